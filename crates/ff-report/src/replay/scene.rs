//! A robot as a tree of nodes with shapes.

use super::appearance::Appearance;
use super::mass::{Ellipsoids, Knowledge};
use super::motion::Motion;
use super::{appendage, mass};
use ff_dynamics::{Boundary, Trace, modes};
use ff_model::spatial::so3::rot_to_quat;
use ff_model::tree::Shape;
use ff_model::{Inertia, JointKind, Model, Params, Xform};
use ffid::open::MAX_DENSE;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use std::f64::consts::PI;

/// Density that gives the size of a ball for a point mass: that of water (kg/m^3).
const WATER: f64 = 1000.0;
/// Products of inertia below this share of the trace do not turn a box.
const ALIGNED: f64 = 0.02;
/// Modes below this share of the highest frequency are motions without a spring, such as the spin of a wheel.
const SPRINGLESS: f64 = 1e-6;
/// Thinnest edge of a box relative to its longest.
const THINNEST: f64 = 0.02;
/// Diameter of the rods between joints relative to their length, and its greatest value (m).
const ROD: (f64, f64) = (0.12, 0.06);

/// One robot of a replay.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scene {
    /// What it is: `identified`, `prior`.
    pub label: String,
    /// Parents before children; node 0 is the base.
    pub nodes: Vec<Node>,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Names of the passive coordinates.
    pub coordinates: Vec<String>,
    /// Joint positions without a motion, and of the modes (rad or m).
    pub pose: Vec<f64>,
    /// Passive coordinates at which the springs are relaxed (rad or m).
    pub rest: Vec<f64>,
    /// Natural modes by ascending frequency, joints held at `pose`; motions without a spring are left out.
    pub modes: Vec<ModeShape>,
    /// Total mass (kg).
    pub mass_kg: f64,
    /// Centre of mass at `pose` in the base frame (m).
    pub com_m: [f64; 3],
    /// Its covariance there, `xx xy xz yy yz zz` in axes of the base (m^2); absent where nothing is known of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com_covariance_m2: Option<[f64; 6]>,
    /// Motion; absent where there is none to show.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
}

/// A natural mode.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModeShape {
    /// Undamped natural frequency (Hz).
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Shape over the passive coordinates, largest 1.
    pub passive: Vec<f64>,
    /// Motion of the base with it, linear first (m, rad).
    pub base: [f64; 6],
}

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
        /// Index of the coordinate (rad).
        by: usize,
    },
    /// Along an axis.
    Slide {
        /// Unit axis in the frame of the node.
        axis: [f64; 3],
        /// Index of the coordinate (m).
        by: usize,
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

/// A robot to be shown.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// What it is: `identified`, `prior`.
    pub label: &'a str,
    /// The robot.
    pub model: &'a Model,
    /// Its parameters.
    pub params: &'a Params<f64>,
    /// Joint positions without a motion, and of the modes (rad or m).
    pub pose: &'a [f64],
    /// Motion, if there is one to show.
    pub trace: Option<&'a Trace>,
    /// How well parameters are known.
    pub known: Option<&'a Knowledge>,
    /// Surfaces of its links.
    pub appearance: &'a Appearance,
}

impl Scene {
    /// The scene of a robot. Allocates.
    ///
    /// # Panics
    /// If pose, trace or parameters belong to another model.
    pub fn new(s: &Subject<'_>) -> Self {
        let (model, params) = (s.model, s.params);
        let rest = model.rest_position(params);
        let mut nodes = bodies(s);
        for k in 0..model.appendages().len() {
            appendage::push(&mut nodes, model, params, k, &rest);
        }
        let (com, covariance) = mass::at(s, s.pose, &rest);
        // Modes that cannot be computed are not drawn; `ffid check` and the report name the reason.
        let small = model.np() > 0 && model.nv() <= MAX_DENSE;
        let found = small.then(|| modes(model, params, s.pose, &rest, Boundary::JointsHeld).ok()).flatten();
        let found = found.unwrap_or_default();
        let highest = found.iter().map(|m| m.frequency_hz).fold(0.0, f64::max);
        let rings = |m: &ff_dynamics::Mode| m.frequency_hz > SPRINGLESS * highest;
        let shape = |m: ff_dynamics::Mode| ModeShape {
            frequency_hz: m.frequency_hz,
            damping_ratio: m.damping_ratio,
            passive: m.passive,
            base: m.base.into(),
        };
        Self {
            label: s.label.to_owned(),
            nodes,
            joints: model.joint_names(),
            coordinates: model.passive_coords().into_iter().map(|(name, _)| name).collect(),
            pose: s.pose.to_vec(),
            modes: found.into_iter().filter(rings).map(shape).collect(),
            mass_kg: mass::total(s, s.pose, &rest),
            com_m: com.into(),
            com_covariance_m2: covariance,
            motion: s.trace.map(|t| {
                let motion = Motion::new(model, params, t);
                let ellipsoids = Ellipsoids::along(s, t, &motion);
                motion.with(ellipsoids)
            }),
            rest,
        }
    }
}

