//! Spline fits of joint records against a trajectory with known derivatives.

use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
use ff_dynamics::motion::JointMotion;
use ff_testkit::assert_within;
use ident::motion::{DEGREE, FitError, JointSamples, choose_knots, fit_motion, fit_motion_from_rest, noise_estimate};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const N: usize = 3;

/// Sums of sines with known derivatives; fastest 0.5 Hz.
fn truth(t: f64) -> [[f64; N]; 3] {
    let mut y = [[0.0; N]; 3];
    for (j, amplitude) in [0.31, 0.24, 0.43].into_iter().enumerate() {
        for (k, f) in [0.071, 0.23, 0.5].into_iter().enumerate() {
            let w = std::f64::consts::TAU * f;
            let a = amplitude / (1.0 + 3.0 * k as f64);
            let (s, c) = (w * t + 0.4 + j as f64 + 0.7 * k as f64).sin_cos();
            y[0][j] += a * s;
            y[1][j] += a * w * c;
            y[2][j] -= a * w * w * s;
        }
    }
    y
}

struct Record {
    times: Vec<f64>,
    q: Vec<f64>,
    qd: Vec<f64>,
}

fn record(samples: usize, h: f64, sigma: f64, sigma_rate: f64, seed: u64) -> Record {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let unit = Normal::new(0.0, 1.0).unwrap();
    let mut r = Record { times: vec![], q: vec![], qd: vec![] };
    for i in 0..samples {
        let t = i as f64 * h;
        let y = truth(t);
        r.times.push(t);
        for j in 0..N {
            r.q.push(y[0][j] + sigma * unit.sample(&mut rng));
            r.qd.push(y[1][j] + sigma_rate * unit.sample(&mut rng));
        }
    }
    r
}

impl Record {
    fn view(&self, rates: Option<f64>) -> JointSamples<'_> {
        let qd = rates.map(|_| &self.qd[..]);
        JointSamples { dof: N, times: &self.times, q: &self.q, qd, rate_weight: rates.unwrap_or(1.0) }
    }
}

/// Rms error of position, rate and acceleration away from the ends, over all joints.
fn errors(m: &dyn JointMotion) -> [f64; 3] {
    let mut e = [0.0; 3];
    let count = 5000;
    for i in 0..count {
        let t = 1.0 + (m.duration() - 2.0) * i as f64 / count as f64;
        let mut y = [[0.0; N]; 3];
        let [q, qd, qdd] = &mut y;
        m.eval(t, q, qd, qdd);
        let want = truth(t);
        for o in 0..3 {
            e[o] += (0..N).map(|j| (y[o][j] - want[o][j]).powi(2)).sum::<f64>() / (N * count) as f64;
        }
    }
    // Two digits, for reading.
    e.map(|x| format!("{:.1e}", x.sqrt()).parse().unwrap())
}

#[test]
fn six_thousand_samples_six_hundred_knots() {
    let r = record(6000, 0.01, 1e-5, 1e-4, 3);
    let fit = fit_motion(&r.view(None), 0.1).unwrap();
    eprintln!("6000 samples x {} points x {N} joints", fit.motion.spline().knots().count());
    assert_eq!(fit.motion.spline().knots().count(), 600 + DEGREE);
    for s in &fit.residual {
        assert!((s / 1e-5 - 1.0).abs() < 0.05, "residual {s}");
    }
    let e = errors(&fit.motion);
    eprintln!("0.1 s knots, noise 1e-5 rad: rms errors {e:?}");
    assert!(e[0] < 5e-6 && e[1] < 1e-4 && e[2] < 4e-3, "{e:?}");
}

