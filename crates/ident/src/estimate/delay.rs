//! Predictions where sensors read them: interpolation of a uniform grid at sample times `t_i`, or at `t_i - d` for readings late by `d`, all channels of a
//! group alike or each by a lag of its own besides.
//!
//! A polynomial of degree five runs through the six samples around the wanted instant (Lagrange; at the ends of the record the
//! nearest six). A component at frequency f is wrong by at most `(2 pi f dt)^6 / 205` of itself: 5e-6 at a twentieth of the
//! sampling rate, 3e-10 at a hundredth. Weights are polynomials of the delay, so that the derivative is exact.
//! Derivation of the bound, and what it means for estimates: `docs/theory/output-operator.md`.

use crate::estimate::estimator::STENCIL;
use core::ops::Range;
use nalgebra::DMatrix;
use std::sync::Arc;

/// Samples in a stencil.
const N: usize = STENCIL;

/// Samples beyond the ends of the record for which there is extrapolation.
const BEYOND: f64 = 1.0;

/// Predictions on a uniform grid, taken at the sample times of a group of channels, perhaps later than that by a delay.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OutputOperator {
    /// Samples and interval (s) of the grid.
    grid: usize,
    dt: f64,
    /// Sample times (s); those of the grid where there are none.
    times: Option<Arc<[f64]>>,
    /// Delay over `dt`.
    shift: f64,
    /// What is added to that for each channel; empty where all are alike.
    lags: Vec<f64>,
    /// Readings that are means over time.
    means: Option<Kernel>,
}

/// What a mean is made of: an odd number of weights, about its instant.
#[derive(Clone, Debug, PartialEq)]
struct Kernel {
    weights: Arc<[f64]>,
    /// How far apart what they weigh is, over `dt`.
    spacing: f64,
}

impl Kernel {
    /// How far it reaches to either side.
    fn reach(&self) -> f64 {
        (self.weights.len() / 2) as f64 * self.spacing
    }
}

/// First sample of the grid, weights of it and those behind, and their derivatives with respect to the delay (1/s).
struct Stencil {
    first: usize,
    weights: Parts,
    slopes: Parts,
}

/// Weights of one instant, or of a mean.
enum Parts {
    Instant([f64; N]),
    Mean(Vec<f64>),
}

impl core::ops::Deref for Parts {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        match self {
            Self::Instant(parts) => parts,
            Self::Mean(parts) => parts,
        }
    }
}

