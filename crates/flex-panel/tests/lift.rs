//! Panels modelled in the URDF, lifted out of the tree; and bodies that the end effector holds.
use crate::common::{rng, sym};
use ff_dynamics::{State, Work, bias, forward_dynamics, mass_matrix, rnea};
use ff_mission::urdf;
use ff_mission::urdf::UrdfOptions;
use ff_mission::{LoadOptions, Loaded, Mission};
use ff_model::{Model, Params, Problems, Registry};
use nalgebra::DMatrix;
use validate::check_appendage;

fn registry() -> Registry {
    let mut r = Registry::new();
    flex_panel::register(&mut r);
    ff_model::payload::register(&mut r);
    r
}
fn peers() -> String {
    std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/peers-model/flex.urdf")).unwrap()
}
fn load(mission: &str, urdf: &str) -> Result<Loaded, Problems> {
    Mission::from_str(mission, urdf, &registry(), &LoadOptions::default())
}

const LIFTED: &str = r#"
[robot]
urdf = "flex.urdf"
end_effector = "tool"

[[appendage]]
kind = "flex_panel"
name = "a"
lift = ["panel_a1", "panel_a2"]
stiffness_nm_per_rad = [200.0, 190.0]
damping_nms_per_rad = [2.0, 1.5]
rest_rad = [0.1, -0.05]

[[appendage]]
kind = "flex_panel"
name = "b"
lift = ["panel_b1", "panel_b2"]
stiffness_nm_per_rad = [180.0, 170.0]
damping_nms_per_rad = [2.2, 1.7]
"#;

/// The same state of tree and lifted model: `at[i]` is the tree's joint behind generalised velocity `i` of the lifted
/// one. Largest relative differences of mass matrix, bias, forward dynamics and RNEA; springs are external to the tree.
fn compare(tree: &Model, lifted: &Model, springs: &[(f64, f64, f64)], seed: u64) -> [f64; 4] {
    let mut r = rng(seed);
    let nv = tree.nv();
    assert_eq!((nv, lifted.nv()), (lifted.nv(), 6 + lifted.nj() + springs.len()));
    let names = tree.joint_names();
    // Joints by name, then the lifted ones in the order in which they hang there: the tree keeps that order.
    let stay: Vec<usize> = lifted.joint_names().iter().map(|n| names.iter().position(|m| m == n).unwrap()).collect();
    let gone: Vec<usize> = (0..names.len()).filter(|j| !stay.contains(j)).collect();
    let at: Vec<usize> = (0..6).chain(stay.iter().chain(&gone).map(|j| 6 + j)).collect();
    let (pt, pl) = (Params::nominal(tree), Params::nominal(lifted));
    let (mut wt, mut wl) = (Work::new(tree), Work::new(lifted));
    let mut worst = [0.0_f64; 4];
    for _ in 0..100 {
        let (mut t, mut l) = (State::<f64>::zero(tree), State::<f64>::zero(lifted));
        t.q.iter_mut().for_each(|q| *q = sym(&mut r, 1.4));
        t.v.iter_mut().for_each(|v| *v = sym(&mut r, 0.8));
        stay.iter().enumerate().for_each(|(i, &j)| l.q[i] = t.q[j]);
        gone.iter().enumerate().for_each(|(i, &j)| l.eta[i] = t.q[j]);
        at.iter().enumerate().for_each(|(i, &j)| l.v[i] = t.v[j]);
        let pick = |x: &[f64]| -> Vec<f64> { at.iter().map(|&j| x[j]).collect() };
        let mut see = |k: usize, have: &[f64], want: &[f64]| worst[k] = worst[k].max(crate::common::rel(have, want));
        let (mut ht, mut hl) = (DMatrix::zeros(nv, nv), DMatrix::zeros(nv, nv));
        mass_matrix(tree, &pt, &t, &mut wt, &mut ht);
        mass_matrix(lifted, &pl, &l, &mut wl, &mut hl);
        see(0, hl.as_slice(), DMatrix::from_fn(nv, nv, |i, j| ht[(at[i], at[j])]).as_slice());
        let spring: Vec<f64> =
            gone.iter().zip(springs).map(|(&j, s)| s.0 * (t.q[j] - s.2) + s.1 * t.v[6 + j]).collect();
        let first = 6 + stay.len();
        let (mut bt, mut bl) = (vec![0.0; nv], vec![0.0; nv]);
        bias(tree, &pt, &t, &mut wt, &mut bt);
        bias(lifted, &pl, &l, &mut wl, &mut bl);
        let mut want = pick(&bt);
        spring.iter().enumerate().for_each(|(i, f)| want[first + i] += f);
        see(1, &bl, &want);
        let tau: Vec<f64> = (0..nv).map(|_| sym(&mut r, 9.0)).collect();
        let mut own = tau.clone();
        gone.iter().zip(&spring).for_each(|(&j, f)| own[6 + j] -= f);
        let (mut at_tree, mut at_lifted) = (vec![0.0; nv], vec![0.0; nv]);
        forward_dynamics(tree, &pt, &t, &own, &mut wt, &mut at_tree).unwrap();
        forward_dynamics(lifted, &pl, &l, &pick(&tau), &mut wl, &mut at_lifted).unwrap();
        see(2, &at_lifted, &pick(&at_tree));
        let acc: Vec<f64> = (0..nv).map(|_| sym(&mut r, 2.0)).collect();
        let (mut ft, mut fl) = (vec![0.0; nv], vec![0.0; nv]);
        rnea(tree, &pt, &t, &acc, &mut wt, &mut ft);
        rnea(lifted, &pl, &l, &pick(&acc), &mut wl, &mut fl);
        let mut want = pick(&ft);
        spring.iter().enumerate().for_each(|(i, f)| want[first + i] += f);
        see(3, &fl, &want);
    }
    worst
}

