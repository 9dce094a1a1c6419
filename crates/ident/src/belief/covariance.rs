//! How well the data determine each parameter, and which combinations they do not determine at all.
//!
//! With J the whitened Jacobian with respect to physical parameters (m x n) and sizes `s_i`
//! ([`crate::parameters::scale::sizes`]), the scaled sensitivities are `A = J diag(s) = U diag(sigma) V^T`. Along the unit
//! direction `v_k` of relative change the standard deviation is `1/sigma_k` (1 = as uncertain as the parameter
//! is large). Directions with `sigma_k <= tol sigma_1` are null: the data say nothing about them. The
//! Cramer-Rao covariance `(J^T J)^-1 = diag(s) V diag(1/sigma^2) V^T diag(s)` is given for the parameters that
//! have no part in a null direction; the others have no deviation at all.

use ff_least_squares::{Determined, TOUCH, determine};
use ff_linalg::{self as linalg, LinalgError};
use ff_model::ParamDecl;
use nalgebra::{DMatrix, DVector};

/// A named unknown.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Unknown {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Size (in the unit): what a relative change of 1 means.
    pub size: f64,
}

impl Unknown {
    /// Whether it is part of the initial state of a record, by its name.
    pub(crate) fn is_initial(&self) -> bool {
        self.name.starts_with("initial.") || self.name.contains(".initial.")
    }
    /// Whether it is a constant error of a sensor, by its name.
    pub(crate) fn is_bias(&self) -> bool {
        self.name.contains("gyro.bias.") || self.name.contains("torque.bias.")
    }
    /// The parameters of these indices, with the sizes of all ([`crate::parameters::scale::sizes`]). Allocates.
    ///
    /// # Panics
    /// If an index does not exist.
    pub fn of_parameters(decls: &[ParamDecl], selected: &[usize], sizes: &[f64]) -> Vec<Self> {
        let of = |&i: &usize| Self { name: decls[i].name.clone(), unit: decls[i].unit.to_owned(), size: sizes[i] };
        selected.iter().map(of).collect()
    }
}

/// A combination of parameters.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Direction {
    /// Singular value of the scaled sensitivities (its inverse is the relative standard deviation).
    pub singular_value: f64,
    /// Parameters and their changes along the direction, in their own units, largest relative part first;
    /// parts below a tenth of the largest are left out.
    pub terms: Vec<(String, f64)>,
    /// How many parts were left out.
    pub omitted: usize,
}

impl core::fmt::Display for Direction {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        for (i, (name, w)) in self.terms.iter().enumerate() {
            let sign = if *w < 0.0 { "- " } else { "" };
            let sign = if i > 0 && *w >= 0.0 { "+ " } else { sign };
            write!(f, "{}{sign}{:.3e} {name}", if i > 0 { " " } else { "" }, w.abs())?;
        }
        if self.omitted > 0 { write!(f, " (and {} smaller)", self.omitted) } else { Ok(()) }
    }
}

/// The result of [`analyse`].
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
/// use ident::{Noise, Rda, Request, Uncertainty, estimate};
///
/// // One joint: the data cannot tell all ten parameters of the hull, and name the combinations that stay open.
/// let hull: Vec<usize> = (0..10).collect();
/// let mut rda = Rda::new(&robot, &record, &Noise { torque: 0.01, gyro: 1e-5 })?;
/// let request = Request { anchor: Some(0.3), ..Request::new(&decls, &hull, truth.values()) };
/// let told: Uncertainty = estimate(&request, &mut rda)?.data_only;
/// assert!(told.rank < 10 && told.null.len() == 10 - told.rank);
/// println!("not identifiable: {}", told.null[0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertainty {
    /// The unknowns, in the order of the columns.
    pub unknowns: Vec<Unknown>,
    /// Covariance in physical units, n x n, on the identifiable subspace (pseudo-inverse when rank < n).
    pub covariance: DMatrix<f64>,
    /// Standard deviations in physical units; none for a parameter that has a part in a null direction.
    pub deviation: Vec<Option<f64>>,
    /// Singular values of the scaled sensitivities, descending.
    pub singular_values: Vec<f64>,
    /// The directions they belong to, orthonormal columns in scaled parameters, n x n.
    pub directions: DMatrix<f64>,
    /// Numerical rank.
    pub rank: usize,
    /// Ratio of the largest singular value to the smallest one counted in the rank.
    pub condition: f64,
    /// Null directions, n - rank, in the reduced form that mixes as few parameters as possible.
    pub null: Vec<Direction>,
    /// Directions within the rank that are known worse than to their own size (`sigma < 1`), weakest first.
    pub weak: Vec<Direction>,
}

