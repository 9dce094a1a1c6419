//! The regressor: how generalised forces depend on the inertial parameters of the bodies.

use crate::state::State;
use crate::tree::links as tree;
use crate::work::buffers::Work;
use ff_lanes::Kernel;
use ff_model::dispatch_rotation;
use ff_model::scalar::{LaneScalar, ModelScalar};
use ff_model::spatial::vec3::V3;
use ff_model::tree::Mounted;
use ff_model::{Force, Model, Motion, Params};
use nalgebra::{DMatrix, Matrix3, Vector3};
use std::ops::Deref;

/// Wrench of a rigid body moving with twist `v` and acceleration `a`, per unit of each inertial parameter.
///
/// Column `k` of the body regressor `A(v, a)` in `f = I a + v x* I v = A phi`, for
/// `phi = [m, h, Ixx, Ixy, Iyy, Ixz, Iyz, Izz]`. With the classical acceleration `ac = a_lin + w x v` of the
/// origin: `f = m ac + (al x + w x w x) h`, `n = I al + w x I w + h x ac` (Atkeson, An, Hollerbach 1986, eq. (8)).
#[inline]
pub fn body_regressor<T: ModelScalar>(v: &Motion<T>, a: &Motion<T>) -> [Force<T>; 10] {
    let (w, al) = (&v.ang, &a.ang);
    let ac = a.lin + w.cross(&v.lin);
    let z = T::zero();
    let mut out = [Force::zero(); 10];
    out[0].lin = ac;
    // S = [al]x + [w]x^2, columns act on h; moment h x ac has columns e_k x ac.
    let s = skew(al) + w * w.transpose() - Matrix3::from_diagonal_element(w.x * w.x + w.y * w.y + w.z * w.z);
    for k in 0..3 {
        out[1 + k].lin = s.column(k).into_owned();
        let mut e = Vector3::zeros();
        e[k] = T::one();
        out[1 + k].ang = e.cross(&ac);
    }
    // L(x) phi_I = I x for the six rotational parameters; n = L(al) + w x L(w).
    let l = |x: &Vector3<T>| -> [Vector3<T>; 6] {
        [
            Vector3::new(x.x, z, z),
            Vector3::new(x.y, x.x, z),
            Vector3::new(z, x.y, z),
            Vector3::new(x.z, z, x.x),
            Vector3::new(z, x.z, x.y),
            Vector3::new(z, z, x.z),
        ]
    };
    let (la, lw) = (l(al), l(w));
    for k in 0..6 {
        out[4 + k].ang = la[k] + w.cross(&lw[k]);
    }
    out
}

fn skew<T: ModelScalar>(v: &Vector3<T>) -> Matrix3<T> {
    let z = T::zero();
    Matrix3::new(z, -v.z, v.y, v.z, z, -v.x, -v.y, v.x, z)
}

/// The regressor of one model, `nv x n_params`, where [`regressor`] puts it; reads as its matrix.
///
/// More than half of it is zero whatever the motion: what a joint closer to the tip has to do with a body, a panel with another one.
/// That is written once, here.
///
/// ```
/// use ff_dynamics::{Regressor, State, Work, regressor, rnea};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
/// # let state = ff_testkit::tree::random_state(&robot, &mut ff_testkit::random::rng(3), 0.1);
///
/// // Generalised forces are linear in the inertial parameters: tau = Y phi.
/// let (params, a) = (Params::nominal(&robot), vec![0.3; robot.nv()]);
/// let (mut work, mut y, mut tau) = (Work::new(&robot), Regressor::new(&robot), vec![0.0; robot.nv()]);
/// regressor(&robot, &params, &state, &a, &mut work, &mut y);
/// rnea(&robot, &params, &state, &a, &mut work, &mut tau);
/// let phi = ff_model::nalgebra::DVector::from_column_slice(params.values());
/// assert!((&*y * phi - ff_model::nalgebra::DVector::from_vec(tau)).norm() < 1e-9);
/// ```
#[derive(Clone, Debug)]
pub struct Regressor<T> {
    y: DMatrix<T>,
    /// Parents of the bodies of the model it belongs to, and of its appendages the host, the first coordinate and the first parameter.
    bodies: Vec<usize>,
    appendages: Vec<[usize; 3]>,
    /// Of the tree with every joint moving by itself, where joints follow others.
    tree: Option<Box<Self>>,
}

impl<T: LaneScalar> Regressor<T> {
    /// Zeros for `model`. Allocates.
    pub fn new(model: &Model) -> Self {
        Self {
            y: DMatrix::from_element(model.nv(), model.n_params(), T::zero()),
            bodies: model.bodies().iter().map(|b| b.parent).collect(),
            appendages: model.appendages().iter().map(place).collect(),
            tree: model.coordinates().map(|_| Box::new(Self::new(&model.spanning()))),
        }
    }
    /// Whether the same elements are zero in that of another model.
    fn fits(&self, model: &Model) -> bool {
        self.y.shape() == (model.nv(), model.n_params())
            && model.bodies().iter().map(|b| b.parent).eq(self.bodies.iter().copied())
            && model.appendages().iter().map(place).eq(self.appendages.iter().copied())
            && self.tree.is_some() == model.coordinates().is_some()
    }
}

fn place(a: &Mounted) -> [usize; 3] {
    [a.host, a.coord_offset, a.param_offset]
}

