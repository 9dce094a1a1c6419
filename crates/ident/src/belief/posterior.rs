//! One identification after another: what the first has learnt is what the next knows beforehand.
//!
//! A [`Posterior`] is a Gaussian over named parameters, kept as whitened rows `W (p - mean)`: `W^T W` is the information matrix,
//! and its inverse the covariance. Rows can say that nothing is known of a direction, which a covariance cannot; that is the
//! rule for panels, of which three inertia transfers per hinge are never seen. As residuals of the next fit ([`PosteriorRows`],
//! the shape of [`crate::belief::prior::Priors`]) they are what the record before would have added to the cost near its minimum, so that
//! two records in sequence give what both give at once as far as the model is linear between their estimates, in coordinates in which
//! factors common to masses, stiffnesses and gains are.
//!
//! Parameters that are of no interest are projected out of the rows, `W <- (1 - U U^T) W` with `U` spanning their columns: the
//! exact marginal, also where they are not determined. Between two identifications something may have changed: [`loosen`]
//! adds a random step to what may have moved, [`forget`] all knowledge of it. [`change`] gives what a grasp has added.
//! `docs/theory/linear-estimators.md`, section on sequences.
//!
//! [`loosen`]: Posterior::loosen
//! [`forget`]: Posterior::forget

use crate::belief::covariance::Uncertainty;
use crate::belief::scaling::ScaleCoordinates;
use crate::estimate::outcome::{Estimate, RANK_TOLERANCE};
use crate::solve::linear::LinearEstimate;
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use ff_model::ParamDecl;
use ff_model::tree::{SelectionError, select};
use nalgebra::{DMatrix, DVector};

/// Why a posterior cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SequenceError {
    /// A pattern matches nothing.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// None of its parameters is estimated now.
    #[error("the posterior knows {known:?}, none of which is estimated now; select one of them, or leave it out")]
    Disjoint {
        /// First names of the posterior.
        known: Vec<String>,
    },
    /// The same name with another unit.
    #[error("'{name}' has unit {then} in the posterior and {now} in the model; they are different quantities")]
    Unit {
        /// The parameter.
        name: String,
        /// In the posterior.
        then: String,
        /// In the model.
        now: String,
    },
    /// Shapes or numbers that no posterior has.
    #[error("not a posterior: {0}")]
    Shape(String),
    /// A width that is not positive and finite.
    #[error("standard deviation {value} of the change of '{pattern}' must be positive and finite")]
    Width {
        /// The pattern.
        pattern: String,
        /// The width.
        value: f64,
    },
    /// A factorisation refused its input.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// A Gaussian over named parameters.
///
/// ```
/// use ident::Posterior;
/// use nalgebra::DMatrix;
///
/// let covariance = DMatrix::from_row_slice(2, 2, &[0.04, 0.018, 0.018, 0.09]);
/// let names = vec!["base.mass".into(), "base.h_x".into()];
/// let posterior = Posterior::from_covariance(names, vec!["kg".into(), "kg m".into()], vec![612.5, -3.2], &covariance)?;
/// // As JSON, for the next identification.
/// let back: Posterior = serde_json::from_str(&serde_json::to_string(&posterior)?)?;
/// assert_eq!(back, posterior);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Posterior {
    /// Full names.
    pub names: Vec<String>,
    /// SI units.
    pub units: Vec<String>,
    /// Sizes: what a relative change of 1 means, for rank decisions.
    pub sizes: Vec<f64>,
    /// Means, in these units.
    pub mean: Vec<f64>,
    /// Whitened rows: `rows (p - mean)` are standard normal. One inner vector per row; as many as directions are known.
    pub rows: Vec<Vec<f64>>,
}

