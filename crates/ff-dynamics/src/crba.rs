//! The mass matrix by the composite-rigid-body algorithm (CRBA).

use crate::state::State;
use crate::tree;
use crate::work::{PortWork, Work};
use ff_lanes::Kernel;
use ff_model::by_turn;
use ff_model::vec3::Ten;
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
    assert_eq!(h.shape(), (model.nv(), model.nv()), "mass matrix shape");
    let sparse = model.appendages().len() + model.nj() > 0;
    T::enter(Crba { model, params, state, work, h: h.as_mut_slice(), sparse });
}

struct Crba<'a, T: ModelScalar> {
    model: &'a Model,
    params: &'a Params<T>,
    state: &'a State<T>,
    work: &'a mut Work<T>,
    h: &'a mut [T],
    sparse: bool,
}

impl<T: ModelScalar> Kernel for Crba<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { model, params, state, work, h, sparse } = self;
        let nv = model.nv();
        tree::place(&mut work.links, &state.q);
        work.port_inertias(model, params, &state.eta);
        if sparse {
            // Pairs of which neither carries the other stay zero.
            for x in h.iter_mut() {
                *x = T::zero();
            }
        }
        composite(params, model, work);
        columns(model, work, |i, j, x| {
            h[i * nv + j] = x;
            h[j * nv + i] = x;
        });
    }
}

/// Composite inertias of all bodies, ports included; needs the poses and `M` of the ports.
#[inline(always)]
pub(crate) fn composite<T: ModelScalar>(params: &Params<T>, model: &Model, work: &mut Work<T>) {
    for (i, l) in work.links.iter_mut().enumerate() {
        l.ic = Ten::from(params.body(i));
    }
    for (ap, p) in model.appendages().iter().zip(&work.ports) {
        work.links[ap.host].ic.add(&p.hung());
    }
    tree::compose(&mut work.links);
}

/// Every element of the mass matrix that can differ from zero, as `set(row, column, value)` with the row a
/// descendant of the column or the same; needs [`composite`]. Ports get their coupling at the base.
#[inline(always)]
pub(crate) fn columns<T: ModelScalar>(model: &Model, work: &mut Work<T>, mut set: impl FnMut(usize, usize, T)) {
    let (nb, nj) = (model.nb(), model.nj());
    let links = &work.links;
    if nb == 6 {
        let Ten { m, h, i } = links[0].ic;
        let z = T::zero();
        for k in 0..3 {
            for l in 0..=k {
                set(k, l, if k == l { m } else { z });
            }
        }
        // [h]x, lower left.
        for (r, row) in [[z, -h.z, h.y], [h.z, z, -h.x], [-h.y, h.x, z]].iter().enumerate() {
            for (c, &x) in row.iter().enumerate() {
                set(3 + r, c, x);
            }
        }
        set(3, 3, i.xx);
        set(4, 3, i.xy);
        set(4, 4, i.yy);
        set(5, 3, i.xz);
        set(5, 4, i.yz);
        set(5, 5, i.zz);
    }
    macro_rules! carry {
        ($row:expr, $at:expr, $f:expr, $n:expr) => {{
            let (row, mut i, mut f, mut n) = ($row, $at, $f, $n);
            while i > 0 {
                (f, n) = tree::inwards(&links[i], &f, &n);
                i = links[i].parent;
                if i > 0 {
                    set(row, nb + i - 1, links[i].force_of(&f, &n));
                }
            }
            if nb == 6 {
                for (c, x) in [f.x, f.y, f.z, n.x, n.y, n.z].into_iter().enumerate() {
                    set(row, c, x);
                }
            }
            (f, n)
        }};
    }
    for i in 1..links.len() {
        let (f, n) = by_turn!(T, links[i].pose.turn, K => links[i].axis_momentum::<K>());
        set(nb + i - 1, nb + i - 1, links[i].force_of(&f, &n));
        carry!(nb + i - 1, i, f, n);
    }
    for (ap, p) in model.appendages().iter().zip(&mut work.ports) {
        let first = nb + nj + ap.coord_offset;
        for j in 0..p.n {
            for l in 0..=j {
                set(first + j, first + l, p.m[(6 + j) * (6 + p.n) + 6 + l]);
            }
            let (f, n) = p.pull(j);
            let (f, n) = p.up(&f, &n);
            if ap.host > 0 {
                set(first + j, nb + ap.host - 1, links[ap.host].force_of(&f, &n));
            }
            p.g[j] = carry!(first + j, ap.host, f, n);
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
