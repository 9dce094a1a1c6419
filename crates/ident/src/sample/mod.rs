//! Draws from the posterior, and whether they can be trusted.
//!
//! ```text
//! density      -1/2 objective + ln |det dp/dx|, with its gradient, in coordinates whitened by the fit
//! chains       No-U-Turn sampling of any density (nuts-rs), several chains on several threads
//! rto          independent draws of a density nearby: randomise, then optimise
//! importance   draws of a density nearby, weighed
//! passes       every way of drawing, as often as it takes
//! posterior    all together: draws of the parameters of a fit
//! diagnostics  rank-normalised split R-hat, bulk and tail effective sizes
//! intervals    quantiles, highest-density intervals
//! ```
//!
//! See `docs/theory/sampling.md`.

mod chains;
mod density;
mod diagnostics;
mod importance;
mod intervals;
mod passes;
mod posterior;
mod rto;

pub use chains::{Chain, ChainSettings, LogDensity, SampleError, Trajectories};
pub use density::{Frame, PosteriorDensity};
pub use diagnostics::{Diagnosis, ess_bulk, ess_tail, r_hat};
pub use importance::{PARETO_K_MOST, Weights, resampled};
pub use intervals::{hdi, quantile};
pub use posterior::{Draws, ESS_LEAST, R_HAT_MOST, Way, Weighed, sample};
