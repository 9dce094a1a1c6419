//! What a residual costs: squares, or less than squares for outliers.
//!
//! A fit minimises `sum rho(r_i) / 2` over whitened residuals `r_i`.
//!
//! | loss | `rho(r)` | `psi = rho' / 2` |
//! |---|---|---|
//! | squares | `r^2` | `r` |
//! | Huber (1964) | `r^2` up to `k`, then `2 k abs(r) - k^2` | `r` limited to `-k .. k` |
//! | Student | `(nu + 1) ln(1 + r^2 / nu)` | `(nu + 1) r / (nu + r^2)` |
//!
//! The last is minus twice the log likelihood of Student's distribution with `nu` degrees of freedom (K. Lange, R. Little,
//! J. Taylor, *Robust statistical modeling using the t distribution*, JASA 84, 1989). The solver sees
//! `sign(r) sqrt(rho(r))`, whose sum of squares is the cost itself: a step is accepted only if the true cost falls.
//!
//! Far outliers have little or no influence; the price is a larger variance when there are none. An M-estimate has the
//! covariance `kappa (J^T J)^-1` with `kappa = mean(psi^2) / mean(psi')^2` (P. Huber, *Robust Statistics*, 1981, eq. (7.6.2)).

/// What a whitened residual costs.
///
/// ```
/// use ident::Loss;
///
/// // An outlier of ten standard deviations.
/// assert_eq!(Loss::Squares.rho(10.0), 100.0);
/// assert!(Loss::HUBER.rho(10.0) < 26.0 && Loss::STUDENT.rho(10.0) < 17.0);
/// assert_eq!(Loss::HUBER.rho(0.8), Loss::Squares.rho(0.8));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Loss {
    /// Least squares: the maximum of the likelihood when noise is Gaussian.
    #[default]
    Squares,
    /// Linear beyond `k` standard deviations. 1.345 keeps 95 % of the efficiency under Gaussian noise.
    Huber {
        /// Where squares end, in standard deviations.
        k: f64,
    },
    /// Maximum likelihood under Student's distribution. 4 is usual; large values are squares.
    Student {
        /// Degrees of freedom.
        dof: f64,
    },
}

impl Loss {
    /// The usual tuning of Huber's loss.
    pub const HUBER: Self = Self::Huber { k: 1.345 };
    /// The usual tuning of Student's loss.
    pub const STUDENT: Self = Self::Student { dof: 4.0 };

    /// True when the parameter of the loss is positive and finite.
    pub fn is_valid(&self) -> bool {
        let p = match *self {
            Self::Squares => return true,
            Self::Huber { k } => k,
            Self::Student { dof } => dof,
        };
        p > 0.0 && p.is_finite()
    }
    /// `rho(r)`.
    pub fn rho(&self, r: f64) -> f64 {
        match *self {
            Self::Huber { k } if r.abs() > k => k * (2.0 * r.abs() - k),
            Self::Student { dof } => (dof + 1.0) * (r * r / dof).ln_1p(),
            _ => r * r,
        }
    }
    /// `psi(r) = rho'(r) / 2`: the pull of a residual on the estimate.
    pub fn psi(&self, r: f64) -> f64 {
        match *self {
            Self::Huber { k } => r.clamp(-k, k),
            Self::Student { dof } => (dof + 1.0) * r / (dof + r * r),
            Self::Squares => r,
        }
    }
    /// `psi'(r)`.
    fn stiffness(&self, r: f64) -> f64 {
        match *self {
            Self::Huber { k } => f64::from(u8::from(r.abs() <= k)),
            Self::Student { dof } => (dof + 1.0) * (dof - r * r) / (dof + r * r).powi(2),
            Self::Squares => 1.0,
        }
    }
    /// `(sign(r) sqrt(rho(r)), its derivative)`: what the least-squares solver sees of a residual.
    pub(crate) fn root(&self, r: f64) -> (f64, f64) {
        if *self == Self::Squares {
            return (r, 1.0);
        }
        let root = self.rho(r).sqrt().copysign(r);
        // psi / root is 0 / 0 at r = 0; its limit is sqrt(psi'(0)).
        let slope = if r.abs() > 1e-8 { self.psi(r) / root } else { self.stiffness(0.0).sqrt() };
        (root, slope)
    }
    /// `kappa`: by how much the covariance exceeds `(J^T J)^-1` of unit noise, from the residuals at the estimate. One for
    /// [`Loss::Squares`], where the given noise is believed; infinite when no residual has any pull left.
    pub(crate) fn inflation(&self, residuals: &[f64]) -> f64 {
        if *self == Self::Squares || residuals.is_empty() {
            return 1.0;
        }
        let n = residuals.len() as f64;
        let pull = residuals.iter().map(|&r| self.psi(r).powi(2)).sum::<f64>() / n;
        let stiffness = residuals.iter().map(|&r| self.stiffness(r)).sum::<f64>() / n;
        if stiffness > 0.0 { pull / stiffness.powi(2) } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ff_testkit::scaled;

    const ALL: [Loss; 4] = [Loss::Squares, Loss::HUBER, Loss::Huber { k: 0.6 }, Loss::STUDENT];

    #[test]
    fn pulls_and_slopes_are_derivatives() {
        let h = 1e-6;
        for l in ALL {
            for r in [-7.3, -1.9, -0.4, 1e-3, 0.31, 1.2, 40.0] {
                assert_relative_eq!(l.psi(r), (l.rho(r + h) - l.rho(r - h)) / (4.0 * h), max_relative = scaled(1e-6));
                assert_relative_eq!(l.stiffness(r), (l.psi(r + h) - l.psi(r - h)) / (2.0 * h), epsilon = scaled(1e-8));
                let (root, slope) = l.root(r);
                assert_relative_eq!(root * root, l.rho(r), max_relative = scaled(1e-12));
                assert_relative_eq!(slope, (l.root(r + h).0 - l.root(r - h).0) / (2.0 * h), epsilon = scaled(1e-6));
            }
            assert_relative_eq!(l.root(0.0).1, l.root(1e-4).1, epsilon = scaled(1e-6));
        }
    }

    #[test]
    fn large_parameters_are_squares_and_wrong_ones_are_refused() {
        let l = Loss::Student { dof: 1e9 };
        assert_relative_eq!(l.rho(2.3), 2.3f64.powi(2), max_relative = scaled(1e-8));
        assert_relative_eq!(Loss::Huber { k: 50.0 }.rho(-3.1), 3.1f64.powi(2), max_relative = scaled(1e-14));
        for p in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(!Loss::Huber { k: p }.is_valid() && !Loss::Student { dof: p }.is_valid());
        }
        assert!(ALL.iter().all(Loss::is_valid));
        assert_eq!(Loss::HUBER.inflation(&[9.0, -8.0]), f64::INFINITY);
        assert_eq!(Loss::Squares.inflation(&[9.0, -8.0]), 1.0);
    }
}
