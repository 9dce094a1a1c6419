//! Spectral peaks, each with its resolution; and the refusal to name one where there is none.
//!
//! A peak is a local maximum that stands above the noise floor by more than chance explains and above the
//! saddles to its neighbours by a factor of two. Its frequency is interpolated by a parabola through the
//! logarithms of three bins, which for the Hann window is good to a few hundredths of a bin on a pure line; the
//! stated interval is nevertheless never narrower than half a bin to either side, because a bin is what the
//! record resolves. Damping comes from the half-power width, from which the width of the window (1.44 bins for
//! Hann) is removed. For frequencies finer than a bin use `crate::modal::fit`.

use crate::psd::{Psd, PsdError};

/// Half-power width of the Hann window in bins.
const HANN_WIDTH: f64 = 1.44;
/// A peak must rise above the saddle to a higher peak by this factor.
const PROMINENCE: f64 = 2.0;

/// Why no peak is named.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PeakError {
    /// Nothing in the band stands out (bad-inputs row D25). The largest bin is not a mode.
    #[error(
        "no peak between {f_min} and {f_max} Hz: the largest local maximum is {snr:.2} times the floor, {limit:.2} \
         needed; excite more strongly, or fit the free decay"
    )]
    NoPeak {
        /// Largest local maximum over the floor (0 without a local maximum).
        snr: f64,
        /// What would have counted.
        limit: f64,
        /// Lower end of the band (Hz).
        f_min: f64,
        /// Upper end of the band (Hz).
        f_max: f64,
    },
    /// The band holds fewer than five bins, or lies outside the spectrum.
    #[error("band {f_min} .. {f_max} Hz holds {bins} bins of {df} Hz, at least 5 needed")]
    Band {
        /// Lower end (Hz).
        f_min: f64,
        /// Upper end (Hz).
        f_max: f64,
        /// Bins inside.
        bins: usize,
        /// Width of a bin (Hz).
        df: f64,
    },
    /// The record is too short for the band.
    #[error(transparent)]
    Psd(#[from] PsdError),
}

impl PeakError {
    /// Process exit code of `bad-inputs.md`: 13 (ill-posed), 11 for a band that cannot be.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::NoPeak { .. } => 13,
            Self::Band { .. } => 11,
            Self::Psd(e) => e.exit_code(),
        }
    }
}

/// One peak.
///
/// ```
/// # // Two decaying modes of one channel, 60 s at 10 Hz, with a little noise from a fixed sequence.
/// # let mode = |t: f64, f: f64, zeta: f64, phase: f64| {
/// #     let w = std::f64::consts::TAU * f;
/// #     (-zeta * w * t).exp() * (w * (1.0 - zeta * zeta).sqrt() * t + phase).cos()
/// # };
/// # let y = nalgebra::DMatrix::from_fn(600, 1, |i, _| {
/// #     let t = 0.1 * i as f64;
/// #     let noise: f64 = (0..12u64).map(|k| ((i as u64 * 12 + k + 1) * 2654435761 % 4294967296) as f64 / 4294967296.0).sum::<f64>() - 6.0;
/// #     0.05 * mode(t, 0.21, 0.006, 0.4) + 0.02 * mode(t, 0.47, 0.004, -0.9) + 1e-4 * noise
/// # });
/// use ff_spectral::{Welch, find_peaks};
///
/// let psd = Welch::new(600, 10.0)?.run(y.as_slice())?;
/// let peaks = find_peaks(&psd, 0.1, 1.0, None)?.peaks;
/// let loudest = peaks.iter().max_by(|a, b| a.density.total_cmp(&b.density)).unwrap();
/// assert!(loudest.interval.0 < 0.21 && 0.21 < loudest.interval.1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Peak {
    /// Interpolated frequency (Hz).
    pub frequency: f64,
    /// Interval that the resolution supports: `frequency -+ df/2` at the least (Hz).
    pub interval: (f64, f64),
    /// Density at the top over the noise floor.
    pub snr: f64,
    /// Density at the top (unit of the spectrum).
    pub density: f64,
    /// Damping ratio from the half-power width, the window removed; 0 when the window is all there is.
    pub damping: f64,
    /// Damping ratios that a half-power width uncertain by a bin allows.
    pub damping_interval: (f64, f64),
}

