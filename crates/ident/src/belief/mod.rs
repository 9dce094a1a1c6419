//! TODO-FOLDER ident belief

pub(crate) mod covariance;
pub(crate) mod identifiability;
pub(crate) mod posterior;
pub(crate) mod prior;
pub(crate) mod profile;

pub use covariance::{Direction, Uncertainty, Unknown, analyse, physical_jacobian};
pub use identifiability::{Combination, Reduced, Silence, reduce, silence, structural};
pub use posterior::{Posterior, PosteriorRows, SequenceError, change};
pub use prior::{PriorError, PriorRow, Priors, Sigma};
pub use profile::{LIMIT95, Point, Profile, profile};
