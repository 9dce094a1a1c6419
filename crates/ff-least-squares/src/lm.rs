//! Levenberg-Marquardt for whitened nonlinear least squares, with box bounds and an honest status.
//!
//! Minimises `C(x) = |r(x)|^2 / 2` by steps `p = argmin |J p + r|` subject to `|D p| <= Delta`, where
//! `D_j` is the largest norm column j has shown so far (J. More, *The Levenberg-Marquardt algorithm*, LNM 630,
//! 1978). Each linearisation is first reduced to a triangle `R` with `R^T R = J^T J` and `c = Q^T r`
//! ([`reduce`]), so that the search for the damping works on n x n numbers only: with `R D^-1 = U S V^T`,
//!
//! ```text
//! D p(lambda) = -V diag(s / (s^2 + lambda)) U^T c,      lambda from |D p| = Delta (More's Newton iteration)
//! ```
//!
//! A variable at its bound whose gradient points outwards is held for the step; the step of the others is
//! projected onto the box. `Delta` follows the gain ratio (actual over predicted reduction).

use crate::linearise::{Dense, Linearise, curvature, finite};
use crate::step::Linear;
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

/// How the trust region measures a step.
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
/// use ff_least_squares::{Scale, Settings, minimise};
///
/// // Both ways of measuring a step lead to the same minimum.
/// let settings = |scale| Settings { scale, ..Settings::default() };
/// let [columns, unit] = [Scale::Columns, Scale::Unit].map(|s| minimise(&mut Decay, &[2.0, 0.5], &settings(s)).unwrap().x);
/// assert!((columns[0] - unit[0]).abs() < 1e-8 && (columns[1] - unit[1]).abs() < 1e-8);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// By the largest column norms so far (More): independent of the units of the unknowns.
    Columns,
    /// By the unknowns themselves, `D = 1`: for coordinates whose length means something. Directions that the
    /// data hardly see then wait until the others have settled, instead of being moved the most.
    Unit,
}

/// When to stop. The defaults suit whitened residuals.
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
/// // The rate is 0.7; a bound below it is met, and the status says which unknown stopped there.
/// let settings = Settings { bounds: vec![(0.0, 9.0), (0.1, 0.6)], ..Settings::default() };
/// let solution = minimise(&mut Decay, &[2.0, 0.5], &settings)?;
/// assert!(matches!(solution.status, Status::AtBound { ref at, .. } if *at == [1]), "{:?}", solution.status);
/// # Ok::<(), ff_least_squares::LmError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Converged when an undamped Gauss-Newton step promises a relative reduction of the cost below this.
    /// With N residuals the parameters are then within about `sqrt(tol N)` of their standard deviations.
    pub decrement_tolerance: f64,
    /// Converged when an undamped Gauss-Newton step promises to reduce `|r|^2` by less than this, times `|r|^2` per residual where that
    /// is below one (residuals smaller than the noise they were divided by). The unknowns are then within about the square root of it
    /// of their standard deviations: 1e-4 is a hundredth of a deviation. 0 leaves the end to the other tests.
    pub gain_tolerance: f64,
    /// Converged when an accepted, undamped step is shorter than this relative to the point (scaled norms).
    pub step_tolerance: f64,
    /// Converged when the cost falls below this (problems with zero residual).
    pub cost_floor: f64,
    /// Most linearisations.
    pub max_iterations: usize,
    /// How unknowns are measured in the trust region.
    pub scale: Scale,
    /// First trust radius: with [`Scale::Columns`] relative to `|D x|` (absolute for `x = 0`), else absolute.
    pub initial_radius: f64,
    /// Largest trust radius, in the same measure; infinite unless set.
    pub max_radius: f64,
    /// Follow curved valleys: correct every step by the second derivative of the residuals along it (geodesic
    /// acceleration), found with one more evaluation. Pays where a Jacobian costs much more than residuals.
    pub acceleration: bool,
    /// After an undamped step that kept its promise, go on with the same linearisation (the chord method) for as long as it
    /// does; bring one that did not keep its promise to a fifth to where its parabola is lowest. Pays where a Jacobian costs
    /// much more than residuals; what is called converged is so by a linearisation of its own.
    pub chord: bool,
    /// Lower and upper bound of each unknown; empty for none. Infinite entries are free.
    pub bounds: Vec<(f64, f64)>,
    /// Singular values of `R D^-1` below this times the largest count as zero.
    pub rank_tolerance: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            decrement_tolerance: 1e-12,
            gain_tolerance: 0.0,
            step_tolerance: 1e-10,
            cost_floor: 0.0,
            max_iterations: 100,
            scale: Scale::Columns,
            initial_radius: 1.0,
            max_radius: f64::INFINITY,
            acceleration: false,
            chord: false,
            bounds: Vec::new(),
            rank_tolerance: 1e-13,
        }
    }
}

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
    /// What is left to gain is small against the statistics ([`Settings::gain_tolerance`]).
    Statistics,
    /// Steps of full length gain next to nothing although an undamped one promises more: a direction along which the cost is flat,
    /// on which the data say nothing. Its unknowns are where the fit left them.
    Flat,
    /// The promised reduction is below the rounding of the cost and no longer shrinks: tighter tolerances
    /// than the arithmetic can meet were asked for.
    Rounding,
}

