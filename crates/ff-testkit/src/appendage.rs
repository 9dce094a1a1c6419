//! Random panels and pendulums, and states of their ports: skewed axes, offset centres of mass, no zeros.

use crate::random::{Random, symmetric, uniform, vector};
use ff_model::{Motion, PortState};
use flex_panel::{PanelChain, Segment};
use nalgebra::{Matrix3, Rotation3, Vector3};
use slosh_pendulum::SloshPendulum;

/// A random segment on a skewed hinge with spring, damper and rest angle.
pub fn segment(r: &mut Random) -> Segment {
    // Principal moments as sums of pairs of second moments: every triangle inequality holds.
    let s = Vector3::new(uniform(r, 0.2, 3.0), uniform(r, 0.2, 3.0), uniform(r, 0.2, 3.0));
    let turn = Rotation3::new(vector(r, 2.0)).into_inner();
    let moments = Matrix3::from_diagonal(&Vector3::new(s.y + s.z, s.x + s.z, s.x + s.y));
    let i_com = turn * moments * turn.transpose();
    Segment::new(uniform(r, 0.5, 40.0), vector(r, 1.2), &i_com, vector(r, 1.5), vector(r, 1.0))
        .with_spring(uniform(r, 1.0, 300.0), uniform(r, 0.1, 5.0))
        .with_rest(symmetric(r, 0.4))
}

/// A chain of `n` random segments.
///
/// # Panics
/// If `n` is outside the limits of [`PanelChain`].
pub fn chain(r: &mut Random, n: usize) -> PanelChain {
    PanelChain::new((0..n).map(|_| segment(r)).collect()).unwrap()
}

/// A random pendulum.
pub fn pendulum(r: &mut Random) -> SloshPendulum {
    let mut u = |a: f64, b: f64| uniform(r, a, b);
    let (k, d) = ([u(1.0, 50.0), u(1.0, 50.0)], [u(0.1, 8.0), u(0.1, 8.0)]);
    SloshPendulum::new(u(1.0, 200.0), u(0.1, 1.5), k, d).unwrap()
}

/// A random motion of a host and of the coordinates of its port.
pub struct PortSample {
    /// Twist of the host.
    pub host: Motion<f64>,
    /// Coordinates.
    pub eta: Vec<f64>,
    /// Rates.
    pub nu: Vec<f64>,
}

impl PortSample {
    /// Coordinate `k` within `ranges[k]` about zero.
    pub fn new(r: &mut Random, ranges: &[f64]) -> Self {
        Self {
            host: Motion::new(vector(r, 2.0), vector(r, 2.0)),
            eta: ranges.iter().map(|&a| symmetric(r, a)).collect(),
            nu: ranges.iter().map(|_| symmetric(r, 2.0)).collect(),
        }
    }
    /// As the port sees it.
    pub fn port(&self) -> PortState<'_, f64> {
        PortState { host: self.host, eta: &self.eta, nu: &self.nu }
    }
    /// `y = [V; nu]`.
    pub fn y(&self) -> Vec<f64> {
        let mut y = vec![0.0; 6 + self.nu.len()];
        self.host.write_to(&mut y);
        y[6..].copy_from_slice(&self.nu);
        y
    }
}
