//! The bias that the energies imply, through the object-safe face of an appendage.
//!
//! The formula of [`ff_model::port::derived_bias`], written a second time over [`PortModel`], because a boxed appendage
//! cannot be passed to a generic function, and because a suite should not trust the code it holds others to.

use ff_model::port::{PortModel, PortView, port_len};
use ff_model::{Dual, Force, Motion, PortMatrix, Scalar};

/// Inertia matrix as rows, over any number type.
pub(super) fn matrix<T: Scalar>(a: &dyn PortModel<T>, p: &[T], eta: &[T]) -> Vec<Vec<T>> {
    // In a buffer that holds other numbers.
    let mut buffer = vec![T::from_f64(-7.3e5); port_len(eta.len())];
    a.inertia(p, eta, &mut PortMatrix::over(eta.len(), &mut buffer));
    PortView::new(eta.len(), &buffer).dense().row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// `h = Mdot y + [V x* (M y)_b; -d(y^T M y / 2)/d eta + dU/d eta + dR/d nu]`, length `6+n`. Allocates.
pub(super) fn bias<T: Scalar>(a: &dyn PortModel<Dual<T, 1>>, p: &[T], host: Motion<T>, eta: &[T], nu: &[T]) -> Vec<T> {
    let n = eta.len();
    let dim = 6 + n;
    let mut y = vec![T::zero(); dim];
    host.write_to(&mut y);
    y[6..].copy_from_slice(nu);
    let p: Vec<Dual<T, 1>> = p.iter().map(|&x| Dual::constant(x)).collect();
    let along = |x: &[T], dx: &dyn Fn(usize) -> T| -> Vec<Dual<T, 1>> {
        x.iter().enumerate().map(|(i, &x)| Dual::new(x, dx(i))).collect()
    };
    let m = matrix(a, &p, &along(eta, &|i| nu[i]));
    let times = |pick: &dyn Fn(&Dual<T, 1>) -> T| -> Vec<T> {
        m.iter().map(|row| row.iter().zip(&y).fold(T::zero(), |s, (m, &y)| s + pick(m) * y)).collect()
    };
    let mut h = times(&|d| d.eps[0]);
    let mut turned = [T::zero(); 6];
    host.cross_force(&Force::from_slice(&times(&|d| d.re))).write_to(&mut turned);
    for i in 0..6 {
        h[i] += turned[i];
    }
    for k in 0..n {
        let unit = |i: usize| if i == k { T::one() } else { T::zero() };
        let at = along(eta, &unit);
        let m = matrix(a, &p, &at);
        let mut twice = T::zero();
        for i in 0..dim {
            for j in 0..dim {
                twice += y[i] * m[i][j].eps[0] * y[j];
            }
        }
        h[6 + k] += a.potential(&p, &at).eps[0] + a.rayleigh(&p, &along(nu, &unit)).eps[0] - twice.scale(0.5);
    }
    h
}
