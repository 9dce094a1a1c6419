//! One linearisation that serves several places (a chord): at the end of a fit for those around it, or on the way along a valley.

use super::observed_estimator::ObservedEstimator;
use ff_linalg::tr_mul;
use ff_model::ParamGroup;
use ident::estimate::{At, Estimate};
use ident::solve::Normal;
use ident::{Estimator, Request, Transform};
use nalgebra::{DMatrix, DVector};

/// Most by which a positive parameter falls where places are looked at.
const FOLLOW: f64 = 3.0;
/// Part of a positive parameter that a step leaves of it at least.
const LEAST_PART: f64 = 0.1;
/// Solutions of a step with positive parameters held at that.
const BOUNDED: usize = 4;
/// Places whose rows are held at a time.
const AT_ONCE: usize = 16;
/// Parts of a step that are tried.
const SHORTENED: [f64; 5] = [1.0, 0.5, 0.25, 0.125, 0.0625];

/// A place to look at: all unknowns, the columns that a chord leaves alone, and how many steps it is from the end along a spring.
pub(super) struct Place {
    pub(super) at: Vec<f64>,
    pub(super) fixed: Vec<usize>,
    pub(super) steps: i32,
}

/// A linearisation at the end of a fit that serves other places: residuals there, with the unknowns that do not make the place moved by it.
pub(super) struct Chord {
    j: DMatrix<f64>,
    known: DMatrix<f64>,
    normal: Normal,
}

