//! Physical parameters and the unconstrained coordinates in which they are estimated.
//!
//! | group | coordinates | why |
//! |---|---|---|
//! | a whole inertial body | ten log-Cholesky numbers | every point is a body that can exist |
//! | positive | `x = ln p` | never negative; a step is a relative change |
//! | free | `x = p / s`, `s` its size ([`sizes`](crate::parameters::sizes)) | scale only |
//!
//! Log-Cholesky (C. Rucker, P. Wensing, *Smooth parameterization of rigid-body inertia*, IEEE RA-L 7(2), 2022):
//! the pseudo-inertia `[[S, h], [h^T, m]]` is `U U^T` with
//!
//! ```text
//! U = e^a [ e^d1 s12  s13  t1 ]
//!         [  0   e^d2 s23  t2 ]      x = [a, d1, d2, d3, s12, s23, s13, t1, t2, t3]
//!         [  0    0   e^d3 t3 ]
//!         [  0    0    0    1 ]
//! ```
//!
//! so that `m = e^2a`, the centre of mass is `t` (m), and the upper 3 x 3 block A (m) gives the second moments
//! about it, `S_c = m A A^T`. When only some of the ten numbers of a body are selected, consistency cannot be
//! built in: its mass is treated as positive, the others as free, and [`Transform::partial_bodies`] names it.

use crate::parameters::affine::Affine;
use crate::parameters::scale;
use ff_model::Inertia;
use ff_model::Scalar;
use ff_model::{Dual, ParamDecl, ParamGroup};
use nalgebra::{DMatrix, Matrix3, Matrix4, Vector3};

/// Relative size below which a second moment counts as zero: the log of it is then all rounding.
const BOUNDARY: f64 = 1e-10;

/// Why parameters have no coordinates.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TransformError {
    /// The body is a point mass, a rod or a flat plate: consistent, but on the boundary where the logarithm
    /// is infinite.
    #[error(
        "body '{body}' is {shape}: its second moments about the centre of mass are {moments:?} kg m^2, and \
             log-Cholesky needs all three positive; give it some extent in every direction, or leave it out of the estimate"
    )]
    Boundary {
        /// Name of the body.
        body: String,
        /// `a point mass`, `a thin rod` or `a flat plate`.
        shape: &'static str,
        /// Eigenvalues of `S_c`, ascending (kg m^2).
        moments: [f64; 3],
    },
    /// The ten numbers are not those of any body.
    #[error("body '{body}': {reason}; start from a consistent inertia")]
    Inconsistent {
        /// Name of the body.
        body: String,
        /// The broken law.
        reason: String,
    },
    /// A positive parameter is zero or negative.
    #[error("parameter '{name}' is {value} {unit}, but its logarithm is estimated; start from a positive value")]
    NotPositive {
        /// Full name.
        name: String,
        /// Value.
        value: f64,
        /// SI unit.
        unit: &'static str,
    },
    /// A value is NaN or infinite.
    #[error("parameter '{name}' is not finite")]
    NotFinite {
        /// Full name.
        name: String,
    },
    /// Wrong lengths, repeated or unknown indices.
    #[error("{0}")]
    Shape(String),
}

impl TransformError {
    /// Process exit code of `bad-inputs.md`: 11 (configuration).
    pub fn exit_code(&self) -> u8 {
        11
    }
}

/// One block of coordinates; `at` is its first coordinate, which has the same number as its first parameter.
#[derive(Clone, Debug, PartialEq)]
enum Block {
    Body { at: usize, name: String },
    Affine { at: usize, name: String, map: Box<Affine> },
    Log { at: usize },
    Scaled { at: usize, scale: f64 },
    Reciprocal { at: usize, scale: f64 },
}

/// The map between selected physical parameters and unconstrained coordinates; both have [`Transform::dim`]
/// elements, in the order of the selection.
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
/// use ident::Transform;
///
/// // Any coordinates are a body that exists.
/// let hull: Vec<usize> = (0..10).collect();
/// let map = Transform::new(&decls, &hull, truth.values())?;
/// let x: Vec<f64> = map.coordinates(truth.values())?.iter().map(|x| x - 0.7).collect();
/// let body = ff_model::Inertia::from_params(&map.physical(&x));
/// assert!(body.check().is_ok() && body.mass != 60.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Transform {
    selected: Vec<usize>,
    decls: Vec<ParamDecl>,
    blocks: Vec<Block>,
    partial: Vec<String>,
    full: usize,
}

