//! Nanoseconds per call, ours and the peers', in interleaved rounds.

use super::aggregate::Spread;
use super::build::Target;
use super::cell::{Cell, split_lanes};
use super::limits;
use super::models::MODELS;
use super::options::Effort;
use super::peers;
use super::programs::Programs;
use super::run;
use ffid::exit::Failure;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// `(program, model, function, form)`; the form is empty for peers.
type Key = (&'static str, String, String, String);

/// Median, min and max per round.
type Rounds = BTreeMap<Key, Vec<(f64, f64, f64)>>;

const PORTABLE: &str = "portable";
const NATIVE: &str = "native";
const PINOCCHIO: &str = "pinocchio";
const MUJOCO: &str = "mujoco";

/// Runs every program in every round, by turns.
///
/// # Errors
/// As [`run::lines`]; [`Failure::Numerical`] for a line without its figures.
pub fn measure(p: &Programs<'_>, states: &Path, effort: Effort, only: &str) -> Result<Vec<Cell>, Failure> {
    let names = MODELS.iter().flat_map(|m| limits::FUNCTIONS.iter().map(move |f| (m, f.name)));
    let named = names.flat_map(|(m, f)| ["ports", "tree"].map(|c| format!("{m}.{f}.{c}")));
    if !only.contains(".x") && !named.into_iter().any(|n| n.contains(only)) {
        return Ok(Vec::new());
    }
    let (text, reps) = (|p: &Path| p.display().to_string(), effort.reps.to_string());
    let ours = ["micro", "--states", &text(states), "--reps", &reps, "--only", only].map(str::to_owned);
    let mut all = Rounds::new();
    for round in 1..=effort.rounds {
        eprintln!("round {round} of {}", effort.rounds);
        for (name, program) in [(PORTABLE, p.portable), (NATIVE, p.native)] {
            collect(&mut all, name, &run::lines(p.root, program, &ours, &p.pin)?)?;
        }
        if let Some(peers) = p.peers {
            let pin = ["clang".to_owned(), text(states), reps.clone()];
            collect(&mut all, PINOCCHIO, &run::lines(p.root, &peers.pin_bench, &pin, &p.pin)?)?;
            let mj = ["C-API".to_owned(), text(states), text(&peers.model), reps.clone()];
            collect(&mut all, MUJOCO, &run::lines(p.root, &peers.mj_bench, &mj, &p.pin)?)?;
        }
    }
    Ok(cells(&all))
}

fn collect(all: &mut Rounds, program: &'static str, lines: &[Value]) -> Result<(), Failure> {
    // MuJoCo's program prints checks among its figures.
    for l in lines.iter().filter(|l| l.get("check").is_none()) {
        let text = |k: &str| l[k].as_str().map(str::to_owned);
        let number = |k: &str| l[k].as_f64().filter(|x| x.is_finite() && *x > 0.0);
        let entry = || {
            let form = if [PORTABLE, NATIVE].contains(&program) { text("config")? } else { String::new() };
            let key = (program, text("model")?, text("fn")?, form);
            Some((key, (number("median_ns")?, number("min_ns")?, number("max_ns")?)))
        };
        let (key, figures) =
            entry().ok_or_else(|| Failure::Numerical(format!("the {program} benchmark printed no figures in: {l}")))?;
        all.entry(key).or_default().push(figures);
    }
    Ok(())
}

fn cells(all: &Rounds) -> Vec<Cell> {
    let best = |program: &'static str, model: &str, names: &[&str]| {
        let of = |n: &&str| Spread::of(all.get(&(program, model.to_owned(), (*n).to_owned(), String::new()))?);
        names.iter().filter_map(of).min_by(|a, b| a.median.total_cmp(&b.median))
    };
    let ours = all.iter().filter(|((program, ..), _)| [PORTABLE, NATIVE].contains(program));
    let mut cells: Vec<Cell> = ours
        .filter_map(|((program, model, function, form), rounds)| {
            let plain = split_lanes(function).0;
            Some(Cell {
                model: model.clone(),
                function: function.clone(),
                form: form.clone(),
                target: if *program == PORTABLE { Target::Portable } else { Target::Native },
                ours: Spread::of(rounds)?,
                pinocchio: best(PINOCCHIO, model, peers::pinocchio(plain)),
                mujoco: best(MUJOCO, model, peers::mujoco(plain)),
            })
        })
        .collect();
    let place = |c: &Cell| {
        let model = MODELS.iter().position(|m| *m == c.model);
        let function = limits::FUNCTIONS.iter().position(|f| f.name == c.plain().0);
        (model, c.form.clone(), c.target == Target::Native, c.plain().1, function, c.function.clone())
    };
    cells.sort_by_key(place);
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn ours_meet_the_best_peer_of_the_same_model() {
        let line = |f: &str, m: &str, ns: f64| json!({"config": "ports", "model": m, "fn": f, "median_ns": ns, "min_ns": ns - 1.0, "max_ns": ns + 9.0});
        let mut all = Rounds::new();
        collect(&mut all, PORTABLE, &[line("fd.x8", "flex", 120.0), line("fd", "flex", 900.0)]).unwrap();
        collect(&mut all, PORTABLE, &[line("fd", "flex", 910.0), json!({"check": "rnea"})]).unwrap();
        let pin =
            [line("aba LOCAL", "flex", 1700.0), line("aba WORLD", "flex", 1800.0), line("aba LOCAL", "slosh", 9.0)];
        collect(&mut all, PINOCCHIO, &pin).unwrap();
        let cells = cells(&all);
        assert_eq!(cells.iter().map(|c| c.function.as_str()).collect::<Vec<_>>(), ["fd", "fd.x8"]);
        assert_eq!(cells[0].ours, Spread { median: 905.0, min: 899.0, max: 919.0 });
        assert_eq!(cells[0].ratio(), Some(905.0 / 1700.0));
        assert_eq!(cells[1].ratio(), Some(120.0 / 1700.0));
        assert!(collect(&mut all, NATIVE, &[json!({"config": "ports", "model": "flex", "fn": "rnea"})]).is_err());
    }
}
