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

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn unknowns() -> Vec<Unknown> {
        let sizes = [600.0, 0.5, 20.0, 3.0];
        sizes.iter().enumerate().map(|(i, s)| Unknown { name: format!("p{i}"), unit: "kg".into(), size: *s }).collect()
    }
    /// Column 3 is `0.2 column 1 - 0.05 column 0`; with `still`, column 2 is silent.
    fn sensitivities(still: bool) -> DMatrix<f64> {
        let scale = [0.02, 30.0, if still { 0.0 } else { 0.4 }];
        let mut j = DMatrix::from_fn(40, 4, |i, k| {
            scale.get(k).map_or(0.0, |s| s * ((0.31 * (k + 1) as f64) * i as f64 + 0.4).sin())
        });
        let c = j.column(1) * 0.2 - j.column(0) * 0.05;
        j.set_column(3, &c);
        j
    }

    #[test]
    fn what_no_record_tells_is_told_from_what_this_one_does_not() {
        let structure = analyse(&sensitivities(false), &unknowns(), 1e-9).unwrap();
        let record = analyse(&sensitivities(true), &unknowns(), 1e-9).unwrap();
        assert_eq!((structure.rank, record.rank), (3, 2));
        let s = silence(&record, &structure).unwrap();
        assert_eq!((s.structural.len(), s.unexcited.len()), (1, 1));
        assert_eq!(s.unexcited[0].terms, [("p2".to_owned(), 20.0)]);
        let names: Vec<&str> = s.structural[0].terms.iter().map(|t| t.0.as_str()).collect();
        assert!(names.contains(&"p1") && names.contains(&"p3") && !names.contains(&"p2"), "{names:?}");
        assert_eq!(silence(&structure, &structure).unwrap().unexcited, []);
        // Other sizes, and a bias behind the parameters.
        let mut more = sensitivities(true).insert_column(4, 1.0);
        more[(3, 4)] = 2.0;
        let mut names = unknowns();
        names.iter_mut().for_each(|u| u.size *= 1.7);
        names.push(Unknown { name: "bias".into(), unit: "N m".into(), size: 0.1 });
        let s = silence(&analyse(&more, &names, 1e-9).unwrap(), &structure).unwrap();
        assert_eq!((s.structural.len(), s.unexcited.len()), (1, 1));
        assert_eq!(s.unexcited[0].terms[0].0, "p2");
    }

    #[test]
    fn a_reduced_set_predicts_the_same() {
        let j = sensitivities(false);
        let u = analyse(&j, &unknowns(), 1e-9).unwrap();
        let r = reduce(&u).unwrap();
        assert_eq!((r.kept.len(), r.held.len(), r.combinations.len()), (3, 1, 3));
        // Moving the held one is undone by moving the kept ones.
        let mut undone = j.column(r.held[0]).into_owned();
        for (k, c) in r.kept.iter().zip(&r.combinations) {
            assert_eq!(c.name, format!("p{k}"));
            let part = c.terms.iter().find(|t| t.0 == format!("p{}", r.held[0])).map_or(0.0, |t| t.1);
            undone -= j.column(*k) * part;
        }
        assert_relative_eq!(undone.norm(), 0.0, epsilon = 1e-10 * j.column(r.held[0]).norm());
        let all = reduce(&analyse(&j.columns(0, 3).into_owned(), &unknowns()[..3], 1e-9).unwrap()).unwrap();
        assert_eq!((all.kept, all.held.len()), (vec![0, 1, 2], 0));
    }
}
