//! The chain's energies, and its bias by hand for speed.
//!
//! Sources: R. Featherstone, *Rigid Body Dynamics Algorithms*, Springer 2008: composite rigid bodies
//! (table 6.2) and recursive Newton-Euler (table 5.1), with the host as the moving root.

use crate::chain::{MAX_SEGMENTS, PanelChain};
use ff_model::small::{cross, mv};
use ff_model::{Appendage, Decl, Force, Inertia, Motion, PortMatrix, PortState, PortVector, Scalar, TwinBody, Xform};

/// Runs `$body` with `$cap` a compile-time capacity of at least `$n`, so that the usual short panels do not
/// clear stack buffers for sixteen segments of derivative-carrying numbers.
macro_rules! with_capacity {
    ($n:expr, $f:ident($($arg:expr),*)) => {
        match $n {
            0..=2 => $f::<T, 2>($($arg),*),
            3..=4 => $f::<T, 4>($($arg),*),
            5..=8 => $f::<T, 8>($($arg),*),
            _ => $f::<T, MAX_SEGMENTS>($($arg),*),
        }
    };
}

impl Appendage for PanelChain {
    fn decl(&self) -> &Decl {
        self.declared()
    }

    /// Kinetic-energy matrix by composite rigid bodies, `O(n^2)`; `(6+n) x (6+n)`, mount frame.
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        with_capacity!(self.count(), composite(self, p, eta, m));
    }

    /// `U = x^T K x / 2` with `x = eta - rest` (J).
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        let mut u = T::zero();
        for i in 0..self.count() {
            let x = eta[i] - T::from_f64(self.hinges[i].rest);
            u += p[self.stiffness_index(i)] * x * x;
        }
        u = u.scale(0.5);
        for (&(i, j), &k) in self.k_pairs.pairs.iter().zip(&p[self.k_pair_offset()..]) {
            let (x, y) = (eta[i] - T::from_f64(self.hinges[i].rest), eta[j] - T::from_f64(self.hinges[j].rest));
            u += k * x * y;
        }
        u
    }

    /// `R = nu^T D nu / 2` (W).
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        let mut r = T::zero();
        for i in 0..self.count() {
            r += p[self.damping_index(i)] * nu[i] * nu[i];
        }
        r = r.scale(0.5);
        for (&(i, j), &d) in self.d_pairs.pairs.iter().zip(&p[self.d_pair_offset()..]) {
            r += d * nu[i] * nu[j];
        }
        r
    }

    /// Recursive Newton-Euler with `A = 0`, `nu' = 0`, plus springs and dampers; `O(n)`.
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        with_capacity!(self.count(), newton_euler(self, p, s, h));
    }

    fn twin(&self) -> Option<Vec<TwinBody>> {
        // A tree link knows only its own spring.
        let plain = self.k_pairs.pairs.is_empty() && self.d_pairs.pairs.is_empty();
        plain.then(|| self.twin_bodies())
    }
}

/// `M` by composite rigid bodies. With `Ic_i` the inertia of segments `i..n` about hinge `i` and
/// `S_i = [0; u_i]`: `M_bb = X Ic_0 X^T`, `F = Ic_i S_i`, `M_ij = S_j . F` carried inwards, `M_bi` = `F` at the
/// mount.
#[inline]
fn composite<T: Scalar, const N: usize>(c: &PanelChain, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
    let n = c.count();
    let mut pose = [Xform::<T>::identity(); N];
    let mut ic = [Inertia::<T>::zero(); N];
    for i in 0..n {
        pose[i] = c.hinges[i].pose(eta[i]);
        ic[i] = Inertia::from_params(&p[c.inertial_offset(i)..]);
    }
    for i in (1..n).rev() {
        let outer = ic[i].to_parent(&pose[i]);
        ic[i - 1] += outer;
    }
    m.add_host(&ic[0].to_parent(&pose[0]));
    for i in 0..n {
        let u = c.hinges[i].times(T::one());
        let mut f = Force::new(cross(&u, &ic[i].h), mv(&ic[i].rot, &u));
        for j in (0..=i).rev() {
            m.set_sym(6 + i, 6 + j, c.hinges[j].along(&f.ang));
            f = pose[j].force_to_parent(&f);
        }
        for k in 0..6 {
            m.set_sym(k, 6 + i, f.get(k));
        }
    }
}

/// `h` by recursive Newton-Euler at zero host and hinge acceleration:
/// `V_i = X V_{i-1} + S nu`, `A_i = X A_{i-1} + V_i x S nu`, `F_i = I A_i + V_i x* I V_i + X^T F_{i+1}`.
///
/// `A` is the componentwise derivative of the body twist, so the host's own `A` is zero, not its classical
/// acceleration; the host's velocity products enter through `V_i x* I V_i`.
#[inline]
fn newton_euler<T: Scalar, const N: usize>(c: &PanelChain, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
    let n = c.count();
    let mut pose = [Xform::<T>::identity(); N];
    let mut force = [Force::<T>::zero(); N];
    let mut v = s.host;
    let mut a = Motion::<T>::zero();
    for i in 0..n {
        let hinge = &c.hinges[i];
        pose[i] = hinge.pose(s.eta[i]);
        let rate = hinge.times(s.nu[i]);
        v = pose[i].motion_to_child(&v);
        a = pose[i].motion_to_child(&a);
        v.ang += rate;
        a.lin += cross(&v.lin, &rate);
        a.ang += cross(&v.ang, &rate);
        let body = Inertia::from_params(&p[c.inertial_offset(i)..]);
        force[i] = body.mul_motion(&a) + v.cross_force(&body.mul_motion(&v));
    }
    let mut f = Force::<T>::zero();
    for i in (0..n).rev() {
        let hinge = &c.hinges[i];
        f += force[i];
        h[6 + i] = hinge.along(&f.ang)
            + p[c.stiffness_index(i)] * (s.eta[i] - T::from_f64(hinge.rest))
            + p[c.damping_index(i)] * s.nu[i];
        f = pose[i].force_to_parent(&f);
    }
    f.write_to(h);
    for (&(i, j), &k) in c.k_pairs.pairs.iter().zip(&p[c.k_pair_offset()..]) {
        h[6 + i] += k * (s.eta[j] - T::from_f64(c.hinges[j].rest));
        h[6 + j] += k * (s.eta[i] - T::from_f64(c.hinges[i].rest));
    }
    for (&(i, j), &d) in c.d_pairs.pairs.iter().zip(&p[c.d_pair_offset()..]) {
        h[6 + i] += d * s.nu[j];
        h[6 + j] += d * s.nu[i];
    }
}
