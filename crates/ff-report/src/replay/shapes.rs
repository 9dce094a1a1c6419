//! Shapes of bodies, rods and joints.

use super::node::{Drawn, Form, Pose, Role};
use ff_model::tree::Shape;
use ff_model::{Inertia, Xform};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Density that gives the size of a ball for a point mass: that of water (kg/m^3).
const WATER: f64 = 1000.0;
/// Products of inertia below this share of the trace do not turn a box.
const ALIGNED: f64 = 0.02;
/// Thinnest edge of a box relative to its longest.
const THINNEST: f64 = 0.02;
/// Diameter of the rods between joints relative to their length, and its greatest value (m).
const ROD: (f64, f64) = (0.12, 0.06);

/// Box of even density with the mass, centre of mass and inertia of a body: edges `a^2 = 6 (I_b + I_c - I_a) / m` along the
/// principal axes (K. Meriam, *Dynamics*, table of solids), or along the axes of the body where its products of inertia are small; a ball of
/// water for a point mass; `None` without mass.
pub(super) fn equivalent(inertia: &Inertia<f64>, role: Role) -> Option<Drawn> {
    let com = inertia.com().filter(|_| inertia.mass > 0.0)?;
    let about = inertia.about_com();
    let products = Vector3::new(about[(0, 1)], about[(0, 2)], about[(1, 2)]);
    // Principal axes of nearly equal moments point anywhere: two estimates of one body would look turned against each other.
    let aligned = products.amax() < ALIGNED * about.trace();
    let eigen = about.symmetric_eigen();
    let (i, mut axes) =
        if aligned { (about.diagonal(), Matrix3::identity()) } else { (eigen.eigenvalues, eigen.eigenvectors) };
    let edge = |a: usize| (6.0 * (i.sum() - 2.0 * i[a]) / inertia.mass).max(0.0).sqrt();
    let size = [edge(0), edge(1), edge(2)];
    let longest = size.iter().fold(0.0, |a: f64, b| a.max(*b));
    let radius = ball(inertia.mass);
    if longest < 1e-3 * radius {
        let form = Form::Sphere { radius };
        return Some(Drawn { role, place: Pose::from(&Xform::new(Matrix3::identity(), com)), form });
    }
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let size = size.map(|x| x.max(THINNEST * longest));
    Some(Drawn { role, place: Pose::from(&Xform::new(axes, com)), form: Form::Box { size } })
}

/// Radius of a ball of water of this mass (m).
pub(super) fn ball(mass: f64) -> f64 {
    (3.0 * mass / (4.0 * PI * WATER)).cbrt()
}

/// About how large a body is (m): the longest edge of its box.
pub(super) fn size(inertia: &Inertia<f64>) -> f64 {
    match equivalent(inertia, Role::Inertia).map(|d| d.form) {
        Some(Form::Box { size }) => size.iter().fold(0.0, |a: f64, b| a.max(*b)),
        Some(Form::Sphere { radius }) => 2.0 * radius,
        _ => 0.1,
    }
}

/// A rod from the origin to `end`; `None` where they coincide.
pub(super) fn rod(end: &Vector3<f64>) -> Option<Drawn> {
    let length = end.norm();
    let radius = 0.5 * (ROD.0 * length).min(ROD.1);
    (length > 1e-6).then(|| Drawn {
        role: Role::Rod,
        place: Pose::from(&Xform::new(along_z(end), 0.5 * end)),
        form: Form::Cylinder { radius, length },
    })
}

/// The axis of a joint as a short cylinder; `link` is the mean distance from joint to joint (m).
pub(super) fn sensor(axis: &Vector3<f64>, link: f64) -> Drawn {
    let radius = (0.12 * link).clamp(0.01, 0.12);
    Drawn {
        role: Role::Joint,
        place: Pose::from(&Xform::new(along_z(axis), Vector3::zeros())),
        form: Form::Cylinder { radius, length: 3.0 * radius },
    }
}

/// A rotation that takes z to a direction.
fn along_z(to: &Vector3<f64>) -> Matrix3<f64> {
    let z = to / to.norm();
    let other = if z.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let x = other.cross(&z).normalize();
    Matrix3::from_columns(&[x, z.cross(&x), z])
}

/// A shape of a URDF.
pub(super) fn form(shape: &Shape) -> Form {
    match *shape {
        Shape::Sphere { radius } => Form::Sphere { radius },
        Shape::Box { size } => Form::Box { size },
        // Half balls at the ends of a capsule add a radius each; a cylinder of that length shows as much.
        Shape::Capsule { radius, length } => Form::Cylinder { radius, length: length + 2.0 * radius },
        Shape::Cylinder { radius, length } => Form::Cylinder { radius, length },
    }
}
