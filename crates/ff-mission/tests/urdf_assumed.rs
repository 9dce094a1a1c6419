//! URDFs as they are: what does not decide an answer is a warning that says what was assumed, what does stays an error.

use crate::common::registry;
use approx::assert_relative_eq;
use ff_mission::mission::EstimateMethod;
use ff_mission::urdf::{UrdfOptions, from_str};
use ff_mission::{LoadOptions, Loaded, Mission};
use ff_model::diagnostics::Limit;
use ff_model::spatial::so3::rot_of_rpy;
use ff_model::{BaseKind, Model, Problems, Severity, Xform};
use ff_testkit::problem::{assert_violation, problem_of};
use ff_testkit::scaled;
use nalgebra::Vector3;

fn link(name: &str, mass: f64) -> String {
    let (a, b) = (0.01 * mass, 0.015 * mass);
    format!(
        "<link name='{name}'><inertial><origin xyz='0.1 -0.2 0.3'/><mass value='{mass}'/>\
         <inertia ixx='{a}' ixy='0' ixz='0' iyy='{b}' iyz='0' izz='{b}'/></inertial></link>\n"
    )
}

fn frame(name: &str) -> String {
    format!("<link name='{name}'/>\n")
}

/// A joint a quarter of a metre out on its parent; `inside` goes behind its axis and limits.
fn joint(name: &str, kind: &str, parent: &str, child: &str, inside: &str) -> String {
    let limit =
        if inside.contains("<limit") { "" } else { "<limit lower='-2' upper='1.5' effort='9' velocity='0.7'/>" };
    format!(
        "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>\
         <origin xyz='0.25 0 0.1' rpy='0.3 0 0'/><axis xyz='0 0 1'/>{limit}{inside}</joint>\n"
    )
}

/// Hull, arm and two fingers; the second follows the first.
fn gripper(fingers: [String; 2]) -> String {
    link("hull", 50.0)
        + &link("arm", 4.0)
        + &fingers.concat()
        + &joint("shoulder", "revolute", "hull", "arm", "")
        + &joint("left", "prismatic", "arm", "left_finger", "<limit lower='0' upper='0.04' effort='9' velocity='1'/>")
        + &joint(
            "right",
            "prismatic",
            "arm",
            "right_finger",
            "<limit lower='0' upper='0.04' effort='9' velocity='1'/><mimic joint='left' multiplier='-2' offset='0.01'/>",
        )
}

fn heavy() -> [String; 2] {
    [link("left_finger", 0.1), link("right_finger", 0.2)]
}

fn read(body: &str, options: &UrdfOptions) -> Result<(Model, Problems), Problems> {
    from_str(&format!("<robot name='r'>\n{body}</robot>"), options)
}

fn accepted(body: &str) -> (Model, Problems) {
    read(body, &UrdfOptions::default()).unwrap_or_else(|p| panic!("{p}"))
}

fn refused(body: &str, code: &str, object: &str) {
    let p = read(body, &UrdfOptions::default()).unwrap_err();
    let found = problem_of(&p, code);
    assert_eq!((found.severity, found.object.as_deref()), (Severity::Error, Some(object)), "{p}");
    assert!(found.hint.is_some() && found.line.is_some(), "{p}");
}

/// The only warning is of this code, on this object, and names a next step.
fn warned(w: &Problems, code: &str, object: &str) {
    assert_eq!(w.0.len(), 1, "{w}");
    assert_eq!(
        (w.0[0].code, w.0[0].object.as_deref(), w.0[0].severity),
        (code, Some(object), Severity::Warning),
        "{w}"
    );
    assert!(w.0[0].hint.is_some() && w.0[0].line.is_some(), "{w}");
}

fn mission(robot: &str, rest: &str, body: &str) -> Result<Loaded, Problems> {
    let toml = format!("[robot]\nurdf = 'x'\n{robot}\n{rest}");
    Mission::from_str(&toml, &format!("<robot name='r'>\n{body}</robot>"), &registry(), &LoadOptions::default())
}

