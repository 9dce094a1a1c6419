//! Robots from MJCF: the same robot as its URDF, and what each notation means.

use crate::common::registry;
use approx::assert_relative_eq;
use ff_mission::urdf::{UrdfOptions, from_file, from_str};
use ff_mission::{LoadOptions, Mission};
use ff_model::spatial::so3::rot_of_rpy;
use ff_model::{Inertia, JointKind, Model, Problems, Xform};
use ff_testkit::problem::problem_of;
use ff_testkit::scaled;
use nalgebra::{Matrix3, Vector3};
use std::path::Path;

fn read(body: &str) -> Result<(Model, Problems), Problems> {
    from_str(&format!("<mujoco model='m'>\n{body}\n</mujoco>"), &UrdfOptions::default())
}

fn accepted(body: &str) -> (Model, Problems) {
    read(body).unwrap_or_else(|p| panic!("{p}"))
}

fn refused(body: &str, code: &str, object: &str) {
    let p = read(body).unwrap_err();
    let found = problem_of(&p, code);
    assert_eq!(found.object.as_deref(), Some(object), "{p}");
    assert!(found.hint.is_some() && found.line.is_some(), "{p}");
}

const HULL: &str = "<freejoint/><inertial pos='0.1 0.2 0.3' mass='50' fullinertia='3 4 5 0.1 0.2 0.3'/>";

/// A hull with one body on it.
fn on_hull(inside: &str) -> String {
    format!("<worldbody><body name='hull'>{HULL}{inside}</body></worldbody>")
}

/// The spacecraft of the example was written as URDF and, with springs and a tank, as MJCF by the same program.
#[test]
fn the_surveyor_is_the_same_robot_in_both_formats() {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/three-segment");
    let [urdf, mjcf] = ["robot.urdf", "robot.xml"]
        .map(|f| from_file(&example.join(f), &UrdfOptions::default()).unwrap_or_else(|p| panic!("{p}")));
    let (urdf, (mjcf, warnings)) = (urdf.0, mjcf);
    // Springs of joints that no mission lifts.
    assert_eq!(problem_of(&warnings, "Urdf::Spring").object.as_deref(), Some("joint wing_1"), "{warnings}");
    assert_eq!((mjcf.body_name(0), mjcf.inertia(0).mass), ("bus", 412.0));
    let mut compared = 0;
    for b in urdf.bodies().iter().filter(|b| b.name.starts_with("arm_")) {
        let other = &mjcf.bodies()[mjcf.body(&b.name).unwrap() - 1];
        assert_eq!((&other.joint.name, other.joint.kind), (&b.joint.name, JointKind::Continuous));
        let (p, q) = (&other.joint.placement, &b.joint.placement);
        assert_relative_eq!(p.pos, q.pos, epsilon = scaled(1e-12));
        assert_relative_eq!(p.rot, q.rot, epsilon = scaled(1e-12));
        assert_relative_eq!(other.joint.axis, b.joint.axis, epsilon = scaled(1e-12));
        assert_relative_eq!(other.inertia.h, b.inertia.h, epsilon = scaled(1e-12));
        assert_relative_eq!(other.inertia.rot, b.inertia.rot, epsilon = scaled(1e-12));
        compared += 1;
    }
    assert_eq!(compared, 6);
    // Two joints on one body: a link without mass between them.
    let fuel = &mjcf.bodies()[mjcf.body("fuel").unwrap() - 1];
    let cross = &mjcf.bodies()[fuel.parent - 1];
    assert_eq!((fuel.joint.name.as_str(), cross.joint.name.as_str()), ("swing_1", "swing_0"));
    assert!(cross.inertia.is_zero() && fuel.joint.placement.pos.norm() == 0.0);
    assert_eq!((fuel.impedance.stiffness, fuel.impedance.viscous), (14.5, 1.6));
}

/// Springs and dampers of the file are those of the hinges that a mission makes of the joints.
#[test]
fn joints_on_springs_become_an_appendage_with_these() {
    let text = on_hull(
        "<body name='wing' pos='0 1 0'><joint name='hinge' axis='1 0 0' stiffness='31' damping='0.7' springref='10'/>\
         <inertial pos='0 0.5 0' mass='4' diaginertia='0.3 0.1 0.3'/></body>",
    );
    let text = format!("<mujoco>{text}</mujoco>");
    let toml = "[robot]\nurdf = 'x.xml'\n[[appendage]]\nkind = 'flex_panel'\nname = 'w'\nlift = ['hinge']\n";
    let loaded = Mission::from_str(toml, &text, &registry(), &LoadOptions::default()).unwrap();
    assert!(loaded.warnings.0.is_empty(), "{}", loaded.warnings);
    let nominal = |name: &str| loaded.model.param_decls().into_iter().find(|p| p.name == name).unwrap().nominal;
    assert_eq!((loaded.model.nj(), nominal("w.k[0]"), nominal("w.d[0]")), (0, 31.0, 0.7));
}

