//! Reports as one HTML file: opens offline, readable on a phone, in the dark and on paper.
//!
//! A [`Page`] is data: a title, a verdict, sections of [`Block`]s. Everything that is text goes through [`escape`]. Figures are SVG of
//! [`crate::plot`], set into the page; with scripts they become plots to zoom and to read values from, on paper they stay. Scripts are in the
//! file, only where something needs them, and its content security policy forbids every request.
//!
//! ```
//! use ff_report::page::{Block, Level, Page};
//!
//! let mut page = Page::new("Identification of <probe>");
//! page.verdict(Level::Good, &["All 2 parameters are determined by the record.".to_owned()]);
//! page.section("Parameters", vec![Block::text("Values & intervals.")]);
//! let html = page.render();
//! assert!(html.contains("Identification of &lt;probe&gt;") && html.contains("Values &amp; intervals."));
//! assert!(!html.contains("<script"));
//! ```
pub(crate) mod assets;
pub(crate) mod bars;
mod block;
pub(crate) mod render;
pub(crate) mod style;
#[cfg(test)]
pub(crate) mod tests;

pub use bars::interval;
pub use block::{Block, Cell, Level, Page, Table, points};
pub(crate) use block::{Opening, Part, script_json};
pub use render::escape;

impl Page {
    /// The file.
    pub fn render(&self) -> String {
        render::page(self)
    }
}
