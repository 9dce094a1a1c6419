//! What disturbs the joint motion: joints that give way, encoders that are late, oscillators beside the robot, and what acts on the base.
//!
//! Behind an elastic joint with its encoder on the motor's side the link is at
//!
//! ```text
//! q_link(t) = q(t) - c tau(t)
//! ```
//!
//! with the compliance `c` and the torque `tau` through the joint (M. W. Spong, *Modeling and control of elastic joint robots*, ASME J. Dynamic
//! Systems, Measurement and Control 109(4), 1987), which depends on how the link moves. The torque is predicted, since that of a sensor has noise in
//! it, which two derivatives raise; a fit goes on with the deflections of its own end until both agree ([`OutputError::deflect_anew`]).

use super::OutputError;
use crate::estimate::output_rows::OutputRows;
use crate::estimate::output_spans::SPAN;
use crate::estimate::setup::SetupError;
use crate::motion::joint_motion::MotionNoise;
use crate::motion::late_encoder::LateEncoder;
use crate::motion::tables::{Displaced, Table, Tables};
use crate::motion::torque_sensitivity::{along_poses, while_free};
use crate::motion::zero_phase::ZeroPhase;
use crate::uncertain::oscillator;
use crate::uncertain::source::ErrorSource;
use ff_dynamics::Wanted;
use ff_dynamics::motion::HermiteTable;
use ff_dynamics::reduced::{Disturbance, simulate_reduced_span};
use ff_least_squares::EvalError;
use ff_linalg as linalg;
use ff_model::Params;
use nalgebra::{DMatrix, DVector, Vector3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Passes over torques and deflections, which depend on each other, and the norm of what a pass changes in whitened residuals below which they agree.
const PASSES: usize = 12;
/// See [`PASSES`].
const AGREE: f64 = 0.1;
/// Knots of the motion in a period of the cutoff from which a parabola over the period tells how the torque goes on.
const KNOTS: f64 = 8.0;
/// Samples from which torques are smoothed as positions are.
const LEAST: usize = 64;
/// Poses along a record at which the inertia behind a joint is taken.
const POSES: usize = 5;

/// A joint that gives way.
struct Elastic {
    joint: usize,
    /// Its compliance (rad/(N m)).
    compliance: f64,
    /// Frequency of the link on it, the encoder held (Hz): `1/2pi sqrt(1 / (c J))`, with the inertia `J` behind it.
    resonance_hz: f64,
}

/// Where torques are predicted.
struct Assumed {
    params: Params<f64>,
    /// Joints and mounts; nothing disturbs the motion.
    placed: Displaced,
    /// State that the record begins with.
    start: Vec<f64>,
    elastic: Vec<Elastic>,
}

impl Assumed {
    /// Nuisance unknowns of zero, at the parameters that the options name, or those of the model, where joints give way as these say.
    fn of_options(rows: &OutputRows<'_>) -> Self {
        let (model, options) = (rows.model, &rows.options);
        let params = match &options.deflected_at {
            Some(values) => Params::from_values(model, values.clone()),
            None => Params::nominal(model),
        };
        Self::new(rows, params, &vec![0.0; rows.nuisance().len()], options.compliances.iter().copied())
    }
    fn at(rows: &OutputRows<'_>, full: &[f64], extra: &[f64]) -> Self {
        let compliance = |(source, &c): (&ErrorSource, &f64)| match source {
            ErrorSource::Compliance(j) if c != 0.0 => Some((*j, c)),
            _ => None,
        };
        let compliances = rows.disturbing.iter().zip(rows.disturbed(extra)).filter_map(compliance);
        Self::new(rows, Params::from_values(rows.model, full.to_vec()), extra, compliances)
    }
    fn new(
        rows: &OutputRows<'_>,
        params: Params<f64>,
        extra: &[f64],
        compliances: impl Iterator<Item = (usize, f64)>,
    ) -> Self {
        let elastic = |(joint, compliance): (usize, f64)| {
            let inertia = inertia_behind(rows, &params, joint);
            Elastic { joint, compliance, resonance_hz: (compliance.abs() * inertia).sqrt().recip() / TAU }
        };
        let elastic = compliances.map(elastic).collect();
        let placed = Displaced { sizes: Vec::new(), ..rows.placed(extra) };
        Self { start: rows.start(&params, extra), params, placed, elastic }
    }
}

/// What disturbs the motion, in the order of the rows' list.
pub(super) fn disturbances(rows: &OutputRows<'_>, tables: &mut Tables) -> Result<Vec<Disturbance>, SetupError> {
    let mut predicted = None;
    let mut responses: Vec<Option<[DMatrix<f64>; 3]>> = vec![None; rows.options.oscillators.len()];
    let mut out = Vec::new();
    let dt = rows.grid.1;
    for source in &rows.disturbing {
        let needs = matches!(source, ErrorSource::Compliance(_) | ErrorSource::Oscillator(..));
        if needs && predicted.is_none() {
            predicted = Some(Predicted::agreeing(rows, tables, &Assumed::of_options(rows))?);
        }
        out.push(match (*source, &predicted) {
            (ErrorSource::Compliance(j), Some(p)) => deflection(tables, &p.torques, j, dt)?,
            (ErrorSource::Oscillator(k, column), Some(p)) => {
                let of = &rows.options.oscillators[k];
                let response = responses[k].get_or_insert_with(|| of.response(&p.accelerations, dt));
                let wrenches = oscillator::wrenches(of, column, response);
                Disturbance::Wrench(Arc::new(move |t| oscillator::at(&wrenches, dt, t)))
            }
            (ErrorSource::EncoderLag(j), _) => Disturbance::Motion(Arc::new(LateEncoder::new(tables.motion(), j, dt))),
            (ErrorSource::Force(i), _) => along(i),
            (ErrorSource::Moment(i), _) => along(3 + i),
            _ => continue,
        });
    }
    Ok(out)
}

/// A unit wrench along one of its six components.
fn along(component: usize) -> Disturbance {
    let mut wrench = [0.0; 6];
    wrench[component] = 1.0;
    Disturbance::Wrench(Arc::new(move |_| wrench))
}

/// What the model does on the grid.
struct Predicted {
    /// Joint torques (N m, samples x joints).
    torques: DMatrix<f64>,
    /// Acceleration of the base's origin and angular acceleration in base axes (m/s^2, rad/s^2, samples x 6).
    accelerations: DMatrix<f64>,
}

impl Predicted {
    /// Along the readings of the encoders, or along the links behind joints that give way; there in passes over torques and deflections, until
    /// they agree. Where they do not, the links deflect by the torques of a stiff joint. Leaves those deflections in the tables.
    fn agreeing(rows: &OutputRows<'_>, tables: &mut Tables, at: &Assumed) -> Result<Self, SetupError> {
        let stiff = Self::along(rows, tables, at, &[])?;
        Ok(Self::passes(rows, tables, at, &stiff).unwrap_or(stiff))
    }
    fn passes(rows: &OutputRows<'_>, tables: &mut Tables, at: &Assumed, stiff: &Self) -> Option<Self> {
        let sizes: Vec<f64> = at.elastic.iter().map(|e| e.compliance).collect();
        let mut found: Option<Self> = None;
        let mut before = f64::INFINITY;
        for _ in 0..if sizes.is_empty() { 0 } else { PASSES } {
            let torques = &found.as_ref().unwrap_or(stiff).torques;
            let bends = at.elastic.iter().map(|e| deflection(tables, torques, e.joint, rows.grid.1));
            tables.disturbances = bends.collect::<Result<_, _>>().ok()?;
            let mut next = Self::along(rows, tables, at, &sizes).ok()?;
            next.torques = followed(rows, tables, at, &stiff.torques, &next.torques);
            let weighed = |(j, s): (usize, &f64)| s * (&next.torques - torques).column(j).norm();
            let moved = rows.inverse[0].iter().enumerate().map(weighed).fold(0.0, f64::hypot);
            if moved.is_nan() || moved >= before {
                return None;
            }
            (found, before) = (Some(next), moved);
            if moved < AGREE {
                break;
            }
        }
        found
    }
    /// Along the motion with these sizes of the disturbances of the tables.
    fn along(rows: &OutputRows<'_>, tables: &mut Tables, at: &Assumed, sizes: &[f64]) -> Result<Self, SetupError> {
        let (model, params, mut z) = (rows.model, &at.params, at.start.clone());
        let samples = rows.grid.0;
        let (mut torques, mut accelerations) = (DMatrix::zeros(samples, model.nj()), DMatrix::zeros(samples, 6));
        let (placed, wanted) = (Displaced { sizes: sizes.to_vec(), ..at.placed.clone() }, Wanted::default());
        for first in (0..samples).step_by(SPAN) {
            let span = first..(first + SPAN).min(samples);
            let Table { table, samples } = tables.span(model, params, &placed, &wanted, span.clone());
            let y = simulate_reduced_span(model, params, table, samples, &mut z);
            let y = y.map_err(|e| SetupError::JointMotion(format!("the motion cannot be predicted: {e}")))?;
            torques.rows_mut(span.start, span.len()).copy_from(&y.tau);
            for (i, to) in span.enumerate() {
                let (velocity, rate) = (y.twist.fixed_view::<1, 3>(i, 0), y.twist.fixed_view::<1, 3>(i, 3));
                let mut a = y.accel.row(i).into_owned();
                let turning = rate.transpose().cross(&velocity.transpose());
                (0..3).for_each(|k| a[k] += turning[k]);
                accelerations.row_mut(to).copy_from(&a);
            }
        }
        Ok(Self { torques, accelerations })
    }
}

/// Fades within so many samples of either end.
fn faded(x: &mut [f64], over: f64) {
    let n = x.len();
    for (i, x) in x.iter_mut().enumerate() {
        let inwards = (i.min(n - 1 - i) as f64 / over).min(1.0);
        *x *= (0.5 * PI * inwards).sin().powi(2);
    }
}

/// A signal with so many samples more at either end, on the parabola through as many of it.
fn continued(x: &[f64], beyond: usize) -> Vec<f64> {
    let n = x.len();
    let over = (beyond + 1).min(n);
    let powers = |t: f64| [1.0, t, t * t];
    let a = DMatrix::from_fn(over, 3, |i, k| powers(i as f64 / over as f64)[k]);
    let along = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
        match linalg::least_squares(&a, &DVector::from_fn(over, |i, _| of(i))) {
            Ok(c) => (1..=beyond).map(|i| c.dot(&Vector3::from(powers(-(i as f64) / over as f64)))).collect(),
            // Too few for a parabola.
            Err(_) => vec![of(0); beyond],
        }
    };
    let (before, behind) = (along(&|i| x[i]), along(&|i| x[n - 1 - i]));
    before.into_iter().rev().chain(x.iter().copied()).chain(behind).collect()
}

