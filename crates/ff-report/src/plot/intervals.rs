//! Intervals of many quantities, a row each, on one scale.

use super::canvas::{Canvas, Result, Text};
use super::layout::{flow, text_width, wrap};
use super::scale::{Axis, extent, typeset};
use super::style::{AXIS, FONT, GRID, MARK, MINOR, PALETTE, SMALL, pale};
use plotters::style::text_anchor::HPos;

/// Height of a row, of a row of the legend and the room below it, of the axis, and of a line of its label (px).
const ROW: f64 = 24.0;
const LEGEND: f64 = 18.0;
const BELOW: f64 = 6.0;
const FOOT: f64 = 30.0;
const LINE: f64 = 16.0;
/// Most of the width that names take.
const NAMES: f64 = 0.45;
/// Ends of an interval off the scale are cut there with an arrow.
const ARROW: f64 = 7.0;
/// Room to the right, and for a tick (px).
const RIGHT: f64 = 24.0;
const TICKS: f64 = 90.0;

/// An interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// A dot, if there is one.
    pub at: Option<f64>,
    /// Place in the palette.
    pub colour: usize,
    /// Wide and pale, behind the others: what was known beforehand.
    pub wide: bool,
}

/// Rows of intervals on one axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intervals {
    /// Label of the axis, with unit.
    pub x_label: String,
    /// Range of the axis; that of the data unless set.
    pub x_range: Option<(f64, f64)>,
    /// Logarithmic axis.
    pub log_x: bool,
    /// Names of colours of the palette.
    pub legend: Vec<(String, usize)>,
    /// Abscissae that are marked in all rows.
    pub marks: Vec<f64>,
    /// Name of each row, and its intervals, drawn in this order but the wide ones first.
    pub rows: Vec<(String, Vec<Interval>)>,
}

