//! Which errors would explain a record, in order.

use crate::uncertain::hypotheses::Hypothesis;
use crate::uncertain::multiplicity;
use crate::uncertain::score::{Combination, Direction, Score, Scores, Searched};
use core::ops::Range;

/// How often the tests of all errors together see one where there is none. The tests for coloured residuals
/// ([`crate::checks::whiteness::LEVEL`]) have as much.
pub const LEVEL: f64 = 0.005;
/// Correlation of two errors' effects above which the data cannot choose between them.
pub const ALIKE: f64 = 0.95;
/// Part of a standard deviation that an error must move an estimate by to count against the model.
pub const MATTERS: f64 = 0.5;
/// Errors that are looked for beside one another.
const TOGETHER: usize = 6;
/// By how much more the best may explain than another for the data to choose between them.
const CLOSE: f64 = 12.0;
/// Deviations of chi-squared that it must lie above its expectation by for a part of that to have a meaning.
const EXCESS: f64 = 4.0;

/// An error that the record speaks for.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// Which of the hypotheses.
    pub hypothesis: usize,
    /// Its test, behind those named before it that count together with it ([`Named::beside`]).
    pub score: Score,
    /// Whether it is one of several that explain the record together: then the score is what it adds to those before it.
    pub beside: bool,
    /// Others whose effect is nearly the same (correlation above [`ALIKE`]).
    pub alike: Vec<usize>,
}

/// The outcome of all tests.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ranking {
    /// Errors that the data could tell from the fit's unknowns.
    pub tested: usize,
    /// Independent tests that these are worth.
    pub independent: f64,
    /// Those that are larger than chance allows at [`LEVEL`] over all tests: first those that explain the record together, then
    /// the others by how much of it they explain alone.
    pub named: Vec<Named>,
    /// Part of chi-squared above its expectation that those which explain the record together account for; `None` where it is not
    /// above it by more than chance.
    pub explained: Option<f64>,
    /// Chi-squared above its expectation, where that is more than chance.
    pub excess: Option<f64>,
    /// All that were tested, whatever came of it, each by itself.
    pub alone: Vec<Named>,
}

impl Ranking {
    /// Whether one of the errors may move an estimate by more than [`MATTERS`] of its deviation, at 95 %: one of those that explain the
    /// record together, or one that explains as much as the best.
    pub fn matters(&self) -> bool {
        let best = self.named.first().map_or(0.0, |n| n.score.drop);
        let counts = |(k, n): (usize, &Named)| k == 0 || n.beside || n.score.drop > best - CLOSE;
        self.named.iter().enumerate().any(|(k, n)| counts((k, n)) && n.score.may_move > MATTERS)
    }
}

/// An error that can be tested.
struct Testable {
    hypothesis: usize,
    components: Vec<usize>,
    searched: Searched,
    positive: bool,
}

impl Testable {
    fn test(&self, scores: &Scores, given: &[usize]) -> Option<Score> {
        let score = scores.test_searched(&self.components, given, self.searched)?;
        Some(if self.positive { score.of_positive() } else { score })
    }
}

/// The errors with columns among `names` (parameters, then nuisance unknowns): indices of the hypotheses, their components in one list,
/// and where each begins there. Columns of the `base` are those of the fit.
pub struct Layout {
    of: Vec<Testable>,
    /// Columns of all components, for [`Scores::new`].
    pub components: Vec<Direction>,
}

