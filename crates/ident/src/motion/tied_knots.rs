//! Times of the knots of a plan that positions and torques tell together.
//!
//! Positions tell when a jerk of size `J` jumps to `s_q`, the deviation of the size of the kink of one order less over `J`
//! (`crate::motion::spline_fit::movable`). Torques tell it as the instant of a bend ([`Corner`]), to
//!
//! ```text
//! s_c = SHARP / (w |J|)            w: what a unit acceleration takes, in deviations of the torque sensors
//! ```
//!
//! Where both are of one instant, the mean with weights `s^-2` is taken. Torques may all be late: the middle difference is taken off them. `SHARP` is the one of a
//! few factors at which the differences are likeliest.

use crate::motion::kink::{Kink, with_times};
use crate::motion::spline_basis::SplineBasis;
use crate::motion::spline_fit::{DEGREE, FitError, JointSamples, spans};
use crate::motion::torque_corners::Corner;

/// Deviations of the instant of a bend in torques that bend by one deviation in a second (s). It was 2.5 for 40 to 60 bends each of four sizes in a record whose bends are known.
const SHARP: [f64; 8] = [0.15, 0.3, 0.6, 1.2, 2.5, 5.0, 10.0, 20.0];
/// Factor on the knots of the spline that plans are beside: what it takes up of them is not told.
const WIDER: f64 = 4.0;
/// Intervals between samples about a knot in which there may be a bend of it, and deviations of their difference.
const NEAR: f64 = 2.0;
const ALIKE: f64 = 3.0;
/// Bends that tell by how much torques are late, at least.
const SEVERAL: usize = 8;
/// Intervals within which the knot of another joint, of which torques bend by no less than a part as much, makes a bend its own.
const BESIDE: f64 = 4.0;
const LESS: f64 = 0.25;
/// What the error of a time must fall to for torques to count.
const GAIN: f64 = 0.8;

/// Kinks at these times, and what errors of them leave.
pub(super) struct Tied {
    pub(super) kinks: Vec<Kink>,
    /// Kinks of one order less, and the deviation of the size of each: what the error of a time adds to the motion to first order.
    pub(super) errors: Vec<(Kink, f64)>,
}

/// One knot, by its lowest kink.
struct Knot {
    kink: Kink,
    /// Deviations of the torques over s.
    bends: f64,
    /// Deviation of its time (s).
    sigma: f64,
    size: f64,
}

/// Kinks of plans beside splines with knots `spacing` (s) apart, through positions with this `noise` (rad or m), at times that `corners` tell as well. Allocates.
pub(super) fn tied(
    s: &JointSamples<'_>,
    spacing: f64,
    kinks: &[Kink],
    (noise, weights): (&[f64], &[f64]),
    corners: &[Corner],
) -> Result<Tied, FitError> {
    let mut out = Tied { kinks: kinks.to_vec(), errors: Vec::new() };
    if !kinks.iter().any(is_bend) || !corners.iter().any(|c| c.order == 3) {
        return Ok(out);
    }
    let basis = SplineBasis::new(s, spans(s, WIDER * spacing), DEGREE, false)?;
    let smooth = basis.smooth(s);
    let mut knots = Vec::new();
    for j in 0..s.dof {
        let own: Vec<Kink> = kinks.iter().filter(|k| k.joint == j).copied().collect();
        let (lowest, both) = with_times(&own);
        // Times that positions do not tell one by one stay.
        let Ok(bent) = basis.bend(s, j, &both, &smooth.row(j).transpose()) else { continue };
        knots.extend(lowest.iter().enumerate().map(|(i, &k)| {
            let size = bent.sizes[k];
            let sigma = noise[j] * bent.variances[own.len() + i].sqrt() / size.abs();
            Knot { kink: own[k], bends: weights[j] * size.abs(), sigma, size }
        }));
    }
    let dt = s.times[s.times.len() - 1] / (s.times.len() - 1) as f64;
    let late = late(&knots, corners, dt);
    let corners: Vec<Option<f64>> = knots.iter().map(|k| nearest(&knots, k, corners, late, dt)).collect();
    let sharp = sharp(&knots, &corners);
    for (knot, corner) in knots.iter().zip(corners) {
        let of_torques = sharp / knot.bends;
        let alike = |c: &f64| (c - knot.kink.time).abs() < ALIKE * knot.sigma.hypot(of_torques);
        let Some(corner) = corner.filter(alike) else { continue };
        let (of_q, of_c) = (knot.sigma.powi(-2), of_torques.powi(-2));
        let sigma = (of_q + of_c).sqrt().recip();
        if sigma > GAIN * knot.sigma {
            continue;
        }
        let time = (of_q * knot.kink.time + of_c * corner) / (of_q + of_c);
        let own = out.kinks.iter_mut().filter(|k| k.joint == knot.kink.joint && k.time == knot.kink.time);
        own.for_each(|k| k.time = time);
        out.errors.push((Kink { time, ..knot.kink }.by_time(), sigma * knot.size.abs()));
    }
    Ok(out)
}

/// Of [`SHARP`]: minus twice the logarithm of the likelihood is least, of differences that count for no more than [`ALIKE`] deviations each.
fn sharp(knots: &[Knot], corners: &[Option<f64>]) -> f64 {
    let unlikely = |sharp: f64| {
        let one = |(k, c): (&Knot, &Option<f64>)| {
            let variance = k.sigma.powi(2) + (sharp / k.bends).powi(2);
            Some(variance.ln() + ((*c)? - k.kink.time).powi(2).min(ALIKE * ALIKE * variance) / variance)
        };
        knots.iter().zip(corners).filter_map(one).sum::<f64>()
    };
    SHARP.into_iter().min_by(|a, b| unlikely(*a).total_cmp(&unlikely(*b))).unwrap_or(SHARP[SHARP.len() / 2])
}