/// Nodes of the rigid bodies.
fn bodies(s: &Subject<'_>) -> Vec<Node> {
    let (model, params) = (s.model, s.params);
    let lengths = model.bodies().iter().map(|b| b.joint.placement.pos.norm());
    let link = lengths.sum::<f64>() / model.nj().max(1) as f64;
    let mut nodes: Vec<Node> = (0..model.n_bodies())
        .map(|i| {
            let inertia = params.body(i);
            let mut shapes: Vec<Drawn> = s.appearance.of_body(i).cloned().collect();
            let drawn = !shapes.is_empty();
            shapes.extend(equivalent(inertia, Role::Inertia));
            if !drawn {
                let ends = model.bodies().iter().filter(|b| b.parent == i).map(|b| b.joint.placement.pos);
                // The base is a block, not a link between joints.
                shapes.extend(ends.filter(|_| i > 0).filter_map(|end| rod(&end)));
            }
            let mut node = Node {
                name: model.body_name(i).to_owned(),
                parent: None,
                place: Pose::from(&Xform::identity()),
                moves: None,
                shapes,
                mass_kg: (inertia.mass > 0.0).then_some(inertia.mass),
            };
            if let Some(b) = i.checked_sub(1).map(|j| &model.bodies()[j]) {
                let axis = b.joint.axis.into();
                node.parent = Some(b.parent);
                node.place = Pose::from(&b.joint.placement);
                node.moves = Some(match b.joint.kind {
                    JointKind::Prismatic => Moves::Slide { axis, by: i - 1 },
                    JointKind::Revolute | JointKind::Continuous => Moves::Turn { axis, by: i - 1 },
                });
                node.shapes.push(sensor(&b.joint.axis, link));
            }
            node
        })
        .collect();
    let gyro = Form::Axes { size: 0.5 * size(params.body(0)) };
    nodes[0].shapes.push(Drawn { role: Role::Gyro, place: Pose::from(&Xform::identity()), form: gyro });
    nodes
}

/// Box of even density with the mass, centre of mass and inertia of a body: edges `a^2 = 6 (I_b + I_c - I_a) / m` along the
/// principal axes (K. Meriam, *Dynamics*, table of solids), or along the axes of the body where its products of inertia are small; a ball of
/// water for a point mass; `None` without mass.
pub(super) fn equivalent(inertia: &Inertia<f64>, role: Role) -> Option<Drawn> {
    let com = inertia.com().filter(|_| inertia.mass > 0.0)?;
    let about = inertia.about_com();
    let products = Vector3::new(about[(0, 1)], about[(0, 2)], about[(1, 2)]);
    // Principal axes of nearly equal moments point anywhere: two estimates of one body would look turned against each other.
    let aligned = products.amax() < ALIGNED * about.trace();
    let eigen = about.symmetric_eigen();
    let (i, mut axes) =
        if aligned { (about.diagonal(), Matrix3::identity()) } else { (eigen.eigenvalues, eigen.eigenvectors) };
    let edge = |a: usize| (6.0 * (i.sum() - 2.0 * i[a]) / inertia.mass).max(0.0).sqrt();
    let size = [edge(0), edge(1), edge(2)];
    let longest = size.iter().fold(0.0, |a: f64, b| a.max(*b));
    let radius = ball(inertia.mass);
    if longest < 1e-3 * radius {
        let form = Form::Sphere { radius };
        return Some(Drawn { role, place: Pose::from(&Xform::new(Matrix3::identity(), com)), form });
    }
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let size = size.map(|x| x.max(THINNEST * longest));
    Some(Drawn { role, place: Pose::from(&Xform::new(axes, com)), form: Form::Box { size } })
}

/// Radius of a ball of water of this mass (m).
pub(super) fn ball(mass: f64) -> f64 {
    (3.0 * mass / (4.0 * PI * WATER)).cbrt()
}

/// About how large a body is (m): the longest edge of its box.
pub(super) fn size(inertia: &Inertia<f64>) -> f64 {
    match equivalent(inertia, Role::Inertia).map(|d| d.form) {
        Some(Form::Box { size }) => size.iter().fold(0.0, |a: f64, b| a.max(*b)),
        Some(Form::Sphere { radius }) => 2.0 * radius,
        _ => 0.1,
    }
}

/// A rod from the origin to `end`; `None` where they coincide.
pub(super) fn rod(end: &Vector3<f64>) -> Option<Drawn> {
    let length = end.norm();
    let radius = 0.5 * (ROD.0 * length).min(ROD.1);
    (length > 1e-6).then(|| Drawn {
        role: Role::Rod,
        place: Pose::from(&Xform::new(along_z(end), 0.5 * end)),
        form: Form::Cylinder { radius, length },
    })
}

/// The axis of a joint as a short cylinder; `link` is the mean distance from joint to joint (m).
fn sensor(axis: &Vector3<f64>, link: f64) -> Drawn {
    let radius = (0.12 * link).clamp(0.01, 0.12);
    Drawn {
        role: Role::Joint,
        place: Pose::from(&Xform::new(along_z(axis), Vector3::zeros())),
        form: Form::Cylinder { radius, length: 3.0 * radius },
    }
}

/// A rotation that takes z to a direction.
fn along_z(to: &Vector3<f64>) -> Matrix3<f64> {
    let z = to / to.norm();
    let other = if z.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let x = other.cross(&z).normalize();
    Matrix3::from_columns(&[x, z.cross(&x), z])
}

/// A shape of a URDF.
pub(super) fn form(shape: &Shape) -> Form {
    match *shape {
        Shape::Sphere { radius } => Form::Sphere { radius },
        Shape::Box { size } => Form::Box { size },
        // Half balls at the ends of a capsule add a radius each; a cylinder of that length shows as much.
        Shape::Capsule { radius, length } => Form::Cylinder { radius, length: length + 2.0 * radius },
        Shape::Cylinder { radius, length } => Form::Cylinder { radius, length },
    }
}
