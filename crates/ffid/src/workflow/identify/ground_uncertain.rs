//! What the mission is not sure of, in the calibration on the ground: considered, not estimated.
//!
//! The estimate `x` of the calibration is linear in the torques, and the equations hold robot and sensors as the mission has them. In a world in
//! which something is off by one of its deviations s, the same records lead to another estimate; with errors that are independent of one
//! another and of the noise
//!
//! ```text
//! P_c = P + sum_c d_c d_c^T,     d_c = x(c = s_c) - x(c = 0)
//! ```
//!
//! which to first order is the consider covariance of [`ident::belief::consider`], `d_c = S_c s_c`. Each `d_c` is a calibration of its own: torques
//! divided by their gain, joints and their zeros displaced, links that are not estimated heavier.

use super::error::IdentifyError;
use super::ground::{calibration, linear};
use super::result::uncertain::{BudgetLine, UncertainLine, considered_budget};
use super::uncertain::{UncertainItems, UncertainKind, UncertainUnknown};
use ff_model::{Kinematics, Model, ParamDecl};
use ff_records::Record;
use ident::GroundEstimate;
use ident::compose::TieMap;
use ident::estimate::JointTerm;
use ident::solve::Weights;
use nalgebra::{DMatrix, DVector};

/// How a calibration is set up, whatever the model.
pub(super) struct SetUp<'a> {
    pub(super) low_pass_hz: Option<f64>,
    /// Parameters that are zero in each record.
    pub(super) absent: &'a [Vec<usize>],
    /// Place among the selected, mean, standard deviation.
    pub(super) prior: &'a [(usize, f64, f64)],
    /// Friction and the like of every joint.
    pub(super) terms: &'a [Vec<JointTerm>],
    /// Standard deviation of every joint's residual (N m; A where its current was measured), what is correlated allowed for.
    pub(super) sigma: &'a [f64],
}

/// A calibration: how, of what, from where.
pub(super) struct Calibration<'a> {
    pub(super) model: &'a Model,
    pub(super) set_up: SetUp<'a>,
    pub(super) records: &'a [&'a Record],
    pub(super) selected: &'a [usize],
    pub(super) start: &'a [f64],
}

/// What was considered.
#[derive(Default)]
pub(super) struct Considered {
    pub(super) lines: Vec<UncertainLine>,
    pub(super) budget: Vec<BudgetLine>,
}

