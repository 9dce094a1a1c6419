//! Records.

use crate::arrays::{Numbers, array2, matrix, maybe, numbers};
use crate::errors::{guarded, problems};
use crate::mission::{Mission, or_refused};
use ffid::dynamics::{Readings, SensorSuite, Trace, measure};
use ffid::files::folder::Entry;
use ffid::model::{BaseKind, Model};
use ffid::records::{Record as Samples, RecordBuilder};
use ffid_cli::session::{Given, given, read_record};
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
    /// From arrays, one row per sample: `t`, `q`, `tau`, and perhaps `gyro`, `qd`, `qdd`, `acc`, `att`.
    #[staticmethod]
    fn build(
        mission: &Mission,
        name: PathBuf,
        arrays: &Bound<'_, PyDict>,
        resample: bool,
        allow: Vec<String>,
    ) -> PyResult<Self> {
        let model = &mission.opened.model;
        let get = |key: &str| arrays.get_item(key).map(|x| x.filter(|x| !x.is_none()));
        let absent = arrays.py().None().into_bound(arrays.py());
        let need = |key: &str| Ok::<_, PyErr>(get(key)?.unwrap_or_else(|| absent.clone()));
        let t = numbers("t", &need("t")?, &[None])?;
        let n = Some(t.shape()[0]);
        let n_by = |columns: usize| [n, Some(columns)];
        let mut leniency = mission.leniency.clone();
        leniency.allow.extend(allow.iter().cloned());
        let mut all: Vec<Numbers<'_>> = Vec::new();
        let joints = model.nj();
        let mut builder = RecordBuilder::new(model.joint_names()).stamps(t.as_slice()?.to_vec()).resample(resample);
        for code in ffid::mission::leniency::ALLOWABLE.iter().filter(|c| leniency.allows(c)) {
            builder = builder.allow(*code);
        }
        if model.base_kind() == BaseKind::Fixed {
            builder = builder.fixed_base();
        }
        let q = numbers("q", &need("q")?, &n_by(joints))?;
        let tau = numbers("tau", &need("tau")?, &n_by(joints))?;
        builder = builder.q(matrix(&q)?).tau(matrix(&tau)?);
        all.extend([t, q, tau]);
        type Put = fn(RecordBuilder, nalgebra::DMatrix<f64>) -> RecordBuilder;
        let optional: [(&str, usize, Put); 5] = [
            ("gyro", 3, RecordBuilder::gyro),
            ("qd", joints, RecordBuilder::qd),
            ("qdd", joints, RecordBuilder::qdd),
            ("acc", 3, RecordBuilder::acc),
            ("att", 4, RecordBuilder::att),
        ];
        for (key, columns, put) in optional {
            if let Some(x) = maybe(key, get(key)?.as_ref(), &n_by(columns))? {
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
    /// A channel as an array; none where the record does not have it.
    fn channel<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let r: &Samples = &self.given.record;
        let m = match name {
            "t" => {
                let t = (0..r.samples()).map(|i| r.t0() + r.time(i)).collect();
                return Ok(Some(PyArray1::from_vec(py, t).into_any()));
            }
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

/// What sensors with a seed read of a simulation, or the exact values, as arrays by name.
pub(crate) fn traced<'py>(
    py: Python<'py>,
    model: &Model,
    trace: &Trace,
    rate_hz: f64,
    noise: Option<(&SensorSuite, u64)>,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    // As in the files of `ffid simulate`, so that both give the same records.
    let t: Vec<f64> = (0..trace.len()).map(|i| i as f64 / rate_hz).collect();
    all.set_item("t", PyArray1::from_vec(py, t))?;
    let floats = model.base_kind() == BaseKind::Floating;
    match noise {
        Some((sensors, seed)) => {
            let Readings { q, tau, gyro, .. } = measure(trace, sensors, seed);
            all.set_item("q", array2(py, &q)?)?;
            all.set_item("tau", array2(py, &tau)?)?;
            if floats {
                all.set_item("gyro", array2(py, &gyro)?)?;
            }
        }
        None => {
            for (name, m) in [("q", &trace.q), ("qd", &trace.qd), ("qdd", &trace.qdd), ("tau", &trace.tau)] {
                all.set_item(name, array2(py, m)?)?;
            }
            if floats {
                all.set_item("gyro", array2(py, &trace.gyro())?)?;
                all.set_item("att", array2(py, &trace.att)?)?;
                all.set_item("pos", array2(py, &trace.pos)?)?;
            }
            all.set_item("eta", array2(py, &trace.eta)?)?;
        }
    }
    Ok(all)
}
