//! Data to HTML.

use super::assets::{Needs, POLICY};
use super::block::{Block, Cell, Level, Opening, Page, Table, script_json};
use super::style::CSS;
use std::fmt::Write;

/// Text as it may stand in an element or in an attribute in double quotes. Control characters, which HTML forbids, become
/// the sign for a character that cannot be shown.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\n' | '\t' => out.push(c),
            c if c.is_control() => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

fn class(level: Level) -> &'static str {
    match level {
        Level::Good => "good",
        Level::Fair => "fair",
        Level::Bad => "bad",
    }
}

pub(super) fn page(p: &Page) -> String {
    let title = escape(&p.title);
    let needs = Needs::of(p.lead.iter().chain(p.sections.iter().flat_map(|s| &s.1)));
    let styles = needs.styles().concat();
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"/>\n<title>{title}</title>\n\
         <style>{CSS}{styles}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n"
    );
    // Writing to a text cannot fail, here and below.
    if let Some((level, sentences)) = &p.verdict {
        let _ = write!(out, "<div class=\"verdict {}\">", class(*level));
        for s in sentences {
            let _ = write!(out, "<p>{}</p>", escape(s));
        }
        out.push_str("</div>\n");
    }
    if let Some(o) = &p.opening {
        opening(&mut out, o);
    }
    p.lead.iter().for_each(|b| block(&mut out, b));
    if p.sections.len() > 2 {
        out.push_str("<nav>");
        for (i, (name, _)) in p.sections.iter().enumerate() {
            let _ = write!(out, "<a href=\"#s{i}\">{}</a> ", escape(name));
        }
        out.push_str("</nav>\n");
    }
    for (i, (name, blocks)) in p.sections.iter().enumerate() {
        let _ = write!(out, "<section id=\"s{i}\">\n<h2>{}</h2>\n", escape(name));
        blocks.iter().for_each(|b| block(&mut out, b));
        out.push_str("</section>\n");
    }
    let _ =
        write!(out, "</main>\n<footer>Written by ffid {}. {}</footer>\n", env!("CARGO_PKG_VERSION"), escape(&p.source));
    for script in needs.scripts() {
        let _ = writeln!(out, "<script>{script}</script>");
    }
    out.push_str("</body>\n</html>\n");
    out
}

fn opening(out: &mut String, o: &Opening) {
    let _ = write!(out, "<div class=\"verdict opening {}\">", class(o.level));
    for part in &o.parts {
        let _ = write!(out, "<div class=\"part\"><h2>{}</h2><div>", escape(part.label));
        if let Some((level, words)) = &part.mark {
            let _ = write!(out, "<p class=\"mark {}\">{}</p>", class(*level), escape(words));
        }
        part.sentences.iter().for_each(|s| _ = write!(out, "<p>{}</p>", escape(s)));
        out.push_str("</div></div>");
    }
    if !o.full.is_empty() {
        out.push_str("<details><summary>Everything that was found, in words</summary>");
        o.full.iter().for_each(|s| _ = write!(out, "<p>{}</p>", escape(s)));
        out.push_str("</details>");
    }
    out.push_str("</div>\n");
}

fn block(out: &mut String, b: &Block) {
    match b {
        Block::Text(s) => _ = writeln!(out, "<p>{}</p>", escape(s)),
        Block::List(all) => {
            out.push_str("<ul>");
            all.iter().for_each(|s| _ = write!(out, "<li>{}</li>", escape(s)));
            out.push_str("</ul>\n");
        }
        Block::Code(s) => _ = writeln!(out, "<pre>{}</pre>", escape(s)),
        Block::Figure { svg, caption, data } => {
            _ = writeln!(
                out,
                "<figure class=\"plot\">{svg}<figcaption>{}</figcaption><script type=\"application/json\">{}</script></figure>",
                escape(caption),
                script_json(data)
            );
        }
        Block::Drawing { svg, caption } => {
            let said = if caption.is_empty() {
                String::new()
            } else {
                format!("<figcaption>{}</figcaption>", escape(caption))
            };
            _ = writeln!(out, "<figure class=\"drawing\">{svg}{said}</figure>");
        }
        Block::Link { file, text } => _ = writeln!(out, "<p><a href=\"{}\">{}</a></p>", escape(file), escape(text)),
        Block::Replay(html) => _ = writeln!(out, "<div class=\"replay\">{html}</div>"),
        Block::Details(summary, blocks) => {
            let _ = writeln!(out, "<details><summary>{}</summary>", escape(summary));
            blocks.iter().for_each(|b| block(out, b));
            out.push_str("</details>\n");
        }
        Block::Table(t) => table(out, t),
    }
}

/// Characters of words from which a cell is broken into lines.
const LONG: usize = 36;

fn table(out: &mut String, t: &Table) {
    // A table that is too wide for a phone becomes a card for each row there.
    let cards = if t.head.len() > 3 { " class=\"cards\"" } else { "" };
    let _ = write!(out, "<div class=\"wide\"><table{cards}>");
    if !t.caption.is_empty() {
        let _ = write!(out, "<caption>{}</caption>", escape(&t.caption));
    }
    out.push_str("<thead><tr>");
    for (i, h) in t.head.iter().enumerate() {
        let number = t.rows.first().is_some_and(|r| matches!(r.get(i), Some(Cell::Number(_))));
        let _ = write!(out, "<th scope=\"col\"{}>{}</th>", if number { " class=\"n\"" } else { "" }, escape(h));
    }
    out.push_str("</tr></thead><tbody>\n");
    for row in &t.rows {
        out.push_str("<tr>");
        for (i, c) in row.iter().enumerate() {
            let tag = if i == 0 { "th" } else { "td" };
            let label = t.head.get(i).map_or("", String::as_str);
            let scope = if i == 0 { " scope=\"row\"".to_owned() } else { format!(" data-label=\"{}\"", escape(label)) };
            let _ = match c {
                Cell::Words(s) if i > 0 && s.chars().count() > LONG => {
                    write!(out, "<{tag}{scope} class=\"w\">{}</{tag}>", escape(s))
                }
                Cell::Words(s) => write!(out, "<{tag}{scope}>{}</{tag}>", escape(s)),
                // A number and its interval are too wide for a column together.
                Cell::Number(s) => match s.split_once(" [") {
                    Some((number, interval)) => write!(
                        out,
                        "<{tag}{scope} class=\"n\"><span>{} <span class=\"range\">[{}</span></span></{tag}>",
                        escape(number),
                        escape(interval)
                    ),
                    None => write!(out, "<{tag}{scope} class=\"n\">{}</{tag}>", escape(s)),
                },
                Cell::Drawing(svg) => write!(out, "<{tag}{scope}>{svg}</{tag}>"),
                Cell::Mark(l, s) => write!(out, "<{tag}{scope} class=\"{}\">{}</{tag}>", class(*l), escape(s)),
            };
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>\n");
}
