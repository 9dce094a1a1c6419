//! `[[changes]]`: what is another from one record to the next.

use super::declared::{Holds, Key, key, must};
use super::reader::{Table, error};
use super::select::fits;
use ff_model::Model;
use ff_model::diagnostics::{clip, list, nearest};
use serde::Serialize;

/// One `[[changes]]`: parameters that make a random step from one record to the next, each by itself: fuel that is burnt, a tank that is
/// filled, a hinge that ages.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Changes {
    /// `parameters`: names or patterns, in which `*` stands for any text.
    pub parameters: Vec<String>,
    /// `step_std`: standard deviation of a step, in the unit of each.
    pub step_std: Option<f64>,
    /// `step_relative_std`: the same relative to their values.
    pub step_relative_std: Option<f64>,
    /// `step_mean`: what a step is expected to be, in the unit of each; none unless given.
    pub step_mean: f64,
}

/// Keys of `[[changes]]`.
pub(crate) const CHANGES: &[Key] = &[
    must("parameters", Holds::Texts, "parameters that change from record to record, by name or pattern"),
    key(
        "step_std",
        Holds::Positive,
        "standard deviation of the change from one record to the next, in the unit of each",
    ),
    key("step_relative_std", Holds::Positive, "the same relative to their values"),
    key("step_mean", Holds::Number, "what the change is expected to be, in the unit of each").or(0.0),
];

impl Changes {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let out = Self {
            parameters: t.strings("parameters").unwrap_or_default(),
            step_std: t.number("step_std"),
            step_relative_std: t.number("step_relative_std"),
            step_mean: t.number("step_mean").unwrap_or_default(),
        };
        match (t.has("step_std"), t.has("step_relative_std")) {
            (false, false) => {
                let p = error("Config::MissingKey", "parameters without step_std or step_relative_std");
                t.fail(
                    "parameters",
                    p.hint("say how far they may move from one record to the next, as one standard deviation"),
                );
            }
            (true, true) => {
                let what = "step_std and step_relative_std are two deviations of the same parameters";
                t.fail("step_relative_std", error("Config::Conflict", what).hint("give one of them"));
            }
            _ => {}
        }
        t.finish();
        out
    }
    /// Reports names that the model does not have, and relative steps of what is zero.
    pub(super) fn check(&self, model: &Model, t: &Table<'_, '_>) {
        let decls = model.param_decls();
        for (k, pattern) in self.parameters.iter().enumerate() {
            let named: Vec<_> = decls.iter().filter(|d| fits(pattern, &d.name)).collect();
            let place = t.place(&format!("parameters[{k}]"));
            if named.is_empty() {
                let p = error("Config::NoSuchParameter", format!("'{}' fits no parameter", clip(pattern)));
                let p = p.on(format!("{}[{k}]", t.name_of("parameters")));
                let names = || decls.iter().map(|d| d.name.as_str());
                let hint = match nearest(pattern, names()) {
                    Some(n) => format!("did you mean {n}?"),
                    None => format!("there are {}", list(names(), 8)),
                };
                t.fail_at(place, p.hint(hint));
            } else if self.step_relative_std.is_some() && named.iter().all(|d| d.nominal == 0.0) {
                let what = format!("'{}' is zero, and a relative step of it is none", clip(pattern));
                let p = error("Config::OutOfRange", what).on(format!("{}[{k}]", t.name_of("parameters")));
                t.fail_at(place, p.hint("give step_std, in its unit"));
            }
        }
    }
    /// Standard deviation of a step of a parameter with this value; `None` for one that makes none.
    pub fn std_of(&self, value: f64) -> Option<f64> {
        let std = self.step_std.or(self.step_relative_std.map(|r| r * value.abs()));
        std.filter(|s| *s > 0.0)
    }
}
