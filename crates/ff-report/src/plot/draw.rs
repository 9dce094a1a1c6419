//! Draws a figure: titles, legends, axes, curves.

use super::canvas;
use super::canvas::{Canvas, Result, Text};
use super::figure::{Figure, LOG_DECADES, Panel, Range, Series, VLine, WIDTH};
use super::layout::{flow, stagger, text_width, wrap};
use super::polyline::{Frame, dashes, visible};
use super::scale::{Axis, extent, superscript, typeset};
use super::style::{AXIS, FONT, GRID, MARK, MINOR, PALETTE, SMALL, WHITE, pale};
use plotters::prelude::RGBColor;
use plotters::style::text_anchor::HPos;

const SHADE: RGBColor = RGBColor(238, 233, 214);

const LEFT: f64 = 84.0;
const RIGHT: f64 = WIDTH - 24.0;
const ROW: f64 = 18.0;
/// Size of the title (px).
const TITLE: f64 = 17.0;
/// A curve below this share of the largest of its panel is zero.
const ZERO: f64 = 1e-9;

/// A legend entry: label, series it belongs to (`None` for a band), row and left edge.
type Entry = (String, Option<usize>, (usize, f64));

/// Height of what surrounds the data area of a panel.
struct Heights {
    title: f64,
    legend: f64,
    marks: f64,
}

/// The whole figure as SVG, `width` px wide; panels are [`WIDTH`] wide.
pub(super) fn figure(f: &Figure, width: f64) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let title = wrap(&f.title, 1.1 * TITLE, width - 24.0);
    let caption = wrap(&f.caption, SMALL, width - 48.0);
    let header = if title.is_empty() { 14.0 } else { 24.0 + 22.0 * title.len() as f64 };
    let panels: f64 = f.panels.iter().map(|p| total(&heights(p)) + p.height).sum();
    let footer = if caption.is_empty() { 6.0 } else { 14.0 + 16.0 * caption.len() as f64 };
    let corner = f.corner.as_ref().map_or(0.0, |c| c.height(width));
    let intervals = f.intervals.as_ref().map_or(0.0, |i| i.height(width));
    let heat = f.heat.as_ref().map_or(0.0, |h| h.height(width));
    let size = (width, (header + corner + intervals + heat + panels + footer).ceil());
    let mut svg = String::new();
    let mut c = Canvas::new(&mut svg, size);
    c.fill((0.0, 0.0), size, WHITE)?;
    for (i, line) in title.iter().enumerate() {
        let look = Text::new(TITLE).bold().anchor(HPos::Center);
        c.text(line, (width / 2.0, 24.0 + 22.0 * i as f64), look)?;
    }
    let mut top = header;
    if let Some(f) = &f.corner {
        f.draw(&mut c, top, width)?;
        top += corner;
    }
    if let Some(i) = &f.intervals {
        i.draw(&mut c, top, width)?;
        top += intervals;
    }
    if let Some(h) = &f.heat {
        h.draw(&mut c, top, width)?;
        top += heat;
    }
    for p in &f.panels {
        panel(&mut c, p, top)?;
        top += total(&heights(p)) + p.height;
    }
    for (i, line) in caption.iter().enumerate() {
        c.text(line, (24.0, top + 8.0 + 16.0 * i as f64), Text::new(SMALL).colour(AXIS))?;
    }
    c.finish()?;
    Ok(canvas::dress(&svg, size, &f.title))
}

fn heights(p: &Panel) -> Heights {
    let (_, legend) = legend(p);
    let (_, marks) = marks(p, &x_axis(p));
    Heights {
        title: if p.title.is_empty() { 0.0 } else { 22.0 },
        legend: legend as f64 * ROW,
        marks: marks as f64 * 15.0 + 6.0,
    }
}

/// Everything but the data area: rows above it, tick labels and axis label below it, a gap.
fn total(h: &Heights) -> f64 {
    h.title + h.legend + h.marks + 20.0 + 20.0 + 16.0
}

fn x_axis(p: &Panel) -> Axis {
    let range = p.x_range.or_else(|| extent(p.series.iter().flat_map(|s| s.xs.iter().copied())));
    Axis::linear(range.unwrap_or((0.0, 1.0)), (LEFT, RIGHT))
}

