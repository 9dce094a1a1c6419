//! 3-vectors, symmetric 3 x 3 matrices and joint poses of the inner loops, inlined for every scalar.
//!
//! The public types of this crate store nalgebra vectors, whose operators are ordinary functions. Inside a
//! function compiled for a vector instruction set everything must be inlined (`ff-lanes`), so the hot
//! algorithms compute in these. Nothing allocates.
pub(crate) mod body;

pub use body::{Moving, PackedInertia};

use crate::scalar::traits::Scalar;
use core::ops::{Add, AddAssign, Neg, Sub, SubAssign};
use nalgebra::{Matrix3, Vector3};

/// `c - a b`, in one rounding where the scalar has it.
#[inline(always)]
pub fn nmul_add<T: Scalar>(a: T, b: T, c: T) -> T {
    (-a).mul_add(b, c)
}

/// `[f(0), .. f(N - 1)]`. What `core::array::from_fn` and `map` do, but inlined: they are functions of their own, in
/// which the instructions of lanes are not to be had (`ff-lanes`). `fill` is overwritten.
#[inline(always)]
pub fn array<X: Copy, const N: usize>(fill: X, f: impl Fn(usize) -> X) -> [X; N] {
    let mut x = [fill; N];
    for (k, x) in x.iter_mut().enumerate() {
        *x = f(k);
    }
    x
}

/// A 3-vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct V3<T> {
    /// x.
    pub x: T,
    /// y.
    pub y: T,
    /// z.
    pub z: T,
}

impl<T: Scalar> V3<T> {
    /// From components.
    #[inline(always)]
    pub fn new(x: T, y: T, z: T) -> Self {
        Self { x, y, z }
    }
    /// The zero vector.
    #[inline(always)]
    pub fn zero() -> Self {
        Self::new(T::zero(), T::zero(), T::zero())
    }
    /// Component `i`.
    ///
    /// # Panics
    /// If `i > 2`.
    #[inline(always)]
    pub fn get(&self, i: usize) -> T {
        [self.x, self.y, self.z][i]
    }
    /// From three numbers.
    ///
    /// # Panics
    /// If there are fewer.
    #[inline(always)]
    pub fn from_slice(s: &[T]) -> Self {
        Self::new(s[0], s[1], s[2])
    }
    /// Into three numbers.
    ///
    /// # Panics
    /// If there are fewer.
    #[inline(always)]
    pub fn write_to(&self, s: &mut [T]) {
        s[0] = self.x;
        s[1] = self.y;
        s[2] = self.z;
    }
    /// `self . o`.
    #[inline(always)]
    pub fn dot(&self, o: &Self) -> T {
        self.z.mul_add(o.z, self.y.mul_add(o.y, self.x * o.x))
    }
    /// `self x o`.
    #[inline(always)]
    pub fn cross(&self, o: &Self) -> Self {
        Self::new(
            nmul_add(self.z, o.y, self.y * o.z),
            nmul_add(self.x, o.z, self.z * o.x),
            nmul_add(self.y, o.x, self.x * o.y),
        )
    }
    /// `c + self x o`.
    #[inline(always)]
    pub fn cross_add(&self, o: &Self, c: &Self) -> Self {
        Self::new(
            nmul_add(self.z, o.y, self.y.mul_add(o.z, c.x)),
            nmul_add(self.x, o.z, self.z.mul_add(o.x, c.y)),
            nmul_add(self.y, o.x, self.x.mul_add(o.y, c.z)),
        )
    }
    /// `k self`.
    #[inline(always)]
    pub fn scaled(&self, k: T) -> Self {
        Self::new(self.x * k, self.y * k, self.z * k)
    }
    /// `k self + c`.
    #[inline(always)]
    pub fn scale_add(&self, k: T, c: &Self) -> Self {
        Self::new(self.x.mul_add(k, c.x), self.y.mul_add(k, c.y), self.z.mul_add(k, c.z))
    }
}

impl<T: Scalar> From<&Vector3<T>> for V3<T> {
    #[inline(always)]
    fn from(v: &Vector3<T>) -> Self {
        let v = &v.data.0[0];
        Self::new(v[0], v[1], v[2])
    }
}
impl<T: Scalar> From<V3<T>> for Vector3<T> {
    #[inline(always)]
    fn from(v: V3<T>) -> Self {
        Vector3::new(v.x, v.y, v.z)
    }
}
impl<T: Scalar> Add for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}
impl<T: Scalar> Sub for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}
impl<T: Scalar> Neg for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}
impl<T: Scalar> AddAssign for V3<T> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<T: Scalar> SubAssign for V3<T> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

