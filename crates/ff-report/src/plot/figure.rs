//! A figure as data: panels of curves, intervals, correlations, draws.

use super::corner::Corner;
use super::heat::Heat;
use super::intervals::Intervals;
use ffid::exit::Failure;

/// Width of every figure (px of the SVG; the PNG has twice as many).
pub const WIDTH: f64 = 960.0;

/// A figure: title, panels from top to bottom, caption.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// Title above everything.
    pub title: String,
    /// Draws of several quantities in pairs, above the panels.
    pub corner: Option<Corner>,
    /// Intervals on one scale, above the panels.
    pub intervals: Option<Intervals>,
    /// Correlations, above the panels.
    pub heat: Option<Heat>,
    /// Panels from top to bottom.
    pub panels: Vec<Panel>,
    /// Text below everything, wrapped to the width; empty for none.
    pub caption: String,
}

/// One pair of axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Heading of the panel, such as `A) response of the flexible appendages`; empty for none.
    pub title: String,
    /// Label with unit, such as `time (s)`.
    pub x_label: String,
    /// Label with unit.
    pub y_label: String,
    /// Range of x; that of the data unless set.
    pub x_range: Option<(f64, f64)>,
    /// Range of y; that of the data with a margin unless set.
    pub y_range: Option<(f64, f64)>,
    /// Logarithmic y, for spectra. Values that are not positive are left out; without `y_range` at most
    /// [`LOG_DECADES`] decades below the maximum are shown.
    pub log_y: bool,
    /// Height of the data area (px).
    pub height: f64,
    /// Curves.
    pub series: Vec<Series>,
    /// Marked abscissae with their names, such as `model 0.231 Hz`.
    pub vlines: Vec<VLine>,
    /// Shaded intervals of x.
    pub bands: Vec<Band>,
    /// Areas between two curves, behind the others.
    pub ranges: Vec<Range>,
}

/// Most decades a logarithmic axis shows of its own accord.
pub const LOG_DECADES: f64 = 10.0;

/// One curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; empty for no entry.
    pub label: String,
    /// Abscissae, ascending.
    pub xs: Vec<f64>,
    /// Ordinates.
    pub ys: Vec<f64>,
    /// Dashed rather than solid.
    pub dashed: bool,
    /// Place in the palette; that of the series in its panel unless set.
    pub colour: Option<usize>,
}

/// The area between two curves: an interval at every abscissa.
#[derive(Clone, Debug, PartialEq)]
pub struct Range {
    /// Abscissae, ascending.
    pub xs: Vec<f64>,
    /// Lower ends.
    pub low: Vec<f64>,
    /// Upper ends.
    pub high: Vec<f64>,
    /// Place in the palette; drawn pale.
    pub colour: usize,
}

/// A vertical line at `x` with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct VLine {
    /// Where.
    pub x: f64,
    /// Its name, drawn above the data area.
    pub label: String,
    /// Place in the palette; grey unless set.
    pub colour: Option<usize>,
    /// Solid rather than dashed.
    pub solid: bool,
}

/// A shaded interval of x with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// From.
    pub from: f64,
    /// To.
    pub to: f64,
    /// Name in the legend; empty for none.
    pub label: String,
}

