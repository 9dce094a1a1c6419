//! From the elements of SDF to links and joints.

use crate::lines::LineIndex;
use crate::urdf::raw::{RawInertial, RawJoint, RawLimit, RawLink, RawMimic, RawPose, RawRobot};
use crate::xml;
use ff_model::diagnostics::{clip, list, nearest};
use ff_model::tree::JointImpedance;
use ff_model::{Area, Problem, Problems};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use roxmltree::Node;
use std::collections::HashMap;

/// Numbers beyond this stand for "no limit" in SDF.
const UNLIMITED: f64 = 1e16;
/// Most frames from a pose to that of the model.
const MAX_FRAMES: usize = 300;
/// The frame of the model.
const MODEL: &str = "__model__";

/// The links and joints of a file; what cannot be read is left out and has its problem recorded.
pub(crate) fn read(root: Node<'_, '_>, lines: LineIndex<'_>, out: &mut Problems) -> RawRobot {
    let mut r = Reader { lines, out, frames: HashMap::new(), known: HashMap::new() };
    let models: Vec<Node<'_, '_>> = root.descendants().filter(|n| n.has_tag_name("model")).collect();
    let model = match models[..] {
        [one] => one,
        _ => {
            let what = format!("{} models in the file, expected 1", models.len());
            r.fail(
                root,
                "file",
                "Sdf::Unsupported",
                what,
                "give a file with one model, without <include> and nested models",
            );
            return RawRobot::default();
        }
    };
    if let Some(n) = model.children().find(|n| n.has_tag_name("include")) {
        r.fail(n, "file", "Sdf::Unsupported", "includes another model".into(), "give the expanded model (gz sdf -p)");
    }
    r.robot(model)
}

struct Reader<'a, 'i, 't, 'p> {
    lines: LineIndex<'t>,
    out: &'p mut Problems,
    /// Links, joints and frames by name.
    frames: HashMap<&'a str, Node<'a, 'i>>,
    /// Poses found so far, in the frame of the model.
    known: HashMap<&'a str, Isometry3<f64>>,
}

fn child<'a, 'i>(n: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    n.children().find(|c| c.has_tag_name(name))
}

fn text<'a>(n: Node<'a, '_>, name: &str) -> Option<&'a str> {
    child(n, name).and_then(|c| c.text()).map(str::trim)
}

impl<'a, 'i> Reader<'a, 'i, '_, '_> {
    fn line(&self, n: Node<'_, '_>) -> usize {
        xml::line(&self.lines, n)
    }
    fn fail(&mut self, n: Node<'_, '_>, object: &str, code: &'static str, what: String, hint: &str) {
        xml::fail((&self.lines, &mut *self.out), n, object, code, what, hint);
    }
    /// Exactly `N` finite numbers of an element's text.
    fn numbers<const N: usize>(&mut self, n: Node<'_, '_>, object: &str) -> Option<[f64; N]> {
        let text = n.text().unwrap_or_default();
        // Limits may be infinite, nothing else.
        let good = |x: &f64| x.is_finite() || (!x.is_nan() && n.parent().is_some_and(|p| p.has_tag_name("limit")));
        let all: Option<Vec<f64>> = text.split_whitespace().map(|t| t.parse().ok().filter(good)).collect();
        let found = all.and_then(|v| <[f64; N]>::try_from(v).ok());
        if found.is_none() {
            let what = format!("<{}> '{}' is not {N} number(s)", n.tag_name().name(), clip(text.trim()));
            self.fail(n, object, "Sdf::BadNumber", what, "write numbers with a decimal point, separated by blanks");
        }
        found
    }
    fn number(&mut self, n: Node<'_, '_>, name: &str, object: &str) -> Option<f64> {
        child(n, name).and_then(|c| self.numbers(c, object)).map(|[x]| x)
    }

