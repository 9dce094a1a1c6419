//! Minima that an exchange of like elements leads to.

use ff_least_squares::EvalError;
use ff_model::ParamDecl;
use ident::compose::{Exchanged, exchanges};
use ident::{Estimator, Request, estimate};
use nalgebra::DMatrix;

/// Springs `a`, `b` of two hinges of which a record tells sum and product well, and the difference through `told` alone; a mass by itself.
struct Mirrored {
    told: f64,
}

const TRUTH: [f64; 3] = [31.0, 218.0, 187.0];

impl Mirrored {
    fn of(&self, p: &[f64]) -> [f64; 4] {
        let (m, a, b) = (p[0], p[1], p[2]);
        [m / 0.3, (a + b) / 0.24, a * b / 31.0, self.told * (a - b)]
    }
}

impl Estimator for Mirrored {
    fn rows(&self) -> usize {
        4
    }
    fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        let (here, there) = (self.of(p), self.of(&TRUTH));
        r.iter_mut().zip(here.iter().zip(there)).for_each(|(r, (a, b))| *r = a - b);
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
        let all = DMatrix::from_row_slice(
            4,
            3,
            &[
                1.0 / 0.3,
                0.0,
                0.0,
                0.0,
                1.0 / 0.24,
                1.0 / 0.24,
                0.0,
                p[2] / 31.0,
                p[1] / 31.0,
                0.0,
                self.told,
                -self.told,
            ],
        );
        selected.iter().enumerate().for_each(|(c, &i)| j.set_column(c, &all.column(i)));
        Ok(())
    }
}

fn decls(names: [&str; 3]) -> Vec<ParamDecl> {
    names.iter().zip(["kg", "N m/rad", "N m/rad"]).zip(TRUTH).map(|((n, u), v)| ParamDecl::positive(*n, u, v)).collect()
}

fn found(names: [&str; 3], told: f64, start: [f64; 3]) -> Exchanged {
    let decls = decls(names);
    let request = Request::new(&decls, &[0, 1, 2], &start);
    let mut of = Mirrored { told };
    let first = estimate(&request, &mut of).unwrap();
    exchanges(&request, first, &mut of)
}

const WINGS: [&str; 3] = ["base.mass", "left.k[1]", "right.k[1]"];
const START: [f64; 3] = [29.0, 214.0, 190.0];

#[test]
fn mirrored_hinges_have_a_second_minimum_which_is_found() {
    let x = found(WINGS, 1e-4, START);
    let [other] = &x.others[..] else { panic!("{:?}", x.others) };
    assert_eq!(other.pairs, [("left.k[1]".to_owned(), "right.k[1]".to_owned())]);
    let (here, there) = (&x.best.values, &other.estimate.values);
    assert!((here[1] - 218.0).abs() < 1e-3 && (there[1] - 187.0).abs() < 0.1 && (there[2] - 218.0).abs() < 0.1);
    // The difference alone tells them apart.
    let expected = (1e-4_f64 * 2.0 * 31.0).powi(2);
    assert!((other.excess - expected).abs() < 0.1 * expected, "{} of {expected}", other.excess);
    // Two hinges of one wing, and two axes of a tank, too.
    assert_eq!(found(["base.mass", "wing.k[0]", "wing.k[1]"], 1e-4, START).others.len(), 1);
}

#[test]
fn what_a_record_tells_apart_has_no_second_minimum() {
    assert!(found(WINGS, 0.1, START).others.is_empty());
    // Not alike: other names, no element of the same kind.
    assert!(found(["base.mass", "left.k[1]", "right.c[1]"], 1e-4, START).others.is_empty());
    assert!(found(["base.mass", "k", "stiffness"], 1e-4, START).others.is_empty());
}

#[test]
fn a_fit_that_ended_with_hinges_exchanged_is_led_to_the_lower_minimum() {
    let x = found(WINGS, 0.04, [29.0, 184.0, 221.0]);
    assert!((x.best.values[1] - 218.0).abs() < 0.01, "{:?}", x.best.values);
    let [other] = &x.others[..] else { panic!("{:?}", x.others) };
    assert!(other.excess > 1.0 && other.excess < 9.2 && other.estimate.values[1] < 192.0, "{}", other.excess);
    assert_eq!(x.best.parameters[1].start, 184.0);
}
