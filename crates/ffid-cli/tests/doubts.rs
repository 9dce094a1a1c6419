//! What may be wrong with a record, or with the model: clocks, rest, momentum, modes, models compared, an arm on the ground.
//! Rows D15, D16, D23 to D26, D29 and D30 of `bad-inputs.md`.

use crate::case::{Case, flex, near_the_truth, slosh};
use crate::common::fixture;
use ffid::workflow::identify::IdentificationResult;

/// Changes the cells of a record: time, name of the column, old value -> new value.
pub(crate) fn edit(text: &str, change: impl Fn(f64, &str, f64) -> f64) -> String {
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut out = head.join(",") + "\n";
    for line in lines {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        let new: Vec<String> = cells.iter().zip(&head).map(|(c, h)| change(cells[0], h, *c).to_string()).collect();
        out += &(new.join(",") + "\n");
    }
    out
}

/// A record whose columns of one kind were read at another time: `at(t)` instead of t.
fn shifted(text: &str, column: &str, at: impl Fn(f64) -> f64) -> String {
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|l| l.split(',').map(|c| c.parse().unwrap()).collect()).collect();
    let head: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let dt = rows[1][0] - rows[0][0];
    edit(text, |t, name, old| {
        if !name.starts_with(column) {
            return old;
        }
        let k = head.iter().position(|h| *h == name).unwrap();
        let x = (at(t) / dt).clamp(0.0, (rows.len() - 1) as f64);
        let i = (x as usize).min(rows.len() - 2);
        rows[i][k] + (x - i as f64) * (rows[i + 1][k] - rows[i][k])
    })
}

/// A mission whose fuel rings for minutes, sampled slowly enough for that, with its stiffness alone to be found.
fn ringing(mission: &str) -> String {
    let damped = mission.replace("damping_nms_per_rad = [5.0, 5.0]", "damping_nms_per_rad = [0.2, 0.2]");
    let known = damped.replace("\"base.*\", \"tank.k[*]\", \"tank.d[*]\"", "\"tank.k[*]\"");
    known.replace("rate_hz = 50.0", "rate_hz = 20.0")
}

/// A trajectory with hardly any motion.
pub(crate) fn calm(trajectory: &str) -> String {
    let one = |(i, line): (usize, &str)| {
        let small = |(k, x): (usize, &str)| match x.parse::<f64>() {
            Ok(v) if i > 0 && k > 0 => (0.3 + 1e-4 * v).to_string(),
            _ => x.to_owned(),
        };
        line.split(',').enumerate().map(small).collect::<Vec<_>>().join(",") + "\n"
    };
    trajectory.lines().enumerate().map(one).collect()
}

#[test]
#[ignore = "full tier: 3 s"]
fn d15_a_channel_that_is_late_is_put_right_with_a_warning() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    // Torques three samples (60 ms) late.
    c.write("late.csv", &shifted(&c.read("rec.csv"), "tau.", |t| t - 0.06));
    let (code, out, err) = c.run(&["identify", "m.toml", "--record", "late.csv", "--out", "res"]);
    assert_eq!(code, 0, "{out}\n{err}");
    assert!(err.contains("warning[Data::ClockOffset]") && err.contains("torque"), "{err}");
    let r = near_the_truth(&c, "res", 4.5);
    let clock = r.clocks.iter().find(|k| k.group == "torque").unwrap();
    assert!(clock.corrected && (clock.offset_s - 0.06).abs() < (4.0 * clock.offset_std_s).min(0.004), "{clock:?}");
    assert!(r.clocks.iter().any(|k| k.group == "gyro" && !k.corrected), "{:?}", r.clocks);
    assert!((r.chi2_per_dof - 1.0).abs() < 0.05, "{}", r.chi2_per_dof);
    // Trusted, the record is not explained, or explained by wrong parameters.
    let trust = ["identify", "m.toml", "--record", "late.csv", "--out", "x", "--clocks", "trust"];
    let (_, out, err) = c.run(&trust);
    assert!(err.contains("warning[Fit::Misfit]"), "{out}\n{err}");
    // Clocks that agree are left alone.
    let (code, _, err) = c.run(&["identify", "m.toml", "--record", "rec.csv", "--out", "good"]);
    assert!(code == 0 && !err.contains("Clock"), "{err}");
}

