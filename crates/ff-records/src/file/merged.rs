//! Several files of one motion as one record: joints from one recorder, the gyro from another. Rows are those of all files in the order of
//! their time, on one clock of whole nanoseconds; what a file did not sample in a row is without a number there.

use super::blocks::{BLOCK, Block, Blocks, Stamps};
use super::columns::time_column;
use super::heading::closest;
use super::naming::{LISTED, is_nameless, split, starred};
use super::source::raw_names;
use super::units::{Dimension, find};
use super::{JointColumn, ReadOptions, data, open, order};
use ff_model::diagnostics::{clip, list};
use ff_model::{Problem, Problems};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Largest error of a time stamp from its own digits (s).
const RESOLUTION: f64 = 1e-6;
/// Stamps beyond this (s) count from 1970, those of a recorder that counts from its start do not.
const EPOCH: f64 = 3e8;

/// One of the files, all of it.
struct Part {
    path: PathBuf,
    names: Vec<String>,
    time: usize,
    stamps: Vec<i64>,
    columns: Vec<Vec<f64>>,
    notes: Problems,
    bytes: u64,
}

struct Merged {
    names: Vec<String>,
    stamps: Vec<i64>,
    columns: Vec<Vec<f64>>,
    wanted: Vec<bool>,
    /// Rows given so far.
    given: usize,
    notes: Problems,
    bytes: u64,
}

/// Opens files of one motion as one record. They are kept in memory until all rows are out.
///
/// # Errors
/// Those of [`open`] and of reading; `Data::Columns` for a channel that two files have, `Data::Outside` where their times do not overlap,
/// `Data::NonMonotone`, and `Data::TimeScale` for stamps that have lost digits.
pub fn open_together(
    paths: &[&Path],
    joints: &[JointColumn],
    options: &ReadOptions,
) -> Result<Box<dyn Blocks>, Problems> {
    let options = ReadOptions { one_of_several: true, ..options.clone() };
    rules_fit(paths, &options)?;
    let parts: Vec<Part> = paths.iter().map(|p| part(p, joints, &options)).collect::<Result<_, _>>()?;
    let mut bad = Problems::default();
    for (k, b) in parts.iter().enumerate() {
        for a in &parts[..k] {
            twice(a, b, &mut bad);
            bad.0.extend(apart(a, b));
        }
    }
    if bad.has_errors() { Err(bad) } else { Ok(Box::new(Merged::of(parts))) }
}

/// Every rule of `--rename` fits a column of one of the files; a file whose names cannot be read says so when it is read. Pipes, which are read
/// once, are not looked at.
fn rules_fit(paths: &[&Path], options: &ReadOptions) -> Result<(), Problems> {
    if options.rename.is_empty() || !paths.iter().all(|p| p.is_file()) {
        return Ok(());
    }
    let all: Vec<(&Path, Vec<String>)> =
        paths.iter().map(|p| (*p, raw_names(p, options).unwrap_or_default())).collect();
    let mut bad = Problems::default();
    for (old, _) in &options.rename {
        let fits = |cell: &String| starred(old, cell).is_some() || starred(old, split(cell).0).is_some();
        if all.iter().any(|(_, names)| names.iter().any(fits)) {
            continue;
        }
        let near = |(path, names): &(&Path, Vec<String>)| {
            let near = closest(old, names);
            let shown: Vec<String> = near.iter().map(|n| format!("'{}'", clip(n))).collect();
            (!near.is_empty()).then(|| format!("{} in '{}'", shown.join(", "), path.display()))
        };
        let near: Vec<String> = all.iter().filter_map(near).collect();
        let hint = if near.is_empty() {
            let names = all.iter().flat_map(|(_, names)| names.iter().map(String::as_str));
            format!("columns: {}", list(names, LISTED))
        } else {
            format!("closest: {}", near.join("; "))
        };
        let p = data("Data::Columns", format!("no column of these files is called '{}'", clip(old)));
        bad.push(p.on("--rename").hint(hint));
    }
    if bad.has_errors() { Err(bad) } else { Ok(()) }
}

fn part(path: &Path, joints: &[JointColumn], options: &ReadOptions) -> Result<Part, Problems> {
    let read = || {
        let (_, mut source) = open(path, joints, options)?;
        let names = source.names().to_vec();
        let time = time_column(&names).map_err(|p| Problems(vec![*p]))?;
        let (mut stamps, mut columns) = (Vec::new(), vec![Vec::new(); names.len()]);
        let mut block = Block::new(names.len());
        while source.next(&mut block)? {
            nanoseconds(&block.stamps, &names[time], &mut stamps)?;
            columns
                .iter_mut()
                .zip(&block.columns)
                .for_each(|(to, from): (&mut Vec<f64>, _)| to.extend_from_slice(from));
        }
        ascending(&stamps)?;
        let (notes, bytes) = (source.notes().in_file(path), source.bytes());
        Ok(Part { path: path.to_path_buf(), names, time, stamps, columns, notes, bytes })
    };
    read().map_err(|p: Problems| p.in_file(path))
}

