//! What errors of joint accelerations are worth to the torques.
//!
//! They enter through the inertia that the joints feel while base and passive coordinates `u` are free,
//! `H* = H_mm - H_mu H_uu^-1 H_um`, taken at the nominal parameters at some poses along the record: a scale is wanted
//! (`docs/theory/joint-motion.md`).

use crate::motion::knot_spectrum::Stake;
use ff_dynamics::{State, Work, mass_matrix};
use ff_model::{Model, Params};
use ff_records::Record;
use nalgebra::DMatrix;

/// Poses along a record at which inertias are taken.
const POSES: usize = 9;
/// Part of the variance of the torque sensors that noise of accelerations may add without costing anything.
const FREE: f64 = 1e-3;

/// What accelerations are worth for torque sensors of standard deviation `sigma` (N m): for every joint, the norm of the torques
/// that its unit acceleration takes, base and passive coordinates free, root mean square over the poses, over `sigma`. At the
/// nominal parameters. `None` where a mass matrix is not definite. Allocates.
pub(crate) fn stake(model: &Model, record: &Record, sigma: f64) -> Option<Stake> {
    let params = Params::<f64>::nominal(model);
    let (n, m) = (model.nj(), model.np());
    let nb = model.nv() - n - m;
    let mut work = Work::new(model);
    let mut state = State::zero(model);
    state.eta = model.rest_position(&params);
    let mut h = DMatrix::zeros(model.nv(), model.nv());
    let free: Vec<usize> = (0..nb).chain(nb + n..model.nv()).collect();
    let joints: Vec<usize> = (nb..nb + n).collect();
    let mut squares = vec![0.0; n];
    for k in 0..POSES {
        let i = k * (record.q().nrows() - 1) / (POSES - 1);
        state.q.iter_mut().zip(record.q().row(i).iter()).for_each(|(q, x)| *q = *x);
        mass_matrix(model, &params, &state, &mut work, &mut h);
        let cut = |rows: &[usize], cols: &[usize]| h.select_rows(rows).select_columns(cols);
        let h_um = cut(&free, &joints);
        let x = cut(&free, &free).cholesky()?.solve(&h_um);
        let torque = cut(&joints, &joints) - h_um.transpose() * &x;
        squares.iter_mut().zip(torque.column_iter()).for_each(|(s, c)| *s += c.norm_squared());
    }
    let weights = squares.iter().map(|s| (s / POSES as f64).sqrt() / sigma).collect();
    Some(Stake { weights, free: FREE * n as f64 })
}
