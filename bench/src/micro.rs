//! `ff-bench micro`: nanoseconds per call.

use crate::check;
use crate::functions::{Function, RegressorRunner, Runner};
use crate::lanes::Lanes;
use crate::models::{self, Form, Name, Peer};
use crate::states::{self, Sample, Set};
use crate::timing::{Timing, time};
use anyhow::ensure;
use ff_dynamics::SingularInertia;
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
}

/// One line of output; the fields of `peers/src/bench.hpp`.
#[derive(Serialize)]
struct Line<'a> {
    peer: &'static str,
    config: &'a str,
    model: &'a str,
    r#fn: String,
    #[serde(flatten)]
    timing: Timing,
}

/// Runs everything that is asked for.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    for name in [Name::Rigid, Name::Flex, Name::Slosh] {
        let samples = states::read(&args.states.join(format!("{}.txt", name.text())))?;
        for form in [Form::Ports, Form::Tree] {
            if name == Name::Rigid && form == Form::Tree {
                continue; // without passive bodies both forms are one
            }
            let peer = models::build(name, form)?;
            ensure!(samples.iter().all(|s| s.v.len() == peer.model.nv()), "states of another model than {name:?}");
            one(args, &peer, &samples)?;
        }
    }
    Ok(())
}

fn one(args: &Args, peer: &Peer, samples: &[Sample]) -> anyhow::Result<()> {
    let functions = Function::LANED.into_iter().chain(Function::PLAIN);
    if !functions.into_iter().any(|f| wanted(args, peer, f.text())) {
        return Ok(());
    }
    check::against_oracle(peer, &args.fixtures)?;
    laned::<f64>(args, peer, samples)?;
    // PLACE FOR LANES: laned::<F64x4>(..) and laned::<F64x8>(..) once `Lanes` is implemented for them.
    if wanted(args, peer, "regressor") {
        let mut r = Runner::<f64>::new(&peer.model, Set::new(&peer.model, samples)?);
        let mut y = RegressorRunner::new(&peer.model);
        check::regressor(&label(peer), &mut r, &mut y)?;
        let calls = r.set.states.len();
        print(peer, "regressor".into(), time(calls, 1, args.reps as usize, |i| y.call(&mut r, i)))?;
    }
    Ok(())
}

/// The functions that are generic over the scalar.
fn laned<T: Lanes>(args: &Args, peer: &Peer, samples: &[Sample]) -> anyhow::Result<()> {
    let mut r = Runner::<T>::new(&peer.model, Set::new(&peer.model, samples)?);
    check::mutual(&format!("{}{}", label(peer), T::SUFFIX), &mut r)?;
    let (calls, reps) = (r.set.states.len(), args.reps as usize);
    let mut failed: Option<SingularInertia> = None;
    for f in Function::LANED {
        let name = format!("{}{}", f.text(), T::SUFFIX);
        if !wanted(args, peer, &name) {
            continue;
        }
        let mut sound = |x: Result<f64, SingularInertia>| {
            x.unwrap_or_else(|e| {
                failed = Some(e);
                f64::NAN
            })
        };
        let timing = match f {
            Function::Rnea => time(calls, T::LANES, reps, |i| r.rnea(i)),
            Function::Crba => time(calls, T::LANES, reps, |i| r.crba(i)),
            Function::Fd => time(calls, T::LANES, reps, |i| sound(r.fd(i))),
            Function::Hybrid => time(calls, T::LANES, reps, |i| sound(r.hybrid(i))),
            Function::Regressor => continue,
        };
        if let Some(e) = failed {
            return Err(e.into());
        }
        print(peer, name, timing)?;
    }
    Ok(())
}

fn label(peer: &Peer) -> String {
    format!("{} {}", peer.name.text(), peer.form.text())
}

fn wanted(args: &Args, peer: &Peer, function: &str) -> bool {
    format!("{}.{function}.{}", peer.name.text(), peer.form.text()).contains(&args.only)
}

fn print(peer: &Peer, function: String, timing: Timing) -> anyhow::Result<()> {
    let (config, model) = (peer.form.text(), peer.name.text());
    println!("{}", serde_json::to_string(&Line { peer: "ffid", config, model, r#fn: function, timing })?);
    Ok(())
}
