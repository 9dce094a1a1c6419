//! Errors of a device by a number that no unit has: a gyro that is mounted at an angle, a gain of the gyro, a common gain of all torques.
//!
//! Asked where no unit, axis or sign explains what a quick fit leaves. With `m` the measured and `p` the predicted rates, both without their
//! means, the turn is the rotation `R` that minimises `sum |m - R p|^2` (Kabsch, Acta Cryst. A32, 1976, 922; by the singular values of
//! `sum m p^T`), a gain is `sum m p / sum p^2`. The prediction is first that of the start, then that of a quick fit of the record with
//! the number put right, in turn.

use super::case::{Case, Scales};
use super::mismatch::{Output, put_right};
use super::motion_error::MotionError;
use super::prediction::Prediction;
use super::quick_fit::{FOLLOWS, QuickFit, quick_fit};
use ff_records::Record;
use nalgebra::{DMatrix, DMatrixView, Matrix3, Rotation3};

/// Angle (rad) and logarithm of a gain below which it is left to the fit, which estimates small ones and states how well.
pub(super) const LEAST_TURN: f64 = 0.1;
pub(super) const LEAST_GAIN: f64 = 0.1;
/// Quick fits for each, at most, and relative fall of the misfit below which there is no need for another.
const ROUNDS: usize = 3;
const SETTLED: f64 = 0.02;
/// Part of the misfit that it may leave.
const UNEXPLAINED: f64 = 0.25;

/// What of these explains the record: the quick fit with it put right, that with the least misfit first.
pub(super) fn found(case: &Case<'_>, thin: &Record, start: &[f64], before: f64) -> Vec<(QuickFit, Output)> {
    let right = |error: &Output| {
        let error = std::slice::from_ref(error);
        (put_right(thin, error), Scales::of(case, MotionError::None, error))
    };
    let of = |number: fn(&Prediction, usize) -> Option<Output>| {
        followed(case, thin, (start, start), |p| number(p, thin.joints()), right)
    };
    let mut out: Vec<(QuickFit, Output)> = [turn, gyro_gain, torque_gain].into_iter().filter_map(of).collect();
    out.retain(|(fit, o)| is_large(o) && fit.misfit < FOLLOWS && fit.misfit < UNEXPLAINED * before);
    out.sort_by(|a, b| a.0.misfit.total_cmp(&b.0.misfit));
    out
}

/// Number and quick fit in turn, until the misfit no longer falls: the number at first by a prediction `at` these values, fits from `start`.
/// `right` is the record with an error put right, and the scales of its channels.
pub(super) fn followed<E>(
    case: &Case<'_>,
    thin: &Record,
    (at, start): (&[f64], &[f64]),
    number: impl Fn(&Prediction) -> Option<E>,
    right: impl Fn(&E) -> (Record, Scales),
) -> Option<(QuickFit, E)> {
    let mut values = at.to_vec();
    let mut best: Option<(QuickFit, E)> = None;
    for _ in 0..ROUNDS {
        let Some(error) = Prediction::coarse_at(case, thin, &values).and_then(|p| number(&p)) else {
            break;
        };
        let (record, scales) = right(&error);
        let Some(fit) = quick_fit(case, &record, &scales, start, false) else { break };
        let left = best.as_ref().map_or(f64::INFINITY, |b| b.0.misfit);
        values.clone_from(&fit.values);
        let settled = fit.misfit > (1.0 - SETTLED) * left;
        if fit.misfit < left {
            best = Some((fit, error));
        }
        if settled {
            break;
        }
    }
    best
}

fn is_large(o: &Output) -> bool {
    match o {
        Output::Turned(rotation) => rotation.angle() > LEAST_TURN,
        Output::GyroGain(gain) | Output::TorqueGain(gain) => gain.ln().abs() > LEAST_GAIN,
        _ => false,
    }
}

fn turn(of: &Prediction, joints: usize) -> Option<Output> {
    let rates = |m: &DMatrix<f64>| m.columns(joints, 3).into_owned();
    let product = rates(&of.measured).tr_mul(&rates(&of.predicted));
    let product = Matrix3::from_fn(|i, j| product[(i, j)]);
    let svd = product.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let proper = Matrix3::from_diagonal(&[1.0, 1.0, (u * v_t).determinant().signum()].into());
    let rotation = Rotation3::from_matrix_unchecked(u * proper * v_t);
    rotation.matrix().iter().all(|x| x.is_finite()).then_some(Output::Turned(rotation))
}

fn gyro_gain(of: &Prediction, joints: usize) -> Option<Output> {
    let gain = gain(of.measured.columns(joints, 3), of.predicted.columns(joints, 3))?;
    Some(Output::GyroGain(gain))
}

fn torque_gain(of: &Prediction, joints: usize) -> Option<Output> {
    let gain = gain(of.measured.columns(0, joints), of.predicted.columns(0, joints))?;
    Some(Output::TorqueGain(gain))
}

fn gain(m: DMatrixView<'_, f64>, p: DMatrixView<'_, f64>) -> Option<f64> {
    let gain = m.dot(&p) / p.norm_squared();
    (gain.is_finite() && gain > 0.0).then_some(gain)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn prediction(measured: DMatrix<f64>, predicted: DMatrix<f64>) -> Prediction {
        let sigma = vec![1e-3; measured.ncols()];
        Prediction { residuals: Vec::new(), measured, predicted, sigma }
    }

    #[test]
    fn turn_and_gains_are_those_that_were_made() {
        // Two joints and the gyro.
        let p = DMatrix::from_fn(200, 5, |i, k| (0.07 * i as f64 * (1.0 + 0.4 * k as f64) + k as f64).sin());
        let axis = nalgebra::Unit::new_normalize(Vector3::new(0.3, -0.8, 0.5));
        let made = Rotation3::from_axis_angle(&axis, 0.61);
        let mut m = p.clone();
        for i in 0..p.nrows() {
            let rate = made * Vector3::new(p[(i, 2)], p[(i, 3)], p[(i, 4)]);
            (0..3).for_each(|k| m[(i, 2 + k)] = rate[k]);
        }
        let Some(Output::Turned(rotation)) = turn(&prediction(m, p.clone()), 2) else { panic!("no turn") };
        assert!(rotation.angle_to(&made) < 1e-12);
        let mut m = p.clone();
        m.columns_mut(0, 2).scale_mut(0.7376);
        m.columns_mut(2, 3).scale_mut(2.1);
        let of = prediction(m, p);
        assert!(matches!(torque_gain(&of, 2), Some(Output::TorqueGain(gain)) if (gain - 0.7376).abs() < 1e-12));
        assert!(matches!(gyro_gain(&of, 2), Some(Output::GyroGain(gain)) if (gain - 2.1).abs() < 1e-12));
    }

    #[test]
    fn a_mirrored_gyro_is_no_turn() {
        let p = DMatrix::from_fn(200, 3, |i, k| (0.07 * i as f64 * (1.0 + 0.4 * k as f64) + k as f64).sin());
        let mut m = p.clone();
        m.column_mut(2).neg_mut();
        let Some(Output::Turned(rotation)) = turn(&prediction(m, p), 0) else { panic!("no rotation") };
        assert!((rotation.matrix().determinant() - 1.0).abs() < 1e-12);
    }
}
