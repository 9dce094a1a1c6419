//! What a diagnosis holds.

use crate::exit::Exit;
use ff_model::diagnostics::Severity;
use ff_model::{Problem, Problems};
use serde::Serialize;

pub(super) const NOTHING_MOVES: &str = "Data::NothingMoves";

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Topic {
    /// Samples that are missing or late.
    Gaps,
    /// Whether the joints move.
    Excitation,
    /// Units of the channels.
    Units,
    /// Axes of the gyro, columns of joints.
    Axes,
    /// Signs of channels.
    Signs,
    /// Sensors that are dead, at the end of their range or slower than the record, and what reading warned of.
    Sensors,
    /// Whether the record begins at rest.
    Rest,
    /// Noise and steps of the readings.
    Noise,
    /// Clocks of torques and gyro.
    Clocks,
    /// Modes of the free decay.
    Modes,
    /// The values of the mission against the record.
    Prior,
}

impl Topic {
    /// As in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gaps => "gaps",
            Self::Excitation => "excitation",
            Self::Units => "units",
            Self::Axes => "axes",
            Self::Signs => "signs",
            Self::Sensors => "sensors",
            Self::Rest => "rest",
            Self::Noise => "noise",
            Self::Clocks => "clocks",
            Self::Modes => "modes",
            Self::Prior => "prior",
        }
    }
}

/// What a finding comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Judgement {
    /// As it should be, or not to be told from this record.
    Good,
    /// A fit can be made; its result has to be taken with care.
    Suspicious,
    /// A fit is of no use before this is put right.
    Wrong,
}

impl Judgement {
    /// As in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Suspicious => "suspicious",
            Self::Wrong => "wrong",
        }
    }
}

/// One finding on one record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Label of the record.
    pub record: String,
    /// What it is about.
    pub topic: Topic,
    /// The channel, such as `tau.joint3`; none for all of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<String>,
    /// What it comes to.
    pub judgement: Judgement,
    /// The figure that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured: Option<f64>,
    /// What it should be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<f64>,
    /// Unit of both; empty for ratios.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// The same in a sentence.
    pub text: String,
    /// The problem that it gives rise to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem: Option<Problem>,
}

impl Finding {
    /// On all channels of the record of this label.
    pub(super) fn new(label: &str, topic: Topic, judgement: Judgement, text: impl Into<String>) -> Self {
        Self {
            record: label.to_owned(),
            topic,
            channel: None,
            judgement,
            measured: None,
            expected: None,
            unit: String::new(),
            text: text.into(),
            problem: None,
        }
    }
    pub(super) fn on(mut self, channel: impl Into<String>) -> Self {
        self.channel = Some(channel.into());
        self
    }
    /// Measured figure, expected figure and their unit.
    pub(super) fn figures(mut self, measured: f64, expected: f64, unit: &str) -> Self {
        (self.measured, self.expected, self.unit) = (Some(measured), Some(expected), unit.to_owned());
        self
    }
    pub(super) fn raising(mut self, p: Problem) -> Self {
        self.problem = Some(p);
        self
    }
}

/// Findings on records, before a fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Name of the robot.
    pub robot: String,
    /// The worst judgement.
    pub judgement: Judgement,
    /// By record, in the order of [`Topic`].
    pub findings: Vec<Finding>,
}

impl Diagnosis {
    pub(super) fn new(robot: &str, mut findings: Vec<Finding>) -> Self {
        // Stable, and by record first: records come one after the other.
        let mut order: Vec<String> = Vec::new();
        for f in &findings {
            if !order.contains(&f.record) {
                order.push(f.record.clone());
            }
        }
        findings.sort_by_key(|f| (order.iter().position(|r| *r == f.record), f.topic));
        let judgement = findings.iter().map(|f| f.judgement).max().unwrap_or(Judgement::Good);
        Self { robot: robot.to_owned(), judgement, findings }
    }
    /// The problems that the findings give rise to.
    pub fn problems(&self) -> Problems {
        Problems(self.findings.iter().filter_map(|f| f.problem.clone()).collect())
    }
    /// The exit code for `problems` of a diagnosis, after some were allowed: 13 where nothing moves, else that of the first error.
    pub fn exit(problems: &Problems) -> Exit {
        let first = problems.0.iter().find(|p| p.severity == Severity::Error);
        match first {
            Some(p) if p.code == NOTHING_MOVES => Exit::IllPosed,
            _ => Exit::of(problems),
        }
    }
}
