//! One interface for every way of comparing a record with a model, and the fit that they share.
//!
//! An estimator predicts what the sensors should have read for given parameters, with exact derivatives.
//! [`estimate`] adds priors and nuisance unknowns, minimises with [`ff_least_squares::lm`] over physical values only, and
//! says how well each parameter is known.
//!
//! Bodies are estimated in their inertial parameters, in which records are nearly linear, and steps that
//! would leave the physical bodies are refused and shortened. In log-Cholesky coordinates, where every point is
//! physical, the same fit of the flexible case creeps along curved valleys (`docs/decisions/0004-coordinates.md`).

use crate::belief::covariance::{Unknown, analyse};
use crate::belief::prior::Priors;
use crate::estimate::fit::{Evaluated, Fit, Reference};
use crate::estimate::outcome::{Estimate, EstimateError, Estimated, RANK_TOLERANCE};
use crate::parameters::scale;
use crate::parameters::transform::{Transform, TransformError};
use crate::solve::loss::Loss;
use ff_least_squares::{Criterion, EvalError, Linearise, LmError, Scale, Settings, Status, minimise_linearised};
use ff_model::ParamDecl;
use nalgebra::DMatrix;

/// A cheaper look at the same data ([`Estimator::coarse`]).
pub struct Coarse<'a> {
    /// Over some of the rows, with the same parameters and nuisance.
    pub estimator: Box<dyn Estimator + 'a>,
    /// Which of the rows they are, ascending.
    pub rows: Vec<usize>,
}

/// A way of predicting a record. Residuals are whitened: divided by the standard deviation of the sensor.
///
/// ```
/// use ff_least_squares::EvalError;
/// use ff_model::ParamDecl;
/// use ident::{Estimator, Request, estimate};
/// use nalgebra::DMatrix;
///
/// /// A stiffness from a static test: deflections under three torques, read to 1 mrad.
/// struct Static([(f64, f64); 3]);
/// impl Estimator for Static {
///     fn rows(&self) -> usize { 3 }
///     fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
///         r.iter_mut().zip(self.0).for_each(|(r, (torque, angle))| *r = (torque / p[0] - angle) / 1e-3);
///         Ok(())
///     }
///     fn jacobian(&mut self, p: &[f64], e: &[f64], _: &[usize], r: &mut [f64], j: &mut DMatrix<f64>) -> Result<(), EvalError> {
///         (0..3).for_each(|i| j[(i, 0)] = -self.0[i].0 / p[0].powi(2) / 1e-3);
///         self.residuals(p, e, r)
///     }
/// }
/// let k = [ParamDecl::positive("hinge.k", "N m/rad", 150.0)];
/// let fit = estimate(&Request::new(&k, &[0], &[150.0]), &mut Static([(5.0, 0.025), (9.0, 0.0449), (14.0, 0.0701)]))?;
/// assert!((fit.values[0] - 200.0).abs() < 1.0);
/// # Ok::<(), ident::EstimateError>(())
/// ```
pub trait Estimator {
    /// Number of residuals, the same for every call.
    fn rows(&self) -> usize;
    /// Unknowns besides the parameters of the model (biases, initial state); their `size` is the scale of a
    /// relevant change, and their start value is zero.
    fn nuisance(&self) -> Vec<Unknown> {
        Vec::new()
    }
    /// Whitened residuals `(model - measured) / sigma` into `r` ([`Estimator::rows`] long).
    ///
    /// `full` is the full parameter vector of the model, `extra` the nuisance values.
    ///
    /// # Errors
    /// [`EvalError`].
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError>;
    /// Residuals and their derivatives: columns are `selected` (indices into the full vector), then nuisance.
    /// `j` arrives with the right shape and unspecified contents.
    ///
    /// # Errors
    /// [`EvalError`].
    fn jacobian(
        &mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError>;
    /// The same over so much less data that it takes a fraction of the time, if there is enough of it: [`estimate`] takes the way
    /// there and does the last steps with all of it. `full` is about where it will be used. `None` unless overridden.
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        let _ = full;
        None
    }
}