impl Posterior {
    /// Of a fit with all that went into it, priors included; biases and other nuisance unknowns are projected out.
    ///
    /// # Errors
    /// [`SequenceError::Linalg`].
    pub fn of(estimate: &Estimate) -> Result<Self, SequenceError> {
        let known = estimate.parameters.iter().chain(&estimate.nuisance).map(|p| p.value).collect();
        let all = Self::from_uncertainty(&estimate.uncertainty, known)?;
        all.marginal_of(&(0..estimate.parameters.len()).collect::<Vec<_>>())
    }
    /// Of a linear fit; friction and other unknowns besides the parameters of the model are kept.
    ///
    /// # Errors
    /// [`SequenceError::Linalg`].
    pub fn of_linear(estimate: &LinearEstimate) -> Result<Self, SequenceError> {
        let known = estimate.parameters.iter().chain(&estimate.extra).map(|p| p.value).collect();
        Self::from_uncertainty(&estimate.uncertainty, known)
    }
    fn from_uncertainty(u: &Uncertainty, mean: Vec<f64>) -> Result<Self, SequenceError> {
        // J diag(s) = U diag(w) V^T: the rows are diag(w) V^T diag(1/s) on the directions that are determined.
        let row = |k: usize| {
            let of = |i: usize| u.singular_values[k] * u.directions[(i, k)] / u.unknowns[i].size;
            (0..u.unknowns.len()).map(of).collect()
        };
        Self {
            names: u.unknowns.iter().map(|u| u.name.clone()).collect(),
            units: u.unknowns.iter().map(|u| u.unit.clone()).collect(),
            sizes: u.unknowns.iter().map(|u| u.size).collect(),
            mean,
            rows: (0..u.rank).map(row).collect(),
        }
        .checked()
    }
    /// From a mean and a full covariance.
    ///
    /// # Errors
    /// [`SequenceError::Shape`] if the covariance is not symmetric positive definite.
    pub fn from_covariance(
        names: Vec<String>,
        units: Vec<String>,
        mean: Vec<f64>,
        covariance: &DMatrix<f64>,
    ) -> Result<Self, SequenceError> {
        let n = names.len();
        if covariance.shape() != (n, n) {
            return Err(SequenceError::Shape(format!("covariance {:?} of {n} parameters", covariance.shape())));
        }
        linalg::check_finite("covariance", covariance)?;
        let scale = DVector::from_fn(n, |i, _| covariance[(i, i)].max(f64::MIN_POSITIVE).sqrt());
        let scaled = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
        let indefinite = || SequenceError::Shape("the covariance is not positive definite".into());
        let l = scaled.cholesky().ok_or_else(indefinite)?.l();
        let inverse = l.solve_lower_triangular(&DMatrix::identity(n, n)).ok_or_else(indefinite)?;
        let row = |k: usize| (0..n).map(|i| inverse[(k, i)] / scale[i]).collect();
        let sizes = mean.iter().zip(scale.iter()).map(|(m, s)| if *m == 0.0 { *s } else { m.abs() }).collect();
        Self { names, units, sizes, mean, rows: (0..n).map(row).collect() }.checked()
    }
    /// Refuses what a file might hold and no posterior has; readers of files call it. Returns itself.
    ///
    /// # Errors
    /// [`SequenceError::Shape`].
    pub fn checked(self) -> Result<Self, SequenceError> {
        let n = self.names.len();
        let bad = |what: String| Err(SequenceError::Shape(what));
        if n == 0 || self.units.len() != n || self.sizes.len() != n || self.mean.len() != n {
            return bad(format!(
                "{n} names, {} units, {} sizes, {} means; there must be as many of each, and one at least",
                self.units.len(),
                self.sizes.len(),
                self.mean.len()
            ));
        }
        if let Some(k) = self.rows.iter().position(|r| r.len() != n) {
            return bad(format!("row {k} has {} numbers for {n} parameters", self.rows[k].len()));
        }
        if let Some(i) = (1..n).find(|&i| self.names[..i].contains(&self.names[i])) {
            return bad(format!("'{}' is named twice", self.names[i]));
        }
        let numbers = self.mean.iter().chain(&self.sizes).chain(self.rows.iter().flatten());
        if numbers.into_iter().any(|x| !x.is_finite()) || self.sizes.iter().any(|s| *s <= 0.0) {
            return bad("a number is not finite, or a size not positive".into());
        }
        Ok(self)
    }
    /// Number of parameters.
    pub fn len(&self) -> usize {
        self.names.len()
    }
    /// True without parameters.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }
    fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows.len(), self.len(), |i, j| self.rows[i][j])
    }
    /// Information matrix `W^T W`, n x n. Allocates.
    pub fn information(&self) -> DMatrix<f64> {
        let w = self.matrix();
        w.transpose() * w
    }
    /// Covariance, n x n; `None` when some direction is not known at all. Allocates.
    ///
    /// # Errors
    /// [`SequenceError::Linalg`].
    pub fn covariance(&self) -> Result<Option<DMatrix<f64>>, SequenceError> {
        let (n, w) = (self.len(), self.scaled());
        if w.nrows() < n {
            return Ok(None);
        }
        let d = linalg::svd(&w)?;
        if d.rank(RANK_TOLERANCE) < n {
            return Ok(None);
        }
        let mut half = d.v;
        for k in 0..n {
            half.column_mut(k).unscale_mut(d.s[k]);
        }
        for (i, s) in self.sizes.iter().enumerate() {
            half.row_mut(i).scale_mut(*s);
        }
        Ok(Some(&half * half.transpose()))
    }
    /// `W diag(sizes)`.
    fn scaled(&self) -> DMatrix<f64> {
        let mut w = self.matrix();
        self.sizes.iter().enumerate().for_each(|(k, s)| w.column_mut(k).scale_mut(*s));
        w
    }
    fn matching(&self, patterns: &[&str]) -> Result<Vec<usize>, SequenceError> {
        let decls: Vec<ParamDecl> = self.names.iter().map(|n| ParamDecl::positive(n.clone(), "1", 1.0)).collect();
        Ok(select(&decls, patterns)?)
    }
    /// What is known of the parameters that the patterns match, whatever the others are. Allocates.
    ///
    /// # Errors
    /// [`SequenceError::Selection`], [`SequenceError::Linalg`].
    pub fn marginal(&self, patterns: &[&str]) -> Result<Self, SequenceError> {
        self.marginal_of(&self.matching(patterns)?)
    }
    /// All parameters are kept, but nothing is known any more of those that the patterns match. Allocates.
    ///
    /// # Errors
    /// [`SequenceError::Selection`], [`SequenceError::Linalg`].
    pub fn forget(&self, patterns: &[&str]) -> Result<Self, SequenceError> {
        let gone = self.matching(patterns)?;
        let kept: Vec<usize> = (0..self.len()).filter(|i| !gone.contains(i)).collect();
        let mut out = self.clone();
        out.rows.clear();
        if kept.is_empty() {
            return Ok(out);
        }
        for row in self.marginal_of(&kept)?.rows {
            let mut wide = vec![0.0; self.len()];
            kept.iter().zip(row).for_each(|(&k, x)| wide[k] = x);
            out.rows.push(wide);
        }
        Ok(out)
    }
    /// Every parameter that the patterns match may have moved by a random step of standard deviation `sigma` (in its unit) since:
    /// adds `sigma^2` to its variance. Allocates.
    ///
    /// # Errors
    /// [`SequenceError::Width`], [`SequenceError::Selection`], [`SequenceError::Linalg`].
    pub fn loosen(&self, patterns: &[&str], sigma: f64) -> Result<Self, SequenceError> {
        if !(sigma.is_finite() && sigma > 0.0) {
            return Err(SequenceError::Width { pattern: patterns.join(", "), value: sigma });
        }
        let moved = self.matching(patterns)?;
        // Unknowns [p now | p then]: what was known of p then, and the step between them.
        let n = self.len();
        let mut joint = self.clone();
        for &i in &moved {
            joint.names.push(format!("{} then", self.names[i]));
            joint.units.push(self.units[i].clone());
            joint.sizes.push(self.sizes[i]);
            joint.mean.push(self.mean[i]);
        }
        for row in &mut joint.rows {
            row.resize(n + moved.len(), 0.0);
            for (k, &i) in moved.iter().enumerate() {
                row[n + k] = std::mem::take(&mut row[i]);
            }
        }
        for (k, &i) in moved.iter().enumerate() {
            let mut step = vec![0.0; n + moved.len()];
            (step[i], step[n + k]) = (1.0 / sigma, -1.0 / sigma);
            joint.rows.push(step);
        }
        joint.marginal_of(&(0..n).collect::<Vec<_>>())
    }
    fn marginal_of(&self, kept: &[usize]) -> Result<Self, SequenceError> {
        let pick = |v: &[String]| kept.iter().map(|&i| v[i].clone()).collect();
        let numbers = |v: &[f64]| -> Vec<f64> { kept.iter().map(|&i| v[i]).collect() };
        let w = self.scaled();
        let gone: Vec<usize> = (0..self.len()).filter(|i| !kept.contains(i)).collect();
        let mut own = DMatrix::from_fn(w.nrows(), kept.len(), |i, j| w[(i, kept[j])]);
        if !gone.is_empty() && w.nrows() > 0 {
            let others = DMatrix::from_fn(w.nrows(), gone.len(), |i, j| w[(i, gone[j])]);
            let d = linalg::svd(&others)?;
            let u = d.u.columns(0, d.rank(RANK_TOLERANCE)).into_owned();
            own -= &u * (u.transpose() * &own);
        }
        // As many rows as directions are known.
        let rows = if own.nrows() == 0 {
            vec![]
        } else {
            let d = linalg::svd(&own)?;
            let row = |k: usize| (0..kept.len()).map(|i| d.s[k] * d.v[(i, k)] / self.sizes[kept[i]]).collect();
            // Against the strongest direction of all: what the projection left of one that it removed is rounding.
            let limit = RANK_TOLERANCE * linalg::singular_values(&w)?.first().copied().unwrap_or(0.0);
            (0..d.s.len()).filter(|&k| d.s[k] > limit).map(row).collect()
        };
        Ok(Self {
            names: pick(&self.names),
            units: pick(&self.units),
            sizes: numbers(&self.sizes),
            mean: numbers(&self.mean),
            rows,
        })
    }
    /// As residual rows of a fit of `selected`. Parameters of the posterior that are not selected now are projected out: what
    /// they are held at now says nothing about what they were then. Allocates.
    ///
    /// # Errors
    /// [`SequenceError::Disjoint`], [`SequenceError::Unit`], [`SequenceError::Linalg`].
    pub fn rows_for(&self, decls: &[ParamDecl], selected: &[usize]) -> Result<PosteriorRows, SequenceError> {
        let mut kept = Vec::new();
        let mut columns = Vec::new();
        for (column, &i) in selected.iter().enumerate() {
            if let Some(k) = self.names.iter().position(|n| *n == decls[i].name) {
                if self.units[k] != decls[i].unit {
                    let (name, then, now) = (self.names[k].clone(), self.units[k].clone(), decls[i].unit.to_owned());
                    return Err(SequenceError::Unit { name, then, now });
                }
                kept.push(k);
                columns.push(column);
            }
        }
        if kept.is_empty() {
            return Err(SequenceError::Disjoint { known: self.names.iter().take(5).cloned().collect() });
        }
        let m = self.marginal_of(&kept)?;
        let own: Vec<&ParamDecl> = columns.iter().map(|&c| &decls[selected[c]]).collect();
        let mut w = m.matrix();
        let coordinates = ScaleCoordinates::of_rows(&own, &m.mean, &mut w)?;
        Ok(PosteriorRows { columns, w, coordinates })
    }
}

