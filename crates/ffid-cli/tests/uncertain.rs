//! What the mission is not sure of: estimates are honest whatever it is, and the budget says what they owe to it.

use crate::common::{ffid, fixture};
use crate::evidence::{distances, identify, is_gyro, truth, value, world};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Sections that say how far sensors may be off.
fn unsure(mission: String) -> String {
    let put = |m: String, key: &str, more: &str| {
        let at = m.find(key).unwrap_or_else(|| panic!("{key} in the mission"));
        format!("{}{more}\n{}", &m[..at], &m[at..])
    };
    let m = put(mission, "noise_std_nm", "gain_relative_std = 0.01\ngain_common_relative_std = 0.01");
    let m = put(m, "noise_std_rad_per_s", "scale_relative_std = 0.003\nmisalignment_std_rad = 0.01");
    m + "\n[[uncertain]]\nbodies = [\"*\"]\nmass_relative_std = 0.02\n\n[[uncertain]]\nparameters = [\"tank.length\"]\nrelative_std = 0.1\n"
}

/// A gyro turned by 13 mrad with a scale of each axis, torque sensors with gains: all within what [`unsure`] says.
fn spoil(names: &[String], x: &mut [f64]) {
    let g = is_gyro(names);
    let w = nalgebra::Vector3::new(x[g], x[g + 1], x[g + 2]);
    let turned = nalgebra::Rotation3::from_scaled_axis(nalgebra::Vector3::new(0.009, -0.0073, 0.0062)) * w;
    for (k, scale) in [1.0031, 0.9974, 1.0012].into_iter().enumerate() {
        x[g + k] = scale * turned[k];
    }
    for (k, j) in (0..names.len()).filter(|&i| names[i].starts_with("tau.")).enumerate() {
        x[j] *= 1.008 + [0.009, -0.004, -0.011, 0.006, 0.002][k];
    }
}

#[test]
#[ignore = "full tier: 3 s"]
fn errors_of_sensors_within_what_the_mission_says_leave_estimates_honest() {
    let dir = tempfile::tempdir().unwrap();
    world(dir.path(), 8, spoil, unsure);
    let (code, r) = identify(dir.path(), &[]);
    assert_eq!((code, r["evidence"]["state"].as_str()), (0, Some("explained")), "{}", r["evidence"]["reason"]);
    let off = distances(&r, &truth(dir.path()));
    assert!(off.iter().all(|d| *d < 4.0), "{off:?}");
    // What the record tells of them.
    let (turn, std) = value(&r, "uncertain", "gyro.rotation.x");
    assert!((turn - 0.009).abs() < 4.0 * std && std < 0.001, "{turn} +- {std}");
    // The parts of every variance add up.
    let budget = r["budget"].as_array().unwrap();
    assert_eq!(budget.len(), r["parameters"].as_array().unwrap().len());
    for b in budget {
        let of: f64 = b["errors"].as_array().unwrap().iter().map(|e| e["share"].as_f64().unwrap()).sum();
        let noise = b["noise"].as_f64().unwrap();
        assert!((noise + of - 1.0).abs() < 1e-6 && noise > 0.0, "{b}");
    }
    let mass = budget.iter().find(|b| b["name"] == "base.mass").unwrap();
    assert!(mass["errors"][0]["kind"] == "masses" && mass["errors"][0]["share"].as_f64().unwrap() > 0.3, "{mass}");
    let better = &mass["better"];
    assert!(better["std"].as_f64().unwrap() < 0.8 * mass["std"].as_f64().unwrap(), "{mass}");
}

/// The joint motion of `clean.csv` as a trajectory file.
fn trajectory(dir: &Path) {
    let text = fs::read_to_string(dir.join("clean.csv")).unwrap();
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let kept: Vec<usize> =
        (0..names.len()).filter(|&i| ["time", "q.", "dq.", "ddq."].iter().any(|p| names[i].starts_with(p))).collect();
    let line = |l: &str| {
        let all: Vec<&str> = l.split(',').collect();
        kept.iter().map(|&i| all[i]).collect::<Vec<_>>().join(",")
    };
    let out: Vec<String> = text.lines().map(line).collect();
    let head = out[0].replace("ddq.", "qdd.").replace("dq.", "qd.");
    fs::write(dir.join("t.csv"), format!("{head}\n{}\n", out[1..].join("\n"))).unwrap();
}

