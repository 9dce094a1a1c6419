//! What the importer makes of a tree: merged links, order of bodies, base frame, limits.

use approx::assert_relative_eq;
use ff_mission::urdf::{UrdfOptions, from_str};
use ff_model::spatial::so3::rot_of_rpy;
use ff_model::{BaseKind, Inertia, JointKind, Model, Motion, Xform};
use ff_testkit::scaled;
use nalgebra::{Matrix3, Vector3};

/// Inertia of 1 kg about the centre of mass: xx, xy, xz, yy, yz, zz.
const SIX: [f64; 6] = [0.03, 0.001, -0.002, 0.04, 0.003, 0.05];

fn link(name: &str, mass: f64) -> String {
    let [xx, xy, xz, yy, yz, zz] = SIX.map(|x| x * mass);
    format!(
        "<link name='{name}'><inertial><origin xyz='0.1 -0.2 0.3' rpy='0.4 0.5 -0.6'/><mass value='{mass}'/>\
         <inertia ixx='{xx}' ixy='{xy}' ixz='{xz}' iyy='{yy}' iyz='{yz}' izz='{zz}'/></inertial></link>"
    )
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, origin: &str) -> String {
    format!(
        "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/><origin {origin}/>\
         <axis xyz='0 0.6 0.8'/><limit lower='-1.2' upper='2.3' effort='45' velocity='0.7'/></joint>"
    )
}

fn import(body: &str, options: &UrdfOptions) -> Result<Model, String> {
    let (m, warnings) = from_str(&format!("<robot name='r'>{body}</robot>"), options).map_err(|p| p.to_string())?;
    assert!(warnings.0.is_empty(), "{warnings}");
    Ok(m)
}

/// The inertia `link` writes, in the link frame, put together by hand.
fn own(mass: f64) -> Inertia<f64> {
    let r = rot_of_rpy(&Vector3::new(0.4, 0.5, -0.6));
    let [xx, xy, xz, yy, yz, zz] = SIX.map(|x| x * mass);
    let i = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    Inertia::from_com(mass, &Vector3::new(0.1, -0.2, 0.3), &(r * i * r.transpose()))
}

fn pose(xyz: [f64; 3], rpy: [f64; 3]) -> Xform<f64> {
    Xform::new(rot_of_rpy(&Vector3::from(rpy)), Vector3::from(xyz))
}

#[test]
fn links_on_fixed_joints_add_their_inertia_and_stay_as_frames() {
    let body = link("base", 50.0)
        + &link("arm", 4.0)
        + &link("hand", 2.0)
        + &link("finger", 1.0)
        + &joint("j", "revolute", "base", "arm", "xyz='0.5 0 0.1' rpy='0.2 0 0'")
        + &joint("f1", "fixed", "arm", "hand", "xyz='0 0.7 0.2' rpy='0.1 -0.3 0.9'")
        + &joint("f2", "fixed", "hand", "finger", "xyz='0.3 0 -0.1' rpy='-0.5 0.2 0'");
    let m = import(&body, &UrdfOptions::default()).unwrap();
    assert_eq!(m.n_bodies(), 2);
    let (hand, finger) = (pose([0.0, 0.7, 0.2], [0.1, -0.3, 0.9]), pose([0.3, 0.0, -0.1], [-0.5, 0.2, 0.0]));
    // Kinetic energy of the three links, each with the twist of its own frame, is that of the merged body.
    let v = Motion::new(Vector3::new(0.3, -1.1, 0.8), Vector3::new(0.5, 0.2, -0.9));
    let at_hand = hand.motion_to_child(&v);
    let at_finger = finger.motion_to_child(&at_hand);
    let sum = own(4.0).kinetic(&v) + own(2.0).kinetic(&at_hand) + own(1.0).kinetic(&at_finger);
    assert_relative_eq!(m.inertia(1).kinetic(&v), sum, max_relative = scaled(1e-13));
    let f = m.frame("finger").unwrap();
    assert_eq!(f.body, 1);
    assert_relative_eq!(f.placement.pos, (hand * finger).pos, epsilon = scaled(1e-15));
    assert_relative_eq!(f.placement.rot, (hand * finger).rot, epsilon = scaled(1e-15));
    let names: Vec<&str> = m.frames().iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["base", "arm", "hand", "finger"]);
}

#[test]
fn bodies_come_in_file_order_with_parents_first() {
    let body = joint("j3", "revolute", "b", "c", "xyz='0 0 1'")
        + &joint("j1", "revolute", "base", "a", "xyz='0 0 2'")
        + &joint("j2", "revolute", "base", "b", "xyz='0 0 3'")
        + &joint("j4", "revolute", "a", "d", "xyz='0 0 4'")
        + &["c", "d", "b", "base", "a"].map(|n| link(n, 1.0)).concat();
    let m = import(&body, &UrdfOptions::default()).unwrap();
    assert_eq!(m.joint_names(), ["j1", "j2", "j3", "j4"]);
    let parents: Vec<usize> = m.bodies().iter().map(|b| b.parent).collect();
    assert_eq!(parents, [0, 0, 2, 1]);
    assert_eq!(m.bodies()[2].joint.placement.pos.z, 1.0);
}

