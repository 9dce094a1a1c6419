//! Readings that are held: a channel slower than the rows whose last reading stands in every row until the next one, as recorders and
//! `ffill` of pandas write it. Taken as samples they would count several times, and late.

use super::columns::Target;
use crate::time_base::ChannelGroup;
use ff_model::{Area, Problem, Problems};

/// New readings that a window counts. Equal neighbours by chance, of rounded readings or at rest, scatter far more over windows.
const WINDOW: usize = 16;
/// Fewest windows, and the part of them that must be as long as the median, to a row.
const WINDOWS: usize = 4;
const ALIKE: f64 = 0.9;
/// Fewest rows per new reading.
const LEAST: f64 = 1.15;

/// Takes held readings out of the groups of sensors, where they become NaN, and returns these groups; says so of torques, which a motor may hold.
pub(super) fn take_out(
    columns: &mut [Vec<f64>],
    targets: &[Target],
    stamps: &[f64],
    bad: &mut Problems,
) -> Vec<ChannelGroup> {
    let mut out = Vec::new();
    for group in ChannelGroup::ALL.into_iter().filter(|g| *g != ChannelGroup::Carried) {
        let of: Vec<usize> = (0..targets.len()).filter(|&c| targets[c].sampled_with() == Some(group)).collect();
        // One encoder at a constant rate turns over evenly, too.
        if of.is_empty() || group == ChannelGroup::Motion && of.len() < 2 {
            continue;
        }
        let new = new_readings(columns, &of, stamps.len());
        let Some(rows) = rows_per_reading(&new) else { continue };
        let (from, to) = (new[0].0, new[new.len() - 1].0);
        let rate = (new.len() - 1) as f64 / (stamps[to] - stamps[from]);
        let what = format!("readings are held: a new one in every {rows:.3} rows, {rate:.4} Hz");
        let warn = |what: String| Problem::warning(Area::Data, "Data::Held", what).on(group.name());
        // Of joint states that are held, the torques are.
        if group == ChannelGroup::Torque && !out.contains(&ChannelGroup::Motion) {
            bad.push(warn(format!("{what}; every row counts")).hint(
                "if a slower sensor was filled forward, leave its cells empty between samples, or deviations come out too small; \
                 nothing to do where the motor held its torque",
            ));
            continue;
        }
        let what = format!("{what}; each counts once, in the row where it first stands");
        bad.push(warn(what).hint("better leave cells empty between samples, and let each have the time of its own"));
        let mut kept = kept(&new, rows, stamps.len()).into_iter().peekable();
        for i in 0..stamps.len() {
            if kept.next_if_eq(&i).is_none() {
                of.iter().for_each(|&c| columns[c][i] = f64::NAN);
            }
        }
        out.push(group);
    }
    out
}

/// Rows in which any channel of a group has another reading than in the row before that has one, each with its number among rows that have.
fn new_readings(columns: &[Vec<f64>], of: &[usize], rows: usize) -> Vec<(usize, usize)> {
    let (mut last, mut number): (Option<usize>, usize) = (None, 0);
    let mut out = Vec::new();
    for i in 0..rows {
        if of.iter().all(|&c| columns[c][i].is_nan()) {
            continue;
        }
        let same = |l: usize| of.iter().all(|&c| columns[c][i].to_bits() == columns[c][l].to_bits());
        if !last.is_some_and(same) {
            out.push((i, number));
        }
        (last, number) = (Some(i), number + 1);
    }
    out
}

/// Rows whose readings count: the new ones, and at the same pace those that a sensor at rest repeats.
fn kept(new: &[(usize, usize)], rows: f64, end: usize) -> Vec<usize> {
    let mut out = Vec::with_capacity(new.len());
    for (k, &(row, _)) in new.iter().enumerate() {
        let next = new.get(k + 1).map_or(end, |n| n.0);
        let at = |m: usize| row + (m as f64 * rows).round() as usize;
        out.extend((0..).map(at).take_while(|&i| i == row || i as f64 + 0.5 * rows < next as f64));
    }
    out
}

/// Rows per new reading, where new readings come evenly and less often than rows.
fn rows_per_reading(new: &[(usize, usize)]) -> Option<f64> {
    let mut windows: Vec<usize> = (WINDOW..new.len()).step_by(WINDOW).map(|k| new[k].1 - new[k - WINDOW].1).collect();
    if windows.len() < WINDOWS {
        return None;
    }
    windows.sort_unstable();
    let median = windows[windows.len() / 2];
    let alike = windows.iter().filter(|w| w.abs_diff(median) <= 1).count();
    let rows = median as f64 / WINDOW as f64;
    (rows >= LEAST && alike as f64 >= ALIKE * windows.len() as f64).then_some(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(k: usize) -> f64 {
        let a = (k as f64 * 12.9898 + 4.1).sin() * 43758.5453;
        2.0 * (a - a.floor()) - 1.0
    }
    fn rows_of(x: impl Fn(usize) -> f64) -> Option<f64> {
        let columns = vec![(0..2000).map(x).collect::<Vec<f64>>()];
        rows_per_reading(&new_readings(&columns, &[0], 2000))
    }

    #[test]
    fn held_readings_are_told_from_rounded_ones() {
        assert_eq!(rows_of(|i| noise(i / 2)), Some(2.0));
        assert!(rows_of(|i| noise(i * 2 / 5)).is_some_and(|r| (r - 2.5).abs() < 0.07));
        assert!(rows_of(|i| noise(i * 2 / 3)).is_some_and(|r| (r - 1.5).abs() < 0.07));
        // What is repeated at rest counts at the same pace.
        let new = [(0, 0), (2, 2), (4, 4), (11, 11), (13, 13)];
        assert_eq!(kept(&new, 2.0, 16), [0, 2, 4, 6, 8, 11, 13]);
        // New in every row, coarse noise, a slow motion in steps, a rest of three quarters.
        assert_eq!(rows_of(noise), None);
        assert_eq!(rows_of(|i| if i % 2 == 0 { noise(i) } else { f64::NAN }), None);
        assert_eq!(rows_of(|i| (1.2 * noise(i)).round()), None);
        assert_eq!(rows_of(|i| (30.0 * (0.01 * i as f64).sin()).round()), None);
        assert_eq!(rows_of(|i| if i < 1500 { 0.0 } else { noise(i) }), None);
    }
}
