//! An identification with what figures and files need.

use super::evidence::NamedError;
use super::fitted::Fitted;
use super::result::identification::IdentificationResult;
use super::signals::Signals;
use ident::sample::Draws;

/// A result with what figures and files need beside it.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The result; its held-out part and its warnings are the caller's to add.
    pub result: IdentificationResult,
    /// Signals of every record.
    pub signals: Vec<Signals>,
    /// All parameters with the estimates in place.
    pub values: Vec<f64>,
    /// Indices of the parameters that were estimated, for themselves or by a tie.
    pub selected: Vec<usize>,
    /// Every error that was tested, each by itself, whether the record speaks for it or not.
    pub tried: Vec<NamedError>,
    /// Draws from the posterior ([`super::sample_posterior`]).
    pub draws: Option<Draws>,
    /// Where the fit has ended; none on the ground.
    pub(super) fitted: Option<Fitted>,
}
