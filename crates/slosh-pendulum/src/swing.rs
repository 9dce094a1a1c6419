//! Place of a mass on an arm that swings about two axes.

use crate::point::{Coupling, Drive, Place, Push};
use ff_model::Scalar;
use ff_model::spatial::vec3::V3;

/// A mass on an arm of length `l` from a fulcrum, with swing angles `a` (about the mount x axis) and `b` (about the y
/// axis turned with `a`).
///
/// In the axes `x`, `t = [0, cos a, sin a]`, `u = [0, -sin a, cos a]` the arm is `l [-sin b, 0, -cos b]`; they turn
/// about `x` with the rate `a'`.
#[derive(Clone, Copy)]
pub(crate) struct Swing<T> {
    sa: T,
    ca: T,
    sb: T,
    cb: T,
    /// `l sin b`, `l cos b`.
    ls: T,
    lc: T,
    l: T,
    arm: V3<T>,
    /// Fulcrum (m, mount frame), unless it is the mount itself.
    at: Option<V3<T>>,
}

/// `x * v` for the unit vector along x.
#[inline(always)]
fn about_x<T: Scalar>(v: &V3<T>) -> V3<T> {
    V3::new(T::zero(), -v.z, v.y)
}

impl<T: Scalar> Swing<T> {
    #[inline(always)]
    pub(crate) fn new(at: Option<V3<T>>, l: T, eta: &[T]) -> Self {
        let (sa, ca) = eta[0].sin_cos();
        let (sb, cb) = eta[1].sin_cos();
        Self::of(at, l, [sa, ca, sb, cb])
    }
    #[inline(always)]
    fn of(at: Option<V3<T>>, l: T, [sa, ca, sb, cb]: [T; 4]) -> Self {
        let (ls, lc) = (l * sb, l * cb);
        Self { sa, ca, sb, cb, ls, lc, l, arm: V3::new(-ls, sa * lc, -(ca * lc)), at }
    }
    /// A vector from its components along `x`, `t`, `u`.
    #[inline(always)]
    fn axes(&self, x: T, t: T, u: T) -> V3<T> {
        V3::new(x, self.ca.mul_add(t, -(self.sa * u)), self.sa.mul_add(t, self.ca * u))
    }
    /// `dr/db`.
    #[inline(always)]
    fn d_b(&self) -> V3<T> {
        V3::new(-self.lc, -(self.sa * self.ls), self.ca * self.ls)
    }
    /// The moment of a force about the fulcrum, and its parts about the two axes of the swing.
    #[inline(always)]
    fn turn(&self, f: &V3<T>) -> (V3<T>, [T; 2]) {
        let n = self.arm.cross(f);
        (n, [n.x, self.ca.mul_add(n.y, self.sa * n.z)])
    }
    /// A moment about the fulcrum with the force that belongs to it, about the mount.
    #[inline(always)]
    fn about_mount(&self, f: &V3<T>, n: V3<T>) -> V3<T> {
        if let Some(at) = &self.at { at.cross_add(f, &n) } else { n }
    }
}

