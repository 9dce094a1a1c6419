//! What noise alone leaves in the residuals, measured from the readings.
//!
//! A fit that ends with residuals three times the noise of the mission is in the wrong valley, unless the noise is three times what the mission says.
//! Differences of the readings tell the two apart before anything is predicted, so that no time goes into a search for a better valley than the
//! right one. So does noise of the encoders, which the model passes on and no difference of the readings shows: draws of it say what it leaves
//! (`docs/theory/evidence.md`).

use super::evidence::HEARD;
use super::labelled_record::LabelledRecord;
use super::record_estimator::Twin;
use super::row_layout::RowLayout;
use crate::workflow::differences::white_noise;
use nalgebra::{DMatrix, DVectorView};

/// Ratio of measured to stated variance below which the two are one.
const SAME: f64 = 1.1;
/// Factor on what was measured: differences do not know it better.
const MARGIN: f64 = 1.05;

/// Draws of the encoders' noise, where they are not more.
pub(super) const DRAWS: usize = 6;
/// Part of the noise of the sensors from which many draws are worth what they take: then chance along every direction is as much theirs as that of the sensors.
const LOUD: f64 = 0.25;
/// Factor on what draws say of it: they do not know it better, and more would let ends pass that are not at the lowest place.
const ROUGHLY: f64 = 1.05;

/// What noise alone leaves, as mean squared whitened residuals.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct NoiseFloor {
    /// That of torque sensors and gyro: one where it is what was stated, or less.
    pub(super) sensors: f64,
    /// Draws of what the encoders' noise adds to the residuals of each record through the motion, a column each; none where that is little.
    pub(super) drawn: Vec<DMatrix<f64>>,
}

impl NoiseFloor {
    /// Of these records, the deviation of each channel of a sample being `sigma`, without noise of the encoders.
    pub(super) fn of(records: &[LabelledRecord], sigma: &[f64]) -> Self {
        Self { sensors: noise_floor(records, sigma), drawn: Vec::new() }
    }
    /// With noise of the encoders at these parameters of the model. Goes through the records once.
    pub(super) fn at(&self, twins: &[Twin<'_>], values: &[f64]) -> Self {
        let drawn: Option<Vec<_>> = twins.iter().map(|t| t.draws_of_motion(DRAWS, values)).collect();
        let with = Self { sensors: self.sensors, drawn: drawn.unwrap_or_default() };
        if with.encoders() > HEARD { with } else { Self { sensors: self.sensors, drawn: Vec::new() } }
    }
    /// Whether noise of the encoders is loud beside that of the sensors.
    pub(super) fn is_loud(&self) -> bool {
        self.encoders() > LOUD
    }
    /// What noise of the encoders adds to the mean square.
    fn encoders(&self) -> f64 {
        mean_square(&self.drawn)
    }
    /// [`NoiseFloor::total`] with this part of the mean square that is noise of the encoders, where it was looked at.
    pub(super) fn with_motion(&self, encoders: Option<f64>) -> f64 {
        self.sensors + ROUGHLY * encoders.unwrap_or_else(|| self.encoders())
    }
    /// Mean squared residual below which there is nothing but noise, as [`ident::Request::noise`] has it.
    pub(super) fn total(&self) -> f64 {
        self.with_motion(None)
    }
}

/// Mean square of what draws of the encoders' noise add to residuals; zero of none.
pub(super) fn mean_square(drawn: &[DMatrix<f64>]) -> f64 {
    let sum: f64 = drawn.iter().map(DMatrix::norm_squared).sum();
    sum / drawn.iter().map(DMatrix::len).sum::<usize>().max(1) as f64
}

/// Mean squared whitened residual that white noise of the readings leaves of these records, the deviation of each channel of a sample being `sigma`: one
/// where it is what was stated, or less.
fn noise_floor(records: &[LabelledRecord], sigma: &[f64]) -> f64 {
    let (mut sum, mut rows) = (0.0, 0.0);
    for t in records {
        let layout = RowLayout::of(&t.record, sigma.len());
        // Differences of means are of what they follow.
        let averaged = t.record.averaging().is_some();
        for (k, sigma) in sigma.iter().enumerate() {
            let joints = t.record.joints();
            let (data, column) = if k < joints { (t.record.tau(), k) } else { (t.record.gyro(), k - joints) };
            if column >= data.ncols() {
                continue;
            }
            let samples = layout.samples(k) as f64;
            sum += samples * if averaged { 1.0 } else { above_stated(data.column(column).as_view(), *sigma) };
            rows += samples;
        }
    }
    let mean = if rows > 0.0 { sum / rows } else { 1.0 };
    if mean > SAME { MARGIN * mean } else { 1.0 }
}

/// Measured over stated variance of a channel, one at least.
fn above_stated(readings: DVectorView<'_, f64>, sigma: f64) -> f64 {
    let ratio = white_noise(readings).map_or(1.0, |measured| (measured / sigma).powi(2));
    if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::differences::tests::uniform;
    use ff_records::RecordBuilder;
    use nalgebra::DMatrix;

    /// A record of one joint whose torque swings at this frequency (Hz), with white noise on torque and gyro.
    fn record(hz: f64, torque: f64, gyro: f64) -> LabelledRecord {
        let (n, dt) = (3000, 0.02);
        let swing = |i: usize, hz: f64| (std::f64::consts::TAU * hz * i as f64 * dt).sin();
        let q = DMatrix::from_fn(n, 1, |i, _| 0.7 * swing(i, 0.11));
        let tau = DMatrix::from_fn(n, 1, |i, _| 13.0 * swing(i, hz) + torque * uniform(i, 1.3));
        let gyro = DMatrix::from_fn(n, 3, |i, k| 0.02 * swing(i, 0.23) + gyro * uniform(i, 7.1 + k as f64));
        let built = RecordBuilder::new(["elbow"]).uniform(0.0, 1.0 / dt).q(q).tau(tau).gyro(gyro).build();
        let record = built.unwrap().0;
        LabelledRecord { label: "a".into(), record, resampled: (false, false), continues: false, ago: 0 }
    }

    #[test]
    fn noise_that_is_larger_than_was_said_is_measured_and_a_signal_is_not() {
        let sigma = [0.05, 2e-4, 2e-4, 2e-4];
        assert_eq!(noise_floor(&[record(0.31, 0.05, 2e-4)], &sigma), 1.0);
        assert_eq!(noise_floor(&[record(0.31, 0.02, 1e-4)], &sigma), 1.0);
        // Torques seven times as noisy: one channel of four.
        let more = noise_floor(&[record(0.31, 0.35, 2e-4)], &sigma);
        assert!((more / (MARGIN * (49.0 + 3.0) / 4.0) - 1.0).abs() < 0.06, "{more}");
        // A mode of 9 Hz at 50 samples per second leaves differences of every order.
        assert_eq!(noise_floor(&[record(9.0, 0.05, 2e-4)], &sigma), 1.0);
    }
}
