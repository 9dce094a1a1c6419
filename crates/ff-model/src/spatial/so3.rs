//! Rotations: unit quaternions (w, x, y, z), exponential map, Euler angles for reports.
//!
//! Written here rather than taken from nalgebra, because `UnitQuaternion::from_scaled_axis` over dual
//! numbers loses its derivative at zero; these use series that hold there. Nothing allocates.

use crate::scalar::traits::Scalar;
use crate::spatial::small::cross;
use nalgebra::{Matrix3, Vector3, Vector4};

/// A quaternion as `[w, x, y, z]`; unit norm unless stated. Rotates body coordinates into the world.
pub type Quat<T> = Vector4<T>;

/// The identity rotation.
pub fn quat_identity<T: Scalar>() -> Quat<T> {
    Vector4::new(T::one(), T::zero(), T::zero(), T::zero())
}

/// Hamilton product `a b`: first `b`, then `a`.
#[inline(always)]
pub fn quat_mul<T: Scalar>(a: &Quat<T>, b: &Quat<T>) -> Quat<T> {
    let (aw, ax, ay, az) = (a[0], a[1], a[2], a[3]);
    let (bw, bx, by, bz) = (b[0], b[1], b[2], b[3]);
    Vector4::new(
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
}

/// The inverse rotation of a unit quaternion.
#[inline(always)]
pub fn quat_conj<T: Scalar>(q: &Quat<T>) -> Quat<T> {
    Vector4::new(q[0], -q[1], -q[2], -q[3])
}

/// `q / |q|`.
#[inline(always)]
pub fn quat_normalize<T: Scalar>(q: &Quat<T>) -> Quat<T> {
    let n2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    let n = n2.sqrt();
    Vector4::new(q[0] / n, q[1] / n, q[2] / n, q[3] / n)
}

/// Rotation matrix (body to world) of a unit quaternion.
#[inline(always)]
pub fn quat_to_rot<T: Scalar>(q: &Quat<T>) -> Matrix3<T> {
    let (w, x, y, z) = (q[0], q[1], q[2], q[3]);
    let two = T::from_f64(2.0);
    let one = T::one();
    Matrix3::new(
        one - two * (y * y + z * z),
        two * (x * y - w * z),
        two * (x * z + w * y),
        two * (x * y + w * z),
        one - two * (x * x + z * z),
        two * (y * z - w * x),
        two * (x * z - w * y),
        two * (y * z + w * x),
        one - two * (x * x + y * y),
    )
}

/// Unit quaternion of a rotation matrix (Shepperd's choice of the largest pivot); `w >= 0`.
pub fn rot_to_quat(r: &Matrix3<f64>) -> Quat<f64> {
    let t = r.trace();
    let q = if t >= r[(0, 0)] && t >= r[(1, 1)] && t >= r[(2, 2)] {
        Vector4::new(1.0 + t, r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)])
    } else {
        let i = if r[(0, 0)] >= r[(1, 1)] && r[(0, 0)] >= r[(2, 2)] {
            0
        } else if r[(1, 1)] >= r[(2, 2)] {
            1
        } else {
            2
        };
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let mut q = Vector4::zeros();
        q[0] = r[(k, j)] - r[(j, k)];
        q[1 + i] = 1.0 + r[(i, i)] - r[(j, j)] - r[(k, k)];
        q[1 + j] = r[(j, i)] + r[(i, j)];
        q[1 + k] = r[(k, i)] + r[(i, k)];
        q
    };
    let q = q / q.norm();
    if q[0] < 0.0 { -q } else { q }
}

/// `sin(h)/h` and `cos(h)` as functions of `h^2`, smooth through zero.
///
/// The series serves when it may for every lane. Where lanes differ, a zero among them must not become `0/0`: what is
/// added to `h^2` is lost in any number above the switch, and makes the quotient 1 at zero.
#[inline(always)]
fn sinc_cos<T: Scalar>(h2: T) -> (T, T) {
    if (T::from_f64(1e-4) - h2).is_positive() {
        // Taylor to h^8: the first term left out is below 1e-23 at the switch.
        let c = |k: f64| T::from_f64(k);
        let s = c(1.0) - h2 * (c(1.0 / 6.0) - h2 * (c(1.0 / 120.0) - h2 * (c(1.0 / 5040.0) - h2 * c(1.0 / 362_880.0))));
        let co = c(1.0) - h2 * (c(0.5) - h2 * (c(1.0 / 24.0) - h2 * (c(1.0 / 720.0) - h2 * c(1.0 / 40320.0))));
        (s, co)
    } else {
        let h = (h2 + T::from_f64(1e-300)).sqrt();
        let (s, c) = h.sin_cos();
        (s / h, c)
    }
}

