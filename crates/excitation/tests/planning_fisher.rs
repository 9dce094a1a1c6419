//! A plan for the real system: better than its warm start and than multisine-like random plans, within the limits.

use crate::common::{paper, request};
use excitation::objective::{RelativeQuantity, relative_deviations};
use excitation::planning::{FisherRequest, base_quantities, named_quantities};
use excitation::system::flexible::Estimated;
use excitation::system::flexible::{FlexibleError, FlexibleRequest, Nuisance};
use excitation::system::rigid::RigidError;
use excitation::*;
use ff_model::Params;

fn flexible(step: f64) -> FlexibleRequest {
    let loaded = paper("flex.toml");
    let hinges = loaded.estimated.iter().filter(|&&i| i >= 10);
    FlexibleRequest {
        named: (0..10).map(|index| Estimated { index, prior: None }).collect(),
        others: hinges.map(|&index| Estimated { index, prior: Some(10.0) }).collect(),
        noise: SensorNoise { torque: 0.1, gyro: Some(1.5e-4), rate: 100.0 },
        accelerometer: None,
        nuisance: Nuisance { gyro_bias: Some(1e-4), deflection: Some(1e-3), ..Nuisance::default() },
        step,
    }
}

#[test]
#[ignore = "full tier: 4 s"]
fn refined_on_the_real_system() {
    let loaded = paper("flex.toml");
    let params = Params::nominal(&loaded.model);
    let information = FlexibleInformation::new(&loaded.model, &params, &flexible(0.25)).unwrap();
    let quantities = base_quantities(&information).unwrap();
    let criterion = Criterion::Largest { quantities: quantities.clone(), power: 8.0 };
    let rigid = request(&loaded, 1);
    let fisher = FisherRequest {
        start: rigid.start.clone(),
        end: End::Free,
        limits: rigid.limits.clone(),
        duration: Duration::Fixed(30.0),
        control_points: 6,
        seed: 1,
        starts: 2,
        refined: 2,
        threads: 2,
        warm: SqpOptions { iterations: 20, ..SqpOptions::default() },
        options: SqpOptions { iterations: 8, ..SqpOptions::default() },
    };
    let plan = |threads| {
        let request = FisherRequest { threads, ..fisher.clone() };
        plan_fisher(&loaded.model, &params, &information, &criterion, rigid.noise, &request).unwrap()
    };
    let p = plan(2);
    assert!(p.limits.holds && check_for_all_time(&p.motion, &fisher.limits, 4).unwrap().holds);
    assert_eq!(p.rated.len(), 4);
    assert!(p.rated.is_sorted() && p.outcome.cost < p.outcome.start_cost - 0.05);
    // The cost is the smoothed logarithm of what is reported.
    let worst = relative_deviations(&p.information, &quantities).into_iter().fold(0.0, f64::max);
    eprintln!("largest {:.3} %, costs {:?} -> {}", 100.0 * worst, p.rated, p.outcome.cost);
    assert!((0.0..3f64.ln() / 16.0 + 1e-9).contains(&(p.outcome.cost - worst.ln())));
    // Random plans end far above.
    let random = p.rated.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(p.outcome.cost < random - 0.5);
    // Threads change nothing.
    assert_eq!(p.x, plan(1).x);
}

#[test]
fn quantities_are_relative_to_their_own_size() {
    let loaded = paper("flex.toml");
    let params = Params::nominal(&loaded.model);
    let information = FlexibleInformation::new(&loaded.model, &params, &flexible(0.5)).unwrap();
    let q = base_quantities(&information).unwrap();
    assert_eq!(q.iter().map(|q| q.rows.nrows()).collect::<Vec<_>>(), [1, 3, 6]);
    // A mass of one percent more, centre of mass and inertia about it unchanged.
    let (values, sizes) = (information.values(), information.sizes());
    let body = ff_model::Inertia::from_params(values);
    let (c, i) = (body.com().unwrap(), body.about_com());
    let change = |m: f64, c: &nalgebra::Vector3<f64>, i: &nalgebra::Matrix3<f64>| {
        let to = ff_model::Inertia::from_com(m, c, i).to_params();
        nalgebra::DVector::from_fn(10, |k, _| (to[k] - values[k]) / sizes[k])
    };
    let size = |q: &RelativeQuantity, d: &nalgebra::DVector<f64>| (&q.rows * d).norm();
    let m = change(values[0] * (1.0 + 1e-5), &c, &i);
    assert!((size(&q[0], &m) / 1e-5 - 1.0).abs() < 1e-3 && size(&q[1], &m) < 1e-9 && size(&q[2], &m) < 1e-8);
    let d = nalgebra::Vector3::new(0.36, -0.48, 0.8) * (c.norm() * 1e-5);
    let m = change(values[0], &(c + d), &i);
    assert!(size(&q[0], &m) < 1e-12 && (size(&q[1], &m) / 1e-5 - 1.0).abs() < 1e-3 && size(&q[2], &m) < 1e-8);
    let d = nalgebra::Matrix3::new(0.4, 0.3, -0.2, 0.3, 0.5, 0.1, -0.2, 0.1, -0.7);
    let m = change(values[0], &c, &(i + d * (1e-5 * i.norm() / d.norm())));
    assert!(size(&q[0], &m) < 1e-12 && size(&q[1], &m) < 1e-9 && (size(&q[2], &m) / 1e-5 - 1.0).abs() < 1e-3);
    let named = named_quantities(&information);
    assert!(named.len() == 10 && (named[0].rows[(0, 0)] - 1.0).abs() < 1e-12);
    // Without all ten there is no centre of mass.
    let some = FlexibleRequest { named: vec![Estimated { index: 0, prior: None }], ..flexible(0.5) };
    assert!(base_quantities(&FlexibleInformation::new(&loaded.model, &params, &some).unwrap()).is_none());
}

#[test]
fn impossible_requests_are_named() {
    let loaded = paper("flex.toml");
    let params = Params::nominal(&loaded.model);
    let new = |r: &FlexibleRequest| FlexibleInformation::new(&loaded.model, &params, r).map(|_| ()).unwrap_err();
    let good = flexible(0.5);
    let with = |index, prior| FlexibleRequest { named: vec![Estimated { index, prior }], ..good.clone() };
    let all = loaded.model.n_params();
    let absent = new(&with(9999, None));
    assert!(matches!(absent, FlexibleError::Parameter { index: 9999, count, .. } if count == all), "{absent}");
    let twice = new(&FlexibleRequest { others: good.named.clone(), ..good.clone() });
    let first = good.named[0].index;
    assert!(matches!(twice, FlexibleError::Parameter { index, .. } if index == first), "{twice}");
    assert!(matches!(new(&with(0, Some(-1.0))), FlexibleError::Value { what: "prior of a parameter", .. }));
    assert!(matches!(new(&FlexibleRequest { step: 0.0, ..good.clone() }), FlexibleError::Value { .. }));
    assert!(matches!(
        new(&FlexibleRequest { named: vec![], ..good.clone() }),
        FlexibleError::Rigid(RigidError::Selection)
    ));
    let silent = SensorNoise { torque: f64::NAN, ..good.noise };
    assert!(matches!(
        new(&FlexibleRequest { noise: silent, ..good.clone() }),
        FlexibleError::Rigid(RigidError::Noise { .. })
    ));
    let fixed = loaded.model.clone().with_base_kind(ff_model::BaseKind::Fixed);
    let e = FlexibleInformation::new(&fixed, &params, &good).map(|_| ()).unwrap_err();
    assert_eq!(e, FlexibleError::Rigid(RigidError::NotFreeFloating));
}
