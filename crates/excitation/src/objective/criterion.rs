//! How an information matrix becomes one number that should be small.
//!
//! With `C` the covariance of the scaled named parameters, nuisance parameters projected out:
//!
//! | criterion | value | slope `dJ/dC` |
//! |---|---|---|
//! | D | `log det C` | `C^-1` |
//! | A | `log tr C` | `1 / tr C` |
//! | E | `log (tr C^p)^(1/p)`, towards `log` of the largest eigenvalue | `C^(p-1) / tr C^p` |
//! | largest | `log (sum_g v_g^p)^(1/2p)`, `v_g = tr R_g C R_g^T`, towards `log` of the largest relative deviation | `sum_g v_g^(p-1) R_g^T R_g / (2 sum v^p)` |
//! | condition | `log [(tr C^p)(tr C^-p)]^(1/2p)`, towards `log cond(Y)` of the regressor `Y`, `C^-1 = Y^T Y` | `(C^(p-1) / tr C^p - C^(-p-1) / tr C^-p) / 2` |
//!
//! A smoothed value exceeds the true logarithm by at most `log(k)/p` (half of that for `largest`) for `k` eigenvalues or
//! quantities. (F. Pukelsheim, *Optimal Design of Experiments*, 2006, chapter 6, has the criteria.) The gradient over the
//! information matrix `F` is `-F^-1 E (dJ/dC) E^T F^-1` with `E` picking the named columns.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// One quantity that depends on the parameters, relative to its own size.
#[derive(Clone, Debug, PartialEq)]
pub struct RelativeQuantity {
    /// What it is.
    pub name: String,
    /// Slopes over the scaled named parameters, divided by the size of the quantity; one row per component. The
    /// relative standard deviation is `sqrt(tr R C R^T)`: for several components, that of the length of the error.
    pub rows: DMatrix<f64>,
}

/// What is made small.
///
/// ```
/// use excitation::Criterion;
/// use nalgebra::DMatrix;
///
/// // Two parameters; twice the information on both makes every variance half.
/// let information = DMatrix::from_row_slice(2, 2, &[40.0, 6.0, 6.0, 9.0]);
/// let value = |c: &Criterion, scale: f64| c.value_slope(&(scale * &information), 2).unwrap().0;
/// for criterion in [Criterion::D, Criterion::A, Criterion::E { power: 8.0 }] {
///     assert!(value(&criterion, 2.0) < value(&criterion, 1.0));
/// }
/// assert!((value(&Criterion::Condition { power: 8.0 }, 2.0) - value(&Criterion::Condition { power: 8.0 }, 1.0)).abs() < 1e-9);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Criterion {
    /// Volume of the confidence ellipsoid: indifferent to the choice of units.
    D,
    /// Mean variance of the scaled parameters.
    A,
    /// Largest eigenvalue of the covariance, smoothed.
    E {
        /// `p >= 1`; 8 is sharp enough.
        power: f64,
    },
    /// Largest relative standard deviation, smoothed.
    Largest {
        /// The quantities that count.
        quantities: Vec<RelativeQuantity>,
        /// `p >= 1`; 8 is sharp enough.
        power: f64,
    },
    /// Condition number of the regressor (scaled columns), smoothed.
    Condition {
        /// `p >= 1`; 8 is sharp enough.
        power: f64,
    },
}

