//! The right-hand side of a simulation.

use crate::sim::inputs::{ExternalInput, Inputs};
use crate::sim::integrate::QUADRATURES;
use crate::sim::simulate::{Drive, SimError};
use crate::state::State;
use crate::tree::aba::SingularInertia;
use crate::tree::forward::{forward_dynamics, hybrid_dynamics};
use crate::work::buffers::Work;
use ff_model::scalar::ModelScalar;
use ff_model::{Model, Params};

/// How far inside a step its ends are looked at, as a fraction of it.
const INSIDE: f64 = 1e-10;

/// The right-hand side: accelerations and the rates of the quadratures, which are dissipated energy, work of the joint
/// torques, work of the inputs, and their impulse about the world origin in world axes.
pub(crate) struct Plant<'a> {
    model: &'a Model,
    params: &'a Params<f64>,
    drive: &'a Drive<'a>,
    inputs: Option<Inputs<'a>>,
    /// The step that is being taken, from and to (s): what jumps at its ends is seen from inside.
    span: (f64, f64),
    work: Work<f64>,
    /// Joint torques of the last evaluation.
    pub(crate) tau: Vec<f64>,
    full: Vec<f64>,
    qdd: Vec<f64>,
    q: Vec<f64>,
    qd: Vec<f64>,
}

impl<'a> Plant<'a> {
    pub(crate) fn new(
        model: &'a Model,
        params: &'a Params<f64>,
        drive: &'a Drive<'a>,
        inputs: &'a [&'a dyn ExternalInput],
    ) -> Self {
        let z = vec![0.0; model.nj()];
        Self {
            model,
            params,
            drive,
            inputs: (!inputs.is_empty()).then(|| Inputs::new(model, inputs)),
            span: (f64::NEG_INFINITY, f64::INFINITY),
            work: Work::new(model),
            tau: z.clone(),
            full: vec![0.0; model.nv()],
            qdd: z.clone(),
            q: z.clone(),
            qd: z,
        }
    }
    /// From now on a step from `from` to `to` (s) is taken.
    pub(crate) fn enter_step(&mut self, from: f64, to: f64) {
        let inside = INSIDE * (to - from);
        self.span = (from + inside, to - inside);
    }
    /// Accelerations at `t`. `seen` is the time at which a prescribed motion is looked up.
    ///
    /// # Errors
    /// [`SimError::Singular`] and [`SimError::NotFinite`].
    pub(crate) fn accelerate(
        &mut self,
        t: f64,
        seen: f64,
        state: &mut State<f64>,
        a: &mut [f64],
        rate: &mut [f64; QUADRATURES],
    ) -> Result<(), SimError> {
        let step = self.span.1 - self.span.0;
        self.rates(t, seen, state, a, rate).map_err(|source| SimError::singular(t, step, state.is_finite(), source))
    }
    fn rates(
        &mut self,
        t: f64,
        seen: f64,
        state: &mut State<f64>,
        a: &mut [f64],
        rate: &mut [f64; QUADRATURES],
    ) -> Result<(), SingularInertia> {
        let Self { model, params, work, .. } = self;
        if let Drive::Prescribed(m) = self.drive {
            m.eval(seen, &mut self.q, &mut self.qd, &mut self.qdd);
            state.q.copy_from_slice(&self.q);
            state.qd_mut().copy_from_slice(&self.qd);
        }
        rate[2..].fill(0.0);
        let mut passive: &[f64] = &[];
        if let Some(inputs) = &mut self.inputs {
            let total;
            (passive, rate[2], total) = inputs.apply(inside(t, self.span), model, params, state, work);
            total.write_to(&mut rate[3..]);
        }
        match self.drive {
            Drive::Prescribed(_) => {
                if !passive.is_empty() {
                    work.set_passive_forces(passive);
                }
                hybrid_dynamics(model, params, state, &self.qdd, work, a, &mut self.tau)?;
            }
            Drive::Torque(law) => {
                law(t, state, &mut self.tau);
                let (nb, nj) = (model.nb(), model.nj());
                self.full[nb..nb + nj].copy_from_slice(&self.tau);
                if !passive.is_empty() {
                    self.full[nb + nj..].copy_from_slice(passive);
                }
                forward_dynamics(model, params, state, &self.full, work, a)?;
            }
        }
        let nu = state.nu();
        rate[0] = 0.0;
        for (k, ap) in model.appendages().iter().enumerate() {
            let nu = &nu[ap.coord_offset..ap.coord_offset + ap.dim()];
            rate[0] += f64::port(&*ap.appendage).dissipated_power(params.appendage(model, k), nu);
        }
        rate[1] = self.tau.iter().zip(state.qd()).map(|(t, w)| t * w).sum();
        Ok(())
    }
    /// `t`, moved inside the step that is being taken.
    pub(crate) fn inside(&self, t: f64) -> f64 {
        inside(t, self.span)
    }
}

/// `t` within a span. A span that rounding has turned around is its own beginning.
fn inside(t: f64, (from, to): (f64, f64)) -> f64 {
    t.min(to).max(from)
}
