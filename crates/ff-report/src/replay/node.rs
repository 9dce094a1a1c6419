//! A frame of a robot, and what is drawn on it.

use ff_model::Xform;
use ff_model::spatial::so3::rot_to_quat;
use serde::Serialize;

/// A frame that moves against its parent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Node {
    /// Name of the body, the appendage or its link.
    pub name: String,
    /// Index of the parent; absent for the base.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parent: Option<usize>,
    /// Pose in the frame of the parent at coordinate zero.
    pub place: Pose,
    /// How it moves; absent where it is fixed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moves: Option<Moves>,
    /// What is drawn.
    pub shapes: Vec<Drawn>,
    /// Mass (kg); absent for a massless frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<f64>,
}

/// A pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pose {
    /// Position (m).
    pub p: [f64; 3],
    /// Unit quaternion `[x, y, z, w]`, as WebGL libraries have it.
    pub r: [f64; 4],
}

impl From<&Xform<f64>> for Pose {
    fn from(x: &Xform<f64>) -> Self {
        let q = rot_to_quat(&x.rot);
        Self { p: x.pos.into(), r: [q[1], q[2], q[3], q[0]] }
    }
}

/// How a node moves against its parent. Coordinates count the joints first, then the passive ones.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Moves {
    /// By an angle about an axis.
    Turn {
        /// Unit axis in the frame of the node.
        axis: [f64; 3],
        /// Index of the coordinate (rad, or m of a joint that follows one that slides).
        by: usize,
        /// Multiplier and offset where the joint follows that of the coordinate; absent where it is that joint.
        #[serde(skip_serializing_if = "Option::is_none")]
        follows: Option<[f64; 2]>,
    },
    /// Along an axis.
    Slide {
        /// Unit axis in the frame of the node.
        axis: [f64; 3],
        /// Index of the coordinate (m, or rad of a joint that follows one that turns).
        by: usize,
        /// Multiplier and offset where the joint follows that of the coordinate; absent where it is that joint.
        #[serde(skip_serializing_if = "Option::is_none")]
        follows: Option<[f64; 2]>,
    },
    /// By shifts and rotation vectors that add up.
    Sway {
        /// Index of the first coordinate.
        first: usize,
        /// Shift per unit of each coordinate in the frame of the node (m).
        shift: Vec<[f64; 3]>,
        /// Rotation vector per unit of each coordinate (rad).
        turn: Vec<[f64; 3]>,
    },
}

/// A shape on a node.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drawn {
    /// What it stands for.
    pub role: Role,
    /// Pose in the frame of the node; the shape is about its origin.
    pub place: Pose,
    /// What it is.
    #[serde(flatten)]
    pub form: Form,
}

/// What a shape stands for; the page has a colour for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Surface of a link as its URDF has it.
    Link,
    /// Box of even density that has mass, centre of mass and inertia of a body; of a point mass, a ball of water.
    Inertia,
    /// From a joint to the next.
    Rod,
    /// Segment of a flexible structure.
    Panel,
    /// A mass that swings or slides.
    Fuel,
    /// A torque sensor and encoder: the axis of a joint.
    Joint,
    /// The gyro: axes of the base frame.
    Gyro,
    /// Where an appendage is mounted.
    Mount,
}

/// Geometry of a shape, about its origin.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "form", rename_all = "lowercase")]
pub enum Form {
    /// A box with these edges (m).
    Box {
        /// Edges (m).
        size: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// Radius (m).
        radius: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius (m).
        radius: f64,
        /// Length (m).
        length: f64,
    },
    /// Three axes.
    Axes {
        /// Their length (m).
        size: f64,
    },
    /// A mesh of the replay.
    Mesh {
        /// Its index.
        mesh: usize,
        /// Factors along its axes.
        scale: [f64; 3],
    },
}