#[test]
fn lifted_panels_move_as_they_did_in_the_tree() {
    let (tree, _) = urdf::from_str(&peers(), &UrdfOptions::default()).unwrap();
    let lifted = load(LIFTED, &peers()).unwrap();
    let m = &lifted.model;
    assert_eq!((tree.nj(), m.nj(), m.np(), m.appendages().len()), (11, 7, 4, 2));
    assert!(m.frame("panel_a1_link").is_none() && m.frame("tool").is_some() && m.frame("arm_l7").is_some());
    assert_eq!(lifted.mission.appendages[0].lift, ["panel_a1", "panel_a2"]);
    assert_eq!(
        (&*lifted.mission.appendages[0].host, lifted.mission.appendages[0].mount.xyz_m),
        ("base", [1.8, 0.0, 0.6])
    );
    assert_eq!(m.frames()[lifted.end_effector.unwrap()].name, "tool");
    let springs = [(200.0, 2.0, 0.1), (190.0, 1.5, -0.05), (180.0, 2.2, 0.0), (170.0, 1.7, 0.0)];
    let worst = compare(&tree, m, &springs, 71);
    println!("H {:.1e}, bias {:.1e}, forward dynamics {:.1e}, RNEA {:.1e}", worst[0], worst[1], worst[2], worst[3]);
    // Accelerations differ by the condition of the mass matrix times the rounding of two elimination orders.
    let limits = [1e-12, 1e-12, 1e-10, 1e-12];
    assert!(worst.iter().zip(limits).all(|(&w, l)| w < l), "{worst:?}");
}

