//! Random chains and states: skewed axes, offset centres of mass, no zeros ("zeros mask bugs").
#![allow(clippy::unwrap_used)] // helpers of tests may panic

use ff_model::{Motion, PortState, Scalar};
use flex_panel::PanelChain;
use flex_panel::Segment;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[path = "../../../slosh-pendulum/tests/common/ports.rs"]
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

pub(crate) fn segment(r: &mut ChaCha8Rng) -> Segment {
    // Principal moments as sums of pairs of second moments: every triangle inequality holds.
    let s = Vector3::new(r.random_range(0.2..3.0), r.random_range(0.2..3.0), r.random_range(0.2..3.0));
    let turn = Rotation3::new(vec3(r, 2.0)).into_inner();
    let moments = Matrix3::from_diagonal(&Vector3::new(s.y + s.z, s.x + s.z, s.x + s.y));
    let i_com = turn * moments * turn.transpose();
    Segment::new(r.random_range(0.5..40.0), vec3(r, 1.2), &i_com, vec3(r, 1.5), vec3(r, 1.0))
        .with_spring(r.random_range(1.0..300.0), r.random_range(0.1..5.0))
        .with_rest(sym(r, 0.4))
}

pub(crate) fn chain(r: &mut ChaCha8Rng, n: usize) -> PanelChain {
    PanelChain::new((0..n).map(|_| segment(r)).collect()).unwrap()
}

/// A random motion of a host and a chain of `n` hinges.
pub(crate) struct State {
    pub(crate) host: Motion<f64>,
    pub(crate) eta: Vec<f64>,
    pub(crate) nu: Vec<f64>,
}

impl State {
    pub(crate) fn new(r: &mut ChaCha8Rng, n: usize) -> Self {
        Self {
            host: Motion::new(vec3(r, 2.0), vec3(r, 2.0)),
            eta: (0..n).map(|_| sym(r, 3.0)).collect(),
            nu: (0..n).map(|_| sym(r, 2.0)).collect(),
        }
    }
    pub(crate) fn port(&self) -> PortState<'_, f64> {
        PortState { host: self.host, eta: &self.eta, nu: &self.nu }
    }
    /// `y = [V; nu]`.
    pub(crate) fn y(&self) -> Vec<f64> {
        let mut y = vec![0.0; 6 + self.nu.len()];
        self.host.write_to(&mut y);
        y[6..].copy_from_slice(&self.nu);
        y
    }
}

/// Largest component.
pub(crate) fn amax<T: Scalar>(x: &[T]) -> f64 {
    x.iter().fold(0.0, |a, b| a.max(b.value().abs()))
}

/// Largest difference over largest component.
pub(crate) fn rel(a: &[f64], b: &[f64]) -> f64 {
    let d = a.iter().zip(b).fold(0.0_f64, |m, (x, y)| m.max((x - y).abs()));
    d / amax(a).max(amax(b))
}
