//! `cargo xtask study sequence`: records one after another.
//!
//! The servicer of `fixtures/verdict`. Parts for `--only`, or numbers of lives:
//!
//! * `orders`: does it matter in which order records come?
//! * `life`: fuel is burnt between ten records, and biases of the gyro walk within them; how many of the 95 % intervals hold the truth?

mod life;
mod orders;

use super::figures::Study;
use super::options::Options;
use super::trials::Trials;
use super::verdict::world::World;

/// Runs the study.
///
/// # Errors
/// Files that cannot be read or written; a record that cannot be made; an identification in an order that gives nothing.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("sequence", options.seed);
    let trials = Trials::open("sequence", 1, options)?;
    let world = World::new("start.toml")?;
    if options.wants("orders") && options.cases().is_empty() {
        orders::run(&world, &trials, options, &mut study)?;
    }
    if options.wants("life") {
        life::run(&world, &trials, options, &mut study)?;
    }
    trials.note().into_iter().for_each(|n| study.note(n));
    Ok(study)
}
