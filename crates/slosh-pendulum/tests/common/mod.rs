//! Random pendulums and states, no zeros ("zeros mask bugs").
#![allow(clippy::unwrap_used)] // helpers of tests may panic

use ff_model::{Motion, PortState};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use slosh_pendulum::SloshPendulum;

pub(crate) mod ports;

pub(crate) type Random = ChaCha8Rng;

pub(crate) fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Uniform in `[-a, a]`.
pub(crate) fn sym(r: &mut ChaCha8Rng, a: f64) -> f64 {
    r.random_range(-a..a)
}

pub(crate) fn vec3(r: &mut ChaCha8Rng, a: f64) -> Vector3<f64> {
    Vector3::new(sym(r, a), sym(r, a), sym(r, a))
}

pub(crate) fn pendulum(r: &mut ChaCha8Rng) -> SloshPendulum {
    let mut u = |a: f64, b: f64| r.random_range(a..b);
    let (k, d) = ([u(1.0, 50.0), u(1.0, 50.0)], [u(0.1, 8.0), u(0.1, 8.0)]);
    SloshPendulum::new(u(1.0, 200.0), u(0.1, 1.5), k, d).unwrap()
}

/// A random motion of host and pendulum, within the range of the coordinates.
pub(crate) struct State {
    pub(crate) host: Motion<f64>,
    pub(crate) eta: [f64; 2],
    pub(crate) nu: [f64; 2],
}

impl State {
    pub(crate) fn new(r: &mut ChaCha8Rng) -> Self {
        Self {
            host: Motion::new(vec3(r, 2.0), vec3(r, 2.0)),
            eta: [sym(r, 3.1), sym(r, 1.4)],
            nu: [sym(r, 2.0), sym(r, 2.0)],
        }
    }
    pub(crate) fn port(&self) -> PortState<'_, f64> {
        PortState { host: self.host, eta: &self.eta, nu: &self.nu }
    }
    /// `y = [V; nu]`.
    pub(crate) fn y(&self) -> [f64; 8] {
        let mut y = [0.0; 8];
        self.host.write_to(&mut y);
        y[6..].copy_from_slice(&self.nu);
        y
    }
}

/// Largest difference over largest component.
pub(crate) fn rel(a: &[f64], b: &[f64]) -> f64 {
    let amax = |x: &[f64]| x.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let d = a.iter().zip(b).fold(0.0_f64, |m, (x, y)| m.max((x - y).abs()));
    d / amax(a).max(amax(b))
}
