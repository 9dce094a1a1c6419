//! How many independent tests a set of tests that hang together is worth.
//!
//! That any of n tests errs at the level a has, with `A_h` the event that test h does and N the number of those that do, the probability
//!
//! ```text
//! P(union A_h) = sum_h P(A_h) E(1 / N | A_h) = a n E(1 / N | A_h, h drawn evenly)
//! ```
//!
//! (R. Adler, J. Blanchet, J. Liu, *Ann. Appl. Probab.* 22, 2012, 1167: what makes a rare union cheap to sample). So n tests are worth
//! `n E(1/N)` independent ones. Sums `s` of all tests are normal with a known covariance; given that `s_h^T R_h^-1 s_h`, chi-squared with k
//! degrees of freedom, lies beyond its limit, its direction is even, and the others follow by regression.

use crate::uncertain::score::usable;
use ff_spectral::chi_square::chi_square_survival;
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Draws: the number is then known to a few percent.
const DRAWS: usize = 300;

/// A test: its components, and whether the one that it has cannot be negative (which has a negative sum, for `e = -S^-1 s`).
#[derive(Clone, Copy)]
pub(super) struct Test<'a> {
    pub(super) components: &'a [usize],
    pub(super) positive: bool,
}

/// One of the tests that can be made.
struct One {
    components: Vec<usize>,
    positive: bool,
    inverse: DMatrix<f64>,
    root: DMatrix<f64>,
    limit: f64,
}

/// The number of independent tests that tests of these components are worth at the level `p` each, whose sums have this covariance: one to
/// their number. Those whose covariance is singular are left out. Allocates.
pub(super) fn independent(covariance: &DMatrix<f64>, tests: &[Test<'_>], p: f64) -> f64 {
    // Components that belong to no test may lie within the unknowns of the fit, and have no variance.
    let mut used: Vec<usize> = tests.iter().flat_map(|t| t.components.iter().copied()).collect();
    used.sort_unstable();
    used.dedup();
    let n = used.len();
    let scale: Vec<f64> = used.iter().map(|&i| covariance[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    let r = DMatrix::from_fn(n, n, |i, j| covariance[(used[i], used[j])] / (scale[i] * scale[j]));
    let one = |&Test { components, positive }: &Test<'_>| -> Option<One> {
        let of: Vec<usize> = components.iter().filter_map(|i| used.binary_search(i).ok()).collect();
        let own = DMatrix::from_fn(of.len(), of.len(), |a, b| r[(of[a], of[b])]);
        let (inverse, root) = (usable(&own)?, own.cholesky()?.l());
        let limit = quantile(sides(positive) * p, of.len());
        Some(One { components: of, positive, inverse, root, limit })
    };
    let all: Vec<One> = tests.iter().filter_map(one).collect();
    if all.len() < 2 || r.iter().any(|x| !x.is_finite()) {
        return all.len().max(1) as f64;
    }
    let e = r.clone().symmetric_eigen();
    let factor = &e.eigenvectors * DMatrix::from_diagonal(&e.eigenvalues.map(|x| x.max(0.0).sqrt()));
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let draws = DRAWS.max(all.len());
    let mut sum = 0.0;
    for draw in 0..draws {
        let h = &all[draw % all.len()];
        let k = h.components.len();
        let mut normal = |n: usize| DVector::from_fn(n, |_, _| Distribution::<f64>::sample(&StandardNormal, &mut rng));
        let mut s = &factor * normal(n);
        let direction = if h.positive { DVector::from_element(k, -1.0) } else { normal(k).normalize() };
        let radius = quantile(sides(h.positive) * p * (1.0 - rng.random::<f64>()), k).sqrt();
        let change = &h.root * direction * radius - s.select_rows(&h.components);
        s += r.select_columns(&h.components) * (&h.inverse * change);
        let beyond = |t: &&One| {
            let own = s.select_rows(&t.components);
            (own.transpose() * &t.inverse * &own)[0] >= t.limit && (!t.positive || own[0] < 0.0)
        };
        // Rounding may put the test itself just below its own limit.
        sum += 1.0 / all.iter().filter(beyond).count().max(1) as f64;
    }
    all.len() as f64 * sum / draws as f64
}

/// By how much more often chi-squared lies beyond the limit of a test than the test sees something.
fn sides(positive: bool) -> f64 {
    if positive { 2.0 } else { 1.0 }
}

/// What chi-squared with k degrees of freedom exceeds with probability `p`.
fn quantile(p: f64, k: usize) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while chi_square_survival(high, k as f64) > p && high < 1e4 {
        high *= 2.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if chi_square_survival(middle, k as f64) > p { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn independent_tests_count_each_and_equal_ones_once() {
        let tests: Vec<Vec<usize>> = (0..12).map(|i| vec![2 * i, 2 * i + 1]).collect();
        let of = |covariance: &DMatrix<f64>| {
            let tests: Vec<Test<'_>> = tests.iter().map(|t| Test { components: t, positive: false }).collect();
            independent(covariance, &tests, 1e-4)
        };
        let apart = DMatrix::from_fn(24, 24, |i, j| if i == j { 3.0 + i as f64 } else { 0.0 });
        assert!((of(&apart) - 12.0).abs() < 0.1);
        // Four groups of three that are the same but for their scale.
        let alike = DMatrix::from_fn(24, 24, |i, j| {
            let same = i / 6 == j / 6 && i % 2 == j % 2;
            if same { (1.0 + i as f64) * (1.0 + j as f64) } else { 0.0 }
        });
        assert!((of(&alike) - 4.0).abs() < 0.1, "{}", of(&alike));
        // Between the two: correlated by 0.9.
        let near = DMatrix::from_fn(24, 24, |i, j| {
            if i == j {
                1.0
            } else if i / 6 == j / 6 && i % 2 == j % 2 {
                0.9
            } else {
                0.0
            }
        });
        assert!((5.0..11.0).contains(&of(&near)), "{}", of(&near));
    }

    #[test]
    fn tests_of_opposite_signs_of_one_number_are_two_and_one_side_lies_within_both() {
        let of = |tests: &[Test<'_>]| {
            // Two numbers that are one but for their sign, and a third.
            let c = DMatrix::from_row_slice(3, 3, &[2.0, -3.0, 0.0, -3.0, 4.5, 0.0, 0.0, 0.0, 0.7]);
            independent(&(c + DMatrix::identity(3, 3) * 1e-9), tests, 1e-4)
        };
        let [a, b] = [[0usize], [1]];
        let (up, down) = (Test { components: &a, positive: true }, Test { components: &b, positive: true });
        assert!((of(&[up, down]) - 2.0).abs() < 1e-9, "{}", of(&[up, down]));
        assert!((of(&[up, up]) - 1.0).abs() < 1e-9);
        // At equal levels one side has the nearer limit: P(one or both) = 1e-4 + 0.5e-4.
        let both = Test { components: &a, positive: false };
        assert!((of(&[up, both]) - 1.5).abs() < 0.05, "{}", of(&[up, both]));
    }

    #[test]
    fn quantiles_are_those_of_tables() {
        for (p, k, x) in [(0.05, 1, 3.8415), (0.01, 3, 11.3449), (1e-4, 6, 27.8563)] {
            assert!((quantile(p, k) - x).abs() < 1e-3, "{p} {k} {}", quantile(p, k));
        }
    }
}
