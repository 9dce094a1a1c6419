//! The MCAP container (<https://mcap.dev/spec>): records one after the other, messages mostly in compressed chunks.

use super::lz4;
use crate::file::blocks::unreadable;
use crate::file::read::BUFFER;
use ff_model::diagnostics::clip;
use ff_model::{Problem, Problems};
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};

const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Largest chunk, compressed or not (bytes). Recorders write some hundred kB to some MB.
const MAX_CHUNK: u64 = 256 << 20;
/// Largest record outside a chunk that is of interest (bytes).
const MAX_RECORD: u64 = 64 << 20;
/// Most channels and schemas.
const MAX_CHANNELS: usize = 65_536;

/// A topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) id: u16,
    pub(super) topic: String,
    /// How messages are encoded.
    pub(super) encoding: String,
    /// Name of their type.
    pub(super) schema: String,
}

/// A message, borrowed from its chunk.
pub(super) struct Message<'a> {
    pub(super) channel: u16,
    /// ns.
    pub(super) log_time: i64,
    /// Byte of the file where its record or chunk begins.
    pub(super) offset: u64,
    pub(super) data: &'a [u8],
}

/// A file being read from front to back.
pub(super) struct Container {
    file: BufReader<File>,
    len: u64,
    /// Next byte of the file.
    at: u64,
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, Channel>,
    /// Records of the present chunk, and the next byte in it.
    chunk: Vec<u8>,
    next: usize,
    chunk_at: u64,
    raw: Vec<u8>,
}

/// A cursor over the fields of a record; `None` at its end.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, n: usize) -> Option<&'a [u8]> {
        let (out, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(out)
    }
    fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(*self.bytes(2)?.first_chunk()?))
    }
    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(*self.bytes(4)?.first_chunk()?))
    }
    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(*self.bytes(8)?.first_chunk()?))
    }
    fn text(&mut self) -> Option<&'a [u8]> {
        let n = self.u32()? as usize;
        self.bytes(n)
    }
    fn string(&mut self) -> Option<String> {
        Some(String::from_utf8_lossy(self.text()?).into_owned())
    }
}

const DAMAGED: &str = "record the bag again; it may be damaged";

fn damaged(what: impl std::fmt::Display, offset: u64) -> Problems {
    unreadable("Data::Mcap", format!("{what} (record at byte {offset})"), DAMAGED)
}

fn truncated(offset: u64) -> Problems {
    let what = format!("the file ends within the record that begins at byte {offset}");
    let hint = "copy the bag again, or --allow maybe-truncated for the complete chunks before";
    unreadable("Data::MaybeTruncated", what, hint)
}