#[test]
fn what_other_programs_added_is_skipped_with_one_warning() {
    let good = link("hull", 9.0) + &link("arm", 1.0) + &joint("j", "revolute", "hull", "arm", "");
    assert!(accepted(&good).1.0.is_empty());
    let added = good
        .replace("<inertial>", "<contact stiffness='1'><deep/></contact><inertial>")
        .replace("velocity='0.7'", "velocity='0.7' gear_velocity='3'")
        + "<sensor name='s'><parent link='arm'/></sensor>";
    let (m, w) = accepted(&added);
    warned(&w, "Urdf::Skipped", "link hull");
    for what in ["<contact> in <link> (2)", "'gear_velocity' of <limit> (1)", "<sensor> in <robot> (1)"] {
        assert!(w.0[0].message.contains(what), "{w}");
    }
    assert_eq!(m.total_mass(), 10.0);
    // A slip of the pen is none of these, nor is what would lose mass or the place of something.
    refused(&good.replace("<axis xyz", "<axsi xyz"), "Urdf::UnknownElement", "joint j");
    refused(
        &good.replace("velocity='0.7'", "velocity='0.7' uper='3'").replace("upper='1.5'", ""),
        "Urdf::UnknownAttribute",
        "joint j",
    );
    let inner = good.clone() + "<group><link name='tank'><inertial><mass value='3'/></inertial></link></group>";
    refused(&inner, "Urdf::UnknownElement", "robot");
    let moved = good.replace("<link name='arm'>", "<link name='arm'><origin xyz='0 0 0.1'/>");
    refused(&moved, "Urdf::UnknownElement", "link arm");
    let same = good.replace("<link name='arm'>", "<link name='arm'><origin xyz='0 0 0'/>");
    warned(&accepted(&same).1, "Urdf::Skipped", "link arm");
}

/// The gripper of the Panda: fingers that follow each other.
#[test]
fn a_follower_has_no_coordinate_of_its_own() {
    let (m, w) = accepted(&gripper(heavy()));
    assert!(w.0.is_empty(), "{w}");
    assert_eq!((m.joint_names(), m.nj(), m.n_bodies()), (vec!["shoulder".to_owned(), "left".to_owned()], 2, 4));
    let right = m.followers().next().unwrap();
    assert_eq!((right.0.joint.name.as_str(), right.0.name.as_str()), ("right", "right_finger"));
    assert_eq!((right.1.index, right.1.multiplier, right.1.offset), (1, -2.0, 0.01));
    // 0 <= -2 q + 0.01 <= 0.04, and half the speed.
    let limits = m.own_body(1).joint.limits;
    assert_relative_eq!(limits.lower, 0.0);
    assert_relative_eq!(limits.upper, 0.005, max_relative = scaled(1e-14));
    assert_relative_eq!(limits.velocity, 0.5);
    // Frames move along, and what moves with them resists the joint that they follow.
    for fingers in
        [[link("left_finger", 0.1), frame("right_finger")], [frame("left_finger"), link("right_finger", 0.1)]]
    {
        let (m, w) = accepted(&gripper(fingers));
        assert!(w.0.iter().all(|p| p.code == "Urdf::NoInertial"), "{w}");
        assert_eq!((m.joint_names(), m.n_joints()), (vec!["shoulder".to_owned(), "left".to_owned()], 3));
    }
    // Of frames alone nothing tells where they stand.
    let (m, w) = accepted(&gripper([frame("left_finger"), frame("right_finger")]));
    assert!(w.has("Urdf::NoInertial"), "{w}");
    assert_eq!((m.joint_names(), m.n_joints()), (vec!["shoulder".to_owned()], 1));
}

