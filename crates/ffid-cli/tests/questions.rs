//! What may be asked of `ffid identify` beside the fit: several records, fewer unknowns, profiles, ties, earlier knowledge.

use crate::case::{flex, near_the_truth, slosh};
use ff_mission::Leniency;
use ffid::files::folder::Entry;
use ffid::open::open;
use ffid::workflow::identify::IdentificationResult;
use std::fs;

#[test]
#[ignore = "full tier: 3 s"]
fn several_records_share_the_parameters_and_keep_their_biases() {
    let c = slosh();
    // Each record has biases of its own.
    for (seed, bias, trajectory, out) in [("4", "0.3", "a.csv", "r1.csv"), ("5", "-0.2", "b.csv", "r2.csv")] {
        let biased =
            c.read("truth.toml").replace("noise_std_nm = 0.1", &format!("bias_nm = {bias}\nnoise_std_nm = 0.1"));
        c.write("biased.toml", &biased);
        c.simulate("biased.toml", trajectory, out, &["--seed", seed]);
    }
    c.good(&["identify", "m.toml", "--record", "r1.csv", "--out", "one"]);
    let out = c.good(&["identify", "m.toml", "--records", "r1.csv", "r2.csv", "--out", "both"]);
    assert!(out.contains("record r1:") && out.contains("record r2:"), "{out}");
    let (one, both) = (c.result("one"), near_the_truth(&c, "both", 4.5));
    assert!((both.chi2_per_dof - 1.0).abs() < 0.03, "{}", both.chi2_per_dof);
    // 7 torque and 3 gyro biases of each.
    assert_eq!((both.nuisance.len(), both.records.len(), both.provenance.inputs.len()), (20, 2, 4));
    for (label, truth) in [("r1", 0.3), ("r2", -0.2)] {
        let b = both.nuisance.iter().find(|p| p.name.starts_with(label) && p.name.contains("joint3")).unwrap();
        assert!((b.value - truth).abs() < 5.0 * b.std.unwrap(), "{}: {}", b.name, b.value);
    }
    assert!(both.records.iter().all(|r| (r.mean_square - 1.0).abs() < 0.05 && r.channels.len() == 10));
    for (p, q) in one.parameters.iter().zip(&both.parameters) {
        assert!(q.std.unwrap() < p.std.unwrap(), "{}", p.name);
    }
    assert!(c.path("both/residuals-r2.csv").exists() && c.path("both/signals-r2.svg").exists());
    // One record twice is one record.
    fs::copy(c.path("r1.csv"), c.path("copy.csv")).unwrap();
    let twice = ["identify", "m.toml", "--records", "r1.csv", "copy.csv", "--out", "x"];
    c.refused(&twice, 12, "Data::SameData", &["copy.csv", "r1.csv"]);
    c.clean();
}

#[test]
#[ignore = "full tier: 3 s"]
fn d27_the_set_that_can_be_told_is_estimated_when_asked_for() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--noise-free"]);
    // Base and pendulum with all their parameters: by structure some combinations move nothing.
    let all = c.read("m.toml").replace("\"tank.k[*]\", \"tank.d[*]\"", "\"tank.*\", \"link1.*\"");
    assert_ne!(all, c.read("m.toml"));
    c.write("all.toml", &all);
    let args = ["identify", "all.toml", "--record", "rec.csv", "--out", "res", "--force"];
    c.refused(&args, 13, "Fit::Unidentifiable", &["--reduce"]);
    let (code, out, err) = c.run(&[&args[..], &["--reduce"]].concat());
    assert_eq!(code, 0, "{out}\n{err}");
    assert!(err.contains("warning[Fit::Unidentifiable]") && out.contains("held: "), "{out}\n{err}");
    let r = c.result("res");
    let (set, silent) = (r.reduced.as_ref().unwrap(), r.silent.as_ref().unwrap());
    assert!(!silent.structural.is_empty(), "{silent:?}");
    let null = silent.structural.len() + silent.unexcited.len();
    assert_eq!((set.held.len(), r.null_directions.len()), (null, null));
    // Everything that is left is determined, and stands for what is held.
    assert!(r.parameters.iter().all(|p| p.std.is_some()));
    assert!(set.combinations.iter().any(|s| s.terms.iter().any(|t| set.held.contains(&t.0))), "{set:?}");
    assert!(set.held.iter().all(|h| r.parameters.iter().all(|p| p.name != *h)));
    assert!(r.chi2_per_dof < 1e-3, "{}", r.chi2_per_dof);
}

