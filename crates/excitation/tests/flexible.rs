//! Information of the real system: the matrix against the sensitivities of the dynamics crate, the gradient against
//! central differences, on panels, fuel, a payload with parameters of its own, and a structure known by its modes.

use crate::common::{numbers, paper};
use excitation::objective::{FisherCost, RelativeQuantity};
use excitation::system::flexible::{Estimated, FlexibleRequest, Nuisance};
use excitation::*;
use ff_dynamics::Wanted;
use ff_dynamics::sim::Accelerometer;
use ff_dynamics::{Prescribed, Sampling, sensitivities};
use ff_model::{Model, Params, Xform};
use ff_testkit::assert_within;
use nalgebra::{DMatrix, Rotation3, Vector3};

fn accelerometer() -> Accelerometer {
    let turn = Rotation3::from_euler_angles(0.3, -0.8, 1.1).into_inner();
    Accelerometer { mount: Xform::new(turn, Vector3::new(0.4, -0.3, 0.7)) }
}

fn indices(model: &Model, pick: impl Fn(&str) -> bool) -> Vec<usize> {
    let decls = model.param_decls();
    (0..decls.len()).filter(|&i| pick(&decls[i].name)).collect()
}

fn request(named: &[usize], others: &[usize], step: f64) -> FlexibleRequest {
    FlexibleRequest {
        named: named.iter().map(|&index| Estimated { index, prior: None }).collect(),
        others: others.iter().map(|&index| Estimated { index, prior: Some(3.0) }).collect(),
        noise: SensorNoise { torque: 0.1, gyro: Some(1.5e-4), rate: 100.0 },
        accelerometer: Some((accelerometer(), 2e-3)),
        nuisance: Nuisance {
            gyro_bias: Some(1e-4),
            torque_bias: Some(0.05),
            accel_bias: Some(1e-3),
            deflection: Some(0.01),
            rate: Some(0.005),
        },
        step,
    }
}

fn plan(model: &Model, seconds: f64, free: usize) -> (SplinePlan, Vec<f64>) {
    let n = model.nj();
    let limits = JointLimits { lower: -3.0, upper: 3.0, velocity: 0.6, acceleration: 0.5, jerk: None };
    let plan = SplinePlan::new(PlanSpec {
        start: numbers(n, 0.9, 5),
        end: End::Free,
        duration: Duration::Free { min: 0.7 * seconds, max: seconds },
        degree: 5,
        free,
        limits: vec![limits; n],
        refine: 1,
    })
    .unwrap();
    let x = random_plan(&plan, 3, 1, 0.9).unwrap();
    (plan, x)
}

/// The same matrix from the sensitivities of the dynamics crate.
fn by_dynamics(
    model: &Model,
    r: &FlexibleRequest,
    info: &FlexibleInformation,
    p: &SplinePlan,
    x: &[f64],
) -> DMatrix<f64> {
    let params = Params::nominal(model);
    let motion = p.motion(x).unwrap();
    let m = model.np();
    let Duration::Free { max, .. } = p.spec().duration else { unreachable!() };
    let steps = (max / r.step).ceil() as usize;
    let sampling = Sampling { samples: steps + 1, sample_s: p.duration(x) / steps as f64, substeps: 1 };
    let wanted = Wanted {
        params: info.parameters().iter().map(|p| p.index).collect(),
        initial: (6..6 + 2 * m).collect(),
        accel: true,
        ..Wanted::default()
    };
    let table = Prescribed::new(model, &params, &motion, &sampling, &wanted.links(model));
    let mut z0 = vec![0.0; 6 + 2 * m];
    z0[6..6 + m].copy_from_slice(&model.rest_position(&params));
    let (response, s) = sensitivities(model, &params, &table, &z0, &wanted).unwrap();
    let (n, k) = (model.nj(), wanted.len());
    let all = info.sizes().len();
    assert_eq!(all, k + n + 6);
    let mut f = DMatrix::zeros(all, all);
    for i in 0..=steps {
        let mut y = DMatrix::zeros(n + 6, all);
        for c in 0..k {
            let accel = accelerometer().derivative(&response, &s, i, c).unwrap();
            for r in 0..n + 6 {
                y[(r, c)] = match r {
                    r if r < n => s.tau[(i * n + r, c)],
                    r if r < n + 3 => s.gyro[(i * 3 + r - n, c)],
                    r => accel[r - n - 3],
                };
            }
        }
        for r in 0..n + 6 {
            y[(r, k + r)] = 1.0;
            let sigma = if r < n {
                0.1
            } else if r < n + 3 {
                1.5e-4
            } else {
                2e-3
            };
            for c in 0..all {
                y[(r, c)] *= info.sizes()[c] / sigma;
            }
        }
        let end = i == 0 || i == steps;
        f += y.tr_mul(&y) * (100.0 * sampling.sample_s * if end { 0.5 } else { 1.0 });
    }
    f
}