#[test]
fn a_chain_of_followers_is_referred_to_the_joint_that_moves() {
    // Written from the last of the chain to the first, the one that moves in between.
    let mimic = |of: &str, m: f64, o: f64| format!("<mimic joint='{of}' multiplier='{m}' offset='{o}'/>");
    let body = |first: &str| {
        link("hull", 50.0)
            + &["a", "b", "c"].map(|n| link(n, 1.0)).concat()
            + &joint("c", "revolute", "hull", "c", &mimic("b", -0.5, 0.3))
            + &joint("a", "revolute", "hull", "a", first)
            + &joint("b", "revolute", "a", "b", &mimic("a", 1.4, -0.2))
    };
    let (m, w) = accepted(&body(""));
    assert!(w.0.is_empty(), "{w}");
    assert_eq!(m.joint_names(), ["a"]);
    let of = |name: &str| m.coordinate(m.body(name).unwrap() - 1);
    assert_eq!((of("b").multiplier, of("b").offset), (1.4, -0.2));
    assert_relative_eq!(of("c").multiplier, -0.7, max_relative = scaled(1e-15));
    assert_relative_eq!(of("c").offset, 0.4, max_relative = scaled(1e-15));
    // A circle is said once, however many joints lead there.
    let p = read(&body(&mimic("b", 0.7, 0.0)), &UrdfOptions::default()).unwrap_err();
    let said: Vec<_> =
        p.0.iter().filter(|p| p.code == "Urdf::MimicCycle").map(|p| p.object.as_deref().unwrap()).collect();
    assert_eq!(said, ["joint a"], "{p}");
    // Of a chain whose middle is held, the rest stands where that puts it.
    let at = |options: UrdfOptions| {
        let (m, w) = read(&body(""), &options).unwrap();
        assert!(w.0.is_empty(), "{w}");
        let c = m.frame("c").unwrap().placement.rot;
        let turn = rot_of_rpy(&Vector3::new(0.3, 0.0, 0.0)).tr_mul(&c);
        (m.joint_names().len(), turn[(1, 0)].atan2(turn[(0, 0)]))
    };
    let (joints, angle) = at(UrdfOptions { lock_at: [("b".to_owned(), 0.6)].into(), ..UrdfOptions::default() });
    assert_eq!(joints, 1);
    assert_relative_eq!(angle, -0.5 * 0.6 + 0.3, epsilon = scaled(1e-15));
    let (joints, angle) = at(UrdfOptions { lock_at: [("a".to_owned(), 0.4)].into(), ..UrdfOptions::default() });
    assert_eq!(joints, 0);
    assert_relative_eq!(angle, -0.5 * (1.4 * 0.4 - 0.2) + 0.3, epsilon = scaled(1e-15));
    // At ratio zero, and of a joint that is fixed, it is held without a word.
    let still = body("").replace("multiplier='1.4'", "multiplier='0'");
    let (m, w) = accepted(&still);
    assert!(w.0.is_empty() && m.n_joints() == 1, "{w}");
    let fixed = body("").replace("name='a' type='revolute'", "name='a' type='fixed'");
    let (m, w) = accepted(&fixed);
    assert!(w.0.is_empty() && m.n_joints() == 0, "{w}");
}

#[test]
fn a_follower_of_a_hinge_that_is_lifted_is_held() {
    let lift = "[[appendage]]\nkind = 'flex_panel'\nname = 'wing'\nlift = ['JOINT']\nstiffness_nm_per_rad = [2.0]\ndamping_nms_per_rad = [0.1]\n";
    let body = link("hull", 50.0)
        + &link("a", 1.0)
        + &link("b", 1.0)
        + &joint("a", "revolute", "hull", "a", "")
        + &joint("b", "revolute", "hull", "b", "<mimic joint='a' multiplier='-1.5' offset='0.2'/>");
    let wing = mission("", &lift.replace("JOINT", "a"), &body).unwrap();
    warned(&wing.warnings, "Urdf::Mimic", "joint b");
    assert!(wing.warnings.0[0].message.contains("0.2 rad"), "{}", wing.warnings);
    assert_eq!((wing.model.nj(), wing.model.np()), (0, 1));
    // The follower itself as a hinge swings by itself; what follows elsewhere stays coupled.
    let other = mission("", &lift.replace("JOINT", "b"), &body).unwrap();
    assert!(other.warnings.0.is_empty(), "{}", other.warnings);
    assert_eq!((other.model.joint_names(), other.model.np()), (vec!["a".to_owned()], 1));
    let more = body + &link("c", 1.0) + &joint("c", "revolute", "a", "c", "<mimic joint='a' multiplier='0.7'/>");
    let third = mission("", &lift.replace("JOINT", "b"), &more).unwrap().model;
    assert_eq!((third.nj(), third.n_joints()), (1, 2));
    let c = third.followers().next().unwrap();
    assert_eq!((c.0.joint.name.as_str(), c.1.index, c.1.multiplier), ("c", 0, 0.7));
}

