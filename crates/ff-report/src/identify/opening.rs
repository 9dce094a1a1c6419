//! What a report opens with: the answer, how far it can be trusted, and what to do next.

use super::names;
use crate::page::{Level, Opening, Part};
use crate::plot::typeset;
use ffid::workflow::identify::{BodyLine, BodyQuantity, IdentificationResult, Method, ParameterVerdict, State};
use ffid::workflow::identify::{next_step, num};

/// Most parameters that are named in a sentence.
const NAMED: usize = 4;
/// Deviations by which a small error of something that is taken as exact has to move an estimate before it is mentioned.
const MATTERS: f64 = 1.0;

/// The opening of the report of a result; `level` is that of the whole.
pub(super) fn opening(r: &IdentificationResult, level: Level) -> Opening {
    let (trust, heading, trusted) = trust(r);
    // As the terminal writes it.
    let set = |all: Vec<String>| all.into_iter().map(|s| s.replace(" +- ", " \u{b1} ")).collect();
    Opening {
        level,
        parts: vec![
            Part { label: "Answer", mark: None, sentences: set(answer(r)) },
            Part { label: "Trust", mark: Some((trust, heading)), sentences: set(trusted) },
            Part { label: "Next step", mark: None, sentences: set(next(r)) },
        ],
        full: said(r),
    }
}

/// Everything that the terminal says, in its order.
fn said(r: &IdentificationResult) -> Vec<String> {
    let held = r.held_out.iter().map(|h| format!("Held out ({}): {}", h.source, h.verdict));
    r.verdict.iter().cloned().chain(held).collect()
}

fn quantity(q: &BodyQuantity) -> String {
    q.std.map_or_else(|| num(q.value), |s| with_std(q.value, s))
}

/// A value to the second digit of its deviation: `605.2 ± 7.3`.
fn with_std(value: f64, std: f64) -> String {
    if !(std > 0.0 && std.is_finite()) {
        return num(value);
    }
    let digits = (1 - std.log10().floor() as i32).max(0) as usize;
    if digits > 7 || value.abs() >= 1e7 {
        return format!("{} \u{b1} {}", num(value), num(std));
    }
    format!("{value:.digits$} \u{b1} {std:.digits$}")
}

fn body(b: &BodyLine) -> String {
    let of = |name: &str| b.quantities.iter().find(|q| q.name == name);
    let mass = of("mass").map(|q| format!("mass {} kg", quantity(q)));
    let com: Vec<String> = ["com_x", "com_y", "com_z"].iter().filter_map(|n| of(n)).map(quantity).collect();
    let com = (com.len() == 3).then(|| format!("centre of mass ({}) m", com.join(", ")));
    format!("{}: {}", b.name, mass.into_iter().chain(com).collect::<Vec<_>>().join(", "))
}

/// Whether data speak against the model: estimates and deviations are then those of another robot.
fn refuted(r: &IdentificationResult) -> bool {
    let contradicted = r.evidence.is_some() && r.state() == State::Contradicted;
    contradicted || r.held_out.as_ref().is_some_and(|h| !h.explained)
}

fn answer(r: &IdentificationResult) -> Vec<String> {
    let mut out: Vec<String> = r.verdict.first().cloned().into_iter().collect();
    if !r.status.is_solution() {
        return out;
    }
    if refuted(r) {
        out = vec!["None that can be used: the data contradict the model.".to_owned()];
        // Deviations hold for a right model alone.
        let bare = |b: &BodyLine| {
            let quantities = b.quantities.iter().cloned().map(|q| BodyQuantity { std: None, ..q }).collect();
            body(&BodyLine { quantities, ..b.clone() })
        };
        out.extend(r.bodies.first().map(|b| format!("The fit ended at {}. Its parameters are below.", bare(b))));
        return out;
    }
    // What the record does not tell has no deviation, and is where the fit began.
    let told = |b: &&BodyLine| b.quantities.iter().all(|q| q.std.is_some());
    out.extend(r.bodies.iter().filter(told).take(2).map(|b| format!("{}.", body(b))));
    let of_body =
        |name: &str| r.bodies.iter().any(|b| name.strip_prefix(&b.name).is_some_and(|rest| rest.starts_with('.')));
    let others: Vec<_> =
        r.parameters.iter().filter(|p| !of_body(&p.name) && p.verdict == ParameterVerdict::Estimated).collect();
    let mut before = None;
    let one = |p: &&ffid::workflow::identify::Parameter| {
        let value = p.std.map_or_else(|| num(p.value), |s| with_std(p.value, s));
        // Said once for all of a kind that follow each other.
        let kind = names::kind(p);
        let what = kind.filter(|_| kind != before).map_or_else(String::new, |k| format!("{k} "));
        before = kind;
        format!("{what}{} {value} {}", p.name, typeset(&p.unit))
    };
    let words: Vec<String> = others.iter().take(NAMED).map(one).collect();
    if !words.is_empty() {
        let more = others.len().saturating_sub(NAMED);
        let more = if more > 0 { format!("; {more} more below") } else { String::new() };
        out.push(format!("{}{more}.", words.join("; ")));
    }
    out
}