/// The wing on the third arm link, its joint frames turned, axes skewed.
fn skewed() -> String {
    let panel = |n: &str, parent: &str, place: &str, axis: &str| {
        format!(
            "<link name='{n}_link'><inertial><origin xyz='0.1 0.9 -0.05' rpy='0.2 -0.1 0.3'/><mass value='21.0'/><inertia ixx='9.1' ixy='0.2' ixz='-0.3' iyy='4.2' iyz='0.1' izz='11.3'/></inertial></link>\
             <joint name='{n}' type='continuous'><parent link='{parent}'/><child link='{n}_link'/><origin {place}/><axis xyz='{axis}'/></joint>"
        )
    };
    let more = panel("w1", "arm_l3", "xyz='0.2 0.1 0.3' rpy='0.4 -0.7 1.1'", "0.6 0.0 0.8")
        + &panel("w2", "w1_link", "xyz='0.1 1.8 0.2' rpy='-0.9 0.3 0.5'", "0.0 0.28 0.96")
        + &panel("w3", "w2_link", "xyz='-0.1 1.7 0.1' rpy='1.3 0.2 -0.6'", "0.8 -0.6 0.0");
    peers().replace("</robot>", &(more + "</robot>"))
}

#[test]
fn turned_joint_frames_and_any_host_are_lifted_too() {
    let urdf = skewed();
    let (tree, _) = urdf::from_str(&urdf, &UrdfOptions::default()).unwrap();
    let mission = "[robot]\nurdf = 'x'\n[[appendage]]\nkind = 'flex_panel'\nname = 'w'\nlift = ['w1', 'w2', 'w3']\n\
                   stiffness_nm_per_rad = [90.0, 80.0, 70.0]\ndamping_nms_per_rad = [0.9, 0.8, 0.7]\nrest_rad = [0.2, 0.1, -0.1]\n";
    let m = load(mission, &urdf).unwrap().model;
    assert_eq!(m.body_name(m.appendages()[0].host), "arm_l3");
    let worst = compare(&tree, &m, &[(90.0, 0.9, 0.2), (80.0, 0.8, 0.1), (70.0, 0.7, -0.1)], 72);
    println!("H {:.1e}, bias {:.1e}, forward dynamics {:.1e}, RNEA {:.1e}", worst[0], worst[1], worst[2], worst[3]);
    // Accelerations differ by the condition of the mass matrix times the rounding of two elimination orders.
    let limits = [1e-12, 1e-12, 1e-10, 1e-12];
    assert!(worst.iter().zip(limits).all(|(&w, l)| w < l), "{worst:?}");
    // Couplings go to the chain as they are.
    let coupled = mission.replace("[90.0, 80.0, 70.0]", "[[90.0, 5.0, 0.0], [5.0, 80.0, 4.0], [0.0, 4.0, 70.0]]");
    let m = load(&coupled, &urdf).unwrap().model;
    assert!(m.param_decls().iter().any(|p| p.name == "w.k[1,2]" && p.nominal == 4.0));
}

#[track_caller]
fn refused(from: &str, to: &str, code: &str, line: usize, says: &str) {
    assert!(LIFTED.contains(from), "{from}");
    let e = load(&LIFTED.replacen(from, to, 1), &peers()).unwrap_err();
    let errors: Vec<_> = e.0.iter().filter(|p| p.severity == ff_model::Severity::Error).collect();
    assert_eq!(
        (errors.len(), errors[0].code, errors[0].line, errors[0].hint.is_some()),
        (1, code, Some(line), true),
        "{e}"
    );
    assert!(e.to_string().contains(says), "{says}: {e}");
}

