//! The excitation and Figs. 4 to 7: series as CSV, figures as SVG and PNG.

use super::experiment::Experiment;
use super::spectra::{Frequencies, Spectra};
use ff_report::plot::{Figure, Panel, VLine};
use ff_spectral::Psd;
use ffid::files::csv_out;
use ffid::files::csv_out::Column;
use std::path::Path;

/// Writes the time figure (torques over base rate) and the spectrum figure of one case, and returns them.
pub(super) fn write(
    out: &Path,
    time: &str,
    spectrum: &str,
    x: &Experiment,
    s: &Spectra,
    f: &Frequencies,
) -> anyhow::Result<[Figure; 2]> {
    let t = x.ringing.times();
    let names = x.system.model().joint_names();
    let gyro = x.ringing.gyro();
    let tau: Vec<Vec<f64>> = (0..names.len()).map(|j| x.ringing.tau.column(j).iter().copied().collect()).collect();
    let rates: Vec<Vec<f64>> = (0..3).map(|j| gyro.column(j).iter().copied().collect()).collect();
    let mut columns = vec![Column::new("time", "s", &t)];
    let mut torque = Panel::new("time (s)", "joint torque (N m)");
    for (n, y) in names.iter().zip(&tau) {
        columns.push(Column::new(format!("tau.{n}"), "N m", y));
        torque = torque.curve(n.as_str(), &t, y);
    }
    let mut rate = Panel::new("time (s)", "base rate (rad/s)");
    for (n, y) in ["x", "y", "z"].iter().zip(&rates) {
        columns.push(Column::new(format!("gyro.{n}"), "rad/s", y));
        rate = rate.curve(format!("about {n}"), &t, y);
    }
    csv_out::write(&out.join(format!("{time}.csv")), &columns)?;
    let end = t.last().copied().unwrap_or(0.0).min(x.ring_from + 40.0);
    let what = what(x);
    let number = |stem: &str| stem.replacen("fig", "Fig. ", 1);
    let response = Figure::new(format!("{}: response to the manoeuvre, {what}", number(time)))
        .panel(torque.x_range(0.0, end).vline(x.ring_from, "joints hold"))
        .panel(rate.x_range(0.0, end).vline(x.ring_from, "joints hold"))
        .caption("Noise-free simulation; the joints move until the marked time and are held from then on.");
    response.write(&out.join(time))?;

    let top = 1.5;
    let cut = |p: &Psd| -> (Vec<f64>, Vec<f64>) {
        p.frequency.iter().zip(&p.density).filter(|(f, _)| **f > 0.0 && **f <= top).map(|(f, d)| (*f, *d)).unzip()
    };
    let mut fig = Figure::new(format!("{}: power spectral densities, {what}", number(spectrum)));
    let panels = [
        ("A) response of torques and gyro, each in units of its noise", "PSD (1/Hz)", &s.response, "response"),
        ("B) joint accelerations of the manoeuvre", "PSD (rad^2/s^4/Hz)", &s.manoeuvre, "manoeuvre"),
        (
            "C) joint accelerations of the identification trajectory",
            "PSD (rad^2/s^4/Hz)",
            &s.identification,
            "identification",
        ),
        (
            "D) joint accelerations of the trajectory for the rigid identification",
            "PSD (rad^2/s^4/Hz)",
            &s.quiet,
            "quiet",
        ),
    ];
    // Trajectories are compared on one range: the largest density above 0.02 Hz and five decades below it.
    let highest = [&s.manoeuvre, &s.identification, &s.quiet]
        .iter()
        .flat_map(|p| p.frequency.iter().zip(&p.density).filter(|(f, _)| **f > 0.02 && **f <= top).map(|(_, d)| *d))
        .fold(f64::MIN_POSITIVE, f64::max);
    let high = 10f64.powf(highest.log10().ceil());
    for (title, unit, psd, name) in panels {
        let (fx, fy) = cut(psd);
        csv_out::write(
            &out.join(format!("{spectrum}_{name}.csv")),
            &[Column::new("frequency", "Hz", &fx), Column::new("psd", "1/Hz", &fy)],
        )?;
        let mut p = Panel::log_y("frequency (Hz)", unit).titled(title).curve("", &fx, &fy).x_range(0.0, top);
        if name == "response" {
            for tone in f.combination_tones.iter().filter(|t| t.hz < top) {
                p.vlines.push(VLine { x: tone.hz, label: tone.words(), colour: Some(3), solid: false });
            }
            for hz in &f.paper_hz {
                p.vlines.push(VLine { x: *hz, label: format!("paper {hz:.2}"), colour: Some(1), solid: false });
            }
        } else {
            p = p.y_range(1e-5 * high, high);
        }
        for m in &f.model_hz {
            p = p.vline(*m, format!("{m:.3}"));
        }
        fig = fig.panel(p);
    }
    let spectra = fig.caption(
        "Marked in grey: free-floating natural frequencies of the model (Hz); in A also what the paper reads, and tones at sums and \
         differences of modes, which the free decay of a nonlinear system has. Signals are padded with zeros to eight times their length.",
    );
    spectra.write(&out.join(spectrum))?;
    Ok([response, spectra])
}

fn what(x: &Experiment) -> &'static str {
    if x.system.name == "flex" { "flexible panels" } else { "fuel slosh" }
}

/// Writes the joint rates of every trajectory of a case, and returns the figure.
pub(super) fn excitation(out: &Path, stem: &str, x: &Experiment) -> anyhow::Result<Figure> {
    const STEP_S: f64 = 0.02;
    let names = x.system.model().joint_names();
    let limit = x.system.limits.iter().map(|l| l.velocity).fold(0.0, f64::max);
    let mut figure = Figure::new(format!("Joint rates of the trajectories, {}", what(x)));
    for (k, (name, motion)) in x.motions().into_iter().enumerate() {
        // The manoeuvre ends where the joints hold.
        let end = if k == 0 { x.ring_from + 1.0 } else { motion.duration() };
        let t: Vec<f64> = (0..=(end / STEP_S) as usize).map(|i| i as f64 * STEP_S).collect();
        let n = names.len();
        let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut rates = vec![Vec::with_capacity(t.len()); n];
        for &u in &t {
            motion.eval(u, &mut q, &mut qd, &mut qdd);
            rates.iter_mut().zip(&qd).for_each(|(r, v)| r.push(*v));
        }
        let mut p = Panel::new("time (s)", "joint rate (rad/s)").titled(format!("{}) {name}", ["A", "B", "C", "D"][k]));
        p = p.y_range(-1.15 * limit, 1.15 * limit);
        p.height = 150.0;
        let mut columns = vec![Column::new("time", "s", &t)];
        for (joint, y) in names.iter().zip(&rates) {
            columns.push(Column::new(format!("dq.{joint}"), "rad/s", y));
            p = p.curve(if k == 0 { joint.as_str() } else { "" }, &t, y);
        }
        csv_out::write(&out.join(format!("{stem}_{}.csv", name.replace(' ', "-"))), &columns)?;
        figure = figure.panel(p);
    }
    let figure = figure.caption(format!(
        "A: the paper's simplified manoeuvre. B: planned, most information on the base. C: planned, much information and little effect of the modes. D: random at \
         the limits of {limit} rad/s; models are compared along it."
    ));
    figure.write(&out.join(stem))?;
    Ok(figure)
}
