//! Why nothing was planned.

use crate::exit::Exit;
use ff_model::{Area, Problem, Problems};

/// Why there is no plan: a problem, and the code to end with.
#[derive(Debug, thiserror::Error)]
#[error("{problem}")]
pub struct ExciteError {
    /// What is wrong.
    pub problem: Box<Problem>,
    /// 11 for settings, 13 for demands that contradict each other, 14 for failed computations, 130 when interrupted.
    pub exit: Exit,
}

impl ExciteError {
    pub(super) fn new(exit: Exit, code: &'static str, what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { problem: Box::new(Problem::error(Area::Config, code, what).hint(hint)), exit }
    }
    pub(super) fn on(mut self, object: impl Into<String>) -> Self {
        *self.problem = self.problem.on(object);
        self
    }
}

impl From<ExciteError> for Problems {
    fn from(e: ExciteError) -> Self {
        Self(vec![*e.problem])
    }
}