impl Layout {
    /// Of the hypotheses whose columns there are. One that has columns of the `base` alone has been estimated; those that lie within
    /// the base are dropped from what they share with it.
    pub fn new(all: &[Hypothesis], names: &[String], labels: &[String], base: &[usize]) -> Self {
        let (mut of, mut components) = (Vec::new(), Vec::new());
        for (hypothesis, h) in all.iter().enumerate() {
            let Some(columns) = h.columns(names, labels) else { continue };
            let free: Vec<Combination> =
                columns.into_iter().filter(|c| c.iter().any(|(i, _)| !base.contains(i))).collect();
            if free.is_empty() || free.len() < h.components.len() {
                continue;
            }
            let first = components.len();
            components.extend(free.into_iter().map(Direction::from));
            let (searched, positive) = (Searched::default(), h.positive);
            of.push(Testable { hypothesis, components: (first..components.len()).collect(), searched, positive });
        }
        Self { of, components }
    }
    /// With another hypothesis: that the unknowns `base` of the fit have other values in the record with these rows than in the others.
    pub fn differing(&mut self, hypothesis: usize, base: &[Combination], rows: &Range<usize>) {
        let of_record = |c: &Combination| Direction { rows: Some(rows.clone()), ..c.clone().into() };
        self.push(hypothesis, base.iter().map(of_record), Searched::default());
    }
    /// With another hypothesis whose columns were looked for.
    pub fn push(&mut self, hypothesis: usize, components: impl Iterator<Item = Direction>, searched: Searched) {
        let first = self.components.len();
        self.components.extend(components);
        let components = (first..self.components.len()).collect();
        self.of.push(Testable { hypothesis, components, searched, positive: false });
    }
    /// Components of one of the hypotheses, if it has columns.
    pub fn components_of(&self, hypothesis: usize) -> Option<&[usize]> {
        self.of.iter().find(|t| t.hypothesis == hypothesis).map(|t| &t.components[..])
    }
    /// Tests all, and ranks what is found.
    pub fn rank(&self, scores: &Scores) -> Ranking {
        let worth = |s: &Score| s.evidence;
        let alone: Vec<Option<Score>> = self.of.iter().map(|t| t.test(scores, &[])).collect();
        let tested = alone.iter().flatten().count();
        let told = self.of.iter().zip(&alone).filter(|t| t.1.is_some() && t.0.searched == Searched::default());
        let told: Vec<multiplicity::Test<'_>> =
            told.map(|(t, _)| multiplicity::Test { components: &t.components, positive: t.positive }).collect();
        let searched = (tested - told.len()) as f64;
        let independent =
            (multiplicity::independent(&scores.of_sums(), &told, LEVEL / tested.max(1) as f64) + searched).max(1.0);
        let limit = LEVEL / independent;
        let mut named: Vec<Named> = Vec::new();
        let mut given: Vec<usize> = Vec::new();
        while named.len() < TOGETHER {
            let behind = self.of.iter().enumerate().filter_map(|(k, t)| {
                let score = if given.is_empty() { alone[k].clone() } else { t.test(scores, &given) };
                score.filter(|s| s.p < limit).map(|s| (k, s))
            });
            let best = behind.max_by(|a, b| worth(&a.1).total_cmp(&worth(&b.1)));
            let Some((k, score)) = best else { break };
            let beside = !named.is_empty();
            let alike = self.alike(scores, &alone, k);
            given.extend(&self.of[k].components);
            named.push(Named { hypothesis: k, score, beside, alike });
        }
        let excess = scores.excess(EXCESS);
        let together: f64 = named.iter().map(|n| n.score.drop).sum();
        let explained = excess.map(|excess| (together / excess).min(1.0));
        let mut rest: Vec<Named> = (0..self.of.len())
            .filter(|k| named.iter().all(|n| n.hypothesis != *k))
            .filter_map(|k| {
                let score = alone[k].clone().filter(|s| s.p < limit)?;
                Some(Named { hypothesis: k, score, beside: false, alike: self.alike(scores, &alone, k) })
            })
            .collect();
        rest.sort_by(|a, b| worth(&b.score).total_cmp(&worth(&a.score)));
        named.extend(rest);
        let by_itself = |(k, score): (usize, &Option<Score>)| {
            let score = score.clone()?;
            Some(Named { hypothesis: k, score, beside: false, alike: self.alike(scores, &alone, k) })
        };
        let mut every: Vec<Named> = alone.iter().enumerate().filter_map(by_itself).collect();
        for n in named.iter_mut().chain(&mut every) {
            n.hypothesis = self.of[n.hypothesis].hypothesis;
            n.alike.iter_mut().for_each(|k| *k = self.of[*k].hypothesis);
        }
        Ranking { tested, independent, named, explained, excess, alone: every }
    }
    fn alike(&self, scores: &Scores, alone: &[Option<Score>], k: usize) -> Vec<usize> {
        let Some(own) = &alone[k] else { return Vec::new() };
        let others = alone.iter().enumerate().filter(|(i, _)| *i != k);
        let like = others.filter(|(i, s)| {
            s.as_ref().is_some_and(|s| {
                scores.correlation((&self.of[k].components, own), (&self.of[*i].components, s)).abs() > ALIKE
            })
        });
        like.map(|(i, _)| i).collect()
    }
}
