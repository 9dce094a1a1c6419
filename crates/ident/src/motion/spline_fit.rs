//! Joint records to smooth motion: a least-squares B-spline through sampled joint positions.
//!
//! Differencing samples multiplies noise by `1/h` and `1/h^2`; a spline with few knots averages it first and
//! gives position, rate and acceleration of one and the same curve. Least-squares spline approximation as in
//! de Boor (*A Practical Guide to Splines*, ch. XIV) and Piegl and Tiller (*The NURBS Book*, 9.4.1), with
//! uniform clamped knots of degree 7: `min sum_k |N(t_k) P - q_k|^2 / s^2 + |N'(t_k) P - qd_k|^2 / s_d^2`.
//! The normal matrix has bandwidth 7, so its Cholesky factorisation costs `O(k)`.

use crate::motion::kink::{Column, FittedMotion, Kink, with_times};
use crate::motion::spline_basis::SplineBasis;
use ff_dynamics::motion::bspline::BSplineError;
use thiserror::Error;

/// Degree of the fitted splines: acceleration five times continuously differentiable.
pub const DEGREE: usize = 7;

/// Samples per knot below which a spline follows every sample.
pub(super) const SAMPLES_PER_KNOT: f64 = 2.5;

/// Why a record could not be fitted.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FitError {
    /// Lengths that do not agree.
    #[error("{what} has length {got}, expected {expected}")]
    Length {
        /// Which argument.
        what: &'static str,
        /// Length met.
        got: usize,
        /// Length needed.
        expected: usize,
    },
    /// A value that is not finite.
    #[error("{what}, sample {sample}: {value} is not finite")]
    NotFinite {
        /// Which argument.
        what: &'static str,
        /// Sample index, from 0.
        sample: usize,
        /// The value met.
        value: f64,
    },
    /// Sample times that do not start at 0 or do not ascend.
    #[error("sample {sample} is at {time} s; times must start at 0 and ascend")]
    Time {
        /// Sample index, from 0.
        sample: usize,
        /// Its time (s).
        time: f64,
    },
    /// A spacing or standard deviation out of range.
    #[error("{what} is {value}; it must be positive and finite")]
    Value {
        /// Which argument.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Too few samples near one time for the knot spacing asked for.
    #[error("too few samples near {time} s for this knot spacing; widen it or fill the gap")]
    Undetermined {
        /// Where (s).
        time: f64,
    },
    /// Sample times that are not equally spaced where they must be.
    #[error("sample {sample} at {time} s is off the even grid by more than 1 %; give the noise instead")]
    Uneven {
        /// Sample index, from 0.
        sample: usize,
        /// Its time (s).
        time: f64,
    },
    /// The spline could not be built.
    #[error(transparent)]
    Spline(#[from] BSplineError),
}

/// Sampled joint motion. Sample `k` of joint `j` stands at `[k n + j]`.
#[derive(Clone, Copy, Debug)]
pub struct JointSamples<'a> {
    /// Number of joints `n`.
    pub dof: usize,
    /// Sample times (s), ascending from 0; not necessarily equally spaced.
    pub times: &'a [f64],
    /// Positions (rad or m).
    pub q: &'a [f64],
    /// Rates (rad/s or m/s), if measured.
    pub qd: Option<&'a [f64]>,
    /// Standard deviation of the positions over that of the rates (s); weighs the rates. Not used
    /// without rates.
    pub rate_weight: f64,
}

/// A fitted motion and how well it fits.
#[derive(Clone, Debug)]
pub struct MotionFit {
    /// The motion, with consistent rates and accelerations.
    pub motion: FittedMotion,
    /// Knot spacing used (s).
    pub spacing: f64,
    /// Residual rms of the positions per joint (rad or m), divided by the degrees of freedom left
    /// (samples less control points, when only positions are fitted): an estimate of the noise if the
    /// spline can follow the motion.
    pub residual: Vec<f64>,
    /// Residual rms of the rates per joint (rad/s), plain; empty without rates.
    pub rate_residual: Vec<f64>,
    /// Variance of the fitted rate at the first sample for white noise of unit deviation in position (1/s^2).
    pub start_rate_variance: f64,
    /// The rates at the first sample were held at zero ([`fit_motion_from_rest`]).
    pub from_rest: bool,
}

impl MotionFit {
    /// Whether the motion may have started from rest: the fitted rates at the first sample are zero to four standard deviations,
    /// for positions with this noise (rad or m, per joint). Allocates.
    pub fn may_start_at_rest(&self, noise: &[f64]) -> bool {
        let mut rate = vec![0.0; noise.len()];
        self.motion.derivative(0.0, 1, &mut rate);
        let s = self.start_rate_variance.sqrt();
        rate.iter().zip(noise).zip(&self.residual).all(|((v, n), r)| v.abs() <= 4.0 * s * n.max(*r))
    }
}