#[test]
fn limits_of_a_follower_that_leave_no_range_are_none() {
    let body = gripper(heavy()).replace("offset='0.01'", "offset='-0.2'");
    let (m, w) = accepted(&body);
    warned(&w, "Urdf::BadLimits", "joint right");
    assert_eq!((m.own_body(1).joint.limits.lower, m.own_body(1).joint.limits.upper), (0.0, 0.04));
    // A follower is not driven: an effort of zero, and no limits at all, say nothing about it.
    for limit in ["<limit effort='0' velocity='0'/>", "<limit lower='0' upper='0.04' effort='0' velocity='1'/>"] {
        let whole = gripper(heavy());
        let at = whole.rfind("<limit").unwrap();
        let end = at + whole[at..].find("/>").unwrap() + 2;
        let (_, w) = accepted(&(whole[..at].to_owned() + limit + &whole[end..]));
        assert!(w.0.is_empty(), "{limit}: {w}");
    }
}

#[test]
fn a_follower_that_the_user_locks_is_no_warning() {
    let lock =
        |names: &[&str]| UrdfOptions { lock: names.iter().map(|&n| n.to_owned()).collect(), ..UrdfOptions::default() };
    // The whole gripper, or the follower alone: then the user says that it stays behind.
    for (names, joints) in
        [(&["left"][..], &["shoulder"][..]), (&["right"], &["shoulder", "left"]), (&["*t"], &["shoulder"])]
    {
        let (m, w) = read(&gripper(heavy()), &lock(names)).unwrap();
        assert!(w.0.is_empty(), "{names:?}: {w}");
        assert_eq!((m.joint_names(), m.n_joints()), (joints.iter().map(|&j| j.to_owned()).collect(), joints.len()));
    }
    // It follows to where the other is held.
    let options = UrdfOptions { lock_at: [("left".to_owned(), 0.03)].into(), ..UrdfOptions::default() };
    let (m, w) = read(&gripper(heavy()), &options).unwrap();
    assert!(w.0.is_empty(), "{w}");
    let z = |name: &str| {
        rot_of_rpy(&Vector3::new(0.3, 0.0, 0.0))
            .tr_mul(&(m.frame(name).unwrap().placement.pos - Vector3::new(0.25, 0.0, 0.1)))
            .z
    };
    assert_relative_eq!(z("left_finger"), 0.03, epsilon = scaled(1e-15));
    assert_relative_eq!(z("right_finger"), -2.0 * 0.03 + 0.01, epsilon = scaled(1e-15));
}

