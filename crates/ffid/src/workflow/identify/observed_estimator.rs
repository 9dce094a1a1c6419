//! Progress and interruption of a fit.

use super::error::IdentifyError;
use super::labelled_record::LabelledRecord;
use super::settings::Settings;
use ff_least_squares::EvalError;
use ident::belief::Unknown;
use ident::estimate::{Around, At, Centred, Coarse, Estimate, RowStream, Steps};
use ident::{Estimator, Request};
use nalgebra::DMatrix;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Refuses records by what is wrong with them, given the settings of the fit.
pub type RecordCheck<'a> = &'a dyn Fn(&[LabelledRecord], &Settings) -> Result<(), IdentifyError>;

/// Progress and interruption from outside.
#[derive(Clone, Copy, Default)]
pub struct Observer<'a> {
    /// Set to end the fit.
    pub stop: Option<&'a AtomicBool>,
    /// Called with the number of the linearisation and chi-squared per residual.
    pub progress: Option<&'a dyn Fn(usize, f64)>,
    /// Where the best point of a fit goes that is ended from outside.
    pub kept: Option<&'a RefCell<Option<Interim>>>,
    /// Whether a fit that is ended from outside is a result that has not ended ([`super::result::fit::Ended::Interrupted`]), and no error.
    pub partial: bool,
    /// Asked where a first fit leads nowhere, before errors of the model and other starts are looked for, which takes minutes.
    pub doubts: Option<RecordCheck<'a>>,
}

impl<'a> Observer<'a> {
    /// The same, for a fit beside the one that is asked for: it reports nothing and leaves nothing.
    pub fn aside(&self) -> Observer<'a> {
        Observer { progress: None, kept: None, partial: false, doubts: None, ..*self }
    }
    /// Whether it is to end.
    pub fn is_stopped(&self) -> bool {
        self.stop.is_some_and(|s| s.load(Ordering::SeqCst))
    }
    /// Whether it is to end with the result that there is.
    pub fn ends_with_result(&self) -> bool {
        self.partial && self.is_stopped()
    }
    /// What comes behind a fit that has ended: `None` where it was ended from outside, and the fit itself is the result.
    ///
    /// # Errors
    /// Those of `found`, and [`IdentifyError::Interrupted`] where nothing is a result that has not ended ([`Observer::partial`]).
    pub fn unless_ended<V>(&self, found: Result<V, IdentifyError>) -> Result<Option<V>, IdentifyError> {
        match found {
            Err(IdentifyError::Interrupted) if self.partial => Ok(None),
            found => found.map(Some),
        }
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
    /// The least chi-squared per residual of all data, and where that is.
    best: RefCell<Option<(f64, Point)>>,
    /// The last linearisation over fewer of them.
    on_the_way: RefCell<Option<Point>>,
    /// The last end of a fit that was looked around, and the steps per period of the fastest mode in which fewer rows do for that.
    near: RefCell<Option<(Arc<Centred>, Option<f64>)>>,
}

