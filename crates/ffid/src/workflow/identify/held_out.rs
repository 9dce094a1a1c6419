//! Does the model explain data it has not seen? Parameters stay as they are; biases and initial state, which belong to
//! the record and not to the robot, are fitted.

use super::drives;
use super::error::IdentifyError;
use super::evidence::{Evidence, State};
use super::ground;
use super::ground::Arm;
use super::labelled_record::LabelledRecord;
use super::noise_floor::{DRAWS, mean_square};
use super::observed_estimator::{ObservedEstimator, Observer};
use super::options::FitOptions;
use super::record_estimator::RecordEstimator;
use super::result::held_out::HeldOut;
use super::result::provenance::Provenance;
use super::run::identify;
use super::settings::Settings;
use super::signals::Signals;
use super::text;
use super::ties::TieSpec;
use super::uncertain::UncertainItems;
use crate::open::Opened;
use ff_model::Model;
use ff_records::Record;
use ident::Estimator;
use ident::Posterior;
use ident::compose::SharedErrors;
use ident::estimate::{NuisanceFit, fit_nuisance};

/// The prediction of an arm on the ground: nothing is fitted; noise is what the calibration left. Its deviations are allowed for, and what its low pass takes
/// of a motion that is faster here.
fn on_the_ground(
    model: &Model,
    values: &[f64],
    arm: &Arm,
    record: &Record,
    s: &Settings,
    source: String,
) -> Result<(HeldOut, Signals), IdentifyError> {
    let (signals, foretold) = ground::explain(model, values, arm, record)?;
    let (samples, joints) = (signals.time.len(), signals.names.len());
    let used = (0..joints).flat_map(|k| signals.readings(k).0).filter(|r| *r != 0.0).count().max(1);
    let chi2_per_dof = foretold.chi2 / foretold.rows.max(1) as f64;
    let mut held = HeldOut::of(source, record, &signals, chi2_per_dof, s.limit);
    // Behind a low pass the ends do not count.
    (held.samples, held.seconds) = (samples, samples as f64 * record.dt());
    let squares: f64 = signals.channels().iter().map(|c| c.over_noise.powi(2)).sum();
    let times = (squares * samples as f64 / used as f64).sqrt();
    let words = if held.explained { "predicts" } else { "does NOT predict" };
    held.verdict = format!(
        "The calibrated arm {words} these torques: residuals are {times:.2} times those of the calibration, {:.2} times what these{} make, {}.",
        chi2_per_dof.sqrt(),
        if foretold.taken > 0.0 { ", its deviations and its low pass" } else { " and its deviations" },
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
    let silent = watch.aside();
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
    drives::gains_known(model, record, &names)?;
    let of = String::from("held-out");
    let one =
        [LabelledRecord { label: of, record: record.clone(), resampled: (false, false), continues: false, ago: 0 }];
    let s = &drives::settled(model, &one, s)?;
    let fit = RecordEstimator::beside(model, record, s, &UncertainItems::held(model, &names), &[])?;
    let sigma = fit.sigmas(model);
    let (estimator, twin) = fit.split();
    let mut estimator = SharedErrors::new(estimator, values.len(), &names, &[]);
    let all: Vec<f64> = values.iter().copied().chain(s.held_errors.iter().map(|e| e.1)).collect();
    let found = nuisance(&mut estimator, &all, s, watch)?;
    let signals = Signals::of(model, record, &found.residuals, &sigma);
    let chi2_per_dof = found.chi2_per_dof();
    // What the encoders' noise leaves is no fault of the model: it is looked for where there is more than the sensors explain.
    let drawn = if chi2_per_dof > s.limit { twin.draws_of_motion(DRAWS, values) } else { None };
    let encoders = mean_square(drawn.as_slice());
    let mut held = HeldOut::of(source.into(), record, &signals, chi2_per_dof, s.limit * (1.0 + encoders));
    held.verdict = in_words(&held);
    Ok((held, signals))
}

/// What it comes to.
fn in_words(held: &HeldOut) -> String {
    let rms = held.chi2_per_dof.sqrt();
    let tested = |e: &Evidence| match e.state {
        State::Explained => format!("; {}", e.reason),
        State::NotTested => format!("; tests were not made: {}", e.reason),
        State::Contradicted => String::new(),
    };
    if held.explained {
        let tested = held.evidence.as_ref().map(tested).unwrap_or_default();
        return format!(
            "The model predicts these data: residuals are {rms:.3} times the noise of the sensors{tested}."
        );
    }
    let worst = held.channels.iter().max_by(|a, b| a.over_noise.total_cmp(&b.over_noise));
    let worst =
        worst.map(|c| format!("; worst in {}, {:.2} times its noise", c.name, c.over_noise)).unwrap_or_default();
    let against = held.evidence.as_ref().filter(|e| e.state == State::Contradicted);
    let against = against.map(|e| format!(" {}.", e.reason)).unwrap_or_default();
    format!(
        "The model does NOT explain these data:{against} Residuals are {rms:.3} times the noise, limit {:.3}{worst}.",
        held.limit.sqrt()
    )
}

/// What is known of a robot before a record of it is judged.
#[derive(Clone, Copy)]
pub struct Known<'a> {
    /// The mission.
    pub opened: &'a Opened,
    /// What other records have told of its parameters; nothing but chi-squared is judged without.
    pub posterior: Option<&'a Posterior>,
    /// Ties of that identification.
    pub ties: &'a [TieSpec],
}

/// Of what is known, the part about parameters of the model: errors of bodies and ties are numbers beside it, about a mission that an
/// identified one has replaced. `None` where nothing is left. Allocates.
pub fn of_model(posterior: &Posterior, model: &Model) -> Option<Posterior> {
    let decls = model.param_decls();
    let names: Vec<&str> =
        posterior.names.iter().map(String::as_str).filter(|n| decls.iter().any(|d| d.name == *n)).collect();
    posterior.marginal(&names).ok().filter(|p| !p.names.is_empty())
}

/// [`predict_held_out`], judged by the tests of a fit ([`super::identify`]): what other records have told is the prior of the
/// parameters, so that these data can contradict it, and errors of the world are tried.
///
/// # Errors
/// As [`predict_held_out`].
pub fn judge_held_out(
    known: Known<'_>,
    values: &[f64],
    arm: Option<&Arm>,
    record: &Record,
    s: &Settings,
    source: impl Into<String>,
    watch: &Observer<'_>,
) -> Result<(HeldOut, Signals), IdentifyError> {
    let (held, signals) = predict_held_out(&known.opened.model, values, arm, record, s, source, watch)?;
    let Some(posterior) = known.posterior.filter(|_| arm.is_none()) else { return Ok((held, signals)) };
    let label = String::from("record");
    let one = [LabelledRecord { label, record: record.clone(), resampled: (false, false), continues: false, ago: 0 }];
    let own = Settings { prior: None, start_offset: 0.0, ..s.clone() };
    // From what is known: from the mission's values the way is that of the first fit, and may end elsewhere, or not at all.
    let options = FitOptions {
        posterior: Some(posterior.clone()),
        start_at_posterior: true,
        ties: known.ties.to_vec(),
        ..FitOptions::default()
    };
    let silent = watch.aside();
    let evidence = match identify(known.opened, &one, &own, &options, Provenance::default(), &silent) {
        Ok(found) => found.result.evidence.unwrap_or_default(),
        Err(IdentifyError::Interrupted) => return Err(IdentifyError::Interrupted),
        Err(e) => Evidence { reason: e.to_string(), ..Evidence::default() },
    };
    let mut held = held.judged_by(evidence);
    held.verdict = in_words(&held);
    Ok((held, signals))
}
