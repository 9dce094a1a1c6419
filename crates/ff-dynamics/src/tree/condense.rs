//! Base equations with the appendages eliminated one by one.
//!
//! With `C` the composite inertia of everything rigid, `G` the appendages' coupling at the base, `e` their residuals
//! and `f` the wrench at zero base acceleration,
//!
//! ```text
//! (C - sum G M_ee^-1 G^T) A = -f + sum G M_ee^-1 e,     nu' = -M_ee^-1 (e + G^T A).
//! ```
//!
//! Passive coordinates are unknowns of their own appendage alone, so that the solve costs `O(n)` in the number of
//! appendages; what is left is 6 x 6.
//!
//! For many right-hand sides `(r_b, r_e)` at once [`Inverse`] has `S^-1` of `S = C - sum G M_ee^-1 G^T`, `M_ee^-1 G^T` and
//! `M_ee^-1`: `x_b = S^-1 (r_b - sum G M_ee^-1 r_e)`, `x_e = M_ee^-1 r_e - M_ee^-1 G^T x_b`. Nothing allocates but its `new`.

use crate::linalg::ldl;
use crate::linalg::rows::{RowTask, accumulate, by_rows};
use crate::work::port_work::PortWork;
use core::convert::identity;
use ff_model::Model;
use ff_model::port::PortView;
use ff_model::scalar::ModelScalar;
use ff_model::spatial::vec3::{PackedInertia, V3};
use ff_model::tree::Mounted;

/// Classical acceleration of the base origin and angular acceleration. Reads `m`, `r` and `g` of the ports, writes
/// `gain` and `free`.
///
/// # Errors
/// The port whose own mass matrix is not positive definite, or `None` for the base.
#[inline(always)]
pub(crate) fn base_acceleration<T: ModelScalar>(
    ports: &mut [PortWork<T>],
    c: &PackedInertia<T>,
    f: &V3<T>,
    n: &V3<T>,
) -> Result<(V3<T>, V3<T>), Option<usize>> {
    let mut s = rigid(c);
    let mut b = [-f.x, -f.y, -f.z, -n.x, -n.y, -n.z];
    for (k, p) in ports.iter_mut().enumerate() {
        if !eliminate_port(p, &mut s, &mut b) {
            return Err(Some(k));
        }
    }
    if !ldl::factor_fixed(&mut s) {
        return Err(None);
    }
    ldl::solve_fixed(&s, &mut b);
    Ok((V3::from_slice(&b), V3::from_slice(&b[3..])))
}

/// The 6 x 6 inertia of a rigid body, linear part first.
#[inline(always)]
fn rigid<T: ModelScalar>(c: &PackedInertia<T>) -> [[T; 6]; 6] {
    let z = T::zero();
    let (h, i) = (&c.h, &c.i);
    [
        [c.m, z, z, z, h.z, -h.y],
        [z, c.m, z, -h.z, z, h.x],
        [z, z, c.m, h.y, -h.x, z],
        [z, -h.z, h.y, i.xx, i.xy, i.xz],
        [h.z, z, -h.x, i.xy, i.yy, i.yz],
        [-h.y, h.x, z, i.xz, i.yz, i.zz],
    ]
}

#[inline(always)]
fn eliminate_port<T: ModelScalar>(p: &mut PortWork<T>, s: &mut [[T; 6]; 6], b: &mut [T; 6]) -> bool {
    match p.n {
        0 => true,
        1 => eliminate::<T, 1>(p, s, b),
        2 => eliminate::<T, 2>(p, s, b),
        3 => eliminate::<T, 3>(p, s, b),
        4 => eliminate::<T, 4>(p, s, b),
        _ => eliminate_any(p, s, b),
    }
}

/// Passive rows of a right-hand side that can be other than zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OwnRows {
    None,
    /// Those of one port.
    Port(usize),
    All,
}

/// Minus the inverse of the mass matrix of base and passive coordinates, in parts, for many right-hand sides.
///
/// With this many, an inverse is cheaper than a factorisation: its products do not wait for one another.
#[derive(Clone, Debug)]
pub(crate) struct Inverse<T> {
    /// `-(C - sum G M_ee^-1 G^T)^-1`, which is symmetric.
    base: [[T; 6]; 6],
    /// `-M_ee^-1 G^T` of all passive coordinates, `m x 6`, column by column.
    gain: Vec<T>,
    ports: Vec<OwnInverse<T>>,
}

/// `-M_ee^-1` of a port, `n x n`, and its first passive coordinate.
#[derive(Clone, Debug)]
struct OwnInverse<T> {
    first: usize,
    n: usize,
    inverse: Vec<T>,
}

