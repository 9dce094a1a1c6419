//! What the sensors of a mission read on a motion: the record that `ffid simulate` writes.

use crate::modes::held;
use crate::workflow::identify::joint_torques;
use crate::workflow::preflight::{start_pose, step};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::sim::Channel;
use ff_dynamics::sim::inputs::ExternalInput;
use ff_dynamics::sim::simulate_with;
use ff_dynamics::{Drive, Readings, SensorSuite, SimError, SimOptions, State, Trace, measure};
use ff_mission::mission::{self, Sensors};
use ff_model::{BaseKind, Model, Params};
use ff_records::file::{CsvWriter, joints_of};
use nalgebra::DMatrix;
use std::io;

/// The sensors of a mission as `ff-dynamics` reads them.
pub fn suite(s: &Sensors) -> SensorSuite {
    let channel = |noise_std, bias, quantum| Channel { noise_std, bias, quantum };
    let quantum = s.encoder.bits.map_or(0.0, |b| Channel::encoder(b).quantum);
    SensorSuite {
        torque: channel(s.torque.noise_std_nm, s.torque.bias_nm, s.torque.lsb_nm),
        gyro: channel(s.gyro.noise_std_rad_per_s, s.gyro.bias_rad_per_s, s.gyro.lsb_rad_per_s),
        encoder: channel(s.encoder.noise_std_rad, s.encoder.bias_rad, quantum),
    }
}

/// Simulates a motion from rest, springs relaxed, and `hold_s` longer, under external inputs, sampled at `rate_hz`; the step is
/// the one that the modes at the start pose need. Allocates.
///
/// # Errors
/// [`SimError`].
pub fn fly(
    model: &Model,
    params: &Params<f64>,
    motion: &dyn JointMotion,
    inputs: &[&dyn ExternalInput],
    rate_hz: f64,
    hold_s: f64,
) -> Result<Trace, SimError> {
    fly_from(model, params, &at_rest(model, params, motion), motion, inputs, rate_hz, hold_s)
}

/// [`fly`] from another state than rest: its joints are those of the motion. Allocates.
///
/// # Errors
/// [`SimError`].
pub fn fly_from(
    model: &Model,
    params: &Params<f64>,
    from: &State<f64>,
    motion: &dyn JointMotion,
    inputs: &[&dyn ExternalInput],
    rate_hz: f64,
    hold_s: f64,
) -> Result<Trace, SimError> {
    let start = start_pose(motion);
    let rest = model.rest_position(params);
    let duration_s = motion.duration() + hold_s;
    let sample_s = 1.0 / rate_hz;
    let found = held(model, params, &start, &rest);
    let options = SimOptions { duration_s, step_s: step(&found, duration_s, sample_s), sample_s };
    simulate_with(model, params, from, &Drive::Prescribed(motion), inputs, &options)
}

/// Simulates a motion from where it begins, base at rest, springs relaxed. Allocates.
///
/// # Errors
/// [`SimError`].
pub fn from_rest(
    model: &Model,
    params: &Params<f64>,
    motion: &dyn JointMotion,
    options: &SimOptions,
) -> Result<Trace, SimError> {
    simulate_with(model, params, &at_rest(model, params, motion), &Drive::Prescribed(motion), &[], options)
}

/// Where a motion begins, base at rest, springs relaxed. Allocates.
pub fn at_rest(model: &Model, params: &Params<f64>, motion: &dyn JointMotion) -> State<f64> {
    let mut from = State::zero(model);
    from.q.copy_from_slice(&start_pose(motion));
    from.eta.copy_from_slice(&model.rest_position(params));
    from
}

/// What torque channels on the motor's side read on a simulated motion.
#[derive(Clone, Debug)]
pub struct MotorSide {
    /// Readings (N m or N, A of currents; samples x joints).
    pub tau: DMatrix<f64>,
    /// Joints whose channel is a current.
    pub currents: Vec<bool>,
}

impl MotorSide {
    /// With friction, reflected inertia and gains of these drives; the torques of the bodies where there are none. Allocates.
    pub fn of(model: &Model, trace: &Trace, drives: &[mission::Drive]) -> Self {
        let (joints, near_rest) = joint_torques(drives, &model.joint_names());
        let tau = DMatrix::from_fn(trace.tau.nrows(), trace.tau.ncols(), |i, j| {
            joints.reading(j, (trace.qd[(i, j)], trace.qdd[(i, j)]), trace.tau[(i, j)], near_rest[j])
        });
        Self { tau, currents: joints.gains.iter().map(Option::is_some).collect() }
    }
    /// With noise, bias and quantisation of torque sensors, those of current sensors for currents.
    fn measured(&self, trace: &Trace, sensors: &SensorSuite, current: Channel, seed: u64) -> Readings {
        let trace = Trace { tau: self.tau.clone(), ..trace.clone() };
        let mut out = measure(&trace, sensors, seed);
        if self.currents.contains(&true) {
            let currents = measure(&trace, &SensorSuite { torque: current, ..*sensors }, seed).tau;
            for j in (0..self.currents.len()).filter(|&j| self.currents[j]) {
                out.tau.set_column(j, &currents.column(j));
            }
        }
        out
    }
}

/// The current sensors of a mission.
pub fn current_channel(s: &Sensors) -> Channel {
    Channel { noise_std: s.current.noise_std_a, bias: s.current.bias_a, quantum: s.current.lsb_a }
}

/// A record as CSV: what the sensors read with this seed, or, without one, the exact motion with joint rates and
/// accelerations. Torque channels are those of `motors`; noise is that of the sensors of torques, and of currents. Gyro and attitude are those of a
/// floating base. Allocates.
///
/// # Errors
/// [`io::ErrorKind::InvalidData`] for a number that is not finite.
pub fn csv(
    model: &Model,
    trace: &Trace,
    motors: &MotorSide,
    rate_hz: f64,
    noise: Option<(&SensorSuite, Channel, u64)>,
) -> io::Result<Vec<u8>> {
    let joints = joints_of(model);
    // A quotient, so that the third sample at 100 Hz is at 0.02 s, and not a bit beside it.
    let time: Vec<f64> = (0..trace.len()).map(|i| i as f64 / rate_hz).collect();
    let mut out = Vec::new();
    // On a base that is bolted down gyro and attitude would be constant, which the reader takes for broken sensors.
    let floats = model.base_kind() == BaseKind::Floating;
    match noise {
        Some((sensors, current, seed)) => {
            let Readings { q, tau, gyro, .. } = motors.measured(trace, sensors, current, seed);
            let w = CsvWriter {
                currents: &motors.currents,
                joints: &joints,
                time: &time,
                q: &q,
                dq: None,
                ddq: None,
                tau: &tau,
                gyro: floats.then_some(&gyro),
                acc: None,
                att: None,
            };
            w.write(&mut out)?;
        }
        None => {
            let gyro = trace.gyro();
            let w = CsvWriter {
                currents: &motors.currents,
                joints: &joints,
                time: &time,
                q: &trace.q,
                dq: Some(&trace.qd),
                ddq: Some(&trace.qdd),
                tau: &motors.tau,
                gyro: floats.then_some(&gyro),
                acc: None,
                att: floats.then_some(&trace.att),
            };
            w.write(&mut out)?;
        }
    }
    Ok(out)
}
