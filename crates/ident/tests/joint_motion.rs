//! Joint motion through encoders of 20 bits: accelerations against known ones, and what is estimated with them.

use crate::common::estimate;
use crate::common::*;
use excitation::plan::{Extent, Shape};
use excitation::{JointCommand, Manoeuvre, ManoeuvreSpec};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::sim::Channel;
use ff_dynamics::{SensorSuite, Trace, measure};
use ff_mission::Loaded;
use ff_model::Params;
use ff_records::{Record, RecordBuilder};
use ff_testkit::assert_within;
use ident::motion::{SpectralFit, Stake};
use ident::motion::{motion_at_stake, spectral_motion};
use ident::parameters::offset_start;
use ident::parameters::select;
use ident::*;

const NOISE: Noise = Noise { torque: 0.1, gyro: 1.5e-4 };

/// The paper's manoeuvre: two joints there and back at full speed, corners in the jerk.
fn bang_bang(l: &Loaded, hold: f64) -> Manoeuvre {
    let command = |joint, frequency| JointCommand {
        joint,
        shape: Shape::Doublet,
        extent: Extent::HalfPeriod { frequency, negative: joint == 1 },
        velocity: 0.17,
        acceleration: 0.15,
    };
    let start = l.mission.reproduce.as_ref().unwrap().hold_rad.clone();
    let commands = vec![command(0, 0.105), command(1, 0.109), command(4, 0.13)];
    Manoeuvre::new(&ManoeuvreSpec { start, commands, ramp: 0.1, lead: 1.0, hold, grid: Some(0.01) }).unwrap()
}

/// What sensors read; without noise, exact positions.
fn sensed(l: &Loaded, t: &Trace, seed: Option<u64>, rates: bool) -> Record {
    let white = |noise_std| Channel { noise_std, ..Channel::default() };
    let sensors = SensorSuite { torque: white(NOISE.torque), gyro: white(NOISE.gyro), encoder: Channel::encoder(20) };
    let b = RecordBuilder::new(l.model.joint_names()).uniform(0.0, 1.0 / t.dt).allow("Data::Stuck");
    let b = if rates { b.qd(t.qd.clone()) } else { b };
    let b = match seed {
        None => b.q(t.q.clone()).tau(t.tau.clone()).gyro(t.gyro()),
        Some(seed) => {
            let r = measure(t, &sensors, seed);
            b.q(r.q).tau(r.tau).gyro(r.gyro)
        }
    };
    b.build().unwrap().0
}

/// Rms error of the accelerations, two seconds off the ends, worst joint (rad/s^2).
fn error(fit: &SpectralFit, truth: &dyn JointMotion) -> f64 {
    let n = truth.dof();
    let (mut q, mut qd) = (vec![0.0; n], vec![0.0; n]);
    let (mut a, mut b, mut sum) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let from = 200;
    let to = (100.0 * fit.fit.motion.duration()) as usize - 200;
    for i in from..to {
        let t = 0.01 * i as f64 + 0.003;
        fit.fit.motion.eval(t, &mut q, &mut qd, &mut a);
        truth.eval(t, &mut q, &mut qd, &mut b);
        (0..n).for_each(|j| sum[j] += (a[j] - b[j]).powi(2));
    }
    sum.iter().map(|s| (s / (to - from) as f64).sqrt()).fold(0.0, f64::max)
}

#[test]
#[ignore = "full tier: 8 s"]
fn accelerations_of_a_plan_are_known_to_less_than_torques_can_tell() {
    let l = paper("slosh.toml");
    let motion = planned(&l, 40.0, 27);
    let t = run(&l, &motion, 40.0);
    // 150 kg m^2 against 0.1 N m.
    let stake =
        Stake { weights: vec![1500.0; l.model.nj()], rates: Vec::new(), free: 0.14, kinks: false, corners: Vec::new() };
    let exact = motion_at_stake(&sensed(&l, &t, None, false), &stake, false).unwrap();
    assert_within!(error(&exact, &motion), 1e-6, "{:e} at {}", error(&exact, &motion), exact.fit.spacing);
    let read = sensed(&l, &t, Some(3), false);
    let fit = motion_at_stake(&read, &stake, false).unwrap();
    let (e, expected) = (error(&fit, &motion), fit.acceleration_noise(0, fit.fit.spacing));
    eprintln!("spacing {:.3} s: error {e:.1e}, noise {expected:.1e}, {:?}", fit.fit.spacing, fit.reason);
    // Noise and nothing else, and a fiftieth of the variance of the torque sensors.
    assert!(e < 1.4 * expected && 1500.0 * e < 0.25, "{e:e} {expected:e}");
    // Without anything at stake noise and bias are weighed against each other.
    let plain = spectral_motion(&read).unwrap();
    assert!(error(&plain, &motion) < 2.0 * e && plain.fit.spacing >= fit.fit.spacing);
}

#[test]
#[ignore = "full tier: 2 s"]
fn rates_that_are_not_those_of_the_positions_are_left_out() {
    let l = paper("slosh.toml");
    let motion = planned(&l, 30.0, 14);
    let t = run(&l, &motion, 30.0);
    let scaled = Trace { qd: &t.qd * 1.01, ..t.clone() };
    let fit = spectral_motion(&sensed(&l, &scaled, Some(5), true)).unwrap();
    assert_eq!(fit.rate_weight, 0.0);
    assert_eq!(fit.fit.spacing, spectral_motion(&sensed(&l, &t, Some(5), false)).unwrap().fit.spacing);
}

/// `ffid identify` gave a chi-squared of 8 here, and no converged fit (exit 14): the accelerations rang at every corner.
#[test]
fn a_bang_bang_manoeuvre_is_identified_from_encoders() {
    let l = paper("slosh.toml");
    let motion = bang_bang(&l, 40.0);
    let t = run(&l, &motion, motion.duration());
    let record = sensed(&l, &t, Some(1), false);
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = select(&decls, &["base.*", "tank.*"]).unwrap();
    let start = offset_start(&decls, &truth, &selected, 0.1, 2);
    let mut oe = OutputError::new(&l.model, &record, &Options::new(NOISE)).unwrap();
    let e = estimate(&Request { prior_width: Some(0.3), ..Request::new(&decls, &selected, &start) }, &mut oe).unwrap();
    eprintln!("{:?}, chi-squared {:.3}", e.status, e.chi2_per_dof);
    assert!(e.status.is_converged(), "{:?}", e.status);
    assert!((0.9..1.1).contains(&e.chi2_per_dof), "{}", e.chi2_per_dof);
    for p in &e.parameters {
        let want = truth[decls.iter().position(|d| d.name == p.name).unwrap()];
        assert!((p.value - want).abs() < 5.0 * p.std.unwrap(), "{}: {} for {want} +- {:?}", p.name, p.value, p.std);
    }
}
