//! From the elements of MJCF to links and joints.

use super::classes::Classes;
use super::geometry;
use super::orientation::{Angles, along, rotation};
use crate::lines::LineIndex;
use crate::urdf::raw::{RawInertial, RawJoint, RawLimit, RawLink, RawMimic, RawPose, RawRobot};
use crate::xml;
use ff_model::diagnostics::{clip, list, misspelling, nearest};
use ff_model::tree::JointImpedance;
use ff_model::{Area, Inertia, Problem, Problems, Xform};
use nalgebra::{UnitQuaternion, Vector3};
use roxmltree::Node;
use std::collections::HashMap;

/// Link that stands for the world.
const WORLD: &str = "world";
/// Elements of bodies that only a compiler of MJCF resolves.
const UNRESOLVED: [&str; 6] = ["frame", "replicate", "attach", "composite", "flexcomp", "include"];
/// Elements that give a body its mass and motion; the others are skipped.
const BODY: [&str; 5] = ["body", "inertial", "joint", "freejoint", "geom"];
/// Attributes of `<joint>` that are read.
const JOINT: [&str; 13] = [
    "name",
    "class",
    "type",
    "pos",
    "axis",
    "range",
    "limited",
    "ref",
    "stiffness",
    "springref",
    "damping",
    "frictionloss",
    "armature",
];
/// Notations of an orientation.
const NOTATIONS: [(&str, usize); 5] = [("quat", 4), ("axisangle", 4), ("euler", 3), ("xyaxes", 6), ("zaxis", 3)];
/// Density of a shape that gives neither mass nor density (kg/m^3).
const DENSITY: f64 = 1000.0;

/// The links and joints of a file; what cannot be read is left out and has its problem recorded.
pub(crate) fn read(root: Node<'_, '_>, lines: LineIndex<'_>, out: &mut Problems) -> RawRobot {
    let child = |name: &'static str| root.children().filter(move |n| n.has_tag_name(name));
    let compiler = |name: &str| child("compiler").filter_map(|c| c.attribute(name)).next_back();
    let sequence: Vec<char> = compiler("eulerseq").unwrap_or("xyz").chars().collect();
    let sequence_length = sequence.len();
    let unit = if compiler("angle") == Some("radian") { 1.0 } else { std::f64::consts::PI / 180.0 };
    let mut r = Reader {
        classes: Classes::read(root),
        angles: Angles { unit, sequence: sequence.try_into().unwrap_or(['x', 'y', 'z']) },
        autolimits: compiler("autolimits") != Some("false"),
        from_shapes: compiler("inertiafromgeom").unwrap_or("auto").to_owned(),
        groups: (0.0, 5.0),
        lines,
        armature: Vec::new(),
        out,
        robot: RawRobot { name: root.attribute("model").unwrap_or("mujoco").to_owned(), ..RawRobot::default() },
    };
    if r.angles.sequence.iter().any(|c| !"xyzXYZ".contains(*c)) || sequence_length != 3 {
        r.fail(
            root,
            "compiler",
            "Mjcf::BadNumber",
            "eulerseq is no sequence of three axes".into(),
            "give eulerseq=\"xyz\"",
        );
    }
    if r.classes.too_many() {
        r.fail(root, "default", "Mjcf::Unsupported", "too many classes".into(), SAVE);
    }
    for c in child("compiler") {
        if let Some([from, to]) = r.own_numbers(c, "inertiagrouprange") {
            r.groups = (from, to);
        }
        if c.attribute("coordinate") == Some("global") {
            r.fail(c, "compiler", "Mjcf::Unsupported", "global coordinates".into(), SAVE);
        }
        if r.own_numbers::<1>(c, "settotalmass").is_some_and(|[m]| m > 0.0) {
            r.fail(c, "compiler", "Mjcf::Unsupported", "settotalmass scales masses".into(), SAVE);
        }
    }
    for n in root.children().filter(|n| n.has_tag_name("include")) {
        r.fail(n, "file", "Mjcf::Unsupported", "includes another file".into(), SAVE);
    }
    r.robot.links.push(RawLink { name: WORLD.to_owned(), line: 1, ..RawLink::default() });
    for world in child("worldbody") {
        r.contents(world, WORLD, None, Vector3::zeros());
    }
    let index = r.robot.joints.iter().enumerate().map(|(k, j)| (j.name.clone(), k)).collect();
    for n in child("equality").flat_map(|e| e.children()).filter(Node::is_element) {
        r.equality(n, &index);
    }
    r.report_armature();
    r.robot
}

