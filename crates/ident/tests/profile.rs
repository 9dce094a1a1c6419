//! Intervals from the likelihood itself: the profile of one parameter.

use crate::common::estimate;
use ff_least_squares::EvalError;
use ff_model::ParamDecl;
use ff_testkit::assert_within;
use ident::belief::*;
use ident::belief::{Priors, Sigma};
use ident::estimate::Estimator;
use ident::estimate::Request;
use nalgebra::DMatrix;

/// Decay `a exp(-b t)`, read with noise of one.
struct Decay {
    read: Vec<f64>,
}

fn time(i: usize) -> f64 {
    0.4 * i as f64
}

impl Estimator for Decay {
    fn rows(&self) -> usize {
        self.read.len()
    }
    fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        for (i, r) in r.iter_mut().enumerate() {
            *r = p[0] * (-p[1] * time(i)).exp() - self.read[i];
        }
        Ok(())
    }
    fn jacobian(
        &mut self,
        p: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        self.residuals(p, extra, r)?;
        for i in 0..r.len() {
            let e = (-p[1] * time(i)).exp();
            let d = [e, -p[0] * time(i) * e];
            selected.iter().enumerate().for_each(|(c, &s)| j[(i, c)] = d[s]);
        }
        Ok(())
    }
}

fn setup() -> (Decay, [ParamDecl; 2]) {
    let read = (0..12).map(|i| 9.0 * (-0.7 * time(i)).exp() + 0.8 * (2.9 * i as f64).sin()).collect();
    (Decay { read }, [ParamDecl::positive("a", "N m", 9.0), ParamDecl::positive("b", "1/s", 0.7)])
}

#[test]
fn the_profile_is_the_lowest_cost_at_each_value() {
    let (mut decay, decls) = setup();
    let request = Request::new(&decls, &[0, 1], &[5.0, 1.3]);
    let best = estimate(&request, &mut decay).unwrap();
    let p = profile(&request, &best, 1, 6.0, &mut decay).unwrap();
    // Independently: for fixed b the best a is linear least squares.
    let cost = |b: f64| {
        let e: Vec<f64> = (0..12).map(|i| (-b * time(i)).exp()).collect();
        let a = e.iter().zip(&decay.read).map(|(e, y)| e * y).sum::<f64>() / e.iter().map(|e| e * e).sum::<f64>();
        e.iter().zip(&decay.read).map(|(e, y)| (a * e - y).powi(2)).sum::<f64>()
    };
    let lowest = cost(p.value);
    for point in &p.points {
        assert_within!((point.excess - (cost(point.value) - lowest)).abs(), 1e-6, "{point:?}");
    }
    let (low, high) = (p.interval95.0.unwrap(), p.interval95.1.unwrap());
    for end in [low, high] {
        assert!((cost(end) - lowest - LIMIT95).abs() < 0.05, "{end}: {}", cost(end) - lowest);
    }
    // Not symmetric, as a deviation would have it.
    assert!((high - p.value) > 1.02 * (p.value - low), "{low} {} {high}", p.value);
    // Nothing to be found on a side that is not searched far enough.
    let near = profile(&request, &best, 1, 1.0, &mut decay).unwrap();
    assert_eq!((near.interval95, near.points.len()), ((None, None), 5));
}

#[test]
fn a_prior_counts_like_data() {
    let (mut decay, decls) = setup();
    let priors = Priors::new(&decls, &[0, 1], &[9.0, 0.7], &[("b", Sigma::Absolute(0.05))]).unwrap();
    let request = Request { priors, ..Request::new(&decls, &[0, 1], &[9.0, 0.7]) };
    let best = estimate(&request, &mut decay).unwrap();
    let p = profile(&request, &best, 1, 6.0, &mut decay).unwrap();
    let width = (p.interval95.1.unwrap() - p.interval95.0.unwrap()) / 2.0;
    let expected = 1.96 * best.parameters[1].std.unwrap();
    assert!((width / expected - 1.0).abs() < 0.05 && width < 1.96 * 0.05, "{width} {expected}");
}
