//! Figures of a study and their limits.

use super::options::Options;
use super::trials::{Number, Trials};
use crate::table::{Table, sig};
use ffid::exit::Failure;
use ffid::files::json;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How a figure is held to its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Op {
    /// Not above.
    #[serde(rename = "<=")]
    AtMost,
    /// Not below.
    #[serde(rename = ">=")]
    AtLeast,
}

impl Op {
    fn holds(self, figure: f64, limit: f64) -> bool {
        // A figure that is not a number holds no limit.
        match self {
            Self::AtMost => figure <= limit,
            Self::AtLeast => figure >= limit,
        }
    }
    fn text(self) -> &'static str {
        match self {
            Self::AtMost => "<=",
            Self::AtLeast => ">=",
        }
    }
}

/// What a part of a study adds to it, as its trial keeps it.
#[derive(Serialize, Deserialize)]
struct Part {
    figures: Vec<Figure>,
    notes: Vec<String>,
}

/// A figure of a part.
#[derive(Serialize, Deserialize)]
struct Figure {
    name: String,
    unit: String,
    value: Number,
    limit: Option<(Op, f64)>,
}

/// Figures of one study, with limits on some of them.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    study: &'static str,
    seed: u64,
    figures: BTreeMap<String, f64>,
    limits: BTreeMap<String, (Op, f64)>,
    pass: bool,
    #[serde(skip)]
    lines: Vec<(String, String)>,
    #[serde(skip)]
    notes: Vec<String>,
}