/// Results of `ffid plan` for the motion of the record.
fn planned(dir: &Path) -> Value {
    trajectory(dir);
    let (code, out, err) = ffid(dir, &["plan", "m.toml", "--trajectory", "t.csv", "--json"]);
    assert_eq!(code, 0, "{out}{err}");
    serde_json::from_str::<Value>(&out).unwrap()["verdict"].clone()
}

/// The mission that the records obey, whose deviations are those at the answer.
fn true_mission(_: String) -> String {
    fs::read_to_string(fixture("verdict").join("truth.toml")).unwrap()
}

#[test]
#[ignore = "full tier: 3 s"]
fn the_verdict_on_a_plan_states_the_deviations_and_the_budget_of_its_record() {
    let dir = tempfile::tempdir().unwrap();
    let mounts = "\n[[uncertain]]\nmounts = [\"*\"]\nposition_std_m = 0.003\nangle_std_rad = 0.002\n";
    world(dir.path(), 11, |_, _| {}, |m| unsure(true_mission(m)) + mounts);
    let plan = planned(dir.path());
    let (code, r) = identify(dir.path(), &["--initial-state"]);
    assert_eq!(code, 0, "{}", r["verdict"]);
    let list = |v: &Value, key: &str| v[key].as_array().unwrap().clone();
    let (before, after) = (list(&plan, "parameters"), list(&r, "parameters"));
    assert_eq!(before.len(), after.len());
    for (p, q) in before.iter().zip(&after) {
        let ratio = p["std"].as_f64().unwrap() / q["std"].as_f64().unwrap();
        assert!(p["name"] == q["name"] && (ratio - 1.0).abs() < 0.03, "{ratio}: {p} {q}");
    }
    assert_eq!(list(&plan, "uncertain").len(), list(&r, "uncertain").len());
    for (p, q) in list(&plan, "budget").iter().zip(&list(&r, "budget")) {
        assert!(p["name"] == q["name"] && (p["noise"].as_f64().unwrap() - q["noise"].as_f64().unwrap()).abs() < 0.03);
        assert_eq!(p["better"]["kind"], q["better"]["kind"], "{p} {q}");
    }
    // The same plan were everything exact: what the errors cost.
    let dir = tempfile::tempdir().unwrap();
    world(dir.path(), 11, |_, _| {}, true_mission);
    let exact = planned(dir.path());
    assert!(exact["budget"].is_null() && exact["uncertain"].is_null());
    let mass = |v: &Value| v["parameters"][0]["std"].as_f64().unwrap();
    assert!(mass(&plan) > 5.0 * mass(&exact), "{} {}", mass(&plan), mass(&exact));
}

#[test]
#[ignore = "full tier: 4 s"]
fn a_plan_says_what_is_taken_as_exact_as_its_record_does() {
    let dir = tempfile::tempdir().unwrap();
    world(dir.path(), 12, |_, _| {}, true_mission);
    let (plan, (_, r)) = (planned(dir.path()), identify(dir.path(), &["--initial-state"]));
    let (before, after) = (plan["taken_as_exact"].as_array().unwrap(), r["taken_as_exact"].as_array().unwrap());
    let by = |h: &Value| h["moves_by"].as_f64().unwrap();
    let of = |all: &[Value], name: &str, moves: &str| {
        by(all.iter().find(|h| h["name"] == name && h["moves"] == moves).unwrap_or_else(|| panic!("{name} in {all:?}")))
    };
    // One of a kind: errors that go by other names are of several components.
    let ratio = of(before, "gyro.scale.z", "base.i_zz") / of(after, "gyro-scale.z", "base.i_zz");
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    assert!(before.windows(2).all(|w| by(&w[0]) >= by(&w[1])), "{before:?}");
    let (code, out, _) = ffid(dir.path(), &["plan", "m.toml", "--trajectory", "t.csv"]);
    let said =
        out.lines().take(3).any(|l| l.contains("taken as exact") && l.contains(before[0]["name"].as_str().unwrap()));
    assert!(code == 0 && said, "{out}");
}

