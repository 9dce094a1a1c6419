//! Coordinates in which a change of all masses, stiffnesses and gains by one factor is a straight line.
//!
//! Torques are in proportion to masses, stiffnesses and dampers, and a common gain of the torque sensors multiplies them: data are the same for
//! `(s p, (1 + g)/s)` at every `s`. Linearised rows know that at their own linearisation point alone: there the direction
//! `(p, -(1 + g))` costs nothing, and a step `d` (relative) further along the curve its second order does, `d^2` over the relative precision of the
//! data. Rows of several records, each linearised elsewhere on the curve, then determine the gain, which none of them has seen: the
//! inconsistency of extended Kalman filters in simultaneous localisation and mapping (Julier and Uhlmann 2001; Huang, Mourikis and Roumeliotis 2010).
//! In the coordinates of this file that curve is a straight line, the same from each linearisation point:
//!
//! ```text
//! phi = m ln(p/m)                    masses, stiffnesses, dampers, lengths: positive numbers that the data tell
//! phi = (1 + m) ln((1 + p)/(1 + m))  relative errors: gains, errors of masses
//! phi = p m_M/p_M - m                first moments and inertias, over a mass M: that of their own body, or the first that is known
//! phi = p - m                        all else
//! ```
//!
//! `m` is the mean. All are tangent to `p - m` there but for the third, whose derivatives by the mass change the rows: `W_M + W_p m/m_M`.
//! They are used where the rows tell the common factor far worse than its parts; elsewhere rows stay linear, which is exact for linear models.
//! Below a tenth of its mean a logarithm goes on as its tangent, so that all values are finite and rise with `p`.

use crate::estimate::outcome::RANK_TOLERANCE;
use ff_linalg::{self as linalg, LinalgError};
use ff_model::{ParamDecl, ParamGroup};
use nalgebra::{DMatrix, DVector};

/// Part of the mean below which a logarithm goes on as its tangent.
const LEAST: f64 = 0.1;
/// Least size of a parameter in the deviations that the rows give it when all others are known; one that is known worse than that is
/// kept as it is, since its curve may begin at zero.
const TOLD: f64 = 3.0;
/// Largest mean of a number without unit that counts as a relative error.
const RELATIVE: f64 = 0.5;
/// Information on the common factor, over the largest on one of its parts alone (both as deviations), below which the coordinates are used.
const CANCELLED: f64 = 0.1;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Coordinate {
    /// As it is.
    Linear,
    /// Logarithm of `shift + p`.
    Log { shift: f64 },
    /// Over the parameter of this number, a logarithm of shift zero.
    Over(usize),
}

/// The coordinates of the parameters of one set of rows.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ScaleCoordinates {
    mean: Vec<f64>,
    of: Vec<Coordinate>,
}

/// Logarithm, and its derivative; a tangent below [`LEAST`].
fn log(x: f64) -> (f64, f64) {
    if x > LEAST { (x.ln(), 1.0 / x) } else { (LEAST.ln() + (x - LEAST) / LEAST, 1.0 / LEAST) }
}

fn scales_with_mass(unit: &str) -> bool {
    unit.starts_with("kg") || unit.starts_with('N')
}

/// Whether rows tell a factor common to all that is in proportion to mass far worse than each part: relative errors, such as gains, may
/// follow as they cost least.
fn trades_off(decls: &[&ParamDecl], mean: &[f64], w: &DMatrix<f64>) -> Result<bool, LinalgError> {
    let parts: Vec<DVector<f64>> =
        (0..mean.len()).filter(|&k| scales_with_mass(decls[k].unit)).map(|k| w.column(k) * mean[k]).collect();
    let largest = parts.iter().map(|p| p.norm()).fold(0.0, f64::max);
    if w.nrows() == 0 || largest == 0.0 {
        return Ok(false);
    }
    let mut common: DVector<f64> = parts.iter().sum();
    let follow: Vec<DVector<f64>> =
        (0..mean.len()).filter(|&k| decls[k].unit == "1").map(|k| w.column(k).into_owned()).collect();
    if !follow.is_empty() {
        let d = linalg::svd(&DMatrix::from_columns(&follow))?;
        let u = d.u.columns(0, d.rank(RANK_TOLERANCE)).into_owned();
        common -= &u * (u.transpose() * &common);
    }
    Ok(common.norm() < CANCELLED * largest)
}