impl Chord {
    /// At the end of a fit. Allocates the Jacobian.
    pub(super) fn new(request: &Request<'_>, e: &Estimate, estimator: &mut ObservedEstimator<'_>) -> Option<Self> {
        let extra = e.nuisance.iter().map(|p| p.value).collect();
        Self::at(request, (e.values.clone(), extra), estimator).map(|made| made.0)
    }
    /// At other values of parameters and nuisance unknowns, and the residuals there. Allocates the Jacobian.
    pub(super) fn at(
        request: &Request<'_>,
        (at, extra): (Vec<f64>, Vec<f64>),
        estimator: &mut ObservedEstimator<'_>,
    ) -> Option<(Self, Here)> {
        let (rows, columns) = (estimator.rows(), request.selected.len() + extra.len());
        let (mut r, mut j) = (vec![0.0; rows], DMatrix::zeros(rows, columns));
        estimator.jacobian(&at, &extra, request.selected, &mut r, &mut j).ok()?;
        let mut known = DMatrix::zeros(request.priors.len(), columns);
        let here = Here::new(request, at, extra, r)?;
        let values: Vec<f64> = request.selected.iter().map(|&i| here.at[i]).collect();
        request.priors.fill_jacobian(&values, &mut known, 0);
        let normal = Normal::new(&j, &known).ok()??;
        Some((Self { j, known, normal }, here))
    }
    /// The minimum of `x^T H x / 2 - b^T x`, `H` the normal matrix, with the elements `fixed` at these values: `y + Z m` with `H y = b`, `H Z` the
    /// unit vectors of those that are fixed, and the multipliers `m` that put them there.
    fn solved(&self, b: &DVector<f64>, fixed: &[usize], values: &[f64]) -> Option<DVector<f64>> {
        let mut x = self.normal.root.solve(b);
        if fixed.is_empty() {
            return Some(x);
        }
        let unit = |i: usize, k: usize| if i == fixed[k] { 1.0 } else { 0.0 };
        let z = self.normal.root.solve(&DMatrix::from_fn(b.len(), fixed.len(), unit));
        let own = DMatrix::from_fn(fixed.len(), fixed.len(), |a, k| z[(fixed[a], k)]);
        let off = DVector::from_fn(fixed.len(), |k, _| values[k] - x[fixed[k]]);
        x += z * own.cholesky()?.solve(&off);
        fixed.iter().zip(values).for_each(|(&k, v)| x[k] = *v);
        Some(x)
    }
    /// `[J; K]^T` times residuals of the data and of what is known, in deviations of each unknown by itself.
    fn slope(&self, r: &[f64], known: &[f64]) -> DVector<f64> {
        let slope = tr_mul(&self.j, r) + self.known.tr_mul(&DVector::from_column_slice(known));
        DVector::from_fn(slope.len(), |k, _| slope[k] / self.normal.size[k])
    }
    /// The step of all unknowns but the columns `fixed` that this linearisation makes of the residuals somewhere, and by how much it promises
    /// that their squares fall. Positive parameters keep a tenth.
    pub(super) fn step(&self, request: &Request<'_>, here: &Here, fixed: &[usize]) -> Option<(Vec<f64>, f64)> {
        let n = self.normal.size.len();
        let slope = self.slope(&here.r, &here.known);
        let mut step = DVector::zeros(n);
        let mut fixed = fixed.to_vec();
        for _ in 0..BOUNDED {
            let values: Vec<f64> = fixed.iter().map(|&k| step[k]).collect();
            step = self.solved(&-&slope, &fixed, &values)?;
            let held = fixed.len();
            for (k, &i) in request.selected.iter().enumerate() {
                if fixed[..held].contains(&k) {
                    continue;
                }
                let least = (LEAST_PART - 1.0) * here.at[i] * self.normal.size[k];
                if request.decls[i].group == ParamGroup::Positive && step[k] < least {
                    step[k] = least;
                    fixed.push(k);
                }
            }
            if fixed.len() == held {
                break;
            }
        }
        let promised = -2.0 * slope.dot(&step) - step.dot(&(&self.normal.matrix * &step));
        let step: Vec<f64> = step.iter().zip(&self.normal.size).map(|(x, s)| x / s).collect();
        promised.is_finite().then_some((step, promised))
    }
    /// Cost at each of these places with the other unknowns moved, and where they are then. Allocates the rows of [`AT_ONCE`].
    pub(super) fn looks(
        &self,
        request: &Request<'_>,
        e: &Estimate,
        places: &[&Place],
        estimator: &mut ObservedEstimator<'_>,
    ) -> Vec<Option<(f64, Vec<f64>)>> {
        let extra: Vec<f64> = e.nuisance.iter().map(|p| p.value).collect();
        in_lots(places, &extra, estimator, |place, r| self.judged(request, place, &r))
    }
    /// As [`Chord::looks`] at places of the same `fixed` columns, where what is at a place may be there in any strength: the cost with the residuals `own` of the
    /// chord's point changed by the part, within these bounds, of what they change by to the place that makes it lowest, all other unknowns moved, and that part. Allocates the
    /// rows of [`AT_ONCE`].
    pub(super) fn looks_along(
        &self,
        request: &Request<'_>,
        own: &Here,
        (places, fixed): (&[&Place], &[usize]),
        (least, most): (f64, f64),
        estimator: &mut ObservedEstimator<'_>,
    ) -> Vec<Option<(f64, f64)>> {
        // What the free unknowns take of the residuals, and of a change of them.
        let none = vec![0.0; fixed.len()];
        let slope = self.slope(&own.r, &own.known);
        let Some(step) = self.solved(&slope, fixed, &none) else { return Vec::new() };
        let left = own.cost - step.dot(&slope);
        let less = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        in_lots(places, &own.extra, estimator, |place, r| {
            let there = Here::new(request, place.at.clone(), Vec::new(), r)?;
            let change = (less(&there.r, &own.r), less(&there.known, &own.known));
            let by_change = self.slope(&change.0, &change.1);
            let by_step = self.solved(&by_change, fixed, &none)?;
            let squares: f64 = change.0.iter().chain(&change.1).map(|c| c * c).sum();
            let products: f64 =
                own.r.iter().zip(&change.0).chain(own.known.iter().zip(&change.1)).map(|(a, b)| a * b).sum();
            let (rise, bend) = (products - step.dot(&by_change), squares - by_step.dot(&by_change));
            let part = (-rise / bend).clamp(least, most);
            let cost = left + part * (2.0 * rise + part * bend);
            cost.is_finite().then_some((cost, part))
        })
    }
    /// See [`Chord::looks`], with the residuals of the data there.
    fn judged(&self, request: &Request<'_>, place: &Place, r: &[f64]) -> Option<(f64, Vec<f64>)> {
        let values: Vec<f64> = request.selected.iter().map(|&i| place.at[i]).collect();
        let mut known = Vec::new();
        request.priors.push_residuals(&values, &mut known);
        let squares: f64 = r.iter().chain(&known).map(|r| r * r).sum();
        let b = self.slope(r, &known);
        let step = self.solved(&b, &place.fixed, &vec![0.0; place.fixed.len()])?;
        let cost = squares - b.dot(&step);
        let mut at = place.at.clone();
        for (k, &i) in request.selected.iter().enumerate().filter(|(k, _)| !place.fixed.contains(k)) {
            let moved = at[i] - step[k] / self.normal.size[k];
            let least = if request.decls[i].group == ParamGroup::Positive { at[i] / FOLLOW } else { f64::NEG_INFINITY };
            at[i] = moved.max(least);
        }
        let physical = is_physical(request, &at);
        cost.is_finite().then(|| (cost, if physical { at } else { place.at.clone() }))
    }
}

