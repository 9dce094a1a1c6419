//! What a record has besides parameters: biases, delays, initial states, outliers; and several records at once.

use crate::common::estimate;
use crate::common::*;
use ff_mission::Loaded;
use ff_model::Params;
use ff_records::{Record, RecordBuilder};
use ff_testkit::assert_within;
use ident::SetupError;
use ident::Several;
use ident::compose::Shared;
use ident::estimate::Estimate;
use ident::parameters::offset_start;
use ident::parameters::select;
use ident::uncertain::{ErrorSource, WalkPart};
use ident::*;
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub(crate) const NOISE: Noise = Noise { torque: 0.1, gyro: 1.5e-4 };
const SECONDS: f64 = 30.0;
const GYRO_BIAS: [f64; 3] = [4e-4, -3e-4, 7e-4];

fn torque_bias(j: usize) -> f64 {
    0.3 * (1.7 * j as f64 + 0.4).sin()
}

/// The slosh case with biases, torques 3 ms late and the gyro 4 ms early; noise of `sigma` times [`NOISE`].
fn spoiled(l: &Loaded, sigma: f64, seed: u64) -> Record {
    let motion = planned(l, SECONDS, 10);
    let fine = {
        let o = ff_dynamics::SimOptions { duration_s: SECONDS, step_s: 1e-3, sample_s: 1e-3 };
        let p = Params::nominal(&l.model);
        let drive = ff_dynamics::Drive::Prescribed(&motion);
        ff_dynamics::simulate(&l.model, &p, &ff_dynamics::State::zero(&l.model), &drive, &o).unwrap()
    };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = move || -> f64 { StandardNormal.sample(&mut rng) };
    let (n, samples) = (l.model.nj(), 2950);
    let gyro = fine.gyro();
    // Sample i is taken at 0.01 i + 0.2 s, so that both delays stay inside; the record starts in motion.
    let at = |i: usize| 10 * i + 200;
    let q = DMatrix::from_fn(samples, n, |i, j| fine.q[(at(i), j)]);
    let qd = DMatrix::from_fn(samples, n, |i, j| fine.qd[(at(i), j)]);
    let qdd = DMatrix::from_fn(samples, n, |i, j| fine.qdd[(at(i), j)]);
    let tau =
        DMatrix::from_fn(samples, n, |i, j| fine.tau[(at(i) - 3, j)] + torque_bias(j) + sigma * NOISE.torque * noise());
    let gyro = DMatrix::from_fn(samples, 3, |i, j| gyro[(at(i) + 4, j)] + GYRO_BIAS[j] + sigma * NOISE.gyro * noise());
    let b = RecordBuilder::new(l.model.joint_names()).uniform(0.0, 100.0).allow("Data::Stuck");
    b.q(q).qd(qd).qdd(qdd).tau(tau).gyro(gyro).build().unwrap().0
}

fn everything() -> Options {
    Options {
        substeps: 1,
        gyro_bias: true,
        torque_bias: true,
        initial_state: true,
        torque_delay: true,
        gyro_delay: true,
        ..Options::new(NOISE)
    }
}

/// Six seconds of the slosh case, without noise.
pub(crate) fn short_record(l: &Loaded) -> Record {
    spoiled(l, 0.0, 0).window(3.0, 9.0).unwrap()
}

#[test]
fn derivatives_are_those_of_the_residuals() {
    let l = paper("slosh.toml");
    let record = short_record(&l);
    let mut oe = OutputError::new(&l.model, &record, &everything()).unwrap();
    let selected = select(&l.model.param_decls(), &["base.mass", "base.i_xy", "tank.*"]).unwrap();
    let unknowns = oe.nuisance();
    let names: Vec<&str> = unknowns.iter().map(|u| u.name.as_str()).collect();
    assert_eq!(
        (names[2], names[10], names[11], names[12]),
        ("gyro.bias.z", "torque.delay", "gyro.delay", "initial.rate.x")
    );
    columns_are_derivatives(&l, &mut oe, &selected);
}