/// Level, heading and reasons.
fn trust(r: &IdentificationResult) -> (Level, &'static str, Vec<String>) {
    let mut said = Vec::new();
    let held_fails = r.held_out.as_ref().is_some_and(|h| !h.explained);
    let state = r.evidence.as_ref().map(|_| r.state());
    let (level, heading) = match (r.status.is_solution(), state) {
        (_, Some(State::Contradicted)) => (Level::Bad, "Do not use it: the record contradicts the model"),
        (false, _) => (Level::Bad, "None: the fit has not ended at a solution"),
        (true, _) if held_fails => (Level::Bad, "Do not use it: data that were not used are not predicted"),
        (true, Some(State::Explained)) if r.minima.as_ref().is_some_and(|m| m.undecided().is_some()) => {
            (Level::Fair, "The model explains the record, with several answers")
        }
        (true, Some(State::Explained)) if r.exit() == ffid::exit::Exit::IllPosed => {
            (Level::Fair, "The model explains the record, which does not tell all of it")
        }
        (true, Some(State::Explained)) => (Level::Good, "The model explains the record"),
        (true, Some(State::NotTested) | None) if r.method == Method::Ground => {
            (Level::Good, "Calibrated on the ground")
        }
        (true, Some(State::NotTested) | None) => (Level::Fair, "Not tested"),
    };
    if let Some(e) = &r.evidence {
        said.push(format!("Residuals are {:.2} times the noise of the sensors; {}.", r.chi2_per_dof.sqrt(), e.reason));
        said.extend(e.in_doubt());
    }
    said.extend(r.held_out.iter().map(|h| format!("Data that were not used ({}): {}", h.source, h.verdict)));
    if let Some((p, off)) = r.farthest_from_truth() {
        said.push(format!(
            "The truth is known: the farthest estimate, {}, is {:.1} of its deviations from it.",
            p.name,
            off.abs()
        ));
    }
    if let Some(h) = r.taken_as_exact.first().filter(|h| h.moves_by >= MATTERS) {
        said.push(format!(
            "The deviations hold if sensors, links and placements are exactly as the mission says: {} of {} alone would move {} by {:.1} of its deviations.",
            h.size, h.name, h.moves, h.moves_by
        ));
    }
    if !r.uncertain.is_empty() {
        said.push(format!(
            "The deviations allow for {} quantities that the mission is not sure of.",
            r.uncertain.len()
        ));
    }
    (level, heading, said)
}

fn named(r: &IdentificationResult, of: &[ParameterVerdict]) -> Option<String> {
    let all: Vec<&str> = r.parameters.iter().filter(|p| of.contains(&p.verdict)).map(|p| p.name.as_str()).collect();
    (!all.is_empty()).then(|| ff_model::diagnostics::list(all, NAMED))
}

fn next(r: &IdentificationResult) -> Vec<String> {
    let mut out = Vec::new();
    if r.status.is_interrupted() {
        return vec!["Run the command again, and let it end.".to_owned()];
    }
    if !r.status.is_solution() {
        let found = r.evidence.as_ref().and_then(|e| Some((e.refitted()?, e.remedy()?)));
        if let Some((found, remedy)) = found {
            return vec![format!("The fit ends with {found}: {remedy}.")];
        }
        return vec![
            "Give the fit another start (--starts 5), or check the mission (ffid check) and the record (ffid doctor)."
                .to_owned(),
        ];
    }
    let contradicted = r.evidence.is_some() && r.state() == State::Contradicted;
    if contradicted {
        let first = r.evidence.as_ref().and_then(|e| Some((e.named.first()?, e.remedy()?)));
        out.push(match first {
            Some((n, remedy)) => format!("See what explains the record, below. If {} is plausible, {remedy}.", n.text),
            None => "Nothing that was tried explains the record: look at residuals and spectra below, then mend the mission.".to_owned(),
        });
    }
    if !r.null_directions.is_empty() && r.reduced.is_none() {
        out.push("The record is silent on some combinations: estimate only what it can tell (--reduce), or record another motion.".to_owned());
    }
    if let Some(apart) = r.minima.as_ref().filter(|m| m.undecided().is_some()) {
        let all = ff_model::diagnostics::list(apart.alternatives.iter().map(|a| a.name.as_str()), NAMED);
        out.push(format!("The record does not choose between several values of {all}: move these modes more, record longer, or give what is known (--prior)."));
    }
    if let Some(weak) =
        named(r, &[ParameterVerdict::Weak, ParameterVerdict::PriorOnly, ParameterVerdict::NotIdentifiable])
    {
        out.push(format!("To learn more about {weak}: plan another motion (ffid excite), and record it."));
    }
    if let Some(better) = next_step(&r.budget) {
        out.push(better);
    } else if r.uncertain.is_empty() && r.taken_as_exact.first().is_some_and(|h| h.moves_by >= MATTERS) {
        out.push("Say in the mission how far sensors and placements may be off: [[uncertain]] and [sensors] (ffid init writes both).".to_owned());
    }
    if r.held_out.is_none() && !contradicted {
        out.push(
            "Try the answer on data that were not used: --held-out 0.3, or another record with ffid validate."
                .to_owned(),
        );
    }
    if !contradicted && r.held_out.as_ref().is_none_or(|h| h.explained) {
        out.push("The robot with these values is identified.toml beside this report.".to_owned());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::with_std;

    #[test]
    fn values_are_as_fine_as_their_deviations() {
        assert_eq!(with_std(605.237, 7.2863), "605.2 \u{b1} 7.3");
        assert_eq!(with_std(-0.001_998_9, 0.001_615), "-0.0020 \u{b1} 0.0016");
        assert_eq!(with_std(98.287, 25.255), "98 \u{b1} 25");
        assert_eq!(with_std(3.0, 0.0), "3.0000");
    }
}
