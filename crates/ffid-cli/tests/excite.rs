//! `ffid excite` and `ffid plan` through the real binary: goals, files, refusals, interruption.

use crate::common;
use crate::common::ffid;
use excitation::trajectory::Samples;
use excitation::{Trajectory, TrajectoryFile};
use ff_dynamics::motion::JointMotion;
use ffid::open::open;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A short, small plan: seconds, not minutes.
const SMALL: &str = "[excite]\nduration_s = 15.0\ncontrol_points = 4\nstarts = 2\niterations = 15\nhold_s = 10.0\n";

/// A folder with a mission: a fixture of the paper at 20 Hz, and more sections.
struct Case {
    dir: TempDir,
}

impl Case {
    fn new(fixture: &str, more: &str) -> Self {
        let folder = common::fixture("paper");
        let dir = tempfile::tempdir().unwrap();
        fs::copy(folder.join("robot.urdf"), dir.path().join("robot.urdf")).unwrap();
        let text = fs::read_to_string(folder.join(fixture)).unwrap().replace("rate_hz = 100.0", "rate_hz = 20.0");
        fs::write(dir.path().join("m.toml"), format!("{text}\n{more}")).unwrap();
        Self { dir }
    }
    /// With something in the text replaced.
    fn edited(fixture: &str, more: &str, from: &str, to: &str) -> Self {
        let c = Self::new(fixture, more);
        let text = fs::read_to_string(c.path("m.toml")).unwrap();
        assert!(text.contains(from));
        fs::write(c.path("m.toml"), text.replacen(from, to, 1)).unwrap();
        c
    }
    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }
    /// Exit code, standard output, standard error; run in the folder of the case.
    fn run(&self, args: &[&str]) -> (i32, String, String) {
        ffid(self.dir.path(), args)
    }
    fn json(&self, args: &[&str]) -> (i32, Value) {
        let (code, out, err) = self.run(&[args, &["--json"]].concat());
        assert!(err.is_empty(), "{err}");
        (code, serde_json::from_str(&out).unwrap())
    }
    /// The one error of a refusal.
    fn refused(&self, args: &[&str], exit: i32, code: &str, says: &[&str]) {
        let (found, out, err) = self.run(args);
        assert_eq!(found, exit, "{err}");
        assert!(out.is_empty(), "{out}");
        assert!(err.contains(&format!("error[{code}]")), "{code} in {err}");
        // JSON says the same.
        let (again, v) = self.json(args);
        assert_eq!((again, v["exit_code"].as_i64()), (exit, Some(i64::from(exit))));
        let found = v["problems"].as_array().unwrap().iter().any(|p| p["code"] == code && common::says(p, &err, says));
        assert!(found, "{says:?} in {err}\n{v}");
    }
    fn names(&self) -> Vec<String> {
        let all = fs::read_dir(self.dir.path()).unwrap();
        let mut all: Vec<String> = all.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        all.sort();
        all
    }
}

fn bits(m: &dyn JointMotion) -> Vec<u64> {
    let n = m.dof();
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut out = Vec::new();
    for k in 0..=300 {
        m.eval(m.duration() * f64::from(k) / 300.0, &mut q, &mut qd, &mut qdd);
        out.extend(q.iter().chain(&qd).chain(&qdd).map(|x| x.to_bits()));
    }
    out
}