/// Largest inertia that a joint moves with a free base, other joints and passive coordinates held (kg m^2).
fn inertia_behind(rows: &OutputRows<'_>, params: &Params<f64>, joint: usize) -> f64 {
    let model = rows.model;
    let base: Vec<usize> = (0..model.nv() - model.nj() - model.np()).collect();
    let own = base.len() + joint;
    let behind = |h: DMatrix<f64>| while_free(&h, &base, &[own]).map_or(h[(own, own)], |[inertia, _]| inertia[(0, 0)]);
    along_poses(model, params, &rows.record, POSES).map(behind).fold(0.0, f64::max)
}

/// See [`FIRST`].
type Differences = [[f64; 5]; 3];
/// Five-point differences of fourth order, for the samples of the five in turn: first and second derivatives, over `12 dt` and `12 dt^2`; those of the
/// last two are those of the first two from behind.
const FIRST: Differences =
    [[-25.0, 48.0, -36.0, 16.0, -3.0], [-3.0, -10.0, 18.0, -6.0, 1.0], [1.0, -8.0, 0.0, 8.0, -1.0]];
/// See [`FIRST`].
const SECOND: Differences =
    [[35.0, -104.0, 114.0, -56.0, 11.0], [11.0, -20.0, 6.0, 4.0, -1.0], [-1.0, 16.0, -30.0, 16.0, -1.0]];

