//! Bias and dissipated power, derived from the three energies by forward differentiation.

use super::declaration::{MAX_COORDS, MAX_PARAMS, MAX_PORT};
use super::energies::Appendage;
use super::matrix::{PortMatrix, port_len};
use super::state::{PortState, PortVector};
use crate::scalar::dual::Dual;
use crate::scalar::traits::Scalar;
use crate::spatial::motion::Force;

/// The bias that follows from the three energies (module docs), by forward differentiation.
///
/// `h` has length `6+n` and is overwritten. Costs `2 + 3n` evaluations over duals; does not allocate.
///
/// # Panics
/// If the appendage declares more than [`MAX_COORDS`] coordinates or [`MAX_PARAMS`] parameters.
pub fn derived_bias<A: Appendage + ?Sized, T: Scalar>(a: &A, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
    type D<T> = Dual<T, 1>;
    let n = s.eta.len();
    let dim = 6 + n;
    let mut buf = [D::<T>::constant(T::zero()); port_len(MAX_COORDS)];
    let mut y = [T::zero(); MAX_PORT];
    s.host.write_to(&mut y);
    y[6..dim].copy_from_slice(s.nu);
    let mut pd_store = [D::<T>::constant(T::zero()); MAX_PARAMS];
    let pd = &mut pd_store[..p.len()];
    for (d, &x) in pd.iter_mut().zip(p) {
        *d = D::constant(x);
    }
    let mut eta = [D::<T>::constant(T::zero()); MAX_COORDS];

    // Along the motion: real part M, dual part dM/dt.
    for i in 0..n {
        eta[i] = Dual::new(s.eta[i], s.nu[i]);
    }
    let mut m = PortMatrix::new(n, &mut buf);
    a.inertia(pd, &eta[..n], &mut m);
    let m = m.view();
    let mut pi = [T::zero(); 6];
    for i in 0..dim {
        let mut acc = T::zero();
        for j in 0..dim {
            acc += m.get(i, j).eps[0] * y[j];
            if i < 6 {
                pi[i] += m.get(i, j).re * y[j];
            }
        }
        h[i] = acc;
    }
    let mut host = [T::zero(); 6];
    s.host.cross_force(&Force::from_slice(&pi)).write_to(&mut host);
    for i in 0..6 {
        h[i] += host[i];
    }
    // Along each coordinate: gradient of U - T; along each rate: gradient of R.
    for k in 0..n {
        for i in 0..n {
            eta[i] = Dual::new(s.eta[i], if i == k { T::one() } else { T::zero() });
        }
        let mut m = PortMatrix::new(n, &mut buf);
        a.inertia(pd, &eta[..n], &mut m);
        let m = m.view();
        let mut yy = T::zero();
        for i in 0..dim {
            for j in 0..dim {
                yy += y[i] * m.get(i, j).eps[0] * y[j];
            }
        }
        let du = a.potential(pd, &eta[..n]).eps[0];
        for i in 0..n {
            eta[i] = Dual::new(s.nu[i], if i == k { T::one() } else { T::zero() });
        }
        let dr = a.rayleigh(pd, &eta[..n]).eps[0];
        h[6 + k] += du + dr - yy.scale(0.5);
    }
}

/// The power that follows from the Rayleigh function, `nu . dR/d nu`, by a dual number along `nu`: the default of
/// [`PortDynamics::dissipated_power`](super::PortDynamics::dissipated_power). Does not allocate.
///
/// # Panics
/// If there are more than [`MAX_COORDS`] rates or [`MAX_PARAMS`] parameters.
pub fn derived_power<A: Appendage + ?Sized, T: Scalar>(a: &A, p: &[T], nu: &[T]) -> T {
    fn sized<A: Appendage + ?Sized, T: Scalar, const N: usize>(a: &A, p: &[T], nu: &[T]) -> T {
        let mut pd = [Dual::<T, 1>::constant(T::zero()); N];
        for (d, &x) in pd.iter_mut().zip(p) {
            *d = Dual::constant(x);
        }
        let mut nd = [Dual::<T, 1>::constant(T::zero()); MAX_COORDS];
        for (d, &x) in nd.iter_mut().zip(nu) {
            *d = Dual::new(x, x);
        }
        a.rayleigh(&pd[..p.len()], &nd[..nu.len()]).eps[0]
    }
    // Most appendages are small, and clearing buffers for the largest would cost more than the power.
    match p.len() {
        0..=8 => sized::<A, T, 8>(a, p, nu),
        9..=32 => sized::<A, T, 32>(a, p, nu),
        _ => sized::<A, T, MAX_PARAMS>(a, p, nu),
    }
}
