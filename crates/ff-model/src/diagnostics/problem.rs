//! What is wrong with an input, said so that the reader can mend it.
//!
//! Readers collect every [`Problem`] before they refuse; a refused input is a [`Problems`] value, which
//! prints one line per problem and knows the exit code the command line must return.

use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

/// How bad a problem is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The input is refused.
    Error,
    /// Work goes on; the warning is recorded with the result.
    Warning,
}

/// Which kind of input a problem is in; decides the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Area {
    /// Robot model (URDF): exit code 10.
    Model,
    /// Mission file or settings: exit code 11.
    Config,
    /// Record or other data: exit code 12.
    Data,
    /// Reading or writing files: exit code 20.
    Io,
}

impl Area {
    /// The process exit code of `bad-inputs.md` for a refusal in this area.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Model => 10,
            Self::Config => 11,
            Self::Data => 12,
            Self::Io => 20,
        }
    }
}

/// One thing that is wrong: what, where, value, limit, unit, and one next step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Problem {
    /// Stable name of the kind of problem, such as `Urdf::Cycle` or `Config::UnknownKey`.
    pub code: &'static str,
    /// Error or warning.
    pub severity: Severity,
    /// Kind of input.
    pub area: Area,
    /// The file, when there is one.
    pub file: Option<PathBuf>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// Column in the line, from 1.
    pub column: Option<usize>,
    /// The object concerned: a link, joint, key or parameter name.
    pub object: Option<String>,
    /// What is wrong, with value, limit and unit.
    pub message: String,
    /// One next step.
    pub hint: Option<String>,
}

impl Problem {
    /// An error.
    pub fn error(area: Area, code: &'static str, message: impl Into<String>) -> Self {
        Self {
            code,
            severity: Severity::Error,
            area,
            file: None,
            line: None,
            column: None,
            object: None,
            message: message.into(),
            hint: None,
        }
    }
    /// A warning.
    pub fn warning(area: Area, code: &'static str, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(area, code, message) }
    }
    /// Adds the file.
    #[must_use]
    pub fn in_file(mut self, file: impl Into<PathBuf>) -> Self {
        self.file = Some(file.into());
        self
    }
    /// Adds the line (from 1).
    #[must_use]
    pub fn at_line(mut self, line: usize) -> Self {
        self.line = Some(line);
        self
    }
    /// Adds line and column (both from 1).
    #[must_use]
    pub fn at(mut self, line: usize, column: usize) -> Self {
        self.line = Some(line);
        self.column = Some(column);
        self
    }
    /// Adds the name of the object concerned.
    #[must_use]
    pub fn on(mut self, object: impl Into<String>) -> Self {
        self.object = Some(object.into());
        self
    }
    /// Adds the next step.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}:", file.display())?;
            if let Some(l) = self.line {
                write!(f, "{l}:")?;
                if let Some(c) = self.column {
                    write!(f, "{c}:")?;
                }
            }
            write!(f, " ")?;
        }
        let sev = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        write!(f, "{sev}[{}]", self.code)?;
        if let Some(o) = &self.object {
            write!(f, " {o}")?;
        }
        write!(f, ": {}", self.message)?;
        if let Some(h) = &self.hint {
            write!(f, "; {h}")?;
        }
        Ok(())
    }
}

/// All problems of an input that was refused. Holds at least one error.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct Problems(pub Vec<Problem>);

impl Problems {
    /// Adds a problem.
    pub fn push(&mut self, p: Problem) {
        self.0.push(p);
    }
    /// Adds all of another list.
    pub fn extend(&mut self, o: Self) {
        self.0.extend(o.0);
    }
    /// Names the file in every problem that names none.
    #[must_use]
    pub fn in_file(mut self, file: impl AsRef<Path>) -> Self {
        for p in &mut self.0 {
            p.file.get_or_insert_with(|| file.as_ref().to_path_buf());
        }
        self
    }
    /// True when any entry is an error.
    pub fn has_errors(&self) -> bool {
        self.0.iter().any(|p| p.severity == Severity::Error)
    }
    /// The exit code: that of the first error (0 without one).
    pub fn exit_code(&self) -> u8 {
        self.0.iter().find(|p| p.severity == Severity::Error).map_or(0, |p| p.area.exit_code())
    }
    /// True when a problem with this code is present.
    pub fn has(&self, code: &str) -> bool {
        self.0.iter().any(|p| p.code == code)
    }
    /// `Ok((value, warnings))` without errors, else all problems.
    ///
    /// # Errors
    /// Itself, when it holds an error.
    pub fn finish<V>(mut self, value: Option<V>) -> Result<(V, Self), Self> {
        match value {
            Some(v) if !self.has_errors() => Ok((v, self)),
            Some(_) => Err(self),
            None => {
                // A refusal without an error would end with exit code 0. No reader should get here.
                if !self.has_errors() {
                    let what = "refused, but no reader said why";
                    self.push(Problem::error(Area::Config, "Internal::NoReason", what).hint("please report this file"));
                }
                Err(self)
            }
        }
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, p) in self.0.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{p}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_always_has_an_error_and_a_code() {
        let warning = Problems(vec![Problem::warning(Area::Model, "Urdf::NoInertial", "w")]);
        let refused = warning.clone().finish::<()>(None).unwrap_err();
        assert!(refused.has("Internal::NoReason") && refused.exit_code() == 11);
        assert_eq!(warning.clone().finish(Some(1)).unwrap(), (1, warning));
    }
}
