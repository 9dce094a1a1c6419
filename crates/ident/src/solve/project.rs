//! Physical projection: the parameters nearest to a linear estimate that bodies and joints can have.
//!
//! Linear least squares knows no bodies: noise, or a direction that the data hardly see, makes masses negative and inertias
//! break the triangle inequality. With the estimate `x_hat` and the triangle `R` of its whitened equations
//! ([`crate::solve::linear::LinearEstimate::equations`]) the projection is the semidefinite program
//!
//! ```text
//! min 1/2 |R (x - x_hat)|^2 + 1/2 w^2 |diag(s)^-1 (x - x_hat)|^2
//! subject to  P_b(x) - eps N_b >= 0 (4 x 4, every body),  x_i >= eps s_i (stiffness, damping, friction)
//! ```
//!
//! with the pseudo-inertia `P_b` (linear in `x`), `N_b = m diag(l^2, l^2, l^2, 1)` its size, and a small hold `w` that decides
//! where the data do not (P. Wensing, S. Kim, J.-J. Slotine, *Linear matrix inequalities for physically consistent inertial
//! parameter identification*, IEEE RA-L 3(1), 2018; C. Sousa, R. Cortesao, IJRR 33(6), 2014). The distance is the increase of
//! half the chi-square: what the data have against the projection.
//!
//! Data without noise leave a residual of rounding, and a metric that is a million millions finer than the hold; double precision does
//! not follow the path beside it. `R` is then taken so much coarser that no column of `R diag(s)` is longer than 1e7, and
//! cost and multipliers are scaled back: the same program with a larger hold, which moves what the data tell by less than a part in 1e9.
//!
//! Solved by following the central path of the log-determinant barrier with damped Newton steps, which need no line search
//! because the function is self-concordant, and no start from the user because a body that exists is always at hand (S.
//! Boyd, L. Vandenberghe, *Convex Optimization*, 2004, 9.6 and 11.3). The Hessian is a sum of squares, so that every step is a
//! least-squares problem and no Gram matrix is formed. `docs/decisions/0008-projection.md` says why no conic solver is used.

use crate::parameters::scale;
use crate::solve::linear::LinearEstimate;
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use ff_model::Inertia;
use ff_model::{ParamDecl, ParamGroup};
use nalgebra::{DMatrix, DVector, Matrix4};

/// Row, column and weight of the ten entries of a symmetric 4 x 4 matrix, as a vector with its Frobenius norm.
const ENTRIES: [(usize, usize, f64); 10] = {
    const R: f64 = std::f64::consts::SQRT_2;
    [
        (0, 0, 1.0),
        (1, 1, 1.0),
        (2, 2, 1.0),
        (3, 3, 1.0),
        (0, 1, R),
        (1, 2, R),
        (0, 2, R),
        (0, 3, R),
        (1, 3, R),
        (2, 3, R),
    ]
};

/// Longest column of the metric, per size of its unknown, beside which the path can be followed.
const FINEST: f64 = 1e7;

/// How to project.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectOptions {
    /// Smallest eigenvalue of a pseudo-inertia, and smallest positive parameter, relative to their size.
    pub epsilon: f64,
    /// Hold of directions that the data do not determine: cost of moving by its own size, in standard deviations. In proportion to
    /// the metric above 1e7 standard deviations per size.
    pub hold: f64,
    /// Bound on how far the cost is above its least value.
    pub tolerance: f64,
}

impl Default for ProjectOptions {
    /// 1e-6 of the size, a hold of 1e-3, cost to 1e-10.
    fn default() -> Self {
        Self { epsilon: 1e-6, hold: 1e-3, tolerance: 1e-10 }
    }
}

