//! Parameters that are functions of fewer unknowns: one stiffness for all hinges, one filling level for all of the fuel.
//!
//! A [`Tie`] replaces some parameters `p` of a model by unknowns `u` of its own, `p = f(u)`. [`Tied`] puts ties before any
//! [`Estimator`]: it shows the fit a shorter list of declarations (what is not tied, then the unknowns of the ties), expands
//! values on the way in and multiplies derivatives by `df/du` on the way out (chain rule, exact). Selection by pattern,
//! priors, bounds, covariance and names work on the shorter list as on any other.
//!
//! [`Affine`] covers shared values, values equal up to a factor, and `p = p0 + B u`; other maps implement [`Tie`].

use crate::compose::substituted::{Substituted, Substitution};
use crate::estimate::along::Direction;
use crate::estimate::estimator::Estimator;
use ff_least_squares::EvalError;
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use ff_model::Inertia;
use ff_model::tree::{SelectionError, select};
use ff_model::{ParamDecl, ParamGroup};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// A differentiable map from unknowns of its own to parameters of the model.
///
/// ```
/// use ff_least_squares::EvalError;
/// use ff_model::ParamDecl;
/// use ident::Tie;
/// use nalgebra::DMatrix;
///
/// /// Mass and length of a slosh pendulum (parameters 20 and 21) as functions of the fill height.
/// struct Fill([ParamDecl; 1]);
/// impl Tie for Fill {
///     fn unknowns(&self) -> &[ParamDecl] { &self.0 }
///     fn parameters(&self) -> &[usize] { &[20, 21] }
///     fn evaluate(&self, u: &[f64], p: &mut [f64]) -> Result<(), EvalError> {
///         (p[0], p[1]) = (640.0 * u[0], 0.9 - 0.5 * u[0]);
///         if p[1] > 0.0 { Ok(()) } else { Err(EvalError::Rejected("the tank is full".into())) }
///     }
///     fn derivative(&self, _: &[f64], d: &mut DMatrix<f64>) -> Result<(), EvalError> {
///         d.copy_from_slice(&[640.0, -0.5]);
///         Ok(())
///     }
/// }
/// let (fill, mut p) = (Fill([ParamDecl::positive("fuel.fill", "m", 0.25)]), [0.0; 2]);
/// fill.evaluate(&[0.25], &mut p)?;
/// assert_eq!(p, [160.0, 0.775]);
/// # Ok::<(), EvalError>(())
/// ```
pub trait Tie: Send + Sync {
    /// Its unknowns: names, units, start values, whether they must stay positive.
    fn unknowns(&self) -> &[ParamDecl];
    /// Indices of the parameters that it determines.
    fn parameters(&self) -> &[usize];
    /// Writes these parameters (in the order of [`Tie::parameters`]) for unknowns `u`.
    ///
    /// # Errors
    /// [`EvalError`] where the map is not defined (an empty tank); the fit then takes a shorter step.
    fn evaluate(&self, u: &[f64], p: &mut [f64]) -> Result<(), EvalError>;
    /// Writes `dp/du`, parameters by unknowns; `d` arrives with the right shape and unspecified contents.
    ///
    /// # Errors
    /// As [`Tie::evaluate`].
    fn derivative(&self, u: &[f64], d: &mut DMatrix<f64>) -> Result<(), EvalError>;
}

/// Why a tie was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TieError {
    /// A pattern matches nothing.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// Members of one shared value have different units.
    #[error("'{name}' ties parameters of different units: {first} and {other}")]
    Units {
        /// The tie.
        name: String,
        /// Unit of its first member.
        first: String,
        /// Another one.
        other: String,
    },
    /// A parameter belongs to two ties, or twice to one.
    #[error("'{parameter}' is tied twice; let one pattern leave it out with a leading '!'")]
    Twice {
        /// The parameter.
        parameter: String,
    },
    /// A name that the model, or another tie, already uses.
    #[error("'{name}' is the name of a parameter already; give the tie another")]
    Name {
        /// The name.
        name: String,
    },
    /// A factor of zero, or a number that is not finite.
    #[error("factor {value} of '{parameter}' must be finite and not zero")]
    Factor {
        /// The parameter.
        parameter: String,
        /// The factor.
        value: f64,
    },
    /// Shapes that do not fit.
    #[error("{0}")]
    Shape(String),
    /// A map that is not defined at its start.
    #[error("'{name}' cannot be evaluated at its start: {reason}")]
    Start {
        /// First unknown of the tie.
        name: String,
        /// Why.
        reason: String,
    },
}

