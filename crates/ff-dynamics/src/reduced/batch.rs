//! The reduced system for many parameter sets at once, one per lane: under one table of the arm, or each under its own.

use crate::reduced::coupled;
use crate::reduced::single::{Written, simulate_reduced};
use crate::reduced::system::{Lost, Reduced, ReducedError, Response, check, integrate};
use crate::reduced::table::{ArmSource, OnePerLane, Prescribed};
use ff_model::scalar::LaneScalar;
use ff_model::scalar::lanes::{Isa, LaneTask, dispatch, gather};
use ff_model::tree::Coordinates;
use ff_model::{Model, Params};

/// [`simulate_reduced`] for many parameter sets and initial states under one joint motion, as many at a time as the
/// machine has lanes (eight with AVX-512, four otherwise).
///
/// The results are those of single runs to rounding (the lanes use fused multiply-adds). Each set gets its own result: where the state of one is no
/// longer finite, those that share its lanes go on; where a mass matrix is not positive definite, they are run again alone. Allocates results and
/// buffers.
///
/// # Errors
/// [`ReducedError::NotFreeFloating`]; what goes wrong with one set is in its own result.
///
/// # Panics
/// If an initial state has the wrong length.
pub fn simulate_reduced_batch(
    model: &Model,
    table: &Prescribed,
    runs: &[(&Params<f64>, &[f64])],
) -> Result<Vec<Result<Response, ReducedError>>, ReducedError> {
    if let Some(done) = coupled::over_tree(model, |tree| simulate_reduced_batch(tree, table, runs), folded) {
        return done;
    }
    let start = |&(_, z0): &(&Params<f64>, &[f64])| z0.len();
    check_starts(model, runs.iter().map(start))?;
    Ok(dispatch(Isa::holding(runs.len()), Batch { model, table, runs }))
}

/// A parameter set, the table of the arm that belongs to it, and an initial state.
pub type OwnTable<'a> = (&'a Params<f64>, &'a Prescribed, &'a [f64]);

/// [`simulate_reduced_batch`] with a table per parameter set: the masses of the links, placements of joints and mounts, or
/// the motion itself differ between the sets. Allocates results and buffers.
///
/// # Errors
/// As [`simulate_reduced_batch`].
///
/// # Panics
/// If an initial state has the wrong length, or the tables differ in sampling, joints or hosts of the appendages.
pub fn simulate_reduced_own_tables(
    model: &Model,
    runs: &[OwnTable<'_>],
) -> Result<Vec<Result<Response, ReducedError>>, ReducedError> {
    if let Some(done) = coupled::over_tree(model, |tree| simulate_reduced_own_tables(tree, runs), folded) {
        return done;
    }
    check_starts(model, runs.iter().map(|run| run.2.len()))?;
    for pair in runs.windows(2) {
        assert!(pair[0].1.is_like(pair[1].1), "tables of one sampling, number of joints and hosts of the appendages");
    }
    Ok(dispatch(Isa::holding(runs.len()), OwnTables { model, runs }))
}

/// Every run with the torques of the coordinates.
fn folded(map: &Coordinates, runs: Vec<Result<Response, ReducedError>>) -> Vec<Result<Response, ReducedError>> {
    runs.into_iter().map(|r| r.map(|r| Response::folded(map, r))).collect()
}

fn check_starts(model: &Model, lengths: impl Iterator<Item = usize>) -> Result<(), ReducedError> {
    check(model)?;
    lengths.for_each(|n| assert_eq!(n, 6 + 2 * model.np(), "initial state"));
    Ok(())
}

struct Batch<'a> {
    model: &'a Model,
    table: &'a Prescribed,
    runs: &'a [(&'a Params<f64>, &'a [f64])],
}

impl LaneTask for Batch<'_> {
    type Output = Vec<Result<Response, ReducedError>>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { model, table, runs } = self;
        let mut all = Vec::with_capacity(runs.len());
        for group in runs.chunks(L::N) {
            match together::<L, _>(model, table, group.len(), |i| group[i]) {
                Some(together) => all.extend(together),
                None => all.extend(group.iter().map(|&(p, z)| simulate_reduced(model, p, table, z))),
            }
        }
        all
    }
}

struct OwnTables<'a> {
    model: &'a Model,
    runs: &'a [OwnTable<'a>],
}

impl LaneTask for OwnTables<'_> {
    type Output = Vec<Result<Response, ReducedError>>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { model, runs } = self;
        let mut all = Vec::with_capacity(runs.len());
        for group in runs.chunks(L::N) {
            let tables: Vec<&Prescribed> = (0..L::N).map(|l| group[l.min(group.len() - 1)].1).collect();
            match together::<L, _>(model, &OnePerLane(&tables), group.len(), |i| (group[i].0, group[i].2)) {
                Some(together) => all.extend(together),
                None => all.extend(group.iter().map(|&(p, table, z)| simulate_reduced(model, p, table, z))),
            }
        }
        all
    }
}

/// A group of runs, one per lane; one that is not full repeats its last. `None` for a single run, and where a mass matrix is not positive definite.
#[inline(always)]
fn together<'a, L: LaneScalar, S: ArmSource<L>>(
    model: &Model,
    source: &S,
    count: usize,
    run: impl Fn(usize) -> (&'a Params<f64>, &'a [f64]),
) -> Option<Vec<Result<Response, ReducedError>>> {
    if count == 1 {
        return None;
    }
    let (m, nj) = (model.np(), model.nj());
    let of = |l: usize| run(l.min(count - 1));
    let values: Vec<&[f64]> = (0..L::N).map(|l| of(l).0.values()).collect();
    let starts: Vec<&[f64]> = (0..L::N).map(|l| of(l).1).collect();
    let params = Params::from_values(model, (0..values[0].len()).map(|i| gather::<L>(&values, i)).collect());
    let z0: Vec<L> = (0..starts[0].len()).map(|i| gather(&starts, i)).collect();
    let mut out: Vec<Response> = (0..count).map(|_| Response::new(source.layout().samples, nj, m)).collect();
    let mut sys = Reduced::<L, S>::new(model, &params, source);
    let samples = source.layout().samples;
    let mut lost: Lost = Default::default();
    let done = integrate(&mut sys, &z0, 0..samples, Some(&mut lost), Written::new(&mut out, (m, nj), None));
    // Where all are lost, what is left of the integration says nothing.
    if done.is_err() && lost[..count].iter().any(Option::is_none) {
        return None;
    }
    Some(out.into_iter().zip(lost).map(|(response, lost)| lost.map_or(Ok(response), Err)).collect())
}
