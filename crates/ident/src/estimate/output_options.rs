//! What output error assumes, and what it may adjust besides parameters.

use crate::estimate::ground::joint_terms::NearRest;
use crate::estimate::setup::{Noise, SetupError};
use crate::uncertain::oscillator::Oscillator;
use crate::uncertain::source::ErrorSource;
use ff_model::Model;
use ff_records::Record;

/// What the estimator assumes and what else it may adjust.
///
/// ```
/// use ident::{Noise, Options};
///
/// // Sensors with biases, and a robot that need not be at rest when the record begins.
/// let noise = Noise { torque: 0.1, gyro: 1.5e-4 };
/// let options = Options { gyro_bias: true, torque_bias: true, initial_state: true, ..Options::new(noise) };
/// assert_eq!((options.substeps, options.noise), (2, noise));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Noise that whitens the residuals.
    pub noise: Noise,
    /// Integration steps per sample; where `step_error` is given, those of the first linearisations.
    pub substeps: usize,
    /// Norm of what the steps are off by, in whitened residuals, beyond which a fit takes more of them: at its end no estimate is off by
    /// more of its standard deviations. Steps stay as they are unless given.
    pub step_error: Option<f64>,
    /// Estimate a constant bias of every gyro axis.
    pub gyro_bias: bool,
    /// Estimate a constant bias of every torque sensor.
    pub torque_bias: bool,
    /// Estimate the initial base rate and passive state instead of assuming rest.
    pub initial_state: bool,
    /// Estimate by how much the torque readings are late against the joint positions (s); negative when early.
    pub torque_delay: bool,
    /// The same for the gyro.
    pub gyro_delay: bool,
    /// Placements of joints and mounts to estimate, by name ([`ff_model::Model::kinematic_params`]: `joint3.offset`,
    /// `joint3.placement.x`, `wing.mount.rx`); all others stay where the model has them.
    pub kinematics: Vec<String>,
    /// Errors of sensors, joints and surroundings to estimate; all others are none.
    pub errors: Vec<ErrorSource>,
    /// Draws of the noise of the positions, as the fit of the joint motion lets it through: unknowns `motion.noise[k]` that are not
    /// estimated, whose columns say what that noise does to the residuals. None where the motion was not fitted.
    pub motion_noise: usize,
    /// Whether columns of draws are to be as exact as the motion is followed ([`crate::OutputError::survey`]), where that noise is loud.
    pub noise_is_loud: bool,
    /// Oscillators that the model does not have and [`ErrorSource::Oscillator`] refers to.
    pub oscillators: Vec<Oscillator>,
    /// Parameters at which the torques are predicted that deflect compliant joints, and the motion of the base that drives oscillators;
    /// those of the model unless given. Their change with the parameters that are estimated is not followed.
    pub deflected_at: Option<Vec<f64>>,
    /// Joints that give way there by so much (rad/(N m)): their links move behind the encoders while torques are predicted.
    pub compliances: Vec<(usize, f64)>,
    /// Readings next to the ends of a fitted motion, where its noise is larger than theirs, count like all others: residuals are then
    /// predictions less readings, over the noise of the sensors, everywhere.
    pub all_alike: bool,
    /// Standard deviation of the noise of each torque channel in its own unit (N m, or A of a motor current), in place of that of `noise`;
    /// none for torques that are all alike.
    pub channel_noise: Vec<f64>,
    /// For every joint, what the sign of its rate is close to rest, and whether its torque counts there; none, or `None` for a joint: the sign goes
    /// over smoothly within a hundredth of its largest rate, and everything counts.
    pub near_rest: Vec<Option<NearRest>>,
    /// Inertia of rotors and gears that the torques of the joints have in them (kg m^2, or kg), roughly: what noise of the positions is worth to the
    /// torques, by which a motion is fitted. None when empty. That of the first options counts for all others of the same motion.
    pub reflected_inertia: Vec<f64>,
}

impl Options {
    /// Given noise, two steps per sample, no nuisance unknowns, start at rest.
    pub fn new(noise: Noise) -> Self {
        Self {
            noise,
            substeps: 2,
            step_error: None,
            gyro_bias: false,
            torque_bias: false,
            initial_state: false,
            torque_delay: false,
            gyro_delay: false,
            kinematics: Vec::new(),
            errors: Vec::new(),
            motion_noise: 0,
            noise_is_loud: false,
            oscillators: Vec::new(),
            deflected_at: None,
            compliances: Vec::new(),
            all_alike: false,
            channel_noise: Vec::new(),
            near_rest: Vec::new(),
            reflected_inertia: Vec::new(),
        }
    }
    /// These options in place of those of the same record: its noise stays, what its channels are, and how well it is integrated.
    pub(crate) fn with(&self, substeps: usize, other: &Self) -> Self {
        let is_of_joints = |e: &ErrorSource| matches!(e, ErrorSource::Joint(..) | ErrorSource::DriveGain(_));
        let mut errors = other.errors.clone();
        errors.extend(self.errors.iter().filter(|e| is_of_joints(e) && !other.errors.contains(e)));
        Self {
            noise: self.noise,
            channel_noise: self.channel_noise.clone(),
            near_rest: self.near_rest.clone(),
            substeps,
            step_error: self.step_error,
            errors,
            ..other.clone()
        }
    }
    /// Channels that are what the options say: gains for currents, and noise for each where it is given.
    pub(crate) fn check_channels(&self, model: &Model, record: &Record) -> Result<(), SetupError> {
        for (channel, &value) in self.channel_noise.iter().enumerate() {
            if !(value > 0.0 && value.is_finite()) || self.channel_noise.len() != model.nj() {
                return Err(SetupError::ChannelNoise { channel, value, joints: model.nj() });
            }
        }
        let read = |j: usize| record.currents().get(j).copied().unwrap_or(false);
        let gained = |j: usize| self.errors.contains(&ErrorSource::DriveGain(j));
        match (0..model.nj()).find(|&j| read(j) != gained(j)) {
            Some(j) => Err(SetupError::Currents { joint: model.joint_names().swap_remove(j), measured: read(j) }),
            None => Ok(()),
        }
    }
}
