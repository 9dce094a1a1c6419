//! An interval beside its prior, small enough for a cell of a table.

use super::block::Cell;
use std::fmt::Write;

/// Width and height of the drawing (px).
const SIZE: (f64, f64) = (144.0, 18.0);
/// Room at both ends (px).
const EDGE: f64 = 4.0;

/// A thin bar for the prior, a thick one for the estimate with a dot at its value, a tick at the start; all on one scale
/// that holds them. An empty cell when there is nothing to draw.
pub fn interval(value: f64, estimate: Option<(f64, f64)>, prior: Option<(f64, f64)>, start: f64) -> Cell {
    let ends = [estimate, prior].into_iter().flatten().flat_map(|(a, b)| [a, b]).chain([value, start]);
    let (lo, hi) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    if !(hi > lo && (hi - lo).is_finite()) || (estimate.is_none() && prior.is_none()) {
        return Cell::Words(String::new());
    }
    let (w, h) = SIZE;
    let at = |x: f64| EDGE + (w - 2.0 * EDGE) * (x - lo) / (hi - lo);
    let mut svg = format!("<svg viewBox=\"0 0 {w} {h}\" role=\"img\" aria-label=\"interval\">");
    // Writing to a text cannot fail.
    if let Some((a, b)) = prior {
        let _ = write!(
            svg,
            "<path class=\"prior\" d=\"M{:.1} 9H{:.1}\" stroke-width=\"12\"/>",
            at(a),
            at(b).max(at(a) + 1.0)
        );
    }
    let s = at(start);
    let _ = write!(svg, "<path class=\"start\" d=\"M{s:.1} 2V16\" stroke-width=\"1.5\"/>");
    if let Some((a, b)) = estimate {
        let _ =
            write!(svg, "<path class=\"est\" d=\"M{:.1} 9H{:.1}\" stroke-width=\"4\"/>", at(a), at(b).max(at(a) + 1.0));
    }
    let _ = write!(svg, "<circle class=\"dot\" cx=\"{:.1}\" cy=\"9\" r=\"3\"/></svg>", at(value));
    Cell::Drawing(svg)
}
