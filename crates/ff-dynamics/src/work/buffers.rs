//! Buffers of the algorithms, and the kinematic passes they share.

use crate::linalg::ltl::ROOT;
use crate::state::State;
use crate::work::coupled::Coupled;
use crate::work::link::{Link, links};
use crate::work::node::Node;
use crate::work::port_work::PortWork;
use ff_model::scalar::ModelScalar;
use ff_model::spatial::small::{mm, mv};
use ff_model::spatial::so3::quat_to_rot;
use ff_model::spatial::vec3::V3;
use ff_model::{Force, Inertia, JointKind, Model, Motion, Params, PortMatrix, PortState, Xform};
use nalgebra::{Matrix3, Matrix6, Vector3};

/// Every buffer the algorithms need for one model; nothing allocates after [`Work::new`].
///
/// One `Work` serves one thread. Fields are private to the crate; results are returned by the algorithms.
///
/// ```
/// use ff_dynamics::{State, Work, forward_dynamics, rnea};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let state = ff_testkit::tree::random_state(&robot, &mut ff_testkit::random::rng(3), 0.1);
///
/// // One set of buffers for every algorithm; nothing is allocated after this.
/// let (params, mut work) = (Params::nominal(&robot), Work::new(&robot));
/// let (torque, mut a, mut back) = (vec![0.7; robot.nv()], vec![0.0; robot.nv()], vec![0.0; robot.nv()]);
/// forward_dynamics(&robot, &params, &state, &torque, &mut work, &mut a)?;
/// rnea(&robot, &params, &state, &a, &mut work, &mut back);
/// assert!(back.iter().zip(&torque).all(|(b, t)| (b - t).abs() < 1e-8));
/// # Ok::<(), ff_dynamics::tree::SingularInertia>(())
/// ```
#[derive(Clone, Debug)]
pub struct Work<T: ModelScalar> {
    /// Fixed part of the joint placements, lifted to `T`.
    placement: Vec<Xform<T>>,
    /// Joint axes.
    pub(crate) axis: Vec<Vector3<T>>,
    /// Pose of each body in its parent; entry 0 unused.
    pub(crate) x: Vec<Xform<T>>,
    /// Body twists in body frames.
    pub(crate) v: Vec<Motion<T>>,
    /// Body accelerations in body frames.
    pub(crate) a: Vec<Motion<T>>,
    /// Wrenches on bodies, body frames.
    pub(crate) f: Vec<Force<T>>,
    /// Composite inertias.
    pub(crate) ic: Vec<Inertia<T>>,
    /// Articulated inertias and bias wrenches.
    pub(crate) ia: Vec<Matrix6<T>>,
    pub(crate) pa: Vec<Force<T>>,
    /// Per joint `I_A S`, `1 / (S . I_A S)` and `tau - S . p_A`.
    pub(crate) u: Vec<Force<T>>,
    pub(crate) dinv: Vec<T>,
    pub(crate) ut: Vec<T>,
    /// Ports.
    pub(crate) ports: Vec<PortWork<T>>,
    /// Wrenches applied from outside, on each body in its own frame; zero unless set.
    pub(crate) external: Vec<Force<T>>,
    /// Whether any of them was ever set.
    pub(crate) has_external: bool,
    /// Forces applied from outside on the passive coordinates, and whether they were ever set.
    pub(crate) external_passive: Vec<T>,
    pub(crate) has_passive: bool,
    /// Mean number of joints between a body and the base, its own included; zero without joints.
    pub(crate) mean_depth: f64,
    /// Zero accelerations, length `nv`.
    pub(crate) zeros: Vec<T>,
    /// Bodies as the fast passes hold them.
    pub(crate) links: Vec<Link<T>>,
    /// Parent of every degree of freedom in the sparse mass matrix, the base left out ([`crate::linalg::ltl`]).
    pub(crate) dof_parent: Vec<usize>,
    /// Pairs `(i, j)`, `j < i`, of which neither carries the other: zero in the mass matrix.
    pub(crate) apart: Vec<(usize, usize)>,
    /// Mass matrix, row-major, lower triangle. What is zero whatever the state stays as it began.
    pub(crate) lower: Vec<T>,
    /// Per body, the screws of the base and of the joints that move it, in its frame: `6 + nj` each.
    pub(crate) screws: Vec<(V3<T>, V3<T>)>,
    /// Bodies in base axes, for the derivatives.
    pub(crate) nodes: Vec<Node<T>>,
    /// Where joints follow others: everything above is over the tree with every joint moving by itself.
    pub(crate) coupled: Option<Box<Coupled<T>>>,
}

