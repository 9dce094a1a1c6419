//! `ffid simulate`, `identify`, `validate` and `predict` through the real binary: the chain from a mission to an answer,
//! the files it leaves, and what wrong records get (rows `D..` and `R..` of `bad-inputs.md`).

use crate::case::{Case, flex, near_the_truth, slosh, trajectory};
use ff_mission::Leniency;
use ffid::open::open;
use ffid::workflow::identify::State;
use serde_json::Value;
use std::fs;

#[test]
#[ignore = "full tier: 4 s"]
fn slosh_from_a_mission_to_a_validated_model() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    c.simulate("truth.toml", "b.csv", "other.csv", &["--seed", "5"]);
    let out = c.good(&["identify", "m.toml", "--record", "rec.csv", "--held-out", "other.csv", "--out", "res"]);
    assert!(out.contains("All 14 parameters are determined") && out.contains("held out: other.csv"), "{out}");
    c.clean();
    let r = near_the_truth(&c, "res", 4.5);
    assert!((r.chi2_per_dof - 1.0).abs() < 0.03, "{}", r.chi2_per_dof);
    let h = r.held_out.as_ref().unwrap();
    assert!(h.explained && (h.chi2_per_dof - 1.0).abs() < 0.05, "{}", h.chi2_per_dof);
    assert_eq!((r.nuisance.len(), r.channels.len(), r.provenance.inputs.len()), (10, 10, 4));
    // The start was that of the mission.
    assert_eq!(r.parameters[0].start, 571.0);

    // result.json is read back to the bit, and written again to the byte.
    let bytes = fs::read(c.path("res/result.json")).unwrap();
    assert_eq!(String::from_utf8(r.to_json().unwrap()).unwrap(), String::from_utf8(bytes).unwrap());
    // identified.toml is the same model, bit for bit; its URDF alone the same robot.
    let again = open(&c.path("res/identified.toml"), Leniency::default()).unwrap();
    for (d, v) in again.model.param_decls().iter().zip(&r.model) {
        assert_eq!((&d.name, d.nominal.to_bits()), (&v.name, v.value.to_bits()));
    }
    let alone = open(&c.path("res/identified.urdf"), Leniency::default()).unwrap();
    assert!((alone.model.inertia(0).mass - r.parameters[0].value).abs() < 1e-12 * 600.0);
    for name in [
        "report.html",
        "report.txt",
        "residuals.csv",
        "held-out.csv",
        "signals.svg",
        "spectra.svg",
        "manifest.toml",
        "replay.html",
    ] {
        assert!(c.path("res").join(name).exists(), "{name}");
    }
    let html = c.read("res/report.html");
    assert!(html.contains("<svg") && html.contains("default-src 'none'") && !html.contains(" src=\""));
    assert!(html.contains("<a href=\"replay.html\">") && html.contains("<figure class=\"plot\">"));
    // The identified robot beside that of the mission, on the motion of the record.
    let replay = c.read("res/replay.html");
    let data = replay.split("<script type=\"application/json\">").nth(1).unwrap().split("</script>").next().unwrap();
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    let scenes = data["scenes"].as_array().unwrap();
    assert_eq!((&scenes[0]["label"], &scenes[1]["label"]), (&"identified".into(), &"mission".into()));
    let base = |k: usize| scenes[k]["nodes"][0]["mass_kg"].as_f64().unwrap();
    assert_eq!((base(0), base(1)), (r.parameters[0].value, 571.0));
    let seconds = |k: usize| {
        let m = &scenes[k]["motion"];
        m["step_s"].as_f64().unwrap() * (m["frames"].as_f64().unwrap() - 1.0)
    };
    assert!((seconds(0) - r.provenance.record.seconds).abs() < 0.1 && seconds(0) == seconds(1), "{}", seconds(0));
    assert!(scenes[0]["motion"]["ellipsoids"]["at"].as_array().unwrap().len() > 10);
    for piece in ["All 14 parameters", "Provenance", "mode 1", "tau.joint3", &r.provenance.inputs[2].sha256] {
        assert!(html.contains(piece), "{piece}");
    }
    let csv = c.read("res/residuals.csv");
    assert!(csv.starts_with("time[s],tau.joint1.measured[N m],tau.joint1.predicted[N m],tau.joint1.residual[N m],"));
    assert_eq!(csv.lines().count(), 1 + r.provenance.record.samples);

    // A record it has not seen; one it has (D39); one of another robot.
    c.simulate("truth.toml", "b.csv", "third.csv", &["--seed", "6"]);
    let out = c.good(&["validate", "res", "--record", "third.csv", "--out", "val"]);
    assert!(out.contains("The model predicts these data"), "{out}");
    assert!(c.read("val/report.html").contains("Validation of paper"));
    c.refused(&["validate", "res", "--record", "rec.csv"], 12, "Data::SameData", &["rec.csv", "SHA-256"]);
    c.good(&["convert", "rec.csv", "rec.parquet"]);
    c.refused(&["validate", "res", "--record", "rec.parquet"], 12, "Data::SameData", &["rec.parquet", "rec.csv"]);
    c.simulate("m.toml", "b.csv", "wrong.csv", &["--seed", "7"]);
    c.refused(&["validate", "res", "--record", "wrong.csv"], 16, "Fit::NotExplained", &["limit 2"]);

    // The prediction is what the identified robot does: close to the truth, far closer than what was believed.
    c.good(&["predict", "res", "--trajectory", "b.csv", "--out", "pred.csv"]);
    c.simulate("truth.toml", "b.csv", "exact.csv", &["--noise-free"]);
    c.simulate("m.toml", "b.csv", "believed.csv", &["--noise-free"]);
    let gyro = |name: &str| -> Vec<f64> {
        let text = c.read(name);
        let k = text.lines().next().unwrap().split(',').position(|h| h == "gyro.y[rad/s]").unwrap();
        text.lines().skip(1).map(|l| l.split(',').nth(k).unwrap().parse().unwrap()).collect()
    };
    let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
    let (exact, good, bad) = (gyro("exact.csv"), gyro("pred.csv"), gyro("believed.csv"));
    assert!(off(&exact, &good) < 0.1 * off(&exact, &bad), "{} {}", off(&exact, &good), off(&exact, &bad));

    // A folder that is not whole, or was changed, is refused (R04).
    fs::write(c.path("res/result.json"), "{}").unwrap();
    c.refused(&["validate", "res", "--record", "third.csv"], 12, "Data::Changed", &["result.json"]);
    fs::remove_file(c.path("res/manifest.toml")).unwrap();
    c.refused(
        &["predict", "res", "--trajectory", "b.csv", "--out", "p.csv"],
        12,
        "Data::Incomplete",
        &["manifest.toml"],
    );
    c.refused(&["validate", "val", "--record", "third.csv"], 12, "Data::WrongResult", &["ffid validate"]);
    c.refused(&["validate", "nowhere", "--record", "third.csv"], 20, "Io::Read", &["nowhere"]);
}

