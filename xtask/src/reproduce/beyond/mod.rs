//! Three experiments that the paper does not do: panels and fuel at once, sensors with biases and a delay, and the fill level
//! followed over a sequence of records.

mod filling;
mod sensors;
mod together;

pub(super) use filling::{Filling, Level};
pub(super) use sensors::{SensorFit, Sensors, Unknown};
pub(super) use together::{ModelFit, Together};

use super::identify::Row;
use super::system::{Source, System};
use ff_dynamics::motion::bspline::BSplineMotion;
use indicatif::ProgressBar;
use serde::Serialize;
use std::path::Path;

/// Seed of noise, starts and motions.
const SEED: u64 = 25;

/// The experiments.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Beyond {
    pub(super) together: Together,
    pub(super) sensors: Sensors,
    pub(super) filling: Filling,
}

impl Beyond {
    /// Runs them on the missions of a folder.
    ///
    /// # Errors
    /// Missions that cannot be read; fits that give nothing.
    pub(super) fn run(folder: &Path, quick: bool, bar: &ProgressBar) -> anyhow::Result<Self> {
        let (combined, slosh) =
            (Source::read(&folder.join("combined.toml"))?, Source::read(&folder.join("slosh.toml"))?);
        bar.set_message("panels and fuel at once");
        let s = combined.with(quick, |_| ())?;
        let motion = lively(&s)?;
        let run = || Together::run(&combined, &s, &motion);
        let (together, sensors) = rayon::join(run, || Sensors::run(&s, &motion));
        bar.set_message("fill level over a sequence");
        Ok(Self { together: together?, sensors: sensors?, filling: Filling::run(&slosh.with(quick, |_| ())?)? })
    }
}

/// Control points per second and joint of the motion: splines reach half as many oscillations in a second, and the highest mode is at 0.68 Hz.
const POINTS_PER_S: f64 = 1.4;
/// Part of the length that a quick run has.
const QUICK: f64 = 0.6;

/// A random motion at the limits that reaches the modes.
fn lively(s: &System) -> anyhow::Result<BSplineMotion> {
    let seconds = s.identification_s() * if s.quick { QUICK } else { 1.0 };
    s.random(seconds, (POINTS_PER_S * seconds).round() as usize, SEED)
}

/// The estimate that is furthest from the truth in its stated deviations, and by how many.
fn furthest(rows: &[Row]) -> (String, f64) {
    let far = |r: &Row| r.std.map_or(0.0, |s| (r.value - r.truth).abs() / s);
    let worst = rows.iter().max_by(|a, b| far(a).total_cmp(&far(b)));
    worst.map_or_else(|| (String::new(), 0.0), |r| (r.name.clone(), far(r)))
}