/// Two peaks that the spectrum may have blurred (bad-inputs row D26).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct UnresolvedPeaks {
    /// Lower frequency (Hz).
    pub f1: f64,
    /// Higher frequency (Hz).
    pub f2: f64,
    /// Bin width (Hz).
    pub df: f64,
}

/// Peaks of a band.
///
/// ```
/// # // Two decaying modes of one channel, 60 s at 10 Hz, with a little noise from a fixed sequence.
/// # let mode = |t: f64, f: f64, zeta: f64, phase: f64| {
/// #     let w = std::f64::consts::TAU * f;
/// #     (-zeta * w * t).exp() * (w * (1.0 - zeta * zeta).sqrt() * t + phase).cos()
/// # };
/// # let y = nalgebra::DMatrix::from_fn(600, 1, |i, _| {
/// #     let t = 0.1 * i as f64;
/// #     let noise: f64 = (0..12u64).map(|k| ((i as u64 * 12 + k + 1) * 2654435761 % 4294967296) as f64 / 4294967296.0).sum::<f64>() - 6.0;
/// #     0.05 * mode(t, 0.21, 0.006, 0.4) + 0.02 * mode(t, 0.47, 0.004, -0.9) + 1e-4 * noise
/// # });
/// use ff_spectral::{Peaks, Welch, find_peaks};
///
/// let psd = Welch::new(600, 10.0)?.run(y.as_slice())?;
/// let found: Peaks = find_peaks(&psd, 0.1, 1.0, None)?;
/// assert!(found.peaks.iter().all(|p| p.density >= found.limit * found.floor));
/// assert_eq!(found.df, 10.0 / 600.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Peaks {
    /// Peaks by frequency.
    pub peaks: Vec<Peak>,
    /// Neighbours closer than the main lobe of the window (4 bins).
    pub unresolved: Vec<UnresolvedPeaks>,
    /// Noise floor used (unit of the spectrum).
    pub floor: f64,
    /// Ratio to the floor from which a maximum counts.
    pub limit: f64,
    /// Bin width (Hz).
    pub df: f64,
}

/// Finds the peaks of `psd` in `f_min .. f_max` (Hz). `floor` is the known density of the noise (for a
/// [`Psd::weighted_sum`] of n channels `2 n / rate`); without it the lower quartile of the band is taken, which
/// broad peaks raise. Allocates.
///
/// # Errors
/// [`PeakError`]; in particular the segment must last five periods of `f_min` (row D23).
pub fn find_peaks(psd: &Psd, f_min: f64, f_max: f64, floor: Option<f64>) -> Result<Peaks, PeakError> {
    let df = psd.df;
    crate::psd::check_resolution(1.0 / df, f_min)?;
    let lo = (f_min / df).ceil().max(1.0) as usize;
    let hi = ((f_max / df).floor() as usize).min(psd.density.len().saturating_sub(2));
    let bins = (hi + 1).saturating_sub(lo);
    if bins < 5 {
        return Err(PeakError::Band { f_min, f_max, bins, df });
    }
    let s = &psd.density;
    let floor = floor.filter(|f| *f > 0.0).unwrap_or_else(|| {
        let mut v = s[lo..=hi].to_vec();
        v.sort_by(f64::total_cmp);
        // The median of an exponential density is 0.69 of its mean, its lower quartile 0.29.
        let q = v[bins / 4] / if psd.segments > 1 { 1.0 - 0.71 / (psd.segments as f64).sqrt() } else { 0.29 };
        q.max(f64::MIN_POSITIVE)
    });
    let limit = chance_limit(psd.segments, bins);
    let mut largest: f64 = 0.0;
    let mut peaks = Vec::new();
    for i in lo..=hi {
        if !(s[i] > s[i - 1] && s[i] >= s[i + 1]) {
            continue;
        }
        largest = largest.max(s[i] / floor);
        if s[i] > limit * floor && prominence(&s[lo - 1..=hi + 1], i + 1 - lo) >= PROMINENCE {
            peaks.push(describe(s, i, df, floor));
        }
    }
    if peaks.is_empty() {
        return Err(PeakError::NoPeak { snr: largest, limit, f_min, f_max });
    }
    let pairs = peaks.windows(2).map(|w| UnresolvedPeaks { f1: w[0].frequency, f2: w[1].frequency, df });
    let unresolved = pairs.filter(|p| p.f2 - p.f1 < 4.0 * df).collect();
    Ok(Peaks { peaks, unresolved, floor, limit, df })
}

