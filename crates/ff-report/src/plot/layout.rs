//! Sizes of text, and rows of labels that do not overlap.

/// Width of a text in DejaVu Sans of the given size (px), from the advance widths of its characters.
///
/// Classes of characters rather than the font's own table: good to a few per cent, and enough for
/// spacing.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let em: f64 = text
        .chars()
        .map(|c| match c {
            'i' | 'j' | 'l' | '\'' | '|' => 0.30,
            ' ' | '.' | ',' | ':' | ';' | 'I' | '·' => 0.32,
            'f' | 't' | 'r' | '(' | ')' | '-' | '/' | '[' | ']' => 0.40,
            'm' | 'w' | 'M' | 'W' | '%' | '@' | '—' => 0.97,
            '−' | '+' | '=' | '<' | '>' | '±' | '→' | '×' => 0.84,
            '⁰'..='⁹' | '⁻' | '¹' | '²' | '³' => 0.42,
            c if c.is_uppercase() => 0.70,
            c if c.is_ascii_digit() => 0.64,
            _ => 0.60,
        })
        .sum();
    em * size
}

/// Splits text into lines no wider than `width` px.
pub(super) fn wrap(text: &str, size: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(line, size) + text_width(word, size) + 0.32 * size <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Places items of the given widths side by side in rows: `(row, left edge)` of each, and the rows used.
pub(super) fn flow(widths: &[f64], gap: f64, left: f64, right: f64) -> (Vec<(usize, f64)>, usize) {
    let (mut row, mut x) = (0, left);
    let mut out = Vec::with_capacity(widths.len());
    for &w in widths {
        if x > left && x + w > right {
            row += 1;
            x = left;
        }
        out.push((row, x));
        x += w + gap;
    }
    (out, if widths.is_empty() { 0 } else { row + 1 })
}

/// Centres labels over their abscissae, each in the lowest row in which it overlaps no other label:
/// `(row, middle)` of each, and the rows used. `items` are `(x, width)`.
pub(super) fn stagger(items: &[(f64, f64)], gap: f64, left: f64, right: f64) -> (Vec<(usize, f64)>, usize) {
    let mut order: Vec<usize> = (0..items.len()).collect();
    order.sort_by(|&a, &b| items[a].0.total_cmp(&items[b].0));
    // Right edge of the last label of every row.
    let mut edges: Vec<f64> = Vec::new();
    let mut out = vec![(0, 0.0); items.len()];
    for i in order {
        let (x, w) = items[i];
        let middle = x.min(right - 0.5 * w).max(left + 0.5 * w);
        let row = edges.iter().position(|&e| e + gap <= middle - 0.5 * w).unwrap_or(edges.len());
        if row == edges.len() {
            edges.push(0.0);
        }
        edges[row] = middle + 0.5 * w;
        out[i] = (row, middle);
    }
    (out, edges.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_labels_go_to_separate_rows() {
        let (at, rows) = stagger(&[(100.0, 80.0), (104.0, 80.0), (300.0, 80.0)], 8.0, 0.0, 400.0);
        assert_eq!(rows, 2);
        assert_eq!([at[0].0, at[1].0, at[2].0], [0, 1, 0]);
        // A label at the edge is moved inside.
        let (at, _) = stagger(&[(1.0, 80.0)], 8.0, 0.0, 400.0);
        assert_eq!(at[0], (0, 40.0));
    }

    #[test]
    fn a_full_row_breaks() {
        let (at, rows) = flow(&[60.0, 60.0, 60.0], 10.0, 0.0, 140.0);
        assert_eq!((at, rows), (vec![(0, 0.0), (0, 70.0), (1, 0.0)], 2));
        assert_eq!(wrap("one two three", 10.0, 45.0), ["one two", "three"]);
    }
}