/// Relative reduction of the cost that its own rounding hides. Below it the gain ratio is noise, and steps
/// are judged by whether the promise (the projected gradient) still shrinks.
const UNRESOLVED: f64 = 1e-12;

/// Length of an undamped step ([`Scale::Unit`]) below which its second order is left to chords.
const NEAR: f64 = 0.1;

/// Gains of undamped steps whose length is right.
const KEPT: (f64, f64) = (0.8, 1.2);
/// Largest factor on the length of others.
const FARTHEST: f64 = 5.0;

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

/// The result of [`minimise`].
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
    /// Calls of [`Problem::residuals`] and [`Problem::jacobian`] together.
    pub evaluations: usize,
    /// Linearisations.
    pub iterations: usize,
    /// Trust radius at the end, to go on from.
    pub radius: f64,
    /// Every trial step.
    pub history: Vec<Iterate>,
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

fn half_norm2(r: &[f64]) -> f64 {
    0.5 * r.iter().map(|x| x * x).sum::<f64>()
}

/// `C(x) - C(x')` as `(r - r').(r + r') / 2`: near the minimum the two costs agree to all digits, and their
/// difference would be rounding noise.
fn reduction(r: &[f64], new: &[f64]) -> f64 {
    0.5 * r.iter().zip(new).map(|(a, b)| (a - b) * (a + b)).sum::<f64>()
}

/// Minimises from `start`.
///
/// Memory: two vectors of m and two m x n matrices, besides n x n work per iteration.
///
/// # Errors
/// [`LmError`]. A fit that ends without a minimum is not an error; look at [`Solution::status`].
pub fn minimise<P: Problem + ?Sized>(problem: &mut P, start: &[f64], set: &Settings) -> Result<Solution, LmError> {
    let mut dense = Dense::new(problem);
    let solution = minimise_linearised(&mut dense, start, set)?;
    Ok(Solution { jacobian: dense.j, ..solution })
}