impl TieError {
    /// Process exit code of `bad-inputs.md`: 11 (configuration).
    pub fn exit_code(&self) -> u8 {
        11
    }
}

/// `p = p0 + B u`.
#[derive(Clone, Debug, PartialEq)]
pub struct Affine {
    unknowns: Vec<ParamDecl>,
    parameters: Vec<usize>,
    offset: DVector<f64>,
    matrix: DMatrix<f64>,
}

impl Affine {
    /// Any affine map: `offset` and the rows of `matrix` belong to `parameters`, its columns to `unknowns`.
    ///
    /// # Errors
    /// [`TieError::Shape`].
    pub fn new(
        unknowns: Vec<ParamDecl>,
        parameters: Vec<usize>,
        offset: DVector<f64>,
        matrix: DMatrix<f64>,
    ) -> Result<Self, TieError> {
        let (m, n) = matrix.shape();
        if (m, n) != (parameters.len(), unknowns.len()) || offset.len() != m {
            let (p, u) = (parameters.len(), unknowns.len());
            return Err(TieError::Shape(format!(
                "matrix {m} x {n}, offset {}, for {p} parameters of {u} unknowns",
                offset.len()
            )));
        }
        let finite =
            linalg::check_finite("tie", &matrix).and(linalg::check_finite_slice("tie offset", offset.as_slice()));
        finite.map_err(|e: LinalgError| TieError::Shape(e.to_string()))?;
        Ok(Self { unknowns, parameters, offset, matrix })
    }
    /// One value for every parameter that a pattern matches, such as `panel_*.k[*]`; starts at the mean of their values. The
    /// unknown must stay positive if all of them must.
    ///
    /// # Errors
    /// [`TieError`].
    pub fn shared(decls: &[ParamDecl], values: &[f64], name: &str, patterns: &[&str]) -> Result<Self, TieError> {
        let members: Vec<(&str, f64)> = patterns.iter().map(|p| (*p, 1.0)).collect();
        Self::factors(decls, values, name, &members)
    }
    /// Parameters that are one value up to known factors: `p = factor u`, patterns with their factor. A pattern with a leading `!`
    /// takes out what the ones before it matched.
    ///
    /// # Errors
    /// [`TieError`].
    pub fn factors(decls: &[ParamDecl], values: &[f64], name: &str, members: &[(&str, f64)]) -> Result<Self, TieError> {
        if values.len() != decls.len() {
            return Err(TieError::Shape(format!("{} parameters, but {} values", decls.len(), values.len())));
        }
        let mut tied: Vec<(usize, f64)> = Vec::new();
        for (pattern, factor) in members {
            if let Some(out) = pattern.trim().strip_prefix('!') {
                let out = select(decls, &[out])?;
                tied.retain(|(i, _)| !out.contains(i));
                continue;
            }
            for i in select(decls, &[*pattern])? {
                if tied.iter().any(|(k, _)| *k == i) {
                    return Err(TieError::Twice { parameter: decls[i].name.clone() });
                }
                if !(factor.is_finite() && *factor != 0.0) {
                    return Err(TieError::Factor { parameter: decls[i].name.clone(), value: *factor });
                }
                tied.push((i, *factor));
            }
        }
        let Some(&(first, _)) = tied.first() else { return Err(SelectionError::Empty.into()) };
        let unit = decls[first].unit;
        if let Some((i, _)) = tied.iter().find(|(i, _)| decls[*i].unit != unit) {
            let (first, other) = (unit.to_owned(), decls[*i].unit.to_owned());
            return Err(TieError::Units { name: name.to_owned(), first, other });
        }
        let mean = tied.iter().map(|(i, f)| values[*i] / f).sum::<f64>() / tied.len() as f64;
        // Mass and stiffness are positive alone; a second moment only together with the others.
        let positive = |i: usize| decls[i].group == ParamGroup::Positive || decls[i].unit == "kg";
        let group =
            if tied.iter().all(|&(i, f)| positive(i) && f > 0.0) { ParamGroup::Positive } else { ParamGroup::Free };
        let inf = f64::INFINITY;
        let bounds = if group == ParamGroup::Positive { (0.0, inf) } else { (-inf, inf) };
        let unknown = ParamDecl { name: name.to_owned(), unit, nominal: mean, bounds, group };
        Ok(Self {
            unknowns: vec![unknown],
            offset: DVector::zeros(tied.len()),
            matrix: DMatrix::from_iterator(tied.len(), 1, tied.iter().map(|t| t.1)),
            parameters: tied.into_iter().map(|t| t.0).collect(),
        })
    }
    /// Parameters held at values of their own: no unknown at all.
    ///
    /// # Errors
    /// [`TieError`].
    pub fn fixed(decls: &[ParamDecl], members: &[(&str, f64)]) -> Result<Self, TieError> {
        let mut parameters = Vec::new();
        let mut offset = Vec::new();
        for (pattern, value) in members {
            for i in select(decls, &[*pattern])? {
                if parameters.contains(&i) {
                    return Err(TieError::Twice { parameter: decls[i].name.clone() });
                }
                parameters.push(i);
                offset.push(*value);
            }
        }
        let matrix = DMatrix::zeros(parameters.len(), 0);
        Self::new(vec![], parameters, offset.into(), matrix)
    }
}