#[test]
fn a_follower_of_nothing_or_of_itself_is_refused() {
    let body = gripper(heavy());
    refused(&body.replace("joint='left'", "joint='lefft'"), "Urdf::UnknownJoint", "joint right");
    refused(&body.replace("joint='left'", "joint='right'"), "Urdf::MimicCycle", "joint right");
    // The joint of another file: what follows it moves by itself.
    let (m, w) = accepted(&body.replace("joint='left'", "joint='robot2/gripper'"));
    warned(&w, "Urdf::UnknownJoint", "joint right");
    assert_eq!((m.joint_names(), m.n_joints()), (["shoulder", "left", "right"].map(String::from).to_vec(), 3));
    // So does what follows a joint beside the subtree, whatever other joint has a name like it.
    let aside = link("hand", 3.0)
        + &joint("lefd", "revolute", "hull", "hand", "")
        + &body.replace("joint='left'", "joint='lefd'");
    let loaded = mission("subtree = 'arm'", "", &aside).unwrap();
    warned(&loaded.warnings, "Urdf::UnknownJoint", "joint right");
    assert!(loaded.warnings.0[0].message.contains("subtree arm"), "{}", loaded.warnings);
    assert_eq!((loaded.model.nj(), loaded.model.n_joints()), (2, 2));
}

/// A locked robot is the robot with its joints at these positions: every link where the joints put it, every mass with it.
#[test]
fn a_locked_joint_is_a_fixed_one_at_its_position() {
    let body = link("hull", 50.0)
        + &link("arm", 4.0)
        + &link("hand", 2.0)
        + &joint("shoulder", "revolute", "hull", "arm", "")
        + &joint("wrist", "revolute", "arm", "hand", "");
    let loaded = mission("lock_at = { wrist = 0.8 }", "", &body).unwrap();
    assert!(loaded.warnings.0.is_empty(), "{}", loaded.warnings);
    let turned = body.replace("name='wrist' type='revolute'", "name='wrist' type='fixed'");
    // rpy of the joint and the turn about its z axis: yaw first, then roll, in one rotation.
    let want = Xform::new(
        rot_of_rpy(&Vector3::new(0.3, 0.0, 0.0)) * rot_of_rpy(&Vector3::new(0.0, 0.0, 0.8)),
        Vector3::new(0.25, 0.0, 0.1),
    );
    let hand = loaded.model.frame("hand").unwrap();
    assert_relative_eq!(hand.placement.rot, want.rot, epsilon = scaled(1e-15));
    assert_relative_eq!(hand.placement.pos, want.pos, epsilon = scaled(1e-15));
    let straight = accepted(&turned).0;
    assert_relative_eq!(loaded.model.inertia(1).mass, straight.inertia(1).mass);
    assert!((loaded.model.inertia(1).h - straight.inertia(1).h).norm() > 0.05);
    // Outside its limits, or with a name that fits nothing, it is refused at its key.
    let p = mission("lock_at = { wrist = 1.8 }", "", &body).unwrap_err();
    let found = problem_of(&p, "Config::OutOfRange");
    assert_violation(found, 1.8, Limit::Within(-2.0, 1.5), "rad");
    assert_eq!((found.line, p.exit_code()), (Some(3), 11));
    let p = mission("lock = ['wirst']", "", &body).unwrap_err();
    let found = problem_of(&p, "Config::UnknownJoint");
    assert!(found.line == Some(3) && found.hint.as_ref().is_some_and(|h| h.contains("wrist")), "{p}");
}

#[test]
fn a_subtree_is_a_robot_of_its_own() {
    let body = link("hull", 50.0)
        + &link("arm", 4.0)
        + &link("hand", 2.0)
        + &link("wing", 3.0).replace("ixx='0.03'", "ixx='-1'")
        + &joint("shoulder", "revolute", "hull", "arm", "")
        + &joint("wrist", "revolute", "arm", "hand", "")
        + &joint("hinge", "ball", "hull", "wing", "");
    // What is wrong elsewhere does not matter.
    let m = mission("subtree = 'arm'", "", &body).unwrap().model;
    assert_eq!((m.body_name(0), m.joint_names(), m.total_mass()), ("arm", vec!["wrist".to_owned()], 6.0));
    let p = mission("subtree = 'amr'", "", &body).unwrap_err();
    let found = problem_of(&p, "Config::UnknownLink");
    assert!(found.line == Some(3) && found.hint.as_ref().is_some_and(|h| h.contains("arm")), "{p}");
    assert!(mission("", "", &body).unwrap_err().has("Urdf::UnknownJointType"));
}

