//! A device whose readings are later than the positions, found at the values of a quick fit that does not follow it as it is.
//!
//! The delay is the shift of the readings at which they resemble their prediction most, `max_d sum_k m_k(t + d) p_k(t)` over the channels of the device, both
//! without their means; the prediction is first that of the quick fit of the record as it is, then of one with the delay put right, in turn. It says where a fit
//! may begin: how late the device is, and how well that is known, is for [`super::clocks`].

use super::case::Case;
use super::device::{Device, later};
use super::mismatch::Output;
use super::prediction::Prediction;
use super::quick_fit::{FOLLOWS, QuickFit};
use super::sensor_errors::followed;
use ff_records::Record;

/// Longest delay looked for (s), and as a part of the record.
const LATEST: (f64, f64) = (0.25, 0.03);
/// Part of a sample of the thinned record in which delays are looked for.
const STEP: f64 = 0.25;

/// A quick fit of the record with one of its devices put right in time, and how late it is (s); that with the lesser misfit.
pub(super) fn found(case: &Case<'_>, thin: &Record, fit: &QuickFit, start: &[f64]) -> Option<(QuickFit, Device, f64)> {
    let most = LATEST.0.min(LATEST.1 * thin.seconds()) / thin.dt();
    let mut best: Option<(QuickFit, Device, f64)> = None;
    for device in [Device::Gyro, Device::Torques] {
        let Some((own, Output::Late { samples, .. })) =
            followed(case, thin, (&fit.values, start), &|p, joints| late(p, joints, device, most))
        else {
            continue;
        };
        if best.as_ref().is_none_or(|b| own.misfit < b.0.misfit) {
            best = Some((own, device, samples * thin.dt()));
        }
        if best.as_ref().is_some_and(|b| b.0.misfit < FOLLOWS) {
            break;
        }
    }
    best
}

fn late(of: &Prediction, joints: usize, device: Device, most: f64) -> Option<Output> {
    let channels = device.channels(joints);
    let steps = (most / STEP).floor() as i32;
    let alike = |n: i32| -> f64 {
        let shift = STEP * f64::from(n);
        channels
            .clone()
            .map(|k| later(of.measured.column(k), shift).dot(&of.predicted.column(k)) / of.sigma[k].powi(2))
            .sum()
    };
    let best = (-steps..=steps).map(|n| (n, alike(n))).max_by(|a, b| a.1.total_cmp(&b.1))?.0;
    let (before, at, after) = (alike(best - 1), alike(best), alike(best + 1));
    // The top of the parabola through the three.
    let bend = before - 2.0 * at + after;
    let aside = if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    let samples = STEP * (f64::from(best) + aside);
    samples.is_finite().then_some(Output::Late { device, samples })
}

#[cfg(test)]
mod tests {
    use super::super::device::put_earlier;
    use super::*;
    use nalgebra::DMatrix;

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
            let Some(Output::Late { samples, .. }) = late(&of, 2, device, 9.0) else { panic!("none") };
            assert!((samples - delay).abs() < 0.02, "{samples} instead of {delay}");
            let mut right = m;
            put_earlier(&mut right, 2, device, delay);
            let worst = (5..390)
                .flat_map(|i| (0..5).map(move |k| (i, k)))
                .map(|at| (right[at] - p[at]).abs())
                .fold(0.0, f64::max);
            assert!(worst < 5e-3, "{worst}");
        }
    }
}
