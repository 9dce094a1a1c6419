//! Could these numbers be a robot? Inertias, axes, limits, and values that look like the wrong unit.

use super::raw::{RawInertial, RawJoint, RawLink, RawRobot};
use ff_model::Inertia;
use ff_model::spatial::InertiaError;
use ff_model::{Area, Problem, Problems};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Joint types the importer turns into bodies or merges.
const TYPES: [&str; 4] = ["revolute", "continuous", "prismatic", "fixed"];
/// How far an axis may be from unit length before it is worth a warning.
const AXIS_TOLERANCE: f64 = 1e-6;

fn err(code: &'static str, message: impl Into<String>) -> Problem {
    Problem::error(Area::Model, code, message)
}
fn warn(code: &'static str, message: impl Into<String>) -> Problem {
    Problem::warning(Area::Model, code, message)
}

/// Every check of one link and one joint on its own.
pub(super) fn check(r: &RawRobot, out: &mut Problems) {
    for l in r.links.iter().filter(|l| !l.unsure) {
        if let Some((i, line)) = &l.inertial {
            inertial(l, i, *line, out);
        }
    }
    for j in &r.joints {
        joint(j, out);
    }
}

fn inertial(l: &RawLink, i: &RawInertial, line: usize, out: &mut Problems) {
    let name = format!("link {}", l.name);
    degrees(&i.origin.rpy, &name, line, out);
    // A link without any mass is legal between joints (the cross of a universal joint) and as a pure frame.
    if i.is_zero() {
        return;
    }
    // About the centre of mass, where URDF gives it: shifting to the link origin would round.
    let body = Inertia::from_com(i.mass, &Vector3::zeros(), &i.matrix());
    let problem = match body.check() {
        Ok(()) => None,
        Err(InertiaError::NotFinite { name: n }) => {
            Some(err("Urdf::NotFinite", format!("{n} is not finite")).hint("give finite numbers"))
        }
        Err(InertiaError::NonPositiveMass { value }) => Some(
            err("Urdf::NonPositiveMass", format!("mass {value} kg, limit > 0 kg"))
                .hint("give the mass in kg; a massless link has mass and inertia 0"),
        ),
        Err(InertiaError::NotPsd { moments }) => Some(
            err(
                "Urdf::InertiaNotPsd",
                format!("principal moments {} kg m^2 about the centre of mass, limit >= 0 kg m^2", show(&moments)),
            )
            .hint(cause(i)),
        ),
        Err(InertiaError::Triangle { moments, violation }) => Some(
            err(
                "Urdf::Triangle",
                format!(
                    "principal moments {} kg m^2: the largest exceeds the sum of the others by {violation:.6} kg m^2, limit 0 kg m^2",
                    show(&moments)
                ),
            )
            .hint("no mass distribution has these; check the units and axes, or allow 'triangle'"),
        ),
    };
    if let Some(p) = problem {
        out.push(p.at_line(line).on(name));
        return;
    }
    density(&name, i, line, out);
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
    format!("{:.6}, {:.6}, {:.6}", m[0], m[1], m[2])
}

/// Density of the box with the same mass and moments; only for bodies that are not plates, rods or points.
fn density(name: &str, i: &RawInertial, line: usize, out: &mut Problems) {
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
            .at_line(line)
            .on(name)
            .hint("URDF is in kg, m and kg m^2; check for mm or g"),
        );
    }
}

/// Angles beyond a full turn are usually degrees.
fn degrees(angles: &[f64], object: &str, line: usize, out: &mut Problems) {
    // One message per element, for the largest.
    let largest = angles.iter().max_by(|a, b| a.abs().total_cmp(&b.abs()));
    if let Some(a) = largest.filter(|a| a.abs() > TAU + 1e-3) {
        out.push(
            warn("Urdf::LooksLikeDegrees", format!("angle {a} rad, more than a turn ({TAU:.4} rad)"))
                .at_line(line)
                .on(object)
                .hint("URDF angles are in rad"),
        );
    }
}

fn joint(j: &RawJoint, out: &mut Problems) {
    let name = format!("joint {}", j.name);
    degrees(&j.origin.rpy, &name, j.origin_line, out);
    match j.kind.as_str() {
        // Absent: reported by the strict pass.
        "" => return,
        k if TYPES.contains(&k) => {}
        k @ ("floating" | "planar" | "spherical") => {
            let hint = match k {
                "floating" => "the base floats by itself: remove the joint and its parent link",
                _ => "build it from revolute and prismatic joints with massless links between",
            };
            out.push(
                err("Urdf::Unsupported", format!("type '{k}' is not supported")).at_line(j.line).on(name).hint(hint),
            );
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
    if j.moves() {
        axis(j, &name, out);
        limits(j, &name, out);
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
    let mut bad =
        |message: String, hint: &str| out.push(err("Urdf::BadLimits", message).at_line(l.line).on(name).hint(hint));
    if let Some(v) = l.velocity.filter(|v| *v <= 0.0) {
        bad(format!("velocity limit {v} {speed}, limit > 0 {speed}"), "give the greatest speed of the joint");
    }
    if let Some(e) = l.effort.filter(|e| *e < 0.0) {
        bad(format!("effort limit {e} {force}, limit >= 0 {force}"), "give the greatest torque or force");
    }
    if j.kind == "continuous" {
        return;
    }
    match (l.lower, l.upper) {
        (Some(lo), Some(up)) if lo > up => {
            bad(format!("lower {lo} {u} exceeds upper {up} {u}"), "swap them");
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
                bad(format!("{text}: the range is empty"), "give both limits");
            } else {
                out.push(warn("Urdf::NoLimits", text).at_line(l.line).on(name).hint("give both limits"));
            }
        }
    }
    if revolute {
        degrees(&[l.lower.unwrap_or(0.0), l.upper.unwrap_or(0.0)], name, l.line, out);
    }
    if l.effort == Some(0.0) {
        out.push(
            warn("Urdf::NoEffort", format!("effort limit 0 {force}: the joint cannot be driven"))
                .at_line(l.line)
                .on(name)
                .hint("give the greatest torque or force"),
        );
    }
}
