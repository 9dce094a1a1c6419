//! The end of a fit: whether it explains the record, what its numbers are of, and how it is put together with the fit before it.

use ff_model::ParamGroup;
use ident::Request;
use ident::estimate::{Estimate, KEPT_BYTES};
use ident::parameters::is_stiffness;

/// Deviations of chi-squared per degree of freedom (`sqrt(2 / dof)`) above one at which a fit is taken to have ended in the wrong valley:
/// chance does not, what errors of the model leave may.
pub(super) const FAR: f64 = 5.0;
/// The same from which its neighbours are no alternatives ([`super::valleys`]), and for a thinned record, whose steps are not exact.
const NO_ANSWER: f64 = 10.0;
/// Chi-squared per degree of freedom from which starts far away are tried as well, before more steps on the way there.
pub(super) const WIDE: f64 = 1.5;
/// The same from which what is near the end of the fit is not looked at: it is as wrong as everything.
pub(super) const NOWHERE: f64 = 10.0;
/// Half of chi-squared by which another end must be lower to be another valley.
pub(super) const LOWER: f64 = 9.2;

/// Whether chi-squared per degree of freedom is no further from what noise leaves than errors of the model may leave it.
pub(super) fn explains(e: &Estimate, noise: f64) -> bool {
    within(e, NO_ANSWER, noise)
}

/// Whether chi-squared per degree of freedom is within so many of its deviations of one, or below the mean square `noise` that noise leaves
/// ([`Request::noise`]), where that is more.
pub(super) fn within(e: &Estimate, deviations: f64, noise: f64) -> bool {
    let chance = 1.0 + deviations * (2.0 / e.residuals.len().max(1) as f64).sqrt();
    e.chi2_per_dof < if noise > 1.0 { chance.max(noise) } else { chance }
}

/// The end of a fit with some of its parameters as the mission has them.
pub(super) fn given_back(request: &Request<'_>, e: &Estimate, which: impl Fn(usize) -> bool) -> Vec<f64> {
    let mut out = e.values.clone();
    request.selected.iter().filter(|&&i| which(i)).for_each(|&i| out[i] = request.start[i]);
    out
}

/// A fit that went on after the `first`, as one with it.
pub(super) fn gone_on(mut e: Estimate, first: &Estimate, request: &Request<'_>) -> Estimate {
    e.iterations += first.iterations;
    e.descent.splice(0..0, first.descent.iter().cloned());
    from_the_start(&mut e, request);
    e
}

/// Says of a fit that it began at the start of the request, wherever its last part did.
pub(super) fn from_the_start(e: &mut Estimate, request: &Request<'_>) {
    for (p, &i) in e.parameters.iter_mut().zip(request.selected) {
        p.start = request.start[i];
    }
}

/// The appendage (or body) that a parameter or a coordinate is named after.
pub(super) fn owner(name: &str) -> Option<&str> {
    name.split_once('.').map(|n| n.0)
}

/// Whether this parameter is one of a body.
pub(super) fn of_body(request: &Request<'_>, i: usize) -> bool {
    matches!(request.decls[i].group, ParamGroup::Inertial(_))
}

/// Whether this parameter is a stiffness.
pub(super) fn is_spring(request: &Request<'_>, i: usize) -> bool {
    is_stiffness(&request.decls[i])
}

/// Whether the rows of a fit are few enough to be kept with their columns.
pub(super) fn keeps_rows(request: &Request<'_>, e: &Estimate) -> bool {
    let columns = request.selected.len() + e.nuisance.len();
    e.residuals.len().saturating_mul(8 * columns) <= KEPT_BYTES
}

/// Whether a stiffness is estimated.
pub(super) fn has_springs(request: &Request<'_>) -> bool {
    request.selected.iter().any(|&i| is_spring(request, i))
}
