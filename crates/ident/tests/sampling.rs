//! Draws from posteriors that are known by other means.

use crate::common::{estimate, paper, planned};
use ff_dynamics::{Drive, SimOptions, State, simulate};
use ff_least_squares::EvalError;
use ff_model::{ParamDecl, ParamGroup, Params};
use ff_records::RecordBuilder;
use ident::belief::{LIMIT95, PriorRow, Priors, Unknown, profile};
use ident::compose::Shared;
use ident::estimate::{Between, Coarse, Estimate, Estimator, Request};
use ident::parameters::select;
use ident::sample::{ChainSettings, Draws, ESS_LEAST, Frame, LogDensity, PosteriorDensity, R_HAT_MOST, SampleError};
use ident::sample::{
    Diagnosis, Trajectories, Way, Weights, ess_bulk, ess_tail, hdi, quantile, r_hat, resampled, sample,
};
use ident::{Noise, Options, OutputError, Several};
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

const SETTINGS: ChainSettings =
    ChainSettings { chains: 4, warm_up: 200, draws: 1000, trajectories: Trajectories::Short, threads: 2, seed: 7 };

fn free(name: &str) -> ParamDecl {
    let inf = f64::INFINITY;
    ParamDecl { bounds: (-inf, inf), group: ParamGroup::Free, ..ParamDecl::positive(name, "m", 1.0) }
}

/// Residuals as a function of parameters and nuisance unknowns, with derivatives by columns.
type Rows = fn(&[f64], &[f64]) -> Vec<(f64, Vec<f64>)>;

#[derive(Clone)]
struct Formula {
    rows: Rows,
    count: usize,
    nuisance: usize,
    /// Whether all rows can be had as a part of themselves, around which draws can be solved for.
    looks: bool,
}

impl Formula {
    const fn new(rows: Rows, count: usize, nuisance: usize) -> Self {
        Self { rows, count, nuisance, looks: false }
    }
}

impl Estimator for Formula {
    fn rows(&self) -> usize {
        self.count
    }
    fn nuisance(&self) -> Vec<Unknown> {
        (0..self.nuisance).map(|k| Unknown { name: format!("bias.{k}"), unit: "m".into(), size: 0.3 }).collect()
    }
    fn residuals(&mut self, p: &[f64], e: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        r.iter_mut().zip((self.rows)(p, e)).for_each(|(r, row)| *r = row.0);
        Ok(())
    }
    fn jacobian(
        &mut self,
        p: &[f64],
        e: &[f64],
        _: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        for (i, (value, slopes)) in (self.rows)(p, e).into_iter().enumerate() {
            r[i] = value;
            slopes.into_iter().enumerate().for_each(|(k, s)| j[(i, k)] = s);
        }
        Ok(())
    }
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        let rows = (0..self.count).collect();
        let all = Coarse { estimator: Box::new(self.clone()), rows, between: Between::same(self.count) };
        (self.looks && share >= 1.0).then_some(all)
    }
}

fn drawn(request: &Request<'_>, of: &Formula, settings: &ChainSettings) -> (Estimate, Draws) {
    let at = estimate(request, &mut of.clone()).unwrap();
    let draws = sample(request, &at, || Ok(Box::new(of.clone())), settings, None).unwrap();
    (at, draws)
}

fn converged(d: &Draws) {
    for k in 0..d.names.len() {
        let of = d.diagnosis(k);
        assert!(of.r_hat < R_HAT_MOST && of.ess_bulk.min(of.ess_tail) > ESS_LEAST, "{}: {of:?}", d.names[k]);
    }
}

/// Mean and variance of all draws.
fn moments(d: &Draws, k: usize) -> (f64, f64) {
    let all = d.of(k).concat();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    (mean, all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (all.len() - 1) as f64)
}

