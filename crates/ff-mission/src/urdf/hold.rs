//! Which joints stay where they are: those that the user locks, those that follow one that does ([`super::follow`]), those that carry
//! nothing.
//!
//! A held joint is a fixed one at its position: what it carries becomes part of the body that it hangs on.

use super::follow::{self, Follower};
use super::graph::Tree;
use super::options::UrdfOptions;
use super::raw::{RawJoint, RawRobot};
use ff_model::diagnostics::{Limit, clip, list, nearest};
use ff_model::spatial::so3::{exp_so3, quat_to_rot};
use ff_model::tree::matches;
use ff_model::{Area, Inertia, Problem, Problems, Xform};
use nalgebra::Vector3;

/// An inertia about the joint axis of this share of the trace is what rounding leaves of zero.
const NOTHING: f64 = 1e-12;

/// What was decided on every joint.
#[derive(Debug)]
pub(super) struct Held {
    /// Position of every joint that is held (rad or m); `None` for one that moves and for one that is fixed anyway.
    pub(super) at: Vec<Option<f64>>,
    /// What a joint follows that has no coordinate of its own.
    pub(super) follows: Vec<Option<Follower>>,
}

impl Held {
    /// Nothing is held: for a file whose tree could not be told.
    pub(super) fn none(r: &RawRobot) -> Self {
        Self { at: vec![None; r.joints.len()], follows: vec![None; r.joints.len()] }
    }
    /// True for a joint that adds a body: one that moves by itself or follows one that does.
    pub(super) fn moves(&self, r: &RawRobot, joint: usize) -> bool {
        r.joints[joint].moves() && self.at[joint].is_none()
    }
    /// Pose of the child link of a joint in the parent link: at its position if held, at zero if not.
    pub(super) fn pose(&self, r: &RawRobot, joint: usize) -> Xform<f64> {
        let j = &r.joints[joint];
        let at = super::convert::xform(&j.origin);
        let (Some(q), Some(axis)) = (self.at[joint], Vector3::from(j.axis.0).try_normalize(1e-12)) else { return at };
        match j.kind.as_str() {
            "prismatic" => at * Xform::new(nalgebra::Matrix3::identity(), axis * q),
            "revolute" | "continuous" => at * Xform::new(quat_to_rot(&exp_so3(&(axis * q))), Vector3::zeros()),
            _ => at,
        }
    }
}

/// Decides on every joint; what was assumed is a warning, a lock that cannot be is an error.
pub(super) fn settle(r: &RawRobot, tree: &Tree, options: &UrdfOptions, out: &mut Problems) -> Held {
    let mut held = Held::none(r);
    let named = lock(r, options, &mut held, out);
    let mass = carried_mass(r, tree);
    follow::settle(r, |k| mass[tree.child[k]], &named, options, &mut held, out);
    other_kinds(r, tree, &mass, &mut held, out);
    massless(r, tree, options, &mut held, out);
    held
}

/// Zero, or the limit next to it.
pub(super) fn nominal(j: &RawJoint) -> f64 {
    if j.kind == "continuous" {
        return 0.0;
    }
    let of = |x: Option<f64>| x.unwrap_or(0.0);
    j.limit.filter(|l| of(l.lower) <= of(l.upper)).map_or(0.0, |l| 0.0_f64.max(of(l.lower)).min(of(l.upper)))
}

/// Holds what the user locks; which joints he named.
fn lock(r: &RawRobot, options: &UrdfOptions, held: &mut Held, out: &mut Problems) -> Vec<bool> {
    let mut named = vec![false; r.joints.len()];
    let unknown = |pattern: &str, what: String| {
        let names = || r.joints.iter().filter(|j| j.moves()).map(|j| j.name.as_str());
        let p = Problem::error(Area::Config, "Config::UnknownJoint", what).on(pattern);
        match nearest(pattern, names()) {
            Some(n) => p.hint(format!("did you mean {n}?")),
            None => p.hint(format!("joints: {}", list(names(), 12))),
        }
    };
    for pattern in &options.lock {
        let mut any = false;
        for (k, j) in r.joints.iter().enumerate().filter(|(_, j)| j.moves() && matches(pattern, &j.name)) {
            (any, named[k]) = (true, true);
            held.at[k] = Some(nominal(j));
        }
        if !any {
            out.push(unknown(pattern, format!("'{}' fits no joint that moves", clip(pattern))));
        }
    }
    for (name, &q) in &options.lock_at {
        let Some(k) = r.joints.iter().position(|j| j.moves() && j.name == *name) else {
            out.push(unknown(name, format!("the robot has no moving joint '{}'", clip(name))));
            continue;
        };
        let j = &r.joints[k];
        let range = j.limit.filter(|_| j.kind != "continuous").and_then(|l| Some((l.lower?, l.upper?)));
        if let Some((lower, upper)) = range.filter(|(a, b)| a <= b && !(*a..=*b).contains(&q)) {
            let unit = if j.kind == "prismatic" { "m" } else { "rad" };
            let what = format!("joint {name} locked at {q} {unit}, limit {lower} to {upper} {unit}");
            out.push(
                Problem::error(Area::Config, "Config::OutOfRange", what)
                    .violating(q, Limit::Within(lower, upper), unit)
                    .on(name)
                    .hint("lock it within its limits"),
            );
        }
        named[k] = true;
        held.at[k] = Some(q);
    }
    named
}

