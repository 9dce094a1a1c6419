//! What a spline bends of a joint motion that is not as smooth as it, as draws.
//!
//! Knots are as far apart as noise and bias cost the least together, so that where a motion has corners a bias is left that readings of the encoders do not
//! show, and torques do. How large it is follows from the motion itself. Where the jerk jumps, accelerations have a density that falls as `f^-4`,
//! below the frequency of the knots, where the spline follows it, as above, where it does not:
//!
//! ```text
//! S(f) = A f^-4,     A = min over three bands of  mean of (P(f) - N(f)) f^4, and two deviations of that mean,
//! N(f) = 2 s^2 dt (2 pi f)^4
//! ```
//!
//! with the periodogram `P` of the accelerations besides those of the kinks that were found (`crate::motion::kink`) between 0.15 and 0.4 of the frequency of the knots, and noise `s` of the positions. Of a motion
//! that is smooth no more than that uncertainty is left. A draw is a signal `x` of that density, as large at every instant as the joint moves there,
//! on knots finer than those of the motion; the spline of the motion bends `x - (spline through x)` of it. A random phase has the power of corners and not their
//! instants: what is tested beside draws is tested against that power.

use crate::motion::kink::FittedMotion;
use crate::motion::spline_fit::{FitError, JointSamples, SAMPLES_PER_KNOT, fit_with_kinks};
use core::f64::consts::{PI, TAU};
use ff_linalg::LinalgError;
use ff_linalg::fourier::RealFft;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// By which the density of accelerations falls with frequency: that of corners of the jerk.
const POWER: i32 = 4;
/// Bands of the accelerations, in frequencies of the knots.
const BANDS: [f64; 4] = [0.15, 0.22, 0.3, 0.4];
/// Lines of a band at least.
const LINES: usize = 6;
/// Deviations of a mean of noise that may be motion, and the lines of a tapered periodogram that count as one.
const UNSEEN: f64 = 2.0;
const ALIKE: f64 = 1.5;
/// Knots of a draw in an interval between those of the motion, at most.
const FINER: f64 = 4.0;
/// Highest frequency of a draw in frequencies of its knots.
const FOLLOWED: f64 = 0.4;
/// Intervals between knots on either side over which the size of the motion is averaged, and over which it begins and ends: a rate at the first sample would
/// be momentum that lasts all the record.
const ABOUT: f64 = 4.0;

/// What a spline bends of the motion of each joint.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Bent {
    /// Between knots of a draw, and of the motion (s).
    fine: f64,
    spacing: f64,
    dt: f64,
    joints: Vec<Law>,
}

/// Of one joint.
#[derive(Clone, Debug, PartialEq)]
struct Law {
    /// Density of the acceleration at 1 Hz.
    density: f64,
    /// Of the motion at each sample, relative to its mean square.
    size: Vec<f64>,
}

