//! Small helpers for readers of text files: byte offset to line and column, nearest known name.

/// Maps byte offsets of a text to lines and columns; built once, looked up in `O(log lines)`.
#[derive(Debug)]
pub(crate) struct LineIndex<'a> {
    text: &'a str,
    starts: Vec<usize>,
}

impl<'a> LineIndex<'a> {
    /// Indexes a text.
    pub(crate) fn new(text: &'a str) -> Self {
        let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        Self { text, starts }
    }
    /// Line and column (both from 1, columns in characters) of a byte offset; offsets past the end give
    /// the end of the text.
    pub(crate) fn at(&self, offset: usize) -> (usize, usize) {
        let mut offset = offset.min(self.text.len());
        while !self.text.is_char_boundary(offset) {
            offset -= 1;
        }
        let line = self.starts.partition_point(|&s| s <= offset).max(1);
        let start = self.starts.get(line - 1).copied().unwrap_or(0);
        (line, self.text.get(start..offset).map_or(0, |s| s.chars().count()) + 1)
    }
}

/// The known name most like `word`, if one is close enough to be worth suggesting.
pub fn nearest<'k>(word: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    // Names in a file can be as long as the file; the comparison is quadratic.
    if word.len() > 200 {
        return None;
    }
    known
        .into_iter()
        .filter(|k| k.len() <= 200)
        .map(|k| (k, strsim::damerau_levenshtein(&word.to_lowercase(), &k.to_lowercase())))
        .filter(|(k, d)| *d <= 1 + word.chars().count().max(k.chars().count()) / 3)
        .min_by_key(|(_, d)| *d)
        .map(|(k, _)| k)
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

    #[test]
    fn offsets_become_lines_and_columns() {
        let i = LineIndex::new("ab\nµc\n\nd");
        assert_eq!(i.at(0), (1, 1));
        assert_eq!(i.at(2), (1, 3));
        assert_eq!(i.at(3), (2, 1));
        assert_eq!(i.at(4), (2, 1)); // inside the two bytes of the first character
        assert_eq!(i.at(5), (2, 2));
        assert_eq!(i.at(7), (3, 1));
        assert_eq!(i.at(99), (4, 2));
        assert_eq!(LineIndex::new("").at(0), (1, 1));
    }

    #[test]
    fn only_close_names_are_suggested() {
        assert_eq!(nearest("inertail", ["visual", "inertial"]), Some("inertial"));
        assert_eq!(nearest("Base", ["base"]), Some("base"));
        assert_eq!(nearest("zebra", ["visual", "inertial"]), None);
    }

    #[test]
    fn long_lists_say_what_they_leave_out() {
        assert_eq!(list(["a", "b", "c"], 2), "a, b and 1 more");
        assert_eq!(clip(&"x".repeat(100)).len(), 60);
    }
}
