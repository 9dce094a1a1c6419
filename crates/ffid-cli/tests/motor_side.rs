//! Robots that float and whose torque channels read on the motor's side: friction, currents, from MuJoCo's record of `fixtures/verdict`.

use crate::common::{ffid, says};
use crate::evidence::{distances, identify, truth, value, world};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;
use std::fs;
use std::path::Path;

const JOINTS: [&str; 5] = ["yaw", "shoulder", "elbow", "roll", "wrist"];
/// Viscous and Coulomb friction, reflected inertia and gain of joint `j`.
fn motor(j: usize) -> [f64; 4] {
    let of = |k: f64| 1.0 + 0.4 * (1.9 * j as f64 + k).sin();
    [2.3 * of(0.3), 0.61 * of(1.1), 0.83 * of(2.0), 0.27 * of(0.7) * if j == 2 { -1.0 } else { 1.0 }]
}

/// What motors read of exact torques: friction and inertia, over the gain where it is a current.
fn spoil(currents: bool) -> impl Fn(&[String], &mut [f64]) {
    move |names, x| {
        for (j, joint) in JOINTS.iter().enumerate() {
            let at = |head: &str| names.iter().position(|n| n.starts_with(&format!("{head}.{joint}["))).unwrap();
            let [v, c, i, k] = motor(j);
            let (qd, qdd) = (x[at("dq")], x[at("ddq")]);
            let sign = if qd == 0.0 { 0.0 } else { qd.signum() };
            x[at("tau")] = (x[at("tau")] + v * qd + c * sign + i * qdd) / if currents { k } else { 1.0 };
        }
    }
}

/// The columns of torques are currents, with noise of 0.3 A in all.
fn as_currents(dir: &Path) {
    let text = fs::read_to_string(dir.join("rec.csv")).unwrap();
    let (head, rows) = text.split_once('\n').unwrap();
    let sigmas: Vec<f64> = head
        .split(',')
        .map(|n| if n.starts_with("tau.") { (0.3f64.powi(2) - 0.06f64.powi(2)).sqrt() } else { 0.0 })
        .collect();
    let head = head.replace("tau.", "current.").replace("[N m]", "[A]");
    fs::write(dir.join("rec.csv"), noisy(&head, rows, &sigmas, 31)).unwrap();
}

/// A record with noise of these deviations in its columns.
fn noisy(head: &str, rows: &str, sigmas: &[f64], seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut out = head.to_owned() + "\n";
    for row in rows.lines() {
        let noisy = row.split(',').zip(sigmas).map(|(x, s)| {
            let n: f64 = StandardNormal.sample(&mut rng);
            format!("{}", x.parse::<f64>().unwrap() + s * n)
        });
        out += &(noisy.collect::<Vec<_>>().join(",") + "\n");
    }
    out
}

fn with(mission: String, drive: &str) -> String {
    let sensors = "[sensors.current]\nnoise_std_a = 0.3\n\n[sensors.gyro]";
    mission.replace("[sensors.gyro]", sensors) + "\n[[drive]]\njoints = [\"*\"]\n" + drive + "\n"
}

const TERMS: &str = "terms = [\"viscous\", \"coulomb\", \"inertia\"]";

/// Friction, inertia and gains of a result within this many deviations of the truth, and nowhere far less certain than that.
fn joints_are_right(r: &Value, list: &str, currents: bool, limit: f64) {
    for (j, joint) in JOINTS.iter().enumerate() {
        let names = [
            format!("friction.{joint}.viscous"),
            format!("friction.{joint}.coulomb"),
            format!("drive.{joint}.inertia"),
            format!("drive.{joint}.gain"),
        ];
        for (name, true_value) in names.iter().zip(motor(j)).take(if currents { 4 } else { 3 }) {
            let (found, std) = value(r, list, name);
            assert!((found - true_value).abs() < limit * std, "{name}: {found} +- {std} for {true_value}");
            assert!(std < 0.2 * true_value.abs(), "{name}: {std}");
        }
    }
}

