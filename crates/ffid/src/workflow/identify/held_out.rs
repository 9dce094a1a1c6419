//! Does the model explain data it has not seen? Parameters stay as they are; biases and initial state, which belong to
//! the record and not to the robot, are fitted.

use super::error::IdentifyError;
use super::ground;
use super::ground::Arm;
use super::observed_estimator::{ObservedEstimator, Observer};
use super::record_estimator::RecordEstimator;
use super::result::held_out::HeldOut;
use super::settings::Settings;
use super::signals::Signals;
use super::text;
use super::uncertain::UncertainItems;
use ff_model::Model;
use ff_records::Record;
use ident::Estimator;
use ident::compose::SharedErrors;
use ident::estimate::{NuisanceFit, fit_nuisance};

/// The prediction of an arm on the ground: nothing is fitted; noise is what the calibration left.
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

/// Fits biases and initial state of a record, the parameters as they are ([`fit_nuisance`]).
pub(super) fn nuisance(
    estimator: &mut dyn Estimator,
    values: &[f64],
    s: &Settings,
    watch: &Observer<'_>,
) -> Result<NuisanceFit, IdentifyError> {
    // The linearisations of a judgement are not those of the fit.
    let silent = Observer { progress: None, ..*watch };
    let mut watched = ObservedEstimator::new(estimator, &silent);
    let found = fit_nuisance(&mut watched, values, s.max_iterations);
    if watched.stopped() {
        return Err(IdentifyError::Interrupted);
    }
    found.map_err(IdentifyError::from)
}

/// Predicts a record with the parameters `values`. `source` says where it is from.
///
/// `arm` are friction and noise of a ground calibration, whose prediction needs them; nothing is fitted then.
///
/// A part of a longer record does not begin at rest: give `initial_state` in the settings.
///
/// # Errors
/// [`IdentifyError`].
pub fn predict_held_out(
    model: &Model,
    values: &[f64],
    arm: Option<&Arm>,
    record: &Record,
    s: &Settings,
    source: impl Into<String>,
    watch: &Observer<'_>,
) -> Result<(HeldOut, Signals), IdentifyError> {
    record.check_joints(&model.joint_names()).map_err(IdentifyError::Refused)?;
    if let Some(arm) = arm {
        return on_the_ground(model, values, arm, record, s, source.into());
    }
    let names: Vec<String> = s.held_errors.iter().map(|e| e.0.clone()).collect();
    let fit = RecordEstimator::beside(model, record, s, &UncertainItems::held(model, &names))?;
    let sigma = fit.sigmas(model);
    let mut estimator = SharedErrors::new(fit.into_estimator(), values.len(), &names, &[]);
    let all: Vec<f64> = values.iter().copied().chain(s.held_errors.iter().map(|e| e.1)).collect();
    let found = nuisance(&mut estimator, &all, s, watch)?;
    let signals = Signals::of(model, record, &found.residuals, &sigma);
    let chi2_per_dof = found.chi2_per_dof();
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
