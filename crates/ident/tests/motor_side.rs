//! Records whose torque channels read on the motor's side of the gears: friction, reflected inertia, currents with gains that are not known.

use crate::common::{exact, paper, planned, run};
use crate::output_error::{NOISE, columns_at, short_record};
use ff_mission::Loaded;
use ff_model::{ParamDecl, ParamGroup, Params};
use ff_records::Record;
use ff_testkit::assert_within;
use ident::compose::SharedErrors;
use ident::estimate::{Estimate, JointTerm, JointTorques, NearRest, attempt, rough_joints, without_joints};
use ident::parameters::{offset_start, select};
use ident::uncertain::ErrorSource;
use ident::{Noise, Options, OutputError, Request, SetupError};
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const TERMS: [JointTerm; 7] = [
    JointTerm::Viscous,
    JointTerm::Coulomb,
    JointTerm::ReflectedInertia,
    JointTerm::Asymmetry,
    JointTerm::Quadratic,
    JointTerm::Stribeck { rate: 0.021 },
    JointTerm::Load,
];

/// Coefficients and gains of general size for joint `j`.
fn motors(joints: usize, terms: &[JointTerm], currents: &[bool]) -> JointTorques {
    let of = |j: usize, k: usize| {
        (0.4 + 0.3 * (1.3 * j as f64 + 0.7 * k as f64).sin()) * [9.0, 0.9, 1.7, 2.1, 7.0, 0.5, 0.11][k]
    };
    let one = |j: usize| terms.iter().enumerate().map(|(k, t)| (*t, of(j, k))).collect();
    let gain = |j: usize| currents[j].then(|| (0.31 + 0.17 * (2.1 * j as f64).cos()) * if j == 3 { -1.0 } else { 1.0 });
    JointTorques { terms: (0..joints).map(one).collect(), gains: (0..joints).map(gain).collect() }
}

/// The record of exact torques as motors read it.
fn read(record: &Record, motors: &JointTorques, near: Option<NearRest>) -> Record {
    let (qd, qdd) = (record.qd().unwrap(), record.qdd().unwrap());
    let tau = DMatrix::from_fn(record.tau().nrows(), record.joints(), |i, j| {
        motors.reading(j, (qd[(i, j)], qdd[(i, j)]), record.tau()[(i, j)], near)
    });
    with_channels(record, tau, motors)
}

fn with_channels(record: &Record, tau: DMatrix<f64>, motors: &JointTorques) -> Record {
    let b = ff_records::RecordBuilder::new(record.joint_names().to_vec())
        .uniform(0.0, record.rate_hz())
        .allow("Data::Stuck");
    let b = b.q(record.q().clone()).qd(record.qd().unwrap().clone()).qdd(record.qdd().unwrap().clone()).tau(tau);
    let currents = motors.gains.iter().map(Option::is_some).collect();
    b.gyro(record.gyro().clone()).currents(currents).build().unwrap().0
}

fn sources(motors: &JointTorques) -> Vec<ErrorSource> {
    let terms = motors.terms.iter().enumerate().flat_map(|(j, of)| of.iter().map(move |t| ErrorSource::Joint(j, t.0)));
    let gains = motors.gains.iter().enumerate().filter(|g| g.1.is_some()).map(|(j, _)| ErrorSource::DriveGain(j));
    terms.chain(gains).collect()
}

/// The value of an error.
fn value(motors: &JointTorques, of: &ErrorSource) -> f64 {
    match *of {
        ErrorSource::Joint(j, term) => motors.coefficient(j, term),
        ErrorSource::DriveGain(j) => motors.gains[j].unwrap(),
        _ => unreachable!("no error of a joint"),
    }
}

