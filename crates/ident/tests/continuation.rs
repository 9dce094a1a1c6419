//! From a rough start to the answer: a cheap pass over several starts, then the whole record from the one that explains it.

use ff_least_squares::EvalError;
use ff_model::ParamDecl;
use ident::compose::*;
use ident::estimate::Estimator;
use ident::estimate::Request;
use nalgebra::DMatrix;

/// A tone of unknown frequency and amplitude: full of valleys.
struct Tone {
    every: usize,
}
impl Tone {
    fn t(&self, i: usize) -> f64 {
        0.1 * (i * self.every) as f64
    }
}
impl Estimator for Tone {
    fn rows(&self) -> usize {
        400 / self.every
    }
    fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        for (i, r) in r.iter_mut().enumerate() {
            let t = self.t(i);
            *r = (p[1] * (p[0] * t).sin() - 1.3 * (2.1 * t).sin()) / 0.05;
        }
        Ok(())
    }
    fn jacobian(
        &mut self,
        p: &[f64],
        _: &[f64],
        _: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        self.residuals(p, &[], r)?;
        for i in 0..r.len() {
            let t = self.t(i);
            j[(i, 0)] = p[1] * t * (p[0] * t).cos() / 0.05;
            j[(i, 1)] = (p[0] * t).sin() / 0.05;
        }
        Ok(())
    }
}

#[test]
fn starts_that_end_in_a_valley_are_passed_over() {
    let decls = vec![ParamDecl::positive("w", "rad/s", 1.0), ParamDecl::positive("a", "m", 1.0)];
    let request = Request::new(&decls, &[0, 1], &[1.0, 1.0]);
    let starts = vec![vec![0.8, 1.0], vec![3.4, 0.6], vec![2.14, 0.5], vec![2.1, 1.3]];
    let run = |starts: &[Vec<f64>]| {
        let (mut every, mut fourth) = (Tone { every: 1 }, Tone { every: 4 });
        let mut fine = Pass { request: request.clone(), estimator: &mut every };
        let coarse = Pass { request: request.clone(), estimator: &mut fourth };
        estimate_staged(&mut [coarse], &mut fine, starts, Accept { coarse: 1.5, fine: 1.5, agree: 1 }).unwrap()
    };
    let s = run(&starts);
    assert_eq!((s.trials.len(), s.explained), (3, true), "{:?}", s.trials);
    assert!(s.trials[0].chi2_per_dof.is_some_and(|c| c > 10.0));
    assert!((s.estimate.values[0] - 2.1).abs() < 1e-9 && (s.estimate.values[1] - 1.3).abs() < 1e-9);
    assert_eq!(s.estimate.residuals.len(), 400);
    let lost = run(&starts[..2]);
    assert!(!lost.explained && lost.estimate.chi2_per_dof > 10.0);
    let a = Accept::noise(200, 20_000);
    assert!((a.coarse - 1.3).abs() < 1e-12 && (a.fine - 1.03).abs() < 1e-12);
}
