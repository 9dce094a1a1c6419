//! Base attitude excursion and base rate.

use super::held::{HeldPartials, HeldSystem, HeldWork};
use super::windows::Signal;
use super::{Channel, ConstraintError, Snapshot, check_limit};
use ff_model::so3::{exp_so3, log_so3, quat_identity, quat_mul, quat_to_rot};
use nalgebra::{DMatrix, Matrix3, Vector3};
use std::ops::Range;
use std::sync::Arc;

/// `|omega_b| <= limit` (rad/s).
#[derive(Clone, Debug)]
pub struct BaseRate {
    system: Arc<HeldSystem>,
    channel: [Channel; 1],
}

impl BaseRate {
    /// Allocates a name.
    ///
    /// # Errors
    /// [`ConstraintError::Limit`].
    pub fn new(system: &Arc<HeldSystem>, limit: f64) -> Result<Self, ConstraintError> {
        check_limit("base rate", limit, "rad/s")?;
        let channel = [Channel::at_most("base rate", system.model().body_name(0), "rad/s", limit)];
        Ok(Self { system: system.clone(), channel })
    }
}

/// Unit vector, or zero for a vector of length zero, whose length has no derivative.
pub(super) fn direction(v: &Vector3<f64>) -> Vector3<f64> {
    let norm = v.norm();
    if norm > 0.0 { v / norm } else { Vector3::zeros() }
}

impl Signal for BaseRate {
    type Work = (HeldWork, HeldPartials);
    fn channels(&self) -> &[Channel] {
        &self.channel
    }
    fn work(&self) -> Self::Work {
        (self.system.work(), self.system.partials())
    }
    fn drive(&self, (w, d): &mut Self::Work, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>) {
        match partials {
            None => drop(self.system.evaluate(w, s)),
            Some(out) => {
                self.system.differentiate(w, s, d);
                let e = direction(&w.twist.fixed_rows::<3>(3).into_owned());
                (0..out.ncols()).for_each(|k| out[(0, k)] = e.dot(&d.twist.fixed_view::<3, 1>(3, k)));
            }
        }
        u[0] = w.twist.fixed_rows::<3>(3).norm();
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        out[0] = Vector3::new(at.twist[3], at.twist[4], at.twist[5]).norm();
    }
}

/// Geodesic angle of the base from its attitude at the start, at most `limit` (rad).
#[derive(Clone, Debug)]
pub struct BaseAttitude {
    system: Arc<HeldSystem>,
    channel: [Channel; 1],
}

impl BaseAttitude {
    /// A limit in `(0, pi)`. Allocates a name.
    ///
    /// # Errors
    /// [`ConstraintError::Limit`].
    pub fn new(system: &Arc<HeldSystem>, limit: f64) -> Result<Self, ConstraintError> {
        check_limit("base attitude excursion", limit, "rad")?;
        let channel = [Channel::at_most("base attitude excursion", system.model().body_name(0), "rad", limit)];
        Ok(Self { system: system.clone(), channel })
    }
}

/// Buffers of a history of the attitude: base rates are the drives.
#[derive(Clone, Debug)]
pub struct History {
    held: HeldWork,
    partials: HeldPartials,
    pub(super) turning: Turning,
}

impl History {
    pub(super) fn new(system: &HeldSystem) -> Self {
        Self { held: system.work(), partials: system.partials(), turning: Turning::default() }
    }
    pub(super) fn rates(
        &mut self,
        system: &HeldSystem,
        s: [&[f64]; 3],
        u: &mut [f64],
        partials: Option<&mut DMatrix<f64>>,
    ) {
        match partials {
            None => drop(system.evaluate(&mut self.held, s)),
            Some(out) => {
                system.differentiate(&mut self.held, s, &mut self.partials);
                out.copy_from(&self.partials.twist.rows(3, 3));
            }
        }
        u.copy_from_slice(&self.held.twist.as_slice()[3..]);
    }
}

/// Attitudes `R_k` (base to world, identity at the start) from base rates in base axes (`3 x N`), by
/// `R_(k+1) = R_k exp(h/2 (w_k + w_(k+1)) + h^2/12 w_k x w_(k+1))`: the trapezoidal rule with the commutator of the
/// fourth Magnus term (Iserles and others, *Lie-group methods*, Acta Numerica 2000).
#[derive(Clone, Debug, Default)]
pub(super) struct Turning {
    pub(super) attitude: Vec<Matrix3<f64>>,
    /// `R_k J_l(Omega_k)`, which carries a change of step `k` into the world.
    carried: Vec<Matrix3<f64>>,
    dt: f64,
}

