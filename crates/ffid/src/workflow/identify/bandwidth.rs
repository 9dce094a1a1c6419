//! The low pass of a calibration on the ground, chosen by how well parts of the log predict each other.
//!
//! Accelerations that come from positions are noise above some frequency, and noise in the equations biases a linear fit towards zero; a
//! low pass that is too narrow takes the motion itself away. Both are seen in the torques of a part of the log that was not fitted. Candidates
//! are a twelfth of the sampling rate and fractions of it by the root of two. Each of [`BLOCKS`] parts of the log is predicted by a fit of the others behind
//! the candidate, and scored by torques and equations behind one and the same filter, that of the motion: twice the frequency below which 99 % of the
//! power of the joint rates is, since centrifugal and Coriolis torques are products of two rates. Noise of the positions is in the equations that judge, too, and the fit that is biased alike wins: behind a wide filter the
//! best candidate is the filter itself. So the filter is no wider than the motion asks for.
//!
//! The filter of the motion is itself a candidate, and the choice where the log says nothing: another is taken only where it predicts better
//! beyond the scatter over the parts. Of those that are as good as the best within that scatter, the one next to the filter of the motion is taken.

use ff_model::Model;
use ff_records::Record;
use ff_spectral::Welch;
use ident::estimate::smoothed;
use ident::{Friction, Ground};

/// Most candidates beside the filter of the motion: each is the one before over the root of two.
const CANDIDATES: usize = 15;
/// The widest candidate is the sampling rate over this. A filter takes a tenth at most, and other parts of a log have slightly other rates.
const WIDEST: f64 = 12.0;
/// Part of the power of the joint rates that the motion is.
const POWER: f64 = 0.99;
/// Density of positions that may be noise, times what nine tenths of the spectrum above the widest candidate stay below.
const NOISE: f64 = 10.0;
/// The filter of the motion, behind which candidates are compared, over the frequency up to which that power is: torques of rates are products of
/// two, whose frequencies add.
const BAND: f64 = 2.0;
/// Parts of a log that predict each other.
const BLOCKS: usize = 6;
/// A score is worse than another by more than this many standard errors of their difference, or as good.
const STANDARD_ERRORS: f64 = 2.0;

/// What was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bandwidth {
    /// Cutoff (Hz).
    pub hz: f64,
    /// The filter of the motion, behind which candidates were compared (Hz).
    pub compared_hz: f64,
    /// Torques of parts that were not fitted: residual over signal, root mean square, with the chosen low pass. `None` where no candidate
    /// predicts them better than torques of zero beyond the scatter, and the filter of the motion was taken.
    pub missed: Option<f64>,
    /// The widest candidate (Hz), and what it misses of these torques.
    pub widest: Option<(f64, f64)>,
}

/// Why no low pass was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoBandwidth {
    /// Rates and accelerations were recorded: they are set points, which have no noise.
    #[error("the log has rates and accelerations of its own")]
    SetPoints,
    /// No spectrum of the positions, or one without motion below the widest candidate.
    #[error("no motion stands out of the noise of the positions below a twelfth of the sampling rate")]
    NoMotion,
    /// The log is too short for the filter of the motion.
    #[error("the log is too short for a low pass")]
    TooShort,
}

/// Chooses the low pass for a log of an arm on the ground, of the `selected` parameters about `start`. Allocates.
///
/// # Errors
/// [`NoBandwidth`].
pub fn choose_low_pass(
    model: &Model,
    record: &Record,
    selected: &[usize],
    start: &[f64],
) -> Result<Bandwidth, NoBandwidth> {
    if record.qd().is_some() && record.qdd().is_some() {
        return Err(NoBandwidth::SetPoints);
    }
    let widest = record.rate_hz() / WIDEST;
    let compared_hz = (BAND * moving_below(record, widest).ok_or(NoBandwidth::NoMotion)?).min(widest);
    let part = record.seconds() / BLOCKS as f64;
    let edges: Vec<f64> = (0..=BLOCKS).map(|k| record.t0() + k as f64 * part).collect();
    let behind = |hz: f64| Some((smoothed(record, hz).ok()?, Ground::new(model, Friction::ALL).ok()?.low_pass(hz)));
    let (seen, ground) = behind(compared_hz).ok_or(NoBandwidth::TooShort)?;
    let judged = ground.blocks(&seen, &edges, (selected, start)).map_err(|_| NoBandwidth::TooShort)?;
    let torques = judged.torques();
    // Every joint alike.
    let weight =
        |j: usize| 1.0 / (torques.iter().map(|t| t[j]).sum::<f64>().max(f64::MIN_POSITIVE) * model.nj() as f64);
    let weights: Vec<f64> = (0..model.nj()).map(weight).collect();
    let weighted = |of: &[Vec<f64>]| -> Score {
        Score(of.iter().map(|joints| joints.iter().zip(&weights).map(|(x, w)| x * w).sum()).collect())
    };
    let score = |hz: f64| {
        let (seen, ground) = behind(hz)?;
        let fits = ground.blocks(&seen, &edges, (selected, start)).ok()?.left_out().ok()?;
        let of = weighted(&judged.missed(&fits));
        (fits.len() == torques.len() && of.sum().is_finite()).then_some(of)
    };
    let mut tried = vec![compared_hz];
    tried.extend((0..CANDIDATES).map(|k| widest * 0.5f64.powf(0.5 * k as f64)));
    let scored: Vec<(f64, Score)> = tried.into_iter().filter_map(|hz| Some((hz, score(hz)?))).collect();
    let best = scored.iter().map(|s| &s.1).min_by(|a, b| a.sum().total_cmp(&b.sum()));
    let widest = scored.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map(|(hz, s)| (*hz, s.sum().sqrt()));
    let away = |hz: f64| (hz / compared_hz).ln().abs();
    let nearest = best.filter(|best| best.below(&weighted(&torques))).and_then(|best| {
        let alike = scored.iter().filter(|s| !best.below(&s.1));
        alike.min_by(|a, b| away(a.0).total_cmp(&away(b.0)))
    });
    let (hz, missed) = match nearest {
        Some((hz, score)) => (*hz, Some(score.sum().sqrt())),
        // Parts that cannot be fitted, or of motions that tell nothing of each other.
        None => (compared_hz, None),
    };
    Ok(Bandwidth { hz, compared_hz, missed, widest })
}

/// What is missed of the torques of every part of a log: squares, over those of all parts.
struct Score(Vec<f64>);

impl Score {
    fn sum(&self) -> f64 {
        self.0.iter().sum()
    }
    /// True where it misses less beyond the scatter: by more than [`STANDARD_ERRORS`] of the sum of the differences.
    fn below(&self, other: &Self) -> bool {
        let less: Vec<f64> = other.0.iter().zip(&self.0).map(|(a, b)| a - b).collect();
        let n = less.len() as f64;
        let mean = less.iter().sum::<f64>() / n;
        let variance = less.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        mean > STANDARD_ERRORS * (variance / n).sqrt()
    }
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

    /// A part that is much worse by itself says nothing: the others have to agree.
    #[test]
    fn one_part_of_a_log_does_not_choose() {
        let of = |x: [f64; 6]| Score(x.to_vec());
        let best = of([0.02, 0.03, 0.05, 0.04, 0.02, 0.03]);
        let everywhere = of([0.03, 0.04, 0.065, 0.055, 0.03, 0.045]);
        let once = of([0.02, 0.03, 0.05, 0.9, 0.02, 0.03]);
        assert!(best.below(&everywhere) && !best.below(&once) && !everywhere.below(&best));
        assert!((once.sum() - 1.05).abs() < 1e-12);
    }

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
