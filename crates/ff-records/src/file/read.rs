//! One pass over a file: lines, cells, numbers, samples. Memory beside the samples is one buffer and one line.

use super::blocks::collect;
use super::columns::{Target, targets};
use super::samples::{Clock, NOT_FINITE, Samples};
use super::source::{Format, blocks, opened};
use super::{JointColumn, data, number};
use crate::builder::RecordBuilder;
use crate::record::Record;
use ff_model::diagnostics::clip;
use ff_model::{Area, Problem, Problems, Severity};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Size of the buffer (bytes).
pub(super) const BUFFER: usize = 1 << 20;
/// Longest line (bytes): no record has thousands of channels.
const MAX_LINE: u64 = 1 << 20;

/// What is read, and what is put up with.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// Most samples.
    pub max_rows: usize,
    /// Longest file (bytes).
    pub max_bytes: u64,
    /// Columns to leave out, by name (without unit) or as the header has them.
    pub ignore: Vec<String>,
    /// Leave out rows with cells that are not finite; the rows left make a gap.
    pub drop_gaps: bool,
    /// Leave out a row that repeats the one before, time stamp included.
    pub drop_repeated: bool,
    /// Interpolate jittered or missing samples ([`RecordBuilder::resample`]).
    pub resample: bool,
    /// Fewest samples ([`RecordBuilder::need_samples`]).
    pub need_samples: usize,
    /// The base is bolted down: the gyro is not required ([`RecordBuilder::fixed_base`]).
    pub fixed_base: bool,
    /// Codes of errors to report as warnings, such as `Data::Stuck`.
    pub allow: Vec<String>,
    /// Topics of an MCAP file to read; the one of each kind that fits unless given.
    pub topics: Vec<String>,
    /// Joints of an MCAP file that slide, where no robot tells.
    pub slides: Vec<String>,
}

impl Default for ReadOptions {
    /// Four million rows (eleven hours at 100 Hz), 16 GiB; nothing is dropped or repaired.
    fn default() -> Self {
        Self {
            max_rows: 4_000_000,
            max_bytes: 16 << 30,
            ignore: Vec::new(),
            drop_gaps: false,
            drop_repeated: false,
            resample: false,
            need_samples: 2,
            fixed_base: false,
            allow: Vec::new(),
            topics: Vec::new(),
            slides: Vec::new(),
        }
    }
}

/// A record with what is to be said about it.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The samples, on a uniform clock.
    pub record: Record,
    /// What was let through.
    pub warnings: Problems,
    /// Bytes read.
    pub bytes: u64,
}

/// Reads a file: CSV, Parquet or MCAP, by its first bytes.
///
/// # Errors
/// All of [`read_from`], with the file; `Io::Read`.
pub fn read(path: &Path, joints: &[JointColumn], options: &ReadOptions) -> Result<Loaded, Problems> {
    let (file, format) = opened(path, options)?;
    let loaded = match format {
        Format::Csv => read_from(BufReader::with_capacity(BUFFER, file), joints, options),
        other => blocks(file, other, joints, options).and_then(|mut s| collect(s.as_mut(), joints, options)),
    };
    let mut loaded = loaded.map_err(|p| p.in_file(path))?;
    loaded.warnings = loaded.warnings.in_file(path);
    Ok(loaded)
}

pub(super) fn too_long(bytes: u64, limit: u64) -> Problem {
    data("Data::TooLarge", format!("{bytes} bytes, limit {limit} bytes")).hint("cut the record, or raise --max-bytes")
}

/// Reads CSV text for the joints of a robot, whose order the record takes.
///
/// # Errors
/// Every problem of the header at once, or the first ones of the data, with line and column: `Data::NoSamples` (D01),
/// `Data::NotFinite` and `Data::BadNumber` (D03), `Data::RowLength` (D04), `Data::MaybeTruncated` (D05),
/// `Data::Separator` (D06), `Data::Columns` (D07), `Data::UnitMissing` and `Data::UnknownUnit` (D08),
/// `Data::NonMonotone` (D11), `Data::TimeScale` (D12), `Data::TooLarge` (D34), `Data::NameMismatch` (D37),
/// `Data::NotUtf8`, and those of [`RecordBuilder::build`].
pub fn read_from(input: impl BufRead, joints: &[JointColumn], options: &ReadOptions) -> Result<Loaded, Problems> {
    let mut bad = Problems::default();
    let mut lines = Lines::new(input, options.max_bytes);
    let parsed = head(&mut lines, joints, options, &mut bad)
        .and_then(|targets| body(&mut lines, &targets, joints, options, &mut bad));
    finish(parsed, bad, options, lines.bytes)
}

