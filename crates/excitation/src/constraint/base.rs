//! Base attitude excursion and base rate.
//!
//! In the search the base rates are those with the appendages held, exact, and the linear response of the appendages;
//! measured are those of the full simulation.

use super::held::{HeldPartials, HeldSystem, HeldWork};
use super::ringing::{Ringing, Rung};
use super::signal::Signal;
use super::{Channel, ConstraintError, Snapshot, check_limit};
use ff_model::spatial::so3::{exp_so3, log_so3, quat_identity, quat_mul, quat_to_rot, right_jacobian};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};
use std::sync::Arc;

/// Unit vector, or zero for a vector of length zero, whose length has no derivative.
pub(super) fn direction(v: &Vector3<f64>) -> Vector3<f64> {
    let norm = v.norm();
    if norm > 0.0 { v / norm } else { Vector3::zeros() }
}

/// The part of [`Signal`] that is the same for everything that follows from base rates: a type with a field `rates` and
/// a field `channel`.
macro_rules! driven_by_rates {
    () => {
        type Work = History;
        fn channels(&self) -> &[Channel] {
            &self.channel
        }
        fn rate(&self) -> f64 {
            self.rates.ringing.rate
        }
        fn drives(&self) -> usize {
            self.rates.drives()
        }
        fn work(&self) -> History {
            self.rates.work()
        }
        fn drive(&self, w: &mut History, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>) {
            self.rates.drive(w, s, u, partials);
        }
        fn reaches_back(&self) -> bool {
            true
        }
    };
}
pub(super) use driven_by_rates;

/// Base rates over a trajectory, and from them attitudes.
#[derive(Clone, Debug)]
pub(super) struct Rates {
    system: Arc<HeldSystem>,
    pub(super) ringing: Ringing,
}

/// Buffers of a constraint on rates or attitude.
#[derive(Clone, Debug)]
pub struct History {
    held: HeldWork,
    partials: HeldPartials,
    rung: Rung,
    /// Base rates, `3 x N`.
    pub(super) rate: Matrix3xX<f64>,
    pub(super) turning: Turning,
}

