//! A motion over time: prescribed joint motion or joint torques in, everything observable out.

use crate::aba::SingularInertia;
use crate::forward::{forward_dynamics, hybrid_dynamics};
use crate::integrate::{QUADRATURES, Rkmk4};
use crate::momentum::{Budget, budget};
use crate::motion::JointMotion;
use crate::state::State;
use crate::work::Work;
use ff_model::{Model, ModelScalar, Params};
use nalgebra::DMatrix;

/// What moves the joints.
pub enum Drive<'a> {
    /// A position-controlled arm: the joints follow this motion exactly.
    Prescribed(&'a dyn JointMotion),
    /// Joint torques as a function of time and state, written into the last argument (N m, length `n`).
    Torque(&'a TorqueLaw<'a>),
}

/// Joint torques as a function of time and state.
pub type TorqueLaw<'a> = dyn Fn(f64, &State<f64>, &mut [f64]) + 'a;

/// Step and sampling of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimOptions {
    /// Length of the simulation (s).
    pub duration_s: f64,
    /// Integration step at most (s); shortened so that samples fall on steps.
    pub step_s: f64,
    /// Time between samples (s).
    pub sample_s: f64,
}

/// Why a simulation stopped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimError {
    /// Steps or lengths make no sense.
    #[error("{what} is {value} s, but must be positive and finite{extra}; correct the simulation settings")]
    Options {
        /// Which setting.
        what: &'static str,
        /// Its value (s).
        value: f64,
        /// More about the limit.
        extra: &'static str,
    },
    /// A mass matrix became singular.
    #[error("at t = {t} s: {source}")]
    Singular {
        /// Time (s).
        t: f64,
        /// Where.
        source: SingularInertia,
    },
    /// A passive coordinate left the range its model is valid in.
    #[error("at t = {t} s: coordinate {coord} is {value} {unit}, outside {lo} .. {hi}; excite less or widen the model")]
    Range {
        /// Time (s).
        t: f64,
        /// Full name.
        coord: String,
        /// Value.
        value: f64,
        /// Unit.
        unit: &'static str,
        /// Lower end of the range.
        lo: f64,
        /// Upper end of the range.
        hi: f64,
    },
    /// The state became NaN or infinite.
    #[error("at t = {t} s: the state is no longer finite; use a smaller step than {step} s")]
    NotFinite {
        /// Time (s).
        t: f64,
        /// Step used (s).
        step: f64,
    },
    /// The drive has another number of joints than the model.
    #[error("the joint motion has {got} joints, the model {want}; give one column per joint of the URDF")]
    Joints {
        /// In the drive.
        got: usize,
        /// In the model.
        want: usize,
    },
}

/// Samples of a simulation: one row per sample, one column per channel.
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
}

