//! Which joint accelerations drive a mode: weights for the [`Modal`](crate::Modal) cost from the model.
//!
//! With the joints moving and the base free, the passive coordinates about rest obey (`theory.md` 2)
//!
//! ```text
//! H_p* b'' + D b' + K b = -B qdd,     B = H_mp^T - H_bp^T H_b^-1 H_bm,     H_p* = H_p - H_bp^T H_b^-1 H_bp,
//! ```
//!
//! so that mode `psi` (largest component 1) with amplitude `x` obeys
//!
//! ```text
//! x'' + 2 zeta w x' + w^2 x = c . qdd,     c = -psi^T B / (psi^T H_p* psi).
//! ```
//!
//! `c . qdd` is thus the acceleration of the mode's largest coordinate, and an undamped mode is left swinging
//! with rate amplitude `|int (c . qdd) exp(-i w t) dt|`, the gain of [`Modal`](crate::Modal). The weights hold at the
//! configuration they are computed for; along a large motion they change with the mass matrix.

use crate::cost::spectrum::Target;
use ff_dynamics::modes::ModesError;
use ff_dynamics::{Boundary, MassBlocks, State, Work, mass_matrix, modes};
use ff_model::{Model, Params};
use nalgebra::{DMatrix, DVector};

/// One target per mode of the free-floating system with held joints, at joint positions `q` and appendages at
/// rest, in ascending frequency; importance 1 each. Weights have the unit of the passive coordinate per
/// joint unit (1 for revolute on hinge). Empty without appendages. Allocates.
///
/// # Errors
/// [`ModesError`].
///
/// # Panics
/// If `q` has the wrong length.
pub fn modal_targets(model: &Model, params: &Params<f64>, q: &[f64]) -> Result<Vec<Target>, ModesError> {
    let eta = model.rest_position(params);
    let found = modes(model, params, q, &eta, Boundary::JointsHeld)?;
    if found.is_empty() {
        return Ok(Vec::new());
    }
    let mut state = State::zero(model);
    state.q.copy_from_slice(q);
    state.eta.copy_from_slice(&eta);
    let mut h = DMatrix::zeros(model.nv(), model.nv());
    mass_matrix(model, params, &state, &mut Work::new(model), &mut h);
    let b = MassBlocks::new(&h, model.nb(), model.nj());
    // A fixed base has no rows to eliminate.
    let (drive, inertia) = if model.nb() == 0 {
        (b.h_mp.transpose(), b.h_p)
    } else {
        let chol = b.h_b.cholesky().ok_or(ModesError::Singular)?;
        let coupling = b.h_bp.transpose();
        (b.h_mp.transpose() - &coupling * chol.solve(&b.h_bm), b.h_p - &coupling * chol.solve(&b.h_bp))
    };
    Ok(found
        .into_iter()
        .map(|mode| {
            let psi = DVector::from_vec(mode.passive);
            let mass = psi.dot(&(&inertia * &psi));
            let weights = -(drive.tr_mul(&psi)) / mass;
            Target { frequency: mode.frequency_hz, weights: weights.as_slice().to_vec(), importance: 1.0 }
        })
        .collect())
}

/// Band (Hz) around all natural frequencies at joint positions `q`: from `(1 - margin)` times the lowest to
/// `(1 + margin)` times the highest, for [`QuietBand`](crate::QuietBand). `None` without appendages.
/// Frequencies move with the configuration; the margin has to cover that. Allocates.
///
/// # Errors
/// [`ModesError`].
///
/// # Panics
/// If `q` has the wrong length.
pub fn flexible_band(
    model: &Model,
    params: &Params<f64>,
    q: &[f64],
    margin: f64,
) -> Result<Option<(f64, f64)>, ModesError> {
    let found = modes(model, params, q, &model.rest_position(params), Boundary::JointsHeld)?;
    let edges = found.first().zip(found.last());
    Ok(edges.map(|(a, b)| ((1.0 - margin) * a.frequency_hz, (1.0 + margin) * b.frequency_hz)))
}
