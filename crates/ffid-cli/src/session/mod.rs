//! The commands for programs that hold missions, records and trajectories in memory: the same options, checks and results as the
//! command line, without its files. The Python package is built on it.
//!
//! Options are given as on the command line (`["--held-out", "0.3", "--reduce"]`) and read by the same parser, so that both know the
//! same ones; [`options`] lists them.

mod identification;
mod judged;
mod motion;
mod options;
mod record;

pub use identification::{Identification, identify, load_result};
pub use judged::{Diagnosed, Planning, Validation, doctor, plan_excitation, preflight, validate};
pub use motion::Motion;
pub use options::{CommandOption, options};
pub use record::{Given, given, read_columns, read_record};

use crate::results::Refusal;
use ff_model::Problems;
use ffid::exit::Exit;

/// Why a command has no result.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// The code that the command would end with.
    pub exit: Exit,
    /// What is wrong; at least one error.
    pub problems: Problems,
}

impl From<Refusal> for Refused {
    fn from((exit, problems): Refusal) -> Self {
        Self { exit, problems }
    }
}

impl From<Problems> for Refused {
    fn from(problems: Problems) -> Self {
        Self { exit: Exit::of(&problems), problems }
    }
}
