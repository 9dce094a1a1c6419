//! Records of an experiment, and the models identified from them.

use super::system::System;
use crate::table::sig;
use ff_dynamics::{Trace, measure};
use ff_least_squares::Settings;
use ff_model::Params;
use ff_records::{Record, RecordBuilder};
use ffid::exit::Failure;
use ident::estimate::Estimate;
use ident::estimate::attempt;
use ident::parameters::offset_start;
use ident::{Options, OutputError, Rda, Request};
use serde::Serialize;

/// Which sensors a record was taken with: none but the truth, or those of the mission with a seed.
pub(super) type Noise = Option<u64>;

/// One identification, for the summary.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
    case: String,
    run: &'static str,
    model: &'static str,
    status: String,
    #[serde(skip)]
    converged: bool,
    iterations: usize,
    chi2_per_dof: f64,
    rank: usize,
    unknowns: usize,
    /// Largest error of a combination that the data determine to a tenth of its size or better, relative.
    worst_identifiable: f64,
    identifiable: usize,
    parameters: Vec<Row>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) name: String,
    pub(super) unit: String,
    pub(super) start: f64,
    pub(super) value: f64,
    pub(super) truth: f64,
    /// Left out where the data cannot tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) std: Option<f64>,
}

/// Relative standard deviation up to which a combination of parameters counts as identifiable.
const IDENTIFIABLE: f64 = 0.1;

/// The record of a trace: exact with rates and accelerations, or as the sensors read it.
pub(super) fn record(s: &System, t: &Trace, noise: Noise, seed_offset: u64) -> anyhow::Result<Record> {
    let b = RecordBuilder::new(s.model().joint_names()).uniform(0.0, 1.0 / t.dt).allow("Data::Stuck");
    let b = match noise {
        None => b.q(t.q.clone()).qd(t.qd.clone()).qdd(t.qdd.clone()).tau(t.tau.clone()).gyro(t.gyro()),
        Some(seed) => {
            let r = measure(t, &s.sensors, seed.wrapping_add(seed_offset));
            b.q(r.q).tau(r.tau).gyro(r.gyro)
        }
    };
    Ok(b.build()?.0)
}

pub(super) fn settings() -> Settings {
    Settings { max_iterations: 60, decrement_tolerance: 1e-9, cost_floor: 1e-13, ..Settings::default() }
}

/// A fit: the parameters it ends with, what the summary says of it, and the fit itself.
pub(super) struct Found {
    pub(super) params: Params<f64>,
    pub(super) report: Report,
    pub(super) estimate: Estimate,
}

/// The base of a rigid model by the reduced dynamics algorithm, from the mission's offset off, in a direction of seed `start`; `model` is
/// what the summary calls it.
pub(super) fn rigid(
    s: &System,
    record: &Record,
    noise: Noise,
    truth: &Params<f64>,
    start: u64,
    model: &'static str,
) -> anyhow::Result<Found> {
    let m = &s.rigid;
    let decls = m.param_decls();
    let selected: Vec<usize> = (0..10).collect();
    let start = offset_start(&decls, truth.values(), &selected, s.loaded.mission.estimate.start_offset, start);
    let mut rda = Rda::new(m, record, &s.noise)?;
    let request = Request { settings: settings(), ..Request::new(&decls, &selected, &start) };
    let e = attempt(&request, &mut rda)?;
    let report = report(s, model, noise, &e, truth);
    Ok(Found { params: Params::from_values(m, e.values.clone()), report, estimate: e })
}

/// Everything the mission asks for, by output error, from the mission's offset off, in a direction of seed `start`.
pub(super) fn extended(s: &System, record: &Record, noise: Noise, start: u64) -> anyhow::Result<Found> {
    let m = s.model();
    let decls = m.param_decls();
    let e = &s.loaded.mission.estimate;
    let selected = s.estimated(&decls)?;
    let start = offset_start(&decls, s.params.values(), &selected, e.start_offset, start);
    let options = Options { substeps: 1, ..Options::new(s.noise) };
    let mut output_error = OutputError::new(m, record, &options)?;
    let request = Request {
        // Perfect data need no prior; what they leave open is held where it is.
        prior_width: if noise.is_some() { e.prior_relative_std } else { None },
        anchor: if noise.is_some() { None } else { Some(10.0) },
        settings: settings(),
        ..Request::new(&decls, &selected, &start)
    };
    let e = attempt(&request, &mut output_error)?;
    let report = report(s, "extended", noise, &e, &s.params);
    Ok(Found { params: Params::from_values(m, e.values.clone()), report, estimate: e })
}

fn report(s: &System, model: &'static str, noise: Noise, e: &Estimate, truth: &Params<f64>) -> Report {
    let decls = if model != "extended" { s.rigid.param_decls() } else { s.model().param_decls() };
    let true_value = |name: &str| decls.iter().position(|d| d.name == name).map_or(0.0, |i| truth.values()[i]);
    let u = &e.data_only;
    let errors: Vec<f64> = e.parameters.iter().map(|p| p.value - true_value(&p.name)).collect();
    let (identifiable, worst_identifiable) = u.worst_combination(&errors, IDENTIFIABLE);
    Report {
        case: s.name.clone(),
        run: if noise.is_some() { "noisy" } else { "noise_free" },
        model,
        status: format!("{:?}", e.status),
        converged: e.status.is_converged(),
        iterations: e.iterations,
        chi2_per_dof: e.chi2_per_dof,
        rank: u.rank,
        unknowns: u.unknowns.len(),
        worst_identifiable,
        identifiable,
        parameters: e
            .parameters
            .iter()
            .map(|p| Row {
                name: p.name.clone(),
                unit: p.unit.clone(),
                start: p.start,
                value: p.value,
                truth: true_value(&p.name),
                std: p.std,
            })
            .collect(),
    }
}

impl Report {
    pub(super) fn title(&self) -> String {
        format!("{}, {}, {}", self.case, self.run.replace('_', "-"), self.model)
    }
    /// The fit as cells of a table: case, run, model, directions seen, told to a tenth, worst error of these, steps, chi-squared.
    pub(super) fn cells(&self) -> [String; 8] {
        [
            self.case.clone(),
            self.run.replace('_', "-"),
            self.model.to_owned(),
            format!("{} of {}", self.rank, self.unknowns),
            self.identifiable.to_string(),
            format!("{:.1e}", self.worst_identifiable),
            self.iterations.to_string(),
            sig(self.chi2_per_dof, 3),
        ]
    }
    pub(super) fn worst(&self) -> f64 {
        self.worst_identifiable
    }
    pub(super) fn chi2_per_dof(&self) -> f64 {
        self.chi2_per_dof
    }
    /// Itself, if the fit has converged.
    ///
    /// # Errors
    /// [`Failure::Numerical`] naming the fit.
    pub(super) fn ended(&self) -> anyhow::Result<()> {
        let said = || Failure::Numerical(format!("{}: the fit ended with {}", self.title(), self.status));
        if self.converged { Ok(()) } else { Err(said().into()) }
    }
    pub(super) fn is(&self, run: &str, model: &str) -> bool {
        self.run == run && self.model == model
    }
    pub(super) fn rows(&self) -> &[Row] {
        &self.parameters
    }
}
