//! The states to run on: the file format of `peers/src/make_states.py`.

use crate::lanes::pack;
use anyhow::{Context, bail, ensure};
use ff_dynamics::State;
use ff_model::Model;
use ff_model::scalar::LaneScalar;
use nalgebra::Vector4;
use std::path::Path;

/// One state with an acceleration and a force, as the peers write it: `q = [position 3, quaternion x y z w, joints,
/// passive]`, `v`, `a`, `tau = [base linear 3, base angular 3 (base frame), joints, passive]`.
#[derive(Clone, Debug, serde::Deserialize)]
pub(crate) struct Sample {
    pub(crate) q: Vec<f64>,
    pub(crate) v: Vec<f64>,
    pub(crate) a: Vec<f64>,
    pub(crate) tau: Vec<f64>,
}

/// Reads `nq nv n` and then `q v a tau` on each of `n` lines.
pub(crate) fn read(path: &Path) -> anyhow::Result<Vec<Sample>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    parse(&text).with_context(|| format!("{}", path.display()))
}

fn parse(text: &str) -> anyhow::Result<Vec<Sample>> {
    let mut lines = text.lines();
    let head: Vec<usize> =
        lines.next().unwrap_or_default().split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
    let &[nq, nv, n] = head.as_slice() else { bail!("line 1 must hold nq, nv and the number of states") };
    let mut samples = Vec::with_capacity(n);
    for (i, line) in lines.take(n).enumerate() {
        let x: Vec<f64> = line
            .split_whitespace()
            .map(str::parse)
            .collect::<Result<_, _>>()
            .with_context(|| format!("line {}", i + 2))?;
        ensure!(x.len() == nq + 3 * nv, "line {} holds {} numbers instead of {}", i + 2, x.len(), nq + 3 * nv);
        ensure!(x.iter().all(|x| x.is_finite()), "line {} holds a number that is not finite", i + 2);
        let (q, rest) = x.split_at(nq);
        let part = |k: usize| rest[k * nv..(k + 1) * nv].to_vec();
        samples.push(Sample { q: q.to_vec(), v: part(0), a: part(1), tau: part(2) });
    }
    ensure!(samples.len() == n, "{} states instead of {n}", samples.len());
    Ok(samples)
}

/// States over one scalar type; with lanes, each entry holds `T::N` consecutive states.
#[derive(Clone, Debug)]
pub(crate) struct Set<T: LaneScalar> {
    pub(crate) states: Vec<State<T>>,
    pub(crate) a: Vec<Vec<T>>,
    pub(crate) tau: Vec<Vec<T>>,
}

impl<T: LaneScalar> Set<T> {
    /// Packs the samples for `model`; those left over by a division by the lanes are dropped.
    pub(crate) fn new(model: &Model, samples: &[Sample]) -> anyhow::Result<Self> {
        let (nj, nv) = (model.nj(), model.nv());
        for s in samples {
            ensure!(s.q.len() == nv + 1 && s.v.len() == nv, "states of {} velocities for a model of {nv}", s.v.len());
        }
        let mut set = Self { states: Vec::new(), a: Vec::new(), tau: Vec::new() };
        for group in samples.chunks_exact(T::N) {
            let pack = |x: &dyn Fn(&Sample) -> f64| pack::<T>(|i| x(&group[i]));
            let mut s = State::<T>::zero(model);
            for k in 0..3 {
                s.pos[k] = pack(&|x| x.q[k]);
            }
            s.att = Vector4::new(pack(&|x| x.q[6]), pack(&|x| x.q[3]), pack(&|x| x.q[4]), pack(&|x| x.q[5]));
            (0..nj).for_each(|k| s.q[k] = pack(&|x| x.q[7 + k]));
            (0..model.np()).for_each(|k| s.eta[k] = pack(&|x| x.q[7 + nj + k]));
            (0..nv).for_each(|k| s.v[k] = pack(&|x| x.v[k]));
            set.states.push(s);
            set.a.push((0..nv).map(|k| pack(&|x| x.a[k])).collect());
            set.tau.push((0..nv).map(|k| pack(&|x| x.tau[k])).collect());
        }
        Ok(set)
    }
}
