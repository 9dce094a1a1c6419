//! A result as text: the verdict, then all numbers.

use super::budget::{budget, uncertain};
use crate::workflow::identify::evidence::NamedError;
use crate::workflow::identify::number::num;
use crate::workflow::identify::result::body::BodyLine;
use crate::workflow::identify::result::channel::Channel;
use crate::workflow::identify::result::fit::{Ended, Method};
use crate::workflow::identify::result::held_out::HeldOut;
use crate::workflow::identify::result::identification::IdentificationResult;
use crate::workflow::identify::result::parameter::{Parameter, ParameterVerdict};
use crate::workflow::identify::result::sampled::Sampled;
use std::fmt;

/// Errors that are listed.
const LISTED: usize = 6;

/// An error that the record speaks for, in two lines.
fn error(f: &mut fmt::Formatter<'_>, n: &NamedError) -> fmt::Result {
    let beside = if n.beside { "and beside it " } else { "" };
    writeln!(f, "  {}: {beside}{}", n.name, n.text)?;
    let alike = match &n.alike[..] {
        [] => String::new(),
        all => format!(
            "; nearly the same effect (correlation above 0.95) has {}",
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
        let after = if self.status.is_interrupted() {
            String::new()
        } else {
            format!(" after {} linearisations", self.iterations)
        };
        writeln!(f, "\nfit: {end}{after}, chi-squared per degree of freedom {:.4}", self.chi2_per_dof)?;
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
        writeln!(
            f,
            "  {} of them met the edge of what is physical, lost their energy or have no solution",
            s.divergences
        )?;
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
