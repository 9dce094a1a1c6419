//! Records of an experiment, and the models identified from them.

use super::experiment::Experiment;
use ff_dynamics::{Trace, measure};
use ff_least_squares::Settings;
use ff_model::{Model, Params};
use ff_records::{Record, RecordBuilder};
use ffid::exit::Failure;
use ident::estimate::Estimate;
use ident::estimate::attempt;
use ident::parameters::offset_start;
use ident::parameters::select;
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
struct Row {
    name: String,
    unit: String,
    start: f64,
    value: f64,
    truth: f64,
    /// Left out where the data cannot tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    std: Option<f64>,
}

/// Relative standard deviation up to which a combination of parameters counts as identifiable.
const IDENTIFIABLE: f64 = 0.1;

/// The record of a trace: exact with rates and accelerations, or as the sensors read it.
pub(super) fn record(x: &Experiment, t: &Trace, noise: Noise, seed_offset: u64) -> anyhow::Result<Record> {
    let b = RecordBuilder::new(x.loaded.model.joint_names()).uniform(0.0, 1.0 / t.dt).allow("Data::Stuck");
    let b = match noise {
        None => b.q(t.q.clone()).qd(t.qd.clone()).qdd(t.qdd.clone()).tau(t.tau.clone()).gyro(t.gyro()),
        Some(seed) => {
            let r = measure(t, &x.sensors, seed.wrapping_add(seed_offset));
            b.q(r.q).tau(r.tau).gyro(r.gyro)
        }
    };
    Ok(b.build()?.0)
}

fn settings() -> Settings {
    Settings { max_iterations: 60, decrement_tolerance: 1e-9, cost_floor: 1e-13, ..Settings::default() }
}

/// The base of a rigid model by the reduced dynamics algorithm, from `offset` off.
pub(super) fn rigid(
    x: &Experiment,
    record: &Record,
    noise: Noise,
    truth: &Params<f64>,
) -> anyhow::Result<(Params<f64>, Report)> {
    let m = &x.rigid;
    let decls = m.param_decls();
    let selected: Vec<usize> = (0..10).collect();
    let start = offset_start(&decls, truth.values(), &selected, x.loaded.mission.estimate.start_offset, x.seed);
    let mut rda = Rda::new(m, record, &x.noise)?;
    let request = Request { settings: settings(), ..Request::new(&decls, &selected, &start) };
    let e = attempt(&request, &mut rda)?;
    let report = report(x, "rigid", noise, &e, truth);
    Ok((Params::from_values(m, e.values), report))
}

/// Everything the mission asks for, by output error, from the mission's offset off.
pub(super) fn extended(x: &Experiment, record: &Record, noise: Noise) -> anyhow::Result<(Params<f64>, Report)> {
    let m: &Model = &x.loaded.model;
    let decls = m.param_decls();
    let e = &x.loaded.mission.estimate;
    let selected = if x.quick { select(&decls, &["base.*", "*.k[*]", "*.d[*]"])? } else { x.loaded.estimated.clone() };
    let start = offset_start(&decls, x.params.values(), &selected, e.start_offset, x.seed);
    let options = Options { substeps: 1, ..Options::new(x.noise) };
    let mut output_error = OutputError::new(m, record, &options)?;
    let request = Request {
        // Perfect data need no prior; what they leave open is held where it is.
        prior_width: if noise.is_some() { e.prior_relative_std } else { None },
        anchor: if noise.is_some() { None } else { Some(10.0) },
        settings: settings(),
        ..Request::new(&decls, &selected, &start)
    };
    let e = attempt(&request, &mut output_error)?;
    if !e.status.is_converged() && noise.is_some() {
        return Err(Failure::Numerical(format!("{}: extended identification ended with {:?}", x.name, e.status)).into());
    }
    let report = report(x, "extended", noise, &e, &x.params);
    Ok((Params::from_values(m, e.values), report))
}

fn report(x: &Experiment, model: &'static str, noise: Noise, e: &Estimate, truth: &Params<f64>) -> Report {
    let decls = if model == "rigid" { x.rigid.param_decls() } else { x.loaded.model.param_decls() };
    let true_value = |name: &str| decls.iter().position(|d| d.name == name).map_or(0.0, |i| truth.values()[i]);
    let u = &e.data_only;
    let errors: Vec<f64> = e.parameters.iter().map(|p| p.value - true_value(&p.name)).collect();
    let (identifiable, worst_identifiable) = u.worst_combination(&errors, IDENTIFIABLE);
    Report {
        case: x.name.clone(),
        run: if noise.is_some() { "noisy" } else { "noise_free" },
        model,
        status: format!("{:?}", e.status),
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
        format!("{} {} {}", self.case, self.run, self.model)
    }
    pub(super) fn line(&self) -> String {
        format!(
            "{}: {} of {} directions seen, {} of them to 10 % or better, worst error of these {:.1e}; {} steps, chi2/dof {:.2e}",
            self.title(),
            self.rank,
            self.unknowns,
            self.identifiable,
            self.worst_identifiable,
            self.iterations,
            self.chi2_per_dof
        )
    }
    pub(super) fn worst(&self) -> f64 {
        self.worst_identifiable
    }
    pub(super) fn is(&self, run: &str, model: &str) -> bool {
        self.run == run && self.model == model
    }
}
