//! Results as JSON that holds numbers only: a NaN is an error, not a silent `null`.

use crate::exit::Failure;
use crate::files::atomic;
use serde::Serialize;
use serde_json::Value;
use std::path::Path;

/// Writes `value` as indented JSON, atomically.
///
/// serde_json turns NaN and infinities into `null`; so any `null` is refused, and an absent `Option` must
/// be left out (`skip_serializing_if = "Option::is_none"`).
///
/// # Errors
/// [`Failure::NotFinite`] with the path of the offending value, [`Failure::Io`].
pub fn write<T: Serialize>(path: &Path, value: &T) -> Result<(), Failure> {
    atomic::write(path, &bytes(path, value)?)
}

/// The bytes that [`write()`] would write to `path`.
///
/// # Errors
/// [`Failure::NotFinite`] with the path of the offending value, [`Failure::Io`].
pub fn bytes<T: Serialize>(path: &Path, value: &T) -> Result<Vec<u8>, Failure> {
    let fail = |e: serde_json::Error| Failure::io("format", path, e.into());
    let tree = serde_json::to_value(value).map_err(fail)?;
    if let Some(place) = first_null(&tree, String::new()) {
        let place = format!("{}: {place}", path.display());
        return Err(Failure::NotFinite { place, value: "null in JSON".into() });
    }
    let mut bytes = serde_json::to_vec_pretty(value).map_err(fail)?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// Path of the first `null`, such as `table2.noisy.max_pos_m` or `fig5.model_hz[1]`.
fn first_null(v: &Value, at: String) -> Option<String> {
    match v {
        Value::Null => Some(if at.is_empty() { "the whole value".into() } else { at }),
        Value::Array(a) => a.iter().enumerate().find_map(|(i, v)| first_null(v, format!("{at}[{i}]"))),
        Value::Object(o) => {
            let join = |k: &str| if at.is_empty() { k.to_owned() } else { format!("{at}.{k}") };
            o.iter().find_map(|(k, v)| first_null(v, join(k)))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Errors {
        mean_pos_m: f64,
        modes_hz: Vec<f64>,
    }

    #[test]
    fn numbers_read_back_exactly() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("summary.json");
        write(&path, &Errors { mean_pos_m: 0.1 + 0.2, modes_hz: vec![0.231, 1e-300] }).unwrap();
        let v: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(v["mean_pos_m"].as_f64(), Some(0.1 + 0.2));
        assert_eq!(v["modes_hz"][1].as_f64(), Some(1e-300));
    }

    #[test]
    fn refuses_non_finite_numbers_by_path() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("summary.json");
        let bad = [("table2", Errors { mean_pos_m: 1.0, modes_hz: vec![0.2, f64::INFINITY] })];
        let map: std::collections::BTreeMap<_, _> = bad.into_iter().collect();
        let e = write(&path, &map).unwrap_err();
        assert!(e.to_string().contains("table2.modes_hz[1] is not finite"), "{e}");
        assert!(!path.exists());
    }
}
