//! Tests of the model after a fit: what is left in the residuals, and which error would explain it ([`ident::uncertain`]).

use super::error::IdentifyError;
use super::evidence::{ErrorSize, Evidence, Harm, NamedError, State};
use super::extra_mode::{self, ExtraMode};
use super::findings::Whiteness;
use super::fitted::Ended;
use super::noise_floor::NoiseFloor;
use super::number::num;
use super::record_estimator::Twin;
use super::settings::Settings;
use super::survey::{Columns, Survey};
use ff_model::ParamDecl;
use ident::checks::whiteness;
use ident::estimate::Estimate;
use ident::uncertain::{self, Hypothesis, Layout, MATTERS, Named, Ranking, Scores};
use nalgebra::DMatrix;

/// Part of the squared residuals below which noise of the encoders is not worth whitening.
const QUIET: f64 = 1e-4;

/// Errors that are listed as the most harmful.
const HARMFUL: usize = 10;

/// What the tests of errors found.
#[derive(Default)]
pub(super) struct Tests {
    pub(super) tested: usize,
    pub(super) independent: f64,
    pub(super) named: Vec<NamedError>,
    /// All, each by itself.
    pub(super) alone: Vec<NamedError>,
    /// Whether one of them moves an estimate, and the part of what is left over that they account for.
    pub(super) matters: bool,
    pub(super) explained: Option<f64>,
    /// Chi-squared above its expectation, where that is more than chance.
    pub(super) excess: Option<f64>,
    /// What it would come to with the first of them estimated, where that was fitted ([`super::refit`]).
    pub(super) with_first: Option<State>,
    /// Where that fit has ended, in the unknowns without it, if it has fallen farther than by its size: the first has ended in another valley.
    pub(super) below: Option<Vec<f64>>,
    /// What was tried, and the mode that was found.
    pub(super) tried: Vec<Hypothesis>,
    pub(super) extra: Option<ExtraMode>,
    /// Squared residuals that noise of the encoders adds, relative, and what draws of it add to the residuals of each record.
    pub(super) motion_noise: f64,
    pub(super) drawn: Vec<DMatrix<f64>>,
    /// What small errors of what is taken as exact would do; empty where the mission says what is not.
    pub(super) harm: Vec<Harm>,
}

impl Tests {
    /// Puts errors in place of those that were named, with which fits follow the record while that without them led nowhere: what was said at its
    /// end is void. `nothing_is_left` with them, or something is.
    pub(super) fn explained_by(&self, named: Vec<NamedError>, nothing_is_left: bool) -> Self {
        let with_first = Some(if nothing_is_left { State::Explained } else { State::Contradicted });
        let tested = self.tested.max(named.len());
        let (independent, alone, tried) = (self.independent, self.alone.clone(), self.tried.clone());
        Self { tested, independent, named, alone, tried, matters: true, with_first, ..Self::default() }
    }
    /// Errors of one robot that may be, each of which alone would lower chi-squared by more than `least`; those that would most, first. Allocates.
    pub(super) fn leading(&self, least: f64, most: usize, may_be: impl Fn(&NamedError) -> bool) -> Vec<NamedError> {
        let leads = |n: &&NamedError| n.drop > least && !n.is_another_robot() && may_be(n);
        let mut out: Vec<NamedError> = self.alone.iter().filter(leads).cloned().collect();
        out.sort_by(|a, b| b.drop.total_cmp(&a.drop));
        out.truncate(most);
        out
    }
}

/// Tests every error at the end of a fit. `None` where the model cannot be evaluated with them. Where the fit has not ended, what they say
/// are indications: a score is that of a linearisation whose unknowns have not settled.
pub(super) fn tests(end: &Ended<'_>, twins: &[Twin<'_>], s: &Settings) -> Result<Option<Tests>, IdentifyError> {
    let settled = end.fitted.estimate.is_solution();
    let Some((mut survey, mut ranking)) = ranked(end, twins, s, None)? else { return Ok(None) };
    let mut extra = None;
    if settled
        && extra_mode::may_be(end, &survey, &ranking)
        && let Some(found) = extra_mode::search(end, twins, s)?
        && found.stands_out(uncertain::LEVEL / (1 + ranking.tested) as f64)
        && ranking.named.iter().all(|n| n.score.evidence < found.evidence())
        && let Some(with) = ranked(end, twins, s, Some(&found))?
    {
        (survey, ranking) = with;
        extra = Some(found);
    }
    Ok(Some(found_by(end, survey, &ranking, extra)))
}

