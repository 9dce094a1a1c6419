//! `cargo xtask study <name>`: seeded experiments that hold the project to figures it has promised.
//!
//! A study fills a [`Study`] with figures and their limits; which prints, writes and judges them. The JSON of every
//! study is `{"study", "seed", "figures": {name: number}, "limits": {name: [op, number]}, "pass"}`; when a limit fails
//! the exit code is 15, with everything printed and written before. A study consists of [`trials`], which are kept as they are done.

pub mod budget;
mod covered;
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
    /// Records one after another: does their order matter, and do intervals hold the truth while fuel is burnt and biases walk?
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

/// What a study found, printed and judged; unless it was asked for a part that it does not have.
fn ended(study: Study, options: &Options) -> anyhow::Result<()> {
    options.all_known()?;
    Ok(study.finish(options)?)
}

/// Runs a study.
///
/// # Errors
/// Those of the study, [`Options::all_known`], [`Study::finish`].
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.which {
        Which::Excitation(options) => ended(excitation::run(options)?, options),
        Which::Recovery(options) => ended(identification::recovery::run(options)?, options),
        Which::Convergence(options) => ended(identification::convergence::run(options)?, options),
        Which::Coverage(options) => ended(identification::coverage::run(options)?, options),
        Which::Combined(options) => ended(identification::combined::run(options)?, options),
        Which::Degeneracies(options) => ended(degeneracies::run(options)?, options),
        Which::Nist(options) => ended(nist::run(options)?, options),
        Which::Starts(options) => ended(starts::run(options)?, options),
        Which::Budget(options) => ended(budget::run(options)?, options),
        Which::Sequence(options) => ended(sequence::run(options)?, options),
        Which::Posterior(options) => ended(identification::posterior::run(options)?, options),
        Which::Real(args) => ended(real::run(args)?, &args.options),
        Which::Thinned(options) => ended(thinned::run(options)?, options),
        Which::Verdict(args) => ended(verdict::run(args)?, &args.options),
    }
}
