//! Rows block by block: the same rows, the same answer, memory that does not grow, the same bits on any number of threads.

use crate::common::estimate;
use crate::common::*;
use allocation_counter::measure;
use ff_dynamics::motion::JointMotion;
use ff_least_squares::{Settings, TallQr};
use ff_mission::Loaded;
use ff_model::Params;
use ff_records::{ChannelGroup, Mask, Record, RecordBuilder};
use ff_testkit::motion::Sines;
use ident::compose::{Affine, Masked, Shared, TieMap};
use ident::estimate::{Estimate, Jacobian, RowBlock, attempt};
use ident::parameters::{offset_start, select};
use ident::*;
use nalgebra::DMatrix;

const NOISE: Noise = Noise { torque: 0.1, gyro: 1.5e-4 };

fn everything(substeps: usize) -> Options {
    Options {
        substeps,
        gyro_bias: true,
        torque_bias: true,
        initial_state: true,
        torque_delay: true,
        gyro_delay: true,
        ..Options::new(NOISE)
    }
}

/// A record of smooth motion; torques and gyro are no system's, which rows do not mind.
fn any(l: &Loaded, samples: usize) -> Record {
    let n = l.model.nj();
    let motion = Sines::new(3, n, samples as f64 * 0.01, 0.5);
    let (mut q, mut qd, mut qdd) = (DMatrix::zeros(samples, n), DMatrix::zeros(samples, n), DMatrix::zeros(samples, n));
    let (mut a, mut b, mut c) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for i in 0..samples {
        motion.eval(0.01 * i as f64, &mut a, &mut b, &mut c);
        for k in 0..n {
            (q[(i, k)], qd[(i, k)], qdd[(i, k)]) = (a[k], b[k], c[k]);
        }
    }
    let wave = |w: f64| move |i: usize, k: usize| (w * i as f64 + 0.7 * k as f64).sin();
    let b = RecordBuilder::new(l.model.joint_names()).uniform(0.0, 100.0).q(q).qd(qd).qdd(qdd);
    b.tau(DMatrix::from_fn(samples, n, wave(0.013)))
        .gyro(DMatrix::from_fn(samples, 3, wave(0.011)) * 1e-3)
        .build()
        .unwrap()
        .0
}

/// The same with torques and gyro at times of their own.
fn own_times(record: &Record) -> Record {
    let times = |every: f64, count: usize| -> Vec<f64> {
        let t = (0..count).filter(|i| i % 9 != 4).map(|i| every * (i as f64 + 0.3 + 0.25 * (1.3 * i as f64).sin()));
        t.filter(|t| *t < record.time(record.samples() - 1)).collect()
    };
    let (a, b) = (times(0.013, 5000), times(0.031, 2000));
    let names = record.joint_names().to_vec();
    let wave = |w: f64| move |i: usize, k: usize| (w * i as f64 + 0.7 * k as f64).sin();
    let of = RecordBuilder::new(names).uniform(0.0, 100.0).q(record.q().clone()).qd(record.qd().unwrap().clone());
    let of = of.qdd(record.qdd().unwrap().clone()).tau(DMatrix::from_fn(a.len(), 7, wave(0.02)));
    let of = of.gyro(DMatrix::from_fn(b.len(), 3, wave(0.02)) * 1e-3);
    of.times(ChannelGroup::Torque, a).times(ChannelGroup::Gyro, b).build().unwrap().0
}

/// Rows of all streams are those of the Jacobian, bit for bit, each once.
fn agree(what: &str, e: &mut dyn Estimator, full: &[f64], selected: &[usize], least: usize) {
    let extra: Vec<f64> = e.nuisance().iter().enumerate().map(|(k, u)| 0.4 * u.size * (k as f64 + 0.3).sin()).collect();
    let (rows, columns) = (e.rows(), selected.len() + extra.len());
    let (mut r, mut j) = (vec![0.0; rows], DMatrix::zeros(rows, columns));
    e.jacobian(full, &extra, selected, &mut r, &mut j).unwrap();
    let mut alone = vec![0.0; rows];
    e.residuals(full, &extra, &mut alone).unwrap();
    assert_eq!(alone, r, "{what}");
    let (mut seen, mut blocks) = (vec![0; rows], 0);
    let mut block = RowBlock::default();
    for mut stream in e.streams(full, &extra, selected).unwrap() {
        while stream.next(&mut block).unwrap() {
            blocks += 1;
            assert_eq!(
                (block.residuals.len(), block.jacobian.shape()),
                (block.count(), (block.count(), columns)),
                "{what}"
            );
            for (at, from) in block.places() {
                for (k, row) in at.enumerate() {
                    seen[row] += 1;
                    assert_eq!(block.residuals[from + k], r[row], "{what}, row {row}");
                    assert_eq!(block.jacobian.row(from + k), j.row(row), "{what}, row {row}");
                }
            }
        }
    }
    assert!(blocks >= least && seen.iter().all(|s| *s == 1), "{what}: {blocks} blocks");
}