/// The ratio to the floor that the largest of `bins` noise bins exceeds once in a thousand spectra: each is
/// chi-squared with 2K degrees of freedom over 2K (K averaged segments; overlap of Hann segments leaves about
/// 0.9 K independent ones), quantile by the bound of B. Laurent, P. Massart (2000).
fn chance_limit(segments: usize, bins: usize) -> f64 {
    let k = (0.9 * segments as f64).max(1.0);
    let log = (1000.0 * bins as f64).ln();
    1.0 + (2.0 * log / k).sqrt() + log / k
}

/// Height of `s[i]` over the higher of the two saddles to ground higher than itself; to the lowest point on a
/// side that has none.
fn prominence(s: &[f64], i: usize) -> f64 {
    let saddle = |side: &mut dyn Iterator<Item = &f64>| {
        let mut low = s[i];
        for &x in side {
            if x > s[i] {
                break;
            }
            low = low.min(x);
        }
        low
    };
    let left = saddle(&mut s[..i].iter().rev());
    let right = saddle(&mut s[i + 1..].iter());
    s[i] / left.max(right).max(f64::MIN_POSITIVE)
}

fn describe(s: &[f64], i: usize, df: f64, floor: f64) -> Peak {
    let tiny = f64::MIN_POSITIVE;
    let [a, b, c] = [s[i - 1], s[i], s[i + 1]].map(|x| x.max(tiny).ln());
    let curve = a - 2.0 * b + c;
    let shift = if curve < 0.0 { (0.5 * (a - c) / curve).clamp(-0.5, 0.5) } else { 0.0 };
    let frequency = (i as f64 + shift) * df;
    // The noise floor adds to the peak and to its flanks; the half is that of the peak alone.
    let half = floor + 0.5 * (s[i] - floor).max(0.0);
    let cross = |step: isize| {
        let mut k = i as isize;
        loop {
            let next = k + step;
            let Some(&y) = usize::try_from(next).ok().and_then(|n| s.get(n)) else { return k as f64 };
            if y <= half {
                let x = s[k as usize];
                return k as f64 + step as f64 * (x - half) / (x - y).max(tiny);
            }
            k = next;
        }
    };
    let width = (cross(1) - cross(-1)).max(0.0);
    let own = |bins: f64| (bins * bins - HANN_WIDTH * HANN_WIDTH).max(0.0).sqrt() * df / (2.0 * frequency);
    Peak {
        frequency,
        interval: (frequency - 0.5 * df, frequency + 0.5 * df),
        snr: s[i] / floor,
        density: s[i],
        damping: own(width),
        damping_interval: (own(width - 1.0), own(width + 1.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::psd::Welch;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    /// Spectrum of noise of unit deviation plus `signal(t)`, 60 s at 20 Hz in one segment unless told.
    fn spectrum(seed: u64, segment: usize, n: usize, signal: impl Fn(f64) -> f64) -> Psd {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let x: Vec<f64> = (0..n).map(|i| signal(i as f64 / 20.0) + normal.sample(&mut rng)).collect();
        Welch::new(segment, 20.0).unwrap().run(&x).unwrap()
    }
    fn tone(f: f64) -> impl Fn(f64) -> f64 {
        move |t| 3.0 * (core::f64::consts::TAU * f * t + 0.4).cos()
    }

    #[test]
    fn lines_are_found_within_half_a_bin_which_is_always_stated() {
        let p = spectrum(3, 1200, 1200, |t| tone(0.231)(t) + tone(0.683)(t));
        let found = find_peaks(&p, 0.1, 2.0, Some(2.0 / 20.0)).unwrap();
        assert_eq!(found.peaks.len(), 2, "{found:#?}");
        for (peak, f) in found.peaks.iter().zip([0.231, 0.683]) {
            assert!((peak.frequency - f).abs() < 0.3 * p.df && peak.interval.0 < f && f < peak.interval.1);
            assert!(peak.interval.1 - peak.interval.0 >= p.df * 0.999 && peak.snr > 100.0);
            assert!(peak.damping_interval.0 == 0.0 && peak.damping < 0.05);
        }
        assert!(found.unresolved.is_empty());
    }

    #[test]
    fn damping_is_read_from_the_width_where_the_window_allows() {
        // A randomly driven resonator at 1 Hz, 5 %, long record: half-power width 0.1 Hz against 0.05 Hz bins.
        let (w, z, dt) = (core::f64::consts::TAU, 0.05, 0.05);
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let pole = nalgebra::Complex::new(-z * w, w).scale(dt).exp();
        let (mut y1, mut y2) = (0.0, 0.0);
        let x: Vec<f64> = (0..80_000)
            .map(|_| {
                let y = 2.0 * pole.re * y1 - pole.norm_sqr() * y2 + normal.sample(&mut rng);
                (y2, y1) = (y1, y);
                y
            })
            .collect();
        let p = Welch::new(1000, 20.0).unwrap().run(&x).unwrap();
        let found = find_peaks(&p, 0.3, 3.0, None).unwrap();
        let top = found.peaks.iter().max_by(|a, b| a.density.total_cmp(&b.density)).unwrap();
        assert!((top.frequency - 1.0).abs() < 0.02, "{top:?}");
        let (lo, hi) = top.damping_interval;
        assert!(lo < 0.05 && 0.05 < hi && (top.damping - 0.05).abs() < 0.015, "{top:?}");
    }

    #[test]
    fn noise_and_strong_damping_give_no_peak_rather_than_the_largest_bin() {
        for (segment, n) in [(1200, 1200), (300, 3000)] {
            let mut false_alarms = 0;
            for seed in 0..400 {
                match find_peaks(&spectrum(seed, segment, n, |_| 0.0), 0.4, 5.0, Some(0.1)) {
                    Ok(_) => false_alarms += 1,
                    Err(e) => assert!(matches!(e, PeakError::NoPeak { .. }) && e.exit_code() == 13, "{e}"),
                }
            }
            println!("{false_alarms} false alarms in 400 spectra");
            assert!(false_alarms <= 2, "{false_alarms} of 400, segment {segment}");
        }
        // Over in a third of a period: a bulge at the low end, without a maximum inside the band.
        let p = spectrum(5, 1200, 1200, |t| 2.0 * (-3.0 * t).exp());
        assert!(matches!(find_peaks(&p, 0.1, 5.0, Some(0.1)), Err(PeakError::NoPeak { .. })));
    }

    #[test]
    fn near_neighbours_and_short_records_are_reported() {
        let p = spectrum(6, 1200, 1200, |t| tone(0.500)(t) + tone(0.552)(t));
        let found = find_peaks(&p, 0.1, 2.0, Some(0.1)).unwrap();
        assert_eq!((found.peaks.len(), found.unresolved.len()), (2, 1), "{found:#?}");
        assert!(matches!(find_peaks(&p, 0.06, 2.0, None), Err(PeakError::Psd(PsdError::Resolution { .. }))));
        assert!(matches!(find_peaks(&p, 0.5, 0.55, None), Err(PeakError::Band { .. })));
    }
}
