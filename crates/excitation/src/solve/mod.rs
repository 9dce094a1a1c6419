//! The optimiser: quadratic programs, SQP, search, conflicts, verification.

pub(crate) mod conflict;
pub(crate) mod demand;
pub(crate) mod observer;
pub(crate) mod problem;
pub(crate) mod qp;
pub(crate) mod search;
pub(crate) mod sqp;
pub(crate) mod verdict;

pub use demand::{Conflict, Demand};
pub use observer::{Observer, Progress};
pub use problem::Problem;
pub use search::{Found, MultiStart, ROUNDS, SearchOptions, multi_start, search, search_from};
pub use sqp::{Outcome, SqpOptions, Status, minimise, minimise_under};
pub use verdict::{Basis, ConstraintMargin, DENSER, Verdict, verify};
