//! A result in words, for the terminal and `report.txt`.

use super::evidence::{Harm, NamedError, State};
use super::findings::{Minima, PriorConflict, ProfileLine, Whiteness};
use super::number::num;
use super::result::body::BodyLine;
use super::result::channel::Channel;
use super::result::fit::{Ended, Method};
use super::result::held_out::HeldOut;
use super::result::identification::IdentificationResult;
use super::result::parameter::{Parameter, ParameterVerdict};
use super::result::sampled::{Sampled, SampledState};
use super::result::uncertain::{BudgetLine, UncertainLine};
use std::fmt;

/// Deviations that an error may move an estimate by without a word.
const HARMLESS: f64 = 0.1;
/// Errors that are listed.
const LISTED: usize = 6;
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
    if !r.null_directions.is_empty() {
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
    if let Some(s) = &r.silent {
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
            out.push(format!("{} {words}: {}.", all.len(), ff_model::diagnostics::list(all.iter().copied(), 12)));
        }
    }
    if let Ended::Flat { along } = &r.status {
        out.push(format!(
            "The fit has a flat direction: going on along it gains nothing that the noise would not. It is {along}."
        ));
    }
    out.extend(conflicts(&r.prior_conflicts));
    let rms = r.chi2_per_dof.sqrt();
    out.push(if r.method == Method::Ground {
        format!("The arm and its friction predict the torques {}.{}", shares(&r.channels), beside(r))
    } else {
        tested(r, rms)
    });
    if r.method != Method::Ground && r.chi2_per_dof < QUIET {
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

/// What the record says of the model as a whole.
fn tested(r: &IdentificationResult, rms: f64) -> String {
    let reason = r.evidence.as_ref().map_or("", |e| &e.reason);
    match r.state() {
        State::Contradicted => format!(
            "The model does NOT explain the record: {reason}. Residuals are {rms:.3} times the noise of the sensors; the \
             standard deviations below hold for a model that is right, which this one is not."
        ),
        State::Explained => {
            format!("The model explains the record: residuals are {rms:.3} times the noise of the sensors; {reason}.")
        }
        State::NotTested => format!("The model was not tested: {reason}."),
    }
}

/// Priors that the record contradicts, the worst first.
fn conflicts(all: &[PriorConflict]) -> Option<String> {
    let worst = all.first()?;
    let rest = ff_model::diagnostics::list(all.iter().skip(1).map(|c| c.name.as_str()), 6);
    let others = if rest.is_empty() { String::new() } else { format!("; so are those of {rest}") };
    Some(format!(
        "The prior of {} is in conflict with the record: {} +- {} {u} was given, the record alone says {} +- {} {u}, {:.1} standard \
         deviations apart (limit {}){others}. Correct the mission's value, or leave the prior out with --no-prior.",
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

/// Residuals as parts of the signals, for an arm whose sensors have no figure of their own.
pub(super) fn shares(channels: &[Channel]) -> String {
    let share = |c: &Channel| 100.0 * c.residual_rms / c.signal_rms.max(f64::MIN_POSITIVE);
    let all = || channels.iter().map(|c| (share(c), c.name.as_str()));
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

/// An error that the record speaks for, in two lines.
fn error(f: &mut fmt::Formatter<'_>, n: &NamedError) -> fmt::Result {
    let beside = if n.beside { "and beside it " } else { "" };
    writeln!(f, "  {}: {beside}{}", n.name, n.text)?;
    let alike = match &n.alike[..] {
        [] => String::new(),
        all => format!(
            "; this record cannot tell it from {}",
            ff_model::diagnostics::list(all.iter().map(String::as_str), 4)
        ),
    };
    let (drop, by) = (num(n.drop), n.moves_by);
    let how = if n.refitted { "with it among the unknowns, " } else { "to first order, " };
    writeln!(f, "    {how}chi-squared falls by {drop}, {} moves by {by:.1} deviations{alike}", n.moves)?;
    if !n.mission.is_empty() {
        writeln!(f, "    to have it in the model, add to the mission, and its parameters to [estimate]:")?;
        n.mission.lines().try_for_each(|l| writeln!(f, "      {l}"))?;
    }
    Ok(())
}

fn row(f: &mut fmt::Formatter<'_>, p: &Parameter, w: usize) -> fmt::Result {
    write!(f, "  {:w$} {:>13} {:8}", p.name, num(p.value), p.unit)?;
    match (p.std, p.interval95) {
        (Some(s), Some((lo, hi))) => write!(f, " +- {:>10}  [{}, {}]", num(s), num(lo), num(hi))?,
        _ => write!(f, " cannot be told")?,
    }
    if let Some(s) = p.std_coloured {
        write!(f, "  coloured +- {}", num(s))?;
    }
    if p.start != 0.0 && p.value != p.start {
        write!(f, "  {:+.2} %", 100.0 * (p.value - p.start) / p.start.abs())?;
    }
    if p.verdict != ParameterVerdict::Estimated && p.std.is_some() {
        write!(f, "  {}", p.verdict.words())?;
    }
    writeln!(f)
}

/// A body as mass, centre of mass, inertia about it and principal axes.
fn body(f: &mut fmt::Formatter<'_>, b: &BodyLine) -> fmt::Result {
    let std = |s: Option<f64>| s.map_or_else(|| "not identifiable".to_owned(), |s| format!("+- {:>10}", num(s)));
    let change = |c: Option<f64>| c.map_or_else(String::new, |c| format!("  {c:+.2} %"));
    writeln!(f, "\nbody {}: about its centre of mass, in the axes of its frame", b.name)?;
    for q in &b.quantities {
        writeln!(f, "  {:15} {:>13} {:8} {}{}", q.name, num(q.value), q.unit, std(q.std), change(q.change_percent))?;
    }
    for a in &b.principal {
        let [x, y, z] = a.axis;
        let turn = a.axis_std_rad.map_or_else(String::new, |s| format!(" +- {:.3} deg", s.to_degrees()));
        let (value, deviation) = (num(a.moment_kgm2), std(a.moment_std_kgm2));
        let change = change(a.change_percent);
        writeln!(f, "  principal axis  {value:>13} kg m^2   {deviation}{change}  [{x:.4}, {y:.4}, {z:.4}]{turn}")?;
    }
    Ok(())
}

impl fmt::Display for HeldOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} ({} samples, {:.3} s)", self.source, self.samples, self.seconds)?;
        writeln!(f, "  {}", self.verdict)?;
        writeln!(f, "  chi-squared per degree of freedom {:.4}, limit {}", self.chi2_per_dof, self.limit)?;
        channels(f, &self.channels)
    }
}

fn channels(f: &mut fmt::Formatter<'_>, all: &[Channel]) -> fmt::Result {
    let w = all.iter().map(|c| c.name.chars().count()).max().unwrap_or(8);
    for c in all {
        writeln!(
            f,
            "  {:w$} signal {:>11} {:6} residual {:>11}  {:>7.3} times the noise",
            c.name,
            num(c.signal_rms),
            c.unit,
            num(c.residual_rms),
            c.over_noise
        )?;
    }
    Ok(())
}

impl fmt::Display for IdentificationResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let p = &self.provenance;
        let how = match self.method {
            Method::Rda => "rigid, base acceleration eliminated",
            Method::OutputError => "output error",
            Method::Ground => "fixed base, linear least squares with joint friction",
        };
        let rec = &p.record;
        writeln!(f, "identification of {} from {:.3} s at {:.4} Hz ({how})", self.robot, rec.seconds, rec.rate_hz)?;
        self.verdict.iter().try_for_each(|v| writeln!(f, "  {v}"))?;
        let w = self.parameters.iter().chain(&self.nuisance).map(|p| p.name.chars().count()).max().unwrap_or(8);
        writeln!(
            f,
            "\nparameters ({}), standard deviation, 95 % interval, change against the start",
            self.parameters.len()
        )?;
        self.parameters.iter().try_for_each(|p| row(f, p, w))?;
        if self.parameters.iter().any(|p| p.std_coloured.is_some()) {
            writeln!(
                f,
                "  (coloured: standard deviation under random noise of the colour that the residuals have, were the model right)"
            )?;
        }
        if !self.nuisance.is_empty() {
            writeln!(f, "\nbeside them ({})", self.nuisance.len())?;
            self.nuisance.iter().try_for_each(|p| row(f, p, w))?;
        }
        self.bodies.iter().try_for_each(|b| body(f, b))?;
        budget(f, &self.budget, w)?;
        uncertain(f, &self.uncertain)?;
        if !self.over_time.is_empty() {
            writeln!(f, "\nwhat changes")?;
            self.over_time.iter().try_for_each(|c| write!(f, "{c}"))?;
        }
        if let Some(e) = self.evidence.as_ref().filter(|e| !e.named.is_empty()) {
            writeln!(f, "\nwhat would explain the record, of {} errors that were tried", e.tried)?;
            e.named.iter().take(LISTED).try_for_each(|n| error(f, n))?;
            if let Some(more) = e.named.len().checked_sub(LISTED).filter(|&k| k > 0) {
                writeln!(f, "  and {more} more that explain less (result.json)")?;
            }
        }
        let total = self.singular_values.len();
        writeln!(f, "\nidentifiability: {} of {total} unknowns determined by the data alone", self.rank)?;
        for d in &self.null_directions {
            writeln!(f, "  silent on: {}", d.text)?;
        }
        for d in &self.weak_directions {
            writeln!(f, "  known worse than its own size: {}", d.text)?;
        }
        if let Some(s) = &self.silent {
            for (what, all) in [("by structure", &s.structural), ("not excited", &s.unexcited)] {
                all.iter().try_for_each(|d| writeln!(f, "  {what}: {}", d.text))?;
            }
        }
        if let Some(r) = &self.reduced {
            let held: Vec<String> =
                r.values.iter().map(|v| format!("{} at {} {}", v.name, num(v.value), v.unit)).collect();
            writeln!(f, "  held: {}", ff_model::diagnostics::list(held.iter().map(String::as_str), 40))?;
            r.combinations.iter().try_for_each(|c| writeln!(f, "  estimated: {}", c.text))?;
        }
        for c in self.correlations.iter().take(12) {
            writeln!(f, "  correlation {:+.4} of {} and {}", c.value, c.first, c.second)?;
        }
        if !self.profiles.is_empty() {
            let end = |x: Option<f64>| x.map_or_else(|| "unbounded".to_owned(), num);
            writeln!(f, "\nprofile likelihood, 95 % intervals")?;
            for p in &self.profiles {
                let gauss =
                    p.gaussian95.map_or_else(String::new, |(a, b)| format!(" (Gaussian [{}, {}])", num(a), num(b)));
                writeln!(f, "  {:w$} [{}, {}] {}{gauss}", p.name, end(p.lower95), end(p.upper95), p.unit)?;
            }
        }
        self.sampled.iter().try_for_each(|s| draws(f, s, w))?;
        if let Some((p, off)) = self.farthest_from_truth() {
            writeln!(f, "\ntruth: the farthest estimate, {}, is {:.2} of its deviations from it", p.name, off.abs())?;
        }
        if let Some(m) = &self.minima {
            let all: Vec<String> = m.objectives.iter().map(|o| format!("{o:.6e}")).collect();
            writeln!(f, "\nstarts: {} of {} converged, minima at {}", m.converged, m.starts, all.join(", "))?;
        }
        if let Some(c) = &self.comparison {
            writeln!(f, "\nmodels, judged by {}", c.judged_by)?;
            for k in &c.candidates {
                writeln!(
                    f,
                    "  {:9} {:>3} unknowns  -2 ln L +{:<11} (+- {:<9}) AIC +{:<11} BIC +{:<11} residuals {:.3} times the noise",
                    k.name,
                    k.unknowns,
                    num(k.held_out),
                    num(k.held_out_std),
                    num(k.aic),
                    num(k.bic),
                    k.held_out_mean_square.sqrt()
                )?;
            }
            writeln!(f, "  recommended: {}; {}", c.recommended, c.reason)?;
        }
        if !self.modes.is_empty() {
            writeln!(f, "\nmodes of the identified model (joints held, pose of the mission)")?;
            for m in &self.modes {
                writeln!(
                    f,
                    "  {:.4} Hz, damping {:.2} % (at the start {:.4} Hz)",
                    m.frequency_hz,
                    100.0 * m.damping_ratio,
                    m.start_hz
                )?;
            }
        }
        for d in &self.decay {
            writeln!(
                f,
                "\nmodes of the free decay of {} ({:.2} to {:.2} s, resolution {:.4} Hz)",
                d.record, d.from_s, d.to_s, d.resolution_hz
            )?;
            for m in &d.modes {
                write!(
                    f,
                    "  {:.4} +- {:.4} Hz, damping {:.2} +- {:.2} %",
                    m.frequency_hz,
                    m.frequency_std_hz,
                    100.0 * m.damping_ratio,
                    100.0 * m.damping_std
                )?;
                match (m.model_hz, m.mac) {
                    (Some(hz), Some(mac)) => writeln!(f, ": mode of the model at {hz:.4} Hz, MAC {mac:.3}")?,
                    _ => writeln!(f, ": {}", m.note)?,
                }
            }
            d.unresolved.iter().try_for_each(|(a, b)| writeln!(f, "  {a:.4} and {b:.4} Hz cannot be kept apart"))?;
            d.unseen.iter().try_for_each(|u| writeln!(f, "  not seen: {:.4} Hz, {}", u.frequency_hz, u.why))?;
        }
        if !self.clocks.is_empty() {
            writeln!(f, "\nclocks against that of the encoders (late, fast)")?;
        }
        for c in &self.clocks {
            writeln!(
                f,
                "  clock of the {} of {}: {:+.3} +- {:.3} ms, {:+.1} +- {:.1} ppm{}",
                c.group,
                c.record,
                1e3 * c.offset_s,
                1e3 * c.offset_std_s,
                c.skew_ppm,
                c.skew_std_ppm,
                if c.corrected { ", corrected" } else { "" }
            )?;
        }
        let end = match &self.status {
            Ended::Converged => "converged".to_owned(),
            other => other.to_string(),
        };
        writeln!(
            f,
            "\nfit: {end} after {} linearisations, chi-squared per degree of freedom {:.4}",
            self.iterations, self.chi2_per_dof
        )?;
        if self.records.is_empty() {
            channels(f, &self.channels)?;
        }
        for r in &self.records {
            writeln!(
                f,
                "  record {}: {:.3} s, residuals {:.3} times the noise",
                r.label,
                r.seconds,
                r.mean_square.sqrt()
            )?;
            channels(f, &r.channels)?;
        }
        if let Some(h) = &self.held_out {
            write!(f, "\nheld out: {h}")?;
        }
        Ok(())
    }
}

