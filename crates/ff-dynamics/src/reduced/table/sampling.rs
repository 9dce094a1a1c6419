//! The times of a table.

/// Sampling of a prescribed motion.
///
/// ```
/// # use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
/// # let params = Params::nominal(&robot);
/// # let sampling = ff_dynamics::Sampling { samples: 51, sample_s: 0.02, substeps: 2 };
/// # let table = ff_dynamics::Prescribed::new(&robot, &params, &motion, &sampling, &[]);
/// # let rest = vec![0.0; 6 + 2 * robot.np()];
/// use ff_dynamics::{Prescribed, Sampling, simulate_reduced};
///
/// // Half the step: the base rate changes by less than a part in 1e5.
/// let fine = Sampling { samples: 51, sample_s: 0.02, substeps: 4 };
/// let fine = Prescribed::new(&robot, &params, &motion, &fine, &[]);
/// let last = |table| simulate_reduced(&robot, &params, table, &rest).map(|r| r.twist.row(50).columns(3, 3).into_owned());
/// let (coarse, fine) = (last(&table)?, last(&fine)?);
/// assert!((&coarse - &fine).norm() < 1e-5 * fine.norm());
/// # Ok::<(), ff_dynamics::reduced::ReducedError>(())
/// ```
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
