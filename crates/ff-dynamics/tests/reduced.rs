//! The reduced system against the full dynamics, and its sensitivities against differences.

use crate::common::*;
use ff_dynamics::reduced::sensitivity::{Carried, sensitivities_span};
use ff_dynamics::reduced::{reduced_torques_span, simulate_reduced_span};
use ff_dynamics::*;
use ff_model::*;

fn start(m: &Model) -> Vec<f64> {
    (0..6 + 2 * m.np()).map(|i| 0.03 * (1.3 * i as f64 + 0.4).sin()).collect()
}

#[test]
fn reduced_and_full_dynamics_give_the_same_record() {
    let m = system();
    let p = Params::nominal(&m);
    let z0 = start(&m);
    let mut s = State::zero(&m);
    s.v[..6].copy_from_slice(&z0[..6]);
    s.eta.copy_from_slice(&z0[6..6 + m.np()]);
    s.nu_mut().copy_from_slice(&z0[6 + m.np()..]);
    let wave = Wave(7);
    let o = SimOptions { duration_s: 5.0, step_s: 1e-3, sample_s: 0.05 };
    let full = simulate(&m, &p, &s, &Drive::Prescribed(&wave), &o).unwrap();
    let sampling = Sampling { samples: full.len(), sample_s: 0.05, substeps: 50 };
    let table = Prescribed::new(&m, &p, &wave, &sampling, &[]);
    let red = simulate_reduced(&m, &p, &table, &z0).unwrap();
    let close = |a: &nalgebra::DMatrix<f64>, b: &nalgebra::DMatrix<f64>, tol: f64| {
        let e = (a - b).amax() / b.amax();
        println!("{e:.1e}");
        assert!(e < tol, "{e:e}");
    };
    close(&red.tau, &full.tau, 1e-11);
    close(&red.twist, &full.twist, 1e-11);
    close(&red.accel, &full.accel, 1e-11);
    close(&red.eta, &full.eta, 1e-11);
    close(&red.nu, &full.nu, 1e-11);
}

#[test]
fn sensitivities_are_the_derivatives_of_the_simulated_record() {
    let m = system();
    let p = Params::nominal(&m);
    let z0 = start(&m);
    // Base, link 4 (which carries the boom) and the last link, every appendage parameter, initial state.
    let wanted = Wanted {
        params: (0..10).chain(40..50).chain(70..m.n_params()).collect(),
        initial: (0..z0.len()).collect(),
        ..Wanted::default()
    };
    let sampling = Sampling { samples: 31, sample_s: 0.05, substeps: 5 };
    let wave = Wave(7);
    let links = wanted.links(&m);
    assert_eq!(links, [4, 7]);
    let table = Prescribed::new(&m, &p, &wave, &sampling, &links);
    let (r, s) = sensitivities(&m, &p, &table, &z0, &wanted).unwrap();
    assert_eq!(r, simulate_reduced(&m, &p, &table, &z0).unwrap());
    let run = |values: Vec<f64>, z: &[f64]| {
        let p = Params::from_values(&m, values);
        let t = Prescribed::new(&m, &p, &wave, &sampling, &[]);
        simulate_reduced(&m, &p, &t, z).unwrap()
    };
    let mut worst = 0.0f64;
    for col in 0..wanted.len() {
        let (mut lo, mut hi) = (p.values().to_vec(), p.values().to_vec());
        let (mut zl, mut zh) = (z0.clone(), z0.clone());
        let h;
        if col < wanted.params.len() {
            let k = wanted.params[col];
            h = 1e-4 * (1.0 + p.values()[k].abs());
            lo[k] -= h;
            hi[k] += h;
        } else {
            let k = wanted.initial[col - wanted.params.len()];
            h = 1e-5;
            zl[k] -= h;
            zh[k] += h;
        }
        let (a, b) = (run(lo, &zl), run(hi, &zh));
        // Differences of torques of order 10 carry 1e-11 / h of rounding; below this a column counts as zero.
        let mut scale = 1e-3f64;
        let mut err = 0.0f64;
        for i in 0..sampling.samples {
            for j in 0..7 {
                let d = (b.tau[(i, j)] - a.tau[(i, j)]) / (2.0 * h);
                scale = scale.max(d.abs());
                err = err.max((d - s.tau[(i * 7 + j, col)]).abs());
            }
            for j in 0..3 {
                let d = (b.twist[(i, 3 + j)] - a.twist[(i, 3 + j)]) / (2.0 * h);
                err = err.max((d - s.gyro[(i * 3 + j, col)]).abs());
            }
        }
        worst = worst.max(err / scale);
        assert_within!(err, 1e-5 * scale, "column {col}: {err:e} of {scale:e}");
    }
    // Galilean invariance: a uniform velocity changes nothing that is measured.
    for col in wanted.params.len()..wanted.params.len() + 3 {
        assert!(s.tau.column(col).amax() < 1e-10 && s.gyro.column(col).amax() < 1e-10, "column {col}");
    }
    println!("worst column {worst:.1e} of its largest torque derivative, {} columns", wanted.len());
}

