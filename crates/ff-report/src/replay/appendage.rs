//! Appendages as nodes: the links of their tree twin, or one mass that moves as their momentum says.

use super::node::{Drawn, Form, Moves, Node, Pose, Role};
use super::shapes::{ball, equivalent, rod, size};
use ff_model::port::TwinBody;
use ff_model::scalar::ModelScalar;
use ff_model::{Inertia, Model, Params, Xform};
use nalgebra::{Matrix3, Vector3};

/// Thickness of a panel relative to its length.
const THICKNESS: f64 = 0.02;

/// Adds the mount of appendage `k` and what hangs there.
pub(super) fn push(nodes: &mut Vec<Node>, model: &Model, params: &Params<f64>, k: usize, rest: &[f64]) {
    let a = &model.appendages()[k];
    let p = params.appendage(model, k);
    let first = model.nj() + a.coord_offset;
    let mount = nodes.len();
    let host = size(params.body(a.host));
    nodes.push(Node {
        name: a.name.clone(),
        parent: Some(a.host),
        place: Pose::from(&a.mount),
        moves: None,
        shapes: vec![Drawn {
            role: Role::Mount,
            place: Pose::from(&Xform::identity()),
            form: Form::Axes { size: (0.25 * host).max(0.05) },
        }],
        mass_kg: None,
    });
    match a.appendage.tree_twin().and_then(|t| t.tree_bodies(p)) {
        Some(links) => {
            for (i, link) in links.iter().enumerate() {
                let hinge = links.iter().find(|l| l.parent == Some(i)).map(|l| l.placement.pos);
                nodes.push(twin(mount, &a.name, first, i, link, hinge));
            }
        }
        None => nodes.extend(sway(mount, &a.name, model, p, k, first, rest)),
    }
}

/// A link of a twin; `hinge` is where the next one hangs.
fn twin(mount: usize, name: &str, first: usize, i: usize, link: &TwinBody, hinge: Option<Vector3<f64>>) -> Node {
    let mut shapes = Vec::new();
    if let Some(com) = link.inertia.com().filter(|_| link.inertia.mass > 0.0) {
        if link.inertia.about_com().norm() < 1e-9 * link.inertia.mass {
            // A point mass on an arm.
            let form = Form::Sphere { radius: ball(link.inertia.mass) };
            let place = Pose::from(&Xform::new(Matrix3::identity(), com));
            shapes.push(Drawn { role: Role::Fuel, place, form });
            shapes.extend(rod(&com));
        } else {
            shapes.extend(plate(&link.inertia, &link.axis, hinge));
            shapes.extend(equivalent(&link.inertia, Role::Inertia));
        }
    }
    Node {
        name: format!("{name}[{i}]"),
        parent: Some(link.parent.map_or(mount, |p| mount + 1 + p)),
        place: Pose::from(&link.placement),
        moves: Some(Moves::Turn { axis: link.axis.into(), by: first + i, follows: None }),
        shapes,
        mass_kg: (link.inertia.mass > 0.0).then_some(link.inertia.mass),
    }
}

/// A segment as a plate: from its hinge to the next one or, at the tip, to twice the distance of its centre of mass; as wide as its
/// box along the hinge axis. `None` where the centre of mass is at the hinge.
fn plate(inertia: &Inertia<f64>, axis: &Vector3<f64>, hinge: Option<Vector3<f64>>) -> Option<Drawn> {
    let com = inertia.com()?;
    let end = hinge.filter(|h| h.norm() > 1e-6).unwrap_or(2.0 * com);
    let length = end.norm();
    let along = end / length;
    let across = axis - along * axis.dot(&along);
    if !(length > 1e-6 && across.norm() > 1e-3) {
        return None;
    }
    let across = across.normalize();
    let normal = along.cross(&across);
    // Second moment of the mass along the axis: width^2 / 12 of an even plate.
    let i = inertia.about_com();
    let spread = 0.5 * i.trace() - (across.transpose() * i * across)[(0, 0)];
    let width = (12.0 * spread.max(0.0) / inertia.mass).sqrt().clamp(0.05 * length, 2.0 * length);
    let place = Pose::from(&Xform::new(Matrix3::from_columns(&[along, across, normal]), 0.5 * end));
    Some(Drawn { role: Role::Panel, place, form: Form::Box { size: [length, width, THICKNESS * length] } })
}

/// One mass that shifts and turns with the momentum of the appendage: per unit rate `m dc = M_be` (linear rows) and, about the centre of
/// mass, `I w = M_be` (angular rows). Exact for a mass on springs and for a rotor. `None` without mass.
fn sway(mount: usize, name: &str, model: &Model, p: &[f64], k: usize, first: usize, rest: &[f64]) -> Option<Node> {
    let a = &model.appendages()[k];
    let own = &rest[a.coord_offset..a.coord_offset + a.dim()];
    let m = f64::port(&*a.appendage).dense_inertia(p, own);
    let whole = Inertia::from_elements(|i, j| m[(i, j)]);
    let com = whole.com().filter(|_| whole.mass > 0.0)?;
    let inverse = whole.about_com().try_inverse();
    let momentum = |c: usize, from: usize| Vector3::new(m[(from, 6 + c)], m[(from + 1, 6 + c)], m[(from + 2, 6 + c)]);
    let (shift, turn): (Vec<[f64; 3]>, Vec<[f64; 3]>) = (0..a.dim())
        .map(|c| {
            let linear = momentum(c, 0);
            let about_com = momentum(c, 3) - com.cross(&linear);
            let turn = inverse.map_or_else(Vector3::zeros, |i| i * about_com);
            let shift = linear / whole.mass;
            ([shift.x, shift.y, shift.z], [turn.x, turn.y, turn.z])
        })
        .unzip();
    let shifts = shift.iter().flatten().any(|x| x.abs() > 1e-9);
    let mut body = equivalent(&whole, Role::Inertia)?;
    // What is extended and shifts is a structure; points and rotors are not.
    body.role = match (a.dim(), &body.form) {
        (0, _) => Role::Inertia,
        (_, Form::Box { .. }) if shifts => Role::Panel,
        _ => Role::Fuel,
    };
    let place = Pose::from(&Xform::new(Matrix3::identity(), com));
    body.place.p = [0.0; 3];
    Some(Node {
        name: format!("{name} (mass)"),
        parent: Some(mount),
        place,
        moves: (a.dim() > 0).then_some(Moves::Sway { first, shift, turn }),
        shapes: vec![body],
        mass_kg: Some(whole.mass),
    })
}
