//! How dense the knots of a fitted joint motion need be, read off the spectrum of the positions.
//!
//! Knots too far apart bend the motion, knots too close let noise through, whose part in the acceleration grows with
//! `spacing^-2.5`. Above the frequency where the spectrum of the positions meets the floor of its noise there is nothing to
//! follow: a spline of degree 5 needs some four knots per period there ([`KNOTS_PER_PERIOD`]), and no more. Among the
//! spacings up to that density the coarsest is taken whose residual is at the noise of every joint, as in
//! [`crate::motion_fit::choose_knots`], which knows no such end and, told too little noise, follows what there is down to 2.5 samples.

use crate::motion_fit::{FitError, JointSamples, MotionFit, fit_motion, noise_estimate};
use crate::psd::{PsdError, Welch};

/// Knots per period of the highest frequency that stands out of the noise. At four, a spline of degree 5 follows a sine to
/// about 1e-3 of its amplitude in position.
pub const KNOTS_PER_PERIOD: f64 = 4.0;

/// Why the knots are as dense as they are.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum KnotReason {
    /// The coarsest knots whose residual is at the noise of every joint.
    ResidualAtNoise,
    /// The residual is above the noise, but beyond this frequency (Hz) the spectrum shows nothing that finer knots could
    /// follow: the figure given for the noise is too low.
    SpectrumAtFloor {
        /// Where the last joint meets its floor (Hz).
        band: f64,
    },
    /// The spectrum stands out of the floor up to the highest frequency that 2.5 samples per knot can follow: sample faster.
    AllOfTheBand,
}

/// A fit with the spectrum behind its knots.
#[derive(Clone, Debug)]
pub struct SpectralFit {
    /// The fit.
    pub fit: MotionFit,
    /// Per joint, the frequency (Hz) above which its positions are at the floor of their noise; 0 for one that stands still.
    pub bands: Vec<f64>,
    /// Per joint, the floor (rad^2 / Hz or m^2 / Hz).
    pub floors: Vec<f64>,
    /// Why these knots.
    pub reason: KnotReason,
}

/// Why there is no spectral choice.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KnotError {
    /// The fit failed.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The spectrum failed.
    #[error(transparent)]
    Psd(#[from] PsdError),
}

