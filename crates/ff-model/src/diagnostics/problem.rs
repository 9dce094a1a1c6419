//! What is wrong with an input, said so that the reader can mend it.
//!
//! Readers collect every [`Problem`] before they refuse; a refused input is a [`Problems`] value, which
//! prints one line per problem and knows the exit code the command line must return.

use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

/// How bad a problem is.
///
/// ```
/// use ff_model::Area;
/// use ff_model::diagnostics::{Problem, Severity};
///
/// let p = Problem::warning(Area::Data, "Data::Gap", "12 samples lost");
/// assert_eq!((p.severity, p.area.exit_code()), (Severity::Warning, 12));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The input is refused.
    Error,
    /// Work goes on; the warning is recorded with the result.
    Warning,
}

/// Which kind of input a problem is in; decides the exit code.
///
/// ```
/// use ff_model::{Area, Problem, Problems};
///
/// let refused = Problems(vec![Problem::error(Area::Model, "Urdf::Cycle", "links a and b carry each other")]);
/// assert_eq!(refused.exit_code(), Area::Model.exit_code());
/// assert_eq!([Area::Config, Area::Data, Area::Io].map(Area::exit_code), [11, 12, 20]);
/// ```
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

/// What a number may be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// Greater than this.
    Above(f64),
    /// This or greater.
    AtLeast(f64),
    /// Less than this.
    Below(f64),
    /// This or less.
    AtMost(f64),
    /// From the first to the second, both included.
    Within(f64, f64),
}

impl Limit {
    /// True for a number that keeps the limit; never for NaN.
    pub fn admits(self, value: f64) -> bool {
        match self {
            Self::Above(limit) => value > limit,
            Self::AtLeast(limit) => value >= limit,
            Self::Below(limit) => value < limit,
            Self::AtMost(limit) => value <= limit,
            Self::Within(low, high) => (low..=high).contains(&value),
        }
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Above(limit) => write!(f, "> {limit}"),
            Self::AtLeast(limit) => write!(f, ">= {limit}"),
            Self::Below(limit) => write!(f, "< {limit}"),
            Self::AtMost(limit) => write!(f, "<= {limit}"),
            Self::Within(low, high) => write!(f, "{low} to {high}"),
        }
    }
}

/// A number that breaks its limit; prints as `value 0 kg, limit > 0 kg`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Violation {
    /// The number.
    pub value: f64,
    /// What it may be.
    pub limit: Limit,
    /// Unit of both, empty for counts and ratios.
    pub unit: Cow<'static, str>,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { value, limit, unit } = self;
        let space = if unit.is_empty() { "" } else { " " };
        write!(f, "value {value}{space}{unit}, limit {limit}{space}{unit}")
    }
}

/// One thing that is wrong: what, where, value, limit, unit, and one next step.
///
/// ```
/// use ff_model::diagnostics::Limit;
/// use ff_model::{Area, Problem};
///
/// let p = Problem::out_of_range(Area::Config, "Config::OutOfRange", -0.7, Limit::Above(0.0), "Hz")
///     .in_file("probe.toml")
///     .at_line(7)
///     .on("sensors.rate_hz")
///     .hint("give the rate at which the gyro is read");
/// assert_eq!(p.violation.as_ref().map(|v| (v.value, v.limit)), Some((-0.7, Limit::Above(0.0))));
/// assert!(p.to_string().starts_with("probe.toml:7"), "{p}");
/// ```
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
    /// The number that breaks a limit, for programs; `message` says the same in words. None where no single number does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub violation: Option<Violation>,
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
            violation: None,
            hint: None,
        }
    }
    /// An error: `value` breaks its limit. The message is `value {value} {unit}, limit {limit} {unit}`.
    pub fn out_of_range(
        area: Area,
        code: &'static str,
        value: f64,
        limit: Limit,
        unit: impl Into<Cow<'static, str>>,
    ) -> Self {
        let violation = Violation { value, limit, unit: unit.into() };
        let message = violation.to_string();
        Self { violation: Some(violation), ..Self::error(area, code, message) }
    }
    /// An error: a file of a format that is newer than the newest which this program knows.
    pub fn newer_format(area: Area, code: &'static str, found: u64, newest: u64) -> Self {
        Self::error(area, code, format!("format version {found}, this program reads versions up to {newest}"))
            .violating(found as f64, Limit::AtMost(newest as f64), "")
            .hint("use a newer version of this program, or write the file in an older format")
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
    /// Adds the number that breaks a limit; the message is to say it, too.
    #[must_use]
    pub fn violating(mut self, value: f64, limit: Limit, unit: impl Into<Cow<'static, str>>) -> Self {
        self.violation = Some(Violation { value, limit, unit: unit.into() });
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
///
/// ```
/// use ff_model::{Area, Problem, Problems};
///
/// let mut found = Problems::default();
/// found.push(Problem::warning(Area::Model, "Urdf::NoInertial", "link 'tool' has no mass"));
/// assert!(!found.has_errors());
/// found.push(Problem::error(Area::Data, "Data::Gap", "12 samples lost"));
/// assert_eq!((found.exit_code(), found.has("Data::Gap")), (12, true));
/// ```
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
    fn a_number_out_of_its_limits_is_said_in_words_and_kept_for_programs() {
        let p = Problem::out_of_range(Area::Config, "Config::OutOfRange", -0.7, Limit::AtLeast(0.0), "N m/rad");
        assert_eq!(p.message, "value -0.7 N m/rad, limit >= 0 N m/rad");
        let v = p.violation.unwrap();
        assert_eq!((v.value, v.limit, v.unit.as_ref()), (-0.7, Limit::AtLeast(0.0), "N m/rad"));
        let p = Problem::out_of_range(Area::Config, "Config::OutOfRange", 53.0, Limit::Within(1.0, 52.0), "");
        assert_eq!(p.message, "value 53, limit 1 to 52");
        let limits =
            [Limit::Above(2.0), Limit::AtLeast(2.0), Limit::Below(2.0), Limit::AtMost(2.0), Limit::Within(2.0, 3.0)];
        assert_eq!(limits.map(|l| l.admits(2.0)), [false, true, false, true, true]);
        assert!(limits.iter().all(|l| !l.admits(f64::NAN)));
    }

    #[test]
    fn a_refusal_always_has_an_error_and_a_code() {
        let warning = Problems(vec![Problem::warning(Area::Model, "Urdf::NoInertial", "w")]);
        let refused = warning.clone().finish::<()>(None).unwrap_err();
        assert!(refused.has("Internal::NoReason") && refused.exit_code() == 11);
        assert_eq!(warning.clone().finish(Some(1)).unwrap(), (1, warning));
    }
}