impl Intervals {
    /// Every number of it that has to be finite, with its row.
    pub(super) fn numbers(&self) -> impl Iterator<Item = (&str, f64)> {
        self.rows.iter().flat_map(|(name, all)| {
            all.iter().flat_map(move |i| [Some(i.low), Some(i.high), i.at]).flatten().map(move |x| (name.as_str(), x))
        })
    }
    fn left(&self, width: f64) -> f64 {
        let widest = self.rows.iter().map(|(n, _)| text_width(&typeset(n), SMALL)).fold(60.0, f64::max);
        (widest + 36.0).min(NAMES * width)
    }
    /// Least room for a tick: there are four where there is little.
    fn room(&self, width: f64) -> f64 {
        (0.2 * (width - self.left(width) - RIGHT)).clamp(32.0, TICKS)
    }
    /// Row and left edge of every entry of the legend, and the height of all.
    fn entries(&self, width: f64) -> (Vec<(usize, f64)>, f64) {
        let widths: Vec<f64> = self.legend.iter().map(|(name, _)| 28.0 + text_width(name, FONT)).collect();
        let (at, rows) = flow(&widths, 20.0, self.left(width), width - RIGHT);
        (at, LEGEND * rows.max(1) as f64 + BELOW)
    }
    /// Lines of the label of the axis; `power` of ten is a factor of its ticks.
    fn label(&self, power: i32, width: f64) -> Vec<String> {
        let label = typeset(&self.x_label);
        let label = if power == 0 { label } else { format!("{label}, times 10{}", super::scale::superscript(power)) };
        wrap(&label, FONT, width - self.left(width) - RIGHT)
    }
    /// Height of the drawing.
    pub(super) fn height(&self, width: f64) -> f64 {
        let (_, power) = self.axis((self.left(width), width - RIGHT)).ticks(self.room(width));
        let foot = FOOT + LINE * self.label(power, width).len() as f64;
        self.entries(width).1 + ROW * self.rows.len() as f64 + foot
    }
    fn axis(&self, px: (f64, f64)) -> Axis {
        let values = || self.numbers().map(|n| n.1).chain(self.marks.iter().copied());
        if self.log_x {
            let data = extent(values().filter(|x| *x > 0.0)).unwrap_or((0.1, 1.0));
            return Axis::log(self.x_range.unwrap_or((data.0 / 1.3, data.1 * 1.3)), px);
        }
        let (lo, hi) = extent(values()).unwrap_or((0.0, 1.0));
        let margin = 0.04 * (hi - lo);
        Axis::linear(self.x_range.unwrap_or((lo - margin, hi + margin)), px)
    }
    pub(super) fn draw(&self, c: &mut Canvas<'_>, top: f64, width: f64) -> Result<()> {
        let (left, right) = (self.left(width), width - RIGHT);
        let (places, legend) = self.entries(width);
        let (head, bottom) = (top + legend, top + legend + ROW * self.rows.len() as f64);
        let axis = self.axis((left, right));
        for ((name, k), (row, x)) in self.legend.iter().zip(places) {
            let y = top + 8.0 + LEGEND * row as f64;
            let wide = self.rows.iter().flat_map(|r| &r.1).any(|i| i.colour == *k && i.wide);
            let full = PALETTE[k % PALETTE.len()];
            let (colour, thick) = if wide { (pale(full), 12.0) } else { (full, 4.0) };
            c.path(&[(x, y), (x + 22.0, y)], colour, thick)?;
            c.text(name, (x + 28.0, y), Text::new(FONT))?;
        }
        let (ticks, power) = axis.ticks(self.room(width));
        for t in &ticks {
            let named = !t.label.is_empty();
            c.line((t.at, head), (t.at, bottom), if named { GRID } else { MINOR }, 1.0)?;
            if named {
                c.line((t.at, bottom), (t.at, bottom + 4.0), AXIS, 1.0)?;
                c.text(&t.label, (t.at, bottom + 14.0), Text::new(SMALL).anchor(HPos::Center))?;
            }
        }
        for px in self.marks.iter().filter_map(|m| axis.px(*m)).filter(|px| (left..=right).contains(px)) {
            c.line((px, head), (px, bottom), MARK, 1.4)?;
        }
        for (i, (name, all)) in self.rows.iter().enumerate() {
            let y = head + ROW * (i as f64 + 0.5);
            let room = left - 20.0;
            let mut shown = typeset(name);
            while text_width(&shown, SMALL) > room && shown.chars().count() > 4 {
                shown = shown.chars().take(shown.chars().count() - 2).collect::<String>() + "\u{2026}";
            }
            c.text(&shown, (left - 10.0, y), Text::new(SMALL).anchor(HPos::Right))?;
            let (wide, thin): (Vec<&Interval>, Vec<&Interval>) = all.iter().partition(|k| k.wide);
            // What would lie upon each other is set side by side.
            let n = thin.len() as f64;
            for k in wide {
                self.bar(c, k, (y, 13.0), &axis, (left, right))?;
            }
            for (j, k) in thin.into_iter().enumerate() {
                let at = y + 7.0 * (j as f64 - 0.5 * (n - 1.0));
                self.bar(c, k, (at, 3.0), &axis, (left, right))?;
            }
        }
        c.path(&[(left, head), (right, head), (right, bottom), (left, bottom), (left, head)], AXIS, 1.0)?;
        for (i, line) in self.label(power, width).iter().enumerate() {
            let at = (0.5 * (left + right), bottom + 32.0 + LINE * i as f64);
            c.text(line, at, Text::new(FONT).anchor(HPos::Center))?;
        }
        Ok(())
    }
    fn bar(
        &self,
        c: &mut Canvas<'_>,
        k: &Interval,
        (y, thick): (f64, f64),
        axis: &Axis,
        (left, right): (f64, f64),
    ) -> Result<()> {
        let full = PALETTE[k.colour % PALETTE.len()];
        let colour = if k.wide { pale(full) } else { full };
        // What has no logarithm lies to the left of everything.
        let px = |x: f64| axis.px(x).unwrap_or(left - 1.0);
        let (a, b) = (px(k.low), px(k.high));
        let clamp = |x: f64| x.clamp(left, right);
        if b - a >= 0.5 && b >= left && a <= right {
            c.fill((clamp(a), y - 0.5 * thick), (clamp(b), y + 0.5 * thick), colour)?;
        }
        for (out, end, turn) in [
            (a.min(px(k.at.unwrap_or(k.low))) < left, left, 1.0),
            (b.max(px(k.at.unwrap_or(k.high))) > right, right, -1.0),
        ] {
            if out && !k.wide {
                let tip = [(end + turn * ARROW, y - 4.0), (end + turn, y), (end + turn * ARROW, y + 4.0)];
                c.path(&tip, colour, 1.6)?;
            }
        }
        if let Some(at) = k.at.map(px).filter(|p| (left..=right).contains(p)) {
            c.dot((at, y), 3.6, full)?;
        }
        Ok(())
    }
}
