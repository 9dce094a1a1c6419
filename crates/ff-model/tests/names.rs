//! Bodies, joints, appendages and parameters by name and pattern.

use ff_model::payload::Payload;
use ff_model::tree::{JointLimits, SelectionError};
use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Params, Xform};
use nalgebra::{Matrix3, Vector3};

fn model() -> Model {
    let about_com = Matrix3::new(0.9, 0.06, -0.04, 0.06, 0.7, 0.05, -0.04, 0.05, 1.1);
    let body = |mass| Inertia::from_com(mass, &Vector3::new(0.5, -0.2, 0.1), &about_com);
    let mut m = Model::new("probe", "hull", body(40.0), BaseKind::Floating);
    for (i, (joint, link)) in [("shoulder", "upper_arm"), ("elbow", "forearm")].into_iter().enumerate() {
        let joint = Joint {
            name: joint.into(),
            kind: JointKind::Revolute,
            axis: Vector3::new(0.2, -0.9, 0.4),
            placement: Xform::new(Matrix3::identity(), Vector3::new(0.7, 0.3, -0.4)),
            limits: JointLimits::default(),
        };
        m.add_body(i, link, joint, body(5.0 + i as f64));
    }
    let at = Xform::new(Matrix3::identity(), Vector3::new(0.3, -0.7, 0.2));
    m.mount("load", 2, at, Payload::new(&body(3.0)).unwrap()).unwrap();
    m
}

#[test]
fn names_lead_to_bodies_joints_and_appendages() {
    let m = model();
    assert_eq!(["hull", "base", "forearm", "load"].map(|n| m.body(n)), [Some(0), Some(0), Some(2), None]);
    assert_eq!(["shoulder", "elbow", "forearm"].map(|n| m.joint(n)), [Some(0), Some(1), None]);
    assert_eq!(["load", "hull"].map(|n| m.appendage(n)), [Some(0), None]);
    // A joint and the body that it carries.
    assert_eq!(m.joint("elbow").map(|i| i + 1), m.body("forearm"));
}

#[test]
fn patterns_lead_to_parameters() {
    let m = model();
    assert_eq!(m.parameter_indices("*.mass").unwrap(), [0, 10, 20, 30]);
    let mut p = Params::<f64>::nominal(&m);
    let before = p.values().to_vec();
    assert_eq!(p.get(&m, "forearm.mass").unwrap(), 6.0);
    assert_eq!(p.set_matching(&m, "*arm.mass", 7.25).unwrap(), 2);
    assert_eq!((p.get(&m, "upper_arm.mass").unwrap(), p.body(2).mass), (7.25, 7.25));
    let changed: Vec<usize> = (0..m.n_params()).filter(|&i| p.values()[i] != before[i]).collect();
    assert_eq!(changed, [10, 20]);
    let nearest = |name: &str| SelectionError::NoMatch { pattern: name.into(), nearest: Some("load.body.mass".into()) };
    assert_eq!(p.get(&m, "load.body.mas").unwrap_err(), nearest("load.body.mas"));
    assert_eq!(p.set_matching(&m, "load.body.mas", 1.3).unwrap_err(), nearest("load.body.mas"));
    assert_eq!(m.parameter_indices("*.k[*]").unwrap_err().exit_code(), 11);
    // A pattern is no name.
    assert!(p.get(&m, "load.*").is_err());
}