#[test]
fn blocks_hand_out_the_rows_of_the_jacobian_through_masks_ties_and_several_records() {
    let l = paper("slosh.toml");
    let record = any(&l, 1700);
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    // A link's mass, too: its table is made with the derivatives.
    let selected = select(&decls, &["base.mass", "base.h_y", "tank.*"]).unwrap();
    let links: Vec<usize> = selected[..2].iter().copied().chain([40]).chain(selected[2..].iter().copied()).collect();
    let oe = |record| OutputError::new(&l.model, record, &everything(2)).unwrap();
    agree("uniform", &mut oe(&record), &truth, &links, 4);
    let plain = Options { substeps: 1, ..Options::new(NOISE) };
    agree("plain", &mut OutputError::new(&l.model, &record, &plain).unwrap(), &truth, &selected, 4);
    let own = own_times(&record);
    agree("own times", &mut oe(&own), &truth, &selected, 4);
    let mut mask = Mask::all(record.samples(), l.model.nj());
    (0..1700).filter(|i| i % 7 < 4).for_each(|i| mask.tau.row_mut(i).fill(0.3));
    agree("mask", &mut Masked::new(oe(&record), &mask).unwrap(), &truth, &selected, 4);
    let mut mask = Mask::of_saturation(&own);
    mask.gyro.row_mut(30).fill(0.25);
    agree("mask by group", &mut Masked::by_group(oe(&own), &mask).unwrap(), &truth, &selected, 4);
    let tie = Affine::shared(&decls, &truth, "d", &["tank.d[*]"]).unwrap();
    let map = TieMap::new(&decls, &truth, vec![Box::new(tie) as Box<dyn Tie>]).unwrap();
    let (short, tied) = (map.start(), [0, 3, map.decls().len() - 1]);
    agree("ties", &mut Tied::new(oe(&record), map), &short, &tied, 4);
    let shared = Shared::new(&[("one", &decls[..]), ("two", &decls[..])], &["tank.mass"]).unwrap();
    let both = shared.gather(&[truth.clone(), truth.clone()]);
    let parts: Vec<Box<dyn Estimator + '_>> = vec![Box::new(oe(&record)), Box::new(oe(&own))];
    let selected = select(&shared.decls, &["base.mass", "*tank.*"]).unwrap();
    agree("records", &mut Several::new(&shared, parts), &both, &selected, 8);
    let rigid = l.model.without_appendages();
    let truth = Params::<f64>::nominal(&rigid).values().to_vec();
    agree("rigid", &mut Rda::new(&rigid, &record, &NOISE).unwrap(), &truth, &[0, 3, 40], 2);
    agree("rigid, own times", &mut Rda::new(&rigid, &own, &NOISE).unwrap(), &truth, &[0, 3, 40], 2);
}

/// Two records of the slosh case in one fit, with what is kept of a linearisation.
fn fit(l: &Loaded, records: &[Record; 2], jacobian: Jacobian, loss: Loss) -> Estimate {
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let shared = Shared::new(&[("first", &decls), ("second", &decls)], &["tank.mass"]).unwrap();
    let selected = select(&shared.decls, &["base.i_xx", "base.i_zz", "*tank.mass", "*tank.k*"]).unwrap();
    let options = Options { substeps: 1, gyro_bias: true, ..Options::new(NOISE) };
    let one = |record| -> Box<dyn Estimator + '_> { Box::new(OutputError::new(&l.model, record, &options).unwrap()) };
    let mut both = Several::new(&shared, records.iter().map(one).collect());
    let all = shared.gather(&[truth.clone(), truth]);
    let start = offset_start(&shared.decls, &all, &selected, 0.15, 2);
    estimate(&Request { jacobian, loss, ..Request::new(&shared.decls, &selected, &start) }, &mut both).unwrap()
}