#[test]
#[ignore = "full tier: 2 s"]
fn d16_a_clock_that_runs_fast_is_put_right_with_a_warning() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    // The gyro drifts by 48 ms over the record.
    c.write("fast.csv", &shifted(&c.read("rec.csv"), "gyro.", |t| t - 2e-3 * (t - 12.0)));
    let (code, out, err) = c.run(&["identify", "m.toml", "--record", "fast.csv", "--out", "res"]);
    assert_eq!(code, 0, "{out}\n{err}");
    assert!(err.contains("warning[Data::ClockSkew]") && err.contains("gyro"), "{err}");
    let r = near_the_truth(&c, "res", 5.0);
    let clock = r.clocks.iter().find(|k| k.group == "gyro").unwrap();
    assert!(clock.corrected && (clock.skew_ppm - 2000.0).abs() < 200.0, "{clock:?}");
}

#[test]
#[ignore = "full tier: 4 s"]
fn d29_momentum_that_is_not_conserved_is_refused_unless_declared() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let fired = edit(&c.read("rec.csv"), |t, name, x| if name == "gyro.y[rad/s]" && t > 11.0 { x + 4e-3 } else { x });
    c.write("fired.csv", &fired);
    let args = ["identify", "m.toml", "--record", "fired.csv", "--out", "res"];
    c.refused(&args, 12, "Data::MomentumNotConserved", &["N m s", "--external-torque"]);
    assert!(!c.path("res").exists());
    let (code, out, err) = c.run(&[&args[..], &["--external-torque"]].concat());
    // Declared or not, the model has no torque on its base, and the record says so.
    assert_eq!(code, 16, "{out}\n{err}");
    assert!(err.contains("warning[Data::MomentumNotConserved]"), "{err}");
}

/// A torque that acts all the time: the base rate drifts, which no bias does.
#[test]
#[ignore = "full tier: 4 s"]
fn d29_momentum_that_drifts_steadily_is_refused_as_well() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let drifts = edit(&c.read("rec.csv"), |t, name, x| if name == "gyro.z[rad/s]" { x + 3e-4 * t } else { x });
    c.write("drifts.csv", &drifts);
    let args = ["identify", "m.toml", "--record", "drifts.csv", "--out", "res"];
    c.refused(&args, 12, "Data::MomentumNotConserved", &["N m s", "--external-torque"]);
    assert!(!c.path("res").exists());
}

/// Clocks that the record does not tell are taken as they are, unless they are required.
#[test]
#[ignore = "full tier: 2 s"]
fn d15_clocks_that_are_required_must_be_told() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let require = ["--record", "rec.csv", "--out", "res", "--clocks", "require"];
    c.good(&[&["identify", "m.toml"][..], &require].concat());
    assert_eq!(c.result("res").clocks.len(), 2);
    // Hardly any motion: the torques are those of the noise.
    c.write("calm.csv", &calm(&c.read("a.csv")));
    c.simulate("truth.toml", "calm.csv", "calm-rec.csv", &["--seed", "2"]);
    let args = ["identify", "m.toml", "--record", "calm-rec.csv", "--out", "x", "--prior", "0.3"];
    c.refused(
        &[&args[..], &["--clocks", "require"]].concat(),
        13,
        "Data::ClockNotEstimable",
        &["calm-rec", "--clocks trust"],
    );
    assert!(!c.path("x").exists());
}

