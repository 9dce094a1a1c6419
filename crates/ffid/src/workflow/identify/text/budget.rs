//! What is not known exactly as text: what it is known to now, and the variance that it leaves.

use crate::workflow::identify::number::num;
use crate::workflow::identify::result::uncertain::{BudgetLine, UncertainLine};
use std::fmt;

/// Part of a variance from which it is listed.
const SEEN: f64 = 0.005;
/// Part of a prior deviation below which a record has told something.
const LEARNT: f64 = 0.8;
/// Uncertain quantities that are listed.
const MOST_UNCERTAIN: usize = 20;

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
pub(super) fn uncertain(f: &mut fmt::Formatter<'_>, all: &[UncertainLine]) -> fmt::Result {
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