#[test]
#[ignore = "full tier: 6 s"]
fn currents_with_friction_give_parameters_friction_and_gains() {
    let dir = tempfile::tempdir().unwrap();
    world(dir.path(), 21, spoil(true), |m| with(m, TERMS));
    as_currents(dir.path());
    let (code, r) = identify(dir.path(), &[]);
    assert_eq!((code, r["evidence"]["state"].as_str()), (0, Some("explained")), "{}", r["evidence"]);
    let off = distances(&r, &truth(dir.path()));
    assert!(off.len() == 17 && off.iter().all(|d| *d < 4.0), "{off:?}");
    joints_are_right(&r, "nuisance", true, 4.0);
    assert!(r["iterations"].as_u64().unwrap() < 60, "{}", r["iterations"]);
    // Channels are currents, and the doctor has nothing against them.
    assert!(r["channels"][1]["name"] == "current.shoulder" && r["channels"][1]["unit"] == "A", "{}", r["channels"]);
    let (code, out, err) = ffid(dir.path(), &["doctor", "m.toml", "--record", "rec.csv", "--json"]);
    let all: Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{e}\n{out}\n{err}"));
    let findings = all["diagnosis"]["findings"].as_array().unwrap();
    let bad: Vec<&Value> = findings.iter().filter(|f| f["judgement"] != "good" && f["topic"] != "prior").collect();
    assert!(code == 0 && findings.len() > 5 && bad.is_empty(), "{bad:?}\n{err}");
}

/// The record of `fixtures/motors`: MuJoCo's own damping, armature and frictionloss, currents and one torque, with noise.
#[test]
#[ignore = "full tier: 8 s"]
#[allow(clippy::approx_constant, reason = "3.14 N m s/rad is what the fixture has")]
fn friction_of_another_engine_comes_back() {
    let dir = tempfile::tempdir().unwrap();
    world(dir.path(), 1, |_, _| {}, |m| with(m, TERMS).replace("noise_std_a = 0.3", "noise_std_a = 0.2"));
    let record = crate::common::fixture("motors").join("m3.parquet");
    let (code, _, err) = ffid(dir.path(), &["convert", record.to_str().unwrap(), "motors.csv", "--force"]);
    assert_eq!(code, 0, "{err}");
    let text = fs::read_to_string(dir.path().join("motors.csv")).unwrap();
    let (head, rows) = text.split_once('\n').unwrap();
    let sigma = |name: &str| match name.split('.').next() {
        Some("current") => 0.2,
        Some("tau") => 0.06,
        Some("gyro") => 1e-4,
        Some("q") => 1e-5,
        _ => 0.0,
    };
    let sigmas: Vec<f64> = head.split(',').map(sigma).collect();
    fs::write(dir.path().join("rec.csv"), noisy(head, rows, &sigmas, 27)).unwrap();
    let (code, r) = identify(dir.path(), &[]);
    assert_eq!((code, r["evidence"]["state"].as_str()), (0, Some("explained")), "{}", r["evidence"]);
    let off = distances(&r, &truth(dir.path()));
    assert!(off.len() == 17 && off.iter().all(|d| *d < 4.0), "{off:?}");
    // As `fixtures/motors/generate.py` has them.
    let all = [
        ("yaw", [2.71, 0.83, 0.57, 0.213]),
        ("shoulder", [3.14, 1.12, 0.83, -0.287]),
        ("elbow", [1.93, 0.64, 0.46, 0.171]),
        ("roll", [0.87, 0.29, 0.31, 0.0]),
        ("wrist", [0.62, 0.23, 0.27, 0.094]),
    ];
    for (joint, values) in all {
        let names = ["friction.J.viscous", "drive.J.inertia", "friction.J.coulomb", "drive.J.gain"];
        for (name, true_value) in names.iter().zip(values).filter(|n| n.1 != 0.0) {
            let (found, std) = value(&r, "nuisance", &name.replace('J', joint));
            assert!(
                (found - true_value).abs() < 4.0 * std && std < 0.3 * true_value.abs(),
                "{name} {joint}: {found} +- {std}"
            );
        }
    }
}

#[test]
#[ignore = "full tier: 15 s"]
fn friction_that_was_not_declared_is_named_and_adopted() {
    let dir = tempfile::tempdir().unwrap();
    let viscous = |names: &[String], x: &mut [f64]| {
        let at = |head: &str| names.iter().position(|n| n.starts_with(&format!("{head}.shoulder["))).unwrap();
        // Goes over within about a hundredth of the largest rate, as errors that are tried do.
        let qd = x[at("dq")];
        x[at("tau")] += 0.9 * qd + 0.2 * qd / qd.hypot(0.003);
    };
    world(dir.path(), 22, viscous, |m| m);
    let (code, r) = identify(dir.path(), &[]);
    let e = &r["evidence"];
    assert_eq!((code, e["state"].as_str()), (16, Some("contradicted")), "{e}");
    assert_eq!(e["named"][0]["name"], "friction.shoulder", "{e}");
    let (_, r) = identify(dir.path(), &["--adopt", "friction.shoulder"]);
    let (found, std) = value(&r, "nuisance", "friction.shoulder.viscous");
    assert!((found - 0.9).abs() < 6.0 * std && std < 0.1, "{found} +- {std}");
    // Declared, with the way in which it goes over: nothing is left.
    let dir = tempfile::tempdir().unwrap();
    let drive = "terms = [\"viscous\", \"coulomb\"]\nsmooth_rad_per_s = 0.004";
    world(dir.path(), 22, viscous, |m| with(m, drive).replace("joints = [\"*\"]", "joints = [\"shoulder\"]"));
    let (code, r) = identify(dir.path(), &[]);
    assert_eq!((code, r["evidence"]["state"].as_str()), (0, Some("explained")), "{}", r["evidence"]);
    for (name, true_value) in [("viscous", 0.9), ("coulomb", 0.2)] {
        let (found, std) = value(&r, "nuisance", &format!("friction.shoulder.{name}"));
        assert!((found - true_value).abs() < 4.0 * std && std < 0.05, "{name}: {found} +- {std}");
    }
}

