//! From a mission and records to parameters: the steps of `ffid identify`.
//!
//! ```text
//! run::identify           one fit
//!   Unknowns              parameters, ties, priors, start
//!   drives                channels on the motor's side: friction, reflected inertia, gains of currents
//!   RecordEstimator       Rda | OutputError for each record -> Several -> Tied -> estimate | best_of
//!   suspects              errors that keep the fit from any answer; in_motion, missing_mode: a start or an appendage that the mission lacks
//!   ends, lost            whether the end of a fit explains the record, and what it has lost on its way
//!   elsewhere, valleys    other starts where the fit ended in a wrong valley, minima beside its end
//!   places                readings beside kinks of the motion that alone contradict the end
//!   band                  records whose joints move as their encoders do not tell, compared where they do
//!   orders                springs of an appendage in the wrong order, where tests contradict the end
//!   bends                 valleys that are no parabola within the deviations
//!   known                 reduction, structural and unexcited directions, profiles of the likelihood, whiteness
//!   explain, refit        tests of errors, and fits with the leading ones where the model is contradicted
//!   Report                estimates and findings into an IdentificationResult
//! checked::identify_checked   fits and record checks in turn (ident::checks): axes, start at rest, clocks, momentum, free decay
//! sample_posterior        draws from the posterior around the last fit
//! predict_held_out        prediction of data that were not fitted
//! judge_held_out          the same, judged by the tests of a fit
//! compare_variants        rigid, flexible, sloshing or both
//! result, findings        what `result.json` holds
//! text                    the same in words
//! ```
pub(crate) mod adoption;
mod assembly;
pub mod axes;
mod band;
pub(crate) mod bandwidth;
mod bends;
pub(crate) mod checked;
mod chord;
pub(crate) mod clocks;
pub(crate) mod compare;
mod compliances;
mod consider;
mod course;
pub(crate) mod decay;
mod drawn_anew;
pub mod draws;
mod drives;
mod elsewhere;
mod encoder_noise;
mod ends;
mod error;
pub(crate) mod evidence;
pub(crate) mod explain;
mod extra_mode;
pub(crate) mod findings;
mod fitted;
pub(crate) mod ground;
mod ground_uncertain;
pub(crate) mod held_out;
pub(crate) mod identified;
mod in_motion;
mod kept_records;
pub(crate) mod known;
pub(crate) mod labelled_record;
mod lost;
mod missing_mode;
mod mission_end;
mod mixture;
pub mod model_files;
mod mounted_mode;
mod noise_floor;
pub(in crate::workflow) mod number;
pub(crate) mod observed_estimator;
pub(crate) mod options;
mod orders;
mod over_time;
mod places;
pub(crate) mod record_estimator;
mod refit;
pub(crate) mod report;
pub(crate) mod result;
pub(in crate::workflow) mod ringing;
mod row_layout;
pub(crate) mod run;
pub(crate) mod sampled;
pub(crate) mod segments;
pub(crate) mod settings;
pub(crate) mod signals;
mod survey;
mod suspect_starts;
mod suspects;
pub(crate) mod text;
pub(crate) mod ties;
pub(crate) mod uncertain;
mod unknowns;
mod unresolved;
mod valleys;

pub use adoption::adopted_sensor_errors;
pub use bandwidth::{Bandwidth, NoBandwidth, choose_low_pass};
pub use checked::identify_checked;
pub use compare::{Comparison, compare_variants};
pub use course::{Course, CoursePoint};
pub(in crate::workflow) use drives::behind_gears;
pub use drives::joint_torques;
pub use error::IdentifyError;
pub use evidence::{ErrorSize, Evidence, Harm, NamedError, State};
pub use findings::{
    Alternative, CandidateLine, ClockLine, ComparisonTable, DecayMode, DecayModes, DeterminedCombination, Minima,
    PriorConflict, ProfileLine, RecordFit, ReducedSet, UnobservedDirections, UnseenMode, Whiteness,
};
pub use ground::{Arm, LOW_PASS};
pub use held_out::{Known, judge_held_out, of_model, predict_held_out};
pub use ident::checks::{ClockPolicy, ModelVariant, RecordChecks};
pub use identified::Identified;
pub use kept_records::{KeptRecord, MOST_SAMPLES, keep, read_kept};
pub use labelled_record::LabelledRecord;
pub use number::num;
pub use observed_estimator::{Interim, Observer, RecordCheck};
pub use options::{Absent, FitOptions};
pub use record_estimator::RecordEstimator;
pub(in crate::workflow) use record_estimator::sigmas;
pub(in crate::workflow) use result::uncertain::budget as variance_budget;
pub use result::{
    Better, BodyLine, BodyQuantity, BudgetLine, BudgetShare, Channel, Combination, Correlation, Covariance,
    DescentStep, Ended, FORMAT, HeldOut, IdentificationResult, InputFile, Method, ModeLine, Parameter,
    ParameterVerdict, PrincipalAxis, Provenance, RecordLine, STRONG, Sampled, SampledLine, SampledState, UncertainLine,
    VERSION, Value, Warning, held_errors,
};
pub use run::identify;
pub use sampled::sample_posterior;
pub use segments::{Segments, on_even_clock, segments};
pub use settings::{EXPLAINED, Settings, method};
pub use signals::Signals;
pub(in crate::workflow) use text::budget;
pub use text::{harmful, next_step, verdict};
pub use ties::TieSpec;
pub(in crate::workflow) use uncertain::UncertainUnknown;
pub use uncertain::{DeclaredUncertain, DeclaredUnknown, UncertainItems, UncertainKind};