#[test]
#[ignore = "full tier: 3 s"]
fn d30_a_record_that_does_not_begin_at_rest_is_told_by_its_misfit() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let text = c.read("rec.csv");
    let mut lines = text.lines();
    let head = lines.next().unwrap().to_owned() + "\n";
    c.write("cut.csv", &(head + &lines.skip(450).collect::<Vec<_>>().join("\n") + "\n"));
    let (code, out, err) = c.run(&["identify", "m.toml", "--record", "cut.csv", "--out", "res"]);
    assert_eq!(code, 0, "{out}\n{err}");
    assert!(err.contains("warning[Data::NotAtRest]") && err.contains("--initial-state"), "{err}");
    let r = near_the_truth(&c, "res", 4.5);
    assert!(r.nuisance.iter().any(|p| p.name.starts_with("initial.")) && r.chi2_per_dof < 1.1, "{}", r.chi2_per_dof);
}

#[test]
#[ignore = "full tier: 2 s"]
fn d23_modes_of_the_free_decay_are_matched_to_those_of_the_model() {
    let c = flex();
    c.simulate("truth.toml", "b.csv", "rec.csv", &["--seed", "7", "--hold", "40"]);
    c.good(&["identify", "m.toml", "--record", "rec.csv", "--out", "res", "--modes"]);
    let r = c.result("res");
    let d = &r.decay[0];
    assert!(d.to_s - d.from_s > 39.0 && d.to_s - d.from_s < 46.0, "{} .. {}", d.from_s, d.to_s);
    let matched: Vec<_> = d.modes.iter().filter(|m| m.model_hz.is_some()).collect();
    assert!(matched.len() >= 2, "{d:?}");
    for m in matched {
        let hz = m.model_hz.unwrap();
        assert!((m.frequency_hz / hz - 1.0).abs() < 0.03 && m.mac.unwrap() > 0.7, "{m:?}");
    }
    // The one that turns the base is known to a ten-thousandth.
    assert!(d.modes.iter().any(|m| m.mac.is_some_and(|c| c > 0.99) && m.frequency_std_hz < 1e-4), "{d:?}");
    // Every mode of the model was seen, or it is said why not.
    assert_eq!(d.modes.iter().filter(|m| m.model_hz.is_some()).count() + d.unseen.len(), r.modes.len());
    // Without a decay there is nothing to tell modes from.
    c.simulate("truth.toml", "b.csv", "short.csv", &["--seed", "7"]);
    let args = ["identify", "m.toml", "--record", "short.csv", "--out", "x", "--modes"];
    c.refused(&args, 13, "Data::Resolution", &["--hold"]);
}

#[test]
#[ignore = "full tier: 6 s"]
fn d25_modes_that_do_not_rise_above_the_noise() {
    let c = slosh();
    // Hardly any motion before the hold: nothing rings above the noise.
    c.write("calm.csv", &calm(&c.read("a.csv")));
    c.simulate("truth.toml", "calm.csv", "rec.csv", &["--seed", "2", "--hold", "60"]);
    let args = ["identify", "m.toml", "--record", "rec.csv", "--out", "x", "--modes", "--prior", "0.3"];
    c.refused(&args, 13, "Data::NoPeak", &[]);
}

/// A record that is sampled too slowly for the modes of the model tells none of them; one whose sensors let through what is near
/// half the rate may show it as a mode.
#[test]
#[ignore = "full tier: 3 s"]
fn d24_samples_too_slow_for_the_modes_and_signals_that_were_not_filtered() {
    let c = flex();
    // Hinges that swing at 4.8 Hz, ten samples a second.
    let stiff = c.read("truth.toml").replace("stiffness_nm_per_rad = 200.0", "stiffness_nm_per_rad = 10000.0");
    let stiff = stiff.replace("\"base.*\", \"panel_*.k[*]\", \"panel_*.d[*]\"", "\"base.mass\"");
    c.write("stiff.toml", &stiff.replace("rate_hz = 50.0", "rate_hz = 10.0"));
    c.simulate("stiff.toml", "b.csv", "stiff.csv", &["--seed", "7", "--hold", "30"]);
    let args = ["identify", "stiff.toml", "--record", "stiff.csv", "--out", "x", "--modes"];
    c.refused(&args, 13, "Data::Nyquist", &["10 Hz", "18.0"]);
    c.simulate("truth.toml", "b.csv", "rec.csv", &["--seed", "7", "--hold", "40"]);
    let rec = c.read("rec.csv");
    // One and a half times the noise of the sensor.
    let tone = |t: f64| 0.15 * (std::f64::consts::TAU * 24.2 * t).sin();
    c.write("tone.csv", &edit(&rec, |t, name, x| if name == "tau.joint7[N m]" { x + tone(t) } else { x }));
    for (record, warned) in [("tone.csv", true), ("rec.csv", false)] {
        let (code, out, err) = c.run(&["identify", "truth.toml", "--record", record, "--out", "res", "--force"]);
        // What was folded back is not in the model.
        assert!(code == 0 || code == 16 && warned, "{code} {out}\n{err}");
        let says = ["warning[Data::Aliasing]", "tau.joint7", "above 22.500 Hz", "limit 1 %"];
        assert_eq!(says.iter().all(|s| err.contains(s)), warned, "{err}");
        assert_eq!(err.contains("Aliasing"), warned, "{err}");
    }
}

