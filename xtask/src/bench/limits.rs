//! What must be reached (issues 3, 6 and 22), and whether it is.
//!
//! Every ratio is one of medians of the same run. The portable build counts; `ports`, the form users have, counts.

use super::build::Target;
use super::cell::{Cell, split_lanes};
use super::models::MODELS;
use super::tasks::Tasks;
use std::collections::BTreeMap;

/// One row of the table of issue 3: ours over the best Pinocchio.
pub struct Row {
    /// Name of the function in `ff-bench`.
    pub name: &'static str,
    /// One state at a time, at most.
    pub single: f64,
    /// Per state, several at a time, at most.
    pub batched: f64,
}

/// The table.
pub const FUNCTIONS: [Row; 6] = [
    Row { name: "rnea", single: 0.5, batched: 0.08 },
    Row { name: "crba", single: 0.6, batched: 0.1 },
    Row { name: "fd", single: 0.6, batched: 0.12 },
    Row { name: "hybrid", single: 0.35, batched: 0.07 },
    Row { name: "regressor", single: 0.5, batched: 0.15 },
    Row { name: "id_derivatives", single: 0.6, batched: 0.15 },
];

/// A minute of the flexible system against the best peer program; per trajectory when several run in lanes.
pub const SIMULATE: (f64, f64) = (1.0 / 3.0, 1.0 / 15.0);
/// Sensitivities of 58 parameters against our own plain simulation.
pub const SENSITIVITIES: f64 = 6.0;
/// The peers' identification of 15 parameters against C++ with Pinocchio, and least squares over a regressor against NumPy's
/// pivoted QR (issue 6).
pub const FITS: (f64, f64) = (1.0 / 40.0, 1.0 / 20.0);
/// Seconds for all 58 parameters under a prior, 60 s at 100 Hz (issue 6).
pub const IDENTIFY58_S: f64 = 1.0;
/// The same beside 40 errors of sensors, masses and placements, against the time without (issue 22).
pub const UNCERTAIN: f64 = 2.5;
/// The portable build against the native one.
pub const PORTABLE: f64 = 1.5;

/// One limit.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Limit {
    /// What was measured; `None` where nothing was, or nothing to compare with.
    pub ratio: Option<f64>,
    /// At most this.
    pub limit: f64,
    /// `None` where it cannot be told, because no peers were asked for.
    pub pass: Option<bool>,
}

/// Every limit by name, such as `flex.rnea.batched`.
pub fn evaluate(cells: &[Cell], tasks: &Tasks, with_peers: bool) -> BTreeMap<String, Limit> {
    let mut all = BTreeMap::new();
    let mut put = |name: String, ratio: Option<f64>, limit: f64, against_peers: bool| {
        // What should have been measured and was not is a failure, not an unknown.
        let unknown = ratio.is_none() && against_peers && !with_peers;
        let pass = if unknown { None } else { Some(ratio.is_some_and(|r| r <= limit)) };
        all.insert(name, Limit { ratio, limit, pass });
    };
    for row in &FUNCTIONS {
        for model in MODELS {
            let single = best(cells, model, row.name, false, Target::Portable).and_then(Cell::ratio);
            let batched = best(cells, model, row.name, true, Target::Portable).and_then(Cell::ratio);
            put(format!("{model}.{}", row.name), single, row.single, true);
            put(format!("{model}.{}.batched", row.name), batched, row.batched, true);
        }
        for (suffix, lanes) in [("", false), (".batched", true)] {
            let [portable, native] =
                [Target::Portable, Target::Native].map(|t| best(cells, "flex", row.name, lanes, t).map(|c| c.ours));
            let ratio = portable.zip(native).map(|(p, n)| p.median / n.median);
            put(format!("portable_vs_native.{}{suffix}", row.name), ratio, PORTABLE, false);
        }
    }
    put("flex.simulate_60s".into(), tasks.simulation_ratio(false), SIMULATE.0, true);
    put("flex.simulate_60s.batched".into(), tasks.simulation_ratio(true), SIMULATE.1, true);
    put("flex.sensitivities58".into(), tasks.sensitivities_ratio(), SENSITIVITIES, false);
    put("flex.identify15".into(), tasks.fit_ratio("identify15"), FITS.0, true);
    put("rigid.least_squares".into(), tasks.fit_ratio("least_squares"), FITS.1, true);
    put("flex.identify58_s".into(), tasks.fit_seconds("identify58"), IDENTIFY58_S, false);
    let uncertain = tasks.fit_seconds("identify58_uncertain").zip(tasks.fit_seconds("identify58")).map(|(u, s)| u / s);
    put("flex.identify58_uncertain".into(), uncertain, UNCERTAIN, false);
    all
}

/// The cell that counts: the ports form; of several numbers of lanes the fastest.
fn best<'a>(cells: &'a [Cell], model: &str, function: &str, lanes: bool, target: Target) -> Option<&'a Cell> {
    cells
        .iter()
        .filter(|c| c.model == model && c.form == "ports" && c.target == target)
        .filter(|c| split_lanes(&c.function) == (function, lanes))
        .min_by(|a, b| a.ours.median.total_cmp(&b.ours.median))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::aggregate::Spread;

    fn cell(function: &str, form: &str, target: Target, ns: f64) -> Cell {
        let spread = |x: f64| Spread { median: x, min: 0.9 * x, max: 1.1 * x };
        let (model, function, form) = ("flex".into(), function.into(), form.into());
        Cell { model, function, form, target, ours: spread(ns), pinocchio: Some(spread(800.0)), mujoco: None }
    }

    #[test]
    fn every_cell_of_the_table_is_there() {
        let all = evaluate(&[], &Tasks::default(), true);
        assert_eq!(all.len(), 6 * 3 * 2 + 6 * 2 + 7);
        for name in ["slosh.id_derivatives.batched", "rigid.hybrid", "flex.simulate_60s", "portable_vs_native.fd"] {
            assert_eq!(all[name].pass, Some(false), "{name}: what was not measured does not pass");
        }
        // Without peers nothing can be said about ratios to them.
        let all = evaluate(&[], &Tasks::default(), false);
        assert_eq!(all["flex.rnea"].pass, None);
        assert_eq!(all["flex.sensitivities58"].pass, Some(false));
    }

    #[test]
    fn the_portable_ports_form_counts_and_the_best_width() {
        let cells = [
            cell("rnea", "tree", Target::Portable, 100.0),
            cell("rnea", "ports", Target::Native, 160.0),
            cell("rnea", "ports", Target::Portable, 240.0),
            cell("rnea.x4", "ports", Target::Portable, 72.0),
            cell("rnea.x8", "ports", Target::Portable, 56.0),
        ];
        let all = evaluate(&cells, &Tasks::default(), true);
        assert_eq!(all["flex.rnea"], Limit { ratio: Some(0.3), limit: 0.5, pass: Some(true) });
        assert_eq!(all["flex.rnea.batched"], Limit { ratio: Some(0.07), limit: 0.08, pass: Some(true) });
        assert_eq!(all["portable_vs_native.rnea"], Limit { ratio: Some(1.5), limit: 1.5, pass: Some(true) });
        assert_eq!(all["portable_vs_native.rnea.batched"].pass, Some(false));
    }
}
