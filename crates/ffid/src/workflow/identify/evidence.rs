//! Whether a record speaks for the model or against it, and what would explain it, as part of the result.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Name of the error that is a mode which the mission lacks.
pub(super) const EXTRA_MODE: &str = "extra-mode";
/// Name of the error that is a robot with other parameters, before the label of a record.
pub(super) const OTHER_ROBOT: &str = "other-robot";
/// Deviations of one component of an error from which it is seen.
const SEEN: f64 = 4.0;

/// What the record says of the model as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// Nothing in the record speaks against it.
    Explained,
    /// Something does, and more than chance would.
    Contradicted,
    /// Nothing was tested.
    #[default]
    NotTested,
}

impl State {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Explained => "explained",
            Self::Contradicted => "contradicted",
            Self::NotTested => "not tested",
        }
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.words())
    }
}

/// The evidence for and against the model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evidence {
    /// What it comes to.
    pub state: State,
    /// Why, in one line.
    pub reason: String,
    /// How often a right model would be contradicted by all tests together.
    pub false_alarms: f64,
    /// Errors that were tried.
    pub tried: usize,
    /// Independent tests that these are worth; absent in results of older versions.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub independent: Option<f64>,
    /// Part of chi-squared above its expectation that the errors which explain the record together account for.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub explained: Option<f64>,
    /// Part of the squared residuals that is noise of the encoders, by simulation.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub motion_noise: Option<f64>,
    /// What the record would say of the model with the first of the errors below estimated: absent where that was not fitted.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub with_first: Option<State>,
    /// Frequency (Hz) below which alone torques and base rates were compared; absent where all of them were.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub below_hz: Option<f64>,
    /// Errors that the record speaks for: first those that explain it together, then others that would explain part of it alone.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub named: Vec<NamedError>,
    /// What of units, axes and signs of the record may be why the model does not explain it, in words.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub columns: Vec<String>,
}

/// Part of the squared residuals from which noise of the encoders is said beside that of the other sensors.
pub(super) const HEARD: f64 = 0.01;

impl Evidence {
    /// Mean squared residual that is noise of the encoders, where that is a hundredth of that of the other sensors at least; zero else.
    pub fn encoder_noise(&self) -> f64 {
        self.motion_noise.filter(|&m| m > HEARD).unwrap_or(0.0)
    }
    /// Errors with which fits end, each with those that explain the record beside it; `None` where no fit was made with the first. Allocates.
    pub fn refitted(&self) -> Option<String> {
        let mut out = String::new();
        self.named.first().filter(|n| n.refitted)?;
        for n in self.named.iter().filter(|n| n.refitted) {
            let link = if n.beside { " beside " } else { ", or " };
            out += if out.is_empty() { "" } else { link };
            out += &n.text;
        }
        Some(out)
    }
    /// The columns that may be why the record is not explained, in a sentence: to be looked at before anything is estimated. Allocates.
    pub fn in_doubt(&self) -> Option<String> {
        let all = self.columns.join("; ");
        (!all.is_empty()).then(|| format!("Columns of the record are in doubt, which is to be looked at first: {all}."))
    }
    /// What to do about the errors that explain the record, as the next step of a message; `None` where none is named. Allocates.
    pub fn remedy(&self) -> Option<String> {
        let first = self.named.first()?;
        if first.is_another_robot() {
            return Some("identify the records apart, and compare what they say".to_owned());
        }
        if first.name == EXTRA_MODE {
            let such = if first.mission.is_empty() { "" } else { ", such as the one in the report," };
            return Some(format!("add an [[appendage]] of that frequency to the mission{such} and estimate it"));
        }
        let together =
            self.named.iter().enumerate().filter(|(k, n)| *k == 0 || n.beside && n.refitted && first.refitted);
        let names: Vec<&str> = together.map(|(_, n)| n.name.as_str()).collect();
        Some(format!("measure that, or estimate it: --adopt {}", names.join(",")))
    }
}

/// What a small error of something that is taken as exact would do to the estimates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Harm {
    /// The error, as `--adopt` takes it.
    pub name: String,
    /// Its size, in words: `1 %`, `1 mm`, `1 mrad`.
    pub size: String,
    /// The parameter that would be wrong by most of its deviations.
    pub moves: String,
    /// By how many.
    pub moves_by: f64,
}

