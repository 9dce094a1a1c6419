//! Lines, rectangles and text on an SVG through plotters' backend, in fractional pixels.

use super::polyline::Point;
use plotters::backend::SVGBackend;
use plotters::prelude::{Color, DrawingBackend, FontStyle, FontTransform, IntoFont, RGBColor, ShapeStyle, TextStyle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters_backend::{BackendCoord, DrawingErrorKind};

/// Family of every text; the PNG renderer has it built in, browsers may fall back to their own.
pub(super) const FAMILY: &str = "DejaVu Sans, Verdana, sans-serif";

/// Canvas units per pixel: plotters' SVG coordinates are integers.
const UNITS: f64 = 8.0;
/// plotters divides the font size by this number when it writes SVG.
const PLOTTERS_FONT_FACTOR: f64 = 1.24;

/// What the backend reports.
pub(super) type Result<T> = core::result::Result<T, DrawingErrorKind<std::io::Error>>;

/// A drawing of `size` pixels under construction.
pub(super) struct Canvas<'a> {
    backend: SVGBackend<'a>,
}

/// Where text sits relative to its point, and how it looks.
#[derive(Clone, Copy)]
pub(super) struct Text {
    pub(super) size: f64,
    pub(super) colour: RGBColor,
    pub(super) bold: bool,
    pub(super) anchor: HPos,
    pub(super) upright: bool,
}

impl Text {
    /// Dark, left-aligned, `size` pixels high.
    pub(super) fn new(size: f64) -> Self {
        Self { size, colour: RGBColor(40, 40, 40), bold: false, anchor: HPos::Left, upright: false }
    }
    pub(super) fn anchor(self, anchor: HPos) -> Self {
        Self { anchor, ..self }
    }
    pub(super) fn colour(self, colour: RGBColor) -> Self {
        Self { colour, ..self }
    }
    pub(super) fn bold(self) -> Self {
        Self { bold: true, ..self }
    }
    /// Reading upwards, for the label of a vertical axis.
    pub(super) fn upright(self) -> Self {
        Self { upright: true, ..self }
    }
}

fn units(v: f64) -> i32 {
    (v * UNITS).round() as i32
}

fn at(p: Point) -> BackendCoord {
    (units(p.0), units(p.1))
}

impl<'a> Canvas<'a> {
    /// Starts a drawing of `width` x `height` pixels in `buffer`.
    pub(super) fn new(buffer: &'a mut String, (width, height): (f64, f64)) -> Self {
        let size = (units(width).unsigned_abs(), units(height).unsigned_abs());
        Self { backend: SVGBackend::with_string(buffer, size) }
    }
    pub(super) fn path(&mut self, run: &[Point], colour: RGBColor, width: f64) -> Result<()> {
        let style = ShapeStyle { color: colour.to_rgba(), filled: false, stroke_width: units(width).unsigned_abs() };
        self.backend.draw_path(run.iter().map(|&p| at(p)), &style)
    }
    pub(super) fn line(&mut self, a: Point, b: Point, colour: RGBColor, width: f64) -> Result<()> {
        let style = ShapeStyle { color: colour.to_rgba(), filled: false, stroke_width: units(width).unsigned_abs() };
        self.backend.draw_line(at(a), at(b), &style)
    }
    pub(super) fn fill(&mut self, a: Point, b: Point, colour: RGBColor) -> Result<()> {
        self.backend.draw_rect(at(a), at(b), &colour.to_rgba(), true)
    }
    /// A disc of radius `r` (px).
    pub(super) fn dot(&mut self, p: Point, r: f64, colour: RGBColor) -> Result<()> {
        let style = ShapeStyle { color: colour.to_rgba(), filled: true, stroke_width: 0 };
        self.backend.draw_circle(at(p), units(r).unsigned_abs(), &style, true)
    }
    /// A filled polygon.
    pub(super) fn area(&mut self, corners: &[Point], colour: RGBColor) -> Result<()> {
        let style = ShapeStyle { color: colour.to_rgba(), filled: true, stroke_width: 0 };
        self.backend.fill_polygon(corners.iter().map(|&p| at(p)), &style)
    }
    /// Text whose vertical middle is at `p`.
    pub(super) fn text(&mut self, text: &str, p: Point, look: Text) -> Result<()> {
        let font = (FAMILY, look.size * UNITS * PLOTTERS_FONT_FACTOR).into_font();
        let font = if look.bold { font.style(FontStyle::Bold) } else { font };
        let font = if look.upright { font.transform(FontTransform::Rotate270) } else { font };
        let style = TextStyle {
            font,
            color: look.colour.to_backend_color(),
            pos: Pos { h_pos: look.anchor, v_pos: VPos::Bottom },
        };
        // The backend's offsets count in ex, which renderers measure differently; anchoring at the bottom
        // and shifting by a fixed share of the size puts the middle of the capitals on the point.
        let shift = look.size * (0.36 + 0.27);
        let p = if look.upright { (p.0 + shift, p.1) } else { (p.0, p.1 + shift) };
        self.backend.draw_text(text, &style, at(p))
    }
    /// Closes the drawing.
    pub(super) fn finish(mut self) -> Result<()> {
        self.backend.present()
    }
}

/// Adds what the backend cannot: size in pixels rather than units, round joins, and a title for readers.
pub(super) fn dress(svg: &str, (width, height): (f64, f64), title: &str) -> String {
    let body = svg.split_once('>').map_or("", |(_, body)| body);
    let title = title.replace('&', "&amp;").replace('<', "&lt;");
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {} {}\" \
         stroke-linejoin=\"round\">\n<title>{title}</title>{body}",
        units(width),
        units(height)
    )
}
