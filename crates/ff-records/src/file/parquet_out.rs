//! Writing Parquet: flat columns of doubles, block after block.

use super::blocks::{Block, Stamps};
use super::columns::time_column;
use super::naming::split;
use parquet::basic::{Compression, Encoding, Repetition, Type as Physical};
use parquet::data_type::{DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::io;
use std::io::Write;
use std::sync::Arc;

/// Rows of a row group: a reader holds one page of each column, so this bounds no memory but that of the writer.
const GROUP: usize = 1 << 17;

/// Writes a record as Parquet. The unit of a column is in its name (`q.joint1[rad]`) and, for programs that read metadata, in
/// the key `unit.q.joint1[rad]` of the file.
pub struct ParquetWriter<W: Write + Send> {
    file: SerializedFileWriter<W>,
    /// Column of the time in a block; `None` when the table has no stamps of its own.
    time: Option<usize>,
    whole: bool,
    waiting: Block,
}

impl<W: Write + Send> std::fmt::Debug for ParquetWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ParquetWriter").field("time", &self.time).finish_non_exhaustive()
    }
}

impl<W: Write + Send> ParquetWriter<W> {
    /// Begins a file of columns with these names (`name[unit]`), time among them or not; `whole` for time stamps that are whole
    /// numbers.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(out: W, names: &[String], whole: bool) -> io::Result<Self> {
        let time = time_column(names).ok();
        let column = |(k, name): (usize, &String)| {
            let physical = if whole && Some(k) == time { Physical::INT64 } else { Physical::DOUBLE };
            Type::primitive_type_builder(name, physical).with_repetition(Repetition::REQUIRED).build().map(Arc::new)
        };
        let fields = names.iter().enumerate().map(column).collect::<Result<Vec<_>, _>>().map_err(io::Error::other)?;
        let schema = Type::group_type_builder("record").with_fields(fields).build().map_err(io::Error::other)?;
        let unit = |n: &String| split(n).1.map(|u| KeyValue::new(format!("unit.{n}"), u.to_owned()));
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_encoding(Encoding::PLAIN)
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::None)
            .set_created_by(concat!("ffid ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_key_value_metadata(Some(names.iter().filter_map(unit).collect()))
            .build();
        let file = SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties)).map_err(io::Error::other)?;
        let mut waiting = Block::new(names.len());
        if whole {
            waiting.stamps = Stamps::Whole(Vec::new());
        }
        Ok(Self { file, time, whole, waiting })
    }
    /// Adds rows. The block has a column per name; that of the time is in its stamps.
    ///
    /// # Errors
    /// Those of `out`; [`io::ErrorKind::InvalidData`] for a block of another shape.
    pub fn write(&mut self, block: &Block) -> io::Result<()> {
        let n = block.rows();
        let w = &mut self.waiting;
        let shaped = |(k, c): (usize, &Vec<f64>)| Some(k) == self.time || c.len() == n;
        if block.columns.len() != w.columns.len() || !block.columns.iter().enumerate().all(shaped) {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "a block of another shape"));
        }
        match (&mut w.stamps, &block.stamps) {
            (Stamps::Whole(to), Stamps::Whole(from)) => to.extend_from_slice(from),
            (Stamps::Real(to), Stamps::Real(from)) => to.extend_from_slice(from),
            _ if n == 0 => {}
            _ => return Err(io::Error::new(io::ErrorKind::InvalidData, "stamps of two kinds")),
        }
        w.columns.iter_mut().zip(&block.columns).for_each(|(to, from)| to.extend_from_slice(from));
        if self.waiting.rows() >= GROUP { self.flush() } else { Ok(()) }
    }
    /// Writes the rows that wait as a row group.
    fn flush(&mut self) -> io::Result<()> {
        let mut group = self.file.next_row_group().map_err(io::Error::other)?;
        let mut k = 0;
        while let Some(mut column) = group.next_column().map_err(io::Error::other)? {
            let done = match (&self.waiting.stamps, self.time == Some(k)) {
                (Stamps::Whole(v), true) => column.typed::<Int64Type>().write_batch(v, None, None),
                (Stamps::Real(v), true) if !self.whole => column.typed::<DoubleType>().write_batch(v, None, None),
                _ => column.typed::<DoubleType>().write_batch(&self.waiting.columns[k], None, None),
            };
            done.map_err(io::Error::other)?;
            column.close().map_err(io::Error::other)?;
            k += 1;
        }
        group.close().map_err(io::Error::other)?;
        self.waiting.clear();
        Ok(())
    }
    /// Ends the file and gives back what it was written to.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn finish(mut self) -> io::Result<W> {
        if self.waiting.rows() > 0 {
            self.flush()?;
        }
        self.file.into_inner().map_err(io::Error::other)
    }
}
/// A column of [`write_table`].
#[derive(Clone, Debug, PartialEq)]
pub enum TableColumn {
    /// Whole numbers.
    Whole(Vec<i64>),
    /// Numbers, with their SI unit (`1` for pure numbers).
    Real(Vec<f64>, String),
}

/// Writes a table of named columns of equal length; units go to the metadata of the file as `unit.<name>`.
///
/// # Errors
/// Those of `out`; [`io::ErrorKind::InvalidData`] for columns of unequal length.
pub fn write_table<W: Write + Send>(out: W, columns: &[(String, TableColumn)]) -> io::Result<W> {
    let rows = |c: &TableColumn| match c {
        TableColumn::Whole(v) => v.len(),
        TableColumn::Real(v, _) => v.len(),
    };
    if columns.iter().any(|(_, c)| rows(c) != rows(&columns[0].1)) {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "columns of unequal length"));
    }
    let field = |(name, c): &(String, TableColumn)| {
        let physical = if matches!(c, TableColumn::Whole(_)) { Physical::INT64 } else { Physical::DOUBLE };
        Type::primitive_type_builder(name, physical).with_repetition(Repetition::REQUIRED).build().map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<Result<Vec<_>, _>>().map_err(io::Error::other)?;
    let schema = Type::group_type_builder("table").with_fields(fields).build().map_err(io::Error::other)?;
    let unit = |(name, c): &(String, TableColumn)| match c {
        TableColumn::Whole(_) => None,
        TableColumn::Real(_, unit) => Some(KeyValue::new(format!("unit.{name}"), unit.clone())),
    };
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(concat!("ffid ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(columns.iter().filter_map(unit).collect()))
        .build();
    let mut file = SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties)).map_err(io::Error::other)?;
    let mut group = file.next_row_group().map_err(io::Error::other)?;
    for (_, c) in columns {
        let Some(mut to) = group.next_column().map_err(io::Error::other)? else { break };
        match c {
            TableColumn::Whole(v) => to.typed::<Int64Type>().write_batch(v, None, None),
            TableColumn::Real(v, _) => to.typed::<DoubleType>().write_batch(v, None, None),
        }
        .map_err(io::Error::other)?;
        to.close().map_err(io::Error::other)?;
    }
    group.close().map_err(io::Error::other)?;
    file.into_inner().map_err(io::Error::other)
}
