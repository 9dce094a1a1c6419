//! Parquet files, one row group after the other, through the column readers of the `parquet` crate (its `arrow` part would
//! double the build). Columns hold one number a row; what the crate cannot cope with is an error here, never a panic.

use super::blocks::{BLOCK, Block, Blocks, unreadable};
use super::columns::time_column;
use super::heading::{rename, tell_time, told_time};
use super::naming::split;
use super::parquet_values::{Buffers, Kind, numbers, stamps};
use super::{ReadOptions, over};
use bytes::Bytes;
use ff_model::diagnostics::clip;
use ff_model::{Area, Problem, Problems};
use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, TimeUnit, Type};
use parquet::column::reader::ColumnReader;
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::reader::{ChunkReader, FileReader, Length, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Most columns of a file.
const MAX_COLUMNS: usize = 10_000;

/// A file whose declared lengths are checked before memory is taken for them.
struct Guarded {
    file: File,
    len: u64,
}

impl Length for Guarded {
    fn len(&self) -> u64 {
        self.len
    }
}

impl ChunkReader for Guarded {
    type T = BufReader<File>;

    fn get_read(&self, start: u64) -> ParquetResult<Self::T> {
        let mut file = self.file.try_clone()?;
        file.seek(SeekFrom::Start(start))?;
        Ok(BufReader::with_capacity(1 << 16, file))
    }
    fn get_bytes(&self, start: u64, length: usize) -> ParquetResult<Bytes> {
        if start.checked_add(length as u64).is_none_or(|end| end > self.len) {
            let what = format!("{length} bytes at {start} are asked for, the file has {}", self.len);
            return Err(ParquetError::EOF(what));
        }
        let mut out = vec![0; length];
        let mut file = self.file.try_clone()?;
        file.seek(SeekFrom::Start(start))?;
        file.read_exact(&mut out)?;
        Ok(out.into())
    }
}

/// Runs a part of the parquet crate; a panic of it becomes an error.
fn guard<V>(f: impl FnOnce() -> ParquetResult<V>) -> Result<V, Problems> {
    let hint = "write the file again; it may be cut short or damaged";
    match catch_unwind(AssertUnwindSafe(f)) {
        Ok(Ok(v)) => Ok(v),
        Ok(Err(e)) => Err(unreadable("Data::Parquet", clip(&e.to_string().replace('\n', " ")), hint)),
        Err(_) => Err(unreadable("Data::Parquet", "the reader gave up on this file", hint)),
    }
}

pub(super) struct ParquetBlocks {
    reader: SerializedFileReader<Guarded>,
    names: Vec<String>,
    wanted: Vec<bool>,
    time: usize,
    /// Row group that is read next.
    group: usize,
    /// Readers of the columns of the present row group; `None` for those that are not wanted.
    open: Vec<Option<ColumnReader>>,
    /// Rows of the present row group that are left.
    left: usize,
    buffers: Buffers,
    len: u64,
    /// What was understood of the names.
    notes: Problems,
}

impl ParquetBlocks {
    /// With names changed by the rules of the options ([`rename`]).
    pub(super) fn new(file: File, options: &ReadOptions) -> Result<Self, Problems> {
        let mut table = Self::table(file)?;
        let mut bad = Problems::default();
        if !rename(&mut table.names, &options.rename, &mut bad) && !options.one_of_several {
            return Err(bad);
        }
        let before = table.names.clone();
        if let (dates, Some(place)) = tell_time(&mut table.names, None) {
            table.notes.0.extend(told_time(&before[place], &table.names[place], dates, None));
        }
        let time = time_column(&table.names).map_err(|p| Problems(vec![*p]))?;
        Ok(Self { time, ..table })
    }
    /// Names of columns as they stand in the file.
    pub(super) fn raw_names(file: File) -> Result<Vec<String>, Problems> {
        Ok(Self::table(file)?.names)
    }
    /// Of a table without time stamps.
    fn table(file: File) -> Result<Self, Problems> {
        let len = file.metadata().map_or(0, |m| m.len());
        let reader = guard(|| SerializedFileReader::new(Guarded { file, len }))?;
        let meta = reader.metadata().file_metadata();
        let columns = meta.schema_descr().columns();
        if columns.len() > MAX_COLUMNS {
            let p = over(columns.len() as f64, MAX_COLUMNS as f64, "columns");
            return Err(Problems(vec![p.hint("is this a record?")]));
        }
        let units = meta.key_value_metadata();
        let unit_of = |name: &str| {
            let key = format!("unit.{name}");
            units?.iter().find(|kv| kv.key == key)?.value.clone()
        };
        let mut names = Vec::with_capacity(columns.len());
        for c in columns {
            let name = c.path().string();
            let full = match (split(&name).1, unit_of(&name), stamp_unit(c)) {
                (Some(_), ..) => name,
                (None, Some(u), _) => format!("{name}[{u}]"),
                (None, None, Some(u)) => format!("{name}[{u}]"),
                (None, None, None) => name,
            };
            names.push(full);
        }
        let (time, wanted) = (usize::MAX, vec![true; names.len()]);
        let (open, buffers, notes) = (Vec::new(), Buffers::default(), Problems::default());
        Ok(Self { reader, names, wanted, time, group: 0, open, left: 0, buffers, len, notes })
    }
    /// Rows of the whole file, by its footer.
    fn declared(&self) -> u64 {
        u64::try_from(self.reader.metadata().file_metadata().num_rows()).unwrap_or(0)
    }
    /// Opens the next row group that has rows; false behind the last.
    fn advance(&mut self) -> Result<bool, Problems> {
        while self.left == 0 {
            if self.group == self.reader.num_row_groups() {
                return Ok(false);
            }
            let (group, wanted, reader) = (self.group, &self.wanted, &self.reader);
            let (open, rows) = guard(|| {
                let g = reader.get_row_group(group)?;
                let open = (0..wanted.len()).map(|k| wanted[k].then(|| g.get_column_reader(k)).transpose());
                Ok((open.collect::<ParquetResult<Vec<_>>>()?, g.metadata().num_rows()))
            })?;
            self.open = open;
            self.left = usize::try_from(rows).unwrap_or(0);
            self.group += 1;
        }
        Ok(true)
    }
}

/// Reads a table of numbers from a Parquet file, such as [`super::write_table`] writes: columns in order, each with its name. NaN where there
/// is no number. Allocates.
///
/// # Errors
/// `Io::Read`; `Data::Parquet` and `Data::BadNumber` for what is no such table.
pub fn read_table(path: &Path) -> Result<Vec<(String, Vec<f64>)>, Problems> {
    let read = || -> Result<Vec<(String, Vec<f64>)>, Problems> {
        let file = File::open(path).map_err(|e| {
            let p = Problem::error(Area::Io, "Io::Read", format!("cannot be read: {e}"));
            Problems(vec![p.hint("check the path and its permissions")])
        })?;
        let mut source = ParquetBlocks::table(file)?;
        let mut all = vec![Vec::new(); source.names.len()];
        let mut block = Block::new(all.len());
        while source.next(&mut block)? {
            all.iter_mut().zip(&block.columns).for_each(|(to, from)| to.extend_from_slice(from));
        }
        let schema = source.reader.metadata().file_metadata().schema_descr_ptr();
        Ok(schema.columns().iter().map(|c| c.path().string()).zip(all).collect())
    };
    read().map_err(|p| p.in_file(path))
}

/// The unit that the type of a column says, for time stamps of other programs.
fn stamp_unit(c: &ColumnDescriptor) -> Option<&'static str> {
    let of = |unit: &TimeUnit| match unit {
        TimeUnit::MILLIS => "ms",
        TimeUnit::MICROS => "us",
        TimeUnit::NANOS => "ns",
    };
    match (c.logical_type_ref(), c.converted_type()) {
        (Some(LogicalType::Timestamp(t)), _) => Some(of(&t.unit)),
        (Some(LogicalType::Time(t)), _) => Some(of(&t.unit)),
        (_, ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS) => Some("ms"),
        (_, ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS) => Some("us"),
        // Spark and older writers of pandas; nothing but time is of this type.
        _ if c.physical_type() == Type::INT96 => Some("ns"),
        _ => None,
    }
}

