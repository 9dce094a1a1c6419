//! Why an identification has no result.

use ff_model::{Area, Problem, Problems};
use ident::EstimateError;
use ident::estimate::NuisanceError;

/// Why there is no result.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// Mission, record and settings do not belong together: problems with places and next steps.
    #[error("{0}")]
    Refused(Problems),
    /// The record cannot tell what was asked for: problems, with exit code 13.
    #[error("{0}")]
    IllPosed(Problems),
    /// The fit failed.
    #[error(transparent)]
    Fit(#[from] EstimateError),
    /// Stopped from outside.
    #[error("interrupted")]
    Interrupted,
    /// The model could not be evaluated.
    #[error("{0}")]
    Model(String),
}

impl From<NuisanceError> for IdentifyError {
    fn from(e: NuisanceError) -> Self {
        match e {
            NuisanceError::Evaluate(e) => Self::Model(e.to_string()),
            NuisanceError::Minimise(e) => Self::Fit(e.into()),
        }
    }
}

/// One problem with the configuration.
pub(crate) fn config(code: &'static str, what: impl Into<String>, hint: &str) -> Problems {
    Problems(vec![Problem::error(Area::Config, code, what).hint(hint)])
}
