//! `lift`: joints of the URDF that are hinges of a panel, taken out of the tree and made the segments of an appendage.
//!
//! The lifted bodies leave the tree with their links and joints. Segment frames of an appendage are parallel to the mount
//! when all hinges are at zero, while URDF frames may be turned: with `R_i` the rotation of joint frame `i` in the first,
//! hinge positions, axes, centres of mass and inertias are turned by `R_i`. The mount is the first joint frame.

use super::reader::{Table, error};
use ff_model::Xform;
use ff_model::diagnostics::{clip, list, nearest};
use ff_model::tree::JointImpedance;
use ff_model::{JointKind, Model};
use nalgebra::{Matrix3, Vector3};
use toml::Value;

/// Settings with one number per joint that go to the segments.
const PER_JOINT: [&str; 3] = [STIFFNESS, DAMPING, REST];
const STIFFNESS: &str = "stiffness_nm_per_rad";
const DAMPING: &str = "damping_nms_per_rad";
const REST: &str = "rest_rad";

/// Indices of the bodies carried by the named joints, from the host outwards; `None` where a problem is recorded.
pub(super) fn chain(model: &Model, joints: &[String], t: &Table<'_, '_>) -> Option<Vec<usize>> {
    let mut bodies: Vec<usize> = Vec::with_capacity(joints.len());
    let mut good = !joints.is_empty();
    if !good {
        t.fail("lift", error("Config::Param", "no joints").hint("name the joints from the host outwards"));
    }
    for name in joints {
        let names = || model.bodies().iter().map(|b| b.joint.name.as_str());
        match model.bodies().iter().position(|b| b.joint.name == *name) {
            Some(k) => bodies.push(k + 1),
            None => {
                let p = error("Config::UnknownJoint", format!("the robot has no moving joint '{}'", clip(name)));
                t.fail(
                    "lift",
                    match nearest(name, names()) {
                        Some(n) => p.hint(format!("did you mean {n}?")),
                        None => p.hint(format!("joints: {}", list(names(), 12))),
                    },
                );
                good = false;
            }
        }
    }
    if !good {
        return None;
    }
    for (i, &b) in bodies.iter().enumerate() {
        let body = &model.bodies()[b - 1];
        let (name, what) = (&body.joint.name, "lift");
        if body.joint.kind == JointKind::Prismatic {
            let p = error("Config::NotAHinge", format!("joint {name} slides"));
            t.fail(what, p.hint("lift revolute and continuous joints only"));
            good = false;
        }
        if i > 0 && body.parent != bodies[i - 1] {
            let p = error("Config::NotAChain", format!("joint {name} does not hang on the link of {}", joints[i - 1]));
            t.fail(what, p.hint("name the joints of one chain from the host outwards"));
            good = false;
        }
        // A child that is lifted out of its order has been reported as that.
        let children = (1..).zip(model.bodies()).filter(|(_, o)| o.parent == b);
        for (_, other) in children.filter(|(k, _)| !bodies.contains(k)) {
            let p = error(
                "Config::NotAChain",
                format!("joint {} hangs on the lifted link {}", other.joint.name, body.name),
            );
            t.fail(what, p.hint("a panel is a chain without branches; lift the branch as well, or none"));
            good = false;
        }
        if body.inertia.com().is_none() {
            let p = error("Config::Inertia", format!("link {} has no mass", body.name));
            t.fail(what, p.hint("a panel segment needs mass"));
            good = false;
        }
    }
    good.then_some(bodies)
}