impl Transform {
    /// For the parameters `selected` (ascending indices into `decls`, as from [`crate::parameters::select`]).
    /// `start` is the full parameter vector; it fixes the scale of free parameters and must have coordinates.
    ///
    /// # Errors
    /// Any [`TransformError`].
    pub fn new(decls: &[ParamDecl], selected: &[usize], start: &[f64]) -> Result<Self, TransformError> {
        if start.len() != decls.len() {
            return Err(TransformError::Shape(format!("{} parameters, but {} values", decls.len(), start.len())));
        }
        if !selected.windows(2).all(|w| w[0] < w[1]) || selected.last().is_some_and(|&i| i >= decls.len()) {
            return Err(TransformError::Shape("selected indices must ascend and exist".into()));
        }
        let mine: Vec<ParamDecl> = selected.iter().map(|&i| decls[i].clone()).collect();
        let (mut blocks, mut partial, mut at) = (Vec::new(), Vec::<String>::new(), 0);
        while at < mine.len() {
            let d = &mine[at];
            let ten = selected.get(at + 9).is_some_and(|&last| {
                let first = selected[at];
                last == first + 9
                    && matches!(d.group, ParamGroup::Inertial(_))
                    && decls[first..=last].iter().all(|o| o.group == d.group)
            });
            at += match &d.group {
                ParamGroup::Inertial(body) if ten => {
                    blocks.push(Block::Body { at, name: body.clone() });
                    10
                }
                group => {
                    if let ParamGroup::Inertial(body) = group
                        && !partial.contains(body)
                    {
                        partial.push(body.clone());
                    }
                    let mass = matches!(group, ParamGroup::Inertial(_)) && d.unit == "kg";
                    if mass || *group == ParamGroup::Positive {
                        blocks.push(Block::Log { at });
                    } else {
                        blocks.push(Block::Scaled { at, scale: scale::of_one(d, start[selected[at]]) });
                    }
                    1
                }
            };
        }
        let t = Self { selected: selected.to_vec(), decls: mine, blocks, partial, full: decls.len() };
        t.coordinates(start)?;
        Ok(t)
    }
    /// As [`Transform::new`], but with whole bodies in affine coordinates around `start` (`crate::parameters::affine`) and
    /// positive parameters divided by their start.
    ///
    /// The equations of motion are linear in inertial parameters, stiffness and damping together, so valleys of
    /// the cost (a heavier panel on a stiffer hinge) are straight here and curved in logarithms: a least-squares
    /// solver takes far longer steps. Steps shorter than 1 stay physical; whoever goes further must
    /// refuse points where [`Transform::inconsistent`] names a body.
    ///
    /// # Errors
    /// Any [`TransformError`].
    pub fn affine(decls: &[ParamDecl], selected: &[usize], start: &[f64]) -> Result<Self, TransformError> {
        Self::mixed(decls, selected, start, |_, _| true)
    }
    /// As [`Transform::affine`] for those blocks that `straight` names by their first coordinate and their length, as
    /// [`Transform::new`] for the others.
    pub(crate) fn mixed(
        decls: &[ParamDecl],
        selected: &[usize],
        start: &[f64],
        straight: impl Fn(usize, usize) -> bool,
    ) -> Result<Self, TransformError> {
        let mut t = Self::new(decls, selected, start)?;
        for b in &mut t.blocks {
            let own = match b {
                Block::Body { at, .. } | Block::Affine { at, .. } => (*at, 10),
                Block::Log { at } | Block::Scaled { at, .. } | Block::Reciprocal { at, .. } => (*at, 1),
            };
            if !straight(own.0, own.1) {
                continue;
            }
            if let Block::Body { at, name } = b {
                let i = selected[*at];
                if let Some(map) = Affine::around(&Inertia::from_params(&start[i..i + 10])) {
                    *b = Block::Affine { at: *at, name: name.clone(), map: Box::new(map) };
                }
            } else if let Block::Log { at } = b {
                *b = Block::Scaled { at: *at, scale: start[selected[*at]] };
            }
        }
        Ok(t)
    }
    /// With the scale of every parameter that has one at least as large as its size in `full`: a parameter that a fit has
    /// brought close to zero is then measured by where it came from, and finds its way back, or across, in as many steps.
    #[must_use]
    pub(crate) fn scaled_at_least(mut self, full: &[f64]) -> Self {
        for b in &mut self.blocks {
            if let Block::Scaled { at, scale } = b {
                *scale = scale.max(scale::of_one(&self.decls[*at], full[self.selected[*at]]));
            }
        }
        self
    }
    /// With the reciprocals of the parameters at these places of the selection as coordinates, scaled so that 1 is where `full` has them: the
    /// compliances of springs in a row (`crate::parameters::springs`).
    #[must_use]
    pub(crate) fn reciprocal(mut self, which: &[usize], full: &[f64]) -> Self {
        for b in &mut self.blocks {
            if let Block::Scaled { at, .. } = *b
                && which.contains(&at)
            {
                *b = Block::Reciprocal { at, scale: full[self.selected[at]] };
            }
        }
        self
    }
    /// The first selected body that is not physical (pseudo-inertia not positive definite) or parameter that is
    /// not positive although it must be, by name, in a full parameter vector. Always `None` at points of
    /// [`Transform::new`].
    pub fn inconsistent(&self, full: &[f64]) -> Option<&str> {
        let mut k = 0;
        while k < self.dim() {
            let whole = match (&self.decls[k].group, self.decls.get(k + 9)) {
                (ParamGroup::Inertial(body), Some(last)) if last.group == self.decls[k].group => Some(body),
                _ => None,
            };
            if let Some(body) = whole {
                let i = self.selected[k];
                let pseudo = Inertia::from_params(&full[i..i + 10]).pseudo();
                if pseudo.cholesky().is_none() {
                    return Some(body);
                }
            }
            let d = &self.decls[k];
            if whole.is_none() && d.group == ParamGroup::Positive && full[self.selected[k]] <= 0.0 {
                return Some(&d.name);
            }
            k += if whole.is_some() { 10 } else { 1 };
        }
        None
    }
    /// Number of coordinates = number of selected parameters.
    pub fn dim(&self) -> usize {
        self.selected.len()
    }
    /// Indices of the selected parameters in the full vector.
    pub fn selected(&self) -> &[usize] {
        &self.selected
    }
    /// Declarations of the selected parameters.
    pub fn decls(&self) -> &[ParamDecl] {
        &self.decls
    }
    /// Bodies of which only a part is estimated, so that nothing keeps them consistent.
    pub fn partial_bodies(&self) -> &[String] {
        &self.partial
    }
    /// Names of the coordinates, such as `ln panel_left.k[0]` or `base:d1`. Allocates.
    pub fn coordinate_names(&self) -> Vec<String> {
        const TEN: [&str; 10] = ["a", "d1", "d2", "d3", "s12", "s23", "s13", "t1", "t2", "t3"];
        let mut out = Vec::with_capacity(self.dim());
        for b in &self.blocks {
            match b {
                Block::Body { name, .. } => out.extend(TEN.iter().map(|c| format!("{name}:{c}"))),
                Block::Affine { name, .. } => out.extend((0..10).map(|k| format!("{name}:S{k}"))),
                Block::Log { at } => out.push(format!("ln {}", self.decls[*at].name)),
                Block::Scaled { at, scale } => out.push(format!("{} / {scale}", self.decls[*at].name)),
                Block::Reciprocal { at, scale } => out.push(format!("{scale} / {}", self.decls[*at].name)),
            }
        }
        out
    }
    /// Coordinates of the selected part of a full parameter vector (inverse map). Allocates.
    ///
    /// # Errors
    /// [`TransformError`] naming the body or parameter that has none.
    pub fn coordinates(&self, full: &[f64]) -> Result<Vec<f64>, TransformError> {
        if full.len() != self.full {
            return Err(TransformError::Shape(format!("{} parameters, but {} values", self.full, full.len())));
        }
        let p: Vec<f64> = self.selected.iter().map(|&i| full[i]).collect();
        if let Some(k) = p.iter().position(|v| !v.is_finite()) {
            return Err(TransformError::NotFinite { name: self.decls[k].name.clone() });
        }
        let mut x = vec![0.0; p.len()];
        for b in &self.blocks {
            match b {
                Block::Affine { at, map, .. } => {
                    x[*at..at + 10].copy_from_slice(&map.coordinates(&Inertia::from_params(&p[*at..at + 10])));
                }
                Block::Body { at, name } => {
                    x[*at..at + 10].copy_from_slice(&log_cholesky(name, &Inertia::from_params(&p[*at..at + 10]))?);
                }
                Block::Log { at } if p[*at] > 0.0 => x[*at] = p[*at].ln(),
                Block::Log { at } => {
                    let d = &self.decls[*at];
                    return Err(TransformError::NotPositive { name: d.name.clone(), value: p[*at], unit: d.unit });
                }
                Block::Scaled { at, scale } => x[*at] = p[*at] / scale,
                Block::Reciprocal { at, scale } => x[*at] = scale / p[*at],
            }
        }
        Ok(x)
    }
    /// Writes the physical values at `x` into the selected places of `full` (forward map). Does not allocate.
    ///
    /// # Panics
    /// If `x` or `full` has another length than at construction.
    pub fn apply(&self, x: &[f64], full: &mut [f64]) {
        assert_eq!((x.len(), full.len()), (self.dim(), self.full), "lengths of coordinates and parameters");
        for b in &self.blocks {
            match b {
                Block::Affine { at, map, .. } => {
                    for (k, v) in map.body(&x[*at..at + 10]).to_params().iter().enumerate() {
                        full[self.selected[at + k]] = *v;
                    }
                }
                Block::Body { at, .. } => {
                    let phi = inertia_of(&core::array::from_fn(|k| x[at + k])).to_params();
                    for (k, v) in phi.iter().enumerate() {
                        full[self.selected[at + k]] = *v;
                    }
                }
                Block::Log { at } => full[self.selected[*at]] = x[*at].exp(),
                Block::Scaled { at, scale } => full[self.selected[*at]] = x[*at] * scale,
                Block::Reciprocal { at, scale } => full[self.selected[*at]] = scale / x[*at],
            }
        }
    }
    /// Physical values of the selected parameters at `x`. Allocates.
    ///
    /// # Panics
    /// If `x` has another length than at construction.
    pub fn physical(&self, x: &[f64]) -> Vec<f64> {
        let mut full = vec![0.0; self.full];
        self.apply(x, &mut full);
        self.selected.iter().map(|&i| full[i]).collect()
    }
    /// Exact Jacobian `d physical / d x` (dim x dim, block-diagonal) at `x`. Allocates the matrix.
    ///
    /// # Panics
    /// If `x` has another length than at construction.
    pub fn jacobian(&self, x: &[f64]) -> DMatrix<f64> {
        assert_eq!(x.len(), self.dim(), "length of the coordinates");
        let mut out = DMatrix::zeros(x.len(), x.len());
        self.for_each_block(x, |at, n, block| {
            for i in 0..n {
                for k in 0..n {
                    out[(at + i, at + k)] = block[(i, k)];
                }
            }
        });
        out
    }
    /// Gradient of `ln |det (d physical / d x)|`, which is linear in x: 1 for a logarithm, `20 a + 2 d1 + 3 d2 + 4 d3` for log-Cholesky
    /// numbers (`P = U U^T` has the determinant `2^4 prod_k U_kk^k`, and U over x that of `e^(10 a + d1 + d2 + d3)`), 0 for coordinates
    /// that are linear in the parameters. Allocates.
    pub fn log_volume_slope(&self) -> Vec<f64> {
        let mut out = vec![0.0; self.dim()];
        for b in &self.blocks {
            match b {
                Block::Body { at, .. } => out[*at..at + 4].copy_from_slice(&[20.0, 2.0, 3.0, 4.0]),
                Block::Log { at } => out[*at] = 1.0,
                // Reciprocals, of which it is not linear, are coordinates of fits alone.
                Block::Affine { .. } | Block::Scaled { .. } | Block::Reciprocal { .. } => {}
            }
        }
        out
    }
    /// Turns derivatives with respect to the selected physical parameters (columns of `j`, m x dim) into
    /// derivatives with respect to the coordinates, in place: `J <- J (d physical / d x)`, block by block,
    /// m * 10 operations per column instead of m * dim.
    ///
    /// # Panics
    /// If `x` or the width of `j` differs from the dimension.
    pub fn chain(&self, x: &[f64], j: &mut DMatrix<f64>) {
        assert_eq!((x.len(), j.ncols()), (self.dim(), self.dim()), "coordinates and columns");
        self.for_each_block(x, |at, n, block| {
            if n == 1 {
                j.column_mut(at).scale_mut(block[(0, 0)]);
                return;
            }
            for mut row in j.columns_mut(at, n).row_iter_mut() {
                let old: [f64; 10] = core::array::from_fn(|i| row[i]);
                for k in 0..n {
                    row[k] = (0..n).map(|i| old[i] * block[(i, k)]).sum();
                }
            }
        });
    }
    fn for_each_block(&self, x: &[f64], mut f: impl FnMut(usize, usize, &nalgebra::SMatrix<f64, 10, 10>)) {
        let mut m = nalgebra::SMatrix::<f64, 10, 10>::zeros();
        for b in &self.blocks {
            let (at, n) = match b {
                Block::Affine { at, map, .. } => {
                    m = map.jacobian();
                    (*at, 10)
                }
                Block::Body { at, .. } => {
                    let dual = core::array::from_fn(|k| Dual::<f64, 10>::variable(x[at + k], k));
                    for (i, p) in inertia_of(&dual).to_params().iter().enumerate() {
                        for k in 0..10 {
                            m[(i, k)] = p.eps[k];
                        }
                    }
                    (*at, 10)
                }
                Block::Log { at } => {
                    m[(0, 0)] = x[*at].exp();
                    (*at, 1)
                }
                Block::Scaled { at, scale } => {
                    m[(0, 0)] = *scale;
                    (*at, 1)
                }
                Block::Reciprocal { at, scale } => {
                    m[(0, 0)] = -scale / x[*at].powi(2);
                    (*at, 1)
                }
            };
            f(at, n, &m);
        }
    }
    /// The declared bounds of positive and free parameters as bounds of the coordinates, for
    /// [`ff_least_squares::Settings::bounds`]; those of whole bodies are not boxes there and are left infinite. Allocates.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        let mut out = vec![(f64::NEG_INFINITY, f64::INFINITY); self.dim()];
        for b in &self.blocks {
            match b {
                Block::Body { .. } | Block::Affine { .. } => {}
                Block::Log { at } => {
                    let (lo, hi) = self.decls[*at].bounds;
                    out[*at] = (if lo > 0.0 { lo.ln() } else { f64::NEG_INFINITY }, hi.ln());
                }
                Block::Scaled { at, scale } => {
                    let (lo, hi) = self.decls[*at].bounds;
                    out[*at] = (lo / scale, hi / scale);
                }
                Block::Reciprocal { at, scale } => {
                    let (lo, hi) = self.decls[*at].bounds;
                    out[*at] = (scale / hi, if lo > 0.0 { scale / lo } else { f64::INFINITY });
                }
            }
        }
        out
    }
    /// Names and physical values at `x`, for messages ([`ff_least_squares::Problem::describe`]). Allocates.
    pub fn describe(&self, x: &[f64]) -> Vec<(String, f64)> {
        self.decls.iter().map(|d| d.name.clone()).zip(self.physical(x)).collect()
    }
}

