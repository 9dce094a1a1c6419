//! A low-pass filter that shifts nothing in time and keeps every sample: Butterworth, run forwards and backwards.
//!
//! ```text
//! |G(f)| = 1 / (1 + (tan(pi f / f_s) / tan(pi f_c / f_s))^8)
//! ```
//!
//! is the gain of a filter of order four that is run both ways (bilinear transform, warped so that the cutoff `f_c` is exact;
//! there the gain is 1/2), as of `filtfilt` in MATLAB and SciPy. Both ends are continued by turning the signal about its first
//! and last sample, and the filter starts in the steady state of the first number, so that a constant passes unchanged (F.
//! Gustafsson, *Determining the initial states in forward-backward filtering*, IEEE Trans. Signal Processing 44(4), 1996). Within
//! [`ZeroPhase::transient`] samples of an end the result still depends on that continuation.
//!
//! Linear in the signal: passed through both sides of equations that are linear in their unknowns, it leaves the solution as it
//! is and takes away what is above the cutoff.

use nalgebra::DMatrix;
use std::f64::consts::PI;

/// What is left of the response to an impulse at the end of the transient.
const SETTLED: f64 = 1e-2;
/// Highest cutoff in parts of the sampling rate: there is less to take away above, and differences of positions become inexact.
const HIGHEST: f64 = 0.1;
/// Lowest cutoff in parts of the sampling rate: below, the coefficients cancel.
const LOWEST: f64 = 1e-5;

/// A planned filter.
#[derive(Clone, Debug, PartialEq)]
pub struct ZeroPhase {
    /// Gain and the two coefficients of the denominator of every section `g (1 + z^-1)^2 / (1 + a_1 z^-1 + a_2 z^-2)`.
    sections: [[f64; 3]; 2],
    transient: usize,
    noise_gain: f64,
}

impl ZeroPhase {
    /// Keeps what is below `cutoff_hz` of signals sampled at `rate_hz`; `None` unless the cutoff is between 1e-5 and 1e-1 of the
    /// rate.
    pub fn new(rate_hz: f64, cutoff_hz: f64) -> Option<Self> {
        (LOWEST..=HIGHEST).contains(&(cutoff_hz / rate_hz)).then(|| Self::of_part(cutoff_hz / rate_hz))
    }
    /// Keeps what is below `cutoff_hz`, or the nearest cutoff for which there is a filter, of signals sampled at `rate_hz`; with the cutoff.
    pub(crate) fn nearest(rate_hz: f64, cutoff_hz: f64) -> (Self, f64) {
        let part = (cutoff_hz / rate_hz).clamp(LOWEST, HIGHEST);
        (Self::of_part(part), part * rate_hz)
    }
    /// With this part of the sampling rate as the cutoff.
    fn of_part(part: f64) -> Self {
        let k = (PI * part).tan();
        let section = |damping: f64| {
            let a0 = 1.0 + damping * k + k * k;
            [k * k / a0, 2.0 * (k * k - 1.0) / a0, (1.0 - damping * k + k * k) / a0]
        };
        // Poles of order four: at 22.5 and 67.5 degrees from the negative axis.
        let sections = [PI / 8.0, 3.0 * PI / 8.0].map(|angle| section(2.0 * angle.cos()));
        // The slowest pole has the radius sqrt(a_2).
        let slowest = sections.iter().map(|s| s[2]).fold(0.0, f64::max).sqrt();
        let transient = (SETTLED.ln() / slowest.ln()).ceil() as usize;
        let mut out = Self { sections, transient, noise_gain: 1.0 };
        // The response to an impulse far from both ends.
        let mut impulse = vec![0.0; 8 * transient + 1];
        impulse[4 * transient] = 1.0;
        out.run(&mut impulse);
        out.noise_gain = impulse.iter().map(|h| h * h).sum();
        out
    }
    /// Samples at each end of a record that depend on what was before or comes after: where the response to an impulse has
    /// fallen to a hundredth.
    pub fn transient(&self) -> usize {
        self.transient
    }
    /// Variance of filtered unit white noise: so many of all samples of a filtered signal are worth an independent one.
    pub fn noise_gain(&self) -> f64 {
        self.noise_gain
    }
    /// Filters a signal in place. Allocates.
    pub fn run(&self, x: &mut [f64]) {
        self.together([x]);
    }
    /// Filters signals of one length in place. Allocates.
    ///
    /// # Panics
    /// If their lengths differ.
    pub fn run_all<'x>(&self, signals: impl IntoIterator<Item = &'x mut [f64]>) {
        let mut signals = signals.into_iter();
        loop {
            // A pass waits for its last number: four of them wait together.
            match [signals.next(), signals.next(), signals.next(), signals.next()] {
                [Some(a), Some(b), Some(c), Some(d)] => self.together([a, b, c, d]),
                rest => return rest.into_iter().flatten().for_each(|x| self.run(x)),
            }
        }
    }
    /// Filters every column in place. Allocates.
    pub fn columns(&self, x: &mut DMatrix<f64>) {
        let n = x.nrows().max(1);
        self.run_all(x.as_mut_slice().chunks_mut(n));
    }
    fn together<const N: usize>(&self, x: [&mut [f64]; N]) {
        let n = x[0].len();
        assert!(x.iter().all(|x| x.len() == n), "signals of one length");
        let Some(last) = n.checked_sub(1) else { return };
        // As far as the signals can be turned about their ends, and far enough to settle.
        let pad = (3 * self.transient).min(last);
        let at = |i: usize| x.each_ref().map(|x| x[i]);
        let about = |end: usize, i: usize| x.each_ref().map(|x| 2.0 * x[end] - x[i]);
        let mut all = Vec::with_capacity(n + 2 * pad);
        all.extend((1..=pad).rev().map(|i| about(0, i)));
        all.extend((0..n).map(at));
        all.extend((last - pad..last).rev().map(|i| about(last, i)));
        self.pass(&mut all);
        all.reverse();
        self.pass(&mut all);
        all.reverse();
        for (k, x) in x.into_iter().enumerate() {
            x.iter_mut().zip(&all[pad..]).for_each(|(x, y)| *x = y[k]);
        }
    }
    /// One pass from the front, from the steady state of the first numbers (transposed direct form II).
    fn pass<const N: usize>(&self, x: &mut [[f64; N]]) {
        for [g, a1, a2] in self.sections {
            let Some(&first) = x.first() else { return };
            let (mut s1, mut s2) = (first.map(|x| (1.0 - g) * x), first.map(|x| (g - a2) * x));
            for v in x.iter_mut() {
                for k in 0..N {
                    let (u, y) = (v[k], g * v[k] + s1[k]);
                    s1[k] = 2.0 * g * u - a1 * y + s2[k];
                    s2[k] = g * u - a2 * y;
                    v[k] = y;
                }
            }
        }
    }
}
