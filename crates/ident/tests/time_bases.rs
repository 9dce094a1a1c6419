//! Records whose channels have sample times of their own, against uniform ones.

use crate::common::estimate;
use crate::common::*;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{Drive, SimOptions, State, Trace, simulate};
use ff_least_squares::Settings;
use ff_mission::Loaded;
use ff_model::Params;
use ff_records::{ChannelGroup, Record, RecordBuilder};
use ff_testkit::motion::Sines;
use ident::estimate::smoothed;
use ident::motion::spectral_motion;
use ident::parameters::select;
use ident::*;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const NOISE: Noise = Noise { torque: 0.1, gyro: 1.5e-4 };
const SECONDS: f64 = 30.0;

/// A smooth motion, and what sensors would read of it every millisecond.
fn fine(l: &Loaded) -> (Sines, Trace) {
    let motion = Sines::new(5, l.model.nj(), SECONDS, 0.6);
    let o = SimOptions { duration_s: SECONDS, step_s: 1e-3, sample_s: 1e-3 };
    let p = Params::nominal(&l.model);
    let trace = simulate(&l.model, &p, &State::zero(&l.model), &Drive::Prescribed(&motion), &o).unwrap();
    (motion, trace)
}

/// Milliseconds about `every` apart, off by up to a `jitter`-th of that, of which every `lost`-th is missing; from the first to the last.
fn stamps(every: usize, jitter: f64, lost: usize) -> Vec<usize> {
    let last = (SECONDS * 1e3) as usize;
    let mut at = vec![0];
    for i in (1..last / every).filter(|i| i % lost != 2) {
        let off = jitter * every as f64 * (2.7 * i as f64 + 0.3 * (i as f64).sqrt()).sin();
        at.push((every * i).saturating_add_signed(off.round() as isize));
    }
    at.push(last);
    at
}
fn seconds(at: &[usize]) -> Vec<f64> {
    at.iter().map(|k| *k as f64 * 1e-3).collect()
}
fn rows(of: &DMatrix<f64>, at: &[usize]) -> DMatrix<f64> {
    of.select_rows(at)
}

/// A record of the motion logged about every 10 ms, with torques and gyro at these milliseconds.
fn stamped(l: &Loaded, fine: &Trace, grid_hz: f64, motion: &[usize], torque: &[usize], gyro: &[usize]) -> Record {
    let rates = fine.gyro();
    let b = RecordBuilder::new(l.model.joint_names()).grid(grid_hz).allow("Data::Stuck");
    let b = b.times(ChannelGroup::Motion, seconds(motion)).q(rows(&fine.q, motion)).qd(rows(&fine.qd, motion));
    let b = b.qdd(rows(&fine.qdd, motion)).times(ChannelGroup::Torque, seconds(torque)).tau(rows(&fine.tau, torque));
    b.times(ChannelGroup::Gyro, seconds(gyro)).gyro(rows(&rates, gyro)).build().unwrap().0
}

fn uniform(l: &Loaded, fine: &Trace) -> Record {
    let at: Vec<usize> = (0..=(SECONDS * 100.0) as usize).map(|i| 10 * i).collect();
    let b = RecordBuilder::new(l.model.joint_names()).uniform(0.0, 100.0).allow("Data::Stuck");
    let b = b.q(rows(&fine.q, &at)).qd(rows(&fine.qd, &at)).qdd(rows(&fine.qdd, &at));
    b.tau(rows(&fine.tau, &at)).gyro(rows(&fine.gyro(), &at)).build().unwrap().0
}

/// Step of sixth differences (ms), over which `h^6 f^(6)` is larger than they are by at most `(x / sin x)^6`, `x = pi f h`: 0.7 % up to the
/// 1.5 Hz at which third products of the motion's sines (0.5 Hz) end.
const FINE: usize = 20;

