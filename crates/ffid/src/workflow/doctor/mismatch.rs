//! What torques and gyro are, compared with their prediction: off by the factor of a unit, of another sign, in another column.
//!
//! The distance of a measured signal m from its prediction p, both without their means, is `|m - p|^2 / (|m|^2 + |p|^2)`: 0 where they
//! agree, 1 where they have nothing in common or one is far smaller, 2 where the sign is reversed. Twice the amplitude is 0.2 away, three
//! times the amplitude 0.4.

use super::prediction::Prediction;
use super::units::{ONE_TORQUE, RATE, TORQUE, nearest, on_motor_side};
use ff_records::Record;
use ident::checks::{AxisMismatch, axis_mismatches};
use nalgebra::{DMatrix, DVectorView, Rotation3};

/// Root mean square of a signal over its noise above which it is judged.
const LOUD: f64 = 5.0;
/// The same, above which it counts in a distance.
const HEARD: f64 = 1.5;
/// Correlation that a channel needs for its factor to count.
const ALIKE: f64 = 0.6;
/// The same for one channel alone among others.
const ALIKE_ALONE: f64 = 0.8;
/// Sum of the distances of two torques above which it is asked whether their columns are swapped, and part that swapping must leave.
const FAR: f64 = 0.5;
const SWAPPED: f64 = 0.4;

/// Ratios of the amplitudes of other torques to their predictions, within which one torque may be in a unit of its own. Beyond, the mission
/// carries something else than the robot does.
const OTHERS: std::ops::RangeInclusive<f64> = 0.3..=3.0;

/// What the outputs of a record are.
#[derive(Clone, Debug)]
pub(super) enum Output {
    /// All torques are `factor` times too large; measured is the median of the ratios of amplitudes.
    TorqueUnit { factor: f64, measured: f64 },
    /// Torques are those of the motors, before gears: as many times too large (a number below one), for every joint.
    MotorSide { factors: Vec<f64> },
    /// One of them is.
    OneTorqueUnit { joint: usize, factor: f64, measured: f64 },
    /// The gyro is.
    GyroUnit { factor: f64, measured: f64 },
    /// Sign of a torque, or axes of the gyro.
    Axis(AxisMismatch),
    /// The columns of two torques are swapped.
    Swapped { joints: (usize, usize) },
    /// The gyro is mounted at an angle: it reads this rotation of the rates in base axes.
    Turned(Rotation3<f64>),
    /// The gyro reads so many times what there is.
    GyroGain(f64),
    /// All torques do.
    TorqueGain(f64),
}

impl Output {
    /// Whether it is the unit of a channel.
    pub(super) fn is_unit(&self) -> bool {
        use Output::{GyroUnit, MotorSide, OneTorqueUnit, TorqueUnit};
        matches!(self, TorqueUnit { .. } | MotorSide { .. } | OneTorqueUnit { .. } | GyroUnit { .. })
    }
}

/// Outputs explained as well as units, signs and columns allow.
#[derive(Clone, Debug)]
pub(super) struct Explained {
    pub(super) outputs: Vec<Output>,
    /// Mean distance over the loud channels as recorded, and with all of that put right; 0 when no channel is loud.
    pub(super) before: f64,
    pub(super) after: f64,
    /// Squares of what is left of the torques over their noise, put right but in the unit that they were recorded in; `None` where that is not the
    /// right one.
    pub(super) torques_left: Option<f64>,
}

/// `|m - p|^2 / (|m|^2 + |p|^2)`.
pub(super) fn distance(m: DVectorView<'_, f64>, p: DVectorView<'_, f64>) -> f64 {
    let size = m.norm_squared() + p.norm_squared();
    if size > 0.0 { (m - p).norm_squared() / size } else { 0.0 }
}

fn correlation(m: DVectorView<'_, f64>, p: DVectorView<'_, f64>) -> f64 {
    let scale = m.norm() * p.norm();
    if scale > 0.0 { m.dot(&p) / scale } else { 0.0 }
}

