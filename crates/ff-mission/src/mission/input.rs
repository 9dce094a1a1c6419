//! `[[input]]`: what acts on the robot from outside while `ffid simulate` flies it, and the motors of wheels.
//!
//! Only declared here; `ff-dynamics` has what they do. To add a kind: a variant, its reader, a line in [`KINDS`].

use super::declared::{Holds, Key, key, must, words};
use super::excite::choice;
use super::frames::Frames;
use super::limits::direction;
use super::reader::{Table, error};
use ff_model::Model;
use ff_model::diagnostics::Limit;
use ff_model::diagnostics::{clip, list, nearest};
use serde::Serialize;

/// Greatest cosine between two directions that count as perpendicular.
const PERPENDICULAR: f64 = 1e-6;

/// Greatest distance (m) from the origin of a body that counts as its origin.
const AT_ORIGIN: f64 = 1e-9;

/// One `[[input]]`.
///
/// ```toml
/// [[input]]
/// kind = "thruster"
/// host = "base"
/// point_m = [-0.4, 0.3, 0.2]
/// direction = [0.8, 0.1, -0.3]
/// pulse = [{ t_on_s = 1.3, t_off_s = 4.1, force_n = 6.5 }]
/// ```
///
/// Times count from the start of the simulation. The world axes are those of the base at that moment.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum InputSpec {
    /// `thruster`: a force along a direction that is fixed in a link.
    Thruster {
        /// `host`: the link, or client, that is pushed. Required.
        host: String,
        /// `point_m`: where it is pushed, in the frame of the link (m). Required.
        point_m: [f64; 3],
        /// `direction`: where to, in the frame of the link, of any length. Required.
        direction: [f64; 3],
        /// How strongly, and when.
        #[serde(flatten)]
        thrust: Course<Thrust>,
    },
    /// `wrench`: a given force and moment on a link, about the origin of its frame.
    Wrench {
        /// `host`: the link, or client. Required.
        host: String,
        /// `axes`: those of `force_n` and `moment_nm`. Required.
        axes: WrenchAxes,
        /// How strongly, and when.
        #[serde(flatten)]
        wrench: Course<Wrench>,
    },
    /// `passive_force`: a force between an appendage and its host, on one coordinate of it, such as the motor of a wheel.
    PassiveForce {
        /// `coordinate`: its full name, such as `wheel.spin`. Required.
        coordinate: String,
        /// How strongly, and when.
        #[serde(flatten)]
        force: Course<Effort>,
    },
    /// `gravity_gradient`: on everything, on a circular orbit. The world falls with the point of the orbit that is its
    /// origin, and keeps its axes.
    GravityGradient {
        /// `mu_m3_per_s2`: gravitational parameter of what is orbited (m^3/s^2); the Earth's unless given.
        mu_m3_per_s2: Option<f64>,
        /// `radius_m`: distance from its centre (m). Required.
        radius_m: f64,
        /// `radial`: direction away from the centre at the start, in world axes, of any length. Required.
        radial: [f64; 3],
        /// `normal`: normal of the orbit in world axes, of any length; the robot goes round it by the right hand. Required.
        normal: [f64; 3],
    },
}

/// How strong an input is over time: `V` given in the table itself, in every `pulse` or in every `sample`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Course<V> {
    /// The same at all times.
    Constant(V),
    /// `[[input.pulse]]`: on, then off; zero otherwise. Pulses that overlap add up.
    Pulse(Vec<PulseSpec<V>>),
    /// `[[input.sample]]`: linear in between, at least two; zero before the first and after the last.
    Sample(Vec<SampleSpec<V>>),
}

/// One `[[input.pulse]]`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PulseSpec<V> {
    /// `t_on_s`: when it begins (s).
    pub t_on_s: f64,
    /// `t_off_s`: when it ends (s), later than that.
    pub t_off_s: f64,
    /// In between.
    #[serde(flatten)]
    pub value: V,
}

/// One `[[input.sample]]`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SampleSpec<V> {
    /// `t_s`: when (s), later than the sample before.
    pub t_s: f64,
    /// At that time.
    #[serde(flatten)]
    pub value: V,
}