#[test]
fn rda_torques_and_their_derivatives_are_those_of_the_rigid_system() {
    let m = system().without_appendages();
    let p = Params::nominal(&m);
    let wave = Wave(7);
    let mut s = State::zero(&m);
    s.v[..6].copy_from_slice(&[0.1, -0.2, 0.05, 0.03, -0.06, 0.08]);
    let o = SimOptions { duration_s: 1.0, step_s: 1e-3, sample_s: 0.05 };
    let full = simulate(&m, &p, &s, &Drive::Prescribed(&wave), &o).unwrap();
    let sampling = Sampling { samples: full.len(), sample_s: 0.05, substeps: 1 };
    let wanted = Wanted { params: (0..10).chain(30..40).chain(70..80).collect(), initial: vec![], ..Wanted::default() };
    let table = Prescribed::new(&m, &p, &wave, &sampling, &wanted.links(&m));
    let (tau, d) = reduced_torques(&m, &p, &table, &full.gyro(), &wanted).unwrap();
    // The base starts with a linear velocity the RDA never hears of.
    assert_within!((&tau - &full.tau).amax(), 1e-11 * full.tau.amax());
    for (c, &k) in wanted.params.iter().enumerate() {
        let h = 1e-4 * (1.0 + p.values()[k].abs());
        let run = |h: f64| {
            let mut v = p.values().to_vec();
            v[k] += h;
            let p = Params::from_values(&m, v);
            let t = Prescribed::new(&m, &p, &wave, &sampling, &[]);
            reduced_torques(&m, &p, &t, &full.gyro(), &Wanted::default()).unwrap().0
        };
        let fd = (run(h) - run(-h)) / (2.0 * h);
        for i in 0..tau.nrows() {
            for j in 0..7 {
                let e = (fd[(i, j)] - d[(i * 7 + j, c)]).abs();
                assert_within!(e, 1e-6 * (1e-3 + fd.amax()), "parameter {k} sample {i} joint {j}: {e:e}");
            }
        }
    }
}

/// Rows `from..` of a matrix whose rows come in groups of `width` per sample.
fn part(of: &nalgebra::DMatrix<f64>, span: &core::ops::Range<usize>, width: usize) -> nalgebra::DMatrix<f64> {
    of.rows(span.start * width, span.len() * width).into_owned()
}

#[test]
fn a_record_in_parts_is_the_whole_record_bit_for_bit() {
    let m = system();
    let p = Params::nominal(&m);
    let z0 = start(&m);
    let wanted = Wanted {
        params: (0..10).chain(40..50).chain(70..m.n_params()).collect(),
        initial: (2..z0.len()).collect(),
        accel: true,
        attitude: true,
        ..Wanted::default()
    };
    let (wave, links) = (Wave(7), wanted.links(&m));
    for substeps in [1, 3] {
        let sampling = Sampling { samples: 37, sample_s: 0.05, substeps };
        let table = Prescribed::new(&m, &p, &wave, &sampling, &links);
        let (r, s) = sensitivities(&m, &p, &table, &z0, &wanted).unwrap();
        let mut carried = [Carried::start(&m, &z0, &wanted), Carried::start(&m, &z0, &wanted)];
        let mut z = z0.clone();
        for span in [0..1, 1..2, 2..9, 9..20, 20..36, 36..37] {
            // Of the table of the whole record, and of one that ends with the first sample of the next part.
            let own = span.start..(span.end + 1).min(37);
            let short = Prescribed::span(&m, &p, &wave, &sampling, own, &links);
            let parts = [(&table, span.clone()), (&short, 0..span.len())];
            for ((table, local), carried) in parts.into_iter().zip(&mut carried) {
                let (rp, sp) = sensitivities_span(&m, &p, table, local, carried, &wanted).unwrap();
                let (a, b) = (s.attitude.as_ref().unwrap(), sp.attitude.unwrap());
                assert_eq!((rp.tau, rp.accel), (part(&r.tau, &span, 1), part(&r.accel, &span, 1)), "{span:?}");
                assert_eq!((sp.tau, sp.gyro), (part(&s.tau, &span, 7), part(&s.gyro, &span, 3)), "{span:?}");
                assert_eq!(sp.accel.unwrap(), part(s.accel.as_ref().unwrap(), &span, 6), "{span:?}");
                assert_eq!((b.att, b.d), (part(&a.att, &span, 1), part(&a.d, &span, 3)), "{span:?}");
            }
            let rp = simulate_reduced_span(&m, &p, &short, 0..span.len(), &mut z).unwrap();
            assert_eq!((rp.nu, rp.twist), (part(&r.nu, &span, 1), part(&r.twist, &span, 1)), "{span:?}");
        }
        assert_eq!(z[3..6], r.twist.row(36).iter().copied().collect::<Vec<_>>()[3..]);
    }
}

#[test]
fn rda_torques_of_a_part_are_those_of_the_whole_bit_for_bit() {
    let m = system().without_appendages();
    let (p, wave) = (Params::nominal(&m), Wave(7));
    let sampling = Sampling { samples: 21, sample_s: 0.05, substeps: 1 };
    let wanted = Wanted { params: (0..10).chain(30..40).collect(), ..Wanted::default() };
    let rates = nalgebra::DMatrix::from_fn(21, 3, |i, k| 0.1 * (0.3 * i as f64 + k as f64).sin());
    let table = Prescribed::new(&m, &p, &wave, &sampling, &wanted.links(&m));
    let (tau, d) = reduced_torques(&m, &p, &table, &rates, &wanted).unwrap();
    for span in [0..5, 5..6, 6..21] {
        let own = part(&rates, &span, 1);
        let (t, dt) = reduced_torques_span(&m, &p, &table, span.clone(), &own, &wanted).unwrap();
        assert_eq!((t, dt), (part(&tau, &span, 1), part(&d, &span, 7)), "{span:?}");
    }
}
