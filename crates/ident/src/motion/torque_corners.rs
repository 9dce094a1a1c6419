//! Instants at which torques jump or bend: those at which the accelerations of joints do.
//!
//! A torque follows the acceleration at once, and its sensor tells a corner of it far better than an encoder does: within 0.04 s, a jerk that jumps by
//! 1 rad/s^3 changes the torque of 10 kg m^2 by 0.4 N m, and the position by 1e-5 rad. Over `2 W` readings about the middle between two of them, polynomials of
//! degree 5 are taken off the readings `y` of every channel, off a step and off a ramp `x` there, and
//!
//! ```text
//! F = sum over channels of (x^T y)^2 / (s^2 x^T x)
//! ```
//!
//! is by how much chi-squared would fall with a corner at that instant. Windows are `W` = 6, 12, 24 ... readings up to half a second, the shortest first, and hold no
//! corner that was found before. A ramp that begins beside the middle is one there with a step, of which its instant follows. A corner of the torque that is none of the motion, such as dry friction at
//! a reversal, finds no size in the positions (`crate::motion::kink_search`).

use crate::motion::kink_search::usual_noise;
use crate::motion::spline_fit::{JointSamples, is_even};
use ff_records::time_base::ChannelGroup;
use ff_records::{Averaging, Record};
use nalgebra::{DMatrix, DVector};

/// Where torques have a corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// When (s).
    pub time: f64,
    /// Which derivative of the positions jumps: 2 where the torque jumps, 3 where it bends.
    pub order: usize,
}

/// Readings on either side of an instant at least, time on either side at most (s): what a polynomial follows of modes; and the degree of the polynomials.
const SHORTEST: usize = 6;
const LONGEST: f64 = 0.5;
const DEGREE: i32 = 5;
/// Fall of chi-squared from which there is a corner, beside one for each channel.
const SEEN: f64 = 50.0;
/// Intervals between readings by which the beginning of a ramp may be beside the middle.
const BESIDE: f64 = 1.5;
/// Interval between torques over that of the record from which they have a clock of their own.
const SLOWER: f64 = 1.2;
/// Corners for so many readings are none: what is not smooth at all has none that could be told.
const EVERY: usize = 8;

/// Corners of the torques of a record, whose missing readings are taken to lie on the line between their neighbours. Allocates.
pub(crate) fn corners_of(record: &Record, sigma: f64) -> Vec<Corner> {
    let own = || (record.tau(), record.times(ChannelGroup::Torque));
    let ((tau, times), dt) = (record.averaging().map_or_else(own, Averaging::torques), record.dt());
    let Some(times) = times.filter(|t| t.len() > 1) else {
        return torque_corners(tau, dt, sigma);
    };
    // Readings of a slower clock have none in between.
    let usual = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    if usual > SLOWER * dt {
        let from_first: Vec<f64> = times.iter().map(|t| t - times[0]).collect();
        if is_even(&from_first).is_err() {
            return Vec::new();
        }
        return torque_corners(tau, usual, sigma)
            .into_iter()
            .map(|c| Corner { time: c.time + times[0], ..c })
            .collect();
    }
    let count = ((times[times.len() - 1] - times[0]) / dt).round() as usize + 1;
    let mut next = 1;
    let mut even = DMatrix::zeros(tau.ncols(), count);
    for i in 0..count {
        let t = times[0] + i as f64 * dt;
        while next + 1 < times.len() && times[next] < t {
            next += 1;
        }
        let part = ((t - times[next - 1]) / (times[next] - times[next - 1])).clamp(0.0, 1.0);
        for c in 0..tau.ncols() {
            even[(c, i)] = tau[(next - 1, c)] * (1.0 - part) + tau[(next, c)] * part;
        }
    }
    let found = torque_corners(&even.transpose(), dt, sigma);
    found.into_iter().map(|c| Corner { time: c.time + times[0], ..c }).collect()
}

