//! Unknowns in a result: values, verdicts, combinations, correlations, covariance.

use ff_model::{Model, ParamDecl};
use ident::Uncertainty;
use ident::belief::Direction;
use ident::estimate::report::{Estimate as Line, Verdict};
use serde::{Deserialize, Serialize};

/// Correlation from which a pair is named.
pub const STRONG: f64 = 0.95;

/// One unknown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Where the fit started.
    pub start: f64,
    /// Estimate.
    pub value: f64,
    /// Standard deviation; absent where data and priors cannot tell.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub std: Option<f64>,
    /// Standard deviation that allows for random noise of the colour which the residuals have ([`ident::belief::coloured_covariance`]);
    /// absent where they are white. It holds for a right model alone, as the other does.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub std_coloured: Option<f64>,
    /// 95 % interval.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub interval95: Option<(f64, f64)>,
    /// Mean of its prior.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub prior_mean: Option<f64>,
    /// Standard deviation of its prior.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub prior_std: Option<f64>,
    /// What it was when the record was simulated; absent unless the truth was given.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub truth: Option<f64>,
    /// What the data say.
    pub verdict: ParameterVerdict,
}

impl Parameter {
    pub(in crate::workflow::identify) fn of(l: &Line, prior_mean: Option<f64>) -> Self {
        Self {
            name: l.name.clone(),
            unit: l.unit.clone(),
            start: l.start,
            value: l.value,
            std: l.deviation,
            std_coloured: None,
            interval95: l.interval95,
            prior_mean: prior_mean.filter(|_| l.prior_sigma.is_some()),
            prior_std: l.prior_sigma,
            truth: None,
            verdict: ParameterVerdict::of(l.verdict),
        }
    }
}

impl Parameter {
    /// Distance of the estimate from the truth, in standard deviations; `None` unless both are known.
    pub fn deviations_off(&self) -> Option<f64> {
        let (truth, std) = self.truth.zip(self.std.filter(|s| *s > 0.0))?;
        Some((self.value - truth) / std)
    }
}

/// The verdict on one unknown ([`Verdict`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterVerdict {
    /// Determined by the data.
    Estimated,
    /// Determined to worse than its own size.
    Weak,
    /// The value is that of its prior.
    PriorOnly,
    /// The fit ended with it at a bound.
    AtBound,
    /// Part of a combination on which the data are silent.
    NotIdentifiable,
    /// One of two values, at minima that exchange like elements ([`super::identification::IdentificationResult::exchanges`]).
    NotUnique,
}

impl ParameterVerdict {
    fn of(v: Verdict) -> Self {
        match v {
            Verdict::Estimated => Self::Estimated,
            Verdict::Weak => Self::Weak,
            Verdict::PriorOnly => Self::PriorOnly,
            Verdict::AtBound => Self::AtBound,
            Verdict::NotIdentifiable => Self::NotIdentifiable,
        }
    }
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Estimated => "estimated",
            Self::Weak => "weak",
            Self::PriorOnly => "prior only",
            Self::AtBound => "at a bound",
            Self::NotIdentifiable => "not identifiable",
            Self::NotUnique => "not unique",
        }
    }
}

/// A value of the model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Value {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value.
    pub value: f64,
}

impl Value {
    /// All parameters of a model with these values.
    pub(in crate::workflow::identify) fn all(model: &Model, values: &[f64]) -> Vec<Self> {
        let one = |(d, &value): (&ParamDecl, &f64)| Self { name: d.name.clone(), unit: d.unit.to_owned(), value };
        model.param_decls().iter().zip(values).map(one).collect()
    }
}

/// A combination of parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combination {
    /// Singular value of the scaled sensitivities along it.
    pub singular_value: f64,
    /// Change of each parameter along it, in its own unit, largest relative part first.
    pub terms: Vec<(String, f64)>,
    /// Smaller parts left out.
    pub omitted: usize,
    /// In words.
    pub text: String,
}

impl Combination {
    pub(in crate::workflow::identify) fn of(d: &Direction) -> Self {
        Self { singular_value: d.singular_value, terms: d.terms.clone(), omitted: d.omitted, text: d.to_string() }
    }
}

/// A strong correlation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correlation {
    /// One unknown.
    pub first: String,
    /// The other.
    pub second: String,
    /// Coefficient.
    pub value: f64,
}

impl Correlation {
    /// Every pair from [`STRONG`] on, strongest first.
    pub(in crate::workflow::identify) fn strong(u: &Uncertainty) -> Vec<Self> {
        let pairs = u.strong_correlations(STRONG).into_iter();
        pairs.map(|(first, second, value)| Self { first, second, value }).collect()
    }
}

/// Covariance in the units of the unknowns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Covariance {
    /// Unknowns, in the order of rows and columns.
    pub names: Vec<String>,
    /// Rows.
    pub rows: Vec<Vec<f64>>,
}

impl Covariance {
    pub(in crate::workflow::identify) fn of(u: &Uncertainty) -> Self {
        Self {
            names: u.unknowns.iter().map(|k| k.name.clone()).collect(),
            rows: u.covariance.row_iter().map(|r| r.iter().copied().collect()).collect(),
        }
    }
}