fn median(mut x: Vec<f64>) -> Option<f64> {
    x.sort_unstable_by(f64::total_cmp);
    x.get(x.len() / 2).copied()
}

/// Compares the outputs of `record` with their prediction.
pub(super) fn explain(record: &Record, of: &Prediction) -> Explained {
    let (nj, samples) = (record.joints(), record.samples());
    let root = (samples as f64).sqrt();
    let (mut m, p) = (of.measured.clone(), &of.predicted);
    let loud: Vec<bool> =
        (0..nj + 3).map(|k| m.column(k).norm().max(p.column(k).norm()) > LOUD * of.sigma[k] * root).collect();
    let mean = |m: &DMatrix<f64>, p: &DMatrix<f64>| {
        let of: Vec<f64> = (0..nj + 3).filter(|&k| loud[k]).map(|k| distance(m.column(k), p.column(k))).collect();
        of.iter().sum::<f64>() / of.len().max(1) as f64
    };
    let before = mean(&m, p);
    let mut outputs = Vec::new();
    let judged: Vec<usize> = (0..nj).filter(|&k| loud[k] && p.column(k).norm() > 0.0).collect();
    torque_units(&mut m, p, &judged, nj, &mut outputs);
    // One device: its axes, in whatever order, have one unit.
    let norm = |m: &DMatrix<f64>| m.columns(nj, 3).norm();
    if (nj..nj + 3).any(|k| loud[k])
        && norm(p) > 0.0
        && let Some(factor) = nearest(norm(&m) / norm(p), &RATE).map(|u| u.factor)
    {
        let measured = norm(&m) / norm(p);
        let mut scaled = m.clone();
        scaled.columns_mut(nj, 3).scale_mut(1.0 / factor);
        // As recorded or with the axes put right, the gyro has to resemble its prediction.
        let mut turned = scaled.clone();
        axes(record, of, &scaled).iter().for_each(|a| undo(a, &scaled, &mut turned, nj));
        let after: f64 = (nj..nj + 3).map(|k| distance(turned.column(k), p.column(k))).sum::<f64>() / 3.0;
        if after < 1.0 - ALIKE {
            outputs.push(Output::GyroUnit { factor, measured });
            m = scaled;
        }
    }
    swaps(&mut m, p, &judged, &mut outputs);
    let found = axes(record, of, &m);
    let known = m.clone();
    for a in found {
        undo(&a, &known, &mut m, nj);
        outputs.push(Output::Axis(a));
    }
    let after = mean(&m, p);
    let scaled =
        |o: &Output| matches!(o, Output::TorqueUnit { .. } | Output::OneTorqueUnit { .. } | Output::MotorSide { .. });
    let left = || (0..nj).map(|k| (m.column(k) - p.column(k)).norm_squared() / of.sigma[k].powi(2)).sum();
    let torques_left = if outputs.iter().any(scaled) { None } else { Some(left()) };
    Explained { outputs, before, after, torques_left }
}

/// Whether an axis of the gyro is clearly the reverse of its prediction, which a quick fit may hide in the products of inertia.
pub(super) fn is_gyro_reversed(of: &Prediction, nj: usize) -> bool {
    let loud = |k: usize| of.predicted.column(k).norm() > LOUD * of.sigma[k] * (of.predicted.nrows() as f64).sqrt();
    (nj..nj + 3).any(|k| loud(k) && correlation(of.measured.column(k), of.predicted.column(k)) < -ALIKE_ALONE)
}

/// The unit of the gyro by its amplitude alone: values of the mission that are far off may predict another shape.
pub(super) fn gyro_unit(record: &Record, of: &Prediction) -> Option<Output> {
    let norm = |m: &DMatrix<f64>| m.columns(record.joints(), 3).norm();
    let measured = norm(&of.measured) / norm(&of.predicted);
    nearest(measured, &RATE).map(|u| Output::GyroUnit { factor: u.factor, measured })
}

