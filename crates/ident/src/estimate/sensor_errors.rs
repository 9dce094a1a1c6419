//! Readings of sensors with errors, of what error-free ones would read ([`ErrorSource`] has the equations).

use crate::estimate::ground::joint_terms::{JointTerm, Moving, NearRest};
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
    /// Rates and accelerations of the joints at the samples of the torques, and the largest rate of each; empty where no joint has terms.
    rates: DMatrix<f64>,
    accelerations: DMatrix<f64>,
    fastest: Vec<f64>,
    /// For every joint what becomes of its samples near rest, where that was said.
    near_rest: Vec<Option<NearRest>>,
}

/// What the readings of a group depend on, at some sizes of the errors.
struct Effect {
    gain: Vec<f64>,
    turn: Option<(Matrix3<f64>, Matrix3<f64>)>,
    /// One over the gains of drives; empty without currents.
    current: Vec<f64>,
    /// Coefficients of friction in proportion to the load; empty without.
    load: Vec<f64>,
}

impl Effect {
    /// Whether motors are seen, and not what is behind their gears.
    fn is_of_drives(&self) -> bool {
        !(self.current.is_empty() && self.load.is_empty())
    }
    /// What a unit of torque, less friction, is in the unit of the channel.
    fn scale(&self, channel: usize) -> f64 {
        self.current.get(channel).copied().unwrap_or(1.0)
    }
    fn turned(&self, x: Vector3<f64>) -> Vector3<f64> {
        self.turn.as_ref().map_or(x, |(r, _)| r * x)
    }
    /// Readings turned and scaled in place.
    fn apply_rows(&self, values: &mut DMatrix<f64>) {
        if self.turn.is_some() {
            for mut row in values.row_iter_mut() {
                row.copy_from(&self.turned(Vector3::new(row[0], row[1], row[2])).transpose());
            }
        }
        let scaled = values.column_iter_mut().zip(&self.gain).filter(|(_, gain)| **gain != 1.0);
        scaled.for_each(|(mut column, gain)| column.scale_mut(*gain));
    }
}

/// Rates and accelerations of a motion at these times from `middle` on, samples x joints.
fn sampled(motion: &dyn JointMotion, times: &[f64], middle: f64) -> [DMatrix<f64>; 2] {
    let n = motion.dof();
    let [mut rates, mut accelerations] = core::array::from_fn(|_| DMatrix::zeros(times.len(), n));
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for (i, t) in times.iter().enumerate() {
        motion.eval(t + middle, &mut q, &mut qd, &mut qdd);
        rates.row_mut(i).iter_mut().zip(&qd).for_each(|(r, &x)| *r = x);
        accelerations.row_mut(i).iter_mut().zip(&qdd).for_each(|(r, &x)| *r = x);
    }
    [rates, accelerations]
}