#[test]
#[ignore = "full tier: 8 s"]
fn every_goal_gives_a_folder_that_is_whole_and_reads_back() {
    let c = Case::new("flex.toml", SMALL);
    let model = open(&c.path("m.toml"), Default::default()).unwrap().model;
    for goal in ["information", "modal", "quiet", "paper", "condition"] {
        let (code, v) = c.json(&["excite", "m.toml", "--goal", goal, "--out", goal]);
        assert_eq!(code, 0, "{goal}: {}", v["problems"]);
        assert_eq!(v["plan"]["goal"], goal);
        assert_eq!(v["verdict"]["limits_hold"], true);
        let out = c.path(goal);
        let written = TrajectoryFile::load(&out.join("trajectory.json"), &model).unwrap();
        assert_eq!(written.origin.goal, goal);
        let (samples, _) = Samples::load(&out.join("trajectory.csv"), &model).unwrap();
        let motion = written.trajectory.motion();
        assert_eq!(samples, Samples::of(motion, &written.joints, 0.05).unwrap(), "{goal}");
        // What is printed is what is written.
        let verdict: Value = serde_json::from_str(&fs::read_to_string(out.join("verdict.json")).unwrap()).unwrap();
        assert_eq!(verdict, v["verdict"]);
        assert!(verdict["parameters"].as_array().unwrap().len() == 18);
        let manifest: toml::Table = toml::from_str(&fs::read_to_string(out.join("manifest.toml")).unwrap()).unwrap();
        let listed: Vec<&str> =
            manifest["file"].as_array().unwrap().iter().map(|f| f["file"].as_str().unwrap()).collect();
        let figures = ["deviations.svg", "response.svg", "spectrum.svg", "trajectory.svg"];
        for name in
            figures.iter().chain(&["report.html", "report.txt", "trajectory.csv", "trajectory.json", "verdict.json"])
        {
            assert!(listed.contains(name), "{name} in {listed:?}");
        }
        for f in figures {
            assert!(fs::read_to_string(out.join(f)).unwrap().starts_with("<svg"));
        }
        let is_spline = matches!(written.trajectory, Trajectory::Spline(_));
        assert_eq!(is_spline, goal != "paper");
    }
    assert!(c.names().iter().all(|n| !n.contains("partial") && !n.contains("lock")), "{:?}", c.names());
}

/// The plan that is taken is the best of several with what the mission is not sure of, which costs.
#[test]
#[ignore = "full tier: 8 s"]
fn plans_are_compared_with_what_the_mission_is_not_sure_of() {
    const UNSURE: &str = "\n[[uncertain]]\nbodies = [\"*\"]\nmass_relative_std = 0.02\ncom_std_m = 0.003\n\n\
        [[uncertain]]\nmounts = [\"*\"]\nposition_std_m = 0.003\nangle_std_rad = 0.002\n";
    let gains = ("noise_std_nm = 0.1 ", "gain_relative_std = 0.01\nnoise_std_nm = 0.1 ");
    let c = Case::edited("flex.toml", &format!("{SMALL}{UNSURE}"), gains.0, gains.1);
    let (code, v) = c.json(&["excite", "m.toml", "--out", "d"]);
    assert_eq!(code, 0, "{}", v["problems"]);
    let (plan, verdict) = (&v["plan"], &v["verdict"]);
    let of = |key: &str| plan["in_world"][key].as_f64().unwrap_or_else(|| panic!("{key}: {plan}"));
    assert!(of("cost") <= of("cost_of_exact_choice") && of("compared") >= 2.0, "{plan}");
    // Eighteen variances are larger by more than a tenth each.
    assert!(of("cost") > of("cost_if_exact") + 1.8, "{plan}");
    assert_eq!(of("uncertain") as usize, verdict["uncertain"].as_array().unwrap().len());
    assert_eq!(verdict["budget"].as_array().unwrap().len(), verdict["parameters"].as_array().unwrap().len());
    // A goal without a covariance says that it does not know them.
    let (code, v) = c.json(&["excite", "m.toml", "--goal", "condition", "--out", "e"]);
    assert!(code == 0 && v["plan"]["in_world"].is_null());
    assert!(
        v["plan"]["notes"].as_array().unwrap().iter().any(|n| n.as_str().unwrap().contains("not sure of")),
        "{}",
        v["plan"]
    );
}

