//! From a rough start to the answer: a cheap pass over several starts, then the whole record from the one that explains it.
//!
//! Output error far from the truth has valleys that lead nowhere: predicted and measured oscillations slip by a period. Where
//! the residuals are in units of declared noise, most such ends are recognised: they leave a `chi^2` per degree of freedom that
//! noise cannot explain. Starts are tried in order, on a coarse estimator (a thinned record); from one that explains its data the
//! fine estimator takes over, and has to explain its own. Some wrong ends show in the whole record only.
//!
//! A test of the noise level is blunt: among `n` residuals it passes an end that is worse than the best by some `sqrt(n)` in
//! `chi^2`, where one or two would decide. So ends are also compared with each other: the lowest counts once several starts have
//! led to it ([`Accept::agree`]), or when there is no start left.

use crate::estimate::estimation::attempt;
use crate::estimate::estimator::Estimator;
use crate::estimate::outcome::{Estimate, EstimateError};
use crate::estimate::request::Request;
use crate::parameters::transform::Transform;
use ff_least_squares::Status;
use ff_model::{ParamDecl, ParamGroup};

/// One pass: what to fit it with, and to what.
pub struct Pass<'a, 'b> {
    /// Parameters, priors and settings; its `start` is not used, except that of the last pass when there are no starts.
    pub request: Request<'a>,
    /// The data of the pass.
    pub estimator: &'b mut dyn Estimator,
}

/// One start that was tried on the passes before the last.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Trial {
    /// Which of the starts.
    pub start: usize,
    /// Linearisations of all these passes.
    pub iterations: usize,
    /// `chi^2` per degree of freedom that the last of them left; none when one failed.
    pub chi2_per_dof: Option<f64>,
}

/// The result of [`estimate_staged`].
#[derive(Clone, Debug)]
pub struct Staged {
    /// Of the last pass.
    pub estimate: Estimate,
    /// Every start that was tried, in order.
    pub trials: Vec<Trial>,
    /// Whether the estimate explains the data of the last pass.
    pub explained: bool,
}

/// When a fit counts as the answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accept {
    /// `chi^2` per degree of freedom that still counts as explained, at the end of the coarse passes.
    pub coarse: f64,
    /// Of the last pass.
    pub fine: f64,
    /// Starts that must have led the coarse passes to the lowest end found, while there are others to try. One is enough
    /// where an end that explains the data at all explains them completely (no noise).
    pub agree: usize,
}

impl Accept {
    /// What noise of the declared size leaves, but for three deviations (`sqrt(2 / n)` each), for so many residuals; three
    /// starts must agree: the first two are often of one origin.
    pub fn noise(coarse: usize, fine: usize) -> Self {
        let limit = |n: usize| 1.0 + 3.0 * (2.0 / n.max(1) as f64).sqrt();
        Self { coarse: limit(coarse), fine: limit(fine), agree: 3 }
    }
}

/// Ends of the same passes with objectives (`chi^2` and priors) this close are one: half as far from each other as one deviation of
/// one parameter is from the best.
const SAME: f64 = 0.5;
/// Relative reduction that ends no pass before [`SETTLED`] does.
const UNRELATED: f64 = 1e-9;
/// What is left to gain of an end that others are compared with: two that have gone on so far differ by less than [`SAME`] where they are one.
const SETTLED: f64 = 0.1;

/// An end of the coarse passes that explains their data.
struct End {
    objective: f64,
    values: Vec<f64>,
    /// Starts that led here.
    starts: usize,
    /// The fine pass has been there, and it did not explain its data.
    refused: bool,
}

