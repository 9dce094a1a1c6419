//! Time integration on the configuration manifold.
//!
//! Runge-Kutta-Munthe-Kaas of order 4: within a step the attitude is `att_0 exp(u)` and the rotation vector
//! `u` obeys `u' = dexp^-1_u(w)`, so the quaternion is a product of unit quaternions and stays on the unit
//! sphere to rounding (Munthe-Kaas 1998; Hairer, Lubich, Wanner, *Geometric Numerical Integration*, IV.8).

use crate::state::State;
use ff_model::Model;
use ff_model::scalar::ModelScalar;
use ff_model::spatial::small::{add, mv, scaled};
use ff_model::spatial::so3::{dexp_inv_body, exp_so3, quat_mul, quat_normalize, quat_to_rot};
use nalgebra::Vector3;

/// Number of quadratures that a simulation carries beside the state: energy dissipated, work of the joint torques, work
/// of the external inputs, and their impulse (six).
pub const QUADRATURES: usize = 9;

/// Rate of change of a state, in the coordinates of one step.
#[derive(Clone, Debug)]
struct Rate<T: ModelScalar, const Q: usize> {
    pos: Vector3<T>,
    rot: Vector3<T>,
    q: Vec<T>,
    eta: Vec<T>,
    v: Vec<T>,
    quad: [T; Q],
}

/// Fixed-step integrator with `Q` quadratures and its buffers; allocates only in [`Rkmk4::new`].
#[derive(Clone, Debug)]
pub struct Rkmk4<T: ModelScalar, const Q: usize = QUADRATURES> {
    stage: State<T>,
    k: [Rate<T, Q>; 4],
}

/// Classical Runge-Kutta nodes and weights.
const NODE: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
const WEIGHT: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

impl<T: ModelScalar, const Q: usize> Rkmk4<T, Q> {
    /// Buffers for a model.
    pub fn new(model: &Model) -> Self {
        let stage = State::zero(model);
        let rate = Rate {
            pos: Vector3::zeros(),
            rot: Vector3::zeros(),
            q: stage.q.clone(),
            eta: stage.eta.clone(),
            v: stage.v.clone(),
            quad: [T::zero(); Q],
        };
        Self { stage, k: [rate.clone(), rate.clone(), rate.clone(), rate] }
    }

    /// One step of length `h` from time `t`, in place of `state` and `quad`.
    ///
    /// `accel(t, state, a, dquad)` is called at the four stages. It may overwrite the joint part of `state`
    /// (prescribed joints) before it writes the accelerations `a` (`nv`) and the rates of the quadratures.
    ///
    /// # Errors
    /// Whatever `accel` returns; `state` is then unchanged.
    #[inline(always)]
    pub fn step<E>(
        &mut self,
        t: f64,
        h: f64,
        state: &mut State<T>,
        quad: &mut [T; Q],
        accel: impl FnMut(f64, &mut State<T>, &mut [T], &mut [T; Q]) -> Result<(), E>,
    ) -> Result<(), E> {
        self.step_from(t, h, state, quad, None, accel)
    }

    /// [`Rkmk4::step`] with the first stage given, `(a, dquad)` at `t` and `state`, where it is known already: a
    /// sample at every step then costs no evaluation of its own. The result is the same to the bit.
    ///
    /// # Errors
    /// As [`Rkmk4::step`].
    ///
    /// # Panics
    /// If the given accelerations are not `nv` long.
    #[inline(always)]
    pub fn step_from<E>(
        &mut self,
        t: f64,
        h: f64,
        state: &mut State<T>,
        quad: &mut [T; Q],
        first: Option<(&[T], &[T; Q])>,
        mut accel: impl FnMut(f64, &mut State<T>, &mut [T], &mut [T; Q]) -> Result<(), E>,
    ) -> Result<(), E> {
        for s in 0..4 {
            let c = T::from_f64(NODE[s] * h);
            self.stage.copy_from(state);
            let mut u = Vector3::zeros();
            if s > 0 {
                let k = &self.k[s - 1];
                u = scaled(&k.rot, c);
                self.stage.pos = add(&self.stage.pos, &scaled(&k.pos, c));
                self.stage.att = quat_mul(&state.att, &exp_so3(&u));
                axpy(&mut self.stage.q, c, &k.q);
                axpy(&mut self.stage.eta, c, &k.eta);
                axpy(&mut self.stage.v, c, &k.v);
            }
            let k = &mut self.k[s];
            match first {
                Some((a, dquad)) if s == 0 => {
                    k.v.copy_from_slice(a);
                    k.quad = *dquad;
                }
                _ => accel(t + NODE[s] * h, &mut self.stage, &mut k.v, &mut k.quad)?,
            }
            let twist = self.stage.base_twist();
            k.pos = mv(&quat_to_rot(&self.stage.att), &twist.lin);
            k.rot = dexp_inv_body(&u, &twist.ang);
            k.q.copy_from_slice(self.stage.qd());
            k.eta.copy_from_slice(self.stage.nu());
        }
        let mut u = Vector3::zeros();
        for (s, k) in self.k.iter().enumerate() {
            let w = T::from_f64(WEIGHT[s] * h);
            u = add(&u, &scaled(&k.rot, w));
            state.pos = add(&state.pos, &scaled(&k.pos, w));
            axpy(&mut state.q, w, &k.q);
            axpy(&mut state.eta, w, &k.eta);
            axpy(&mut state.v, w, &k.v);
            for (q, d) in quad.iter_mut().zip(&k.quad) {
                *q += w * *d;
            }
        }
        state.att = quat_normalize(&quat_mul(&state.att, &exp_so3(&u)));
        Ok(())
    }
}

#[inline(always)]
fn axpy<T: ModelScalar>(y: &mut [T], a: T, x: &[T]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * *x;
    }
}