impl ScaleCoordinates {
    /// Of parameters with these declarations and means, and rows `w` around the means, which it changes to rows over the coordinates.
    ///
    /// # Errors
    /// Those of a singular value decomposition.
    pub(super) fn of_rows(decls: &[&ParamDecl], mean: &[f64], w: &mut DMatrix<f64>) -> Result<Self, LinalgError> {
        if !trades_off(decls, mean, w)? {
            return Ok(Self { mean: mean.to_vec(), of: vec![Coordinate::Linear; mean.len()] });
        }
        let told: Vec<bool> = (0..mean.len()).map(|k| w.column(k).norm() * mean[k].abs() >= TOLD).collect();
        let positive = |k: usize| match &decls[k].group {
            ParamGroup::Inertial(_) => decls[k].unit == "kg",
            ParamGroup::Positive => true,
            ParamGroup::Free => false,
        };
        let mut of: Vec<Coordinate> = (0..mean.len())
            .map(|k| match decls[k].group {
                _ if positive(k) && mean[k] > 0.0 && told[k] => Coordinate::Log { shift: 0.0 },
                ParamGroup::Free if decls[k].unit == "1" && mean[k].abs() < RELATIVE && w.column(k).norm() >= TOLD => {
                    Coordinate::Log { shift: 1.0 }
                }
                _ => Coordinate::Linear,
            })
            .collect();
        let masses: Vec<usize> =
            (0..of.len()).filter(|&k| of[k] == Coordinate::Log { shift: 0.0 } && decls[k].unit == "kg").collect();
        for k in 0..of.len() {
            if of[k] == Coordinate::Linear && !positive(k) && scales_with_mass(decls[k].unit) {
                let own = masses.iter().copied().find(|&m| match &decls[k].group {
                    group @ ParamGroup::Inertial(_) => decls[m].group == *group,
                    _ => false,
                });
                if let Some(mass) = own.or_else(|| masses.first().copied()) {
                    of[k] = Coordinate::Over(mass);
                    let column = w.column(k) * (mean[k] / mean[mass]);
                    w.column_mut(mass).axpy(1.0, &column, 1.0);
                }
            }
        }
        Ok(Self { mean: mean.to_vec(), of })
    }
    /// Coordinate of parameter `k` at the values that `p` gives by number.
    pub(super) fn value(&self, k: usize, p: impl Fn(usize) -> f64) -> f64 {
        let m = self.mean[k];
        match self.of[k] {
            Coordinate::Linear => p(k) - m,
            Coordinate::Log { shift } => (m + shift) * log((p(k) + shift) / (m + shift)).0,
            Coordinate::Over(mass) => p(k) * (-log(p(mass) / self.mean[mass]).0).exp() - m,
        }
    }
    /// Its derivatives: by its own parameter, and number of another with the derivative by that.
    pub(super) fn slopes(&self, k: usize, p: impl Fn(usize) -> f64) -> (f64, Option<(usize, f64)>) {
        match self.of[k] {
            Coordinate::Linear => (1.0, None),
            Coordinate::Log { shift } => (log((p(k) + shift) / (self.mean[k] + shift)).1, None),
            Coordinate::Over(mass) => {
                let (l, slope) = log(p(mass) / self.mean[mass]);
                let inverse = (-l).exp();
                (inverse, Some((mass, -p(k) * inverse * slope / self.mean[mass])))
            }
        }
    }
}