/// What a thruster has a [`Course`] of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Thrust {
    /// `force_n` (N), not negative.
    pub force_n: f64,
}

/// What a wrench has a [`Course`] of; one of the two may be left out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wrench {
    /// `force_n` (N); zero unless given.
    pub force_n: [f64; 3],
    /// `moment_nm` (N m); zero unless given.
    pub moment_nm: [f64; 3],
}

/// What a force on a coordinate has a [`Course`] of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effort {
    /// `torque_nm`: on an angle (N m).
    TorqueNm(f64),
    /// `force_n`: on a length (N).
    ForceN(f64),
}

/// Axes in which a wrench is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum WrenchAxes {
    /// `body`: those of the link.
    Body,
    /// `world`: the wrench keeps its direction while the link turns.
    World,
}

/// Reads what is particular to a kind.
type Reader = fn(&Table<'_, '_>) -> Option<InputSpec>;

/// Its keys and its reader, by kind.
const KINDS: [(&str, (&[Key], Reader)); 4] = [
    ("thruster", (THRUSTER, thruster)),
    ("wrench", (WRENCH, wrench)),
    ("passive_force", (PASSIVE_FORCE, passive_force)),
    ("gravity_gradient", (GRAVITY_GRADIENT, gravity_gradient)),
];

/// Keys of every kind of `[[input]]`.
pub(crate) const INPUTS: &[&[Key]] = &[KINDS[0].1.0, KINDS[1].1.0, KINDS[2].1.0, KINDS[3].1.0];

const T_ON: Key = must("t_on_s", Holds::Number, "begin (s)");
const T_OFF: Key = must("t_off_s", Holds::Number, "end (s), later than t_on_s");
const T: Key = must("t_s", Holds::Number, "time (s), later than that of the sample before");

const THRUST: Key = must("force_n", Holds::NotNegative, "force (N)");
const THRUSTER: &[Key] = &[
    must("kind", Holds::OneOf(&["thruster"]), "a force along a direction that is fixed in a link"),
    must("host", Holds::Text, "link or client that is pushed"),
    must("point_m", Holds::Vector(3), "where it is pushed, in the frame of the link (m)"),
    must("direction", Holds::Vector(3), "where to, in the frame of the link, of any length"),
    key("force_n", Holds::NotNegative, "force at all times (N), unless pulse or sample is given"),
    key("pulse", Holds::Tables(&[T_ON, T_OFF, THRUST]), "on, then off"),
    key("sample", Holds::Tables(&[T, THRUST]), "linear in between, zero outside"),
];

const AXES: [(&str, WrenchAxes); 2] = [("body", WrenchAxes::Body), ("world", WrenchAxes::World)];
const AXES_WORDS: [&str; 2] = words(&AXES);
const FORCE: Key = key("force_n", Holds::Vector(3), "force (N); zero unless given");
const MOMENT: Key = key("moment_nm", Holds::Vector(3), "moment about the origin of the link (N m); zero unless given");
const WRENCH: &[Key] = &[
    must("kind", Holds::OneOf(&["wrench"]), "a given force and moment on a link"),
    must("host", Holds::Text, "link or client; with world axes one that begins where its body does"),
    must("axes", Holds::OneOf(&AXES_WORDS), "axes of force and moment; those of the world keep their direction"),
    FORCE,
    MOMENT,
    key("pulse", Holds::Tables(&[T_ON, T_OFF, FORCE, MOMENT]), "on, then off"),
    key("sample", Holds::Tables(&[T, FORCE, MOMENT]), "linear in between, zero outside"),
];

const TORQUE_NM: Key = key("torque_nm", Holds::Number, "torque on an angle (N m)");
const FORCE_N: Key = key("force_n", Holds::Number, "force on a length (N)");
const PASSIVE_FORCE: &[Key] = &[
    must("kind", Holds::OneOf(&["passive_force"]), "between an appendage and its host, such as the motor of a wheel"),
    must("coordinate", Holds::Text, "full name of a coordinate of an appendage, such as wheel.spin"),
    TORQUE_NM,
    FORCE_N,
    key("pulse", Holds::Tables(&[T_ON, T_OFF, TORQUE_NM, FORCE_N]), "on, then off"),
    key("sample", Holds::Tables(&[T, TORQUE_NM, FORCE_N]), "linear in between, zero outside"),
];

