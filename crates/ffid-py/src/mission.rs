//! Missions: loaded, judged, simulated.

use crate::arrays::array2;
use crate::batch;
use crate::errors::{internal, json, problems};
use crate::motion::Motion;
use crate::traced::traced;
use ffid::dynamics::Boundary;
use ffid::dynamics::state::dof_names;
use ffid::inputs::Declared;
use ffid::mission::Leniency;
use ffid::mission::urdf::UrdfOptions;
use ffid::model::{Area, BaseKind, JointKind, Params, Problem, Problems};
use ffid::modes::ModeTable;
use ffid::open::{MAX_DENSE, Opened, open};
use ffid::summary::Summary;
use ffid_cli::session;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// A mission with its model, or the model of a robot alone.
#[pyclass(frozen, module = "ffid._ffid")]
pub(crate) struct Mission {
    pub(crate) file: PathBuf,
    pub(crate) opened: Opened,
    pub(crate) leniency: Leniency,
    pub(crate) params: Params<f64>,
    /// Parameters whose values are not those of the file.
    pub(crate) changed: Vec<usize>,
}

impl Mission {
    pub(crate) fn new(file: PathBuf, opened: Opened, leniency: Leniency) -> Self {
        let params = Params::nominal(&opened.model);
        Self { file, opened, leniency, params, changed: Vec::new() }
    }
    /// Sensors, limits and what is to be estimated; a robot alone has none.
    pub(crate) fn section(&self) -> PyResult<&ffid::mission::Mission> {
        self.opened.mission.as_ref().ok_or_else(|| {
            let what = "a robot alone has no sensors, limits or parameters to estimate";
            let p = Problem::error(Area::Config, "Config::NoMission", what).in_file(&self.file);
            problems(&Problems(vec![p.hint("load a mission file, or begin one with Mission.from_urdf")]), 11)
        })
    }
}

