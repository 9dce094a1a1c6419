//! What the prescribed arm is made of at one instant: numbers of the table, over any scalar.
//!
//! Equations and symbols are those of [`crate::reduced::table`]. Everything is in base axes, about the base origin.

use ff_lanes::WIDEST;
use ff_model::scalar::LaneScalar;
use ff_model::spatial::vec3::{M3, PackedInertia, Pose, RotationKind, S3, V3, turn};
use ff_model::{Scalar, Xform};

/// Numbers of an [`Arm`] and of a [`Frame`].
pub(crate) const ARM: usize = 28;
pub(crate) const FRAME: usize = 24;

/// The wrench on a set of links as a linear function of the base's acceleration and a quadratic one of its angular velocity
/// (`crate::reduced::table`): `m, h, J, 2 h., h.., C, L.`.
#[derive(Clone, Copy, Debug)]
pub struct Arm<T> {
    /// Mass `m` (kg), first moment `h` (kg m), inertia `J` (kg m^2).
    pub ten: PackedInertia<T>,
    /// `2 h.` (kg m/s).
    pub dh2: V3<T>,
    /// `h..` (kg m/s^2).
    pub ddh: V3<T>,
    /// `C` (kg m^2/s).
    pub c: M3<T>,
    /// `L.` (N m).
    pub dl: V3<T>,
}

impl<T: Scalar> Arm<T> {
    /// Numbers of an arm.
    pub const LEN: usize = ARM;

    /// From its numbers in the order of the fields, `J` as `xx, xy, yy, xz, yz, zz`, `C` by columns.
    ///
    /// # Panics
    /// If there are fewer than [`Arm::LEN`].
    pub fn from_slice(x: &[T]) -> Self {
        Self::read(|i| x[i])
    }
    #[inline(always)]
    pub(crate) fn read(from: impl Fn(usize) -> T) -> Self {
        // One call of `from`, so that it is inlined.
        let mut all = [T::zero(); ARM];
        for (i, x) in all.iter_mut().enumerate() {
            *x = from(i);
        }
        let (x, v) = (|i: usize| all[i], |i: usize| V3::from_slice(&all[i..i + 3]));
        Self {
            ten: PackedInertia {
                m: x(0),
                h: v(1),
                i: S3 { xx: x(4), xy: x(5), yy: x(6), xz: x(7), yz: x(8), zz: x(9) },
            },
            dh2: v(10),
            ddh: v(13),
            c: M3([v(16), v(19), v(22)]),
            dl: v(25),
        }
    }
    #[inline(always)]
    pub(crate) fn numbers(&self) -> [T; ARM] {
        let (b, c) = (&self.ten, &self.c.0);
        let mut x = [b.m; ARM];
        b.h.write_to(&mut x[1..]);
        x[4..10].copy_from_slice(&[b.i.xx, b.i.xy, b.i.yy, b.i.xz, b.i.yz, b.i.zz]);
        let rest = [&self.dh2, &self.ddh, &c[0], &c[1], &c[2], &self.dl];
        for (i, v) in rest.into_iter().enumerate() {
            v.write_to(&mut x[10 + 3 * i..]);
        }
        x
    }
}

/// Pose and motion of a frame relative to the base, in base coordinates: `R, p, p., p.., w, w.`.
#[derive(Clone, Copy, Debug)]
pub struct Frame<T> {
    /// Pose `(R, p)` in the base. `R` stands in [`Pose::r`], whatever it is known to be.
    pub pose: Pose<T>,
    /// Whether it moves at all; what follows is zero otherwise.
    pub moving: bool,
    /// Velocity `p.` of the origin (m/s).
    pub dp: V3<T>,
    /// Acceleration `p..` of the origin (m/s^2).
    pub ddp: V3<T>,
    /// Angular velocity `w` (rad/s).
    pub w: V3<T>,
    /// Componentwise rate `w.` of the angular velocity (rad/s^2).
    pub dw: V3<T>,
}

/// Motion of a frame that is carried by the base, in its own axes: angular velocity, angular acceleration, classical
/// acceleration of the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carried<T> {
    pub(crate) w: V3<T>,
    pub(crate) al: V3<T>,
    pub(crate) a: V3<T>,
}

