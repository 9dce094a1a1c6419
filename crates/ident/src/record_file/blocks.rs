//! Records in blocks of rows: what every format gives, and the one way from blocks to a record.

use super::columns::{Target, targets};
use super::read::{Clock, Count, LISTED, builder, finish, resolution};
use super::{JointColumn, Loaded, ReadOptions, data};
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
    pub(super) fn clear(&mut self) {
        match self {
            Self::Whole(v) => v.clear(),
            Self::Real(v) => v.clear(),
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

/// What a row of a block is called in messages.
const ROW: &str = "row";

/// Reads all blocks into a record of the given joints.
///
/// # Errors
/// Those of [`super::read_from`], with rows in place of lines.
pub(super) fn collect(
    source: &mut dyn Blocks,
    joints: &[JointColumn],
    options: &ReadOptions,
) -> Result<Loaded, Problems> {
    let mut bad = Problems::default();
    let parsed = match targets(source.names(), joints, &options.ignore, options.fixed_base, &mut bad) {
        Some(t) => rows(source, &t, joints, options, &mut bad),
        None => None,
    };
    // The names of these files stand in no line.
    for p in &mut bad.0 {
        if let Some(row) = p.line.take().filter(|_| ["Data::Dropped", "Data::Repeated"].contains(&p.code)) {
            p.message.push_str(&format!(", {ROW} {row}"));
        }
        p.column = None;
    }
    bad.extend(source.notes());
    finish(parsed, bad, options, source.bytes())
}

/// The columns that grow, with what they have to be checked for.
struct Growing<'a> {
    targets: &'a [Target],
    options: &'a ReadOptions,
    columns: Vec<Vec<f64>>,
    clock: Clock,
    count: Count,
    /// Rows of the file so far.
    seen: usize,
}

fn rows(
    source: &mut dyn Blocks,
    targets: &[Target],
    joints: &[JointColumn],
    options: &ReadOptions,
    bad: &mut Problems,
) -> Option<(crate::record_builder::RecordBuilder, f64)> {
    let wanted: Vec<bool> = targets.iter().map(|t| !matches!(t, Target::Ignored)).collect();
    source.want(&wanted);
    // Row D34: before memory is taken.
    if let Some(n) = source.declared_rows().filter(|n| *n > options.max_rows as u64) {
        let what = format!("{n} rows, limit {}", options.max_rows);
        bad.push(data("Data::TooLarge", what).hint("cut the record, or raise --max-rows"));
        return None;
    }
    let mut all = Growing {
        targets,
        options,
        columns: vec![Vec::new(); targets.len()],
        clock: Clock::new(targets),
        count: Count::default(),
        seen: 0,
    };
    let mut block = Block::new(targets.len());
    loop {
        match source.next(&mut block) {
            Ok(true) => {}
            Ok(false) => break,
            Err(p) => {
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
    all.count.report(bad);
    if all.clock.stamps.is_empty() {
        if !bad.has_errors() {
            let what = "there are column names, but no samples";
            bad.push(data("Data::NoSamples", what).hint("check that recording had started"));
        }
        return None;
    }
    resolution(&all.clock, bad);
    Some((builder(all.columns, targets, joints, &all.clock), all.clock.origin))
}

impl Growing<'_> {
    /// Takes a block; `None` when there is no use in going on.
    fn take(&mut self, block: &Block, bad: &mut Problems) -> Option<()> {
        let n = block.rows();
        if self.clock.stamps.len() + n > self.options.max_rows {
            let what = format!("more than {} rows", self.options.max_rows);
            bad.push(data("Data::TooLarge", what).hint("cut the record, or raise --max-rows"));
            return None;
        }
        let times = self.times(&block.stamps, bad)?;
        if self.smooth(block, &times) {
            // The usual case, a column at a time.
            for (to, (from, t)) in self.columns.iter_mut().zip(block.columns.iter().zip(self.targets)) {
                if let Target::Channel(_, _, u) = t {
                    if u.mul == 1.0 && u.div == 1.0 {
                        to.extend_from_slice(from);
                    } else {
                        to.extend(from.iter().map(|&x| u.to_si(x)));
                    }
                }
            }
            self.clock.stamps.extend(times);
        } else {
            for (i, t) in times.into_iter().enumerate() {
                self.row(block, i, t, bad);
            }
        }
        self.seen += n;
        Some(())
    }
    /// Seconds of the stamps, relative to the origin.
    fn times(&mut self, stamps: &Stamps, bad: &mut Problems) -> Option<Vec<f64>> {
        let mut out = Vec::with_capacity(stamps.len());
        match stamps {
            Stamps::Whole(all) => {
                for (i, &w) in all.iter().enumerate() {
                    let Some(t) = self.clock.of_whole(w) else {
                        let what = format!("{ROW} {}: stamp {w} is too far from the first", self.seen + i + 1);
                        bad.push(data("Data::TimeScale", what).on("time").hint("check the clock of the recorder"));
                        return None;
                    };
                    out.push(t);
                }
            }
            Stamps::Real(all) => out.extend(all.iter().map(|&x| self.clock.of_real(x))),
        }
        Some(out)
    }
    /// True when every number is finite and time goes forward.
    fn smooth(&self, block: &Block, times: &[f64]) -> bool {
        let first = self.clock.stamps.last().is_none_or(|&l| times.first().is_none_or(|&t| t > l));
        first
            && times.iter().all(|t| t.is_finite())
            && times.windows(2).all(|w| w[1] > w[0])
            && block.columns.iter().zip(self.targets).all(|(c, t)| {
                // Without a branch per number.
                !matches!(t, Target::Channel(..)) || c.iter().fold(true, |s, x| s & x.is_finite())
            })
    }
    /// One row with all its checks.
    fn row(&mut self, block: &Block, i: usize, time: f64, bad: &mut Problems) {
        let number = self.seen + i + 1;
        let value = |k: usize| match &self.targets[k] {
            Target::Channel(_, _, u) => u.to_si(block.columns[k][i]),
            _ => 0.0,
        };
        let n = self.targets.len();
        let wrong = (0..n).find(|&k| !value(k).is_finite());
        if wrong.is_some() || !time.is_finite() {
            if self.options.drop_gaps {
                self.count.dropped += 1;
                self.count.first_dropped.get_or_insert(number);
                return;
            }
            self.count.bad_cells += 1;
            if self.count.bad_cells <= LISTED {
                let name = wrong.map_or("time", |k| self.targets[k].group());
                let what = format!("{ROW} {number}: a cell is empty, or not finite");
                let hint = "repair or cut out these samples, or leave such rows out with --gaps drop";
                bad.push(data("Data::NotFinite", what).on(name).hint(hint));
            }
            return;
        }
        if let Some(&last) = self.clock.stamps.last() {
            let same = || {
                let channel = |k: &usize| matches!(self.targets[*k], Target::Channel(..));
                (0..n).filter(channel).all(|k| self.columns[k].last() == Some(&value(k)))
            };
            if self.options.drop_repeated && time == last && same() {
                self.count.repeated += 1;
                return;
            }
            if time <= last {
                self.count.backward += 1;
                if self.count.backward <= LISTED {
                    let o = self.clock.origin;
                    let what = format!("{ROW} {number}: time goes from {} to {} s", last + o, time + o);
                    let hint = "sort the rows; --drop-repeated leaves out rows that repeat the one before";
                    bad.push(data("Data::NonMonotone", what).on("time").hint(hint));
                }
            }
        }
        self.clock.stamps.push(time);
        for k in 0..n {
            if matches!(self.targets[k], Target::Channel(..)) {
                let x = match &self.targets[k] {
                    Target::Channel(_, _, u) => u.to_si(block.columns[k][i]),
                    _ => continue,
                };
                self.columns[k].push(x);
            }
        }
    }
}

/// A problem of a file that is no text.
pub(super) fn unreadable(code: &'static str, what: impl Into<String>, hint: &str) -> Problems {
    let p: Problem = data(code, what);
    Problems(vec![p.hint(hint)])
}
