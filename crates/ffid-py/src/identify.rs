//! Identification and what follows from it.

use crate::arrays::{array2, table};
use crate::errors::{guarded, internal, json, problems, refused};
use crate::mission::{Mission, or_refused};
use crate::record::Record;
use crate::watch::watched;
use ffid::exit::Exit;
use ffid::mission::Leniency;
use ffid::model::Problems;
use ffid::workflow::identify::{IdentificationResult, Observer, Signals};
use ffid_cli::session;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Mutex;

/// An identification with what its files need.
#[pyclass(frozen, module = "ffid._ffid")]
pub(crate) struct Identification {
    /// Saving adds warnings to the result.
    inner: Mutex<session::Identification>,
    file: PathBuf,
    leniency: Leniency,
}

impl Identification {
    fn with<R>(&self, f: impl FnOnce(&mut session::Identification) -> PyResult<R>) -> PyResult<R> {
        let mut inner = self.inner.lock().map_err(|_| internal("a call on this result failed before"))?;
        f(&mut inner)
    }
}

#[pymethods]
impl Identification {
    /// `result.json`.
    fn json(&self) -> PyResult<String> {
        self.with(|i| json(&i.found.result))
    }
    /// The report in words.
    fn text(&self) -> PyResult<String> {
        self.with(|i| Ok(i.found.result.to_string()))
    }
    fn problems(&self) -> PyResult<String> {
        self.with(|i| json(&i.problems))
    }
    #[getter]
    fn exit(&self) -> PyResult<u8> {
        self.with(|i| Ok(i.exit.code()))
    }
    /// The covariance of parameters and nuisance.
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.with(|i| {
            let rows = &i.found.result.covariance.rows;
            table(py, rows.concat(), [rows.len(), rows.first().map_or(0, Vec::len)])
        })
    }
    /// Signals of record `k`, or of the data that were held out: time, measured, predicted, names, units, standard deviations.
    fn signals<'py>(&self, py: Python<'py>, k: Option<usize>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.with(|i| {
            let s = match k {
                Some(k) => i.found.signals.get(k),
                None => i.held.as_ref(),
            };
            s.map(|s| signals(py, s)).transpose()
        })
    }
    fn save(&self, py: Python<'_>, folder: PathBuf, replace: bool, png: bool) -> PyResult<String> {
        let saved = py.detach(|| guarded(|| self.inner.lock().map(|mut i| i.save(&folder, replace, png)).ok()))?;
        let warnings: Problems = or_refused(saved.ok_or_else(|| internal("a call on this result failed before"))?)?;
        json(&warnings)
    }
    fn report(&self, py: Python<'_>) -> PyResult<String> {
        let page = py.detach(|| guarded(|| self.inner.lock().map(|i| i.report()).ok()))?;
        page.ok_or_else(|| internal("a call on this result failed before"))?.map_err(|e| internal(&e.to_string()))
    }
    /// The mission with the estimates in place.
    fn mission(&self) -> PyResult<Mission> {
        self.with(|i| {
            let mut opened = i.opened.clone();
            let values: Vec<(usize, f64)> = i.found.selected.iter().map(|&k| (k, i.found.values[k])).collect();
            opened.model.set_nominal(&values).map_err(|p| problems(&p, Exit::Numerical.code()))?;
            let changed = i.found.selected.clone();
            Ok(Mission { changed, ..Mission::new(self.file.clone(), opened, self.leniency.clone()) })
        })
    }
}

fn signals<'py>(py: Python<'py>, s: &Signals) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    all.set_item("t", PyArray1::from_slice(py, &s.time))?;
    all.set_item("measured", array2(py, &s.measured)?)?;
    all.set_item("predicted", array2(py, &s.predicted)?)?;
    all.set_item("names", &s.names)?;
    all.set_item("units", &s.units)?;
    all.set_item("sigma", PyArray1::from_slice(py, &s.sigma))?;
    Ok(all)
}

/// Identifies with the options of `ffid identify`.
#[pyfunction]
pub(crate) fn identify(
    py: Python<'_>,
    mission: Py<Mission>,
    records: Vec<Py<Record>>,
    held_out: Option<Py<Record>>,
    options: Vec<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Identification> {
    let m = mission.get();
    let found = watched(py, progress, |stop, tell| {
        let given: Vec<session::Given> = records.iter().map(|r| r.get().given.clone()).collect();
        let held = held_out.as_ref().map(|r| &r.get().given);
        let show = |n: usize, chi2: f64| _ = tell.send(("fit", n, chi2));
        let watch = Observer { stop: Some(stop), progress: Some(&show) };
        session::identify(&m.file, &m.opened, &given, held, &options, &watch)
    })?;
    let inner = Mutex::new(or_refused(found)?);
    Ok(Identification { inner, file: m.file.clone(), leniency: m.leniency.clone() })
}

/// `result.json` of a folder that is complete and untouched, and the code that its identification ended with.
#[pyfunction]
pub(crate) fn load_result(folder: PathBuf) -> PyResult<(String, u8)> {
    let result = or_refused(guarded(|| session::load_result(&folder))?)?;
    Ok((json(&result)?, result.exit().code()))
}

/// The verdict of `ffid validate` on a record (JSON), in words, and its signals. `result` is the text of a `result.json`.
#[pyfunction]
pub(crate) fn validate<'py>(
    py: Python<'py>,
    mission: Py<Mission>,
    result: &str,
    record: Py<Record>,
    options: Vec<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String, Bound<'py, PyDict>)> {
    let result = IdentificationResult::from_json(result.as_bytes()).map_err(|e| internal(&e))?;
    let m = mission.get();
    let found = watched(py, progress, |stop, tell| {
        let show = |n: usize, chi2: f64| _ = tell.send(("validate", n, chi2));
        let watch = Observer { stop: Some(stop), progress: Some(&show) };
        session::validate(&m.file, &m.opened, &result, &record.get().given, &options, &watch)
    })?;
    let (held, of) = found.map_err(|r| refused(&r))?;
    Ok((json(&held)?, held.to_string(), signals(py, &of)?))
}
