//! Progress and interruption of a fit.

use ff_least_squares::EvalError;
use ident::Estimator;
use ident::belief::Unknown;
use ident::estimate::{Coarse, RowStream};
use nalgebra::DMatrix;
use std::cell::Cell;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Progress and interruption from outside.
#[derive(Clone, Copy, Default)]
pub struct Observer<'a> {
    /// Set to end the fit.
    pub stop: Option<&'a AtomicBool>,
    /// Called with the number of the linearisation and chi-squared per residual.
    pub progress: Option<&'a dyn Fn(usize, f64)>,
}

/// An estimator that reports its progress and ends on request, over the decimated record too.
pub(super) struct ObservedEstimator<'a> {
    inner: Box<dyn Estimator + 'a>,
    watch: &'a Observer<'a>,
    state: Rc<SharedState>,
}

/// State shared by an estimator and its coarse ones.
#[derive(Default)]
struct SharedState {
    linearisations: Cell<usize>,
    stopped: Cell<bool>,
    /// The last linearisation was folded, and has not been reported yet.
    folded: Cell<bool>,
}

impl SharedState {
    fn report(&self, watch: &Observer<'_>, r: &[f64]) {
        if let Some(tell) = watch.progress {
            tell(self.linearisations.get(), r.iter().map(|x| x * x).sum::<f64>() / r.len().max(1) as f64);
        }
    }
}

impl<'a> ObservedEstimator<'a> {
    pub(super) fn new(inner: impl Estimator + 'a, watch: &'a Observer<'a>) -> Self {
        Self { inner: Box::new(inner), watch, state: Rc::default() }
    }
    /// Whether it was ended from outside.
    pub(super) fn stopped(&self) -> bool {
        self.state.stopped.get()
    }
    fn go_on(&self) -> Result<(), EvalError> {
        if self.watch.stop.is_some_and(|s| s.load(Ordering::SeqCst)) {
            self.state.stopped.set(true);
            return Err(EvalError::Fatal("interrupted".into()));
        }
        Ok(())
    }
}

impl Estimator for ObservedEstimator<'_> {
    fn rows(&self) -> usize {
        self.inner.rows()
    }
    fn nuisance(&self) -> Vec<Unknown> {
        self.inner.nuisance()
    }
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        let thin = self.inner.coarse(full)?;
        let watched = ObservedEstimator { inner: thin.estimator, watch: self.watch, state: Rc::clone(&self.state) };
        Some(Coarse { estimator: Box::new(watched), ..thin })
    }
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        let begun = self.inner.beginning(share)?;
        let watched = ObservedEstimator { inner: begun.estimator, watch: self.watch, state: Rc::clone(&self.state) };
        Some(Coarse { estimator: Box::new(watched), ..begun })
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        self.go_on()?;
        self.inner.residuals(full, extra, r)?;
        // Rows that are folded are not seen here; the first residuals after them tell about as much.
        if self.state.folded.replace(false) {
            self.state.report(self.watch, r);
        }
        Ok(())
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
        self.state.linearisations.set(self.state.linearisations.get() + 1);
        self.state.report(self.watch, r);
        Ok(())
    }
    fn streams<'s>(
        &'s mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
    ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
        self.go_on()?;
        self.state.linearisations.set(self.state.linearisations.get() + 1);
        self.state.folded.set(true);
        self.inner.streams(full, extra, selected)
    }
}