#[test]
fn errors_of_sensors_joints_and_surroundings_have_columns_that_are_derivatives() {
    let l = paper("slosh.toml");
    let record = spoiled(&l, 0.0, 0).window(3.0, 9.0).unwrap();
    let kinematics = vec!["joint2.offset".to_owned(), "tank.mount.ry".to_owned()];
    // Delays beside skews, so that readings are interpolated; more placements and disturbances than a table keeps.
    let mut errors = ErrorSource::all(l.model.nj());
    errors.push(ErrorSource::TorqueWalk(2, WalkPart { index: 1, every_ms: 2300 }));
    errors.push(ErrorSource::GyroWalk(1, WalkPart { index: 0, every_ms: 4100 }));
    let options = Options { errors, kinematics, ..everything() };
    let mut oe = OutputError::new(&l.model, &record, &options).unwrap();
    let names: Vec<String> = oe.nuisance().into_iter().map(|u| u.name).collect();
    for name in [
        "torque.gain",
        "gyro.rotation.y",
        "friction.joint7.coulomb",
        "compliance.joint3",
        "encoder.lag.joint6",
        "torque.lag.joint4",
        "wrench.nz",
    ] {
        assert!(names.iter().any(|n| n == name), "{name} of {names:?}");
    }
    let selected = select(&l.model.param_decls(), &["base.mass", "tank.*"]).unwrap();
    columns_are_derivatives(&l, &mut oe, &selected);
    let lacking = Options { errors: vec![ErrorSource::Compliance(7)], ..Options::new(NOISE) };
    assert!(matches!(OutputError::new(&l.model, &record, &lacking), Err(SetupError::NoSuchError(7))));
}

/// Every column against a central difference, at general sizes of all nuisance unknowns.
fn columns_are_derivatives(l: &Loaded, oe: &mut OutputError<'_>, selected: &[usize]) {
    let unknowns = oe.nuisance();
    let extra: Vec<f64> = unknowns.iter().enumerate().map(|(k, u)| u.size * (0.3 + 0.7 * (k as f64).sin())).collect();
    columns_at(l, oe, selected, &extra);
}

/// Every column against a central difference, at these values of all nuisance unknowns.
pub(crate) fn columns_at(l: &Loaded, oe: &mut OutputError<'_>, selected: &[usize], extra: &[f64]) {
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let decls = l.model.param_decls();
    let unknowns = oe.nuisance();
    let rows = oe.rows();
    let (mut r, mut j) = (vec![0.0; rows], DMatrix::zeros(rows, selected.len() + extra.len()));
    oe.jacobian(&truth, extra, selected, &mut r, &mut j).unwrap();
    let mut at = |full: &[f64], extra: &[f64]| {
        let mut r = vec![0.0; rows];
        oe.residuals(full, extra, &mut r).unwrap();
        r
    };
    assert_eq!(at(&truth, extra), r);
    let sizes = ident::parameters::sizes(&decls, &truth);
    for c in 0..j.ncols() {
        // Parameters and nuisance unknowns in one vector.
        let (place, h) = match selected.get(c) {
            Some(&i) => (i, 1e-5 * sizes[i]),
            None => {
                let u = &unknowns[c - selected.len()];
                // Readings are linear in a wrench, and hardly change with one of the size of the torques' noise.
                let step = match u.name.split('.').next() {
                    Some("wrench") => 1.0,
                    Some("compliance") => 1.0,
                    Some("encoder") => 0.1,
                    _ => 1e-3,
                };
                (truth.len() + c - selected.len(), step * u.size)
            }
        };
        let mut moved = |h: f64| {
            let mut x = [&truth[..], extra].concat();
            x[place] += h;
            at(&x[..truth.len()], &x[truth.len()..])
        };
        let (a, b) = (moved(h), moved(-h));
        let worst = (0..rows).map(|i| (j[(i, c)] - (a[i] - b[i]) / (2.0 * h)).abs()).fold(0.0, f64::max);
        let scale = j.column(c).amax();
        let name = |c: usize| c.checked_sub(selected.len()).map_or("a parameter", |k| &unknowns[k].name);
        assert!(scale > 0.0 && worst < 1e-5 * scale, "column {c} {}: {worst:e} of {scale:e}", name(c));
    }
}

#[test]
fn biases_delays_and_initial_state_come_back_with_the_parameters() {
    let l = paper("slosh.toml");
    let record = spoiled(&l, 0.0, 0);
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = select(&decls, &["base.*", "tank.*"]).unwrap();
    let start = offset_start(&decls, &truth, &selected, 0.2, 4);
    let mut oe = OutputError::new(&l.model, &record, &everything()).unwrap();
    let e = estimate(&Request::new(&decls, &selected, &start), &mut oe).unwrap();
    let of = |name: &str| e.nuisance.iter().find(|u| u.name == name).unwrap().value;
    println!("{:?} after {}: delays {} {}", e.status, e.iterations, of("torque.delay"), of("gyro.delay"));
    assert_within!((of("torque.delay") - 3e-3).abs(), 1e-9, "{}", of("torque.delay"));
    assert_within!((of("gyro.delay") + 4e-3).abs(), 1e-9, "{}", of("gyro.delay"));
    for (k, axis) in ["x", "y", "z"].iter().enumerate() {
        assert_within!((of(&format!("gyro.bias.{axis}")) - GYRO_BIAS[k]).abs(), 1e-7);
    }
    for (j, name) in l.model.joint_names().iter().enumerate() {
        assert_within!((of(&format!("torque.bias.{name}")) - torque_bias(j)).abs(), 1e-4);
    }
    let errors: Vec<f64> =
        selected.iter().map(|&i| e.values[i] - truth[i]).chain(e.nuisance.iter().map(|_| 0.0)).collect();
    let (known, worst) = e.data_only.worst_combination(&errors, 0.1);
    println!("{known} combinations, worst {worst:e}");
    assert!(known >= 16 && worst < 1e-7, "{known} combinations, worst {worst:e}");
}