/// Fits `samples` (equally spaced, positions only) with knots from the spectrum. `noise` is the standard deviation per joint
/// where it is known; otherwise it is estimated. Allocates.
///
/// # Errors
/// [`KnotError`]; at least 64 samples are needed.
pub fn fit_by_spectrum(samples: &JointSamples<'_>, noise: Option<&[f64]>) -> Result<SpectralFit, KnotError> {
    let estimated = noise_estimate(samples)?;
    let (n, m) = (samples.dof, samples.times.len());
    if m < 64 {
        return Err(FitError::Length { what: "samples", got: m, expected: 64 }.into());
    }
    let given = noise.is_some();
    let noise = match noise {
        Some(s) if s.len() != n => {
            return Err(FitError::Length { what: "noise", got: s.len(), expected: n }.into());
        }
        Some(s) => s,
        None => &estimated,
    };
    let end = samples.times[m - 1];
    let dt = end / (m - 1) as f64;
    // Four segments with half overlap: enough averages to tell a line from the floor, enough length to see slow ones.
    let segment = (2 * m / 5).max(32);
    let mut welch = Welch::new(segment, 1.0 / dt)?;
    let (mut bands, mut floors) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let mut x = vec![0.0; m];
    for j in 0..n {
        // Second differences: a ramp leaks across the whole spectrum of positions, and is gone from theirs. White noise of
        // deviation s has the density 2 s^2 dt (2 sin(pi f dt))^4 there.
        for (i, v) in x.iter_mut().enumerate().take(m - 1).skip(1) {
            *v = samples.q[(i + 1) * n + j] - 2.0 * samples.q[i * n + j] + samples.q[(i - 1) * n + j];
        }
        let p = welch.run(&x[1..m - 1])?;
        let floor = 2.0 * noise[j] * noise[j] * dt;
        let white = |f: f64| floor * (2.0 * (core::f64::consts::PI * f * dt).sin()).powi(4);
        // The window leaks a line into its neighbours, and rounding is a floor of its own.
        let rounding = 1e-30 * p.density.iter().copied().fold(0.0, f64::max);
        let low = p.confidence(0.998)?;
        // Twice the floor: a figure for the noise that is a little low must not count as motion. A single bin in some
        // hundreds is above by chance; two side by side are not.
        let above = |k: usize| low[k].0 > 2.0 * white(p.frequency[k]) + rounding;
        let top = (1..p.density.len() - 1).rev().find(|&k| above(k) && above(k + 1));
        bands.push(top.map_or(0.0, |k| p.frequency[k + 1]));
        floors.push(floor);
    }
    let band = bands.iter().copied().fold(0.0, f64::max);
    let finest = 2.5 * dt;
    let limited = 1.0 / (KNOTS_PER_PERIOD * band.max(1.0 / end));
    let densest = limited.max(finest);
    let largest = samples.q.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    // Two deviations of the comparison, as in `choose_knots`: an estimated noise varies as well.
    let uncertainty = if given { 1.0 } else { (1.0 + 1.0 / 0.316f64).sqrt() };
    let slack = 1.0 + 2.0 * uncertainty / (2.0 * m as f64).sqrt();
    let mut spacing = (end / 6.0).max(densest);
    loop {
        let fit = fit_motion(samples, spacing)?;
        let reached = fit.residual.iter().zip(noise).all(|(r, s)| *r <= (slack * s).max(1e-12 * largest));
        if reached || spacing <= densest {
            let reason = if reached {
                KnotReason::ResidualAtNoise
            } else if limited > finest {
                KnotReason::SpectrumAtFloor { band }
            } else {
                KnotReason::AllOfTheBand
            };
            return Ok(SpectralFit { fit, bands, floors, reason });
        }
        spacing = (spacing / core::f64::consts::SQRT_2).max(densest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_dynamics::motion::JointMotion;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    const RATE: f64 = 50.0;
    const N: usize = 2000;

    /// Two joints: a slow ramped sine and one with a tone at 0.9 Hz; noise `s`, coloured by `a`.
    fn positions(s: f64, a: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let (mut rng, normal) = (ChaCha8Rng::seed_from_u64(seed), Normal::new(0.0, 1.0).unwrap());
        let times: Vec<f64> = (0..N).map(|i| i as f64 / RATE).collect();
        let mut c = [0.0; 2];
        let mut q = Vec::new();
        for t in &times {
            for (j, c) in c.iter_mut().enumerate() {
                *c = a * *c + (1.0 - a * a).sqrt() * normal.sample(&mut rng);
                q.push(truth(*t, j) + s * *c);
            }
        }
        (times, q)
    }
    fn truth(t: f64, j: usize) -> f64 {
        let tone = if j == 1 { 0.004 * (core::f64::consts::TAU * 0.9 * t).sin() } else { 0.0 };
        0.3 * (0.4 * t + j as f64).sin() + 0.01 * t + tone
    }

    #[test]
    fn the_band_ends_at_the_fastest_motion_and_the_acceleration_follows_it() {
        let (times, q) = positions(2e-5, 0.0, 1);
        let s = JointSamples { dof: 2, times: &times, q: &q, qd: None, rate_weight: 0.0 };
        let f = fit_by_spectrum(&s, None).unwrap();
        // The window of 16 s spreads a line that stands 200 deviations out over a few tenths of a hertz.
        assert!((0.9..1.4).contains(&f.bands[1]) && f.bands[0] < 0.7, "{:?}", f.bands);
        assert_eq!(f.reason, KnotReason::ResidualAtNoise);
        let (mut y, mut yd, mut ydd) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        let mut worst = 0.0f64;
        for i in 100..N - 100 {
            let t = times[i] + 0.004;
            f.fit.motion.eval(t, &mut y, &mut yd, &mut ydd);
            let w = core::f64::consts::TAU * 0.9;
            let exact = -0.3 * 0.16 * (0.4 * t + 1.0).sin() - 0.004 * w * w * (w * t).sin();
            worst = worst.max((ydd[1] - exact).abs());
        }
        assert!(worst < 0.04 * 0.004 * 32.0, "{worst}");
    }

    #[test]
    fn a_noise_figure_a_tenth_too_low_does_not_drive_the_knots_to_the_samples() {
        let (times, q) = positions(1e-4, 0.0, 2);
        let s = JointSamples { dof: 2, times: &times, q: &q, qd: None, rate_weight: 0.0 };
        let low = [9e-5, 9e-5];
        let free = crate::motion_fit::choose_knots(&s, Some(&low)).unwrap();
        let f = fit_by_spectrum(&s, Some(&low)).unwrap();
        assert!(matches!(f.reason, KnotReason::SpectrumAtFloor { band } if band < 2.0), "{:?}", f.reason);
        assert!(f.fit.spacing > 2.0 * free.spacing, "{} {}", f.fit.spacing, free.spacing);
        assert_eq!(fit_by_spectrum(&s, Some(&[1e-4, 1e-4])).unwrap().reason, KnotReason::ResidualAtNoise);
    }

    #[test]
    fn slow_noise_is_not_followed() {
        // Noise that is mostly below 1 Hz: differences see a tenth of it, and would have the knots follow it.
        let (times, q) = positions(3e-4, 0.95, 2);
        let s = JointSamples { dof: 2, times: &times, q: &q, qd: None, rate_weight: 0.0 };
        let free = crate::motion_fit::choose_knots(&s, Some(&[1e-5, 1e-5])).unwrap();
        let f = fit_by_spectrum(&s, Some(&[3e-4, 3e-4])).unwrap();
        assert!(f.fit.spacing > 3.0 * free.spacing, "{} {}", f.fit.spacing, free.spacing);
    }

    #[test]
    fn too_few_samples_and_wrong_noise_are_refused() {
        let (times, q) = positions(1e-4, 0.0, 3);
        let s = JointSamples { dof: 2, times: &times[..40], q: &q[..80], qd: None, rate_weight: 0.0 };
        assert!(matches!(fit_by_spectrum(&s, None), Err(KnotError::Fit(FitError::Length { got: 40, .. }))));
        let s = JointSamples { times: &times, q: &q, ..s };
        assert!(fit_by_spectrum(&s, Some(&[1e-4])).is_err());
        // Without noise, all there is to follow is followed.
        let (times, q) = positions(0.0, 0.0, 3);
        let s = JointSamples { times: &times, q: &q, ..s };
        let f = fit_by_spectrum(&s, None).unwrap();
        assert!(f.fit.residual[1] < 1e-7, "{:?} {:?}", f.fit.residual, f.reason);
    }
}