#[test]
#[ignore = "full tier: 6 s"]
fn equal_seeds_give_equal_bytes_and_others_do_not() {
    let c = Case::new("slosh.toml", SMALL);
    for (out, seed) in [("a", "5"), ("b", "5"), ("c", "6")] {
        assert_eq!(c.run(&["excite", "m.toml", "--out", out, "--seed", seed, "--quiet"]).0, 0);
    }
    let read = |d: &str, f: &str| fs::read(c.path(d).join(f)).unwrap();
    for f in ["trajectory.json", "trajectory.csv", "verdict.json", "report.txt", "manifest.toml", "spectrum.svg"] {
        assert_eq!(read("a", f), read("b", f), "{f}");
    }
    assert_ne!(read("a", "trajectory.json"), read("c", "trajectory.json"));
}

#[test]
#[ignore = "full tier: 2 s"]
fn a_planned_trajectory_is_judged_as_it_was_when_planned() {
    let c = Case::new("slosh.toml", SMALL);
    let (_, planned) = c.json(&["excite", "m.toml", "--out", "p"]);
    let (code, judged) = c.json(&["plan", "m.toml", "--trajectory", "p/trajectory.json", "--out", "v"]);
    assert_eq!(code, 0);
    assert_eq!(judged["verdict"], planned["verdict"]);
    assert!(c.path("v").join("verdict.json").exists() && !c.path("v").join("trajectory.json").exists());
    // As samples it is the same motion; only the proof of its limits is another.
    let (code, sampled) = c.json(&["plan", "m.toml", "--trajectory", "p/trajectory.csv"]);
    assert_eq!(code, 0, "{}", sampled["problems"]);
    let std = |v: &Value, i: usize| v["verdict"]["parameters"][i]["std"].as_f64().unwrap();
    for i in 0..16 {
        assert!((std(&sampled, i) / std(&planned, i) - 1.0).abs() < 1e-6);
    }
    assert_eq!(
        (sampled["verdict"]["limits"][0]["proof"].as_str(), judged["verdict"]["limits"][0]["proof"].as_str()),
        (Some("samples"), Some("all_time"))
    );
    // Positions alone are fitted.
    let text = fs::read_to_string(c.path("p/trajectory.csv")).unwrap();
    let cut = |l: &str| l.split(',').take(8).collect::<Vec<_>>().join(",") + "\n";
    fs::write(c.path("q.csv"), text.lines().map(cut).collect::<String>()).unwrap();
    let (code, fitted) = c.json(&["plan", "m.toml", "--trajectory", "q.csv"]);
    assert_eq!(code, 0, "{}", fitted["problems"]);
    for i in 0..16 {
        assert!((std(&fitted, i) / std(&planned, i) - 1.0).abs() < 0.02);
    }
    // Bit for bit, also through the binary.
    let model = open(&c.path("m.toml"), Default::default()).unwrap().model;
    let a = TrajectoryFile::load(&c.path("p/trajectory.json"), &model).unwrap();
    fs::write(c.path("again.json"), a.to_json()).unwrap();
    let b = TrajectoryFile::load(&c.path("again.json"), &model).unwrap();
    assert_eq!(bits(a.trajectory.motion()), bits(b.trajectory.motion()));
}

#[test]
fn text_says_what_matters() {
    let c = Case::new("flex.toml", SMALL);
    let (code, out, _) = c.run(&["excite", "m.toml", "--goal", "paper"]);
    assert_eq!(code, 0);
    for piece in [
        "paper plan, ",
        "verdict on ",
        "base.mass               600.0 kg       +-",
        "weak: above 10.00 %",
        "modes at the start pose",
        "0.1126 Hz",
        "base attitude at most",
        "excitation at the modes",
        "limits are kept; the closest:",
        "for all time",
        "a rigid identification of the base",
        "written to m-paper",
    ] {
        assert!(out.contains(piece), "{piece:?} is missing in\n{out}");
    }
    let (code, out, _) = c.run(&["excite", "m.toml", "--goal", "paper", "--out", "x", "--quiet"]);
    assert_eq!((code, out.as_str()), (0, ""));
}

