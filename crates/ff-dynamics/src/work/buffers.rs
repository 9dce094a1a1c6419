//! Buffers of the algorithms, and the kinematic passes they share.

use crate::linalg::ltl::ROOT;
use crate::state::State;
use crate::tree::derivatives::Node;
use crate::tree::links as tree;
use crate::tree::links::Link;
use ff_model::port::{PortView, port_len};
use ff_model::scalar::ModelScalar;
use ff_model::spatial::small::{mm, mv};
use ff_model::spatial::so3::quat_to_rot;
use ff_model::spatial::vec3::{Pose, Ten, Turn, V3, turn};
use ff_model::{Force, Inertia, JointKind, Model, Motion, Params, PortMatrix, PortState, Xform};
use nalgebra::{Matrix3, Matrix6, Vector3};

/// Buffers of one appendage port.
#[derive(Clone, Debug)]
pub(crate) struct PortWork<T: ModelScalar> {
    /// Mount pose in the host body.
    pub(crate) mount: Xform<T>,
    /// Host twist in the mount frame.
    pub(crate) v: Motion<T>,
    /// The numbers of `M`: see [`PortMatrix`].
    pub(crate) m: Vec<T>,
    /// Bias, `6+n`.
    pub(crate) h: Vec<T>,
    /// Factorised `M_ee`, `n^2`: a buffer of the elimination.
    pub(crate) ee: Vec<T>,
    /// `M_ee^-1 M_eb`, `n x 6` row-major.
    pub(crate) gain: Vec<T>,
    /// `M_ee^-1 (tau_e - h_e)`, `n`.
    pub(crate) free: Vec<T>,
    /// Number of coordinates.
    pub(crate) n: usize,
    /// Mount pose as the fast passes hold it.
    pub(crate) pose: Pose<T>,
    /// Residual, `6+n`.
    pub(crate) r: Vec<T>,
    /// Columns of `M_be` carried to the base, force and moment.
    pub(crate) g: Vec<(V3<T>, V3<T>)>,
    /// Derivative columns of the port equations.
    pub(crate) d: Vec<T>,
}

impl<T: ModelScalar> PortWork<T> {
    pub(crate) fn new(a: &ff_model::tree::Mounted) -> Self {
        let n = a.dim();
        let z = |k: usize| vec![T::zero(); k];
        let dim = 6 + n;
        Self {
            mount: a.mount.lift(),
            v: Motion::zero(),
            m: z(port_len(n)),
            h: z(dim),
            ee: z(n * n),
            gain: z(6 * n),
            free: z(n),
            n,
            pose: Pose::constant(&a.mount),
            r: z(dim),
            g: vec![(V3::zero(), V3::zero()); n],
            d: z(dim * a.decl().params.len().max(6 + 2 * n)),
        }
    }
    /// The residual `r = h + M [A; 0]` at a host acceleration (componentwise, angular) and own rates held.
    #[inline(always)]
    pub(crate) fn rest(&mut self, a: &V3<T>, al: &V3<T>) {
        let b = self.mass().host();
        let f = al.cross_add(&b.h, &a.scale_add(b.m, &V3::from_slice(&self.h)));
        let n = b.h.cross_add(a, &b.i.mul_add(al, &V3::from_slice(&self.h[3..])));
        f.write_to(&mut self.r);
        n.write_to(&mut self.r[3..]);
        for k in 0..self.n {
            let (f, n) = self.mass().coupling(k);
            self.r[6 + k] = f.dot(a) + n.dot(al) + self.h[6 + k];
        }
    }
    /// Adds the host rows of the residual to the host's wrench.
    #[inline(always)]
    pub(crate) fn press(&self, host: &mut Link<T>) {
        let (f, n) = self.up(&V3::from_slice(&self.r), &V3::from_slice(&self.r[3..]));
        host.f += f;
        host.n += n;
    }
    /// A wrench in the mount frame, in the host's.
    #[inline(always)]
    pub(crate) fn up(&self, f: &V3<T>, n: &V3<T>) -> (V3<T>, V3<T>) {
        match self.pose.turn {
            Turn::None if !T::DERIVATIVES => self.pose.wrench_up::<{ turn::NONE }>(f, n),
            _ => self.pose.wrench_up::<{ turn::ANY }>(f, n),
        }
    }
    /// The host block as a body in the host frame.
    #[inline(always)]
    pub(crate) fn hung(&self) -> Ten<T> {
        match self.pose.turn {
            Turn::None if !T::DERIVATIVES => self.pose.body_up::<{ turn::NONE }>(&self.mass().host()),
            _ => self.pose.body_up::<{ turn::ANY }>(&self.mass().host()),
        }
    }
    /// `M`.
    #[inline(always)]
    pub(crate) fn mass(&self) -> PortView<'_, T> {
        PortView::new(self.n, &self.m)
    }
    /// Column `k` of `M_be`: the wrench on the host per unit own acceleration, in the mount frame.
    pub(crate) fn coupling(&self, k: usize) -> Force<T> {
        let (f, n) = self.mass().coupling(k);
        Force::new(f.into(), n.into())
    }
    /// `M_bb A` for a host acceleration `A` in the mount frame.
    #[inline(always)]
    pub(crate) fn host_inertia(&self, a: &Motion<T>) -> Force<T> {
        let (f, n) = self.mass().host().momentum(&V3::from(&a.lin), &V3::from(&a.ang));
        Force::new(f.into(), n.into())
    }
}

/// Every buffer the algorithms need for one model; nothing allocates after [`Work::new`].
///
/// One `Work` serves one thread. Fields are private to the crate; results are returned by the algorithms.
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
}

impl<T: ModelScalar> Work<T> {
    /// Buffers for `model`. Allocates.
    pub fn new(model: &Model) -> Self {
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
            links: tree::links(model),
            apart: apart(model.nb(), &dof_parent),
            dof_parent,
            lower: vec![T::zero(); model.nv().pow(2)],
            screws: vec![(V3::zero(), V3::zero()); nb * (6 + model.nj())],
            nodes: vec![Node::zero(); nb],
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
        let qd = state.qd();
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
