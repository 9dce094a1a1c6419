//! Records behind a low pass, and the parts of them that a filter leaves whole.

use crate::estimate::setup::SetupError;
use crate::motion::zero_phase::ZeroPhase;
use crate::solve::linear::LinearError;
use ff_records::Record;
use nalgebra::DMatrix;

/// The filter of a cutoff (Hz).
pub(super) fn filter(record: &Record, value: f64) -> Result<ZeroPhase, LinearError> {
    let needed = "above zero and a tenth of the rate at most";
    let wrong = || LinearError::Option { what: "cutoff of the low pass (Hz)".into(), value, needed };
    ZeroPhase::new(record.rate_hz(), value).ok_or_else(wrong)
}

/// What is said of a record that is shorter than three transients.
pub(super) fn too_short(value: f64) -> LinearError {
    let needed = "higher, for a record as short as this";
    LinearError::Option { what: "cutoff of the low pass (Hz)".into(), value, needed }
}

/// A record with joint positions that passed a low pass, and their rates and accelerations, for positions too noisy for splines.
/// Rates and accelerations that were recorded, both, pass it as they are. Samples at the ends that depend on what was before or comes
/// after are cut off. Torques stay as they are. Allocates.
///
/// # Errors
/// [`LinearError::Option`] for a frequency out of range (a tenth of the sampling rate at most), or a record too short for it.
pub fn smoothed(record: &Record, hz: f64) -> Result<Record, LinearError> {
    record.check_uniform("a filter").map_err(SetupError::from)?;
    let z = filter(record, hz)?;
    let (n, cut) = (record.samples(), z.transient());
    if n < 3 * cut {
        return Err(too_short(hz));
    }
    Ok(through(record, &z).rows(cut..n - cut))
}

/// A record whose motion has passed a filter, ends included.
pub(super) fn through(record: &Record, z: &ZeroPhase) -> Record {
    let pass = |m: &DMatrix<f64>| {
        let mut m = m.clone();
        z.columns(&mut m);
        m
    };
    let (q, dt) = (pass(record.q()), record.dt());
    let (qd, qdd) = match (record.qd(), record.qdd()) {
        (Some(v), Some(a)) => (pass(v), pass(a)),
        _ => (slopes(&q, dt, RATE), slopes(&q, dt * dt, ACCELERATION)),
    };
    record.clone().with_motion(q, qd, qdd)
}

/// Central differences of order four: what two samples before to two behind count.
pub(super) const RATE: [f64; 5] = [1.0 / 12.0, -8.0 / 12.0, 0.0, 8.0 / 12.0, -1.0 / 12.0];
/// See [`RATE`].
pub(super) const ACCELERATION: [f64; 5] = [-1.0 / 12.0, 16.0 / 12.0, -30.0 / 12.0, 16.0 / 12.0, -1.0 / 12.0];

/// Differences of every column over `step`; the two samples at each end, where a filter has not settled, take those next to them.
pub(super) fn slopes(x: &DMatrix<f64>, step: f64, weights: [f64; 5]) -> DMatrix<f64> {
    let last = x.nrows() - 3;
    DMatrix::from_fn(x.nrows(), x.ncols(), |i, j| {
        let i = i.clamp(2, last);
        weights.iter().enumerate().map(|(k, w)| w * x[(i + k - 2, j)]).sum::<f64>() / step
    })
}
