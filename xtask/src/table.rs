//! Fixed-width text tables for the terminal.

use ff_report::page::{Block, Cell, Table as HtmlTable};
use std::fmt;

/// A table: the first column is left-aligned, the others right-aligned unless [`Table::left`] says more.
///
/// ```
/// let mut t = xtask::table::Table::new("Table II", &["error", "paper", "ours"]);
/// t.row(["mean position (m)".into(), "0.0181".into(), xtask::table::sig(0.017_43, 3)]);
/// assert!(t.to_string().contains("mean position (m)  0.0181  0.0174"));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    title: String,
    headers: Vec<String>,
    rows: Vec<Row>,
    notes: Vec<String>,
    left: usize,
}

#[derive(Clone, Debug, PartialEq)]
enum Row {
    Cells(Vec<String>),
    Rule,
}

impl Table {
    /// An empty table.
    pub fn new(title: impl Into<String>, headers: &[&str]) -> Self {
        let headers = headers.iter().map(|&h| h.to_owned()).collect();
        Self { title: title.into(), headers, rows: Vec::new(), notes: Vec::new(), left: 1 }
    }
    /// The same for a report: the table, then its notes. Allocates.
    pub fn blocks(&self) -> Vec<Block> {
        let cells = |row: &Row| match row {
            Row::Cells(c) => {
                let cell = |(k, c): (usize, &String)| {
                    if k < self.left { Cell::words(c.as_str()) } else { Cell::number(c.as_str()) }
                };
                Some(c.iter().enumerate().map(cell).collect::<Vec<_>>())
            }
            Row::Rule => None,
        };
        let table = HtmlTable {
            caption: self.title.clone(),
            head: self.headers.clone(),
            rows: self.rows.iter().filter_map(cells).collect(),
        };
        let mut out = vec![Block::Table(table)];
        out.extend(self.notes.iter().map(Block::text));
        out
    }
    /// Aligns the first `columns` to the left.
    #[must_use]
    pub fn left(mut self, columns: usize) -> Self {
        self.left = columns;
        self
    }
    /// Adds a row. Missing cells are blank, surplus ones widen the table.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) -> &mut Self {
        self.rows.push(Row::Cells(cells.into_iter().collect()));
        self
    }
    /// Adds a horizontal rule.
    pub fn rule(&mut self) -> &mut Self {
        self.rows.push(Row::Rule);
        self
    }
    /// Adds a line below the table.
    pub fn note(&mut self, text: impl Into<String>) -> &mut Self {
        self.notes.push(text.into());
        self
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cells = |r: &Row| if let Row::Cells(c) = r { c.clone() } else { Vec::new() };
        let lines: Vec<Vec<String>> =
            std::iter::once(self.headers.clone()).chain(self.rows.iter().map(cells)).collect();
        let columns = lines.iter().map(Vec::len).max().unwrap_or(0);
        let width: Vec<usize> = (0..columns)
            .map(|c| lines.iter().filter_map(|l| l.get(c)).map(|s| s.chars().count()).max().unwrap_or(0))
            .collect();
        let rule = "-".repeat(width.iter().sum::<usize>() + 2 * columns.saturating_sub(1));
        let line = |f: &mut fmt::Formatter<'_>, cells: &[String]| {
            let mut out = String::new();
            for (c, &w) in width.iter().enumerate() {
                let s = cells.get(c).map_or("", String::as_str);
                // Padding counts characters, not bytes: units carry superscripts.
                let pad = " ".repeat(w.saturating_sub(s.chars().count()));
                let gap = if c == 0 { "" } else { "  " };
                out += &if c < self.left { format!("{gap}{s}{pad}") } else { format!("{gap}{pad}{s}") };
            }
            writeln!(f, "{}", out.trim_end())
        };
        writeln!(f, "{}", self.title)?;
        writeln!(f, "{rule}")?;
        line(f, &self.headers)?;
        writeln!(f, "{rule}")?;
        for r in &self.rows {
            match r {
                Row::Cells(c) => line(f, c)?,
                Row::Rule => writeln!(f, "{rule}")?,
            }
        }
        writeln!(f, "{rule}")?;
        self.notes.iter().try_for_each(|n| writeln!(f, "{n}"))
    }
}

/// A number with `digits` significant digits: plain between 1e-4 and 1e6, else with an exponent.
pub fn sig(x: f64, digits: usize) -> String {
    let digits = digits.max(1);
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let sci = format!("{:.*e}", digits - 1, x);
    // The exponent after rounding, so that 9.99 to one digit counts as 10.
    let exp: i32 = sci.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0);
    if !(-4..6).contains(&exp) {
        return sci;
    }
    let decimals = usize::try_from(digits as i32 - 1 - exp).unwrap_or(0);
    format!("{x:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits() {
        for (x, d, s) in [
            (0.018_149, 3, "0.0181"),
            (9.99, 1, "10"),
            (-1234.5, 3, "-1234"),
            (3.2e-7, 2, "3.2e-7"),
            (5.0e9, 2, "5.0e9"),
            (0.0, 3, "0"),
            (0.000_123_4, 3, "0.000123"),
        ] {
            assert_eq!(sig(x, d), s);
        }
    }

    #[test]
    fn columns_line_up_whatever_the_characters() {
        let mut t = Table::new("T", &["what", "kg m²", "ours"]);
        t.row(["a".into(), "1".into(), "22".into()]).rule().row(["longer".into(), "333".into()]).note("why");
        let lines: Vec<String> = t.to_string().lines().map(str::to_owned).collect();
        assert_eq!(lines[2], "what    kg m²  ours");
        assert_eq!(lines[4], "a           1    22");
        assert_eq!(lines[6], "longer    333");
        assert_eq!(lines.last().map(String::as_str), Some("why"));
        assert_eq!(t.left(2).to_string().lines().nth(4), Some("a       1        22"));
    }
}
