//! Linear-first spatial algebra (6D vectors) in body coordinates.
//!
//! A twist is `[v; w]`, a wrench `[f; n]`: the linear part comes first, as in the paper's
//! `x_b = [r_b, gamma_b]`. `v` is the velocity, and `n` the moment, at the origin of the frame in which
//! the vector is written. Nothing here allocates; all operations are `#[inline]`.
//!
//! Source of the operators: R. Featherstone, *Rigid Body Dynamics Algorithms*, Springer 2008, ch. 2,
//! with the linear part moved to the front.

use crate::scalar::traits::Scalar;
use crate::spatial::small::{add, cross, dot, mm, mtv, mv, scaled, sub};
use core::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};
use nalgebra::{Matrix3, Vector3, Vector6};

/// A motion vector: twist (m/s, rad/s) or spatial acceleration (m/s^2, rad/s^2).
///
/// As an acceleration it is the componentwise time derivative of the body twist; the classical
/// acceleration of the origin is `lin + ang_velocity x lin_velocity`.
///
/// ```
/// use ff_model::nalgebra::Vector3;
/// use ff_model::{Force, Motion};
///
/// // Power of a wrench on a moving body (W).
/// let twist = Motion::new(Vector3::new(0.1, -0.3, 0.2), Vector3::new(0.4, 0.5, -0.6));
/// let wrench = Force::new(Vector3::new(3.0, 1.0, -2.0), Vector3::new(0.7, 2.0, 1.5));
/// assert!((twist.dot(&wrench) - (0.3 - 0.3 - 0.4 + 0.28 + 1.0 - 0.9_f64)).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<T: Scalar> {
    /// Linear part, of the frame origin.
    pub lin: Vector3<T>,
    /// Angular part.
    pub ang: Vector3<T>,
}

/// A force vector: wrench (N, N m) or momentum (kg m/s, kg m^2/s).
///
/// ```
/// use ff_model::nalgebra::{Matrix3, Vector3};
/// use ff_model::{Force, Xform};
///
/// // A pull of 3 N along y at a point 0.5 m along x and 0.2 m along z is a moment about the origin as well.
/// let at = Xform::new(Matrix3::identity(), Vector3::new(0.5, 0.0, 0.2));
/// let wrench = at.force_to_parent(&Force::new(Vector3::new(0.0, 3.0, 0.0), Vector3::zeros()));
/// assert!((wrench.ang - Vector3::new(-0.6, 0.0, 1.5)).norm() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Force<T: Scalar> {
    /// Linear part.
    pub lin: Vector3<T>,
    /// Angular part, about the frame origin.
    pub ang: Vector3<T>,
}

macro_rules! vector_space {
    ($name:ident) => {
        impl<T: Scalar> $name<T> {
            /// From linear and angular part.
            #[inline(always)]
            pub fn new(lin: Vector3<T>, ang: Vector3<T>) -> Self {
                Self { lin, ang }
            }
            /// The zero vector.
            #[inline(always)]
            pub fn zero() -> Self {
                Self { lin: Vector3::zeros(), ang: Vector3::zeros() }
            }
            /// From six numbers, linear first.
            ///
            /// # Panics
            /// If `s` has fewer than six elements.
            #[inline(always)]
            pub fn from_slice(s: &[T]) -> Self {
                Self { lin: Vector3::new(s[0], s[1], s[2]), ang: Vector3::new(s[3], s[4], s[5]) }
            }
            /// Into six numbers, linear first.
            ///
            /// # Panics
            /// If `s` has fewer than six elements.
            #[inline(always)]
            pub fn write_to(&self, s: &mut [T]) {
                s[0] = self.lin.x;
                s[1] = self.lin.y;
                s[2] = self.lin.z;
                s[3] = self.ang.x;
                s[4] = self.ang.y;
                s[5] = self.ang.z;
            }
            /// As a nalgebra column, linear first.
            #[inline(always)]
            pub fn to_vector(&self) -> Vector6<T> {
                Vector6::new(self.lin.x, self.lin.y, self.lin.z, self.ang.x, self.ang.y, self.ang.z)
            }
            /// Component `i` of 6, linear first.
            ///
            /// # Panics
            /// If `i >= 6`.
            #[inline(always)]
            pub fn get(&self, i: usize) -> T {
                if i < 3 { self.lin[i] } else { self.ang[i - 3] }
            }
            /// `k` times this vector.
            #[inline(always)]
            pub fn scaled(&self, k: T) -> Self {
                Self { lin: scaled(&self.lin, k), ang: scaled(&self.ang, k) }
            }
        }
        impl<T: Scalar> Add for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn add(self, o: Self) -> Self {
                Self { lin: add(&self.lin, &o.lin), ang: add(&self.ang, &o.ang) }
            }
        }
        impl<T: Scalar> Sub for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, o: Self) -> Self {
                Self { lin: sub(&self.lin, &o.lin), ang: sub(&self.ang, &o.ang) }
            }
        }
        impl<T: Scalar> Neg for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self { lin: -self.lin, ang: -self.ang }
            }
        }
        impl<T: Scalar> AddAssign for $name<T> {
            #[inline(always)]
            fn add_assign(&mut self, o: Self) {
                *self = *self + o;
            }
        }
        impl<T: Scalar> SubAssign for $name<T> {
            #[inline(always)]
            fn sub_assign(&mut self, o: Self) {
                *self = *self - o;
            }
        }
    };
}
vector_space!(Motion);
vector_space!(Force);

