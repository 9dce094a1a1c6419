//! The strict reading: no name misspelt, every token a number, every line kept.
//!
//! urdf-rs drops unknown elements and non-numeric tokens, so that a misspelt `<inertial>` is a massless link
//! and `xyz="0,5 1 2 3"` is `[1, 2, 3]`. This pass refuses both and remembers where everything stands. Elements and attributes that
//! some other program added, and that no known name is a misspelling of, are skipped with one warning for the file.

use super::prescan::xacro;
use super::raw::{RawInertial, RawJoint, RawLimit, RawLink, RawMimic, RawPose, RawRobot};
use super::schema;
use super::schema::Element;
use crate::leniency::Leniency;
use crate::lines::LineIndex;
use crate::xml::MAX_PROBLEMS;
use ff_model::diagnostics::{clip, list, misspelling};
use ff_model::tree::JointImpedance;
use ff_model::{Area, Problem, Problems};
use roxmltree::{Attribute, Document, Node, ParsingOptions};

/// Most XML nodes of a file; 10,000 full links have about 400,000.
const MAX_NODES: u32 = 2_000_000;

/// Most kinds of elements and attributes that are skipped by name.
const MAX_SKIPPED: usize = 100;

/// The links and joints of a file in another format, told by its root element; `None` for a URDF and for what is no XML.
pub(super) fn foreign(text: &str, out: &mut Problems) -> Option<RawRobot> {
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let doc = Document::parse_with_options(text, options).ok()?;
    let root = doc.root_element();
    match root.tag_name().name() {
        "mujoco" => Some(crate::mjcf::read(root, LineIndex::new(text), out)),
        "sdf" => Some(crate::sdf::read(root, LineIndex::new(text), out)),
        _ => None,
    }
}

/// Reads a file; what cannot be read is left at zero or absent and has its problem recorded.
pub(super) fn read(text: &str, leniency: &Leniency, out: &mut Problems) -> Option<RawRobot> {
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let doc = match Document::parse_with_options(text, options) {
        Ok(d) => d,
        Err(e) => {
            out.push(syntax_error(text, &e));
            return None;
        }
    };
    let mut r = Reader { lines: LineIndex::new(text), leniency, refused: 0, skipped: Vec::new(), out };
    let robot = r.robot(doc.root_element());
    r.report_skipped();
    Some(robot)
}

/// A parse error of the XML itself.
fn syntax_error(text: &str, e: &roxmltree::Error) -> Problem {
    let whole = e.to_string();
    let message = whole.split(" at ").next().unwrap_or(&whole).to_owned();
    let pos = e.pos();
    let (line, column) = match e {
        // These carry no position: the file ended before its root element was closed.
        roxmltree::Error::NoRootNode | roxmltree::Error::UnclosedRootNode => LineIndex::new(text).at(text.len()),
        _ => (pos.row as usize, pos.col as usize),
    };
    match e {
        roxmltree::Error::NodesLimitReached | roxmltree::Error::AttributesLimitReached => Problem::error(
            Area::Model,
            "Urdf::TooLarge",
            format!("more than {MAX_NODES} XML nodes or attributes, the limit"),
        )
        .hint("split the robot"),
        roxmltree::Error::DtdDetected => {
            Problem::error(Area::Model, "Urdf::DtdForbidden", "document type declarations are refused")
                .hint("remove the <!DOCTYPE ...> block")
        }
        _ => Problem::error(Area::Model, "Urdf::Syntax", clip(&message)).at(line, column).hint(
            if text.trim().is_empty() {
                "the file is empty; give a URDF"
            } else {
                "mend the XML; a file cut short ends like this"
            },
        ),
    }
}

/// What the walk carries along.
struct Reader<'t, 'p> {
    lines: LineIndex<'t>,
    leniency: &'p Leniency,
    /// Errors so far that the user has not allowed.
    refused: usize,
    /// What no known name is a misspelling of: description, times, offset of the first, object.
    skipped: Vec<(String, usize, usize, String)>,
    out: &'p mut Problems,
}

impl Reader<'_, '_> {
    fn line(&self, n: Node<'_, '_>) -> usize {
        self.lines.at(n.range().start).0
    }
    fn err(&mut self, offset: usize, object: &str, code: &'static str, message: String, hint: String) {
        if !self.leniency.allows(code) {
            self.refused += 1;
        }
        // Never drop the first error that refuses, however many allowed ones came before.
        if self.out.0.len() >= MAX_PROBLEMS && self.refused > 1 {
            return;
        }
        let (line, column) = self.lines.at(offset);
        self.out.push(Problem::error(Area::Model, code, message).at(line, column).on(clip(object)).hint(hint));
    }