const GRAVITY_GRADIENT: &[Key] = &[
    must("kind", Holds::OneOf(&["gravity_gradient"]), "on everything, on a circular orbit"),
    key("mu_m3_per_s2", Holds::Positive, "gravitational parameter (m^3/s^2); the Earth's unless given"),
    must("radius_m", Holds::Positive, "distance from the centre of what is orbited (m)"),
    must("radial", Holds::Vector(3), "direction away from it at the start, in world axes, of any length"),
    must("normal", Holds::Vector(3), "normal of the orbit in world axes, of any length; perpendicular to radial"),
];

impl InputSpec {
    /// Reads one table; `None` where a problem is recorded.
    pub(super) fn read(t: &Table<'_, '_>) -> Option<Self> {
        // The keys of an unknown kind cannot be judged.
        let (keys, read) = choice(t, "kind", &KINDS)?;
        t.is_of(keys);
        let input = read(t);
        t.finish();
        input
    }
    /// What can be checked against the robot; coordinates only when it is `complete`, with every appendage.
    pub(super) fn check(&self, frames: &Frames<'_>, model: &Model, complete: bool, t: &Table<'_, '_>) {
        match self {
            Self::Thruster { host, .. } | Self::Wrench { host, axes: WrenchAxes::Body, .. } => {
                frames.find(host, "host", t);
            }
            Self::Wrench { host, axes: WrenchAxes::World, .. } => about_origin(host, frames, t),
            Self::PassiveForce { coordinate, force } if complete => on_coordinate(coordinate, force, model, t),
            Self::PassiveForce { .. } | Self::GravityGradient { .. } => {}
        }
    }
}

fn thruster(t: &Table<'_, '_>) -> Option<InputSpec> {
    let host = t.string("host");
    let point_m = t.vector::<3>("point_m");
    let direction = direction(t, "direction");
    let thrust = course(t);
    Some(InputSpec::Thruster { host: host?, point_m: point_m?, direction: direction?, thrust: thrust? })
}

fn wrench(t: &Table<'_, '_>) -> Option<InputSpec> {
    let host = t.string("host");
    let axes = choice(t, "axes", &AXES);
    let wrench = course(t);
    Some(InputSpec::Wrench { host: host?, axes: axes?, wrench: wrench? })
}

fn passive_force(t: &Table<'_, '_>) -> Option<InputSpec> {
    let coordinate = t.string("coordinate");
    let force = course(t);
    Some(InputSpec::PassiveForce { coordinate: coordinate?, force: force? })
}

fn gravity_gradient(t: &Table<'_, '_>) -> Option<InputSpec> {
    let mu_m3_per_s2 = t.number("mu_m3_per_s2");
    let radius_m = t.number("radius_m");
    let (radial, normal) = (direction(t, "radial"), direction(t, "normal"));
    let (radius_m, radial, normal) = (radius_m?, radial?, normal?);
    let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let cosine = dot(&radial, &normal) / (dot(&radial, &radial) * dot(&normal, &normal)).sqrt();
    if cosine.abs() > PERPENDICULAR {
        let what = format!("cosine {cosine:.3e} between radial and normal, limit {PERPENDICULAR:e}");
        let p = error("Config::OutOfRange", what).violating(cosine.abs(), Limit::AtMost(PERPENDICULAR), "");
        t.fail("normal", p.hint("give a normal perpendicular to radial"));
        return None;
    }
    Some(InputSpec::GravityGradient { mu_m3_per_s2, radius_m, radial, normal })
}

