//! Dynamics of free-floating robots with passive appendages.
//!
//! `algorithm(model, params, state, work)`: the [`Model`](ff_model::Model) is immutable, [`Work`] owns every
//! buffer, and nothing allocates after `Work::new`. Algorithms are written once over
//! [`ModelScalar`](ff_model::scalar::ModelScalar). Conventions are those of [`ff_model`].
//!
//! | module | contents |
//! |---|---|
//! | [`tree`] | RNEA, CRBA, forward and hybrid dynamics, derivatives, regressor, frames |
//! | [`reduced`] | the prescribed arm as a table; simulation of base and passive states; sensitivities |
//! | [`motion`] | joint motions, B-splines |
//! | [`sim`] | a motion over time, several at once in lanes, sensors, external inputs |
//! | [`analysis`] | modes, momentum and energy, centroidal quantities, conditioning, integration step |
//! | `batch` | the algorithms of `tree` for many motions at once, in lanes (feature `batch`) |
//! | [`state`], [`work`] | state of the system; buffers |
//! | [`linalg`] | factorisations of small matrices in place |

pub mod analysis;
#[cfg(feature = "batch")]
pub mod batch;
pub mod linalg;
pub mod motion;
pub mod reduced;
pub mod sim;
pub mod state;
pub mod tree;
pub mod work;

pub use analysis::{Boundary, Mode, modes};
pub use reduced::sensitivity::{Sensitivities, Wanted, sensitivities};
pub use reduced::{Prescribed, Response, Sampling, reduced_torques, simulate_reduced};
pub use sim::{Drive, Readings, SensorSuite, SimError, SimOptions, Trace, measure, simulate};
pub use state::State;
pub use tree::{
    Regressor, bias, forward_dynamics, frame_jacobian, frame_pose, hybrid_dynamics, mass_matrix, regressor, rnea,
};
pub use work::Work;

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
