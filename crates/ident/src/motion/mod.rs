//! Joint rates and accelerations that belong to measured positions.

pub(crate) mod banded;
mod bent;
mod free_knots;
pub(crate) mod joint_motion;
pub(crate) mod kink;
pub(crate) mod kink_search;
pub(crate) mod knot_risk;
pub(crate) mod knot_spectrum;
mod last_fits;
pub(crate) mod late_encoder;
pub(crate) mod loose_ends;
mod planned;
pub(crate) mod segments;
pub(crate) mod spline_basis;
pub(crate) mod spline_fit;
pub(crate) mod stamped_motion;
pub(crate) mod tables;
mod tied_knots;
pub(crate) mod torque_corners;
pub(crate) mod torque_sensitivity;
pub(crate) mod zero_phase;

pub use joint_motion::{joint_motion, motion_at_stake, spectral_motion};
pub use kink::{FittedMotion, Kink};
pub use knot_spectrum::{KNOTS_PER_PERIOD, KnotError, KnotReason, SpectralFit, Stake, fit_at_stake, fit_by_spectrum};
pub use spline_fit::{
    DEGREE, FitError, JointSamples, MotionFit, choose_knots, fit_motion, fit_motion_from_rest, fit_with_kinks,
    noise_estimate, noise_of,
};
pub use torque_corners::Corner;
pub use zero_phase::ZeroPhase;
