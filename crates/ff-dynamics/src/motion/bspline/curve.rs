//! Joint motion as a B-spline.

use super::{BSplineError, Knots};
use crate::motion::joint::{JointMotion, at_rest, is_outside};
use nalgebra::DMatrix;

/// `n` joints moving along `q(t) = sum_i N_{i,p}(t) P_i` (P&T eq. 3.1).
#[derive(Clone, Debug, PartialEq)]
pub struct BSplineMotion {
    knots: Knots,
    control: DMatrix<f64>,
}

impl BSplineMotion {
    /// From a basis of `k` functions and control points `n x k` (rad or m), one column per control point.
    ///
    /// # Errors
    /// [`BSplineError::Control`] if the shape does not fit or a value is not finite.
    pub fn new(knots: Knots, control: DMatrix<f64>) -> Result<Self, BSplineError> {
        if control.ncols() != knots.count() || control.nrows() == 0 {
            let (n, k) = control.shape();
            return Err(BSplineError::Control(format!("{n} joints x {k} points, expected {} points", knots.count())));
        }
        if let Some(i) = control.iter().position(|x| !x.is_finite()) {
            let (joint, point) = (i % control.nrows(), i / control.nrows());
            return Err(BSplineError::Control(format!("joint {joint}, point {point} is {}", control[i])));
        }
        Ok(Self { knots, control })
    }
    /// The basis.
    pub fn knots(&self) -> &Knots {
        &self.knots
    }
    /// Control points, `n x k`.
    pub fn control(&self) -> &DMatrix<f64> {
        &self.control
    }
    /// Basis and control points (`n x (k - order)`) of a derivative curve (P&T eqs. 3.4-3.6). Allocates.
    ///
    /// # Errors
    /// [`BSplineError::Order`] if that derivative is not a spline.
    pub fn derivative_control(&self, order: usize) -> Result<(Knots, DMatrix<f64>), BSplineError> {
        let (mut knots, mut control) = (self.knots.clone(), self.control.clone());
        for _ in 0..order {
            let lower = knots.derivative().map_err(|_| BSplineError::Order { order, degree: self.knots.degree() })?;
            control = knots.difference(&control);
            knots = lower;
        }
        Ok((knots, control))
    }
    /// The same curve with every knot span divided into `parts`. Allocates.
    #[must_use]
    pub fn refined(&self, parts: usize) -> Self {
        let r = self.knots.refine(parts);
        Self { control: r.apply(&self.control), knots: r.knots().clone() }
    }
    /// The same path over another duration (s): rates scale with `1/T`, accelerations with `1/T^2`.
    ///
    /// # Errors
    /// [`BSplineError::Duration`].
    pub fn with_duration(&self, duration: f64) -> Result<Self, BSplineError> {
        Ok(Self { knots: self.knots.with_duration(duration)?, control: self.control.clone() })
    }
    /// Derivative of any order of all joints at time `t` (s), clamped to `[0, duration]`; `out` is `n` long,
    /// units `rad/s^order`. Does not allocate.
    ///
    /// # Panics
    /// If `out` is shorter than `n`.
    pub fn derivative(&self, t: f64, order: usize, out: &mut [f64]) {
        let b = self.knots.derivative_at(t, order);
        if order == 0 {
            self.combine(b.first, &b.values, out);
        } else {
            self.combine_rates(b.first, &b.values, out);
        }
    }
    fn combine(&self, first: usize, weights: &[f64], out: &mut [f64]) {
        let n = self.control.nrows();
        let out = &mut out[..n];
        out.fill(0.0);
        for j in 0..=self.knots.degree() {
            for (o, p) in out.iter_mut().zip(self.control.column(first + j).iter()) {
                *o += weights[j] * p;
            }
        }
    }
    /// Weights of a derivative sum to zero, so any reference point may be subtracted first. The one with
    /// the greatest weight makes derivatives vanish exactly where the control points that act are equal:
    /// rest is rest, not 1e-16.
    fn combine_rates(&self, first: usize, weights: &[f64], out: &mut [f64]) {
        let n = self.control.nrows();
        let p = self.knots.degree();
        let heaviest = (0..=p).fold(0, |m, j| if weights[j].abs() > weights[m].abs() { j } else { m });
        for (i, o) in out[..n].iter_mut().enumerate() {
            let reference = self.control[(i, first + heaviest)];
            *o = (0..=p).map(|j| weights[j] * (self.control[(i, first + j)] - reference)).sum();
        }
    }
}

impl JointMotion for BSplineMotion {
    fn dof(&self) -> usize {
        self.control.nrows()
    }
    fn duration(&self) -> f64 {
        self.knots.duration()
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let (first, [b0, b1, b2]) = self.knots.local::<3>(t);
        self.combine(first, &b0, q);
        if is_outside(t, self.duration()) {
            at_rest(self.dof(), qd, qdd);
        } else {
            self.combine_rates(first, &b1, qd);
            self.combine_rates(first, &b2, qdd);
        }
    }
    /// The knots.
    fn breaks(&self) -> Vec<f64> {
        self.knots.breaks()
    }
}
