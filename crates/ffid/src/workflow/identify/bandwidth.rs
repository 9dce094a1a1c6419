//! The low pass of a calibration on the ground, chosen by how well one half of the log predicts the other.
//!
//! Accelerations that come from positions are noise above some frequency, and noise in the equations biases a linear fit towards zero; a
//! low pass that is too narrow takes the motion itself away. Both are seen in the torques of a part of the log that was not fitted. Candidates
//! are a twelfth of the sampling rate and fractions of it by the root of two. Each is fitted to one half of the log and scored on the other, and the other way round,
//! by torques and equations behind one and the same filter: 2.5 times the frequency below which 99 % of the power of the joint rates is.
//! Noise of the positions is in the equations that judge, too, and the fit that is biased alike wins: behind a wide filter the best
//! candidate is the filter itself. So the filter is no wider than the motion asks for. Where no candidate predicts the other half better than
//! torques of zero, that filter is the choice.

use ff_model::Model;
use ff_records::Record;
use ff_spectral::Welch;
use ident::estimate::{JointTorques, smoothed};
use ident::{Friction, Ground};

/// Most candidates: each is the one before over the root of two.
const CANDIDATES: usize = 15;
/// The widest candidate is the sampling rate over this. A filter takes a tenth at most, and other parts of a log have slightly other rates.
const WIDEST: f64 = 12.0;
/// Part of the power of the joint rates that the motion is.
const POWER: f64 = 0.99;
/// Density of positions that may be noise, times what nine tenths of the spectrum above the widest candidate stay below.
const NOISE: f64 = 10.0;
/// The filter behind which candidates are compared, times the frequency up to which that power is.
const BAND: f64 = 2.5;
/// A wider band is as good when its score is within this part of the best.
const ALIKE: f64 = 1e-3;

/// What was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bandwidth {
    /// Cutoff (Hz).
    pub hz: f64,
    /// The widest candidate (Hz).
    pub widest_hz: f64,
    /// Filter that candidates were compared behind (Hz).
    pub compared_hz: f64,
    /// Torques of the half that was not fitted: residual over signal, root mean square, with the chosen low pass and with the widest. `None`
    /// where no candidate predicts the other half, and the filter of the comparison was taken.
    pub missed: Option<(f64, f64)>,
}

/// Chooses the low pass for a log of an arm on the ground, of the `selected` parameters about `start`. `None` where the log is too short to be
/// halved, or no candidate can be fitted. Allocates.
pub fn choose_low_pass(model: &Model, record: &Record, selected: &[usize], start: &[f64]) -> Option<Bandwidth> {
    // What a controller logged of its set points has no noise.
    if record.qd().is_some() && record.qdd().is_some() {
        return None;
    }
    let half = 0.5 * record.seconds();
    let halves = [record.window(0.0, half).ok()?, record.window(half, f64::INFINITY).ok()?];
    let widest = record.rate_hz() / WIDEST;
    let compared_hz = (BAND * moving_below(record, widest)?).min(widest);
    let fit = |of: &Record, hz: f64| {
        let seen = smoothed(of, hz).ok()?;
        let found = Ground::new(model, Friction::ALL).ok()?.low_pass(hz).estimate(&[&seen], selected, start).ok()?;
        Some((found.fit.values, found.joints))
    };
    let judge = |of: &Record, values: &[f64], joints: &JointTorques| {
        let seen = smoothed(of, compared_hz).ok()?;
        let (predicted, residual) =
            Ground::new(model, Friction::ALL).ok()?.low_pass(compared_hz).predict(&seen, values, joints).ok()?;
        let measured = predicted + &residual;
        // Every joint alike.
        let one =
            |j: usize| residual.column(j).norm_squared() / measured.column(j).norm_squared().max(f64::MIN_POSITIVE);
        Some((0..model.nj()).map(one).sum::<f64>() / model.nj().max(1) as f64)
    };
    let score = |hz: f64| {
        let mut sum = 0.0;
        for (fitted, judged) in [(0, 1), (1, 0)] {
            let (values, joints) = fit(&halves[fitted], hz)?;
            sum += 0.5 * judge(&halves[judged], &values, &joints)?;
        }
        sum.is_finite().then_some(sum)
    };
    let scored: Vec<(f64, f64)> =
        (0..CANDIDATES).map(|k| widest * 0.5f64.powf(0.5 * k as f64)).filter_map(|hz| Some((hz, score(hz)?))).collect();
    let best = scored.iter().map(|s| s.1).fold(f64::INFINITY, f64::min);
    if best >= 1.0 {
        // Halves too short for the filter, or of motions that tell nothing of each other.
        smoothed(record, compared_hz).ok()?;
        return Some(Bandwidth { hz: compared_hz, widest_hz: widest, compared_hz, missed: None });
    }
    let &(hz, chosen) = scored.iter().find(|s| s.1 <= (1.0 + ALIKE) * best)?;
    let missed = Some((chosen.sqrt(), scored[0].1.sqrt()));
    Some(Bandwidth { hz, widest_hz: scored[0].0, compared_hz, missed })
}

