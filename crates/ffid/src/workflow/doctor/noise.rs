//! White noise of every channel without a model, and the steps of its readings.
//!
//! Differences of order k of neighbours have the variance `C(2k, k) sigma^2` for white noise, while a smooth signal of angular frequency w
//! keeps `(w h)^k` of its amplitude, so that order six is an upper bound of the noise that motion hardly touches. Noise that is correlated
//! in time loses more at higher orders: whether there is less than stated is judged by order three.

use super::case::{Case, Scales};
use super::diagnosis::{Finding, Judgement, Topic};
use super::units::ONE_TORQUE;
use crate::workflow::differences::{FEWEST, LEAKS, by_differences, typical};
use crate::workflow::identify::{Settings, num};
use crate::workflow::preflight::Sensing;
use ff_mission::mission::Sensors;
use ff_model::diagnostics::Limit;
use ff_model::{Area, JointKind, Problem};
use nalgebra::DMatrix;

/// Ratio of measured to stated noise that is suspicious, and its inverse.
const OFF: f64 = 3.0;
/// Ratio of the noise that steps of readings make by themselves to what is stated, from which it is suspicious: it follows the motion.
const COARSE: f64 = 1.5;
/// Ratio of the noise of a torque to a thousand times that of the others, or a thousandth, that is a unit; and of theirs to what is stated.
const EXACT: f64 = 1.15;
const OTHERS: f64 = 1.5;
/// A kind of sensor: its channels, and what the mission says of it.
struct Sensor<'a> {
    data: &'a DMatrix<f64>,
    names: Vec<String>,
    units: Vec<&'static str>,
    /// `[section] key` of its noise, or the flag that gives it.
    key: &'static str,
    noise: f64,
    quantum: f64,
    quantum_key: &'static str,
    /// Factor by which each channel is off.
    scales: Vec<f64>,
    steps: &'a [f64],
    /// Whether its channels jump now and then.
    jumps: bool,
}

/// The sensors of the mission with the noise that the settings have in its place: flags of the command.
pub(super) fn stated(mut sensors: Sensors, settings: &Settings) -> (Sensors, Given) {
    let known = Sensing::of(&sensors);
    let differs = |a: f64, b: f64| (a - b).abs() > 1e-12 * b.abs();
    let given = Given {
        torque: differs(settings.noise.torque, known.torque_nm),
        gyro: differs(settings.noise.gyro, known.gyro_rad_per_s),
        current: differs(settings.current_noise, sensors.current.noise_std_a),
    };
    if given.torque {
        (sensors.torque.noise_std_nm, sensors.torque.lsb_nm) = (settings.noise.torque, 0.0);
    }
    if given.gyro {
        (sensors.gyro.noise_std_rad_per_s, sensors.gyro.lsb_rad_per_s) = (settings.noise.gyro, 0.0);
    }
    if given.current {
        sensors.current.noise_std_a = settings.current_noise;
    }
    (sensors, given)
}

/// Sensors whose noise is given in place of that of the mission.
#[derive(Clone, Copy, Default)]
pub(super) struct Given {
    torque: bool,
    gyro: bool,
    current: bool,
}

