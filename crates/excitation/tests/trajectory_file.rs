//! Trajectories as files: bit for bit there and back, and every way in which a file can be wrong.

use crate::common::paper;
use excitation::plan::Extent;
use excitation::plan::Shape;
use excitation::trajectory::{Origin, Samples, named_joints, write_csv};
use excitation::*;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::{BSplineMotion, Knots};
use ff_model::diagnostics::Limit;
use ff_model::{Model, Problem, Problems};
use ff_testkit::assert_within;
use ff_testkit::problem::assert_violation;
use nalgebra::DMatrix;
use serde_json::{Value, json};

fn model() -> Model {
    paper("flex.toml").model
}

/// Numbers with all their digits, among them some that print in exponent form.
fn spline(model: &Model) -> TrajectoryFile {
    let mut t = vec![0.0; 6];
    t.extend([7.123_456_789_012_345, 13.1, 13.1, 29.999_999_999_999_996]);
    t.extend([41.7; 6]);
    let knots = Knots::new(5, t).unwrap();
    let control = DMatrix::from_fn(7, knots.count(), |i, k| {
        let x = ((1.7 * i as f64 + 0.3) * (k as f64 + 0.1)).sin() / 3.0;
        if (i, k) == (3, 4) { -1.234_567_890_123_456_7e-17 } else { x }
    });
    let origin =
        Origin { robot: "paper".into(), goal: "information".into(), seed: u64::MAX, program: "test \"1\"".into() };
    let motion = BSplineMotion::new(knots, control).unwrap();
    TrajectoryFile { joints: named_joints(model), origin, trajectory: Trajectory::Spline(motion) }
}

fn manoeuvre(model: &Model) -> TrajectoryFile {
    let command =
        |joint, shape, extent| JointCommand { joint, shape, extent, velocity: 0.17, acceleration: 0.1 + 0.05 / 3.0 };
    let spec = ManoeuvreSpec {
        start: (0..7).map(|i| 0.1 * i as f64 / 0.7).collect(),
        commands: vec![
            command(3, Shape::Doublet, Extent::HalfPeriod { frequency: 0.229 / 1.01, negative: true }),
            command(1, Shape::Single, Extent::Angle(-0.37 / 1.3)),
        ],
        ramp: 0.1,
        lead: 1.0 / 3.0,
        hold: 20.2,
        grid: Some(0.01),
    };
    let m = Manoeuvre::new(&spec).unwrap();
    TrajectoryFile {
        joints: named_joints(model),
        origin: Origin::default(),
        trajectory: Trajectory::Manoeuvre(spec, m),
    }
}

fn bits(m: &dyn JointMotion) -> Vec<u64> {
    let n = m.dof();
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut out = vec![m.duration().to_bits()];
    for k in 0..500 {
        m.eval(m.duration() * f64::from(k) / 499.0, &mut q, &mut qd, &mut qdd);
        out.extend(q.iter().chain(&qd).chain(&qdd).map(|x| x.to_bits()));
    }
    out
}

#[test]
fn json_is_read_back_bit_for_bit() {
    let m = model();
    for f in [spline(&m), manoeuvre(&m)] {
        let text = f.to_json();
        let back = TrajectoryFile::from_json(&text).unwrap();
        assert_eq!(back, f);
        assert_eq!(bits(back.trajectory.motion()), bits(f.trajectory.motion()));
        assert_eq!(back.to_json(), text);
        assert_eq!(f.clone().for_model(&m).unwrap(), f);
    }
    // Equality of floats does not tell -0 from 0; bits do.
    let Trajectory::Spline(a) = spline(&m).trajectory else { unreachable!() };
    let Trajectory::Spline(b) = TrajectoryFile::from_json(&spline(&m).to_json()).unwrap().trajectory else {
        unreachable!()
    };
    let all =
        |s: &BSplineMotion| -> Vec<u64> { s.control().iter().chain(s.knots().knots()).map(|x| x.to_bits()).collect() };
    assert_eq!(all(&a), all(&b));
}

#[test]
fn joints_in_another_order_are_put_right() {
    let m = model();
    for f in [spline(&m), manoeuvre(&m)] {
        let mut v: Value = serde_json::from_str(&f.to_json()).unwrap();
        let turn = |list: &mut Value| list.as_array_mut().unwrap().rotate_left(3);
        turn(&mut v["joints"]);
        for key in ["control_points", "start"] {
            if v["motion"].get(key).is_some() {
                turn(&mut v["motion"][key]);
            }
        }
        let back = TrajectoryFile::from_json(&v.to_string()).unwrap();
        assert_ne!(back.joints, f.joints);
        assert_eq!(back.for_model(&m).unwrap(), f);
    }
}

