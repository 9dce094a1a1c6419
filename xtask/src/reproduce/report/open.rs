//! What the paper leaves open, in tables.

use super::super::open::{Conclusion, Outcome, gain};
use super::super::score::Columns;
use super::shown::POINTS;
use crate::reproduce::printed;
use crate::reproduce::summary::Summary;
use crate::table::sig;
use ff_report::page::{Block, Cell, Level, Table};
use ff_report::plot::{Figure, Interval, Intervals};

/// The conclusions of the paper, and what the sweep says of each.
pub(super) fn conclusions(s: &Summary) -> Vec<Block> {
    if s.conclusions.is_empty() {
        return vec![Block::text(
            "This run has tried none of what the paper leaves open; one without --quick, or with --sweep, does.",
        )];
    }
    let row = |c: &Conclusion| {
        let level = match c.holds {
            (k, n) if k == n && n > 0 => Level::Good,
            (k, n) if 10 * k < n => Level::Bad,
            _ => Level::Fair,
        };
        vec![
            Cell::words(c.said),
            Cell::Mark(level, c.word().into()),
            Cell::number(format!("{} of {}", c.holds.0, c.holds.1)),
            Cell::words(c.found.clone()),
        ]
    };
    let caption =
        "Conclusions of the paper over what it leaves open: geometry, posture, tank mount, noise, trajectories";
    let table = Table {
        caption: caption.into(),
        head: ["conclusion", "verdict", "in", "found"].map(String::from).to_vec(),
        rows: s.conclusions.iter().map(row).collect(),
    };
    vec![Block::Table(table)]
}

/// The tables over trials of the mission as it is.
pub(super) fn repeated(s: &Summary, case: &str) -> Vec<Block> {
    let k = usize::from(case != "flex");
    s.sweep.nominal(case).map(|o| printed::repeated(o, k).blocks()).unwrap_or_default()
}

/// Every setting.
///
/// # Errors
/// Those of [`Figure::to_svg`].
pub(super) fn sweep(s: &Summary) -> anyhow::Result<Vec<Block>> {
    let all = &s.sweep.outcomes;
    if all.is_empty() {
        return Ok(vec![]);
    }
    let most = all.iter().map(|o| o.trials.len() + o.failures.len()).max().unwrap_or(0);
    let mut out = vec![Block::text(format!(
        "One choice is changed at a time. The missions as they are have {most} trials each, every setting {}; a trial has the same trajectories at every setting but \
         those of the posture, and noise and starts of its own. More: cargo xtask reproduce --sweep N.",
        s.sweep.per_setting
    ))];
    for (case, title) in [("flex", "Flexible panels"), ("slosh", "Fuel slosh")] {
        let of: Vec<&Outcome> = all.iter().filter(|o| o.case == case).collect();
        out.push(Block::figure(&figure(title, &of), POINTS)?);
        let head = [
            "choice and setting",
            "modes (Hz)",
            "rigid, truth (m)",
            "extended, truth (m)",
            "gain",
            "closer to the rigid reference: position",
            "angle",
        ];
        out.push(Block::Table(Table {
            caption: format!("{title}: mean position errors, noisy records"),
            head: head.map(String::from).to_vec(),
            rows: of.iter().map(|o| row(o)).collect(),
        }));
    }
    let failed: Vec<String> = all.iter().flat_map(failures).collect();
    if !failed.is_empty() {
        out.push(Block::List(failed));
    }
    Ok(out)
}

fn name(o: &Outcome) -> String {
    if o.choice.is_empty() { o.setting.clone() } else { format!("{}: {}", o.choice, o.setting) }
}

fn failures(o: &Outcome) -> Vec<String> {
    let unfinished = o.trials.len() - o.ended().count();
    let place = format!("{}, {}", o.case, name(o));
    let said =
        (unfinished > 0).then(|| format!("{place}: {unfinished} extended fits did not converge and are left out"));
    o.failures.iter().map(|f| format!("{place}: {f}")).chain(said).collect()
}

fn row(o: &Outcome) -> Vec<Cell> {
    let over =
        |f: &dyn Fn(&Columns) -> f64| Cell::number(o.interval(f).map_or_else(|| "none".into(), |x| printed::words(&x)));
    let n = o.ended().count();
    let of = |k: usize| Cell::number(format!("{k} of {n}"));
    vec![
        Cell::words(name(o)),
        Cell::number(o.model_hz.iter().map(|hz| sig(*hz, 3)).collect::<Vec<_>>().join(", ")),
        over(&|c| c.rigid_id_vs_truth.mean_pos_m),
        over(&|c| c.extended_id_vs_truth.mean_pos_m),
        over(&|c| gain(c, |e| e.mean_pos_m)),
        of(o.count(|c| c.extended_id.mean_pos_m < c.rigid_id.mean_pos_m)),
        of(o.count(|c| c.extended_id.mean_angle_rad < c.rigid_id.mean_angle_rad)),
    ]
}

/// Errors of both models against the truth at every setting, on one scale.
fn figure(title: &str, of: &[&Outcome]) -> Figure {
    let row = |o: &&Outcome| {
        let range = |pick: fn(&Columns) -> f64, colour: usize| {
            let x = o.interval(pick)?;
            Some(Interval { low: x.range.0, high: x.range.1, at: Some(x.mean), colour, wide: false })
        };
        let rigid = range(|c| c.rigid_id_vs_truth.mean_pos_m, 1);
        let extended = range(|c| c.extended_id_vs_truth.mean_pos_m, 0);
        (name(o), rigid.into_iter().chain(extended).collect())
    };
    let intervals = Intervals {
        x_label: "mean position error against the true satellite (m)".into(),
        log_x: true,
        legend: vec![("rigid model".into(), 1), ("extended model".into(), 0)],
        rows: of.iter().map(row).collect(),
        ..Intervals::default()
    };
    Figure::new(format!("{title}: what each choice does"))
        .intervals(intervals)
        .caption("Dots: geometric means over the trials; bars: from the least to the greatest.")
}
