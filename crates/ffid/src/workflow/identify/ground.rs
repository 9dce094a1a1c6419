//! The arm on the ground: a fixed base with gravity, positions and torques, joint friction. Linear least squares
//! ([`Ground`]), made physical by projection ([`ident::solve::project`](mod@ident::solve::project)).

use super::bandwidth::correlated_samples;
use super::error::{IdentifyError, config};
use super::findings::{DeterminedCombination, HALF95, ReducedSet};
use super::ground_uncertain::{Calibration, SetUp};
use super::identified::Identified;
use super::known;
use super::labelled_record::LabelledRecord;
use super::number::num;
use super::options::FitOptions;
use super::report::{record_line, records_of};
use super::result::fit::{Ended, Method};
use super::result::identification::IdentificationResult;
use super::result::parameter::{Combination, Correlation, Covariance, Parameter, ParameterVerdict, Value};
use super::result::provenance::{Provenance, Warning};
use super::settings::Settings;
use super::signals::Signals;
use super::text;
use super::uncertain::{DeclaredUncertain, UncertainItems};
use super::unknowns::Unknowns;
use crate::open::Opened;
use ff_least_squares::{Criterion, Status};
use ff_model::{Area, JointKind, Model, Problem, Problems};
use ff_records::Record;
use ident::Loss;
use ident::Posterior;
use ident::Priors;
use ident::SetupError;
use ident::estimate::report::FitReport;
use ident::estimate::{Calibrated, Elastic, Foretold, JointTerm, JointTorques};
use ident::solve::{LinearError, LinearEstimate};
use ident::uncertain::ErrorSource;
use ident::{Friction, Ground, GroundEstimate};
use nalgebra::DMatrix;

/// Joint friction, gains and noise, as an identification found them, and how well it knows its unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// Friction, reflected inertia and gains of every joint.
    pub joints: JointTorques,
    /// Compliance of every joint (rad/(N m), m/N), zero for stiff ones.
    pub compliances: Vec<f64>,
    /// Standard deviation of the residual of every joint (N m; A where its current was measured).
    pub sigma: Vec<f64>,
    /// Cutoff of the low pass that torques and equations went through (Hz), if any.
    pub low_pass_hz: Option<f64>,
    /// Covariance of parameters, friction and gains.
    pub covariance: Covariance,
}

/// Times that joints which bend are looked for beside what was found with them.
const BENDINGS: usize = 4;

/// Name of the cutoff among the settings of a result.
pub const LOW_PASS: &str = "low_pass_hz";

impl Arm {
    /// Of a result; none when it is not that of a ground calibration.
    pub fn of(r: &IdentificationResult, joints: &[String]) -> Option<Self> {
        if r.method != Method::Ground {
            return None;
        }
        let terms = |joint: &String| {
            let of = |p: &Parameter| Some((JointTerm::of_name(&p.name, joint)?, p.value));
            r.nuisance.iter().filter_map(of).collect()
        };
        let value = |of: ErrorSource| {
            let name = of.name(joints);
            r.nuisance.iter().find(|p| p.name == name).map(|p| p.value)
        };
        let each = 0..joints.len();
        let sigma = r.channels.iter().map(|c| if c.over_noise > 0.0 { c.residual_rms / c.over_noise } else { 1.0 });
        Some(Self {
            joints: JointTorques {
                terms: joints.iter().map(terms).collect(),
                gains: each.clone().map(|j| value(ErrorSource::DriveGain(j))).collect(),
            },
            compliances: each.map(|j| value(ErrorSource::Compliance(j)).unwrap_or(0.0)).collect(),
            sigma: sigma.collect(),
            low_pass_hz: r.provenance.settings.get(LOW_PASS).and_then(|hz| hz.parse().ok()),
            covariance: r.covariance.clone(),
        })
    }
}

/// The estimator.
pub(super) fn calibration(model: &Model, low_pass_hz: Option<f64>) -> Result<Ground<'_>, IdentifyError> {
    let ground = Ground::new(model, Friction::ALL).map_err(linear)?;
    Ok(match low_pass_hz {
        Some(hz) => ground.low_pass(hz),
        None => ground,
    })
}

