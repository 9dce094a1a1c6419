//! The dynamics over rows, on threads.

use crate::arrays::{Numbers, numbers, table, writable};
use crate::errors::{array, guarded, problems};
use ffid::dynamics::batch::{Algorithm, BatchError, Motions, batch, position_width};
use ffid::model::{Area, BaseKind, Model, Params, Problem, Problems};
use nalgebra::DMatrix;
use pyo3::prelude::*;
use std::thread::scope;

/// Rows below which another thread costs more than it saves.
const ROWS: usize = 256;
/// Rows of a part are a multiple of this, so that lanes are full but in the last.
const LANES: usize = 8;
/// Largest deviation of the norm of an attitude from 1.
const NORM: f64 = 1e-6;

/// A model and the parameters of the mission.
type Robot<'a> = (&'a Model, &'a Params<f64>);

fn algorithm(name: &str, frame: Option<&str>, model: &Model) -> PyResult<Algorithm> {
    let index = || {
        let (m, frame) = (model, frame.unwrap_or_default());
        m.frames().iter().position(|f| f.name == frame).ok_or_else(|| {
            let names: Vec<&str> = m.frames().iter().map(|f| f.name.as_str()).collect();
            let p = Problem::error(Area::Config, "Config::UnknownFrame", format!("no frame '{frame}'")).on("frame");
            problems(&Problems(vec![p.hint(format!("frames: {}", names.join(", ")))]), 11)
        })
    };
    Ok(match name {
        "rnea" => Algorithm::Rnea,
        "mass_matrix" => Algorithm::MassMatrix,
        "forward_dynamics" => Algorithm::ForwardDynamics,
        "hybrid_dynamics" => Algorithm::HybridDynamics,
        "regressor" => Algorithm::Regressor,
        "derivatives" => Algorithm::Derivatives,
        "momentum" => Algorithm::Momentum,
        "frame_pose" => Algorithm::FramePose(index()?),
        _ => Algorithm::FrameJacobian(index()?),
    })
}

/// Positions of a model, attitudes of unit norm.
fn positions<'py>(model: &Model, q: &Bound<'py, PyAny>) -> PyResult<Numbers<'py>> {
    let width = position_width(model);
    let q = numbers("q", q, &[None, Some(width)])?;
    if model.base_kind() == BaseKind::Floating {
        for (i, row) in q.as_slice()?.chunks(width).enumerate() {
            let norm = row[3..7].iter().map(|x| x * x).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > NORM {
                let what = format!("attitude of norm {norm} in row {i}, columns 3 to 6; limit 1 +- {NORM:e}");
                return Err(array(
                    Problem::error(Area::Data, "Array::Attitude", what)
                        .on("q")
                        .hint("divide it by its norm; the order is w, x, y, z"),
                ));
            }
        }
    }
    Ok(q)
}

/// Rows of every part.
fn parts(rows: usize, threads: usize) -> usize {
    let most = if threads == 0 { std::thread::available_parallelism().map_or(1, usize::from) } else { threads };
    let count = most.min(rows.div_ceil(ROWS)).max(1);
    rows.div_ceil(count).next_multiple_of(LANES)
}

/// Values of the parameters, those of the mission unless given.
fn parameters((model, nominal): Robot<'_>, given: Option<&Bound<'_, PyAny>>) -> PyResult<Params<f64>> {
    let Some(given) = given.filter(|g| !g.is_none()) else { return Ok(nominal.clone()) };
    let values = numbers("parameters", given, &[Some(model.n_params())])?;
    Ok(Params::from_values(model, values.as_slice()?.to_vec()))
}

fn singular(model: &Model, e: &BatchError, first: usize) -> PyErr {
    let what = format!("rows {} to {}: {}", e.first + first, e.last + first, e.source);
    let p = Problem::error(Area::Model, "Model::Singular", what).on(model.name());
    problems(&Problems(vec![p.hint("give every moving part mass and inertia")]), 14)
}

