//! The integration tests as one program; as unit tests they would compile the crate a second time.
//! `cargo test -p ff-records --test all csv` runs those of `csv.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

#[cfg(any(feature = "mcap", feature = "rosbag"))]
mod bags;
mod builder;
mod csv;
mod foreign;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(feature = "rosbag")]
mod rosbag;
