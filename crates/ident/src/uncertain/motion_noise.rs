//! What a fit takes noise of the joint motion for.
//!
//! A spline through noisy positions moves the model by noise as well. Where a mode lies where the motion has nothing else, its ringing in the
//! prediction is all noise: it is as large as the noise makes it, and not as the robot rings. Its columns say that the record tells the mode's stiffness, and
//! its size in the residuals draws that to where the predicted ringing is least (errors in variables; W. A. Fuller, *Measurement Error Models*, 1987,
//! section 1.1; with noise that is added on purpose: J. R. Cook, L. A. Stefanski, *J. Am. Stat. Assoc.* 89, 1994, 1314). To first order, noise that does `N_m` to
//! the residuals moves the estimates by `l_m = -A^-1 B^T N_m`, `A = B^T B`: many draws of that cost a column each. Linearised once more with the noise `n_m` of
//! a few of them added to the motion and taken off it,
//!
//! ```text
//! F = mean_m A(+-n_m) - A,   delta_m+- = -A(+-n_m)^-1 g(+-n_m) + A^-1 g,     g = B^T r
//! e_m = (delta_m+ + delta_m-) / 2,   o_m = (delta_m+ - delta_m-) / 2 - l_m
//! ```
//!
//! F is the information that noise pretends, `e_m` where as much noise again draws the estimates to whatever its sign, and `o_m` what first order
//! misses. Of the `A = L L^T` of the fit, the part `f` of F is no information along the eigenvectors of `L^-1 F L^-T`, and the covariance is
//!
//! ```text
//! L^-T V diag(1 / (1 - f)) V^T L^-1  +  mean_k l_k l_k^T  +  mean_m (e_m e_m^T + o_m o_m^T).
//! ```
//!
//! A few draws span a few directions: three moved the estimates of 19 parameters along three, and the others came out sharper than they are.

use crate::estimate::along::Direction;
use crate::estimate::estimator::Estimator;
use crate::uncertain::score::{Combination, EndOfFit, folded};
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
        // Columns that no unknown of the fit is made of, such as those of draws, need no derivatives.
        let all = Direction::of_columns(at.selected, at.full.len(), at.extra.len());
        let mut used: Vec<usize> = at.base.iter().flat_map(|(c, _)| c.iter().map(|c| c.0)).collect();
        used.sort_unstable();
        used.dedup();
        let along: Vec<Direction> = used.iter().map(|&k| all[k].clone()).collect();
        let place = |k: usize| used.binary_search(&k).unwrap_or_default();
        let of = |c: &Combination| c.iter().map(|&(k, by)| (place(k), by)).collect();
        let base: Vec<(Combination, f64)> = at.base.iter().map(|(c, size)| (of(c), *size)).collect();
        let at = &EndOfFit { base: &base, priors: at.priors.clone(), ..*at };
        let (triangle, _) = folded(&mut estimator, at, &along, &mut |_, _| {})?;
        let r = triangle.view((0, 0), (n, n)).into_owned();
        let rest = triangle.view((0, n), (n, 1)).column(0).into_owned();
        Ok(Self { information: r.tr_mul(&r), slope: r.tr_mul(&rest) })
    }
}

/// What noise of the motion adds to the covariance of a fit with the normal equations `fit`: `drawn` has `B^T N_k` of many draws
/// ([`Scores::drawn_over_unknowns`](super::Scores::drawn_over_unknowns)), `shaken` the normal equations with the noise of the first of them added to the
/// motion and taken off it; equations in the page above. `None` where one of them is singular. Allocates.
///
/// # Panics
/// If more draws are shaken than drawn, or `drawn` has not as many rows as there are unknowns.
pub fn covariance_of_motion_noise(
    fit: &NormalEquations,
    drawn: &DMatrix<f64>,
    shaken: &[[NormalEquations; 2]],
) -> Option<DMatrix<f64>> {
    let n = fit.slope.len();
    let size = fit.information.diagonal().map(f64::sqrt);
    let scaled = |a: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| a[(i, j)] / (size[i] * size[j]));
    let still = scaled(&fit.information);
    // In units of the columns.
    let step = |of: &NormalEquations| Some(-scaled(&of.information).cholesky()?.solve(&of.slope.component_div(&size)));
    let own = step(fit)?;
    let factor = still.clone().cholesky()?;
    let lower = factor.l();
    let mut linear = drawn.clone();
    linear.column_iter_mut().for_each(|mut c| c.component_div_assign(&size));
    linear = -factor.solve(&linear);
    let mut moved = &linear * linear.transpose() / drawn.ncols().max(1) as f64;
    let mut fiction = DMatrix::zeros(n, n);
    let share = 1.0 / shaken.len().max(1) as f64;
    for (k, [added, taken]) in shaken.iter().enumerate() {
        fiction += (scaled(&added.information) + scaled(&taken.information)) * 0.5 - &still;
        let (plus, minus) = (step(added)? - &own, step(taken)? - &own);
        let even = (&plus + &minus) * 0.5;
        let odd = (&plus - &minus) * 0.5 - linear.column(k);
        moved += (&even * even.transpose() + &odd * odd.transpose()) * share;
    }
    let half = lower.solve_lower_triangular(&(fiction * share))?;
    let told = lower.solve_lower_triangular(&half.transpose())?.symmetric_eigen();
    let wider = told.eigenvalues.map(|f| {
        let f = f.clamp(0.0, 1.0 - REAL);
        f / (1.0 - f)
    });
    let back = lower.tr_solve_lower_triangular(&told.eigenvectors)?;
    let added = &back * DMatrix::from_diagonal(&wider) * back.transpose() + moved;
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
        let draws: Vec<Vec<f64>> = (0..16).map(|_| draw(noise)).collect();
        let shake = |n: &Vec<f64>| [1.0, -1.0].map(|by| normal(&add(&read, n, by), &v, &y, p));
        let shaken: Vec<[NormalEquations; 2]> = draws[..3].iter().map(shake).collect();
        let over = |u: &[f64], n: &[f64]| p[0] * u.iter().zip(n).map(|(u, n)| u * n).sum::<f64>();
        let drawn = DMatrix::from_fn(2, 16, |i, k| over(if i == 0 { &read } else { &v }, &draws[k]));
        let wide = &alone + covariance_of_motion_noise(&fit, &drawn, &shaken).unwrap();
        assert!((p[0] - truth[0]).abs() < 7.0 * std(&wide, 0), "{p:?} {}", std(&wide, 0));
        // What is known exactly stays as sharp as residuals leave it.
        assert!(std(&wide, 1) < 1.5 * std(&alone, 1) && (p[1] - truth[1]).abs() < 4.0 * std(&wide, 1), "{p:?}");
        // Without noise nothing is added.
        let none = covariance_of_motion_noise(&fit, &DMatrix::zeros(2, 4), &[[fit.clone(), fit.clone()]]).unwrap();
        assert!(none.amax() < 1e-12 * alone.amax());
    }
}
