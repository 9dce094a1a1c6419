//! Where is the mass that moves in a mode?
//!
//! A point mass m at r that moves along unit vectors `e_k` has the momentum coefficients, at unit modal mass,
//!
//! ```text
//! N_k = [u_k; r x u_k],   u_k = sqrt(m) e_k          effective inertia  sum_k N_k N_k^T
//! ```
//!
//! Of coefficients with their covariance, r and the `u_k` are fitted: a spring-mass or a pendulum moves along two directions that
//! are square to one another, with one and the same mass. Along a single direction r is known but for its part along it; the point
//! nearest to the origin is taken.

use ff_least_squares::{EvalError, Problem, Settings, minimise};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// A point mass that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct PointMass {
    /// Mass that moves along each direction, their mean (kg), with its standard deviation.
    pub mass: (f64, f64),
    /// Where it is at rest (m), with standard deviations.
    pub position: [(f64, f64); 3],
    /// `u_k` in its columns (square root of kg).
    pub directions: DMatrix<f64>,
    /// By how much chi-squared rises from the coefficients that were given.
    pub misfit: f64,
}

/// `N(r, u) - N`, whitened.
struct Nearest<'a> {
    momenta: &'a DMatrix<f64>,
    root: &'a DMatrix<f64>,
}

impl Nearest<'_> {
    fn product(x: &[f64], k: usize) -> [Vector3<f64>; 2] {
        let (r, u) = (Vector3::from_column_slice(&x[..3]), Vector3::from_column_slice(&x[3 + 3 * k..6 + 3 * k]));
        [u, r.cross(&u)]
    }
    fn slope(&self, x: &[f64]) -> DMatrix<f64> {
        let c = self.momenta.ncols();
        let mut out = DMatrix::zeros(6 * c, 3 + 3 * c);
        let r = Vector3::from_column_slice(&x[..3]);
        for k in 0..c {
            let [u, _] = Self::product(x, k);
            out.view_mut((6 * k, 3 + 3 * k), (3, 3)).copy_from(&Matrix3::identity());
            out.view_mut((6 * k + 3, 3 + 3 * k), (3, 3)).copy_from(&r.cross_matrix());
            out.view_mut((6 * k + 3, 0), (3, 3)).copy_from(&-u.cross_matrix());
        }
        out
    }
}

