//! Currents of motors with unknown gains: `k_j i_j = (Y phi)_j + f_j`, with noise in the current.
//!
//! As `i_j = g_j ((Y phi)_j + known_j) + F_j` with `g_j = 1 / k_j` and friction `F_j = g_j f_j` in A, what is noisy stands alone on its side, so
//! that no gain is pulled towards zero, and friction is linear whatever the gain. What is left are the products `g_j phi`. They are linearised
//! where the last solution is,
//!
//! ```text
//! i_j + g0 Y phi0 = g0 Y phi + F + g (Y phi0 + known)
//! ```
//!
//! on the triangles of the columns: another pass over the data is not needed. A gain that the mission's bodies do not tell (a last joint that
//! turns about the axis of its load) begins at zero: its joint then says nothing of the bodies until others have. Deviations are those of
//! gains in N m/A and friction in N m, by a last linearisation in these:
//!
//! ```text
//! i_j + g0 (Y phi0 + f0) = g0 (Y phi + f) + g (Y phi0 + known + f0),   g = 2 g0 - g0^2 k
//! ```
//!
//! The scale of gains and parameters is told by what of the arm is known, or by priors.

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
    if kept.len() == t.columns.len() {
        return Ok(t.clone());
    }
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

/// What stands for friction and gains of a joint that has a current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Unit {
    /// Friction in N m, gains in N m/A.
    Torque,
    /// Friction in A, gains in A/N m.
    Current,
}

/// The gain of a joint as the mission's bodies tell it.
pub(super) struct First {
    /// A/N m; zero where it is not told.
    pub(super) gain: f64,
    /// What counts as a large change of it.
    pub(super) size: f64,
}

/// Deviations that a gain is from zero where the mission's bodies tell it.
const TOLD: f64 = 10.0;

impl Substitution<'_> {
    fn first_known(&self) -> usize {
        self.selected + self.layout.terms.len()
    }
    /// Equations of a joint over parameters, terms and gains: what is known to the right side, currents linearised. Allocates.
    pub(super) fn of(&self, joint: usize, t: &Triangle, unit: Unit) -> Result<Triangle, LinalgError> {
        let first_known = self.first_known();
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
        // Friction in A is not multiplied by the gain.
        let multiplied = |c: usize| unit == Unit::Torque || c < self.selected;
        let mut here: DVector<f64> = DVector::zeros(a.nrows());
        for (mut column, &c) in a.column_iter_mut().zip(&columns).filter(|(_, c)| multiplied(**c)) {
            here.axpy(self.at[c], &column, 1.0);
            column *= gain;
        }
        let slope = &here + t.r.column(known);
        let (slope, right) = match unit {
            Unit::Current => (slope, b + here * gain),
            Unit::Torque => (&slope * (-gain * gain), b + here * gain - slope * (2.0 * gain)),
        };
        let width = a.ncols();
        let mut whole = a.insert_columns(width, 2, 0.0);
        whole.set_column(width, &slope);
        whole.set_column(width + 1, &right);
        columns.push(first_known + self.gains[..joint].iter().flatten().count());
        Ok(Triangle { name: t.name.clone(), columns, r: linalg::qr_r(&whole)?, rows: t.rows })
    }
    /// The gain that explains a joint best with the bodies as they are and any friction. Allocates.
    ///
    /// With the triangle `[R_11 R_12; 0 R_22]` of friction, torque and current, `R_22` is that of torque and current off the columns of friction.
    pub(super) fn start(&self, joint: usize, t: &Triangle) -> Result<First, LinalgError> {
        let (first_known, m) = (self.first_known(), self.selected);
        let mut torque: DVector<f64> = DVector::zeros(t.r.nrows());
        let mut friction = Vec::new();
        for (k, &c) in t.columns.iter().enumerate() {
            if c < m {
                torque.axpy(self.at[c], &t.r.column(k), 1.0);
            } else if c < first_known {
                friction.push(k);
            } else if c == first_known + joint {
                torque += t.r.column(k);
            }
        }
        let n = friction.len();
        let mut all = t.r.select_columns(&friction).insert_columns(n, 2, 0.0);
        all.set_column(n, &torque);
        all.set_column(n + 1, &t.r.column(t.columns.len()));
        let current = all.column(n + 1).norm();
        let r = linalg::qr_r(&all)?;
        let (gain, rest) = (r[(n, n + 1)] / r[(n, n)], r[(n + 1, n + 1)] / (t.rows.max(1) as f64).sqrt());
        let told = gain.is_finite() && r[(n, n + 1)].abs() > TOLD * rest.abs();
        let sound = |x: f64| x.is_finite() && x > 0.0;
        let size = if told { gain.abs() } else { current / torque.norm() };
        Ok(First { gain: if told { gain } else { 0.0 }, size: if sound(size) { size } else { 1.0 } })
    }
}