/// The change of the joint motion per unit of the compliance of joint `j`: the link stays behind the encoder by the torque. Where the motion is a spline
/// through readings, so is this, on the same knots: both are then smoothed alike, and the links move as a spline through where they were, from rest where
/// the motion begins there; a rate at the first sample would be momentum that lasts all the record.
fn deflection(tables: &Tables, tau: &DMatrix<f64>, j: usize, dt: f64) -> Result<Disturbance, SetupError> {
    let (samples, n) = tau.shape();
    let values = tau.column(j);
    let [q, qd, qdd]: [Vec<f64>; 3] = match &tables.noise {
        Some(noise) if samples >= LEAST => {
            let spline = noise.alike(values.as_slice(), dt)?;
            core::array::from_fn(|order| {
                let mut at = [0.0];
                let one = |i: usize| {
                    spline.derivative(i as f64 * dt, order, &mut at);
                    at[0]
                };
                (0..samples).map(one).collect()
            })
        }
        _ => {
            let over = |weights: &Differences, mirrored: f64, by: f64| {
                (0..samples).map(|i| difference(values.as_slice(), i, weights, mirrored) / by).collect()
            };
            let first = over(&FIRST, -1.0, 12.0 * dt);
            [values.as_slice().to_vec(), first, over(&SECOND, 1.0, 12.0 * dt * dt)]
        }
    };
    let spread = |of: &[f64]| {
        let mut out = vec![0.0; samples * n];
        of.iter().enumerate().for_each(|(i, x)| out[i * n + j] = -x);
        out
    };
    let table = HermiteTable::new(n, dt, &spread(&q), &spread(&qd), &spread(&qdd));
    Ok(Disturbance::Motion(Arc::new(table.map_err(|e| SetupError::JointMotion(e.to_string()))?)))
}

