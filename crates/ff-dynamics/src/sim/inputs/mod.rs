//! What acts on the system from outside: thrusters, wrenches, motors of wheels, the gradient of gravity.
//!
//! Inputs are declared beside the drive of the joints ([`crate::sim::simulate::simulate_with`], [`crate::sim::adaptive::simulate_adaptive`]). An
//! [`ExternalInput`] looks at the [`Scene`], the poses and twists of all bodies, and adds wrenches on bodies and forces on
//! passive coordinates to the [`Loads`]. A simulation carries their work and their impulse as quadratures, so that
//!
//! ```text
//! momentum(t) - momentum(0) = impulse(t)                          six equations, world axes, about the world origin
//! energy(t) - energy(0)     = work + input_work - dissipated
//! ```
//!
//! can be read off every trace.
pub(crate) mod orbit;
pub(crate) mod signal;
pub(crate) mod wrench;

pub use orbit::GravityGradient;
pub use signal::{Pulse, Signal};
pub use wrench::{AppliedWrench, Axes, PassiveForce, Thruster};

use crate::state::State;
use crate::work::buffers::Work;
use ff_model::spatial::so3::quat_to_rot;
use ff_model::{Force, Model, Motion, Params, Xform};

/// Something outside the system that acts on it.
pub trait ExternalInput: Send + Sync {
    /// Adds what acts at time `t` (s). Called at every stage of the integrator; must not allocate.
    fn act(&self, t: f64, scene: &Scene<'_>, on: &mut Loads);
    /// Times (s) at which the input or its rate jumps; steps then end there, and each side is integrated with its own
    /// values. In any order; may allocate. None unless overridden.
    fn breaks(&self) -> Vec<f64> {
        Vec::new()
    }
    /// Whether the input fits the model: called once, before a simulation.
    ///
    /// # Errors
    /// [`InputError`] if it names a body or a coordinate that does not exist.
    fn check(&self, model: &Model) -> Result<(), InputError>;
}

/// Why an input is impossible.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InputError {
    /// A number out of range.
    #[error("{what} is {value} {unit}, but must be {need}")]
    Value {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// What was needed.
        need: &'static str,
    },
    /// A list without elements.
    #[error("the input has no {0}; give at least one")]
    Empty(&'static str),
    /// Lists of different lengths.
    #[error("there are {times} sample times and {values} values; give one value per time")]
    Length {
        /// Number of times.
        times: usize,
        /// Number of values.
        values: usize,
    },
    /// A body that does not exist.
    #[error("body {got} does not exist; bodies are numbered from 0, the base, to {last}")]
    Body {
        /// Asked for.
        got: usize,
        /// Last body of the model.
        last: usize,
    },
    /// A passive coordinate that does not exist.
    #[error("passive coordinate {got} does not exist; the model has {count}, numbered from 0")]
    Coordinate {
        /// Asked for.
        got: usize,
        /// In the model.
        count: usize,
    },
}

impl InputError {
    /// `Ok` for a finite number.
    pub(crate) fn finite(what: &'static str, value: f64, unit: &'static str) -> Result<(), Self> {
        if value.is_finite() { Ok(()) } else { Err(Self::Value { what, value, unit, need: "finite" }) }
    }
    /// `Ok` for a positive, finite number.
    pub(crate) fn positive(what: &'static str, value: f64, unit: &'static str) -> Result<(), Self> {
        if value > 0.0 && value.is_finite() {
            return Ok(());
        }
        Err(Self::Value { what, value, unit, need: "positive and finite" })
    }
    /// `Ok` for a body of the model.
    pub(crate) fn body(got: usize, model: &Model) -> Result<(), Self> {
        if got < model.n_bodies() { Ok(()) } else { Err(Self::Body { got, last: model.n_bodies() - 1 }) }
    }
}

/// The system at one instant, as an input sees it.
pub struct Scene<'a> {
    /// The model.
    pub model: &'a Model,
    /// Its parameters.
    pub params: &'a Params<f64>,
    /// Its state.
    pub state: &'a State<f64>,
    pose: &'a [Xform<f64>],
    twist: &'a [Motion<f64>],
}