#[pymethods]
impl Mission {
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, allow: Vec<String>, strict: bool) -> PyResult<Self> {
        let leniency = Leniency { allow, strict };
        let opened = py.detach(|| crate::errors::guarded(|| open(&path, leniency.clone())))?;
        let opened = opened.map_err(|p| problems(&p, p.exit_code()))?;
        Ok(Self::new(path, opened, leniency))
    }
    #[staticmethod]
    fn robot(py: Python<'_>, path: PathBuf, fixed: bool, gravity: [f64; 3]) -> PyResult<Self> {
        let base_kind = if fixed { BaseKind::Fixed } else { BaseKind::Floating };
        let options = UrdfOptions { base_kind, ..UrdfOptions::default() };
        let read = py.detach(|| crate::errors::guarded(|| ffid::mission::urdf::from_file(&path, &options)))?;
        let (model, warnings) = read.map_err(|p| problems(&p, p.exit_code()))?;
        let opened = Opened {
            model: model.with_gravity(gravity.into()),
            mission: None,
            estimated: Vec::new(),
            excited: Vec::new(),
            end_effector: None,
            inputs: Vec::new(),
            warnings,
        };
        Ok(Self::new(path, opened, Leniency::default()))
    }
    #[getter]
    fn file(&self) -> PathBuf {
        self.file.clone()
    }
    /// Codes of errors that are let through.
    #[getter]
    fn allow(&self) -> Vec<String> {
        self.leniency.allow.clone()
    }
    /// Whether values are not those of the file.
    #[getter]
    fn is_changed(&self) -> bool {
        !self.changed.is_empty()
    }
    /// Name, joints, frames, degrees of freedom, widths, poses as JSON.
    fn about(&self) -> PyResult<String> {
        let m = &self.opened.model;
        let frames: Vec<&str> = m.frames().iter().map(|f| f.name.as_str()).collect();
        let sensing = self.opened.mission.as_ref().map(|m| &m.sensors);
        json(&serde_json::json!({
            "name": m.name(), "joints": m.joint_names(), "frames": frames, "dofs": dof_names(m),
            "floating": m.base_kind() == BaseKind::Floating, "nj": m.nj(), "np": m.np(), "nv": m.nv(),
            "nq": ffid::dynamics::batch::position_width(m), "pose": self.opened.pose(),
            "rest": m.rest_position(&self.params), "rate_hz": sensing.map(|s| s.rate_hz),
            "mission": self.opened.mission.is_some(),
            "slides": m.own_bodies().map(|b| b.joint.kind == JointKind::Prismatic).collect::<Vec<_>>(),
        }))
    }
    /// Name, unit, value, bounds and whether it is to be estimated, of every parameter, as JSON.
    fn parameters(&self) -> PyResult<String> {
        let finite = |x: f64| x.is_finite().then_some(x);
        let decls = self.opened.model.param_decls();
        let rows: Vec<_> = (decls.iter().enumerate())
            .map(|(i, d)| {
                serde_json::json!({"name": d.name, "unit": d.unit, "value": d.nominal, "lower": finite(d.bounds.0),
                    "upper": finite(d.bounds.1), "estimated": self.opened.estimated.contains(&i)})
            })
            .collect();
        json(&rows)
    }
    fn warnings(&self) -> PyResult<String> {
        json(&self.opened.warnings)
    }
    /// The summary of `ffid check`, as JSON and in words.
    fn check(&self) -> PyResult<(String, String)> {
        let s = Summary::new(&self.opened.model, &self.opened.estimated);
        Ok((json(&s)?, s.to_string()))
    }
    /// The modes at joint positions, or at the pose of the mission, as JSON and in words.
    fn modes(&self, py: Python<'_>, boundary: &str, q: Option<Vec<f64>>) -> PyResult<(String, String)> {
        let boundary = match boundary {
            "joints-held" => Boundary::JointsHeld,
            "base-held" => Boundary::BaseHeld,
            _ => Boundary::JointsFree,
        };
        let m = &self.opened.model;
        let q = q.unwrap_or_else(|| self.opened.pose());
        let found = if m.nv() > MAX_DENSE {
            Err(format!("{} degrees of freedom, limit {MAX_DENSE}", m.nv()))
        } else {
            py.detach(|| crate::errors::guarded(|| ModeTable::new(m, &q, boundary).map_err(|e| e.to_string())))?
        };
        let table = found.map_err(|why| {
            let p = Problem::error(Area::Model, "Model::NoModes", why).in_file(&self.file);
            problems(&Problems(vec![p.hint("check stiffness and inertia of the appendages")]), 14)
        })?;
        Ok((json(&table)?, table.to_string()))
    }
    /// The mission with other values of parameters, by index.
    fn with_values(&self, values: Vec<(usize, f64)>) -> PyResult<Self> {
        let mut opened = self.opened.clone();
        opened.model.set_nominal(&values).map_err(|p| problems(&p, Area::Config.exit_code()))?;
        let mut changed: Vec<usize> = self.changed.iter().copied().chain(values.iter().map(|v| v.0)).collect();
        changed.sort_unstable();
        changed.dedup();
        Ok(Self { changed, ..Self::new(self.file.clone(), opened, self.leniency.clone()) })
    }
    /// The mission with its files, as names and contents.
    fn files(&self) -> PyResult<Vec<(String, Vec<u8>)>> {
        let mission = self.section()?;
        let m = &self.opened.model;
        let made = ffid::workflow::identify::model_files::write(
            &self.file,
            mission,
            m,
            self.params.values(),
            &self.changed,
            &self.leniency,
        );
        let (files, _) = made.map_err(|e| internal(&e.to_string()))?;
        Ok(files)
    }
    /// Simulates a motion from rest; `seed` for what the sensors read, none for exact values. Returns arrays by name, and warnings.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        motion: &Motion,
        hold_s: f64,
        seed: Option<u64>,
        rate_hz: Option<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let m = &self.opened.model;
        let rate = match rate_hz {
            Some(r) => r,
            None => self.section()?.sensors.rate_hz,
        };
        let inputs: Vec<_> = self.opened.inputs.iter().map(Declared::as_input).collect();
        let (motion, params) = (motion.of(self)?, &self.params);
        let flown = py.detach(|| {
            crate::errors::guarded(|| ffid::sense::fly(m, params, motion.motion.as_ref(), &inputs, rate, hold_s))
        })?;
        let trace = flown.map_err(|e| {
            let p = Problem::error(Area::Config, "Sim::Failed", e.to_string()).in_file(&self.file);
            problems(&Problems(vec![p.hint("excite less, or check the parameters")]), 14)
        })?;
        let sensors = self.opened.mission.as_ref().map(|s| ffid::sense::suite(&s.sensors)).unwrap_or_default();
        traced(py, m, &trace, rate, seed.map(|s| (&sensors, s)))
    }
    /// An algorithm of the dynamics over rows.
    #[allow(clippy::too_many_arguments, reason = "tables by name")]
    fn batch<'py>(
        &self,
        algorithm: &str,
        frame: Option<&str>,
        q: &Bound<'py, PyAny>,
        v: Option<&Bound<'py, PyAny>>,
        given: Option<&Bound<'py, PyAny>>,
        parameters: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        batch::run((&self.opened.model, &self.params), algorithm, frame, [Some(q), v, given, parameters, out], threads)
    }
    /// The triangle of the regressor over all rows, the forces as last column when given.
    fn regressor_triangle<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
        tau: Option<&Bound<'py, PyAny>>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let r = batch::triangle((&self.opened.model, &self.params), q, v, a, tau, threads)?;
        Ok(array2(py, &r)?.into_any())
    }
    /// Base parameters of the regressor over motions: the parameters that are kept, all as functions of them, the condition number.
    fn base_parameters<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
        tolerance: f64,
        threads: usize,
    ) -> PyResult<(Vec<usize>, Bound<'py, PyArray2<f64>>, f64)> {
        let r = batch::triangle((&self.opened.model, &self.params), q, v, a, None, threads)?;
        let sizes = ffid::ident::parameters::sizes(&self.opened.model.param_decls(), self.params.values());
        let found = py.detach(|| crate::errors::guarded(|| ffid::base_parameters(&r, &sizes, tolerance)))?;
        let b = found.map_err(|e| {
            let p = Problem::error(Area::Data, "Array::NotFinite", e.to_string()).on("regressor");
            crate::errors::array(p.hint("look for numbers that are too large"))
        })?;
        Ok((b.kept, array2(py, &b.matrix)?, b.condition))
    }
}

/// A command with its output captured: exit code, standard output, standard error.
#[pyfunction]
pub(crate) fn command(py: Python<'_>, arguments: Vec<String>) -> PyResult<(u8, String, String)> {
    py.detach(|| {
        crate::errors::guarded(|| {
            let (mut out, mut err) = (Vec::new(), Vec::new());
            let all = std::iter::once("ffid".to_owned()).chain(arguments);
            let exit = ffid_cli::run(all, &mut out, &mut err);
            (exit.code(), String::from_utf8_lossy(&out).into_owned(), String::from_utf8_lossy(&err).into_owned())
        })
    })
}

/// The command `ffid` on the streams of the process.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<String>) -> PyResult<u8> {
    py.detach(|| crate::errors::guarded(|| ffid_cli::main_from(arguments).code()))
}

/// Every option of every command, as JSON.
#[pyfunction]
pub(crate) fn options_table() -> PyResult<String> {
    json(&session::options())
}
