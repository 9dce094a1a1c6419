//! The regressor: how generalised forces depend on the inertial parameters of the bodies.

use crate::state::State;
use crate::work::Work;
use ff_model::{Force, Grad, Model, ModelScalar, Motion, Params, PortMatrix, PortState, scalar::DIRECTIONS};
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
/// Rows as in [`crate::rnea`]: base wrench, joint torques, passive rows. For the bodies `tau = Y phi`
/// holds exactly; appendage columns are exact derivatives (by forward duals) of the port equations. A
/// rigid model has `n_params = 10 n_bodies` and no appendage columns. Allocates one index list per appendage.
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
        port_param_derivatives(&*ap.appendage, p, &s, &host, acc, &wanted, |col, d| {
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

/// Calls `each(tag, d)` with `d[0..6+n]`, the derivative of the port residual `M [A; nu'] + h` with respect to
/// each of the `wanted` parameters `(own index, tag)`, [`DIRECTIONS`] of them per pass.
pub(crate) fn port_param_derivatives(
    appendage: &dyn ff_model::DynAppendage,
    p: &[f64],
    s: &PortState<'_, f64>,
    host_acc: &Motion<f64>,
    acc: &[f64],
    wanted: &[(usize, usize)],
    mut each: impl FnMut(usize, &[f64]),
) {
    const MAX: usize = 6 + ff_model::MAX_COORDS;
    let n = s.eta.len();
    let zero = Grad::constant(0.0);
    let mut pd = [zero; ff_model::appendage::MAX_PARAMS];
    for (d, &x) in pd.iter_mut().zip(p) {
        *d = Grad::constant(x);
    }
    let (mut eta, mut nu) = ([zero; ff_model::MAX_COORDS], [zero; ff_model::MAX_COORDS]);
    for i in 0..n {
        eta[i] = Grad::constant(s.eta[i]);
        nu[i] = Grad::constant(s.nu[i]);
    }
    let lift = |m: &Motion<f64>| Motion::new(m.lin.map(Grad::constant), m.ang.map(Grad::constant));
    let state = PortState { host: lift(&s.host), eta: &eta[..n], nu: &nu[..n] };
    let mut buf = [zero; MAX * MAX];
    let mut h = [zero; MAX];
    let port = Grad::port(appendage);
    for pass in wanted.chunks(DIRECTIONS) {
        for (d, &(own, _)) in pass.iter().enumerate() {
            pd[own].eps[d] = 1.0;
        }
        let pd_all = &pd[..p.len()];
        let mut m = PortMatrix::new(n, &mut buf);
        port.inertia(pd_all, &eta[..n], &mut m);
        port.bias(pd_all, &state, &mut h[..6 + n]);
        for (d, &(own, tag)) in pass.iter().enumerate() {
            let mut out = [0.0; MAX];
            for i in 0..6 + n {
                let mut x = h[i].eps[d];
                for j in 0..6 {
                    x += m.get(i, j).eps[d] * host_acc.get(j);
                }
                for j in 0..n {
                    x += m.get(i, 6 + j).eps[d] * acc[j];
                }
                out[i] = x;
            }
            each(tag, &out[..6 + n]);
            pd[own].eps[d] = 0.0;
        }
    }
}
