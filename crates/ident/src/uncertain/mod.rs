//! What may be wrong beside the parameters, and what of it would explain a record.

pub(crate) mod hypotheses;
pub(crate) mod motion_noise;
pub(crate) mod multiplicity;
pub(crate) mod oscillator;
pub(crate) mod point_mass;
pub(crate) mod ranking;
pub(crate) mod score;
pub(crate) mod source;

pub use hypotheses::{Component, Hypothesis, hypotheses, with_every_column};
pub use motion_noise::{NormalEquations, covariance_of_motion_noise};
pub use oscillator::{ELEMENTS, Oscillator, OscillatorColumn, Shape, effective_inertia, elements};
pub use point_mass::PointMass;
pub use ranking::{ALIKE, LEVEL, Layout, MATTERS, Named, Ranking};
pub use score::{Combination, Direction, EndOfFit, Score, Scores, Searched, evidence};
pub use source::{ErrorSource, WalkPart};
