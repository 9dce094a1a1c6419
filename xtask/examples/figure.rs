//! Draws a sample of every feature of the figures into `target/figure-sample/`.
//!
//! `cargo run -p xtask --example figure`

use ff_report::plot::{Figure, Panel, Series, VLine};
use std::f64::consts::TAU;

fn main() -> anyhow::Result<()> {
    let dir = xtask::workspace::root()?.join("target/figure-sample");
    let t: Vec<f64> = (0..6000).map(|i| f64::from(i) * 0.01).collect();
    let decay = |a: f64, f: f64, z: f64| -> Vec<f64> {
        t.iter().map(|t| a * (-z * TAU * f * t).exp() * (TAU * f * t).cos()).collect()
    };
    let mut torque = Panel::new("time (s)", "joint torque (N m)").titled("Joint torques").band(0.0, 8.0, "excitation");
    for (j, a) in [0.3, 4.0, 0.2, -3.1, 0.1, 0.9, 0.05].into_iter().enumerate() {
        let (slow, fast) = (decay(a, 0.23, 0.007), decay(0.4 * a, 0.68, 0.021));
        let y: Vec<f64> = slow.iter().zip(&fast).map(|(a, b)| a + b).collect();
        torque.series.push(Series::new(format!("joint {}", j + 1), &t, &y));
    }
    let rate = Panel::new("time (s)", "base angular rate (rad/s)")
        .titled("Base")
        .curve("ω_x", &t, &decay(4e-4, 0.23, 0.007))
        .curve("ω_y", &t, &decay(-1e-4, 0.68, 0.02))
        .curve("ω_z", &t, &decay(2e-5, 0.113, 0.004));
    Figure::new("Fig. 4: free response of the flexible system")
        .panel(torque)
        .panel(rate)
        .caption(
            "Joint torques and base angular rate after the manoeuvre (shaded), joints held. A sample drawn by \
             `cargo run -p xtask --example figure` from invented decaying oscillations; no result of the project.",
        )
        .write(&dir.join("time"))?;

    let f: Vec<f64> = (1..3000).map(|i| f64::from(i) * 5e-4).collect();
    let peak = |f0: f64, z: f64, f: f64| 1.0 / ((f * f - f0 * f0).powi(2) + (2.0 * z * f0 * f).powi(2));
    let psd =
        |a: f64| -> Vec<f64> { f.iter().map(|&f| a * (peak(0.231, 0.007, f) + 9.0 * peak(0.68, 0.02, f))).collect() };
    let mut panel = Panel::log_y("frequency (Hz)", "PSD ((N m)²/Hz)")
        .titled("A) answer of the flexible appendages")
        .curve("joint 2", &f, &psd(1.0))
        .curve("joint 4", &f, &psd(0.02))
        .x_range(0.0, 1.5);
    panel.series.push(Series::new("model", &f, &psd(0.3)).dashed());
    for (k, (x, label)) in
        [(0.231, "measured 0.231 Hz"), (0.2314, "model 0.2314 Hz"), (0.23, "paper 0.23 Hz"), (0.68, "paper 0.68 Hz")]
            .into_iter()
            .enumerate()
    {
        panel.vlines.push(VLine { x, label: label.into(), colour: (k < 2).then_some(k), solid: k == 0 });
    }
    for p in Figure::new("Fig. 5: power spectral density").panel(panel).write(&dir.join("psd"))? {
        println!("{}", p.display());
    }
    Ok(())
}
