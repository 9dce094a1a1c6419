//! Joint motions and their planning.

use crate::arrays::{maybe, numbers, table};
use crate::errors::{guarded, json, or_refused};
use crate::mission::Mission;
use crate::watch::watched;
use ffid::workflow::excite::{Observer, Progress};
use ffid_cli::session;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::path::PathBuf;
use std::sync::Mutex;

/// Where a motion comes from: motions are made for a mission when they are used, which checks them again.
#[derive(Clone)]
enum Source {
    File(PathBuf),
    Json(String),
    Samples { t: Vec<f64>, q: Vec<f64>, qd: Option<Vec<f64>>, qdd: Option<Vec<f64>> },
}

/// A joint motion.
#[pyclass(frozen, module = "ffid._ffid")]
pub(crate) struct Motion {
    source: Source,
    /// Of what it was made with: joints, duration (s), warnings as JSON.
    joints: usize,
    duration: f64,
    warnings: String,
}

impl Motion {
    /// The motion for a mission.
    pub(crate) fn of(&self, mission: &Mission) -> PyResult<session::Motion> {
        or_refused(made(&self.source, mission))
    }
    fn new(source: Source, mission: &Mission) -> PyResult<Self> {
        let m = or_refused(guarded(|| made(&source, mission))?)?;
        let joints = mission.opened.model.nj();
        Ok(Self { joints, duration: m.motion.duration(), warnings: json(&m.warnings)?, source })
    }
}

fn made(source: &Source, mission: &Mission) -> Result<session::Motion, session::Refused> {
    let opened = &mission.opened;
    match source {
        Source::File(path) => session::Motion::load(path, opened),
        Source::Json(text) => session::Motion::from_json(text, opened),
        Source::Samples { t, q, qd, qdd } => session::Motion::from_samples(t, q, qd.as_deref(), qdd.as_deref(), opened),
    }
}

#[pymethods]
impl Motion {
    #[staticmethod]
    fn load(mission: &Mission, path: PathBuf) -> PyResult<Self> {
        Self::new(Source::File(path), mission)
    }
    #[staticmethod]
    fn from_json(mission: &Mission, text: String) -> PyResult<Self> {
        Self::new(Source::Json(text), mission)
    }
    #[staticmethod]
    fn from_samples(
        mission: &Mission,
        t: &Bound<'_, PyAny>,
        q: &Bound<'_, PyAny>,
        qd: Option<&Bound<'_, PyAny>>,
        qdd: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let t = numbers("t", t, &[None])?;
        let shape = [Some(t.shape()[0]), Some(mission.opened.model.nj())];
        let own = |x: Option<crate::arrays::Numbers<'_>>| x.map(|x| x.as_slice().map(<[f64]>::to_vec)).transpose();
        let source = Source::Samples {
            t: t.as_slice()?.to_vec(),
            q: numbers("q", q, &shape)?.as_slice()?.to_vec(),
            qd: own(maybe("qd", qd, &shape)?)?,
            qdd: own(maybe("qdd", qdd, &shape)?)?,
        };
        Self::new(source, mission)
    }
    #[getter]
    fn duration(&self) -> f64 {
        self.duration
    }
    fn warnings(&self) -> String {
        self.warnings.clone()
    }
    /// Positions, rates and accelerations at times.
    fn sample<'py>(&self, mission: &Mission, t: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyTuple>> {
        let py = t.py();
        let t = numbers("t", t, &[None])?;
        let (n, t) = (self.joints, t.as_slice()?);
        let motion = self.of(mission)?.motion;
        let [mut q, mut qd, mut qdd] = [(); 3].map(|()| vec![0.0; n * t.len()]);
        for (i, t) in t.iter().enumerate() {
            let row = i * n..(i + 1) * n;
            motion.eval(*t, &mut q[row.clone()], &mut qd[row.clone()], &mut qdd[row]);
        }
        let shape = [t.len(), n];
        PyTuple::new(py, [table(py, q, shape)?, table(py, qd, shape)?, table(py, qdd, shape)?])
    }
    /// The verdict of `ffid plan` as JSON and in words, and what it finds fault with.
    fn preflight(&self, py: Python<'_>, mission: &Mission) -> PyResult<(String, String, String)> {
        let judged = py
            .detach(|| guarded(|| session::preflight(&mission.file, &mission.opened, &made(&self.source, mission)?)))?;
        let (verdict, faults) = or_refused(judged)?;
        Ok((json(&verdict)?, verdict.to_string(), json(&faults)?))
    }
}

/// A plan: trajectory, plan, verdict (JSON), verdict in words, faults (JSON).
type Planned = (String, String, String, String, String);

/// Plans with the options of `ffid excite`. Ended from outside, the best plan so far, if there is one, and what ended it.
#[pyfunction]
pub(crate) fn plan_excitation(
    py: Python<'_>,
    mission: Py<Mission>,
    options: Vec<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Option<Planned>, Option<PyErr>)> {
    let m = mission.get();
    let (found, broken) = watched(py, progress, |stop, tell| {
        let tell = Mutex::new(tell);
        let show = |p: &Progress| {
            if let Ok(tell) = tell.lock() {
                let _ = tell.send((p.stage, p.iteration, p.cost));
            }
        };
        let watch = Observer { stop: Some(stop), progress: Some(&show) };
        session::plan_excitation(&m.file, &m.opened, &options, &watch)
    })?;
    let (p, broken) = match (found, broken) {
        (Err(_), Some(broken)) => return Ok((None, Some(broken))),
        (found, broken) => (or_refused(found)?, broken),
    };
    let plan =
        (p.planned.file.to_json(), json(&p.planned)?, json(&p.verdict)?, p.verdict.to_string(), json(&p.faults)?);
    Ok((Some(plan), broken))
}
