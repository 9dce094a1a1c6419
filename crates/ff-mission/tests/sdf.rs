//! Robots from SDF: the same robot as its URDF, poses against any frame.

use approx::assert_relative_eq;
use ff_mission::urdf::{UrdfOptions, from_str};
use ff_model::{BaseKind, JointKind, Model, Problems};
use ff_testkit::problem::problem_of;
use ff_testkit::scaled;

const URDF: &str = "<robot name='r'>
  <link name='hull'><inertial><origin xyz='0.1 0.2 0.3' rpy='0.1 0 0.2'/><mass value='50'/><inertia ixx='3' ixy='0.1' ixz='0.2' iyy='4' iyz='0.3' izz='5'/></inertial></link>
  <link name='arm'><inertial><origin xyz='0.4 0 0.1'/><mass value='4'/><inertia ixx='0.1' ixy='0.01' ixz='0' iyy='0.2' iyz='0' izz='0.25'/></inertial></link>
  <link name='rod'><inertial><origin xyz='0 0.3 0'/><mass value='2'/><inertia ixx='0.1' ixy='0' ixz='0' iyy='0.05' iyz='0' izz='0.1'/></inertial></link>
  <joint name='shoulder' type='revolute'><parent link='hull'/><child link='arm'/><origin xyz='0.5 0.1 0.2' rpy='0.3 -0.2 0.7'/><axis xyz='0 0.6 0.8'/><limit lower='-1' upper='2' effort='30' velocity='0.5'/></joint>
  <joint name='slide' type='prismatic'><parent link='arm'/><child link='rod'/><origin xyz='0.8 0 0.1' rpy='0 0.5 0'/><axis xyz='1 0 0'/><limit lower='0' upper='0.4' effort='9' velocity='0.1'/></joint>
</robot>";

/// The same, with the poses of links against what is at hand, and the rod against a frame.
pub(crate) const SDF: &str = "<sdf version='1.9'><model name='r'>
  <link name='hull'><inertial><pose>0.1 0.2 0.3 0.1 0 0.2</pose><mass>50</mass><inertia><ixx>3</ixx><ixy>0.1</ixy><ixz>0.2</ixz><iyy>4</iyy><iyz>0.3</iyz><izz>5</izz></inertia></inertial></link>
  <frame name='seat' attached_to='arm'><pose>0.8 0 0 0 0 0</pose></frame>
  <link name='arm'><pose relative_to='hull'>0.5 0.1 0.2 0.3 -0.2 0.7</pose>
    <inertial><pose>0.4 0 0.1 0 0 0</pose><mass>4</mass><inertia><ixx>0.1</ixx><ixy>0.01</ixy><ixz>0</ixz><iyy>0.2</iyy><iyz>0</iyz><izz>0.25</izz></inertia></inertial></link>
  <link name='rod'><pose relative_to='slide'>0 0.1 0 0 0 0.4</pose>
    <inertial><pose relative_to=''>0.077883668 0.184212199 0 0 0 -0.4</pose><mass>2</mass><inertia><ixx>0.1</ixx><iyy>0.05</iyy><izz>0.1</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>
  <joint name='shoulder' type='revolute'><parent>hull</parent><child>arm</child><axis><xyz>0 3 4</xyz><limit><lower>-1</lower><upper>2</upper><effort>30</effort><velocity>0.5</velocity></limit></axis></joint>
  <joint name='slide' type='prismatic'><pose relative_to='seat'>0 0 0.1 0 0.5 0</pose><parent>arm</parent><child>rod</child>
    <axis><xyz>1 0 0</xyz><limit><lower>0</lower><upper>0.4</upper><effort>9</effort><velocity>0.1</velocity></limit></axis></joint>
</model></sdf>";

fn read(text: &str) -> Result<(Model, Problems), Problems> {
    from_str(text, &UrdfOptions::default())
}

