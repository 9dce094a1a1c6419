//! The record of general systems: sliding joints, turned mounts, an appendage that is not Galilean, accelerometer and
//! attitude, several parameter sets at once.

// Helpers may unwrap like the tests they serve.
#![allow(clippy::unwrap_used)]

use crate::common::*;
use ff_dynamics::reduced::ReducedError;
use ff_dynamics::reduced::sensitivity::sensitivities_with;
use ff_dynamics::reduced::simulate_reduced_batch;
use ff_dynamics::sim::Accelerometer;
use ff_dynamics::*;
use ff_model::spatial::so3::{log_so3, quat_conj, quat_mul};
use ff_model::*;
use flex_panel::modal::{ModalAppendage, Mode};
use nalgebra::{DMatrix, Matrix3, Vector3, Vector4, Vector6};

/// A random tree with sliding and turning joints, a panel and a slosh mass on turned mounts, and modal appendages on the
/// base and on a link.
pub(crate) fn general() -> Model {
    let mut r = rng(11);
    let mut m = random_tree(&mut r, 5, BaseKind::Floating);
    assert!(m.bodies().iter().any(|b| b.joint.kind == JointKind::Prismatic), "no sliding joint");
    let at = |r: &mut _| Xform::new(rotation(r), vector(r, 0.7));
    for host in [0, 3] {
        let part = rigid_segment(body(&mut r, 4.0), vector(&mut r, 0.5), unit_vector(&mut r)).with_spring(80.0, 1.5);
        let panel = flex_panel::PanelChain::new(vec![part.clone(), part]).unwrap();
        m.mount(format!("panel{host}"), host, at(&mut r), panel).unwrap();
        let rigid = Inertia::from_com(20.0, &v3(0.3, 0.9, -0.2), &Matrix3::from_diagonal(&v3(6.0, 3.0, 7.0)));
        let mode = |f, p: [f64; 6]| Mode { frequency_hz: f, damping_ratio: 0.02, participation: Vector6::from(p) };
        let modes = [mode(0.7, [0.4, -0.3, 1.9, 1.1, 0.2, -0.3]), mode(1.3, [1.2, 0.5, -0.2, 0.1, -0.4, 0.9])];
        let modal = ModalAppendage::new(rigid, &modes).unwrap();
        m.mount(format!("modal{host}"), host, at(&mut r), modal).unwrap();
    }
    // Ports of no coordinates, and of more than the sizes with code of their own.
    let client = payload::Payload::new(&body(&mut r, 6.0)).unwrap();
    m.mount("client", 5, at(&mut r), client).unwrap();
    let part = rigid_segment(body(&mut r, 2.0), vector(&mut r, 0.4), unit_vector(&mut r)).with_spring(60.0, 1.0);
    m.mount("blade", 0, at(&mut r), flex_panel::PanelChain::new(vec![part; 5]).unwrap()).unwrap();
    let slosh = slosh_pendulum::SloshPendulum::new(30.0, 0.6, [9.0, 11.0], [1.5, 2.0]).unwrap();
    m.mount("tank", 0, at(&mut r), slosh).unwrap();
    m
}

pub(crate) fn start(m: &Model) -> Vec<f64> {
    (0..6 + 2 * m.np()).map(|i| if i < 6 { 0.2 } else { 0.02 } * (1.3 * i as f64 + 0.4).sin()).collect()
}

pub(crate) fn state_of(m: &Model, z: &[f64]) -> State<f64> {
    let mut s = State::zero(m);
    s.v[..6].copy_from_slice(&z[..6]);
    s.eta.copy_from_slice(&z[6..6 + m.np()]);
    s.nu_mut().copy_from_slice(&z[6 + m.np()..]);
    s
}

pub(crate) const SAMPLING: Sampling = Sampling { samples: 9, sample_s: 0.05, substeps: 5 };