#[test]
#[ignore = "full tier: 3 s"]
fn what_is_taken_as_exact_is_said() {
    let dir = tempfile::tempdir().unwrap();
    world(dir.path(), 9, |_, _| {}, |m| m);
    let (code, r) = identify(dir.path(), &[]);
    assert_eq!(code, 0);
    let harm = r["taken_as_exact"].as_array().unwrap();
    let by: Vec<f64> = harm.iter().map(|h| h["moves_by"].as_f64().unwrap()).collect();
    assert!(by.len() >= 3 && by[0] > 5.0 && by.windows(2).all(|w| w[0] >= w[1]), "{harm:?}");
    let says = |v: &Value| v.as_str().is_some_and(|s| s.contains(harm[0]["name"].as_str().unwrap()));
    assert!(r["verdict"].as_array().unwrap().iter().any(says), "{}", r["verdict"]);
}

/// What is off by far more than the mission says is named, as without.
#[test]
#[ignore = "full tier: 5 s"]
fn an_error_beyond_what_the_mission_says_contradicts() {
    let dir = tempfile::tempdir().unwrap();
    let late = |names: &[String], x: &mut [f64]| {
        let j = names.iter().position(|n| n.starts_with("q.elbow")).unwrap();
        x[j] += 0.02;
    };
    world(dir.path(), 10, late, unsure);
    let (code, r) = identify(dir.path(), &[]);
    let e = &r["evidence"];
    assert_eq!((code, e["state"].as_str()), (16, Some("contradicted")), "{}", e["reason"]);
    let best = &e["named"][0];
    let alike = |name: &str| best["alike"].as_array().is_some_and(|a| a.iter().any(|n| n == name));
    assert!(best["name"] == "encoder-offset.elbow" || alike("encoder-offset.elbow"), "{}", e["reason"]);
}

/// Estimates with everything else at the mission's values, and deviations that say how far that may lead.
#[test]
#[ignore = "full tier: 5 s"]
fn considered_errors_widen_the_deviations_and_are_no_contradiction() {
    let dir = tempfile::tempdir().unwrap();
    world(dir.path(), 13, spoil, unsure);
    let (code, joint) = identify(dir.path(), &[]);
    assert_eq!(code, 0, "{}", joint["verdict"]);
    let (code, r) = identify(dir.path(), &["--consider"]);
    assert_eq!((code, r["evidence"]["state"].as_str()), (0, Some("explained")), "{}", r["evidence"]["reason"]);
    let off = distances(&r, &truth(dir.path()));
    assert!(off.iter().all(|d| *d < 4.0), "{off:?}");
    // Errors that are not estimated cost more than those that are, and a turned gyro far more.
    let std = |r: &Value, k: usize| r["parameters"][k]["std"].as_f64().unwrap();
    let n = r["parameters"].as_array().unwrap().len();
    let ratio: Vec<f64> = (0..n).map(|k| std(&r, k) / std(&joint, k)).collect();
    assert!(ratio.iter().all(|x| *x > 0.97) && ratio.iter().any(|x| *x > 3.0), "{ratio:?}");
    for b in r["budget"].as_array().unwrap() {
        let of: f64 = b["errors"].as_array().unwrap().iter().map(|e| e["share"].as_f64().unwrap()).sum();
        assert!((b["noise"].as_f64().unwrap() + of - 1.0).abs() < 1e-6, "{b}");
    }
    for u in r["uncertain"].as_array().unwrap() {
        assert_eq!((&u["value"], &u["std"]), (&u["prior_mean"], &u["prior_std"]), "held at the mission's value");
    }
    assert!(r["posterior"].is_null() && r["provenance"]["settings"]["uncertain"] == "considered");
    let args =
        ["identify", "m.toml", "--record", "rec.csv", "--out", "x", "--consider", "--profile", "base.mass", "--json"];
    let (code, out, _) = ffid(dir.path(), &args);
    let p = &serde_json::from_str::<Value>(&out).unwrap()["problems"][0];
    assert_eq!(
        (code, p["code"].as_str(), p["object"].as_str()),
        (11, Some("Config::Consider"), Some("--profile")),
        "{p}"
    );
}

