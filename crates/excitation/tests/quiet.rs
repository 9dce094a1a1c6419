//! Quiet plans on the paper's robot with panels: what the joints do in the band, and what a flexible robot
//! makes of it in truth. Times are printed, not tested: the tests of this file compete for the cores.

use crate::common::{paper, request};
use excitation::objective::SampleInformation;
use excitation::plan::{PlanError, PlanLimit};
use excitation::planning::{InformationRequest, Planned, PlanningError, QuietBand, Quietness};
use excitation::system::flexible_band;
use excitation::system::rigid::RigidError;
use excitation::*;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{Prescribed, Response, Sampling, simulate_reduced};
use ff_model::{Model, Params};
use nalgebra::{DMatrix, DVector};

/// Squared whitened difference between the flexible robot and the frozen one over the record, and the bias it
/// gives a (linearised) rigid fit of the ten base parameters.
fn truth(model: &Model, p: &Planned, noise: &SensorNoise) -> (f64, DVector<f64>) {
    let params = Params::nominal(model);
    let (dt, samples) = (0.1, 601);
    let run = |m: &Model| -> Response {
        let values = Params::nominal(m);
        let table = Prescribed::new(m, &values, &p.motion, &Sampling { samples, sample_s: dt, substeps: 5 }, &[]);
        simulate_reduced(m, &values, &table, &vec![0.0; 6 + 2 * m.np()]).unwrap()
    };
    let (flexible, rigid) = (run(model), run(&model.frozen(&params)));
    let source = RigidInformation::new(model, &params, &(0..10).collect::<Vec<_>>(), *noise).unwrap();
    let (mut chi, mut right, mut normal) = (0.0, DVector::zeros(10), DMatrix::zeros(10, 10));
    let mut y = DMatrix::zeros(10, 10);
    let (mut q, mut qd, mut qdd) = ([0.0; 7], [0.0; 7], [0.0; 7]);
    for i in 0..samples {
        p.motion.eval(dt * i as f64, &mut q, &mut qd, &mut qdd);
        source.rows_at(&q, &qd, &qdd, &mut y);
        let r = DVector::from_fn(10, |j, _| match j {
            0..7 => (flexible.tau[(i, j)] - rigid.tau[(i, j)]) / noise.torque,
            _ => (flexible.twist[(i, j - 4)] - rigid.twist[(i, j - 4)]) / noise.gyro.unwrap(),
        });
        chi += r.norm_squared() * noise.rate * dt;
        right += y.tr_mul(&r);
        normal += y.tr_mul(&y);
    }
    let bias = normal.cholesky().unwrap().solve(&right);
    (chi, bias.component_mul(&DVector::from_column_slice(source.sizes())))
}

#[test]
#[ignore = "full tier: 6 s"]
fn quiet_for_the_modes() {
    let loaded = paper("flex.toml");
    let (model, params) = (&loaded.model, Params::nominal(&loaded.model));
    let all: Vec<usize> = (0..10).collect();
    let request = request(&loaded, 3);
    let loud = plan_information(model, &params, &all, &request).unwrap();
    let quiet = plan_quiet(model, &params, &all, &request, &Quietness::Modes { emphasis: 3.0 }).unwrap();
    let (loud_chi, loud_bias) = truth(model, &loud, &request.noise);
    let (quiet_chi, quiet_bias) = truth(model, &quiet, &request.noise);
    let expected = quiet.quiet.unwrap();
    eprintln!("modes: {:?}, searches {:?}", quiet.status, quiet.searches);
    eprintln!("chi^2: loud {loud_chi:.3e}, quiet {quiet_chi:.3e}; expected of the quiet plan {expected:?}");
    for (k, (l, q)) in loud.predictions.iter().zip(&quiet.predictions).take(10).enumerate() {
        let (before, after) = (loud_bias[k], quiet_bias[k]);
        eprintln!("{:9}  loud {:.2e} bias {before:8.2}   quiet {:.2e} bias {after:8.2}", l.name, l.planned, q.planned);
        // Measured: at most 2.1.
        assert!(q.planned < 3.0 * l.planned && q.planned < 0.5 * q.random);
    }
    assert!(quiet.limits.holds && check_for_all_time(&quiet.motion, &request.limits, 4).unwrap().holds);
    // Measured: 410 times less disturbance, and 4.8 or 40 kg of bias of the base mass instead of 232, depending on
    // the last bits of the products: the quiet search runs into its iteration limit (issue 5 asks for a fifth).
    assert!(quiet_chi < loud_chi / 100.0 && expected.planned < expected.random);
    assert!(quiet_bias[0].abs() < 0.2 * loud_bias[0].abs());
}