/// The two modes of hardly damped fuel are closer than a minute tells apart: they are named as a pair.
#[test]
#[ignore = "full tier: 2 s"]
fn d26_modes_closer_than_the_resolution_are_named() {
    let c = slosh();
    c.write("ring.toml", &ringing(&c.read("truth.toml")));
    c.simulate("ring.toml", "b.csv", "ring.csv", &["--seed", "6", "--hold", "60"]);
    let (code, out, err) = c.run(&["identify", "ring.toml", "--record", "ring.csv", "--out", "res", "--modes"]);
    assert_eq!(code, 0, "{out}\n{err}");
    assert!(err.contains("warning[Data::Unresolved]"), "{err}");
    let d = &c.result("res").decay[0];
    let (f1, f2) = d.unresolved[0];
    assert!(f1 < f2 && f2 - f1 < d.resolution_hz && d.resolution_hz < 0.02, "{d:?}");
}

#[test]
#[ignore = "full tier: 5 s"]
fn models_are_compared_by_what_they_predict() {
    let c = flex();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "3"]);
    c.simulate("truth.toml", "b.csv", "other.csv", &["--seed", "4"]);
    let args = ["identify", "m.toml", "--record", "rec.csv", "--held-out", "other.csv", "--out", "res", "--compare"];
    let out = c.good(&args);
    assert!(out.contains("recommended: flexible") && out.contains("Models compared by other.csv"), "{out}");
    let t = c.result("res").comparison.unwrap();
    assert!(t.explains && t.candidates.len() == 2);
    let rigid = t.candidates.iter().find(|k| k.name == "rigid").unwrap();
    assert!(
        rigid.held_out > 2.0 * rigid.held_out_std && rigid.held_out_mean_square > 100.0 && rigid.bic > 1000.0,
        "{rigid:?}"
    );
    let one = ["identify", "m.toml", "--record", "rec.csv", "--out", "x", "--compare", "rigid"];
    c.refused(&one, 11, "Config::Compare", &[]);
}

/// The peers' arm on the ground with noise of its torques, and a motion of its joints.
fn simulated_arm() -> Case {
    let folder = fixture("");
    let c = slosh();
    let text = std::fs::read_to_string(folder.join("ground/arm.toml")).unwrap();
    let noisy = text.replace("../peers-model/", "").replace("250.0", "250.0\n\n[sensors.torque]\nnoise_std_nm = 0.2");
    c.write("arm.toml", &noisy);
    std::fs::copy(folder.join("peers-model/arm_fixed.urdf"), c.path("arm_fixed.urdf")).unwrap();
    c.write("motion.csv", &c.read("a.csv").replace("q.joint", "q.arm_j"));
    c
}

