//! The errors that are tried: which columns belong together, what they are called and how they are told.

use crate::compose::several::is_called;
use crate::estimate::ground::joint_terms::JointTerm;
use crate::estimate::output_options::Options;
use crate::uncertain::score::Combination;
use crate::uncertain::source::ErrorSource;
use ff_model::tree::{DisplacementKind, Placed};
use ff_model::{Model, ParamDecl, ParamGroup};
use std::collections::BTreeMap;

/// A component of a hypothesis.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// What tells it from the others, such as `x`; empty where there is one alone.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// The column, as a combination of names: parameters of the model, or nuisance unknowns without the label of a record.
    pub of: Vec<(String, f64)>,
}

/// What may be wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// Its name, as `--adopt` takes it: `gyro-misalignment`, `torque-gain.joint3`.
    pub name: String,
    /// In words, as the subject of "would explain it": `a gyro that reads rates turned`.
    pub words: String,
    /// Its components.
    pub components: Vec<Component>,
    /// Whether its one component cannot be negative, as no joint stretches against its load: then only that speaks for it.
    pub positive: bool,
}

impl Hypothesis {
    /// Of these components, each of either sign.
    pub fn new(name: impl Into<String>, words: impl Into<String>, components: Vec<Component>) -> Self {
        Self { name: name.into(), words: words.into(), components, positive: false }
    }
    /// One component with its own column.
    fn one(name: impl Into<String>, words: impl Into<String>, column: impl Into<String>, unit: &str) -> Self {
        Self::new(name, words, vec![component("", column, unit)])
    }
    /// Columns of its components among named ones (parameters, then nuisance unknowns, of which several records have one each, with
    /// their labels before the name); `None` where a column is missing.
    pub fn columns(&self, names: &[String], labels: &[String]) -> Option<Vec<Combination>> {
        let find = |wanted: &str| -> Vec<usize> {
            (0..names.len()).filter(|&i| is_called(&names[i], wanted, labels)).collect()
        };
        let each = |c: &Component| {
            let mut out = Vec::new();
            for (name, weight) in &c.of {
                let at = find(name);
                if at.is_empty() {
                    return None;
                }
                out.extend(at.into_iter().map(|i| (i, *weight)));
            }
            Some(out)
        };
        self.components.iter().map(each).collect()
    }
}

fn component(name: &str, column: impl Into<String>, unit: &str) -> Component {
    Component { name: name.into(), unit: unit.into(), of: vec![(column.into(), 1.0)] }
}

const AXES: [&str; 3] = ["x", "y", "z"];

fn axes(prefix: &str, unit: &str) -> Vec<Component> {
    AXES.iter().map(|a| component(a, format!("{prefix}{a}"), unit)).collect()
}

/// What the last link of a chain may hold that the model knows nothing of: all ten numbers of the link. Links of which some are estimated, and
/// those that weigh nothing, are left out.
fn held_bodies(model: &Model, selected: &[usize], values: &[f64]) -> Vec<Hypothesis> {
    let (decls, bodies) = (model.param_decls(), model.bodies());
    let mut out = Vec::new();
    let is_last = |k: usize| bodies.iter().all(|b| b.parent != k + 1);
    for body in (0..bodies.len()).filter(|&k| is_last(k)).map(|k| &bodies[k]) {
        let Some(first) = decls.iter().position(|d| d.name == format!("{}.mass", body.name)) else { continue };
        let of = first..first + 10;
        if values[first] <= 0.0 || of.clone().any(|i| selected.contains(&i)) {
            continue;
        }
        let one = |d: &ParamDecl| component(d.name.rsplit('.').next().unwrap_or_default(), d.name.clone(), d.unit);
        let all = decls[of].iter().map(one).collect();
        out.push(Hypothesis::new(format!("held.{}", body.name), format!("something that {} holds", body.name), all));
    }
    out
}

/// Everything that is tried for a model whose parameters `selected` have been estimated around `values`. Whatever a fit has estimated
/// itself is left out by [`Hypothesis::columns`] and [`crate::uncertain::Scores::test`]. Allocates.
pub fn hypotheses(model: &Model, selected: &[usize], values: &[f64]) -> Vec<Hypothesis> {
    let mut out = sensors(model);
    out.extend(placements(model));
    out.extend(parameters(&model.param_decls(), selected, values));
    out.extend(held_bodies(model, selected, values));
    out.push(Hypothesis::new("external-force", "a constant force on the base", axes("wrench.f", "N")));
    out.push(Hypothesis::new("external-torque", "a constant torque on the base", axes("wrench.n", "N m")));
    let mut initial = axes("initial.rate.", "rad/s");
    for (name, coordinate) in model.passive_coords() {
        initial.push(component(&name, format!("initial.{name}"), coordinate.unit));
        initial.push(component(&format!("d/dt {name}"), format!("initial.d/dt {name}"), "1/s"));
    }
    out.push(Hypothesis::new("start-in-motion", "a robot that is not at rest when the record begins", initial));
    out
}