/// Whether a link or anything that hangs on it has mass or inertia.
fn carried_mass(r: &RawRobot, tree: &Tree) -> Vec<bool> {
    let mut has: Vec<bool> =
        r.links.iter().map(|l| l.unsure || l.inertial.as_ref().is_some_and(|(i, _)| !i.is_zero())).collect();
    for &j in tree.order.iter().rev() {
        has[tree.parent[j]] |= has[tree.child[j]];
    }
    has
}

/// Planar, floating and spherical joints can be held, where nothing depends on it; those that carry mass are refused where joints are
/// judged.
fn other_kinds(r: &RawRobot, tree: &Tree, mass: &[bool], held: &mut Held, out: &mut Problems) {
    for (k, j) in r.joints.iter().enumerate() {
        if super::physics::is_other_kind(&j.kind) && held.moves(r, k) && !mass[tree.child[k]] {
            held.at[k] = Some(0.0);
            let what = format!("type '{}' is not supported; held at its origin, as it carries no mass", j.kind);
            out.push(
                Problem::warning(Area::Model, "Urdf::Unsupported", what)
                    .at_line(j.line)
                    .on(format!("joint {}", j.name))
                    .hint("name it in lock of [robot] to confirm"),
            );
        }
    }
}

/// Holds joints that nothing resists: no force accelerates what they carry, and no other body notices how they stand.
fn massless(r: &RawRobot, tree: &Tree, options: &UrdfOptions, held: &mut Held, out: &mut Problems) {
    // About the frame of each link, what is fixed to it included; whether a joint further out moves.
    let own =
        |l: &super::raw::RawLink| l.inertial.as_ref().map_or_else(Inertia::zero, |(i, _)| super::convert::inertia(i));
    let mut carried: Vec<Inertia<f64>> = r.links.iter().map(own).collect();
    let mut open = vec![false; r.links.len()];
    // What a joint and its followers carry resists them together.
    let mut together: Vec<bool> = held.follows.iter().map(Option::is_some).collect();
    held.follows.iter().flatten().for_each(|f| together[f.head] = true);
    for &j in tree.order.iter().rev() {
        let (joint, child, parent) = (&r.joints[j], tree.child[j], tree.parent[j]);
        if held.moves(r, j) && !open[child] && !together[j] && !super::physics::is_other_kind(&joint.kind) {
            let link = &r.links[child];
            let i = &carried[child];
            let (what, unit, x) = match (joint.kind.as_str(), Vector3::from(joint.axis.0).try_normalize(1e-12)) {
                ("prismatic", _) => ("mass", "kg", i.mass),
                // Without an axis, which is reported elsewhere, any inertia will do.
                (_, None) => ("inertia", "kg m^2", i.rot.trace()),
                (_, Some(a)) => ("inertia about its joint axis", "kg m^2", a.dot(&(i.rot * a))),
            };
            let lifted = options.lifted.contains(&joint.name);
            if x.abs() <= NOTHING * i.rot.trace() && !lifted && !link.unsure {
                let q = nominal(joint);
                held.at[j] = Some(q);
                let place = |code, what: String, line| {
                    let p = Problem::warning(Area::Model, code, what).at_line(line).on(format!("link {}", link.name));
                    p.hint(format!("give mass and inertia, or name joint {} in lock of [robot] to confirm", joint.name))
                };
                out.push(match &link.inertial {
                    None => {
                        let what = format!("has no <inertial>: nothing resists joint {}, which is held", joint.name);
                        place("Urdf::NoInertial", what, link.line)
                    }
                    Some((_, line)) => {
                        let what = format!("{what} {x} {unit}, limit > 0 {unit}: joint {} is held", joint.name);
                        place("Urdf::MasslessLeaf", what, *line).violating(x, Limit::Above(0.0), unit)
                    }
                });
            }
        }
        if held.moves(r, j) {
            open[parent] = true;
        } else {
            let pose = held.pose(r, j);
            let i = carried[child].to_parent(&pose);
            carried[parent] += i;
            open[parent] |= open[child];
        }
    }
}
