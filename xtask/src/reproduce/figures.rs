//! Figs. 4 to 7: series as CSV, figures as SVG and PNG.

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
    let names = x.loaded.model.joint_names();
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
    let what = if x.name == "flex" { "Flexible panels" } else { "Fuel slosh" };
    let response = Figure::new(format!("{what}: response to the manoeuvre"))
        .panel(torque.x_range(0.0, end).vline(x.ring_from, "joints hold"))
        .panel(rate.x_range(0.0, end).vline(x.ring_from, "joints hold"))
        .caption("Noise-free simulation; the joints move until the marked time and are held from then on.");
    response.write(&out.join(time))?;

    let top = 1.5;
    let cut = |p: &Psd| -> (Vec<f64>, Vec<f64>) {
        p.frequency.iter().zip(&p.density).filter(|(f, _)| **f > 0.0 && **f <= top).map(|(f, d)| (*f, *d)).unzip()
    };
    let mut fig = Figure::new(format!("{what}: power spectral densities"));
    let panels = [
        ("A) response of torques and gyro, each in units of its noise", "PSD (1/Hz)", &s.response, "answer"),
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
        if name == "answer" {
            for hz in f.combination_tones_hz.iter().filter(|hz| **hz < top) {
                p.vlines.push(VLine {
                    x: *hz,
                    label: format!("{hz:.3} sum or difference"),
                    colour: Some(3),
                    solid: false,
                });
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
        "Marked: free-floating natural frequencies of the model (Hz); in A also tones at sums and differences of them, which the free decay \
         of a nonlinear system has. Spectra B to D are padded with zeros, eight times the length of the trajectory.",
    );
    spectra.write(&out.join(spectrum))?;
    Ok([response, spectra])
}
