//! What time stamps of samples tell: an even clock, the times at which the samples were taken, or an even clock with noise.
//!
//! Stamps that do not lie on an even clock are of two kinds. *True sampling times*: the recorder came early or late, and the
//! readings are those of that instant. *Noisy stamps*: the readings were taken evenly, and only the stamps scatter. Taking the one for the other makes an
//! error of rate times stamp error in every reading, which is seen in the joint positions: a smooth motion stays smooth at the right
//! times only.

use crate::resample::usual_interval;
use ff_model::{Area, Problem, Problems};
use nalgebra::DMatrix;

/// Largest deviation from an even clock, in intervals, up to which stamps are that clock (row D14).
const JITTER: f64 = 0.1;
/// Stamps are noisy when positions at even times scatter less than this part of what they do at the stamps.
const SMOOTHER: f64 = 0.9;
/// Largest correlation of neighbouring deviations of noisy stamps: a sample that was lost shifts all behind it.
const ALONE: f64 = 0.3;
/// Samples of a difference: of order six, as the noise of a joint motion is estimated.
const WINDOW: usize = 7;

/// What the stamps are.
pub(crate) enum Judged {
    /// Times of the samples.
    Own(Vec<f64>),
    /// An even clock behind noisy stamps: first time and interval (s).
    Even {
        /// First time (s).
        t0: f64,
        /// Interval (s).
        dt: f64,
    },
    /// Even already, or not to be used: the builder says what is wrong.
    Checked(Vec<f64>),
}

/// Judges stamps by themselves and by joint positions `q` (a row per stamp), and says in a warning what was assumed.
pub(crate) fn judge(t: Vec<f64>, q: Option<&DMatrix<f64>>, bad: &mut Problems) -> Judged {
    let n = t.len();
    let sound = n > WINDOW && t.iter().all(|x| x.is_finite()) && t.windows(2).all(|w| w[1] > w[0]);
    let Some(q) = q.filter(|q| sound && q.nrows() == n) else { return Judged::Checked(t) };
    let usual = usual_interval(&t);
    let mean = (t[n - 1] - t[0]) / (n - 1) as f64;
    let off = t.iter().enumerate().map(|(i, x)| (x - t[0] - i as f64 * mean).abs()).fold(0.0, f64::max) / mean;
    let gap = t.windows(2).any(|w| w[1] - w[0] > 1.5 * usual);
    if !gap && off <= JITTER || !(1e-5..=0.5).contains(&usual) {
        return Judged::Checked(t);
    }
    let warn = |what: String, hint: &str| Problem::warning(Area::Data, "Data::Jitter", what).on("time").hint(hint);
    let even = EvenClock::through(&t);
    if even.correlation < ALONE {
        let regular: Vec<f64> = (0..n).map(|i| even.t0 + even.dt * i as f64).collect();
        let (at_stamps, at_even) = (roughness(&t, q), roughness(&regular, q));
        if let Some(ratio) = ratio(&at_even, &at_stamps).filter(|r| *r < SMOOTHER) {
            let what = format!(
                "stamps scatter by {:.3e} s (rms) about an even clock of {:.4} Hz, and positions at even times scatter {ratio:.3} times as much \
                 as at the stamps (limit {SMOOTHER}): the stamps are noisy, and the even clock was taken",
                even.rms,
                1.0 / even.dt
            );
            bad.push(warn(what, "give the stamps of the device that samples, where it has a clock"));
            return Judged::Even { t0: even.t0, dt: even.dt };
        }
    }
    // Gaps are counted group by group.
    let rms =
        (t.windows(2).map(|w| w[1] - w[0]).filter(|s| *s <= 1.5 * usual).map(|s| (s - usual).powi(2)).sum::<f64>()
            / (n - 1) as f64)
            .sqrt();
    if rms > 0.02 * usual {
        let what = format!(
            "intervals scatter by {rms:.3e} s (rms) about {usual:.3e} s: every sample counts at its own time, none is moved"
        );
        bad.push(warn(what, "nothing to do; --resample puts samples on an even clock"));
    }
    Judged::Own(t)
}

/// The line through stamps against their number.
struct EvenClock {
    t0: f64,
    dt: f64,
    /// Of the deviations from it (s), and correlation of neighbouring ones.
    rms: f64,
    correlation: f64,
}