#[test]
#[ignore = "full tier: 6 s"]
fn a_robust_loss_is_not_moved_by_outliers() {
    let l = paper("slosh.toml");
    let clean = spoiled(&l, 1.0, 3);
    let mut tau = clean.tau().clone();
    // Every twentieth sample of one joint is off by up to 30 N m, in step with a slow motion.
    for i in (0..tau.nrows()).step_by(20) {
        tau[(i, 1)] += 30.0 * (0.009 * i as f64).sin();
    }
    let b = RecordBuilder::new(l.model.joint_names()).uniform(0.0, 100.0).allow("Data::Stuck");
    let b = b.q(clean.q().clone()).qd(clean.qd().unwrap().clone()).qdd(clean.qdd().unwrap().clone());
    let record = b.tau(tau).gyro(clean.gyro().clone()).build().unwrap().0;
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = select(&decls, &["base.*", "tank.*"]).unwrap();
    let fit = |record: &Record, loss: Loss| {
        let mut oe = OutputError::new(&l.model, record, &everything()).unwrap();
        estimate(&Request { loss, ..Request::new(&decls, &selected, &truth) }, &mut oe).unwrap()
    };
    let worst = |e: &Estimate| {
        e.parameters
            .iter()
            .zip(&selected)
            .map(|(p, &i)| (p.value - truth[i]).abs() / p.std.unwrap())
            .fold(0.0, f64::max)
    };
    let (plain, huber, student) = (fit(&record, Loss::Squares), fit(&record, Loss::HUBER), fit(&record, Loss::STUDENT));
    println!("largest error in standard deviations: {:.1} {:.1} {:.1}", worst(&plain), worst(&huber), worst(&student));
    assert!(plain.chi2_per_dof > 4.0 && worst(&plain) > 20.0, "{}", worst(&plain));
    let undisturbed = fit(&clean, Loss::Squares);
    for robust in [&huber, &student] {
        assert!(worst(robust) < 3.5, "{}", worst(robust));
        // A little less is known than without outliers.
        let ratio = robust.parameters[0].std.unwrap() / undisturbed.parameters[0].std.unwrap();
        assert!((1.0..1.3).contains(&ratio), "{ratio}");
    }
    let wrong = Request { loss: Loss::Huber { k: -1.0 }, ..Request::new(&decls, &selected, &truth) };
    let mut oe = OutputError::new(&l.model, &record, &everything()).unwrap();
    assert!(estimate(&wrong, &mut oe).unwrap_err().to_string().contains("1.345"));
}

#[test]
fn two_records_share_the_model_and_keep_their_biases() {
    let l = paper("slosh.toml");
    let whole = spoiled(&l, 0.0, 0);
    let (first, second) = (whole.window(0.0, 14.0).unwrap(), whole.window(15.0, 29.0).unwrap());
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    // Fuel is burnt in between: the tank is another one, base and arm are not.
    let shared = Shared::new(&[("first", &decls), ("second", &decls)], &["tank.mass"]).unwrap();
    let selected = select(&shared.decls, &["base.*", "*tank.*"]).unwrap();
    let one =
        |record| -> Box<dyn Estimator + '_> { Box::new(OutputError::new(&l.model, record, &everything()).unwrap()) };
    let mut both = Several::new(&shared, vec![one(&first), one(&second)]);
    let all = shared.gather(&[truth.clone(), truth.clone()]);
    let start = offset_start(&shared.decls, &all, &selected, 0.15, 2);
    let e = estimate(&Request::new(&shared.decls, &selected, &start), &mut both).unwrap();
    let masses: Vec<&Estimated> = e.parameters.iter().filter(|p| p.name.ends_with("tank.mass")).collect();
    assert_eq!(masses.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["first.tank.mass", "second.tank.mass"]);
    println!("{:?} after {}: {:?}", e.status, e.iterations, masses.iter().map(|p| p.value).collect::<Vec<_>>());
    assert!(masses.iter().all(|p| (p.value - 100.0).abs() < 1e-5), "{masses:?}");
    assert!(e.nuisance.iter().any(|u| u.name == "second.torque.delay" && (u.value - 3e-3).abs() < 1e-9));
}

