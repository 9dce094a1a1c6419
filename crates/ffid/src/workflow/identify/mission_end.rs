//! What a record hardly tells of springs and dampers, and the mission does.
//!
//! Where the outer hinges of a stiff wing are hardly seen, the lowest minimum follows the noise: a damper vanishes, a spring runs away, and the others are as
//! sharp there as if that were known. Around it the posterior is no normal density, and most of it lies elsewhere: a wing of three hinges was explained with
//! the outer one at 290 +- 50 N m/rad, truth 1029, where chi-squared is higher by 3 for six springs and dampers. So the fit is tried once more with the springs and dampers of such
//! an appendage held to the mission by half of itself. Where the data allow that (chi-squared without this hold is higher by no more than [`BESIDE`]), it
//! is another end of the fit, and deviations cover both, each by its weight ([`super::mixture`]). The estimate stays the lowest.

use super::chord::is_physical;
use super::ends::{WIDE, owner};
use super::lost::{has_vanished, is_hardly_told};
use super::mixture;
use super::observed_estimator::ObservedEstimator;
use super::valleys::{ASIDE, BESIDE, Ending, answers};
use ff_least_squares::Settings as Solver;
use ff_model::ParamGroup;
use ident::Request;
use ident::belief::PriorRow;
use ident::estimate::{Estimate, attempt};
use ident::parameters::{is_damping, is_stiffness};
use nalgebra::{DMatrix, DVector};

/// Factor on the start beyond which a spring or damper has run away.
const AWAY: f64 = 10.0;
/// Part of the mission's value to which what is hardly told is held.
const HELD: f64 = 0.5;
/// Part of a positive coordinate that the way to the mission leaves of it at least.
const LEAST_PART: f64 = 0.1;
/// Linearisations, and promised reduction of chi-squared at their end, which is compared with [`BESIDE`].
const MOST: usize = 25;
const SETTLED: f64 = 0.1;
/// Linearisations after which what is still far from the data ([`WIDE`]) is not gone on with: a mission that the data allow is nearly where the
/// way to it begins.
const SHOWN: usize = 3;

/// Makes deviations cover the end of the fit at which what is hardly told is near the mission, if the data allow it. Allocates; takes up to
/// [`MOST`] linearisations of fewer rows, and none where all springs and dampers are told.
pub(super) fn allow_for_mission(
    request: &Request<'_>,
    ending: &mut Ending,
    is_asked: impl Fn(usize) -> bool,
    estimator: &mut ObservedEstimator<'_>,
) {
    let e = &ending.estimate;
    let hardly = hardly_told(request, e);
    if !answers(request, e) || request.prior_width.is_some() || hardly.is_empty() || estimator.stopped() {
        return;
    }
    let found = estimator.around(
        request,
        e,
        |i| !is_asked(i),
        |near, beyond| near_mission(request, e, &hardly, near).map(|(found, cost)| (found, cost + beyond)),
    );
    if let Some((found, cost)) = found.filter(|(_, cost)| cost - e.objective < BESIDE) {
        let covariance = mixture::beside(e, &found, cost - e.objective);
        if let Some(covariance) = covariance {
            ending.widened(covariance);
        }
    }
}

/// Springs and dampers, by column, of the appendages of which the record hardly tells one: the others are as sharp as if that were known. None that a prior
/// holds.
fn hardly_told(request: &Request<'_>, e: &Estimate) -> Vec<usize> {
    let free = |&k: &usize| {
        let (i, d) = (request.selected[k], &request.decls[request.selected[k]]);
        let known = request.priors.rows().iter().any(|r| r.column == k);
        (is_stiffness(d) || is_damping(d)) && request.start[i] > 0.0 && !known
    };
    let hardly = |&k: &usize| {
        let (i, p) = (request.selected[k], &e.parameters[k]);
        let gone = has_vanished(request, e, i) || p.value > AWAY * request.start[i];
        gone || is_hardly_told(p)
    };
    let of = |k: usize| owner(&request.decls[request.selected[k]].name);
    let all: Vec<usize> = (0..request.selected.len()).filter(free).collect();
    let owners: Vec<_> = all.iter().filter(|k| hardly(k)).map(|&k| of(k)).collect();
    all.into_iter().filter(|&k| owners.contains(&of(k))).collect()
}

