//! A change of angular momentum during a record: a jump at some instant, or a steady drift.
//!
//! Score test of three more unknowns, the change `d` of the base rate (rad/s, base frame). J is the Jacobian of everything that was
//! fitted, r the whitened residuals, P the projector onto the complement of the range of J, S the columns that a step (or a ramp) of
//! the rate at an instant adds to the gyro residuals. They lower chi-squared by
//!
//! ```text
//! drop = g' (S' P S)^-1 g,    g = S' P r
//! ```
//!
//! and the change of momentum is that rate times the inertia of the whole system about its centre of mass, joints and passive
//! coordinates locked (C. R. Rao, *Proc. Cambridge Phil. Soc.* 44, 1948).

use crate::estimate::estimator::Estimator;
use crate::estimate::nuisance::{NuisanceError, NuisanceFit};
use ff_dynamics::{State, Work, mass_matrix};
use ff_model::{Inertia, Model, Params};
use ff_records::Record;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Part of the misfit that a change of momentum must explain to be reported.
const EXPLAINS: f64 = 0.6;
/// Least drop of chi-squared for that, by three unknowns.
const DROP: f64 = 60.0;
/// Instants at which a jump is tried.
const INSTANTS: usize = 60;

/// A change of angular momentum that explains most of a misfit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentumChange {
    /// Time stamp of the jump (s); `None` for a steady drift.
    pub at: Option<f64>,
    /// Change of the base rate over the record (rad/s, base frame).
    pub rate: Vector3<f64>,
    /// Change of angular momentum (N m s, base axes, about the centre of mass).
    pub momentum: Vector3<f64>,
    /// Drop of chi-squared.
    pub drop: f64,
    /// Chi-squared above its expectation before.
    pub excess: f64,
}

/// Tests whether a jump or a drift of the angular momentum explains what a fit of `record` leaves. `estimator` predicts torques
/// and gyro of the record (output error), `values` is the full parameter vector, `selected` are the parameters that were fitted,
/// `nuisance` the result of [`crate::estimate::fit_nuisance`] with this estimator, `gyro_sigma` the standard deviation of a gyro
/// sample (rad/s). `None` when no such change explains most of the misfit. Allocates the Jacobian.
///
/// # Errors
/// [`NuisanceError::Evaluate`] when the record cannot be predicted at these values.
///
/// # Panics
/// If channels have sample times of their own ([`Record::is_uniform`]).
pub fn momentum_change(
    model: &Model,
    record: &Record,
    estimator: &mut dyn Estimator,
    (values, selected): (&[f64], &[usize]),
    nuisance: NuisanceFit,
    gyro_sigma: f64,
) -> Result<Option<MomentumChange>, NuisanceError> {
    assert!(record.is_uniform(), "all channels on one uniform clock");
    let NuisanceFit { values: extra, residuals: mut r, .. } = nuisance;
    let mut j = DMatrix::zeros(r.len(), selected.len() + extra.len());
    estimator.jacobian(values, &extra, selected, &mut r, &mut j)?;
    for mut c in j.column_iter_mut() {
        let norm = c.norm();
        if norm > 0.0 && norm.is_finite() {
            c.unscale_mut(norm);
        }
    }
    if j.iter().chain(&r).any(|x| !x.is_finite()) {
        return Ok(None);
    }
    let q = j.qr().q();
    let r = DVector::from_vec(r);
    let left = &r - &q * q.tr_mul(&r);
    let (n, nj) = (record.samples(), model.nj());
    let width = nj + 3;
    let excess = left.norm_squared() - (r.len() - q.ncols()) as f64;
    // Drop of chi-squared by three columns, and the change of rate over the record.
    let explained = |shape: &dyn Fn(usize) -> f64| -> Option<(f64, Vector3<f64>)> {
        let mut columns = DMatrix::zeros(n * width, 3);
        for i in 0..n {
            (0..3).for_each(|k| columns[(i * width + nj + k, k)] = shape(i) / gyro_sigma);
        }
        columns -= &q * q.tr_mul(&columns);
        let g = columns.tr_mul(&left);
        let change = (columns.tr_mul(&columns)).cholesky()?.solve(&g);
        // Residuals are predicted minus measured: what they lack is what the measured rate has more.
        Some((g.dot(&change), -Vector3::new(change[0], change[1], change[2])))
    };
    let last = (n - 1).max(1) as f64;
    let mut best: (f64, Vector3<f64>, Option<f64>) = (0.0, Vector3::zeros(), None);
    if let Some((drop, change)) = explained(&|i| i as f64 / last) {
        best = (drop, change, None);
    }
    for m in 1..INSTANTS {
        let from = m * n / INSTANTS;
        if let Some((drop, change)) = explained(&|i| f64::from(u8::from(i >= from)))
            && drop > best.0
        {
            best = (drop, change, Some(record.time(from)));
        }
    }
    let (drop, rate, at) = best;
    if drop < DROP || drop < EXPLAINS * excess {
        return Ok(None);
    }
    let momentum = locked_inertia(model, values, record) * rate;
    Ok(Some(MomentumChange { at, rate, momentum, drop, excess }))
}

/// Inertia (kg m^2) of the whole system about its centre of mass, joints locked where they are in the middle of the record.
fn locked_inertia(model: &Model, values: &[f64], record: &Record) -> Matrix3<f64> {
    let params = Params::from_values(model, values.to_vec());
    let mut state = State::<f64>::zero(model);
    let mid = record.samples() / 2;
    (0..model.nj()).for_each(|j| state.q[j] = record.q()[(mid, j)]);
    state.eta.copy_from_slice(&model.rest_position(&params));
    let mut h = DMatrix::zeros(model.nv(), model.nv());
    mass_matrix(model, &params, &state, &mut Work::new(model), &mut h);
    Inertia::from_elements(|i, j| h[(i, j)]).about_com()
}
