//! Draws from the posterior as a file that ArviZ and others read.

use crate::exit::Failure;
use crate::files::atomic;
use ff_records::file::{TableColumn, write_table};
use ident::sample::Draws;
use std::path::Path;

/// Writes draws as Parquet: columns `chain` and `draw` of whole numbers from 0, one of each unknown under its name (SI unit in the metadata
/// as `unit.<name>`), and `lp`, the logarithm of the density over the coordinates that are drawn in.
///
/// # Errors
/// [`Failure::Io`].
pub fn write_parquet(d: &Draws, path: &Path) -> Result<(), Failure> {
    let (chains, n) = (d.chains.len(), d.len());
    let index = |of: fn(usize, usize) -> usize| (0..chains * n).map(|i| of(i, n) as i64).collect();
    let mut columns = vec![
        ("chain".to_owned(), TableColumn::Whole(index(|i, n| i / n))),
        ("draw".to_owned(), TableColumn::Whole(index(|i, n| i % n))),
    ];
    for (k, (name, unit)) in d.names.iter().zip(&d.units).enumerate() {
        columns.push((name.clone(), TableColumn::Real(d.of(k).concat(), unit.clone())));
    }
    columns.push(("lp".to_owned(), TableColumn::Real(d.log_density.concat(), "1".to_owned())));
    atomic::stream(path, |f| {
        let mut out = write_table(std::io::BufWriter::new(f), &columns)?;
        std::io::Write::flush(&mut out)
    })
}
