//! The chain as an immutable structure: geometry, declaration, accessors and the tree twin.

use crate::KIND;
use crate::coupling;
use crate::coupling::{Coupling, DAMPING, STIFFNESS};
use crate::segment::Segment;
use ff_model::CoordDecl;
use ff_model::diagnostics::Limit;
use ff_model::port::MAX_COORDS;
use ff_model::port::MAX_PARAMS;
use ff_model::port::{TreeTwin, TwinBody};
use ff_model::spatial::Axis;
use ff_model::spatial::vec3::{Pose, RotationKind, V3};
use ff_model::{Area, Decl, Inertia, ParamDecl, Problem, Problems, Scalar, Xform};
use nalgebra::{DMatrix, Matrix3, Vector3};
use std::f64::consts::PI;

/// Most segments of one chain: one coordinate each.
pub const MAX_SEGMENTS: usize = MAX_COORDS;

/// Geometry of one hinge, made ready for evaluation.
#[derive(Clone, Debug)]
pub(crate) struct Hinge {
    /// Unit axis, in the segment frame and in its parent.
    pub(crate) axis: Axis,
    unit: Vector3<f64>,
    /// Origin in the parent frame (m).
    pos: Vector3<f64>,
    /// Relaxed angle (rad).
    pub(crate) rest: f64,
}

impl Hinge {
    fn new(s: &Segment) -> Self {
        // Scaled first: the square of a tiny or huge component would leave the range of f64.
        let unit = (s.axis / s.axis.amax()).normalize();
        Self { axis: Axis::new(&unit, &Matrix3::identity()), unit, pos: s.hinge, rest: s.rest }
    }

    /// Makes `x`, an identity so far, the pose of the segment in its parent at angle `eta` (rad): a turn about the axis.
    /// `K` is that of the chain, [`PanelChain::about`]. Does not allocate.
    #[inline(always)]
    pub(crate) fn place<T: Scalar, const K: u8>(&self, eta: T, x: &mut Pose<T>) {
        x.p = V3::new(T::from_f64(self.pos.x), T::from_f64(self.pos.y), T::from_f64(self.pos.z));
        self.axis.turn::<T, K>(eta, x);
    }
}

/// A chain of 1 to [`MAX_SEGMENTS`] rigid segments on sprung, damped revolute hinges.
///
/// Parameters, in order: ten inertial per segment about its hinge (`seg[0].mass` ... `seg[n-1].i_zz`), then
/// `k[i]` (N m/rad), then `d[i]` (N m s/rad), then the couplings `k[i,j]` and `d[i,j]`, `i < j`, of
/// [`PanelChain::with_coupling`]. Coordinates: `hinge[i]` (rad), range -pi to pi; the model has
/// no singularity, the range bounds what a panel can do.
///
/// ```
/// # use ff_model::nalgebra::{Matrix3, Vector3};
/// # let inertia_com = Matrix3::new(15.0, 0.7, -0.4, 0.7, 11.0, 0.5, -0.4, 0.5, 16.0);
/// # let (hinge, axis) = (Vector3::new(0.1, 0.3, -0.2), Vector3::new(1.0, 0.1, -0.2));
/// # let segment = flex_panel::Segment::new(33.0, Vector3::new(0.06, 1.07, -0.04), &inertia_com, hinge, axis).with_spring(200.0, 2.0);
/// use flex_panel::PanelChain;
///
/// let wing = PanelChain::new(vec![segment.clone(), segment.with_spring(140.0, 1.3)])?;
/// let decl = ff_model::Appendage::decl(&wing);
/// assert_eq!((decl.coords.len(), decl.params.len()), (2, 2 * 10 + 2 + 2));
/// assert_eq!((decl.params[21].name.as_str(), decl.params[21].nominal), ("k[1]", 140.0));
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug)]
pub struct PanelChain {
    decl: Decl,
    pub(crate) hinges: Vec<Hinge>,
    /// What all hinges turn about, in either direction; [`RotationKind::General`] if they differ.
    pub(crate) about: RotationKind,
    pub(crate) k_pairs: Coupling,
    pub(crate) d_pairs: Coupling,
}

