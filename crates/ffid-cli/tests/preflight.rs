//! The verdict against what happens: noise drawn many times, fits made, other programs' way of computing the same.

use crate::common::fixture;
use excitation::{Duration, End, PlanSpec, SplinePlan, check_for_all_time, random_plan};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::BSplineMotion;
use ff_dynamics::sim::Channel;
use ff_dynamics::{SensorSuite, measure};
use ff_least_squares::Settings;
use ff_model::Params;
use ff_records::RecordBuilder;
use ffid::open::{Opened, open};
use ffid::workflow::preflight::{Determination, Preflight, Proof, Question, Seen, Sensing, joint_limits, judge};
use ident::estimate::Estimate;
use ident::parameters::select;
use ident::{Noise, Options, OutputError, Rda, Request, estimate};

fn paper(name: &str) -> Opened {
    let path = fixture("paper").join(name);
    open(&path, Default::default()).unwrap()
}

/// A random feasible trajectory from the hold pose.
fn random(o: &Opened, duration: f64, free: usize, seed: u64) -> BSplineMotion {
    let limits = joint_limits(&o.model, &o.mission.as_ref().unwrap().limits);
    let (start, end, duration) = (o.pose(), End::Free, Duration::Fixed(duration));
    let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free, limits, refine: 2 }).unwrap();
    plan.motion(&random_plan(&plan, seed, 1, 1.0).unwrap()).unwrap()
}

fn ask(o: &Opened, motion: &dyn JointMotion, patterns: &[&str], rate_hz: f64) -> Preflight {
    let mission = o.mission.as_ref().unwrap();
    let selected = select(&o.model.param_decls(), patterns).unwrap();
    judge(&Question {
        model: &o.model,
        params: &Params::nominal(&o.model),
        selected: &selected,
        motion,
        sensing: Sensing { rate_hz, ..Sensing::of(&mission.sensors) },
        weak: 0.1,
        proven: None,
        limits: &mission.limits,
        constraints: &[],
        end_effector: o.end_effector,
        uncertain: None,
        small: None,
    })
    .unwrap()
}

/// A fit of a noisy record of the simulated trajectory, biases and initial state beside the parameters.
fn fit(o: &Opened, v: &Preflight, patterns: &[&str], seed: u64) -> Estimate {
    let (model, params, decls) = (&o.model, Params::nominal(&o.model), o.model.param_decls());
    let t = &v.trace;
    let channel = |noise_std| Channel { noise_std, bias: 0.0, quantum: 0.0 };
    let suite = SensorSuite {
        torque: channel(v.sensing.torque_nm),
        gyro: channel(v.sensing.gyro_rad_per_s),
        encoder: channel(0.0),
    };
    let r = measure(t, &suite, seed);
    let record = RecordBuilder::new(model.joint_names()).uniform(0.0, 1.0 / t.dt).q(r.q).tau(r.tau).gyro(r.gyro);
    let record = record.qd(t.qd.clone()).qdd(t.qdd.clone()).build().unwrap().0;
    let noise = Noise { torque: v.sensing.torque_nm, gyro: v.sensing.gyro_rad_per_s };
    let options =
        Options { substeps: 8, gyro_bias: true, torque_bias: true, initial_state: true, ..Options::new(noise) };
    let selected = select(&decls, patterns).unwrap();
    let request = Request {
        // A thousandth of a standard deviation: the last digits of flat valleys say nothing here.
        settings: Settings { decrement_tolerance: 1e-9, ..Settings::default() },
        ..Request::new(&decls, &selected, params.values())
    };
    estimate(&request, &mut OutputError::new(model, &record, &options).unwrap()).unwrap()
}

/// The paper's two systems: what is predicted is what a fit of a noisy record reports.
///
/// Thrice as fast as the limits allow, so that the panels ring, and with 3 % of the noise. (Where the record tells little of
/// the springs, the fit's estimate of the initial ringing, which is not there, makes it believe that it knows them better.)
#[test]
fn predicted_deviations_are_those_a_fit_reports() {
    for (file, patterns, seed) in
        [("flex.toml", ["base.*", "panel_*.k[*]"].as_slice(), 5), ("slosh.toml", &["base.*", "tank.*"], 6)]
    {
        let mut o = paper(file);
        let sensors = &mut o.mission.as_mut().unwrap().sensors;
        sensors.torque.noise_std_nm *= 0.03;
        sensors.gyro.noise_std_rad_per_s *= 0.03;
        let motion = random(&o, 60.0, 16, seed).with_duration(20.0).unwrap();
        let v = ask(&o, &motion, patterns, 50.0);
        let e = fit(&o, &v, patterns, 7);
        assert!(e.status.is_converged(), "{:?}", e.status);
        assert_eq!(e.parameters.len(), v.parameters.len());
        let mut worst: f64 = 0.0;
        for (p, q) in v.parameters.iter().chain(&v.nuisance).zip(e.parameters.iter().chain(&e.nuisance)) {
            assert_eq!(p.name, q.name);
            let ratio = p.std.unwrap() / q.std.unwrap();
            eprintln!("{file} {:24} predicted {:.3e}, fit {:.3e}", p.name, p.std.unwrap(), q.std.unwrap());
            worst = worst.max((ratio - 1.0).abs());
        }
        eprintln!("{file}: {worst}");
        assert!(worst < 0.05);
    }
}

