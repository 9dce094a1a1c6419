//! The system while its appendages are held at rest: what constraints need of the model, with exact derivatives.
//!
//! At zero momentum and with appendages held, the joint motion decides everything (`theory.md` 1). With
//! `H`, `c` the mass matrix and bias of the *whole* system at its rest position:
//!
//! ```text
//! V = -H_b^-1 H_bm qd,      A = -H_b^-1 (H_bm qdd + c_b),
//! tau = H_bm^T A + H_m qdd + c_m,      e = H_bp^T A + H_mp^T qdd + c_p.
//! ```
//!
//! A unit acceleration of passive coordinate `k` alone, joints held, moves the base by `G_k` and loads the joints with
//! `B_k`, columns of
//!
//! ```text
//! G = -H_b^-1 H_bp,      B = H_mp + H_bm^T G.
//! ```
//!
//! `e` is the generalised force that would have to hold the passive coordinates; let go, they are driven by `-e`.
//!
//! Derivatives. Inverse dynamics at zero velocity with the "acceleration" `u = (V, qd, 0)` returns `H u`, whose base
//! rows are the momentum, so its derivative with respect to `q_l` at fixed `u` gives `dV/dq_l = -H_b^-1 d(H_b V +
//! H_bm qd)/dq_l`; `dV/dqd = -H_b^-1 H_bm`. A second call at the motion itself gives the columns of all rows; the
//! change of `A` that keeps the base rows zero is eliminated as in [`ff_dynamics::tree::hybrid_columns`]. `G_k` and `B_k` are
//! the same at zero velocity with the acceleration `(G_k, 0, 1_k)`.

use crate::system::rigid::RigidError;
use ff_dynamics::tree::{Derivatives, rnea_derivatives};
use ff_dynamics::{State, Work, mass_matrix, rnea};
use ff_model::{BaseKind, Model, Params};
use nalgebra::{Cholesky, Const, DMatrix, Matrix6, Vector6};

/// A free-floating system at zero momentum with its appendages held at rest.
#[derive(Clone, Debug)]
pub struct HeldSystem {
    model: Model,
    params: Params<f64>,
    rest: Vec<f64>,
}

/// Buffers of [`HeldSystem`], and the result of the last evaluation.
#[derive(Clone, Debug)]
pub struct HeldWork {
    work: Work<f64>,
    state: State<f64>,
    acceleration: Vec<f64>,
    h: DMatrix<f64>,
    momentum: Derivatives<f64>,
    motion: Derivatives<f64>,
    /// Base twist `V`, base axes, linear first.
    pub twist: Vector6<f64>,
    /// Base acceleration `A`.
    pub accel: Vector6<f64>,
    /// Joint torques (N m or N).
    pub tau: Vec<f64>,
    /// Generalised force that holds the passive coordinates.
    pub hold: Vec<f64>,
}

/// Derivatives with respect to `(q, qd, qdd)` in turn, `... x 3 n`.
#[derive(Clone, Debug)]
pub struct HeldPartials {
    /// Of the base twist.
    pub twist: DMatrix<f64>,
    /// Of joint torques, then holding forces.
    pub force: DMatrix<f64>,
}

