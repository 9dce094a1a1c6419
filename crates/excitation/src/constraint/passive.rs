//! Panel deflection and slosh angle.
//!
//! In the search passive coordinates are those of the linear response about rest at the configuration where the
//! plan starts, driven by the force that would have to hold them ([`HeldSystem`]):
//!
//! ```text
//! H_p* b'' + D b' + K b = -e(t),      H_p* = H_p - H_bp^T H_b^-1 H_bp,
//! ```
//!
//! centrifugal and all other terms of the arm's motion included in `e`, on whatever body the appendage hangs. What is
//! left out is the change of `H_p*` along the motion, the effect of the deflection on `e`, and everything
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

use super::held::{HeldPartials, HeldSystem, HeldWork};
use super::windows::Signal;
use super::{Channel, ConstraintError, Snapshot, check_limit};
use ff_dynamics::modes::stiffness_damping;
use ff_dynamics::{Boundary, State, Work, mass_matrix, modes};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use std::sync::Arc;

/// Samples per period of the fastest mode.
const PER_PERIOD: f64 = 12.0;

/// `|eta_k - rest_k| <= limit_k`, one channel per limited passive coordinate.
#[derive(Clone, Debug)]
pub struct PassiveRange {
    system: Arc<HeldSystem>,
    coords: Vec<usize>,
    channels: Vec<Channel>,
    rate: f64,
    a: DMatrix<f64>,
    b: DMatrix<f64>,
}

/// `z_(k+1) = f z_k + g0 e_k + g1 e_(k+1)`, and derivatives with respect to the step.
#[derive(Clone, Debug, Default)]
struct Step {
    f: DMatrix<f64>,
    g0: DMatrix<f64>,
    g1: DMatrix<f64>,
}

/// Buffers of [`PassiveRange`].
#[derive(Clone, Debug)]
pub struct PassiveWork {
    held: HeldWork,
    partials: HeldPartials,
    step: Step,
    d_step: Step,
    z: Vec<DVector<f64>>,
}

impl PassiveRange {
    /// One limit per passive coordinate in its unit, `inf` for none; linear response about joint positions `q`.
    /// Allocates.
    ///
    /// # Errors
    /// [`ConstraintError`]: a wrong number of limits, one that is not positive, a singular mass matrix.
    ///
    /// # Panics
    /// If `q` has the wrong length.
    pub fn new(system: &Arc<HeldSystem>, q: &[f64], limits: &[f64]) -> Result<Self, ConstraintError> {
        let m = system.model();
        let declared = m.passive_coords();
        if limits.len() != declared.len() {
            let what = "passive coordinates";
            return Err(ConstraintError::Count { what, got: limits.len(), want: declared.len() });
        }
        let (mut coords, mut channels) = (Vec::new(), Vec::new());
        for (k, (&limit, (name, decl))) in limits.iter().zip(&declared).enumerate() {
            if limit != f64::INFINITY {
                check_limit(name, limit, decl.unit)?;
                coords.push(k);
                channels.push(Channel::at_most("deflection", name.as_str(), decl.unit, limit));
            }
        }
        let (n, np) = (m.nj(), m.np());
        let mut state = State::zero(m);
        state.q.copy_from_slice(q);
        state.eta.copy_from_slice(system.rest());
        let mut h = DMatrix::zeros(m.nv(), m.nv());
        mass_matrix(m, system.params(), &state, &mut Work::new(m), &mut h);
        let singular = || ConstraintError::Rigid(crate::rigid::RigidError::Singular);
        let h_bp = h.view((0, 6 + n), (6, np)).into_owned();
        let h_b = h.view((0, 0), (6, 6)).into_owned().cholesky().ok_or_else(singular)?;
        let inertia = h.view((6 + n, 6 + n), (np, np)) - h_bp.tr_mul(&h_b.solve(&h_bp));
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
        Ok(Self { system: system.clone(), coords, channels, rate, a, b })
    }
    /// The same limit for every coordinate that has the unit `unit` (`rad` for hinges and pendulums). Allocates.
    ///
    /// # Errors
    /// As [`PassiveRange::new`].
    ///
    /// # Panics
    /// If `q` has the wrong length.
    pub fn all(system: &Arc<HeldSystem>, q: &[f64], unit: &str, limit: f64) -> Result<Self, ConstraintError> {
        let of = |u: &str| if u == unit { limit } else { f64::INFINITY };
        let limits: Vec<f64> = system.model().passive_coords().iter().map(|(_, d)| of(d.unit)).collect();
        Self::new(system, q, &limits)
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

impl Signal for PassiveRange {
    type Work = PassiveWork;
    fn channels(&self) -> &[Channel] {
        &self.channels
    }
    fn rate(&self) -> f64 {
        self.rate
    }
    fn drives(&self) -> usize {
        self.system.model().np()
    }
    fn work(&self) -> PassiveWork {
        PassiveWork {
            held: self.system.work(),
            partials: self.system.partials(),
            step: Step::default(),
            d_step: Step::default(),
            z: Vec::new(),
        }
    }
    fn drive(&self, w: &mut PassiveWork, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>) {
        match partials {
            None => drop(self.system.evaluate(&mut w.held, s)),
            Some(out) => {
                self.system.differentiate(&mut w.held, s, &mut w.partials);
                let (n, m) = (self.system.model().nj(), self.system.model().np());
                out.copy_from(&w.partials.force.rows(n, m));
            }
        }
        u.copy_from_slice(&w.held.hold);
    }
    fn respond(&self, w: &mut PassiveWork, dt: f64, u: &DMatrix<f64>, y: &mut DMatrix<f64>) {
        // The exponential of a matrix that is not finite does not come to an end.
        let finite = dt.is_finite() && u.iter().all(|x| x.is_finite());
        if !finite {
            y.fill(f64::NAN);
            return;
        }
        (w.step, w.d_step) = self.discretise(dt);
        let count = u.ncols();
        w.z = vec![DVector::zeros(self.a.nrows()); count];
        for k in 0..count - 1 {
            w.z[k + 1] = &w.step.f * &w.z[k] + &w.step.g0 * u.column(k) + &w.step.g1 * u.column(k + 1);
        }
        for (c, &coord) in self.coords.iter().enumerate() {
            (0..count).for_each(|k| y[(c, k)] = w.z[k][coord].abs());
        }
    }
    fn reaches_back(&self) -> bool {
        true
    }
    fn adjoint(
        &self,
        w: &PassiveWork,
        u: &DMatrix<f64>,
        channel: usize,
        window: Range<usize>,
        weights: &[f64],
        over_u: &mut DMatrix<f64>,
    ) -> f64 {
        let coord = self.coords[channel];
        let (mut l, mut over_dt) = (DVector::zeros(self.a.nrows()), 0.0);
        for k in (1..window.end).rev() {
            if k >= window.start {
                l[coord] += weights[k - window.start] * w.z[k][coord].signum();
            }
            let mut before = over_u.column_mut(k - 1);
            before += w.step.g0.tr_mul(&l);
            let mut here = over_u.column_mut(k);
            here += w.step.g1.tr_mul(&l);
            let grown =
                &w.d_step.f * &w.z[k - 1] + &w.d_step.g0 * u.column(k - 1) + &w.d_step.g1 * u.column(k);
            over_dt += l.dot(&grown);
            l = w.step.f.tr_mul(&l);
        }
        over_dt
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        let rest = self.system.rest();
        self.coords.iter().zip(out).for_each(|(&k, o)| *o = (at.eta[k] - rest[k]).abs());
    }
}