/// Torques that a pass goes on with. What a deflection adds to them is followed below the resonance of the link on its joint alone: a pass leaves `c J (2 pi f)^2`
/// of what the last one left, and noise would grow from pass to pass above. At the ends, where a motion is loose and the last sample would feed itself, it is
/// continued on a parabola over one period of that, or fades within half of one that spans too few knots.
fn followed(
    rows: &OutputRows<'_>,
    tables: &Tables,
    at: &Assumed,
    stiff: &DMatrix<f64>,
    bent: &DMatrix<f64>,
) -> DMatrix<f64> {
    let rate = 1.0 / rows.grid.1;
    let spacing = tables.noise.as_ref().map_or(0.0, MotionNoise::spacing);
    let mut added = bent - stiff;
    let n = added.nrows();
    for &Elastic { joint, resonance_hz, .. } in &at.elastic {
        let (filter, cutoff) = ZeroPhase::nearest(rate, resonance_hz);
        let added = &mut added.as_mut_slice()[joint * n..(joint + 1) * n];
        if KNOTS * spacing * cutoff < 1.0 {
            let beyond = (rate / cutoff) as usize;
            let mut all = continued(added, beyond);
            filter.run(&mut all);
            added.copy_from_slice(&all[beyond..beyond + n]);
        } else {
            faded(added, 0.5 * rate / cutoff);
            filter.run(added);
        }
    }
    stiff + added
}

/// A five-point difference at sample `i`, over the five samples about it, or the five at an end.
fn difference(values: &[f64], i: usize, weights: &Differences, mirrored: f64) -> f64 {
    let Some(last) = values.len().checked_sub(5) else { return 0.0 };
    let start = i.saturating_sub(2).min(last);
    let (place, of) = (i - start, &values[start..start + 5]);
    match weights.get(place) {
        Some(weights) => weights.iter().zip(of).map(|(w, x)| w * x).sum(),
        None => mirrored * weights[4 - place].iter().zip(of.iter().rev()).map(|(w, x)| w * x).sum::<f64>(),
    }
}

impl OutputError<'_> {
    /// Lets elastic joints deflect by the torques that are predicted at these unknowns, with the deflections that they have there, if that changes the
    /// residuals by more than [`AGREE`], and says whether it does. Linearisations hold deflections per compliance, so that each such pass
    /// is one of a fixed point. Allocates.
    ///
    /// # Errors
    /// [`EvalError`] where nothing is predicted.
    pub(super) fn deflect_anew(&mut self, full: &[f64], extra: &[f64]) -> Result<bool, EvalError> {
        let at = Assumed::at(&self.rows, full, extra);
        if at.elastic.is_empty() {
            return Ok(false);
        }
        let (rows, steps) = (&self.rows, self.steps());
        let (mut old, mut new) = (vec![0.0; rows.count()], vec![0.0; rows.count()]);
        let rejected = |e: SetupError| EvalError::Rejected(e.to_string());
        let mut tables = self.tables.thinned(1, steps).passing();
        let mut sizes = rows.disturbed(extra).to_vec();
        let bent = Predicted::along(rows, &mut tables, &at, &sizes).map_err(rejected)?;
        let elastic = rows.disturbing.iter().map(|source| matches!(source, ErrorSource::Compliance(_)));
        sizes.iter_mut().zip(elastic).filter(|(_, is)| *is).for_each(|(size, _)| *size = 0.0);
        let stiff = Predicted::along(rows, &mut tables, &at, &sizes).map_err(rejected)?;
        let torques = followed(rows, &tables, &at, &stiff.torques, &bent.torques);
        for (k, source) in rows.disturbing.iter().enumerate() {
            if let ErrorSource::Compliance(j) = source {
                tables.disturbances[k] = deflection(&tables, &torques, *j, rows.grid.1).map_err(rejected)?;
            }
        }
        self.at_hand(steps, full, extra, &mut old)?;
        super::by_spans(rows, &mut tables, full, extra, &mut new)?;
        let moved = old.iter().zip(&new).map(|(a, b)| a - b).fold(0.0, f64::hypot);
        if moved.is_nan() || moved <= AGREE {
            return Ok(false);
        }
        self.tables.disturbances = tables.disturbances;
        // What is kept is of the deflections before.
        self.take_steps(steps);
        Ok(true)
    }
}