#[test]
#[ignore = "full tier: 3 s"]
fn flex_with_priors_and_a_fraction_held_out() {
    let c = flex();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "11"]);
    let (code, v) = {
        let (code, out, _) =
            c.run(&["identify", "m.toml", "--record", "rec.csv", "--held-out", "0.25", "--out", "res", "--json"]);
        (code, serde_json::from_str::<Value>(&out).unwrap())
    };
    assert_eq!(code, 0, "{v}");
    let r = near_the_truth(&c, "res", 4.5);
    assert_eq!(v["result"]["parameters"][0]["value"].as_f64(), Some(r.parameters[0].value));
    assert_eq!(r.parameters[0].prior_mean, Some(620.0));
    let h = r.held_out.as_ref().unwrap();
    assert!(h.source.contains("25.0 %") && h.explained, "{h}");
    assert!(r.modes.len() == 4 && (r.modes[1].frequency_hz - 0.2289).abs() < 0.01, "{:?}", r.modes);
    // The output is there: refused without --force, and kept as .bak with it.
    c.refused(&["identify", "m.toml", "--record", "rec.csv", "--out", "res"], 20, "Io::Exists", &["--force"]);
    let before = c.read("res/result.json");
    c.good(&["identify", "m.toml", "--record", "rec.csv", "--out", "res", "--force", "--quiet"]);
    assert_eq!(c.read("res.bak/result.json"), before);
    // The same seed gives the same bytes, and another one does not.
    c.simulate("truth.toml", "a.csv", "again.csv", &["--seed", "11"]);
    assert_eq!(c.read("again.csv"), c.read("rec.csv"));
    c.simulate("truth.toml", "a.csv", "again.csv", &["--seed", "12"]);
    assert_ne!(c.read("again.csv"), c.read("rec.csv"));
}

