//! The estimator that predicts one record.

use super::adoption::Adopted;
use super::drives::Drives;
use super::error::{IdentifyError, config};
use super::fitted::Ended;
use super::result::fit::Method;
use super::settings::{Settings, method};
use super::uncertain::UncertainItems;
use crate::modes::held;
use crate::workflow::preflight::step;
use ff_model::{Area, BaseKind, Model, Params, Problem, Problems};
use ff_records::{ChannelGroup, Record};
use ident::Estimator;
use ident::SetupError;
use ident::uncertain::ErrorSource;
use ident::{Noise, Options, OutputError, Rda};
use nalgebra::DMatrix;

/// What integration may be off by, in deviations of an estimate.
const STEP_ERROR: f64 = 0.02;

/// The estimator of a record, chosen by the method.
pub struct RecordEstimator<'a> {
    estimator: Box<dyn Estimator + 'a>,
    record: (&'a Model, &'a Record),
    /// Output error with the same motion, where that is the method.
    twin: Option<OutputError<'a>>,
    method: Method,
    noise: Noise,
    /// Standard deviation of every torque channel in its unit; none for torques that are all alike.
    channel_noise: Vec<f64>,
    /// Errors that this record alone has.
    own: Vec<ErrorSource>,
}

impl<'a> RecordEstimator<'a> {
    /// Chooses by the method; the steps of the integration by the modes.
    ///
    /// # Errors
    /// [`IdentifyError::Refused`].
    pub fn new(model: &'a Model, record: &'a Record, s: &Settings) -> Result<Self, IdentifyError> {
        Self::beside(model, record, s, &UncertainItems::default(), &[])
    }
    /// With the errors of sensors and placements that the mission is not sure of among its unknowns, and errors of this record.
    pub(super) fn beside(
        model: &'a Model,
        record: &'a Record,
        s: &Settings,
        uncertain: &UncertainItems,
        own: &[ErrorSource],
    ) -> Result<Self, IdentifyError> {
        let drives = Drives::of(model, record, s);
        // The rigid method knows no friction and no currents; it makes way unless it is asked for.
        let makes_way = s.method.is_none() && !drives.is_empty() && model.base_kind() == BaseKind::Floating;
        let method = if makes_way { Method::OutputError } else { method(model, s.method) };
        let mut twin = None;
        let estimator: Box<dyn Estimator + 'a> = match method {
            Method::Ground => {
                let what = "the ground calibration predicts no free-floating robot";
                return Err(IdentifyError::Refused(config("Config::Method", what, "leave --method out")));
            }
            Method::Rda => Box::new(Rda::new(model, record, &s.noise).map_err(setup)?),
            Method::OutputError => {
                let substeps = substeps(model, record);
                let mut options =
                    Options { substeps, step_error: Some(STEP_ERROR), ..wanted(model, s, uncertain, own)? };
                drives.widen(&mut options);
                let fit = OutputError::new(model, record, &options).map_err(setup)?;
                let fit = fit.suited(Params::nominal(model).values()).map_err(setup)?;
                twin = Some(fit.with_options(&Options::new(s.noise)).map_err(setup)?);
                Box::new(fit)
            }
        };
        let channel_noise = drives.channel_noise().to_vec();
        Ok(Self { estimator, record: (model, record), twin, method, noise: s.noise, channel_noise, own: own.to_vec() })
    }
    /// [`RecordEstimator::beside`] with the motion of another estimator of the same record, and joints deflected by the torques of
    /// the model at the end of a fit.
    pub(super) fn again(
        twin: &Twin<'a>,
        s: &Settings,
        uncertain: &UncertainItems,
        at: &Ended<'_>,
    ) -> Result<Self, IdentifyError> {
        let record = twin.record;
        let Some(of) = &twin.of else {
            return Self::beside(record.0, record.1, s, uncertain, &twin.own);
        };
        let (deflected_at, compliances) = (Some(at.values.to_vec()), at.compliances());
        let options = Options { deflected_at, compliances, ..wanted(record.0, s, uncertain, &twin.own)? };
        let fit = of.with_options(&options).map_err(setup)?;
        let (own, channel_noise) = (twin.own.clone(), twin.channel_noise.clone());
        let twin = Some(fit.with_options(&Options::new(s.noise)).map_err(setup)?);
        let (estimator, method) = (Box::new(fit), Method::OutputError);
        Ok(Self { estimator, record, twin, method, noise: s.noise, channel_noise, own })
    }
    /// Output error of the same record that predicts it alone: no unknowns beside the parameters, every reading counting alike. `None` for
    /// the rigid method.
    pub(in crate::workflow) fn plain(&self) -> Result<Option<OutputError<'a>>, IdentifyError> {
        let options = Options { all_alike: true, ..Options::new(self.noise) };
        self.twin.as_ref().map(|twin| twin.with_options(&options).map_err(setup)).transpose()
    }
    /// The estimator.
    pub fn estimator(&mut self) -> &mut (dyn Estimator + 'a) {
        &mut *self.estimator
    }
    /// The estimator, by value.
    pub fn into_estimator(self) -> Box<dyn Estimator + 'a> {
        self.estimator
    }
    /// The estimator, and what makes others of the same record.
    pub(super) fn split(self) -> (Box<dyn Estimator + 'a>, Twin<'a>) {
        let Self { estimator, record, twin, noise, channel_noise, own, .. } = self;
        (estimator, Twin { record, of: twin, noise, channel_noise, own, changes: Vec::new() })
    }
    /// Standard deviation of every channel of a sample, in the order of the residuals.
    pub fn sigmas(&self, model: &Model) -> Vec<f64> {
        let mut out = match self.method {
            Method::OutputError if !self.channel_noise.is_empty() => {
                self.channel_noise.iter().copied().chain([self.noise.gyro; 3]).collect()
            }
            Method::OutputError => sigmas(model, &self.noise),
            _ => vec![self.noise.torque; model.nj()],
        };
        // Means have less.
        let gains = [ChannelGroup::Torque, ChannelGroup::Gyro].map(|g| self.record.1.noise_gain(g));
        let joints = model.nj();
        out.iter_mut().enumerate().for_each(|(k, sigma)| *sigma *= gains[usize::from(k >= joints)]);
        out
    }
}