#[test]
fn what_cannot_be_lifted_is_named() {
    refused("\"panel_a2\"", "\"panel_a3\"", "Config::UnknownJoint", 9, "did you mean panel_a");
    refused(
        "[\"panel_a1\", \"panel_a2\"]",
        "[\"panel_a2\", \"panel_a1\"]",
        "Config::NotAChain",
        9,
        "does not hang on the link of panel_a2",
    );
    refused("[\"panel_a1\", \"panel_a2\"]", "[]", "Config::Param", 9, "no joints");
    refused("[200.0, 190.0]", "[200.0]", "Config::WrongLength", 10, "1 numbers for 2 lifted joints");
    refused("\"a\"\n", "\"a\"\nhost = \"base\"\n", "Config::Conflict", 9, "hangs where its first joint does");
    refused(
        "[\"panel_b1\", \"panel_b2\"]",
        "[\"panel_a1\", \"panel_a2\"]",
        "Config::Conflict",
        17,
        "lifted by another appendage",
    );
    refused("rest_rad = [0.1, -0.05]", "segments = []", "Config::Conflict", 12, "both lift and segments");
    refused(
        "end_effector = \"tool\"",
        "end_effector = \"panel_a2_link\"",
        "Config::UnknownFrame",
        4,
        "no link 'panel_a2_link'",
    );
    refused(
        "damping_nms_per_rad = [2.0, 1.5]",
        "damping_nms_per_rad = [2.0, -1.5]",
        "Config::NotPassive",
        6,
        "-1.5 N m s/rad",
    );
    let one = LIFTED
        .replacen("[\"panel_a1\", \"panel_a2\"]", "[\"panel_a1\"]", 1)
        .replace("[200.0, 190.0]", "[200.0]")
        .replace("[2.0, 1.5]", "[2.0]")
        .replace("[0.1, -0.05]", "[0.1]");
    let e = load(&one, &peers()).unwrap_err();
    assert!(e.has("Config::NotAChain") && e.to_string().contains("joint panel_a2 hangs on the lifted link"), "{e}");
}

const CLIENT: &str = r#"
[robot]
urdf = "flex.urdf"
end_effector = "tool"

[[client]]
name = "client"
mount = { xyz_m = [0.1, 0.2, 0.15], rpy_rad = [0.3, -0.4, 0.5] }
mass_kg = 320.0
com_m = [0.05, 0.1, 0.6]
inertia_com_kgm2 = [90.0, 2.0, -3.0, 80.0, 1.0, 70.0]

[[appendage]]
kind = "flex_panel"
name = "client_panel"
host = "client"
mount = { xyz_m = [0.6, 0.1, 0.7], rpy_rad = [0.2, 0.1, -0.3] }
segments = [
    { mass_kg = 12.0, com_m = [0.7, 0.05, 0.02], inertia_com_kgm2 = [1.2, 0.1, 0.0, 3.1, 0.1, 4.0], hinge_m = [0.1, 0.0, 0.05], hinge_axis = [0.1, 1.0, 0.2], stiffness_nm_per_rad = 60.0, damping_nms_per_rad = 0.6 },
]

[estimate]
parameters = ["client.*", "client_panel.k[*]"]
"#;