impl<T: ModelScalar> Work<T> {
    /// Buffers for `model`. Allocates.
    pub fn new(model: &Model) -> Self {
        if model.coordinates().is_none() {
            return Self::of_tree(model);
        }
        let tree = model.spanning();
        let work = Self::of_tree(&tree);
        Self { coupled: Some(Box::new(Coupled::new(model, tree))), ..work }
    }
    /// Buffers for a model whose joints all move by themselves.
    fn of_tree(model: &Model) -> Self {
        let (nb, dof_parent) = (model.n_bodies(), dof_parents(model));
        let mut placement = vec![Xform::identity()];
        let mut axis = vec![Vector3::zeros()];
        for b in model.bodies() {
            placement.push(b.joint.placement.lift());
            axis.push(b.joint.axis.map(T::from_f64));
        }
        Self {
            placement,
            axis,
            x: vec![Xform::identity(); nb],
            v: vec![Motion::zero(); nb],
            a: vec![Motion::zero(); nb],
            f: vec![Force::zero(); nb],
            ic: vec![Inertia::zero(); nb],
            ia: vec![Matrix6::zeros(); nb],
            pa: vec![Force::zero(); nb],
            u: vec![Force::zero(); nb],
            dinv: vec![T::zero(); nb],
            ut: vec![T::zero(); nb],
            ports: model.appendages().iter().map(PortWork::new).collect(),
            external: vec![Force::zero(); nb],
            has_external: false,
            external_passive: vec![T::zero(); model.np()],
            has_passive: false,
            mean_depth: mean_depth(model),
            zeros: vec![T::zero(); model.nv()],
            links: links(model),
            apart: apart(model.nb(), &dof_parent),
            dof_parent,
            lower: vec![T::zero(); model.nv().pow(2)],
            screws: vec![(V3::zero(), V3::zero()); nb * (6 + model.nj())],
            nodes: vec![Node::zero(); nb],
            coupled: None,
        }
    }
    /// Applies a wrench (N, N m; body frame, about the body origin) on a body in every later call, until
    /// set again. Ports and joints are unaffected.
    ///
    /// # Panics
    /// If the body does not exist.
    pub fn set_external(&mut self, body: usize, wrench: Force<T>) {
        self.external[body] = wrench;
        self.has_external = true;
    }
    /// Applies forces (N m or N) on the passive coordinates in every later call of [`crate::tree::forward::hybrid_dynamics`], until set
    /// again. The other algorithms take them as the passive part of `tau`.
    ///
    /// # Panics
    /// If there are not `m` of them.
    pub fn set_passive_forces(&mut self, forces: &[T]) {
        self.has_passive = true;
        self.external_passive.copy_from_slice(forces);
    }
    /// Pose of body `i` in its parent, from the last pass.
    pub(crate) fn joint_motion(&self, model: &Model, i: usize) -> Motion<T> {
        match model.bodies()[i - 1].joint.kind {
            JointKind::Prismatic => Motion::new(self.axis[i], Vector3::zeros()),
            _ => Motion::new(Vector3::zeros(), self.axis[i]),
        }
    }
    /// Poses of all bodies in their parents from the joint positions.
    pub(crate) fn place(&mut self, model: &Model, q: &[T]) {
        if let (Some(map), Some(c)) = (model.coordinates(), &mut self.coupled) {
            map.positions(q, &mut c.joint);
        }
        let q = self.coupled.as_ref().map_or(q, |c| &c.joint);
        for (k, b) in model.bodies().iter().enumerate() {
            let i = k + 1;
            let p = &self.placement[i];
            self.x[i] = match b.joint.kind {
                JointKind::Prismatic => Xform::new(p.rot, p.pos + mv(&p.rot, &(self.axis[i] * q[k]))),
                _ => Xform::new(mm(&p.rot, &axis_rotation(&self.axis[i], q[k])), p.pos),
            };
        }
    }
    /// Twists of all bodies and port hosts; needs [`Work::place`].
    pub(crate) fn twists(&mut self, model: &Model, state: &State<T>) {
        self.v[0] = state.base_twist();
        if let (Some(map), Some(c)) = (model.coordinates(), &mut self.coupled) {
            map.rates(state.qd(), &mut c.joint);
        }
        let qd = self.coupled.as_ref().map_or(state.qd(), |c| &c.joint);
        for (k, b) in model.bodies().iter().enumerate() {
            let i = k + 1;
            let mut v = self.x[i].motion_to_child(&self.v[b.parent]);
            match b.joint.kind {
                JointKind::Prismatic => v.lin += self.axis[i] * qd[k],
                _ => v.ang += self.axis[i] * qd[k],
            }
            self.v[i] = v;
        }
        for (a, p) in model.appendages().iter().zip(&mut self.ports) {
            p.v = p.mount.motion_to_child(&self.v[a.host]);
        }
    }
    /// Mass matrices of all ports.
    #[inline(always)]
    pub(crate) fn port_inertias(&mut self, model: &Model, params: &Params<T>, eta: &[T]) {
        for (k, a) in model.appendages().iter().enumerate() {
            let n = a.dim();
            let eta = &eta[a.coord_offset..a.coord_offset + n];
            let mut m = PortMatrix::over(n, &mut self.ports[k].m);
            T::port(&*a.appendage).inertia(params.appendage(model, k), eta, &mut m);
        }
    }
    /// Biases of all ports; needs [`Work::twists`].
    pub(crate) fn port_biases(&mut self, model: &Model, params: &Params<T>, state: &State<T>) {
        for (k, a) in model.appendages().iter().enumerate() {
            let r = a.coord_offset..a.coord_offset + a.dim();
            let p = &mut self.ports[k];
            let s = PortState { host: p.v, eta: &state.eta[r.clone()], nu: &state.nu()[r] };
            T::port(&*a.appendage).bias(params.appendage(model, k), &s, &mut p.h);
        }
    }
    /// Minus gravity in base coordinates: the acceleration of an imagined base frame that accounts for it.
    pub(crate) fn gravity(model: &Model, state: &State<T>) -> Motion<T> {
        let g = model.gravity();
        if g.norm_squared() == 0.0 {
            return Motion::zero();
        }
        Motion::new(-quat_to_rot(&state.att).tr_mul(&g.map(T::from_f64)), Vector3::zeros())
    }
}

