//! `[[input]]` of a mission: what acts in `ffid simulate`, what is wrong with a table, and which commands take none.

use crate::case::trajectory;
use crate::common;
use crate::common::{ffid, fixture};
use ff_dynamics::sim::inputs::ExternalInput;
use ff_dynamics::sim::inputs::GravityGradient;
use ff_dynamics::sim::simulate_with;
use ff_dynamics::{Drive, SimOptions, State, Trace};
use ff_mission::Leniency;
use ff_model::{Params, Problems};
use ff_testkit::motion::Swing;
use ffid::inputs::Declared;
use ffid::open::{Opened, open};
use ffid::sense::{fly, from_rest};
use nalgebra::{Rotation3, Vector3};
use serde_json::Value;
use std::fs;

/// Every joint in motion, from rest.
fn wave(joints: usize) -> Swing {
    let joints = (0..joints).map(|j| (0.07 + 0.02 * j as f64, 0.8 + 0.3 * j as f64)).collect();
    Swing { seconds: 3.0, rest: 0.4, joints }
}

const RATE: f64 = 100.0;

/// A mission of a folder of its own.
fn load(text: &str) -> Result<Opened, Problems> {
    let dir = tempfile::tempdir().unwrap();
    fs::copy(fixture("paper/robot.urdf"), dir.path().join("robot.urdf")).unwrap();
    let file = dir.path().join("m.toml");
    fs::write(&file, text.replace("../paper/", "")).unwrap();
    open(&file, Leniency::default())
}

fn text(path: &str) -> String {
    fs::read_to_string(fixture(path)).unwrap()
}

/// The paper's flexible robot, panels damped, with inputs.
fn flexible(inputs: &str) -> Opened {
    load(&format!("{}\n{inputs}", text("paper/flex.toml"))).unwrap_or_else(|p| panic!("{p}"))
}

fn run(o: &Opened) -> Trace {
    let inputs: Vec<_> = o.inputs.iter().map(Declared::as_input).collect();
    fly(&o.model, &Params::nominal(&o.model), &wave(o.model.nj()), &inputs, RATE, 0.0).unwrap()
}

/// What the momentum about the world origin has gained at the end: linear, angular.
fn gain(o: &Opened, t: &Trace) -> [Vector3<f64>; 2] {
    let p = Params::nominal(&o.model);
    let at = |i| t.budget(&o.model, &p, i).momentum;
    let (a, b) = (at(0), at(t.len() - 1));
    [b.lin - a.lin, b.ang - a.ang]
}

fn v3(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
}

/// Force times duration along the direction, twice: the base is so heavy to turn that its axes stay those of the world, while it
/// is pushed, the arm swings and the panels bend and lose energy.
#[test]
fn a_burn_gives_force_times_duration() {
    let heavy = "end_effector = \"tool\"\nbase_inertial = { mass_kg = 613.0, com_m = [0.8, 0.1, 0.5], \
                 inertia_com_kgm2 = [1.1e10, 2e8, -3e8, 1.3e10, 1e8, 1.2e10] }";
    let m = text("paper/flex.toml").replace("end_effector = \"tool\"", heavy);
    let burns = "\n[[input]]\nkind = 'thruster'\nhost = 'base'\npoint_m = [-0.4, 0.3, 0.2]\ndirection = [0.8, 0.3, -0.5]
        pulse = [{ t_on_s = 0.313, t_off_s = 1.127, force_n = 6.5 }, { t_on_s = 1.9, t_off_s = 2.2071, force_n = 11.3 }]\n";
    let o = load(&(m + burns)).unwrap_or_else(|p| panic!("{p}"));
    let t = run(&o);
    let want = v3(0.8, 0.3, -0.5).normalize() * (6.5 * (1.127 - 0.313) + 11.3 * (2.2071 - 1.9));
    let [p, _] = gain(&o, &t);
    println!("{p:?} for {want:?}, dissipated {} J", t.dissipated[t.len() - 1]);
    assert!((p - want).norm() < 1e-7 * want.norm(), "{p:?} {want:?}");
    assert!(t.dissipated[t.len() - 1] > 1e-4 && t.eta.amax() > 1e-3, "the panels must bend");
}

