//! Which terms the joints have, chosen by data that were not fitted.
//!
//! The samples are cut into blocks. Each block is predicted by a fit of the others, with and without a term; a term is taken where it
//! lowers the squared error of its joint by the part [`GAIN`] and by more than [`BORNE_OUT`] standard errors over the blocks, the one that lowers it most first. Held-out blocks judge
//! what residuals do not: those of friction, elasticity and filters are coloured, so that criteria that count samples as independent take
//! every term. While terms are tried, the bodies stay as the fit of the other blocks has them and the friction of the joint is fitted
//! anew; all terms that were taken are judged again with the bodies fitted beside them.

use super::calibration::Ground;
use super::currents;
use super::equations::Group;
use super::joint_terms::JointTerm;
use super::problem::Problem;
use crate::solve::linear::{LinearError, Weights};
use ff_least_squares::Triangle;
use ff_linalg as linalg;
use ff_records::Record;
use nalgebra::{DMatrix, DVector};

/// Blocks that all samples are cut into, about.
const BLOCKS: usize = 6;
/// Fewest samples of a block.
const SHORTEST: usize = 50;
/// Part of the squared error of a joint that a term has to take away.
const GAIN: f64 = 0.1;
/// Mean over standard error of what it takes away of the blocks, at least: no single block may speak for it.
const BORNE_OUT: f64 = 2.5;
/// Most terms of a joint beside viscous and Coulomb friction and offset.
const TERMS: usize = 3;
/// Rates of the Stribeck effect that are tried, in parts of the fastest rate of the joint.
const STRIBECK: [f64; 3] = [0.01, 0.03, 0.1];

/// A term that was taken.
#[derive(Clone, Debug, PartialEq)]
pub struct TermChoice {
    /// Which joint.
    pub joint: usize,
    /// Which term.
    pub term: JointTerm,
    /// Squared error of the blocks that were not fitted, with the term over without it.
    pub ratio: f64,
}

/// A candidate by its number among the terms of the layout.
#[derive(Clone, Copy)]
pub(super) struct Candidate {
    column: usize,
    joint: usize,
    term: JointTerm,
}

impl Ground<'_> {
    /// Terms of the joints that the records bear out, for [`Ground::terms`], and how much each takes away; none where the records are
    /// too short to be cut into blocks. Allocates.
    ///
    /// # Errors
    /// [`LinearError`].
    pub fn choose_terms(
        &self,
        records: &[&Record],
        selected: &[usize],
        start: &[f64],
    ) -> Result<(Vec<Vec<JointTerm>>, Vec<TermChoice>), LinearError> {
        let bare = Ground { terms: Vec::new(), ..self.clone() };
        let groups = bare.checked(records, selected, start)?;
        let nj = self.model.nj();
        let none = (vec![Vec::new(); nj], Vec::new());
        let samples: usize = groups.iter().map(Group::samples).sum();
        if samples < BLOCKS * SHORTEST || !self.friction.coulomb {
            return Ok(none);
        }
        let of = currents(records, nj)?;
        let own = bare.all_terms();
        let problem = Problem::new(&bare, &groups, of.clone(), (selected, start), own.clone());
        let base = problem.solve(&problem.triangles(&groups, start)?, &self.weights)?;
        let mut terms = own.clone();
        let mut candidates = Vec::new();
        for j in 0..nj {
            let fastest = groups.iter().map(|g| g.fastest(j)).fold(0.0, f64::max);
            let mut tried =
                vec![JointTerm::ReflectedInertia, JointTerm::Asymmetry, JointTerm::Quadratic, JointTerm::Load];
            tried.extend(STRIBECK.map(|part| JointTerm::Stribeck { rate: rounded(part * fastest) }));
            for term in tried.into_iter().filter(|_| fastest > 0.0) {
                candidates.push(Candidate { column: terms.len(), joint: j, term });
                terms.push((j, term));
            }
        }
        let all = Problem::new(&bare, &groups, of, (selected, start), terms);
        // Gains as the fit of all has them: what is compared is torques.
        let blocks = cut(&all, &groups, &base.fit.values, &base.joints.gains)?;
        let folds = Folds { problem: &all, blocks: &blocks, own: own.len() };
        let weights = Weights::FromResiduals(2);
        let bodies = folds.fits(&[], &weights)?;
        let mut taken: Vec<Candidate> = Vec::new();
        for j in 0..nj {
            let of: Vec<Candidate> = candidates.iter().copied().filter(|c| c.joint == j).collect();
            taken.extend(folds.of_joint(j, &of, &bodies)?);
        }
        if taken.is_empty() {
            return Ok(none);
        }
        // Judged again with the bodies fitted beside them.
        let with = folds.fits(&taken, &weights)?;
        let mut out = none;
        for j in 0..nj {
            let of: Vec<&Candidate> = taken.iter().filter(|c| c.joint == j).collect();
            let (before, after) = (folds.errors(j, &bodies), folds.errors(j, &with));
            let ratio = after.iter().sum::<f64>() / before.iter().sum::<f64>().max(f64::MIN_POSITIVE);
            if !of.is_empty() && borne_out(&before, &after, (GAIN, BORNE_OUT)) {
                out.0[j] = of.iter().map(|c| c.term).collect();
                out.1.extend(of.iter().map(|c| TermChoice { joint: j, term: c.term, ratio }));
            }
        }
        Ok(out)
    }
}