pub(super) fn findings(case: &Case<'_>, scales: &Scales) -> Vec<Finding> {
    let (r, s) = (case.record, &case.sensors);
    let slides: Vec<bool> = case.model.own_bodies().map(|b| b.joint.kind == JointKind::Prismatic).collect();
    let of_joint = |turns, slide| slides.iter().map(|&yes| if yes { slide } else { turns }).collect();
    let named = |head: &str| r.joint_names().iter().map(|j| format!("{head}.{j}")).collect();
    let mut all = vec![
        Sensor {
            data: r.q(),
            names: named("q"),
            units: of_joint("rad", "m"),
            key: "[sensors.encoder] noise_std_rad",
            noise: s.encoder.noise_std_rad,
            quantum: s.encoder.bits.map_or(0.0, |b| ff_dynamics::sim::Channel::encoder(b).quantum),
            quantum_key: "[sensors.encoder] bits",
            scales: scales.position.clone(),
            steps: &case.level.position_step,
            jumps: false,
        },
        Sensor {
            data: &case.torque.readings,
            names: named("tau"),
            units: of_joint("N m", "N"),
            key: if case.given.torque { "--torque-noise" } else { "[sensors.torque] noise_std_nm" },
            noise: s.torque.noise_std_nm,
            quantum: s.torque.lsb_nm,
            quantum_key: "[sensors.torque] lsb_nm",
            scales: scales.torque.clone(),
            steps: &case.level.torque_step,
            jumps: case.jumps,
        },
    ];
    if case.gains.iter().any(Option::is_some) {
        all.splice(1..2, currents(case, scales));
    }
    if !r.is_fixed_base() {
        all.push(Sensor {
            data: &case.gyro.readings,
            names: ["x", "y", "z"].map(|a| format!("gyro.{a}")).to_vec(),
            units: vec!["rad/s"; 3],
            key: if case.given.gyro { "--gyro-noise" } else { "[sensors.gyro] noise_std_rad_per_s" },
            noise: s.gyro.noise_std_rad_per_s,
            quantum: s.gyro.lsb_rad_per_s,
            quantum_key: "[sensors.gyro] lsb_rad_per_s",
            scales: vec![scales.gyro; 3],
            steps: &case.level.gyro_step,
            jumps: false,
        });
    }
    all.iter().flat_map(|sensor| of_sensor(case, sensor)).collect()
}

/// Currents that stand as torques, in A again.
fn currents<'c>(case: &'c Case<'_>, scales: &Scales) -> Option<Sensor<'c>> {
    // What one sensor says of all its channels; of a mixture nothing is judged.
    let gains = case.gains.iter().copied().collect::<Option<Vec<f64>>>()?;
    let s = &case.sensors.current;
    Some(Sensor {
        data: &case.torque.readings,
        names: case.record.joint_names().iter().map(|j| format!("current.{j}")).collect(),
        units: vec!["A"; gains.len()],
        key: if case.given.current { "--current-noise" } else { "[sensors.current] noise_std_a" },
        noise: s.noise_std_a,
        quantum: s.lsb_a,
        quantum_key: "[sensors.current] lsb_a",
        scales: gains.iter().zip(&scales.torque).map(|(k, scale)| k.abs() * scale).collect(),
        steps: &case.level.torque_step,
        jumps: true,
    })
}

impl Sensor<'_> {
    /// Who states the noise.
    fn source(&self) -> &'static str {
        if self.key.starts_with('-') { "the command" } else { "the mission" }
    }
}

/// How the noise of a channel differs from what the mission says.
#[derive(Clone, Copy, PartialEq)]
enum Differs {
    More,
    Less,
    Coarser,
}

/// Which channel differs, how, and by which figure.
fn differing(s: &Sensor<'_>, expected: f64) -> Vec<(usize, Differs, f64)> {
    if expected == 0.0 || s.data.nrows() < FEWEST {
        return Vec::new();
    }
    let one = |k: usize| {
        let x = s.data.column(k);
        let of = if s.jumps { typical } else { by_differences };
        let [three, four, six] = [3, 4, 6].map(|o| of(x.as_view(), o) / s.scales[k]);
        let step = s.steps[k] / s.scales[k];
        let of_step = step / 12f64.sqrt();
        // Steps of a channel at rest hide its noise.
        let hidden = s.quantum.max(step) > 2.0 * s.noise;
        if of_step > COARSE * expected {
            Some((k, Differs::Coarser, of_step))
        } else if six > OFF * expected && four < LEAKS * six {
            Some((k, Differs::More, six))
        } else if !hidden && three < expected / OFF {
            Some((k, Differs::Less, three))
        } else {
            None
        }
    };
    (0..s.names.len()).filter_map(one).collect()
}

