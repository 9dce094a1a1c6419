//! Which format a file has, and its reader.

use super::blocks::{Blocks, unreadable};
use super::csv_blocks::CsvBlocks;
use super::lines::{BUFFER, Lines, header, too_long};
use super::wide::Text;
use super::{JointColumn, ReadOptions};
use ff_model::{Area, Problem, Problems};
use std::fs::File;
use std::io;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Formats of records, told apart by their first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text: everything that is none of the others.
    Csv,
    /// Apache Parquet.
    Parquet,
    /// MCAP, as ROS 2 bags are.
    Mcap,
    /// A bag of ROS 1.
    Rosbag,
}

impl Format {
    /// The format of a file that begins with these bytes.
    pub fn of(first: &[u8]) -> Self {
        if first.starts_with(b"PAR1") {
            Self::Parquet
        } else if first.starts_with(b"\x89MCAP0\r\n") {
            Self::Mcap
        } else if first.starts_with(b"#ROSBAG ") {
            Self::Rosbag
        } else {
            Self::Csv
        }
    }
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Csv => "CSV",
            Self::Parquet => "Parquet",
            Self::Mcap => "MCAP",
            Self::Rosbag => "ROS 1 bag",
        }
    }
}

/// Files that are no records, by their first bytes: what they are, and what to do.
fn foreign(first: &[u8]) -> Option<(&'static str, &'static str)> {
    const KNOWN: [(&[u8], &str, &str); 8] = [
        (b"\x1f\x8b", "compressed by gzip", "unpack it with gunzip -k"),
        (b"BZh", "compressed by bzip2", "unpack it with bunzip2 -k"),
        (b"\xfd7zXZ", "compressed by xz", "unpack it with unxz -k"),
        (b"\x28\xb5\x2f\xfd", "compressed by zstd", "unpack it with unzstd"),
        (b"PK\x03\x04", "a zip archive or a workbook", "unpack it, or save the sheet as CSV"),
        (b"SQLite format 3", "a ROS 2 bag in SQLite", "convert it to MCAP with ros2 bag convert"),
        (b"\x89HDF", "HDF5", "write its arrays as CSV or Parquet"),
        (b"MATLAB 5.0", "a MAT file", "write its arrays as CSV with writetable"),
    ];
    KNOWN.into_iter().find(|k| first.starts_with(k.0)).map(|k| (k.1, k.2))
}

/// A file that may be read, at its start, with its format.
///
/// # Errors
/// `Io::Read`; `Data::TooLarge` by its length, before anything is read; `Data::Format` for archives and formats of others.
pub(super) fn opened(path: &Path, options: &ReadOptions) -> Result<(File, Format), Problems> {
    let io = |e: io::Error| {
        let p = Problem::error(Area::Io, "Io::Read", format!("cannot be read: {e}"));
        Problems(vec![p.in_file(path).hint("check the path and its permissions")])
    };
    let mut file = File::open(path).map_err(io)?;
    let meta = file.metadata().map_err(io)?;
    if meta.is_dir() {
        return Err(io(io::Error::new(io::ErrorKind::IsADirectory, "is a folder")));
    }
    // A pipe has no length and cannot go back, and is text.
    if !meta.is_file() {
        return Ok((file, Format::Csv));
    }
    if meta.len() > options.max_bytes {
        return Err(Problems(vec![too_long(meta.len(), options.max_bytes)]).in_file(path));
    }
    let mut first = Vec::with_capacity(16);
    (&file).take(16).read_to_end(&mut first).map_err(io)?;
    if let Some((what, hint)) = foreign(&first) {
        return Err(unreadable("Data::Format", what, hint).in_file(path));
    }
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    Ok((file, Format::of(&first)))
}

/// Opens a record of any format for reading in blocks. `joints` tells joints that slide, where the file does not.
///
/// # Errors
/// `Io::Read`, `Data::TooLarge`, `Data::NoReader` for a format that this build leaves out, and those of the header.
pub fn open(path: &Path, joints: &[JointColumn], options: &ReadOptions) -> Result<(Format, Box<dyn Blocks>), Problems> {
    let (file, format) = opened(path, options)?;
    Ok((format, blocks(file, format, joints, options).map_err(|p| p.in_file(path))?))
}

/// Names of columns as they stand in a file; `None` where it has none, or they cannot be read.
pub(super) fn raw_names(path: &Path, options: &ReadOptions) -> Option<Vec<String>> {
    let (file, format) = opened(path, options).ok()?;
    match format {
        Format::Csv => {
            let options = ReadOptions { rename: Vec::new(), ..options.clone() };
            let mut lines = Lines::new(BufReader::with_capacity(BUFFER, Text::new(file)), &options);
            header(&mut lines, &options, &mut Problems::default()).map(|h| h.raw)
        }
        #[cfg(feature = "parquet")]
        Format::Parquet => super::parquet_in::ParquetBlocks::raw_names(file).ok(),
        _ => None,
    }
}

/// The reader of a file at its start.
#[cfg_attr(
    not(any(feature = "mcap", feature = "rosbag")),
    expect(unused_variables, reason = "sliding joints are asked for by bags")
)]
pub(super) fn blocks(
    file: File,
    format: Format,
    joints: &[JointColumn],
    options: &ReadOptions,
) -> Result<Box<dyn Blocks>, Problems> {
    if !(options.rename.is_empty() || options.one_of_several || matches!(format, Format::Csv | Format::Parquet)) {
        let what = "--rename changes names of columns, and a bag has none";
        return Err(unreadable(
            "Data::Columns",
            what,
            "convert it first, and give --rename with the file that was written",
        ));
    }
    match format {
        Format::Csv => Ok(Box::new(CsvBlocks::new(file, options)?)),
        #[cfg(feature = "parquet")]
        Format::Parquet => Ok(Box::new(super::parquet_in::ParquetBlocks::new(file, options)?)),
        #[cfg(feature = "mcap")]
        Format::Mcap => {
            let bag = super::bag::mcap::Mcap::new(file)?;
            Ok(Box::new(super::bag::BagBlocks::new(bag, joints, options)?))
        }
        #[cfg(feature = "rosbag")]
        Format::Rosbag => {
            let bag = super::bag::rosbag::Rosbag::new(file)?;
            Ok(Box::new(super::bag::BagBlocks::new(bag, joints, options)?))
        }
        #[allow(unreachable_patterns)] // with all features there is nothing left
        other => {
            let what = format!("a {} file, which this build does not read", other.name());
            Err(unreadable("Data::NoReader", what, "build with the feature of this format, or convert it to CSV"))
        }
    }
}
