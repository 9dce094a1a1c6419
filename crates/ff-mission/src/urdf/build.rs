//! From a checked tree of links to bodies: links on fixed joints are merged into the body they are fixed to.

use super::UrdfOptions;
use super::graph::Tree;
use super::raw::{RawInertial, RawJoint, RawPose, RawRobot};
use ff_model::Inertia;
use ff_model::Xform;
use ff_model::diagnostics::{list, nearest};
use ff_model::spatial::so3::rot_of_rpy;
use ff_model::tree::JointLimits;
use ff_model::{Area, Problem, Problems};
use ff_model::{BaseKind, Joint, JointKind, Model};
use nalgebra::Vector3;

/// Greatest distance of a mass from the base that is believed (m).
const MAX_REACH: f64 = 100.0;

/// A body being assembled.
struct Group {
    /// Link that names the body.
    link: usize,
    /// Joint that carries it and parent body; `None` for the base.
    joint: Option<(usize, usize)>,
    inertia: Inertia<f64>,
    has_child: bool,
    /// Distance of the body frame from the base along the chain (m).
    reach: f64,
}

/// Builds the model; `None` when the base or a body cannot move as asked (problems say why).
pub(super) fn model(r: &RawRobot, tree: &Tree, options: &UrdfOptions, out: &mut Problems) -> Option<Model> {
    let base = base_link(r, tree, options, out)?;
    // Pose of every link in its body; the base body takes the frame of the base link.
    let mut at: Vec<(usize, Xform<f64>)> = vec![(0, Xform::identity()); r.links.len()];
    at[tree.root] = (0, pose_in_root(r, tree, base).inverse());
    let mut groups = vec![Group { link: base, joint: None, inertia: Inertia::zero(), has_child: false, reach: 0.0 }];
    let mut placements: Vec<Xform<f64>> = Vec::new();
    for &j in &tree.order {
        let (body, parent_pose) = at[tree.parent[j]];
        let pose = parent_pose * xform(&r.joints[j].origin);
        let child = tree.child[j];
        if r.joints[j].moves() {
            groups[body].has_child = true;
            let reach = groups[body].reach + pose.pos.norm();
            let joint = Some((j, body));
            groups.push(Group { link: child, joint, inertia: Inertia::zero(), has_child: false, reach });
            placements.push(pose);
            at[child] = (groups.len() - 1, Xform::identity());
        } else {
            at[child] = (body, pose);
        }
    }
    let mut worst = (0.0, base);
    for (k, l) in r.links.iter().enumerate() {
        let (body, pose) = at[k];
        let own = match (&l.inertial, &options.base_inertial) {
            (_, Some(i)) if k == base => *i,
            (Some((i, _)), _) => inertia(i),
            (None, _) => Inertia::zero(),
        };
        groups[body].inertia += own.to_parent(&pose);
        let reach = groups[body].reach + own.com().map_or(pose.pos, |c| pose.point(&c)).norm();
        if reach > worst.0 {
            worst = (reach, k);
        }
    }
    if worst.0 > MAX_REACH {
        let l = &r.links[worst.1];
        out.push(
            Problem::warning(
                Area::Model,
                "Urdf::ImplausibleScale",
                format!("reaches {:.3} m from the base, expected at most {MAX_REACH} m", worst.0),
            )
            .at_line(l.line)
            .on(format!("link {}", l.name))
            .hint("URDF lengths are in m; check for mm"),
        );
    }
    masses(r, &groups, &at, options, out);
    names(r, &groups, out);
    if out.has_errors() {
        return None;
    }
    Some(assemble(r, &groups, &placements, &at, options))
}

/// The link that carries the base frame: the root, or one fixed to it.
fn base_link(r: &RawRobot, tree: &Tree, options: &UrdfOptions, out: &mut Problems) -> Option<usize> {
    let Some(name) = &options.base_link else { return Some(tree.root) };
    let Some(k) = r.links.iter().position(|l| l.name == *name) else {
        let p = Problem::error(Area::Config, "Config::UnknownLink", "the base link does not exist").on(name);
        out.push(match nearest(name, r.links.iter().map(|l| l.name.as_str())) {
            Some(n) => p.hint(format!("did you mean {n}?")),
            None => p.hint(format!("links: {}", list(r.links.iter().map(|l| l.name.as_str()), 8))),
        });
        return None;
    };
    let mut up = k;
    while let Some(j) = tree.carrier[up] {
        if r.joints[j].moves() {
            out.push(
                Problem::error(
                    Area::Config,
                    "Config::BaseNotRoot",
                    format!(
                        "joint {} moves between the root {} and the base link",
                        r.joints[j].name, r.links[tree.root].name
                    ),
                )
                .on(name)
                .hint("take the root, or a link fixed to it, as the base"),
            );
            return None;
        }
        up = tree.parent[j];
    }
    Some(k)
}

/// Pose of a link that is fixed to the root, in the root.
fn pose_in_root(r: &RawRobot, tree: &Tree, link: usize) -> Xform<f64> {
    let (mut x, mut up) = (Xform::identity(), link);
    while let Some(j) = tree.carrier[up] {
        x = xform(&r.joints[j].origin) * x;
        up = tree.parent[j];
    }
    x
}

