//! What channels show by themselves: a sensor at the end of its range or dead, readings that jump out and back, attitudes that are none,
//! rates that are not those of the positions.

use crate::resample::usual_interval;
use crate::runs::{longest, repeats, runs};
use core::ops::Range;
use ff_model::{Area, Problem, Problems};
use nalgebra::DMatrix;

/// Equal extreme samples in a row that make a plateau (row D17).
const PLATEAU: usize = 3;
/// Largest part of a record on plateaus.
const SATURATED: f64 = 0.01;
/// Part of the largest value of a channel below which a change is rounding.
const ROUNDED: f64 = 1e-11;
/// Second differences beyond this many times their median are looked at as spikes (row D19).
const SPIKE: f64 = 8.0;
/// Most differences that a median is taken of: a long record need not be sorted whole.
const SAMPLED: usize = 20_000;
/// Longest interval, in usual ones, across which readings are compared with their neighbours.
const WIDEST: f64 = 2.5;
/// Steps of a position from one sample to the next, over the largest elsewhere, by which an encoder that froze has been left behind.
const LEFT_BEHIND: f64 = 4.0;
/// Largest part of a channel that is left out as spikes.
const FEW: f64 = 0.01;
/// Equal readings in a row that are a fault in a channel that hardly ever repeats one.
const FROZEN: usize = 10;
/// Largest part of a channel that is left out as frozen readings.
const MOST_FROZEN: f64 = 0.2;
/// How far the neighbours of a spike may be from minus half of it.
const SHAPE: f64 = 0.35;

/// Rows D17 and D19. `time` of a sample (s) is what messages name.
pub(crate) fn channel(name: &str, x: &[f64], time: &dyn Fn(usize) -> f64, bad: &mut Problems) {
    // Statistics of a few samples say nothing.
    if x.len() >= 50 {
        saturated(name, x, time, bad);
    }
}

/// Median of what an iterator gives, or of every k-th of it for a long channel; zero without numbers.
fn median(count: usize, value: impl Fn(usize) -> f64, keep: impl Fn(f64) -> bool) -> f64 {
    let stride = count.div_ceil(SAMPLED).max(1);
    let mut v: Vec<f64> = (0..count).step_by(stride).map(value).filter(|x| keep(*x)).collect();
    if v.is_empty() {
        return 0.0;
    }
    let mid = v.len() / 2;
    *v.select_nth_unstable_by(mid, f64::total_cmp).1
}

/// Runs of the largest or smallest value that are entered or left with a step: what a limit does to a signal. The top of a
/// smooth or coarsely quantised signal is entered by the smallest of steps.
fn saturated(name: &str, x: &[f64], time: &dyn Fn(usize) -> f64, bad: &mut Problems) {
    // Nearly every channel ends here: it has no plateau.
    if !repeats(x, PLATEAU - 1) {
        return;
    }
    let (lo, hi) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)));
    // A motor that is switched off reads exactly zero: no sensor ends there, unless all its readings do.
    let off = |v: f64| v == 0.0 && name.starts_with("tau.");
    let at_end = |v: f64| (v == lo || v == hi) && !off(v);
    let plateaus: Vec<Range<usize>> = runs(x).filter(|r| r.len() >= PLATEAU && at_end(x[r.start])).collect();
    if plateaus.is_empty() {
        return;
    }
    let step = |i: usize| (x[i + 1] - x[i]).abs();
    let least = (0..x.len() - 1).map(step).filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
    if !least.is_finite() {
        return;
    }
    let usual = median(x.len() - 1, step, |s| s > 0.0);
    let sharp = (0.25 * usual).max(2.0 * least);
    let (mut count, mut first, mut at) = (0, 0, 0.0);
    for Range { start, end } in plateaus {
        // A signal that begins or ends at rest enters its plateau from nowhere.
        let entered = start > 0 && (x[start] - x[start - 1]).abs() >= sharp;
        let left = end < x.len() && (x[end] - x[start]).abs() >= sharp;
        if entered || left {
            if count == 0 {
                (first, at) = (start, x[start]);
            }
            count += end - start;
        }
    }
    if count == 0 {
        return;
    }
    let share = count as f64 / x.len() as f64;
    let t = time(first);
    let what = format!(
        "{count} samples ({:.2} %, limit {:.0} %) stand at the end of the range, the first at {t:.3} s with {at}",
        100.0 * share,
        100.0 * SATURATED
    );
    let make = if share > SATURATED { Problem::error } else { Problem::warning };
    let hint = "excite less, widen the range of the sensor, or cut this part out; to go on, --allow saturated";
    bad.push(make(Area::Data, "Data::Saturated", what).on(name).hint(hint));
}

