//! The least-squares problem of a calibration: columns, triangles of every joint, and its solution.

use super::calibration::Ground;
use super::equations::{Group, Layout};
use super::gains::{Substitution, Unit, joined, with_columns};
use super::joint_terms::{JointTerm, JointTorques};
use crate::belief::covariance::Unknown;
use crate::solve::linear;
use crate::solve::linear::{LinearError, LinearEstimate, Task, Weights};
use ff_least_squares::Triangle;
use ff_model::{JointKind, ParamDecl};

/// Most linearisations of gains.
const LINEARISATIONS: usize = 30;
/// Change of the gains, in sizes, at which they are found.
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
    /// A term as an unknown, in the unit of `torque`, the size of the torque of its joint (and of its friction in proportion to a load, `load`).
    fn term_unknown(&self, j: usize, term: JointTerm, torque: f64, load: f64) -> (Unknown, f64) {
        let model = self.ground.model;
        let body = &model.own_body(j).joint;
        let rate = self.sizes[j].1;
        let size = match term {
            JointTerm::Viscous | JointTerm::Asymmetry | JointTerm::ReflectedInertia => torque / rate,
            JointTerm::Quadratic => torque / (rate * rate),
            JointTerm::Load => load,
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
    fn gain_unknown(&self, j: usize, size: f64) -> Unknown {
        let joint = &self.ground.model.own_body(j).joint;
        let unit = if joint.kind == JointKind::Prismatic { "N/A" } else { "N m/A" };
        Unknown { name: format!("drive.{}.gain", joint.name), unit: unit.into(), size: size.max(f64::MIN_POSITIVE) }
    }
    /// Solves. Gains of joints that have currents begin as the mission's bodies tell them.
    pub(super) fn solve(&self, triangles: &[Triangle], weights: &Weights) -> Result<Solved, LinearError> {
        let (nj, own) = (self.ground.model.nj(), self.layout.terms.len());
        let (at, g) = if self.currents.contains(&true) {
            self.about(triangles, weights)?
        } else {
            (vec![0.0; self.before_gains()], vec![None; nj])
        };
        let equations = self.equations(triangles, (&at, &g), Unit::Torque)?;
        // A current says nothing of the size of a torque.
        let torque = |j: usize| if self.currents[j] { 1.0 } else { self.sizes[j].0 };
        let mut extra: Vec<_> =
            self.layout.terms.iter().map(|&(j, t)| self.term_unknown(j, t, torque(j), 0.1)).collect();
        let gains: Vec<Option<f64>> = g.iter().map(|g| g.map(|g| 1.0 / g)).collect();
        let some = gains.iter().enumerate().filter_map(|(j, k)| k.map(|k| (j, k)));
        extra.extend(some.map(|(j, k)| (self.gain_unknown(j, k.abs()), k)));
        let fit = self.linear_fit(weights, extra, &equations)?;
        let mut joints = JointTorques { terms: vec![Vec::new(); nj], gains };
        for (&(j, term), e) in self.layout.terms.iter().zip(&fit.extra) {
            joints.terms[j].push((term, e.value));
        }
        joints.gains.iter_mut().flatten().zip(&fit.extra[own..]).for_each(|(k, e)| *k = e.value);
        Ok(Solved { fit, joints })
    }
    /// Equations of every joint, linear about these values and gains (A/N m).
    pub(super) fn equations(
        &self,
        triangles: &[Triangle],
        (at, gains): (&[f64], &[Option<f64>]),
        unit: Unit,
    ) -> Result<Vec<Triangle>, LinearError> {
        let s = Substitution { layout: &self.layout, selected: self.selected.len(), at, gains };
        Ok(triangles.iter().enumerate().map(|(j, t)| s.of(j, t, unit)).collect::<Result<_, _>>()?)
    }
    fn linear_fit(
        &self,
        weights: &Weights,
        extra: Vec<(Unknown, f64)>,
        equations: &[Triangle],
    ) -> Result<LinearEstimate, LinearError> {
        linear::solve(&self.task(weights, extra), equations)
    }
    fn task<'t>(&'t self, weights: &'t Weights, extra: Vec<(Unknown, f64)>) -> Task<'t> {
        let priors = &self.ground.priors;
        Task { decls: &self.decls, selected: self.selected, start: self.start, extra, weights, priors }
    }
    /// Parameters and terms (N m), and gains (A/N m) of the joints that have currents, about which everything is linear.
    fn about(&self, triangles: &[Triangle], weights: &Weights) -> Result<(Vec<f64>, Vec<Option<f64>>), LinearError> {
        let (m, own) = (self.selected.len(), self.layout.terms.len());
        let mut at: Vec<f64> = self.selected.iter().map(|&i| self.start[i]).collect();
        at.resize(self.before_gains(), 0.0);
        let none = vec![None; triangles.len()];
        let s = Substitution { layout: &self.layout, selected: m, at: &at, gains: &none };
        let begin = |(j, t): (usize, &Triangle)| self.currents[j].then(|| s.start(j, t)).transpose();
        let first = triangles.iter().enumerate().map(begin).collect::<Result<Vec<_>, _>>()?;
        let mut g: Vec<Option<f64>> = first.iter().map(|f| f.as_ref().map(|f| f.gain)).collect();
        let size = |j: usize| first[j].as_ref().map_or(1.0, |f| f.size);
        for _ in 0..LINEARISATIONS {
            let equations = self.equations(triangles, (&at, &g), Unit::Current)?;
            let term = |&(j, t): &(usize, JointTerm)| {
                let load = if g[j].is_some() { 0.1 * size(j) } else { 0.1 };
                let (unknown, start) = self.term_unknown(j, t, self.sizes[j].0, load);
                (unknown, start * g[j].unwrap_or(1.0))
            };
            let mut extra: Vec<_> = self.layout.terms.iter().map(term).collect();
            let some = g.iter().enumerate().filter_map(|(j, g)| g.map(|g| (j, g)));
            extra.extend(some.map(|(j, g)| (self.gain_unknown(j, size(j)), g)));
            let fit = self.linear_fit(weights, extra, &equations)?;
            at = fit.parameters.iter().chain(&fit.extra[..own]).map(|p| p.value).collect();
            let mut change = 0.0f64;
            let found = fit.extra[own..].iter().map(|e| e.value);
            for ((j, to), new) in g.iter_mut().enumerate().filter_map(|(j, g)| g.as_mut().map(|g| (j, g))).zip(found) {
                change = change.max((new - *to).abs() / size(j));
                *to = new;
            }
            if change < SETTLED {
                break;
            }
        }
        // A motor without any effect has no gain: what would be infinite is as large as it may be.
        for (j, g) in g.iter_mut().enumerate() {
            let least = f64::EPSILON * size(j);
            *g = g.map(|g| if g.abs() < least { least } else { g });
        }
        for (to, &(j, _)) in at[m..].iter_mut().zip(&self.layout.terms) {
            *to /= g[j].unwrap_or(1.0);
        }
        Ok((at, g))
    }
    /// Parameters, then the coefficients of `terms`, of triangles in N m over these. Allocates.
    pub(super) fn plain(
        &self,
        terms: &[(usize, JointTerm)],
        triangles: &[Triangle],
        weights: &Weights,
    ) -> Result<Vec<f64>, LinearError> {
        let extra = terms.iter().map(|&(j, t)| self.term_unknown(j, t, self.sizes[j].0, 0.1)).collect();
        linear::values(&self.task(weights, extra), triangles)
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
        let t = s.of(j, &t, Unit::Torque)?;
        Ok(with_columns(&t, |c| c < m || wanted(c - m))?)
    }
}