/// Outer hinges whose modes hardly stand out of the noise: every start ends at a peak of the noise, with a deviation that covers the others.
#[test]
#[ignore = "full tier: 6 s"]
fn modes_that_drown_in_the_noise_have_several_minima_and_deviations_that_cover_them() {
    let cad = "\"base.mass\" = 620.0\n\"panel_left.k[1]\" = 260.0\n\"panel_right.k[1]\" = 140.0";
    let c = Case::new("flex.toml", "parameters = [\"base.mass\", \"panel_*.k[*]\", \"panel_*.d[*]\"]", cad);
    for name in ["truth.toml", "m.toml"] {
        let loud = c.read(name).replace("noise_std_nm = 0.1 ", "noise_std_nm = 2.0 ");
        let loud = loud.replace("noise_std_rad_per_s = 1.5e-4", "noise_std_rad_per_s = 3e-3");
        c.write(name, &loud.replace("rate_hz = 50.0", "rate_hz = 20.0"));
    }
    let near = c.read("m.toml").replace("k[1]\" = 260.0", "k[1]\" = 170.0").replace("k[1]\" = 140.0", "k[1]\" = 170.0");
    c.write("other.toml", &near);
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "11"]);
    let lowest = ["m.toml", "other.toml"].map(|m| {
        let (code, out, err) = c.run(&["identify", m, "--record", "rec.csv", "--out", "res", "--force"]);
        assert_eq!(code, 0, "{out}\n{err}");
        assert!(out.contains("NOT unique") && err.contains("warning[Fit::MultipleMinima]"), "{out}\n{err}");
        let m = near_the_truth(&c, "res", 3.5).minima.unwrap();
        let k = m.alternatives.iter().find(|a| a.name == "panel_left.k[1]").unwrap();
        let apart = k.values.iter().map(|v| (v - k.values[0]).abs()).fold(0.0, f64::max);
        let stated = c.result("res").parameters.iter().find(|p| p.name == k.name).unwrap().std.unwrap();
        assert!(apart > 2.0 * k.stds[0] && stated > k.stds[0], "{k:?} {stated}");
        m.objectives[0]
    });
    assert!((lowest[0] - lowest[1]).abs() < 0.1, "{lowest:?}");
}

/// A gyro turned by some degrees on a light base presses the base against the edge of what can exist. The error is named with its size, and
/// `--adopt` ends at the truth.
#[test]
#[ignore = "full tier: 12 s"]
fn an_error_that_presses_a_base_to_the_edge_is_named() {
    let c = Case::new("flex.toml", "parameters = [\"base.*\"]", "");
    let base = "base_inertial = { mass_kg = 9.0, com_m = [0.06, 0.02, 0.05], inertia_com_kgm2 = [0.21, 0.01, -0.02, 0.19, 0.01, 0.23] }";
    let light = format!(
        "[robot]\nurdf = \"robot.urdf\"\nbase = \"floating\"\n{base}\n\n[sensors]\nrate_hz = 50.0\n[sensors.torque]\nnoise_std_nm = 0.1\n[sensors.gyro]\nnoise_std_rad_per_s = 1.5e-4\n[sensors.encoder]\nbits = 20\n[estimate]\nmethod = \"output_error\"\nparameters = [\"base.*\"]\n"
    );
    c.write("truth.toml", &light);
    c.write("m.toml", &format!("{light}start_offset = 0.2\n"));
    for (trajectory, out, seed) in [("a.csv", "rec.csv", "3"), ("b.csv", "other.csv", "4")] {
        c.simulate("truth.toml", trajectory, out, &["--seed", seed]);
        let text = c.read(out);
        let (head, rows) = text.split_once('\n').unwrap();
        let at = head.split(',').position(|h| h.starts_with("gyro.x")).unwrap();
        let (sin, cos) = 6f64.to_radians().sin_cos();
        let turned: Vec<String> = rows
            .lines()
            .map(|l| {
                let mut v: Vec<f64> = l.split(',').map(|x| x.parse().unwrap()).collect();
                (v[at + 1], v[at + 2]) = (cos * v[at + 1] - sin * v[at + 2], sin * v[at + 1] + cos * v[at + 2]);
                v.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
            })
            .collect();
        c.write(out, &format!("{head}\n{}\n", turned.join("\n")));
    }
    let args = ["identify", "m.toml", "--record", "rec.csv", "--held-out", "other.csv", "--out", "res", "--force"];
    let (code, out, err) = c.run(&args);
    assert_eq!(code, 16, "{out}\n{err}");
    assert!(err.contains("estimate it: --adopt "), "{err}");
    let r = c.result("res");
    let e = r.evidence.as_ref().unwrap();
    // The axis of the first joint turned the other way does the same to the record, and may come first.
    let gyro = e.named.iter().find(|n| n.name == "gyro-misalignment" && n.refitted).unwrap();
    assert!(e.reason.contains(&gyro.text), "{e:?}");
    let size = gyro.size.iter().map(|c| c.value.powi(2)).sum::<f64>().sqrt().to_degrees();
    assert!((size - 6.0).abs() < 0.1, "{size}");
    let h = r.held_out.as_ref().unwrap();
    assert!(!h.explained && h.evidence.as_ref().is_some_and(|e| e.state == State::Contradicted), "{:?}", h.evidence);
    c.good(&[&args[..], &["--adopt", "gyro-misalignment"]].concat());
    let r = near_the_truth(&c, "res", 4.5);
    assert!(r.held_out.unwrap().evidence.is_some_and(|e| e.state == State::Explained));
}

