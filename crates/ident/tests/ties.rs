//! Ties in whole fits: one stiffness for all hinges, and the fuel of a tank from what has been consumed.

use crate::common::estimate;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::sim::Channel;
use ff_dynamics::{Drive, SensorSuite, SimOptions, State, measure, simulate};
use ff_least_squares::{EvalError, Settings};
use ff_model::spatial::so3::rot_of_rpy;
use ff_model::tree::JointLimits;
use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, ParamDecl, Params, Xform};
use ff_records::{Record, RecordBuilder};
use ff_testkit::assert_within;
use flex_panel::{PanelChain, Segment};
use ident::Posterior;
use ident::compose::{Affine, TieMap};
use ident::*;
use ident::{Tie, Tied};
use nalgebra::{DMatrix, Matrix3, Vector3};
use slosh_pendulum::geometry::Tank;

/// The robot of the speed comparison with the peers.
fn robot() -> Model {
    let length = 3.0 / 7.0;
    let base = Inertia::from_com(600.0, &Vector3::new(0.9, 0.0, 0.6), &Matrix3::from_diagonal_element(150.0));
    let mut model = Model::new("peers", "base", base, BaseKind::Floating);
    let link = Inertia::from_com(
        60.0 / 7.0,
        &Vector3::new(0.0, length / 2.0, 0.0),
        &Matrix3::from_diagonal(&Vector3::new(0.4, 0.04, 0.4)),
    );
    let mut parent = 0;
    for i in 1..=7 {
        let axis = if i % 2 == 1 { Vector3::y() } else { Vector3::z() };
        let placement = if i == 1 {
            Xform::new(rot_of_rpy(&Vector3::new(std::f64::consts::FRAC_PI_2, 0.0, 0.0)), Vector3::new(0.4, 0.0, 1.2))
        } else {
            Xform::new(Matrix3::identity(), Vector3::new(0.0, length, 0.0))
        };
        let joint = Joint {
            name: format!("arm_j{i}"),
            kind: JointKind::Revolute,
            axis,
            placement,
            limits: JointLimits::default(),
        };
        parent = model.add_body(parent, format!("arm_l{i}"), joint, link);
    }
    for (wing, x, side) in [("panel_a", 1.8, 1.0), ("panel_b", 0.0, -1.0)] {
        let segment = |x: f64| Segment {
            inertia: Inertia::from_com(
                33.0,
                &Vector3::new(side, 0.0, 0.0),
                &Matrix3::from_diagonal(&Vector3::new(15.0, 11.0, 15.0)),
            ),
            hinge: Vector3::new(x, 0.0, 0.0),
            axis: Vector3::y(),
            stiffness: 200.0,
            damping: 2.0,
            rest: 0.0,
        };
        let chain = PanelChain::new(vec![segment(0.0), segment(2.0 * side)]).unwrap();
        model.mount(wing, 0, Xform::new(Matrix3::identity(), Vector3::new(x, 0.0, 0.6)), chain).unwrap();
    }
    model
}

/// The peers' manoeuvre.
struct Manoeuvre(f64);
impl JointMotion for Manoeuvre {
    fn dof(&self) -> usize {
        7
    }
    fn duration(&self) -> f64 {
        self.0
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        const START: [f64; 7] = [0.0, 0.6, 0.0, -1.2, 0.0, 0.8, 0.0];
        const A: [f64; 7] = [0.4, 0.5, -0.3, -0.6, 0.35, 0.45, -0.5];
        const F: [f64; 7] = [0.05, 0.11, 0.07, 0.09, 0.06, 0.13, 0.10];
        const B: [f64; 7] = [0.03, 0.04, -0.03, 0.05, 0.02, -0.04, 0.05];
        const G: [f64; 7] = [0.45, 0.68, 0.5, 0.72, 0.6, 0.8, 0.55];
        for j in 0..7 {
            let (w, u) = (std::f64::consts::TAU * F[j], std::f64::consts::TAU * G[j]);
            q[j] = START[j] + A[j] * (1.0 - (w * t).cos()) + B[j] * (1.0 - (u * t).cos());
            qd[j] = A[j] * w * (w * t).sin() + B[j] * u * (u * t).sin();
            qdd[j] = A[j] * w * w * (w * t).cos() + B[j] * u * u * (u * t).cos();
        }
    }
}