/// Unit quaternion of the rotation vector `u` (rad): `exp(u / 2)`. Exact derivatives at zero.
#[inline(always)]
pub fn exp_so3<T: Scalar>(u: &Vector3<T>) -> Quat<T> {
    // Products written out: nalgebra's are not inlined into code for lanes.
    let half = Vector3::new(u.x.scale(0.5), u.y.scale(0.5), u.z.scale(0.5));
    let h2 = half.x * half.x + half.y * half.y + half.z * half.z;
    let (sinc, cos) = sinc_cos(h2);
    Vector4::new(cos, half.x * sinc, half.y * sinc, half.z * sinc)
}

/// Rotation vector (rad) of a unit quaternion, the short way round (`|u| <= pi`).
pub fn log_so3(q: &Quat<f64>) -> Vector3<f64> {
    let s = if q[0] < 0.0 { -1.0 } else { 1.0 };
    let v = Vector3::new(q[1], q[2], q[3]) * s;
    let n = v.norm();
    let w = q[0] * s;
    let k = if n < 1e-9 { 2.0 / w } else { 2.0 * n.atan2(w) / n };
    v * k
}

/// Right-trivialised inverse derivative of the exponential, to fourth order:
/// `dexp^-1_u(w) = w + 1/2 u x w + 1/12 u x (u x w)` for body rates `w`.
///
/// Body-fixed rates pair with right multiplication `q_{n+1} = q_n exp(u)`; the sign of the middle term
/// is the one for that side. Source: Iserles et al., *Lie-group methods*, Acta Numerica 2000, eq. (2.46).
#[inline(always)]
pub fn dexp_inv_body<T: Scalar>(u: &Vector3<T>, w: &Vector3<T>) -> Vector3<T> {
    let uw = cross(u, w);
    let uuw = cross(u, &uw);
    let term = |i: usize| w[i] + uw[i].scale(0.5) + uuw[i].scale(1.0 / 12.0);
    Vector3::new(term(0), term(1), term(2))
}

/// Angle of the rotation from `a` to `b` (rad, 0 to pi): the geodesic distance on SO(3).
pub fn geodesic_angle(a: &Quat<f64>, b: &Quat<f64>) -> f64 {
    log_so3(&quat_mul(&quat_conj(a), b)).norm()
}

/// Roll, pitch, yaw (rad) of a rotation matrix `Rz(yaw) Ry(pitch) Rx(roll)`, as URDF writes it. Reports only.
pub fn rpy_of(r: &Matrix3<f64>) -> Vector3<f64> {
    let pitch = (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)]));
    Vector3::new(r[(2, 1)].atan2(r[(2, 2)]), pitch, r[(1, 0)].atan2(r[(0, 0)]))
}

/// Rotation matrix of roll, pitch, yaw (rad): `Rz(yaw) Ry(pitch) Rx(roll)`.
pub fn rot_of_rpy(rpy: &Vector3<f64>) -> Matrix3<f64> {
    let ax = |i: usize, a: f64| {
        let mut u = Vector3::zeros();
        u[i] = a;
        quat_to_rot(&exp_so3(&u))
    };
    ax(2, rpy.z) * ax(1, rpy.y) * ax(0, rpy.x)
}

