//! Placements of joints and mounts as parameters: columns of the record against differences and dual numbers, and tables of
//! the arm over any scalar. The system is that of `record.rs`: floating base, turning and sliding joints on general axes,
//! panels, slosh, a modal appendage that is not Galilean and a payload, on base and links.

// Helpers may unwrap like the tests they serve.
#![allow(clippy::unwrap_used)]

use crate::common::*;
use crate::record::{SAMPLING, att, general, start, state_of};
use ff_dynamics::reduced::ArmModel;
use ff_dynamics::reduced::ArmTable;
use ff_dynamics::reduced::{OwnTable, ReducedError, simulate_reduced_over, simulate_reduced_own_tables};
use ff_dynamics::sim::Accelerometer;
use ff_dynamics::*;
use ff_model::scalar::D1;
use ff_model::scalar::lanes::{Four, Lanes};
use ff_model::spatial::so3::{log_so3, quat_conj, quat_mul};
use ff_model::*;
use nalgebra::{DMatrix, Vector3};

/// General values: a few centimetres and hundredths of a radian.
fn values(m: &Model) -> Vec<f64> {
    (0..m.n_kinematic_params()).map(|i| 0.04 * (1.9 * i as f64 + 0.3).sin()).collect()
}

/// All kinematic parameters, and a few of links, base and appendages beside them.
fn everything(m: &Model) -> Wanted {
    Wanted {
        params: vec![3, 21, 27, 10 * m.n_bodies() + 2, m.n_params() - 1],
        kinematics: (0..m.n_kinematic_params()).collect(),
        initial: vec![4],
        accel: true,
        attitude: true,
        ..Wanted::default()
    }
}

/// A column of a sum of parameters, whatever they belong to, is the sum of their columns.
#[test]
fn sums_of_parameters_have_the_sums_of_their_columns() {
    let m = general();
    let (p, z0, kinematics) = (Params::<f64>::nominal(&m), start(&m), Kinematics::from_values(&m, values(&m)));
    let single = everything(&m);
    let [base, link, same_link, port, last] = single.params[..] else { panic!("five parameters") };
    let combined = vec![
        vec![(link, 0.7), (same_link, -1.3)],
        vec![(base, 2.0)],
        vec![(port, 0.4), (last, -0.6), (base, 1.5), (same_link, 0.2)],
        vec![],
        vec![(last, 1.1), (last, 0.9)],
    ];
    let summed = Wanted { params: vec![port], combined, ..single.clone() };
    let column = |i: usize| single.params.iter().position(|&p| p == i).unwrap();
    let run = |w: &Wanted| {
        let table = Prescribed::with_kinematics(&m, &p, &kinematics, &Wave(m.nj()), &SAMPLING, w);
        sensitivities(&m, &p, &table, &z0, w).unwrap().1
    };
    let (one, all) = (run(&single), run(&summed));
    let pairs =
        [(&one.tau, &all.tau), (&one.gyro, &all.gyro), (one.accel.as_ref().unwrap(), all.accel.as_ref().unwrap())];
    for (one, all) in pairs {
        assert_eq!(all.ncols(), summed.len());
        for (c, parts) in summed.combined.iter().enumerate() {
            let mut want = one.column(0) * 0.0;
            parts.iter().for_each(|&(i, by)| want += one.column(column(i)) * by);
            let off = (all.column(1 + c) - &want).amax();
            assert!(off < 1e-11 * want.amax().max(1e-3), "{c}: {off:.1e} of {:.1e}", want.amax());
        }
        let (behind, count) = (single.params.len(), single.len() - single.params.len());
        let off = (all.columns(summed.inertial(), count) - one.columns(behind, count)).amax();
        assert!(off < 1e-11 * one.amax(), "{off:.1e}");
    }
}

