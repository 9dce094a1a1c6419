//! The way to the answer over less data: a thinned record, and parts of it that grow from its beginning.

use crate::estimate::descent::{Place, RANGE, Way, settle};
use crate::estimate::estimator::Estimator;
use crate::estimate::fit::{Evaluated, Fit, Reference};
use crate::estimate::near_end;
use crate::estimate::request::Request;
use crate::parameters::transform::Transform;
use ff_least_squares::{Linearise, Settings, Status};

/// Relative reduction of the cost below which a pass over less data has done its part: a hundred times that of the pass it is for,
/// within these bounds.
const APPROACHED: (f64, f64) = (1e-4, 1e-2);
/// The lower of them where fewer rows with the cost of all of them lead on from there ([`near_end::land`]): by what the integration is off, the thinned record is
/// further from the end than that.
const LANDS: f64 = 2e-3;
/// Promised reduction of chi-squared below which it has, too.
const APPROACHED_GAIN: f64 = 0.03;

/// See [`Request::give_up`].
const GIVEN_UP: usize = 10;
/// Factor on the rows of a pass from which a finer one is worth its time.
const FINER: f64 = 1.5;

/// Linearisations after which a first pass that has not ended is taken to be lost in a valley, and is led there over growing parts of
/// the record. Passes that find their way take fewer.
const LOST: usize = 12;
/// Mean squared residual, over that of noise, from which its end does not explain the data, and it is led as well.
const UNEXPLAINED: f64 = 1.5;
/// First part of the record that it is led over.
const FIRST_PART: f64 = 0.0625;
/// By how much a part is longer than the one before.
const DOUBLED: f64 = 2.0;
/// How a fit is led over parts of the record.
struct Growth {
    /// By how much a part is longer than the one before where [`DOUBLED`] has led nowhere.
    slower: &'static [f64],
    /// Linearisations of each.
    steps: usize,
}
/// What leads a fit whose oscillations have slipped, one after another.
enum Means {
    Parts(Growth),
    OtherStart,
}
/// See [`Means`]: parts as long again as the one before, then another start, then parts that grow as fast as they can.
const ALL_MEANS: [Means; 3] = [
    Means::Parts(Growth { slower: &[], steps: 15 }),
    Means::OtherStart,
    Means::Parts(Growth { slower: &[core::f64::consts::SQRT_2, 1.19], steps: 40 }),
];
/// Relative width that what a part of the record leaves open is held to around its start.
const PART_WIDTH: f64 = 1.0;

/// Takes the start to where less data say that the answer is, if there is such a look at them and all data agree that it is better there.
/// What goes wrong on the way is no error: the start stays as it was.
pub(super) fn approach(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
) {
    let Some(mut thin) = estimator.rough(&place.full) else { return };
    let statistics = if request.settings.gain_tolerance > 0.0 { APPROACHED_GAIN } else { 0.0 };
    let least = if near_end::asked(request) { LANDS } else { APPROACHED.0 };
    let settings = Settings {
        decrement_tolerance: (100.0 * request.settings.decrement_tolerance).clamp(least, APPROACHED.1),
        gain_tolerance: request.settings.gain_tolerance.max(statistics),
        max_iterations: request.settings.max_iterations / 2,
        ..request.settings.clone()
    };
    let lax = Request { settings, ..request.clone() };
    let mut there = place.clone();
    let coarsest = thin.estimator.rough(&place.full).is_none();
    let thinner: &mut dyn Estimator = &mut *thin.estimator;
    if coarsest {
        lead(&lax, thinner, sizes, references, &mut there);
    } else {
        approach(&lax, thinner, sizes, references, &mut there);
    }
    let lax = unless_hopeless(&lax, thinner, sizes, references, &there);
    let mut end = pass(&lax, thinner, sizes, references, &mut there, None);
    let rows = thin.estimator.rows();
    drop(thin);
    // Springs that have stiffened on the way ask for finer steps.
    if let Some(mut finer) = estimator.rough(&there.full).filter(|c| c.estimator.rows() as f64 > FINER * rows as f64) {
        let again = pass(&lax, &mut *finer.estimator, sizes, references, &mut there, None);
        end = again.or(end);
    }
    place.iterations = there.iterations;
    // Where the pass got to counts, even where it did not get to its end: all data decide.
    if end.is_some() {
        *place = better(request, estimator, sizes, references, [place.clone(), there]);
    }
}

/// The request, or one of few linearisations where what led to `place` has led nowhere ([`Request::give_up`]).
pub(super) fn unless_hopeless<'r>(
    request: &Request<'r>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &[Reference],
    place: &Place,
) -> Request<'r> {
    let mut out = request.clone();
    let Some(limit) = request.give_up.filter(|_| place.iterations > 0) else { return out };
    let left = cost(request, estimator, sizes, references, place);
    if left.is_none_or(|c| c > limit * request.noise_of(estimator.rows())) {
        out.settings.max_iterations = GIVEN_UP.min(out.settings.max_iterations);
    }
    out
}

/// One pass over less data from `place`, which ends where it will not get below the objective `to_reach`; none when it fails.
fn pass(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
    to_reach: Option<f64>,
) -> Option<Status> {
    let threads = request.jacobian.threads(estimator.rows(), request.selected.len() + sizes.len());
    let mut evaluated = Evaluated::new(threads);
    let all = (0.0, request.noise_of(estimator.rows()));
    let way = Way { range: RANGE, to_reach, ..Way::over_less(all) };
    let end = settle(request, estimator, sizes, references, place, &mut evaluated, way);
    end.ok().map(|(_, status)| status)
}

