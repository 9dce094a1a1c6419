//! The least-squares problem of a calibration: columns, triangles of every joint, and its solution.

use super::calibration::Ground;
use super::equations::{Group, Layout};
use super::gains::{Substitution, joined, with_columns};
use super::joint_terms::{JointTerm, JointTorques};
use crate::belief::covariance::Unknown;
use crate::solve::linear;
use crate::solve::linear::{LinearError, LinearEstimate, Task, Weights};
use ff_least_squares::Triangle;
use ff_model::{JointKind, ParamDecl};

/// Most linearisations of gains.
const LINEARISATIONS: usize = 30;
/// Relative change of the gains at which they are found.
const SETTLED: f64 = 1e-10;

/// What is estimated, and from which triangles.
pub(super) struct Problem<'a> {
    pub(super) ground: &'a Ground<'a>,
    pub(super) decls: Vec<ParamDecl>,
    pub(super) selected: &'a [usize],
    pub(super) start: &'a [f64],
    pub(super) layout: Layout,
    /// Joints whose currents were measured.
    pub(super) currents: Vec<bool>,
    /// Sizes of what was measured and of rates (root mean square), by joint.
    sizes: Vec<(f64, f64)>,
}

/// A solution, with the gains (N m/A) of the joints that have currents.
pub(super) struct Solved {
    pub(super) fit: LinearEstimate,
    pub(super) joints: JointTorques,
}

