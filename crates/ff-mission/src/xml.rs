//! Problems of elements of an XML file, at their lines.

use crate::lines::LineIndex;
use ff_model::diagnostics::clip;
use ff_model::{Area, Problem, Problems};
use roxmltree::Node;

/// Most problems listed; a file that is not a URDF at all would otherwise list every tag.
pub(crate) const MAX_PROBLEMS: usize = 500;

/// Line of an element, from 1.
pub(crate) fn line(lines: &LineIndex<'_>, n: Node<'_, '_>) -> usize {
    lines.at(n.range().start).0
}

/// Reports an error at an element, unless there are [`MAX_PROBLEMS`] already.
pub(crate) fn fail(
    (lines, out): (&LineIndex<'_>, &mut Problems),
    n: Node<'_, '_>,
    object: &str,
    code: &'static str,
    what: String,
    hint: &str,
) {
    if out.0.len() >= MAX_PROBLEMS {
        return;
    }
    let (line, column) = lines.at(n.range().start);
    out.push(Problem::error(Area::Model, code, what).at(line, column).on(clip(object)).hint(hint));
}
