use super::*;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

fn root(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// What of JSON Schema the schemas use: the reason why a value is refused.
fn check(schema: &Value, v: &Value, at: &str) -> Result<(), String> {
    let no = |why: String| Err(format!("{at}: {why}"));
    if schema["anyOf"].as_array().is_some_and(|all| all.iter().all(|s| check(s, v, at).is_err())) {
        return no("none of several".into());
    }
    let typed = match schema["type"].as_str() {
        Some("object") => v.is_object(),
        Some("array") => v.is_array(),
        Some("string") => v.is_string(),
        Some("number") => v.is_number(),
        Some("integer") => v.is_u64() || v.is_i64(),
        _ => true,
    };
    if !typed {
        return no(format!("{v} is no {}", schema["type"]));
    }
    if schema["enum"].as_array().is_some_and(|e| !e.contains(v)) || schema.get("const").is_some_and(|c| c != v) {
        return no(format!("{v} is none of the known words"));
    }
    let x = v.as_f64();
    if schema["minimum"].as_f64().is_some_and(|m| x.is_some_and(|x| x < m))
        || schema["exclusiveMinimum"].as_f64().is_some_and(|m| x.is_some_and(|x| x <= m))
    {
        return no(format!("{v} is too small"));
    }
    if let Some(items) = v.as_array() {
        let n = items.len() as u64;
        if schema["minItems"].as_u64().is_some_and(|m| n < m) || schema["maxItems"].as_u64().is_some_and(|m| n > m) {
            return no(format!("{n} items"));
        }
        for (i, item) in items.iter().enumerate().filter(|_| schema["items"].is_object()) {
            check(&schema["items"], item, &format!("{at}[{i}]"))?;
        }
    }
    if let Some(map) = v.as_object() {
        for key in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            if !map.contains_key(key) {
                return no(format!("{key} is missing"));
            }
        }
        for (key, item) in map {
            let path = format!("{at}.{key}");
            match (&schema["properties"][key], &schema["additionalProperties"]) {
                (Value::Null, Value::Bool(false)) => return no(format!("unknown key {key}")),
                (Value::Null, other @ Value::Object(_)) => check(other, item, &path)?,
                (Value::Null, _) => {}
                (known, _) => check(known, item, &path)?,
            }
        }
    }
    for rule in schema["allOf"].as_array().into_iter().flatten() {
        let condition = &rule["if"];
        let not = condition.get("not").is_none_or(|n| check(n, v, at).is_err());
        if not && check(condition, v, at).is_ok() {
            check(&rule["then"], v, at)?;
        }
    }
    Ok(())
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
            if let Holds::Table(k) | Holds::Tables(k) | Holds::Appendages(k) = k.holds {
                names(k, out);
            }
        }
    }
    let mut known = BTreeSet::new();
    names(mission::ROOT, &mut known);
    let missing: Vec<_> = asked.difference(&known).collect();
    let stale: Vec<_> = known.difference(&asked).collect();
    assert!(missing.is_empty() && stale.is_empty(), "not in the schema: {missing:?}; not asked for: {stale:?}");
}
