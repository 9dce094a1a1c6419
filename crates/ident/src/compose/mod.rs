//! Several records, parameters tied to each other, rough starts, many starts.

pub(crate) mod changed;
pub(crate) mod continuation;
pub(crate) mod exchange;
pub(crate) mod masked;
pub(crate) mod multi_start;
pub(crate) mod several;
pub(crate) mod shared_errors;
pub(crate) mod tied_rows;
pub(crate) mod ties;

pub use changed::Changed;
pub use continuation::{Accept, Pass, Staged, Trial, estimate_staged};
pub use exchange::{Exchange, Exchanged, difference, exchanges};
pub use masked::Masked;
pub use multi_start::{Best, Ending, best_of, equal_cost};
pub use several::{Several, Shared, SharedError, is_called};
pub use shared_errors::SharedErrors;
pub use ties::{Affine, Tie, TieError, TieMap, Tied};
