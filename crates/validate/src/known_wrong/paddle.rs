//! A rigid body on one sprung hinge at the mount, with ten inertial parameters, with and without a mistake.

use ff_model::CoordDecl;
use ff_model::port::{TreeTwin, TwinBody};
use ff_model::{Appendage, Decl, Inertia, ParamDecl, PortMatrix, Scalar, Xform};
use nalgebra::{Matrix3, Vector3};

const K: usize = 10;
const D: usize = 11;
const LENGTH: usize = 12;
const STIFFNESS: f64 = 40.0;
const DAMPING: f64 = 0.9;

/// The mistakes; see [`super::known_wrong`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PaddleMistake {
    MassSquared,
    ScaledByLength,
    SpringPerMass,
    TwinSpring,
    FrozenInertia,
}
use PaddleMistake as Wrong;

/// The paddle. It turns about the z axis of its mount.
pub(super) struct Paddle {
    decl: Decl,
    wrong: Option<Wrong>,
}

impl Paddle {
    pub(super) fn new(wrong: Option<Wrong>) -> Self {
        let mut params = ParamDecl::inertial("blade", &blade());
        params.push(ParamDecl::positive("k", "N m/rad", STIFFNESS));
        params.push(ParamDecl::positive("d", "N m s/rad", DAMPING));
        if wrong == Some(Wrong::ScaledByLength) {
            params.push(ParamDecl::positive("length", "m", 1.3));
        }
        let coords = [CoordDecl::new("q", "rad", (-1.5, 1.5))];
        Self { decl: Decl::new("paddle", coords, params), wrong }
    }
}

fn blade() -> Inertia<f64> {
    let about_com = Matrix3::new(0.9, 0.06, -0.04, 0.06, 0.7, 0.05, -0.04, 0.05, 1.1);
    Inertia::from_com(6.0, &Vector3::new(0.5, -0.2, 0.1), &about_com)
}

impl Appendage for Paddle {
    fn decl(&self) -> &Decl {
        &self.decl
    }

    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let mut body = Inertia::from_params(&p[..10]);
        let factor = match self.wrong {
            Some(Wrong::MassSquared) => Some(p[0].scale(1.0 / 6.0)),
            Some(Wrong::ScaledByLength) => Some(p[LENGTH]),
            _ => None,
        };
        if let Some(k) = factor {
            body = Inertia { mass: body.mass * k, h: body.h * k, rot: body.rot * k };
        }
        let (s, c) = if self.wrong == Some(Wrong::FrozenInertia) { T::zero().sin_cos() } else { eta[0].sin_cos() };
        let (o, one) = (T::zero(), T::one());
        let turned = body.to_parent(&Xform::new(Matrix3::new(c, -s, o, s, c, o, o, o, one), Vector3::zeros()));
        m.add_host(&turned);
        // The hinge rate is an angular velocity about z: its column is that of w_z.
        for i in 0..6 {
            let x = m.view().get(i, 5);
            m.set_sym(i, 6, x);
        }
        m.set_sym(6, 6, turned.rot[(2, 2)]);
    }

    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        let k = if self.wrong == Some(Wrong::SpringPerMass) { p[K] * p[0] } else { p[K] };
        (k * eta[0] * eta[0]).scale(0.5)
    }

    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        (p[D] * nu[0] * nu[0]).scale(0.5)
    }
}

impl TreeTwin for Paddle {
    fn tree_bodies(&self, p: &[f64]) -> Option<Vec<TwinBody>> {
        let stiffness = if self.wrong == Some(Wrong::TwinSpring) { p[K] * 1.01 } else { p[K] };
        Some(vec![TwinBody {
            parent: None,
            axis: Vector3::z(),
            placement: Xform::identity(),
            inertia: Inertia::from_params(&p[..10]),
            stiffness,
            damping: p[D],
            rest: 0.0,
        }])
    }
}
