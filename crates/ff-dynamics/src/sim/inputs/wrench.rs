//! Thrusters, given wrenches, and forces on passive coordinates.

use super::{ExternalInput, InputError, Loads, Scene, Signal};
use ff_model::{Force, Model};
use nalgebra::Vector3;

/// A thruster: a force along a direction that is fixed in a body, at a point of it.
///
/// `f = F(t) d`, `n = r x f`. The mass it expels is neglected; estimate or set the mass for the time in question.
#[derive(Clone, Debug, PartialEq)]
pub struct Thruster {
    body: usize,
    point: Vector3<f64>,
    direction: Vector3<f64>,
    thrust: Signal<1>,
}

impl Thruster {
    /// A thruster of `body` at `point` (m) that pushes the body along `direction` (any length), both in the body frame,
    /// with `thrust` (N).
    ///
    /// # Errors
    /// [`InputError`] for numbers that are not finite, a direction without length, and negative thrust: a thruster cannot
    /// pull.
    pub fn new(
        body: usize,
        point: Vector3<f64>,
        direction: Vector3<f64>,
        thrust: Signal<1>,
    ) -> Result<Self, InputError> {
        point.iter().try_for_each(|x| InputError::finite("a coordinate of the thruster", *x, "m"))?;
        direction.iter().try_for_each(|x| InputError::finite("a component of the direction", *x, ""))?;
        let length = direction.norm();
        InputError::positive("the length of the direction", length, "")?;
        let least = thrust.least();
        if least < 0.0 {
            let need = "not negative; turn the direction around";
            return Err(InputError::Value { what: "thrust", value: least, unit: "N", need });
        }
        Ok(Self { body, point, direction: direction / length, thrust })
    }
}

impl ExternalInput for Thruster {
    fn act(&self, t: f64, _: &Scene<'_>, on: &mut Loads) {
        let f = self.direction * self.thrust.at(t)[0];
        on.add(self.body, Force::new(f, self.point.cross(&f)));
    }
    fn breaks(&self) -> Vec<f64> {
        self.thrust.breaks()
    }
    fn check(&self, model: &Model) -> Result<(), InputError> {
        InputError::body(self.body, model)
    }
}

/// Axes in which an [`AppliedWrench`] is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// Those of the body.
    Body,
    /// Those of the world: the wrench keeps its direction while the body turns.
    World,
}

/// A given wrench over time on a body, about its origin.
#[derive(Clone, Debug, PartialEq)]
pub struct AppliedWrench {
    /// The body.
    pub body: usize,
    /// The axes of `wrench`.
    pub axes: Axes,
    /// Force (N) and moment (N m) about the origin of the body.
    pub wrench: Signal<6>,
}

impl ExternalInput for AppliedWrench {
    fn act(&self, t: f64, scene: &Scene<'_>, on: &mut Loads) {
        let w = Force::from_slice(&self.wrench.at(t));
        let w = match self.axes {
            Axes::Body => w,
            Axes::World => {
                let r = &scene.pose(self.body).rot;
                Force::new(r.tr_mul(&w.lin), r.tr_mul(&w.ang))
            }
        };
        on.add(self.body, w);
    }
    fn breaks(&self) -> Vec<f64> {
        self.wrench.breaks()
    }
    fn check(&self, model: &Model) -> Result<(), InputError> {
        InputError::body(self.body, model)
    }
}

/// A force on a passive coordinate, between the appendage and its host: the motor of a reaction wheel, for instance.
///
/// It does work but changes no momentum.
#[derive(Clone, Debug, PartialEq)]
pub struct PassiveForce {
    /// Index of the passive coordinate.
    pub coordinate: usize,
    /// Force (N) or torque (N m).
    pub force: Signal<1>,
}

impl ExternalInput for PassiveForce {
    fn act(&self, t: f64, _: &Scene<'_>, on: &mut Loads) {
        on.add_passive(self.coordinate, self.force.at(t)[0]);
    }
    fn breaks(&self) -> Vec<f64> {
        self.force.breaks()
    }
    fn check(&self, model: &Model) -> Result<(), InputError> {
        let (got, count) = (self.coordinate, model.np());
        if got < count { Ok(()) } else { Err(InputError::Coordinate { got, count }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thrusters_that_make_no_sense_are_refused() {
        let v = Vector3::new(0.3, -0.7, 1.1);
        let on = |x: f64| Signal::constant([x]).unwrap();
        let e = Thruster::new(0, v, v, on(-2.0)).unwrap_err();
        assert_eq!(e.to_string(), "thrust is -2 N, but must be not negative; turn the direction around");
        assert!(matches!(Thruster::new(0, v, v * 0.0, on(1.0)), Err(InputError::Value { value: 0.0, .. })));
        assert!(Thruster::new(0, v * f64::NAN, v, on(1.0)).is_err());
        assert!(Thruster::new(0, v, v * f64::INFINITY, on(1.0)).is_err());
    }
}
