//! Inverse dynamics by the recursive Newton-Euler algorithm (RNEA).

use crate::state::State;
use crate::work::Work;
use ff_model::{Model, ModelScalar, Motion, Params};

/// Generalised forces for given accelerations: `tau = H(q) a + c(q, v)`.
///
/// Rows are `[base wrench (base frame, about the base origin) | joint torques | passive rows]`. The passive
/// rows contain springs and dampers: they are zero in free motion, and a non-zero value is the generalised
/// force that would have to act from outside. Gravity and [`Work::set_external`] wrenches are included.
///
/// Source: R. Featherstone, *Rigid Body Dynamics Algorithms*, 2008, table 5.1, with ports added on the hosts.
/// `a` and `tau` have length `nv`. Does not allocate. Cost `O(n + m)`.
///
/// # Panics
/// If a slice has the wrong length.
pub fn rnea<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    a: &[T],
    work: &mut Work<T>,
    tau: &mut [T],
) {
    work.place(model, &state.q);
    work.twists(model, state);
    work.port_inertias(model, params, &state.eta);
    work.port_biases(model, params, state);
    rnea_placed(model, params, state, a, work, tau);
}

/// Velocity-dependent terms, springs, dampers and gravity: `c(q, v)`, [`rnea`] at zero acceleration.
///
/// # Panics
/// If `c` is not `nv` long.
pub fn bias<T: ModelScalar>(model: &Model, params: &Params<T>, state: &State<T>, work: &mut Work<T>, c: &mut [T]) {
    let zeros = std::mem::take(&mut work.zeros);
    rnea(model, params, state, &zeros, work, c);
    work.zeros = zeros;
}

/// [`rnea`] after kinematics and port terms are in place.
pub(crate) fn rnea_placed<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    a: &[T],
    work: &mut Work<T>,
    tau: &mut [T],
) {
    let (nb, nj) = (model.nb(), model.nj());
    assert_eq!(a.len(), model.nv(), "acceleration length");
    assert_eq!(tau.len(), model.nv(), "tau length");
    let base = if nb == 6 { Motion::from_slice(a) } else { Motion::zero() };
    work.a[0] = base + Work::gravity(model, state);
    let qd = state.qd();
    for i in 0..model.n_bodies() {
        if i > 0 {
            let s = work.joint_motion(model, i);
            let parent = model.bodies()[i - 1].parent;
            work.a[i] = work.x[i].motion_to_child(&work.a[parent])
                + s.scaled(a[nb + i - 1])
                + work.v[i].cross(&s.scaled(qd[i - 1]));
        }
        let b = params.body(i);
        work.f[i] = b.mul_motion(&work.a[i]) + work.v[i].cross_force(&b.mul_motion(&work.v[i])) - work.external[i];
    }
    let acc = &a[nb + nj..];
    for (k, ap) in model.appendages().iter().enumerate() {
        let p = &work.ports[k];
        let n = ap.dim();
        let host = p.mount.motion_to_child(&work.a[ap.host]);
        let mut w = p.host_inertia(&host) + ff_model::Force::from_slice(&p.h);
        for j in 0..n {
            let c = p.coupling(j);
            w += c.scaled(acc[ap.coord_offset + j]);
            let mut e = p.h[6 + j] + host.dot(&c);
            for l in 0..n {
                e += p.m(6 + j, 6 + l) * acc[ap.coord_offset + l];
            }
            tau[nb + nj + ap.coord_offset + j] = e;
        }
        let up = p.mount.force_to_parent(&w);
        work.f[ap.host] += up;
    }
    for i in (1..model.n_bodies()).rev() {
        tau[nb + i - 1] = work.joint_motion(model, i).dot(&work.f[i]);
        let up = work.x[i].force_to_parent(&work.f[i]);
        work.f[model.bodies()[i - 1].parent] += up;
    }
    if nb == 6 {
        work.f[0].write_to(tau);
    }
}
