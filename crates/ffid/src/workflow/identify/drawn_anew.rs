//! An appendage that a fit has lost, drawn anew where the fit has ended.
//!
//! Where the rest is nearly right, only the few unknowns of that appendage are in the wrong place. A fit that sets out from one draw of them needs dozens of
//! linearisations, and most draws lead nowhere. So many draws are looked at first, by predictions over few rows with the cost of all of them. Whatever its
//! frequencies and lengths are, what a light appendage adds to a record is nearly proportional to its mass, if springs and dampers grow with it: each draw counts
//! with the strength that explains most, all other unknowns moved by one linearisation (a chord). The best is led on. Of several modes it may have
//! found some: those that are hardly told there are drawn once more, with the masses and lengths that the others have told.

use super::chord::{Chord, Here, Place};
use super::ends::{FAR, LOWER, is_spring, of_body, within};
use super::lost::is_hardly_told;
use super::observed_estimator::ObservedEstimator;
use ff_least_squares::{Settings as Solver, Status};
use ident::Request;
use ident::estimate::{Estimate, attempt};
use ident::parameters::{is_damping, wide_start};

/// Draws that are looked at together, of which one in [`ANYWHERE`] has its springs anywhere, the others at lines of the residuals.
const DRAWS: usize = 48;
/// See [`DRAWS`].
const ANYWHERE: usize = 4;
/// How often others are drawn where none is better than the end of the fit.
const LOTS: usize = 3;
/// Strengths in which a draw counts. Far from those that were drawn, fits creep.
const STRENGTHS: (f64, f64) = (0.3, 3.0);
/// Part of what lies above noise that a draw must explain to be led on, and that a fit must in [`FEW`] linearisations.
const PROMISING: f64 = 0.01;
/// See [`PROMISING`].
const WORTH: f64 = 0.05;
const FEW: usize = 10;
/// How often it goes on.
const LONGER: usize = 2;
/// The best draws, which are looked at as they are.
const BEST: usize = 3;

/// Puts springs among these parameters to lines of the residuals, in the order of a turn.
pub(super) type ToLines<'a> = dyn Fn(&[usize], usize, &mut [f64]) + 'a;

/// What is drawn anew, and around what.
pub(super) struct Search<'a> {
    pub(super) request: &'a Request<'a>,
    pub(super) first: &'a Estimate,
    /// Parameters of what is lost, by index.
    pub(super) lost: &'a [usize],
    /// The end of the fit with these as the mission has them.
    pub(super) back: &'a [f64],
    pub(super) seed: u64,
    /// Settings of a pass that shows where a start leads.
    pub(super) settings: Solver,
    pub(super) to_lines: &'a ToLines<'a>,
    /// Takes off what carries it what has become heavier in the first than it was in the second.
    pub(super) whole: &'a dyn Fn(&mut [f64], &[f64]),
}