#[test]
#[ignore = "full tier: 3 s"]
fn terms_and_gains_of_joints_have_columns_that_are_derivatives() {
    let l = paper("slosh.toml");
    let currents: Vec<bool> = (0..l.model.nj()).map(|j| j % 3 != 1).collect();
    let motors = motors(l.model.nj(), &TERMS, &currents);
    for (delays, near) in [(true, NearRest::Smooth(0.013)), (false, NearRest::LeaveOut(0.004))] {
        let record = read(&short_record(&l), &motors, Some(near));
        let errors = [
            sources(&motors),
            vec![ErrorSource::TorqueGain(Some(2)), ErrorSource::TorqueDrift(0), ErrorSource::TorqueSkew],
        ]
        .concat();
        let channel_noise = currents.iter().map(|&c| if c { 0.23 } else { 0.1 }).collect();
        let options = Options {
            errors,
            channel_noise,
            near_rest: vec![Some(near); l.model.nj()],
            torque_delay: delays,
            torque_bias: true,
            gyro_bias: true,
            initial_state: true,
            ..Options::new(NOISE)
        };
        let mut oe = OutputError::new(&l.model, &record, &options).unwrap();
        let unknowns = ident::Estimator::nuisance(&oe);
        let joints = l.model.joint_names();
        let extra: Vec<f64> = unknowns
            .iter()
            .enumerate()
            .map(|(k, u)| {
                let of = ErrorSource::of_joint(&u.name, &joints);
                of.map_or(u.size * (0.3 + 0.7 * (k as f64).sin()), |s| 1.1 * value(&motors, &s))
            })
            .collect();
        assert_eq!(unknowns.iter().filter(|u| ErrorSource::of_joint(&u.name, &joints).is_some()).count(), 7 * 7 + 5);
        let selected = select(&l.model.param_decls(), &["base.mass", "tank.*"]).unwrap();
        columns_at(&l, &mut oe, &selected, &extra);
        // Torques of joints next to rest are no data, and nothing else is left out.
        let qd = record.qd().unwrap();
        let resting = qd.iter().filter(|r| r.abs() <= 0.004).count();
        assert_eq!(ident::Estimator::left_out(&oe), if delays { 0 } else { resting });
    }
    let record = read(&short_record(&l), &motors, None);
    let bare = OutputError::new(&l.model, &record, &Options::new(NOISE));
    assert!(matches!(bare, Err(SetupError::Currents { measured: true, .. })));
}

/// A fit of base and tank beside terms and gains of the joints, from half of the gains and no friction.
fn fit(l: &Loaded, record: &Record, motors: &JointTorques, near: NearRest, noise: (Noise, &[f64])) -> Estimate {
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    // With length and damping free the valley of the tank is bent, and deviations are those of no normal distribution.
    let selected = select(&decls, &["base.*", "tank.mass", "tank.k[*]"]).unwrap();
    let mut start = offset_start(&decls, &truth, &selected, 0.1, 4);
    let errors = sources(motors);
    let options = Options {
        errors: errors.clone(),
        channel_noise: noise.1.to_vec(),
        near_rest: vec![Some(near); l.model.nj()],
        torque_bias: true,
        gyro_bias: true,
        ..Options::new(noise.0)
    };
    let inner = OutputError::new(&l.model, record, &options).unwrap();
    let joints = l.model.joint_names();
    let names: Vec<String> = errors.iter().map(|e| e.name(&joints)).collect();
    let mut estimator = SharedErrors::new(Box::new(inner), decls.len(), &names, &[]);
    let (mut all, mut asked) = (decls, selected);
    for e in &errors {
        let nominal = if matches!(e, ErrorSource::DriveGain(_)) { 0.6 * value(motors, e) } else { 0.0 };
        let size = value(motors, e).abs();
        let (unit, group) = (e.unit(), ParamGroup::Free);
        all.push(ParamDecl { name: e.name(&joints), unit, nominal, bounds: (nominal - size, nominal + size), group });
        asked.push(start.len());
        start.push(nominal);
    }
    attempt(&Request { anchor: Some(10.0), ..Request::new(&all, &asked, &start) }, &mut estimator).unwrap()
}

#[test]
fn friction_and_gains_come_back_with_the_parameters() {
    let l = paper("slosh.toml");
    let motion = planned(&l, 30.0, 10);
    let clean = exact(&l, &run(&l, &motion, 30.0));
    let currents: Vec<bool> = (0..l.model.nj()).map(|j| j != 4).collect();
    let terms = [JointTerm::Viscous, JointTerm::Coulomb, JointTerm::ReflectedInertia];
    let motors = motors(l.model.nj(), &terms, &currents);
    let near = NearRest::LeaveOut(0.002);
    let record = read(&clean, &motors, Some(near));
    let channel_noise: Vec<f64> = currents.iter().map(|&c| if c { 0.3 } else { 0.1 }).collect();
    let e = fit(&l, &record, &motors, near, (NOISE, &channel_noise));
    assert!(e.is_solution(), "{:?}", e.status);
    let joints = l.model.joint_names();
    for source in sources(&motors) {
        let p = e.parameters.iter().find(|p| p.name == source.name(&joints)).unwrap();
        let (off, std) = ((p.value - value(&motors, &source)).abs(), p.std.unwrap());
        assert!(off < 0.02 * std, "{}: {} for {}, deviation {std:e}", p.name, p.value, value(&motors, &source));
    }
    // The rows that are left out are not counted.
    let counted = e.residuals.iter().filter(|r| **r != 0.0).count();
    assert!(counted < e.residuals.len() - 100 && e.chi2_per_dof < 1e-4, "{counted} {}", e.chi2_per_dof);
    // Roughly, channel by channel, at the true parameters.
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let all: Vec<Vec<JointTerm>> = vec![terms.to_vec(); l.model.nj()];
    let rough = rough_joints(&l.model, &record, &truth, &all, &vec![Some(near); l.model.nj()], &NOISE).unwrap();
    for (j, gain) in motors.gains.iter().enumerate() {
        match (gain, rough.joints.gains[j]) {
            (Some(k), Some(found)) => assert_within!((found / k - 1.0).abs(), 1e-6, "{j}: {found} {k}"),
            (want, found) => assert_eq!((want, found), (&None, None)),
        }
    }
    let torques = without_joints(&l.model, &record, &rough.joints, &vec![Some(near); l.model.nj()], &NOISE).unwrap();
    let off = (torques.tau() - clean.tau()).amax();
    assert!(torques.has_torques(), "currents left");
    assert_within!(off, 1e-5 * clean.tau().amax(), "{off}");
}

