//! What is known beforehand, as extra residual rows.
//!
//! A Gaussian prior on parameter p with mean `p0` and standard deviation `s` adds one row `(p - p0) / s` to
//! the whitened residuals and `1/s` to their Jacobian with respect to the physical parameter; the minimum is
//! then the maximum a posteriori estimate. The rows are in physical units: add them *before*
//! [`Transform::chain`](crate::parameters::transform::Transform::chain).

use crate::belief::posterior::PosteriorRows;
use ff_model::ParamDecl;
use ff_model::tree::{SelectionError, select};
use nalgebra::DMatrix;

/// Width of a prior.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sigma {
    /// Fraction of the size of the parameter ([`crate::parameters::scale::sizes`]), such as 0.3 for 30 %.
    Relative(f64),
    /// In the unit of the parameter.
    Absolute(f64),
}

/// Why a prior was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PriorError {
    /// A pattern matches nothing.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// A width that is not positive and finite.
    #[error("prior on '{pattern}' has width {value}; it must be positive and finite")]
    Width {
        /// The pattern.
        pattern: String,
        /// The width.
        value: f64,
    },
    /// A pattern matches parameters, but none that is estimated.
    #[error("prior on '{pattern}' matches no estimated parameter; estimate it, or drop the prior")]
    NotEstimated {
        /// The pattern.
        pattern: String,
    },
}

impl PriorError {
    /// Process exit code of `bad-inputs.md`: 11 (configuration).
    pub fn exit_code(&self) -> u8 {
        11
    }
}

/// One row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PriorRow {
    /// Which of the selected parameters.
    pub column: usize,
    /// Mean, in the unit of the parameter.
    pub mean: f64,
    /// Standard deviation, in the unit of the parameter.
    pub sigma: f64,
}

/// Priors on the selected parameters: at most one row of its own for each, and the posteriors of earlier identifications.
///
/// ```
/// # use ff_dynamics::{Drive, SimOptions, State, motion::FnMotion, simulate};
/// # use ff_model::nalgebra::{Matrix3, Vector3};
/// # use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Params, Xform, tree::JointLimits};
/// # let hull = Inertia::from_com(60.0, &Vector3::new(0.2, 0.1, 0.3), &Matrix3::from_diagonal(&Vector3::new(15.0, 14.0, 13.0)));
/// # let mut robot = Model::new("probe", "hull", hull, BaseKind::Floating);
/// # let (kind, placement) = (JointKind::Revolute, Xform::new(Matrix3::identity(), Vector3::new(0.5, 0.1, 0.4)));
/// # let (axis, limits) = (Vector3::new(0.1, -0.2, 0.9), JointLimits::default());
/// # let link = Inertia::from_com(8.6, &Vector3::new(0.1, 0.21, -0.1), &Matrix3::from_diagonal(&Vector3::new(0.4, 0.05, 0.37)));
/// # robot.add_body(0, "arm", Joint { name: "shoulder".into(), kind, axis, placement, limits }, link);
/// # let truth = Params::<f64>::nominal(&robot);
/// # let motion = FnMotion::new(1, 10.0, |t, q, qd, qdd| {
/// #     let (sin, cos) = (0.9 * t).sin_cos();
/// #     (q[0], qd[0], qdd[0]) = (0.7 * (1.0 - cos), 0.63 * sin, 0.567 * cos);
/// # })?;
/// # let options = SimOptions { duration_s: 10.0, step_s: 0.01, sample_s: 0.01 };
/// # let trace = simulate(&robot, &truth, &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// # let record = ff_records::RecordBuilder::new(["shoulder"]).uniform(0.0, 100.0).q(trace.q.clone()).tau(trace.tau.clone());
/// # let (record, _) = record.gyro(trace.gyro()).build()?;
/// # let (decls, mass) = (robot.param_decls(), robot.parameter_indices("base.mass")?);
/// # let mut start = truth.values().to_vec();
/// # start[mass[0]] = 72.0;
/// use ident::belief::Sigma;
/// use ident::{Noise, Priors, Rda, Request, estimate};
///
/// // The mass is known to 0.5 kg beforehand; data of poor torque sensors add little.
/// let priors = Priors::new(&decls, &mass, truth.values(), &[("base.mass", Sigma::Absolute(0.5))])?;
/// let mut rda = Rda::new(&robot, &record, &Noise { torque: 500.0, gyro: 1e-5 })?;
/// let fit = estimate(&Request { priors, ..Request::new(&decls, &mass, &start) }, &mut rda)?;
/// let std = fit.parameters[0].std.unwrap();
/// assert!((0.45..0.5).contains(&std), "{std}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Priors {
    rows: Vec<PriorRow>,
    posteriors: Vec<PosteriorRows>,
}

