//! `cargo xtask study <name>`: seeded experiments that hold the project to figures it has promised.
//!
//! A study fills a [`Study`] with figures and their limits; which prints, writes and judges them. The JSON of every
//! study is `{"study", "seed", "figures": {name: number}, "limits": {name: [op, number]}, "pass"}`; when a limit fails
//! the exit code is 15, with everything printed and written before. A study consists of [`trials`], which are kept as they are done.

pub mod budget;
mod cpu;
pub mod degeneracies;
pub mod excitation;
mod figures;
pub mod identification;
pub mod nist;
mod options;
mod quintic;
pub mod real;
pub mod sequence;
pub mod starts;
pub mod thinned;
pub mod trials;
pub mod verdict;

pub use figures::{Op, Study};
pub use options::Options;

/// Arguments of `study`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    which: Which,
}

/// One variant per study.
#[derive(Debug, clap::Subcommand)]
enum Which {
    /// Planned excitation against random multisines, quiet and modal plans, limits, gradients, times
    Excitation(Options),
    /// Noise-free data from 100 starts 20 % off: rigid, flexible, slosh, both, with a payload
    Recovery(Options),
    /// Fits from missions up to five times off in every stiffness, damping, slosh mass and length, and in the base mass
    Convergence(Options),
    /// 1000 noisy records: do the 95 % intervals hold the truth?
    Coverage(Options),
    /// Panels and fuel at once, with biases and a delay unknown
    Combined(Options),
    /// 20 built degeneracies: named, and no false one
    Degeneracies(Options),
    /// The solver on NIST's 27 problems of nonlinear regression
    Nist(Options),
    /// Fits of 100 random truths within 70 % of the prior, from the start that their modes give
    Starts(Options),
    /// Worlds in which everything that a mission is not sure of is drawn: do the 95 % intervals hold the truth?
    Budget(Options),
    /// Five records one after another, in ten orders: is the end that of the joint fit?
    Sequence(Options),
    /// Draws from the posterior: ranks of truths drawn from the prior, R-hat and effective sizes in time
    Posterior(Options),
    /// Measured logs of arms on the ground: held-out torques against least squares on Pinocchio's regressor
    Real(real::Args),
    /// Logs with lost, late and missing samples and torques at half the rate: do the 95 % intervals hold the truth?
    Thinned(Options),
    /// Worlds of MuJoCo, exact and with errors: is a wrong model contradicted, and no right one?
    Verdict(verdict::Args),
}

/// Runs a study.
///
/// # Errors
/// Those of the study and of [`Study::finish`].
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.which {
        Which::Excitation(options) => Ok(excitation::run(options)?.finish(options)?),
        Which::Recovery(options) => Ok(identification::recovery::run(options)?.finish(options)?),
        Which::Convergence(options) => Ok(identification::convergence::run(options)?.finish(options)?),
        Which::Coverage(options) => Ok(identification::coverage::run(options)?.finish(options)?),
        Which::Combined(options) => Ok(identification::combined::run(options)?.finish(options)?),
        Which::Degeneracies(options) => Ok(degeneracies::run(options)?.finish(options)?),
        Which::Nist(options) => Ok(nist::run(options)?.finish(options)?),
        Which::Starts(options) => Ok(starts::run(options)?.finish(options)?),
        Which::Budget(options) => Ok(budget::run(options)?.finish(options)?),
        Which::Sequence(options) => Ok(sequence::run(options)?.finish(options)?),
        Which::Posterior(options) => Ok(identification::posterior::run(options)?.finish(options)?),
        Which::Real(args) => Ok(real::run(args)?.finish(&args.options)?),
        Which::Thinned(options) => Ok(thinned::run(options)?.finish(options)?),
        Which::Verdict(args) => Ok(verdict::run(args)?.finish(&args.options)?),
    }
}