/// What is made of the residuals at each of these places, of which [`AT_ONCE`] are held.
fn in_lots<T>(
    places: &[&Place],
    extra: &[f64],
    estimator: &mut ObservedEstimator<'_>,
    one: impl Fn(&Place, Vec<f64>) -> Option<T>,
) -> Vec<Option<T>> {
    let mut out = Vec::new();
    for some in places.chunks(AT_ONCE) {
        let at: Vec<At<'_>> = some.iter().map(|p| (&p.at[..], extra)).collect();
        out.extend(some.iter().zip(estimator.rows_at(&at)).map(|(place, r)| one(place, r?)));
    }
    out
}

/// Unknowns, and the residuals there: of the data, then of what is known.
pub(super) struct Here {
    pub(super) at: Vec<f64>,
    pub(super) extra: Vec<f64>,
    r: Vec<f64>,
    known: Vec<f64>,
    /// The sum of their squares.
    pub(super) cost: f64,
}

impl Here {
    fn new(request: &Request<'_>, at: Vec<f64>, extra: Vec<f64>, r: Vec<f64>) -> Option<Self> {
        let values: Vec<f64> = request.selected.iter().map(|&i| at[i]).collect();
        let mut known = Vec::new();
        request.priors.push_residuals(&values, &mut known);
        let cost: f64 = r.iter().chain(&known).map(|r| r * r).sum();
        cost.is_finite().then_some(Self { at, extra, r, known, cost })
    }
    /// Where a step of all unknowns leads, shortened until what is there can exist and the cost is lower, and the part of it that was gone;
    /// `None` where it never is.
    pub(super) fn stepped(
        &self,
        request: &Request<'_>,
        step: &[f64],
        estimator: &mut ObservedEstimator<'_>,
    ) -> Option<(f64, Self)> {
        let (of_parameters, of_extra) = step.split_at(request.selected.len());
        for part in SHORTENED {
            let mut at = self.at.clone();
            request.selected.iter().zip(of_parameters).for_each(|(&i, x)| at[i] += part * x);
            if !is_physical(request, &at) {
                continue;
            }
            let extra: Vec<f64> = self.extra.iter().zip(of_extra).map(|(e, x)| e + part * x).collect();
            let mut r = vec![0.0; self.r.len()];
            if estimator.residuals(&at, &extra, &mut r).is_ok()
                && let Some(next) = Self::new(request, at, extra, r).filter(|next| next.cost < self.cost)
            {
                return Some((part, next));
            }
        }
        None
    }
}

/// Whether bodies with these parameters can exist.
pub(super) fn is_physical(request: &Request<'_>, at: &[f64]) -> bool {
    Transform::affine(request.decls, request.selected, at).is_ok_and(|t| t.inconsistent(at).is_none())
}
