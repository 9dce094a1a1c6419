//! Does the model explain data it has not seen? Parameters stay as they are; biases and initial state, which belong to
//! the record and not to the robot, are fitted.

use super::ground;
use super::ground::Arm;
use super::result::HeldOut;
use super::text;
use super::watched::Watched;
use super::{Fit, IdentifyError, Settings, Signals, Watch};
use ff_least_squares::{EvalError, Problem, Settings as Solver, lm};
use ff_model::Model;
use ff_records::Record;
use ident::{EstimateError, Estimator};
use nalgebra::DMatrix;

/// What belongs to the record alone, as a problem of its own: unknowns are nuisance values over their sizes.
struct Beside<'a> {
    inner: &'a mut dyn Estimator,
    values: &'a [f64],
    sizes: Vec<f64>,
}

impl Beside<'_> {
    fn extra(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.sizes).map(|(x, s)| x * s).collect()
    }
}

impl Problem for Beside<'_> {
    fn dim(&self) -> usize {
        self.sizes.len()
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        let extra = self.extra(x);
        r.resize(self.inner.rows(), 0.0);
        self.inner.residuals(self.values, &extra, r)
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        let extra = self.extra(x);
        r.resize(self.inner.rows(), 0.0);
        j.resize_mut(self.inner.rows(), self.sizes.len(), 0.0);
        self.inner.jacobian(self.values, &extra, &[], r, j)?;
        for (k, s) in self.sizes.iter().enumerate() {
            j.column_mut(k).scale_mut(*s);
        }
        Ok(())
    }
}

/// The same for an arm on the ground: nothing is fitted; noise is what the calibration left.
fn on_the_ground(
    model: &Model,
    values: &[f64],
    arm: &Arm,
    record: &Record,
    s: &Settings,
    source: String,
) -> Result<(HeldOut, Signals), IdentifyError> {
    let (signals, used) = ground::explain(model, values, arm, record)?;
    let squares: f64 = signals.channels().iter().map(|c| c.over_noise.powi(2)).sum();
    let samples = signals.time.len();
    let chi2_per_dof = squares * samples as f64 / used.max(1) as f64;
    let mut held = HeldOut::of(source, record, &signals, chi2_per_dof, s.limit);
    // Behind a low pass the ends do not count.
    (held.samples, held.seconds) = (samples, samples as f64 * record.dt());
    let times = chi2_per_dof.sqrt();
    let words = if held.explained { "predicts" } else { "does NOT predict" };
    held.verdict = format!(
        "The calibrated arm {words} these torques: residuals are {times:.2} times those of the calibration, {}.",
        text::shares(&held.channels)
    );
    Ok((held, signals))
}

/// Fits what belongs to the record alone, the parameters as they are: its values, and the whitened residuals.
pub(super) fn beside(
    estimator: &mut dyn Estimator,
    values: &[f64],
    s: &Settings,
    watch: &Watch<'_>,
) -> Result<(Vec<f64>, Vec<f64>), IdentifyError> {
    let sizes: Vec<f64> = estimator.nuisance().iter().map(|u| u.size).collect();
    if sizes.is_empty() {
        let mut r = vec![0.0; estimator.rows()];
        estimator.residuals(values, &[], &mut r).map_err(|e| IdentifyError::Model(e.to_string()))?;
        return Ok((Vec::new(), r));
    }
    // The linearisations of a judgement are not those of the fit.
    let silent = Watch { progress: None, ..*watch };
    let mut watched = Watched::new(estimator, &silent);
    let start = vec![0.0; sizes.len()];
    let mut problem = Beside { inner: &mut watched, values, sizes };
    let solver = Solver { max_iterations: s.max_iterations, cost_floor: 1e-13, ..Solver::default() };
    let found = lm::minimise(&mut problem, &start, &solver);
    let sizes = problem.sizes;
    if watched.stopped() {
        return Err(IdentifyError::Interrupted);
    }
    let found = found.map_err(EstimateError::from)?;
    Ok((found.x.iter().zip(&sizes).map(|(x, s)| x * s).collect(), found.residuals))
}

/// Predicts a record with the parameters `values`. `source` says where it is from.
///
/// `arm` are friction and noise of a ground calibration, whose prediction needs them; nothing is fitted then.
///
/// A part of a longer record does not begin at rest: give `initial_state` in the settings.
///
/// # Errors
/// [`IdentifyError`].
pub fn explain(
    model: &Model,
    values: &[f64],
    arm: Option<&Arm>,
    record: &Record,
    s: &Settings,
    source: impl Into<String>,
    watch: &Watch<'_>,
) -> Result<(HeldOut, Signals), IdentifyError> {
    record.check_joints(&model.joint_names()).map_err(IdentifyError::Refused)?;
    if let Some(arm) = arm {
        return on_the_ground(model, values, arm, record, s, source.into());
    }
    let mut fit = Fit::new(model, record, s)?;
    let sigma = fit.sigmas(model);
    let (extra, residuals) = beside(fit.estimator(), values, s, watch)?;
    let freedom = residuals.len().saturating_sub(extra.len());
    let signals = Signals::of(model, record, &residuals, &sigma);
    let chi2_per_dof = residuals.iter().map(|r| r * r).sum::<f64>() / freedom.max(1) as f64;
    let mut held = HeldOut::of(source.into(), record, &signals, chi2_per_dof, s.limit);
    let rms = chi2_per_dof.sqrt();
    held.verdict = if held.explained {
        format!("The model predicts these data: residuals are {rms:.3} times the noise of the sensors.")
    } else {
        let worst = held.channels.iter().max_by(|a, b| a.over_noise.total_cmp(&b.over_noise));
        let worst = worst.map(|c| format!("; worst in {}, {:.2} times its noise", c.name, c.over_noise));
        format!(
            "The model does NOT explain these data: residuals are {rms:.3} times the noise, limit {:.3}{}.",
            s.limit.sqrt(),
            worst.unwrap_or_default()
        )
    };
    Ok((held, signals))
}
