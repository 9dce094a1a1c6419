//! Text of a file as UTF-8, whatever it is encoded in.

use ff_model::{Area, Problem};
use std::fs::File;
use std::io;
use std::io::{Read, Seek, SeekFrom};

/// Bytes decoded at a time.
const CHUNK: usize = 1 << 16;
/// What takes the place of what is no character.
const UNKNOWN: char = char::REPLACEMENT_CHARACTER;

/// A text file, whose UTF-16 is decoded: with a mark in front, or of letters of two bytes each.
pub(super) struct Text {
    file: File,
    /// Whether the low byte of a letter comes first; `None` of UTF-8.
    little: Option<bool>,
    /// What was read and not decoded: the first half of a letter, or of a pair of them.
    rest: Vec<u8>,
    decoded: Vec<u8>,
    given: usize,
}

/// Whether the first bytes of a file are those of UTF-16, and its low bytes first.
pub(super) fn little_end_first(first: &[u8]) -> Option<bool> {
    match first {
        [0xff, 0xfe, ..] => Some(true),
        [0xfe, 0xff, ..] => Some(false),
        // Letters of two bytes without a mark in front.
        _ => {
            let zero =
                |k: usize| first.len() >= 8 && first.chunks_exact(2).take(4).all(|c| (c[k] == 0) && (c[1 - k] != 0));
            zero(1).then_some(true).or(zero(0).then_some(false))
        }
    }
}

impl Text {
    /// A file at its start; one that cannot go back, such as a pipe, is taken as UTF-8.
    pub(super) fn new(mut file: File) -> Self {
        let little = first_bytes(&mut file).ok().and_then(|first| little_end_first(&first));
        Self { file, little, rest: Vec::new(), decoded: Vec::new(), given: 0 }
    }
    /// What is said of text that is decoded.
    pub(super) fn note(&self) -> Option<Problem> {
        let end = if self.little? { "low" } else { "high" };
        let what = format!("text in UTF-16, the {end} byte first, was decoded");
        Some(Problem::warning(Area::Data, "Data::Encoding", what).hint("nothing to do"))
    }
    /// Decodes the next bytes; false at the end.
    fn decode(&mut self, little: bool) -> io::Result<bool> {
        let mut bytes = std::mem::take(&mut self.rest);
        let n = (&self.file).take(CHUNK as u64).read_to_end(&mut bytes)?;
        let whole = bytes.len() & !1;
        let mut units: Vec<u16> = bytes[..whole]
            .chunks_exact(2)
            .map(|c| if little { u16::from_le_bytes([c[0], c[1]]) } else { u16::from_be_bytes([c[0], c[1]]) })
            .collect();
        let mut from = whole;
        // The first half of a pair waits for the other.
        if n > 0 && units.last().is_some_and(|u| (0xd800..0xdc00).contains(u)) {
            units.pop();
            from -= 2;
        }
        self.rest = if n > 0 { bytes[from..].to_vec() } else { Vec::new() };
        (self.decoded, self.given) = (Vec::with_capacity(units.len()), 0);
        let letters = char::decode_utf16(units).map(|c| c.unwrap_or(UNKNOWN));
        self.decoded.extend(letters.collect::<String>().into_bytes());
        Ok(n > 0 || !self.decoded.is_empty())
    }
}

/// The first bytes of a file that can go back to its start.
fn first_bytes(file: &mut File) -> io::Result<Vec<u8>> {
    let mut first = Vec::with_capacity(16);
    if file.metadata()?.is_file() {
        (&*file).take(16).read_to_end(&mut first)?;
        file.seek(SeekFrom::Start(0))?;
    }
    Ok(first)
}

impl Read for Text {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let Some(little) = self.little else { return self.file.read(out) };
        while self.given == self.decoded.len() {
            if !self.decode(little)? {
                return Ok(0);
            }
        }
        let n = out.len().min(self.decoded.len() - self.given);
        out[..n].copy_from_slice(&self.decoded[self.given..self.given + n]);
        self.given += n;
        Ok(n)
    }
}