#[test]
fn the_same_robot_in_both_formats() {
    let [(urdf, _), (sdf, w)] = [URDF, SDF].map(|t| read(t).unwrap_or_else(|p| panic!("{p}")));
    assert!(w.0.is_empty(), "{w}");
    assert_eq!(sdf.joint_names(), urdf.joint_names());
    for (a, b) in sdf.bodies().iter().zip(urdf.bodies()) {
        assert_eq!((a.joint.kind, a.joint.limits), (b.joint.kind, b.joint.limits));
        assert_relative_eq!(a.joint.placement.pos, b.joint.placement.pos, epsilon = scaled(1e-14));
        assert_relative_eq!(a.joint.placement.rot, b.joint.placement.rot, epsilon = scaled(1e-14));
        assert_relative_eq!(a.joint.axis, b.joint.axis, epsilon = scaled(1e-15));
        // The centre of mass of the rod is written with nine decimals.
        assert_relative_eq!(a.inertia.h, b.inertia.h, epsilon = scaled(1e-8));
        assert_relative_eq!(a.inertia.rot, b.inertia.rot, epsilon = scaled(1e-8));
    }
    assert_relative_eq!(sdf.inertia(0).rot, urdf.inertia(0).rot, epsilon = scaled(1e-13));
}

#[test]
fn axes_springs_and_limits_mean_what_the_format_says() {
    let text = SDF
        .replace("<xyz>0 3 4</xyz>", "<xyz expressed_in='hull'>0 3 4</xyz><dynamics><damping>0.4</damping><spring_stiffness>7</spring_stiffness></dynamics>")
        .replace("<lower>-1</lower><upper>2</upper><effort>30</effort>", "<lower>-1e16</lower><upper>1e16</upper><effort>-1</effort>");
    let (m, w) = read(&text).unwrap();
    assert_eq!(problem_of(&w, "Urdf::Spring").object.as_deref(), Some("joint shoulder"));
    let b = &m.bodies()[0];
    assert_relative_eq!(
        b.joint.placement.rot * b.joint.axis,
        nalgebra::Vector3::new(0.0, 0.6, 0.8),
        epsilon = scaled(1e-14)
    );
    assert_eq!((b.impedance.viscous, b.impedance.stiffness), (0.4, 7.0));
    assert_eq!((b.joint.kind, b.joint.limits.effort), (JointKind::Continuous, f64::INFINITY));
    // Hung from the world.
    let fixed = UrdfOptions { base_kind: BaseKind::Fixed, ..UrdfOptions::default() };
    let hung =
        SDF.replace("<parent>hull</parent>", "<parent>world</parent>").replace("relative_to='hull'", "relative_to=''");
    let hung = hung.replacen("<link name='hull'>", "<link name='hull'><pose>9 9 9 0 0 0</pose>", 1);
    assert!(from_str(&hung, &fixed).unwrap_err().has("Urdf::MultipleRoots"));
    // Without inertial, the format has one.
    let bare = SDF.replace("<joint name='shoulder'", "<link name='eye'/><joint name='e' type='fixed'><parent>arm</parent><child>eye</child></joint><joint name='shoulder'");
    let (m, w) = read(&bare).unwrap();
    assert_eq!(problem_of(&w, "Sdf::NoInertial").object.as_deref(), Some("link eye"));
    assert_relative_eq!(m.inertia(1).mass, 5.0);
}

#[test]
fn what_cannot_be_read_is_refused_with_its_place() {
    for (from, to, code, object) in [
        ("relative_to='seat'", "relative_to='saet'", "Sdf::UnknownFrame", "slide"),
        ("attached_to='arm'", "attached_to='rod'", "Sdf::PoseCycle", "slide"),
        ("<mass>4</mass>", "<mass>4,5</mass>", "Sdf::BadNumber", "link arm"),
        ("<child>rod</child>", "", "Sdf::MissingElement", "joint slide"),
        ("<frame name", "<model name='x'/><frame name", "Sdf::Unsupported", "file"),
        ("<frame name", "<include><uri>x</uri></include><frame name", "Sdf::Unsupported", "file"),
    ] {
        assert!(SDF.contains(from), "{from}");
        let p = read(&SDF.replacen(from, to, 1)).unwrap_err();
        let found = p.0.iter().find(|p| p.code == code).unwrap_or_else(|| panic!("{code}: {p}"));
        assert!(found.line.is_some() && found.hint.is_some(), "{p}");
        assert!(code == "Sdf::PoseCycle" || found.object.as_deref() == Some(object), "{p}");
    }
}
