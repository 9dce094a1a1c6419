//! The laws of mechanics, asked of the simulation of one robot: a check of the model and of this program on it.
//!
//! The joints follow a smooth motion from rest, springs relaxed, in steps `h`, `h/2` and `h/4`:
//!
//! | law | number |
//! |---|---|
//! | momentum of a free-floating system without gravity stays zero | its largest value over the momentum of the parts that move |
//! | energy changes by the work of the joints less what dampers take | the largest difference over the largest energy |
//! | dampers only take | the most they gave back over what they took |
//! | the integrator is of fourth order | `log2(|x_h - x_h/2| / |x_h/2 - x_h/4|)` of all states |

use crate::modes::held;
use crate::open::nominal_pose;
use crate::sense::from_rest;
use crate::workflow::preflight::step;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{SimError, SimOptions, Trace};
use ff_model::{BaseKind, Model, Params};
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;

/// Length of the motion (s), and samples looked at.
const DURATION: f64 = 8.0;
const SAMPLES: usize = 40;
/// Amplitude of the joints at most (rad or m), halved while an appendage leaves its range.
const AMPLITUDE: f64 = 0.3;
/// Largest relative error of a balance.
pub const BALANCE: f64 = 1e-6;
/// Least order; 4 less what a coarse first step takes.
pub const ORDER: f64 = 3.5;
/// Differences below this are rounding.
const ROUNDING: f64 = 1e-12;

/// One law.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Law {
    /// Which.
    pub name: &'static str,
    /// The number; absent where it cannot be asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// What it is held to.
    pub limit: f64,
    /// Whether it is kept.
    pub holds: bool,
    /// What the number is, or why there is none.
    pub meaning: String,
}

/// All laws.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SelfCheck {
    /// Name of the robot.
    pub robot: String,
    /// Longest of the three steps (s).
    pub step_s: f64,
    /// Amplitude of the joints (rad or m).
    pub amplitude: f64,
    /// The laws.
    pub laws: Vec<Law>,
}

impl SelfCheck {
    /// True when all are kept.
    pub fn holds(&self) -> bool {
        self.laws.iter().all(|l| l.holds)
    }
}

/// `q_j(t) = q_j0 + a_j (1 - cos w_j t) / 2`: every joint at its own frequency, from rest.
struct Wave {
    start: Vec<f64>,
    amplitude: Vec<f64>,
}

impl Wave {
    fn rate(j: usize) -> f64 {
        TAU * (0.11 + 0.037 * j as f64)
    }
}

impl JointMotion for Wave {
    fn dof(&self) -> usize {
        self.start.len()
    }
    fn duration(&self) -> f64 {
        DURATION
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        for j in 0..self.start.len() {
            let (a, w) = (0.5 * self.amplitude[j], Self::rate(j));
            let (sin, cos) = (w * t).sin_cos();
            q[j] = self.start[j] + a * (1.0 - cos);
            qd[j] = a * w * sin;
            qdd[j] = a * w * w * cos;
        }
    }
}

/// Moves the robot and asks. Allocates.
///
/// # Errors
/// [`SimError`] when it cannot be simulated even with small motions.
pub fn check(model: &Model) -> Result<SelfCheck, SimError> {
    let params = Params::nominal(model);
    let mut amplitude = AMPLITUDE;
    loop {
        match at(model, &params, amplitude) {
            Err(SimError::Range { .. }) if amplitude > 1e-3 => amplitude *= 0.5,
            other => return other,
        }
    }
}

fn at(model: &Model, params: &Params<f64>, amplitude: f64) -> Result<SelfCheck, SimError> {
    let start = nominal_pose(model);
    // Into the range of a joint, whichever way there is room.
    let room = |(b, q): (&ff_model::Body, &f64)| {
        let (up, down) = (b.joint.limits.upper - q, q - b.joint.limits.lower);
        if up >= down { amplitude.min(up) } else { -amplitude.min(down) }
    };
    let motion = Wave { amplitude: model.own_bodies().zip(&start).map(room).collect(), start: start.clone() };
    let rest = model.rest_position(params);
    let found = held(model, params, &start, &rest);
    let sample_s = DURATION / SAMPLES as f64;
    // The step that simulations take; halved twice, the balances are those of the finest.
    let step_s = step(&found, DURATION, 0.1 * sample_s);
    let run = |h: f64| from_rest(model, params, &motion, &SimOptions { duration_s: DURATION, step_s: h, sample_s });
    let traces = [run(step_s)?, run(0.5 * step_s)?, run(0.25 * step_s)?];
    let finest = &traces[2];
    let mut laws = Vec::new();
    laws.push(momentum(model, params, finest));
    laws.extend(energy(model, params, finest));
    laws.push(order(&traces));
    Ok(SelfCheck { robot: model.name().to_owned(), step_s, amplitude, laws })
}

