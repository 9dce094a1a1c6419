//! Several records in one fit: parameters that they share, and parameters that each has for itself.

use crate::common::estimate;
use ff_least_squares::EvalError;
use ff_model::Inertia;
use ff_model::{ParamDecl, ParamGroup};
use ff_testkit::assert_within;
use ident::belief::Unknown;
use ident::compose::*;
use ident::estimate::Request;
use ident::estimate::{Coarse, Estimator};
use nalgebra::DMatrix;
use nalgebra::{Matrix3, Vector3};

/// Straight lines `slope t + level + bias`, read at some instants.
struct Line {
    times: Vec<f64>,
    read: Vec<f64>,
    /// Which of the parameters are slope and level.
    at: [usize; 2],
}

impl Estimator for Line {
    fn rows(&self) -> usize {
        self.times.len()
    }
    fn nuisance(&self) -> Vec<Unknown> {
        vec![Unknown { name: "bend".into(), unit: "1".into(), size: 1.0 }]
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        for (i, t) in self.times.iter().enumerate() {
            r[i] = full[self.at[0]] * t + full[self.at[1]] + extra[0] * t * t - self.read[i];
        }
        Ok(())
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        self.residuals(full, extra, r)?;
        j.fill(0.0);
        for (i, &t) in self.times.iter().enumerate() {
            for (c, s) in selected.iter().enumerate() {
                j[(i, c)] = if *s == self.at[0] { t } else { f64::from(u8::from(*s == self.at[1])) };
            }
            j[(i, selected.len())] = t * t;
        }
        Ok(())
    }
}

fn line(values: [f64; 2], bend: f64, at: [usize; 2]) -> Box<dyn Estimator> {
    let times: Vec<f64> = (0..9).map(|i| 0.3 * f64::from(i) - 0.7).collect();
    let read = times.iter().map(|t| values[0] * t + values[1] + bend * t * t).collect();
    Box::new(Line { times, read, at })
}

#[test]
fn shared_and_own_parameters_are_told_apart() {
    // The second record names its parameters in the other order and has one more.
    let one = [ParamDecl::positive("k", "N m/rad", 2.0), ParamDecl::positive("level", "N m", 1.0)];
    let two = [
        ParamDecl::positive("level", "N m", 1.0),
        ParamDecl::positive("k", "N m/rad", 2.0),
        ParamDecl::positive("idle", "kg", 7.0),
    ];
    let shared = Shared::new(&[("calm", &one), ("windy", &two)], &["level"]).unwrap();
    let names: Vec<&str> = shared.decls.iter().map(|d| d.name.as_str()).collect();
    assert_eq!(names, ["k", "calm.level", "windy.level", "idle"]);
    let mut both = Several::new(&shared, vec![line([3.0, 1.5], 0.2, [0, 1]), line([3.0, 2.5], -0.4, [1, 0])]);
    assert_eq!(both.nuisance()[1].name, "windy.bend");
    let start = shared.gather(&[vec![2.0, 1.0], vec![1.0, 9.0, 7.0]]);
    assert_eq!(start, [2.0, 1.0, 1.0, 7.0]);
    let e = estimate(&Request::new(&shared.decls, &[0, 1, 2], &start), &mut both).unwrap();
    for (got, want) in e.values.iter().zip([3.0, 1.5, 2.5, 7.0]) {
        assert_within!((got - want).abs(), 1e-9, "{:?}", e.values);
    }
    assert!((e.nuisance[0].value - 0.2).abs() < 1e-9 && (e.nuisance[1].value + 0.4).abs() < 1e-9);
    assert_eq!(shared.of_record(1, &e.values)[0], e.values[2]);
}

#[test]
fn a_body_is_claimed_as_a_whole() {
    let i = Matrix3::new(15.0, 0.3, -0.2, 0.3, 18.0, 0.7, -0.2, 0.7, 21.0);
    let d = ParamDecl::inertial("payload", &Inertia::from_com(60.0, &Vector3::new(0.9, -0.3, 0.6), &i));
    let shared = Shared::new(&[("before", &d), ("after", &d)], &["payload.mass"]).unwrap();
    assert_eq!(shared.decls.len(), 20);
    assert_eq!(shared.decls[13].name, "after.payload.h_z");
    assert!(matches!(&shared.decls[13].group, ParamGroup::Inertial(b) if b == "after.payload"));
}

