//! CSV text in blocks, for conversion: numbers as they are, no column is left out.

use super::blocks::{BLOCK, Block, Blocks, Stamps, unreadable};
use super::columns::split;
use super::read::{BUFFER, Lines, header};
use super::{data, number};
use ff_model::{Problem, Problems, clip};
use std::fs::File;
use std::io::BufReader;

/// Whole stamps beyond this are kept whole: as floating-point numbers they would lose digits.
const WHOLE: u64 = 1 << 50;

pub(super) struct CsvBlocks {
    lines: Lines<BufReader<File>>,
    names: Vec<String>,
    time: usize,
    wanted: Vec<bool>,
    /// Whether stamps are whole, once the first is read.
    whole: Option<bool>,
}

impl CsvBlocks {
    pub(super) fn new(file: File) -> Result<Self, Problems> {
        let mut lines = Lines::new(BufReader::with_capacity(BUFFER, file));
        let mut bad = Problems::default();
        let Some(names) = header(&mut lines, &mut bad) else { return Err(bad) };
        let Some(time) = names.iter().position(|n| split(n).0 == "time") else {
            let p = data("Data::Columns", "there is no column time[s]").at_line(1);
            return Err(Problems(vec![p.hint("give the time of every sample")]));
        };
        let wanted = vec![true; names.len()];
        Ok(Self { lines, names, time, wanted, whole: None })
    }
    /// One line into the block.
    fn take(&mut self, out: &mut Block) -> Result<(), Problems> {
        let (line, at) = (&self.lines.line, self.lines.number);
        let quoted = line.contains(&b'"').then(|| super::read::cells(line)).flatten();
        let (mut start, mut k) = (0, 0);
        loop {
            let cell = match &quoted {
                Some(cells) => cells.get(k).unwrap_or_default(),
                None => {
                    let rest = &line[start.min(line.len())..];
                    &rest[..rest.iter().position(|&b| b == b',').unwrap_or(rest.len())]
                }
            };
            let bad = |code, what: String| {
                let p = data(code, what).at(at, start + 1);
                Err(Problems(vec![p.hint("write numbers with a decimal point and nothing else")]))
            };
            if k == self.time {
                let whole = number::whole(cell);
                let keep = *self.whole.get_or_insert(whole.is_some_and(|w| w.unsigned_abs() > WHOLE));
                if out.rows() == 0 {
                    out.stamps = if keep { Stamps::Whole(Vec::new()) } else { Stamps::Real(Vec::new()) };
                }
                match (&mut out.stamps, whole, number::parse(cell)) {
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
                match number::parse(cell) {
                    Some(x) => out.columns[k].push(x),
                    None if cell.trim_ascii().is_empty() => out.columns[k].push(f64::NAN),
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
        if k == self.names.len() {
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
        out.stamps.clear();
        out.columns.iter_mut().for_each(Vec::clear);
        let one = |p: Problem| Problems(vec![p]);
        while out.rows() < BLOCK {
            if !self.lines.next().map_err(|p| one(*p))? {
                break;
            }
            if !self.lines.line.trim_ascii().is_empty() {
                self.take(out)?;
            } else if self.lines.next().map_err(|p| one(*p))? {
                return Err(unreadable("Data::RowLength", "a blank line between samples", "remove it"));
            }
        }
        if out.rows() == 0 && !self.lines.ended {
            let what = "the last line does not end: the file may be cut short, and its last number with it";
            let p = data("Data::MaybeTruncated", what).at_line(self.lines.number);
            return Err(one(p.hint("write the file again, or end the line if it is whole")));
        }
        Ok(out.rows() > 0)
    }
    fn bytes(&self) -> u64 {
        self.lines.bytes
    }
}