/// The one error of a text.
fn error(text: &str) -> Problem {
    let p = TrajectoryFile::from_json(text).and_then(|f| f.for_model(&model())).unwrap_err();
    assert_eq!(p.exit_code(), 12, "{p}");
    assert!(p.0.len() == 1 && p.0[0].hint.is_some(), "{p}");
    p.0[0].clone()
}

/// Asserts code and object of the one error of a text, and that it gives the names and numbers which the user has to look for.
fn assert_error(text: &str, code: &str, object: Option<&str>, names: &[&str]) {
    let p = error(text);
    assert_eq!((p.code, p.object.as_deref()), (code, object), "{p}");
    let line = p.to_string();
    assert!(names.iter().all(|s| line.contains(s)), "{names:?} in {line}");
}

#[test]
fn every_mistake_of_a_json_file_is_named() {
    let m = model();
    let text = spline(&m).to_json();
    let good: Value = serde_json::from_str(&text).unwrap();
    let changed = |f: &dyn Fn(&mut Value)| {
        let mut v = good.clone();
        f(&mut v);
        v.to_string()
    };
    for cut in
        [String::new(), text[..text.len() / 2].to_owned(), text.replace("41.7", "NaN"), text.replace("41.7", "1e999")]
    {
        let p = error(&cut);
        assert!(p.code == "Data::Syntax" && p.line.is_some_and(|l| l <= text.lines().count()), "{p}");
    }
    assert_error("[]", "Data::WrongType", Some("file"), &[]);
    let cases: Vec<(String, &str, &str, &[&str])> = vec![
        (changed(&|v| v["format"] = json!("other")), "Data::Format", "format", &["other", "ffid-trajectory"]),
        (
            changed(&|v| v["motion"]["control_points"][2][5] = json!(null)),
            "Data::NotFinite",
            "motion.control_points[2][5]",
            &[],
        ),
        (changed(&|v| v["motion"]["knots_s"][7] = json!("NaN")), "Data::NotFinite", "motion.knots_s[7]", &[]),
        (changed(&|v| v["motion"]["knots_s"][7] = json!("7")), "Data::WrongType", "motion.knots_s[7]", &[]),
        (changed(&|v| v["motion"]["knots_s"][7] = json!(99.0)), "Data::BadSpline", "motion", &["knot 8"]),
        (changed(&|v| v["motion"]["degree"] = json!(9)), "Data::BadSpline", "motion", &["9", "1..=7"]),
        (changed(&|v| v["motion"]["degree"] = json!(2.5)), "Data::WrongType", "motion.degree", &[]),
        (
            changed(&|v| v["motion"]["duration_s"] = json!(41.0)),
            "Data::BadSpline",
            "motion.duration_s",
            &["41 s", "41.7 s"],
        ),
        (
            changed(&|v| _ = v["motion"]["control_points"][6].as_array_mut().unwrap().pop()),
            "Data::WrongLength",
            "motion.control_points[6]",
            &["9", "10"],
        ),
        (
            changed(&|v| _ = v["motion"]["control_points"].as_array_mut().unwrap().pop()),
            "Data::WrongLength",
            "motion.control_points",
            &["6", "7"],
        ),
        (
            changed(&|v| _ = v["motion"].as_object_mut().unwrap().remove("degree")),
            "Data::MissingKey",
            "motion",
            &["degree"],
        ),
        (changed(&|v| v["origin"]["sed"] = json!(1)), "Data::UnknownKey", "origin", &["sed", "seed"]),
        (changed(&|v| v["motion"]["kind"] = json!("fourier")), "Data::Format", "motion.kind", &["fourier"]),
        (changed(&|v| v["joints"][3]["name"] = json!("joint1")), "Data::DuplicateName", "joints[3]", &["joint1"]),
        (changed(&|v| v["joints"][3]["name"] = json!("jont4")), "Data::NameMismatch", "joints", &["joint4", "jont4"]),
        (changed(&|v| v["joints"][3]["unit"] = json!("deg")), "Data::Unit", "joints[3].unit", &["deg"]),
        (changed(&|v| v["joints"][3]["unit"] = json!("m")), "Data::Unit", "joint4", &["rad"]),
    ];
    for (text, code, object, names) in cases {
        assert_error(&text, code, Some(object), names);
    }
    let p = error(&changed(&|v| v["joints"] = json!([])));
    assert_eq!((p.code, p.object.as_deref()), ("Data::WrongLength", Some("joints")));
    assert_violation(&p, 0.0, Limit::Within(1.0, 10_000.0), "joints");
    let p = error(&changed(&|v| v["version"] = json!(2)));
    assert_eq!((p.code, p.object.as_deref()), ("Data::Version", Some("version")));
    assert_violation(&p, 2.0, Limit::AtMost(1.0), "");
}

