//! `cargo xtask study nist`: the solver on NIST's Statistical Reference Datasets.
//!
//! All 27 problems of nonlinear regression from both starts ([`validate::nist`]). Digits are those of the worst parameter,
//! at most eleven. A false success is a fit that says it has converged with fewer than four digits.

use super::{Op, Options, Study};
use crate::workspace;
use ff_least_squares::{EvalError, LmError, Problem, Settings, minimise};
use nalgebra::DMatrix;
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

/// Runs the study.
///
/// # Errors
/// Files that cannot be read.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("nist", options.seed);
    let folder = workspace::root()?.join("fixtures/nist");
    // Certification asks for digits, not for a fraction of a standard deviation.
    let settings =
        Settings { decrement_tolerance: 1e-24, step_tolerance: 0.0, max_iterations: 2000, ..Settings::default() };
    let (mut reached, mut false_success, mut sum, mut count) = ([0, 0], 0, 0.0, 0.0);
    let (need, mut evaluations) = ([4.0, 6.0], 0);
    for p in problems(&folder)? {
        for (k, start) in p.starts.iter().enumerate() {
            let (digits, status) = match minimise(&mut Fit(&p), start, &settings) {
                Ok(s) => {
                    let digits = p.worst_digits(&s.x);
                    false_success += usize::from(s.status.is_converged() && digits < 4.0);
                    evaluations += s.evaluations;
                    (digits, format!("{:?}, {} evaluations", s.status, s.evaluations))
                }
                Err(e @ LmError::NonFiniteResidual { .. }) => (0.0, e.to_string()),
                Err(e) => return Err(e.into()),
            };
            reached[k] += usize::from(digits >= need[k]);
            sum += digits;
            count += 1.0;
            study.note(format!("{:9} start {}: {digits:4.1} digits, {status}", p.name, k + 1));
        }
    }
    study.limited("start_1.reached_4_digits", "", reached[0] as f64, Op::AtLeast, 24.0);
    study.limited("start_2.reached_6_digits", "", reached[1] as f64, Op::AtLeast, 27.0);
    study.limited("false_success", "", false_success as f64, Op::AtMost, 0.0);
    study.limited("mean_digits", "", sum / count, Op::AtLeast, 9.0);
    study.figure("evaluations", "", evaluations as f64);
    Ok(study)
}
