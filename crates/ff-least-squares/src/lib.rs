//! Least squares: Levenberg-Marquardt with bounds and rank decided, and triangles of tall matrices.
//!
//! * [`minimise`] solves a [`Problem`]: residuals and Jacobian in, [`Solution`] out, with the reason for stopping.
//! * [`Linearise`] is the interface of a problem that reduces its own Jacobian, so that it need not be kept whole.
//! * [`TallQr`] folds rows into a triangle as they come, in lanes, in memory that does not grow with their number.

mod covariance;
mod linearise;
mod lm;
mod pieces;
mod problem;
mod settings;
mod solution;
mod step;
mod tall_qr;

pub use covariance::{Determined, TOUCH, determine};
pub use linearise::{Dense, Linearise, NOT_FINITE, Reduced, Tried, finite, reduced, rounding};
pub use lm::{jacobian_error, minimise, minimise_linearised};
pub use problem::{EvalError, LmError, Problem};
pub use settings::{Scale, Settings};
pub use solution::{Criterion, Iterate, Solution, Status};
pub use step::reduce;
pub use tall_qr::{Merged, Stream, Tall, TallQr, Triangle, merge, qr_r, triangle_of};

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
