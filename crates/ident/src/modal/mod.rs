//! TODO-FOLDER ident modal

pub(crate) mod assignment;
pub(crate) mod estimate;
pub(crate) mod matching;
pub(crate) mod model;

pub use estimate::{Converted, ModalEstimate, ModalEstimateError, ModalRequest, convert_modes, estimate_modal};
pub use matching::{MatchSettings, ModeMatch, Pair, Stray, Unseen, match_modes};
pub use model::{HeldPose, ModalModel, ModalModelError, ModeDerivatives, ModelMode};