/// The `V` of a [`Course`], read from the table of the input, of a pulse or of a sample.
trait Strength: Sized {
    /// Its keys.
    const KEYS: &'static [&'static str];
    /// `None` when no key is there, and where a problem is recorded.
    fn read(t: &Table<'_, '_>) -> Option<Self>;
    /// True when the table has one of the keys, right or wrong.
    fn given(t: &Table<'_, '_>) -> bool {
        Self::KEYS.iter().any(|k| t.has(k))
    }
    /// As in a pulse or a sample, which cannot do without.
    fn required(t: &Table<'_, '_>) -> Option<Self> {
        let v = Self::read(t);
        if Self::given(t) { v } else { t.required(Self::KEYS[0], v) }
    }
}

impl Strength for Thrust {
    const KEYS: &'static [&'static str] = &["force_n"];
    fn read(t: &Table<'_, '_>) -> Option<Self> {
        // A thruster cannot pull.
        t.number("force_n").map(|force_n| Self { force_n })
    }
}

impl Strength for Wrench {
    const KEYS: &'static [&'static str] = &["force_n", "moment_nm"];
    fn read(t: &Table<'_, '_>) -> Option<Self> {
        let or_zero = |key, v: Option<[f64; 3]>| if t.has(key) { v } else { Some([0.0; 3]) };
        let force_n = or_zero("force_n", t.vector::<3>("force_n"));
        let moment_nm = or_zero("moment_nm", t.vector::<3>("moment_nm"));
        Some(Self { force_n: force_n?, moment_nm: moment_nm? }).filter(|_| Self::given(t))
    }
}

impl Strength for Effort {
    const KEYS: &'static [&'static str] = &["torque_nm", "force_n"];
    fn read(t: &Table<'_, '_>) -> Option<Self> {
        let torque = t.number("torque_nm").map(Self::TorqueNm);
        let force = t.number("force_n").map(Self::ForceN);
        if t.has("torque_nm") && t.has("force_n") {
            let p = error("Config::Conflict", "torque_nm and force_n are both given");
            t.fail("force_n", p.hint("keep torque_nm for an angle, force_n for a length"));
            return None;
        }
        torque.or(force)
    }
}

impl<V> Course<V> {
    /// Values that it is made of.
    fn values(&self) -> Vec<&V> {
        match self {
            Self::Constant(v) => vec![v],
            Self::Pulse(p) => p.iter().map(|p| &p.value).collect(),
            Self::Sample(s) => s.iter().map(|s| &s.value).collect(),
        }
    }
}

/// How strong an input is; `None` where a problem is recorded.
fn course<V: Strength>(t: &Table<'_, '_>) -> Option<Course<V>> {
    let constant = V::read(t);
    let pulses: Vec<_> = t.tables("pulse").iter().map(pulse).collect();
    let samples: Vec<_> = t.tables("sample").iter().map(sample).collect();
    match (V::given(t), t.has("pulse"), t.has("sample")) {
        (true, false, false) => constant.map(Course::Constant),
        (false, true, false) => {
            enough(t, "pulse", 1)?;
            pulses.into_iter().collect::<Option<_>>().map(Course::Pulse)
        }
        (false, false, true) => {
            enough(t, "sample", 2)?;
            let samples = samples.into_iter().collect::<Option<Vec<_>>>()?;
            ascending(&samples, t).then_some(Course::Sample(samples))
        }
        (false, false, false) => {
            let p = error("Config::MissingKey", format!("none of {}, pulse, sample", V::KEYS.join(", ")));
            t.fail("pulse", p.hint(format!("add pulse = [...], or {} = ... for all times", V::KEYS[0])));
            None
        }
        (_, pulse, _) => {
            let p = error("Config::Conflict", format!("more than one of {}, pulse, sample", V::KEYS.join(", ")));
            t.fail(if pulse { "pulse" } else { "sample" }, p.hint("keep one; make two inputs of them to add them"));
            None
        }
    }
}