/// `h^6 max|f^(6)|` of the grid interval `h = step` (ms) over six grid intervals on both sides of a time, for every channel.
fn sixth(of: &DMatrix<f64>, step: usize) -> impl Fn(usize, usize) -> f64 {
    const BINOMIAL: [f64; 7] = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0];
    let at = |i: usize, c: usize| -> f64 { (0..7).map(|a| BINOMIAL[a] * of[((i + a) * FINE, c)]).sum::<f64>().abs() };
    let count = (of.nrows() - 1) / FINE - 5;
    let d = DMatrix::from_fn(count, of.ncols(), at);
    let (reach, scale) = (6 * step / FINE, 1.007 * (step as f64 / FINE as f64).powi(6));
    move |ms: usize, c: usize| {
        let mid = ms / FINE;
        let near = mid.saturating_sub(reach + 3)..(mid + reach).min(count);
        scale * near.map(|i| d[(i, c)]).fold(0.0, f64::max)
    }
}

#[test]
fn two_rates_with_jitter_and_losses_give_the_estimates_of_a_uniform_record_to_the_bound_of_the_docs() {
    const STEP: usize = 100; // of the grid (ms)
    let l = paper("slosh.toml");
    let (_, fine) = fine(&l);
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = select(&decls, &["base.i_xx", "base.i_yy", "base.i_zz", "tank.mass", "tank.k[0]"]).unwrap();
    let (motion, torque, gyro) = (stamps(10, 0.3, 9), stamps(110, 0.2, 8), stamps(190, 0.25, 5));
    let record = stamped(&l, &fine, 10.0, &motion, &torque, &gyro);
    assert!(record.dt() == 0.1 && record.samples() == 301 && !record.is_uniform());
    let start = ident::parameters::offset_start(&decls, &truth, &selected, 0.1, 3);
    let settings = Settings { decrement_tolerance: 1e-20, ..Settings::default() };
    let fit = |record: &Record, substeps: usize| {
        let mut oe = OutputError::new(&l.model, record, &Options { substeps, ..Options::new(NOISE) }).unwrap();
        let request = Request { settings: settings.clone(), ..Request::new(&decls, &selected, &start) };
        estimate(&request, &mut oe).unwrap()
    };
    let (even, own) = (fit(&uniform(&l, &fine), 2), fit(&record, 20));
    // Errors of the readings at the truth: they are those of the interpolation.
    let mut oe = OutputError::new(&l.model, &record, &Options { substeps: 20, ..Options::new(NOISE) }).unwrap();
    let (mut e, mut j) = (vec![0.0; oe.rows()], DMatrix::zeros(oe.rows(), selected.len()));
    oe.jacobian(&truth, &[], &selected, &mut e, &mut j).unwrap();
    let rates = fine.gyro();
    let (of_torque, of_gyro) = (sixth(&fine.tau, STEP), sixth(&rates, STEP));
    let end = (SECONDS * 1e3) as usize;
    let constant = |ms: usize| 1.0 / if (2 * STEP..=end - 2 * STEP).contains(&ms) { 204.8 } else { 42.5 };
    let mut bounds = Vec::new();
    torque.iter().for_each(|&ms| (0..7).for_each(|c| bounds.push(constant(ms) * of_torque(ms, c) / NOISE.torque)));
    gyro.iter().for_each(|&ms| (0..3).for_each(|c| bounds.push(constant(ms) * of_gyro(ms, c) / NOISE.gyro)));
    assert_eq!(bounds.len(), e.len());
    let above = (0..e.len()).filter(|&i| e[i].abs() > bounds[i] + 1e-6).count();
    let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let most = (0..e.len()).map(|i| e[i].abs() / (bounds[i] + 1e-6)).fold(0.0, f64::max);
    println!(
        "largest part of a bound: {most}; readings: {:e} (bound {:e}), {above} of {} above",
        norm(&e),
        norm(&bounds),
        e.len()
    );
    assert!(above == 0 && norm(&e) > 0.05 * norm(&bounds));
    // What the errors make of the estimates: -J^+ e, and at most their norm in standard deviations.
    let e = DVector::from_vec(e);
    let scales: Vec<f64> = j.column_iter().map(|c| c.norm()).collect();
    j.column_iter_mut().zip(&scales).for_each(|(mut c, s)| c.unscale_mut(*s));
    let moved = ff_linalg::least_squares(&j, &e).unwrap();
    for (k, (a, b)) in own.parameters.iter().zip(&even.parameters).enumerate() {
        let (sigma, off) = (a.std.unwrap(), a.value - b.value);
        println!("{}: {off:e}, to first order {:e}, bound {:e}", a.name, -moved[k] / scales[k], sigma * norm(&bounds));
        assert!(off.abs() < sigma * norm(&bounds), "{}: {off:e}", a.name);
        assert!((off + moved[k] / scales[k]).abs() < 0.02 * sigma * e.norm(), "{}: {off:e}", a.name);
        assert!((b.value - truth[selected[k]]).abs() < 0.02 * sigma * e.norm(), "{}: {}", a.name, b.value);
    }
}