/// Options of output error with the unknowns that these settings ask for, and errors of one record.
fn wanted(
    model: &Model,
    s: &Settings,
    uncertain: &UncertainItems,
    own: &[ErrorSource],
) -> Result<Options, IdentifyError> {
    let (gyro_bias, torque_bias, initial_state) = (s.biases, s.biases, s.initial_state);
    let options = Options { gyro_bias, torque_bias, initial_state, ..Options::new(s.noise) };
    let adopted = Adopted::new(model, &[], &s.adopt).map_err(IdentifyError::Refused)?;
    let mut options = adopted.widen(options);
    uncertain.widen(&mut options);
    options.errors.extend_from_slice(own);
    Ok(options)
}

/// What predicts a record with other unknowns than those of a fit.
pub(super) struct Twin<'a> {
    record: (&'a Model, &'a Record),
    of: Option<OutputError<'a>>,
    noise: Noise,
    channel_noise: Vec<f64>,
    /// Errors that this record alone has.
    pub(super) own: Vec<ErrorSource>,
    /// Parameters that are others in it than in the last record, with the sizes of their steps.
    pub(super) changes: Vec<(usize, f64)>,
}

impl<'a> Twin<'a> {
    /// The record.
    pub(super) fn record(&self) -> &'a Record {
        self.record.1
    }
    /// Kinks of its motion, and what they leave open ([`OutputError::kinks`]).
    pub(super) fn kinks(&self) -> (usize, usize, usize) {
        self.of.as_ref().map_or((0, 0, 0), OutputError::kinks)
    }
    /// When kinks of its motion are ([`OutputError::kink_times`]).
    pub(super) fn kink_times(&self) -> Vec<f64> {
        self.of.as_ref().map(OutputError::kink_times).unwrap_or_default()
    }
    /// Up to where its positions tell accelerations ([`OutputError::told_hz`]).
    pub(super) fn told_hz(&self) -> Option<f64> {
        self.of.as_ref()?.told_hz()
    }
    /// What draws of the encoders' noise do to the residuals at these parameters, a column each; none where nothing is predicted there, or no motion was
    /// fitted.
    pub(super) fn draws_of_motion(&self, draws: usize, full: &[f64]) -> Option<DMatrix<f64>> {
        self.of.as_ref()?.draws_of_motion(draws, full).ok()?
    }
    /// Output error of the same record with other options, for columns that need not be exact ([`OutputError::survey`]); for the rigid
    /// method, whose torques are predicted from the gyro, made anew.
    pub(super) fn survey(&self, options: &Options, full: &[f64]) -> Result<OutputError<'a>, SetupError> {
        match &self.of {
            Some(of) => of.survey(options, full),
            None => {
                let (model, record) = self.record;
                // Its residuals are those of this estimator, so that they have to be exact.
                OutputError::new(model, record, &Options { noise: self.noise, ..options.clone() })
            }
        }
    }
}

/// Standard deviations of torques and gyro.
pub(in crate::workflow) fn sigmas(model: &Model, noise: &Noise) -> Vec<f64> {
    let mut out = vec![noise.torque; model.nj()];
    out.extend([noise.gyro; 3]);
    out
}

/// Why a record cannot be predicted at all.
pub(super) fn setup(e: SetupError) -> IdentifyError {
    let (area, hint) = match e {
        SetupError::JointMotion(_) => (Area::Data, "look at the joint positions of the record"),
        SetupError::TimeBase(_) => (Area::Data, "look at the sample times of the record"),
        _ => (Area::Config, "check mission and record"),
    };
    IdentifyError::Refused(Problems(vec![Problem::error(area, "Data::Setup", e.to_string()).hint(hint)]))
}

/// Steps per sample that the modes need, at the start pose of a record.
fn substeps(model: &Model, record: &Record) -> usize {
    let pose: Vec<f64> = record.q().row(0).iter().copied().collect();
    let params = Params::nominal(model);
    let rest = model.rest_position(&params);
    let h = step(&held(model, &params, &pose, &rest), record.seconds(), record.dt());
    (record.dt() / h).round().max(1.0) as usize
}
