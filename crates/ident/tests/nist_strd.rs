//! The solver on the NIST Statistical Reference Datasets, from both published starts, against the certified
//! estimates, their standard deviations and residual sums of squares.

use ff_model::{Dual, Scalar};
use ident::covariance::{Unknown, analyse};
use ident::lm::{EvalError, Problem, Settings, minimise};
use nalgebra::DMatrix;
use std::fmt::Write as _;

const MAX: usize = 9;
type D = Dual<f64, MAX>;
type Model = fn(&[D], &[f64]) -> D;

fn c(x: f64) -> D {
    D::constant(x)
}
fn ln(x: D) -> D {
    Dual { re: x.re.ln(), eps: x.eps.map(|e| e / x.re) }
}
fn atan(x: D) -> D {
    Dual { re: x.re.atan(), eps: x.eps.map(|e| e / (1.0 + x.re * x.re)) }
}
fn pow(x: D, p: D) -> D {
    (ln(x) * p).exp()
}
/// `b_0 + b_1 x + ...`
fn poly(b: &[D], x: f64) -> D {
    b.iter().rev().fold(c(0.0), |s, &b| s.scale(x) + b)
}
/// Numerator from `b[..n]`, denominator `1 + x (b[n] + ...)`.
fn rational(b: &[D], n: usize, x: f64) -> D {
    poly(&b[..n], x) / (c(1.0) + poly(&b[n..], x).scale(x))
}
fn bell(b: &[D], x: f64) -> D {
    let z = (c(x) - b[1]) / b[2];
    b[0] * (-(z * z)).exp()
}
fn tone(b: &[D], x: f64) -> D {
    let (s, k) = (c(core::f64::consts::TAU * x) / b[0]).sin_cos();
    b[1] * k + b[2] * s
}

/// Name, text of the file, model.
const SETS: [(&str, &str, Model); 20] = [
    ("Misra1a", include_str!("data/nist/Misra1a.dat"), |b, x| b[0] * (c(1.0) - (-b[1]).scale(x[0]).exp())),
    ("Chwirut2", include_str!("data/nist/Chwirut2.dat"), |b, x| (-b[0]).scale(x[0]).exp() / (b[1] + b[2].scale(x[0]))),
    ("Lanczos3", include_str!("data/nist/Lanczos3.dat"), |b, x| {
        b.chunks(2).fold(c(0.0), |s, p| s + p[0] * (-p[1]).scale(x[0]).exp())
    }),
    ("Gauss1", include_str!("data/nist/Gauss1.dat"), |b, x| {
        b[0] * (-b[1]).scale(x[0]).exp() + bell(&b[2..], x[0]) + bell(&b[5..], x[0])
    }),
    ("DanWood", include_str!("data/nist/DanWood.dat"), |b, x| b[0] * pow(c(x[0]), b[1])),
    ("Kirby2", include_str!("data/nist/Kirby2.dat"), |b, x| rational(b, 3, x[0])),
    ("Hahn1", include_str!("data/nist/Hahn1.dat"), |b, x| rational(b, 4, x[0])),
    ("MGH17", include_str!("data/nist/MGH17.dat"), |b, x| {
        b[0] + b[1] * (-b[3]).scale(x[0]).exp() + b[2] * (-b[4]).scale(x[0]).exp()
    }),
    ("Misra1d", include_str!("data/nist/Misra1d.dat"), |b, x| b[0] * b[1].scale(x[0]) / (c(1.0) + b[1].scale(x[0]))),
    ("Roszman1", include_str!("data/nist/Roszman1.dat"), |b, x| {
        b[0] - b[1].scale(x[0]) - atan(b[2] / (c(x[0]) - b[3])).scale(core::f64::consts::FRAC_1_PI)
    }),
    ("Nelson", include_str!("data/nist/Nelson.dat"), |b, x| b[0] - b[1].scale(x[0]) * (-b[2]).scale(x[1]).exp()),
    ("MGH09", include_str!("data/nist/MGH09.dat"), |b, x| {
        let xx = x[0] * x[0];
        b[0] * (c(xx) + b[1].scale(x[0])) / (c(xx) + b[2].scale(x[0]) + b[3])
    }),
    ("Thurber", include_str!("data/nist/Thurber.dat"), |b, x| rational(b, 4, x[0])),
    ("BoxBOD", include_str!("data/nist/BoxBOD.dat"), |b, x| b[0] * (c(1.0) - (-b[1]).scale(x[0]).exp())),
    ("Rat42", include_str!("data/nist/Rat42.dat"), |b, x| b[0] / (c(1.0) + (b[1] - b[2].scale(x[0])).exp())),
    ("MGH10", include_str!("data/nist/MGH10.dat"), |b, x| b[0] * (b[1] / (c(x[0]) + b[2])).exp()),
    ("Eckerle4", include_str!("data/nist/Eckerle4.dat"), |b, x| {
        let z = (c(x[0]) - b[2]) / b[1];
        b[0] / b[1] * (z * z).scale(-0.5).exp()
    }),
    ("Rat43", include_str!("data/nist/Rat43.dat"), |b, x| {
        b[0] / pow(c(1.0) + (b[1] - b[2].scale(x[0])).exp(), c(1.0) / b[3])
    }),
    ("Bennett5", include_str!("data/nist/Bennett5.dat"), |b, x| b[0] * pow(b[1] + c(x[0]), -(c(1.0) / b[2]))),
    ("ENSO", include_str!("data/nist/ENSO.dat"), |b, x| {
        let year = tone(&[c(12.0), b[1], b[2]], x[0]);
        b[0] + year + tone(&b[3..6], x[0]) + tone(&b[6..9], x[0])
    }),
];

