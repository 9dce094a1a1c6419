//! What would explain a record? Score tests of errors that a fit has not estimated.
//!
//! At the end of a fit with whitened residuals r and columns B of its unknowns, an error with columns C changes the residuals by
//! `C e`. With P what projects off the columns of B, and `S = C^T P C`, `s = C^T P r`,
//!
//! ```text
//! e = -S^-1 s,   cov e = S^-1,   drop of chi-squared = s^T S^-1 s
//! ```
//!
//! which is chi-squared with as many degrees of freedom as C has columns if nothing is wrong (C. R. Rao, *Proc. Camb. Phil. Soc.* 44, 1948,
//! 50), without another fit: the unknowns of the fit move by `-B^+ C e`. B is folded into a triangle by Householder's reflections; of C
//! only products with B, r and itself are kept, so that memory does not grow with the rows.
//!
//! Noise of the encoders comes into the prediction through the joint motion and is in r besides the noise of the sensors. Given draws
//! n_m of what it does to the residuals, `cov s = S + mean (C^T P n_m)(C^T P n_m)^T` takes the place of S in the test. Of M draws, that is an
//! estimate of `M / rho^2` degrees of freedom, with rho their part of the variance along what is tested, and the statistic one of Hotelling's.
//!
//! The same noise is in the columns, which are those of the prediction: s has an expectation where nothing is wrong
//! ([`Scores::allow_for_noise_in_columns`]).

use crate::estimate::along;
use crate::estimate::estimator::Estimator;
use crate::estimate::row_stream::RowBlock;
use core::ops::Range;
use ff_least_squares::{EvalError, Tall, triangle_of};
use ff_linalg::LinalgError;
use ff_spectral::chi_square::{chi_square_survival, hotelling_survival};
use nalgebra::{DMatrix, DVector};

/// Part of the norm of a column that must be left behind the projection; below, the fit's unknowns can do what the error does.
const LEFT: f64 = 1e-5;
/// Smallest eigenvalue of normalised `S`, relative to the largest, of errors that can be told apart.
const APART: f64 = 1e-8;
/// Deviations of a normal variable that it exceeds in 5 %.
const SURE: f64 = 1.645;
/// Relative width of what holds unknowns that the data do not tell, in their sizes.
const HOLD: f64 = 1e6;

/// Part of what noise is found to give the sums `s` on average that it may be off by: a few draws tell it, and this noise was one of its own.
const ROUGHLY: f64 = 0.5;

/// A linear combination of columns: index of the column and weight.
pub type Combination = Vec<(usize, f64)>;

/// The column of a component of an error.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// What it is made of.
    pub columns: Combination,
    /// The rows that it has alone, those of one record; all unless given.
    pub rows: Option<Range<usize>>,
    /// Standard deviation of what is known of its size without the record, about none; infinite unless given.
    pub width: f64,
}

impl From<Combination> for Direction {
    fn from(columns: Combination) -> Self {
        Self { columns, rows: None, width: f64::INFINITY }
    }
}

/// Where a fit ended, and what its estimator differentiates by.
pub struct EndOfFit<'a> {
    /// All parameters.
    pub full: &'a [f64],
    /// Nuisance unknowns of the estimator.
    pub extra: &'a [f64],
    /// Parameters that have columns: those of the fit and those of errors.
    pub selected: &'a [usize],
    /// Unknowns that the fit has estimated, as columns (of `selected`, then nuisance), with their sizes.
    pub base: &'a [(Combination, f64)],
    /// Which of them are asked for: how far an error moves the others counts nothing.
    pub asked: &'a [usize],
    /// Whitened residuals of the fit, in the order of the rows; those that the estimator itself gives unless given.
    pub residuals: Option<&'a [f64]>,
    /// Rows of priors over the columns of the base, and their residuals.
    pub priors: (DMatrix<f64>, Vec<f64>),
}

