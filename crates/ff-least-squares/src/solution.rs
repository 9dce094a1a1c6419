//! How a fit ended, and where.

use nalgebra::DMatrix;

/// Which test was met.
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
/// use ff_least_squares::{Criterion, Settings, Status, minimise};
///
/// let settings = Settings { cost_floor: 1e-3, ..Settings::default() };
/// let solution = minimise(&mut Decay, &[2.0, 0.5], &settings)?;
/// assert_eq!(solution.status, Status::Converged { by: Criterion::Cost });
/// # Ok::<(), ff_least_squares::LmError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// The Gauss-Newton decrement: the data want no further change.
    Decrement,
    /// The last step was negligible although nothing held it back.
    Step,
    /// The cost reached its floor.
    Cost,
    /// What is left to gain is small against the statistics ([`Settings::gain_tolerance`](crate::Settings::gain_tolerance)).
    Statistics,
    /// Steps of full length gain next to nothing although an undamped one promises more: a direction along which the cost is flat,
    /// on which the data say nothing. Its unknowns are where the fit left them.
    Flat,
    /// The promised reduction is below the rounding of the cost and no longer shrinks: tighter tolerances
    /// than the arithmetic can meet were asked for.
    Rounding,
}

/// How a fit ended.
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
/// use ff_least_squares::{Settings, Status, minimise};
///
/// let settings = Settings { max_iterations: 1, ..Settings::default() };
/// let solution = minimise(&mut Decay, &[0.3, 4.0], &settings)?;
/// assert_eq!(solution.status, Status::IterationLimit); // the point is not an estimate
/// # Ok::<(), ff_least_squares::LmError>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum Status {
    /// A minimum inside the bounds.
    Converged {
        /// The test that was met.
        by: Criterion,
    },
    /// A minimum of the bounded problem, but these unknowns want to leave their bounds: their values and
    /// deviations are not estimates.
    AtBound {
        /// Indices of the unknowns at a bound.
        at: Vec<usize>,
        /// The test that was met by the others.
        by: Criterion,
    },
    /// No step reduces the cost, yet the linearisation promises one: the Jacobian is wrong, or the model
    /// is not smooth here. Not a solution.
    Stalled {
        /// Relative reduction that the linearisation still promises.
        promised: f64,
    },
    /// Ran out of iterations. Not a solution.
    IterationLimit,
}

impl Status {
    /// True for [`Status::Converged`] only.
    pub fn is_converged(&self) -> bool {
        matches!(self, Self::Converged { .. })
    }
}

/// One trial step.
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
/// use ff_least_squares::{Settings, minimise};
///
/// let solution = minimise(&mut Decay, &[0.9, 2.0], &Settings::default())?;
/// let accepted: Vec<f64> = solution.history.iter().filter(|step| step.accepted).map(|step| step.cost).collect();
/// assert!(accepted.windows(2).all(|costs| costs[1] < costs[0])); // each step reduces the cost
/// # Ok::<(), ff_least_squares::LmError>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Iterate {
    /// Linearisation it belongs to, from 0.
    pub iteration: usize,
    /// Cost before the step.
    pub cost: f64,
    /// Relative reduction that an undamped step promises at this linearisation.
    pub decrement: f64,
    /// Marquardt parameter of the step.
    pub lambda: f64,
    /// Trust radius of the step.
    pub radius: f64,
    /// Actual over predicted reduction; absent when the trial point could not be evaluated.
    pub gain: Option<f64>,
    /// Whether the point moved.
    pub accepted: bool,
}

/// The result of [`minimise`](crate::minimise).
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
/// use ff_least_squares::{Settings, determine, minimise};
///
/// let solution = minimise(&mut Decay, &[2.0, 0.5], &Settings::default())?;
/// let deviation = determine(&solution.jacobian, &[3.0, 0.7], 1e-10)?.deviation;
/// assert!((solution.x[1] - 0.7).abs() < 1e-9 && deviation.iter().all(Option::is_some));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Solution {
    /// Best point.
    pub x: Vec<f64>,
    /// Cost `|r|^2 / 2` there.
    pub cost: f64,
    /// Residuals there (m).
    pub residuals: Vec<f64>,
    /// Jacobian there (m x n), for `ident::belief::covariance`.
    pub jacobian: DMatrix<f64>,
    /// How the fit ended.
    pub status: Status,
    /// Calls of [`Problem::residuals`](crate::Problem::residuals) and [`Problem::jacobian`](crate::Problem::jacobian) together.
    pub evaluations: usize,
    /// Linearisations.
    pub iterations: usize,
    /// Trust radius at the end, to go on from.
    pub radius: f64,
    /// Every trial step.
    pub history: Vec<Iterate>,
}
