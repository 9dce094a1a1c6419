//! Draws from the posterior around a fit: the step of `ffid identify --sample`.

use super::assembly::Setup;
use super::error::{IdentifyError, config};
use super::identified::Identified;
use super::labelled_record::LabelledRecord;
use super::observed_estimator::Observer;
use super::options::FitOptions;
use super::result::sampled::Sampled;
use super::settings::Settings;
use crate::open::Opened;
use ident::estimate::FINEST;
use ident::sample::{ChainSettings, SampleError, sample};
use ident::{Estimator, Request};

/// Draws from the posterior of an identification, whose records and settings are those of its last fit. Draws and what they say are put
/// into `found`; where there is nothing to draw from, the reason is. Interrupted, the draws there are are kept.
///
/// # Errors
/// [`IdentifyError::Refused`] for the calibration on the ground, which has no posterior of this kind, and for settings that are not those
/// of the fit.
pub fn sample_posterior(
    opened: &Opened,
    records: &[LabelledRecord],
    settings: &Settings,
    options: &FitOptions,
    chains: &ChainSettings,
    found: &mut Identified,
    watch: &Observer<'_>,
) -> Result<(), IdentifyError> {
    let Some(fitted) = &found.fitted else {
        let hint = "leave --sample out: its estimates are linear in the torques, and their intervals are exact";
        return Err(IdentifyError::Refused(config("Config::Sample", "the ground calibration draws nothing", hint)));
    };
    let setup = Setup::new(opened, records, settings, options)?;
    let (unknowns, at) = (&setup.unknowns, &fitted.estimate);
    let whole = setup.request()?;
    let request =
        Request { selected: &fitted.selected, priors: unknowns.priors(&fitted.selected)?, start: &at.values, ..whole };
    let make = || -> Result<Box<dyn Estimator + '_>, SampleError> {
        let made = setup.estimator(&opened.model, records);
        let mut made = made.map_err(|e| SampleError::Sampler(e.to_string()))?;
        // Steps of the integration are those that the mission's values ask for; the fit has ended elsewhere.
        let extra: Vec<f64> = at.nuisance.iter().map(|p| p.value).collect();
        made.refine(&at.values, &extra, FINEST).map_err(|e| SampleError::Sampler(e.to_string()))?;
        Ok(made)
    };
    match sample(&request, at, make, chains, watch.stop) {
        Ok(draws) => {
            let of_fit: Vec<(f64, Option<f64>)> =
                at.parameters.iter().chain(&at.nuisance).map(|p| (p.value, p.std)).collect();
            let asked = |k: usize| fitted.selected.get(k).is_some_and(|&i| unknowns.is_asked(i));
            found.result.sampled = Some(Sampled::of(&draws, chains, &of_fit, asked));
            found.draws = (!draws.is_empty()).then_some(draws);
        }
        // The fit stands whatever becomes of the draws.
        Err(e) => found.result.sampled = Some(Sampled::none(e.to_string(), chains)),
    }
    Ok(())
}
