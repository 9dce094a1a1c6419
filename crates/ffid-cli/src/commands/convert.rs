//! `ffid convert`: a record from one format to another, block by block in memory of fixed size.

use crate::flags::record::TextFlags;
use crate::output::{Input, Outcome};
use crate::results;
use crate::results::{Refusal, refused};
use ff_model::diagnostics::{clip, list};
use ff_model::{Area, Problem, Problems};
use ff_records::file::units;
use ff_records::file::units::Unit;
use ff_records::file::{
    Block, CsvRows, Format, JointColumn, ParquetWriter, ReadOptions, Stamps, ignores, is_nameless, name_and_unit, open,
    open_together, without_name,
};
use ffid::exit::Failure;
use ffid::files::atomic;
use ffid::files::folder::Entry;
use serde::Serialize;
use std::fmt;
use std::fmt::Display;
use std::fs::File;
use std::io;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid convert rec.csv rec.parquet              names, units and every bit of the numbers stay
  ffid convert rec.parquet rec.csv --si         degrees, milliseconds and the like become SI
  ffid convert log.csv rec.csv --separator semicolons --rename 'stamp=time[ms]' --rename 'pos_*=q.*[deg]'
  ffid convert joints.csv rec.csv --with gyro.csv    one record of two recorders that share a clock
  ffid convert flight.mcap rec.parquet --topic /arm/joint_states --topic /bus/imu

The format of IN is that of its first bytes, the one of OUT that of its name (.csv or .parquet). A bag is read on the clock of its
joint states, the base sensors interpolated between their samples (docs/records.md).";

/// Arguments of `ffid convert`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// The record to write: .csv or .parquet.
    out: PathBuf,
    /// Another file of the same motion, with stamps of the same clock: rows of both in the order of their time, empty cells where one has no
    /// sample; may be given several times.
    #[arg(long, value_name = "FILE")]
    with: Vec<PathBuf>,
    /// Convert every column to its SI unit; whole numbers of time stay as they are.
    #[arg(long)]
    si: bool,
    #[command(flatten)]
    text: TextFlags,
    /// Leave out a column of this name; one * stands for any text. May be given several times.
    #[arg(long, value_name = "COLUMN")]
    ignore: Vec<String>,
    /// A topic of a bag; may be given several times.
    #[arg(long, value_name = "TOPIC")]
    topic: Vec<String>,
    /// A joint of a bag that slides: its columns are in m and N.
    #[arg(long, value_name = "JOINT")]
    slides: Vec<String>,
    /// Longest file read (bytes).
    #[arg(long, default_value_t = ReadOptions::default().max_bytes)]
    max_bytes: u64,
    /// Replace an existing file.
    #[arg(long)]
    force: bool,
    /// Print problems only.
    #[arg(long)]
    quiet: bool,
}

/// What was written.
#[derive(Serialize)]
struct Converted {
    from: &'static str,
    to: &'static str,
    out: PathBuf,
    rows: u64,
    columns: Vec<String>,
    bytes_read: u64,
    bytes_written: u64,
    sha256: String,
}

impl Display for Converted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = list(self.columns.iter().map(String::as_str), 8);
        writeln!(
            f,
            "{}: {} rows of {} columns, {} to {}",
            self.out.display(),
            self.rows,
            self.columns.len(),
            self.from,
            self.to
        )?;
        writeln!(f, "  {names}")
    }
}

/// Converts and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    args.input.print_done("converted", work(args), args.quiet, out, err)
}

/// A column as it is written.
struct Column {
    name: String,
    /// Place in the file read.
    from: usize,
    /// Unit that is left behind; `None` to take numbers as they are.
    unit: Option<&'static Unit>,
    time: bool,
}

fn work(args: &Args) -> Result<(Converted, Problems), Refusal> {
    let io = |e: Failure| results::io_hint(e, "OUT");
    let to = match args.out.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("csv") => Format::Csv,
        Some("parquet") => Format::Parquet,
        _ => {
            let what = format!("'{}' ends neither with .csv nor with .parquet", args.out.display());
            let p = Problem::error(Area::Config, "Config::BadChoice", what).hint("name the file to write so");
            return Err(refused(Problems(vec![p])));
        }
    };
    if args.out.exists() && !args.force {
        return Err(io(Failure::Exists { path: args.out.clone() }));
    }
    let joints: Vec<JointColumn> = Vec::new();
    let mut options = ReadOptions {
        max_bytes: args.max_bytes,
        topics: args.topic.clone(),
        slides: args.slides.clone(),
        ..ReadOptions::default()
    };
    args.text.fill(&mut options);
    let file = &args.input.file;
    let (from, mut source) = if args.with.is_empty() {
        let (format, source) = open(file, &joints, &options).map_err(refused)?;
        (format.name(), source)
    } else {
        let all: Vec<&Path> = [file].into_iter().chain(&args.with).map(PathBuf::as_path).collect();
        ("several files", open_together(&all, &joints, &options).map_err(refused)?)
    };
    let named = |p: Problems| p.in_file(file);
    let columns = columns(source.names(), args).map_err(|p| refused(named(p)))?;
    let nameless = without_name(source.names()).map(|p| Problems(vec![p.at_line(1)]));
    let mut wanted = vec![false; source.names().len()];
    columns.iter().for_each(|c| wanted[c.from] = true);
    source.want(&wanted);
    let leniency = args.input.leniency();
    let mut problems = nameless.map(named).unwrap_or_default();
    let mut rows = 0;
    // A problem of the data ends the writing; what was there before stays.
    let mut wrong = None;
    let written = atomic::stream(&args.out, |f| {
        let mut sink = Sink::new(to, columns.iter().map(|c| c.name.clone()).collect(), f);
        let mut block = Block::new(wanted.len());
        loop {
            match source.next(&mut block) {
                Ok(true) => {}
                Ok(false) => break,
                // What is complete of a bag that is cut short, when that is allowed.
                Err(p) if p.0.iter().all(|p| leniency.allows(p.code)) => {
                    problems.extend(named(p));
                    break;
                }
                Err(p) => {
                    wrong = Some(p);
                    return Err(io::Error::other("the record cannot be read"));
                }
            }
            rows += block.rows() as u64;
            sink.take(&columns, &mut block)?;
        }
        sink.finish()
    });
    if let Some(p) = wrong {
        let mut p = named(p);
        p.extend(named(source.notes()));
        return Err(refused(p));
    }
    written.map_err(io)?;
    problems.extend(named(source.notes()));
    leniency.settle(&mut problems);
    let entry = Entry::of(&args.out, "").map_err(io)?;
    let done = Converted {
        from,
        to: to.name(),
        out: args.out.clone(),
        rows,
        columns: columns.into_iter().map(|c| c.name).collect(),
        bytes_read: source.bytes(),
        bytes_written: entry.bytes,
        sha256: entry.sha256,
    };
    Ok((done, problems))
}

