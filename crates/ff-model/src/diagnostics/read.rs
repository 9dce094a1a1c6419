//! Reading a whole file with a size limit, so that `/dev/zero` or a 50 GB file is refused and not loaded.

use crate::diagnostics::problem::{Area, Problem, Problems};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The text of a file that a mission file names, of at most `limit` bytes; a byte order mark is dropped. Allocates.
///
/// # Errors
/// One problem with the file's name: `Io::Read` when it cannot be read, `Data::TooLarge` above the limit,
/// `Data::NotUtf8` with the line of the first byte that is not UTF-8.
pub fn text_file(path: &Path, limit: usize) -> Result<String, Problems> {
    let bytes = bytes(path, limit, Area::Data, "Data::TooLarge")?;
    match String::from_utf8(bytes) {
        Ok(s) => Ok(match s.strip_prefix('\u{feff}') {
            Some(rest) => rest.to_owned(),
            None => s,
        }),
        Err(e) => {
            let at = e.utf8_error().valid_up_to();
            let line = 1 + e.as_bytes().iter().take(at).filter(|&&b| b == b'\n').count();
            let p = Problem::error(Area::Data, "Data::NotUtf8", format!("byte {at} is not UTF-8"));
            Err(Problems(vec![p.in_file(path).at_line(line).hint("save the file as UTF-8")]))
        }
    }
}

/// The bytes of a file of at most `limit` bytes.
///
/// # Errors
/// `Io::Read` when it cannot be read; `code` in `area` when it is larger than the limit.
pub(crate) fn bytes(path: &Path, limit: usize, area: Area, code: &'static str) -> Result<Vec<u8>, Problems> {
    let one = |p: Problem| Problems(vec![p]);
    let io = |e: std::io::Error| {
        one(Problem::error(Area::Io, "Io::Read", format!("cannot be read: {e}"))
            .in_file(path)
            .hint("check the path and its permissions"))
    };
    let file = File::open(path).map_err(io)?;
    if file.metadata().map_err(io)?.is_dir() {
        return Err(one(Problem::error(Area::Io, "Io::Read", "is a directory, not a file")
            .in_file(path)
            .hint("name a file in it")));
    }
    let mut out = Vec::new();
    // One byte more than allowed tells "full" from "too large".
    file.take(limit as u64 + 1).read_to_end(&mut out).map_err(io)?;
    if out.len() > limit {
        return Err(one(Problem::error(area, code, format!("more than {limit} bytes, the limit"))
            .in_file(path)
            .hint("split the file")));
    }
    Ok(out)
}
