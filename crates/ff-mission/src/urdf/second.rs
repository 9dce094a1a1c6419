//! The second opinion: urdf-rs parses the same text, and its numbers must be those of the strict reading.
//!
//! Only [`urdf_rs::read_from_string`] is ever called: the readers of files and package paths start other
//! programs.

use super::raw::{RawPose, RawRobot};
use ff_model::diagnostics::clip;
use ff_model::{Area, Problem, Problems};
use roxmltree::{Document, Node};
use std::collections::HashSet;

/// Parses with urdf-rs and compares. Call it only on text the strict pass has accepted.
pub(super) fn agree(text: &str, r: &RawRobot, out: &mut Problems) {
    let robot = match urdf_rs::read_from_string(&decisive(text, r)) {
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
    for (l, o) in r.links.iter().zip(&robot.links) {
        let i = &o.inertial;
        let n = &i.inertia;
        if l.name != o.name {
            differ(format!("link {}", l.name), l.line);
        } else if let Some((own, line)) = &l.inertial {
            let theirs = super::raw::RawInertial {
                origin: pose(&i.origin),
                mass: i.mass.value,
                inertia: [n.ixx, n.ixy, n.ixz, n.iyy, n.iyz, n.izz],
            };
            if *own != theirs {
                differ(format!("link {}", l.name), *line);
            }
        }
    }
    for (j, o) in r.joints.iter().zip(&robot.joints) {
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
    }
}

/// The text with blanks for what is not read here: links and joints that are not used, shapes, materials and additions of other
/// programs, on which urdf-rs has views of its own.
fn decisive(text: &str, r: &RawRobot) -> String {
    let links: HashSet<&str> = r.links.iter().map(|l| l.name.as_str()).collect();
    let joints: HashSet<&str> = r.joints.iter().map(|j| j.name.as_str()).collect();
    let Ok(document) = Document::parse(text) else { return text.to_owned() };
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    let mut blank = |range: std::ops::Range<usize>| {
        out.push_str(&text[at..range.start]);
        // Lines stay lines, for positions in messages.
        out.extend(text[range.clone()].chars().map(|c| if c == '\n' { '\n' } else { ' ' }));
        at = range.end;
    };
    for n in document.root_element().children().filter(Node::is_element) {
        let name = n.attribute("name").unwrap_or_default();
        match n.tag_name().name() {
            "joint" if joints.contains(name) => {}
            "link" if links.contains(name) => {
                let skipped = n.children().filter(|c| c.is_element() && c.tag_name().name() != "inertial");
                skipped.for_each(|c| blank(c.range()));
            }
            _ => blank(n.range()),
        }
    }
    out.push_str(&text[at..]);
    out
}

fn pose(p: &urdf_rs::Pose) -> RawPose {
    RawPose { xyz: *p.xyz, rpy: *p.rpy, quat: None }
}
