//! Deviations that allow for noise of the encoders in the prediction.
//!
//! Where a mode rings by that noise alone, its columns pretend that the record tells its spring, and the spring is drawn off ([`ident::uncertain::NormalEquations`]): both
//! panels of a 60 kg servicer, at 6 and 8 Hz beside a motion below 3 Hz, were explained 3 to 10 stated deviations off with encoders of 20 bits.

use super::error::IdentifyError;
use super::fitted::{Ended, Fitted};
use super::mixture;
use super::record_estimator::Twin;
use super::result::provenance::Warning;
use super::settings::Settings;
use super::survey::{Columns, Survey};
use ff_model::diagnostics::list;
use ident::Loss;
use ident::uncertain::covariance_of_motion_noise;

/// Factor on a deviation from which it counts: below, draws of noise say more than what they are of.
const COUNTS: f64 = 1.1;

/// Parameters that are named in one line.
const LISTED: usize = 4;

/// A parameter whose deviation allows for noise of the encoders.
pub(super) struct Shaken {
    pub(super) name: String,
    /// How many times as wide it has become.
    pub(super) wider: f64,
}

/// The fit with deviations that allow for noise of the encoders, and whose it is that became wider by it, the most first; `None` where none did.
/// Allocates, and linearises eight times in the long steps of a survey.
pub(super) fn allow_for_encoders(
    end: &Ended<'_>,
    twins: &[Twin<'_>],
    s: &Settings,
) -> Result<Option<(Fitted, Vec<Shaken>)>, IdentifyError> {
    let e = &end.fitted.estimate;
    if !e.is_solution() || s.loss != Loss::Squares {
        return Ok(None);
    }
    let Some(survey) = Survey::new(end, twins, s, &Columns::Shaken)? else { return Ok(None) };
    let drawn = survey.scores.drawn_over_unknowns();
    let added = survey.shaken.as_ref().and_then(|(fit, shaken)| covariance_of_motion_noise(fit, drawn, shaken));
    let Some(added) = added else { return Ok(None) };
    // Columns of the survey among the unknowns of the fit.
    let of_fit: Vec<&str> = e.uncertainty.unknowns.iter().map(|u| u.name.as_str()).collect();
    let place = |name: &String| of_fit.iter().position(|n| n == name);
    let places: Vec<Option<usize>> = survey.names.iter().map(place).collect();
    let mut covariance = e.uncertainty.covariance.clone();
    for (a, i) in places.iter().enumerate() {
        for (b, k) in places.iter().enumerate() {
            if let (Some(i), Some(k)) = (i, k) {
                covariance[(*i, *k)] += added[(a, b)];
            }
        }
    }
    let asked = |k: usize| end.fitted.selected.get(k).is_some_and(|&i| end.unknowns.is_asked(i));
    let wider = |k: usize| (covariance[(k, k)] / e.uncertainty.covariance[(k, k)]).sqrt();
    let told = |k: &usize| asked(*k) && e.uncertainty.deviation[*k].is_some() && wider(*k) > COUNTS;
    let mut shaken: Vec<Shaken> =
        (0..of_fit.len()).filter(told).map(|k| Shaken { name: of_fit[k].to_owned(), wider: wider(k) }).collect();
    if shaken.is_empty() {
        return Ok(None);
    }
    shaken.sort_by(|a, b| b.wider.total_cmp(&a.wider));
    let mut fitted = end.fitted.clone();
    fitted.alone.get_or_insert_with(|| e.uncertainty.clone());
    // A valley that was followed without that noise has no say where it counts.
    fitted.bent.retain(|p| shaken.iter().all(|s| s.name != p.name));
    mixture::widen(&mut fitted.estimate, covariance);
    Ok(Some((fitted, shaken)))
}

/// Says how many kinks joint motions have, and how many readings next to them do not count; `None` where there are none.
pub(super) fn kinked(twins: &[Twin<'_>]) -> Option<Warning> {
    let add = |a: (usize, usize, usize), b: (usize, usize, usize)| (a.0 + b.0, a.1 + b.1, a.2 + b.2);
    let (kinks, untold, all) = twins.iter().map(Twin::kinks).fold((0, 0, 0), add);
    let part = 100.0 * untold as f64 / all.max(1) as f64;
    (kinks > 0).then(|| Warning {
        code: "Data::Kinks".to_owned(),
        message: format!(
            "accelerations of the joints jump or bend at {kinks} instants, which are taken from the positions; {part:.1} % of the readings are next to one, \
             where positions do not tell the acceleration, and do not count"
        ),
    })
}

/// Says whose deviations have become wider.
pub(super) fn said(shaken: &[Shaken]) -> Warning {
    let one = |s: &Shaken| format!("{} ({:.1} times as wide)", s.name, s.wider);
    let named: Vec<String> = shaken.iter().map(one).collect();
    let named = list(named.iter().map(String::as_str), LISTED);
    let message = format!(
        "noise of the joint positions makes the model ring about as much as the robot rang, which draws estimates off; deviations allow for it: {named}"
    );
    Warning { code: "Fit::MotionNoise".to_owned(), message }
}
