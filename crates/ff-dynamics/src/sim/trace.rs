//! What a simulation records.

use crate::analysis::momentum::{Budget, budget};
use crate::sim::integrate::QUADRATURES;
use crate::state::State;
use crate::work::buffers::Work;
use ff_model::{Model, Params};
use nalgebra::DMatrix;

/// Samples of a simulation: one row per sample, one column per channel.
///
/// ```
/// use ff_dynamics::{Drive, SimOptions, State, Trace, simulate};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
///
/// let options = SimOptions { duration_s: 1.0, step_s: 0.005, sample_s: 0.1 };
/// let trace: Trace =
///     simulate(&robot, &Params::nominal(&robot), &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// assert_eq!((trace.len(), trace.eta.ncols()), (11, robot.np()));
/// assert_eq!(trace.gyro().column(2), trace.twist.column(5)); // rad/s about z of the base
/// assert_eq!(trace.state(&robot, 10).q, trace.last.q);
/// # Ok::<(), ff_dynamics::SimError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Trace {
    /// Time between samples (s); the first sample is at the start.
    pub dt: f64,
    /// Joint positions, rates and accelerations, `N x n`.
    pub q: DMatrix<f64>,
    /// See `q`.
    pub qd: DMatrix<f64>,
    /// See `q`.
    pub qdd: DMatrix<f64>,
    /// Joint torques after the gear (N m), `N x n`.
    pub tau: DMatrix<f64>,
    /// Base twist, base frame, linear first, `N x 6`. Columns 3..6 are what a gyro measures (rad/s).
    pub twist: DMatrix<f64>,
    /// Base acceleration (componentwise rate of `twist`), `N x 6`.
    pub accel: DMatrix<f64>,
    /// Base origin in the world (m), `N x 3`.
    pub pos: DMatrix<f64>,
    /// Base attitude `[w, x, y, z]`, `N x 4`.
    pub att: DMatrix<f64>,
    /// Passive coordinates, `N x m`.
    pub eta: DMatrix<f64>,
    /// Passive rates, `N x m`.
    pub nu: DMatrix<f64>,
    /// Energy dissipated since the start (J), length `N`.
    pub dissipated: Vec<f64>,
    /// Work of the joint torques since the start (J), length `N`.
    pub work: Vec<f64>,
    /// Work of the external inputs since the start (J), length `N`.
    pub input_work: Vec<f64>,
    /// Impulse of the external inputs since the start: linear (N s), and angular about the world origin (N m s), both in
    /// world axes, `N x 6`.
    pub impulse: DMatrix<f64>,
    /// State at the end.
    pub last: State<f64>,
}

impl Trace {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.dissipated.len()
    }
    /// True without samples.
    pub fn is_empty(&self) -> bool {
        self.dissipated.is_empty()
    }
    /// Sample times (s).
    pub fn times(&self) -> Vec<f64> {
        (0..self.len()).map(|i| i as f64 * self.dt).collect()
    }
    /// Base rates in the base frame (rad/s), `N x 3`.
    pub fn gyro(&self) -> DMatrix<f64> {
        self.twist.columns(3, 3).into_owned()
    }
    /// The state at sample `i` (allocates).
    pub fn state(&self, model: &Model, i: usize) -> State<f64> {
        let mut s = State::zero(model);
        for k in 0..3 {
            s.pos[k] = self.pos[(i, k)];
        }
        for k in 0..4 {
            s.att[k] = self.att[(i, k)];
        }
        let copy = |m: &DMatrix<f64>, out: &mut [f64]| out.iter_mut().enumerate().for_each(|(k, x)| *x = m[(i, k)]);
        copy(&self.q, &mut s.q);
        copy(&self.eta, &mut s.eta);
        if model.nb() == 6 {
            copy(&self.twist, &mut s.v[..6]);
        }
        copy(&self.qd, s.qd_mut());
        copy(&self.nu, s.nu_mut());
        s
    }
    /// Momentum and energy at sample `i` (allocates).
    pub fn budget(&self, model: &Model, params: &Params<f64>, i: usize) -> Budget<f64> {
        budget(model, params, &self.state(model, i), &mut Work::new(model))
    }
    /// Zeros for `samples` samples. Allocates.
    pub(crate) fn new(model: &Model, samples: usize, dt: f64, start: &State<f64>) -> Self {
        let z = |columns| DMatrix::zeros(samples, columns);
        let (nj, np) = (model.nj(), model.np());
        Self {
            dt,
            q: z(nj),
            qd: z(nj),
            qdd: z(nj),
            tau: z(nj),
            twist: z(6),
            accel: z(6),
            pos: z(3),
            att: z(4),
            eta: z(np),
            nu: z(np),
            dissipated: Vec::with_capacity(samples),
            work: Vec::with_capacity(samples),
            input_work: Vec::with_capacity(samples),
            impulse: z(6),
            last: start.clone(),
        }
    }
    /// Writes sample `i`, the next one, with its accelerations, joint torques and quadratures.
    pub(crate) fn put(&mut self, i: usize, s: &State<f64>, a: &[f64], tau: &[f64], quad: &[f64; QUADRATURES]) {
        let (nb, nj) = (s.v.len() - s.q.len() - s.eta.len(), s.q.len());
        let fill = |m: &mut DMatrix<f64>, x: &[f64]| x.iter().enumerate().for_each(|(k, &v)| m[(i, k)] = v);
        fill(&mut self.q, &s.q);
        fill(&mut self.qd, s.qd());
        fill(&mut self.qdd, &a[nb..nb + nj]);
        fill(&mut self.tau, tau);
        fill(&mut self.twist, &s.v[..nb]);
        fill(&mut self.accel, &a[..nb]);
        fill(&mut self.pos, s.pos.as_slice());
        fill(&mut self.att, s.att.as_slice());
        fill(&mut self.eta, &s.eta);
        fill(&mut self.nu, s.nu());
        self.dissipated.push(quad[0]);
        self.work.push(quad[1]);
        self.input_work.push(quad[2]);
        fill(&mut self.impulse, &quad[3..]);
    }
}
