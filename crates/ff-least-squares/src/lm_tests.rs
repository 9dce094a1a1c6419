use super::*;
use crate::problem::EvalError;
use approx::assert_relative_eq;
use ff_testkit::{assert_within, scaled};
use nalgebra::DVector;

/// Residuals and their Jacobian.
type Rows = (Vec<f64>, DMatrix<f64>);

/// Residuals and Jacobian rows from a closure.
struct Fun<F> {
    n: usize,
    f: F,
}

impl<F: FnMut(&[f64]) -> Rows> Problem for Fun<F> {
    fn dim(&self) -> usize {
        self.n
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        *r = (self.f)(x).0;
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        (*r, *j) = (self.f)(x);
        Ok(())
    }
}

fn rosenbrock() -> Fun<impl FnMut(&[f64]) -> Rows> {
    Fun {
        n: 2,
        f: |x: &[f64]| {
            let r = vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]];
            (r, DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]))
        },
    }
}

/// `y = a exp(-b t)` with a known pattern added, m samples.
fn decay(m: usize) -> Fun<impl FnMut(&[f64]) -> Rows> {
    let f = move |x: &[f64]| {
        let t = |i: usize| 3.0 * i as f64 / m as f64;
        let y = |i: usize| 1.7 * (-0.8 * t(i)).exp() + 0.05 * (7.0 * t(i)).sin();
        let r = (0..m).map(|i| x[0] * (-x[1] * t(i)).exp() - y(i)).collect();
        let j = DMatrix::from_fn(m, 2, |i, k| {
            let e = (-x[1] * t(i)).exp();
            if k == 0 { e } else { -x[0] * t(i) * e }
        });
        (r, j)
    };
    Fun { n: 2, f }
}

#[test]
fn rosenbrock_converges_from_the_classical_start() {
    let s = minimise(&mut rosenbrock(), &[-1.2, 1.0], &Settings { cost_floor: 1e-28, ..Settings::default() }).unwrap();
    assert!(s.status.is_converged(), "{:?}", s.status);
    assert_relative_eq!(s.x[0], 1.0, max_relative = scaled(1e-12));
    assert!(s.evaluations < 60, "{}", s.evaluations);
    assert_within!(jacobian_error(&mut rosenbrock(), &[0.3, -0.7], 1e-6).unwrap(), 1e-8);
}

#[test]
fn powell_singular_is_solved_although_the_jacobian_is_singular_there() {
    let mut p = Fun {
        n: 4,
        f: |x: &[f64]| {
            let (a, b) = (x[1] - 2.0 * x[2], x[0] - x[3]);
            let (s5, s10) = (5f64.sqrt(), 10f64.sqrt());
            let r = vec![x[0] + 10.0 * x[1], s5 * (x[2] - x[3]), a * a, s10 * b * b];
            let rows = [
                [1.0, 10.0, 0.0, 0.0],
                [0.0, 0.0, s5, -s5],
                [0.0, 2.0 * a, -4.0 * a, 0.0],
                [2.0 * s10 * b, 0.0, 0.0, -2.0 * s10 * b],
            ];
            (r, DMatrix::from_fn(4, 4, |i, k| rows[i][k]))
        },
    };
    let set = Settings { cost_floor: 1e-20, ..Settings::default() };
    let s = minimise(&mut p, &[3.0, -1.0, 0.0, 1.0], &set).unwrap();
    assert!(s.status == Status::Converged { by: Criterion::Cost } && s.x.iter().all(|x| x.abs() < 1e-4), "{:?}", s.x);
}

#[test]
fn an_active_bound_is_reported_and_the_rest_is_optimal() {
    let bounds = vec![(f64::NEG_INFINITY, f64::INFINITY), (0.9, 3.0)];
    let set = Settings { bounds, ..Settings::default() };
    let s = minimise(&mut decay(200), &[0.3, 2.0], &set).unwrap();
    assert!(matches!(&s.status, Status::AtBound { at, .. } if at == &[1]), "{:?}", s.status);
    assert_eq!(s.x[1], 0.9);
    let g: f64 = s.jacobian.column(0).iter().zip(&s.residuals).map(|(a, b)| a * b).sum();
    assert_within!(g.abs(), 1e-6);
    let free = minimise(&mut decay(200), &[0.3, 2.0], &Settings::default()).unwrap();
    assert!(free.status.is_converged() && free.cost < s.cost);
    // A start outside the box is refused.
    assert_eq!(minimise(&mut decay(200), &[0.3, 5.0], &set).unwrap_err().exit_code(), 11);
}

#[test]
fn a_wrong_jacobian_is_a_stall_and_never_a_solution() {
    let mut p = decay(50);
    let mut wrong = Fun {
        n: 2,
        f: move |x: &[f64]| {
            let (r, j) = (p.f)(x);
            (r, -j)
        },
    };
    let s = minimise(&mut wrong, &[1.0, 1.0], &Settings::default()).unwrap();
    assert!(matches!(s.status, Status::Stalled { promised } if promised > 1e-3), "{:?}", s.status);
    let set = Settings { max_iterations: 2, ..Settings::default() };
    assert_eq!(minimise(&mut rosenbrock(), &[-1.2, 1.0], &set).unwrap().status, Status::IterationLimit);
    assert!(jacobian_error(&mut wrong, &[1.0, 1.0], 1e-6).unwrap() > 1.9);
}

