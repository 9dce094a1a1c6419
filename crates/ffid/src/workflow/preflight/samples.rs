//! The record that a trajectory will give.

use super::error::PreflightError;
use super::question::{Question, Sensing};
use ff_dynamics::analysis::advise_step;
use ff_dynamics::{Mode, Trace};
use ff_records::{Record, RecordBuilder};
use ident::Noise;
use nalgebra::DMatrix;

/// Error of the simulation, relative to the amplitude of every mode.
const SIMULATION_ERROR: f64 = 1e-6;
/// Most numbers of the Jacobian (rows times columns): beyond it only every k-th sample is taken, and counts k times.
pub(super) const MOST_NUMBERS: usize = 40_000_000;

/// The longest integration step (s) that resolves modes and sampling, a whole fraction of the sample time.
pub fn step(modes: &[Mode], duration: f64, sample: f64) -> f64 {
    let advised = advise_step(modes, duration, SIMULATION_ERROR).map_or(sample, |a| a.step_s);
    let parts = (sample / advised).ceil().clamp(1.0, 1000.0);
    sample / parts
}

/// The record of a trace as perfect sensors read it, every `every`-th sample.
pub(crate) fn record(q: &Question<'_>, t: &Trace, every: usize) -> Result<Record, PreflightError> {
    let rows: Vec<usize> = (0..t.len()).step_by(every).collect();
    let thin = |m: &DMatrix<f64>| m.select_rows(&rows);
    let builder = RecordBuilder::new(q.model.joint_names()).uniform(0.0, 1.0 / (t.dt * every as f64));
    let builder = builder.q(thin(&t.q)).qd(thin(&t.qd)).qdd(thin(&t.qdd)).tau(thin(&t.tau)).gyro(thin(&t.gyro()));
    // A joint that holds, and a robot that turns faster than usual, are no faults of a simulated record.
    let builder = builder.allow("Data::Stuck").allow("Data::LooksLikeDegrees");
    Ok(builder.build()?.0)
}

pub(crate) fn noise(s: &Sensing) -> Noise {
    Noise { torque: s.torque_nm, gyro: s.gyro_rad_per_s }
}
