//! `cargo xtask study degeneracies`: what cannot be known is named, and nothing else is.
//!
//! 20 systems and records with a degeneracy that was built in, each with the number of null directions that mechanics demands
//! and, where it is a matter of names, the parameters that they must touch. A case is named when
//!
//! * there are as many null directions as there must be, with a gap of at least 1,000 in the singular values,
//! * the parameters without a deviation are those of the degeneracy,
//! * and no direction is false: moving the parameters along it changes nothing, on motions that the analysis has not seen
//!   (structural ones) or in the record itself (the others).
mod cases;
mod robots;

use super::figures::{Op, Study};
use super::options::Options;
use super::trials::Trials;
use ident::Uncertainty;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Change of a prediction along a null direction, relative to that of the loudest parameter, that still counts as none.
const SILENT: f64 = 1e-9;
/// Ratio of singular values on the two sides of the rank.
const GAP: f64 = 1e3;

/// A system with a degeneracy.
pub(super) struct Case {
    name: &'static str,
    /// Null directions that there must be.
    expected: usize,
    /// The parameters that must be touched, if it is a matter of names.
    touched: Option<Vec<String>>,
    /// Parameters that must not be.
    untouched: Vec<String>,
    /// What the analysis says.
    found: Uncertainty,
    /// Sensitivities (rows: predictions that were not analysed, or the record; columns: the same unknowns).
    proof: DMatrix<f64>,
}

/// What came of one case.
#[derive(Serialize, Deserialize)]
struct Verdict {
    named: bool,
    /// Null directions that change what was not analysed.
    false_directions: usize,
    /// The case in words, and its first null directions.
    lines: Vec<String>,
}

/// Runs the study.
///
/// # Errors
/// Systems that cannot be computed; none of these should.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("degeneracies", options.seed);
    let trials = Trials::open("degeneracies", 1, options)?;
    let cases = cases::all(options.seed);
    let all = trials.run("all", 0..cases.len() as u64, |t| Ok(judge(&cases[t.number as usize]()?)))?;
    all.iter().flat_map(|v| &v.lines).for_each(|line| study.note(line));
    trials.note().into_iter().for_each(|n| study.note(n));
    study.figure("cases", "", all.len() as f64);
    let named = all.iter().filter(|v| v.named).count();
    study.limited("named", "", named as f64, Op::AtLeast, 20.0);
    let false_ones: usize = all.iter().map(|v| v.false_directions).sum();
    study.limited("false_directions", "", false_ones as f64, Op::AtMost, 0.0);
    Ok(study)
}

fn judge(case: &Case) -> Verdict {
    let u = &case.found;
    let null = u.unknowns.len() - u.rank;
    let gap = if null > 0 && u.rank > 0 {
        u.singular_values[u.rank - 1] / u.singular_values[u.rank].max(f64::MIN_POSITIVE)
    } else {
        f64::INFINITY
    };
    let touched: Vec<&str> =
        u.unknowns.iter().zip(&u.deviation).filter(|(_, d)| d.is_none()).map(|(k, _)| k.name.as_str()).collect();
    let names = case
        .touched
        .as_ref()
        .is_none_or(|want| want.len() == touched.len() && want.iter().all(|w| touched.contains(&w.as_str())));
    let spared = case.untouched.iter().all(|w| !touched.contains(&w.as_str()));
    let loud = loudest(case);
    let wrong = loud.iter().filter(|l| **l > SILENT).count();
    let ok = null == case.expected && gap >= GAP && names && spared && wrong == 0;
    let worst = loud.iter().fold(0.0f64, |m, l| m.max(*l));
    let mut lines = vec![format!(
        "{:34} {:2} unknowns, {null:2} null directions ({} expected), gap {gap:.0e}, change along them {worst:.0e}{}",
        case.name,
        u.unknowns.len(),
        case.expected,
        if ok { String::new() } else { format!("  NOT NAMED; touched: {}", touched.join(", ")) },
    )];
    lines.extend(u.null.iter().take(4).map(|d| format!("    {d}")));
    if null > 4 {
        lines.push(format!("    and {} more", null - 4));
    }
    Verdict { named: ok, false_directions: wrong, lines }
}

/// For every null direction: how much a relative change of one along it changes what was not analysed, relative to the most that a
/// single parameter changes.
fn loudest(case: &Case) -> Vec<f64> {
    let u = &case.found;
    let single = (0..u.unknowns.len()).map(|i| case.proof.column(i).norm() * u.unknowns[i].size).fold(0.0, f64::max);
    let column = |k: usize| {
        let v = DVector::from_fn(u.unknowns.len(), |i, _| u.directions[(i, k)] * u.unknowns[i].size);
        (&case.proof * v).norm() / single
    };
    (u.rank..u.unknowns.len()).map(column).collect()
}
