//! Where the uncertainty of an estimate comes from.
//!
//! A linearised fit of whitened data `J` with independent priors of standard deviation `s_c` on some unknowns has the information
//! `H = J^T J + sum_c e_c e_c^T / s_c^2` and the covariance `P = H^-1`. Its error is `P (J^T n + sum_c e_c b_c / s_c)` for unit noise `n`
//! and unit draws `b_c` of what the priors are about, so that the variance of unknown i splits without remainder:
//!
//! ```text
//! P_ii = (P J^T J P)_ii + sum_c (P_ic / s_c)^2
//! ```
//!
//! the first term due to the noise of the sensors, the others to each prior (the consider analysis of orbit determination, B. Tapley,
//! B. Schutz, G. Born, *Statistical Orbit Determination*, 2004, ch. 6). A prior that becomes `f` times as wide (`f < 1`: better known) adds `(1/f^2 - 1) / s_c^2` to `H`; the covariance follows by the
//! Sherman-Morrison-Woodbury identity.

use nalgebra::DMatrix;

/// Unknowns whose priors belong together: a column of the covariance and the standard deviation of its prior, each.
pub type PriorGroup = Vec<(usize, f64)>;

/// Part of the variance of unknown `i` that each group of priors is to blame for; what is missing to one is due to the noise of the
/// sensors. Allocates.
///
/// ```
/// use ident::belief::{prior_shares, tightened};
/// use nalgebra::DMatrix;
///
/// // y = p + b + n with b known to 3 beforehand and n to 4: P = [[25, -9], [-9, 9]].
/// let covariance = DMatrix::from_row_slice(2, 2, &[25.0, -9.0, -9.0, 9.0]);
/// let groups = [vec![(1, 3.0)]];
/// assert_eq!(prior_shares(&covariance, 0, &groups), [9.0 / 25.0]);
/// // With b known three times better: 16 + 1.
/// assert!((tightened(&covariance, 0, &groups[0], 1.0 / 3.0) - 17.0_f64.sqrt()).abs() < 1e-12);
/// ```
///
/// # Panics
/// If a column does not exist.
pub fn prior_shares(covariance: &DMatrix<f64>, i: usize, groups: &[PriorGroup]) -> Vec<f64> {
    let variance = covariance[(i, i)];
    let of = |g: &PriorGroup| g.iter().map(|&(c, s)| (covariance[(i, c)] / s).powi(2)).sum::<f64>() / variance;
    groups.iter().map(of).collect()
}

/// Standard deviation that unknown `i` would have if the priors of a group were `factor` (below one) times as wide. Allocates.
///
/// # Panics
/// If a column does not exist.
pub fn tightened(covariance: &DMatrix<f64>, i: usize, group: &PriorGroup, factor: f64) -> f64 {
    let k = group.len();
    let more = 1.0 / (factor * factor) - 1.0;
    let inner = DMatrix::from_fn(k, k, |a, b| {
        let own = if a == b { group[a].1.powi(2) / more } else { 0.0 };
        own + covariance[(group[a].0, group[b].0)]
    });
    let across = DMatrix::from_fn(k, 1, |a, _| covariance[(group[a].0, i)]);
    let gained = inner.cholesky().map_or(0.0, |l| (across.transpose() * l.solve(&across))[(0, 0)]);
    (covariance[(i, i)] - gained).max(0.0).sqrt()
}
