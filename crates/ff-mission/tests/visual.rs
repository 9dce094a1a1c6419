//! What a URDF says that links look like: shapes and meshes with their places; what cannot be read is a warning.

use ff_mission::urdf::visual::{LookKind, Surface, from_urdf};
use ff_mission::urdf::{UrdfOptions, from_str};
use ff_model::Severity;
use ff_model::tree::Shape;
use nalgebra::Vector3;

const INERTIAL: &str =
    r#"<inertial><mass value="3"/><inertia ixx="1" iyy="1.1" izz="1.2" ixy="0" ixz="0" iyz="0"/></inertial>"#;

fn robot(arm: &str) -> String {
    format!(
        r#"<robot name="r"><link name="bus">{INERTIAL}</link>
<link name="arm">{INERTIAL}</link>
<link name="tool">{INERTIAL}{arm}</link>
<joint name="j" type="continuous"><parent link="bus"/><child link="arm"/><axis xyz="0 1 0"/></joint>
<joint name="f" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.5 0 0.2"/></joint></robot>"#
    )
}

#[test]
fn shapes_and_meshes_stand_on_the_body_that_carries_the_link() {
    let text = robot(
        r#"<visual><origin xyz="0.1 0 0"/><geometry><mesh filename="package://r/a.stl" scale="0.001 0.001 0.002"/></geometry></visual>
<visual><geometry><sphere radius="0.2"/></geometry></visual>
<collision><geometry><mesh filename="b.stl"/></geometry></collision>"#,
    );
    let (model, _) = from_str(&text, &UrdfOptions::default()).unwrap();
    let (looks, problems) = from_urdf(&text, &model).unwrap();
    assert!(problems.0.is_empty());
    let mesh = |file: &str, scale| Surface::Mesh { file: file.to_owned(), scale };
    let got: Vec<_> = looks.iter().map(|l| (l.link.as_str(), l.body, l.kind, l.surface.clone())).collect();
    let want = [
        ("tool", 1, LookKind::Visual, mesh("package://r/a.stl", [0.001, 0.001, 0.002])),
        ("tool", 1, LookKind::Visual, Surface::Solid(Shape::Sphere { radius: 0.2 })),
        ("tool", 1, LookKind::Collision, mesh("b.stl", [1.0; 3])),
    ];
    assert_eq!(got, want);
    assert!((looks[0].placement.pos - Vector3::new(0.6, 0.0, 0.2)).norm() < 1e-15);
}

#[test]
fn what_cannot_be_drawn_is_a_warning_with_its_line() {
    let text = robot(r#"<visual><geometry><torus radius="1"/></geometry></visual>"#);
    let (model, _) = from_str(&robot(""), &UrdfOptions::default()).unwrap();
    let (looks, problems) = from_urdf(&text, &model).unwrap();
    assert!(looks.is_empty());
    let p = &problems.0[0];
    assert_eq!((p.severity, p.code, p.line), (Severity::Warning, "Urdf::BadCollision", Some(3)));
    assert_eq!(from_urdf("<robot", &model).unwrap_err().0[0].severity, Severity::Error);
}