/// Single samples that leave their neighbours and come back: second differences are `s, -2 s, s`. Returns those to be left out: all of
/// them where they are few, none where they are so many that the channel may be like that. The warning says which. With `keep`, none.
pub(crate) fn spikes(name: &str, x: &[f64], time: &dyn Fn(usize) -> f64, keep: bool, bad: &mut Problems) -> Vec<usize> {
    if x.len() < 50 {
        return Vec::new();
    }
    // From the straight line between the neighbours, at whatever times they were read; across gaps nothing is judged.
    let t: Vec<f64> = (0..x.len()).map(time).collect();
    let usual = usual_interval(&t);
    let second = |i: usize| {
        let (before, behind) = (t[i + 1] - t[i], t[i + 2] - t[i + 1]);
        if before.max(behind) > WIDEST * usual {
            return 0.0;
        }
        2.0 * ((x[i] * behind + x[i + 2] * before) / (before + behind) - x[i + 1])
    };
    let all = x.len() - 2;
    // A motor that is off for a while reads zero, which is no noise. Nor are the last digits of readings in steps that are on a line, next to which one step
    // would be a spike.
    let rounded = ROUNDED * x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let usual = median(all, |i| second(i).abs(), |s| s > rounded);
    // Nothing to compare with where most samples lie on straight lines.
    if usual <= 0.0 {
        return Vec::new();
    }
    let limit = SPIKE * usual;
    let near = |a: f64, b: f64| (a + 0.5 * b).abs() <= SHAPE * 0.5 * b.abs();
    let mut found = Vec::new();
    for i in 1..all - 1 {
        let s = second(i);
        if s.abs() > 2.0 * limit && near(second(i - 1), s) && near(second(i + 1), s) {
            found.push(i + 1);
        }
    }
    let Some(&first) = found.first() else { return found };
    let few = found.len() as f64 <= FEW * x.len() as f64;
    let done = if keep || !few { "nothing was left out" } else { "they are left out" };
    let what = format!(
        "{} single samples ({:.3} %, limit {:.0} % to leave them out) jump by more than {SPIKE} times what is usual (limit {:.3e}), the first at \
         {:.3} s: {}; {done}",
        found.len(),
        100.0 * found.len() as f64 / x.len() as f64,
        100.0 * FEW,
        limit,
        time(first),
        x[first]
    );
    let p = Problem::warning(Area::Data, "Data::Spikes", what).on(name);
    let hint = if few {
        "look at the recorder; --keep-spikes fits them"
    } else {
        "look at the recorder, or give --loss huber"
    };
    bad.push(p.hint(hint));
    if keep || !few { Vec::new() } else { found }
}

/// What to do about a reading that stays.
const CUT: &str = "check sensor and recorder; cut the record where the reading is none";

