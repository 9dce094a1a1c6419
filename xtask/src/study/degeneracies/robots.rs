//! Robots for the degeneracies: general bodies on chosen axes.

use ff_dynamics::motion::JointMotion;
use ff_model::CoordDecl;
use ff_model::tree::JointLimits;
use ff_model::{Appendage, BaseKind, Decl, Inertia, Joint, JointKind, Model, ParamDecl, PortMatrix, Scalar, Xform};
use nalgebra::{Matrix3, Vector3};

/// A body like no other: every number depends on `k`.
pub(super) fn body(k: usize) -> Inertia<f64> {
    let x = k as f64;
    let com = Vector3::new(0.11 + 0.03 * x, -0.07 + 0.02 * x, 0.23 - 0.04 * x);
    let i = Matrix3::new(4.1 + x, 0.3, -0.21, 0.3, 5.2 + 0.7 * x, 0.17, -0.21, 0.17, 6.3 + 0.4 * x);
    Inertia::from_com(20.0 + 7.0 * x, &com, &i)
}

/// One that lies in the plane across `axis` (0, 1 or 2), so that a turn about it turns nothing else.
pub(super) fn flat(k: usize, axis: usize) -> Inertia<f64> {
    let b = body(k);
    let mut com = b.com().unwrap_or_default();
    let mut i = b.about_com();
    com[axis] = 0.0;
    for o in (0..3).filter(|o| *o != axis) {
        (i[(axis, o)], i[(o, axis)]) = (0.0, 0.0);
    }
    Inertia::from_com(b.mass, &com, &i)
}

/// A general place, the `k`-th.
pub(super) fn place(k: usize) -> Vector3<f64> {
    let x = k as f64;
    Vector3::new(0.4 + 0.1 * x, 0.3 - 0.15 * x, -0.2 + 0.12 * x)
}

/// A general axis, the `k`-th: no two are parallel or meet at right angles.
pub(super) fn axis(k: usize) -> Vector3<f64> {
    let x = k as f64;
    Vector3::new((1.1 * x + 0.3).sin(), (0.7 * x + 1.1).cos(), 0.6 + 0.1 * x)
}

/// A joint.
pub(super) fn joint(name: &str, kind: JointKind, axis: Vector3<f64>, at: Vector3<f64>) -> Joint {
    let placement = Xform::new(Matrix3::identity(), at);
    Joint { name: name.to_owned(), kind, axis, placement, limits: JointLimits::default() }
}

/// A base with a chain of joints on these axes.
pub(super) fn chain(kind: BaseKind, joints: &[(JointKind, Vector3<f64>)]) -> Model {
    let mut m = Model::new("robot", "base", body(9), kind);
    for (k, (kind, axis)) in joints.iter().enumerate() {
        m.add_body(k, format!("link{}", k + 1), joint(&format!("joint{}", k + 1), *kind, *axis, place(k)), body(k));
    }
    m
}

/// Sines on every joint, none a multiple of another.
pub(super) struct Sines {
    pub(super) joints: usize,
    pub(super) amplitude: f64,
    pub(super) seconds: f64,
}

impl JointMotion for Sines {
    fn dof(&self) -> usize {
        self.joints
    }
    fn duration(&self) -> f64 {
        self.seconds
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        for j in 0..self.joints {
            (q[j], qd[j], qdd[j]) = (0.2 * j as f64 + 0.1, 0.0, 0.0);
            for k in 0..3 {
                let w = 0.9 + 0.37 * j as f64 + 1.13 * k as f64;
                let a = self.amplitude / (1.0 + k as f64);
                // From rest: 1 - cos.
                q[j] += a * (1.0 - (w * t).cos());
                qd[j] += a * w * (w * t).sin();
                qdd[j] += a * w * w * (w * t).cos();
            }
        }
    }
}

/// Fuel whose fulcrum is not known: the mass at rest is, at the origin of the mount, but not how far away it hangs. It swings
/// by `l (alpha, beta)` across; small angles.
///
/// `T = m |v + l (alpha', beta', 0) + w x r|^2 / 2`, `U = k . angle^2 / 2`, `R = d . rate^2 / 2`. Scaling the angles by `1/s` and
/// `l, k, d` by `s, s^2, s^2` changes nothing that is felt at the base (theory: `docs/paper-errata.md`, item 15).
pub(super) struct UnknownFulcrum {
    decl: Decl,
}

impl UnknownFulcrum {
    pub(super) fn new() -> Self {
        let values = [
            ("mass", "kg", 40.0),
            ("length", "m", 0.7),
            ("k[0]", "N m/rad", 11.0),
            ("k[1]", "N m/rad", 14.0),
            ("d[0]", "N m s/rad", 1.3),
            ("d[1]", "N m s/rad", 0.9),
        ];
        let params = values.map(|(n, u, x)| ParamDecl::positive(n, u, x)).to_vec();
        let coords = ["alpha", "beta"].map(|n| CoordDecl { name: n.into(), unit: "rad", range: (-1.5, 1.5) }).to_vec();
        Self { decl: Decl { kind: "unknown_fulcrum", coords, params } }
    }
}

impl Appendage for UnknownFulcrum {
    fn decl(&self) -> &Decl {
        &self.decl
    }
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let (l, z) = (p[1], T::zero());
        let r = Vector3::new(l * eta[0], l * eta[1], z);
        m.add_point(p[0], &r, &[Vector3::new(l, z, z), Vector3::new(z, l, z)]);
    }
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        (p[2] * eta[0] * eta[0] + p[3] * eta[1] * eta[1]).scale(0.5)
    }
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        (p[4] * nu[0] * nu[0] + p[5] * nu[1] * nu[1]).scale(0.5)
    }
}