/// Products of the columns of errors behind the projection.
#[derive(Clone, Debug)]
pub struct Scores {
    /// `S` over all components of all errors, and `S` before the projection (diagonal).
    s: DMatrix<f64>,
    size: Vec<f64>,
    /// `s`.
    slope: DVector<f64>,
    /// What noise of the motion adds to the covariance of `s`.
    noise: DMatrix<f64>,
    /// `R^-1 R^-T B^T C`: how the unknowns of the fit follow a unit of each component; their deviations.
    follow: DMatrix<f64>,
    deviation: Vec<f64>,
    asked: Vec<usize>,
    /// What draws of the motion's noise do to the residuals, rows x draws.
    drawn: DMatrix<f64>,
    /// `B^T N`: see [`Scores::drawn_over_unknowns`].
    over_unknowns: DMatrix<f64>,
    /// Squared residuals behind the projection, and rows less unknowns; what noise of the motion adds to the former.
    chi2: f64,
    freedom: usize,
    motion: f64,
}

/// What looking for an error costs in significance: the best of many is larger by chance than one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Searched {
    /// Numbers that were adjusted beside the components.
    pub freedom: usize,
    /// Places that were tried, as independent ones (Bonferroni).
    pub places: f64,
}

impl Default for Searched {
    fn default() -> Self {
        Self { freedom: 0, places: 1.0 }
    }
}

/// The test of one error.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// By how much chi-squared falls with it.
    pub drop: f64,
    /// Degrees of freedom.
    pub freedom: usize,
    /// How often such a drop would be met were nothing wrong, noise of the motion included.
    pub p: f64,
    /// `-ln p` of the drop alone, without noise of the motion, also where p is too small for a number: what errors are ranked by. A few
    /// draws of noise tell how likely a drop is, but not which of two large ones is larger.
    pub evidence: f64,
    /// Its components.
    pub estimate: Vec<f64>,
    /// Their standard deviations.
    pub std: Vec<f64>,
    /// Of the unknowns that are asked for, the one that moves most with it, and by how many of its deviations.
    pub moves: (usize, f64),
    /// By how many of its deviations one of them may move, at 95 %.
    pub may_move: f64,
}

fn fatal(e: LinalgError) -> EvalError {
    EvalError::Fatal(Box::new(e))
}

impl Score {
    /// The test of an error with one component that cannot be negative: the drop is 0 in half of all cases where nothing
    /// is wrong, and chi-squared with one degree of freedom in the others (S. Self, K.-Y. Liang, *J. Am. Stat. Assoc.* 82,
    /// 1987, 605). A negative estimate says nothing.
    pub(super) fn of_positive(self) -> Self {
        if self.estimate.iter().all(|e| *e > 0.0) {
            Self { p: 0.5 * self.p, evidence: self.evidence + core::f64::consts::LN_2, ..self }
        } else {
            Self { p: 1.0, evidence: 0.0, ..self }
        }
    }
}

/// The triangle of the columns of the base and the residuals, with the rows of priors below them, and the number of rows of the estimator. `each` is
/// called with every block and its columns of the base. Columns of the base are combinations of those `along` these directions.
pub(crate) fn folded(
    estimator: &mut dyn Estimator,
    at: &EndOfFit<'_>,
    along: &[along::Direction],
    each: &mut dyn FnMut(&RowBlock, &DMatrix<f64>),
) -> Result<(DMatrix<f64>, usize), EvalError> {
    let n = at.base.len();
    let (mut triangle, mut rows) = (DMatrix::zeros(0, n + 1), 0);
    let (mut block, mut base) = (RowBlock::default(), DMatrix::zeros(0, n + 1));
    for mut stream in estimator.streams_along(at.full, at.extra, along)? {
        while stream.next(&mut block)? {
            if let Some(of_fit) = at.residuals {
                let places: Vec<_> = block.places().collect();
                for (place, from) in places {
                    let count = place.len();
                    block.residuals[from..from + count].copy_from_slice(&of_fit[place]);
                }
            }
            rows += block.count();
            of_rows(&mut base, block.count());
            at.base.iter().enumerate().for_each(|(to, (all, _))| gather(&block, all, &mut base, to));
            base.column_mut(n).copy_from_slice(&block.residuals);
            each(&block, &base);
            let part = triangle_of(&Tall::new(&base)).map_err(fatal)?;
            triangle = ff_linalg::qr_r(&stack(&triangle, &part)).map_err(fatal)?;
        }
    }
    let (rows_known, known) = &at.priors;
    let mut tail = DMatrix::zeros(n + known.len(), n + 1);
    for (k, (_, size)) in at.base.iter().enumerate() {
        tail[(k, k)] = 1.0 / (HOLD * size);
    }
    tail.view_mut((n, 0), rows_known.shape()).copy_from(rows_known);
    tail.view_mut((n, n), (known.len(), 1)).copy_from_slice(known);
    Ok((ff_linalg::qr_r(&stack(&triangle, &tail)).map_err(fatal)?, rows))
}