impl Search<'_> {
    /// Where the best of all draws leads, if that explains the record, over rows that have the cost of all of them but for `beyond`.
    pub(super) fn best(&self, near: &mut ObservedEstimator<'_>, beyond: f64) -> Option<Estimate> {
        let (request, first) = (self.request, self.first);
        let extra = first.nuisance.iter().map(|p| p.value).collect();
        let (chord, here) = Chord::at(request, (first.values.clone(), extra), near)?;
        let own = first.objective - beyond;
        let above_noise = first.objective - request.noise * first.residuals.len() as f64;
        let least = (PROMISING * above_noise).max(LOWER);
        let start = (0..LOTS).find_map(|lot| self.start(&chord, &here, lot, near).filter(|s| s.0 < own - least))?.1;
        let worth = WORTH * above_noise;
        let led = self.led(&start, own, worth, near)?;
        if self.explains(&led, beyond) {
            return Some(led);
        }
        let on = self.once_more(&chord, (&led, least), near)?;
        let led = self.led(&on, led.objective, worth, near)?;
        self.explains(&led, beyond).then_some(led)
    }
    /// A draw of these parameters around `at`.
    fn drawn(&self, at: &[f64], which: &[usize], k: usize) -> Vec<f64> {
        // Not the draws of other starts.
        let seed = self.seed.wrapping_add(0x1057 + k as u64);
        let mut out = wide_start(self.request.decls, at, which, seed);
        if !k.is_multiple_of(ANYWHERE) {
            (self.to_lines)(which, k, &mut out);
        }
        out
    }
    /// Columns of what is lost.
    fn fixed(&self) -> Vec<usize> {
        let is_lost = |k: &usize| self.lost.contains(&self.request.selected[*k]);
        (0..self.request.selected.len()).filter(is_lost).collect()
    }
    fn place(&self, at: Vec<f64>) -> Place {
        Place { at, fixed: self.fixed(), steps: 0 }
    }
    /// The best draw of a lot, and its cost in the strength that is best.
    fn start(
        &self,
        chord: &Chord,
        here: &Here,
        lot: usize,
        near: &mut ObservedEstimator<'_>,
    ) -> Option<(f64, Vec<f64>)> {
        let (request, first) = (self.request, self.first);
        let draw = |k: usize| {
            let mut at = self.drawn(self.back, self.lost, lot * DRAWS + k);
            (self.whole)(&mut at, &first.values);
            self.place(at)
        };
        let places: Vec<Place> = (0..DRAWS).map(draw).collect();
        let all: Vec<&Place> = places.iter().collect();
        let looked = chord.looks_along(request, here, (&all, &self.fixed()), STRENGTHS, near);
        let mut found: Vec<(f64, Place)> = Vec::new();
        for (place, (cost, strength)) in places.iter().zip(looked).filter_map(|(p, l)| Some((p, l?))) {
            let mut at = place.at.clone();
            self.lost.iter().filter(|&&i| self.is_extensive(i)).for_each(|&i| at[i] *= strength);
            (self.whole)(&mut at, &place.at);
            found.push((cost, self.place(at)));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.truncate(BEST);
        let least = found.first()?.0;
        let best: Vec<&Place> = found.iter().map(|f| &f.1).collect();
        let looked = chord.looks(request, first, &best, near).into_iter().flatten();
        let moved = looked.min_by(|a, b| a.0.total_cmp(&b.0))?.1;
        // Bodies go along. Springs of others, which the record hardly tells, would go anywhere.
        let mut at = first.values.clone();
        let goes = |i: &&usize| self.lost.contains(i) || of_body(request, **i);
        request.selected.iter().filter(goes).for_each(|&i| at[i] = moved[i]);
        Some((least, at))
    }
    /// Whether what an appendage adds to a record grows with this parameter and all others of this kind together.
    fn is_extensive(&self, i: usize) -> bool {
        let decl = &self.request.decls[i];
        !of_body(self.request, i) && (decl.unit == "kg" || is_spring(self.request, i) || is_damping(decl))
    }
    /// Where a fit leads that has found some of the modes, or is still on its way: a draw of springs and dampers that are hardly told there which takes at
    /// least so much off its cost.
    fn once_more(
        &self,
        chord: &Chord,
        (led, least): (&Estimate, f64),
        near: &mut ObservedEstimator<'_>,
    ) -> Option<Vec<f64>> {
        let request = self.request;
        let wanted = |&i: &usize| self.lost.contains(&i) && (is_spring(request, i) || is_damping(&request.decls[i]));
        let pairs = request.selected.iter().copied().zip(&led.parameters);
        let untold: Vec<usize> = pairs.filter(|(i, p)| wanted(i) && is_hardly_told(p)).map(|(i, _)| i).collect();
        if untold.is_empty() {
            return Some(led.values.clone());
        }
        let mut at = led.values.clone();
        untold.iter().for_each(|&i| at[i] = self.back[i]);
        let mut best = |lot: usize| {
            let draw = |k| self.place(self.drawn(&at, &untold, lot * DRAWS + k));
            let places: Vec<Place> = (0..DRAWS).map(draw).collect();
            let looked = chord.looks(request, self.first, &places.iter().collect::<Vec<_>>(), near);
            let costs = places.into_iter().zip(looked).filter_map(|(place, l)| Some((l?.0, place.at)));
            costs.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|c| c.0 < led.objective - least)
        };
        (0..LOTS).find_map(&mut best).map(|c| c.1)
    }
    /// Where a fit leads from a start; `None` where that is not below an objective by so much, or it stays above for long.
    fn led(&self, start: &[f64], below: f64, worth: f64, near: &mut ObservedEstimator<'_>) -> Option<Estimate> {
        let few = Solver { max_iterations: FEW.min(self.settings.max_iterations), ..self.settings.clone() };
        let tried = Request {
            start,
            centre: Some(self.request.start),
            coarse: false,
            near_end: false,
            finer: 0,
            settings: few,
            ..self.request.clone()
        };
        let mut led = attempt(&tried, near).ok()?;
        for _ in 0..LONGER {
            if led.objective > below - worth || led.status != Status::IterationLimit {
                break;
            }
            let on = attempt(&Request { start: &led.values, ..tried.clone() }, near).ok()?;
            let gained = led.objective - on.objective;
            led = on;
            if gained < worth {
                break;
            }
        }
        (led.objective < below - worth).then_some(led)
    }
    /// Whether a fit leaves no more than chance does of all rows.
    fn explains(&self, led: &Estimate, beyond: f64) -> bool {
        let first = self.first;
        let chi2_per_dof = first.chi2_per_dof * (led.objective + beyond) / first.objective;
        led.objective + beyond < first.objective - LOWER
            && within(&Estimate { chi2_per_dof, ..first.clone() }, FAR, self.request.noise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::identify::observed_estimator::Observer;
    use ff_least_squares::EvalError;
    use ff_model::ParamDecl;
    use ident::Estimator;
    use nalgebra::DMatrix;

    /// Readings of a hull's rate in noise, with a tank that rings in two modes: `b + m sum_i exp(-d_i t / 2 m) sin(sqrt(k_i / m) t + i)`.
    struct Ringing(Vec<f64>);
    const TRUTH: [f64; 6] = [0.41, 7.3, 12.9, 22.4, 0.83, 1.27];
    const SIGMA: f64 = 0.9;
    const READINGS: usize = 900;
    impl Ringing {
        fn rate(p: &[f64], t: f64) -> f64 {
            let mode = |i: usize| (-p[4 + i] / p[1] * t / 2.0).exp() * ((p[2 + i] / p[1]).sqrt() * t + i as f64).sin();
            p[0] + 0.2 * p[1] * (mode(0) + mode(1))
        }
        fn new() -> Self {
            // A sum of sines of no common period: as wide as noise, and not of the model.
            let noise = |k: usize| (0.37 + 2.399 * (k * k % 7919) as f64).sin() * std::f64::consts::SQRT_2 * SIGMA;
            Self((0..READINGS).map(|k| Self::rate(&TRUTH, 0.04 * k as f64) + noise(k)).collect())
        }
    }
    impl Estimator for Ringing {
        fn rows(&self) -> usize {
            READINGS
        }
        fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
            let read = self.0.iter().enumerate();
            read.zip(r).for_each(|((k, y), r)| *r = (Self::rate(p, 0.04 * k as f64) - y) / SIGMA);
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
            for (c, &i) in selected.iter().enumerate() {
                let at = |by: f64| {
                    let mut at = p.to_vec();
                    at[i] += by * 1e-6;
                    at
                };
                let (above, below) = (at(1.0), at(-1.0));
                for k in 0..READINGS {
                    let t = 0.04 * k as f64;
                    j[(k, c)] = (Self::rate(&above, t) - Self::rate(&below, t)) / 2e-6 / SIGMA;
                }
            }
            self.residuals(p, extra, r)
        }
    }

    #[test]
    fn a_tank_that_is_lost_is_found_where_the_rest_is_right() {
        let positive = |name: &str, unit| ParamDecl::positive(name, unit, 1.0);
        let decls = [
            positive("hull.bias", "rad/s"),
            positive("tank.mass", "kg"),
            positive("tank.k[0]", "N m/rad"),
            positive("tank.k[1]", "N m/rad"),
            positive("tank.d[0]", "N m s/rad"),
            positive("tank.d[1]", "N m s/rad"),
        ];
        let start = [0.52, 1.6, 52.0, 98.0, 2.3, 0.34];
        let selected = [0, 1, 2, 3, 4, 5];
        let request = Request::new(&decls, &selected, &start);
        let mut record = Ringing::new();
        let first = attempt(&request, &mut record).unwrap();
        assert!(!within(&first, FAR, 1.0), "no test where the fit finds it: {}", first.chi2_per_dof);
        let back = [first.values[0], 1.6, 52.0, 98.0, 2.3, 0.34];
        let observer = Observer::default();
        let mut near = ObservedEstimator::new(&mut record, &observer);
        let search = Search {
            request: &request,
            first: &first,
            lost: &[1, 2, 3, 4, 5],
            back: &back,
            seed: 1,
            settings: Solver { decrement_tolerance: 1e-4, ..Solver::default() },
            to_lines: &|_, _, _| (),
            whole: &|_, _| (),
        };
        let found = search.best(&mut near, 0.0).expect("found");
        drop(near);
        for (i, (value, truth)) in found.values.iter().zip(TRUTH).enumerate() {
            assert!((value / truth - 1.0).abs() < 0.3, "{}: {value} of {truth}", decls[i].name);
        }
        // What no draw explains is not led to: another record of the same noise.
        record.0.reverse();
        let first = attempt(&request, &mut record).unwrap();
        let mut near = ObservedEstimator::new(&mut record, &observer);
        assert!(Search { first: &first, ..search }.best(&mut near, 0.0).is_none());
    }
}
