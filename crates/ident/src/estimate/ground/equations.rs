//! The equations of motion of records on the ground: motion at the samples, torques or currents, columns of the terms of the joints.

use super::calibration::Ground;
use super::joint_terms::{JointTerm, Moving};
use super::smoothed::{filter, too_short};
use crate::estimate::complete::{motion_at, trimmed};
use crate::motion::joint_motion::joint_motion;
use crate::motion::zero_phase::ZeroPhase;
use crate::solve::linear::LinearError;
use crate::solve::regressor_rows::{Equations, Extra, Kind};
use core::ops::Range;
use ff_dynamics::{State, Work, frame_jacobian, rnea};
use ff_least_squares::Triangle;
use ff_model::{Model, Params};
use ff_records::Record;
use nalgebra::DMatrix;

/// What is looked at of a record.
pub(super) struct Window {
    /// Samples between the ends that are left out.
    pub(super) used: Range<usize>,
    pub(super) filter: Option<ZeroPhase>,
    /// Which of these count: all but the transients of the filter.
    pub(super) rows: Range<usize>,
}

/// Motion and measured torques at the samples of a record.
pub(super) struct Instants {
    pub(super) q: DMatrix<f64>,
    pub(super) qd: DMatrix<f64>,
    pub(super) qdd: DMatrix<f64>,
    /// Torques, or currents of the joints that have these (A).
    pub(super) measured: DMatrix<f64>,
    /// Joint torques of wrenches that were measured (N m), where there are any.
    pub(super) external: Option<DMatrix<f64>>,
    pub(super) filter: Option<ZeroPhase>,
    /// Rows that count: all but the transients of the filter.
    pub(super) rows: Range<usize>,
}

impl Instants {
    /// The rows that count.
    pub(super) fn of_rows(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        m.rows(self.rows.start, self.rows.len()).into_owned()
    }
}

impl Ground<'_> {
    pub(super) fn window(&self, record: &Record) -> Result<Window, LinearError> {
        let used = trimmed(record, self.trim_s)?;
        let n = used.len();
        let Some(hz) = self.low_pass_hz else { return Ok(Window { used, filter: None, rows: 0..n }) };
        let z = filter(record, hz)?;
        let cut = z.transient();
        if n < 3 * cut {
            return Err(too_short(hz));
        }
        Ok(Window { used, filter: Some(z), rows: cut..n - cut })
    }
    pub(super) fn instants(&self, record: &Record) -> Result<Instants, LinearError> {
        let Window { used, filter, rows } = self.window(record)?;
        let (q, qd, qdd) = motion_at(&*joint_motion(self.model, record)?, record, used.clone());
        let measured = record.tau().rows(used.start, used.len()).into_owned();
        let external = external_torques(self.model, record, &used, &q);
        Ok(Instants { q, qd, qdd, measured, external, filter, rows })
    }
    /// The sign of a rate.
    pub(super) fn sign(&self, rate: f64) -> f64 {
        self.friction.near_rest.sign(rate)
    }
    /// Whether the sign of a rate is to be trusted, or does not matter.
    pub(super) fn moves(&self, rate: f64) -> bool {
        !self.friction.coulomb || self.friction.near_rest.uses(rate)
    }
}

/// Torques (N x n) that the wrenches of a record put on the joints: `J^T w` of every frame that the robot has, in whose axes and about
/// whose origin `w` is what acts on the robot.
fn external_torques(model: &Model, record: &Record, used: &Range<usize>, q: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let carried = record.carried()?;
    let of = |(frame, columns): (String, [usize; 6])| Some((model.frame(&frame)?.clone(), columns));
    let frames: Vec<_> = carried.wrenches().into_iter().filter_map(of).collect();
    if frames.is_empty() {
        return None;
    }
    let (mut work, mut state) = (Work::new(model), State::zero(model));
    let mut jacobian = DMatrix::zeros(6, model.nv());
    let mut out = DMatrix::zeros(q.nrows(), model.nj());
    for i in 0..q.nrows() {
        (0..model.nj()).for_each(|j| state.q[j] = q[(i, j)]);
        for (frame, columns) in &frames {
            frame_jacobian(model, &state, frame, &mut work, &mut jacobian);
            for j in 0..model.nj() {
                let w = |r: usize| carried.values[(used.start + i, columns[r])];
                out[(i, j)] += (0..6).map(|r| jacobian[(r, j)] * w(r)).sum::<f64>();
            }
        }
    }
    Some(out)
}

