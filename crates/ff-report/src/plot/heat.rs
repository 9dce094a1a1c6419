//! A matrix of correlations as colours.

use super::canvas::{Canvas, Result, Text};
use super::layout::text_width;
use super::style::{AXIS, SMALL, WHITE};
use plotters::prelude::RGBColor;
use plotters::style::text_anchor::HPos;

/// Largest side of a cell (px).
const CELL: f64 = 34.0;
/// Largest matrix with numbers in its cells.
const NUMBERED: usize = 20;
/// Key below the matrix.
const KEY: f64 = 44.0;
/// Ends of the scale: -1 and +1. Blue and orange are told apart by the colour blind.
const ENDS: [RGBColor; 2] = [RGBColor(213, 94, 0), RGBColor(0, 114, 178)];

/// Correlations of named quantities.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heat {
    /// Names.
    pub names: Vec<String>,
    /// Rows of coefficients, -1 to 1.
    pub rows: Vec<Vec<f64>>,
}

/// Colour of a coefficient.
fn colour(x: f64) -> RGBColor {
    let (part, full) = (x.abs().min(1.0), ENDS[usize::from(x > 0.0)]);
    let mix = |c: u8| (255.0 - part * (255.0 - f64::from(c))) as u8;
    RGBColor(mix(full.0), mix(full.1), mix(full.2))
}

impl Heat {
    fn left(&self) -> f64 {
        self.names.iter().map(|n| text_width(n, SMALL)).fold(40.0, f64::max) + 24.0
    }
    fn side(&self, width: f64) -> f64 {
        CELL.min((width - self.left() - 90.0) / self.names.len().max(1) as f64)
    }
    /// Height of the drawing.
    pub(super) fn height(&self, width: f64) -> f64 {
        self.side(width) * self.names.len() as f64 + KEY
    }
    /// The lower triangle with the diagonal: names to the left, and at the end of each row, where the column is.
    pub(super) fn draw(&self, c: &mut Canvas<'_>, top: f64, width: f64) -> Result<()> {
        let (left, side, n) = (self.left(), self.side(width), self.names.len());
        for (i, (name, row)) in self.names.iter().zip(&self.rows).enumerate() {
            let y = top + side * i as f64;
            c.text(name, (left - 8.0, y + 0.5 * side), Text::new(SMALL.min(0.8 * side)).anchor(HPos::Right))?;
            for (j, x) in row.iter().take(i).enumerate() {
                let at = (left + side * j as f64, y);
                c.fill(at, (at.0 + side - 1.0, at.1 + side - 1.0), colour(*x))?;
                if n <= NUMBERED && x.abs() >= 0.005 {
                    let ink = if x.abs() > 0.6 { WHITE } else { RGBColor(40, 40, 40) };
                    let text = format!("{x:.2}").replace("0.", ".").replace('-', "\u{2212}");
                    let look = Text::new(9.5_f64.min(0.32 * side)).anchor(HPos::Center).colour(ink);
                    c.text(&text, (at.0 + 0.5 * side - 0.5, at.1 + 0.5 * side), look)?;
                }
            }
            let look = Text::new(SMALL.min(0.8 * side)).colour(AXIS);
            c.text(name, (left + side * i as f64 + 4.0, y + 0.5 * side), look)?;
        }
        let y = top + side * n as f64 + 14.0;
        for k in 0..=20 {
            let x = f64::from(k) / 10.0 - 1.0;
            c.fill((left + 10.0 * f64::from(k), y), (left + 10.0 * f64::from(k + 1), y + 10.0), colour(x))?;
        }
        for (x, label) in [(5.0, "\u{2212}1"), (105.0, "0"), (205.0, "1")] {
            c.text(label, (left + x, y + 20.0), Text::new(SMALL).anchor(HPos::Center))?;
        }
        c.text("correlation", (left + 222.0, y + 5.0), Text::new(SMALL))
    }
}
