//! How what moves slowly has moved, at the end of a fit.

use super::error::IdentifyError;
use super::fitted::Fitted;
use super::labelled_record::LabelledRecord;
use super::number::num;
use super::over_time::{AXES, OverTime};
use super::unknowns::Unknowns;
use ff_model::Model;
use ident::uncertain::ErrorSource;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Something that changes, as an identification found it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Course {
    /// A parameter, or the bias of a channel: `tank.mass`, `gyro.bias.x`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// The record within which a bias walks; absent for what changes from record to record.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub record: Option<String>,
    /// In the order of time.
    pub points: Vec<CoursePoint>,
}

/// A point of a [`Course`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoursePoint {
    /// Seconds since the first sample of the record, or the number of the record from 1.
    pub at: f64,
    /// The record.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub record: Option<String>,
    /// Value there.
    pub value: f64,
    /// Its standard deviation; absent where it is not determined.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub std: Option<f64>,
}

/// Points of a course that are listed.
const LISTED: usize = 12;

impl fmt::Display for Course {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = |p: &CoursePoint| match p.std {
            Some(s) => format!("{} +- {}", num(p.value), num(s)),
            None => format!("{} (not determined)", num(p.value)),
        };
        let Some(record) = &self.record else {
            writeln!(f, "  {} ({}), record by record", self.name, self.unit)?;
            let skipped = self.points.len().saturating_sub(LISTED);
            if skipped > 0 {
                writeln!(f, "    the first {skipped} are in result.json")?;
            }
            return self
                .points
                .iter()
                .skip(skipped)
                .try_for_each(|p| writeln!(f, "    {:24} {}", p.record.as_deref().unwrap_or_default(), value(p)));
        };
        let of = |p: &CoursePoint| format!("{} at {} s", value(p), num(p.at));
        let ends: Vec<String> = self.points.first().into_iter().chain(self.points.last()).map(of).collect();
        writeln!(f, "  {} ({}) within {record}: {}", self.name, self.unit, ends.join(", "))
    }
}

impl Course {
    /// Of everything that changes, at the end of a fit. `all` are the parameters of the model there. Allocates.
    pub(super) fn all(
        over: &OverTime,
        model: &Model,
        records: &[LabelledRecord],
        unknowns: &Unknowns,
        (f, values): (&Fitted, &[f64]),
    ) -> Result<Vec<Self>, IdentifyError> {
        let (e, n) = (&f.estimate, f.selected.len());
        let covariance = &e.uncertainty.covariance;
        let unknown = |name: &str| {
            let selected = f.selected.iter().position(|&i| unknowns.decls[i].name == name);
            selected.map(|k| (k, e.values[f.selected[k]]))
        };
        let beside = |name: &str| {
            let k = e.nuisance.iter().position(|p| p.name == name)?;
            Some((n + k, e.nuisance[k].value))
        };
        let determined =
            |w: &DVector<f64>| w.iter().zip(&e.uncertainty.deviation).all(|(w, s)| *w == 0.0 || s.is_some());
        let deviation = |w: &DVector<f64>| {
            let variance = (w.transpose() * covariance * w)[(0, 0)];
            (determined(w) && variance >= 0.0).then(|| variance.sqrt())
        };
        let mut out = Vec::new();
        let columns = unknowns.columns(&f.selected, &e.values)?;
        for (&(i, _), name) in over.changing.iter().zip(&over.names) {
            let mut weights = DVector::zeros(covariance.ncols());
            for (k, column) in columns.iter().enumerate() {
                weights[k] = column.iter().filter(|c| c.0 == i).map(|c| c.1).sum();
            }
            let mut value = values[i];
            let mut points = Vec::new();
            for (epoch, label) in over.labels.iter().enumerate().rev() {
                points.push(CoursePoint {
                    at: (epoch + 1) as f64,
                    record: Some(label.clone()),
                    value,
                    std: deviation(&weights),
                });
                if let Some((k, step)) = unknown(&format!("{label}.step.{name}")) {
                    value -= step;
                    weights[k] -= 1.0;
                }
            }
            points.reverse();
            let unit = model.param_decls()[i].unit.to_owned();
            out.push(Self { name: name.clone(), unit, record: None, points });
        }
        let joints = model.joint_names();
        for (k, labelled) in records.iter().enumerate() {
            let own = over.walks_of(k);
            let full = |name: String| if records.len() > 1 { format!("{}.{name}", labelled.label) } else { name };
            let mut channels: Vec<(String, bool)> = joints.iter().map(|j| (j.clone(), true)).collect();
            channels.extend(AXES.map(|a| (a.to_owned(), false)));
            for (channel, torque) in channels {
                let group = if torque { "torque" } else { "gyro" };
                let walk = format!("{group}.walk.{channel}[");
                let parts: Vec<&ErrorSource> = own.iter().filter(|s| s.name(&joints).starts_with(&walk)).collect();
                if parts.is_empty() {
                    continue;
                }
                let bias = format!("{group}.bias.{channel}");
                let mut weights = DVector::zeros(covariance.ncols());
                let mut value = 0.0;
                if let Some((c, start)) = beside(&full(bias.clone())) {
                    (weights[c], value) = (1.0, start);
                }
                let mut points = vec![CoursePoint { at: 0.0, record: None, value, std: deviation(&weights) }];
                for source in parts {
                    let (ErrorSource::TorqueWalk(_, part) | ErrorSource::GyroWalk(_, part)) = source else { continue };
                    let Some((c, step)) = unknown(&full(source.name(&joints))) else { continue };
                    value += step;
                    weights[c] = 1.0;
                    let at = f64::from(part.index + 1) * f64::from(part.every_ms) / 1e3;
                    points.push(CoursePoint { at, record: None, value, std: deviation(&weights) });
                }
                let unit = if torque { "N m" } else { "rad/s" }.to_owned();
                let record = Some(labelled.label.clone());
                out.push(Self { name: bias, unit, record, points });
            }
        }
        Ok(out)
    }
}
