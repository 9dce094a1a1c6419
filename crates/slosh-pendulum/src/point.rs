//! Port equations of a point mass, from its place in the mount frame: for speed alone, see [`crate::particle`].
//!
//! A mass `m` at `r(eta)` feels, with the velocity `v`, angular velocity `w` and accelerations `A`, `al` of the mount,
//!
//! ```text
//! a = A + w x c + al x r + r'',   c = v + w x r + 2 r',   r' = sum d_k nu_k,   d_k = dr/d eta_k
//! f = m a      n = r x f      own row k: d_k . f + k_k eta_k + d_k nu_k
//! ```
//!
//! The velocity of the mount enters through its acceleration in an inertial frame, `A + w x v`, alone.

use crate::slot::Slot;
use ff_model::spatial::vec3::{M3, PackedInertia, S3, V3, array};
use ff_model::{PortAccel, PortMatrix, PortState, Scalar};

/// Motion of the mount, and own rates and accelerations of one mass.
#[derive(Clone, Copy)]
pub(crate) struct Drive<T, const N: usize> {
    pub(crate) v: V3<T>,
    pub(crate) w: V3<T>,
    pub(crate) nu: [T; N],
    /// `A`, `al` and own accelerations; none of them where a bias is asked for.
    pub(crate) acc: Option<(V3<T>, V3<T>, [T; N])>,
}

impl<T: Scalar, const N: usize> Drive<T, N> {
    /// The part of a port's motion that belongs to the coordinates from `eta0` on.
    #[inline(always)]
    pub(crate) fn new(s: &PortState<'_, T>, acc: Option<&PortAccel<'_, T>>, eta0: usize) -> Self {
        let pick = |x: &[T]| {
            let x = &x[eta0..eta0 + N];
            array(T::zero(), |k| x[k])
        };
        let acc = acc.map(|a| (V3::from(&a.host.lin), V3::from(&a.host.ang), pick(a.nu)));
        Self { v: V3::from(&s.host.lin), w: V3::from(&s.host.ang), nu: pick(s.nu), acc }
    }
    /// Own accelerations, if there are any.
    #[inline(always)]
    fn own(&self) -> Option<&[T; N]> {
        self.acc.as_ref().map(|a| &a.2)
    }
    /// Acceleration of the mass without that of the mount itself, and `c`, for the mass at `r` with own velocity and
    /// acceleration `rate` and `lift`.
    #[inline(always)]
    pub(crate) fn carry(&self, r: &V3<T>, rate: &V3<T>, lift: &V3<T>) -> (V3<T>, V3<T>) {
        let c = self.w.cross_add(r, &rate.scale_add(T::from_f64(2.0), &self.v));
        let a = self.w.cross_add(&c, lift);
        (if let Some((_, al, _)) = &self.acc { al.cross_add(r, &a) } else { a }, c)
    }
    /// Adds the acceleration `A` of the mount.
    #[inline(always)]
    pub(crate) fn on(&self, a: V3<T>) -> V3<T> {
        if let Some((host, ..)) = &self.acc { *host + a } else { a }
    }
    /// `[al]x + [w]x^2`.
    #[inline(always)]
    pub(crate) fn field(&self) -> M3<T> {
        M3::field(&self.w, &self.acc.map_or(V3::zero(), |a| a.1))
    }
}

/// Force, moment about the mount, and own generalised forces.
#[derive(Clone, Copy)]
pub(crate) struct Push<T, const N: usize> {
    pub(crate) f: V3<T>,
    pub(crate) n: V3<T>,
    pub(crate) own: [T; N],
}

impl<T: Scalar, const N: usize> Push<T, N> {
    /// Into column `c` of the slot's own columns in `to`, springs not included.
    #[inline(always)]
    fn write(&self, slot: &Slot, column: &mut [T]) {
        self.f.write_to(column);
        self.n.write_to(&mut column[3..]);
        column[6 + slot.eta0..6 + slot.eta0 + N].copy_from_slice(&self.own);
    }
}

/// Force and moment about the mount.
pub(crate) type Wrench<T> = (V3<T>, V3<T>);
/// Columns of `M_be` and the diagonal of `M_ee`.
pub(crate) type Coupling<T, const N: usize> = ([Wrench<T>; N], [T; N]);