pub(super) fn linear(e: LinearError) -> IdentifyError {
    let (area, code, hint) = match &e {
        LinearError::Base { .. } | LinearError::Option { .. } => {
            (Area::Config, "Config::Method", "see [robot] base and the flags of the command")
        }
        LinearError::Setup(SetupError::JointMotion(_)) => {
            (Area::Data, "Data::Setup", "look at the joint positions of the record")
        }
        LinearError::Linalg(_) => return IdentifyError::Model(e.to_string()),
        _ => (Area::Data, "Data::Setup", "check mission and record"),
    };
    IdentifyError::Refused(Problems(vec![Problem::error(area, code, e.to_string()).hint(hint)]))
}

/// What the ground calibration does not do.
pub(super) fn check(s: &Settings, options: &FitOptions) -> Result<(), Problems> {
    let wrong = [
        (options.consider, "considered errors", "leave --consider out: the verdict says what is taken as exact"),
        (
            options.posterior.is_some(),
            "an earlier identification without its records",
            "give all records at once with --records",
        ),
        (!options.ties.is_empty(), "ties", "estimate the parameters for themselves"),
        (!options.profile.is_empty(), "profiles", "its cost is a parabola: the intervals are exact"),
        (
            s.loss != Loss::Squares,
            "robust loss",
            "give --loss squares, and leave samples that are wrong out of the record",
        ),
        (options.more_starts > 0, "other starts", "it is linear: every start leads to the same answer"),
    ];
    match wrong.iter().find(|w| w.0) {
        None => Ok(()),
        Some((_, what, hint)) => Err(config("Config::Method", format!("the ground calibration takes no {what}"), hint)),
    }
}