/// Fits a spline with knots `spacing` (s) apart (rounded so that spans are equal). Allocates.
///
/// # Errors
/// [`FitError`] naming the argument or the time where samples are missing.
pub fn fit_motion(samples: &JointSamples<'_>, spacing: f64) -> Result<MotionFit, FitError> {
    fit_with_kinks(samples, spacing, &[], false)
}

/// [`fit_motion`] with the rates at the first sample held at zero.
///
/// Splines are loose at their ends. The rate that noise leaves there is small, but a simulation that starts with the base at rest
/// takes it for momentum, and for a kick to everything that swings. Allocates.
///
/// # Errors
/// As [`fit_motion`].
pub fn fit_motion_from_rest(samples: &JointSamples<'_>, spacing: f64) -> Result<MotionFit, FitError> {
    fit_with_kinks(samples, spacing, &[], true)
}

/// [`fit_motion`] by a spline that has these kinks, of sizes to be found; `from_rest` as in [`fit_motion_from_rest`]. Allocates.
///
/// # Errors
/// As [`fit_motion`]; `Undetermined` at a kink that the samples do not tell from the others.
pub fn fit_with_kinks(
    samples: &JointSamples<'_>,
    spacing: f64,
    kinks: &[Kink],
    from_rest: bool,
) -> Result<MotionFit, FitError> {
    fit_spacing(samples, spacing, &Shape { degree: DEGREE, from_rest, kinks })
}

/// [`fit_motion`] by a spline of another degree, up to [`DEGREE`].
pub(super) fn fit_of_degree(samples: &JointSamples<'_>, spacing: f64, degree: usize) -> Result<MotionFit, FitError> {
    fit_spacing(samples, spacing, &Shape { degree, from_rest: false, kinks: &[] })
}

/// Kinks of one order less, for those of these kinks whose times (s) positions with this noise (rad or m, per joint) tell to `within`, or, of a motion that is `planned`, to
/// a part of the time to their neighbours: what errors of their times add to a motion, to first order, which errors as long as the kinks are
/// apart are not. Allocates.
pub(super) fn movable(
    samples: &JointSamples<'_>,
    spacing: f64,
    kinks: &[(Kink, f64)],
    planned: bool,
    noise: &[f64],
    within: f64,
) -> Vec<Kink> {
    let Ok(basis) = SplineBasis::new(samples, spans(samples, spacing), DEGREE, false) else { return Vec::new() };
    let mut out = Vec::new();
    for (j, sigma) in noise.iter().enumerate() {
        let own: Vec<(Kink, f64)> = kinks.iter().filter(|k| k.0.joint == j).copied().collect();
        let all: Vec<Kink> = own.iter().map(|k| k.0).collect();
        let (lowest, both) = with_times(&all);
        let none = nalgebra::DVector::zeros(basis.knots.count());
        let Ok(bent) = basis.bend(samples, j, &both, &none) else { continue };
        let told = |i: usize| {
            let (kink, size) = own[lowest[i]];
            let apart = all.iter().map(|k| (k.time - kink.time).abs()).filter(|apart| *apart > 0.0);
            let next = apart.fold(f64::INFINITY, f64::min);
            let within = if planned { within.max(OF_A_GAP * next) } else { within };
            sigma * bent.variances[all.len() + i].sqrt() < within * size.abs()
        };
        out.extend((0..lowest.len()).filter(|i| told(*i)).map(|i| both[all.len() + i]));
    }
    out
}

/// Part of the time from a knot of a plan to the next to which errors of its time are of first order.
const OF_A_GAP: f64 = 0.1;

/// What a spline is like.
pub(super) struct Shape<'a> {
    pub(super) degree: usize,
    pub(super) from_rest: bool,
    pub(super) kinks: &'a [Kink],
}

fn fit_spacing(samples: &JointSamples<'_>, spacing: f64, of: &Shape<'_>) -> Result<MotionFit, FitError> {
    let end = check(samples)?;
    positive("knot spacing", spacing)?;
    fit_spans(samples, end, spans(samples, spacing), of)
}

/// Spans of equal length, as near to `spacing` as they can be.
pub(super) fn spans(samples: &JointSamples<'_>, spacing: f64) -> usize {
    let count = samples.times.len();
    (samples.times[count - 1] / spacing).round().clamp(1.0, count as f64) as usize
}