/// Torque, gyro, accelerometer and attitude at every sample, by plain simulation of the displaced model.
fn record(m: &Model, kinematics: Vec<f64>, z: &[f64], sensor: &Accelerometer) -> (Response, Vec<Vector3<f64>>, Trace) {
    let moved = m.displaced(&Kinematics::from_values(m, kinematics));
    let (p, wave) = (Params::nominal(m), Wave(m.nj()));
    let r = simulate_reduced(&moved, &p, &Prescribed::new(&moved, &p, &wave, &SAMPLING, &[]), z).unwrap();
    let a = (0..SAMPLING.samples).map(|i| sensor.read(&r, i)).collect();
    let o = SimOptions { duration_s: 0.4, step_s: 0.01, sample_s: 0.05 };
    let t = simulate(&moved, &p, &state_of(m, z), &Drive::Prescribed(&wave), &o).unwrap();
    (r, a, t)
}

#[test]
fn placements_of_joints_and_mounts_have_the_columns_of_central_differences() {
    let m = general();
    let (p, z0, at) = (Params::<f64>::nominal(&m), start(&m), values(&m));
    let sensor = Accelerometer { mount: Xform::new(rotation(&mut rng(3)), v3(0.4, -0.7, 0.9)) };
    let wanted = everything(&m);
    let kinematics = Kinematics::from_values(&m, at.clone());
    let table = Prescribed::with_kinematics(&m, &p, &kinematics, &Wave(m.nj()), &SAMPLING, &wanted);
    let (r, s) = sensitivities(&m, &p, &table, &z0, &wanted).unwrap();
    assert_eq!(r, record(&m, at.clone(), &z0, &sensor).0, "the response is that of the displaced model");
    let attitude = s.attitude.as_ref().unwrap();
    let mut worst = [0.0f64; 4];
    for (c, decl) in m.kinematic_params().iter().enumerate() {
        let col = wanted.params.len() + c;
        // Differences of fourth order: their own error is below the tolerance.
        let h = 2e-3;
        let runs = [-2.0, -1.0, 1.0, 2.0].map(|k| {
            let mut v = at.clone();
            v[c] += k * h;
            record(&m, v, &z0, &sensor)
        });
        let difference = |of: &dyn Fn(usize) -> f64| (of(0) - of(3) + 8.0 * (of(2) - of(1))) / (12.0 * h);
        let mut seen = [(0.0f64, 1e-3f64); 4];
        let mut put = |k: usize, got: f64, want: f64| {
            seen[k] = (seen[k].0.max((got - want).abs()), seen[k].1.max(want.abs()));
        };
        for i in 0..SAMPLING.samples {
            for j in 0..m.nj() {
                put(0, s.tau[(i * m.nj() + j, col)], difference(&|k| runs[k].0.tau[(i, j)]));
            }
            let accelerometer = sensor.derivative(&r, &s, i, col).unwrap();
            let turned = |k: usize| log_so3(&quat_mul(&quat_conj(&att(&attitude.att, i)), &att(&runs[k].2.att, i)));
            for j in 0..3 {
                put(1, s.gyro[(3 * i + j, col)], difference(&|k| runs[k].0.twist[(i, 3 + j)]));
                put(2, accelerometer[j], difference(&|k| runs[k].1[i][j]));
                put(3, attitude.d[(3 * i + j, col)], difference(&|k| turned(k)[j]));
            }
        }
        for (k, (error, scale)) in seen.into_iter().enumerate() {
            worst[k] = worst[k].max(error / scale);
            assert!(error < 1e-6 * scale, "{}, sensor {k}: {error:e} of {scale:e}", decl.name);
        }
    }
    println!("worst: torque, gyro, accelerometer, attitude {worst:?}");
}