fn law(name: &'static str, value: f64, limit: f64, holds: bool, meaning: &str) -> Law {
    // What is not finite is no number, and no law kept.
    Law {
        name,
        value: value.is_finite().then_some(value),
        limit,
        holds: holds && value.is_finite(),
        meaning: meaning.to_owned(),
    }
}

fn momentum(model: &Model, params: &Params<f64>, t: &Trace) -> Law {
    let name = "momentum";
    if model.base_kind() == BaseKind::Fixed || model.gravity().norm() > 0.0 {
        let meaning = "not asked: a fixed base or gravity changes it".to_owned();
        return Law { name, value: None, limit: BALANCE, holds: true, meaning };
    }
    let (mut worst, mut scale) = (0.0f64, 0.0f64);
    for i in 0..t.len() {
        let b = t.budget(model, params, i);
        // Momentum over mass and over the speed that its kinetic energy amounts to: a pure number.
        worst = worst.max(b.momentum.lin.norm());
        scale = scale.max((2.0 * b.kinetic * b.mass).sqrt());
    }
    let value = if scale > 0.0 { worst / scale } else { 0.0 };
    law(name, value, BALANCE, value <= BALANCE, "largest linear momentum over that of the moving parts")
}

fn energy(model: &Model, params: &Params<f64>, t: &Trace) -> [Law; 2] {
    let first = t.budget(model, params, 0).energy();
    let (mut worst, mut scale, mut back) = (0.0f64, 0.0f64, 0.0f64);
    for i in 0..t.len() {
        let b = t.budget(model, params, i);
        worst = worst.max((b.energy() - first - t.work[i] + t.dissipated[i]).abs());
        scale = scale.max(b.kinetic.abs()).max(t.work[i].abs());
        if i > 0 {
            back = back.max(t.dissipated[i - 1] - t.dissipated[i]);
        }
    }
    let value = if scale > 0.0 { worst / scale } else { 0.0 };
    let given = if scale > 0.0 { back / scale } else { 0.0 };
    [
        law(
            "energy",
            value,
            BALANCE,
            value <= BALANCE,
            "largest error of energy = work - dissipation, over the energy",
        ),
        law("dissipation", given, ROUNDING, given <= ROUNDING, "most that dampers gave back, over the energy"),
    ]
}

fn order(t: &[Trace; 3]) -> Law {
    let apart = |a: &Trace, b: &Trace| {
        [(&a.twist, &b.twist), (&a.eta, &b.eta), (&a.nu, &b.nu)]
            .into_iter()
            .map(|(x, y)| (x - y).norm_squared())
            .sum::<f64>()
            .sqrt()
    };
    let size = (t[2].twist.norm_squared() + t[2].eta.norm_squared() + t[2].nu.norm_squared()).sqrt();
    let (coarse, fine) = (apart(&t[0], &t[1]), apart(&t[1], &t[2]));
    let name = "order of the integrator";
    if coarse <= ROUNDING * size * 100.0 {
        let meaning = "not asked: the steps differ by rounding alone".to_owned();
        return Law { name, value: None, limit: ORDER, holds: true, meaning };
    }
    let value = (coarse / fine).log2();
    law(name, value, ORDER, value >= ORDER, "by halving the step twice; fourth order is 4")
}

impl fmt::Display for SelfCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {DURATION} s, joints by {} (rad, m), steps of {:.3e} s, halved twice",
            self.robot, self.amplitude, self.step_s
        )?;
        for l in &self.laws {
            let word = if l.holds { "holds" } else { "BROKEN" };
            let value = l.value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3e}"));
            writeln!(f, "  {:24} {word:6} {value:>11} (limit {:.1e}): {}", l.name, l.limit, l.meaning)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_mission::Leniency;
    use std::path::PathBuf;

    #[test]
    fn robots_of_many_kinds_keep_the_laws() {
        for file in ["paper/flex.toml", "paper/slosh.toml", "kinds/all.toml", "paper/robot.urdf"] {
            let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(file);
            let model = crate::open::open(&path, Leniency::default()).unwrap().model;
            let c = check(&model).unwrap();
            assert!(c.holds() && c.laws.len() == 4, "{file}\n{c}");
        }
    }

    #[test]
    fn broken_laws_are_seen() {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/paper/slosh.toml");
        let model = crate::open::open(&path, Leniency::default()).unwrap().model;
        let params = Params::nominal(&model);
        let motion = Wave { start: vec![0.1; 7], amplitude: vec![0.2; 7] };
        let options = SimOptions { duration_s: DURATION, step_s: 0.02, sample_s: 0.2 };
        let mut t = from_rest(&model, &params, &motion, &options).unwrap();
        assert!(momentum(&model, &params, &t).holds && energy(&model, &params, &t).iter().all(|l| l.holds));
        t.dissipated[20] *= 0.5;
        assert!(energy(&model, &params, &t).iter().all(|l| !l.holds));
        t.twist[(11, 0)] += 1e-3;
        assert!(!momentum(&model, &params, &t).holds);
    }
}