/// Corners of torques (samples x joints) read every `dt` (s), with noise of this deviation or more, in the order of time; none where there are too many. Allocates.
fn torque_corners(tau: &DMatrix<f64>, dt: f64, sigma: f64) -> Vec<Corner> {
    let (samples, n) = tau.shape();
    if !(sigma > 0.0 && dt > 0.0) || samples < 4 * SHORTEST {
        return Vec::new();
    }
    let (times, rows): (Vec<f64>, _) = ((0..samples).map(|i| i as f64 * dt).collect(), tau.transpose());
    let readings = JointSamples { dof: n, times: &times, q: rows.as_slice(), qd: None, rate_weight: 0.0 };
    let measured = usual_noise(&readings, &vec![f64::INFINITY; n]);
    let over = |(c, noise): (usize, &f64)| {
        let noise = if noise.is_finite() { noise.max(sigma) } else { sigma };
        tau.column(c).iter().map(|x| x / noise).collect()
    };
    let scaled: Vec<Vec<f64>> = measured.iter().enumerate().map(over).collect();
    let mut found: Vec<(usize, Corner)> = Vec::new();
    let fits = |half: &usize| *half == SHORTEST || *half as f64 * dt <= LONGEST;
    let halves = core::iter::successors(Some(SHORTEST), |half| Some(2 * half)).take_while(fits);
    for half in halves.take_while(|half| 4 * half < samples) {
        let [step, ramp] = columns(half);
        let falls: Vec<[f64; 2]> = (0..=samples - 2 * half)
            .map(|from| {
                let of = |x: &DVector<f64>| {
                    let dot =
                        |y: &Vec<f64>| y[from..from + 2 * half].iter().zip(x.iter()).map(|(y, x)| y * x).sum::<f64>();
                    scaled.iter().map(|y| dot(y).powi(2)).sum::<f64>() / x.norm_squared()
                };
                [of(&step), of(&ramp)]
            })
            .collect();
        let most = |f: &[f64; 2]| f[0].max(f[1]);
        let mut order: Vec<usize> = (0..falls.len()).filter(|&i| most(&falls[i]) > n as f64 + SEEN).collect();
        order.sort_by(|&a, &b| most(&falls[b]).total_cmp(&most(&falls[a])));
        for from in order {
            let first = from + half;
            // Of this length a corner is seen from the whole of its window, of shorter ones no window may hold any.
            if found.iter().any(|(at, _)| at.abs_diff(first) < half) {
                continue;
            }
            let middle = (first as f64 - 0.5) * dt;
            let [by_step, by_ramp] = falls[from];
            found.push((
                first,
                if by_step > by_ramp {
                    Corner { time: middle, order: 2 }
                } else {
                    Corner { time: middle + beside(&scaled, from, [&step, &ramp]) * dt, order: 3 }
                },
            ));
        }
    }
    if found.len() * EVERY > samples {
        return Vec::new();
    }
    let mut corners: Vec<Corner> = found.into_iter().map(|f| f.1).collect();
    corners.sort_by(|a, b| a.time.total_cmp(&b.time));
    corners
}

/// A step and a ramp from the middle of a window on, without the polynomials.
fn columns(half: usize) -> [DVector<f64>; 2] {
    let n = 2 * half;
    let at = |i: usize| i as f64 - half as f64 + 0.5;
    let powers = DMatrix::from_fn(n, DEGREE as usize + 1, |i, k| (at(i) / half as f64).powi(k as i32));
    let basis = powers.qr().q();
    let off = |x: DVector<f64>| &x - &basis * basis.tr_mul(&x);
    [off(DVector::from_fn(n, |i, _| f64::from(at(i) > 0.0))), off(DVector::from_fn(n, |i, _| at(i).max(0.0)))]
}

/// Intervals by which a ramp begins behind the middle of a window: `y = b (u - d)_+` is `b u_+ - b d` there.
fn beside(scaled: &[Vec<f64>], from: usize, [step, ramp]: [&DVector<f64>; 2]) -> f64 {
    let (ss, sr, rr) = (step.norm_squared(), step.dot(ramp), ramp.norm_squared());
    let determinant = ss * rr - sr * sr;
    let (mut products, mut squares) = (0.0, 0.0);
    for y in scaled {
        let dot = |x: &DVector<f64>| y[from..from + x.len()].iter().zip(x.iter()).map(|(y, x)| y * x).sum::<f64>();
        let (s, r) = (dot(step), dot(ramp));
        let (a, b) = ((s * rr - r * sr) / determinant, (r * ss - s * sr) / determinant);
        products += a * b;
        squares += b * b;
    }
    let d = -products / squares;
    if d.is_finite() { d.clamp(-BESIDE, BESIDE) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Two channels that swing, with noise of unit deviation and these jumps and bends.
    fn torques(corners: &[(f64, usize, f64)], dt: f64) -> DMatrix<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        DMatrix::from_fn(3000, 2, |i, c| {
            let t = i as f64 * dt;
            let noise: f64 = StandardNormal.sample(&mut rng);
            let swing = 70.0 * (1.3 * t + c as f64).sin() + 11.0 * (4.1 * t).cos();
            let of = |&(at, order, size): &(f64, usize, f64)| {
                let u = t - at;
                (if u < 0.0 {
                    0.0
                } else if order == 2 {
                    1.0
                } else {
                    u
                }) * size
                    * (0.4 + c as f64)
            };
            swing + noise + corners.iter().map(of).sum::<f64>()
        })
    }

    #[test]
    fn corners_are_found_where_they_are_and_nowhere_else() {
        let dt = 0.02;
        assert_eq!(torque_corners(&torques(&[], dt), dt, 1.0), []);
        let truth = [(7.313, 3, 160.0), (7.909, 3, -170.0), (20.111, 2, 12.0), (31.77, 3, 90.0), (41.007, 2, -55.0)];
        let found = torque_corners(&torques(&truth, dt), dt, 1.0);
        assert_eq!(found.len(), truth.len(), "{found:?}");
        for (f, t) in found.iter().zip(&truth) {
            assert_eq!(f.order, t.1, "{found:?}");
            assert!((f.time - t.0).abs() < 0.6 * dt, "{f:?} {t:?}");
        }
        // Noise that is louder than was said is measured.
        assert_eq!(torque_corners(&(torques(&[], dt) * 9.0), dt, 1.0), []);
    }
}
