//! All data near the end of a fit, by fewer of their rows.
//!
//! What is looked for around an estimate (other minima, valleys that bend) takes predictions by the hundred, and all of them differ from the
//! one at the estimate `p` by what changes slowly against the samples. With residuals `r(x) = r(p) + d(x)` the cost is
//! `|r(p)|^2 + 2 r(p)^T d(x) + |d(x)|^2`, and where `d` is known at every n-th sample and a polynomial of degree five through six of them in
//! between, `d = H d_n` (what changes in five samples or more is then off by less than 2 % of itself, docs/theory/output-operator.md), both
//! terms are those of the thinned record: `2 (H^T r(p))^T d_n` and `|W d_n|^2` with `W^2 = diag(H^T 1)`, a quadrature. So
//!
//! ```text
//! r_n(x) = W (t(x) - t(p)) + W^-1 H^T r(p) + c
//! ```
//!
//! with the residuals `t` of the thinned record has the cost of all data but for a constant, with all of their noise. The correction `c` is
//! in the span of the columns at `p`, and gives the cost there the slope that all data give it.
//!
//! What is known to a little and changes what is seen in nearly the same way everywhere near (errors of sensors, of masses, of mounts) keeps
//! the columns that it has at `p`. Residuals are always those of all unknowns.

use crate::belief::covariance::Unknown;
use crate::estimate::along::Direction;
use crate::estimate::estimator::{At, Coarse, Estimator, Steps};
use crate::estimate::outcome::Estimate;
use crate::estimate::request::Request;
use crate::estimate::row_stream::weigh;
use crate::solve::loss::Loss;
use crate::solve::normal::Normal;
use ff_least_squares::EvalError;
use ff_linalg::{gram, tr_mul};
use nalgebra::{DMatrix, DVector, DVectorView};
use std::sync::Arc;

/// Corrections of the slope: what priors hold takes the second.
const CORRECTIONS: usize = 2;

/// Steps per period of the fastest mode that are tried, one after another: the method is stable down to 2.2.
const PER_PERIOD: [f64; 4] = [2.5, 3.5, 5.0, 7.0];
/// In how many steps for each of these a place is predicted whose modes are too fast for them.
const FINER: usize = 3;
/// Relative difference, in any direction, of what fewer rows tell from what all do. Over the width of an interval chi-squared is then off by as much of four.
const AGREES: f64 = 0.01;

/// The point around which all data are told by fewer rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Centre<'c> {
    /// All parameters, and the nuisance unknowns.
    pub(crate) values: &'c [f64],
    /// See [`Centre::values`].
    pub(crate) extra: &'c [f64],
    /// Residuals of all rows there.
    pub(crate) residuals: &'c [f64],
    /// What is known of the slope there.
    pub(crate) slope: Slope<'c>,
    /// Covariance that all rows leave there ([`AGREES`]), where fewer rows must tell as much.
    pub(crate) covariance: Option<&'c DMatrix<f64>>,
}

/// `J^T r` of all rows, over the selected parameters and the nuisance unknowns.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Slope<'c> {
    /// The end of a fit: it is what the priors pull.
    End,
    /// This.
    Known(&'c DVector<f64>),
    /// What fewer rows make of it, without a correction.
    Untold,
}

/// Fewer rows with the cost of all of them near a point.
pub struct Around<'a> {
    thin: Box<dyn Estimator + 'a>,
    /// The same rows in finer steps, for places where nothing is predicted in those.
    finer: Option<Finer<'a>>,
    of: Arc<Centred>,
}

/// See [`FINER`].
struct Finer<'a> {
    thin: Box<dyn Estimator + 'a>,
    /// What is added to its weighted residuals, once it has been asked: they differ at the point by what long steps are off.
    offset: Option<Vec<f64>>,
}

