//! Parameters by name pattern: `base.*`, `panel_left.k[*]`.

use super::reader::{Table, error};
use ff_model::Model;
use ff_model::diagnostics::{clip, nearest};

/// True when `name` fits `pattern`, in which `*` stands for any text and all else for itself.
pub(super) fn fits(pattern: &str, name: &str) -> bool {
    let mut pieces = pattern.split('*');
    let Some(mut rest) = pieces.next().and_then(|first| name.strip_prefix(first)) else { return false };
    let middle: Vec<&str> = pieces.collect();
    let Some((last, middle)) = middle.split_last() else { return rest.is_empty() };
    for piece in middle {
        match rest.find(piece) {
            Some(i) => rest = &rest[i + piece.len()..],
            None => return false,
        }
    }
    rest.ends_with(last)
}

/// Indices of the parameters that fit any pattern, ascending; a pattern that fits none is reported.
pub(super) fn indices(patterns: &[String], model: &Model, t: &Table<'_, '_>) -> Vec<usize> {
    let names: Vec<String> = model.param_decls().into_iter().map(|p| p.name).collect();
    let mut chosen = vec![false; names.len()];
    for (k, pattern) in patterns.iter().enumerate() {
        let mut any = false;
        for (i, n) in names.iter().enumerate() {
            if fits(pattern, n) {
                chosen[i] = true;
                any = true;
            }
        }
        if !any {
            let p = error("Config::NoSuchParameter", format!("'{}' fits no parameter", clip(pattern)));
            let p = p.on(format!("{}[{k}]", t.name_of("parameters")));
            let hint = match nearest(pattern, names.iter().map(String::as_str)) {
                Some(n) => format!("did you mean {n}?"),
                None => "ffid check lists the names".to_owned(),
            };
            t.fail_at(t.place(&format!("parameters[{k}]")), p.hint(hint));
        }
    }
    (0..names.len()).filter(|&i| chosen[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::fits;

    #[test]
    fn stars_stand_for_any_text_and_brackets_for_themselves() {
        for (p, n, want) in [
            ("base.*", "base.mass", true),
            ("base.*", "base2.mass", false),
            ("panel_left.k[*]", "panel_left.k[0]", true),
            ("panel_left.k[*]", "panel_left.k0", false),
            ("*.k[*]", "panel_left.k[12]", true),
            ("*", "anything", true),
            ("base.mass", "base.mass", true),
            ("base.mass", "base.mass2", false),
            ("a*b*b", "ab", false),
            ("a*b*b", "abb", true),
            ("", "", true),
            ("", "x", false),
        ] {
            assert_eq!(fits(p, n), want, "{p} {n}");
        }
    }
}
