//! Tolerances of the reproduction; outside one, the exit code is 15.

use super::score::Columns;
use super::summary::Summary;
use ffid::exit::Failure;

/// Compares every promised figure with its limit.
///
/// # Errors
/// [`Failure::Tolerance`] listing everything outside.
pub(super) fn all(s: &Summary) -> anyhow::Result<()> {
    let bad = outside(s);
    if bad.is_empty() { Ok(()) } else { Err(Failure::Tolerance(bad.join("\n")).into()) }
}

/// Everything outside its limit, in words.
pub(super) fn outside(s: &Summary) -> Vec<String> {
    let mut bad = Vec::new();
    // `--quick` has a third of the data and a shorter comparison; its limits are looser but can fail.
    let (free, noisy) = if s.quick { (100.0, 5.0) } else { (100.0, 30.0) };
    for (name, runs) in [("table2", &s.table2), ("table3", &s.table3)] {
        for (run, c, least) in [("noise_free", &runs.noise_free, free), ("noisy", &runs.noisy, noisy)] {
            for (what, gain) in gains(c) {
                if gain.is_nan() || gain < least {
                    bad.push(format!("{name}.{run}: gain in {what} is {gain:.1}, limit >= {least}"));
                }
            }
        }
    }
    for (name, f) in [("fig5", &s.fig5), ("fig7", &s.fig7)] {
        if f.measured_hz.is_empty() {
            bad.push(format!("{name}: no mode was measured"));
        }
        for hz in &f.measured_hz {
            let off = f.model_hz.iter().map(|m| (m - hz).abs()).fold(f64::INFINITY, f64::min);
            if off > f.resolution_hz {
                bad.push(format!(
                    "{name}: measured {hz:.4} Hz is {off:.4} Hz from any eigenvalue, limit {:.4}",
                    f.resolution_hz
                ));
            }
        }
    }
    for paper in &s.fig5.paper_hz {
        let off = s.fig5.measured_hz.iter().map(|m| (m / paper - 1.0).abs()).fold(f64::INFINITY, f64::min);
        if off > 0.1 {
            bad.push(format!(
                "fig5: nearest measured mode is {:.0} % from the paper's {paper} Hz, limit 10 %",
                100.0 * off
            ));
        }
    }
    for r in s.identified.iter().filter(|r| r.is("noise_free", "extended")) {
        if r.worst().is_nan() || r.worst() > 1e-6 {
            bad.push(format!("{}: worst identifiable combination is off by {:.1e}, limit 1e-6", r.title(), r.worst()));
        }
    }
    bad
}

/// Rigid over extended error against the truth, mean position and mean angle.
fn gains(c: &Columns) -> [(&'static str, f64); 2] {
    let (r, e) = (&c.rigid_id_vs_truth, &c.extended_id_vs_truth);
    [("mean position", r.mean_pos_m / e.mean_pos_m), ("mean angle", r.mean_angle_rad / e.mean_angle_rad)]
}
