//! Records.

use crate::arrays::{Numbers, array2, matrix, maybe, numbers, numbers_or_nan};
use crate::errors::{guarded, or_refused, problems};
use crate::mission::Mission;
use ffid::files::folder::Entry;
use ffid::model::BaseKind;
use ffid::records::{ChannelGroup, Record as Samples, RecordBuilder};
use ffid_cli::session::{Given, given, read_columns, read_record};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// A record of a robot.
#[pyclass(frozen, module = "ffid._ffid")]
pub(crate) struct Record {
    pub(crate) given: Given,
}

#[pymethods]
impl Record {
    /// Reads a file with options of `ffid doctor`.
    #[staticmethod]
    fn read(py: Python<'_>, mission: &Mission, path: PathBuf, options: Vec<String>) -> PyResult<Self> {
        let read = py.detach(|| guarded(|| read_record(&mission.opened.model, &path, &options)))?;
        Ok(Self { given: or_refused(read)? })
    }
    /// From columns by `name[unit]`, each `(N,)`, with options of `ffid doctor`.
    #[staticmethod]
    fn from_columns(
        py: Python<'_>,
        mission: &Mission,
        name: PathBuf,
        columns: &Bound<'_, PyDict>,
        options: Vec<String>,
    ) -> PyResult<Self> {
        let mut all: Vec<(String, Vec<f64>)> = Vec::new();
        for (column, x) in columns {
            let column: String = column.extract()?;
            let rows = all.first().map(|(_, x)| x.len());
            let x = numbers_or_nan(&column, &x, &[rows])?.as_slice()?.to_vec();
            all.push((column, x));
        }
        let read = py.detach(|| guarded(|| read_columns(&mission.opened.model, &name, &all, &options)))?;
        Ok(Self { given: or_refused(read)? })
    }
    /// From arrays, one row per sample: `t`, `q`, `tau`, and perhaps `gyro`, `qd`, `qdd`, `acc`, `att`; `t_tau`, `t_gyro`, `t_acc` and `t_att`
    /// for groups that are sampled at times of their own.
    #[staticmethod]
    fn build(
        mission: &Mission,
        name: PathBuf,
        arrays: &Bound<'_, PyDict>,
        resample: bool,
        keep_spikes: bool,
        allow: Vec<String>,
    ) -> PyResult<Self> {
        let model = &mission.opened.model;
        let get = |key: &str| arrays.get_item(key).map(|x| x.filter(|x| !x.is_none()));
        let absent = arrays.py().None().into_bound(arrays.py());
        let need = |key: &str| Ok::<_, PyErr>(get(key)?.unwrap_or_else(|| absent.clone()));
        let t = numbers("t", &need("t")?, &[None])?;
        let mut leniency = mission.leniency.clone();
        leniency.allow.extend(allow.iter().cloned());
        let mut all: Vec<Numbers<'_>> = Vec::new();
        let joints = model.joint_names().len();
        // As files are read.
        let mut builder = RecordBuilder::new(model.joint_names())
            .stamps(t.as_slice()?.to_vec())
            .resample(resample)
            .keep_spikes(keep_spikes)
            .long_gaps(true)
            .need_samples(8);
        for code in ffid::mission::leniency::ALLOWABLE.iter().filter(|c| leniency.allows(c)) {
            builder = builder.allow(*code);
        }
        if model.base_kind() == BaseKind::Fixed {
            builder = builder.fixed_base();
        }
        let n = t.shape()[0];
        all.push(t);
        type Put = fn(RecordBuilder, nalgebra::DMatrix<f64>) -> RecordBuilder;
        let channels: [(&str, usize, Option<(&str, ChannelGroup)>, Put); 7] = [
            ("q", joints, None, RecordBuilder::q),
            ("qd", joints, None, RecordBuilder::qd),
            ("qdd", joints, None, RecordBuilder::qdd),
            ("tau", joints, Some(("t_tau", ChannelGroup::Torque)), RecordBuilder::tau),
            ("gyro", 3, Some(("t_gyro", ChannelGroup::Gyro)), RecordBuilder::gyro),
            ("acc", 3, Some(("t_acc", ChannelGroup::Accelerometer)), RecordBuilder::acc),
            ("att", 4, Some(("t_att", ChannelGroup::Attitude)), RecordBuilder::att),
        ];
        for (key, columns, own, put) in channels {
            let mut rows = n;
            if let Some((time, group)) = own
                && let Some(times) = maybe(time, get(time)?.as_ref(), &[None])?
            {
                rows = times.shape()[0];
                builder = builder.times(group, times.as_slice()?.to_vec());
                all.push(times);
            }
            let shape = [Some(rows), Some(columns)];
            let given = get(key)?;
            let x = if matches!(key, "q" | "tau") {
                Some(numbers(key, &need(key)?, &shape)?)
            } else {
                maybe(key, given.as_ref(), &shape)?
            };
            if let Some(x) = x {
                builder = put(builder, matrix(&x)?);
                all.push(x);
            }
        }
        let slices: Vec<&[f64]> = all.iter().map(Numbers::as_slice).collect::<PyResult<_>>()?;
        let source = Entry::of_numbers(&slices, name.to_string_lossy());
        let (record, warnings) = guarded(|| builder.build())?.map_err(|p| problems(&p.in_file(&name), 12))?;
        Ok(Self { given: or_refused(given(model, &name, record, warnings.in_file(&name), source, &leniency))? })
    }
    #[getter]
    fn name(&self) -> PathBuf {
        self.given.path.clone()
    }
    fn warnings(&self) -> PyResult<String> {
        crate::errors::json(&self.given.warnings)
    }
    /// Samples, rate (Hz), time of the first sample (s).
    fn clock(&self) -> (usize, f64, f64) {
        let r = &self.given.record;
        (r.samples(), r.rate_hz(), r.t0())
    }
    /// Sample times (s) of a group of channels: `q`, `tau`, `gyro`, `acc` or `att`.
    fn times<'py>(&self, py: Python<'py>, group: &str) -> Bound<'py, PyArray1<f64>> {
        let r = &self.given.record;
        let group = match group {
            "tau" => ChannelGroup::Torque,
            "gyro" => ChannelGroup::Gyro,
            "acc" => ChannelGroup::Accelerometer,
            "att" => ChannelGroup::Attitude,
            _ => ChannelGroup::Motion,
        };
        let t = match r.times(group) {
            Some(own) => own.iter().map(|t| r.t0() + t).collect(),
            None => (0..r.samples()).map(|i| r.t0() + r.time(i)).collect(),
        };
        PyArray1::from_vec(py, t)
    }
    /// Whether all channels are sampled on one even clock.
    #[getter]
    fn is_uniform(&self) -> bool {
        self.given.record.is_uniform()
    }
    /// A channel as an array; none where the record does not have it.
    fn channel<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let r: &Samples = &self.given.record;
        let m = match name {
            "q" => Some(r.q()),
            "qd" => r.qd(),
            "qdd" => r.qdd(),
            "tau" => Some(r.tau()),
            "gyro" => Some(r.gyro()).filter(|_| !r.is_fixed_base()),
            "acc" => r.acc(),
            _ => r.att(),
        };
        m.map(|m| Ok(array2(py, m)?.into_any())).transpose()
    }
}
