//! Which conclusions of the paper survive what it leaves open.

use super::{Outcome, Sweep, gain};
use crate::table::sig;
use serde::Serialize;

/// A conclusion of the paper, in how many trials of all settings it holds, and what that rests on.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Conclusion {
    pub(crate) said: &'static str,
    /// Trials in which it holds, of how many.
    pub(crate) holds: (usize, usize),
    /// In numbers.
    pub(crate) found: String,
}

impl Conclusion {
    /// Whether it holds in all, in some, or in hardly any.
    pub(crate) fn word(&self) -> &'static str {
        match self.holds {
            (_, 0) => "not tried",
            (k, n) if k == n => "holds",
            (k, n) if 10 * k >= 9 * n => "holds but for few",
            (k, n) if 10 * k >= n => "depends on the choice",
            _ => "does not hold",
        }
    }
}

/// Error of the rigid identification against the truth from which it is said to have a significant influence (m): a tenth of the paper's smallest.
const SIGNIFICANT_M: f64 = 1e-3;

/// Every conclusion over all trials of a sweep.
pub(crate) fn conclusions(s: &Sweep) -> Vec<Conclusion> {
    let all = || s.outcomes.iter();
    let trials: usize = all().map(|o| o.ended().count()).sum();
    let count = |holds: &dyn Fn(&super::Columns) -> bool| -> usize { all().map(|o| o.count(holds)).sum() };
    let extreme = |of: &dyn Fn(&Outcome) -> Option<(f64, f64)>| {
        all().filter_map(of).fold((f64::INFINITY, 0.0_f64), |(a, b), (x, y)| (a.min(x), b.max(y)))
    };
    let rigid = extreme(&|o| o.interval(|c| c.rigid_id_vs_truth.mean_pos_m).map(|i| i.range));
    let gains = extreme(&|o| o.interval(|c| gain(c, |e| e.mean_pos_m)).map(|i| i.range));
    let of = |case: &'static str| s.outcomes.iter().filter(move |o| o.case == case);
    let near = |hz: f64, paper: f64| (hz / paper - 1.0).abs() <= 0.1;
    let matched = |o: &&Outcome| [0.23, 0.68].iter().all(|p| o.model_hz.iter().any(|hz| near(*hz, *p)));
    let lowest = of("slosh").flat_map(|o| o.model_hz.iter().copied()).fold(f64::INFINITY, f64::min);
    let turning = of("flex").fold((f64::INFINITY, 0.0_f64), |(a, b), o| (a.min(o.turning_hz), b.max(o.turning_hz)));
    vec![
        Conclusion {
            said: "Panels and fuel have a significant influence on a rigid identification",
            holds: (count(&|c| c.rigid_id_vs_truth.mean_pos_m >= SIGNIFICANT_M), trials),
            found: format!(
                "mean error of the rigid identification against the true satellite {} to {} m; 1 mm or more counts",
                sig(rigid.0, 2),
                sig(rigid.1, 2)
            ),
        },
        Conclusion {
            said: "Modelling them improves the model, judged by the true satellite",
            holds: (count(&|c| gain(c, |e| e.mean_pos_m) > 1.0), trials),
            found: format!("mean position error {} to {} times smaller", sig(gains.0, 2), sig(gains.1, 2)),
        },
        Conclusion {
            said: "... judged as in the paper, by a rigid reference model, in mean position",
            holds: (count(&|c| c.extended_id.mean_pos_m < c.rigid_id.mean_pos_m), trials),
            found: "the reference is rigid, so that the true satellite itself does not follow it (errata, item 23)"
                .into(),
        },
        Conclusion {
            said: "... judged as in the paper, in mean geodesic angle",
            holds: (count(&|c| c.extended_id.mean_angle_rad < c.rigid_id.mean_angle_rad), trials),
            found: "the paper has roll, pitch and yaw; the angle does not depend on axes".into(),
        },
        Conclusion {
            said: "The panels ring at 0.23 and 0.68 Hz (within 10 %)",
            holds: (of("flex").filter(matched).count(), of("flex").count()),
            found: format!(
                "settings, not trials; the mode that turns the base most is at {} to {} Hz",
                sig(turning.0, 3),
                sig(turning.1, 3)
            ),
        },
        Conclusion {
            said: "The fuel swings at 0.06 Hz (within 10 %)",
            holds: (of("slosh").filter(|o| o.model_hz.iter().any(|hz| near(*hz, 0.06))).count(), of("slosh").count()),
            found: format!("settings, not trials; the lowest frequency of any of them is {} Hz", sig(lowest, 3)),
        },
    ]
}
