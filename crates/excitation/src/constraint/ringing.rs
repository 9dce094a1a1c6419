//! The linear response of the appendages.
//!
//! About rest, at the configuration where the plan starts, passive coordinates let go obey
//!
//! ```text
//! H_p* b'' + D b' + K b = -e(t),      H_p* = H_p - H_bp^T H_b^-1 H_bp,
//! ```
//!
//! `e` being the force that would have to hold them ([`super::HeldSystem`]), centrifugal and all other terms of the arm's
//! motion included, on whatever body the appendage hangs. With `G`, `B` of [`super::HeldSystem`] at the present
//! configuration they add to the motion with appendages held
//!
//! ```text
//! V += G b',      tau += B b''.
//! ```
//!
//! What is left out is the change of `H_p*` along the motion, the effect of the deflection on `e`, and everything
//! nonlinear in the deflection: the full simulation measures what that makes.
//!
//! Between samples `e` is taken as linear and the response is exact (C. Van Loan, *Computing integrals involving the
//! matrix exponential*, IEEE TAC 23(3), 1978): with `z = [b; b']`, `z' = A z + B e`,
//!
//! ```text
//! exp [A h, B h, 0; 0, 0, 1; 0, 0, 0] = [F, G_1, G_2; ...],   z_(k+1) = F z_k + (G_1 - G_2) e_k + G_2 e_(k+1);
//! ```
//!
//! the derivative with respect to `h` is the corner of `exp [X, dX; 0, X]`.

use super::{ConstraintError, HeldSystem};
use ff_dynamics::analysis::stiffness_damping;
use ff_dynamics::{Boundary, State, Work, mass_matrix, modes};
use nalgebra::{DMatrix, DVector};

/// Samples per period of the fastest mode.
const PER_PERIOD: f64 = 12.0;

/// Linearised appendages of a system.
#[derive(Clone, Debug)]
pub struct Ringing {
    /// Samples per second that resolve the fastest mode.
    pub(super) rate: f64,
    a: DMatrix<f64>,
    b: DMatrix<f64>,
}

/// `z_(k+1) = f z_k + g0 e_k + g1 e_(k+1)`.
#[derive(Clone, Debug, Default)]
struct Step {
    f: DMatrix<f64>,
    g0: DMatrix<f64>,
    g1: DMatrix<f64>,
}

/// A response: `z` per sample, and what its derivatives need.
#[derive(Clone, Debug, Default)]
pub struct Rung {
    step: Step,
    /// `dz_(k+1) / dh` at fixed `z_k`.
    grown: Vec<DVector<f64>>,
    /// Deflections from rest, then their rates.
    pub(super) z: Vec<DVector<f64>>,
}