fn mean_depth(model: &Model) -> f64 {
    let mut depth = vec![0usize; model.n_bodies()];
    for (i, b) in model.bodies().iter().enumerate() {
        depth[i + 1] = depth[b.parent] + 1;
    }
    depth.iter().sum::<usize>() as f64 / model.nj().max(1) as f64
}

/// Parent of every degree of freedom but those of the base: the one before within an appendage, the joint of the parent
/// body, the joint of the host. `H` has an entry only between a degree of freedom and its ancestors (Featherstone 2008,
/// sec. 6.4), of which the base is one to all.
fn dof_parents(model: &Model) -> Vec<usize> {
    let (nb, nj) = (model.nb(), model.nj());
    let of_body = |body: usize| if body > 0 { nb + body - 1 } else { ROOT };
    let mut parent = vec![ROOT; nb];
    parent.extend(model.bodies().iter().map(|b| of_body(b.parent)));
    for a in model.appendages() {
        let first = nb + nj + a.coord_offset;
        parent.extend((0..a.dim()).map(|j| if j > 0 { first + j - 1 } else { of_body(a.host) }));
    }
    parent
}

/// Marks `dof` and its ancestors besides the base.
fn mark(parent: &[usize], mut dof: usize, moves: &mut [bool]) {
    while dof != ROOT {
        moves[dof] = true;
        dof = parent[dof];
    }
}

/// Pairs of degrees of freedom of which neither is an ancestor of the other.
fn apart(nb: usize, parent: &[usize]) -> Vec<(usize, usize)> {
    let mut out = Vec::new();
    for i in nb..parent.len() {
        let mut related = vec![false; parent.len()];
        mark(parent, i, &mut related);
        out.extend((nb..i).filter(|&j| !related[j]).map(|j| (i, j)));
    }
    out
}

/// Rotation about a unit axis: `1 + s [u]x + (1 - c) [u]x^2` (Rodrigues).
#[inline(always)]
pub(crate) fn axis_rotation<T: ff_model::Scalar>(u: &Vector3<T>, angle: T) -> Matrix3<T> {
    let (s, c) = angle.sin_cos();
    let k = T::one() - c;
    let (ux, uy, uz) = (u.x, u.y, u.z);
    let (kx, ky, kz) = (k * ux, k * uy, k * uz);
    let (sx, sy, sz) = (s * ux, s * uy, s * uz);
    Matrix3::new(
        c + kx * ux,
        kx * uy - sz,
        kx * uz + sy,
        ky * ux + sz,
        c + ky * uy,
        ky * uz - sx,
        kz * ux - sy,
        kz * uy + sx,
        c + kz * uz,
    )
}
