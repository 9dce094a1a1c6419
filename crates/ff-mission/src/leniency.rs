//! What a user chose to put up with: named errors let through as warnings, warnings made to refuse.

use ff_model::diagnostics::{list, nearest};
use ff_model::{Area, Problem, Problems, Severity};

/// Problems that may be allowed: the model can still be built, or the record still be used, and their author may know
/// better.
///
/// Everything else (a cycle, an unknown link, a number that is not one) leaves nothing to work with.
pub const ALLOWABLE: [&str; 11] = [
    "Data::AxisMismatch",
    "Data::LooksLikeDegrees",
    "Data::MaybeTruncated",
    "Data::Saturated",
    "Data::Stuck",
    "Data::TooShort",
    "Data::UnitMismatch",
    "Urdf::InertiaNotPsd",
    "Urdf::Triangle",
    "Urdf::UnknownAttribute",
    "Urdf::UnknownElement",
];

/// The settings behind `--allow CODE` and `--strict`.
///
/// ```
/// use ff_mission::Leniency;
///
/// let leniency = Leniency { allow: vec!["triangle".into(), "mass-less".into()], strict: false };
/// assert!(leniency.allows("Urdf::Triangle"));
/// // The second is not the name of an error that can be let through.
/// assert_eq!(leniency.check().0[0].object.as_deref(), Some("mass-less"));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Leniency {
    /// Codes of errors to report as warnings: `triangle`, `Triangle` or `Urdf::Triangle`.
    pub allow: Vec<String>,
    /// Refuse on warnings too, those allowed by name excepted.
    pub strict: bool,
}

/// Upper and lower case, `-` and `_` do not matter, nor does the part before `::`.
fn plain(code: &str) -> String {
    let last = code.rsplit("::").next().unwrap_or(code);
    last.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect()
}

impl Leniency {
    /// True when problems with this code are let through.
    pub fn allows(&self, code: &str) -> bool {
        ALLOWABLE.contains(&code) && self.allow.iter().any(|a| plain(a) == plain(code))
    }
    /// Names that cannot be allowed, each as an error.
    pub fn check(&self) -> Problems {
        let mut out = Problems::default();
        for a in &self.allow {
            if ALLOWABLE.iter().any(|c| plain(c) == plain(a)) {
                continue;
            }
            let names = ALLOWABLE.map(|c| c.rsplit("::").next().unwrap_or(c));
            let p = Problem::error(Area::Config, "Config::NotAllowable", "no error of this name can be allowed").on(a);
            out.push(match nearest(a, names) {
                Some(n) => p.hint(format!("did you mean {n}?")),
                None => p.hint(format!("those that can: {}", list(names, ALLOWABLE.len()))),
            });
        }
        out
    }
    /// Turns allowed errors into warnings and, when strict, all other warnings into errors.
    pub fn settle(&self, problems: &mut Problems) {
        for p in &mut problems.0 {
            if self.allows(p.code) {
                if p.severity == Severity::Error {
                    p.severity = Severity::Warning;
                    p.message.push_str(" (allowed by the user)");
                }
            } else if self.strict {
                p.severity = Severity::Error;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allowing_and_strictness_change_severity_only_where_named() {
        let l = Leniency { allow: vec!["triangle".into()], strict: true };
        let mut p = Problems(vec![
            Problem::error(Area::Model, "Urdf::Triangle", "t"),
            Problem::warning(Area::Model, "Urdf::NoInertial", "n"),
            Problem::error(Area::Model, "Urdf::Cycle", "c"),
        ]);
        l.settle(&mut p);
        let sev: Vec<_> = p.0.iter().map(|p| p.severity).collect();
        assert_eq!(sev, [Severity::Warning, Severity::Error, Severity::Error]);
        assert!(p.0[0].message.contains("allowed"));
        // Settling twice must not turn an allowed problem back into an error.
        l.settle(&mut p);
        assert_eq!(p.0[0].severity, Severity::Warning);
    }

    #[test]
    fn a_cycle_cannot_be_allowed() {
        let l = Leniency { allow: vec!["cycle".into(), "Triangel".into()], strict: false };
        assert!(!l.allows("Urdf::Cycle"));
        let p = l.check();
        assert_eq!(p.0.len(), 2);
        assert!(p.to_string().contains("did you mean Triangle"), "{p}");
    }
}
