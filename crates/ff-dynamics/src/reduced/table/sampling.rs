//! The times of a table.

/// Sampling of a prescribed motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Number of samples, the first at time zero.
    pub samples: usize,
    /// Time between samples (s).
    pub sample_s: f64,
    /// Integration steps per sample, at least 1.
    pub substeps: usize,
}

impl Sampling {
    /// Nodes at half integration steps, the first and the last sample included.
    pub(crate) fn nodes(&self) -> usize {
        (self.samples - 1) * self.substeps * 2 + 1
    }
    /// Integration step (s).
    pub(crate) fn step(&self) -> f64 {
        self.sample_s / self.substeps as f64
    }
    /// Time of a node (s).
    pub(crate) fn time_of(&self, node: usize) -> f64 {
        0.5 * self.step() * node as f64
    }
    /// Nodes from one sample to the next.
    pub(crate) fn nodes_per_sample(&self) -> usize {
        2 * self.substeps
    }
}
