//! Measured records of joint motion, joint torques and base sensors.
//!
//! [`RecordBuilder`] is the one door for data: non-finite numbers, broken clocks and ragged columns stop there, all problems at once.
//!
//! | module | contents |
//! |---|---|
//! | [`record`] | [`Record`]: samples that can be relied on |
//! | [`builder`] | from columns to a record, with every check |
//! | [`clock`] | lags of the channels, and a record resampled onto one clock |
//! | [`mask`] | which samples count |
//! | [`file`](mod@file) | CSV with units, Parquet and ROS 2 bags (features `parquet`, `mcap`) |

pub mod builder;
mod checks;
pub mod clock;
pub mod file;
pub mod mask;
pub mod record;
mod runs;
mod thin;

pub use builder::RecordBuilder;
pub use mask::Mask;
pub use record::Record;

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
