//! Sensors that say nothing: noise, or a step of their readings, where torques or gyro should move.
//!
//! What should move is predicted by the values of the mission, which is believed where most other channels are as it predicts. A channel that
//! holds exactly one value is refused by reading.

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use super::excitation::{quiet_below, travel};
use super::mismatch::distance;
use super::prediction::Prediction;
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem};

/// Predicted travel over that of noise, from which a silent channel is dead.
const SHOULD: f64 = 10.0;
/// Distance below which a channel is as predicted: a factor of two and a half.
const AS_PREDICTED: f64 = 0.35;

pub(super) fn findings(case: &Case<'_>, p: &Prediction) -> Vec<Finding> {
    let (level, nj) = (&case.level, case.record.joints());
    let noise = |k: usize| level.of_output(k);
    let limit = |k: usize, noise: f64| quiet_below(noise, level.step_of_output(k), travel(p.measured.column(k)).1);
    // By the noise of the mission as well: a channel whose unit is wrong has its noise in that unit.
    let should = |k: usize| travel(p.predicted.column(k)).0 > SHOULD * limit(k, noise(k).max(p.sigma[k]));
    let silent = |k: usize| travel(p.measured.column(k)).0 <= limit(k, noise(k));
    let (dead, alive): (Vec<usize>, Vec<usize>) = (0..nj + 3).filter(|&k| should(k)).partition(|&k| silent(k));
    let right = alive.iter().filter(|&&k| distance(p.measured.column(k), p.predicted.column(k)) < AS_PREDICTED).count();
    // What a channel lacks another may have: columns are swapped then.
    let swapped = |k: usize| !silent(k) && travel(p.measured.column(k)).0 > SHOULD * travel(p.predicted.column(k)).0;
    if 2 * right <= alive.len().max(dead.len()) || (0..nj + 3).any(swapped) {
        return Vec::new();
    }
    let names = case.record.response_names();
    let one = |k: usize| {
        let (measured, expected) = (travel(p.measured.column(k)).0, travel(p.predicted.column(k)).0);
        let unit = if k < nj { "N m" } else { "rad/s" };
        let text = format!(
            "reads noise alone: its means change by {measured:.2e} {unit} over the record, {expected:.2e} {unit} are predicted: the sensor is dead"
        );
        let problem = Problem::error(Area::Data, "Data::DeadChannel", text.clone())
            .on(&names[k])
            .violating(measured, Limit::Above(limit(k, noise(k))), unit)
            .hint("check the sensor and its wiring: a channel that says nothing is not that of a base at rest");
        let f = case.finding(Topic::Sensors, Judgement::Wrong, text).on(&names[k]);
        f.figures(measured, expected, unit).raising(problem)
    };
    dead.into_iter().map(one).collect()
}