/// A line read at five places with one bias that a reading tells, strongly correlated, and a prior on the slope: all is Gaussian.
#[test]
fn draws_of_a_linear_problem_have_its_covariance() {
    let rows: Rows = |p, e| {
        let at = |i: usize| 10.0 + i as f64;
        let mut all: Vec<(f64, Vec<f64>)> = (0..5)
            .map(|i| ((p[0] + p[1] * at(i) + e[0] - 3.0 * i as f64) / 0.2, vec![5.0, 5.0 * at(i), 5.0]))
            .collect();
        all.push((e[0] / 0.5, vec![0.0, 0.0, 2.0]));
        all
    };
    let of = Formula::new(rows, 6, 1);
    let decls = [free("a"), free("b")];
    let priors = Priors::default().with(PriorRow { column: 1, mean: 2.9, sigma: 0.05 });
    let request = Request { priors, ..Request::new(&decls, &[0, 1], &[-29.0, 2.9]) };
    let (at, draws) = drawn(&request, &of, &SETTINGS);
    converged(&draws);
    // By hand: (J^T J + prior)^-1.
    let mut j = DMatrix::zeros(7, 3);
    for (i, (_, slopes)) in rows(&[0.0; 2], &[0.0]).into_iter().enumerate() {
        slopes.into_iter().enumerate().for_each(|(k, s)| j[(i, k)] = s);
    }
    j[(6, 1)] = 1.0 / 0.05;
    let exact = (j.transpose() * &j).try_inverse().unwrap();
    for k in 0..3 {
        let (mean, variance) = moments(&draws, k);
        let value = if k < 2 { at.parameters[k].value } else { at.nuisance[0].value };
        assert!((mean - value).abs() < 0.1 * exact[(k, k)].sqrt(), "{k}: {mean} {value}");
        assert!((variance / exact[(k, k)] - 1.0).abs() < 0.12, "{k}: {variance} {}", exact[(k, k)]);
        let sorted = draws.sorted(k);
        let width = quantile(&sorted, 0.975) - quantile(&sorted, 0.025);
        assert!((width / (2.0 * 1.959_964 * exact[(k, k)].sqrt()) - 1.0).abs() < 0.06);
    }
    // The same draws on one thread, others for another seed.
    let alone = drawn(&request, &of, &ChainSettings { threads: 1, ..SETTINGS }).1;
    assert_eq!(alone, draws);
    assert!(drawn(&request, &of, &ChainSettings { seed: 8, ..SETTINGS }).1 != draws);
}

/// `x ~ N(5, 1)`, `y | x ~ N(20 + (x - 5)^2 / 2, 1)`: the mean of y is 20.5, its variance 1.5, where the fit says 20 and 1.
const BENT: Rows = |p, _| {
    let x = p[0] - 5.0;
    vec![(x, vec![1.0, 0.0]), (p[1] - 20.0 - 0.5 * x * x, vec![-x, 1.0])]
};

/// Moments and quantiles of [`BENT`].
fn has_the_marginals_of_bent(draws: &Draws) {
    let ((mx, vx), (my, vy)) = (moments(draws, 0), moments(draws, 1));
    assert!((mx - 5.0).abs() < 0.08 && (vx - 1.0).abs() < 0.1, "{mx} {vx}");
    assert!((my - 20.5).abs() < 0.1 && (vy - 1.5).abs() < 0.25, "{my} {vy}");
    // Quantiles of y by numerical integration over x.
    let sorted = draws.sorted(1);
    let normal = |x: f64| (-0.5 * x * x).exp() / core::f64::consts::TAU.sqrt();
    for p in [0.05, 0.5, 0.95] {
        let q = quantile(&sorted, p);
        // P(y < q) = int phi(x) Phi(q - 20 - x^2 / 2) dx, the inner one as a sum as well.
        let h = 0.01;
        let mut below = 0.0;
        for i in -600..600 {
            let x = (f64::from(i) + 0.5) * h;
            let to = q - 20.0 - 0.5 * x * x;
            let steps = 400;
            let inner: f64 = if to < -8.0 {
                0.0
            } else {
                let w = (to.min(8.0) + 8.0) / f64::from(steps);
                (0..steps).map(|k| normal(-8.0 + (f64::from(k) + 0.5) * w) * w).sum()
            };
            below += normal(x) * inner * h;
        }
        assert!((below - p).abs() < 0.02, "{p}: {below}");
    }
}

#[test]
fn draws_of_a_bent_ridge_have_its_marginals() {
    let decls = [free("x"), free("y")];
    let request = Request::new(&decls, &[0, 1], &[5.1, 20.1]);
    let settings = ChainSettings { draws: 4000, trajectories: Trajectories::Long, ..SETTINGS };
    let (at, draws) = drawn(&request, &Formula::new(BENT, 2, 0), &settings);
    converged(&draws);
    assert!((at.parameters[1].std.unwrap() - 1.0).abs() < 1e-3);
    assert_eq!((draws.way, draws.trajectories, draws.weighed), (Way::AllRows, Trajectories::Long, None));
    has_the_marginals_of_bent(&draws);
}

