//! Colours and sizes of letters.

use plotters::prelude::RGBColor;

/// Okabe and Ito's colours that carry on white, blue first; the ninth series starts again, dashed.
pub(super) const PALETTE: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(40, 40, 40),
    RGBColor(128, 94, 40),
];
pub(super) const GRID: RGBColor = RGBColor(226, 226, 226);
pub(super) const MINOR: RGBColor = RGBColor(240, 240, 240);
pub(super) const AXIS: RGBColor = RGBColor(90, 90, 90);
pub(super) const MARK: RGBColor = RGBColor(110, 110, 110);
pub(super) const WHITE: RGBColor = RGBColor(255, 255, 255);
pub(super) const FONT: f64 = 12.5;
pub(super) const SMALL: f64 = 11.5;

/// A colour between itself and white.
pub(super) fn pale(c: RGBColor) -> RGBColor {
    let mix = |x: u8| (0.3 * f64::from(x) + 0.7 * 255.0) as u8;
    RGBColor(mix(c.0), mix(c.1), mix(c.2))
}
