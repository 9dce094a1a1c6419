//! Time series and spectra as CSV: one `name[unit]` column each, every number read back exactly.

use crate::exit::Failure;
use crate::files::atomic;
use std::path::Path;

/// One column of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Column<'a> {
    /// Name, such as `tau_j2`.
    pub name: String,
    /// SI unit, such as `N m`; `1` for a pure number.
    pub unit: &'static str,
    /// Values, one per row.
    pub values: &'a [f64],
}

impl<'a> Column<'a> {
    /// A column.
    pub fn new(name: impl Into<String>, unit: &'static str, values: &'a [f64]) -> Self {
        Self { name: name.into(), unit, values }
    }
    /// The header cell, `name[unit]`.
    pub fn header(&self) -> String {
        format!("{}[{}]", self.name, self.unit)
    }
}

/// Writes columns of equal length, atomically.
///
/// Numbers are printed with Rust's shortest form, which reads back to the same bits.
///
/// # Errors
/// [`Failure::Length`] for unequal columns, [`Failure::NotFinite`] naming column and row, [`Failure::Io`].
pub fn write(path: &Path, columns: &[Column<'_>]) -> Result<(), Failure> {
    checked(path, columns, f64::is_finite)
}

/// [`write()`] of readings that some rows do not have: NaN is an empty cell.
///
/// # Errors
/// As [`write()`], for infinite numbers.
pub fn write_with_gaps(path: &Path, columns: &[Column<'_>]) -> Result<(), Failure> {
    checked(path, columns, |x| !x.is_infinite())
}

fn checked(path: &Path, columns: &[Column<'_>], good: fn(f64) -> bool) -> Result<(), Failure> {
    let rows = columns.first().map_or(0, |c| c.values.len());
    for c in columns {
        if c.values.len() != rows {
            let place = format!("{}: columns {} and {}", path.display(), columns[0].header(), c.header());
            return Err(Failure::Length { place, left: rows, right: c.values.len() });
        }
        if let Some(row) = c.values.iter().position(|&v| !good(v)) {
            let place = format!("{}: column {}, row {}", path.display(), c.header(), row + 1);
            return Err(Failure::NotFinite { place, value: c.values[row].to_string() });
        }
    }
    let bytes = render(columns, rows).map_err(|e| Failure::io("format", path, std::io::Error::other(e)))?;
    atomic::write(path, &bytes)
}

fn render(columns: &[Column<'_>], rows: usize) -> Result<Vec<u8>, Box<dyn std::error::Error + Send + Sync>> {
    let mut w = csv::Writer::from_writer(Vec::new());
    w.write_record(columns.iter().map(Column::header))?;
    for row in 0..rows {
        w.write_record(columns.iter().map(|c| number(c.values[row])))?;
    }
    Ok(w.into_inner()?)
}

/// Shortest text that reads back exactly, in exponent form where that is shorter.
fn number(v: f64) -> String {
    if v.is_nan() {
        return String::new();
    }
    let (plain, exp) = (format!("{v}"), format!("{v:e}"));
    if exp.len() < plain.len() { exp } else { plain }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_reads_back_exactly() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.csv");
        let (t, x) = (vec![0.0, 0.1, 0.1 + 0.2], vec![-1.5e-300, f64::MAX, f64::MIN_POSITIVE]);
        write(&path, &[Column::new("t", "s", &t), Column::new("psd_j2", "(N m)^2/Hz", &x)]).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("t[s],psd_j2[(N m)^2/Hz]\n"), "{text}");
        for (i, line) in text.lines().skip(1).enumerate() {
            let v: Vec<f64> = line.split(',').map(|s| s.parse().unwrap()).collect();
            assert_eq!(v, [t[i], x[i]]);
        }
    }

    #[test]
    fn refuses_what_no_reader_could_use() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.csv");
        let e = write(&path, &[Column::new("t", "s", &[0.0, f64::NAN])]).unwrap_err();
        assert!(e.to_string().contains("column t[s], row 2"), "{e}");
        let e = write(&path, &[Column::new("t", "s", &[0.0]), Column::new("x", "m", &[])]).unwrap_err();
        assert!(matches!(e, Failure::Length { left: 1, right: 0, .. }), "{e}");
        assert!(!path.exists());
    }
}
