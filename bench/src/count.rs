//! `ff-bench count`: a given number of calls and nothing else, for callgrind.

use crate::functions::{Function, Runner};
use crate::generate;
use crate::isa::Isa;
use crate::lanes::Lanes;
use crate::models::{self, Form, Name};
use crate::states::Set;

/// Arguments of `count`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[arg(long, value_enum)]
    model: Name,
    #[arg(long, value_enum)]
    form: Form,
    #[arg(long, value_enum)]
    function: Function,
    /// States carried at once: 1 for plain numbers
    #[arg(long, default_value_t = 1)]
    lanes: usize,
    /// Number of calls; the states are gone through again and again
    #[arg(long)]
    calls: usize,
    #[arg(long, value_enum, default_value_t = Isa::Portable)]
    isa: Isa,
}

/// Distinct states, few enough that making them costs little under valgrind.
const STATES: usize = 64;

/// Makes the calls.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    args.isa.select()?;
    match args.lanes {
        1 => calls::<f64>(args),
        // PLACE FOR LANES: 4 and 8.
        n => anyhow::bail!("no scalar of {n} lanes in this build"),
    }
}

fn calls<T: Lanes>(args: &Args) -> anyhow::Result<()> {
    let peer = models::build(args.model, args.form)?;
    let samples = generate::samples(&peer.model, STATES);
    let mut r = Runner::<T>::new(&peer.model, Set::new(&peer.model, &samples)?);
    anyhow::ensure!(T::FUNCTIONS.contains(&args.function), "no {} over {} lanes", args.function.text(), T::LANES);
    let n = r.set.states.len();
    let mut sum = 0.0;
    for i in 0..args.calls {
        sum += r.call(args.function, i % n)?;
    }
    println!("{sum}");
    Ok(())
}
