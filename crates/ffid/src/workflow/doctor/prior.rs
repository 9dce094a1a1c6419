//! The values of the mission against the record, and where a quick fit takes them.

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use super::prediction::Prediction;
use super::quick_fit::{FOLLOWS, QuickFit};
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem};

/// Misfit above which a quick fit is so far from the record, a tenth of the signals and more, that something is missing or turned.
pub(super) const FAR_OFF: f64 = 5.0;

/// Chi-squared per degree of freedom of the mission's values; what it is, and no judgement: that the values are wrong is why there is a fit.
/// Suspicious where a quick fit from them does not come near the record, and nothing else that was found is why.
pub(super) fn finding(case: &Case<'_>, p: &Prediction, fit: &QuickFit, explained: bool) -> Finding {
    let samples = case.record.samples();
    let mut squares = 0.0;
    let mut worst = (0.0, String::new());
    let names = case.record.response_names();
    for (k, name) in names.iter().enumerate() {
        let left: f64 = (p.predicted.column(k) - p.measured.column(k)).norm_squared() / p.sigma[k].powi(2);
        squares += left;
        let over = (left / samples as f64).sqrt();
        if over > worst.0 {
            worst = (over, name.clone());
        }
    }
    let chi2 = squares / (p.residuals.len() - names.len()).max(1) as f64;
    let moved = |e: &ident::Estimated| (e.value - e.start).abs() / e.start.abs();
    let farthest = fit
        .parameters
        .iter()
        .filter(|e| e.start != 0.0)
        .max_by(|a, b| moved(a).total_cmp(&moved(b)))
        .map_or_else(String::new, |e| format!("; {} moves most, by {:.1} %", e.name, 100.0 * moved(e)));
    let far = if fit.misfit > FOLLOWS {
        ", so that it does not follow the record: the mission is far off, or lacks something that moves"
    } else {
        ""
    };
    let text = format!(
        "with the values of the mission chi-squared per degree of freedom is {chi2:.4} (worst in {}, {:.2} times the noise); a quick fit of {} \
         parameters leaves the misfit {:.3}{far}{farthest}",
        worst.1,
        worst.0,
        fit.parameters.len(),
        fit.misfit
    );
    if fit.misfit <= FAR_OFF || explained {
        return case.finding(Topic::Prior, Judgement::Good, text).figures(chi2, 1.0, "");
    }
    let p = Problem::warning(Area::Data, "Data::NotFollowed", text.clone())
        .on(worst.1)
        .violating(fit.misfit, Limit::AtMost(FAR_OFF), "")
        .hint("compare zeros and axes of the joints with the URDF, and the mission with what moves on the robot; ffid identify names errors that it can fit");
    case.finding(Topic::Prior, Judgement::Suspicious, text).figures(chi2, 1.0, "").raising(p)
}