fn y_axis(p: &Panel, px: (f64, f64)) -> Axis {
    let range = y_range(p);
    if p.log_y { Axis::log(range.unwrap_or((0.1, 1.0)), px) } else { Axis::linear(range.unwrap_or((0.0, 1.0)), px) }
}

/// Range of y: the one that is set or that of the data inside the range of x, with a margin. `None` without data.
pub(super) fn y_range(p: &Panel) -> Option<(f64, f64)> {
    let shown = p.x_range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let inside = |x: f64| x >= shown.0 && x <= shown.1;
    let curves = p.series.iter().flat_map(|s| s.xs.iter().zip(&s.ys));
    let ranges = p.ranges.iter().flat_map(|r| r.xs.iter().zip(&r.low).chain(r.xs.iter().zip(&r.high)));
    let values = curves.chain(ranges).filter(|(x, _)| inside(**x)).map(|(_, y)| *y);
    if p.log_y {
        let data = extent(values.filter(|y| *y > 0.0)).map(|(lo, hi)| {
            // To whole decades, with room above the peaks.
            let top = (hi.log10() + 0.15).ceil();
            let floor = lo.log10().floor().max(top - LOG_DECADES);
            (10f64.powf(floor), 10f64.powf(top))
        });
        return p.y_range.or(data);
    }
    let data = extent(values).map(|(lo, hi)| (lo - 0.06 * (hi - lo), hi + 0.06 * (hi - lo)));
    p.y_range.or(data)
}

/// Place of series `i` in the palette.
pub(super) fn colour_index(s: &Series, i: usize) -> usize {
    s.colour.unwrap_or(i)
}

/// Whether a curve is flat at zero on the scale of its panel.
pub(super) fn is_zero(p: &Panel, s: &Series) -> bool {
    let size = |s: &Series| s.ys.iter().fold(0.0, |a: f64, y| a.max(y.abs()));
    let largest = p.series.iter().map(size).fold(0.0, f64::max);
    !p.log_y && p.series.len() > 1 && !s.ys.is_empty() && size(s) <= ZERO * largest
}

/// Curves nearer to each other than this share of the largest of their panel cannot be told apart.
const SAME: f64 = 2e-3;

/// Whether a curve lies upon an earlier one all along, which it would hide.
pub(super) fn covers(p: &Panel, i: usize) -> bool {
    let s = &p.series[i];
    let size = p.series.iter().flat_map(|s| &s.ys).fold(0.0, |a: f64, y| a.max(y.abs()));
    let near = |o: &Series| o.ys.iter().zip(&s.ys).all(|(a, b)| (a - b).abs() <= SAME * size);
    let earlier = p.series[..i].iter().filter(|o| !o.dashed && !is_zero(p, o) && o.xs == s.xs);
    !p.log_y && s.ys.len() > 1 && !is_zero(p, s) && earlier.into_iter().any(near)
}

/// Label of a curve in the legend. One that is zero cannot be found by its colour under the others, so that it is named.
fn shown_label(p: &Panel, i: usize) -> String {
    let s = &p.series[i];
    if !s.label.is_empty() && is_zero(p, s) { format!("{} (zero)", s.label) } else { s.label.clone() }
}

/// Colour and dashing of series `i`.
fn look(p: &Panel, i: usize) -> (RGBColor, bool) {
    let s = &p.series[i];
    let k = colour_index(s, i);
    (PALETTE[k % PALETTE.len()], s.dashed || covers(p, i) || k / PALETTE.len() % 2 == 1)
}

/// Entries of the legend with their places: series first, then bands; what has no label has no entry.
fn legend(p: &Panel) -> (Vec<Entry>, usize) {
    let series = (0..p.series.len()).map(|i| (shown_label(p, i), Some(i)));
    let bands = p.bands.iter().map(|b| (b.label.clone(), None));
    let named: Vec<(String, Option<usize>)> = series.chain(bands).filter(|(l, _)| !l.is_empty()).collect();
    let widths: Vec<f64> = named.iter().map(|(l, _)| 30.0 + text_width(l, FONT)).collect();
    let (at, rows) = flow(&widths, 18.0, LEFT, RIGHT);
    (named.into_iter().zip(at).map(|((l, i), at)| (l, i, at)).collect(), rows)
}

