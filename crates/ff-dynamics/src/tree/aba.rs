//! Forward dynamics by the articulated-body algorithm (Featherstone 2008, ch. 7), linear in the joints.
//!
//! A port is condensed onto its host before the backward pass,
//!
//! ```text
//! I_A = M_bb - M_be M_ee^-1 M_eb,     p_A = h_b + M_be M_ee^-1 (tau_e - h_e),
//! nu' = M_ee^-1 (tau_e - h_e - M_eb A),
//! ```
//!
//! so the cost is linear in joints and appendages, at any host.

use crate::linalg::ldl;
use crate::state::State;
use crate::tree::forward::by_mass_matrix;
use crate::work::buffers::Work;
use ff_model::scalar::ModelScalar;
use ff_model::spatial::small::{mm, rotate_sym};
use ff_model::{Force, Model, Motion, Params, Xform};
use nalgebra::{Matrix3, Matrix6};

/// A mass matrix (of a body, a port, or the whole base) lost positive definiteness.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("inertia seen at {at} is not positive definite; check masses and inertias of everything it carries")]
pub struct SingularInertia {
    /// Body, joint or appendage.
    pub at: String,
}

/// Accelerations for given forces, as [`crate::tree::forward::forward_dynamics`], which calls this for long chains.
///
/// `tau = [external base wrench | joint torques | external passive forces]`, all `nv` long; springs, dampers,
/// gravity and [`Work::set_external`] are added by the model. Where joints follow others it is [`by_mass_matrix`]. Does not allocate except
/// for the error.
///
/// # Errors
/// [`SingularInertia`] where a pivot is not positive.
///
/// # Panics
/// If a slice has the wrong length.
pub fn aba<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    tau: &[T],
    work: &mut Work<T>,
    a: &mut [T],
) -> Result<(), SingularInertia> {
    if work.coupled.is_some() {
        return by_mass_matrix(model, params, state, tau, work, a);
    }
    let (nb, nj) = (model.nb(), model.nj());
    assert_eq!(tau.len(), model.nv(), "tau length");
    assert_eq!(a.len(), model.nv(), "acceleration length");
    prepare(model, params, state, &tau[nb + nj..], work)?;
    let qd = state.qd();
    for i in (1..model.n_bodies()).rev() {
        let s = work.joint_motion(model, i);
        let u = mul6(&work.ia[i], &s);
        let d = s.dot(&u);
        if !(d.value() > 0.0 && d.is_finite()) {
            return Err(SingularInertia { at: format!("joint {}", model.bodies()[i - 1].joint.name) });
        }
        let dinv = T::one() / d;
        let ut = tau[nb + i - 1] - s.dot(&work.pa[i]);
        let c = work.v[i].cross(&s.scaled(qd[i - 1]));
        let uv = u.to_vector();
        let ia = work.ia[i] - uv * (uv * dinv).transpose();
        let pa = work.pa[i] + mul6(&ia, &c) + u.scaled(ut * dinv);
        (work.u[i], work.dinv[i], work.ut[i]) = (u, dinv, ut);
        let parent = model.bodies()[i - 1].parent;
        work.ia[parent] += inertia_to_parent(&ia, &work.x[i]);
        let up = work.x[i].force_to_parent(&pa);
        work.pa[parent] += up;
    }
    let wrench = if nb == 6 { Force::from_slice(tau) } else { Force::zero() };
    root(model, state, wrench, work, a)?;
    for i in 1..model.n_bodies() {
        let s = work.joint_motion(model, i);
        let parent = model.bodies()[i - 1].parent;
        let acc = work.x[i].motion_to_child(&work.a[parent]) + work.v[i].cross(&s.scaled(qd[i - 1]));
        let qdd = (work.ut[i] - acc.dot(&work.u[i])) * work.dinv[i];
        a[nb + i - 1] = qdd;
        work.a[i] = acc + s.scaled(qdd);
    }
    passive_accelerations(model, work, &mut a[nb + nj..]);
    Ok(())
}

