//! `[sensors]`, `[estimate]`, `[reproduce]`: the sections that do not change the model.

use super::declared::{Holds, Key, key, must, words};
use super::reader;
use super::reader::{Table, error};
use ff_model::Model;
use ff_model::diagnostics::{Limit, clip, list, nearest};
use serde::Serialize;

/// Section `[sensors]`; without it, perfect sensors at 100 Hz.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensors {
    /// `rate_hz`: sample rate of all sensors (Hz); 100 unless given.
    pub rate_hz: f64,
    /// `[sensors.torque]`: joint torque sensors.
    pub torque: Torque,
    /// `[sensors.current]`: currents of motors, of joints whose torque is not measured.
    pub current: Current,
    /// `[sensors.gyro]`: base gyro.
    pub gyro: Gyro,
    /// `[sensors.encoder]`: joint encoders.
    pub encoder: Encoder,
}

/// Section `[sensors.torque]`; all keys default to zero.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Torque {
    /// `noise_std_nm`: standard deviation of white noise (N m).
    pub noise_std_nm: f64,
    /// `bias_nm`: constant offset (N m).
    pub bias_nm: f64,
    /// `lsb_nm`: quantisation step (N m); 0 for none.
    pub lsb_nm: f64,
    /// `gain_relative_std`: standard deviation of the gain of each sensor; exact unless given.
    pub gain_relative_std: Option<f64>,
    /// `gain_common_relative_std`: of the gain of all of them together; exact unless given.
    pub gain_common_relative_std: Option<f64>,
    /// `bias_walk_nm_per_sqrt_s`: standard deviation of what the bias of each sensor has walked after a second, growing with the root of
    /// the time (N m/sqrt(s)); constant unless given.
    pub bias_walk_nm_per_sqrt_s: Option<f64>,
}

/// Section `[sensors.current]`; all keys default to zero.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Current {
    /// `noise_std_a`: standard deviation of white noise (A).
    pub noise_std_a: f64,
    /// `bias_a`: constant offset (A).
    pub bias_a: f64,
    /// `lsb_a`: quantisation step (A); 0 for none.
    pub lsb_a: f64,
}

/// Section `[sensors.gyro]`; all keys default to zero.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Gyro {
    /// `noise_std_rad_per_s`: standard deviation of white noise (rad/s).
    pub noise_std_rad_per_s: f64,
    /// `bias_rad_per_s`: constant offset (rad/s).
    pub bias_rad_per_s: f64,
    /// `lsb_rad_per_s`: quantisation step (rad/s); 0 for none.
    pub lsb_rad_per_s: f64,
    /// `scale_relative_std`: standard deviation of the scale of each axis; exact unless given.
    pub scale_relative_std: Option<f64>,
    /// `misalignment_std_rad`: of its rotation against the base, about every axis (rad); exact unless given.
    pub misalignment_std_rad: Option<f64>,
    /// `bias_walk_rad_per_s_per_sqrt_s`: standard deviation of what the bias of each axis has walked after a second, growing with the root of
    /// the time (rad/s/sqrt(s)), known as rate random walk; constant unless given.
    pub bias_walk_rad_per_s_per_sqrt_s: Option<f64>,
}

/// Section `[sensors.encoder]`; numbers default to zero.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Encoder {
    /// `noise_std_rad`: standard deviation of white noise (rad).
    pub noise_std_rad: f64,
    /// `bias_rad`: constant offset (rad).
    pub bias_rad: f64,
    /// `bits`: steps per turn are `2^bits`, 1 to 52; no quantisation unless given.
    pub bits: Option<u32>,
    /// `offset_std_rad`: standard deviation of the zero of each joint (rad); exact unless given.
    pub offset_std_rad: Option<f64>,
}