/// The errors of many fits spread as predicted: no shared code decides this one.
#[test]
#[ignore = "full tier: 8 s"]
fn predicted_deviations_are_the_spread_of_many_fits() {
    let o = paper("slosh.toml");
    let patterns = ["base.mass", "base.i_*", "tank.*"];
    let v = ask(&o, &random(&o, 30.0, 8, 3), &patterns, 10.0);
    let runs = 40;
    let mut sums = vec![0.0; v.parameters.len()];
    for seed in 0..runs {
        let e = fit(&o, &v, &patterns, 100 + seed);
        assert!(e.status.is_converged());
        for (s, (p, q)) in sums.iter_mut().zip(v.parameters.iter().zip(&e.parameters)) {
            *s += ((q.value - p.value) / p.std.unwrap()).powi(2);
        }
    }
    for (s, p) in sums.iter().zip(&v.parameters) {
        let spread = (s / runs as f64).sqrt();
        eprintln!("{:12} spread {spread:.3} of predicted {:.3e}", p.name, p.std.unwrap());
        // Root of chi^2 / 40: 0.67 .. 1.37 holds 99.8 % of it.
        assert!((0.67..1.37).contains(&spread), "{}: {spread}", p.name);
    }
}

/// Centre of mass and inertia about it follow the same spread.
#[test]
#[ignore = "full tier: 2 s"]
fn derived_deviations_are_the_spread_of_derived_values() {
    let o = paper("slosh.toml");
    let patterns = ["base.*"];
    let v = ask(&o, &random(&o, 30.0, 8, 3), &patterns, 10.0);
    assert_eq!(v.derived.len(), 9);
    let runs = 30;
    let mut sums = [0.0; 9];
    for seed in 0..runs {
        let e = fit(&o, &v, &patterns, 300 + seed);
        let b = ff_model::Inertia::<f64>::from_params(&e.values[..10]);
        let (c, i) = (b.com().unwrap(), b.about_com());
        let y = [c.x, c.y, c.z, i[(0, 0)], i[(0, 1)], i[(1, 1)], i[(0, 2)], i[(1, 2)], i[(2, 2)]];
        for ((s, d), y) in sums.iter_mut().zip(&v.derived).zip(y) {
            *s += ((y - d.value) / d.std.unwrap()).powi(2);
        }
    }
    for (s, d) in sums.iter().zip(&v.derived) {
        let spread = (s / f64::from(runs as u32)).sqrt();
        assert!((0.62..1.42).contains(&spread), "{}: {spread}", d.name);
    }
}

/// All inertias of the panels free: three combinations per hinge cannot be told (theory notes, section 7), and are named.
#[test]
fn what_cannot_be_told_is_named() {
    let o = paper("flex.toml");
    let v = ask(&o, &random(&o, 60.0, 16, 5), &["base.*", "panel_*"], 20.0);
    assert_eq!((v.parameters.len(), v.null_directions.len()), (58, 12));
    assert_eq!(v.unknowns - v.rank, 12);
    for d in &v.null_directions {
        assert!(d.terms.iter().any(|(n, _)| n.starts_with("panel_")), "{d}");
    }
    let silent: Vec<&str> =
        v.parameters.iter().filter(|p| p.told == Determination::NotAtAll).map(|p| p.name.as_str()).collect();
    assert!(silent.contains(&"base.mass") && silent.iter().any(|n| n.starts_with("panel_left.")), "{silent:?}");
    assert!(v.parameters.iter().all(|p| (p.told == Determination::NotAtAll) == p.std.is_none()));
    let text = v.to_string();
    assert!(text.contains("cannot be told") && text.matches("silent on:").count() == 12, "{text}");
    // Springs are told whatever the inertias are.
    assert!(v.parameters.iter().any(|p| p.name == "panel_left.k[0]" && p.std.is_some()), "{text}");
}

/// The symmetric mode at 0.113 Hz: at the paper's pose the base translates with it. A gyro would need it to ring far
/// stronger than torque sensors do, and on a move of the two pitch joints reads nothing of it.
#[test]
fn the_symmetric_mode_is_for_torques_not_for_the_gyro() {
    let o = paper("flex.toml");
    let v = ask(&o, &random(&o, 60.0, 16, 5), &["base.mass"], 100.0);
    let m = &v.modes[0];
    assert!((m.frequency_hz - 0.1126).abs() < 1e-4);
    let needed = |r: &ffid::workflow::preflight::Reading| r.ringing_at_noise.unwrap_or(f64::INFINITY);
    let (torque, gyro) = (needed(&m.torque), needed(&m.gyro));
    eprintln!("symmetric: torque sees {torque:.3e} rad, gyro {gyro:.3e} rad; {m:?}");
    // Measured: 0.023 and 0.175 rad.
    assert!(torque < 0.03 && gyro > 5.0 * torque);
    // The antisymmetric one is the gyro's.
    let a = &v.modes[1];
    assert!(needed(&a.gyro) < 0.1 * needed(&a.torque) && a.gyro.seen == Seen::Plainly, "{a:?}");
}