/// An algorithm over rows; arguments are `q`, `v`, what is given, parameters and `out`.
pub(crate) fn run<'py>(
    robot: Robot<'_>,
    name: &str,
    frame: Option<&str>,
    [q, v, given, params, out]: [Option<&Bound<'py, PyAny>>; 5],
    threads: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let algorithm = algorithm(name, frame, robot.0)?;
    let model = robot.0;
    let Some(q) = q else { return Err(crate::errors::internal("no positions")) };
    let py = q.py();
    let none = py.None().into_bound(py);
    let table_q = positions(model, q)?;
    let rows = table_q.shape()[0];
    let of = |name: &str, x: Option<&Bound<'py, PyAny>>, width: usize| -> PyResult<Option<Numbers<'py>>> {
        if width == 0 {
            return Ok(None);
        }
        numbers(name, x.unwrap_or(&none), &[Some(rows), Some(width)]).map(Some)
    };
    let v = of("v", v, if algorithm.needs_velocities() { model.nv() } else { 0 })?;
    let given_name = match algorithm {
        Algorithm::ForwardDynamics => "tau",
        Algorithm::HybridDynamics => "qdd",
        _ => "a",
    };
    let given = of(given_name, given, algorithm.given_width(model))?;
    let params = parameters(robot, params)?;
    let width = algorithm.result_width(model);
    let (q, v, given) = (table_q.as_slice()?, slice(v.as_ref())?, slice(given.as_ref())?);
    let compute = |to: &mut [f64]| -> PyResult<()> {
        let step = parts(rows, threads);
        let done = py.detach(|| {
            guarded(|| {
                let one = |k: usize, out: &mut [f64]| {
                    let (first, n) = (k * step, out.len() / width);
                    let part = |x: &'_ [f64]| -> std::ops::Range<usize> {
                        let w = x.len() / rows;
                        first * w..(first + n) * w
                    };
                    let m = Motions { rows: n, q: &q[part(q)], v: &v[part(v)], given: &given[part(given)] };
                    batch(algorithm, model, &params, &m, out).map_err(|e| (e, first))
                };
                if step >= rows {
                    return one(0, to);
                }
                scope(|s| {
                    let all: Vec<_> =
                        to.chunks_mut(step * width).enumerate().map(|(k, out)| s.spawn(move || one(k, out))).collect();
                    all.into_iter().try_for_each(|t| match t.join() {
                        Ok(done) => done,
                        Err(why) => std::panic::resume_unwind(why),
                    })
                })
            })
        })?;
        done.map_err(|(e, first)| singular(model, &e, first))
    };
    match out.filter(|o| !o.is_none()) {
        Some(out) => {
            let mut to = writable(out, &[rows, width])?;
            compute(to.as_slice_mut().map_err(|e| crate::errors::internal(&e.to_string()))?)?;
            Ok(out.clone())
        }
        None => {
            let size = rows.checked_mul(width).filter(|n| *n <= 1 << 30).ok_or_else(|| {
                let p = Problem::error(
                    Area::Data,
                    "Array::TooLarge",
                    format!("{rows} rows of {width} numbers, limit {} numbers", 1 << 30),
                );
                array(p.on("q").hint("compute it in parts"))
            })?;
            let mut to = vec![0.0; size];
            compute(&mut to)?;
            Ok(table(py, to, [rows, width])?.into_any())
        }
    }
}

fn slice<'a>(x: Option<&'a Numbers<'_>>) -> PyResult<&'a [f64]> {
    x.map_or(Ok(&[]), Numbers::as_slice)
}

/// The triangle of the regressor's rows.
pub(crate) fn triangle<'py>(
    robot: Robot<'_>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    a: &Bound<'py, PyAny>,
    tau: Option<&Bound<'py, PyAny>>,
    threads: usize,
) -> PyResult<DMatrix<f64>> {
    let (model, nominal) = robot;
    let (py, q) = (q.py(), positions(model, q)?);
    let rows = q.shape()[0];
    let like_v = [Some(rows), Some(model.nv())];
    let (v, a) = (numbers("v", v, &like_v)?, numbers("a", a, &like_v)?);
    let tau = crate::arrays::maybe("tau", tau, &like_v)?;
    let motions = Motions { rows, q: q.as_slice()?, v: v.as_slice()?, given: a.as_slice()? };
    let tau = tau.as_ref().map(Numbers::as_slice).transpose()?;
    let threads = rows.div_ceil(parts(rows, threads));
    let done = py.detach(|| guarded(|| ffid::regressor_triangle(model, nominal, &motions, tau, threads)))?;
    done.map_err(|e| {
        let p = Problem::error(Area::Data, "Array::NotFinite", e.to_string()).on("regressor");
        array(p.hint("look for numbers that are too large"))
    })
}
