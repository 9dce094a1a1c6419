//! What acts on the robot in `ffid simulate`: the `[[input]]` tables of a mission as inputs of a simulation, and in words.

use ff_dynamics::Trace;
use ff_dynamics::sim::inputs::ExternalInput;
use ff_dynamics::sim::inputs::InputError;
use ff_dynamics::sim::inputs::{AppliedWrench, Axes, GravityGradient, PassiveForce, Pulse, Signal, Thruster};
use ff_mission::mission::{Course, Effort, InputSpec, WrenchAxes};
use ff_model::tree::Frame;
use ff_model::{Area, Force, Model, Problem, Problems};
use nalgebra::Vector3;
use serde::Serialize;
use std::fmt;
use std::fmt::Display;

/// An input of a mission.
#[derive(Clone, Debug, PartialEq)]
pub enum Declared {
    /// `kind = "thruster"`.
    Thruster(Thruster),
    /// `kind = "wrench"`.
    Wrench(AppliedWrench),
    /// `kind = "passive_force"`.
    PassiveForce(PassiveForce),
    /// `kind = "gravity_gradient"`.
    GravityGradient(GravityGradient),
}

impl Declared {
    /// For [`ff_dynamics::sim::simulate_with`].
    pub fn as_input(&self) -> &dyn ExternalInput {
        match self {
            Self::Thruster(i) => i,
            Self::Wrench(i) => i,
            Self::PassiveForce(i) => i,
            Self::GravityGradient(i) => i,
        }
    }
}

/// The inputs of a mission whose model this is. Allocates.
///
/// # Errors
/// `Config::Input` for numbers that only a simulation can tell to be impossible, such as the square of a length that overflows.
pub fn declare(specs: &[InputSpec], model: &Model) -> Result<Vec<Declared>, Problems> {
    let mut problems = Problems::default();
    let mut all = Vec::with_capacity(specs.len());
    for (k, spec) in specs.iter().enumerate() {
        match one(spec, model) {
            Ok(input) => all.push(input),
            Err(e) => {
                let p = Problem::error(Area::Config, "Config::Input", e.to_string()).on(format!("input[{k}]"));
                problems.push(p.hint("give numbers of the size that the robot has"));
            }
        }
    }
    problems.finish(Some(all)).map(|(all, _)| all)
}

fn one(spec: &InputSpec, model: &Model) -> Result<Declared, InputError> {
    let declared = match spec {
        InputSpec::Thruster { host, point_m, direction, thrust } => {
            let Frame { body, placement, .. } = frame(model, host)?;
            let thrust = signal(thrust, |v| [v.force_n])?;
            let (point, along) = (placement.point(&Vector3::from(*point_m)), placement.rot * Vector3::from(*direction));
            Declared::Thruster(Thruster::new(*body, point, along, thrust)?)
        }
        InputSpec::Wrench { host, axes, wrench } => {
            let Frame { body, placement, .. } = frame(model, host)?;
            let given = |lin: [f64; 3], ang: [f64; 3]| Force::new(Vector3::from(lin), Vector3::from(ang));
            let (axes, wrench) = match axes {
                WrenchAxes::Body => {
                    let of_body = signal(wrench, |w| {
                        placement.force_to_parent(&given(w.force_n, w.moment_nm)).to_vector().into()
                    });
                    (Axes::Body, of_body?)
                }
                // The reader has seen to it that the link begins where its body does.
                WrenchAxes::World => {
                    (Axes::World, signal(wrench, |w| given(w.force_n, w.moment_nm).to_vector().into())?)
                }
            };
            Declared::Wrench(AppliedWrench { body: *body, axes, wrench })
        }
        InputSpec::PassiveForce { coordinate, force } => {
            let count = model.np();
            let found = model.passive_coords().iter().position(|(n, _)| n == coordinate);
            let coordinate = found.ok_or(InputError::Coordinate { got: count, count })?;
            let force = signal(force, |e| match e {
                Effort::TorqueNm(x) | Effort::ForceN(x) => [*x],
            })?;
            Declared::PassiveForce(PassiveForce { coordinate, force })
        }
        InputSpec::GravityGradient { mu_m3_per_s2, radius_m, radial, normal } => {
            let mu = mu_m3_per_s2.unwrap_or(GravityGradient::EARTH);
            Declared::GravityGradient(GravityGradient::new(mu, *radius_m, (*radial).into(), (*normal).into())?)
        }
    };
    declared.as_input().check(model)?;
    Ok(declared)
}