/// Keys of `[sensors]`.
pub(crate) const SENSORS: &[Key] = &[
    key("rate_hz", Holds::Positive, "sample rate of all sensors (Hz)").or(100.0),
    key("torque", Holds::Table(TORQUE), "joint torque sensors"),
    key("current", Holds::Table(CURRENT), "currents of motors, of joints whose torque is not measured"),
    key("gyro", Holds::Table(GYRO), "base gyro"),
    key("encoder", Holds::Table(ENCODER), "joint encoders"),
];

const TORQUE: &[Key] = &[
    key("noise_std_nm", Holds::NotNegative, "standard deviation of white noise (N m)").or(0.0),
    key("bias_nm", Holds::Number, "constant offset (N m)").or(0.0),
    key("lsb_nm", Holds::NotNegative, "quantisation step (N m); 0 for none").or(0.0),
    key("gain_relative_std", Holds::Positive, "standard deviation of the gain of each sensor; exact unless given"),
    key("gain_common_relative_std", Holds::Positive, "of the gain of all of them together; exact unless given"),
    key(
        "bias_walk_nm_per_sqrt_s",
        Holds::Positive,
        "random walk of the bias of each sensor: standard deviation after a second (N m/sqrt(s)); constant unless given",
    ),
];

const CURRENT: &[Key] = &[
    key("noise_std_a", Holds::NotNegative, "standard deviation of white noise (A)").or(0.0),
    key("bias_a", Holds::Number, "constant offset (A)").or(0.0),
    key("lsb_a", Holds::NotNegative, "quantisation step (A); 0 for none").or(0.0),
];

const GYRO: &[Key] = &[
    key("noise_std_rad_per_s", Holds::NotNegative, "standard deviation of white noise (rad/s)").or(0.0),
    key("bias_rad_per_s", Holds::Number, "constant offset (rad/s)").or(0.0),
    key("lsb_rad_per_s", Holds::NotNegative, "quantisation step (rad/s); 0 for none").or(0.0),
    key("scale_relative_std", Holds::Positive, "standard deviation of the scale of each axis; exact unless given"),
    key("misalignment_std_rad", Holds::Positive, "of its rotation about every axis (rad); exact unless given"),
    key(
        "bias_walk_rad_per_s_per_sqrt_s",
        Holds::Positive,
        "random walk of the bias of each axis: standard deviation after a second (rad/s/sqrt(s)); constant unless given",
    ),
];

// Beyond 52 bits a step is below the resolution of the numbers themselves.
const BITS: Holds = Holds::WholeWithin { from: 1, to: 52, unit: " bits" };
const ENCODER: &[Key] = &[
    key("noise_std_rad", Holds::NotNegative, "standard deviation of white noise (rad)").or(0.0),
    key("bias_rad", Holds::Number, "constant offset (rad)").or(0.0),
    key("bits", BITS, "steps per turn are 2^bits, 1 to 52; no quantisation unless given"),
    key("offset_std_rad", Holds::Positive, "standard deviation of the zero of each joint (rad); exact unless given"),
];

impl Default for Sensors {
    fn default() -> Self {
        reader::absent(SENSORS, Self::read)
    }
}

