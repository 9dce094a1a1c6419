//! How far apart parts of the records are, against what the deviations of an estimate say.
//!
//! What is left of a real arm is no noise: belts that stretch, friction that changes with temperature. It says the same for seconds, and more
//! samples of the same motion do not average it away. The samples are cut into blocks. With the whitened triangle `[R_i z_i]` of block `i`, and
//! estimate `x` and covariance `P` of all others,
//!
//! ```text
//! e = z_i - R_i x,     cov e = 1 + R_i P R_i^T = U diag(1 + w^2) U^T,     R_i P^(1/2) = U diag(w) V^T
//! ```
//!
//! if what is left is white. The mean of `(u_k^T e)^2 / (1 + w_k^2)` over all directions `u_k` and blocks is then 1, and otherwise the factor on
//! the variances. Directions of which the others know ten times less than the block itself are left out.

use super::GroundEstimate;
use super::calibration::Ground;
use super::currents;
use super::problem::Problem;
use super::selection::cut;
use crate::solve::linear::{LinearError, with_priors};
use ff_least_squares::{Triangle, merge};
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use ff_records::Record;

/// Deviation of a direction by the others over that by the block itself, above which it is left out.
const LESS_KNOWN: f64 = 10.0;

impl Ground<'_> {
    /// The factor on the variances of `found`, an estimate of the parameters `selected` from these records about `start`, that parts of them ask
    /// for: the formula of the module, about 1 for white noise; 1 where the records are too short to be cut. Gains count as known. Allocates.
    ///
    /// # Errors
    /// [`LinearError`].
    pub fn scatter(
        &self,
        records: &[&Record],
        (selected, start): (&[usize], &[f64]),
        found: &GroundEstimate,
    ) -> Result<f64, LinearError> {
        let groups = self.checked(records, selected, start)?;
        let of = currents(records, self.model.nj())?;
        let terms = self.all_terms();
        let n = selected.len() + terms.len();
        let problem = Problem::new(self, &groups, of, (selected, start), terms);
        let blocks = cut(&problem, &groups, &found.fit.values, &found.joints.gains)?;
        let sigma = found.torque_sigma();
        // What the others do not tell stays where all have it.
        let all = found.fit.parameters.iter().chain(&found.fit.extra).zip(&found.fit.uncertainty.unknowns);
        let near: Vec<_> = all.take(n).enumerate().map(|(k, (p, u))| (k, p.value, u.size)).collect();
        let (mut sum, mut count) = (0.0, 0);
        for (i, block) in blocks.iter().enumerate() {
            let others: Vec<Triangle> =
                blocks.iter().enumerate().filter(|(k, _)| *k != i).flat_map(|b| b.1.clone()).collect();
            if others.is_empty() {
                continue;
            }
            let known = with_priors(merge(n, &others, &sigma.repeat(blocks.len() - 1))?, &near)?;
            let own = merge(n, block, &sigma)?;
            let singular = || LinalgError::RankDeficient { rank: 0, columns: n, dependent: Vec::new() };
            let x = known.r.solve_upper_triangular(&known.d).ok_or_else(singular)?;
            // A = R_i root^-1.
            let a = known.r.tr_solve_upper_triangular(&own.r.transpose()).ok_or_else(singular)?.transpose();
            let e = own.d - own.r * x;
            let svd = linalg::svd(&a)?;
            for (k, w) in svd.s.iter().enumerate().filter(|(_, w)| (1.0 / LESS_KNOWN..LESS_KNOWN).contains(*w)) {
                sum += svd.u.column(k).dot(&e).powi(2) / (1.0 + w * w);
                count += 1;
            }
        }
        Ok(if count == 0 { 1.0 } else { sum / f64::from(count) })
    }
}