fn sensors(model: &Model) -> Vec<Hypothesis> {
    let mut out = vec![
        Hypothesis::one("torque-gain", "a common gain of all torque sensors", "torque.gain", "1"),
        Hypothesis::one("gyro-scale", "a scale of the gyro", "gyro.scale", "1"),
        Hypothesis::new("gyro-misalignment", "a gyro that reads rates turned", axes("gyro.rotation.", "rad")),
        Hypothesis::new("gyro-drift", "a bias of the gyro that drifts", axes("gyro.drift.", "rad/s^2")),
        Hypothesis::new("gyro-bias", "a bias of the gyro", axes("gyro.bias.", "rad/s")),
        Hypothesis::one("torque-clock", "torques that are late", "torque.delay", "s"),
        Hypothesis::one("gyro-clock", "a gyro that is late", "gyro.delay", "s"),
        Hypothesis::one("torque-clock-rate", "a clock of the torques that runs slowly", "torque.skew", "1"),
        Hypothesis::one("gyro-clock-rate", "a clock of the gyro that runs slowly", "gyro.skew", "1"),
        Hypothesis::one("clock-rate", "a clock of the whole record that runs fast", "clock.rate", "1"),
    ];
    for axis in AXES {
        let words = format!("a scale of the gyro's {axis} axis");
        out.push(Hypothesis::one(format!("gyro-scale.{axis}"), words, format!("gyro.scale.{axis}"), "1"));
    }
    for j in model.joint_names() {
        let mut one = |name: &str, words: String, column: &str, unit: &str| {
            let positive = name == "compliance";
            let h = Hypothesis::one(format!("{name}.{j}"), words, format!("{column}.{j}"), unit);
            out.push(Hypothesis { positive, ..h });
        };
        one("torque-gain", format!("a gain of the torque sensor of {j}"), "torque.gain", "1");
        one("torque-bias", format!("a bias of the torque sensor of {j}"), "torque.bias", "N m");
        one("torque-drift", format!("a bias of the torque sensor of {j} that drifts"), "torque.drift", "N m/s");
        one("compliance", format!("an elastic {j} with its encoder on the motor's side"), "compliance", "rad/(N m)");
        one("torque-clock", format!("a torque sensor of {j} that is late"), "torque.lag", "s");
        one("encoder-clock", format!("an encoder of {j} that is late"), "encoder.lag", "s");
        let friction = vec![
            component("viscous", JointTerm::Viscous.name(&j), JointTerm::Viscous.unit(false)),
            component("coulomb", JointTerm::Coulomb.name(&j), JointTerm::Coulomb.unit(false)),
        ];
        let words = format!("friction between the torque sensor of {j} and the link");
        out.push(Hypothesis::new(format!("friction.{j}"), words, friction));
    }
    out
}

/// Placements of joints and mounts. The first joint moves by what a mount of the whole arm would.
fn placements(model: &Model) -> Vec<Hypothesis> {
    let mut groups: BTreeMap<(usize, bool, u8), Hypothesis> = BTreeMap::new();
    let (joints, mounts) = (model.bodies(), model.appendages());
    for p in model.kinematic_params() {
        let (k, is_mount, owner) = match p.of {
            Placed::Joint(j) => (j, false, joints[j].joint.name.clone()),
            Placed::Mount(k) => (k, true, mounts[k].name.clone()),
        };
        let (kind, name, words) = match (p.kind, is_mount) {
            (DisplacementKind::Offset, _) => (
                0,
                format!("encoder-offset.{owner}"),
                format!("an offset of the encoder of {owner} (to add to its readings)"),
            ),
            (DisplacementKind::Shift, false) => {
                (1, format!("joint-position.{owner}"), format!("{owner} at another place on the link before it"))
            }
            (DisplacementKind::Rotation, false) => {
                (2, format!("joint-axis.{owner}"), format!("an axis of {owner} that is turned"))
            }
            (DisplacementKind::Shift, true) => {
                (1, format!("mount-position.{owner}"), format!("{owner} mounted elsewhere"))
            }
            (DisplacementKind::Rotation, true) => {
                (2, format!("mount-rotation.{owner}"), format!("{owner} mounted turned"))
            }
        };
        let group = groups.entry((k, is_mount, kind)).or_insert_with(|| Hypothesis::new(name, words, Vec::new()));
        let label = p.name.rsplit('.').next().unwrap_or_default().to_owned();
        group.components.push(component(&label, p.name.clone(), p.unit));
    }
    let mut out: Vec<Hypothesis> = groups.into_values().collect();
    for h in &mut out {
        if let [only] = &mut h.components[..] {
            only.name.clear();
        }
    }
    out
}