/// Why there is no projection.
#[derive(Debug, thiserror::Error)]
pub enum ProjectError {
    /// An option outside its range.
    #[error("{what} is {value}, must be positive and finite{}", if *what == "epsilon" { " and below 0.1" } else { "" })]
    Option {
        /// Which.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Some of the ten parameters of a body are taken as known, and the start is no body from which the others could be
    /// adjusted.
    #[error("body '{body}' is estimated in part, and its start values are not those of a body; correct the known ones")]
    Infeasible {
        /// The body.
        body: String,
    },
    /// Shapes that do not belong together.
    #[error("{0}")]
    Shape(String),
    /// The central path was lost to rounding; scale or condition are beyond double precision.
    #[error("the projection stopped at a bound of {gap:.1e} on the cost, above the tolerance {tolerance:.1e}")]
    Stalled {
        /// Reached.
        gap: f64,
        /// Asked for.
        tolerance: f64,
    },
    /// A factorisation refused its input.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// A body of which at least one parameter is unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name, for messages.
    pub name: String,
    /// The ten parameters; what is unknown is overwritten.
    pub known: [f64; 10],
    /// The unknown that each of the ten is, if any.
    pub unknown: [Option<usize>; 10],
    /// Mass (kg) and length (m) that measure it.
    pub size: (f64, f64),
}

/// What is constrained.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cone {
    /// Bodies.
    pub bodies: Vec<Body>,
    /// Unknowns that must be positive.
    pub positive: Vec<usize>,
}

/// The nearest point with its multipliers.
#[derive(Clone, Debug)]
pub struct Nearest {
    /// Unknowns.
    pub x: Vec<f64>,
    /// Cost: half the squared distance in the metric, hold included.
    pub cost: f64,
    /// Multiplier of each body, positive semidefinite; its product with `P - eps N` is near zero.
    pub bodies: Vec<Matrix4<f64>>,
    /// Multiplier of each positive unknown.
    pub positive: Vec<f64>,
    /// Bound on how far `cost` is above the least one.
    pub gap: f64,
    /// Newton steps.
    pub steps: usize,
}

impl Body {
    fn pseudo(&self, x: &[f64]) -> Matrix4<f64> {
        let mut p = self.known;
        for (p, u) in p.iter_mut().zip(&self.unknown) {
            if let Some(k) = u {
                *p = x[*k];
            }
        }
        Inertia::from_params(&p).pseudo()
    }
    /// `eps N`.
    fn least(&self, epsilon: f64) -> Matrix4<f64> {
        let (m, l) = self.size;
        Matrix4::from_diagonal(&nalgebra::Vector4::new(l * l, l * l, l * l, 1.0)) * (m * epsilon)
    }
    fn whole(&self) -> bool {
        self.unknown.iter().all(Option::is_some)
    }
}

/// Solves the program of the module documentation around `x_hat`; `r` is any matrix with a column per unknown, `sizes` are
/// the sizes `s`, `start` is used for bodies of which only a part is unknown. Allocates.
///
/// # Errors
/// [`ProjectError`].
pub fn nearest(
    r: &DMatrix<f64>,
    x_hat: &[f64],
    sizes: &[f64],
    start: &[f64],
    cone: &Cone,
    options: &ProjectOptions,
) -> Result<Nearest, ProjectError> {
    let n = x_hat.len();
    for (what, value) in [("epsilon", options.epsilon), ("hold", options.hold), ("tolerance", options.tolerance)] {
        if !(value.is_finite() && value > 0.0 && (what != "epsilon" || value < 0.1)) {
            return Err(ProjectError::Option { what, value });
        }
    }
    let known = cone.bodies.iter().flat_map(|b| b.unknown.iter().flatten()).chain(&cone.positive);
    if r.ncols() != n || sizes.len() != n || start.len() != n || known.clone().any(|&k| k >= n) {
        return Err(ProjectError::Shape(format!("{n} unknowns, {} columns, {} sizes", r.ncols(), sizes.len())));
    }
    linalg::check_finite("metric", r)?;
    linalg::check_finite_slice("estimate", x_hat)?;
    if let Some(&value) = sizes.iter().find(|s| !(s.is_finite() && **s > 0.0)) {
        return Err(ProjectError::Option { what: "size of an unknown", value });
    }
    let finest = r.column_iter().zip(sizes).map(|(c, s)| c.norm() * s).fold(0.0, f64::max);
    let coarser = if finest > FINEST { FINEST / finest } else { 1.0 };
    let r = &(r * coarser);
    let path = Path { r, x_hat, sizes, cone, options };
    if path.factors(x_hat).is_some() {
        // Nothing to project, and no multiplier.
        let (bodies, positive) = (vec![Matrix4::zeros(); cone.bodies.len()], vec![0.0; cone.positive.len()]);
        return Ok(Nearest { x: x_hat.to_vec(), cost: 0.0, bodies, positive, gap: 0.0, steps: 0 });
    }
    let mut found = path.follow(path.inside(start)?)?;
    let back = 1.0 / (coarser * coarser);
    found.cost *= back;
    found.gap *= back;
    found.bodies.iter_mut().for_each(|b| *b *= back);
    found.positive.iter_mut().for_each(|p| *p *= back);
    Ok(found)
}