/// A base that is bolted down has neither rate nor attitude: columns of constants would pass for broken sensors.
#[test]
fn a_simulated_arm_on_the_ground_has_no_gyro() {
    let c = simulated_arm();
    c.simulate("arm.toml", "motion.csv", "exact.csv", &["--noise-free"]);
    c.simulate("arm.toml", "motion.csv", "rec.csv", &["--seed", "3"]);
    for (file, columns) in [("exact.csv", 1 + 4 * 7), ("rec.csv", 1 + 2 * 7)] {
        let text = c.read(file);
        let head: Vec<&str> = text.lines().next().unwrap().split(',').collect();
        assert!(
            head.len() == columns && !head.iter().any(|h| h.starts_with("gyro") || h.starts_with("att")),
            "{head:?}"
        );
    }
}

#[test]
#[ignore = "full tier: 4 s"]
fn a_simulated_arm_on_the_ground_is_identified() {
    let c = simulated_arm();
    c.simulate("arm.toml", "motion.csv", "rec.csv", &["--seed", "3"]);
    let (code, out, err) = c.run(&["identify", "arm.toml", "--record", "rec.csv", "--reduce", "--out", "res"]);
    assert!(code == 0 && !err.contains("Stuck"), "{out}\n{err}");
    assert!((c.result("res").chi2_per_dof - 1.0).abs() < 0.02);
}