/// A marked line inside the axis: its pixel, and the row and middle of its name.
type Mark<'a> = (&'a VLine, f64, (usize, f64));

/// The marked lines inside the axis, and the rows that their names take.
fn marks<'a>(p: &'a Panel, x: &Axis) -> (Vec<Mark<'a>>, usize) {
    let inside = |v: &'a VLine| x.px(v.x).filter(|px| (LEFT..=RIGHT).contains(px)).map(|px| (v, px));
    let lines: Vec<(&VLine, f64)> = p.vlines.iter().filter_map(inside).collect();
    let items: Vec<(f64, f64)> = lines.iter().map(|(v, px)| (*px, text_width(&v.label, SMALL))).collect();
    let (at, rows) = stagger(&items, 10.0, LEFT, RIGHT);
    // Lines without a name need no row for it.
    let rows = if lines.iter().all(|(v, _)| v.label.is_empty()) { 0 } else { rows };
    (lines.into_iter().zip(at).map(|((v, px), at)| (v, px, at)).collect(), rows)
}

fn panel(c: &mut Canvas<'_>, p: &Panel, top: f64) -> Result<()> {
    let h = heights(p);
    let frame_top = top + h.title + h.legend + h.marks;
    let frame = Frame { left: LEFT, top: frame_top, right: RIGHT, bottom: frame_top + p.height };
    let x = x_axis(p);
    let y = y_axis(p, (frame.bottom, frame.top));
    if !p.title.is_empty() {
        c.text(&p.title, (LEFT, top + 10.0), Text::new(13.5).bold())?;
    }
    draw_legend(c, p, top + h.title)?;
    for b in &p.bands {
        if let (Some(l), Some(r)) = (x.px(b.from), x.px(b.to)) {
            let clamp = |v: f64| v.clamp(frame.left, frame.right);
            c.fill((clamp(l), frame.top), (clamp(r), frame.bottom), SHADE)?;
        }
    }
    for r in &p.ranges {
        area(c, r, &x, &y, &frame)?;
    }
    axes(c, p, &x, &y, &frame)?;
    draw_marks(c, p, &x, &frame)?;
    // Curves that are zero first: later ones are drawn over them.
    let (zero, others): (Vec<usize>, Vec<usize>) = (0..p.series.len()).partition(|&i| is_zero(p, &p.series[i]));
    for i in zero.into_iter().chain(others) {
        let (s, (colour, dashed)) = (&p.series[i], look(p, i));
        let points = s.xs.iter().zip(&s.ys).map(|(&u, &v)| Some((x.px(u)?, y.px(v)?)));
        for run in visible(points, &frame) {
            if dashed {
                for d in dashes(&run, 7.0, 4.0) {
                    c.path(&d, colour, 1.5)?;
                }
            } else {
                c.path(&run, colour, 1.5)?;
            }
        }
    }
    // The frame last, over the ends of curves and grid.
    let (l, r, t, b) = (frame.left, frame.right, frame.top, frame.bottom);
    c.path(&[(l, t), (r, t), (r, b), (l, b), (l, t)], AXIS, 1.0)
}

/// The area between two curves.
fn area(c: &mut Canvas<'_>, r: &Range, x: &Axis, y: &Axis, f: &Frame) -> Result<()> {
    let at = |u: &f64, v: &f64| {
        let inside = |p: (f64, f64)| (p.0.clamp(f.left, f.right), p.1.clamp(f.top, f.bottom));
        Some(inside((x.px(*u)?, y.px(*v)?)))
    };
    let there = r.xs.iter().zip(&r.high).filter_map(|(u, v)| at(u, v));
    let back = r.xs.iter().zip(&r.low).rev().filter_map(|(u, v)| at(u, v));
    let corners: Vec<(f64, f64)> = there.chain(back).collect();
    if corners.len() < 3 { Ok(()) } else { c.area(&corners, pale(PALETTE[r.colour % PALETTE.len()])) }
}

