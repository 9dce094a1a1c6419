//! Records in blocks of rows: what every format gives, and the one way from blocks to a record.

use super::aliases::head;
use super::columns::Target;
use super::options::finish;
use super::samples::{NOT_FINITE, Samples, too_many};
use super::{JointColumn, Loaded, ReadOptions, data};
use crate::builder::RecordBuilder;
use ff_model::{Problem, Problems};

/// Most rows of a block.
pub const BLOCK: usize = 8192;

/// Time stamps of a block.
#[derive(Clone, Debug, PartialEq)]
pub enum Stamps {
    /// Whole numbers of the unit in the header: no digit of an epoch is lost.
    Whole(Vec<i64>),
    /// Numbers of the unit in the header.
    Real(Vec<f64>),
}

impl Stamps {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Whole(v) => v.len(),
            Self::Real(v) => v.len(),
        }
    }
    /// True when there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// The buffer of whole stamps, or a new one where they are not whole.
    #[cfg(any(feature = "parquet", feature = "mcap", feature = "rosbag"))]
    pub(super) fn take_whole(&mut self) -> Vec<i64> {
        match std::mem::replace(self, Self::Real(Vec::new())) {
            Self::Whole(v) => v,
            Self::Real(_) => Vec::new(),
        }
    }
}

/// Some rows of a record, column by column.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Time stamps.
    pub stamps: Stamps,
    /// A column per name of the source, in the units of the header. The column of the time is empty, and so is one that is
    /// not wanted. NaN where the file has no number.
    pub columns: Vec<Vec<f64>>,
}

impl Block {
    /// An empty block of so many columns.
    pub fn new(columns: usize) -> Self {
        Self { stamps: Stamps::Real(Vec::new()), columns: vec![Vec::new(); columns] }
    }
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.stamps.len()
    }
    /// Takes all rows out; the buffers stay.
    pub(super) fn clear(&mut self) {
        match &mut self.stamps {
            Stamps::Whole(v) => v.clear(),
            Stamps::Real(v) => v.clear(),
        }
        self.columns.iter_mut().for_each(Vec::clear);
    }
}

/// A record that is read block by block, in memory of fixed size.
pub trait Blocks {
    /// Names with units, `name[unit]`, one of them `time[..]`.
    fn names(&self) -> &[String];
    /// Tells which columns are wanted; all unless told.
    fn want(&mut self, wanted: &[bool]);
    /// Reads the next rows into `out`, whose buffers are used again; false at the end.
    ///
    /// # Errors
    /// What is wrong with the file, with the place in it.
    fn next(&mut self, out: &mut Block) -> Result<bool, Problems>;
    /// Bytes read so far.
    fn bytes(&self) -> u64;
    /// Rows of the whole file, if it says so before they are read.
    fn declared_rows(&self) -> Option<u64> {
        None
    }
    /// What was done to make rows of the file, and what was put up with; asked at the end.
    fn notes(&self) -> Problems {
        Problems::default()
    }
}

/// Reads all blocks into a record of the given joints.
///
/// # Errors
/// Those of [`super::read_from`], with rows in place of lines. `si_units` gives columns under other names that have no unit that of their channel.
pub(super) fn collect(
    source: &mut dyn Blocks,
    joints: &[JointColumn],
    options: &ReadOptions,
    si_units: bool,
) -> Result<Loaded, Problems> {
    let mut bad = Problems::default();
    let (head, targets) = head(source.names(), None, joints, options, si_units, &mut bad).unwrap_or_default();
    // The names of these files stand in no line.
    bad.0.iter_mut().for_each(|p| p.line = None);
    let parsed = targets.and_then(|t| rows(source, (&head, &t), joints, options, &mut bad));
    bad.extend(source.notes());
    finish(parsed, bad, options, source.bytes())
}

/// Names the row of a table, as there are no lines.
fn in_row(mut p: Problem, row: usize) -> Problem {
    p.message = format!("row {row}: {}", p.message);
    p
}

