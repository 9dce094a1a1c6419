//! The JSON form of a trajectory.

use super::{FORMAT, NamedJoint, Origin, Trajectory, TrajectoryFile, VERSION, bad_manoeuvre, bad_spline, data};
use crate::plan::manoeuvre::{Extent, JointCommand, Manoeuvre, ManoeuvreSpec, Shape};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::{BSplineMotion, Knots};
use ff_model::diagnostics::{Limit, clip, nearest};
use ff_model::{Area, Problem, Problems};
use nalgebra::DMatrix;
use serde_json::{Map, Value, json};

/// Joints and control points beyond which a file is refused before anything is allocated for it.
const MAX_JOINTS: usize = 10_000;

pub(super) fn write(f: &TrajectoryFile) -> String {
    let joints: Vec<Value> = f.joints.iter().map(|j| json!({ "name": j.name, "unit": j.unit })).collect();
    let motion = match &f.trajectory {
        Trajectory::Spline(m) => {
            let points: Vec<Vec<f64>> = m.control().row_iter().map(|r| r.iter().copied().collect()).collect();
            json!({
                "kind": "bspline",
                "degree": m.knots().degree(),
                "duration_s": m.duration(),
                "knots_s": m.knots().knots(),
                "control_points": points,
            })
        }
        Trajectory::Manoeuvre(s, _) => {
            let commands: Vec<Value> = s.commands.iter().map(|c| command(c, &f.joints)).collect();
            json!({
                "kind": "manoeuvre",
                "start": s.start,
                "commands": commands,
                "ramp_s": s.ramp,
                "lead_s": s.lead,
                "hold_s": s.hold,
                "grid_s": s.grid,
            })
        }
    };
    let o = &f.origin;
    let all = json!({
        "format": FORMAT,
        "version": VERSION,
        "origin": { "robot": o.robot, "goal": o.goal, "seed": o.seed, "program": o.program },
        "joints": joints,
        "motion": motion,
    });
    format!("{all:#}\n")
}

fn command(c: &JointCommand, joints: &[NamedJoint]) -> Value {
    let mut v = json!({
        "joint": joints[c.joint].name,
        "shape": if c.shape == Shape::Single { "single" } else { "doublet" },
        "velocity": c.velocity,
        "acceleration": c.acceleration,
    });
    match c.extent {
        Extent::Angle(a) => v["angle"] = json!(a),
        Extent::HalfPeriod { frequency, negative } => {
            v["frequency_hz"] = json!(frequency);
            v["negative"] = json!(negative);
        }
    }
    v
}

pub(super) fn read(text: &str) -> Result<TrajectoryFile, Problems> {
    let root: Value = serde_json::from_str(text).map_err(|e| {
        let cut = if e.is_eof() { "the file ends too early" } else { "is not JSON" };
        let p = data("Data::Syntax", format!("{cut}: {}", clip(&e.to_string()))).at(e.line(), e.column());
        Problems(vec![p.hint("write the file again; numbers must be finite")])
    })?;
    let mut bad = Problems::default();
    let found = file(&root, &mut bad);
    bad.finish(found).map(|(f, _)| f)
}

/// One JSON object read key by key; what was not asked for is reported at the end.
struct Object<'v> {
    map: &'v Map<String, Value>,
    path: String,
    asked: Vec<&'static str>,
}

