//! TODO-FOLDER ff-dynamics analysis

pub(crate) mod centroidal;
pub(crate) mod conditioning;
pub(crate) mod modes;
pub(crate) mod momentum;
pub(crate) mod step;

pub use centroidal::{Centroidal, CentroidalRate};
pub use conditioning::{Conditioning, SHARE, conditioning};
pub use modes::{Boundary, Mode, ModesError, modes, stiffness_damping};
pub use momentum::{Budget, budget};
pub use step::{StepAdvice, advise_step, rk4_error};