fn pulse<V: Strength>(t: &Table<'_, '_>) -> Option<PulseSpec<V>> {
    let on = t.number("t_on_s");
    let off = t.number("t_off_s");
    let value = V::required(t);
    t.finish();
    let (t_on_s, t_off_s) = (on?, off?);
    if t_off_s <= t_on_s {
        let what = format!("value {t_off_s} s, limit > t_on_s, {t_on_s} s");
        let p = error("Config::OutOfRange", what).violating(t_off_s, Limit::Above(t_on_s), "s");
        t.fail("t_off_s", p.hint("let the pulse end after it begins"));
        return None;
    }
    Some(PulseSpec { t_on_s, t_off_s, value: value? })
}

fn sample<V: Strength>(t: &Table<'_, '_>) -> Option<SampleSpec<V>> {
    let at = t.number("t_s");
    let value = V::required(t);
    t.finish();
    Some(SampleSpec { t_s: at?, value: value? })
}

/// At least so many tables; what is no array has been reported.
fn enough(t: &Table<'_, '_>, key: &'static str, least: usize) -> Option<()> {
    let n = t.entries(key)?;
    if n < least {
        let what = format!("{n} tables, at least {least} needed");
        let hint = format!("add [[{}]], or give one value for all times", t.name_of(key));
        t.fail(key, error("Config::WrongLength", what).hint(hint));
        return None;
    }
    Some(())
}

/// True when every sample is later than the one before; the first that is not is reported.
fn ascending<V>(samples: &[SampleSpec<V>], t: &Table<'_, '_>) -> bool {
    let Some(k) = samples.windows(2).position(|w| w[1].t_s <= w[0].t_s) else { return true };
    let key = format!("sample[{}].t_s", k + 1);
    let what = format!("value {} s, limit > {} s, the sample before", samples[k + 1].t_s, samples[k].t_s);
    let limit = Limit::Above(samples[k].t_s);
    let p = error("Config::OutOfRange", what).violating(samples[k + 1].t_s, limit, "s").on(t.name_of(&key));
    t.fail_at(t.place(&key), p.hint("give the samples in order, each time once"));
    false
}

/// A wrench in world axes acts about the origin of a body: about another point of it its moment would turn with the body.
fn about_origin(host: &str, frames: &Frames<'_>, t: &Table<'_, '_>) {
    let Some(f) = frames.find(host, "host", t).map(|k| &frames.0.frames()[k]) else { return };
    let off = f.placement.pos.norm();
    if off > AT_ORIGIN {
        let body = frames.0.body_name(f.body);
        let what =
            format!("its origin is {off} m from that of body {body}, limit {AT_ORIGIN:e} m for axes = \"world\"");
        let p = error("Config::OutOfRange", what).violating(off, Limit::AtMost(AT_ORIGIN), "m");
        t.fail("host", p.hint(format!("give {body} as host, or axes = \"body\"")));
    }
}

/// The coordinate exists, and has the unit that its forces suppose.
fn on_coordinate(name: &str, force: &Course<Effort>, model: &Model, t: &Table<'_, '_>) {
    let coords = model.passive_coords();
    let names = || coords.iter().map(|(n, _)| n.as_str());
    let Some((_, c)) = coords.iter().find(|(n, _)| n == name) else {
        let p = error("Config::UnknownCoordinate", format!("no appendage has a coordinate '{}'", clip(name)));
        t.fail(
            "coordinate",
            match nearest(name, names()) {
                Some(n) => p.hint(format!("did you mean {n}?")),
                None if coords.is_empty() => p.hint("add an [[appendage]] with coordinates"),
                None => p.hint(format!("coordinates: {}", list(names(), 12))),
            },
        );
        return;
    };
    let wrong = |e: &&Effort| matches!((e, c.unit), (Effort::TorqueNm(_), "m") | (Effort::ForceN(_), "rad"));
    if let Some(e) = force.values().into_iter().find(wrong) {
        let (given, need) = match e {
            Effort::TorqueNm(_) => ("torque_nm", "force_n"),
            Effort::ForceN(_) => ("force_n", "torque_nm"),
        };
        let p = error("Config::Conflict", format!("{given} is given, but the unit of {name} is {}", c.unit));
        t.fail("coordinate", p.hint(format!("give {need}")));
    }
}