fn of_sensor(case: &Case<'_>, s: &Sensor<'_>) -> Vec<Finding> {
    let expected = s.noise.hypot(s.quantum / 12f64.sqrt());
    let kind = s.names.first().and_then(|n| n.split('.').next()).unwrap_or("");
    let unit = s.units.first().copied().unwrap_or("");
    let found = differing(s, expected);
    if found.is_empty() {
        let of = if s.jumps { typical } else { by_differences };
        let all = (0..s.names.len()).map(|k| of(s.data.column(k).as_view(), 6) / s.scales[k]);
        let (low, high) = all.fold((f64::INFINITY, 0.0f64), |(a, b), x| (a.min(x), b.max(x)));
        let text = if expected > 0.0 {
            format!("{kind}: noise {low:.2e} to {high:.2e} {unit}, {} has {expected:.2e}", s.source())
        } else {
            format!("{kind}: noise {low:.2e} to {high:.2e} {unit}, the mission gives none ({})", s.key)
        };
        return vec![case.finding(Topic::Noise, Judgement::Good, text).on(kind).figures(high, expected, unit)];
    }
    // The mission has one figure for all channels of a sensor.
    let together = found.len() > 1 && found.len() == s.names.len() && found.iter().all(|f| f.1 == found[0].1);
    if together {
        let mut all: Vec<f64> = found.iter().map(|f| f.2).collect();
        all.sort_unstable_by(f64::total_cmp);
        return vec![raised(case, s, (kind, unit), (found[0].1, all[all.len() / 2]), expected)];
    }
    found
        .iter()
        .map(|&(k, how, figure)| {
            another_unit(case, s, k, (figure, expected))
                .unwrap_or_else(|| raised(case, s, (&s.names[k], s.units[k]), (how, figure), expected))
        })
        .collect()
}

/// The error of a torque whose noise is a thousand times that of the others, or a thousandth, while those have what was stated: no signal of
/// this joint stands out of it.
fn another_unit(case: &Case<'_>, s: &Sensor<'_>, k: usize, (figure, expected): (f64, f64)) -> Option<Finding> {
    if !s.names[k].starts_with("tau.") {
        return None;
    }
    let of = if s.jumps { typical } else { by_differences };
    let off = |j: usize| (of(s.data.column(j).as_view(), 6) / s.scales[j] / expected).ln().abs();
    let others: Vec<usize> = (0..s.names.len()).filter(|&j| j != k).collect();
    let alone = !others.is_empty() && others.iter().all(|&j| off(j) < OTHERS.ln());
    let ratio = figure / expected;
    let unit = ONE_TORQUE.iter().find(|u| (ratio / u.factor).ln().abs() < EXACT.ln()).filter(|_| alone)?;
    let text = format!(
        "noise {figure:.3e} {}, {} times that of the other joints and of {}: {} (factor {})",
        s.units[k],
        num(ratio),
        s.source(),
        unit.is,
        unit.factor
    );
    let p = Problem::error(Area::Data, "Data::UnitMismatch", text.clone())
        .on(&s.names[k])
        .violating(ratio, Limit::Within(1.0 / OFF, OFF), "")
        .hint(format!("write the unit {} in the header, or multiply by {}", unit.write, 1.0 / unit.factor));
    Some(case.finding(Topic::Units, Judgement::Wrong, text).on(&s.names[k]).figures(ratio, unit.factor, "").raising(p))
}

/// The finding on a channel, or on all of a sensor.
fn raised(
    case: &Case<'_>,
    s: &Sensor<'_>,
    (on, unit): (&str, &str),
    (how, figure): (Differs, f64),
    expected: f64,
) -> Finding {
    let ratio = num(figure / expected);
    let of = format!("{ratio} times the {expected:.3e} {unit} of {}", s.source());
    let (text, hint) = match how {
        Differs::More => {
            (format!("noise {figure:.3e} {unit}, {of}"), format!("set {} = {figure:.2e}, or look at the sensor", s.key))
        }
        Differs::Less => (
            format!("noise {figure:.3e} {unit} at most, {of}"),
            format!("set {} = {figure:.2e}, unless the readings were smoothed", s.key),
        ),
        Differs::Coarser => (
            format!("readings in steps of {:.3e} {unit}, noise {figure:.3e} {unit}, {of}", figure * 12f64.sqrt()),
            format!("give the step as {}", s.quantum_key),
        ),
    };
    let limit = Limit::Within(expected / OFF, expected * OFF);
    let p = Problem::warning(Area::Data, "Data::NoiseFigure", text.clone())
        .on(on)
        .violating(figure, limit, unit.to_owned())
        .hint(hint);
    case.finding(Topic::Noise, Judgement::Suspicious, text).on(on).figures(figure, expected, unit).raising(p)
}