    /// Reports unknown attributes and child elements, and known ones given twice.
    fn check(&mut self, n: Node<'_, '_>, e: &Element, object: &str) {
        for a in n.attributes() {
            if is_expression(a.value()) {
                let (line, column) = self.lines.at(a.range_value().start);
                self.refused += 1;
                self.out
                    .push(xacro(&format!("'{}' is a xacro expression", clip(a.value()))).at(line, column).on(object));
            }
            if a.name() == "quat_xyzw" && e.attributes.contains(&"rpy") {
                // urdf-rs ignores it before version 1.1 and rounds it near a pitch of 90 degrees after.
                self.err(
                    a.range().start,
                    object,
                    "Urdf::Unsupported",
                    "quat_xyzw is not supported".into(),
                    "give the rotation as rpy=\"roll pitch yaw\" in rad".into(),
                );
            } else if !e.attributes.contains(&a.name()) {
                let what = format!("attribute '{}' of <{}>", clip(a.name()), e.name);
                // A known attribute that is there as well is not what this one was meant to be.
                let absent = e.attributes.iter().copied().filter(|k| !n.has_attribute(*k));
                match misspelling(a.name(), absent) {
                    Some(k) => {
                        let hint = format!("did you mean {k}?");
                        self.err(a.range().start, object, "Urdf::UnknownAttribute", format!("unknown {what}"), hint);
                    }
                    None => self.skip(what, a.range().start, object),
                }
            }
        }
        let mut seen: Vec<&str> = Vec::new();
        for c in n.children().filter(Node::is_element) {
            let name = c.tag_name().name();
            if e.single.contains(&name) {
                if seen.contains(&name) {
                    self.err(
                        c.range().start,
                        object,
                        "Urdf::DuplicateElement",
                        format!("a second <{name}> in <{}>", e.name),
                        "keep one of them".into(),
                    );
                }
                seen.push(name);
            } else if !e.many.contains(&name) {
                self.unknown_element(c, e, object);
            }
        }
    }

    /// An element that is not read here: an error if it is a misspelling, or if mass or structure would be lost with it.
    fn unknown_element(&mut self, c: Node<'_, '_>, e: &Element, object: &str) {
        let name = c.tag_name().name();
        let known = || e.single.iter().chain(e.many).copied();
        let hint = match (misspelling(name, known()), schema::home_of(name)) {
            (Some(k), _) => Some(format!("did you mean <{k}>?")),
            (None, Some(home)) if schema::is_decisive(name) && !is_identity(c) => {
                Some(format!("<{name}> belongs in <{home}>"))
            }
            (None, None) if c.descendants().any(|d| ["inertial", "mass"].contains(&d.tag_name().name())) => {
                Some(format!("mass inside it would be lost; known here: {}", list(known(), 12)))
            }
            _ => None,
        };
        let what = format!("<{}> in <{}>", clip(name), e.name);
        match hint {
            Some(hint) => {
                self.err(c.range().start, object, "Urdf::UnknownElement", format!("unknown element {what}"), hint);
            }
            None => self.skip(what, c.range().start, object),
        }
    }

    fn skip(&mut self, what: String, offset: usize, object: &str) {
        let kinds = self.skipped.len();
        match self.skipped.iter_mut().find(|s| s.0 == what) {
            Some(s) => s.1 += 1,
            // A file of any kind may hold a million names; a few tell what it is.
            None if kinds >= MAX_SKIPPED => {}
            None => self.skipped.push((what, 1, offset, object.to_owned())),
        }
    }

    /// One warning for all that was skipped.
    fn report_skipped(&mut self) {
        self.skipped.sort_by_key(|s| s.2);
        let Some((_, _, offset, object)) = self.skipped.first() else { return };
        let (line, column) = self.lines.at(*offset);
        let kinds: Vec<String> = self.skipped.iter().map(|(what, n, ..)| format!("{what} ({n})")).collect();
        let message = format!("not part of URDF and skipped: {}", list(kinds.iter().map(String::as_str), 8));
        self.out.push(
            Problem::warning(Area::Model, "Urdf::Skipped", message)
                .at(line, column)
                .on(clip(object))
                .hint("nothing to do, unless one of them is to say something about mass or motion"),
        );
    }

    fn robot(&mut self, n: Node<'_, '_>) -> RawRobot {
        let mut r = RawRobot::default();
        if n.tag_name().name() != "robot" {
            let what = format!("the root element is <{}>, not <robot>", clip(n.tag_name().name()));
            self.err(n.range().start, "file", "Urdf::UnknownElement", what, "give a URDF file".into());
            return r;
        }
        self.check(n, &schema::ROBOT, "robot");
        r.name = self.name(n, "robot");
        for c in n.children().filter(Node::is_element) {
            match c.tag_name().name() {
                "link" => r.links.push(self.link(c)),
                "joint" => r.joints.push(self.joint(c, n.attribute("version"))),
                _ => {}
            }
        }
        if r.links.is_empty() {
            let hint = "a robot needs at least its base link".to_owned();
            self.err(n.range().start, "robot", "Urdf::NoLinks", "there is no <link>".into(), hint);
        }
        r
    }