impl Container {
    pub(super) fn new(file: File) -> Result<Self, Problems> {
        let len = file.metadata().map_or(0, |m| m.len());
        let mut out = Self {
            file: BufReader::with_capacity(BUFFER, file),
            len,
            at: 0,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            chunk: Vec::new(),
            next: 0,
            chunk_at: 0,
            raw: Vec::new(),
        };
        out.rewind()?;
        Ok(out)
    }
    /// Back to the first record.
    pub(super) fn rewind(&mut self) -> Result<(), Problems> {
        self.file.seek(SeekFrom::Start(0)).map_err(|e| io(&e))?;
        let mut magic = [0; 8];
        self.file.read_exact(&mut magic).map_err(|_| truncated(0))?;
        if magic != *MAGIC {
            return Err(damaged("no MCAP file", 0));
        }
        self.at = 8;
        self.chunk.clear();
        self.next = 0;
        Ok(())
    }
    pub(super) fn bytes(&self) -> u64 {
        self.at
    }
    /// The next message; `None` behind the last.
    pub(super) fn next(&mut self) -> Result<Option<Message<'_>>, Problems> {
        let Some((start, end)) = self.advance()? else { return Ok(None) };
        let (offset, content) = (self.chunk_at, &self.chunk[start..end]);
        let (channel, log_time, data) =
            message(content).ok_or_else(|| damaged("a message that is cut short", offset))?;
        Ok(Some(Message { channel, log_time, offset, data }))
    }
    /// What is known of a channel.
    pub(super) fn channel(&self, id: u16) -> Option<&Channel> {
        self.channels.get(&id)
    }
    /// Reads records until a message is at hand: its range in the chunk.
    fn advance(&mut self) -> Result<Option<(usize, usize)>, Problems> {
        loop {
            while self.next < self.chunk.len() {
                let mut f = Fields(&self.chunk[self.next..]);
                let head = (f.bytes(1), f.u64());
                let (Some(op), Some(n)) = head else { return Err(damaged("a chunk that is cut short", self.chunk_at)) };
                let start = self.next + 9;
                let end = usize::try_from(n).ok().and_then(|n| start.checked_add(n)).filter(|e| *e <= self.chunk.len());
                let Some(end) = end else { return Err(damaged("a record longer than its chunk", self.chunk_at)) };
                self.next = end;
                match op[0] {
                    0x05 => return Ok(Some((start, end))),
                    0x03 | 0x04 => {
                        let content = self.chunk[start..end].to_vec();
                        self.describe(op[0], &content)?;
                    }
                    _ => {}
                }
            }
            if !self.record()? {
                return Ok(None);
            }
        }
    }
    /// Reads one record of the file; messages outside chunks become a chunk of one. False at the end.
    fn record(&mut self) -> Result<bool, Problems> {
        let offset = self.at;
        let mut head = [0; 9];
        // A file that was ended properly has its footer and the magic again.
        if self.len.saturating_sub(offset) < 9 {
            return Err(truncated(offset));
        }
        self.file.read_exact(&mut head).map_err(|_| truncated(offset))?;
        let op = head[0];
        let n = head[1..].first_chunk().map_or(0, |b| u64::from_le_bytes(*b));
        if n > self.len - offset - 9 {
            // As a file that is cut, unless no file of this size could hold it.
            let err = if n > 1 << 62 { damaged(format!("a record of {n} bytes"), offset) } else { truncated(offset) };
            return Err(err);
        }
        match op {
            // The footer, or the end of the data: summaries follow, which say nothing new.
            0x02 | 0x0f => return Ok(false),
            0x03..=0x06 => {
                let limit = if op == 0x06 { MAX_CHUNK } else { MAX_RECORD };
                if n > limit {
                    let what = format!("a record of {n} bytes at byte {offset}, limit {limit}");
                    return Err(unreadable("Data::TooLarge", what, "record in smaller chunks"));
                }
                self.raw.resize(n as usize, 0);
                self.file.read_exact(&mut self.raw).map_err(|e| match e.kind() {
                    ErrorKind::UnexpectedEof => truncated(offset),
                    _ => io(&e),
                })?;
                self.at = offset + 9 + n;
                self.chunk_at = offset;
                match op {
                    0x06 => self.unpack(offset)?,
                    0x05 => {
                        self.chunk.clear();
                        self.chunk.extend_from_slice(&head);
                        self.chunk.extend_from_slice(&self.raw);
                        self.next = 0;
                    }
                    _ => {
                        let content = std::mem::take(&mut self.raw);
                        self.describe(op, &content)?;
                        self.raw = content;
                    }
                }
            }
            0 => return Err(damaged("a record without a kind", offset)),
            _ => {
                let skip = i64::try_from(n).map_err(|_| truncated(offset))?;
                self.file.seek_relative(skip).map_err(|e| io(&e))?;
                self.at = offset + 9 + n;
            }
        }
        Ok(true)
    }
    /// A schema or a channel.
    fn describe(&mut self, op: u8, content: &[u8]) -> Result<(), Problems> {
        let mut f = Fields(content);
        let offset = self.chunk_at;
        if self.channels.len() + self.schemas.len() > MAX_CHANNELS {
            return Err(damaged("too many channels", offset));
        }
        let done = if op == 0x03 { self.schema(&mut f) } else { self.topic(&mut f) };
        done.ok_or_else(|| damaged("a schema or channel that is cut short", offset))
    }
    fn schema(&mut self, f: &mut Fields<'_>) -> Option<()> {
        let (id, name) = (f.u16()?, f.string()?);
        self.schemas.insert(id, name);
        Some(())
    }
    fn topic(&mut self, f: &mut Fields<'_>) -> Option<()> {
        let (id, schema, topic, encoding) = (f.u16()?, f.u16()?, f.string()?, f.string()?);
        let schema = self.schemas.get(&schema).cloned().unwrap_or_default();
        self.channels.insert(id, Channel { id, topic, encoding, schema });
        Some(())
    }
    /// Makes the chunk in `raw` the present one.
    fn unpack(&mut self, offset: u64) -> Result<(), Problems> {
        let mut f = Fields(&self.raw);
        let Some((size, crc, compression, packed)) = chunk_head(&mut f) else {
            return Err(damaged("a chunk that is cut short", offset));
        };
        if size > MAX_CHUNK {
            let what = format!("a chunk of {size} bytes at byte {offset}, limit {MAX_CHUNK}");
            return Err(unreadable("Data::TooLarge", what, "record in smaller chunks"));
        }
        let Some(body) = usize::try_from(packed).ok().and_then(|n| f.bytes(n)) else {
            return Err(damaged(format!("a chunk of {packed} bytes in a smaller record"), offset));
        };
        self.next = 0;
        // Memory is taken for what is there, not for what is promised.
        let done = match compression {
            b"" => {
                self.chunk.clear();
                self.chunk.extend_from_slice(body);
                Ok(body.len())
            }
            b"lz4" if size > lz4::most(body) => Err(format!("{} bytes cannot hold {size}", body.len())),
            b"lz4" => {
                // Bytes of the chunk before are overwritten.
                self.chunk.resize(size as usize, 0);
                lz4::unpack(body, &mut self.chunk)
            }
            b"zstd" => {
                self.chunk.clear();
                // One byte more than promised tells too much from enough.
                zstd::stream::read::Decoder::with_buffer(body)
                    .and_then(|d| d.take(size + 1).read_to_end(&mut self.chunk))
                    .map_err(|e| e.to_string())
            }
            other => {
                let name = clip(&String::from_utf8_lossy(other));
                return Err(damaged(format!("a chunk compressed by '{name}'"), offset));
            }
        };
        match done {
            Err(e) => return Err(damaged(format!("a chunk that cannot be unpacked: {}", clip(&e)), offset)),
            Ok(n) if n as u64 != size => {
                return Err(damaged(format!("a chunk of {n} bytes that should have {size}"), offset));
            }
            Ok(_) => {}
        }
        if crc != 0 && crc32fast::hash(&self.chunk) != crc {
            return Err(damaged("a chunk with a wrong checksum", offset));
        }
        Ok(())
    }
}

/// Size when unpacked, checksum, compression and packed size of a chunk, behind the times of its first and last message.
fn chunk_head<'a>(f: &mut Fields<'a>) -> Option<(u64, u32, &'a [u8], u64)> {
    f.bytes(16)?;
    Some((f.u64()?, f.u32()?, f.text()?, f.u64()?))
}

/// Channel, time of recording (ns) and content of a message record.
fn message(content: &[u8]) -> Option<(u16, i64, &[u8])> {
    let mut f = Fields(content);
    let (channel, _, log, _) = (f.u16()?, f.u32()?, f.u64()?, f.u64()?);
    Some((channel, i64::try_from(log).ok()?, f.0))
}

fn io(e: &std::io::Error) -> Problems {
    let p = Problem::error(ff_model::Area::Io, "Io::Read", format!("cannot be read: {e}"));
    Problems(vec![p.hint("check the disk")])
}