/// Where its rows are two coordinates in which it is straight, every solution is a draw, with the weight of all others.
#[test]
fn a_bent_ridge_that_is_straight_in_its_rows_is_drawn_by_solving() {
    let decls = [free("x"), free("y")];
    let request = Request::new(&decls, &[0, 1], &[5.1, 20.1]);
    let of = Formula { looks: true, ..Formula::new(BENT, 2, 0) };
    let (_, draws) = drawn(&request, &of, &ChainSettings { draws: 2000, ..SETTINGS });
    converged(&draws);
    let weighed = draws.weighed.unwrap();
    assert_eq!((draws.way, draws.divergences, draws.predictions), (Way::Solved, 0, 8000));
    assert!(weighed.effective > 0.999 * 8000.0, "{weighed:?}");
    has_the_marginals_of_bent(&draws);
    // The same on one thread, others for another seed.
    let settings = ChainSettings { draws: 300, ..SETTINGS };
    let some = drawn(&request, &of, &settings).1;
    assert_eq!(some, drawn(&request, &of, &ChainSettings { threads: 1, ..settings }).1);
    assert!(some != drawn(&request, &of, &ChainSettings { seed: 8, ..settings }).1);
}

/// Rows that are not straight in anything, a parameter with an edge and a prior: weights are what make the draws those of the posterior.
/// Marginals against a sum over a grid.
#[test]
fn weighed_draws_of_rows_that_stay_bent_have_the_marginals_of_the_posterior() {
    let rows: Rows = |p, _| {
        let (a, b) = (p[0], p[1]);
        let (s, c) = (1.3 * b).sin_cos();
        vec![
            ((a * c - 0.9) / 0.35, vec![c / 0.35, -1.3 * a * s / 0.35]),
            ((a * s - 0.6) / 0.5, vec![s / 0.5, 1.3 * a * c / 0.5]),
            ((a * a * b - 0.5) / 0.9, vec![2.0 * a * b / 0.9, a * a / 0.9]),
        ]
    };
    let of = Formula { looks: true, ..Formula::new(rows, 3, 0) };
    let decls = [ParamDecl::positive("a", "m", 1.0), free("b")];
    let priors = Priors::default().with(PriorRow { column: 1, mean: 0.7, sigma: 0.4 });
    let request = Request { priors, ..Request::new(&decls, &[0, 1], &[1.0, 0.5]) };
    let (at, draws) = drawn(&request, &of, &ChainSettings { draws: 3000, ..SETTINGS });
    converged(&draws);
    let weighed = draws.weighed.unwrap();
    assert_eq!(draws.way, Way::Solved);
    assert!(weighed.effective < 0.95 * 12000.0 && weighed.pareto_k.unwrap() < 0.7, "{weighed:?}");
    let (n, h) = (600, 0.01);
    let mut sums = [[0.0; 3]; 2];
    for i in 0..n {
        for j in 0..n {
            let at = [(f64::from(i) + 0.5) * h, (f64::from(j) + 0.5) * h - 2.0];
            let k = (at[1] - 0.7) / 0.4;
            let cost: f64 = rows(&at, &[]).iter().map(|r| r.0 * r.0).sum::<f64>() + k * k;
            for (s, x) in sums.iter_mut().zip(at) {
                (0..3).for_each(|m| s[m] += x.powi(m as i32) * (-0.5 * cost).exp());
            }
        }
    }
    let mut off = [0.0; 2];
    for (k, [total, first, second]) in sums.into_iter().enumerate() {
        let (mean, variance) = moments(&draws, k);
        let (exact, spread) = (first / total, second / total - (first / total).powi(2));
        assert!((mean - exact).abs() < 0.05 * spread.sqrt(), "{k}: {mean} {exact}");
        assert!((variance / spread - 1.0).abs() < 0.08, "{k}: {variance} {spread}");
        off[k] = (at.parameters[k].value - exact).abs() / spread.sqrt();
    }
    // The fit's are not these.
    assert!(off[0].max(off[1]) > 0.1, "{off:?}");
}