/// Row D18. A torque or gyro channel that never changes is a dead sensor; one that holds still for a tenth
/// of the record, or a joint that never moves, may be meant. Readings that freeze ([`frozen`], [`frozen_encoder`]) are returned to be left out, but for the first of
/// a stretch, unless they are more than [`MOST_FROZEN`] of a channel, or to be kept.
pub(crate) fn stuck(
    name: &str,
    m: &DMatrix<f64>,
    joints: &[String],
    time: &dyn Fn(usize) -> f64,
    keep: bool,
    bad: &mut Problems,
) -> Vec<usize> {
    let sensor = matches!(name, "tau" | "gyro");
    let mut out = Vec::new();
    if !(sensor || name == "q") || m.nrows() < 8 {
        return out;
    }
    for (j, c) in m.column_iter().enumerate() {
        let c = c.as_slice();
        let longest = longest(c);
        let axis = if name == "gyro" { ["x", "y", "z"][j] } else { &joints[j] };
        let at = format!("{name}.{axis}");
        let holds = |run: &Range<usize>| {
            let (a, b) = (time(run.start), time(run.end));
            format!("holds exactly {} from {a:.3} to {b:.3} s of {:.3} s", c[run.start], time(c.len()))
        };
        let warn = |what: String, hint: &str| Problem::warning(Area::Data, "Data::Stuck", what).on(&at).hint(hint);
        let dead = longest.len() == c.len();
        if dead {
            let p = if sensor { Problem::error } else { Problem::warning }(Area::Data, "Data::Stuck", holds(&longest));
            let p = p.on(&at);
            bad.push(if sensor { p.hint("check the sensor; for noise-free simulation allow Data::Stuck") } else { p });
            continue;
        }
        let stretches = match longest.len() {
            ..FROZEN => Vec::new(),
            _ if sensor => frozen(c),
            _ => frozen_encoder(c),
        };
        let lost: usize = stretches.iter().map(|r| r.len() - 1).sum();
        if let Some(first) = stretches.first() {
            let few = lost as f64 <= MOST_FROZEN * c.len() as f64;
            let also =
                if stretches.len() > 1 { format!(", and {} times more", stretches.len() - 1) } else { String::new() };
            let done = if keep || !few { "nothing was left out" } else { "they are left out" };
            let what = format!(
                "{}{also}: {lost} samples ({:.2} %, limit {:.0} % to leave them out) repeat the reading before them; {done}",
                holds(first),
                100.0 * lost as f64 / c.len() as f64,
                100.0 * MOST_FROZEN
            );
            bad.push(warn(what, if few && !keep { "check sensor and recorder; --allow stuck fits them" } else { CUT }));
            if few && !keep {
                out.extend(stretches.into_iter().flat_map(|r| r.start + 1..r.end));
            }
        } else if sensor && longest.len() >= 50 && longest.len() * 10 >= c.len() {
            bad.push(warn(holds(&longest), CUT));
        }
    }
    out
}

/// Stretches over which readings that hardly ever repeat the one before, since they have noise or move, do so all the time. From the first
/// sample on a simulated robot without noise may be at rest, and at the end of its range a sensor is saturated (row D17), unless that is zero.
fn frozen(x: &[f64]) -> Vec<Range<usize>> {
    let all: Vec<Range<usize>> = runs(x).filter(|r| r.len() > 1).collect();
    let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let at_end = |v: f64| v != 0.0 && (v == low || v == high);
    let freezes = |r: &Range<usize>| r.len() >= FROZEN && r.start > 0 && !at_end(x[r.start]);
    let (long, short): (Vec<Range<usize>>, Vec<_>) = all.into_iter().partition(freezes);
    let samples = |all: &[Range<usize>]| all.iter().map(ExactSizeIterator::len).sum::<usize>();
    if (samples(&short) - short.len()) * 100 <= x.len() - samples(&long) { long } else { Vec::new() }
}

/// Stretches over which an encoder froze while its joint went on: behind them it jumps further than anywhere else from one sample to the next. A joint that
/// rests holds its position, too, and leaves it slowly.
fn frozen_encoder(x: &[f64]) -> Vec<Range<usize>> {
    let ends = |r: &Range<usize>| r.len() >= FROZEN && r.start > 0 && r.end < x.len();
    let mut found: Vec<Range<usize>> = runs(x).filter(ends).collect();
    let step = |i: usize| (x[i] - x[i - 1]).abs();
    // Runs are ascending, and there may be thousands of them.
    let ends_one = |i: &usize| found.binary_search_by_key(i, |r| r.end).is_ok();
    let usual = (1..x.len()).filter(|i| !ends_one(i)).map(step).fold(0.0, f64::max);
    // An encoder that never steps twice within so few samples has nothing to be compared with.
    if usual == 0.0 {
        return Vec::new();
    }
    found.retain(|r| step(r.end) > LEFT_BEHIND * usual);
    found
}

