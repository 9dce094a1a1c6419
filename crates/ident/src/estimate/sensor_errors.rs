//! Readings of sensors with errors, of what error-free ones would read ([`ErrorSource`] has the equations).

use crate::uncertain::source::ErrorSource;
use core::ops::Range;
use ff_dynamics::motion::JointMotion;
use ff_model::spatial::so3::{exp_so3, quat_to_rot, right_jacobian};
use ff_records::Record;
use ff_records::time_base::ChannelGroup;
use nalgebra::{DMatrix, Matrix3, Vector3};
use std::sync::Arc;

/// Part of the largest rate of a joint below which Coulomb friction goes over from one sign to the other.
const SLOW: f64 = 0.01;

/// Errors of torque sensors and gyro, and what their readings depend on besides predictions.
pub(crate) struct SensorErrors {
    pub(crate) of: Vec<ErrorSource>,
    /// Middle of the record since its first sample, and sample times of torques and gyro since then (s).
    middle: f64,
    times: [Arc<[f64]>; 2],
    /// Rates of the joints at the samples of the torques, and the largest of each; empty without friction.
    rates: DMatrix<f64>,
    fastest: Vec<f64>,
}

/// What the readings of a group depend on, at some sizes of the errors.
struct Effect {
    gain: Vec<f64>,
    turn: Option<(Matrix3<f64>, Matrix3<f64>)>,
}

impl Effect {
    fn is_plain(&self) -> bool {
        self.turn.is_none() && self.gain.iter().all(|&g| g == 1.0)
    }
    fn turned(&self, x: Vector3<f64>) -> Vector3<f64> {
        self.turn.as_ref().map_or(x, |(r, _)| r * x)
    }
    /// The channels of one reading, or of its derivative, turned and scaled in place.
    fn apply(&self, x: &mut [f64]) {
        if self.turn.is_some() {
            let w = self.turned(Vector3::new(x[0], x[1], x[2]));
            x.copy_from_slice(w.as_slice());
        }
        x.iter_mut().zip(&self.gain).for_each(|(x, g)| *x *= g);
    }
    fn apply_rows(&self, values: &mut DMatrix<f64>) {
        if self.is_plain() {
            return;
        }
        let mut reading = vec![0.0; values.ncols()];
        for mut row in values.row_iter_mut() {
            reading.iter_mut().zip(&row).for_each(|(x, &v)| *x = v);
            self.apply(&mut reading);
            row.copy_from_slice(&reading);
        }
    }
}

