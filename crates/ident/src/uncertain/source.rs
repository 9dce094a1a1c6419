//! What may be wrong beside the parameters: errors of sensors, of joints and of what pushes the base.

use crate::estimate::ground::joint_terms::JointTerm;
use crate::uncertain::oscillator::OscillatorColumn;

/// Coordinate axes.
const AXES: [&str; 3] = ["x", "y", "z"];

/// An error of the world or of its sensors, of a size that can be estimated; none has size zero.
///
/// With the predicted torque `tau_j` and base rate `w`, time `t` since the middle of the record, and rates `qd_j`, the sensors read
///
/// ```text
/// tau_j    ((1 + gain + gain_j) tau_j(t - skew t - lag_j) + drift_j t + sum_k walk_jk ramp_k + f_j(qd_j, qdd_j, tau_j)) / k_j
/// gyro     diag(1 + scale + scale_i) exp([rotation x]) w(t - skew t) + drift t + sum_k walk_k ramp_k
/// ```
///
/// with the terms `f_j` of the joint ([`JointTerm`]: friction, reflected inertia) and the gain `k_j` of its drive where the channel is the
/// current of its motor ([`ErrorSource::DriveGain`]), else one.
///
/// and the robot moves by `q_j - compliance_j tau_j + lag_j qd_j` where the encoder reads `q_j` (with the lag of the encoder), under a constant wrench on its base. Placements
/// of joints and mounts (encoder offsets, lengths of links, mounts) are [`ff_model::Model::kinematic_params`], biases and delays
/// options of [`crate::OutputError`], masses and stiffnesses parameters of the model.
///
/// ```
/// use ident::uncertain::ErrorSource;
///
/// let source = ErrorSource::TorqueGain(Some(1));
/// assert_eq!(source.name(&["shoulder".into(), "elbow".into()]), "torque.gain.elbow");
/// assert_eq!((source.unit(), ErrorSource::GyroRotation(2).unit()), ("1", "rad"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ErrorSource {
    /// Relative gain of all torque sensors, or of that of one joint.
    TorqueGain(Option<usize>),
    /// Slope of the bias of a torque sensor (N m/s).
    TorqueDrift(usize),
    /// Change of the bias of a torque sensor during one part of the record (N m).
    TorqueWalk(usize, WalkPart),
    /// A term of the torque of a joint beside that of the bodies, which a sensor on the motor's side of the gear reads: friction, reflected
    /// inertia. Linear in its coefficient, since the motion of the joint is known.
    Joint(usize, JointTerm),
    /// Torque of a joint by the current of its motor (N m/A), which its channel reads in place of the torque. The one error that is none at no
    /// size: a record of currents needs it, and it is never zero.
    DriveGain(usize),
    /// How slowly the clock of the torques runs against that of the encoders, relative.
    TorqueSkew,
    /// How late the torque sensor of a joint is beside the others (s): its filter, or a bus that asks one after the other.
    TorqueLag(usize),
    /// Relative scale of the gyro, or of one of its axes.
    GyroScale(Option<usize>),
    /// Rotation vector from base axes to those of the gyro, one component (rad).
    GyroRotation(usize),
    /// Slope of the bias of a gyro axis (rad/s^2).
    GyroDrift(usize),
    /// Change of the bias of a gyro axis during one part of the record (rad/s).
    GyroWalk(usize, WalkPart),
    /// How slowly the clock of the gyro runs, relative.
    GyroSkew,
    /// How fast the clock of the whole record runs, relative. By a time that runs fast by `e` joints move slower by `e` than they did, so that a model
    /// in it predicts `1 / (1 + e)` of what the gyro read and `1 / (1 + e)^2` of the torques, while springs and dampers take values for which all else is the
    /// same: nothing but sensors brings a unit of time of its own.
    ClockRate,
    /// Compliance between an encoder on the motor's side and the link (rad/(N m)).
    Compliance(usize),
    /// How late the encoder of a joint is (s), to first order: beside the others, on a bus that asks one after the other.
    EncoderLag(usize),
    /// Constant force on the base at its origin along one of its axes (N).
    Force(usize),
    /// Constant moment on the base about one of its axes (N m).
    Moment(usize),
    /// Of one of [`crate::Options::oscillators`], by index.
    Oscillator(usize, OscillatorColumn),
}

/// A part of a record during which a bias goes over from one value to another, linearly in time: before it nothing of the change is
/// there, behind it all.
///
/// A bias that walks at random, by a standard deviation of `s` in a unit of time, changes during parts of length T by independent amounts of
/// standard deviation `s sqrt(T)`; between the ends of a part it is off the straight line by `s sqrt(T / 6)` (root mean square: the
/// variance `s^2 t (T - t) / T` of a Brownian bridge, averaged).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct WalkPart {
    /// Which part, from 0.
    pub index: u32,
    /// Length of every part (ms).
    pub every_ms: u32,
}

