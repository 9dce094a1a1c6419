//! A value against a JSON schema.

use serde_json::Value;

/// What of JSON Schema the schemas use: the reason why a value is refused.
pub(crate) fn check(schema: &Value, v: &Value, at: &str) -> Result<(), String> {
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
        Some("boolean") => v.is_boolean(),
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
    if schema["maximum"].as_f64().is_some_and(|m| x.is_some_and(|x| x > m))
        || schema["exclusiveMaximum"].as_f64().is_some_and(|m| x.is_some_and(|x| x >= m))
    {
        return no(format!("{v} is too large"));
    }
    if let Some(items) = v.as_array() {
        let n = items.len() as u64;
        if schema["minItems"].as_u64().is_some_and(|m| n < m) || schema["maxItems"].as_u64().is_some_and(|m| n > m) {
            return no(format!("{n} items"));
        }
        for (i, (item, of)) in items.iter().zip(schema["prefixItems"].as_array().into_iter().flatten()).enumerate() {
            check(of, item, &format!("{at}[{i}]"))?;
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