fn rows(
    source: &mut dyn Blocks,
    (head, targets): (&[String], &[Target]),
    joints: &[JointColumn],
    options: &ReadOptions,
    bad: &mut Problems,
) -> Option<(RecordBuilder, f64)> {
    let wanted: Vec<bool> = targets.iter().map(|t| !matches!(t, Target::Ignored)).collect();
    source.want(&wanted);
    // Row D34: before memory is taken.
    if let Some(n) = source.declared_rows().filter(|n| *n > options.max_rows as u64) {
        bad.push(too_many(usize::try_from(n).unwrap_or(usize::MAX), options.max_rows));
        return None;
    }
    let mut all = Growing {
        targets,
        options,
        samples: Samples::new((head, targets), options, in_row),
        times: Vec::new(),
        row: vec![0.0; targets.len()],
        seen: 0,
    };
    let mut block = Block::new(targets.len());
    loop {
        match source.next(&mut block) {
            Ok(true) => {}
            Ok(false) => break,
            Err(p) => {
                // What is complete of a file that is cut short, when that is allowed.
                let stop = p.has_errors() && !p.0.iter().all(|p| options.allow.iter().any(|a| a == p.code));
                bad.extend(p);
                if stop {
                    return None;
                }
                break;
            }
        }
        all.take(&block, bad)?;
    }
    all.samples.finish(joints, None, bad)
}

/// The samples that grow, with what a block of them takes.
struct Growing<'a> {
    targets: &'a [Target],
    options: &'a ReadOptions,
    samples: Samples<'a>,
    times: Vec<f64>,
    row: Vec<f64>,
    /// Rows of the file so far.
    seen: usize,
}

impl Growing<'_> {
    /// Takes a block; `None` when there is no use in going on.
    fn take(&mut self, block: &Block, bad: &mut Problems) -> Option<()> {
        if let Some(p) = self.samples.too_many(block.rows()) {
            bad.push(p);
            return None;
        }
        self.place(&block.stamps, bad)?;
        if self.samples.forward(&self.times) && self.finite(block) {
            // The usual case.
            self.samples.append(&self.times, &block.columns);
        } else {
            for i in 0..block.rows() {
                self.row(block, i, bad);
            }
        }
        self.seen += block.rows();
        Some(())
    }
    /// Seconds of the stamps, relative to the origin.
    fn place(&mut self, stamps: &Stamps, bad: &mut Problems) -> Option<()> {
        self.times.clear();
        let clock = &mut self.samples.clock;
        match stamps {
            Stamps::Whole(all) => {
                for (i, &w) in all.iter().enumerate() {
                    let Some(t) = clock.of_whole(w) else {
                        let p = data("Data::TimeScale", format!("stamp {w} is too far from the first"));
                        let p = in_row(p, self.seen + i + 1).on("time");
                        bad.push(p.hint("check the clock of the recorder"));
                        return None;
                    };
                    self.times.push(t);
                }
            }
            Stamps::Real(all) => self.times.extend(all.iter().map(|&x| clock.of_real(x))),
        }
        Some(())
    }
    /// True when every number is finite.
    fn finite(&self, block: &Block) -> bool {
        block.columns.iter().zip(self.targets).all(|(c, t)| {
            // Without a branch per number.
            t.unit().is_none() || c.iter().fold(true, |s, x| s & x.is_finite())
        })
    }
    /// One row with all its checks.
    fn row(&mut self, block: &Block, i: usize, bad: &mut Problems) {
        let (number, time) = (self.seen + i + 1, self.times[i]);
        for (k, t) in self.targets.iter().enumerate() {
            if let Some(u) = t.unit() {
                self.row[k] = u.to_si(block.columns[k][i]);
            }
        }
        let wrong = self.row.iter().position(|x| !x.is_finite());
        // Nulls of groups that were not sampled in this row.
        if time.is_finite() && (wrong.is_none() || self.samples.unsampled(&self.row)) {
            self.samples.push(number, time, &self.row);
        } else if self.options.drop_gaps {
            self.samples.drop_row(number);
        } else {
            let name = wrong.map_or("time", |k| self.targets[k].group());
            let p = data("Data::NotFinite", "a cell is empty, or not finite");
            self.samples.bad_cell(in_row(p, number).on(name).hint(NOT_FINITE), bad);
        }
    }
}

/// A problem of a file that is no text.
pub(super) fn unreadable(code: &'static str, what: impl Into<String>, hint: &str) -> Problems {
    let p: Problem = data(code, what);
    Problems(vec![p.hint(hint)])
}