/// Any base: a wrench in world axes gives its force times duration, its moment and that of the force where the base is.
#[test]
fn a_wrench_in_world_axes_keeps_its_direction() {
    let pulse = "pulse = [{ t_on_s = 0.4, t_off_s = 1.9, force_n = [3.1, -4.2, 2.3], moment_nm = [0.7, 5.1, -1.3] }]\n";
    let wrench = |axes: &str| format!("[[input]]\nkind = 'wrench'\nhost = 'base'\naxes = '{axes}'\n{pulse}");
    let (f, m) = (v3(3.1, -4.2, 2.3), v3(0.7, 5.1, -1.3));
    let o = flexible(&wrench("world"));
    let t = run(&o);
    let [p, l] = gain(&o, &t);
    assert!((p - f * 1.5).norm() < 1e-8, "{p:?}");
    // Simpson's rule over the samples of the pulse.
    let arm = (40..190).step_by(2).fold(Vector3::zeros(), |s, k| {
        let at = |k: usize| t.pos.row(k).transpose();
        s + (at(k) + at(k + 1) * 4.0 + at(k + 2)) / (3.0 * RATE)
    });
    let want = m * 1.5 + arm.cross(&f);
    assert!((l - want).norm() < 1e-8, "{l:?} {want:?}");
    assert!((t.att[(190, 0)] - 1.0).abs() > 1e-5, "the base must turn");
    let o = flexible(&wrench("body"));
    let [p, _] = gain(&o, &run(&o));
    assert!((p - f * 1.5).norm() > 1e-3, "{p:?}");
}

/// A client has a frame turned against that of the body it belongs to: a thruster there is the wrench of its force, given there in
/// body axes, and both are what other numbers say in the frame of the body.
#[test]
fn frames_beside_that_of_their_body_count() {
    let client = "[[client]]\nname = 'client'\nmount = { xyz_m = [0.1, -0.2, 0.3], rpy_rad = [0.3, -0.5, 0.8] }
        mass_kg = 34.0\ncom_m = [0.1, 0.2, 0.3]\ninertia_com_kgm2 = [3.1, 0.1, -0.2, 2.7, 0.3, 2.2]\n";
    let thruster =
        "[[input]]\nkind = 'thruster'\nhost = 'client'\npoint_m = [0.2, 0.1, -0.3]\ndirection = [0.3, -0.6, 0.5]
        force_n = 4.3\n";
    let wrench = |host: &str, f: Vector3<f64>, n: Vector3<f64>| {
        let list = |v: &Vector3<f64>| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
        let (f, n) = (list(&f), list(&n));
        format!("[[input]]\nkind = 'wrench'\nhost = '{host}'\naxes = 'body'\nforce_n = {f}\nmoment_nm = {n}\n")
    };
    let (f, r) = (v3(0.3, -0.6, 0.5).normalize() * 4.3, v3(0.2, 0.1, -0.3));
    // The client hangs in the tool, which is 3/7 m along y from link7, with its axes.
    let turn = Rotation3::from_euler_angles(0.3, -0.5, 0.8);
    let (on_link, at) = (turn * f, turn * r + v3(0.1, 3.0 / 7.0 - 0.2, 0.3));
    let all = [thruster.to_owned(), wrench("client", f, r.cross(&f)), wrench("link7", on_link, at.cross(&on_link))]
        .map(|i| run(&flexible(&(client.to_owned() + &i))));
    assert!(all[0].impulse.amax() > 5.0);
    for other in &all[1..] {
        let off = (&all[0].twist - &other.twist).amax() / all[0].twist.amax();
        assert!(off < 1e-10, "{off:e}");
    }
}

