//! The NIST Statistical Reference Datasets for nonlinear regression: the test of a least-squares solver.
//!
//! 27 problems, each with data, a model, two starts (the first far from the solution, the second near it), and estimates,
//! their standard deviations and residual sum of squares certified to eleven digits, found in 500 digits of arithmetic
//! (<https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml>). The files in `fixtures/nist` are the originals; a solver is
//! judged by [`digits`], the log relative error of its worst parameter. Derivatives are exact (forward duals).

use ff_model::{Dual, Scalar};
use nalgebra::DMatrix;
use std::path::{Path, PathBuf};

/// Most parameters of any problem.
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
/// Exponential, and two bells.
fn gauss(b: &[D], x: &[f64]) -> D {
    b[0] * (-b[1]).scale(x[0]).exp() + bell(&b[2..], x[0]) + bell(&b[5..], x[0])
}
/// Three exponentials.
fn lanczos(b: &[D], x: &[f64]) -> D {
    b.chunks(2).fold(c(0.0), |s, p| s + p[0] * (-p[1]).scale(x[0]).exp())
}
fn chwirut(b: &[D], x: &[f64]) -> D {
    (-b[0]).scale(x[0]).exp() / (b[1] + b[2].scale(x[0]))
}
fn decay(b: &[D], x: &[f64]) -> D {
    b[0] * (c(1.0) - (-b[1]).scale(x[0]).exp())
}

/// Name and model of every problem, in NIST's order of difficulty.
const MODELS: [(&str, Model); 27] = [
    ("Misra1a", decay),
    ("Chwirut2", chwirut),
    ("Chwirut1", chwirut),
    ("Lanczos3", lanczos),
    ("Gauss1", gauss),
    ("Gauss2", gauss),
    ("DanWood", |b, x| b[0] * pow(c(x[0]), b[1])),
    ("Misra1b", |b, x| {
        let base = c(1.0) + b[1].scale(0.5 * x[0]);
        b[0] * (c(1.0) - c(1.0) / (base * base))
    }),
    ("Kirby2", |b, x| rational(b, 3, x[0])),
    ("Hahn1", |b, x| rational(b, 4, x[0])),
    ("Nelson", |b, x| b[0] - b[1].scale(x[0]) * (-b[2]).scale(x[1]).exp()),
    ("MGH17", |b, x| b[0] + b[1] * (-b[3]).scale(x[0]).exp() + b[2] * (-b[4]).scale(x[0]).exp()),
    ("Lanczos1", lanczos),
    ("Lanczos2", lanczos),
    ("Gauss3", gauss),
    ("Misra1c", |b, x| b[0] * (c(1.0) - pow(c(1.0) + b[1].scale(2.0 * x[0]), c(-0.5)))),
    ("Misra1d", |b, x| b[0] * b[1].scale(x[0]) / (c(1.0) + b[1].scale(x[0]))),
    ("Roszman1", |b, x| b[0] - b[1].scale(x[0]) - atan(b[2] / (c(x[0]) - b[3])).scale(core::f64::consts::FRAC_1_PI)),
    ("ENSO", |b, x| {
        let year = tone(&[c(12.0), b[1], b[2]], x[0]);
        b[0] + year + tone(&b[3..6], x[0]) + tone(&b[6..9], x[0])
    }),
    ("MGH09", |b, x| {
        let xx = x[0] * x[0];
        b[0] * (c(xx) + b[1].scale(x[0])) / (c(xx) + b[2].scale(x[0]) + b[3])
    }),
    ("Thurber", |b, x| rational(b, 4, x[0])),
    ("BoxBOD", decay),
    ("Rat42", |b, x| b[0] / (c(1.0) + (b[1] - b[2].scale(x[0])).exp())),
    ("MGH10", |b, x| b[0] * (b[1] / (c(x[0]) + b[2])).exp()),
    ("Eckerle4", |b, x| {
        let z = (c(x[0]) - b[2]) / b[1];
        b[0] / b[1] * (z * z).scale(-0.5).exp()
    }),
    ("Rat43", |b, x| b[0] / pow(c(1.0) + (b[1] - b[2].scale(x[0])).exp(), c(1.0) / b[3])),
    ("Bennett5", |b, x| b[0] * pow(b[1] + c(x[0]), -(c(1.0) / b[2]))),
];

