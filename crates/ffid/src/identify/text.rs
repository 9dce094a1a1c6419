//! A result in words, for the terminal and `report.txt`.

use super::result::{Ended, HeldOut, IdentificationResult, Method, Parameter, Told};
use std::fmt;

/// Chi-squared per degree of freedom below which the noise figures are too large to be those of the record.
const QUIET: f64 = 0.5;

/// Four significant digits, in exponent form when very large or small.
pub(crate) fn num(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 {
        "0".into()
    } else if (1e-3..1e6).contains(&size) {
        let digits = (4 - size.log10().floor() as i32).max(0) as usize;
        format!("{x:.digits$}")
    } else {
        format!("{x:.4e}")
    }
}

/// The verdict in sentences, the most important first.
pub(super) fn verdict(r: &IdentificationResult, limit: f64) -> Vec<String> {
    let mut out = Vec::new();
    let n = r.parameters.len();
    let names =
        |t: Told| -> Vec<&str> { r.parameters.iter().filter(|p| p.verdict == t).map(|p| p.name.as_str()).collect() };
    let told = names(Told::Estimated).len();
    if !r.status.is_solution() {
        out.push(format!("The fit did NOT end at a solution: it {}. The values below are no estimates.", r.status));
    } else if told == n {
        out.push(format!("All {n} parameters are determined by the record."));
    } else {
        out.push(format!("{told} of {n} parameters are determined by the record."));
    }
    if !r.null_directions.is_empty() {
        let k = r.null_directions.len();
        let held = if r.priors_cover { "held by the priors" } else { "left where the fit started" };
        let what = if k == 1 { "one combination".to_owned() } else { format!("{k} combinations") };
        let first = &r.null_directions[0].text;
        out.push(format!("The record is silent on {what}, {held}: {first}{}", if k > 1 { "; ..." } else { "." }));
    }
    for (t, words) in [
        (Told::Weak, "known worse than to their own size"),
        (Told::PriorOnly, "no better known than before, by their priors"),
        (Told::AtBound, "at a bound, and no estimates"),
    ] {
        let all = names(t);
        if !all.is_empty() {
            out.push(format!("{} {words}: {}.", all.len(), crate::model::list(all.iter().copied(), 12)));
        }
    }
    let rms = r.chi2_per_dof.sqrt();
    out.push(if r.chi2_per_dof > limit {
        format!(
            "The model does NOT explain the record: residuals are {rms:.2} times the noise of the sensors (limit {:.2}). \
             Standard deviations are too small by about that factor; something moves that the model does not have, or \
             the noise figures are wrong.",
            limit.sqrt()
        )
    } else if r.chi2_per_dof < QUIET {
        format!(
            "Residuals are {rms:.3} times the noise that was given: the sensors are quieter than that, and the standard \
             deviations are too large."
        )
    } else {
        format!("The model explains the record: residuals are {rms:.3} times the noise of the sensors.")
    });
    out
}

fn row(f: &mut fmt::Formatter<'_>, p: &Parameter, w: usize) -> fmt::Result {
    write!(f, "  {:w$} {:>13} {:8}", p.name, num(p.value), p.unit)?;
    match (p.std, p.interval95) {
        (Some(s), Some((lo, hi))) => write!(f, " +- {:>10}  [{}, {}]", num(s), num(lo), num(hi))?,
        _ => write!(f, " cannot be told")?,
    }
    if p.verdict != Told::Estimated && p.std.is_some() {
        write!(f, "  {}", p.verdict.words())?;
    }
    writeln!(f)
}

impl fmt::Display for HeldOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} ({} samples, {:.3} s)", self.source, self.samples, self.seconds)?;
        writeln!(f, "  {}", self.verdict)?;
        writeln!(f, "  chi-squared per degree of freedom {:.4}, limit {}", self.chi2_per_dof, self.limit)?;
        channels(f, &self.channels)
    }
}

fn channels(f: &mut fmt::Formatter<'_>, all: &[super::result::Channel]) -> fmt::Result {
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
        };
        let rec = &p.record;
        writeln!(f, "identification of {} from {:.3} s at {:.4} Hz ({how})", self.robot, rec.seconds, rec.rate_hz)?;
        self.verdict.iter().try_for_each(|v| writeln!(f, "  {v}"))?;
        let w = self.parameters.iter().chain(&self.nuisance).map(|p| p.name.chars().count()).max().unwrap_or(8);
        writeln!(f, "\nparameters ({}), standard deviation, 95 % interval", self.parameters.len())?;
        self.parameters.iter().try_for_each(|p| row(f, p, w))?;
        if !self.nuisance.is_empty() {
            writeln!(f, "\nbeside them ({})", self.nuisance.len())?;
            self.nuisance.iter().try_for_each(|p| row(f, p, w))?;
        }
        let total = self.singular_values.len();
        writeln!(f, "\nidentifiability: {} of {total} unknowns determined by the data alone", self.rank)?;
        for d in &self.null_directions {
            writeln!(f, "  silent on: {}", d.text)?;
        }
        for d in &self.weak_directions {
            writeln!(f, "  known worse than its own size: {}", d.text)?;
        }
        for c in self.correlations.iter().take(12) {
            writeln!(f, "  correlation {:+.4} of {} and {}", c.value, c.first, c.second)?;
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
        let end = match &self.status {
            Ended::Converged => "converged".to_owned(),
            other => other.to_string(),
        };
        writeln!(
            f,
            "\nfit: {end} after {} linearisations, chi-squared per degree of freedom {:.4}",
            self.iterations, self.chi2_per_dof
        )?;
        channels(f, &self.channels)?;
        if let Some(h) = &self.held_out {
            write!(f, "\nheld out: {h}")?;
        }
        Ok(())
    }
}
