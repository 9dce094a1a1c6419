//! Everything that may be wrong with units, axes and signs of a record, each put right and compared with a prediction.

use super::case::Case;
use super::mismatch::{Explained, Output, distance_with, explain, gyro_unit, torque_unit};
use super::motion_error::MotionError;
use super::prediction::Prediction;
use ff_model::JointKind;
use ff_records::Record;
use ident::checks::AxisMismatch;

/// Factor by which distance and misfit of a hypothesis count more with each mistake that it consists of.
pub(super) const SIMPLER: f64 = 1.3;

/// Kinds of joint: true where it turns.
pub(super) fn turns(case: &Case<'_>) -> Vec<bool> {
    case.model.own_bodies().map(|b| b.joint.kind != JointKind::Prismatic).collect()
}

/// A hypothesis: errors of the motion, then of outputs.
#[derive(Clone)]
pub(super) struct Hypothesis {
    pub(super) motion: MotionError,
    pub(super) outputs: Vec<Output>,
    /// Mean distance that it leaves, and what a measure of it is multiplied by for the errors it consists of.
    pub(super) distance: f64,
    pub(super) price: f64,
}

impl Hypothesis {
    /// Whether it is the unit of channels, and nothing else.
    pub(super) fn is_unit(&self) -> bool {
        (self.motion == MotionError::None || self.motion.is_unit()) && self.outputs.iter().all(Output::is_unit)
    }
    /// Whether it is the unit of one joint.
    pub(super) fn is_of_one_joint(&self) -> bool {
        let one = |o: &Output| matches!(o, Output::OneTorqueUnit { .. });
        matches!(self.motion, MotionError::OneFactor(..)) || self.outputs.iter().any(one)
    }
    /// Whether it is the unit of all torques, or of the gyro, and nothing else.
    pub(super) fn is_of_device(&self) -> bool {
        let torques = matches!(self.outputs[..], [Output::TorqueUnit { .. } | Output::MotorSide { .. }]);
        self.motion == MotionError::None && (torques || self.is_gyro_unit())
    }
    /// Whether it is the unit of the gyro, and nothing else.
    pub(super) fn is_gyro_unit(&self) -> bool {
        self.motion == MotionError::None && matches!(self.outputs[..], [Output::GyroUnit { .. }])
    }
}

/// Whether units may be wrong together: those of all angles are, in the same way; for small motions others make up for one another.
pub(super) fn is_plausible(motion: MotionError, outputs: &[Output]) -> bool {
    let same = |o: &Output| match (motion, o) {
        (MotionError::Factor(f), Output::GyroUnit { factor, .. }) => (f / factor).ln().abs() < 1e-9,
        _ => !motion.is_unit(),
    };
    outputs.iter().filter(|o| o.is_unit()).all(same)
}

/// Mistakes that a hypothesis consists of: the columns of a joint, or all torques, that are wrong in the same way are one.
pub(super) fn mistakes(motion: MotionError, outputs: &[Output], joints: usize) -> i32 {
    let of_torque = |o: &Output| matches!(o, Output::Axis(AxisMismatch::Torque { .. }));
    let same = match (motion, outputs) {
        (MotionError::Reversed(j), [Output::Axis(AxisMismatch::Torque { joint, .. })]) => *joint == j,
        (MotionError::Swapped(i, j), [Output::Swapped { joints }]) => *joints == (i, j),
        _ => false,
    };
    let of_outputs = match outputs.len() {
        _ if same => 0,
        k if k == joints && k > 0 && outputs.iter().all(of_torque) => 1,
        k => k as i32,
    };
    of_outputs + i32::from(motion != MotionError::None)
}

/// A gyro whose axes are any but those of the base, in order or sign. What its prediction shares with it may be too little to tell by.
pub(super) fn turned_gyros() -> impl Iterator<Item = AxisMismatch> {
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    orders.into_iter().flat_map(|axes| {
        let signs = move |bits: u8| std::array::from_fn(|i| if bits >> i & 1 == 1 { -1.0 } else { 1.0 });
        // The first of the first is the gyro as it should be.
        (u8::from(axes == [0, 1, 2])..8).map(move |bits| AxisMismatch::Gyro {
            axes,
            signs: signs(bits),
            improvement: 1.0,
        })
    })
}

/// Everything that may be wrong with positions and outputs, by what it leaves at these values, cheapest first.
pub(super) fn ranked(case: &Case<'_>, thin: &Record, values: &[f64]) -> Vec<Hypothesis> {
    let (turns, n) = (turns(case), thin.joints());
    let mut out = Vec::new();
    let mut all = vec![MotionError::None];
    all.extend(MotionError::all(&turns, thin.dt(), true));
    let reversed = |joint| Output::Axis(AxisMismatch::Torque { joint, correlation: -1.0 });
    let swapped = |i, j| Output::Swapped { joints: (i, j) };
    for motion in all {
        let record = motion.put_right(thin, &turns);
        let Some(p) = Prediction::coarse_at(case, &record, values) else { continue };
        let Explained { outputs, .. } = explain(&record, &p);
        let mut variants = vec![Vec::new()];
        if !outputs.is_empty() {
            variants.push(outputs);
        }
        match motion {
            MotionError::None => {
                variants.extend((0..n).map(|j| vec![reversed(j)]));
                variants.push((0..n).map(reversed).collect());
                variants.extend((0..n).flat_map(|i| (i + 1..n).map(move |j| vec![swapped(i, j)])));
                variants.extend(gyro_unit(&record, &p).into_iter().chain(torque_unit(&record, &p)).map(|o| vec![o]));
                variants.extend(turned_gyros().map(|a| vec![Output::Axis(a)]));
            }
            // The names of a joint, or the sense of its axis, are wrong in all its columns.
            MotionError::Reversed(j) => variants.push(vec![reversed(j)]),
            MotionError::Swapped(i, j) => variants.push(vec![swapped(i, j)]),
            MotionError::Factor(_) | MotionError::OneFactor(..) | MotionError::Time(_) => {}
        }
        for outputs in variants {
            let errors = mistakes(motion, &outputs, n);
            if errors > 0 && is_plausible(motion, &outputs) {
                let distance = distance_with(&record, &p, &outputs);
                out.push(Hypothesis { motion, outputs, distance, price: SIMPLER.powi(errors) });
            }
        }
    }
    out.sort_by(|a, b| (a.distance * a.price).total_cmp(&(b.distance * b.price)));
    out
}