/// The linearised bias is that of a fit, where it is small enough for a linear answer.
#[test]
fn the_rigid_bias_is_that_of_a_rigid_fit() {
    let o = paper("flex.toml");
    // Slow: the panels follow almost rigidly.
    let motion = random(&o, 60.0, 3, 2).with_duration(240.0).unwrap();
    let v = ask(&o, &motion, &["base.*"], 10.0);
    let b = v.rigid_bias.as_ref().unwrap();
    let t = &v.trace;
    let record = RecordBuilder::new(o.model.joint_names()).uniform(0.0, 1.0 / t.dt).allow("Data::Stuck");
    let record = record.q(t.q.clone()).qd(t.qd.clone()).qdd(t.qdd.clone()).tau(t.tau.clone()).gyro(t.gyro());
    let record = record.build().unwrap().0;
    let rigid = o.model.frozen(&Params::nominal(&o.model));
    let (decls, params) = (rigid.param_decls(), Params::nominal(&rigid));
    let selected: Vec<usize> = (0..10).collect();
    let noise = Noise { torque: v.sensing.torque_nm, gyro: v.sensing.gyro_rad_per_s };
    let request = Request::new(&decls, &selected, params.values());
    let e = estimate(&request, &mut Rda::new(&rigid, &record, &noise).unwrap()).unwrap();
    assert!(e.status.is_converged());
    let largest = b.parameters.iter().filter_map(|p| p.relative_bias).map(f64::abs).fold(0.0, f64::max);
    assert_eq!(largest, b.worst_relative);
    for (p, q) in b.parameters.iter().zip(&e.parameters) {
        let real = q.value - q.start;
        eprintln!("{:10} linear {:+.4e}, fit {real:+.4e}, std {:.2e}", p.name, p.bias.unwrap(), p.std.unwrap());
        let scale = largest * (p.bias.unwrap() / p.relative_bias.unwrap());
        assert!((p.bias.unwrap() - real).abs() < 0.1 * real.abs() + 0.02 * scale, "{}", p.name);
    }
}

/// Bounds for all time are never inside what samples show, and little outside of it.
#[test]
fn margins_for_all_time_enclose_those_of_samples() {
    let o = paper("slosh.toml");
    let motion = random(&o, 40.0, 6, 9);
    let limits = joint_limits(&o.model, &o.mission.as_ref().unwrap().limits);
    let proven = check_for_all_time(&motion, &limits, 4).unwrap();
    let sampled = ask(&o, &motion, &["base.mass"], 100.0);
    let mission = o.mission.as_ref().unwrap();
    let all_time = judge(&Question {
        model: &o.model,
        params: &Params::nominal(&o.model),
        selected: &[0],
        motion: &motion,
        sensing: Sensing::of(&mission.sensors),
        weak: 0.1,
        proven: Some(&proven),
        limits: &mission.limits,
        constraints: &[],
        end_effector: None,
        uncertain: None,
        small: None,
    })
    .unwrap();
    assert!(sampled.limits_hold && all_time.limits_hold && all_time.limits.len() == 28);
    for a in &all_time.limits {
        assert_eq!(a.proof, Proof::AllTime);
        let b = sampled.limits.iter().find(|b| b.what == a.what && b.item == a.item).unwrap();
        assert_eq!((b.proof, &b.unit, b.limit), (Proof::Samples, &a.unit, a.limit));
        assert!(a.margin <= b.margin + 1e-9 && a.margin > b.margin - 0.15 * a.limit.abs(), "{a:?}\n{b:?}");
    }
}

/// Excursions are those of the trace, and hold together: path, attitude, rate.
#[test]
fn excursions_hold_together() {
    let o = paper("slosh.toml");
    let v = ask(&o, &random(&o, 40.0, 6, 9), &["base.mass"], 50.0);
    let (e, t) = (&v.excursion, &v.trace);
    let n = t.len();
    // The angle cannot grow faster than the base turns; in sum it is bounded by the integral of the rate.
    let rate = |i: usize| t.twist.row(i).columns(3, 3).norm();
    let turned: f64 = (1..n).map(|i| 0.5 * (rate(i) + rate(i - 1)) * t.dt).sum();
    assert!(e.attitude.value > 0.02 && e.attitude.value <= turned, "{} {turned}", e.attitude.value);
    assert!((0..n).all(|i| rate(i) <= e.rate.value));
    // Without a net force the centre of mass stays; the base moves against the arm, by less than the arm's reach.
    assert!(e.displacement.value > 0.01 && e.displacement.value < 3.0);
    assert_eq!((e.torques.len(), e.passive.len()), (7, 2));
    assert!(e.end_effector_speed.as_ref().unwrap().value < 7.0 * 0.17 * 4.0);
    let peak = (0..n).map(|i| t.tau[(i, 2)].abs()).fold(0.0, f64::max);
    assert_eq!(e.torques[2].value, peak);
}
