//! Sensors at the end of their range, with noise on top: readings stay where they are while the prediction goes on.
//!
//! Readings at exactly one value are found by reading. Here a straight line through the readings well inside the range makes the prediction
//! comparable, whatever the gain; where it lies above the largest readings, those of a sensor without a limit follow it.

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use super::prediction::Prediction;
use super::quick_fit::QuickFit;
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem};
use nalgebra::DVectorView;

/// Part of the samples that make up the end of the range, and part of the end below which a reading is inside.
const TOP: f64 = 0.02;
const INSIDE: f64 = 0.8;
/// Correlation of readings and prediction inside the range, below which nothing is judged.
const ALIKE: f64 = 0.9;
/// Deviations of what is left inside by which the prediction is beyond the end, and by which it changes there at least.
const BEYOND: f64 = 3.0;
const CHANGES: f64 = 3.0;
/// Deviation of the readings there, over noise, and over that of the prediction, up to which they are flat.
const FLAT: f64 = 2.0;
const FLATTER: f64 = 0.15;
/// Part of the samples that a fit may have at the end of a range, and their number.
const SHARE: f64 = 0.01;
const FEWEST: usize = 20;

/// Readings at the end of a range.
struct End {
    /// Their mean, how many, and the mean prediction.
    at: f64,
    count: usize,
    predicted: f64,
}

fn mean_and_deviation(x: &[f64]) -> (f64, f64) {
    let x = DVectorView::from_slice(x, x.len());
    (x.mean(), x.variance().sqrt())
}

/// The upper end of the range of readings `m` of this noise, where their prediction `p` goes on.
fn upper(m: &[f64], p: &[f64], noise: f64) -> Option<End> {
    let mut sorted = m.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let top = sorted[m.len() - 1 - (TOP * 0.5 * m.len() as f64) as usize];
    let middle = sorted[m.len() / 2];
    let inside = |x: f64| (x - middle).abs() < INSIDE * (top - middle);
    let inner: (Vec<f64>, Vec<f64>) = m.iter().zip(p).filter(|(m, _)| inside(**m)).map(|(m, p)| (*m, *p)).unzip();
    let ((m_mean, m_std), (p_mean, p_std)) = (mean_and_deviation(&inner.0), mean_and_deviation(&inner.1));
    if inner.0.len() < FEWEST || m_std == 0.0 || p_std == 0.0 {
        return None;
    }
    let products = inner.0.iter().zip(&inner.1).map(|(m, p)| (m - m_mean) * (p - p_mean));
    let correlation = products.sum::<f64>() / inner.0.len() as f64 / (m_std * p_std);
    if correlation < ALIKE {
        return None;
    }
    let line = |p: f64| m_mean + correlation * m_std / p_std * (p - p_mean);
    let left = m_std * (1.0 - correlation * correlation).max(0.0).sqrt();
    let bound = top + BEYOND * left.max(noise);
    let beyond: (Vec<f64>, Vec<f64>) =
        m.iter().zip(p).filter(|(_, p)| line(**p) > bound).map(|(m, p)| (*m, line(*p))).unzip();
    if beyond.0.len() < FEWEST {
        return None;
    }
    let ((at, spread), (predicted, changes)) = (mean_and_deviation(&beyond.0), mean_and_deviation(&beyond.1));
    let flat = spread < FLAT * noise || spread < 1e-9 * at.abs();
    (flat && spread < FLATTER * changes.max(predicted - at) && changes > CHANGES * noise).then_some(End {
        at,
        count: beyond.0.len(),
        predicted,
    })
}

fn end(m: DVectorView<'_, f64>, p: DVectorView<'_, f64>, noise: f64) -> Option<End> {
    let (m, p): (Vec<f64>, Vec<f64>) = (m.iter().copied().collect(), p.iter().copied().collect());
    upper(&m, &p, noise).or_else(|| {
        let turned = |x: &[f64]| x.iter().map(|v| -v).collect::<Vec<_>>();
        let lower = upper(&turned(&m), &turned(&p), noise)?;
        Some(End { at: -lower.at, predicted: -lower.predicted, ..lower })
    })
}

/// At the values of the mission, or else at those of a quick fit, whichever bring the rest of a channel to its prediction.
pub(super) fn judged(case: &Case<'_>, nominal: &Prediction, fit: &QuickFit) -> Vec<Finding> {
    let out = findings(case, nominal);
    if !out.is_empty() {
        return out;
    }
    Prediction::at(case, case.record, &fit.values).map_or_else(|_| Vec::new(), |p| findings(case, &p))
}

fn findings(case: &Case<'_>, p: &Prediction) -> Vec<Finding> {
    let (raw, names, nj) = (case.record.responses(), case.record.response_names(), case.record.joints());
    let mut out = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let unit = if k < nj { "N m" } else { "rad/s" };
        let Some(end) = end(raw.column(k), p.predicted.column(k), case.level.of_output(k)) else { continue };
        let share = end.count as f64 / raw.nrows() as f64;
        if share < SHARE {
            continue;
        }
        let text = format!(
            "{} samples ({:.2} %, limit {:.0} %) stay at {:.4e} {unit} while {:.4e} {unit} are predicted: the end of the sensor's range",
            end.count,
            100.0 * share,
            100.0 * SHARE,
            end.at,
            end.predicted
        );
        let problem = Problem::error(Area::Data, "Data::Saturated", text.clone())
            .on(name)
            .violating(share, Limit::AtMost(SHARE), "")
            .hint("excite less, widen the range of the sensor, or cut this part out; to go on, --allow saturated");
        let f = case.finding(Topic::Sensors, Judgement::Wrong, text).on(name);
        out.push(f.figures(share, SHARE, "").raising(problem));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clipped_signal_is_told_from_one_that_the_mission_predicts_too_large() {
        let noise = |i: usize| 0.004 * ((i as f64 * 12.9898).sin() * 43758.5453).fract();
        let p: Vec<f64> =
            (0..900).map(|i| 0.4 * (0.031 * i as f64).sin() + 0.3 * (0.013 * i as f64 + 0.4).sin()).collect();
        let of = |f: &dyn Fn(f64) -> f64| -> Vec<f64> { p.iter().enumerate().map(|(i, v)| f(*v) + noise(i)).collect() };
        let found = upper(&of(&|v| 0.7 * v.min(0.31)), &p, 0.0025).unwrap();
        assert!((found.at - 0.217).abs() < 2e-3 && found.count > 90, "{} {}", found.at, found.count);
        assert!(upper(&of(&|v| 0.7 * v), &p, 0.0025).is_none());
        // Gain that falls with the amplitude, as that of a wrong mission may.
        assert!(upper(&of(&|v| 0.7 * v - 0.3 * v.powi(3)), &p, 0.0025).is_none());
    }
}
