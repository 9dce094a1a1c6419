//! One mission with every kind of appendage this workspace brings.

use crate::common::fixture;
use ff_dynamics::analysis::budget;
use ff_dynamics::{
    Boundary, Drive, Regressor, SimOptions, State, Work, bias, forward_dynamics, hybrid_dynamics, mass_matrix,
    regressor, rnea, simulate,
};
use ff_least_squares::Settings;
use ff_mission::Leniency;
use ff_model::Params;
use ff_model::scalar::D1;
use ff_records::RecordBuilder;
use ff_testkit::motion::Swing;
use ident::Options;
use ident::parameters::offset_start;
use ident::{Noise, OutputError, Request, estimate};
use nalgebra::DMatrix;
use std::path::Path;

fn opened() -> ffid::open::Opened {
    let path = &fixture("kinds/all.toml");
    ffid::open::open(path, Leniency::default()).unwrap()
}

#[test]
fn every_kind_is_in_the_example() {
    let o = opened();
    let found: std::collections::BTreeSet<_> = o.model.appendages().iter().map(|a| a.decl().kind).collect();
    let known: Vec<_> = ffid::default_registry().kinds().map(str::to_owned).collect();
    assert_eq!(found.into_iter().collect::<Vec<_>>(), known);
    assert_eq!((o.model.nj(), o.model.np()), (7, 2 + 2 + 1 + 2 + 2 + 3 + 2));
    let names: Vec<_> = o.model.param_decls().into_iter().map(|p| p.name).collect();
    let chosen: Vec<_> = o.estimated.iter().map(|&i| names[i].as_str()).collect();
    for name in ["client.body.mass", "panel_a.k[0,1]", "wheel.i_spin", "tank_round.mode[0].length", "array_client.k[1]"]
    {
        assert!(chosen.contains(&name), "{name} is not in {chosen:?}");
    }
}

#[test]
fn modes_are_found_for_all_of_them() {
    let o = opened();
    let table = ffid::modes::ModeTable::new(&o.model, &o.pose(), Boundary::JointsHeld).unwrap();
    assert_eq!(table.modes.len(), o.model.np());
    // The wheel turns freely; everything else swings.
    let still = table.modes.iter().filter(|m| m.frequency_hz < 1e-6).count();
    assert_eq!(still, 1);
}

#[test]
fn the_algorithms_agree_and_energy_balances_with_all_of_them() {
    let o = opened();
    let m = &o.model;
    let (p, mut work, nv) = (Params::nominal(m), Work::new(m), m.nv());
    // Fixed, general numbers.
    let wave = |i: usize, a: f64| a * (1.7 * i as f64 + 0.6).sin();
    let mut s = State::<f64>::zero(m);
    (0..s.q.len()).for_each(|i| s.q[i] = wave(i, 0.9));
    (0..s.eta.len()).for_each(|i| s.eta[i] = wave(i + 3, 0.15));
    (0..nv).for_each(|i| s.v[i] = wave(i + 5, 0.4));
    let tau: Vec<f64> = (0..nv).map(|i| wave(i + 7, 5.0)).collect();
    let (mut a, mut back) = (vec![0.0; nv], vec![0.0; nv]);
    forward_dynamics(m, &p, &s, &tau, &mut work, &mut a).unwrap();
    rnea(m, &p, &s, &a, &mut work, &mut back);
    let (mut h, mut b) = (DMatrix::zeros(nv, nv), vec![0.0; nv]);
    mass_matrix(m, &p, &s, &mut work, &mut h);
    bias(m, &p, &s, &mut work, &mut b);
    let full = &h * nalgebra::DVector::from_column_slice(&a) + nalgebra::DVector::from_column_slice(&b);
    let scale = (0..nv).map(|i| (0..nv).map(|j| (h[(i, j)] * a[j]).abs()).sum::<f64>()).fold(1.0, f64::max);
    for i in 0..nv {
        assert!((back[i] - tau[i]).abs() < 1e-11 * scale && (full[i] - tau[i]).abs() < 1e-11 * scale, "row {i}");
    }
    let (mut ah, mut th) = (vec![0.0; nv], vec![0.0; m.nj()]);
    hybrid_dynamics(m, &p, &s, &a[6..6 + m.nj()], &mut work, &mut ah, &mut th).unwrap();
    rnea(m, &p, &s, &ah, &mut work, &mut back);
    assert!((0..6).chain(6 + m.nj()..nv).all(|i| back[i].abs() < 1e-11 * scale));
    // Energy: d(T + U)/dt = power of tau - dissipation, along the motion.
    let energy = |t: f64| {
        let mut x = s.clone();
        (0..m.nj()).for_each(|i| x.q[i] += t * s.v[6 + i] + 0.5 * t * t * a[6 + i]);
        (0..m.np()).for_each(|i| x.eta[i] += t * s.v[6 + m.nj() + i] + 0.5 * t * t * a[6 + m.nj() + i]);
        (0..nv).for_each(|i| x.v[i] += t * a[i]);
        let e = budget(m, &p, &x, &mut Work::new(m));
        e.kinetic + e.potential
    };
    let step = 1e-4;
    let rate = (8.0 * (energy(step) - energy(-step)) - energy(2.0 * step) + energy(-2.0 * step)) / (12.0 * step);
    let power: f64 = tau.iter().zip(&s.v).map(|(t, v)| t * v).sum();
    let loss = budget(m, &p, &s, &mut work).dissipation;
    println!("energy rate {rate:.9}, power {power:.9}, loss {loss:.9} W");
    assert!(loss > 0.1 && (rate - power + loss).abs() < 1e-7 * (power.abs() + loss), "{rate} {power} {loss}");
}