/// What `--reduce` holds stands where the mission has it, and is listed with its value: the mass of a wing that only combinations with
/// the base tell is not one that the fit drifted to.
#[test]
fn what_is_held_stands_where_the_mission_has_it() {
    let c = flex();
    let all = "parameters = [\"base.*\", \"panel_*.k[*]\", \"panel_*.d[*]\", \"panel_*.seg[*].mass\", \"panel_*.seg[*].h_y\"]";
    let from = "parameters = [\"base.*\", \"panel_*.k[*]\", \"panel_*.d[*]\"]\nprior_relative_std = 0.3";
    let mission = c.read("m.toml").replace(from, all);
    assert_ne!(mission, c.read("m.toml"));
    c.write("all.toml", &mission);
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let (code, out, err) = c.run(&["identify", "all.toml", "--record", "rec.csv", "--out", "res", "--reduce"]);
    assert_eq!(code, 0, "{out}\n{err}");
    let r = c.result("res");
    let set = r.reduced.as_ref().unwrap();
    let nominal = open(&c.path("all.toml"), Leniency::default()).unwrap().model.param_decls();
    assert!(!set.values.is_empty() && set.values.len() == set.held.len(), "{set:?}");
    for held in &set.values {
        let want = nominal.iter().find(|d| d.name == held.name).unwrap().nominal;
        let model = r.model.iter().find(|v| v.name == held.name).unwrap().value;
        assert_eq!((held.value, model), (want, want), "{}", held.name);
        assert!(out.contains(&format!("{} at ", held.name)), "{out}");
    }
    // The held values are true here, so that the others are what they stand for, and true as well.
    near_the_truth(&c, "res", 4.5);
}

/// A prior of 3 % on a base mass that is 20 % off: the verdict names it, with both values and deviations.
#[test]
#[ignore = "full tier: 2 s"]
fn a_prior_in_conflict_with_the_record_is_named() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let off = c.read("m.toml").replace("\"base.mass\" = 571.0", "\"base.mass\" = 720.0");
    c.write("off.toml", &off);
    let out = c.good(&["identify", "off.toml", "--record", "rec.csv", "--out", "res", "--prior", "0.03"]);
    let r = c.result("res");
    let conflict = r.prior_conflicts.iter().find(|p| p.name == "base.mass").unwrap_or_else(|| panic!("{out}"));
    assert_eq!((conflict.prior_mean, conflict.prior_std), (720.0, 0.03 * 720.0));
    assert!((conflict.data_value - 600.0).abs() < 5.0 * conflict.data_std, "{conflict:?}");
    assert!(r.verdict.iter().any(|v| v.contains("in conflict with the record")), "{:?}", r.verdict);
    // Priors that are right are not.
    c.good(&["identify", "truth.toml", "--record", "rec.csv", "--out", "right", "--prior", "0.03"]);
    assert_eq!(c.result("right").prior_conflicts, []);
}

/// Torque samples that are wrong by 30 times their noise: squares follow them, Huber's loss does not.
#[test]
#[ignore = "full tier: 7 s"]
fn a_robust_loss_is_a_flag() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let record = c.read("rec.csv");
    let header: Vec<&str> = record.lines().next().unwrap().split(',').collect();
    let column = header.iter().position(|h| h.starts_with("tau.joint2")).unwrap();
    let wrong = |(k, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if k > 0 && k % 23 == 0 {
            cells[column] = (cells[column].parse::<f64>().unwrap() + 3.0).to_string();
        }
        cells.join(",")
    };
    let spoilt: Vec<String> = record.lines().enumerate().map(wrong).collect();
    c.write("spoilt.csv", &(spoilt.join("\n") + "\n"));
    let miss = |out: &str, more: &[&str]| {
        let args = ["identify", "m.toml", "--record", "spoilt.csv", "--clocks", "trust", "--out", out];
        let (code, text, err) = c.run(&[&args[..], more].concat());
        // Outliers contradict white noise of the size that was given.
        assert!([0, 16].contains(&code), "{code} {text}\n{err}");
        let r = c.result(out);
        let bias = r.nuisance.iter().find(|p| p.name == "torque.bias.joint2").unwrap().value;
        (bias.abs(), r.provenance.settings.get("loss").cloned())
    };
    let (squares, huber) = (miss("squares", &[]), miss("huber", &["--loss", "huber"]));
    assert!(squares.0 > 0.1 && huber.0 < 0.2 * squares.0, "{squares:?} {huber:?}");
    assert!(squares.1.is_none() && huber.1.is_some_and(|l| l.contains("huber")));
}

