//! `ff-bench sim`: the whole task of the peers, a minute of the manoeuvre with torques and gyro recorded at every step.

use crate::models;
use crate::models::{Form, Name, Peer};
use crate::motion::Manoeuvre;
use anyhow::ensure;
use clap::ValueEnum;
use ff_dynamics::sim::{Keep, Run, simulate_ensemble};
use ff_dynamics::{Drive, Prescribed, Sampling, SimOptions, State, simulate, simulate_reduced};
use ff_model::Params;
use serde::Serialize;
use std::time::Instant;

/// Arguments of `sim`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[arg(long, value_enum)]
    model: Name,
    #[arg(long, value_enum, default_value_t = Via::Full)]
    via: Via,
    /// Length (s)
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Step and sample time (s)
    #[arg(long, default_value_t = 0.001)]
    step: f64,
    /// Repetitions
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    reps: u32,
}

/// Which of our simulators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Via {
    /// `simulate`: everything the peers compute, position and attitude included.
    Full,
    /// `simulate_ensemble`: the same for eight parameter sets at once, time per trajectory.
    #[value(name = "full.x8")]
    Ensemble,
    /// `simulate_reduced`: what identification integrates; no position, no attitude.
    Reduced,
}

impl Via {
    fn trajectories(self) -> usize {
        if self == Self::Ensemble { 8 } else { 1 }
    }
}

/// One line of output, the fields of `peers/src/pin_sim.cpp`.
#[derive(Serialize)]
struct Line {
    peer: &'static str,
    config: &'static str,
    task: String,
    reps: u32,
    median_s: f64,
    min_s: f64,
    max_s: f64,
    /// `[position 3, quaternion x y z w | passive, base twist 6, passive rates]`; without the first seven where they are
    /// not integrated.
    x_end: Vec<f64>,
    tau_end: Vec<f64>,
}

/// Simulates and prints.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    ensure!(args.step > 0.0 && args.seconds >= args.step, "step and length must be positive");
    let mut seconds = Vec::new();
    let mut end = (Vec::new(), Vec::new());
    for _ in 0..args.reps {
        // As in the peers' programs, making the model and tabulating the motion counts.
        let start = Instant::now();
        let peer = models::build(args.model, Form::Ports)?;
        end = match args.via {
            Via::Full => full(&peer, args)?,
            Via::Ensemble => ensemble(&peer, args)?,
            Via::Reduced => reduced(&peer, args)?,
        };
        seconds.push(start.elapsed().as_secs_f64() / args.via.trajectories() as f64);
    }
    seconds.sort_by(f64::total_cmp);
    let line = Line {
        peer: "ffid",
        config: match args.via {
            Via::Full => "full",
            Via::Ensemble => "full.x8",
            Via::Reduced => "reduced",
        },
        task: format!("sim {} {}s RK4 dt={}", args.model.text(), args.seconds, args.step),
        reps: args.reps,
        median_s: seconds[seconds.len() / 2],
        min_s: seconds[0],
        max_s: seconds[seconds.len() - 1],
        x_end: end.0,
        tau_end: end.1,
    };
    println!("{}", serde_json::to_string(&line)?);
    Ok(())
}

/// End state and joint torques there.
type End = (Vec<f64>, Vec<f64>);

fn full(peer: &Peer, args: &Args) -> anyhow::Result<End> {
    let model = &peer.model;
    let (step, params) = (args.step, Params::nominal(model));
    // The stages fall on half steps, where the table is exact.
    let motion = Manoeuvre { duration: args.seconds };
    let options = SimOptions { duration_s: args.seconds, step_s: step, sample_s: step };
    let trace = simulate(model, &params, &State::zero(model), &Drive::Prescribed(&motion), &options)?;
    Ok((end_state(&trace.last), trace.tau.row(trace.len() - 1).iter().copied().collect()))
}

/// Eight trajectories; the first is the nominal one, which is reported. That each lane is a simulation of its own is
/// tested in ff-dynamics.
fn ensemble(peer: &Peer, args: &Args) -> anyhow::Result<End> {
    let model = &peer.model;
    let step = args.step;
    let nominal = Params::<f64>::nominal(model);
    let params: Vec<Params<f64>> = (0..8)
        .map(|k| {
            // The arm is known, as in identification; base and appendages differ.
            let known = 10..10 * model.n_bodies();
            let scaled = |(i, x): (usize, &f64)| {
                if known.contains(&i) { *x } else { x * (1.0 + 1e-3 * k as f64 * (1.0 + (i % 5) as f64)) }
            };
            Params::from_values(model, nominal.values().iter().enumerate().map(scaled).collect())
        })
        .collect();
    let start = State::zero(model);
    let runs: Vec<Run<'_>> = params.iter().map(|params| Run { params, start: &start }).collect();
    let motion = Manoeuvre { duration: args.seconds };
    let options = SimOptions { duration_s: args.seconds, step_s: step, sample_s: step };
    let traces = simulate_ensemble(model, &runs, &motion, &options, Keep::default())?;
    let last = traces[0].tau.nrows() - 1;
    Ok((end_state(&traces[0].last), traces[0].tau.row(last).iter().copied().collect()))
}

fn end_state(s: &State<f64>) -> Vec<f64> {
    let att = [s.att[1], s.att[2], s.att[3], s.att[0]];
    [s.pos.as_slice(), &att, &s.eta, &s.v[..6], s.nu()].concat()
}

fn reduced(peer: &Peer, args: &Args) -> anyhow::Result<End> {
    let model = &peer.model;
    let params = Params::nominal(model);
    let samples = (args.seconds / args.step).round() as usize + 1;
    let sampling = Sampling { samples, sample_s: args.step, substeps: 1 };
    let table = Prescribed::new(model, &params, &Manoeuvre { duration: args.seconds }, &sampling, &[]);
    let r = simulate_reduced(model, &params, &table, &vec![0.0; 6 + 2 * model.np()])?;
    let row = |m: &nalgebra::DMatrix<f64>| -> Vec<f64> { m.row(samples - 1).iter().copied().collect() };
    Ok(([row(&r.eta), row(&r.twist), row(&r.nu)].concat(), row(&r.tau)))
}
