//! What every study takes.

use ff_model::{Area, Problem, Problems};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// What every study takes.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Options {
    /// Also write figures, limits and verdict to this file as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Seed of all randomness
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub seed: u64,
    /// Fewer samples and shorter searches: shows that everything runs; limits that need the whole are left out
    #[arg(long)]
    pub quick: bool,
    /// Only these parts of the study; its documentation names them. A number means a case of every part, where parts have cases
    #[arg(long, value_name = "PART")]
    pub only: Vec<String>,
    /// File of the trials, one JSON object per line [default: target/study/`STUDY`-`SEED`.jsonl, with -quick before the dot]
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Continue an interrupted run: trials in the file count as done
    #[arg(long)]
    pub resume: bool,
    /// Parts that the study has asked for.
    #[arg(skip)]
    pub(super) known: Arc<Mutex<BTreeSet<String>>>,
}

impl Options {
    /// Whether a part is to be run. Numbers name cases, not parts.
    pub fn wants(&self, part: &str) -> bool {
        self.know(part);
        let mut named = self.only.iter().filter(|p| p.parse::<u64>().is_err()).peekable();
        named.peek().is_none() || named.any(|p| p == part)
    }
    /// Whether a part that is left out by default is to be run.
    pub fn lists(&self, part: &str) -> bool {
        self.know(part);
        self.only.iter().any(|p| p == part)
    }
    fn know(&self, part: &str) {
        self.known.lock().unwrap_or_else(PoisonError::into_inner).insert(part.to_owned());
    }
    /// Refuses parts that the study, which has ended, does not have: nothing was run for them.
    ///
    /// # Errors
    /// The first such part.
    pub fn all_known(&self) -> Result<(), Problems> {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let unknown = self.only.iter().find(|p| p.parse::<u64>().is_err() && !known.contains(*p));
        let Some(part) = unknown else { return Ok(()) };
        let parts: Vec<&str> = known.iter().map(String::as_str).collect();
        let hint = if parts.is_empty() { "leave it out: the study has no parts".into() } else { parts.join(", ") };
        let what = format!("the study has no part {part:?}");
        Err(Problems(vec![Problem::error(Area::Config, "Config::Part", what).on("--only").hint(hint)]))
    }
    /// Numbers of the cases that are wanted; none where all are.
    pub fn cases(&self) -> Vec<u64> {
        self.only.iter().filter_map(|p| p.parse().ok()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_cases_of_every_part() {
        let only =
            |parts: &[&str]| Options { only: parts.iter().map(|&p| p.to_owned()).collect(), ..Options::default() };
        assert!(only(&[]).wants("noisy") && only(&["1025"]).wants("noisy") && only(&["noisy", "1025"]).wants("noisy"));
        assert!(!only(&["noisy", "1025"]).wants("exact") && !only(&["exact"]).wants("noisy"));
    }

    #[test]
    fn a_part_that_no_study_has_is_refused() {
        let o = Options { only: vec!["nosy".into(), "7".into()], ..Options::default() };
        assert!(!o.wants("noisy") && !o.lists("prior"));
        let said = o.all_known().unwrap_err().to_string();
        assert!(said.contains("\"nosy\"") && said.contains("noisy, prior"), "{said}");
        let o = Options { only: vec!["prior".into()], ..Options::default() };
        assert!(o.lists("prior") && o.all_known().is_ok());
    }
}