/// A record of a robot whose joints and tank are not quite where the model has them: exact columns, and the values come back.
#[test]
fn placements_of_joints_and_mounts_are_estimated_by_name() {
    let l = paper("slosh.toml");
    let m = &l.model;
    let joints = m.joint_names();
    let wanted = [
        (format!("{}.offset", joints[2]), 0.004),
        (format!("{}.placement.x", joints[4]), -0.003),
        (format!("{}.placement.rz", joints[1]), 0.002),
        ("tank.mount.y".to_owned(), 0.02),
    ];
    let mut values = vec![0.0; m.n_kinematic_params()];
    for (name, x) in &wanted {
        values[m.kinematic_index(name).unwrap()] = *x;
    }
    let moved = m.displaced(&ff_model::Kinematics::from_values(m, values));
    let motion = planned(&l, SECONDS, 10);
    let o = ff_dynamics::SimOptions { duration_s: SECONDS, step_s: 5e-3, sample_s: 1e-2 };
    let drive = ff_dynamics::Drive::Prescribed(&motion);
    let y = ff_dynamics::simulate(&moved, &Params::nominal(m), &ff_dynamics::State::zero(m), &drive, &o).unwrap();
    let gyro = y.gyro();
    let b = RecordBuilder::new(joints).uniform(0.0, 100.0).allow("Data::Stuck");
    let record = b.q(y.q).qd(y.qd).qdd(y.qdd).tau(y.tau).gyro(gyro).build().unwrap().0;
    let kinematics = wanted.iter().map(|(name, _)| name.clone()).collect();
    let options = Options { substeps: 2, torque_bias: true, initial_state: true, kinematics, ..Options::new(NOISE) };
    let mut oe = OutputError::new(m, &record, &options).unwrap();
    let decls = m.param_decls();
    let truth = Params::<f64>::nominal(m).values().to_vec();
    let selected = select(&decls, &["base.mass", "tank.*"]).unwrap();
    let unknowns = oe.nuisance();
    let first = m.nj();
    let (names, rows) = (unknowns[first..first + 4].iter().map(|u| u.name.clone()).collect::<Vec<_>>(), oe.rows());
    for ((name, _), got) in wanted.iter().zip(&names) {
        assert_eq!(m.kinematic_index(name), m.kinematic_index(got), "{name} {got}");
    }
    // Columns at a general point.
    let extra: Vec<f64> = unknowns.iter().enumerate().map(|(k, u)| u.size * (0.3 + 0.7 * (k as f64).sin())).collect();
    let (mut r, mut j) = (vec![0.0; rows], DMatrix::zeros(rows, selected.len() + extra.len()));
    oe.jacobian(&truth, &extra, &selected, &mut r, &mut j).unwrap();
    for k in first..extra.len() {
        let mut at = |h: f64| {
            let (mut x, mut r) = (extra.clone(), vec![0.0; rows]);
            x[k] += h;
            oe.residuals(&truth, &x, &mut r).unwrap();
            r
        };
        let h = 1e-4;
        let (a, b) = (at(h), at(-h));
        let column = j.column(selected.len() + k);
        let worst = (0..rows).map(|i| (column[i] - (a[i] - b[i]) / (2.0 * h)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-5 * column.amax(), "{}: {worst:e} of {:e}", unknowns[k].name, column.amax());
    }
    let start = offset_start(&decls, &truth, &selected, 0.1, 4);
    let e = estimate(&Request::new(&decls, &selected, &start), &mut oe).unwrap();
    for ((_, want), name) in wanted.iter().zip(&names) {
        let got = e.nuisance.iter().find(|u| u.name == *name).unwrap().value;
        println!("{name}: {got}");
        assert!((got - want).abs() < 1e-5, "{name}: {got} {want}");
    }
}

#[test]
fn a_placement_that_does_not_exist_or_comes_twice_is_refused() {
    let l = paper("slosh.toml");
    let record = spoiled(&l, 0.0, 0).window(3.0, 9.0).unwrap();
    let of = |names: &[String]| {
        let options = Options { kinematics: names.to_vec(), ..Options::new(NOISE) };
        OutputError::new(&l.model, &record, &options).err().unwrap()
    };
    let joint = &l.model.joint_names()[0];
    let near = match of(&[format!("{joint}.ofset")]) {
        SetupError::Placement { near, .. } => near,
        other => panic!("{other}"),
    };
    assert_eq!(near, Some(format!("{joint}.offset")));
    // The rotation about the joint's axis under its other name.
    let twice = ["rx", "ry", "rz"].map(|r| format!("{joint}.placement.{r}"));
    let names = [&twice[..], &[format!("{joint}.offset")]].concat();
    assert!(matches!(of(&names), SetupError::PlacementTwice(name) if name == format!("{joint}.offset")));
}
