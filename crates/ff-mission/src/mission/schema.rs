//! JSON schema of mission files, printed from the keys that the reader reads by ([`Key`]), and the same for other files whose keys
//! are declared.
//!
//! What each kind of appendage cannot do without is asked of its factory, so that a kind of your own is in the schema of your
//! registry.

pub use super::declared::{Holds, Key, Literal, key, must};

use super::load::ROOT;
use ff_model::Registry;
use serde_json::{Map, Value, json};

/// The dialect of the schemas.
pub const DIALECT: &str = "https://json-schema.org/draft/2020-12/schema";

/// The schema of a mission file whose appendages are of the kinds of a registry. Allocates.
pub fn mission(registry: &Registry) -> Value {
    of_file("Mission file of ffid", ROOT, registry)
}

/// The schema of a file with these keys. Allocates.
pub fn of_file(title: &str, root: &[Key], registry: &Registry) -> Value {
    let mut out = object(root, registry);
    if let Value::Object(map) = &mut out {
        map.insert("$schema".to_owned(), json!(DIALECT));
        map.insert("title".to_owned(), json!(title));
    }
    out
}

fn object(keys: &[Key], registry: &Registry) -> Value {
    let mut properties = Map::new();
    for k in keys {
        let mut of = value(k.holds, registry);
        if let Value::Object(map) = &mut of {
            let mut about = k.about.to_owned();
            if let Some(default) = k.default {
                let (value, text) = match default {
                    Literal::Number(x) => (json!(x), x.to_string()),
                    Literal::Whole(x) => (json!(x), x.to_string()),
                    Literal::Word(w) => (json!(w), w.to_owned()),
                };
                about += if about.is_empty() { "" } else { "; " };
                about += &format!("{text} unless given");
                map.insert("default".to_owned(), value);
            }
            map.insert("description".to_owned(), json!(about));
        }
        properties.insert(k.name.to_owned(), of);
    }
    let required: Vec<&str> = keys.iter().filter(|k| k.required).map(|k| k.name).collect();
    json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
}

fn value(holds: Holds, registry: &Registry) -> Value {
    let list = |of: Value, n: usize| json!({ "type": "array", "items": of, "minItems": n, "maxItems": n });
    let number = || json!({ "type": "number" });
    let any = |of: Value| json!({ "type": "array", "items": of });
    let one_of = |tables: &[&[Key]]| json!({ "anyOf": tables.iter().map(|t| object(t, registry)).collect::<Vec<_>>() });
    match holds {
        Holds::Text => json!({ "type": "string" }),
        Holds::OneOf(words) => json!({ "type": "string", "enum": words }),
        Holds::Number => number(),
        Holds::Positive => json!({ "type": "number", "exclusiveMinimum": 0 }),
        Holds::NotNegative => json!({ "type": "number", "minimum": 0 }),
        Holds::Angle => json!({ "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": std::f64::consts::PI }),
        Holds::Fraction => json!({ "type": "number", "minimum": 0, "exclusiveMaximum": 1 }),
        Holds::Offset => json!({ "type": "number", "exclusiveMinimum": -1 }),
        Holds::Whole => json!({ "type": "integer", "minimum": 0 }),
        Holds::WholeWithin { from, to, .. } => json!({ "type": "integer", "minimum": from, "maximum": to }),
        Holds::Flag => json!({ "type": "boolean" }),
        Holds::Just(n) => json!({ "const": n }),
        Holds::Texts => any(json!({ "type": "string" })),
        Holds::Numbers => any(number()),
        Holds::Wholes => any(json!({ "type": "integer", "minimum": 0 })),
        Holds::Vector(n) => list(number(), n),
        Holds::Rows => list(list(number(), 3), 3),
        Holds::Symmetric => json!({ "anyOf": [list(number(), 6), list(list(number(), 3), 3)] }),
        Holds::Matrix => any(any(number())),
        Holds::Pairs => any(list(number(), 2)),
        Holds::Terms => any(json!({
            "type": "array", "prefixItems": [{ "type": "string" }, number()], "minItems": 2, "maxItems": 2
        })),
        Holds::Table(keys) => object(keys, registry),
        Holds::Tables(keys) => any(object(keys, registry)),
        Holds::Either(tables) => one_of(tables),
        Holds::TablesOf(tables) => any(one_of(tables)),
        Holds::Appendages(keys) => any(appendage(keys, registry)),
        Holds::Named => json!({ "type": "object", "additionalProperties": number() }),
        Holds::Words => json!({ "type": "object", "additionalProperties": { "type": "string" } }),
    }
}

/// Common keys, and for every kind those that its factory misses in an empty table.
fn appendage(keys: &[Key], registry: &Registry) -> Value {
    let mut of = object(keys, registry);
    let kinds: Vec<&str> = registry.kinds().collect();
    let mut rules = vec![json!({
        "if": { "not": { "required": ["lift"] } }, "then": { "required": ["host"] }
    })];
    for kind in &kinds {
        let missing = required(kind, registry);
        if !missing.is_empty() {
            // The segments of what is lifted are those of the URDF.
            rules.push(json!({
                "if": { "properties": { "kind": { "const": kind } }, "required": ["kind"], "not": { "required": ["lift"] } },
                "then": { "required": missing }
            }));
        }
    }
    if let Value::Object(map) = &mut of {
        if let Some(kind) = map.get_mut("properties").and_then(|p| p.get_mut("kind")).and_then(Value::as_object_mut) {
            kind.insert("enum".to_owned(), json!(kinds));
        }
        // Further keys belong to the kind.
        map.insert("additionalProperties".to_owned(), json!(true));
        map.insert("allOf".to_owned(), json!(rules));
    }
    of
}

/// Keys that a kind cannot do without.
fn required(kind: &str, registry: &Registry) -> Vec<String> {
    let Some(Err(problems)) = registry.get(kind).map(|f| f(&toml::Table::new())) else { return Vec::new() };
    let missing = problems.0.into_iter().filter(|p| p.code == "Config::MissingKey");
    missing.filter_map(|p| p.object).collect()
}
