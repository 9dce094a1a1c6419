//! The second opinion: urdf-rs parses the same text, its numbers are the ones used, and the two must agree.
//!
//! Only [`urdf_rs::read_from_string`] is ever called: the readers of files and package paths start other
//! programs.

use super::raw::{RawPose, RawRobot};
use ff_model::diagnostics::clip;
use ff_model::{Area, Problem, Problems};

/// Parses with urdf-rs and takes its numbers. Call it only on text the strict pass has accepted.
pub(super) fn adopt(text: &str, r: &mut RawRobot, out: &mut Problems) {
    let robot = match urdf_rs::read_from_string(text) {
        Ok(x) => x,
        Err(e) => {
            out.push(
                Problem::error(Area::Model, "Urdf::Syntax", format!("urdf-rs: {}", clip(&e.to_string())))
                    .hint("compare with the URDF specification"),
            );
            return;
        }
    };
    let mut differ = |what: String, line: usize| {
        out.push(
            Problem::error(Area::Model, "Urdf::ReadersDisagree", "two readings of the file differ here")
                .at_line(line)
                .on(what)
                .hint("write the element without namespaces, entities or other rare XML, and report this"),
        );
    };
    if robot.links.len() != r.links.len() || robot.joints.len() != r.joints.len() {
        differ("robot".into(), 1);
        return;
    }
    for (l, o) in r.links.iter_mut().zip(&robot.links) {
        let i = &o.inertial;
        let n = &i.inertia;
        if l.name != o.name {
            differ(format!("link {}", l.name), l.line);
        } else if let Some((own, line)) = &mut l.inertial {
            let theirs = super::raw::RawInertial {
                origin: pose(&i.origin),
                mass: i.mass.value,
                inertia: [n.ixx, n.ixy, n.ixz, n.iyy, n.iyz, n.izz],
            };
            if *own != theirs {
                differ(format!("link {}", l.name), *line);
            }
            *own = theirs;
        }
    }
    for (j, o) in r.joints.iter_mut().zip(&robot.joints) {
        let (origin, axis) = (pose(&o.origin), *o.axis.xyz);
        let same_limits = j.limit.is_none_or(|l| {
            l.lower.is_none_or(|x| x == o.limit.lower)
                && l.upper.is_none_or(|x| x == o.limit.upper)
                && l.velocity.is_none_or(|x| x == o.limit.velocity)
                && l.effort.is_none_or(|x| x == o.limit.effort)
        });
        let same = j.name == o.name
            && j.parent.0 == o.parent.link
            && j.child.0 == o.child.link
            && j.kind == format!("{:?}", o.joint_type).to_lowercase()
            && j.origin == origin
            && j.axis.0 == axis
            && same_limits;
        if !same {
            differ(format!("joint {}", j.name), j.line);
        }
        j.origin = origin;
        j.axis.0 = axis;
    }
}

fn pose(p: &urdf_rs::Pose) -> RawPose {
    RawPose { xyz: *p.xyz, rpy: *p.rpy }
}