#[test]
fn settings_that_make_no_sense_are_refused() {
    let section = |text: &str| Case::new("flex.toml", &format!("[excite]\n{text}\n"));
    let cases: [(&str, &str, &[&str]); 14] = [
        ("gaol = \"modal\"", "Config::UnknownKey", &["excite", "'gaol'", "goal"]),
        ("goal = \"model\"", "Config::UnknownChoice", &["excite.goal", "'model'", "modal"]),
        ("duration_s = 0.0", "Config::OutOfRange", &["excite.duration_s", "value 0 s, limit > 0 s"]),
        ("duration_s = 9.0\nduration_bounds_s = [1.0, 2.0]", "Config::Conflict", &["duration_bounds_s"]),
        ("duration_bounds_s = [30.0, 20.0]", "Config::OutOfRange", &["30 .. 20 s"]),
        ("degree = 2", "Config::OutOfRange", &["excite.degree", "value 2, limit 3 to 7"]),
        ("control_points = 0", "Config::OutOfRange", &["excite.control_points"]),
        ("start_rad = [0.1, 0.2]", "Config::WrongLength", &["2 positions for 7 joints"]),
        (
            "end_rad = [0.1, 0.2, 9.0, 0, 0, 0, 0]",
            "Config::OutOfRange",
            &["joint3", "value 9 rad, limit -3.1 to 3.1 rad"],
        ),
        ("end = \"strat\"", "Config::UnknownChoice", &["start"]),
        ("parameters = [\"bse.*\"]", "Config::NoSuchParameter", &["excite.parameters[0]", "'bse.*'"]),
        ("joints = [\"joint22\"]", "Config::UnknownJoint", &["excite.joints", "joint2"]),
        ("frequency_error = 1.5", "Config::OutOfRange", &["value 1.5, limit < 1"]),
        ("duration_s = nan", "Config::NotFinite", &["excite.duration_s"]),
    ];
    for (text, code, says) in cases {
        section(text).refused(&["excite", "m.toml"], 11, code, says);
    }
    let limits = |line: &str| {
        Case::edited("flex.toml", SMALL, "velocity_rad_per_s = 0.17", &format!("velocity_rad_per_s = 0.17\n{line}"))
    };
    let cases: [(&str, &str, &[&str]); 6] = [
        ("jerk_rad_per_s2 = 1.0", "Config::UnknownKey", &["jerk_rad_per_s3"]),
        ("torque_nm = -1.0", "Config::OutOfRange", &["limits.torque_nm", "value -1 N m, limit > 0 N m"]),
        ("base_attitude_rad = 57.0", "Config::OutOfRange", &["value 57 rad, limit < 3.141592653589793 rad"]),
        (
            "pointing = [{ name = \"antenna\", axis = [0, 0, 0], target = [0, 0, 1], within_rad = 0.1 }]",
            "Config::ZeroAxis",
            &["axis"],
        ),
        (
            "pointing = [{ name = \"antenna\", axis = [0, 0, 1], target = [0, 0, 1] }]",
            "Config::MissingKey",
            &["within_rad"],
        ),
        (
            "pointing = [{ name = \"a\", axis = [0, 0, 1], target = [0, 0, 1], within_rad = 0.1, outside_rad = 0.2 }]",
            "Config::Conflict",
            &["outside_rad"],
        ),
    ];
    for (line, code, says) in cases {
        limits(line).refused(&["excite", "m.toml"], 11, code, says);
    }
}

