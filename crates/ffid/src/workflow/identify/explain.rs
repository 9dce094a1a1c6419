//! Tests of the model after a fit: what is left in the residuals, and which error would explain it ([`ident::uncertain`]).

use super::error::IdentifyError;
use super::evidence::{ErrorSize, Evidence, Harm, NamedError, State};
use super::findings::Whiteness;
use super::record_estimator::Twin;
use super::report::Fitted;
use super::result::parameter::Parameter;
use super::row_layout::RowLayout;
use super::settings::Settings;
use super::text::num;
use super::unknowns::Unknowns;
use ff_model::{Model, ParamDecl};
use ident::checks::whiteness;
use ident::compose::{Shared, is_called};
use ident::estimate::Estimate;
use ident::uncertain::{
    self, Combination, Component, EndOfFit, Hypothesis, Layout, MATTERS, Named, Scores, hypotheses,
};
use ident::{Estimator, Options, OutputError, SetupError, Several};
use nalgebra::DMatrix;

/// Draws of the encoders' noise.
const DRAWS: usize = 6;
/// Part of the squared residuals below which noise of the encoders is not worth whitening.
const QUIET: f64 = 1e-4;

/// Errors that are listed as the most harmful.
const HARMFUL: usize = 10;

/// What the tests of errors found.
pub(super) struct Tests {
    pub(super) tested: usize,
    pub(super) named: Vec<NamedError>,
    /// All, each by itself.
    pub(super) alone: Vec<NamedError>,
    /// Whether one of them moves an estimate, and the part of what is left over that they account for.
    pub(super) matters: bool,
    pub(super) explained: Option<f64>,
    /// Squared residuals that noise of the encoders adds, relative, and what draws of it add to the residuals of each record.
    pub(super) motion_noise: f64,
    pub(super) drawn: Vec<DMatrix<f64>>,
    /// What small errors of what is taken as exact would do; empty where the mission says what is not.
    pub(super) harm: Vec<Harm>,
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
    of.survey(&uncertain::with_every_column(model, &plain), values)
}

