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
use crate::solve::linear::LinearError;
use ff_least_squares::Triangle;
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use ff_records::Record;
use nalgebra::{DMatrix, DVector};

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
        let gains = &found.joints.gains;
        let sigma = found.fit.kinds.iter().zip(gains).map(|(k, g)| k.sigma * g.map_or(1.0, f64::abs));
        let sigma: Vec<f64> = sigma.collect();
        let blocks = cut(&problem, &groups, &found.fit.values, gains)?;
        let blocks = blocks.iter().map(|b| whitened(b, &sigma, n)).collect::<Result<Vec<_>, _>>()?;
        // What the others do not tell stays where all have it.
        let all = found.fit.parameters.iter().chain(&found.fit.extra).zip(&found.fit.uncertainty.unknowns);
        let mut near = DMatrix::zeros(n, n + 1);
        for (k, (p, u)) in all.take(n).enumerate() {
            (near[(k, k)], near[(k, n)]) = (1.0 / u.size, p.value / u.size);
        }
        let (mut sum, mut count) = (0.0, 0);
        for (i, block) in blocks.iter().enumerate() {
            let others: Vec<&DMatrix<f64>> = blocks.iter().enumerate().filter(|(k, _)| *k != i).map(|b| b.1).collect();
            if others.is_empty() {
                continue;
            }
            let known = linalg::qr_r(&stacked(&[&others[..], &[&near]].concat()))?;
            let root = known.view((0, 0), (n, n)).into_owned();
            let singular = || LinalgError::RankDeficient { rank: 0, columns: n, dependent: Vec::new() };
            let x = root.solve_upper_triangular(&known.view((0, n), (n, 1)).column(0)).ok_or_else(singular)?;
            let (r, z) = (block.columns(0, n), block.column(n));
            // A = R_i root^-1.
            let a = root.tr_solve_upper_triangular(&r.transpose()).ok_or_else(singular)?.transpose();
            let e: DVector<f64> = z - r * x;
            let svd = linalg::svd(&a)?;
            for (k, w) in svd.s.iter().enumerate().filter(|(_, w)| (1.0 / LESS_KNOWN..LESS_KNOWN).contains(*w)) {
                sum += svd.u.column(k).dot(&e).powi(2) / (1.0 + w * w);
                count += 1;
            }
        }
        Ok(if count == 0 { 1.0 } else { sum / f64::from(count) })
    }
}

/// The triangle of all joints of a block over `n` unknowns and the right side, without what no unknown explains. Allocates.
fn whitened(block: &[Triangle], sigma: &[f64], n: usize) -> Result<DMatrix<f64>, LinalgError> {
    let rows = block.iter().map(|t| t.r.nrows()).sum::<usize>().max(n + 1);
    let mut all = DMatrix::zeros(rows, n + 1);
    let mut at = 0;
    for (t, sigma) in block.iter().zip(sigma) {
        for (k, to) in t.columns.iter().copied().chain([n]).enumerate() {
            all.view_mut((at, to), (t.r.nrows(), 1)).copy_from(&(t.r.column(k) / *sigma));
        }
        at += t.r.nrows();
    }
    Ok(linalg::qr_r(&all)?.rows(0, n).into_owned())
}

fn stacked(parts: &[&DMatrix<f64>]) -> DMatrix<f64> {
    let rows = parts.iter().map(|p| p.nrows()).sum();
    let mut out = DMatrix::zeros(rows, parts.first().map_or(0, |p| p.ncols()));
    let mut at = 0;
    for p in parts {
        out.rows_mut(at, p.nrows()).copy_from(*p);
        at += p.nrows();
    }
    out
}
