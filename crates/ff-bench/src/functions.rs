//! The functions that are timed, each as one call on state number `i`.

use crate::states::Set;
use clap::ValueEnum;
use ff_dynamics::tree::{Derivatives, SingularInertia, mass_matrix_lower, rnea_derivatives};
use ff_dynamics::{Regressor, Work, forward_dynamics, hybrid_dynamics, mass_matrix, regressor, rnea};
use ff_model::scalar::LaneScalar;
use ff_model::{Model, Params};
use nalgebra::DMatrix;
use std::hint::black_box;

/// One timed function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Function {
    /// Forces for a motion.
    Rnea,
    /// Lower triangle of the mass matrix: as the peers, which fill one triangle, too.
    Crba,
    /// Mass matrix, both triangles.
    #[value(name = "mass_matrix")]
    MassMatrix,
    /// Accelerations for forces, everything free.
    Fd,
    /// Base and passive accelerations and joint torques for prescribed joint accelerations.
    Hybrid,
    /// Derivatives of the forces with respect to every parameter.
    Regressor,
    /// Derivatives of the forces with respect to position, velocity and acceleration.
    #[value(name = "id_derivatives")]
    IdDerivatives,
}

impl Function {
    /// All of them.
    pub(crate) const ALL: [Self; 7] =
        [Self::Rnea, Self::Crba, Self::MassMatrix, Self::Fd, Self::Hybrid, Self::Regressor, Self::IdDerivatives];

    /// Name in the JSON output.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::Rnea => "rnea",
            Self::Crba => "crba",
            Self::MassMatrix => "mass_matrix",
            Self::Fd => "fd",
            Self::Hybrid => "hybrid",
            Self::Regressor => "regressor",
            Self::IdDerivatives => "id_derivatives",
        }
    }
}

/// A model with states and every buffer, over one scalar type.
pub(crate) struct Runner<'m, T: LaneScalar> {
    pub(crate) model: &'m Model,
    pub(crate) params: Params<T>,
    pub(crate) set: Set<T>,
    pub(crate) work: Work<T>,
    /// Forces or accelerations, `nv`.
    pub(crate) out: Vec<T>,
    /// Joint torques of the hybrid form.
    pub(crate) joint: Vec<T>,
    /// Mass matrix.
    pub(crate) matrix: DMatrix<T>,
    /// Regressor.
    pub(crate) y: Regressor<T>,
    /// Derivatives.
    pub(crate) d: Derivatives<T>,
}

impl<'m, T: LaneScalar> Runner<'m, T> {
    pub(crate) fn new(model: &'m Model, set: Set<T>) -> Self {
        let (z, nv) = (T::zero(), model.nv());
        Self {
            model,
            params: Params::nominal(model),
            set,
            work: Work::new(model),
            out: vec![z; nv],
            joint: vec![z; model.nj()],
            matrix: DMatrix::from_element(nv, nv, z),
            y: Regressor::new(model),
            d: Derivatives::new(model),
        }
    }

    /// One call of `f` on state `i`; the result stays in the buffers, one number of it is returned, as the peers do.
    #[inline(always)]
    pub(crate) fn call(&mut self, f: Function, i: usize) -> Result<f64, SingularInertia> {
        let (m, p, s) = (self.model, &self.params, &self.set.states[i]);
        let (a, tau) = (&self.set.a[i], &self.set.tau[i]);
        Ok(match f {
            Function::Rnea => {
                rnea(m, p, s, a, &mut self.work, &mut self.out);
                pick(black_box(&self.out), 7)
            }
            Function::Crba => {
                let h = mass_matrix_lower(m, p, s, &mut self.work);
                let k = 7.min(m.nv() - 1);
                black_box(&h)[(k, k)].lane(0)
            }
            Function::MassMatrix => {
                mass_matrix(m, p, s, &mut self.work, &mut self.matrix);
                pick(black_box(&self.matrix).as_slice(), 7 * m.nv() + 7)
            }
            Function::Fd => {
                forward_dynamics(m, p, s, tau, &mut self.work, &mut self.out)?;
                pick(black_box(&self.out), 7)
            }
            Function::Hybrid => {
                let qdd = &a[m.nb()..m.nb() + m.nj()];
                hybrid_dynamics(m, p, s, qdd, &mut self.work, &mut self.out, &mut self.joint)?;
                black_box(&self.out);
                // The peers' line sums the joint torques.
                black_box(&self.joint).iter().map(|t| t.lane(0)).sum()
            }
            Function::Regressor => {
                regressor(m, p, s, a, &mut self.work, &mut self.y);
                // Row 6, column 16.
                pick(black_box(&self.y).as_slice(), 16 * m.nv() + 6)
            }
            Function::IdDerivatives => {
                rnea_derivatives(m, p, s, a, &mut self.work, &mut self.d);
                pick(black_box(&self.d).dq.as_slice(), 7 * m.nv() + 7)
            }
        })
    }

    /// Everything that a call of `f` on state `i` computed, if it was the last one.
    pub(crate) fn result(&mut self, f: Function, i: usize) -> Vec<T> {
        match f {
            Function::Rnea | Function::Fd => self.out.clone(),
            // The numbers are in `work`: once more.
            Function::Crba => {
                let h = mass_matrix_lower(self.model, &self.params, &self.set.states[i], &mut self.work);
                (0..h.nrows()).flat_map(|i| (0..=i).map(move |j| (i, j))).map(|at| h[at]).collect()
            }
            Function::MassMatrix => self.matrix.as_slice().to_vec(),
            Function::Hybrid => [self.out.as_slice(), &self.joint].concat(),
            Function::Regressor => self.y.as_slice().to_vec(),
            Function::IdDerivatives => [self.d.dq.as_slice(), self.d.dv.as_slice(), self.d.da.as_slice()].concat(),
        }
    }
}

/// Element `k`, or the last of a shorter result.
#[inline(always)]
fn pick<T: LaneScalar>(x: &[T], k: usize) -> f64 {
    x[k.min(x.len() - 1)].lane(0)
}