#[test]
#[ignore = "full tier: 8 s"]
fn what_is_known_of_friction_and_gains_is_a_prior_and_other_data_are_predicted_with_them() {
    let dir = tempfile::tempdir().unwrap();
    let known = "viscous_nm_s_per_rad = 2.1\ncoulomb_nm = 0.5\ninertia_kg_m2 = 0.9\nrelative_std = 0.5\ngain_nm_per_a = 0.25\ngain_relative_std = 3.0";
    let turned = known.replace("gain_nm_per_a = 0.25", "gain_nm_per_a = -0.25");
    world(dir.path(), 23, spoil(true), |m| with(m, known) + "\n[[drive]]\njoints = [\"elbow\"]\n" + &turned + "\n");
    as_currents(dir.path());
    let (code, r) = identify(dir.path(), &["--held-out", "0.3"]);
    assert_eq!((code, r["evidence"]["state"].as_str()), (0, Some("explained")), "{}", r["evidence"]);
    joints_are_right(&r, "uncertain", true, 4.0);
    let kinds: Vec<&str> = r["uncertain"].as_array().unwrap().iter().map(|u| u["kind"].as_str().unwrap()).collect();
    assert!(
        kinds.iter().filter(|k| **k == "joint_terms").count() == 15
            && kinds.iter().filter(|k| **k == "drive_gains").count() == 5
    );
    let held = &r["held_out"];
    assert!(held["explained"] == true && held["chi2_per_dof"].as_f64().unwrap() < 1.2, "{held}");
    // Another record, with friction and gains of the first.
    world(dir.path(), 28, spoil(true), |m| m);
    as_currents(dir.path());
    let (code, _, err) = ffid(dir.path(), &["validate", "found", "--record", "rec.csv", "--force"]);
    assert!(code == 0, "{code} {err}");
}

#[test]
#[ignore = "full tier: 10 s"]
fn currents_do_not_tell_how_heavy_a_robot_is() {
    let dir = tempfile::tempdir().unwrap();
    let all = |m: String| m.replace("parameters = [\"base.*\"", "parameters = [\"*\", \"base.*\"");
    world(dir.path(), 24, spoil(true), |m| all(with(m, TERMS)));
    as_currents(dir.path());
    let (_, r) = identify(dir.path(), &[]);
    let verdict = r["verdict"].to_string();
    assert!(verdict.contains("Currents do not tell the scale"), "{verdict}");
    let gains = |d: &Value| d["terms"].as_array().unwrap().iter().any(|t| t[0].as_str().unwrap().ends_with(".gain"));
    assert!(r["null_directions"].as_array().unwrap().iter().any(gains), "{}", r["null_directions"]);
}

