//! The immutable description of a system: bodies in a tree, frames, appendages, gravity.
mod coupling;
pub(crate) mod displaced;

use crate::port::declaration::{CoordDecl, Decl, ParamDecl};
use crate::port::shared::SharedAppendage;
use crate::spatial::inertia::Inertia;
use crate::spatial::motion::Xform;
use crate::tree::coordinates::Coordinates;
use nalgebra::Vector3;
use std::fmt;

/// How a body moves against its parent.
///
/// ```
/// use ff_model::JointKind;
/// # let arm = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
///
/// let turning = arm.bodies().iter().filter(|b| b.joint.kind != JointKind::Prismatic).count();
/// assert_eq!(turning, arm.nj());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Rotation about the axis, with limits.
    Revolute,
    /// Rotation about the axis without limits.
    Continuous,
    /// Translation along the axis.
    Prismatic,
}

/// Limits of a joint; infinite where the URDF is silent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Lower position limit (rad or m).
    pub lower: f64,
    /// Upper position limit (rad or m).
    pub upper: f64,
    /// Greatest speed (rad/s or m/s).
    pub velocity: f64,
    /// Greatest torque or force (N m or N).
    pub effort: f64,
}

impl Default for JointLimits {
    fn default() -> Self {
        let inf = f64::INFINITY;
        Self { lower: -inf, upper: inf, velocity: inf, effort: inf }
    }
}

/// Spring, damper and dry friction of a joint as its description gives them; zero where it is silent:
/// `tau = stiffness (q - rest) + viscous dq + coulomb sign(dq)`.
///
/// They describe the drive side of a joint. The dynamics leave them out: torques are those behind the gear, where they do not show.
/// A joint that is lifted into an appendage takes spring and damper as those of its hinge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointImpedance {
    /// Stiffness (N m/rad or N/m).
    pub stiffness: f64,
    /// Position at which the spring is slack (rad or m).
    pub rest: f64,
    /// Viscous coefficient (N m s/rad or N s/m).
    pub viscous: f64,
    /// Coulomb torque or force (N m or N).
    pub coulomb: f64,
}

/// The one-degree-of-freedom joint that carries a body.
///
/// ```
/// use ff_model::nalgebra::{Matrix3, Vector3};
/// use ff_model::tree::JointLimits;
/// use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Xform};
///
/// let elbow = Joint {
///     name: "elbow".into(),
///     kind: JointKind::Revolute,
///     axis: Vector3::new(0.2, -0.3, 2.0), // any length: `add_body` normalises it
///     placement: Xform::new(Matrix3::identity(), Vector3::new(0.4, 0.1, -0.2)),
///     limits: JointLimits { lower: -1.9, upper: 2.1, velocity: 0.5, effort: 30.0 },
/// };
/// # let body = Inertia::from_com(5.0, &Vector3::new(0.2, -0.1, 0.3), &Matrix3::from_diagonal_element(0.4));
/// let mut model = Model::new("probe", "hull", body, BaseKind::Floating);
/// model.add_body(0, "forearm", elbow, body);
/// assert!((model.bodies()[0].joint.axis.norm() - 1.0).abs() < 1e-15);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name in the URDF.
    pub name: String,
    /// Kind of motion.
    pub kind: JointKind,
    /// Unit axis in the joint (= body) frame.
    pub axis: Vector3<f64>,
    /// Pose of the joint frame at position zero in the parent body frame.
    pub placement: Xform<f64>,
    /// Limits.
    pub limits: JointLimits,
}

/// A moving rigid body. Links on fixed joints are merged into it and remain as [`Frame`]s.
///
/// ```
/// # let arm = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
/// // Names from a body to the base.
/// let mut at = arm.body("arm_l3").unwrap();
/// let mut names = Vec::new();
/// while at > 0 {
///     let body = &arm.bodies()[at - 1];
///     names.push(body.name.as_str());
///     at = body.parent;
/// }
/// assert_eq!(names, ["arm_l3", "arm_l2", "arm_l1"]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name of the URDF link that moves.
    pub name: String,
    /// Index of the parent body; 0 is the base.
    pub parent: usize,
    /// Its joint.
    pub joint: Joint,
    /// Inertia about the body frame, merged links included.
    pub inertia: Inertia<f64>,
    /// Spring, damper and friction of its joint; zero unless [`Model::set_impedance`] gave them.
    pub impedance: JointImpedance,
}