/// What [`Around`] knows of its point: made once, it serves every look around that ([`Around::again`]).
#[derive(Debug)]
pub struct Centred {
    /// Roots of the number of rows that each of these stands for.
    roots: Vec<f64>,
    /// What is added to the weighted residuals of the thinned record.
    offset: Vec<f64>,
    /// Parameters whose columns stay.
    held: Vec<usize>,
    /// Cost of all data at the point, less what it is here.
    pub beyond: f64,
    /// The point: all parameters, the nuisance unknowns, and the parameters of the columns.
    values: Vec<f64>,
    extra: Vec<f64>,
    selected: Vec<usize>,
    /// The linearisation there.
    residuals: Vec<f64>,
    jacobian: DMatrix<f64>,
}

impl Centred {
    /// The column that a parameter keeps.
    fn column(&self, parameter: usize) -> Option<DVectorView<'_, f64>> {
        let k = self.selected.iter().position(|&i| i == parameter)?;
        self.held.contains(&parameter).then(|| self.jacobian.column(k))
    }
}

impl<'c> Centre<'c> {
    /// The end of a fit, with its nuisance unknowns.
    fn end(e: &'c Estimate, extra: &'c [f64]) -> Self {
        Self { values: &e.values, extra, residuals: &e.residuals, slope: Slope::End, covariance: None }
    }
}