#[test]
fn readings_on_a_fine_grid_are_those_of_a_uniform_record() {
    // Stamps at the instants of the grid: the same problem, listed in another order.
    let l = paper("slosh.toml");
    let (_, fine) = fine(&l);
    let at: Vec<usize> = (0..=(SECONDS * 100.0) as usize).map(|i| 10 * i).collect();
    let (own, even) = (stamped(&l, &fine, 100.0, &at, &at, &at), uniform(&l, &fine));
    assert_eq!((own.samples(), own.dt()), (even.samples(), even.dt()));
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let options = Options { gyro_bias: true, torque_delay: true, initial_state: true, ..Options::new(NOISE) };
    let made = |record: &Record| {
        let mut oe = OutputError::new(&l.model, record, &options).unwrap();
        let extra: Vec<f64> = oe.nuisance().iter().enumerate().map(|(k, u)| 0.3 * u.size * (k as f64).cos()).collect();
        let (mut r, mut j) = (vec![0.0; oe.rows()], DMatrix::zeros(oe.rows(), 2 + extra.len()));
        oe.jacobian(&truth, &extra, &[0, 4], &mut r, &mut j).unwrap();
        (r, j)
    };
    let ((r, j), (s, k)) = (made(&own), made(&even));
    let n = l.model.nj();
    let scales: Vec<f64> = j.column_iter().map(|c| c.amax()).collect();
    for i in 0..at.len() {
        for c in 0..n + 3 {
            let row = if c < n { i * n + c } else { at.len() * n + i * 3 + c - n };
            let even = i * (n + 3) + c;
            assert!((r[row] - s[even]).abs() < 1e-7, "sample {i} channel {c}");
            for (p, scale) in scales.iter().enumerate() {
                assert!((j[(row, p)] - k[(even, p)]).abs() < 1e-9 * scale, "sample {i} channel {c} column {p}");
            }
        }
    }
}

