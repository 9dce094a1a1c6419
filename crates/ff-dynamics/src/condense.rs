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
use ff_model::ModelScalar;
use ff_model::vec3::{Ten, V3};

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
    let z = T::zero();
    let (h, i) = (&c.h, &c.i);
    let mut s = [
        [c.m, z, z, z, h.z, -h.y],
        [z, c.m, z, -h.z, z, h.x],
        [z, z, c.m, h.y, -h.x, z],
        [z, -h.z, h.y, i.xx, i.xy, i.xz],
        [h.z, z, -h.x, i.xy, i.yy, i.yz],
        [-h.y, h.x, z, i.xz, i.yz, i.zz],
    ];
    let mut b = [-f.x, -f.y, -f.z, -n.x, -n.y, -n.z];
    for (k, p) in ports.iter_mut().enumerate() {
        let ok = match p.n {
            0 => true,
            1 => eliminate::<T, 1>(p, &mut s, &mut b),
            2 => eliminate::<T, 2>(p, &mut s, &mut b),
            3 => eliminate::<T, 3>(p, &mut s, &mut b),
            4 => eliminate::<T, 4>(p, &mut s, &mut b),
            _ => eliminate_any(p, &mut s, &mut b),
        };
        if !ok {
            return Err(Some(k));
        }
    }
    if !ldl::factor_fixed(&mut s) {
        return Err(None);
    }
    ldl::solve_fixed(&s, &mut b);
    Ok((V3::from_slice(&b), V3::from_slice(&b[3..])))
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
    for i in 0..N {
        for j in 0..=i {
            m[i][j] = p.m[(6 + i) * (6 + N) + 6 + j];
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
    let g: [[T; 6]; N] = core::array::from_fn(|k| {
        let (f, n) = &p.g[k];
        [f.x, f.y, f.z, n.x, n.y, n.z]
    });
    for c in 0..6 {
        let mut x: [T; N] = core::array::from_fn(|k| g[k][c]);
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
            p.ee[i * n + j] = p.m[(6 + i) * (6 + n) + 6 + j];
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
