//! `cargo xtask study nist`: the solver on NIST's Statistical Reference Datasets.
//!
//! All 27 problems of nonlinear regression from both starts ([`validate::nist`]). Digits are those of the worst parameter,
//! at most eleven. A false success is a fit that says it has converged with fewer than four digits.

use super::figures::{Op, Study};
use super::options::Options;
use super::trials::{Number, Trials};
use crate::workspace;
use ff_least_squares::{EvalError, LmError, Problem, Settings, minimise};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use validate::nist;
use validate::nist::problems;

struct Fit<'a>(&'a nist::Problem);

impl Problem for Fit<'_> {
    fn dim(&self) -> usize {
        self.0.certified.len()
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        self.0.residuals(x, r);
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        self.0.jacobian(x, r, j);
        Ok(())
    }
}

/// What came of one problem from one start.
#[derive(Serialize, Deserialize)]
struct Outcome {
    digits: Number,
    converged: bool,
    evaluations: usize,
    status: String,
}

/// Runs the study.
///
/// # Errors
/// Files that cannot be read.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("nist", options.seed);
    let trials = Trials::open("nist", 1, options)?;
    let problems = problems(&workspace::root()?.join("fixtures/nist"))?;
    // A trial is a problem with one of its starts.
    let all: Vec<(&nist::Problem, usize)> =
        problems.iter().flat_map(|p| (0..p.starts.len()).map(move |k| (p, k))).collect();
    let outcomes = trials.run("all", 0..all.len() as u64, |t| {
        let (p, k) = all[t.number as usize];
        one(p, &p.starts[k])
    })?;
    let (mut reached, mut false_success, mut sum, mut count) = ([0, 0], 0, 0.0, 0.0);
    let (need, mut evaluations) = ([4.0, 6.0], 0);
    for (&(p, k), o) in all.iter().zip(&outcomes) {
        let digits = o.digits.0;
        false_success += usize::from(o.converged && digits < 4.0);
        evaluations += o.evaluations;
        reached[k] += usize::from(digits >= need[k]);
        sum += digits;
        count += 1.0;
        study.note(format!("{:9} start {}: {digits:4.1} digits, {}", p.name, k + 1, o.status));
    }
    trials.note().into_iter().for_each(|n| study.note(n));
    study.limited("start_1.reached_4_digits", "", reached[0] as f64, Op::AtLeast, 24.0);
    study.limited("start_2.reached_6_digits", "", reached[1] as f64, Op::AtLeast, 27.0);
    study.limited("false_success", "", false_success as f64, Op::AtMost, 0.0);
    study.limited("mean_digits", "", sum / count, Op::AtLeast, 9.0);
    study.figure("evaluations", "", evaluations as f64);
    Ok(study)
}

fn one(p: &nist::Problem, start: &[f64]) -> anyhow::Result<Outcome> {
    // Certification asks for digits, not for a fraction of a standard deviation.
    let settings =
        Settings { decrement_tolerance: 1e-24, step_tolerance: 0.0, max_iterations: 2000, ..Settings::default() };
    match minimise(&mut Fit(p), start, &settings) {
        Ok(s) => Ok(Outcome {
            digits: Number(p.worst_digits(&s.x)),
            converged: s.status.is_converged(),
            evaluations: s.evaluations,
            status: format!("{:?}, {} evaluations", s.status, s.evaluations),
        }),
        Err(e @ LmError::NonFiniteResidual { .. }) => {
            Ok(Outcome { digits: Number(0.0), converged: false, evaluations: 0, status: e.to_string() })
        }
        Err(e) => Err(e.into()),
    }
}
