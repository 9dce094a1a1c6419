//! The chain's energies, and its bias by hand for speed.
//!
//! Sources: R. Featherstone, *Rigid Body Dynamics Algorithms*, Springer 2008: composite rigid bodies
//! (table 6.2) and recursive Newton-Euler (table 5.1), with the host as the moving root.

use crate::chain::{MAX_SEGMENTS, PanelChain};
use crate::tangent::jacobian;
use ff_model::port::TreeTwin;
use ff_model::scalar::PlainScalar;
use ff_model::spatial::vec3::{M3, Moving, PackedInertia, Pose, RotationKind, V3, turn};
use ff_model::{Appendage, Decl, Motion, PortAccel, PortDynamics, PortMatrix, PortState, PortVector, Scalar};

/// Runs `$f` with a compile-time capacity of at least the number of segments, so that the usual short panels do not
/// clear stack buffers for sixteen, and with what the hinges turn about as a constant of [`turn`]: poses then stay in
/// registers. Two hinges, the most common panel, have a version for each axis; one and three have one version each, since
/// thirteen took longer to compile than the rest of the crate. Numbers with derivatives take `$cold`, the same function
/// not inlined: they are compiled once.
macro_rules! specialised {
    ($c:ident, $f:ident, $cold:ident($($arg:expr),*)) => {
        if T::DERIVATIVES {
            if $c.count() <= 4 {
                $cold::<T, 4, { turn::ANY }>($($arg),*)
            } else {
                $cold::<T, MAX_SEGMENTS, { turn::ANY }>($($arg),*)
            }
        } else {
            match $c.count() {
                1 => $f::<T, 1, { turn::ANY }>($($arg),*),
                2 => by_axis!($c.about, K => $f::<T, 2, K>($($arg),*)),
                3 => $f::<T, 3, { turn::ANY }>($($arg),*),
                _ => $f::<T, MAX_SEGMENTS, { turn::ANY }>($($arg),*),
            }
        }
    };
}

/// As [`ff_model::dispatch_rotation`] for hinges, which all turn.
macro_rules! by_axis {
    ($about:expr, $k:ident => $e:expr) => {
        match $about {
            RotationKind::X => {
                const $k: u8 = turn::X;
                $e
            }
            RotationKind::Y => {
                const $k: u8 = turn::Y;
                $e
            }
            RotationKind::Z => {
                const $k: u8 = turn::Z;
                $e
            }
            RotationKind::None | RotationKind::General => {
                const $k: u8 = turn::ANY;
                $e
            }
        }
    };
}

impl Appendage for PanelChain {
    fn decl(&self) -> &Decl {
        self.declared()
    }

    /// Kinetic-energy matrix by composite rigid bodies, `O(n^2)`; `(6+n) x (6+n)`, mount frame.
    #[inline(always)]
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        specialised!(self, composite, composite_once(self, p, eta, m));
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
    #[inline(always)]
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
}

impl PortDynamics for PanelChain {
    const WRITES_ALL: bool = true;

    /// `R` is quadratic.
    #[inline(always)]
    fn dissipated_power<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        self.rayleigh(p, nu).scale(2.0)
    }

    /// Recursive Newton-Euler with `A = 0`, `nu' = 0`, plus springs and dampers; `O(n)`.
    #[inline(always)]
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        specialised!(self, bias, bias_once(self, p, s, h));
    }

    /// Both from one pass over the poses.
    #[inline(always)]
    fn terms<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>) {
        specialised!(self, terms, terms(self, p, s, m, h));
    }

    /// Recursive Newton-Euler, plus springs and dampers; `O(n)`.
    #[inline(always)]
    fn residual<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        _: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        specialised!(self, residual, residual(self, p, s, acc, r));
    }

    /// Composite bodies with their momenta, in closed form; `O(n^2)` (Singh, Russell, Wensing 2022).
    #[inline(always)]
    fn jacobian<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]) {
        specialised!(self, jacobian, jacobian(self, p, s, acc, j));
    }

    /// Screws of host and hinges carried outwards and contracted with the motion of each segment.
    #[inline(always)]
    fn regressor<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        specialised!(self, regressor, regressor(self, p, s, acc, y));
    }

    fn twin(&self) -> Option<&dyn TreeTwin> {
        Some(self)
    }
}

/// The poses of all segments.
#[inline(always)]
fn poses<T: Scalar, const N: usize, const K: u8>(c: &PanelChain, eta: &[T]) -> [Pose<T>; N] {
    let mut pose = [Pose::<T>::identity(); N];
    let n = if N <= 3 { N } else { c.count() };
    for (x, (h, &e)) in pose[..n].iter_mut().zip(c.hinges[..n].iter().zip(&eta[..n])) {
        h.place::<T, K>(e, x);
    }
    pose
}

#[inline(always)]
fn composite<T: Scalar, const N: usize, const K: u8>(c: &PanelChain, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
    composite_at::<T, N, K>(c, p, &poses::<T, N, K>(c, eta), m);
}

