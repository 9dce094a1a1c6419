//! Draws from the posterior in the report.

use crate::page::{Block, Cell, Level, Table};
use crate::plot::typeset;
use ffid::workflow::identify::{IdentificationResult, Sampled, SampledLine, SampledState, num};

/// What draws say, and how far they can be trusted; nothing without any.
pub(super) fn blocks(r: &IdentificationResult) -> Vec<Block> {
    let Some(s) = &r.sampled else { return Vec::new() };
    let state = match s.state {
        SampledState::Converged => "Converged",
        SampledState::NotConverged => "NOT converged, so that no intervals are given",
        SampledState::Interrupted => "Interrupted before they had converged, so that no intervals are given",
        SampledState::NotDrawn => "Nothing was drawn",
    };
    let weighed = match (s.effective_weights, s.pareto_k) {
        (Some(n), Some(k)) => format!(" Their weights are worth {n:.0} equal ones (shape of their tail {k:.2})."),
        (Some(n), None) => format!(" Their weights are worth {n:.0} equal ones."),
        _ => String::new(),
    };
    let mut out = vec![Block::text(format!(
        "{state}: {}. {}; {} chains of {} draws after {} to tune them, seed {}, {} evaluations, {} divergent.{weighed}",
        s.reason, s.sampler, s.chains, s.draws, s.warm_up, s.seed, s.evaluations, s.divergences
    ))];
    if !s.parameters.is_empty() {
        out.push(Block::Table(table("Parameters", &s.parameters)));
    }
    if !s.beside.is_empty() {
        out.push(Block::Details(
            "What was drawn beside them".into(),
            vec![Block::Table(table("Beside them", &s.beside))],
        ));
    }
    out
}

fn table(caption: &str, lines: &[SampledLine]) -> Table {
    let number = |x: Option<f64>| Cell::number(x.map_or_else(String::new, num));
    let range =
        |x: Option<(f64, f64)>| Cell::number(x.map_or_else(String::new, |(a, b)| format!("{} .. {}", num(a), num(b))));
    let row = |l: &SampledLine| {
        let (level, word) = match l.differs {
            Some(d) if d > Sampled::DIFFERS => (Level::Fair, format!("{d:.1} deviations from the fit")),
            Some(d) => (Level::Good, format!("as the fit ({d:.1})")),
            None => (Level::Fair, String::new()),
        };
        vec![
            Cell::words(l.name.clone()),
            number(l.median),
            Cell::words(typeset(&l.unit)),
            number(l.std),
            range(l.interval95),
            range(l.hdi95),
            Cell::number(l.r_hat.map_or_else(String::new, |x| format!("{x:.4}"))),
            Cell::number(l.ess_bulk.map_or_else(String::new, |x| format!("{x:.0}"))),
            Cell::number(l.ess_tail.map_or_else(String::new, |x| format!("{x:.0}"))),
            Cell::Mark(level, word),
        ]
    };
    let head =
        ["name", "median", "unit", "std", "95 % interval", "highest density", "R-hat", "bulk", "tails", "intervals"];
    Table { caption: caption.into(), head: head.map(String::from).to_vec(), rows: lines.iter().map(row).collect() }
}