#[test]
fn fifteen_unknowns_of_the_peers_comparison_come_back() {
    let model = robot();
    let o = SimOptions { duration_s: 30.0, step_s: 1e-3, sample_s: 0.01 };
    let t = simulate(&model, &Params::nominal(&model), &State::zero(&model), &Drive::Prescribed(&Manoeuvre(30.0)), &o)
        .unwrap();
    let r =
        RecordBuilder::new(model.joint_names()).uniform(0.0, 100.0).q(t.q.clone()).qd(t.qd.clone()).qdd(t.qdd.clone());
    let r = r.tau(t.tau.clone()).gyro(t.gyro()).build().unwrap().0;
    let decls = model.param_decls();
    let nominal = Params::<f64>::nominal(&model).values().to_vec();
    let tie = |name: &str, members: &[(&str, f64)]| {
        Box::new(Affine::factors(&decls, &nominal, name, members).unwrap()) as Box<dyn Tie>
    };
    let map = || {
        TieMap::new(
            &decls,
            &nominal,
            vec![
                tie("panel.mass", &[("panel_*.seg[*].mass", 1.0)]),
                tie("panel.h_x", &[("panel_a.seg[*].h_x", 1.0), ("panel_b.seg[*].h_x", -1.0)]),
                tie("panel.i_yy", &[("panel_*.seg[*].i_yy", 1.0)]),
                tie("panel.k", &[("panel_*.k[*]", 1.0)]),
                tie("panel.d", &[("panel_*.d[*]", 1.0)]),
            ],
        )
        .unwrap()
    };
    let short = map().decls().to_vec();
    let truth = map().start();
    let selected: Vec<usize> = (0..10).chain(short.len() - 5..short.len()).collect();
    let scale = [600.0, 540.0, 100.0, 360.0, 366.0, 100.0, 852.0, 324.0, 100.0, 636.0, 33.0, 33.0, 44.0, 200.0, 2.0];
    let factor = [-0.1, 0.1, 0.0, -0.07, -0.15, 0.0, 0.15, -0.1, 0.0, -0.12, 0.15, -0.1, 0.1, -0.3, 0.5];
    let shift = |k: usize| [(2, 0.05), (5, 0.05), (8, -0.05)].iter().find(|s| s.0 == k).map_or(0.0, |s| s.1);
    for start in [0.1, 0.3] {
        let mut values = truth.clone();
        for (k, &i) in selected.iter().enumerate() {
            values[i] = truth[i] * (1.0 + start * factor[k]) + start * shift(k) * scale[k];
        }
        let oe =
            OutputError::new(&model, &r, &Options { substeps: 1, ..Options::new(Noise { torque: 0.1, gyro: 1e-4 }) })
                .unwrap();
        let settings = Settings { decrement_tolerance: 1e-8, max_iterations: 40, ..Settings::default() };
        let request = Request { settings, ..Request::new(&short, &selected, &values) };
        let e = estimate(&request, &mut Tied::new(oe, map()).unchecked()).unwrap();
        let errors: Vec<f64> = selected.iter().enumerate().map(|(k, &i)| (e.values[i] - truth[i]) / scale[k]).collect();
        println!(
            "start {start}: {:?} after {}, chi2 {:.2e}, rank {}, condition {:.1e}, errors {errors:.2?}",
            e.status, e.iterations, e.chi2_per_dof, e.data_only.rank, e.data_only.condition
        );
        // A step of 10 ms against the truth at 1 ms is all that is left.
        assert!(e.status.is_converged() && errors.iter().all(|e| e.abs() < 2.6e-7));
        let full = map().expand(&e.values).unwrap();
        assert_eq!(map().inconsistent(&full), None);
        let of = |n: &str| full[decls.iter().position(|d| d.name == n).unwrap()];
        assert_eq!(of("panel_a.seg[1].h_x"), -of("panel_b.seg[0].h_x"));
        assert_eq!(of("panel_a.k[0]"), of("panel_b.k[1]"));
    }
}

/// What has been consumed of the fuel decides base, slosh mass, length, stiffness and damping together.
struct Fuel {
    unknowns: Vec<ParamDecl>,
    parameters: Vec<usize>,
    dry: Inertia<f64>,
}
impl Fuel {
    const FULL: f64 = 320.0;
    const DENSITY: f64 = 1010.0;
    const SETTLING: f64 = 0.05;
    fn all(&self, consumed: f64) -> Result<Vec<f64>, EvalError> {
        let radius: f64 = 0.45;
        let fill = (Self::FULL - consumed) / (Self::DENSITY * std::f64::consts::PI * radius * radius);
        let tank = Tank::Cylinder { radius, fill };
        let m = tank.model(Self::DENSITY, 1).map_err(|p| EvalError::Rejected(p.to_string()))?;
        let (slosh, bottom) = (m.modes[0], Vector3::new(0.9, 0.0, -0.3));
        let mut base = self.dry;
        base += Inertia::point(m.fixed_mass, &(bottom + Vector3::z() * m.fixed_height));
        let k = slosh.mass * Self::SETTLING * slosh.length;
        let d = 2.0 * 0.02 * k / slosh.omega(Self::SETTLING);
        Ok([&base.to_params()[..], &[slosh.mass, slosh.length, k, k, d, d]].concat())
    }
}
impl Tie for Fuel {
    fn unknowns(&self) -> &[ParamDecl] {
        &self.unknowns
    }
    fn parameters(&self) -> &[usize] {
        &self.parameters
    }
    fn evaluate(&self, u: &[f64], p: &mut [f64]) -> Result<(), EvalError> {
        p.copy_from_slice(&self.all(u[0])?);
        Ok(())
    }
    /// Differences: this is a test, and the geometry has no derivative of its own.
    fn derivative(&self, u: &[f64], d: &mut DMatrix<f64>) -> Result<(), EvalError> {
        let (up, down) = (self.all(u[0] + 1e-3)?, self.all(u[0] - 1e-3)?);
        (0..up.len()).for_each(|i| d[(i, 0)] = (up[i] - down[i]) / 2e-3);
        Ok(())
    }
}

