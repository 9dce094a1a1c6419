//! What the verdict on a trajectory opens with: what its record will tell, whether it may be flown, and what to do next.

use crate::page::{Level, Opening, Part};
use crate::plot::typeset;
use ff_model::diagnostics::list;
use ffid::workflow::identify::{harmful, next_step, num};
use ffid::workflow::preflight::{Determination, LimitMargin, Preflight, Seen};

/// Most names in a sentence, and most broken limits.
const NAMED: usize = 12;
const BROKEN: usize = 4;

/// The opening of the report of a verdict.
pub(super) fn opening(v: &Preflight) -> Opening {
    let answer = answer(v);
    let tells_all = answer.len() == 1;
    let level = match (v.limits_hold, tells_all) {
        (false, _) => Level::Bad,
        (true, false) => Level::Fair,
        (true, true) => Level::Good,
    };
    let (mark, broken) = limits(v);
    Opening {
        level,
        parts: vec![
            Part { label: "Answer", mark: None, sentences: answer },
            Part { label: "Limits", mark: Some(mark), sentences: broken },
            Part { label: "Next step", mark: None, sentences: next(v, tells_all) },
        ],
        full: Vec::new(),
    }
}

/// What will be told; more than one sentence where something will not.
fn answer(v: &Preflight) -> Vec<String> {
    let n = v.parameters.len();
    let told = v.parameters.iter().filter(|p| p.told == Determination::Well).count();
    let mut out = vec![format!("{told} of {n} parameters will be determined by {:.2} s of this motion.", v.duration_s)];
    let weak = v.parameters.iter().filter(|p| p.told == Determination::Weakly).map(|p| p.name.as_str());
    let weak: Vec<&str> = weak.collect();
    if !weak.is_empty() {
        let percent = (1000.0 * v.weak_above).round() / 10.0;
        out.push(format!("Known worse than to {percent} %: {}.", list(weak, NAMED)));
    }
    if !v.null_directions.is_empty() {
        out.push(format!("The record will be silent on {} combinations.", v.null_directions.len()));
    }
    let blind = v.modes.iter().filter(|m| m.torque.seen == Seen::Not && m.gyro.seen == Seen::Not).count();
    if blind > 0 {
        out.push(format!("No sensor will see {blind} of {} modes.", v.modes.len()));
    }
    out
}

fn limits(v: &Preflight) -> ((Level, &'static str), Vec<String>) {
    if v.limits_hold {
        let words = if v.limits.is_empty() { "None are given" } else { "All limits are kept" };
        return ((Level::Good, words), Vec::new());
    }
    let mut broken: Vec<&LimitMargin> = v.limits.iter().filter(|m| !m.holds).collect();
    broken.sort_by(|a, b| (a.margin / a.limit.abs()).total_cmp(&(b.margin / b.limit.abs())));
    let one = |m: &&LimitMargin| {
        let unit = typeset(&m.unit);
        format!(
            "{} of {}: {} {unit}, limit {} {unit}, at {:.2} s.",
            m.what,
            m.item,
            num(m.bound),
            num(m.limit),
            m.time_s
        )
    };
    let mut said: Vec<String> = broken.iter().take(BROKEN).map(one).collect();
    if broken.len() > BROKEN {
        said.push(format!("{} more below.", broken.len() - BROKEN));
    }
    ((Level::Bad, "Do not fly it: limits are broken"), said)
}

fn next(v: &Preflight, tells_all: bool) -> Vec<String> {
    let mut out = Vec::new();
    out.push(match (v.limits_hold, tells_all) {
        (false, _) => "Let ffid excite plan a motion within the limits, or make this one smaller or slower.".to_owned(),
        (true, false) => "Let ffid excite plan a motion that tells more, or estimate less: [estimate].".to_owned(),
        (true, true) => "Fly it, look at the record by ffid doctor, and give it to ffid identify.".to_owned(),
    });
    out.extend(next_step(&v.budget).into_iter().chain(harmful(&v.taken_as_exact)));
    out
}
