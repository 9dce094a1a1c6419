//! One record, as every part of the doctor sees it.

use super::diagnosis::{Finding, Judgement, Topic};
use super::level::Level;
use super::noise::{Given, stated};
use super::sampling::Sampled;
use crate::modes::held;
use crate::open::Opened;
use crate::workflow::identify::{IdentifyError, LabelledRecord, Method, Settings, sigmas};
use ff_mission::mission::Sensors;
use ff_model::{Model, Params};
use ff_records::{ChannelGroup, Record};
use ident::Noise;

/// One record, and what every part asks of it.
pub(super) struct Case<'a> {
    pub(super) model: &'a Model,
    pub(super) record: &'a Record,
    pub(super) label: &'a str,
    /// By output error, at rest at the first sample, without biases; noise above zero.
    pub(super) settings: Settings,
    pub(super) sensors: Sensors,
    /// Whose noise is not that of the mission.
    pub(super) given: Given,
    /// Parameters to estimate.
    pub(super) estimated: &'a [usize],
    pub(super) level: Level,
    /// Torques and gyro as sampled.
    pub(super) torque: Sampled,
    pub(super) gyro: Sampled,
    /// What the integration has to follow at the first sample (Hz); 0 for a rigid robot.
    pub(super) fastest_hz: f64,
    /// Gains (N m/A) of the joints whose currents were read, by which they stand as torques here; none without currents.
    pub(super) gains: Vec<Option<f64>>,
    /// Whether torques may jump where a joint turns back: they are read on the motor's side.
    pub(super) jumps: bool,
}

impl<'a> Case<'a> {
    pub(super) fn new(
        opened: &'a Opened,
        labelled: &'a LabelledRecord,
        record: &'a Record,
        (s, stating): (&Settings, &Settings),
        jumps: bool,
    ) -> Result<Self, IdentifyError> {
        let (model, record) = (&opened.model, record);
        record.check_joints(&model.joint_names()).map_err(IdentifyError::Refused)?;
        let own = &labelled.record;
        let torque = Sampled::of(own, ChannelGroup::Torque, own.tau(), record.tau());
        let gyro = Sampled::of(own, ChannelGroup::Gyro, own.gyro(), record.gyro());
        let level = Level::of(record, &torque.readings, &gyro.readings, jumps);
        // A mission of perfect sensors does not say what a reading weighs; the record does.
        let or = |given: f64, measured: &[f64]| {
            let most = measured.iter().copied().fold(1e-12, f64::max);
            if given > 0.0 && given.is_finite() { given } else { most }
        };
        let noise = Noise { torque: or(s.noise.torque, &level.torque), gyro: or(s.noise.gyro, &level.gyro) };
        let settings = Settings {
            method: Some(Method::OutputError),
            noise,
            biases: false,
            initial_state: false,
            adopt: Vec::new(),
            ..s.clone()
        };
        let sensors = opened.mission.as_ref().map(|m| m.sensors.clone()).unwrap_or_default();
        let (sensors, given) = stated(sensors, stating);
        let label = &labelled.label;
        let fastest_hz = fastest(model, record);
        let (estimated, gains) = (&opened.estimated[..], Vec::new());
        Ok(Self {
            model,
            record,
            label,
            settings,
            sensors,
            given,
            estimated,
            level,
            torque,
            gyro,
            fastest_hz,
            gains,
            jumps,
        })
    }
    /// Standard deviations of torques and gyro, in the order of [`Record::responses`].
    pub(super) fn sigma(&self) -> Vec<f64> {
        sigmas(self.model, &self.settings.noise)
    }
    pub(super) fn finding(&self, topic: Topic, judgement: Judgement, text: impl Into<String>) -> Finding {
        Finding::new(self.label, topic, judgement, text)
    }
}

/// Factors by which the channels of a record are too large.
#[derive(Clone, Debug)]
pub(super) struct Scales {
    pub(super) position: Vec<f64>,
    pub(super) torque: Vec<f64>,
    pub(super) gyro: f64,
}

/// The highest frequency (Hz) of the modes at the first sample, or the rate of decay of an overdamped one as such.
fn fastest(model: &Model, record: &Record) -> f64 {
    let params = Params::nominal(model);
    let q: Vec<f64> = record.q().row(0).iter().copied().collect();
    let modes = held(model, &params, &q, &model.rest_position(&params));
    modes.iter().map(|m| m.frequency_hz * (2.0 * m.damping_ratio).max(1.0)).fold(0.0, f64::max)
}