#[test]
fn every_mistake_of_a_manoeuvre_is_named() {
    let good: Value = serde_json::from_str(&manoeuvre(&model()).to_json()).unwrap();
    let changed = |f: &dyn Fn(&mut Value)| {
        let mut v = good.clone();
        f(&mut v["motion"]);
        v.to_string()
    };
    let cases: Vec<(String, &str, &str, &[&str])> = vec![
        (
            changed(&|v| v["commands"][0]["joint"] = json!("joint9")),
            "Data::UnknownJoint",
            "motion.commands[0].joint",
            &["joint9"],
        ),
        (
            changed(&|v| v["commands"][0]["shape"] = json!("triplet")),
            "Data::Format",
            "motion.commands[0].shape",
            &["triplet"],
        ),
        (changed(&|v| v["commands"][1]["joint"] = json!("joint4")), "Data::BadManoeuvre", "motion", &["3"]),
        (changed(&|v| v["commands"][0]["negative"] = json!(1)), "Data::WrongType", "motion.commands[0].negative", &[]),
        (changed(&|v| v["ramp_s"] = json!(0.0)), "Data::BadManoeuvre", "motion", &["ramp", "0"]),
        (changed(&|v| v["ramp_s"] = json!(9.0)), "Data::BadManoeuvre", "motion", &["ramp"]),
        (changed(&|v| v["start"] = json!([1.0])), "Data::WrongLength", "motion.start", &["1", "7"]),
        (changed(&|v| v["grid_s"] = json!("x")), "Data::WrongType", "motion.grid_s", &[]),
    ];
    for (text, code, object, names) in cases {
        assert_error(&text, code, Some(object), names);
    }
}

#[test]
fn all_mistakes_are_reported_at_once() {
    let mut v: Value = serde_json::from_str(&spline(&model()).to_json()).unwrap();
    v["motion"]["control_points"][0][0] = json!(null);
    v["motion"]["control_points"][6][2] = json!("x");
    v["joints"][1]["unit"] = json!("deg");
    v["extra"] = json!(1);
    let p = TrajectoryFile::from_json(&v.to_string()).unwrap_err();
    for code in ["Data::UnknownKey", "Data::Unit"] {
        assert!(p.has(code), "{p}");
    }
}

#[test]
fn samples_are_read_back_bit_for_bit() {
    let m = model();
    let f = spline(&m);
    let s = Samples::of(f.trajectory.motion(), &f.joints, 0.01).unwrap();
    assert_eq!((s.len(), s.times[s.len() - 1]), (4171, 41.7));
    let (back, warnings) = Samples::from_csv(&write_csv(&s), &m).unwrap();
    assert!(warnings.0.is_empty(), "{warnings}");
    assert_eq!(back, s);
    // Between samples the quintic follows the spline.
    let table = back.table().unwrap();
    let (mut a, mut b) = ([[0.0; 7]; 3], [[0.0; 7]; 3]);
    let [q, qd, qdd] = &mut a;
    f.trajectory.motion().eval(17.3456, q, qd, qdd);
    let [q, qd, qdd] = &mut b;
    table.eval(17.3456, q, qd, qdd);
    for (x, y) in a.iter().flatten().zip(b.iter().flatten()) {
        assert_within!((x - y).abs(), 1e-9, "{x} {y}");
    }
    // Windows line ends, a byte order mark's worth of blanks and another order of columns change nothing.
    let crlf = write_csv(&s).replace('\n', "\r\n");
    assert_eq!(Samples::from_csv(&crlf, &m).unwrap().0, s);
}

/// Positions of a slow wave, as CSV with the given header and cells.
fn table(header: &str, cell: impl Fn(usize, usize) -> String) -> String {
    let columns = header.split(',').count();
    let row = |i: usize| (0..columns).map(|c| cell(i, c)).collect::<Vec<_>>().join(",") + "\n";
    format!("{header}\n{}", (0..40).map(row).collect::<String>())
}

fn header(kinds: &[(&str, &str)]) -> String {
    let all = kinds.iter().flat_map(|(k, u)| (1..=7).map(move |j| format!(",{k}.joint{j}[{u}]")));
    all.fold("time[s]".to_owned(), |h, c| h + &c)
}