struct Path<'a> {
    r: &'a DMatrix<f64>,
    x_hat: &'a [f64],
    sizes: &'a [f64],
    cone: &'a Cone,
    options: &'a ProjectOptions,
}

/// Newton decrement below which full steps converge quadratically.
const NEAR: f64 = 0.25;
/// Decrement at which a point counts as on the central path.
const CENTRED: f64 = 1e-6;
/// Factor between two points of the path.
const LONGER: f64 = 12.0;
/// Newton steps for one point of the path; self-concordance promises far fewer.
const STEPS: usize = 200;

impl Path<'_> {
    /// A point strictly inside: eigenvalues of the estimate lifted to a hundredth of the size of the body.
    fn inside(&self, start: &[f64]) -> Result<Vec<f64>, ProjectError> {
        let mut x = self.x_hat.to_vec();
        let lift = 1e-2f64.max(10.0 * self.options.epsilon);
        for b in &self.cone.bodies {
            if b.whole() {
                let (m, l) = b.size;
                let unit = nalgebra::Vector4::new(l, l, l, 1.0) * m.sqrt();
                let (to, from) = (Matrix4::from_diagonal(&unit), Matrix4::from_diagonal(&unit.map(f64::recip)));
                let scaled = from * b.pseudo(&x) * from;
                let e = scaled.symmetric_eigen();
                let values = e.eigenvalues.map(|v| v.max(lift));
                let p = to * (e.eigenvectors * Matrix4::from_diagonal(&values) * e.eigenvectors.transpose()) * to;
                for (k, v) in Inertia::from_pseudo(&p).to_params().iter().enumerate() {
                    if let Some(u) = b.unknown[k] {
                        x[u] = *v;
                    }
                }
            } else {
                b.unknown.iter().flatten().for_each(|&u| x[u] = start[u]);
                if (b.pseudo(&x) - b.least(self.options.epsilon)).cholesky().is_none() {
                    return Err(ProjectError::Infeasible { body: b.name.clone() });
                }
            }
        }
        for &k in &self.cone.positive {
            x[k] = x[k].max(lift * self.sizes[k]);
        }
        Ok(x)
    }
    fn cost(&self, x: &[f64]) -> f64 {
        let dx = DVector::from_fn(x.len(), |i, _| x[i] - self.x_hat[i]);
        let held: f64 = dx.iter().zip(self.sizes).map(|(d, s)| (self.options.hold * d / s).powi(2)).sum();
        0.5 * ((self.r * dx).norm_squared() + held)
    }
    /// Cholesky factor of every slack, or none outside.
    fn factors(&self, x: &[f64]) -> Option<Vec<Matrix4<f64>>> {
        let eps = self.options.epsilon;
        if self.cone.positive.iter().any(|&k| x[k] <= eps * self.sizes[k]) {
            return None;
        }
        self.cone.bodies.iter().map(|b| Some((b.pseudo(x) - b.least(eps)).cholesky()?.l())).collect()
    }
    /// Newton step of `t cost - sum log det` in units of the sizes, and its decrement.
    fn step(&self, t: f64, x: &[f64], factors: &[Matrix4<f64>]) -> Result<(DVector<f64>, f64), ProjectError> {
        let (n, m) = (x.len(), self.r.nrows());
        let rows = m + n + 10 * factors.len() + self.cone.positive.len();
        let mut a = DMatrix::zeros(rows.max(n + 1), n + 1);
        let root = t.sqrt();
        let dx = DVector::from_fn(n, |i, _| x[i] - self.x_hat[i]);
        let residual = self.r * &dx;
        for i in 0..m {
            for k in 0..n {
                a[(i, k)] = root * self.r[(i, k)] * self.sizes[k];
            }
            a[(i, n)] = -root * residual[i];
        }
        for k in 0..n {
            a[(m + k, k)] = root * self.options.hold;
            a[(m + k, n)] = -root * self.options.hold * dx[k] / self.sizes[k];
        }
        let mut at = m + n;
        for (b, l) in self.cone.bodies.iter().zip(factors) {
            let singular = || LinalgError::RankDeficient { rank: 3, columns: 4, dependent: vec![] };
            let inverse = l.try_inverse().ok_or_else(singular)?;
            for (p, u) in b.unknown.iter().enumerate() {
                let Some(k) = u else { continue };
                let mut unit = [0.0; 10];
                unit[p] = self.sizes[*k];
                let e = inverse * Inertia::from_params(&unit).pseudo() * inverse.transpose();
                for (i, &(row, col, weight)) in ENTRIES.iter().enumerate() {
                    a[(at + i, *k)] = weight * e[(row, col)];
                }
            }
            (0..4).for_each(|i| a[(at + i, n)] = 1.0);
            at += 10;
        }
        for &k in &self.cone.positive {
            a[(at, k)] = self.sizes[k] / (x[k] - self.options.epsilon * self.sizes[k]);
            a[(at, n)] = 1.0;
            at += 1;
        }
        let r = linalg::qr_r(&a)?;
        let (top, right) = (r.view((0, 0), (n, n)).into_owned(), r.view((0, n), (n, 1)).column(0).into_owned());
        let singular = || LinalgError::RankDeficient { rank: n - 1, columns: n, dependent: vec![] };
        let u = top.solve_upper_triangular(&right).ok_or_else(singular)?;
        Ok((u, right.norm()))
    }
    fn follow(&self, mut x: Vec<f64>) -> Result<Nearest, ProjectError> {
        let terms = (4 * self.cone.bodies.len() + self.cone.positive.len()) as f64;
        let tolerance = self.options.tolerance;
        // The first point of the path: barrier and cost weigh alike.
        let mut t = (terms / self.cost(&x).max(tolerance)).clamp(1e-30, terms.max(1.0) / tolerance);
        let mut steps = 0;
        let lost = |t: f64| ProjectError::Stalled { gap: terms / t, tolerance };
        loop {
            let mut last = f64::INFINITY;
            for inner in 0.. {
                let factors = self.factors(&x).ok_or_else(|| lost(t))?;
                let (u, decrement) = self.step(t, &x, &factors)?;
                // Rounding sets a floor under the decrement; a full step there has nothing more to give.
                if decrement < CENTRED || (decrement < NEAR && decrement > 0.5 * last) {
                    break;
                }
                if inner == STEPS {
                    return Err(lost(t));
                }
                last = decrement;
                let length = if decrement < NEAR { 1.0 } else { 1.0 / (1.0 + decrement) };
                x.iter_mut().zip(u.iter().zip(self.sizes)).for_each(|(x, (u, s))| *x += length * u * s);
                steps += 1;
            }
            if terms / t <= tolerance * self.cost(&x).max(1.0) {
                break;
            }
            t *= LONGER;
        }
        let factors = self.factors(&x).ok_or_else(|| lost(t))?;
        // Multipliers `1/slack / t`, moved along the next Newton step: stationarity then holds to rounding, where the plain ones
        // have the relative error of a slack that is the difference of two large numbers.
        let (u, _) = self.step(t, &x, &factors)?;
        let further: Vec<f64> = x.iter().zip(u.iter().zip(self.sizes)).map(|(x, (u, s))| x + u * s).collect();
        let dual = |(b, l): (&Body, &Matrix4<f64>)| {
            let inverse = l.try_inverse()?;
            let change = inverse * (b.pseudo(&further) - b.pseudo(&x)) * inverse.transpose();
            Some(inverse.transpose() * (Matrix4::identity() - change) * inverse / t)
        };
        let positive = |&k: &usize| {
            let slack = x[k] - self.options.epsilon * self.sizes[k];
            (1.0 - u[k] * self.sizes[k] / slack) / (t * slack)
        };
        let bodies = self.cone.bodies.iter().zip(&factors).map(dual).collect::<Option<_>>().ok_or_else(|| lost(t))?;
        let positive = self.cone.positive.iter().map(positive).collect();
        let x = if self.factors(&further).is_some() { further } else { x };
        Ok(Nearest { cost: self.cost(&x), bodies, positive, gap: terms / t, steps, x })
    }
}

