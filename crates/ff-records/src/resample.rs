//! Signals with sample times of their own, brought to a uniform grid.
//!
//! A polynomial of degree five runs through the six samples nearest to every instant of the grid (Lagrange, for any spacing of the
//! samples). With samples no further than `h` apart, a signal is wrong by at most `h^6 max|f^(6)| / 205` between the middle two
//! (`docs/theory/output-operator.md`). Between samples far apart the polynomial follows nothing that was measured: gaps are refused.

use crate::time_base::ChannelGroup;
use nalgebra::DMatrix;

/// Samples in a stencil.
const N: usize = 6;
/// Longest interval between samples, in usual (median) intervals, that is interpolated over.
pub(crate) const WIDEST_GAP: f64 = 4.0;

/// Why the times of a group of channels do not do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TimeBaseError {
    /// All channels are needed on one uniform clock.
    #[error("the {} has sample times of its own, and {what} needs all channels on one uniform clock; bring the record to it (Record::resampled)", group.name())]
    NotUniform {
        /// Channels with times of their own.
        group: ChannelGroup,
        /// What needs the clock.
        what: &'static str,
    },
    /// Too few samples for a stencil.
    #[error("the {} has {got} samples, interpolation needs {N}; record longer", group.name())]
    TooFew {
        /// Which channels.
        group: ChannelGroup,
        /// Samples there are.
        got: usize,
    },
    /// Too long without samples.
    #[error(
        "the {} has no sample from {from} to {to} s, {:.1} usual intervals (limit {WIDEST_GAP}); cut the record there",
        group.name(), (to - from) / usual
    )]
    Gap {
        /// Which channels.
        group: ChannelGroup,
        /// Last sample before the gap (s since the first of the grid).
        from: f64,
        /// First sample behind it (s).
        to: f64,
        /// Median interval (s).
        usual: f64,
    },
    /// The grid goes on where there are no samples.
    #[error(
        "the {} was sampled from {from} to {to} s, the joint motion from 0 to {end} s, more than one interval further; cut the record to what all channels cover",
        group.name()
    )]
    Outside {
        /// Which channels.
        group: ChannelGroup,
        /// Its first sample (s since the first of the grid).
        from: f64,
        /// Its last sample (s).
        to: f64,
        /// Last instant of the grid (s).
        end: f64,
    },
}

/// Median interval of ascending times; at least two. Allocates.
pub(crate) fn usual_interval(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    let mid = steps.len() / 2;
    *steps.select_nth_unstable_by(mid, f64::total_cmp).1
}

/// The columns of `values` (one row per time, s, ascending) of a group of channels at `0, dt, 2 dt, ...`, `samples` of them. Allocates.
///
/// # Errors
/// [`TimeBaseError`].
pub fn on_grid(
    group: ChannelGroup,
    times: &[f64],
    values: &DMatrix<f64>,
    dt: f64,
    samples: usize,
) -> Result<DMatrix<f64>, TimeBaseError> {
    on_grid_across(WIDEST_GAP, group, times, values, dt, samples)
}

/// [`on_grid`] with gaps of up to so many usual intervals, across which the polynomials lead as well. Allocates.
///
/// # Errors
/// As [`on_grid`].
pub fn on_grid_across(
    widest: f64,
    group: ChannelGroup,
    times: &[f64],
    values: &DMatrix<f64>,
    dt: f64,
    samples: usize,
) -> Result<DMatrix<f64>, TimeBaseError> {
    let usual = enough(group, times)?;
    if let Some(w) = times.windows(2).find(|w| w[1] - w[0] > widest * usual) {
        return Err(TimeBaseError::Gap { group, from: w[0], to: w[1], usual });
    }
    let (from, to, end) = (times[0], times[times.len() - 1], (samples - 1) as f64 * dt);
    // A hair more than an interval, for jitter.
    if from > 1.5 * usual || to < end - 1.5 * usual {
        return Err(TimeBaseError::Outside { group, from, to, end });
    }
    Ok(bridge((widest, usual), times, values, dt, samples))
}

/// [`on_grid`] without a limit to gaps, across which values lie on a straight line; before the first and behind the last sample they are held.
///
/// # Errors
/// [`TimeBaseError`].
pub(crate) fn bridged(
    group: ChannelGroup,
    times: &[f64],
    values: &DMatrix<f64>,
    dt: f64,
    samples: usize,
) -> Result<DMatrix<f64>, TimeBaseError> {
    let usual = enough(group, times)?;
    Ok(bridge((WIDEST_GAP, usual), times, values, dt, samples))
}

/// Median interval of at least as many times as a polynomial goes through.
fn enough(group: ChannelGroup, times: &[f64]) -> Result<f64, TimeBaseError> {
    let got = times.len();
    if got < N { Err(TimeBaseError::TooFew { group, got }) } else { Ok(usual_interval(times)) }
}

