//! `[parameters]`: values of parameters by full name, which replace those that the rest of the file leads to; `[prior_means]`: values that
//! priors are about.

use super::reader::{Table, error};
use ff_model::Model;
use ff_model::diagnostics::{clip, nearest};
use ff_model::keys::wrong_type;
use std::collections::BTreeMap;
use toml::Value;

/// The numbers of the section; what is no number is reported.
pub(super) fn read(t: &Table<'_, '_>) -> BTreeMap<String, f64> {
    let mut out = BTreeMap::new();
    for (name, value) in t.undeclared() {
        match value {
            // Not finite: reported for the whole file.
            Value::Float(x) => _ = out.insert(name, x),
            Value::Integer(i) => _ = out.insert(name, i as f64),
            Value::Table(_) => {
                let p = wrong_type("a table", "a number").hint("put the whole name in quotes: \"base.mass\" = 612.5");
                t.fail(&name, p);
            }
            other => t.fail(&name, wrong_type(other.type_str(), "a number")),
        }
    }
    out
}

/// Puts the values into the complete model; unknown names and values that cannot be are reported.
pub(super) fn apply(model: &mut Model, values: &BTreeMap<String, f64>, t: &Table<'_, '_>) {
    let found = check(model, values, t);
    let (Ok(problems) | Err(problems)) = model.set_nominal(&found);
    for p in problems.0 {
        // A body is named by one of its ten parameters, at whose line it stands.
        let object = p.object.clone().unwrap_or_default();
        let key = values.keys().find(|k| **k == object || k.starts_with(&format!("{object}.")));
        t.fail(key.map_or(object.as_str(), String::as_str), p);
    }
}

/// The values by index of their parameter; unknown names are reported.
pub(super) fn check(model: &Model, values: &BTreeMap<String, f64>, t: &Table<'_, '_>) -> Vec<(usize, f64)> {
    let names: Vec<String> = model.param_decls().into_iter().map(|p| p.name).collect();
    let mut found = Vec::with_capacity(values.len());
    for (name, &x) in values.iter().filter(|(_, x)| x.is_finite()) {
        match names.iter().position(|n| n == name) {
            Some(i) => found.push((i, x)),
            None => {
                let p = error("Config::NoSuchParameter", format!("the model has no parameter '{}'", clip(name)));
                let hint = match nearest(name, names.iter().map(String::as_str)) {
                    Some(n) => format!("did you mean {n}?"),
                    None => "ffid check lists the names".to_owned(),
                };
                t.fail(name, p.hint(hint));
            }
        }
    }
    found
}