/// The record of a builder (with the origin of its clock), or everything that is wrong.
pub(super) fn finish(
    parsed: Option<(RecordBuilder, f64)>,
    mut bad: Problems,
    options: &ReadOptions,
    bytes: u64,
) -> Result<Loaded, Problems> {
    for p in &mut bad.0 {
        if options.allow.iter().any(|a| a == p.code) {
            p.severity = Severity::Warning;
        }
    }
    let (builder, t0) = match parsed {
        Some(p) if !bad.has_errors() => p,
        _ => return bad.finish(None).map(|(x, _)| x),
    };
    let builder = if options.fixed_base { builder.fixed_base() } else { builder };
    let builder = options.allow.iter().fold(builder, |b, a| b.allow(a));
    match builder.need_samples(options.need_samples).resample(options.resample).build() {
        Ok((mut record, warnings)) => {
            record.t0 += t0;
            bad.extend(warnings);
            Ok(Loaded { record, warnings: bad, bytes })
        }
        Err(problems) => {
            bad.extend(problems);
            Err(bad)
        }
    }
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
            let what = format!("a line of more than {MAX_LINE} bytes");
            return Err(Box::new(data("Data::TooLarge", what).at_line(self.number).hint("is this a CSV file?")));
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

fn head(
    lines: &mut Lines<impl BufRead>,
    joints: &[JointColumn],
    options: &ReadOptions,
    bad: &mut Problems,
) -> Option<Vec<Target>> {
    targets(&header(lines, bad)?, joints, &options.ignore, options.fixed_base, bad)
}

/// The line of names; `None` where a problem is recorded.
pub(super) fn header(lines: &mut Lines<impl BufRead>, bad: &mut Problems) -> Option<Vec<String>> {
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
                bad.push(data("Data::NoSamples", what).at_line(1).hint("begin with time[s],q.<joint>[rad],..."));
                return None;
            }
        }
    }
    if let Err(e) = core::str::from_utf8(&lines.line) {
        let what = format!("byte {} is not UTF-8", e.valid_up_to());
        bad.push(data("Data::NotUtf8", what).at(1, e.valid_up_to() + 1).hint("save the file as UTF-8"));
        return None;
    }
    let Some(record) = cells(&lines.line) else {
        bad.push(data("Data::Syntax", "the line of names is not CSV").at_line(1).hint("mend its quotes"));
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
        bad.push(data("Data::Separator", what).at_line(1).hint(hint));
        return None;
    }
    Some(names)
}

/// Everything behind the header: the samples as a builder, and the origin of its clock.
fn body(
    lines: &mut Lines<impl BufRead>,
    targets: &[Target],
    joints: &[JointColumn],
    options: &ReadOptions,
    bad: &mut Problems,
) -> Option<(RecordBuilder, f64)> {
    let mut all = Samples::new(targets, options, Problem::at_line);
    let mut row = vec![0.0; targets.len()];
    loop {
        match lines.sample() {
            Ok(true) => {}
            Ok(false) => break,
            Err(p) => {
                bad.push(*p);
                return None;
            }
        }
        if let Some(p) = all.too_many(1) {
            bad.push(p.at_line(lines.number));
            return None;
        }
        match fill(&lines.line, lines.number, targets, &mut row, &mut all.clock) {
            Ok(time) => all.push(lines.number, time, &row, bad),
            Err(problems) if options.drop_gaps && problems.0.iter().all(|p| p.code == "Data::NotFinite") => {
                all.drop_row(lines.number);
            }
            Err(problems) => {
                let stop = problems.has("Data::RowLength");
                problems.0.into_iter().for_each(|p| all.bad_cell(p, bad));
                if stop {
                    break;
                }
            }
        }
    }
    bad.0.extend(lines.cut_short());
    all.finish(joints, Some(lines.number), bad)
}

