//! An oscillator on the base that the model does not have: a second tank, an antenna on a spring.
//!
//! Relative to its mount it moves along coordinates y whose momentum is `N^T V` per base twist V, with N scaled to unit modal mass:
//!
//! ```text
//! y'' + 2 zeta omega y' + omega^2 y = -N^T a          a = dV/dt + omega x v, the acceleration of the base
//! wrench on the base                  -N y''  =  P u''        u'' + 2 zeta omega u' + omega^2 u = a,   P = N N^T
//! ```
//!
//! (P. Hughes, *Spacecraft Attitude Dynamics*, 1986, ch. 4: modal momentum coefficients). The model's own prediction gives `a`, so that
//! the wrench is linear in the 21 elements of the symmetric effective inertia `P` (kg, kg m, kg m^2; about the base's origin in base
//! axes, linear before angular): columns like those of any other wrench. To first order the reaction on `a` changes frequency and size
//! alone: omega is the frequency as a record shows it, base free and joints held, and P is larger than that of the mounted part by
//! `1 / (1 - mu)` with mu its share of the moving inertia.

use ff_least_squares::{EvalError, Problem, Settings, minimise};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Elements of a symmetric effective inertia.
pub const ELEMENTS: usize = 21;

/// Names of wrench components.
const WRENCH: [&str; 6] = ["fx", "fy", "fz", "nx", "ny", "nz"];

/// Row and column of every element of the effective inertia, upper triangle row by row.
pub fn elements() -> impl Iterator<Item = (usize, usize)> {
    (0..6).flat_map(|i| (i..6).map(move |j| (i, j)))
}

/// An oscillator that the model does not have.
///
/// ```
/// use ident::uncertain::Oscillator;
///
/// let fuel = Oscillator { frequency_hz: 0.35, damping_ratio: 0.04, inertia: None };
/// assert!(fuel.is_valid() && !Oscillator { damping_ratio: 1.2, ..fuel }.is_valid());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Oscillator {
    /// Natural frequency (Hz), base free.
    pub frequency_hz: f64,
    /// Part of critical damping, below one.
    pub damping_ratio: f64,
    /// Elements of the effective inertia at which derivatives with respect to frequency and damping are taken.
    pub inertia: Option<[f64; ELEMENTS]>,
}

impl Oscillator {
    /// Whether it oscillates.
    pub fn is_valid(&self) -> bool {
        self.frequency_hz > 0.0 && self.frequency_hz.is_finite() && (0.0..1.0).contains(&self.damping_ratio)
    }
    /// `u''` and its derivatives with respect to frequency (Hz) and damping ratio, samples x 6 each, from rest under accelerations
    /// (samples x 6) on a grid of `dt` seconds. Classical Runge-Kutta, one step per sample, accelerations between samples by cubics.
    pub(crate) fn response(&self, accelerations: &DMatrix<f64>, dt: f64) -> [DMatrix<f64>; 3] {
        let samples = accelerations.nrows();
        let mut out = [(); 3].map(|()| DMatrix::zeros(samples, 6));
        let omega = core::f64::consts::TAU * self.frequency_hz;
        let (c, k) = (2.0 * self.damping_ratio * omega, omega * omega);
        // u, u', and the derivatives of both with respect to omega and the damping ratio.
        let second = |x: &[f64; 6], a: f64| {
            let by_omega = -2.0 * self.damping_ratio * x[1] - 2.0 * omega * x[0] - c * x[3] - k * x[2];
            let by_damping = -2.0 * omega * x[1] - c * x[5] - k * x[4];
            [a - c * x[1] - k * x[0], by_omega, by_damping]
        };
        let slope = |x: &[f64; 6], a: f64| {
            let s = second(x, a);
            [x[1], s[0], x[3], s[1], x[5], s[2]]
        };
        let ahead = |x: &[f64; 6], by: f64, s: &[f64; 6]| -> [f64; 6] { core::array::from_fn(|i| x[i] + by * s[i]) };
        for axis in 0..6 {
            let a = |i: isize| accelerations[(i.clamp(0, samples as isize - 1) as usize, axis)];
            let mut x = [0.0; 6];
            for i in 0..samples {
                let s = second(&x, a(i as isize));
                out[0][(i, axis)] = s[0];
                out[1][(i, axis)] = core::f64::consts::TAU * s[1];
                out[2][(i, axis)] = s[2];
                let i = i as isize;
                let middle = (9.0 * (a(i) + a(i + 1)) - a(i - 1) - a(i + 2)) / 16.0;
                let s1 = slope(&x, a(i));
                let s2 = slope(&ahead(&x, 0.5 * dt, &s1), middle);
                let s3 = slope(&ahead(&x, 0.5 * dt, &s2), middle);
                let s4 = slope(&ahead(&x, dt, &s3), a(i + 1));
                let mean: [f64; 6] = core::array::from_fn(|i| (s1[i] + 2.0 * (s2[i] + s3[i]) + s4[i]) / 6.0);
                x = ahead(&x, dt, &mean);
            }
        }
        out
    }
}

