//! Errors and warnings that follow from an identification.

use super::args::Args;
use ff_model::diagnostics::list;
use ff_model::{Area, Problem, Problems};
use ffid::workflow::identify::{Combination, IdentificationResult, Method, Minima, SampledState, State};

/// Code of everything that was ended from outside.
pub(crate) const INTERRUPTED: &str = "Fit::Interrupted";

/// Most combinations named in one line.
const LISTED: usize = 3;

/// What a result finds fault with, given what was found `before` the fit. A solution that is not one, and what nothing can tell, are errors.
pub(crate) fn faults(r: &IdentificationResult, args: &Args, before: &Problems) -> Problems {
    let mut out = Problems::default();
    let file = args.paths().swap_remove(0);
    let mut add = |p: Problem, hint: &str| out.push(p.in_file(&file).hint(hint));
    if r.status.is_interrupted() {
        let what = format!("the fit {}: what is written is where it has got to, and no estimates", r.status);
        add(Problem::error(Area::Data, INTERRUPTED, what), "run the command again, and let it end");
    } else if !r.status.is_solution() && r.state() != State::Contradicted {
        // Where an error is known with which it ends, the model is what is wrong, and not the start.
        let hint = "start nearer, give priors, or raise --max-iterations";
        add(Problem::error(Area::Data, "Fit::NoSolution", format!("the fit {}", r.status)), hint);
    }
    let silent: Vec<(&[Combination], &str)> = match &r.silent {
        None => vec![(&r.null_directions, "")],
        Some(s) => vec![
            (
                &s.structural,
                if r.method == Method::Ground {
                    ", as any log of this arm with its base fixed is"
                } else {
                    ", as any record of this robot is"
                },
            ),
            (&s.unexcited, ", which another motion might tell"),
        ],
    };
    // What a fit that has not ended does not see where it stopped is no property of the record.
    for (all, why) in silent.into_iter().filter(|s| r.status.is_solution() && !s.0.is_empty()) {
        let what = match all {
            [one] => format!("the record is silent on {}{why}", one.text),
            _ => {
                let named = list(all.iter().map(|d| d.text.as_str()), LISTED);
                format!("the record is silent on {} combinations of parameters{why}: {named}", all.len())
            }
        };
        let (make, hint): (fn(_, _, String) -> Problem, _) = if r.reduced.is_some() {
            (|a, c, m| Problem::warning(a, c, m), "what it can tell was estimated, and the rest held; see the report")
        } else if r.priors_cover {
            (|a, c, m| Problem::warning(a, c, m), "its prior holds it; excite it, or estimate less")
        } else {
            (|a, c, m| Problem::error(a, c, m), "give --reduce or --prior, estimate less, or excite otherwise")
        };
        add(make(Area::Data, "Fit::Unidentifiable", what), hint);
    }
    if let Some(said) = r.minima.as_ref().and_then(Minima::undecided) {
        let p = Problem::warning(Area::Data, "Fit::MultipleMinima", said);
        add(p, "move these modes more, record longer, or give what is known with --prior");
    } else if let Some(m) = r.minima.as_ref().filter(|m| m.objectives.len() > 1) {
        let costs: Vec<String> = m.objectives.iter().map(|o| format!("{o:.4e}")).collect();
        let what = format!("{} starts led to {} minima, of cost {}", m.starts, costs.len(), costs.join(", "));
        let hint = format!("{}; start nearer, or excite more", m.taken());
        add(Problem::warning(Area::Data, "Fit::MultipleMinima", what), &hint);
    }
    let of_motion = [
        (
            "Fit::Band",
            "measure positions finer, or record rates and accelerations, to have more compared; else there is nothing to do",
        ),
        ("Fit::MotionNoise", "move the joints so that these modes ring, or measure positions finer"),
        (
            "Data::Kinks",
            "a log of the rates and accelerations that the controller commanded, or a smoother profile, keeps all readings",
        ),
    ];
    for (code, hint) in of_motion {
        for w in r.warnings.iter().filter(|w| w.code == code) {
            add(Problem::warning(Area::Data, code, w.message.clone()), hint);
        }
    }
    if let Some(d) = r.sampled.as_ref().filter(|d| d.state != SampledState::Converged) {
        let hint = match d.state {
            SampledState::NotDrawn => "give --reduce or a prior, or leave --sample out",
            SampledState::Interrupted => "let it end, or draw fewer",
            _ => "draw more (--sample with a larger number), or give what moves slowest a prior (--prior)",
        };
        let what = format!("the posterior has no intervals from draws: {}", d.reason);
        add(Problem::warning(Area::Data, "Fit::NotSampled", what), hint);
    }
    if let Some(e) = r.evidence.as_ref().filter(|e| e.state == State::Contradicted) {
        let chi2 = format!("chi-squared per degree of freedom {:.3}, limit {}", r.chi2_per_dof, args.fit.limit());
        let p = Problem::warning(Area::Data, "Fit::Misfit", format!("{}; {chi2}", e.reason));
        // Where no error explains it, noise that is another than was given comes first.
        let figure = before.0.iter().find(|p| p.code == "Data::NoiseFigure").and_then(|p| {
            let of = p.object.as_deref().unwrap_or_default();
            Some(format!("first the noise of {of}, which is another than was given: {}", p.hint.as_deref()?))
        });
        let hint = e.remedy().or(figure).unwrap_or_else(|| {
            "ask `ffid doctor` for the noise of the sensors, and look at the spectra of the residuals: something moves that the model does \
             not have, or the noise is another"
                .to_owned()
        });
        add(p, &hint);
    }
    if let Some(h) = r.held_out.as_ref().filter(|h| !h.explained) {
        let what = format!(
            "held-out data: {} (chi-squared per degree of freedom {:.3}, limit {})",
            h.verdict, h.chi2_per_dof, h.limit
        );
        add(Problem::warning(Area::Data, "Fit::HeldOut", what), "the model does not predict what it has not seen");
    }
    out
}