/// The frequency (Hz), `widest` at most, below which [`POWER`] of the rates of all joints is; `None` for a record too short for a spectrum, or
/// at rest.
fn moving_below(record: &Record, widest: f64) -> Option<f64> {
    let n = record.samples();
    let mut welch = Welch::new((n / 2).max(8), record.rate_hz()).ok()?;
    let mut power: Vec<f64> = Vec::new();
    let mut df = 0.0;
    // Noise would be most of the power of the rates: no motion is above the widest candidate, and what the spectrum holds there counts as none.
    // Noise of an encoder is flat; where samples were interpolated it falls towards the end of the spectrum, and the median says too little.
    let floor = |frequency: &[f64], density: &[f64]| {
        let mut above: Vec<f64> =
            frequency.iter().zip(density).filter(|(f, _)| **f > widest).map(|(_, d)| *d).collect();
        above.sort_unstable_by(f64::total_cmp);
        NOISE * above.get(above.len() * 9 / 10).copied().unwrap_or_default()
    };
    for q in record.q().column_iter() {
        let psd = welch.run(q.as_slice()).ok()?;
        df = psd.df;
        power.resize(psd.density.len(), 0.0);
        let none = floor(&psd.frequency, &psd.density);
        let of = |(f, d): (&f64, &f64)| if *f > widest { 0.0 } else { f * f * (d - none).max(0.0) };
        power.iter_mut().zip(psd.frequency.iter().zip(&psd.density)).for_each(|(p, fd)| *p += of(fd));
    }
    let all: f64 = power.iter().sum();
    if all <= 0.0 {
        return None;
    }
    let mut below = 0.0;
    let at = power.iter().position(|p| {
        below += p;
        below >= POWER * all
    })?;
    Some((at as f64 + 1.0) * df)
}

/// How many samples of residuals tell as much as one of white noise: `1 + 2 sum_k rho_k`, the sum of their correlations up to five times
/// what it gives (A. D. Sokal, *Monte Carlo methods in statistical mechanics*, 1997, section 3). At least 1.
pub(super) fn correlated_samples(x: &[f64]) -> f64 {
    let square: f64 = x.iter().map(|v| v * v).sum();
    if square <= 0.0 {
        return 1.0;
    }
    let mut tau = 1.0f64;
    for lag in 1..x.len() / 4 {
        let product: f64 = x.iter().zip(&x[lag..]).map(|(a, b)| a * b).sum();
        tau += 2.0 * product / square;
        if lag as f64 >= 5.0 * tau {
            break;
        }
    }
    tau.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlated_noise_counts_as_fewer_samples() {
        let white: Vec<f64> = (0..20_000)
            .map(|k| {
                let a = (f64::from(k) * 12.9898 + 4.1).sin() * 43758.5453;
                2.0 * (a - a.floor()) - 1.0
            })
            .collect();
        assert!((correlated_samples(&white) - 1.0).abs() < 0.15, "{}", correlated_samples(&white));
        // x_k = 0.8 x_{k-1} + e: (1 + 0.8) / (1 - 0.8) samples.
        let mut last = 0.0;
        let coloured: Vec<f64> = white
            .iter()
            .map(|e| {
                last = 0.8 * last + e;
                last
            })
            .collect();
        let tau = correlated_samples(&coloured);
        assert!((tau / 9.0 - 1.0).abs() < 0.2, "{tau}");
    }
}
