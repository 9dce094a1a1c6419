//! Could these numbers be a robot? Inertias, axes, limits, and values that look like the wrong unit.

use super::raw::{RawInertial, RawJoint, RawLink, RawRobot};
use ff_model::Inertia;
use ff_model::diagnostics::Limit;
use ff_model::spatial::InertiaError;
use ff_model::{Area, Problem, Problems};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Joint types the importer turns into bodies or merges.
const TYPES: [&str; 4] = ["revolute", "continuous", "prismatic", "fixed"];
/// Joint types that exist in URDF and are no single degree of freedom.
const OTHER_TYPES: [&str; 3] = ["floating", "planar", "spherical"];
/// Limits of joints that turn several times are within this (rad); in degrees they are beyond it.
const SEVERAL_TURNS: f64 = 3.2 * TAU;
/// Numbers beyond this stand for "no limit" (rad).
const UNLIMITED: f64 = 1e3;
/// How far an axis may be from unit length before it is worth a warning.
const AXIS_TOLERANCE: f64 = 1e-6;

fn err(code: &'static str, message: impl Into<String>) -> Problem {
    Problem::error(Area::Model, code, message)
}
fn warn(code: &'static str, message: impl Into<String>) -> Problem {
    Problem::warning(Area::Model, code, message)
}

/// A link whose inertia no body has: whether that matters depends on the body that it becomes part of.
#[derive(Debug)]
pub(super) struct Doubt {
    /// Index of the link.
    pub(super) link: usize,
    /// The problem, as the error that it is if it matters.
    pub(super) problem: Problem,
}

/// Every check of a link on its own. Returns the links with an inertia that no body has; a negative mass is never right.
pub(super) fn links(r: &RawRobot, out: &mut Problems) -> Vec<Doubt> {
    let mut doubts = Vec::new();
    for (k, l) in r.links.iter().enumerate().filter(|(_, l)| !l.unsure) {
        if let Some((i, line)) = &l.inertial {
            degrees(&i.origin.rpy, TAU + 1e-3, &format!("link {}", l.name), *line, out);
            match inertial(l, i, *line) {
                Some(problem) if problem.code != "Urdf::NotFinite" && i.mass >= 0.0 => {
                    doubts.push(Doubt { link: k, problem });
                }
                Some(problem) => out.push(problem),
                None => {}
            }
        }
    }
    doubts
}

/// Every check of a joint on its own; of one that does not move only where it stands. `settled`: the limits of this joint do not matter.
pub(super) fn joints(
    r: &RawRobot,
    moves: impl Fn(usize) -> bool,
    follows: impl Fn(usize) -> bool,
    settled: impl Fn(&str) -> bool,
    out: &mut Problems,
) {
    for (k, j) in r.joints.iter().enumerate() {
        joint(j, moves(k), follows(k), settled(&j.name), out);
    }
}

fn inertial(l: &RawLink, i: &RawInertial, line: usize) -> Option<Problem> {
    // A link without any mass is legal between joints (the cross of a universal joint) and as a pure frame.
    if i.is_zero() {
        return None;
    }
    // About the centre of mass, where URDF gives it: shifting to the link origin would round.
    let body = Inertia::from_com(i.mass, &Vector3::zeros(), &i.matrix());
    // Programs that write moments as differences leave some -1e-20: nothing against a micrometre of the mass.
    let rounding = 1e-9 * (i.matrix().trace().abs() + i.mass * (i.com().norm_squared() + 1e-6));
    let problem = match body.check() {
        Ok(()) => return None,
        Err(InertiaError::NotFinite { name: n }) => {
            err("Urdf::NotFinite", format!("{n} is not finite")).hint("give finite numbers")
        }
        Err(InertiaError::NonPositiveMass { value }) => {
            err("Urdf::NonPositiveMass", format!("mass {value} kg, limit > 0 kg"))
                .violating(value, Limit::Above(0.0), "kg")
                .hint("give the mass in kg; a massless link has mass and inertia 0")
        }
        Err(InertiaError::NotPsd { moments } | InertiaError::Triangle { moments, .. })
            if moments[0] >= -rounding && moments[2] - moments[0] - moments[1] <= rounding =>
        {
            return None;
        }
        Err(InertiaError::NotPsd { moments }) => err(
            "Urdf::InertiaNotPsd",
            format!("principal moments {} kg m^2 about the centre of mass, limit >= 0 kg m^2", show(&moments)),
        )
        .violating(moments.iter().copied().fold(f64::INFINITY, f64::min), Limit::AtLeast(0.0), "kg m^2")
        .hint(cause(i)),
        Err(InertiaError::Triangle { moments, violation }) => err(
            "Urdf::Triangle",
            format!(
                "principal moments {} kg m^2: the largest exceeds the sum of the others by {} kg m^2, limit 0 kg m^2",
                show(&moments),
                six_digits(violation)
            ),
        )
        .violating(violation, Limit::AtMost(0.0), "kg m^2")
        .hint("no mass distribution has these; check the units and axes, or allow 'triangle'"),
    };
    Some(problem.at_line(line).on(format!("link {}", l.name)))
}

