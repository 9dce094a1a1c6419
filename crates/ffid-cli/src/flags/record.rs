//! What `simulate`, `identify`, `validate` and `predict` share: reading a record, and asking whether it can be true.

use crate::flags::fit::failed;
use crate::output::Input;
use crate::results::{Refusal, refused};
use clap::ValueEnum;
use ff_mission::Leniency;
use ff_mission::leniency::ALLOWABLE;
use ff_model::diagnostics::list;
use ff_model::{Area, BaseKind, Model, Problem, Problems};
use ff_records::file::{DateOrder, Loaded, ReadOptions, StampSource, followers_of, joints_of, read};
use ff_records::{ChannelGroup, Record};
use ffid::workflow::identify::{on_even_clock, segments};
use ident::estimate::smoothed;
use ident::solve::LinearError;
use std::path::Path;

/// Speeds beyond this many times the limit of a joint are not believed.
const TOO_FAST: f64 = 3.0;
/// Beyond this many times, and beyond the range of the joint as well, the unit is another.
const IMPOSSIBLE: f64 = 15.0;

/// What to do with rows that have no number in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Gaps {
    /// Refuse the record.
    Refuse,
    /// Leave the rows out; what is left has a gap.
    Drop,
}

/// Times of the messages of a bag.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Stamps {
    /// Those in the headers, of the sensors; the times of recording where there are none.
    Header,
    /// The times of recording.
    Receive,
}

impl From<Stamps> for StampSource {
    fn from(s: Stamps) -> Self {
        match s {
            Stamps::Header => Self::Header,
            Stamps::Receive => Self::Receive,
        }
    }
}

/// What separates the cells of a CSV file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Separator {
    /// `,`, and numbers have a decimal point.
    Commas,
    /// `;`, and a comma in a number is a decimal comma.
    Semicolons,
    /// A tab, and the same.
    Tabs,
    /// `|`, and the same.
    Bars,
    /// Blanks, and the same.
    Blanks,
}

/// What `3/5/2024` is, where a file does not say it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Dates {
    /// The 3rd of May.
    DayFirst,
    /// The 5th of March.
    MonthFirst,
}

/// What a text calls its columns, and what separates them.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct TextFlags {
    /// What separates the columns of a CSV file; with any but commas, a comma in a number is a decimal comma. Semicolons, tabs and bars are
    /// told by the line of names where the file leaves no doubt.
    #[arg(long, value_enum, default_value_t = Separator::Commas)]
    separator: Separator,
    /// Call a column otherwise, as 'timestamp=time[ns]'; one * stands for any text, as in 'pos_*=q.*[deg]'. May be given several times.
    #[arg(long, value_name = "OLD=NEW", value_parser = renaming)]
    rename: Vec<(String, String)>,
    /// What 3/5/2024 is, where no row of the file settles it.
    #[arg(long, value_enum)]
    dates: Option<Dates>,
}

impl TextFlags {
    /// Into the options of reading.
    pub(crate) fn fill(&self, options: &mut ReadOptions) {
        options.rename.clone_from(&self.rename);
        options.dates = match self.dates {
            None => DateOrder::Unknown,
            Some(Dates::DayFirst) => DateOrder::DayFirst,
            Some(Dates::MonthFirst) => DateOrder::MonthFirst,
        };
        options.separator = match self.separator {
            Separator::Commas => b',',
            Separator::Semicolons => b';',
            Separator::Tabs => b'\t',
            Separator::Bars => b'|',
            Separator::Blanks => b' ',
        };
    }
}

fn renaming(word: &str) -> Result<(String, String), String> {
    let (old, new) = word.split_once('=').ok_or("OLD=NEW is needed, such as 'timestamp=time[ns]'")?;
    let stars = |s: &str| s.matches('*').count();
    if stars(old) > 1 || stars(new) > stars(old) {
        return Err("one * in OLD, and at most one in NEW".to_owned());
    }
    if new.trim().is_empty() {
        return Err("NEW is empty; a column is left out with --ignore".to_owned());
    }
    Ok((old.to_owned(), new.to_owned()))
}

/// How a record is read.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct RecordFlags {
    #[command(flatten)]
    text: TextFlags,
    /// Interpolate jittered samples and gaps of up to 1 % of the record. Without it, samples count at their own times.
    #[arg(long)]
    resample: bool,
    /// Keep single samples that jump out and back, which are otherwise left out and counted.
    #[arg(long)]
    keep_spikes: bool,
    /// Rows with NaN, infinite or empty cells.
    #[arg(long, value_enum, default_value_t = Gaps::Refuse)]
    gaps: Gaps,
    /// Leave out rows that repeat the one before.
    #[arg(long)]
    drop_repeated: bool,
    /// Leave out a column of this name; one * stands for any text. May be given several times.
    #[arg(long, value_name = "COLUMN")]
    ignore: Vec<String>,
    /// A topic of a bag to read; may be given several times.
    #[arg(long, value_name = "TOPIC")]
    topic: Vec<String>,
    /// Times at which messages of a bag count: the stamps in their headers, or the times of recording.
    #[arg(long, value_enum, default_value_t = Stamps::Header)]
    stamps: Stamps,
    /// Leave out what is above this frequency (Hz): positions, torques and equations pass the same filter, which shifts nothing in
    /// time. For logs of an arm on the ground, whose accelerations come from noisy positions; there it is chosen from the log unless
    /// given. `validate` takes that of the identification unless given.
    #[arg(long, value_name = "HZ", value_parser = crate::flags::fit::positive)]
    low_pass: Option<f64>,
    /// Most rows of a record.
    #[arg(long, default_value_t = ReadOptions::default().max_rows)]
    max_rows: usize,
    /// Longest record (bytes).
    #[arg(long, default_value_t = ReadOptions::default().max_bytes)]
    max_bytes: u64,
}

