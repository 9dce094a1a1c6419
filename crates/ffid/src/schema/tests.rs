use super::check::check;
use crate::schema::*;
use crate::workflow::identify::IdentificationResult;
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
    let schema = mission(&crate::default_registry());
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

/// The keys that the reader asks for, from its sources: the same as those of the schema.
#[test]
fn the_keys_are_those_that_the_reader_asks_for() {
    let mut asked = BTreeSet::new();
    for file in fs::read_dir(root("crates/ff-model/src/mission")).unwrap().map(|e| e.unwrap().path()) {
        if file.ends_with("reader.rs") {
            continue;
        }
        let text = fs::read_to_string(&file).unwrap();
        for call in [
            ".number(",
            ".string(",
            ".strings(",
            ".vector(",
            ".vector::<2>(",
            ".vector::<3>(",
            ".vector::<4>(",
            ".whole(",
            ".wholes(",
            ".numbers(",
            ".rows(",
            ".table(",
            ".tables(",
            "six(t, ",
            "six(&t, ",
            "within(t, ",
            "fraction(t, ",
            "choice(t, ",
            "angle(t, ",
            "or_zero(&t, ",
            "or_zero(t, ",
            "angle(&t, ",
            "direction(t, ",
            "direction(&t, ",
        ] {
            for (i, _) in text.match_indices(call) {
                if let Some(name) =
                    text[i + call.len()..].trim_start().strip_prefix('"').and_then(|r| r.split('"').next())
                {
                    asked.insert(name.to_owned());
                }
            }
        }
    }
    // Lists of keys that are read alike: `["axis", "target"].map(|key| ...)`.
    let limits = fs::read_to_string(root("crates/ff-model/src/mission/limits.rs")).unwrap();
    for (i, _) in limits.match_indices("].map(|key|") {
        let list = &limits[limits[..i].rfind('[').unwrap()..i];
        asked.extend(list.split('"').skip(1).step_by(2).map(str::to_owned));
    }
    fn names(keys: &[Key], out: &mut BTreeSet<String>) {
        for k in keys {
            out.insert(k.name.to_owned());
            match k.holds {
                Holds::Table(k) | Holds::Tables(k) | Holds::Appendages(k) => names(k, out),
                Holds::TablesOf(all) => all.iter().for_each(|k| names(k, out)),
                _ => {}
            }
        }
    }
    let mut known = BTreeSet::new();
    names(mission::ROOT, &mut known);
    let missing: Vec<_> = asked.difference(&known).collect();
    let stale: Vec<_> = known.difference(&asked).collect();
    assert!(missing.is_empty() && stale.is_empty(), "not in the schema: {missing:?}; not asked for: {stale:?}");
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
        Some("integer") => json!(3),
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

fn read(v: &Value) -> Result<IdentificationResult, String> {
    IdentificationResult::from_json(v.to_string().as_bytes())
}

/// Schema and reader ask for the same: a result with every key is read, every key that can be left out can be left out of both,
/// and the reader knows no key that the schema does not.
#[test]
fn the_schema_of_results_is_what_the_reader_reads() {
    let schema = result();
    for pick in 0..12 {
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
    // Results of real identifications.
    for seed in fs::read_dir(root("fuzz/seeds/result")).unwrap().map(|e| e.unwrap().path()) {
        check(&schema, &serde_json::from_slice(&fs::read(&seed).unwrap()).unwrap(), "").unwrap();
    }
}
