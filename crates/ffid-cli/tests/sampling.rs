//! `ffid identify --sample`: draws from the posterior, their file, and what the result says of them.

use crate::case::{Case, trajectory};
use crate::json_schema::check;
use ffid::workflow::identify::SampledState;

fn case() -> Case {
    let cad = "\"tank.k[0]\" = 24.5\n\"tank.k[1]\" = 16.5\n\"tank.d[0]\" = 4.1";
    let c = Case::new("slosh.toml", "parameters = [\"tank.k[*]\", \"tank.d[*]\"]", cad);
    c.write("short.csv", &trajectory(8.0, 0.2));
    c.simulate("truth.toml", "short.csv", "rec.csv", &[]);
    c
}

#[test]
#[ignore = "full tier: 20 s"]
fn draws_are_written_and_judged() {
    let c = case();
    let args = ["identify", "m.toml", "--record", "rec.csv", "--out", "r", "--sample", "--seed", "3"];
    let said = c.good(&args);
    let r = c.result("r");
    let s = r.sampled.clone().unwrap();
    assert_eq!((s.state, s.chains, s.draws, s.seed), (SampledState::Converged, 4, 400, 3), "{}", s.reason);
    assert!(s.r_hat.unwrap() < 1.01 && s.ess_bulk.unwrap().min(s.ess_tail.unwrap()) >= 400.0);
    assert_eq!(s.parameters.len(), r.parameters.len());
    assert_eq!(s.beside.len(), r.nuisance.len());
    for (l, p) in s.parameters.iter().zip(&r.parameters) {
        let ((a, b), (lo, hi)) = (l.interval95.unwrap(), l.hdi95.unwrap());
        assert_eq!(l.name, p.name);
        assert!(a < l.median.unwrap() && l.median.unwrap() < b && hi - lo <= 1.001 * (b - a));
        // All are positive, and so are all draws.
        assert!(a > 0.0 && (l.mean.unwrap() - p.value).abs() < 2.0 * p.std.unwrap(), "{l:?}");
    }
    assert!(r.verdict.iter().any(|v| v.contains("draws")) && said.contains("draws from the posterior"));
    assert!(c.path("r/corner.svg").exists() && c.read("r/report.html").contains("Draws from the posterior"));
    let bytes = std::fs::read(c.path("r/draws.parquet")).unwrap();
    assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
    let text = String::from_utf8_lossy(&bytes).into_owned();
    for name in ["chain", "draw", "lp", "tank.k[0]", "unit.tank.k[0]"] {
        assert!(text.contains(name), "{name}");
    }
    let json = serde_json::from_str(&c.read("r/result.json")).unwrap();
    check(&ffid::schema::result(), &json, "result").unwrap();
}

/// Too few draws: a warning, no intervals, and the fit as without.
#[test]
#[ignore = "full tier: 10 s"]
fn draws_that_have_not_converged_give_no_intervals() {
    let c = case();
    let said = c.good(&["identify", "m.toml", "--record", "rec.csv", "--out", "r", "--sample", "20"]);
    let r = c.result("r");
    let s = r.sampled.unwrap();
    // Where the first stage does not converge, the second draws twice as many.
    assert_eq!((s.state, s.draws), (SampledState::NotConverged, 40), "{}", s.reason);
    assert!(s.parameters.iter().all(|l| l.interval95.is_none() && l.hdi95.is_none() && l.mean.is_none()));
    assert!(s.parameters.iter().all(|l| l.r_hat.is_some()) && c.path("r/draws.parquet").exists());
    assert!(r.warnings.iter().any(|w| w.code == "Fit::NotSampled"), "{said}");
    assert!(r.parameters.iter().all(|p| p.interval95.is_some()));
}