/// The record over dual numbers that carry the derivative of one thing: torques, gyro, acceleration of the base origin.
fn by_duals(m: &Model, params: Vec<D1>, kinematics: Vec<D1>, z0: &[f64]) -> [DMatrix<f64>; 3] {
    let params = Params::from_values(m, params);
    let kinematics = Kinematics::from_values(m, kinematics);
    let table = ArmTable::new(m, &params, &kinematics, &Wave(m.nj()), &SAMPLING);
    let z0: Vec<D1> = z0.iter().map(|&z| D1::constant(z)).collect();
    let r = simulate_reduced_over(m, &params, &table, &z0).unwrap();
    let of = |m: &DMatrix<D1>, i, k| Vector3::new(m[(i, k)], m[(i, k + 1)], m[(i, k + 2)]);
    let classical = |i: usize, k: usize| {
        let (w, v) = (of(&r.twist, i, 3), of(&r.twist, i, 0));
        if k < 3 {
            (of(&r.accel, i, 0) + ff_model::spatial::small::cross(&w, &v))[k].eps[0]
        } else {
            r.accel[(i, k)].eps[0]
        }
    };
    let n = SAMPLING.samples;
    [r.tau.map(|x| x.eps[0]), r.twist.columns(3, 3).map(|x| x.eps[0]), DMatrix::from_fn(n, 6, classical)]
}

#[test]
fn placements_of_joints_and_mounts_have_the_columns_of_dual_numbers() {
    let m = general();
    let (p, z0, at) = (Params::<f64>::nominal(&m), start(&m), values(&m));
    let wanted = everything(&m);
    let kinematics = Kinematics::from_values(&m, at.clone());
    let table = Prescribed::with_kinematics(&m, &p, &kinematics, &Wave(m.nj()), &SAMPLING, &wanted);
    let (_, s) = sensitivities(&m, &p, &table, &z0, &wanted).unwrap();
    let mut worst = 0.0f64;
    for col in 0..wanted.forced() {
        let mut params: Vec<D1> = p.values().iter().map(|&x| D1::constant(x)).collect();
        let mut kinematics: Vec<D1> = at.iter().map(|&x| D1::constant(x)).collect();
        match wanted.params.get(col) {
            Some(&k) => params[k].eps[0] = 1.0,
            None => kinematics[wanted.kinematics[col - wanted.params.len()]].eps[0] = 1.0,
        }
        let want = by_duals(&m, params, kinematics, &z0);
        for (want, got) in want.iter().zip([&s.tau, &s.gyro, s.accel.as_ref().unwrap()]) {
            // A column is a sample's channels one after another.
            let got = DMatrix::from_row_slice(SAMPLING.samples, want.ncols(), got.column(col).as_slice());
            let error = (&got - want).amax() / want.amax().max(1e-3);
            worst = worst.max(error);
            assert!(error < 1e-10, "column {col}: {error:e}");
        }
    }
    println!("worst column {worst:.1e} of its largest derivative, {} columns", wanted.forced());
}

/// The rigid arm's torques of the RDA have the columns, too.
#[test]
fn reduced_torques_depend_on_placements() {
    let m = general().without_appendages();
    let (p, at) = (Params::<f64>::nominal(&m), values(&m));
    let rates = DMatrix::from_fn(SAMPLING.samples, 3, |i, k| 0.1 * (0.7 * i as f64 + 1.3 * k as f64).sin());
    let wanted = Wanted { kinematics: (0..m.n_kinematic_params()).collect(), ..Wanted::default() };
    let run = |v: Vec<f64>, wanted: &Wanted| {
        let k = Kinematics::from_values(&m, v);
        let table = Prescribed::with_kinematics(&m, &p, &k, &Wave(m.nj()), &SAMPLING, wanted);
        reduced_torques(&m, &p, &table, &rates, wanted).unwrap()
    };
    let (tau, d) = run(at.clone(), &wanted);
    for c in 0..wanted.len() {
        let h = 1e-4;
        let moved = |h: f64| {
            let mut v = at.clone();
            v[c] += h;
            run(v, &Wanted::default()).0
        };
        let fd = (moved(h) - moved(-h)) / (2.0 * h);
        for i in 0..tau.nrows() {
            for j in 0..m.nj() {
                let e = (fd[(i, j)] - d[(i * m.nj() + j, c)]).abs();
                assert!(e < 1e-6 * (1.0 + fd.amax()), "parameter {c} sample {i} joint {j}: {e:e}");
            }
        }
    }
}

