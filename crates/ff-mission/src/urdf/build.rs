//! From a checked tree of links to bodies: links on fixed joints are merged into the body they are fixed to.

use super::convert::{inertia, limits};
use super::graph::Tree;
use super::hold::Held;
use super::options::UrdfOptions;
use super::physics::Doubt;
use super::raw::{RawJoint, RawRobot};
use ff_model::Inertia;
use ff_model::Xform;
use ff_model::diagnostics::Limit;
use ff_model::diagnostics::{list, nearest};
use ff_model::spatial::InertiaError;
use ff_model::{Area, Problem, Problems, Severity};
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
    /// Pose of that joint at position zero in the parent body.
    placement: Xform<f64>,
    inertia: Inertia<f64>,
    /// Distance of the body frame from the base along the chain (m).
    reach: f64,
}

/// Builds the model; `None` when the base or a body cannot move as asked (problems say why).
pub(super) fn model(
    r: &RawRobot,
    tree: &Tree,
    held: &Held,
    doubts: Vec<Doubt>,
    options: &UrdfOptions,
    out: &mut Problems,
) -> Option<Model> {
    let base = base_link(r, tree, held, options, out)?;
    // Pose of every link in its body; the base body takes the frame of the base link.
    let mut at: Vec<(usize, Xform<f64>)> = vec![(0, Xform::identity()); r.links.len()];
    at[tree.root] = (0, pose_in_root(r, tree, held, base).inverse());
    let mut groups =
        vec![Group { link: base, joint: None, placement: Xform::identity(), inertia: Inertia::zero(), reach: 0.0 }];
    for &j in &tree.order {
        let (body, parent_pose) = at[tree.parent[j]];
        let pose = parent_pose * held.pose(r, j);
        let child = tree.child[j];
        if held.moves(r, j) {
            let reach = groups[body].reach + pose.pos.norm();
            let joint = Some((j, body));
            groups.push(Group { link: child, joint, placement: pose, inertia: Inertia::zero(), reach });
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
    densities(r, &groups, &at, &doubts, out);
    doubtful(r, &groups, &at, doubts, options, out);
    names(r, &groups, out);
    if out.0.iter().any(|p| p.severity == Severity::Error && !options.leniency.allows(p.code)) {
        return None;
    }
    Some(assemble(r, held, &groups, &at, options, out))
}

/// The link that carries the base frame: the root, or one fixed to it.
fn base_link(r: &RawRobot, tree: &Tree, held: &Held, options: &UrdfOptions, out: &mut Problems) -> Option<usize> {
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
        if held.moves(r, j) {
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
fn pose_in_root(r: &RawRobot, tree: &Tree, held: &Held, link: usize) -> Xform<f64> {
    let (mut x, mut up) = (Xform::identity(), link);
    while let Some(j) = tree.carrier[up] {
        x = held.pose(r, j) * x;
        up = tree.parent[j];
    }
    x
}

/// Links without mass: a shape without mass may have been forgotten, a base that floats needs some. Joints that carry none have been
/// held before.
fn masses(r: &RawRobot, groups: &[Group], at: &[(usize, Xform<f64>)], options: &UrdfOptions, out: &mut Problems) {
    let floating = options.base_kind == BaseKind::Floating;
    for (k, l) in r.links.iter().enumerate() {
        let g = &groups[at[k].0];
        let overridden = k == groups[0].link && options.base_inertial.is_some();
        if l.inertial.is_some() || overridden {
            continue;
        }
        let carries = g.link == k && (g.joint.is_some() || floating);
        let problem = if carries && g.joint.is_none() && g.inertia.is_zero() {
            Problem::error(Area::Model, "Urdf::NoInertial", "is a base that floats but has no <inertial>, so no mass")
                .hint("add <inertial>, give base_inertial in [robot], or set base = \"fixed\"")
        } else if carries && g.inertia.is_zero() {
            Problem::warning(Area::Model, "Urdf::NoInertial", "moves but has no <inertial>; taken as massless")
                .hint("add <inertial>, with mass and inertia 0 if it only joins two joints")
        } else if l.shape {
            Problem::warning(Area::Model, "Urdf::NoInertial", "has a shape but no <inertial>; taken as massless")
                .hint("add <inertial>, with mass and inertia 0 if another link has its mass")
        } else {
            continue;
        };
        out.push(problem.at_line(l.line).on(format!("link {}", l.name)));
    }
    let (base, link) = (&groups[0].inertia, &r.links[groups[0].link]);
    // Without any <inertial> the message above has said it.
    if floating && base.mass <= 0.0 && !(link.inertial.is_none() && base.is_zero()) {
        out.push(
            Problem::error(Area::Model, "Urdf::MasslessBase", format!("mass {} kg, limit > 0 kg", base.mass))
                .violating(base.mass, Limit::Above(0.0), "kg")
                .at_line(link.inertial.as_ref().map_or(link.line, |x| x.1))
                .on(format!("link {}", link.name))
                .hint("a floating base needs mass; give it, or set base = \"fixed\""),
        );
    }
}

/// What is assumed of an inertia that no body has.
pub(crate) const TAKEN: &str = "; taken as given";

/// Inertias that no body has: an error where the motion would follow from them, which is a body that moves and whose moments, with all
/// that is fixed to it, have a negative one; else a warning that they are taken as they are.
fn doubtful(
    r: &RawRobot,
    groups: &[Group],
    at: &[(usize, Xform<f64>)],
    doubts: Vec<Doubt>,
    options: &UrdfOptions,
    out: &mut Problems,
) {
    for Doubt { link, mut problem } in doubts {
        let (body, g) = (at[link].0, &groups[at[link].0]);
        if link == groups[0].link && options.base_inertial.is_some() {
            continue;
        }
        let name = &r.links[g.link].name;
        let what = match g.inertia.check() {
            Ok(()) => Some(format!("{TAKEN}, body {name} as a whole can be")),
            Err(InertiaError::Triangle { .. }) => Some(TAKEN.to_owned()),
            Err(_) if body == 0 && options.base_kind == BaseKind::Fixed => {
                Some(format!("{TAKEN}, the base does not move"))
            }
            Err(_) => None,
        };
        if let Some(what) = what {
            problem.severity = Severity::Warning;
            problem.message += &what;
        }
        out.push(problem);
    }
}

/// A link with this share of the mass of its body decides how it moves.
const CONSIDERABLE: f64 = 0.05;

/// Densities of links that matter.
fn densities(r: &RawRobot, groups: &[Group], at: &[(usize, Xform<f64>)], doubts: &[Doubt], out: &mut Problems) {
    for (k, l) in r.links.iter().enumerate() {
        let share = l.inertial.as_ref().map_or(0.0, |(i, _)| i.mass / groups[at[k].0].inertia.mass);
        if share >= CONSIDERABLE && !doubts.iter().any(|d| d.link == k) {
            super::physics::density(l, out);
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
    held: &Held,
    groups: &[Group],
    at: &[(usize, Xform<f64>)],
    options: &UrdfOptions,
    out: &mut Problems,
) -> Model {
    let mut m =
        Model::new(r.name.as_str(), r.links[groups[0].link].name.as_str(), groups[0].inertia, options.base_kind);
    let mut body_of = vec![0; r.joints.len()];
    for g in groups {
        if let Some((j, parent)) = g.joint {
            let mut joint = joint(&r.joints[j], g.placement);
            super::follow::narrow(r, held, j, &mut joint.limits, out);
            body_of[j] = m.add_body(parent, r.links[g.link].name.as_str(), joint, g.inertia);
            m.set_impedance(body_of[j], r.joints[j].impedance);
        }
    }
    for (k, f) in held.follows.iter().enumerate() {
        let coupled = f.as_ref().map(|f| m.couple(body_of[k], body_of[f.head], f.ratio, f.offset));
        coupled.and_then(Result::err).into_iter().for_each(|p| out.extend(p));
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
    Joint { name: j.name.clone(), kind, axis: Vector3::from(j.axis.0).normalize(), placement, limits: limits(j) }
}
