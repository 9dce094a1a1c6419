//! Lines and columns of positions in a text.

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
}