/// A rigid robot goes through the reduced dynamics algorithm; exact data give the truth.
#[test]
fn a_rigid_robot_from_exact_data() {
    let c = slosh();
    let rigid = |name: &str| {
        let text = c.read(name);
        let a = text.find("[[appendage]]").unwrap();
        let b = text.find("[sensors]").unwrap();
        let text = format!("{}{}", &text[..a], &text[b..]).replace(", \"tank.k[*]\", \"tank.d[*]\"", "");
        let kept: Vec<&str> = text.lines().filter(|l| !l.contains("tank")).collect();
        c.write(name, &(kept.join("\n") + "\n"));
    };
    rigid("truth.toml");
    rigid("m.toml");
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--noise-free"]);
    c.good(&["identify", "m.toml", "--record", "rec.csv", "--out", "res"]);
    let r = c.result("res");
    assert_eq!(r.method, ffid::workflow::identify::Method::Rda);
    assert!((r.parameters[0].value - 600.0).abs() < 1e-4, "{}", r.parameters[0].value);
    assert!(r.nuisance.is_empty() && r.channels.len() == 7);
    // No noise figures: nothing to weigh residuals by.
    for name in ["m.toml", "truth.toml"] {
        let quiet =
            c.read(name).replace("noise_std_nm = 0.1", "noise_std_nm = 0").replace("noise_std_rad_per_s = 1.5e-4", "");
        c.write(name, &quiet);
    }
    let args = ["identify", "m.toml", "--record", "rec.csv", "--out", "r2"];
    c.refused(&args, 11, "Config::NoNoise", &["--torque-noise", "[sensors.gyro]", "limit > 0 N m"]);
    c.clean();
    c.good(&[&args[..], &["--torque-noise", "0.1", "--gyro-noise", "1e-4"]].concat());
}

#[test]
#[ignore = "full tier: 5 s"]
fn d27_what_the_record_cannot_tell_is_named_and_priors_cover_it() {
    let c = flex();
    // A joint about one axis only: most of the base is not excited.
    let mut text = String::from("time[s]");
    (1..=7).for_each(|j| text += &format!(",q.joint{j}[rad]"));
    text.push('\n');
    for k in 0..=200 {
        let s = f64::from(k) / 200.0;
        let q = 1.2 * (s * (1.0 - s) * 4.0).powi(3) * (9.0 * s).sin();
        text += &format!("{},{q},0,0,0,0,0,0\n", 10.0 * s);
    }
    c.write("one.csv", &text);
    c.simulate("truth.toml", "one.csv", "rec.csv", &["--seed", "2"]);
    let mission = c
        .read("m.toml")
        .replace("prior_relative_std = 0.3", "")
        .replace("\"base.*\", \"panel_*.k[*]\", \"panel_*.d[*]\"", "\"base.*\", \"panel_*\"");
    c.write("free.toml", &mission);
    let args = ["identify", "free.toml", "--record", "rec.csv", "--force"];
    // The message lists the largest terms of three combinations; which of two like panels is among them is left to rounding.
    c.refused(&args, 13, "Fit::Unidentifiable", &["panel_"]);
    let r = c.result("free-identified");
    assert!(!r.null_directions.is_empty() && !r.priors_cover && r.rank < r.singular_values.len());
    for part in ["base.mass", "panel_left.", "panel_right."] {
        let named = |(name, _): &(String, f64)| name.starts_with(part);
        assert!(r.null_directions.iter().any(|d| d.terms.iter().any(named)), "{part}");
    }
    // With priors everything has a deviation, and what the data do not tell is a warning.
    let (code, out, err) = c.run(&[&args[..], &["--prior", "0.3", "--out", "p"]].concat());
    assert_eq!(code, 0, "{out}\n{err}");
    assert!(err.contains("warning[Fit::Unidentifiable]"), "{err}");
    let r = c.result("p");
    assert!(r.priors_cover && r.parameters.iter().all(|p| p.std.is_some()));
}

