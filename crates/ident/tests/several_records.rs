//! Several records in one fit: parameters that they share, and parameters that each has for itself.

use crate::common::estimate;
use ff_least_squares::EvalError;
use ff_model::Inertia;
use ff_model::{ParamDecl, ParamGroup};
use ff_testkit::assert_within;
use ident::belief::Unknown;
use ident::compose::*;
use ident::estimate::Estimator;
use ident::estimate::Request;
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
