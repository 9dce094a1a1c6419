//! Modes that stand out of the noise nowhere.
//!
//! Of the many frequencies that a mode might have, noise alone makes one look the best: over `n` lines of a spectrum the cost falls by some `2 ln n` at the
//! highest of its peaks, and the deviation there is that of one line. Where the cost at other frequencies stays so near that of the end of a fit that chance
//! reaches it, all of them are left. With the cost `c_i` at frequencies `f_i`, each of which stands for an interval `h_i`, and the end of the fit a normal density
//! of deviation `s` in frequency, the posterior has
//!
//! ```text
//! w_i = exp(-(c_i - c_0) / 2) h_i / (sqrt(2 pi) s)
//! ```
//!
//! there for one at the end, and the second moment about it is `C + sum_i w_i d_i d_i^T / (1 + sum_i w_i)`, `d_i` being what the unknowns differ by.

use ident::Request;
use ident::estimate::Estimate;
use nalgebra::{DMatrix, DVector};

/// Deviations of the frequency about the end of a fit that its own density covers.
const OWN: f64 = 3.0;

/// A spring whose mode is resolved nowhere, and other places for it.
pub(super) struct Unresolved {
    /// What the unknowns differ by there, and the weight of the place against that of the end.
    places: Vec<(Vec<f64>, f64)>,
}

impl Unresolved {
    /// The spring in this column, the end of the fit, and the places that were looked at on both its sides, in order: cost and values.
    pub(super) fn new(request: &Request<'_>, e: &Estimate, column: usize, seen: Vec<(f64, Vec<f64>)>) -> Self {
        let index = request.selected[column];
        // Frequencies go with the root of a stiffness; one at the end.
        let own = 0.5 * e.parameters[column].std.unwrap_or(f64::INFINITY) / e.values[index];
        let mut looked: Vec<(f64, f64, Vec<f64>)> =
            seen.into_iter().map(|(cost, at)| ((at[index] / e.values[index]).sqrt(), cost, at)).collect();
        looked.sort_by(|a, b| a.0.total_cmp(&b.0));
        let frequency = |k: usize| looked[k].0;
        let last = looked.len().saturating_sub(1);
        let width = |k: usize| 0.5 * (frequency((k + 1).min(last)) - frequency(k.saturating_sub(1)));
        let one = |k: usize| {
            let (frequency, cost, at) = &looked[k];
            let weight = (-0.5 * (cost - e.objective)).exp() * width(k) / ((std::f64::consts::TAU).sqrt() * own);
            let off: Vec<f64> = request.selected.iter().map(|&i| at[i] - e.values[i]).collect();
            ((frequency - 1.0).abs() > OWN * own && weight.is_finite()).then_some((off, weight))
        };
        Self { places: (0..looked.len()).filter_map(one).collect() }
    }
    /// The second moment about the end of the fit that covers the places; `None` where there are none.
    pub(super) fn cover(&self, e: &Estimate) -> Option<DMatrix<f64>> {
        let sum: f64 = self.places.iter().map(|p| p.1).sum();
        let mut covariance = e.uncertainty.covariance.clone();
        let unknowns = covariance.nrows();
        for (off, weight) in &self.places {
            let d = DVector::from_fn(unknowns, |k, _| off.get(k).copied().unwrap_or(0.0));
            covariance += &d * d.transpose() * (weight / (1.0 + sum));
        }
        (sum > 0.0).then_some(covariance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_least_squares::EvalError;
    use ff_model::ParamDecl;
    use ident::Estimator;
    use ident::estimate::attempt;

    const STD: f64 = 37.0;
    /// One reading of each unknown.
    struct Read;
    impl Estimator for Read {
        fn rows(&self) -> usize {
            2
        }
        fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
            (r[0], r[1]) = ((p[0] - 1500.0) / STD, (p[1] - 20.0) / 0.3);
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
            j.copy_from_slice(&[1.0 / STD, 0.0, 0.0, 1.0 / 0.3]);
            self.residuals(p, extra, r)
        }
    }

    #[test]
    fn deviations_cover_places_by_the_intervals_that_they_stand_for() {
        let decls = ["wing.k[0]", "wing.m"].map(|name| ParamDecl::positive(name, "N m/rad", 0.0));
        let request = Request::new(&decls, &[0, 1], &[1400.0, 21.0]);
        let estimate = attempt(&request, &mut Read).unwrap();
        // Frequencies over that of the end, and what the other unknown follows by; one is part of the end itself, and one is nowhere near.
        let place = |f: f64, cost: f64| (estimate.objective + cost, vec![1500.0 * f * f, 20.0 + 4.0 * (f - 1.0)]);
        let seen = vec![place(0.8, 6.1), place(0.9, 7.3), place(1.01, 0.4), place(1.15, 5.2), place(1.3, 90.0)];
        let covariance = Unresolved::new(&request, &estimate, 0, seen).cover(&estimate).unwrap();
        let own = 0.5 * STD / 1500.0 * std::f64::consts::TAU.sqrt();
        let weight = |cost: f64, width: f64| (-0.5 * cost).exp() * width / own;
        let places = [(0.8f64, weight(6.1, 0.05)), (0.9, weight(7.3, 0.105)), (1.15, weight(5.2, 0.145))];
        let sum: f64 = 1.0 + places.iter().map(|p| p.1).sum::<f64>();
        let spread = |of: &dyn Fn(f64) -> f64| places.iter().map(|p| p.1 * of(p.0).powi(2)).sum::<f64>() / sum;
        let (k, m) = (spread(&|f| 1500.0 * (f * f - 1.0)), spread(&|f| 4.0 * (f - 1.0)));
        let std = |k: usize| covariance[(k, k)].sqrt();
        assert!((std(0) / (STD * STD + k).sqrt() - 1.0).abs() < 1e-6, "{}", std(0));
        assert!((std(1) / (0.09 + m).sqrt() - 1.0).abs() < 1e-6, "{}", std(1));
        assert!(k.sqrt() > 2.0 * STD);
    }
}
