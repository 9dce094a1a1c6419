//! Which joint accelerations drive a mode: weights for the [`Modal`](crate::objective::spectrum::Modal) cost from the model.
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
//! with rate amplitude `|int (c . qdd) exp(-i w t) dt|`, the gain of [`Modal`](crate::objective::spectrum::Modal). The weights hold at the
//! configuration they are computed for; along a large motion they change with the mass matrix.

use crate::objective::disturbance::DrivenMode;
use crate::objective::spectrum::Target;
use crate::system::rigid::SensorNoise;
use ff_dynamics::analysis::ModesError;
use ff_dynamics::tree::MassBlocks;
use ff_dynamics::{Boundary, Mode, State, Work, mass_matrix, modes};
use ff_model::{Model, Params};
use nalgebra::{DMatrix, DVector};

/// Modes at joint positions `q` with the matrices that say what drives them.
struct Driven {
    modes: Vec<Mode>,
    blocks: MassBlocks,
    /// `B`, passive x joints.
    joints: DMatrix<f64>,
    /// `psi^T H_p* psi` per mode.
    masses: Vec<f64>,
}

fn driven(model: &Model, params: &Params<f64>, q: &[f64]) -> Result<Driven, ModesError> {
    let eta = model.rest_position(params);
    let modes = modes(model, params, q, &eta, Boundary::JointsHeld)?;
    let mut state = State::zero(model);
    state.q.copy_from_slice(q);
    state.eta.copy_from_slice(&eta);
    let mut h = DMatrix::zeros(model.nv(), model.nv());
    mass_matrix(model, params, &state, &mut Work::new(model), &mut h);
    let blocks = MassBlocks::new(&h, model.nb(), model.nj());
    let (mut joints, mut inertia) = (blocks.h_mp.transpose(), blocks.h_p.clone());
    // A fixed base has no rows to eliminate.
    if model.nb() > 0 {
        let chol = blocks.h_b.clone().cholesky().ok_or(ModesError::Singular)?;
        joints -= blocks.h_bp.tr_mul(&chol.solve(&blocks.h_bm));
        inertia -= blocks.h_bp.tr_mul(&chol.solve(&blocks.h_bp));
    }
    let mass =
        |m: &Mode| DVector::from_column_slice(&m.passive).dot(&(&inertia * DVector::from_column_slice(&m.passive)));
    let masses = modes.iter().map(mass).collect();
    Ok(Driven { modes, blocks, joints, masses })
}

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
    let d = driven(model, params, q)?;
    let target = |(mode, mass): (&Mode, &f64)| {
        let weights = d.joints.tr_mul(&DVector::from_column_slice(&mode.passive)) * (-1.0 / mass);
        Target { frequency: mode.frequency_hz, weights: weights.as_slice().to_vec(), importance: 1.0 }
    };
    Ok(d.modes.iter().zip(&d.masses).map(target).collect())
}

/// The modes as base acceleration drives them and as the sensors see them, for
/// [`Disturbance`](crate::objective::disturbance::Disturbance); free base, joint positions `q`, appendages at rest, all on the base.
///
/// With `A` the base acceleration of the robot with frozen appendages, `B qdd` above is `H_bp^T A` (velocity terms
/// in `A` included), so `d = -H_bp psi / (psi^T H_p* psi)`. A modal acceleration moves the base by
/// `a = -H_b^-1 H_bp psi` and loads the joints with `H_bm^T a + H_mp psi`. Allocates.
///
/// # Errors
/// [`ModesError`].
///
/// # Panics
/// If `q` has the wrong length or the base is fixed.
pub fn driven_modes(
    model: &Model,
    params: &Params<f64>,
    q: &[f64],
    noise: &SensorNoise,
) -> Result<Vec<DrivenMode>, ModesError> {
    let d = driven(model, params, q)?;
    assert_eq!(model.nb(), 6, "a free base");
    let one = |(mode, mass): (&Mode, &f64)| {
        let psi = DVector::from_column_slice(&mode.passive);
        let drive = &d.blocks.h_bp * &psi * (-1.0 / mass);
        let load = d.blocks.h_bm.tr_mul(&mode.base) + &d.blocks.h_mp * &psi;
        DrivenMode {
            frequency: mode.frequency_hz,
            damping: mode.damping_ratio,
            drive: drive.fixed_rows::<6>(0).into_owned(),
            torque: load.norm_squared() / (noise.torque * noise.torque),
            gyro: noise.gyro.map_or(0.0, |g| mode.base.fixed_rows::<3>(3).norm_squared() / (g * g)),
        }
    };
    Ok(d.modes.iter().zip(&d.masses).map(one).collect())
}

/// Band (Hz) around all natural frequencies at joint positions `q`: from `(1 - margin)` times the lowest to
/// `(1 + margin)` times the highest, for [`QuietBand`](crate::planning::QuietBand). `None` without appendages.
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