impl Criterion {
    /// Value and gradient over the information matrix `f`, of which the first `named` columns count; `None` where `f` is
    /// not positive definite, or shapes or powers make no sense. Allocates.
    pub fn value_slope(&self, f: &DMatrix<f64>, named: usize) -> Option<(f64, DMatrix<f64>)> {
        let inverse = inverse(f)?;
        let c = inverse.view((0, 0), (named, named)).into_owned();
        let (value, slope) = self.of_covariance(&c)?;
        let e = inverse.columns(0, named);
        let over = -(e * slope * e.transpose());
        (value.is_finite() && over.iter().all(|x| x.is_finite())).then_some((value, over))
    }
    /// Value at the covariance of the scaled named parameters, everything else marginalised; `None` where it is not positive definite, or
    /// shapes or powers make no sense. Allocates.
    ///
    /// ```
    /// use excitation::Criterion;
    /// use nalgebra::DMatrix;
    ///
    /// let covariance = DMatrix::from_row_slice(2, 2, &[0.04, 0.0, 0.0, 0.25]);
    /// assert!((Criterion::D.value(&covariance).unwrap() - 0.01_f64.ln()).abs() < 1e-12);
    /// assert_eq!(Criterion::D.value(&-covariance), None);
    /// ```
    pub fn value(&self, covariance: &DMatrix<f64>) -> Option<f64> {
        self.of_covariance(covariance).map(|v| v.0).filter(|v| v.is_finite())
    }
    fn of_covariance(&self, c: &DMatrix<f64>) -> Option<(f64, DMatrix<f64>)> {
        let n = c.nrows();
        match self {
            Self::D => {
                let chol = c.clone().cholesky()?;
                Some((2.0 * chol.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>(), chol.inverse()))
            }
            Self::A => Some((c.trace().ln(), DMatrix::identity(n, n) / c.trace())),
            Self::E { power } => {
                let spectrum = Spectrum::new(c)?;
                let (value, slope) = spectrum.largest(*power);
                Some((value, spectrum.matrix(&slope)))
            }
            Self::Condition { power } => {
                let spectrum = Spectrum::new(c)?;
                let (high, up) = spectrum.largest(*power);
                let inverse = Spectrum { values: spectrum.values.map(|x| 1.0 / x), ..spectrum.clone() };
                let (low, down) = inverse.largest(*power);
                // d(1/x) = -dx / x^2.
                let slope = DVector::from_fn(n, |i, _| 0.5 * (up[i] - down[i] * inverse.values[i].powi(2)));
                Some((0.5 * (high + low), spectrum.matrix(&slope)))
            }
            Self::Largest { quantities, power } => {
                let fits = quantities.iter().all(|q| q.rows.ncols() == n) && !quantities.is_empty();
                if !fits {
                    return None;
                }
                let variances: Vec<f64> =
                    quantities.iter().map(|q| (&q.rows * c * q.rows.transpose()).trace()).collect();
                let most = variances.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
                let sum: f64 = variances.iter().map(|v| (v / most).powf(*power)).sum();
                let mut slope = DMatrix::zeros(n, n);
                for (q, v) in quantities.iter().zip(&variances) {
                    let weight = 0.5 * (v / most).powf(power - 1.0) / (sum * most);
                    slope.gemm_tr(weight, &q.rows, &q.rows, 1.0);
                }
                Some((0.5 * (most.ln() + sum.ln() / power), slope))
            }
        }
    }
}

/// Relative standard deviation of every quantity for the information matrix `f`, of which the first columns are named;
/// infinite where it is not positive definite. Allocates.
///
/// # Panics
/// If the rows of a quantity are longer than `f`.
pub fn relative_deviations(f: &DMatrix<f64>, quantities: &[RelativeQuantity]) -> Vec<f64> {
    let Some(inverse) = inverse(f) else { return vec![f64::INFINITY; quantities.len()] };
    let one = |q: &RelativeQuantity| {
        let n = q.rows.ncols();
        (&q.rows * inverse.view((0, 0), (n, n)) * q.rows.transpose()).trace().max(0.0).sqrt()
    };
    quantities.iter().map(one).collect()
}

/// Inverse by Cholesky after scaling to a unit diagonal; the largest entries do not hide the smallest.
pub(crate) fn inverse(f: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = f.nrows();
    let d: Vec<f64> = f.diagonal().iter().map(|x| 1.0 / x.sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| f[(i, j)] * d[i] * d[j]);
    if scaled.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let inverse = scaled.cholesky()?.inverse();
    Some(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * d[i] * d[j]))
}

/// Eigenvalues, all positive, and eigenvectors.
#[derive(Clone)]
struct Spectrum {
    values: DVector<f64>,
    vectors: DMatrix<f64>,
}

