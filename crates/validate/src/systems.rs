//! Random systems of mixed appendages on random hosts: momentum, energy with damping on, hand-written bias.
//!
//! A free-floating tree of zero to six bodies on skewed joints carries one to four appendages, each on any body at any
//! pose, with parameters drawn about the nominal ones. It moves by itself for some seconds, joints and appendages
//! damped, and is watched at every step. The integrator is [`crate::extrapolation`], so that the figures show the
//! mechanics; the first step comes from the highest mode, the others from the error estimate.

use crate::conformance::{Source, bias_against_derived};
use crate::extrapolation::{Extrapolation, Stopped};
use ff_dynamics::analysis::{Budget, budget};
use ff_dynamics::tree::SingularInertia;
use ff_dynamics::{Boundary, State, Work, forward_dynamics, modes};
use ff_model::scalar::ModelScalar;
use ff_model::spatial::so3::{exp_so3, quat_mul, quat_to_rot};
use ff_model::tree::JointLimits;
use ff_model::{BaseKind, DynAppendage, Inertia, Joint, JointKind, Model, Motion, Params, PortState, Problems, Xform};
use nalgebra::{Vector3, Vector4};
use serde::Serialize;
use std::sync::Arc;

/// Error of one integration step that is accepted; see [`Extrapolation::new`].
const TOLERANCE: f64 = 1e-14;

/// What became of one system.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SystemFigures {
    /// Seed it was drawn with.
    pub seed: u64,
    /// Moving bodies, the base included.
    pub bodies: usize,
    /// Kinds of its appendages, in order.
    pub kinds: Vec<String>,
    /// Passive coordinates.
    pub coordinates: usize,
    /// Worst drift of linear and of angular momentum (about the world origin), each relative to its start.
    pub momentum: f64,
    /// Worst of `|T + U + dissipated - work of the joints - start|`, relative to the energy at the start.
    pub energy: f64,
    /// Worst difference of a bias and the derived one, relative to the largest entry.
    pub bias: f64,
    /// Energy dissipated by the appendages, relative to the energy at the start.
    pub dissipated: f64,
    /// Length of the motion (s); shorter than asked when a coordinate left its range.
    pub seconds: f64,
    /// Accepted steps.
    pub steps: usize,
}

/// Why a system could not be judged. Each is a defect: random systems are regular.
#[derive(Debug, thiserror::Error)]
pub enum SystemError {
    /// An appendage could not be mounted.
    #[error("seed {seed}: {source}")]
    Mount {
        /// Seed of the system.
        seed: u64,
        /// Why not.
        source: Problems,
    },
    /// The motion stopped.
    #[error("seed {seed}: {source}")]
    Motion {
        /// Seed of the system.
        seed: u64,
        /// Why.
        source: Stopped<SingularInertia>,
    },
}

/// Draws the system of `seed` from `parts`, moves it for `seconds` and measures. Deterministic; allocates.
///
/// # Errors
/// [`SystemError`].
///
/// # Panics
/// If `parts` is empty.
pub fn random_system(
    parts: &[Arc<dyn DynAppendage>],
    seed: u64,
    seconds: f64,
) -> Result<SystemFigures, Box<SystemError>> {
    assert!(!parts.is_empty(), "no appendages to draw from");
    let mut source = Source::new(seed);
    let model = draw_model(parts, &mut source).map_err(|source| SystemError::Mount { seed, source })?;
    let params = draw_params(&model, &mut source);
    let start = draw_state(&model, &params, &mut source);
    let drag: Vec<f64> = (0..model.nj()).map(|_| 1.0 + 4.0 * source.unit()).collect();
    let mut run = Run::new(&model, &params, drag);
    let mut figures = SystemFigures {
        seed,
        bodies: model.n_bodies(),
        kinds: model.appendages().iter().map(|a| a.decl().kind.to_owned()).collect(),
        coordinates: model.np(),
        momentum: 0.0,
        energy: 0.0,
        bias: 0.0,
        dissipated: 0.0,
        seconds: 0.0,
        steps: 0,
    };
    let mut z = run.pack(&start);
    let first = run.budget();
    let mut integrator = Extrapolation::new(z.len(), TOLERANCE);
    // One tenth of a period of the highest mode; step control does the rest.
    let highest = modes(&model, &params, &start.q, &start.eta, Boundary::JointsFree)
        .ok()
        .and_then(|m| m.last().map(|m| m.frequency_hz))
        .unwrap_or(1.0);
    let (mut t, mut step) = (0.0, (0.1 / highest.max(0.1)).min(0.2));
    while t < seconds {
        let taken = integrator.step(t, step.min(seconds - t), &mut z, |_, z, dz| run.rate(z, dz));
        let (done, next) = taken.map_err(|source| SystemError::Motion { seed, source })?;
        (t, step) = (t + done, next);
        figures.steps += 1;
        run.unpack(&z);
        figures.watch(&mut run, &first, &z);
        figures.seconds = t;
        let coords = model.appendages().iter().flat_map(|a| &a.decl().coords);
        if coords.zip(&run.state.eta).any(|(c, x)| *x < c.range.0 || *x > c.range.1) {
            break;
        }
    }
    Ok(figures)
}