#[test]
fn what_a_mission_lacks_is_named() {
    let c = Case::edited("flex.toml", SMALL, "noise_std_nm = 0.1", "noise_std_nm = 0.0");
    c.refused(&["excite", "m.toml"], 11, "Config::Excite", &["torque sensors is 0"]);
    c.refused(&["excite", "m.toml", "--goal", "paper"], 11, "Config::Verdict", &["torque sensors", "is 0"]);
    let c = Case::edited("flex.toml", SMALL, "acceleration_rad_per_s2 = 0.15", "");
    c.refused(&["excite", "m.toml"], 11, "Config::MissingKey", &["acceleration_rad_per_s2"]);
    let c = Case::new("flex.toml", SMALL);
    c.refused(&["excite", "robot.urdf"], 11, "Config::NoMission", &["robot.urdf", "mission file"]);
    c.refused(&["excite", "nowhere.toml"], 20, "Io::Read", &["nowhere.toml"]);
    assert!(c.names() == ["m.toml", "robot.urdf"], "{:?}", c.names());
    // Wrong usage is clap's.
    let (code, _, err) = c.run(&["excite", "m.toml", "--goal", "quite"]);
    assert!(code == 2 && err.contains("did you mean quiet?"), "{err}");
    assert_eq!(c.run(&["excite", "m.toml", "--starts", "0"]).0, 2);
    assert_eq!(c.run(&["plan", "m.toml"]).0, 2);
    for command in ["excite", "plan"] {
        let (code, out, _) = c.run(&[command, "--help"]);
        assert!(code == 0 && out.contains("Examples:") && out.contains("ffid plan m.toml --trajectory"), "{out}");
    }
}

/// Demands that cannot be met end with 13 and name what is in the way.
#[test]
fn infeasible_demands_are_answered() {
    let end = "end_rad = [1.5707963267948966, 1.4, 0.0, -1.0, 0.0, 2.4, 0.0]";
    let c = Case::new("flex.toml", &format!("[excite]\nduration_s = 4.0\ncontrol_points = 6\nstarts = 1\n{end}\n"));
    c.refused(&["excite", "m.toml"], 13, "Plan::Conflict", &["joint4", "speed", "0.17 rad/s", "limit 4 s"]);
    // The paper's move carries joint 4 beyond its range from here.
    let start = "start_rad = [1.57, 1.4, 0.0, 3.09, 0.0, 2.4, 0.0]";
    let c = Case::new("flex.toml", &format!("[excite]\ngoal = \"paper\"\n{start}\n"));
    c.refused(&["excite", "m.toml"], 13, "Plan::Infeasible", &["joint4", "upper position limit 3.1"]);
    assert_eq!(c.names(), ["m.toml", "robot.urdf"]);
}

#[test]
fn results_never_overwrite_and_need_a_place() {
    let c = Case::new("slosh.toml", SMALL);
    let args = ["excite", "m.toml", "--goal", "paper", "--out", "out"];
    assert_eq!(c.run(&args).0, 0);
    let before = fs::read(c.path("out/manifest.toml")).unwrap();
    c.refused(&args, 20, "Io::Exists", &["out", "--force"]);
    assert_eq!(fs::read(c.path("out/manifest.toml")).unwrap(), before);
    assert_eq!(c.run(&[&args[..], &["--force"]].concat()).0, 0);
    assert_eq!(fs::read(c.path("out.bak/manifest.toml")).unwrap(), before);
    // A folder cannot be made inside a file. (Permissions do not stop the superuser, who may run this test.)
    fs::write(c.path("file"), "x").unwrap();
    c.refused(&["excite", "m.toml", "--out", "file/out"], 20, "Io::Write", &["file"]);
    c.refused(&["plan", "m.toml", "--trajectory", "out/trajectory.json", "--out", "out"], 20, "Io::Exists", &["out"]);
    // Another run holds the lock.
    let lock = fs::File::create(c.path("busy.lock")).unwrap();
    lock.lock().unwrap();
    c.refused(&["excite", "m.toml", "--out", "busy"], 21, "Io::Locked", &["busy.lock"]);
    let names = c.names();
    assert_eq!(names, ["busy.lock", "file", "m.toml", "out", "out.bak", "robot.urdf"]);
}