/// Torques (N x n) of the rigid bodies with these parameters. Allocates.
pub(super) fn rigid_torques(
    model: &Model,
    values: &[f64],
    (q, qd, qdd): (&DMatrix<f64>, &DMatrix<f64>, &DMatrix<f64>),
) -> DMatrix<f64> {
    let nj = model.nj();
    let params = Params::from_values(model, values.to_vec());
    let (mut work, mut state) = (Work::new(model), State::zero(model));
    let mut out = DMatrix::zeros(q.nrows(), nj);
    let (mut acc, mut row) = (vec![0.0; nj], vec![0.0; nj]);
    for i in 0..q.nrows() {
        for j in 0..nj {
            (state.q[j], state.v[j], acc[j]) = (q[(i, j)], qd[(i, j)], qdd[(i, j)]);
        }
        rnea(model, &params, &state, &acc, &mut work, &mut row);
        row.iter().enumerate().for_each(|(j, x)| out[(i, j)] = *x);
    }
    out
}

/// Columns of the equations beside the parameters, in their order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    /// Terms of the joints.
    pub(super) terms: Vec<(usize, JointTerm)>,
    /// Whether a column per joint holds the torque that is known.
    pub(super) known: bool,
}

/// Samples of records whose parameters are zero alike, one record behind the other.
pub(super) struct Group {
    q: DMatrix<f64>,
    qd: DMatrix<f64>,
    qdd: DMatrix<f64>,
    measured: DMatrix<f64>,
    external: Option<DMatrix<f64>>,
    filters: Vec<(Range<usize>, ZeroPhase)>,
    /// 1 where the torque of a joint counts.
    keep: DMatrix<f64>,
    /// Parameters that are zero here.
    absent: Vec<usize>,
}

/// The groups of records that lack the same parameters.
pub(super) fn groups(ground: &Ground<'_>, records: &[&Record]) -> Result<Vec<Group>, LinearError> {
    let nj = ground.model.nj();
    let mut parts: Vec<(Vec<usize>, Vec<Instants>)> = Vec::new();
    for (k, r) in records.iter().enumerate() {
        let absent = ground.absent.get(k).cloned().unwrap_or_default();
        let at = ground.instants(r)?;
        match parts.iter_mut().find(|p| p.0 == absent) {
            Some(p) => p.1.push(at),
            None => parts.push((absent, vec![at])),
        }
    }
    let one = |(absent, parts): (Vec<usize>, Vec<Instants>)| {
        let n: usize = parts.iter().map(|p| p.q.nrows()).sum();
        let stack = |of: &dyn Fn(&Instants) -> DMatrix<f64>| {
            let mut out = DMatrix::zeros(n, nj);
            let mut at = 0;
            for p in &parts {
                let m = of(p);
                out.rows_mut(at, m.nrows()).copy_from(&m);
                at += m.nrows();
            }
            out
        };
        let (q, qd, qdd) = (stack(&|p| p.q.clone()), stack(&|p| p.qd.clone()), stack(&|p| p.qdd.clone()));
        let measured = stack(&|p| p.measured.clone());
        let some = parts.iter().any(|p| p.external.is_some());
        let external = some.then(|| stack(&|p| p.external.clone().unwrap_or_else(|| DMatrix::zeros(p.q.nrows(), nj))));
        let (mut filters, mut counts, mut first) = (Vec::new(), Vec::with_capacity(n), 0);
        for p in &parts {
            counts.extend((0..p.q.nrows()).map(|i| p.rows.contains(&i)));
            filters.extend(p.filter.clone().map(|z| (first..first + p.q.nrows(), z)));
            first += p.q.nrows();
        }
        let keep = DMatrix::from_fn(n, nj, |i, j| f64::from(u8::from(counts[i] && ground.moves(qd[(i, j)]))));
        Group { q, qd, qdd, measured, external, filters, keep, absent }
    };
    Ok(parts.into_iter().map(one).collect())
}

