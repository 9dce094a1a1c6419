//! TODO-FOLDER excitation solve

pub(crate) mod conflict;
pub(crate) mod observer;
pub(crate) mod problem;
pub(crate) mod qp;
pub(crate) mod search;
pub(crate) mod sqp;
pub(crate) mod verdict;

pub use conflict::{Conflict, Demand};
pub use observer::{Progress, Watch};
pub use problem::Problem;
pub use search::{Found, MultiStart, ROUNDS, SearchOptions, multi_start, search, search_from};
pub use sqp::{Outcome, SqpOptions, Status, minimise, minimise_under};
pub use verdict::{Basis, ConstraintMargin, DENSER, Verdict, verify};