impl SensorErrors {
    pub(crate) fn new(
        of: Vec<ErrorSource>,
        near_rest: &[Option<NearRest>],
        record: &Record,
        motion: &dyn JointMotion,
    ) -> Self {
        let middle = 0.5 * record.seconds();
        let times = [(ChannelGroup::Torque, record.tau()), (ChannelGroup::Gyro, record.gyro())].map(|(group, m)| {
            let at = |i: usize| record.times(group).map_or(i as f64 * record.dt(), |t| t[i]);
            (0..m.nrows()).map(|i| at(i) - middle).collect()
        });
        let moves = of.iter().any(|e| matches!(e, ErrorSource::Joint(..))) || near_rest.iter().any(Option::is_some);
        let [torques, _]: &[Arc<[f64]>; 2] = &times;
        let [rates, accelerations] =
            if moves { sampled(motion, torques, middle) } else { core::array::from_fn(|_| DMatrix::zeros(0, 0)) };
        let fastest = rates.column_iter().map(|c| c.amax()).collect();
        Self { of, middle, times, rates, accelerations, fastest, near_rest: near_rest.to_vec() }
    }
    /// Torque samples of joints next to rest that do not count: sample and joint.
    pub(crate) fn at_rest(&self) -> Vec<(usize, usize)> {
        let band = |j: usize| self.near_rest.get(j).copied().flatten();
        let joints = (0..self.rates.ncols()).filter_map(|j| Some((j, band(j)?)));
        let of = |(j, near): (usize, NearRest)| {
            (0..self.rates.nrows()).filter(move |&i| !near.uses(self.rates[(i, j)])).map(move |i| (i, j))
        };
        let mut all: Vec<(usize, usize)> = joints.flat_map(of).collect();
        all.sort_unstable();
        all
    }
    /// Rates and accelerations of disturbing motions at the samples of the torques; none where no joint has terms.
    pub(crate) fn shaken(&self, draws: &[Arc<dyn JointMotion>]) -> Vec<[DMatrix<f64>; 2]> {
        if !self.of.iter().any(|e| matches!(e, ErrorSource::Joint(..))) {
            return Vec::new();
        }
        draws.iter().map(|motion| sampled(&**motion, &self.times[0], self.middle)).collect()
    }
    /// What a disturbance of the motion changes of a torque channel through the terms of its joint, at a sample at which rate and acceleration
    /// change by so much.
    pub(crate) fn through_terms(&self, e: &[f64], i: usize, joint: usize, (qd, qdd): (f64, f64)) -> f64 {
        let at = self.moving(i, joint, 0.0);
        let of = |(source, x): (&ErrorSource, &f64)| match *source {
            ErrorSource::Joint(j, term) if j == joint => {
                let (rate, acceleration) = term.slopes(at);
                x * (rate * qd + acceleration * qdd)
            }
            _ => 0.0,
        };
        self.of.iter().zip(e).map(of).sum::<f64>() * self.scale(e, 0, joint)
    }
    /// Rate of a joint at a torque sample, where a joint has terms.
    pub(crate) fn rate(&self, i: usize, j: usize) -> Option<f64> {
        self.rates.get((i, j)).copied()
    }
    /// What the coefficient of a term is multiplied by at a torque sample, under this torque of the bodies.
    pub(crate) fn factor(&self, term: JointTerm, i: usize, j: usize, load: f64) -> f64 {
        term.factor(self.moving(i, j, load))
    }
    /// A joint at a torque sample, under this torque of the bodies.
    fn moving(&self, i: usize, j: usize, load: f64) -> Moving {
        let qd = self.rates[(i, j)];
        let sign = match self.near_rest.get(j).copied().flatten() {
            Some(near) => near.sign(qd),
            None => {
                let slow = SLOW * self.fastest[j];
                if slow == 0.0 { 0.0 } else { qd / qd.hypot(slow) }
            }
        };
        Moving { qd, qdd: self.accelerations[(i, j)], sign, load }
    }
    /// Whether a clock of this group may run at another rate, or one of its channels be late beside the others.
    pub(crate) fn retimes(&self, group: usize) -> bool {
        self.of.iter().any(|e| *e == skew(group) || group == 0 && matches!(e, ErrorSource::TorqueLag(_)))
    }
    /// How late every channel of a group is beside the others (s); empty where none may be.
    pub(crate) fn lags(&self, e: &[f64], group: usize, channels: usize) -> Vec<f64> {
        let mut lags = Vec::new();
        for (source, &e) in self.of.iter().zip(e).filter(|_| group == 0) {
            if let ErrorSource::TorqueLag(j) = *source {
                lags.resize(channels, 0.0);
                lags[j] += e;
            }
        }
        lags
    }
    /// Sample times of a group by the clock of the encoders since the first sample of the grid (s), where its own runs slowly by the
    /// size of the skew among `e`; `None` where it does not or is none of the errors.
    pub(crate) fn skewed(&self, e: &[f64], group: usize) -> Option<Arc<[f64]>> {
        let size = self.of.iter().zip(e).find(|(s, _)| **s == skew(group)).map(|(_, &e)| e).filter(|&e| e != 0.0)?;
        Some(self.times[group].iter().map(|t| self.middle + t - size * t).collect())
    }
    fn effect(&self, e: &[f64], group: usize, channels: usize) -> Effect {
        let (mut gain, mut rotation) = (vec![1.0; channels], Vector3::zeros());
        let (mut current, mut load) = (Vec::new(), Vec::new());
        for (source, &e) in self.of.iter().zip(e) {
            match (group, source) {
                (0, ErrorSource::TorqueGain(None)) | (1, ErrorSource::GyroScale(None)) => {
                    gain.iter_mut().for_each(|g| *g += e);
                }
                (0, ErrorSource::TorqueGain(Some(c))) | (1, ErrorSource::GyroScale(Some(c))) => gain[*c] += e,
                (0, ErrorSource::ClockRate) => gain.iter_mut().for_each(|g| *g += e * (2.0 + e)),
                (1, ErrorSource::ClockRate) => gain.iter_mut().for_each(|g| *g += e),
                (1, ErrorSource::GyroRotation(c)) => rotation[*c] += e,
                (0, ErrorSource::DriveGain(j)) => {
                    current.resize(channels, 1.0);
                    current[*j] = e.recip();
                }
                (0, ErrorSource::Joint(j, JointTerm::Load)) => {
                    load.resize(channels, 0.0);
                    load[*j] += e;
                }
                _ => {}
            }
        }
        let turned = rotation != Vector3::zeros();
        let turn = turned.then(|| (quat_to_rot(&exp_so3(&rotation)), right_jacobian(&rotation)));
        Effect { gain, turn, current, load }
    }
    /// What torque `x` of the bodies makes of a channel at a sample, friction in proportion to it among it, and its derivative with respect
    /// to `x`: both in N m.
    fn of_torque(&self, effect: &Effect, i: usize, channel: usize, x: f64) -> (f64, f64) {
        let load = effect.load.get(channel).copied().unwrap_or(0.0);
        let gain = effect.gain[channel];
        if load == 0.0 {
            return (gain * x, gain);
        }
        let sign = self.moving(i, channel, x).sign;
        (gain * x + load * x.abs() * sign, gain + load * sign * if x < 0.0 { -1.0 } else { 1.0 })
    }
    /// One over the gain of the drive of a joint whose current is read, at these sizes; one for a torque.
    pub(crate) fn scale(&self, e: &[f64], group: usize, channel: usize) -> f64 {
        let is = |s: &ErrorSource| group == 0 && *s == ErrorSource::DriveGain(channel);
        self.of.iter().zip(e).find(|(s, _)| is(s)).map_or(1.0, |(_, k)| k.recip())
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
            // What a load does is no offset, but a part of the gain.
            (0, ErrorSource::Joint(_, JointTerm::Load)) => 0.0,
            (0, ErrorSource::Joint(j, term)) if j == channel => term.factor(self.moving(i, j, 0.0)),
            _ => 0.0,
        }
    }
    /// Readings of the sensors `readings` of a group, from what error-free ones would read (readings x channels), in place.
    pub(crate) fn observe(&self, e: &[f64], group: usize, readings: Range<usize>, values: &mut DMatrix<f64>) {
        let effect = self.effect(e, group, values.ncols());
        if effect.is_of_drives() {
            for c in 0..values.ncols() {
                let scale = effect.scale(c);
                for (k, i) in readings.clone().enumerate() {
                    let x = &mut values[(k, c)];
                    *x = (self.of_torque(&effect, i, c, *x).0 + self.added(e, group, i, c)) * scale;
                }
            }
            return;
        }
        effect.apply_rows(values);
        let adds = |(source, e): &(&ErrorSource, &f64)| **e != 0.0 && source.is_added(group);
        for (source, &e) in self.of.iter().zip(e).filter(adds) {
            for c in 0..values.ncols() {
                for (k, i) in readings.clone().enumerate() {
                    values[(k, c)] += e * self.offset(source, group, i, c);
                }
            }
        }
    }
    /// What derivatives of the readings of a group are of those of what error-free sensors would read, the same at all times: gains of the
    /// channels, behind a rotation. `None` where motors are seen, which is [`SensorErrors::observe_rows`].
    pub(crate) fn the_same_always(
        &self,
        e: &[f64],
        group: usize,
        channels: usize,
    ) -> Option<(Vec<f64>, Option<Matrix3<f64>>)> {
        let effect = self.effect(e, group, channels);
        (!effect.is_of_drives()).then(|| (effect.gain, effect.turn.map(|t| t.0)))
    }
    /// What the derivatives `slope` of error-free readings `values` of a group (readings x channels) are of the readings, in place.
    pub(crate) fn turn(
        &self,
        e: &[f64],
        group: usize,
        readings: Range<usize>,
        values: &DMatrix<f64>,
        slope: &mut DMatrix<f64>,
    ) {
        let effect = self.effect(e, group, slope.ncols());
        if !effect.is_of_drives() {
            return effect.apply_rows(slope);
        }
        for c in 0..slope.ncols() {
            for (k, i) in readings.clone().enumerate() {
                slope[(k, c)] *= self.of_torque(&effect, i, c, values[(k, c)]).1 * effect.scale(c);
            }
        }
    }
    /// Derivatives of the readings of motors from those of what error-free sensors would read (row `channels * k + c`), in place; `values` are what these
    /// would read.
    pub(crate) fn observe_rows(
        &self,
        e: &[f64],
        group: usize,
        readings: Range<usize>,
        values: &DMatrix<f64>,
        rows: &mut DMatrix<f64>,
    ) {
        let channels = values.ncols();
        let effect = self.effect(e, group, channels);
        let slope = |(row, i): (usize, usize)| {
            let of = move |c: usize| (i, c, values[(row, c)]);
            (0..channels).map(of).map(|(i, c, x)| self.of_torque(&effect, i, c, x).1 * effect.scale(c))
        };
        let slopes: Vec<f64> = readings.enumerate().flat_map(slope).collect();
        for mut column in rows.column_iter_mut() {
            column.iter_mut().zip(&slopes).for_each(|(d, s)| *d *= s);
        }
    }
    /// Derivatives of the readings of a group with respect to the size of error `k`, given to `put(reading, channel, value)` where
    /// they are not zero. `values` are what error-free sensors would read, `bias` what is added to that (none for none), `slope` their
    /// derivatives with respect to a delay.
    pub(crate) fn column(
        &self,
        k: usize,
        e: &[f64],
        (group, readings): (usize, Range<usize>),
        (values, bias): (&DMatrix<f64>, &[f64]),
        slope: Option<&DMatrix<f64>>,
        mut put: impl FnMut(usize, usize, f64),
    ) {
        let (source, channels) = (self.of[k], values.ncols());
        let effect = self.effect(e, group, channels);
        let gyro = |m: &DMatrix<f64>, row: usize| Vector3::new(m[(row, 0)], m[(row, 1)], m[(row, 2)]);
        // What a unit of error-free torque is in a channel.
        let unit = |row: usize, i: usize, c: usize| self.of_torque(&effect, i, c, values[(row, c)]).1 * effect.scale(c);
        for (row, i) in readings.enumerate() {
            match source {
                ErrorSource::TorqueGain(of) => match of {
                    Some(c) => put(row, c, values[(row, c)] * effect.scale(c)),
                    None => (0..channels).for_each(|c| put(row, c, values[(row, c)] * effect.scale(c))),
                },
                ErrorSource::ClockRate if group == 0 => {
                    let by = 2.0 * (1.0 + e[k]);
                    (0..channels).for_each(|c| put(row, c, by * values[(row, c)] * effect.scale(c)));
                }
                ErrorSource::ClockRate => {
                    let w = effect.turned(gyro(values, row));
                    (0..3).for_each(|c| put(row, c, w[c]));
                }
                ErrorSource::DriveGain(c) => {
                    let bias = bias.get(c).copied().unwrap_or(0.0);
                    let torque = self.of_torque(&effect, i, c, values[(row, c)]).0 + self.added(e, group, i, c) + bias;
                    put(row, c, -torque * effect.scale(c).powi(2));
                }
                ErrorSource::Joint(c, JointTerm::Load) => {
                    let x = values[(row, c)];
                    put(row, c, JointTerm::Load.factor(self.moving(i, c, x)) * effect.scale(c));
                }
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
                        (0..channels).for_each(|c| put(row, c, unit(row, i, c) * t * slope[(row, c)]));
                    }
                }
                ErrorSource::TorqueLag(c) => {
                    let Some(slope) = slope else { continue };
                    put(row, c, unit(row, i, c) * slope[(row, c)]);
                }
                ErrorSource::TorqueDrift(c)
                | ErrorSource::TorqueWalk(c, _)
                | ErrorSource::GyroDrift(c)
                | ErrorSource::GyroWalk(c, _)
                | ErrorSource::Joint(c, _) => put(row, c, self.offset(&source, group, i, c) * effect.scale(c)),
                ErrorSource::Compliance(_)
                | ErrorSource::EncoderLag(_)
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