impl Problem for Nearest<'_> {
    fn dim(&self) -> usize {
        3 + 3 * self.momenta.ncols()
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        let mut error = -DVector::from_column_slice(self.momenta.as_slice());
        for k in 0..self.momenta.ncols() {
            for (half, part) in Self::product(x, k).into_iter().enumerate() {
                (0..3).for_each(|i| error[6 * k + 3 * half + i] += part[i]);
            }
        }
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

impl PointMass {
    /// The point mass nearest to momentum coefficients (6 x coordinates, linear before angular) with this covariance, column below column.
    /// `None` where the covariance is none, or nothing moves along a line. Allocates.
    pub fn nearest(momenta: &DMatrix<f64>, covariance: &DMatrix<f64>) -> Option<Self> {
        let c = momenta.ncols();
        let root = covariance.clone().try_inverse()?.cholesky()?.l().transpose();
        // r x u_k = a_k in the sense of least squares.
        let (mut left, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for k in 0..c {
            let (u, a) = (momenta.fixed_view::<3, 1>(0, k).into_owned(), momenta.fixed_view::<3, 1>(3, k).into_owned());
            left += u.cross_matrix().transpose() * u.cross_matrix();
            right += u.cross(&a);
        }
        let at = left.pseudo_inverse(1e-9 * left.norm()).ok()? * right;
        let mut start: Vec<f64> = at.iter().copied().collect();
        (0..c).for_each(|k| start.extend(momenta.fixed_view::<3, 1>(0, k).iter()));
        let mut problem = Nearest { momenta, root: &root };
        let found = minimise(&mut problem, &start, &Settings { max_iterations: 100, ..Settings::default() }).ok()?;
        let misfit = found.residuals.iter().map(|r| r * r).sum();
        let slope = &root * problem.slope(&found.x);
        let deviations = (slope.transpose() * &slope).pseudo_inverse(1e-12).ok()?;
        let directions = DMatrix::from_column_slice(3, c, &found.x[3..]);
        let mass = directions.norm_squared() / c as f64;
        let gradient = DVector::from_fn(3 + 3 * c, |i, _| if i < 3 { 0.0 } else { 2.0 * found.x[i] / c as f64 });
        let of_mass = (gradient.transpose() * &deviations * &gradient)[0].max(0.0).sqrt();
        let position = core::array::from_fn(|i| (found.x[i], deviations[(i, i)].max(0.0).sqrt()));
        (mass > 0.0 && mass.is_finite()).then_some(Self { mass: (mass, of_mass), position, directions, misfit })
    }
    /// Whether it moves along two directions as one mass does, square to one another, to within so many deviations of its mass.
    pub fn is_fuel(&self, deviations: f64) -> bool {
        if self.directions.ncols() != 2 {
            return false;
        }
        let product = self.directions.tr_mul(&self.directions);
        let slack = (deviations * self.mass.1).max(0.1 * self.mass.0);
        (product[(0, 0)] - product[(1, 1)]).abs() < 2.0 * slack && product[(0, 1)].abs() < slack
    }
    /// Unit vector that it does not move along, of two directions.
    pub fn axis(&self) -> Option<Vector3<f64>> {
        if self.directions.ncols() != 2 {
            return None;
        }
        let column = |k: usize| Vector3::from_column_slice(self.directions.column(k).as_slice());
        column(0).cross(&column(1)).try_normalize(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;

    #[test]
    fn fuel_is_found_where_it_is_and_a_hinge_is_none() {
        let (mass, at) = (2.3f64, Vector3::new(0.31, -0.22, 0.17));
        let (e, f) = (Vector3::new(0.6, 0.64, -0.48), Vector3::new(0.8, -0.48, 0.36));
        let column = |e: Vector3<f64>| -> Vec<f64> {
            let u = mass.sqrt() * e;
            u.iter().chain(at.cross(&u).iter()).copied().collect()
        };
        let momenta = DMatrix::from_column_slice(6, 2, &[column(e), column(f)].concat());
        let deviation = |i: usize| if i % 6 < 3 { 0.05 } else { 0.004 };
        let covariance = DMatrix::from_fn(12, 12, |i, j| deviation(i) * deviation(j) * if i == j { 1.0 } else { 0.2 });
        let found = PointMass::nearest(&momenta, &covariance).unwrap();
        assert_within!(found.misfit, 1e-9);
        assert_within!((found.mass.0 - mass).abs(), 1e-6);
        (0..3).for_each(|i| assert_within!((found.position[i].0 - at[i]).abs(), 1e-6));
        assert!(found.is_fuel(3.0) && found.position.iter().all(|p| p.1 > 1e-4 && p.1 < 0.1), "{found:?}");
        assert_within!(found.axis().unwrap().dot(&e).abs() + found.axis().unwrap().dot(&f).abs(), 1e-6);
        // Along one direction, the part of the place along it is not known and left at zero.
        let one =
            PointMass::nearest(&momenta.columns(0, 1).into_owned(), &covariance.view((0, 0), (6, 6)).into_owned());
        let one = one.unwrap();
        let place = Vector3::from(one.position.map(|p| p.0));
        assert_within!((place - (at - e * at.dot(&e) / e.norm_squared())).norm(), 1e-6);
        assert!(!one.is_fuel(3.0) && one.axis().is_none());
        // A hinge turns its body: momentum along its line of action and a moment about it.
        let mut hinge = momenta.columns(0, 1).into_owned();
        (0..3).for_each(|i| hinge[(3 + i, 0)] += 0.2 * e[i]);
        assert!(PointMass::nearest(&hinge, &covariance.view((0, 0), (6, 6)).into_owned()).unwrap().misfit > 40.0);
    }
}