/// Each defect of a record has its code, its place and exit code 12, before anything is written.
#[test]
fn d01_to_d12_and_d34_d37_defects_of_records() {
    let c = slosh();
    c.simulate("truth.toml", "b.csv", "rec.csv", &["--seed", "4"]);
    let good = c.read("rec.csv");
    let refuse = |text: &str, code: &str, says: &[&str], more: &[&str]| {
        c.write("bad.csv", text);
        c.refused(&[&["identify", "m.toml", "--record", "bad.csv"], more].concat(), 12, code, says);
        assert!(!c.path("m-identified").exists());
        c.clean();
    };
    let header = good.lines().next().unwrap().to_owned() + "\n";
    let cell = |line: usize, column: usize, new: &str| {
        let mut lines: Vec<String> = good.lines().map(str::to_owned).collect();
        let mut cells: Vec<&str> = lines[line - 1].split(',').collect();
        cells[column] = new;
        lines[line - 1] = cells.join(",");
        lines.join("\n") + "\n"
    };
    let first = |n: usize| good.lines().take(n).fold(String::new(), |s, l| s + l + "\n");
    refuse("", "Data::NoSamples", &["bad.csv:1"], &[]); // D01
    refuse(&header, "Data::NoSamples", &["no samples"], &[]);
    refuse(&first(12), "Data::TooShort", &["11 samples", ">= 28 samples"], &[]); // D02
    refuse(&cell(30, 9, "nan"), "Data::NotFinite", &["bad.csv:30:", "tau, channel 2"], &[]); // D03
    refuse(&cell(30, 9, "1e400"), "Data::NotFinite", &["--gaps drop"], &[]);
    refuse(&good.replacen(",0", "", 1), "Data::RowLength", &["bad.csv:"], &[]); // D04
    refuse(good.trim_end(), "Data::MaybeTruncated", &["cut short"], &[]); // D05
    refuse(&good.replace(',', " "), "Data::Separator", &["blanks"], &[]); // D06
    refuse(&good.replace("gyro.z[rad/s]", "temperature[K]"), "Data::Columns", &["gyro.z", "temperature"], &[]); // D07
    refuse(&good.replace("q.joint1[rad]", "q.joint1"), "Data::UnitMissing", &["deg"], &[]); // D08
    refuse(&good.replace("tau.joint1[N m]", "tau.joint1[lbf in]"), "Data::UnknownUnit", &["mN m"], &[]);
    refuse(&cell(30, 0, "0.01"), "Data::NonMonotone", &["bad.csv:30"], &[]); // D11
    refuse(&good.replace("time[s]", "time[min]"), "Data::TimeScale", &["1.2"], &[]); // D12
    refuse(&good, "Data::TooLarge", &["--max-rows"], &["--max-rows", "50"]); // D34
    refuse(&good, "Data::TooLarge", &["--max-bytes"], &["--max-bytes", "1000"]);
    refuse(&good.replace("joint3", "joint_3"), "Data::NameMismatch", &["is joint_3 meant to be joint3?"], &[]); // D37
    // Readings of a sensor that died (D18) and of one at the end of its range (D17).
    let column = |k: usize, f: &dyn Fn(f64) -> f64| {
        let rows = good.lines().skip(1).map(|l| {
            let mut cells: Vec<String> = l.split(',').map(str::to_owned).collect();
            cells[k] = f(cells[k].parse().unwrap()).to_string();
            cells.join(",")
        });
        header.clone() + &rows.collect::<Vec<_>>().join("\n") + "\n"
    };
    refuse(&column(9, &|_| 0.25), "Data::Stuck", &["tau.joint2"], &[]);
    let top = good.lines().skip(1).map(|l| l.split(',').nth(9).unwrap().parse::<f64>().unwrap()).fold(0.0, f64::max);
    refuse(&column(9, &|x| x.min(0.4 * top)), "Data::Saturated", &["tau.joint2", "limit 1 %"], &[]);
    // A gyro mounted the other way round, and a torque with the wrong sign (D21).
    refuse(&column(16, &|x| -x), "Data::AxisMismatch", &["gyro", "-y"], &[]);
    refuse(&column(9, &|x| -x), "Data::AxisMismatch", &["tau.joint2", "sign"], &[]);
    // The same file to fit and to judge (D39), and files that are not there.
    c.write("bad.csv", &good);
    c.write("copy.csv", &good);
    let args = ["identify", "m.toml", "--record", "bad.csv", "--held-out", "copy.csv"];
    c.refused(&args, 12, "Data::SameData", &["copy.csv", "bad.csv"]);
    // Its readings in another format.
    c.good(&["convert", "bad.csv", "copy.parquet", "--si"]);
    for more in [&["--record", "bad.csv", "--held-out", "copy.parquet"][..], &["--records", "bad.csv", "copy.parquet"]]
    {
        let args = [&["identify", "m.toml"], more].concat();
        c.refused(&args, 12, "Data::SameData", &["copy.parquet", "bad.csv"]);
    }
    c.refused(&["identify", "m.toml", "--record", "none.csv"], 20, "Io::Read", &["none.csv"]);
    c.refused(&["identify", "m.toml", "--record", "bad.csv", "--held-out", "1.5"], 11, "Config::OutOfRange", &["1.5"]);
    c.refused(&["identify", "m.toml", "--record", "bad.csv", "--held-out", "30%"], 11, "Config::BadChoice", &["30%"]);
    c.clean();
}

