//! Trials of a study: each has random numbers of its own, is kept in a file when it is done, and need not be done again.
//!
//! A trial is known by the study, its version, the seed of the study, the part of the study and a number. What it draws depends on
//! these alone ([`Trial::rng`]): on no trial before it, no thread and no order. So a study can stop at any time and go on later, and
//! its figures are those of an uninterrupted run.
//!
//! The file has one JSON object per line: `{"study", "version", "seed", "quick", "build", "part", "trial", "seconds", "result"}`. A line
//! is written in one piece when its trial ends; an interruption loses the trials that are running. A last line without its line
//! feed is what an interruption left, and is cut off. `build` are the first digits of the SHA-256 of the program: a file that was
//! begun by another build can be continued, and the table of the study says so.

use super::options::Options;
use crate::workspace;
use anyhow::Context;
use ffid::exit::Failure;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::{Mutex, OnceLock};
use std::time::Instant;

/// Why a file of trials is refused.
#[derive(Debug, thiserror::Error)]
pub enum TrialsError {
    /// The trials of the file were drawn otherwise.
    #[error(
        "{}:{line}: trial of {key} {found}, but this run has {key} {wanted}; give another --out, or leave out --resume to begin anew",
        path.display()
    )]
    Incompatible {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// What differs: `study`, `version`, `seed` or `quick`.
        key: &'static str,
        /// The value in the file.
        found: String,
        /// The value of this run.
        wanted: String,
    },
    /// A line within the file is not a trial.
    #[error("{}:{line}: not a trial: {reason}; remove the line, or leave out --resume to begin anew", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// What the JSON reader says.
        reason: String,
    },
}

/// A number as a trial keeps it: JSON has no infinities and no NaN, so these are text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number(pub f64);

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() { s.serialize_f64(self.0) } else { s.serialize_str(&self.0.to_string()) }
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        match Value::deserialize(d)? {
            Value::String(text) => text.parse().map(Self).map_err(serde::de::Error::custom),
            value => value.as_f64().map(Self).ok_or_else(|| serde::de::Error::custom(format!("{value} is no number"))),
        }
    }
}

/// Which trial is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trial {
    /// Seed of the study.
    pub seed: u64,
    /// Number of the trial within its part.
    pub number: u64,
}

impl Trial {
    /// The random numbers of this trial: ChaCha8 with the seed of the study as key and the number of the trial as stream. Parts of a
    /// study share them, as common random numbers.
    pub fn rng(&self) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(self.number);
        rng
    }
    /// `1000 seed + number`, for functions that take a seed and make streams of their own from it (ChaCha8 with this key). Unlike from
    /// study seed to study seed while there are at most a thousand trials.
    pub fn own_seed(&self) -> u64 {
        self.seed.wrapping_mul(1000).wrapping_add(self.number)
    }
}

/// A line of the file; `R` is the result.
#[derive(Serialize, Deserialize)]
struct Line<R> {
    study: String,
    version: u32,
    seed: u64,
    quick: bool,
    build: String,
    part: String,
    trial: u64,
    seconds: f64,
    result: R,
}

/// The trials of one run of a study.
#[derive(Debug)]
pub struct Trials {
    study: &'static str,
    version: u32,
    seed: u64,
    quick: bool,
    build: String,
    path: PathBuf,
    /// Locked as a file as long as this lives.
    file: Mutex<File>,
    /// Results that were in the file, by part and number.
    kept: BTreeMap<(String, u64), Value>,
    /// How many of them another build computed.
    foreign: usize,
}

