//! A fit under watch: it tells how far it is, and ends when it is told to.

use crate::ident::covariance::Unknown;
use crate::ident::estimator::Estimator;
use crate::ident::lm::EvalError;
use nalgebra::DMatrix;
use std::sync::atomic::{AtomicBool, Ordering};

/// Watched from outside while it works.
#[derive(Clone, Copy, Default)]
pub struct Watch<'a> {
    /// Set to end the fit.
    pub stop: Option<&'a AtomicBool>,
    /// Told the number of the linearisation and chi-squared per residual.
    pub progress: Option<&'a dyn Fn(usize, f64)>,
}

/// An estimator that tells how far it is, and ends when it is told to.
pub(super) struct Watched<'a> {
    inner: &'a mut dyn Estimator,
    watch: &'a Watch<'a>,
    count: usize,
    /// Whether it was ended from outside.
    pub(super) stopped: bool,
}

impl<'a> Watched<'a> {
    pub(super) fn new(inner: &'a mut dyn Estimator, watch: &'a Watch<'a>) -> Self {
        Self { inner, watch, count: 0, stopped: false }
    }
    fn go_on(&mut self) -> Result<(), EvalError> {
        if self.watch.stop.is_some_and(|s| s.load(Ordering::SeqCst)) {
            self.stopped = true;
            return Err(EvalError::Fatal("interrupted".into()));
        }
        Ok(())
    }
}

impl Estimator for Watched<'_> {
    fn rows(&self) -> usize {
        self.inner.rows()
    }
    fn nuisance(&self) -> Vec<Unknown> {
        self.inner.nuisance()
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        self.go_on()?;
        self.inner.residuals(full, extra, r)
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        self.go_on()?;
        self.inner.jacobian(full, extra, selected, r, j)?;
        self.count += 1;
        if let Some(tell) = self.watch.progress {
            tell(self.count, r.iter().map(|x| x * x).sum::<f64>() / r.len().max(1) as f64);
        }
        Ok(())
    }
}
