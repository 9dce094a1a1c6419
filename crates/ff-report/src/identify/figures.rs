//! Figures of a result: signals, residuals and their spectra with the modes marked.

use crate::plot::{Figure, Panel, Series};
use ff_spectral::Welch;
use ffid::workflow::identify::ModeLine;
use ffid::workflow::identify::Signals;

/// Most channels in one figure.
const CHANNELS: usize = 10;
/// Zeros after a window, in its lengths: lines closer than the resolution, so that a short record gives a curve.
const PADDED: usize = 4;
/// Spectra are shown up to this many times the highest mode, if that is less than half the sampling rate.
const ABOVE: f64 = 4.0;

/// Measured and predicted signals, one panel per channel. `title` is that of the record.
pub fn signals(s: &Signals, title: &str) -> Figure {
    let mut fig = Figure::new(title.to_owned());
    for k in 0..s.names.len().min(CHANNELS) {
        let mut p = Panel::new("time (s)", s.units[k]).titled(s.names[k].as_str());
        p.height = 150.0;
        let label = |l: &str| if k == 0 { l.to_owned() } else { String::new() };
        let [time, measured, predicted] = s.curve(k);
        p.series.push(Series::new(label("measured"), &time, &measured).colour(5));
        p.series.push(Series::new(label("predicted"), &time, &predicted).colour(1));
        fig = fig.panel(p);
    }
    left_out(fig, s)
}

/// Residuals over time, in multiples of the noise.
pub fn residuals(s: &Signals, title: &str) -> Figure {
    let mut fig = Figure::new(title.to_owned());
    for k in 0..s.names.len().min(CHANNELS) {
        let [time, measured, predicted] = s.curve(k);
        let scaled: Vec<f64> = measured.iter().zip(&predicted).map(|(m, p)| (m - p) / s.sigma[k]).collect();
        let mut p = Panel::new("time (s)", "times the noise").titled(s.names[k].as_str()).curve("", &time, &scaled);
        p.height = 120.0;
        fig = fig.panel(p);
    }
    left_out(fig, s)
}

/// Spectra of signal and residual of torques and gyro, with the modes of the identified model. `None` for a record too
/// short for a spectrum.
pub fn spectra(s: &Signals, modes: &[ModeLine], title: &str) -> Option<Figure> {
    // Channels at rates of their own are left out of a common axis.
    let n = (0..s.names.len()).map(|k| s.curve(k)[0].len()).min().unwrap_or(0);
    if 10 * n < 9 * s.time.len() {
        return None;
    }
    let rate = if n > 1 { (n - 1) as f64 / s.time[s.time.len() - 1] } else { return None };
    // Half the record: three windows to average over.
    let mut welch = Welch::new((n / 2).max(8), rate).ok()?.padded(PADDED);
    let top = modes.last().map_or(0.5 * rate, |m| ABOVE * m.frequency_hz).min(0.5 * rate);
    let mut fig = Figure::new(title.to_owned());
    let mut any = false;
    for k in 0..s.names.len().min(CHANNELS) {
        let [_, measured, predicted] = s.curve(k);
        let residual: Vec<f64> = measured.iter().zip(&predicted).map(|(m, p)| m - p).collect();
        let (Ok(signal), Ok(residual)) = (welch.run(&measured), welch.run(&residual)) else {
            continue;
        };
        let cut = |p: &ff_spectral::Psd| -> (Vec<f64>, Vec<f64>) {
            let shown = p.frequency.iter().zip(&p.density).filter(|(f, d)| **f > 0.0 && **f <= top && **d > 0.0);
            shown.map(|(f, d)| (*f, *d)).unzip()
        };
        let ((fs, ds), (fr, dr)) = (cut(&signal), cut(&residual));
        if fs.is_empty() || fr.is_empty() {
            continue;
        }
        let label = |l: &str| if any { String::new() } else { l.to_owned() };
        let noise = 2.0 * s.sigma[k].powi(2) / rate;
        let unit = format!("PSD (({})^2/Hz)", s.units[k]);
        let mut p = Panel::log_y("frequency (Hz)", unit).titled(s.names[k].as_str()).x_range(0.0, top);
        p.height = 160.0;
        p.series.push(Series::new(label("measured"), &fs, &ds).colour(5));
        p.series.push(Series::new(label("residual"), &fr, &dr).colour(1));
        p.series.push(Series::new(label("noise of the sensor"), &[fr[0], top], &[noise; 2]).dashed().colour(6));
        for m in modes {
            p = p.vline(m.frequency_hz, if any { String::new() } else { format!("{:.3} Hz", m.frequency_hz) });
        }
        any = true;
        fig = fig.panel(p);
    }
    any.then(|| left_out(fig.caption("Vertical lines: modes of the identified model, joints held."), s))
}

fn left_out(fig: Figure, s: &Signals) -> Figure {
    let more = s.names.len().saturating_sub(CHANNELS);
    if more == 0 {
        return fig;
    }
    let text = format!("{} {more} more channels are in residuals.csv.", fig.caption);
    fig.caption(text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::{Block, Page, points};
    use nalgebra::DMatrix;

    /// An hour of ten channels at 100 Hz, a fifth of it held out: noise is what thins worst.
    #[test]
    #[ignore = "full tier: 2 s"]
    fn a_report_of_an_hour_stays_below_five_megabytes() {
        const N: usize = 360_000;
        let noise = |i: usize, k: usize| (((i * 7919 + k * 104_729) % 10_007) as f64 / 10_007.0 - 0.5) * 0.3;
        let clean = |i: usize, k: usize| (i as f64 * 1e-3 * (k + 1) as f64).sin();
        let of = |n: usize| Signals {
            time: (0..n).map(|i| i as f64 * 0.01).collect(),
            names: (0..10).map(|k| format!("tau.joint{k}")).collect(),
            units: vec!["N m"; 10],
            sigma: vec![0.1; 10],
            measured: DMatrix::from_fn(n, 10, |i, k| clean(i, k) + noise(i, k)),
            predicted: DMatrix::from_fn(n, 10, clean),
        };
        let (fitted, held) = (of(N * 4 / 5), of(N / 5));
        let modes = [ModeLine { frequency_hz: 0.7, damping_ratio: 0.01, start_hz: 0.6 }];
        let mut all = vec![signals(&fitted, "signals"), residuals(&fitted, "residuals")];
        all.extend(spectra(&fitted, &modes, "spectra"));
        all.extend([signals(&held, "held out"), residuals(&held, "its residuals")]);
        let mut page = Page::new("An hour");
        let n = points(&all);
        page.section("Figures", all.iter().map(|f| Block::figure(f, n).unwrap()).collect());
        let bytes = page.render().len();
        assert!(all.len() == 5 && bytes < 5_000_000, "{bytes} bytes");
    }
}
