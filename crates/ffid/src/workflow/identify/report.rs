//! The result of a fit: numbers into the lines of `result.json`.

use super::error::IdentifyError;
use super::explain;
use super::findings::{PriorConflict, RecordFit};
use super::fitted::Fitted;
use super::known;
use super::labelled_record::LabelledRecord;
use super::noise_floor::NoiseFloor;
use super::options::FitOptions;
use super::result::body::BodyLine;
use super::result::channel::ModeLine;
use super::result::fit::{DescentStep, Ended};
use super::result::identification::IdentificationResult;
use super::result::parameter::{Combination, Correlation, Covariance, Parameter, ParameterVerdict, Value};
use super::result::provenance::{Provenance, RecordLine, Warning};
use super::result::uncertain::{self, UncertainLine};
use super::settings::{Settings, method};
use super::signals::Signals;
use super::unknowns::{Unknowns, known_before};
use crate::modes::held;
use crate::open::Opened;
use ff_model::Params;
use ff_records::Record;
use ident::Posterior;
use ident::Uncertainty;
use ident::estimate::report::FitReport;

/// What a result is made of.
pub(super) struct Report<'a> {
    pub(super) opened: &'a Opened,
    pub(super) records: &'a [LabelledRecord],
    pub(super) settings: &'a Settings,
    pub(super) options: &'a FitOptions,
    pub(super) unknowns: &'a Unknowns,
    pub(super) signals: &'a [Signals],
    /// All parameters of the model.
    pub(super) values: &'a [f64],
    /// Tests of errors.
    pub(super) tests: Option<&'a explain::Tests>,
    /// What noise alone leaves.
    pub(super) floor: &'a NoiseFloor,
}

impl Report<'_> {
    pub(super) fn result(&self, f: &Fitted, provenance: Provenance) -> Result<IdentificationResult, IdentifyError> {
        let (model, e, unknowns) = (&self.opened.model, &f.estimate, self.unknowns);
        let start = unknowns.expand(&unknowns.start)?;
        let cost = 0.5 * e.residuals.iter().map(|r| r * r).sum::<f64>();
        let mut from: Vec<f64> = f.selected.iter().map(|&i| unknowns.start[i]).collect();
        let mut to: Vec<f64> = e.parameters.iter().map(|p| p.value).collect();
        from.extend(e.nuisance.iter().map(|p| p.start));
        to.extend(e.nuisance.iter().map(|p| p.value));
        let priors = unknowns.priors(&f.selected)?;
        let (uncertain, mut budget) =
            uncertain::lines(unknowns, &f.selected, &e.values, &e.uncertainty, f.alone.as_ref());
        if self.options.posterior.is_some() {
            // What earlier records have told of the errors is not independent of one another, and the variance does not split.
            budget.clear();
        }
        let fit = FitReport::new(e.status.clone(), (cost, e.residuals.len()), (&from, &to), &priors, &e.uncertainty);
        let names: Vec<String> = fit.estimates.iter().map(|l| l.name.clone()).collect();
        let line = |k: usize| Parameter::of(&fit.estimates[k], f.selected.get(k).map(|&i| unknowns.nominal[i]));
        let n = f.selected.len();
        let mut parameters: Vec<Parameter> = (0..n).filter(|&k| unknowns.is_asked(f.selected[k])).map(line).collect();
        if let Some(m) = &f.minima {
            let covered = |p: &mut Parameter| p.interval95 = p.interval95.map(|about| m.covered(&p.name, about));
            parameters.iter_mut().for_each(covered);
        }
        let earlier = self.options.posterior.as_ref().or(self.options.learnt.as_ref());
        if let Some(p) = earlier {
            let known = known_before(p).map_err(|e| IdentifyError::Model(e.to_string()))?;
            parameters.iter_mut().for_each(|line| before(line, known.get(&line.name)));
        }
        // Rows of an earlier identification are not independent, so that the formula does not hold with them; where no fit has ended, there is none.
        let independent = earlier.is_none() && e.is_solution();
        let mut prior_conflicts: Vec<PriorConflict> =
            parameters.iter().filter(|_| independent).filter_map(PriorConflict::of).collect();
        let not_sure = |u: &UncertainLine| {
            PriorConflict::between((&u.name, &u.unit), (u.prior_mean, u.prior_std), (u.value, u.std?))
        };
        prior_conflicts.extend(uncertain.iter().filter(|_| independent).filter_map(not_sure));
        prior_conflicts.sort_by(|a, b| b.deviations.total_cmp(&a.deviations));
        let posterior = Posterior::of(e).map_err(|e| IdentifyError::Model(e.to_string()))?;
        let modes = mode_lines(self.opened, &start, self.values);
        let heard = self.tests.filter(|t| t.motion_noise > 0.0).map_or(&[][..], |t| &t.drawn);
        let whiteness = known::whiteness(self.records, self.signals, &modes, heard);
        let evidence =
            explain::evidence(self.tests, (e, self.floor), &whiteness, !parameters.is_empty(), self.settings);
        let first = &self.records[0].record;
        Ok(IdentificationResult {
            status: Ended::of(&e.status, &names, flattest(&e.data_only)),
            iterations: e.iterations,
            descent: DescentStep::all(&e.descent),
            chi2_per_dof: e.chi2_per_dof,
            residuals: e.residuals.len(),
            bodies: BodyLine::all(&unknowns.decls, (&unknowns.start, &e.values), &f.selected, &e.uncertainty),
            prior_conflicts,
            uncertain,
            budget,
            taken_as_exact: self.tests.map_or_else(Vec::new, |t| t.harm.clone()),
            parameters,
            nuisance: (0..n)
                .filter(|&k| unknowns.beside.contains(&f.selected[k]))
                .chain(n..fit.estimates.len())
                .map(line)
                .collect(),
            model: Value::all(model, self.values),
            rank: f.full.rank,
            singular_values: f.full.singular_values.clone(),
            null_directions: f.full.null.iter().map(Combination::of).collect(),
            weak_directions: e
                .data_only
                .weak
                .iter()
                // A bias that is not seen worries nobody.
                .filter(|d| d.terms.first().is_some_and(|t| names[..n].contains(&t.0)))
                .map(Combination::of)
                .collect(),
            priors_cover: e.uncertainty.full_rank(),
            reduced: f.reduced.clone(),
            minima: f.minima.clone(),
            correlations: Correlation::strong(&e.uncertainty),
            covariance: Covariance::of(&e.uncertainty),
            posterior: Some(posterior),
            evidence: Some(evidence),
            whiteness,
            modes,
            channels: self.signals[0].channels(),
            records: records_of(self.records, self.signals),
            warnings: Warning::all(&self.opened.warnings),
            ..IdentificationResult::empty(
                model.name(),
                method(model, self.settings.method),
                Provenance { record: record_line(first), ..provenance },
            )
        })
    }
}

