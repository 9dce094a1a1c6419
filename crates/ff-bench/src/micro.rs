//! `ff-bench micro`: nanoseconds per call.

use crate::check;
use crate::functions::{Function, Runner};
use crate::isa;
use crate::lanes::suffix;
use crate::models;
use crate::models::{Name, Peer};
use crate::states;
use crate::states::{Sample, Set};
use crate::timing::{Timing, time};
use anyhow::ensure;
use ff_dynamics::tree::SingularInertia;
use ff_model::scalar::LaneScalar;
use ff_model::scalar::lanes::{Isa, LaneTask, dispatch, dispatch_one};
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `micro`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder of rigid.txt, flex.txt and slosh.txt as peers/src/make_states.py writes them
    #[arg(long)]
    states: PathBuf,
    /// The project's fixtures, for the oracle
    #[arg(long, default_value = "fixtures")]
    fixtures: PathBuf,
    /// Repetitions of the loop over all states
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..))]
    reps: u32,
    /// Only lines whose `model.fn.config` contains this
    #[arg(long, default_value = "")]
    only: String,
    /// Widest instructions to use
    #[arg(long, value_enum, default_value_t = isa::Isa::Auto)]
    isa: isa::Isa,
}

/// One line of output; the fields of `peers/src/bench.hpp`.
#[derive(Serialize)]
struct Line<'a> {
    peer: &'static str,
    config: &'a str,
    model: &'a str,
    r#fn: &'a str,
    #[serde(flatten)]
    timing: Timing,
}

/// Runs everything that is asked for.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    for name in Name::ALL {
        let samples = states::read(&args.states.join(format!("{}.txt", name.text())))?;
        for &form in name.forms() {
            let peer = models::build(name, form)?;
            ensure!(samples.iter().all(|s| s.v.len() == peer.model.nv()), "states of another model than {name:?}");
            one(args, &peer, &samples)?;
        }
    }
    Ok(())
}

fn one(args: &Args, peer: &Peer, samples: &[Sample]) -> anyhow::Result<()> {
    // Names of lanes contain the plain name, so this misses none of them.
    if !Function::ALL.into_iter().any(|f| wanted(args, peer, f.text())) && !args.only.contains(".x") {
        return Ok(());
    }
    check::against_oracle(peer, &args.fixtures)?;
    let mut plain = Runner::<f64>::new(&peer.model, Set::new(&peer.model, samples)?);
    check::mutual(&peer.label(), &mut plain)?;
    check::regressor(&peer.label(), &mut plain)?;
    check::id_derivatives(&peer.label(), &mut plain)?;
    measure(args, peer, &mut plain)?;
    // Over one lane this shows that a result does not depend on what the buffers held before.
    laned::<f64>(args, peer, samples, &mut plain)?;
    if args.isa.widest()? >= Isa::V3 {
        dispatch_one(Laned { args, peer, samples, plain: &mut plain })?;
    }
    for isa in args.isa.all()? {
        dispatch(isa, Laned { args, peer, samples, plain: &mut plain })?;
    }
    Ok(())
}

struct Laned<'a, 'm> {
    args: &'a Args,
    peer: &'a Peer,
    samples: &'a [Sample],
    plain: &'a mut Runner<'m, f64>,
}

impl LaneTask for Laned<'_, '_> {
    type Output = anyhow::Result<()>;
    fn run<L: LaneScalar>(self) -> Self::Output {
        laned::<L>(self.args, self.peer, self.samples, self.plain)
    }
}

/// Checks every lane against the plain computation, and times what is batched.
fn laned<T: LaneScalar>(
    args: &Args,
    peer: &Peer,
    samples: &[Sample],
    plain: &mut Runner<'_, f64>,
) -> anyhow::Result<()> {
    let mut r = Runner::<T>::new(&peer.model, Set::new(&peer.model, samples)?);
    check::lanes(&peer.label(), plain, &mut r)?;
    if suffix::<T>().is_empty() { Ok(()) } else { measure(args, peer, &mut r) }
}

/// Times everything that exists over `T`.
fn measure<T: LaneScalar>(args: &Args, peer: &Peer, r: &mut Runner<'_, T>) -> anyhow::Result<()> {
    let (calls, reps) = (r.set.states.len(), args.reps as usize);
    for f in Function::ALL {
        let name = format!("{}{}", f.text(), suffix::<T>());
        if !wanted(args, peer, &name) {
            continue;
        }
        let mut failed: Option<SingularInertia> = None;
        let timing = time(calls, T::N, reps, |i| {
            r.call(f, i).unwrap_or_else(|e| {
                failed = Some(e);
                f64::NAN
            })
        });
        if let Some(e) = failed {
            return Err(e.into());
        }
        let (config, model) = (peer.form.text(), peer.name.text());
        println!("{}", serde_json::to_string(&Line { peer: "ffid", config, model, r#fn: &name, timing })?);
    }
    Ok(())
}

fn wanted(args: &Args, peer: &Peer, function: &str) -> bool {
    format!("{}.{function}.{}", peer.name.text(), peer.form.text()).contains(&args.only)
}