/// Where what is asked for cannot be reached from most draws, chains take over.
#[test]
fn where_few_draws_have_a_solution_chains_are_drawn() {
    let rows: Rows = |p, _| {
        let (x, e) = (p[0], (-0.5 * p[0] * p[0]).exp());
        vec![(3.0 * x * e - 0.5, vec![3.0 * (1.0 - x * x) * e]), (0.0, vec![0.0])]
    };
    let of = Formula { looks: true, ..Formula::new(rows, 2, 0) };
    let decls = [free("x")];
    let priors = Priors::default().with(PriorRow { column: 0, mean: 0.0, sigma: 1.5 });
    let request = Request { priors, ..Request::new(&decls, &[0], &[0.1]) };
    let (_, draws) = drawn(&request, &of, &ChainSettings { draws: 4000, ..SETTINGS });
    assert_ne!(draws.way, Way::Solved);
    converged(&draws);
    // Its moments, by sums: half of it is beyond the place that no solution gets past.
    let density = |x: f64| (-0.5 * ((3.0 * x * (-0.5 * x * x).exp() - 0.5).powi(2) + x * x / 2.25)).exp();
    let grid = || (0..40_000).map(|i| (f64::from(i) - 19_999.5) * 0.005);
    let moment = |n: i32| grid().map(|x| x.powi(n) * density(x)).sum::<f64>() / grid().map(density).sum::<f64>();
    let (mean, spread) = (moment(1), moment(2) - moment(1).powi(2));
    let (found, variance) = moments(&draws, 0);
    assert!((found - mean).abs() < 0.1 * spread.sqrt(), "{found} {mean}");
    assert!((variance / spread - 1.0).abs() < 0.1, "{variance} {spread}");
}

/// A sine that few draws get over, and a stop as chains begin: the draws that were solved for are kept.
#[test]
fn a_stop_before_the_next_way_has_drawn_keeps_the_draws_of_the_one_before() {
    let rows: Rows = |p, _| vec![(2.0 * p[0].sin() - 0.3, vec![2.0 * p[0].cos()]), (0.0, vec![0.0])];
    let of = Formula { looks: true, ..Formula::new(rows, 2, 0) };
    let decls = [free("x")];
    let priors = Priors::default().with(PriorRow { column: 0, mean: 0.0, sigma: 40.0 });
    let request = Request { priors, ..Request::new(&decls, &[0], &[0.1]) };
    let at = estimate(&request, &mut of.clone()).unwrap();
    let (stopped, made) = (AtomicBool::new(false), AtomicUsize::new(0));
    // One for what all draws have in common, two for each of four chains.
    let make = || {
        stopped.store(made.fetch_add(1, Ordering::SeqCst) >= 9, Ordering::SeqCst);
        Ok(Box::new(of.clone()))
    };
    let d = sample(&request, &at, make, &ChainSettings { threads: 1, ..SETTINGS }, Some(&stopped)).unwrap();
    assert!(made.load(Ordering::SeqCst) > 9 && d.divergences > 0);
    assert!(d.way == Way::Solved && !d.is_empty() && !d.converged(), "{:?} {}", d.way, d.len());
}

/// Half of the solutions are negative, where the parameter cannot be: chains of one draw of which some have none.
#[test]
fn chains_without_a_draw_that_is_physical_are_left_out() {
    let rows: Rows = |p, _| vec![(p[0] - 0.1, vec![1.0])];
    let of = Formula { looks: true, ..Formula::new(rows, 1, 0) };
    let decls = [ParamDecl::positive("k", "N m/rad", 0.2)];
    let request = Request::new(&decls, &[0], &[0.2]);
    let at = estimate(&request, &mut of.clone()).unwrap();
    let (stopped, made) = (AtomicBool::new(false), AtomicUsize::new(0));
    let settings = ChainSettings { draws: 1, chains: 12, threads: 1, ..SETTINGS };
    let make = || {
        stopped.store(made.fetch_add(1, Ordering::SeqCst) > 2 * settings.chains, Ordering::SeqCst);
        Ok(Box::new(of.clone()))
    };
    let d = sample(&request, &at, make, &settings, Some(&stopped)).unwrap();
    assert!(d.way == Way::Solved && (2..12).contains(&d.chains.len()), "{:?} {}", d.way, d.chains.len());
    assert!(d.chains.iter().all(|c| c.len() == 1 && c[0][0] > 0.0) && d.log_density.len() == d.chains.len());
}

