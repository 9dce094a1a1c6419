//! One pass over a file: lines, cells, numbers, samples. Memory beside the samples is one buffer and one line.

use super::blocks::collect;
use super::columns::Target;
use super::heading::Heading;
use super::lines::{BUFFER, Lines, cells, header};
use super::options::{Loaded, ReadOptions, finish};
use super::samples::{Clock, NOT_FINITE, Samples};
use super::source::{Format, blocks, opened};
use super::wide::Text;
use super::{JointColumn, aliases, data, dates, number};
use crate::builder::RecordBuilder;
use ff_model::diagnostics::clip;
use ff_model::{Problem, Problems};
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Reads a file: CSV, Parquet or MCAP, by its first bytes.
///
/// # Errors
/// All of [`read_from`], with the file; `Io::Read`.
pub fn read(path: &Path, joints: &[JointColumn], options: &ReadOptions) -> Result<Loaded, Problems> {
    let (file, format) = opened(path, options)?;
    let loaded = match format {
        Format::Csv => {
            let text = Text::new(file);
            let note = text.note();
            read_from(BufReader::with_capacity(BUFFER, text), joints, options).map(|mut l| {
                l.warnings.0.splice(0..0, note);
                l
            })
        }
        other => blocks(file, other, joints, options).and_then(|mut s| collect(s.as_mut(), joints, options, false)),
    };
    let mut loaded = loaded.map_err(|p| p.in_file(path))?;
    loaded.warnings = loaded.warnings.in_file(path);
    Ok(loaded)
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
    let mut lines = Lines::new(input, options);
    let parsed = head(&mut lines, joints, options, &mut bad)
        .and_then(|(heading, targets)| body(&mut lines, (&heading, &targets), joints, options, &mut bad));
    finish(parsed, bad, options, lines.bytes)
}

fn head(
    lines: &mut Lines<impl BufRead>,
    joints: &[JointColumn],
    options: &ReadOptions,
    bad: &mut Problems,
) -> Option<(Heading, Vec<Target>)> {
    let mut heading = header(lines, options, bad)?;
    let first = lines.first();
    let found = aliases::head(&heading.names, first.as_deref(), joints, options, false, bad);
    let targets = found.and_then(|(names, targets)| {
        heading.names = names;
        targets
    });
    // The names may stand behind remarks.
    bad.0.iter_mut().filter(|p| p.line == Some(1)).for_each(|p| p.line = Some(heading.line));
    Some((heading, targets?))
}