impl<T: ModelScalar> Inverse<T> {
    pub(crate) fn new(model: &Model) -> Self {
        let z = T::zero();
        let own = |a: &Mounted| OwnInverse { first: a.coord_offset, n: a.dim(), inverse: vec![z; a.dim() * a.dim()] };
        Self { base: [[z; 6]; 6], gain: vec![z; 6 * model.np()], ports: model.appendages().iter().map(own).collect() }
    }
    /// From the composite inertia; reads `m` and `g` of the ports, overwrites the rest of what elimination leaves in them. False
    /// where a pivot is not positive; the inverse is then meaningless.
    #[inline(always)]
    pub(crate) fn set(&mut self, ports: &mut [PortWork<T>], c: &PackedInertia<T>) -> bool {
        let (mut s, mut b, mut ok) = (rigid(c), [T::zero(); 6], true);
        let m = self.gain.len() / 6;
        for (p, own) in ports.iter_mut().zip(&mut self.ports) {
            p.r.fill(T::zero());
            ok &= eliminate_port(p, &mut s, &mut b);
            for i in 0..p.n {
                for k in 0..6 {
                    self.gain[k * m + own.first + i] = -p.gain[6 * i + k];
                }
            }
            own.set(p);
        }
        ok &= ldl::factor_fixed(&mut s);
        for (k, column) in self.base.iter_mut().enumerate() {
            *column = [T::zero(); 6];
            column[k] = -T::one();
            ldl::solve_fixed(&s, column);
        }
        ok
    }
    /// Minus the solutions for `W` right-hand sides `[base 6 | passive]` into `x`, columns of length `6 + m` one after another.
    /// Passive rows of the right-hand sides other than `own` are zero.
    #[inline(always)]
    pub(crate) fn solve_minus<const W: usize>(&self, own: OwnRows, rhs: &[T], x: &mut [T]) {
        let m = self.gain.len() / 6;
        let n = 6 + m;
        let (rhs, x) = (&rhs[..W * n], &mut x[..W * n]);
        let (ports, passive) = match own {
            OwnRows::None => (0..0, 0..0),
            OwnRows::Port(k) => (k..k + 1, self.ports[k].first..self.ports[k].first + self.ports[k].n),
            OwnRows::All => (0..self.ports.len(), 0..m),
        };
        let mut b = [[T::zero(); W]; 6];
        for w in 0..W {
            let column = &rhs[w * n..w * n + 6];
            for r in 0..6 {
                b[r][w] = column[r];
            }
        }
        for i in passive {
            for w in 0..W {
                let e = rhs[w * n + 6 + i];
                for r in 0..6 {
                    b[r][w] = self.gain[r * m + i].mul_add(e, b[r][w]);
                }
            }
        }
        let mut y = [[T::zero(); W]; 6];
        accumulate(&mut y, identity, self.base.as_flattened(), 6, 0, &b);
        for w in 0..W {
            let column = &mut x[w * n..w * n + 6];
            for r in 0..6 {
                column[r] = y[r][w];
            }
        }
        by_rows::<W>(0..m, &mut Passive { gain: &self.gain, y: &y, x });
        for p in &self.ports[ports] {
            for i in 0..p.n {
                for j in 0..p.n {
                    let e = p.inverse[i * p.n + j];
                    for w in 0..W {
                        let at = w * n + 6 + p.first;
                        x[at + i] = e.mul_add(rhs[at + j], x[at + i]);
                    }
                }
            }
        }
    }
}

/// Passive rows of solutions for the rows `y` of the base: `x = gain y`.
struct Passive<'a, T, const W: usize> {
    gain: &'a [T],
    y: &'a [[T; W]; 6],
    x: &'a mut [T],
}

impl<T: ModelScalar, const W: usize> RowTask for Passive<'_, T, W> {
    #[inline(always)]
    fn rows<const R: usize>(&mut self, from: usize) {
        let m = self.gain.len() / 6;
        let mut s = [[T::zero(); W]; R];
        accumulate(&mut s, identity, self.gain, m, from, self.y);
        for w in 0..W {
            let x = &mut self.x[w * (6 + m) + 6 + from..][..R];
            for r in 0..R {
                x[r] = s[r][w];
            }
        }
    }
}