/// A named frame fixed to a body.
///
/// ```
/// use ff_model::Xform;
/// use ff_model::nalgebra::{Matrix3, Vector3};
/// # let mut arm = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
///
/// let grasp = Xform::new(Matrix3::identity(), Vector3::new(0.1, -0.05, 0.2));
/// arm.add_frame("grasp", arm.nj(), grasp);
/// let found = arm.frame("grasp").map(|f| (f.body, f.placement));
/// assert_eq!(found, Some((arm.nj(), grasp)));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Name (every URDF link has one).
    pub name: String,
    /// The body that carries it.
    pub body: usize,
    /// Pose in the body frame.
    pub placement: Xform<f64>,
}

/// An appendage on its host.
#[derive(Clone)]
pub struct Mounted {
    /// Name in the mission file; prefix of its parameters and coordinates.
    pub name: String,
    /// The body that carries it.
    pub host: usize,
    /// Pose of the mount frame in the host body frame.
    pub mount: Xform<f64>,
    /// What hangs there.
    pub appendage: SharedAppendage,
    /// First own coordinate among all passive coordinates.
    pub coord_offset: usize,
    /// First own parameter in the parameter vector.
    pub param_offset: usize,
    /// Nominal values of its parameters, in order: those it declares, unless [`Model::set_nominal`] gave others.
    pub(crate) nominal: Vec<f64>,
    /// Number of own coordinates: asked for at every stage of a simulation.
    pub(crate) dim: usize,
}

impl Mounted {
    /// Coordinates and parameters of the appendage.
    pub fn decl(&self) -> &Decl {
        self.appendage.declaration()
    }
    /// Number of own coordinates.
    pub fn dim(&self) -> usize {
        self.dim
    }
}

impl fmt::Debug for Mounted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mounted")
            .field("name", &self.name)
            .field("host", &self.host)
            .field("kind", &self.decl().kind)
            .finish_non_exhaustive()
    }
}

/// Whether the base moves.
///
/// ```
/// use ff_model::BaseKind;
/// # let arm = ff_testkit::tree::peers_arm(BaseKind::Floating);
///
/// // The same arm bolted to a bench: six degrees of freedom less.
/// let bench = arm.clone().with_base_kind(BaseKind::Fixed);
/// assert_eq!((arm.nv() - bench.nv(), bench.nb()), (6, 0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BaseKind {
    /// Bolted to the world: no base degrees of freedom.
    Fixed,
    /// Free-floating: six base degrees of freedom, no external wrench unless one is declared.
    Floating,
}

/// A complete system. Immutable once built; every algorithm takes it by reference.
///
/// Body 0 is the base; body `i >= 1` hangs on arm joint `i - 1`, and parents come before children. The
/// generalised velocity is `[base 6 | joints n | passive m]` ([`Model::nv`] long; no base part when the
/// base is fixed); a joint that follows another one has no coordinate ([`Model::couple`]). The parameter vector is `[10 per body | parameters of each appendage in order]`.
///
/// ```
/// use ff_model::nalgebra::{Matrix3, Vector3};
/// use ff_model::payload::Payload;
/// use ff_model::{BaseKind, Inertia, Model, Xform};
///
/// let block = |mass| Inertia::from_com(mass, &Vector3::new(0.1, -0.2, 0.3), &Matrix3::from_diagonal_element(0.7));
/// let mut probe = Model::new("probe", "hull", block(50.0), BaseKind::Floating);
/// let at = Xform::new(Matrix3::identity(), Vector3::new(0.4, 0.9, -0.3));
/// probe.mount("camera", 0, at, Payload::new(&block(3.5))?)?;
/// assert_eq!((probe.nv(), probe.n_params(), probe.total_mass()), (6, 20, 53.5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Model {
    pub(super) name: String,
    pub(super) base_kind: BaseKind,
    pub(super) gravity: Vector3<f64>,
    pub(super) base_name: String,
    pub(super) base_inertia: Inertia<f64>,
    pub(super) bodies: Vec<Body>,
    pub(super) frames: Vec<Frame>,
    pub(super) appendages: Vec<Mounted>,
    pub(super) passive: usize,
    pub(super) params: usize,
    /// Of joints that follow others; `None` where every joint moves by itself.
    pub(super) coordinates: Option<Coordinates>,
}