impl<'v> Object<'v> {
    fn new(v: &'v Value, path: &str, bad: &mut Problems) -> Option<Self> {
        let Value::Object(map) = v else {
            bad.push(wrong(path, v, "an object"));
            return None;
        };
        Some(Self { map, path: path.to_owned(), asked: Vec::new() })
    }
    fn name(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }
    fn optional(&mut self, key: &'static str) -> Option<&'v Value> {
        self.asked.push(key);
        self.map.get(key)
    }
    fn get(&mut self, key: &'static str, bad: &mut Problems) -> Option<&'v Value> {
        let v = self.optional(key);
        if v.is_none() {
            let object = if self.path.is_empty() { "file" } else { &self.path };
            bad.push(
                data("Data::MissingKey", format!("'{key}' is missing")).on(object).hint("the file may be cut short"),
            );
        }
        v
    }
    fn text(&mut self, key: &'static str, bad: &mut Problems) -> Option<&'v str> {
        let v = self.get(key, bad)?;
        let s = v.as_str();
        if s.is_none() {
            bad.push(wrong(&self.name(key), v, "a text"));
        }
        s
    }
    fn number(&mut self, key: &'static str, bad: &mut Problems) -> Option<f64> {
        let v = self.get(key, bad)?;
        number(v, &self.name(key), bad)
    }
    fn whole(&mut self, key: &'static str, bad: &mut Problems) -> Option<u64> {
        let v = self.get(key, bad)?;
        if v.as_u64().is_none() {
            bad.push(wrong(&self.name(key), v, "a whole number of zero or more"));
        }
        v.as_u64()
    }
    fn list(&mut self, key: &'static str, bad: &mut Problems) -> Option<&'v Vec<Value>> {
        let v = self.get(key, bad)?;
        if v.as_array().is_none() {
            bad.push(wrong(&self.name(key), v, "a list"));
        }
        v.as_array()
    }
    fn numbers(&mut self, key: &'static str, bad: &mut Problems) -> Option<Vec<f64>> {
        let v = self.get(key, bad)?;
        numbers(v, &self.name(key), bad)
    }
    fn finish(&self, bad: &mut Problems) {
        for k in self.map.keys().filter(|k| !self.asked.contains(&k.as_str())) {
            let p = data("Data::UnknownKey", format!("unknown key '{}'", clip(k)));
            let p = p.on(if self.path.is_empty() { "file" } else { &self.path });
            bad.push(match nearest(k, self.asked.iter().copied()) {
                Some(n) => p.hint(format!("did you mean {n}?")),
                None => p.hint(format!("known keys: {}", self.asked.join(", "))),
            });
        }
    }
}

fn wrong(path: &str, found: &Value, wanted: &str) -> Problem {
    let kind = match found {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    };
    let path = if path.is_empty() { "file" } else { path };
    data("Data::WrongType", format!("is {kind}, must be {wanted}")).on(path).hint(format!("give {wanted}"))
}

fn number(v: &Value, path: &str, bad: &mut Problems) -> Option<f64> {
    let x = v.as_f64();
    // JSON has no NaN: writers that meet one put null, or the word as a text.
    let not_a_number = v.is_null() || v.as_str().is_some_and(|s| s.parse::<f64>().is_ok_and(|x| !x.is_finite()));
    match x.filter(|x| x.is_finite()) {
        Some(x) => return Some(x),
        None if x.is_some() || not_a_number => {
            bad.push(
                data("Data::NotFinite", format!("{v} is not a finite number")).on(path).hint("write the file again"),
            );
        }
        None => bad.push(wrong(path, v, "a number")),
    }
    None
}

fn numbers(v: &Value, path: &str, bad: &mut Problems) -> Option<Vec<f64>> {
    let Some(all) = v.as_array() else {
        bad.push(wrong(path, v, "a list of numbers"));
        return None;
    };
    let read: Vec<Option<f64>> = all.iter().enumerate().map(|(i, x)| number(x, &format!("{path}[{i}]"), bad)).collect();
    read.into_iter().collect()
}

fn file(root: &Value, bad: &mut Problems) -> Option<TrajectoryFile> {
    let mut o = Object::new(root, "", bad)?;
    // Another program's file, or another version: nothing else in it can be judged.
    let format = o.text("format", bad)?;
    if format != FORMAT {
        let what = format!("format is '{}', must be '{FORMAT}'", clip(format));
        bad.push(
            data("Data::Format", what).on("format").hint("give a trajectory written by `ffid excite`, or a CSV file"),
        );
        return None;
    }
    let version = o.whole("version", bad)?;
    if version > VERSION {
        bad.push(Problem::newer_format(Area::Data, "Data::Version", version, VERSION).on("version"));
        return None;
    }
    if version == 0 {
        let p = Problem::out_of_range(Area::Data, "Data::Version", 0.0, Limit::AtLeast(1.0), "").on("version");
        bad.push(p.hint("write the trajectory again with `ffid excite`"));
        return None;
    }
    let origin = o.get("origin", bad).and_then(|v| origin(v, bad));
    let joints = o.list("joints", bad).and_then(|v| joints(v, bad));
    let motion = o.get("motion", bad);
    o.finish(bad);
    let (origin, joints, motion) = (origin?, joints?, motion?);
    let trajectory = trajectory(motion, &joints, bad)?;
    Some(TrajectoryFile { joints, origin, trajectory })
}

fn origin(v: &Value, bad: &mut Problems) -> Option<Origin> {
    let mut o = Object::new(v, "origin", bad)?;
    let (robot, goal) = (o.text("robot", bad), o.text("goal", bad));
    let (seed, program) = (o.whole("seed", bad), o.text("program", bad));
    o.finish(bad);
    Some(Origin { robot: robot?.to_owned(), goal: goal?.to_owned(), seed: seed?, program: program?.to_owned() })
}

fn joints(all: &[Value], bad: &mut Problems) -> Option<Vec<NamedJoint>> {
    if all.is_empty() || all.len() > MAX_JOINTS {
        let (count, limit) = (all.len() as f64, Limit::Within(1.0, MAX_JOINTS as f64));
        let p = Problem::out_of_range(Area::Data, "Data::WrongLength", count, limit, "joints");
        bad.push(p.on("joints").hint("name every joint once"));
        return None;
    }
    let mut out: Vec<NamedJoint> = Vec::with_capacity(all.len());
    let mut good = true;
    for (i, v) in all.iter().enumerate() {
        let path = format!("joints[{i}]");
        let Some(mut o) = Object::new(v, &path, bad) else {
            good = false;
            continue;
        };
        let (name, unit) = (o.text("name", bad), o.text("unit", bad));
        o.finish(bad);
        let unit = unit.and_then(|u| {
            let known = ["rad", "m"].into_iter().find(|k| *k == u);
            if known.is_none() {
                let what = format!("unit '{}', must be rad or m", clip(u));
                bad.push(data("Data::Unit", what).on(format!("{path}.unit")).hint("convert the control points"));
            }
            known
        });
        let (Some(name), Some(unit)) = (name, unit) else {
            good = false;
            continue;
        };
        if out.iter().any(|j| j.name == name) {
            let what = format!("joint '{}' is named twice", clip(name));
            bad.push(data("Data::DuplicateName", what).on(path).hint("name every joint once"));
            good = false;
        }
        out.push(NamedJoint { name: name.to_owned(), unit });
    }
    good.then_some(out)
}

fn trajectory(v: &Value, joints: &[NamedJoint], bad: &mut Problems) -> Option<Trajectory> {
    let mut o = Object::new(v, "motion", bad)?;
    match o.text("kind", bad)? {
        "bspline" => spline(o, joints.len(), bad).map(Trajectory::Spline),
        "manoeuvre" => {
            let spec = manoeuvre(o, joints, bad)?;
            match Manoeuvre::new(&spec) {
                Ok(m) => Some(Trajectory::Manoeuvre(spec, m)),
                Err(e) => {
                    bad.extend(bad_manoeuvre(&e));
                    None
                }
            }
        }
        other => {
            let what = format!("kind '{}', must be bspline or manoeuvre", clip(other));
            bad.push(data("Data::Format", what).on("motion.kind").hint("give a trajectory written by `ffid excite`"));
            None
        }
    }
}

fn spline(mut o: Object<'_>, n: usize, bad: &mut Problems) -> Option<BSplineMotion> {
    let degree = o.whole("degree", bad);
    let duration = o.number("duration_s", bad);
    let knots = o.numbers("knots_s", bad);
    let rows = o.list("control_points", bad);
    o.finish(bad);
    let (degree, duration, knots, rows) = (degree?, duration?, knots?, rows?);
    if rows.len() != n {
        let what = format!("{} rows for {n} joints", rows.len());
        bad.push(data("Data::WrongLength", what).on("motion.control_points").hint("give one row per joint"));
        return None;
    }
    let points: Vec<Option<Vec<f64>>> =
        rows.iter().enumerate().map(|(i, r)| numbers(r, &format!("motion.control_points[{i}]"), bad)).collect();
    let points: Vec<Vec<f64>> = points.into_iter().collect::<Option<_>>()?;
    let knots = match Knots::new(usize::try_from(degree).unwrap_or(usize::MAX), knots) {
        Ok(k) => k,
        Err(e) => {
            bad.extend(bad_spline(&e));
            return None;
        }
    };
    if knots.duration() != duration {
        let what = format!("duration_s is {duration} s, the last knot is at {} s", knots.duration());
        bad.push(data("Data::BadSpline", what).on("motion.duration_s").hint("they must be the same number"));
        return None;
    }
    let mut good = true;
    for (i, row) in points.iter().enumerate().filter(|(_, r)| r.len() != knots.count()) {
        let what = format!("{} control points; degree and knots ask for {}", row.len(), knots.count());
        bad.push(
            data("Data::WrongLength", what).on(format!("motion.control_points[{i}]")).hint("the file may be cut short"),
        );
        good = false;
    }
    if !good {
        return None;
    }
    let control = DMatrix::from_fn(n, knots.count(), |i, k| points[i][k]);
    match BSplineMotion::new(knots, control) {
        Ok(m) => Some(m),
        Err(e) => {
            bad.extend(bad_spline(&e));
            None
        }
    }
}

fn manoeuvre(mut o: Object<'_>, joints: &[NamedJoint], bad: &mut Problems) -> Option<ManoeuvreSpec> {
    let start = o.numbers("start", bad);
    let commands = o.list("commands", bad);
    let (ramp, lead, hold) = (o.number("ramp_s", bad), o.number("lead_s", bad), o.number("hold_s", bad));
    let grid = match o.optional("grid_s") {
        None | Some(Value::Null) => Some(None),
        Some(v) => number(v, "motion.grid_s", bad).map(Some),
    };
    o.finish(bad);
    let start = start?;
    if start.len() != joints.len() {
        let what = format!("{} positions for {} joints", start.len(), joints.len());
        bad.push(data("Data::WrongLength", what).on("motion.start").hint("give one position per joint"));
        return None;
    }
    let commands: Vec<Option<JointCommand>> =
        commands?.iter().enumerate().map(|(i, v)| read_command(v, i, joints, bad)).collect();
    let commands = commands.into_iter().collect::<Option<_>>()?;
    Some(ManoeuvreSpec { start, commands, ramp: ramp?, lead: lead?, hold: hold?, grid: grid? })
}

fn read_command(v: &Value, i: usize, joints: &[NamedJoint], bad: &mut Problems) -> Option<JointCommand> {
    let path = format!("motion.commands[{i}]");
    let mut o = Object::new(v, &path, bad)?;
    let name = o.text("joint", bad);
    let shape = o.text("shape", bad);
    let (velocity, acceleration) = (o.number("velocity", bad), o.number("acceleration", bad));
    let extent = if o.map.contains_key("angle") {
        o.number("angle", bad).map(Extent::Angle)
    } else {
        let frequency = o.number("frequency_hz", bad);
        let negative = o.get("negative", bad).and_then(|v| {
            if v.as_bool().is_none() {
                bad.push(wrong(&format!("{path}.negative"), v, "true or false"));
            }
            v.as_bool()
        });
        frequency.zip(negative).map(|(frequency, negative)| Extent::HalfPeriod { frequency, negative })
    };
    o.finish(bad);
    let joint = name.and_then(|n| {
        let j = joints.iter().position(|j| j.name == n);
        if j.is_none() {
            let what = format!("the file has no joint '{}'", clip(n));
            let p = data("Data::UnknownJoint", what).on(format!("{path}.joint"));
            bad.push(match nearest(n, joints.iter().map(|j| j.name.as_str())) {
                Some(n) => p.hint(format!("did you mean {n}?")),
                None => p.hint("name a joint of `joints`"),
            });
        }
        j
    });
    let shape = shape.and_then(|s| match s {
        "single" => Some(Shape::Single),
        "doublet" => Some(Shape::Doublet),
        _ => {
            let what = format!("shape '{}', must be single or doublet", clip(s));
            bad.push(
                data("Data::Format", what).on(format!("{path}.shape")).hint("write the file again with `ffid excite`"),
            );
            None
        }
    });
    Some(JointCommand {
        joint: joint?,
        shape: shape?,
        extent: extent?,
        velocity: velocity?,
        acceleration: acceleration?,
    })
}