#[test]
fn a_world_from_which_the_robot_hangs_freely_is_no_part_of_it() {
    let robot = link("hull", 9.0) + &link("arm", 1.0) + &joint("j", "revolute", "hull", "arm", "");
    let world = |kind: &str| {
        frame("world")
            + &frame("odom")
            + &robot
            + &joint("w", "fixed", "world", "odom", "")
            + &joint("free", kind, "odom", "hull", "")
    };
    let (m, w) = accepted(&world("floating"));
    assert!(w.0.is_empty(), "{w}");
    assert_eq!((m.body_name(0), m.nv()), ("hull", 7));
    let (m, w) = accepted(&world("planar"));
    warned(&w, "Urdf::Unsupported", "joint free");
    assert_eq!((m.body_name(0), m.nv()), ("hull", 7));
    // Bolted to that world, the joint would have to move.
    let fixed = UrdfOptions { base_kind: BaseKind::Fixed, ..UrdfOptions::default() };
    assert!(read(&world("floating"), &fixed).unwrap_err().has("Urdf::Unsupported"));
}

#[test]
fn joints_of_other_kinds_are_held_where_nothing_depends_on_them() {
    let body = |child: String| {
        link("hull", 9.0)
            + &link("arm", 1.0)
            + &child
            + &joint("j", "revolute", "hull", "arm", "")
            + &joint("free", "floating", "arm", "target", "")
    };
    let (m, w) = accepted(&body(frame("target")));
    warned(&w, "Urdf::Unsupported", "joint free");
    assert_eq!(m.joint_names(), ["j"]);
    refused(&body(link("target", 1.0)), "Urdf::Unsupported", "joint free");
    let lock = UrdfOptions { lock: vec!["free".into()], ..UrdfOptions::default() };
    let (m, w) = read(&body(link("target", 1.0)), &lock).unwrap();
    assert!(w.0.is_empty() && m.inertia(1).mass == 2.0, "{w}");
}

#[test]
fn joints_that_carry_nothing_are_held_and_named_once() {
    let zero = |n: &str| {
        let z = "ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'";
        format!("<link name='{n}'><inertial><mass value='0'/><inertia {z}/></inertial></link>\n")
    };
    let body = link("hull", 9.0)
        + &link("arm", 1.0)
        + &zero("a")
        + &zero("b")
        + &joint("j", "revolute", "hull", "arm", "")
        + &joint("ja", "revolute", "arm", "a", "")
        + &joint("jb", "revolute", "a", "b", "");
    let (m, w) = accepted(&body);
    warned(&w, "Urdf::MasslessLeaf", "link b");
    assert!(w.0[0].message.contains("link a"), "{w}");
    assert_eq!((m.joint_names(), m.frame("b").map(|f| f.body)), (vec!["j".to_owned()], Some(1)));
    // Who drives it is told that it is not there.
    let p = mission("", "[reproduce]\nmanoeuvre_joints = ['jb']\n", &body).unwrap_err();
    assert!(p.has("Config::UnknownJoint"), "{p}");
    // A mass on the axis of the joint resists as little.
    let on_axis = link("hull", 9.0)
        + "<link name='rod'><inertial><origin xyz='0 0 0.4'/><mass value='2'/>\
        <inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/></inertial></link>\n"
        + &joint("j", "revolute", "hull", "rod", "");
    let (m, w) = accepted(&on_axis);
    warned(&w, "Urdf::MasslessLeaf", "link rod");
    assert_eq!((m.nj(), m.inertia(0).mass), (0, 11.0));
}

