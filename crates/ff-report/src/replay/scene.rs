//! A robot as a tree of nodes with shapes.

use super::appearance::Appearance;
use super::mass::Knowledge;
use super::motion::Motion;
use super::node::{Drawn, Form, Moves, Node, Pose, Role};
use super::shapes::{equivalent, rod, sensor, size};
use super::{appendage, mass};
use ff_dynamics::{Boundary, Trace, modes};
use ff_model::{JointKind, Model, Params, Xform};
use ffid::open::MAX_DENSE;
use serde::Serialize;

/// Modes below this share of the highest frequency are motions without a spring, such as the spin of a wheel.
const SPRINGLESS: f64 = 1e-6;

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
        let (com, covariance) = mass::at(model, params, s.known, s.pose, &rest);
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
            mass_kg: mass::total(model, params, s.pose, &rest),
            com_m: com.into(),
            com_covariance_m2: covariance,
            motion: s.trace.map(|t| Motion::new(model, params, t, s.known)),
            rest,
        }
    }
}

/// Nodes of the rigid bodies.
fn bodies(s: &Subject<'_>) -> Vec<Node> {
    let (model, params) = (s.model, s.params);
    let lengths = model.bodies().iter().map(|b| b.joint.placement.pos.norm());
    let link = lengths.sum::<f64>() / model.n_joints().max(1) as f64;
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
                let of = model.coordinate(i - 1);
                let own = (of.multiplier, of.offset) == (1.0, 0.0);
                let (by, follows) = (of.index, (!own).then_some([of.multiplier, of.offset]));
                node.moves = Some(match b.joint.kind {
                    JointKind::Prismatic => Moves::Slide { axis, by, follows },
                    JointKind::Revolute | JointKind::Continuous => Moves::Turn { axis, by, follows },
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
