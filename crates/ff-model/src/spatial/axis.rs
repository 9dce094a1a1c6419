//! A constant joint axis that knows when it lies along a coordinate axis.

use crate::scalar::traits::Scalar;
use crate::spatial::vec3::{M3, Pose, RotationKind, V3, turn};
use nalgebra::{Matrix3, Vector3};

/// A unit axis fixed in both frames of a joint.
///
/// Most joints turn about a coordinate axis, and a rotation about one costs a quarter of a general rotation. The
/// constant `K` of the methods is that of [`Axis::about`], or [`turn::ANY`], which holds for every axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Which coordinate axis, or [`RotationKind::General`].
    about: RotationKind,
    /// Its direction.
    sign: f64,
    u: [f64; 3],
    /// Rotation by an angle as `k[0] + cos k[1] + sin k[2]` (Rodrigues), after a constant rotation.
    k: [Matrix3<f64>; 3],
}

#[inline(always)]
fn lift<T: Scalar>(v: &[f64; 3]) -> V3<T> {
    V3::new(T::from_f64(v[0]), T::from_f64(v[1]), T::from_f64(v[2]))
}

impl Axis {
    /// From a unit vector, and the constant rotation `placement` that comes before the turn.
    pub fn new(u: &Vector3<f64>, placement: &Matrix3<f64>) -> Self {
        let along = |e: Vector3<f64>| {
            if *u == e {
                1.0
            } else if *u == -e {
                -1.0
            } else {
                0.0
            }
        };
        let signs = [along(Vector3::x()), along(Vector3::y()), along(Vector3::z())];
        let axis = [RotationKind::X, RotationKind::Y, RotationKind::Z].into_iter().zip(signs).find(|(_, s)| *s != 0.0);
        let (about, sign) = axis.unwrap_or((RotationKind::General, 1.0));
        let uu = u * u.transpose();
        let k = [placement * uu, placement * (Matrix3::identity() - uu), placement * u.cross_matrix()];
        Self { about, sign, u: (*u).into(), k }
    }
    /// Which coordinate axis, or [`RotationKind::General`].
    pub fn about(&self) -> RotationKind {
        self.about
    }
    /// Sets the rotation of `pose` to the turn by `q` (rad); `K` is [`Axis::about`] without a constant rotation,
    /// [`turn::ANY`] with one.
    #[inline(always)]
    pub fn turn<T: Scalar, const K: u8>(&self, q: T, pose: &mut Pose<T>) {
        let (s, c) = q.scale(self.sign).sin_cos();
        if K == turn::ANY {
            // Rodrigues' formula needs the angle about the axis itself.
            let s = s.scale(self.sign);
            let [k0, k1, k2] = [&self.k[0].data.0, &self.k[1].data.0, &self.k[2].data.0];
            let e = |j: usize, i: usize| {
                s.mul_add(T::from_f64(k2[j][i]), c.mul_add(T::from_f64(k1[j][i]), T::from_f64(k0[j][i])))
            };
            let col = |j: usize| V3::new(e(j, 0), e(j, 1), e(j, 2));
            pose.r = M3([col(0), col(1), col(2)]);
        } else {
            (pose.s, pose.c) = (s, c);
        }
    }
    /// `v + k u`.
    #[inline(always)]
    pub fn add<T: Scalar, const K: u8>(&self, v: V3<T>, k: T) -> V3<T> {
        match K {
            turn::X => V3::new(v.x + k.scale(self.sign), v.y, v.z),
            turn::Y => V3::new(v.x, v.y + k.scale(self.sign), v.z),
            turn::Z => V3::new(v.x, v.y, v.z + k.scale(self.sign)),
            _ => lift::<T>(&self.u).scale_add(k, &v),
        }
    }
    /// `c + v x k u`.
    #[inline(always)]
    pub fn cross_add<T: Scalar, const K: u8>(&self, v: &V3<T>, k: T, c: V3<T>) -> V3<T> {
        let r = k.scale(self.sign);
        match K {
            turn::X => V3::new(c.x, v.z.mul_add(r, c.y), (-v.y).mul_add(r, c.z)),
            turn::Y => V3::new((-v.z).mul_add(r, c.x), c.y, v.x.mul_add(r, c.z)),
            turn::Z => V3::new(v.y.mul_add(r, c.x), (-v.x).mul_add(r, c.y), c.z),
            _ => v.cross_add(&lift::<T>(&self.u).scaled(k), &c),
        }
    }
    /// `u . v`.
    #[inline(always)]
    pub fn along<T: Scalar, const K: u8>(&self, v: &V3<T>) -> T {
        match K {
            turn::X => v.x.scale(self.sign),
            turn::Y => v.y.scale(self.sign),
            turn::Z => v.z.scale(self.sign),
            _ => lift::<T>(&self.u).dot(v),
        }
    }
    /// `u x v` and `s u` for a symmetric `s`: what a turn about the axis costs.
    #[inline(always)]
    pub fn momentum<T: Scalar, const K: u8>(&self, h: &V3<T>, i: &crate::spatial::vec3::S3<T>) -> (V3<T>, V3<T>) {
        let (k, z) = (T::from_f64(self.sign), T::zero());
        match K {
            turn::X => (V3::new(z, -h.z * k, h.y * k), i.col(0).scaled(k)),
            turn::Y => (V3::new(h.z * k, z, -h.x * k), i.col(1).scaled(k)),
            turn::Z => (V3::new(-h.y * k, h.x * k, z), i.col(2).scaled(k)),
            _ => {
                let u = lift::<T>(&self.u);
                (u.cross(h), i.mul(&u))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dispatch_rotation;
    use crate::spatial::so3::{exp_so3, quat_to_rot};
    use crate::spatial::vec3::S3;
    use approx::assert_relative_eq;
    use ff_testkit::scaled;

    #[test]
    fn every_kind_of_axis_does_the_same_algebra() {
        let (v, c, q) = (Vector3::new(0.3, -1.1, 0.8), Vector3::new(0.5, 0.2, -0.9), 0.83);
        let i = S3 { xx: 2.1, xy: 0.3, yy: 3.2, xz: -0.4, yz: 0.6, zz: 2.7 };
        let full = Matrix3::new(i.xx, i.xy, i.xz, i.xy, i.yy, i.yz, i.xz, i.yz, i.zz);
        let skew = quat_to_rot(&exp_so3(&Vector3::new(0.4, -0.2, 0.7)));
        for u in [Vector3::x(), -Vector3::y(), Vector3::z(), -Vector3::z(), Vector3::new(0.6, -0.48, 0.64)] {
            for placement in [Matrix3::identity(), skew] {
                let a = Axis::new(&u, &placement);
                let near =
                    |x: V3<f64>, y: Vector3<f64>| assert_relative_eq!(Vector3::from(x), y, epsilon = scaled(1e-15));
                near(dispatch_rotation!(f64, a.about(), K => a.add::<f64, K>(V3::from(&v), q)), v + u * q);
                near(a.add::<f64, { turn::ANY }>(V3::from(&v), q), v + u * q);
                let crossed =
                    dispatch_rotation!(f64, a.about(), K => a.cross_add::<f64, K>(&V3::from(&v), q, V3::from(&c)));
                near(crossed, c + v.cross(&(u * q)));
                let along = dispatch_rotation!(f64, a.about(), K => a.along::<f64, K>(&V3::from(&v)));
                assert_relative_eq!(along, u.dot(&v), epsilon = scaled(1e-15));
                let (f, n) = dispatch_rotation!(f64, a.about(), K => a.momentum::<f64, K>(&V3::from(&v), &i));
                near(f, u.cross(&v));
                near(n, full * u);
                let mut pose = Pose::identity();
                pose.turn = if placement == skew { RotationKind::General } else { a.about() };
                dispatch_rotation!(f64, pose.turn, K => a.turn::<f64, K>(q, &mut pose));
                near(
                    dispatch_rotation!(f64, pose.turn, K => pose.up::<K>(&V3::from(&c))),
                    placement * quat_to_rot(&exp_so3(&(u * q))) * c,
                );
            }
        }
    }
}
