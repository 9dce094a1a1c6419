//! Collision geometry of a URDF: shapes, places, and what is refused.

use ff_mission::urdf::collision::{Shape, from_urdf};
use ff_mission::urdf::{UrdfOptions, from_str};
use nalgebra::Vector3;

const INERTIAL: &str = r#"<inertial><origin xyz="0.1 0.2 0.3"/><mass value="3"/><inertia ixx="1" iyy="1.1" izz="1.2" ixy="0" ixz="0" iyz="0"/></inertial>"#;

/// A base, an arm on a joint, and a tool fixed to the arm, with the given contents of arm and tool.
fn robot(arm: &str, tool: &str) -> String {
    format!(
        r#"<robot name="r"><link name="bus">{INERTIAL}<collision><geometry><box size="1 2 3"/></geometry></collision></link>
<link name="arm">{INERTIAL}{arm}</link>
<link name="tool">{INERTIAL}{tool}</link>
<joint name="j" type="revolute"><parent link="bus"/><child link="arm"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="f" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.5 0 0.2" rpy="0 0 0.3"/></joint></robot>"#
    )
}

fn read(arm: &str, tool: &str) -> Result<Vec<ff_mission::urdf::collision::Solid>, ff_model::Problems> {
    let (model, _) = from_str(&robot("", ""), &UrdfOptions::default()).unwrap();
    from_urdf(&robot(arm, tool), &model).map(|s| s.0)
}

#[test]
fn shapes_stand_where_the_urdf_puts_them() {
    let arm = r#"<collision><origin xyz="0.1 -0.2 0.4" rpy="0.3 0.2 -0.1"/><geometry><cylinder radius="0.07" length="0.6"/></geometry></collision>
<collision name="elbow"><geometry><sphere radius="0.11"/></geometry></collision>"#;
    let tool = r#"<collision><origin xyz="0.02 0.03 0.04"/><geometry><capsule radius="0.03" length="0.2"/></geometry></collision>"#;
    let solids = read(arm, tool).unwrap();
    let names: Vec<_> = solids.iter().map(|s| (s.name.as_str(), s.body)).collect();
    assert_eq!(names, [("bus", 0), ("arm", 1), ("arm/elbow", 1), ("tool", 1)]);
    assert_eq!(solids[0].shape, Shape::Box { size: [1.0, 2.0, 3.0] });
    assert_eq!(solids[1].shape, Shape::Cylinder { radius: 0.07, length: 0.6 });
    assert_eq!(solids[2].shape, Shape::Sphere { radius: 0.11 });
    assert_eq!(solids[3].shape, Shape::Capsule { radius: 0.03, length: 0.2 });
    assert_eq!(solids[1].placement.pos, Vector3::new(0.1, -0.2, 0.4));
    let turn = ff_model::spatial::so3::rot_of_rpy(&Vector3::new(0.3, 0.2, -0.1));
    assert!((solids[1].placement.rot - turn).norm() < 1e-14);
    // The tool is fixed to the arm, turned about z.
    let (s, c) = 0.3f64.sin_cos();
    let want = Vector3::new(0.5 + c * 0.02 - s * 0.03, s * 0.02 + c * 0.03, 0.24);
    assert!((solids[3].placement.pos - want).norm() < 1e-14);
}

#[test]
fn what_cannot_be_read_is_refused_with_its_line() {
    let code = |arm: &str| {
        let p = read(arm, "").unwrap_err();
        assert_eq!(p.0.len(), 1, "{p}");
        assert!(p.0[0].line == Some(2) && p.0[0].hint.is_some() && p.0[0].object.as_deref() == Some("link arm"), "{p}");
        (p.0[0].code, p.0[0].message.clone())
    };
    let shape = |s: &str| format!("<collision><geometry>{s}</geometry></collision>");
    let mesh = code(&shape(r#"<mesh filename="package://a/b.stl"/>"#));
    assert!(mesh.0 == "Urdf::CollisionMesh" && mesh.1.contains("b.stl"), "{mesh:?}");
    assert_eq!(code(&shape(r#"<cone radius="1"/>"#)).0, "Urdf::BadCollision");
    assert_eq!(code("<collision/>").0, "Urdf::BadCollision");
    let negative = code(&shape(r#"<sphere radius="-0.2"/>"#));
    assert!(negative.0 == "Urdf::BadCollision" && negative.1.contains("-0.2 m") && negative.1.contains("> 0 m"));
    assert_eq!(code(&shape(r#"<box size="1 2"/>"#)).0, "Urdf::BadNumber");
    assert_eq!(code(&shape(r#"<box size="1 2 nan"/>"#)).0, "Urdf::BadNumber");
    assert_eq!(code(&shape(r#"<cylinder radius="0,5" length="1"/>"#)).0, "Urdf::BadNumber");
    let origin = r#"<collision><origin xyz="1 2"/><geometry><sphere radius="1"/></geometry></collision>"#;
    assert_eq!(code(origin).0, "Urdf::BadNumber");
    // Several at once.
    let two = format!("{}{}", shape("<mesh/>"), shape(r#"<sphere radius="0"/>"#));
    assert_eq!(read(&two, "").unwrap_err().0.len(), 2);
}
