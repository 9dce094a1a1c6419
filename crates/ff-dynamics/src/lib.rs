//! How it moves: dynamics of free-floating robots with passive appendages.
//!
//! `algorithm(model, params, state, work)`: the [`Model`](ff_model::Model) is immutable, [`Work`] owns every
//! buffer, and nothing allocates after `Work::new`. Algorithms are written once over
//! [`ModelScalar`](ff_model::scalar::ModelScalar). Conventions are those of [`ff_model`].
//!
//! | question | module |
//! |---|---|
//! | forces for a motion | [`mod@rnea`] |
//! | mass matrix, blocks of eq. (2), condition | [`crba`], [`blocks`], [`mod@conditioning`] |
//! | motion for forces; prescribed joints | [`forward`], [`mod@aba`] |
//! | momentum, energy, dissipation; centroidal momentum matrix | [`momentum`], [`mod@centroidal`] |
//! | dependence on parameters | [`mod@regressor`] |
//! | dependence on positions and velocities | [`derivatives`] |
//! | prescribed arm condensed; records and their sensitivities | [`prescribed`], [`reduced`], [`sensitivity`] |
//! | joint motions | [`motion`], [`bspline`] |
//! | frequencies and damping | [`mod@modes`] |
//! | frames | [`frames`] |
//! | a motion over time, and what sensors see of it | [`mod@simulate`], [`sensors`] |
//! | thrusters, wrenches, gravity gradient, motors | [`inputs`] |
//! | several runs at once, one per lane | [`ensemble`] |
//! | the step a system needs; steps that adapt | [`step`], [`adaptive`] |

pub mod aba;
pub mod adaptive;
mod attitude;
pub mod blocks;
pub mod bspline;
pub mod centroidal;
mod condense;
pub mod conditioning;
pub mod crba;
pub mod derivatives;
pub mod ensemble;
mod flight;
mod flow;
pub mod forward;
pub mod frames;
mod gather;
pub mod inputs;
pub mod integrate;
pub mod ldl;
mod ltl;
pub mod modes;
pub mod momentum;
pub mod motion;
mod parts;
mod plant;
pub mod prescribed;
pub mod reduced;
mod reduced_torques;
pub mod regressor;
pub mod rnea;
mod rows;
pub mod sensitivity;
pub mod sensors;
pub mod simulate;
pub mod state;
pub mod step;
mod tangent;
mod torque_rows;
mod trace;
mod tree;
mod work;

pub use aba::{SingularInertia, aba};
pub use adaptive::{AdaptiveOptions, StepReport, simulate_adaptive};
pub use attitude::Attitude;
pub use blocks::MassBlocks;
pub use centroidal::{Centroidal, CentroidalRate};
pub use conditioning::{Conditioning, conditioning};
pub use crba::{mass_matrix, mass_matrix_lower};
pub use derivatives::{Derivatives, hybrid_columns, rnea_derivatives};
pub use ensemble::{Keep, Run, RunTrace, simulate_ensemble};
pub use forward::{forward_dynamics, hybrid_dynamics};
pub use frames::{frame_jacobian, frame_pose};
pub use inputs::{ExternalInput, InputError};
pub use modes::{Boundary, Mode, modes};
pub use momentum::{Budget, budget};
pub use prescribed::{Prescribed, Sampling};
pub use reduced::{ReducedError, Response, simulate_reduced, simulate_reduced_batch, simulate_reduced_span};
pub use reduced_torques::{reduced_torques, reduced_torques_span};
pub use regressor::{Regressor, body_regressor, regressor};
pub use rnea::{bias, rnea};
pub use sensitivity::{Carried, Sensitivities, Wanted, sensitivities, sensitivities_span, sensitivities_with};
pub use sensors::{Accelerometer, Channel, Readings, SensorSuite, measure};
pub use simulate::{Drive, SimError, SimOptions, Trace, simulate, simulate_with};
pub use state::{State, dof_names};
pub use step::{StepAdvice, advise_step, rk4_error};
pub use work::Work;
