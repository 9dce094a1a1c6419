//! Warnings of one kind as one: a list that is read to its end.

use ff_model::diagnostics::list;
use ff_model::{Area, Problem, Problems, Severity};
use std::collections::HashMap;

/// Names in a summary.
const NAMED: usize = 6;

/// The warnings of a result with those of one kind put together.
pub(super) fn summarised<M>(mut result: Result<(M, Problems), Problems>) -> Result<(M, Problems), Problems> {
    match &mut result {
        Ok((_, p)) | Err(p) => summarise(p),
    }
    result
}

/// Puts warnings about the model with the same code and file into one: the first, with the names of the others behind its message.
/// Errors stay as they are, one by one.
pub(crate) fn summarise(problems: &mut Problems) {
    let key = |p: &Problem| (p.code, p.file.clone());
    let counts = |p: &Problem| p.severity == Severity::Warning && p.area == Area::Model;
    let mut first: HashMap<_, usize> = HashMap::new();
    let mut others: HashMap<usize, Vec<String>> = HashMap::new();
    let mut out: Vec<Problem> = Vec::with_capacity(problems.0.len());
    for p in std::mem::take(&mut problems.0) {
        if counts(&p) {
            if let Some(&at) = first.get(&key(&p)) {
                let name = p.object.unwrap_or_else(|| "the file".to_owned());
                let names = others.entry(at).or_default();
                if !names.contains(&name) && out[at].object.as_ref() != Some(&name) {
                    names.push(name);
                }
                continue;
            }
            first.insert(key(&p), out.len());
        }
        out.push(p);
    }
    for (at, names) in others.into_iter().filter(|(_, n)| !n.is_empty()) {
        out[at].message += &format!("; the same of {}", list(names.iter().map(String::as_str), NAMED));
    }
    problems.0 = out;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_of_a_kind_become_one_and_errors_stay() {
        let of = |severity, code, object: &str| Problem {
            severity,
            ..Problem::error(Area::Model, code, format!("what of {object}")).on(object)
        };
        let (w, e) = (Severity::Warning, Severity::Error);
        let mut p = Problems(vec![
            of(w, "Urdf::NoInertial", "link a"),
            of(e, "Urdf::Triangle", "link b"),
            of(w, "Urdf::NoInertial", "link c"),
            of(w, "Urdf::Mimic", "joint d"),
            of(e, "Urdf::Triangle", "link e"),
            of(w, "Urdf::NoInertial", "link f"),
        ]);
        summarise(&mut p);
        let found: Vec<_> = p.0.iter().map(|p| (p.code, p.object.as_deref().unwrap_or_default())).collect();
        let want = [
            ("Urdf::NoInertial", "link a"),
            ("Urdf::Triangle", "link b"),
            ("Urdf::Mimic", "joint d"),
            ("Urdf::Triangle", "link e"),
        ];
        assert_eq!(found, want);
        assert!(p.0[0].message.ends_with("link c, link f"), "{}", p.0[0]);
        assert!(!p.0[2].message.contains("the same"), "{}", p.0[2]);
        // Putting together what is together changes nothing.
        let once = p.clone();
        summarise(&mut p);
        assert_eq!(p, once);
    }
}
