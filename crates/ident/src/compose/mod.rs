//! Several records, parameters tied to each other, rough starts, many starts.

pub(crate) mod changed;
pub(crate) mod continuation;
pub(crate) mod masked;
pub(crate) mod multi_start;
pub(crate) mod several;
pub(crate) mod shared_errors;
pub(crate) mod substituted;
pub(crate) mod ties;

pub use changed::{Changed, Changes};
pub use continuation::{Accept, Pass, Staged, Trial, estimate_staged};
pub use masked::Masked;
pub use multi_start::{Best, Ending, best_of, equal_cost};
pub use several::{Several, Shared, SharedError, is_called};
pub use shared_errors::{CommonErrors, SharedErrors};
pub use substituted::{Substituted, Substitution};
pub use ties::{Affine, Tie, TieError, TieMap, Tied, Ties};