#[test]
fn chosen_knots_beat_fine_knots_and_differences() {
    let (h, sigma) = (0.01, 1e-5);
    let r = record(6000, h, sigma, 1e-4, 5);
    for s in noise_estimate(&r.view(None)).unwrap() {
        assert!((s / sigma - 1.0).abs() < 0.1, "noise {s}");
    }
    let chosen = choose_knots(&r.view(None), None).unwrap();
    let given = choose_knots(&r.view(None), Some(&[sigma; N])).unwrap();
    let fine = fit_motion(&r.view(None), 0.05).unwrap();
    let (e, g, f) = (errors(&chosen.motion), errors(&given.motion), errors(&fine.motion));
    // Central second difference: error sqrt(6) sigma / h^2.
    let difference = 6.0f64.sqrt() * sigma / (h * h);
    eprintln!(
        "chosen {:.3} s: {e:?}; noise given {:.3} s: {g:?}; 0.05 s: {f:?}; difference {difference:.2}",
        chosen.spacing, given.spacing
    );
    assert!((0.2..1.0).contains(&chosen.spacing), "{}", chosen.spacing);
    assert!(e[2] < f[2] / 5.0 && e[2] < difference / 100.0);
    assert_within!(e[2], 1e-3, "acceleration error {}", e[2]);
}

#[test]
fn measured_rates_help() {
    let r = record(3000, 0.01, 1e-4, 2e-5, 8);
    let without = errors(&fit_motion(&r.view(None), 0.2).unwrap().motion);
    let fit = fit_motion(&r.view(Some(5.0)), 0.2).unwrap();
    let with = errors(&fit.motion);
    eprintln!("without rates {without:?}, with rates {with:?}");
    assert!(with[2] < 0.5 * without[2]);
    assert!(fit.rate_residual.iter().all(|s| (s / 2e-5 - 1.0).abs() < 0.1), "{:?}", fit.rate_residual);
}

/// Knots as wide as encoders of 1e-5 rad, read 20 times a second, ask for on an arm of 1000 kg m^2. What a spline bends a tone by is a line in the torques
/// at the knots' frequency less that of the tone: 0.1 N m of degree 5, which 2000 readings with noise of 0.3 N m show.
#[test]
fn a_tone_is_bent_by_less_than_torques_show() {
    let (f, size) = (core::f64::consts::TAU * 0.483, 0.03);
    let times: Vec<f64> = (0..2000).map(|i| 0.05 * f64::from(i)).collect();
    let tone = |t: f64| size * (f * t + 0.4).sin();
    let q: Vec<f64> = times.iter().map(|t| tone(*t)).collect();
    let fit = fit_motion(&JointSamples { dof: 1, times: &times, q: &q, qd: None, rate_weight: 0.0 }, 0.26).unwrap();
    let inside = &times[100..1900];
    let error = |t: &f64| {
        let mut a = [0.0];
        fit.motion.derivative(*t, 2, &mut a);
        a[0] + f * f * tone(*t)
    };
    let rms = (inside.iter().map(|t| error(t).powi(2)).sum::<f64>() / inside.len() as f64).sqrt();
    assert!(1000.0 * rms < 0.01, "{rms:e} rad/s^2");
}

#[test]
fn a_spline_of_the_same_knots_is_found_again() {
    let l = JointLimits { lower: -2.0, upper: 2.0, velocity: 0.17, acceleration: 0.15, jerk: None };
    let spec = PlanSpec {
        start: vec![0.1, -0.2, 0.3],
        end: End::Fixed(vec![0.2, 0.15, -0.1]),
        duration: Duration::Fixed(30.0),
        degree: DEGREE,
        free: 14,
        limits: vec![l; 3],
        refine: 1,
    };
    let plan = SplinePlan::new(spec).unwrap();
    let m = plan.motion(&random_plan(&plan, 4, 2, 0.8).unwrap()).unwrap();
    let times: Vec<f64> = (0..=1500).map(|i| 30.0 * i as f64 / 1500.0).collect();
    let mut q = vec![0.0; 3 * times.len()];
    for (row, t) in q.chunks_mut(3).zip(&times) {
        m.derivative(*t, 0, row);
    }
    let samples = JointSamples { dof: 3, times: &times, q: &q, qd: None, rate_weight: 1.0 };
    let fit = fit_motion(&samples, 30.0 / 13.0).unwrap();
    assert_within!((fit.motion.spline().control() - m.control()).amax(), 1e-11);
    assert!(fit.residual.iter().all(|r| *r < 1e-13));
}