impl Rates {
    pub(super) fn new(system: &Arc<HeldSystem>, q: &[f64]) -> Result<Self, ConstraintError> {
        Ok(Self { system: system.clone(), ringing: Ringing::new(system, q)? })
    }
    /// Rates with the appendages held, holding forces, ports.
    pub(super) fn drives(&self) -> usize {
        let (n, m) = (self.system.model().nj(), self.ringing.count());
        3 + m + (6 + n) * m
    }
    /// Drive that holds the first component of the rate `G_p`.
    fn port(&self, p: usize) -> usize {
        let (n, m) = (self.system.model().nj(), self.ringing.count());
        3 + m + p * (6 + n) + 3
    }
    pub(super) fn work(&self) -> History {
        History {
            held: self.system.work(),
            partials: self.system.partials(),
            rung: Rung::default(),
            rate: Matrix3xX::zeros(0),
            turning: Turning::default(),
        }
    }
    pub(super) fn drive(&self, w: &mut History, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>) {
        let (n, m) = (self.system.model().nj(), self.ringing.count());
        let (own, ports) = u.split_at_mut(3 + m);
        match partials {
            None => {
                self.system.evaluate(&mut w.held, s);
                self.system.ports(&mut w.held, ports, None);
            }
            Some(out) => {
                self.system.differentiate(&mut w.held, s, &mut w.partials);
                out.rows_mut(0, 3).copy_from(&w.partials.twist.rows(3, 3));
                out.rows_mut(3, m).copy_from(&w.partials.force.rows(n, m));
                let mut d = DMatrix::zeros(ports.len(), n);
                self.system.ports(&mut w.held, ports, Some(&mut d));
                out.view_mut((3 + m, 0), d.shape()).copy_from(&d);
            }
        }
        own[..3].copy_from_slice(&w.held.twist.as_slice()[3..]);
        own[3..].copy_from_slice(&w.held.hold);
    }
    /// Fills the rates.
    pub(super) fn respond(&self, w: &mut History, dt: f64, u: &DMatrix<f64>) {
        let m = self.ringing.count();
        w.rung = self.ringing.respond(dt, u, 3);
        w.rate = u.fixed_rows::<3>(0).into_owned();
        for (k, z) in w.rung.z.iter().enumerate() {
            let mut rate = w.rate.column_mut(k);
            (0..m).for_each(|p| rate += u.fixed_view::<3, 1>(self.port(p), k) * z[m + p]);
        }
    }
    /// Fills the rates, and the attitudes that follow from them.
    pub(super) fn turn(&self, w: &mut History, dt: f64, u: &DMatrix<f64>) {
        self.respond(w, dt, u);
        w.turning = Turning::new(dt, &w.rate);
    }
    /// Given the axis in which a small turn (world axes) of the attitude at sample `i` changes a scalar, adds the
    /// derivatives with respect to the drives and returns that with respect to `dt`.
    pub(super) fn adjoint_of_turn(
        &self,
        w: &History,
        u: &DMatrix<f64>,
        i: usize,
        over_turn: &Vector3<f64>,
        over_u: &mut DMatrix<f64>,
    ) -> f64 {
        w.turning.adjoint(&w.rate, i, over_turn, over_u) + self.adjoint(w, u, i, over_u)
    }
    /// Carries derivatives with respect to the rates `0..=last` (in the first rows of `over_u`) on to the other drives;
    /// returns that with respect to `dt`.
    pub(super) fn adjoint(&self, w: &History, u: &DMatrix<f64>, last: usize, over_u: &mut DMatrix<f64>) -> f64 {
        let m = self.ringing.count();
        for k in 0..=last {
            let over_rate = over_u.fixed_view::<3, 1>(0, k).into_owned();
            for p in 0..m {
                let mut here = over_u.fixed_view_mut::<3, 1>(self.port(p), k);
                here += over_rate * w.rung.z[k][m + p];
            }
        }
        let over_rate: Matrix3xX<f64> = over_u.fixed_rows::<3>(0).into_owned();
        let add = |k: usize, l: &mut DVector<f64>| {
            let over = over_rate.column(k);
            (0..m).for_each(|p| l[m + p] += u.fixed_view::<3, 1>(self.port(p), k).dot(&over));
        };
        self.ringing.adjoint(&w.rung, 3, last, add, over_u)
    }
}

/// `|omega_b| <= limit` (rad/s).
#[derive(Clone, Debug)]
pub struct BaseRate {
    rates: Rates,
    channel: [Channel; 1],
}

impl BaseRate {
    /// Appendages linearised about joint positions `q`. Allocates.
    ///
    /// # Errors
    /// [`ConstraintError`]: a limit that is not positive, a wrong number of joint positions, a singular mass matrix.
    pub fn new(system: &Arc<HeldSystem>, q: &[f64], limit: f64) -> Result<Self, ConstraintError> {
        check_limit("base rate", limit, "rad/s")?;
        let channel = [Channel::at_most("base rate", system.model().body_name(0), "rad/s", limit)];
        Ok(Self { rates: Rates::new(system, q)?, channel })
    }
}

impl Signal for BaseRate {
    driven_by_rates!();
    fn respond(&self, w: &mut History, dt: f64, u: &DMatrix<f64>, y: &mut DMatrix<f64>) {
        self.rates.respond(w, dt, u);
        (0..u.ncols()).for_each(|k| y[(0, k)] = w.rate.column(k).norm());
    }
    fn adjoint(&self, w: &History, u: &DMatrix<f64>, _channel: usize, i: usize, over_u: &mut DMatrix<f64>) -> f64 {
        let e = direction(&w.rate.column(i).into_owned());
        over_u.fixed_view_mut::<3, 1>(0, i).copy_from(&e);
        self.rates.adjoint(w, u, i, over_u)
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        out[0] = Vector3::new(at.twist[3], at.twist[4], at.twist[5]).norm();
    }
}

