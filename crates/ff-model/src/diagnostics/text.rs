//! Small helpers for readers of text files: byte offset to line and column, nearest known name.

/// The known name most like `word`, if one is close enough to be worth suggesting; without feature `suggestions` one that
/// differs in case alone.
pub fn nearest<'k>(word: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    // Names in a file can be as long as the file; the comparison is quadratic.
    if word.len() > 200 {
        return None;
    }
    known
        .into_iter()
        .filter(|k| k.len() <= 200)
        .map(|k| (k, distance(&word.to_lowercase(), &k.to_lowercase())))
        .filter(|(k, d)| *d <= 1 + word.chars().count().max(k.chars().count()) / 3)
        .min_by_key(|(_, d)| *d)
        .map(|(k, _)| k)
}

/// The known name that `word` is a slip of the pen of: one letter in four of the longer of both, at least one, changed, added, left
/// out or swapped. Closer than what [`nearest`] suggests. Without feature `suggestions` one that differs in case alone.
pub fn misspelling<'k>(word: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    let near = nearest(word, known)?;
    let longer = word.chars().count().max(near.chars().count());
    (distance(&word.to_lowercase(), &near.to_lowercase()) <= (longer / 4).max(1)).then_some(near)
}

/// Letters to change, add, leave out or swap.
#[cfg(feature = "suggestions")]
fn distance(a: &str, b: &str) -> usize {
    strsim::damerau_levenshtein(a, b)
}

#[cfg(not(feature = "suggestions"))]
fn distance(a: &str, b: &str) -> usize {
    if a == b { 0 } else { usize::MAX }
}

/// At most `max` names, comma separated, with the number left out.
pub fn list<'k>(names: impl IntoIterator<Item = &'k str>, max: usize) -> String {
    let all: Vec<&str> = names.into_iter().collect();
    let shown = all.iter().take(max).map(|n| clip(n)).collect::<Vec<_>>().join(", ");
    if all.len() > max { format!("{shown} and {} more", all.len() - max) } else { shown }
}

/// A text cut to 60 characters, so that a message stays readable whatever a file holds.
pub fn clip(s: &str) -> String {
    if s.chars().count() <= 60 { s.to_owned() } else { format!("{}...", s.chars().take(57).collect::<String>()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "suggestions")]
    #[test]
    fn only_close_names_are_suggested() {
        assert_eq!(nearest("inertail", ["visual", "inertial"]), Some("inertial"));
        assert_eq!(nearest("Base", ["base"]), Some("base"));
        assert_eq!(nearest("zebra", ["visual", "inertial"]), None);
    }

    #[cfg(feature = "suggestions")]
    #[test]
    fn a_longer_name_that_holds_a_known_one_is_no_misspelling() {
        let limit = ["lower", "upper", "velocity", "effort"];
        assert_eq!(misspelling("velcoity", limit), Some("velocity"));
        assert_eq!(misspelling("efort", limit), Some("effort"));
        assert_eq!((nearest("gear_velocity", limit), misspelling("gear_velocity", limit)), (Some("velocity"), None));
        assert_eq!(misspelling("K", ["damping", "friction"]), None);
    }

    #[test]
    fn long_lists_say_what_they_leave_out() {
        assert_eq!(list(["a", "b", "c"], 2), "a, b and 1 more");
        assert_eq!(clip(&"x".repeat(100)).len(), 60);
    }
}