impl EvenClock {
    fn through(t: &[f64]) -> Self {
        let n = t.len() as f64;
        let (mid, mean) = (0.5 * (n - 1.0), t.iter().map(|x| x - t[0]).sum::<f64>() / n);
        let about = |i: usize| i as f64 - mid;
        let dt =
            t.iter().enumerate().map(|(i, x)| about(i) * (x - t[0] - mean)).sum::<f64>() / (n * (n * n - 1.0) / 12.0);
        let e: Vec<f64> = t.iter().enumerate().map(|(i, x)| x - t[0] - mean - dt * about(i)).collect();
        let square = e.iter().map(|x| x * x).sum::<f64>();
        let neighbours = e.windows(2).map(|w| w[0] * w[1]).sum::<f64>();
        let correlation = if square > 0.0 { neighbours / square } else { 0.0 };
        Self { t0: t[0] + mean - dt * mid, dt, rms: (square / n).sqrt(), correlation }
    }
}

/// Root mean square of divided differences of order six at `times`, each over its size for white noise: the noise of every column, and
/// what is not smooth about it.
fn roughness(times: &[f64], q: &DMatrix<f64>) -> Vec<f64> {
    let n = times.len();
    let scale = (n - 1) as f64 / (times[n - 1] - times[0]);
    let mut squares = vec![0.0; q.ncols()];
    for first in 0..=n - WINDOW {
        let t = &times[first..first + WINDOW];
        let w: [f64; WINDOW] = core::array::from_fn(|a| {
            1.0 / (0..WINDOW).filter(|&b| b != a).map(|b| scale * (t[a] - t[b])).product::<f64>()
        });
        let variance: f64 = w.iter().map(|w| w * w).sum();
        for (j, s) in squares.iter_mut().enumerate() {
            *s += w.iter().enumerate().map(|(a, w)| w * q[(first + a, j)]).sum::<f64>().powi(2) / variance;
        }
    }
    squares.iter().map(|s| (s / (n + 1 - WINDOW) as f64).sqrt()).collect()
}

/// Geometric mean of `a / b` over the joints that move.
fn ratio(a: &[f64], b: &[f64]) -> Option<f64> {
    let logs: Vec<f64> = a.iter().zip(b).filter(|(a, b)| **a > 0.0 && **b > 0.0).map(|(a, b)| (a / b).ln()).collect();
    (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(k: usize) -> f64 {
        let a = (k as f64 * 12.9898 + 4.1).sin() * 43758.5453;
        2.0 * (a - a.floor()) - 1.0
    }
    /// Stamps at 100 Hz that scatter by up to 4 ms, and the motion at `at(stamp, even time)`.
    fn log(at: impl Fn(f64, f64) -> f64) -> (Vec<f64>, DMatrix<f64>) {
        let even = |i: usize| 0.01 * i as f64;
        let t: Vec<f64> = (0..800).map(|i| even(i) + 4e-3 * noise(i)).collect();
        let q = DMatrix::from_fn(800, 2, |i, j| {
            (1.1 * at(t[i], even(i)) + j as f64).sin() + 2e-5 * noise(3000 + 2 * i + j)
        });
        (t, q)
    }

    #[test]
    fn true_times_and_noisy_stamps_are_told_apart_by_the_motion() {
        let (t, q) = log(|stamp, _| stamp);
        let mut bad = Problems::default();
        assert!(matches!(judge(t.clone(), Some(&q), &mut bad), Judged::Own(own) if own == t));
        assert!(bad.has("Data::Jitter") && !bad.has_errors(), "{bad}");
        let (t, q) = log(|_, even| even);
        let mut bad = Problems::default();
        let Judged::Even { t0, dt } = judge(t, Some(&q), &mut bad) else { panic!("{bad}") };
        assert!(t0.abs() < 3e-4 && (dt - 0.01).abs() < 2e-6, "{t0} {dt}");
        assert!(bad.has("Data::Jitter") && !bad.has_errors(), "{bad}");
    }

    #[test]
    fn lost_samples_are_no_noisy_stamps() {
        let (t, q) = log(|_, even| even);
        let even: Vec<f64> = (0..t.len()).map(|i| 0.01 * i as f64).collect();
        let kept: Vec<usize> = (0..t.len()).filter(|i| noise(*i) < 0.9).collect();
        let (t, q) = (kept.iter().map(|&i| even[i]).collect::<Vec<f64>>(), q.select_rows(&kept));
        let mut bad = Problems::default();
        assert!(matches!(judge(t.clone(), Some(&q), &mut bad), Judged::Own(own) if own == t), "{bad}");
    }
}