/// Values of all parameters and of the nuisance unknowns.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) full: Vec<f64>,
    pub(super) extra: Vec<f64>,
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
    fn keep(&self, (full, extra): At<'_>, r: &[f64]) {
        let now = mean_square(r);
        let mut best = self.best.borrow_mut();
        if best.as_ref().is_none_or(|(least, _)| now < *least) {
            *best = Some((now, Point { full: full.to_vec(), extra: extra.to_vec() }));
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
    /// Linearisations so far, over fewer data too.
    pub(super) fn linearisations(&self) -> usize {
        self.state.linearisations.get()
    }
    /// The estimator itself, which answers after the fit was ended from outside, too.
    pub(super) fn unwatched(&mut self) -> &mut (dyn Estimator + 'a) {
        &mut *self.inner
    }
    /// Where a fit that was ended from outside has got to: the best point by all data, or the last linearisation over fewer, if that is
    /// better by all. `None` before the first of either.
    pub(super) fn so_far(&mut self) -> Option<Point> {
        let (best, last) = (self.state.best.take(), self.state.on_the_way.take());
        let Some(last) = last else { return best.map(|b| b.1) };
        let none = vec![0.0; self.inner.nuisance().len()];
        let last = if last.extra.len() == none.len() { last } else { Point { extra: none, ..last } };
        let mut r = vec![0.0; self.inner.rows()];
        let at_last = self.inner.residuals(&last.full, &last.extra, &mut r).map(|()| mean_square(&r));
        match (best, at_last) {
            (Some((least, best)), Ok(now)) => Some(if now < least { last } else { best }),
            (Some((_, best)), Err(_)) => Some(best),
            (None, Ok(_)) => Some(last),
            (None, Err(_)) => None,
        }
    }
    /// Leaves the best point where it is kept, unless a better one is there. `expand` makes all parameters of unknowns.
    pub(super) fn leave<E>(&self, expand: impl FnOnce(&[f64]) -> Result<Vec<f64>, E>) {
        let (Some(kept), Some((chi2_per_residual, best))) = (self.watch.kept, &*self.state.best.borrow()) else {
            return;
        };
        let mut kept = kept.borrow_mut();
        if kept.as_ref().is_some_and(|k| k.chi2_per_residual <= *chi2_per_residual) {
            return;
        }
        if let Ok(values) = expand(&best.full) {
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
    /// What a look around the end of a fit finds, over fewer rows with the cost of all of them ([`Around`]): in steps as long as do for all that is told
    /// there, or in those that follow the fastest mode. Where there are no fewer rows, over all of them. `look` is also told the cost of all rows at
    /// the end less that of these; columns of parameters that `stays` says stay.
    pub(super) fn around<T>(
        &mut self,
        request: &Request<'_>,
        e: &Estimate,
        stays: impl Fn(usize) -> bool,
        look: impl Fn(&mut ObservedEstimator<'_>, f64) -> T,
    ) -> T {
        let found = self.near(request, e, stays).map(|(mut near, beyond)| look(&mut near, beyond));
        match found {
            Some(found) => found,
            None => look(self, 0.0),
        }
    }
    /// Fewer rows with the cost of all of them at the end of a fit, be that a minimum or not, in steps that just follow the fastest mode there or at `other`
    /// parameters, and the cost of all rows there less that of these. `None` where there are no fewer.
    pub(super) fn beside(
        &self,
        request: &Request<'_>,
        e: &Estimate,
        other: &[f64],
    ) -> Option<(ObservedEstimator<'_>, f64)> {
        let around = Around::beside(request, e, other, &*self.inner).ok()??;
        let beyond = around.centred().beyond;
        Some((self.over_less(Box::new(around)), beyond))
    }
    /// See [`ObservedEstimator::around`].
    fn near(
        &self,
        request: &Request<'_>,
        e: &Estimate,
        stays: impl Fn(usize) -> bool,
    ) -> Option<(ObservedEstimator<'_>, f64)> {
        let fewer = || self.inner.coarse(&e.values).or_else(|| self.inner.beginning(1.0));
        let known = self.state.near.borrow().clone();
        let again = known.and_then(|(of, steps)| {
            let around = match steps {
                Some(steps) => Around::stepped_again(request, e, (&*self.inner, steps), &stays, of),
                None => Around::again(request, e, fewer()?, &stays, of),
            };
            Some((around?, steps))
        });
        let (around, steps) = match again {
            Some(again) => again,
            None => match Around::thinnest(request, e, &*self.inner, &stays).ok()? {
                Some((around, steps)) => (around, Some(steps)),
                None => (Around::new(request, e, fewer()?, &stays).ok()??, None),
            },
        };
        self.state.near.replace(Some((Arc::clone(around.centred()), steps)));
        let beyond = around.centred().beyond;
        Some((self.over_less(Box::new(around)), beyond))
    }
    /// Whether the best point is to be kept.
    fn keeps(&self) -> bool {
        self.whole && (self.watch.kept.is_some() || self.watch.partial)
    }
    /// Notes where a linearisation is, if that may be all there is of the fit when it is ended.
    fn pass(&self, full: &[f64], extra: &[f64]) {
        self.state.linearisations.set(self.linearisations() + 1);
        if !self.whole && self.watch.partial {
            self.state.on_the_way.replace(Some(Point { full: full.to_vec(), extra: extra.to_vec() }));
        }
    }
    fn go_on(&self) -> Result<(), EvalError> {
        if self.watch.is_stopped() {
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
    fn stepped(&self, full: &[f64], steps: Steps) -> Option<Coarse<'_>> {
        Some(self.watched(self.inner.stepped(full, steps)?))
    }
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        Some(self.watched(self.inner.beginning(share)?))
    }
    fn residuals_at(&mut self, at: &[At<'_>], r: &mut [&mut [f64]]) -> Vec<Result<(), EvalError>> {
        // Progress is told one by one.
        if self.state.folded.get() || self.go_on().is_err() {
            return at.iter().zip(r).map(|(&(full, extra), r)| self.residuals(full, extra, r)).collect();
        }
        let done = self.inner.residuals_at(at, r);
        if self.keeps() {
            let good = at.iter().zip(r.iter()).zip(&done).filter(|(_, done)| done.is_ok());
            good.for_each(|((at, r), _)| self.state.keep(*at, r));
        }
        done
    }
    fn refine(&mut self, full: &[f64], extra: &[f64], most: usize) -> Result<bool, EvalError> {
        self.go_on()?;
        self.inner.refine(full, extra, most)
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        self.go_on()?;
        self.inner.residuals(full, extra, r)?;
        if self.keeps() {
            self.state.keep((full, extra), r);
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
            self.state.keep((full, extra), r);
        }
        self.pass(full, extra);
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
        self.pass(full, extra);
        self.state.folded.set(true);
        self.inner.streams(full, extra, selected)
    }
}
