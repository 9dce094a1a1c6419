//! `ff-bench sensitivities`: derivatives of the record with respect to all parameters, against the plain simulation.

use crate::isa::Isa;
use crate::models;
use crate::models::{Form, Name};
use crate::motion::Manoeuvre;
use ff_dynamics::reduced::sensitivity::sensitivities_with;
use ff_dynamics::{Prescribed, Sampling, Wanted, sensitivities, simulate_reduced};
use ff_model::Params;
use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;

/// Arguments of `sensitivities`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[arg(long, value_enum, default_value_t = Name::Flex)]
    model: Name,
    /// Length of the record (s), sampled and integrated at 100 Hz
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Repetitions
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    reps: u32,
    /// Once and nothing else, for an instruction counter, with the lanes of this set
    #[arg(long, value_enum)]
    once: Option<Isa>,
}

#[derive(Serialize)]
struct Line {
    peer: &'static str,
    model: &'static str,
    r#fn: &'static str,
    parameters: usize,
    plain_s: f64,
    sensitivities_s: f64,
    /// The first call, whose memory comes from the system page by page.
    first_s: f64,
    /// Derivatives against central differences of the simulation, relative per column.
    differences: f64,
}

const SAMPLE_S: f64 = 0.01;

/// Times both on the same table, by turns.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let peer = models::build(args.model, Form::Ports)?;
    let model = &peer.model;
    let params = Params::nominal(model);
    let samples = (args.seconds / SAMPLE_S).round() as usize + 1;
    let sampling = Sampling { samples, sample_s: SAMPLE_S, substeps: 1 };
    let table = Prescribed::new(model, &params, &Manoeuvre { duration: args.seconds }, &sampling, &[]);
    // The base body and every appendage; the arm is known, as in the paper.
    let wanted = Wanted {
        params: (0..10).chain(10 * model.n_bodies()..model.n_params()).collect(),
        initial: vec![],
        ..Wanted::default()
    };
    let z0 = vec![0.0; 6 + 2 * model.np()];
    if let Some(isa) = args.once {
        let (r, _) = sensitivities_with(isa.widest()?, model, &params, &table, &z0, &wanted)?;
        println!("{}", r.tau.sum());
        return Ok(());
    }
    let (mut plain, mut exact) = (Vec::new(), Vec::new());
    let start = Instant::now();
    let (_, sens) = sensitivities(model, &params, &table, &z0, &wanted)?;
    let first_s = start.elapsed().as_secs_f64();
    let differences = differences(model, &params, &table, &z0, &wanted, &sens)?;
    anyhow::ensure!(differences < 1e-4, "sensitivities differ from central differences by {differences:.1e}");
    // An identification calls again and again, with memory that it has had before.
    drop(sens);
    black_box(sensitivities(model, &params, &table, &z0, &wanted)?);
    for _ in 0..args.reps {
        let start = Instant::now();
        black_box(simulate_reduced(model, &params, &table, &z0)?);
        plain.push(start.elapsed().as_secs_f64());
        let start = Instant::now();
        black_box(sensitivities(model, &params, &table, &z0, &wanted)?);
        exact.push(start.elapsed().as_secs_f64());
    }
    let median = |x: &mut Vec<f64>| {
        x.sort_by(f64::total_cmp);
        x[x.len() / 2]
    };
    let line = Line {
        peer: "ffid",
        model: args.model.text(),
        r#fn: "sensitivities",
        parameters: wanted.len(),
        plain_s: median(&mut plain),
        sensitivities_s: median(&mut exact),
        first_s,
        differences,
    };
    println!("{}", serde_json::to_string(&line)?);
    Ok(())
}

/// Worst column against central differences, relative to the largest element of that column.
fn differences(
    model: &ff_model::Model,
    params: &Params<f64>,
    table: &Prescribed,
    z0: &[f64],
    wanted: &Wanted,
    sens: &ff_dynamics::Sensitivities,
) -> anyhow::Result<f64> {
    let nj = model.nj();
    let mut worst = 0.0f64;
    // A few of each kind are enough to know that this is the right matrix; ff-dynamics tests every column.
    for col in (0..wanted.len()).step_by(5) {
        let p = wanted.params[col];
        let h = 1e-4 * params.values()[p].abs().max(1.0);
        let at = |d: f64| -> anyhow::Result<_> {
            let mut v = params.values().to_vec();
            v[p] += d;
            Ok(simulate_reduced(model, &Params::from_values(model, v), table, z0)?)
        };
        let (up, down) = (at(h)?, at(-h)?);
        let (mut error, mut scale) = (0.0f64, 0.0f64);
        for i in 0..table.samples() {
            for j in 0..nj {
                let fd = (up.tau[(i, j)] - down.tau[(i, j)]) / (2.0 * h);
                error = error.max((fd - sens.tau[(i * nj + j, col)]).abs());
                scale = scale.max(fd.abs());
            }
        }
        // A parameter that the torques do not feel has nothing to be compared with.
        if scale > 1e-9 {
            worst = worst.max(error / scale);
        }
    }
    Ok(worst)
}