/// Whether torques bend at a kink, if no other is below it.
fn is_bend(kink: &Kink) -> bool {
    kink.order == 3
}

/// The bend next to a knot that is of no other.
fn nearest(knots: &[Knot], knot: &Knot, corners: &[Corner], late: f64, dt: f64) -> Option<f64> {
    if !is_bend(&knot.kink) {
        return None;
    }
    let shared = |k: &Knot| {
        let apart = (k.kink.time - knot.kink.time).abs();
        k.kink != knot.kink && apart < BESIDE * dt && k.bends > LESS * knot.bends
    };
    let bends = corners.iter().filter(|c| c.order == 3).map(|c| c.time - late);
    let near = bends.min_by(|a, b| (a - knot.kink.time).abs().total_cmp(&(b - knot.kink.time).abs()))?;
    let apart = (near - knot.kink.time).abs();
    let nearer = |k: &Knot| k.kink.joint == knot.kink.joint && (near - k.kink.time).abs() < apart;
    (apart < NEAR * dt && !knots.iter().any(|k| shared(k) || nearer(k))).then_some(near)
}

/// By how much torques are late: the middle one of the differences.
fn late(knots: &[Knot], corners: &[Corner], dt: f64) -> f64 {
    let apart = |k: &Knot| Some(nearest(knots, k, corners, 0.0, dt)? - k.kink.time);
    let mut apart: Vec<f64> = knots.iter().filter_map(apart).collect();
    if apart.len() < SEVERAL {
        return 0.0;
    }
    apart.sort_by(f64::total_cmp);
    apart[apart.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::planned::Positions;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const DT: f64 = 0.02;
    const SIGMA: f64 = 1e-4;

    /// Bends of two joints, half a second apart and more.
    fn bends() -> Vec<(Kink, f64)> {
        let mut rng = ChaCha8Rng::seed_from_u64(17);
        let mut out = Vec::new();
        for joint in 0..2 {
            let mut time = 0.9 + 0.31 * joint as f64;
            for i in 0..14 {
                let size = (0.4 + 0.5 * rng.random::<f64>()) * if i % 4 == 1 || i % 4 == 2 { -1.0 } else { 1.0 };
                out.push((Kink { joint, time, order: 3 }, size));
                time += 0.62 + 0.17 * rng.random::<f64>();
            }
        }
        out
    }

    #[test]
    fn torques_that_tell_bends_better_place_them_and_late_ones_alike() {
        let (bends, mut rng) = (bends(), ChaCha8Rng::seed_from_u64(19));
        let times: Vec<f64> = (0..640).map(|i| DT * f64::from(i)).collect();
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let position = |joint: usize, t: f64| {
            let own = bends.iter().filter(|b| b.0.joint == joint);
            own.map(|(k, size)| size * (t - k.time).max(0.0).powi(3) / 6.0).sum::<f64>()
        };
        let q: Vec<f64> = times.iter().flat_map(|&t| [position(0, t), position(1, t)]).collect();
        let q: Vec<f64> = q.iter().map(|q| q + SIGMA * normal()).collect();
        let s = JointSamples { dof: 2, times: &times, q: &q, qd: None, rate_weight: 0.0 };
        // As positions tell them, to some 6 ms; torques of 1000 deviations over rad/s^3 tell 1.5 ms.
        let found = |joint: usize| {
            let own: Vec<f64> = q.iter().skip(joint).step_by(2).copied().collect();
            let plan =
                Positions { times: &times, q: &own, sigma: SIGMA, told: &[] }.planned(f64::INFINITY, 1.0).unwrap();
            plan.knots.into_iter().map(move |time| Kink { joint, time, order: 3 })
        };
        let off: Vec<Kink> = found(0).chain(found(1)).collect();
        assert_eq!(off.len(), bends.len());
        let error = |kinks: &[Kink]| {
            let squares = kinks.iter().zip(&bends).map(|(k, b)| (k.time - b.0.time).powi(2));
            (squares.sum::<f64>() / kinks.len() as f64).sqrt()
        };
        let corners: Vec<f64> = bends.iter().map(|(k, size)| k.time + 1.2e-3 / size.abs() * normal()).collect();
        for late in [0.0, 0.007] {
            let mut corners: Vec<Corner> = corners.iter().map(|t| Corner { time: t + late, order: 3 }).collect();
            corners.sort_by(|a, b| a.time.total_cmp(&b.time));
            let tied = tied(&s, 1.1, &off, (&[SIGMA; 2], &[1000.0; 2]), &corners).unwrap();
            let (before, now) = (error(&off), error(&tied.kinks));
            eprintln!("{late} {} {before} {now}", tied.errors.len());
            assert!(tied.errors.len() > 16 && now < 0.7 * before, "{late}: {} {before} {now}", tied.errors.len());
            // What is said of each is of the size of its error: none of the joint's other kinks is touched.
            for (k, size) in &tied.errors {
                let (i, _) =
                    tied.kinks.iter().enumerate().find(|(_, t)| t.joint == k.joint && t.time == k.time).unwrap();
                assert!(k.order == 2 && size / bends[i].1.abs() < 0.01, "{k:?} {size}");
            }
        }
        // Torques that tell nothing move nothing.
        let corners: Vec<Corner> = corners.iter().map(|&time| Corner { time, order: 3 }).collect();
        let tied = tied(&s, 1.1, &off, (&[SIGMA; 2], &[1.0; 2]), &corners).unwrap();
        assert!(tied.errors.is_empty() && tied.kinks == off);
    }
}