/// A 3 x 3 matrix by columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct M3<T>(pub [V3<T>; 3]);

impl<T: Scalar> M3<T> {
    /// The zero matrix.
    #[inline(always)]
    pub fn zero() -> Self {
        Self([V3::zero(); 3])
    }
    /// `m v`.
    #[inline(always)]
    pub fn mul(&self, v: &V3<T>) -> V3<T> {
        let [a, b, c] = &self.0;
        c.scale_add(v.z, &b.scale_add(v.y, &a.scaled(v.x)))
    }
    /// `m v + u`.
    #[inline(always)]
    pub fn mul_add(&self, v: &V3<T>, u: &V3<T>) -> V3<T> {
        let [a, b, c] = &self.0;
        c.scale_add(v.z, &b.scale_add(v.y, &a.scale_add(v.x, u)))
    }
    /// `m^T v`.
    #[inline(always)]
    pub fn tr_mul(&self, v: &V3<T>) -> V3<T> {
        V3::new(self.0[0].dot(v), self.0[1].dot(v), self.0[2].dot(v))
    }
    /// `[al]x + [w]x [w]x`: the acceleration field of a body about its origin (paper of Atkeson et al. 1986,
    /// eq. (6)): a point at `r` accelerates by `a + field r`, and its inertia force is `m a + field h`.
    #[inline(always)]
    pub fn field(w: &V3<T>, al: &V3<T>) -> Self {
        let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
        let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
        Self([
            V3::new(-(yy + zz), xy + al.z, xz - al.y),
            V3::new(xy - al.z, -(xx + zz), yz + al.x),
            V3::new(xz + al.y, yz - al.x, -(xx + yy)),
        ])
    }
}

impl<T: Scalar> From<&Matrix3<T>> for M3<T> {
    #[inline(always)]
    fn from(m: &Matrix3<T>) -> Self {
        let m = &m.data.0;
        let [a, b, c] = m;
        Self([V3::from_slice(a), V3::from_slice(b), V3::from_slice(c)])
    }
}

/// A symmetric 3 x 3 matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct S3<T> {
    /// Element (x, x), and so on.
    pub xx: T,
    /// Element (x, y).
    pub xy: T,
    /// Element (y, y).
    pub yy: T,
    /// Element (x, z).
    pub xz: T,
    /// Element (y, z).
    pub yz: T,
    /// Element (z, z).
    pub zz: T,
}

impl<T: Scalar> S3<T> {
    /// The zero matrix.
    #[inline(always)]
    pub fn zero() -> Self {
        let o = T::zero();
        Self { xx: o, xy: o, yy: o, xz: o, yz: o, zz: o }
    }
    /// `s v`.
    #[inline(always)]
    pub fn mul(&self, v: &V3<T>) -> V3<T> {
        V3::new(
            self.xz.mul_add(v.z, self.xy.mul_add(v.y, self.xx * v.x)),
            self.yz.mul_add(v.z, self.yy.mul_add(v.y, self.xy * v.x)),
            self.zz.mul_add(v.z, self.yz.mul_add(v.y, self.xz * v.x)),
        )
    }
    /// `s v + u`.
    #[inline(always)]
    pub fn mul_add(&self, v: &V3<T>, u: &V3<T>) -> V3<T> {
        V3::new(
            self.xz.mul_add(v.z, self.xy.mul_add(v.y, self.xx.mul_add(v.x, u.x))),
            self.yz.mul_add(v.z, self.yy.mul_add(v.y, self.xy.mul_add(v.x, u.y))),
            self.zz.mul_add(v.z, self.yz.mul_add(v.y, self.xz.mul_add(v.x, u.z))),
        )
    }
    /// Column `j`.
    #[inline(always)]
    pub fn col(&self, j: usize) -> V3<T> {
        match j {
            0 => V3::new(self.xx, self.xy, self.xz),
            1 => V3::new(self.xy, self.yy, self.yz),
            _ => V3::new(self.xz, self.yz, self.zz),
        }
    }
}

