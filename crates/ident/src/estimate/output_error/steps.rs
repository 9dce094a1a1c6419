//! How long the steps of the integration may be.

use crate::estimate::request::FINEST;

/// Where a fit leaves more than this mean square, the integration may be off by this part of what is left beyond: springs that have run away
/// ask for hundreds of steps per sample, and there are no deviations there to be exact by.
const FAR: f64 = 1.5;
/// See [`FAR`].
const OF_WHAT_IS_LEFT: f64 = 1e-3;

/// Residuals in two numbers of steps.
#[derive(Clone, Copy)]
pub(super) struct Compared {
    /// [`super::OutputError::integration_error`].
    pub(super) error: f64,
    /// Sum of squares in the shorter ones.
    pub(super) residual: f64,
}

impl Compared {
    /// What the integration may be off by where no more than `limit` is asked for, given so many residuals ([`FAR`]).
    pub(super) fn allowed(&self, limit: f64, rows: usize) -> f64 {
        let left = (self.residual - FAR * rows as f64).max(0.0).sqrt();
        limit.max(OF_WHAT_IS_LEFT * left)
    }
}

/// Steps per sample at which those that make this error make no more than the limit.
pub(super) fn steps_for(limit: f64, steps: usize, error: f64) -> usize {
    ((steps as f64 * (error / limit).powf(0.25)).ceil() as usize).clamp(1, FINEST)
}
