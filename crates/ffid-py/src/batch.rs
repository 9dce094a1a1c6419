//! The dynamics over rows, on threads.

use crate::arrays::{Numbers, all_finite, finite, numbers, numbers_or_nan, table, writable};
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
/// Rows that are looked at and then computed while they are at hand: a look at all rows first would read them from memory twice.
const AT_HAND: usize = 1024;
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

/// The norms of the attitudes in rows of positions; none for a fixed base.
fn norms<'a>(model: &Model, q: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    let floats = model.base_kind() == BaseKind::Floating;
    let rows = floats.then(|| q.chunks_exact(position_width(model)));
    rows.into_iter().flatten().map(|row| row[3..7].iter().map(|x| x * x).sum::<f64>().sqrt())
}

/// Refuses positions that are not finite and attitudes that are not of unit norm, with the place of the first.
fn check_positions(model: &Model, q: &Numbers<'_>) -> PyResult<()> {
    finite("q", q)?;
    let wrong = norms(model, q.as_slice()?).enumerate().find(|(_, norm)| (norm - 1.0).abs() > NORM);
    wrong.map_or(Ok(()), |(i, norm)| {
        let what = format!("attitude of norm {norm} in row {i}, columns 3 to 6; limit 1 +- {NORM:e}");
        let p = Problem::error(Area::Data, "Array::Attitude", what).on("q");
        Err(array(p.hint("divide it by its norm; the order is w, x, y, z")))
    })
}

/// Whether rows can be computed with; [`check_positions`] and [`finite`] say why not.
fn sound(model: &Model, m: &Motions<'_>) -> bool {
    let near = |norm: f64| (norm - 1.0).abs() <= NORM;
    [m.q, m.v, m.given].into_iter().all(all_finite) && norms(model, m.q).fold(true, |all, norm| all & near(norm))
}

/// Positions of a model, attitudes of unit norm.
fn positions<'py>(model: &Model, q: &Bound<'py, PyAny>) -> PyResult<Numbers<'py>> {
    let q = numbers_or_nan("q", q, &[None, Some(position_width(model))])?;
    check_positions(model, &q)?;
    Ok(q)
}

/// Why rows were not computed.
enum Stop {
    /// Numbers among them that cannot be computed with.
    Unsound,
    /// A mass matrix that is not positive definite, in rows after this one.
    Singular(BatchError, usize),
}

/// An algorithm over rows from `first` on, a few at a time; what is wrong with them is looked for before they are computed.
fn compute_rows(
    (algorithm, model, params): (Algorithm, &Model, &Params<f64>),
    all: &Motions<'_>,
    first: usize,
    out: &mut [f64],
) -> Result<(), Stop> {
    let width = algorithm.result_width(model);
    for (k, out) in out.chunks_mut(AT_HAND * width).enumerate() {
        let (first, rows) = (first + k * AT_HAND, out.len() / width);
        let part = |x: &'_ [f64]| {
            let w = x.len() / all.rows;
            first * w..(first + rows) * w
        };
        let m = Motions { rows, q: &all.q[part(all.q)], v: &all.v[part(all.v)], given: &all.given[part(all.given)] };
        if !sound(model, &m) {
            return Err(Stop::Unsound);
        }
        batch(algorithm, model, params, &m, out).map_err(|e| Stop::Singular(e, first))?;
    }
    Ok(())
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

/// An algorithm over rows; arguments are `q`, `v`, what is given, parameters and `out`. After an error some rows of `out` are written.
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
    let table_q = numbers_or_nan("q", q, &[None, Some(position_width(model))])?;
    let rows = table_q.shape()[0];
    let of = |name: &str, x: Option<&Bound<'py, PyAny>>, width: usize| -> PyResult<Option<Numbers<'py>>> {
        if width == 0 {
            return Ok(None);
        }
        numbers_or_nan(name, x.unwrap_or(&none), &[Some(rows), Some(width)]).map(Some)
    };
    let table_v = of("v", v, if algorithm.needs_velocities() { model.nv() } else { 0 })?;
    let given_name = match algorithm {
        Algorithm::ForwardDynamics => "tau",
        Algorithm::HybridDynamics => "qdd",
        _ => "a",
    };
    let table_given = of(given_name, given, algorithm.given_width(model))?;
    let params = parameters(robot, params)?;
    let width = algorithm.result_width(model);
    let motions =
        Motions { rows, q: table_q.as_slice()?, v: slice(table_v.as_ref())?, given: slice(table_given.as_ref())? };
    let compute = |to: &mut [f64]| -> PyResult<()> {
        let step = parts(rows, threads);
        let done = py.detach(|| {
            guarded(|| {
                let one = |k: usize, out: &mut [f64]| compute_rows((algorithm, model, &params), &motions, k * step, out);
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
        let Err(stop) = done else { return Ok(()) };
        // What is wrong with the arrays comes first, wherever it stands in them.
        check_positions(model, &table_q)?;
        table_v.as_ref().map_or(Ok(()), |v| finite("v", v))?;
        table_given.as_ref().map_or(Ok(()), |g| finite(given_name, g))?;
        Err(match stop {
            Stop::Singular(e, first) => singular(model, &e, first),
            Stop::Unsound => crate::errors::internal("rows that are refused for no reason"),
        })
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