impl RecordFlags {
    /// Reads a record of the robot; `need` is the fewest samples that make sense. Its motion passes the low pass (Hz), if any.
    pub(crate) fn read(
        &self,
        path: &Path,
        model: &Model,
        need: usize,
        low_pass: Option<f64>,
        input: &Input,
    ) -> Result<Loaded, Problems> {
        self.read_leniently(path, model, need, low_pass, &input.leniency())
    }
    /// [`RecordFlags::read`] with other leniency than that of the command line.
    pub(crate) fn read_leniently(
        &self,
        path: &Path,
        model: &Model,
        need: usize,
        low_pass: Option<f64>,
        leniency: &Leniency,
    ) -> Result<Loaded, Problems> {
        let options = self.options(model, need, leniency);
        let mut loaded = believed(read(path, &joints_of(model), &options)?, model, path, leniency)?;
        if let Some(hz) = low_pass {
            loaded.record = filtered(&loaded.record, hz).map_err(|p| p.in_file(path))?;
        }
        Ok(loaded)
    }
    /// How a record of the robot is read.
    pub(crate) fn options(&self, model: &Model, need: usize, leniency: &Leniency) -> ReadOptions {
        let mut options = ReadOptions {
            max_rows: self.max_rows,
            followers: followers_of(model),
            max_bytes: self.max_bytes,
            ignore: self.ignore.clone(),
            drop_gaps: self.gaps == Gaps::Drop,
            drop_repeated: self.drop_repeated,
            fixed_base: model.base_kind() == BaseKind::Fixed,
            resample: self.resample,
            keep_spikes: self.keep_spikes,
            long_gaps: true,
            need_samples: need,
            allow: ALLOWABLE.iter().filter(|c| leniency.allows(c)).map(|c| (*c).to_owned()).collect(),
            topics: self.topic.clone(),
            slides: Vec::new(),
            stamps: self.stamps.into(),
            ..ReadOptions::default()
        };
        self.text.fill(&mut options);
        options
    }
    /// Reads what a model is judged by: the longest part of the record, if it has gaps; on the ground on an even clock. Whether it begins
    /// behind a gap, in the middle of a motion. `unseen` refuses readings that were fitted.
    pub(crate) fn read_one(
        &self,
        path: &Path,
        model: &Model,
        low_pass: Option<f64>,
        input: &Input,
        unseen: impl FnOnce(&Record) -> Result<(), Problems>,
    ) -> Result<(Loaded, bool), Refusal> {
        let mut loaded = self.read(path, model, 8, None, input).map_err(refused)?;
        unseen(&loaded.record).map_err(refused)?;
        let (record, moving) = judged(path, loaded.record, low_pass, &mut loaded.warnings)?;
        loaded.record = record;
        Ok((loaded, moving))
    }
    /// Cutoff of the low pass of the ground calibration (Hz).
    pub(crate) fn low_pass(&self) -> Option<f64> {
        self.low_pass
    }
}

/// What was read, with what is [`plausible`] of it, where `leniency` lets it through.
pub(crate) fn believed(
    mut loaded: Loaded,
    model: &Model,
    path: &Path,
    leniency: &Leniency,
) -> Result<Loaded, Problems> {
    plausible(&loaded.record, model, path, &mut loaded.warnings);
    not_used(&loaded.record, model, path, &mut loaded.warnings);
    leniency.settle(&mut loaded.warnings);
    if loaded.warnings.has_errors() { Err(loaded.warnings) } else { Ok(loaded) }
}

/// Whether a part of a record begins later than the record: in the middle of a motion, so that its initial state is not rest.
pub(crate) fn begins_later(part: &Record, whole: &Record) -> bool {
    part.t0() > whole.t0() + 0.5 * whole.dt()
}

/// The part of a record that a model is judged by: the longest, if it has gaps; on the ground on an even clock. Its motion passes the low
/// pass (Hz), if any. Whether it begins behind a gap, in the middle of a motion.
pub(crate) fn judged(
    path: &Path,
    record: Record,
    low_pass: Option<f64>,
    warnings: &mut Problems,
) -> Result<(Record, bool), Refusal> {
    let label = path.display().to_string();
    let found = segments(&label, &record).map_err(failed)?;
    warnings.extend(found.warnings.clone());
    let longest = found.longest();
    let moving = longest.as_ref().is_some_and(|part| begins_later(part, &record));
    let mut record = longest.unwrap_or(record);
    if record.is_fixed_base() {
        let (even, warned) = on_even_clock(&label, &record).map_err(failed)?;
        record = even;
        warnings.extend(warned);
    }
    if let Some(hz) = low_pass {
        record = filtered(&record, hz).map_err(|p| refused(p.in_file(path)))?;
    }
    Ok((record, moving))
}

