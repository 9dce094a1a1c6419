//! What is settled on the bytes alone, before any XML parser sees them: size, encoding, nesting, DTD, xacro.
//!
//! The parser inside urdf-rs recurses once per level and aborts the process at about 20,000 levels; urdf-rs
//! also runs `rosrun` and `xacro` for files that look like xacro. Neither must ever see such a file.

use super::options::{MAX_BYTES, MAX_DEPTH};
use crate::lines::LineIndex;
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem, Problems};

/// The text of a file without its byte order mark.
///
/// # Errors
/// Too large, or not UTF-8.
pub(super) fn decode(bytes: &[u8]) -> Result<&str, Problems> {
    let fail = |p: Problem| Err(Problems(vec![p]));
    if bytes.len() > MAX_BYTES {
        return fail(
            Problem::error(Area::Model, "Urdf::TooLarge", format!("{} bytes, limit {MAX_BYTES} bytes", bytes.len()))
                .violating(bytes.len() as f64, Limit::AtMost(MAX_BYTES as f64), "bytes")
                .hint("keep meshes out of the URDF, or split the robot"),
        );
    }
    match std::str::from_utf8(bytes) {
        Ok(s) => Ok(s.strip_prefix('\u{feff}').unwrap_or(s)),
        Err(e) => {
            let at = e.valid_up_to();
            let line = 1 + bytes[..at].iter().filter(|&&b| b == b'\n').count();
            let what = format!("byte {at} (0x{:02x}) is not UTF-8", bytes.get(at).copied().unwrap_or(0));
            fail(Problem::error(Area::Model, "Urdf::NotUtf8", what).at_line(line).hint("save the file as UTF-8"))
        }
    }
}

/// Walks the tags once. Stops at the first finding: what follows must not reach a parser.
pub(super) fn scan(text: &str, max_links: usize) -> Result<(), Problems> {
    let b = text.as_bytes();
    let (mut i, mut depth, mut links) = (0, 0usize, 0usize);
    let fail = |at: usize, p: Problem| {
        let (line, column) = LineIndex::new(text).at(at);
        Err(Problems(vec![p.at(line, column)]))
    };
    while let Some(open) = find(b, i, b"<") {
        let rest = &b[open..];
        if rest.starts_with(b"<!--") {
            i = find(b, open + 4, b"-->").map_or(b.len(), |e| e + 3);
        } else if rest.starts_with(b"<![CDATA[") {
            i = find(b, open + 9, b"]]>").map_or(b.len(), |e| e + 3);
        } else if rest.starts_with(b"<?") {
            i = find(b, open + 2, b"?>").map_or(b.len(), |e| e + 2);
        } else if rest.starts_with(b"<!") {
            return fail(
                open,
                Problem::error(
                    Area::Model,
                    "Urdf::DtdForbidden",
                    "document type declarations and entities are refused",
                )
                .hint("remove the <!DOCTYPE ...> block"),
            );
        } else {
            if rest.starts_with(b"<xacro:") || rest.starts_with(b"</xacro:") {
                return fail(open, xacro("an element of xacro"));
            }
            let end = tag_end(b, open + 1);
            if rest.starts_with(b"</") {
                depth = depth.saturating_sub(1);
            } else {
                let name = rest[1..].split(|c| c.is_ascii_whitespace() || matches!(c, b'/' | b'>')).next();
                if depth == 1 && name == Some(b"link") {
                    links += 1;
                    if links > max_links {
                        return fail(
                            open,
                            Problem::error(
                                Area::Model,
                                "Urdf::TooLarge",
                                format!("more than {max_links} links, the limit"),
                            )
                            .violating(max_links as f64 + 1.0, Limit::AtMost(max_links as f64), "links")
                            .hint("raise the limit if the robot is really that large"),
                        );
                    }
                }
                // An element without content adds no level for its siblings but is itself one level down.
                let level = depth + 1;
                if level > MAX_DEPTH {
                    return fail(
                        open,
                        Problem::error(
                            Area::Model,
                            "Urdf::TooDeep",
                            format!("elements nested {level} deep, limit {MAX_DEPTH}"),
                        )
                        .violating(level as f64, Limit::AtMost(MAX_DEPTH as f64), "levels")
                        .hint("a URDF needs 5 levels; look for an element that is not closed"),
                    );
                }
                if end < 2 || b.get(end - 2) != Some(&b'/') {
                    depth = level;
                }
            }
            i = end;
        }
    }
    Ok(())
}

/// The refusal of xacro and of paths that only ROS can resolve.
pub(super) fn xacro(what: &str) -> Problem {
    Problem::error(Area::Model, "Urdf::XacroNotSupported", format!("{what}; this program starts no other programs"))
        .hint("expand the file first: xacro robot.xacro > robot.urdf")
}

/// First position of `needle` at or after `from`.
fn find(b: &[u8], from: usize, needle: &[u8]) -> Option<usize> {
    b.get(from..)?.windows(needle.len()).position(|w| w == needle).map(|p| p + from)
}

/// Position after the `>` that closes the tag; quotes may hold a `>`.
fn tag_end(b: &[u8], from: usize) -> usize {
    let mut quote = None;
    for (k, &c) in b.iter().enumerate().skip(from) {
        match quote {
            Some(q) if c == q => quote = None,
            Some(_) => {}
            None if c == b'"' || c == b'\'' => quote = Some(c),
            None if c == b'>' => return k + 1,
            None => {}
        }
    }
    b.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(text: &str) -> Option<&'static str> {
        scan(text, 3).err().map(|p| p.0[0].code)
    }

    #[test]
    fn quotes_comments_and_cdata_do_not_nest() {
        let many = "<a>".repeat(100);
        assert_eq!(code(&format!("<r><!--{many}--><![CDATA[{many}]]><a x=\"{many}\"/></r>")), None);
        assert_eq!(code(&many), Some("Urdf::TooDeep"));
    }

    #[test]
    fn siblings_do_not_nest() {
        assert_eq!(code(&format!("<r>{}{}</r>", "<a/>".repeat(500), "<b> </b>".repeat(500))), None);
        assert_eq!(code(&format!("{}<x/>{}", "<a>".repeat(63), "</a>".repeat(63))), None);
        assert_eq!(code(&format!("{}<x/>{}", "<a>".repeat(64), "</a>".repeat(64))), Some("Urdf::TooDeep"));
    }

    #[test]
    fn links_are_counted_at_the_top_only() {
        assert_eq!(code("<r><link name='a'/><link/><link></link><j><link/></j></r>"), None);
        assert_eq!(code("<r><link/><link/><link/><link/></r>"), Some("Urdf::TooLarge"));
    }

    #[test]
    fn unterminated_pieces_end_the_scan() {
        for t in ["<", "<!--", "<?", "<a", "<a '", "<![CDATA[", "</", "<>", ""] {
            assert_eq!(code(t), None, "{t}");
        }
        assert_eq!(code("<!D"), Some("Urdf::DtdForbidden"));
    }
}
