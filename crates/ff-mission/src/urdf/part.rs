//! Which part of a file becomes the robot: the whole, a named subtree, or what remains without frames that hold nothing.

use super::options::UrdfOptions;
use super::raw::RawRobot;
use ff_model::diagnostics::{list, nearest};
use ff_model::{Area, BaseKind, Problem, Problems};
use std::collections::{HashMap, HashSet};

/// Most trees of a file that are told apart: more are no frames that somebody left.
const MAX_TREES: usize = 100;

/// The links and joints that are used. What is left out of them by decision of the reader is a warning.
pub(super) fn used(whole: &RawRobot, options: &UrdfOptions, out: &mut Problems) -> Option<RawRobot> {
    let mut r = whole.clone();
    if let Some(root) = &options.subtree {
        if !r.links.iter().any(|l| l.name == *root) {
            let names = || r.links.iter().map(|l| l.name.as_str());
            let p =
                Problem::error(Area::Config, "Config::UnknownLink", "the root of the subtree does not exist").on(root);
            out.push(match nearest(root, names()) {
                Some(n) => p.hint(format!("did you mean {n}?")),
                None => p.hint(format!("links: {}", list(names(), 8))),
            });
            return None;
        }
        let keep = below(&r, root);
        retain(&mut r, &keep);
        let used: HashSet<String> = r.joints.iter().map(|j| j.name.clone()).collect();
        let left_out: HashSet<&str> =
            whole.joints.iter().map(|j| j.name.as_str()).filter(|n| !used.contains(*n)).collect();
        for j in &mut r.joints {
            j.follows_outside = j.mimic.as_ref().is_some_and(|m| left_out.contains(m.joint.as_str()));
        }
    }
    drop_frames(&mut r, out);
    drop_world(&mut r, options, out);
    Some(r)
}

/// Names of a link and of all that hang on it.
fn below(r: &RawRobot, root: &str) -> HashSet<String> {
    let mut children: HashMap<&str, Vec<&str>> = HashMap::new();
    for j in &r.joints {
        children.entry(j.parent.0.as_str()).or_default().push(j.child.0.as_str());
    }
    let (mut found, mut open) = (HashSet::from([root.to_owned()]), vec![root]);
    while let Some(link) = open.pop() {
        for &c in children.get(link).into_iter().flatten() {
            if found.insert(c.to_owned()) {
                open.push(c);
            }
        }
    }
    found
}

/// Keeps these links, and the joints between them.
fn retain(r: &mut RawRobot, keep: &HashSet<String>) {
    r.links.retain(|l| keep.contains(&l.name));
    r.joints.retain(|j| keep.contains(&j.parent.0) && keep.contains(&j.child.0));
}

/// True for links without mass between which nothing moves.
fn mere_frames(r: &RawRobot, links: &HashSet<String>) -> bool {
    let massless = |l: &super::raw::RawLink| !l.unsure && l.inertial.as_ref().is_none_or(|(i, _)| i.is_zero());
    r.links.iter().filter(|l| links.contains(&l.name)).all(massless)
        && r.joints.iter().filter(|j| links.contains(&j.parent.0) && links.contains(&j.child.0)).all(|j| !j.moves())
}

/// Links that no joint names as its child.
fn roots(r: &RawRobot) -> Vec<String> {
    let children: HashSet<&str> = r.joints.iter().map(|j| j.child.0.as_str()).collect();
    r.links.iter().filter(|l| !children.contains(l.name.as_str())).map(|l| l.name.clone()).collect()
}

/// Of several trees, those that are mere frames go, if one that is more remains.
fn drop_frames(r: &mut RawRobot, out: &mut Problems) {
    let roots = roots(r);
    // With a wrong name the links below look like roots: that is for the graph to report.
    let known: HashSet<&str> = r.links.iter().map(|l| l.name.as_str()).collect();
    let whole = r.joints.iter().all(|j| known.contains(j.parent.0.as_str()) && known.contains(j.child.0.as_str()));
    if !(2..=MAX_TREES).contains(&roots.len()) || !whole || known.len() < r.links.len() {
        return;
    }
    let trees: Vec<(String, HashSet<String>)> = roots.into_iter().map(|n| (n.clone(), below(r, &n))).collect();
    let (frames, robots): (Vec<_>, Vec<_>) = trees.into_iter().partition(|(_, t)| mere_frames(r, t));
    let [(_, keep)] = robots.as_slice() else { return };
    if let Some((name, _)) = frames.first() {
        let line = r.links.iter().find(|l| l.name == *name).map_or(0, |l| l.line);
        let names = list(frames.iter().map(|(n, _)| n.as_str()), 6);
        out.push(
            Problem::warning(
                Area::Model,
                "Urdf::MultipleRoots",
                format!("no joint connects {names}: left out, a mere frame"),
            )
            .at_line(line)
            .on(format!("link {name}"))
            .hint("connect it by a fixed joint, or remove it"),
        );
        retain(r, keep);
    }
}

/// A world of mere frames from which the robot hangs by a joint that is free: the robot is what hangs there, and its base floats by itself.
fn drop_world(r: &mut RawRobot, options: &UrdfOptions, out: &mut Problems) {
    if options.base_kind != BaseKind::Floating || roots(r).len() != 1 {
        return;
    }
    let all: HashSet<String> = r.links.iter().map(|l| l.name.clone()).collect();
    let free = r.joints.iter().filter(|j| matches!(j.kind.as_str(), "floating" | "planar")).find_map(|j| {
        let keep = below(r, &j.child.0);
        let world: HashSet<String> = all.difference(&keep).cloned().collect();
        let named = options.base_link.as_ref().is_some_and(|b| world.contains(b));
        (!world.is_empty() && !named && mere_frames(r, &world)).then(|| (keep, j.clone()))
    });
    let Some((keep, j)) = free else { return };
    if j.kind == "planar" {
        out.push(
            Problem::warning(
                Area::Model,
                "Urdf::Unsupported",
                "joins the robot to a world in a plane; taken to float freely",
            )
            .at_line(j.line)
            .on(format!("joint {}", j.name))
            .hint("set base = \"fixed\" in [robot] if it does not"),
        );
    }
    retain(r, &keep);
}