/// The unit of all torques by their amplitudes, of joints that are `judged`.
fn common_unit(m: &DMatrix<f64>, p: &DMatrix<f64>, judged: &[usize], nj: usize) -> Option<Output> {
    let ratio = |k: usize| m.column(k).norm() / p.column(k).norm();
    let measured = median(judged.iter().map(|&k| ratio(k)).collect())?;
    // Every joint has a gear of its own; those that are too quiet to tell have that of the others.
    let geared = |k: usize| judged.contains(&k) && on_motor_side(ratio(k));
    if on_motor_side(measured) && 2 * judged.iter().filter(|&&k| geared(k)).count() > judged.len() {
        return Some(Output::MotorSide {
            factors: (0..nj).map(|k| if geared(k) { ratio(k) } else { measured }).collect(),
        });
    }
    nearest(measured, &TORQUE).map(|unit| Output::TorqueUnit { factor: unit.factor, measured })
}

/// The same of a record, whatever the shapes: values of the mission that are far off may predict another.
pub(super) fn torque_unit(record: &Record, of: &Prediction) -> Option<Output> {
    let root = (record.samples() as f64).sqrt();
    let loud = |k: &usize| of.predicted.column(*k).norm() > LOUD * of.sigma[*k] * root;
    let judged: Vec<usize> = (0..record.joints()).filter(loud).collect();
    common_unit(&of.measured, &of.predicted, &judged, record.joints())
}

/// Units of the torques, all and one by one, of joints that are `judged`; puts them right in `m`.
fn torque_units(m: &mut DMatrix<f64>, p: &DMatrix<f64>, judged: &[usize], nj: usize, outputs: &mut Vec<Output>) {
    let ratio = |m: &DMatrix<f64>, k: usize| m.column(k).norm() / p.column(k).norm();
    let alike = |k: usize| correlation(m.column(k), p.column(k)).abs();
    if median(judged.iter().map(|&k| alike(k)).collect()).is_some_and(|c| c > ALIKE)
        && let Some(unit) = common_unit(m, p, judged, nj)
    {
        apply(&unit, m, nj);
        outputs.push(unit);
    }
    let others = |m: &DMatrix<f64>, joint: usize| {
        let mut of = judged.iter().filter(|&&k| k != joint).map(|&k| ratio(m, k));
        let near = |k: usize| judged.contains(&k) && !OTHERS.contains(&ratio(m, k));
        let beside = joint.checked_sub(1).is_some_and(near) || near(joint + 1);
        !beside && of.all(|r| OTHERS.contains(&r) || nearest(r, &ONE_TORQUE).is_some())
    };
    for &joint in judged {
        let measured = ratio(m, joint);
        let known = nearest(measured, &ONE_TORQUE).map(|u| u.factor);
        if let Some(factor) = known.or(on_motor_side(measured).then_some(measured))
            && correlation(m.column(joint), p.column(joint)).abs() > ALIKE_ALONE
            && (known.is_some() || others(m, joint))
        {
            outputs.push(Output::OneTorqueUnit { joint, factor, measured });
            m.column_mut(joint).scale_mut(1.0 / factor);
        }
    }
}

/// Mean distance of the outputs of `record` with these errors put right, over the channels that can be heard at all.
pub(super) fn distance_with(record: &Record, of: &Prediction, outputs: &[Output]) -> f64 {
    let (nj, root) = (record.joints(), (record.samples() as f64).sqrt());
    let mut m = of.measured.clone();
    let heard: Vec<usize> = (0..nj + 3)
        .filter(|&k| m.column(k).norm().max(of.predicted.column(k).norm()) > HEARD * of.sigma[k] * root)
        .collect();
    outputs.iter().for_each(|o| apply(o, &mut m, nj));
    let sum: f64 = heard.iter().map(|&k| distance(m.column(k), of.predicted.column(k))).sum();
    sum / heard.len().max(1) as f64
}

/// `record` with these errors of its outputs put right. Allocates.
pub(super) fn put_right(record: &Record, outputs: &[Output]) -> Record {
    let (mut m, nj) = (record.responses(), record.joints());
    outputs.iter().for_each(|o| apply(o, &mut m, nj));
    record.clone().with_tau(m.columns(0, nj).into_owned()).with_gyro(m.columns(nj, 3).into_owned())
}

