//! The container of ROS 1 bags, version 2.0 (<http://wiki.ros.org/Bags/Format/2.0>): records of a header and data; messages and the
//! topics they belong to mostly in chunks, plain or compressed by lz4 or bz2.
//!
//! A bag is read from front to back without its index, so that one whose recorder was killed (`.bag.active`) is read as well. No
//! length is believed that the file does not back.

use super::container::{Channel, Container, LIMIT, MAX_CHANNELS, Message, io, too_large, truncated};
use super::definition::stamp;
use crate::file::blocks::unreadable;
use crate::file::lines::BUFFER;
use ff_model::Problems;
use ff_model::diagnostics::clip;
use std::borrow::Cow;
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};

/// The first line of a bag.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// Longest header of a record (bytes).
const HEADER: usize = 1 << 20;

/// Kinds of records.
mod op {
    pub(super) const MESSAGE: u8 = 2;
    pub(super) const BAG: u8 = 3;
    pub(super) const INDEX: u8 = 4;
    pub(super) const CHUNK: u8 = 5;
    pub(super) const CHUNK_INFO: u8 = 6;
    pub(super) const CONNECTION: u8 = 7;
}

/// A file being read from front to back.
pub(crate) struct Rosbag {
    file: BufReader<File>,
    len: u64,
    at: u64,
    channels: HashMap<u32, Channel>,
    /// The chunk at hand, unpacked, and what of it has been read.
    chunk: Vec<u8>,
    read: usize,
    /// Data of the record at hand, outside of chunks or as it is packed.
    data: Vec<u8>,
}

/// A message that was found: its topic, time, and data.
struct Found {
    channel: u32,
    log_time: i64,
    /// Where in the chunk; none for one outside of chunks.
    place: Option<(usize, usize)>,
}

fn damaged(what: impl std::fmt::Display, before: u64) -> Problems {
    let hint = "run rosbag reindex on the bag, or record it again; it may be damaged";
    unreadable("Data::Rosbag", format!("{what} (before byte {before})"), hint)
}

/// The fields of a header; `None` where a length does not fit.
struct Header<'a>(&'a [u8]);

impl<'a> Header<'a> {
    fn field(&self, name: &str) -> Option<&'a [u8]> {
        let mut rest = self.0;
        while let Some((n, more)) = rest.split_first_chunk::<4>() {
            let (field, more) = more.split_at_checked(u32::from_le_bytes(*n) as usize)?;
            rest = more;
            let equals = field.iter().position(|b| *b == b'=')?;
            if &field[..equals] == name.as_bytes() {
                return Some(&field[equals + 1..]);
            }
        }
        None
    }
    fn u32(&self, name: &str) -> Option<u32> {
        Some(u32::from_le_bytes(self.field(name)?.try_into().ok()?))
    }
    fn op(&self) -> Option<u8> {
        match self.field("op")? {
            [op] => Some(*op),
            _ => None,
        }
    }
    /// Seconds and nanoseconds (ns).
    fn time(&self, name: &str) -> Option<i64> {
        let b: [u8; 8] = self.field(name)?.try_into().ok()?;
        Some(stamp(b))
    }
    fn text(&self, name: &str) -> Option<String> {
        self.field(name).map(|b| String::from_utf8_lossy(b).into_owned())
    }
}