/// [`tests`] without a search for a mode that is missing.
pub(super) fn tests_of_listed(
    end: &Ended<'_>,
    twins: &[Twin<'_>],
    s: &Settings,
) -> Result<Option<Tests>, IdentifyError> {
    let Some((survey, ranking)) = ranked(end, twins, s, None)? else { return Ok(None) };
    Ok(Some(found_by(end, survey, &ranking, None)))
}

/// Tests of every error, and of an oscillator that was found. Where noise of the encoders is loud and errors are named, that noise may be what they are named
/// for: then without what it gives the tests.
fn ranked(
    end: &Ended<'_>,
    twins: &[Twin<'_>],
    s: &Settings,
    extra: Option<&ExtraMode>,
) -> Result<Option<(Survey, Ranking)>, IdentifyError> {
    let may_be_noise = |scores: &Scores, layout: &Layout| {
        let first = |named: &[Named]| named.first().is_some_and(|n| scores.may_be_motion_noise(n.score.drop));
        end.loud && first(&layout.rank(scores).named)
    };
    let survey = Survey::without_noise_in_columns(end, twins, s, &Columns::Every(extra), &may_be_noise)?;
    Ok(survey.map(|survey| {
        let ranking = survey.layout.rank(&survey.scores);
        (survey, ranking)
    }))
}

/// Tests as they are reported.
fn found_by(end: &Ended<'_>, survey: Survey, ranking: &Ranking, extra: Option<ExtraMode>) -> Tests {
    let Survey { scores, layout, tried, names, .. } = &survey;
    let name_of = |column: usize| names[column].as_str();
    let lines = |all: &[Named]| -> Vec<NamedError> {
        let one = |n: &Named| {
            let mut line = named(n, tried, &name_of);
            if let Some(found) = extra.as_ref().filter(|_| n.hypothesis == survey.oscillator) {
                found.describe(&mut line);
            }
            line
        };
        all.iter().map(one).collect()
    };
    let (matters, alone, named) = (ranking.matters(), lines(&ranking.alone), lines(&ranking.named));
    let motion_noise = scores.motion_noise();
    let (explained, excess) = (ranking.explained, ranking.excess);
    let decls = end.model.param_decls();
    let harm = if end.fitted.estimate.is_solution() && end.unknowns.marginal.is_empty() {
        harm(scores, layout, tried, end.values, &decls, &name_of)
    } else {
        Vec::new()
    };
    let (tested, independent) = (ranking.tested, ranking.independent);
    let Survey { drawn, tried, .. } = survey;
    let with_first = None;
    Tests {
        tested,
        independent,
        matters,
        explained,
        excess,
        with_first,
        below: None,
        tried,
        extra,
        named,
        alone,
        motion_noise,
        drawn,
        harm,
    }
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
        refitted: false,
        mission: String::new(),
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

/// By how much a gain may be off one in a channel whose sign was changed.
const TURNED: f64 = 0.1;

/// An error with its size: a vector by its length and direction, or component by component.
pub(super) fn in_words(words: &str, size: &[ErrorSize]) -> String {
    if let [one] = size {
        // Twice the whole of a gain less is the reading with its sign changed.
        let turned = words.contains("gain") && one.unit == "1" && (one.value + 2.0).abs() < TURNED;
        let sign = if turned { ", which is the other sign" } else { "" };
        return format!("{words} by {}{sign}", sized(one.value, one.std, &one.unit));
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
    // A mass says more than what it is multiplied with.
    let last = |c: &ErrorSize| c.name != "mass";
    let told = |c: &ErrorSize| (c.value / c.std).abs();
    largest.sort_by(|a, b| last(a).cmp(&last(b)).then(told(b).total_cmp(&told(a))));
    let parts: Vec<String> =
        largest.iter().take(3).map(|c| format!("{} {}", c.name, sized(c.value, c.std, &c.unit))).collect();
    format!("{words} ({})", parts.join(", "))
}

/// Part of what is left over that an error must account for to be said to explain it.
pub(super) const MOST: f64 = 0.8;

/// Whether an error can be as large as that. What is beyond stands for something else, which no linearisation tells: a gain of several hundred
/// percent, an angle beyond half a turn, a clock off by a tenth, a mass below zero.
fn can_be(n: &NamedError) -> bool {
    let size = n.size.iter().map(|c| c.value * c.value).sum::<f64>().sqrt();
    match n.name.split('.').next().unwrap_or_default() {
        "torque-gain" | "gyro-scale" => size <= 2.0,
        "gyro-misalignment" | "encoder-offset" | "joint-axis" | "mount-rotation" => size <= std::f64::consts::PI,
        "torque-clock-rate" | "gyro-clock-rate" | "clock-rate" => size <= 0.1,
        "mass" => n.size.iter().all(|c| c.unit != "1" || c.value > -1.0),
        _ => true,
    }
}

/// Part of the white noise of a channel that must be missing for it to be of another kind.
const NOT_WHITE: f64 = 0.25;
/// Chi-squared within which the data do not choose between two errors.
pub(super) const CLOSE: f64 = 12.0;

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
            let of = if found.encoder_noise() > 0.0 { ", encoders among them" } else { "" };
            format!("residuals are {:.2} times the noise of the sensors{of}", chi2_per_dof.sqrt())
        }
        None => "what is left in the residuals follows an error of another kind".to_owned(),
    };
    let Some(best) = found.named.first() else {
        if found.tried == 0 {
            return format!("{seen}; errors that might explain it could not be tried");
        }
        return format!("{seen}, and none of the {} errors that were tried would explain it", found.tried);
    };
    let first: Vec<&NamedError> =
        found.named.iter().enumerate().filter(|(k, n)| *k == 0 || n.beside).map(|(_, n)| n).take(3).collect();
    let together: Vec<&str> = first.iter().map(|n| &n.text[..]).collect();
    if !first.iter().all(|n| can_be(n)) {
        return format!(
            "{seen}; of the {} errors that were tried none explains it at a size that can be; the best is {}",
            found.tried,
            together.join(" beside ")
        );
    }
    let (drop, by) = (num(best.drop), best.moves_by);
    let rest = match found.with_first {
        Some(State::Explained) => ", and nothing is left with it",
        Some(State::Contradicted) if found.named.iter().all(|n| !n.beside) => ", but something is left with it",
        _ => "",
    };
    let moved = format!("chi-squared falls by {drop}, {} moves by {by:.1} deviations{rest}", best.moves);
    let part = found.explained.filter(|&part| part < MOST && found.with_first != Some(State::Explained));
    match part {
        Some(0.0) => format!(
            "{seen}; no fit with one of the {} errors that were tried explains it: to first order the best is {}",
            found.tried,
            together.join(" beside ")
        ),
        Some(part) => format!(
            "{seen}; of the {} errors that were tried none explains it: the best, {}, accounts for {:.0} % of what is left over",
            found.tried,
            together.join(" beside "),
            100.0 * part
        ),
        None => {
            let near = |n: &&NamedError| n.refitted && !n.beside && can_be(n) && n.drop > best.drop - CLOSE;
            let others: Vec<&str> = found.named.iter().skip(1).filter(near).map(|n| &n.text[..]).collect();
            let others = if others.is_empty() || first.len() > 1 {
                String::new()
            } else {
                format!(", and so would {}, between which the record does not choose", others.join(", or "))
            };
            // What several do together is the sum of what first order says of each.
            let how = if first.len() > 2 { ", to first order," } else { "" };
            format!("{seen}; {} would{how} explain it ({moved}){others}", together.join(" beside "))
        }
    }
}

/// That a fit has not ended, and what it would take.
fn unsettled(found: &Evidence) -> String {
    let (what, named) = ("the fit did not end at a solution", &found.named);
    if let (Some(n), Some(any)) = (named.first(), found.refitted()) {
        let more = if named.iter().any(|n| n.refitted && n.beside) { "more unknowns" } else { "one more unknown" };
        let drop = num(n.drop);
        let falls = if found.with_first == Some(State::Contradicted) {
            format!(", with which chi-squared falls by {drop}, but something is left")
        } else {
            format!(" would explain it (chi-squared falls by {drop})")
        };
        return format!("{what}, but does with {more}: {any}{falls}");
    }
    match named.first() {
        Some(n) => format!(
            "{what}; where it stopped, {} would lower chi-squared most (by {}), which is an indication and no test",
            n.text,
            num(n.drop)
        ),
        None => what.to_owned(),
    }
}

/// What the residuals say of the noise of the sensors, where that is other than was said, so that tests which take it for known say nothing of the
/// model.
pub(super) fn of_sensors(
    e: &Estimate,
    floor: &NoiseFloor,
    tests: Option<&Tests>,
    whiteness: &[Whiteness],
    s: &Settings,
) -> Option<String> {
    let encoders = tests.map_or(0.0, |t| t.motion_noise);
    if floor.sensors > 1.0
        && e.chi2_per_dof > s.limit * (1.0 + encoders)
        && e.chi2_per_dof < floor.with_motion(Some(encoders))
    {
        return Some(format!(
            "residuals are {:.2} times the noise of the sensors, and neighbouring readings scatter by as much: [sensors] gives them too \
             little noise; `ffid doctor` says how much they have",
            e.chi2_per_dof.sqrt()
        ));
    }
    let coloured = || whiteness.iter().filter(|w| w.excess == Some(true));
    if coloured().next().is_none() || !coloured().all(hides_white_noise) {
        return None;
    }
    let most = coloured().map(|w| w.first_correlation).fold(0.0, f64::max);
    let list = ff_model::diagnostics::list(coloured().map(|w| w.channel.as_str()), 6);
    Some(format!(
        "the residuals of {list} are no larger than the noise of [sensors], and yet neighbours correlate by up to {most:.2}: that noise is not white, \
         or there is less of it and something else beside; `ffid doctor` says how much is white. Deviations that allow for the colour are \
         given beside the others"
    ))
}

/// Whether white noise as large as was said cannot be in these residuals: of what an error of the model adds to it, all may be alike from sample to sample, but not
/// more.
fn hides_white_noise(w: &Whiteness) -> bool {
    w.first_correlation * w.mean_square > (w.mean_square - 1.0).max(0.0) + NOT_WHITE
}

/// What it comes to, given the fit's own figures, what noise alone leaves, and whether it had anything to estimate.
pub(super) fn evidence(
    tests: Option<&Tests>,
    (e, floor): (&Estimate, &NoiseFloor),
    whiteness: &[Whiteness],
    estimates: bool,
    s: &Settings,
) -> Evidence {
    // Outliers count as the loss counts them.
    let freedom = e.residuals.len() as f64 / e.residuals.iter().map(|r| r * r).sum::<f64>().max(f64::MIN_POSITIVE);
    let robust = e.residuals.iter().map(|&r| s.loss.rho(r)).sum::<f64>() / e.residuals.len().max(1) as f64;
    // Noise of the encoders is in the residuals besides that of the sensors.
    let of_noise = 1.0 + tests.map_or(0.0, |t| t.motion_noise);
    let (chi2, limit) = (e.chi2_per_dof * freedom * robust / of_noise, s.limit);
    let mut out = Evidence {
        false_alarms: uncertain::LEVEL + whiteness::LEVEL,
        tried: tests.map_or(0, |t| t.tested),
        independent: tests.map(|t| t.independent),
        motion_noise: tests.map(|t| t.motion_noise).filter(|&x| x > QUIET),
        named: tests.map(|t| t.named.clone()).unwrap_or_default(),
        ..Evidence::default()
    };
    out.with_first = tests.and_then(|t| t.with_first);
    if !e.is_solution() {
        out.reason = unsettled(&out);
        // The record is followed with the error and not without it, and the error is far from none: as much as a test at an end would say.
        if out.named.first().is_some_and(|n| n.refitted && n.is_seen()) {
            out.state = State::Contradicted;
        }
        return out;
    }
    if !estimates || (whiteness.is_empty() && tests.is_none()) {
        out.reason = "the record is too short for tests of its residuals".into();
        return out;
    }
    if let Some(reason) = of_sensors(e, floor, tests, whiteness, s) {
        // Tests take chance for errors there.
        out.named.clear();
        (out.state, out.reason) = (State::Contradicted, reason);
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
        None if tests.is_some() => {
            format!("nothing stands out of the noise, and none of {} errors that were tried is seen", out.tried)
        }
        None => "nothing stands out of the noise; other errors could not be tried".to_owned(),
    };
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(name: &str, value: f64, unit: &str) -> NamedError {
        let size = vec![ErrorSize { name: String::new(), unit: unit.into(), value, std: 1e-3 * value.abs() }];
        let text = in_words(name, &size);
        let (name, moves) = (name.to_owned(), "base.mass".to_owned());
        NamedError {
            name,
            text,
            size,
            drop: 8100.0,
            freedom: 1,
            p: 0.0,
            moves,
            moves_by: 40.0,
            beside: false,
            alike: Vec::new(),
            refitted: false,
            mission: String::new(),
        }
    }

    #[test]
    fn white_noise_that_was_said_to_be_there_bounds_what_an_error_can_leave_alike() {
        let channel = |mean_square: f64, first_correlation: f64| Whiteness {
            channel: "tau.elbow".into(),
            mean_square,
            white_p: 0.0,
            portmanteau_p: 0.0,
            normal_p: 0.4,
            first_correlation,
            largest: 4.1,
            white: false,
            excess_p: Some(0.0),
            excess: Some(true),
            peak_hz: Some(0.6),
            stands_out_hz: Vec::new(),
        };
        // An error that adds seven tenths of the noise, and one that adds as much as that while no white noise is left.
        assert!(!hides_white_noise(&channel(1.7, 0.4)) && hides_white_noise(&channel(1.7, 0.9)));
        assert!(hides_white_noise(&channel(1.02, 0.8)) && !hides_white_noise(&channel(1.02, 0.05)));
        assert!(!hides_white_noise(&channel(37.0, 0.97)));
    }

    /// Errors of a size that cannot be are those of a linearisation far from what is wrong.
    #[test]
    fn what_cannot_be_so_large_explains_nothing() {
        let told =
            |named: Vec<NamedError>| against(&Evidence { tried: 85, named, ..Evidence::default() }, &[], 9.0, 2.0);
        for (name, possible, impossible, unit) in [
            ("torque-gain.elbow", -0.99, -1366.0, "1"),
            ("encoder-offset.elbow", 1.57, 13.5, "rad"),
            ("gyro-clock-rate", 2e-3, -5.9, "1"),
            ("mass.link", -0.4, -1.3, "1"),
        ] {
            let can = told(vec![error(name, possible, unit)]);
            assert!(can.contains("would explain it (chi-squared falls by 8100"), "{can}");
            let cannot = told(vec![error(name, impossible, unit)]);
            assert!(cannot.contains("none explains it at a size that can be") && cannot.contains(name), "{cannot}");
            assert!(!cannot.contains("would explain"), "{cannot}");
            // Beside one that can be, too.
            let beside = NamedError { beside: true, ..error(name, impossible, unit) };
            assert!(told(vec![error("friction.elbow", 0.2, "N m s/rad"), beside]).contains("that can be"));
        }
    }
}
