//! Measured and predicted channels side by side.

use super::result::Channel;
use crate::exit::Failure;
use crate::files::atomic;
use crate::files::csv_out;
use crate::files::csv_out::Column;
use ff_model::{JointKind, Model};
use ff_records::Record;
use ff_records::file::{Block, ParquetWriter, Stamps};
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
    /// N x channels.
    pub measured: DMatrix<f64>,
    /// N x channels, biases included.
    pub predicted: DMatrix<f64>,
}

impl Signals {
    /// From whitened residuals `(predicted - measured) / sigma`, sample after sample.
    ///
    /// # Panics
    /// If there is not one residual per sample and channel.
    pub fn of(model: &Model, record: &Record, residuals: &[f64], sigma: &[f64]) -> Self {
        let (n, k) = (record.samples(), sigma.len());
        assert_eq!(residuals.len(), n * k, "one residual per sample and channel");
        let measured = record.responses().columns(0, k).into_owned();
        let predicted = DMatrix::from_fn(n, k, |i, j| measured[(i, j)] + sigma[j] * residuals[i * k + j]);
        let torque = |b: &ff_model::Body| if b.joint.kind == JointKind::Prismatic { "N" } else { "N m" };
        let mut units: Vec<&'static str> = model.bodies().iter().map(torque).collect();
        units.resize(k, "rad/s");
        let mut names = record.response_names();
        names.truncate(k);
        Self {
            time: (0..n).map(|i| i as f64 / record.rate_hz()).collect(),
            names,
            units,
            sigma: sigma.to_vec(),
            measured,
            predicted,
        }
    }
    /// Residual `measured - predicted` of a channel. Allocates.
    pub fn residual(&self, k: usize) -> Vec<f64> {
        self.measured.column(k).iter().zip(self.predicted.column(k).iter()).map(|(m, p)| m - p).collect()
    }
    /// Every channel in a line.
    pub fn channels(&self) -> Vec<Channel> {
        let rms =
            |x: &mut dyn Iterator<Item = f64>| (x.map(|v| v * v).sum::<f64>() / self.time.len().max(1) as f64).sqrt();
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
    /// Those of [`csv_out::write`].
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let residuals: Vec<Vec<f64>> = (0..self.names.len()).map(|k| self.residual(k)).collect();
        let mut columns = vec![Column::new("time", "s", &self.time)];
        for (k, name) in self.names.iter().enumerate() {
            let (m, p) = (self.measured.column_range(k), self.predicted.column_range(k));
            columns.push(Column::new(format!("{name}.measured"), self.units[k], m));
            columns.push(Column::new(format!("{name}.predicted"), self.units[k], p));
            columns.push(Column::new(format!("{name}.residual"), self.units[k], &residuals[k]));
        }
        csv_out::write(path, &columns)
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