impl Figure {
    /// A figure without panels.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }
    /// Adds a panel below the others.
    #[must_use]
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }
    /// Sets the intervals.
    #[must_use]
    pub fn intervals(mut self, intervals: Intervals) -> Self {
        self.intervals = Some(intervals);
        self
    }
    /// Sets the correlations.
    #[must_use]
    pub fn heat(mut self, heat: Heat) -> Self {
        self.heat = Some(heat);
        self
    }
    /// Sets the caption.
    #[must_use]
    pub fn caption(mut self, text: impl Into<String>) -> Self {
        self.caption = text.into();
        self
    }
    pub(super) fn check(&self) -> Result<(), Failure> {
        for (name, values) in self.corner.iter().flat_map(|c| c.names.iter().zip(&c.draws)) {
            if let Some(i) = values.iter().position(|v| !v.is_finite()) {
                let place = format!("figure '{}', draws of '{name}': sample {i}", self.title);
                return Err(Failure::NotFinite { place, value: values[i].to_string() });
            }
        }
        if let Some((name, x)) = self.intervals.iter().flat_map(Intervals::numbers).find(|(_, x)| !x.is_finite()) {
            return Err(Failure::NotFinite {
                place: format!("figure '{}', row '{name}'", self.title),
                value: x.to_string(),
            });
        }
        for (name, row) in self.heat.iter().flat_map(|h| h.names.iter().zip(&h.rows)) {
            if let Some(x) = row.iter().find(|x| !x.is_finite()) {
                let place = format!("figure '{}', correlations of '{name}'", self.title);
                return Err(Failure::NotFinite { place, value: x.to_string() });
            }
        }
        for r in self.panels.iter().flat_map(|p| &p.ranges) {
            let place = format!("figure '{}', shaded area", self.title);
            if r.low.len() != r.xs.len() || r.high.len() != r.xs.len() {
                return Err(Failure::Length { place, left: r.xs.len(), right: r.low.len().min(r.high.len()) });
            }
            if let Some(x) = r.xs.iter().chain(&r.low).chain(&r.high).find(|x| !x.is_finite()) {
                return Err(Failure::NotFinite { place, value: x.to_string() });
            }
        }
        for s in self.panels.iter().flat_map(|p| &p.series) {
            let place = format!("figure '{}', series '{}'", self.title, s.label);
            if s.xs.len() != s.ys.len() {
                return Err(Failure::Length { place, left: s.xs.len(), right: s.ys.len() });
            }
            for (axis, values) in [("x", &s.xs), ("y", &s.ys)] {
                if let Some(i) = values.iter().position(|v| !v.is_finite()) {
                    let place = format!("{place}: {axis} of sample {i}");
                    return Err(Failure::NotFinite { place, value: values[i].to_string() });
                }
            }
        }
        Ok(())
    }
}

impl Panel {
    /// Empty linear axes.
    pub fn new(x_label: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self {
            title: String::new(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            x_range: None,
            y_range: None,
            log_y: false,
            height: 240.0,
            series: Vec::new(),
            vlines: Vec::new(),
            bands: Vec::new(),
            ranges: Vec::new(),
        }
    }
    /// Empty axes with a logarithmic ordinate.
    pub fn log_y(x_label: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self { log_y: true, ..Self::new(x_label, y_label) }
    }
    /// Sets the heading.
    #[must_use]
    pub fn titled(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }
    /// Adds a curve.
    #[must_use]
    pub fn curve(mut self, label: impl Into<String>, xs: &[f64], ys: &[f64]) -> Self {
        self.series.push(Series::new(label, xs, ys));
        self
    }
    /// Adds a dashed vertical line.
    #[must_use]
    pub fn vline(mut self, x: f64, label: impl Into<String>) -> Self {
        self.vlines.push(VLine { x, label: label.into(), colour: None, solid: false });
        self
    }
    /// Shades an interval of x.
    #[must_use]
    pub fn band(mut self, from: f64, to: f64, label: impl Into<String>) -> Self {
        self.bands.push(Band { from, to, label: label.into() });
        self
    }
    /// Shades the area between two curves over the same abscissae.
    #[must_use]
    pub fn range(mut self, xs: &[f64], low: &[f64], high: &[f64], colour: usize) -> Self {
        self.ranges.push(Range { xs: xs.to_vec(), low: low.to_vec(), high: high.to_vec(), colour });
        self
    }
    /// Sets the range of x.
    #[must_use]
    pub fn x_range(mut self, from: f64, to: f64) -> Self {
        self.x_range = Some((from, to));
        self
    }
    /// Sets the range of y.
    #[must_use]
    pub fn y_range(mut self, from: f64, to: f64) -> Self {
        self.y_range = Some((from, to));
        self
    }
}

impl Series {
    /// A solid curve.
    pub fn new(label: impl Into<String>, xs: &[f64], ys: &[f64]) -> Self {
        Self { label: label.into(), xs: xs.to_vec(), ys: ys.to_vec(), dashed: false, colour: None }
    }
    /// The same curve dashed.
    #[must_use]
    pub fn dashed(mut self) -> Self {
        self.dashed = true;
        self
    }
    /// The same curve in colour `i` of the palette, to match another series.
    #[must_use]
    pub fn colour(mut self, i: usize) -> Self {
        self.colour = Some(i);
        self
    }
}
