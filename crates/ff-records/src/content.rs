//! Whether two records hold the same readings, whatever file they come from.
//!
//! Noise makes every few samples of torques or rates unlike all others. So some of them, evenly spread, stand for a record: numbers are rounded
//! to twelve bits, so that a file of fewer digits or another unit is known again, and as many neighbouring samples as have a dozen numbers are
//! hashed together. Samples that do not change tell nothing and are passed over.

use crate::record::Record;
use core::fmt;
use nalgebra::DMatrix;
use std::collections::HashSet;

/// Windows of samples that stand for a group of channels.
const WINDOWS: usize = 32;
/// Numbers of a window, at least.
const NUMBERS: usize = 12;
/// Fewest windows that say something.
const FEWEST: usize = 4;
/// Records with one in so many windows in common share readings.
const SHARE: usize = 3;

/// What stands for the readings of a record: hashes of some of its samples of torques, and of the gyro.
///
/// ```
/// use ff_records::{Content, RecordBuilder};
/// use nalgebra::DMatrix;
///
/// let wave = |k: f64| DMatrix::from_fn(400, 3, |i, j| (k * (i * i) as f64 + 0.7 * j as f64).sin());
/// let record = |k| RecordBuilder::new(["a", "b", "c"]).uniform(0.0, 100.0).q(wave(0.001)).tau(wave(k)).gyro(wave(0.3 * k)).build();
/// let (one, other) = (record(0.023)?.0, record(0.029)?.0);
/// let words = Content::of(&one).to_string();
/// assert!(Content::from_words(&words).is_in(&one) && !Content::from_words(&words).is_in(&other));
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Content {
    groups: [Vec<u64>; 2],
}

impl Content {
    /// Of a record. Allocates.
    pub fn of(record: &Record) -> Self {
        Self { groups: groups(record).map(|m| m.map_or_else(Vec::new, windows)) }
    }
    /// Of what [`Content::to_string`](ToString) has written; what is no hash is passed over.
    pub fn from_words(words: &str) -> Self {
        let mut parts =
            words.split(';').map(|part| part.split(' ').filter_map(|w| u64::from_str_radix(w, 16).ok()).collect());
        Self { groups: [parts.next().unwrap_or_default(), parts.next().unwrap_or_default()] }
    }
    /// Whether a record holds these readings, a third of them at least: in torques and in the gyro, where both tell anything. The sample
    /// rate and the clock do not matter. Allocates.
    pub fn is_in(&self, record: &Record) -> bool {
        let shared = |(windows, m): (&Vec<u64>, Option<&DMatrix<f64>>)| {
            (windows.len() >= FEWEST).then(|| m.is_some_and(|m| SHARE * hits(windows, m) >= windows.len()))
        };
        let found: Vec<bool> = self.groups.iter().zip(groups(record)).filter_map(shared).collect();
        !found.is_empty() && found.iter().all(|f| *f)
    }
}

impl fmt::Display for Content {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, group) in self.groups.iter().enumerate() {
            f.write_str(if k > 0 { ";" } else { "" })?;
            for (i, hash) in group.iter().enumerate() {
                write!(f, "{}{hash:016x}", if i > 0 { " " } else { "" })?;
            }
        }
        Ok(())
    }
}

/// What has noise: torques, and the gyro of a base that moves.
fn groups(record: &Record) -> [Option<&DMatrix<f64>>; 2] {
    [Some(record.tau()), (!record.is_fixed_base()).then(|| record.gyro())]
}

/// Samples of a window.
fn length(m: &DMatrix<f64>) -> usize {
    NUMBERS.div_ceil(m.ncols().max(1)).max(2)
}

/// Hash of the window that begins at a row; `None` where its samples are all the same.
fn window(m: &DMatrix<f64>, row: usize) -> Option<u64> {
    let rows = row..row + length(m);
    let mut changes = false;
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for j in 0..m.ncols() {
        let first = rounded(m[(row, j)]);
        for i in rows.clone() {
            let x = rounded(m[(i, j)]);
            changes |= x != first;
            // FNV-1a, a number at a time, with its high bits brought down.
            hash = (hash ^ x).wrapping_mul(0x0000_0100_0000_01b3);
            hash ^= hash >> 29;
        }
    }
    changes.then_some(hash)
}

/// A number to twelve bits behind the first.
fn rounded(x: f64) -> u64 {
    const DROPPED: u32 = 40;
    // Both zeros are one.
    let bits = if x == 0.0 { 0 } else { x.to_bits() };
    bits.wrapping_add(1 << (DROPPED - 1)) >> DROPPED
}

/// Windows that are evenly spread.
fn windows(m: &DMatrix<f64>) -> Vec<u64> {
    let Some(last) = m.nrows().checked_sub(length(m)) else { return Vec::new() };
    let mut out = Vec::with_capacity(WINDOWS);
    let mut next = 0;
    for k in 0..WINDOWS {
        let from = next.max(k * last / (WINDOWS - 1));
        let Some((row, hash)) = (from..=last).find_map(|i| Some((i, window(m, i)?))) else { break };
        out.push(hash);
        next = row + 1;
    }
    out
}

/// How many of these windows are in a table.
fn hits(windows: &[u64], m: &DMatrix<f64>) -> usize {
    let Some(last) = m.nrows().checked_sub(length(m)) else { return 0 };
    let wanted: HashSet<u64> = windows.iter().copied().collect();
    let found: HashSet<u64> = (0..=last).filter_map(|i| window(m, i)).filter(|h| wanted.contains(h)).collect();
    windows.iter().filter(|h| found.contains(h)).count()
}