/// One problem.
#[derive(Clone, Debug)]
pub struct Problem {
    /// NIST's name.
    pub name: &'static str,
    /// The two starts.
    pub starts: [Vec<f64>; 2],
    /// Certified estimates.
    pub certified: Vec<f64>,
    /// Their certified standard deviations.
    pub deviation: Vec<f64>,
    /// Certified residual sum of squares.
    pub rss: f64,
    model: Model,
    y: Vec<f64>,
    x: Vec<Vec<f64>>,
}

/// Why a problem cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum NistError {
    /// No file.
    #[error("{}: {source}; the files are in fixtures/nist", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why not.
        #[source]
        source: std::io::Error,
    },
    /// Not a file of NIST's.
    #[error("{}: {what}; restore the file (cargo xtask fixtures --check)", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
}

/// All 27 problems, from a folder with NIST's files.
///
/// # Errors
/// [`NistError`].
pub fn problems(folder: &Path) -> Result<Vec<Problem>, NistError> {
    MODELS.iter().map(|(name, model)| read(folder, name, *model)).collect()
}

fn read(folder: &Path, name: &'static str, model: Model) -> Result<Problem, NistError> {
    let path = folder.join(format!("{name}.dat"));
    let text = std::fs::read_to_string(&path).map_err(|source| NistError::Io { path: path.clone(), source })?;
    let wrong = |what: String| NistError::Format { path: path.clone(), what };
    let numbers = |l: &str| -> Vec<f64> { l.split_whitespace().filter_map(|w| w.parse().ok()).collect() };
    let lines: Vec<&str> = text.lines().collect();
    let data = lines.iter().rposition(|l| l.starts_with("Data:"));
    let data = data.ok_or_else(|| wrong("no line 'Data:'".into()))?;
    let mut p = Problem {
        name,
        starts: [vec![], vec![]],
        certified: vec![],
        deviation: vec![],
        rss: f64::NAN,
        model,
        y: vec![],
        x: vec![],
    };
    let mut observations = None;
    for l in &lines[..data] {
        if let Some((name, rest)) = l.split_once('=')
            && name.trim().strip_prefix('b').is_some_and(|k| k.parse::<usize>().is_ok())
            && numbers(rest).len() == 4
        {
            let v = numbers(rest);
            p.starts[0].push(v[0]);
            p.starts[1].push(v[1]);
            p.certified.push(v[2]);
            p.deviation.push(v[3]);
        }
        if l.starts_with("Residual Sum of Squares:") {
            p.rss = numbers(l).first().copied().unwrap_or(f64::NAN);
        }
        if l.starts_with("Number of Observations:") {
            observations = numbers(l).first().map(|n| *n as usize);
        }
    }
    for l in &lines[data + 1..] {
        let v = numbers(l);
        if v.len() >= 2 {
            p.y.push(v[0]);
            p.x.push(v[1..].to_vec());
        }
    }
    // Nelson's model is one of the logarithm.
    if name == "Nelson" {
        p.y.iter_mut().for_each(|y| *y = y.ln());
    }
    if p.certified.is_empty() || p.certified.len() > MAX || !p.rss.is_finite() {
        return Err(wrong("no certified values".into()));
    }
    // Some files give the count in the header only as a word; where it is a number it must be met.
    match observations {
        Some(n) if n != p.y.len() => Err(wrong(format!("{} rows of data, {n} announced", p.y.len()))),
        _ => Ok(p),
    }
}