#[test]
fn derivatives_with_times_delays_and_biases_are_those_of_the_residuals() {
    let l = paper("slosh.toml");
    let (_, fine) = fine(&l);
    let record = stamped(&l, &fine, 25.0, &stamps(10, 0.3, 9), &stamps(60, 0.3, 7), &stamps(110, 0.2, 6));
    let record = record.window(4.0, 13.0).unwrap();
    let options = Options {
        substeps: 2,
        gyro_bias: true,
        torque_bias: true,
        initial_state: true,
        torque_delay: true,
        gyro_delay: true,
        ..Options::new(NOISE)
    };
    let mut oe = OutputError::new(&l.model, &record, &options).unwrap();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let decls = l.model.param_decls();
    let selected = select(&decls, &["base.mass", "tank.*"]).unwrap();
    let unknowns = oe.nuisance();
    let extra: Vec<f64> = unknowns.iter().enumerate().map(|(k, u)| u.size * (0.3 + 0.7 * (k as f64).sin())).collect();
    let rows = oe.rows();
    assert_eq!(rows, 7 * record.tau().nrows() + 3 * record.gyro().nrows());
    let (mut r, mut j) = (vec![0.0; rows], DMatrix::zeros(rows, selected.len() + extra.len()));
    oe.jacobian(&truth, &extra, &selected, &mut r, &mut j).unwrap();
    let mut at = |x: &[f64]| {
        let mut r = vec![0.0; rows];
        oe.residuals(&x[..truth.len()], &x[truth.len()..], &mut r).unwrap();
        r
    };
    let all = [truth.clone(), extra.clone()].concat();
    assert_eq!(at(&all), r);
    let sizes = ident::parameters::sizes(&decls, &truth);
    for c in 0..j.ncols() {
        let (place, h) = match selected.get(c) {
            Some(&i) => (i, 1e-5 * sizes[i]),
            None => (truth.len() + c - selected.len(), 1e-3 * unknowns[c - selected.len()].size),
        };
        let mut moved = |h: f64| {
            let mut x = all.clone();
            x[place] += h;
            at(&x)
        };
        let (a, b) = (moved(h), moved(-h));
        let worst = (0..rows).map(|i| (j[(i, c)] - (a[i] - b[i]) / (2.0 * h)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-5 * j.column(c).amax(), "column {c}: {worst:e} of {:e}", j.column(c).amax());
    }
}

#[test]
fn the_look_at_less_data_has_rows_of_all_data() {
    let l = paper("slosh.toml");
    let (_, fine) = fine(&l);
    // The last readings lie behind the last instant of the thinner grid, and the motion reaches to its end.
    let record = stamped(&l, &fine, 99.7, &stamps(10, 0.3, 9), &stamps(20, 0.2, 8), &stamps(30, 0.25, 5));
    let oe = OutputError::new(&l.model, &record, &Options { substeps: 1, ..Options::new(NOISE) });
    let mut oe = oe.unwrap();
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = select(&decls, &["base.*", "tank.mass", "tank.k[*]"]).unwrap();
    let values = ident::parameters::offset_start(&decls, &truth, &selected, 0.1, 3);
    let mut all = vec![0.0; oe.rows()];
    oe.residuals(&values, &[], &mut all).unwrap();
    let mut thin = oe.coarse(&values).unwrap();
    assert_eq!(thin.rows.len(), thin.estimator.rows());
    let mut some = vec![0.0; thin.rows.len()];
    thin.estimator.residuals(&values, &[], &mut some).unwrap();
    let picked = DVector::from_iterator(some.len(), thin.rows.iter().map(|&i| all[i]));
    let apart = (&picked - DVector::from_vec(some)).norm();
    assert!(2 * picked.len() <= all.len() && apart < 0.1 * picked.norm(), "{apart:e} of {:e}", picked.norm());
}

#[test]
fn noisy_positions_with_jitter_and_losses_are_fitted_at_their_times() {
    let l = paper("slosh.toml");
    let (motion, fine) = fine(&l);
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut noisy = |of: DMatrix<f64>, sigma: f64| {
        of.map(|x| {
            let e: f64 = StandardNormal.sample(&mut rng);
            x + sigma * e
        })
    };
    let (at, torque, gyro) = (stamps(10, 0.35, 7), stamps(20, 0.3, 9), stamps(50, 0.3, 6));
    let b = RecordBuilder::new(l.model.joint_names()).times(ChannelGroup::Motion, seconds(&at));
    let b = b.q(noisy(rows(&fine.q, &at), 6e-6)).times(ChannelGroup::Torque, seconds(&torque));
    let b = b.tau(noisy(rows(&fine.tau, &torque), NOISE.torque)).times(ChannelGroup::Gyro, seconds(&gyro));
    let (record, warned) = b.gyro(noisy(rows(&fine.gyro(), &gyro), NOISE.gyro)).build().unwrap();
    // The lost samples are named, none is made up.
    assert!(warned.has("Data::Gap") && !warned.has("Data::Resampled"), "{warned}");
    assert_eq!((record.q().nrows(), record.tau().nrows()), (at.len(), torque.len()));
    let fit = spectral_motion(&record).unwrap();
    for s in &fit.noise {
        assert!((s / 6e-6 - 1.0).abs() < 0.12, "{s:e}");
    }
    let n = l.model.nj();
    let (mut a, mut b) = (vec![0.0; 3 * n], vec![0.0; 3 * n]);
    let mut worst = 0.0f64;
    for k in 100..2900 {
        for (m, x) in [(&motion as &dyn JointMotion, &mut a), (&fit.fit.motion, &mut b)] {
            let (q, rest) = x.split_at_mut(n);
            let (qd, qdd) = rest.split_at_mut(n);
            m.eval(0.01 * k as f64, q, qd, qdd);
        }
        worst = (2 * n..3 * n).map(|i| (a[i] - b[i]).abs()).fold(worst, f64::max);
    }
    println!("knots {} s, worst acceleration {worst:e} rad/s^2", fit.fit.spacing);
    assert!(worst < 1e-3, "{worst:e}");
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = select(&decls, &["base.i_xx", "base.i_yy", "base.i_zz", "tank.mass", "tank.k[0]"]).unwrap();
    let start = ident::parameters::offset_start(&decls, &truth, &selected, 0.1, 3);
    let mut oe = OutputError::new(&l.model, &record, &Options::new(NOISE)).unwrap();
    let e = estimate(&Request::new(&decls, &selected, &start), &mut oe).unwrap();
    println!("chi2 {} {:?}", e.chi2_per_dof, e.status);
    assert!((e.chi2_per_dof - 1.0).abs() < 0.05, "{}", e.chi2_per_dof);
    for (p, &i) in e.parameters.iter().zip(&selected) {
        let off = (p.value - truth[i]) / p.std.unwrap();
        assert!(off.abs() < 4.0, "{}: {off}", p.name);
    }
}

#[test]
fn the_rigid_estimator_takes_times_and_linear_ones_say_what_to_do() {
    let l = paper("slosh.toml");
    let model = l.model.without_appendages();
    let motion = Sines::new(5, model.nj(), SECONDS, 0.6);
    let o = SimOptions { duration_s: SECONDS, step_s: 1e-3, sample_s: 1e-3 };
    let p = Params::nominal(&model);
    let fine = simulate(&model, &p, &State::zero(&model), &Drive::Prescribed(&motion), &o).unwrap();
    let rigid = Loaded { model, ..l };
    let (at, torque, gyro) = (stamps(10, 0.3, 9), stamps(50, 0.3, 7), stamps(70, 0.2, 6));
    let record = stamped(&rigid, &fine, 50.0, &at, &torque, &gyro);
    let mut rda = Rda::new(&rigid.model, &record, &NOISE).unwrap();
    let mut r = vec![0.0; rda.rows()];
    rda.residuals(p.values(), &[], &mut r).unwrap();
    // In units of the noise: what interpolation of the gyro over 0.14 s leaves.
    let worst = r.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    println!("worst {worst:e} of {} rows", r.len());
    assert!(r.len() == 7 * torque.len() && worst < 0.02, "{worst:e}");
    let e = smoothed(&record, 1.0).unwrap_err().to_string();
    assert!(e.contains("joint motion has sample times of its own") && e.contains("resampled"), "{e}");
    let even = record.resampled().unwrap();
    assert!(even.is_uniform() && even.samples() == record.samples());
    let apart = (even.tau() - rows(&fine.tau, &(0..even.samples()).map(|i| 20 * i).collect::<Vec<_>>())).amax();
    assert!(apart < 1e-3 * fine.tau.amax(), "{apart:e}");
}

/// The beginning of a record with sample times of its own is the rows up to there: predictions next to its end are interpolated from one side.
#[test]
fn the_beginning_of_a_stamped_record_is_its_first_rows() {
    let l = paper("slosh.toml");
    let (_, fine) = fine(&l);
    let record = stamped(&l, &fine, 100.0, &stamps(10, 0.4, 11), &stamps(20, 0.3, 7), &stamps(10, 0.2, 13));
    let options = Options { substeps: 2, initial_state: true, ..Options::new(NOISE) };
    let mut whole = OutputError::new(&l.model, &record, &options).unwrap();
    let mut full = Params::<f64>::nominal(&l.model).values().to_vec();
    full[0] *= 1.13;
    let extra: Vec<f64> = whole.nuisance().iter().enumerate().map(|(k, u)| 0.3 * u.size * (k as f64).cos()).collect();
    let mut all = vec![0.0; whole.rows()];
    whole.residuals(&full, &extra, &mut all).unwrap();
    let mut begun = whole.beginning(0.37).unwrap();
    let mut some = vec![0.0; begun.estimator.rows()];
    begun.estimator.residuals(&full, &extra, &mut some).unwrap();
    let share = some.len() as f64 / all.len() as f64;
    assert!((share - 0.37).abs() < 0.01 && begun.rows.len() == some.len(), "{share}");
    let size = (all.iter().map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt();
    let apart = some.iter().zip(&begun.rows).map(|(x, &i)| (x - all[i]).abs());
    let far = apart.clone().filter(|a| *a > 1e-9 * size).count();
    assert!(apart.fold(0.0, f64::max) < 1e-3 * size && far < 60, "{far} of {}", some.len());
}