/// What ArviZ 0.23.4 (`az.psislw`) makes of the same logarithms of weights: shape of the tail, `(sum w)^2 / sum w^2`.
#[test]
fn weights_are_smoothed_as_arviz_does() {
    let mut state: u64 = 12345;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let u: Vec<f64> = (0..1600).map(|_| uniform()).collect();
    let of = |n: usize, f: fn(f64) -> f64| Weights::new(&u[..n].iter().map(|u| f(*u)).collect::<Vec<_>>());
    for (w, k, effective) in [
        (of(200, |u| 0.3 * u), -0.635_670_640_200_17, 198.429_231_215_050_24),
        (of(1000, |u| -0.9 * u.ln()), 1.087_653_212_762_304_9, 43.631_410_212_688_48),
        (of(1600, |u| 0.05 * u.ln() * u), -0.882_734_178_351_009_5, 1_599.951_377_623_303),
        (of(400, |u| -0.4 * (-u).ln_1p()), 0.340_439_878_243_858_24, 259.977_801_753_018_35),
    ] {
        assert!((w.pareto_k.unwrap() - k).abs() < 1e-6, "{:?} {k}", w.pareto_k);
        assert!((w.effective() / effective - 1.0).abs() < 1e-6, "{} {effective}", w.effective());
    }
    // Equal weights have no tail, none have no draws; every draw comes as often as its weight says, to the next whole number.
    assert_eq!(Weights::new(&[-3.0; 50]).pareto_k, None);
    assert!(resampled(&Weights::new(&[f64::NEG_INFINITY; 50]).values).is_empty());
    let w = of(1000, |u| -0.4 * u.ln());
    let (kept, sum) = (resampled(&w.values), w.values.iter().sum::<f64>());
    assert_eq!(kept.len(), 1000);
    for (i, v) in w.values.iter().enumerate() {
        let times = kept.iter().filter(|k| **k == i).count() as f64;
        assert!((times - v / sum * 1000.0).abs() < 1.0, "{i}: {times}");
    }
}

/// The decay of `tests/profile.rs`, positive parameters, wide enough to be drawn as logarithms: quantiles against the profile.
#[test]
fn intervals_of_draws_are_those_of_the_profile() {
    let rows: Rows = |p, _| {
        let time = |i: usize| 0.4 * i as f64;
        let read = |i: usize| 9.0 * (-0.7 * time(i)).exp() + 0.8 * (2.9 * i as f64).sin();
        let row = |i: usize| {
            let e = (-p[1] * time(i)).exp();
            (p[0] * e - read(i), vec![e, -p[0] * time(i) * e])
        };
        (0..12).map(row).collect()
    };
    let of = Formula::new(rows, 12, 0);
    let decls = [ParamDecl::positive("a", "N m", 9.0), ParamDecl::positive("b", "1/s", 0.7)];
    let request = Request::new(&decls, &[0, 1], &[5.0, 1.3]);
    let (at, draws) = drawn(&request, &of, &ChainSettings { draws: 2000, ..SETTINGS });
    converged(&draws);
    assert!(draws.sorted(1)[0] > 0.0);
    let found = profile(&request, &at, 1, 6.0, &mut of.clone()).unwrap();
    let (low, high) = (found.interval95.0.unwrap(), found.interval95.1.unwrap());
    let (a, b) = hdi(&draws.sorted(1), 0.95);
    let std = at.parameters[1].std.unwrap();
    // A profile is a maximum over the others, draws are a mean over them: the same but for a part of the deviation.
    assert!((a - low).abs() < 0.3 * std && (b - high).abs() < 0.3 * std, "{a} {b} against {low} {high}, {LIMIT95}");
}

