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
//! | [`time_base`] | groups of channels with sample times of their own |
//! | [`file`](mod@file) | CSV with units, Parquet and bags of ROS (features `parquet`, `mcap`, `rosbag`) |

mod averaged;
pub mod builder;
mod carried;
mod checks;
pub mod clock;
mod content;
pub mod file;
pub mod mask;
pub mod record;
mod resample;
mod runs;
mod split;
mod stamps;
mod thin;
pub mod time_base;
mod time_checks;
mod uniform;

pub use averaged::{Averaging, Means};
pub use builder::RecordBuilder;
pub use carried::{Carried, WRENCH};
pub use content::Content;
pub use mask::Mask;
pub use record::Record;
pub use time_base::ChannelGroup;

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