/// Triangles of every joint, block by block of all samples, in N m by these gains; `load` are the parameters by which the load of a gear is
/// told. None where there are too few samples.
pub(super) fn cut(
    problem: &Problem<'_>,
    groups: &[Group],
    load: &[f64],
    gains: &[Option<f64>],
) -> Result<Vec<Vec<Triangle>>, LinearError> {
    let samples: usize = groups.iter().map(Group::samples).sum();
    let mut blocks = Vec::new();
    if samples < BLOCKS * SHORTEST {
        return Ok(blocks);
    }
    for g in groups {
        let n = g.samples();
        let count = ((BLOCKS * n) as f64 / samples as f64).round().clamp(2.0, BLOCKS as f64) as usize;
        let cuts: Vec<_> = (0..count).map(|k| k * n / count..(k + 1) * n / count).collect();
        let about = (problem.selected, problem.start, load);
        for found in g.triangles(problem.ground, &problem.layout, about, &cuts)? {
            let linear = found.iter().enumerate().map(|(j, t)| problem.linear(j, t, gains, &|_| true));
            blocks.push(linear.collect::<Result<Vec<_>, _>>()?);
        }
    }
    Ok(blocks)
}

/// Whether the squared errors of the blocks fall by this part at least, and in the mean by so many standard errors over the blocks.
pub(super) fn borne_out(before: &[f64], after: &[f64], (part, errors): (f64, f64)) -> bool {
    let n = before.len() as f64;
    let less: Vec<f64> = before.iter().zip(after).map(|(b, a)| b - a).collect();
    let mean = less.iter().sum::<f64>() / n;
    let variance = less.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    n * mean > part * before.iter().sum::<f64>() && mean > errors * (variance / n).sqrt()
}

/// Two significant digits, so that names and results stay readable.
fn rounded(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

/// Blocks of samples, each predicted by the others.
pub(super) struct Folds<'a> {
    pub(super) problem: &'a Problem<'a>,
    /// Triangles of every joint, block by block.
    pub(super) blocks: &'a [Vec<Triangle>],
    /// Number of the terms that every joint has; candidates come behind them.
    pub(super) own: usize,
}

