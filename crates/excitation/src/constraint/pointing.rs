//! Pointing cones: an axis of the base against an inertial direction.

use super::base::{History, Turning, direction};
use super::held::HeldSystem;
use super::windows::Signal;
use super::{Channel, ConstraintError, Sense, Snapshot, check_limit};
use ff_model::so3::quat_to_rot;
use nalgebra::{DMatrix, Vector3};
use std::ops::Range;
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
    system: Arc<HeldSystem>,
    axis: Vector3<f64>,
    target: Vector3<f64>,
    channel: [Channel; 1],
}

impl Pointing {
    /// `axis` in base axes, `target` in world axes (those of the base at the start), of any length. Allocates.
    ///
    /// # Errors
    /// [`ConstraintError`] for a vector of length zero or an angle that is not positive.
    pub fn new(
        system: &Arc<HeldSystem>,
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
        Ok(Self { system: system.clone(), axis: axis.normalize(), target: target.normalize(), channel })
    }
    /// Angle between a world vector and the target; stable near 0 and pi.
    fn angle(&self, v: &Vector3<f64>) -> f64 {
        v.cross(&self.target).norm().atan2(v.dot(&self.target))
    }
}

impl Signal for Pointing {
    type Work = History;
    fn channels(&self) -> &[Channel] {
        &self.channel
    }
    fn drives(&self) -> usize {
        3
    }
    fn work(&self) -> Self::Work {
        History::new(&self.system)
    }
    fn drive(&self, w: &mut Self::Work, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>) {
        w.rates(&self.system, s, u, partials);
    }
    fn respond(&self, w: &mut Self::Work, dt: f64, u: &DMatrix<f64>, y: &mut DMatrix<f64>) {
        w.turning = Turning::new(dt, u);
        for (k, r) in w.turning.attitude.iter().enumerate() {
            y[(0, k)] = self.angle(&(r * self.axis));
        }
    }
    fn reaches_back(&self) -> bool {
        true
    }
    fn adjoint(
        &self,
        w: &Self::Work,
        u: &DMatrix<f64>,
        _channel: usize,
        window: Range<usize>,
        weights: &[f64],
        over_u: &mut DMatrix<f64>,
    ) -> f64 {
        let (t, start) = (&w.turning, window.start);
        // Turning by dphi moves the axis by dphi x v: the angle to the target grows by dphi . (target x v) / |..|.
        let over = |k: usize| direction(&self.target.cross(&(t.attitude[k] * self.axis))) * weights[k - start];
        t.adjoint(u, window, over, over_u)
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        out[0] = self.angle(&(quat_to_rot(&at.att) * self.axis));
    }
}
