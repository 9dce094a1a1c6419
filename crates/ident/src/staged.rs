//! From a rough start to the answer: a cheap pass over several starts, then the whole record from the one that explains it.
//!
//! Output error far from the truth has valleys that lead nowhere: predicted and measured oscillations slip by a period. Where
//! the residuals are in units of declared noise, such an end is recognised: it leaves `chi^2` per degree of freedom far above 1.
//! Starts are tried in order, on a coarse estimator (a thinned record), until one explains its data; the fine estimator
//! takes over from there, or from the best of all when none does.

use crate::estimator::{Estimate, EstimateError, Estimator, Request, estimate};

/// One start that was tried on the coarse estimator.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Trial {
    /// Which of the starts.
    pub start: usize,
    /// Linearisations.
    pub iterations: usize,
    /// `chi^2` per degree of freedom that it left; none when it failed.
    pub chi2_per_dof: Option<f64>,
}

/// The result of [`estimate_staged`].
#[derive(Clone, Debug)]
pub struct Staged {
    /// Of the fine estimator.
    pub estimate: Estimate,
    /// Every start that was tried, in order.
    pub trials: Vec<Trial>,
    /// Whether the start that was taken explained the coarse data.
    pub explained: bool,
}

/// Tries `starts` on `coarse` with `first`, and goes on from the first that leaves `chi^2` per degree of freedom at most
/// `accept` on `fine` with `then` (whose own `start` is not used, nor is that of `first`). Allocates.
///
/// # Errors
/// [`EstimateError`]: that of the last start when all fail, or that of the fine estimator.
///
/// # Panics
/// Never; without starts, that of `then` is the only one.
pub fn estimate_staged(
    (first, coarse): (&Request<'_>, &mut dyn Estimator),
    (then, fine): (&Request<'_>, &mut dyn Estimator),
    starts: &[Vec<f64>],
    accept: f64,
) -> Result<Staged, EstimateError> {
    let mut trials = Vec::new();
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut failed = None;
    for (k, start) in starts.iter().enumerate() {
        let tried = estimate(&Request { start, ..first.clone() }, coarse);
        let e = match tried {
            Ok(e) => e,
            Err(e) => {
                trials.push(Trial { start: k, iterations: 0, chi2_per_dof: None });
                failed = Some(e);
                continue;
            }
        };
        trials.push(Trial { start: k, iterations: e.iterations, chi2_per_dof: Some(e.chi2_per_dof) });
        if best.as_ref().is_none_or(|b| e.chi2_per_dof < b.0) {
            best = Some((e.chi2_per_dof, e.values));
        }
        if best.as_ref().is_some_and(|b| b.0 <= accept) {
            break;
        }
    }
    let (left, start) = match (best, failed) {
        (Some(b), _) => b,
        (None, Some(e)) => return Err(e),
        (None, None) => (f64::INFINITY, then.start.to_vec()),
    };
    let estimate = estimate(&Request { start: &start, ..then.clone() }, fine)?;
    Ok(Staged { estimate, trials, explained: left <= accept })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lm::EvalError;
    use ff_model::ParamDecl;
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
        let s = estimate_staged((&request, &mut Tone { every: 4 }), (&request, &mut Tone { every: 1 }), &starts, 1.5)
            .unwrap();
        assert_eq!((s.trials.len(), s.explained), (3, true), "{:?}", s.trials);
        assert!(s.trials[0].chi2_per_dof.is_some_and(|c| c > 10.0));
        assert!((s.estimate.values[0] - 2.1).abs() < 1e-9 && (s.estimate.values[1] - 1.3).abs() < 1e-9);
        assert_eq!(s.estimate.residuals.len(), 400);
        let lost =
            estimate_staged((&request, &mut Tone { every: 4 }), (&request, &mut Tone { every: 1 }), &starts[..2], 1.5)
                .unwrap();
        assert!(!lost.explained && lost.estimate.chi2_per_dof > 10.0);
    }
}
