//! The verdict in words.

use super::{Determination, LimitMargin, ModeVisibility, Predicted, Preflight, Proof, Seen, modes::Reading};
use crate::workflow::identify::number::significant;
use crate::workflow::identify::{budget, harmful, next_step};
use std::fmt;

/// Limits listed: the closest ones.
const CLOSEST: usize = 6;

impl fmt::Display for Preflight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "verdict on {:.4} s at {} Hz for {}", self.duration_s, self.sensing.rate_hz, self.robot)?;
        let s = &self.sensing;
        writeln!(f, "noise of one sample: torque {} N m, gyro {} rad/s", num(s.torque_nm), num(s.gyro_rad_per_s))?;
        exactness(f, self)?;
        parameters(f, self)?;
        let names = self.parameters.iter().map(|p| p.name.chars().count());
        budget(f, &self.budget, names.max().unwrap_or(8))?;
        if !self.modes.is_empty() {
            writeln!(f, "\nmodes at the start pose, and who sees them")?;
            writeln!(
                f,
                "  peak, record: signal over noise of the largest sample, and of the whole record; ringing: amplitude of free"
            )?;
            writeln!(f, "  ringing (rad, m) that would equal the noise of one sample")?;
            writeln!(f, "  {:62}  {:>9}  {:>9}  {:>9}", "", "peak", "record", "ringing")?;
            self.modes.iter().try_for_each(|m| mode(f, m))?;
        }
        excursion(f, self)?;
        spectrum(f, self)?;
        limits(f, self)?;
        rigid(f, self)
    }
}

/// Four significant digits, in exponent form when very large or small.
fn num(x: f64) -> String {
    significant(x, 4)
}

/// What the deviations allow for, and what they do not.
fn exactness(f: &mut fmt::Formatter<'_>, p: &Preflight) -> fmt::Result {
    if !p.uncertain.is_empty() {
        let n = p.uncertain.len();
        writeln!(f, "deviations allow for {n} quantities that the mission is not sure of")?;
    }
    next_step(&p.budget).into_iter().chain(harmful(&p.taken_as_exact)).try_for_each(|line| writeln!(f, "{line}"))
}

fn parameters(f: &mut fmt::Formatter<'_>, p: &Preflight) -> fmt::Result {
    let n = p.parameters.len();
    writeln!(
        f,
        "\npredicted standard deviations ({n} parameters, {} biases and initial states beside them)",
        p.nuisance.len()
    )?;
    let all: Vec<&Predicted> = p.parameters.iter().chain(&p.derived).collect();
    let w = all.iter().map(|x| x.name.chars().count()).max().unwrap_or(8);
    for x in all {
        write!(f, "  {:w$} {:>12} {:8}", x.name, num(x.value), x.unit)?;
        match (x.std, x.relative_std) {
            (Some(s), Some(r)) => write!(f, " +- {:>10}  {:>8.3} %", num(s), 100.0 * r)?,
            _ => write!(f, " cannot be told")?,
        }
        writeln!(f, "{}", if x.told == Determination::Weakly { "  weak" } else { "" })?;
    }
    writeln!(
        f,
        "  weak: above {} % of the parameter (for moments of a body: of its mass and radius)",
        num(100.0 * p.weak_above)
    )?;
    writeln!(f, "  {} of {} unknowns determined, condition number {}", p.rank, p.unknowns, num(p.condition))?;
    for d in &p.null_directions {
        writeln!(f, "  silent on: {d}")?;
    }
    for d in &p.weak_directions {
        writeln!(f, "  known worse than its own size: {d}")?;
    }
    Ok(())
}

fn reading(r: &Reading) -> String {
    let word = match r.seen {
        Seen::Plainly => "seen",
        Seen::Buried => "buried, seen over the record",
        Seen::Not => "NOT seen",
    };
    let at_noise = r.ringing_at_noise.map_or("never".into(), num);
    let [peak, record] = [r.peak_over_noise, r.record_snr].map(num);
    format!("{word:27}  {peak:>9}  {record:>9}  {at_noise:>9}")
}

fn mode(f: &mut fmt::Formatter<'_>, m: &ModeVisibility) -> fmt::Result {
    let name = format!("{:.4} Hz, damping {:.2} %", m.frequency_hz, 100.0 * m.damping_ratio);
    writeln!(f, "  {name:25} torques  {}", reading(&m.torque))?;
    writeln!(f, "  {:25} gyro     {}", "", reading(&m.gyro))
}