fn fit_spans(samples: &JointSamples<'_>, end: f64, spans: usize, of: &Shape<'_>) -> Result<MotionFit, FitError> {
    let basis = SplineBasis::new(samples, spans, of.degree, of.from_rest)?;
    let mut control = basis.smooth(samples);
    let n = samples.dof;
    let mut kinks: Vec<(Column, f64)> = Vec::with_capacity(of.kinks.len());
    for j in 0..n {
        let own: Vec<Kink> = of.kinks.iter().filter(|k| k.joint == j).copied().collect();
        if !own.is_empty() {
            let bent = basis.bend(samples, j, &own, &control.row(j).transpose())?;
            control.set_row(j, &bent.control.transpose());
            kinks.extend(bent.columns.into_iter().zip(bent.sizes.iter().copied()));
        }
    }
    let (k, start_rate_variance) = (basis.knots.count(), basis.start_rate_variance());
    let knots = basis.knots;
    let m = samples.times.len();
    let ramp = end / (m - 1) as f64;
    let motion = FittedMotion::new(knots, control, kinks, ramp)?;
    let (mut res, mut rate) = (vec![0.0; n], vec![0.0; n]);
    let mut y = vec![0.0; n];
    for (i, &t) in samples.times.iter().enumerate() {
        motion.derivative(t, 0, &mut y);
        for j in 0..n {
            res[j] += (y[j] - samples.q[i * n + j]).powi(2);
        }
        if let Some(qd) = samples.qd {
            motion.derivative(t, 1, &mut y);
            for j in 0..n {
                rate[j] += (y[j] - qd[i * n + j]).powi(2);
            }
        }
    }
    let left = if samples.qd.is_none() && m > k { m - k } else { m };
    res.iter_mut().for_each(|r| *r = (*r / left as f64).sqrt());
    rate.iter_mut().for_each(|r| *r = (*r / m as f64).sqrt());
    let rate_residual = if samples.qd.is_some() { rate } else { Vec::new() };
    let spacing = end / spans as f64;
    let from_rest = of.from_rest;
    Ok(MotionFit { motion, spacing, residual: res, rate_residual, start_rate_variance, from_rest })
}

/// Weights of a difference of order 6, and their sum of squares.
const BINOMIAL: [f64; 7] = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0];
pub(super) const SIXTH: f64 = 924.0;

/// Differences of order 6 of the positions of joint `j`; none of fewer than seven samples.
pub(super) fn sixth_differences(samples: &JointSamples<'_>, j: usize) -> impl Iterator<Item = f64> {
    let (n, q) = (samples.dof, samples.q);
    let rows = (samples.times.len() + 1).saturating_sub(BINOMIAL.len());
    (0..rows).map(move |i| BINOMIAL.iter().enumerate().map(|(a, c)| c * q[(i + a) * n + j]).sum())
}

/// Standard deviation of white noise on each joint position, from differences of order 6 of equally spaced
/// samples: `var(diff^m x) = C(2m, m) sigma^2` for white noise, while a smooth motion of angular frequency
/// `w` keeps only `(w h)^m` of its amplitude (J. von Neumann 1941 for `m = 1`). Needs 7 samples; returns an
/// upper bound when the motion is not smooth at the sample time. Allocates.
///
/// # Errors
/// [`FitError`] if lengths disagree, a value is not finite, there are too few samples or they are uneven.
pub fn noise_estimate(samples: &JointSamples<'_>) -> Result<Vec<f64>, FitError> {
    check(samples)?;
    let (n, m) = (samples.dof, samples.times.len());
    is_even(samples.times)?;
    if m < BINOMIAL.len() {
        return Err(FitError::Length { what: "samples", got: m, expected: BINOMIAL.len() });
    }
    let rows = m + 1 - BINOMIAL.len();
    let of_joint = |j: usize| {
        let sum: f64 = sixth_differences(samples, j).map(|d| d.powi(2)).sum();
        (sum / rows as f64 / SIXTH).sqrt()
    };
    Ok((0..n).map(of_joint).collect())
}

/// Whether ascending times from 0 are equally spaced to a hundredth of an interval.
pub(crate) fn is_even(times: &[f64]) -> Result<(), FitError> {
    let h = times[times.len() - 1] / (times.len() - 1) as f64;
    match times.iter().enumerate().find(|(i, t)| (*t - *i as f64 * h).abs() > 0.01 * h) {
        Some((sample, &time)) => Err(FitError::Uneven { sample, time }),
        None => Ok(()),
    }
}

