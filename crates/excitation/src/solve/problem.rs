//! What is to be optimised: a cost over the variables of a plan, under constraints.

use crate::constraint::{Constraint, Sense, Wanted};
use crate::objective::Cost;
use crate::plan::error::{PlanError, PlanLimit};
use crate::plan::limits::{JointLimits, ROUNDING};
use crate::plan::spline::{Duration, SplinePlan};
use nalgebra::DMatrix;

/// Relative distance to the limit within which peaks are looked at.
const NEAR: f64 = -0.4;
/// Relative distance to the limit within which every sample is looked at.
const CLOSE: f64 = -0.003;

/// A cost to be made small by a trajectory that keeps all limits and constraints.
#[derive(Clone)]
pub struct Problem<'a> {
    /// What is to be small.
    pub cost: &'a dyn Cost,
    /// Variables, and the limits of the joints.
    pub plan: &'a SplinePlan,
    /// What else must hold.
    pub constraints: Vec<&'a dyn Constraint>,
    /// Names of the joints and whether they are prismatic; empty when no model is known.
    pub(crate) joints: Vec<(String, bool)>,
    /// Added to the rows: what the full simulation has shown to be missing. Empty for nothing.
    pub(crate) correction: Vec<f64>,
    /// Channels that do not count (search for conflicts).
    pub(crate) dropped: Vec<(usize, usize)>,
    /// Joints and derivative orders whose limits do not count (search for conflicts); order 0 is the position.
    pub(crate) freed: Vec<(usize, i32)>,
}