    /// The `name` attribute; absent or blank is an error.
    fn name(&mut self, n: Node<'_, '_>, element: &str) -> String {
        let name = self.required(n, "name", element).map_or("", |a| a.value());
        if name.trim() != name {
            let what = format!("name '{}' has blanks around it", clip(name));
            self.err(n.range().start, element, "Urdf::BadName", what, "give a name without blanks around it".into());
        }
        name.to_owned()
    }

    fn link(&mut self, n: Node<'_, '_>) -> RawLink {
        let before = self.refused;
        let name = self.name(n, "link");
        let object = format!("link {name}");
        self.check(n, &schema::LINK, &object);
        let inertial = child(n, "inertial").map(|c| (self.inertial(c, &object), self.line(c)));
        let shape = ["visual", "collision"].iter().any(|e| child(n, e).is_some());
        RawLink { line: self.line(n), name, inertial, shape, unsure: self.refused > before }
    }

    fn inertial(&mut self, n: Node<'_, '_>, object: &str) -> RawInertial {
        self.check(n, &schema::INERTIAL, object);
        let origin = self.pose(n, object);
        let mut mass = 0.0;
        if let Some(m) = self.required_child(n, "mass", object) {
            self.check(m, &schema::MASS, object);
            mass = self.required_number(m, "value", object);
        }
        let mut inertia = [0.0; 6];
        if let Some(i) = self.required_child(n, "inertia", object) {
            self.check(i, &schema::INERTIA, object);
            for (slot, name) in inertia.iter_mut().zip(schema::INERTIA.attributes) {
                *slot = self.required_number(i, name, object);
            }
        }
        RawInertial { origin, mass, inertia }
    }

