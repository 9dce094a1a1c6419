//! The verdict in sentences: what is determined, whether the model explains the record, what would help.

use crate::workflow::identify::evidence::{Evidence, Harm, State};
use crate::workflow::identify::findings::{Minima, PriorConflict, ProfileLine, Whiteness};
use crate::workflow::identify::number::num;
use crate::workflow::identify::result::channel::Channel;
use crate::workflow::identify::result::fit::{Ended, Method};
use crate::workflow::identify::result::identification::IdentificationResult;
use crate::workflow::identify::result::parameter::{Combination, ParameterVerdict};
use crate::workflow::identify::result::provenance::Warning;
use crate::workflow::identify::result::sampled::{Sampled, SampledState};
use crate::workflow::identify::result::uncertain::BudgetLine;

/// Deviations that an error may move an estimate by without a word.
const HARMLESS: f64 = 0.1;
/// Chi-squared per degree of freedom below which the noise figures are too large to be those of the record.
const QUIET: f64 = 0.5;

/// A parameter with its interval from the likelihood.
fn bent_in_words(p: &ProfileLine) -> String {
    let end = |x: Option<f64>| x.map_or_else(|| "unbounded".to_owned(), num);
    format!("{} (95 % within [{}, {}] {})", p.name, end(p.lower95), end(p.upper95), p.unit)
}

/// What is taken as exact, or which part of the uncertainty is due to what is not.
fn exactness(r: &IdentificationResult) -> Vec<String> {
    let mut said = Vec::new();
    if !r.not_allowed_for.is_empty() {
        let how = match r.method {
            Method::Ground => "the calibration on the ground takes robot and biases as the same at all times",
            _ => "the rigid method has no columns of sensors and placements; --method output-error has",
        };
        said.push(format!(
            "{} quantities that the mission is not sure of were taken as exact, and the deviations do NOT allow for them ({}): {how}.",
            r.not_allowed_for.len(),
            ff_model::diagnostics::list(r.not_allowed_for.iter().map(String::as_str), 4)
        ));
    }
    said.extend(allowed_for(r));
    said
}

fn allowed_for(r: &IdentificationResult) -> Vec<String> {
    if !r.uncertain.is_empty() {
        let mut out = vec![format!(
            "They are known whatever {} other quantities are that the mission is not sure of; their deviations allow for these.",
            r.uncertain.len()
        )];
        out.extend(next_step(&r.budget));
        return out;
    }
    harmful(&r.taken_as_exact).into_iter().collect()
}

/// The verdict in sentences, the most important first.
pub fn verdict(r: &IdentificationResult) -> Vec<String> {
    let mut out = Vec::new();
    let n = r.parameters.len();
    let names = |t: ParameterVerdict| -> Vec<&str> {
        r.parameters.iter().filter(|p| p.verdict == t).map(|p| p.name.as_str()).collect()
    };
    let told = names(ParameterVerdict::Estimated).len();
    if !r.status.is_solution() {
        out.push(format!("The fit did NOT end at a solution: it {}. The values below are no estimates.", r.status));
    } else {
        let all = if told == n { format!("All {n}") } else { format!("{told} of {n}") };
        let apart = r.minima.as_ref().filter(|m| m.undecided().is_some()).map(|m| m.alternatives.len());
        let apart = apart.map_or_else(String::new, |k| format!(", {k} of them NOT uniquely"));
        out.push(format!("{all} parameters are determined by the record{apart}."));
    }
    out.extend(exactness(r));
    // What a fit that has not ended does not see where it stopped is no property of the record.
    let solved = r.status.is_solution();
    if solved && !r.null_directions.is_empty() {
        let k = r.null_directions.len();
        let held = match (&r.reduced, r.priors_cover) {
            (Some(_), _) => {
                "and the parameters that it can tell were estimated instead, with others held at the mission's values"
            }
            (None, true) => "held by the priors",
            (None, false) => "left where the fit started",
        };
        let what = if k == 1 { "one combination".to_owned() } else { format!("{k} combinations") };
        let first = &r.null_directions[0].text;
        out.push(format!("The record is silent on {what}, {held}: {first}{}", if k > 1 { "; ..." } else { "." }));
    }
    out.extend(scale_of_currents(r));
    if let Some(s) = r.silent.as_ref().filter(|_| solved) {
        if !s.structural.is_empty() {
            let k = s.structural.len();
            out.push(format!(
                "No record of this robot can tell {k} of them; they move nothing: {}.",
                s.structural[0].text
            ));
        }
        if !s.unexcited.is_empty() {
            let k = s.unexcited.len();
            out.push(format!("Another motion, or more sensors, might tell {k} of them: {}.", s.unexcited[0].text));
        }
    }
    if let Some(said) = r.minima.as_ref().and_then(Minima::undecided) {
        out.push(format!(
            "The parameters are NOT unique: {said}. The lowest is given, and the deviations cover all of them."
        ));
    } else if let Some(m) = r.minima.as_ref().filter(|m| m.objectives.len() > 1) {
        out.push(format!(
            "The fit has {} minima: {} starts led to different answers, and {}.",
            m.objectives.len(),
            m.starts,
            m.taken()
        ));
    }
    let bent: Vec<String> = r.profiles.iter().filter(|p| p.bent).map(bent_in_words).collect();
    if !bent.is_empty() {
        out.push(format!(
            "The cost is no parabola along {}; the deviations allow for that, and so do those of what moves with it.",
            bent.join(", ")
        ));
    }
    for (t, words) in [
        (ParameterVerdict::Weak, "known worse than to their own size"),
        (ParameterVerdict::PriorOnly, "no better known than before, by their priors"),
        (ParameterVerdict::AtBound, "at a bound, and no estimates"),
    ] {
        let all = names(t);
        if !all.is_empty() {
            let beside = match t {
                ParameterVerdict::Weak if r.method == Method::Ground => "; values lean on the mission's there",
                _ => "",
            };
            out.push(format!(
                "{} {words}: {}{beside}.",
                all.len(),
                ff_model::diagnostics::list(all.iter().copied(), 12)
            ));
        }
    }
    if let Ended::Flat { along } = &r.status {
        out.push(format!(
            "The fit has a flat direction: going on along it gains nothing that the noise would not. It is {along}."
        ));
    }
    out.extend(conflicts(r));
    let rms = r.over_noise().sqrt();
    out.push(if r.method == Method::Ground {
        format!("The arm and its friction predict the torques {}.{}", shares(&r.channels), beside(r))
    } else {
        tested(r, rms)
    });
    out.extend(r.evidence.as_ref().and_then(Evidence::in_doubt));
    if r.method != Method::Ground && r.over_noise() < QUIET {
        out.push(format!(
            "Residuals are {rms:.3} times the noise that was given: the sensors are quieter than that, and the standard \
             deviations are too large."
        ));
    }
    out.extend(whiteness(&r.whiteness));
    out.extend(r.sampled.as_ref().map(sampled));
    out.extend(r.comparison.iter().map(|c| format!("Models compared by {}: {}.", c.judged_by, c.reason)));
    out
}

