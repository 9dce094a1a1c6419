//! A corner plot: histograms of draws on the diagonal, densities of pairs below it, and the normal distribution of a fit over both.

use super::canvas::{Canvas, Result, Text};
use plotters::prelude::RGBColor;
use plotters::style::text_anchor::HPos;

/// Bins of a histogram, and of each side of the density of a pair.
const BINS: usize = 24;
/// Largest side of a cell (px).
const CELL: f64 = 150.0;
/// Between cells (px).
const GAP: f64 = 8.0;
/// Room for the names and ranges below the last row.
const FOOT: f64 = 44.0;
const LEFT: f64 = 60.0;
const FRAME: RGBColor = RGBColor(150, 150, 150);
const DRAWS: RGBColor = RGBColor(0, 114, 178);
const FIT: RGBColor = RGBColor(213, 94, 0);
/// Radius of the ellipse that holds 95 % of a normal density of two dimensions: the square root of 5.991.
const RADIUS95: f64 = 2.447_747;

/// Draws of some quantities against the normal distribution of a fit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Corner {
    /// Names with units.
    pub names: Vec<String>,
    /// Draws of each.
    pub draws: Vec<Vec<f64>>,
    /// Where the fit has ended.
    pub centre: Vec<f64>,
    /// Its covariance, row by row.
    pub covariance: Vec<Vec<f64>>,
}

impl Corner {
    fn side(&self, width: f64) -> f64 {
        let n = self.names.len().max(1) as f64;
        CELL.min((width - LEFT - 24.0 - GAP * (n - 1.0)) / n)
    }
    /// Height of the drawing.
    pub(super) fn height(&self, width: f64) -> f64 {
        self.names.len() as f64 * (self.side(width) + GAP) + FOOT
    }
    /// From the least to the greatest draw, and as far as the ellipse of the fit.
    fn range(&self, k: usize) -> (f64, f64) {
        let reach = 1.05 * RADIUS95 * self.covariance[k][k].max(0.0).sqrt();
        let of_fit = (self.centre[k] - reach, self.centre[k] + reach);
        self.draws[k].iter().fold(of_fit, |(a, b), x| (a.min(*x), b.max(*x)))
    }
    fn bin(x: f64, (lo, hi): (f64, f64)) -> usize {
        (((x - lo) / (hi - lo) * BINS as f64) as usize).min(BINS - 1)
    }
    pub(super) fn draw(&self, c: &mut Canvas<'_>, top: f64, width: f64) -> Result<()> {
        let (n, side) = (self.names.len(), self.side(width));
        let at = |k: usize| (side + GAP) * k as f64;
        for row in 0..n {
            for column in 0..=row {
                let (x, y) = (LEFT + at(column), top + at(row));
                if row == column {
                    self.histogram(c, row, (x, y), side)?;
                } else {
                    self.pair(c, (column, row), (x, y), side)?;
                }
                let (a, b) = ((x, y), (x + side, y + side));
                c.path(&[a, (b.0, a.1), b, (a.0, b.1), a], FRAME, 0.6)?;
            }
            c.text(&self.names[row], (LEFT + at(row) + 4.0, top + at(row) - 1.0 + 8.0), Text::new(10.5).bold())?;
        }
        let bottom = top + at(n) - GAP;
        for k in 0..n {
            let (lo, hi) = self.range(k);
            let x = LEFT + at(k);
            c.text(&ffid::workflow::identify::num(lo), (x, bottom + 12.0), Text::new(9.0))?;
            c.text(&ffid::workflow::identify::num(hi), (x + side, bottom + 26.0), Text::new(9.0).anchor(HPos::Right))?;
        }
        Ok(())
    }
    fn histogram(&self, c: &mut Canvas<'_>, k: usize, (x, y): (f64, f64), side: f64) -> Result<()> {
        let range = self.range(k);
        let mut counts = [0.0f64; BINS];
        self.draws[k].iter().for_each(|v| counts[Self::bin(*v, range)] += 1.0);
        let bin = (range.1 - range.0) / BINS as f64;
        let std = self.covariance[k][k].max(0.0).sqrt();
        let total = self.draws[k].len() as f64;
        let normal = |v: f64| {
            let u = (v - self.centre[k]) / std;
            total * bin * (-0.5 * u * u).exp() / (std * core::f64::consts::TAU.sqrt())
        };
        let highest = counts.iter().copied().fold(normal(self.centre[k]), f64::max).max(1.0);
        let up = |v: f64| y + side - 0.85 * side * v / highest;
        let step = side / BINS as f64;
        let mut steps = vec![(x, y + side)];
        for (i, n) in counts.iter().enumerate() {
            steps.extend([(x + step * i as f64, up(*n)), (x + step * (i + 1) as f64, up(*n))]);
        }
        steps.push((x + side, y + side));
        c.path(&steps, DRAWS, 1.2)?;
        if std > 0.0 {
            let curve: Vec<(f64, f64)> = (0..=4 * BINS)
                .map(|i| {
                    let part = i as f64 / (4 * BINS) as f64;
                    (x + part * side, up(normal(range.0 + part * (range.1 - range.0))))
                })
                .collect();
            c.path(&curve, FIT, 1.2)?;
        }
        Ok(())
    }
    fn pair(&self, c: &mut Canvas<'_>, (i, j): (usize, usize), (x, y): (f64, f64), side: f64) -> Result<()> {
        let (across, up) = (self.range(i), self.range(j));
        let mut counts = vec![0usize; BINS * BINS];
        for (a, b) in self.draws[i].iter().zip(&self.draws[j]) {
            counts[Self::bin(*b, up) * BINS + Self::bin(*a, across)] += 1;
        }
        let most = counts.iter().copied().max().unwrap_or(1).max(1) as f64;
        let step = side / BINS as f64;
        for (k, n) in counts.iter().enumerate().filter(|(_, n)| **n > 0) {
            let (column, row) = ((k % BINS) as f64, (k / BINS) as f64);
            // Light where there is one draw, full where there are most.
            let part = 0.15 + 0.85 * *n as f64 / most;
            let mix = |full: u8| (255.0 - part * (255.0 - f64::from(full))) as u8;
            let (left, bottom) = (x + step * column, y + side - step * row);
            c.fill((left, bottom - step), (left + step, bottom), RGBColor(mix(DRAWS.0), mix(DRAWS.1), mix(DRAWS.2)))?;
        }
        // The ellipse by the factor of the covariance of two, cut where it leaves the cell.
        let (p, q, r) = (self.covariance[i][i], self.covariance[i][j], self.covariance[j][j]);
        if p <= 0.0 {
            return Ok(());
        }
        let (l, m, o) = (p.sqrt(), q / p.sqrt(), (r - q * q / p).max(0.0).sqrt());
        let mut run: Vec<(f64, f64)> = Vec::new();
        for k in 0..=72 {
            let (sin, cos) = (core::f64::consts::TAU * f64::from(k) / 72.0).sin_cos();
            let (a, b) = (self.centre[i] + RADIUS95 * l * cos, self.centre[j] + RADIUS95 * (m * cos + o * sin));
            let u = (a - across.0) / (across.1 - across.0);
            let v = (b - up.0) / (up.1 - up.0);
            if (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v) {
                run.push((x + u * side, y + side - v * side));
            } else if run.len() > 1 {
                c.path(&run, FIT, 1.2)?;
                run.clear();
            } else {
                run.clear();
            }
        }
        if run.len() > 1 { c.path(&run, FIT, 1.2) } else { Ok(()) }
    }
}