impl Turning {
    pub(super) fn new(dt: f64, u: &DMatrix<f64>) -> Self {
        let count = u.ncols();
        let rate = |k: usize| Vector3::new(u[(0, k)], u[(1, k)], u[(2, k)]);
        let mut quat = quat_identity();
        let mut out = Self { attitude: vec![Matrix3::identity()], carried: Vec::with_capacity(count), dt };
        for k in 0..count - 1 {
            let (a, b) = (rate(k), rate(k + 1));
            let step = (a + b) * (0.5 * dt) + a.cross(&b) * (dt * dt / 12.0);
            out.carried.push(out.attitude[k] * left_jacobian(&step));
            quat = quat_mul(&quat, &exp_so3(&step));
            out.attitude.push(quat_to_rot(&quat));
        }
        out
    }
    /// Given the derivatives of a scalar with respect to small turns (world axes) of the attitudes in `window`, adds
    /// those with respect to the rates and returns that with respect to `dt`.
    pub(super) fn adjoint(
        &self,
        u: &DMatrix<f64>,
        window: Range<usize>,
        over_turn: impl Fn(usize) -> Vector3<f64>,
        over_u: &mut DMatrix<f64>,
    ) -> f64 {
        let rate = |k: usize| Vector3::new(u[(0, k)], u[(1, k)], u[(2, k)]);
        let (mut later, mut over_dt) = (Vector3::zeros(), 0.0);
        for k in (0..window.end - 1).rev() {
            if k + 1 >= window.start {
                later += over_turn(k + 1);
            }
            let l = self.carried[k].tr_mul(&later);
            let (a, b) = (rate(k), rate(k + 1));
            let (half, twelfth) = (0.5 * self.dt, self.dt * self.dt / 12.0);
            // l . (a x db) = (l x a) . db,  l . (da x b) = (b x l) . da.
            let (over_a, over_b) = (l * half + b.cross(&l) * twelfth, l * half + l.cross(&a) * twelfth);
            for i in 0..3 {
                over_u[(i, k)] += over_a[i];
                over_u[(i, k + 1)] += over_b[i];
            }
            over_dt += l.dot(&((a + b) * 0.5 + a.cross(&b) * (self.dt / 6.0)));
        }
        over_dt
    }
}

/// `J_l(u)`: `exp(u + du) = exp(J_l du) exp(u)` to first order.
fn left_jacobian(u: &Vector3<f64>) -> Matrix3<f64> {
    let angle = u.norm();
    let x = u.cross_matrix();
    let (a, b) = if angle < 1e-4 {
        (0.5 - angle * angle / 24.0, 1.0 / 6.0 - angle * angle / 120.0)
    } else {
        ((1.0 - angle.cos()) / (angle * angle), (angle - angle.sin()) / angle.powi(3))
    };
    Matrix3::identity() + x * a + x * x * b
}

/// Angle of a rotation and its axis, which is the derivative with respect to small turns in the world.
fn excursion(r: &Matrix3<f64>) -> (f64, Vector3<f64>) {
    let v = log_so3(&ff_model::so3::rot_to_quat(r));
    (v.norm(), direction(&v))
}

impl Signal for BaseAttitude {
    type Work = History;
    fn channels(&self) -> &[Channel] {
        &self.channel
    }
    fn drives(&self) -> usize {
        3
    }
    fn work(&self) -> Self::Work {
        History::new(&self.system)
    }
    fn drive(&self, w: &mut Self::Work, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>) {
        w.rates(&self.system, s, u, partials);
    }
    fn respond(&self, w: &mut Self::Work, dt: f64, u: &DMatrix<f64>, y: &mut DMatrix<f64>) {
        w.turning = Turning::new(dt, u);
        for (k, r) in w.turning.attitude.iter().enumerate() {
            y[(0, k)] = excursion(r).0;
        }
    }
    fn reaches_back(&self) -> bool {
        true
    }
    fn adjoint(
        &self,
        w: &Self::Work,
        u: &DMatrix<f64>,
        _channel: usize,
        window: Range<usize>,
        weights: &[f64],
        over_u: &mut DMatrix<f64>,
    ) -> f64 {
        let (t, start) = (&w.turning, window.start);
        t.adjoint(u, window, |k| excursion(&t.attitude[k]).1 * weights[k - start], over_u)
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        out[0] = log_so3(&at.att).norm();
    }
}
