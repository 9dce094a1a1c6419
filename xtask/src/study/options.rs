//! What every study takes.

use std::path::PathBuf;

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
}

impl Options {
    /// Whether a part is to be run. Numbers name cases, not parts.
    pub fn wants(&self, part: &str) -> bool {
        let mut named = self.only.iter().filter(|p| p.parse::<u64>().is_err()).peekable();
        named.peek().is_none() || named.any(|p| p == part)
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
}