impl<T> Deref for Regressor<T> {
    type Target = DMatrix<T>;
    fn deref(&self) -> &DMatrix<T> {
        &self.y
    }
}

/// `Y = d tau / d p` at fixed motion, `nv x n_params`, in the order of [`Model::param_decls`].
///
/// Rows as in [`crate::tree::rnea::rnea()`]: base wrench, joint torques, passive rows. For the bodies `tau = Y phi`
/// holds exactly; appendage columns are exact derivatives of the port equations
/// ([`ff_model::PortDynamics::regressor`]). A rigid model has `n_params = 10 n_bodies` and no appendage columns.
///
/// Each row is the screw of its degree of freedom, carried outwards to the bodies it moves, contracted with
/// their motion ([`ff_model::spatial::vec3::Moving::powers`]). Does not allocate.
///
/// # Panics
/// If `a` is not `nv` long, or `y` belongs to a model of another tree.
pub fn regressor<T: LaneScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    a: &[T],
    work: &mut Work<T>,
    y: &mut Regressor<T>,
) {
    assert_eq!(a.len(), model.nv(), "acceleration length");
    assert!(y.fits(model), "regressor of another model");
    if let Some(tree) = &mut y.tree {
        work.over_tree(|work, c| {
            c.set(model, state);
            c.accelerate(a);
            regressor(&c.tree, params, &c.state, &c.a, work, tree);
            c.rows(&tree.y, &mut y.y);
        });
        return;
    }
    T::enter(Filling { model, params, state, a, work, y: y.y.as_mut_slice() });
}

struct Filling<'a, T: LaneScalar> {
    model: &'a Model,
    params: &'a Params<T>,
    state: &'a State<T>,
    a: &'a [T],
    work: &'a mut Work<T>,
    y: &'a mut [T],
}

impl<T: LaneScalar> Kernel for Filling<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { model, params, state, a, work, y } = self;
        let (nb, nj, nv) = (model.nb(), model.nj(), model.nv());
        let links = &mut work.links[..];
        tree::place(links, &state.q);
        tree::move_all(model, state, a, links);
        // Lanes fill the first cache, and what is zero is better left alone. One number is faster with the matrix in the cache, where
        // clearing it brings it.
        if size_of::<T>() == size_of::<f64>() {
            y.fill(T::zero());
        }
        // Screws of all degrees of freedom that move body b, in its frame: base, then joints. Those of the base's
        // translation are axes alone.
        let per = 6 + nj;
        let screws = &mut work.screws[..];
        for k in 0..3 {
            let mut e = [T::zero(); 3];
            e[k] = T::one();
            screws[k] = (V3::from_slice(&e), V3::zero());
            screws[3 + k] = (V3::zero(), V3::from_slice(&e));
        }
        for b in 0..links.len() {
            if b > 0 {
                let (inner, own) = screws.split_at_mut(b * per);
                let from = &inner[links[b].parent * per..][..per];
                let (own, l) = (&mut own[..per], &links[b]);
                dispatch_rotation!(T, l.pose.turn, K => {
                    if nb == 6 {
                        for k in 0..3 {
                            own[k].0 = l.pose.down::<K>(&from[k].0);
                        }
                        for k in 3..6 {
                            own[k] = l.pose.screw_down::<K>(&from[k].0, &from[k].1);
                        }
                    }
                    let mut j = l.parent;
                    while j > 0 {
                        own[5 + j] = l.pose.screw_down::<K>(&from[5 + j].0, &from[5 + j].1);
                        j = links[j].parent;
                    }
                });
                own[5 + b] = l.screw();
            }
            let motion = links[b].moving();
            let block = &mut y[10 * b * nv..(10 * b + 10) * nv];
            let own = &screws[b * per..(b + 1) * per];
            for k in 0..nb.min(3) {
                let x = motion.pushes(&own[k].0);
                for i in 0..4 {
                    block[i * nv + k] = x[i];
                }
            }
            // Joints from body b inwards, then the base's rotation.
            let (mut j, mut k) = (b, 3);
            while j > 0 || k < nb {
                let (r, s) = if j > 0 { (nb + j - 1, &own[5 + j]) } else { (k, &own[k]) };
                let x = motion.powers(&s.0, &s.1);
                for i in 0..10 {
                    block[i * nv + r] = x[i];
                }
                if j > 0 {
                    j = links[j].parent;
                } else {
                    k += 1;
                }
            }
        }
        for (k, (ap, port)) in model.appendages().iter().zip(&mut work.ports).enumerate() {
            let p = params.appendage(model, k);
            let dim = 6 + port.n;
            let mut columns = std::mem::take(&mut port.d);
            tree::port_motion(model, state, a, ap, port, &links[ap.host], false, |s, acc| {
                T::tangent(&*ap.appendage).regressor(p, s, acc, &mut columns);
            });
            for (c, d) in columns[..p.len() * dim].chunks_exact(dim).enumerate() {
                let col = &mut y[(ap.param_offset + c) * nv..][..nv];
                let own = &mut col[nb + nj + ap.coord_offset..][..port.n];
                for (to, &x) in own.iter_mut().zip(&d[6..]) {
                    *to = x;
                }
                let (f, n) = port.up(&V3::from_slice(d), &V3::from_slice(&d[3..]));
                crate::tree::crba::carry(links, nb, ap.host, f, n, col);
            }
            port.d = columns;
        }
    }
}