impl<'a> Around<'a> {
    /// Around the end of a fit of `request`; `stays` are parameters, by index, whose columns are taken from there. `None` where there is no
    /// look at fewer data, or under a robust loss. Allocates the Jacobian of the thinned record.
    ///
    /// # Errors
    /// [`EvalError`].
    pub fn new(
        request: &Request<'_>,
        e: &Estimate,
        thin: Coarse<'a>,
        stays: impl Fn(usize) -> bool,
    ) -> Result<Option<Self>, EvalError> {
        let extra: Vec<f64> = e.nuisance.iter().map(|p| p.value).collect();
        Self::of_point(request, Centre::end(e, &extra), thin, stays)
    }
    /// As [`Around::new`], around where a fit has got to, be that a minimum or not: the slope there is what fewer rows make of it. In steps that just follow
    /// the fastest mode there, or at `other` parameters if that is less and there can be predicted in them, and finer ones for places where it is faster.
    ///
    /// # Errors
    /// [`EvalError`].
    pub fn beside<E: Estimator + ?Sized>(
        request: &Request<'_>,
        e: &Estimate,
        other: &[f64],
        of: &'a E,
    ) -> Result<Option<Self>, EvalError> {
        let extra: Vec<f64> = e.nuisance.iter().map(|p| p.value).collect();
        let centre = Centre { slope: Slope::Untold, ..Centre::end(e, &extra) };
        let per_period = PER_PERIOD[0];
        let stepped = |at| Some((of.stepped(at, Steps { per_period, each_in: 1 })?, at));
        let mut looks: Vec<_> = [&e.values[..], other].into_iter().filter_map(stepped).collect();
        looks.sort_by_key(|(thin, _)| thin.estimator.rows());
        for (thin, at) in looks {
            if let Some(around) = Self::in_steps(request, centre, thin, |_| false)? {
                return Ok(Some(Self { finer: Finer::new(at, of, per_period), ..around }));
            }
        }
        Ok(None)
    }
    /// As [`Around::new`], in the longest steps in which fewer rows tell of every direction what all of them do, to a hundredth; steps per period of the
    /// fastest mode beside it, for [`Around::stepped_again`]. Where modes are too fast for these somewhere around, that place is predicted in finer ones. `None` where
    /// there are no such steps.
    ///
    /// # Errors
    /// [`EvalError`].
    pub fn thinnest<E: Estimator + ?Sized>(
        request: &Request<'_>,
        e: &Estimate,
        of: &'a E,
        stays: impl Fn(usize) -> bool,
    ) -> Result<Option<(Self, f64)>, EvalError> {
        if !e.data_only.full_rank() {
            return Ok(None);
        }
        let extra: Vec<f64> = e.nuisance.iter().map(|p| p.value).collect();
        let centre = Centre { covariance: Some(&e.data_only.covariance), ..Centre::end(e, &extra) };
        let mut rows = 0;
        for per_period in PER_PERIOD {
            // Steps that are cut to the same number of samples have been tried.
            let thin = of.stepped(&e.values, Steps { per_period, each_in: 1 });
            let Some(thin) = thin.filter(|thin| thin.estimator.rows() != rows) else { continue };
            rows = thin.estimator.rows();
            if let Some(around) = Self::in_steps(request, centre, thin, &stays)? {
                let finer = Finer::new(&e.values, of, per_period);
                return Ok(Some((Self { finer, ..around }, per_period)));
            }
        }
        Ok(None)
    }
    /// As [`Around::of_point`], in steps in which a mode may not be stable: these predict nothing.
    fn in_steps(
        request: &Request<'_>,
        centre: Centre<'_>,
        thin: Coarse<'a>,
        stays: impl Fn(usize) -> bool,
    ) -> Result<Option<Self>, EvalError> {
        match Self::of_point(request, centre, thin, stays) {
            Err(EvalError::Rejected(_)) => Ok(None),
            found => found,
        }
    }
    /// As [`Around::new`], around any point.
    ///
    /// # Errors
    /// [`EvalError`].
    pub(crate) fn of_point(
        request: &Request<'_>,
        e: Centre<'_>,
        thin: Coarse<'a>,
        stays: impl Fn(usize) -> bool,
    ) -> Result<Option<Self>, EvalError> {
        let Coarse { estimator: mut thin, between, .. } = thin;
        if request.loss != Loss::Squares || between.len() != e.residuals.len() {
            return Ok(None);
        }
        let rows = thin.rows();
        let (mut weights, mut sums) = (vec![0.0; rows], vec![0.0; rows]);
        for (b, r) in between.iter().zip(e.residuals) {
            for (row, part) in b.rows.into_iter().zip(b.parts) {
                weights[row] += part;
                sums[row] += part * r;
            }
        }
        if weights.iter().any(|w| *w <= 0.0) {
            return Ok(None);
        }
        let roots: Vec<f64> = weights.iter().map(|w: &f64| w.sqrt()).collect();
        let (mut r, mut j) = (vec![0.0; rows], DMatrix::zeros(rows, request.selected.len() + e.extra.len()));
        thin.jacobian(e.values, e.extra, request.selected, &mut r, &mut j)?;
        j.column_iter_mut().for_each(|mut c| weigh(c.iter_mut(), &roots));
        if e.covariance.is_some_and(|all| !tells(request, &j, all)) {
            return Ok(None);
        }
        let mut gathered = DVector::from_iterator(rows, sums.iter().zip(&roots).map(|(s, w)| s / w));
        if correct(request, e, &j, &mut gathered).is_none() {
            return Ok(None);
        }
        let beyond = e.residuals.iter().map(|r| r * r).sum::<f64>() - gathered.norm_squared();
        let offset = offset(gathered.as_slice(), &r, &roots);
        let held = request.selected.iter().copied().filter(|&i| stays(i)).collect();
        let (values, extra, selected) = (e.values.to_vec(), e.extra.to_vec(), request.selected.to_vec());
        let residuals = gathered.as_slice().to_vec();
        let of = Centred { roots, offset, held, beyond, values, extra, selected, residuals, jacobian: j };
        Ok(Some(Self { thin, finer: None, of: Arc::new(of) }))
    }
    /// As [`Around::new`], with what an earlier one of the same request has found out about the end of its fit. `None` where it is of another
    /// end, of other columns or of other rows. Does not allocate.
    #[must_use]
    pub fn again(
        request: &Request<'_>,
        e: &Estimate,
        thin: Coarse<'a>,
        stays: impl Fn(usize) -> bool,
        of: Arc<Centred>,
    ) -> Option<Self> {
        let alike = of.values == e.values
            && of.extra.iter().copied().eq(e.nuisance.iter().map(|p| p.value))
            && of.selected == request.selected
            && of.held.iter().copied().eq(request.selected.iter().copied().filter(|&i| stays(i)))
            && of.roots.len() == thin.estimator.rows();
        alike.then_some(Self { thin: thin.estimator, finer: None, of })
    }
    /// [`Around::again`] for one of [`Around::thinnest`].
    #[must_use]
    pub fn stepped_again<E: Estimator + ?Sized>(
        request: &Request<'_>,
        e: &Estimate,
        (estimator, per_period): (&'a E, f64),
        stays: impl Fn(usize) -> bool,
        of: Arc<Centred>,
    ) -> Option<Self> {
        let thin = estimator.stepped(&e.values, Steps { per_period, each_in: 1 })?;
        let finer = Finer::new(&e.values, estimator, per_period);
        Some(Self { finer, ..Self::again(request, e, thin, stays, of)? })
    }
    /// What it knows of its point.
    #[must_use]
    pub fn centred(&self) -> &Arc<Centred> {
        &self.of
    }
}

/// Whether these columns, with what else the covariance knows, leave that covariance in every direction, to [`AGREES`].
fn tells(request: &Request<'_>, j: &DMatrix<f64>, covariance: &DMatrix<f64>) -> bool {
    let Ok(mut information) = gram(j) else { return false };
    for (column, i) in request.selected.iter().enumerate() {
        let given = request.marginal.iter().filter(|m| m.0 == *i).map(|m| m.1.powi(-2));
        information[(column, column)] += given.sum::<f64>();
    }
    let deviations = covariance.diagonal().map(f64::sqrt);
    let in_deviations = |k: usize, other: usize| deviations[k] * deviations[other];
    let unit = covariance.map_with_location(|a, b, c| c / in_deviations(a, b));
    let Some(root) = unit.cholesky() else { return false };
    let scaled = information.map_with_location(|a, b, x| x * in_deviations(a, b));
    let both = root.l().tr_mul(&scaled) * root.l();
    both.iter().all(|x| x.is_finite()) && both.symmetric_eigenvalues().iter().all(|x| (x - 1.0).abs() < AGREES)
}

/// Gives the cost at the point the slope that all data give it: at the end of a fit, none with that of the priors.
fn correct(request: &Request<'_>, e: Centre<'_>, j: &DMatrix<f64>, gathered: &mut DVector<f64>) -> Option<()> {
    let columns = j.ncols();
    let values: Vec<f64> = request.selected.iter().map(|&i| e.values[i]).collect();
    let mut known = DMatrix::zeros(request.priors.len(), columns);
    request.priors.fill_jacobian(&values, &mut known, 0);
    let mut of_priors = Vec::new();
    request.priors.push_residuals(&values, &mut of_priors);
    let wanted = match e.slope {
        Slope::Untold => return Some(()),
        Slope::Known(slope) => slope.clone(),
        Slope::End => -known.tr_mul(&DVector::from_vec(of_priors)),
    };
    let Normal { root, size, .. } = Normal::new(j, &known).ok()??;
    for _ in 0..CORRECTIONS {
        let slope = tr_mul(j, gathered.as_slice()) - &wanted;
        let mut step = root.solve(&DVector::from_fn(columns, |k, _| slope[k] / size[k]));
        step.iter_mut().zip(&size).for_each(|(x, s)| *x /= s);
        *gathered -= j * step;
    }
    gathered.iter().all(|x| x.is_finite()).then_some(())
}

impl<'a> Finer<'a> {
    fn new<E: Estimator + ?Sized>(values: &[f64], of: &'a E, per_period: f64) -> Option<Self> {
        let thin = of.stepped(values, Steps { per_period, each_in: FINER })?.estimator;
        Some(Self { thin, offset: None })
    }
    /// What predicts in finer steps, and what is added to its weighted residuals: known once it has been asked at the point.
    fn prepared(&mut self, of: &Centred) -> Result<(&mut (dyn Estimator + 'a), &[f64]), EvalError> {
        let added = match self.offset.take() {
            Some(known) => known,
            None => {
                let mut own = vec![0.0; of.roots.len()];
                self.thin.residuals(&of.values, &of.extra, &mut own)?;
                offset(&of.residuals, &own, &of.roots)
            }
        };
        Ok((&mut *self.thin, self.offset.insert(added)))
    }
}

/// What makes residuals `own` at the point, weighted, those that have the cost of all rows.
fn offset(gathered: &[f64], own: &[f64], roots: &[f64]) -> Vec<f64> {
    gathered.iter().zip(own.iter().zip(roots)).map(|(c, (r, w))| c - w * r).collect()
}

impl Centred {
    fn finish(&self, r: &mut [f64], offset: &[f64]) {
        r.iter_mut().zip(self.roots.iter().zip(offset)).for_each(|(r, (w, c))| *r = *r * w + c);
    }
}

/// Whether nothing is predicted in these steps.
fn too_fast(done: &Result<(), EvalError>) -> bool {
    matches!(done, Err(EvalError::Rejected(_)))
}

impl Estimator for Around<'_> {
    fn rows(&self) -> usize {
        self.of.roots.len()
    }
    fn nuisance(&self) -> Vec<Unknown> {
        self.thin.nuisance()
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        self.residuals_at(&[(full, extra)], &mut [r]).pop().unwrap_or(Ok(()))
    }
    /// Of the long steps; in finer ones where these predict nothing.
    fn residuals_at(&mut self, at: &[At<'_>], r: &mut [&mut [f64]]) -> Vec<Result<(), EvalError>> {
        let Self { thin, finer, of } = self;
        let mut done = thin.residuals_at(at, r);
        let (mut again, mut to) = (Vec::new(), Vec::new());
        for ((done, at), r) in done.iter().zip(at).zip(r) {
            if too_fast(done) {
                again.push(*at);
                to.push(&mut **r);
            } else {
                of.finish(r, &of.offset);
            }
        }
        if let Some(finer) = finer.as_mut().filter(|_| !again.is_empty())
            && let Ok((thin, offset)) = finer.prepared(of)
        {
            let found = thin.residuals_at(&again, &mut to);
            to.iter_mut().for_each(|r| of.finish(r, offset));
            done.iter_mut().filter(|done| too_fast(done)).zip(found).for_each(|(done, finer)| *done = finer);
        }
        done
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        let of = Arc::clone(&self.of);
        if full == of.values && extra == of.extra && selected == of.selected {
            r.copy_from_slice(&of.residuals);
            j.copy_from(&of.jacobian);
            return Ok(());
        }
        let along = Direction::of_columns(selected, full.len(), extra.len());
        let places: Vec<_> = along.iter().map(|d| of.column(d.only()?)).collect();
        let made: Vec<Direction> =
            along.iter().zip(&places).filter(|(_, held)| held.is_none()).map(|(d, _)| d.clone()).collect();
        let mut own = DMatrix::zeros(r.len(), made.len());
        let done = self.thin.jacobian_along(full, extra, &made, r, &mut own);
        match &mut self.finer {
            Some(finer) if too_fast(&done) => {
                let (thin, offset) = finer.prepared(&of)?;
                thin.jacobian_along(full, extra, &made, r, &mut own)?;
                of.finish(r, offset);
            }
            _ => {
                done?;
                of.finish(r, &of.offset);
            }
        }
        own.column_iter_mut().for_each(|mut c| weigh(c.iter_mut(), &of.roots));
        let mut next = own.column_iter();
        for (mut to, held) in j.column_iter_mut().zip(&places) {
            match held {
                Some(column) => to.copy_from(column),
                None => next.next().iter().for_each(|c| to.copy_from(c)),
            }
        }
        Ok(())
    }
}
