//! Columns in memory, read as a file of them would be.

use super::blocks::{BLOCK, Block, Blocks, Stamps, collect};
use super::columns::{si_unit, time_column};
use super::naming::split;
use super::{JointColumn, Loaded, ReadOptions};
use ff_model::Problems;

struct MemoryBlocks<'a> {
    names: Vec<String>,
    columns: &'a [(String, Vec<f64>)],
    time: usize,
    wanted: Vec<bool>,
    rows: usize,
    done: usize,
}

impl Blocks for MemoryBlocks<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn want(&mut self, wanted: &[bool]) {
        self.wanted = wanted.to_vec();
    }
    fn next(&mut self, out: &mut Block) -> Result<bool, Problems> {
        let rows = self.done..self.rows.min(self.done + BLOCK);
        out.stamps = Stamps::Real(self.columns[self.time].1[rows.clone()].to_vec());
        for (k, (to, (_, from))) in out.columns.iter_mut().zip(self.columns).enumerate() {
            to.clear();
            if self.wanted[k] && k != self.time {
                to.extend_from_slice(&from[rows.clone()]);
            }
        }
        self.done = rows.end;
        Ok(!rows.is_empty())
    }
    fn bytes(&self) -> u64 {
        (self.rows * self.columns.len() * size_of::<f64>()) as u64
    }
    fn declared_rows(&self) -> Option<u64> {
        Some(self.rows as u64)
    }
}

/// Reads columns in memory into a record of the given joints: `(name[unit], numbers)` of equal length, NaN where there is no number. A column
/// without a unit is in the SI unit of its channel. Everything else is as in a file of these columns.
///
/// # Errors
/// Those of [`super::read_from`], with rows in place of lines.
///
/// # Panics
/// If the columns differ in length.
pub fn read_columns(
    columns: &[(String, Vec<f64>)],
    joints: &[JointColumn],
    options: &ReadOptions,
) -> Result<Loaded, Problems> {
    let with_unit = |name: &String| match split(name).1 {
        None => si_unit(name, joints).map_or_else(|| name.clone(), |unit| format!("{name}[{unit}]")),
        Some(_) => name.clone(),
    };
    let names: Vec<String> = columns.iter().map(|(name, _)| with_unit(name)).collect();
    let time = time_column(&names).map_err(|p| Problems(vec![*p]))?;
    let rows = columns[time].1.len();
    assert!(columns.iter().all(|(_, x)| x.len() == rows), "columns of equal length");
    let wanted = vec![true; names.len()];
    collect(&mut MemoryBlocks { names, columns, time, wanted, rows, done: 0 }, joints, options, true)
}
