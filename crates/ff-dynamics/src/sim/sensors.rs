//! What sensors make of a motion: sampling, bias, white noise, quantisation. Seeded, repeatable.

use crate::reduced::sensitivity::driver::Sensitivities;
use crate::reduced::system::Response;
use crate::sim::trace::Trace;
use ff_model::Xform;
use nalgebra::{DMatrix, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Errors of one kind of channel. Zero means none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Channel {
    /// Standard deviation of the white noise per sample, in the unit of the channel.
    pub noise_std: f64,
    /// Constant bias of every axis.
    pub bias: f64,
    /// Quantisation step; readings are rounded to its multiples after noise and bias.
    pub quantum: f64,
}

impl Channel {
    /// An encoder with `bits` per turn: quantum `2 pi / 2^bits` rad.
    pub fn encoder(bits: u32) -> Self {
        Self { quantum: std::f64::consts::TAU / f64::from(bits).exp2(), ..Self::default() }
    }
    /// One standard deviation of everything random: noise and quantisation `quantum / sqrt(12)`.
    pub fn sigma(&self) -> f64 {
        self.noise_std.hypot(self.quantum / 12f64.sqrt())
    }
    fn read(&self, x: f64, rng: &mut ChaCha8Rng) -> f64 {
        let z: f64 = StandardNormal.sample(rng);
        let y = x + self.bias + self.noise_std * z;
        if self.quantum > 0.0 { (y / self.quantum).round() * self.quantum } else { y }
    }
}

/// Where an accelerometer is and how it is turned, in the base frame.
///
/// It reads the specific force at its place, in its axes; without gravity
/// `R^T (a + al x r + w x (w x r))` with the classical acceleration `a` of the base origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accelerometer {
    /// Pose of the sensor in the base frame.
    pub mount: Xform<f64>,
}

impl Accelerometer {
    /// Reading (m/s^2) at sample `i` of a reduced simulation. Does not allocate.
    ///
    /// # Panics
    /// If there is no such sample.
    pub fn read(&self, r: &Response, i: usize) -> Vector3<f64> {
        let row = |m: &DMatrix<f64>, k: usize| Vector3::new(m[(i, k)], m[(i, k + 1)], m[(i, k + 2)]);
        let (v, w, al) = (row(&r.twist, 0), row(&r.twist, 3), row(&r.accel, 3));
        let p = &self.mount.pos;
        self.mount.rot.transpose() * (row(&r.accel, 0) + w.cross(&v) + al.cross(p) + w.cross(&w.cross(p)))
    }
    /// Derivative of the reading at sample `i` along column `c` of sensitivities that hold accelerations
    /// ([`crate::Wanted::accel`]); `None` if they do not. Does not allocate.
    ///
    /// # Panics
    /// If there is no such sample or column.
    pub fn derivative(&self, r: &Response, s: &Sensitivities, i: usize, c: usize) -> Option<Vector3<f64>> {
        let accel = s.accel.as_ref()?;
        let at = |m: &DMatrix<f64>, k: usize| Vector3::new(m[(k, c)], m[(k + 1, c)], m[(k + 2, c)]);
        let (dw, da, dal) = (at(&s.gyro, 3 * i), at(accel, 6 * i), at(accel, 6 * i + 3));
        let w = Vector3::new(r.twist[(i, 3)], r.twist[(i, 4)], r.twist[(i, 5)]);
        let p = &self.mount.pos;
        let turning = dw.cross(&w.cross(p)) + w.cross(&dw.cross(p));
        Some(self.mount.rot.transpose() * (da + dal.cross(p) + turning))
    }
}

/// The sensors of a robot: joint torque (after the gear), joint encoder, base gyro.
///
/// ```
/// use ff_dynamics::SensorSuite;
/// use ff_dynamics::sim::Channel;
///
/// let gyro = Channel { noise_std: 1.5e-4, bias: 2e-5, quantum: 1e-5 };
/// let torque = Channel { noise_std: 0.1, ..Channel::default() };
/// let sensors = SensorSuite { torque, encoder: Channel::encoder(20), gyro };
/// assert!((sensors.encoder.quantum * f64::from(1 << 20) - std::f64::consts::TAU).abs() < 1e-12);
/// assert!(sensors.gyro.sigma() > 1.5e-4); // noise and quantisation
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorSuite {
    /// Joint torque (N m).
    pub torque: Channel,
    /// Joint position (rad).
    pub encoder: Channel,
    /// Base rate (rad/s).
    pub gyro: Channel,
}

/// Sensor readings, `N x channels`.
///
/// ```
/// use ff_dynamics::sim::Channel;
/// use ff_dynamics::{Drive, Readings, SensorSuite, SimOptions, State, measure, simulate};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
///
/// let options = SimOptions { duration_s: 4.0, step_s: 0.01, sample_s: 0.01 };
/// let trace = simulate(&robot, &Params::nominal(&robot), &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// let torque = Channel { noise_std: 0.1, ..Channel::default() };
/// let sensors = SensorSuite { torque, encoder: Channel::encoder(20), gyro: Channel::default() };
/// let read: Readings = measure(&trace, &sensors, 7);
/// let noise = (&read.tau - &trace.tau).norm() / (read.tau.len() as f64).sqrt();
/// assert!((noise - 0.1).abs() < 0.005 && read.gyro == trace.gyro());
/// # Ok::<(), ff_dynamics::SimError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    /// Time between samples (s).
    pub dt: f64,
    /// Joint positions (rad), `N x n`.
    pub q: DMatrix<f64>,
    /// Joint torques (N m), `N x n`.
    pub tau: DMatrix<f64>,
    /// Base rates (rad/s), `N x 3`.
    pub gyro: DMatrix<f64>,
}

/// Reads the sensors at every sample of `trace`. Equal seeds give equal readings.
///
/// Each of the three kinds of channel has its own random stream, so switching one off leaves the others'
/// noise unchanged. Allocates the result.
pub fn measure(trace: &Trace, sensors: &SensorSuite, seed: u64) -> Readings {
    let read = |m: &DMatrix<f64>, c: &Channel, stream: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        m.map(|x| c.read(x, &mut rng))
    };
    Readings {
        dt: trace.dt,
        q: read(&trace.q, &sensors.encoder, 1),
        tau: read(&trace.tau, &sensors.torque, 2),
        gyro: read(&trace.gyro(), &sensors.gyro, 3),
    }
}
