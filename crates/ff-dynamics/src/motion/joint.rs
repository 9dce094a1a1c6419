//! Prescribed joint motion: what a position-controlled arm does, as a function of time.
//!
//! A free-floating system whose arm is position-controlled needs no joint states: the simulator asks a
//! [`JointMotion`] for `(q, qd, qdd)` at each stage time. Units are rad, rad/s, rad/s^2 for rotary joints and
//! m, m/s, m/s^2 for sliding ones.

use std::sync::Arc;
use thiserror::Error;

/// Positions and rates of two motions that follow each other must agree to this (rad or m; rad/s or m/s).
pub const JOIN_TOLERANCE: f64 = 1e-9;

/// Why a motion could not be built.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MotionError {
    /// No joints, no samples or no segments.
    #[error("a motion needs at least one {0}")]
    Empty(&'static str),
    /// A number that is not finite.
    #[error("{what} of joint {joint} at index {index} is {value}, which is not finite")]
    NotFinite {
        /// Which quantity.
        what: &'static str,
        /// Joint index, from 0.
        joint: usize,
        /// Sample or segment index, from 0.
        index: usize,
        /// The value met.
        value: f64,
    },
    /// A duration or sample time that is negative, zero where it must not be, or not finite.
    #[error("{what} is {value} s; it must be finite and {need}")]
    BadTime {
        /// Which time.
        what: &'static str,
        /// The value met (s).
        value: f64,
        /// What was needed.
        need: &'static str,
    },
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
    /// Two segments of a sequence do not join.
    #[error("segment {segment} starts with {what} {start} of joint {joint}, but the segment before ends with {end}")]
    Gap {
        /// Index of the later segment.
        segment: usize,
        /// `"position"` or `"rate"`.
        what: &'static str,
        /// Joint index, from 0.
        joint: usize,
        /// Value at the end of the earlier segment.
        end: f64,
        /// Value at the start of the later segment.
        start: f64,
    },
}

/// Prescribed motion of `n` joints over `[0, duration]`.
///
/// Before 0 and after the duration the motion is held at its end position with rates and accelerations
/// zero; both end points belong to the motion itself.
pub trait JointMotion: Send + Sync {
    /// Number of joints `n`.
    fn dof(&self) -> usize;
    /// Length of the motion (s), finite and not negative.
    fn duration(&self) -> f64;
    /// Position, rate and acceleration of all joints at time `t` (s). Each slice is `n` long.
    /// Does not allocate.
    ///
    /// # Panics
    /// If a slice is shorter than `n`.
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]);
    /// Times (s), ascending, at which some derivative of `qdd` or `qdd` itself jumps. A fixed-step
    /// integrator keeps its order when these are step boundaries. Empty when unknown or smooth.
    /// Allocates.
    fn breaks(&self) -> Vec<f64> {
        Vec::new()
    }
}

macro_rules! forward_motion {
    ($($ptr:ty),*) => {$(
        impl<M: JointMotion + ?Sized> JointMotion for $ptr {
            fn dof(&self) -> usize {
                (**self).dof()
            }
            fn duration(&self) -> f64 {
                (**self).duration()
            }
            fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
                (**self).eval(t, q, qd, qdd);
            }
            fn breaks(&self) -> Vec<f64> {
                (**self).breaks()
            }
        }
    )*};
}
forward_motion!(Box<M>, Arc<M>, &M);

/// Part of the duration that a time may be beyond an end by rounding: `k * dt` of the last sample need not be the duration, and is at
/// the end of the motion, not behind it.
const ROUNDED: f64 = 1e-12;

/// Whether a time lies outside `[0, duration]`, by more than rounding.
pub(crate) fn is_outside(t: f64, duration: f64) -> bool {
    t < -ROUNDED * duration || t > duration + ROUNDED * duration
}

/// Zeroes the first `n` rates and accelerations: what holds outside `[0, duration]`.
pub(crate) fn at_rest(n: usize, qd: &mut [f64], qdd: &mut [f64]) {
    qd[..n].fill(0.0);
    qdd[..n].fill(0.0);
}

pub(crate) fn check_time(what: &'static str, value: f64, positive: bool) -> Result<(), MotionError> {
    if value.is_finite() && (value > 0.0 || (value == 0.0 && !positive)) {
        return Ok(());
    }
    Err(MotionError::BadTime { what, value, need: if positive { "positive" } else { "not negative" } })
}

/// All joints held at a constant configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct Hold {
    q: Vec<f64>,
    duration: f64,
}

