//! Joint motion of a record as a smooth function of time, with consistent rates and accelerations.

use crate::knot_spectrum::{SpectralFit, fit_by_spectrum};
use crate::motion_fit::{JointSamples, choose_knots};
use crate::rda::SetupError;
use crate::record::Record;
use ff_dynamics::motion::{HermiteTable, JointMotion};
use ff_model::Model;
use nalgebra::DMatrix;

/// The joint motion of a record.
///
/// With rates and accelerations in the record (noise-free simulation, or a controller that logs its set
/// points), quintic Hermite interpolation through the samples; with positions alone, a least-squares B-spline
/// ([`crate::motion_fit`]). Allocates.
///
/// # Errors
/// [`SetupError`].
pub fn joint_motion(model: &Model, record: &Record) -> Result<Box<dyn JointMotion>, SetupError> {
    let n = record.joints();
    if n != model.nj() {
        return Err(SetupError::Joints { got: n, want: model.nj() });
    }
    let rows = |m: &nalgebra::DMatrix<f64>| m.transpose().as_slice().to_vec();
    match (record.qd(), record.qdd()) {
        (Some(qd), Some(qdd)) => {
            let table = HermiteTable::new(n, record.dt(), &rows(record.q()), &rows(qd), &rows(qdd));
            Ok(Box::new(table.map_err(|e| SetupError::JointMotion(e.to_string()))?))
        }
        _ => fitted(record),
    }
}

/// B-spline through the positions of a record: the coarsest knots that reach the noise floor, no denser than the spectrum of
/// the positions has anything to follow, with the reason ([`crate::knot_spectrum`]). Allocates.
///
/// # Errors
/// [`SetupError::JointMotion`]; at least 64 samples are needed.
pub fn spectral_motion(record: &Record) -> Result<SpectralFit, SetupError> {
    on_samples(record, |s| fit_by_spectrum(s, None).map_err(|e| SetupError::JointMotion(e.to_string())))
}

fn on_samples<T>(record: &Record, fit: impl FnOnce(&JointSamples<'_>) -> T) -> T {
    let times: Vec<f64> = (0..record.samples()).map(|i| i as f64 * record.dt()).collect();
    let q = rows(record.q());
    fit(&JointSamples { dof: record.joints(), times: &times, q: &q, qd: None, rate_weight: 0.0 })
}

/// [`spectral_motion`], or without a spectrum for the shortest records.
fn fitted(record: &Record) -> Result<Box<dyn JointMotion>, SetupError> {
    if record.samples() >= 64 {
        return Ok(Box::new(spectral_motion(record)?.fit.motion));
    }
    let fit = on_samples(record, |s| choose_knots(s, None)).map_err(|e| SetupError::JointMotion(e.to_string()))?;
    Ok(Box::new(fit.motion))
}

/// Row-major copy: sample after sample.
fn rows(m: &DMatrix<f64>) -> Vec<f64> {
    m.transpose().as_slice().to_vec()
}