#[test]
fn a_simulation_writes_what_motors_read() {
    let dir = tempfile::tempdir().unwrap();
    world(dir.path(), 25, |_, _| {}, |m| m);
    let clean = fs::read_to_string(dir.path().join("clean.csv")).unwrap();
    let columns = clean.lines().next().unwrap().split(',').position(|c| c.starts_with("tau.")).unwrap();
    let motion: Vec<String> =
        clean.lines().take(900).map(|l| l.split(',').take(columns).collect::<Vec<_>>().join(",")).collect();
    fs::write(
        dir.path().join("motion.csv"),
        motion.join("\n").replace(",ddq.", ",qdd.").replace(",dq.", ",qd.") + "\n",
    )
    .unwrap();
    let drives: String = (0..5)
        .map(|j| {
            let ([v, c, i, k], joint) = (motor(j), JOINTS[j]);
            let gain = if j == 3 { String::new() } else { format!("gain_nm_per_a = {k}\n") };
            format!("\n[[drive]]\njoints = [\"{joint}\"]\nviscous_nm_s_per_rad = {v}\ncoulomb_nm = {c}\ninertia_kg_m2 = {i}\n{gain}")
        })
        .collect();
    let mission = fs::read_to_string(crate::common::fixture("verdict").join("truth.toml")).unwrap();
    fs::write(dir.path().join("t.toml"), mission.clone() + &drives).unwrap();
    let run = |mission: &str, to: &str| {
        let args =
            ["simulate", mission, "--trajectory", "motion.csv", "--out", to, "--noise-free", "--quiet", "--force"];
        let (code, _, err) = ffid(dir.path(), &args);
        assert_eq!(code, 0, "{err}");
        let text = fs::read_to_string(dir.path().join(to)).unwrap();
        let names: Vec<String> = text.lines().next().unwrap().split(',').map(str::to_owned).collect();
        let rows: Vec<Vec<f64>> =
            text.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
        (names, rows)
    };
    fs::write(dir.path().join("plain.toml"), mission).unwrap();
    let ((plain, exact), (names, read)) = (run("plain.toml", "plain.csv"), run("t.toml", "motors.csv"));
    let at = |names: &[String], name: String| {
        names.iter().position(|n| n.starts_with(&name)).unwrap_or_else(|| panic!("{name}"))
    };
    for (j, joint) in JOINTS.iter().enumerate() {
        let [v, c, i, k] = motor(j);
        let (head, gain) = if j == 3 { ("tau", 1.0) } else { ("current", k) };
        let [q, tau] = [at(&plain, format!("dq.{joint}")), at(&plain, format!("tau.{joint}"))];
        let (qdd, own) = (at(&plain, format!("ddq.{joint}")), at(&names, format!("{head}.{joint}[")));
        for (a, b) in exact.iter().zip(&read) {
            let sign = if a[q] == 0.0 { 0.0 } else { a[q].signum() };
            let want = (a[tau] + v * a[q] + c * sign + i * a[qdd]) / gain;
            assert!((b[own] - want).abs() < 1e-12 * (1.0 + want.abs()), "{joint}: {} {want}", b[own]);
        }
    }
}

#[test]
#[ignore = "full tier: 4 s"]
fn drives_that_make_no_sense_are_refused_with_a_next_step() {
    let dir = tempfile::tempdir().unwrap();
    world(dir.path(), 26, spoil(true), |m| m);
    as_currents(dir.path());
    let mission = fs::read_to_string(dir.path().join("m.toml")).unwrap();
    let refused = |drive: &str, args: &[&str], code: &str, words: &[&str]| {
        fs::write(dir.path().join("m.toml"), with(mission.clone(), drive)).unwrap();
        let (_, out, err) = ffid(dir.path(), &[args, &["--json"]].concat());
        let all: Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{e}\n{out}\n{err}"));
        let found = all["problems"].as_array().unwrap().iter().find(|p| p["code"] == code).cloned();
        let p = found.unwrap_or_else(|| panic!("{code} in {}", all["problems"]));
        assert!(says(&p, &p.to_string(), words) && !p["hint"].as_str().unwrap().is_empty(), "{p}");
    };
    let check = ["check", "m.toml"];
    refused("terms = [\"viscos\"]", &check, "Config::BadChoice", &["viscos", "viscous"]);
    refused("terms = [\"stribeck\"]", &check, "Config::MissingKey", &["stribeck_rate_rad_per_s"]);
    refused("gain_relative_std = 0.1\nterms = [\"viscous\"]", &check, "Config::MissingKey", &["gain_nm_per_a"]);
    refused("terms = [\"viscous\"]\nrelative_std = 0.3", &check, "Config::MissingKey", &["relative_std"]);
    refused("gain_nm_per_a = 0", &check, "Config::OutOfRange", &["N m/A"]);
    refused("near_rest_rad_per_s = 0.02", &check, "Config::MissingKey", &["terms"]);
    refused(
        "terms = [\"coulomb\"]\nnear_rest_rad_per_s = 0.01\nsmooth_rad_per_s = 0.02",
        &check,
        "Config::Conflict",
        &["smooth_rad_per_s"],
    );
    let fit = ["identify", "m.toml", "--record", "rec.csv", "--out", "r", "--force"];
    refused(TERMS, &[&fit[..], &["--method", "rda"]].concat(), "Config::Method", &["currents"]);
    // That of the elbow is negative.
    let gains = format!("{TERMS}\ngain_nm_per_a = 0.25");
    refused(&gains, &fit, "Data::Currents", &["current.elbow", "0.25 N m/A"]);
    let silent = mission.clone();
    fs::write(dir.path().join("m.toml"), silent).unwrap();
    let (code, out, _) = ffid(dir.path(), &[&fit[..], &["--json"]].concat());
    assert!(code == 11 && out.contains("Config::NoNoise") && out.contains("noise_std_a"), "{code} {out}");
}