/// Integrates `start` for `options.duration_s` and samples what can be observed.
///
/// With [`Drive::Prescribed`] the joint part of `start` is overwritten by the motion. Fixed-step
/// [`Rkmk4`]; allocates the trace and buffers once.
///
/// # Errors
/// [`SimError`]; the trace up to there is dropped.
pub fn simulate(
    model: &Model,
    params: &Params<f64>,
    start: &State<f64>,
    drive: &Drive<'_>,
    options: &SimOptions,
) -> Result<Trace, SimError> {
    let positive = |what, value: f64| {
        if value > 0.0 && value.is_finite() { Ok(()) } else { Err(SimError::Options { what, value, extra: "" }) }
    };
    positive("duration", options.duration_s)?;
    positive("integration step", options.step_s)?;
    positive("sample time", options.sample_s)?;
    if let Drive::Prescribed(m) = drive
        && m.dof() != model.nj()
    {
        return Err(SimError::Joints { got: m.dof(), want: model.nj() });
    }
    let per_sample = (options.sample_s / options.step_s - 1e-9).ceil().max(1.0) as usize;
    let h = options.sample_s / per_sample as f64;
    let samples = (options.duration_s / options.sample_s + 1e-9).floor() as usize + 1;
    let (nb, nj, nv) = (model.nb(), model.nj(), model.nv());
    let mut trace = Trace {
        dt: options.sample_s,
        q: DMatrix::zeros(samples, nj),
        qd: DMatrix::zeros(samples, nj),
        qdd: DMatrix::zeros(samples, nj),
        tau: DMatrix::zeros(samples, nj),
        twist: DMatrix::zeros(samples, 6),
        accel: DMatrix::zeros(samples, 6),
        pos: DMatrix::zeros(samples, 3),
        att: DMatrix::zeros(samples, 4),
        eta: DMatrix::zeros(samples, model.np()),
        nu: DMatrix::zeros(samples, model.np()),
        dissipated: Vec::with_capacity(samples),
        work: Vec::with_capacity(samples),
        last: start.clone(),
    };
    let coords = model.passive_coords();
    let mut plant = Plant::new(model, params, drive);
    let mut stepper = Rkmk4::new(model);
    let mut state = start.clone();
    let mut quad = [0.0; QUADRATURES];
    let mut a = vec![0.0; nv];
    for i in 0..samples {
        let t = i as f64 * options.sample_s;
        let mut rate = [0.0; QUADRATURES];
        plant.accelerate(t, &mut state, &mut a, &mut rate).map_err(|source| SimError::Singular { t, source })?;
        let fill = |m: &mut DMatrix<f64>, x: &[f64]| x.iter().enumerate().for_each(|(k, &v)| m[(i, k)] = v);
        fill(&mut trace.q, &state.q);
        fill(&mut trace.qd, state.qd());
        fill(&mut trace.qdd, &a[nb..nb + nj]);
        fill(&mut trace.tau, &plant.tau);
        fill(&mut trace.twist, &state.v[..nb]);
        fill(&mut trace.accel, &a[..nb]);
        fill(&mut trace.pos, state.pos.as_slice());
        fill(&mut trace.att, state.att.as_slice());
        fill(&mut trace.eta, &state.eta);
        fill(&mut trace.nu, state.nu());
        trace.dissipated.push(quad[0]);
        trace.work.push(quad[1]);
        if i + 1 == samples {
            break;
        }
        for k in 0..per_sample {
            let ts = t + k as f64 * h;
            // The sample has evaluated the first stage of the step that starts there.
            let first = (k == 0).then_some((a.as_slice(), &rate));
            stepper
                .step_from(ts, h, &mut state, &mut quad, first, |t, s, a, r| plant.accelerate(t, s, a, r))
                .map_err(|source| SimError::Singular { t: ts, source })?;
        }
        if !state.is_finite() {
            return Err(SimError::NotFinite { t, step: h });
        }
        for (x, (name, c)) in state.eta.iter().zip(&coords) {
            if *x < c.range.0 || *x > c.range.1 {
                let (lo, hi) = c.range;
                return Err(SimError::Range { t, coord: name.clone(), value: *x, unit: c.unit, lo, hi });
            }
        }
    }
    trace.last = state;
    Ok(trace)
}

/// The right-hand side: accelerations and the rates of dissipated energy and joint work.
struct Plant<'a> {
    model: &'a Model,
    params: &'a Params<f64>,
    drive: &'a Drive<'a>,
    work: Work<f64>,
    tau: Vec<f64>,
    full: Vec<f64>,
    qdd: Vec<f64>,
    q: Vec<f64>,
    qd: Vec<f64>,
}

impl<'a> Plant<'a> {
    fn new(model: &'a Model, params: &'a Params<f64>, drive: &'a Drive<'a>) -> Self {
        let z = vec![0.0; model.nj()];
        Self {
            model,
            params,
            drive,
            work: Work::new(model),
            tau: z.clone(),
            full: vec![0.0; model.nv()],
            qdd: z.clone(),
            q: z.clone(),
            qd: z,
        }
    }
    fn accelerate(
        &mut self,
        t: f64,
        state: &mut State<f64>,
        a: &mut [f64],
        rate: &mut [f64; QUADRATURES],
    ) -> Result<(), SingularInertia> {
        match self.drive {
            Drive::Prescribed(m) => {
                m.eval(t, &mut self.q, &mut self.qd, &mut self.qdd);
                state.q.copy_from_slice(&self.q);
                state.qd_mut().copy_from_slice(&self.qd);
                hybrid_dynamics(self.model, self.params, state, &self.qdd, &mut self.work, a, &mut self.tau)?;
            }
            Drive::Torque(law) => {
                law(t, state, &mut self.tau);
                let nb = self.model.nb();
                self.full[nb..nb + self.tau.len()].copy_from_slice(&self.tau);
                forward_dynamics(self.model, self.params, state, &self.full, &mut self.work, a)?;
            }
        }
        let nu = state.nu();
        rate[0] = 0.0;
        for (k, ap) in self.model.appendages().iter().enumerate() {
            let nu = &nu[ap.coord_offset..ap.coord_offset + ap.dim()];
            rate[0] += f64::port(&*ap.appendage).dissipated_power(self.params.appendage(self.model, k), nu);
        }
        rate[1] = self.tau.iter().zip(state.qd()).map(|(t, w)| t * w).sum();
        Ok(())
    }
}