#[test]
#[ignore = "full tier: 2 s"]
fn a_profile_of_a_parameter_agrees_with_its_interval_where_the_cost_is_a_parabola() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "9"]);
    let args = ["identify", "m.toml", "--record", "rec.csv", "--out", "res", "--profile", "tank.k[1],base.mass"];
    let out = c.good(&args);
    assert!(out.contains("profile likelihood"), "{out}");
    let r = c.result("res");
    assert_eq!(r.profiles.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["base.mass", "tank.k[1]"]);
    for p in &r.profiles {
        let (a, b) = p.gaussian95.unwrap();
        let (width, lo, hi) = (b - a, p.lower95.unwrap(), p.upper95.unwrap());
        assert!((lo - a).abs() < 0.1 * width && (hi - b).abs() < 0.1 * width, "{p:?}");
        assert!(p.points.len() > 6 && p.points.iter().all(|x| x.1 > -1e-3), "{p:?}");
    }
    let wrong = ["identify", "m.toml", "--record", "rec.csv", "--out", "x", "--profile", "tank.l[1]"];
    c.refused(&wrong, 11, "Config::UnknownParameter", &["tank.l[1]", "did you mean", "base.mass"]);
    // Before anything is fitted.
    assert!(!c.path("x/result.json").exists());
}

#[test]
#[ignore = "full tier: 3 s"]
fn what_one_identification_has_learnt_the_next_one_knows() {
    let c = slosh();
    c.simulate("truth.toml", "a.csv", "r1.csv", &["--seed", "4"]);
    c.simulate("truth.toml", "b.csv", "r2.csv", &["--seed", "5"]);
    c.good(&["identify", "m.toml", "--record", "r1.csv", "--out", "first"]);
    c.good(&["identify", "m.toml", "--record", "r2.csv", "--prior-from", "first", "--out", "second"]);
    c.good(&["identify", "m.toml", "--records", "r1.csv", "r2.csv", "--out", "both"]);
    let (first, second, both) = (c.result("first"), near_the_truth(&c, "second", 4.5), c.result("both"));
    // In sequence as at once: the records of the first are fitted again.
    let alike = |a: &IdentificationResult, b: &IdentificationResult, of_value: f64, of_std: f64| {
        for ((a, b), f) in a.parameters.iter().zip(&b.parameters).zip(&first.parameters) {
            assert!((a.value - b.value).abs() < of_value * b.std.unwrap(), "{}: {} and {}", a.name, a.value, b.value);
            assert!((a.std.unwrap() / b.std.unwrap() - 1.0).abs() < of_std, "{}", a.name);
            assert!((a.prior_mean.unwrap() / f.value - 1.0).abs() < 1e-9, "{}", a.name);
            assert!((a.prior_std.unwrap() / f.std.unwrap() - 1.0).abs() < 1e-6, "{}", a.name);
        }
    };
    alike(&second, &both, 0.02, 1e-4);
    let kept: Vec<_> = second.kept_records.iter().map(|k| (k.label.as_str(), k.file.as_str())).collect();
    assert_eq!(kept, [("r2", "record-1.parquet"), ("r1", "record-2.parquet")]);
    // A third one knows what the first has fitted.
    let again = ["identify", "m.toml", "--record", "r1.csv", "--prior-from", "second", "--out", "x"];
    c.refused(&again, 12, "Data::SameData", &["r1.csv"]);
    // A result without records leaves its parabola, and says so: as far as the model is linear between the two.
    let result = c.path("first/result.json");
    let before = Entry::of(result.as_ref(), "").unwrap();
    let mut bare: serde_json::Value = serde_json::from_str(&c.read("first/result.json")).unwrap();
    bare.as_object_mut().unwrap().remove("kept_records");
    c.write("first/result.json", &bare.to_string());
    let after = Entry::of(result.as_ref(), "").unwrap();
    let size = |e: &Entry| format!("bytes = {}", e.bytes);
    let manifest = c.read("first/manifest.toml").replace(&before.sha256, &after.sha256);
    c.write("first/manifest.toml", &manifest.replace(&size(&before), &size(&after)));
    let args = ["identify", "m.toml", "--record", "r2.csv", "--prior-from", "first", "--out", "third"];
    let (code, _, said) = c.run(&args);
    assert!(code == 0 && said.contains("warning[Data::NoRecords]"), "{code} {said}");
    alike(&c.result("third"), &both, 0.1, 0.02);
    // The same record must not count twice; a folder that was touched is refused.
    let again = ["identify", "m.toml", "--record", "r1.csv", "--prior-from", "first", "--out", "x"];
    c.refused(&again, 12, "Data::SameData", &["r1.csv", "--records"]);
    c.write("first/report.txt", "better");
    let args = ["identify", "m.toml", "--record", "r2.csv", "--prior-from", "first", "--out", "x"];
    c.refused(&args, 12, "Data::Changed", &["report.txt"]);
}