impl WalkPart {
    /// How much of the change is there `t` seconds after the first sample.
    pub fn ramp(self, t: f64) -> f64 {
        (1e3 * t / f64::from(self.every_ms.max(1)) - f64::from(self.index)).clamp(0.0, 1.0)
    }
}

/// What an error acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ActsOn {
    /// The readings of torques (0) or of the gyro (1).
    Readings(usize),
    /// Those of both.
    AllReadings,
    /// The motion.
    Motion,
}

impl ActsOn {
    /// Whether it acts on the readings of this group.
    pub(crate) fn readings(self, group: usize) -> bool {
        self == Self::AllReadings || self == Self::Readings(group)
    }
}

impl ErrorSource {
    /// Every error there is, for so many joints, but oscillators and walks of biases, of which there are as many as one likes.
    pub fn all(joints: usize) -> Vec<Self> {
        let each = |of: fn(usize) -> Self, n: usize| (0..n).map(of);
        let mut out = vec![Self::TorqueGain(None), Self::GyroScale(None), Self::TorqueSkew, Self::GyroSkew];
        out.extend(each(|j| Self::TorqueGain(Some(j)), joints));
        out.extend(each(Self::TorqueDrift, joints));
        out.extend(each(|j| Self::Joint(j, JointTerm::Viscous), joints));
        out.extend(each(|j| Self::Joint(j, JointTerm::Coulomb), joints));
        out.extend(each(Self::TorqueLag, joints));
        out.extend(each(Self::Compliance, joints));
        out.extend(each(Self::EncoderLag, joints));
        out.extend(each(|i| Self::GyroScale(Some(i)), 3));
        out.extend(each(Self::GyroRotation, 3));
        out.extend(each(Self::GyroDrift, 3));
        out.extend(each(Self::Force, 3));
        out.extend(each(Self::Moment, 3));
        out.push(Self::ClockRate);
        out
    }
    /// Its name, `torque.gain.elbow`, given those of the joints.
    ///
    /// # Panics
    /// If the joint does not exist.
    pub fn name(&self, joints: &[String]) -> String {
        match *self {
            Self::TorqueGain(None) => "torque.gain".into(),
            Self::TorqueGain(Some(j)) => format!("torque.gain.{}", joints[j]),
            Self::TorqueDrift(j) => format!("torque.drift.{}", joints[j]),
            Self::TorqueWalk(j, part) => format!("torque.walk.{}[{}]", joints[j], part.index),
            Self::Joint(j, term) => term.name(&joints[j]),
            Self::DriveGain(j) => format!("drive.{}.gain", joints[j]),
            Self::TorqueSkew => "torque.skew".into(),
            Self::TorqueLag(j) => format!("torque.lag.{}", joints[j]),
            Self::GyroScale(None) => "gyro.scale".into(),
            Self::GyroScale(Some(i)) => format!("gyro.scale.{}", AXES[i]),
            Self::GyroRotation(i) => format!("gyro.rotation.{}", AXES[i]),
            Self::GyroDrift(i) => format!("gyro.drift.{}", AXES[i]),
            Self::GyroWalk(i, part) => format!("gyro.walk.{}[{}]", AXES[i], part.index),
            Self::GyroSkew => "gyro.skew".into(),
            Self::ClockRate => "clock.rate".into(),
            Self::Compliance(j) => format!("compliance.{}", joints[j]),
            Self::EncoderLag(j) => format!("encoder.lag.{}", joints[j]),
            Self::Force(i) => format!("wrench.f{}", AXES[i]),
            Self::Moment(i) => format!("wrench.n{}", AXES[i]),
            Self::Oscillator(k, column) => format!("oscillator[{k}].{}", column.name()),
        }
    }
    /// The term or the gain of the drive of a joint that is called so, given the names of the joints: `friction.elbow.viscous`,
    /// `drive.elbow.inertia`, `drive.elbow.gain`.
    pub fn of_joint(name: &str, joints: &[String]) -> Option<Self> {
        joints.iter().enumerate().find_map(|(j, joint)| {
            if *name == Self::DriveGain(j).name(joints) {
                return Some(Self::DriveGain(j));
            }
            JointTerm::of_name(name, joint).map(|term| Self::Joint(j, term))
        })
    }
    /// Its SI unit; of turning joints, for those of a joint.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::TorqueGain(_) | Self::GyroScale(_) | Self::TorqueSkew | Self::GyroSkew | Self::ClockRate => "1",
            Self::TorqueDrift(_) => "N m/s",
            Self::Joint(_, term) => term.unit(false),
            Self::DriveGain(_) => "N m/A",
            Self::Moment(_) | Self::TorqueWalk(..) => "N m",
            Self::GyroRotation(_) => "rad",
            Self::GyroDrift(_) => "rad/s^2",
            Self::GyroWalk(..) => "rad/s",
            Self::Compliance(_) => "rad/(N m)",
            Self::TorqueLag(_) | Self::EncoderLag(_) => "s",
            Self::Force(_) => "N",
            Self::Oscillator(_, column) => column.unit(),
        }
    }
    /// Whether it belongs to the robot and is the same in all its records; drifts and walks, clocks, wrenches and oscillations belong to one.
    pub fn is_of_robot(&self) -> bool {
        match self {
            Self::TorqueGain(_)
            | Self::TorqueLag(_)
            | Self::Joint(..)
            | Self::DriveGain(_)
            | Self::GyroScale(_)
            | Self::GyroRotation(_)
            | Self::Compliance(_)
            | Self::EncoderLag(_) => true,
            Self::TorqueDrift(_)
            | Self::TorqueWalk(..)
            | Self::TorqueSkew
            | Self::GyroDrift(_)
            | Self::GyroWalk(..)
            | Self::GyroSkew
            | Self::ClockRate
            | Self::Force(_)
            | Self::Moment(_)
            | Self::Oscillator(..) => false,
        }
    }
    /// A size that would be relevant, with sensors of this noise (N m, rad/s) and a record of so many seconds.
    pub fn size(&self, torque: f64, gyro: f64, seconds: f64) -> f64 {
        match self {
            Self::TorqueGain(_) | Self::GyroScale(_) | Self::GyroRotation(_) | Self::DriveGain(_) => 1e-2,
            Self::TorqueSkew | Self::GyroSkew | Self::ClockRate => 1e-3,
            // Steps of a fit are held to a few sizes: a sample of a slow bus, and what stands out of one reading by the end.
            Self::TorqueLag(_) | Self::EncoderLag(_) => 1e-2,
            Self::TorqueDrift(_) => 10.0 * torque / seconds,
            Self::GyroDrift(_) => 10.0 * gyro / seconds,
            Self::Joint(_, JointTerm::Load) => 1e-2,
            Self::Joint(..) | Self::TorqueWalk(..) | Self::Moment(_) | Self::Force(_) => torque,
            Self::GyroWalk(..) => gyro,
            Self::Compliance(_) => 1e-4,
            Self::Oscillator(_, OscillatorColumn::Inertia(_)) => 1.0,
            Self::Oscillator(..) => 1e-2,
        }
    }
    /// Whether a robot of so many joints, with so many oscillators, has it.
    pub(crate) fn exists(&self, joints: usize, oscillators: usize) -> bool {
        match *self {
            Self::TorqueGain(None) | Self::GyroScale(None) | Self::TorqueSkew | Self::GyroSkew | Self::ClockRate => {
                true
            }
            Self::TorqueGain(Some(j))
            | Self::TorqueDrift(j)
            | Self::TorqueWalk(j, _)
            | Self::TorqueLag(j)
            | Self::Joint(j, _)
            | Self::DriveGain(j)
            | Self::Compliance(j)
            | Self::EncoderLag(j) => j < joints,
            Self::GyroScale(Some(i))
            | Self::GyroRotation(i)
            | Self::GyroDrift(i)
            | Self::GyroWalk(i, _)
            | Self::Force(i)
            | Self::Moment(i) => i < 3,
            Self::Oscillator(k, column) => k < oscillators && column.exists(),
        }
    }
    /// Whether it adds to the readings of a group whatever was predicted.
    pub(crate) fn is_added(&self, group: usize) -> bool {
        match group {
            0 => matches!(self, Self::TorqueDrift(_) | Self::TorqueWalk(..) | Self::Joint(..)),
            _ => matches!(self, Self::GyroDrift(_) | Self::GyroWalk(..)),
        }
    }
    pub(crate) fn acts_on(&self) -> ActsOn {
        match self {
            Self::TorqueGain(_)
            | Self::TorqueDrift(_)
            | Self::TorqueWalk(..)
            | Self::Joint(..)
            | Self::DriveGain(_)
            | Self::TorqueSkew
            | Self::TorqueLag(_) => ActsOn::Readings(0),
            Self::GyroScale(_) | Self::GyroRotation(_) | Self::GyroDrift(_) | Self::GyroWalk(..) | Self::GyroSkew => {
                ActsOn::Readings(1)
            }
            Self::ClockRate => ActsOn::AllReadings,
            Self::Compliance(_) | Self::EncoderLag(_) | Self::Force(_) | Self::Moment(_) | Self::Oscillator(..) => {
                ActsOn::Motion
            }
        }
    }
}
