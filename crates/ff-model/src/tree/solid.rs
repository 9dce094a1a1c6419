//! Solids on bodies, for distances between them. They have no part in the dynamics and are no part of a
//! [`Model`](crate::Model).

use crate::Xform;

/// A convex shape about the origin of its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Radius (m).
        radius: f64,
    },
    /// A box.
    Box {
        /// Edge lengths (m).
        size: [f64; 3],
    },
    /// A circular cylinder along z.
    Cylinder {
        /// Radius (m).
        radius: f64,
        /// Length (m).
        length: f64,
    },
    /// A cylinder along z with half balls at its ends.
    Capsule {
        /// Radius (m).
        radius: f64,
        /// Length between the centres of the half balls (m).
        length: f64,
    },
}

impl Shape {
    /// The numbers that must be positive. Allocates.
    pub fn sizes(&self) -> Vec<f64> {
        match *self {
            Self::Sphere { radius } => vec![radius],
            Self::Box { size } => size.to_vec(),
            Self::Cylinder { radius, length } | Self::Capsule { radius, length } => vec![radius, length],
        }
    }
}

/// A shape on a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// Name: that of the link, `link#1` from its second `<collision>` on, or `link/name` when that has one.
    pub name: String,
    /// The body that carries it, 0 for the base.
    pub body: usize,
    /// Pose in the body frame.
    pub placement: Xform<f64>,
    /// Its shape.
    pub shape: Shape,
}
