//! What an identification hands to people and programs: `result.json`.

pub(crate) mod body;
pub(crate) mod channel;
pub(crate) mod fit;
pub(crate) mod held_out;
pub(crate) mod identification;
pub(crate) mod parameter;
pub(crate) mod provenance;
pub(crate) mod sampled;
pub(crate) mod uncertain;

pub use body::{BodyLine, BodyQuantity, PrincipalAxis};
pub use channel::{Channel, ModeLine};
pub use fit::{DescentStep, Ended, Method};
pub use held_out::HeldOut;
pub use identification::{FORMAT, IdentificationResult, VERSION};
pub use parameter::{Combination, Correlation, Covariance, Parameter, ParameterVerdict, STRONG, Value};
pub use provenance::{InputFile, Provenance, RecordLine, Warning};
pub use sampled::{Sampled, SampledLine, SampledState};
pub use uncertain::{Better, BudgetLine, BudgetShare, UncertainLine, held_errors};