/// As [`minimise`], for a problem that keeps its Jacobian: that of the solution is left empty.
///
/// A trait object, so that the solver is compiled once and not for every problem of every crate.
pub fn minimise_linearised(problem: &mut dyn Linearise, start: &[f64], set: &Settings) -> Result<Solution, LmError> {
    const TRIES: usize = 10;
    let n = problem.dim();
    check_start(n, start, &set.bounds)?;
    let bound = |i: usize| set.bounds.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let mut x = start.to_vec();
    let mut r = Vec::new();
    let (mut rr, mut c) = match problem.linearise(&x, &mut r)? {
        Ok(triangle) => triangle,
        Err(reason) => {
            return Err(LmError::NonFiniteResidual { attempts: 1, values: problem.describe(&x), best: x, reason });
        }
    };
    problem.accept();
    let mut cost = half_norm2(&r);
    let mut d: Vec<f64> = vec![0.0; n];
    let (mut radius, mut evaluations) = (f64::NAN, 1);
    let (mut trial, mut r_trial) = (x.clone(), Vec::with_capacity(r.len()));
    let mut history = Vec::new();
    let (mut bad, mut iteration, mut small_step, mut flat_from) = (0, 0, false, None);
    let (status, active) = 'outer: loop {
        for (i, d) in d.iter_mut().enumerate() {
            let norm = if set.scale == Scale::Unit { 1.0 } else { rr.column(i).norm() };
            *d = if *d == 0.0 && norm == 0.0 { 1.0 } else { d.max(norm) };
        }
        let gradient = rr.tr_mul(&c);
        let (lower, upper): (Vec<f64>, Vec<f64>) = (0..n).map(bound).unzip();
        let held: Vec<usize> = (0..n)
            .filter(|&i| (x[i] <= lower[i] && gradient[i] > 0.0) || (x[i] >= upper[i] && gradient[i] < 0.0))
            .collect();
        let free = (0..n).filter(|i| !held.contains(i)).collect();
        let lin = Linear::new(rr, c, &d, free, set.rank_tolerance)?;
        let x_norm = scaled_norm(&x, &d);
        if radius.is_nan() {
            let relative = set.scale == Scale::Columns && x_norm > 0.0;
            radius = (set.initial_radius * if relative { x_norm } else { 1.0 }).min(set.max_radius);
        }
        let decrement = if cost > 0.0 { lin.promised() / cost } else { 0.0 };
        let done = if cost <= set.cost_floor {
            Some(Criterion::Cost)
        } else if decrement <= set.decrement_tolerance {
            Some(Criterion::Decrement)
        } else if 2.0 * lin.promised() <= set.gain_tolerance * (2.0 * cost / r.len() as f64).min(1.0) {
            Some(Criterion::Statistics)
        } else if small_step {
            Some(Criterion::Step)
        } else if flat_from.is_some_and(|before| decrement > 0.9 * before) {
            Some(Criterion::Rounding)
        } else {
            None
        };
        if let Some(by) = done {
            let status = if held.is_empty() { Status::Converged { by } } else { Status::AtBound { at: vec![], by } };
            break 'outer (status, held);
        }
        if iteration >= set.max_iterations {
            break 'outer (Status::IterationLimit, held);
        }
        (rr, c) = loop {
            let lambda = lin.damping(radius);
            let p = lin.step(lambda, &d);
            for i in 0..n {
                trial[i] = (x[i] + p[i]).clamp(lower[i], upper[i]);
            }
            let p: Vec<f64> = trial.iter().zip(&x).map(|(t, x)| t - x).collect();
            // Near the end chords do as much, and are steps of their own.
            let near = set.chord && lambda == 0.0 && set.scale == Scale::Unit && scaled_norm(&p, &d) < NEAR;
            if set.acceleration && decrement > UNRESOLVED && !near {
                evaluations += 1;
                if let Some(g) = curvature(problem, &lin, &x, &p, &r, &mut r_trial)?
                    && let Some(a) = lin.correction(lambda, &d, &p, &g)
                {
                    for i in 0..n {
                        trial[i] = (trial[i] + a[i]).clamp(lower[i], upper[i]);
                    }
                }
            }
            let p_norm = scaled_norm(&p, &d);
            let predicted = lin.predicted(&p);
            let mut note = Iterate { iteration, cost, decrement, lambda, radius, gain: None, accepted: false };
            // Below this radius no representable change of x is left: the promise cannot be kept.
            if p_norm <= 4.0 * f64::EPSILON * x_norm || radius < 1e-30 {
                history.push(note);
                let by = Criterion::Rounding;
                let resolved = UNRESOLVED.max(problem.rounding(&x, &r) / cost);
                let status = match decrement <= resolved {
                    true if held.is_empty() => Status::Converged { by },
                    true => Status::AtBound { at: vec![], by },
                    false => Status::Stalled { promised: decrement },
                };
                break 'outer (status, held);
            }
            evaluations += 1;
            let mut tried = problem.residuals(&trial, &mut r_trial)?;
            let gain = if predicted > 0.0 && tried.is_ok() { reduction(&r, &r_trial) / predicted } else { -1.0 };
            let flat =
                decrement <= UNRESOLVED && lambda == 0.0 && (cost - half_norm2(&r_trial)).abs() <= UNRESOLVED * cost;
            let accept = tried.is_ok() && (gain > 1e-4 || flat);
            let mut triangle = None;
            if accept {
                if set.chord && lambda == 0.0 && decrement > UNRESOLVED && !(KEPT.0..KEPT.1).contains(&gain) {
                    let room = Room { x: &x, d: &d, lower: &lower, upper: &upper, radius: set.max_radius };
                    evaluations += along(problem, &room, gain, (&mut trial, &mut r_trial))?;
                }
                if set.chord && lambda == 0.0 && gain > 0.25 {
                    let room = Room { x: &x, d: &d, lower: &lower, upper: &upper, radius: set.max_radius };
                    evaluations += chord(problem, &lin, &room, set, &mut trial, &mut r_trial)?;
                }
                evaluations += 1;
                tried = problem.linearise(&trial, &mut r_trial)?.map(|t| triangle = Some(t));
            }
            if let Err(reason) = tried {
                bad += 1;
                history.push(note);
                if bad >= TRIES {
                    let values = problem.describe(&trial);
                    return Err(LmError::NonFiniteResidual { attempts: bad, values, best: x, reason });
                }
                radius = 0.1 * radius.min(p_norm);
                continue;
            }
            bad = 0;
            note.gain = Some(gain);
            note.accepted = accept;
            history.push(note);
            if gain < 0.25 {
                radius = radius.min(p_norm) * if gain < 0.0 { 0.25 } else { 0.5 };
            } else if gain > 0.75 || lambda == 0.0 {
                radius = radius.max(2.0 * p_norm).min(set.max_radius.max(radius));
            }
            if let Some(triangle) = triangle {
                problem.accept();
                flat_from = flat.then_some(decrement);
                small_step = lambda == 0.0 && gain > 0.25 && p_norm <= set.step_tolerance * x_norm;
                core::mem::swap(&mut x, &mut trial);
                core::mem::swap(&mut r, &mut r_trial);
                cost = half_norm2(&r);
                iteration += 1;
                break triangle;
            }
        };
    };
    let status = match status {
        Status::AtBound { by, .. } => Status::AtBound { at: active, by },
        s => s,
    };
    let jacobian = DMatrix::zeros(0, 0);
    Ok(Solution { x, cost, residuals: r, jacobian, status, evaluations, iterations: iteration, radius, history })
}