impl PanelChain {
    /// A chain from its segments, from the host outwards. Axes are normalised. Allocates.
    ///
    /// # Errors
    /// Every problem of every segment, all of [`Area::Config`]: `Config::Param` (no or too many segments, rest
    /// angle out of range), `Config::NotPassive` (negative stiffness or damping), `Config::Inertia` (ten numbers
    /// that no body has), `Config::Axis` (zero axis), `Config::NotFinite`.
    pub fn new(segments: Vec<Segment>) -> Result<Self, Problems> {
        let mut problems = Problems::default();
        if segments.is_empty() || segments.len() > MAX_SEGMENTS {
            problems.push(
                Problem::error(
                    Area::Config,
                    "Config::Param",
                    format!("{} segments, outside the limits 1 to {MAX_SEGMENTS}", segments.len()),
                )
                .violating(segments.len() as f64, Limit::Within(1.0, MAX_SEGMENTS as f64), "segments")
                .on("segments")
                .hint("one table per rigid segment, from the host outwards"),
            );
        }
        for (i, s) in segments.iter().enumerate() {
            s.check(i, &mut problems);
        }
        if problems.has_errors() {
            return Err(problems);
        }
        let mut params = Vec::with_capacity(12 * segments.len());
        for (i, s) in segments.iter().enumerate() {
            params.extend(ParamDecl::inertial(&format!("seg[{i}]"), &s.inertia));
        }
        for (i, s) in segments.iter().enumerate() {
            params.push(ParamDecl::positive(format!("k[{i}]"), "N m/rad", s.stiffness));
        }
        for (i, s) in segments.iter().enumerate() {
            params.push(ParamDecl::positive(format!("d[{i}]"), "N m s/rad", s.damping));
        }
        let coords = (0..segments.len()).map(|i| CoordDecl::new(format!("hinge[{i}]"), "rad", (-PI, PI)));
        let hinges: Vec<Hinge> = segments.iter().map(Hinge::new).collect();
        let about = hinges[0].axis.about();
        Ok(Self {
            decl: Decl::new(KIND, coords, params),
            about: if hinges.iter().all(|h| h.axis.about() == about) { about } else { RotationKind::General },
            hinges,
            k_pairs: Coupling::default(),
            d_pairs: Coupling::default(),
        })
    }

    /// The same chain with full symmetric stiffness (N m/rad) and damping (N m s/rad) matrices, `n x n`, whose
    /// diagonals replace `k[i]` and `d[i]`; off-diagonal elements that are not zero become parameters, with bounds inside
    /// which the matrix stays positive semidefinite. Replaces couplings given before. Allocates.
    ///
    /// # Errors
    /// Every problem, all of [`Area::Config`]: `Config::WrongLength`, `Config::NotFinite`, `Config::NotSymmetric`,
    /// `Config::NotPassive` (a matrix that is not positive semidefinite), `Config::TooManyParameters`.
    pub fn with_coupling(mut self, k: &DMatrix<f64>, d: &DMatrix<f64>) -> Result<Self, Problems> {
        let n = self.count();
        let mut problems = Problems::default();
        coupling::check(k, n, STIFFNESS, &mut problems);
        coupling::check(d, n, DAMPING, &mut problems);
        if problems.has_errors() {
            return Err(problems);
        }
        let params = &mut self.decl.params;
        params.truncate(12 * n);
        for i in 0..n {
            for (p, x) in [(10 * n + i, k[(i, i)]), (11 * n + i, d[(i, i)])] {
                params[p].nominal = x;
                params[p].bounds = (0.0, f64::INFINITY);
            }
        }
        self.k_pairs = Coupling::declare(k, STIFFNESS, 10 * n, params);
        self.d_pairs = Coupling::declare(d, DAMPING, 11 * n, params);
        if params.len() > MAX_PARAMS {
            let what = format!("{} parameters, limit {MAX_PARAMS}", params.len());
            let p = Problem::error(Area::Config, "Config::TooManyParameters", what).on("segments");
            let p = p.violating(params.len() as f64, Limit::AtMost(MAX_PARAMS as f64), "parameters");
            return Err(Problems(vec![p.hint("couple fewer hinges: elements that are zero are no parameters")]));
        }
        Ok(self)
    }

    /// Index of the first coupling `k[i,j]` in the parameter slice.
    pub(crate) fn k_pair_offset(&self) -> usize {
        12 * self.count()
    }

    /// Index of the first coupling `d[i,j]` in the parameter slice.
    pub(crate) fn d_pair_offset(&self) -> usize {
        self.k_pair_offset() + self.k_pairs.pairs.len()
    }

    /// Nominal stiffness and damping matrices of the hinges (N m/rad, N m s/rad). Allocates.
    pub fn stiffness_damping(&self) -> (DMatrix<f64>, DMatrix<f64>) {
        let (n, p) = (self.count(), self.nominal());
        let full = |diagonal: usize, first: usize, c: &Coupling| {
            let mut m = DMatrix::from_fn(n, n, |i, j| if i == j { p[diagonal + i] } else { 0.0 });
            for (l, &(i, j)) in c.pairs.iter().enumerate() {
                m[(i, j)] = p[first + l];
                m[(j, i)] = p[first + l];
            }
            m
        };
        (full(10 * n, self.k_pair_offset(), &self.k_pairs), full(11 * n, self.d_pair_offset(), &self.d_pairs))
    }