/// The table of the appendage: `settings` with the bodies as `segments`; lists of one number per joint go to these.
/// `None` where a problem is recorded.
pub(super) fn table(model: &Model, bodies: &[usize], settings: &toml::Table, t: &Table<'_, '_>) -> Option<toml::Table> {
    let mut rest = settings.clone();
    if rest.contains_key("segments") {
        let p = error("Config::Conflict", "both lift and segments are given");
        t.fail("segments", p.hint("the segments are those of the lifted links"));
        return None;
    }
    let mut segments = Vec::with_capacity(bodies.len());
    let mut turn = Matrix3::identity();
    for (i, &b) in bodies.iter().enumerate() {
        let body = &model.bodies()[b - 1];
        // The first joint frame is the mount.
        let hinge = if i == 0 { Vector3::zeros() } else { turn * body.joint.placement.pos };
        if i > 0 {
            turn *= body.joint.placement.rot;
        }
        let com = turn * body.inertia.com()?;
        let j = turn * body.inertia.about_com() * turn.transpose();
        let array = |x: &[f64]| Value::Array(x.iter().map(|&x| Value::Float(x)).collect());
        let mut s = toml::Table::new();
        s.insert("mass_kg".into(), Value::Float(body.inertia.mass));
        s.insert("com_m".into(), array(com.as_slice()));
        let six = [j[(0, 0)], j[(0, 1)], j[(0, 2)], j[(1, 1)], j[(1, 2)], j[(2, 2)]];
        s.insert("inertia_com_kgm2".into(), array(&six));
        s.insert("hinge_m".into(), array(hinge.as_slice()));
        s.insert("hinge_axis".into(), array((turn * body.joint.axis).as_slice()));
        segments.push(s);
    }
    // Springs and dampers that the description gives are those of the hinges, where the mission is silent and all hinges have one.
    let given = |of: fn(&JointImpedance) -> f64| -> Option<Vec<f64>> {
        let all = bodies.iter().map(|&b| of(&model.bodies()[b - 1].impedance));
        all.map(|x| (x > 0.0).then_some(x)).collect()
    };
    let springs = given(|i| i.stiffness);
    // A rest position belongs to its spring.
    let rests = springs.is_some() && !rest.contains_key(STIFFNESS) && !rest.contains_key(REST);
    let at = bodies.iter().map(|&b| model.bodies()[b - 1].impedance.rest).collect();
    for (key, values) in [(STIFFNESS, springs), (DAMPING, given(|i| i.viscous)), (REST, rests.then_some(at))] {
        if let Some(values) = values.filter(|_| !rest.contains_key(key)) {
            rest.insert(key.into(), Value::Array(values.into_iter().map(Value::Float).collect()));
        }
    }
    let mut good = true;
    for key in PER_JOINT {
        // A matrix of couplings stays where it is.
        let Some(Value::Array(values)) = rest.get(key).filter(|v| !nested(v)) else { continue };
        if values.len() == segments.len() {
            segments.iter_mut().zip(values).for_each(|(s, v)| _ = s.insert(key.into(), v.clone()));
            rest.remove(key);
        } else {
            let what = format!("{} numbers for {} lifted joints", values.len(), segments.len());
            t.fail(key, error("Config::WrongLength", what).hint("give one number per joint"));
            good = false;
        }
    }
    rest.insert("segments".into(), Value::Array(segments.into_iter().map(Value::Table).collect()));
    good.then_some(rest)
}

fn nested(v: &Value) -> bool {
    v.as_array().is_some_and(|a| a.iter().any(Value::is_array))
}

/// The model without the lifted bodies and their frames, and the new index of every body that stays. Allocates.
pub(super) fn without(model: &Model, lifted: &[usize]) -> (Model, Vec<Option<usize>>) {
    let mut new = Model::new(model.name(), model.body_name(0), *model.inertia(0), model.base_kind());
    let mut index = vec![Some(0)];
    for (k, b) in model.bodies().iter().enumerate() {
        // The children of a lifted body are lifted, too (`chain`), so the parent of one that stays has its index.
        let parent = index[b.parent].filter(|_| !lifted.contains(&(k + 1)));
        let body = parent.map(|p| new.add_body(p, b.name.as_str(), b.joint.clone(), b.inertia));
        body.into_iter().for_each(|body| new.set_impedance(body, b.impedance));
        index.push(body);
    }
    for (body, followed) in model.followers() {
        // No joint follows one that is lifted, nor is a follower lifted (`urdf::follow`).
        let driver = model.own_body(followed.index);
        let at = |joint: &str| index[model.bodies().iter().position(|b| b.joint.name == joint)? + 1];
        if let (Some(f), Some(d)) = (at(&body.joint.name), at(&driver.joint.name)) {
            _ = new.couple(f, d, followed.multiplier, followed.offset);
        }
    }
    for f in model.frames() {
        if let Some(body) = index[f.body].filter(|_| new.frame(&f.name).is_none()) {
            new.add_frame(f.name.as_str(), body, f.placement);
        }
    }
    (new.with_gravity(*model.gravity()), index)
}

/// Body that carries the first lifted one, and the pose of its joint there: host and mount.
pub(super) fn seat(model: &Model, first: usize) -> (usize, Xform<f64>) {
    let b = &model.bodies()[first - 1];
    (b.parent, b.joint.placement)
}
