//! The paper's robot and missions load without a warning and are what Table I says.

use crate::common::{fixture, registry};
use approx::assert_relative_eq;
use ff_mission::urdf::{UrdfOptions, from_file};
use ff_mission::{LoadOptions, Mission};
use ff_model::{BaseKind, Inertia, Model};
use nalgebra::{Matrix3, Vector3};

fn robot() -> Model {
    let (m, warnings) = from_file(&fixture("paper/robot.urdf"), &UrdfOptions::default()).unwrap();
    assert!(warnings.0.is_empty(), "{warnings}");
    m
}

/// Pose of each body in the base at joint positions zero.
fn poses(m: &Model) -> Vec<ff_model::Xform<f64>> {
    let mut out = vec![ff_model::Xform::identity()];
    for b in m.bodies() {
        out.push(out[b.parent] * b.joint.placement);
    }
    out
}

#[test]
fn the_robot_is_table_one() {
    let m = robot();
    assert_eq!((m.base_kind(), m.n_bodies(), m.nj()), (BaseKind::Floating, 8, 7));
    let base = m.inertia(0);
    assert_relative_eq!(base.mass, 600.0);
    assert_relative_eq!(base.com().unwrap(), Vector3::new(0.9, 0.0, 0.6), epsilon = 1e-15);
    assert_relative_eq!(base.about_com(), Matrix3::from_diagonal_element(150.0), epsilon = 1e-10);
    let arm: f64 = (1..8).map(|i| m.inertia(i).mass).sum();
    assert_relative_eq!(arm, 60.0, max_relative = 1e-14);
}

#[test]
fn the_arm_points_up_with_alternating_axes() {
    let m = robot();
    let x = poses(&m);
    for (i, b) in m.bodies().iter().enumerate() {
        let axis = x[i + 1].rot * b.joint.axis;
        let want = if i % 2 == 0 { Vector3::z() } else { Vector3::y() };
        assert_relative_eq!(axis, want, epsilon = 1e-15);
        assert_relative_eq!(x[i + 1].pos, Vector3::new(0.9, 0.0, 1.2 + 3.0 / 7.0 * i as f64), epsilon = 1e-15);
        // In base axes the small moment is the one along the arm.
        let seen = b.inertia.to_parent(&x[i + 1]);
        assert_relative_eq!(seen.about_com(), Matrix3::from_diagonal(&Vector3::new(0.4, 0.4, 0.04)), epsilon = 1e-12);
        assert_relative_eq!(seen.com().unwrap() - x[i + 1].pos, Vector3::new(0.0, 0.0, 1.5 / 7.0), epsilon = 1e-14);
    }
    let tool = m.frame("tool").unwrap();
    assert_eq!(tool.body, 7);
    assert_relative_eq!((x[7] * tool.placement).pos, Vector3::new(0.9, 0.0, 4.2), epsilon = 1e-14);
}

#[test]
fn both_missions_load_without_a_warning() {
    for (file, np, appendages) in [("paper/flex.toml", 4, 2), ("paper/slosh.toml", 2, 1)] {
        let l = Mission::load(&fixture(file), &registry(), &LoadOptions::default()).unwrap_or_else(|p| panic!("{p}"));
        assert!(l.warnings.0.is_empty(), "{}", l.warnings);
        assert_eq!((l.model.np(), l.model.appendages().len()), (np, appendages), "{file}");
        assert_eq!(l.mission.sensors.rate_hz, 100.0);
        assert_eq!(l.mission.sensors.torque.noise_std_nm, 0.1);
        assert_eq!(l.mission.sensors.gyro.noise_std_rad_per_s, 1.5e-4);
        assert_eq!(l.mission.sensors.encoder.bits, Some(20));
        assert_eq!(l.mission.limits.velocity_rad_per_s, Some(0.17));
        assert_eq!(l.mission.limits.acceleration_rad_per_s2, Some(0.15));
        // The base's ten and every k and d.
        assert_eq!(l.estimated.len(), 10 + 2 * np, "{file}");
        let names: Vec<String> = l.model.param_decls().into_iter().map(|p| p.name).collect();
        assert!(l.estimated.iter().all(|&i| names[i].starts_with("base.") || names[i].ends_with(']')));
        let f = &l.model.frames()[l.end_effector.unwrap()];
        assert_eq!((f.name.as_str(), f.body), ("tool", 7));
        assert_eq!(l.mission.reproduce.unwrap().hold_rad.len(), 7);
    }
}

#[test]
fn wings_mirror_each_other_and_the_tank_hangs_from_the_centre_of_mass() {
    let l = Mission::load(&fixture("paper/flex.toml"), &registry(), &LoadOptions::default()).unwrap();
    let at: Vec<_> = l.model.appendages().iter().map(|a| a.mount.pos).collect();
    assert_eq!(at, [Vector3::new(0.9, 0.3, 0.6), Vector3::new(0.9, -0.3, 0.6)]);
    let segments = |i: usize| l.mission.appendages[i].settings["segments"].as_array().unwrap().clone();
    for (a, b) in segments(0).iter().zip(&segments(1)) {
        for key in ["com_m", "hinge_m"] {
            let y = |t: &toml::Value| t[key][1].as_float().unwrap();
            assert_eq!(y(a), -y(b));
        }
        for key in
            ["mass_kg", "inertia_com_kgm2", "hinge_axis", "stiffness_nm_per_rad", "damping_nms_per_rad", "rest_rad"]
        {
            assert_eq!(a[key], b[key]);
        }
    }
    let l = Mission::load(&fixture("paper/slosh.toml"), &registry(), &LoadOptions::default()).unwrap();
    let com = l.model.inertia(0).com().unwrap();
    assert_relative_eq!(l.model.appendages()[0].mount.pos, com, epsilon = 1e-15);
}

#[test]
fn rigid_fuel_adds_to_the_body_of_its_link() {
    let urdf = crate::common::text("paper/robot.urdf");
    let toml = "[robot]\nurdf = 'x'\n[[robot.rigid]]\nlink = 'tool'\nmass_kg = 5\ncom_m = [0.1, 0.2, 0.3]\n";
    let l = Mission::from_str(toml, &urdf, &registry(), &LoadOptions::default()).unwrap();
    let r = robot();
    let tool = r.frame("tool").unwrap();
    let fuel = Inertia::point(5.0, &(tool.placement.pos + Vector3::new(0.1, 0.2, 0.3)));
    assert_relative_eq!(l.model.inertia(7).rot, (*r.inertia(7) + fuel).rot, epsilon = 1e-13);
    assert_relative_eq!(l.model.inertia(7).h, (*r.inertia(7) + fuel).h, epsilon = 1e-13);
}
