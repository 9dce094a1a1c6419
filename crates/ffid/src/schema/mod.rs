//! JSON schemas: of the files that people write, so that editors complete and check them, and of what programs read.
//!
//! The reader of mission files asks for its keys by name ([`ff_mission::mission`]); the keys here are held to those by a test
//! that reads its sources. What each kind of appendage needs is asked of its factory, so that a kind of your own is in the schema of your registry.
#[cfg(test)]
pub(crate) mod check;
pub(crate) mod mission;
pub(crate) mod result;
#[cfg(test)]
pub(crate) mod tests;

use ff_model::{Registry, toml};
use serde_json::{Map, Value, json};

/// The dialect of the schemas.
pub const DIALECT: &str = "https://json-schema.org/draft/2020-12/schema";

/// What a key holds.
#[derive(Clone, Copy, Debug)]
enum Holds {
    Text,
    Number,
    /// A number above zero.
    Positive,
    /// A number of zero or more.
    NotNegative,
    Whole,
    Texts,
    Numbers,
    Wholes,
    /// Exactly so many numbers.
    Vector(usize),
    /// Rows of three numbers, three of them.
    Rows,
    /// Six numbers xx, xy, xz, yy, yz, zz, or three rows of three.
    Symmetric,
    OneOf(&'static [&'static str]),
    Table(&'static [Key]),
    Tables(&'static [Key]),
    /// Tables that are each one of several.
    TablesOf(&'static [&'static [Key]]),
    /// Any names with numbers.
    Named,
    /// Any names with texts.
    Words,
    Flag,
    /// This number and no other.
    Just(u32),
    /// Rows of any length.
    Matrix,
    /// Two numbers each.
    Pairs,
    /// A name and a number each.
    Terms,
    /// One of several tables.
    Either(&'static [&'static [Key]]),
    /// Tables of appendages.
    Appendages(&'static [Key]),
}

/// A key of a table.
#[derive(Clone, Copy, Debug)]
struct Key {
    name: &'static str,
    required: bool,
    holds: Holds,
    about: &'static str,
}

const fn key(name: &'static str, holds: Holds, about: &'static str) -> Key {
    Key { name, required: false, holds, about }
}
const fn must(name: &'static str, holds: Holds, about: &'static str) -> Key {
    Key { name, required: true, holds, about }
}

/// The schema of a mission file whose appendages are of the kinds of a registry. Allocates.
pub fn mission(registry: &Registry) -> Value {
    titled("Mission file of ffid", object(mission::ROOT, registry))
}

/// The schema of the `result.json` of an identification ([`crate::workflow::identify::IdentificationResult`]). Allocates.
pub fn result() -> Value {
    titled("Result of ffid identify", object(result::ROOT, &Registry::default()))
}

fn titled(title: &str, mut root: Value) -> Value {
    if let Value::Object(map) = &mut root {
        map.insert("$schema".to_owned(), json!(DIALECT));
        map.insert("title".to_owned(), json!(title));
    }
    root
}

fn object(keys: &[Key], registry: &Registry) -> Value {
    let mut properties = Map::new();
    for k in keys {
        let mut of = value(k.holds, registry);
        if let Value::Object(map) = &mut of {
            map.insert("description".to_owned(), json!(k.about));
        }
        properties.insert(k.name.to_owned(), of);
    }
    let required: Vec<&str> = keys.iter().filter(|k| k.required).map(|k| k.name).collect();
    json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
}

fn value(holds: Holds, registry: &Registry) -> Value {
    let list = |of: Value, n: usize| json!({ "type": "array", "items": of, "minItems": n, "maxItems": n });
    let number = || json!({ "type": "number" });
    match holds {
        Holds::Text => json!({ "type": "string" }),
        Holds::Number => number(),
        Holds::Positive => json!({ "type": "number", "exclusiveMinimum": 0 }),
        Holds::NotNegative => json!({ "type": "number", "minimum": 0 }),
        Holds::Whole => json!({ "type": "integer", "minimum": 0 }),
        Holds::Texts => json!({ "type": "array", "items": { "type": "string" } }),
        Holds::Numbers => json!({ "type": "array", "items": number() }),
        Holds::Wholes => json!({ "type": "array", "items": { "type": "integer", "minimum": 0 } }),
        Holds::Vector(n) => list(number(), n),
        Holds::Rows => list(list(number(), 3), 3),
        Holds::Symmetric => json!({ "anyOf": [list(number(), 6), list(list(number(), 3), 3)] }),
        Holds::OneOf(words) => json!({ "type": "string", "enum": words }),
        Holds::Table(keys) => object(keys, registry),
        Holds::Tables(keys) => json!({ "type": "array", "items": object(keys, registry) }),
        Holds::TablesOf(tables) => json!({ "type": "array", "items": value(Holds::Either(tables), registry) }),
        Holds::Named => json!({ "type": "object", "additionalProperties": number() }),
        Holds::Words => json!({ "type": "object", "additionalProperties": { "type": "string" } }),
        Holds::Flag => json!({ "type": "boolean" }),
        Holds::Just(n) => json!({ "const": n }),
        Holds::Matrix => json!({ "type": "array", "items": { "type": "array", "items": number() } }),
        Holds::Pairs => json!({ "type": "array", "items": list(number(), 2) }),
        Holds::Terms => json!({ "type": "array", "items": {
            "type": "array", "prefixItems": [{ "type": "string" }, number()], "minItems": 2, "maxItems": 2
        } }),
        Holds::Either(tables) => json!({ "anyOf": tables.iter().map(|t| object(t, registry)).collect::<Vec<_>>() }),
        Holds::Appendages(keys) => json!({ "type": "array", "items": appendage(keys, registry) }),
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
        if let Some(Value::Object(properties)) = map.get_mut("properties") {
            properties.insert(
                "kind".to_owned(),
                json!({ "type": "string", "enum": kinds, "description": "what hangs there" }),
            );
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