#[test]
fn the_base_frame_may_be_a_link_fixed_to_the_root() {
    let body = link("adapter", 3.0)
        + &link("bus", 50.0)
        + &link("arm", 4.0)
        + &joint("f", "fixed", "adapter", "bus", "xyz='0.3 -0.4 1.5' rpy='0.2 0.9 -0.7'")
        + &joint("j", "revolute", "adapter", "arm", "xyz='0.1 0.2 0.3'");
    let options = UrdfOptions { base_link: Some("bus".into()), ..UrdfOptions::default() };
    let m = import(&body, &options).unwrap();
    let bus = pose([0.3, -0.4, 1.5], [0.2, 0.9, -0.7]);
    assert_eq!(m.body_name(0), "bus");
    let want = own(50.0) + own(3.0).to_parent(&bus.inverse());
    assert_relative_eq!(m.inertia(0).rot, want.rot, epsilon = scaled(1e-12));
    assert_relative_eq!(m.inertia(0).h, want.h, epsilon = scaled(1e-13));
    // The arm stands where it stood.
    let arm = bus * m.bodies()[0].joint.placement;
    assert_relative_eq!(arm.pos, Vector3::new(0.1, 0.2, 0.3), epsilon = scaled(1e-15));
    assert_relative_eq!(arm.rot, Matrix3::identity(), epsilon = scaled(1e-15));

    let moving = UrdfOptions { base_link: Some("arm".into()), ..UrdfOptions::default() };
    assert!(import(&body, &moving).unwrap_err().contains("Config::BaseNotRoot"));
    let wrong = UrdfOptions { base_link: Some("buss".into()), ..UrdfOptions::default() };
    assert!(import(&body, &wrong).unwrap_err().contains(" bus?"));
}

#[test]
fn kinds_axes_and_limits_arrive() {
    let body = ["base", "a", "b", "c"].map(|n| link(n, 1.0)).concat()
        + &joint("j1", "revolute", "base", "a", "xyz='0 0 0'")
        + &joint("j2", "prismatic", "a", "b", "xyz='0 0 0'")
        + &joint("j3", "continuous", "b", "c", "xyz='0 0 0'");
    let m = import(&body, &UrdfOptions::default()).unwrap();
    let kinds: Vec<JointKind> = m.bodies().iter().map(|b| b.joint.kind).collect();
    assert_eq!(kinds, [JointKind::Revolute, JointKind::Prismatic, JointKind::Continuous]);
    let (first, last) = (&m.bodies()[0].joint, &m.bodies()[2].joint);
    assert_relative_eq!(first.axis, Vector3::new(0.0, 0.6, 0.8), epsilon = scaled(1e-15));
    let l = first.limits;
    assert_eq!((l.lower, l.upper, l.velocity, l.effort), (-1.2, 2.3, 0.7, 45.0));
    // A continuous joint has no position limits, whatever the file says.
    assert_eq!((last.limits.lower, last.limits.upper), (f64::NEG_INFINITY, f64::INFINITY));
}

#[test]
fn massless_links_between_joints_are_legal_when_said() {
    let zero = "<link name='cross'><inertial><mass value='0'/>\
                <inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/></inertial></link>";
    let joints = joint("j1", "revolute", "base", "cross", "xyz='0 0 0'")
        + &joint("j2", "revolute", "cross", "bob", "xyz='0 0 0'");
    let m = import(&(link("base", 9.0) + zero + &link("bob", 2.0) + &joints), &UrdfOptions::default()).unwrap();
    assert!(m.inertia(1).is_zero() && m.n_bodies() == 3);
    // Left out instead of said, it is the same robot with a warning: nobody can tell a massless link from a forgotten one.
    let silent = link("base", 9.0) + "<link name='cross'/>" + &link("bob", 2.0) + &joints;
    let (same, w) = from_str(&format!("<robot name='r'>{silent}</robot>"), &UrdfOptions::default()).unwrap();
    assert!(same.inertia(1).is_zero() && same.n_bodies() == 3);
    assert_eq!((w.0.len(), w.0[0].code, w.0[0].object.as_deref()), (1, "Urdf::NoInertial", Some("link cross")));
}

#[test]
fn a_floating_base_needs_mass_and_a_fixed_one_does_not() {
    let zero = "<inertial><mass value='0'/><inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/></inertial>";
    let body = format!("<link name='base'>{zero}</link>")
        + &link("arm", 2.0)
        + &joint("j", "revolute", "base", "arm", "xyz='0 0 0'");
    assert!(import(&body, &UrdfOptions::default()).unwrap_err().contains("Urdf::MasslessBase"));
    let fixed = UrdfOptions { base_kind: BaseKind::Fixed, ..UrdfOptions::default() };
    assert_eq!(import(&body, &fixed).unwrap().nv(), 1);
    let given = UrdfOptions { base_inertial: Some(own(70.0)), ..UrdfOptions::default() };
    assert_eq!(import(&body, &given).unwrap().inertia(0).mass, 70.0);
}

#[test]
fn skipped_subtrees_may_hold_anything() {
    let visual = "<visual><origin xyz='a b'/><geometry><mesh filename='package://x/y.stl'/></geometry></visual>";
    let body =
        link("base", 9.0).replace("</link>", &format!("{visual}</link>")) + "<gazebo><plugin><x/></plugin></gazebo>";
    // urdf-rs refuses this pose; it never sees what is skipped.
    let m = import(&body, &UrdfOptions::default()).unwrap();
    assert_eq!((m.n_bodies(), m.total_mass()), (1, 9.0));
}

/// Found by a million mutations: `<parent link=""/>` was refused without a word.
#[test]
fn empty_names_are_named() {
    let body = link("base", 9.0) + &link("arm", 2.0) + &joint("j", "revolute", "base", "arm", "xyz='0 0 0'");
    for (from, to) in
        [("parent link='base'", "parent link=''"), ("type='revolute'", "type=''"), ("name='arm'", "name=''")]
    {
        let p = import(&body.replace(from, to), &UrdfOptions::default()).unwrap_err();
        assert!(p.contains("Urdf::MissingAttribute"), "{p}");
    }
}
