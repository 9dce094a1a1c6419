//! JSON schemas against the readers of `ffid`. They are here because its own test program would compile the reader of results again.

use crate::json_schema::check;
use ff_mission::{LoadOptions, Mission};
use ff_model::{Problems, Registry, toml};
use ffid::schema::*;
use ffid::workflow::identify::IdentificationResult;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

fn root(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

fn load(path: &std::path::Path) -> Option<Value> {
    let table: toml::Table = fs::read_to_string(path).ok()?.parse().ok()?;
    serde_json::to_value(table).ok()
}

#[test]
fn every_mission_that_loads_is_valid_and_the_wrong_ones_are_not() {
    let schema = mission(&ffid::default_registry());
    let mut seen = 0;
    for folder in ["fixtures/paper", "fixtures/modal", "fixtures/kinds"] {
        for file in fs::read_dir(root(folder)).unwrap().map(|e| e.unwrap().path()) {
            if file.extension().is_some_and(|e| e == "toml") {
                check(&schema, &load(&file).unwrap(), "").unwrap_or_else(|e| panic!("{}: {e}", file.display()));
                seen += 1;
            }
        }
    }
    assert!(seen >= 6, "{seen}");
    for (bad, why) in [
        ("M32_unknown_key", "unknown key"),
        ("M32_unknown_limit", "unknown key"),
        ("M32_unknown_section", "unknown key"),
        ("M32_unknown_goal", "known words"),
        ("M38_unknown_kind", "known words"),
        ("M39_rate", "too small"),
        ("M39_type", "is no"),
    ] {
        let v = load(&root(&format!("fixtures/bad/{bad}.toml"))).unwrap();
        let e = check(&schema, &v, "").expect_err(bad);
        assert!(e.contains(why), "{bad}: {e}");
    }
    // What a kind needs is asked of its factory; segments that are lifted are those of the URDF.
    let with = |appendage: Value| check(&schema, &json!({ "robot": { "urdf": "r" }, "appendage": [appendage] }), "");
    let tank = |more: &str| json!({ "kind": "slosh_pendulum", "name": "t", "host": "b", "length_m": 0.7, "mass_kg": 3, more: [1, 2] });
    assert!(with(tank("stiffness_nm_per_rad")).unwrap_err().contains("damping_nms_per_rad is missing"));
    assert!(with(tank("damping_nms_per_rad")).unwrap_err().contains("stiffness_nm_per_rad is missing"));
    let wing = |key: &str| json!({ "kind": "flex_panel", "name": "w", key: ["j1"] });
    assert!(with(wing("lift")).is_ok() && with(wing("host")).is_err());
}

/// A value with every key of a schema; of several tables the one of this number.
fn full(schema: &Value, pick: usize) -> Value {
    if let Some(all) = schema["anyOf"].as_array() {
        return full(&all[pick % all.len()], pick);
    }
    if let Some(words) = schema["enum"].as_array() {
        return words[pick % words.len()].clone();
    }
    let n = schema["minItems"].as_u64().unwrap_or(2) as usize;
    match schema["type"].as_str() {
        Some("object") => match &schema["additionalProperties"] {
            of @ Value::Object(_) => json!({ "any": full(of, pick) }),
            _ => schema["properties"].as_object().unwrap().iter().map(|(k, of)| (k.clone(), full(of, pick))).collect(),
        },
        Some("array") => match schema["prefixItems"].as_array() {
            Some(each) => each.iter().map(|of| full(of, pick)).collect(),
            None => (0..n).map(|_| full(&schema["items"], pick)).collect(),
        },
        Some("string") => json!("text"),
        Some("number") => json!(0.25),
        Some("integer") => json!(schema["maximum"].as_u64().map_or(3, |most| most.min(3))),
        Some("boolean") => json!(true),
        _ => schema["const"].clone(),
    }
}

/// Every table in a value, as JSON pointer.
fn tables(v: &Value, at: &str, out: &mut Vec<String>) {
    match v {
        Value::Object(map) => {
            out.push(at.to_owned());
            map.iter().for_each(|(k, v)| tables(v, &format!("{at}/{k}"), out));
        }
        Value::Array(items) => items.iter().take(1).for_each(|v| tables(v, &format!("{at}/0"), out)),
        _ => {}
    }
}

/// What is wrong with a mission of this content.
fn problems(mission: &Value, registry: &Registry) -> Problems {
    let urdf = fs::read_to_string(root("fixtures/paper/robot.urdf")).unwrap();
    let text = toml::to_string(mission).unwrap();
    Mission::from_str(&text, &urdf, registry, &LoadOptions::default()).map(|_| ()).unwrap_err()
}

/// By construction: the reader refuses to read a key that is not declared, and reports one that nothing reads as unknown. So a
/// mission with every key of the schema meets neither, and a further key is unknown in every table.
#[test]
fn the_schema_of_missions_is_what_the_reader_reads() {
    let registry = ffid::default_registry();
    let schema = mission(&registry);
    for pick in 0..4 {
        let mut whole = full(&schema, pick);
        check(&schema, &whole, "").unwrap();
        // What is lifted has no mount of its own.
        whole["appendage"][0].as_object_mut().unwrap().remove("lift");
        let p = problems(&whole, &registry);
        let wrong = |p: &Problems| p.0.iter().any(|p| p.code == "Config::UnknownKey" || p.code.starts_with("Internal"));
        assert!(!wrong(&p) && !p.has("Config::Syntax"), "{p}");
        let mut places = Vec::new();
        tables(&whole, "", &mut places);
        assert!(places.len() >= 20, "{places:?}");
        // Names of parameters and joints, and the keys of a kind, are for others to judge.
        let named = ["/parameters", "/prior_means", "/robot/lock_at", "/appendage/0"];
        for at in places.iter().filter(|at| !named.contains(&at.as_str())) {
            let mut v = whole.clone();
            v.pointer_mut(at).unwrap().as_object_mut().unwrap().insert("further".to_owned(), json!(0));
            assert!(wrong(&problems(&v, &registry)), "{at}");
        }
    }
}

fn read(v: &Value) -> Result<IdentificationResult, String> {
    IdentificationResult::from_json(v.to_string().as_bytes())
}

#[test]
fn the_schema_of_results_is_what_the_reader_reads() {
    schema_and_reader_agree(0..3);
    // Results of real identifications.
    for seed in fs::read_dir(root("fuzz/seeds/result")).unwrap().map(|e| e.unwrap().path()) {
        check(&result(), &serde_json::from_slice(&fs::read(&seed).unwrap()).unwrap(), "").unwrap();
    }
}

#[test]
#[ignore = "full tier: 3 s"]
fn the_schema_of_results_is_what_the_reader_reads_in_every_variant() {
    schema_and_reader_agree(3..12);
}

/// Schema and reader ask for the same: a result with every key is read, every key that can be left out can be left out of both,
/// and the reader knows no key that the schema does not.
///
/// `picks` choose among the variants of the schema.
fn schema_and_reader_agree(picks: std::ops::Range<usize>) {
    let schema = result();
    for pick in picks {
        let whole = full(&schema, pick);
        check(&schema, &whole, "").unwrap();
        let again = read(&whole).unwrap_or_else(|e| panic!("{e}: {whole}"));
        let written: Value = serde_json::from_slice(&again.to_json().unwrap()).unwrap();
        assert_eq!(written, whole);
        let mut places = Vec::new();
        tables(&whole, "", &mut places);
        assert!(places.len() > 25, "{places:?}");
        for at in places {
            let keys: Vec<String> = whole.pointer(&at).unwrap().as_object().unwrap().keys().cloned().collect();
            let change = |f: &dyn Fn(&mut Map<String, Value>)| {
                let mut v = whole.clone();
                f(v.pointer_mut(&at).unwrap().as_object_mut().unwrap());
                (check(&schema, &v, ""), read(&v).map(|_| ()))
            };
            if at.ends_with("/settings") {
                continue;
            }
            for k in &keys {
                let (by_schema, by_reader) = change(&|map| _ = map.remove(k));
                assert_eq!(by_schema.is_ok(), by_reader.is_ok(), "{at} without {k}: {by_schema:?}, {by_reader:?}");
                let (by_schema, by_reader) = change(&|map| _ = map.insert(k.clone(), json!({ "other": [] })));
                assert!(by_schema.is_err() && by_reader.is_err(), "{at} with another {k}");
            }
            let (by_schema, by_reader) = change(&|map| _ = map.insert("?".to_owned(), json!(0)));
            assert!(by_schema.is_err(), "{at}");
            // The tag of an enum lets the reader take more than its keys.
            if !at.ends_with("/status") {
                let said = by_reader.unwrap_err();
                let known: BTreeSet<&str> = said.split('`').skip(3).step_by(2).collect();
                assert_eq!(known, keys.iter().map(String::as_str).collect(), "{at}: {said}");
            }
        }
    }
}
