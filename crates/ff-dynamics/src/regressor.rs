//! The regressor: how generalised forces depend on the inertial parameters of the bodies.

use crate::state::State;
use crate::work::Work;
use ff_model::{
    D1, DynAppendage, Force, Grad, Model, ModelScalar, Motion, ParamGroup, Params, PortMatrix, PortState,
    scalar::DIRECTIONS,
};
use nalgebra::{DMatrix, Matrix3, Vector3};

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

/// `Y = d tau / d p` at fixed motion, `nv x n_params`, in the order of [`Model::param_decls`].
///
/// Rows as in [`crate::rnea()`]: base wrench, joint torques, passive rows. For the bodies `tau = Y phi`
/// holds exactly; appendage columns are exact derivatives of the port equations. A
/// rigid model has `n_params = 10 n_bodies` and no appendage columns. Allocates buffers per appendage.
///
/// # Panics
/// If a shape is wrong.
pub fn regressor(
    model: &Model,
    params: &Params<f64>,
    state: &State<f64>,
    a: &[f64],
    work: &mut Work<f64>,
    y: &mut DMatrix<f64>,
) {
    let (nb, nj, nv) = (model.nb(), model.nj(), model.nv());
    assert_eq!(a.len(), nv, "acceleration length");
    assert_eq!(y.shape(), (nv, model.n_params()), "regressor shape");
    y.fill(0.0);
    work.place(model, &state.q);
    work.twists(model, state);
    accelerations(model, state, a, work);
    for b in 0..model.n_bodies() {
        for (k, f) in body_regressor(&work.v[b], &work.a[b]).iter().enumerate() {
            carry(model, work, y, b, *f, 10 * b + k);
        }
    }
    for (k, ap) in model.appendages().iter().enumerate() {
        let r = ap.coord_offset..ap.coord_offset + ap.dim();
        let host = work.ports[k].mount.motion_to_child(&work.a[ap.host]);
        let p = params.appendage(model, k);
        let s = PortState { host: work.ports[k].v, eta: &state.eta[r.clone()], nu: &state.nu()[r.clone()] };
        let acc = &a[nb + nj + r.start..nb + nj + r.end];
        let mount = work.ports[k].mount;
        let wanted: Vec<(usize, usize)> = (0..p.len()).map(|j| (j, ap.param_offset + j)).collect();
        PortDerivatives::new(&*ap.appendage, &wanted).evaluate(&*ap.appendage, p, &s, &host, acc, |col, d| {
            for i in 0..ap.dim() {
                y[(nb + nj + r.start + i, col)] = d[6 + i];
            }
            carry(model, work, y, ap.host, mount.force_to_parent(&Force::from_slice(d)), col);
        });
    }
}

/// Fills `work.a` with body accelerations (gravity included) for generalised accelerations `a`.
fn accelerations(model: &Model, state: &State<f64>, a: &[f64], work: &mut Work<f64>) {
    let nb = model.nb();
    let base = if nb == 6 { Motion::from_slice(a) } else { Motion::zero() };
    work.a[0] = base + Work::gravity(model, state);
    for i in 1..model.n_bodies() {
        let s = work.joint_motion(model, i);
        work.a[i] = work.x[i].motion_to_child(&work.a[model.bodies()[i - 1].parent])
            + s.scaled(a[nb + i - 1])
            + work.v[i].cross(&s.scaled(state.qd()[i - 1]));
    }
}

/// Adds a wrench on body `i` to column `col` of every joint on the way to the root, and to the base rows.
fn carry(model: &Model, work: &Work<f64>, y: &mut DMatrix<f64>, mut i: usize, mut f: Force<f64>, col: usize) {
    let nb = model.nb();
    while i > 0 {
        y[(nb + i - 1, col)] += work.joint_motion(model, i).dot(&f);
        f = work.x[i].force_to_parent(&f);
        i = model.bodies()[i - 1].parent;
    }
    if nb == 6 {
        for r in 0..6 {
            y[(r, col)] += f.get(r);
        }
    }
}

/// Parameter derivatives of one port, with their buffers.
///
/// The energies are linear in the ten inertial parameters of a body (that is what makes them inertial
/// parameters), so those columns are the port equations at unit parameters, in plain `f64`. All others are
/// found by forward duals, [`DIRECTIONS`] at a time.
#[derive(Clone, Debug)]
pub(crate) struct PortDerivatives {
    linear: Vec<(usize, usize)>,
    other: Vec<(usize, usize)>,
    unit: Vec<f64>,
    m: Vec<f64>,
    pd: Vec<Grad>,
    md: Vec<Grad>,
    eta: Vec<Grad>,
    nu: Vec<Grad>,
    hd: Vec<Grad>,
    out: Vec<f64>,
}

impl PortDerivatives {
    /// For the parameters `wanted` of an appendage, as `(own index, tag)`.
    pub(crate) fn new(appendage: &dyn DynAppendage, wanted: &[(usize, usize)]) -> Self {
        let decl = appendage.declaration();
        let (n, np) = (decl.coords.len(), decl.params.len());
        let inertial = |w: &&(usize, usize)| matches!(decl.params[w.0].group, ParamGroup::Inertial(_));
        let zero = Grad::constant(0.0);
        Self {
            linear: wanted.iter().filter(inertial).copied().collect(),
            other: wanted.iter().filter(|w| !inertial(w)).copied().collect(),
            unit: vec![0.0; np],
            m: vec![0.0; (6 + n).pow(2)],
            pd: vec![zero; np],
            md: vec![zero; (6 + n).pow(2)],
            eta: vec![zero; n],
            nu: vec![zero; n],
            hd: vec![zero; 6 + n],
            out: vec![0.0; 6 + n],
        }
    }