/// The next step where only a compiler of MJCF knows more.
const SAVE: &str = "save the compiled model with MuJoCo (mj_saveLastXML, or Save XML in its viewer) and read that";

struct Reader<'a, 't, 'p> {
    classes: Classes<'a>,
    angles: Angles,
    autolimits: bool,
    from_shapes: String,
    /// Groups of shapes that have mass.
    groups: (f64, f64),
    lines: LineIndex<'t>,
    /// Joints with a rotor inertia, and the line of the first.
    armature: Vec<(String, usize)>,
    out: &'p mut Problems,
    robot: RawRobot,
}

impl<'a> Reader<'a, '_, '_> {
    fn line(&self, n: Node<'_, '_>) -> usize {
        xml::line(&self.lines, n)
    }
    fn fail(&mut self, n: Node<'_, '_>, object: &str, code: &'static str, what: String, hint: &str) {
        xml::fail((&self.lines, &mut *self.out), n, object, code, what, hint);
    }
    /// Any number of finite numbers of a text.
    fn parse(&mut self, n: Node<'_, '_>, name: &str, text: &str) -> Option<Vec<f64>> {
        let all: Option<Vec<f64>> =
            text.split_whitespace().map(|t| t.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        if all.is_none() {
            let what = format!("{name}=\"{}\" of <{}> holds what is no finite number", clip(text), n.tag_name().name());
            let object = n.attribute("name").unwrap_or("element").to_owned();
            self.fail(n, &object, "Mjcf::BadNumber", what, "write numbers with a decimal point, separated by blanks");
        }
        all
    }
    fn exactly<const N: usize>(&mut self, n: Node<'_, '_>, name: &str, text: &str) -> Option<[f64; N]> {
        let all = self.parse(n, name, text)?;
        let found = all.len();
        let out = <[f64; N]>::try_from(all).ok();
        if out.is_none() {
            let what = format!("{name} of <{}> holds {found} numbers, expected {N}", n.tag_name().name());
            let object = n.attribute("name").unwrap_or("element").to_owned();
            self.fail(n, &object, "Mjcf::BadNumber", what, "give as many numbers as the attribute has");
        }
        out
    }
    /// Numbers of an attribute of the element itself.
    fn own_numbers<const N: usize>(&mut self, n: Node<'_, '_>, name: &str) -> Option<[f64; N]> {
        n.attribute(name).and_then(|text| self.exactly(n, name, text))
    }
    /// Numbers of an attribute of the element or its class.
    fn numbers<const N: usize>(&mut self, n: Node<'a, '_>, class: Option<&str>, name: &str) -> Option<[f64; N]> {
        let text = self.classes.value(n, class, name)?;
        self.exactly(n, name, text)
    }
    fn number(&mut self, n: Node<'a, '_>, class: Option<&str>, name: &str) -> Option<f64> {
        self.numbers(n, class, name).map(|[x]| x)
    }

    /// Orientation of an element, in the one notation that it uses.
    fn orientation(&mut self, n: Node<'a, '_>, class: Option<&str>) -> UnitQuaternion<f64> {
        for (notation, count) in NOTATIONS {
            let Some(text) = self.classes.value(n, class, notation) else { continue };
            let Some(x) = self.parse(n, notation, text) else { continue };
            let found = if x.len() == count { rotation(notation, &x, &self.angles) } else { None };
            if let Some(r) = found {
                return r;
            }
            let object = n.attribute("name").unwrap_or("element").to_owned();
            let what = format!("{notation}=\"{}\" of <{}> is no rotation", clip(text), n.tag_name().name());
            self.fail(n, &object, "Mjcf::BadNumber", what, "give a rotation of full length");
        }
        UnitQuaternion::identity()
    }

    /// What stands in a body or in the world; `shift`: origin of the frame of its link in that of the body (m).
    fn contents(&mut self, n: Node<'a, '_>, link: &str, class: Option<&'a str>, shift: Vector3<f64>) {
        for c in n.children().filter(Node::is_element) {
            match c.tag_name().name() {
                "body" => self.body(c, link, class, shift),
                name if UNRESOLVED.contains(&name) => {
                    self.fail(
                        c,
                        &format!("link {link}"),
                        "Mjcf::Unsupported",
                        format!("<{name}> is not resolved"),
                        SAVE,
                    );
                }
                name if !BODY.contains(&name) => {
                    if let Some(known) = misspelling(name, BODY) {
                        let what = format!("unknown element <{}> in <body>", clip(name));
                        let hint = format!("did you mean <{known}>?");
                        self.fail(c, &format!("link {link}"), "Mjcf::UnknownElement", what, &hint);
                    }
                }
                _ => {}
            }
        }
    }

    fn body(&mut self, n: Node<'a, '_>, parent: &str, around: Option<&'a str>, shift: Vector3<f64>) {
        let class = n.attribute("childclass").or(around);
        let name = n.attribute("name").map_or_else(|| format!("body{}", self.robot.links.len()), str::to_owned);
        for c in n.children().filter(Node::is_element).chain([n]) {
            let named = c.attribute(if c == n { "childclass" } else { "class" });
            if let Some(wrong) = named.filter(|k| !self.classes.has(k)) {
                let what = format!("class '{}' does not exist", clip(wrong));
                let hint = match nearest(wrong, self.classes.names()) {
                    Some(k) => format!("did you mean {k}?"),
                    None => "name a class of <default>".to_owned(),
                };
                self.fail(c, &format!("link {name}"), "Mjcf::UnknownClass", what, &hint);
            }
        }
        let pos = self.own_numbers(n, "pos").map_or_else(Vector3::zeros, Vector3::from);
        // Pose of the frame to come in the link before it.
        let mut at = (pos - shift, self.orientation(n, None));
        let joints: Vec<Node<'a, '_>> =
            n.children().filter(|c| c.has_tag_name("joint") || c.has_tag_name("freejoint")).collect();
        let (mut carrier, mut anchor) = (parent.to_owned(), Vector3::zeros());
        if joints.is_empty() {
            let joint = RawJoint { name: format!("{name}/fixed"), kind: "fixed".to_owned(), ..RawJoint::default() };
            self.attach(n, joint, &carrier, &name, at);
        }
        for (k, &j) in joints.iter().enumerate() {
            let fallback = if joints.len() == 1 { format!("{name}/joint") } else { format!("{name}/joint{k}") };
            let (mut joint, place, reference) = self.joint(j, class, fallback);
            // From the anchor of the joint before to that of this one, both in the frame of the body.
            at.0 += at.1 * (place - anchor);
            anchor = place;
            let axis = Vector3::from(joint.axis.0);
            match (joint.kind.as_str(), axis.try_normalize(1e-12)) {
                ("prismatic", Some(a)) => at.0 -= at.1 * a * reference,
                ("revolute" | "continuous", Some(a)) => at.1 *= UnitQuaternion::new(-a * reference),
                _ => {}
            }
            joint.axis.1 = self.line(j);
            let last = k + 1 == joints.len();
            let child = if last { name.clone() } else { format!("{name}/{}", joint.name) };
            self.attach(j, joint, &carrier, &child, at);
            if !last {
                let zero = Some((RawInertial::default(), self.line(n)));
                let link = RawLink { name: child.clone(), line: self.line(n), inertial: zero, ..RawLink::default() };
                self.robot.links.push(link);
            }
            (carrier, at) = (child, (Vector3::zeros(), UnitQuaternion::identity()));
        }
        let before = self.out.0.len();
        let inertial = self.inertial(n, class, &name, anchor).map(|i| (i, self.line(n)));
        let shape = n.children().any(|c| c.has_tag_name("geom"));
        let unsure = self.out.0.len() > before;
        self.robot.links.push(RawLink { name: name.clone(), line: self.line(n), inertial, shape, unsure });
        self.contents(n, &name, class, anchor);
    }

    fn attach(
        &mut self,
        n: Node<'_, '_>,
        joint: RawJoint,
        parent: &str,
        child: &str,
        at: (Vector3<f64>, UnitQuaternion<f64>),
    ) {
        let line = self.line(n);
        let origin = pose(&at.0, &at.1);
        let (parent, child) = ((parent.to_owned(), line), (child.to_owned(), line));
        self.robot.joints.push(RawJoint { line, origin, origin_line: line, parent, child, ..joint });
    }

    /// A joint, its anchor in the frame of its body (m), and its position in the pose of the file (rad or m).
    fn joint(&mut self, n: Node<'a, '_>, class: Option<&'a str>, fallback: String) -> (RawJoint, Vector3<f64>, f64) {
        let name = n.attribute("name").map_or(fallback, str::to_owned);
        if n.has_tag_name("freejoint") {
            return (RawJoint { name, kind: "floating".to_owned(), ..RawJoint::default() }, Vector3::zeros(), 0.0);
        }
        for a in n.attributes().filter(|a| !JOINT.contains(&a.name())) {
            let absent = JOINT.into_iter().filter(|k| !n.has_attribute(*k));
            // `user` and the solver's settings say nothing of motion.
            if let Some(known) = misspelling(a.name(), absent).filter(|_| !a.name().starts_with("sol")) {
                let what = format!("unknown attribute '{}' of <joint>", clip(a.name()));
                let hint = format!("did you mean {known}?");
                self.fail(n, &format!("joint {name}"), "Mjcf::UnknownAttribute", what, &hint);
            }
        }
        let kind = self.classes.value(n, class, "type").unwrap_or("hinge");
        let unit = if kind == "slide" { 1.0 } else { self.angles.unit };
        let mut of = |key| self.number(n, class, key).unwrap_or(0.0);
        let (stiffness, viscous, coulomb) = (of("stiffness"), of("damping"), of("frictionloss"));
        let (reference, slack, armature) = (of("ref") * unit, of("springref") * unit, of("armature"));
        let impedance = JointImpedance { stiffness, rest: slack, viscous, coulomb };
        // Of any length, as MJCF has it; a zero one is reported where axes are judged.
        let axis = self.numbers(n, class, "axis").unwrap_or([0.0, 0.0, 1.0]);
        let axis = Vector3::from(axis).try_normalize(1e-12).map_or(axis, Into::into);
        let place = self.numbers(n, class, "pos").map_or_else(Vector3::zeros, Vector3::from);
        let range = self.numbers::<2>(n, class, "range");
        let limited = match self.classes.value(n, class, "limited") {
            Some("true") => true,
            Some("false") => false,
            _ => self.autolimits && range.is_some(),
        };
        let limits = range.filter(|_| limited).map(|r| r.map(|x| x * unit));
        if armature != 0.0 {
            self.armature.push((name.clone(), self.line(n)));
        }
        let unlimited = [f64::NEG_INFINITY, f64::INFINITY];
        let (kind, limits) = match kind {
            "slide" => ("prismatic", Some(limits.unwrap_or(unlimited))),
            "hinge" if limits.is_some() => ("revolute", limits),
            "hinge" => ("continuous", None),
            "ball" => ("spherical", None),
            "free" => ("floating", None),
            other => {
                let what = format!("unknown type '{}'; known: hinge, slide, ball, free", clip(other));
                self.fail(n, &format!("joint {name}"), "Mjcf::UnknownJointType", what, "give one of these");
                ("fixed", None)
            }
        };
        let line = self.line(n);
        let limit = limits.map(|[lower, upper]| RawLimit {
            line,
            lower: Some(lower),
            upper: Some(upper),
            velocity: None,
            effort: None,
        });
        let axis = (axis, line);
        (RawJoint { name, kind: kind.to_owned(), axis, limit, impedance, ..RawJoint::default() }, place, reference)
    }

    /// Mass and inertia of a body, in its frame moved to `anchor`.
    fn inertial(
        &mut self,
        n: Node<'a, '_>,
        class: Option<&'a str>,
        name: &str,
        anchor: Vector3<f64>,
    ) -> Option<RawInertial> {
        let given = n.children().find(|c| c.has_tag_name("inertial")).filter(|_| self.from_shapes != "true");
        let Some(i) = given else {
            return if self.from_shapes == "false" { None } else { self.shapes(n, class, name, anchor) };
        };
        let object = format!("link {name}");
        let need = |r: &mut Self, found: bool, what: &str| {
            if !found {
                let hint = format!("add {what}=\"...\"");
                r.fail(i, &object, "Mjcf::MissingAttribute", format!("<inertial> has no attribute {what}"), &hint);
            }
        };
        let mass = self.own_numbers(i, "mass").map_or(0.0, |[m]| m);
        need(self, i.has_attribute("mass"), "mass");
        need(self, i.has_attribute("pos"), "pos");
        let com = self.own_numbers(i, "pos").map_or_else(Vector3::zeros, Vector3::from);
        let inertia = match (self.own_numbers(i, "fullinertia"), self.own_numbers(i, "diaginertia")) {
            // The order of MJCF: the diagonal first.
            (Some([xx, yy, zz, xy, xz, yz]), _) => [xx, xy, xz, yy, yz, zz],
            (None, Some([x, y, z])) => [x, 0.0, 0.0, y, 0.0, z],
            (None, None) => {
                need(self, i.has_attribute("fullinertia") || i.has_attribute("diaginertia"), "diaginertia");
                [0.0; 6]
            }
        };
        Some(RawInertial { origin: pose(&(com - anchor), &self.orientation(i, None)), mass, inertia })
    }

    /// The sum of the shapes of a body.
    fn shapes(
        &mut self,
        n: Node<'a, '_>,
        class: Option<&'a str>,
        name: &str,
        anchor: Vector3<f64>,
    ) -> Option<RawInertial> {
        let mut sum: Inertia<f64> = Inertia::zero();
        for g in n.children().filter(|c| c.has_tag_name("geom")) {
            let group = self.number(g, class, "group").unwrap_or(0.0);
            if !(self.groups.0..=self.groups.1).contains(&group) {
                continue;
            }
            let shape = self.classes.value(g, class, "type").unwrap_or("sphere");
            let mass = self.number(g, class, "mass");
            let density = self.number(g, class, "density").unwrap_or(DENSITY);
            if shape == "plane" || mass == Some(0.0) || (mass.is_none() && density == 0.0) {
                continue;
            }
            let Some(count) = geometry::sizes(shape) else {
                let what = format!("has no <inertial>, and the mass of a shape '{}' is not computed", clip(shape));
                self.fail(g, &format!("link {name}"), "Mjcf::NoInertial", what, SAVE);
                return None;
            };
            let mut pos = self.numbers(g, class, "pos").map_or_else(Vector3::zeros, Vector3::from);
            let mut turn = self.orientation(g, class);
            let text = self.classes.value(g, class, "size").unwrap_or_default();
            let mut size = self.parse(g, "size", text)?;
            if let Some(ends) = self.numbers::<6>(g, class, "fromto") {
                let (a, b) = (Vector3::new(ends[0], ends[1], ends[2]), Vector3::new(ends[3], ends[4], ends[5]));
                (pos, turn) = ((a + b) / 2.0, along(&(b - a)).unwrap_or(turn));
                // The half length is the last of the sizes that the shape needs.
                size.truncate(count - 1);
                size.push((b - a).norm() / 2.0);
            }
            if size.len() < count || size.iter().take(count).any(|s| *s <= 0.0) {
                let what = format!("size \"{}\" of a {shape}, which needs {count} numbers > 0 m", clip(text));
                self.fail(g, &format!("link {name}"), "Mjcf::BadNumber", what, "give half lengths in m");
                return None;
            }
            let (volume, per_mass) = geometry::solid(shape, &size);
            let own = geometry::inertia(mass.unwrap_or(density * volume), &per_mass);
            sum += own.to_parent(&Xform::new(*turn.to_rotation_matrix().matrix(), pos - anchor));
        }
        let com = sum.com()?;
        let i = sum.about_com();
        let inertia = [i[(0, 0)], i[(0, 1)], i[(0, 2)], i[(1, 1)], i[(1, 2)], i[(2, 2)]];
        Some(RawInertial { origin: pose(&com, &UnitQuaternion::identity()), mass: sum.mass, inertia })
    }

    /// A coupling of two joints is a `<mimic>`; loops are refused.
    fn equality(&mut self, n: Node<'a, '_>, index: &HashMap<String, usize>) {
        if n.attribute("active") == Some("false") {
            return;
        }
        let kind = n.tag_name().name();
        let joint = n.attribute("joint1").unwrap_or_default();
        let object = n.attribute("name").map_or_else(|| format!("equality {joint}"), |e| format!("equality {e}"));
        match (kind, n.attribute("joint2")) {
            ("joint", Some(master)) => {
                let text = self.classes.value(n, None, "polycoef").unwrap_or("0 1 0 0 0");
                let Some(c) = self.parse(n, "polycoef", text) else { return };
                let of = |k: usize| c.get(k).copied().unwrap_or(0.0);
                if (2..5).any(|k| of(k) != 0.0) {
                    let what = format!("polycoef {text}: a coupling that is not linear");
                    self.fail(n, &object, "Mjcf::Unsupported", what, "remove it and lock the joint in [robot]");
                    return;
                }
                let line = self.line(n);
                match index.get(joint) {
                    Some(&k) => {
                        let (multiplier, offset) = (of(1), of(0));
                        self.robot.joints[k].mimic =
                            Some(RawMimic { line, joint: master.to_owned(), multiplier, offset });
                    }
                    None => {
                        let names = || index.keys().map(String::as_str).take(1000);
                        let hint = match nearest(joint, names()) {
                            Some(k) => format!("did you mean {k}?"),
                            None => format!("joints: {}", list(names(), 8)),
                        };
                        let what = format!("names joint '{}', which does not exist", clip(joint));
                        self.fail(n, &object, "Mjcf::UnknownJoint", what, &hint);
                    }
                }
            }
            ("connect" | "weld", _) => {
                let hint =
                    "remove it; a closed loop is no tree, and its bodies do not move as the file without it says";
                self.fail(n, &object, "Mjcf::Unsupported", format!("<{kind}> closes a loop"), hint);
            }
            _ => {
                let what = format!("<{kind}> of <equality> is skipped");
                let p = Problem::warning(Area::Model, "Mjcf::Skipped", what).at_line(self.line(n)).on(object);
                self.out.push(p.hint("lock the joints that it holds in [robot]"));
            }
        }
    }

    fn report_armature(&mut self) {
        let Some((first, line)) = self.armature.first() else { return };
        let what = format!(
            "rotor inertia (armature) of {} is not modelled",
            list(self.armature.iter().map(|(n, _)| n.as_str()), 6)
        );
        let p = Problem::warning(Area::Model, "Mjcf::Armature", what).at_line(*line).on(format!("joint {first}"));
        self.out.push(p.hint("torques are those behind the gear, where the rotor does not show"));
    }
}

fn pose(at: &Vector3<f64>, turn: &UnitQuaternion<f64>) -> RawPose {
    let q = turn.quaternion();
    RawPose { xyz: (*at).into(), rpy: [0.0; 3], quat: Some([q.w, q.i, q.j, q.k]) }
}