/// Gives a buffer so many rows, of which every one is written anew; allocates where it has others.
fn of_rows(buffer: &mut DMatrix<f64>, rows: usize) {
    if buffer.nrows() != rows {
        *buffer = DMatrix::zeros(rows, buffer.ncols());
    }
}

/// Puts a combination of columns into one of `to`.
fn gather(block: &RowBlock, all: &[(usize, f64)], to: &mut DMatrix<f64>, column: usize) {
    let mut to = to.column_mut(column);
    if all.is_empty() {
        to.fill(0.0);
    }
    // What stood there before is not looked at.
    for (k, &(from, weight)) in all.iter().enumerate() {
        to.axpy(weight, &block.jacobian.column(from), if k == 0 { 0.0 } else { 1.0 });
    }
}

impl Scores {
    /// Goes through the rows of `estimator` once. `components` are the columns of the errors, in any order; `draws` what
    /// draws of the motion's noise do to the residuals, each the sum of its columns: one of every record. Allocates the square of the number of components, and
    /// the rows of the draws.
    ///
    /// # Errors
    /// [`EvalError`] of the estimator, or of a factorisation of columns that are not finite.
    pub fn new<E: Estimator + ?Sized>(
        mut estimator: &mut E,
        at: &EndOfFit<'_>,
        components: &[Direction],
        draws: &[Combination],
    ) -> Result<Self, EvalError> {
        Self::gathered(&mut estimator, at, components, draws)
    }
    /// Compiled once, here, and not for every estimator of every crate.
    fn gathered(
        estimator: &mut dyn Estimator,
        at: &EndOfFit<'_>,
        components: &[Direction],
        draws: &[Combination],
    ) -> Result<Self, EvalError> {
        let (n, c, m) = (at.base.len(), components.len(), draws.len());
        let mut cross = DMatrix::zeros(n, c + m);
        let mut own = DMatrix::zeros(c, c + m + 1);
        let mut drawn_rows = DMatrix::zeros(estimator.rows(), m);
        let left_out = estimator.left_out();
        let mut wide = DMatrix::zeros(0, c + m + 1);
        let along = along::Direction::of_columns(at.selected, at.full.len(), at.extra.len());
        let (triangle, rows) = folded(estimator, at, &along, &mut |block, base| {
            of_rows(&mut wide, block.count());
            // A block has rows of one record.
            let first = block.rows.first().map_or(0, |r| r.start);
            for (to, d) in components.iter().enumerate() {
                let has = d.rows.as_ref().is_none_or(|r| r.contains(&first));
                gather(block, if has { &d.columns } else { &[] }, &mut wide, to);
            }
            for (k, all) in draws.iter().enumerate() {
                gather(block, all, &mut wide, c + k);
                for (place, from) in block.places() {
                    let len = place.len();
                    drawn_rows.view_mut((place.start, k), (len, 1)).copy_from(&wide.view((from, c + k), (len, 1)));
                }
            }
            wide.column_mut(c + m).copy_from_slice(&block.residuals);
            // Products of transposed copies are blocked, those with transposes in place are not.
            cross.gemm(1.0, &base.columns(0, n).transpose(), &wide.columns(0, c + m), 1.0);
            own.gemm(1.0, &wide.columns(0, c).transpose(), &wide, 1.0);
        })?;
        for (k, d) in components.iter().enumerate() {
            own[(k, k)] += d.width.powi(-2);
        }
        let known = &at.priors.1;
        let r = triangle.view((0, 0), (n, n)).into_owned();
        let rest = triangle.column(n);
        let singular = || EvalError::Rejected("unknowns of the fit have no columns".into());
        let v = r.tr_solve_upper_triangular(&cross).ok_or_else(singular)?;
        let follow = r.solve_upper_triangular(&v.columns(0, c)).ok_or_else(singular)?;
        let inverse = r.solve_upper_triangular(&DMatrix::identity(n, n)).ok_or_else(singular)?;
        let deviation = inverse.row_iter().map(|row| row.norm()).collect();
        let (vc, vm) = (v.columns(0, c), v.columns(c, m));
        let s = own.columns(0, c) - vc.tr_mul(&vc);
        let size = (0..c).map(|i| own[(i, i)]).collect();
        let slope = own.column(c + m) - vc.tr_mul(&rest.rows(0, n));
        let drawn = own.columns(c, m) - vc.tr_mul(&vm);
        let noise = if m == 0 { DMatrix::zeros(c, c) } else { &drawn * drawn.transpose() / m as f64 };
        let over_unknowns = r.tr_mul(&vm);
        let chi2 = rest.rows(n, rest.len() - n).norm_squared();
        let motion = (drawn_rows.norm_squared() - vm.norm_squared()).max(0.0) / m.max(1) as f64;
        let freedom = (rows + known.len()).saturating_sub(n + left_out);
        let asked = at.asked.to_vec();
        Ok(Self {
            s,
            size,
            slope,
            noise,
            follow,
            deviation,
            asked,
            drawn: drawn_rows,
            over_unknowns,
            chi2,
            freedom,
            motion,
        })
    }
    /// The sums `s = C^T P r` of all components.
    pub fn sums(&self) -> &DVector<f64> {
        &self.slope
    }
    /// Takes off the sums `s` what noise of the motion gives them on average because it is in the columns and in the residuals alike (errors in
    /// variables): measured torques regressed on predicted ones with noise have a gain below one, and a mode that is driven by nothing but noise
    /// explains that noise. With as much noise again that is there twice (J. R. Cook, L. A. Stefanski, *J. Am. Stat. Assoc.* 89, 1994, 1314): from the
    /// sums `still` of the motion as it is and those with draws added to it and taken off it,
    ///
    /// ```text
    /// b = mean (s+ + s-) / 2 - still,   s - b,   cov s + (b / 2) (b / 2)^T
    /// ```
    ///
    /// The last term is for what a few draws do not tell of b. Without draws nothing changes.
    ///
    /// # Panics
    /// If sums are not as many as components.
    pub fn allow_for_noise_in_columns(&mut self, still: &DVector<f64>, shaken: &[[DVector<f64>; 2]]) {
        let mut bias = DVector::zeros(self.slope.len());
        for s in shaken.iter().flatten() {
            bias += (s - still) / (2 * shaken.len()) as f64;
        }
        self.slope -= &bias;
        bias *= ROUGHLY;
        self.noise.ger(1.0, &bias, &bias, 1.0);
    }
    /// Chi-squared that is left behind the projection, over the degrees of freedom.
    pub fn chi2_per_dof(&self) -> f64 {
        self.chi2 / self.freedom.max(1) as f64
    }
    /// What noise of the motion adds to [`Scores::chi2_per_dof`].
    pub fn motion_noise(&self) -> f64 {
        self.motion / self.freedom.max(1) as f64
    }
    /// Whether noise of the motion leaves so much in the residuals that a drop of chi-squared may be of it: no columns explain more of it than there is.
    pub fn may_be_motion_noise(&self, drop: f64) -> bool {
        drop < self.motion
    }
    /// What draws of the motion's noise do to the residuals: one column per draw.
    pub fn drawn(&self) -> &DMatrix<f64> {
        &self.drawn
    }
    /// `B^T N` for the columns B of the unknowns of the fit and those N of the draws.
    pub fn drawn_over_unknowns(&self) -> &DMatrix<f64> {
        &self.over_unknowns
    }
    /// Chi-squared and degrees of freedom behind the projection.
    pub fn chi2(&self) -> (f64, usize) {
        (self.chi2, self.freedom)
    }
    /// Chi-squared above its expectation, that of the motion's noise among it, where that is more than `deviations` of chance.
    pub fn excess(&self, deviations: f64) -> Option<f64> {
        let excess = self.chi2 - self.freedom as f64 - self.motion;
        let chance = (2.0 * self.freedom as f64 + 4.0 * self.motion).sqrt();
        (excess > deviations * chance).then_some(excess)
    }
    /// Covariance of the sums `s` of all components, noise of the motion included.
    pub(super) fn of_sums(&self) -> DMatrix<f64> {
        &self.s + &self.noise
    }
    /// The test of the error with these components, behind others that are taken for granted; `None` where the data cannot tell it
    /// from the unknowns of the fit, or from those. Allocates.
    pub fn test(&self, of: &[usize], given: &[usize]) -> Option<Score> {
        self.test_searched(of, given, Searched::default())
    }
    /// [`Scores::test`] of components that were looked for: `p` is that of as many more degrees of freedom, times the number of places.
    pub fn test_searched(&self, of: &[usize], given: &[usize], searched: Searched) -> Option<Score> {
        if of.iter().any(|i| given.contains(i)) {
            return None;
        }
        let all: Vec<usize> = given.iter().chain(of).copied().collect();
        let scale: Vec<f64> = all.iter().map(|&i| self.size[i].sqrt()).collect();
        if scale.iter().any(|&x| !(x > 0.0 && x.is_finite())) {
            return None;
        }
        let pick = |m: &DMatrix<f64>| {
            DMatrix::from_fn(all.len(), all.len(), |a, b| m[(all[a], all[b])] / (scale[a] * scale[b]))
        };
        let (mut s, mut noise) = (pick(&self.s), pick(&self.noise));
        let mut slope = DVector::from_fn(all.len(), |a, _| self.slope[all[a]] / scale[a]);
        let g = given.len();
        if g > 0 {
            let solve = usable(&s.view((0, 0), (g, g)).into_owned())?;
            let across = s.view((0, g), (g, of.len())).into_owned();
            let weights = &solve * &across;
            let rest = s.view((g, g), (of.len(), of.len())).into_owned();
            // What is left of the errors behind the given ones: C_of - C_given W.
            let mut turn = DMatrix::zeros(of.len(), all.len());
            turn.columns_mut(0, g).copy_from(&-weights.transpose());
            turn.columns_mut(g, of.len()).fill_with_identity();
            slope = &turn * slope;
            noise = &turn * noise * turn.transpose();
            s = rest - across.tr_mul(&weights);
        }
        if (0..of.len()).any(|i| s[(i, i)] < LEFT * LEFT) {
            return None;
        }
        let inverse = usable(&s)?;
        noise += unseen(&s, &noise, self.drawn.ncols());
        let with_noise = usable(&(&s + &noise))?;
        let e = -(&inverse * &slope);
        let weights = &with_noise * &slope;
        let tested = slope.dot(&weights);
        // Noise of the motion is known by its draws, and by fewer of them counts for less the smaller a part it is of what is tested.
        let drawn = (weights.transpose() * &noise * &weights)[0] / tested;
        let known_by = if drawn > 0.0 { self.drawn.ncols() as f64 / drawn.powi(2) } else { f64::INFINITY };
        let covariance = &inverse * (&s + &noise) * &inverse;
        let scale = &scale[g..];
        let estimate: Vec<f64> = e.iter().zip(scale).map(|(e, s)| e / s).collect();
        let std = (0..of.len()).map(|i| covariance[(i, i)].max(0.0).sqrt() / scale[i]).collect();
        let (mut moves, mut may_move) = ((0, 0.0), 0.0f64);
        for &k in &self.asked {
            let deviation = self.deviation[k];
            let slope = DVector::from_fn(of.len(), |a, _| self.follow[(k, of[a])] / (scale[a] * deviation));
            let by = slope.dot(&e).abs();
            if by > moves.1 {
                moves = (k, by);
            }
            may_move = may_move.max(by + SURE * (slope.transpose() * &covariance * &slope)[0].max(0.0).sqrt());
        }
        let drop = (slope.transpose() * &inverse * &slope)[0];
        let freedom = of.len() + searched.freedom;
        let p = (hotelling_survival(tested, freedom as f64, known_by) * searched.places).min(1.0);
        let evidence = evidence(drop, freedom) - searched.places.ln();
        Some(Score { drop, freedom, p, evidence, estimate, std, moves, may_move })
    }
    /// By how many deviations an error of these components, of this size each, would move the unknown that is asked for and moves most if
    /// the fit took it for none, and which that is; `None` where none is asked for.
    pub fn shift(&self, of: &[usize], size: &[f64]) -> Option<(usize, f64)> {
        let by = |k: usize| of.iter().zip(size).map(|(&i, x)| (self.follow[(k, i)] * x).powi(2)).sum::<f64>().sqrt();
        self.asked.iter().map(|&k| (k, by(k) / self.deviation[k])).max_by(|a, b| a.1.total_cmp(&b.1))
    }
    /// How these components hang together behind the projection: their covariance when they alone are estimated, noise of the motion
    /// left out; `None` where they cannot be told apart.
    pub fn covariance(&self, of: &[usize]) -> Option<DMatrix<f64>> {
        usable(&DMatrix::from_fn(of.len(), of.len(), |a, b| self.s[(of[a], of[b])]))
    }
    /// Correlation of what two errors do to the residuals behind the projection, each in the direction that was estimated: one where
    /// the data cannot tell them apart.
    pub fn correlation(&self, (a, x): (&[usize], &Score), (b, y): (&[usize], &Score)) -> f64 {
        let product = |a: &[usize], x: &[f64], b: &[usize], y: &[f64]| -> f64 {
            let row = |i: usize| b.iter().zip(y).map(|(&j, y)| self.s[(i, j)] * y).sum::<f64>();
            a.iter().zip(x).map(|(&i, x)| x * row(i)).sum()
        };
        let (x, y) = (&x.estimate[..], &y.estimate[..]);
        product(a, x, b, y) / (product(a, x, a, x) * product(b, y, b, y)).sqrt()
    }
}

