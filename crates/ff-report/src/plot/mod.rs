//! Figures: declared as data, drawn as SVG (plotters) and PNG (resvg), with the font built in.
//!
//! A [`Figure`] is a column of [`Panel`]s. Legends and the names of marked lines sit outside the data
//! area, colours come from the colour-blind-safe palette of Okabe and Ito in order, and curves are
//! reduced to what the eye can see, so that an SVG stays small however long the record.
//!
//! ```no_run
//! use ff_report::plot::{Figure, Panel, Series};
//! # let (t, tau) = (vec![0.0, 1.0], vec![0.0, 1.0]);
//! let mut torque = Panel::new("time (s)", "joint torque (N m)");
//! torque.series.push(Series::new("joint 2", &t, &tau));
//! Figure::new("Free response").panel(torque).write("target/reproduce/fig4".as_ref())?;
//! # Ok::<(), ffid::exit::Failure>(())
//! ```
pub(crate) mod canvas;
pub(crate) mod corner;
pub(crate) mod draw;
mod figure;
pub(crate) mod heat;
pub(crate) mod intervals;
mod json;
pub(crate) mod layout;
pub(crate) mod polyline;
pub(crate) mod raster;
pub(crate) mod scale;
mod style;
#[cfg(test)]
pub(crate) mod tests;

pub use corner::Corner;
pub use figure::{Band, Figure, LOG_DECADES, Panel, Range, Series, VLine, WIDTH};
pub use heat::Heat;
pub use intervals::{Interval, Intervals};
pub(crate) use scale::typeset;

use ffid::exit::Failure;
use ffid::files::atomic;
use std::path::{Path, PathBuf};

/// Width of a figure on a phone (px).
const NARROW: f64 = 380.0;

impl Figure {
    /// The figure as SVG text.
    ///
    /// # Errors
    /// [`Failure::NotFinite`] or [`Failure::Length`] naming the series.
    pub fn to_svg(&self) -> Result<String, Failure> {
        self.svg(WIDTH)
    }
    /// The figure as SVG for a phone: charts are drawn anew for its width, and letters keep their size. `None` where there are panels or
    /// squares, which take the room of a desk.
    ///
    /// # Errors
    /// Those of [`Figure::to_svg`].
    pub(crate) fn to_narrow_svg(&self) -> Result<Option<String>, Failure> {
        let fits = self.panels.is_empty() && self.corner.is_none() && self.heat.is_none();
        fits.then(|| self.svg(NARROW)).transpose()
    }
    fn svg(&self, width: f64) -> Result<String, Failure> {
        self.check()?;
        draw::figure(self, width).map_err(|e| Failure::Numerical(format!("figure '{}': {e}", self.title)))
    }
    /// The figure as JSON for the scripts of a page: panels with their curves, each thinned to about `points` points that keep least and
    /// greatest values. Allocates.
    pub fn to_json(&self, points: usize) -> String {
        json::figure(self, points)
    }
    /// Writes `stem.svg` and `stem.png`, each whole or not at all, and returns their paths.
    ///
    /// # Errors
    /// Those of [`Figure::to_svg`], and [`Failure::Io`].
    pub fn write(&self, stem: &Path) -> Result<[PathBuf; 2], Failure> {
        let svg = self.to_svg()?;
        let png = raster::png(&svg).map_err(|e| Failure::Numerical(format!("figure '{}': {e}", self.title)))?;
        let paths = ["svg", "png"].map(|ext| {
            let mut name = stem.as_os_str().to_owned();
            name.push(format!(".{ext}"));
            PathBuf::from(name)
        });
        atomic::write(&paths[0], svg.as_bytes())?;
        atomic::write(&paths[1], &png)?;
        Ok(paths)
    }

    /// Writes `stem.svg` alone.
    ///
    /// # Errors
    /// Those of [`Figure::to_svg`], and [`Failure::Io`].
    pub fn write_svg(&self, stem: &Path) -> Result<PathBuf, Failure> {
        let mut name = stem.as_os_str().to_owned();
        name.push(".svg");
        atomic::write(Path::new(&name), self.to_svg()?.as_bytes())?;
        Ok(PathBuf::from(name))
    }
}