fn check(model: &Model, named: &[usize], others: &[usize], seconds: f64, step: f64, criteria: bool) {
    let params = Params::nominal(model);
    let r = request(named, others, step);
    let info = FlexibleInformation::new(model, &params, &r).unwrap();
    let (plan, x) = plan(model, seconds, 5);
    // The matrix itself.
    let motion_matrix = {
        let mut kept = None;
        let mut g = vec![0.0; x.len()];
        info.value_gradient(&plan, &x, &mut g, |f| {
            kept = Some(f.clone());
            Some((0.0, DMatrix::zeros(f.nrows(), f.ncols())))
        });
        assert!(g.iter().all(|g| g.abs() < 1e-12));
        kept.unwrap()
    };
    let want = by_dynamics(model, &r, &info, &plan, &x);
    for i in 0..want.nrows() {
        for j in 0..want.nrows() {
            let size = (want[(i, i)] * want[(j, j)]).sqrt();
            let prior = if i == j && i < info.parameters().len() {
                info.parameters()[i].prior.map_or(1e-8, |s| (info.sizes()[i] / s).powi(2))
            } else {
                f64::from(i == j)
            };
            let e = (motion_matrix[(i, j)] - prior - want[(i, j)]).abs();
            assert_within!(e, 1e-8 * size + 1e-12, "{i} {j}: {} against {}", motion_matrix[(i, j)], want[(i, j)]);
        }
    }
    // A linear functional of the matrix with general weights: the whole way back.
    let n = want.nrows();
    let scale: Vec<f64> = (0..n).map(|i| 1.0 / (want[(i, i)] + 1.0).sqrt()).collect();
    let raw = DMatrix::from_vec(n, n, numbers(n * n, 1.0, 17));
    let weights = DMatrix::from_fn(n, n, |i, j| (raw[(i, j)] + raw[(j, i)]) * scale[i] * scale[j]);
    let value =
        |y: &[f64], g: &mut [f64]| info.value_gradient(&plan, y, g, |f| Some((f.dot(&weights), weights.clone())));
    differences("linear", &plan, &x, value);
    if !criteria {
        return; // a record this short says too little for differences of a determinant
    }
    let quantities = (0..named.len())
        .map(|i| RelativeQuantity {
            name: info.names()[i].0.clone(),
            rows: DMatrix::from_fn(1, named.len(), |_, j| if i == j { 1.0 } else { 0.1 }),
        })
        .collect();
    for criterion in [Criterion::D, Criterion::E { power: 8.0 }, Criterion::Largest { quantities, power: 8.0 }] {
        let cost = FisherCost { information: info.clone(), criterion };
        differences(&format!("{:?}", cost.criterion), &plan, &x, |y, g| cost.value_gradient(&plan, y, g));
    }
}

fn differences(what: &str, plan: &SplinePlan, x: &[f64], value: impl Fn(&[f64], &mut [f64]) -> f64) {
    let n = plan.variables();
    let (mut g, mut scrap) = (vec![3.0; n], vec![0.0; n]);
    value(x, &mut g);
    let norm = g.iter().map(|v| v * v).sum::<f64>().sqrt();
    let mut worst: f64 = 0.0;
    // Every third control point, the free ends and the duration.
    for i in (0..n).filter(|i| i % 3 == 0 || *i == n - 1) {
        let mut y = x.to_vec();
        let mut at = |d: f64| {
            y[i] = x[i] + d;
            value(&y, &mut scrap)
        };
        let h = 2e-3;
        let num = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
        worst = worst.max((g[i] - num).abs() / norm);
        assert_within!((g[i] - num).abs(), 1e-6 * norm, "{what}, variable {i}: {} against {num}, norm {norm}", g[i]);
    }
    eprintln!("{:.40}: {worst:.1e}", what);
}

#[test]
#[ignore = "full tier: 8 s"]
fn panels() {
    let model = paper("flex.toml").model;
    let named = indices(&model, |n| n.starts_with("base.") || n.contains(".k["));
    let others = indices(&model, |n| n.contains(".d["));
    check(&model, &named, &others, 9.0, 0.25, true);
}

#[test]
#[ignore = "full tier: 6 s"]
fn fuel_and_links() {
    let model = paper("slosh.toml").model;
    let names: Vec<String> = model.param_decls().iter().map(|d| d.name.clone()).collect();
    eprintln!("{names:?}");
    let named = indices(&model, |n| n == "base.mass" || n.starts_with("link7."));
    let others: Vec<usize> = (10 * model.n_bodies()..model.n_params()).collect();
    check(&model, &named, &others, 9.0, 0.25, true);
}

/// Fuel, and parameters of a follower and of what it carries.
#[test]
fn joints_that_follow_others() {
    let mut model = paper("slosh.toml").model;
    model.couple(3, 5, -0.7, 0.2).unwrap();
    model.couple(6, 3, 1.4, -0.1).unwrap();
    let named = indices(&model, |n| n == "base.mass" || n == "link3.h_y" || n.starts_with("link7.I"));
    let others: Vec<usize> = (10 * model.n_bodies()..model.n_params()).collect();
    check(&model, &named, &others, 1.0, 0.25, false);
}

/// Appendages on links, one of them not Galilean, with parameters of payload, modes and fuel.
#[test]
#[ignore = "full tier: 8 s"]
fn every_kind() {
    let mut registry = ff_model::Registry::new();
    ff_model::payload::register(&mut registry);
    flex_panel::register(&mut registry);
    reaction_wheel::register(&mut registry);
    slosh_pendulum::register(&mut registry);
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/kinds/all.toml");
    let model = ff_mission::Mission::load(&file, &registry, &Default::default()).unwrap().model;
    assert!(model.appendages().iter().any(|a| !a.decl().galilean && a.host > 0));
    let named = indices(&model, |n| n == "base.mass" || n.starts_with("client."));
    assert_eq!(named.len(), 11);
    let pick = ["array_client", "tank_client.", "tank_main.length", "panel_b.k", "wheel."];
    let others: Vec<usize> =
        pick.iter().flat_map(|p| indices(&model, |n| n.starts_with(p)).into_iter().take(3)).collect();
    check(&model, &named, &others, 2.0, 0.04, false);
}
