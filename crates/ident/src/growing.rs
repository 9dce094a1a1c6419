//! Fits of longer and longer beginnings of a record, each from where the last one ended.
//!
//! The cost over a long record of an oscillation has many minima in its frequency: a start that is off by more than about half
//! a period over the record slips a cycle, and the fit ends with a spring that is far too stiff or too soft. Over a beginning of
//! the record the same start is within half a period. Every fit brings the frequency closer, so that the next, longer one
//! starts in the valley of the truth (multiple-length, or progressive, fitting; cf. L. Ljung, *System Identification*, 1999,
//! sec. 10.5 on local minima).
//!
//! A beginning tells less than the whole, so the fits of beginnings are held near the start by a prior of the given relative
//! width. The last fit is that of the whole record and of the request alone.

use crate::estimator::{Estimate, EstimateError, Estimator, Request, estimate};
use crate::lm::Settings;

/// Iterations spent on a beginning: it only has to come near.
const FEW: usize = 15;
/// Relative gain below which a beginning is left.
const NEAR: f64 = 1e-4;

/// Fits `beginnings` (shortest first) under a prior of relative width `width` around the start, then `whole` as requested.
/// The nuisance unknowns start from zero each time. [`Estimate::iterations`] counts all. Allocates as [`estimate`].
///
/// # Errors
/// Those of the last fit; a beginning that cannot be fitted is passed over. [`EstimateError::Width`].
pub fn estimate_growing<E: Estimator + ?Sized>(
    request: &Request<'_>,
    width: f64,
    beginnings: &mut [Box<dyn Estimator + '_>],
    whole: &mut E,
) -> Result<Estimate, EstimateError> {
    if !(width > 0.0 && width.is_finite()) {
        return Err(EstimateError::Width(width));
    }
    let mut start = request.start.to_vec();
    let mut spent = 0;
    for beginning in beginnings {
        let settings = Settings {
            max_iterations: FEW.min(request.settings.max_iterations),
            decrement_tolerance: NEAR.max(request.settings.decrement_tolerance),
            ..request.settings.clone()
        };
        // The prior stays where the request starts, although the fit begins where the last one ended.
        let near = Near { request, width, settings };
        if let Ok(e) = near.fit(&start, beginning.as_mut()) {
            spent += e.iterations;
            start = e.values;
        }
    }
    let mut e = estimate(&Request { start: &start, centre: Some(request.start), ..request.clone() }, whole)?;
    for (p, &i) in e.parameters.iter_mut().zip(request.selected) {
        p.start = request.start[i];
    }
    e.iterations += spent;
    Ok(e)
}

/// A fit of a beginning.
struct Near<'a, 'r> {
    request: &'a Request<'r>,
    width: f64,
    settings: Settings,
}

impl Near<'_, '_> {
    fn fit(&self, start: &[f64], estimator: &mut (dyn Estimator + '_)) -> Result<Estimate, EstimateError> {
        let own = self.request.prior_width.map_or(self.width, |w| w.min(self.width));
        let request = Request {
            start,
            centre: Some(self.request.start),
            prior_width: Some(own),
            anchor: None,
            settings: self.settings.clone(),
            ..self.request.clone()
        };
        estimate(&request, estimator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lm::EvalError;
    use ff_model::ParamDecl;
    use nalgebra::DMatrix;

    /// `sin(w t)` over a number of samples.
    struct Tone {
        samples: usize,
    }

    const TRUTH: f64 = 2.3;

    impl Estimator for Tone {
        fn rows(&self) -> usize {
            self.samples
        }
        fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
            for (i, r) in r.iter_mut().enumerate() {
                let t = 0.05 * i as f64;
                *r = ((p[0] * t).sin() - (TRUTH * t).sin()) / 0.01;
            }
            Ok(())
        }
        fn jacobian(
            &mut self,
            p: &[f64],
            extra: &[f64],
            _: &[usize],
            r: &mut [f64],
            j: &mut DMatrix<f64>,
        ) -> Result<(), EvalError> {
            self.residuals(p, extra, r)?;
            for i in 0..r.len() {
                let t = 0.05 * i as f64;
                j[(i, 0)] = t * (p[0] * t).cos() / 0.01;
            }
            Ok(())
        }
    }

    #[test]
    fn a_cycle_is_not_slipped() {
        let decls = [ParamDecl::positive("w", "rad/s", TRUTH)];
        // Forty seconds: half a period over the record is 0.08 rad/s; the start is 0.6 off.
        let start = [TRUTH + 0.6];
        let request = Request::new(&decls, &[0], &start);
        let slipped = estimate(&request, &mut Tone { samples: 800 }).unwrap();
        assert!((slipped.values[0] - TRUTH).abs() > 0.05, "{:?}", slipped.values);
        let part = |samples| -> Box<dyn Estimator> { Box::new(Tone { samples }) };
        let mut parts = [part(60), part(200)];
        let e = estimate_growing(&request, 0.5, &mut parts, &mut Tone { samples: 800 }).unwrap();
        assert!((e.values[0] - TRUTH).abs() < 1e-9 && e.status.is_converged(), "{:?}", e.values);
        assert_eq!(e.parameters[0].start, start[0]);
        assert!(matches!(
            estimate_growing(&request, 0.0, &mut [], &mut Tone { samples: 800 }),
            Err(EstimateError::Width(_))
        ));
    }
}
