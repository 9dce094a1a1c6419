//! A page as data.

use crate::plot::Figure;
use ffid::exit::Failure;

/// How a verdict is to be taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// As hoped.
    Good,
    /// With reservations.
    Fair,
    /// Not to be relied on.
    Bad,
}

/// What a report opens with: labelled parts in a few words, and everything that there is to say behind them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Opening {
    pub(crate) level: Level,
    pub(crate) parts: Vec<Part>,
    /// All sentences.
    pub(crate) full: Vec<String>,
}

/// A part of an opening.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part {
    /// `Answer`, `Trust`.
    pub(crate) label: &'static str,
    /// In one phrase, with the colour of a verdict.
    pub(crate) mark: Option<(Level, &'static str)>,
    /// The most important first.
    pub(crate) sentences: Vec<String>,
}

/// A report.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    pub(super) title: String,
    pub(super) verdict: Option<(Level, Vec<String>)>,
    pub(super) opening: Option<Opening>,
    pub(super) lead: Vec<Block>,
    pub(super) source: String,
    pub(super) sections: Vec<(String, Vec<Block>)>,
}

/// Part of a section.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// A list of sentences.
    List(Vec<String>),
    /// A table.
    Table(Table),
    /// A figure: SVG and what it shows.
    Figure {
        /// SVG, trusted: made by [`crate::plot`].
        svg: String,
        /// What it shows, for those who cannot see it.
        caption: String,
        /// The same as JSON for the scripts of the page ([`crate::plot::Figure::to_json`]).
        data: String,
    },
    /// A drawing without scripts.
    Drawing {
        /// SVG, trusted: made by this crate or by its caller from text that went through [`escape`](super::escape).
        svg: String,
        /// What it shows; empty where the drawing says so itself.
        caption: String,
    },
    /// A link to a file beside the page.
    Link {
        /// Name of the file.
        file: String,
        /// What it is.
        text: String,
    },
    /// The view of a replay: HTML, trusted: made by [`crate::replay`].
    Replay(String),
    /// Preformatted text.
    Code(String),
    /// Blocks behind a line that opens them.
    Details(String, Vec<Block>),
}

/// A table; the first column is the head of each row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// What it lists.
    pub caption: String,
    /// Heads of the columns.
    pub head: Vec<String>,
    /// Rows of as many cells.
    pub rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Words, to the left.
    Words(String),
    /// A number, to the right, its digits aligned.
    Number(String),
    /// A drawing of [`interval`](super::interval).
    Drawing(String),
    /// A word with the colour of a verdict.
    Mark(Level, String),
}

impl Cell {
    /// Words.
    pub fn words(s: impl Into<String>) -> Self {
        Self::Words(s.into())
    }
    /// A number.
    pub fn number(s: impl Into<String>) -> Self {
        Self::Number(s.into())
    }
}

impl Block {
    /// A paragraph.
    pub fn text(s: impl Into<String>) -> Self {
        Self::Text(s.into())
    }
    /// A figure, drawn; with scripts each curve has about `points` points.
    ///
    /// # Errors
    /// Those of [`Figure::to_svg`].
    pub fn figure(f: &Figure, points: usize) -> Result<Self, Failure> {
        // The writer of SVG escapes what is markup, but lets control characters through, which no XML may hold.
        let hidden = |c: char| c.is_control() && !c.is_ascii_whitespace();
        let shown = |svg: String| svg.replace(hidden, "\u{fffd}");
        let (svg, caption) = (shown(f.to_svg()?), f.title.clone());
        // Only panels have curves to zoom into.
        if f.panels.is_empty() {
            let svg = match f.to_narrow_svg()?.map(shown) {
                Some(narrow) => format!("<div class=\"desk\">{svg}</div><div class=\"phone\">{narrow}</div>"),
                None => svg,
            };
            // It carries its title.
            return Ok(Self::Drawing { svg, caption: String::new() });
        }
        Ok(Self::Figure { svg, caption, data: f.to_json(points) })
    }
}

/// Numbers that all curves of a page may take together, as scripts read them: 2 MB, at 4 bytes each in base64.
const NUMBERS: usize = 400_000;

/// Points for each curve of these figures, so that a page with all of them stays below 5 MB however long the records are.
pub fn points<'a>(figures: impl IntoIterator<Item = &'a Figure>) -> usize {
    let curves: usize = figures.into_iter().flat_map(|f| &f.panels).map(|p| p.series.len() + 1).sum();
    (NUMBERS / curves.max(1)).clamp(200, 4000)
}

/// JSON as it may stand in a `<script>` element: no `<`, which could end it.
pub(crate) fn script_json(json: &str) -> String {
    json.replace('<', "\\u003c")
}

impl Page {
    /// A page without sections.
    pub fn new(title: impl Into<String>) -> Self {
        let source = "All numbers are in result.json, exactly.".to_owned();
        Self { title: title.into(), verdict: None, opening: None, lead: Vec::new(), source, sections: Vec::new() }
    }
    /// Sets what comes first: the verdict in sentences, the most important in front.
    pub fn verdict(&mut self, level: Level, sentences: &[String]) {
        self.verdict = Some((level, sentences.to_vec()));
    }
    /// Sets what comes first in labelled parts, in place of a verdict.
    pub(crate) fn open_with(&mut self, opening: Opening) {
        self.opening = Some(opening);
    }
    /// Adds a block before the sections.
    pub(crate) fn lead(&mut self, block: Block) {
        self.lead.push(block);
    }
    /// Sets what the foot of the page says of its numbers.
    pub fn source(&mut self, text: &str) {
        text.clone_into(&mut self.source);
    }
    /// Adds a section; one without blocks is left out.
    pub fn section(&mut self, title: impl Into<String>, blocks: Vec<Block>) {
        if !blocks.is_empty() {
            self.sections.push((title.into(), blocks));
        }
    }
}
