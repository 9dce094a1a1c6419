//! Tests of the model after a fit: what is left in the residuals, and which error would explain it ([`ident::uncertain`]).

use super::error::IdentifyError;
use super::evidence::{ErrorSize, Evidence, NamedError, State};
use super::findings::Whiteness;
use super::record_estimator::Twin;
use super::report::Fitted;
use super::result::parameter::Parameter;
use super::settings::Settings;
use super::text::num;
use super::unknowns::Unknowns;
use ff_model::Model;
use ident::checks::whiteness;
use ident::compose::Shared;
use ident::estimate::Estimate;
use ident::uncertain::{self, EndOfFit, Hypothesis, Layout, MATTERS, Named, Scores, hypotheses};
use ident::{Estimator, Options, OutputError, Several, SetupError};
use nalgebra::DMatrix;

/// Draws of the encoders' noise.
const DRAWS: usize = 6;
/// Part of the squared residuals below which noise of the encoders is not worth whitening.
const QUIET: f64 = 1e-4;

/// What the tests of errors found.
pub(super) struct Tests {
    pub(super) tested: usize,
    pub(super) named: Vec<NamedError>,
    /// All, each by itself.
    pub(super) alone: Vec<NamedError>,
    /// Whether one of them moves an estimate.
    pub(super) matters: bool,
    /// Squared residuals that noise of the encoders adds, relative, and what draws of it add to the residuals of each record.
    pub(super) motion_noise: f64,
    pub(super) drawn: Vec<DMatrix<f64>>,
}

/// What the fit is, and the estimators of its records with every column.
pub(super) struct Ended<'a> {
    pub(super) model: &'a Model,
    pub(super) shared: &'a Shared,
    pub(super) labels: &'a [String],
    pub(super) unknowns: &'a Unknowns,
    pub(super) fitted: &'a Fitted,
    /// All parameters of the model.
    pub(super) values: &'a [f64],
}

/// An estimator with the columns of everything that is tried.
fn wide<'m>(of: &Twin<'m>, model: &Model, s: &Settings, values: &[f64]) -> Result<OutputError<'m>, SetupError> {
    let plain = Options { deflected_at: Some(values.to_vec()), motion_noise: DRAWS, ..Options::new(s.noise) };
    of.with(&uncertain::with_every_column(model, &plain))
}

