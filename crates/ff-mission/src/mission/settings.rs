//! `[sensors]`, `[estimate]`, `[reproduce]`: the sections that do not change the model.

use super::appendage::or_zero;
use super::reader::{Must, Table, error};
use serde::Serialize;

/// Section `[sensors]`; without it, perfect sensors at 100 Hz.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensors {
    /// `rate_hz`: sample rate of all sensors (Hz); 100 unless given.
    pub rate_hz: f64,
    /// `[sensors.torque]`: joint torque sensors.
    pub torque: Torque,
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
}

impl Default for Sensors {
    fn default() -> Self {
        Self { rate_hz: 100.0, torque: Torque::default(), gyro: Gyro::default(), encoder: Encoder::default() }
    }
}

impl Sensors {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let mut s = Self::default();
        s.rate_hz = t.number("rate_hz", Must::BePositive).unwrap_or(s.rate_hz);
        if let Some(t) = t.table("torque") {
            s.torque.noise_std_nm = or_zero(&t, "noise_std_nm", Must::NotBeNegative);
            s.torque.bias_nm = or_zero(&t, "bias_nm", Must::Any);
            s.torque.lsb_nm = or_zero(&t, "lsb_nm", Must::NotBeNegative);
            t.finish();
        }
        if let Some(t) = t.table("gyro") {
            s.gyro.noise_std_rad_per_s = or_zero(&t, "noise_std_rad_per_s", Must::NotBeNegative);
            s.gyro.bias_rad_per_s = or_zero(&t, "bias_rad_per_s", Must::Any);
            s.gyro.lsb_rad_per_s = or_zero(&t, "lsb_rad_per_s", Must::NotBeNegative);
            t.finish();
        }
        if let Some(t) = t.table("encoder") {
            s.encoder.noise_std_rad = or_zero(&t, "noise_std_rad", Must::NotBeNegative);
            s.encoder.bias_rad = or_zero(&t, "bias_rad", Must::Any);
            s.encoder.bits = t.whole("bits").and_then(|b| match u32::try_from(b) {
                // Beyond 52 bits a step is below the resolution of the numbers themselves.
                Ok(b) if (1..=52).contains(&b) => Some(b),
                _ => {
                    let what = format!("value {b} bits, limit 1 to 52 bits");
                    t.fail("bits", error("Config::OutOfRange", what).hint("give the resolution per turn in bits"));
                    None
                }
            });
            t.finish();
        }
        t.finish();
        s
    }
}

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
}

impl Estimate {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let offset = t.number("start_offset", Must::Any).unwrap_or(0.0);
        if offset <= -1.0 {
            let what = format!("value {offset}, limit > -1");
            t.fail(
                "start_offset",
                error("Config::OutOfRange", what).hint("a start value must keep the sign of the nominal one"),
            );
        }
        let out = Self {
            parameters: t.strings("parameters").unwrap_or_default(),
            start_offset: offset,
            prior_relative_std: t.number("prior_relative_std", Must::BePositive),
        };
        t.finish();
        out
    }
}

/// Section `[reproduce]`: the procedure of the paper, used by `cargo xtask reproduce`.
///
/// To add a key: one field here, one line in `read`.
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

impl Reproduce {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let out = Self {
            seed: t.whole("seed").unwrap_or(0),
            trajectory_seeds: t.wholes("trajectory_seeds").unwrap_or_default(),
            hold_rad: t.numbers("hold_rad").unwrap_or_default(),
            manoeuvre_joints: t.strings("manoeuvre_joints").unwrap_or_default(),
            settle_s: or_zero(t, "settle_s", Must::NotBeNegative),
            record_s: t.required("record_s", t.number("record_s", Must::BePositive)).unwrap_or(0.0),
            identification_s: t
                .required("identification_s", t.number("identification_s", Must::BePositive))
                .unwrap_or(0.0),
            reference_s: t.required("reference_s", t.number("reference_s", Must::BePositive)).unwrap_or(0.0),
            control_points: t.whole("control_points").unwrap_or(10),
        };
        t.finish();
        out
    }
}
