//! What a record tells beside things that are not known exactly.
//!
//! With the whitened Jacobian `J = [J_p J_n J_c]` of requested parameters, biases and initial state, and errors `c` with priors of
//! deviation `s_c`, the information is `H = J^T J + diag(0, 0, 1 / s_c^2)`. The deviations of the requested parameters are those of
//! `(H^-1)_pp`, which is the inverse of the Schur complement
//!
//! ```text
//! M_p = H_pp - H_px H_xx^-1 H_xp        x = (n, c)
//! ```
//!
//! (B. Tapley, B. Schutz, G. Born, *Statistical Orbit Determination*, 2004, sec. 6.3). It is computed from the triangle of `J` with a row
//! `1 / s_c` for every prior, never from `H`. An error of size `e_c` that is not estimated moves the estimate by
//! `-(J_x^T J_x)^-1 J_x^T J_c e_c`, `x = (p, n)`.

use super::error::PreflightError;
use super::question::Question;
use super::samples::{MOST_NUMBERS, noise, record};
use crate::workflow::identify::{Harm, UncertainItems, UncertainUnknown};
use ff_dynamics::Trace;
use ff_least_squares::{Tall, triangle_of};
use ident::belief::{Unknown, analyse};
use ident::compose::{SharedErrors, TieMap};
use ident::estimate::RANK_TOLERANCE;
use ident::parameters::sizes;
use ident::{Estimator, Options, OutputError, Tied, Uncertainty};
use nalgebra::{DMatrix, DVector};

/// Samples that tell what small errors would move, and which of two plans tells more.
pub(super) const SURVEYED: usize = 1500;

/// What a record tells, as the triangle of its whitened Jacobian.
pub(super) struct Columns {
    /// Every how many samples one was looked at.
    pub(super) every: usize,
    /// Over requested parameters, nuisance unknowns, errors.
    triangle: DMatrix<f64>,
    pub(super) unknowns: Vec<Unknown>,
    /// Errors with their columns.
    pub(super) errors: Vec<(usize, UncertainUnknown)>,
}

/// Of the simulated record, beside `items`; of about `samples` of it, if given.
pub(super) fn columns(
    q: &Question<'_>,
    trace: &Trace,
    substeps: usize,
    items: &UncertainItems,
    samples: Option<usize>,
) -> Result<Columns, PreflightError> {
    let (model, n) = (q.model, q.selected.len());
    let beside = 6 + model.nj() + 2 * model.np();
    let wide = n + beside + items.touched() + items.shared.len();
    let most = (trace.len() * (model.nj() + 3) * wide).div_ceil(MOST_NUMBERS);
    let every = most.max(samples.map_or(1, |s| trace.len() / s)).max(1);
    let record = record(q, trace, every)?;
    let mut options = Options {
        substeps: substeps * every,
        gyro_bias: true,
        torque_bias: true,
        initial_state: true,
        ..Options::new(noise(&q.sensing))
    };
    items.widen(&mut options);
    let fit = OutputError::new(model, &record, &options)?;
    let of_model = model.param_decls().len();
    let mut decls = model.param_decls();
    decls.extend(items.shared.iter().cloned());
    let mut values = q.params.values().to_vec();
    values.resize(decls.len(), 0.0);
    let mut start = values.clone();
    let mut requested = q.selected.to_vec();
    let mut own = decls.clone();
    let mut fit: Box<dyn Estimator + '_> = Box::new(fit);
    if !items.unknowns.is_empty() {
        let refused = |e: String| PreflightError::Uncertain(e);
        let ties = items.ties(&values).map_err(|e| refused(e.to_string()))?;
        let map = TieMap::new(&decls, &values, ties).map_err(|e| refused(e.to_string()))?;
        let free = |i: &usize| map.free().binary_search(i).map_err(|_| refused(format!("{} is tied", decls[*i].name)));
        requested = q.selected.iter().map(free).collect::<Result<_, _>>()?;
        (own, start) = (map.decls().to_vec(), map.start());
        let shared = SharedErrors::new(fit, of_model, &items.shared_names(), &[]);
        // Errors of a slender body may lead through numbers that no body has.
        fit = Box::new(Tied::new(shared, map).unchecked());
    }
    let place = |u: &UncertainUnknown| Some((own.iter().position(|d| d.name == u.name)?, u.clone()));
    let mut placed: Vec<(usize, UncertainUnknown)> = items.unknowns.iter().filter_map(place).collect();
    placed.sort_by_key(|p| p.0);
    let mut selected: Vec<usize> = requested.iter().copied().chain(placed.iter().map(|p| p.0)).collect();
    selected.sort_unstable();
    let beside = fit.nuisance();
    let (mut r, zeros) = (vec![0.0; fit.rows()], vec![0.0; beside.len()]);
    let mut j = DMatrix::zeros(fit.rows(), selected.len() + beside.len());
    fit.jacobian(&start, &zeros, &selected, &mut r, &mut j)?;
    // A sample that stands for `every` of them carries that many times the information.
    j.scale_mut((every as f64).sqrt());
    let at = |i: &usize| selected.binary_search(i).unwrap_or_default();
    let order: Vec<usize> = requested
        .iter()
        .map(at)
        .chain(selected.len()..selected.len() + beside.len())
        .chain(placed.iter().map(|p| at(&p.0)))
        .collect();
    let triangle = triangle_of(&Tall::new(&j))?.select_columns(&order);
    let (of_model, of_own) = (sizes(&decls, &values), sizes(&own, &start));
    let mut unknowns = Unknown::of_parameters(&decls, q.selected, &of_model);
    unknowns.extend(beside);
    let first = unknowns.len();
    unknowns.extend(Unknown::of_parameters(&own, &placed.iter().map(|p| p.0).collect::<Vec<_>>(), &of_own));
    let errors = placed.into_iter().enumerate().map(|(k, p)| (first + k, p.1)).collect();
    Ok(Columns { every, triangle, unknowns, errors })
}

