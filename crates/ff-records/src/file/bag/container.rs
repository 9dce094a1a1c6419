//! What the two containers of ROS messages have in common: topics, messages one after the other, and what is said of a damaged file.

use crate::file::blocks::unreadable;
use ff_model::{Problem, Problems};
use std::borrow::Cow;

/// Largest record and largest chunk, compressed or not (bytes). Recorders write some hundred kB to some MB.
pub(crate) const LIMIT: usize = 256 << 20;
/// Most topics and types.
pub(crate) const MAX_CHANNELS: usize = 65_536;

/// A topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Channel {
    pub(crate) id: u32,
    pub(crate) topic: String,
    /// How messages are encoded: `cdr` of ROS 2, `ros1`.
    pub(crate) encoding: String,
    /// Name of their type.
    pub(crate) schema: String,
    /// Definition of their type, where messages are read by it.
    pub(crate) definition: String,
}

/// A message.
pub(crate) struct Message<'a> {
    pub(crate) channel: u32,
    /// Time of recording (ns).
    pub(crate) log_time: i64,
    /// Byte of the file before which it stands: the end of its record or chunk.
    pub(crate) before: u64,
    pub(crate) data: Cow<'a, [u8]>,
}

/// A bag being read from front to back.
pub(crate) trait Container {
    /// The next message; `None` behind the last.
    ///
    /// # Errors
    /// `Data::MaybeTruncated`, what is damaged, `Data::TooLarge`, `Io::Read`.
    fn next(&mut self) -> Result<Option<Message<'_>>, Problems>;
    /// Back to the first message.
    ///
    /// # Errors
    /// `Io::Read`.
    fn rewind(&mut self) -> Result<(), Problems>;
    /// What is known of a topic.
    fn channel(&self, id: u32) -> Option<&Channel>;
    /// Bytes read so far.
    fn bytes(&self) -> u64;
    /// Code of what is damaged.
    fn code(&self) -> &'static str;
}

/// What to do about a bag that is damaged.
pub(crate) const DAMAGED: &str = "record the bag again; it may be damaged";

/// A file that ends too early.
pub(crate) fn truncated(len: u64) -> Problems {
    let what = format!("the file ends at byte {len}, within a record");
    let hint = "copy the bag again: no complete chunk with joint states stands before";
    unreadable("Data::MaybeTruncated", what, hint)
}

/// A record or chunk that is not taken into memory.
pub(crate) fn too_large(what: &str, n: u64, before: u64) -> Problems {
    let what = format!("{what} of {n} bytes before byte {before}, limit {LIMIT}");
    unreadable("Data::TooLarge", what, "record in smaller chunks")
}

pub(crate) fn io(e: &std::io::Error) -> Problems {
    let p = Problem::error(ff_model::Area::Io, "Io::Read", format!("cannot be read: {e}"));
    Problems(vec![p.hint("check the disk")])
}