/// What is asked of an oscillator: an element of its effective inertia, its frequency or its damping.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OscillatorColumn {
    /// An element, among [`elements`].
    Inertia(usize),
    /// The frequency (Hz).
    Frequency,
    /// The damping ratio.
    Damping,
}

impl OscillatorColumn {
    /// Its name behind that of the oscillator.
    pub(crate) fn name(self) -> String {
        match self {
            Self::Inertia(k) => {
                elements().nth(k).map_or_else(String::new, |(i, j)| format!("{}.{}", WRENCH[i], WRENCH[j]))
            }
            Self::Frequency => "frequency".into(),
            Self::Damping => "damping".into(),
        }
    }
    /// Its SI unit.
    pub(crate) fn unit(self) -> &'static str {
        match self {
            Self::Inertia(k) => match elements().nth(k) {
                Some((i, j)) if j < 3 && i < 3 => "kg",
                Some((i, j)) if i >= 3 && j >= 3 => "kg m^2",
                _ => "kg m",
            },
            Self::Frequency => "Hz",
            Self::Damping => "1",
        }
    }
    /// Whether there is such a column.
    pub(crate) fn exists(self) -> bool {
        !matches!(self, Self::Inertia(k) if k >= ELEMENTS)
    }
}

/// The wrench on the base per unit of a column, at every sample: what the closure of a disturbance interpolates.
pub(crate) fn wrenches(
    of: &Oscillator,
    column: OscillatorColumn,
    [second, by_frequency, by_damping]: &[DMatrix<f64>; 3],
) -> DMatrix<f64> {
    let product = |p: &[f64; ELEMENTS], u: &DMatrix<f64>| {
        let mut out = DMatrix::zeros(u.nrows(), 6);
        for (weight, (i, j)) in p.iter().zip(elements()) {
            out.column_mut(i).axpy(*weight, &u.column(j), 1.0);
            if i != j {
                out.column_mut(j).axpy(*weight, &u.column(i), 1.0);
            }
        }
        out
    };
    let held = of.inertia.unwrap_or([0.0; ELEMENTS]);
    match column {
        OscillatorColumn::Inertia(k) => product(&core::array::from_fn(|e| f64::from(u8::from(e == k))), second),
        OscillatorColumn::Frequency => product(&held, by_frequency),
        OscillatorColumn::Damping => product(&held, by_damping),
    }
}

/// Rows of wrenches on a grid of `dt` seconds at any time, by cubics through the four nearest samples.
pub(crate) fn at(wrenches: &DMatrix<f64>, dt: f64, t: f64) -> [f64; 6] {
    let last = wrenches.nrows().saturating_sub(1);
    if last < 3 {
        return core::array::from_fn(|c| wrenches[((t / dt).round().clamp(0.0, last as f64) as usize, c)]);
    }
    let x = (t / dt).clamp(0.0, last as f64);
    let first = (x.floor() as usize).saturating_sub(1).min(last - 3);
    let f = x - first as f64;
    let weights = [
        -(f - 1.0) * (f - 2.0) * (f - 3.0) / 6.0,
        f * (f - 2.0) * (f - 3.0) / 2.0,
        -f * (f - 1.0) * (f - 3.0) / 2.0,
        f * (f - 1.0) * (f - 2.0) / 6.0,
    ];
    core::array::from_fn(|c| (0..4).map(|k| weights[k] * wrenches[(first + k, c)]).sum())
}

/// The effective inertia as a matrix.
pub fn effective_inertia(of: &[f64; ELEMENTS]) -> nalgebra::Matrix6<f64> {
    let mut out = nalgebra::Matrix6::zeros();
    for (&x, (i, j)) in of.iter().zip(elements()) {
        (out[(i, j)], out[(j, i)]) = (x, x);
    }
    out
}

/// An effective inertia that can exist, nearest to an estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Coordinates that move at the frequency: one for a hinge or a spring, two for fuel.
    pub coordinates: usize,
    /// `N` in its columns (see [`Oscillator`]): linear before angular momentum.
    pub momenta: DMatrix<f64>,
    /// By how much chi-squared rises from the estimate.
    pub misfit: f64,
    /// Effective mass: the trace over forces (kg), with its standard deviation.
    pub mass: (f64, f64),
    /// Effective inertia about the base's origin: the trace over moments (kg m^2), with its standard deviation.
    pub moment: (f64, f64),
}