/// Twenty seconds of the paper's tank, noisy: intervals of fuel mass and pendulum length against their profiles, from two records as well.
#[test]
#[ignore = "full tier: 20 s"]
fn draws_of_a_simulated_record_agree_with_its_profiles() {
    let l = paper("slosh.toml");
    let motion = planned(&l, 20.0, 10);
    let o = SimOptions { duration_s: 20.0, step_s: 1e-3, sample_s: 0.1 };
    let p = Params::nominal(&l.model);
    let t = simulate(&l.model, &p, &State::zero(&l.model), &Drive::Prescribed(&motion), &o).unwrap();
    let noise = Noise { torque: 0.1, gyro: 1.5e-4 };
    let record = |seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut noisy =
            |m: &DMatrix<f64>, s: f64| m.map(|x| x + s * Distribution::<f64>::sample(&StandardNormal, &mut rng));
        let (tau, gyro) = (noisy(&t.tau, noise.torque), noisy(&t.gyro(), noise.gyro));
        let b = RecordBuilder::new(l.model.joint_names()).uniform(0.0, 10.0).allow("Data::Stuck");
        b.q(t.q.clone()).qd(t.qd.clone()).qdd(t.qdd.clone()).tau(tau).gyro(gyro).build().unwrap().0
    };
    let (one, two) = (record(1), record(2));
    let decls = l.model.param_decls();
    let selected = select(&decls, &["tank.mass", "tank.length", "tank.k[*]", "tank.d[*]"]).unwrap();
    let options = Options { substeps: 2, gyro_bias: true, ..Options::new(noise) };
    let request = Request::new(&decls, &selected, p.values());
    let settings = ChainSettings { draws: 500, ..SETTINGS };
    let shared = Shared::new(&[("one", &decls[..]), ("two", &decls[..])], &[""; 0]).unwrap();
    let make = || -> Box<dyn Estimator> { Box::new(OutputError::new(&l.model, &one, &options).unwrap()) };
    let both = || -> Box<dyn Estimator> {
        let second = OutputError::new(&l.model, &two, &options).unwrap();
        Box::new(Several::new(&shared, vec![make(), Box::new(second)]))
    };
    let single = estimate(&request, &mut *make()).unwrap();
    let joint = estimate(&request, &mut *both()).unwrap();
    let draws = sample(&request, &single, || Ok(make()), &settings, None).unwrap();
    let of_both = sample(&request, &joint, || Ok(both()), &settings, None).unwrap();
    converged(&draws);
    converged(&of_both);
    assert!(draws.names.len() > selected.len() && of_both.names.len() > draws.names.len(), "{:?}", of_both.names);
    for name in ["tank.mass", "tank.length"] {
        let k = draws.names.iter().position(|n| n == name).unwrap();
        let found = profile(&request, &single, k, 6.0, &mut *make()).unwrap();
        let std = single.parameters[k].std.unwrap();
        let (a, b) = hdi(&draws.sorted(k), 0.95);
        let (low, high) = (found.interval95.0.unwrap(), found.interval95.1.unwrap());
        assert!((a - low).abs() < 0.4 * std && (b - high).abs() < 0.4 * std, "{name}: {a} {b}, {low} {high}, {std}");
        let (two, one) = (moments(&of_both, k).1, moments(&draws, k).1);
        assert!((two / one - 0.5).abs() < 0.15, "{name}: {two} {one}");
    }
}

/// Differences of the density, in every kind of coordinates.
#[test]
fn the_gradient_is_that_of_the_density() {
    let rows: Rows = |p, e| {
        let f = p[0] * p[1] + e[0];
        let d = (f - 2.0, vec![p[1], p[0], 1.0]);
        vec![
            d,
            (p[1] - 1.2, vec![0.0, 1.0, 0.0]),
            (3.0 * (p[0] - p[1] * p[1]) - e[0], vec![3.0, -6.0 * p[1], -1.0]),
            (e[0], vec![0.0, 0.0, 1.0]),
        ]
    };
    let of = Formula::new(rows, 4, 1);
    let decls = [ParamDecl::positive("k", "N m", 1.0), free("b")];
    let priors = Priors::default().with(PriorRow { column: 0, mean: 1.0, sigma: 0.7 });
    for loss in [ident::Loss::Squares, ident::Loss::STUDENT] {
        let request = Request { priors: priors.clone(), loss, ..Request::new(&decls, &[0, 1], &[1.0, 1.0]) };
        let at = estimate(&request, &mut of.clone()).unwrap();
        let frame = Frame::new(&request, &at).unwrap();
        let mut density = PosteriorDensity::new(&request, &frame, Box::new(of.clone())).unwrap();
        let z = [0.3, -0.4, 0.2];
        let (mut g, mut none) = ([0.0; 3], [0.0; 3]);
        density.log_density(&z, &mut g).unwrap().unwrap();
        for k in 0..3 {
            let mut at = |d: f64| {
                let mut z = z;
                z[k] += d;
                density.log_density(&z, &mut none).unwrap().unwrap()
            };
            let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((slope - g[k]).abs() < 1e-6 * (1.0 + slope.abs()), "{k}: {slope} {}", g[k]);
        }
    }
}