#[test]
fn what_cannot_be_shared_is_named() {
    let (a, b) = ([ParamDecl::positive("k", "N m/rad", 2.0)], [ParamDecl::positive("k", "N/m", 2.0)]);
    let e = Shared::new::<&str>(&[("one", &a), ("two", &b)], &[]).unwrap_err();
    assert!(e.to_string().starts_with("'k' is positive in N m/rad in record 'one' and positive in N/m"), "{e}");
    assert!(matches!(Shared::new::<&str>(&[], &[]), Err(SharedError::NoRecord)));
    assert!(matches!(Shared::new::<&str>(&[("a", &a), ("a", &a)], &[]), Err(SharedError::Label(_))));
    assert!(matches!(Shared::new(&[("a", &a)], &["x"]), Err(SharedError::Selection(_))));
}

/// A line `k t + state` whose every third reading is a look at it, if that leaves eight, and whose beginnings have three.
struct Readings(Vec<f64>);

impl Readings {
    fn some(&self, rows: Vec<usize>) -> Coarse<'_> {
        let estimator = Box::new(Readings(rows.iter().map(|&i| self.0[i]).collect()));
        Coarse { estimator, rows, between: Vec::new() }
    }
}

impl Estimator for Readings {
    fn rows(&self) -> usize {
        self.0.len()
    }
    fn nuisance(&self) -> Vec<Unknown> {
        vec![Unknown { name: "initial.rate.x".into(), unit: "rad/s".into(), size: 1e-2 }]
    }
    fn coarse(&self, _: &[f64]) -> Option<Coarse<'_>> {
        (self.0.len() >= 24).then(|| self.some((0..self.0.len()).step_by(3).collect()))
    }
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        let rows = (share * self.0.len() as f64) as usize;
        (rows >= 3).then(|| self.some((0..rows).collect()))
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        r.iter_mut().zip(&self.0).for_each(|(r, t)| *r = (full[0] - 3.0) * t + (extra[0] - 1.7));
        Ok(())
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        self.residuals(full, extra, r)?;
        for (i, t) in self.0.iter().enumerate() {
            (0..selected.len()).for_each(|c| j[(i, c)] = *t);
            j[(i, selected.len())] = 1.0;
        }
        Ok(())
    }
}

/// A part that is too short to be thinned stays whole, and begins with more of it than the others, so that long ones are led all the same.
#[test]
fn a_short_part_keeps_no_long_one_from_less_data() {
    let decls = [ParamDecl::positive("k", "N m/rad", 2.0)];
    let shared = Shared::new::<&str>(&[("long", &decls), ("short", &decls)], &[]).unwrap();
    let part = |n: usize| Box::new(Readings((0..n).map(|i| 0.1 * i as f64).collect())) as Box<dyn Estimator>;
    let both = Several::new(&shared, vec![part(30), part(10)]);
    let thin = both.coarse(&[2.0]).unwrap();
    let kept: Vec<usize> = (0..30).step_by(3).chain(30..40).collect();
    assert_eq!((thin.estimator.rows(), thin.rows), (20, kept));
    assert!(thin.estimator.coarse(&[2.0]).is_none());
    // A tenth is three of thirty, and one of ten: there it is four tenths.
    let begun = both.beginning(0.1).unwrap();
    assert_eq!((begun.estimator.rows(), begun.rows), (7, vec![0, 1, 2, 30, 31, 32, 33]));
    assert!(both.beginning(0.05).is_none());
    assert!(Several::new(&shared, vec![part(10), part(9)]).coarse(&[2.0]).is_none());
}

/// An initial state 170 of its sizes from rest, in which the record is linear, is no way to creep along.
#[test]
fn an_initial_state_far_from_rest_takes_no_more_steps() {
    let decls = [ParamDecl::positive("k", "N m/rad", 2.0)];
    let mut fit = Readings((0..20).map(|i| 0.1 * f64::from(i)).collect());
    let settings = ff_least_squares::Settings { max_iterations: 15, ..Default::default() };
    let e = estimate(&Request { settings, ..Request::new(&decls, &[0], &[2.0]) }, &mut fit).unwrap();
    assert!((e.values[0] - 3.0).abs() < 1e-6 && (e.nuisance[0].value - 1.7).abs() < 1e-6, "{:?}", e.nuisance);
}
