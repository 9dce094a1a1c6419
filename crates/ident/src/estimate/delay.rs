//! Signals a little later than they were sampled: interpolation at `t_i - d`.
//!
//! A polynomial of degree five runs through the six samples around the wanted instant (Lagrange; at the ends of the record the
//! nearest six). A component at frequency f is wrong by at most `(2 pi f dt)^6 / 205` of itself: 5e-6 at a twentieth of the
//! sampling rate, 3e-10 at a hundredth. Weights are polynomials of the delay, so that the derivative is exact.

use nalgebra::DMatrix;

/// Samples in a stencil.
const N: usize = 6;

/// Samples beyond the ends of the record for which there is extrapolation.
const BEYOND: f64 = 1.0;

/// Weights of one delay for every sample of a record.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Delay {
    samples: usize,
    dt: f64,
    /// `d / dt`.
    shift: f64,
}

/// First sample, weights, and their derivatives with respect to the delay (1/s).
type Stencil = (usize, [f64; N], [f64; N]);

impl Delay {
    /// For records of `samples` (at least six) at `dt`, by `delay_s`; `None` when that is no shorter than the record.
    pub(crate) fn new(samples: usize, dt: f64, delay_s: f64) -> Option<Self> {
        let shift = delay_s / dt;
        (samples >= N && shift.abs() < samples as f64).then_some(Self { samples, dt, shift })
    }
    fn stencil(&self, i: usize) -> Stencil {
        // Beyond the ends the polynomial of the last six samples serves for a little; then it would run away, and is held.
        let last = (self.samples - 1) as f64;
        let at = i as f64 - self.shift;
        let x = at.clamp(-BEYOND, last + BEYOND);
        let first = (x.floor().max(0.0) as usize).saturating_sub(N / 2 - 1).min(self.samples - N);
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
    /// Values of the columns of `y` (samples x channels) at `t_i - d`. Allocates.
    pub(crate) fn of(&self, y: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.samples, y.ncols());
        for i in 0..self.samples {
            let (first, w, _) = self.stencil(i);
            for c in 0..y.ncols() {
                out[(i, c)] = (0..N).map(|k| w[k] * y[(first + k, c)]).sum();
            }
        }
        out
    }
    /// Derivative of [`Delay::of`] with respect to the delay (unit of y per s). Allocates.
    pub(crate) fn slope(&self, y: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.samples, y.ncols());
        for i in 0..self.samples {
            let (first, _, dw) = self.stencil(i);
            for c in 0..y.ncols() {
                out[(i, c)] = (0..N).map(|k| dw[k] * y[(first + k, c)]).sum();
            }
        }
        out
    }
    /// [`Delay::of`] for sensitivities: row `channels * i + c` of `d` holds channel c at sample i. Allocates.
    pub(crate) fn of_rows(&self, d: &DMatrix<f64>, channels: usize) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(d.nrows(), d.ncols());
        let stencils: Vec<Stencil> = (0..self.samples).map(|i| self.stencil(i)).collect();
        for (mut out, d) in out.column_iter_mut().zip(d.column_iter()) {
            for (i, (first, w, _)) in stencils.iter().enumerate() {
                for c in 0..channels {
                    out[channels * i + c] = (0..N).map(|k| w[k] * d[channels * (first + k) + c]).sum();
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
            let delay = Delay::new(80, DT, d).unwrap();
            let (got, want) = (delay.of(&sampled(0.0)), sampled(d));
            // Where the wanted instant lies in the record.
            for i in 6..74 {
                for c in 0..2 {
                    assert_relative_eq!(got[(i, c)], want[(i, c)], epsilon = 1e-9);
                }
            }
            let rows = delay.of_rows(&DMatrix::from_fn(160, 1, |k, _| signal((k / 2) as f64 * DT, k % 2)), 2);
            assert!((0..160).all(|k| rows[k] == got[(k / 2, k % 2)]));
        }
    }

    #[test]
    fn the_slope_is_the_derivative_also_at_the_ends() {
        let (y, h) = (sampled(0.0), 1e-6);
        let at = |d: f64| Delay::new(80, DT, d).unwrap().of(&y);
        for d in [0.0034, -0.0241] {
            let slope = Delay::new(80, DT, d).unwrap().slope(&y);
            assert_relative_eq!(slope, (at(d + h) - at(d - h)) / (2.0 * h), epsilon = 1e-7);
        }
    }

    #[test]
    fn impossible_delays_are_refused() {
        assert!(Delay::new(5, DT, 0.001).is_none() && Delay::new(80, DT, 0.81).is_none());
        assert!(Delay::new(80, DT, f64::NAN).is_none());
    }
}