impl Group {
    pub(super) fn samples(&self) -> usize {
        self.q.nrows()
    }
    pub(super) fn has_external(&self) -> bool {
        self.external.is_some()
    }
    /// Part of the samples of a joint that counts.
    pub(super) fn used(&self, joint: usize) -> f64 {
        self.keep.column(joint).sum()
    }
    /// Sums of squares of the rate and of what was measured of a joint.
    pub(super) fn squares(&self, joint: usize) -> (f64, f64) {
        (self.qd.column(joint).norm_squared(), self.measured.column(joint).norm_squared())
    }
    /// Fastest rate of a joint that counts.
    pub(super) fn fastest(&self, joint: usize) -> f64 {
        let (rates, keep) = (self.qd.column(joint), self.keep.column(joint));
        let moving = rates.iter().zip(keep.iter());
        moving.filter(|(_, k)| **k > 0.0).map(|(w, _)| w.abs()).fold(0.0, f64::max)
    }
    /// Triangles of every joint, of each block of samples; `load` are the parameters by which the load of a gear is told.
    pub(super) fn triangles(
        &self,
        ground: &Ground<'_>,
        layout: &Layout,
        (selected, values, load): (&[usize], &[f64], &[f64]),
        blocks: &[Range<usize>],
    ) -> Result<Vec<Vec<Triangle>>, LinearError> {
        let model = ground.model;
        let zeroed = |values: &[f64], more: &[usize]| {
            let mut v = values.to_vec();
            self.absent.iter().chain(more).for_each(|&p| v[p] = 0.0);
            v
        };
        let motion = (&self.q, &self.qd, &self.qdd);
        let needs_load = layout.terms.iter().any(|t| t.1 == JointTerm::Load);
        let loads = needs_load.then(|| rigid_torques(model, &zeroed(load, &[]), motion));
        let mut extra = Vec::with_capacity(layout.terms.len() + model.nj());
        for &(j, term) in &layout.terms {
            let factor = |i: usize| {
                let qd = self.qd[(i, j)];
                let load = loads.as_ref().map_or(0.0, |l| l[(i, j)]);
                term.factor(Moving { qd, qdd: self.qdd[(i, j)], sign: ground.sign(qd), load })
            };
            extra.push(Extra { dof: j, factor: (0..self.samples()).map(factor).collect() });
        }
        let mut values = zeroed(values, &[]);
        if layout.known {
            // What is known of the torque of the rigid bodies, less what acts from outside.
            let mut known = rigid_torques(model, &zeroed(&values, selected), motion);
            if let Some(external) = &self.external {
                known -= external;
            }
            extra.extend((0..model.nj()).map(|j| Extra { dof: j, factor: known.column(j).iter().copied().collect() }));
            values.fill(0.0);
        }
        let joints = model.joint_names();
        let kinds = joints.iter().enumerate().map(|(j, n)| Kind { name: format!("torque {n}"), dofs: vec![j] });
        let equations = Equations {
            model,
            q: self.q.clone(),
            v: self.qd.clone(),
            a: self.qdd.clone(),
            measured: self.measured.clone(),
            selected,
            values: &values,
            absent: &self.absent,
            extra,
            keep: Some(self.keep.clone()),
            kinds: kinds.collect(),
        };
        let whole = 0..self.samples();
        if self.filters.is_empty() && blocks == core::slice::from_ref(&whole) {
            return Ok(vec![equations.triangles()?]);
        }
        let filters: Vec<_> = self.filters.iter().map(|(rows, z)| (rows.clone(), z)).collect();
        Ok(equations.filtered_triangles(&filters, blocks)?)
    }
}