#[test]
fn the_disturbance_is_foreseen() {
    let loaded = paper("flex.toml");
    let (model, params) = (&loaded.model, Params::nominal(&loaded.model));
    let all: Vec<usize> = (0..10).collect();
    let request =
        InformationRequest { options: SqpOptions { iterations: 1, ..SqpOptions::default() }, ..request(&loaded, 1) };
    for seed in 1..6 {
        let request = InformationRequest { seed, ..request.clone() };
        let p = plan_quiet(model, &params, &all, &request, &Quietness::Modes { emphasis: 0.0 }).unwrap();
        let (chi, expected) = (truth(model, &p, &request.noise).0, p.quiet.unwrap().planned);
        eprintln!("chi^2 {chi:.3e}, expected {expected:.3e}");
        // Frequencies and coupling are those of the start configuration.
        assert!((0.3..3.0).contains(&(chi / expected)));
    }
}

#[test]
#[ignore = "full tier: 7 s"]
fn quiet_in_a_band() {
    let loaded = paper("flex.toml");
    let (model, params) = (&loaded.model, Params::nominal(&loaded.model));
    let all: Vec<usize> = (0..10).collect();
    let request = request(&loaded, 3);
    let (low, high) = flexible_band(model, &params, &request.start, 0.2).unwrap().unwrap();
    let band = |emphasis| Quietness::Band(QuietBand { low, high, emphasis, weights: vec![1.0; 7] });
    let loud = plan_quiet(model, &params, &all, &request, &band(0.0)).unwrap();
    let quiet = plan_quiet(model, &params, &all, &request, &band(10.0)).unwrap();
    let (a, b) = (loud.quiet.unwrap(), quiet.quiet.unwrap());
    eprintln!(
        "band {low:.3} .. {high:.3} Hz: energy {:.2e} -> {:.2e}, -log det {:.1} -> {:.1}",
        a.planned, b.planned, loud.information_cost, quiet.information_cost
    );
    eprintln!(
        "chi^2: loud {:.2e}, quiet {:.2e}",
        truth(model, &loud, &request.noise).0,
        truth(model, &quiet, &request.noise).0
    );
    assert!(quiet.limits.holds);
    // Measured: 13.9 times less energy for 1.2 of -log det.
    assert!(b.planned < a.planned / 8.0);
    assert!(quiet.information_cost < loud.information_cost + 4.0);
}

#[test]
fn impossible_requests_are_named() {
    let loaded = paper("flex.toml");
    let (model, params) = (&loaded.model, Params::nominal(&loaded.model));
    let good = request(&loaded, 1);
    let quiet = |q: Quietness| plan_quiet(model, &params, &[0], &good, &q).map(|_| ()).unwrap_err();
    let band = |low, high, emphasis, n| Quietness::Band(QuietBand { low, high, emphasis, weights: vec![1.0; n] });
    for bad in [band(0.3, 0.1, 1.0, 7), band(0.1, 0.3, -1.0, 7), band(0.1, 0.3, 1.0, 6), band(f64::NAN, 0.3, 1.0, 7)] {
        assert!(matches!(quiet(bad), PlanningError::Band { .. }));
    }
    assert!(matches!(quiet(Quietness::Modes { emphasis: f64::NAN }), PlanningError::Emphasis(_)));
    let rigid = model.without_appendages();
    let modes = Quietness::Modes { emphasis: 1.0 };
    let e = plan_quiet(&rigid, &Params::nominal(&rigid), &[0], &good, &modes).map(|_| ()).unwrap_err();
    assert_eq!(e.to_string(), "the model has no appendages; plan quietly for a band instead");

    let plan = |r: &InformationRequest| plan_information(model, &params, &[0], r).map(|_| ()).unwrap_err();
    let mut r = good.clone();
    r.start[2] = 9.0;
    assert!(matches!(plan(&r), PlanningError::Plan(PlanError::Infeasible { which: PlanLimit { joint: Some(2), .. } })));
    r = good.clone();
    r.start.pop();
    assert!(matches!(plan(&r), PlanningError::Plan(PlanError::Argument { .. })));
    r = InformationRequest { starts: 0, ..good.clone() };
    assert!(matches!(plan(&r), PlanningError::Plan(PlanError::Argument { what: "starts", .. })));
    r = InformationRequest { duration: f64::NAN, ..good.clone() };
    assert!(matches!(plan(&r), PlanningError::Plan(PlanError::Spline(_))));
    let e = plan_information(model, &params, &[0, 85], &good).map(|_| ()).unwrap_err();
    assert!(matches!(e, PlanningError::Rigid(RigidError::NotBase { name }) if name.starts_with("panel_left")));
}