#[test]
fn anchors_references_and_orientations_place_a_joint() {
    let body = |more: &str| {
        on_hull(&format!(
            "<body name='arm' pos='0.3 0.1 -0.2' euler='20 0 0'>\
             <joint name='j' axis='0 0 2' pos='0.1 0 0.05' range='-90 30' ref='15'/>\
             <inertial pos='0.4 0 0' mass='3' diaginertia='0.1 0.2 0.2'/>{more}</body>"
        ))
    };
    let (m, w) = accepted(&body("<body name='tool' pos='0.8 0 0'/>"));
    assert!(w.0.is_empty(), "{w}");
    let joint = &m.bodies()[0].joint;
    let (anchor, roll) = (Vector3::new(0.1, 0.0, 0.05), rot_of_rpy(&Vector3::new(20.0_f64.to_radians(), 0.0, 0.0)));
    assert_relative_eq!(joint.placement.pos, Vector3::new(0.3, 0.1, -0.2) + roll * anchor, epsilon = scaled(1e-15));
    // At the reference the joint stands as the file has it.
    let back = rot_of_rpy(&Vector3::new(0.0, 0.0, 15.0_f64.to_radians()));
    assert_relative_eq!(joint.placement.rot * back, roll, epsilon = scaled(1e-15));
    assert_relative_eq!(joint.axis, Vector3::z());
    let limits = joint.limits;
    assert_relative_eq!(limits.lower, -90.0_f64.to_radians());
    assert_relative_eq!(limits.upper, 30.0_f64.to_radians());
    assert_eq!((joint.kind, limits.velocity), (JointKind::Revolute, f64::INFINITY));
    assert_relative_eq!(m.inertia(1).com().unwrap(), Vector3::new(0.4, 0.0, 0.0) - anchor, epsilon = scaled(1e-15));
    assert_relative_eq!(
        m.frame("tool").unwrap().placement.pos,
        Vector3::new(0.8, 0.0, 0.0) - anchor,
        epsilon = scaled(1e-15)
    );
    // Angles in radian, limits that are switched off, a slide.
    let radian = body("")
        .replace("euler='20 0 0'", "euler='0.5 0 0'")
        .replace("range='-90 30' ref='15'", "range='-1 1' limited='false'");
    let (m, _) = accepted(&format!("<compiler angle='radian'/>{radian}"));
    let joint = &m.bodies()[0].joint;
    assert_relative_eq!(joint.placement.rot, rot_of_rpy(&Vector3::new(0.5, 0.0, 0.0)), epsilon = scaled(1e-15));
    assert_eq!((joint.kind, joint.limits.lower), (JointKind::Continuous, f64::NEG_INFINITY));
    let slide = body("").replace("<joint name='j'", "<joint name='j' type='slide'").replace("ref='15'", "ref='0.2'");
    let (m, w) = accepted(&slide);
    let joint = &m.bodies()[0].joint;
    assert!(w.0.is_empty() && joint.kind == JointKind::Prismatic && joint.limits.lower == -90.0, "{w}");
    let at = Vector3::new(0.3, 0.1, -0.2) + roll * (anchor - Vector3::new(0.0, 0.0, 0.2));
    assert_relative_eq!(joint.placement.pos, at, epsilon = scaled(1e-15));
}

#[test]
fn defaults_reach_elements_through_classes() {
    let defaults = "<default><joint damping='0.1' axis='0 1 0'/>\
        <default class='arm'><joint stiffness='3'/><default class='wrist'><joint damping='0.4'/></default></default></default>";
    let joint = |n: &str, more: &str| {
        format!(
            "<body name='{n}'><joint name='j{n}' {more}/><inertial pos='0.1 0 0' mass='1' diaginertia='1 1 1'/></body>"
        )
    };
    let body = defaults.to_owned()
        + &on_hull(
            &(joint("a", "")
                + &joint("b", "class='arm'")
                + &joint("c", "class='wrist' stiffness='5'")
                + &format!("<body name='around' childclass='wrist'>{}</body>", joint("d", ""))),
        );
    let (m, _) = accepted(&body);
    let of = |n: &str| {
        let b = &m.bodies()[m.body(n).unwrap() - 1];
        (b.impedance.viscous, b.impedance.stiffness, b.joint.axis.y)
    };
    assert_eq!(
        [of("a"), of("b"), of("c"), of("d")],
        [(0.1, 0.0, 1.0), (0.1, 3.0, 1.0), (0.4, 5.0, 1.0), (0.4, 3.0, 1.0)]
    );
    refused(&body.replace("class='wrist' stiffness", "class='wirst' stiffness"), "Mjcf::UnknownClass", "link c");
}