/// Row D22: unit norm to 1e-3, then normalised; q and -q are the same attitude, so signs are made continuous.
pub(crate) fn unwrap_attitude(att: &mut DMatrix<f64>, bad: &mut Problems) {
    let mut last = [0.0; 4];
    for i in 0..att.nrows() {
        let norm = att.row(i).norm();
        if (norm - 1.0).abs() > 1e-3 {
            let m = format!("row {i}: quaternion norm {norm} differs from 1 by more than 1e-3");
            bad.push(Problem::error(Area::Data, "Data::Quaternion", m).on("att").hint("order is w, x, y, z"));
            return;
        }
        let dot: f64 = (0..4).map(|k| att[(i, k)] * last[k]).sum();
        let scale = if dot < 0.0 { -1.0 / norm } else { 1.0 / norm };
        for k in 0..4 {
            att[(i, k)] *= scale;
            last[k] = att[(i, k)];
        }
    }
}

/// Row D09: recorded rates against differences of the positions.
pub(crate) fn degrees(q: &DMatrix<f64>, qd: &DMatrix<f64>, dt: f64, times: Option<&[f64]>, bad: &mut Problems) {
    let rows = q.nrows();
    let (mut a, mut b) = (0.0, 0.0);
    for (q, qd) in q.column_iter().zip(qd.column_iter()) {
        for i in 1..rows.saturating_sub(1) {
            let between = times.map_or(2.0 * dt, |t| t[i + 1] - t[i - 1]);
            a += ((q[i + 1] - q[i - 1]) / between).powi(2);
            b += qd[i].powi(2);
        }
    }
    let ratio = (a / b).sqrt();
    for (r, what) in [(ratio, "positions"), (1.0 / ratio, "rates")] {
        if (50.0..65.0).contains(&r) {
            let m = format!("{what} are {r:.1} times too large for the other: one is in degrees");
            bad.push(Problem::error(Area::Data, "Data::LooksLikeDegrees", m).on("q, qd").hint("convert to radians"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    fn noise(k: usize) -> f64 {
        let a = (k as f64 * 12.9898 + 4.1).sin() * 43758.5453;
        2.0 * (a - a.floor()) - 1.0
    }
    fn found(x: &[f64]) -> Problems {
        let mut bad = Problems::default();
        let time = |i: usize| i as f64 * 0.01;
        channel("tau.a", x, &time, &mut bad);
        spikes("tau.a", x, &time, false, &mut bad);
        bad
    }

    #[test]
    fn a_motor_that_is_off_is_not_saturated() {
        let on: Vec<f64> = (0..1000).map(|k| 3.0 + (0.021 * k as f64).sin() + 0.02 * noise(k)).collect();
        let half: Vec<f64> = on.iter().enumerate().map(|(k, x)| if (k / 100) % 2 == 0 { 0.0 } else { *x }).collect();
        assert!(found(&half).0.is_empty(), "{}", found(&half));
        // The same at another value is the end of the range.
        let held: Vec<f64> = half.iter().map(|x| x + 0.5).collect();
        assert!(found(&held).has("Data::Saturated"), "{}", found(&held));
    }

    #[test]
    fn d18_a_sensor_that_freezes_for_a_while_is_told_from_one_with_coarse_steps() {
        let wave: Vec<f64> = (0..2000).map(|k| 3.0 * (0.021 * k as f64 + 0.3).sin() + 0.02 * noise(k)).collect();
        let judged = |x: &[f64], keep: bool| {
            let mut bad = Problems::default();
            let m = DMatrix::from_columns(&[wave.clone().into(), x.to_vec().into(), wave.clone().into()]);
            let out = stuck("gyro", &m, &[], &|i| i as f64 * 0.01, keep, &mut bad);
            (out, bad)
        };
        let told = |x: &[f64]| judged(x, false).1;
        let out = |x: &[f64], keep: bool| judged(x, keep).0;
        let held = |from: usize, to: usize| -> Vec<f64> {
            wave.iter().enumerate().map(|(k, x)| if (from..to).contains(&k) { wave[from] } else { *x }).collect()
        };
        let p = told(&held(900, 960));
        assert!(p.has("Data::Stuck") && !p.has_errors() && p.to_string().contains("gyro.y: holds exactly"), "{p}");
        assert!(p.to_string().contains("from 9.000 to 9.600 s"), "{p}");
        assert!(p.to_string().contains("59 samples") && out(&held(900, 960), false) == (901..960).collect::<Vec<_>>());
        assert!(out(&held(900, 960), true).is_empty() && out(&held(900, 1700), false).is_empty());
        let twice: Vec<f64> =
            held(900, 960).iter().enumerate().map(|(k, x)| if k < 20 { wave[3] } else { *x }).collect();
        let twice: Vec<f64> =
            twice.iter().enumerate().map(|(k, x)| if (1300..1312).contains(&k) { 0.0 } else { *x }).collect();
        // What begins the record may be rest.
        assert_eq!(out(&twice, false), (901..960).chain(1301..1312).collect::<Vec<_>>(), "{}", told(&twice));
        assert!(told(&held(1900, 2000)).has("Data::Stuck"));
        assert!(told(&held(900, 905)).0.is_empty() && told(&wave).0.is_empty());
        // Steps as large as the noise, and a minute at rest.
        let coarse: Vec<f64> = held(900, 960).iter().map(|x| (x / 0.1).round() * 0.1).collect();
        assert!(told(&coarse).0.is_empty(), "{}", told(&coarse));
    }

    #[test]
    fn d18_an_encoder_that_freezes_while_its_joint_moves_is_told_from_a_joint_at_rest() {
        // Out, a rest of a second, and back again.
        let moves = |t: f64| if t < 5.0 { 0.4 - 0.4 * (0.2 * PI * t).cos() } else { 0.8 };
        let angle = |k: usize| {
            let t = 0.01 * k as f64;
            if t < 6.0 { moves(t) } else { moves(11.0 - t) }
        };
        let wave: Vec<f64> = (0..1100).map(angle).collect();
        let out = |x: &[f64], keep: bool| {
            let mut bad = Problems::default();
            let m = DMatrix::from_columns(&[wave.clone().into(), x.to_vec().into()]);
            let joints = ["shoulder".to_owned(), "elbow".to_owned()];
            (stuck("q", &m, &joints, &|i| i as f64 * 0.01, keep, &mut bad), bad)
        };
        assert!(out(&wave, false).0.is_empty() && out(&wave, false).1.0.is_empty());
        let held: Vec<f64> =
            wave.iter().enumerate().map(|(k, x)| if (230..280).contains(&k) { wave[230] } else { *x }).collect();
        let (left, told) = out(&held, false);
        assert_eq!(left, (231..280).collect::<Vec<_>>(), "{told}");
        assert!(told.has("Data::Stuck") && told.to_string().contains("q.elbow: holds exactly"), "{told}");
        assert!(out(&held, true).0.is_empty() && out(&held, true).1.has("Data::Stuck"));
        // Steps of the encoder, which a slow joint stays on, too.
        let coarse = |x: &[f64]| -> Vec<f64> { x.iter().map(|x| (x / 1e-3).round() * 1e-3).collect() };
        assert!(out(&coarse(&wave), false).0.is_empty());
        assert_eq!(out(&coarse(&held), false).0, left);
        // A joint that rests, and then goes by a step now and then.
        let slow: Vec<f64> = (0..1100).map(|k| 1e-3 * f64::from(k / 20).max(45.0)).collect();
        assert!(out(&slow, false).1.0.is_empty(), "{}", out(&slow, false).1);
    }

    #[test]
    fn few_spikes_are_left_out_and_many_are_not() {
        let wave: Vec<f64> = (0..2000).map(|k| 3.0 * (0.021 * k as f64 + 0.3).sin() + 0.02 * noise(k)).collect();
        let with = |every: usize| {
            let one = |(k, x): (usize, &f64)| x + if k % every == 7 { 1.3 } else { 0.0 };
            wave.iter().enumerate().map(one).collect::<Vec<f64>>()
        };
        let out = |x: &[f64], keep| spikes("tau.a", x, &|i| i as f64, keep, &mut Problems::default());
        assert_eq!(out(&with(500), false), [7, 507, 1007, 1507]);
        assert!(out(&with(500), true).is_empty() && out(&with(40), false).is_empty() && out(&wave, false).is_empty());
    }

    #[test]
    fn a_step_of_an_encoder_is_no_spike_beside_readings_on_a_line() {
        // Rests, moves by steps of 4.8e-5 rad, and flickers between two of them for one reading now and then.
        let step = core::f64::consts::TAU / f64::from(1 << 17);
        let moved = |k: usize| 0.37 + 0.9 * (0.004 * k.saturating_sub(900) as f64).sin();
        let flicker = |k: usize| if k % 97 == 5 { step } else { 0.0 };
        let read: Vec<f64> = (0..2000).map(|k| (moved(k) / step).round() * step + flicker(k)).collect();
        let out = |x: &[f64]| spikes("q.a", x, &|i| 0.02 * i as f64, false, &mut Problems::default());
        assert!(out(&read).is_empty(), "{:?}", out(&read));
        let mut spiked = read;
        spiked[611] += 300.0 * step;
        assert_eq!(out(&spiked), [611]);
    }

    #[test]
    fn d17_a_clipped_sensor_is_told_from_a_signal_at_rest() {
        let wave: Vec<f64> = (0..1000).map(|k| 3.0 * (0.021 * k as f64 + 0.3).sin() + 0.02 * noise(k)).collect();
        assert!(found(&wave).0.is_empty(), "{}", found(&wave));
        let clipped: Vec<f64> = wave.iter().map(|x| x.clamp(-9.0, 2.5)).collect();
        let p = found(&clipped);
        assert!(p.has("Data::Saturated") && p.has_errors() && p.to_string().contains("tau.a"), "{p}");
        // Less than a hundredth of the record: let through, and said.
        let mut few = wave.clone();
        few[203..208].fill(7.0);
        let p = found(&few);
        assert!(p.has("Data::Saturated") && !p.has_errors(), "{p}");
        // Quantised coarsely, and at rest for a while at its smallest value.
        let quantised: Vec<f64> = (0..1000).map(|k| (30.0 * (0.013 * k as f64).sin()).round() / 10.0).collect();
        assert!(found(&quantised).0.is_empty(), "{}", found(&quantised));
        let rest: Vec<f64> = (0..1000)
            .map(|k| {
                let s = (k as f64 / 1000.0 - 0.3).max(0.0);
                5.0 * s.powi(3)
            })
            .collect();
        assert!(found(&rest).0.is_empty(), "{}", found(&rest));
    }

    #[test]
    fn d19_a_spike_is_reported_a_step_is_not() {
        let wave: Vec<f64> = (0..1000).map(|k| 3.0 * (0.021 * k as f64 + 0.3).sin() + 0.02 * noise(k)).collect();
        let mut spiked = wave.clone();
        spiked[431] += 1.3;
        let p = found(&spiked);
        assert!(p.has("Data::Spikes") && !p.has_errors() && p.to_string().contains("4.310 s"), "{p}");
        let step: Vec<f64> = wave.iter().enumerate().map(|(k, x)| x + if k > 500 { 1.3 } else { 0.0 }).collect();
        assert!(!found(&step).has("Data::Spikes"), "{}", found(&step));
    }
}