/// Geodesic angle of the base from its attitude at the start, at most `limit` (rad).
#[derive(Clone, Debug)]
pub struct BaseAttitude {
    rates: Rates,
    channel: [Channel; 1],
}

impl BaseAttitude {
    /// Appendages linearised about joint positions `q`. Allocates.
    ///
    /// # Errors
    /// As [`BaseRate::new`].
    pub fn new(system: &Arc<HeldSystem>, q: &[f64], limit: f64) -> Result<Self, ConstraintError> {
        check_limit("base attitude excursion", limit, "rad")?;
        let channel = [Channel::at_most("base attitude excursion", system.model().body_name(0), "rad", limit)];
        Ok(Self { rates: Rates::new(system, q)?, channel })
    }
}

/// Attitudes `R_k` (base to world, identity at the start) from base rates in base axes (`3 x N`), by
/// `R_(k+1) = R_k exp(h/2 (w_k + w_(k+1)) + h^2/12 w_k x w_(k+1))`: the trapezoidal rule with the commutator of the
/// fourth Magnus term (A. Iserles and others, *Lie-group methods*, Acta Numerica 9, 2000).
#[derive(Clone, Debug, Default)]
pub(super) struct Turning {
    pub(super) attitude: Vec<Matrix3<f64>>,
    /// `R_k J_l(Omega_k)`, which carries a change of step `k` into the world.
    carried: Vec<Matrix3<f64>>,
    dt: f64,
}

impl Turning {
    pub(super) fn new(dt: f64, rate: &Matrix3xX<f64>) -> Self {
        let count = rate.ncols();
        let rate = |k: usize| rate.column(k).into_owned();
        let mut quat = quat_identity();
        let mut out = Self { attitude: vec![Matrix3::identity()], carried: Vec::with_capacity(count), dt };
        for k in 0..count - 1 {
            let (a, b) = (rate(k), rate(k + 1));
            let step = (a + b) * (0.5 * dt) + a.cross(&b) * (dt * dt / 12.0);
            out.carried.push(out.attitude[k] * right_jacobian(&step).transpose());
            quat = quat_mul(&quat, &exp_so3(&step));
            out.attitude.push(quat_to_rot(&quat));
        }
        out
    }
    /// Given the derivative of a scalar with respect to a small turn (world axes) of the attitude at sample `last`, adds
    /// those with respect to the rates (the first rows of `over_u`) and returns that with respect to `dt`.
    pub(super) fn adjoint(
        &self,
        rate: &Matrix3xX<f64>,
        last: usize,
        over_turn: &Vector3<f64>,
        over_u: &mut DMatrix<f64>,
    ) -> f64 {
        let rate = |k: usize| rate.column(k).into_owned();
        let mut over_dt = 0.0;
        for k in (0..last).rev() {
            let l = self.carried[k].tr_mul(over_turn);
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

/// Angle of a rotation and its axis, which is the derivative with respect to small turns in the world.
fn excursion(r: &Matrix3<f64>) -> (f64, Vector3<f64>) {
    let v = log_so3(&ff_model::spatial::so3::rot_to_quat(r));
    (v.norm(), direction(&v))
}

impl Signal for BaseAttitude {
    driven_by_rates!();
    fn respond(&self, w: &mut History, dt: f64, u: &DMatrix<f64>, y: &mut DMatrix<f64>) {
        self.rates.turn(w, dt, u);
        for (k, r) in w.turning.attitude.iter().enumerate() {
            y[(0, k)] = excursion(r).0;
        }
    }
    fn adjoint(&self, w: &History, u: &DMatrix<f64>, _channel: usize, i: usize, over_u: &mut DMatrix<f64>) -> f64 {
        let turn = excursion(&w.turning.attitude[i]).1;
        self.rates.adjoint_of_turn(w, u, i, &turn, over_u)
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        out[0] = log_so3(&at.att).norm();
    }
}