/// On the ground errors are considered: estimates stay, deviations allow for them. What it has no means for is said.
#[test]
#[ignore = "full tier: 4 s"]
fn the_ground_considers_what_is_not_known_and_says_what_it_takes_as_exact() {
    let dir = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(fixture("ground/arm.toml")).unwrap().replace("../peers-model/", "");
    let unsure = "\n[[uncertain]]\nmounts = [\"arm_j2\"]\nposition_std_m = 0.002\n\n[[changes]]\nparameters = [\"arm_l*.mass\"]\nstep_std = 0.1\n\n[sensors.torque]\ngain_common_relative_std = 0.01\n";
    fs::write(dir.path().join("exact.toml"), &text).unwrap();
    fs::write(dir.path().join("arm.toml"), text + unsure).unwrap();
    fs::copy(fixture("peers-model/arm_fixed.urdf"), dir.path().join("arm_fixed.urdf")).unwrap();
    let (code, out, err) = ffid(dir.path(), &["check", "arm.toml", "--json"]);
    assert_eq!(code, 0, "{out}{err}");
    let declared = serde_json::from_str::<Value>(&out).unwrap()["uncertain"].clone();
    let exact = declared["not_allowed_for"].as_array().unwrap();
    assert_eq!(declared["unknowns"].as_array().unwrap().len(), 4 + exact.len());
    assert!(!exact.is_empty() && exact.iter().all(|n| n.as_str().unwrap().starts_with("step.")), "{declared}");
    let log = dir.path().join("log.csv");
    let whole = fs::read_to_string(fixture("ground/log.csv")).unwrap();
    fs::write(&log, whole.lines().take(1501).flat_map(|l| [l, "\n"]).collect::<String>()).unwrap();
    let identified = |mission: &str| {
        let args =
            ["identify", mission, "--record", log.to_str().unwrap(), "--reduce", "--out", "res", "--force", "--json"];
        let (code, out, err) = ffid(dir.path(), &args);
        assert_eq!(code, 0, "{err}");
        serde_json::from_str::<Value>(&out).unwrap()["result"].clone()
    };
    let (r, sure) = (identified("arm.toml"), identified("exact.toml"));
    assert_eq!(r["not_allowed_for"], declared["not_allowed_for"]);
    let says = |v: &Value| v.as_str().is_some_and(|s| s.contains("do NOT allow for") && s.contains("step."));
    assert!(r["verdict"].as_array().unwrap().iter().take(3).any(says), "{}", r["verdict"]);
    assert_eq!((r["uncertain"].as_array().unwrap().len(), &r["posterior"]), (4, &Value::Null));
    // A gain of all joints scales their friction; where a joint is hardly matters to it.
    let (v, std) = value(&r, "nuisance", "friction.arm_j2.coulomb");
    let (same, alone) = value(&sure, "nuisance", "friction.arm_j2.coulomb");
    assert_eq!(v, same);
    let from_gain = (std * std - alone * alone).sqrt() * 1.01 / (0.01 * v.abs());
    assert!((0.999..1.1).contains(&from_gain), "{from_gain}: {v} {std} {alone}");
    let budget = r["budget"].as_array().unwrap();
    assert!(!budget.is_empty());
    for b in budget {
        let of: f64 = b["errors"].as_array().unwrap().iter().map(|e| e["share"].as_f64().unwrap()).sum();
        assert!((b["noise"].as_f64().unwrap() + of - 1.0).abs() < 1e-6, "{b}");
    }
}