impl Study {
    /// Without figures.
    pub fn new(study: &'static str, seed: u64) -> Self {
        let (figures, limits) = (BTreeMap::new(), BTreeMap::new());
        Self { study, seed, figures, limits, pass: true, lines: Vec::new(), notes: Vec::new() }
    }
    /// A figure without a limit.
    pub fn figure(&mut self, name: impl Into<String>, unit: &str, value: f64) {
        let name = name.into();
        eprintln!("{name} = {} {unit}", sig(value, 4));
        self.add(name, unit, value, None);
    }
    fn add(&mut self, name: String, unit: &str, value: f64, limit: Option<(Op, f64)>) {
        self.figures.insert(name.clone(), value);
        if let Some((op, limit)) = limit {
            self.pass &= op.holds(value, limit);
            self.limits.insert(name.clone(), (op, limit));
        }
        self.lines.push((name, unit.to_owned()));
    }
    /// A figure with a limit.
    pub fn limited(&mut self, name: impl Into<String>, unit: &str, value: f64, op: Op, limit: f64) {
        let name = name.into();
        eprintln!("{name} = {} {unit}", sig(value, 4));
        self.add(name, unit, value, Some((op, limit)));
    }
    /// A limit that holds for the whole study only: with `quick`, a figure.
    pub fn judged(&mut self, quick: bool, name: impl Into<String>, unit: &str, value: f64, (op, limit): (Op, f64)) {
        if quick {
            self.figure(name, unit, value);
        } else {
            self.limited(name, unit, value, op, limit);
        }
    }
    /// A line below the table.
    pub fn note(&mut self, text: impl Into<String>) {
        self.notes.push(text.into());
    }
    /// A part that is not divided into trials: what `fill` adds, kept as one trial.
    ///
    /// # Errors
    /// Those of `fill` and of [`Trials::once`].
    pub fn part(
        &mut self,
        trials: &Trials,
        name: &str,
        fill: impl FnOnce(&mut Self) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let part = trials.once(name, || {
            let mut s = Self::new(self.study, self.seed);
            fill(&mut s)?;
            let figures = s.lines.into_iter().map(|(name, unit)| {
                let value = s.figures.get(&name).copied().unwrap_or(f64::NAN);
                let limit = s.limits.get(&name).copied();
                Figure { name, unit, value: Number(value), limit }
            });
            Ok(Part { figures: figures.collect(), notes: s.notes })
        })?;
        for f in part.figures {
            self.add(f.name, &f.unit, f.value.0, f.limit);
        }
        self.notes.extend(part.notes);
        Ok(())
    }
    /// Value of a figure.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.figures.get(name).copied()
    }
    /// True while every limit holds.
    pub fn pass(&self) -> bool {
        self.pass
    }
    /// Figures that are outside their limits, in words.
    pub fn faults(&self) -> Vec<String> {
        let outside = |(name, (op, limit)): (&String, &(Op, f64))| {
            let value = self.figures.get(name).copied().unwrap_or(f64::NAN);
            (!op.holds(value, *limit)).then(|| format!("{name} is {}, limit {} {limit}", sig(value, 4), op.text()))
        };
        self.limits.iter().filter_map(outside).collect()
    }
    /// Figures with limits and verdicts, in the order in which they were found.
    pub fn table(&self) -> Table {
        let mut t = Table::new(
            format!("Study '{}', seed {}", self.study, self.seed),
            &["figure", "unit", "value", "limit", "verdict"],
        )
        .left(2);
        for (name, unit) in &self.lines {
            let value = self.figures.get(name).copied().unwrap_or(f64::NAN);
            let limit = self.limits.get(name);
            t.row([
                name.clone(),
                unit.clone(),
                sig(value, 4),
                limit.map_or(String::new(), |(op, l)| format!("{} {l}", op.text())),
                limit.map_or("", |(op, l)| if op.holds(value, *l) { "pass" } else { "FAIL" }).to_owned(),
            ]);
        }
        for n in &self.notes {
            t.note(n.clone());
        }
        t
    }
    /// Prints the table, writes the JSON if asked.
    ///
    /// # Errors
    /// [`Failure::Tolerance`] (exit code 15) when a limit fails, with everything printed and written before;
    /// [`Failure::NotFinite`], [`Failure::Io`].
    pub fn finish(&self, options: &Options) -> Result<(), Failure> {
        println!("{}", self.table());
        if let Some(path) = &options.json {
            json::write(path, self)?;
        }
        match self.faults() {
            f if f.is_empty() => Ok(()),
            f => Err(Failure::Tolerance(f.join("; "))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_and_verdict_follow_the_limits() {
        let dir = tempfile::tempdir().unwrap();
        let options = Options { json: Some(dir.path().join("s.json")), seed: 7, quick: true, ..Options::default() };
        let mut s = Study::new("sample", 7);
        s.figure("plain", "m", 1.25);
        s.limited("low", "dB", 40.0, Op::AtLeast, 40.0);
        assert!(s.finish(&options).is_ok());
        s.limited("high", "s", 31.0, Op::AtMost, 30.0);
        let e = s.finish(&options).unwrap_err();
        assert!(matches!(&e, Failure::Tolerance(t) if t.contains("high is 31.00, limit <= 30")), "{e}");
        let text = std::fs::read_to_string(dir.path().join("s.json")).unwrap();
        let v: serde_json::Value = serde_json::from_str(&text).unwrap();
        let want = serde_json::json!({
            "study": "sample", "seed": 7, "pass": false,
            "figures": {"plain": 1.25, "low": 40.0, "high": 31.0},
            "limits": {"low": [">=", 40.0], "high": ["<=", 30.0]},
        });
        assert_eq!(v, want);
        let table = s.table().to_string();
        assert!(table.contains("FAIL") && table.contains("pass") && !s.pass());
    }

    /// An undivided part gives the same table and the same JSON whether it is run or read.
    #[test]
    fn a_part_that_was_kept_adds_the_same() {
        let dir = tempfile::tempdir().unwrap();
        let out = Some(dir.path().join("t.jsonl"));
        let of = |resume: bool, run: bool| {
            let options = Options { out: out.clone(), seed: 7, resume, ..Options::default() };
            let trials = Trials::open("sample", 1, &options).unwrap();
            let mut s = Study::new("sample", 7);
            s.figure("before", "", 0.3);
            let fill = |s: &mut Study| {
                assert!(run, "the part is in the file");
                s.limited("low", "dB", 1.0 / 3.0, Op::AtLeast, 40.0);
                s.figure("lost", "m", f64::INFINITY);
                s.note("a line");
                Ok(())
            };
            s.part(&trials, "a", fill).unwrap();
            (s.table().to_string(), s.faults(), s.pass())
        };
        let first = of(false, true);
        assert!(!first.2 && first.0.contains("a line") && first.0.contains("dB"));
        assert_eq!(of(true, false), first);
    }

    #[test]
    fn a_figure_that_is_not_a_number_fails() {
        let mut s = Study::new("sample", 1);
        s.limited("lost", "", f64::NAN, Op::AtMost, 1.0);
        assert!(!s.pass() && s.faults().len() == 1);
    }
}