/// Where steps may lead: bounds, and how far from the linearisation.
struct Room<'a> {
    x: &'a [f64],
    d: &'a [f64],
    lower: &'a [f64],
    upper: &'a [f64],
    radius: f64,
}

/// Takes an undamped step that did not keep its promise to where the parabola through both its ends is lowest: `1 / (2 - gain)` times its
/// length, at most [`FARTHEST`] times, if the residuals there are smaller. Where the residuals are curved against what they leave,
/// Gauss-Newton steps are wrong by the factor `gain - 1` each, and converge as slowly. Returns the number of evaluations.
fn along<P: Linearise + ?Sized>(
    problem: &mut P,
    room: &Room<'_>,
    gain: f64,
    (trial, r_trial): (&mut Vec<f64>, &mut Vec<f64>),
) -> Result<usize, LmError> {
    let times = if gain < 2.0 { (1.0 / (2.0 - gain)).min(FARTHEST) } else { FARTHEST };
    let far = |k: usize| (room.x[k] + times * (trial[k] - room.x[k])).clamp(room.lower[k], room.upper[k]);
    let next: Vec<f64> = (0..trial.len()).map(far).collect();
    let way: Vec<f64> = next.iter().zip(room.x).map(|(a, b)| a - b).collect();
    if scaled_norm(&way, room.d) > room.radius {
        return Ok(0);
    }
    let mut r_next = Vec::with_capacity(r_trial.len());
    if problem.residuals(&next, &mut r_next)?.is_ok() && reduction(r_trial, &r_next) > 0.0 {
        *trial = next;
        core::mem::swap(r_trial, &mut r_next);
    }
    Ok(1)
}