impl<T: Scalar> Frame<T> {
    /// Numbers of a frame.
    pub const LEN: usize = FRAME;

    /// At rest in the base.
    pub fn fixed(x: &Xform<f64>) -> Self {
        Self::at_rest(Pose::constant(x))
    }
    pub(crate) fn at_rest(pose: Pose<T>) -> Self {
        let z = V3::zero();
        Self { pose, moving: false, dp: z, ddp: z, w: z, dw: z }
    }
    /// A frame that moves, from its numbers in the order of the fields, `R` by columns.
    ///
    /// # Panics
    /// If there are fewer than [`Frame::LEN`].
    pub fn from_slice(x: &[T]) -> Self {
        Self::read(|i| x[i])
    }
    #[inline(always)]
    pub(crate) fn read(from: impl Fn(usize) -> T) -> Self {
        let mut all = [T::zero(); FRAME];
        for (i, x) in all.iter_mut().enumerate() {
            *x = from(i);
        }
        let v = |i: usize| V3::from_slice(&all[i..i + 3]);
        let mut pose = Pose::identity();
        (pose.turn, pose.r, pose.p) = (RotationKind::General, M3([v(0), v(3), v(6)]), v(9));
        Self { pose, moving: true, dp: v(12), ddp: v(15), w: v(18), dw: v(21) }
    }
    #[inline(always)]
    pub(crate) fn numbers(&self) -> [T; FRAME] {
        let (r, mut x) = (&self.pose.r.0, [T::zero(); FRAME]);
        let all = [&r[0], &r[1], &r[2], &self.pose.p, &self.dp, &self.ddp, &self.w, &self.dw];
        for (i, v) in all.into_iter().enumerate() {
            v.write_to(&mut x[3 * i..]);
        }
        x
    }
    /// A vector of the base in the frame.
    #[inline(always)]
    pub(crate) fn down(&self, v: &V3<T>) -> V3<T> {
        if self.pose.turn == RotationKind::None { *v } else { self.pose.down::<{ turn::ANY }>(v) }
    }
    /// A wrench of the frame in the base.
    #[inline(always)]
    pub(crate) fn up(&self, f: &V3<T>, n: &V3<T>) -> (V3<T>, V3<T>) {
        if self.pose.turn == RotationKind::None {
            self.pose.wrench_up::<{ turn::NONE }>(f, n)
        } else {
            self.pose.wrench_up::<{ turn::ANY }>(f, n)
        }
    }
    /// Motion for a base that turns with `w`, `al` and whose origin accelerates by `a`; `field` is that of `w`, `al`.
    #[inline(always)]
    pub(crate) fn carried(&self, w: &V3<T>, al: &V3<T>, a: &V3<T>, field: &M3<T>) -> Carried<T> {
        let mut at = field.mul_add(&self.pose.p, a);
        let (mut w_at, mut al_at) = (*w, *al);
        if self.moving {
            let two = T::from_f64(2.0);
            at += self.ddp + w.cross(&self.dp).scaled(two);
            al_at += w.cross_add(&self.w, &self.dw);
            w_at += self.w;
        }
        Carried { w: self.down(&w_at), al: self.down(&al_at), a: self.down(&at) }
    }
    /// Velocity of the origin in the axes of the frame, for a base that moves with `v`, `w`.
    #[inline(always)]
    pub(crate) fn velocity(&self, v: &V3<T>, w: &V3<T>) -> V3<T> {
        self.down(&(w.cross_add(&self.pose.p, v) + self.dp))
    }
}

/// A joint torque, or a sum of them, as a function of the base's motion (`crate::reduced::table`):
/// `ga.a + gb.al + gw.w + w^T Q w + c`.
#[derive(Clone, Copy, Debug)]
pub struct TorqueForm<T> {
    /// Per acceleration of the base origin.
    pub ga: V3<T>,
    /// Per angular acceleration.
    pub gb: V3<T>,
    /// Per angular velocity.
    pub gw: V3<T>,
    /// Per product of angular velocities.
    pub q: S3<T>,
    /// At rest.
    pub c: T,
}

/// Numbers of a [`TorqueForm`].
pub(crate) const FORM: usize = 16;

impl<T: Scalar> TorqueForm<T> {
    /// Numbers of a form.
    pub const LEN: usize = FORM;