    fn robot(&mut self, model: Node<'a, 'i>) -> RawRobot {
        let mut r = RawRobot { name: model.attribute("name").unwrap_or("model").to_owned(), ..RawRobot::default() };
        let named = |kind: &'static str| model.children().filter(move |n| n.has_tag_name(kind));
        for n in named("link").chain(named("joint")).chain(named("frame")) {
            if let Some(name) = n.attribute("name") {
                self.frames.insert(name, n);
            }
        }
        // A link takes the frame of the joint that carries it.
        let mut moved: HashMap<String, Isometry3<f64>> = HashMap::new();
        for n in named("joint") {
            let (name, c) = (n.attribute("name").unwrap_or_default(), text(n, "child").unwrap_or_default());
            let pose = self.frame(name, n, 0);
            moved.entry(c.to_owned()).or_insert(pose);
        }
        for n in named("link") {
            let name = n.attribute("name").unwrap_or_default().to_owned();
            let own = self.frame(n.attribute("name").unwrap_or_default(), n, 0);
            let shift = moved.get(&name).map_or_else(Isometry3::identity, |at| at.inverse() * own);
            let before = self.out.0.len();
            let inertial = Some(self.inertial(n, &name, &shift));
            let shape = child(n, "visual").or(child(n, "collision")).is_some();
            let unsure = self.out.0[before..].iter().any(|p| p.severity == ff_model::Severity::Error);
            moved.entry(name.clone()).or_insert(own);
            r.links.push(RawLink { line: self.line(n), name, inertial, shape, unsure });
        }
        let mut world = moved.contains_key("world");
        for n in named("joint") {
            let joint = self.joint(n, &moved);
            if joint.parent.0 == "world" && !std::mem::replace(&mut world, true) {
                r.links.push(RawLink { name: "world".to_owned(), line: joint.line, ..RawLink::default() });
            }
            r.joints.push(joint);
        }
        r
    }

    /// Pose of a link, joint or frame in the frame of the model.
    fn frame(&mut self, name: &'a str, n: Node<'a, 'i>, depth: usize) -> Isometry3<f64> {
        if let Some(known) = self.known.get(name) {
            return *known;
        }
        let pose = child(n, "pose");
        let relative = pose.and_then(|p| p.attribute("relative_to")).filter(|t| !t.is_empty());
        let by_kind = match n.tag_name().name() {
            "joint" => text(n, "child"),
            "frame" => n.attribute("attached_to").filter(|t| !t.is_empty()),
            _ => None,
        };
        let own = pose.map_or_else(Isometry3::identity, |p| self.pose(p, name));
        let base = self.named(relative.or(by_kind), n, name, depth);
        self.known.insert(name, base * own);
        base * own
    }
    fn named(&mut self, name: Option<&'a str>, n: Node<'a, 'i>, of: &str, depth: usize) -> Isometry3<f64> {
        let Some(name) = name.filter(|t| *t != MODEL && *t != "world") else { return Isometry3::identity() };
        if depth > self.frames.len().min(MAX_FRAMES) {
            let what = format!("its pose is relative to '{}', and that to it", clip(name));
            self.fail(n, of, "Sdf::PoseCycle", what, "give one of the poses relative to the model");
            return Isometry3::identity();
        }
        match self.frames.get(name).copied() {
            Some(found) => self.frame(name, found, depth + 1),
            None => {
                let hint = match nearest(name, self.frames.keys().copied().take(1000)) {
                    Some(k) => format!("did you mean {k}?"),
                    None => format!("frames: {}", list(self.frames.keys().copied(), 8)),
                };
                self.fail(n, of, "Sdf::UnknownFrame", format!("names '{}', which does not exist", clip(name)), &hint);
                Isometry3::identity()
            }
        }
    }
    /// A `<pose>`: x y z roll pitch yaw (m, rad; degrees where it says so), or with a quaternion, scalar last.
    fn pose(&mut self, n: Node<'_, '_>, object: &str) -> Isometry3<f64> {
        if n.attribute("rotation_format") == Some("quat_xyzw") {
            let Some([x, y, z, a, b, c, w]) = self.numbers(n, object) else { return Isometry3::identity() };
            let q = UnitQuaternion::try_new(nalgebra::Quaternion::new(w, a, b, c), 1e-9);
            let Some(q) = q.filter(|q| q.coords.iter().all(|c| c.is_finite())) else {
                self.fail(n, object, "Sdf::BadNumber", "is no rotation".into(), "give a unit quaternion, scalar last");
                return Isometry3::identity();
            };
            return Isometry3::from_parts(Translation3::new(x, y, z), q);
        }
        let Some([x, y, z, roll, pitch, yaw]) = self.numbers(n, object) else { return Isometry3::identity() };
        let unit = if n.attribute("degrees") == Some("true") { 1.0_f64.to_radians() } else { 1.0 };
        let turn = UnitQuaternion::from_euler_angles(roll * unit, pitch * unit, yaw * unit);
        Isometry3::from_parts(Translation3::new(x, y, z), turn)
    }