#[test]
fn every_parameter_has_its_column_in_the_regressor() {
    let o = opened();
    let m = &o.model;
    let nv = m.nv();
    let p = Params::<f64>::nominal(m);
    let mut s = State::<f64>::zero(m);
    (0..s.q.len()).for_each(|i| s.q[i] = (1.3 * i as f64 + 0.4).sin());
    (0..s.eta.len()).for_each(|i| s.eta[i] = 0.1 * (1.1 * i as f64 + 0.7).cos());
    (0..nv).for_each(|i| s.v[i] = 0.5 * (0.9 * i as f64 + 0.2).sin());
    let a: Vec<f64> = (0..nv).map(|i| (2.1 * i as f64 + 0.3).sin()).collect();
    let mut y = Regressor::new(m);
    regressor(m, &p, &s, &a, &mut Work::new(m), &mut y);
    let (sd, ad): (State<D1>, Vec<D1>) = (s.lift(), a.iter().map(|&x| D1::constant(x)).collect());
    let mut work = Work::<D1>::new(m);
    for k in 0..m.n_params() {
        let values = p.values().iter().enumerate().map(|(i, &x)| D1::new(x, f64::from(u8::from(i == k)))).collect();
        let mut tau = vec![D1::constant(0.0); nv];
        rnea(m, &Params::from_values(m, values), &sd, &ad, &mut work, &mut tau);
        let scale = 1.0 + tau.iter().fold(0.0_f64, |x, t| x.max(t.eps[0].abs()));
        for (i, t) in tau.iter().enumerate() {
            assert!((y[(i, k)] - t.eps[0]).abs() < 1e-12 * scale, "column {k}, row {i}");
        }
    }
}

/// Joints that swing from rest, each with a period and an amplitude of its own.
fn swing(joints: usize) -> Swing {
    let one =
        |j: usize| (if j.is_multiple_of(2) { 1.0 } else { -1.0 } * (0.06 + 0.01 * j as f64), 0.9 + 0.41 * j as f64);
    Swing { seconds: 1e3, rest: 0.3, joints: (0..joints).map(one).collect() }
}

