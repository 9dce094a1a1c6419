//! `cargo xtask bench`: nanoseconds per call of every algorithm, beside the engines people would pick instead.
//!
//! `ff-bench` is built for the portable CPU target and for this machine's, and runs by turns with the programs of
//! `peers/run_peers.sh` on one core. [`limits`] holds what must be reached; what is measured and how is in
//! `docs/benchmarks.md`. Two other questions have flags of their own: [`instructions`] and [`sizes`].
pub mod aggregate;
pub mod build;
pub mod cell;
pub mod instructions;
pub mod limits;
pub mod micro;
pub mod models;
mod options;
pub mod peers;
pub mod programs;
pub mod report;
pub mod run;
pub mod sizes;
pub mod tasks;

pub use options::{Args, Effort};

use crate::workspace;
use ffid::files::atomic;

/// Runs what is asked for.
///
/// # Errors
/// Failures of the programs, [`ffid::exit::Failure::Tolerance`] when an instruction count rose.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let root = workspace::root()?;
    let effort = Effort::of(args);
    if args.instructions {
        return instructions::run(&root, args);
    }
    if args.sizes {
        return sizes::run(&root, args, effort);
    }
    // A wrong folder should be known before anything is built.
    let peers = args.peers.as_deref().map(peers::Peers::find).transpose()?;
    let portable = build::ff_bench(&root, build::Target::Portable)?;
    let native = build::ff_bench(&root, build::Target::Native)?;
    let pin = run::Pin::to(args.core);
    let states = match &peers {
        Some(p) => p.states.clone(),
        None => build::own_states(&root, &portable)?,
    };
    let programs = programs::Programs { root: &root, portable: &portable, native: &native, peers: peers.as_ref(), pin };
    let cells = micro::measure(&programs, &states, effort, &args.only)?;
    let tasks = tasks::measure(&programs, effort, &args.only)?;
    let limits = limits::evaluate(&cells, &tasks, peers.is_some());
    print!("{}", report::text(&cells, &tasks, &limits, peers.is_some(), &programs.pin));
    if let Some(path) = &args.json {
        atomic::write(path, &report::json(&cells, &tasks, &limits)?)?;
    }
    Ok(())
}