/// Squared distances from the truth over the number of combinations that data of noise determine, and chi-squared over its degrees of freedom.
fn worlds(count: u64) -> Vec<(f64, f64)> {
    let l = paper("slosh.toml");
    let motion = planned(&l, 30.0, 10);
    let clean = exact(&l, &run(&l, &motion, 30.0));
    let currents: Vec<bool> = (0..l.model.nj()).map(|j| j % 2 == 0).collect();
    let terms = [JointTerm::Viscous, JointTerm::Coulomb, JointTerm::Stribeck { rate: 0.02 }];
    let motors = motors(l.model.nj(), &terms, &currents);
    let near = NearRest::LeaveOut(0.004);
    let read = read(&clean, &motors, Some(near));
    let noise = Noise { torque: 0.1 * NOISE.torque, gyro: 0.1 * NOISE.gyro };
    let channel_noise: Vec<f64> = currents.iter().map(|&c| if c { 0.03 } else { noise.torque }).collect();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let one = |seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw =
            |sigma: f64| -> f64 { sigma * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, &mut rng) };
        let tau = DMatrix::from_fn(read.samples(), l.model.nj(), |i, j| read.tau()[(i, j)] + draw(channel_noise[j]));
        let gyro = DMatrix::from_fn(read.samples(), 3, |i, k| read.gyro()[(i, k)] + draw(noise.gyro));
        let record = with_channels(&read, tau, &motors).with_gyro(gyro);
        let e = fit(&l, &record, &motors, near, (noise, &channel_noise));
        let joints = l.model.joint_names();
        let of = sources(&motors);
        assert!(e.is_solution(), "{:?}", e.status);
        let right = |name: &str| {
            let decls = l.model.param_decls();
            let own = decls.iter().position(|d| d.name == name).map(|i| truth[i]);
            own.unwrap_or_else(|| value(&motors, of.iter().find(|s| s.name(&joints) == name).unwrap()))
        };
        let beside = e.nuisance.iter().map(|p| p.value);
        let errors: Vec<f64> = e.parameters.iter().map(|p| p.value - right(&p.name)).chain(beside).collect();
        let errors = nalgebra::DVector::from_vec(errors);
        // What the data tell: no priors are there.
        assert!(e.data_only.full_rank(), "{:?}", e.data_only.null);
        let c = e.data_only.covariance.clone().cholesky().unwrap();
        (errors.dot(&c.solve(&errors)) / errors.len() as f64, e.chi2_per_dof)
    };
    (0..count).map(one).collect()
}

fn is_honest(found: &[(f64, f64)]) {
    let n = found.len() as f64;
    let mean = found.iter().map(|f| f.0).sum::<f64>() / n;
    let chi2 = found.iter().map(|f| f.1).sum::<f64>() / n;
    println!("{n} worlds: e^T C^-1 e / n is {mean:.3}, chi-squared per degree of freedom {chi2:.4}");
    // Some fifty unknowns: a chi-squared over its freedom scatters by 0.2; residuals of some thirty thousand by 0.008.
    assert!((mean - 1.0).abs() < 4.0 * 0.2 / n.sqrt() && (chi2 - 1.0).abs() < 4.0 * 0.008 / n.sqrt(), "{mean} {chi2}");
}

#[test]
#[ignore = "full tier: 2 s"]
fn deviations_beside_friction_and_gains_are_honest() {
    is_honest(&worlds(2));
}

#[test]
#[ignore = "full tier: 60 s"]
fn deviations_beside_friction_and_gains_are_honest_in_many_worlds() {
    is_honest(&worlds(36));
}