/// The body with the ten coordinates `x`; see the module documentation.
pub fn inertia_of<T: Scalar>(x: &[T; 10]) -> Inertia<T> {
    let z = T::zero();
    let u = Matrix4::new(
        x[1].exp(),
        x[4],
        x[6],
        x[7], //
        z,
        x[2].exp(),
        x[5],
        x[8], //
        z,
        z,
        x[3].exp(),
        x[9], //
        z,
        z,
        z,
        T::one(),
    );
    let scale = x[0].scale(2.0).exp();
    Inertia::from_pseudo(&((u * u.transpose()) * scale))
}

/// The ten log-Cholesky coordinates of a body.
///
/// # Errors
/// [`TransformError::Boundary`] or [`TransformError::Inconsistent`] with the name given.
pub fn log_cholesky(name: &str, body: &Inertia<f64>) -> Result<[f64; 10], TransformError> {
    let wrong = |reason: String| TransformError::Inconsistent { body: name.to_owned(), reason };
    body.check().map_err(|e| wrong(e.to_string()))?;
    let m = body.mass;
    let t: Vector3<f64> = body.h / m;
    let s = body.pseudo().fixed_view::<3, 3>(0, 0) / m - t * t.transpose();
    let mut moments: [f64; 3] = (s * m).symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    // A point mass far from the origin leaves rounding of size |t|^2, so compare with that as well.
    let limit = m * BOUNDARY * (s.trace().abs() + 1e-4 * t.norm_squared());
    let shape = match moments.iter().filter(|&&e| e <= limit).count() {
        0 => None,
        1 => Some("a flat plate"),
        2 => Some("a thin rod"),
        _ => Some("a point mass"),
    };
    if let Some(shape) = shape {
        return Err(TransformError::Boundary { body: name.to_owned(), shape, moments });
    }
    // S_c / m = A A^T with A upper triangular, from the last row up.
    let mut a = Matrix3::zeros();
    for j in (0..3).rev() {
        let d: f64 = s[(j, j)] - (j + 1..3).map(|k| a[(j, k)] * a[(j, k)]).sum::<f64>();
        if d <= 0.0 {
            return Err(wrong(format!("its pseudo-inertia is not positive definite (pivot {d:.3e} m^2)")));
        }
        a[(j, j)] = d.sqrt();
        for i in 0..j {
            let off: f64 = s[(i, j)] - (j + 1..3).map(|k| a[(i, k)] * a[(j, k)]).sum::<f64>();
            a[(i, j)] = off / a[(j, j)];
        }
    }
    Ok([0.5 * m.ln(), a[(0, 0)].ln(), a[(1, 1)].ln(), a[(2, 2)].ln(), a[(0, 1)], a[(1, 2)], a[(0, 2)], t.x, t.y, t.z])
}
