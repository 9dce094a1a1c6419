//! Exact derivatives of a simulated record with respect to parameters.

pub(crate) mod assemble;
pub(crate) mod carried;
pub(crate) mod driver;
pub(crate) mod outputs;
pub(crate) mod partials;
pub(crate) mod propagate;
pub(crate) mod sink;
pub(crate) mod stage;
pub(crate) mod wanted;

pub use carried::Carried;
pub use driver::{Sensitivities, sensitivities, sensitivities_over, sensitivities_span, sensitivities_with};
pub use wanted::Wanted;
