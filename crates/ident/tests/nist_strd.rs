//! The solver on the NIST Statistical Reference Datasets, from both published starts, against the certified
//! estimates, their standard deviations and residual sums of squares.

use ff_least_squares::{EvalError, Problem, Settings, minimise};
use ident::belief::{Unknown, analyse};
use nalgebra::DMatrix;
use std::fmt::Write as _;
use std::path::Path;
use validate::nist;
use validate::nist::{digits, problems};

struct Fit<'a>(&'a nist::Problem);

impl Problem for Fit<'_> {
    fn dim(&self) -> usize {
        self.0.certified.len()
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        self.0.residuals(x, r);
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        self.0.jacobian(x, r, j);
        Ok(())
    }
}

#[test]
fn certified_estimates_are_reached_from_both_starts() {
    let (mut report, mut bad) = (String::new(), 0);
    for p in problems(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/nist")).unwrap() {
        for (k, start) in p.starts.iter().enumerate() {
            // Certification asks for digits, not for a fraction of a standard deviation.
            let settings = Settings {
                decrement_tolerance: 1e-24,
                step_tolerance: 0.0,
                max_iterations: 2000,
                ..Settings::default()
            };
            let line = match minimise(&mut Fit(&p), start, &settings) {
                Err(e) => {
                    bad += 1;
                    format!("{e}")
                }
                Ok(s) => {
                    let b = p.worst_digits(&s.x);
                    let rss = digits(2.0 * s.cost, p.rss);
                    // Certified deviations are those of residuals with unknown, equal variance.
                    let unknown = |v: &f64| Unknown { name: String::new(), unit: String::new(), size: v.abs() };
                    let u = analyse(&s.jacobian, &s.x.iter().map(unknown).collect::<Vec<_>>(), 1e-14).unwrap();
                    let noise = (2.0 * s.cost / (p.observations() - s.x.len()) as f64).sqrt();
                    let sd = u.deviation.iter().zip(&p.deviation);
                    let sd = sd.map(|(a, c)| digits(noise * a.unwrap_or(0.0), *c)).fold(11.0, f64::min);
                    // The residuals of Lanczos1 are rounding: their size, and with it the deviations, has no digits.
                    bad += usize::from(sd < 6.0 && p.name != "Lanczos1");
                    bad += usize::from(b < 6.5 || !s.status.is_converged());
                    format!("{b:5.1} {sd:5.1} {rss:5.1} digits, {:4} evaluations, {:?}", s.evaluations, s.status)
                }
            };
            writeln!(report, "{:9} start {} {line}", p.name, k + 1).unwrap();
        }
    }
    println!("{report}");
    assert_eq!(bad, 0, "\n{report}");
}
