//! States of our own, for when those of the peers are not at hand.

use crate::models;
use crate::models::{Form, Name};
use crate::states::Sample;
use ff_model::Model;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Arguments of `states`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder to write rigid.txt, flex.txt and slosh.txt to
    dir: PathBuf,
    /// States per model
    #[arg(long, default_value_t = 1000)]
    count: usize,
}

/// Writes the files.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    std::fs::create_dir_all(&args.dir)?;
    for name in Name::ALL {
        let model = models::build(name, Form::Ports)?.model;
        let mut text = format!("{} {} {}\n", model.nv() + 1, model.nv(), args.count);
        for s in samples(&model, args.count) {
            let numbers = s.q.iter().chain(&s.v).chain(&s.a).chain(&s.tau);
            for (i, x) in numbers.enumerate() {
                // Shortest text that reads back to the same bits.
                write!(text, "{}{x}", if i > 0 { " " } else { "" })?;
            }
            text.push('\n');
        }
        std::fs::write(args.dir.join(format!("{}.txt", name.text())), text)?;
    }
    Ok(())
}

/// Random states from a fixed seed, drawn from the ranges of `peers/src/make_states.py`.
pub(crate) fn samples(model: &Model, count: usize) -> Vec<Sample> {
    let mut r = ChaCha8Rng::seed_from_u64(20_130_900 + model.nv() as u64);
    (0..count).map(|_| sample(model, &mut r)).collect()
}

fn sample(model: &Model, r: &mut ChaCha8Rng) -> Sample {
    let (nj, np, nv) = (model.nj(), model.np(), model.nv());
    let mut uniform = |n: usize, bound: f64| -> Vec<f64> { (0..n).map(|_| r.random_range(-bound..bound)).collect() };
    // A direction in the ball is uniform on the sphere.
    let quaternion = loop {
        let q = uniform(4, 1.0);
        let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (0.1..=1.0).contains(&norm) {
            break q.iter().map(|x| x / norm).collect::<Vec<f64>>();
        }
    };
    Sample {
        q: [uniform(3, 1.0), quaternion, uniform(nj, 2.5), uniform(np, 0.5)].concat(),
        v: [uniform(3, 1.0), uniform(3, 0.5), uniform(nj + np, 1.0)].concat(),
        a: uniform(nv, 1.0),
        tau: uniform(nv, 10.0),
    }
}