/// What points to an estimator is one.
macro_rules! pointer {
    ($pointer:ty) => {
        impl<E: Estimator + ?Sized> Estimator for $pointer {
            fn rows(&self) -> usize {
                (**self).rows()
            }
            fn nuisance(&self) -> Vec<Unknown> {
                (**self).nuisance()
            }
            fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
                (**self).residuals(full, extra, r)
            }
            fn jacobian(
                &mut self,
                full: &[f64],
                extra: &[f64],
                selected: &[usize],
                r: &mut [f64],
                j: &mut DMatrix<f64>,
            ) -> Result<(), EvalError> {
                (**self).jacobian(full, extra, selected, r, j)
            }
            fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
                (**self).coarse(full)
            }
        }
    };
}
pointer!(Box<E>);
pointer!(&mut E);

/// What to estimate, from where, with what prior knowledge.
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
/// use ident::{Loss, Noise, Rda, Request, estimate};
///
/// // Mass and arm inertia, 30 % prior width, outliers weighted down.
/// let selected = robot.parameter_indices("base.mass")?;
/// let request = Request { prior_width: Some(0.3), loss: Loss::HUBER, ..Request::new(&decls, &selected, &start) };
/// let mut rda = Rda::new(&robot, &record, &Noise { torque: 0.01, gyro: 1e-5 })?;
/// assert!((estimate(&request, &mut rda)?.values[0] - 60.0).abs() < 0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Request<'a> {
    /// Declarations of all parameters of the model.
    pub decls: &'a [ParamDecl],
    /// Indices of the parameters to estimate, ascending.
    pub selected: &'a [usize],
    /// Full parameter vector to start from; those not selected stay as they are here.
    pub start: &'a [f64],
    /// What [`Request::prior_width`] is measured from, when it is not the start (a fit that goes on from another's end).
    pub centre: Option<&'a [f64]>,
    /// Prior knowledge of selected parameters.
    pub priors: Priors,
    /// Prior knowledge of everything selected at once: relative standard deviation around the start (0.3 is
    /// 30 %), bodies measured in the affine-invariant metric. `None` for none.
    pub prior_width: Option<f64>,
    /// Holds directions that neither data nor priors determine near where they are, without biasing the
    /// others: a pull of this relative width that is re-centred at each estimate until it moves nothing
    /// (proximal point method). `None` leaves such directions to drift.
    pub anchor: Option<f64>,
    /// What a residual costs. Priors and anchors are squares whatever is asked for here.
    pub loss: Loss,
    /// Take the way to the answer over less data, where the estimator offers that ([`Estimator::coarse`]). The answer and its
    /// deviations are those of all data either way.
    pub coarse: bool,
    /// When to stop.
    pub settings: Settings,
}

impl<'a> Request<'a> {
    /// These parameters from this start, with the data alone: no priors, no anchor, default settings.
    pub fn new(decls: &'a [ParamDecl], selected: &'a [usize], start: &'a [f64]) -> Self {
        Self {
            decls,
            selected,
            start,
            centre: None,
            priors: Priors::default(),
            prior_width: None,
            anchor: None,
            loss: Loss::Squares,
            coarse: true,
            settings: Settings::default(),
        }
    }
}

/// Longest step in affine coordinates. Coordinates are taken anew around every estimate, so that a step below 1
/// always leads to physical values, and a body close to the boundary is approached, never crossed.
const RADIUS: f64 = 0.5;
/// Relative move below which it has no more to give.
const ANCHOR_MOVED: f64 = 1e-10;