#[test]
#[ignore = "full tier: 2 s"]
fn tied_parameters_are_fewer_unknowns() {
    let c = flex();
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "3"]);
    // All hinges are alike in the paper.
    c.write(
        "ties.toml",
        "[[tie]]\nname = \"hinge.k\"\nparameters = [\"panel_*.k[*]\"]\n\n[[tie]]\nname = \"hinge.d\"\nslope = { \"panel_left.d[0]\" = 2.0, \
         \"panel_left.d[1]\" = 2.0, \"panel_right.d[0]\" = 2.0, \"panel_right.d[1]\" = 2.0 }\nstart = 0.5\n",
    );
    let args = ["identify", "m.toml", "--record", "rec.csv", "--no-prior", "--ties", "ties.toml", "--out", "res"];
    let out = c.good(&args);
    assert!(out.contains("hinge.k"), "{out}");
    let r = c.result("res");
    assert_eq!(r.parameters.len(), 12);
    let value = |n: &str| r.model.iter().find(|v| v.name == n).unwrap().value;
    let k = r.parameters.iter().find(|p| p.name == "hinge.k").unwrap();
    let truth: Vec<f64> = {
        let t = ffid::open::open(&c.path("truth.toml"), Default::default()).unwrap().model.param_decls();
        ["panel_left.k[0]", "panel_left.d[0]"]
            .iter()
            .map(|n| t.iter().find(|d| d.name == *n).unwrap().nominal)
            .collect()
    };
    assert!((k.value - truth[0]).abs() < 4.5 * k.std.unwrap(), "{} +- {:?}", k.value, k.std);
    for n in ["panel_left.k[0]", "panel_left.k[1]", "panel_right.k[0]", "panel_right.k[1]"] {
        assert_eq!(value(n), k.value, "{n}");
    }
    let d = r.parameters.iter().find(|p| p.name == "hinge.d").unwrap();
    assert!((value("panel_right.d[1]") - (truth[1] + 2.0 * (d.value - 0.5))).abs() < 1e-9);
    // The identified robot is that with the ties applied, bit for bit.
    let again = ffid::open::open(&c.path("res/identified.toml"), Default::default()).unwrap().model;
    assert!(again.param_decls().iter().zip(&r.model).all(|(d, v)| d.nominal.to_bits() == v.value.to_bits()));
    for (text, says) in [
        ("[[tie]]\nname = \"a\"\n", "exactly one"),
        ("[[tie]]\nname = \"a\"\nparametres = [\"x\"]\n", "parametres"),
        ("[[tie]]\nname = \"a\"\nparameters = [\"nothing.*\"]\n", "nothing.*"),
        ("[[tie]]\nname = \"a\"\nparameters = [\"base.mass\", \"panel_left.k[0]\"]\n", "different units"),
        ("[[tie]]\nname = \"a\"\nparameters = [\"base.mass\"]\nstart = 2.0\n", "start belongs to slope"),
        ("[[tie]]\nname = \"base.mass\"\nparameters = [\"panel_*.k[0]\"]\n", "is the name of a parameter"),
    ] {
        c.write("bad.toml", text);
        c.refused(
            &["identify", "m.toml", "--record", "rec.csv", "--ties", "bad.toml", "--out", "x"],
            11,
            "Config::Ties",
            &[says],
        );
    }
}

#[test]
fn d33_starts_that_agree_are_counted() {
    let c = slosh();
    c.simulate("truth.toml", "b.csv", "rec.csv", &["--seed", "6"]);
    let out = c.good(&["identify", "m.toml", "--record", "rec.csv", "--starts", "3", "--out", "res"]);
    assert!(out.contains("starts: 3 of 3 converged"), "{out}");
    let m = near_the_truth(&c, "res", 4.5).minima.unwrap();
    assert_eq!((m.starts, m.converged, m.objectives.len()), (3, 3, 1));
}
