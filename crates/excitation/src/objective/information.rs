//! Make parameters visible: `-log det (Y^T Y + delta I)` (D-optimality).
//!
//! `Y` stacks the sensitivities of the measurements to the parameters over the trajectory, whitened and
//! scaled: `M = rate int Y^T Y dt + delta I` with `rate` the samples per second of the record, so that `M` is
//! the information matrix and `M^-1` bounds the covariance (`theory.md` 3 and 7).
//! `d(-log det M) = -2 rate int tr(M^-1 Y^T dY) dt`.

use super::{Cost, Node, Sweep, uniform_nodes};
use crate::plan::spline::SplinePlan;
use nalgebra::DMatrix;

/// What one sample tells about the parameters.
pub trait SampleInformation: Send + Sync {
    /// Number of parameters.
    fn parameters(&self) -> usize;
    /// Measurements per sample.
    fn rows(&self) -> usize;
    /// Block of `Y`, `rows x parameters`: sensitivities divided by the standard deviation of the
    /// measurement and multiplied by the scale of the parameter. Every entry is overwritten.
    fn rows_at(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut DMatrix<f64>);
    /// Adds `sum_ab W_ab dY_ab/dq` to `gq`, and likewise for `qd`, `qdd`, with `W` of the shape of the block. Must be
    /// exact: the optimiser trusts it.
    fn contract(&self, state: [&[f64]; 3], weights: &DMatrix<f64>, gradient: [&mut [f64]; 3]);
}

/// `-log det (rate int Y^T Y dt + delta I)`.
#[derive(Clone, Debug)]
pub struct Information<S> {
    /// Sensitivities of the measurements.
    pub source: S,
    /// Number of quadrature samples, at least 2.
    pub samples: usize,
    /// Samples per second of the record that will be taken (Hz).
    pub rate: f64,
    /// Prior information `delta > 0`: keeps the determinant positive when a parameter is invisible.
    pub delta: f64,
}

impl<S: SampleInformation> Information<S> {
    /// The information matrix `M` of the trajectory `x`, `delta I` included, over scaled parameters. Allocates.
    ///
    /// # Panics
    /// If `x` has the wrong length.
    pub fn matrix(&self, plan: &SplinePlan, x: &[f64]) -> DMatrix<f64> {
        self.assemble(&mut Sweep::new(plan, x), &uniform_nodes(plan, self.samples), |_| ())
    }
    /// Sums up `M` and hands the block of every sample to `keep`.
    fn assemble(&self, sweep: &mut Sweep, nodes: &[Node], mut keep: impl FnMut(DMatrix<f64>)) -> DMatrix<f64> {
        let (duration, p) = (sweep.duration, self.source.parameters());
        let mut m = DMatrix::identity(p, p) * self.delta;
        sweep.forward(nodes, |node, s| {
            let mut y = DMatrix::zeros(self.source.rows(), p);
            self.source.rows_at(&s.q, &s.qd, &s.qdd, &mut y);
            m.gemm_tr(self.rate * node.weight * duration, &y, &y, 1.0);
            keep(y);
        });
        m
    }
    /// Value of `f` at the matrix of the trajectory `x`, with the gradient over `x` from that over the matrix, which `f`
    /// returns (symmetric); NaN where the matrix is not finite or `f` has no answer.
    pub(crate) fn value_gradient_of(
        &self,
        plan: &SplinePlan,
        x: &[f64],
        grad: &mut [f64],
        f: impl FnOnce(&DMatrix<f64>) -> Option<(f64, DMatrix<f64>)>,
    ) -> f64 {
        let nodes = uniform_nodes(plan, self.samples);
        let mut sweep = Sweep::new(plan, x);
        let duration = sweep.duration;
        let mut blocks = Vec::with_capacity(nodes.len());
        let m = self.assemble(&mut sweep, &nodes, |y| blocks.push(y));
        // A factorisation would accept infinities.
        if m.iter().any(|v| !v.is_finite()) {
            return f64::NAN;
        }
        let Some((value, slope)) = f(&m) else { return f64::NAN };
        let mut blocks = blocks.iter();
        sweep.backward(&nodes, grad, |node, s, adj| {
            let Some(y) = blocks.next() else { return };
            let mut w = y * &slope;
            adj.duration = self.rate * node.weight * w.dot(y);
            w *= 2.0 * self.rate * node.weight * duration;
            self.source.contract([&s.q, &s.qd, &s.qdd], &w, [&mut adj.q, &mut adj.qd, &mut adj.qdd]);
        });
        value
    }
}

impl<S: SampleInformation> Cost for Information<S> {
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        self.value_gradient_of(plan, x, grad, |m| {
            let chol = m.clone().cholesky()?;
            Some((-2.0 * chol.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>(), -chol.inverse()))
        })
    }
}
