//! The mass matrix by the composite-rigid-body algorithm (CRBA).

use crate::state::State;
use crate::work::{PortWork, Work};
use ff_model::{Force, Inertia, Model, ModelScalar, Motion, Params};
use nalgebra::DMatrix;

/// Mass matrix `H(q, eta)`, `nv x nv`, symmetric, over `[base 6 | joints n | passive m]`.
///
/// Springs and dampers play no part. Source: Featherstone 2008, table 6.2; an appendage adds its host block
/// to the composite inertia of the host, and its coupling columns are carried to the root like joint columns.
/// Does not allocate.
///
/// # Panics
/// If `h` is not `nv x nv`.
pub fn mass_matrix<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    work: &mut Work<T>,
    h: &mut DMatrix<T>,
) {
    work.place(model, &state.q);
    work.port_inertias(model, params, &state.eta);
    let (nb, nj, nv) = (model.nb(), model.nj(), model.nv());
    assert_eq!(h.shape(), (nv, nv), "mass matrix shape");
    h.fill(T::zero());
    for i in 0..model.n_bodies() {
        work.ic[i] = *params.body(i);
    }
    for (k, ap) in model.appendages().iter().enumerate() {
        let hung = host_block(&work.ports[k]).to_parent(&work.ports[k].mount);
        work.ic[ap.host] += hung;
    }
    for i in (1..model.n_bodies()).rev() {
        let up = work.ic[i].to_parent(&work.x[i]);
        work.ic[model.bodies()[i - 1].parent] += up;
    }
    if nb == 6 {
        h.fixed_view_mut::<6, 6>(0, 0).copy_from(&work.ic[0].to_matrix());
    }
    for i in 1..model.n_bodies() {
        let s = work.joint_motion(model, i);
        let f = work.ic[i].mul_motion(&s);
        h[(nb + i - 1, nb + i - 1)] = s.dot(&f);
        carry(model, work, h, i, f, nb + i - 1);
    }
    for (k, ap) in model.appendages().iter().enumerate() {
        let p = &work.ports[k];
        let first = nb + nj + ap.coord_offset;
        for j in 0..ap.dim() {
            for l in 0..ap.dim() {
                h[(first + j, first + l)] = p.m(6 + j, 6 + l);
            }
            let f = p.mount.force_to_parent(&p.coupling(j));
            if ap.host > 0 {
                let s = work.joint_motion(model, ap.host);
                set(h, nb + ap.host - 1, first + j, s.dot(&f));
            }
            carry(model, work, h, ap.host, f, first + j);
        }
    }
}

fn set<T: ModelScalar>(h: &mut DMatrix<T>, i: usize, j: usize, x: T) {
    h[(i, j)] = x;
    h[(j, i)] = x;
}

/// Carries the wrench `f` on body `i` to the root, filling column (and row) `col` on the way.
fn carry<T: ModelScalar>(model: &Model, work: &Work<T>, h: &mut DMatrix<T>, mut i: usize, mut f: Force<T>, col: usize) {
    let nb = model.nb();
    while i > 0 {
        f = work.x[i].force_to_parent(&f);
        i = model.bodies()[i - 1].parent;
        if i > 0 {
            set(h, nb + i - 1, col, work.joint_motion(model, i).dot(&f));
        }
    }
    if nb == 6 {
        for r in 0..6 {
            set(h, r, col, f.get(r));
        }
    }
}

/// The host block of a port as a rigid body: with its own rates zero an appendage moves with its host, so
/// `M_bb` has the ten-parameter structure (checked by the conformance suite, not here).
pub(crate) fn host_block<T: ModelScalar>(p: &PortWork<T>) -> Inertia<T> {
    Inertia::from_elements(|i, j| p.m(i, j))
}

/// `H y` for one motion, used by momentum: avoids the full matrix. See [`crate::momentum`].
pub(crate) fn port_momentum<T: ModelScalar>(p: &PortWork<T>, host: &Motion<T>, nu: &[T]) -> Force<T> {
    let mut w = p.host_inertia(host);
    for (j, &n) in nu.iter().enumerate() {
        w += p.coupling(j).scaled(n);
    }
    w
}