#[test]
fn shapes_give_mass_where_no_inertial_does() {
    let body = on_hull(
        "<body name='arm' pos='0 0 1'><joint name='j' axis='1 0 0'/>\
         <geom type='box' size='0.1 0.2 0.3' pos='0.5 0 0' mass='6' euler='0 0 90'/>\
         <geom type='capsule' fromto='0 0 0 0 0.4 0' size='0.05' density='500'/>\
         <geom type='mesh' mesh='skin' density='0'/></body>",
    );
    let (m, w) = accepted(&body);
    assert!(w.0.is_empty(), "{w}");
    let box_ = Inertia::from_com(6.0, &Vector3::zeros(), &Matrix3::from_diagonal(&Vector3::new(0.26, 0.2, 0.1)));
    let box_ = box_.to_parent(&Xform::new(
        rot_of_rpy(&Vector3::new(0.0, 0.0, 90.0_f64.to_radians())),
        Vector3::new(0.5, 0.0, 0.0),
    ));
    let volume = std::f64::consts::PI * 0.05_f64.powi(2) * (0.4 + 4.0 / 3.0 * 0.05);
    let arm = m.inertia(1);
    assert_relative_eq!(arm.mass, 6.0 + 500.0 * volume, max_relative = scaled(1e-13));
    assert_relative_eq!(arm.h, box_.h + Vector3::new(0.0, 0.2, 0.0) * (500.0 * volume), epsilon = scaled(1e-13));
    // The capsule lies along y.
    let capsule = arm.rot - box_.rot;
    assert!(capsule[(1, 1)] < 0.1 * capsule[(0, 0)], "{capsule}");
    assert_relative_eq!(capsule[(0, 0)], capsule[(2, 2)], max_relative = scaled(1e-9));
    // The mass of a mesh is not known here.
    refused(&body.replace("mesh='skin' density='0'", "mesh='skin'"), "Mjcf::NoInertial", "link arm");
    refused(&body.replace("size='0.1 0.2 0.3'", "size='0.1 0.2'"), "Mjcf::BadNumber", "link arm");
}

#[test]
fn couplings_are_followers_and_loops_are_refused() {
    let finger = |n: &str| {
        format!(
            "<body name='{n}'><joint name='j{n}' type='slide' range='0 0.1'/><inertial pos='0 0 0.1' mass='0.1' diaginertia='1e-4 1e-4 1e-4'/></body>"
        )
    };
    let couple = |what: &str| on_hull(&(finger("a") + &finger("b"))) + &format!("<equality>{what}</equality>");
    let (m, w) = accepted(&couple("<joint joint1='ja' joint2='jb' polycoef='0 1 0 0 0'/>"));
    let (ja, at) = m.followers().next().unwrap();
    assert_eq!((m.nj(), m.n_joints(), ja.joint.name.as_str(), at.index, at.multiplier), (1, 2, "ja", 0, 1.0), "{w}");
    assert_eq!(accepted(&couple("<joint joint1='ja' joint2='jb' active='false'/>")).0.nj(), 2);
    refused(&couple("<joint joint1='jc' joint2='jb'/>"), "Mjcf::UnknownJoint", "equality jc");
    refused(&couple("<joint joint1='ja' joint2='jb' polycoef='0 1 0.3'/>"), "Mjcf::Unsupported", "equality ja");
    refused(&couple("<connect name='loop' body1='a' body2='b' anchor='0 0 0'/>"), "Mjcf::Unsupported", "equality loop");
}

#[test]
fn what_only_a_compiler_resolves_and_slips_of_the_pen_are_refused() {
    let arm = |inside: &str| on_hull(&format!("<body name='arm'>{inside}</body>"));
    let good = "<joint name='j'/><inertial pos='0.1 0 0' mass='1' diaginertia='1 1 1'/>";
    assert_eq!(accepted(&arm(good)).0.nj(), 1);
    refused(&arm(&format!("{good}<replicate count='3'/>")), "Mjcf::Unsupported", "link arm");
    refused(&format!("<include file='x.xml'/>{}", arm(good)), "Mjcf::Unsupported", "file");
    refused(&arm(&format!("{good}<bdoy name='x'/>")), "Mjcf::UnknownElement", "link arm");
    refused(&arm(&good.replace("name='j'", "name='j' stifness='2'")), "Mjcf::UnknownAttribute", "joint j");
    refused(&arm(&good.replace("mass='1'", "mass='1,5'")), "Mjcf::BadNumber", "element");
    refused(&arm(&good.replace("mass='1' ", "")), "Mjcf::MissingAttribute", "link arm");
    refused(&arm(&good.replace("name='j'", "name='j' type='hing'")), "Mjcf::UnknownJointType", "joint j");
    // A rotor is said, once.
    let (_, w) = accepted(&arm(&good.replace("name='j'", "name='j' armature='0.1'")));
    assert_eq!(problem_of(&w, "Mjcf::Armature").object.as_deref(), Some("joint j"));
}