impl Hold {
    /// Holds `q` (rad or m) for `duration` (s), which may be zero.
    ///
    /// # Errors
    /// [`MotionError`] if `q` is empty or not finite, or the duration is negative or not finite.
    pub fn new(q: Vec<f64>, duration: f64) -> Result<Self, MotionError> {
        if q.is_empty() {
            return Err(MotionError::Empty("joint"));
        }
        check_time("duration", duration, false)?;
        if let Some(joint) = q.iter().position(|x| !x.is_finite()) {
            return Err(MotionError::NotFinite { what: "position", joint, index: 0, value: q[joint] });
        }
        Ok(Self { q, duration })
    }
}

impl JointMotion for Hold {
    fn dof(&self) -> usize {
        self.q.len()
    }
    fn duration(&self) -> f64 {
        self.duration
    }
    fn eval(&self, _t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        q[..self.q.len()].copy_from_slice(&self.q);
        at_rest(self.q.len(), qd, qdd);
    }
}

/// Several motions one after another.
///
/// At a join the later motion speaks. Accelerations may jump there (the join is then a break time);
/// positions and rates may not: a jump in rate is an impulse that no integrator would see, so momentum
/// would silently not be conserved.
pub struct Sequence {
    parts: Vec<Box<dyn JointMotion>>,
    starts: Vec<f64>,
    duration: f64,
}

impl std::fmt::Debug for Sequence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sequence").field("starts", &self.starts).field("duration", &self.duration).finish()
    }
}

impl Sequence {
    /// Puts `parts` one after another.
    ///
    /// # Errors
    /// [`MotionError`] if there is no part, the numbers of joints differ, a duration is bad, or a position
    /// or rate differs by more than [`JOIN_TOLERANCE`] across a join.
    pub fn new(parts: Vec<Box<dyn JointMotion>>) -> Result<Self, MotionError> {
        let n = parts.first().ok_or(MotionError::Empty("segment"))?.dof();
        let mut starts = Vec::with_capacity(parts.len());
        let mut duration = 0.0;
        let (mut end, mut begin, mut acc) = (vec![0.0; 2 * n], vec![0.0; 2 * n], vec![0.0; n]);
        for (segment, part) in parts.iter().enumerate() {
            if part.dof() != n {
                return Err(MotionError::Length { what: "joint list of a segment", got: part.dof(), expected: n });
            }
            check_time("duration of a segment", part.duration(), false)?;
            if segment > 0 {
                let (q, qd) = begin.split_at_mut(n);
                part.eval(0.0, q, qd, &mut acc);
                for i in 0..2 * n {
                    // Written so that a NaN counts as a gap.
                    let joins = (end[i] - begin[i]).abs() <= JOIN_TOLERANCE;
                    if !joins {
                        let what = if i < n { "position" } else { "rate" };
                        let (joint, end, start) = (i % n, end[i], begin[i]);
                        return Err(MotionError::Gap { segment, what, joint, end, start });
                    }
                }
            }
            let (q, qd) = end.split_at_mut(n);
            part.eval(part.duration(), q, qd, &mut acc);
            starts.push(duration);
            duration += part.duration();
        }
        Ok(Self { parts, starts, duration })
    }
    /// Start time of each part (s).
    pub fn starts(&self) -> &[f64] {
        &self.starts
    }
}

impl JointMotion for Sequence {
    fn dof(&self) -> usize {
        self.parts[0].dof()
    }
    fn duration(&self) -> f64 {
        self.duration
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let inside = t.clamp(0.0, self.duration);
        let k = self.starts.partition_point(|&s| s <= inside).saturating_sub(1);
        // Rounding in the sum of durations must not carry the local time past the end of its part.
        let local = (inside - self.starts[k]).min(self.parts[k].duration());
        self.parts[k].eval(local, q, qd, qdd);
        if is_outside(t, self.duration) {
            at_rest(self.dof(), qd, qdd);
        }
    }
    fn breaks(&self) -> Vec<f64> {
        let mut out = Vec::new();
        for (part, start) in self.parts.iter().zip(&self.starts) {
            out.push(*start);
            out.extend(part.breaks().iter().map(|b| start + b));
        }
        out.push(self.duration);
        out.sort_by(f64::total_cmp);
        out.dedup_by(|a, b| (*a - *b).abs() <= 1e-12 * (1.0 + b.abs()));
        out
    }
}

/// Quintic Hermite interpolation through uniformly sampled positions, rates and accelerations.
///
/// Between samples `k` and `k + 1`, with `s = (t - k h) / h`, the unique polynomial of degree 5 that takes
/// the six given end values: `q(s) = sum_i c_i s^i`, `c0 = q0`, `c1 = h qd0`, `c2 = h^2 qdd0 / 2` and, with
/// `d = q1 - c0 - c1 - c2`, `e = h qd1 - c1 - 2 c2`, `f = h^2 qdd1 - 2 c2`,
/// `c3 = 10 d - 4 e + f/2`, `c4 = -15 d + 7 e - f`, `c5 = 6 d - 3 e + f/2`
/// (solve the 3x3 system of the end conditions at `s = 1`). Twice continuously differentiable; reproduces
/// polynomials of degree 5; returns the samples themselves at sample times.
#[derive(Clone, Debug, PartialEq)]
pub struct HermiteTable {
    dof: usize,
    samples: usize,
    step: f64,
    /// Per sample `[q n | qd n | qdd n]`.
    data: Vec<f64>,
}

