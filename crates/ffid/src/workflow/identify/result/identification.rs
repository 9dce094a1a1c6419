//! A whole identification: `result.json`. Every number reads back exactly.

use super::body::BodyLine;
use super::channel::{Channel, ModeLine};
use super::fit::{DescentStep, Ended, Method};
use super::held_out::HeldOut;
use super::parameter::{Combination, Correlation, Covariance, Parameter, Value};
use super::provenance::{Provenance, Warning};
use super::sampled::Sampled;
use super::uncertain::{BudgetLine, UncertainLine};
use crate::workflow::identify::course::Course;
use crate::workflow::identify::evidence::{Evidence, Harm, State};
use crate::workflow::identify::findings::{
    ClockLine, ComparisonTable, DecayModes, Minima, PriorConflict, ProfileLine, RecordFit, ReducedSet,
    UnobservedDirections, Whiteness,
};
use crate::workflow::identify::kept_records::KeptRecord;
use ident::Posterior;
use serde::{Deserialize, Serialize};

/// What the field `format` of a result must say.
pub const FORMAT: &str = "ffid-result";
/// Version that is written, and the only one that is read.
pub const VERSION: u32 = 1;

/// A whole identification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdentificationResult {
    /// [`FORMAT`].
    pub format: String,
    /// [`VERSION`].
    pub version: u32,
    /// Name of the robot.
    pub robot: String,
    /// How the record was predicted.
    pub method: Method,
    /// In words: what was found, and what was not.
    pub verdict: Vec<String>,
    /// What the record says of the model as a whole; absent in results of older versions.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub evidence: Option<Evidence>,
    /// How the fit ended.
    pub status: Ended,
    /// Linearisations used.
    pub iterations: usize,
    /// Those that led to the estimates, in order, and the estimates themselves; empty for linear fits and in results of older versions.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub descent: Vec<DescentStep>,
    /// Sum of squared whitened residuals over the degrees of freedom; 1 when model and noise figures are right.
    pub chi2_per_dof: f64,
    /// Residuals of the record.
    pub residuals: usize,
    /// The parameters asked for.
    pub parameters: Vec<Parameter>,
    /// Biases and initial state, estimated beside them.
    pub nuisance: Vec<Parameter>,
    /// Every parameter of the model with the estimates in place, in the order of the parameter vector.
    pub model: Vec<Value>,
    /// Numerical rank of the scaled sensitivities of the data alone.
    pub rank: usize,
    /// Their singular values, descending.
    pub singular_values: Vec<f64>,
    /// Combinations on which the record is silent, in the names of the parameters.
    pub null_directions: Vec<Combination>,
    /// Combinations that the record tells to worse than their own size, weakest first.
    pub weak_directions: Vec<Combination>,
    /// True when every combination on which the record is silent is held by a prior.
    pub priors_cover: bool,
    /// The combinations on which the record is silent, told apart: by structure, or because it excites too little.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub silent: Option<UnobservedDirections>,
    /// What was estimated in place of what was asked for, because the record is silent on the rest.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub reduced: Option<ReducedSet>,
    /// Priors that the data contradict, the worst first.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub prior_conflicts: Vec<PriorConflict>,
    /// Mass, centre of mass, inertia about it and principal axes of every body of which something was estimated.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub bodies: Vec<BodyLine>,
    /// What the mission is not sure of, before and after; the parameters are known whatever it is.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub uncertain: Vec<UncertainLine>,
    /// What changes: parameters from record to record, biases that walk within one.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub over_time: Vec<Course>,
    /// Where the variance of every parameter comes from, where something is uncertain.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub budget: Vec<BudgetLine>,
    /// What the mission is not sure of and the method does not allow for: it was taken as exact.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub not_allowed_for: Vec<String>,
    /// Where nothing is: what small errors of what is taken as exact would do, the most harmful first.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub taken_as_exact: Vec<Harm>,
    /// Intervals from the likelihood itself.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub profiles: Vec<ProfileLine>,
    /// What draws from the posterior say.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub sampled: Option<Sampled>,
    /// Where other starts led.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub minima: Option<Minima>,
    /// Pairs with a correlation of 0.95 or more.
    pub correlations: Vec<Correlation>,
    /// Covariance of parameters and nuisance, priors included.
    pub covariance: Covariance,
    /// What is known of the parameters, biases and initial state projected out: the prior of a later identification.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub posterior: Option<Posterior>,
    /// Residuals of every channel against white noise.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub whiteness: Vec<Whiteness>,
    /// Modes of the identified model at the mission's pose, joints held.
    pub modes: Vec<ModeLine>,
    /// Modes of the free decay in the records.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub decay: Vec<DecayModes>,
    /// Clocks of the channels against that of the encoders.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub clocks: Vec<ClockLine>,
    /// Models against each other.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub comparison: Option<ComparisonTable>,
    /// Every record, when there are several.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub records: Vec<RecordFit>,
    /// The records themselves, as files of the folder, for a later identification.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub kept_records: Vec<KeptRecord>,
    /// Every channel over the (first) record.
    pub channels: Vec<Channel>,
    /// The same on data that were not used.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub held_out: Option<HeldOut>,
    /// What was put up with.
    pub warnings: Vec<Warning>,
    /// Where all this comes from.
    pub provenance: Provenance,
}