impl Model {
    /// A system with only a base body and its frame.
    pub fn new(name: impl Into<String>, base_name: impl Into<String>, base: Inertia<f64>, kind: BaseKind) -> Self {
        let base_name = base_name.into();
        Self {
            name: name.into(),
            base_kind: kind,
            gravity: Vector3::zeros(),
            frames: vec![Frame { name: base_name.clone(), body: 0, placement: Xform::identity() }],
            base_name,
            base_inertia: base,
            bodies: Vec::new(),
            appendages: Vec::new(),
            passive: 0,
            params: 10,
            coordinates: None,
        }
    }
    /// Sets the gravity acceleration in world axes (m/s^2); zero unless set.
    #[must_use]
    pub fn with_gravity(mut self, g: Vector3<f64>) -> Self {
        self.gravity = g;
        self
    }
    /// The same system with another base kind.
    #[must_use]
    pub fn with_base_kind(mut self, kind: BaseKind) -> Self {
        self.base_kind = kind;
        self
    }
    /// Adds a body on a joint and returns its index. Adds a frame of the same name.
    ///
    /// # Panics
    /// If `parent` does not exist yet, appendages are already mounted (their offsets would move), or joints are already coupled.
    pub fn add_body(
        &mut self,
        parent: usize,
        name: impl Into<String>,
        mut joint: Joint,
        inertia: Inertia<f64>,
    ) -> usize {
        assert!(parent <= self.bodies.len(), "parent body {parent} does not exist");
        assert!(self.appendages.is_empty(), "bodies must be added before appendages");
        assert!(self.coordinates.is_none(), "bodies must be added before joints are coupled");
        let name = name.into();
        joint.axis /= joint.axis.norm();
        self.bodies.push(Body { name: name.clone(), parent, joint, inertia, impedance: JointImpedance::default() });
        let index = self.bodies.len();
        self.frames.push(Frame { name, body: index, placement: Xform::identity() });
        self.params += 10;
        index
    }
    /// Gives the joint that carries body `body` its spring, damper and friction.
    ///
    /// # Panics
    /// If the body does not exist or is the base.
    pub fn set_impedance(&mut self, body: usize, impedance: JointImpedance) {
        assert!((1..self.n_bodies()).contains(&body), "no joint carries body {body}");
        self.bodies[body - 1].impedance = impedance;
    }
    /// Adds a named frame fixed to a body.
    ///
    /// # Panics
    /// If the body does not exist.
    pub fn add_frame(&mut self, name: impl Into<String>, body: usize, placement: Xform<f64>) {
        assert!(body < self.n_bodies(), "body {body} does not exist");
        self.frames.push(Frame { name: name.into(), body, placement });
    }
    /// Adds rigidly attached mass to a body (fixed fuel, merged links): paper eq. (18).
    ///
    /// # Panics
    /// If the body does not exist.
    pub fn add_rigid(&mut self, body: usize, inertia: &Inertia<f64>) {
        let own = if body == 0 { &mut self.base_inertia } else { &mut self.bodies[body - 1].inertia };
        *own += *inertia;
    }
    /// The same tree without its appendages: the rigid model of the paper.
    #[must_use]
    pub fn without_appendages(&self) -> Self {
        let mut m = self.clone();
        m.appendages.clear();
        m.passive = 0;
        m.params = 10 * m.n_bodies();
        m
    }

