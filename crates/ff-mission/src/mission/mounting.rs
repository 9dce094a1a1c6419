//! What hangs on the robot comes onto its model: lifted parts of the tree, clients, appendages.

use super::appendage::{Draft, Kinds};
use super::client::Client;
use super::frames::Frames;
use super::lift;
use super::reader::{Table, error};
use super::robot::Robot;
use ff_model::Model;

/// Makes the appendages that are lifted out of the tree, and the tree without them.
pub(super) fn lift_all(drafts: &mut [Draft<'_, '_>], tree: Model, kinds: &Kinds<'_>) -> Model {
    let mut lifted: Vec<usize> = Vec::new();
    for d in drafts.iter_mut().filter(|d| d.lift.is_some()) {
        let Some(bodies) = d.lift(&tree, kinds) else { continue };
        if let Some(&b) = bodies.iter().find(|b| lifted.contains(b)) {
            let name = &tree.bodies()[b - 1].joint.name;
            let p = error("Config::Conflict", format!("joint {name} is lifted by another appendage as well"));
            d.table.fail("lift", p.hint("name it once"));
            d.appendage = None;
        }
        lifted.extend(bodies);
    }
    if lifted.is_empty() { tree } else { lift::without(&tree, &lifted).0 }
}

/// Gives a client its frame; false when it could not, with the problems recorded at its table.
pub(super) fn hold(model: &mut Model, client: Option<&Client>, robot: &Robot, t: &Table<'_, '_>) -> bool {
    let Some(c) = client else { return false };
    if model.frame(&c.name).is_some() || c.name == "base" {
        let p = error("Config::DuplicateName", format!("'{}' is the name of a link as well", c.name));
        t.fail("name", p.hint("rename the client"));
        return false;
    }
    let Some(host) = c.host.as_ref().or(robot.end_effector.as_ref()) else {
        let p = error("Config::MissingKey", "no link holds the client: neither host nor robot.end_effector is given");
        t.fail("host", p.hint("add host = ..., or end_effector = ... in [robot]"));
        return false;
    };
    let Some(k) = Frames(model).find(host, "host", t) else { return false };
    let (body, pose) = (model.frames()[k].body, model.frames()[k].placement * c.mount.to_xform());
    model.add_frame(c.name.as_str(), body, pose);
    true
}

/// Mounts the body of a client on its frame.
pub(super) fn mount_client(model: &mut Model, frames: &Frames<'_>, client: Option<&Client>, t: &Table<'_, '_>) {
    let Some((c, f)) = client.and_then(|c| Some((c, frames.0.frame(&c.name)?))) else { return };
    let Some(payload) = c.payload(t) else { return };
    if let Err(problems) = model.mount(c.name.as_str(), f.body, f.placement, payload) {
        problems.0.into_iter().for_each(|p| t.fail("name", p));
    }
}

/// Mounts one appendage; false when it could not be, with the problems recorded at its table.
pub(super) fn mount(model: &mut Model, frames: &Frames<'_>, d: &Draft<'_, '_>) -> bool {
    let t = &d.table;
    if d.host.is_some() && d.host == d.name {
        let p = error("Config::UnknownFrame", "an appendage cannot hang on itself");
        t.fail("host", p.hint("name a link of the URDF as host"));
        return false;
    }
    // Parameters of bodies are called `base.mass` and `<link>.mass`.
    let taken = |n: &&String| *n == "base" || (0..model.n_bodies()).any(|i| model.body_name(i) == *n);
    if let Some(n) = d.name.as_ref().filter(taken) {
        let p = error("Config::DuplicateName", format!("'{n}' is the name of a body as well"));
        t.fail("name", p.hint("rename the appendage"));
        return false;
    }
    let frame = d.host.as_ref().and_then(|h| frames.find(h, "host", t)).map(|k| &frames.0.frames()[k]);
    let (Some(f), Some(spec), Some(a)) = (frame, d.spec(), &d.appendage) else { return false };
    let pose = f.placement * spec.mount.to_xform();
    match model.mount(spec.name.as_str(), f.body, pose, a.clone()) {
        Ok(()) => true,
        Err(problems) => {
            for p in problems.0 {
                let prefix = format!("{}.", spec.name);
                let key = p.object.as_deref().and_then(|o| o.strip_prefix(&prefix)).unwrap_or("name").to_owned();
                t.fail_at(t.place(&key), p);
            }
            false
        }
    }
}
