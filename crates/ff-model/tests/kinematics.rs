//! Kinematic parameters: names, directions, and what they displace.

use ff_model::payload::Payload;
use ff_model::spatial::so3::{exp_so3, quat_to_rot, rot_of_rpy};
use ff_model::tree::JointLimits;
use ff_model::tree::{DisplacementKind, KinematicParam};
use ff_model::*;
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

fn v3(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
}

/// A turning joint on a general axis, a sliding one, a turning one about the negative z axis, and a payload.
fn model() -> Model {
    let body = Inertia::from_com(3.0, &v3(0.2, -0.1, 0.3), &Matrix3::identity());
    let mut m = Model::new("m", "hull", body, BaseKind::Floating);
    let joint = |name: &str, kind, axis: Vector3<f64>, rpy: Vector3<f64>| Joint {
        name: name.into(),
        kind,
        axis,
        placement: Xform::new(rot_of_rpy(&rpy), v3(0.4, -0.7, 0.2)),
        limits: JointLimits::default(),
    };
    let skew = v3(0.5, -0.9, 1.3);
    m.add_body(0, "l1", joint("turns", JointKind::Revolute, v3(0.3, -0.5, 0.8), skew), body);
    m.add_body(1, "l2", joint("slides", JointKind::Prismatic, v3(-0.2, 0.9, 0.4), skew), body);
    m.add_body(2, "l3", joint("plain", JointKind::Continuous, v3(0.0, 0.0, -1.0), Vector3::zeros()), body);
    let client = Payload::new(&body).unwrap();
    m.mount("client", 2, Xform::new(rot_of_rpy(&skew), v3(0.1, 0.6, -0.3)), Arc::from(client)).unwrap();
    m
}

/// The displaced model for one value.
fn moved(m: &Model, name: &str, x: f64) -> Model {
    let mut v = vec![0.0; m.n_kinematic_params()];
    v[m.kinematic_index(name).unwrap()] = x;
    m.displaced(&Kinematics::from_values(m, v))
}

#[test]
fn every_joint_and_every_mount_has_six() {
    let m = model();
    let names: Vec<String> = m.kinematic_params().into_iter().map(|p| p.name).collect();
    assert_eq!(names.len(), m.n_kinematic_params());
    assert_eq!(m.n_kinematic_params(), 6 * 4);
    let plain = ["x", "y", "z", "rx", "ry"].map(|c| format!("plain.placement.{c}"));
    assert_eq!(names[12..17], plain);
    assert_eq!(names[17], "plain.offset");
    assert_eq!(names[18..], ["x", "y", "z", "rx", "ry", "rz"].map(|c| format!("client.mount.{c}")));
    // Of a sliding joint the offset is a shift, and all rotations are its own.
    assert_eq!(names[8..12], ["slides.placement.rx", "slides.placement.ry", "slides.placement.rz", "slides.offset"]);
    for p in m.kinematic_params() {
        assert!((p.direction.norm() - 1.0).abs() < 1e-15, "{}", p.name);
        assert_eq!(p.unit == "m", p.kind == DisplacementKind::Shift || p.name == "slides.offset", "{}", p.name);
    }
}

/// Along a joint's own axis there is one parameter, whatever it is called; the others displace across the axis.
#[test]
fn the_component_along_the_axis_is_the_offset() {
    let m = model();
    let of = |name| m.kinematic_index(name);
    assert_eq!(of("plain.placement.rz"), of("plain.offset"));
    assert_eq!(of("plain.placement.z"), Some(14));
    for (joint, kind) in [("turns", DisplacementKind::Rotation), ("slides", DisplacementKind::Shift)] {
        let own: Vec<KinematicParam> = m.kinematic_params().into_iter().filter(|p| p.name.starts_with(joint)).collect();
        let axis = own.iter().find(|p| p.kind == DisplacementKind::Offset).unwrap().direction;
        let across: Vec<&KinematicParam> = own.iter().filter(|p| p.kind == kind).collect();
        assert_eq!(across.len(), 2, "{joint}");
        assert!(across.iter().all(|p| p.direction.dot(&axis).abs() < 1e-15), "{joint}");
        assert!(across[0].direction.dot(&across[1].direction).abs() < 1e-15, "{joint}");
    }
    assert_eq!(of("plain.placement.rw"), None);
    assert_eq!(of("client.offset"), None);
}

#[test]
fn displaced_models_are_where_the_parameters_say() {
    let m = model();
    let at = |m: &Model, j: usize| m.bodies()[j].joint.placement;
    // Nothing moves without values.
    let same = m.displaced(&Kinematics::fixed(&m));
    assert_eq!(same.bodies(), m.bodies());
    assert_eq!(same.appendages()[0].mount, m.appendages()[0].mount);
    // An offset is a joint position: R0 Rot(u, x).
    let (x, joint) = (0.37, &m.bodies()[0].joint);
    let turned = joint.placement.rot * quat_to_rot(&exp_so3(&(joint.axis * x)));
    let got = at(&moved(&m, "turns.offset", x), 0);
    assert!((got.rot - turned).amax() < 1e-15 && got.pos == joint.placement.pos);
    // The same turn about the axis seen from the parent: exp(a x) R0.
    let axis = joint.placement.rot * joint.axis;
    assert!((quat_to_rot(&exp_so3(&(axis * x))) * joint.placement.rot - turned).amax() < 1e-15);
    let slid = at(&moved(&m, "slides.offset", x), 1).pos - at(&m, 1).pos;
    assert!((slid - at(&m, 1).rot * m.bodies()[1].joint.axis * x).amax() < 1e-15);
    // Shifts and rotations are in axes of the parent.
    assert!((at(&moved(&m, "turns.placement.y", x), 0).pos - at(&m, 0).pos - v3(0.0, x, 0.0)).amax() < 1e-15);
    let tilted = at(&moved(&m, "plain.placement.rx", x), 2);
    assert!((tilted.rot - quat_to_rot(&exp_so3(&v3(x, 0.0, 0.0)))).amax() < 1e-15);
    let mount = moved(&m, "client.mount.ry", x).appendages()[0].mount;
    let before = m.appendages()[0].mount;
    assert!((mount.rot - quat_to_rot(&exp_so3(&v3(0.0, x, 0.0))) * before.rot).amax() < 1e-15);
    assert_eq!(mount.pos, before.pos);
}

#[test]
#[should_panic(expected = "number of kinematic parameters")]
fn values_of_another_model_are_refused() {
    let _ = model().displaced(&Kinematics::fixed(&model().without_appendages()));
}
