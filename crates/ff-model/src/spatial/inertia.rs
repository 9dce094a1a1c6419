//! Rigid-body inertia: ten parameters, spatial matrix, pseudo-inertia, and physical consistency.
//!
//! The ten numbers of a body are `phi = [m, hx, hy, hz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz]` with `h = m c` the
//! first moment and `I` the rotational inertia **about the body frame origin**, in the body frame
//! (the order of Pinocchio's `toDynamicParameters`).

use crate::scalar::traits::Scalar;
use crate::spatial::motion::{Force, Motion, Xform};
use crate::spatial::small::{add, cross, dot, mv, rotate_sym, scaled};
use nalgebra::{Matrix3, Matrix4, Matrix6, Vector3};

/// Names of the ten inertial parameters, in order.
pub const INERTIAL_NAMES: [&str; 10] = ["mass", "h_x", "h_y", "h_z", "i_xx", "i_xy", "i_yy", "i_xz", "i_yz", "i_zz"];
/// SI units of the ten inertial parameters, in order.
pub const INERTIAL_UNITS: [&str; 10] =
    ["kg", "kg m", "kg m", "kg m", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2"];
/// Row and column of each of the six rotational parameters.
const SYM: [(usize, usize); 6] = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)];

/// Inertia of a rigid body about the origin of its frame.
///
/// ```
/// use ff_model::Inertia;
/// use ff_model::nalgebra::{Matrix3, Vector3};
///
/// let about_com = Matrix3::new(9.0, 0.3, -0.2, 0.3, 8.0, 0.4, -0.2, 0.4, 7.0);
/// let hull = Inertia::from_com(50.0, &Vector3::new(0.2, -0.1, 0.3), &about_com);
/// assert_eq!(hull.to_params()[..4], [50.0, 10.0, -5.0, 15.0]);
/// assert!(hull.check().is_ok());
/// // No body has a principal moment of inertia above the sum of the other two.
/// let impossible = Matrix3::from_diagonal(&Vector3::new(9.0, 1.2, 1.4));
/// assert!(Inertia::from_com(50.0, &Vector3::new(0.2, -0.1, 0.3), &impossible).check().is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia<T: Scalar> {
    /// Mass (kg).
    pub mass: T,
    /// First moment of mass `m c` (kg m).
    pub h: Vector3<T>,
    /// Rotational inertia about the frame origin (kg m^2), symmetric.
    pub rot: Matrix3<T>,
}

/// Why ten numbers are not the inertia of any body.
#[derive(Clone, Debug, PartialEq)]
pub enum InertiaError {
    /// A parameter is NaN or infinite.
    NotFinite {
        /// Which of the ten.
        name: &'static str,
    },
    /// Mass zero or negative.
    NonPositiveMass {
        /// The mass (kg).
        value: f64,
    },
    /// The rotational inertia about the centre of mass is not positive semidefinite.
    NotPsd {
        /// Principal moments, ascending (kg m^2).
        moments: [f64; 3],
    },
    /// One principal moment exceeds the sum of the other two.
    Triangle {
        /// Principal moments, ascending (kg m^2).
        moments: [f64; 3],
        /// How far the largest exceeds the sum of the others (kg m^2).
        violation: f64,
    },
}

impl core::fmt::Display for InertiaError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotFinite { name } => write!(f, "inertial parameter {name} is not finite"),
            Self::NonPositiveMass { value } => write!(f, "mass {value} kg is not positive"),
            Self::NotPsd { moments } => {
                write!(f, "inertia about the centre of mass has negative principal moments {moments:?} kg m^2")
            }
            Self::Triangle { moments, violation } => {
                write!(f, "principal moments {moments:?} kg m^2 violate the triangle inequality by {violation} kg m^2")
            }
        }
    }
}

impl std::error::Error for InertiaError {}

#[inline(always)]
fn skew<T: Scalar>(v: &Vector3<T>) -> Matrix3<T> {
    let z = T::zero();
    Matrix3::new(z, -v.z, v.y, v.z, z, -v.x, -v.y, v.x, z)
}

