//! CSV text in blocks, for conversion: numbers as they are, no column is left out.

use super::blocks::{BLOCK, Block, Blocks, Stamps};
use super::columns::time_column;
use super::lines::{BUFFER, Lines, header};
use super::options::DateOrder;
use super::samples::either;
use super::wide::Text;
use super::{ReadOptions, data, dates, number};
use ff_model::diagnostics::clip;
use ff_model::{Problem, Problems};
use std::fs::File;
use std::io::{BufReader, Seek, SeekFrom};

/// Whole stamps beyond this are kept whole: as floating-point numbers they would lose digits.
const WHOLE: u64 = 1 << 50;

pub(super) struct CsvBlocks {
    lines: Lines<BufReader<Text>>,
    names: Vec<String>,
    time: usize,
    wanted: Vec<bool>,
    /// How stamps are written, if not as numbers.
    dates: Option<dates::Style>,
    /// Whether stamps are whole, once the first is read.
    whole: Option<bool>,
    /// What was understood of the line of names.
    notes: Problems,
}

impl CsvBlocks {
    pub(super) fn new(file: File, options: &ReadOptions) -> Result<Self, Problems> {
        // Dates that are day first or month first are settled by a row behind the first, if at all; a pipe cannot be read twice.
        let again = file.try_clone().ok().filter(|f| f.metadata().is_ok_and(|m| m.is_file()));
        let mut found = Self::at_start(file, options)?;
        if found.dates == Some(dates::Style::Either) {
            let order = found.settled()?;
            let Some(mut again) = again.filter(|_| order != DateOrder::Unknown) else { return Ok(found) };
            _ = again.seek(SeekFrom::Start(0));
            found = Self::at_start(again, &ReadOptions { dates: order, ..options.clone() })?;
        }
        Ok(found)
    }
    fn at_start(file: File, options: &ReadOptions) -> Result<Self, Problems> {
        let text = Text::new(file);
        let mut notes = Problems(text.note().into_iter().collect());
        let mut lines = Lines::new(BufReader::with_capacity(BUFFER, text), options);
        let Some(heading) = header(&mut lines, options, &mut notes) else { return Err(notes) };
        let (names, dates) = (heading.names, heading.dates);
        let time = time_column(&names).map_err(|p| Problems(vec![(*p).at_line(1)]))?;
        let wanted = vec![true; names.len()];
        Ok(Self { lines, names, time, wanted, dates, whole: None, notes })
    }
    /// Reads on until a row says which number of a date is the day.
    fn settled(&mut self) -> Result<DateOrder, Problems> {
        let mut first: Option<dates::Numbers> = None;
        while self.lines.sample().map_err(|p| Problems(vec![*p]))? {
            let date = super::lines::cells(&self.lines.line).and_then(|c| dates::numbers(c.get(self.time)?));
            let Some(date) = date else { continue };
            let known = *first.get_or_insert(date);
            match known.settled_by(&date) {
                Some(dates::Style::MonthFirst) => return Ok(DateOrder::MonthFirst),
                Some(_) => return Ok(DateOrder::DayFirst),
                None => {}
            }
        }
        match first {
            Some(date) if !date.is_one() => Err(Problems(vec![either(&date)])),
            // Both readings are one.
            _ => Ok(DateOrder::DayFirst),
        }
    }
    /// One line into the block.
    fn take(&mut self, out: &mut Block) -> Result<(), Problems> {
        let (line, at) = (&self.lines.line, self.lines.number);
        let quoted = line.contains(&b'"').then(|| super::lines::cells(line)).flatten();
        let (mut start, mut k) = (0, 0);
        loop {
            let (value, cell) = match &quoted {
                Some(cells) => (None, cells.get(k).unwrap_or_default()),
                None => {
                    let rest = &line[start.min(line.len())..];
                    let (value, len) = number::cell(rest);
                    (value, &rest[..len])
                }
            };
            let bad = |code, what: String| {
                let p = data(code, what).at(at, start + 1);
                Err(Problems(vec![p.hint("write numbers with a decimal point and nothing else")]))
            };
            if k == self.time {
                let whole = match self.dates {
                    Some(style) => dates::of_style(cell, style),
                    None => number::whole(cell),
                };
                let keep =
                    *self.whole.get_or_insert(whole.is_some_and(|w| self.dates.is_some() || w.unsigned_abs() > WHOLE));
                if out.rows() == 0 {
                    out.stamps = if keep { Stamps::Whole(Vec::new()) } else { Stamps::Real(Vec::new()) };
                }
                match (&mut out.stamps, whole, value.or_else(|| number::parse(cell))) {
                    (Stamps::Whole(v), Some(w), _) => v.push(w),
                    (Stamps::Real(v), _, Some(x)) => v.push(x),
                    _ => {
                        return bad(
                            "Data::BadNumber",
                            format!("'{}' is no time", clip(&String::from_utf8_lossy(cell))),
                        );
                    }
                }
            } else if self.wanted.get(k) == Some(&true) {
                match value.or_else(|| number::parse(cell)) {
                    Some(x) => out.columns[k].push(x),
                    None if number::absent(cell) => out.columns[k].push(f64::NAN),
                    None => {
                        let what = format!("'{}' is not a number", clip(&String::from_utf8_lossy(cell)));
                        return bad("Data::BadNumber", what);
                    }
                }
            }
            k += 1;
            start += cell.len() + 1;
            let more = match &quoted {
                Some(cells) => k < cells.len(),
                None => start <= line.len(),
            };
            if !more {
                break;
            }
        }
        // A comma at the end of the line is no cell.
        if k == self.names.len() || k == self.names.len() + 1 && line.trim_ascii_end().ends_with(b",") {
            return Ok(());
        }
        let what = format!("{k} cells, the line of names has {}", self.names.len());
        let p = data("Data::RowLength", what).at_line(at);
        Err(Problems(vec![p.hint("the line may be cut short; write the file again")]))
    }
}

impl Blocks for CsvBlocks {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn want(&mut self, wanted: &[bool]) {
        self.wanted = wanted.to_vec();
    }
    fn next(&mut self, out: &mut Block) -> Result<bool, Problems> {
        out.clear();
        let one = |p: Problem| Problems(vec![p]);
        while out.rows() < BLOCK && self.lines.sample().map_err(|p| one(*p))? {
            self.take(out)?;
        }
        // Asked for once more at the end of the file, when all its rows are out.
        if let Some(p) = self.lines.cut_short().filter(|_| out.rows() == 0) {
            return Err(one(p));
        }
        Ok(out.rows() > 0)
    }
    fn bytes(&self) -> u64 {
        self.lines.bytes
    }
    fn notes(&self) -> Problems {
        self.notes.clone()
    }
}