/// Fits the selected parameters of `request` with `estimator`. Allocates the Jacobian and its factors.
///
/// # Errors
/// [`EstimateError`]. A fit that stalls or meets its iteration limit is returned with that
/// [`Estimate::status`], not as an error.
pub fn estimate<E: Estimator + ?Sized>(request: &Request<'_>, estimator: &mut E) -> Result<Estimate, EstimateError> {
    if !request.loss.is_valid() {
        return Err(EstimateError::Loss(request.loss));
    }
    let extra = estimator.nuisance();
    let n = request.selected.len();
    let sizes_extra: Vec<f64> = extra.iter().map(|u| u.size).collect();
    let fixed = match request.prior_width {
        Some(w) => Some(Reference::new(request.decls, request.selected, request.centre.unwrap_or(request.start), w)?),
        None => None,
    };
    let mut references: Vec<Reference> = fixed.into_iter().collect();
    let mut place = Place { full: request.start.to_vec(), nuisance: vec![0.0; extra.len()], iterations: 0 };
    if request.coarse {
        approach(request, estimator, &sizes_extra, &mut references, &mut place);
    }
    let mut evaluated = Evaluated::default();
    let (transform, status) =
        settle(request, estimator, &sizes_extra, &mut references, &mut place, &mut evaluated, ANCHOR_MOVED)?;
    let Place { full, nuisance, iterations } = place;
    let values_extra: Vec<f64> = nuisance.iter().zip(&sizes_extra).map(|(x, s)| x * s).collect();
    let rows = estimator.rows();
    let selected = transform.selected();
    let at_solution = |e: EvalError| LmError::Setup(e.to_string());
    // The last linearisation is the one at the solution, unless the last step was refused after it.
    let at = evaluated.at(estimator, selected, &full, &values_extra, request.loss).map_err(at_solution)?;
    let mut data = at.information()?;
    let residuals = core::mem::take(&mut at.residuals);
    // What a loss leaves of the information.
    data.unscale_mut(request.loss.inflation(&residuals).sqrt());
    let values = full;
    let sizes = scale::sizes(request.decls, &values);
    let mut unknowns = Unknown::of_parameters(request.decls, selected, &sizes);
    unknowns.extend(extra.iter().cloned());
    let data_only = analyse(&data, &unknowns, RANK_TOLERANCE)?;
    let uncertainty = if request.priors.is_empty() && references.is_empty() {
        data_only.clone()
    } else {
        let known = request.priors.len() + n * references.len();
        let mut tail = DMatrix::zeros(known, n);
        request.priors.fill_jacobian(&mut tail, 0);
        for (k, r) in references.iter().enumerate() {
            let rows = r.jacobian(&values).map_err(at_solution)?;
            tail.rows_mut(request.priors.len() + k * n, n).copy_from(&rows);
        }
        let from = data.nrows();
        let mut both = data.resize_vertically(from + known, 0.0);
        both.view_mut((from, 0), (known, n)).copy_from(&tail);
        analyse(&both, &unknowns, RANK_TOLERANCE)?
    };
    let chi2: f64 = residuals.iter().map(|r| r * r).sum();
    let mut known = Vec::new();
    request.priors.push_residuals(&selected.iter().map(|&i| values[i]).collect::<Vec<_>>(), &mut known);
    for r in &references {
        known.extend(r.residuals(&values).map_err(at_solution)?);
    }
    let objective =
        residuals.iter().map(|&r| request.loss.rho(r)).sum::<f64>() + known.iter().map(|r| r * r).sum::<f64>();
    let dof = rows.saturating_sub(data_only.rank).max(1);
    let listed = |k: usize, start: f64, value: f64| Estimated {
        name: unknowns[k].name.clone(),
        unit: unknowns[k].unit.clone(),
        start,
        value,
        std: uncertainty.deviation[k],
    };
    Ok(Estimate {
        parameters: selected.iter().enumerate().map(|(k, &i)| listed(k, request.start[i], values[i])).collect(),
        nuisance: values_extra.iter().enumerate().map(|(k, &v)| listed(n + k, 0.0, v)).collect(),
        values,
        status,
        chi2_per_dof: chi2 / dof as f64,
        objective,
        data_only,
        uncertainty,
        iterations,
        residuals,
    })
}

/// Where a fit is: all parameters, nuisance unknowns over their sizes, and the linearisations it took.
#[derive(Clone)]
struct Place {
    full: Vec<f64>,
    nuisance: Vec<f64>,
    iterations: usize,
}