/// Which columns are written, under which names; every one must have a unit that is known.
fn columns(names: &[String], args: &Args) -> Result<Vec<Column>, Problems> {
    let (mut out, mut bad) = (Vec::new(), Problems::default());
    for (from, cell) in names.iter().enumerate() {
        let (name, symbol) = name_and_unit(cell);
        if ignores(&args.ignore, cell) || is_nameless(cell) {
            continue;
        }
        let fail = |code, what: String, hint: &str| Problem::error(Area::Data, code, what).on(clip(name)).hint(hint);
        let time = name == "time";
        let Some(symbol) = symbol else {
            let what = format!("column '{}' has no unit", clip(cell));
            bad.push(fail(
                "Data::UnitMissing",
                what,
                "write NAME[UNIT], or give it one with --rename, or leave it out with --ignore",
            ));
            continue;
        };
        let Some(unit) = units::any(symbol) else {
            let what = format!("unit [{}] of column '{}' is not known", clip(symbol), clip(name));
            bad.push(fail("Data::UnknownUnit", what, "docs/records.md lists the units; or --ignore the column"));
            continue;
        };
        let si = units::si(unit.dimension);
        // Whether stamps are whole is known with the first block only: their name stays.
        let convert = args.si && !time && unit.symbol != si;
        let name = if convert { format!("{name}[{si}]") } else { cell.clone() };
        out.push(Column { name, from, unit: convert.then_some(unit), time });
    }
    if bad.has_errors() { Err(bad) } else { Ok(out) }
}

/// What is written, once the first block says how its stamps are kept.
enum Sink<'f> {
    New(Format, Vec<String>, BufWriter<&'f mut File>),
    Csv(CsvRows<BufWriter<&'f mut File>>),
    Parquet(Box<ParquetWriter<BufWriter<&'f mut File>>>),
    Gone,
}

impl<'f> Sink<'f> {
    fn new(format: Format, names: Vec<String>, file: &'f mut File) -> Self {
        Self::New(format, names, BufWriter::with_capacity(1 << 20, file))
    }
    fn begin(&mut self, whole: bool) -> io::Result<()> {
        *self = match std::mem::replace(self, Self::Gone) {
            Self::New(Format::Parquet, names, w) => Self::Parquet(Box::new(ParquetWriter::new(w, &names, whole)?)),
            Self::New(_, names, w) => Self::Csv(CsvRows::new(w, &names)?),
            other => other,
        };
        Ok(())
    }
    fn take(&mut self, columns: &[Column], block: &mut Block) -> io::Result<()> {
        self.begin(matches!(block.stamps, Stamps::Whole(_)))?;
        let mut out = Block::new(columns.len());
        std::mem::swap(&mut out.stamps, &mut block.stamps);
        for (to, c) in out.columns.iter_mut().zip(columns).filter(|(_, c)| !c.time) {
            std::mem::swap(to, &mut block.columns[c.from]);
            if let Some(u) = c.unit {
                to.iter_mut().for_each(|x| *x = u.to_si(*x));
            }
        }
        match self {
            Self::Csv(w) => w.write(&out)?,
            Self::Parquet(w) => w.write(&out)?,
            _ => {}
        }
        // The buffers go back to be filled again.
        std::mem::swap(&mut out.stamps, &mut block.stamps);
        for (to, c) in out.columns.iter_mut().zip(columns).filter(|(_, c)| !c.time) {
            std::mem::swap(to, &mut block.columns[c.from]);
        }
        Ok(())
    }
    fn finish(mut self) -> io::Result<()> {
        self.begin(false)?;
        match self {
            Self::Csv(w) => w.finish()?.flush(),
            Self::Parquet(w) => w.finish()?.flush(),
            _ => Ok(()),
        }
    }
}
