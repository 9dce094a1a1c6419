//! A rigid body and its motion, as the inner loops hold them.

use super::{M3, S3, V3};
use crate::scalar::traits::Scalar;
use crate::spatial::inertia::Inertia;

/// A rigid body's ten inertial parameters about its frame origin, as the inner loops hold them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackedInertia<T> {
    /// Mass (kg).
    pub m: T,
    /// First moment (kg m).
    pub h: V3<T>,
    /// Rotational inertia about the origin (kg m^2).
    pub i: S3<T>,
}

impl<T: Scalar> PackedInertia<T> {
    /// No mass.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { m: T::zero(), h: V3::zero(), i: S3::zero() }
    }
    /// From the ten parameters in the order of [`crate::spatial::inertia::INERTIAL_NAMES`].
    ///
    /// # Panics
    /// If there are fewer.
    #[inline(always)]
    pub fn from_params(p: &[T]) -> Self {
        let p = &p[..10];
        let i = S3 { xx: p[4], xy: p[5], yy: p[6], xz: p[7], yz: p[8], zz: p[9] };
        Self { m: p[0], h: V3::new(p[1], p[2], p[3]), i }
    }
    /// Adds another body about the same origin.
    #[inline(always)]
    pub fn add(&mut self, o: &Self) {
        self.m += o.m;
        self.h += o.h;
        self.i.xx += o.i.xx;
        self.i.xy += o.i.xy;
        self.i.yy += o.i.yy;
        self.i.xz += o.i.xz;
        self.i.yz += o.i.yz;
        self.i.zz += o.i.zz;
    }
    /// Force and moment about the origin for classical acceleration `a`, angular velocity `w` and acceleration
    /// `al`, with `field = [al]x + [w]x^2`: `f = m a + field h`, `n = I al + w x I w + h x a`.
    #[inline(always)]
    pub fn wrench(&self, w: &V3<T>, al: &V3<T>, a: &V3<T>, field: &M3<T>) -> (V3<T>, V3<T>) {
        let f = field.mul_add(&self.h, &a.scaled(self.m));
        let n = w.cross_add(&self.i.mul(w), &self.i.mul_add(al, &self.h.cross(a)));
        (f, n)
    }
    /// Derivatives of [`PackedInertia::wrench`] with respect to each component `w_i` of the angular velocity, where the origin
    /// has the acceleration `a = A + w x v` with `A` and `v` fixed (componentwise accelerations of a twist):
    /// `f_i = m e_i x v + w h_i - 2 h w_i + e_i (w.h)`, `n_i = e_i x I w + w x I e_i + h x (e_i x v)`.
    #[inline(always)]
    pub fn wrench_by_spin(&self, w: &V3<T>, v: &V3<T>) -> [(V3<T>, V3<T>); 3] {
        let (mv, iw, wh, h) = (v.scaled(self.m), self.i.mul(w), w.dot(&self.h), &self.h);
        let (hv, v_h) = (v.dot(h), h.scaled(T::from_f64(-2.0)));
        // e_i x mv + e_i wh, and e_i x I w + e_i (h.v), by columns.
        let f = [V3::new(wh, -mv.z, mv.y), V3::new(mv.z, wh, -mv.x), V3::new(-mv.y, mv.x, wh)];
        let n = [V3::new(hv, -iw.z, iw.y), V3::new(iw.z, hv, -iw.x), V3::new(-iw.y, iw.x, hv)];
        core::array::from_fn(|i| {
            let (wi, hi) = (w.get(i), h.get(i));
            let f = v_h.scale_add(wi, &w.scale_add(hi, &f[i]));
            // h x (e_i x v) = e_i (h.v) - v h_i.
            (f, w.cross_add(&self.i.col(i), &v.scale_add(-hi, &n[i])))
        })
    }
    /// Momentum for a velocity `v` of the origin and angular velocity `w`: `m v + w x h`, `I w + h x v`.
    #[inline(always)]
    pub fn momentum(&self, v: &V3<T>, w: &V3<T>) -> (V3<T>, V3<T>) {
        (w.cross_add(&self.h, &v.scaled(self.m)), self.i.mul_add(w, &self.h.cross(v)))
    }
}