/// Reads the cells of a line into `row`; the time comes back by itself.
fn fill(line: &[u8], number: usize, targets: &[Target], row: &mut [f64], clock: &mut Clock) -> Result<f64, Problems> {
    let mut problems = Problems::default();
    let mut time = 0.0;
    let mut k = 0;
    let mut start = 0;
    // The fast way: no quotes, so that a comma is a comma; a plain number ends where its digits do.
    loop {
        let rest = &line[start..];
        let (value, len) = number::cell(rest);
        match (value, targets.get(k), row.get_mut(k)) {
            (Some(x), Some(Target::Channel(_, _, u)), Some(to)) => *to = u.to_si(x),
            (_, Some(target), to) => {
                one(&rest[..len], target, (number, start + 1), to, clock, &mut time, &mut problems);
            }
            _ => {}
        }
        k += 1;
        if len == rest.len() {
            break;
        }
        start += len + 1;
    }
    if (k != targets.len() || !problems.0.is_empty()) && line.contains(&b'"') {
        return quoted(line, number, targets, row, clock);
    }
    length(k, targets.len(), number, line)?;
    if problems.0.is_empty() { Ok(time) } else { Err(problems) }
}

/// The same with quotes, which only few programs put around numbers.
fn quoted(line: &[u8], number: usize, targets: &[Target], row: &mut [f64], clock: &mut Clock) -> Result<f64, Problems> {
    let record = cells(line).unwrap_or_default();
    length(record.len(), targets.len(), number, line)?;
    let (mut time, mut problems) = (0.0, Problems::default());
    for (k, (cell, target)) in record.iter().zip(targets).enumerate() {
        one(cell, target, (number, 1), row.get_mut(k), clock, &mut time, &mut problems);
    }
    if problems.0.is_empty() { Ok(time) } else { Err(problems) }
}

fn length(got: usize, want: usize, number: usize, line: &[u8]) -> Result<(), Problems> {
    if got == want {
        return Ok(());
    }
    let what = format!("{got} cells, the line of names has {want}");
    let hint = if line.contains(&b';') || got > want {
        "separate cells by commas and write numbers with a decimal point, not a comma"
    } else {
        "the line may be cut short; write the file again"
    };
    Err(Problems(vec![data("Data::RowLength", what).at_line(number).hint(hint)]))
}

/// One cell. `place` is line and column in characters of ASCII, which numbers are.
fn one(
    cell: &[u8],
    target: &Target,
    place: (usize, usize),
    to: Option<&mut f64>,
    clock: &mut Clock,
    time: &mut f64,
    problems: &mut Problems,
) {
    let (name, x) = match target {
        Target::Ignored => return,
        Target::Time(_) => ("time", clock.read(cell)),
        Target::Channel(g, _, u) => (g.prefix(), number::parse(cell).map(|x| u.to_si(x))),
    };
    let shown = || clip(&String::from_utf8_lossy(cell));
    let p = match x {
        Some(x) if x.is_finite() => {
            match target {
                Target::Time(_) => *time = x,
                _ => _ = to.map(|t| *t = x),
            }
            return;
        }
        // What a missing value looks like in the files of many programs.
        None if cell.trim_ascii().is_empty() => data("Data::NotFinite", "an empty cell".to_owned()),
        Some(_) => data("Data::NotFinite", format!("'{}' is not finite", shown())),
        None => data("Data::BadNumber", format!("'{}' is not a number", shown())),
    };
    let hint = match p.code {
        "Data::NotFinite" => NOT_FINITE,
        _ => "write numbers with a decimal point and nothing else",
    };
    let channel = match target {
        Target::Channel(_, k, _) => format!("{name}, channel {}", k + 1),
        _ => name.to_owned(),
    };
    problems.push(p.at(place.0, place.1).on(channel).hint(hint));
}