/// Puts an error right in torques and gyro, N x (n + 3).
pub(super) fn apply(o: &Output, m: &mut DMatrix<f64>, nj: usize) {
    match o {
        Output::TorqueUnit { factor, .. } => m.columns_mut(0, nj).scale_mut(1.0 / factor),
        Output::MotorSide { factors } => {
            factors.iter().enumerate().for_each(|(j, f)| m.column_mut(j).scale_mut(1.0 / f));
        }
        Output::OneTorqueUnit { joint, factor, .. } => m.column_mut(*joint).scale_mut(1.0 / factor),
        Output::GyroUnit { factor, .. } => m.columns_mut(nj, 3).scale_mut(1.0 / factor),
        Output::Swapped { joints: (i, j), .. } => m.swap_columns(*i, *j),
        Output::TorqueGain(gain) => m.columns_mut(0, nj).scale_mut(1.0 / gain),
        Output::GyroGain(gain) => m.columns_mut(nj, 3).scale_mut(1.0 / gain),
        Output::Turned(rotation) => {
            // A row m^T = (R p)^T, of which R makes p^T.
            let rates = m.columns(nj, 3) * rotation.matrix();
            m.columns_mut(nj, 3).copy_from(&rates);
        }
        Output::Axis(a) => {
            let known = m.clone();
            undo(a, &known, m, nj);
        }
    }
}

/// Signs of torques, and axes of the gyro, of outputs `m`.
fn axes(record: &Record, of: &Prediction, m: &DMatrix<f64>) -> Vec<AxisMismatch> {
    let (nj, k) = (record.joints(), of.sigma.len());
    let mut residuals = vec![0.0; record.samples() * k];
    for i in 0..record.samples() {
        for j in 0..k {
            residuals[i * k + j] = (of.predicted[(i, j)] - m[(i, j)]) / of.sigma[j];
        }
    }
    let corrected = record.clone().with_tau(m.columns(0, nj).into_owned()).with_gyro(m.columns(nj, 3).into_owned());
    axis_mismatches(&corrected, &residuals, &of.sigma)
}

/// Puts right in `m` what `known` has as `a` says.
fn undo(a: &AxisMismatch, known: &DMatrix<f64>, m: &mut DMatrix<f64>, nj: usize) {
    match *a {
        AxisMismatch::Torque { joint, .. } => m.column_mut(joint).neg_mut(),
        AxisMismatch::Gyro { axes, signs, .. } => {
            for i in 0..3 {
                m.set_column(nj + axes[i], &(known.column(nj + i) * signs[i]));
            }
        }
    }
}

/// Pairs of torques that are nearer to each other's predictions by far.
fn swaps(m: &mut DMatrix<f64>, p: &DMatrix<f64>, judged: &[usize], outputs: &mut Vec<Output>) {
    for (at, &i) in judged.iter().enumerate() {
        for &j in &judged[at + 1..] {
            let of = |a: usize, b: usize| distance(m.column(a), p.column(b));
            let (before, after) = (of(i, i) + of(j, j), of(i, j) + of(j, i));
            if before > FAR && after < (SWAPPED * before).min(FAR) {
                outputs.push(Output::Swapped { joints: (i, j) });
                m.swap_columns(i, j);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::units::DEGREES;
    use super::*;

    #[test]
    fn a_threefold_amplitude_is_nearer_than_anything_that_is_judged() {
        let p = nalgebra::DVector::from_fn(400, |i, _| (0.05 * i as f64).sin());
        let of = |m: nalgebra::DVector<f64>| distance(m.as_view(), p.as_view());
        assert!((of(&p * 3.0) - 0.4).abs() < 1e-12 && (of(&p / 3.0) - 0.4).abs() < 1e-12);
        assert!((of(-&p) - 2.0).abs() < 1e-12 && of(&p * DEGREES) > 0.96 && of(p.clone()) == 0.0);
    }
}
