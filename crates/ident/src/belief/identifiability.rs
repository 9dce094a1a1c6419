//! Which combinations no record can tell, which this one does not, and what can be estimated instead.
//!
//! A direction of parameters that changes no row of the equations of motion, whatever the motion, changes no record. Such
//! structural null directions are the null space of the regressor (base, joint and passive rows) stacked over random motions;
//! for a body behind a revolute joint or hinge there are three (mass, first and second moment of a mass distribution on the
//! axis, moved from one side to the other; J. Wittenburg, *Dynamics of Multibody Systems*, 2008, sec. 5.5; M. Gautier, W.
//! Khalil, *Direct calculation of minimum set of inertial parameters*, IEEE T-RA 6(3), 1990). A record that excites too
//! little has more: those could be told by another motion.
//!
//! The passive coordinates are not measured, so a record may be silent where these equations are not: on the length of a
//! pendulum of unknown fulcrum, say. Such directions are counted as unexcited.

use crate::belief::covariance::{Direction, Uncertainty, Unknown, analyse, name_direction, sparse_basis};
use crate::parameters::scale;
use ff_dynamics::{Regressor, State, Work, regressor};
use ff_linalg as linalg;
use ff_linalg::{Elimination, LinalgError, eliminate};
use ff_model::{Model, Params};
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Relative singular value below which a direction is structural.
const TOLERANCE: f64 = 1e-10;

/// What the equations of motion can tell at most about the parameters `selected` (ascending), at the values `params`; its
/// null directions are those that no record can tell. Sizes are those of the parameters at these values. Allocates.
///
/// # Errors
/// [`LinalgError`], for parameters that are not finite.
///
/// # Panics
/// If an index does not exist.
pub fn structural(model: &Model, params: &Params<f64>, selected: &[usize]) -> Result<Uncertainty, LinalgError> {
    let decls = model.param_decls();
    let sizes = scale::sizes(&decls, params.values());
    let unknowns = Unknown::of_parameters(&decls, selected, &sizes);
    let nv = model.nv();
    // Twice as many rows as unknowns leave nothing to chance.
    let motions = (2 * selected.len()).div_ceil(nv).max(2);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut random = |scale: f64| scale * rng.random_range(-1.0..1.0);
    let (mut work, mut y) = (Work::new(model), Regressor::new(model));
    let mut all = DMatrix::zeros(motions * nv, selected.len());
    let rest = model.rest_position(params);
    for k in 0..motions {
        let mut state = State::zero(model);
        state.q.iter_mut().for_each(|q| *q = random(3.0));
        state.eta.iter_mut().zip(&rest).for_each(|(e, r)| *e = r + random(0.5));
        state.v.iter_mut().for_each(|v| *v = random(1.0));
        let a: Vec<f64> = (0..nv).map(|_| random(1.0)).collect();
        regressor(model, params, &state, &a, &mut work, &mut y);
        for (c, &i) in selected.iter().enumerate() {
            all.view_mut((k * nv, c), (nv, 1)).copy_from(&y.column(i));
        }
    }
    analyse(&all, &unknowns, TOLERANCE)
}

/// The null directions of a record, told apart.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Silence {
    /// No record of this robot can tell these. They move nothing, so it does not matter.
    pub structural: Vec<Direction>,
    /// Another motion, or more sensors, might tell these.
    pub unexcited: Vec<Direction>,
}

/// Tells apart what `record` (of the same unknowns, and maybe others such as biases after them) is silent on. Allocates.
///
/// # Errors
/// [`LinalgError`].
///
/// # Panics
/// If the record has fewer unknowns than the structure.
pub fn silence(record: &Uncertainty, structure: &Uncertainty) -> Result<Silence, LinalgError> {
    let (n, own) = (record.unknowns.len(), structure.unknowns.len());
    assert!(own <= n, "the record must know the unknowns of the structure");
    if record.rank == n {
        return Ok(Silence::default());
    }
    // The two may have been scaled by different sizes: compare directions in those of the record.
    let count = own - structure.rank;
    let mut never = DMatrix::zeros(n, count);
    for k in 0..count {
        for i in 0..own {
            let ratio = structure.unknowns[i].size / record.unknowns[i].size;
            never[(i, k)] = structure.directions[(i, structure.rank + k)] * ratio;
        }
    }
    let null = record.directions.columns(record.rank, n - record.rank).into_owned();
    if count == 0 {
        return Ok(Silence { structural: vec![], unexcited: record.null.clone() });
    }
    // Orthonormal basis of the structural directions, then what it leaves of the record's.
    let never = linalg::svd(&never)?.u;
    let left = &null - &never * never.tr_mul(&null);
    let d = linalg::svd(&left)?;
    // Cosines are near 0 or 1: the structural space is part of the other one.
    let rest = d.s.iter().filter(|&&s| s > 0.5).count();
    let named = |basis: DMatrix<f64>| -> Result<Vec<Direction>, LinalgError> {
        let basis = sparse_basis(&basis)?;
        Ok(basis.column_iter().map(|c| name_direction(c.as_slice(), 0.0, &record.unknowns)).collect())
    };
    let unexcited = if rest > 0 { named(d.u.columns(0, rest).into_owned())? } else { Vec::new() };
    Ok(Silence { structural: named(never)?, unexcited })
}