/// Takes `starts` in order through `coarse`; from the lowest end that explains its data, once [`Accept::agree`] starts have led to it
/// or all have been tried, on through `fine`, which has to explain its own. When none does, the best that `fine` made, or what
/// it makes of the best of `coarse`. A good order is: a short beginning of the record, in which no oscillation can slip by a period;
/// a thinned record; the whole one. Allocates.
///
/// # Errors
/// [`EstimateError`]: that of the last start when all fail, or that of the fine pass.
pub fn estimate_staged(
    coarse: &mut [Pass<'_, '_>],
    fine: &mut Pass<'_, '_>,
    starts: &[Vec<f64>],
    accept: Accept,
) -> Result<Staged, EstimateError> {
    let mut search = Search { fine, accept, ends: Vec::new(), finished: None, failed: None };
    let mut trials = Vec::new();
    let mut best: Option<(f64, Vec<f64>)> = None;
    for (k, start) in starts.iter().enumerate() {
        let mut trial = Trial { start: k, iterations: 0, chi2_per_dof: None };
        let end = descend(coarse, start, accept.agree > 1, &mut trial);
        trials.push(trial);
        let (end, values) = match end {
            Ok(Some(end)) => end,
            Ok(None) => continue,
            Err(e) => {
                search.failed = Some(e);
                continue;
            }
        };
        if end.chi2_per_dof <= accept.coarse {
            search.arrived(end.objective, &values);
            if let Some(estimate) = search.lowest(accept.agree) {
                return Ok(Staged { estimate, trials, explained: true });
            }
        }
        if best.as_ref().is_none_or(|b| end.chi2_per_dof < b.0) {
            best = Some((end.chi2_per_dof, values));
        }
    }
    // No start is left to agree.
    while search.ends.iter().any(|e| !e.refused) {
        if let Some(estimate) = search.lowest(1) {
            return Ok(Staged { estimate, trials, explained: true });
        }
    }
    if let Some(estimate) = search.finished {
        return Ok(Staged { estimate, trials, explained: false });
    }
    let start = match (best, search.failed) {
        (Some(b), _) => b.1,
        (None, Some(e)) => return Err(e),
        (None, None) => starts.first().map_or_else(|| search.fine.request.start.to_vec(), Clone::clone),
    };
    let estimate = through(search.fine, &start)?.0;
    let explained = estimate.chi2_per_dof <= accept.fine;
    Ok(Staged { estimate, trials, explained })
}

/// One start through the coarse passes: the last estimate, and where to go on from; nothing when there are no passes. An end that is to be
/// `compared` goes on until [`SETTLED`] is left to gain, whatever relative reduction the last pass was asked for: a thousandth of the cost
/// of thousands of residuals is several of chi-squared.
fn descend(
    coarse: &mut [Pass<'_, '_>],
    start: &[f64],
    compared: bool,
    trial: &mut Trial,
) -> Result<Option<(Estimate, Vec<f64>)>, EstimateError> {
    let mut end: Option<(Estimate, Vec<f64>)> = None;
    let last = coarse.len();
    for (k, pass) in coarse.iter_mut().enumerate() {
        let from = end.as_ref().map_or(start, |e| &e.1);
        let asked = pass.request.settings.clone();
        if compared && k + 1 == last {
            let of = &mut pass.request.settings;
            of.gain_tolerance = of.gain_tolerance.max(SETTLED);
            of.decrement_tolerance = of.decrement_tolerance.min(UNRELATED);
        }
        let done = through(pass, from);
        pass.request.settings = asked;
        let (estimate, steps, on) = done?;
        trial.iterations += steps;
        end = Some((estimate, on));
    }
    trial.chi2_per_dof = end.as_ref().map(|e| e.0.chi2_per_dof);
    Ok(end)
}

/// What the fine pass has to choose from, and what became of it.
struct Search<'p, 'a, 'b> {
    fine: &'p mut Pass<'a, 'b>,
    accept: Accept,
    ends: Vec<End>,
    /// The best of the fine pass among those that do not explain its data.
    finished: Option<Estimate>,
    failed: Option<EstimateError>,
}

