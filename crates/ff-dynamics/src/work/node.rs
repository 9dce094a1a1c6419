//! A body and its joint in base axes, for the derivatives.

use ff_model::Scalar;
use ff_model::spatial::vec3::{M3, PackedInertia, Pose, RotationKind, V3};

/// A body and its joint in base axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node<T: Scalar> {
    /// Pose in the base.
    pub(crate) pose: Pose<T>,
    /// Spatial velocity and acceleration: linear part at the base origin, angular part.
    pub(crate) u: V3<T>,
    pub(crate) w: V3<T>,
    pub(crate) al: V3<T>,
    pub(crate) aw: V3<T>,
    /// Joint screw and its two rates.
    pub(crate) s: Screw<T>,
    pub(crate) psi: Screw<T>,
    pub(crate) psi2: Screw<T>,
    /// Composite inertia, linear momentum, `D`, and wrench.
    pub(crate) ic: PackedInertia<T>,
    pub(crate) p: V3<T>,
    pub(crate) d: M3<T>,
    pub(crate) f: V3<T>,
    pub(crate) n: V3<T>,
}

/// Linear part at the base origin, angular part.
pub(crate) type Screw<T> = (V3<T>, V3<T>);

impl<T: Scalar> Node<T> {
    pub(crate) fn zero() -> Self {
        let z = V3::zero();
        let mut pose = Pose::identity();
        pose.turn = RotationKind::General;
        Self {
            pose,
            u: z,
            w: z,
            al: z,
            aw: z,
            s: (z, z),
            psi: (z, z),
            psi2: (z, z),
            ic: PackedInertia::zero(),
            p: z,
            d: M3::zero(),
            f: z,
            n: z,
        }
    }
    #[inline(always)]
    pub(crate) fn add(&mut self, o: &Self) {
        self.ic.add(&o.ic);
        self.p += o.p;
        self.f += o.f;
        self.n += o.n;
        for k in 0..3 {
            self.d.0[k] += o.d.0[k];
        }
    }
    /// What a small change of angular velocity does to force and moment.
    #[inline(always)]
    pub(crate) fn turning(&self, w: &V3<T>) -> Screw<T> {
        (w.cross(&self.p).scaled(T::from_f64(2.0)), self.d.mul(w))
    }
}