impl Tie for Affine {
    fn unknowns(&self) -> &[ParamDecl] {
        &self.unknowns
    }
    fn parameters(&self) -> &[usize] {
        &self.parameters
    }
    fn evaluate(&self, u: &[f64], p: &mut [f64]) -> Result<(), EvalError> {
        for (i, p) in p.iter_mut().enumerate() {
            *p = self.offset[i] + u.iter().enumerate().map(|(k, u)| self.matrix[(i, k)] * u).sum::<f64>();
        }
        Ok(())
    }
    fn derivative(&self, _u: &[f64], d: &mut DMatrix<f64>) -> Result<(), EvalError> {
        d.copy_from(&self.matrix);
        Ok(())
    }
}

/// The map from the shorter parameter vector to the full one.
pub struct TieMap {
    decls: Vec<ParamDecl>,
    /// Full index of each parameter that is not tied.
    free: Vec<usize>,
    ties: Vec<Placed>,
    /// Full vector at the start.
    full: Vec<f64>,
    /// First parameter and name of every body that a tie changes.
    bodies: Vec<(usize, String)>,
}

struct Placed {
    tie: Box<dyn Tie>,
    /// First of its unknowns in the shorter vector.
    at: usize,
}

impl Placed {
    fn own<'u>(&self, short: &'u [f64]) -> &'u [f64] {
        &short[self.at..self.at + self.tie.unknowns().len()]
    }
    fn derivative(&self, short: &[f64]) -> Result<DMatrix<f64>, EvalError> {
        let mut d = DMatrix::zeros(self.tie.parameters().len(), self.tie.unknowns().len());
        self.tie.derivative(self.own(short), &mut d)?;
        Ok(d)
    }
}