    /// An empty builder. Allocates.
    pub fn builder() -> PanelBuilder {
        PanelBuilder::default()
    }

    /// Number of segments `n`, which is also the number of coordinates.
    pub fn count(&self) -> usize {
        self.hinges.len()
    }

    /// Coordinates and parameters with their nominal values.
    pub(crate) fn declared(&self) -> &Decl {
        &self.decl
    }

    /// Index of the first of the ten inertial parameters of segment `i` in the parameter slice.
    pub fn inertial_offset(&self, i: usize) -> usize {
        10 * i
    }

    /// Index of `k[i]` in the parameter slice.
    pub fn stiffness_index(&self, i: usize) -> usize {
        10 * self.count() + i
    }

    /// Index of `d[i]` in the parameter slice.
    pub fn damping_index(&self, i: usize) -> usize {
        11 * self.count() + i
    }

    /// Nominal values of all parameters, in the order of the declaration. Allocates.
    pub fn nominal(&self) -> Vec<f64> {
        self.decl.params.iter().map(|p| p.nominal).collect()
    }

    /// Segment `i` with its nominal parameters and unit axis; `None` if there is no such segment.
    pub fn segment(&self, i: usize) -> Option<Segment> {
        self.segment_at(&self.nominal(), i)
    }

    /// Segment `i` at parameters `p`.
    fn segment_at(&self, p: &[f64], i: usize) -> Option<Segment> {
        let h = self.hinges.get(i)?;
        Some(Segment {
            inertia: Inertia::from_params(&p[self.inertial_offset(i)..]),
            hinge: h.pos,
            axis: h.unit,
            stiffness: p[self.stiffness_index(i)],
            damping: p[self.damping_index(i)],
            rest: h.rest,
        })
    }

    /// The chain as ordinary tree links with external springs, at nominal parameters (see [`TwinBody`]). Couplings
    /// between hinges are not in it: [`PanelChain::stiffness_damping`] has them.
    /// Allocates.
    pub fn twin_bodies(&self) -> Vec<TwinBody> {
        self.twin_bodies_at(&self.nominal())
    }

    fn twin_bodies_at(&self, p: &[f64]) -> Vec<TwinBody> {
        (0..self.count())
            .filter_map(|i| self.segment_at(p, i).map(|s| (i, s)))
            .map(|(i, s)| TwinBody {
                parent: i.checked_sub(1),
                axis: s.axis,
                placement: Xform::new(Matrix3::identity(), s.hinge),
                inertia: s.inertia,
                stiffness: s.stiffness,
                damping: s.damping,
                rest: s.rest,
            })
            .collect()
    }
}

impl TreeTwin for PanelChain {
    /// `None` for coupled hinges: a tree joint has its own spring only.
    fn tree_bodies(&self, p: &[f64]) -> Option<Vec<TwinBody>> {
        let plain = self.k_pairs.pairs.is_empty() && self.d_pairs.pairs.is_empty();
        plain.then(|| self.twin_bodies_at(p))
    }
}

ff_model::shared!(PanelChain);

/// Collects segments from the host outwards; see [`PanelChain::builder`].
///
/// ```
/// # use ff_model::nalgebra::{Matrix3, Vector3};
/// # let inertia_com = Matrix3::new(15.0, 0.7, -0.4, 0.7, 11.0, 0.5, -0.4, 0.5, 16.0);
/// # let (hinge, axis) = (Vector3::new(0.1, 0.3, -0.2), Vector3::new(1.0, 0.1, -0.2));
/// # let segment = flex_panel::Segment::new(33.0, Vector3::new(0.06, 1.07, -0.04), &inertia_com, hinge, axis).with_spring(200.0, 2.0);
/// use flex_panel::PanelChain;
///
/// let wing = PanelChain::builder().segment(segment.clone()).segment(segment.clone().with_rest(0.15)).build()?;
/// assert_eq!(ff_model::Appendage::decl(&wing).coords[1].name, "hinge[1]");
/// // Springs that drive instead of restoring are refused.
/// let refused = PanelChain::builder().segment(segment.with_spring(-3.0, 2.0)).build().unwrap_err();
/// assert!(refused.has("Config::NotPassive"));
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct PanelBuilder {
    segments: Vec<Segment>,
}

impl PanelBuilder {
    /// Adds the next segment outwards.
    #[must_use]
    pub fn segment(mut self, s: Segment) -> Self {
        self.segments.push(s);
        self
    }

    /// The chain.
    ///
    /// # Errors
    /// As [`PanelChain::new`].
    pub fn build(self) -> Result<PanelChain, Problems> {
        PanelChain::new(self.segments)
    }
}
