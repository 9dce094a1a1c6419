//! Records in files: one `name[unit]` column per channel, one row per sample; as CSV, and with features `parquet`, `mcap` and `rosbag` as
//! Parquet, as ROS 2 bags, and as ROS 1 bags.
//!
//! ```text
//! time[s],q.joint1[rad],dq.joint1[rad/s],tau.joint1[N m],gyro.x[rad/s],gyro.y[rad/s],gyro.z[rad/s]
//! 0,0.25,0,1.5,0,0,0
//! 0.01,0.25001,0.002,1.4,-1e-4,2e-4,0
//! ```
//!
//! | columns | meaning | |
//! |---|---|---|
//! | `time` | time stamp | required |
//! | `q.<joint>` | position after the gear | required for every joint |
//! | `dq.<joint>`, `ddq.<joint>` | rate and acceleration (`qd.`, `qdd.` as well) | for every joint or for none |
//! | `tau.<joint>` | torque (or force) after the gear, on the joint | required for every joint |
//! | `gyro.x`, `.y`, `.z` | base angular velocity in base axes | required, unless the base is fixed |
//! | `acc.x`, `.y`, `.z` | specific force in base axes | optional |
//! | `att.w`, `.x`, `.y`, `.z` | attitude quaternion, body to world, scalar first | optional |
//!
//! Columns come in any order. The time may be dates, year first ([ISO 8601](https://www.iso.org/iso-8601-date-and-time-format.html)), or day and month first where the file says which. Columns under names of other programs (`q1`, `/joint_states/effort[2]`, `wx`) are taken where they say one thing, with a warning. Units are converted because the header names them ([`units`]); a column without one is
//! refused. The file is read in one pass through a buffer of fixed size, with limits on rows and bytes; what is kept is
//! the samples. [`CsvWriter`] writes every number in its shortest exact form, so that a file is read back bit for bit.
//!
//! Rows `D..` are those of `bad-inputs.md`.
pub(crate) mod aliases;
#[cfg(any(feature = "mcap", feature = "rosbag"))]
pub(crate) mod bag;
pub(crate) mod blocks;
pub(crate) mod columns;
pub(crate) mod csv_blocks;
pub(crate) mod dates;
pub(crate) mod heading;
pub(crate) mod held;
pub(crate) mod joined;
pub(crate) mod lines;
pub(crate) mod merged;
pub(crate) mod naming;
pub(crate) mod number;
pub(crate) mod options;
pub(crate) mod order;
#[cfg(feature = "parquet")]
pub(crate) mod parquet_in;
#[cfg(feature = "parquet")]
pub(crate) mod parquet_out;
#[cfg(feature = "parquet")]
pub(crate) mod parquet_values;
pub(crate) mod phrases;
pub(crate) mod read;
pub(crate) mod samples;
pub(crate) mod source;
pub(crate) mod table;
pub mod units;
pub(crate) mod wide;
pub(crate) mod write;

pub use blocks::{BLOCK, Block, Blocks, Stamps};
pub use columns::without_name;
pub use merged::open_together;
pub use naming::{ignores, is_nameless};
pub use options::{DateOrder, Loaded, ReadOptions, StampSource};
#[cfg(feature = "parquet")]
pub use parquet_in::read_table;
#[cfg(feature = "parquet")]
pub use parquet_out::{ParquetWriter, TableColumn, write_table};
pub use read::{read, read_from};
pub use source::{Format, open};
pub use table::read_columns;
pub use write::{CsvRows, CsvWriter};

use ff_model::diagnostics::Limit;
use ff_model::{Area, JointKind, Model, Problem};

/// A joint as a record names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointColumn {
    /// Name in the URDF.
    pub name: String,
    /// True for a joint that slides: its position is in metres, its torque a force.
    pub slides: bool,
}

/// A joint that follows another at a ratio: what a log says of it follows from the other one.
#[derive(Clone, Debug, PartialEq)]
pub struct FollowerColumn {
    /// Name in the URDF.
    pub name: String,
    /// True for a joint that slides.
    pub slides: bool,
    /// The joint that it follows, by its index among those of the record.
    pub joint: usize,
    /// Motion per motion of that joint (1, rad/m, m/rad).
    pub multiplier: f64,
    /// Position where that joint is at zero (rad or m).
    pub offset: f64,
}

/// The joints of a model that follow others. Allocates.
pub fn followers_of(model: &Model) -> Vec<FollowerColumn> {
    let one = |(b, c): (&ff_model::Body, ff_model::tree::JointCoordinate)| FollowerColumn {
        name: b.joint.name.clone(),
        slides: b.joint.kind == JointKind::Prismatic,
        joint: c.index,
        multiplier: c.multiplier,
        offset: c.offset,
    };
    model.followers().map(one).collect()
}

/// The joints of a model that move by themselves, in its order. Allocates.
pub fn joints_of(model: &Model) -> Vec<JointColumn> {
    let one =
        |b: &ff_model::Body| JointColumn { name: b.joint.name.clone(), slides: b.joint.kind == JointKind::Prismatic };
    model.own_bodies().map(one).collect()
}

fn data(code: &'static str, message: impl Into<String>) -> Problem {
    Problem::error(Area::Data, code, message)
}

/// Row D34: more of something than its limit.
fn over(value: f64, limit: f64, unit: &'static str) -> Problem {
    Problem::out_of_range(Area::Data, "Data::TooLarge", value, Limit::AtMost(limit), unit)
}

/// Name and unit of a column `name[unit]`.
pub fn name_and_unit(cell: &str) -> (&str, Option<&str>) {
    naming::split(cell)
}