impl SensorErrors {
    pub(crate) fn new(of: Vec<ErrorSource>, record: &Record, motion: &dyn JointMotion) -> Self {
        let middle = 0.5 * record.seconds();
        let times = [(ChannelGroup::Torque, record.tau()), (ChannelGroup::Gyro, record.gyro())].map(|(group, m)| {
            let at = |i: usize| record.times(group).map_or(i as f64 * record.dt(), |t| t[i]);
            (0..m.nrows()).map(|i| at(i) - middle).collect()
        });
        let rubs = of.iter().any(|e| matches!(e, ErrorSource::ViscousFriction(_) | ErrorSource::CoulombFriction(_)));
        let (n, mut rates) = (motion.dof(), DMatrix::zeros(0, 0));
        if rubs {
            let [torques, _]: &[Arc<[f64]>; 2] = &times;
            rates = DMatrix::zeros(torques.len(), n);
            let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
            for (i, t) in torques.iter().enumerate() {
                motion.eval(t + middle, &mut q, &mut qd, &mut qdd);
                rates.row_mut(i).iter_mut().zip(&qd).for_each(|(r, &x)| *r = x);
            }
        }
        let fastest = rates.column_iter().map(|c| c.amax()).collect();
        Self { of, middle, times, rates, fastest }
    }
    /// Whether a clock of this group may run at another rate.
    pub(crate) fn skews(&self, group: usize) -> bool {
        self.of.contains(&skew(group))
    }
    /// Sample times of a group by the clock of the encoders since the first sample of the grid (s), where its own runs slowly by the
    /// size of the skew among `e`; `None` where it does not or is none of the errors.
    pub(crate) fn skewed(&self, e: &[f64], group: usize) -> Option<Arc<[f64]>> {
        let size = self.of.iter().zip(e).find(|(s, _)| **s == skew(group)).map(|(_, &e)| e).filter(|&e| e != 0.0)?;
        Some(self.times[group].iter().map(|t| self.middle + t - size * t).collect())
    }
    fn effect(&self, e: &[f64], group: usize, channels: usize) -> Effect {
        let (mut gain, mut rotation) = (vec![1.0; channels], Vector3::zeros());
        for (source, &e) in self.of.iter().zip(e) {
            match (group, source) {
                (0, ErrorSource::TorqueGain(None)) | (1, ErrorSource::GyroScale(None)) => {
                    gain.iter_mut().for_each(|g| *g += e);
                }
                (0, ErrorSource::TorqueGain(Some(c))) | (1, ErrorSource::GyroScale(Some(c))) => gain[*c] += e,
                (1, ErrorSource::GyroRotation(c)) => rotation[*c] += e,
                _ => {}
            }
        }
        let turned = rotation != Vector3::zeros();
        let turn = turned.then(|| (quat_to_rot(&exp_so3(&rotation)), right_jacobian(&rotation)));
        Effect { gain, turn }
    }
    /// What is added to the reading `i` of a channel whatever was predicted.
    fn added(&self, e: &[f64], group: usize, i: usize, channel: usize) -> f64 {
        let slopes = self.of.iter().zip(e).filter(|(_, e)| **e != 0.0);
        slopes.map(|(source, &e)| e * self.offset(source, group, i, channel)).sum()
    }
    /// Derivative of [`SensorErrors::added`] with respect to the size of `source`.
    fn offset(&self, source: &ErrorSource, group: usize, i: usize, channel: usize) -> f64 {
        match (group, *source) {
            (0, ErrorSource::TorqueDrift(c)) | (1, ErrorSource::GyroDrift(c)) if c == channel => self.times[group][i],
            (0, ErrorSource::TorqueWalk(c, part)) | (1, ErrorSource::GyroWalk(c, part)) if c == channel => {
                part.ramp(self.times[group][i] + self.middle)
            }
            (0, ErrorSource::ViscousFriction(j)) if j == channel => self.rates[(i, j)],
            (0, ErrorSource::CoulombFriction(j)) if j == channel => {
                let (rate, slow) = (self.rates[(i, j)], SLOW * self.fastest[j]);
                if slow == 0.0 { 0.0 } else { rate / rate.hypot(slow) }
            }
            _ => 0.0,
        }
    }
    /// Readings of the sensors `readings` of a group, from what error-free ones would read (readings x channels), in place.
    pub(crate) fn observe(&self, e: &[f64], group: usize, readings: Range<usize>, values: &mut DMatrix<f64>) {
        self.effect(e, group, values.ncols()).apply_rows(values);
        for c in 0..values.ncols() {
            for (k, i) in readings.clone().enumerate() {
                values[(k, c)] += self.added(e, group, i, c);
            }
        }
    }
    /// Gains and rotation alone, of derivatives of what error-free sensors would read (readings x channels), in place.
    pub(crate) fn turn(&self, e: &[f64], group: usize, slope: &mut DMatrix<f64>) {
        self.effect(e, group, slope.ncols()).apply_rows(slope);
    }
    /// Derivatives of the readings from those of what error-free sensors would read (row `channels * k + c`), in place.
    pub(crate) fn observe_rows(&self, e: &[f64], group: usize, channels: usize, rows: &mut DMatrix<f64>) {
        let effect = self.effect(e, group, channels);
        if effect.is_plain() {
            return;
        }
        for mut column in rows.column_iter_mut() {
            column.as_mut_slice().chunks_exact_mut(channels).for_each(|x| effect.apply(x));
        }
    }
    /// Derivatives of the readings of a group with respect to the size of error `k`, given to `put(reading, channel, value)` where
    /// they are not zero. `values` are what error-free sensors would read, `slope` their derivatives with respect to a delay.
    pub(crate) fn column(
        &self,
        k: usize,
        e: &[f64],
        (group, readings): (usize, Range<usize>),
        values: &DMatrix<f64>,
        slope: Option<&DMatrix<f64>>,
        mut put: impl FnMut(usize, usize, f64),
    ) {
        let (source, channels) = (self.of[k], values.ncols());
        let effect = self.effect(e, group, channels);
        let gyro = |m: &DMatrix<f64>, row: usize| Vector3::new(m[(row, 0)], m[(row, 1)], m[(row, 2)]);
        for (row, i) in readings.enumerate() {
            match source {
                ErrorSource::TorqueGain(of) => match of {
                    Some(c) => put(row, c, values[(row, c)]),
                    None => (0..channels).for_each(|c| put(row, c, values[(row, c)])),
                },
                ErrorSource::GyroScale(of) => {
                    let w = effect.turned(gyro(values, row));
                    match of {
                        Some(c) => put(row, c, w[c]),
                        None => (0..3).for_each(|c| put(row, c, w[c])),
                    }
                }
                ErrorSource::GyroRotation(axis) => {
                    // d (R w) = -R [w x] J_r d(rotation).
                    let along = Vector3::ith(axis, 1.0);
                    let along = effect.turn.as_ref().map_or(along, |(_, j)| j * along);
                    let d = effect.turned(along.cross(&gyro(values, row)));
                    (0..3).for_each(|c| put(row, c, effect.gain[c] * d[c]));
                }
                ErrorSource::TorqueSkew | ErrorSource::GyroSkew => {
                    let Some(slope) = slope else { continue };
                    let t = self.times[group][i];
                    if group == 1 {
                        let d = effect.turned(gyro(slope, row));
                        (0..3).for_each(|c| put(row, c, effect.gain[c] * t * d[c]));
                    } else {
                        (0..channels).for_each(|c| put(row, c, effect.gain[c] * t * slope[(row, c)]));
                    }
                }
                ErrorSource::TorqueDrift(c)
                | ErrorSource::TorqueWalk(c, _)
                | ErrorSource::GyroDrift(c)
                | ErrorSource::GyroWalk(c, _)
                | ErrorSource::ViscousFriction(c)
                | ErrorSource::CoulombFriction(c) => put(row, c, self.offset(&source, group, i, c)),
                ErrorSource::Compliance(_)
                | ErrorSource::Force(_)
                | ErrorSource::Moment(_)
                | ErrorSource::Oscillator(..) => {}
            }
        }
    }
}

fn skew(group: usize) -> ErrorSource {
    if group == 0 { ErrorSource::TorqueSkew } else { ErrorSource::GyroSkew }
}