/// Units, columns in another order, line ends of Windows and a byte order mark give the same answer (D08, R10).
#[test]
#[ignore = "full tier: 2 s"]
fn d08_r10_the_same_record_in_other_units_gives_the_same_answer() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let mut lines = Vec::new();
    for (i, l) in c.read("rec.csv").lines().enumerate() {
        let mut cells: Vec<String> = l.split(',').map(str::to_owned).collect();
        if i == 0 {
            cells = cells
                .iter()
                .map(|h| h.replace("time[s]", "time[ms]").replace("[rad]", "[deg]").replace("N m", "mN m"))
                .collect();
        } else {
            for (k, x) in cells.iter_mut().enumerate() {
                let v: f64 = x.parse().unwrap();
                let f = if k == 0 || (8..15).contains(&k) {
                    1e3
                } else if k < 8 {
                    180.0 / std::f64::consts::PI
                } else {
                    1.0
                };
                *x = (v * f).to_string();
            }
        }
        cells.rotate_left(5);
        lines.push(cells.join(","));
    }
    c.write("other.csv", &format!("\u{feff}{}\r\n", lines.join("\r\n")));
    for (record, out) in [("rec.csv", "one"), ("other.csv", "two")] {
        c.good(&["identify", "m.toml", "--record", record, "--out", out, "--quiet"]);
    }
    let (one, two) = (c.result("one"), c.result("two"));
    for (a, b) in one.parameters.iter().zip(&two.parameters) {
        assert!((a.value - b.value).abs() < 1e-5 * a.std.unwrap(), "{}: {} {}", a.name, a.value, b.value);
    }
}

/// Fuel that swings otherwise than the mission says, and is not estimated: the record is not explained, and that is said.
#[test]
#[ignore = "full tier: 2 s"]
fn a_model_that_lacks_something_is_told_apart() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    c.write("stiff.toml", &c.read("m.toml").replace(", \"tank.k[*]\", \"tank.d[*]\"", ""));
    let (code, out, err) = c.run(&["identify", "stiff.toml", "--record", "rec.csv", "--out", "res"]);
    assert_eq!(code, 16, "{out}\n{err}");
    assert!(out.contains("does NOT explain the record") && err.contains("warning[Fit::Misfit]"), "{out}\n{err}");
    // Numbers with deviations would pass for an answer.
    let html = c.read("res/report.html");
    let answer = html.split("Answer</h2>").nth(1).unwrap().split("Trust</h2>").next().unwrap();
    assert!(answer.contains("None that can be used") && !answer.contains('\u{b1}'), "{answer}");
    c.write("far.toml", &c.read("m.toml").replace("\"tank.k[0]\" = 24.5", "\"tank.k[0]\" = 300.0"));
    // Few iterations are no solution: 14, with what there is in the folder and no robot made of it.
    c.refused(
        &["identify", "far.toml", "--record", "rec.csv", "--max-iterations", "1", "--out", "few", "--force"],
        14,
        "Fit::NoSolution",
        &[],
    );
    assert!(c.path("few/result.json").exists() && !c.path("few/identified.toml").exists());
    c.refused(&["predict", "few", "--trajectory", "b.csv", "--out", "p.csv"], 12, "Data::NoSolution", &[]);
    c.refused(
        &["identify", "m.toml", "--record", "rec.csv", "--method", "rda"],
        11,
        "Config::Method",
        &["output-error"],
    );
    let urdf = ["identify", "robot.urdf", "--record", "rec.csv"];
    c.refused(&urdf, 11, "Config::NoMission", &["robot.urdf"]);
}

