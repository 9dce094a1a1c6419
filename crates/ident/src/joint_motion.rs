//! Joint motion of a record as a smooth function of time, with consistent rates and accelerations.

use crate::rda::SetupError;
use crate::record::Record;
use ff_dynamics::motion::{HermiteTable, JointMotion};
use ff_model::Model;

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
    let fail = |e: &dyn std::fmt::Display| SetupError::JointMotion(e.to_string());
    match (record.qd(), record.qdd()) {
        (Some(qd), Some(qdd)) => {
            let table = HermiteTable::new(n, record.dt(), &rows(record.q()), &rows(qd), &rows(qdd));
            Ok(Box::new(table.map_err(|e| fail(&e))?))
        }
        _ => fitted(record),
    }
}

fn fitted(record: &Record) -> Result<Box<dyn JointMotion>, SetupError> {
    let _ = record;
    Err(SetupError::JointMotion("positions alone need motion_fit".into()))
}