impl Scene<'_> {
    /// Pose of a body in the world.
    ///
    /// # Panics
    /// If the body does not exist.
    pub fn pose(&self, body: usize) -> &Xform<f64> {
        &self.pose[body]
    }
    /// Twist of a body, in its own frame.
    ///
    /// # Panics
    /// If the body does not exist.
    pub fn twist(&self, body: usize) -> &Motion<f64> {
        &self.twist[body]
    }
}

/// What all inputs together exert.
#[derive(Clone, Debug)]
pub struct Loads {
    bodies: Vec<Force<f64>>,
    passive: Vec<f64>,
}

impl Loads {
    /// None. Allocates.
    pub fn new(model: &Model) -> Self {
        Self { bodies: vec![Force::zero(); model.n_bodies()], passive: vec![0.0; model.np()] }
    }
    /// Adds a wrench (N, N m) on a body, in its frame, about its origin.
    ///
    /// # Panics
    /// If the body does not exist.
    pub fn add(&mut self, body: usize, wrench: Force<f64>) {
        self.bodies[body] += wrench;
    }
    /// Adds a force (N m or N) on a passive coordinate. The wrench on the whole appendage is that of its host.
    ///
    /// # Panics
    /// If the coordinate does not exist.
    pub fn add_passive(&mut self, coordinate: usize, force: f64) {
        self.passive[coordinate] += force;
    }
    /// Wrench on a body, in its frame, about its origin.
    ///
    /// # Panics
    /// If the body does not exist.
    pub fn wrench(&self, body: usize) -> &Force<f64> {
        &self.bodies[body]
    }
    /// Forces on the passive coordinates, length `m`.
    pub fn passive(&self) -> &[f64] {
        &self.passive
    }
}

/// The inputs of a simulation with their buffers.
pub(crate) struct Inputs<'a> {
    inputs: &'a [&'a dyn ExternalInput],
    pose: Vec<Xform<f64>>,
    loads: Loads,
}

impl<'a> Inputs<'a> {
    pub(crate) fn new(model: &Model, inputs: &'a [&'a dyn ExternalInput]) -> Self {
        Self { inputs, pose: vec![Xform::identity(); model.n_bodies()], loads: Loads::new(model) }
    }
    /// Evaluates all inputs at `t` and hands the wrenches on bodies to `work`. Returns the forces on the passive
    /// coordinates, the power of everything, and its wrench about the world origin in world axes.
    pub(crate) fn apply(
        &mut self,
        t: f64,
        model: &Model,
        params: &Params<f64>,
        state: &State<f64>,
        work: &mut Work<f64>,
    ) -> (&[f64], f64, Force<f64>) {
        work.place(model, &state.q);
        work.twists(model, state);
        self.pose[0] = Xform::new(quat_to_rot(&state.att), state.pos);
        for (k, b) in model.bodies().iter().enumerate() {
            self.pose[k + 1] = self.pose[b.parent] * work.x[k + 1];
        }
        self.loads.bodies.fill(Force::zero());
        self.loads.passive.fill(0.0);
        let scene = Scene { model, params, state, pose: &self.pose, twist: &work.v };
        for input in self.inputs {
            input.act(t, &scene, &mut self.loads);
        }
        let (mut power, mut total) = (0.0, Force::zero());
        for (i, wrench) in self.loads.bodies.iter().enumerate() {
            power += work.v[i].dot(wrench);
            total += self.pose[i].force_to_parent(wrench);
            work.set_external(i, *wrench);
        }
        power += self.loads.passive.iter().zip(state.nu()).map(|(f, nu)| f * nu).sum::<f64>();
        (&self.loads.passive, power, total)
    }
}

/// Times strictly between `from` and `to` at which one of the inputs breaks, ascending, none closer to another than
/// `apart`. Allocates.
pub(crate) fn breaks_of(inputs: &[&dyn ExternalInput], more: &[f64], from: f64, to: f64, apart: f64) -> Vec<f64> {
    let mut all: Vec<f64> = inputs.iter().flat_map(|i| i.breaks()).chain(more.iter().copied()).collect();
    all.retain(|t| *t > from + apart && *t < to - apart);
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| *a - *b <= apart);
    all
}
