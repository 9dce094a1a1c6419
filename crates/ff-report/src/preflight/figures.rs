//! Figures of a verdict.

use crate::plot::{Figure, Panel, Series};
use ff_spectral::Psd;
use ffid::workflow::preflight::{Determination, Preflight};
use ffid::workflow::preflight::{angle, displacement};
use nalgebra::DMatrix;

/// Spectra are shown up to this many times the highest mode.
const ABOVE: f64 = 1.6;
/// Most parameters named in a figure.
const NAMED: usize = 40;
/// Highest frequency shown without modes (Hz).
const TOP: f64 = 2.0;

fn panel(m: &DMatrix<f64>, names: &[String], t: &[f64], label: &str) -> Panel {
    let mut p = Panel::new("time (s)", label);
    p.height = 170.0;
    for (k, n) in names.iter().enumerate() {
        p.series.push(Series::new(n.as_str(), t, m.column(k).as_slice()));
    }
    p
}

/// The figures of a verdict with their file stems: `trajectory`, `response`, `spectrum`, `deviations`. Allocates.
pub fn figures(v: &Preflight) -> Vec<(&'static str, Figure)> {
    vec![
        ("trajectory", trajectory(v)),
        ("response", response(v)),
        ("spectrum", spectrum(v)),
        ("deviations", deviations(v)),
    ]
}

fn trajectory(v: &Preflight) -> Figure {
    let t = v.trace.times();
    let quiet = |mut p: Panel| {
        p.series.iter_mut().for_each(|s| s.label.clear());
        p
    };
    Figure::new(format!("{}: joint motion", v.robot))
        .panel(panel(&v.trace.q, &v.joints, &t, "position (rad, m)"))
        .panel(quiet(panel(&v.trace.qd, &v.joints, &t, "speed (rad/s)")))
        .panel(quiet(panel(&v.trace.qdd, &v.joints, &t, "acceleration (rad/s^2)")))
}

fn response(v: &Preflight) -> Figure {
    let x = &v.trace;
    let t = x.times();
    let axes = ["x", "y", "z"].map(str::to_owned);
    let attitude: Vec<f64> = (0..x.len()).map(|i| angle(x, i)).collect();
    let moved = DMatrix::from_fn(x.len(), 3, |i, k| displacement(x, i)[k]);
    let mut turned = Panel::new("time (s)", "base attitude (rad)").curve("angle from the start", &t, &attitude);
    turned.height = 120.0;
    let mut fig = Figure::new(format!("{}: what the sensors will read, and what the base does", v.robot))
        .panel(panel(&x.tau, &v.joints, &t, "joint torque (N m)"))
        .panel(panel(&x.gyro(), &axes, &t, "base rate (rad/s)"))
        .panel(turned)
        .panel(panel(&moved, &axes, &t, "base position (m)"));
    if !v.passive.is_empty() {
        fig = fig.panel(panel(&x.eta, &v.passive, &t, "passive (rad, m)"));
    }
    fig.caption("Simulated without noise at the mission's nominal parameters.")
}

fn spectrum(v: &Preflight) -> Figure {
    let s = &v.spectrum;
    let top = s.modes.last().map_or(TOP, |m| ABOVE * m.frequency_hz).min(0.5 * v.sensing.rate_hz);
    let cut = |p: &Psd| -> (Vec<f64>, Vec<f64>) {
        let shown = p.frequency.iter().zip(&p.density).filter(|(f, _)| **f > 0.0 && **f <= top);
        shown.map(|(f, d)| (*f, *d)).unzip()
    };
    let mut fig = Figure::new(format!("{}: excitation against the modes", v.robot));
    for (title, unit, psd) in [
        ("A) joint accelerations, summed over joints", "PSD (rad^2/s^4/Hz)", &s.joints),
        ("B) angular acceleration of the base", "PSD (rad^2/s^4/Hz)", &s.base[0]),
        ("C) linear acceleration of the base", "PSD (m^2/s^4/Hz)", &s.base[1]),
    ] {
        let (f, d) = cut(psd);
        let mut p = Panel::log_y("frequency (Hz)", unit).titled(title).curve("", &f, &d).x_range(0.0, top);
        p.height = 190.0;
        for m in &s.modes {
            p = p.vline(m.frequency_hz, format!("{:.3}", m.frequency_hz));
        }
        if let Some((a, b)) = s.band_hz {
            p = p.band(a, b, "");
        }
        fig = fig.panel(p);
    }
    fig.caption("Marked: natural frequencies at the start pose, joints held (Hz). Shaded: the flexible band.")
}

/// A stem for each parameter, from the lowest decade to its relative standard deviation.
fn deviations(v: &Preflight) -> Figure {
    let known: Vec<(usize, f64)> =
        v.parameters.iter().enumerate().filter_map(|(k, p)| Some((k, p.relative_std?))).collect();
    let low = known.iter().map(|(_, r)| *r).fold(v.weak_above, f64::min);
    let high = known.iter().map(|(_, r)| *r).fold(v.weak_above, f64::max);
    let floor = 10f64.powf(low.log10().floor() - 0.5);
    let mut p = Panel::log_y("parameter, in the order of the report, from 0", "relative standard deviation");
    p.height = 300.0;
    p = p.x_range(-0.7, v.parameters.len() as f64 - 0.3).y_range(floor, 10f64.powf(high.log10().ceil()));
    let edge = [-0.7, v.parameters.len() as f64 - 0.3];
    p.series.push(Series::new("weak above", &edge, &[v.weak_above; 2]).dashed().colour(1));
    for (k, r) in &known {
        let x = *k as f64;
        // A bar, drawn as a closed outline.
        let (xs, ys) = ([x - 0.3, x - 0.3, x + 0.3, x + 0.3], [floor, *r, *r, floor]);
        p.series.push(Series::new("", &xs, &ys).colour(if v.parameters[*k].told == Determination::Weakly {
            1
        } else {
            0
        }));
    }
    // More names than that cannot be read.
    for (k, q) in v.parameters.iter().enumerate().filter(|_| v.parameters.len() <= NAMED) {
        p = p.vline(k as f64, q.name.clone());
    }
    let silent: Vec<&str> =
        v.parameters.iter().filter(|p| p.told == Determination::NotAtAll).map(|p| p.name.as_str()).collect();
    let caption = if silent.is_empty() {
        "Predicted for one record, biases and initial state estimated beside.".to_owned()
    } else {
        format!("Predicted for one record. The record is silent on {}.", silent.join(", "))
    };
    Figure::new(format!("{}: how well the parameters will be known", v.robot)).panel(p).caption(caption)
}
