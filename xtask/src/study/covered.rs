//! How many of the 95 % intervals hold the truth, and how many worlds are contradicted.

use super::figures::{Op, Study};
use ffid::exit::Exit;

/// Half the width of a 95 % interval, in deviations.
const WIDTH: f64 = 1.959_963_984_540_054;
/// Limits on the intervals that hold the truth (%).
const LIMITS: (f64, f64) = (93.0, 97.0);

/// Most worlds that may be contradicted (%).
const CONTRADICTED: f64 = 5.0;

/// Per cent; of nothing, none.
pub(super) fn percent(yes: usize, of: usize) -> f64 {
    100.0 * yes as f64 / of.max(1) as f64
}

/// Intervals that hold the truth (%), and the root mean square of the errors, from errors in stated deviations. An estimate without a
/// deviation, whose error is not a number, is not held.
pub(super) fn of(errors: &[f64]) -> (f64, f64) {
    let rms = (errors.iter().map(|z| z * z).sum::<f64>() / errors.len().max(1) as f64).sqrt();
    (percent(errors.iter().filter(|z| z.abs() < WIDTH).count(), errors.len()), rms)
}

impl Study {
    /// Worlds that are contradicted, with a limit unless the study is `quick`, and others that end with an exit code of their own; `ends` has for
    /// each world whether it is contradicted, and its exit code. `before` stands before the names of the figures.
    pub(super) fn contradicted(&mut self, quick: bool, before: &str, ends: impl Iterator<Item = (bool, u8)>) {
        let ends: Vec<(bool, u8)> = ends.collect();
        let share =
            |counts: &dyn Fn(&(bool, u8)) -> bool| percent(ends.iter().filter(|e| counts(e)).count(), ends.len());
        let contradicted = share(&|e| e.0);
        self.judged(quick, format!("{before}contradicted"), "%", contradicted, (Op::AtMost, CONTRADICTED));
        self.figure(format!("{before}other_exit"), "%", share(&|e| !e.0 && e.1 != Exit::Done.code()));
    }
    /// Intervals of a group of estimates that hold the truth, with limits on both sides unless the study is `quick`.
    pub(super) fn covered(&mut self, quick: bool, group: &str, errors: &[f64]) {
        let name = |what: &str| if group.is_empty() { what.to_owned() } else { format!("{group}.{what}") };
        let (held, rms) = of(errors);
        self.judged(quick, name("covered.least"), "%", held, (Op::AtLeast, LIMITS.0));
        self.judged(quick, name("covered.most"), "%", held, (Op::AtMost, LIMITS.1));
        self.figure(name("rms_deviations"), "", rms);
    }
}