/// [`noise_estimate`] of samples at any times.
///
/// Where they are not equally spaced, divided differences take the place of differences: `sum_a w_a x(t_a)` over seven neighbours with
/// `w_a = 1 / prod_b (t_a - t_b)` vanishes for polynomials of degree five and has the variance `sigma^2 sum w_a^2` for white noise.
/// Allocates.
///
/// # Errors
/// As [`noise_estimate`], but for uneven times.
pub fn noise_of(samples: &JointSamples<'_>) -> Result<Vec<f64>, FitError> {
    const WINDOW: usize = 7;
    let end = check(samples)?;
    let (n, m) = (samples.dof, samples.times.len());
    if is_even(samples.times).is_ok() {
        return noise_estimate(samples);
    }
    if m < WINDOW {
        return Err(FitError::Length { what: "samples", got: m, expected: WINDOW });
    }
    // In intervals, so that products stay near one.
    let scale = (m - 1) as f64 / end;
    let mut squares = vec![0.0; n];
    for first in 0..=m - WINDOW {
        let t = &samples.times[first..first + WINDOW];
        let w: [f64; WINDOW] = core::array::from_fn(|a| {
            1.0 / (0..WINDOW).filter(|&b| b != a).map(|b| scale * (t[a] - t[b])).product::<f64>()
        });
        let variance: f64 = w.iter().map(|w| w * w).sum();
        for (j, s) in squares.iter_mut().enumerate() {
            let difference: f64 = w.iter().enumerate().map(|(a, w)| w * samples.q[(first + a) * n + j]).sum();
            *s += difference * difference / variance;
        }
    }
    Ok(squares.iter().map(|s| (s / (m + 1 - WINDOW) as f64).sqrt()).collect())
}

/// The coarsest knots whose residual is at the noise floor of every joint.
///
/// Spacings from a quarter of the record down to 2.5 samples, each `1/sqrt(2)` of the one before, are tried.
/// `noise` is the standard deviation per joint (rad or m); without it [`noise_of`] is used. "At the
/// floor" means within two standard deviations of the comparison (`1 + 2 / sqrt(2 N)` for a given noise and `N`
/// samples, twice as wide for an estimated one) or, for noise below it, within 1e-12 of the largest position. Too coarse knots bend the acceleration, too fine ones
/// let noise through: its noise grows with `spacing^-2.5`. The finest spacing is returned when none reaches
/// the floor. Allocates.
///
/// # Errors
/// [`FitError`] as [`fit_motion`]; `Value` if a noise figure is negative or not finite.
pub fn choose_knots(samples: &JointSamples<'_>, noise: Option<&[f64]>) -> Result<MotionFit, FitError> {
    let end = check(samples)?;
    let estimated;
    let mut uncertainty = 1.0;
    let noise = if let Some(s) = noise {
        if s.len() != samples.dof {
            return Err(FitError::Length { what: "noise", got: s.len(), expected: samples.dof });
        }
        if let Some(&value) = s.iter().find(|v| !(v.is_finite() && **v >= 0.0)) {
            return Err(FitError::Value { what: "noise", value });
        }
        s
    } else {
        estimated = noise_of(samples)?;
        // Overlapping differences carry C(12,6)^2 / C(24,12) = 0.316 of the information; both figures vary.
        uncertainty = (1.0 + 1.0 / 0.316f64).sqrt();
        &estimated
    };
    let largest = samples.q.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let count = samples.times.len() as f64;
    let slack = 1.0 + 2.0 * uncertainty / (2.0 * count).sqrt();
    let most = (count / SAMPLES_PER_KNOT).floor().max(1.0);
    let mut spans = 4.0f64.min(most);
    loop {
        let fit =
            fit_spans(samples, end, spans.round() as usize, &Shape { degree: DEGREE, from_rest: false, kinks: &[] })?;
        let reached = fit.residual.iter().zip(noise).all(|(r, s)| *r <= (slack * s).max(1e-12 * largest));
        if reached || spans >= most {
            return Ok(fit);
        }
        spans = (spans * std::f64::consts::SQRT_2).min(most);
    }
}

/// Checks lengths, numbers and times; returns the last time.
fn check(s: &JointSamples<'_>) -> Result<f64, FitError> {
    let m = s.times.len();
    if s.dof == 0 || m < 2 {
        let (what, got, expected) = if s.dof == 0 { ("joint list", 0, 1) } else { ("times", m, 2) };
        return Err(FitError::Length { what, got, expected });
    }
    for (what, x) in [("q", s.q), ("qd", s.qd.unwrap_or(s.q))] {
        if x.len() != m * s.dof {
            return Err(FitError::Length { what, got: x.len(), expected: m * s.dof });
        }
        if let Some(i) = x.iter().position(|v| !v.is_finite()) {
            return Err(FitError::NotFinite { what, sample: i / s.dof, value: x[i] });
        }
    }
    if s.qd.is_some() {
        positive("rate weight", s.rate_weight)?;
    }
    for (sample, &time) in s.times.iter().enumerate() {
        let ascends = time.is_finite() && if sample == 0 { time == 0.0 } else { time > s.times[sample - 1] };
        if !ascends {
            return Err(FitError::Time { sample, time });
        }
    }
    Ok(s.times[m - 1])
}

fn positive(what: &'static str, value: f64) -> Result<(), FitError> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(FitError::Value { what, value }) }
}