/// An error that the record speaks for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedError {
    /// Its name, as `--adopt` takes it.
    pub name: String,
    /// In words, with its size.
    pub text: String,
    /// Its components.
    pub size: Vec<ErrorSize>,
    /// By how much chi-squared falls with it.
    pub drop: f64,
    /// Number of components.
    pub freedom: usize,
    /// How often such a drop would be met were nothing wrong.
    pub p: f64,
    /// The estimate that moves most with it.
    pub moves: String,
    /// By how many of its standard deviations.
    pub moves_by: f64,
    /// Whether it adds to those before it; else it is taken by itself.
    pub beside: bool,
    /// Errors whose effect on this record is nearly the same.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub alike: Vec<String>,
    /// Whether size, fall of chi-squared and what moves are those of a fit that estimates it; else those of a score test, to first order.
    #[serde(skip_serializing_if = "is_false", default)]
    pub refitted: bool,
    /// What to add to the mission to have it in the model, as TOML; empty for an error that `--adopt` takes.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub mission: String,
}

fn is_false(x: &bool) -> bool {
    !*x
}

impl NamedError {
    /// As a fit with it among the unknowns has found it: its size, by how much chi-squared falls, and what moves most, by how many deviations.
    pub(super) fn fitted(name: String, text: String, size: Vec<ErrorSize>, drop: f64, moves: (String, f64)) -> Self {
        let (freedom, (moves, moves_by)) = (size.len(), moves);
        let (p, beside, alike, mission) = (0.0, false, Vec::new(), String::new());
        Self { name, text, size, drop, freedom, p, moves, moves_by, beside, alike, refitted: true, mission }
    }
    /// Whether it is of parameters that are others in a record.
    pub(super) fn is_another_robot(&self) -> bool {
        self.name.starts_with(OTHER_ROBOT)
    }
    /// Whether a component is more than four deviations from none.
    pub(super) fn is_seen(&self) -> bool {
        self.size.iter().any(|c| c.value.abs() > SEEN * c.std)
    }
}

/// A component of an error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorSize {
    /// What tells it from the others; empty where there is one.
    pub name: String,
    /// SI unit; `1` is relative.
    pub unit: String,
    /// Its size.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str, refitted: bool, beside: bool) -> NamedError {
        NamedError {
            name: name.into(),
            text: format!("an error of {name}"),
            size: Vec::new(),
            drop: 412.0,
            freedom: 1,
            p: 1e-9,
            moves: "base.mass".into(),
            moves_by: 3.4,
            beside,
            alike: Vec::new(),
            refitted,
            mission: String::new(),
        }
    }

    #[test]
    fn what_explains_the_record_together_is_estimated_together() {
        let of = |named: Vec<NamedError>| Evidence { named, ..Evidence::default() };
        let both = of(vec![named("mass.wing", true, false), named("parameters.tank", true, true)]);
        assert_eq!(both.refitted().unwrap(), "an error of mass.wing beside an error of parameters.tank");
        assert_eq!(both.remedy().unwrap(), "measure that, or estimate it: --adopt mass.wing,parameters.tank");
        let either = of(vec![named("mass.wing", true, false), named("parameters.tank", true, false)]);
        assert_eq!(either.refitted().unwrap(), "an error of mass.wing, or an error of parameters.tank");
        assert_eq!(either.remedy().unwrap(), "measure that, or estimate it: --adopt mass.wing");
        // What no fit was made with is an indication.
        let first_order = of(vec![named("mass.wing", false, false), named("parameters.tank", false, true)]);
        assert_eq!(first_order.refitted(), None);
        assert!(first_order.remedy().unwrap().ends_with("--adopt mass.wing"));
        let apart = of(vec![named("other-robot.b", true, false)]).remedy().unwrap();
        assert!(apart.contains("apart") && !apart.contains("--adopt"), "{apart}");
        assert_eq!(of(Vec::new()).remedy(), None);
        assert_eq!(of(Vec::new()).in_doubt(), None);
        let swapped = Evidence { columns: vec!["q.j6: swapped".into(), "gyro: turned".into()], ..Evidence::default() };
        assert!(swapped.in_doubt().unwrap().ends_with("first: q.j6: swapped; gyro: turned."));
    }
}