impl<T: Scalar> Inertia<T> {
    /// No mass at all.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { mass: T::zero(), h: Vector3::zeros(), rot: Matrix3::zeros() }
    }
    /// A point mass `m` at `c`.
    #[inline]
    pub fn point(mass: T, c: &Vector3<T>) -> Self {
        let h = c * mass;
        Self { mass, h, rot: Self::steiner(&h, c) }
    }
    /// From mass, centre of mass and inertia about the centre of mass (all in the body frame).
    ///
    /// `I_o = I_c + m (|c|^2 1 - c c^T)` (parallel axis theorem).
    #[inline]
    pub fn from_com(mass: T, c: &Vector3<T>, i_com: &Matrix3<T>) -> Self {
        let h = c * mass;
        Self { mass, h, rot: i_com + Self::steiner(&h, c) }
    }
    /// `(h . c) 1 - h c^T`, which is `m (|c|^2 1 - c c^T)` for `h = m c`.
    #[inline(always)]
    fn steiner(h: &Vector3<T>, c: &Vector3<T>) -> Matrix3<T> {
        let d = dot(h, c);
        Matrix3::from_diagonal_element(d) - h * c.transpose()
    }
    /// From the ten parameters.
    ///
    /// # Panics
    /// If `p` has fewer than ten elements.
    #[inline(always)]
    pub fn from_params(p: &[T]) -> Self {
        Self {
            mass: p[0],
            h: Vector3::new(p[1], p[2], p[3]),
            rot: Matrix3::new(p[4], p[5], p[7], p[5], p[6], p[8], p[7], p[8], p[9]),
        }
    }
    /// To the ten parameters.
    #[inline]
    pub fn to_params(&self) -> [T; 10] {
        let mut p = [T::zero(); 10];
        p[0] = self.mass;
        p[1] = self.h.x;
        p[2] = self.h.y;
        p[3] = self.h.z;
        for (k, &(i, j)) in SYM.iter().enumerate() {
            p[4 + k] = self.rot[(i, j)];
        }
        p
    }
    /// Momentum of a body moving with twist `v`: `[m v + w x h; h x v + I w]`.
    #[inline(always)]
    pub fn mul_motion(&self, v: &Motion<T>) -> Force<T> {
        let lin = add(&scaled(&v.lin, self.mass), &cross(&v.ang, &self.h));
        Force { lin, ang: add(&mv(&self.rot, &v.ang), &cross(&self.h, &v.lin)) }
    }
    /// Kinetic energy at twist `v` (J): `v . I v / 2`.
    #[inline]
    pub fn kinetic(&self, v: &Motion<T>) -> T {
        v.dot(&self.mul_motion(v)).scale(0.5)
    }
    /// The 6 x 6 spatial inertia matrix, linear first.
    pub fn to_matrix(&self) -> Matrix6<T> {
        let mut m = Matrix6::zeros();
        let s = skew(&self.h);
        for i in 0..3 {
            m[(i, i)] = self.mass;
            for j in 0..3 {
                m[(i, j + 3)] = -s[(i, j)];
                m[(i + 3, j)] = s[(i, j)];
                m[(i + 3, j + 3)] = self.rot[(i, j)];
            }
        }
        m
    }
    /// The body behind a 6 x 6 spatial inertia matrix, of which `m(i, j)` is an element: the inverse of
    /// [`Inertia::to_matrix`]. A matrix without the ten-parameter structure gives the body that shares these
    /// of its elements: (0,0), the lower left (5,1), (3,2), (4,0), and the lower right block.
    #[inline(always)]
    pub fn from_elements(m: impl Fn(usize, usize) -> T) -> Self {
        let rot = Matrix3::new(m(3, 3), m(3, 4), m(3, 5), m(4, 3), m(4, 4), m(4, 5), m(5, 3), m(5, 4), m(5, 5));
        Self { mass: m(0, 0), h: Vector3::new(m(5, 1), m(3, 2), m(4, 0)), rot }
    }
    /// The same body seen from the parent frame of `x` (`x` = pose of this frame in the parent).
    ///
    /// `h' = R h + m p`, `I' = R I R^T + (2 p.h_R + m p.p) 1 - (h_R p^T + p h_R^T) - m p p^T` with `h_R = R h`.
    #[inline(always)]
    pub fn to_parent(&self, x: &Xform<T>) -> Self {
        let hr = mv(&x.rot, &self.h);
        let p = &x.pos;
        let h = add(&hr, &scaled(p, self.mass));
        // m(|p|^2 1 - p p^T) + 2 p.hr 1 - hr p^T - p hr^T  =  ((hr + h).p) 1 - h p^T - p hr^T
        let d = dot(&add(&hr, &h), p);
        let mut rot = rotate_sym(&x.rot, &self.rot);
        for i in 0..3 {
            rot[(i, i)] += d;
            for j in 0..3 {
                rot[(i, j)] -= h[i] * p[j] + p[i] * hr[j];
            }
        }
        Self { mass: self.mass, h, rot }
    }
    /// The 4 x 4 pseudo-inertia `[[S, h], [h^T, m]]` with `S = tr(I)/2 1 - I`.
    ///
    /// The body is physically consistent exactly when this matrix is positive semidefinite
    /// (P. Wensing, S. Kim, J.-J. Slotine, *Linear matrix inequalities for physically consistent inertial
    /// parameter identification*, IEEE RA-L 3(1), 2018, eq. (13)).
    pub fn pseudo(&self) -> Matrix4<T> {
        let half = self.rot.trace().scale(0.5);
        let mut p = Matrix4::zeros();
        for i in 0..3 {
            for j in 0..3 {
                p[(i, j)] = -self.rot[(i, j)];
            }
            p[(i, i)] += half;
            p[(i, 3)] = self.h[i];
            p[(3, i)] = self.h[i];
        }
        p[(3, 3)] = self.mass;
        p
    }
    /// From a symmetric 4 x 4 pseudo-inertia; inverse of [`Inertia::pseudo`]: `I = tr(S) 1 - S`.
    pub fn from_pseudo(p: &Matrix4<T>) -> Self {
        let s = Matrix3::from_fn(|i, j| p[(i, j)]);
        Self {
            mass: p[(3, 3)],
            h: Vector3::new(p[(0, 3)], p[(1, 3)], p[(2, 3)]),
            rot: Matrix3::from_diagonal_element(s.trace()) - s,
        }
    }
}