#[test]
fn a_held_client_with_a_panel_is_a_body_of_the_tree() {
    let loaded = load(CLIENT, &peers()).unwrap();
    let m = &loaded.model;
    assert_eq!((m.nj(), m.np(), loaded.estimated.len()), (11, 1, 11));
    assert_eq!(m.frames()[loaded.end_effector.unwrap()].name, "tool");
    let names: Vec<_> = m.param_decls().into_iter().map(|p| p.name).collect();
    assert!(names.contains(&"client.body.mass".to_owned()) && names.contains(&"client.body.i_zz".to_owned()));
    // By hand: the client's body added to the last arm link, its panel a link on a continuous joint.
    let (mut tree, _) = urdf::from_str(&peers(), &UrdfOptions::default()).unwrap();
    let tool = tree.frame("tool").unwrap().clone();
    let pose = |xyz: [f64; 3], rpy: [f64; 3]| {
        ff_model::Xform::new(ff_model::spatial::so3::rot_of_rpy(&rpy.into()), xyz.into())
    };
    let client = tool.placement * pose([0.1, 0.2, 0.15], [0.3, -0.4, 0.5]);
    let i = nalgebra::Matrix3::new(90.0, 2.0, -3.0, 2.0, 80.0, 1.0, -3.0, 1.0, 70.0);
    let body = ff_model::Inertia::from_com(320.0, &nalgebra::Vector3::new(0.05, 0.1, 0.6), &i);
    tree.add_rigid(tool.body, &body.to_parent(&client));
    let i = nalgebra::Matrix3::new(1.2, 0.1, 0.0, 0.1, 3.1, 0.1, 0.0, 0.1, 4.0);
    let panel = ff_model::Inertia::from_com(12.0, &nalgebra::Vector3::new(0.7, 0.05, 0.02), &i);
    let hinge = pose([0.6, 0.1, 0.7], [0.2, 0.1, -0.3]) * pose([0.1, 0.0, 0.05], [0.0; 3]);
    let joint = ff_model::Joint {
        name: "hinge".into(),
        kind: ff_model::JointKind::Continuous,
        axis: nalgebra::Vector3::new(0.1, 1.0, 0.2),
        placement: client * hinge,
        limits: ff_model::tree::JointLimits::default(),
    };
    tree.add_body(tool.body, "panel", joint, panel);
    let worst = compare(&tree, m, &[(60.0, 0.6, 0.0)], 73);
    println!("H {:.1e}, bias {:.1e}, forward dynamics {:.1e}, RNEA {:.1e}", worst[0], worst[1], worst[2], worst[3]);
    // Accelerations differ by the condition of the mass matrix times the rounding of two elimination orders.
    let limits = [1e-12, 1e-12, 1e-10, 1e-12];
    assert!(worst.iter().zip(limits).all(|(&w, l)| w < l), "{worst:?}");
}

#[test]
fn payloads_keep_every_law() {
    let table = "mass_kg = 32.0\ncom_m = [0.05, 0.1, 0.6]\ninertia_com_kgm2 = [9.0, 0.2, -0.3, 8.0, 0.1, 7.0]";
    let a = ff_model::payload::from_toml(&table.parse().unwrap()).unwrap();
    let report = check_appendage(&*a);
    println!("{report}");
    assert!(report.checks.iter().all(|c| c.pass), "{report}");
    let Err(e) = ff_model::payload::from_toml(&table.replace("32.0", "-32.0").parse().unwrap()) else {
        panic!("accepted")
    };
    assert_eq!((e.0.len(), e.0[0].code, e.0[0].object.as_deref()), (1, "Config::Inertia", Some("mass_kg")), "{e}");
    let Err(e) = ff_model::payload::from_toml(&table.replace("9.0", "90.0").parse().unwrap()) else {
        panic!("accepted")
    };
    assert_eq!((e.0.len(), e.0[0].object.as_deref()), (1, Some("inertia_com_kgm2")), "{e}");
}

#[test]
fn wrong_clients_are_refused_by_name() {
    for (from, to, code, line, says) in [
        ("\"client\"\nmount", "\"tool\"\nmount", "Config::DuplicateName", 7, "name of a link"),
        ("end_effector = \"tool\"\n", "", "Config::MissingKey", 5, "no link holds the client"),
        ("mass_kg = 320.0", "mass_kg = 320.0\nhost = \"tol\"", "Config::UnknownFrame", 10, "did you mean tool?"),
        ("mass_kg = 320.0", "mass_kg = -320.0", "Config::OutOfRange", 9, "-320 kg"),
        ("[90.0, 2.0", "[900.0, 2.0", "Config::Triangle", 11, "triangle"),
        ("mass_kg = 320.0", "mass = 320.0\nmass_kg = 320.0", "Config::UnknownKey", 9, "mass_kg"),
    ] {
        assert!(CLIENT.contains(from), "{from}");
        let text = CLIENT.replacen(from, to, 1);
        let e = load(&text, &peers()).unwrap_err();
        let p = e.0.iter().find(|p| p.code == code).unwrap_or_else(|| panic!("no {code} in {e}"));
        assert_eq!((p.line, p.hint.is_some()), (Some(line), true), "{e}");
        assert!(p.to_string().contains(says), "{says}: {e}");
    }
}