/// What a rotation is known to be, so that it is not multiplied out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RotationKind {
    /// The identity.
    None,
    /// About x.
    X,
    /// About y.
    Y,
    /// About z.
    Z,
    /// Any.
    General,
}

impl RotationKind {
    /// What a rotation is handled as over the scalar `T`.
    #[inline(always)]
    pub fn of<T: Scalar>(self) -> Self {
        if T::DERIVATIVES { Self::General } else { self }
    }
}

/// [`RotationKind`] as a constant of the compiler, so that a step of an algorithm asks once what its rotation is
/// (`dispatch_rotation!`): asking in every operation multiplies the code paths through a step.
pub mod turn {
    /// The identity.
    pub const NONE: u8 = 0;
    /// About x.
    pub const X: u8 = 1;
    /// About y.
    pub const Y: u8 = 2;
    /// About z.
    pub const Z: u8 = 3;
    /// Any.
    pub const ANY: u8 = 4;
}

/// Evaluates an expression with the constant `$k` standing for a [`vec3::RotationKind`](crate::spatial::vec3::RotationKind) known at run
/// time: `dispatch_rotation!(T, pose.turn, K => pose.up::<K>(&v))` for a scalar `T`. For numbers with derivatives every
/// rotation is [`RotationKind::General`](crate::spatial::vec3::RotationKind::General), see [`RotationKind::of`](crate::spatial::vec3::RotationKind::of).
#[macro_export]
macro_rules! dispatch_rotation {
    ($t:ty, $turn:expr, $k:ident => $e:expr) => {
        if <$t as $crate::Scalar>::DERIVATIVES {
            const $k: u8 = $crate::spatial::vec3::turn::ANY;
            $e
        } else {
            match $turn {
                $crate::spatial::vec3::RotationKind::None => {
                    const $k: u8 = $crate::spatial::vec3::turn::NONE;
                    $e
                }
                $crate::spatial::vec3::RotationKind::X => {
                    const $k: u8 = $crate::spatial::vec3::turn::X;
                    $e
                }
                $crate::spatial::vec3::RotationKind::Y => {
                    const $k: u8 = $crate::spatial::vec3::turn::Y;
                    $e
                }
                $crate::spatial::vec3::RotationKind::Z => {
                    const $k: u8 = $crate::spatial::vec3::turn::Z;
                    $e
                }
                $crate::spatial::vec3::RotationKind::General => {
                    const $k: u8 = $crate::spatial::vec3::turn::ANY;
                    $e
                }
            }
        }
    };
}

/// The plane of a turn in `R S R^T`, with `d = first - second` diagonal element and `e` the mixed one:
/// `first' = first + x`, `second' = second - x`, `mixed' = mixed + y`, `x = -s (s d + 2 c mixed)`,
/// `y = c (s d + 2 c mixed) - 2 mixed`, written with `k = s d + 2 c mixed`.
///
/// A function like [`row`], because a closure is not inlined into code for lanes.
#[inline(always)]
fn turned<T: Scalar>(c: T, s: T, first: T, mixed: T, second: T) -> (T, T, T) {
    let k = s.mul_add(first - second, (c * mixed).scale(2.0));
    (nmul_add(s, k, first), c.mul_add(k, -mixed), s.mul_add(k, second))
}

/// Pose of a child frame in its parent: `p_parent = R p_child + p`. Methods take what `R` is as a constant of
/// [`turn`], which must be that of `turn`.
#[derive(Clone, Copy, Debug)]
pub struct Pose<T> {
    /// What `R` is.
    pub turn: RotationKind,
    /// Cosine of the angle, for a turn about a coordinate axis.
    pub c: T,
    /// Sine of the angle, for a turn about a coordinate axis.
    pub s: T,
    /// `R` where it is [`RotationKind::General`]; not read otherwise.
    pub r: M3<T>,
    /// Origin of the child in the parent (m).
    pub p: V3<T>,
}