impl Search<'_, '_, '_> {
    fn arrived(&mut self, objective: f64, values: &[f64]) {
        match self.ends.iter_mut().find(|e| (e.objective - objective).abs() < SAME) {
            Some(e) => {
                e.starts += 1;
                if objective < e.objective {
                    (e.objective, e.values) = (objective, values.to_vec());
                }
            }
            None => self.ends.push(End { objective, values: values.to_vec(), starts: 1, refused: false }),
        }
    }
    /// The fine pass from the lowest end that it has not refused, if so many starts led there: its estimate, if that explains its data.
    fn lowest(&mut self, agree: usize) -> Option<Estimate> {
        let left = self.ends.iter_mut().filter(|e| !e.refused);
        let end = left.min_by(|a, b| a.objective.total_cmp(&b.objective)).filter(|e| e.starts >= agree)?;
        end.refused = true;
        match through(self.fine, &end.values) {
            Ok((e, ..)) if e.chi2_per_dof <= self.accept.fine => return Some(e),
            Ok((e, ..)) if self.finished.as_ref().is_none_or(|f| e.chi2_per_dof < f.chi2_per_dof) => {
                self.finished = Some(e);
            }
            Ok(_) => {}
            Err(e) => self.failed = Some(e),
        }
        None
    }
}

/// How often a pass is taken up again from the inside after it has ended at the edge of what can exist.
const RETURNS: usize = 6;

/// One pass from `start`: its estimate, its steps, and where to go on from.
///
/// Near the edge (a body with a vanishing second moment) steps are measured by a body that is hardly there, and the fit sticks
/// although the answer may lie inside. It is then taken up again from half way back to where it came from, which is
/// physical, since what lies between two physical sets of parameters is. The best of all returns counts.
fn through(pass: &mut Pass<'_, '_>, start: &[f64]) -> Result<(Estimate, usize, Vec<f64>), EstimateError> {
    let (decls, selected) = (pass.request.decls, pass.request.selected);
    let at_edge = |e: &Estimate| {
        matches!(e.status, Status::AtBound { .. }) || Transform::affine(decls, selected, &e.values).is_err()
    };
    let halfway =
        |e: &Estimate, from: &[f64]| -> Vec<f64> { e.values.iter().zip(from).map(|(a, b)| 0.5 * (a + b)).collect() };
    let mut best = attempt(&Request { start, ..pass.request.clone() }, pass.estimator)?;
    let (mut steps, mut from) = (best.iterations, start.to_vec());
    for _ in 0..RETURNS {
        if !at_edge(&best) {
            break;
        }
        from = halfway(&best, &from);
        // A return that fails, or leads nowhere, leaves what was found before.
        let Ok(e) = attempt(&Request { start: &from, ..pass.request.clone() }, pass.estimator) else { break };
        steps += e.iterations;
        let gained = e.chi2_per_dof < 0.999 * best.chi2_per_dof;
        if e.chi2_per_dof < best.chi2_per_dof {
            best = e;
        }
        if !gained && at_edge(&best) {
            break;
        }
    }
    // Along the edge a fit may creep for ever. Without the edge it does not; where that leads to what can exist, it goes on from there.
    if at_edge(&best) {
        let loose = unbounded(decls);
        let free = Request { decls: &loose, start: &best.values, ..pass.request.clone() };
        if let Ok(way) = attempt(&free, pass.estimator) {
            steps += way.iterations;
            if let Ok(e) = attempt(&Request { start: &way.values, ..pass.request.clone() }, pass.estimator) {
                steps += e.iterations;
                if e.chi2_per_dof < best.chi2_per_dof {
                    best = e;
                }
            }
        }
    }
    let on = if at_edge(&best) { halfway(&best, &from) } else { best.values.clone() };
    Ok((best, steps, on))
}

/// The same parameters, bodies as ten numbers each that may be anything.
fn unbounded(decls: &[ParamDecl]) -> Vec<ParamDecl> {
    let loose = |d: &ParamDecl| match d.group {
        ParamGroup::Inertial(_) => {
            ParamDecl { group: ParamGroup::Free, bounds: (f64::NEG_INFINITY, f64::INFINITY), ..d.clone() }
        }
        _ => d.clone(),
    };
    decls.iter().map(loose).collect()
}
