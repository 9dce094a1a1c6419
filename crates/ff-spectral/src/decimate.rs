//! Lower sampling rates without aliases.
//!
//! A symmetric FIR low-pass (Kaiser-windowed sinc) followed by taking every M-th sample, on the part of the
//! record that the filter covers whole. A free decay `z^i` goes through such a filter unchanged but for the
//! factor `H(z)`, so frequencies and damping ratios fitted afterwards are exact; amplitudes are divided by
//! [`Decimator::gain`].

use nalgebra::{Complex, DMatrix};

/// Stop-band attenuation (dB).
const ATTENUATION: f64 = 70.0;

/// A planned decimation.
///
/// ```
/// use ff_spectral::Decimator;
/// use nalgebra::DMatrix;
///
/// // A record at 200 Hz whose modes lie below 2 Hz: every twentieth sample is enough.
/// let decimator = Decimator::new(200.0, 2.0);
/// assert_eq!(decimator.factor(), 20);
/// let tone = DMatrix::from_fn(8000, 1, |i, _| (std::f64::consts::TAU * 0.7 * i as f64 / 200.0).sin());
/// let thin = decimator.run(&tone);
/// let first = tone[(decimator.margin(), 0)];
/// assert!((thin[(0, 0)] - first).abs() < 1e-3 && thin.nrows() == decimator.len(8000));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Decimator {
    taps: Vec<f64>,
    factor: usize,
}

impl Decimator {
    /// Keeps frequencies up to `f_max` of a signal sampled at `rate_hz`: the new rate is at least `5 f_max`, the
    /// pass band ends at `f_max`, and the stop band (-70 dB) begins at half the new rate. Below `10 f_max` the
    /// signal is left alone (factor 1, no filter). Kaiser's formulas give the length.
    pub fn new(rate_hz: f64, f_max: f64) -> Self {
        let factor = (rate_hz / (5.0 * f_max)).floor();
        if !(2.0..1e6).contains(&factor) {
            return Self { taps: vec![1.0], factor: 1 };
        }
        let stop = 0.5 * rate_hz / factor;
        let width = core::f64::consts::TAU * (stop - f_max) / rate_hz;
        let half = ((ATTENUATION - 8.0) / (2.285 * width) / 2.0).ceil();
        let beta = 0.1102 * (ATTENUATION - 8.7);
        let cut = core::f64::consts::PI * (stop + f_max) / rate_hz;
        let taps: Vec<f64> = (-(half as i64)..=half as i64)
            .map(|k| {
                let x = k as f64;
                let sinc = if k == 0 { cut } else { (cut * x).sin() / x };
                sinc * bessel_i0(beta * (1.0 - (x / half).powi(2)).max(0.0).sqrt())
            })
            .collect();
        let sum: f64 = taps.iter().sum();
        Self { taps: taps.iter().map(|t| t / sum).collect(), factor: factor as usize }
    }
    /// Every how many samples one is kept.
    pub fn factor(&self) -> usize {
        self.factor
    }
    /// Samples lost at each end of the record.
    pub fn margin(&self) -> usize {
        self.taps.len() / 2
    }
    /// Number of samples left of `n`.
    pub fn len(&self, n: usize) -> usize {
        (n + 1).checked_sub(self.taps.len()).map_or(0, |valid| valid.div_ceil(self.factor))
    }
    /// Variance of filtered unit white noise: `sum h^2`.
    pub fn noise_gain(&self) -> f64 {
        self.taps.iter().map(|h| h * h).sum()
    }
    /// Filters and decimates each column. Sample 0 of the result is sample [`Decimator::margin`] of the
    /// input. Allocates the result.
    pub fn run(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(self.len(x.nrows()), x.ncols(), |i, j| {
            let from = i * self.factor;
            let part = &x.column(j).data.into_slice()[from..from + self.taps.len()];
            part.iter().zip(&self.taps).map(|(x, h)| x * h).sum()
        })
    }
    /// Factor by which a component `z^i` (z per *input* sample) is multiplied: `H(z) = sum h_k z^k`.
    pub fn gain(&self, z: Complex<f64>) -> Complex<f64> {
        let m = self.margin() as i32;
        self.taps.iter().enumerate().map(|(k, h)| z.powi(k as i32 - m) * *h).sum()
    }
    /// `d ln H / d ln z`: how the gain changes with the pole.
    pub(crate) fn log_slope(&self, z: Complex<f64>) -> Complex<f64> {
        let m = self.margin() as i32;
        let slope: Complex<f64> = self
            .taps
            .iter()
            .enumerate()
            .map(|(k, h)| {
                let e = k as i32 - m;
                z.powi(e) * (*h * f64::from(e))
            })
            .sum();
        slope / self.gain(z)
    }
}

/// Modified Bessel function of the first kind, order 0 (series; converges for every argument).
fn bessel_i0(x: f64) -> f64 {
    let q = 0.25 * x * x;
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > 1e-17 * sum {
        term *= q / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;

    #[test]
    fn the_pass_band_is_flat_the_stop_band_quiet_and_decays_keep_their_poles() {
        let d = Decimator::new(100.0, 1.3);
        let at = |f: f64| d.gain(Complex::from_polar(1.0, core::f64::consts::TAU * f / 100.0)).norm();
        assert_eq!(d.factor(), 15);
        assert!((0..=13).all(|k| (at(0.1 * k as f64) - 1.0).abs() < 1e-3));
        assert!((334..5000).all(|k| at(0.01 * k as f64) < 4e-4));
        let z = Complex::from_polar(0.9991, 0.043);
        let x = DMatrix::from_fn(3000, 1, |i, _| z.powi(i as i32).re);
        let y = d.run(&x);
        assert_eq!(y.nrows(), d.len(3000));
        let expect = (d.gain(z) * z.powi((d.margin() + 7 * 15) as i32)).re;
        assert_within!((y[(7, 0)] - expect).abs(), 1e-12);
    }

    #[test]
    fn slow_signals_pass_untouched_and_short_ones_vanish() {
        let d = Decimator::new(10.0, 1.5);
        let x = DMatrix::from_fn(20, 2, |i, j| (i + 3 * j) as f64);
        assert_eq!((d.factor(), d.run(&x)), (1, x.clone()));
        assert_eq!(Decimator::new(1000.0, 1.0).run(&x).nrows(), 0);
    }
}
