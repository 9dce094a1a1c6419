//! `cargo xtask conformance`: the suite of `validate` over every kind of appendage and over every known-wrong one.
//!
//! Kinds come from [`ffid::default_registry`] with their example tables, so that a new kind appears by itself. With
//! `--systems N` random systems of mixed kinds move for ten seconds each and are held to momentum and energy.

use crate::table::{Table, sig};
use ff_model::{DynAppendage, Registry};
use ffid::exit::Failure;
use ffid::files::json;
use rayon::prelude::*;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;
use validate::ConformanceReport;
use validate::conformance::Check;
use validate::known_wrong::known_wrong;
use validate::systems::{SystemFigures, random_system};
use validate::{check_appendage_counting, check_kind};

/// Length of the motion of a random system (s).
const SECONDS: f64 = 10.0;
/// Greatest drift of momentum of a random system, relative.
const MOMENTUM: f64 = 1e-11;
/// Greatest error of its energy balance, relative.
const ENERGY: f64 = 1e-10;
/// Greatest difference of a bias and the derived one, relative.
const BIAS: f64 = 1e-12;

/// Arguments of `conformance`.
#[derive(Debug, Default, clap::Args)]
pub struct Args {
    /// Also write the results to this file as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Also run this many random systems of mixed kinds for 10 s each, on all cores (10000 take minutes)
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub systems: u64,
    /// Seed of the first random system; the others follow
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    pub seed: u64,
}

/// Everything the command finds, as written to the JSON file.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// One report per registered kind.
    pub kinds: Vec<ConformanceReport>,
    /// What became of the known-wrong appendages.
    pub known_wrong: Vec<Caught>,
    /// Figures of the random systems.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub systems: Option<Systems>,
}

/// A known-wrong appendage and the suite's verdict.
#[derive(Clone, Debug, Serialize)]
pub struct Caught {
    /// Its name.
    pub name: &'static str,
    /// What is wrong with it.
    pub mistake: &'static str,
    /// The law that must refuse it, as judged; the figure is zero where the suite did not get that far.
    pub by: Check,
    /// Every law that refused it.
    pub broken: Vec<&'static str>,
    /// True when it was refused by that law.
    pub caught: bool,
}

/// Random systems, judged together.
#[derive(Clone, Debug, Serialize)]
pub struct Systems {
    /// How many.
    pub count: u64,
    /// Seed of the first.
    pub seed: u64,
    /// Momentum, energy and bias: the worst of all, and the seed of the system it was found in.
    pub checks: Vec<Check>,
    /// Systems that moved for the whole time; in the others a coordinate left the range its model is valid in.
    pub whole: usize,
    /// Systems in which dampers took more than a hundredth of the energy.
    pub damped: usize,
    /// Mean part of the energy that dampers took.
    pub mean_dissipated: f64,
    /// Accepted integration steps of all systems.
    pub steps: usize,
}

/// Runs the suite, prints one table, writes the JSON file.
///
/// # Errors
/// [`Failure::Tolerance`] (exit code 15) when a kind fails, a known-wrong appendage is not caught by its law, or a
/// system is outside its limits, with everything printed and written before; [`Failure::Io`], [`Failure::Numerical`].
pub fn run(args: &Args) -> anyhow::Result<()> {
    let registry = ffid::default_registry();
    let started = Instant::now();
    let mut outcome = Outcome { kinds: kinds(&registry), known_wrong: wrong_ones(), systems: None };
    if args.systems > 0 {
        outcome.systems = Some(systems(&registry, args.systems, args.seed)?);
    }
    println!("{}", outcome.table());
    println!("{} s", sig(started.elapsed().as_secs_f64(), 3));
    if let Some(path) = &args.json {
        json::write(path, &outcome)?;
    }
    match outcome.faults() {
        faults if faults.is_empty() => Ok(()),
        faults => Err(Failure::Tolerance(faults.join("; ")).into()),
    }
}

/// Allocations of one call: this program runs on the counting allocator of `allocation-counter`.
fn meter(f: &mut dyn FnMut()) -> u64 {
    allocation_counter::measure(f).count_total
}

/// The report of every kind of a registry, with a counting allocator.
pub fn kinds(registry: &Registry) -> Vec<ConformanceReport> {
    registry.kinds().map(|k| check_kind(registry, k, Some(meter))).collect()
}

/// The verdict on every known-wrong appendage.
pub fn wrong_ones() -> Vec<Caught> {
    // One of them panics, which is caught; its messages would bury the table.
    let loud = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let out = known_wrong()
        .iter()
        .map(|w| {
            let report = check_appendage_counting(&*w.appendage, meter);
            let by = report.check(w.law).cloned().unwrap_or_else(|| Check::new(w.law, 0.0, 0.0, "not reached"));
            let broken = report.failures().map(|c| c.law).collect();
            Caught { name: w.name, mistake: w.mistake, caught: !by.pass && by.required, by, broken }
        })
        .collect();
    std::panic::set_hook(loud);
    out
}