impl Calibration<'_> {
    /// Of this model, from these records and values.
    pub(super) fn run(
        &self,
        model: &Model,
        records: &[&Record],
        start: &[f64],
    ) -> Result<GroundEstimate, IdentifyError> {
        let s = &self.set_up;
        let ground = calibration(model, s.low_pass_hz)?.absent(s.absent.to_vec()).priors(s.prior.to_vec());
        let ground = ground.terms(s.terms.to_vec()).weights(Weights::Given(s.sigma.to_vec()));
        ground.estimate(records, self.selected, start).map_err(linear)
    }
    /// The estimate in a world in which `u` is off by one deviation.
    fn off(&self, u: &UncertainUnknown, map: &TieMap) -> Result<GroundEstimate, IdentifyError> {
        let model = self.model;
        match u.kind {
            UncertainKind::TorqueGains => {
                let joints = model.joint_names();
                let gained =
                    |j: usize| u.name == "torque.gain" || u.name.strip_prefix("torque.gain.") == Some(&joints[j]);
                let scaled = |r: &&Record| {
                    let mut tau = r.tau().clone();
                    for j in (0..joints.len()).filter(|&j| gained(j)) {
                        tau.column_mut(j).unscale_mut(1.0 + u.std);
                    }
                    (*r).clone().with_tau(tau)
                };
                let records: Vec<Record> = self.records.iter().map(scaled).collect();
                self.run(model, &records.iter().collect::<Vec<_>>(), self.start)
            }
            kind if kind.is_shared() => {
                let mut by = vec![0.0; model.n_kinematic_params()];
                if let Some(i) = model.kinematic_index(&u.name) {
                    by[i] = u.std;
                }
                let displaced = model.displaced(&Kinematics::from_values(model, by));
                self.run(&displaced, self.records, self.start)
            }
            _ => {
                let mut short = map.start();
                if let Some(i) = map.decls().iter().position(|d| d.name == u.name) {
                    short[i] = u.mean + u.std;
                }
                let start = map.expand(&short).map_err(|e| IdentifyError::Model(e.to_string()))?;
                self.run(model, self.records, &start)
            }
        }
    }
    /// Widens the deviations of `found` by how far these records, in which something is off by one of its deviations, lead.
    pub(super) fn widen(&self, off: &[&Record], found: &mut GroundEstimate) -> Result<(), IdentifyError> {
        let there = self.run(self.model, off, self.start)?;
        let by = DVector::from_vec(values(&there)) - DVector::from_vec(values(found));
        found.fit.uncertainty.covariance += &by * by.transpose();
        restate(found);
        Ok(())
    }
    /// Widens the deviations of `found` by what the mission is not sure of.
    pub(super) fn consider(
        &self,
        items: &UncertainItems,
        found: &mut GroundEstimate,
    ) -> Result<Considered, IdentifyError> {
        // There is no gyro on the ground.
        let matters =
            |u: &&UncertainUnknown| !matches!(u.kind, UncertainKind::GyroScale | UncertainKind::GyroAlignment);
        let unknowns: Vec<&UncertainUnknown> = items.unknowns.iter().filter(matters).collect();
        if unknowns.is_empty() {
            return Ok(Considered::default());
        }
        let decls = self.model.param_decls();
        let ties = items.ties(self.start)?;
        let map = TieMap::new(&decls, self.start, ties).map_err(|e| IdentifyError::Model(e.to_string()))?;
        let (here, n) = (values(found), found.fit.uncertainty.unknowns.len());
        let mut moved = DMatrix::zeros(n, unknowns.len());
        let mut of_base = vec![0.0; found.fit.base.len()];
        for (c, u) in unknowns.iter().enumerate() {
            let there = self.off(u, &map)?;
            for (k, (a, b)) in values(&there).iter().zip(&here).enumerate() {
                moved[(k, c)] = a - b;
            }
            // Combinations that are determined in both worlds have the same parameters before them.
            for (k, b) in found.fit.base.iter().enumerate() {
                let value = |e: &GroundEstimate| -> f64 {
                    let one = |name: &String| {
                        let all = e.fit.parameters.iter().chain(&e.fit.extra);
                        all.filter(|p| p.name == *name).map(|p| p.value).sum::<f64>()
                    };
                    b.terms.iter().map(|(name, w)| w * one(name)).sum()
                };
                of_base[k] += (value(&there) - value(found)).powi(2);
            }
        }
        found.fit.uncertainty.covariance += &moved * moved.transpose();
        restate(found);
        found.fit.base.iter_mut().zip(&of_base).for_each(|(b, more)| b.std = b.std.hypot(more.sqrt()));
        let asked: Vec<(usize, &ParamDecl)> = self.selected.iter().enumerate().map(|(k, &i)| (k, &decls[i])).collect();
        let kinds: Vec<(UncertainKind, f64)> = unknowns.iter().map(|u| (u.kind, u.std)).collect();
        for (c, u) in unknowns.iter().enumerate() {
            moved.column_mut(c).unscale_mut(u.std);
        }
        let budget = considered_budget(&asked, &kinds, &found.fit.uncertainty, &moved);
        let line = |u: &&UncertainUnknown| UncertainLine {
            name: u.name.clone(),
            unit: u.unit.to_owned(),
            kind: u.kind,
            prior_mean: u.mean,
            prior_std: u.std,
            value: u.mean,
            std: Some(u.std),
        };
        Ok(Considered { lines: unknowns.iter().map(line).collect(), budget })
    }
}

/// Values of all unknowns.
fn values(e: &GroundEstimate) -> Vec<f64> {
    e.fit.parameters.iter().chain(&e.fit.extra).map(|p| p.value).collect()
}

/// Deviations as the covariance has them.
fn restate(found: &mut GroundEstimate) {
    let u = &mut found.fit.uncertainty;
    for (k, std) in u.deviation.iter_mut().enumerate() {
        *std = std.map(|_| u.covariance[(k, k)].max(0.0).sqrt());
    }
    let stds = u.deviation.clone();
    let all = found.fit.parameters.iter_mut().chain(&mut found.fit.extra);
    all.zip(&stds).for_each(|(p, std)| p.std = *std);
}