/// Calibrates.
pub(super) fn identify(
    opened: &Opened,
    records: &[LabelledRecord],
    s: &Settings,
    options: &FitOptions,
    provenance: Provenance,
) -> Result<Identified, IdentifyError> {
    let model = &opened.model;
    let unknowns = Unknowns::new(model, &opened.estimated, s, options, &UncertainItems::means(opened))?;
    let (decls, selected, start) = (&unknowns.decls, &unknowns.selected, &unknowns.start);
    let absent = records.iter().map(|r| missing(model, options, &r.label)).collect::<Result<Vec<_>, _>>()?;
    let prior = priors(&unknowns, s);
    let mut ground = calibration(model, s.low_pass_hz)?.absent(absent.clone()).priors(prior.clone());
    let measured: Vec<&Record> = records.iter().map(|r| &r.record).collect();
    let (mut terms, _) = ground.choose_terms(&measured, selected, start).map_err(linear)?;
    ground = ground.terms(terms.clone());
    let mut found = ground.estimate(&measured, selected, start).map_err(linear)?;
    // Joints that bend between encoder and link: from here on, records are those of the links. Gains of drives that were found with stiff joints
    // are not those of joints that bend, which are looked for again beside the new ones.
    let mut next = ground.elastic(&measured, (selected, start), &found).map_err(linear)?;
    let mut elastic: Vec<Elastic> = Vec::new();
    let mut linked: Vec<Record> = Vec::new();
    let mut compliances = vec![0.0; model.nj()];
    for _ in 0..BENDINGS {
        if next.is_empty() {
            break;
        }
        elastic = next;
        compliances.fill(0.0);
        elastic.iter().for_each(|e| compliances[e.joint] = e.compliance);
        linked = linked_by(&ground, records, &absent, &found.fit.values, &compliances)?;
        let of_links: Vec<&Record> = linked.iter().collect();
        terms = ground.choose_terms(&of_links, selected, start).map_err(linear)?.0;
        ground = ground.terms(terms.clone());
        found = ground.estimate(&of_links, selected, start).map_err(linear)?;
        next = ground.elastic(&measured, (selected, start), &found).map_err(linear)?;
        let near =
            |(a, b): (&Elastic, &Elastic)| a.joint == b.joint && (a.compliance - b.compliance).abs() < b.std / 3.0;
        if next.len() == elastic.len() && next.iter().zip(&elastic).all(near) {
            break;
        }
    }
    let samples = if linked.is_empty() { measured } else { linked.iter().collect() };
    let sigma: Vec<f64> = found.fit.kinds.iter().map(|k| k.sigma).collect();
    // What is left is not white even before the filter: friction that is not what the formula says, joints that bend. Residuals of so
    // many samples count as one, beyond those that the rows of the equations already count as one for the filter.
    let joints = model.nj();
    let mut counted = vec![(0.0, 0.0); joints];
    for (r, absent) in samples.iter().zip(&absent) {
        let values = without(&found.fit.values, absent);
        let (_, residual) = ground.predict(r, &values, &found.joints).map_err(linear)?;
        let worth = ground.worth(r).map_err(linear)?;
        for (c, column) in counted.iter_mut().zip(residual.column_iter()) {
            let n = column.len() as f64;
            *c = (c.0 + n * (worth * correlated_samples(column.as_slice())).max(1.0), c.1 + n);
        }
    }
    let correlated: Vec<f64> = counted.iter().map(|c| c.0 / c.1.max(1.0)).collect();
    let mut effective: Vec<f64> = sigma.iter().zip(&correlated).map(|(s, t)| s * t.sqrt()).collect();
    let chi2_per_dof = found.fit.chi2_per_dof;
    let set_up = SetUp { low_pass_hz: s.low_pass_hz, absent: &absent, prior: &prior, terms: &terms, sigma: &effective };
    let calibrated = Calibration { model, set_up, records: &samples, selected, start };
    found = calibrated.run(model, &samples, start)?;
    // Nor does all of it average away: parts of the records tell how far it leads.
    let wider = ground.scatter(&samples, (selected, start), &found).map_err(linear)?.max(1.0).sqrt();
    effective.iter_mut().for_each(|s| *s *= wider);
    let set_up = SetUp { low_pass_hz: s.low_pass_hz, absent: &absent, prior: &prior, terms: &terms, sigma: &effective };
    let calibrated = Calibration { model, set_up, records: &samples, selected, start };
    found = calibrated.run(model, &samples, start)?;
    found.fit.chi2_per_dof = chi2_per_dof;
    let softer = |e: &Elastic| {
        compliances.iter().enumerate().map(|(j, c)| if j == e.joint { c + e.std } else { *c }).collect::<Vec<f64>>()
    };
    for e in &elastic {
        let off = linked_by(&ground, records, &absent, &found.fit.values, &softer(e))?;
        calibrated.widen(&off.iter().collect::<Vec<_>>(), &mut found)?;
    }
    let considered = calibrated.consider(&UncertainItems::beside(opened, &opened.estimated), &mut found)?;
    // What the record tells worse than to its own size predicts no other: it stays near the mission. Priors that were given do so themselves.
    if prior.is_empty() {
        found.lean_on_start(decls, selected).map_err(|e| linear(e.into()))?;
    }
    // Numbers that no body has are moved to the nearest that some body has.
    let bounded = found.make_physical(decls, selected, start).map_err(|e| IdentifyError::Model(e.to_string()))?;
    let covariance = Covariance::of(&found.fit.uncertainty);
    let (joints, low_pass_hz) = (found.joints.clone(), s.low_pass_hz);
    let arm = Arm { joints, compliances, sigma, low_pass_hz, covariance };
    let (mut signals, mut seen) = (Vec::new(), Vec::new());
    for (r, absent) in records.iter().zip(&absent) {
        let values = without(&found.fit.values, absent);
        let linked = link_side(&ground, &r.record, &values, &arm.compliances)?;
        let (predicted, record) = predict(model, &ground, &linked, &values, &arm)?;
        signals.push(predicted);
        seen.push(LabelledRecord { record, ..r.clone() });
    }
    let provenance = Provenance { record: record_line(&records[0].record), ..provenance };
    let mut result = report(opened, &seen, s, options, (&unknowns, &found, &bounded), &signals, provenance)?;
    result.nuisance.extend(elastic.iter().map(|e| bending(model, e)));
    if !elastic.is_empty() {
        result.verdict = text::verdict(&result);
    }
    if !considered.lines.is_empty() {
        (result.uncertain, result.budget) = (considered.lines, considered.budget);
        // Its errors are those of the next identification too: taken as independent they would count as noise.
        result.posterior = None;
        result.verdict = text::verdict(&result);
    }
    Ok(Identified {
        result,
        signals,
        values: found.fit.values,
        selected: unknowns.touched.clone(),
        tried: Vec::new(),
        draws: None,
        fitted: None,
    })
}