impl Bent {
    /// Of a motion with knots `spacing` (s) apart through so many samples `dt` apart; `None` where knots are as fine as samples allow, or these too few. Allocates.
    pub(super) fn of(motion: &FittedMotion, noise: &[f64], spacing: f64, (samples, dt): (usize, f64)) -> Option<Self> {
        let fine = (spacing / FINER).max(SAMPLES_PER_KNOT * dt);
        let lines = |from: f64, to: f64| ((to - from) / spacing * dt * samples as f64) as usize;
        if fine * 1.4 > spacing || BANDS.windows(2).any(|b| lines(b[0], b[1]) < LINES) {
            return None;
        }
        let n = noise.len();
        let times: Vec<f64> = (0..samples).map(|i| i as f64 * dt).collect();
        let mut whole = vec![0.0; n * samples];
        times.iter().zip(whole.chunks_exact_mut(n)).for_each(|(t, a)| motion.derivative(*t, 2, a));
        let left = motion.besides_kinks(&times, &whole);
        let of = |j: usize| {
            let [left, whole] = [&left, &whole].map(|a| a.iter().skip(j).step_by(n).copied().collect::<Vec<f64>>());
            let size = size(&whole, ABOUT * spacing / dt)?;
            Some(Law { density: density(&left, noise[j], spacing, dt)?, size })
        };
        let joints = (0..n).map(of).collect::<Option<Vec<Law>>>()?;
        Some(Self { fine, spacing, dt, joints })
    }
    /// A signal of that density. Allocates.
    pub(super) fn draw(&self, rng: &mut impl Rng) -> Result<FittedMotion, FitError> {
        let (n, m) = (self.joints.len(), self.joints.first().map_or(0, |l| l.size.len()));
        let mut q = vec![0.0; n * m];
        for (j, law) in self.joints.iter().enumerate() {
            let x = self.stationary(law, rng).unwrap_or_else(|_| vec![0.0; m]);
            let sized = x.iter().zip(&law.size).map(|(x, s)| x * s);
            q.iter_mut().skip(j).step_by(n).zip(sized).for_each(|(q, x)| *q = x);
        }
        let times: Vec<f64> = (0..m).map(|i| i as f64 * self.dt).collect();
        let samples = JointSamples { dof: n, times: &times, q: &q, qd: None, rate_weight: 0.0 };
        Ok(fit_with_kinks(&samples, self.fine, &[], false)?.motion)
    }
    /// Positions of that density at all times: sums of `cos + sin` of every line (R. Hartley), of independent sizes.
    fn stationary(&self, law: &Law, rng: &mut impl Rng) -> Result<Vec<f64>, LinalgError> {
        let m = law.size.len();
        let line = 1.0 / (m as f64 * self.dt);
        let band = BANDS[0] / self.spacing..FOLLOWED / self.fine;
        let size = |f: f64| {
            if band.contains(&f) { (0.5 * law.density * f.powi(-POWER) * line).sqrt() / (TAU * f).powi(2) } else { 0.0 }
        };
        let mut forward = RealFft::new(m);
        for (k, x) in forward.input().iter_mut().enumerate() {
            let normal: f64 = StandardNormal.sample(rng);
            *x = normal * size(k.min(m - k) as f64 * line);
        }
        let of = forward.run()?;
        Ok((0..m).map(|i| if i < of.len() { of[i].re - of[i].im } else { of[m - i].re + of[m - i].im }).collect())
    }
}

/// `A` of the page above from accelerations `dt` apart, whose positions have noise of this deviation.
fn density(a: &[f64], noise: f64, spacing: f64, dt: f64) -> Option<f64> {
    let m = a.len();
    let mut forward = RealFft::new(m);
    for (i, (x, a)) in forward.input().iter_mut().zip(a).enumerate() {
        *x = a * (PI * (i as f64 + 0.5) / m as f64).sin().powi(2);
    }
    // Mean square of the taper.
    let scale = 2.0 * dt / (0.375 * m as f64);
    let lines = forward.run().ok()?;
    let line = 1.0 / (m as f64 * dt);
    let of_band = |b: &[f64]| {
        let [from, to] = [b[0], b[1]].map(|b| (b / (spacing * line)).ceil() as usize);
        let (mut seen, mut white, mut squares) = (0.0, 0.0, 0.0);
        for (k, c) in lines.iter().enumerate().take(to).skip(from) {
            let f = k as f64 * line;
            let by = f.powi(POWER);
            let n = 2.0 * noise * noise * dt * (TAU * f).powi(4) * by;
            seen += scale * c.norm_sqr() * by;
            white += n;
            squares += n * n;
        }
        let count = to.saturating_sub(from).max(1) as f64;
        ((seen - white).max(0.0) + UNSEEN * (ALIKE * squares).sqrt()) / count
    };
    Some(BANDS.windows(2).map(of_band).fold(f64::INFINITY, f64::min))
}