/// `P(N) - P`, weighted by the root of the information about `P`.
struct Nearest<'a> {
    estimate: &'a [f64; ELEMENTS],
    /// Its rows times an error of `P` are whitened.
    root: &'a DMatrix<f64>,
    coordinates: usize,
}

impl Nearest<'_> {
    fn product(&self, x: &[f64]) -> DVector<f64> {
        let sum = |(i, j): (usize, usize)| (0..self.coordinates).map(|k| x[6 * k + i] * x[6 * k + j]).sum();
        DVector::from_iterator(ELEMENTS, elements().map(sum))
    }
    /// Derivatives of [`Nearest::product`].
    fn slope(&self, x: &[f64]) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(ELEMENTS, x.len());
        for (row, (i, j)) in elements().enumerate() {
            for k in 0..self.coordinates {
                out[(row, 6 * k + i)] += x[6 * k + j];
                out[(row, 6 * k + j)] += x[6 * k + i];
            }
        }
        out
    }
}

impl Problem for Nearest<'_> {
    fn dim(&self) -> usize {
        6 * self.coordinates
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        let error = self.product(x) - DVector::from_row_slice(self.estimate);
        r.clear();
        r.extend((self.root * error).iter());
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        self.residuals(x, r)?;
        *j = self.root * self.slope(x);
        Ok(())
    }
}

impl Shape {
    /// The effective inertia of so many coordinates that is nearest to an estimate with this covariance of its elements; rotations are
    /// compared with displacements by a `length` (m). `None` where the covariance is none, or nothing positive is near. Allocates.
    pub fn nearest(
        estimate: &[f64; ELEMENTS],
        covariance: &DMatrix<f64>,
        coordinates: usize,
        length: f64,
    ) -> Option<Self> {
        let root = covariance.clone().try_inverse()?.cholesky()?.l().transpose();
        let metric = |i: usize| if i < 3 { 1.0 } else { length };
        let p = effective_inertia(estimate);
        let eigen = SymmetricEigen::new(DMatrix::from_fn(6, 6, |i, j| p[(i, j)] / (metric(i) * metric(j))));
        let mut order: Vec<usize> = (0..6).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let size = eigen.eigenvalues.amax();
        // What the estimate knows least of may have the largest eigenvalue: other directions are starts as well.
        let start = |skipped: usize| -> Vec<f64> {
            let own = order.iter().cycle().skip(skipped).take(coordinates);
            let column = |&k: &usize| {
                let by = eigen.eigenvalues[k].max(1e-3 * size).sqrt();
                (0..6)
                    .map(move |i| (i, k, by))
                    .map(|(i, k, by)| by * metric(i) * eigen.eigenvectors[(i, k)])
                    .collect::<Vec<_>>()
            };
            own.flat_map(column).collect()
        };
        let mut problem = Nearest { estimate, root: &root, coordinates };
        let settings = Settings { max_iterations: 200, ..Settings::default() };
        let ends = (0..4).filter_map(|k| minimise(&mut problem, &start(k), &settings).ok());
        let best = ends.min_by(|a, b| norm(&a.residuals).total_cmp(&norm(&b.residuals)))?;
        let (x, misfit) = (best.x, norm(&best.residuals));
        let slope = &root * problem.slope(&x);
        // Coordinates of one frequency can be mixed, which changes nothing.
        let deviations = (slope.transpose() * &slope).pseudo_inverse(1e-12).ok()?;
        let trace = |from: usize| {
            let of = |i: usize| (from..from + 3).contains(&(i % 6));
            let value = x.iter().enumerate().filter(|(i, _)| of(*i)).map(|(_, x)| x * x).sum::<f64>();
            let gradient = DVector::from_fn(x.len(), |i, _| if of(i) { 2.0 * x[i] } else { 0.0 });
            (value, (gradient.transpose() * &deviations * &gradient)[0].max(0.0).sqrt())
        };
        let (mass, moment) = (trace(0), trace(3));
        Some(Self { coordinates, momenta: DMatrix::from_column_slice(6, coordinates, &x), misfit, mass, moment })
    }
    /// Its effective inertia.
    pub fn inertia(&self) -> [f64; ELEMENTS] {
        let p = &self.momenta * self.momenta.transpose();
        let mut out = [0.0; ELEMENTS];
        out.iter_mut().zip(elements()).for_each(|(o, at)| *o = p[at]);
        out
    }
}

