//! Currents of motors with unknown gains: `k_j i_j = (Y phi)_j + f_j`, with noise in the current.
//!
//! As `i_j = g_j ((Y phi)_j + known_j + f_j)` with `g_j = 1 / k_j`, what is noisy stands alone on its side, so that no gain is pulled
//! towards zero. Products of `g_j` with the other unknowns are linearised where the last solution is,
//!
//! ```text
//! i_j + g0 (Y phi0 + f0) = g0 (Y phi + f) + g (Y phi0 + known + f0),   g = 2 g0 - g0^2 k
//! ```
//!
//! on the triangles of the columns: another pass over the data is not needed. The scale of gains and parameters is told by what of the arm is
//! known, or by priors.

use super::equations::Layout;
use ff_least_squares::Triangle;
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use nalgebra::{DMatrix, DVector};

/// Triangles of several kinds of one name as one. Allocates.
pub(super) fn joined(parts: Vec<Triangle>) -> Result<Triangle, LinalgError> {
    let mut columns: Vec<usize> = parts.iter().flat_map(|t| t.columns.iter().copied()).collect();
    columns.sort_unstable();
    columns.dedup();
    let stacked: usize = parts.iter().map(|t| t.r.nrows()).sum();
    let mut all = DMatrix::zeros(stacked.max(columns.len() + 1), columns.len() + 1);
    let (mut at, mut rows) = (0, 0);
    for t in &parts {
        for (k, c) in t.columns.iter().enumerate() {
            let to = columns.binary_search(c).unwrap_or_default();
            all.view_mut((at, to), (t.r.nrows(), 1)).copy_from(&t.r.column(k));
        }
        all.view_mut((at, columns.len()), (t.r.nrows(), 1)).copy_from(&t.r.column(t.columns.len()));
        at += t.r.nrows();
        rows += t.rows;
    }
    let name = parts.first().map(|t| t.name.clone()).unwrap_or_default();
    Ok(Triangle { name, columns, r: linalg::qr_r(&all)?, rows })
}

/// A triangle with these of its columns alone, in their order. Allocates.
pub(super) fn with_columns(t: &Triangle, keep: impl Fn(usize) -> bool) -> Result<Triangle, LinalgError> {
    let kept: Vec<usize> = (0..t.columns.len()).filter(|&k| keep(t.columns[k])).collect();
    let all: Vec<usize> = kept.iter().copied().chain(std::iter::once(t.columns.len())).collect();
    let columns = kept.iter().map(|&k| t.columns[k]).collect();
    Ok(Triangle { name: t.name.clone(), columns, r: linalg::qr_r(&t.r.select_columns(&all))?, rows: t.rows })
}

/// What the columns of a triangle mean, and where the last solution is.
#[derive(Clone, Copy)]
pub(super) struct Substitution<'a> {
    pub(super) layout: &'a Layout,
    /// Number of parameters among the unknowns.
    pub(super) selected: usize,
    /// Parameters and terms of the last solution.
    pub(super) at: &'a [f64],
    /// Gains (A/N m) of the joints that have currents.
    pub(super) gains: &'a [Option<f64>],
}

impl Substitution<'_> {
    /// Equations of a joint over parameters, terms and gains `k` (N m/A): what is known to the right side, currents linearised. Allocates.
    pub(super) fn of(&self, joint: usize, t: &Triangle) -> Result<Triangle, LinalgError> {
        let first_known = self.selected + self.layout.terms.len();
        let known = t.columns.iter().position(|&c| c == first_known + joint);
        let Some(known) = known.filter(|_| self.layout.known) else { return Ok(t.clone()) };
        let b = t.r.column(t.columns.len());
        let unknown: Vec<usize> = (0..t.columns.len()).filter(|&k| t.columns[k] < first_known).collect();
        let mut columns: Vec<usize> = unknown.iter().map(|&k| t.columns[k]).collect();
        let mut a = t.r.select_columns(&unknown);
        let Some(gain) = self.gains[joint] else {
            let right = b - t.r.column(known);
            let width = a.ncols();
            a = a.insert_column(width, 0.0);
            a.set_column(width, &right);
            return Ok(Triangle { name: t.name.clone(), columns, r: linalg::qr_r(&a)?, rows: t.rows });
        };
        let zero: DVector<f64> = DVector::zeros(a.nrows());
        let here = columns.iter().enumerate().fold(zero, |sum, (k, &c)| sum + a.column(k) * self.at[c]);
        let slope = &here + t.r.column(known);
        let right = b + &here * gain - &slope * (2.0 * gain);
        let slope = slope * (-gain * gain);
        a *= gain;
        let width = a.ncols();
        let mut whole = a.insert_columns(width, 2, 0.0);
        whole.set_column(width, &slope);
        whole.set_column(width + 1, &right);
        columns.push(first_known + self.gains[..joint].iter().flatten().count());
        Ok(Triangle { name: t.name.clone(), columns, r: linalg::qr_r(&whole)?, rows: t.rows })
    }
    /// The gain that explains a joint best with everything else as it is; `None` for a joint without a torque. Allocates.
    pub(super) fn start(&self, joint: usize, t: &Triangle) -> Option<f64> {
        let first_known = self.selected + self.layout.terms.len();
        let b = t.r.column(t.columns.len());
        let mut torque: DVector<f64> = DVector::zeros(t.r.nrows());
        let (mut offset, mut coulomb) = (None, None);
        for (k, &c) in t.columns.iter().enumerate() {
            if c < first_known {
                torque += t.r.column(k) * self.at[c];
                // Friction is not known at the start: what it explains does not count.
                match c.checked_sub(self.selected).map(|e| self.layout.terms[e].1) {
                    Some(super::JointTerm::Offset) => offset = Some(k),
                    Some(super::JointTerm::Coulomb) => coulomb = Some(k),
                    _ => {}
                }
            } else if c == first_known + joint {
                torque += t.r.column(k);
            }
        }
        let mut a = DMatrix::from_columns(&[torque.clone()]);
        for k in [offset, coulomb].into_iter().flatten() {
            let width = a.ncols();
            a = a.insert_column(width, 0.0);
            a.set_column(width, &t.r.column(k));
        }
        let alone = torque.dot(&b) / torque.norm_squared();
        let g = (a.transpose() * &a).lu().solve(&(a.transpose() * b)).map_or(alone, |x| x[0]);
        let sound = |g: f64| g.is_finite() && g != 0.0;
        if sound(g) { Some(g) } else { Some(alone).filter(|g| sound(*g)) }
    }
}