fn wave(i: usize, c: usize) -> f64 {
    if c == 0 { 0.1 * i as f64 } else { 0.3 * (0.2 * i as f64 + c as f64).sin() }
}

#[test]
fn degrees_are_converted_and_times_start_at_zero() {
    let m = model();
    let radians = Samples::from_csv(&table(&header(&[("q", "rad")]), |i, c| wave(i, c).to_string()), &m).unwrap().0;
    let degrees = table(&header(&[("q", "deg")]), |i, c| {
        if c == 0 { (7.0 + wave(i, 0)).to_string() } else { wave(i, c).to_degrees().to_string() }
    });
    let converted = Samples::from_csv(&degrees, &m).unwrap().0;
    for (a, b) in radians.q.iter().zip(&converted.q).chain(radians.times.iter().zip(&converted.times)) {
        assert_within!((a - b).abs(), 1e-13, "{a} {b}");
    }
    assert!(converted.qd.is_none() && converted.table().is_none() && converted.times[0] == 0.0);
}

#[test]
fn every_mistake_of_a_csv_file_is_named() {
    let q = header(&[("q", "rad")]);
    let plain = table(&q, |i, c| wave(i, c).to_string());
    let with = |i0: usize, c0: usize, x: &str| {
        table(&q, |i, c| if (i, c) == (i0, c0) { x.to_owned() } else { wave(i, c).to_string() })
    };
    let head = |from: &str, to: &str| plain.replacen(from, to, 1);
    let rates = |factor: f64| {
        table(&header(&[("q", "rad"), ("qd", "rad/s")]), |i, c| match c {
            0..8 => wave(i, c).to_string(),
            _ => (factor * 0.6 * (0.2 * i as f64 + (c - 7) as f64).cos()).to_string(),
        })
    };
    let cases: Vec<(String, &str, &[&str])> = vec![
        (String::new(), "Data::NoSamples", &[]),
        (format!("{q}\n"), "Data::NoSamples", &[]),
        (plain.lines().take(5).map(|l| format!("{l}\n")).collect(), "Data::TooShort", &["4"]),
        (with(6, 3, "NaN"), "Data::NotFinite", &["t.csv:8", "q.joint3[rad]", "NaN"]),
        (with(6, 3, "1e400"), "Data::NotFinite", &["1e400"]),
        (with(6, 3, "0.1x"), "Data::BadNumber", &["0.1x"]),
        (with(6, 3, "0,1"), "Data::RowLength", &["9", "8"]),
        (plain[..plain.len() - 3].to_owned(), "Data::MaybeTruncated", &["t.csv:41"]),
        (plain.replace(',', ";"), "Data::Separator", &[]),
        (head("q.joint3[rad]", "q.joint2[rad]"), "Data::Columns", &["q.joint2[rad]"]),
        (head("q.joint3[rad]", "q.jont3[rad]"), "Data::NameMismatch", &["joint3", "q.jont3[rad]"]),
        (head("q.joint3[rad]", "q.joint3"), "Data::UnitMissing", &["q.joint3"]),
        (head("q.joint3[rad]", "q.joint3[mm]"), "Data::Unit", &["mm", "rad"]),
        (head("time[s]", "time[ms]"), "Data::Unit", &["ms", "[s]"]),
        (head("time[s]", "temp[K]"), "Data::NameMismatch", &["temp[K]"]),
        (head("q.joint7[rad]", "qd.joint7[rad/s]"), "Data::NameMismatch", &["joint7"]),
        (with(9, 0, "0.8"), "Data::NonMonotone", &["t.csv:11", "0.8 s"]),
        (
            table(&q, |i, c| if c == 0 { (100 * i).to_string() } else { wave(i, c).to_string() }),
            "Data::TimeScale",
            &["100 s"],
        ),
        (
            table(&q, |i, c| if c == 0 { (1.7e12 + 1e-3 * i as f64).to_string() } else { wave(i, c).to_string() }),
            "Data::TimeScale",
            &[],
        ),
        (rates(180.0 / std::f64::consts::PI), "Data::LooksLikeDegrees", &["57.3"]),
        (rates(1.1), "Data::Rates", &["5 %"]),
    ];
    let m = model();
    for (text, code, says) in cases {
        let p = Samples::from_csv(&text, &m).unwrap_err();
        let p = Problems(p.0.into_iter().map(|p| p.in_file("t.csv")).collect());
        assert!(p.has(code) && p.exit_code() == 12, "expected {code}: {p}");
        let text = p.to_string();
        assert!(says.iter().all(|s| text.contains(s)), "{says:?} in {text}");
    }
    assert!(Samples::from_csv(&rates(1.0), &m).is_ok());
}