/// The table that lanes fill and the one over any scalar give the same record, and without displacements every bit is that
/// of the model itself.
#[test]
fn tables_of_lanes_and_tables_over_any_scalar_agree() {
    let m = general();
    let (p, z0, wave) = (Params::<f64>::nominal(&m), start(&m), Wave(m.nj()));
    for at in [vec![0.0; m.n_kinematic_params()], values(&m)] {
        let k = Kinematics::from_values(&m, at);
        let lanes = Prescribed::with_kinematics(&m, &p, &k, &wave, &SAMPLING, &Wanted::default());
        let any = ArmTable::new(&m, &p, &k, &wave, &SAMPLING);
        let (a, b) =
            (simulate_reduced(&m, &p, &lanes, &z0).unwrap(), simulate_reduced_over(&m, &p, &any, &z0).unwrap());
        for (a, b) in [(&a.tau, &b.tau), (&a.twist, &b.twist), (&a.accel, &b.accel), (&a.eta, &b.eta), (&a.nu, &b.nu)] {
            assert!((a - b).amax() < 1e-12 * b.amax(), "{:e}", (a - b).amax() / b.amax());
        }
    }
    let fixed = Prescribed::with_kinematics(&m, &p, &Kinematics::fixed(&m), &wave, &SAMPLING, &Wanted::default());
    let plain = Prescribed::new(&m, &p, &wave, &SAMPLING, &[]);
    assert_eq!(simulate_reduced(&m, &p, &fixed, &z0).unwrap(), simulate_reduced(&m, &p, &plain, &z0).unwrap());
}

/// Arm masses, joint offsets and mounts differ between the sets that share their lanes.
#[test]
fn each_lane_can_have_its_own_table() {
    let m = general();
    let nominal = Params::<f64>::nominal(&m);
    let sets: Vec<(Params<f64>, Prescribed, Vec<f64>)> = (0..11)
        .map(|k| {
            let scale = |(i, x): (usize, &f64)| x * (1.0 + 0.02 * (k as f64 + 0.7 * i as f64).sin());
            let p = Params::from_values(&m, nominal.values().iter().enumerate().map(scale).collect());
            let at = Kinematics::from_values(&m, values(&m).iter().map(|x| x * (k as f64 - 4.3)).collect());
            let table = Prescribed::with_kinematics(&m, &p, &at, &Wave(m.nj()), &SAMPLING, &Wanted::default());
            (p, table, start(&m).iter().map(|x| x * (1.0 + 0.1 * k as f64)).collect())
        })
        .collect();
    let runs: Vec<OwnTable<'_>> = sets.iter().map(|(p, t, z)| (p, t, z.as_slice())).collect();
    let batch = simulate_reduced_own_tables(&m, &runs).unwrap();
    assert_eq!(batch.len(), sets.len());
    for (k, ((p, t, z), got)) in sets.iter().zip(&batch).enumerate() {
        let (got, want) = (got.as_ref().unwrap(), simulate_reduced(&m, p, t, z).unwrap());
        for (g, w) in
            [(&got.tau, &want.tau), (&got.twist, &want.twist), (&got.eta, &want.eta), (&got.accel, &want.accel)]
        {
            assert!((g - w).amax() < 1e-11 * w.amax(), "set {k}: {:e}", (g - w).amax() / w.amax());
        }
    }
    // They do differ.
    let torque = |k: usize| &batch[k].as_ref().unwrap().tau;
    assert!((torque(0) - torque(1)).amax() > 1e-2 * torque(0).amax());
    // A set that fails leaves the others theirs.
    let mut broken = nominal.values().to_vec();
    broken[0] = -1e5;
    let broken = Params::from_values(&m, broken);
    let mixed = [runs[0], (&broken, runs[1].1, runs[1].2), runs[2]];
    let out = simulate_reduced_own_tables(&m, &mixed).unwrap();
    assert!(out[0].is_ok() && out[2].is_ok());
    assert!(matches!(out[1], Err(ReducedError::Singular { .. })), "{:?}", out[1].as_ref().err());
}

