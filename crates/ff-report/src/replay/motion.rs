//! A simulated motion, thinned and packed.

use super::mass::{self, Ellipsoids, Knowledge};
use crate::packed::singles;
use ff_dynamics::Trace;
use ff_model::{Model, Params};
use serde::Serialize;

/// Most frames per second (Hz).
const RATE_HZ: f64 = 30.0;
/// Most frames.
const FRAMES: usize = 6000;

/// A motion as the page reads it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Motion {
    /// Time between frames (s).
    step_s: f64,
    /// Number of frames.
    frames: usize,
    /// Numbers per frame: position of the base (3, m), attitude (4, `x y z w`), joints, passive coordinates, centre of mass in the world
    /// (3, m).
    columns: usize,
    /// All of them, frame after frame: little-endian single precision in base64.
    data: String,
    /// Covariance of the centre of mass; absent where nothing is known of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    ellipsoids: Option<Ellipsoids>,
}

impl Motion {
    /// Every k-th sample of a trace, so that there are at most 30 in a second and 6000 in all.
    pub(super) fn new(model: &Model, params: &Params<f64>, trace: &Trace, known: Option<&Knowledge>) -> Self {
        let every = ((1.0 / (RATE_HZ * trace.dt)).floor() as usize).max(trace.len().div_ceil(FRAMES)).max(1);
        let rows: Vec<usize> = (0..trace.len()).step_by(every).collect();
        let com = mass::path(model, params, trace, &rows);
        let columns = 7 + model.nj() + model.np() + 3;
        let mut all = Vec::with_capacity(rows.len() * columns);
        for (&i, c) in rows.iter().zip(&com) {
            all.extend((0..3).map(|k| trace.pos[(i, k)]));
            all.extend([1, 2, 3, 0].map(|k| trace.att[(i, k)]));
            all.extend((0..model.nj()).map(|k| trace.q[(i, k)]));
            all.extend((0..model.np()).map(|k| trace.eta[(i, k)]));
            all.extend(c.iter());
        }
        Self {
            step_s: trace.dt * every as f64,
            frames: rows.len(),
            columns,
            data: singles(all.into_iter()),
            ellipsoids: known.map(|k| Ellipsoids::along(model, params, k, trace, &rows)),
        }
    }
    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames
    }
}
