//! Progress and interruption of a fit.

use ff_least_squares::EvalError;
use ident::belief::Unknown;
use ident::estimate::{Around, At, Centred, Coarse, Estimate, RowStream};
use ident::{Estimator, Request};
use nalgebra::DMatrix;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Progress and interruption from outside.
#[derive(Clone, Copy, Default)]
pub struct Observer<'a> {
    /// Set to end the fit.
    pub stop: Option<&'a AtomicBool>,
    /// Called with the number of the linearisation and chi-squared per residual.
    pub progress: Option<&'a dyn Fn(usize, f64)>,
    /// Where the best point of a fit goes that is ended from outside.
    pub kept: Option<&'a RefCell<Option<Interim>>>,
}

impl<'a> Observer<'a> {
    /// The same, for a fit beside the one that is asked for: it reports nothing and leaves nothing.
    pub(super) fn aside(&self) -> Observer<'a> {
        Observer { progress: None, kept: None, ..*self }
    }
}

/// The best point of a fit that was ended from outside. It is no estimate: nothing says how far it is from one.
#[derive(Clone, Debug, PartialEq)]
pub struct Interim {
    /// All parameters of the model.
    pub values: Vec<f64>,
    /// Sum of squared residuals over the noise, per residual.
    pub chi2_per_residual: f64,
    /// Linearisations so far.
    pub linearisations: usize,
}

/// An estimator that reports its progress and ends on request, over the decimated record too.
pub(super) struct ObservedEstimator<'a> {
    inner: Box<dyn Estimator + 'a>,
    watch: &'a Observer<'a>,
    state: Rc<SharedState>,
    /// Over all data, not over fewer of them on the way.
    whole: bool,
}

/// State shared by an estimator and its coarse ones.
#[derive(Default)]
struct SharedState {
    linearisations: Cell<usize>,
    stopped: Cell<bool>,
    /// The last linearisation was folded, and has not been reported yet.
    folded: Cell<bool>,
    /// The least chi-squared per residual of all data, and the unknowns there.
    best: RefCell<Option<(f64, Vec<f64>)>>,
    /// The last end of a fit that was looked around.
    near: RefCell<Option<Arc<Centred>>>,
}

/// Chi-squared per residual.
fn mean_square(r: &[f64]) -> f64 {
    r.iter().map(|x| x * x).sum::<f64>() / r.len().max(1) as f64
}

impl SharedState {
    fn report(&self, watch: &Observer<'_>, r: &[f64]) {
        if let Some(tell) = watch.progress {
            tell(self.linearisations.get(), mean_square(r));
        }
    }
    fn keep(&self, full: &[f64], r: &[f64]) {
        let now = mean_square(r);
        let mut best = self.best.borrow_mut();
        if best.as_ref().is_none_or(|(least, _)| now < *least) {
            *best = Some((now, full.to_vec()));
        }
    }
}

impl<'a> ObservedEstimator<'a> {
    pub(super) fn new(inner: impl Estimator + 'a, watch: &'a Observer<'a>) -> Self {
        Self { inner: Box::new(inner), watch, state: Rc::default(), whole: true }
    }
    /// Residuals at several places, side by side where that is faster; `None` where nothing is predicted. Allocates the rows of all.
    pub(super) fn rows_at(&mut self, at: &[At<'_>]) -> Vec<Option<Vec<f64>>> {
        let mut all = vec![vec![0.0; self.rows()]; at.len()];
        let mut to: Vec<&mut [f64]> = all.iter_mut().map(|r| &mut r[..]).collect();
        let done = self.residuals_at(at, &mut to);
        all.into_iter().zip(done).map(|(r, done)| done.ok().map(|()| r)).collect()
    }
    /// Whether it was ended from outside.
    pub(super) fn stopped(&self) -> bool {
        self.state.stopped.get()
    }
    /// Leaves the best point where it is kept, unless a better one is there. `expand` makes all parameters of unknowns.
    pub(super) fn leave<E>(&self, expand: impl FnOnce(&[f64]) -> Result<Vec<f64>, E>) {
        let (Some(kept), Some((chi2_per_residual, full))) = (self.watch.kept, &*self.state.best.borrow()) else {
            return;
        };
        let mut kept = kept.borrow_mut();
        if kept.as_ref().is_some_and(|k| k.chi2_per_residual <= *chi2_per_residual) {
            return;
        }
        if let Ok(values) = expand(full) {
            let linearisations = self.state.linearisations.get();
            *kept = Some(Interim { values, chi2_per_residual: *chi2_per_residual, linearisations });
        }
    }
    /// The same over fewer data.
    fn over_less<'s>(&'s self, inner: Box<dyn Estimator + 's>) -> ObservedEstimator<'s> {
        ObservedEstimator { inner, watch: self.watch, state: Rc::clone(&self.state), whole: false }
    }
    fn watched<'s>(&'s self, of: Coarse<'s>) -> Coarse<'s> {
        Coarse { estimator: Box::new(self.over_less(of.estimator)), ..of }
    }
    /// All data near the end of a fit by fewer of their rows ([`Around`]), or by all of them where they are too few to be thinned, and their
    /// cost there less that of these; columns of parameters that `stays` says stay. `None` where there is no such look.
    pub(super) fn around(
        &self,
        request: &Request<'_>,
        e: &Estimate,
        stays: impl Fn(usize) -> bool,
    ) -> Option<(ObservedEstimator<'_>, f64)> {
        let fewer = || self.inner.coarse(&e.values).or_else(|| self.inner.beginning(1.0));
        let known = self.state.near.borrow().clone();
        let around = match known.and_then(|of| Around::again(request, e, fewer()?, &stays, of)) {
            Some(around) => around,
            None => Around::new(request, e, fewer()?, &stays).ok()??,
        };
        self.state.near.replace(Some(Arc::clone(around.centred())));
        let beyond = around.centred().beyond;
        Some((self.over_less(Box::new(around)), beyond))
    }
    /// Whether the best point is to be kept.
    fn keeps(&self) -> bool {
        self.whole && self.watch.kept.is_some()
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
    fn left_out(&self) -> usize {
        self.inner.left_out()
    }
    fn nuisance(&self) -> Vec<Unknown> {
        self.inner.nuisance()
    }
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        Some(self.watched(self.inner.coarse(full)?))
    }
    fn rough(&self, full: &[f64]) -> Option<Coarse<'_>> {
        Some(self.watched(self.inner.rough(full)?))
    }
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        Some(self.watched(self.inner.beginning(share)?))
    }
    fn residuals_at(&mut self, at: &[At<'_>], r: &mut [&mut [f64]]) -> Vec<Result<(), EvalError>> {
        // The best point is kept, and progress is told, one by one.
        if self.keeps() || self.state.folded.get() || self.go_on().is_err() {
            return at.iter().zip(r).map(|(&(full, extra), r)| self.residuals(full, extra, r)).collect();
        }
        self.inner.residuals_at(at, r)
    }
    fn refine(&mut self, full: &[f64], extra: &[f64], most: usize) -> Result<bool, EvalError> {
        self.go_on()?;
        self.inner.refine(full, extra, most)
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        self.go_on()?;
        self.inner.residuals(full, extra, r)?;
        if self.keeps() {
            self.state.keep(full, r);
        }
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
        if self.keeps() {
            self.state.keep(full, r);
        }
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
