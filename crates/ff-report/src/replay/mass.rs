//! The centre of mass of everything, and how well it is known.

use ff_dynamics::analysis::Centroidal;
use ff_dynamics::{State, Trace};
use ff_model::scalar::D1;
use ff_model::{Model, Params};
use nalgebra::{DMatrix, Vector3};
use serde::Serialize;

/// Most places of a motion at which the covariance is computed; the page interpolates.
const PLACES: usize = 40;

/// Parameters that are not known exactly.
#[derive(Clone, Debug, PartialEq)]
pub struct Knowledge {
    /// Their indices in the parameter vector.
    pub indices: Vec<usize>,
    /// Their covariance (squares of their units).
    pub covariance: DMatrix<f64>,
}

impl Knowledge {
    /// Of the parameters of a model with these names, rows of the covariance in the same order; other names are left out. `None` without
    /// any, or with numbers that are not finite. Allocates.
    pub fn of(model: &Model, names: &[String], rows: &[Vec<f64>]) -> Option<Self> {
        let decls = model.param_decls();
        let found: Vec<(usize, usize)> = names
            .iter()
            .enumerate()
            .filter_map(|(row, n)| Some((row, decls.iter().position(|d| d.name == *n)?)))
            .collect();
        let covariance = DMatrix::from_fn(found.len(), found.len(), |i, j| rows[found[i].0][found[j].0]);
        let finite = covariance.iter().all(|x| x.is_finite());
        (!found.is_empty() && finite).then(|| Self { indices: found.iter().map(|f| f.1).collect(), covariance })
    }
}

/// Covariances along a motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Ellipsoids {
    /// Frames of the motion.
    at: Vec<usize>,
    /// `xx xy xz yy yz zz` of each, in axes of the base (m^2).
    covariance_m2: Vec<[f64; 6]>,
}

impl Ellipsoids {
    /// Covariances at some frames of a motion, whose samples of the trace are `rows`.
    pub(super) fn along(model: &Model, params: &Params<f64>, known: &Knowledge, trace: &Trace, rows: &[usize]) -> Self {
        let frames = rows.len();
        let n = frames.min(PLACES);
        let at: Vec<usize> = (0..n).map(|i| if n > 1 { i * (frames - 1) / (n - 1) } else { 0 }).collect();
        let of = |&i: &usize| {
            let state = trace.state(model, rows[i]);
            covariance(model, params, known, &state.q, &state.eta)
        };
        Self { covariance_m2: at.iter().map(of).collect(), at }
    }
}

/// Centre of mass in the base frame (m), and its covariance if anything is known.
pub(super) fn at(
    model: &Model,
    params: &Params<f64>,
    known: Option<&Knowledge>,
    q: &[f64],
    eta: &[f64],
) -> (Vector3<f64>, Option<[f64; 6]>) {
    let mut c = Centroidal::<f64>::new(model);
    c.evaluate(params, &posed(model, q, eta));
    (*c.com(), known.map(|k| covariance(model, params, k, q, eta)))
}

/// Mass of everything (kg).
pub(super) fn total(model: &Model, params: &Params<f64>, q: &[f64], eta: &[f64]) -> f64 {
    let mut c = Centroidal::<f64>::new(model);
    c.evaluate(params, &posed(model, q, eta));
    c.mass()
}

fn posed(model: &Model, q: &[f64], eta: &[f64]) -> State<f64> {
    let mut state = State::zero(model);
    state.q.copy_from_slice(q);
    state.eta.copy_from_slice(eta);
    state
}

/// `J P J^T` with `J` the exact derivative of the centre of mass with respect to the parameters, base frame.
fn covariance(model: &Model, params: &Params<f64>, known: &Knowledge, q: &[f64], eta: &[f64]) -> [f64; 6] {
    let mut state = State::<D1>::zero(model);
    for (to, from) in state.q.iter_mut().zip(q).chain(state.eta.iter_mut().zip(eta)) {
        *to = D1::constant(*from);
    }
    let mut c = Centroidal::<D1>::new(model);
    let mut values: Vec<D1> = params.values().iter().map(|&x| D1::constant(x)).collect();
    let mut j = DMatrix::zeros(3, known.indices.len());
    for (column, &index) in known.indices.iter().enumerate() {
        values[index].eps[0] = 1.0;
        c.evaluate(&Params::from_values(model, values.clone()), &state);
        values[index].eps[0] = 0.0;
        for i in 0..3 {
            j[(i, column)] = c.com()[i].eps[0];
        }
    }
    let p = &j * &known.covariance * j.transpose();
    [p[(0, 0)], p[(0, 1)], p[(0, 2)], p[(1, 1)], p[(1, 2)], p[(2, 2)]]
}

/// Centre of mass in the world along a trace, at these samples.
pub(super) fn path(model: &Model, params: &Params<f64>, trace: &Trace, rows: &[usize]) -> Vec<Vector3<f64>> {
    let mut c = Centroidal::<f64>::new(model);
    rows.iter()
        .map(|&i| {
            c.evaluate(params, &trace.state(model, i));
            *c.com()
        })
        .collect()
}