impl IdentificationResult {
    /// Chi-squared per degree of freedom over what noise leaves, that of the encoders among it: 1 when model and noise figures are right.
    pub fn over_noise(&self) -> f64 {
        self.chi2_per_dof / (1.0 + self.evidence.as_ref().map_or(0.0, Evidence::encoder_noise))
    }
    /// Without any finding.
    pub(in crate::workflow::identify) fn empty(robot: &str, method: Method, provenance: Provenance) -> Self {
        Self {
            format: FORMAT.into(),
            version: VERSION,
            robot: robot.to_owned(),
            method,
            verdict: Vec::new(),
            evidence: None,
            status: Ended::Converged,
            iterations: 0,
            descent: Vec::new(),
            chi2_per_dof: 0.0,
            residuals: 0,
            parameters: Vec::new(),
            nuisance: Vec::new(),
            model: Vec::new(),
            rank: 0,
            singular_values: Vec::new(),
            null_directions: Vec::new(),
            weak_directions: Vec::new(),
            priors_cover: false,
            silent: None,
            reduced: None,
            prior_conflicts: Vec::new(),
            uncertain: Vec::new(),
            over_time: Vec::new(),
            budget: Vec::new(),
            not_allowed_for: Vec::new(),
            taken_as_exact: Vec::new(),
            bodies: Vec::new(),
            profiles: Vec::new(),
            sampled: None,
            minima: None,
            correlations: Vec::new(),
            covariance: Covariance { names: Vec::new(), rows: Vec::new() },
            posterior: None,
            kept_records: Vec::new(),
            whiteness: Vec::new(),
            modes: Vec::new(),
            decay: Vec::new(),
            clocks: Vec::new(),
            comparison: None,
            channels: Vec::new(),
            records: Vec::new(),
            held_out: None,
            warnings: Vec::new(),
            provenance,
        }
    }
    /// Setting that has the relative width of a prior about everything.
    pub const PRIOR: &'static str = "prior_relative_std";
    /// Whether the fit had such a prior.
    pub fn had_prior(&self) -> bool {
        self.provenance.settings.get(Self::PRIOR).is_some_and(|p| p != "none")
    }
    /// Puts what is true of a simulated record beside the estimates; parameters that `truth` lacks have none.
    pub fn set_truth(&mut self, truth: &[(String, f64)]) {
        for p in &mut self.parameters {
            p.truth = truth.iter().find(|(name, _)| *name == p.name).map(|t| t.1);
        }
    }
    /// The parameter whose estimate is farthest from the truth, with the distance in its standard deviations. `None` unless the truth is
    /// known.
    pub fn farthest_from_truth(&self) -> Option<(&Parameter, f64)> {
        let all = self.parameters.iter().filter_map(|p| Some((p, p.deviations_off()?)));
        all.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    }
    /// What the record says of the model as a whole.
    pub fn state(&self) -> State {
        self.evidence.as_ref().map(|e| e.state).unwrap_or_default()
    }
    /// The code a command ends with that has found this: 130 for a fit that was interrupted; 16 for a model that the record contradicts, with
    /// or without an end of its fit, for what a wrong model does not see is no property of the record; 14 for no solution, whose null
    /// directions say nothing; 13 for combinations that neither data nor priors tell (unless the set that can be told was asked for); 16 for
    /// held-out data that contradict it; 17 for one that was not tested; else 0. On the ground there is no noise figure to test against: 0,
    /// unless held-out data are missed by more than what the fit left.
    pub fn exit(&self) -> crate::exit::Exit {
        use crate::exit::Exit;
        if self.status.is_interrupted() {
            Exit::Interrupted
        } else if self.state() == State::Contradicted {
            Exit::Contradicted
        } else if !self.status.is_solution() {
            Exit::Numerical
        } else if !self.null_directions.is_empty() && !self.priors_cover && self.reduced.is_none() {
            Exit::IllPosed
        } else {
            match self.state() {
                _ if self.held_out.as_ref().is_some_and(|h| !h.explained) => Exit::Contradicted,
                State::NotTested if self.method != Method::Ground && self.evidence.is_some() => Exit::NotTested,
                _ => Exit::Done,
            }
        }
    }
    /// As JSON text.
    ///
    /// # Errors
    /// [`crate::exit::Failure::NotFinite`] with the place of a number that is not finite.
    pub fn to_json(&self) -> Result<Vec<u8>, crate::exit::Failure> {
        crate::files::json::bytes(std::path::Path::new("result.json"), self)
    }
    /// Reads a text of [`IdentificationResult::to_json`].
    ///
    /// # Errors
    /// What is wrong, with line and column.
    pub fn from_json(text: &[u8]) -> Result<Self, String> {
        let r: Self = serde_json::from_slice(text).map_err(|e| e.to_string())?;
        if r.format != FORMAT || r.version != VERSION {
            return Err(format!("format '{}' version {}, expected {FORMAT} {VERSION}", r.format, r.version));
        }
        Ok(r)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exit::Exit;

    /// What the data do not tell where a fit has stopped says nothing of where it would have ended.
    #[test]
    fn a_fit_that_has_not_ended_says_so_first() {
        let mut r = IdentificationResult::empty("robot", Method::OutputError, Provenance::default());
        r.null_directions = vec![Combination::of(&ident::belief::Direction {
            singular_value: 0.0,
            terms: vec![("base.mass".into(), 1.0)],
            omitted: 0,
        })];
        assert_eq!(r.exit(), Exit::IllPosed);
        r.status = Ended::IterationLimit;
        assert_eq!(r.exit(), Exit::Numerical);
        // With an error the record is followed: no other start would end without it.
        r.evidence = Some(Evidence { state: State::Contradicted, ..Evidence::default() });
        assert_eq!(r.exit(), Exit::Contradicted);
        r.evidence = None;
        r.status = Ended::Interrupted { after: 3 };
        assert_eq!(r.exit(), Exit::Interrupted);
        r.status = Ended::Converged;
        r.priors_cover = true;
        assert_eq!(r.exit(), Exit::Done);
    }
}