impl<'a> Problem<'a> {
    pub(super) fn new(
        ground: &'a Ground<'a>,
        groups: &[Group],
        currents: Vec<bool>,
        (selected, start): (&'a [usize], &'a [f64]),
        terms: Vec<(usize, JointTerm)>,
    ) -> Self {
        let n: usize = groups.iter().map(Group::samples).sum();
        let size = |j: usize| {
            let (rate, measured) = groups.iter().map(|g| g.squares(j)).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
            let of = |s: f64| (s / n.max(1) as f64).sqrt().max(1e-6);
            (of(measured), of(rate))
        };
        let known = currents.contains(&true) || groups.iter().any(Group::has_external);
        Self {
            ground,
            decls: ground.model.param_decls(),
            selected,
            start,
            layout: Layout { terms, known },
            sizes: (0..ground.model.nj()).map(size).collect(),
            currents,
        }
    }
    /// Triangles of every joint over all samples; `load` are the parameters by which the load of a gear is told.
    pub(super) fn triangles(&self, groups: &[Group], load: &[f64]) -> Result<Vec<Triangle>, LinearError> {
        let mut of_joint: Vec<Vec<Triangle>> = vec![Vec::new(); self.ground.model.nj()];
        for g in groups {
            let whole = core::slice::from_ref(&(0..g.samples())).to_vec();
            let found = g.triangles(self.ground, &self.layout, (self.selected, self.start, load), &whole)?;
            for (to, t) in of_joint.iter_mut().zip(found.into_iter().flatten()) {
                to.push(t);
            }
        }
        let one = |mut parts: Vec<Triangle>| if parts.len() == 1 { Ok(parts.remove(0)) } else { joined(parts) };
        Ok(of_joint.into_iter().map(one).collect::<Result<_, _>>()?)
    }
    /// Number of the unknowns before the gains.
    fn before_gains(&self) -> usize {
        self.selected.len() + self.layout.terms.len()
    }
    fn term_unknown(&self, j: usize, term: JointTerm) -> (Unknown, f64) {
        let model = self.ground.model;
        let body = &model.own_body(j).joint;
        let (torque, rate) = self.sizes[j];
        // A current says nothing of the size of a torque.
        let torque = if self.currents[j] { 1.0 } else { torque };
        let size = match term {
            JointTerm::Viscous | JointTerm::Asymmetry | JointTerm::ReflectedInertia => torque / rate,
            JointTerm::Quadratic => torque / (rate * rate),
            JointTerm::Load => 0.1,
            _ => torque,
        };
        let slides = body.kind == JointKind::Prismatic;
        // What the robot's file says of it, where the data say nothing.
        let file = self.ground.model.reflected_impedance(j);
        let start = match term {
            JointTerm::Viscous => file.viscous,
            JointTerm::Coulomb => file.coulomb,
            _ => 0.0,
        };
        (Unknown { name: term.name(&body.name), unit: term.unit(slides).into(), size }, start)
    }
    /// Solves, from the gains (N m/A) given or from those that explain the joints best before.
    pub(super) fn solve(
        &self,
        triangles: &[Triangle],
        weights: &Weights,
        gains: Option<&[Option<f64>]>,
    ) -> Result<Solved, LinearError> {
        let m = self.selected.len();
        let mut at: Vec<f64> = self.selected.iter().map(|&i| self.start[i]).collect();
        at.resize(self.before_gains(), 0.0);
        let nj = self.ground.model.nj();
        let mut k: Vec<Option<f64>> = match gains {
            Some(g) => g.to_vec(),
            None => {
                let none = vec![None; nj];
                let s = Substitution { layout: &self.layout, selected: m, at: &at, gains: &none };
                (0..nj)
                    .map(|j| if self.currents[j] { Some(1.0 / s.start(j, &triangles[j]).unwrap_or(1.0)) } else { None })
                    .collect()
            }
        };
        let mut rounds = 0;
        loop {
            let a: Vec<Option<f64>> = k.iter().map(|k| k.map(|k| 1.0 / k)).collect();
            let s = Substitution { layout: &self.layout, selected: m, at: &at, gains: &a };
            let equations = triangles.iter().enumerate().map(|(j, t)| s.of(j, t)).collect::<Result<Vec<_>, _>>()?;
            let mut extra: Vec<(Unknown, f64)> =
                self.layout.terms.iter().map(|&(j, term)| self.term_unknown(j, term)).collect();
            for (j, k) in k.iter().enumerate() {
                let Some(k) = *k else { continue };
                let joint = &self.ground.model.own_body(j).joint;
                let unit = if joint.kind == JointKind::Prismatic { "N/A" } else { "N m/A" };
                let size = k.abs().max(f64::MIN_POSITIVE);
                extra.push((Unknown { name: format!("drive.{}.gain", joint.name), unit: unit.into(), size }, k));
            }
            let priors = &self.ground.priors;
            let task = Task { decls: &self.decls, selected: self.selected, start: self.start, extra, weights, priors };
            let fit = linear::solve(&task, &equations)?;
            let found = fit.extra[self.layout.terms.len()..].iter().map(|e| e.value);
            let (mut next, mut change) = (k.clone(), 0.0f64);
            for (to, new) in next.iter_mut().flatten().zip(found) {
                // A step across zero would turn the motor round: half of the way at most.
                let new = if new * *to > 0.25 * *to * *to { new } else { 0.5 * *to };
                change = change.max((new / *to - 1.0).abs());
                *to = new;
            }
            at = fit.parameters.iter().chain(&fit.extra[..self.layout.terms.len()]).map(|p| p.value).collect();
            k = next;
            rounds += 1;
            if change < SETTLED || rounds == LINEARISATIONS {
                let mut joints = JointTorques { terms: vec![Vec::new(); nj], gains: k };
                for (&(j, term), e) in self.layout.terms.iter().zip(&fit.extra) {
                    joints.terms[j].push((term, e.value));
                }
                return Ok(Solved { fit, joints });
            }
        }
    }
    /// Parameters, then the coefficients of `terms`, of triangles in N m over these. Allocates.
    pub(super) fn plain(
        &self,
        terms: Vec<(usize, JointTerm)>,
        currents: Vec<bool>,
        triangles: &[Triangle],
        weights: &Weights,
    ) -> Result<Vec<f64>, LinearError> {
        let layout = Layout { terms, known: false };
        let of = Problem { layout, currents, decls: self.decls.clone(), sizes: self.sizes.clone(), ..*self };
        let fit = of.solve(triangles, weights, None)?.fit;
        Ok(fit.parameters.iter().chain(&fit.extra).map(|p| p.value).collect())
    }
    /// The triangle of a joint over parameters and the terms that `wanted` names, in N m by the gains (N m/A) given.
    pub(super) fn linear(
        &self,
        j: usize,
        t: &Triangle,
        gains: &[Option<f64>],
        wanted: &dyn Fn(usize) -> bool,
    ) -> Result<Triangle, LinearError> {
        let m = self.selected.len();
        let at = vec![0.0; self.before_gains()];
        let mut t = t.clone();
        if let Some(k) = gains[j] {
            let last = t.columns.len();
            t.r.column_mut(last).scale_mut(k);
        }
        let none = vec![None; gains.len()];
        let s = Substitution { layout: &self.layout, selected: m, at: &at, gains: &none };
        let t = s.of(j, &t)?;
        Ok(with_columns(&t, |c| c < m || wanted(c - m))?)
    }
}