/// Everything behind the header: the samples as a builder, and the origin of its clock.
fn body(
    lines: &mut Lines<impl BufRead>,
    (heading, targets): (&Heading, &[Target]),
    joints: &[JointColumn],
    options: &ReadOptions,
    bad: &mut Problems,
) -> Option<(RecordBuilder, f64)> {
    let mut all = Samples::new((&heading.names, targets), options, Problem::at_line);
    all.clock.dates = heading.dates;
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
            Ok(time) => all.push(lines.number, time, &row),
            Err((time, problems)) if time.is_finite() && no_numbers(&problems) && all.unsampled(&row) => {
                all.push(lines.number, time, &row);
            }
            Err((_, problems)) if options.drop_gaps && no_numbers(&problems) => {
                all.drop_row(lines.number);
            }
            Err((_, problems)) => {
                let stop = problems.has("Data::RowLength");
                let problems = text_line(&lines.line, lines.number, targets, problems);
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

/// One problem in place of those of all its cells where a line has no number at all: names again, units, or a total.
fn text_line(line: &[u8], number: usize, targets: &[Target], problems: Problems) -> Problems {
    let read = targets.iter().filter(|t| !matches!(t, Target::Ignored)).count();
    let Some(all) = cells(line) else { return problems };
    let no_time = all.get(0).is_some_and(is_text);
    // Numbers that are written in another way begin as numbers do.
    let words =
        || !all.iter().any(|c| c.trim_ascii_start().first().is_some_and(|b| b.is_ascii_digit() || b"+-.".contains(b)));
    if !(problems.has("Data::RowLength") && no_time || problems.0.len() == read && words()) {
        return problems;
    }
    let what = format!("a line of text among the samples: '{}'", clip(&String::from_utf8_lossy(line)));
    let hint = "remove it, or begin it with #; where names stand again another record begins: cut the file there, and give both";
    Problems(vec![data("Data::RowLength", what).at_line(number).hint(hint)])
}

/// Whether a cell is neither a number nor a date nor the mark of a missing number.
fn is_text(cell: &[u8]) -> bool {
    !number::absent(cell) && number::parse(cell).is_none() && dates::nanoseconds(cell).is_none()
}

/// Whether all that is wrong with a row are cells without a number, or with an infinite one.
fn no_numbers(problems: &Problems) -> bool {
    problems.0.iter().all(|p| p.code == "Data::NotFinite")
}

/// The time of a row whose cells are all numbers, or that of another and what is wrong with its cells.
type Row = Result<f64, (f64, Problems)>;

/// Reads the cells of a line into `row`, not finite where a cell has no finite number; the time comes back by itself.
fn fill(line: &[u8], number: usize, targets: &[Target], row: &mut [f64], clock: &mut Clock) -> Row {
    let mut problems = Problems::default();
    let mut time = 0.0;
    let mut k = 0;
    let mut start = 0;
    // The fast way: no quotes, so that a comma is a comma; a plain number ends where its digits do.
    loop {
        let rest = &line[start..];
        let (value, len) = number::cell(rest);
        match (value, targets.get(k), row.get_mut(k)) {
            (Some(x), Some(Target::Channel(_, _, u) | Target::Carried(_, u) | Target::Follower(_, u)), Some(to)) => {
                *to = u.to_si(x);
            }
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
    length(k, targets.len(), number, line).map_err(|p| (time, p))?;
    if problems.0.is_empty() { Ok(time) } else { Err((time, problems)) }
}

/// The same with quotes, which only few programs put around numbers.
fn quoted(line: &[u8], number: usize, targets: &[Target], row: &mut [f64], clock: &mut Clock) -> Row {
    let record = cells(line).unwrap_or_default();
    length(record.len(), targets.len(), number, line).map_err(|p| (0.0, p))?;
    let (mut time, mut problems) = (0.0, Problems::default());
    for (k, (cell, target)) in record.iter().zip(targets).enumerate() {
        one(cell, target, (number, 1), row.get_mut(k), clock, &mut time, &mut problems);
    }
    if problems.0.is_empty() { Ok(time) } else { Err((time, problems)) }
}

fn length(got: usize, want: usize, number: usize, line: &[u8]) -> Result<(), Problems> {
    // A comma at the end of the line is no cell.
    if got == want || got == want + 1 && line.trim_ascii_end().ends_with(b",") {
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
    mut to: Option<&mut f64>,
    clock: &mut Clock,
    time: &mut f64,
    problems: &mut Problems,
) {
    let (name, x) = match target {
        Target::Ignored => return,
        Target::Time(_) => ("time", clock.read(cell)),
        Target::Channel(_, _, u) | Target::Carried(_, u) | Target::Follower(_, u) => {
            (target.group(), number::parse(cell).map(|x| u.to_si(x)))
        }
    };
    let shown = || clip(&String::from_utf8_lossy(cell));
    let mut put = |x: f64| match (target, to.take()) {
        (Target::Time(_), _) => *time = x,
        (_, Some(to)) => *to = x,
        _ => {}
    };
    let p = match x {
        Some(x) if x.is_finite() => {
            put(x);
            return;
        }
        // Of a channel that was not sampled then, if the rest of the row bears it out.
        _ if number::absent(cell) => {
            put(f64::NAN);
            match cell.trim_ascii() {
                [] => data("Data::NotFinite", "an empty cell"),
                _ => data("Data::NotFinite", format!("'{}' is no number", shown())),
            }
        }
        Some(x) => {
            put(x);
            data("Data::NotFinite", format!("'{}' is not finite", shown()))
        }
        None => data("Data::BadNumber", format!("'{}' is not a number", shown())),
    };
    let hint = match p.code {
        "Data::NotFinite" => NOT_FINITE,
        _ if matches!(target, Target::Time(_)) && cell.contains(&b':') => {
            "dates are read as 2024-03-05T10:20:30.123, 05.03.2024 10:20:30.123, 3/25/2024 10:20:30.123 AM or 05-Mar-2024 10:20:30.123, all of a file alike; else give seconds as time[s]"
        }
        _ if cell.contains(&b',') => {
            "write numbers with a decimal point; decimal commas are read with --separator semicolons (tabs, ...) between columns"
        }
        _ => "write numbers with a decimal point and nothing else",
    };
    let channel = match target {
        Target::Channel(_, k, _) | Target::Carried(k, _) => format!("{name}, channel {}", k + 1),
        _ => name.to_owned(),
    };
    problems.push(p.at(place.0, place.1).on(channel).hint(hint));
}
