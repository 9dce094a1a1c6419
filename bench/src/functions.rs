//! The functions that are timed, each as one call on state number `i`.

use crate::lanes::Lanes;
use crate::states::Set;
use ff_dynamics::{SingularInertia, State, Work, forward_dynamics, hybrid_dynamics, mass_matrix, regressor, rnea};
use ff_model::{Model, Params};
use nalgebra::DMatrix;
use std::hint::black_box;

/// One timed function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Function {
    Rnea,
    Crba,
    Fd,
    Hybrid,
    Regressor,
    // PLACE FOR `id_derivatives`: a variant here, its name below, one arm in `Runner::call` on `rnea_derivatives`, a
    // check in `check.rs` against duals, and its entry in the table of peers in xtask/src/bench.
}

impl Function {
    /// Those that exist over any [`Lanes`].
    pub(crate) const LANED: [Self; 4] = [Self::Rnea, Self::Crba, Self::Fd, Self::Hybrid];
    /// Those that exist over `f64` only.
    pub(crate) const PLAIN: [Self; 1] = [Self::Regressor];

    /// Name in the JSON output.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::Rnea => "rnea",
            Self::Crba => "crba",
            Self::Fd => "fd",
            Self::Hybrid => "hybrid",
            Self::Regressor => "regressor",
        }
    }
}

/// A model with states and every buffer, over one scalar type.
pub(crate) struct Runner<'m, T: Lanes> {
    pub(crate) model: &'m Model,
    pub(crate) params: Params<T>,
    pub(crate) set: Set<T>,
    pub(crate) work: Work<T>,
    pub(crate) out: Vec<T>,
    pub(crate) joint: Vec<T>,
    pub(crate) matrix: DMatrix<T>,
}

impl<'m, T: Lanes> Runner<'m, T> {
    pub(crate) fn new(model: &'m Model, set: Set<T>) -> Self {
        let z = T::zero();
        Self {
            model,
            params: Params::nominal(model),
            set,
            work: Work::new(model),
            out: vec![z; model.nv()],
            joint: vec![z; model.nj()],
            matrix: DMatrix::from_element(model.nv(), model.nv(), z),
        }
    }

    /// Forces for the motion of state `i`, into `out`.
    #[inline(always)]
    pub(crate) fn rnea(&mut self, i: usize) -> f64 {
        rnea(self.model, &self.params, &self.set.states[i], &self.set.a[i], &mut self.work, &mut self.out);
        black_box(&mut self.out)[7].lane(0)
    }
    /// Mass matrix of state `i`, into `matrix`.
    #[inline(always)]
    pub(crate) fn crba(&mut self, i: usize) -> f64 {
        mass_matrix(self.model, &self.params, &self.set.states[i], &mut self.work, &mut self.matrix);
        black_box(&mut self.matrix)[(7, 7)].lane(0)
    }
    /// Accelerations for the forces of state `i`, into `out`.
    #[inline(always)]
    pub(crate) fn fd(&mut self, i: usize) -> Result<f64, SingularInertia> {
        let (state, tau): (&State<T>, &[T]) = (&self.set.states[i], &self.set.tau[i]);
        forward_dynamics(self.model, &self.params, state, tau, &mut self.work, &mut self.out)?;
        Ok(black_box(&mut self.out)[7].lane(0))
    }
    /// Base and passive accelerations and joint torques for the joint accelerations of state `i`, into `out` and
    /// `joint`.
    #[inline(always)]
    pub(crate) fn hybrid(&mut self, i: usize) -> Result<f64, SingularInertia> {
        let nb = self.model.nb();
        let qdd = &self.set.a[i][nb..nb + self.model.nj()];
        let state = &self.set.states[i];
        hybrid_dynamics(self.model, &self.params, state, qdd, &mut self.work, &mut self.out, &mut self.joint)?;
        black_box(&mut self.out);
        // The peers' line sums the joint torques.
        Ok(black_box(&mut self.joint).iter().map(|t| t.lane(0)).sum())
    }
}

/// The regressor exists over `f64` only.
pub(crate) struct RegressorRunner {
    pub(crate) y: DMatrix<f64>,
}

impl RegressorRunner {
    pub(crate) fn new(model: &Model) -> Self {
        Self { y: DMatrix::zeros(model.nv(), model.n_params()) }
    }
    /// Regressor of state `i`, into `y`.
    #[inline(always)]
    pub(crate) fn call(&mut self, r: &mut Runner<'_, f64>, i: usize) -> f64 {
        regressor(r.model, &r.params, &r.set.states[i], &r.set.a[i], &mut r.work, &mut self.y);
        black_box(&mut self.y)[(6, 16)]
    }
}