impl<T: Scalar> From<&Inertia<T>> for PackedInertia<T> {
    #[inline(always)]
    fn from(b: &Inertia<T>) -> Self {
        let r = &b.rot.data.0;
        let i = S3 { xx: r[0][0], xy: r[1][0], yy: r[1][1], xz: r[2][0], yz: r[2][1], zz: r[2][2] };
        Self { m: b.mass, h: V3::from(&b.h), i }
    }
}

/// Motion of a body as the inner loops hold it: angular velocity and acceleration, classical acceleration of the
/// frame origin, and the field of [`M3::field`].
#[derive(Clone, Copy, Debug)]
pub struct Moving<T> {
    /// Angular velocity (rad/s).
    pub w: V3<T>,
    /// Angular acceleration (rad/s^2).
    pub al: V3<T>,
    /// Classical acceleration of the origin (m/s^2).
    pub a: V3<T>,
    /// `[al]x + [w]x^2`.
    pub field: M3<T>,
}

impl<T: Scalar> Moving<T> {
    /// Power of the inertial wrench of this motion on a screw `(v, w)` of the body frame, per unit of each of the
    /// ten inertial parameters: the row of the regressor that belongs to a degree of freedom with that screw.
    ///
    /// With `f = m a + field h`, `n = I al + w x I w + h x a` and `t = s_w x w`:
    /// `m: s_v . a`; `h: field^T s_v + a x s_w`; `I: s_w^T I al + t^T I w` element by element. A body regressor is
    /// never formed and never carried (Atkeson, An, Hollerbach 1986, eq. (8), contracted with the screw).
    #[inline(always)]
    pub fn powers(&self, v: &V3<T>, w: &V3<T>) -> [T; 10] {
        let h = self.a.cross_add(w, &self.field.tr_mul(v));
        let t = w.cross(&self.w);
        let (u, x, y) = (w, &self.al, &self.w);
        let two = |a: T, b: T, c: T, d: T| a.mul_add(b, c * d);
        [
            v.dot(&self.a),
            h.x,
            h.y,
            h.z,
            two(u.x, x.x, t.x, y.x),
            two(u.x, x.y, u.y, x.x) + two(t.x, y.y, t.y, y.x),
            two(u.y, x.y, t.y, y.y),
            two(u.x, x.z, u.z, x.x) + two(t.x, y.z, t.z, y.x),
            two(u.y, x.z, u.z, x.y) + two(t.y, y.z, t.z, y.y),
            two(u.z, x.z, t.z, y.z),
        ]
    }
    /// [`Moving::powers`] on a screw that does not turn, `w = 0`: those per unit of `m` and `h`; the other six are zero.
    #[inline(always)]
    pub fn pushes(&self, v: &V3<T>) -> [T; 4] {
        let h = self.field.tr_mul(v);
        [v.dot(&self.a), h.x, h.y, h.z]
    }
    /// Of angular velocity and acceleration, and the classical acceleration of the origin.
    #[inline(always)]
    pub fn new(w: V3<T>, al: V3<T>, a: V3<T>) -> Self {
        Self { w, al, a, field: M3::field(&w, &al) }
    }
    /// Force and moment of this motion per unit of each of the ten inertial parameters: the body regressor by
    /// columns (Atkeson, An, Hollerbach 1986, eq. (8)).
    #[inline(always)]
    pub fn columns(&self) -> [(V3<T>, V3<T>); 10] {
        let (w, al, a, o) = (&self.w, &self.al, &self.a, T::zero());
        let [fx, fy, fz] = self.field.0;
        let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
        let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
        let n = |x: T, y: T, z: T| (V3::zero(), V3::new(x, y, z));
        [
            (*a, V3::zero()),
            (fx, V3::new(o, -a.z, a.y)),
            (fy, V3::new(a.z, o, -a.x)),
            (fz, V3::new(-a.y, a.x, o)),
            n(al.x, xz, -xy),
            n(al.y - xz, al.x + yz, xx - yy),
            n(-yz, al.y, xy),
            n(al.z + xy, zz - xx, al.x - yz),
            n(yy - zz, al.z - xy, al.y + xz),
            n(yz, -xz, al.z),
        ]
    }
}
