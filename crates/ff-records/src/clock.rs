//! Clocks of the channels: how far torques and gyro lag behind the encoders, and a record put right.

use crate::mask::Mask;
use crate::record::Record;
use ff_model::{Area, Problem, Problems};
use nalgebra::DMatrix;

/// Offset and skew of one group of channels.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ClockEstimate {
    /// How late the channels are at mid-record (s).
    pub offset: f64,
    /// Its standard deviation (s).
    pub offset_deviation: f64,
    /// Relative excess of the channels' clock over the encoders': they grow later by `skew` seconds per second.
    pub skew: f64,
    /// Its standard deviation.
    pub skew_deviation: f64,
    /// Gain of each channel over the prediction.
    pub gain: Vec<f64>,
    /// Misfit over declared noise; well above 1 when the model is rough.
    pub misfit: f64,
}

/// Torque and gyro channels, each against the encoders.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Clocks {
    /// Of the joint torques.
    pub torque: ClockEstimate,
    /// Of the gyro.
    pub gyro: ClockEstimate,
}

/// Four-point Lagrange interpolation of column `j` at sample `at`, held at the ends.
///
/// # Panics
/// If there are fewer than four samples, or there is no column `j`.
pub fn interpolate(m: &DMatrix<f64>, j: usize, at: f64) -> f64 {
    let n = m.nrows();
    let k = (at.floor().max(1.0) as usize).min(n - 3);
    let u = (at - k as f64).clamp(-1.0, 2.0);
    let (a, b, c, d) = (m[(k - 1, j)], m[(k, j)], m[(k + 1, j)], m[(k + 2, j)]);
    -a * u * (u - 1.0) * (u - 2.0) / 6.0 + b * (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0
        - c * (u + 1.0) * u * (u - 2.0) / 2.0
        + d * (u + 1.0) * u * (u - 1.0) / 6.0
}

/// The record with its torque and gyro channels put on the encoders' clock, where they are off by more than half a sample
/// (`Data::ClockOffset`, row D15) or drift by more than that over the record (`Data::ClockSkew`, row D16), each with a
/// warning; and which samples count afterwards: those at the ends for which there is no reading do not. Allocates.
///
/// # Panics
/// If channels have sample times of their own ([`Record::is_uniform`]).
pub fn correct_clocks(record: &Record, clocks: &Clocks) -> (Record, Mask, Problems) {
    assert!(record.is_uniform(), "all channels on one uniform clock");
    let (mut out, mut problems) = (record.clone(), Problems::default());
    let (n, dt) = (record.samples(), record.dt());
    let mut mask = Mask::all(n, record.joints());
    let mid = 0.5 * (n - 1) as f64 * dt;
    for (group, e) in [("torque", &clocks.torque), ("gyro", &clocks.gyro)] {
        let drift = e.skew * (n - 1) as f64 * dt;
        let (late, drifts) = (e.offset.abs() > 0.5 * dt, drift.abs() > 0.5 * dt);
        let mut warn = |code, what: String| {
            let hint = "synchronise the clocks; the record was resampled onto that of the encoders";
            problems.push(Problem::warning(Area::Data, code, what).on(group).hint(hint));
        };
        if late {
            warn(
                "Data::ClockOffset",
                format!(
                    "{:.2} ms late (+- {:.2} ms, limit half a sample, {:.2} ms)",
                    1e3 * e.offset,
                    1e3 * e.offset_deviation,
                    500.0 * dt
                ),
            );
        }
        if drifts {
            warn(
                "Data::ClockSkew",
                format!(
                    "{:.1} ppm fast (+- {:.1} ppm), {:.2} ms over the record, limit {:.2} ms",
                    1e6 * e.skew,
                    1e6 * e.skew_deviation,
                    1e3 * drift,
                    500.0 * dt
                ),
            );
        }
        if !(late || drifts) {
            continue;
        }
        let (from, to, weights) = if group == "torque" {
            (record.tau(), &mut out.tau, &mut mask.tau)
        } else {
            (record.gyro(), &mut out.gyro, &mut mask.gyro)
        };
        for i in 0..n {
            let t = i as f64 * dt;
            // y(t') was taken when the encoders' clock stood at t = t' - a - s (t' - T/2).
            let at = (mid + (t - mid + e.offset) / (1.0 - e.skew)) / dt;
            for j in 0..from.ncols() {
                to[(i, j)] = interpolate(from, j, at);
                if !(0.0..=(n - 1) as f64).contains(&at) {
                    weights[(i, j)] = 0.0;
                }
            }
        }
    }
    (out, mask, problems)
}