/// The frame of a link or client, which the reader has looked up before.
fn frame<'m>(model: &'m Model, host: &str) -> Result<&'m Frame, InputError> {
    let last = model.n_bodies() - 1;
    model.frame(host).ok_or(InputError::Body { got: last + 1, last })
}

fn signal<V, const N: usize>(course: &Course<V>, value: impl Fn(&V) -> [f64; N]) -> Result<Signal<N>, InputError> {
    match course {
        Course::Constant(v) => Signal::constant(value(v)),
        Course::Pulse(all) => {
            let pulse = all.iter().map(|p| Pulse { start_s: p.t_on_s, end_s: p.t_off_s, value: value(&p.value) });
            Signal::pulses(pulse.collect())
        }
        Course::Sample(all) => {
            Signal::sampled(all.iter().map(|s| s.t_s).collect(), all.iter().map(|s| value(&s.value)).collect())
        }
    }
}

/// The inputs of a mission in words, for `ffid check`.
pub struct Lines<'a>(pub &'a [InputSpec]);

impl Display for Lines<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\ninputs ({}), for `ffid simulate`", self.0.len())?;
        for spec in self.0 {
            match spec {
                InputSpec::Thruster { host, thrust, .. } => writeln!(f, "  thruster on {host}: {}", when(thrust))?,
                InputSpec::Wrench { host, axes, wrench } => {
                    let axes = if *axes == WrenchAxes::Body { "body" } else { "world" };
                    writeln!(f, "  wrench on {host} in {axes} axes: {}", when(wrench))?;
                }
                InputSpec::PassiveForce { coordinate, force } => {
                    writeln!(f, "  passive_force on {coordinate}: {}", when(force))?;
                }
                InputSpec::GravityGradient { radius_m, .. } => {
                    writeln!(f, "  gravity_gradient on everything: at all times, {radius_m} m from the centre")?;
                }
            }
        }
        Ok(())
    }
}

fn when<V>(course: &Course<V>) -> String {
    let span = |what: &str, n: usize, times: &mut dyn Iterator<Item = (f64, f64)>| {
        let (from, to) = times.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (x, y)| (a.min(x), b.max(y)));
        format!("{n} {what}{}, from {from} to {to} s", if n == 1 { "" } else { "s" })
    };
    match course {
        Course::Constant(_) => "at all times".to_owned(),
        Course::Pulse(p) => span("pulse", p.len(), &mut p.iter().map(|p| (p.t_on_s, p.t_off_s))),
        Course::Sample(s) => span("sample", s.len(), &mut s.iter().map(|s| (s.t_s, s.t_s))),
    }
}

/// What inputs did to the robot during a simulation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Acted {
    /// How many there were.
    pub inputs: usize,
    /// Their impulse in world axes (N s): what the momentum has gained.
    pub impulse_ns: [f64; 3],
    /// Their angular impulse about the world origin, in world axes (N m s).
    pub angular_impulse_nms: [f64; 3],
    /// Their work (J).
    pub work_j: f64,
}

impl Acted {
    /// Of a simulation; `None` without inputs.
    pub fn of(inputs: usize, trace: &Trace) -> Option<Self> {
        let (last, work) = (trace.impulse.row_iter().last()?, trace.input_work.last()?);
        let three = |from: usize| [0, 1, 2].map(|k| last[from + k]);
        let acted = Self { inputs, impulse_ns: three(0), angular_impulse_nms: three(3), work_j: *work };
        (inputs > 0).then_some(acted)
    }
}

impl Display for Acted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let three = |[x, y, z]: [f64; 3]| format!("[{x:.6}, {y:.6}, {z:.6}]");
        let (p, l) = (three(self.impulse_ns), three(self.angular_impulse_nms));
        writeln!(
            f,
            "  inputs ({}): impulse {p} N s, {l} N m s about the world origin, work {:.6} J",
            self.inputs, self.work_j
        )
    }
}