impl TieMap {
    /// For a model with these declarations and values. Allocates.
    ///
    /// # Errors
    /// [`TieError`].
    pub fn new(decls: &[ParamDecl], values: &[f64], ties: Vec<Box<dyn Tie>>) -> Result<Self, TieError> {
        if values.len() != decls.len() {
            return Err(TieError::Shape(format!("{} parameters, but {} values", decls.len(), values.len())));
        }
        let mut tied = vec![false; decls.len()];
        for tie in &ties {
            for &i in tie.parameters() {
                let Some(t) = tied.get_mut(i) else {
                    return Err(TieError::Shape(format!("parameter {i} of {} does not exist", decls.len())));
                };
                if std::mem::replace(t, true) {
                    return Err(TieError::Twice { parameter: decls[i].name.clone() });
                }
            }
        }
        let free: Vec<usize> = (0..decls.len()).filter(|&i| !tied[i]).collect();
        let mut short: Vec<ParamDecl> = free.iter().map(|&i| decls[i].clone()).collect();
        let mut placed = Vec::new();
        for tie in ties {
            let at = short.len();
            for u in tie.unknowns() {
                if decls.iter().chain(&short[free.len()..]).any(|d| d.name == u.name) {
                    return Err(TieError::Name { name: u.name.clone() });
                }
                short.push(u.clone());
            }
            placed.push(Placed { tie, at });
        }
        let mut bodies: Vec<(usize, String)> = Vec::new();
        for i in (0..decls.len()).filter(|&i| tied[i]) {
            if let ParamGroup::Inertial(name) = &decls[i].group {
                let first = (0..=i).rev().take_while(|&k| decls[k].group == decls[i].group).last().unwrap_or(i);
                let first = first + (i - first) / 10 * 10;
                if !bodies.iter().any(|b| b.0 == first) && first + 10 <= decls.len() {
                    bodies.push((first, name.clone()));
                }
            }
        }
        let mut map = Self { decls: short, free, ties: placed, full: values.to_vec(), bodies };
        let start = map.start();
        let name = |p: &Placed| p.tie.unknowns().first().map_or_else(String::new, |u| u.name.clone());
        let first = map.ties.first().map_or_else(String::new, name);
        map.full = map.expand(&start).map_err(|e| TieError::Start { name: first, reason: e.to_string() })?;
        Ok(map)
    }
    /// Declarations of the shorter vector: what is not tied, in its old order, then the unknowns of each tie. Parameters that are
    /// not tied keep their nominal value of the model.
    pub fn decls(&self) -> &[ParamDecl] {
        &self.decls
    }
    /// Full indices of the parameters that are not tied, ascending: they come first in the shorter vector, in this order.
    pub fn free(&self) -> &[usize] {
        &self.free
    }
    /// The shorter vector at the start: the values given, and the start of every tie. Allocates.
    pub fn start(&self) -> Vec<f64> {
        let free = self.free.iter().map(|&i| self.full[i]);
        free.chain(self.decls[self.free.len()..].iter().map(|d| d.nominal)).collect()
    }
    /// The full parameter vector. Allocates.
    ///
    /// # Errors
    /// [`EvalError`] where a tie is not defined.
    ///
    /// # Panics
    /// If `short` is not as long as [`TieMap::decls`].
    pub fn expand(&self, short: &[f64]) -> Result<Vec<f64>, EvalError> {
        assert_eq!(short.len(), self.decls.len(), "length of the shorter vector");
        let mut full = self.full.clone();
        self.free.iter().zip(short).for_each(|(&i, &v)| full[i] = v);
        for p in &self.ties {
            let mut own = vec![0.0; p.tie.parameters().len()];
            p.tie.evaluate(p.own(short), &mut own)?;
            p.tie.parameters().iter().zip(own).for_each(|(&i, v)| full[i] = v);
        }
        Ok(full)
    }
    /// `d full / d short` for the selected elements of the shorter vector: full length by selection. Carries a covariance of
    /// the fit to the parameters of the model. Allocates.
    ///
    /// # Errors
    /// As [`TieMap::expand`].
    pub fn jacobian(&self, short: &[f64], selected: &[usize]) -> Result<DMatrix<f64>, EvalError> {
        let mut out = DMatrix::zeros(self.full.len(), selected.len());
        for (c, &s) in selected.iter().enumerate() {
            if let Some(&i) = self.free.get(s) {
                out[(i, c)] = 1.0;
            }
        }
        for p in &self.ties {
            let d = p.derivative(short)?;
            for (c, &s) in selected.iter().enumerate() {
                if s >= p.at && s < p.at + d.ncols() {
                    p.tie.parameters().iter().enumerate().for_each(|(r, &i)| out[(i, c)] = d[(r, s - p.at)]);
                }
            }
        }
        Ok(out)
    }
    /// The first body changed by a tie that is not physical in a full parameter vector.
    ///
    /// # Panics
    /// If the vector is shorter than the full one.
    pub fn inconsistent(&self, full: &[f64]) -> Option<&str> {
        let bad = |i: usize| Inertia::from_params(&full[i..i + 10]).pseudo().cholesky().is_none();
        self.bodies.iter().find(|b| bad(b.0)).map(|b| b.1.as_str())
    }
}

