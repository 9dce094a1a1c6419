//! `ff-bench count`: a given number of calls and nothing else, for callgrind.

use crate::functions::{Function, Runner};
use crate::generate;
use crate::isa::Isa;
use crate::models;
use crate::models::{Form, Name};
use crate::states::Set;
use ff_model::scalar::LaneScalar;
use ff_model::scalar::lanes::{LaneTask, dispatch, dispatch_one};

/// Arguments of `count`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[arg(long, value_enum)]
    model: Name,
    #[arg(long, value_enum)]
    form: Form,
    #[arg(long, value_enum)]
    function: Function,
    /// States carried at once: 1 for plain numbers, 0 for one state in code for AVX2 and FMA
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
    let isa = args.isa.widest()?;
    match args.lanes {
        1 => calls::<f64>(args),
        // One state in code for AVX2 and FMA.
        0 => dispatch_one(Calls(args)),
        n if n == isa.lanes() => dispatch(isa, Calls(args)),
        n => anyhow::bail!("{isa:?} has {} lanes, not {n}; choose another --isa", isa.lanes()),
    }
}

struct Calls<'a>(&'a Args);

impl LaneTask for Calls<'_> {
    type Output = anyhow::Result<()>;
    fn run<L: LaneScalar>(self) -> Self::Output {
        calls::<L>(self.0)
    }
}

fn calls<T: LaneScalar>(args: &Args) -> anyhow::Result<()> {
    let peer = models::build(args.model, args.form)?;
    let samples = generate::samples(&peer.model, STATES);
    let mut r = Runner::<T>::new(&peer.model, Set::new(&peer.model, &samples)?);
    let n = r.set.states.len();
    let mut sum = 0.0;
    for i in 0..args.calls {
        sum += r.call(args.function, i % n)?;
    }
    println!("{sum}");
    Ok(())
}