/// A record on the ground with filtered motion; its torques are filtered with the equations.
pub(crate) fn filtered(r: &Record, hz: f64) -> Result<Record, Problems> {
    let refused = |what: String, hint: &str| {
        Problems(vec![Problem::error(Area::Config, "Config::LowPass", what).on("--low-pass").hint(hint)])
    };
    if !r.is_fixed_base() {
        let what = "the dynamics of a free-floating robot do not pass a filter unchanged".to_owned();
        return Err(refused(what, "leave --low-pass out; the fit weighs noise by itself"));
    }
    let what = |e: LinearError| format!("{e}; the record has {:.2} s at {} Hz", r.seconds(), r.rate_hz());
    smoothed(r, hz).map_err(|e| refused(what(e), "give another frequency, or leave --low-pass out"))
}

/// Channels that were read and that no model here uses, in one warning.
pub(crate) fn not_used(record: &Record, model: &Model, path: &Path, out: &mut Problems) {
    let ground = model.base_kind() == BaseKind::Fixed;
    let Some(carried) = record.carried() else { return };
    let used: Vec<usize> = carried
        .wrenches()
        .into_iter()
        .filter(|(frame, _)| ground && model.frame(frame).is_some())
        .flat_map(|(_, columns)| columns)
        .collect();
    let rest: Vec<&str> =
        (0..carried.names.len()).filter(|k| !used.contains(k)).map(|k| carried.names[k].as_str()).collect();
    if !rest.is_empty() {
        let what = format!("columns that were read and are not used: {}", list(rest.iter().copied(), 8));
        let hint = "known wrenches count on the ground, at frames of the robot; what else acts belongs into [[input]] of a simulation";
        out.push(Problem::warning(Area::Data, "Data::NotUsed", what).in_file(path).hint(hint));
    }
}

/// Rows D09, D10 and D28: motion and torques beyond what the robot can do.
pub(crate) fn plausible(record: &Record, model: &Model, path: &Path, out: &mut Problems) {
    let mut impossible = Vec::new();
    let mut warn = |code, object: String, what: String, hint: &str| {
        out.push(Problem::warning(Area::Data, code, what).in_file(path).on(object).hint(hint));
    };
    // Of a record that lost samples, what was read in between took longer.
    let times = record.times(ChannelGroup::Motion);
    for (j, b) in model.own_bodies().enumerate() {
        let (name, limits) = (&b.joint.name, &b.joint.limits);
        let q = record.q().column(j);
        let (lo, hi) = (q.min(), q.max());
        if lo < limits.lower || hi > limits.upper {
            let what = format!("from {lo:.4} to {hi:.4}, limits {} .. {}", limits.lower, limits.upper);
            warn("Data::BeyondLimits", format!("q.{name}"), what, "is the position in degrees, or its zero elsewhere?");
        }
        // Over ten samples, so that quantisation does not look like speed.
        let span = 10.min(q.len() - 1).max(1);
        let seconds = |i: usize| times.map_or(span as f64 * record.dt(), |t| t[i] - t[i - span]);
        let speed = (span..q.len()).map(|i| (q[i] - q[i - span]).abs() / seconds(i)).fold(0.0, f64::max);
        if speed > IMPOSSIBLE * limits.velocity && (hi - lo) > limits.upper - limits.lower {
            let what = format!(
                "moves at {speed:.4} per s and from {lo:.4} to {hi:.4}, limits {} per s and {} .. {}",
                limits.velocity, limits.lower, limits.upper
            );
            let p = Problem::error(Area::Data, "Data::LooksLikeDegrees", what).in_file(path).on(format!("q.{name}"));
            impossible.push(
                p.hint("if the column is in degrees, write q.<joint>[deg]; to go on, --allow looks-like-degrees"),
            );
        } else if speed > TOO_FAST * limits.velocity {
            let what = format!(
                "moves at {speed:.4} per s, limit {} per s (ratio {:.1})",
                limits.velocity,
                speed / limits.velocity
            );
            warn(
                "Data::LooksLikeDegrees",
                format!("q.{name}"),
                what,
                "if the column is in degrees, write q.<joint>[deg]",
            );
        }
        let torque = record.tau().column(j).amax();
        if torque > limits.effort && !record.currents().get(j).copied().unwrap_or(false) {
            let what = format!("reaches {torque:.4}, effort limit {}", limits.effort);
            warn(
                "Data::BeyondLimits",
                format!("tau.{name}"),
                what,
                "if the column is in mN m, write tau.<joint>[mN m]",
            );
        }
    }
    out.0.extend(impossible);
}