impl Ringing {
    /// About joint positions `q` and rest. Allocates.
    pub(super) fn new(system: &HeldSystem, q: &[f64]) -> Result<Self, ConstraintError> {
        let m = system.model();
        let (n, np) = (m.nj(), m.np());
        if q.len() != n {
            return Err(ConstraintError::Count { what: "joint positions", got: q.len(), want: n });
        }
        let mut state = State::zero(m);
        state.q.copy_from_slice(q);
        state.eta.copy_from_slice(system.rest());
        let mut h = DMatrix::zeros(m.nv(), m.nv());
        mass_matrix(m, system.params(), &state, &mut Work::new(m), &mut h);
        let singular = || ConstraintError::Rigid(crate::system::rigid::RigidError::Singular);
        let block = |r: usize, c: usize, rows: usize, cols: usize| h.view((r, c), (rows, cols)).into_owned();
        let h_bp = block(0, 6 + n, 6, np);
        let h_b = block(0, 0, 6, 6).cholesky().ok_or_else(singular)?;
        let base = -h_b.solve(&h_bp);
        let inertia = block(6 + n, 6 + n, np, np) + h_bp.tr_mul(&base);
        let inverse = inertia.cholesky().ok_or_else(singular)?.inverse();
        let (k, d) = stiffness_damping(m, system.params(), system.rest());
        let mut a = DMatrix::zeros(2 * np, 2 * np);
        a.view_mut((0, np), (np, np)).fill_with_identity();
        a.view_mut((np, 0), (np, np)).copy_from(&(-&inverse * k));
        a.view_mut((np, np), (np, np)).copy_from(&(-&inverse * d));
        let mut b = DMatrix::zeros(2 * np, np);
        b.view_mut((np, 0), (np, np)).copy_from(&-inverse);
        let found = modes(m, system.params(), q, system.rest(), Boundary::JointsHeld)?;
        let rate = PER_PERIOD * found.iter().map(|m| m.frequency_hz).fold(0.0, f64::max);
        Ok(Self { rate, a, b })
    }
    /// Number of passive coordinates.
    pub(super) fn count(&self) -> usize {
        self.b.ncols()
    }
    /// Accelerations of the passive coordinates at sample `k`.
    pub(super) fn acceleration(&self, rung: &Rung, e: &DVector<f64>, k: usize) -> DVector<f64> {
        let m = self.count();
        (&self.a * &rung.z[k] + &self.b * e).rows(m, m).into_owned()
    }
    /// Derivatives of `over . b''` with respect to `z` and `e`.
    pub(super) fn over_acceleration(&self, over: &DVector<f64>) -> (DVector<f64>, DVector<f64>) {
        let m = self.count();
        (self.a.rows(m, m).tr_mul(over), self.b.rows(m, m).tr_mul(over))
    }
    /// The response to `e` (rows `first..` of `u`) from rest, samples `dt` apart. NaN if something is not finite: the
    /// exponential of such a matrix does not come to an end.
    pub(super) fn respond(&self, dt: f64, u: &DMatrix<f64>, first: usize) -> Rung {
        let (m, count) = (self.count(), u.ncols());
        if m == 0 {
            return Rung { z: vec![DVector::zeros(0); count], ..Rung::default() };
        }
        let finite = dt.is_finite() && u.iter().all(|x| x.is_finite());
        if !finite {
            return Rung { z: vec![DVector::from_element(2 * m, f64::NAN); count], ..Rung::default() };
        }
        let (step, d_step) = self.discretise(dt);
        let e = |k: usize| u.view((first, k), (m, 1));
        let (mut z, mut grown) = (Vec::with_capacity(count), Vec::with_capacity(count));
        z.push(DVector::zeros(2 * m));
        let next =
            |s: &Step, z: &DVector<f64>, k: usize| -> DVector<f64> { &s.f * z + &s.g0 * e(k) + &s.g1 * e(k + 1) };
        for k in 0..count - 1 {
            grown.push(next(&d_step, &z[k], k));
            z.push(next(&step, &z[k], k));
        }
        Rung { step, grown, z }
    }
    /// Carries derivatives with respect to `z_k`, `k <= last`, back: adds those with respect to `e` and returns that with
    /// respect to `dt`.
    pub(super) fn adjoint(
        &self,
        rung: &Rung,
        first: usize,
        last: usize,
        over_z: impl Fn(usize, &mut DVector<f64>),
        over_u: &mut DMatrix<f64>,
    ) -> f64 {
        let m = self.count();
        if m == 0 || rung.grown.is_empty() {
            return 0.0;
        }
        let (mut l, mut over_dt) = (DVector::zeros(2 * m), 0.0);
        let mut before = DVector::zeros(2 * m);
        for k in (1..=last).rev() {
            over_z(k, &mut l);
            over_u.view_mut((first, k - 1), (m, 1)).column_mut(0).gemv_tr(1.0, &rung.step.g0, &l, 1.0);
            over_u.view_mut((first, k), (m, 1)).column_mut(0).gemv_tr(1.0, &rung.step.g1, &l, 1.0);
            over_dt += l.dot(&rung.grown[k - 1]);
            before.gemv_tr(1.0, &rung.step.f, &l, 0.0);
            std::mem::swap(&mut l, &mut before);
        }
        over_dt
    }
    /// The discrete response and its derivative with respect to the step `h`.
    fn discretise(&self, h: f64) -> (Step, Step) {
        let (n, m) = self.b.shape();
        let size = n + 2 * m;
        let mut x = DMatrix::zeros(2 * size, 2 * size);
        for o in [0, size] {
            x.view_mut((o, o), (n, n)).copy_from(&(&self.a * h));
            x.view_mut((o, o + n), (n, m)).copy_from(&(&self.b * h));
            x.view_mut((o + n, o + n + m), (m, m)).fill_with_identity();
        }
        x.view_mut((0, size), (n, n)).copy_from(&self.a);
        x.view_mut((0, size + n), (n, m)).copy_from(&self.b);
        let x = x.exp();
        let pick = |o: usize| {
            let g1 = x.view((0, o + n + m), (n, m)).into_owned();
            Step { f: x.view((0, o), (n, n)).into_owned(), g0: x.view((0, o + n), (n, m)) - &g1, g1 }
        };
        (pick(0), pick(size))
    }
}