/// A posterior as residual rows of a fit; the interface of [`crate::belief::prior::Priors`].
///
/// Rows are `W phi(p)` with `phi` tangent to `p - mean` at the mean, in coordinates in which all masses, stiffnesses and dampers
/// times a factor, and the gains over it, is a straight line (logarithms, and first moments and inertias over masses), where the rows tell that
/// factor far worse than its parts; else `phi = p - mean`. Rows of records that are
/// linearised at different points then agree that the factor is not determined, as the records do (`docs/theory/linear-estimators.md`).
#[derive(Clone, Debug, PartialEq)]
pub struct PosteriorRows {
    /// Column of each parameter among the selected ones.
    columns: Vec<usize>,
    w: DMatrix<f64>,
    coordinates: ScaleCoordinates,
}

impl PosteriorRows {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.w.nrows()
    }
    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.w.nrows() == 0
    }
    /// Appends the residuals for the selected physical values `p`.
    ///
    /// # Panics
    /// If `p` is shorter than the selection.
    pub fn push_residuals(&self, p: &[f64], r: &mut Vec<f64>) {
        let value = |k| self.coordinates.value(k, |k| p[self.columns[k]]);
        let phi: Vec<f64> = (0..self.columns.len()).map(value).collect();
        r.extend((0..self.w.nrows()).map(|i| phi.iter().enumerate().map(|(k, x)| self.w[(i, k)] * x).sum::<f64>()));
    }
    /// Writes the derivatives at the selected physical values `p` into rows `first ..` of a Jacobian with respect to these, clearing the rows
    /// first. Does not allocate.
    ///
    /// # Panics
    /// If `p` is shorter than the selection, or `j` has fewer than `first + len()` rows.
    pub fn fill_jacobian(&self, p: &[f64], j: &mut DMatrix<f64>, first: usize) {
        j.rows_mut(first, self.w.nrows()).fill(0.0);
        for (k, &c) in self.columns.iter().enumerate() {
            let (own, other) = self.coordinates.slopes(k, |k| p[self.columns[k]]);
            let mut add = |c: usize, by: f64| {
                j.view_mut((first, c), (self.w.nrows(), 1)).zip_apply(&self.w.column(k), |x, w| *x += by * w);
            };
            add(c, own);
            if let Some((mass, by)) = other {
                add(self.columns[mass], by);
            }
        }
    }
}

