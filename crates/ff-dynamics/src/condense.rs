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
//! appendages; what is left is 6 x 6. Nothing allocates.

use crate::ldl;
use crate::work::PortWork;
use ff_model::vec3::{Ten, V3};
use ff_model::{ModelScalar, PortView};

/// Classical acceleration of the base origin and angular acceleration. Reads `m`, `r` and `g` of the ports, writes
/// `gain` and `free`.
///
/// # Errors
/// The port whose own mass matrix is not positive definite, or `None` for the base.
#[inline(always)]
pub(crate) fn base_acceleration<T: ModelScalar>(
    ports: &mut [PortWork<T>],
    c: &Ten<T>,
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
fn rigid<T: ModelScalar>(c: &Ten<T>) -> [[T; 6]; 6] {
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

/// The mass matrix of base and passive coordinates, factorised for many right-hand sides.
#[derive(Clone, Debug)]
pub(crate) struct Factor<T> {
    /// `C - sum G M_ee^-1 G^T` as [`ldl::factor_fixed`] leaves it.
    base: [[T; 6]; 6],
}

impl<T: ModelScalar> Factor<T> {
    pub(crate) fn new() -> Self {
        Self { base: [[T::zero(); 6]; 6] }
    }
    /// From the composite inertia; reads `m` and `g` of the ports, writes their `gain` and `ee`. False where a pivot is
    /// not positive.
    #[inline(always)]
    pub(crate) fn set(&mut self, ports: &mut [PortWork<T>], c: &Ten<T>) -> bool {
        let (mut s, mut b, mut ok) = (rigid(c), [T::zero(); 6], true);
        for p in ports.iter_mut() {
            p.r.fill(T::zero());
            ok &= eliminate_port(p, &mut s, &mut b);
            p.invert();
        }
        ok &= ldl::factor_fixed(&mut s);
        self.base = s;
        ok
    }
    /// Minus the solution for a right-hand side `[base 6 | passive]` into `x`. Passive rows other than those of port
    /// `only` are zero, if given; of all ports otherwise.
    #[inline(always)]
    pub(crate) fn solve_minus(
        &self,
        ports: &[PortWork<T>],
        offsets: &[usize],
        only: Option<usize>,
        rhs: &[T],
        x: &mut [T],
    ) {
        let mut b = [rhs[0], rhs[1], rhs[2], rhs[3], rhs[4], rhs[5]];
        for (k, (p, &at)) in ports.iter().zip(offsets).enumerate() {
            if only.is_some_and(|only| only != k) {
                continue;
            }
            for i in 0..p.n {
                let (e, g) = (-rhs[6 + at + i], &p.gain[6 * i..6 * i + 6]);
                for r in 0..6 {
                    b[r] = g[r].mul_add(e, b[r]);
                }
            }
        }
        ldl::solve_fixed(&self.base, &mut b);
        for (k, (p, &at)) in ports.iter().zip(offsets).enumerate() {
            let own = only.is_none_or(|only| only == k);
            match p.n {
                1 => p.back::<1>(&b, own, &rhs[6 + at..], &mut x[6 + at..]),
                2 => p.back::<2>(&b, own, &rhs[6 + at..], &mut x[6 + at..]),
                3 => p.back::<3>(&b, own, &rhs[6 + at..], &mut x[6 + at..]),
                _ => p.back_any(&b, own, &rhs[6 + at..], &mut x[6 + at..]),
            }
        }
        for r in 0..6 {
            x[r] = -b[r];
        }
    }
}

impl<T: ModelScalar> PortWork<T> {
    /// `M_ee^-1` into `ee`.
    #[inline(always)]
    fn invert(&mut self) {
        let n = self.n;
        let mut l = [T::zero(); ff_model::MAX_COORDS * ff_model::MAX_COORDS];
        for i in 0..n {
            for j in 0..=i {
                l[i * n + j] = self.mass().own(i, j);
            }
        }
        ldl::factor_inverted(&mut l[..n * n], n);
        for j in 0..n {
            let column = &mut self.ee[j * n..(j + 1) * n];
            column.fill(T::zero());
            column[j] = T::one();
            ldl::solve_inverted(&l[..n * n], n, column);
        }
    }
    /// `x = gain b - M_ee^-1 rhs`, the second term where the right-hand side has `own` rows.
    #[inline(always)]
    fn back<const N: usize>(&self, b: &[T; 6], own: bool, rhs: &[T], x: &mut [T]) {
        let mut y = [T::zero(); N];
        for i in 0..N {
            let g = &self.gain[6 * i..6 * i + 6];
            for r in 0..6 {
                y[i] = g[r].mul_add(b[r], y[i]);
            }
        }
        if own {
            for i in 0..N {
                for j in 0..N {
                    y[i] = (-self.ee[i * N + j]).mul_add(rhs[j], y[i]);
                }
            }
        }
        x[..N].copy_from_slice(&y);
    }
    /// [`PortWork::back`] for any number of coordinates.
    #[inline(always)]
    fn back_any(&self, b: &[T; 6], own: bool, rhs: &[T], x: &mut [T]) {
        let mut y = [T::zero(); ff_model::MAX_COORDS];
        for (i, y) in y.iter_mut().enumerate().take(self.n) {
            for r in 0..6 {
                *y = self.gain[6 * i + r].mul_add(b[r], *y);
            }
            for j in 0..if own { self.n } else { 0 } {
                *y = (-self.ee[i * self.n + j]).mul_add(rhs[j], *y);
            }
        }
        x[..self.n].copy_from_slice(&y[..self.n]);
    }
}

/// The same for an appendage on something that does not move. False if its mass matrix is not positive definite.
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
    let mut x = [T::zero(); ff_model::MAX_COORDS];
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