#[test]
fn bad_records_are_refused() {
    let mut r = record(200, 0.01, 0.0, 0.0, 1);
    assert!(matches!(fit_motion(&r.view(None), 0.0), Err(FitError::Value { what: "knot spacing", .. })));
    assert!(matches!(fit_motion(&r.view(Some(-1.0)), 0.1), Err(FitError::Value { what: "rate weight", .. })));
    assert!(matches!(choose_knots(&r.view(None), Some(&[1.0])), Err(FitError::Length { what: "noise", .. })));
    r.q[31] = f64::NAN;
    assert!(matches!(fit_motion(&r.view(None), 0.1), Err(FitError::NotFinite { what: "q", sample: 10, .. })));
    r.q[31] = 0.1;
    r.times[7] = r.times[6];
    assert!(matches!(fit_motion(&r.view(None), 0.1), Err(FitError::Time { sample: 7, .. })));
    r.times.truncate(150);
    assert!(matches!(fit_motion(&r.view(None), 0.1), Err(FitError::Length { what: "q", got: 600, expected: 450 })));

    // A gap of 0.6 s with knots every 0.05 s: the time of the gap is named.
    let mut r = record(200, 0.01, 1e-5, 0.0, 2);
    r.times.iter_mut().skip(80).for_each(|t| *t += 0.6);
    let e = fit_motion(&r.view(None), 0.05).unwrap_err();
    assert!(matches!(e, FitError::Undetermined { time } if (0.75..1.5).contains(&time)), "{e}");
    assert!(fit_motion(&r.view(None), 0.4).is_ok());
    assert!(matches!(noise_estimate(&r.view(None)), Err(FitError::Uneven { .. })));
    assert!(choose_knots(&r.view(None), Some(&[1e-3; N])).is_ok());
}

/// A motion that starts at rest, with noise; `drift` is a rate that it has from the start.
fn from_rest(drift: f64, sigma: f64, seed: u64) -> Record {
    let mut r = record(2000, 0.01, 0.0, 0.0, seed);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let unit = Normal::new(0.0, sigma).unwrap();
    for (i, t) in r.times.iter().enumerate() {
        for j in 0..N {
            let w = 0.9 + 0.4 * j as f64;
            r.q[i * N + j] = 0.3 * (1.0 - (w * t).cos()) + drift * t + unit.sample(&mut rng);
        }
    }
    r
}

#[test]
fn the_rate_at_the_start_has_the_variance_that_is_said_and_can_be_held() {
    let (sigma, spacing) = (2e-6, 0.2);
    let rate = |f: &ident::motion::MotionFit| {
        let mut v = [0.0; N];
        f.motion.derivative(0.0, 1, &mut v);
        v
    };
    let mut mean_square = 0.0;
    let mut at_rest = 0;
    for seed in 0..200 {
        let r = from_rest(0.0, sigma, 100 + seed);
        let fit = fit_motion(&r.view(None), spacing).unwrap();
        let expected = sigma * fit.start_rate_variance.sqrt();
        mean_square += rate(&fit).iter().map(|v| (v / expected).powi(2)).sum::<f64>() / (200 * N) as f64;
        at_rest += usize::from(fit.may_start_at_rest(&[sigma; N]));
    }
    // 600 squares: 6 % is one standard deviation of their mean.
    assert!((0.8..1.2).contains(&mean_square), "{mean_square}");
    assert_eq!(at_rest, 200);
    let r = from_rest(0.0, sigma, 7);
    let (free, held) =
        (fit_motion(&r.view(None), spacing).unwrap(), fit_motion_from_rest(&r.view(None), spacing).unwrap());
    for (f, h) in rate(&free).iter().zip(rate(&held)) {
        assert_within!(h.abs(), 1e-6 * f.abs(), "{h:e} of {f:e}");
    }
    assert!(held.from_rest && !free.from_rest);
    // The rest of the motion hardly knows.
    assert!(held.residual.iter().zip(&free.residual).all(|(h, f)| (h / f - 1.0).abs() < 0.01));
    // Thirty deviations of a rate are motion.
    let drift = 30.0 * sigma * free.start_rate_variance.sqrt();
    let moving = fit_motion(&from_rest(drift, sigma, 8).view(None), spacing).unwrap();
    assert!(!moving.may_start_at_rest(&[sigma; N]));
}