fn excursion(f: &mut fmt::Formatter<'_>, p: &Preflight) -> fmt::Result {
    let e = &p.excursion;
    writeln!(f, "\nexcursions of the simulated system")?;
    for x in [&e.attitude, &e.rate, &e.displacement].into_iter().chain(&e.end_effector_speed) {
        writeln!(f, "  {} at most {} {} (at {:.2} s)", x.name, num(x.value), x.unit, x.time_s)?;
    }
    writeln!(f, "  base attitude at the end {} rad", num(e.final_attitude_rad))?;
    let list = |all: &[super::Peak]| {
        all.iter().map(|x| format!("{} {} {}", x.name, num(x.value), x.unit)).collect::<Vec<_>>().join(", ")
    };
    writeln!(f, "  torques at most: {}", list(&e.torques))?;
    if !e.passive.is_empty() {
        writeln!(f, "  deflections at most: {}", list(&e.passive))?;
    }
    Ok(())
}

fn spectrum(f: &mut fmt::Formatter<'_>, p: &Preflight) -> fmt::Result {
    let s = &p.spectrum;
    let Some((low, high)) = s.band_hz else { return Ok(()) };
    writeln!(f, "\nexcitation at the modes (resolution {} Hz)", num(s.resolution_hz))?;
    for m in &s.modes {
        writeln!(
            f,
            "  {:.4} Hz: joints {} rad^2/s^4/Hz, base {} rad^2/s^4/Hz and {} m^2/s^4/Hz, rate left {} 1/s",
            m.frequency_hz,
            num(m.joints),
            num(m.base_angular),
            num(m.base_linear),
            num(m.left_swinging)
        )?;
    }
    let share = if s.total > 0.0 { 10.0 * (s.in_band / s.total).log10() } else { f64::NEG_INFINITY };
    writeln!(
        f,
        "  joint accelerations in {:.3} .. {:.3} Hz: {} of {} rad^2/s^4 ({share:.1} dB)",
        low,
        high,
        num(s.in_band),
        num(s.total)
    )
}

fn limits(f: &mut fmt::Formatter<'_>, p: &Preflight) -> fmt::Result {
    let mut all: Vec<&LimitMargin> = p.limits.iter().collect();
    all.sort_by(|a, b| a.relative().total_cmp(&b.relative()));
    let broken = all.iter().filter(|m| !m.holds).count();
    match (p.limits_hold, all.len()) {
        (_, 0) => return writeln!(f, "\nno limits are given"),
        (true, n) => writeln!(f, "\nall {n} limits are kept; the closest:")?,
        (false, n) => writeln!(f, "\n{broken} of {n} limits are BROKEN:")?,
    }
    for m in all.iter().take(CLOSEST.max(broken)) {
        let proof = if m.proof == Proof::AllTime { "for all time" } else { "at the samples" };
        let mark = if m.holds { "" } else { "BROKEN " };
        writeln!(
            f,
            "  {mark}{} of {}: {} of {} {}, margin {} ({proof}, about {:.2} s)",
            m.what,
            m.item,
            num(m.bound),
            num(m.limit),
            m.unit,
            num(m.margin),
            m.time_s
        )?;
    }
    Ok(())
}

fn rigid(f: &mut fmt::Formatter<'_>, p: &Preflight) -> fmt::Result {
    let Some(b) = &p.rigid_bias else { return Ok(()) };
    writeln!(f, "\na rigid identification of the base on this trajectory (linearised bias from flexibility)")?;
    let w = b.parameters.iter().map(|x| x.name.chars().count()).max().unwrap_or(8);
    for x in &b.parameters {
        write!(f, "  {:w$} {:>12} {:8}", x.name, num(x.value), x.unit)?;
        match (x.bias, x.std) {
            (Some(bias), Some(std)) => writeln!(f, " bias {:>10}, std {}", num(bias), num(std))?,
            _ => writeln!(f, " cannot be told")?,
        }
    }
    writeln!(
        f,
        "  worst bias {} % of the parameter; flexibility makes {} times the noise in the torques (rms)",
        num(100.0 * b.worst_relative),
        num(b.torque_rms_over_noise)
    )
}