/// What [`sensitivities`] differentiates, by plain simulation.
fn record(m: &Model, values: &[f64], z: &[f64], sensor: &Accelerometer) -> (Response, Vec<Vector3<f64>>, Trace) {
    let p = Params::from_values(m, values.to_vec());
    let wave = Wave(m.nj());
    let r = simulate_reduced(m, &p, &Prescribed::new(m, &p, &wave, &SAMPLING, &[]), z).unwrap();
    let a = (0..SAMPLING.samples).map(|i| sensor.read(&r, i)).collect();
    let o = SimOptions { duration_s: 0.4, step_s: 0.01, sample_s: 0.05 };
    let t = simulate(m, &p, &state_of(m, z), &Drive::Prescribed(&wave), &o).unwrap();
    (r, a, t)
}

pub(crate) fn att(t: &DMatrix<f64>, i: usize) -> Vector4<f64> {
    Vector4::new(t[(i, 0)], t[(i, 1)], t[(i, 2)], t[(i, 3)])
}

/// Torques, gyro, accelerations, attitude.
fn channels(s: &Sensitivities) -> [DMatrix<f64>; 4] {
    let attitude = s.attitude.as_ref().unwrap();
    [&s.tau, &s.gyro, s.accel.as_ref().unwrap(), &attitude.d].map(Clone::clone)
}

#[test]
fn every_instruction_set_gives_the_same_sensitivities() {
    let m = general();
    let p = Params::<f64>::nominal(&m);
    let z0 = start(&m);
    // Neither columns nor samples fill the lanes.
    for (params, samples) in
        [((0..10).chain(10 * m.n_bodies()..m.n_params() - 3).collect::<Vec<_>>(), 30), (vec![3, 5], 9)]
    {
        let wanted = Wanted { params, initial: vec![2, 5, 8], accel: true, attitude: true, ..Wanted::default() };
        let sampling = Sampling { samples, ..SAMPLING };
        let table = Prescribed::new(&m, &p, &Wave(m.nj()), &sampling, &[]);
        let run = |isa| sensitivities_with(isa, &m, &p, &table, &z0, &wanted).unwrap().1;
        let sets = instruction_sets();
        let want = channels(&run(sets[0]));
        for &isa in &sets[1..] {
            for (got, want) in channels(&run(isa)).iter().zip(&want) {
                assert_eq!(got.shape(), want.shape());
                for (c, (got, want)) in got.column_iter().zip(want.column_iter()).enumerate() {
                    let e = (got - want).amax() / want.amax().max(1e-9);
                    assert_within!(e, 1e-10, "{isa:?} column {c}: {e:e}");
                }
            }
        }
    }
}

/// A base with a panel, without joints.
fn without_joints() -> Model {
    let mut r = rng(5);
    let mut m = Model::new("hull", "hull", body(&mut r, 40.0), BaseKind::Floating);
    let part = rigid_segment(body(&mut r, 4.0), vector(&mut r, 0.5), unit_vector(&mut r)).with_spring(80.0, 1.5);
    let panel = flex_panel::PanelChain::new(vec![part]).unwrap();
    m.mount("panel", 0, Xform::new(rotation(&mut r), vector(&mut r, 0.7)), panel).unwrap();
    m
}

#[test]
fn few_columns_and_samples_are_those_of_many() {
    for m in [general(), peers_arm(BaseKind::Floating), without_joints()] {
        let (p, z0) = (Params::<f64>::nominal(&m), start(&m));
        let params: Vec<usize> = (0..10).chain(10 * m.n_bodies()..m.n_params()).collect();
        let run = |params: &[usize], initial: &[usize], samples| {
            let (params, initial) = (params.to_vec(), initial.to_vec());
            let wanted = Wanted { params, initial, accel: true, attitude: true, ..Wanted::default() };
            // Both steps of eight stages are samples.
            let sampling = Sampling { samples, sample_s: 0.02, substeps: 1 };
            let table = Prescribed::new(&m, &p, &Wave(m.nj()), &sampling, &[]);
            channels(&sensitivities(&m, &p, &table, &z0, &wanted).unwrap().1)
        };
        let initial: Vec<usize> = (0..z0.len()).collect();
        let all = run(&params, &initial, 17);
        let last = params.len() - 1;
        for (some, starts) in
            [(vec![], vec![]), (vec![last], vec![]), (vec![], vec![4]), (vec![7, 2, last], vec![5, 0])]
        {
            let chosen: Vec<usize> = some.iter().map(|&i| params[i]).collect();
            for samples in [1, 2, 9] {
                let few = run(&chosen, &starts, samples);
                let columns: Vec<usize> = some.iter().copied().chain(starts.iter().map(|i| params.len() + i)).collect();
                for ((few, all), channels) in few.iter().zip(&all).zip([m.nj(), 3, 6, 3]) {
                    assert_eq!(few.shape(), (channels * samples, if channels > 0 { columns.len() } else { 0 }));
                    for (c, &of) in columns.iter().enumerate().take(few.ncols()) {
                        let want = all.column(of).rows(0, channels * samples).clone_owned();
                        let e = (few.column(c) - &want).amax() / want.amax().max(1e-9);
                        assert_within!(e, 1e-11, "{}: column {c} of {samples} samples: {e:e}", m.name());
                    }
                }
            }
        }
    }
}