/// Tests every error at the end of a fit. `None` where the model cannot be evaluated with them.
pub(super) fn tests(
    end: &Ended<'_>,
    twins: &[Twin<'_>],
    s: &Settings,
) -> Result<Option<Tests>, IdentifyError> {
    let (model, e) = (end.model, &end.fitted.estimate);
    if twins.is_empty() {
        return Ok(None);
    }
    let mut parts: Vec<Box<dyn Estimator + '_>> = Vec::new();
    let mut rows = Vec::new();
    for twin in twins {
        let Ok(part) = wide(twin, model, s, end.values) else { return Ok(None) };
        rows.push(part.rows());
        parts.push(Box::new(part));
    }
    let several = parts.len() > 1;
    let mut all: Box<dyn Estimator + '_> =
        if several { Box::new(Several::new(end.shared, parts)) } else { parts.remove(0) };
    let decls = model.param_decls();
    let selected: Vec<usize> = (0..decls.len()).collect();
    let nuisance = all.nuisance();
    let names: Vec<String> =
        decls.iter().map(|d| d.name.clone()).chain(nuisance.iter().map(|u| u.name.clone())).collect();
    let value_of = |name: &str| e.nuisance.iter().find(|u| u.name == name).map(|u| u.value);
    let extra: Vec<f64> = nuisance.iter().map(|u| value_of(&u.name).unwrap_or(0.0)).collect();
    let sizes = ident::parameters::sizes(&decls, end.values);
    let (mut base, mut base_names) = (Vec::new(), Vec::new());
    for (column, &i) in end.unknowns.columns(&end.fitted.selected, &e.values)?.into_iter().zip(&end.fitted.selected) {
        let largest = column.iter().map(|&(p, by)| sizes[p] / by.abs()).fold(f64::INFINITY, f64::min);
        base.push((column, largest));
        base_names.push(end.unknowns.decls[i].name.clone());
    }
    for (k, u) in nuisance.iter().enumerate() {
        if value_of(&u.name).is_some() {
            base.push((vec![(decls.len() + k, 1.0)], u.size));
            base_names.push(u.name.clone());
        }
    }
    let draws: Vec<usize> =
        (0..names.len()).filter(|&i| i >= decls.len() && names[i].contains("motion.noise[")).collect();
    let priors = end.unknowns.priors(&end.fitted.selected)?;
    let mut known = DMatrix::zeros(priors.len(), base.len());
    priors.fill_jacobian(&mut known, 0);
    let mut of_priors = Vec::new();
    let at: Vec<f64> = end.fitted.selected.iter().map(|&i| e.values[i]).collect();
    priors.push_residuals(&at, &mut of_priors);
    // Of ties, the parameters that they determine.
    let estimated: Vec<usize> = base.iter().flat_map(|(c, _)| c.iter().map(|c| c.0)).filter(|&i| i < decls.len()).collect();
    let tried = hypotheses(model, &estimated, end.values);
    let labels = if several { end.labels } else { &[] };
    let held: Vec<usize> = base.iter().flat_map(|(c, _)| c.iter().map(|c| c.0)).collect();
    let layout = Layout::new(&tried, &names, labels, &held);
    let place =
        EndOfFit { full: end.values, extra: &extra, selected: &selected, base: &base, priors: (known, of_priors) };
    // The model may not move there at all: then nothing is tested.
    let Ok(scores) = Scores::new(&mut *all, &place, &layout.components, &draws) else { return Ok(None) };
    let ranking = layout.rank(&scores, rows.iter().sum());
    let name_of = |column: usize| base_names[column].as_str();
    let lines = |all: &[Named]| all.iter().map(|n| named(n, &tried, &name_of)).collect();
    let (matters, alone, named) = (ranking.matters(), lines(&ranking.alone), lines(&ranking.named));
    let (mut drawn, mut first) = (Vec::new(), 0);
    for n in rows {
        drawn.push(sum_of_records(scores.drawn(), first, n, if several { twins.len() } else { 1 }));
        first += n;
    }
    let squares: f64 = drawn.iter().map(|d: &DMatrix<f64>| d.norm_squared()).sum();
    let motion_noise = squares / (DRAWS * e.residuals.len().max(1)) as f64;
    Ok(Some(Tests { tested: ranking.tested, matters, named, alone, motion_noise, drawn }))
}

/// Draws of one record: those of the others have no rows here, so that the sum over records is its own.
fn sum_of_records(drawn: &DMatrix<f64>, first: usize, rows: usize, records: usize) -> DMatrix<f64> {
    let draws = drawn.ncols() / records.max(1);
    let mut out = DMatrix::zeros(rows, draws);
    for k in 0..drawn.ncols() {
        let mut column = out.column_mut(k % draws.max(1));
        column += drawn.view((first, k), (rows, 1)).column(0);
    }
    out
}

fn named<'n>(n: &Named, tried: &[Hypothesis], name_of: &dyn Fn(usize) -> &'n str) -> NamedError {
    let h = &tried[n.hypothesis];
    let parts = h.components.iter().zip(n.score.estimate.iter().zip(&n.score.std));
    let size: Vec<ErrorSize> = parts
        .map(|(c, (&value, &std))| ErrorSize { name: c.name.clone(), unit: c.unit.clone(), value, std })
        .collect();
    NamedError {
        name: h.name.clone(),
        text: in_words(&h.words, &size),
        size,
        drop: n.score.drop,
        freedom: n.score.freedom,
        p: n.score.p,
        moves: name_of(n.score.moves.0).to_owned(),
        moves_by: n.score.moves.1,
        beside: n.beside,
        alike: n.alike.iter().map(|&k| tried[k].name.clone()).collect(),
    }
}

/// A value with its deviation, in the unit that is read best.
fn sized(value: f64, std: f64, unit: &str) -> String {
    let (scale, unit) = match unit {
        "rad" => (180.0 / std::f64::consts::PI, "deg"),
        "1" => (100.0, "%"),
        "s" => (1e3, "ms"),
        "m" => (1e3, "mm"),
        unit => (1.0, unit),
    };
    format!("{} +- {} {unit}", num(scale * value), num(scale * std))
}