#[test]
fn the_filling_level_is_tracked_by_one_unknown_and_the_posterior_goes_on() {
    let l = ff_testkit::fixtures::paper("slosh.toml");
    let decls = l.model.param_decls();
    let nominal = Params::<f64>::nominal(&l.model).values().to_vec();
    let place = |n: &str| decls.iter().position(|d| d.name == n).unwrap();
    let tank = ["tank.mass", "tank.length", "tank.k[0]", "tank.k[1]", "tank.d[0]", "tank.d[1]"];
    let parameters: Vec<usize> = (0..10).chain(tank.map(place)).collect();
    let fuel = |start: f64| Fuel {
        unknowns: vec![ParamDecl::positive("consumed", "kg", start)],
        parameters: parameters.clone(),
        dry: Inertia::from_params(&nominal[..10]),
    };
    let noise = Noise { torque: 0.1, gyro: 1.5e-4 };
    let fly = |consumed: f64, seed: u64, noisy: bool| {
        let mut values = nominal.clone();
        parameters.iter().zip(fuel(0.0).all(consumed).unwrap()).for_each(|(&i, v)| values[i] = v);
        let params = Params::from_values(&l.model, values);
        let mut start = State::zero(&l.model);
        start.eta.copy_from_slice(&l.model.rest_position(&params));
        let motion = ff_testkit::motion::Sines::new(seed, 7, 20.0, 0.2);
        let o = SimOptions { duration_s: 20.0, step_s: 1e-2, sample_s: 0.01 };
        let t = simulate(&l.model, &params, &start, &Drive::Prescribed(&motion), &o).unwrap();
        let white = |noise_std| Channel { noise_std: if noisy { noise_std } else { 0.0 }, ..Channel::default() };
        let s = SensorSuite { torque: white(noise.torque), gyro: white(noise.gyro), ..SensorSuite::default() };
        let read = measure(&t, &s, seed);
        let b = RecordBuilder::new(l.model.joint_names()).uniform(0.0, 100.0).q(t.q).qd(t.qd).qdd(t.qdd);
        b.tau(read.tau).gyro(read.gyro).build().unwrap().0
    };
    let fit = |r: &Record, start: f64| {
        let map = TieMap::new(&decls, &nominal, vec![Box::new(fuel(start))]).unwrap();
        let (short, values) = (map.decls().to_vec(), map.start());
        let consumed = [short.len() - 1];
        let oe = OutputError::new(&l.model, r, &Options { substeps: 1, ..Options::new(noise) }).unwrap();
        let settings = Settings { cost_floor: 1e-13, ..Settings::default() };
        let request = Request { settings, ..Request::new(&short, &consumed, &values) };
        estimate(&request, &mut Tied::new(oe, map)).unwrap()
    };
    let exact = fit(&fly(85.0, 3, false), 40.0);
    println!("{:?} {:?}", exact.status, exact.parameters);
    assert_within!((exact.parameters[0].value - 85.0).abs(), 1e-5, "{:?}", exact.parameters[0]);
    // Two records in sequence: the posterior of the first, loosened by what may have been burnt, and the second.
    let (first, second) = (fit(&fly(85.0, 4, true), 60.0), fit(&fly(87.0, 5, true), 60.0));
    let posterior = Posterior::of(&first).unwrap().loosen(&["consumed"], 5.0).unwrap();
    let (a, b) = (posterior.covariance().unwrap().unwrap()[(0, 0)], second.parameters[0].std.unwrap().powi(2));
    let before = first.parameters[0].std.unwrap();
    assert_within!((a - 25.0 - before * before).abs(), 1e-9 * a);
    println!(
        "consumed {} +- {before:.3}, then {} +- {:.3}",
        first.parameters[0].value,
        second.parameters[0].value,
        b.sqrt()
    );
    for (e, t) in [(&first, 85.0), (&second, 87.0)] {
        let p = &e.parameters[0];
        assert!((p.value - t).abs() < 4.0 * p.std.unwrap() && p.std.unwrap() < 3.0, "{p:?}");
    }
}
