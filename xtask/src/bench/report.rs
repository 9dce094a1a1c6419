//! What was measured: tables for the terminal and the JSON file.

use super::aggregate::Spread;
use super::build::Target;
use super::cell::Cell;
use super::limits::Limit;
use super::run::Pin;
use super::tasks::Tasks;
use crate::table::{Table, sig};
use ffid::exit::Failure;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// One result in the JSON file.
#[derive(Serialize)]
struct Entry<'a> {
    model: &'a str,
    r#fn: &'a str,
    config: String,
    median_ns: f64,
    peer_ns: Option<f64>,
    ratio: Option<f64>,
}

#[derive(Serialize)]
struct File<'a> {
    results: Vec<Entry<'a>>,
    limits: &'a BTreeMap<String, Limit>,
}

/// `{"results": [...], "limits": {...}}`; times of whole tasks are in ns as well.
///
/// # Errors
/// [`Failure::Io`] if the format fails.
pub fn json(cells: &[Cell], tasks: &Tasks, limits: &BTreeMap<String, Limit>) -> Result<Vec<u8>, Failure> {
    let config = |form: &str, t: Target| if t == Target::Portable { form.into() } else { format!("{form} native") };
    let micro = cells.iter().map(|c| Entry {
        model: &c.model,
        r#fn: &c.function,
        config: config(&c.form, c.target),
        median_ns: c.ours.median,
        peer_ns: c.pinocchio.map(|p| p.median),
        ratio: c.ratio(),
    });
    let simulations = tasks.simulations.iter().map(|s| Entry {
        model: s.model,
        r#fn: "simulate_60s",
        config: config(s.via, s.target),
        median_ns: 1e9 * s.ours.median,
        peer_ns: s.peer.map(|p| 1e9 * p.1.median),
        ratio: s.peer.map(|p| s.ours.median / p.1.median),
    });
    // Their peer is our own plain simulation.
    let sensitivities = tasks.sensitivities.iter().map(|s| Entry {
        model: "flex",
        r#fn: "sensitivities58",
        config: config("reduced", s.target),
        median_ns: 1e9 * s.exact.median,
        peer_ns: Some(1e9 * s.plain.median),
        ratio: Some(s.exact.median / s.plain.median),
    });
    let fits = tasks.fits.iter().map(|f| Entry {
        model: if f.name == "least_squares" { "rigid" } else { "flex" },
        r#fn: f.name,
        config: config("fit", f.target),
        median_ns: 1e9 * f.ours.median,
        peer_ns: f.peer.map(|p| 1e9 * p.1),
        ratio: f.peer.map(|p| f.ours.median / p.1),
    });
    let file = File { results: micro.chain(simulations).chain(sensitivities).chain(fits).collect(), limits };
    let mut bytes =
        serde_json::to_vec_pretty(&file).map_err(|e| Failure::io("format", Path::new("the JSON file"), e.into()))?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// The tables.
pub fn text(cells: &[Cell], tasks: &Tasks, limits: &BTreeMap<String, Limit>, with_peers: bool, pin: &Pin) -> String {
    let mut out = String::new();
    if !cells.is_empty() {
        out += &format!("{}\n", micro(cells, pin));
    }
    if !tasks.simulations.is_empty() {
        out += &format!("{}\n", simulations(tasks));
    }
    if !tasks.sensitivities.is_empty() {
        out += &format!("{}\n", sensitivities(tasks));
    }
    if !tasks.fits.is_empty() {
        out += &format!("{}\n", fits(tasks));
    }
    out += &verdict(limits, with_peers).to_string();
    out
}

fn micro(cells: &[Cell], pin: &Pin) -> Table {
    let head = ["model.function", "form", "build", "ns", "min..max", "Pinocchio", "min..max", "ratio", "MuJoCo"];
    let mut t = Table::new(format!("Nanoseconds per state, {}", pin.text()), &head);
    let mut last = None;
    for c in cells {
        let group = (&c.model, &c.form, c.target);
        if last.is_some_and(|l| l != group) {
            t.rule();
        }
        last = Some(group);
        let (pin, pin_range) = c.pinocchio.map_or((dash(), dash()), |p| (ns(p.median), range(&p)));
        t.row([
            format!("{}.{}", c.model, c.function),
            c.form.clone(),
            c.target.text().into(),
            ns(c.ours.median),
            range(&c.ours),
            pin,
            pin_range,
            c.ratio().map_or(dash(), |r| format!("{r:.3}")),
            c.mujoco.map_or(dash(), |m| ns(m.median)),
        ]);
    }
    t.note(
        "Medians over interleaved rounds; min and max of any repetition. Pinocchio: clang -O3 -march=native -DNDEBUG,",
    );
    t.note("the fastest of its variants. `ports` has springs and dampers, `tree` has the passive bodies as joints.");
    t
}

fn simulations(tasks: &Tasks) -> Table {
    let head = ["60 s at 1 ms, RK4", "build", "s", "min..max", "best peer", "s", "ratio", "differs by", "error 10 ms"];
    let mut t = Table::new("A minute of the manoeuvre", &head);
    for s in &tasks.simulations {
        t.row([
            format!("{}.{}", s.model, s.via),
            s.target.text().into(),
            sig(s.ours.median, 3),
            format!("{}..{}", sig(s.ours.min, 3), sig(s.ours.max, 3)),
            s.peer.map_or(dash(), |p| p.0.into()),
            s.peer.map_or(dash(), |p| sig(p.1.median, 3)),
            s.peer.map_or(dash(), |p| format!("{:.3}", s.ours.median / p.1.median)),
            s.agreement.map_or(dash(), |a| format!("{a:.0e}")),
            s.error.1.map_or(format!("{:.1e}", s.error.0), |p| format!("{:.1e} ({p:.1e})", s.error.0)),
        ]);
    }
    t.note(
        "`full` integrates what the peers do, `full.x8` for eight parameter sets at once (per trajectory); `reduced`",
    );
    t.note("leaves position and attitude out, as identification does.");
    t.note("Differs by: end state against Pinocchio's. Error: end state at a step of 10 ms; the peer's in brackets.");
    t
}

fn sensitivities(tasks: &Tasks) -> Table {
    let head = ["flexible model, 60 s at 10 ms", "build", "plain (s)", "with (s)", "ratio"];
    let mut t = Table::new("Sensitivities of the record", &head);
    for s in &tasks.sensitivities {
        t.row([
            format!("{} parameters", s.parameters),
            s.target.text().into(),
            sig(s.plain.median, 3),
            sig(s.exact.median, 3),
            format!("{:.2}", s.exact.median / s.plain.median),
        ]);
    }
    t
}

fn fits(tasks: &Tasks) -> Table {
    let head = ["fit", "build", "s", "min..max", "peer", "s", "ratio"];
    let mut t = Table::new("Identification", &head);
    for f in &tasks.fits {
        t.row([
            f.name.into(),
            f.target.text().into(),
            sig(f.ours.median, 3),
            format!("{}..{}", sig(f.ours.min, 3), sig(f.ours.max, 3)),
            f.peer.map_or(dash(), |p| p.0.into()),
            f.peer.map_or(dash(), |p| sig(p.1, 3)),
            f.peer.map_or(dash(), |p| format!("{:.4}", f.ours.median / p.1)),
        ]);
    }
    t.note("identify15: the problem of pin_id.cpp, 30 s at 100 Hz. identify58: base and panels under a prior, 60 s.");
    t.note("identify58_uncertain: the same beside 40 errors of sensors, link masses and placements.");
    t.note("least_squares: 10,000 free-flying instants, 130000 x 80, 59 base parameters.");
    t
}

fn verdict(limits: &BTreeMap<String, Limit>, with_peers: bool) -> Table {
    let mut t = Table::new(
        "Limits of issues 3 and 6: the portable build and the ports form count",
        &["", "ratio", "limit", ""],
    );
    for (name, l) in limits {
        let word = match l.pass {
            Some(true) => "reached",
            Some(false) if l.ratio.is_none() => "not measured",
            Some(false) => "MISSED",
            None => "no peer",
        };
        t.row([name.clone(), l.ratio.map_or(dash(), |r| format!("{r:.3}")), sig(l.limit, 3), word.into()]);
    }
    let reached = limits.values().filter(|l| l.pass == Some(true)).count();
    t.note(format!("{reached} of {} reached.", limits.len()));
    if !with_peers {
        t.note("Ratios to the peers need --peers DIR, the folder of run_peers.sh.");
    }
    t
}

fn ns(x: f64) -> String {
    if x < 100.0 { format!("{x:.1}") } else { format!("{x:.0}") }
}

fn range(s: &Spread) -> String {
    format!("{}..{}", ns(s.min), ns(s.max))
}

fn dash() -> String {
    "-".into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::limits;
    use serde_json::Value;

    fn cell(pinocchio: Option<f64>) -> Cell {
        let spread = |x: f64| Spread { median: x, min: 0.9 * x, max: 1.3 * x };
        let (model, function, form) = ("flex".into(), "rnea".into(), "ports".into());
        let target = Target::Native;
        Cell { model, function, form, target, ours: spread(410.5), pinocchio: pinocchio.map(spread), mujoco: None }
    }

    #[test]
    fn the_file_has_exactly_the_agreed_fields() {
        let cells = [cell(Some(821.0))];
        let limits = limits::evaluate(&cells, &Tasks::default(), true);
        let v: Value = serde_json::from_slice(&json(&cells, &Tasks::default(), &limits).unwrap()).unwrap();
        let keys = |v: &Value| v.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys(&v), ["limits", "results"]);
        assert_eq!(keys(&v["results"][0]), ["config", "fn", "median_ns", "model", "peer_ns", "ratio"]);
        assert_eq!(v["results"][0]["config"], "ports native");
        assert_eq!(v["results"][0]["ratio"].as_f64(), Some(0.5));
        assert_eq!(keys(&v["limits"]["flex.rnea.batched"]), ["limit", "pass", "ratio"]);
    }

    #[test]
    fn without_peers_ratios_are_null_and_the_table_says_why() {
        let cells = [cell(None)];
        let limits = limits::evaluate(&cells, &Tasks::default(), false);
        let v: Value = serde_json::from_slice(&json(&cells, &Tasks::default(), &limits).unwrap()).unwrap();
        assert!(v["results"][0]["ratio"].is_null() && v["results"][0]["peer_ns"].is_null());
        assert!(v["limits"]["flex.rnea"]["pass"].is_null());
        let text = text(&cells, &Tasks::default(), &limits, false, &Pin::none());
        assert!(text.contains("flex.rnea") && text.contains("--peers DIR"), "{text}");
    }
}
