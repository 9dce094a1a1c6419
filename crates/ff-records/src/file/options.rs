//! What is read of a file and put up with, and the record that comes of it.

use super::FollowerColumn;
use crate::builder::RecordBuilder;
use crate::record::Record;
use ff_model::{Problems, Severity};

/// Which of two times a message of a bag counts at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StampSource {
    /// The stamp in its header, of the sensor; the time of recording where there is none.
    #[default]
    Header,
    /// The time at which the recorder got it.
    Receive,
}

/// What `3/5/2024` is, where a file does not say it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DateOrder {
    /// Not known: refused, unless a row of the file settles it.
    #[default]
    Unknown,
    /// The 3rd of May.
    DayFirst,
    /// The 5th of March.
    MonthFirst,
}

/// What is read, and what is put up with.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// Most samples.
    pub max_rows: usize,
    /// Longest file (bytes).
    pub max_bytes: u64,
    /// What separates cells of a text: a comma, or `;`, `|`, a tab or blanks, with which a comma in a cell is a decimal point. With a comma
    /// the others but blanks are told by the line of names and the first row, with a warning.
    pub separator: u8,
    /// What `3/5/2024` is, where a file does not say it.
    pub dates: DateOrder,
    /// Names of columns to change, `(old, new)`; one `*` in both stands for any text. The unit stays unless the new name has one.
    pub rename: Vec<(String, String)>,
    /// Let rules of `rename` through that fit no column, where the file is one of several.
    pub one_of_several: bool,
    /// Columns to leave out, by name (without unit) or as the header has them; one `*` stands for any text.
    pub ignore: Vec<String>,
    /// Joints that follow others ([`followers_of`](super::followers_of)): their columns are left out, their positions compared.
    pub followers: Vec<FollowerColumn>,
    /// Leave out rows with cells that are not finite; the rows left make a gap.
    pub drop_gaps: bool,
    /// Leave out a row that repeats the one before, time stamp included.
    pub drop_repeated: bool,
    /// Interpolate jittered or missing samples ([`RecordBuilder::resample`]).
    pub resample: bool,
    /// Keep single samples that jump out and back ([`RecordBuilder::keep_spikes`]).
    pub keep_spikes: bool,
    /// Let long gaps of the joint motion through, to cut the record there ([`RecordBuilder::long_gaps`]).
    pub long_gaps: bool,
    /// Fewest samples ([`RecordBuilder::need_samples`]).
    pub need_samples: usize,
    /// The base is bolted down: the gyro is not required ([`RecordBuilder::fixed_base`]).
    pub fixed_base: bool,
    /// Codes of errors to report as warnings, such as `Data::Stuck`.
    pub allow: Vec<String>,
    /// Topics of a bag to read; the one of each kind that fits unless given.
    pub topics: Vec<String>,
    /// Joints of a bag that slide, where no robot tells.
    pub slides: Vec<String>,
    /// When messages of a bag were measured.
    pub stamps: StampSource,
}

impl Default for ReadOptions {
    /// Four million rows (eleven hours at 100 Hz), 16 GiB; nothing is dropped or repaired.
    fn default() -> Self {
        Self {
            max_rows: 4_000_000,
            max_bytes: 16 << 30,
            separator: b',',
            dates: DateOrder::Unknown,
            rename: Vec::new(),
            one_of_several: false,
            ignore: Vec::new(),
            followers: Vec::new(),
            drop_gaps: false,
            drop_repeated: false,
            resample: false,
            keep_spikes: false,
            long_gaps: false,
            need_samples: 2,
            fixed_base: false,
            allow: Vec::new(),
            topics: Vec::new(),
            slides: Vec::new(),
            stamps: StampSource::Header,
        }
    }
}

/// A record with what is to be said about it.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The samples.
    pub record: Record,
    /// What was let through.
    pub warnings: Problems,
    /// Bytes read.
    pub bytes: u64,
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
    match builder
        .need_samples(options.need_samples)
        .resample(options.resample)
        .keep_spikes(options.keep_spikes)
        .long_gaps(options.long_gaps)
        .build()
    {
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