impl OutputOperator {
    /// For a grid of `grid` samples (at least six) at `dt`, and readings at `times` since its first (s), or on it, that are late by
    /// `delay_s`; `None` when that is no shorter than the grid.
    pub(crate) fn new(grid: usize, dt: f64, times: Option<Arc<[f64]>>, delay_s: f64) -> Option<Self> {
        let shift = delay_s / dt;
        (grid >= N && shift.abs() < grid as f64).then_some(Self {
            grid,
            dt,
            times,
            shift,
            lags: Vec::new(),
            means: None,
        })
    }
    /// With channels that are later than that by lags of their own (s), none for channels that are alike; `None` when one is no shorter than the grid.
    pub(crate) fn with_lags(mut self, lags: &[f64]) -> Option<Self> {
        self.lags = lags.iter().map(|lag| lag / self.dt).collect();
        let fits = |lag: &f64| (self.shift + lag).abs() < self.grid as f64;
        self.lags.iter().all(fits).then_some(self)
    }
    /// Of readings that were averaged, if they were.
    pub(crate) fn of_means(self, means: Option<&ff_records::Means>) -> Self {
        match means {
            Some(means) => self.with_means(Arc::clone(means.weights()), means.spacing()),
            None => self,
        }
    }
    /// Of readings that are means with these weights, an odd number of them about the instant, of what is `spacing_s` (s) apart.
    fn with_means(self, weights: Arc<[f64]>, spacing_s: f64) -> Self {
        let spacing = spacing_s / self.dt;
        Self { means: Some(Kernel { weights, spacing }), ..self }
    }
    /// How far a reading reaches to either side, in samples.
    fn reach(&self) -> f64 {
        self.means.as_ref().map_or(0.0, Kernel::reach)
    }
    /// Where reading `i` looks at the grid with this lag, in samples.
    fn instant(&self, i: usize, lag: f64) -> f64 {
        self.times.as_ref().map_or(i as f64, |t| t[i] / self.dt) - self.shift - lag
    }
    /// Where the polynomial is taken for an instant.
    fn held(&self, at: f64) -> f64 {
        // Beyond the ends the polynomial of the last six samples serves for a little; then it would run away, and is held.
        let last = (self.grid - 1) as f64;
        at.clamp(-BEYOND, last + BEYOND)
    }
    /// That of a channel.
    fn lag(&self, channel: usize) -> f64 {
        self.lags.get(channel).copied().unwrap_or(0.0)
    }
    /// The largest and the smallest lag.
    fn latest(&self) -> f64 {
        self.lags.iter().copied().reduce(f64::max).unwrap_or(0.0)
    }
    fn earliest(&self) -> f64 {
        self.lags.iter().copied().reduce(f64::min).unwrap_or(0.0)
    }
    /// First of the six samples of the grid that are taken for an instant. Ascends with it.
    fn first_about(&self, at: f64) -> usize {
        (self.held(at).floor().max(0.0) as usize).saturating_sub(N / 2 - 1).min(self.grid - N)
    }
    /// First sample of the grid that reading `i` needs. Ascends with `i`.
    pub(crate) fn first(&self, i: usize) -> usize {
        self.first_about(self.instant(i, self.latest()) - self.reach())
    }
    /// The sample of the grid behind those that reading `i` needs.
    pub(crate) fn end(&self, i: usize) -> usize {
        self.first_about(self.instant(i, self.earliest()) + self.reach()) + N
    }
    /// The stencils of readings, one after the other, and how many each has: one for every channel, or one for all that are alike.
    fn stencils(&self, readings: Range<usize>) -> (Vec<Stencil>, usize) {
        let each = self.lags.len().max(1);
        (readings.flat_map(|i| (0..each).map(move |own| self.stencil(i, own))).collect(), each)
    }
    /// That of a channel, of which the first stands for all that are alike.
    fn stencil(&self, i: usize, channel: usize) -> Stencil {
        let at = self.instant(i, self.lag(channel));
        let Some(Kernel { weights, spacing }) = &self.means else {
            let (first, w, dw) = self.about(at);
            return Stencil { first, weights: Parts::Instant(w), slopes: Parts::Instant(dw) };
        };
        let reach = self.reach();
        let first = self.first_about(at - reach);
        let count = self.first_about(at + reach) + N - first;
        let (mut all, mut slopes) = (vec![0.0; count], vec![0.0; count]);
        for (k, weight) in weights.iter().enumerate() {
            let (own, w, dw) = self.about(at - reach + k as f64 * spacing);
            // Rounding may put the last of them a sample farther than the sum of all spacings does.
            let from = (own - first).min(count - N);
            for j in 0..N {
                all[from + j] += weight * w[j];
                slopes[from + j] += weight * dw[j];
            }
        }
        Stencil { first, weights: Parts::Mean(all), slopes: Parts::Mean(slopes) }
    }
    /// The first of six samples, their weights for an instant, and the derivatives of these.
    fn about(&self, at: f64) -> (usize, [f64; N], [f64; N]) {
        let (x, first) = (self.held(at), self.first_about(at));
        let u = x - first as f64;
        let (mut w, mut dw) = ([0.0; N], [0.0; N]);
        for k in 0..N {
            let others = || (0..N).filter(move |&j| j != k);
            let scale: f64 = others().map(|j| k as f64 - j as f64).product();
            w[k] = others().map(|j| u - j as f64).product::<f64>() / scale;
            let slope: f64 =
                others().map(|j| others().filter(|&l| l != j).map(|l| u - l as f64).product::<f64>()).sum();
            // u falls by one for every dt of delay; a held end does not move.
            dw[k] = if at == x { -slope / (scale * self.dt) } else { 0.0 };
        }
        (first, w, dw)
    }
    /// The first sample of the grid that the instant of reading `i` is made of, and the parts of it and those behind.
    pub(crate) fn parts(&self, i: usize) -> (usize, [f64; N]) {
        let (first, parts, _) = self.about(self.instant(i, self.lag(0)));
        (first, parts)
    }
    /// Values of the columns of `y` (grid x channels, of which row 0 is sample `from` of the grid) for the readings. Allocates.
    pub(crate) fn of(&self, y: &DMatrix<f64>, from: usize, readings: Range<usize>) -> DMatrix<f64> {
        self.weighted(y, from, readings, |s| &s.weights)
    }
    /// Derivative of [`OutputOperator::of`] with respect to the delay (unit of y per s). Allocates.
    pub(crate) fn slope(&self, y: &DMatrix<f64>, from: usize, readings: Range<usize>) -> DMatrix<f64> {
        self.weighted(y, from, readings, |s| &s.slopes)
    }
    fn weighted(
        &self,
        y: &DMatrix<f64>,
        from: usize,
        readings: Range<usize>,
        pick: impl Fn(&Stencil) -> &[f64],
    ) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(readings.len(), y.ncols());
        let (stencils, each) = self.stencils(readings);
        for (row, own) in stencils.chunks_exact(each).enumerate() {
            for c in 0..y.ncols() {
                let stencil = &own[c.min(each - 1)];
                let first = stencil.first - from;
                out[(row, c)] = pick(stencil).iter().enumerate().map(|(k, w)| w * y[(first + k, c)]).sum();
            }
        }
        out
    }
    /// [`OutputOperator::of`] for sensitivities: row `channels * i + c` of `d` holds channel c at sample i. Allocates.
    pub(crate) fn of_rows(
        &self,
        d: &DMatrix<f64>,
        channels: usize,
        from: usize,
        readings: Range<usize>,
    ) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(channels * readings.len(), d.ncols());
        let (stencils, each) = self.stencils(readings);
        for (mut out, d) in out.column_iter_mut().zip(d.column_iter()) {
            for (i, own) in stencils.chunks_exact(each).enumerate() {
                for c in 0..channels {
                    let Stencil { first, weights, .. } = &own[c.min(each - 1)];
                    let parts = weights.iter().enumerate();
                    out[channels * i + c] = parts.map(|(k, w)| w * d[channels * (first - from + k) + c]).sum();
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ff_testkit::scaled;

    const DT: f64 = 0.01;

    fn signal(t: f64, c: usize) -> f64 {
        (2.1 * t + 0.4 * c as f64).sin() + 0.3 * (7.3 * t - 1.1).cos()
    }
    fn sampled(shift: f64) -> DMatrix<f64> {
        DMatrix::from_fn(80, 2, |i, c| signal(i as f64 * DT - shift, c))
    }

    #[test]
    fn smooth_signals_are_delayed_and_advanced() {
        for d in [0.003, -0.0041, 0.0272, 0.0, -0.05] {
            let delay = OutputOperator::new(80, DT, None, d).unwrap();
            let (got, want) = (delay.of(&sampled(0.0), 0, 0..80), sampled(d));
            // Where the wanted instant lies in the record.
            for i in 6..74 {
                for c in 0..2 {
                    assert_relative_eq!(got[(i, c)], want[(i, c)], epsilon = scaled(1e-9));
                }
            }
            let rows = delay.of_rows(&DMatrix::from_fn(160, 1, |k, _| signal((k / 2) as f64 * DT, k % 2)), 2, 0, 0..80);
            assert!((0..160).all(|k| rows[k] == got[(k / 2, k % 2)]));
        }
    }

    #[test]
    fn the_slope_is_the_derivative_also_at_the_ends() {
        let (y, h) = (sampled(0.0), 1e-6);
        let at = |d: f64| OutputOperator::new(80, DT, None, d).unwrap().of(&y, 0, 0..80);
        for d in [0.0034, -0.0241] {
            let slope = OutputOperator::new(80, DT, None, d).unwrap().slope(&y, 0, 0..80);
            assert_relative_eq!(slope, (at(d + h) - at(d - h)) / (2.0 * h), epsilon = scaled(1e-7));
        }
    }

    #[test]
    fn impossible_delays_are_refused() {
        let new = |grid, d| OutputOperator::new(grid, DT, None, d);
        assert!(new(5, 0.001).is_none() && new(80, 0.81).is_none() && new(80, f64::NAN).is_none());
    }

    /// Sample times with jitter, at another rate than the grid, some lost.
    fn times() -> Arc<[f64]> {
        (0..130).filter(|i| i % 11 != 5).map(|i| 0.006 * (i as f64 + 0.3 * (1.9 * i as f64).sin()).max(0.0)).collect()
    }

    #[test]
    fn readings_at_times_of_their_own_are_within_the_bound_of_the_docs() {
        let (y, times) = (sampled(0.0), times());
        // f^(6) = 2.1^6 sin + 0.3 7.3^6 cos.
        let sixth = 2.1f64.powi(6) + 0.3 * 7.3f64.powi(6);
        for d in [0.0, 0.0034] {
            let o = OutputOperator::new(80, DT, Some(Arc::clone(&times)), d).unwrap();
            let got = o.of(&y, 0, 0..times.len());
            let (mut inner, mut outer) = (0.0f64, 0.0f64);
            for (i, t) in times.iter().enumerate() {
                let (x, e) = ((t - d) / DT, (got[(i, 1)] - signal(t - d, 1)).abs());
                if (2.0..77.0).contains(&x) {
                    inner = inner.max(e);
                } else if (0.0..=79.0).contains(&x) {
                    outer = outer.max(e);
                }
            }
            let unit = DT.powi(6) * sixth;
            assert!(inner < unit / 204.8 && inner > 0.2 * unit / 204.8, "{inner:e} {:e}", unit / 204.8);
            assert!(outer < unit / 42.5 && outer > 0.0, "{outer:e} {:e}", unit / 42.5);
        }
    }

    /// Each channel is read as by an operator of its own.
    #[test]
    fn channels_are_late_by_lags_of_their_own() {
        let (y, times, lags) = (sampled(0.0), times(), [0.0173, -0.0068]);
        let with = |lags: &[f64], d: f64| {
            OutputOperator::new(80, DT, Some(Arc::clone(&times)), d).and_then(|o| o.with_lags(lags))
        };
        let (both, all) = (with(&lags, 0.0034).unwrap(), 0..times.len());
        let stacked = DMatrix::from_fn(160, 1, |k, _| y[(k / 2, k % 2)]);
        let rows = both.of_rows(&stacked, 2, 0, all.clone());
        for (c, lag) in lags.into_iter().enumerate() {
            let own = with(&[], 0.0034 + lag).unwrap();
            let pairs = [
                (both.of(&y, 0, all.clone()), own.of(&y, 0, all.clone())),
                (both.slope(&y, 0, all.clone()), own.slope(&y, 0, all.clone())),
            ];
            for (got, want) in pairs {
                assert_relative_eq!(got.column(c), want.column(c), epsilon = scaled(1e-9));
            }
            assert!(all.clone().all(|i| rows[2 * i + c] == both.of(&y, 0, i..i + 1)[(0, c)]));
            assert!(all.clone().all(|i| both.first(i) <= own.first(i) && own.end(i) <= both.end(i)));
        }
        assert!(with(&[0.0, 0.81], 0.0).is_none());
    }

    /// A mean is the sum of its parts, each read at its own instant.
    #[test]
    fn means_are_sums_of_readings() {
        let (y, weights) = (sampled(0.0), [0.07, 0.21, 0.4, 0.19, 0.13]);
        let times: Arc<[f64]> = (0..20).map(|i| 0.11 + 0.029 * f64::from(i)).collect();
        let at = |d: f64| OutputOperator::new(80, DT, Some(Arc::clone(&times)), d).unwrap();
        let lags = [0.0021, -0.0058];
        let (spacing, all) = (0.017, 0..20);
        let mean = at(0.0034).with_means(weights.into(), spacing).with_lags(&lags).unwrap();
        let sum = |of: &dyn Fn(&OutputOperator) -> DMatrix<f64>| {
            let parts = weights.iter().enumerate();
            parts.fold(DMatrix::zeros(20, 2), |sum: DMatrix<f64>, (k, w)| {
                sum + *w * of(&at(0.0034 - (k as f64 - 2.0) * spacing).with_lags(&lags).unwrap())
            })
        };
        assert_relative_eq!(mean.of(&y, 0, all.clone()), sum(&|o| o.of(&y, 0, 0..20)), epsilon = scaled(1e-12));
        assert_relative_eq!(mean.slope(&y, 0, all.clone()), sum(&|o| o.slope(&y, 0, 0..20)), epsilon = scaled(1e-9));
        let stacked = DMatrix::from_fn(160, 1, |k, _| y[(k / 2, k % 2)]);
        let (rows, whole) = (mean.of_rows(&stacked, 2, 0, all.clone()), mean.of(&y, 0, all.clone()));
        assert!((0..40).all(|k| rows[k] == whole[(k / 2, k % 2)]));
        // A window is enough for means, too.
        let (from, end) = (mean.first(5), mean.end(11));
        assert!(from > 0 && end < 80);
        let window = y.rows(from, end - from).into_owned();
        assert_eq!(mean.of(&window, from, 5..12), whole.rows(5, 7));
    }

    #[test]
    fn a_window_of_the_grid_is_enough() {
        let (y, times) = (sampled(0.0), times());
        let o = OutputOperator::new(80, DT, Some(Arc::clone(&times)), -0.0021).unwrap();
        let o = o.with_lags(&[0.0121, -0.0143]).unwrap();
        let whole = o.of(&y, 0, 0..times.len());
        let readings = 31..64;
        let (from, end) = (o.first(31), o.end(63));
        let window = y.rows(from, end - from).into_owned();
        assert_eq!(o.of(&window, from, readings.clone()), whole.rows(31, 33));
        assert_eq!(o.slope(&window, from, readings), o.slope(&y, 0, 0..times.len()).rows(31, 33));
        let d = DMatrix::from_fn(160, 1, |k, _| y[(k / 2, k % 2)]);
        let part = d.rows(2 * from, 2 * (end - from)).into_owned();
        assert_eq!(o.of_rows(&part, 2, from, 31..64), o.of_rows(&d, 2, 0, 0..times.len()).rows(62, 66));
        assert!((1..times.len()).all(|i| o.first(i) >= o.first(i - 1)));
    }
}
