//! `ff-bench linear`: least squares over the regressor of many instants of the free-flying rigid robot, as
//! `peers/src/figaroh_bench.py` runs it with NumPy: regressor, rank-revealing factorisation, base parameters, solution.

use crate::models;
use crate::models::{Form, Name};
use anyhow::ensure;
use ff_dynamics::{State, Work, rnea};
use ff_model::Params;
use ident::Complete;
use ident::solve::Weights;
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::time::Instant;

/// Arguments of `linear`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Instants; each gives 13 rows of 80 columns
    #[arg(long, default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(20..=1_000_000))]
    samples: u32,
    /// Repetitions
    #[arg(long, default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..))]
    reps: u32,
}

#[derive(Serialize)]
struct Line {
    peer: &'static str,
    task: String,
    reps: usize,
    median_s: f64,
    min_s: f64,
    max_s: f64,
    /// Base parameters.
    n_base: usize,
    /// Condition of the scaled columns.
    condition: f64,
    /// Worst base parameter against the truth, relative to its size or 1.
    error: f64,
}

/// Times `Complete::estimate` of all 80 parameters and prints.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let model = models::build(Name::Rigid, Form::Ports)?.model;
    let params = Params::<f64>::nominal(&model);
    let n = args.samples as usize;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let (nj, nv) = (model.nj(), model.nv());
    let q = DMatrix::from_fn(n, nj, |_, _| rng.random_range(-2.5..2.5));
    let v = DMatrix::from_fn(n, nv, |_, _| rng.random_range(-1.0..1.0));
    let a = DMatrix::from_fn(n, nv, |_, _| rng.random_range(-1.0..1.0));
    let mut forces = DMatrix::zeros(n, nv);
    let (mut work, mut state) = (Work::new(&model), State::zero(&model));
    let (mut acc, mut row) = (vec![0.0; nv], vec![0.0; nv]);
    for i in 0..n {
        (0..nj).for_each(|k| state.q[k] = q[(i, k)]);
        (0..nv).for_each(|k| (state.v[k], acc[k]) = (v[(i, k)], a[(i, k)]));
        rnea(&model, &params, &state, &acc, &mut work, &mut row);
        (0..nv).for_each(|k| forces[(i, k)] = row[k]);
    }
    let selected: Vec<usize> = (0..model.n_params()).collect();
    // From somewhere else: what the data do not tell stays there.
    let start: Vec<f64> = params.values().iter().enumerate().map(|(i, x)| x * (1.0 + 0.02 * (i % 7) as f64)).collect();
    let weights = Weights::Given(vec![1.0; 2 + nj]);
    let complete = Complete::of_instants(&model, q, v, a, forces, weights)?;
    let names: Vec<String> = model.param_decls().into_iter().map(|d| d.name).collect();
    let truth = |name: &str| names.iter().position(|n| n == name).map_or(f64::NAN, |i| params.values()[i]);
    let mut seconds = Vec::new();
    let mut line = (0, 0.0, 0.0f64);
    // One repetition warms up.
    for rep in 0..=args.reps {
        let from = Instant::now();
        let e = complete.estimate(&selected, &start)?;
        let taken = from.elapsed().as_secs_f64();
        if rep > 0 {
            seconds.push(taken);
        }
        let errors = e.base.iter().map(|b| {
            let exact: f64 = b.terms.iter().map(|(n, f)| f * truth(n)).sum();
            (b.value - exact).abs() / exact.abs().max(1.0)
        });
        line = (e.base.len(), e.uncertainty.condition, errors.fold(0.0, f64::max));
    }
    let expected = 10 * model.n_bodies() - 3 * nj;
    ensure!(line.0 == expected, "{} base parameters, expected {expected}", line.0);
    ensure!(line.2 < 1e-9, "base parameters are off by {:.1e}", line.2);
    seconds.sort_by(f64::total_cmp);
    let line = Line {
        peer: "ffid",
        task: format!("regressor+base parameters+LS, {n} samples"),
        reps: seconds.len(),
        median_s: seconds[seconds.len() / 2],
        min_s: seconds[0],
        max_s: seconds[seconds.len() - 1],
        n_base: line.0,
        condition: line.1,
        error: line.2,
    };
    println!("{}", serde_json::to_string(&line)?);
    Ok(())
}
