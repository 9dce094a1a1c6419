//! Measured and predicted channels side by side.

use super::labelled_record::LabelledRecord;
use super::result::channel::Channel;
use super::row_layout::RowLayout;
use crate::exit::Failure;
use crate::files::atomic;
use crate::files::csv_out;
use crate::files::csv_out::Column;
use ff_model::{JointKind, Model};
use ff_records::file::{Block, ParquetWriter, Stamps};
use ff_records::{ChannelGroup, Record};
use nalgebra::DMatrix;
use std::path::Path;

/// Channels of a record with their prediction: torques, then (for output error) base rates.
#[derive(Clone, Debug, PartialEq)]
pub struct Signals {
    /// Time since the first sample (s).
    pub time: Vec<f64>,
    /// Names, such as `tau.joint1` and `gyro.x`.
    pub names: Vec<String>,
    /// SI units.
    pub units: Vec<&'static str>,
    /// Standard deviations of the sensors.
    pub sigma: Vec<f64>,
    /// N x channels; NaN at times at which the channel was not read.
    pub measured: DMatrix<f64>,
    /// N x channels, biases included.
    pub predicted: DMatrix<f64>,
}

impl Signals {
    /// Those of every record, from residuals one record after the other, of which each has so many `rows`. Allocates.
    ///
    /// # Panics
    /// If there are fewer residuals.
    pub(super) fn of_each(
        model: &Model,
        records: &[LabelledRecord],
        rows: &[usize],
        residuals: &[f64],
        sigma: &[f64],
    ) -> Vec<Self> {
        let mut left = residuals;
        let mut own = |n: usize| {
            let (first, rest) = left.split_at(n);
            left = rest;
            first
        };
        records.iter().zip(rows).map(|(t, &n)| Self::of(model, &t.record, own(n), sigma)).collect()
    }
    /// From whitened residuals `(predicted - measured) / sigma`, in the order of the rows of the estimator.
    ///
    /// # Panics
    /// If there is not one residual per reading of the channels.
    pub fn of(model: &Model, record: &Record, residuals: &[f64], sigma: &[f64]) -> Self {
        let (k, joints) = (sigma.len(), record.joints());
        let layout = RowLayout::of(record, k);
        assert_eq!(residuals.len(), layout.rows(), "one residual per reading");
        let times = |group: ChannelGroup, rows: usize| -> Vec<f64> {
            record.times(group).map_or_else(|| (0..rows).map(|i| record.time(i)).collect(), <[f64]>::to_vec)
        };
        let torque = times(ChannelGroup::Torque, record.tau().nrows());
        let gyro = if k > joints { times(ChannelGroup::Gyro, record.gyro().nrows()) } else { torque.clone() };
        let mut time = torque.clone();
        if gyro != torque {
            time.extend(&gyro);
            time.sort_unstable_by(f64::total_cmp);
            time.dedup();
        }
        let blank = || DMatrix::from_element(time.len(), k, f64::NAN);
        let (mut measured, mut predicted) = (blank(), blank());
        for c in 0..k {
            let (values, column, own) =
                if c < joints { (record.tau(), c, &torque) } else { (record.gyro(), c - joints, &gyro) };
            let mut at = 0;
            for (i, t) in own.iter().enumerate() {
                at += time[at..].partition_point(|x| x < t);
                measured[(at, c)] = values[(i, column)];
                predicted[(at, c)] = values[(i, column)] + sigma[c] * residuals[layout.row(c, i)];
            }
        }
        let torque = |(j, b): (usize, &ff_model::Body)| match (record.currents().get(j), b.joint.kind) {
            (Some(true), _) => "A",
            (_, JointKind::Prismatic) => "N",
            _ => "N m",
        };
        let mut units: Vec<&'static str> = model.own_bodies().enumerate().map(torque).collect();
        units.resize(k, "rad/s");
        let mut names = record.response_names();
        names.truncate(k);
        Self { time, names, units, sigma: sigma.to_vec(), measured, predicted }
    }
    /// Residuals of the readings of a channel, and their rate (Hz). Allocates.
    pub fn readings(&self, k: usize) -> (Vec<f64>, f64) {
        let all = self.residual(k);
        let read: Vec<usize> = (0..all.len()).filter(|&i| !all[i].is_nan()).collect();
        let span = match (read.first(), read.last()) {
            (Some(&a), Some(&b)) => self.time[b] - self.time[a],
            _ => 0.0,
        };
        let rate = if span > 0.0 { (read.len() - 1) as f64 / span } else { 0.0 };
        (read.iter().map(|&i| all[i]).collect(), rate)
    }
    /// Time, measured and predicted values of a channel where it was read. Allocates.
    pub fn curve(&self, k: usize) -> [Vec<f64>; 3] {
        let read = (0..self.time.len()).filter(|&i| !self.measured[(i, k)].is_nan());
        let mut out: [Vec<f64>; 3] = Default::default();
        for i in read {
            out[0].push(self.time[i]);
            out[1].push(self.measured[(i, k)]);
            out[2].push(self.predicted[(i, k)]);
        }
        out
    }
    /// Residual `measured - predicted` of a channel, NaN at times at which it was not read. Allocates.
    pub fn residual(&self, k: usize) -> Vec<f64> {
        self.measured.column(k).iter().zip(self.predicted.column(k).iter()).map(|(m, p)| m - p).collect()
    }
    /// Every channel in a line.
    pub fn channels(&self) -> Vec<Channel> {
        let rms = |x: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = x.filter(|v| !v.is_nan()).fold((0.0, 0usize), |(s, n), v| (s + v * v, n + 1));
            (sum / count.max(1) as f64).sqrt()
        };
        (0..self.names.len())
            .map(|k| {
                let residual_rms = rms(&mut self.residual(k).into_iter());
                Channel {
                    name: self.names[k].clone(),
                    unit: self.units[k].to_owned(),
                    signal_rms: rms(&mut self.measured.column(k).iter().copied()),
                    residual_rms,
                    over_noise: residual_rms / self.sigma[k],
                }
            })
            .collect()
    }
    /// Writes time, and measured, predicted and residual of every channel, as Parquet: columns `name[unit]` of doubles.
    ///
    /// # Errors
    /// [`Failure::Io`].
    pub fn write_parquet(&self, path: &Path) -> Result<(), Failure> {
        let mut names = vec!["time[s]".to_owned()];
        let mut block = Block::new(1 + 3 * self.names.len());
        block.stamps = Stamps::Real(self.time.clone());
        for (k, name) in self.names.iter().enumerate() {
            let parts = ["measured", "predicted", "residual"];
            names.extend(parts.iter().map(|p| format!("{name}.{p}[{}]", self.units[k])));
            block.columns[3 * k + 1] = self.measured.column_range(k).to_vec();
            block.columns[3 * k + 2] = self.predicted.column_range(k).to_vec();
            block.columns[3 * k + 3] = self.residual(k);
        }
        atomic::stream(path, |f| {
            let mut w = ParquetWriter::new(std::io::BufWriter::new(f), &names, false)?;
            w.write(&block)?;
            std::io::Write::flush(&mut w.finish()?)
        })
    }
    /// Writes time, and measured, predicted and residual of every channel.
    ///
    /// # Errors
    /// Those of [`csv_out::write_with_gaps`].
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let residuals: Vec<Vec<f64>> = (0..self.names.len()).map(|k| self.residual(k)).collect();
        let mut columns = vec![Column::new("time", "s", &self.time)];
        for (k, name) in self.names.iter().enumerate() {
            let (m, p) = (self.measured.column_range(k), self.predicted.column_range(k));
            columns.push(Column::new(format!("{name}.measured"), self.units[k], m));
            columns.push(Column::new(format!("{name}.predicted"), self.units[k], p));
            columns.push(Column::new(format!("{name}.residual"), self.units[k], &residuals[k]));
        }
        csv_out::write_with_gaps(path, &columns)
    }
}

/// A column as the slice it is stored as.
trait ColumnRange {
    fn column_range(&self, k: usize) -> &[f64];
}

impl ColumnRange for DMatrix<f64> {
    fn column_range(&self, k: usize) -> &[f64] {
        let n = self.nrows();
        &self.as_slice()[k * n..(k + 1) * n]
    }
}