impl Blocks for ParquetBlocks {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn want(&mut self, wanted: &[bool]) {
        self.wanted = wanted.to_vec();
    }
    fn next(&mut self, out: &mut Block) -> Result<bool, Problems> {
        out.clear();
        if self.group == 0 {
            self.judge()?;
        }
        if !self.advance()? {
            return Ok(false);
        }
        let rows = self.left.min(BLOCK);
        let schema = self.reader.metadata().file_metadata().schema_descr_ptr();
        let (open, buffers, names, time) = (&mut self.open, &mut self.buffers, &self.names, self.time);
        for (k, reader) in open.iter_mut().enumerate() {
            let Some(reader) = reader else { continue };
            let column = schema.column(k);
            let (full, kind) = (column.max_def_level(), Kind::of(&column).unwrap_or_default());
            let n = guard(|| {
                if k == time {
                    stamps(reader, (full, kind), rows, buffers, &mut out.stamps)
                } else {
                    numbers(reader, (full, kind), rows, buffers, &mut out.columns[k])
                }
            })
            .map_err(|mut p| {
                p.0.iter_mut().for_each(|p| p.object = Some(clip(&names[k])));
                p
            })?;
            if n < rows || (k != time && out.columns[k].len() != rows) || (k == time && out.stamps.len() != rows) {
                let what = format!("column '{}' ends after {n} of {rows} rows of its row group", clip(&names[k]));
                return Err(unreadable("Data::Parquet", what, "write the file again; it may be damaged"));
            }
        }
        self.left -= rows;
        Ok(true)
    }
    fn bytes(&self) -> u64 {
        self.len
    }
    fn declared_rows(&self) -> Option<u64> {
        Some(self.declared())
    }
    fn notes(&self) -> Problems {
        self.notes.clone()
    }
}