impl Spectrum {
    fn new(c: &DMatrix<f64>) -> Option<Self> {
        let e = SymmetricEigen::new(c.clone());
        let fine = e.eigenvalues.iter().all(|&x| x > 0.0 && x.is_finite());
        fine.then_some(Self { values: e.eigenvalues, vectors: e.eigenvectors })
    }
    /// `log (sum x^p)^(1/p)` and its slope over every eigenvalue.
    fn largest(&self, power: f64) -> (f64, DVector<f64>) {
        let most = self.values.max();
        let sum: f64 = self.values.iter().map(|x| (x / most).powf(power)).sum();
        (most.ln() + sum.ln() / power, self.values.map(|x| (x / most).powf(power - 1.0) / (sum * most)))
    }
    /// The matrix with the same eigenvectors and the given eigenvalues.
    fn matrix(&self, values: &DVector<f64>) -> DMatrix<f64> {
        &self.vectors * DMatrix::from_diagonal(values) * self.vectors.transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;

    fn information() -> DMatrix<f64> {
        let a = DMatrix::from_fn(9, 5, |i, j| (1.3 * i as f64 + 0.7 * (j * j) as f64 + 0.4).sin() + 0.1 * j as f64);
        a.tr_mul(&a) + DMatrix::from_diagonal(&DVector::from_fn(5, |i, _| 0.05 + 0.02 * i as f64))
    }

    fn quantities() -> Vec<RelativeQuantity> {
        let row = |r: usize, k: f64| DMatrix::from_fn(r, 3, |i, j| (k + 0.8 * i as f64 - 1.1 * j as f64).cos());
        [(1, 0.3), (3, 1.7), (2, 2.9)]
            .into_iter()
            .map(|(r, k)| RelativeQuantity { name: format!("{k}"), rows: row(r, k) })
            .collect()
    }

    #[test]
    fn slopes_match_differences() {
        let f = information();
        for criterion in [
            Criterion::D,
            Criterion::A,
            Criterion::E { power: 8.0 },
            Criterion::Condition { power: 5.0 },
            Criterion::Largest { quantities: quantities(), power: 8.0 },
        ] {
            let (_, slope) = criterion.value_slope(&f, 3).expect("positive definite");
            for i in 0..5 {
                for j in 0..=i {
                    let at = |d: f64| {
                        let mut g = f.clone();
                        g[(i, j)] += d;
                        if i != j {
                            g[(j, i)] += d;
                        }
                        criterion.value_slope(&g, 3).expect("positive definite").0
                    };
                    let h = 1e-4;
                    let num = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                    let want = if i == j { slope[(i, j)] } else { 2.0 * slope[(i, j)] };
                    assert_within!(
                        (want - num).abs(),
                        1e-7 * slope.norm(),
                        "{criterion:?} {i} {j}: {want} against {num}"
                    );
                }
            }
        }
    }

    #[test]
    fn smoothed_values_bound_the_true_ones() {
        let f = information();
        let c = inverse(&f).expect("positive definite").view((0, 0), (3, 3)).into_owned();
        let e = SymmetricEigen::new(c).eigenvalues;
        let value = |c: Criterion| c.value_slope(&f, 3).expect("positive definite").0;
        let (largest, condition) = (e.max().ln(), 0.5 * (e.max() / e.min()).ln());
        let smooth = value(Criterion::E { power: 8.0 });
        assert!(smooth >= largest && smooth <= largest + 3f64.ln() / 8.0);
        let smooth = value(Criterion::Condition { power: 8.0 });
        assert!(smooth >= condition && smooth <= condition + 3f64.ln() / 8.0);
        let std = relative_deviations(&f, &quantities()).into_iter().fold(0.0, f64::max).ln();
        let smooth = value(Criterion::Largest { quantities: quantities(), power: 8.0 });
        assert!(smooth >= std && smooth <= std + 3f64.ln() / 16.0);
        assert!(value(Criterion::Largest { quantities: quantities(), power: 200.0 }) < std + 3e-3);
    }

    #[test]
    fn nuisance_parameters_cost() {
        let f = information();
        let alone = f.view((0, 0), (3, 3)).into_owned();
        let with = Criterion::D.value_slope(&f, 3).expect("positive definite").0;
        assert!(with > Criterion::D.value_slope(&alone, 3).expect("positive definite").0 + 0.01);
        // The Schur complement.
        let (b, d) = (f.view((0, 3), (3, 2)).into_owned(), f.view((3, 3), (2, 2)).into_owned());
        let schur = alone - &b * d.try_inverse().expect("regular") * b.transpose();
        assert_within!((with + schur.determinant().ln()).abs(), 1e-10);
        assert!(Criterion::A.value_slope(&DMatrix::zeros(2, 2), 1).is_none());
    }
}