/// The end of a fit with the columns `hardly` held to the mission, and its cost without that.
fn near_mission(
    request: &Request<'_>,
    e: &Estimate,
    hardly: &[usize],
    estimator: &mut ObservedEstimator<'_>,
) -> Option<(Estimate, f64)> {
    let row = |&column: &usize| {
        let mean = request.start[request.selected[column]];
        PriorRow { column, mean, sigma: HELD * mean }
    };
    let rows: Vec<PriorRow> = hardly.iter().map(row).collect();
    let priors = rows.iter().fold(request.priors.clone(), |priors, row| priors.with(*row));
    let start = held_to(request, e, &rows).unwrap_or_else(|| {
        let mut start = e.values.clone();
        rows.iter().for_each(|r| start[request.selected[r.column]] = r.mean);
        start
    });
    let centre = Some(request.centre.unwrap_or(request.start));
    let mut go_on = |start: &[f64], max_iterations: usize| {
        let gain_tolerance = request.settings.gain_tolerance.max(SETTLED);
        let settings = Solver { max_iterations, gain_tolerance, ..request.settings.clone() };
        let priors = priors.clone();
        let held = Request { start, centre, priors, coarse: false, finer: ASIDE, settings, ..request.clone() };
        attempt(&held, estimator).ok()
    };
    // On its way or at its end: the data allow either.
    let mut found = go_on(&start, SHOWN)?;
    if !found.is_solution() {
        if found.chi2_per_dof > WIDE * request.noise {
            return None;
        }
        found = go_on(&found.values, MOST - SHOWN)?;
    }
    let pull = |r: &PriorRow| ((found.parameters[r.column].value - r.mean) / r.sigma).powi(2);
    let cost = found.objective - rows.iter().map(pull).sum::<f64>();
    Some((found, cost))
}