impl<T: ModelScalar> OwnInverse<T> {
    /// Reads `m` of the port; its `ee` is a buffer.
    #[inline(always)]
    fn set(&mut self, p: &mut PortWork<T>) {
        let n = self.n;
        for i in 0..n {
            for j in 0..=i {
                p.ee[i * n + j] = p.mass().own(i, j);
            }
        }
        ldl::factor_inverted(&mut p.ee, n);
        for (j, column) in self.inverse.chunks_exact_mut(n.max(1)).enumerate() {
            column.fill(T::zero());
            column[j] = -T::one();
            ldl::solve_inverted(&p.ee, n, column);
        }
    }
}

/// [`eliminate`] for an appendage on something that does not move. False if its mass matrix is not positive definite.
#[inline(always)]
pub(crate) fn alone<T: ModelScalar>(p: &mut PortWork<T>) -> bool {
    eliminate_any(p, &mut [[T::zero(); 6]; 6], &mut [T::zero(); 6])
}

impl<T: ModelScalar> PortWork<T> {
    /// Own accelerations once those of the base (classical, angular) are known.
    #[inline(always)]
    pub(crate) fn respond(&self, base: Option<(&V3<T>, &V3<T>)>, passive: &mut [T]) {
        for i in 0..self.n {
            let mut x = self.free[i];
            if let Some((a, al)) = base {
                let g = &self.gain[6 * i..6 * i + 6];
                x -= V3::from_slice(g).dot(a) + V3::from_slice(&g[3..]).dot(al);
            }
            passive[i] = x;
        }
    }
}

/// Takes an appendage with `N` coordinates out of the base equations: `S -= G M_ee^-1 G^T`,
/// `b += G M_ee^-1 e`. Keeps `gain = M_ee^-1 G^T` and `free = -M_ee^-1 e`. False if `M_ee` is not positive
/// definite.
#[inline(always)]
fn eliminate<T: ModelScalar, const N: usize>(p: &mut PortWork<T>, s: &mut [[T; 6]; 6], b: &mut [T; 6]) -> bool {
    let mut m = [[T::zero(); N]; N];
    let of = PortView::new(N, &p.m);
    for i in 0..N {
        for j in 0..=i {
            m[i][j] = of.own(i, j);
        }
    }
    if !ldl::factor_fixed(&mut m) {
        return false;
    }
    let mut free = [T::zero(); N];
    for i in 0..N {
        free[i] = -p.r[6 + i];
    }
    ldl::solve_fixed(&m, &mut free);
    // Loops, not `array::map`, which is a function of its own: see `ff-lanes`.
    let mut g = [[T::zero(); 6]; N];
    for (g, (f, n)) in g.iter_mut().zip(&p.g) {
        *g = [f.x, f.y, f.z, n.x, n.y, n.z];
    }
    for c in 0..6 {
        let mut x = [T::zero(); N];
        for k in 0..N {
            x[k] = g[k][c];
        }
        ldl::solve_fixed(&m, &mut x);
        for k in 0..N {
            p.gain[6 * k + c] = x[k];
        }
        // Lower triangle, which is all the factorisation reads.
        for r in c..6 {
            for k in 0..N {
                s[r][c] = (-g[k][r]).mul_add(x[k], s[r][c]);
            }
        }
    }
    for k in 0..N {
        p.free[k] = free[k];
        for r in 0..6 {
            b[r] = (-g[k][r]).mul_add(free[k], b[r]);
        }
    }
    true
}

/// [`eliminate`] for any number of coordinates.
#[inline(always)]
fn eliminate_any<T: ModelScalar>(p: &mut PortWork<T>, s: &mut [[T; 6]; 6], b: &mut [T; 6]) -> bool {
    let n = p.n;
    for i in 0..n {
        for j in 0..n {
            p.ee[i * n + j] = p.mass().own(i, j);
        }
        p.free[i] = -p.r[6 + i];
    }
    if !ldl::factor(&mut p.ee, n) {
        return false;
    }
    ldl::solve(&p.ee, n, &mut p.free);
    let row = |g: &(V3<T>, V3<T>)| [g.0.x, g.0.y, g.0.z, g.1.x, g.1.y, g.1.z];
    let mut x = [T::zero(); ff_model::port::MAX_COORDS];
    for c in 0..6 {
        for k in 0..n {
            x[k] = row(&p.g[k])[c];
        }
        ldl::solve(&p.ee, n, &mut x[..n]);
        for k in 0..n {
            p.gain[6 * k + c] = x[k];
            let g = row(&p.g[k]);
            for r in c..6 {
                s[r][c] -= g[r] * x[k];
            }
        }
    }
    for k in 0..n {
        let g = row(&p.g[k]);
        for r in 0..6 {
            b[r] -= g[r] * p.free[k];
        }
    }
    true
}