impl Sensors {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let mut s = Self {
            rate_hz: t.number("rate_hz").unwrap_or_default(),
            torque: Torque::default(),
            current: Current::default(),
            gyro: Gyro::default(),
            encoder: Encoder::default(),
        };
        if let Some(t) = t.table("torque") {
            s.torque.noise_std_nm = t.number("noise_std_nm").unwrap_or_default();
            s.torque.bias_nm = t.number("bias_nm").unwrap_or_default();
            s.torque.lsb_nm = t.number("lsb_nm").unwrap_or_default();
            s.torque.gain_relative_std = t.number("gain_relative_std");
            s.torque.gain_common_relative_std = t.number("gain_common_relative_std");
            s.torque.bias_walk_nm_per_sqrt_s = t.number("bias_walk_nm_per_sqrt_s");
            t.finish();
        }
        if let Some(t) = t.table("current") {
            s.current.noise_std_a = t.number("noise_std_a").unwrap_or_default();
            s.current.bias_a = t.number("bias_a").unwrap_or_default();
            s.current.lsb_a = t.number("lsb_a").unwrap_or_default();
            t.finish();
        }
        if let Some(t) = t.table("gyro") {
            s.gyro.noise_std_rad_per_s = t.number("noise_std_rad_per_s").unwrap_or_default();
            s.gyro.bias_rad_per_s = t.number("bias_rad_per_s").unwrap_or_default();
            s.gyro.lsb_rad_per_s = t.number("lsb_rad_per_s").unwrap_or_default();
            s.gyro.scale_relative_std = t.number("scale_relative_std");
            s.gyro.misalignment_std_rad = t.number("misalignment_std_rad");
            s.gyro.bias_walk_rad_per_s_per_sqrt_s = t.number("bias_walk_rad_per_s_per_sqrt_s");
            t.finish();
        }
        if let Some(t) = t.table("encoder") {
            s.encoder.noise_std_rad = t.number("noise_std_rad").unwrap_or_default();
            s.encoder.bias_rad = t.number("bias_rad").unwrap_or_default();
            s.encoder.bits = t.whole("bits").and_then(|b| u32::try_from(b).ok());
            s.encoder.offset_std_rad = t.number("offset_std_rad");
            t.finish();
        }
        t.finish();
        s
    }
}

/// How a record of a robot that floats is predicted: key `method` of `[estimate]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EstimateMethod {
    /// Rigid robot, the base acceleration eliminated: linear in the parameters. Torques alone are explained.
    Rda,
    /// Base and appendages are simulated: torques and gyro are explained.
    OutputError,
}

const METHODS: [(&str, EstimateMethod); 2] =
    [("rda", EstimateMethod::Rda), ("output_error", EstimateMethod::OutputError)];
const METHOD_WORDS: [&str; 2] = words(&METHODS);

/// Section `[estimate]`: what is to be identified, and from which start.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Estimate {
    /// `parameters`: names or patterns with `*`, such as `base.*` or `panel_left.k[*]`; every pattern must
    /// match a parameter. Nothing unless given.
    pub parameters: Vec<String>,
    /// `start_offset`: relative offset of the start values from nominal, such as 0.25; above -1, default 0.
    pub start_offset: f64,
    /// `prior_relative_std`: relative standard deviation of a prior on the nominal values; no prior unless
    /// given.
    pub prior_relative_std: Option<f64>,
    /// `method`: `"rda"` or `"output_error"`; by the model unless given (`rda` where nothing is passive).
    pub method: Option<EstimateMethod>,
}

/// Keys of `[estimate]`.
pub(crate) const ESTIMATE: &[Key] = &[
    key("parameters", Holds::Texts, "names or patterns with *, such as base.* or panel_left.k[*]"),
    key("start_offset", Holds::Offset, "relative offset of the start, for studies; above -1").or(0.0),
    key("prior_relative_std", Holds::Positive, "relative standard deviation of a prior on the nominal values"),
    key("method", Holds::OneOf(&METHOD_WORDS), "how a record is predicted; by the model unless given"),
];

impl Estimate {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let out = Self {
            parameters: t.strings("parameters").unwrap_or_default(),
            start_offset: t.number("start_offset").unwrap_or_default(),
            prior_relative_std: t.number("prior_relative_std"),
            method: t.string("method").and_then(|word| {
                let found = METHODS.iter().find(|(name, _)| *name == word).map(|(_, method)| *method);
                if found.is_none() {
                    let what = format!("unknown method '{}'; known: {}", clip(&word), METHOD_WORDS.join(", "));
                    t.fail("method", error("Config::BadChoice", what).hint("use method = \"output_error\""));
                }
                found
            }),
        };
        t.finish();
        out
    }
}