impl<T: Scalar> Motion<T> {
    /// Power of wrench `f` on this twist: `f . v + n . w` (W).
    #[inline(always)]
    pub fn dot(&self, f: &Force<T>) -> T {
        dot(&self.lin, &f.lin) + dot(&self.ang, &f.ang)
    }
    /// `self x m`: the rate of change of the motion vector `m` carried by a frame moving with `self`.
    #[inline(always)]
    pub fn cross(&self, m: &Self) -> Self {
        let lin = add(&cross(&self.ang, &m.lin), &cross(&self.lin, &m.ang));
        Self { lin, ang: cross(&self.ang, &m.ang) }
    }
    /// `self x* f`: the rate of change of the force vector `f` carried by a frame moving with `self`.
    #[inline(always)]
    pub fn cross_force(&self, f: &Force<T>) -> Force<T> {
        let ang = add(&cross(&self.ang, &f.ang), &cross(&self.lin, &f.lin));
        Force { lin: cross(&self.ang, &f.lin), ang }
    }
}

/// Pose of a child frame in its parent: `p_parent = rot p_child + pos` (pos in m).
///
/// ```
/// use ff_model::Xform;
/// use ff_model::nalgebra::{Matrix3, Vector3};
///
/// // A quarter turn about z, and a shift.
/// let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
/// let hand = Xform::<f64>::new(quarter, Vector3::new(0.75, -0.25, 0.5));
/// let tip = hand.point(&Vector3::new(0.5, 0.125, 0.25));
/// assert_eq!(tip, Vector3::new(0.625, 0.25, 0.75));
/// assert_eq!(hand.inverse().point(&tip), Vector3::new(0.5, 0.125, 0.25));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Xform<T: Scalar> {
    /// Rotation from child to parent coordinates.
    pub rot: Matrix3<T>,
    /// Origin of the child in parent coordinates.
    pub pos: Vector3<T>,
}