#[test]
#[ignore = "full tier: 3 s"]
fn an_arm_on_the_ground_is_calibrated_from_positions_and_torques() {
    let folder = fixture("");
    let c = slosh();
    let mission = folder.join("ground/arm.toml");
    let mission = mission.to_str().unwrap();
    let log = folder.join("ground/log.csv");
    let log = log.to_str().unwrap();
    c.good(&["check", mission]);
    let args = ["identify", mission, "--record", log, "--held-out", "0.33", "--out", "res", "--force"];
    // Base parameters alone can be told: so says the command, once, and finds them.
    let (code, out, err) = c.run(&args);
    assert_eq!(code, 0, "{out}\n{err}");
    assert_eq!(err.matches("Fit::Unidentifiable").count(), 1, "{err}");
    assert_eq!(err.matches("Data::Bandwidth").count(), 1, "{err}");
    let r = c.result("res");
    let json = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(folder.join("ground").join(name)).unwrap()).unwrap()
    };
    // Friction and offsets are those of the truth.
    let truth = json("truth.json");
    for (j, joint) in truth["joints"].as_array().unwrap().iter().enumerate() {
        for term in ["viscous", "coulomb", "offset"] {
            let name = format!("friction.{}.{term}", joint.as_str().unwrap());
            let p = r.nuisance.iter().find(|p| p.name == name).unwrap();
            let want = truth[term][j].as_f64().unwrap();
            // A gravity load in one direction only may pass for an offset; then there is no deviation.
            if let Some(s) = p.std {
                assert!((p.value - want).abs() < 6.0 * s + 0.05, "{name}: {} +- {s}, {want}", p.value);
            }
        }
    }
    // In the last third the motion ends faster than elsewhere, and behind the low pass that the rest asks for less of it is left: that is allowed for.
    let h = r.held_out.as_ref().unwrap();
    assert!(h.explained && h.chi2_per_dof < 1.3 && h.verdict.contains("and its low pass make"), "{h}");
    // Behind a wide one it is predicted as well as by ordinary least squares on Pinocchio's regressor.
    let (code, out, err) = c.run(&[&args[..], &["--low-pass", "20"]].concat());
    assert_eq!(code, 0, "{out}\n{err}");
    let r = c.result("res");
    let ols = json("ols.json");
    let as_well_as = |r: &IdentificationResult, file: &str, key: &str, limit: f64| {
        let text = c.read(file);
        let head: Vec<&str> = text.lines().next().unwrap().split(',').collect();
        let channels = &r.held_out.as_ref().unwrap().channels;
        for (k, want) in channels.iter().zip(ols[key].as_array().unwrap()) {
            // Samples close to rest are left out of both, here as zeros.
            let column = head.iter().position(|h| h.starts_with(&format!("{}.residual", k.name))).unwrap();
            let of = |l: &str| -> f64 { l.split(',').nth(column).unwrap().parse().unwrap() };
            let used: Vec<f64> = text.lines().skip(1).map(of).filter(|r| *r != 0.0).collect();
            let rms = (used.iter().map(|r| r * r).sum::<f64>() / used.len() as f64).sqrt();
            println!("{}: {rms:.4} and {want:.4}, ratio {:.4}", k.name, rms / want.as_f64().unwrap());
            assert!(rms < limit * want.as_f64().unwrap(), "{}: {rms} and {want}", k.name);
        }
        assert_eq!(channels.len(), 7);
    };
    as_well_as(&r, "res/held-out.csv", "held_out_rms_nm", 1.05);
    // Torques that ripple: behind a low pass as well as by least squares behind that of SciPy, with the same friction.
    let ripple = |t: f64, j: usize| -> f64 {
        [11.0, 23.0, 41.0].iter().map(|f| 1.5 * (std::f64::consts::TAU * f * t + j as f64).sin()).sum()
    };
    let joint = |name: &str| name.strip_prefix("tau.arm_j")?.split('[').next()?.parse::<usize>().ok();
    let rippled =
        edit(&std::fs::read_to_string(log).unwrap(), |t, name, x| joint(name).map_or(x, |j| x + ripple(t, j - 1)));
    c.write("rippled.csv", &rippled);
    let low = [
        "identify",
        mission,
        "--record",
        "rippled.csv",
        "--held-out",
        "0.33",
        "--out",
        "low",
        "--reduce",
        "--low-pass",
        "8",
    ];
    let (code, out, err) = c.run(&low);
    assert_eq!(code, 0, "{out}\n{err}");
    let low = c.result("low");
    assert!(low.held_out.as_ref().unwrap().explained && low.provenance.settings["low_pass_hz"] == "8");
    // Parts are filtered one by one, so that 61 samples fewer are judged than by SciPy.
    as_well_as(&low, "low/held-out.csv", "low_pass_held_out_rms_nm", 1.05);
    for (a, b) in low.nuisance.iter().zip(&r.nuisance) {
        if let (Some(s), Some(t)) = (a.std, b.std) {
            assert!((a.value - b.value).abs() < 6.0 * (s + t) + 0.1, "{}: {} and {}", a.name, a.value, b.value);
        }
    }
    // All samples but those at the ends of both parts, twice: of positions, then of torques; and the same filter when it is judged again.
    let used = |file: &str| c.read(file).lines().count() - 1;
    assert_eq!((used("low/residuals.csv"), used("low/held-out.csv")), (2010 - 4 * 61, 990 - 4 * 61));
    let (code, out, err) = c.run(&["validate", "low", "--record", log]);
    assert_eq!(code, 0, "{out}\n{err}");
    // On a floating base there is none, and none that is too high or too slow for a record.
    for (hz, says) in [("60", "a tenth of the rate at most"), ("0.01", "the record has")] {
        let wrong = ["identify", mission, "--record", log, "--out", "x", "--reduce", "--low-pass", hz];
        c.refused(&wrong, 11, "Config::LowPass", &[says]);
    }
    // Without noise, too, there is a robot that can exist.
    c.write("arm.csv", &c.read("b.csv").replace("q.joint", "q.arm_j"));
    c.simulate(mission, "arm.csv", "exact.csv", &["--noise-free"]);
    let (code, out, err) = c.run(&["identify", mission, "--record", "exact.csv", "--out", "exact", "--reduce"]);
    assert_eq!(code, 0, "{out}\n{err}");
    c.simulate("truth.toml", "b.csv", "rec.csv", &["--seed", "7"]);
    let floating = ["identify", "m.toml", "--record", "rec.csv", "--out", "x", "--low-pass", "2"];
    c.refused(&floating, 11, "Config::LowPass", &["--low-pass"]);
    // Files of the arm; judged again by themselves.
    c.good(&["check", "res/identified.toml"]);
    let wrong = [&args[..], &["--loss", "huber"]].concat();
    c.refused(&wrong, 11, "Config::Method", &["--loss squares"]);
}
