//! Joint torque limits.

use super::held::{HeldPartials, HeldSystem, HeldWork};
use super::ringing::{Ringing, Rung};
use super::signal::Signal;
use super::{Channel, ConstraintError, Snapshot, check_limit};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// `|tau_j| <= limit_j` (N m or N), one channel per joint with a finite limit.
///
/// In the search the torques are those with the appendages held, exact, and the linear response of the appendages;
/// measured are those of the full simulation.
#[derive(Clone, Debug)]
pub struct JointTorque {
    system: Arc<HeldSystem>,
    joints: Vec<usize>,
    channels: Vec<Channel>,
    ringing: Ringing,
}

/// Buffers of [`JointTorque`].
#[derive(Clone, Debug)]
pub struct TorqueWork {
    held: HeldWork,
    partials: HeldPartials,
    rung: Rung,
    /// Signs of the torques of the last response, `n x N`.
    sign: DMatrix<f64>,
    /// Accelerations of the passive coordinates, per sample.
    ringing: Vec<DVector<f64>>,
}

/// Drive that holds `B_(j,p)`.
fn port(n: usize, m: usize, p: usize, j: usize) -> usize {
    n + m + p * (6 + n) + 6 + j
}

impl JointTorque {
    /// One limit per joint, `inf` for none; appendages linearised about joint positions `q`. Allocates.
    ///
    /// # Errors
    /// [`ConstraintError`] for a wrong number of limits or joint positions, or a limit that is not positive.
    pub fn new(system: &Arc<HeldSystem>, q: &[f64], limits: &[f64]) -> Result<Self, ConstraintError> {
        let names = system.model().joint_names();
        if limits.len() != names.len() {
            return Err(ConstraintError::Count { what: "joint torque", got: limits.len(), want: names.len() });
        }
        let (mut joints, mut channels) = (Vec::new(), Vec::new());
        for (j, (&limit, name)) in limits.iter().zip(names).enumerate() {
            let prismatic = system.model().own_body(j).joint.kind == ff_model::JointKind::Prismatic;
            let unit = if prismatic { "N" } else { "N m" };
            if limit != f64::INFINITY {
                check_limit(&format!("torque of joint {name}"), limit, unit)?;
                joints.push(j);
                channels.push(Channel::at_most("joint torque", name, unit, limit));
            }
        }
        let ringing = Ringing::new(system, q)?;
        Ok(Self { system: system.clone(), joints, channels, ringing })
    }
    /// The effort limits of the URDF. Allocates.
    ///
    /// # Errors
    /// As [`JointTorque::new`].
    pub fn from_model(system: &Arc<HeldSystem>, q: &[f64]) -> Result<Self, ConstraintError> {
        let limits: Vec<f64> = system.model().own_bodies().map(|b| b.joint.limits.effort).collect();
        Self::new(system, q, &limits)
    }
}

impl Signal for JointTorque {
    type Work = TorqueWork;
    fn channels(&self) -> &[Channel] {
        &self.channels
    }
    fn rate(&self) -> f64 {
        self.ringing.rate
    }
    fn drives(&self) -> usize {
        let (n, m) = (self.system.model().nj(), self.ringing.count());
        n + m + (6 + n) * m
    }
    fn work(&self) -> TorqueWork {
        let (held, partials) = (self.system.work(), self.system.partials());
        TorqueWork { held, partials, rung: Rung::default(), sign: DMatrix::zeros(0, 0), ringing: Vec::new() }
    }
    fn drive(&self, w: &mut TorqueWork, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>) {
        let (n, m) = (self.system.model().nj(), self.ringing.count());
        match partials {
            None => drop(self.system.evaluate(&mut w.held, s)),
            Some(out) => {
                self.system.differentiate(&mut w.held, s, &mut w.partials);
                out.rows_mut(0, n + m).copy_from(&w.partials.force);
                let mut ports = DMatrix::zeros(u.len() - n - m, n);
                self.system.ports(&mut w.held, &mut u[n + m..], Some(&mut ports));
                out.view_mut((n + m, 0), ports.shape()).copy_from(&ports);
                u[..n].copy_from_slice(&w.held.tau);
                u[n..n + m].copy_from_slice(&w.held.hold);
                return;
            }
        }
        u[..n].copy_from_slice(&w.held.tau);
        u[n..n + m].copy_from_slice(&w.held.hold);
        self.system.ports(&mut w.held, &mut u[n + m..], None);
    }
    fn respond(&self, w: &mut TorqueWork, dt: f64, u: &DMatrix<f64>, y: &mut DMatrix<f64>) {
        let (n, m) = (self.system.model().nj(), self.ringing.count());
        w.rung = self.ringing.respond(dt, u, n);
        w.sign = DMatrix::zeros(n, u.ncols());
        w.ringing.clear();
        for k in 0..u.ncols() {
            let e: DVector<f64> = u.view((n, k), (m, 1)).column(0).into_owned();
            let acceleration = self.ringing.acceleration(&w.rung, &e, k);
            for (c, &j) in self.joints.iter().enumerate() {
                let more: f64 = (0..m).map(|p| u[(port(n, m, p, j), k)] * acceleration[p]).sum();
                let tau = u[(j, k)] + more;
                w.sign[(j, k)] = tau.signum();
                y[(c, k)] = tau.abs();
            }
            w.ringing.push(acceleration);
        }
    }
    fn reaches_back(&self) -> bool {
        true
    }
    fn adjoint(&self, w: &TorqueWork, u: &DMatrix<f64>, channel: usize, i: usize, over_u: &mut DMatrix<f64>) -> f64 {
        let (n, m, j) = (self.system.model().nj(), self.ringing.count(), self.joints[channel]);
        let sign = w.sign[(j, i)];
        over_u[(j, i)] = sign;
        (0..m).for_each(|p| over_u[(port(n, m, p, j), i)] = sign * w.ringing[i][p]);
        let over = DVector::from_fn(m, |p, _| sign * u[(port(n, m, p, j), i)]);
        let (over_z, over_e) = self.ringing.over_acceleration(&over);
        let mut here = over_u.view_mut((n, i), (over_e.len(), 1));
        here += over_e;
        let add = |k: usize, l: &mut DVector<f64>| {
            if k == i {
                *l += &over_z;
            }
        };
        self.ringing.adjoint(&w.rung, n, i, add, over_u)
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        self.joints.iter().zip(out).for_each(|(&j, o)| *o = at.tau[j].abs());
    }
}