    /// Calls `each(tag, d)` with `d[0..6+n]`, the derivative of the port equations `M [A; nu'] + h` at fixed
    /// motion. Does not allocate.
    pub(crate) fn evaluate(
        &mut self,
        appendage: &dyn DynAppendage,
        p: &[f64],
        s: &PortState<'_, f64>,
        host_acc: &Motion<f64>,
        acc: &[f64],
        mut each: impl FnMut(usize, &[f64]),
    ) {
        let n = s.eta.len();
        let plain = f64::port(appendage);
        for &(own, tag) in &self.linear {
            self.unit[own] = 1.0;
            let mut m = PortMatrix::new(n, &mut self.m);
            plain.inertia(&self.unit, s.eta, &mut m);
            plain.bias(&self.unit, s, &mut self.out);
            for (i, x) in self.out.iter_mut().enumerate() {
                for j in 0..6 {
                    *x += m.get(i, j) * host_acc.get(j);
                }
                for (j, a) in acc.iter().enumerate() {
                    *x += m.get(i, 6 + j) * a;
                }
            }
            each(tag, &self.out);
            self.unit[own] = 0.0;
        }
        if self.other.is_empty() {
            return;
        }
        let constant = |to: &mut [Grad], from: &[f64]| {
            to.iter_mut().zip(from).for_each(|(d, &x)| *d = Grad::constant(x));
        };
        constant(&mut self.pd, p);
        constant(&mut self.eta, s.eta);
        constant(&mut self.nu, s.nu);
        let host = Motion::new(s.host.lin.map(Grad::constant), s.host.ang.map(Grad::constant));
        let state = PortState { host, eta: &self.eta, nu: &self.nu };
        let port = Grad::port(appendage);
        for pass in self.other.chunks(DIRECTIONS) {
            for (d, &(own, _)) in pass.iter().enumerate() {
                self.pd[own].eps[d] = 1.0;
            }
            let mut m = PortMatrix::new(n, &mut self.md);
            port.inertia(&self.pd, &self.eta, &mut m);
            port.bias(&self.pd, &state, &mut self.hd);
            for (d, &(own, tag)) in pass.iter().enumerate() {
                for i in 0..6 + n {
                    let mut x = self.hd[i].eps[d];
                    for j in 0..6 {
                        x += m.get(i, j).eps[d] * host_acc.get(j);
                    }
                    for j in 0..n {
                        x += m.get(i, 6 + j).eps[d] * acc[j];
                    }
                    self.out[i] = x;
                }
                each(tag, &self.out);
                self.pd[own].eps[d] = 0.0;
            }
        }
    }
}

/// State derivatives of one port, with their buffers: one forward-dual pass per own direction.
#[derive(Clone, Debug)]
pub(crate) struct PortJacobian {
    p: Vec<D1>,
    eta: Vec<D1>,
    nu: Vec<D1>,
    m: Vec<D1>,
    h: Vec<D1>,
    /// `d(M [A_h; nu'] + h)` per direction, `6+n` each: host twist 6, coordinates n, rates n.
    pub(crate) columns: Vec<f64>,
}

impl PortJacobian {
    pub(crate) fn new(n: usize, p: &[f64]) -> Self {
        let z = |k| vec![D1::constant(0.0); k];
        Self {
            p: p.iter().map(|&x| D1::constant(x)).collect(),
            eta: z(n),
            nu: z(n),
            m: z((6 + n).pow(2)),
            h: z(6 + n),
            columns: vec![0.0; (6 + 2 * n) * (6 + n)],
        }
    }

    /// Fills `columns` at fixed accelerations. Does not allocate.
    pub(crate) fn evaluate(
        &mut self,
        appendage: &dyn DynAppendage,
        s: &PortState<'_, f64>,
        host_acc: &Motion<f64>,
        acc: &[f64],
    ) {
        let n = s.eta.len();
        let dim = 6 + n;
        let port = D1::port(appendage);
        let mut host = [0.0; 6];
        s.host.write_to(&mut host);
        for dir in 0..6 + 2 * n {
            let seed = |i: usize, x: f64| D1::new(x, if i == dir { 1.0 } else { 0.0 });
            for i in 0..n {
                self.eta[i] = seed(6 + i, s.eta[i]);
                self.nu[i] = seed(6 + n + i, s.nu[i]);
            }
            let v: [D1; 6] = core::array::from_fn(|i| seed(i, host[i]));
            let state = PortState { host: Motion::from_slice(&v), eta: &self.eta, nu: &self.nu };
            port.bias(&self.p, &state, &mut self.h);
            let out = &mut self.columns[dir * dim..(dir + 1) * dim];
            for (x, h) in out.iter_mut().zip(&self.h) {
                *x = h.eps[0];
            }
            // The mass matrix depends on the coordinates alone.
            if (6..6 + n).contains(&dir) {
                let mut m = PortMatrix::new(n, &mut self.m);
                port.inertia(&self.p, &self.eta, &mut m);
                for (i, x) in out.iter_mut().enumerate() {
                    for j in 0..6 {
                        *x += m.get(i, j).eps[0] * host_acc.get(j);
                    }
                    for (j, a) in acc.iter().enumerate() {
                        *x += m.get(i, 6 + j).eps[0] * a;
                    }
                }
            }
        }
    }
}