/// A parameter that is estimated for itself and for others: what is found is the value of the whole combination.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Combination {
    /// The parameter that is kept among the unknowns.
    pub name: String,
    /// Parameters held where they are, with what each unit of them adds to the kept one.
    pub terms: Vec<(String, f64)>,
}

impl core::fmt::Display for Combination {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(&self.name)?;
        for (name, c) in &self.terms {
            write!(f, " {} {:.4e} {name}", if *c < 0.0 { '-' } else { '+' }, c.abs())?;
        }
        Ok(())
    }
}

/// A set of unknowns that the data determine, in place of all of them.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Reduced {
    /// Unknowns to estimate (as many as the rank), ascending.
    pub kept: Vec<usize>,
    /// Unknowns to hold where they are, ascending.
    pub held: Vec<usize>,
    /// What the kept ones then stand for, in their order.
    pub combinations: Vec<Combination>,
}

/// Part of a held parameter, relative to the sizes, below which a combination does not name it.
const NEGLIGIBLE: f64 = 1e-6;

/// The unknowns that the data determine: columns of the scaled sensitivities taken in order of what each adds (QR with column
/// pivoting). Those left over are combinations of the kept ones, `A_held = A_kept C`: raising a held one by `dx` and
/// lowering the kept ones by `C dx` changes no prediction. Allocates.
///
/// # Errors
/// [`LinalgError`].
pub fn reduce(u: &Uncertainty) -> Result<Reduced, LinalgError> {
    let (n, rank) = (u.unknowns.len(), u.rank);
    let a = DMatrix::from_fn(rank, n, |k, i| u.singular_values[k] * u.directions[(i, k)]);
    let Elimination { kept: first, left: last, c, .. } = eliminate(&a, rank)?;
    let mut rows: Vec<usize> = (0..rank).collect();
    rows.sort_by_key(|&k| first[k]);
    let combination = |&k: &usize| {
        let part = |j: usize| {
            let physical = c[(k, j)] * u.unknowns[first[k]].size / u.unknowns[last[j]].size;
            (c[(k, j)].abs() > NEGLIGIBLE).then(|| (u.unknowns[last[j]].name.clone(), physical))
        };
        let mut terms: Vec<(usize, (String, f64))> =
            (0..last.len()).filter_map(|j| part(j).map(|t| (last[j], t))).collect();
        terms.sort_by_key(|t| t.0);
        Combination { name: u.unknowns[first[k]].name.clone(), terms: terms.into_iter().map(|t| t.1).collect() }
    };
    let combinations = rows.iter().map(combination).collect();
    let (mut kept, mut held) = (first, last);
    kept.sort_unstable();
    held.sort_unstable();
    Ok(Reduced { kept, held, combinations })
}

/// Factor on the sizes of nuisance unknowns that keeps them before any parameter.
const NUISANCE_FIRST: f64 = 1e6;

/// [`reduce`] for a fit whose first `parameters` unknowns are parameters and the others nuisance: nuisance unknowns are never
/// held while a parameter can be held instead. `kept` and `held` count all unknowns. Allocates.
///
/// # Errors
/// [`LinalgError`].
pub fn reduce_parameters(u: &Uncertainty, parameters: usize) -> Result<Reduced, LinalgError> {
    let mut scaled = u.clone();
    for i in parameters..scaled.unknowns.len() {
        scaled.unknowns[i].size *= NUISANCE_FIRST;
        scaled.directions.row_mut(i).scale_mut(NUISANCE_FIRST);
    }
    reduce(&scaled)
}