/// Tests every error at the end of a fit. `None` where the model cannot be evaluated with them.
pub(super) fn tests(end: &Ended<'_>, twins: &[Twin<'_>], s: &Settings) -> Result<Option<Tests>, IdentifyError> {
    let (model, e) = (end.model, &end.fitted.estimate);
    if twins.is_empty() {
        return Ok(None);
    }
    let mut parts: Vec<Box<dyn Estimator + '_>> = Vec::new();
    let (mut rows, mut orders, mut residuals) = (Vec::new(), Vec::new(), Vec::new());
    let channels = model.nj() + 3;
    for twin in twins {
        let Ok(part) = wide(twin, model, s, end.values) else { return Ok(None) };
        // Rows of the fit are listed sample by sample, or group after group where these are, too.
        let by_sample = part.is_interleaved() || !RowLayout::of(twin.record(), channels).is_interleaved();
        let order = order(part.rows(), channels, by_sample);
        // Those of the rigid method are not residuals of these rows.
        if e.residuals.len() >= residuals.len() + order.len() {
            let first = residuals.len();
            let counts = |r: f64| s.loss.rho(r).sqrt().copysign(r);
            residuals.extend(order.iter().map(|i| counts(e.residuals[first + i])));
        }
        rows.push(part.rows());
        orders.push(order);
        parts.push(Box::new(part));
    }
    let residuals = (residuals.len() == e.residuals.len()).then_some(&residuals[..]);
    let several = parts.len() > 1;
    let mut all: Box<dyn Estimator + '_> =
        if several { Box::new(Several::new(end.shared, parts)) } else { parts.remove(0) };
    let decls = model.param_decls();
    let selected: Vec<usize> = (0..decls.len()).collect();
    let nuisance = all.nuisance();
    let names: Vec<String> =
        decls.iter().map(|d| d.name.clone()).chain(nuisance.iter().map(|u| u.name.clone())).collect();
    let value_of = |name: &str| e.nuisance.iter().find(|u| u.name == name).map(|u| u.value);
    let labels_of = if several { end.labels } else { &[] };
    let beside = |name: &str| -> Combination {
        let own = nuisance.iter().enumerate().filter(|(_, u)| is_called(&u.name, name, labels_of));
        own.map(|(k, _)| (decls.len() + k, 1.0)).collect()
    };
    let shared: Vec<(&str, f64)> = end.unknowns.marginal.iter().map(|(i, u)| (u.name.as_str(), e.values[*i])).collect();
    let shared_value = |name: &str| shared.iter().find(|(n, _)| is_called(name, n, labels_of)).map(|s| s.1);
    let of = |name: &str| value_of(name).or_else(|| shared_value(name));
    let extra: Vec<f64> = nuisance.iter().map(|u| of(&u.name).unwrap_or(0.0)).collect();
    let sizes = ident::parameters::sizes(&decls, end.values);
    let (mut base, mut base_names) = (Vec::new(), Vec::new());
    for (column, &i) in end.unknowns.columns(&end.fitted.selected, &e.values)?.into_iter().zip(&end.fitted.selected) {
        // An error that records share is a column of every one of them.
        let column = match column[..] {
            [(shared, _)] if shared >= decls.len() => beside(&end.unknowns.decls[i].name),
            _ => column,
        };
        if column.is_empty() {
            return Ok(None);
        }
        let largest = column
            .iter()
            .map(|&(p, by)| sizes.get(p).map_or_else(|| nuisance[p - decls.len()].size, |s| s / by.abs()))
            .fold(f64::INFINITY, f64::min);
        base.push((column, largest));
        base_names.push(end.unknowns.decls[i].name.clone());
    }
    for (k, u) in nuisance.iter().enumerate() {
        // What output error estimates and the rigid method does not.
        let bias = residuals.is_none() && s.biases && u.name.contains(".bias.");
        if value_of(&u.name).is_some() || bias {
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
    let mut estimated = Vec::new();
    for ((c, _), &i) in base.iter().zip(&end.fitted.selected) {
        // Of a body of which one error is estimated, the others may be wrong as well.
        if end.unknowns.is_asked(i) || c.len() == 1 {
            estimated.extend(c.iter().map(|c| c.0).filter(|&i| i < decls.len()));
        }
    }
    let mut tried = hypotheses(model, &estimated, end.values);
    let held: Vec<usize> = base.iter().flat_map(|(c, _)| c.iter().map(|c| c.0)).collect();
    let mut layout = Layout::new(&tried, &names, labels_of, &held);
    // Each record but the first against all the others: what it alone would say of the parameters.
    let asked = |k: &usize| end.unknowns.is_asked(end.fitted.selected[*k]);
    let of_parameters: Vec<usize> = (0..end.fitted.selected.len()).filter(asked).collect();
    let parameters: Vec<_> = of_parameters.iter().map(|&k| base[k].0.clone()).collect();
    let mut first = 0;
    for (label, n) in labels_of.iter().zip(&rows) {
        if first > 0 {
            layout.differing(tried.len(), &parameters, &(first..first + n));
            let unit = |k: &usize| end.unknowns.decls[end.fitted.selected[*k]].unit.to_owned();
            let one = |k: &usize| Component { name: base_names[*k].clone(), unit: unit(k), of: Vec::new() };
            let components = of_parameters.iter().map(one).collect();
            let words = format!("parameters that are others in record {label}");
            tried.push(Hypothesis { name: format!("other-robot.{label}"), words, components });
        }
        first += n;
    }
    let place = EndOfFit {
        full: end.values,
        extra: &extra,
        selected: &selected,
        base: &base,
        asked: &of_parameters,
        residuals,
        priors: (known, of_priors),
    };
    // The model may not move there at all: then nothing is tested.
    let Ok(scores) = Scores::new(&mut *all, &place, &layout.components, &draws) else { return Ok(None) };
    let ranking = layout.rank(&scores);
    let name_of = |column: usize| base_names[column].as_str();
    let lines = |all: &[Named]| all.iter().map(|n| named(n, &tried, &name_of)).collect();
    let (matters, alone, named) = (ranking.matters(), lines(&ranking.alone), lines(&ranking.named));
    let (mut drawn, mut first) = (Vec::new(), 0);
    for (n, order) in rows.iter().zip(&orders) {
        let of_rows = sum_of_records(scores.drawn(), first, *n, if several { twins.len() } else { 1 });
        let mut by_sample = DMatrix::zeros(*n, of_rows.ncols());
        order.iter().enumerate().for_each(|(row, &at)| by_sample.set_row(at, &of_rows.row(row)));
        drawn.push(by_sample);
        first += n;
    }
    let squares: f64 = drawn.iter().map(|d: &DMatrix<f64>| d.norm_squared()).sum();
    let motion_noise = squares / (DRAWS * e.residuals.len().max(1)) as f64;
    let explained = ranking.explained;
    let harm = if end.unknowns.marginal.is_empty() {
        harm(&scores, &layout, &tried, end.values, &decls, &name_of)
    } else {
        Vec::new()
    };
    Ok(Some(Tests { tested: ranking.tested, matters, explained, named, alone, motion_noise, drawn, harm }))
}

/// What errors of 1 %, 1 mm and 1 mrad of what is taken as exact would move, the most harmful first.
fn harm<'n>(
    scores: &Scores,
    layout: &Layout,
    tried: &[Hypothesis],
    values: &[f64],
    decls: &[ParamDecl],
    name_of: &dyn Fn(usize) -> &'n str,
) -> Vec<Harm> {
    let mut out: Vec<Harm> = Vec::new();
    for (k, h) in tried.iter().enumerate() {
        let Some(components) = layout.components_of(k) else { continue };
        let (kind, subject) = h.name.split_once('.').unwrap_or((&h.name, ""));
        let (size, words) = match kind {
            "torque-gain" | "gyro-scale" | "mass" => (0.01, "1 %"),
            "gyro-misalignment" | "encoder-offset" | "joint-axis" | "mount-rotation" => (1e-3, "1 mrad"),
            "joint-position" | "mount-position" => (1e-3, "1 mm"),
            "centre-of-mass" => {
                let mass = format!("{subject}.mass");
                let Some(i) = decls.iter().position(|d| d.name == mass) else { continue };
                (1e-3 * values[i], "1 mm")
            }
            _ => continue,
        };
        if let Some((moved, by)) = scores.shift(components, &vec![size; components.len()])
            && by.is_finite()
        {
            let (name, size) = (h.name.clone(), words.to_owned());
            out.push(Harm { name, size, moves: name_of(moved).to_owned(), moves_by: by });
        }
    }
    out.sort_by(|a, b| b.moves_by.total_cmp(&a.moves_by));
    out.truncate(HARMFUL);
    out
}

/// For every row of an estimator its place among rows that are listed sample by sample: torques, then three axes of the gyro; its own
/// place where they are listed alike.
fn order(rows: usize, channels: usize, interleaved: bool) -> Vec<usize> {
    if interleaved {
        return (0..rows).collect();
    }
    let (samples, joints) = (rows / channels, channels - 3);
    let torques = (0..samples).flat_map(|i| (0..joints).map(move |c| i * channels + c));
    torques.chain((0..samples).flat_map(|i| (joints..channels).map(move |c| i * channels + c))).collect()
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
    let size: Vec<ErrorSize> =
        parts.map(|(c, (&value, &std))| ErrorSize { name: c.name.clone(), unit: c.unit.clone(), value, std }).collect();
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

/// Part of what is left over that an error must account for to be said to explain it.
const MOST: f64 = 0.8;

/// Why the record contradicts the model, in one line.
fn against(found: &Evidence, coloured: &[&Whiteness], chi2_per_dof: f64, limit: f64) -> String {
    let least = |w: &Whiteness| w.excess_p.unwrap_or(1.0);
    let worst =
        coloured.iter().min_by(|a, b| least(a).total_cmp(&least(b)).then(b.mean_square.total_cmp(&a.mean_square)));
    let seen = match worst {
        Some(w) => {
            let at = w.peak_hz.map(|f| format!(" near {f:.3} Hz")).unwrap_or_default();
            format!("the residuals of {} stand out of the noise{at}", w.channel)
        }
        None if chi2_per_dof > limit => {
            format!("residuals are {:.2} times the noise of the sensors", chi2_per_dof.sqrt())
        }
        None => "what is left in the residuals follows an error of another kind".to_owned(),
    };
    let Some(best) = found.named.first() else {
        return format!("{seen}, and none of the {} errors that were tried would explain it", found.tried);
    };
    let together: Vec<&str> =
        found.named.iter().enumerate().filter(|(k, n)| *k == 0 || n.beside).map(|(_, n)| &n.text[..]).take(3).collect();
    let (drop, by) = (num(best.drop), best.moves_by);
    let moved = format!("chi-squared falls by {drop}, {} moves by {by:.1} deviations", best.moves);
    match found.explained.filter(|&part| part < MOST) {
        Some(part) => format!(
            "{seen}; of the {} errors that were tried none explains it: the best, {}, accounts for {:.0} % of what is left over",
            found.tried,
            together.join(" beside "),
            100.0 * part
        ),
        None => format!("{seen}; {} would explain it ({moved})", together.join(" beside ")),
    }
}

/// What it comes to, given the fit's own figures.
pub(super) fn evidence(
    tests: Option<&Tests>,
    e: &Estimate,
    whiteness: &[Whiteness],
    parameters: &[Parameter],
    s: &Settings,
) -> Evidence {
    // Outliers count as the loss counts them.
    let freedom = e.residuals.len() as f64 / e.residuals.iter().map(|r| r * r).sum::<f64>().max(f64::MIN_POSITIVE);
    let robust = e.residuals.iter().map(|&r| s.loss.rho(r)).sum::<f64>() / e.residuals.len().max(1) as f64;
    let (chi2, limit) = (e.chi2_per_dof * freedom * robust, s.limit);
    let mut out = Evidence {
        false_alarms: uncertain::LEVEL + whiteness::LEVEL,
        tried: tests.map_or(0, |t| t.tested),
        motion_noise: tests.map(|t| t.motion_noise).filter(|&x| x > QUIET),
        named: tests.map(|t| t.named.clone()).unwrap_or_default(),
        ..Evidence::default()
    };
    if !e.is_solution() {
        out.reason = "the fit did not end at a solution".into();
        return out;
    }
    if parameters.is_empty() || (whiteness.is_empty() && tests.is_none()) {
        out.reason = "the record is too short for tests of its residuals".into();
        return out;
    }
    let coloured: Vec<&Whiteness> = whiteness.iter().filter(|w| w.excess == Some(true)).collect();
    out.explained = tests.and_then(|t| t.explained);
    let best = out.named.first();
    let matters = tests.is_some_and(|t| t.matters);
    // What is coloured may be an error that is named and moves nothing.
    let harmless = best.is_some() && !matters && out.explained.is_none_or(|part| part > MOST);
    if matters || chi2 > limit || !(coloured.is_empty() || harmless) {
        out.state = State::Contradicted;
        out.reason = against(&out, &coloured, chi2, limit);
        return out;
    }
    out.state = State::Explained;
    out.reason = match best {
        Some(b) => format!("{} is seen, but moves no estimate by more than {MATTERS} deviations", b.text),
        None if tests.is_some() => format!("nothing stands out of the noise, and none of {} errors is seen", out.tried),
        None => "nothing stands out of the noise; other errors could not be tried".to_owned(),
    };
    out
}