impl SystemFigures {
    fn watch(&mut self, run: &mut Run<'_>, first: &Budget<f64>, z: &[f64]) {
        let now = run.budget();
        let [dissipated, work] = [z[z.len() - 2], z[z.len() - 1]];
        let drift = |a: &Vector3<f64>, b: &Vector3<f64>| (a - b).norm() / b.norm();
        let momentum = drift(&now.momentum.lin, &first.momentum.lin).max(drift(&now.momentum.ang, &first.momentum.ang));
        let energy = (now.energy() + dissipated - work - first.energy()).abs() / first.energy();
        let bias = run.bias_error();
        for (worst, x) in [(&mut self.momentum, momentum), (&mut self.energy, energy), (&mut self.bias, bias)] {
            // `max` would drop a NaN.
            *worst = if x.is_nan() { f64::NAN } else { worst.max(x) };
        }
        self.dissipated = dissipated / first.energy();
    }
}

fn draw_inertia(s: &mut Source, scale: f64) -> Inertia<f64> {
    // Point masses: physically consistent, and nothing symmetric by accident.
    (0..6).fold(Inertia::zero(), |mut b, _| {
        b += Inertia::point(scale * (0.2 + 0.8 * s.unit()), &s.vec3(0.8));
        b
    })
}

fn draw_pose(s: &mut Source) -> Xform<f64> {
    Xform::new(quat_to_rot(&exp_so3(&s.vec3(1.7))), s.vec3(0.9))
}

fn draw_model(parts: &[Arc<dyn DynAppendage>], s: &mut Source) -> Result<Model, Problems> {
    let below = |s: &mut Source, n: usize| ((s.unit() * n as f64) as usize).min(n - 1);
    let mut m = Model::new("random", "base", draw_inertia(s, 100.0), BaseKind::Floating);
    let bodies = below(s, 7);
    for i in 0..bodies {
        let parent = below(s, i + 1);
        let kind = match below(s, 4) {
            0 => JointKind::Prismatic,
            1 => JointKind::Continuous,
            _ => JointKind::Revolute,
        };
        let axis = loop {
            let v = s.vec3(1.0);
            if v.norm() > 0.2 {
                break v.normalize();
            }
        };
        let joint =
            Joint { name: format!("j{i}"), kind, axis, placement: draw_pose(s), limits: JointLimits::default() };
        let body = draw_inertia(s, 6.0);
        m.add_body(parent, format!("l{i}"), joint, body);
    }
    for k in 0..1 + below(s, 4) {
        let (host, part) = (below(s, bodies + 1), below(s, parts.len()));
        m.mount(format!("a{k}"), host, draw_pose(s), parts[part].clone())?;
    }
    Ok(m)
}

fn draw_params(model: &Model, s: &mut Source) -> Params<f64> {
    let mut values = Params::<f64>::nominal(model).values().to_vec();
    for a in model.appendages() {
        let own = s.parameters(a.decl());
        values[a.param_offset..a.param_offset + own.len()].copy_from_slice(&own);
    }
    Params::from_values(model, values)
}

fn draw_state(model: &Model, params: &Params<f64>, s: &mut Source) -> State<f64> {
    let mut state = State::zero(model);
    state.pos = s.vec3(1.0);
    state.att = exp_so3(&s.vec3(1.5));
    state.q.iter_mut().for_each(|x| *x = s.sym(2.5));
    state.v.iter_mut().for_each(|x| *x = s.sym(0.12));
    for (k, a) in model.appendages().iter().enumerate() {
        let rest = ff_model::tree::rest(a, params.appendage(model, k));
        for (i, c) in a.decl().coords.iter().enumerate() {
            // A tenth of the range, and no more than moves of the kind usually are.
            let reach = (0.1 * (c.range.1 - c.range.0)).min(if c.unit == "rad" { 0.2 } else { 0.05 });
            state.eta[a.coord_offset + i] = (rest[i] + s.sym(reach)).clamp(c.range.0, c.range.1);
            state.nu_mut()[a.coord_offset + i] = s.sym(reach);
        }
    }
    state
}