/// Output that cannot be written, and a folder that another run holds (R02, R07).
#[test]
fn r02_r07_outputs_that_cannot_be_had() {
    let c = slosh();
    c.simulate("truth.toml", "b.csv", "rec.csv", &[]);
    c.refused(&["identify", "m.toml", "--record", "rec.csv", "--out", "rec.csv/x"], 20, "Io::Write", &["rec.csv"]);
    let lock = fs::File::create(c.path("held.lock")).unwrap();
    lock.try_lock().unwrap();
    fs::write(c.path("held.lock"), "pid 12345").unwrap();
    c.refused(&["identify", "m.toml", "--record", "rec.csv", "--out", "held"], 21, "Io::Locked", &["pid 12345"]);
    let args = ["simulate", "m.toml", "--trajectory", "b.csv", "--out", "rec.csv"];
    c.refused(&args, 20, "Io::Exists", &["--force"]);
    c.refused(&[&args[..5], &["n.csv", "--hold=-1"]].concat(), 11, "Config::OutOfRange", &["--hold"]);
}

/// `[parameters]` of a mission: values that cannot be are refused at their line (M39).
#[test]
fn m39_values_of_parameters() {
    let c = slosh();
    let text = c.read("truth.toml");
    for (line, code, says) in [
        ("\"base.mas\" = 3.0", "Config::NoSuchParameter", "did you mean base.mass?"),
        ("\"tank.k[0]\" = -3.0", "Config::Param", "outside its bounds"),
        ("\"base.mass\" = -3.0", "Config::Inertia", "base"),
        ("\"base.mass\" = \"3\"", "Config::Type", "expected a number"),
        ("base.mass = 3.0", "Config::Type", "in quotes"),
    ] {
        c.write("bad.toml", &format!("{text}\n[parameters]\n{line}\n"));
        c.refused(&["check", "bad.toml"], 11, code, &[says, &format!(":{}", text.lines().count() + 3)]);
    }
}

/// Killed at any moment, the folder is absent or whole, and the next run removes what was left (R04); Ctrl-C ends with 130, with
/// what there is by then, whole, or nothing (R03).
#[cfg(unix)]
#[test]
#[ignore = "full tier: 9 s"]
fn r03_r04_killed_and_interrupted_runs() {
    let c = flex();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "3"]);
    let free = c.read("m.toml").replace("\"base.*\", \"panel_*.k[*]\", \"panel_*.d[*]\"", "\"base.*\", \"panel_*\"");
    c.write("m.toml", &free);
    let start = || {
        let program = assert_cmd::cargo::cargo_bin("ffid");
        let mut p = std::process::Command::new(program);
        p.args(["identify", "m.toml", "--record", "rec.csv", "--out", "res", "--force", "--quiet"]);
        p.current_dir(c.folder()).stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null());
        p.spawn().unwrap()
    };
    for k in 0..12 {
        let mut run = start();
        std::thread::sleep(std::time::Duration::from_millis(40 + 90 * k));
        let _ = run.kill();
        run.wait().unwrap();
        for name in ["res", "res.bak"] {
            if c.path(name).exists() {
                ffid::files::complete::check(&c.path(name), "identify").unwrap();
            }
        }
    }
    let mut run = start();
    std::thread::sleep(std::time::Duration::from_millis(150));
    let pid = run.id().to_string();
    assert!(std::process::Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let code = run.wait().unwrap().code();
    // A machine that is quick, or one that is slow to start, may be done or not yet listening.
    assert!(matches!(code, Some(130 | 0) | None), "{code:?}");
    if code == Some(130) {
        assert!(!c.path("res").exists() || ffid::files::complete::check(&c.path("res"), "identify").is_ok());
        assert!(
            !fs::read_dir(c.folder())
                .unwrap()
                .any(|e| { e.unwrap().file_name().into_string().unwrap().ends_with(&format!("partial-{pid}")) })
        );
    }
    // Killed while it computes, a run leaves its partial folder; one beside it is of a process that lives.
    let mut run = start();
    let left = format!("res.partial-{}", run.id());
    while !c.path(&left).exists() && run.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    run.kill().unwrap();
    run.wait().unwrap();
    let alive = format!("res.partial-{}", std::process::id());
    [&left, &alive].iter().for_each(|name| fs::create_dir_all(c.path(name)).unwrap());
    let (code, _, err) = c.run(&["identify", "m.toml", "--record", "rec.csv", "--out", "res", "--force", "--quiet"]);
    assert_eq!(code, 0, "{err}");
    assert!(err.contains("warning[Io::LeftBehind]") && err.contains(&left) && !err.contains(&alive), "{err}");
    assert!(!c.path(&left).exists() && c.path(&alive).exists());
    ffid::files::complete::check(&c.path("res"), "identify").unwrap();
    fs::remove_dir(c.path(&alive)).unwrap();
    // The lock of a killed run is gone with the run that took it over.
    c.clean();
}