struct Set {
    starts: [Vec<f64>; 2],
    certified: Vec<f64>,
    deviation: Vec<f64>,
    rss: f64,
    y: Vec<f64>,
    x: Vec<Vec<f64>>,
}

fn read(text: &str) -> Set {
    let numbers = |l: &str| -> Vec<f64> { l.split_whitespace().filter_map(|w| w.parse().ok()).collect() };
    let lines: Vec<&str> = text.lines().collect();
    let data = lines.iter().rposition(|l| l.starts_with("Data:")).unwrap_or(0);
    let mut set =
        Set { starts: [vec![], vec![]], certified: vec![], deviation: vec![], rss: 0.0, y: vec![], x: vec![] };
    for l in &lines[..data] {
        if let Some((name, rest)) = l.split_once('=')
            && name.trim().strip_prefix('b').is_some_and(|k| k.parse::<usize>().is_ok())
            && numbers(rest).len() == 4
        {
            let v = numbers(rest);
            set.starts[0].push(v[0]);
            set.starts[1].push(v[1]);
            set.certified.push(v[2]);
            set.deviation.push(v[3]);
        }
        if l.starts_with("Residual Sum of Squares:") {
            set.rss = numbers(l)[0];
        }
    }
    for l in &lines[data + 1..] {
        let v = numbers(l);
        if v.len() >= 2 {
            set.y.push(v[0]);
            set.x.push(v[1..].to_vec());
        }
    }
    set
}

struct Fit<'a> {
    set: &'a Set,
    model: Model,
}

impl Problem for Fit<'_> {
    fn dim(&self) -> usize {
        self.set.certified.len()
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        let b: Vec<D> = x.iter().map(|&v| c(v)).collect();
        r.clear();
        r.extend(self.set.x.iter().zip(&self.set.y).map(|(x, y)| (self.model)(&b, x).re - y));
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        let b: Vec<D> = x.iter().enumerate().map(|(i, &v)| D::variable(v, i)).collect();
        r.clear();
        *j = DMatrix::zeros(self.set.y.len(), x.len());
        for (i, (x, y)) in self.set.x.iter().zip(&self.set.y).enumerate() {
            let f = (self.model)(&b, x);
            r.push(f.re - y);
            for k in 0..b.len() {
                j[(i, k)] = f.eps[k];
            }
        }
        Ok(())
    }
}

/// Correct significant digits, NIST's log relative error, at most 11 (the digits certified).
fn digits(a: f64, certified: f64) -> f64 {
    (-((a - certified) / certified).abs().log10()).min(11.0)
}

#[test]
fn certified_estimates_are_reached_from_both_starts() {
    let (mut report, mut bad) = (String::new(), 0);
    for (name, text, model) in SETS {
        let mut set = read(text);
        if name == "Nelson" {
            set.y.iter_mut().for_each(|y| *y = y.ln());
        }
        for k in 0..2 {
            // Certification asks for digits, not for a fraction of a standard deviation.
            let settings = Settings {
                decrement_tolerance: 1e-24,
                step_tolerance: 0.0,
                max_iterations: 2000,
                ..Settings::default()
            };
            let start = set.starts[k].clone();
            let line = match minimise(&mut Fit { set: &set, model }, &start, &settings) {
                Err(e) => {
                    bad += 1;
                    format!("{e}")
                }
                Ok(s) => {
                    let b = s.x.iter().zip(&set.certified).map(|(a, c)| digits(*a, *c)).fold(11.0, f64::min);
                    let rss = digits(2.0 * s.cost, set.rss);
                    // Certified deviations are those of residuals with unknown, equal variance.
                    let unknown = |v: &f64| Unknown { name: String::new(), unit: String::new(), size: v.abs() };
                    let u = analyse(&s.jacobian, &s.x.iter().map(unknown).collect::<Vec<_>>(), 1e-14).unwrap();
                    let noise = (2.0 * s.cost / (set.y.len() - s.x.len()) as f64).sqrt();
                    let sd = u.deviation.iter().zip(&set.deviation);
                    let sd = sd.map(|(a, c)| digits(noise * a.unwrap_or(0.0), *c)).fold(11.0, f64::min);
                    bad += usize::from(sd < 6.0);
                    bad += usize::from(b < 6.5 || !s.status.is_converged());
                    format!("{b:5.1} {sd:5.1} {rss:5.1} digits, {:4} evaluations, {:?}", s.evaluations, s.status)
                }
            };
            writeln!(report, "{name:9} start {} {line}", k + 1).unwrap();
        }
    }
    println!("{report}");
    assert_eq!(bad, 0, "\n{report}");
}