#[test]
fn bad_trajectory_files_are_refused() {
    let c = Case::new("slosh.toml", SMALL);
    assert_eq!(c.run(&["excite", "m.toml", "--out", "p", "--quiet"]).0, 0);
    let json = fs::read_to_string(c.path("p/trajectory.json")).unwrap();
    let csv = fs::read_to_string(c.path("p/trajectory.csv")).unwrap();
    let judge = |name: &str, text: &str, exit: i32, code: &str, says: &[&str]| {
        fs::write(c.path(name), text).unwrap();
        c.refused(&["plan", "m.toml", "--trajectory", name], exit, code, &[says, &[name]].concat());
    };
    judge("cut.json", &json[..json.len() * 2 / 3], 12, "Data::Syntax", &["ends too early"]);
    judge("nan.json", &json.replacen("1.5", "NaN", 1).replacen("0.8", "NaN", 1), 12, "Data::Syntax", &["is not JSON"]);
    judge(
        "name.json",
        &json.replace("joint3", "jiont3"),
        12,
        "Data::NameMismatch",
        &["missing: joint3; extra: jiont3"],
    );
    judge("version.json", &json.replace("\"version\": 1", "\"version\": 7"), 12, "Data::Version", &["version 7"]);
    judge("key.json", &json.replacen("\"degree\"", "\"degre\"", 1), 12, "Data::UnknownKey", &["degree"]);
    judge("cut.csv", &csv[..csv.len() - 4], 12, "Data::MaybeTruncated", &["cut short"]);
    judge("nan.csv", &csv.replacen("\n0.05,", "\nNaN,", 1), 12, "Data::NotFinite", &["time[s]", "data row 2"]);
    judge("name.csv", &csv.replace("joint3", "jiont3"), 12, "Data::NameMismatch", &["q.jiont3[rad]"]);
    judge("unit.csv", &csv.replacen("q.joint3[rad]", "q.joint3", 1), 12, "Data::UnitMissing", &["q.joint3"]);
    c.refused(&["plan", "m.toml", "--trajectory", "none.json"], 20, "Io::Read", &["none.json"]);
    c.refused(&["plan", "m.toml", "--trajectory", "p"], 20, "Io::Read", &["directory"]);
}

/// A trajectory that does not keep the limits is judged, and the code says so.
#[test]
#[ignore = "full tier: 3 s"]
fn a_given_trajectory_beyond_the_limits_ends_with_13() {
    let c = Case::new("slosh.toml", SMALL);
    assert_eq!(c.run(&["excite", "m.toml", "--out", "p", "--quiet"]).0, 0);
    let text = fs::read_to_string(c.path("m.toml")).unwrap();
    let tight = "velocity_rad_per_s = 0.02\ntorque_nm = 0.05\nbase_attitude_rad = 1e-4\npassive_rad = 1e-5";
    fs::write(c.path("m.toml"), text.replace("velocity_rad_per_s = 0.17", tight)).unwrap();
    let (code, v) = c.json(&["plan", "m.toml", "--trajectory", "p/trajectory.json", "--out", "v"]);
    assert_eq!((code, v["verdict"]["limits_hold"].as_bool()), (13, Some(false)));
    let broken = |what: &str| {
        let all = v["verdict"]["limits"].as_array().unwrap();
        all.iter().any(|m| m["what"] == what && m["holds"] == false && m["margin"].as_f64().unwrap() < 0.0)
    };
    for what in ["speed limit", "joint torque", "base attitude excursion", "deflection"] {
        assert!(broken(what), "{what}");
    }
    assert!(v["problems"].as_array().unwrap().iter().any(|p| p["code"] == "Plan::LimitBroken"));
    assert!(c.path("v/verdict.json").exists());
    let (_, out, err) = c.run(&["plan", "m.toml", "--trajectory", "p/trajectory.json"]);
    assert!(out.contains("BROKEN") && err.contains("error[Plan::LimitBroken]"), "{err}");
}

