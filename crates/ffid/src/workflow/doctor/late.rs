//! A device whose readings are later than the positions, found at the values of a quick fit that does not follow it as it is.
//!
//! The delay is the shift of the readings at which they resemble their prediction most, `max_d sum_k m_k(t + d) p_k(t)` over the channels of the device, both
//! without their means; the prediction is first that of the quick fit of the record as it is, then of one with the delay put right, in turn. It says where a fit
//! may begin: how late the device is, and how well that is known, is for [`super::clocks`].

use super::case::{Case, Scales};
use super::prediction::Prediction;
use super::quick_fit::{FOLLOWS, QuickFit};
use super::sensor_errors::followed;
use core::ops::Range;
use ff_records::Record;
use ff_records::clock::interpolate;
use ident::checks::longest_delay;
use nalgebra::DMatrix;

/// Part of a sample of the thinned record in which delays are looked for.
const STEP: f64 = 0.25;

/// What reads outputs, on one clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Device {
    Gyro,
    Torques,
}

impl Device {
    /// Its columns among torques and gyro.
    fn channels(self, joints: usize) -> Range<usize> {
        match self {
            Device::Gyro => joints..joints + 3,
            Device::Torques => 0..joints,
        }
    }
    /// In words.
    pub(super) fn name(self) -> &'static str {
        match self {
            Device::Gyro => "the gyro",
            Device::Torques => "the torques",
        }
    }
    /// The record with what this reads so many samples earlier.
    fn put_earlier(self, record: &Record, samples: f64) -> Record {
        match self {
            Device::Gyro => record.clone().with_gyro(later(record.gyro(), samples)),
            Device::Torques => record.clone().with_tau(later(record.tau(), samples)),
        }
    }
}

/// Columns as they are so many samples later.
fn later(m: &DMatrix<f64>, samples: f64) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| interpolate(m, j, i as f64 + samples))
}

/// A quick fit of the record with one of its devices put right in time, and how late it is (s); that with the lesser misfit.
pub(super) fn found(case: &Case<'_>, thin: &Record, fit: &QuickFit, start: &[f64]) -> Option<(QuickFit, Device, f64)> {
    let most = longest_delay(thin) / thin.dt();
    let mut best: Option<(QuickFit, Device, f64)> = None;
    for device in [Device::Gyro, Device::Torques] {
        let samples = |p: &Prediction| late(p, &device.channels(thin.joints()), most);
        let right = |samples: &f64| (device.put_earlier(thin, *samples), Scales::none(case));
        let Some((own, samples)) = followed(case, thin, (&fit.values, start), samples, right) else { continue };
        if best.as_ref().is_none_or(|b| own.misfit < b.0.misfit) {
            best = Some((own, device, samples * thin.dt()));
        }
        if best.as_ref().is_some_and(|b| b.0.misfit < FOLLOWS) {
            break;
        }
    }
    best
}

/// Samples by which these channels are later than their prediction.
fn late(of: &Prediction, channels: &Range<usize>, most: f64) -> Option<f64> {
    let steps = (most / STEP).floor() as i32;
    let alike = |n: i32| -> f64 {
        let shift = STEP * f64::from(n);
        let one = |k: usize| {
            let at = |i: usize| of.predicted[(i, k)] * interpolate(&of.measured, k, i as f64 + shift);
            (0..of.measured.nrows()).map(at).sum::<f64>() / of.sigma[k].powi(2)
        };
        channels.clone().map(one).sum()
    };
    let best = (-steps..=steps).map(|n| (n, alike(n))).max_by(|a, b| a.1.total_cmp(&b.1))?.0;
    let (before, at, after) = (alike(best - 1), alike(best), alike(best + 1));
    // The top of the parabola through the three.
    let bend = before - 2.0 * at + after;
    let aside = if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    let samples = STEP * (f64::from(best) + aside);
    samples.is_finite().then_some(samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_is_that_which_was_made() {
        // Two joints and the gyro.
        let at = |i: f64, k: usize| (0.21 * i * (1.0 + 0.3 * k as f64) + k as f64).sin();
        let p = DMatrix::from_fn(400, 5, |i, k| at(i as f64, k));
        for (device, delay) in [(Device::Gyro, 2.37), (Device::Torques, -1.64)] {
            let own = device.channels(2);
            let m = DMatrix::from_fn(400, 5, |i, k| at(i as f64 - if own.contains(&k) { delay } else { 0.0 }, k));
            let of =
                Prediction { residuals: Vec::new(), measured: m.clone(), predicted: p.clone(), sigma: vec![1e-3; 5] };
            let samples = late(&of, &own, 9.0).unwrap();
            assert!((samples - delay).abs() < 0.02, "{samples} instead of {delay}");
            let right = later(&m, delay);
            let worst = (5..390)
                .flat_map(|i| own.clone().map(move |k| (i, k)))
                .map(|at| (right[at] - p[at]).abs())
                .fold(0.0, f64::max);
            assert!(worst < 5e-3, "{worst}");
        }
    }
}
