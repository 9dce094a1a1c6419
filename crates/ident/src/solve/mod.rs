//! Linear least squares over a record, physical projection, and loss functions.

pub(crate) mod linear;
pub(crate) mod loss;
pub(crate) mod normal;
pub(crate) mod project;
pub(crate) mod regressor_rows;

pub use linear::{BaseParameter, LinearError, LinearEstimate, RowKind, Weights};
pub use loss::Loss;
pub use normal::Normal;
pub use project::{Body, Cone, Moved, Nearest, ProjectError, ProjectOptions, Projected, nearest, project};