impl<'a> Problem<'a> {
    /// Without constraints beyond the limits of the joints.
    pub fn new(cost: &'a dyn Cost, plan: &'a SplinePlan) -> Self {
        Self {
            cost,
            plan,
            constraints: Vec::new(),
            joints: Vec::new(),
            correction: Vec::new(),
            dropped: Vec::new(),
            freed: Vec::new(),
        }
    }
    /// The same under constraints. Allocates.
    #[must_use]
    pub fn under(mut self, constraints: &[&'a dyn Constraint]) -> Self {
        self.constraints = constraints.to_vec();
        self
    }
    /// The same with joints called by their names. Allocates.
    #[must_use]
    pub fn named(mut self, model: &ff_model::Model) -> Self {
        let prismatic = |b: &ff_model::Body| b.joint.kind == ff_model::JointKind::Prismatic;
        self.joints = model.own_bodies().map(|b| (b.joint.name.clone(), prismatic(b))).collect();
        self
    }
    /// Name of a joint, its index from 0 when no model is known; and whether it is prismatic.
    pub(crate) fn joint(&self, joint: usize) -> (String, bool) {
        self.joints.get(joint).cloned().unwrap_or_else(|| (format!("joint {joint}"), false))
    }
    /// Rows of all constraints.
    pub(crate) fn rows(&self) -> usize {
        self.constraints.iter().map(|c| c.channels().len() * c.samples(self.plan)).sum()
    }
    /// Constraint and channel of every row. Allocates.
    pub(crate) fn origin(&self) -> Vec<(usize, usize)> {
        let of = |(k, c): (usize, &&dyn Constraint)| {
            let samples = c.samples(self.plan);
            (0..c.channels().len()).flat_map(move |ch| std::iter::repeat_n((k, ch), samples)).collect::<Vec<_>>()
        };
        self.constraints.iter().enumerate().flat_map(of).collect()
    }
    /// All rows, the correction included, and the derivatives of those that are wanted. Rows of dropped channels are `-1`.
    pub(crate) fn evaluate(&self, x: &[f64], rows: &mut [f64], jacobian: Option<(&[bool], &mut DMatrix<f64>)>) {
        let mut first = 0;
        let (wanted, mut jacobian) = jacobian.unzip();
        for (k, c) in self.constraints.iter().enumerate() {
            let samples = c.samples(self.plan);
            let count = c.channels().len() * samples;
            let here = &mut rows[first..first + count];
            match (wanted, jacobian.as_mut()) {
                (Some(wanted), Some(j)) if wanted[first..first + count].contains(&true) => {
                    let mut own = DMatrix::zeros(count, j.ncols());
                    let wanted = &wanted[first..first + count];
                    c.evaluate(self.plan, x, here, Some(Wanted { rows: wanted, jacobian: &mut own }));
                    j.rows_mut(first, count).copy_from(&own);
                }
                _ => c.evaluate(self.plan, x, here, None),
            }
            for (row, more) in here.iter_mut().zip(self.correction.iter().skip(first)) {
                *row += more;
            }
            for ch in (0..c.channels().len()).filter(|&ch| self.dropped.contains(&(k, ch))) {
                here[ch * samples..(ch + 1) * samples].fill(-1.0);
            }
            first += count;
        }
    }
    /// The rows that the search has to look at: peaks over time of what comes within [`NEAR`] of its limit, and all
    /// that comes within [`CLOSE`].
    pub(crate) fn select(&self, rows: &[f64], chosen: &mut [bool]) {
        let mut first = 0;
        for c in &self.constraints {
            let samples = c.samples(self.plan);
            for channel in rows[first..].chunks_exact(samples).take(c.channels().len()) {
                for (i, r) in channel.iter().enumerate() {
                    let above = |k: Option<usize>| k.and_then(|k| channel.get(k)).is_none_or(|o| r >= o);
                    let peak = above(i.checked_sub(1)) && above(Some(i + 1));
                    chosen[first + i] = *r > CLOSE || (*r > NEAR && peak);
                }
                first += samples;
            }
        }
    }
    /// The largest row, and NaN if one is not a number; minus infinity without constraints. Allocates.
    pub(crate) fn excess(&self, x: &[f64]) -> f64 {
        let mut rows = vec![0.0; self.rows()];
        self.evaluate(x, &mut rows, None);
        largest(&rows)
    }
    /// Names the constraint that `rows` break most, with its value.
    pub(crate) fn worst_broken(&self, rows: &[f64]) -> PlanError {
        let worst = (0..rows.len()).max_by(|a, b| rows[*a].total_cmp(&rows[*b])).unwrap_or(0);
        let (k, ch) = self.origin()[worst];
        let channel = &self.constraints[k].channels()[ch];
        let beyond = rows[worst] * channel.scale;
        let value = match channel.sense {
            Sense::AtMost => channel.limit + beyond,
            Sense::AtLeast => channel.limit - beyond,
        };
        let (name, item, limit, unit) = (channel.name, channel.item.clone(), channel.limit, channel.unit);
        PlanError::Broken { name, item, value, limit, unit }
    }
    /// True when the limit of a joint does not count.
    pub(crate) fn is_freed(&self, joint: usize, power: i32) -> bool {
        self.freed.contains(&(joint, power))
    }
    /// The joint limit that `x` breaks most, [`SplinePlan::violated`], those that do not count left out.
    pub(crate) fn violated(&self, x: &[f64]) -> Option<PlanLimit> {
        if self.freed.is_empty() {
            return self.plan.violated(x);
        }
        let t = self.plan.duration(x);
        let broken = |r: &&crate::plan::spline::Row| {
            // Negated so that NaN counts as broken.
            let fine = r.slack(x, t) >= -ROUNDING;
            !self.is_freed(r.joint, r.power) && !fine
        };
        if let Some(r) = self.plan.rows.iter().find(broken) {
            return Some(r.which(-r.slack(x, t) * r.scale));
        }
        match self.plan.spec().duration {
            Duration::Free { min, max } if !(min..=max).contains(&t) => self.plan.violated(x),
            _ if t.is_nan() => self.plan.violated(x),
            _ => None,
        }
    }
    /// Limits of a joint, for messages.
    pub(crate) fn limits(&self, joint: usize) -> &JointLimits {
        &self.plan.spec().limits[joint]
    }
}

/// The largest number, NaN if there is one.
pub(crate) fn largest(rows: &[f64]) -> f64 {
    rows.iter().fold(f64::NEG_INFINITY, |m, r| if r.is_nan() || m.is_nan() { f64::NAN } else { m.max(*r) })
}
