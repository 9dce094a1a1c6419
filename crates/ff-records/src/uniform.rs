//! One clock for all samples: what is wrong with it, and samples that are interpolated onto it when that was asked for.

use ff_model::{Area, Problem, Problems};
use nalgebra::DMatrix;

/// Largest deviation from the uniform clock, as a fraction of the sampling interval, before samples have to
/// be resampled (row D14).
const JITTER: f64 = 0.1;
/// Most problems of one kind listed one by one.
const LISTED: usize = 5;

#[derive(Clone, Debug)]
pub(crate) enum Clock {
    Uniform {
        t0: f64,
        dt: f64,
    },
    Stamps(Vec<f64>),
    /// Times of the joint motion, which are kept.
    Motion(Vec<f64>),
}

/// Mean interval between ascending times, two at least, and how far one of them is off the uniform clock with it, as a fraction of the interval.
pub(crate) fn mean_interval(t: &[f64]) -> (f64, f64) {
    let mean = (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64;
    let off = t.iter().enumerate().map(|(i, x)| (x - t[0] - i as f64 * mean).abs()).fold(0.0, f64::max);
    (mean, off / mean)
}

/// `(t0, dt, stamps since t0 when samples have to be interpolated)`.
pub(crate) fn check_clock(
    clock: Clock,
    rows: usize,
    resample: bool,
    bad: &mut Problems,
) -> Option<(f64, f64, Option<Vec<f64>>)> {
    let (t0, dt, stamps) = match clock {
        Clock::Uniform { t0, dt } => (t0, dt, None),
        Clock::Stamps(t) | Clock::Motion(t) => {
            if t.len() != rows {
                bad.push(
                    Problem::error(Area::Data, "Data::Shape", format!("{} time stamps for {rows} samples", t.len()))
                        .on("time"),
                );
                return None;
            }
            if let Some(row) = t.iter().position(|x| !x.is_finite()) {
                bad.push(Problem::error(Area::Data, "Data::NotFinite", format!("row {row} is {}", t[row])).on("time"));
                return None;
            }
            let back: Vec<usize> = (1..rows).filter(|&i| t[i] <= t[i - 1]).collect();
            for &i in back.iter().take(LISTED) {
                let m = format!("row {i}: time goes from {} to {} s ({} such rows)", t[i - 1], t[i], back.len());
                bad.push(
                    Problem::error(Area::Data, "Data::NonMonotone", m)
                        .on("time")
                        .hint("sort the rows or drop repeated ones"),
                );
            }
            if !back.is_empty() || rows < 2 {
                return None;
            }
            let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
            let mid = steps.len() / 2;
            (t[0], *steps.select_nth_unstable_by(mid, f64::total_cmp).1, Some(t))
        }
    };
    if !(t0.is_finite() && dt.is_finite() && dt > 0.0) {
        bad.push(
            Problem::error(Area::Data, "Data::TimeScale", format!("first time {t0} s, interval {dt} s")).on("time"),
        );
        return None;
    }
    if !(1e-5..=0.5).contains(&dt) {
        let m = format!("median interval {dt} s is outside 1e-5 .. 0.5 s");
        bad.push(Problem::error(Area::Data, "Data::TimeScale", m).on("time").hint(if dt > 0.5 {
            "are the stamps in ms, us or ns? name the unit in the header, as time[ms]"
        } else {
            "are the stamps in s, and the header names a smaller unit? write time[s]"
        }));
    }
    if t0.abs() * f64::EPSILON > 1e-6 {
        let m = format!("times near {t0} s resolve only {:.1e} s", t0.abs() * f64::EPSILON);
        bad.push(
            Problem::warning(Area::Data, "Data::TimeScale", m).on("time").hint("store time relative to the start"),
        );
    }
    let Some(t) = stamps else {
        return Some((t0, dt, None));
    };
    let gaps: Vec<usize> = (1..rows).filter(|&i| t[i] - t[i - 1] > 1.5 * dt).collect();
    let lost: f64 = gaps.iter().map(|&i| ((t[i] - t[i - 1]) / dt - 1.0).round().max(1.0)).sum();
    let too_many = lost > 0.01 * rows as f64;
    for &i in gaps.iter().take(LISTED) {
        let m = format!(
            "{} s without samples after {} s ({} gaps, {lost} samples lost)",
            t[i] - t[i - 1],
            t[i - 1],
            gaps.len()
        );
        let p = if too_many || !resample {
            Problem::error(Area::Data, "Data::Gap", m)
        } else {
            Problem::warning(Area::Data, "Data::Gap", m)
        };
        bad.push(p.on("time").hint("cut the record at the gap, or allow resampling of up to 1 % lost samples"));
    }
    let jitter = if gaps.is_empty() { mean_interval(&t).1 } else { f64::INFINITY };
    if jitter <= JITTER {
        return Some((t0, mean_interval(&t).0, None));
    }
    if gaps.is_empty() {
        let m = format!("samples are up to {jitter:.2} intervals off the uniform clock (limit {JITTER})");
        let p = if resample {
            Problem::warning(Area::Data, "Data::Jitter", m)
        } else {
            Problem::error(Area::Data, "Data::Jitter", m)
        };
        bad.push(p.on("time").hint("allow resampling, or record with a steadier clock"));
    }
    if resample {
        bad.push(
            Problem::warning(Area::Data, "Data::Resampled", format!("interpolated linearly onto {dt} s")).on("time"),
        );
        return Some((t0, dt, Some(t.iter().map(|x| x - t0).collect())));
    }
    None
}

/// Samples of the uniform clock up to the last stamp.
pub(crate) fn grid_rows(t: &[f64], dt: f64) -> usize {
    (t[t.len() - 1] / dt + 1e-9).floor() as usize + 1
}

/// Linear interpolation of every column from stamps `t` (from 0, ascending) onto `0, dt, 2 dt, ...`.
pub(crate) fn interpolate(m: &DMatrix<f64>, t: &[f64], dt: f64) -> DMatrix<f64> {
    let last = t[t.len() - 1];
    let rows = grid_rows(t, dt);
    let mut out = DMatrix::zeros(rows, m.ncols());
    let mut k = 0;
    for i in 0..rows {
        let x = (i as f64 * dt).min(last);
        while k + 2 < t.len() && t[k + 1] < x {
            k += 1;
        }
        let w = (x - t[k]) / (t[k + 1] - t[k]);
        for j in 0..m.ncols() {
            out[(i, j)] = (1.0 - w) * m[(k, j)] + w * m[(k + 1, j)];
        }
    }
    out
}