impl Trials {
    /// Opens the file of a study: `--out`, or `target/study/<study>-<seed>.jsonl` (`-quick` with `--quick`) in the workspace. With
    /// `--resume`, the trials in it count as done; without, they are moved to a file with the ending `.old`.
    ///
    /// `version` is that of the trials: it is raised whenever their draws or the shape of their results change.
    ///
    /// # Errors
    /// [`TrialsError`] (exit code 22) for a file of other trials, [`Failure::Locked`] (21) while another run writes to it,
    /// [`Failure::Io`] (20).
    pub fn open(study: &'static str, version: u32, options: &Options) -> anyhow::Result<Self> {
        let path = match &options.out {
            Some(path) => path.clone(),
            None => {
                let quick = if options.quick { "-quick" } else { "" };
                workspace::root()?.join("target/study").join(format!("{study}-{}{quick}.jsonl", options.seed))
            }
        };
        let fail = |action, e| Failure::io(action, &path, e);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|e| fail("create the folder of", e))?;
        }
        let open = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        let mut file = open.map_err(|e| fail("open", e))?;
        file.try_lock().map_err(|e| match e {
            TryLockError::WouldBlock => Failure::Locked { path: path.clone(), by: format!("study {study}") },
            TryLockError::Error(e) => fail("lock", e),
        })?;
        let mut trials = Self {
            study,
            version,
            seed: options.seed,
            quick: options.quick,
            build: build(),
            path: path.clone(),
            file: Mutex::new(file.try_clone().map_err(|e| fail("open", e))?),
            kept: BTreeMap::new(),
            foreign: 0,
        };
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(|e| fail("read", e))?;
        let whole = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
        if options.resume {
            trials.read(&bytes[..whole])?;
            if whole < bytes.len() {
                eprintln!("{}: the last trial was not written to its end; it is run again", path.display());
            }
            file.set_len(whole as u64).map_err(|e| fail("cut", e))?;
        } else if !bytes.is_empty() {
            let mut old = path.clone().into_os_string();
            old.push(".old");
            let old = PathBuf::from(old);
            std::fs::copy(&path, &old).map_err(|e| Failure::io("write", &old, e))?;
            file.set_len(0).map_err(|e| fail("empty", e))?;
        }
        file.seek(SeekFrom::End(0)).map_err(|e| fail("write to", e))?;
        Ok(trials)
    }

    /// Takes the trials of whole lines as done.
    fn read(&mut self, bytes: &[u8]) -> Result<(), TrialsError> {
        for (k, bytes) in bytes.split(|b| *b == b'\n').enumerate().filter(|(_, bytes)| !bytes.is_empty()) {
            let (path, line) = (self.path.clone(), k + 1);
            let l: Line<Value> = match serde_json::from_slice(bytes) {
                Ok(l) => l,
                Err(e) => return Err(TrialsError::Damaged { path, line, reason: e.to_string() }),
            };
            for (key, found, wanted) in [
                ("study", l.study, self.study.to_owned()),
                ("version", l.version.to_string(), self.version.to_string()),
                ("seed", l.seed.to_string(), self.seed.to_string()),
                ("quick", l.quick.to_string(), self.quick.to_string()),
            ] {
                if found != wanted {
                    return Err(TrialsError::Incompatible { path, line, key, found, wanted });
                }
            }
            self.foreign += usize::from(l.build != self.build);
            self.kept.insert((l.part, l.trial), l.result);
        }
        Ok(())
    }

    /// Results of these trials of a part, in their order. What is not in the file is run, on all cores, and written to it.
    ///
    /// # Errors
    /// The first error of a trial that fails (those that are done stay in the file), [`Failure::Io`].
    pub fn run<R: Serialize + DeserializeOwned + Send>(
        &self,
        part: &str,
        numbers: impl IntoIterator<Item = u64>,
        one: impl Fn(Trial) -> anyhow::Result<R> + Sync,
    ) -> anyhow::Result<Vec<R>> {
        let numbers: Vec<u64> = numbers.into_iter().collect();
        numbers.into_par_iter().map(|number| self.trial(part, number, &one)).collect()
    }

    /// A part that is not divided: one trial, on this thread.
    ///
    /// # Errors
    /// That of the trial, [`Failure::Io`].
    pub fn once<R: Serialize + DeserializeOwned>(
        &self,
        part: &str,
        one: impl FnOnce() -> anyhow::Result<R>,
    ) -> anyhow::Result<R> {
        self.trial(part, 0, |_| one())
    }

    fn trial<R: Serialize + DeserializeOwned>(
        &self,
        part: &str,
        number: u64,
        one: impl FnOnce(Trial) -> anyhow::Result<R>,
    ) -> anyhow::Result<R> {
        let what = || format!("study {}, part {part}, trial {number}", self.study);
        if let Some(kept) = self.kept.get(&(part.to_owned(), number)) {
            return R::deserialize(kept).with_context(|| format!("{}: {}", self.path.display(), what()));
        }
        let begun = Instant::now();
        let result = one(Trial { seed: self.seed, number })?;
        // Through JSON in any case, so that a run in one go and one in two give the same bits, and a result that does not read back is
        // known at once.
        let result = serde_json::to_value(result).with_context(what)?;
        self.append(part, number, begun.elapsed().as_secs_f64(), &result)?;
        R::deserialize(&result).with_context(what)
    }

    fn append(&self, part: &str, trial: u64, seconds: f64, result: &Value) -> anyhow::Result<()> {
        let line = Line {
            study: self.study.to_owned(),
            version: self.version,
            seed: self.seed,
            quick: self.quick,
            build: self.build.clone(),
            part: part.to_owned(),
            trial,
            seconds,
            result,
        };
        let mut text = serde_json::to_vec(&line)?;
        text.push(b'\n');
        // A thread that panicked while it held the file has at most torn its own line, which is the last.
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        Ok(file.write_all(&text).map_err(|e| Failure::io("write to", &self.path, e))?)
    }

    /// How many trials were in the file, in words; nothing without any.
    pub fn note(&self) -> Option<String> {
        let n = self.kept.len();
        let other = match self.foreign {
            0 => String::new(),
            k => format!(", {k} of them computed by another build of this program"),
        };
        (n > 0).then(|| format!("{n} trials were read from {}{other}", self.path.display()))
    }
}