#[test]
fn what_nothing_determines_is_not_drawn_and_a_stop_keeps_what_there_is() {
    let rows: Rows = |p, _| vec![(p[0] + p[1] - 1.0, vec![1.0, 1.0]), (2.0 * (p[0] + p[1]), vec![2.0, 2.0])];
    let of = Formula::new(rows, 2, 0);
    let decls = [free("a"), free("b")];
    let request = Request { anchor: Some(10.0), ..Request::new(&decls, &[0, 1], &[1.0, 1.0]) };
    let at = estimate(&request, &mut of.clone()).unwrap();
    let none = sample(&request, &at, || Ok(Box::new(of.clone())), &SETTINGS, None);
    assert!(matches!(&none, Err(SampleError::Improper(d)) if d.contains('a') && d.contains('b')), "{none:?}");
    let priors = Priors::default().with(PriorRow { column: 0, mean: 0.0, sigma: 1.0 });
    let request = Request { priors, ..Request::new(&decls, &[0, 1], &[1.0, 1.0]) };
    let at = estimate(&request, &mut of.clone()).unwrap();
    let stopped = AtomicBool::new(true);
    let d = sample(&request, &at, || Ok(Box::new(of.clone())), &SETTINGS, Some(&stopped)).unwrap();
    assert!(d.is_empty() && d.chains.len() == 4);
}

/// Chains that anyone can make again: `x[c][t] = 0.8 x[c][t-1] + u - 0.5`, u from a congruential generator, to a power, chains apart.
fn chains(count: u64, n: usize, apart: f64, power: i32) -> Vec<Vec<f64>> {
    let mut state: u64 = 12345;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let chain = |c: u64| {
        let mut x: f64 = 0.0;
        let mut draw = || {
            x = 0.8 * x + uniform() - 0.5;
            x.powi(power) + apart * c as f64
        };
        (0..n).map(|_| draw()).collect()
    };
    (0..count).map(chain).collect()
}

/// What ArviZ 0.23.4 (Python 3.11, `az.rhat`, `az.ess` of kinds bulk and tail) makes of the same chains.
#[test]
fn the_values_are_those_of_arviz() {
    for (of, want) in [
        (chains(4, 250, 0.0, 1), [1.081_568_803_195_356_3, 57.275_868_381_471_724, 133.963_431_148_591_07]),
        (chains(4, 250, 0.3, 1), [1.421_623_737_134_151_4, 8.957_151_145_548_155, 37.997_534_351_291_826]),
        (chains(4, 251, 0.0, 3), [1.088_877_267_441_111_4, 48.620_178_497_538_18, 137.837_144_661_157_96]),
        (chains(2, 100, 0.0, 2), [1.039_848_652_107_092_6, 94.851_613_641_838_41, 99.243_224_414_580_42]),
    ] {
        let d = Diagnosis::of(&of);
        for (got, want) in [d.r_hat, d.ess_bulk, d.ess_tail].iter().zip(want) {
            assert!((got / want - 1.0).abs() < 1e-7, "{got} {want}");
        }
    }
    let one = chains(1, 60, 0.0, 1);
    assert!((ess_bulk(&one) / 10.081_190_436_490_015 - 1.0).abs() < 1e-7);
    assert!((ess_tail(&one) / 21.631_029_338_637_497 - 1.0).abs() < 1e-7);
}

#[test]
fn chains_that_are_too_short_or_broken_have_no_figures() {
    assert!(r_hat(&chains(4, 7, 0.0, 1)).is_nan() && ess_bulk(&[]).is_nan());
    let mut broken = chains(2, 50, 0.0, 1);
    broken[1][3] = f64::NAN;
    assert!(Diagnosis::of(&broken).ess_tail.is_nan());
}
