//! What is minimised: residuals and their Jacobian, and why there may be none.

use ff_linalg::LinalgError;
use nalgebra::DMatrix;

/// Why a point could not be evaluated.
///
/// ```
/// use ff_least_squares::EvalError;
///
/// fn temperature_factor(x: f64) -> Result<f64, EvalError> {
///     if x > 0.0 { Ok(x.ln()) } else { Err(EvalError::Rejected(format!("no logarithm of {x}"))) }
/// }
/// assert_eq!(temperature_factor(-0.4).unwrap_err().to_string(), "no logarithm of -0.4");
/// ```
#[derive(Debug, thiserror::Error)]
pub enum EvalError {
    /// The model has no answer here (it diverged, left its range); the solver tries a shorter step.
    #[error("{0}")]
    Rejected(String),
    /// Nothing will help; the solver stops.
    #[error(transparent)]
    Fatal(Box<dyn core::error::Error + Send + Sync>),
}

/// A whitened least-squares problem: residuals have unit standard deviation when the model is right.
///
/// ```
/// use ff_least_squares::{EvalError, Problem, jacobian_error};
/// use nalgebra::DMatrix;
///
/// /// The stiffness and offset of a hinge, from torques read at four angles; 0.02 N m noise.
/// struct Hinge;
/// impl Problem for Hinge {
///     fn dim(&self) -> usize { 2 }
///     fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
///         *r = [(0.1, 1.9), (0.3, 5.2), (0.4, 6.8), (0.7, 11.6)].map(|(a, tau)| (x[0] * (a - x[1]) - tau) / 0.02).to_vec();
///         Ok(())
///     }
///     fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
///         self.residuals(x, r)?;
///         let angles = [0.1, 0.3, 0.4, 0.7];
///         *j = DMatrix::from_fn(4, 2, |i, k| if k == 0 { angles[i] - x[1] } else { -x[0] } / 0.02);
///         Ok(())
///     }
/// }
/// assert!(jacobian_error(&mut Hinge, &[17.0, -0.02], 1e-6)? < 1e-7);
/// # Ok::<(), ff_least_squares::LmError>(())
/// ```
pub trait Problem {
    /// Number of unknowns n.
    fn dim(&self) -> usize;
    /// Residuals at `x` (n). Resizes `r` to m, which must not change between calls.
    ///
    /// # Errors
    /// [`EvalError`]; non-finite residuals need not be reported, the solver looks for them.
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError>;
    /// Residuals and their Jacobian `dr/dx` (m x n; resize `j` if need be) at `x`.
    ///
    /// # Errors
    /// As [`Problem::residuals`].
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError>;
    /// The values to print when `x` cannot be evaluated: by default `x[0]`, `x[1]`, ...; problems that map
    /// to physical parameters name those instead.
    fn describe(&self, x: &[f64]) -> Vec<(String, f64)> {
        x.iter().enumerate().map(|(i, v)| (format!("x[{i}]"), *v)).collect()
    }
}

/// Why there is no result.
///
/// ```
/// # use ff_least_squares::{EvalError, Problem};
/// # /// `y = 3 exp(-0.7 t)` at four times, fitted by `x0 exp(-x1 t)`.
/// # struct Decay;
/// # impl Problem for Decay {
/// #     fn dim(&self) -> usize { 2 }
/// #     fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
/// #         *r = [0.3, 0.9, 1.7, 2.6].map(|t: f64| x[0] * (-x[1] * t).exp() - 3.0 * (-0.7 * t).exp()).to_vec();
/// #         Ok(())
/// #     }
/// #     fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut nalgebra::DMatrix<f64>) -> Result<(), EvalError> {
/// #         let e = [0.3, 0.9, 1.7, 2.6].map(|t: f64| (t, (-x[1] * t).exp()));
/// #         *j = nalgebra::DMatrix::from_fn(4, 2, |i, k| if k == 0 { e[i].1 } else { -x[0] * e[i].0 * e[i].1 });
/// #         self.residuals(x, r)
/// #     }
/// # }
/// use ff_least_squares::{LmError, Settings, minimise};
///
/// let refused = minimise(&mut Decay, &[2.0, f64::NAN], &Settings::default()).unwrap_err();
/// assert!(matches!(refused, LmError::Setup(_)) && refused.exit_code() == 11);
/// ```
#[derive(Debug, thiserror::Error)]
pub enum LmError {
    /// Non-finite residuals or derivatives, at the start or ten trial points in a row (bad-inputs row D31).
    #[error("no finite residual {} at {}{}; give a start nearer the truth, or bounds",
        if *attempts == 1 { "at the start:".to_owned() } else { format!("in {attempts} attempts, the last") },
        named(values), if reason.is_empty() { String::new() } else { format!(" ({reason})") })]
    NonFiniteResidual {
        /// Trial points in a row.
        attempts: usize,
        /// Names and values at the last one.
        values: Vec<(String, f64)>,
        /// Best point so far.
        best: Vec<f64>,
        /// What the model said, if anything.
        reason: String,
    },
    /// The start has the wrong length, is not finite, or is outside the bounds; or m < n.
    #[error("{0}")]
    Setup(String),
    /// The problem gave up.
    #[error(transparent)]
    Fatal(Box<dyn core::error::Error + Send + Sync>),
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

impl LmError {
    /// Process exit code of `bad-inputs.md`: 11 for a wrong set-up, else 14 (numerical failure).
    pub fn exit_code(&self) -> u8 {
        if matches!(self, Self::Setup(_)) { 11 } else { 14 }
    }
}

fn named(values: &[(String, f64)]) -> String {
    values.iter().map(|(n, v)| format!("{n} = {v:.6e}")).collect::<Vec<_>>().join(", ")
}
