//! Identification and what follows from it.

use crate::arrays::{array2, table};
use crate::errors::{guarded, internal, json, or_refused, problems, refused};
use crate::mission::Mission;
use crate::record::Record;
use crate::watch::watched;
use ffid::exit::Exit;
use ffid::mission::Leniency;
use ffid::model::Problems;
use ffid::workflow::identify::model_files::prior_means;
use ffid::workflow::identify::{IdentificationResult, Interim, Observer, Signals};
use ffid_cli::session;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::cell::RefCell;
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
    /// Draws from the posterior: names, units, how many are parameters, values `(chains, draws, names)`, logarithms of the density
    /// `(chains, draws)`, trajectories that diverged.
    fn draws<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.with(|i| {
            let Some(d) = &i.found.draws else { return Ok(None) };
            let (chains, n, width) = (d.chains.len(), d.len(), d.names.len());
            let all = PyDict::new(py);
            all.set_item("names", &d.names)?;
            all.set_item("units", &d.units)?;
            all.set_item("parameters", d.parameters)?;
            all.set_item("values", PyArray1::from_vec(py, d.chains.concat().concat()).reshape([chains, n, width])?)?;
            all.set_item("lp", PyArray1::from_vec(py, d.log_density.concat()).reshape([chains, n])?)?;
            all.set_item("divergences", d.divergences)?;
            Ok(Some(all))
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
            if let Some(m) = &mut opened.mission {
                m.prior_means = prior_means(m, i.found.result.had_prior(), &i.opened.model, &i.found.values);
            }
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

/// What [`identify`] returns: the identification, what was kept of a fit that was ended (values by name, chi-squared per residual,
/// linearisations), and what ended it.
type Ended = (Option<Identification>, Option<(Vec<(String, f64)>, f64, usize)>, Option<PyErr>);

/// Identifies with the options of `ffid identify`; `without` are payloads and the places of records in which they were not mounted.
#[pyfunction]
pub(crate) fn identify(
    py: Python<'_>,
    mission: Py<Mission>,
    records: Vec<Py<Record>>,
    held_out: Option<Py<Record>>,
    without: Vec<(String, usize)>,
    options: Vec<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Ended> {
    let m = mission.get();
    let ((found, kept), broken) = watched(py, progress, |stop, tell| {
        let mut given: Vec<session::Given> = records.iter().map(|r| r.get().given.clone()).collect();
        for (payload, record) in without {
            given[record].without.push(payload);
        }
        let held = held_out.as_ref().map(|r| &r.get().given);
        let show = |n: usize, chi2: f64| _ = tell.send(("fit", n, chi2));
        let kept = RefCell::new(None);
        let watch = Observer { stop: Some(stop), progress: Some(&show), kept: Some(&kept), ..Observer::default() };
        let found = session::identify(&m.file, &m.opened, &given, held, &options, &watch);
        (found, kept.into_inner())
    })?;
    let of_file = |i| Identification { inner: Mutex::new(i), file: m.file.clone(), leniency: m.leniency.clone() };
    match (found, broken) {
        (Ok(found), broken) => Ok((Some(of_file(found)), None, broken)),
        (Err(_), Some(broken)) => {
            let decls = m.opened.model.param_decls();
            let named = |k: Interim| {
                let values = m.opened.estimated.iter().map(|&i| (decls[i].name.clone(), k.values[i])).collect();
                (values, k.chi2_per_residual, k.linearisations)
            };
            Ok((None, kept.map(named), Some(broken)))
        }
        (Err(e), None) => Err(refused(&e)),
    }
}

/// `result.json` of a folder that is complete and untouched, and the code that its identification ended with.
#[pyfunction]
pub(crate) fn load_result(folder: PathBuf) -> PyResult<(String, u8)> {
    let result = or_refused(guarded(|| session::load_result(&folder))?)?;
    Ok((json(&result)?, result.exit().code()))
}

/// What [`validate`] returns: verdict (JSON), in words, its signals, problems (JSON), exit code.
type Validated<'py> = (String, String, Bound<'py, PyDict>, String, u8);

/// The verdict of `ffid validate` on a record. `result` is the text of a `result.json`.
#[pyfunction]
pub(crate) fn validate<'py>(
    py: Python<'py>,
    mission: Py<Mission>,
    result: &str,
    record: Py<Record>,
    options: Vec<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Validated<'py>> {
    let result = IdentificationResult::from_json(result.as_bytes()).map_err(|e| internal(&e))?;
    let m = mission.get();
    let (found, broken) = watched(py, progress, |stop, tell| {
        let show = |n: usize, chi2: f64| _ = tell.send(("validate", n, chi2));
        let watch = Observer { stop: Some(stop), progress: Some(&show), ..Observer::default() };
        session::validate(&m.file, &m.opened, &result, &record.get().given, &options, &watch)
    })?;
    if let Some(e) = broken {
        return Err(e);
    }
    let v = or_refused(found)?;
    Ok((json(&v.held)?, v.held.to_string(), signals(py, &v.signals)?, json(&v.problems)?, v.exit.code()))
}

/// What `ffid doctor` finds in records: the diagnosis (JSON), in words, problems (JSON), exit code.
#[pyfunction]
pub(crate) fn doctor(
    py: Python<'_>,
    mission: Py<Mission>,
    records: Vec<Py<Record>>,
    options: Vec<String>,
) -> PyResult<(String, String, String, u8)> {
    let m = mission.get();
    let found = py.detach(|| {
        guarded(|| {
            let given: Vec<session::Given> = records.iter().map(|r| r.get().given.clone()).collect();
            session::doctor(&m.file, &m.opened, &given, &options)
        })
    })?;
    let d = or_refused(found)?;
    Ok((json(&d.diagnosis)?, d.diagnosis.to_string(), json(&d.problems)?, d.exit.code()))
}

/// Columns of numbers of a Parquet file by name.
#[pyfunction]
pub(crate) fn read_table(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let read = py.detach(|| guarded(|| ffid::records::file::read_table(&path)))?;
    let all = PyDict::new(py);
    for (name, column) in read.map_err(|p| problems(&p, p.exit_code()))? {
        all.set_item(name, PyArray1::from_vec(py, column))?;
    }
    Ok(all)
}
