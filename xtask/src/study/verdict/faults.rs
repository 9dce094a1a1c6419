//! What is wrong in a world: errors of sensors act on its readings, errors of the model on the mission that it is identified with.

use super::world::Readings;
use anyhow::{Context, bail};
use ff_model::{Kinematics, Model, ParamGroup};
use nalgebra::{DMatrix, Rotation3, Unit, Vector3};

/// A direction that favours no axis.
const OBLIQUE: [f64; 3] = [0.48, -0.64, 0.6];

/// An error that a world may have.
pub(super) struct Kind {
    pub(super) name: &'static str,
    /// The hypothesis that it is.
    pub(super) cause: &'static str,
    fault: Fault,
}

/// What is done. Joints are columns of the record.
#[derive(Clone, Copy)]
enum Fault {
    GyroTurn,
    GyroScale,
    TorqueGain(Option<usize>),
    EncoderOffset(usize),
    TorqueLate,
    GyroLate,
    TorqueDrift(usize),
    GyroDrift,
    Viscous(usize),
    /// The encoder sits on the motor's side.
    Compliance(usize),
    /// All bodies whose parameters begin so, in proportion.
    Mass(&'static str),
    /// A joint or mount stands elsewhere; the beginning of the names of its parameters.
    Shift(&'static str),
    /// Another value of this parameter.
    Parameter(&'static str),
}

const SHOULDER: usize = 1;
const ELBOW: usize = 2;

/// All kinds.
pub(super) const KINDS: [Kind; 16] = [
    Kind { name: "gyro-turn", cause: "gyro-misalignment", fault: Fault::GyroTurn },
    Kind { name: "gyro-scale", cause: "gyro-scale", fault: Fault::GyroScale },
    Kind { name: "torque-gain", cause: "torque-gain", fault: Fault::TorqueGain(None) },
    Kind { name: "torque-gain-joint", cause: "torque-gain.shoulder", fault: Fault::TorqueGain(Some(SHOULDER)) },
    Kind { name: "encoder-offset", cause: "encoder-offset.elbow", fault: Fault::EncoderOffset(ELBOW) },
    Kind { name: "torque-late", cause: "torque-clock", fault: Fault::TorqueLate },
    Kind { name: "gyro-late", cause: "gyro-clock", fault: Fault::GyroLate },
    Kind { name: "torque-drift", cause: "torque-drift.elbow", fault: Fault::TorqueDrift(ELBOW) },
    Kind { name: "gyro-drift", cause: "gyro-drift", fault: Fault::GyroDrift },
    Kind { name: "viscous", cause: "friction.shoulder", fault: Fault::Viscous(SHOULDER) },
    Kind { name: "compliance", cause: "compliance.shoulder", fault: Fault::Compliance(SHOULDER) },
    Kind { name: "link-mass", cause: "mass.upper_2", fault: Fault::Mass("upper_2.") },
    Kind { name: "link-length", cause: "joint-position.elbow", fault: Fault::Shift("elbow.placement.") },
    Kind { name: "tank-mount", cause: "mount-position.tank", fault: Fault::Shift("tank.mount.") },
    Kind { name: "tank-length", cause: "tank.length", fault: Fault::Parameter("tank.length") },
    Kind { name: "wing-mass", cause: "mass.wing", fault: Fault::Mass("wing.") },
];

impl Kind {
    /// The deviation of its size when the components of its hypothesis have these, as if they were independent.
    pub(super) fn deviation(&self, components: &[f64]) -> f64 {
        let along = match self.fault {
            Fault::GyroTurn | Fault::GyroDrift | Fault::Shift(_) => &OBLIQUE[..],
            _ => &[1.0][..],
        };
        along.iter().zip(components).map(|(d, s)| (d / s).powi(2)).sum::<f64>().sqrt().recip()
    }
    /// Whether it can be of one sign only: no spring has a compliance below zero, and none is named.
    pub(super) fn is_positive(&self) -> bool {
        matches!(self.fault, Fault::Compliance(_))
    }
    /// Puts an error of this size (rad, m, s, N m, ... or relative) into the readings or into the model.
    ///
    /// # Errors
    /// A robot that does not have the part at fault, or cannot be with such an error.
    pub(super) fn apply(&self, size: f64, to: &mut Readings, model: &mut Model) -> anyhow::Result<()> {
        let axis = Vector3::from(OBLIQUE);
        // From minus to plus one half of the size, for biases are unknown anyway.
        let rows = to.q.nrows();
        let seconds = |i: usize| (i as f64 - 0.5 * (rows - 1) as f64) / to.rate_hz;
        match self.fault {
            Fault::GyroTurn => {
                let turned = Rotation3::from_axis_angle(&Unit::new_normalize(axis), size);
                to.turn_gyro(&turned);
            }
            Fault::GyroScale => to.gyro *= 1.0 + size,
            Fault::TorqueGain(None) => to.tau *= 1.0 + size,
            Fault::TorqueGain(Some(j)) => to.tau.column_mut(j).scale_mut(1.0 + size),
            Fault::EncoderOffset(j) => to.q.column_mut(j).add_scalar_mut(size),
            Fault::TorqueLate => to.tau = later(&to.tau, size * to.rate_hz),
            Fault::GyroLate => to.gyro = later(&to.gyro, size * to.rate_hz),
            Fault::TorqueDrift(j) => {
                to.tau.column_mut(j).iter_mut().enumerate().for_each(|(i, x)| *x += size * seconds(i));
            }
            Fault::GyroDrift => {
                for (k, mut column) in to.gyro.column_iter_mut().enumerate() {
                    column.iter_mut().enumerate().for_each(|(i, x)| *x += size * axis[k] * seconds(i));
                }
            }
            Fault::Viscous(j) => {
                let rates = to.qd.column(j).clone_owned();
                to.tau.column_mut(j).axpy(size, &rates, 1.0);
            }
            Fault::Compliance(j) => {
                let torques = to.tau.column(j).clone_owned();
                to.q.column_mut(j).axpy(size, &torques, 1.0);
            }
            Fault::Mass(prefix) => {
                let inertial =
                    |d: &ff_model::ParamDecl| d.name.starts_with(prefix) && matches!(d.group, ParamGroup::Inertial(_));
                let decls = model.param_decls();
                let all = decls.iter().enumerate().filter(|(_, d)| inertial(d));
                let heavier: Vec<(usize, f64)> = all.map(|(i, d)| (i, (1.0 + size) * d.nominal)).collect();
                if heavier.is_empty() {
                    bail!("no body {prefix}*");
                }
                model.set_nominal(&heavier)?;
            }
            Fault::Shift(prefix) => {
                let mut values = vec![0.0; model.n_kinematic_params()];
                for (k, a) in ["x", "y", "z"].iter().enumerate() {
                    let name = format!("{prefix}{a}");
                    let at = model.kinematic_params().iter().position(|p| p.name == name);
                    values[at.with_context(|| format!("no placement {name}"))?] = size * axis[k];
                }
                *model = model.displaced(&Kinematics::from_values(model, values));
            }
            Fault::Parameter(name) => {
                let decls = model.param_decls();
                let at = decls.iter().position(|d| d.name == name).with_context(|| format!("no parameter {name}"))?;
                model.set_nominal(&[(at, decls[at].nominal + size)])?;
            }
        }
        Ok(())
    }
}

/// Signals as they were so many samples earlier, by polynomials of degree seven through the eight nearest; before the start, the first
/// value.
fn later(signals: &DMatrix<f64>, samples: f64) -> DMatrix<f64> {
    let (whole, f) = (samples.floor(), samples - samples.floor());
    let last = signals.nrows() as f64 - 1.0;
    let mut out = DMatrix::zeros(signals.nrows(), signals.ncols());
    for k in -3..5_i32 {
        let others = (-3..5_i32).filter(|j| *j != k);
        let weight: f64 = others.map(|j| (f - f64::from(j)) / f64::from(k - j)).product();
        for i in 0..signals.nrows() {
            let from = (i as f64 - whole - f64::from(k)).clamp(0.0, last) as usize;
            for j in 0..signals.ncols() {
                out[(i, j)] += weight * signals[(from, j)];
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_those_of_earlier() {
        let wave = |t: f64| (0.1 * t).sin();
        let signal = DMatrix::from_fn(200, 1, |i, _| wave(i as f64));
        for by in [0.0, 0.3, 2.0, 3.7, -1.4] {
            let late = later(&signal, by);
            let off = (10..190).map(|i| (late[(i, 0)] - wave(i as f64 - by)).abs()).fold(0.0, f64::max);
            assert!(off < 1e-9, "{by}: {off:e}");
        }
    }
}
