//! The discrete Fourier transform of real signals: realfft and rustfft behind one type.

use crate::LinalgError;
use nalgebra::Complex;
use realfft::{RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// `X_j = sum_i x_i exp(-2 pi i j / n)` for `j = 0 ..= n / 2`, of a real signal of n samples; not scaled. Owns its buffers, so that the
/// kept library, which refuses buffers of another length, never meets one.
pub struct RealFft {
    plan: Arc<dyn RealToComplex<f64>>,
    input: Vec<f64>,
    output: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

impl core::fmt::Debug for RealFft {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("RealFft").field("samples", &self.input.len()).finish()
    }
}

impl RealFft {
    /// Plans the transform of `samples` samples. Allocates every buffer.
    pub fn new(samples: usize) -> Self {
        let plan = RealFftPlanner::new().plan_fft_forward(samples);
        let (input, output, scratch) = (plan.make_input_vec(), plan.make_output_vec(), plan.make_scratch_vec());
        Self { plan, input, output, scratch }
    }

    /// The samples to transform. [`Self::run`] leaves something else in them.
    pub fn input(&mut self) -> &mut [f64] {
        &mut self.input
    }

    /// Lines of the spectrum, `samples / 2 + 1`.
    pub fn lines(&self) -> usize {
        self.output.len()
    }

    /// The spectrum of [`Self::input`]. Does not allocate.
    ///
    /// # Errors
    /// [`LinalgError::Transform`] if the library refuses, a bug here.
    pub fn run(&mut self) -> Result<&[Complex<f64>], LinalgError> {
        self.plan
            .process_with_scratch(&mut self.input, &mut self.output, &mut self.scratch)
            .map_err(|e| LinalgError::Transform(e.to_string()))?;
        Ok(&self.output)
    }
}