fn norm(r: &[f64]) -> f64 {
    r.iter().map(|r| r * r).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;

    #[test]
    fn the_response_to_a_step_is_the_closed_form_and_its_derivatives_are_differences() {
        let of = |frequency_hz: f64, damping_ratio: f64| Oscillator { frequency_hz, damping_ratio, inertia: None };
        let (dt, samples) = (0.05, 800);
        let a = DMatrix::from_fn(samples, 6, |_, j| 1.0 + j as f64);
        let y = of(0.45, 0.05).response(&a, dt);
        let omega: f64 = core::f64::consts::TAU * 0.45;
        let damped = omega * (1.0f64 - 0.05 * 0.05).sqrt();
        for i in 0..samples {
            let t = dt * i as f64;
            // u'' of a unit step from rest.
            let tangent = 0.05 * omega / damped;
            let exact = (-0.05 * omega * t).exp() * ((damped * t).cos() - tangent * (damped * t).sin());
            assert_within!((y[0][(i, 0)] - exact).abs(), 1e-4);
            assert_within!((y[0][(i, 3)] - 4.0 * exact).abs(), 4e-4);
        }
        let h = 1e-5;
        for (k, (up, down)) in
            [(of(0.45 + h, 0.05), of(0.45 - h, 0.05)), (of(0.45, 0.05 + h), of(0.45, 0.05 - h))].iter().enumerate()
        {
            let difference = (&up.response(&a, dt)[0] - &down.response(&a, dt)[0]) / (2.0 * h);
            assert_within!((difference - &y[k + 1]).amax(), 1e-5 * y[k + 1].amax());
        }
    }

    #[test]
    fn wrenches_are_the_inertia_times_the_response_between_samples_too() {
        let inertia: [f64; ELEMENTS] = core::array::from_fn(|k| 0.3 + 0.1 * k as f64);
        let of = Oscillator { frequency_hz: 0.7, damping_ratio: 0.02, inertia: Some(inertia) };
        let dt = 0.02;
        let a = DMatrix::from_fn(400, 6, |i, j| (0.9 * dt * i as f64 + j as f64).sin());
        let response = of.response(&a, dt);
        let sum = (0..ELEMENTS).fold(DMatrix::zeros(400, 6), |sum, k| {
            sum + inertia[k] * wrenches(&of, OscillatorColumn::Inertia(k), &response)
        });
        let p = effective_inertia(&inertia);
        for i in [0, 17, 399] {
            let whole = p * response[0].row(i).transpose();
            assert_within!((sum.row(i).transpose() - whole).amax(), 1e-12);
        }
        let smooth = DMatrix::from_fn(50, 6, |i, c| (1.3 * dt * i as f64 + c as f64).cos());
        for t in [0.003, 0.451, 0.977] {
            let read = at(&smooth, dt, t);
            (0..6).for_each(|c| assert_within!((read[c] - (1.3 * t + c as f64).cos()).abs(), 1e-7));
        }
    }

    #[test]
    fn the_nearest_inertia_is_that_of_the_coordinates_it_was_made_of() {
        let (first, second) = ([1.5, 0.1, 0.0, 0.0, 0.6, -0.2], [0.0, 1.2, -0.3, -0.6, 0.0, 0.4]);
        let of = |columns: &[[f64; 6]]| -> [f64; ELEMENTS] {
            let mut out = [0.0; ELEMENTS];
            for p in columns {
                out.iter_mut().zip(elements()).for_each(|(o, (i, j))| *o += p[i] * p[j]);
            }
            out
        };
        // Masses are known a hundred times worse than inertias.
        let deviation = |k: usize| match elements().nth(k).unwrap() {
            (i, j) if i < 3 && j < 3 => 0.1,
            (i, j) if i >= 3 && j >= 3 => 1e-3,
            _ => 1e-2,
        };
        let covariance =
            DMatrix::from_fn(ELEMENTS, ELEMENTS, |i, j| deviation(i) * deviation(j) * if i == j { 1.0 } else { 0.3 });
        let fuel = of(&[first, second]);
        let two = Shape::nearest(&fuel, &covariance, 2, 0.7).unwrap();
        assert_within!(two.misfit, 1e-6);
        two.inertia().iter().zip(&fuel).for_each(|(a, b)| assert_within!((a - b).abs(), 1e-6));
        assert_within!((two.mass.0 - (1.5f64.powi(2) + 0.01 + 1.44 + 0.09)).abs(), 1e-6);
        assert!(Shape::nearest(&fuel, &covariance, 1, 0.7).unwrap().misfit > 100.0);
        // Three deviations off in a mass, and so negative: the moments hold the mode.
        let mut hinge = of(&[[0.05, 0.0, 0.0, 0.0, 0.6, -0.2]]);
        hinge[0] -= 0.3;
        let one = Shape::nearest(&hinge, &covariance, 1, 0.7).unwrap();
        assert!(one.misfit < 40.0 && (one.moment.0 - 0.4).abs() < 4.0 * one.moment.1 && one.moment.1 < 0.01, "{one:?}");
    }
}
