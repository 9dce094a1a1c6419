//! What a fit is made of: unknowns and errors of a mission, and the estimators of its records.

use super::adoption::Adopted;
use super::error::{IdentifyError, config};
use super::fitted::Ended;
use super::labelled_record::LabelledRecord;
use super::options::FitOptions;
use super::over_time::{OverTime, later};
use super::record_estimator::{RecordEstimator, Twin};
use super::result::fit::Method;
use super::settings::{Settings, method};
use super::uncertain::UncertainItems;
use super::unknowns::Unknowns;
use crate::open::Opened;
use ff_least_squares::Settings as Solver;
use ff_model::{Area, Model, Problem, Problems};
use ident::compose::{Shared, SharedErrors};
use ident::{Estimator, Loss, Request, Several};

/// Pull that holds what neither data nor priors tell near where it is, relative.
const ANCHOR: f64 = 10.0;
/// Promised reduction of chi-squared below which a fit is at its end: a thirtieth of a standard deviation is left to go.
const GAIN: f64 = 1e-3;

/// What a fit is made of, before any record is predicted.
pub(super) struct Setup {
    pub(super) settings: Settings,
    pub(super) options: FitOptions,
    pub(super) unknowns: Unknowns,
    pub(super) shared: Shared,
    pub(super) labels: Vec<String>,
    pub(super) uncertain: UncertainItems,
    /// What the mission is not sure of and the method knows nothing of.
    pub(super) not_allowed_for: Vec<String>,
    pub(super) estimated: Vec<usize>,
}

impl Setup {
    pub(super) fn new(
        opened: &Opened,
        records: &[LabelledRecord],
        settings: &Settings,
        options: &FitOptions,
    ) -> Result<Self, IdentifyError> {
        let model = &opened.model;
        let adopted = Adopted::new(model, &opened.estimated, &settings.adopt).map_err(IdentifyError::Refused)?;
        // What is held is at the values of the model.
        let of_mission = if options.consider {
            UncertainItems::beside(opened, &opened.estimated)
        } else {
            UncertainItems::of(opened)
        };
        let every = of_mission.in_records(opened.mission.as_ref(), model, records, settings)?;
        let mut every = every.with_drives(model, records, settings)?;
        if records.len() > 1 {
            adopted.share(model, &settings.noise, &mut every);
        }
        if options.consider {
            consider_alone(&every, settings, options).map_err(IdentifyError::Refused)?;
        }
        // The rigid method knows no errors of sensors and placements.
        let needs = (every.needs_output_error() || adopted.of_sensors()) && settings.method.is_none();
        let how = if needs { Method::OutputError } else { method(model, settings.method) };
        if how == Method::Rda && adopted.of_sensors() {
            let what = "--adopt: the rigid method has no columns of errors of sensors and placements";
            return Err(IdentifyError::Refused(config("Config::NotAdoptable", what, "leave --method out")));
        }
        let (uncertain, not_allowed_for) =
            if how == Method::Rda { every.of_parameters_alone() } else { (every, Vec::new()) };
        let settings =
            Settings { method: if needs { Some(Method::OutputError) } else { settings.method }, ..settings.clone() };
        let mut estimated = opened.estimated.clone();
        estimated.extend(&adopted.parameters);
        let mut options = FitOptions { ties: [&options.ties[..], &adopted.ties].concat(), ..options.clone() };
        // What may have changed since is known less well.
        if let (Some(p), Some(mission)) = (&options.posterior, &opened.mission) {
            options.posterior = Some(later(p, mission, model)?);
        }
        let unknowns = Unknowns::new(model, &estimated, &settings, &options, &uncertain)?;
        let decls = model.param_decls();
        let labelled: Vec<(&str, &[_])> = records.iter().map(|t| (t.label.as_str(), decls.as_slice())).collect();
        let none: [&str; 0] = [];
        let shared = Shared::new(&labelled, &none)
            .map_err(|e| IdentifyError::Refused(config("Config::Records", e.to_string(), "name each record once")))?;
        let labels: Vec<String> = records.iter().map(|t| t.label.clone()).collect();
        Ok(Self { settings, options, unknowns, shared, labels, uncertain, not_allowed_for, estimated })
    }
    /// Of all unknowns, from the start.
    pub(super) fn request(&self) -> Result<Request<'_>, IdentifyError> {
        let unknowns = &self.unknowns;
        let solver = Solver {
            max_iterations: self.settings.max_iterations,
            decrement_tolerance: 1e-10,
            gain_tolerance: GAIN,
            cost_floor: 1e-13,
            ..Solver::default()
        };
        Ok(Request {
            anchor: (!unknowns.has_priors()).then_some(ANCHOR),
            marginal: unknowns.marginal.iter().map(|m| (m.0, m.1.std)).collect(),
            loss: self.settings.loss,
            priors: unknowns.priors(&unknowns.selected)?,
            settings: solver,
            centre: Some(&unknowns.start),
            ..Request::new(&unknowns.decls, &unknowns.selected, &unknowns.start)
        })
    }
    pub(super) fn assembly<'a>(&'a self, model: &'a Model, records: &'a [LabelledRecord]) -> Assembly<'a> {
        let Self { settings, unknowns, shared, labels, .. } = self;
        Assembly { model, records, settings, shared, labels, unknowns }
    }
    /// The estimator of all records.
    pub(super) fn estimator<'a>(
        &'a self,
        model: &'a Model,
        records: &'a [LabelledRecord],
    ) -> Result<Box<dyn Estimator + 'a>, IdentifyError> {
        Ok(self.assembly(model, records).assemble(&self.uncertain)?.whole)
    }
}

