//! What `identify` and `validate` share: the flags of the fit, the watch over it, the words for its failures.

use crate::interrupt;
use crate::results::Output;
use ff_mission::Mission;
use ff_mission::mission::EstimateMethod;
use ff_model::{Area, Problem, Problems};
use ffid::exit::Exit;
use ffid::workflow::identify::{EXPLAINED, IdentifyError, Method, Observer, Settings};
use ffid::workflow::preflight::Sensing;
use ident::EstimateError;
use ident::{Loss, Noise};
use indicatif::{ProgressBar, ProgressStyle};
use std::time::Duration;

/// How the record is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum MethodFlag {
    /// By estimate.method of the mission, or else by the model: ground on a fixed base, rda without passive coordinates, else
    /// output-error.
    Auto,
    /// Rigid system, base acceleration eliminated.
    Rda,
    /// Base and appendages simulated.
    OutputError,
    /// An arm on the ground: fixed base, gravity, joint friction.
    Ground,
}

impl MethodFlag {
    pub(crate) fn method(self) -> Option<Method> {
        match self {
            Self::Auto => None,
            Self::Rda => Some(Method::Rda),
            Self::OutputError => Some(Method::OutputError),
            Self::Ground => Some(Method::Ground),
        }
    }
}

/// Noise, nuisance and patience.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct FitFlags {
    /// Standard deviation of one torque sample (N m), instead of [sensors.torque].
    #[arg(long, value_name = "NM", value_parser = positive)]
    torque_noise: Option<f64>,
    /// Standard deviation of one sample of a motor current (A), instead of [sensors.current].
    #[arg(long, value_name = "A", value_parser = positive)]
    current_noise: Option<f64>,
    /// Standard deviation of one gyro sample (rad/s), instead of [sensors.gyro].
    #[arg(long, value_name = "RAD_PER_S", value_parser = positive)]
    gyro_noise: Option<f64>,
    /// Take gyro and torque sensors as free of bias.
    #[arg(long)]
    no_biases: bool,
    /// Estimate base rate and appendages at the first sample; at rest unless given.
    #[arg(long)]
    initial_state: bool,
    /// Most linearisations of the fit.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    max_iterations: u32,
    /// Largest chi-squared per degree of freedom at which the model counts as explaining a record.
    #[arg(long, value_name = "CHI2", default_value_t = EXPLAINED, value_parser = positive)]
    max_chi2: f64,
}

pub(crate) fn positive(word: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("must be a number above zero".to_owned()),
    }
}

impl FitFlags {
    /// Largest chi-squared per degree of freedom that counts as explained.
    pub(crate) fn limit(&self) -> f64 {
        self.max_chi2
    }
    /// Noise of torque and gyro as given on the command line.
    pub(crate) fn noise(&self) -> (Option<f64>, Option<f64>) {
        (self.torque_noise, self.gyro_noise)
    }
    /// The settings for a mission; prior and start are the caller's.
    pub(crate) fn settings(&self, mission: &Mission) -> Settings {
        let s = Sensing::of(&mission.sensors);
        Settings {
            method: mission.estimate.method.map(|m| match m {
                EstimateMethod::Rda => Method::Rda,
                EstimateMethod::OutputError => Method::OutputError,
            }),
            noise: Noise {
                torque: self.torque_noise.unwrap_or(s.torque_nm),
                gyro: self.gyro_noise.unwrap_or(s.gyro_rad_per_s),
            },
            current_noise: self.current_noise.unwrap_or(mission.sensors.current.noise_std_a),
            drives: mission.drives.clone(),
            reflected_inertia: Vec::new(),
            biases: !self.no_biases,
            initial_state: self.initial_state,
            prior: None,
            start_offset: 0.0,
            seed: 0,
            max_iterations: self.max_iterations as usize,
            limit: self.max_chi2,
            adopt: Vec::new(),
            held_errors: Vec::new(),
            low_pass_hz: None,
            loss: Loss::Squares,
        }
    }
}

/// Runs a fit that shows how far it is on a terminal, and ends at Ctrl-C: with what there is, if `partial`.
pub(crate) fn watched<V>(
    output: &Output,
    partial: bool,
    work: impl FnOnce(&Observer<'_>) -> Result<V, IdentifyError>,
) -> Result<V, (Exit, Problems)> {
    let stop = interrupt::flag(output.own_process)?;
    let bar = output.progress().then(|| {
        let bar = ProgressBar::new_spinner();
        let style = ProgressStyle::with_template("{spinner} [{elapsed}] fitting: {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    });
    let tell = |n: usize, chi2: f64| {
        if let Some(bar) = &bar {
            bar.set_message(format!("linearisation {n}, chi-squared per residual {chi2:.6}"));
        }
    };
    let found = work(&Observer { stop: Some(&stop), progress: Some(&tell), partial, ..Observer::default() });
    if let Some(b) = &bar {
        b.finish_and_clear();
    }
    found.map_err(failed)
}

/// The code and the problem of a failure.
pub(crate) fn failed(e: IdentifyError) -> (Exit, Problems) {
    let one = |exit: Exit, area, code, what: String, hint: &str| {
        (exit, Problems(vec![Problem::error(area, code, what).hint(hint)]))
    };
    match e {
        IdentifyError::Refused(p) => (Exit::of(&p), p),
        IdentifyError::IllPosed(p) => (Exit::IllPosed, p),
        IdentifyError::Interrupted => {
            let what = "interrupted before anything was fitted; nothing was written".to_owned();
            one(Exit::Interrupted, Area::Config, "Fit::Interrupted", what, "run the command again")
        }
        IdentifyError::Fit(e @ (EstimateError::Transform(_) | EstimateError::Width(_))) => {
            one(Exit::Config, Area::Config, "Config::Start", e.to_string(), "check [estimate] and the start values")
        }
        IdentifyError::Fit(e) => {
            one(Exit::Numerical, Area::Config, "Fit::Failed", e.to_string(), "start nearer, or estimate less")
        }
        IdentifyError::Model(e) => {
            one(Exit::Numerical, Area::Config, "Fit::Failed", e, "check the parameters of the mission")
        }
    }
}
