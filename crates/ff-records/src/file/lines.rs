//! Lines of a file, their cells, and the line of names.

use super::heading::{Heading, rename, take_units, tell_time};
use super::joined::Joined;
use super::{ReadOptions, data, over};
use ff_model::{Area, Problem, Problems};
use std::io::{BufRead, Read};

/// Size of the buffer (bytes).
pub(super) const BUFFER: usize = 1 << 20;
/// Longest line (bytes): no record has thousands of channels.
const MAX_LINE: u64 = 1 << 20;

/// What remarks of other programs begin with, before the names; `%time` is a name.
const REMARKS: [&[u8]; 3] = [b"//", b"% ", b"%%"];

pub(super) fn too_long(bytes: u64, limit: u64) -> Problem {
    over(bytes as f64, limit as f64, "bytes").hint("cut the record, or raise --max-bytes")
}

/// Lines of a file, each in the same buffer.
pub(super) struct Lines<R> {
    input: R,
    /// Most bytes.
    limit: u64,
    /// What separates cells in the file; in `line` commas do.
    separator: u8,
    /// What ends a line: a carriage return where the file has no newline.
    end: u8,
    /// Two columns that are the time, and are one in `line`.
    joined: Option<Joined>,
    /// The line in `line` has not been taken yet.
    held: bool,
    pub(super) line: Vec<u8>,
    /// Number of the line in `line`, from 1.
    pub(super) number: usize,
    pub(super) bytes: u64,
    /// Whether the line ended with a newline.
    ended: bool,
}

impl<R: BufRead> Lines<R> {
    /// Lines of a file, of no more bytes than the options allow.
    pub(super) fn new(mut input: R, options: &ReadOptions) -> Self {
        let (limit, separator) = (options.max_bytes, options.separator);
        // What cannot be read is said with the first line.
        let first = input.fill_buf().unwrap_or_default();
        let end = if first.contains(&b'\r') && !first.contains(&b'\n') { b'\r' } else { b'\n' };
        let (line, number, bytes) = (Vec::new(), 0, 0);
        Self { input, limit, separator, end, joined: None, held: false, line, number, bytes, ended: true }
    }
    /// Reads the next line, its end removed; false at the end of the file.
    fn next(&mut self) -> Result<bool, Box<Problem>> {
        self.line.clear();
        let n = (&mut self.input).take(MAX_LINE).read_until(self.end, &mut self.line).map_err(|e| {
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
        self.ended = self.line.last() == Some(&self.end);
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
        if self.separator != b',' {
            to_commas(&mut self.line, self.separator);
        }
        Ok(true)
    }
    /// Reads the next line of a sample; false behind the last. Blank lines may only stand at the end; remarks, which begin with `#`, are no
    /// samples.
    pub(super) fn sample(&mut self) -> Result<bool, Box<Problem>> {
        if std::mem::take(&mut self.held) {
            return Ok(true);
        }
        let mut blank = None;
        while self.next()? {
            if self.line.first() == Some(&b'#') {
                continue;
            }
            if !self.line.trim_ascii().is_empty() {
                if let Some(joined) = self.joined {
                    joined.join(&mut self.line);
                }
                let between = |line| data("Data::RowLength", "a blank line between samples").at_line(line);
                return blank.map_or(Ok(true), |line| Err(Box::new(between(line).hint("remove it"))));
            }
            blank.get_or_insert(self.number);
        }
        Ok(false)
    }
    /// Cells of the first sample, which [`Lines::sample`] gives again; `None` where there is none, or no line that can be read.
    fn first(&mut self) -> Option<Vec<Vec<u8>>> {
        self.held = self.sample().ok()?;
        let all = cells(&self.line).filter(|_| self.held)?;
        Some(all.iter().map(<[u8]>::to_vec).collect())
    }
    /// Takes two columns as the time, in the line that is held too.
    fn join(&mut self, joined: Joined) {
        self.joined = Some(joined);
        if self.held {
            joined.join(&mut self.line);
        }
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

/// Puts commas where another separator stands outside quotes, and points where commas stand. Blanks count as one, and not within the brackets of a unit.
fn to_commas(line: &mut Vec<u8>, separator: u8) {
    if separator == b' ' {
        let text = std::mem::take(line);
        let text = text.trim_ascii();
        let remark = text.iter().take_while(|b| **b == b'#').count();
        line.extend_from_slice(&text[..remark]);
        let (mut quoted, mut unit, mut last) = (false, false, b' ');
        for &b in text[remark..].trim_ascii_start() {
            quoted ^= b == b'"';
            unit = (unit || b == b'[') && b != b']';
            let blank = matches!(b, b' ' | b'\t') && !quoted && !unit;
            match b {
                _ if blank && last == b' ' => {}
                _ if blank => line.push(b','),
                b',' => line.push(b'.'),
                _ => line.push(b),
            }
            last = if blank { b' ' } else { b };
        }
        return;
    }
    let mut quoted = false;
    for b in line {
        match *b {
            b'"' => quoted = !quoted,
            b',' => *b = b'.',
            s if s == separator && !quoted => *b = b',',
            _ => {}
        }
    }
}

/// The line of names, behind remarks that begin with `#`; `None` where a problem is recorded. Names are those that the options say, and the column of the time
/// has its own where it can be told.
pub(super) fn header(lines: &mut Lines<impl BufRead>, options: &ReadOptions, bad: &mut Problems) -> Option<Heading> {
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
                if !more {
                    let p =
                        data("Data::NoSamples", "the file has no line of column names").at_line(lines.number.max(1));
                    bad.push(p.hint("begin with time[s],q.<joint>[rad],..."));
                    return None;
                }
            }
        }
        let line = lines.line.trim_ascii();
        if line.is_empty() || REMARKS.iter().any(|r| line.starts_with(r)) {
            continue;
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
        // A title, or a remark of another program.
        let words = names[0].contains(' ') && !names[0].contains([';', '\t', '|']);
        let flag = match guess.into_iter().find(|(c, _)| names[0].contains(*c)) {
            _ if words => "give --separator blanks, or begin lines before the names with #".to_owned(),
            Some((_, name)) => format!("give --separator {name} (decimal commas are read then)"),
            None => "separate columns by commas".to_owned(),
        };
        bad.push(data("Data::Separator", what).at_line(at).hint(flag));
        return None;
    }
    let mut names = names;
    if !rename(&mut names, &options.rename, bad) && !options.one_of_several {
        bad.0.iter_mut().for_each(|p| p.line = p.line.or(Some(at)));
        return None;
    }
    if lines.first().is_some_and(|units| take_units(&mut names, &units)) {
        lines.held = false;
    }
    if let Some(joined) = Joined::of(&names, lines.first().as_deref(), &options.ignore) {
        joined.rename(&mut names);
        lines.join(joined);
    }
    let dates = tell_time(&mut names, lines.first().as_deref());
    Some(Heading { names, line: at, dates })
}