/// The records as the links move, behind joints of these compliances.
fn linked_by(
    ground: &Ground<'_>,
    records: &[LabelledRecord],
    absent: &[Vec<usize>],
    values: &[f64],
    compliances: &[f64],
) -> Result<Vec<Record>, IdentifyError> {
    let one = |(r, absent): (&LabelledRecord, &Vec<usize>)| {
        link_side(ground, &r.record, &without(values, absent), compliances)
    };
    records.iter().zip(absent).map(one).collect()
}

/// A record as the links move; as it is where all joints are stiff.
fn link_side(
    ground: &Ground<'_>,
    record: &Record,
    values: &[f64],
    compliances: &[f64],
) -> Result<Record, IdentifyError> {
    if compliances.iter().all(|c| *c == 0.0) {
        return Ok(record.clone());
    }
    ground.link_side(record, values, compliances).map_err(linear)
}

/// The compliance of a joint as an unknown of the result.
fn bending(model: &Model, e: &Elastic) -> Parameter {
    let joint = &model.own_body(e.joint).joint;
    let unit = if joint.kind == JointKind::Prismatic { "m/N" } else { "rad/(N m)" };
    Parameter {
        name: ErrorSource::Compliance(e.joint).name(&model.joint_names()),
        unit: unit.to_owned(),
        start: 0.0,
        value: e.compliance,
        std: Some(e.std),
        std_coloured: None,
        interval95: Some((e.compliance - HALF95 * e.std, e.compliance + HALF95 * e.std)),
        prior_mean: None,
        prior_std: None,
        truth: None,
        verdict: ParameterVerdict::Estimated,
    }
}

/// Parameters of the payloads that were not mounted in a record.
fn missing(model: &Model, options: &FitOptions, label: &str) -> Result<Vec<usize>, IdentifyError> {
    let decls = model.param_decls();
    let mut out = Vec::new();
    for a in options.absent.iter().filter(|a| a.says(label)) {
        let own = format!("{}.", a.payload);
        let of = |p: usize| decls[p].name.starts_with(&own) && p >= 10 * model.n_bodies();
        let found: Vec<usize> = (0..decls.len()).filter(|p| of(*p)).collect();
        if found.is_empty() {
            let names = model.appendages().iter().map(|m| m.name.as_str());
            let hint = format!("payloads of the mission: {}", ff_model::diagnostics::list(names, 12));
            let what = format!("there is no payload '{}' that could be absent from {label}", a.payload);
            return Err(IdentifyError::Refused(config("Config::UnknownPayload", what, &hint)));
        }
        out.extend(found);
    }
    out.sort_unstable();
    out.dedup();
    Ok(out)
}

/// The values of a robot without what is absent.
fn without(values: &[f64], absent: &[usize]) -> Vec<f64> {
    let mut out = values.to_vec();
    absent.iter().for_each(|&p| out[p] = 0.0);
    out
}

/// Priors of the parameters about the values of the mission, as wide as their sizes times the relative deviation.
fn priors(unknowns: &Unknowns, s: &Settings) -> Vec<(usize, f64, f64)> {
    let Some(relative) = s.prior else { return Vec::new() };
    let sizes = ident::parameters::sizes(&unknowns.decls, &unknowns.means);
    let of = |(k, &p): (usize, &usize)| (k, unknowns.means[p], relative * sizes[p]);
    unknowns.selected.iter().enumerate().map(of).collect()
}

/// Torques that parameters and friction predict for a record as the links move, and that record as the estimator sees it.
fn predict(
    model: &Model,
    ground: &Ground<'_>,
    record: &Record,
    values: &[f64],
    arm: &Arm,
) -> Result<(Signals, Record), IdentifyError> {
    let (_, residual) = ground.predict(record, values, &arm.joints).map_err(linear)?;
    let (n, nj) = residual.shape();
    // Whitened, predicted less measured, sample after sample; zero close to rest, where friction is not what the formula says.
    let r: Vec<f64> = (0..n * nj).map(|i| -residual[(i / nj, i % nj)] / arm.sigma[i % nj]).collect();
    let seen = ground.seen(record).map_err(linear)?;
    Ok((Signals::of(model, &seen, &r, &arm.sigma), seen))
}