/// An estimator over the shorter vector.
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
/// use ident::compose::{Affine, TieMap};
/// use ident::{Noise, Rda, Request, Tied, estimate};
///
/// // Masses of hull and arm change by one common factor.
/// let scale = Affine::factors(&decls, truth.values(), "density", &[("base.mass", 60.0), ("arm.mass", 8.6)])?;
/// let map = TieMap::new(&decls, truth.values(), vec![Box::new(scale)])?;
/// let mut tied = Tied::new(Rda::new(&robot, &record, &Noise { torque: 0.01, gyro: 1e-5 })?, map);
/// let (short, mut from) = (tied.map().decls().to_vec(), tied.map().start());
/// let density = from.len() - 1;
/// from[density] = 1.1;
/// let fit = estimate(&Request::new(&short, &[density], &from), &mut tied)?;
/// assert!((fit.values[density] - 1.0).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type Tied<E> = Substituted<E, Ties>;

/// Parameters that are functions of the shorter vector.
#[derive(Clone)]
pub struct Ties {
    map: Arc<TieMap>,
    checked: bool,
}

impl<E: Estimator> Tied<E> {
    /// Puts the map before an estimator.
    pub fn new(inner: E, map: impl Into<Arc<TieMap>>) -> Self {
        Self { inner, by: Ties { map: map.into(), checked: true } }
    }
    /// Lets the fit pass through values that no body has on its way. Where ties leave a body little room (its other numbers
    /// known), the way from a start inside to an answer inside may lead outside, and a fit that is kept in stalls at the
    /// boundary. Ask [`TieMap::inconsistent`] about the answer.
    #[must_use]
    pub fn unchecked(mut self) -> Self {
        self.by.checked = false;
        self
    }
    /// The map: its declarations are those to select from, and to give to [`crate::estimate::request::Request`].
    pub fn map(&self) -> &TieMap {
        &self.by.map
    }
}

impl Substitution for Ties {
    fn parameters(&self, short: &[f64]) -> Result<Vec<f64>, EvalError> {
        let full = self.map.expand(short)?;
        match self.map.inconsistent(&full).filter(|_| self.checked) {
            Some(name) => Err(EvalError::Rejected(format!("{name} is not physical here"))),
            None => Ok(full),
        }
    }
    fn values(&self, short: &[f64], extra: &[f64]) -> Result<(Vec<f64>, Vec<f64>), EvalError> {
        Ok((self.parameters(short)?, extra.to_vec()))
    }
    fn slopes(&self, short: &[f64], extra: &[f64]) -> Result<Vec<Direction>, EvalError> {
        let mut out: Vec<Direction> = self.map.free.iter().map(|&i| Direction::of(i)).collect();
        for p in &self.map.ties {
            let d = p.derivative(short)?;
            for column in d.column_iter() {
                let parts = p.tie.parameters().iter().zip(&column).filter(|(_, slope)| **slope != 0.0);
                out.push(Direction(parts.map(|(&i, &slope)| (i, slope)).collect()));
            }
        }
        let full = self.map.full.len();
        out.extend((full..full + extra.len()).map(Direction::of));
        Ok(out)
    }
}