/// Bodies that move need mass: their own, or that of bodies further out.
fn masses(r: &RawRobot, groups: &[Group], at: &[(usize, Xform<f64>)], options: &UrdfOptions, out: &mut Problems) {
    for (k, l) in r.links.iter().enumerate() {
        let g = &groups[at[k].0];
        let overridden = k == groups[0].link && options.base_inertial.is_some();
        if l.inertial.is_some() || overridden {
            continue;
        }
        let moves = g.joint.is_some() || options.base_kind == BaseKind::Floating;
        let p = if moves && g.inertia.is_zero() && g.link == k {
            Problem::error(Area::Model, "Urdf::NoInertial", "moves but has no <inertial>, so no mass")
                .hint("add <inertial>; a link meant to be massless between two joints has mass and inertia 0")
        } else {
            Problem::warning(Area::Model, "Urdf::NoInertial", "has no <inertial>; taken as massless")
                .hint("add <inertial>, with mass and inertia 0 if it is only a frame")
        };
        out.push(p.at_line(l.line).on(format!("link {}", l.name)));
    }
    for g in groups {
        let l = &r.links[g.link];
        let line = l.inertial.as_ref().map_or(l.line, |x| x.1);
        // Without any <inertial> the message above has said it.
        let silent = l.inertial.is_none() && g.inertia.is_zero();
        match g.joint {
            None if options.base_kind == BaseKind::Floating && g.inertia.mass <= 0.0 && !silent => out.push(
                Problem::error(Area::Model, "Urdf::MasslessBase", format!("mass {} kg, limit > 0 kg", g.inertia.mass))
                    .at_line(line)
                    .on(format!("link {}", l.name))
                    .hint("a floating base needs mass; give it, or set base = \"fixed\""),
            ),
            Some((j, _)) if !g.has_child && !silent => {
                let joint = &r.joints[j];
                let a = Vector3::from(joint.axis.0);
                let a = a / a.norm().max(f64::MIN_POSITIVE);
                let (what, unit, x) = match joint.kind.as_str() {
                    "prismatic" => ("mass", "kg", g.inertia.mass),
                    // Without an axis, which is reported elsewhere, any inertia will do.
                    _ if a == Vector3::zeros() => ("inertia", "kg m^2", g.inertia.rot.trace()),
                    _ => ("inertia about its joint axis", "kg m^2", a.dot(&(g.inertia.rot * a))),
                };
                if x <= 0.0 {
                    out.push(
                        Problem::error(
                            Area::Model,
                            "Urdf::MasslessLeaf",
                            format!("{what} {x} {unit}, limit > 0 {unit}"),
                        )
                        .at_line(line)
                        .on(format!("link {}", l.name))
                        .hint(format!("nothing resists joint {}: give mass and inertia, or make it fixed", joint.name)),
                    );
                }
            }
            _ => {}
        }
    }
}

/// Parameters are called `base.mass` and `<link>.mass`; another moving link must not be called `base`.
fn names(r: &RawRobot, groups: &[Group], out: &mut Problems) {
    for g in &groups[1..] {
        let l = &r.links[g.link];
        if l.name == "base" {
            out.push(
                Problem::error(Area::Model, "Urdf::BadName", "a moving link that is not the base is called 'base'")
                    .at_line(l.line)
                    .on("link base")
                    .hint("rename it: its parameters would have the names of the base's"),
            );
        }
    }
}

fn assemble(
    r: &RawRobot,
    groups: &[Group],
    placements: &[Xform<f64>],
    at: &[(usize, Xform<f64>)],
    options: &UrdfOptions,
) -> Model {
    let mut m =
        Model::new(r.name.as_str(), r.links[groups[0].link].name.as_str(), groups[0].inertia, options.base_kind);
    for (g, placement) in groups[1..].iter().zip(placements) {
        if let Some((j, parent)) = g.joint {
            let joint = joint(&r.joints[j], *placement);
            m.add_body(parent, r.links[g.link].name.as_str(), joint, g.inertia);
        }
    }
    for (k, l) in r.links.iter().enumerate() {
        let (body, pose) = at[k];
        if groups[body].link != k {
            m.add_frame(l.name.as_str(), body, pose);
        }
    }
    m
}

fn joint(j: &RawJoint, placement: Xform<f64>) -> Joint {
    let kind = match j.kind.as_str() {
        "continuous" => JointKind::Continuous,
        "prismatic" => JointKind::Prismatic,
        _ => JointKind::Revolute,
    };
    let mut limits = JointLimits::default();
    if let Some(l) = j.limit {
        limits.velocity = l.velocity.unwrap_or(limits.velocity);
        limits.effort = l.effort.unwrap_or(limits.effort);
        if kind != JointKind::Continuous && (l.lower.is_some() || l.upper.is_some()) {
            limits.lower = l.lower.unwrap_or(0.0);
            limits.upper = l.upper.unwrap_or(0.0);
        }
    }
    Joint { name: j.name.clone(), kind, axis: Vector3::from(j.axis.0).normalize(), placement, limits }
}

fn xform(p: &RawPose) -> Xform<f64> {
    Xform::new(rot_of_rpy(&Vector3::from(p.rpy)), Vector3::from(p.xyz))
}

/// Inertia of a link about its own frame.
fn inertia(i: &RawInertial) -> Inertia<f64> {
    let in_own_frame = Inertia::from_com(i.mass, &Vector3::zeros(), &i.matrix());
    in_own_frame.to_parent(&xform(&i.origin))
}
