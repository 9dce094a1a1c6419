//! Panel deflection and slosh angle.

use super::held::{HeldPartials, HeldSystem, HeldWork};
use super::ringing::{Ringing, Rung};
use super::signal::Signal;
use super::{Channel, ConstraintError, Snapshot, check_limit};
use nalgebra::DMatrix;
use std::sync::Arc;

/// `|eta_k - rest_k| <= limit_k`, one channel per limited passive coordinate.
///
/// In the search these are the linear response of the appendages; measured is the full simulation.
#[derive(Clone, Debug)]
pub struct PassiveRange {
    system: Arc<HeldSystem>,
    coords: Vec<usize>,
    channels: Vec<Channel>,
    ringing: Ringing,
}

/// Buffers of [`PassiveRange`].
#[derive(Clone, Debug)]
pub struct PassiveWork {
    held: HeldWork,
    partials: HeldPartials,
    rung: Rung,
}

impl PassiveRange {
    /// One limit per passive coordinate in its unit, `inf` for none; linear response about joint positions `q`.
    /// Allocates.
    ///
    /// # Errors
    /// [`ConstraintError`]: a wrong number of limits or joint positions, a limit that is not positive, a singular mass
    /// matrix.
    pub fn new(system: &Arc<HeldSystem>, q: &[f64], limits: &[f64]) -> Result<Self, ConstraintError> {
        let declared = system.model().passive_coords();
        if limits.len() != declared.len() {
            let what = "passive coordinates";
            return Err(ConstraintError::Count { what, got: limits.len(), want: declared.len() });
        }
        let (mut coords, mut channels) = (Vec::new(), Vec::new());
        for (k, (&limit, (name, decl))) in limits.iter().zip(&declared).enumerate() {
            if limit != f64::INFINITY {
                check_limit(name, limit, decl.unit)?;
                coords.push(k);
                channels.push(Channel::at_most("deflection", name.as_str(), decl.unit, limit));
            }
        }
        let ringing = Ringing::new(system, q)?;
        Ok(Self { system: system.clone(), coords, channels, ringing })
    }
    /// The same limit for every coordinate that has the unit `unit` (`rad` for hinges and pendulums). Allocates.
    ///
    /// # Errors
    /// As [`PassiveRange::new`].
    pub fn all(system: &Arc<HeldSystem>, q: &[f64], unit: &str, limit: f64) -> Result<Self, ConstraintError> {
        let of = |u: &str| if u == unit { limit } else { f64::INFINITY };
        let limits: Vec<f64> = system.model().passive_coords().iter().map(|(_, d)| of(d.unit)).collect();
        Self::new(system, q, &limits)
    }
}

impl Signal for PassiveRange {
    type Work = PassiveWork;
    fn channels(&self) -> &[Channel] {
        &self.channels
    }
    fn rate(&self) -> f64 {
        self.ringing.rate
    }
    fn drives(&self) -> usize {
        self.ringing.count()
    }
    fn work(&self) -> PassiveWork {
        PassiveWork { held: self.system.work(), partials: self.system.partials(), rung: Rung::default() }
    }
    fn drive(&self, w: &mut PassiveWork, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>) {
        match partials {
            None => drop(self.system.evaluate(&mut w.held, s)),
            Some(out) => {
                self.system.differentiate(&mut w.held, s, &mut w.partials);
                let (n, m) = (self.system.model().nj(), self.system.model().np());
                out.copy_from(&w.partials.force.rows(n, m));
            }
        }
        u.copy_from_slice(&w.held.hold);
    }
    fn respond(&self, w: &mut PassiveWork, dt: f64, u: &DMatrix<f64>, y: &mut DMatrix<f64>) {
        w.rung = self.ringing.respond(dt, u, 0);
        for (c, &coord) in self.coords.iter().enumerate() {
            (0..u.ncols()).for_each(|k| y[(c, k)] = w.rung.z[k][coord].abs());
        }
    }
    fn reaches_back(&self) -> bool {
        true
    }
    fn adjoint(&self, w: &PassiveWork, _u: &DMatrix<f64>, channel: usize, i: usize, over_u: &mut DMatrix<f64>) -> f64 {
        let coord = self.coords[channel];
        let sign = w.rung.z[i][coord].signum();
        let over = |k: usize, l: &mut nalgebra::DVector<f64>| {
            if k == i {
                l[coord] += sign;
            }
        };
        self.ringing.adjoint(&w.rung, 0, i, over, over_u)
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        let rest = self.system.rest();
        self.coords.iter().zip(out).for_each(|(&k, o)| *o = (at.eta[k] - rest[k]).abs());
    }
}