/// Stamps in the unit of their column, in nanoseconds.
fn nanoseconds(stamps: &Stamps, column: &str, out: &mut Vec<i64>) -> Result<(), Problems> {
    let unit = split(column).1.and_then(|u| find(u, Dimension::Time)).ok_or_else(|| {
        let p = data("Data::UnitMissing", format!("column '{}' has no unit of time", clip(column))).on("time");
        Problems(vec![p.hint("give --rename 'time=time[s]', or ms, us, ns")])
    })?;
    let far = |x: f64, why: &str| {
        let p = data("Data::TimeScale", format!("stamp {x} {} {why}", unit.symbol)).on("time");
        Problems(vec![p.hint("write stamps as whole numbers of ns, or count them from the start of the record")])
    };
    let scale = 1e9 * unit.mul / unit.div;
    match stamps {
        Stamps::Whole(all) => {
            for &w in all {
                out.push(w.checked_mul(scale as i64).ok_or_else(|| far(w as f64, "is beyond what nanoseconds hold"))?);
            }
        }
        Stamps::Real(all) => {
            for &x in all {
                let ns = x * scale;
                if !ns.is_finite() || ns.abs() * f64::EPSILON > RESOLUTION * 1e9 {
                    return Err(far(x, "has lost digits: it is not known to a microsecond"));
                }
                out.push(ns.round() as i64);
            }
        }
    }
    Ok(())
}

/// Rows must be in the order of their time.
fn ascending(stamps: &[i64]) -> Result<(), Problems> {
    let Some(&first) = stamps.first() else {
        let p = data("Data::NoSamples", "there are column names, but no samples");
        return Err(Problems(vec![p.hint("check that recording had started")]));
    };
    let listed: Vec<(usize, usize)> =
        (1..stamps.len()).filter(|&i| stamps[i] <= stamps[i - 1]).map(|i| (i + 1, i)).take(5).collect();
    let seconds: Vec<f64> = stamps.iter().map(|t| t.saturating_sub(first) as f64 * 1e-9).collect();
    let found = order::explain(&seconds, first as f64 * 1e-9, &listed, 0)
        .into_iter()
        .map(|(row, p)| Problem { message: format!("row {row}: {}", p.message), ..p });
    let found = Problems(found.collect());
    if found.has_errors() { Err(found) } else { Ok(()) }
}

/// Channels that both files have.
fn twice(a: &Part, b: &Part, bad: &mut Problems) {
    let channels = |p: &Part| -> Vec<String> {
        let others = p.names.iter().enumerate().filter(|(k, n)| *k != p.time && !is_nameless(n));
        others.map(|(_, n)| split(n).0.to_owned()).collect()
    };
    let first = channels(a);
    for name in channels(b).into_iter().filter(|n| first.contains(n)) {
        let p = data("Data::Columns", format!("column '{}' is in '{}' as well", clip(&name), a.path.display()));
        bad.push(p.on(clip(&name)).in_file(&b.path).hint("leave it out of one of the files, or --ignore it in both"));
    }
}

/// What is wrong with the times of two files that do not overlap.
fn apart(a: &Part, b: &Part) -> Option<Problem> {
    let span = |p: &Part| [p.stamps.first(), p.stamps.last()].map(|t| t.map_or(0.0, |t| *t as f64 * 1e-9));
    let ([a0, a1], [b0, b1]) = (span(a), span(b));
    if a0 <= b1 && b0 <= a1 {
        return None;
    }
    let what = format!("{b0} .. {b1} s, and '{}' {a0} .. {a1} s: they do not overlap", a.path.display());
    let hint = if (a0 > EPOCH) != (b0 > EPOCH) {
        "one counts from 1970 and the other from its own start: write both with the stamps of one clock"
    } else {
        "give files of the same motion, with the stamps of one clock"
    };
    Some(data("Data::Outside", what).on("time").in_file(&b.path).hint(hint))
}

impl Merged {
    fn of(parts: Vec<Part>) -> Self {
        let stamps: Vec<i64> =
            parts.iter().flat_map(|p| p.stamps.iter().copied()).collect::<BTreeSet<_>>().into_iter().collect();
        let (mut names, mut columns) = (vec!["time[ns]".to_owned()], vec![Vec::new()]);
        let (mut notes, mut bytes) = (Problems::default(), 0);
        for part in parts {
            // Both are in order.
            let mut row = 0;
            let mut place = |t: &i64| {
                row += stamps[row..].iter().take_while(|s| *s < t).count();
                row
            };
            let places: Vec<usize> = part.stamps.iter().map(&mut place).collect();
            let time = part.time;
            let channels = part.names.into_iter().zip(part.columns).enumerate().filter(|(k, _)| *k != time);
            for (_, (name, from)) in channels {
                let mut to = vec![f64::NAN; stamps.len()];
                places.iter().zip(&from).for_each(|(&i, &x)| to[i] = x);
                names.push(name);
                columns.push(to);
            }
            notes.extend(part.notes);
            bytes += part.bytes;
        }
        let wanted = vec![true; names.len()];
        Self { names, stamps, columns, wanted, given: 0, notes, bytes }
    }
}

impl Blocks for Merged {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn want(&mut self, wanted: &[bool]) {
        self.wanted = wanted.to_vec();
    }
    fn next(&mut self, out: &mut Block) -> Result<bool, Problems> {
        out.clear();
        let rows = self.given..self.stamps.len().min(self.given + BLOCK);
        out.stamps = Stamps::Whole(self.stamps[rows.clone()].to_vec());
        for (k, to) in out.columns.iter_mut().enumerate().skip(1).filter(|(k, _)| self.wanted[*k]) {
            to.extend_from_slice(&self.columns[k][rows.clone()]);
        }
        self.given = rows.end;
        Ok(!rows.is_empty())
    }
    fn bytes(&self) -> u64 {
        self.bytes
    }
    fn notes(&self) -> Problems {
        self.notes.clone()
    }
}
