//! Choosing parameters by name: `base.*`, `panel_left.k[*]`, `*.d[*]`.
//!
//! `*` stands for any run of characters (also none, also dots); everything else, brackets included, stands
//! for itself. A pattern is matched against the full name. A leading `!` removes what it matches from the
//! selection so far, so that `["base.*", "!base.h_*"]` leaves out the first moments.

use ff_model::ParamDecl;

/// Why a selection was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SelectionError {
    /// A pattern matches no parameter of the model.
    #[error("'{pattern}' matches no parameter{}", nearest.as_ref().map_or_else(
        || "; the model has none".to_owned(), |n| format!("; the nearest name is '{n}'")))]
    NoMatch {
        /// The pattern.
        pattern: String,
        /// The most similar full name.
        nearest: Option<String>,
    },
    /// Nothing is left to estimate.
    #[error("no parameter is selected; name at least one, such as 'base.*'")]
    Empty,
}

impl SelectionError {
    /// Process exit code of `bad-inputs.md`: 11 (configuration).
    pub fn exit_code(&self) -> u8 {
        11
    }
}

/// Indices of the parameters that the patterns select, ascending and without repetition. Allocates.
///
/// # Errors
/// [`SelectionError::NoMatch`] for the first pattern that matches nothing, with the name nearest to it;
/// [`SelectionError::Empty`].
pub fn select<S: AsRef<str>>(decls: &[ParamDecl], patterns: &[S]) -> Result<Vec<usize>, SelectionError> {
    let (out, missed) = sift(decls, patterns);
    if let Some(pattern) = missed {
        let similarity = |d: &ParamDecl| strsim::jaro_winkler(pattern, &d.name);
        let nearest = decls.iter().max_by(|a, b| similarity(a).total_cmp(&similarity(b)));
        return Err(SelectionError::NoMatch { pattern: pattern.to_owned(), nearest: nearest.map(|d| d.name.clone()) });
    }
    if out.is_empty() { Err(SelectionError::Empty) } else { Ok(out) }
}

/// What the patterns leave selected, ascending, and the first pattern that matches nothing.
pub(crate) fn sift<'a, S: AsRef<str>>(decls: &[ParamDecl], patterns: &'a [S]) -> (Vec<usize>, Option<&'a str>) {
    let (mut chosen, mut missed) = (vec![false; decls.len()], None);
    for p in patterns {
        let p = p.as_ref().trim();
        let (pattern, value) = p.strip_prefix('!').map_or((p, true), |rest| (rest.trim_start(), false));
        let mut hit = false;
        for (c, d) in chosen.iter_mut().zip(decls) {
            if matches(pattern, &d.name) {
                (*c, hit) = (value, true);
            }
        }
        missed = missed.or((!hit).then_some(pattern));
    }
    ((0..decls.len()).filter(|&i| chosen[i]).collect(), missed)
}

/// True when `pattern`, with `*` for any run of characters, covers the whole of `name`. Does not allocate.
///
/// Linear in the length of the name for each star (the last star is the only one retried).
pub fn matches(pattern: &str, name: &str) -> bool {
    let (p, n) = (pattern.as_bytes(), name.as_bytes());
    let (mut i, mut k) = (0, 0);
    let mut retry: Option<(usize, usize)> = None;
    while k < n.len() {
        if i < p.len() && p[i] == b'*' {
            retry = Some((i + 1, k));
            i += 1;
        } else if i < p.len() && p[i] == n[k] {
            (i, k) = (i + 1, k + 1);
        } else if let Some((star, from)) = retry {
            retry = Some((star, from + 1));
            (i, k) = (star, from + 1);
        } else {
            return false;
        }
    }
    p[i..].iter().all(|&c| c == b'*')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decls() -> Vec<ParamDecl> {
        let names = ["base.mass", "base.h_x", "panel_left.k[0]", "panel_left.k[1]", "panel_left.d[0]", "tank.d[0]"];
        names.iter().map(|n| ParamDecl::positive(*n, "kg", 1.3)).collect()
    }

    #[test]
    fn stars_span_anything_and_brackets_are_plain() {
        assert!(matches("*.d[*]", "panel_left.d[10]") && !matches("*.d[*]", "panel_left.damp"));
        assert!(matches("*", "x") && matches("a*b*c", "abbbcbc") && !matches("a*b*c", "abbbcb"));
        assert!(!matches("base", "base.mass") && matches("base.mass**", "base.mass") && !matches("", "a"));
        assert_eq!(select(&decls(), &["*.d[*]", "base.*"]), Ok(vec![0, 1, 4, 5]));
        assert_eq!(select(&decls(), &["panel_left.*", "!*.k[1]"]), Ok(vec![2, 4]));
    }

    #[test]
    fn a_pattern_without_a_match_is_refused_with_the_nearest_name() {
        let e = select(&decls(), &["base.*", "panel_lef.k[0]"]).unwrap_err();
        assert_eq!(e.to_string(), "'panel_lef.k[0]' matches no parameter; the nearest name is 'panel_left.k[0]'");
        assert_eq!(select(&decls(), &["base.*", "!*"]), Err(SelectionError::Empty));
        assert_eq!(select::<&str>(&decls(), &[]), Err(SelectionError::Empty));
    }
}
