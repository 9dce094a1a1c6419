//! Lines of a file, their cells, and the line of names.

use super::heading::{Heading, rename, take_units, tell_time, told_time};
use super::joined::Joined;
use super::{ReadOptions, data, number, over};
use ff_model::diagnostics::clip;
use ff_model::{Area, Problem, Problems};
use std::io::{BufRead, Read};

/// Size of the buffer (bytes).
pub(super) const BUFFER: usize = 1 << 20;
/// Longest line (bytes): no record has thousands of channels.
const MAX_LINE: u64 = 1 << 20;

/// What else than commas separates columns, as flags call it.
const SEPARATORS: [(u8, &str); 3] = [(b';', "semicolons"), (b'\t', "tabs"), (b'|', "bars")];

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
    /// A sample that was looked at before it was known what separates its cells.
    again: Option<(Vec<u8>, usize)>,
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
        Self { input, limit, separator, end, joined: None, held: false, again: None, line, number, bytes, ended: true }
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
        if let Some((line, number)) = self.again.take() {
            (self.line, self.number) = (line, number);
            to_commas(&mut self.line, self.separator);
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
    pub(super) fn first(&mut self) -> Option<Vec<Vec<u8>>> {
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
    let mut said: Vec<Problem> = Vec::new();
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
        // What Excel reads in front of the names: the separator.
        if let Some(&[separator]) =
            lines.line.strip_prefix(b"sep=").filter(|_| lines.number == 1 && lines.separator == b',')
        {
            if separator.is_ascii() && !separator.is_ascii_alphanumeric() {
                lines.separator = separator;
                said.push(told(separator).at_line(1));
            }
            continue;
        }
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
    let Some(mut names) = names_of(&lines.line) else {
        bad.push(data("Data::Syntax", "the line of names is not CSV").at_line(at).hint("mend its quotes"));
        return None;
    };
    if names.len() == 1 {
        match told_separator(lines, &names[0]) {
            Ok(separator) => {
                lines.separator = separator;
                to_commas(&mut lines.line, separator);
                names = names_of(&lines.line)?;
                said.push(told(separator).at_line(at));
            }
            Err(p) => {
                bad.push(p.at_line(at));
                return None;
            }
        }
    }
    let numbers = names.iter().filter(|n| number::parse(n.as_bytes()).is_some()).count();
    if 2 * numbers > names.len() {
        let what =
            format!("the first line has numbers and no names: '{}'", clip(&String::from_utf8_lossy(&lines.line)));
        let hint = "put a line of names in front, time[s],q.<joint>[rad],...: ros2 topic echo --csv writes none, and its messages are better recorded as a bag";
        bad.push(data("Data::Columns", what).at_line(at).hint(hint));
        return None;
    }
    let raw = names.clone();
    let mut unfit = Problems::default();
    if !rename(&mut names, &options.rename, &mut unfit) && !options.one_of_several {
        bad.0.extend(unfit.0.into_iter().map(|p| Problem { line: p.line.or(Some(at)), ..p }));
        return None;
    }
    if lines.first().is_some_and(|units| take_units(&mut names, &units)) {
        lines.held = false;
    }
    if let Some(joined) = Joined::of(&names, lines.first().as_deref(), &options.ignore) {
        joined.rename(&mut names);
        lines.join(joined);
    }
    let first = lines.first();
    let before = names.clone();
    let (dates, place) = tell_time(&mut names, first.as_deref());
    let dates = dates.map(|d| d.settled(options.dates));
    if let Some(place) = place {
        let cell = first.as_ref().and_then(|f| f.get(place)).map(|c| String::from_utf8_lossy(c));
        said.extend(told_time(&before[place], &names[place], dates, cell.as_deref()).map(|p| p.at_line(at)));
    }
    bad.0.extend(said);
    Some(Heading { names, line: at, dates, raw })
}

/// Names in a line, without blanks around them.
fn names_of(line: &[u8]) -> Option<Vec<String>> {
    let record = cells(line)?;
    Some(record.iter().map(|c| String::from_utf8_lossy(c).trim().to_owned()).collect())
}

/// What is said of a separator that the file tells.
fn told(separator: u8) -> Problem {
    let name = SEPARATORS.iter().find(|s| s.0 == separator).map_or("other characters", |s| s.1);
    let what =
        format!("columns are separated by {name}, as the line of names says; a comma in a number is a decimal comma");
    Problem::warning(Area::Data, "Data::Separator", what).hint("nothing to do, if that is so")
}

/// What separates the only cell of a line of names, where the first sample has as many cells, and no number in it can be read in two ways.
fn told_separator(lines: &mut Lines<impl BufRead>, head: &str) -> Result<u8, Box<Problem>> {
    let found = SEPARATORS.into_iter().find(|(c, _)| head.contains(char::from(*c)));
    // A title, or a remark of another program.
    let Some((separator, name)) = found else {
        let (what, hint) = if head.contains(' ') {
            (
                "columns seem to be separated by blanks, must be commas",
                "give --separator blanks, or begin lines before the names with #",
            )
        } else {
            ("there is only one column", "separate columns by commas")
        };
        return Err(Box::new(data("Data::Separator", what).hint(hint)));
    };
    let refused = |why: String, hint: String| {
        let what = format!("columns seem to be separated by {name}, must be commas{why}");
        Err(Box::new(data("Data::Separator", what).hint(hint)))
    };
    let flag = format!("give --separator {name} (decimal commas are read then)");
    let names = lines.line.clone();
    let number = lines.number;
    let more = lines.sample();
    let sample = std::mem::replace(&mut lines.line, names);
    let number_of_sample = std::mem::replace(&mut lines.number, number);
    if !more.is_ok_and(|more| more) {
        return refused(String::new(), flag);
    }
    let split = |line: &[u8]| {
        let mut line = line.to_vec();
        to_commas(&mut line, separator);
        cells(&line).map_or(0, |c| c.len())
    };
    let (a, b) = (split(&lines.line), split(&sample));
    if a != b && a + 1 != b {
        return refused(format!(": {a} names in line {number}, {b} cells in line {number_of_sample}"), flag);
    }
    let all: Vec<&[u8]> = sample.split(|b| *b == separator).map(<[u8]>::trim_ascii).collect();
    let comma = all.iter().find(|c| {
        let mut point = c.to_vec();
        point.iter_mut().filter(|b| **b == b',').for_each(|b| *b = b'.');
        c.contains(&b',') && number::parse(&point).is_some()
    });
    let point = all.iter().find(|c| c.contains(&b'.') && number::parse(c).is_some());
    if let (Some(comma), Some(point)) = (comma, point) {
        let show = |c: &[u8]| clip(&String::from_utf8_lossy(c));
        let why = format!(
            ": '{}' beside '{}' in line {number_of_sample} may be a decimal comma or one between thousands",
            show(comma),
            show(point)
        );
        return refused(why, format!("give --separator {name} if it is a decimal comma, or write numbers without it"));
    }
    lines.again = Some((sample, number_of_sample));
    Ok(separator)
}
