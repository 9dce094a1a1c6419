//! The mass matrix by the composite-rigid-body algorithm (CRBA).

use crate::state::State;
use crate::tree::links as tree;
use crate::work::buffers::Work;
use crate::work::link::Link;
use crate::work::port_work::PortWork;
use ff_lanes::Kernel;
use ff_model::dispatch_rotation;
use ff_model::scalar::ModelScalar;
use ff_model::spatial::vec3::{PackedInertia, V3};
use ff_model::{Force, Inertia, Model, Motion, Params};
use nalgebra::{DMatrix, DMatrixView, Dyn};

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
    assert_eq!(h.shape(), (model.nv(), model.nv()), "mass matrix shape");
    let folded = work.over_tree(|work, c| {
        c.set(model, state);
        mass_matrix(&c.tree, params, &c.state, work, &mut c.h);
        c.both(&c.h, h);
    });
    if folded.is_some() {
        return;
    }
    T::enter(Crba::<T, true> { model, params, state, work, h: h.as_mut_slice() });
}

/// The lower triangle of the mass matrix, `nv x nv`: what a Cholesky factorisation reads, in less time than [`mass_matrix`] takes to
/// fill both halves.
///
/// The numbers stay in `work`, where those that are zero whatever the state (between two branches) are never written again.
/// Elements above the diagonal mean nothing. Source: as [`mass_matrix`]. Does not allocate.
pub fn mass_matrix_lower<'w, T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    work: &'w mut Work<T>,
) -> DMatrixView<'w, T, Dyn, Dyn> {
    let nv = model.nv();
    let folded = work.over_tree(|work, c| {
        c.set(model, state);
        mass_matrix(&c.tree, params, &c.state, work, &mut c.h);
        c.fold_mass();
    });
    if folded.is_none() {
        let mut h = core::mem::take(&mut work.lower);
        T::enter(Crba::<T, false> { model, params, state, work, h: &mut h });
        work.lower = h;
    }
    let h = work.coupled.as_ref().map_or(&work.lower, |c| &c.lower);
    DMatrixView::from_slice_with_strides(h, nv, nv, nv, 1)
}

struct Crba<'a, T: ModelScalar, const FULL: bool> {
    model: &'a Model,
    params: &'a Params<T>,
    state: &'a State<T>,
    work: &'a mut Work<T>,
    h: &'a mut [T],
}

impl<T: ModelScalar, const FULL: bool> Kernel for Crba<'_, T, FULL> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { model, params, state, work, h } = self;
        let nv = model.nv();
        tree::place(&mut work.links, &state.q);
        work.port_inertias(model, params, &state.eta);
        tree::compose(model, params, &mut work.links, &work.ports);
        columns::<T, FULL>(model, work, h);
        if FULL {
            for &(i, j) in &work.apart {
                h[i * nv + j] = T::zero();
                h[j * nv + i] = T::zero();
            }
        }
    }
}

/// Writes every element of the mass matrix that can differ from zero between a degree of freedom and its
/// ancestors into row `descendant` of the row-major lower triangle, and into column `descendant` as well if `FULL`;
/// needs [`tree::compose`]. Ports get their coupling at the base.
#[inline(always)]
pub(crate) fn columns<T: ModelScalar, const FULL: bool>(model: &Model, work: &mut Work<T>, h: &mut [T]) {
    let (nb, nj, nv) = (model.nb(), model.nj(), model.nv());
    let h = &mut h[..nv * nv];
    let links = &work.links[..];
    if nb == 6 {
        let PackedInertia { m, h: c, i } = links[0].ic;
        let z = T::zero();
        let rows = [
            [m, z, z, z, c.z, -c.y],
            [z, m, z, -c.z, z, c.x],
            [z, z, m, c.y, -c.x, z],
            [z, -c.z, c.y, i.xx, i.xy, i.xz],
            [c.z, z, -c.x, i.xy, i.yy, i.yz],
            [-c.y, c.x, z, i.xz, i.yz, i.zz],
        ];
        for (k, row) in rows.iter().enumerate() {
            let columns = if FULL { 6 } else { k + 1 };
            h[k * nv..k * nv + columns].copy_from_slice(&row[..columns]);
        }
    }
    for i in 1..links.len() {
        let own = nb + i - 1;
        let mut to = Entries::<T, FULL> { h: &mut *h, nv, own };
        let (x, (f, n)) = dispatch_rotation!(T, links[i].pose.turn, K => {
            let (f, n) = links[i].axis_momentum::<K>();
            (links[i].joint_force::<K>(&f, &n), links[i].pose.wrench_up::<K>(&f, &n))
        });
        to.put(own, x);
        carry(links, nb, links[i].parent, f, n, &mut to);
    }
    for (ap, p) in model.appendages().iter().zip(&mut work.ports) {
        let first = nb + nj + ap.coord_offset;
        for j in 0..p.n {
            let mut to = Entries::<T, FULL> { h: &mut *h, nv, own: first + j };
            for l in 0..=j {
                to.put(first + l, p.mass().own(j, l));
            }
            let (f, n) = p.mass().coupling(j);
            let (f, n) = p.up(&f, &n);
            p.g[j] = carry(links, nb, ap.host, f, n, &mut to);
        }
    }
}

/// Where generalised forces go, one per degree of freedom.
pub(crate) trait Column<T> {
    /// Takes that of degree of freedom `i`.
    fn put(&mut self, i: usize, x: T);
}

impl<T> Column<T> for [T] {
    #[inline(always)]
    fn put(&mut self, i: usize, x: T) {
        self[i] = x;
    }
}

/// Row `own` of the mass matrix, and column `own` as well if `FULL`.
struct Entries<'a, T, const FULL: bool> {
    h: &'a mut [T],
    nv: usize,
    own: usize,
}

impl<T: ModelScalar, const FULL: bool> Column<T> for Entries<'_, T, FULL> {
    #[inline(always)]
    fn put(&mut self, i: usize, x: T) {
        self.h[self.own * self.nv + i] = x;
        if FULL {
            self.h[i * self.nv + self.own] = x;
        }
    }
}

/// Carries a wrench on body `i` to the root and hands out the joint forces and the base wrench.
#[inline(always)]
pub(crate) fn carry<T: ModelScalar, C: Column<T> + ?Sized>(
    links: &[Link<T>],
    nb: usize,
    mut i: usize,
    mut f: V3<T>,
    mut n: V3<T>,
    to: &mut C,
) -> (V3<T>, V3<T>) {
    while i > 0 {
        let l = &links[i];
        let x;
        (x, (f, n)) =
            dispatch_rotation!(T, l.pose.turn, K => (l.joint_force::<K>(&f, &n), l.pose.wrench_up::<K>(&f, &n)));
        to.put(nb + i - 1, x);
        i = l.parent;
    }
    if nb == 6 {
        for (k, x) in [f.x, f.y, f.z, n.x, n.y, n.z].into_iter().enumerate() {
            to.put(k, x);
        }
    }
    (f, n)
}

/// The host block of a port as a rigid body.
pub(crate) fn host_block<T: ModelScalar>(p: &PortWork<T>) -> Inertia<T> {
    Inertia::from_elements(|i, j| p.mass().get(i, j))
}

/// `H y` for one motion, used by momentum: avoids the full matrix. See [`crate::analysis::momentum`].
pub(crate) fn port_momentum<T: ModelScalar>(p: &PortWork<T>, host: &Motion<T>, nu: &[T]) -> Force<T> {
    let mut w = p.host_inertia(host);
    for (j, &n) in nu.iter().enumerate() {
        w += p.coupling(j).scaled(n);
    }
    w
}