/// A system in motion, as a first-order system `z = [position | quaternion | q | eta | v | dissipated | work]`.
struct Run<'m> {
    model: &'m Model,
    params: &'m Params<f64>,
    drag: Vec<f64>,
    state: State<f64>,
    tau: Vec<f64>,
    work: Work<f64>,
}

impl<'m> Run<'m> {
    fn new(model: &'m Model, params: &'m Params<f64>, drag: Vec<f64>) -> Self {
        Self { model, params, drag, state: State::zero(model), tau: vec![0.0; model.nv()], work: Work::new(model) }
    }

    fn pack(&mut self, s: &State<f64>) -> Vec<f64> {
        self.state.copy_from(s);
        [s.pos.as_slice(), s.att.as_slice(), &s.q, &s.eta, &s.v, &[0.0, 0.0]].concat()
    }

    fn unpack(&mut self, z: &[f64]) {
        let s = &mut self.state;
        let mut at = 0;
        for part in [s.pos.as_mut_slice(), s.att.as_mut_slice(), &mut s.q, &mut s.eta, &mut s.v] {
            let n = part.len();
            part.copy_from_slice(&z[at..at + n]);
            at += n;
        }
        // The quaternion leaves the unit sphere by the error of the integrator, here of the order of rounding.
        s.att /= s.att.norm();
    }

    fn rate(&mut self, z: &[f64], dz: &mut [f64]) -> Result<(), SingularInertia> {
        self.unpack(z);
        let (nj, np) = (self.model.nj(), self.model.np());
        for (j, w) in self.state.qd().iter().enumerate() {
            self.tau[6 + j] = -self.drag[j] * w;
        }
        let (pose, rest) = dz.split_at_mut(7);
        let (rates, rest) = rest.split_at_mut(nj + np);
        let (acc, quad) = rest.split_at_mut(6 + nj + np);
        forward_dynamics(self.model, self.params, &self.state, &self.tau, &mut self.work, acc)?;
        let twist = self.state.base_twist();
        pose[..3].copy_from_slice((quat_to_rot(&self.state.att) * twist.lin).as_slice());
        let spin = Vector4::new(0.0, twist.ang.x, twist.ang.y, twist.ang.z);
        pose[3..].copy_from_slice((quat_mul(&self.state.att, &spin) * 0.5).as_slice());
        rates[..nj].copy_from_slice(self.state.qd());
        rates[nj..].copy_from_slice(self.state.nu());
        let dampers = self.model.appendages().iter().enumerate().map(|(k, a)| {
            let nu = &self.state.nu()[a.coord_offset..a.coord_offset + a.dim()];
            f64::port(&*a.appendage).dissipated_power(self.params.appendage(self.model, k), nu)
        });
        quad[0] = dampers.sum();
        quad[1] = self.tau[6..].iter().zip(self.state.qd()).map(|(t, w)| t * w).sum();
        Ok(())
    }

    fn budget(&mut self) -> Budget<f64> {
        budget(self.model, self.params, &self.state, &mut self.work)
    }

    /// The worst of all ports at the present state.
    fn bias_error(&self) -> f64 {
        let mut twists: Vec<Motion<f64>> = vec![self.state.base_twist()];
        for (i, b) in self.model.bodies().iter().enumerate() {
            let (axis, zero) = (b.joint.axis, Vector3::zeros());
            let (turn, shift, screw) = match b.joint.kind {
                JointKind::Prismatic => (zero, axis * self.state.q[i], Motion::new(axis, zero)),
                _ => (axis * self.state.q[i], zero, Motion::new(zero, axis)),
            };
            let x = b.joint.placement * Xform::new(quat_to_rot(&exp_so3(&turn)), shift);
            twists.push(x.motion_to_child(&twists[b.parent]) + screw.scaled(self.state.qd()[i]));
        }
        let ports = self.model.appendages().iter().enumerate().map(|(k, a)| {
            let r = a.coord_offset..a.coord_offset + a.dim();
            let host = a.mount.motion_to_child(&twists[a.host]);
            let s = PortState { host, eta: &self.state.eta[r.clone()], nu: &self.state.nu()[r] };
            bias_against_derived(&*a.appendage, self.params.appendage(self.model, k), &s)
        });
        ports.fold(0.0, |worst: f64, x| if x.is_nan() { f64::NAN } else { worst.max(x) })
    }
}