/// One parameter before and after.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Moved {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Linear estimate.
    pub from: f64,
    /// Projection.
    pub to: f64,
}

/// The projection of a linear estimate.
#[derive(Clone, Debug)]
pub struct Projected {
    /// Full parameter vector.
    pub values: Vec<f64>,
    /// Every unknown, those besides the parameters of the model last.
    pub unknowns: Vec<Moved>,
    /// Increase of the chi-square by the projection: far above the number of unknowns, the data contradict the model.
    pub chi2_increase: f64,
    /// Bodies and parameters that ended on the boundary of what exists.
    pub at_boundary: Vec<String>,
    /// Bound on how far the cost is above its least value.
    pub gap: f64,
}

/// Projects a linear estimate onto what can exist: selected bodies consistent (whole or in part), positive parameters
/// positive, unknowns of `estimate.extra` positive where `positive_extra` says so. `start` is the full parameter vector that
/// the estimate started from. Allocates.
///
/// # Errors
/// [`ProjectError`].
pub fn project(
    estimate: &LinearEstimate,
    decls: &[ParamDecl],
    selected: &[usize],
    start: &[f64],
    positive_extra: impl Fn(&str) -> bool,
    options: &ProjectOptions,
) -> Result<Projected, ProjectError> {
    let (m, n) = (selected.len(), selected.len() + estimate.extra.len());
    if estimate.parameters.len() != m || start.len() != decls.len() || selected.iter().any(|&i| i >= decls.len()) {
        return Err(ProjectError::Shape("estimate, selection and start do not belong together".into()));
    }
    let x_hat: Vec<f64> = estimate.parameters.iter().chain(&estimate.extra).map(|p| p.value).collect();
    let x_start: Vec<f64> = estimate.parameters.iter().chain(&estimate.extra).map(|p| p.start).collect();
    let sizes: Vec<f64> = estimate.uncertainty.unknowns.iter().map(|u| u.size).collect();
    let all_sizes = scale::sizes(decls, start);
    let mut cone = Cone::default();
    for i in (0..decls.len()).filter(|&i| decls[i].group == ParamGroup::Positive) {
        cone.positive.extend(selected.binary_search(&i));
    }
    let mut i = 0;
    while i < decls.len() {
        let ParamGroup::Inertial(name) = &decls[i].group else {
            i += 1;
            continue;
        };
        let ten = decls.get(i..i + 10).filter(|d| d.iter().all(|d| d.group == decls[i].group));
        if ten.is_none() {
            i += 1;
            continue;
        }
        let unknown: [Option<usize>; 10] = core::array::from_fn(|k| selected.binary_search(&(i + k)).ok());
        if unknown.iter().any(Option::is_some) {
            let known = core::array::from_fn(|k| start[i + k]);
            // Second moments have the size m l^2.
            let size = (all_sizes[i], (all_sizes[i + 4] / all_sizes[i]).sqrt());
            cone.bodies.push(Body { name: name.clone(), known, unknown, size });
        }
        i += 10;
    }
    let extra = estimate.extra.iter().enumerate().filter(|(_, e)| positive_extra(&e.name));
    cone.positive.extend(extra.map(|(k, _)| m + k));
    let near = nearest(&estimate.equations.r, &x_hat, &sizes, &x_start, &cone, options)?;
    let mut values = estimate.values.clone();
    selected.iter().zip(&near.x).for_each(|(&i, &v)| values[i] = v);
    let listed = estimate.parameters.iter().chain(&estimate.extra);
    let moved = DVector::from_fn(n, |i, _| near.x[i] - x_hat[i]);
    // On the boundary the slack is small against the size of the body.
    let touches = |b: &Body| {
        let (mass, l) = b.size;
        let f = Matrix4::from_diagonal(&nalgebra::Vector4::new(1.0 / l, 1.0 / l, 1.0 / l, 1.0)) / mass.sqrt();
        (f * b.pseudo(&near.x) * f).symmetric_eigenvalues().min() < 10.0 * options.epsilon
    };
    let mut at_boundary: Vec<String> = cone.bodies.iter().filter(|b| touches(b)).map(|b| b.name.clone()).collect();
    let names: Vec<&str> = listed.clone().map(|p| p.name.as_str()).collect();
    let low = cone.positive.iter().filter(|&&k| near.x[k] < 10.0 * options.epsilon * sizes[k]);
    at_boundary.extend(low.map(|&k| names[k].to_owned()));
    Ok(Projected {
        values,
        unknowns: listed
            .zip(&near.x)
            .map(|(p, &to)| Moved { name: p.name.clone(), unit: p.unit.clone(), from: p.value, to })
            .collect(),
        chi2_increase: (&estimate.equations.r * moved).norm_squared(),
        at_boundary,
        gap: near.gap,
    })
}