impl HeldSystem {
    /// From a model and its parameter values. Allocates.
    ///
    /// # Errors
    /// [`RigidError::NotFreeFloating`] for a fixed base or gravity, [`RigidError::Singular`] for a composite inertia
    /// that is not positive definite at zero joint positions.
    ///
    /// # Panics
    /// If `params` belongs to another model.
    pub fn new(model: &Model, params: &Params<f64>) -> Result<Self, RigidError> {
        if model.base_kind() != BaseKind::Floating || model.gravity().norm() != 0.0 {
            return Err(RigidError::NotFreeFloating);
        }
        let out = Self { model: model.clone(), params: params.clone(), rest: model.rest_position(params) };
        let zero = vec![0.0; model.nj()];
        let fine = out.evaluate(&mut out.work(), [&zero, &zero, &zero]);
        if fine { Ok(out) } else { Err(RigidError::Singular) }
    }
    /// The whole model, appendages included.
    pub fn model(&self) -> &Model {
        &self.model
    }
    /// Its parameter values.
    pub fn params(&self) -> &Params<f64> {
        &self.params
    }
    /// Passive coordinates at rest.
    pub fn rest(&self) -> &[f64] {
        &self.rest
    }
    /// Buffers. Allocates.
    pub fn work(&self) -> HeldWork {
        let m = &self.model;
        let mut state = State::zero(m);
        state.eta.copy_from_slice(&self.rest);
        HeldWork {
            work: Work::new(m),
            state,
            acceleration: vec![0.0; m.nv()],
            h: DMatrix::zeros(m.nv(), m.nv()),
            momentum: Derivatives::new(m),
            motion: Derivatives::new(m),
            twist: Vector6::zeros(),
            accel: Vector6::zeros(),
            tau: vec![0.0; m.nj()],
            hold: vec![0.0; m.np()],
        }
    }
    /// Derivatives, zero. Allocates.
    pub fn partials(&self) -> HeldPartials {
        let (n, m) = (self.model.nj(), self.model.np());
        HeldPartials { twist: DMatrix::zeros(6, 3 * n), force: DMatrix::zeros(n + m, 3 * n) }
    }
    /// Base twist and acceleration, torques and holding forces at `(q, qd, qdd)`, into `w`. False, and everything NaN,
    /// where the composite inertia is not positive definite.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn evaluate(&self, w: &mut HeldWork, s: [&[f64]; 3]) -> bool {
        self.solve(w, s).is_some()
    }
    /// [`HeldSystem::evaluate`] with derivatives.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn differentiate(&self, w: &mut HeldWork, s: [&[f64]; 3], out: &mut HeldPartials) -> bool {
        let n = self.model.nj();
        let Some(chol) = self.solve(w, s) else {
            out.twist.fill(f64::NAN);
            out.force.fill(f64::NAN);
            return false;
        };
        let (m, p) = (&self.model, &self.params);
        let set = |to: &mut [f64], base: &Vector6<f64>, joints: &[f64]| {
            to[..6].copy_from_slice(base.as_slice());
            to[6..6 + n].copy_from_slice(joints);
        };
        w.state.v.fill(0.0);
        set(&mut w.acceleration, &w.twist, s[1]);
        rnea_derivatives(m, p, &w.state, &w.acceleration, &mut w.work, &mut w.momentum);
        set(&mut w.state.v, &w.twist, s[1]);
        set(&mut w.acceleration, &w.accel, s[2]);
        rnea_derivatives(m, p, &w.state, &w.acceleration, &mut w.work, &mut w.motion);
        let Derivatives { dq, dv, da } = &w.motion;
        let rows = n + m.np();
        for l in 0..n {
            let dp = Vector6::from_fn(|i, _| w.momentum.dq[(i, 6 + l)]);
            let follow = -chol.solve(&dp);
            let basis = -chol.solve(&Vector6::from_fn(|i, _| da[(i, 6 + l)]));
            out.twist.fixed_view_mut::<6, 1>(0, l).copy_from(&follow);
            out.twist.fixed_view_mut::<6, 1>(0, n + l).copy_from(&basis);
            out.twist.fixed_view_mut::<6, 1>(0, 2 * n + l).fill(0.0);
            let along = |row: usize, t: &Vector6<f64>| (0..6).map(|c| dv[(row, c)] * t[c]).sum::<f64>();
            for (k, (source, twist)) in [(dq, Some(&follow)), (dv, Some(&basis)), (da, None)].into_iter().enumerate() {
                let column = |row: usize| source[(row, 6 + l)] + twist.map_or(0.0, |t| along(row, t));
                let accel = -chol.solve(&Vector6::from_fn(|i, _| column(i)));
                for r in 0..rows {
                    let back: f64 = (0..6).map(|c| da[(6 + r, c)] * accel[c]).sum();
                    out.force[(r, k * n + l)] = column(6 + r) + back;
                }
            }
        }
        true
    }
    /// `[G; B]` at joint positions `q`, `(6 + n) x m`, into `out` by columns, and with `partials` (`(6 + n) m x n`) their
    /// derivatives with respect to `q`. To be called after [`HeldSystem::evaluate`] or
    /// [`HeldSystem::differentiate`] at the same `q`. NaN where these failed.
    ///
    /// # Panics
    /// If a length or shape is wrong.
    pub fn ports(&self, w: &mut HeldWork, out: &mut [f64], mut partials: Option<&mut DMatrix<f64>>) {
        let (n, m, model) = (self.model.nj(), self.model.np(), &self.model);
        let rows = 6 + n;
        assert_eq!(out.len(), rows * m, "ports");
        let h_b: Matrix6<f64> = w.h.fixed_view::<6, 6>(0, 0).into_owned();
        let finite = w.twist.iter().all(|x| x.is_finite());
        let Some(chol) = h_b.cholesky().filter(|_| finite) else {
            out.fill(f64::NAN);
            partials.into_iter().for_each(|d| d.fill(f64::NAN));
            return;
        };
        w.state.v.fill(0.0);
        for k in 0..m {
            let base = -chol.solve(&Vector6::from_fn(|i, _| w.h[(i, rows + k)]));
            let column = &mut out[k * rows..(k + 1) * rows];
            column[..6].copy_from_slice(base.as_slice());
            for j in 0..n {
                column[6 + j] = w.h[(6 + j, rows + k)] + (0..6).map(|c| w.h[(6 + j, c)] * base[c]).sum::<f64>();
            }
            let Some(partials) = partials.as_mut() else { continue };
            w.acceleration.fill(0.0);
            w.acceleration[..6].copy_from_slice(base.as_slice());
            w.acceleration[rows + k] = 1.0;
            rnea_derivatives(model, &self.params, &w.state, &w.acceleration, &mut w.work, &mut w.momentum);
            let Derivatives { dq, da, .. } = &w.momentum;
            for l in 0..n {
                let follow = -chol.solve(&Vector6::from_fn(|i, _| dq[(i, 6 + l)]));
                (0..6).for_each(|i| partials[(k * rows + i, l)] = follow[i]);
                for j in 0..n {
                    let back: f64 = (0..6).map(|c| da[(6 + j, c)] * follow[c]).sum();
                    partials[(k * rows + 6 + j, l)] = dq[(6 + j, 6 + l)] + back;
                }
            }
        }
    }
    fn solve(&self, w: &mut HeldWork, [q, qd, qdd]: [&[f64]; 3]) -> Option<Cholesky<f64, Const<6>>> {
        let (n, m, p) = (self.model.nj(), &self.model, &self.params);
        assert!(q.len() == n && qd.len() == n && qdd.len() == n, "joint positions, rates, accelerations");
        w.state.q.copy_from_slice(q);
        w.state.v.fill(0.0);
        mass_matrix(m, p, &w.state, &mut w.work, &mut w.h);
        let h_b: Matrix6<f64> = w.h.fixed_view::<6, 6>(0, 0).into_owned();
        let finite = h_b.iter().chain(q).chain(qd).chain(qdd).all(|x| x.is_finite());
        let Some(chol) = h_b.cholesky().filter(|_| finite) else {
            w.twist.fill(f64::NAN);
            w.accel.fill(f64::NAN);
            w.tau.fill(f64::NAN);
            w.hold.fill(f64::NAN);
            return None;
        };
        let pull = Vector6::from_fn(|i, _| (0..n).map(|j| w.h[(i, 6 + j)] * qd[j]).sum::<f64>());
        w.twist = -chol.solve(&pull);
        w.state.v[..6].copy_from_slice(w.twist.as_slice());
        w.state.qd_mut().copy_from_slice(qd);
        w.acceleration.fill(0.0);
        w.acceleration[6..6 + n].copy_from_slice(qdd);
        let mut out = vec![0.0; m.nv()];
        rnea(m, p, &w.state, &w.acceleration, &mut w.work, &mut out);
        w.accel = -chol.solve(&Vector6::from_column_slice(&out[..6]));
        // The rest is linear in A: add what it does instead of a second pass.
        let add = |r: usize| out[6 + r] + (0..6).map(|c| w.h[(6 + r, c)] * w.accel[c]).sum::<f64>();
        (0..n).for_each(|r| w.tau[r] = add(r));
        (0..m.np()).for_each(|r| w.hold[r] = add(n + r));
        Some(chol)
    }
}