/// The likeliest reason for negative moments.
fn cause(i: &RawInertial) -> String {
    let c = i.com();
    if c.norm() == 0.0 {
        return "check signs and units of the six numbers".into();
    }
    format!(
        "with the centre of mass {:.3} m from the link origin a parallel-axis shift about the wrong point does this: \
         URDF wants the inertia about the centre of mass, not about the link origin",
        c.norm()
    )
}

fn show(m: &[f64; 3]) -> String {
    m.map(six_digits).join(", ")
}

/// Six decimals where these tell the number, and otherwise four digits of it.
fn six_digits(x: f64) -> String {
    if x == 0.0 || x.abs() >= 1e-3 { format!("{x:.6}") } else { format!("{x:.3e}") }
}

/// Density of the box with the same mass and moments; only for bodies that are not plates, rods or points.
pub(super) fn density(l: &RawLink, out: &mut Problems) {
    let Some((i, line)) = l.inertial.as_ref().filter(|(i, _)| i.mass > 0.0) else { return };
    let mut e: [f64; 3] = i.matrix().symmetric_eigenvalues().into();
    e.sort_by(f64::total_cmp);
    let sum = e[0] + e[1] + e[2];
    // Box edges from the principal moments: a_i^2 = (6 / m) (sum - 2 I_i).
    let edges = e.map(|x| (6.0 / i.mass * (sum - 2.0 * x)).max(0.0).sqrt());
    let (min, max) = (edges.iter().copied().fold(f64::INFINITY, f64::min), edges.iter().copied().fold(0.0, f64::max));
    let volume = edges[0] * edges[1] * edges[2];
    let rho = i.mass / volume;
    if min > 0.01 * max && !(1.0..=30_000.0).contains(&rho) {
        out.push(
            warn(
                "Urdf::ImplausibleScale",
                format!("mass and inertia make a box of {max:.3} m with density {rho:.3e} kg/m^3, expected 1 to 30000 kg/m^3"),
            )
            .at_line(*line)
            .on(format!("link {}", l.name))
            .hint("URDF is in kg, m and kg m^2; check for mm or g"),
        );
    }
}

/// Angles beyond `limit` that are usually degrees (rad).
fn degrees(angles: &[f64], limit: f64, object: &str, line: usize, out: &mut Problems) {
    // One message per element, for the largest.
    let largest = angles.iter().max_by(|a, b| a.abs().total_cmp(&b.abs()));
    if let Some(a) = largest.filter(|a| a.abs() > limit && a.abs() <= UNLIMITED) {
        out.push(
            warn("Urdf::LooksLikeDegrees", format!("angle {a} rad, more than a turn ({TAU:.4} rad)"))
                .at_line(line)
                .on(object)
                .hint("URDF angles are in rad"),
        );
    }
}

/// True for a joint type of URDF that is no single degree of freedom.
pub(super) fn is_other_kind(kind: &str) -> bool {
    OTHER_TYPES.contains(&kind)
}

fn joint(j: &RawJoint, moves: bool, follows: bool, settled: bool, out: &mut Problems) {
    let name = format!("joint {}", j.name);
    degrees(&j.origin.rpy, TAU + 1e-3, &name, j.origin_line, out);
    match j.kind.as_str() {
        // Absent: reported by the strict pass.
        "" => return,
        k if TYPES.contains(&k) => {}
        k if is_other_kind(k) => {
            if moves {
                let hint = match k {
                    "floating" => "the base floats by itself; hold the joint by lock = [\"...\"] in [robot]",
                    _ => "hold it by lock = [\"...\"] in [robot], or build it from revolute and prismatic joints",
                };
                let what = format!("type '{k}' is not supported, and the joint carries mass");
                out.push(err("Urdf::Unsupported", what).at_line(j.line).on(name).hint(hint));
            }
            return;
        }
        k => {
            let mut p = err(
                "Urdf::UnknownJointType",
                format!("unknown type '{}'; known: {}", ff_model::diagnostics::clip(k), TYPES.join(", ")),
            );
            p = match ff_model::diagnostics::nearest(k, TYPES) {
                Some(n) => p.hint(format!("did you mean {n}?")),
                None => p.hint("for a universal joint use two revolutes with a massless link between"),
            };
            out.push(p.at_line(j.line).on(name));
            return;
        }
    }
    if moves {
        axis(j, &name, out);
        if !settled {
            // Those of a follower only narrow those of the joint that it follows ([`super::follow::narrow`]).
            if !follows {
                limits(j, &name, out);
            }
            spring(j, name, out);
        }
    }
}