/// Signals of a record that played no part, and how well the calibration foretells it.
pub(super) fn explain(
    model: &Model,
    values: &[f64],
    arm: &Arm,
    record: &Record,
) -> Result<(Signals, Foretold), IdentifyError> {
    let ground = calibration(model, arm.low_pass_hz)?;
    let linked = link_side(&ground, record, values, &arm.compliances)?;
    let (signals, _) = predict(model, &ground, &linked, values, arm)?;
    let Covariance { names, rows } = &arm.covariance;
    let covariance = DMatrix::from_fn(names.len(), names.len(), |i, j| rows[i][j]);
    let by = Calibrated { values, joints: &arm.joints, sigma: &arm.sigma, names, covariance: &covariance };
    let foretold = ground.foretold(&linked, &by).map_err(linear)?;
    Ok((signals, foretold))
}

fn reduced(fit: &LinearEstimate) -> ReducedSet {
    let one = |b: &ident::solve::BaseParameter| DeterminedCombination {
        name: b.terms.first().map_or_else(String::new, |t| t.0.clone()),
        terms: b.terms.iter().skip(1).cloned().collect(),
        text: format!("{b} = {} +- {} {}", num(b.value), num(b.std), b.unit),
    };
    ReducedSet { held: Vec::new(), values: Vec::new(), combinations: fit.base.iter().map(one).collect() }
}

fn report(
    opened: &Opened,
    records: &[LabelledRecord],
    s: &Settings,
    options: &FitOptions,
    (unknowns, found, bounded): (&Unknowns, &GroundEstimate, &[String]),
    signals: &[Signals],
    provenance: Provenance,
) -> Result<IdentificationResult, IdentifyError> {
    let (model, fit) = (&opened.model, &found.fit);
    let u = &fit.uncertainty;
    let all: Vec<_> = fit.parameters.iter().chain(&fit.extra).collect();
    let from: Vec<f64> = all.iter().map(|p| p.start).collect();
    let to: Vec<f64> = all.iter().map(|p| p.value).collect();
    let residuals: usize = fit.kinds.iter().map(|k| k.rows).sum();
    let status = Status::Converged { by: Criterion::Step };
    let lines = FitReport::new(
        status,
        (0.5 * fit.chi2_per_dof * residuals as f64, residuals),
        (&from, &to),
        &Priors::default(),
        u,
    );
    let n = unknowns.selected.len();
    let line = |k: usize| Parameter::of(&lines.estimates[k], None);
    let ended = if bounded.is_empty() { Ended::Converged } else { Ended::AtBound { at: bounded.to_vec() } };
    let posterior = Posterior::of_linear(fit).map_err(|e| IdentifyError::Model(e.to_string()))?;
    let mut result = IdentificationResult {
        status: ended,
        iterations: 1,
        chi2_per_dof: fit.chi2_per_dof,
        residuals,
        parameters: (0..n).map(line).collect(),
        nuisance: (n..all.len()).map(line).collect(),
        model: Value::all(model, &fit.values),
        rank: u.rank,
        singular_values: u.singular_values.clone(),
        null_directions: u.null.iter().map(Combination::of).collect(),
        weak_directions: u.weak.iter().map(Combination::of).collect(),
        priors_cover: u.full_rank(),
        silent: known::silent(model, &fit.values, unknowns, u)?,
        reduced: (options.reduce && !u.null.is_empty()).then(|| reduced(fit)),
        correlations: Correlation::strong(u),
        covariance: Covariance::of(u),
        posterior: Some(posterior),
        // What a filter leaves of white noise is not white.
        whiteness: if s.low_pass_hz.is_some() { Vec::new() } else { known::whiteness(records, signals, &[], &[]) },
        channels: signals[0].channels(),
        records: records_of(records, signals),
        warnings: Warning::all(&opened.warnings),
        not_allowed_for: DeclaredUncertain::of(opened).map_or_else(Vec::new, |d| d.not_allowed_for),
        ..IdentificationResult::empty(model.name(), Method::Ground, provenance)
    };
    result.verdict = text::verdict(&result);
    Ok(result)
}