/// Where the end of the fit would be, as far as it is straight, if these rows held as well: `x + C H^T (H C H^T + S)^-1 (m - H x)`, in the
/// compliances of springs, which are what records are straight in. What the data tell stays, so that the way from there is a short one. `None` where
/// that cannot be.
fn held_to(request: &Request<'_>, e: &Estimate, rows: &[PriorRow]) -> Option<Vec<f64>> {
    let spring = |k: usize| is_stiffness(&request.decls[request.selected[k]]);
    let value = |k: usize| e.parameters[k].value;
    // Slope of the coordinate of an unknown, and that of what a row says.
    let slope = |k: usize| if spring(k) { -value(k).powi(-2) } else { 1.0 };
    let coordinate = |k: usize, x: f64| if spring(k) { x.recip() } else { x };
    let c = |i: usize, k: usize| slope(i) * e.uncertainty.covariance[(i, k)] * slope(k);
    let n = rows.len();
    let spread = |r: &PriorRow| if spring(r.column) { r.sigma / (r.mean * r.mean) } else { r.sigma };
    let own = DMatrix::from_fn(n, n, |a, b| {
        c(rows[a].column, rows[b].column) + if a == b { spread(&rows[a]).powi(2) } else { 0.0 }
    });
    let off = DVector::from_fn(n, |a, _| {
        coordinate(rows[a].column, rows[a].mean) - coordinate(rows[a].column, value(rows[a].column))
    });
    // Variances of compliances and of dampers are of sizes that no factorisation takes together.
    let size = own.diagonal().map(|v| v.sqrt());
    let own = DMatrix::from_fn(n, n, |a, b| own[(a, b)] / (size[a] * size[b]));
    let by = own.cholesky()?.solve(&off.component_div(&size)).component_div(&size);
    let mut out = e.values.clone();
    for (k, &i) in request.selected.iter().enumerate() {
        let moved: f64 = rows.iter().enumerate().map(|(a, r)| c(k, r.column) * by[a]).sum();
        let to = coordinate(k, value(k)) + moved;
        let positive = request.decls[i].group == ParamGroup::Positive;
        let least = if positive { LEAST_PART * coordinate(k, value(k)) } else { f64::NEG_INFINITY };
        out[i] = if spring(k) { to.max(least).recip() } else { to.max(least) };
    }
    (is_physical(request, &out) && out.iter().all(|x| x.is_finite())).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::super::observed_estimator::Observer;
    use super::*;
    use ff_least_squares::EvalError;
    use ff_model::ParamDecl;
    use ident::Estimator;
    use nalgebra::DMatrix;

    /// Two hinges in a row: the sum of their compliances, well, and that of the outer one, as well as `sigma`; readings of both.
    struct Hinges {
        sigma: f64,
        read: [f64; 2],
    }
    /// Moment that the outer hinge takes, against the inner one.
    const OUTER: f64 = 0.6;
    const SUM: f64 = 1e-5;
    impl Estimator for Hinges {
        fn rows(&self) -> usize {
            2
        }
        fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
            r[0] = (1.0 / p[0] + OUTER / p[1] - self.read[0]) / SUM;
            r[1] = (1.0 / p[1] - self.read[1]) / self.sigma;
            Ok(())
        }
        fn jacobian(
            &mut self,
            p: &[f64],
            extra: &[f64],
            _: &[usize],
            r: &mut [f64],
            j: &mut DMatrix<f64>,
        ) -> Result<(), EvalError> {
            let slope = |k: usize| -1.0 / (p[k] * p[k]);
            j.copy_from_slice(&[slope(0) / SUM, 0.0, OUTER * slope(1) / SUM, slope(1) / self.sigma]);
            self.residuals(p, extra, r)
        }
    }

    /// Until next to nothing is left to gain.
    fn settings() -> Solver {
        Solver { gain_tolerance: 1e-4, max_iterations: 200, ..Solver::default() }
    }

    /// The way to the mission begins where the data still are explained, and what they leave open is where the mission has it.
    #[test]
    fn what_the_data_tell_stays_on_the_way_to_the_mission() {
        let decls = ["wing.k[0]", "wing.k[1]"].map(|name| ParamDecl::positive(name, "N m/rad", 0.0));
        // The sum of compliances is told to 1e-5, that of the outer one, 2.3e-3, to twice itself.
        let (start, sum) = ([200.0, 230.0], 1.0 / 310.0 + OUTER / 190.0);
        let mut hinges = Hinges { sigma: 4e-3, read: [sum, 1.0 / 430.0] };
        let request = Request { settings: settings(), ..Request::new(&decls, &[0, 1], &start) };
        let e = attempt(&request, &mut hinges).unwrap();
        assert!((e.values[1] / 430.0 - 1.0).abs() < 0.05, "{:?}", e.values);
        let row = |column: usize| PriorRow { column, mean: start[column], sigma: HELD * start[column] };
        let there = held_to(&request, &e, &[row(0), row(1)]).unwrap();
        let off = 1.0 / there[0] + OUTER / there[1] - sum;
        assert!(off.abs() < 3.0 * SUM, "{there:?}: {off:e}");
        // The outer one is most of the way from 430 to 230, and the inner one makes up for it.
        assert!((230.0..350.0).contains(&there[1]) && there[0] > e.values[0], "{there:?} of {:?}", e.values);
        // Held to the mission as they stand, they explain nothing.
        let mut r = [0.0; 2];
        hinges.residuals(&start, &[], &mut r).unwrap();
        assert!(r[0].abs() > 30.0, "{r:?}");
    }

    /// Deviations of the inner hinge before and after, and how far it is off: the outer one read by 1.2 deviations less than it is.
    fn inner(sigma: f64) -> (f64, f64, f64) {
        let truth = [310.0, 190.0];
        let decls = ["wing.k[0]", "wing.k[1]"].map(|name| ParamDecl::positive(name, "N m/rad", 0.0));
        let start = [260.0, 230.0];
        let read = [1.0 / truth[0] + OUTER / truth[1], 1.0 / truth[1] - 1.2 * sigma];
        let mut hinges = Hinges { sigma, read };
        let request = Request { settings: settings(), ..Request::new(&decls, &[0, 1], &start) };
        let estimate = attempt(&request, &mut hinges).unwrap();
        assert!(estimate.is_solution(), "{:?}", estimate.status);
        let (before, off) = (estimate.parameters[0].std.unwrap(), estimate.values[0] - truth[0]);
        let mut ending = Ending { estimate, minima: None, alone: None };
        let observer = Observer::default();
        let mut watched = ObservedEstimator::new(&mut hinges, &observer);
        allow_for_mission(&request, &mut ending, |_| true, &mut watched);
        (before, ending.estimate.parameters[0].std.unwrap(), off)
    }

    #[test]
    fn deviations_cover_the_mission_where_a_spring_has_run_away() {
        let (before, after, off) = inner(6e-3);
        assert!(off.abs() > 1.7 * before && after > 1.1 * before, "{off} {before} {after}");
        assert!(off.abs() < 1.55 * after && after < 200.0, "{off} {before} {after}");
    }

    #[test]
    fn what_is_told_stays_as_it_is() {
        let (before, after, off) = inner(1e-4);
        assert_eq!(before, after);
        assert!(off.abs() < 3.0 * before, "{off} {before}");
    }
}