#[test]
fn general_systems_have_exact_sensitivities_of_all_sensors() {
    let m = general();
    let p = Params::<f64>::nominal(&m);
    let z0 = start(&m);
    let sensor = Accelerometer { mount: Xform::new(rotation(&mut rng(3)), v3(0.4, -0.7, 0.9)) };
    let wanted = Wanted {
        params: (0..10).chain(20..30).chain(10 * m.n_bodies()..m.n_params()).collect(),
        initial: (0..z0.len()).collect(),
        accel: true,
        attitude: true,
        ..Wanted::default()
    };
    let table = Prescribed::new(&m, &p, &Wave(m.nj()), &SAMPLING, &wanted.links(&m));
    let (r, s) = sensitivities(&m, &p, &table, &z0, &wanted).unwrap();
    let (plain, _, full) = record(&m, p.values(), &z0, &sensor);
    assert_eq!(r, plain);
    let attitude = s.attitude.as_ref().unwrap();
    assert_within!((&attitude.att - &full.att).amax(), 1e-13, "attitude is that of the full simulation");
    assert_within!((&r.tau - &full.tau).amax(), 1e-10 * full.tau.amax());
    let mut worst = [0.0f64; 4];
    for col in 0..wanted.len() {
        let (mut v, mut z) = ([p.values().to_vec(), p.values().to_vec()], [z0.clone(), z0.clone()]);
        let h = match wanted.params.get(col) {
            Some(&k) => {
                let h = 1e-4 * (1.0 + p.values()[k].abs());
                (v[0][k], v[1][k]) = (v[0][k] - h, v[1][k] + h);
                h
            }
            None => {
                let k = wanted.initial[col - wanted.params.len()];
                (z[0][k], z[1][k]) = (z[0][k] - 1e-5, z[1][k] + 1e-5);
                1e-5
            }
        };
        let (lo, hi) = (record(&m, &v[0], &z[0], &sensor), record(&m, &v[1], &z[1], &sensor));
        // Largest difference and largest value of each sensor.
        let mut seen = [(0.0f64, 1e-4f64); 4];
        let mut put = |k: usize, got: f64, want: f64| {
            seen[k] = (seen[k].0.max((got - want).abs()), seen[k].1.max(want.abs()));
        };
        for i in 0..SAMPLING.samples {
            for j in 0..m.nj() {
                put(0, s.tau[(i * m.nj() + j, col)], (hi.0.tau[(i, j)] - lo.0.tau[(i, j)]) / (2.0 * h));
            }
            for j in 0..3 {
                put(1, s.gyro[(3 * i + j, col)], (hi.0.twist[(i, 3 + j)] - lo.0.twist[(i, 3 + j)]) / (2.0 * h));
            }
            let (got, want) = (sensor.derivative(&r, &s, i, col).unwrap(), (hi.1[i] - lo.1[i]) / (2.0 * h));
            (0..3).for_each(|j| put(2, got[j], want[j]));
            let turned = log_so3(&quat_mul(&quat_conj(&att(&lo.2.att, i)), &att(&hi.2.att, i))) / (2.0 * h);
            (0..3).for_each(|j| put(3, attitude.d[(3 * i + j, col)], turned[j]));
        }
        for (k, (error, scale)) in seen.into_iter().enumerate() {
            worst[k] = worst[k].max(error / scale);
            assert_within!(error, 2e-5 * scale, "column {col}, sensor {k}: {error:e} of {scale:e}");
        }
    }
    println!(
        "torque {:.1e}, gyro {:.1e}, accelerometer {:.1e}, attitude {:.1e}",
        worst[0], worst[1], worst[2], worst[3]
    );
    // An appendage that is not Galilean feels the velocity: these columns are not zero here, as they are elsewhere.
    assert!((0..3).any(|k| s.tau.column(wanted.params.len() + k).amax() > 1e-6));
}

