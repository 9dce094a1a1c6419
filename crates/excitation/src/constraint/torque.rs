//! Joint torque limits.

use super::held::{HeldPartials, HeldSystem, HeldWork};
use super::windows::Signal;
use super::{Channel, ConstraintError, Snapshot, check_limit};
use nalgebra::DMatrix;
use std::sync::Arc;

/// `|tau_j| <= limit_j` (N m or N), one channel per joint with a finite limit.
///
/// In the search the torques are those of [`HeldSystem`]; measured are those of the full simulation.
#[derive(Clone, Debug)]
pub struct JointTorque {
    system: Arc<HeldSystem>,
    joints: Vec<usize>,
    channels: Vec<Channel>,
}

impl JointTorque {
    /// One limit per joint, `inf` for none. Allocates.
    ///
    /// # Errors
    /// [`ConstraintError`] for a wrong number of limits or one that is not positive.
    pub fn new(system: &Arc<HeldSystem>, limits: &[f64]) -> Result<Self, ConstraintError> {
        let names = system.model().joint_names();
        if limits.len() != names.len() {
            return Err(ConstraintError::Count { what: "joint torque", got: limits.len(), want: names.len() });
        }
        let (mut joints, mut channels) = (Vec::new(), Vec::new());
        for (j, (&limit, name)) in limits.iter().zip(names).enumerate() {
            let prismatic = system.model().bodies()[j].joint.kind == ff_model::JointKind::Prismatic;
            let unit = if prismatic { "N" } else { "N m" };
            if limit != f64::INFINITY {
                check_limit(&format!("torque of joint {name}"), limit, unit)?;
                joints.push(j);
                channels.push(Channel::at_most("joint torque", name, unit, limit));
            }
        }
        Ok(Self { system: system.clone(), joints, channels })
    }
    /// The effort limits of the URDF. Allocates.
    ///
    /// # Errors
    /// As [`JointTorque::new`].
    pub fn from_model(system: &Arc<HeldSystem>) -> Result<Self, ConstraintError> {
        let limits: Vec<f64> = system.model().bodies().iter().map(|b| b.joint.limits.effort).collect();
        Self::new(system, &limits)
    }
}

impl Signal for JointTorque {
    type Work = (HeldWork, HeldPartials);
    fn channels(&self) -> &[Channel] {
        &self.channels
    }
    fn work(&self) -> Self::Work {
        (self.system.work(), self.system.partials())
    }
    fn drive(&self, (w, d): &mut Self::Work, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>) {
        match partials {
            None => drop(self.system.evaluate(w, s)),
            Some(out) => {
                self.system.differentiate(w, s, d);
                for (c, &j) in self.joints.iter().enumerate() {
                    let sign = w.tau[j].signum();
                    (0..out.ncols()).for_each(|k| out[(c, k)] = sign * d.force[(j, k)]);
                }
            }
        }
        self.joints.iter().zip(u).for_each(|(&j, u)| *u = w.tau[j].abs());
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        self.joints.iter().zip(out).for_each(|(&j, o)| *o = at.tau[j].abs());
    }
}