impl<T: Scalar> Place<T, 2, 2> for Swing<T> {
    #[inline(always)]
    fn r(&self) -> V3<T> {
        if let Some(at) = &self.at { *at + self.arm } else { self.arm }
    }
    #[inline(always)]
    fn push(&self, f: V3<T>) -> Push<T, 2> {
        let (n, own) = self.turn(&f);
        Push { f, n: self.about_mount(&f, n), own }
    }
    /// `r' = l (a' cos b t + b' (-cos b x + sin b u))`, and `r''` with `t' = a' u`, `u' = -a' t`.
    #[inline(always)]
    fn motion(&self, &[a, b]: &[T; 2], acc: Option<&[T; 2]>) -> (V3<T>, V3<T>) {
        let (ls, lc) = (self.ls, self.lc);
        let (bb, ab) = (b * b, (a * b).scale(-2.0));
        let (mut x, mut t, mut u) = (ls * bb, ls * ab, lc * a.mul_add(a, bb));
        if let Some(&[a, b]) = acc {
            (x, t, u) = ((-lc).mul_add(b, x), lc.mul_add(a, t), ls.mul_add(b, u));
        }
        (self.axes(-(lc * b), lc * a, ls * b), self.axes(x, t, u))
    }
    /// About the fulcrum the columns are `m [x x arm; arm x (x x arm)]` and, `d_b` being at right angles to the arm
    /// and `t`, `m [d_b; l^2 t]`.
    #[inline(always)]
    fn coupling(&self, m: T) -> Coupling<T, 2> {
        let (h, i_b) = (self.arm.scaled(m), m * self.l * self.l);
        let hc = m * self.lc;
        let i_a = hc * self.lc;
        let (f, g) = (about_x(&h), self.d_b().scaled(m));
        let n = V3::new(i_a, self.ls * (hc * self.sa), -(self.ls * (hc * self.ca)));
        let (n, k) = (self.about_mount(&f, n), V3::new(T::zero(), self.ca * i_b, self.sa * i_b));
        ([(f, n), (g, self.about_mount(&g, k))], [i_a, i_b])
    }
    #[inline(always)]
    fn by_coordinate(&self, drive: &Drive<T, 2>) -> [V3<T>; 2] {
        let (ls, lc) = (self.ls, self.lc);
        let [a, b] = drive.nu;
        let [a2, b2] = drive.acc.map_or([T::zero(); 2], |x| x.2);
        let (rate, lift) = self.motion(&drive.nu, Some(&[a2, b2]));
        let (aa, bb, ab) = (a * a, b * b, (a * b).scale(2.0));
        // Rate and acceleration of d_b; those of d_a are x * r' and x * r'': turning about a fixed axis.
        let d_rate = self.axes(ls * b, -(ls * a), lc * b);
        let d_lift = self.axes(lc.mul_add(bb, ls * b2), -lc.mul_add(ab, ls * a2), lc.mul_add(b2, -(ls * (aa + bb))));
        let field = drive.field();
        let (d_a, w) = (about_x(&self.arm), drive.w.scaled(T::from_f64(2.0)));
        let [_, y, z] = &field.0;
        let by_a = z.scale_add(d_a.z, &y.scale_add(d_a.y, &w.cross_add(&about_x(&rate), &about_x(&lift))));
        [by_a, field.mul_add(&self.d_b(), &w.cross_add(&d_rate, &d_lift))]
    }
    #[inline(always)]
    fn by_rate(&self, drive: &Drive<T, 2>) -> [V3<T>; 2] {
        let (ls, lc) = (self.ls.scale(2.0), self.lc.scale(2.0));
        let [a, b] = drive.nu;
        let w = drive.w.scaled(T::from_f64(2.0));
        let d_a = self.axes(T::zero(), -(ls * b), lc * a);
        [w.cross_add(&about_x(&self.arm), &d_a), w.cross_add(&self.d_b(), &self.axes(ls * b, -(ls * a), lc * b))]
    }
    #[inline(always)]
    fn shift(&self, f: &V3<T>, columns: &mut [Push<T, 2>; 2]) {
        let (d_a, d_b) = (about_x(&self.arm), self.d_b());
        let aa = -self.arm.y.mul_add(f.y, self.arm.z * f.z);
        let ab = d_b.y.mul_add(f.z, -(d_b.z * f.y));
        columns[0].n = d_a.cross_add(f, &columns[0].n);
        columns[1].n = d_b.cross_add(f, &columns[1].n);
        columns[0].own[0] += aa;
        columns[0].own[1] += ab;
        columns[1].own[0] += ab;
        columns[1].own[1] -= self.arm.dot(f);
    }
    /// Everything of the arm at unit length: with `g = d a/d l`, the column of the length is `m (g, e x (a + l g) +
    /// fulcrum x g, e_k . (a + l g))`.
    #[inline(always)]
    fn by_parameter(&self, m: T, drive: &Drive<T, 2>) -> [Push<T, 2>; 2] {
        let unit = Self::of(None, T::one(), [self.sa, self.ca, self.sb, self.cb]);
        let (rate, lift) = unit.motion(&drive.nu, drive.acc.as_ref().map(|a| &a.2));
        let arm = Drive { v: V3::zero(), ..*drive };
        let (g, _) = arm.carry(&unit.arm, &rate, &lift);
        let still = V3::zero();
        let fulcrum = match &self.at {
            Some(at) => drive.carry(at, &still, &still).0,
            None => drive.w.cross(&drive.v),
        };
        let a = drive.on(g.scale_add(self.l, &fulcrum));
        let mass = self.push(a);
        let (n, own) = unit.turn(&g.scale_add(self.l, &a).scaled(m));
        let f = g.scaled(m);
        [mass, Push { f, n: self.about_mount(&f, n), own }]
    }
}