/// A robot whose fuel is burnt between records, and whose gyro walks: a mission's life, record by record.
#[test]
#[ignore = "full tier: 5 s"]
fn fuel_that_is_burnt_between_records_and_a_gyro_that_walks_are_followed() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    world(
        d,
        21,
        |_, _| {},
        |m| {
            let walk = "bias_walk_rad_per_s_per_sqrt_s = 1e-5\nnoise_std_rad_per_s";
            m.replace("noise_std_rad_per_s", walk)
                + "\n[[changes]]\nparameters = [\"tank.mass\"]\nstep_std = 3.0\nstep_mean = -6.0\n"
        },
    );
    // The first 20 s of the motion, three times, with less fuel each time.
    let text = fs::read_to_string(d.join("clean.csv")).unwrap();
    let columns = text.lines().next().unwrap().split(',').position(|c| c.starts_with("tau.")).unwrap();
    let motion = |l: &str| l.split(',').take(columns).collect::<Vec<_>>().join(",");
    let lines: Vec<String> = text.lines().take(1001).map(motion).collect();
    fs::write(d.join("motion.csv"), lines.join("\n").replace(",ddq.", ",qdd.").replace(",dq.", ",qd.") + "\n").unwrap();
    let truth = fs::read_to_string(fixture("verdict").join("truth.toml")).unwrap();
    // So much less that what is predicted with the fuel of another record seems to have another clock.
    let fuel = [46.5, 38.2, 31.9];
    for (k, mass) in fuel.iter().enumerate() {
        fs::write(d.join("t.toml"), truth.replace("mass_kg = 46.5", &format!("mass_kg = {mass}"))).unwrap();
        let (out, seed) = (format!("r{k}.csv"), format!("{}", 31 + k));
        let args = ["simulate", "t.toml", "--trajectory", "motion.csv", "--out", &out, "--seed", &seed, "--quiet"];
        let (code, out, err) = ffid(d, &args);
        assert_eq!(code, 0, "{out}{err}");
    }
    // The gyro of the second record walks: a step of its bias in the middle of what it may.
    let r1 = fs::read_to_string(d.join("r1.csv")).unwrap();
    let gyro = r1.lines().next().unwrap().split(',').position(|c| c.starts_with("gyro.y")).unwrap();
    let walked = |(i, l): (usize, &str)| {
        let mut x: Vec<String> = l.split(',').map(str::to_owned).collect();
        if i > 0 {
            let by = 6e-5 * (i as f64 / 1000.0 * std::f64::consts::PI).sin();
            x[gyro] = format!("{}", x[gyro].parse::<f64>().unwrap() + by);
        }
        x.join(",")
    };
    fs::write(d.join("r1.csv"), r1.lines().enumerate().map(walked).collect::<Vec<_>>().join("\n") + "\n").unwrap();
    let run = |args: &[&str]| {
        let (code, out, err) = ffid(d, &[&["identify", "m.toml", "--json", "--quiet", "--force"], args].concat());
        let r = serde_json::from_str::<Value>(&out).unwrap()["result"].clone();
        assert_eq!((code, r["evidence"]["state"].as_str()), (0, Some("explained")), "{err} {}", r["verdict"]);
        r
    };
    let course = |r: &Value, name: &str, record: Option<&str>| -> Vec<(f64, f64, f64)> {
        let all = r["over_time"].as_array().unwrap();
        let of = all.iter().find(|c| c["name"] == name && c["record"].as_str() == record);
        let points = of.unwrap_or_else(|| panic!("{name} {record:?} in {all:?}"))["points"].as_array().unwrap();
        let number = |p: &Value, key: &str| p[key].as_f64().unwrap();
        points.iter().map(|p| (number(p, "at"), number(p, "value"), number(p, "std"))).collect()
    };
    let joint = run(&["--records", "r0.csv", "r1.csv", "r2.csv", "--out", "joint"]);
    let masses = course(&joint, "tank.mass", None);
    assert_eq!(masses.len(), 3);
    let put_right = |c: &Value| c["corrected"].as_bool().unwrap();
    assert!(!joint["clocks"].as_array().unwrap().iter().any(put_right), "{}", joint["clocks"]);
    for ((_, value, std), true_mass) in masses.iter().zip(fuel) {
        assert!((value - true_mass).abs() < 4.0 * std && *std < 1.2, "{masses:?}");
    }
    // The last is what the robot has now.
    let (now, std) = value(&joint, "parameters", "tank.mass");
    assert!((now - masses[2].1).abs() < 1e-12 && (std - masses[2].2).abs() < 1e-9 * std);
    let bias = course(&joint, "gyro.bias.y", Some("r1"));
    assert_eq!((bias[0].0, bias.len() > 3), (0.0, true), "{bias:?}");
    for (t, value, std) in &bias {
        // Simulated sensors have no bias of their own.
        let by = 6e-5 * (t / 20.0 * std::f64::consts::PI).sin();
        assert!((value - by).abs() < 4.0 * std, "{bias:?}");
    }
    // One folder for the whole life of the mission: record by record the same answer.
    run(&["--record", "r0.csv", "--out", "life"]);
    run(&["--record", "r1.csv", "--prior-from", "life", "--out", "life"]);
    let life = run(&["--record", "r2.csv", "--prior-from", "life", "--out", "life"]);
    for (a, b) in course(&life, "tank.mass", None).iter().zip(&masses) {
        assert!((a.1 - b.1).abs() < 0.02 * b.2 && (a.2 / b.2 - 1.0).abs() < 0.01, "{a:?} {b:?}");
    }
    assert!(
        d.join("life/over-time.svg").exists()
            && fs::read_to_string(d.join("life/report.txt")).unwrap().contains("tank.mass (kg), record by record")
    );
}