impl<T: Scalar> core::ops::Add for Inertia<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self { mass: self.mass + o.mass, h: self.h + o.h, rot: self.rot + o.rot }
    }
}
impl<T: Scalar> core::ops::AddAssign for Inertia<T> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        self.mass += o.mass;
        self.h += o.h;
        self.rot += o.rot;
    }
}

impl Inertia<f64> {
    /// Centre of mass in the body frame (m); `None` for a massless body.
    pub fn com(&self) -> Option<Vector3<f64>> {
        (self.mass > 0.0).then(|| self.h / self.mass)
    }
    /// Rotational inertia about the centre of mass, body axes (kg m^2); about the origin if massless.
    pub fn about_com(&self) -> Matrix3<f64> {
        match self.com() {
            Some(c) => self.rot - Self::steiner(&self.h, &c),
            None => self.rot,
        }
    }
    /// Rate of this inertia about its fixed origin when the body moves with twist `s` (same frame):
    /// `h' = w x h + m v`, `I' = [w]I - I[w] + 2 (h.v) 1 - h v^T - v h^T`; the mass part is zero.
    pub fn rate(&self, s: &Motion<f64>) -> Self {
        let (v, w) = (&s.lin, &s.ang);
        let wx = skew(w);
        let hv = self.h * v.transpose();
        Self {
            mass: 0.0,
            h: cross(w, &self.h) + v * self.mass,
            rot: wx * self.rot - self.rot * wx + Matrix3::from_diagonal_element(2.0 * dot(&self.h, v))
                - hv
                - hv.transpose(),
        }
    }
    /// The same parameters over another scalar, with zero derivatives.
    pub fn lift<T: Scalar>(&self) -> Inertia<T> {
        Inertia { mass: T::from_f64(self.mass), h: self.h.map(T::from_f64), rot: self.rot.map(T::from_f64) }
    }
    /// True when every parameter is exactly zero.
    pub fn is_zero(&self) -> bool {
        self.to_params().iter().all(|&x| x == 0.0)
    }
    /// Checks that some body could have this inertia: finite, `m > 0`, pseudo-inertia positive
    /// semidefinite (which contains the triangle inequality of the principal moments).
    ///
    /// A point mass or thin rod sits on the boundary, so moments are compared with a slack of `1e-9`
    /// of the largest.
    ///
    /// # Errors
    /// The first law that is broken.
    pub fn check(&self) -> Result<(), InertiaError> {
        for (k, x) in self.to_params().iter().enumerate() {
            if !x.is_finite() {
                return Err(InertiaError::NotFinite { name: INERTIAL_NAMES[k] });
            }
        }
        if self.mass <= 0.0 {
            return Err(InertiaError::NonPositiveMass { value: self.mass });
        }
        let mut e: [f64; 3] = self.about_com().symmetric_eigenvalues().into();
        e.sort_by(f64::total_cmp);
        let slack = 1e-9 * e[2].abs().max(self.rot.trace().abs() * 1e-3);
        if e[0] < -slack {
            return Err(InertiaError::NotPsd { moments: e });
        }
        let violation = e[2] - e[0] - e[1];
        if violation > slack {
            return Err(InertiaError::Triangle { moments: e, violation });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::so3::{exp_so3, quat_to_rot};
    use approx::assert_relative_eq;

    fn body() -> Inertia<f64> {
        let r = quat_to_rot(&exp_so3(&Vector3::new(0.3, -0.7, 1.1)));
        let i = r * Matrix3::from_diagonal(&Vector3::new(1.3, 2.1, 2.9)) * r.transpose();
        Inertia::from_com(3.7, &Vector3::new(0.4, -0.2, 0.9), &i)
    }

    #[test]
    fn all_three_representations_carry_the_same_body() {
        let b = body();
        let m = b.to_matrix();
        assert_eq!(Inertia::from_elements(|i, j| m[(i, j)]), b);
        assert_relative_eq!(Inertia::from_params(&b.to_params()).rot, b.rot, epsilon = 1e-15);
        let p = Inertia::from_pseudo(&b.pseudo());
        assert_relative_eq!(p.rot, b.rot, max_relative = 1e-14);
        assert_relative_eq!(p.h, b.h);
        let v = Motion::new(Vector3::new(0.3, -1.1, 0.8), Vector3::new(0.5, 0.2, -0.9));
        assert_relative_eq!(b.to_matrix() * v.to_vector(), b.mul_motion(&v).to_vector(), max_relative = 1e-14);
    }

    #[test]
    fn kinetic_energy_does_not_depend_on_the_frame() {
        let x = Xform::new(quat_to_rot(&exp_so3(&Vector3::new(-0.4, 1.2, 0.6))), Vector3::new(1.1, -0.3, 0.7));
        let v = Motion::new(Vector3::new(0.3, -1.1, 0.8), Vector3::new(0.5, 0.2, -0.9));
        let b = body();
        assert_relative_eq!(b.to_parent(&x).kinetic(&x.motion_to_parent(&v)), b.kinetic(&v), max_relative = 1e-14);
    }

    #[test]
    fn rate_is_the_change_along_a_motion() {
        let s = Motion::new(Vector3::new(0.3, -1.1, 0.8), Vector3::new(0.5, 0.2, -0.9));
        // A short way along the twist, as a pose of the body in the fixed frame.
        let along = |t: f64| {
            let turn = quat_to_rot(&exp_so3(&(s.ang * t)));
            body().to_parent(&Xform::new(turn, s.lin * t))
        };
        let h = 1e-6;
        let (a, b, rate) = (along(-h), along(h), body().rate(&s));
        assert_relative_eq!((b.h - a.h) / (2.0 * h), rate.h, epsilon = 1e-8);
        assert_relative_eq!((b.rot - a.rot) / (2.0 * h), rate.rot, epsilon = 1e-8);
    }

    #[test]
    fn checks_name_the_broken_law() {
        assert_eq!(body().check(), Ok(()));
        let rod =
            Inertia::from_com(2.0, &Vector3::new(0.1, 0.2, 0.3), &Matrix3::from_diagonal(&Vector3::new(0.0, 1.0, 1.0)));
        assert_eq!(rod.check(), Ok(()));
        let tri = Inertia::from_com(2.0, &Vector3::zeros(), &Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 100.0)));
        assert!(
            matches!(tri.check(), Err(InertiaError::Triangle { violation, .. }) if (violation - 98.0).abs() < 1e-9)
        );
        // Inertia given about the origin where the centre of mass was meant (theory.md 5.18).
        let wrong =
            Inertia { mass: 600.0, h: Vector3::new(540.0, 0.0, 360.0), rot: Matrix3::from_diagonal_element(150.0) };
        assert!(matches!(wrong.check(), Err(InertiaError::NotPsd { .. })));
        let mut neg = body();
        neg.mass = -1.0;
        assert!(matches!(neg.check(), Err(InertiaError::NonPositiveMass { .. })));
        neg.mass = f64::NAN;
        assert!(matches!(neg.check(), Err(InertiaError::NotFinite { name: "mass" })));
    }
}