#[inline(always)]
fn bias<T: Scalar, const N: usize, const K: u8>(c: &PanelChain, p: &[T], s: &PortState<'_, T>, h: &mut [T]) {
    let still = [T::zero(); N];
    let acc = PortAccel { host: Motion::zero(), nu: &still[..c.count()] };
    newton_euler::<T, N, K>(c, p, s, &acc, &poses::<T, N, K>(c, s.eta), h);
}

#[inline(never)]
fn composite_once<T: Scalar, const N: usize, const K: u8>(
    c: &PanelChain,
    p: &[T],
    eta: &[T],
    m: &mut PortMatrix<'_, T>,
) {
    composite::<T, N, K>(c, p, eta, m);
}

#[inline(never)]
fn bias_once<T: Scalar, const N: usize, const K: u8>(c: &PanelChain, p: &[T], s: &PortState<'_, T>, h: &mut [T]) {
    bias::<T, N, K>(c, p, s, h);
}

#[inline(always)]
fn terms<T: Scalar, const N: usize, const K: u8>(
    c: &PanelChain,
    p: &[T],
    s: &PortState<'_, T>,
    m: &mut PortMatrix<'_, T>,
    h: &mut [T],
) {
    let pose = poses::<T, N, K>(c, s.eta);
    composite_at::<T, N, K>(c, p, &pose, m);
    let still = [T::zero(); N];
    let acc = PortAccel { host: Motion::zero(), nu: &still[..c.count()] };
    newton_euler::<T, N, K>(c, p, s, &acc, &pose, h);
}

#[inline(always)]
fn residual<T: Scalar, const N: usize, const K: u8>(
    c: &PanelChain,
    p: &[T],
    s: &PortState<'_, T>,
    acc: &PortAccel<'_, T>,
    r: &mut [T],
) {
    newton_euler::<T, N, K>(c, p, s, acc, &poses::<T, N, K>(c, s.eta), r);
}

/// `M` by composite rigid bodies. With `Ic_i` the inertia of segments `i..n` about hinge `i` and
/// `S_i = [0; u_i]`: `M_bb = X Ic_0 X^T`, `F = Ic_i S_i`, `M_ij = S_j . F` carried inwards, `M_bi` = `F` at the
/// mount.
#[inline(always)]
fn composite_at<T: Scalar, const N: usize, const K: u8>(
    c: &PanelChain,
    p: &[T],
    pose: &[Pose<T>; N],
    m: &mut PortMatrix<'_, T>,
) {
    let n = if N <= 3 { N } else { c.count() };
    let mut m = m.expect(n);
    let mut ic = [PackedInertia::<T>::zero(); N];
    for i in 0..n {
        ic[i] = PackedInertia::from_params(&p[c.inertial_offset(i)..]);
    }
    for i in (1..n).rev() {
        let outer = pose[i].body_up::<K>(&ic[i]);
        ic[i - 1].add(&outer);
    }
    m.set_host(&pose[0].body_up::<K>(&ic[0]));
    for i in 0..n {
        let u = &c.hinges[i].axis;
        let (mut f, mut g) = u.momentum::<T, K>(&ic[i].h, &ic[i].i);
        for j in (0..=i).rev() {
            m.set_sym(6 + i, 6 + j, c.hinges[j].axis.along::<T, K>(&g));
            (f, g) = pose[j].wrench_up::<K>(&f, &g);
        }
        m.set_coupling(i, &f, &g);
    }
}

/// Recursive Newton-Euler in classical accelerations (J. Luh, M. Walker, R. Paul 1980), springs and dampers
/// added. The host's velocity enters through the acceleration of its mount point, `A + [w x v; 0]`.
#[inline(always)]
fn newton_euler<T: Scalar, const N: usize, const K: u8>(
    c: &PanelChain,
    p: &[T],
    s: &PortState<'_, T>,
    acc: &PortAccel<'_, T>,
    pose: &[Pose<T>; N],
    h: &mut [T],
) {
    let n = if N <= 3 { N } else { c.count() };
    let (h, hinges) = (&mut h[..6 + n], &c.hinges[..n]);
    let p = &p[..12 * n + c.k_pairs.pairs.len() + c.d_pairs.pairs.len()];
    let mut force = [(V3::<T>::zero(), V3::<T>::zero()); N];
    let mut w = V3::from(&s.host.ang);
    let mut al = V3::from(&acc.host.ang);
    let mut a = w.cross_add(&V3::from(&s.host.lin), &V3::from(&acc.host.lin));
    let mut field = M3::field(&w, &al);
    for i in 0..n {
        let (x, u) = (&pose[i], &hinges[i].axis);
        let at_hinge = field.mul_add(&x.p, &a);
        let carried = x.down::<K>(&w);
        al = u.cross_add::<T, K>(&carried, s.nu[i], x.down::<K>(&al));
        (w, al) = (u.add::<T, K>(carried, s.nu[i]), u.add::<T, K>(al, acc.nu[i]));
        a = x.down::<K>(&at_hinge);
        field = M3::field(&w, &al);
        force[i] = PackedInertia::from_params(&p[c.inertial_offset(i)..]).wrench(&w, &al, &a, &field);
    }
    let (mut f, mut g) = (V3::<T>::zero(), V3::<T>::zero());
    for i in (0..n).rev() {
        let hinge = &hinges[i];
        f += force[i].0;
        g += force[i].1;
        let along = hinge.axis.along::<T, K>(&g);
        (f, g) = pose[i].wrench_up::<K>(&f, &g);
        let spring = p[c.stiffness_index(i)].mul_add(s.eta[i] - T::from_f64(hinge.rest), along);
        h[6 + i] = p[c.damping_index(i)].mul_add(s.nu[i], spring);
    }
    f.write_to(h);
    g.write_to(&mut h[3..]);
    for (&(i, j), &k) in c.k_pairs.pairs.iter().zip(&p[c.k_pair_offset()..]) {
        h[6 + i] += k * (s.eta[j] - T::from_f64(c.hinges[j].rest));
        h[6 + j] += k * (s.eta[i] - T::from_f64(c.hinges[i].rest));
    }
    for (&(i, j), &d) in c.d_pairs.pairs.iter().zip(&p[c.d_pair_offset()..]) {
        h[6 + i] += d * s.nu[j];
        h[6 + j] += d * s.nu[i];
    }
}