    #[inline(always)]
    pub(crate) fn read<X: Copy>(x: &[X], lift: impl Fn(X) -> T) -> Self {
        let x = &x[..FORM];
        let v = |i: usize| V3::new(lift(x[i]), lift(x[i + 1]), lift(x[i + 2]));
        let q =
            S3 { xx: lift(x[9]), xy: lift(x[10]), yy: lift(x[11]), xz: lift(x[12]), yz: lift(x[13]), zz: lift(x[14]) };
        Self { ga: v(0), gb: v(3), gw: v(6), q, c: lift(x[15]) }
    }
    /// Its value for base acceleration `a`, `al` and the products of the components of the angular velocity `w`.
    #[inline(always)]
    pub(crate) fn value(&self, a: &V3<T>, al: &V3<T>, w: &V3<T>, ww: &S3<T>) -> T {
        let dot = |k: &V3<T>, x: &V3<T>, s: T| k.x.mul_add(x.x, k.y.mul_add(x.y, k.z.mul_add(x.z, s)));
        let s = dot(&self.ga, a, dot(&self.gb, al, dot(&self.gw, w, self.c)));
        let diagonal = V3::new(ww.xx, ww.yy, ww.zz);
        let twice = V3::new(ww.xy, ww.xz, ww.yz);
        let s = dot(&V3::new(self.q.xx, self.q.yy, self.q.zz), &diagonal, s);
        dot(&V3::new(self.q.xy.scale(2.0), self.q.xz.scale(2.0), self.q.yz.scale(2.0)), &twice, s)
    }
}

/// `w w^T`.
#[inline(always)]
pub(crate) fn products<T: Scalar>(w: &V3<T>) -> S3<T> {
    S3 { xx: w.x * w.x, xy: w.x * w.y, yy: w.y * w.y, xz: w.x * w.z, yz: w.y * w.z, zz: w.z * w.z }
}

/// What a joint torque is made of.
#[derive(Clone, Copy, Debug)]
pub struct JointRow<T> {
    /// What the links that it carries take.
    pub form: TorqueForm<T>,
    /// Screw of the joint about the base origin: velocity there.
    pub s: V3<T>,
    /// Angular velocity of the screw.
    pub u: V3<T>,
}

/// Numbers of a [`JointRow`].
pub(crate) const ROW: usize = FORM + 6;

impl<T: Scalar> JointRow<T> {
    /// Numbers of a row.
    pub const LEN: usize = ROW;

    /// From its numbers: `ga, gb, gw, Q` as `xx, xy, yy, xz, yz, zz`, `c`, screw.
    ///
    /// # Panics
    /// If there are fewer than [`JointRow::LEN`].
    pub fn from_slice(x: &[T]) -> Self {
        Self::read(x, |x| x)
    }
    #[inline(always)]
    pub(crate) fn read<X: Copy>(x: &[X], lift: impl Fn(X) -> T) -> Self {
        let x = &x[..ROW];
        let v = |i: usize| V3::new(lift(x[i]), lift(x[i + 1]), lift(x[i + 2]));
        let (s, u) = (v(FORM), v(FORM + 3));
        Self { form: TorqueForm::read(x, lift), s, u }
    }
    /// Torque of a wrench about the base origin.
    #[inline(always)]
    pub fn of(&self, f: &V3<T>, n: &V3<T>) -> T {
        self.s.dot(f) + self.u.dot(n)
    }
}

/// The `N` numbers of each of these places in a table of `N` numbers each, one place per lane.
#[inline(always)]
pub(crate) fn columns<L: LaneScalar, const N: usize>(table: &[f64], nodes: &[usize]) -> [L; N] {
    // Not a closure: it has to be compiled into its caller, for the instructions of that one.
    let mut out = [L::zero(); N];
    let mut of: [&[f64]; WIDEST] = [&[]; WIDEST];
    for (of, &n) in of.iter_mut().zip(&nodes[..L::N]) {
        *of = &table[n * N..][..N];
    }
    for (i, x) in out.iter_mut().enumerate() {
        let mut lane = [0.0; WIDEST];
        for (lane, of) in lane.iter_mut().zip(&of[..L::N]) {
            *lane = of[i];
        }
        *x = L::load(&lane);
    }
    out
}