/// What so many draws leave out of the covariance of noise in k directions, of which they leave more the fewer they are for each: the part k / draws of
/// what it is on average, as a multiple of `s` (with l the eigenvalues of `s^-1 noise`, the geometric mean of `1 + l` less one). Directions that chance
/// has left without noise would be those that a test finds.
fn unseen(s: &DMatrix<f64>, noise: &DMatrix<f64>, draws: usize) -> DMatrix<f64> {
    let k = s.nrows();
    let of = |m: DMatrix<f64>| m.cholesky().map(|c| c.ln_determinant());
    let mean = match (of(s + noise), of(s.clone())) {
        (Some(with), Some(without)) if draws > 0 => ((with - without) / k as f64).exp_m1(),
        _ => 0.0,
    };
    s * (mean.max(0.0) * (k as f64 / draws.max(1) as f64).min(1.0))
}

/// `-ln p` of chi-squared x with k degrees of freedom; beyond what p can hold `x/2 - (k/2 - 1) ln(x/2) + ln Gamma(k/2)`.
pub fn evidence(x: f64, k: usize) -> f64 {
    let p = chi_square_survival(x, k as f64);
    if p > 1e-280 {
        return -p.ln();
    }
    let half = 0.5 * k as f64;
    let (mut a, mut ln_gamma) = if k.is_multiple_of(2) { (1.0, 0.0) } else { (0.5, 0.5 * core::f64::consts::PI.ln()) };
    while a < half {
        ln_gamma += f64::ln(a);
        a += 1.0;
    }
    0.5 * x - (half - 1.0) * (0.5 * x).ln() + ln_gamma
}

/// The rows of two matrices, one below the other.
fn stack(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(a.nrows() + b.nrows(), b.ncols());
    out.rows_mut(0, a.nrows()).copy_from(a);
    out.rows_mut(a.nrows(), b.nrows()).copy_from(b);
    out
}

/// The inverse of a symmetric matrix whose eigenvalues can be told from zero.
pub(super) fn usable(s: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    if s.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let d: Vec<f64> = (0..s.nrows()).map(|i| s[(i, i)].sqrt()).collect();
    if d.iter().any(|&x| x <= 0.0 || x.is_nan()) {
        return None;
    }
    let unit = DMatrix::from_fn(s.nrows(), s.nrows(), |i, j| s[(i, j)] / (d[i] * d[j]));
    let e = unit.symmetric_eigen();
    let (least, most) = (e.eigenvalues.min(), e.eigenvalues.max());
    if least <= APART * most || least.is_nan() {
        return None;
    }
    let inverse =
        &e.eigenvectors * DMatrix::from_diagonal(&e.eigenvalues.map(|x| 1.0 / x)) * e.eigenvectors.transpose();
    Some(DMatrix::from_fn(s.nrows(), s.nrows(), |i, j| inverse[(i, j)] / (d[i] * d[j])))
}
