//! Pointing cones: an axis of the base against an inertial direction.

use super::base::{History, Rates, direction, driven_by_rates};
use super::held::HeldSystem;
use super::signal::Signal;
use super::{Channel, ConstraintError, Sense, Snapshot, check_limit};
use ff_model::spatial::so3::quat_to_rot;
use nalgebra::{DMatrix, Vector3};
use std::sync::Arc;

/// Where the axis may point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cone {
    /// Within this angle of the direction (rad): an antenna on the Earth.
    Within(f64),
    /// Outside this angle of the direction (rad): a star tracker and the Sun.
    Outside(f64),
}

/// Angle between an axis of the base and an inertial direction, `acos(R axis . direction)`.
#[derive(Clone, Debug)]
pub struct Pointing {
    rates: Rates,
    axis: Vector3<f64>,
    target: Vector3<f64>,
    channel: [Channel; 1],
}

impl Pointing {
    /// `axis` in base axes, `target` in world axes (those of the base at the start), of any length; appendages
    /// linearised about joint positions `q`. Allocates.
    ///
    /// # Errors
    /// [`ConstraintError`] for a vector of length zero or an angle that is not positive.
    pub fn new(
        system: &Arc<HeldSystem>,
        q: &[f64],
        item: &str,
        axis: &Vector3<f64>,
        target: &Vector3<f64>,
        cone: Cone,
    ) -> Result<Self, ConstraintError> {
        for (what, v) in [("the axis that points", axis), ("the direction pointed at", target)] {
            let fine = v.norm().is_finite() && v.norm() > 0.0;
            if !fine {
                return Err(ConstraintError::Direction { what });
            }
        }
        let (limit, sense) = match cone {
            Cone::Within(a) => (a, Sense::AtMost),
            Cone::Outside(a) => (a, Sense::AtLeast),
        };
        check_limit("pointing angle", limit, "rad")?;
        let channel = [Channel { sense, ..Channel::at_most("pointing angle", item, "rad", limit) }];
        Ok(Self { rates: Rates::new(system, q)?, axis: axis.normalize(), target: target.normalize(), channel })
    }
    /// Angle between a world vector and the target; stable near 0 and pi.
    fn angle(&self, v: &Vector3<f64>) -> f64 {
        v.cross(&self.target).norm().atan2(v.dot(&self.target))
    }
}

impl Signal for Pointing {
    driven_by_rates!();
    fn respond(&self, w: &mut History, dt: f64, u: &DMatrix<f64>, y: &mut DMatrix<f64>) {
        self.rates.turn(w, dt, u);
        for (k, r) in w.turning.attitude.iter().enumerate() {
            y[(0, k)] = self.angle(&(r * self.axis));
        }
    }
    fn adjoint(&self, w: &History, u: &DMatrix<f64>, _channel: usize, i: usize, over_u: &mut DMatrix<f64>) -> f64 {
        // Turning by dphi moves the axis by dphi x v: the angle to the target grows by dphi . (target x v) / |..|.
        let turn = direction(&self.target.cross(&(w.turning.attitude[i] * self.axis)));
        self.rates.adjoint_of_turn(w, u, i, &turn, over_u)
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        out[0] = self.angle(&(quat_to_rot(&at.att) * self.axis));
    }
}