/// Refuses what considered errors do not go with.
fn consider_alone(uncertain: &UncertainItems, s: &Settings, o: &FitOptions) -> Result<(), Problems> {
    let refused = |what: &str, place: &str, hint: &str| {
        let p = Problem::error(Area::Config, "Config::Consider", what).on(place).hint(hint);
        Err(Problems(vec![p]))
    };
    let exact = "the mission is sure of everything, and nothing can be considered";
    if uncertain.count() == 0 {
        return refused(
            exact,
            "--consider",
            "say in [[uncertain]] and [sensors] what is not known exactly, or leave it out",
        );
    }
    let alone = "considered errors widen the covariance of a least-squares fit of all parameters alone";
    for (place, given) in [
        ("--profile", !o.profile.is_empty()),
        ("--reduce", o.reduce),
        ("--prior-from", o.posterior.is_some()),
        ("--loss", s.loss != Loss::Squares),
    ] {
        if given {
            return refused(alone, place, "leave it out, or leave --consider out and estimate the errors");
        }
    }
    Ok(())
}

/// What the estimators of a fit are made of.
#[derive(Clone, Copy)]
pub(super) struct Assembly<'a> {
    pub(super) model: &'a Model,
    pub(super) records: &'a [LabelledRecord],
    pub(super) settings: &'a Settings,
    pub(super) shared: &'a Shared,
    pub(super) labels: &'a [String],
    pub(super) unknowns: &'a Unknowns,
}

/// Estimator of all records over the unknowns of a fit.
pub(super) struct Assembled<'a> {
    pub(super) whole: Box<dyn Estimator + 'a>,
    pub(super) twins: Vec<Twin<'a>>,
    /// Standard deviation of every channel of a sample, and residuals of each record.
    pub(super) sigma: Vec<f64>,
    pub(super) rows: Vec<usize>,
}

impl<'a> Assembly<'a> {
    /// With columns of these errors of sensors and placements.
    pub(super) fn assemble(&self, uncertain: &UncertainItems) -> Result<Assembled<'a>, IdentifyError> {
        let over = &uncertain.over_time;
        self.with(uncertain, &mut |k, t: &'a LabelledRecord, s| {
            RecordEstimator::beside(self.model, &t.record, s, uncertain, over.walks_of(k))
        })
    }
    /// [`Assembly::assemble`] with the motions of other estimators of the same records, the model at the end of a fit.
    pub(super) fn again<'t: 'a>(
        &self,
        uncertain: &UncertainItems,
        twins: &[Twin<'t>],
        at: &Ended<'_>,
    ) -> Result<Assembled<'a>, IdentifyError> {
        self.with(uncertain, &mut |k, _, s| RecordEstimator::again(&twins[k], s, uncertain, at))
    }
    fn with(
        &self,
        uncertain: &UncertainItems,
        make: &mut dyn FnMut(usize, &'a LabelledRecord, &Settings) -> Result<RecordEstimator<'a>, IdentifyError>,
    ) -> Result<Assembled<'a>, IdentifyError> {
        let moving = Settings { initial_state: true, ..self.settings.clone() };
        let over = &uncertain.over_time;
        let mut of = |(k, t): (usize, &'a LabelledRecord)| {
            let settings = if t.continues { &moving } else { self.settings };
            make(k, t, settings)
        };
        let mut fits = self.records.iter().enumerate().map(&mut of).collect::<Result<Vec<_>, _>>()?;
        let sigma = fits.first().map(|f| f.sigmas(self.model)).unwrap_or_default();
        let rows: Vec<usize> = fits.iter_mut().map(|f| f.estimator().rows()).collect();
        let (mut parts, mut twins): (Vec<Box<dyn Estimator + '_>>, Vec<Twin<'_>>) =
            fits.into_iter().map(RecordEstimator::split).unzip();
        let decls = self.model.param_decls();
        for (k, twin) in twins.iter_mut().enumerate() {
            twin.changes = over.changes_of(k).to_vec();
        }
        parts =
            parts.into_iter().zip(&twins).map(|(part, twin)| OverTime::changed(part, &decls, &twin.changes)).collect();
        let mut whole = if parts.len() == 1 { parts.remove(0) } else { Box::new(Several::new(self.shared, parts)) };
        let names = uncertain.shared_names();
        if !names.is_empty() {
            let mut shared = SharedErrors::new(whole, decls.len(), &names, self.labels);
            for (i, name) in names.iter().enumerate() {
                if let Some(made) = over.combined.get(name) {
                    shared = shared.combine(i, made);
                }
            }
            whole = Box::new(shared);
        }
        Ok(Assembled { whole: self.unknowns.tied(whole), twins, sigma, rows })
    }
}