/// An error with its size: a vector by its length and direction, or component by component.
pub(super) fn in_words(words: &str, size: &[ErrorSize]) -> String {
    if let [one] = size {
        return format!("{words} by {}", sized(one.value, one.std, &one.unit));
    }
    let vector = size.len() == 3 && size.iter().all(|c| c.unit == size[0].unit);
    if vector {
        let length = size.iter().map(|c| c.value * c.value).sum::<f64>().sqrt();
        let std = size.iter().map(|c| (c.value / length * c.std).powi(2)).sum::<f64>().sqrt();
        let about = if size[0].unit == "rad" { "about" } else { "along" };
        let axis = match size.iter().position(|c| c.value.abs() > 0.995 * length) {
            Some(i) => format!("{}{}", if size[i].value < 0.0 { "-" } else { "" }, ["x", "y", "z"][i]),
            None => {
                let part = |c: &ErrorSize| format!("{:.2}", c.value / length);
                format!("({})", size.iter().map(part).collect::<Vec<_>>().join(", "))
            }
        };
        return format!("{words} by {} {about} {axis}", sized(length, std, &size[0].unit));
    }
    let mut largest: Vec<&ErrorSize> = size.iter().collect();
    largest.sort_by(|a, b| (b.value / b.std).abs().total_cmp(&(a.value / a.std).abs()));
    let parts: Vec<String> =
        largest.iter().take(3).map(|c| format!("{} {}", c.name, sized(c.value, c.std, &c.unit))).collect();
    format!("{words} ({})", parts.join(", "))
}

/// What it comes to, given the fit's own figures.
pub(super) fn evidence(
    tests: Option<&Tests>,
    e: &Estimate,
    whiteness: &[Whiteness],
    parameters: &[Parameter],
    limit: f64,
) -> Evidence {
    let mut out = Evidence {
        false_alarms: uncertain::LEVEL + whiteness::LEVEL,
        tried: tests.map_or(0, |t| t.tested),
        motion_noise: tests.map(|t| t.motion_noise).filter(|&x| x > QUIET),
        named: tests.map(|t| t.named.clone()).unwrap_or_default(),
        ..Evidence::default()
    };
    if !e.status.is_converged() {
        out.reason = "the fit did not end at a solution".into();
        return out;
    }
    if parameters.is_empty() || whiteness.is_empty() {
        out.reason = "the record is too short for tests of its residuals".into();
        return out;
    }
    let coloured: Vec<&Whiteness> = whiteness.iter().filter(|w| !w.white).collect();
    let best = out.named.first();
    let matters = tests.is_some_and(|t| t.matters);
    if matters || e.chi2_per_dof > limit || !coloured.is_empty() {
        out.state = State::Contradicted;
        let worst = coloured.iter().min_by(|a, b| a.white_p.min(a.portmanteau_p).total_cmp(&b.white_p.min(b.portmanteau_p)));
        let seen = match worst {
            Some(w) => {
                let at = w.peak_hz.map(|f| format!(" near {f:.3} Hz")).unwrap_or_default();
                format!("the residuals of {} are coloured{at}", w.channel)
            }
            None if e.chi2_per_dof > limit => {
                format!("residuals are {:.2} times the noise of the sensors", e.chi2_per_dof.sqrt())
            }
            None => "an error of another kind fits what is left in the residuals".to_owned(),
        };
        out.reason = match best {
            Some(b) => format!(
                "{seen}; {} would explain it (chi-squared falls by {}, {} moves by {:.1} deviations)",
                b.text,
                num(b.drop),
                b.moves,
                b.moves_by
            ),
            None => format!("{seen}, and none of the {} errors that were tried would explain it", out.tried),
        };
        return out;
    }
    out.state = State::Explained;
    out.reason = match best {
        Some(b) => format!("{} is seen, but moves no estimate by more than {MATTERS} deviations", b.text),
        None if tests.is_some() => format!("the residuals are white, and none of {} errors is seen in them", out.tried),
        None => "the residuals are white; other errors could not be tried".to_owned(),
    };
    out
}