#[test]
fn several_parameter_sets_at_once_are_single_runs() {
    let m = system();
    let nominal = Params::<f64>::nominal(&m);
    let table = Prescribed::new(&m, &nominal, &Wave(7), &SAMPLING, &[]);
    // Eleven: one group of eight and one that is not full, or with four lanes two and one.
    let sets: Vec<(Params<f64>, Vec<f64>)> = (0..11)
        .map(|k| {
            let scale = |(i, x): (usize, &f64)| x * (1.0 + 0.02 * (k as f64 + 0.7 * i as f64).sin());
            let values = nominal.values().iter().enumerate().map(scale).collect();
            (Params::from_values(&m, values), start(&m).iter().map(|x| x * (1.0 + 0.1 * k as f64)).collect())
        })
        .collect();
    let runs: Vec<(&Params<f64>, &[f64])> = sets.iter().map(|(p, z)| (p, z.as_slice())).collect();
    let batch = simulate_reduced_batch(&m, &table, &runs).unwrap();
    for ((p, z), got) in sets.iter().zip(&batch) {
        let (got, want) = (got.as_ref().unwrap(), simulate_reduced(&m, p, &table, z).unwrap());
        for (g, w) in
            [(&got.tau, &want.tau), (&got.twist, &want.twist), (&got.eta, &want.eta), (&got.accel, &want.accel)]
        {
            assert_within!((g - w).amax(), 1e-11 * w.amax(), "{:e}", (g - w).amax() / w.amax());
        }
    }
    // One that fails does not take the others with it.
    let mut broken = nominal.values().to_vec();
    broken[0] = -1e5;
    let broken = Params::from_values(&m, broken);
    let z0 = start(&m);
    let mixed = [(&nominal, z0.as_slice()), (&broken, z0.as_slice()), (&nominal, z0.as_slice())];
    let out = simulate_reduced_batch(&m, &table, &mixed).unwrap();
    assert!(out[0].is_ok() && out[2].is_ok());
    assert!(matches!(out[1], Err(ReducedError::Singular { .. })), "{:?}", out[1].as_ref().err());
    // Nor one whose modes are too fast for the steps: the others go on beside it, and its error is that of a run of its own.
    let mut stiff = nominal.values().to_vec();
    m.parameter_indices("*.k[0]").unwrap().iter().for_each(|&i| stiff[i] *= 1e6);
    let stiff = Params::from_values(&m, stiff);
    for order in [[0, 1, 0, 0], [1, 0, 1, 1]] {
        let sets = [(&nominal, z0.as_slice()), (&stiff, z0.as_slice())];
        let out = simulate_reduced_batch(&m, &table, &order.map(|k| sets[k])).unwrap();
        for (k, got) in order.into_iter().zip(out) {
            match (got, simulate_reduced(&m, sets[k].0, &table, sets[k].1)) {
                (Ok(got), Ok(want)) => assert_within!((&got.tau - &want.tau).amax(), 1e-11 * want.tau.amax()),
                (Err(ReducedError::NotFinite { t, .. }), Err(ReducedError::NotFinite { t: alone, .. })) => {
                    assert!(k == 1 && t < 0.5 * SAMPLING.samples as f64 * SAMPLING.sample_s);
                    assert_within!((t - alone).abs(), 2.0 * SAMPLING.sample_s, "{t} {alone}");
                }
                (got, want) => panic!("{k}: {got:?} {want:?}"),
            }
        }
    }
}
