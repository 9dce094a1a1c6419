//! TODO-FOLDER ff-dynamics reduced::sensitivity

pub(crate) mod assemble;
pub(crate) mod driver;
pub(crate) mod outputs;
pub(crate) mod partials;
pub(crate) mod propagate;
pub(crate) mod stage;

pub use driver::{Carried, Sensitivities, Wanted, sensitivities, sensitivities_span, sensitivities_with};