#[test]
fn non_finite_points_are_stepped_back_from_or_named() {
    // log(x) - 3 from x = 8: the first Gauss-Newton step lands on a negative argument when unlimited.
    let mut p = Fun { n: 1, f: |x: &[f64]| (vec![x[0].ln() - 1.0], DMatrix::from_element(1, 1, 1.0 / x[0])) };
    let set = Settings { initial_radius: 100.0, ..Settings::default() };
    let s = minimise(&mut p, &[60.0], &set).unwrap();
    assert!(s.history.iter().any(|h| h.gain.is_none()));
    assert_relative_eq!(s.x[0], core::f64::consts::E, max_relative = scaled(1e-9));
    // Nowhere but at the start.
    let mut calls = 0;
    let mut p = Fun {
        n: 1,
        f: move |x: &[f64]| {
            calls += 1;
            (vec![if calls == 1 { x[0] } else { f64::NAN }], DMatrix::from_element(1, 1, 1.0))
        },
    };
    let e = minimise(&mut p, &[2.5], &Settings::default()).unwrap_err();
    assert!(matches!(e, LmError::NonFiniteResidual { attempts: 10, ref best, .. } if best == &[2.5]));
    assert!(e.to_string().contains("x[0] = 2.5") && e.exit_code() == 14, "{e}");
    let mut p = Fun { n: 1, f: |_: &[f64]| (vec![f64::INFINITY], DMatrix::from_element(1, 1, 1.0)) };
    assert!(matches!(minimise(&mut p, &[2.5], &set), Err(LmError::NonFiniteResidual { attempts: 1, .. })));
}

#[test]
fn the_normal_equations_and_the_triangle_agree_and_ill_conditioning_takes_the_triangle() {
    let f = |i: usize, k: usize| ((k + 1) as f64 * 0.37 * i as f64 + 0.7).sin();
    let r: Vec<f64> = (0..90).map(|i| (0.3 * i as f64).cos()).collect();
    for eps in [1.0, 1e-7] {
        let j = DMatrix::from_fn(
            90,
            4,
            |i, k| if k == 3 { f(i, 0) + eps * f(i, 5) } else { 10f64.powi(k as i32) * f(i, k) },
        );
        let (rr, c) = crate::step::reduce(&j, &r).unwrap();
        let x = rr.solve_upper_triangular(&c).unwrap();
        let y = linalg_reference(&j, &r);
        for k in 0..4 {
            assert_relative_eq!(x[k], y[k], max_relative = scaled(1e-7));
        }
    }
}

fn linalg_reference(j: &DMatrix<f64>, r: &[f64]) -> DVector<f64> {
    ff_linalg::least_squares(j, &DVector::from_column_slice(r)).unwrap()
}

/// `exp(-x t)` against data that no rate explains: residuals stay, and their curvature slows Gauss-Newton steps down.
struct Misfit {
    jacobians: usize,
}

impl Misfit {
    /// Times and data: a decay with an offset that the model does not have.
    fn data(i: usize) -> (f64, f64) {
        let t = 0.15 * (i + 1) as f64;
        (t, (-1.1 * t).exp() + if i.is_multiple_of(2) { 0.9 } else { -0.2 })
    }
}

impl Problem for Misfit {
    fn dim(&self) -> usize {
        1
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        *r = (0..30).map(|i| (-x[0] * Self::data(i).0).exp() - Self::data(i).1).collect();
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        self.jacobians += 1;
        *j = DMatrix::from_fn(30, 1, |i, _| -Self::data(i).0 * (-x[0] * Self::data(i).0).exp());
        self.residuals(x, r)
    }
}

/// `r = (x, 1 - 0.4 x^2)`: the second residual stays, and takes 0.8 of the curvature that the Jacobian shows. Gauss-Newton steps leave
/// four fifths of the way each.
struct Bent {
    jacobians: usize,
}

impl Problem for Bent {
    fn dim(&self) -> usize {
        1
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        *r = vec![x[0], 1.0 - 0.4 * x[0] * x[0]];
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        self.jacobians += 1;
        *j = DMatrix::from_column_slice(2, 1, &[1.0, -0.8 * x[0]]);
        self.residuals(x, r)
    }
}

#[test]
fn a_step_that_did_not_keep_its_promise_is_brought_to_the_lowest_of_its_parabola() {
    let run = |chord: bool| {
        let mut p = Bent { jacobians: 0 };
        let s = minimise(&mut p, &[0.5], &Settings { chord, scale: Scale::Unit, ..Settings::default() }).unwrap();
        assert!(s.status.is_converged() && s.x[0].abs() < 1e-5, "{:?} at {:?}", s.status, s.x);
        p.jacobians
    };
    let (plain, along) = (run(false), run(true));
    assert!(plain > 30 && along <= 8, "{plain} and {along} linearisations");
}

#[test]
fn what_is_small_against_the_noise_is_not_gained() {
    let run = |gain_tolerance: f64| {
        minimise(&mut Misfit { jacobians: 0 }, &[0.9], &Settings { gain_tolerance, ..Settings::default() }).unwrap()
    };
    let (tight, lax) = (run(0.0), run(1e-2));
    assert!(matches!(lax.status, Status::Converged { by: Criterion::Statistics }), "{:?}", lax.status);
    assert!(lax.iterations < tight.iterations, "{} {}", lax.iterations, tight.iterations);
    // A tenth of a deviation is left at most, in units of the residuals.
    let deviation = 1.0 / tight.jacobian.column(0).norm() * (2.0 * tight.cost / 30.0).sqrt().min(1.0);
    assert!((lax.x[0] - tight.x[0]).abs() < 0.5 * deviation, "{} {}", lax.x[0], tight.x[0]);
}
