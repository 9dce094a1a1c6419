//! Noise and steps of the channels of a record, from the record alone.

use crate::workflow::differences::{by_differences, typical};
use ff_records::Record;
use nalgebra::{DMatrix, DVectorView};

/// Distinct readings of a channel above which it has no steps that matter.
const MOST_LEVELS: usize = 50_000;
/// Deviation of a difference of readings from a multiple of the step, in steps.
const ON_GRID: f64 = 0.02;

/// Noise and steps of the channels of a record: upper bounds of the standard deviations, and steps (0 where there are none).
pub(super) struct Level {
    pub(super) position: Vec<f64>,
    pub(super) position_step: Vec<f64>,
    pub(super) torque: Vec<f64>,
    pub(super) torque_step: Vec<f64>,
    pub(super) gyro: Vec<f64>,
    pub(super) gyro_step: Vec<f64>,
}

impl Level {
    /// Of the positions of a record, and of torques and gyro as their sensors sampled them. `jumps`: torques change at once where a joint turns back, as those of dry friction do.
    pub(super) fn of(r: &Record, tau: &DMatrix<f64>, gyro: &DMatrix<f64>, jumps: bool) -> Self {
        let torque = |m: &DMatrix<f64>| -> Vec<f64> {
            m.column_iter()
                .map(|c| if jumps { typical(c.as_view(), 6) } else { by_differences(c.as_view(), 6) })
                .collect()
        };
        let sixth = |m: &DMatrix<f64>| m.column_iter().map(|c| by_differences(c.as_view(), 6)).collect();
        let steps = |m: &DMatrix<f64>| m.column_iter().map(|c| step(c.as_view())).collect();
        Self {
            position: sixth(r.q()),
            position_step: steps(r.q()),
            torque: torque(tau),
            torque_step: steps(tau),
            gyro: sixth(gyro),
            gyro_step: steps(gyro),
        }
    }
    /// Noise of an output: torques of the joints, then the gyro.
    pub(super) fn of_output(&self, k: usize) -> f64 {
        k.checked_sub(self.torque.len()).map_or_else(|| self.torque[k], |axis| self.gyro[axis])
    }
    /// The step of its readings.
    pub(super) fn step_of_output(&self, k: usize) -> f64 {
        k.checked_sub(self.torque.len()).map_or_else(|| self.torque_step[k], |axis| self.gyro_step[axis])
    }
}

/// The step of the readings: the least difference of sorted values, where all are multiples of it; else 0.
pub(super) fn step(x: DVectorView<'_, f64>) -> f64 {
    let mut all: Vec<f64> = x.iter().copied().collect();
    all.sort_unstable_by(f64::total_cmp);
    all.dedup();
    if all.len() < 3 || all.len() > MOST_LEVELS {
        return 0.0;
    }
    let gaps = || all.windows(2).map(|w| w[1] - w[0]);
    let least = gaps().fold(f64::INFINITY, f64::min);
    let range = all[all.len() - 1] - all[0];
    // Below, digits of the numbers themselves.
    if least <= 1e-13 * range.max(all[0].abs()) {
        return 0.0;
    }
    // Means of the multiples: a step known to a few digits only.
    let (mut sum, mut count) = (0.0, 0.0);
    for gap in gaps() {
        let k = (gap / least).round();
        if k > 1e3 || (gap / least - k).abs() > ON_GRID * k {
            return 0.0;
        }
        (sum, count) = (sum + gap, count + k);
    }
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::differences::tests::noisy;

    #[test]
    fn a_step_is_found_where_readings_have_one() {
        let x = noisy(0.01, |t| (2.0 * t).sin());
        assert_eq!(step(x.as_view()), 0.0);
        let read = x.map(|v| (v / 0.0037).round() * 0.0037);
        assert!((step(read.as_view()) / 0.0037 - 1.0).abs() < 1e-6, "{}", step(read.as_view()));
    }
}