fn axes(c: &mut Canvas<'_>, p: &Panel, x: &Axis, y: &Axis, f: &Frame) -> Result<()> {
    let (xs, x_exp) = x.ticks(90.0);
    let (ys, y_exp) = y.ticks(36.0);
    for t in &xs {
        c.line((t.at, f.top), (t.at, f.bottom), GRID, 1.0)?;
        c.line((t.at, f.bottom), (t.at, f.bottom + 4.0), AXIS, 1.0)?;
        c.text(&t.label, (t.at, f.bottom + 14.0), Text::new(SMALL).anchor(HPos::Center))?;
    }
    for t in &ys {
        c.line((f.left, t.at), (f.right, t.at), if t.label.is_empty() { MINOR } else { GRID }, 1.0)?;
        if !t.label.is_empty() {
            c.line((f.left - 4.0, t.at), (f.left, t.at), AXIS, 1.0)?;
            c.text(&t.label, (f.left - 8.0, t.at), Text::new(SMALL).anchor(HPos::Right))?;
        }
    }
    let middle = (f.left + f.right) / 2.0;
    c.text(&with_power(&p.x_label, x_exp), (middle, f.bottom + 32.0), Text::new(FONT).anchor(HPos::Center))?;
    let middle = (f.top + f.bottom) / 2.0;
    c.text(&with_power(&p.y_label, y_exp), (22.0, middle), Text::new(FONT).anchor(HPos::Center).upright())
}

/// `rate (rad/s)` and -4 make `rate (10⁻⁴ rad/s)`.
fn with_power(label: &str, exp: i32) -> String {
    let label = &typeset(label);
    let power = format!("10{}", superscript(exp));
    match label.rfind(" (") {
        _ if exp == 0 => label.to_owned(),
        Some(i) => format!("{} ({power} {}", &label[..i], &label[i + 2..]),
        None => format!("{label} ({power})"),
    }
}

fn draw_legend(c: &mut Canvas<'_>, p: &Panel, top: f64) -> Result<()> {
    for (label, series, (row, left)) in legend(p).0 {
        let mid = top + ROW * row as f64 + ROW / 2.0 - 2.0;
        if let Some(i) = series {
            let (colour, dashed) = look(p, i);
            let sample = [(left, mid), (left + 22.0, mid)];
            for run in if dashed { dashes(&sample, 6.0, 3.0) } else { vec![sample.to_vec()] } {
                c.path(&run, colour, 2.5)?;
            }
        } else {
            c.fill((left, mid - 5.0), (left + 22.0, mid + 5.0), SHADE)?;
        }
        c.text(&label, (left + 28.0, mid), Text::new(FONT))?;
    }
    Ok(())
}

fn draw_marks(c: &mut Canvas<'_>, p: &Panel, x: &Axis, f: &Frame) -> Result<()> {
    let (lines, _) = marks(p, x);
    let label_y = |row: usize| f.top - 10.0 - 15.0 * row as f64;
    let colour = |v: &VLine| v.colour.map_or(MARK, |k| PALETTE[k % PALETTE.len()]);
    for (v, px, (row, _)) in &lines {
        let run = [(*px, f.top), (*px, f.bottom)];
        for d in if v.solid { vec![run.to_vec()] } else { dashes(&run, 5.0, 3.0) } {
            c.path(&d, colour(v), 1.2)?;
        }
        // A leader from the label down to its line.
        if !v.label.is_empty() {
            c.line((*px, label_y(*row) + 6.0), (*px, f.top), colour(v), 0.6)?;
        }
    }
    for (v, _, (row, middle)) in lines.into_iter().filter(|l| !l.0.label.is_empty()) {
        // White behind the text hides the leaders of labels in higher rows.
        let (half, mid) = (0.5 * text_width(&v.label, SMALL) + 2.0, label_y(row));
        c.fill((middle - half, mid - 6.5), (middle + half, mid + 6.5), WHITE)?;
        c.text(&v.label, (middle, mid), Text::new(SMALL).anchor(HPos::Center).colour(colour(v)))?;
    }
    Ok(())
}