#[test]
#[should_panic(expected = "tables of one sampling")]
fn tables_of_different_sampling_do_not_share_lanes() {
    let m = general();
    let (p, z0) = (Params::<f64>::nominal(&m), start(&m));
    let table = |samples| Prescribed::new(&m, &p, &Wave(m.nj()), &Sampling { samples, ..SAMPLING }, &[]);
    let (a, b) = (table(9), table(8));
    let _ = simulate_reduced_own_tables(&m, &[(&p, &a, &z0), (&p, &b, &z0)]);
}

/// Other links in every lane, against one arm at a time.
#[test]
fn an_arm_in_lanes_is_one_arm_per_lane() {
    let m = general();
    let nominal = Params::<f64>::nominal(&m);
    let (params, at): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (0..4)
        .map(|l| {
            let p = nominal.values().iter().map(|x| x * (1.0 + 0.1 * l as f64)).collect();
            (p, values(&m).iter().map(|x| x * (1.7 - l as f64)).collect())
        })
        .unzip();
    let pack = |of: &[Vec<f64>]| -> Vec<Four> {
        (0..of[0].len()).map(|i| Four::load(&[of[0][i], of[1][i], of[2][i], of[3][i]])).collect()
    };
    let joints: Vec<f64> = (0..3 * m.nj()).map(|i| (0.9 * i as f64 + 0.2).sin()).collect();
    let thirds = |x: &[Four]| -> Vec<Four> {
        let k = Kinematics::from_values(&m, pack(&at));
        let sites: Vec<_> =
            m.appendages().iter().enumerate().map(|(i, a)| (a.host, k.mount(i).apply(&a.mount))).collect();
        let mut arm = ArmModel::new(&m, &Params::from_values(&m, pack(&params)), &sites).displaced(&k);
        let (n, mut out) = (m.nj(), Vec::new());
        arm.numbers([&x[..n], &x[n..2 * n], &x[2 * n..]], true, &mut out);
        out
    };
    let together = thirds(&joints.iter().map(|&x| Four::splat(x)).collect::<Vec<_>>());
    for l in 0..4 {
        let k = Kinematics::from_values(&m, at[l].clone());
        let sites: Vec<_> =
            m.appendages().iter().enumerate().map(|(i, a)| (a.host, k.mount(i).apply(&a.mount))).collect();
        let mut arm = ArmModel::new(&m, &Params::from_values(&m, params[l].clone()), &sites).displaced(&k);
        let (n, mut out) = (m.nj(), Vec::new());
        arm.numbers([&joints[..n], &joints[n..2 * n], &joints[2 * n..]], true, &mut out);
        assert_eq!(out.len(), arm.len(true));
        for (i, (a, b)) in together.iter().zip(&out).enumerate() {
            assert!((a.lane(l) - b).abs() < 1e-12 * (1.0 + b.abs()), "lane {l}, number {i}: {} {b}", a.lane(l));
        }
    }
}

/// Without it a wanted parameter would have a column of zeros.
#[test]
#[should_panic(expected = "kinematic parameter 4 is not tracked")]
fn a_table_made_without_a_kinematic_parameter_is_refused() {
    let m = general();
    let p = Params::<f64>::nominal(&m);
    let table = Prescribed::new(&m, &p, &Wave(m.nj()), &SAMPLING, &[]);
    let wanted = Wanted { kinematics: vec![4], ..Wanted::default() };
    let _ = sensitivities(&m, &p, &table, &start(&m), &wanted);
}