/// That currents do not tell how heavy the robot is, where the fit found that.
fn scale_of_currents(r: &IdentificationResult) -> Option<String> {
    let is_gain = |name: &str| name.starts_with("drive.") && name.ends_with(".gain");
    let of = |c: &&Combination| c.terms.iter().any(|t| is_gain(&t.0)) && c.terms.len() > 1;
    r.null_directions.iter().find(of)?;
    Some(
        "Currents do not tell the scale: a robot with all masses, stiffnesses, dampers and friction twice as large, and gains of its drives twice as \
         large, gives the same currents and moves in the same way. Leave out of [estimate] what was weighed, or give gain_nm_per_a with \
         gain_relative_std in [[drive]]; ratios of the estimates hold without."
            .to_owned(),
    )
}

/// Terms of the joints beside viscous and Coulomb friction and offset, which parts of the log bore out that were not fitted.
fn beside(r: &IdentificationResult) -> String {
    let always = [".viscous", ".coulomb", ".offset", ".gain"];
    let more: Vec<&str> =
        r.nuisance.iter().map(|p| p.name.as_str()).filter(|n| !always.iter().any(|a| n.ends_with(a))).collect();
    if more.is_empty() {
        return String::new();
    }
    format!(
        " Parts of the record that were not fitted bear out {} more of its joints: {}.",
        if more.len() == 1 { "one term".to_owned() } else { format!("{} terms", more.len()) },
        ff_model::diagnostics::list(more.iter().copied(), 8)
    )
}

/// Whether draws agree with the intervals of the fit.
fn sampled(s: &Sampled) -> String {
    match s.state {
        SampledState::Converged => {}
        SampledState::NotDrawn => return format!("Nothing was drawn from the posterior: {}.", s.reason),
        _ => return format!("The draws from the posterior have NOT converged, and give no intervals: {}.", s.reason),
    }
    let far = s.differing();
    let limit = Sampled::DIFFERS;
    match far.first() {
        None => format!(
            "Intervals of the fit are those of draws from the posterior, to within {limit} standard deviations ({}).",
            s.reason
        ),
        Some(worst) => format!(
            "The posterior is not the parabola of the fit: intervals of {} of {} parameters differ by more than {limit} standard \
             deviations from those of draws, which are the ones to use: {} by {:.1}{}.",
            far.len(),
            s.parameters.len(),
            worst.name,
            worst.differs.unwrap_or_default(),
            if far.len() > 1 {
                format!("; {}", ff_model::diagnostics::list(far[1..].iter().map(|l| l.name.as_str()), 6))
            } else {
                String::new()
            }
        ),
    }
}

/// Adds to a result what its verdict holds for, as a warning and to the reason.
pub(in crate::workflow::identify) fn qualify(r: &mut IdentificationResult, warning: Warning) {
    if let Some(evidence) = &mut r.evidence {
        evidence.reason = format!("{}; {}", evidence.reason, warning.message);
    }
    r.warnings.push(warning);
    r.verdict = verdict(r);
}