/// A place of a point mass that moves with `N` coordinates and depends on `P` parameters, the mass included.
pub(crate) trait Place<T: Scalar, const N: usize, const P: usize> {
    /// `r` (m).
    fn r(&self) -> V3<T>;
    /// What a force on the mass does: `(f, r x f, d_k . f)`.
    fn push(&self, f: V3<T>) -> Push<T, N>;
    /// `r'` and `r''`; without own accelerations the part of `r''` that comes from the rates.
    fn motion(&self, nu: &[T; N], acc: Option<&[T; N]>) -> Wrench<T>;
    /// Columns of `M_be` as force and moment, and the diagonal of `M_ee`, for a mass `m`. `M_ee` is diagonal: the
    /// directions `d_k` are at right angles.
    fn coupling(&self, m: T) -> Coupling<T, N>;
    /// `d a / d eta_k` at fixed rates and accelerations.
    fn by_coordinate(&self, drive: &Drive<T, N>) -> [V3<T>; N];
    /// `d a / d nu_k = 2 (w x d_k + d_k')`.
    fn by_rate(&self, drive: &Drive<T, N>) -> [V3<T>; N];
    /// Adds what a constant force does differently at another place: column `k` gets `(0, d_k x f, d^2 r/(d eta_l d
    /// eta_k) . f)`.
    fn shift(&self, f: &V3<T>, columns: &mut [Push<T, N>; N]);
    /// Derivatives of the push of the mass `m` with respect to the mass and the other parameters of the place.
    fn by_parameter(&self, m: T, drive: &Drive<T, N>) -> [Push<T, N>; P];
}

/// Writes a wrench to the host rows.
#[inline(always)]
pub(crate) fn press<T: Scalar>((f, n): &Wrench<T>, r: &mut [T]) {
    f.write_to(r);
    n.write_to(&mut r[3..]);
}

/// Writes the wrenches of the first columns of length `dim`.
#[inline(always)]
pub(crate) fn press_each<T: Scalar>(wrenches: &[Wrench<T>], dim: usize, j: &mut [T]) {
    for (k, w) in wrenches.iter().enumerate() {
        press(w, &mut j[k * dim..(k + 1) * dim]);
    }
}

/// A point mass as ten inertial parameters about the mount.
#[inline(always)]
pub(crate) fn point<T: Scalar>(m: T, r: &V3<T>) -> PackedInertia<T> {
    let h = r.scaled(m);
    let (xx, yy, zz) = (h.x * r.x, h.y * r.y, h.z * r.z);
    let i = S3 { xx: yy + zz, xy: -(h.x * r.y), yy: xx + zz, xz: -(h.x * r.z), yz: -(h.y * r.z), zz: xx + yy };
    PackedInertia { m, h, i }
}

/// Writes the own rows and columns of `M` and returns what belongs to the host block.
#[inline(always)]
pub(crate) fn inertia<T: Scalar, const N: usize, const P: usize>(
    x: &impl Place<T, N, P>,
    slot: &Slot,
    p: &[T],
    m: &mut PortMatrix<'_, T>,
) -> PackedInertia<T> {
    let mass = p[slot.p0];
    let (pull, own) = x.coupling(mass);
    for (k, (f, n)) in pull.iter().enumerate() {
        let at = slot.eta0 + k;
        m.set_coupling(at, f, n);
        for other in 0..at {
            m.set_sym(6 + at, 6 + other, T::zero());
        }
        m.set_sym(6 + at, 6 + at, own[k]);
    }
    point(mass, &x.r())
}

/// Writes the own rows of the residual, or of the bias, and returns the wrench.
#[inline(always)]
pub(crate) fn residual<T: Scalar, const N: usize, const P: usize>(
    x: &impl Place<T, N, P>,
    slot: &Slot,
    p: &[T],
    s: &PortState<'_, T>,
    acc: Option<&PortAccel<'_, T>>,
    r: &mut [T],
) -> Wrench<T> {
    let drive = Drive::new(s, acc, slot.eta0);
    let (rate, lift) = x.motion(&drive.nu, drive.own());
    let a = drive.on(drive.carry(&x.r(), &rate, &lift).0);
    let push = x.push(a.scaled(p[slot.p0]));
    let (k, d) = (&p[slot.k0..slot.k0 + N], &p[slot.k0 + N..slot.k0 + 2 * N]);
    let (eta, r) = (&s.eta[slot.eta0..slot.eta0 + N], &mut r[6 + slot.eta0..6 + slot.eta0 + N]);
    for i in 0..N {
        r[i] = d[i].mul_add(drive.nu[i], k[i].mul_add(eta[i], push.own[i]));
    }
    (push.f, push.n)
}