impl ParquetBlocks {
    /// Columns that are wanted must hold one number a row, in a compression that is read.
    fn judge(&self) -> Result<(), Problems> {
        let mut bad = Problems::default();
        let meta = self.reader.metadata();
        let schema = meta.file_metadata().schema_descr();
        for (k, c) in schema.columns().iter().enumerate().filter(|(k, _)| self.wanted[*k]) {
            let info = c.self_type().get_basic_info();
            let several = c.max_rep_level() > 0 || info.has_repetition() && info.repetition() == Repetition::REPEATED;
            if several {
                let what = format!("column '{}' holds a list in every row", clip(&self.names[k]));
                bad.extend(unreadable(
                    "Data::BadNumber",
                    what,
                    "write every element as a column of its own, or --ignore it",
                ));
            } else if Kind::of(c).is_none() {
                let what = format!("column '{}' holds {}", clip(&self.names[k]), holds(c));
                bad.extend(unreadable("Data::BadNumber", what, "write it as a column of doubles, or --ignore it"));
            }
        }
        let codecs = meta.row_groups().first().map_or(&[][..], |g| g.columns()).iter().map(|c| c.compression());
        let unread = |c: &Compression| matches!(c, Compression::BROTLI(_) | Compression::LZO);
        if let Some(codec) = codecs.zip(&self.wanted).filter(|(_, w)| **w).map(|(c, _)| c).find(unread) {
            let name = if codec == Compression::LZO { "lzo" } else { "brotli" };
            let what = format!("columns are compressed by {name}, which is not read here");
            let hint = "write the file with compression zstd, snappy, gzip, lz4 or none, as pyarrow.parquet.write_table(..., compression='zstd')";
            bad.extend(unreadable("Data::Format", what, hint));
        }
        if bad.has_errors() { Err(bad) } else { Ok(()) }
    }
}

/// What a column without numbers holds, in words.
fn holds(c: &ColumnDescriptor) -> String {
    match (c.logical_type_ref(), c.physical_type()) {
        (Some(LogicalType::Float16), _) => "16-bit floats".to_owned(),
        (_, Type::BOOLEAN) => "true or false".to_owned(),
        (_, Type::BYTE_ARRAY) => "text or bytes".to_owned(),
        (_, t) => format!("{t:?}"),
    }
}