impl HermiteTable {
    /// From samples at times `0, h, 2h, ...`: `q`, `qd`, `qdd` each hold `n` values per sample, one sample
    /// after another; `step` is `h` (s).
    ///
    /// # Errors
    /// [`MotionError`] if `n` is zero, there is no sample, lengths disagree, a value is not finite or the
    /// step is not positive.
    pub fn new(dof: usize, step: f64, q: &[f64], qd: &[f64], qdd: &[f64]) -> Result<Self, MotionError> {
        if dof == 0 {
            return Err(MotionError::Empty("joint"));
        }
        check_time("sample time", step, true)?;
        let samples = q.len() / dof;
        if samples == 0 {
            return Err(MotionError::Empty("sample"));
        }
        for (what, x) in [("q", q), ("qd", qd), ("qdd", qdd)] {
            if x.len() != samples * dof {
                return Err(MotionError::Length { what, got: x.len(), expected: samples * dof });
            }
            if let Some(i) = x.iter().position(|v| !v.is_finite()) {
                return Err(MotionError::NotFinite { what, joint: i % dof, index: i / dof, value: x[i] });
            }
        }
        let mut data = Vec::with_capacity(3 * samples * dof);
        for k in 0..samples {
            let row = k * dof..(k + 1) * dof;
            data.extend_from_slice(&q[row.clone()]);
            data.extend_from_slice(&qd[row.clone()]);
            data.extend_from_slice(&qdd[row]);
        }
        Ok(Self { dof, samples, step, data })
    }
    /// Samples any motion at step `step` (s) from 0 to its duration (the last interval may reach past it).
    ///
    /// # Errors
    /// [`MotionError`] as [`HermiteTable::new`].
    pub fn sample(motion: &dyn JointMotion, step: f64) -> Result<Self, MotionError> {
        check_time("sample time", step, true)?;
        let n = motion.dof();
        let samples = (motion.duration() / step - 1e-9).ceil().max(0.0) as usize + 1;
        let (mut q, mut qd, mut qdd) = (vec![0.0; n * samples], vec![0.0; n * samples], vec![0.0; n * samples]);
        for k in 0..samples {
            let r = k * n..(k + 1) * n;
            motion.eval(k as f64 * step, &mut q[r.clone()], &mut qd[r.clone()], &mut qdd[r]);
        }
        Self::new(n, step, &q, &qd, &qdd)
    }
    /// Sample time `h` (s).
    pub fn step(&self) -> f64 {
        self.step
    }
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.samples
    }
}

impl JointMotion for HermiteTable {
    fn dof(&self) -> usize {
        self.dof
    }
    fn duration(&self) -> f64 {
        (self.samples - 1) as f64 * self.step
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let (n, h) = (self.dof, self.step);
        let last = (self.samples - 1) as f64;
        let x = (t / h).clamp(0.0, last);
        let near = x.round();
        // k * h / h need not be k in floating point; sample times still return the samples.
        let snap = (x - near).abs() <= 1e-9;
        let k = if snap { near as usize } else { x.floor() as usize };
        let a = &self.data[3 * n * k..3 * n * (k + 1)];
        if snap {
            q[..n].copy_from_slice(&a[..n]);
            qd[..n].copy_from_slice(&a[n..2 * n]);
            qdd[..n].copy_from_slice(&a[2 * n..]);
        } else {
            let b = &self.data[3 * n * (k + 1)..3 * n * (k + 2)];
            let s = x - k as f64;
            for i in 0..n {
                let (c0, c1, c2) = (a[i], h * a[n + i], 0.5 * h * h * a[2 * n + i]);
                let d = b[i] - c0 - c1 - c2;
                let e = h * b[n + i] - c1 - 2.0 * c2;
                let f = h * h * b[2 * n + i] - 2.0 * c2;
                let (c3, c4, c5) = (10.0 * d - 4.0 * e + 0.5 * f, -15.0 * d + 7.0 * e - f, 6.0 * d - 3.0 * e + 0.5 * f);
                q[i] = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))));
                qd[i] = (c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h;
                qdd[i] = (2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (h * h);
            }
        }
        if t < -1e-9 * h || t > self.duration() + 1e-9 * h {
            at_rest(n, qd, qdd);
        }
    }
}
