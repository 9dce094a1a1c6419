//! From a mission file to modes and to an identified stiffness, without a line about booms in the libraries used.

use ff_dynamics::motion::JointMotion;
use ff_dynamics::{Boundary, Drive, SimOptions, State, modes, simulate};
use ff_least_squares::Settings;
use ff_mission::{LoadOptions, Loaded, Mission};
use ff_model::{Params, Registry};
use ff_records::RecordBuilder;
use ident::Options;
use ident::parameters::offset_start;
use ident::{Noise, OutputError, Request, estimate};

fn load() -> Loaded {
    let mut registry = Registry::new();
    antenna_boom::register(&mut registry);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/mission.toml");
    Mission::load(path.as_ref(), &registry, &LoadOptions::default()).unwrap()
}

/// Freeing the base takes inertia away from the modes: both lie above the cantilever's.
#[test]
fn modes_are_those_of_a_boom_on_a_free_base() {
    let model = load().model;
    let params = Params::nominal(&model);
    let q = vec![0.3; model.nj()];
    let f =
        |b| -> Vec<f64> { modes(&model, &params, &q, &[0.0; 2], b).unwrap().iter().map(|m| m.frequency_hz).collect() };
    let (held, free) = (f(Boundary::BaseHeld), f(Boundary::JointsHeld));
    println!("held {held:?} Hz, free {free:?} Hz");
    let modal_mass = 33.0 / 140.0 * 8.0 + 3.0;
    let cantilever = (3.0 * 2200.0 / 6.0_f64.powi(3) / modal_mass).sqrt() / std::f64::consts::TAU;
    assert!(held.iter().all(|f| (f - cantilever).abs() < 1e-12));
    assert!(free.iter().all(|f| *f > 1.05 * cantilever));
}

/// Joints that swing with periods around that of the boom.
struct Swing(usize);

impl JointMotion for Swing {
    fn dof(&self) -> usize {
        self.0
    }
    fn duration(&self) -> f64 {
        1e3
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        for j in 0..self.0 {
            // From rest: (1 - cos wt), and a start that is smooth.
            let (a, w) = (0.13 + 0.02 * j as f64, 1.1 + 0.37 * j as f64);
            q[j] = 0.3 + a * (1.0 - (w * t).cos()) * if j % 2 == 0 { 1.0 } else { -1.0 };
            qd[j] = a * w * (w * t).sin() * if j % 2 == 0 { 1.0 } else { -1.0 };
            qdd[j] = a * w * w * (w * t).cos() * if j % 2 == 0 { 1.0 } else { -1.0 };
        }
    }
}

#[test]
#[ignore = "full tier: 4 s"]
fn stiffness_damping_and_tip_mass_are_identified() {
    let l = load();
    let truth = Params::<f64>::nominal(&l.model);
    let options = SimOptions { duration_s: 10.0, step_s: 2e-3, sample_s: 0.02 };
    let motion = Swing(l.model.nj());
    let trace = simulate(&l.model, &truth, &State::zero(&l.model), &Drive::Prescribed(&motion), &options).unwrap();
    let record = RecordBuilder::new(l.model.joint_names())
        .uniform(0.0, 1.0 / trace.dt)
        .q(trace.q.clone())
        .qd(trace.qd.clone())
        .qdd(trace.qdd.clone())
        .tau(trace.tau.clone())
        .gyro(trace.gyro())
        .build()
        .unwrap()
        .0;
    let decls = l.model.param_decls();
    let start = offset_start(&decls, truth.values(), &l.estimated, 0.25, 3);
    let noise = Noise { torque: 0.1, gyro: 1.5e-4 };
    let mut predict = OutputError::new(&l.model, &record, &Options { substeps: 4, ..Options::new(noise) }).unwrap();
    let request = Request {
        settings: Settings { cost_floor: 1e-14, ..Settings::default() },
        ..Request::new(&decls, &l.estimated, &start)
    };
    let e = estimate(&request, &mut predict).unwrap();
    assert_eq!(e.parameters.len(), 3);
    for (p, &i) in e.parameters.iter().zip(&l.estimated) {
        let error = p.value / truth.values()[i] - 1.0;
        println!("{}: from {:.4} to {:.6} {}, error {error:.1e}", p.name, p.start, p.value, p.unit);
        assert!((p.start / truth.values()[i] - 1.0).abs() > 0.2, "it has to move");
        assert!(error.abs() < 1e-6, "{}: {error:e}", p.name);
    }
    println!("{:?} after {} steps", e.status, e.iterations);
}