impl<T: Scalar> Xform<T> {
    /// The identity.
    #[inline(always)]
    pub fn identity() -> Self {
        Self { rot: Matrix3::identity(), pos: Vector3::zeros() }
    }
    /// From rotation (child to parent) and child origin.
    #[inline(always)]
    pub fn new(rot: Matrix3<T>, pos: Vector3<T>) -> Self {
        Self { rot, pos }
    }
    /// A motion vector given in the parent, written in the child.
    #[inline(always)]
    pub fn motion_to_child(&self, m: &Motion<T>) -> Motion<T> {
        Motion { lin: mtv(&self.rot, &add(&m.lin, &cross(&m.ang, &self.pos))), ang: mtv(&self.rot, &m.ang) }
    }
    /// A motion vector given in the child, written in the parent.
    #[inline(always)]
    pub fn motion_to_parent(&self, m: &Motion<T>) -> Motion<T> {
        let ang = mv(&self.rot, &m.ang);
        Motion { lin: add(&mv(&self.rot, &m.lin), &cross(&self.pos, &ang)), ang }
    }
    /// A force vector given in the child, written in the parent.
    #[inline(always)]
    pub fn force_to_parent(&self, f: &Force<T>) -> Force<T> {
        let lin = mv(&self.rot, &f.lin);
        Force { lin, ang: add(&mv(&self.rot, &f.ang), &cross(&self.pos, &lin)) }
    }
    /// A force vector given in the parent, written in the child.
    #[inline(always)]
    pub fn force_to_child(&self, f: &Force<T>) -> Force<T> {
        Force { lin: mtv(&self.rot, &f.lin), ang: mtv(&self.rot, &sub(&f.ang, &cross(&self.pos, &f.lin))) }
    }
    /// The inverse pose: parent in child.
    #[inline(always)]
    pub fn inverse(&self) -> Self {
        let rot = self.rot.transpose();
        Self { rot, pos: -mv(&rot, &self.pos) }
    }
    /// A point of the child in parent coordinates.
    #[inline(always)]
    pub fn point(&self, p: &Vector3<T>) -> Vector3<T> {
        add(&mv(&self.rot, p), &self.pos)
    }
}

impl<T: Scalar> Mul for Xform<T> {
    type Output = Self;
    /// Chains poses: `(a in b) * (b's child)`.
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self { rot: mm(&self.rot, &o.rot), pos: self.point(&o.pos) }
    }
}

impl Xform<f64> {
    /// The same pose over another scalar.
    pub fn lift<T: Scalar>(&self) -> Xform<T> {
        Xform { rot: self.rot.map(T::from_f64), pos: self.pos.map(T::from_f64) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::so3::{exp_so3, quat_to_rot};
    use approx::assert_relative_eq;

    fn v(a: f64, b: f64, c: f64) -> Vector3<f64> {
        Vector3::new(a, b, c)
    }
    fn pose() -> Xform<f64> {
        Xform::new(quat_to_rot(&exp_so3(&v(0.4, -1.1, 0.7))), v(0.3, -0.8, 1.9))
    }

    #[test]
    fn power_does_not_depend_on_the_frame() {
        let x = pose();
        let m = Motion::new(v(0.2, -0.5, 0.9), v(1.1, 0.3, -0.4));
        let f = Force::new(v(-0.7, 0.6, 1.3), v(0.8, -1.2, 0.1));
        assert_relative_eq!(x.motion_to_child(&m).dot(&x.force_to_child(&f)), m.dot(&f), max_relative = 1e-14);
        assert_relative_eq!(x.motion_to_parent(&x.motion_to_child(&m)).to_vector(), m.to_vector(), epsilon = 1e-14);
        assert_relative_eq!(x.force_to_parent(&x.force_to_child(&f)).to_vector(), f.to_vector(), epsilon = 1e-14);
    }

    #[test]
    fn cross_products_are_adjoint() {
        let m = Motion::new(v(0.2, -0.5, 0.9), v(1.1, 0.3, -0.4));
        let n = Motion::new(v(-1.2, 0.4, 0.3), v(0.5, -0.6, 0.8));
        let f = Force::new(v(-0.7, 0.6, 1.3), v(0.8, -1.2, 0.1));
        // (m x n) . f = - n . (m x* f)
        assert_relative_eq!(m.cross(&n).dot(&f), -n.dot(&m.cross_force(&f)), max_relative = 1e-14);
    }

    #[test]
    fn poses_chain_like_their_inverses() {
        let (a, b) = (pose(), Xform::new(quat_to_rot(&exp_so3(&v(-0.9, 0.2, 1.3))), v(-0.4, 1.1, 0.2)));
        let p = v(0.3, 0.7, -0.2);
        assert_relative_eq!((a * b).point(&p), a.point(&b.point(&p)), epsilon = 1e-14);
        assert_relative_eq!((a * a.inverse()).pos, Vector3::zeros(), epsilon = 1e-15);
    }
}