/// What was added between two identifications, such as the payload by a grasp: `after - before` for pairs of names, both about
/// the same frame (inertial parameters about one frame add). Both must be independent: the second may not have had the first
/// as its prior for these parameters. `rename` gives the name of the change of each. Allocates.
///
/// # Errors
/// [`SequenceError::Shape`] if a name is missing or a direction is not known in one of them.
pub fn change(
    before: &Posterior,
    after: &Posterior,
    names: &[&str],
    rename: impl Fn(&str) -> String,
) -> Result<Posterior, SequenceError> {
    let (b, a) = (before.exactly(names)?, after.exactly(names)?);
    let full = |p: &Posterior, when: &str| -> Result<DMatrix<f64>, SequenceError> {
        let unknown = || SequenceError::Shape(format!("a direction of the parameters is not known {when}"));
        p.covariance()?.ok_or_else(unknown)
    };
    if let Some(i) = (0..b.len()).find(|&i| b.units[i] != a.units[i]) {
        let (name, then, now) = (b.names[i].clone(), b.units[i].clone(), a.units[i].clone());
        return Err(SequenceError::Unit { name, then, now });
    }
    let covariance = full(&b, "before")? + full(&a, "after")?;
    let mean = a.mean.iter().zip(&b.mean).map(|(a, b)| a - b).collect();
    Posterior::from_covariance(names.iter().map(|n| rename(n)).collect(), a.units, mean, &covariance)
}

impl Posterior {
    /// The marginal of these names, in this order.
    fn exactly(&self, names: &[&str]) -> Result<Self, SequenceError> {
        let place = |n: &&str| {
            let missing = || SequenceError::Shape(format!("'{n}' is not among its parameters"));
            self.names.iter().position(|own| own == n).ok_or_else(missing)
        };
        self.marginal_of(&names.iter().map(place).collect::<Result<Vec<_>, _>>()?)
    }
}