    fn inertial(&mut self, n: Node<'a, 'i>, name: &str, shift: &Isometry3<f64>) -> (RawInertial, usize) {
        let object = format!("link {name}");
        let line = self.line(n);
        let Some(i) = child(n, "inertial") else {
            let what = "has no <inertial>: 1 kg and 1 kg m^2, as SDF has it";
            let p = Problem::warning(Area::Model, "Sdf::NoInertial", what).at_line(line).on(object);
            self.out.push(p.hint("add <inertial>"));
            let inertia = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
            return (RawInertial { origin: raw(shift), mass: 1.0, inertia }, line);
        };
        let own = child(i, "pose").map_or_else(Isometry3::identity, |p| self.pose(p, &object));
        let mass = self.number(i, "mass", &object).unwrap_or(1.0);
        let mut inertia = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
        if let Some(m) = child(i, "inertia") {
            for (slot, key) in inertia.iter_mut().zip(["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]) {
                *slot = self.number(m, key, &object).unwrap_or(*slot);
            }
        }
        (RawInertial { origin: raw(&(shift * own)), mass, inertia }, self.line(i))
    }

    fn joint(&mut self, n: Node<'a, 'i>, moved: &HashMap<String, Isometry3<f64>>) -> RawJoint {
        let name = n.attribute("name").unwrap_or_default();
        let (object, line) = (format!("joint {name}"), self.line(n));
        let end = |which: &str| text(n, which).unwrap_or_default().to_owned();
        let (parent, child_link) = (end("parent"), end("child"));
        if parent.is_empty() || child_link.is_empty() {
            self.fail(n, &object, "Sdf::MissingElement", "has no <parent> or no <child>".into(), "name both links");
        }
        let at = self.frame(name, n, 0);
        let base = moved.get(&parent).copied().unwrap_or_else(Isometry3::identity);
        let mut out = RawJoint {
            name: name.to_owned(),
            line,
            origin: raw(&(base.inverse() * at)),
            origin_line: line,
            parent: (parent, line),
            child: (child_link, line),
            axis: ([0.0, 0.0, 1.0], line),
            ..RawJoint::default()
        };
        let kind = n.attribute("type").unwrap_or_default();
        kind.clone_into(&mut out.kind);
        if kind == "ball" {
            "spherical".clone_into(&mut out.kind);
        }
        let Some(a) = child(n, "axis") else { return out };
        if let Some(xyz) = child(a, "xyz") {
            let given = self.numbers(xyz, &object).map_or_else(Vector3::z, Vector3::from);
            let old = matches!(text(a, "use_parent_model_frame"), Some("1" | "true")).then_some(MODEL);
            let frame = xyz.attribute("expressed_in").filter(|f| !f.is_empty()).or(old);
            let turned = match frame {
                Some(f) => {
                    let expressed = self.named(Some(f), xyz, &object, 0);
                    at.rotation.inverse() * (expressed.rotation * given)
                }
                None => given,
            };
            // Of any length, as SDF has it; a zero one is reported where axes are judged.
            out.axis = (turned.try_normalize(1e-12).unwrap_or(turned).into(), self.line(xyz));
        }
        if let Some(d) = child(a, "dynamics") {
            let mut of = |key| self.number(d, key, &object).unwrap_or(0.0);
            let (viscous, coulomb) = (of("damping"), of("friction"));
            out.impedance =
                JointImpedance { stiffness: of("spring_stiffness"), rest: of("spring_reference"), viscous, coulomb };
        }
        let limits = child(a, "limit");
        let mut of = |key| limits.and_then(|l| self.number(l, key, &object));
        let (lower, upper) = (of("lower").unwrap_or(-UNLIMITED), of("upper").unwrap_or(UNLIMITED));
        // A negative one is none.
        let (velocity, effort) = (of("velocity").filter(|x| *x >= 0.0), of("effort").filter(|x| *x >= 0.0));
        let wide = |x: f64| if x.abs() >= UNLIMITED { f64::INFINITY.copysign(x) } else { x };
        let (lower, upper) = (wide(lower), wide(upper));
        if kind == "revolute" && lower.is_infinite() && upper.is_infinite() {
            "continuous".clone_into(&mut out.kind);
        }
        let line = limits.map_or(line, |l| self.line(l));
        out.limit = Some(RawLimit { line, lower: Some(lower), upper: Some(upper), velocity, effort });
        if let Some(m) = child(a, "mimic") {
            let multiplier = self.number(m, "multiplier", &object).unwrap_or(1.0);
            let reference = self.number(m, "reference", &object).unwrap_or(0.0);
            let offset = self.number(m, "offset", &object).unwrap_or(0.0) - multiplier * reference;
            let joint = m.attribute("joint").unwrap_or_default().to_owned();
            out.mimic = Some(RawMimic { line: self.line(m), joint, multiplier, offset });
        }
        out
    }
}

fn raw(x: &Isometry3<f64>) -> RawPose {
    let q = x.rotation.quaternion();
    RawPose { xyz: x.translation.vector.into(), rpy: [0.0; 3], quat: Some([q.w, q.i, q.j, q.k]) }
}