    fn joint(&mut self, n: Node<'_, '_>, version: Option<&str>) -> RawJoint {
        let name = self.name(n, "joint");
        let object = format!("joint {name}");
        self.check(n, &schema::JOINT, &object);
        let kind = self.required(n, "type", &object).map_or("", |a| a.value()).to_owned();
        let line = self.line(n);
        let end = |r: &mut Self, which: &'static str, e: &Element| match r.required_child(n, which, &object) {
            Some(c) => {
                r.check(c, e, &object);
                let link = r.required(c, "link", &object).map_or("", |a| a.value()).to_owned();
                (link, r.line(c))
            }
            None => (String::new(), line),
        };
        let parent = end(self, "parent", &schema::PARENT);
        let child_link = end(self, "child", &schema::CHILD);
        let axis = match child(n, "axis") {
            Some(a) => {
                self.check(a, &schema::AXIS, &object);
                let xyz = self.required(a, "xyz", &object).map(|x| self.numbers(x, &object));
                (xyz.flatten().unwrap_or([1.0, 0.0, 0.0]), self.line(a))
            }
            None => ([1.0, 0.0, 0.0], line),
        };
        let limit = child(n, "limit").map(|l| self.limit(l, &object, version));
        let mut impedance = JointImpedance::default();
        for e in [&schema::DYNAMICS, &schema::CALIBRATION, &schema::SAFETY] {
            if let Some(c) = child(n, e.name) {
                self.check(c, e, &object);
                for a in c.attributes().filter(|a| e.attributes.contains(&a.name())) {
                    let x: Option<[f64; 1]> = self.numbers(a, &object);
                    match (a.name(), x) {
                        ("damping", Some([x])) => impedance.viscous = x,
                        ("friction", Some([x])) => impedance.coulomb = x,
                        _ => {}
                    }
                }
            }
        }
        let mimic = child(n, "mimic").and_then(|m| self.mimic(m, &object));
        let origin_line = child(n, "origin").map_or(line, |o| self.line(o));
        let origin = self.pose(n, &object);
        RawJoint {
            name,
            line,
            kind,
            origin,
            origin_line,
            parent,
            child: child_link,
            axis,
            limit,
            impedance,
            mimic,
            follows_outside: false,
        }
    }

    fn mimic(&mut self, n: Node<'_, '_>, object: &str) -> Option<RawMimic> {
        self.check(n, &schema::MIMIC, object);
        let joint = self.required(n, "joint", object)?.value().to_owned();
        let mut get = |name| n.attribute_node(name).and_then(|a| self.numbers(a, object)).map(|[x]| x);
        let (multiplier, offset) = (get("multiplier").unwrap_or(1.0), get("offset").unwrap_or(0.0));
        Some(RawMimic { line: self.line(n), joint, multiplier, offset })
    }

    fn limit(&mut self, n: Node<'_, '_>, object: &str, version: Option<&str>) -> RawLimit {
        self.check(n, &schema::LIMIT, object);
        // Up to URDF 1.1 `velocity` is required; from 1.2 on an absent limit is no limit.
        if !matches!(version, Some("1.2")) {
            self.required(n, "velocity", object);
        }
        let mut get = |name| n.attribute_node(name).and_then(|a| self.numbers(a, object)).map(|[x]| x);
        let (lower, upper, velocity, effort) = (get("lower"), get("upper"), get("velocity"), get("effort"));
        for name in ["acceleration", "deceleration", "jerk"] {
            get(name);
        }
        RawLimit { line: self.line(n), lower, upper, velocity, effort }
    }

    /// The optional `<origin>` of an element.
    fn pose(&mut self, n: Node<'_, '_>, object: &str) -> RawPose {
        let Some(o) = child(n, "origin") else { return RawPose::default() };
        self.check(o, &schema::ORIGIN, object);
        let mut get = |name| o.attribute_node(name).and_then(|a| self.numbers(a, object)).unwrap_or_default();
        RawPose { xyz: get("xyz"), rpy: get("rpy"), quat: None }
    }

    /// An attribute that must be there and hold something.
    fn required<'a, 'i>(&mut self, n: Node<'a, 'i>, name: &'static str, object: &str) -> Option<Attribute<'a, 'i>> {
        let a = n.attribute_node(name).filter(|a| !a.value().is_empty());
        if a.is_none() {
            let how = if n.has_attribute(name) { "an empty" } else { "no" };
            let what = format!("<{}> has {how} attribute {name}", n.tag_name().name());
            self.err(n.range().start, object, "Urdf::MissingAttribute", what, format!("give {name}=\"...\""));
        }
        a
    }
    fn required_child<'a, 'i>(&mut self, n: Node<'a, 'i>, name: &'static str, object: &str) -> Option<Node<'a, 'i>> {
        let c = child(n, name);
        if c.is_none() {
            let what = format!("<{}> has no <{name}>", n.tag_name().name());
            self.err(n.range().start, object, "Urdf::MissingElement", what, format!("add <{name} .../>"));
        }
        c
    }
    fn required_number(&mut self, n: Node<'_, '_>, name: &'static str, object: &str) -> f64 {
        self.required(n, name, object).and_then(|a| self.numbers(a, object)).map_or(0.0, |[x]| x)
    }

    /// Exactly `N` finite numbers; every token that is not one is reported.
    fn numbers<const N: usize>(&mut self, a: Attribute<'_, '_>, object: &str) -> Option<[f64; N]> {
        if is_expression(a.value()) {
            return None; // reported by `check`
        }
        let (mut out, mut found, mut good) = ([0.0; N], 0, true);
        let at = a.range_value().start;
        for token in a.value().split_whitespace() {
            match token.parse::<f64>() {
                Ok(x) if x.is_finite() => {
                    if let Some(slot) = out.get_mut(found) {
                        *slot = x;
                    }
                }
                Ok(_) => {
                    good = false;
                    let what = format!("{} = {} is not finite", a.name(), clip(token));
                    self.err(at, object, "Urdf::NotFinite", what, "give a finite number in SI units".into());
                }
                Err(_) => {
                    good = false;
                    let what = format!("'{}' in {}=\"{}\" is not a number", clip(token), a.name(), clip(a.value()));
                    let hint =
                        if token.contains(',') { "write a decimal point, not a comma" } else { "remove or mend it" };
                    self.err(at, object, "Urdf::BadNumber", what, hint.into());
                }
            }
            found += 1;
        }
        if found != N && good {
            good = false;
            let what = format!("{}=\"{}\" holds {found} numbers, expected {N}", a.name(), clip(a.value()));
            self.err(at, object, "Urdf::BadNumber", what, format!("give {N} numbers separated by blanks"));
        }
        good.then_some(out)
    }
}

/// The first child element of a name.
fn child<'a, 'i>(n: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    n.children().find(|c| c.is_element() && c.tag_name().name() == name)
}

/// True for an `<origin>` that moves nothing.
fn is_identity(n: Node<'_, '_>) -> bool {
    let zero = |t: &str| t.split_whitespace().all(|x| x.parse::<f64>().is_ok_and(|x| x == 0.0));
    n.tag_name().name() == "origin" && ["xyz", "rpy"].iter().all(|a| n.attribute(*a).is_none_or(zero))
}

/// True for what xacro would compute.
fn is_expression(value: &str) -> bool {
    value.contains("${") || value.contains("$(")
}