/// What the record says of the model as a whole.
fn tested(r: &IdentificationResult, rms: f64) -> String {
    let reason = r.evidence.as_ref().map_or("", |e| &e.reason);
    let of = if r.over_noise() < r.chi2_per_dof { "sensors, encoders among them" } else { "sensors" };
    match r.state() {
        State::Contradicted => format!(
            "The model does NOT explain the record: {reason}. Residuals are {rms:.3} times the noise of the {of}; the \
             standard deviations below hold for a model that is right, which this one is not."
        ),
        State::Explained => {
            format!("The model explains the record: residuals are {rms:.3} times the noise of the {of}; {reason}.")
        }
        State::NotTested => format!("The model was not tested: {reason}."),
    }
}

/// Priors that the record contradicts, the worst first.
fn conflicts(r: &IdentificationResult) -> Option<String> {
    let all = &r.prior_conflicts;
    let worst = all.first()?;
    let hint = if r.uncertain.iter().any(|u| u.name == worst.name) {
        "Look at what it is in the mission, or give it the deviation there that it has: the estimates lean on it"
    } else {
        "Correct the mission's value, or leave the prior out with --no-prior"
    };
    let rest = ff_model::diagnostics::list(all.iter().skip(1).map(|c| c.name.as_str()), 6);
    let others = if rest.is_empty() { String::new() } else { format!("; so are those of {rest}") };
    Some(format!(
        "The prior of {} is in conflict with the record: {} +- {} {u} was given, the record alone says {} +- {} {u}, {:.1} standard \
         deviations apart (limit {}){others}. {hint}.",
        worst.name,
        num(worst.prior_mean),
        num(worst.prior_std),
        num(worst.data_value),
        num(worst.data_std),
        worst.deviations,
        PriorConflict::LIMIT,
        u = worst.unit,
    ))
}

/// Residuals as parts of the signals, for an arm whose sensors have no figure of their own. A joint that is near rest throughout has no reading
/// that counts, and says nothing.
pub(in super::super) fn shares(channels: &[Channel]) -> String {
    let share = |c: &Channel| 100.0 * c.residual_rms / c.signal_rms.max(f64::MIN_POSITIVE);
    let all = || channels.iter().filter(|c| c.residual_rms > 0.0).map(|c| (share(c), c.name.as_str()));
    let least = all().min_by(|a, b| a.0.total_cmp(&b.0));
    let most = all().max_by(|a, b| a.0.total_cmp(&b.0));
    match (least, most) {
        (Some((a, x)), Some((b, y))) => format!("to between {a:.1} % ({x}) and {b:.1} % ({y}) of their size"),
        _ => String::new(),
    }
}

/// Are the residuals white? Worth a sentence either way.
fn whiteness(all: &[Whiteness]) -> Option<String> {
    let coloured: Vec<&Whiteness> = all.iter().filter(|w| !w.white).collect();
    if all.is_empty() {
        return None;
    }
    if coloured.is_empty() {
        return Some(format!("The residuals of all {} channels are white.", all.len()));
    }
    let names = ff_model::diagnostics::list(coloured.iter().map(|w| w.channel.as_str()), 6);
    let mut hz: Vec<f64> = coloured.iter().flat_map(|w| w.stands_out_hz.iter().copied()).collect();
    hz.sort_by(f64::total_cmp);
    hz.dedup();
    let hz: Vec<String> = hz.iter().map(|f| format!("{f:.3}")).collect();
    let modes = if hz.is_empty() { String::new() } else { format!("; they stand out at {} Hz", hz.join(", ")) };
    let (k, n) = (coloured.len(), all.len());
    Some(format!(
        "The residuals of {k} of {n} channels are coloured, so that something is left in them: {names}{modes}."
    ))
}

/// What is taken as exact, and what the most harmful small errors of it would move.
pub fn harmful(all: &[Harm]) -> Option<String> {
    let worst: Vec<String> = all
        .iter()
        .filter(|h| h.moves_by > HARMLESS)
        .take(3)
        .map(|h| format!("{} of {} moves {} by {:.1} deviations", h.size, h.name, h.moves, h.moves_by))
        .collect();
    if worst.is_empty() {
        return None;
    }
    Some(format!(
        "Everything that is not estimated is taken as exact, sensors and placements included: {}. [[uncertain]] and [sensors] in the \
         mission say how far it may be off.",
        worst.join("; ")
    ))
}

/// What would help most: the error that, known better, makes one of the deviations smaller by the largest factor.
pub fn next_step(budget: &[BudgetLine]) -> Option<String> {
    let gain = |b: &&BudgetLine| b.better.as_ref().map_or(1.0, |x| x.std / b.std);
    let b = budget.iter().min_by(|a, b| gain(a).total_cmp(&gain(b)))?;
    let better = b.better.as_ref()?;
    Some(format!(
        "What would help most: {} known {:.0} times better would bring the deviation of {} from {} to {} {}.",
        better.kind.words(),
        better.factor,
        b.name,
        num(b.std),
        num(better.std),
        b.unit
    ))
}