/// Section `[reproduce]`: the procedure of the paper, used by `cargo xtask reproduce`.
///
/// To add a key: one field here, one line in `REPRODUCE`, one in `read`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Reproduce {
    /// `seed`: seed of every random number; 0 unless given.
    pub seed: u64,
    /// `trajectory_seeds`: seeds of the excitation trajectories, one trajectory each.
    pub trajectory_seeds: Vec<u64>,
    /// `hold_rad`: joint positions held while the modes ring, one per joint.
    pub hold_rad: Vec<f64>,
    /// `manoeuvre_joints`: joints that move to make them ring.
    pub manoeuvre_joints: Vec<String>,
    /// `settle_s`: time after the manoeuvre that is not used (s).
    pub settle_s: f64,
    /// `record_s`: length of the record of the free motion (s).
    pub record_s: f64,
    /// `identification_s`: length of the trajectory that everything is identified from (s).
    pub identification_s: f64,
    /// `reference_s`: length of the reference trajectory along which models are compared (s).
    pub reference_s: f64,
    /// `control_points`: free control points per joint of the identification trajectory.
    pub control_points: u64,
}

/// Keys of `[reproduce]`.
pub(crate) const REPRODUCE: &[Key] = &[
    key("seed", Holds::Whole, "of every random number").or_whole(0),
    key("trajectory_seeds", Holds::Wholes, "one excitation trajectory each"),
    key("hold_rad", Holds::Numbers, "joint positions held while the modes ring (rad)"),
    key("manoeuvre_joints", Holds::Texts, "joints that make them ring"),
    key("settle_s", Holds::NotNegative, "time after the manoeuvre that is not used (s)").or(0.0),
    must("record_s", Holds::Positive, "length of the record of the free motion (s)"),
    must("identification_s", Holds::Positive, "length of the identification trajectory (s)"),
    must("reference_s", Holds::Positive, "length of the reference trajectory (s)"),
    key("control_points", Holds::Whole, "per joint").or_whole(10),
];

impl Reproduce {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let out = Self {
            seed: t.whole("seed").unwrap_or_default(),
            trajectory_seeds: t.wholes("trajectory_seeds").unwrap_or_default(),
            hold_rad: t.numbers("hold_rad").unwrap_or_default(),
            manoeuvre_joints: t.strings("manoeuvre_joints").unwrap_or_default(),
            settle_s: t.number("settle_s").unwrap_or_default(),
            record_s: t.number("record_s").unwrap_or_default(),
            identification_s: t.number("identification_s").unwrap_or_default(),
            reference_s: t.number("reference_s").unwrap_or_default(),
            control_points: t.whole("control_points").unwrap_or_default(),
        };
        t.finish();
        out
    }
    /// What of `[reproduce]` can be checked against the robot.
    pub(super) fn check(&self, model: &Model, t: &Table<'_, '_>) {
        if !self.hold_rad.is_empty() && self.hold_rad.len() != model.nj() {
            let what = format!("{} positions for {} joints", self.hold_rad.len(), model.nj());
            t.fail("hold_rad", error("Config::WrongLength", what).hint("give one position per joint"));
        } else {
            for (b, &q) in model.own_bodies().zip(&self.hold_rad) {
                let l = &b.joint.limits;
                if !(l.lower..=l.upper).contains(&q) {
                    let what = format!("joint {}: {q} rad, limit {} .. {} rad", b.joint.name, l.lower, l.upper);
                    let p = error("Config::OutOfRange", what).violating(q, Limit::Within(l.lower, l.upper), "rad");
                    t.fail("hold_rad", p.hint("give a position within the joint limits"));
                }
            }
        }
        let names = model.joint_names();
        for j in self.manoeuvre_joints.iter().filter(|j| !names.contains(j)) {
            let p = error("Config::UnknownJoint", format!("the robot has no moving joint '{}'", clip(j)));
            t.fail(
                "manoeuvre_joints",
                match nearest(j, names.iter().map(String::as_str)) {
                    Some(n) => p.hint(format!("did you mean {n}?")),
                    None => p.hint(format!("joints: {}", list(names.iter().map(String::as_str), 12))),
                },
            );
        }
    }
}