    /// Name of the system.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// Whether the base moves.
    pub fn base_kind(&self) -> BaseKind {
        self.base_kind
    }
    /// Base degrees of freedom: 6 or 0.
    pub fn nb(&self) -> usize {
        if self.base_kind == BaseKind::Floating { 6 } else { 0 }
    }
    /// Number of joint coordinates `n`: of joints that move by themselves ([`Model::couple`]).
    pub fn nj(&self) -> usize {
        self.coordinates.as_ref().map_or(self.bodies.len(), Coordinates::len)
    }
    /// Number of passive coordinates `m`.
    pub fn np(&self) -> usize {
        self.passive
    }
    /// Length of the generalised velocity: `nb + nj + np`.
    pub fn nv(&self) -> usize {
        self.nb() + self.nj() + self.np()
    }
    /// Bodies including the base.
    pub fn n_bodies(&self) -> usize {
        self.bodies.len() + 1
    }
    /// Length of the parameter vector.
    pub fn n_params(&self) -> usize {
        self.params
    }
    /// Gravity acceleration in world axes (m/s^2).
    pub fn gravity(&self) -> &Vector3<f64> {
        &self.gravity
    }
    /// Moving bodies; body `i` of the tree is `bodies()[i - 1]`.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }
    /// Inertia of body `i` (0 is the base).
    ///
    /// # Panics
    /// If the body does not exist.
    pub fn inertia(&self, i: usize) -> &Inertia<f64> {
        if i == 0 { &self.base_inertia } else { &self.bodies[i - 1].inertia }
    }
    /// Name of body `i` (0 is the base).
    ///
    /// # Panics
    /// If the body does not exist.
    pub fn body_name(&self, i: usize) -> &str {
        if i == 0 { &self.base_name } else { &self.bodies[i - 1].name }
    }
    /// Mounted appendages.
    pub fn appendages(&self) -> &[Mounted] {
        &self.appendages
    }
    /// Named frames.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }
    /// The frame called `name`.
    pub fn frame(&self, name: &str) -> Option<&Frame> {
        self.frames.iter().find(|f| f.name == name)
    }
    /// Full names of the joints that move by themselves, in the order of `q`.
    pub fn joint_names(&self) -> Vec<String> {
        self.own_bodies().map(|b| b.joint.name.clone()).collect()
    }
    /// Passive coordinates as `appendage.coordinate`, with their declarations, in order.
    pub fn passive_coords(&self) -> Vec<(String, CoordDecl)> {
        self.appendages
            .iter()
            .flat_map(|a| a.decl().coords.iter().map(move |c| (format!("{}.{}", a.name, c.name), c.clone())))
            .collect()
    }
    /// All parameters with full names (`base.mass`, `panel_left.k[0]`, ...), in the order of the
    /// parameter vector.
    pub fn param_decls(&self) -> Vec<ParamDecl> {
        let mut out = Vec::with_capacity(self.params);
        for i in 0..self.n_bodies() {
            let prefix = if i == 0 { "base" } else { self.body_name(i) };
            out.extend(ParamDecl::inertial(prefix, self.inertia(i)));
        }
        for a in &self.appendages {
            for (p, nominal) in a.decl().params.iter().zip(&a.nominal) {
                let mut p = p.clone();
                p.nominal = *nominal;
                p.name = format!("{}.{}", a.name, p.name);
                if let crate::port::declaration::ParamGroup::Inertial(b) = &mut p.group {
                    *b = format!("{}.{b}", a.name);
                }
                out.push(p);
            }
        }
        out
    }
    /// Total mass at nominal parameters, appendages included (kg).
    pub fn total_mass(&self) -> f64 {
        let bodies: f64 = (0..self.n_bodies()).map(|i| self.inertia(i).mass).sum();
        let params = crate::tree::parameters::Params::<f64>::nominal(self);
        let hung: f64 = (0..self.appendages.len())
            .map(|k| {
                let a = &self.appendages[k];
                let eta = vec![0.0; a.dim()];
                let port: &dyn crate::port::erased::PortModel<f64> = &*a.appendage;
                port.dense_inertia(params.appendage(self, k), &eta)[(0, 0)]
            })
            .sum();
        bodies + hung
    }
}