/// Runs `count` random systems of all examples of a registry, on all cores; the result does not depend on their number.
///
/// # Errors
/// [`Failure::Numerical`] naming the seed of a system that stopped, or an example that cannot be built.
pub fn systems(registry: &Registry, count: u64, seed: u64) -> Result<Systems, Failure> {
    let stopped = |e: &dyn std::fmt::Display| Failure::Numerical(e.to_string());
    let mut parts: Vec<Arc<dyn DynAppendage>> = Vec::new();
    for kind in registry.kinds() {
        for table in registry.examples(kind) {
            parts.push(registry.build(kind, table).map_err(|e| stopped(&e))?);
        }
    }
    if parts.is_empty() {
        return Err(Failure::Numerical("no kind has an example to build systems from".into()));
    }
    let all: Vec<SystemFigures> = (seed..seed + count)
        .into_par_iter()
        .map(|s| random_system(&parts, s, SECONDS).map_err(|e| stopped(&e)))
        .collect::<Result<_, _>>()?;
    let worst = |law, limit, of: fn(&SystemFigures) -> f64| {
        let at = all.iter().max_by(|a, b| of(a).total_cmp(&of(b)));
        Check::new(law, at.map_or(f64::NAN, of), limit, at.map_or(String::new(), |s| format!("seed {}", s.seed)))
    };
    Ok(Systems {
        count,
        seed,
        checks: vec![
            worst("momentum drift", MOMENTUM, |s| s.momentum),
            worst("energy balance with damping on", ENERGY, |s| s.energy),
            worst("bias equals the derived bias", BIAS, |s| s.bias),
        ],
        whole: all.iter().filter(|s| s.seconds >= SECONDS).count(),
        damped: all.iter().filter(|s| s.dissipated > 0.01).count(),
        mean_dissipated: all.iter().map(|s| s.dissipated).sum::<f64>() / all.len() as f64,
        steps: all.iter().map(|s| s.steps).sum(),
    })
}

impl Outcome {
    /// What is wrong, one entry each; empty when all is well.
    pub fn faults(&self) -> Vec<String> {
        let mut out = Vec::new();
        for report in &self.kinds {
            out.extend(report.failures().map(|c| format!("{}: {} ({})", report.kind, c.law, c.detail)));
        }
        for w in self.known_wrong.iter().filter(|w| !w.caught) {
            out.push(format!("known-wrong '{}' is not caught by '{}'", w.name, w.by.law));
        }
        for c in self.systems.iter().flat_map(|s| &s.checks).filter(|c| !c.pass) {
            out.push(format!("random systems: {} is {:.1e}, limit {:.0e} ({})", c.law, c.figure, c.limit, c.detail));
        }
        out
    }

    /// One table of everything.
    pub fn table(&self) -> Table {
        let mut t = Table::new("Conformance", &["kind", "check", "figure", "limit", "pass"]).left(2);
        let cells = |kind: &str, c: &Check, verdict: &str| {
            let figures = [format!("{:.1e}", c.figure), format!("{:.0e}", c.limit)];
            [kind.to_owned(), c.law.to_owned()].into_iter().chain(figures).chain([verdict.to_owned()])
        };
        let verdict = |c: &Check| match (c.pass, c.required) {
            (true, _) => "yes",
            (false, true) => "NO",
            (false, false) => "noted",
        };
        for report in &self.kinds {
            for c in &report.checks {
                t.row(cells(&report.kind, c, verdict(c)));
            }
            for s in &report.skipped {
                t.row([&*report.kind, s.law, "-", "-", "not checked"].map(str::to_owned));
            }
            t.rule();
        }
        for w in &self.known_wrong {
            let verdict = if w.caught { "caught" } else { "NOT CAUGHT" };
            t.row(cells(&format!("wrong: {}", w.name), &w.by, verdict));
        }
        if let Some(s) = &self.systems {
            t.rule();
            for c in &s.checks {
                t.row(cells(&format!("{} random systems", s.count), c, verdict(c)));
            }
            t.note(format!(
                "{} of {} systems moved for {SECONDS} s, in the others a coordinate left its range; dampers took {} % of \
                 the energy on average, more than 1 % in {}; {} steps",
                s.whole,
                s.count,
                sig(100.0 * s.mean_dissipated, 2),
                s.damped,
                s.steps
            ));
        }
        let caught = self.known_wrong.iter().filter(|w| w.caught).count();
        let passed = self.kinds.iter().filter(|r| r.passed()).count();
        t.note(format!(
            "{passed} of {} kinds pass, {caught} of {} known-wrong appendages are caught by the law they break",
            self.kinds.len(),
            self.known_wrong.len()
        ));
        t
    }
}