/// Samples, and a motor: no momentum, but work, on the coordinate that was named.
#[test]
fn a_motor_changes_no_momentum() {
    let o = flexible(
        "[[appendage]]\nkind = 'reaction_wheel'\nname = 'wheel'\nhost = 'base'\naxis = [0.2, 0.7, -0.4]\nmass_kg = 8.5
        inertia_spin_kgm2 = 0.11\ninertia_transverse_kgm2 = 0.06\nviscous_nms_per_rad = 2e-5
        [[input]]\nkind = 'passive_force'\ncoordinate = 'wheel.spin'
        sample = [{ t_s = 0.3, torque_nm = 0.4 }, { t_s = 1.1, torque_nm = 0.9 }, { t_s = 2.7, torque_nm = 0.2 }]\n",
    );
    let t = run(&o);
    let [p, l] = gain(&o, &t);
    assert!(p.norm() < 1e-8 && l.norm() < 1e-8, "{p:?} {l:?}");
    let spin = o.model.passive_coords().iter().position(|(n, _)| n == "wheel.spin").unwrap();
    // About (0.4 + 0.9) / 2 * 0.8 + (0.9 + 0.2) / 2 * 1.6 N m s on 0.11 kg m^2; the base turns and the rotor rubs a little.
    let (got, want) = (t.nu[(t.len() - 1, spin)], 1.4 / 0.11);
    assert!((got / want - 1.0).abs() < 0.01, "{got} {want}");
    assert!(t.input_work[t.len() - 1] > 5.0);
}

#[test]
fn the_gradient_is_that_of_the_library_and_no_input_changes_nothing() {
    let o = flexible(
        "[[input]]\nkind = 'gravity_gradient'\nradius_m = 6.878e6\nradial = [0.6, -0.3, 0.9]\nnormal = [0.3, 0.6, 0.0]\n",
    );
    let (m, p, motion) = (&o.model, Params::nominal(&o.model), wave(o.model.nj()));
    let t = run(&o);
    let g = GravityGradient::new(GravityGradient::EARTH, 6.878e6, v3(0.6, -0.3, 0.9), v3(0.3, 0.6, 0.0)).unwrap();
    let mut from = State::zero(m);
    from.q.fill(0.4);
    let inputs: [&dyn ExternalInput; 1] = [&g];
    // The step is that which `fly` takes for this robot: 30 of them fill a sample at most.
    let of = |step_s: f64| {
        let options = SimOptions { duration_s: 3.0, step_s, sample_s: 1.0 / RATE };
        simulate_with(m, &p, &from, &Drive::Prescribed(&motion), &inputs, &options).unwrap()
    };
    let same = (1..=30).any(|n| {
        let want = of(1.0 / RATE / f64::from(n));
        want.twist == t.twist && want.eta == t.eta && want.tau == t.tau && want.impulse == t.impulse
    });
    assert!(same && t.impulse.amax() > 1e-6);
    // Another body than the Earth, by its gravitational parameter.
    let text =
        "[[input]]\nkind = 'gravity_gradient'\nmu_m3_per_s2 = 4.28e13\nradius_m = 3.7e6\nradial = [0.6, -0.3, 0.9]
        normal = [0.3, 0.6, 0.0]\n";
    let mars = GravityGradient::new(4.28e13, 3.7e6, v3(0.6, -0.3, 0.9), v3(0.3, 0.6, 0.0)).unwrap();
    assert_eq!(flexible(text).inputs, [Declared::GravityGradient(mars)]);
    // Without inputs `fly` is what it was before there were any.
    let free = flexible("");
    let t = run(&free);
    let same = (1..=30).any(|n| {
        let options = SimOptions { duration_s: 3.0, step_s: 1.0 / RATE / f64::from(n), sample_s: 1.0 / RATE };
        let want = from_rest(m, &p, &motion, &options).unwrap();
        want.twist == t.twist && want.tau == t.tau
    });
    assert!(same && free.inputs.is_empty() && t.impulse.amax() == 0.0);
}

