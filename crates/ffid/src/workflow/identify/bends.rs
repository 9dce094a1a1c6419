//! Valleys that bend within the stated deviations.
//!
//! A standard deviation takes the cost for a parabola. Two mirrored wings that are nearly alike, or mass, length and stiffness of fuel, leave
//! a valley that bends within it: the cost rises by 1.8 where the parabola says 4, and an estimate is four stated deviations off while the
//! residuals are white. Whether that is so is asked of the posterior itself: at a few draws of it, the cost must have risen by what the
//! parabola says. Where it has not, every parameter that was asked for is looked at two deviations to either side, the others moved by one
//! linearisation (a chord); the valley is followed along those that rise too slowly, to where chi-squared has risen by 3.84, the end of
//! a 95 % interval (the profile, [`ident::belief::profile`]). There the covariance is made to allow for what was found
//! (docs/theory/output-error.md). Where the valley leads down instead, the fit has not ended where it is lowest, and goes on from there.

use super::chord::{Chord, Place};
use super::observed_estimator::ObservedEstimator;
use super::valleys::{Ending, answers};
use ff_least_squares::Settings as Solver;
use ff_model::ParamGroup;
use ident::Request;
use ident::belief::{LIMIT95, Point, PriorRow, Profile, Uncertainty};
use ident::estimate::{At, Estimate, attempt};
use nalgebra::{DMatrix, DVector};

/// Draws of the posterior at which the cost is compared with the parabola: both ways along three directions.
const DRAWS: usize = 3;
/// Difference of chi-squared from it, on the average of both ways, from which it is no parabola.
const ODD: f64 = 1.5;
/// Rise at two deviations, four of a parabola, below which a valley is followed.
const SLOW: f64 = 2.5;
/// Parameters that are followed, the slowest first.
const FOLLOWED: usize = 3;
/// Deviations to which they are followed at most.
const REACH: i32 = 8;
/// Part of a positive parameter at which there is nothing beyond: it is zero.
const GONE: f64 = 0.01;
/// Difference of the rise there from four up to which the first chord says enough.
const PLAIN: f64 = 1.2;
/// Parameters whose places are looked at at once.
const AT_ONCE: usize = 4;
/// Chords at a place, and change of the cost at which there is no need for more.
const CHORDS: usize = 3;
const STILL: f64 = 0.1;
/// Linearisations whose chords are gone along with one parameter held, and part of what a chord promises that the next may promise at most.
const RELINEARISED: usize = 3;
const SHRINKS: f64 = 0.3;
/// Width of the prior that holds a parameter while the others are fitted, in deviations, and linearisations of such a fit.
const HELD: f64 = 1e-3;
const REFITS: usize = 4;
/// Fall of chi-squared along a valley from which the fit goes on from there.
pub(super) const LOWER: f64 = 0.3;
/// Part of a variance that an end of an interval adds to it, below which it is left.
const LEAST: f64 = 0.02;

/// What was found along a valley.
pub(super) enum Followed {
    /// Intervals of parameters that were followed: none where it is a parabola.
    Up(Vec<Profile>),
    /// A place that is lower than the end of the fit: all parameters.
    Down(Vec<f64>),
}

/// Looks whether the valley of a fit bends, and makes its deviations allow for it, unless it leads down: to where chi-squared is lower by more
/// than `down`.
pub(super) fn follow(
    request: &Request<'_>,
    ending: &mut Ending,
    is_asked: impl Fn(usize) -> bool,
    down: f64,
    estimator: &mut ObservedEstimator<'_>,
) -> Followed {
    let e = &ending.estimate;
    let u = ending.alone.as_ref().unwrap_or(&e.uncertainty);
    if !answers(request, e) || request.prior_width.is_some() || !u.full_rank() {
        return Followed::Up(Vec::new());
    }
    let found = estimator.around(
        request,
        e,
        |i| !is_asked(i),
        |near, beyond| Bend { request, e, u, down, least: e.objective - beyond }.followed(&is_asked, near),
    );
    let (profiles, covariance) = match found {
        None => return Followed::Up(Vec::new()),
        Some(Err(place)) => return Followed::Down(place),
        Some(Ok(found)) => found,
    };
    if covariance != e.uncertainty.covariance {
        ending.widened(covariance);
    }
    Followed::Up(profiles)
}

