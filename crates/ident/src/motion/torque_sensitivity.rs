//! What errors of joint accelerations are worth to the torques, and those of joint rates to the gyro.
//!
//! Accelerations enter through the inertia that the joints feel while base and passive coordinates `u` are free,
//! `H* = H_mm - H_mu H_uu^-1 H_um`. Rates enter the rate of a floating base by conservation of momentum, `w = -[H_uu^-1 H_um]_w qd`,
//! which on a base that is light against its arm is of the size of `qd` itself. Both are taken at the nominal parameters at some
//! poses along the record: a scale is wanted (`docs/theory/joint-motion.md`).

use crate::motion::knot_spectrum::Stake;
use ff_dynamics::{State, Work, mass_matrix};
use ff_model::{Model, Params};
use ff_records::Record;
use nalgebra::DMatrix;

/// Poses along a record at which inertias are taken.
const POSES: usize = 9;
/// Part of the variance of the sensors that noise of the motion may add without costing anything.
const FREE: f64 = 1e-3;

/// Mass matrices at so many poses along a record, passive coordinates at rest. Allocates.
pub(crate) fn along_poses(
    model: &Model,
    params: &Params<f64>,
    record: &Record,
    poses: usize,
) -> impl Iterator<Item = DMatrix<f64>> {
    let mut work = Work::new(model);
    let mut state = State::zero(model);
    state.eta = model.rest_position(params);
    (0..poses).map(move |k| {
        let i = k * (record.q().nrows() - 1) / (poses - 1);
        state.q.iter_mut().zip(record.q().row(i).iter()).for_each(|(q, x)| *q = *x);
        let mut h = DMatrix::zeros(model.nv(), model.nv());
        mass_matrix(model, params, &state, &mut work, &mut h);
        h
    })
}

/// The inertia that coordinates feel while others are free, and how these then move with them: `H_mm - H_mu H_uu^-1 H_um`, `H_uu^-1 H_um`. `None` where the
/// mass matrix is not definite. Allocates.
pub(crate) fn while_free(h: &DMatrix<f64>, free: &[usize], of: &[usize]) -> Option<[DMatrix<f64>; 2]> {
    let cut = |rows: &[usize], cols: &[usize]| h.select_rows(rows).select_columns(cols);
    let h_um = cut(free, of);
    let x = cut(free, free).cholesky()?.solve(&h_um);
    Some([cut(of, of) - h_um.transpose() * &x, x])
}

/// For every joint, the norm of the torques that its unit acceleration takes over the deviation of the torque sensors (N m), and that of the
/// base's angular rate that its unit rate causes over the deviation of the gyro (rad/s): base and passive coordinates free, root mean square
/// over the poses, at the nominal parameters, with `reflected` inertia of rotors and gears (kg m^2; none when empty) where torques are those of
/// motors. `None` where a mass matrix is not definite. Allocates.
pub(crate) fn stake(model: &Model, record: &Record, [torque, gyro]: [f64; 2], reflected: &[f64]) -> Option<Stake> {
    let params = Params::<f64>::nominal(model);
    let (n, m) = (model.nj(), model.np());
    let nb = model.nv() - n - m;
    let free: Vec<usize> = (0..nb).chain(nb + n..model.nv()).collect();
    let joints: Vec<usize> = (nb..nb + n).collect();
    let (mut squares, mut of_rates) = (vec![0.0; n], vec![0.0; n]);
    for h in along_poses(model, &params, record, POSES) {
        let [mut effective, x] = while_free(&h, &free, &joints)?;
        reflected.iter().enumerate().for_each(|(j, i)| effective[(j, j)] += i);
        // Twists list the velocity first, then the rate.
        let base = x.rows(nb.min(3), nb.min(3));
        of_rates.iter_mut().zip(base.column_iter()).for_each(|(s, c)| *s += c.norm_squared());
        squares.iter_mut().zip(effective.column_iter()).for_each(|(s, c)| *s += c.norm_squared());
    }
    let over = |sums: &[f64], sigma: f64| sums.iter().map(|s| (s / POSES as f64).sqrt() / sigma).collect();
    let (weights, rates) = (over(&squares, torque), over(&of_rates, gyro));
    Some(Stake { weights, rates, free: FREE * (n + nb.min(3)) as f64, kinks: false, corners: Vec::new() })
}
