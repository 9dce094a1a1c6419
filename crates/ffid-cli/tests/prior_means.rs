//! An identified mission keeps what its deviations are about, so that no record counts twice.

use crate::case::{Case, trajectory};
use ffid::workflow::identify::IdentificationResult;

/// Distances of the estimates of two results, in standard deviations of the first; the farthest.
fn apart(a: &IdentificationResult, b: &IdentificationResult) -> f64 {
    let off = |(p, q): (&ffid::workflow::identify::Parameter, &ffid::workflow::identify::Parameter)| {
        (p.value - q.value).abs() / p.std.unwrap()
    };
    a.parameters.iter().zip(&b.parameters).map(off).fold(0.0, f64::max)
}

/// From `identified.toml` a record tells what it told: the estimates are a start, and the prior is that of the mission. With the prior about the
/// estimates, the same record would count twice.
#[test]
fn a_record_that_is_identified_again_counts_once() {
    let cad = "\"base.mass\" = 603.0\n\"tank.k[0]\" = 20.6";
    let c = Case::new("slosh.toml", "parameters = [\"base.*\", \"tank.k[*]\", \"tank.d[*]\"]", cad);
    c.write("a.csv", &trajectory(8.0, 0.2));
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let unsure = "\n[[uncertain]]\nparameters = [\"tank.k[0]\"]\nrelative_std = 0.01\n\n\
                  [[uncertain]]\nbodies = [\"link*\"]\nmass_relative_std = 0.02\n";
    let text = c.read("m.toml");
    let at = text.find("[estimate]").unwrap();
    c.write("m.toml", &format!("{}{unsure}\n{}", &text[..at], &text[at..]));
    let identify = |mission: &str, out: &str| {
        c.good(&["identify", mission, "--record", "rec.csv", "--out", out]);
        c.result(out)
    };
    let first = identify("m.toml", "first");
    let again = identify("first/identified.toml", "again");
    assert!(apart(&first, &again) < 0.02, "{}", apart(&first, &again));
    let written = c.read("first/identified.toml");
    assert!(written.contains("[prior_means]\n") && written.contains("\"tank.k[0]\" = 20.6\n"), "{written}");
    // It stays what it was, however often.
    let means = |text: &str| text[text.find("[prior_means]").unwrap()..].to_owned();
    assert_eq!(means(&c.read("again/identified.toml")), means(&written));
    let bare = written.split("[prior_means]").next().unwrap().to_owned();
    c.write("first/bare.toml", &bare);
    let twice = identify("first/bare.toml", "twice");
    assert!(apart(&first, &twice) > 0.1, "{}", apart(&first, &twice));
    // Other names are refused, as in [parameters].
    c.write("wrong.toml", &format!("{text}\n[prior_means]\n\"tank.kk\" = 1.0\n"));
    c.refused(&["check", "wrong.toml"], 11, "Config::NoSuchParameter", &["tank.kk"]);
}