/// Root of the mean square within so many samples to either side, over that of all, from zero to zero; `None` of what does not move.
fn size(a: &[f64], half: f64) -> Option<Vec<f64>> {
    let (m, half) = (a.len(), half as usize);
    let mut sums = vec![0.0; m + 1];
    (0..m).for_each(|i| sums[i + 1] = sums[i] + a[i] * a[i]);
    let all = sums[m] / m as f64;
    let at = |i: usize| {
        let (from, to) = (i.saturating_sub(half), (i + half + 1).min(m));
        let inside = (i.min(m - 1 - i) as f64 / half.max(1) as f64).min(1.0);
        (0.5 * PI * inside).sin().powi(2) * ((sums[to] - sums[from]) / ((to - from) as f64 * all)).max(0.0).sqrt()
    };
    (all > 0.0).then(|| (0..m).map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::spline_fit::noise_of;
    use ff_dynamics::motion::JointMotion;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const DT: f64 = 0.02;
    const SAMPLES: usize = 3000;
    const SIGMA: f64 = 2e-5;

    /// Acceleration errors, root mean square away from the ends: what the spline of this spacing bends of the motion, what noise leaves, and what is drawn.
    fn errors(q: &dyn Fn(f64) -> f64, spacing: f64) -> [f64; 3] {
        let times: Vec<f64> = (0..SAMPLES).map(|i| i as f64 * DT).collect();
        let fit = |q: &[f64], spacing: f64| {
            let s = JointSamples { dof: 1, times: &times, q, qd: None, rate_weight: 0.0 };
            assert!(noise_of(&s).is_ok());
            fit_with_kinks(&s, spacing, &[], false).unwrap().motion
        };
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let clean: Vec<f64> = times.iter().map(|t| q(*t)).collect();
        let noise: Vec<f64> = clean.iter().map(|_| SIGMA * normal()).collect();
        let noisy: Vec<f64> = clean.iter().zip(&noise).map(|(q, n)| q + n).collect();
        let motion = fit(&noisy, spacing);
        let acceleration = |m: &FittedMotion, t: f64| {
            let mut a = [0.0];
            m.derivative(t, 2, &mut a);
            a[0]
        };
        let inside: Vec<f64> = times.iter().copied().filter(|t| (3.0..57.0).contains(t)).collect();
        let rms =
            |of: &dyn Fn(f64) -> f64| (inside.iter().map(|t| of(*t).powi(2)).sum::<f64>() / inside.len() as f64).sqrt();
        let h = 1e-3;
        let exact = |t: f64| (q(t + h) - 2.0 * q(t) + q(t - h)) / (h * h);
        let (bent, shaken) = (fit(&clean, spacing), fit(&noise, spacing));
        let law = Bent::of(&motion, &[SIGMA], spacing, (SAMPLES, DT)).unwrap();
        let mut squares = 0.0;
        for _ in 0..8 {
            let x = law.draw(&mut rng).unwrap();
            assert_eq!((x.dof(), x.duration()), (1, motion.duration()));
            let read: Vec<f64> = times
                .iter()
                .map(|t| {
                    let mut q = [0.0];
                    x.derivative(*t, 0, &mut q);
                    q[0]
                })
                .collect();
            // It neither starts nor ends with a rate.
            let most = read.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            assert!(read[0].abs() < 1e-4 * most && (read[1] - read[0]).abs() < 1e-3 * most, "{:?} {most}", &read[..2]);
            let taken = fit(&read, spacing);
            squares += rms(&|t| acceleration(&x, t) - acceleration(&taken, t)).powi(2) / 8.0;
        }
        [rms(&|t| acceleration(&bent, t) - exact(t)), rms(&|t| acceleration(&shaken, t)), squares.sqrt()]
    }

    #[test]
    fn draws_are_as_large_as_what_is_bent_of_corners_and_small_where_there_are_none() {
        // Jerk of 0.9, 0, -0.9, 0, ... rad/s^3 for uneven times.
        let corners: Vec<(f64, f64)> = (0..28)
            .map(|i| {
                (2.3 + 1.9 * f64::from(i) + 0.37 * (f64::from(i) * 1.7).sin(), [0.9, -0.9, -0.9, 0.9][i as usize % 4])
            })
            .collect();
        let cornered = |t: f64| corners.iter().map(|c| c.1 * (t - c.0).max(0.0).powi(3) / 6.0).sum::<f64>();
        for spacing in [0.3, 0.5] {
            let [bent, noise, drawn] = errors(&cornered, spacing);
            eprintln!("{spacing}: bent {bent:e}, noise {noise:e}, drawn {drawn:e}");
            assert!((0.6..2.0).contains(&(drawn / bent)), "{bent:e} {drawn:e}");
        }
        let smooth = |t: f64| 0.4 * (1.3 * t).sin() + 0.1 * (3.1 * t + 0.4).cos();
        let [bent, noise, drawn] = errors(&smooth, 0.3);
        eprintln!("smooth: bent {bent:e}, noise {noise:e}, drawn {drawn:e}");
        assert!(drawn < 0.8 * noise, "{bent:e} {noise:e} {drawn:e}");
    }
}