#[test]
fn an_inertia_that_no_body_has_matters_where_motion_follows_from_it() {
    let bad = |name: &str, six: &str| {
        format!("<link name='{name}'><inertial><mass value='0.2'/><inertia {six}/></inertial></link>\n")
    };
    let negative = "ixx='-1e-4' ixy='0' ixz='0' iyy='1e-4' iyz='0' izz='1e-4'";
    let triangle = "ixx='1e-4' ixy='0' ixz='0' iyy='1e-4' iyz='0' izz='1e-2'";
    let body = |link_: String, kind: &str| {
        link("hull", 9.0)
            + &link("arm", 1.0)
            + &link_
            + &joint("j", "revolute", "hull", "arm", "")
            + &joint("k", kind, "arm", "x", "")
    };
    // Part of a body that can be.
    let (m, w) = accepted(&body(bad("x", negative), "fixed"));
    warned(&w, "Urdf::InertiaNotPsd", "link x");
    assert!(w.0[0].message.contains("arm"), "{w}");
    assert_relative_eq!(m.inertia(1).mass, 1.2);
    // A body of its own.
    refused(&body(bad("x", negative), "revolute"), "Urdf::InertiaNotPsd", "link x");
    let driven = body(bad("x", triangle), "revolute");
    warned(&accepted(&driven).1, "Urdf::Triangle", "link x");
    // To be estimated from.
    let p = mission("", "[estimate]\nparameters = ['x.*']\n", &driven).unwrap_err();
    let found = problem_of(&p, "Urdf::Triangle");
    assert_eq!((found.severity, found.object.as_deref()), (Severity::Error, Some("link x")));
    let held =
        mission("", "[estimate]\nparameters = ['hull.*', 'base.*']\n".replace("'hull.*', ", "").as_str(), &driven)
            .unwrap();
    assert!(held.warnings.has("Urdf::Triangle"));
    // A negative mass is never right; none with an inertia is, where the whole can be.
    refused(&body(bad("x", triangle).replace("0.2", "-0.2"), "fixed"), "Urdf::NonPositiveMass", "link x");
    warned(&accepted(&body(bad("x", triangle).replace("0.2", "0"), "fixed")).1, "Urdf::NonPositiveMass", "link x");
    // What subtraction left of zero is zero.
    let rounding = negative.replace("1e-4", "1e-20");
    assert!(
        accepted(&body(bad("x", &rounding).replace("<mass", "<origin xyz='0.1 0 0.1'/><mass"), "revolute"))
            .1
            .0
            .is_empty()
    );
}

#[test]
fn limits_that_make_no_sense_are_taken_as_none_or_refused() {
    let body = |limit: &str| link("hull", 9.0) + &link("arm", 1.0) + &joint("j", "revolute", "hull", "arm", limit);
    let (m, w) = accepted(&body("<limit lower='-1' upper='1' effort='5' velocity='0'/>"));
    warned(&w, "Urdf::BadLimits", "joint j");
    assert_eq!(m.bodies()[0].joint.limits.velocity, f64::INFINITY);
    // Zeros of an exporter: one warning, and none where the mission makes the joint a hinge.
    let zeros = body("<limit lower='-1' upper='1' effort='0' velocity='0'/>");
    warned(&accepted(&zeros).1, "Urdf::NoEffort", "joint j");
    let lift = "[[appendage]]\nkind = 'flex_panel'\nname = 'wing'\nlift = ['j']\nstiffness_nm_per_rad = [2.0]\ndamping_nms_per_rad = [0.1]\n";
    let wing = mission("", lift, &zeros).unwrap();
    assert!(wing.warnings.0.is_empty(), "{}", wing.warnings);
    let locked = mission("lock = ['j']", "", &zeros).unwrap();
    assert!(locked.warnings.0.is_empty(), "{}", locked.warnings);
    // What would decide where it may move is refused, but not of a joint that is held.
    let swapped = body("<limit lower='1' upper='-1' effort='5' velocity='1'/>");
    refused(&swapped, "Urdf::BadLimits", "joint j");
    assert!(mission("lock = ['j']", "", &swapped).unwrap().warnings.0.is_empty());
    refused(&body("<limit lower='-1' upper='1' effort='5' velocity='-1'/>"), "Urdf::BadLimits", "joint j");
    // Several turns are no degrees, and a number beyond all turns is no limit.
    for far in ["9.42", "1e16"] {
        let limit = format!("<limit lower='-{far}' upper='{far}' effort='5' velocity='1'/>");
        assert!(accepted(&body(&limit)).1.0.is_empty());
    }
}

