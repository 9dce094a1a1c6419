//! Whether the record begins at rest (row D30).
//!
//! The rate of a joint at the first sample is that of a cubic through the first quarter of a second: a motion that starts from rest with
//! whatever acceleration has none. Base and appendages are judged while the joints stand still at the beginning.

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use super::prediction::Prediction;
use ff_model::diagnostics::{Limit, list};
use ff_model::{Area, JointKind, Problem};
use ff_records::Record;
use nalgebra::{DMatrix, DVector};

/// Length of the beginning (s), and its fewest samples.
const BEGINNING: f64 = 0.25;
const FEWEST: usize = 12;
/// Rates at the first sample below this part of the largest one count as rest, and below so many standard deviations.
const PART: f64 = 0.05;
const SURE: f64 = 6.0;
/// A joint stands still while it stays within so many standard deviations, or steps, of where it began.
const STILL: f64 = 6.0;
/// Fewest samples of a beginning at rest that the gyro is judged by.
const LEAST_STILL: usize = 20;
/// The gyro moves before the joints do when its deviation there is this many times its noise, and what was predicted.
const LOUD: f64 = 5.0;
/// Rate of the base at the first samples (rad/s) that is no bias of a gyro.
const TURNS: f64 = 5e-3;

/// Rate of `q` at its first sample (per s) by a cubic through `m` samples, and its standard deviation for noise `sigma`.
fn first_rate(q: &[f64], dt: f64, sigma: f64) -> Option<(f64, f64)> {
    // Times in units of the window, so that powers stay near one.
    let span = (q.len() - 1) as f64;
    let a = DMatrix::from_fn(q.len(), 4, |i, p| (i as f64 / span).powi(p as i32));
    let normal = (a.tr_mul(&a)).cholesky()?;
    let x = normal.solve(&a.tr_mul(&DVector::from_column_slice(q)));
    let variance = normal.inverse()[(1, 1)];
    let seconds = span * dt;
    Some((x[1] / seconds, sigma * variance.sqrt() / seconds))
}

/// Joints whose rate at the first sample is not that of rest: index, rate, bound.
fn moving(case: &Case<'_>) -> Vec<(usize, f64, f64)> {
    let r = case.record;
    let m = ((BEGINNING / r.dt()) as usize).max(FEWEST).min(r.samples());
    let mut out = Vec::new();
    for j in 0..r.joints() {
        let q: Vec<f64> = r.q().column(j).iter().copied().collect();
        let span = 10.min(q.len() - 1).max(1);
        let most = (span..q.len()).map(|i| (q[i] - q[i - span]).abs()).fold(0.0, f64::max) / (span as f64 * r.dt());
        let sigma = case.level.position[j].max(case.level.position_step[j]);
        let Some((rate, deviation)) = first_rate(&q[..m], r.dt(), sigma) else { continue };
        let bound = (PART * most).max(SURE * deviation);
        // What is left of a joint that never moves is rounding.
        if most > 0.0 && rate.abs() > bound {
            out.push((j, rate, bound));
        }
    }
    out
}

/// Samples at the beginning during which no joint moves.
fn still(case: &Case<'_>) -> usize {
    let r: &Record = case.record;
    let moved = |i: usize| {
        (0..r.joints()).any(|j| {
            let bound = (STILL * case.level.position[j]).max(1.5 * case.level.position_step[j]).max(1e-12);
            (r.q()[(i, j)] - r.q()[(0, j)]).abs() > bound
        })
    };
    (0..r.samples()).find(|&i| moved(i)).unwrap_or(r.samples())
}

pub(super) fn findings(case: &Case<'_>, predicted: Option<&Prediction>, starts_in_motion: bool) -> Vec<Finding> {
    let r = case.record;
    let warn = |text: String, measured: f64, expected: f64, unit: &'static str| {
        let p = Problem::warning(Area::Data, "Data::NotAtRest", text.clone())
            .on(case.label)
            .violating(measured, Limit::AtMost(expected), unit)
            .hint("give --initial-state, or begin to record before the motion");
        case.finding(Topic::Rest, Judgement::Suspicious, text).figures(measured, expected, unit).raising(p)
    };
    let moving = moving(case);
    if let Some(&(j, rate, bound)) = moving.iter().max_by(|a, b| (a.1.abs() / a.2).total_cmp(&(b.1.abs() / b.2))) {
        let slides = case.model.own_body(j).joint.kind == JointKind::Prismatic;
        let unit = if slides { "m/s" } else { "rad/s" };
        let names: Vec<&str> = moving.iter().map(|m| r.joint_names()[m.0].as_str()).collect();
        let text = format!(
            "the record begins with {} moving; {} at {:.3e} {unit}, limit {bound:.3e} {unit}",
            list(names.iter().copied(), 6),
            r.joint_names()[j],
            rate.abs()
        );
        return vec![warn(text, rate.abs(), bound, unit)];
    }
    if starts_in_motion {
        let text = "torques and gyro are those of a base or appendages that move at the first sample".to_owned();
        return vec![warn(text, 1.0, 0.0, "")];
    }
    let nj = r.joints();
    // The first half: joints that begin to move pass below the noise of their encoders for a while.
    let quiet = still(case) / 2;
    if quiet >= LEAST_STILL && !r.is_fixed_base() {
        for k in 0..3 {
            let of = |m: &DMatrix<f64>, column: usize| {
                let c = m.view((0, column), (quiet, 1));
                let mean = c.mean();
                (c.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / quiet as f64).sqrt()
            };
            let measured = of(r.gyro(), k);
            let noise = case.level.gyro[k].max(case.settings.noise.gyro).max(case.level.gyro_step[k]);
            let expected = predicted.map_or(0.0, |p| of(&p.predicted, nj + k));
            let bound = LOUD * noise.max(expected);
            if measured > bound {
                let text = format!(
                    "base or appendages move before the joints do: gyro.{} changes by {measured:.3e} rad/s in the first {:.2} s, limit \
                     {bound:.3e} rad/s",
                    ["x", "y", "z"][k],
                    quiet as f64 * r.dt()
                );
                return vec![warn(text, measured, bound, "rad/s").on(format!("gyro.{}", ["x", "y", "z"][k]))];
            }
        }
    }
    let first = r.gyro().rows(0, FEWEST.min(r.samples()));
    let rate = (0..3).map(|k| first.column(k).mean().abs()).fold(0.0, f64::max);
    let range = (0..3).map(|k| r.gyro().column(k).max() - r.gyro().column(k).min()).fold(0.0, f64::max);
    let bound = TURNS.max(0.5 * range) + case.sensors.gyro.bias_rad_per_s.abs();
    if rate > bound {
        let text = format!(
            "the gyro reads {rate:.3e} rad/s at the first samples, limit {bound:.3e} rad/s: does the base turn?"
        );
        return vec![warn(text, rate, bound, "rad/s").on("gyro")];
    }
    vec![case.finding(Topic::Rest, Judgement::Good, "the record begins at rest")]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_from_rest_has_no_rate_whatever_its_acceleration() {
        let q = |f: &dyn Fn(f64) -> f64| (0..15).map(|i| f(i as f64 * 0.02)).collect::<Vec<_>>();
        let rate = |q: Vec<f64>| first_rate(&q, 0.02, 1e-5).unwrap().0;
        assert!(rate(q(&|t| 0.4 + 0.3 * t * t - 0.1 * t.powi(3))).abs() < 1e-12);
        assert!((rate(q(&|t| 0.4 - 0.07 * t + 0.3 * t * t)) + 0.07).abs() < 1e-12);
    }
}