/// Parameters that were held: bodies by mass (all ten numbers in proportion), centre of mass and inertia, others one by one.
fn parameters(decls: &[ParamDecl], selected: &[usize], values: &[f64]) -> Vec<Hypothesis> {
    let mut out = Vec::new();
    let mut bodies: Vec<(String, Vec<usize>)> = Vec::new();
    let mut parts: BTreeMap<String, Vec<Component>> = BTreeMap::new();
    for (i, d) in decls.iter().enumerate() {
        let ParamGroup::Inertial(body) = &d.group else {
            if !selected.contains(&i) {
                out.push(Hypothesis::one(d.name.clone(), format!("another {}", d.name), d.name.clone(), d.unit));
                if let Some((owner, own)) = d.name.split_once('.') {
                    parts.entry(owner.to_owned()).or_default().push(component(own, d.name.clone(), d.unit));
                }
            }
            continue;
        };
        match bodies.last_mut().filter(|(name, _)| name == body) {
            Some((_, of)) => of.push(i),
            None => bodies.push((body.clone(), vec![i])),
        }
    }
    let whole = |of: &[usize]| of.iter().all(|i| !selected.contains(i)) && values[of[0]] > 0.0;
    let in_proportion = |of: &[usize]| of.iter().map(|&i| (decls[i].name.clone(), values[i])).collect::<Vec<_>>();
    let mut owners: BTreeMap<String, Vec<(String, f64)>> = BTreeMap::new();
    for (body, of) in &bodies {
        if !whole(of) {
            let rest = of.iter().filter(|i| !selected.contains(i));
            out.extend(rest.map(|&i| {
                let d = &decls[i];
                Hypothesis::one(d.name.clone(), format!("another {}", d.name), d.name.clone(), d.unit)
            }));
            continue;
        }
        let prefix = decls[of[0]].name.trim_end_matches(".mass").to_owned();
        let all = in_proportion(of);
        if let Some((owner, _)) = body.split_once('.') {
            owners.entry(owner.to_owned()).or_default().extend(all.iter().cloned());
        }
        let scaled = vec![Component { name: String::new(), unit: "1".into(), of: all }];
        out.push(Hypothesis::new(
            format!("mass.{prefix}"),
            format!("a mass of {prefix} other than the mission's"),
            scaled,
        ));
        let numbers = |range: core::ops::Range<usize>, unit: &str| -> Vec<Component> {
            let name = |i: usize| decls[of[i]].name.rsplit(['.', '_']).next().unwrap_or_default().to_owned();
            range.map(|i| component(&name(i), decls[of[i]].name.clone(), unit)).collect()
        };
        let moments = numbers(1..4, "kg m");
        out.push(Hypothesis::new(
            format!("centre-of-mass.{prefix}"),
            format!("another centre of mass of {prefix}"),
            moments,
        ));
        let inertia = numbers(4..10, "kg m^2");
        out.push(Hypothesis::new(format!("inertia.{prefix}"), format!("another inertia of {prefix}"), inertia));
    }
    // An appendage of which nothing but bodies is right.
    for (owner, all) in parts.into_iter().filter(|p| p.1.len() > 1) {
        out.push(Hypothesis::new(format!("parameters.{owner}"), format!("other parameters of {owner}"), all));
    }
    // An appendage of several bodies that was weighed as one.
    for (owner, all) in owners {
        if all.len() > 10 {
            let scaled = vec![Component { name: String::new(), unit: "1".into(), of: all }];
            let words = format!("a mass of all of {owner} other than the mission's");
            out.push(Hypothesis::new(format!("mass.{owner}"), words, scaled));
        }
    }
    out
}

/// Options of an estimator that has the columns of everything that is tried, beside those of the fit.
pub fn with_every_column(model: &Model, options: &Options) -> Options {
    Options {
        gyro_bias: true,
        torque_bias: true,
        initial_state: true,
        torque_delay: true,
        gyro_delay: true,
        kinematics: model.kinematic_params().into_iter().map(|p| p.name).collect(),
        errors: ErrorSource::all(model.nj()),
        ..options.clone()
    }
}