/// Limits of the whole system are kept by the plan, appendages swinging; those that contradict each other are named.
#[test]
#[ignore = "full tier: 12 s"]
fn limits_of_the_whole_system_are_kept_or_their_conflict_is_named() {
    let limits = "velocity_rad_per_s = 0.17\ntorque_nm = 2.0\nbase_attitude_rad = 0.004\nbase_rate_rad_per_s = 0.01\n\
        end_effector_speed_m_per_s = 0.2\npassive_rad = 0.01\npointing = [{ name = \"antenna\", axis = [0.1, 0.2, 1.0], \
        target = [0.1, 0.25, 1.0], within_rad = 0.06 }]";
    let c = Case::edited("flex.toml", SMALL, "velocity_rad_per_s = 0.17", limits);
    let (code, v) = c.json(&["excite", "m.toml", "--goal", "condition", "--out", "out"]);
    assert_eq!(code, 0, "{}", v["problems"]);
    let margins = v["verdict"]["limits"].as_array().unwrap();
    for what in ["joint torque", "base attitude excursion", "base rate", "frame speed", "deflection", "pointing angle"]
    {
        let found: Vec<&Value> = margins.iter().filter(|m| m["what"] == what).collect();
        assert!(!found.is_empty() && found.iter().all(|m| m["holds"] == true && m["proof"] == "samples"), "{what}");
    }
    // Without them the same plan would turn the base further.
    let free = Case::new("flex.toml", SMALL);
    let (_, w) = free.json(&["excite", "m.toml", "--goal", "condition", "--out", "out"]);
    let turned = |v: &Value| v["verdict"]["excursion"]["attitude"]["value"].as_f64().unwrap();
    assert!(turned(&v) <= 0.004 && turned(&w) > 0.006, "{} {}", turned(&v), turned(&w));
    // An arm that must move cannot leave the base alone.
    let more = format!("{SMALL}end_rad = [1.57, 1.4, 0.0, -2.0, 0.0, 2.4, 0.0]\n");
    let c = Case::edited(
        "flex.toml",
        &more,
        "velocity_rad_per_s = 0.17",
        "velocity_rad_per_s = 0.17\nbase_attitude_rad = 1e-4",
    );
    let args = ["excite", "m.toml", "--goal", "condition"];
    c.refused(&args, 13, "Plan::Conflict", &["base attitude excursion", "0.0001 rad"]);
}

/// R03: the first signal ends the search with the best plan so far, written and judged.
#[cfg(unix)]
#[test]
#[ignore = "full tier: 9 s"]
fn r03_interruption_keeps_the_best_plan() {
    let more = "[excite]\nduration_s = 60.0\ncontrol_points = 16\nstarts = 5000\n";
    let c = Case::new("flex.toml", more);
    let binary = assert_cmd::cargo::cargo_bin("ffid");
    let child = std::process::Command::new(binary)
        .args(["excite", "m.toml", "--out", "out", "--json"])
        .current_dir(c.dir.path())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    // Planning has begun when the partial folder is there; give the first search a moment for its first steps.
    let begun = || c.names().iter().any(|n| n.contains("partial"));
    while !begun() {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    std::thread::sleep(std::time::Duration::from_millis(2500));
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let out = child.wait_with_output().unwrap();
    assert_eq!(out.status.code(), Some(130));
    let v: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!((v["exit_code"].as_i64(), v["plan"]["interrupted"].as_bool()), (Some(130), Some(true)));
    assert_eq!(v["verdict"]["limits_hold"], true);
    let model = open(&c.path("m.toml"), Default::default()).unwrap().model;
    let file = TrajectoryFile::load(&c.path("out/trajectory.json"), &model).unwrap();
    assert_eq!(file.trajectory.motion().duration(), 60.0);
    assert_eq!(c.names(), ["m.toml", "out", "robot.urdf"]);
    assert!(Path::new(&c.path("out/manifest.toml")).exists());
}