/// Minimises from `place` on, with the coordinates taken anew at every step, and leaves it at the end. `references` are those of priors;
/// an anchor is added and taken out again, and has no more to give when a step moves less than `still`.
fn settle<E: Estimator + ?Sized>(
    request: &Request<'_>,
    estimator: &mut E,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
    evaluated: &mut Evaluated,
    still: f64,
) -> Result<(Transform, Status), EstimateError> {
    let (n, priors_kept) = (request.selected.len(), references.len());
    // The limit is that of a pass: cheap linearisations of thinner records do not use up those of all data.
    let limit = place.iterations + request.settings.max_iterations;
    let mut settings = Settings {
        scale: Scale::Unit,
        initial_radius: RADIUS,
        max_radius: RADIUS,
        max_iterations: 1,
        acceleration: true,
        chord: true,
        ..request.settings.clone()
    };
    let mut last = None;
    let end = loop {
        // Coordinates around the present estimate: linear in the bodies, scaled by them.
        let transform = match (Transform::affine(request.decls, request.selected, &place.full), last.take()) {
            (Ok(t), _) => t,
            // The fit has pressed a body against the boundary of what is physical: that is the answer.
            (Err(TransformError::Boundary { .. }), Some(t)) => {
                break (t, Status::AtBound { at: Vec::new(), by: Criterion::Step });
            }
            (Err(e), _) => return Err(e.into()),
        };
        references.truncate(priors_kept);
        if let Some(w) = request.anchor {
            references.push(Reference::new(request.decls, request.selected, &place.full, w)?);
        }
        let mut x = transform.coordinates(&place.full)?;
        x.extend_from_slice(&place.nuisance);
        let full = place.full.clone();
        let mut fit = Fit::new(request, &mut *estimator, &transform, references, sizes, (&x, &full), evaluated);
        let solution = minimise_linearised(&mut fit, &x, &settings)?;
        place.iterations += solution.iterations;
        settings.initial_radius = solution.radius.min(RADIUS);
        place.nuisance.copy_from_slice(&solution.x[n..]);
        if solution.x[..n] != x[..n] {
            transform.apply(&solution.x[..n], &mut place.full);
        }
        let moved = solution.x.iter().zip(&x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let settled = solution.status.is_converged() && (request.anchor.is_none() || moved < still);
        let over = place.iterations >= limit;
        if settled || over || matches!(solution.status, Status::Stalled { .. }) {
            break (transform, solution.status);
        }
        last = Some(transform);
    };
    references.truncate(priors_kept);
    Ok(end)
}

/// Relative reduction of the cost below which a pass over less data has done its part: a hundred times that of the pass it is for,
/// within these bounds.
const APPROACHED: (f64, f64) = (1e-4, 1e-2);

/// Takes the start to where less data say that the answer is, if there is such a look at them and all data agree that it is better there.
/// What goes wrong on the way is no error: the start stays as it was.
fn approach<E: Estimator + ?Sized>(
    request: &Request<'_>,
    estimator: &mut E,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
) {
    let Some(mut thin) = estimator.coarse(&place.full) else { return };
    let settings = Settings {
        decrement_tolerance: (100.0 * request.settings.decrement_tolerance).clamp(APPROACHED.0, APPROACHED.1),
        max_iterations: request.settings.max_iterations / 2,
        ..request.settings.clone()
    };
    let lax = Request { settings, ..request.clone() };
    let mut there = place.clone();
    approach(&lax, &mut *thin.estimator, sizes, references, &mut there);
    let end =
        settle(&lax, &mut *thin.estimator, sizes, references, &mut there, &mut Evaluated::default(), f64::INFINITY);
    drop(thin);
    place.iterations = there.iterations;
    if !end.is_ok_and(|(_, status)| status.is_converged()) {
        return;
    }
    let mut cost = |at: &Place| -> Option<f64> {
        let transform = Transform::affine(request.decls, request.selected, &at.full).ok()?;
        let mut x = transform.coordinates(&at.full).ok()?;
        x.extend_from_slice(&at.nuisance);
        let (mut new, origin) = (Evaluated::default(), (&x[..], &at.full[..]));
        let mut fit = Fit::new(request, &mut *estimator, &transform, references, sizes, origin, &mut new);
        let mut r = Vec::new();
        let tried = fit.residuals(&x, &mut r).ok()?;
        tried.ok().map(|()| r.iter().map(|r| r * r).sum())
    };
    if let (Some(before), Some(after)) = (cost(place), cost(&there))
        && after < before
    {
        *place = there;
    }
}
