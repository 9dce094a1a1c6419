//! What errors of joint accelerations are worth to the torques.
//!
//! They enter through the inertia that the joints feel while base and passive coordinates `u` are free,
//! `H* = H_mm - H_mu H_uu^-1 H_um`, taken at the nominal parameters at some poses along the record: a scale is wanted
//! (`docs/theory/joint-motion.md`).

use crate::knot_spectrum::Stake;
use crate::record::Record;
use ff_dynamics::{State, Work, mass_matrix};
use ff_model::{Model, Params};
use nalgebra::DMatrix;

/// Poses along a record at which inertias are taken.
const POSES: usize = 9;
/// Part of the variance of the torque sensors that noise of accelerations may add without costing anything.
const FREE: f64 = 1e-3;

/// Torque over joint acceleration, `n x n`, base and passive coordinates free, at some poses along a record.
pub(crate) struct Leverage(Vec<DMatrix<f64>>);

impl Leverage {
    /// At the nominal parameters: a scale is wanted. `None` where a mass matrix is not definite.
    pub(crate) fn new(model: &Model, record: &Record) -> Option<Self> {
        let params = Params::<f64>::nominal(model);
        let (n, m) = (model.nj(), model.np());
        let nb = model.nv() - n - m;
        let mut work = Work::new(model);
        let mut state = State::zero(model);
        state.eta = model.rest_position(&params);
        let mut h = DMatrix::zeros(model.nv(), model.nv());
        let free: Vec<usize> = (0..nb).chain(nb + n..model.nv()).collect();
        let joints: Vec<usize> = (nb..nb + n).collect();
        let mut torque = Vec::new();
        for k in 0..POSES {
            let i = k * (record.samples() - 1) / (POSES - 1);
            state.q.iter_mut().zip(record.q().row(i).iter()).for_each(|(q, x)| *q = *x);
            mass_matrix(model, &params, &state, &mut work, &mut h);
            let cut = |rows: &[usize], cols: &[usize]| h.select_rows(rows).select_columns(cols);
            let h_um = cut(&free, &joints);
            let x = cut(&free, &free).cholesky()?.solve(&h_um);
            torque.push(cut(&joints, &joints) - h_um.transpose() * &x);
        }
        Some(Self(torque))
    }
    /// What accelerations are worth for torques of this noise.
    pub(crate) fn stake(&self, sigma: f64) -> Stake {
        let n = self.0[0].ncols();
        let of = |j: usize| {
            let sum: f64 = self.0.iter().map(|h| h.column(j).norm_squared()).sum();
            (sum / self.0.len() as f64).sqrt() / sigma
        };
        Stake { weights: (0..n).map(of).collect(), free: FREE * n as f64 }
    }
}
