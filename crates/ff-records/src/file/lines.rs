//! Lines of a file, their cells, and the line of names.

use super::{data, over};
use ff_model::{Area, Problem, Problems};
use std::io::{BufRead, Read};

/// Size of the buffer (bytes).
pub(super) const BUFFER: usize = 1 << 20;
/// Longest line (bytes): no record has thousands of channels.
const MAX_LINE: u64 = 1 << 20;

pub(super) fn too_long(bytes: u64, limit: u64) -> Problem {
    over(bytes as f64, limit as f64, "bytes").hint("cut the record, or raise --max-bytes")
}

/// Lines of a file, each in the same buffer.
pub(super) struct Lines<R> {
    input: R,
    /// Most bytes.
    limit: u64,
    pub(super) line: Vec<u8>,
    /// Number of the line in `line`, from 1.
    pub(super) number: usize,
    pub(super) bytes: u64,
    /// Whether the line ended with a newline.
    ended: bool,
}

impl<R: BufRead> Lines<R> {
    /// Lines of a file of no more than so many bytes.
    pub(super) fn new(input: R, limit: u64) -> Self {
        Self { input, limit, line: Vec::new(), number: 0, bytes: 0, ended: true }
    }
    /// Reads the next line, its end removed; false at the end of the file.
    fn next(&mut self) -> Result<bool, Box<Problem>> {
        self.line.clear();
        let n = (&mut self.input).take(MAX_LINE).read_until(b'\n', &mut self.line).map_err(|e| {
            Problem::error(Area::Io, "Io::Read", format!("cannot be read: {e}"))
                .at_line(self.number + 1)
                .hint("check the disk")
        });
        let n = n.map_err(Box::new)?;
        if n == 0 {
            return Ok(false);
        }
        self.number += 1;
        self.bytes += n as u64;
        self.ended = self.line.last() == Some(&b'\n');
        if self.ended {
            self.line.pop();
        } else if n as u64 == MAX_LINE {
            let p = over(n as f64, MAX_LINE as f64 - 1.0, "bytes in a line");
            return Err(Box::new(p.at_line(self.number).hint("is this a CSV file?")));
        }
        if self.bytes > self.limit {
            return Err(Box::new(too_long(self.bytes, self.limit).at_line(self.number)));
        }
        if self.line.last() == Some(&b'\r') {
            self.line.pop();
        }
        Ok(true)
    }
    /// Reads the next line of a sample; false behind the last. Blank lines may only stand at the end.
    pub(super) fn sample(&mut self) -> Result<bool, Box<Problem>> {
        let mut blank = None;
        while self.next()? {
            if !self.line.trim_ascii().is_empty() {
                let between = |line| data("Data::RowLength", "a blank line between samples").at_line(line);
                return blank.map_or(Ok(true), |line| Err(Box::new(between(line).hint("remove it"))));
            }
            blank.get_or_insert(self.number);
        }
        Ok(false)
    }
    /// Row D05, at the end of the file: a last line without its end.
    pub(super) fn cut_short(&self) -> Option<Problem> {
        let what = "the last line does not end: the file may be cut short, and its last number with it";
        let hint = "write the file again, or end the line if it is whole";
        (!self.ended).then(|| data("Data::MaybeTruncated", what).at_line(self.number).hint(hint))
    }
}

/// Cells of a line by the rules of CSV, quotes included.
pub(super) fn cells(line: &[u8]) -> Option<csv::ByteRecord> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(line);
    let mut record = csv::ByteRecord::new();
    reader.read_byte_record(&mut record).ok()?.then_some(record)
}

/// The line of names, behind remarks that begin with `#`; `None` where a problem is recorded.
pub(super) fn header(lines: &mut Lines<impl BufRead>, bad: &mut Problems) -> Option<Vec<String>> {
    loop {
        match lines.next() {
            Err(p) => {
                bad.push(*p);
                return None;
            }
            Ok(more) => {
                if lines.line.starts_with(&[0xef, 0xbb, 0xbf]) {
                    lines.line.drain(..3);
                }
                if !more || lines.line.trim_ascii().is_empty() {
                    let what = if more { "there is no line of column names" } else { "the file is empty" };
                    let p = data("Data::NoSamples", what).at_line(lines.number.max(1));
                    bad.push(p.hint("begin with time[s],q.<joint>[rad],..."));
                    return None;
                }
            }
        }
        let Some(remark) = lines.line.strip_prefix(b"#") else { break };
        // NumPy writes the names themselves behind a '#'.
        let names = remark.trim_ascii_start().to_vec();
        if cells(&names).is_some_and(|c| c.len() > 1 && c.iter().any(|cell| cell.trim_ascii().starts_with(b"time"))) {
            lines.line = names;
            break;
        }
    }
    let at = lines.number;
    if let Err(e) = core::str::from_utf8(&lines.line) {
        let what = format!("byte {} is not UTF-8", e.valid_up_to());
        bad.push(data("Data::NotUtf8", what).at(at, e.valid_up_to() + 1).hint("save the file as UTF-8"));
        return None;
    }
    let Some(record) = cells(&lines.line) else {
        bad.push(data("Data::Syntax", "the line of names is not CSV").at_line(at).hint("mend its quotes"));
        return None;
    };
    let names: Vec<String> = record.iter().map(|c| String::from_utf8_lossy(c).trim().to_owned()).collect();
    if names.len() == 1 {
        let guess = [(';', "semicolons"), ('\t', "tabs"), ('|', "bars"), (' ', "blanks")];
        let what = match guess.into_iter().find(|(c, _)| names[0].contains(*c)) {
            Some((_, name)) => format!("columns seem to be separated by {name}, must be commas"),
            None => "there is only one column".to_owned(),
        };
        let hint = "separate columns by commas, and write numbers with a decimal point";
        bad.push(data("Data::Separator", what).at_line(at).hint(hint));
        return None;
    }
    Some(names)
}