impl Problem {
    /// Number of observations.
    pub fn observations(&self) -> usize {
        self.y.len()
    }
    /// Residuals `f(x) - y` at the parameters `b`.
    pub fn residuals(&self, b: &[f64], r: &mut Vec<f64>) {
        let b: Vec<D> = b.iter().map(|&v| c(v)).collect();
        r.clear();
        r.extend(self.x.iter().zip(&self.y).map(|(x, y)| (self.model)(&b, x).re - y));
    }
    /// Residuals and their exact derivatives.
    pub fn jacobian(&self, b: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) {
        let b: Vec<D> = b.iter().enumerate().map(|(i, &v)| D::variable(v, i)).collect();
        r.clear();
        j.resize_mut(self.y.len(), b.len(), 0.0);
        for (i, (x, y)) in self.x.iter().zip(&self.y).enumerate() {
            let f = (self.model)(&b, x);
            r.push(f.re - y);
            (0..b.len()).for_each(|k| j[(i, k)] = f.eps[k]);
        }
    }
    /// Correct significant digits of the worst parameter.
    pub fn worst_digits(&self, b: &[f64]) -> f64 {
        b.iter().zip(&self.certified).map(|(a, c)| digits(*a, *c)).fold(CERTIFIED, f64::min)
    }
}

/// Digits that NIST certifies.
pub const CERTIFIED: f64 = 11.0;

/// Correct significant digits: NIST's log relative error, between 0 and [`CERTIFIED`].
pub fn digits(a: f64, certified: f64) -> f64 {
    let d = -((a - certified) / certified).abs().log10();
    if d.is_nan() { 0.0 } else { d.clamp(0.0, CERTIFIED) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;

    fn all() -> Vec<Problem> {
        problems(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/nist")).unwrap()
    }

    #[test]
    fn the_certified_values_give_the_certified_residuals() {
        for p in all() {
            let mut r = Vec::new();
            p.residuals(&p.certified, &mut r);
            let rss: f64 = r.iter().map(|x| x * x).sum();
            // What the eleven digits of the parameters leave of the residuals.
            let (mut r, mut j) = (Vec::new(), DMatrix::zeros(0, 0));
            p.jacobian(&p.certified, &mut r, &mut j);
            let cut = (0..j.ncols()).map(|k| j.column(k).norm() * p.certified[k].abs() * 1e-10).sum::<f64>();
            assert!((rss.sqrt() - p.rss.sqrt()).abs() < cut + 1e-10 * p.rss.sqrt(), "{}: {rss:e}", p.name);
            assert_eq!(r.len(), p.observations());
        }
    }

    #[test]
    fn derivatives_are_those_of_the_model() {
        for p in all() {
            let b = &p.starts[1];
            let (mut r, mut j) = (Vec::new(), DMatrix::zeros(0, 0));
            p.jacobian(b, &mut r, &mut j);
            let (mut plus, mut minus) = (Vec::new(), Vec::new());
            for k in 0..b.len() {
                let h = 1e-6 * b[k].abs();
                let at = |h: f64| {
                    let mut x = b.clone();
                    x[k] += h;
                    x
                };
                p.residuals(&at(h), &mut plus);
                p.residuals(&at(-h), &mut minus);
                let scale = j.column(k).amax();
                for i in 0..r.len() {
                    let d = (plus[i] - minus[i]) / (2.0 * h);
                    assert_within!((j[(i, k)] - d).abs(), 1e-5 * scale, "{} b{}: {} {d}", p.name, k + 1, j[(i, k)]);
                }
            }
        }
    }

    #[test]
    fn digits_are_counted() {
        assert!((digits(1.2345, 1.2346) - 4.09).abs() < 0.01);
        assert_eq!((digits(2.0, 2.0), digits(-5.0, 2.0), digits(f64::NAN, 2.0)), (11.0, 0.0, 0.0));
    }

    #[test]
    fn damaged_files_are_refused() {
        let dir = std::env::temp_dir().join(format!("nist-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let text =
            std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/nist/Misra1a.dat"))
                .unwrap();
        let cut = text.trim_end().rsplit_once('\n').unwrap().0;
        std::fs::write(dir.join("Misra1a.dat"), cut).unwrap();
        let e = problems(&dir).unwrap_err().to_string();
        assert!(e.contains("13 rows of data, 14 announced"), "{e}");
        std::fs::remove_dir_all(&dir).unwrap();
        assert!(matches!(problems(&dir), Err(NistError::Io { .. })));
    }
}