#[test]
#[ignore = "full tier: 3 s"]
fn folded_fits_have_the_answer_of_kept_ones_and_the_same_bits_on_any_number_of_threads() {
    let l = paper("slosh.toml");
    let motion = planned(&l, 30.0, 10);
    let mut whole = exact(&l, &run(&l, &motion, 30.0));
    // Deterministic noise, so that there is a minimum to find.
    let rough = |i: usize, c: usize| ((12.9898 * (i * 11 + c) as f64).sin() * 43758.5453).fract();
    let b = RecordBuilder::new(whole.joint_names().to_vec()).uniform(0.0, 100.0);
    let (q, qd, qdd) = (whole.q().clone(), whole.qd().unwrap().clone(), whole.qdd().unwrap().clone());
    let tau = DMatrix::from_fn(whole.samples(), 7, |i, c| whole.tau()[(i, c)] + 0.17 * rough(i, c));
    let gyro = DMatrix::from_fn(whole.samples(), 3, |i, c| whole.gyro()[(i, c)] + 2.6e-4 * rough(i, c + 7));
    whole = b.q(q).qd(qd).qdd(qdd).tau(tau).gyro(gyro).build().unwrap().0;
    let records = [whole.window(0.0, 16.0).unwrap(), whole.window(0.0, 29.0).unwrap()];
    for loss in [Loss::Squares, Loss::HUBER] {
        let kept = fit(&l, &records, Jacobian::Kept, loss);
        let folded = [1, 2, 5].map(|threads| fit(&l, &records, Jacobian::Folded { threads }, loss));
        for other in &folded[1..] {
            assert_eq!((&other.values, &other.residuals), (&folded[0].values, &folded[0].residuals));
            assert_eq!((other.iterations, other.objective), (folded[0].iterations, folded[0].objective));
            assert_eq!((&other.parameters, &other.nuisance), (&folded[0].parameters, &folded[0].nuisance));
            assert_eq!(other.uncertainty.covariance, folded[0].uncertainty.covariance);
        }
        assert!(kept.status.is_converged() && folded[0].status.is_converged(), "{:?}", folded[0].status);
        println!("{loss:?}: {} linearisations kept, {} folded", kept.iterations, folded[0].iterations);
        for (a, b) in
            kept.parameters.iter().chain(&kept.nuisance).zip(folded[0].parameters.iter().chain(&folded[0].nuisance))
        {
            let (sa, sb) = (a.std.unwrap(), b.std.unwrap());
            assert!((a.value - b.value).abs() < 1e-4 * sa && (sa / sb - 1.0).abs() < 1e-6, "{a:?} {b:?}");
        }
    }
}

/// Most bytes at once while all rows are folded into a triangle.
fn peak(l: &Loaded, record: &Record, selected: &[usize]) -> u64 {
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let mut oe = OutputError::new(&l.model, record, &Options { substeps: 1, ..Options::new(NOISE) }).unwrap();
    let mut rows = 0;
    let info = measure(|| {
        let mut block = RowBlock::default();
        let mut triangle = TallQr::new(selected.len());
        for mut stream in oe.streams(&truth, &[], selected).unwrap() {
            while stream.next(&mut block).unwrap() {
                triangle.push(&block.jacobian).unwrap();
            }
        }
        rows = triangle.finish().unwrap().1;
    });
    assert_eq!(rows, oe.rows());
    info.bytes_max
}

#[test]
#[ignore = "full tier: 4 s"]
fn memory_of_a_linearisation_does_not_grow_with_the_record() {
    let l = paper("slosh.toml");
    let decls = l.model.param_decls();
    let selected = select(&decls, &["base.*", "tank.*"]).unwrap();
    // Beyond the samples up to which tables are kept.
    let long = any(&l, 100_000);
    let short = long.window(0.0, 700.0).unwrap();
    let (a, b) = (peak(&l, &short, &selected), peak(&l, &long, &selected));
    println!("{a} bytes for {} samples, {b} for {}", short.samples(), long.samples());
    assert!(b as f64 <= 1.02 * a as f64 && b < 16 << 20, "{a} {b}");
    // The rows are those of a record short enough for a table of its own.
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let of = |record: &Record| {
        let mut oe = OutputError::new(&l.model, record, &everything(1)).unwrap();
        let mut r = vec![0.0; oe.rows()];
        let extra = vec![0.0; oe.nuisance().len()];
        oe.residuals(&truth, &extra, &mut r).unwrap();
        r
    };
    let (r, s) = (of(&short), of(&long.window(0.0, 600.0).unwrap()));
    // But for the last, whose readings are late or early by nothing, and which are the end of one of the two.
    assert_eq!(r[..s.len() - 60], s[..s.len() - 60]);
    // A fit holds residuals, never the rows.
    let start = offset_start(&decls, &truth, &selected, 0.02, 3);
    let most = |jacobian: Jacobian, record: &Record| {
        let settings = Settings { max_iterations: 1, ..Settings::default() };
        let request =
            Request { jacobian, settings, coarse: false, near_end: false, ..Request::new(&decls, &selected, &start) };
        let mut oe = OutputError::new(&l.model, record, &Options { substeps: 1, ..Options::new(NOISE) }).unwrap();
        measure(|| drop(attempt(&request, &mut oe).unwrap())).bytes_max
    };
    let small = long.window(0.0, 660.0).unwrap();
    let rows = 10.0 * small.samples() as f64;
    let folded = most(Jacobian::Folded { threads: 1 }, &small) as f64 / rows;
    // Residuals of the point, the trial, the acceleration and the last two linearisations, and the buffers of a block.
    assert!(folded < 96.0, "{folded} bytes per row");
    let kept = most(Jacobian::Kept, &small) as f64 / rows;
    println!("{folded} bytes per row folded, {kept} kept");
    assert!(kept > folded + 8.0 * selected.len() as f64, "{kept}");
}