/// Analyses a whitened Jacobian `j` (m x n, m >= n, prior rows included if wanted) with respect to physical
/// parameters. `tolerance` is relative to the largest singular value; `1e-9` suits exact sensitivities. Allocates.
///
/// # Errors
/// [`LinalgError`] for non-finite input, m < n, or another number of unknowns.
pub fn analyse(j: &DMatrix<f64>, unknowns: &[Unknown], tolerance: f64) -> Result<Uncertainty, LinalgError> {
    let sizes: Vec<f64> = unknowns.iter().map(|u| u.size).collect();
    let Determined { scaled: a, svd: d, rank, covariance, deviation } = determine(j, &sizes, tolerance)?;
    let (n, s) = (sizes.len(), d.s.as_slice());
    let direction = |v: &[f64], singular_value: f64| name_direction(v, singular_value, unknowns);
    let weak = (0..rank).rev().take_while(|&k| s[k] < 1.0);
    let weak = weak.map(|k| direction(d.v.column(k).as_slice(), s[k])).collect();
    let null = if rank < n {
        let basis = sparse_basis(&d.v.columns(rank, n - rank).into_owned())?;
        let worst = |c: &[f64]| (&a * DVector::from_column_slice(c)).norm();
        basis.column_iter().map(|c| direction(c.as_slice(), worst(c.as_slice()))).collect()
    } else {
        vec![]
    };
    let condition = if rank > 0 { s[0] / s[rank - 1] } else { f64::INFINITY };
    Ok(Uncertainty {
        unknowns: unknowns.to_vec(),
        covariance,
        deviation,
        singular_values: s.to_vec(),
        directions: d.v.clone(),
        rank,
        condition,
        null,
        weak,
    })
}

impl Uncertainty {
    /// Number of directions known to the relative standard deviation `limit` or better, and the largest component
    /// of `errors` (one per unknown, in its unit) along any of them, relative to the size of the parameters.
    ///
    /// For studies with a known truth: what is left of an error in the combinations that the data determine.
    ///
    /// # Panics
    /// If there is another number of errors than unknowns.
    pub fn worst_combination(&self, errors: &[f64], limit: f64) -> (usize, f64) {
        assert_eq!(errors.len(), self.unknowns.len(), "one error per unknown");
        let known = self.singular_values.iter().take(self.rank).filter(|&&s| s * limit >= 1.0).count();
        let along = |k: usize| {
            (0..errors.len()).map(|i| self.directions[(i, k)] * errors[i] / self.unknowns[i].size).sum::<f64>().abs()
        };
        (known, (0..known).map(along).fold(0.0, f64::max))
    }
    /// Standard deviation of the quantity with this gradient over the unknowns (`sqrt(g^T C g)`, in its own unit), or none
    /// where the data cannot tell it: where the gradient over scaled unknowns has a part in a null direction.
    ///
    /// A quantity may be determined although an unknown beside it is not.
    ///
    /// # Panics
    /// If there is not one component per unknown.
    pub fn combination(&self, gradient: &[f64]) -> Option<f64> {
        let n = self.unknowns.len();
        assert_eq!(gradient.len(), n, "one component per unknown");
        let scaled = DVector::from_fn(n, |i, _| gradient[i] * self.unknowns[i].size);
        let lost = (self.rank..n).map(|k| self.directions.column(k).dot(&scaled).powi(2)).sum::<f64>().sqrt();
        let g = DVector::from_column_slice(gradient);
        (lost <= TOUCH * scaled.norm()).then(|| g.dot(&(&self.covariance * &g)).max(0.0).sqrt())
    }
    /// True when every parameter is determined.
    pub fn full_rank(&self) -> bool {
        self.rank == self.unknowns.len()
    }
    /// Correlation coefficients, n x n; zero rows where a parameter has no variance. Allocates.
    pub fn correlations(&self) -> DMatrix<f64> {
        let c = &self.covariance;
        DMatrix::from_fn(c.nrows(), c.ncols(), |i, j| {
            let v = c[(i, i)] * c[(j, j)];
            if v > 0.0 { (c[(i, j)] / v.sqrt()).clamp(-1.0, 1.0) } else { 0.0 }
        })
    }
    /// Pairs of names with `|correlation| >= limit`, strongest first. Allocates.
    pub fn strong_correlations(&self, limit: f64) -> Vec<(String, String, f64)> {
        let c = self.correlations();
        let mut out = Vec::new();
        for i in 0..c.nrows() {
            for j in 0..i {
                if c[(i, j)].abs() >= limit {
                    out.push((self.unknowns[j].name.clone(), self.unknowns[i].name.clone(), c[(i, j)]));
                }
            }
        }
        out.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
        out
    }
}