/// Right Jacobian of the exponential: `exp(u + du) = exp(u) exp(J(u) du)` to first order,
/// `J(u) = 1 - (1 - cos|u|)/|u|^2 [u]x + (|u| - sin|u|)/|u|^3 [u]x^2`; its transpose, `J(-u)`, is the left one
/// (T. Barfoot, *State Estimation for Robotics*, 2017, eq. (7.77)). Does not allocate.
pub fn right_jacobian(u: &Vector3<f64>) -> Matrix3<f64> {
    let (t2, ux) = (u.norm_squared(), u.cross_matrix());
    // Series below, where the closed forms cancel: next terms are t^4/720 and t^4/5040.
    let (a, b) = if t2 < 1e-4 {
        (0.5 - t2 / 24.0 + t2 * t2 / 720.0, 1.0 / 6.0 - t2 / 120.0 + t2 * t2 / 5040.0)
    } else {
        let t = t2.sqrt();
        ((1.0 - t.cos()) / t2, (t - t.sin()) / (t2 * t))
    };
    Matrix3::identity() - ux * a + ux * ux * b
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::dual::Dual;
    use approx::assert_relative_eq;

    #[test]
    fn exponential_and_logarithm_are_inverse_through_the_switch() {
        for s in [0.0, 1e-12, 1e-6, 0.019, 0.021, 1.3, 3.1] {
            let u = Vector3::new(0.48, -0.6, 0.64) * s;
            assert_relative_eq!(log_so3(&exp_so3(&u)), u, epsilon = 1e-14, max_relative = 1e-13);
            let r = quat_to_rot(&exp_so3(&u));
            assert_relative_eq!(rot_to_quat(&r), exp_so3(&u), epsilon = 1e-14);
        }
    }

    #[test]
    fn derivative_of_the_exponential_at_zero_is_one_half() {
        let u = Vector3::new(Dual::<f64, 1>::variable(0.0, 0), Dual::constant(0.0), Dual::constant(0.0));
        assert_eq!(exp_so3(&u)[1].eps[0], 0.5);
    }

    /// One lane at zero, one below the switch to the series, two above it: each as if it were alone.
    #[test]
    fn lanes_on_both_sides_of_the_switch_do_not_disturb_each_other() {
        use crate::scalar::lanes::{Lanes, Portable4};
        let sizes = [0.0, 1e-3, 0.4, 2.7];
        for turn in 0..4 {
            let size = |l: usize| sizes[(l + turn) % 4];
            let one = |l: usize| Vector3::new(0.48, -0.6, 0.64) * size(l);
            let u = Vector3::from_fn(|i, _| Portable4::load(&[one(0)[i], one(1)[i], one(2)[i], one(3)[i]]));
            let q = exp_so3(&u);
            for l in 0..4 {
                let want = exp_so3(&one(l));
                for i in 0..4 {
                    assert!((q[i].lane(l) - want[i]).abs() < 1e-15, "lane {l}, |u| = {}", size(l));
                }
            }
        }
    }

    #[test]
    fn rpy_round_trip_and_geodesic() {
        let rpy = Vector3::new(0.3, -0.9, 2.1);
        assert_relative_eq!(rpy_of(&rot_of_rpy(&rpy)), rpy, epsilon = 1e-14);
        let a = exp_so3(&Vector3::new(0.2, 0.5, -0.1));
        let b = quat_mul(&a, &exp_so3(&Vector3::new(-0.3, 0.1, 0.25)));
        assert_relative_eq!(geodesic_angle(&a, &b), Vector3::new(-0.3, 0.1, 0.25).norm(), max_relative = 1e-13);
    }

    #[test]
    fn right_jacobian_is_the_turn_of_a_changed_rotation_vector() {
        // On both sides of the switch to the series; central differences.
        for size in [1e-3, 0.0099, 0.0101, 0.7, 2.4] {
            let (u, du, h) = (Vector3::new(0.48, -0.6, 0.64) * size, Vector3::new(0.7, 0.4, -1.1), 1e-5);
            let at = |h: f64| log_so3(&quat_mul(&quat_conj(&exp_so3(&u)), &exp_so3(&(u + du * h))));
            assert_relative_eq!(right_jacobian(&u) * du, (at(h) - at(-h)) / (2.0 * h), epsilon = 1e-9);
        }
    }

    #[test]
    fn dexp_inverse_is_the_rate_of_the_rotation_vector() {
        // d/dt exp(u(t)) = exp(u) w with u' = dexp_inv(u, w): check by differencing the quaternion.
        let (u, w, h) = (Vector3::new(0.02, -0.03, 0.01), Vector3::new(0.7, 0.4, -1.1), 1e-6);
        let du = dexp_inv_body(&u, &w);
        let plus = quat_mul(&exp_so3(&u), &exp_so3(&(w * h)));
        let want = (log_so3(&plus) - u) / h;
        assert_relative_eq!(du, want, epsilon = 2e-6);
    }
}