/// A joint on a spring that is left a driven one.
fn spring(j: &RawJoint, name: String, out: &mut Problems) {
    let k = j.impedance.stiffness;
    if k > 0.0 {
        let unit = if j.kind == "prismatic" { "N/m" } else { "N m/rad" };
        let what = format!("stiffness {k} {unit} has no part in the motion of a joint that is driven");
        let p = warn("Urdf::Spring", what).at_line(j.line).on(name);
        out.push(p.hint("lift the joint into an appendage, which takes spring and damper over"));
    }
}

fn axis(j: &RawJoint, name: &str, out: &mut Problems) {
    let (xyz, line) = j.axis;
    let n = Vector3::from(xyz).norm();
    if n < 1e-12 {
        out.push(
            err("Urdf::ZeroAxis", format!("axis length {n}, expected 1"))
                .at_line(line)
                .on(name)
                .hint("give a direction such as 0 0 1"),
        );
    } else if (n - 1.0).abs() > AXIS_TOLERANCE {
        out.push(
            warn("Urdf::AxisNotUnit", format!("axis length {n}, expected 1 within {AXIS_TOLERANCE:e}; normalised"))
                .at_line(line)
                .on(name)
                .hint("write a unit vector"),
        );
    }
}

fn limits(j: &RawJoint, name: &str, out: &mut Problems) {
    let revolute = j.kind != "prismatic";
    let (u, speed, force) = if revolute { ("rad", "rad/s", "N m") } else { ("m", "m/s", "N") };
    let Some(l) = j.limit else {
        if j.kind != "continuous" {
            out.push(
                warn("Urdf::NoLimits", "has no <limit>; taken as unlimited")
                    .at_line(j.line)
                    .on(name)
                    .hint("add <limit lower upper effort velocity>, or make it continuous"),
            );
        }
        return;
    };
    let bad = |message: String, hint: &str| err("Urdf::BadLimits", message).at_line(l.line).on(name).hint(hint);
    let undriven = l.effort == Some(0.0);
    if let Some(v) = l.velocity.filter(|v| *v == 0.0 && !undriven) {
        let what = format!("velocity limit {v} {speed}, limit > 0 {speed}; taken as unlimited");
        let p = warn("Urdf::BadLimits", what).violating(v, Limit::Above(0.0), speed);
        out.push(p.at_line(l.line).on(name).hint("give the greatest speed, or velocity_rad_per_s in [limits]"));
    }
    if let Some(v) = l.velocity.filter(|v| *v < 0.0) {
        let p = bad(format!("velocity limit {v} {speed}, limit > 0 {speed}"), "give the greatest speed of the joint");
        out.push(p.violating(v, Limit::Above(0.0), speed));
    }
    if let Some(e) = l.effort.filter(|e| *e < 0.0) {
        let p = bad(format!("effort limit {e} {force}, limit >= 0 {force}"), "give the greatest torque or force");
        out.push(p.violating(e, Limit::AtLeast(0.0), force));
    }
    if undriven {
        // Exporters of CAD programs write zeros where nobody gave a limit.
        let speed = if l.velocity == Some(0.0) { ", and so is the velocity limit, which is taken as none" } else { "" };
        let what = format!("effort limit 0 {force}: the joint cannot be driven{speed}");
        let p = warn("Urdf::NoEffort", what).at_line(l.line).on(name);
        out.push(p.hint("give the greatest torque or force; lift the joint if it swings on a spring"));
    }
    if j.kind == "continuous" {
        return;
    }
    match (l.lower, l.upper) {
        (Some(lo), Some(up)) if lo > up => {
            let p = bad(format!("lower {lo} {u} exceeds upper {up} {u}"), "swap them");
            out.push(p.violating(lo, Limit::AtMost(up), u));
        }
        (None, None) => out.push(
            warn("Urdf::NoLimits", "has neither lower nor upper limit; taken as unlimited")
                .at_line(l.line)
                .on(name)
                .hint("add lower and upper, or make it continuous"),
        ),
        (Some(_), Some(_)) => {}
        (lo, up) => {
            let (which, other) = if lo.is_none() { ("lower", up) } else { ("upper", lo) };
            let other = other.unwrap_or(0.0);
            // URDF reads an absent limit as zero; that is rarely what was meant, so it is not done in silence.
            let text = format!("{which} limit is absent and read as 0 {u} (the other is {other} {u})");
            if (which == "lower" && other < 0.0) || (which == "upper" && other > 0.0) {
                out.push(bad(format!("{text}: the range is empty"), "give both limits"));
            } else {
                out.push(warn("Urdf::NoLimits", text).at_line(l.line).on(name).hint("give both limits"));
            }
        }
    }
    if revolute {
        degrees(&[l.lower.unwrap_or(0.0), l.upper.unwrap_or(0.0)], SEVERAL_TURNS, name, l.line, out);
    }
}