/// Goes on from `trial` by steps of the linearisation at hand, as long as each finds less than a quarter left of what the one before
/// promised, and wins what it promises itself. Returns the number of evaluations.
fn chord<P: Linearise + ?Sized>(
    problem: &mut P,
    lin: &Linear,
    room: &Room<'_>,
    set: &Settings,
    trial: &mut Vec<f64>,
    r_trial: &mut Vec<f64>,
) -> Result<usize, LmError> {
    const STEPS: usize = 6;
    let (mut before, mut r_next) = (lin.promised(), Vec::with_capacity(r_trial.len()));
    for step in 0..STEPS {
        let Ok(gradient) = problem.transposed(r_trial)? else { return Ok(step) };
        let (p, promised) = lin.again(&gradient, room.d);
        let least = set.decrement_tolerance.max(UNRESOLVED) * half_norm2(r_trial);
        let next: Vec<f64> = (0..p.len()).map(|i| (trial[i] + p[i]).clamp(room.lower[i], room.upper[i])).collect();
        let way: Vec<f64> = next.iter().zip(room.x).map(|(a, b)| a - b).collect();
        let worth = promised > least && promised < 0.25 * before && scaled_norm(&way, room.d) < room.radius;
        if !worth {
            return Ok(step);
        }
        if problem.residuals(&next, &mut r_next)?.is_err() || reduction(r_trial, &r_next) < 0.5 * promised {
            return Ok(step + 1);
        }
        *trial = next;
        core::mem::swap(r_trial, &mut r_next);
        before = promised;
    }
    Ok(STEPS)
}

fn scaled_norm(p: &[f64], d: &[f64]) -> f64 {
    p.iter().zip(d).map(|(p, d)| (p * d).powi(2)).sum::<f64>().sqrt()
}

fn check_start(n: usize, start: &[f64], bounds: &[(f64, f64)]) -> Result<(), LmError> {
    if n == 0 || start.len() != n {
        return Err(LmError::Setup(format!("{n} unknowns, but the start has {}", start.len())));
    }
    if !bounds.is_empty() && bounds.len() != n {
        return Err(LmError::Setup(format!("{n} unknowns, but {} bounds", bounds.len())));
    }
    for (i, x) in start.iter().enumerate() {
        let (lo, hi) = bounds.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        if !(x.is_finite() && lo <= *x && *x <= hi) {
            return Err(LmError::Setup(format!("start {i} is {x}, must be finite and in {lo} .. {hi}")));
        }
    }
    Ok(())
}

/// Largest difference between the Jacobian and central differences of step `h * max(1, |x_i|)`, relative to
/// the norm of the column. For tests of new problems; 2n + 1 evaluations.
///
/// # Errors
/// [`LmError::Fatal`] or [`LmError::NonFiniteResidual`] when a point cannot be evaluated.
pub fn jacobian_error<P: Problem + ?Sized>(problem: &mut P, x: &[f64], h: f64) -> Result<f64, LmError> {
    let (mut r, mut j) = (Vec::new(), DMatrix::zeros(0, 0));
    let ok = |res, r: &[f64], j: Option<&DMatrix<f64>>, x: &[f64]| match finite(res, r, j)? {
        Ok(()) => Ok(()),
        Err(reason) => {
            let values = x.iter().enumerate().map(|(i, v)| (format!("x[{i}]"), *v)).collect();
            Err(LmError::NonFiniteResidual { attempts: 1, values, best: x.to_vec(), reason })
        }
    };
    let res = problem.jacobian(x, &mut r, &mut j);
    ok(res, &r, Some(&j), x)?;
    let mut worst = 0.0f64;
    for i in 0..x.len() {
        let step = h * x[i].abs().max(1.0);
        let mut side = [Vec::new(), Vec::new()];
        for (out, sign) in side.iter_mut().zip([1.0, -1.0]) {
            let mut y = x.to_vec();
            y[i] += sign * step;
            let res = problem.residuals(&y, out);
            ok(res, out, None, &y)?;
        }
        let norm = j.column(i).norm().max(f64::MIN_POSITIVE);
        let diff = side[0].iter().zip(&side[1]).enumerate();
        let e2: f64 = diff.map(|(k, (a, b))| ((a - b) / (2.0 * step) - j[(k, i)]).powi(2)).sum();
        worst = worst.max(e2.sqrt() / norm);
    }
    Ok(worst)
}

#[cfg(test)]
#[path = "lm_tests.rs"]
mod tests;