/// Columns of the regressor: ten per segment, then springs and dampers. See [`Moving::powers`].
#[inline(always)]
fn regressor<T: PlainScalar, const N: usize, const K: u8>(
    c: &PanelChain,
    p: &[T],
    s: &PortState<'_, T>,
    acc: &PortAccel<'_, T>,
    y: &mut [T],
) {
    let n = if N <= 3 { N } else { c.count() };
    let dim = 6 + n;
    let y = &mut y[..p.len() * dim];
    // Screws of the host's translation (axes alone) and rotation, and of the hinges.
    let none = (V3::<T>::zero(), V3::<T>::zero());
    let (mut axes, mut turns, mut hinge) = ([none.0; 3], [none; 3], [none; N]);
    for k in 0..3 {
        let mut e = [T::zero(); 3];
        e[k] = T::one();
        (axes[k], turns[k].1) = (V3::from_slice(&e), V3::from_slice(&e));
    }
    let mut w = V3::from(&s.host.ang);
    let mut al = V3::from(&acc.host.ang);
    let mut a = w.cross_add(&V3::from(&s.host.lin), &V3::from(&acc.host.lin));
    let mut field = M3::field(&w, &al);
    for i in 0..n {
        let (mut x, u) = (Pose::identity(), &c.hinges[i].axis);
        c.hinges[i].place::<T, K>(s.eta[i], &mut x);
        let at_hinge = field.mul_add(&x.p, &a);
        let carried = x.down::<K>(&w);
        al = u.cross_add::<T, K>(&carried, s.nu[i], x.down::<K>(&al));
        (w, al) = (u.add::<T, K>(carried, s.nu[i]), u.add::<T, K>(al, acc.nu[i]));
        a = x.down::<K>(&at_hinge);
        for v in &mut axes {
            *v = x.down::<K>(v);
        }
        for (v, w) in turns.iter_mut().chain(&mut hinge[..i]) {
            (*v, *w) = x.screw_down::<K>(v, w);
        }
        hinge[i] = (V3::zero(), u.add::<T, K>(V3::zero(), T::one()));
        field = M3::field(&w, &al);
        let motion = Moving { w, al, a, field };
        let block = &mut y[10 * i * dim..(10 * i + 10) * dim];
        for (r, v) in axes.iter().enumerate() {
            let x = motion.pushes(v);
            for k in 0..4 {
                block[k * dim + r] = x[k];
            }
        }
        for (r, (v, w)) in turns.iter().chain(&hinge[..=i]).enumerate() {
            let x = motion.powers(v, w);
            for k in 0..10 {
                block[k * dim + 3 + r] = x[k];
            }
        }
        // What is left: translation against moments of inertia, and hinges further out. Each number is written once.
        for (k, column) in block.chunks_exact_mut(dim).enumerate() {
            let (front, behind) = column.split_at_mut(7 + i);
            for x in front[..if k < 4 { 0 } else { 3 }].iter_mut().chain(behind) {
                *x = T::zero();
            }
        }
    }
    for x in &mut y[10 * n * dim..] {
        *x = T::zero();
    }
    let bend = |i: usize| s.eta[i] - T::from_f64(c.hinges[i].rest);
    for i in 0..n {
        y[c.stiffness_index(i) * dim + 6 + i] = bend(i);
        y[c.damping_index(i) * dim + 6 + i] = s.nu[i];
    }
    for (l, &(i, j)) in c.k_pairs.pairs.iter().enumerate() {
        y[(c.k_pair_offset() + l) * dim + 6 + i] = bend(j);
        y[(c.k_pair_offset() + l) * dim + 6 + j] = bend(i);
    }
    for (l, &(i, j)) in c.d_pairs.pairs.iter().enumerate() {
        y[(c.d_pair_offset() + l) * dim + 6 + i] = s.nu[j];
        y[(c.d_pair_offset() + l) * dim + 6 + j] = s.nu[i];
    }
}