impl Folds<'_> {
    /// Unknowns (parameters, then all terms, zero for those that are neither every joint's nor among the candidates) as all blocks but one
    /// tell them, for each.
    pub(super) fn fits(&self, with: &[Candidate], weights: &Weights) -> Result<Vec<Vec<f64>>, LinearError> {
        let m = self.problem.selected.len();
        let kept: Vec<usize> = (0..self.own).chain(with.iter().map(|c| c.column)).collect();
        let terms: Vec<_> = kept.iter().map(|&c| self.problem.layout.terms[c]).collect();
        let joints = self.problem.currents.len();
        let mut out = Vec::new();
        for left_out in 0..self.blocks.len() {
            let mut triangles = Vec::with_capacity(joints);
            for j in 0..joints {
                let others = self.blocks.iter().enumerate().filter(|(b, _)| *b != left_out);
                let mut parts = Vec::new();
                for (_, block) in others {
                    let mut t = super::gains::with_columns(&block[j], |c| c < m || kept.contains(&(c - m)))?;
                    for c in t.columns.iter_mut().filter(|c| **c >= m) {
                        let place = kept.iter().position(|k| k + m == *c).unwrap_or_default();
                        *c = m + place;
                    }
                    parts.push(t);
                }
                triangles.push(super::gains::joined(parts)?);
            }
            let fit = self.problem.plain(&terms, &triangles, weights)?;
            let mut x = vec![0.0; m + self.problem.layout.terms.len()];
            x[..m].copy_from_slice(&fit[..m]);
            kept.iter().zip(&fit[m..]).for_each(|(&c, v)| x[m + c] = *v);
            out.push(x);
        }
        Ok(out)
    }
    /// Squared error of a joint in every block, by the fit of the others.
    fn errors(&self, j: usize, fits: &[Vec<f64>]) -> Vec<f64> {
        self.blocks.iter().zip(fits).map(|(b, x)| b[j].cost(x)).collect()
    }
    /// Terms of one joint, the bodies as they are.
    fn of_joint(&self, j: usize, all: &[Candidate], bodies: &[Vec<f64>]) -> Result<Vec<Candidate>, LinearError> {
        let m = self.problem.selected.len();
        let own: Vec<usize> = (0..self.own).filter(|&c| self.problem.layout.terms[c].0 == j).collect();
        let mut taken: Vec<Candidate> = Vec::new();
        let mut best = self.refitted(j, &own, m, bodies)?.0;
        while taken.len() < TERMS {
            let mut found: Option<(Candidate, Vec<f64>)> = None;
            for c in all {
                // One Stribeck effect, and no term twice.
                let same = |t: &Candidate| core::mem::discriminant(&t.term) == core::mem::discriminant(&c.term);
                if taken.iter().any(same) {
                    continue;
                }
                let columns: Vec<usize> =
                    own.iter().copied().chain(taken.iter().map(|t| t.column)).chain([c.column]).collect();
                let (errors, least) = self.refitted(j, &columns, m, bodies)?;
                // Neither an inertia nor friction in proportion to a load is negative.
                if matches!(c.term, JointTerm::ReflectedInertia | JointTerm::Load) && least < 0.0 {
                    continue;
                }
                let sum = |e: &[f64]| e.iter().sum::<f64>();
                if found.as_ref().is_none_or(|f| sum(&errors) < sum(&f.1)) {
                    found = Some((*c, errors));
                }
            }
            let Some((c, errors)) = found else { break };
            if !borne_out(&best, &errors, (GAIN, BORNE_OUT)) {
                break;
            }
            taken.push(c);
            best = errors;
        }
        Ok(taken)
    }
    /// Squared errors of a joint in every block, its terms `columns` fitted to the others with the bodies as they are; and the least
    /// coefficient of the last term.
    fn refitted(
        &self,
        j: usize,
        columns: &[usize],
        m: usize,
        bodies: &[Vec<f64>],
    ) -> Result<(Vec<f64>, f64), LinearError> {
        let (mut out, mut least) = (Vec::with_capacity(self.blocks.len()), f64::INFINITY);
        for (left_out, x) in bodies.iter().enumerate() {
            // What is left of the joint with the bodies as they are, and the columns of its terms.
            let rows = |t: &Triangle| {
                let mut rest: DVector<f64> = t.r.column(t.columns.len()).into_owned();
                let mut a = DMatrix::zeros(t.r.nrows(), columns.len());
                for (k, &c) in t.columns.iter().enumerate() {
                    if c < m {
                        rest -= t.r.column(k) * x[c];
                    } else if let Some(to) = columns.iter().position(|w| m + w == c) {
                        a.set_column(to, &t.r.column(k));
                    }
                }
                (a, rest)
            };
            let others: Vec<_> =
                self.blocks.iter().enumerate().filter(|(b, _)| *b != left_out).map(|(_, b)| rows(&b[j])).collect();
            let n: usize = others.iter().map(|o| o.1.len()).sum();
            let (mut a, mut b) = (DMatrix::zeros(n, columns.len()), DVector::zeros(n));
            let mut at = 0;
            for (of, rest) in &others {
                a.rows_mut(at, of.nrows()).copy_from(of);
                b.rows_mut(at, rest.len()).copy_from(rest);
                at += rest.len();
            }
            // Columns that say the same leave the error as it is.
            let found = linalg::least_squares(&a, &b);
            let (of, rest) = rows(&self.blocks[left_out][j]);
            least = least.min(found.as_ref().map_or(f64::INFINITY, |x| x[x.len() - 1]));
            out.push(found.map_or(f64::INFINITY, |x| (rest - of * x).norm_squared()));
        }
        Ok((out, least))
    }
}