#[test]
fn of_two_links_without_parent_a_frame_is_left_out() {
    let robot = link("hull", 9.0) + &link("arm", 1.0) + &joint("j", "revolute", "hull", "arm", "");
    let lost = frame("mark") + &frame("tip") + &joint("f", "fixed", "mark", "tip", "");
    let (m, w) = accepted(&(lost.clone() + &robot));
    warned(&w, "Urdf::MultipleRoots", "link mark");
    assert_eq!((m.body_name(0), m.frames().len()), ("hull", 2));
    refused(&(link("mark", 0.1) + &robot), "Urdf::MultipleRoots", "robot");
    refused(&(lost.replace("fixed", "revolute") + &robot), "Urdf::MultipleRoots", "robot");
}

#[test]
fn the_method_of_estimation_is_a_key_of_the_mission() {
    let body = link("hull", 9.0) + &link("arm", 1.0) + &joint("j", "revolute", "hull", "arm", "");
    let method = |line: &str| mission("", &format!("[estimate]\n{line}\n"), &body);
    assert_eq!(method("").unwrap().mission.estimate.method, None);
    let found = method("method = 'output_error'").unwrap().mission.estimate.method;
    assert_eq!(found, Some(EstimateMethod::OutputError));
    let p = method("method = 'output-error'").unwrap_err();
    assert_eq!(problem_of(&p, "Config::BadChoice").line, Some(5), "{p}");
}

#[test]
fn friction_is_taken_over() {
    let body = link("hull", 9.0)
        + &link("arm", 1.0)
        + &joint("j", "revolute", "hull", "arm", "<dynamics damping='0.3' friction='1.7'/>");
    let (m, w) = accepted(&body);
    assert!(w.0.is_empty(), "{w}");
    let f = m.bodies()[0].impedance;
    assert_eq!((f.viscous, f.coulomb), (0.3, 1.7));
    // Of a hinge that is lifted it is the damping, unless the mission gives another.
    let lift = "[[appendage]]\nkind = 'flex_panel'\nname = 'wing'\nlift = ['j']\nstiffness_nm_per_rad = [2.0]\n";
    let damping = |text: &str| {
        let m = mission("", text, &body).unwrap().model;
        m.param_decls().into_iter().find(|p| p.name == "wing.d[0]").unwrap().nominal
    };
    assert_eq!(damping(lift), 0.3);
    assert_eq!(damping(&format!("{lift}damping_nms_per_rad = [0.7]\n")), 0.7);
    assert!(mission("", lift, &body.replace("damping='0.3'", "")).unwrap_err().has("Config::MissingKey"));
}

#[test]
fn a_shape_without_mass_is_one_warning_and_a_frame_none() {
    let shape =
        |n: &str| format!("<link name='{n}'><visual><geometry><sphere radius='1'/></geometry></visual></link>\n");
    let body = |a: String, b: String| {
        link("hull", 9.0) + &a + &b + &joint("a", "fixed", "hull", "cam", "") + &joint("b", "fixed", "hull", "eye", "")
    };
    assert!(accepted(&body(frame("cam"), frame("eye"))).1.0.is_empty());
    let (_, w) = accepted(&body(shape("cam"), shape("eye")));
    warned(&w, "Urdf::NoInertial", "link cam");
    assert!(w.0[0].message.contains("link eye"), "{w}");
    // A base that floats needs mass.
    let bare = frame("hull") + &link("arm", 1.0) + &joint("j", "revolute", "hull", "arm", "");
    refused(&bare, "Urdf::NoInertial", "link hull");
}