impl Rosbag {
    pub(crate) fn new(file: File) -> Result<Self, Problems> {
        let len = file.metadata().map_or(0, |m| m.len());
        let mut bag = Self {
            file: BufReader::with_capacity(BUFFER, file),
            len,
            at: 0,
            channels: HashMap::new(),
            chunk: Vec::new(),
            read: 0,
            data: Vec::new(),
        };
        bag.rewind()?;
        Ok(bag)
    }
    /// Reads `n` bytes that the file has.
    fn take(&mut self, n: usize) -> Result<(), Problems> {
        if n as u64 > self.len.saturating_sub(self.at) {
            return Err(truncated(self.len));
        }
        self.data.resize(n, 0);
        self.file.read_exact(&mut self.data).map_err(|e| match e.kind() {
            ErrorKind::UnexpectedEof => truncated(self.len),
            _ => io(&e),
        })?;
        self.at += n as u64;
        Ok(())
    }
    /// Reads a length, which is `limit` at most.
    fn length(&mut self, what: &str, limit: usize) -> Result<usize, Problems> {
        self.take(4)?;
        let n = self.data.first_chunk().map_or(0, |b| u32::from_le_bytes(*b)) as usize;
        if n as u64 > self.len.saturating_sub(self.at) {
            return Err(truncated(self.len));
        }
        if n > limit { Err(too_large(what, n as u64, self.at)) } else { Ok(n) }
    }
    /// The next record outside of chunks, or the next chunk unpacked; `Some` for a message, `None` at the end.
    fn outside(&mut self) -> Result<Option<Option<Found>>, Problems> {
        if self.at >= self.len {
            return Ok(None);
        }
        let n = self.length("the header of a record", HEADER)?;
        self.take(n)?;
        let head = std::mem::take(&mut self.data);
        let h = Header(&head);
        let Some(kind) = h.op() else { return Err(damaged("a record without a kind", self.at)) };
        match kind {
            op::BAG | op::INDEX | op::CHUNK_INFO => {
                let n = self.length("a record", usize::MAX)?;
                let end = self.at + n as u64;
                self.file.seek(SeekFrom::Start(end)).map_err(|e| io(&e))?;
                self.at = end;
            }
            op::CHUNK => {
                let n = self.length("a chunk", LIMIT)?;
                self.take(n)?;
                let size = h.u32("size").unwrap_or(0) as usize;
                let packing = h.text("compression").unwrap_or_default();
                self.unpack(&packing, size)?;
            }
            op::MESSAGE => {
                let n = self.length("a message", LIMIT)?;
                self.take(n)?;
                let (Some(channel), Some(log_time)) = (h.u32("conn"), h.time("time")) else {
                    return Err(damaged("a message without topic or time", self.at));
                };
                return Ok(Some(Some(Found { channel, log_time, place: None })));
            }
            op::CONNECTION => {
                let n = self.length("a description of a topic", LIMIT)?;
                self.take(n)?;
                let data = std::mem::take(&mut self.data);
                self.describe(&h, &data)?;
            }
            k => return Err(damaged(format!("a record of the unknown kind {k}"), self.at)),
        }
        Ok(Some(None))
    }
    /// Unpacks the data at hand into the chunk.
    fn unpack(&mut self, packing: &str, size: usize) -> Result<(), Problems> {
        (self.read, self.chunk) = (0, std::mem::take(&mut self.chunk));
        self.chunk.clear();
        if size > LIMIT {
            return Err(too_large("a chunk", size as u64, self.at));
        }
        let mut into = |from: &mut dyn Read| {
            // One byte more than there should be, so that a chunk that goes on is found.
            from.take(size as u64 + 1).read_to_end(&mut self.chunk)
        };
        let got = match packing {
            "none" => {
                std::mem::swap(&mut self.chunk, &mut self.data);
                return Ok(());
            }
            "lz4" => lz4::Decoder::new(&self.data[..]).and_then(|mut d| into(&mut d)),
            "bz2" => into(&mut bzip2::read::BzDecoder::new(&self.data[..])),
            other => {
                let what = format!("a chunk compressed by '{}'", clip(other));
                return Err(damaged(what, self.at));
            }
        };
        match got {
            Ok(n) if n == size => Ok(()),
            Ok(n) => Err(damaged(format!("a chunk of {n} bytes that should have {size}"), self.at)),
            Err(e) => Err(damaged(format!("a chunk that cannot be unpacked: {}", clip(&e.to_string())), self.at)),
        }
    }
    /// The next record of the chunk; `Some` for a message.
    fn inside(&mut self) -> Result<Option<Found>, Problems> {
        let short = || damaged("a record that its chunk cuts short", self.at);
        let part = |from: usize| {
            let n = self.chunk.get(from..)?.first_chunk::<4>()?;
            let end = (from + 4).checked_add(u32::from_le_bytes(*n) as usize)?;
            (end <= self.chunk.len()).then_some((from + 4, end))
        };
        let (a, b) = part(self.read).ok_or_else(short)?;
        let (c, d) = part(b).ok_or_else(short)?;
        let h = Header(&self.chunk[a..b]);
        let kind = h.op().ok_or_else(|| damaged("a record without a kind", self.at))?;
        let found = match kind {
            op::MESSAGE => {
                let topic = h.u32("conn").zip(h.time("time"));
                let (channel, log_time) = topic.ok_or_else(|| damaged("a message without topic or time", self.at))?;
                Some(Found { channel, log_time, place: Some((c, d)) })
            }
            op::CONNECTION => {
                let chunk = std::mem::take(&mut self.chunk);
                self.describe(&Header(&chunk[a..b]), &chunk[c..d])?;
                self.chunk = chunk;
                None
            }
            _ => None,
        };
        self.read = d;
        Ok(found)
    }
    /// Takes in a topic.
    fn describe(&mut self, h: &Header<'_>, data: &[u8]) -> Result<(), Problems> {
        if self.channels.len() >= MAX_CHANNELS {
            return Err(damaged("too many topics", self.at));
        }
        let of = Header(data);
        let known = (h.u32("conn"), h.text("topic"), of.text("type"), of.text("message_definition"));
        let (Some(id), Some(topic), Some(schema), Some(definition)) = known else {
            return Err(damaged("a topic without number, name, type or definition", self.at));
        };
        let encoding = "ros1".to_owned();
        self.channels.insert(id, Channel { id, topic, encoding, schema, definition });
        Ok(())
    }
}

impl Container for Rosbag {
    fn next(&mut self) -> Result<Option<Message<'_>>, Problems> {
        let found = loop {
            let found = if self.read < self.chunk.len() {
                self.inside()?
            } else {
                match self.outside()? {
                    None => return Ok(None),
                    Some(found) => found,
                }
            };
            if let Some(found) = found {
                break found;
            }
        };
        let data = match found.place {
            Some((from, to)) => &self.chunk[from..to],
            None => &self.data[..],
        };
        let Found { channel, log_time, .. } = found;
        Ok(Some(Message { channel, log_time, before: self.at, data: Cow::Borrowed(data) }))
    }
    fn rewind(&mut self) -> Result<(), Problems> {
        self.file.seek(SeekFrom::Start(0)).map_err(|e| io(&e))?;
        (self.at, self.read) = (0, 0);
        self.chunk.clear();
        self.take(MAGIC.len())?;
        if self.data == MAGIC { Ok(()) } else { Err(damaged("no bag of version 2.0", self.at)) }
    }
    fn channel(&self, id: u32) -> Option<&Channel> {
        self.channels.get(&id)
    }
    fn bytes(&self) -> u64 {
        self.at
    }
    fn code(&self) -> &'static str {
        "Data::Rosbag"
    }
}