/// The laws of mechanics on a user's own model, and completions.
#[test]
fn selfcheck_and_completions() {
    let c = slosh();
    let out = c.good(&["selfcheck", "m.toml"]);
    for law in ["momentum", "energy", "dissipation", "order of the integrator"] {
        assert!(out.lines().any(|l| l.contains(law) && l.contains("holds")), "{law} in {out}");
    }
    let (code, out, _) = c.run(&["selfcheck", "robot.urdf", "--json"]);
    let v: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, v["selfcheck"]["laws"].as_array().unwrap().len()), (0, 4));
    for shell in ["bash", "zsh", "fish"] {
        assert!(c.good(&["completions", shell]).contains("identify"), "{shell}");
    }
    assert_eq!(c.run(&["completions", "csh"]).0, 2);
}

/// Stiffness and damping 40 % low and the base mass 30 % high: straight over the record of 30 s the limit of 100 linearisations was met at
/// 200 times the noise (exit code 14). The beginning of the record shows the way, which is kept whether or not a pass got to its end.
#[test]
#[ignore = "full tier: 8 s"]
fn a_start_forty_percent_off_ends_at_the_answer() {
    let wrong = "\"base.mass\" = 780.0\n\"panel_left.k[0]\" = 120.0\n\"panel_left.k[1]\" = 120.0\n\"panel_right.k[0]\" = 120.0\n\
                 \"panel_right.k[1]\" = 120.0\n\"panel_left.d[0]\" = 1.2\n\"panel_left.d[1]\" = 1.2\n\"panel_right.d[0]\" = 1.2\n\
                 \"panel_right.d[1]\" = 1.2";
    let c = Case::new("flex.toml", "parameters = [\"base.*\", \"panel_*.k[*]\", \"panel_*.d[*]\"]", wrong);
    c.write("a.csv", &trajectory(30.0, 0.2));
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    c.good(&["identify", "m.toml", "--record", "rec.csv", "--out", "res"]);
    let r = near_the_truth(&c, "res", 4.5);
    assert!((r.chi2_per_dof - 1.0).abs() < 0.03, "{}", r.chi2_per_dof);
}

/// Panels of which all is unknown, with a prior: second moments that the record does not tell press against what is physical. That is an
/// end, not a want of iterations (exit code 14 after 174 linearisations).
#[test]
#[ignore = "full tier: 3 s"]
fn a_fit_that_presses_against_the_edge_of_what_is_physical_ends() {
    let wrong =
        "\"base.mass\" = 780.0\n\"panel_left.k[0]\" = 120.0\n\"panel_right.k[1]\" = 120.0\n\"panel_left.d[0]\" = 1.2";
    let c = Case::new("flex.toml", "parameters = [\"base.*\", \"panel_*\"]\nprior_relative_std = 0.3", wrong);
    c.write("a.csv", &trajectory(60.0, 0.2));
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    c.good(&["identify", "m.toml", "--record", "rec.csv", "--out", "res"]);
    let r = c.result("res");
    assert!(r.status.is_solution() && r.chi2_per_dof < 1.03, "{:?} {}", r.status, r.chi2_per_dof);
}

#[test]
fn a_simulation_longer_than_a_record_may_be_is_refused() {
    let c = slosh();
    let long = ["simulate", "truth.toml", "--trajectory", "a.csv", "--out", "x.csv", "--hold", "1e30"];
    c.refused(&long, 11, "Config::OutOfRange", &["--hold", "samples"]);
    assert!(!c.path("x.csv").exists());
}