/// One table each: what follows `[[input]]`, the code it gets, and words of its line.
const BAD: &[(&str, &str, &[&str])] = &[
    ("host = 'base'", "Config::MissingKey", &["input[0]: ", "'kind'"]),
    ("kind = 'truster'", "Config::UnknownChoice", &["input[0].kind", "thruster"]),
    (
        "kind = 'thruster'\nhost = 'bsae'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\nforce_n = 2.5",
        "Config::UnknownFrame",
        &["input[0].host", "'bsae'", "base"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2]\ndirection = [0.3, 0.2, 0.1]\nforce_n = 2.5",
        "Config::WrongLength",
        &["input[0].point_m", "2 numbers, expected 3"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\ndirection = [0.3, 0.2, 0.1]\nforce_n = 2.5",
        "Config::MissingKey",
        &["'point_m'"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.0, 0.0, 0.0]\nforce_n = 2.5",
        "Config::ZeroAxis",
        &["input[0].direction", "zero vector"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [3e-200, 2e-200, 1e-200]\nforce_n = 2.5",
        "Config::Input",
        &["input[0]", "the length of the direction is 0"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\nforce_n = -2.5",
        "Config::OutOfRange",
        &["input[0].force_n", "value -2.5 N, limit >= 0 N"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\nforce_n = inf",
        "Config::NotFinite",
        &["input[0].force_n"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]",
        "Config::MissingKey",
        &["input[0].pulse", "none of force_n, pulse, sample", "add pulse"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\nforce_n = 2.5\npulse = [{ t_on_s = 0.4, t_off_s = 0.9, force_n = 2.5 }]",
        "Config::Conflict",
        &["input[0].pulse", "more than one of force_n, pulse, sample"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\npulse = []",
        "Config::WrongLength",
        &["input[0].pulse", "0 tables, at least 1 needed"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\npulse = [2.5]",
        "Config::Type",
        &["input[0].pulse[0]", "a table"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\npulse = 2.5",
        "Config::Type",
        &["input[0].pulse", "[[input[0].pulse]]"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\npulse = [{ t_on_s = 0.9, t_off_s = 0.4, force_n = 2.5 }]",
        "Config::OutOfRange",
        &["input[0].pulse[0].t_off_s", "value 0.4 s, limit > 0.9 s"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\npulse = [{ t_on_s = 0.9, t_off_s = nan, force_n = 2.5 }]",
        "Config::NotFinite",
        &["input[0].pulse[0].t_off_s"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\npulse = [{ t_on_s = -1.5e308, t_off_s = 1.5e308, force_n = 2.5 }]",
        "Config::Input",
        &["the length of a pulse is inf s"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\npulse = [{ t_on_s = 0.4, t_off_s = 0.9 }]",
        "Config::MissingKey",
        &["input[0].pulse[0]", "'force_n'"],
    ),
    (
        "kind = 'thruster'\nhost = 'base'\npoint_m = [0.1, 0.2, 0.3]\ndirection = [0.3, 0.2, 0.1]\npulse = [{ t_on = 0.3, t_on_s = 0.4, t_off_s = 0.9, force_n = 2.5 }]",
        "Config::UnknownKey",
        &["input[0].pulse[0]", "'t_on'", "t_on_s"],
    ),
    ("kind = 'wrench'\nhost = 'base'\nforce_n = [2.5, 0.3, 0.7]", "Config::MissingKey", &["'axes'"]),
    (
        "kind = 'wrench'\nhost = 'base'\naxes = 'word'\nforce_n = [2.5, 0.3, 0.7]",
        "Config::UnknownChoice",
        &["input[0].axes", "world"],
    ),
    ("kind = 'wrench'\nhost = 'base'\naxes = 'body'\nforce_n = 2.5", "Config::Type", &["input[0].force_n"]),
    (
        "kind = 'wrench'\nhost = 'base'\naxes = 'body'\npoint_m = [0.1, 0.2, 0.3]\nforce_n = [2.5, 0.3, 0.7]",
        "Config::UnknownKey",
        &["'point_m'"],
    ),
    (
        "kind = 'wrench'\nhost = 'tool'\naxes = 'world'\nforce_n = [2.5, 0.3, 0.7]",
        "Config::OutOfRange",
        &["input[0].host", "0.42857142857142855 m", "of body link7", "give link7 as host"],
    ),
    (
        "kind = 'wrench'\nhost = 'base'\naxes = 'body'\nsample = [{ t_s = 0.3, force_n = [2.5, 0.3, 0.7] }]",
        "Config::WrongLength",
        &["input[0].sample", "1 tables, at least 2 needed"],
    ),
    (
        "kind = 'wrench'\nhost = 'base'\naxes = 'body'\nsample = [{ t_s = 0.3, moment_nm = [2.5, 0.3, 0.7] }, { t_s = 0.3, force_n = [2.5, 0.3, 0.7] }]",
        "Config::OutOfRange",
        &["input[0].sample[1].t_s", "value 0.3 s, limit > 0.3 s"],
    ),
    (
        "kind = 'passive_force'\ncoordinate = 'wheel.spn'\ntorque_nm = 0.3",
        "Config::UnknownCoordinate",
        &["input[0].coordinate", "'wheel.spn'", "wheel.spin"],
    ),
    (
        "kind = 'passive_force'\ncoordinate = 'nothing like it'\ntorque_nm = 0.3",
        "Config::UnknownCoordinate",
        &["coordinates: panel.hinge[0], panel.hinge[1], wheel.spin"],
    ),
    (
        "kind = 'passive_force'\ncoordinate = 'wheel.spin'\nforce_n = 0.3",
        "Config::Conflict",
        &["force_n is given, but the unit of wheel.spin is rad", "give torque_nm"],
    ),
    (
        "kind = 'passive_force'\ncoordinate = 'tank.shift[1]'\npulse = [{ t_on_s = 0.4, t_off_s = 0.9, torque_nm = 2.5 }]",
        "Config::Conflict",
        &["the unit of tank.shift[1] is m", "give force_n"],
    ),
    (
        "kind = 'passive_force'\ncoordinate = 'wheel.spin'\nforce_n = 0.3\ntorque_nm = 0.2",
        "Config::Conflict",
        &["torque_nm and force_n are both given"],
    ),
    (
        "kind = 'gravity_gradient'\nradial = [0.6, -0.3, 0.9]\nnormal = [0.3, 0.6, 0.0]",
        "Config::MissingKey",
        &["'radius_m'"],
    ),
    (
        "kind = 'gravity_gradient'\nradius_m = -7e6\nradial = [0.6, -0.3, 0.9]\nnormal = [0.3, 0.6, 0.0]",
        "Config::OutOfRange",
        &["input[0].radius_m", "value -7000000 m, limit > 0 m"],
    ),
    (
        "kind = 'gravity_gradient'\nradius_m = 7e6\nmu_m3_per_s2 = 0.0\nradial = [0.6, -0.3, 0.9]\nnormal = [0.3, 0.6, 0.0]",
        "Config::OutOfRange",
        &["value 0 m^3/s^2, limit > 0 m^3/s^2"],
    ),
    (
        "kind = 'gravity_gradient'\nradius_m = 7e6\nradial = [0.6, -0.3, 0.9]\nnormal = [0.3, 0.6, 0.1]",
        "Config::OutOfRange",
        &["input[0].normal", "1.182e-1"],
    ),
    (
        "kind = 'gravity_gradient'\nradius_m = 1e-200\nradial = [0.6, -0.3, 0.9]\nnormal = [0.3, 0.6, 0.0]",
        "Config::Input",
        &["the gradient mu / r^3 is inf 1/s^2"],
    ),
];

/// The robot of the example without its inputs.
fn bare() -> String {
    let all = text("kinds/inputs.toml");
    all.split_once("\n[[input]]").unwrap().0.to_owned()
}

#[test]
fn bad_inputs_get_one_error_each_that_names_them() {
    let (bare, mut failures) = (bare(), String::new());
    for (table, code, says) in BAD {
        let Err(found) = load(&format!("{bare}\n[[input]]\n{table}\n")) else {
            failures += &format!("taken: {table}\n");
            continue;
        };
        let p = &found.0[0];
        let line = p.to_string();
        let placed = p.line.is_some() || *code == "Config::Input";
        let good = found.0.len() == 1 && p.code == *code && p.hint.is_some() && placed && found.exit_code() == 11;
        if !good || !common::says(&serde_json::to_value(p).unwrap(), &line, says) {
            failures += &format!("{table}\nexpected {code} {says:?}, found\n{found}\n\n");
        }
    }
    assert!(failures.is_empty(), "{failures}");
    // All of a file at once, each at its table.
    let all: String =
        BAD.iter().filter(|b| b.1 != "Config::Input").map(|(t, ..)| format!("[[input]]\n{t}\n")).collect();
    let found = load(&format!("{bare}\n{all}")).unwrap_err();
    assert_eq!(found.0.len(), BAD.iter().filter(|b| b.1 != "Config::Input").count(), "{found}");
}

/// The lines of the page on simulation are those of the example, which is simulated and checked here.
#[test]
fn the_example_of_the_docs_is_simulated() {
    let example = text("kinds/inputs.toml");
    let page = fs::read_to_string(fixture("../docs/theory/simulation.md")).unwrap();
    let block = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    assert!(example.contains(block) && block.matches("[[input]]").count() == 5, "{block}");
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("a.csv"), trajectory(5.0, 0.2)).unwrap();
    let mission = fixture("kinds/inputs.toml");
    let mission = mission.to_str().unwrap();
    let (code, out, err) = ffid(dir.path(), &["check", mission]);
    assert_eq!(code, 0, "{err}");
    for line in [
        "inputs (5), for `ffid simulate`",
        "  thruster on base: 2 pulses, from 0.7 to 3.85 s",
        "  wrench on link7 in world axes: 3 samples, from 0.4 to 2.6 s",
        "  passive_force on wheel.spin: at all times",
        "  passive_force on tank.shift[1]: 1 pulse, from 2.1 to 2.4 s",
        "  gravity_gradient on everything: at all times, 6878000 m from the centre",
    ] {
        assert!(out.contains(line), "{line}\n{out}");
    }
    let (code, out, err) = ffid(dir.path(), &["check", mission, "--json"]);
    let read: Value = serde_json::from_str(&out).unwrap();
    let thruster = &read["mission"]["inputs"][0];
    assert_eq!((code, thruster["kind"].as_str()), (0, Some("thruster")), "{err}");
    assert_eq!(thruster["pulse"][1]["t_off_s"].as_f64(), Some(3.85), "{thruster}");
    let simulate = ["simulate", mission, "--trajectory", "a.csv", "--seed", "7"];
    let (code, out, err) = ffid(dir.path(), &[&simulate[..], &["--out", "a-rec.csv"]].concat());
    assert!(code == 0 && out.contains("  inputs (5): impulse ["), "{out}{err}");
    let (_, out, _) = ffid(dir.path(), &[&simulate[..], &["--out", "b-rec.csv", "--json"]].concat());
    let v: Value = serde_json::from_str(&out).unwrap();
    let acted = &v["record"]["acted"];
    // The burns give 6.5 * 1.2 + 4.1 * 0.65 N s while the base hardly turns, the wrench what its samples enclose.
    let along = v3(0.8, 0.1, -0.3).normalize() * 10.465;
    let samples = v3(0.75, -0.1, 0.05) * 0.9 + v3(0.25, 0.4, 0.25) * 1.3;
    let got = Vector3::from_fn(|k, _| acted["impulse_ns"][k].as_f64().unwrap());
    assert!((got - along - samples).norm() < 0.05 * got.norm(), "{got:?} {along:?} {samples:?}");
    assert_eq!(acted["inputs"], 5);
    assert_eq!(fs::read(dir.path().join("a-rec.csv")).unwrap(), fs::read(dir.path().join("b-rec.csv")).unwrap());
    // Without inputs nothing is said of them.
    fs::copy(fixture("paper/robot.urdf"), dir.path().join("robot.urdf")).unwrap();
    fs::write(dir.path().join("bare.toml"), bare().replace("../paper/", "")).unwrap();
    let simulate = ["simulate", "bare.toml", "--trajectory", "a.csv", "--out", "c.csv"];
    let (code, out, err) = ffid(dir.path(), &[&simulate[..], &["--json"]].concat());
    assert!(code == 0 && !out.contains("acted"), "{out}{err}");
    let (code, out, _) = ffid(dir.path(), &["check", "bare.toml"]);
    assert!(code == 0 && !out.contains("inputs ("), "{out}");
}

/// What takes the robot to float freely refuses inputs before it does anything.
#[test]
fn commands_that_know_no_inputs_refuse_them() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("a.csv"), trajectory(5.0, 0.2)).unwrap();
    let mission = fixture("kinds/inputs.toml");
    let mission = mission.to_str().unwrap();
    for args in [
        &["identify", mission, "--record", "a.csv", "--out", "res"][..],
        &["identify", mission, "--record", "a.csv", "--out", "res", "--external-torque"],
        &["excite", mission, "--out", "res"],
        &["plan", mission, "--trajectory", "a.csv", "--out", "res"],
    ] {
        let (code, _, err) = ffid(dir.path(), args);
        assert!(code == 11 && err.contains("error[Config::ExternalInput] input: 5 [[input]]"), "{args:?}\n{err}");
        assert!(err.contains("a copy of the mission without [[input]]"), "{err}");
        assert!(!dir.path().join("res").exists());
    }
}