impl<T: Scalar> Pose<T> {
    /// The identity.
    #[inline(always)]
    pub fn identity() -> Self {
        Self { turn: RotationKind::None, c: T::one(), s: T::zero(), r: M3::zero(), p: V3::zero() }
    }
    /// A constant pose; recognises the identity rotation.
    pub fn constant(x: &crate::spatial::motion::Xform<f64>) -> Self {
        let turn = if x.rot == Matrix3::identity() { RotationKind::None } else { RotationKind::General };
        let turn = turn.of::<T>();
        let x = x.lift::<T>();
        Self { turn, c: T::one(), s: T::zero(), r: M3::from(&x.rot), p: V3::from(&x.pos) }
    }
    /// `R^T v`: a vector of the parent written in the child.
    #[inline(always)]
    pub fn down<const K: u8>(&self, v: &V3<T>) -> V3<T> {
        let (c, s) = (self.c, self.s);
        match K {
            turn::NONE => *v,
            turn::X => V3::new(v.x, s.mul_add(v.z, c * v.y), nmul_add(s, v.y, c * v.z)),
            turn::Y => V3::new(nmul_add(s, v.z, c * v.x), v.y, s.mul_add(v.x, c * v.z)),
            turn::Z => V3::new(s.mul_add(v.y, c * v.x), nmul_add(s, v.x, c * v.y), v.z),
            _ => self.r.tr_mul(v),
        }
    }
    /// `R v`: a vector of the child written in the parent.
    #[inline(always)]
    pub fn up<const K: u8>(&self, v: &V3<T>) -> V3<T> {
        let (c, s) = (self.c, self.s);
        match K {
            turn::NONE => *v,
            turn::X => V3::new(v.x, nmul_add(s, v.z, c * v.y), s.mul_add(v.y, c * v.z)),
            turn::Y => V3::new(s.mul_add(v.z, c * v.x), v.y, nmul_add(s, v.x, c * v.z)),
            turn::Z => V3::new(nmul_add(s, v.y, c * v.x), s.mul_add(v.x, c * v.y), v.z),
            _ => self.r.mul(v),
        }
    }
    /// A wrench of the child about its origin, in the parent about the parent's: `(R f, R n + p x R f)`.
    #[inline(always)]
    pub fn wrench_up<const K: u8>(&self, f: &V3<T>, n: &V3<T>) -> (V3<T>, V3<T>) {
        let f = self.up::<K>(f);
        (f, self.p.cross_add(&f, &self.up::<K>(n)))
    }
    /// A screw of the parent (velocity of its origin, angular velocity) written in the child.
    #[inline(always)]
    pub fn screw_down<const K: u8>(&self, v: &V3<T>, w: &V3<T>) -> (V3<T>, V3<T>) {
        (self.down::<K>(&w.cross_add(&self.p, v)), self.down::<K>(w))
    }
    /// `R S R^T`.
    #[inline(always)]
    pub fn up_sym<const K: u8>(&self, i: &S3<T>) -> S3<T> {
        let (c, s) = (self.c, self.s);
        match K {
            turn::NONE => *i,
            turn::X => {
                let (yy, yz, zz) = turned(c, s, i.yy, i.yz, i.zz);
                let (xy, xz) = (nmul_add(s, i.xz, c * i.xy), s.mul_add(i.xy, c * i.xz));
                S3 { xx: i.xx, xy, yy, xz, yz, zz }
            }
            turn::Y => {
                let (zz, xz, xx) = turned(c, s, i.zz, i.xz, i.xx);
                let (yz, xy) = (nmul_add(s, i.xy, c * i.yz), s.mul_add(i.yz, c * i.xy));
                S3 { xx, xy, yy: i.yy, xz, yz, zz }
            }
            turn::Z => {
                let (xx, xy, yy) = turned(c, s, i.xx, i.xy, i.yy);
                let (xz, yz) = (nmul_add(s, i.yz, c * i.xz), s.mul_add(i.xz, c * i.yz));
                S3 { xx, xy, yy, xz, yz, zz: i.zz }
            }
            _ => {
                // R S by columns; row r of R is (a_r, b_r, d_r), element (i, j) is sum_k t_k,i R_j,k.
                let (t, u, v) = (self.r.mul(&i.col(0)), self.r.mul(&i.col(1)), self.r.mul(&i.col(2)));
                let [a, b, d] = &self.r.0;
                let (rx, ry, rz) = (V3::new(a.x, b.x, d.x), V3::new(a.y, b.y, d.y), V3::new(a.z, b.z, d.z));
                let (tx, ty, tz) = (V3::new(t.x, u.x, v.x), V3::new(t.y, u.y, v.y), V3::new(t.z, u.z, v.z));
                S3 {
                    xx: rx.dot(&tx),
                    xy: rx.dot(&ty),
                    yy: ry.dot(&ty),
                    xz: rx.dot(&tz),
                    yz: ry.dot(&tz),
                    zz: rz.dot(&tz),
                }
            }
        }
    }
    /// The body `b` of the child seen from the parent: `h' = R h + m p`,
    /// `I' = R I R^T + ((h_R + h').p) 1 - h' p^T - p h_R^T` with `h_R = R h`.
    #[inline(always)]
    pub fn body_up<const K: u8>(&self, b: &PackedInertia<T>) -> PackedInertia<T> {
        let hr = self.up::<K>(&b.h);
        let p = &self.p;
        let h = p.scale_add(b.m, &hr);
        let i = self.up_sym::<K>(&b.i);
        let sum = hr + h;
        let (dx, dy, dz) = (sum.x * p.x, sum.y * p.y, sum.z * p.z);
        let i = S3 {
            xx: i.xx + (dy + dz),
            yy: i.yy + (dx + dz),
            zz: i.zz + (dx + dy),
            xy: nmul_add(h.x, p.y, nmul_add(p.x, hr.y, i.xy)),
            xz: nmul_add(h.x, p.z, nmul_add(p.x, hr.z, i.xz)),
            yz: nmul_add(h.y, p.z, nmul_add(p.y, hr.z, i.yz)),
        };
        PackedInertia { m: b.m, h, i }
    }
    /// The same pose as rotation matrix and origin.
    pub fn to_xform(&self) -> crate::spatial::motion::Xform<T> {
        let e = |i: usize| {
            let mut v = V3::zero();
            match i {
                0 => v.x = T::one(),
                1 => v.y = T::one(),
                _ => v.z = T::one(),
            }
            Vector3::from(crate::dispatch_rotation!(T, self.turn, K => self.up::<K>(&v)))
        };
        crate::spatial::motion::Xform::new(Matrix3::from_columns(&[e(0), e(1), e(2)]), self.p.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::inertia::Inertia;
    use crate::spatial::motion::Xform;
    use crate::spatial::so3::{exp_so3, quat_to_rot};
    use approx::assert_relative_eq;

    fn body() -> Inertia<f64> {
        let r = quat_to_rot(&exp_so3(&Vector3::new(0.3, -0.7, 1.1)));
        let i = r * Matrix3::from_diagonal(&Vector3::new(1.3, 2.1, 2.9)) * r.transpose();
        Inertia::from_com(3.7, &Vector3::new(0.4, -0.2, 0.9), &i)
    }

    /// Every kind of pose, as the fast type and as the plain one.
    fn poses() -> Vec<(Pose<f64>, Xform<f64>)> {
        let p = Vector3::new(1.1, -0.3, 0.7);
        let angle: f64 = 0.83;
        let about = |turn, axis: Vector3<f64>| {
            let mut q = Pose::identity();
            (q.turn, q.c, q.s, q.p) = (turn, angle.cos(), angle.sin(), V3::from(&p));
            (q, Xform::new(quat_to_rot(&exp_so3(&(axis * angle))), p))
        };
        let any = Xform::new(quat_to_rot(&exp_so3(&Vector3::new(-0.4, 1.2, 0.6))), p);
        vec![
            about(RotationKind::X, Vector3::x()),
            about(RotationKind::Y, Vector3::y()),
            about(RotationKind::Z, Vector3::z()),
            (Pose::constant(&any), any),
            (Pose::constant(&Xform::new(Matrix3::identity(), p)), Xform::new(Matrix3::identity(), p)),
        ]
    }

    #[test]
    fn poses_move_vectors_wrenches_and_bodies_like_the_spatial_algebra() {
        let (u, n) = (Vector3::new(0.7, -0.2, 1.3), Vector3::new(-1.1, 0.5, 0.9));
        for (q, x) in poses() {
            let near = |a: V3<f64>, b: Vector3<f64>| assert_relative_eq!(Vector3::from(a), b, epsilon = 1e-14);
            near(dispatch_rotation!(f64, q.turn, K => q.up::<K>(&V3::from(&u))), x.rot * u);
            near(dispatch_rotation!(f64, q.turn, K => q.down::<K>(&V3::from(&u))), x.rot.transpose() * u);
            let w = x.force_to_parent(&crate::spatial::motion::Force::new(u, n));
            let (f, m) = dispatch_rotation!(f64, q.turn, K => q.wrench_up::<K>(&V3::from(&u), &V3::from(&n)));
            near(f, w.lin);
            near(m, w.ang);
            let (a, b) = (
                dispatch_rotation!(f64, q.turn, K => q.body_up::<K>(&PackedInertia::from(&body()))),
                PackedInertia::from(&body().to_parent(&x)),
            );
            for (a, b) in [
                (a.m, b.m),
                (a.h.x, b.h.x),
                (a.h.y, b.h.y),
                (a.h.z, b.h.z),
                (a.i.xx, b.i.xx),
                (a.i.xy, b.i.xy),
                (a.i.yy, b.i.yy),
                (a.i.xz, b.i.xz),
                (a.i.yz, b.i.yz),
                (a.i.zz, b.i.zz),
            ] {
                assert_relative_eq!(a, b, epsilon = 1e-14);
            }
            assert_relative_eq!(q.to_xform().rot, x.rot, epsilon = 1e-15);
        }
    }

    /// Linear in the parameters, and its derivatives those of differences at fixed componentwise accelerations.
    #[test]
    fn wrench_has_the_columns_and_derivatives_it_says() {
        let v3 = |x: f64, y: f64, z: f64| V3::new(x, y, z);
        let (v, w, a, al) = (v3(0.3, -1.1, 0.8), v3(0.5, 0.2, -0.9), v3(-0.6, 0.4, 1.2), v3(1.1, -0.3, 0.7));
        let b = PackedInertia::from(&body());
        let at = |w: &V3<f64>| b.wrench(w, &al, &w.cross_add(&v, &a), &M3::field(w, &al));
        let (f, n) = at(&w);
        let near = |x: V3<f64>, y: V3<f64>, e: f64| {
            assert_relative_eq!(Vector3::from(x), Vector3::from(y), epsilon = e);
        };
        let (mut sf, mut sn) = (V3::zero(), V3::zero());
        for ((cf, cn), x) in Moving::new(w, al, w.cross_add(&v, &a)).columns().iter().zip(body().to_params()) {
            (sf, sn) = (cf.scale_add(x, &sf), cn.scale_add(x, &sn));
        }
        near(sf, f, 1e-14);
        near(sn, n, 1e-14);
        let h = 1e-6;
        for (i, (df, dn)) in b.wrench_by_spin(&w, &v).into_iter().enumerate() {
            let e = [v3(h, 0.0, 0.0), v3(0.0, h, 0.0), v3(0.0, 0.0, h)][i];
            let (p, m) = (at(&(w + e)), at(&(w - e)));
            near((p.0 - m.0).scaled(0.5 / h), df, 1e-8);
            near((p.1 - m.1).scaled(0.5 / h), dn, 1e-8);
        }
    }

    #[test]
    fn wrench_is_that_of_the_spatial_equations() {
        use crate::spatial::motion::Motion;
        let (v, w) = (Vector3::new(0.3, -1.1, 0.8), Vector3::new(0.5, 0.2, -0.9));
        let (a, al) = (Vector3::new(-0.6, 0.4, 1.2), Vector3::new(1.1, -0.3, 0.7));
        let (tw, acc) = (Motion::new(v, w), Motion::new(a, al));
        let plain = body().mul_motion(&acc) + tw.cross_force(&body().mul_motion(&tw));
        let (w3, al3) = (V3::from(&w), V3::from(&al));
        let field = M3::field(&w3, &al3);
        let (f, n) = PackedInertia::from(&body()).wrench(&w3, &al3, &V3::from(&(a + w.cross(&v))), &field);
        assert_relative_eq!(Vector3::from(f), plain.lin, epsilon = 1e-14);
        assert_relative_eq!(Vector3::from(n), plain.ang, epsilon = 1e-14);
        let p = body().mul_motion(&tw);
        let (l, h) = PackedInertia::from_params(&body().to_params()).momentum(&V3::from(&v), &w3);
        assert_relative_eq!(Vector3::from(l), p.lin, epsilon = 1e-14);
        assert_relative_eq!(Vector3::from(h), p.ang, epsilon = 1e-14);
    }
}