/// By polynomials through six samples, and on straight lines where two of them are further apart than `widest` times the `usual` interval.
fn bridge((widest, usual): (f64, f64), times: &[f64], values: &DMatrix<f64>, dt: f64, samples: usize) -> DMatrix<f64> {
    let got = times.len();
    let mut out = DMatrix::zeros(samples, values.ncols());
    let mut next = 0;
    for i in 0..samples {
        let t = i as f64 * dt;
        while next < got && times[next] <= t {
            next += 1;
        }
        // Three samples on each side; at the ends the nearest six.
        let first = next.saturating_sub(N / 2).min(got - N);
        let wide = |w: &[f64]| w[1] - w[0] > widest * usual;
        let outside = t < times[0] - 1.5 * usual || t > times[got - 1] + 1.5 * usual;
        if outside || times[first..first + N].windows(2).any(wide) {
            let b = next.clamp(1, got - 1);
            let s = ((t - times[b - 1]) / (times[b] - times[b - 1])).clamp(0.0, 1.0);
            for c in 0..values.ncols() {
                out[(i, c)] = values[(b - 1, c)] + s * (values[(b, c)] - values[(b - 1, c)]);
            }
            continue;
        }
        let w = weights(&times[first..first + N], t);
        for c in 0..values.ncols() {
            out[(i, c)] = (0..N).map(|k| w[k] * values[(first + k, c)]).sum();
        }
    }
    out
}

/// Lagrange's weights of the samples at `times` for the value at `t`.
fn weights(times: &[f64], t: f64) -> [f64; N] {
    core::array::from_fn(|k| {
        (0..N).filter(|&j| j != k).map(|j| (t - times[j]) / (times[k] - times[j])).product::<f64>()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const USUAL: f64 = 0.02;

    /// Times with a fifth of an interval of jitter, and every ninth lost.
    fn times(end: f64) -> Vec<f64> {
        let all = (0..).map(|i| USUAL * (i as f64 + 0.2 * (2.3 * i as f64).sin()));
        all.take_while(|t| *t < end).enumerate().filter(|(i, _)| i % 9 != 4).map(|(_, t)| t).collect()
    }
    fn signal(t: f64, c: usize) -> f64 {
        (3.1 * t + 0.4 * c as f64).sin() + 0.2 * (8.0 * t).cos()
    }

    #[test]
    fn a_smooth_signal_comes_out_with_the_error_of_its_sixth_derivative() {
        let t = times(2.0);
        let values = DMatrix::from_fn(t.len(), 2, |i, c| signal(t[i], c));
        let got = on_grid(ChannelGroup::Gyro, &t, &values, 0.013, 150).unwrap();
        // Samples are up to 2.4 intervals apart; f^(6) is at most 3.1^6 + 0.2 8^6.
        let (h, sixth) = (2.4 * USUAL, 3.1f64.powi(6) + 0.2 * 8f64.powi(6));
        let mut worst = 0.0f64;
        for i in 5..145 {
            for c in 0..2 {
                worst = worst.max((got[(i, c)] - signal(0.013 * i as f64, c)).abs());
            }
        }
        let bound = h.powi(6) * sixth / 204.8;
        assert!(worst < bound && worst > 1e-4 * bound, "{worst:e} {bound:e}");
        // Polynomials up to degree five are exact, at the ends, too.
        let p = |t: f64| 0.3 - t + 2.0 * t.powi(3) - 0.7 * t.powi(5);
        let values = DMatrix::from_fn(t.len(), 1, |i, _| p(t[i]));
        let got = on_grid(ChannelGroup::Gyro, &t, &values, 0.013, 150).unwrap();
        assert!((0..150).all(|i| (got[(i, 0)] - p(0.013 * i as f64)).abs() < 1e-10));
    }

    #[test]
    fn what_was_not_measured_is_refused() {
        let on = |t: &[f64], samples| {
            let values = DMatrix::from_element(t.len(), 1, 0.3);
            on_grid(ChannelGroup::Torque, t, &values, 0.01, samples)
        };
        let mut t = times(2.0);
        assert!(matches!(on(&t, 230), Err(TimeBaseError::Outside { end, .. }) if end == 2.29));
        assert!(matches!(on(&t[..5], 10), Err(TimeBaseError::TooFew { got: 5, .. })));
        t.drain(40..45);
        let e = on(&t, 180).unwrap_err();
        assert!(matches!(e, TimeBaseError::Gap { from, .. } if from == t[39]), "{e}");
        assert!(e.to_string().starts_with("the torque has no sample from"), "{e}");
    }
}