/// What draws from the posterior say.
fn draws(f: &mut fmt::Formatter<'_>, s: &Sampled, w: usize) -> fmt::Result {
    writeln!(
        f,
        "\ndraws from the posterior ({} chains of {}, {} evaluations): {}",
        s.chains, s.draws, s.evaluations, s.reason
    )?;
    if s.divergences > 0 {
        writeln!(f, "  {} trajectories met the edge of what is physical, or lost their energy", s.divergences)?;
    }
    for l in &s.parameters {
        let Some(((a, b), median)) = l.interval95.zip(l.median) else { continue };
        let (hdi, differs) = (l.hdi95.unwrap_or_default(), l.differs.unwrap_or_default());
        let apart =
            if differs > Sampled::DIFFERS { format!("  {differs:.1} deviations from the fit") } else { String::new() };
        writeln!(
            f,
            "  {:w$} {:>13} [{}, {}], highest density [{}, {}] {}{apart}",
            l.name,
            num(median),
            num(a),
            num(b),
            num(hdi.0),
            num(hdi.1),
            l.unit
        )?;
    }
    Ok(())
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

/// Where the variance of every parameter comes from.
pub(crate) fn budget(f: &mut fmt::Formatter<'_>, all: &[BudgetLine], w: usize) -> fmt::Result {
    if all.is_empty() {
        return Ok(());
    }
    writeln!(f, "\nwhere the variance comes from (%)")?;
    for b in all {
        write!(f, "  {:w$} noise {:>5.1}", b.name, 100.0 * b.noise)?;
        if b.minima > SEEN {
            write!(f, ", other minima {:.1}", 100.0 * b.minima)?;
        }
        for e in b.errors.iter().filter(|e| e.share > SEEN).take(4) {
            write!(f, ", {} {:.1}", e.kind.words(), 100.0 * e.share)?;
        }
        match &b.better {
            Some(x) => writeln!(
                f,
                "; {} {:.0} times better: +- {} becomes {} {}",
                x.kind.words(),
                x.factor,
                num(b.std),
                num(x.std),
                b.unit
            )?,
            None => writeln!(f)?,
        }
    }
    Ok(())
}

/// What was not known exactly, and is known better now.
fn uncertain(f: &mut fmt::Formatter<'_>, all: &[UncertainLine]) -> fmt::Result {
    if all.is_empty() {
        return Ok(());
    }
    let learnt = |u: &&UncertainLine| u.std.is_some_and(|s| s < LEARNT * u.prior_std);
    let known: Vec<&UncertainLine> = all.iter().filter(learnt).collect();
    writeln!(f, "\nwhat the mission is not sure of ({}), and the record tells better ({})", all.len(), known.len())?;
    for u in known.iter().take(MOST_UNCERTAIN) {
        let std = u.std.map_or_else(String::new, |s| format!(" +- {}", num(s)));
        writeln!(
            f,
            "  {:24} {}{std} {} (mission {} +- {})",
            u.name,
            num(u.value),
            u.unit,
            num(u.prior_mean),
            num(u.prior_std)
        )?;
    }
    match known.len().checked_sub(MOST_UNCERTAIN).filter(|&k| k > 0) {
        Some(more) => writeln!(f, "  and {more} more (result.json)"),
        None => Ok(()),
    }
}

/// Part of a variance from which it is listed.
const SEEN: f64 = 0.005;
/// Part of a prior deviation below which a record has told something.
const LEARNT: f64 = 0.8;
/// Uncertain quantities that are listed.
const MOST_UNCERTAIN: usize = 20;