/// Torques and gyro of one simulated record tell one parameter of each kind, from starts 20 % off: simulation and
/// identification meet every kind through the trait alone.
#[test]
fn a_parameter_of_every_kind_is_identified_from_one_record() {
    let o = opened();
    let m = &o.model;
    let decls = m.param_decls();
    let wanted = [
        "client.body.mass",
        "panel_a.k[0]",
        "wheel.mass", // the spin inertia of a wheel that neither turns nor is driven shows nowhere
        "tank_main.mass",
        "tank_round.mode[0].mass",
        "tank_client.k[0]",
        "array_client.k[0]",
        "adapter.body.mass",
    ];
    let mut selected: Vec<usize> =
        wanted.iter().map(|n| decls.iter().position(|d| d.name == *n).unwrap_or_else(|| panic!("no {n}"))).collect();
    selected.sort_unstable();
    let kinds: std::collections::BTreeSet<&str> = m
        .appendages()
        .iter()
        .filter(|a| wanted.iter().any(|w| w.starts_with(&format!("{}.", a.name))))
        .map(|a| a.decl().kind)
        .collect();
    assert!(ffid::default_registry().kinds().all(|k| kinds.contains(k)), "{kinds:?}");

    let truth = Params::<f64>::nominal(m);
    let options = SimOptions { duration_s: 4.0, step_s: 2.5e-3, sample_s: 0.02 };
    let mut start = State::zero(m);
    start.q.fill(0.3);
    start.eta.copy_from_slice(&m.rest_position(&truth));
    let motion = swing(m.nj());
    let trace = simulate(m, &truth, &start, &Drive::Prescribed(&motion), &options).unwrap();
    let record = RecordBuilder::new(m.joint_names())
        .uniform(0.0, 1.0 / trace.dt)
        .q(trace.q.clone())
        .qd(trace.qd.clone())
        .qdd(trace.qdd.clone())
        .tau(trace.tau.clone())
        .gyro(trace.gyro())
        .build()
        .unwrap()
        .0;
    let from = offset_start(&decls, truth.values(), &selected, 0.2, 5);
    let noise = Noise { torque: 0.1, gyro: 1.5e-4 };
    let mut predict = OutputError::new(m, &record, &Options { substeps: 4, ..Options::new(noise) }).unwrap();
    let request = Request {
        settings: Settings { cost_floor: 1e-14, ..Settings::default() },
        ..Request::new(&decls, &selected, &from)
    };
    let e = estimate(&request, &mut predict).unwrap();
    assert_eq!(e.parameters.len(), wanted.len());
    for (p, &i) in e.parameters.iter().zip(&selected) {
        let error = p.value / truth.values()[i] - 1.0;
        println!("{}: from {:.5} to {:.7} {}, error {error:.1e}", p.name, p.start, p.value, p.unit);
        assert!((p.start / truth.values()[i] - 1.0).abs() > 0.19, "{} has to move", p.name);
        // What is left is the error of two different integrations, 9e-7 at worst.
        assert!(error.abs() < 1e-5, "{}: {error:e}", p.name);
    }
    println!("{:?} after {} steps", e.status, e.iterations);
}

/// The tables that the theory pages show, put together into one mission: they are what the readers accept.
#[test]
fn the_tables_of_the_theory_pages_are_accepted() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let dir = tempfile::tempdir().unwrap();
    for file in ["peers-model/flex.urdf", "modal/wing.csv"] {
        let from = root.join("fixtures").join(file);
        std::fs::copy(&from, dir.path().join(from.file_name().unwrap())).unwrap();
    }
    let mut mission = "[robot]\nurdf = \"flex.urdf\"\nend_effector = \"tool\"\n".to_owned();
    for page in ["panels", "modal", "slosh", "wheel", "payload"] {
        let text = std::fs::read_to_string(root.join(format!("docs/theory/{page}.md"))).unwrap();
        let (_, from) = text.split_once("```toml\n").unwrap_or_else(|| panic!("{page}.md shows no table"));
        mission += from.split_once("```").unwrap().0;
    }
    let path = dir.path().join("pages.toml");
    std::fs::write(&path, mission).unwrap();
    let o = ffid::open::open(&path, Leniency::default()).unwrap();
    let found: std::collections::BTreeSet<_> = o.model.appendages().iter().map(|a| a.decl().kind).collect();
    assert!(ffid::default_registry().kinds().all(|k| found.contains(k)), "{found:?}");
}