/// Sensitivities with respect to physical parameters from those with respect to coordinates:
/// `J_p = J_x P^-1` with `P = d physical / d x` ([`crate::parameters::transform::Transform::jacobian`]). Allocates.
///
/// # Errors
/// [`LinalgError`] for non-finite input, shapes that do not fit, or a singular P.
pub fn physical_jacobian(j: &DMatrix<f64>, p: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    linalg::check_finite("Jacobian", j)?;
    linalg::check_finite("parameter map", p)?;
    let (rows, columns) = p.shape();
    if rows != columns || j.ncols() != rows {
        let needed = format!("a square matrix of size {}", j.ncols());
        return Err(LinalgError::Shape { what: "parameter map", rows, columns, needed });
    }
    let solved = p.transpose().lu().solve(&j.transpose());
    let solved = solved.ok_or(LinalgError::RankDeficient { rank: columns - 1, columns, dependent: vec![] })?;
    Ok(solved.transpose())
}

/// The same space, spanned by vectors that each own one parameter alone (reduced echelon form on the
/// parameters that column pivoting finds), scaled to unit length: a direction then mixes few parameters,
/// where singular vectors of a repeated zero are an arbitrary rotation.
pub(crate) fn sparse_basis(v: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let k = v.ncols();
    let order = linalg::col_piv_qr(&v.transpose())?.order;
    let own = DMatrix::from_fn(k, k, |i, j| v[(order[i], j)]);
    let Some(inverse) = own.try_inverse() else { return Ok(v.clone()) };
    let mut out = v * inverse;
    for mut c in out.column_iter_mut() {
        let norm = c.norm();
        c.unscale_mut(norm);
    }
    Ok(out)
}

pub(crate) fn name_direction(v: &[f64], singular_value: f64, unknowns: &[Unknown]) -> Direction {
    let mut order: Vec<usize> = (0..v.len()).collect();
    order.sort_by(|&a, &b| v[b].abs().total_cmp(&v[a].abs()));
    let top = v[order[0]].abs();
    // The sign of a direction means nothing; make its largest part positive.
    let sign = v[order[0]].signum();
    let kept = order.iter().take_while(|&&i| v[i].abs() >= 0.1 * top).count();
    let omitted = v.iter().filter(|x| x.abs() > TOUCH).count().saturating_sub(kept);
    let terms = order[..kept].iter().map(|&i| (unknowns[i].name.clone(), sign * v[i] * unknowns[i].size)).collect();
    Direction { singular_value, terms, omitted }
}