/// The first digits of the SHA-256 of this program; `unknown` where it cannot be read.
fn build() -> String {
    static BUILD: OnceLock<String> = OnceLock::new();
    let read = || {
        let hash = std::env::current_exe().and_then(std::fs::read).map(|bytes| Sha256::digest(&bytes));
        hash.map_or_else(|_| "unknown".to_owned(), |h| h.iter().take(6).map(|b| format!("{b:02x}")).collect())
    };
    BUILD.get_or_init(read).clone()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exit::code_of;
    use rand::RngExt;
    use std::path::Path;
    use std::sync::atomic::{AtomicU64, Ordering};

    fn options(path: &Path, seed: u64, resume: bool) -> Options {
        Options { out: Some(path.to_owned()), seed, resume, ..Options::default() }
    }

    /// Draws of eight trials, and how many were run for them.
    fn draws(path: &Path, seed: u64, resume: bool) -> anyhow::Result<(Vec<f64>, u64)> {
        let trials = Trials::open("sample", 3, &options(path, seed, resume))?;
        let run = AtomicU64::new(0);
        let all = trials.run("a", 0..8, |t| {
            run.fetch_add(1, Ordering::Relaxed);
            Ok(t.rng().random::<f64>())
        })?;
        Ok((all, run.into_inner()))
    }

    #[test]
    fn a_trial_draws_the_same_whatever_was_run_before() {
        let t = |seed, number| Trial { seed, number }.rng().random::<u64>();
        assert_eq!(t(7, 3), t(7, 3));
        assert!(t(7, 3) != t(7, 4) && t(7, 3) != t(8, 3));
        let dir = tempfile::tempdir().unwrap();
        let trials = Trials::open("sample", 3, &options(&dir.path().join("t.jsonl"), 7, false)).unwrap();
        let draw = |t: Trial| Ok(t.rng().random::<u64>());
        assert_eq!(trials.run("a", [5, 3], draw).unwrap(), [t(7, 5), t(7, 3)]);
        assert_eq!(Trial { seed: 2, number: 17 }.own_seed(), 2017);
    }

    /// Cut at every byte: what is whole is kept, the torn line is run again, and the figures are the same.
    #[test]
    fn a_cut_file_is_continued_to_the_same_results() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.jsonl");
        let (first, run) = draws(&path, 7, false).unwrap();
        assert_eq!(run, 8);
        let whole = std::fs::read(&path).unwrap();
        let lines = |bytes: &[u8]| bytes.iter().filter(|b| **b == b'\n').count() as u64;
        for cut in (0..=whole.len()).step_by(7) {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let (again, run) = draws(&path, 7, true).unwrap();
            assert_eq!((again, run), (first.clone(), 8 - lines(&whole[..cut])), "cut at {cut}");
            assert_eq!(lines(&std::fs::read(&path).unwrap()), 8);
        }
    }

    #[test]
    fn a_failing_trial_loses_itself_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.jsonl");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let fails = |t: Trial| if t.number == 5 { anyhow::bail!("trial five") } else { Ok(t.number) };
        let trials = Trials::open("sample", 3, &options(&path, 7, false)).unwrap();
        assert!(pool.install(|| trials.run("a", 0..6, fails)).unwrap_err().to_string().contains("five"));
        drop(trials);
        let trials = Trials::open("sample", 3, &options(&path, 7, true)).unwrap();
        assert_eq!(trials.kept.len(), 5);
        assert!(trials.note().unwrap().starts_with("5 trials were read from"));
        assert_eq!(trials.run("a", 0..6, |t| Ok(100 + t.number)).unwrap(), [0, 1, 2, 3, 4, 105]);
        // Another part has trials of its own.
        assert_eq!(trials.run("b", 0..1, |t| Ok(200 + t.number)).unwrap(), [200]);
    }

    #[test]
    fn trials_of_another_seed_version_or_study_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.jsonl");
        draws(&path, 7, false).unwrap();
        let before = std::fs::read(&path).unwrap();
        let refused = |study, version, options: Options| {
            let e = Trials::open(study, version, &options).unwrap_err();
            assert_eq!(code_of(&e), 22, "{e}");
            match e.downcast::<TrialsError>().unwrap() {
                TrialsError::Incompatible { line, key, found, wanted, .. } => (line, key, found, wanted),
                e => panic!("{e}"),
            }
        };
        let of = |key, found: &str, wanted: &str| (1, key, found.to_owned(), wanted.to_owned());
        assert_eq!(refused("sample", 3, options(&path, 8, true)), of("seed", "7", "8"));
        assert_eq!(refused("sample", 4, options(&path, 7, true)), of("version", "3", "4"));
        assert_eq!(refused("other", 3, options(&path, 7, true)), of("study", "sample", "other"));
        let quick = Options { quick: true, ..options(&path, 7, true) };
        assert_eq!(refused("sample", 3, quick), of("quick", "false", "true"));
        assert_eq!(std::fs::read(&path).unwrap(), before);
    }

    #[test]
    fn a_line_that_is_no_trial_is_refused_by_its_number() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.jsonl");
        draws(&path, 7, false).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let damaged: Vec<&str> = text.lines().enumerate().map(|(k, l)| if k == 2 { &l[..20] } else { l }).collect();
        std::fs::write(&path, damaged.join("\n") + "\n").unwrap();
        let e = draws(&path, 7, true).unwrap_err();
        assert!(matches!(e.downcast_ref(), Some(TrialsError::Damaged { line: 3, .. })), "{e}");
        assert_eq!(code_of(&e), 22);
    }

    #[test]
    fn two_runs_do_not_write_to_one_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.jsonl");
        let held = Trials::open("sample", 3, &options(&path, 7, false)).unwrap();
        assert_eq!(code_of(&draws(&path, 7, true).unwrap_err()), 21);
        drop(held);
        draws(&path, 7, true).unwrap();
    }

    #[test]
    fn beginning_anew_keeps_the_old_file_beside() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.jsonl");
        draws(&path, 7, false).unwrap();
        let first = std::fs::read(&path).unwrap();
        let (_, run) = draws(&path, 8, false).unwrap();
        assert_eq!(run, 8);
        assert_eq!(std::fs::read(dir.path().join("t.jsonl.old")).unwrap(), first);
    }

    #[test]
    fn results_keep_every_bit() {
        let all = [1.0 / 3.0, -0.0, 5e-324, f64::MAX, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
        let text = serde_json::to_string(&all.map(Number)).unwrap();
        let back: Vec<Number> = serde_json::from_str(&text).unwrap();
        assert!(all.iter().zip(&back).all(|(a, b)| a.to_bits() == b.0.to_bits() || (a.is_nan() && b.0.is_nan())));
        // A number that JSON would make a null of is not accepted in silence.
        let dir = tempfile::tempdir().unwrap();
        let trials = Trials::open("sample", 3, &options(&dir.path().join("t.jsonl"), 7, false)).unwrap();
        assert!(trials.once("a", || Ok(f64::NAN)).is_err());
    }
}