impl Priors {
    /// Those of its own rows whose columns are kept. Allocates.
    #[must_use]
    pub fn of_columns(mut self, keep: impl Fn(usize) -> bool) -> Self {
        self.rows.retain(|r| keep(r.column));
        self
    }
    /// Priors centred on `start` (full parameter vector) for the parameters in `selected` that the patterns
    /// match; a later pattern replaces an earlier one. Allocates.
    ///
    /// # Errors
    /// [`PriorError`].
    ///
    /// # Panics
    /// If `start` and `decls` differ in length.
    pub fn new<S: AsRef<str>>(
        decls: &[ParamDecl],
        selected: &[usize],
        start: &[f64],
        specs: &[(S, Sigma)],
    ) -> Result<Self, PriorError> {
        let sizes = crate::parameters::scale::sizes(decls, start);
        let mut rows: Vec<PriorRow> = Vec::new();
        for (pattern, width) in specs {
            let pattern = pattern.as_ref();
            let (Sigma::Relative(value) | Sigma::Absolute(value)) = *width;
            if !(value.is_finite() && value > 0.0) {
                return Err(PriorError::Width { pattern: pattern.to_owned(), value });
            }
            let mut used = false;
            for i in select(decls, &[pattern])? {
                let Some(column) = selected.iter().position(|&s| s == i) else { continue };
                let sigma = if matches!(width, Sigma::Relative(_)) { value * sizes[i] } else { value };
                rows.retain(|r| r.column != column);
                rows.push(PriorRow { column, mean: start[i], sigma });
                used = true;
            }
            if !used {
                return Err(PriorError::NotEstimated { pattern: pattern.to_owned() });
            }
        }
        rows.sort_by_key(|r| r.column);
        Ok(Self { rows, posteriors: Vec::new() })
    }
    /// These, with a row in place of any that its column has. Allocates.
    #[must_use]
    pub fn with(&self, row: PriorRow) -> Self {
        let mut rows: Vec<PriorRow> = self.rows.iter().filter(|r| r.column != row.column).copied().collect();
        rows.push(row);
        rows.sort_by_key(|r| r.column);
        Self { rows, posteriors: self.posteriors.clone() }
    }
    /// These, and what an earlier identification says ([`crate::belief::posterior::Posterior::rows_for`] the same selection).
    #[must_use]
    pub fn and(mut self, posterior: PosteriorRows) -> Self {
        self.posteriors.push(posterior);
        self
    }
    /// The rows of single parameters, by column.
    pub fn rows(&self) -> &[PriorRow] {
        &self.rows
    }
    /// Number of rows, those of posteriors included.
    pub fn len(&self) -> usize {
        self.rows.len() + self.posteriors.iter().map(PosteriorRows::len).sum::<usize>()
    }
    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Appends `(p - p0) / s` for the selected physical values `p`, then the rows of every posterior ([`PosteriorRows`]).
    ///
    /// # Panics
    /// If `p` is shorter than the selection.
    pub fn push_residuals(&self, p: &[f64], r: &mut Vec<f64>) {
        r.extend(self.rows.iter().map(|row| (p[row.column] - row.mean) / row.sigma));
        self.posteriors.iter().for_each(|b| b.push_residuals(p, r));
    }
    /// Writes `1/s`, then the derivatives of the rows of every posterior at the selected physical values `p`, into rows `first ..` of a Jacobian with respect to the selected physical parameters,
    /// clearing them first. Does not allocate.
    ///
    /// # Panics
    /// If `p` is shorter than the selection, or `j` has fewer than `first + len()` rows.
    pub fn fill_jacobian(&self, p: &[f64], j: &mut DMatrix<f64>, first: usize) {
        j.rows_mut(first, self.rows.len()).fill(0.0);
        for (k, row) in self.rows.iter().enumerate() {
            j[(first + k, row.column)] = 1.0 / row.sigma;
        }
        let mut at = first + self.rows.len();
        for b in &self.posteriors {
            b.fill_jacobian(p, j, at);
            at += b.len();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_relative_to_the_size_and_later_patterns_win() {
        let d: Vec<ParamDecl> =
            ["p.k[0]", "p.k[1]", "p.d[0]"].iter().map(|n| ParamDecl::positive(*n, "N m", 8.0)).collect();
        let specs = [("p.*", Sigma::Relative(0.5)), ("p.d[*]", Sigma::Absolute(0.2))];
        let p = Priors::new(&d, &[0, 2], &[8.0, 9.0, 3.0], &specs).unwrap();
        let mut r = vec![7.0];
        p.push_residuals(&[10.0, 3.1], &mut r);
        assert!((r[1] - 0.5).abs() < 1e-12 && (r[2] - 0.5).abs() < 1e-12 && r.len() == 3);
        let mut j = DMatrix::from_element(3, 2, 9.0);
        p.fill_jacobian(&[10.0, 3.1], &mut j, 1);
        assert_eq!(j.row(1).iter().copied().collect::<Vec<_>>(), [0.25, 0.0]);
        assert_eq!(j[(2, 1)], 5.0);
        let one = |s: Sigma, n: &'static str| Priors::new(&d, &[0, 2], &[8.0, 9.0, 3.0], &[(n, s)]);
        assert!(matches!(one(Sigma::Absolute(0.0), "p.*"), Err(PriorError::Width { .. })));
        assert!(matches!(one(Sigma::Absolute(1.0), "q.*"), Err(PriorError::Selection(_))));
        assert!(matches!(one(Sigma::Absolute(1.0), "p.k[1]"), Err(PriorError::NotEstimated { .. })));
    }
}