/// Writes the columns of coordinates and rates, and the own rows of the three columns of the host's angular velocity,
/// whose wrenches are returned. What a column holds besides must be zero already.
#[inline(always)]
pub(crate) fn jacobian<T: Scalar, const N: usize, const P: usize>(
    x: &impl Place<T, N, P>,
    slot: &Slot,
    p: &[T],
    s: &PortState<'_, T>,
    acc: &PortAccel<'_, T>,
    j: &mut [T],
) -> [Wrench<T>; 3] {
    let (n, m) = (s.eta.len(), p[slot.p0]);
    let dim = 6 + n;
    let drive = Drive::new(s, Some(acc), slot.eta0);
    let (rate, lift) = x.motion(&drive.nu, drive.own());
    let r = x.r();
    let (a, c) = drive.carry(&r, &rate, &lift);
    let f = drive.on(a).scaled(m);
    // d a / d w_i = e_i x c + w x (e_i x r) = e_i x c + e_i (w . r) - r w_i.
    let (mc, mr, wr) = (c.scaled(m), r.scaled(m), r.dot(&drive.w) * m);
    let w = &drive.w;
    let by_spin = [
        mr.scale_add(-w.x, &V3::new(wr, -mc.z, mc.y)),
        mr.scale_add(-w.y, &V3::new(mc.z, wr, -mc.x)),
        mr.scale_add(-w.z, &V3::new(-mc.y, mc.x, wr)),
    ];
    // Loops: closures of some size are not inlined into code for lanes.
    let mut spin = [(V3::zero(), V3::zero()); 3];
    for (i, (spin, by)) in spin.iter_mut().zip(&by_spin).enumerate() {
        let push: Push<T, N> = x.push(*by);
        j[i * dim + 6 + slot.eta0..i * dim + 6 + slot.eta0 + N].copy_from_slice(&push.own);
        *spin = (push.f, push.n);
    }
    let along = x.by_coordinate(&drive);
    let mut columns = [x.push(V3::zero()); N];
    for (column, a) in columns.iter_mut().zip(&along) {
        *column = x.push(a.scaled(m));
    }
    x.shift(&f, &mut columns);
    for (k, mut c) in columns.into_iter().enumerate() {
        c.own[k] += p[slot.k0 + k];
        let first = (3 + slot.eta0 + k) * dim;
        c.write(slot, &mut j[first..first + dim]);
    }
    for (k, a) in x.by_rate(&drive).into_iter().enumerate() {
        let mut c = x.push(a.scaled(m));
        c.own[k] += p[slot.k0 + N + k];
        let first = (3 + n + slot.eta0 + k) * dim;
        c.write(slot, &mut j[first..first + dim]);
    }
    spin
}

/// Writes the columns of the parameters of the mass. What a column holds besides must be zero already.
#[inline(always)]
pub(crate) fn regressor<T: Scalar, const N: usize, const P: usize>(
    x: &impl Place<T, N, P>,
    slot: &Slot,
    p: &[T],
    s: &PortState<'_, T>,
    acc: &PortAccel<'_, T>,
    y: &mut [T],
) {
    let dim = 6 + s.eta.len();
    let drive = Drive::new(s, Some(acc), slot.eta0);
    for (k, push) in x.by_parameter(p[slot.p0], &drive).into_iter().enumerate() {
        push.write(slot, &mut y[(slot.p0 + k) * dim..(slot.p0 + k + 1) * dim]);
    }
    for k in 0..N {
        let row = 6 + slot.eta0 + k;
        y[(slot.k0 + k) * dim + row] = s.eta[slot.eta0 + k];
        y[(slot.k0 + N + k) * dim + row] = drive.nu[k];
    }
}
