//! Choices of the command line and what they are in the library, which knows no command line.

use clap::ValueEnum;
use ffid::workflow::identify::{ClockPolicy, ModelVariant};
use ident::Loss;

/// Values of `--compare`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Candidate {
    /// Panels and fuel frozen.
    Rigid,
    /// Fuel frozen.
    Flexible,
    /// Panels frozen.
    Slosh,
    /// The mission as it is.
    Both,
}

impl From<Candidate> for ModelVariant {
    fn from(c: Candidate) -> Self {
        match c {
            Candidate::Rigid => Self::Rigid,
            Candidate::Flexible => Self::Flexible,
            Candidate::Slosh => Self::Slosh,
            Candidate::Both => Self::Both,
        }
    }
}

/// Values of `--loss`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum LossFlag {
    /// Least squares: for Gaussian noise.
    #[default]
    Squares,
    /// Linear beyond 1.345 standard deviations: a few wrong samples move little.
    Huber,
    /// Student's distribution with 4 degrees of freedom: wrong samples count next to nothing.
    Student,
}

impl From<LossFlag> for Loss {
    fn from(l: LossFlag) -> Self {
        match l {
            LossFlag::Squares => Self::Squares,
            LossFlag::Huber => Self::HUBER,
            LossFlag::Student => Self::STUDENT,
        }
    }
}

/// Values of `--clocks`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Clocks {
    /// Compare them where the record tells; correct what is off by more than half a sample.
    #[default]
    Correct,
    /// The same, and refuse a record that does not tell.
    Require,
    /// Take them as they are.
    Trust,
}

impl From<Clocks> for ClockPolicy {
    fn from(c: Clocks) -> Self {
        match c {
            Clocks::Correct => Self::Correct,
            Clocks::Require => Self::Require,
            Clocks::Trust => Self::Trust,
        }
    }
}
