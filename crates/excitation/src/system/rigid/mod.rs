//! The rigid free-floating robot at zero momentum, with exact derivatives: what the costs need of the model.
//!
//! With the total momentum zero, `I V + h = 0` gives the base twist and its rate the base acceleration
//! (`theory.md` 1), all in base coordinates:
//!
//! ```text
//! V = -I^-1 h = sum_j n_j qd_j,   n_j = -I^-1 F_j,   F_j = I_j S_j,
//! A = dV/dt   = -I^-1 (I' V + h'),
//! ```
//!
//! `I` being the composite inertia of everything, `I_j` that of the subtree on joint `j`, `S_j` its screw, and
//! a prime the componentwise rate in the base frame. A small turn of joint `l` displaces its subtree by `S_l`
//! and leaves the rest, so that with `W_l` the twist of the body that carries joint `l` and `p_l` the
//! momentum of the subtree
//!
//! ```text
//! I dV/dq_l = -g_l,               g_l = S_l x* p_l - I_l (S_l x W_l),
//! I dA/dq_l = -(I' dV/dq_l + g_l')                      (because d/dq_l and d/dt commute),
//! dA/dqd_l  = dV/dq_l + n_l',     dA/dqdd_l = dV/dqd_l = n_l.
//! ```
//!
//! One sweep over the bodies and one factorisation of `I` therefore give everything; no dual numbers and no
//! finite differences are needed.
pub(crate) mod information;
pub(crate) mod sweep;

pub use information::{RigidInformation, SensorNoise};

use crate::objective::base::{BasePartials, BaseResponse};
use ff_model::{BaseKind, Inertia, Model, Params};
use nalgebra::Vector6;
use sweep::Arm;

/// Why the rigid model cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RigidError {
    /// The base is fixed or gravity acts.
    #[error("planning at zero momentum needs a free-floating base and zero gravity")]
    NotFreeFloating,
    /// The composite inertia is not positive definite.
    #[error("the composite inertia is not positive definite; check masses and inertias")]
    Singular,
    /// A parameter that the information of the rigid model does not cover.
    #[error("'{name}' is not an inertial parameter of the base body; plan for base parameters only")]
    NotBase {
        /// Full name, or the index if there is no such parameter.
        name: String,
    },
    /// Nothing to estimate, or the same parameter twice.
    #[error("the estimated parameters must be at least one and all different")]
    Selection,
    /// A standard deviation or sample rate that is not positive and finite.
    #[error("{what} is {value}; it must be positive and finite")]
    Noise {
        /// Which.
        what: &'static str,
        /// Its value.
        value: f64,
    },
}

/// A rigid free-floating robot at zero momentum; a [`BaseResponse`].
///
/// Appendages are frozen at rest ([`Model::frozen`]).
#[derive(Clone, Debug)]
pub struct RigidBase {
    model: Model,
    /// Inertia per body, base first.
    inertias: Vec<Inertia<f64>>,
}

impl RigidBase {
    /// From a model and its parameter values. Allocates.
    ///
    /// # Errors
    /// [`RigidError::NotFreeFloating`], [`RigidError::Singular`] (tested at zero joint positions).
    ///
    /// # Panics
    /// If `params` belongs to another model.
    pub fn new(model: &Model, params: &Params<f64>) -> Result<Self, RigidError> {
        if model.base_kind() != BaseKind::Floating || model.gravity().norm() != 0.0 {
            return Err(RigidError::NotFreeFloating);
        }
        let rigid = model.frozen(params);
        // `frozen` adds the appendages to the nominal bodies; what they add is the same for the given ones.
        let inertias = (0..model.n_bodies())
            .map(|i| {
                let (with, without) = (rigid.inertia(i).to_params(), model.inertia(i).to_params());
                let own = params.body(i).to_params();
                let sum: Vec<f64> = (0..10).map(|k| own[k] + (with[k] - without[k])).collect();
                Inertia::from_params(&sum)
            })
            .collect();
        let out = Self { model: rigid, inertias };
        let zero = vec![0.0; out.model.nj()];
        Arm::new(&out, &zero, &zero, &zero).map(|_| ()).ok_or(RigidError::Singular)?;
        Ok(out)
    }
    /// The rigid model: the given one, appendages frozen.
    pub fn model(&self) -> &Model {
        &self.model
    }
    /// Base twist at zero momentum, linear first, base axes (m/s, rad/s); NaN where the composite inertia is
    /// not positive definite. Allocates.
    ///
    /// # Panics
    /// If a slice has the wrong length.
    pub fn base_twist(&self, q: &[f64], qd: &[f64]) -> Vector6<f64> {
        let zero = vec![0.0; qd.len()];
        Arm::new(self, q, qd, &zero).map_or(Vector6::repeat(f64::NAN), |a| a.twist.to_vector())
    }
}

/// `out` is NaN where the composite inertia is not positive definite. Both methods allocate their buffers and
/// panic if a slice has the wrong length.
impl BaseResponse for RigidBase {
    fn dof(&self) -> usize {
        self.model.nj()
    }
    fn base_acceleration(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut [f64; 6]) {
        match Arm::new(self, q, qd, qdd) {
            Some(arm) => arm.accel.write_to(out),
            None => out.fill(f64::NAN),
        }
    }
    fn partials(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut [f64; 6], partials: &mut BasePartials) {
        let Some(arm) = Arm::new(self, q, qd, qdd) else {
            out.fill(f64::NAN);
            return;
        };
        arm.accel.write_to(out);
        for to in [&mut partials.q, &mut partials.qd, &mut partials.qdd] {
            to.fill(0.0);
        }
        for link in &arm.links {
            let (l, m) = (link.of.index, link.of.multiplier);
            let (g, dg) = arm.displaced(link);
            let v = -arm.solve(&g);
            let a = -arm.solve(&(arm.d_inertia.mul_motion(&v) + dg));
            let n_rate = -arm.solve(&arm.basis_rate(link));
            partials.q.column_mut(l).axpy(m, &a.to_vector(), 1.0);
            partials.qd.column_mut(l).axpy(m, &(v + n_rate).to_vector(), 1.0);
            partials.qdd.column_mut(l).axpy(m, &link.basis.to_vector(), 1.0);
        }
    }
}
