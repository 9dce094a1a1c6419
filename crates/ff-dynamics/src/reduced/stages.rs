//! The stages of an integration, kept for what is differentiated along it.

use crate::reduced::system::Response;
use ff_model::scalar::LaneScalar;

/// State and accelerations in every stage of [`crate::simulate_reduced`]: a fit that goes on from where it has tried need not
/// integrate there again ([`crate::reduced::sensitivity::sensitivities_over`]). Some `8 (18 + 3 m)` bytes a stage, four stages a step.
///
/// ```
/// # use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
/// # let params = Params::nominal(&robot);
/// # let sampling = ff_dynamics::Sampling { samples: 51, sample_s: 0.02, substeps: 2 };
/// # let table = ff_dynamics::Prescribed::new(&robot, &params, &motion, &sampling, &[]);
/// # let rest = vec![0.0; 6 + 2 * robot.np()];
/// use ff_dynamics::Wanted;
/// use ff_dynamics::reduced::{Stages, sensitivity::sensitivities_over};
///
/// let mut stages = Stages::default();
/// let response = stages.integrate(&robot, &params, &table, &rest)?;
/// let wanted = Wanted { params: robot.parameter_indices("base.mass")?, ..Wanted::default() };
/// let (same, s) = sensitivities_over(&robot, &params, &table, &stages, &wanted)?;
/// assert_eq!((same == response, s), (true, ff_dynamics::sensitivities(&robot, &params, &table, &rest, &wanted)?.1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Stages {
    /// Stage by stage; the last sample is a stage of its own.
    z: Vec<f64>,
    u: Vec<f64>,
    /// With the torques of the joints of the tree.
    response: Option<Response>,
}

impl Stages {
    /// Without any, with room for those of a table with `steps` steps and `m` passive coordinates.
    pub(crate) fn begin(&mut self, steps: usize, m: usize) {
        self.response = None;
        for (kept, length) in [(&mut self.z, 6 + 2 * m), (&mut self.u, 6 + m)] {
            kept.clear();
            kept.reserve((4 * steps + 1) * length);
        }
    }
    /// What came of it.
    pub(crate) fn end(&mut self, response: &Response) {
        self.response = Some(response.clone());
    }
    /// Takes the next stage in.
    #[inline(always)]
    pub(crate) fn push<L: LaneScalar>(&mut self, z: &[L], u: &[L]) {
        self.z.extend(z.iter().map(|x| x.lane(0)));
        self.u.extend(u.iter().map(|x| x.lane(0)));
    }
    /// What was integrated, if it was of so many stages with so many passive coordinates.
    pub(crate) fn response(&self, stages: usize, m: usize) -> Option<&Response> {
        let lengths = (self.z.len(), self.u.len());
        self.response.as_ref().filter(|_| lengths == (stages * (6 + 2 * m), stages * (6 + m)))
    }
    /// State and accelerations of stage `i` with `m` passive coordinates.
    #[inline(always)]
    pub(crate) fn at(&self, i: usize, m: usize) -> (&[f64], &[f64]) {
        let (nz, nu) = (6 + 2 * m, 6 + m);
        (&self.z[i * nz..(i + 1) * nz], &self.u[i * nu..(i + 1) * nu])
    }
}