/// Kinematics, own inertias and biases of all bodies, ports condensed onto their hosts.
fn prepare<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    tau_e: &[T],
    work: &mut Work<T>,
) -> Result<(), SingularInertia> {
    work.place(model, &state.q);
    work.twists(model, state);
    work.port_inertias(model, params, &state.eta);
    work.port_biases(model, params, state);
    for i in 0..model.n_bodies() {
        let b = params.body(i);
        work.ia[i] = b.to_matrix();
        work.pa[i] = work.v[i].cross_force(&b.mul_motion(&work.v[i])) - work.external[i];
    }
    for (k, ap) in model.appendages().iter().enumerate() {
        let n = ap.dim();
        let p = &mut work.ports[k];
        for i in 0..n {
            for j in 0..n {
                p.ee[i * n + j] = p.mass().own(i, j);
            }
        }
        if !ldl::factor(&mut p.ee, n) {
            return Err(SingularInertia { at: format!("appendage {}", ap.name) });
        }
        for i in 0..n {
            p.free[i] = tau_e[ap.coord_offset + i] - p.h[6 + i];
        }
        ldl::solve(&p.ee, n, &mut p.free);
        let mut col = [T::zero(); ff_model::port::MAX_COORDS];
        for j in 0..6 {
            for i in 0..n {
                col[i] = p.mass().get(6 + i, j);
            }
            ldl::solve(&p.ee, n, &mut col[..n]);
            for i in 0..n {
                p.gain[i * 6 + j] = col[i];
            }
        }
        let mut ia = Matrix6::from_fn(|i, j| p.mass().get(i, j));
        let mut pa = Force::from_slice(&p.h);
        for l in 0..n {
            let c = p.coupling(l);
            pa += c.scaled(p.free[l]);
            for i in 0..6 {
                for j in 0..6 {
                    ia[(i, j)] -= c.get(i) * p.gain[l * 6 + j];
                }
            }
        }
        let mount = p.mount;
        work.ia[ap.host] += inertia_to_parent(&ia, &mount);
        work.pa[ap.host] += mount.force_to_parent(&pa);
    }
    Ok(())
}

/// Solves for the base acceleration and stores it in `work.a[0]` and the base part of `a`.
fn root<T: ModelScalar>(
    model: &Model,
    state: &State<T>,
    wrench: Force<T>,
    work: &mut Work<T>,
    a: &mut [T],
) -> Result<(), SingularInertia> {
    let g = Work::gravity(model, state);
    if model.nb() == 0 {
        work.a[0] = g;
        return Ok(());
    }
    // The gravity field is an acceleration of the frame: the unknown is the acceleration relative to it.
    let mut l = [T::zero(); 36];
    for i in 0..6 {
        for j in 0..6 {
            l[6 * i + j] = work.ia[0][(i, j)];
        }
    }
    if !ldl::factor(&mut l, 6) {
        return Err(SingularInertia { at: format!("base {}", model.body_name(0)) });
    }
    let mut b = [T::zero(); 6];
    (wrench - work.pa[0]).write_to(&mut b);
    ldl::solve(&l, 6, &mut b);
    work.a[0] = Motion::from_slice(&b);
    (work.a[0] - g).write_to(a);
    Ok(())
}

/// `nu' = free - gain A` at every port.
fn passive_accelerations<T: ModelScalar>(model: &Model, work: &Work<T>, out: &mut [T]) {
    for (k, ap) in model.appendages().iter().enumerate() {
        let p = &work.ports[k];
        let host = p.mount.motion_to_child(&work.a[ap.host]);
        for i in 0..ap.dim() {
            let mut x = p.free[i];
            for j in 0..6 {
                x -= p.gain[i * 6 + j] * host.get(j);
            }
            out[ap.coord_offset + i] = x;
        }
    }
}

#[inline(always)]
fn mul6<T: ModelScalar>(m: &Matrix6<T>, a: &Motion<T>) -> Force<T> {
    let mut f = [T::zero(); 6];
    for i in 0..6 {
        for j in 0..6 {
            f[i] += m[(i, j)] * a.get(j);
        }
    }
    Force::from_slice(&f)
}

/// A general symmetric 6 x 6 inertia of a child frame, seen from the parent: `X^* I X^-1`.
///
/// With blocks `[[A, B], [B^T, C]]` rotated into the parent and `P = [p]x`:
/// `A' = A`, `B' = B - A P`, `C' = C - B^T P + P B - P A P`.
fn inertia_to_parent<T: ModelScalar>(m: &Matrix6<T>, x: &Xform<T>) -> Matrix6<T> {
    let r = &x.rot;
    let block = |i: usize, j: usize| Matrix3::from_fn(|k, l| m[(i + k, j + l)]);
    let a = rotate_sym(r, &block(0, 0));
    let c = rotate_sym(r, &block(3, 3));
    let b = mm(&mm(r, &block(0, 3)), &r.transpose());
    let z = T::zero();
    let p = &x.pos;
    let px = Matrix3::new(z, -p.z, p.y, p.z, z, -p.x, -p.y, p.x, z);
    let ap = mm(&a, &px);
    let b2 = b - ap;
    let pb = mm(&px, &b);
    let c2 = c + pb + pb.transpose() - mm(&px, &ap);
    let mut out = Matrix6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&a);
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(&b2);
    out.fixed_view_mut::<3, 3>(3, 0).copy_from(&b2.transpose());
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&c2);
    out
}