/// A first pass over `estimator` from `place`. When it has not ended after [`LOST`] linearisations, or at what does not explain the data
/// ([`UNEXPLAINED`]), oscillations predicted and measured have slipped by periods: parts of the record that grow from its beginning lead
/// there from the same start, or, where they do not, another start of the request may ([`Request::other_starts`]), or parts that grow more slowly; the
/// best end counts. One that will not get there ends before.
fn lead(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
) {
    let of = |max_iterations: usize| {
        let settings = Settings { max_iterations, ..request.settings.clone() };
        Request { settings, ..request.clone() }
    };
    let most = LOST.min(request.settings.max_iterations);
    let explained = UNEXPLAINED * request.noise_of(estimator.rows());
    let left = |estimator: &mut dyn Estimator, references: &[Reference], at: &Place| {
        cost(request, estimator, sizes, references, at).unwrap_or(f64::INFINITY)
    };
    let mut best = place.clone();
    let end = pass(&of(most), estimator, sizes, references, &mut best, Some(explained));
    let ended = end.is_some_and(|s| s != Status::IterationLimit);
    let explains = left(estimator, references, &best) < explained;
    if ended && explains || request.settings.max_iterations <= LOST {
        *place = best;
        return;
    }
    // Other starts and slower growth are for the fit itself, not for what is tried beside it.
    let means = if request.other_starts.is_some() { &ALL_MEANS[..] } else { &ALL_MEANS[..1] };
    for by in means {
        let mut there = Place { iterations: best.iterations, ..place.clone() };
        match by {
            Means::Parts(parts) => grow(request, estimator, sizes, references, &mut there, parts),
            Means::OtherStart => match other_start(request, estimator, sizes, references, place) {
                Some(full) => there.full = full,
                None => continue,
            },
        }
        let end = pass(&of(most), estimator, sizes, references, &mut there, Some(explained));
        best.iterations = there.iterations;
        if end.is_some() {
            best = better(request, estimator, sizes, references, [best, there]);
        }
        if left(estimator, references, &best) < explained {
            break;
        }
    }
    *place = best;
}

/// Leads a place over parts of the record that grow from its beginning. Each is longer than the one before by a factor, and where it is not explained
/// from there, that is smaller: the better frequencies are known, the longer oscillations do not slip. The last part stays where that is of no use.
fn grow(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    led: &mut Place,
    parts: &Growth,
) {
    let settings =
        Settings { max_iterations: parts.steps.min(request.settings.max_iterations), ..request.settings.clone() };
    let short = Request { anchor: None, settings, ..request.clone() };
    let (mut share, mut by, mut slower) = (FIRST_PART, DOUBLED, parts.slower.iter());
    // What the last part that was explained has led to.
    let mut good: Option<(f64, Place)> = None;
    while share < 1.0 {
        let Some(mut begun) = estimator.beginning(share) else {
            share *= by;
            continue;
        };
        let kept = references.len();
        references.extend(Reference::new(request.decls, request.selected, &led.full, PART_WIDTH).ok());
        let mut on = led.clone();
        let explained = UNEXPLAINED * request.noise_of(begun.estimator.rows());
        let end = pass(&short, &mut *begun.estimator, sizes, references, &mut on, Some(explained));
        references.truncate(kept);
        led.iterations = on.iterations;
        if end.is_some() {
            *led = on;
        }
        let left = cost(request, &mut *begun.estimator, sizes, references, led);
        if left.is_some_and(|left| left < explained) {
            good = Some((share, led.clone()));
        } else {
            let (Some(less), Some((at, place))) = (slower.next(), &good) else { return };
            (share, by) = (*at, *less);
            *led = Place { iterations: led.iterations, ..place.clone() };
        }
        share *= by;
    }
}

/// The best of the other starts that the request has ([`Request::other_starts`]), if it is better than the place.
fn other_start(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &[Reference],
    place: &Place,
) -> Option<Vec<f64>> {
    let all = request.other_starts?.0();
    let mut of = |full: &[f64]| {
        let at = Place { full: full.to_vec(), ..place.clone() };
        cost(request, estimator, sizes, references, &at).unwrap_or(f64::INFINITY)
    };
    let own = of(&place.full);
    let costs = all.into_iter().map(|full| (of(&full), full));
    costs.filter(|c| c.0 < own).min_by(|a, b| a.0.total_cmp(&b.0)).map(|c| c.1)
}

/// That of two places where all data of the estimator say that the cost is lower; the first where they do not say.
fn better(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &[Reference],
    [here, there]: [Place; 2],
) -> Place {
    let before = cost(request, estimator, sizes, references, &here);
    match (before, cost(request, estimator, sizes, references, &there)) {
        (Some(before), Some(after)) if after >= before => here,
        (_, Some(_)) => there,
        (_, None) => here,
    }
}

/// Sum of squared residuals at a place, those of priors and references included; none where it cannot be evaluated.
pub(super) fn cost(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &[Reference],
    at: &Place,
) -> Option<f64> {
    let transform = Transform::affine(request.decls, request.selected, &at.full).ok()?;
    let mut x = transform.coordinates(&at.full).ok()?;
    x.extend_from_slice(&at.nuisance);
    let (mut new, origin) = (Evaluated::new(None), (&x[..], &at.full[..]));
    let mut fit = Fit::new(request, estimator, &transform, references, sizes, origin, &mut new);
    let mut r = Vec::new();
    let tried = fit.residuals(&x, &mut r).ok()?;
    tried.ok().map(|()| r.iter().map(|r| r * r).sum())
}
