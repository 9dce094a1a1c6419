//! What a fit takes noise of the joint motion for.
//!
//! A spline through noisy positions moves the model by noise as well. Where a mode lies where the motion has nothing else, its ringing in the
//! prediction is all noise: it is as large as the noise makes it, and not as the robot rings. Its columns say that the record tells the mode's stiffness, and
//! its size in the residuals draws that to where the predicted ringing is least (errors in variables; W. A. Fuller, *Measurement Error Models*, 1987,
//! section 1.1; with noise that is added on purpose: J. R. Cook, L. A. Stefanski, *J. Am. Stat. Assoc.* 89, 1994, 1314). Linearised once more with noise `n_m` of
//! the same kind added to the motion and taken off it,
//!
//! ```text
//! F = mean_m A(+-n_m) - A,   delta_m = -A(n_m)^-1 g(n_m) + A^-1 g,     A = B^T B,  g = B^T r
//! ```
//!
//! F is the information that noise pretends, and delta_m what as much noise again moves the estimates by. Of the `A = L L^T` of the fit, the part
//! `f` of F is no information along the eigenvectors of `L^-1 F L^-T`, and the covariance is
//!
//! ```text
//! L^-T V diag(1 / (1 - f)) V^T L^-1  +  mean_m delta_m delta_m^T.
//! ```

use crate::estimate::estimator::Estimator;
use crate::uncertain::score::{EndOfFit, folded};
use ff_least_squares::EvalError;
use nalgebra::{DMatrix, DVector};

/// Part of the information along a direction that is taken to be real at least: a deviation becomes seven times as wide by this alone.
const REAL: f64 = 0.02;

/// Normal equations at one place and for one motion.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalEquations {
    /// `B^T B` over the unknowns of the base, priors among it.
    pub information: DMatrix<f64>,
    /// `B^T r`.
    pub slope: DVector<f64>,
}

impl NormalEquations {
    /// Goes through the rows of `estimator` once. Allocates the square of the unknowns, and blocks of rows.
    ///
    /// # Errors
    /// [`EvalError`] of the estimator, or of a factorisation of columns that are not finite.
    pub fn new<E: Estimator + ?Sized>(mut estimator: &mut E, at: &EndOfFit<'_>) -> Result<Self, EvalError> {
        let n = at.base.len();
        let (triangle, _) = folded(&mut estimator, at, &mut |_, _| {})?;
        let r = triangle.view((0, 0), (n, n)).into_owned();
        let rest = triangle.view((0, n), (n, 1)).column(0).into_owned();
        Ok(Self { information: r.tr_mul(&r), slope: r.tr_mul(&rest) })
    }
}

/// What noise of the motion adds to the covariance of a fit with the normal equations `fit`, by those with noise added to the motion and taken off
/// it; equations in the page above. `None` where one of them is singular. Allocates.
pub fn covariance_of_motion_noise(fit: &NormalEquations, shaken: &[NormalEquations]) -> Option<DMatrix<f64>> {
    let n = fit.slope.len();
    let size = fit.information.diagonal().map(f64::sqrt);
    let scaled = |a: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| a[(i, j)] / (size[i] * size[j]));
    let still = scaled(&fit.information);
    // In units of the columns.
    let step = |of: &NormalEquations| Some(-scaled(&of.information).cholesky()?.solve(&of.slope.component_div(&size)));
    let own = step(fit)?;
    let lower = still.clone().cholesky()?.l();
    let (mut fiction, mut moved) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
    for one in shaken {
        fiction += scaled(&one.information) - &still;
        let delta = step(one)? - &own;
        moved += &delta * delta.transpose();
    }
    let share = 1.0 / shaken.len().max(1) as f64;
    let half = lower.solve_lower_triangular(&(fiction * share))?;
    let told = lower.solve_lower_triangular(&half.transpose())?.symmetric_eigen();
    let wider = told.eigenvalues.map(|f| {
        let f = f.clamp(0.0, 1.0 - REAL);
        f / (1.0 - f)
    });
    let back = lower.tr_solve_lower_triangular(&told.eigenvectors)?;
    let added = &back * DMatrix::from_diagonal(&wider) * back.transpose() + moved * share;
    let out = DMatrix::from_fn(n, n, |i, j| added[(i, j)] / (size[i] * size[j]));
    out.iter().all(|x| x.is_finite()).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// `y = p0 u + p1 v` with u known with noise, v exactly.
    fn normal(u: &[f64], v: &[f64], y: &[f64], p: [f64; 2]) -> NormalEquations {
        let b = DMatrix::from_fn(u.len(), 2, |i, k| if k == 0 { u[i] } else { v[i] });
        let r = DVector::from_fn(u.len(), |i, _| p[0] * u[i] + p[1] * v[i] - y[i]);
        NormalEquations { information: b.tr_mul(&b), slope: b.tr_mul(&r) }
    }

    /// Three quarters of what is seen of u is noise: its coefficient comes out at a quarter, sharp, and must not be taken for sharp.
    #[test]
    fn what_noise_pretends_is_no_information() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut draw = |s: f64| -> Vec<f64> {
            (0..4000)
                .map(|_| {
                    s * {
                        let x: f64 = StandardNormal.sample(&mut rng);
                        x
                    }
                })
                .collect()
        };
        let (truth, noise) = ([2.3, -0.7], 1.1);
        let (u, v, e) = (draw(noise / 3f64.sqrt()), draw(1.3), draw(1.0));
        let y: Vec<f64> = (0..u.len()).map(|i| truth[0] * u[i] + truth[1] * v[i] + e[i]).collect();
        let add = |u: &[f64], n: &[f64], by: f64| -> Vec<f64> { u.iter().zip(n).map(|(u, n)| u + by * n).collect() };
        let read = add(&u, &draw(noise), 1.0);
        let at_zero = normal(&read, &v, &y, [0.0; 2]);
        let p = -at_zero.information.clone().cholesky().unwrap().solve(&at_zero.slope);
        let p = [p[0], p[1]];
        let fit = normal(&read, &v, &y, p);
        let std = |c: &DMatrix<f64>, k: usize| c[(k, k)].sqrt();
        let alone = fit.information.clone().try_inverse().unwrap();
        assert!((p[0] - truth[0]).abs() > 20.0 * std(&alone, 0), "{p:?}");
        let draws = [draw(noise), draw(noise), draw(noise)];
        let shaken: Vec<NormalEquations> =
            draws.iter().flat_map(|n| [1.0, -1.0].map(|by| normal(&add(&read, n, by), &v, &y, p))).collect();
        let wide = &alone + covariance_of_motion_noise(&fit, &shaken).unwrap();
        assert!((p[0] - truth[0]).abs() < 7.0 * std(&wide, 0), "{p:?} {}", std(&wide, 0));
        // What is known exactly stays as sharp as residuals leave it.
        assert!(std(&wide, 1) < 1.5 * std(&alone, 1) && (p[1] - truth[1]).abs() < 4.0 * std(&wide, 1), "{p:?}");
        // Without noise nothing is added.
        let none = covariance_of_motion_noise(&fit, &[fit.clone(), fit.clone()]).unwrap();
        assert!(none.amax() < 1e-12 * alone.amax());
    }
}
