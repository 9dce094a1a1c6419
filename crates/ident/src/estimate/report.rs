//! What an identification hands back: numbers with their uncertainty, and a verdict on each.

use crate::belief::covariance::{Direction, Uncertainty};
use crate::belief::prior::Priors;
use ff_least_squares::Status;

/// What the data say about one parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Determined by the data (deviation below its size, and well below that of its prior, if any).
    Estimated,
    /// Determined to worse than its own size.
    Weak,
    /// The deviation is more than nine tenths of the prior's: the value is what was put in.
    PriorOnly,
    /// The fit ended with it at a bound; neither value nor deviation is an estimate.
    AtBound,
    /// Part of a combination on which the data are silent; the value is where the fit started or was led.
    NotIdentifiable,
}

/// One parameter.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value at the start of the fit.
    pub start: f64,
    /// Estimated value.
    pub value: f64,
    /// Standard deviation; none when not identifiable.
    pub deviation: Option<f64>,
    /// 95 % interval `value -+ 1.96 deviation`.
    pub interval95: Option<(f64, f64)>,
    /// Standard deviation of its prior, when it had one.
    pub prior_sigma: Option<f64>,
    /// What the data say.
    pub verdict: Verdict,
}

/// A whole fit.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FitReport {
    /// How the solver ended.
    pub status: Status,
    /// `|r|^2 / (m - n)` of the whitened residuals; about 1 when model and noise are right.
    pub reduced_chi2: f64,
    /// Residuals used.
    pub residuals: usize,
    /// The parameters.
    pub estimates: Vec<Estimate>,
    /// Numerical rank of the scaled sensitivities.
    pub rank: usize,
    /// Their singular values.
    pub singular_values: Vec<f64>,
    /// Combinations on which the data are silent.
    pub null_directions: Vec<Direction>,
    /// Pairs with a correlation of 0.95 or more.
    pub correlations: Vec<(String, String, f64)>,
}

impl FitReport {
    /// Puts together the result of a fit. `start` and `value` are the selected physical values, `at_bound` the
    /// columns held at a bound, `cost` is `|r|^2 / 2`. Allocates.
    ///
    /// # Panics
    /// If `start` or `value` is shorter than the unknowns.
    pub fn new(
        status: Status,
        (cost, residuals): (f64, usize),
        (start, value): (&[f64], &[f64]),
        priors: &Priors,
        u: &Uncertainty,
    ) -> Self {
        let at_bound: &[usize] = if let Status::AtBound { at, .. } = &status { at } else { &[] };
        let estimates = u.unknowns.iter().enumerate().map(|(i, k)| {
            let prior_sigma = priors.rows().iter().find(|r| r.column == i).map(|r| r.sigma);
            let verdict = match u.deviation[i] {
                _ if at_bound.contains(&i) => Verdict::AtBound,
                None => Verdict::NotIdentifiable,
                Some(d) if prior_sigma.is_some_and(|p| d > 0.9 * p) => Verdict::PriorOnly,
                Some(d) if d > k.size => Verdict::Weak,
                Some(_) => Verdict::Estimated,
            };
            Estimate {
                name: k.name.clone(),
                unit: k.unit.clone(),
                start: start[i],
                value: value[i],
                deviation: u.deviation[i],
                interval95: u.deviation[i].map(|d| (value[i] - 1.96 * d, value[i] + 1.96 * d)),
                prior_sigma,
                verdict,
            }
        });
        let estimates = estimates.collect();
        let freedom = residuals.saturating_sub(u.unknowns.len()).max(1);
        Self {
            reduced_chi2: 2.0 * cost / freedom as f64,
            residuals,
            estimates,
            rank: u.rank,
            singular_values: u.singular_values.clone(),
            null_directions: u.null.clone(),
            correlations: u.strong_correlations(0.95),
            status,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::covariance::{Unknown, analyse};
    use crate::belief::prior::Sigma;
    use ff_least_squares::Criterion;
    use ff_model::ParamDecl;
    use nalgebra::DMatrix;

    #[test]
    fn every_verdict_is_told_apart() {
        // Columns: well known, weak, prior only, at bound, silent.
        let mut j = DMatrix::from_fn(30, 5, |i, k| ((0.37 * (k + 1) as f64) * i as f64 + 0.2).sin());
        for (k, s) in [10.0, 1e-2, 1e-3, 10.0, 0.0].into_iter().enumerate() {
            j.column_mut(k).scale_mut(s);
        }
        let names = ["a", "b", "c", "d", "e"];
        let decls: Vec<ParamDecl> = names.iter().map(|n| ParamDecl::positive(*n, "kg", 2.0)).collect();
        let start = [2.0; 5];
        let priors = Priors::new(&decls, &[0, 1, 2, 3, 4], &start, &[("c", Sigma::Relative(0.3))]).unwrap();
        let mut j = j.insert_row(30, 0.0);
        priors.fill_jacobian(&start, &mut j, 30);
        let unknowns: Vec<Unknown> =
            names.iter().map(|n| Unknown { name: (*n).into(), unit: "kg".into(), size: 2.0 }).collect();
        let u = analyse(&j, &unknowns, 1e-9).unwrap();
        let status = Status::AtBound { at: vec![3], by: Criterion::Decrement };
        let r = FitReport::new(status, (13.0, 31), (&start, &[2.1; 5]), &priors, &u);
        let verdicts: Vec<Verdict> = r.estimates.iter().map(|e| e.verdict).collect();
        use Verdict::*;
        assert_eq!(verdicts, [Estimated, Weak, PriorOnly, AtBound, NotIdentifiable]);
        assert!((r.reduced_chi2 - 1.0).abs() < 1e-12 && r.rank == 4);
        assert_eq!(r.null_directions[0].to_string(), "2.000e0 e");
        let text = serde_json::to_string(&r).unwrap();
        assert!(text.contains("\"verdict\":\"not_identifiable\"") && text.contains("\"deviation\":null"));
    }
}
