//! What is known of parameters: priors, posteriors, covariance, what no record could tell.

pub(crate) mod budget;
pub(crate) mod consider;
pub(crate) mod covariance;
pub(crate) mod hac;
pub(crate) mod identifiability;
pub(crate) mod posterior;
pub(crate) mod prior;
pub(crate) mod profile;
mod scaling;

pub use budget::{PriorGroup, prior_shares, tightened};
pub use consider::{Considered, consider};
pub use covariance::{Direction, Uncertainty, Unknown, analyse, physical_jacobian};
pub use hac::{ChannelRows, coloured_covariance};
pub use identifiability::{Combination, Reduced, Silence, reduce, reduce_parameters, silence, structural};
pub use posterior::{Posterior, PosteriorRows, SequenceError, change};
pub use prior::{PriorError, PriorRow, Priors, Sigma};
pub use profile::{LIMIT95, Point, Profile, profile};