impl Columns {
    /// What the record tells, the priors of the errors as measurements; and together with what is known beforehand of requested
    /// parameters, given by column with its deviation.
    pub(super) fn uncertainty(&self, known: &[(usize, f64)]) -> Result<(Uncertainty, Uncertainty), PreflightError> {
        let errors: Vec<(usize, f64)> = self.errors.iter().map(|(c, u)| (*c, u.std)).collect();
        let data = with_rows(&self.triangle, &errors);
        let told = analyse(&data, &self.unknowns, RANK_TOLERANCE)?;
        if known.is_empty() {
            return Ok((told.clone(), told));
        }
        let all = analyse(&with_rows(&data, known), &self.unknowns, RANK_TOLERANCE)?;
        Ok((told, all))
    }
    /// What each error of the size of its deviation would move by most of its deviations, were it taken as exact: the most harmful first.
    pub(super) fn harm(&self, requested: usize) -> Result<Vec<Harm>, PreflightError> {
        let Some(first) = self.errors.first().map(|e| e.0) else { return Ok(Vec::new()) };
        let u = analyse(&self.triangle.columns(0, first).into_owned(), &self.unknowns[..first], RANK_TOLERANCE)?;
        let estimated = self.triangle.columns(0, first);
        let mut out = Vec::new();
        for (c, e) in &self.errors {
            let slope: DVector<f64> = estimated.tr_mul(&self.triangle.column(*c));
            let moved = &u.covariance * slope * e.std;
            let by = |k: usize| u.deviation[k].map_or(0.0, |d| (moved[k] / d).abs());
            let Some(worst) = (0..requested).max_by(|a, b| by(*a).total_cmp(&by(*b))) else { continue };
            let (name, moves) = (e.name.clone(), self.unknowns[worst].name.clone());
            out.push(Harm { name, size: e.kind.small().to_owned(), moves, moves_by: by(worst) });
        }
        out.sort_by(|a, b| b.moves_by.total_cmp(&a.moves_by));
        Ok(out)
    }
}

/// What small errors of everything that is taken as exact would move, the most harmful first.
pub(super) fn taken_as_exact(q: &Question<'_>, trace: &Trace, substeps: usize) -> Result<Vec<Harm>, PreflightError> {
    match q.small {
        Some(items) => columns(q, trace, substeps, items, Some(SURVEYED))?.harm(q.selected.len()),
        None => Ok(Vec::new()),
    }
}

/// A triangle with rows `1 / sigma` below it.
fn with_rows(data: &DMatrix<f64>, given: &[(usize, f64)]) -> DMatrix<f64> {
    let from = data.nrows();
    let mut out = data.clone().resize_vertically(from + given.len(), 0.0);
    given.iter().enumerate().for_each(|(k, &(column, sigma))| out[(from + k, column)] = 1.0 / sigma);
    out
}