/// Intervals and the covariance that allows for them, or a place that is lower than where they were looked at from.
type Looked = Result<(Vec<Profile>, DMatrix<f64>), Vec<f64>>;

/// What a valley is looked at from.
struct Bend<'a> {
    request: &'a Request<'a>,
    e: &'a Estimate,
    /// The parabola at its bottom.
    u: &'a Uncertainty,
    /// Cost there, of the rows that it is looked at by, and how much lower a place is at which the fit goes on.
    least: f64,
    down: f64,
}

impl Bend<'_> {
    /// Intervals of the parameters along which the valley bends, and a covariance that allows for them; `None` where it does not.
    fn followed(&self, is_asked: &impl Fn(usize) -> bool, estimator: &mut ObservedEstimator<'_>) -> Option<Looked> {
        let (request, e) = (self.request, self.e);
        if self.is_parabola(estimator) {
            return None;
        }
        let chord = Chord::new(request, e, estimator)?;
        let asked: Vec<usize> = (0..request.selected.len()).filter(|&k| is_asked(request.selected[k])).collect();
        let mut slow: Vec<(f64, usize)> = Vec::new();
        for some in asked.chunks(AT_ONCE) {
            let sides = some.iter().flat_map(|&column| [-2.0, 2.0].map(|n| (column, n)));
            let place = |(column, n)| Place { at: self.start(column, n), fixed: vec![column], steps: 0 };
            let rises = self.rises(&chord, sides.map(place).collect(), 4.0, estimator);
            for (column, rises) in some.iter().zip(rises.chunks(2)) {
                let lowest = rises.iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
                match lowest {
                    Some((rise, at)) if *rise < -self.down => return Some(Err(at.clone())),
                    Some((rise, _)) if *rise < SLOW => slow.push((*rise, *column)),
                    _ => {}
                }
            }
        }
        slow.sort_by(|a, b| a.0.total_cmp(&b.0));
        slow.truncate(FOLLOWED);
        let mut covariance = e.uncertainty.covariance.clone();
        let mut profiles = Vec::new();
        for (_, column) in slow {
            if estimator.stopped() {
                break;
            }
            match self.profile(column, &chord, &mut covariance, estimator) {
                Ok(profile) => profiles.push(profile),
                Err(place) => return Some(Err(place)),
            }
        }
        Some(Ok((profiles, covariance)))
    }
    fn std(&self, column: usize) -> f64 {
        self.u.covariance[(column, column)].max(0.0).sqrt()
    }
    /// Whether the cost at draws of the posterior is what the parabola says.
    fn is_parabola(&self, estimator: &mut ObservedEstimator<'_>) -> bool {
        let n = self.u.covariance.nrows();
        let std: Vec<f64> = (0..n).map(|k| self.std(k).max(f64::MIN_POSITIVE)).collect();
        let unit = DMatrix::from_fn(n, n, |i, j| {
            self.u.covariance[(i, j)] / (std[i] * std[j]) + if i == j { 1e-12 } else { 0.0 }
        });
        let Some(root) = unit.cholesky() else { return true };
        let draws: Vec<DVector<f64>> = (0..DRAWS).map(|k| DVector::from_fn(n, |i, _| normal(k * n + i))).collect();
        let step = |z: &DVector<f64>, sign: f64| -> Vec<f64> {
            (root.l() * z).iter().zip(&std).map(|(x, s)| sign * x * s).collect()
        };
        let steps: Vec<Vec<f64>> = draws.iter().flat_map(|z| [-1.0, 1.0].map(|sign| step(z, sign))).collect();
        let costs = self.costs(&steps, estimator);
        draws.iter().zip(costs.chunks(2)).all(|(z, both)| {
            // What leads out of what can exist is no place for a parabola.
            let [Some(one), Some(other)] = both else { return false };
            let [one, other] = [one, other].map(|cost| cost - self.least - z.norm_squared());
            // The slopes of what is no bend, such as a damping that is known to a tenth, cancel.
            0.5 * (one + other).abs() <= ODD && (one - other).abs() <= 4.0 * ODD
        })
    }
    /// Cost at steps of all unknowns from the estimate; `None` where that cannot be.
    fn costs(&self, steps: &[Vec<f64>], estimator: &mut ObservedEstimator<'_>) -> Vec<Option<f64>> {
        let selected = self.request.selected;
        let place = |step: &Vec<f64>| {
            let mut at = self.e.values.clone();
            selected.iter().zip(step).for_each(|(&i, x)| at[i] += x);
            let gone = |&i: &usize| self.request.decls[i].group == ParamGroup::Positive && at[i] <= 0.0;
            let extra = self.e.nuisance.iter().zip(&step[selected.len()..]).map(|(p, x)| p.value + x);
            if selected.iter().any(gone) { None } else { Some((at.clone(), extra.collect::<Vec<f64>>())) }
        };
        let places: Vec<Option<(Vec<f64>, Vec<f64>)>> = steps.iter().map(place).collect();
        let at: Vec<At<'_>> = places.iter().flatten().map(|(at, extra)| (&at[..], &extra[..])).collect();
        let rows = estimator.rows_at(&at);
        let cost = |(full, r): (&[f64], &[f64])| {
            let values: Vec<f64> = selected.iter().map(|&i| full[i]).collect();
            let mut known = Vec::new();
            self.request.priors.push_residuals(&values, &mut known);
            let cost = r.iter().chain(&known).map(|r| r * r).sum::<f64>();
            cost.is_finite().then_some(cost)
        };
        let mut costs = at.iter().zip(&rows).map(|(at, r)| r.as_ref().and_then(|r| cost((at.0, r))));
        places.iter().map(|p| p.as_ref().and_then(|_| costs.next().flatten())).collect()
    }
    /// The estimate with one parameter so many deviations away, and the others where the parabola has them then.
    fn start(&self, column: usize, deviations: f64) -> Vec<f64> {
        self.moved(&self.e.values, column, deviations)
    }
    fn moved(&self, from: &[f64], column: usize, deviations: f64) -> Vec<f64> {
        let mut at = from.to_vec();
        for (k, &i) in self.request.selected.iter().enumerate() {
            let x = at[i] + deviations * self.u.covariance[(k, column)] / self.std(column);
            let positive = self.request.decls[i].group == ParamGroup::Positive;
            at[i] = if positive { x.max(0.2 * at[i]) } else { x };
        }
        at
    }
    /// By how much the cost has risen at places with one parameter held and the others moved by chords, and where they are then. As much as
    /// a parabola rises need not be known better.
    fn rises(
        &self,
        chord: &Chord,
        mut places: Vec<Place>,
        parabola: f64,
        estimator: &mut ObservedEstimator<'_>,
    ) -> Vec<Option<(f64, Vec<f64>)>> {
        let mut out: Vec<Option<f64>> = vec![Some(f64::INFINITY); places.len()];
        let mut open: Vec<usize> = (0..places.len()).collect();
        for _ in 0..CHORDS {
            let at: Vec<&Place> = open.iter().map(|&k| &places[k]).collect();
            let found = chord.looks(self.request, self.e, &at, estimator);
            let mut still = Vec::new();
            for (k, found) in open.into_iter().zip(found) {
                let before = out[k].take();
                let (Some(before), Some((cost, moved))) = (before, found) else { continue };
                let rise = cost - self.least;
                out[k] = Some(rise.min(before));
                if before - rise >= STILL && (rise - parabola).abs() >= PLAIN {
                    places[k].at = moved;
                    still.push(k);
                }
            }
            open = still;
        }
        out.into_iter().zip(places).map(|(rise, place)| rise.map(|rise| (rise, place.at))).collect()
    }
    /// The others fitted again with one parameter held; `None` where that does not come near an end. One linearisation where they are, and
    /// chords of it as long as each leaves a fraction of what the one before promised; where the way is too bent for its steps, a fit goes
    /// on from there. The last linearisation is left in `chord`.
    fn refitted(
        &self,
        at: &[f64],
        column: usize,
        chord: &mut Option<Chord>,
        estimator: &mut ObservedEstimator<'_>,
    ) -> Option<(f64, Vec<f64>)> {
        let mut place = (at.to_vec(), self.e.nuisance.iter().map(|p| p.value).collect());
        for _ in 0..RELINEARISED {
            *chord = None;
            let Some((made, mut here)) = Chord::at(self.request, place.clone(), estimator) else { break };
            let (made, mut before, mut straight) = (chord.insert(made), f64::INFINITY, true);
            while let Some((step, promised)) = made.step(self.request, &here, &[column]) {
                if promised < STILL {
                    return Some((here.cost - promised - self.least, here.at));
                }
                if promised > SHRINKS * before {
                    break;
                }
                let Some((part, next)) = here.stepped(self.request, &step, estimator) else { break };
                (here, before, straight) = (next, promised, straight && part == 1.0);
            }
            place = (here.at, here.extra);
            if !straight || before == f64::INFINITY {
                break;
            }
        }
        self.fitted(&place.0, column, estimator)
    }
    /// A fit of the others from a place with one parameter held.
    fn fitted(&self, at: &[f64], column: usize, estimator: &mut ObservedEstimator<'_>) -> Option<(f64, Vec<f64>)> {
        let (request, value) = (self.request, at[self.request.selected[column]]);
        let own = request.priors.rows().iter().find(|r| r.column == column).copied();
        let pin = PriorRow { column, mean: value, sigma: HELD * self.std(column) };
        let settings = Solver { max_iterations: REFITS, gain_tolerance: STILL, ..request.settings.clone() };
        let centre = Some(request.centre.unwrap_or(request.start));
        let priors = request.priors.with(pin);
        let found = attempt(
            &Request { priors, start: at, centre, coarse: false, finer: 0, settings, ..request.clone() },
            estimator,
        )
        .ok()?;
        let got = found.parameters[column].value;
        let prior = own.map_or(0.0, |r| ((got - r.mean) / r.sigma).powi(2));
        Some((found.objective - ((got - value) / pin.sigma).powi(2) + prior - self.least, found.values))
    }
    /// The profile of one parameter; the covariance is made to allow for its ends. A place that is lower is an error.
    fn profile(
        &self,
        column: usize,
        chord: &Chord,
        covariance: &mut DMatrix<f64>,
        estimator: &mut ObservedEstimator<'_>,
    ) -> Result<Profile, Vec<f64>> {
        let (p, index, std) = (&self.e.parameters[column], self.request.selected[column], self.std(column));
        let mut points = vec![Point { value: p.value, excess: 0.0, converged: true }];
        let mut interval = [None, None];
        for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let (mut from, mut last, mut near) = (self.e.values.clone(), (0.0, 0.0), None);
            for n in 1..=REACH {
                let start = self.moved(&from, column, sign);
                // A chord says how far up at most; where it says that this is the end, and before the valley has turned too far, a fit does.
                let here = near.as_ref().unwrap_or(chord);
                let place = Place { at: start.clone(), fixed: vec![column], steps: 0 };
                let looked = self.rises(here, vec![place], f64::INFINITY, estimator).pop().flatten();
                let found = match looked {
                    Some((rise, at)) if rise < 0.5 * LIMIT95 => Some((rise, at)),
                    Some((_, at)) => self.refitted(&at, column, &mut near, estimator),
                    None => self.refitted(&start, column, &mut near, estimator),
                };
                let Some((rise, at)) = found else { break };
                if rise < -self.down {
                    return Err(at);
                }
                points.push(Point { value: at[index], excess: rise, converged: true });
                let (root, limit, here) = (rise.max(0.0).sqrt(), LIMIT95.sqrt(), (at[index] - p.value) / std);
                let step: Vec<f64> = self.request.selected.iter().map(|&i| at[i] - self.e.values[i]).collect();
                if root >= limit {
                    let share = (limit - last.1) / (root - last.1);
                    let end: f64 = last.0 + share * (here - last.0);
                    interval[side] = Some(p.value + std * end);
                    cover(covariance, &step, (here / end).powi(2) * LIMIT95);
                    break;
                }
                let positive = self.request.decls[index].group == ParamGroup::Positive;
                if n == REACH || (positive && at[index] < GONE * p.value) {
                    cover(covariance, &step, rise.max(1.0));
                    break;
                }
                (from, last) = (at, (here, root));
            }
        }
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
        let (name, unit) = (p.name.clone(), p.unit.clone());
        Ok(Profile { name, unit, value: p.value, points, interval95: (interval[0], interval[1]) })
    }
}