/// The combination that data alone know least, in words.
fn flattest(u: &Uncertainty) -> Option<String> {
    u.null.first().or(u.weak.first()).map(ToString::to_string)
}

/// Every record, when there are several.
pub(super) fn records_of(records: &[LabelledRecord], signals: &[Signals]) -> Vec<RecordFit> {
    let one = |(t, s): (&LabelledRecord, &Signals)| {
        let channels = s.channels();
        RecordFit {
            label: t.label.clone(),
            samples: t.record.samples(),
            rate_hz: t.record.rate_hz(),
            seconds: t.record.seconds(),
            mean_square: channels.iter().map(|c| c.over_noise.powi(2)).sum::<f64>() / channels.len().max(1) as f64,
            channels,
        }
    };
    if records.len() > 1 { records.iter().zip(signals).map(one).collect() } else { Vec::new() }
}

pub(super) fn record_line(r: &Record) -> RecordLine {
    RecordLine {
        samples: r.samples(),
        rate_hz: r.rate_hz(),
        seconds: r.seconds(),
        t0: r.t0(),
        rates: r.qd().is_some() && r.qdd().is_some(),
    }
}

/// Adds what an earlier identification knew of a parameter to its prior.
fn before(line: &mut Parameter, known: Option<&(f64, f64)>) {
    let Some(&(mean, std)) = known else { return };
    let (a, b) = (1.0 / (std * std), line.prior_std.map_or(0.0, |s| 1.0 / (s * s)));
    line.prior_mean = Some((a * mean + b * line.prior_mean.unwrap_or(0.0)) / (a + b));
    let both = (a + b).sqrt().recip();
    line.prior_std = Some(both);
    if line.std.is_some_and(|s| s > 0.9 * both)
        && matches!(line.verdict, ParameterVerdict::Estimated | ParameterVerdict::Weak)
    {
        line.verdict = ParameterVerdict::PriorOnly;
    }
}

/// Modes at the pose of the mission, before and after.
fn mode_lines(opened: &Opened, start: &[f64], values: &[f64]) -> Vec<ModeLine> {
    let model = &opened.model;
    let at = |v: &[f64]| {
        let params = Params::from_values(model, v.to_vec());
        let rest = model.rest_position(&params);
        held(model, &params, &opened.pose(), &rest)
    };
    let line = |(a, b): (ff_dynamics::Mode, ff_dynamics::Mode)| ModeLine {
        frequency_hz: b.frequency_hz,
        damping_ratio: b.damping_ratio,
        start_hz: a.frequency_hz,
    };
    at(start).into_iter().zip(at(values)).map(line).collect()
}
