//! The MCAP container (<https://mcap.dev/spec>): records one after the other, messages mostly in compressed chunks.
//!
//! The `mcap` crate knows the format. Its linear reader asks for bytes and gives records, a chunk at a time, each chunk after its
//! checksum. Here stands what the crate leaves to its caller: no more bytes are given than the file has, records that are of no
//! interest and too large to hold are skipped, and a panic on a damaged file becomes an error.

use super::container::{Channel, Container, DAMAGED, LIMIT, MAX_CHANNELS, Message, io, too_large, truncated};
use crate::file::blocks::unreadable;
use crate::file::lines::BUFFER;
use ff_model::Problems;
use ff_model::diagnostics::clip;
use mcap::McapError;
use mcap::records::{MessageHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A file being read from front to back.
pub(crate) struct Mcap {
    file: BufReader<File>,
    len: u64,
    /// Bytes of the file that the reader was given.
    at: u64,
    reader: LinearReader,
    schemas: HashMap<u16, (String, String)>,
    channels: HashMap<u32, Channel>,
    /// Content of the record at hand.
    record: Vec<u8>,
}

fn damaged(what: impl std::fmt::Display, before: u64) -> Problems {
    unreadable("Data::Mcap", format!("{what} (before byte {before})"), DAMAGED)
}

fn reader(options: LinearReaderOptions) -> LinearReader {
    // What follows the data says nothing new.
    let options = options.with_skip_end_magic(true).with_prevalidate_chunk_crcs(true).with_record_length_limit(LIMIT);
    LinearReader::new_with_options(options)
}

/// Zeros at the end of a file that tell that power was cut: a file system leaves them where nothing was written, and a complete file ends in
/// its mark.
const ZEROS: u64 = 64;

impl Mcap {
    pub(crate) fn new(file: File) -> Result<Self, Problems> {
        let len = file.metadata().map_or(0, |m| m.len());
        if len < mcap::MAGIC.len() as u64 {
            return Err(truncated(len));
        }
        Ok(Self {
            file: BufReader::with_capacity(BUFFER, file),
            len,
            at: 0,
            reader: reader(LinearReaderOptions::default()),
            schemas: HashMap::new(),
            channels: HashMap::new(),
            record: Vec::new(),
        })
    }
    /// Reads up to the next schema, channel or message, and gives its kind; `None` at the end of the data.
    fn advance(&mut self) -> Result<Option<u8>, Problems> {
        loop {
            let reader = &mut self.reader;
            let next = move || {
                let reader = reader;
                reader.next_event()
            };
            let event = catch_unwind(AssertUnwindSafe(next));
            match event.map_err(|_| damaged("the reader gave up on this file", self.at))? {
                None => return Ok(None),
                Some(Ok(LinearReadEvent::ReadRequest(n))) => self.feed(n)?,
                Some(Ok(LinearReadEvent::Record { opcode, data })) => match opcode {
                    op::DATA_END | op::FOOTER => return Ok(None),
                    op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                        self.record.clear();
                        self.record.extend_from_slice(data);
                        return Ok(Some(opcode));
                    }
                    0 => {
                        let p = damaged("a record without a kind", self.at);
                        return Err(if self.ends_in_zeros() { truncated(self.len) } else { p });
                    }
                    _ => {}
                },
                // Its head has been read.
                Some(Err(McapError::RecordTooLarge { opcode: op::ATTACHMENT | op::METADATA, len })) => {
                    self.skip(len)?
                }
                Some(Err(e)) => {
                    let p = self.refused(&e);
                    return Err(if self.ends_in_zeros() { truncated(self.len) } else { p });
                }
            }
        }
    }
    /// Gives the reader the bytes it asks for.
    fn feed(&mut self, n: usize) -> Result<(), Problems> {
        if n as u64 > self.len.saturating_sub(self.at) {
            return Err(truncated(self.len));
        }
        self.file.read_exact(self.reader.insert(n)).map_err(|e| match e.kind() {
            ErrorKind::UnexpectedEof => truncated(self.len),
            _ => io(&e),
        })?;
        self.reader.notify_read(n);
        self.at += n as u64;
        Ok(())
    }
    /// Whether the file ends in zeros, of which nothing is left to read then.
    fn ends_in_zeros(&mut self) -> bool {
        let mut end = Vec::new();
        let from = self.len.saturating_sub(ZEROS);
        let read =
            self.file.seek(SeekFrom::Start(from)).and_then(|_| self.file.by_ref().take(ZEROS).read_to_end(&mut end));
        read.is_ok() && end.len() as u64 == ZEROS && end.iter().all(|b| *b == 0)
    }
    /// Leaves out the content of a record.
    fn skip(&mut self, n: u64) -> Result<(), Problems> {
        let end = self.at.checked_add(n).filter(|end| *end <= self.len).ok_or_else(|| truncated(self.len))?;
        self.file.seek(SeekFrom::Start(end)).map_err(|e| io(&e))?;
        self.at = end;
        self.reader = reader(LinearReaderOptions::default().with_skip_start_magic(true));
        Ok(())
    }
    /// Takes in the schema or channel at hand.
    fn describe(&mut self, kind: u8) -> Result<(), Problems> {
        if self.channels.len() + self.schemas.len() > MAX_CHANNELS {
            return Err(damaged("too many channels", self.at));
        }
        match mcap::parse_record(kind, &self.record) {
            Ok(Record::Schema { header, data }) => {
                let definition = String::from_utf8_lossy(&data).into_owned();
                self.schemas.insert(header.id, (header.name, definition));
            }
            Ok(Record::Channel(c)) => {
                let (schema, definition) = self.schemas.get(&c.schema_id).cloned().unwrap_or_default();
                let id = u32::from(c.id);
                let channel = Channel { id, topic: c.topic, encoding: c.message_encoding, schema, definition };
                self.channels.insert(id, channel);
            }
            _ => return Err(damaged("a schema or channel that is cut short", self.at)),
        }
        Ok(())
    }
    /// What the reader refused, in the terms of the user.
    fn refused(&self, e: &McapError) -> Problems {
        let too_large = |what: &str, n: u64| too_large(what, n, self.at);
        match e {
            McapError::BadMagic => damaged("no MCAP file", self.at),
            McapError::RecordTooLarge { len, .. } => too_large("a record", *len),
            McapError::ChunkTooLarge(n) => too_large("a chunk", *n),
            McapError::UnexpectedEof => truncated(self.len),
            McapError::UnexpectedEoc => damaged("a chunk that is cut short", self.at),
            McapError::BadChunkCrc { .. } => damaged("a chunk with a wrong checksum", self.at),
            McapError::UnsupportedCompression(name) => {
                damaged(format!("a chunk compressed by '{}'", clip(name)), self.at)
            }
            e => damaged(clip(&e.to_string().replace('\n', " ")), self.at),
        }
    }
}

impl Container for Mcap {
    fn next(&mut self) -> Result<Option<Message<'_>>, Problems> {
        loop {
            match self.advance()? {
                None => return Ok(None),
                Some(op::MESSAGE) => break,
                Some(kind) => self.describe(kind)?,
            }
        }
        let before = self.at;
        match mcap::parse_record(op::MESSAGE, &self.record) {
            Ok(Record::Message { header: MessageHeader { channel_id, log_time, .. }, data }) => {
                let log_time =
                    i64::try_from(log_time).map_err(|_| damaged("a message with a time out of range", before))?;
                Ok(Some(Message { channel: u32::from(channel_id), log_time, before, data }))
            }
            _ => Err(damaged("a message that is cut short", before)),
        }
    }
    fn rewind(&mut self) -> Result<(), Problems> {
        self.file.seek(SeekFrom::Start(0)).map_err(|e| io(&e))?;
        self.at = 0;
        self.reader = reader(LinearReaderOptions::default());
        Ok(())
    }
    fn channel(&self, id: u32) -> Option<&Channel> {
        self.channels.get(&id)
    }
    fn bytes(&self) -> u64 {
        self.at
    }
    fn code(&self) -> &'static str {
        "Data::Mcap"
    }
}