/// Makes a covariance allow for a place `d` away, where chi-squared has risen by `rise`: no unknown is there more than the root of that in
/// deviations away. `C + w w^T`, the diagonal of which is what that needs and no more.
fn cover(covariance: &mut DMatrix<f64>, d: &[f64], rise: f64) {
    let mut w = DVector::zeros(covariance.nrows());
    for (k, x) in d.iter().enumerate() {
        let (needed, stated) = (x * x / rise, covariance[(k, k)]);
        if needed > (1.0 + LEAST) * stated {
            w[k] = (needed - stated).sqrt().copysign(*x);
        }
    }
    covariance.ger(1.0, &w, &w, 1.0);
}

/// Numbers that are spread as normal ones are, the same each time.
fn normal(i: usize) -> f64 {
    let part = |step: f64| ((i + 1) as f64 * step).fract();
    // Box and Muller, of two irrational steps.
    (-2.0 * (1.0 - part(0.754_877_666_246_693)).max(1e-9).ln()).sqrt()
        * (core::f64::consts::TAU * part(0.569_840_290_998_053)).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::identify::observed_estimator::Observer;
    use ff_least_squares::EvalError;
    use ff_model::ParamDecl;
    use ident::Estimator;

    #[test]
    fn a_covariance_allows_for_a_place_by_the_least_that_does() {
        let mut c = DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 0.0, 1.0, 9.0, 0.0, 0.0, 0.0, 1.0]);
        let before = c.clone();
        cover(&mut c, &[3.9, 5.0], LIMIT95);
        assert_eq!(c, before, "within what is stated");
        cover(&mut c, &[12.0, -9.0], LIMIT95);
        let needed = [144.0, 81.0].map(|d| d / LIMIT95);
        assert!((c[(0, 0)] - needed[0]).abs() < 1e-9 && (c[(1, 1)] - needed[1]).abs() < 1e-9, "{c}");
        assert!(c[(2, 2)] == 1.0 && c[(0, 1)] < 1.0, "{c}");
        assert!(c.cholesky().is_some());
    }

    /// A valley over two unknowns, x beyond `pole`: residuals, and their derivatives by one unknown and the other.
    struct Valley<const ROWS: usize> {
        pole: f64,
        residuals: fn(f64, f64) -> [f64; ROWS],
        slopes: fn(f64) -> [[f64; ROWS]; 2],
    }
    impl<const ROWS: usize> Estimator for Valley<ROWS> {
        fn rows(&self) -> usize {
            ROWS
        }
        fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
            let [x, y] = p[..] else { return Err(EvalError::Rejected("two unknowns".into())) };
            if x <= self.pole {
                return Err(EvalError::Rejected("beyond the pole".into()));
            }
            r.copy_from_slice(&(self.residuals)(x, y));
            Ok(())
        }
        fn jacobian(
            &mut self,
            p: &[f64],
            extra: &[f64],
            selected: &[usize],
            r: &mut [f64],
            j: &mut DMatrix<f64>,
        ) -> Result<(), EvalError> {
            let slopes = (self.slopes)(p[0]);
            selected.iter().enumerate().for_each(|(c, &i)| j.column_mut(c).copy_from_slice(&slopes[i]));
            self.residuals(p, extra, r)
        }
    }

    /// A bent valley: the cost is `(x / (1 + x/4))^2 + 400 (y - x - 0.3 x^2)^2`.
    const BANANA: Valley<2> = Valley {
        pole: -3.5,
        residuals: |x, y| [x / (1.0 + 0.25 * x), 20.0 * (y - x - 0.3 * x * x)],
        slopes: |x| [[(1.0 + 0.25 * x).powi(-2), 20.0 * (-1.0 - 0.6 * x)], [0.0, 20.0]],
    };
    /// A lower floor behind an edge: the cost is `(x - 1)^2 + c(x)^2 + 400 (y - x)^2`, c falling from 2.5 to nothing at `x = 2.2`.
    const CLIFF: Valley<3> = Valley {
        pole: f64::NEG_INFINITY,
        residuals: |x, y| [x - 1.0, edge(x), 20.0 * (y - x)],
        slopes: |x| [[1.0, -6.0 * edge(x) * (1.0 - edge(x) / 2.5), -20.0], [0.0, 0.0, 20.0]],
    };
    fn edge(x: f64) -> f64 {
        2.5 / (1.0 + (6.0 * (x - 2.2)).exp())
    }

    fn free(name: &str) -> ParamDecl {
        ParamDecl {
            name: name.into(),
            unit: "m",
            nominal: 0.0,
            bounds: (f64::NEG_INFINITY, f64::INFINITY),
            group: ParamGroup::Free,
        }
    }

    #[test]
    fn a_valley_that_leads_down_is_where_the_fit_goes_on() {
        let decls = [free("x"), free("y")];
        let settings = Solver { cost_floor: 1e-13, ..Solver::default() };
        let request = Request { settings, ..Request::new(&decls, &[0, 1], &[0.8, 0.7]) };
        let mut cliff = CLIFF;
        let estimate = attempt(&request, &mut cliff).unwrap().ended().unwrap();
        assert!(estimate.values[0] < 1.3, "{:?}", estimate.values);
        let before = estimate.uncertainty.clone();
        let mut ending = Ending { estimate, minima: None, alone: None };
        let observer = Observer::default();
        let mut watched = ObservedEstimator::new(&mut cliff, &observer);
        let Followed::Down(start) = follow(&request, &mut ending, |i| i == 0, LOWER, &mut watched) else {
            panic!("up")
        };
        assert!(start[0] > 2.3, "{start:?}");
        assert_eq!(ending.estimate.uncertainty.covariance, before.covariance);
        let lower = attempt(&Request { start: &start, ..request.clone() }, &mut watched).unwrap();
        assert!(lower.objective < ending.estimate.objective - 1.0, "{}", lower.objective);
    }

    #[test]
    fn deviations_allow_for_a_valley_that_bends() {
        let decls = [free("x"), free("y")];
        let settings = Solver { cost_floor: 1e-13, ..Solver::default() };
        let request = Request { settings, ..Request::new(&decls, &[0, 1], &[0.4, 0.3]) };
        let mut banana = BANANA;
        let estimate = attempt(&request, &mut banana).unwrap().ended().unwrap();
        let std = |e: &Estimate| [e.parameters[0].std.unwrap(), e.parameters[1].std.unwrap()];
        assert!((std(&estimate)[0] - 1.0).abs() < 1e-3 && std(&estimate)[1] < 1.01, "{:?}", std(&estimate));
        let mut ending = Ending { estimate, minima: None, alone: None };
        let observer = Observer::default();
        let mut watched = ObservedEstimator::new(&mut banana, &observer);
        let Followed::Up(profiles) = follow(&request, &mut ending, |i| i == 0, LOWER, &mut watched) else {
            panic!("down")
        };
        let (low, high) = profiles[0].interval95;
        // r_0 = 1.96 and -1.96; ends lie on straight lines of the root of the rise, between places a deviation apart.
        let (low, high) = (low.unwrap(), high.unwrap());
        assert!((high / 3.843 - 1.0).abs() < 0.03 && (low / -1.315 - 1.0).abs() < 0.08, "{low} {high}");
        let [x, y] = std(&ending.estimate);
        assert!((x / (3.843 / 1.96) - 1.0).abs() < 0.05, "{x}");
        assert!(y > (3.843 + 0.3 * 3.843_f64.powi(2)) / 1.96 * 0.95, "{y}");
        assert!((std(&ending.estimate)[0]).powi(2) > ending.alone.unwrap().covariance[(0, 0)]);
    }

    #[test]
    fn draws_are_spread_as_normal_numbers_are() {
        let all: Vec<f64> = (0..4000).map(normal).collect();
        let moment = |k: i32| all.iter().map(|x| x.powi(k)).sum::<f64>() / 4000.0;
        assert!(moment(1).abs() < 0.05 && (moment(2) - 1.0).abs() < 0.1 && (moment(4) - 3.0).abs() < 0.5);
    }
}
