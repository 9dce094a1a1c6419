//! The paper's simplified excitation (section II-A.2): joints parallel to the flexible hinges move at full
//! speed and acceleration, "close to dirac impulse", then hold while the appendages ring.
//!
//! Velocity is a trapezoid whose corners are rounded by a ramp of length `r`, so that the acceleration is
//! continuous and the jerk is `a / r`:
//! ```text
//! acceleration  /---\                      ramp r, plateau k, ramp r: length Ta = 2r + k, gains v = a (r + k)
//!              /     \____________         cruise Tc; the angle of the whole move is D = v (Ta + Tc)
//!                                 \     /
//!                                  \---/
//! ```
//! The two pulses of a move have opposite signs, `Ta + Tc` apart; half a period of a mode apart, they push
//! it twice in phase. In a doublet each lobe (`2 Ta + Tc`) lasts half a period, so that the velocity is one
//! period of a rounded square wave.

use crate::plan::manoeuvre::ManoeuvreError as E;
use ff_dynamics::motion::JointMotion;
use thiserror::Error;

/// Why a manoeuvre is impossible.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ManoeuvreError {
    /// A number out of range.
    #[error("{what} is {value}; it must be finite and {need}")]
    Value {
        /// Which number.
        what: &'static str,
        /// Its value (SI units).
        value: f64,
        /// What was needed.
        need: &'static str,
    },
    /// A joint that does not exist.
    #[error("joint {joint} does not exist; there are {dof}")]
    Joint {
        /// Index asked for, from 0.
        joint: usize,
        /// Number of joints.
        dof: usize,
    },
    /// A joint commanded twice.
    #[error("joint {0} is commanded twice")]
    Twice(usize),
    /// The half period is shorter than the ramps need.
    #[error("half a period is {half_period} s, but the acceleration ramps alone take {needed} s; shorten the ramp")]
    RampTooLong {
        /// Half the period asked for, on the grid if there is one (s).
        half_period: f64,
        /// Length of the shortest possible move or lobe (s).
        needed: f64,
    },
}

/// Go somewhere and stay, or go there and come back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One move.
    Single,
    /// A move and at once its reverse; the joint ends where it began.
    Doublet,
}

/// How far a joint moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// By an angle, with sign (rad or m), as fast as the limits allow.
    Angle(f64),
    /// As far as full speed carries it when the pulses are timed at half the period of a mode (see the
    /// module documentation).
    HalfPeriod {
        /// Frequency of the mode (Hz).
        frequency: f64,
        /// True to move towards negative positions first.
        negative: bool,
    },
}

/// What one joint does.
///
/// ```
/// use excitation::JointCommand;
/// use excitation::plan::{Extent, Shape};
/// use excitation::{Manoeuvre, ManoeuvreSpec};
///
/// let shoulder = JointCommand { joint: 0, shape: Shape::Single, extent: Extent::Angle(-0.25), velocity: 0.17, acceleration: 0.3 };
/// let spec = ManoeuvreSpec { start: vec![0.3, -0.7], commands: vec![shoulder], ramp: 0.1, lead: 2.0, hold: 40.0, grid: None };
/// let manoeuvre = Manoeuvre::new(&spec)?;
///
/// let Extent::Angle(asked) = shoulder.extent else { unreachable!() };
/// let done = manoeuvre.moves()[0];
/// assert!((done.angle - asked).abs() < 1e-12 && done.velocity <= shoulder.velocity);
/// # Ok::<(), excitation::plan::ManoeuvreError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCommand {
    /// Joint index, from 0.
    pub joint: usize,
    /// Single move or doublet.
    pub shape: Shape,
    /// How far.
    pub extent: Extent,
    /// Greatest speed (rad/s or m/s).
    pub velocity: f64,
    /// Greatest acceleration (rad/s^2 or m/s^2).
    pub acceleration: f64,
}

/// A manoeuvre to build.
///
/// ```
/// use excitation::JointCommand;
/// use excitation::plan::{Extent, Shape};
/// use excitation::{Manoeuvre, ManoeuvreSpec};
///
/// let shoulder = JointCommand { joint: 0, shape: Shape::Single, extent: Extent::Angle(-0.25), velocity: 0.17, acceleration: 0.3 };
/// let spec = ManoeuvreSpec { start: vec![0.3, -0.7], commands: vec![shoulder], ramp: 0.1, lead: 2.0, hold: 40.0, grid: None };
/// let manoeuvre = Manoeuvre::new(&spec)?;
///
/// // Break times fall on the samples of a 100 Hz record.
/// let on_grid = Manoeuvre::new(&ManoeuvreSpec { grid: Some(0.01), ..spec })?;
/// let end = on_grid.moves()[0].end;
/// assert!((end * 100.0 - (end * 100.0).round()).abs() < 1e-9);
/// # Ok::<(), excitation::plan::ManoeuvreError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ManoeuvreSpec {
    /// Configuration at the start, one entry per joint (rad or m). Joints without command hold it.
    pub start: Vec<f64>,
    /// Joints that move, all starting together.
    pub commands: Vec<JointCommand>,
    /// Ramp time `r` of the acceleration (s), positive.
    pub ramp: f64,
    /// Rest before the move (s).
    pub lead: f64,
    /// Hold after the last joint has stopped, while the appendages ring (s).
    pub hold: f64,
    /// Sample time (s) whose multiples all break times must be. Times are then lengthened, and speeds and
    /// accelerations lowered, so that limits still hold and angles are exact; half periods are rounded to
    /// the nearest multiple.
    pub grid: Option<f64>,
}

/// What a commanded joint was made to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Joint index, from 0.
    pub joint: usize,
    /// Angle of the (first) move, with sign (rad or m).
    pub angle: f64,
    /// Greatest speed reached.
    pub velocity: f64,
    /// Greatest acceleration reached.
    pub acceleration: f64,
    /// Jerk in the ramps (rad/s^3).
    pub jerk: f64,
    /// Start of motion (s).
    pub start: f64,
    /// End of motion (s).
    pub end: f64,
}

/// Constant jerk from `t` on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    t: f64,
    q: f64,
    v: f64,
    a: f64,
    j: f64,
}

/// Fast joint moves with continuous acceleration, then a hold. Implements [`JointMotion`].
///
/// ```
/// use excitation::JointCommand;
/// use excitation::plan::{Extent, Shape};
/// use ff_dynamics::motion::JointMotion;
/// use excitation::{Manoeuvre, ManoeuvreSpec};
///
/// let shoulder = JointCommand { joint: 0, shape: Shape::Single, extent: Extent::Angle(-0.25), velocity: 0.17, acceleration: 0.3 };
/// let spec = ManoeuvreSpec { start: vec![0.3, -0.7], commands: vec![shoulder], ramp: 0.1, lead: 2.0, hold: 40.0, grid: None };
/// let manoeuvre = Manoeuvre::new(&spec)?;
///
/// let (quiet, end) = manoeuvre.ringing(); // the joints hold, the appendages ring
/// assert!((manoeuvre.duration() - end).abs() < 1e-12 && (end - quiet - 40.0).abs() < 1e-9);
/// let (mut q, mut qd, mut qdd) = ([0.0; 2], [0.0; 2], [0.0; 2]);
/// manoeuvre.eval(end, &mut q, &mut qd, &mut qdd);
/// assert!((q[0] - (0.3 - 0.25)).abs() < 1e-12 && qd == [0.0, 0.0]);
/// # Ok::<(), excitation::plan::ManoeuvreError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Manoeuvre {
    start: Vec<f64>,
    /// Pieces per joint; empty where the joint holds.
    pieces: Vec<Vec<Piece>>,
    moves: Vec<Move>,
    breaks: Vec<f64>,
    duration: f64,
}

/// Phase lengths and peaks of one move.
struct Profile {
    ramp: f64,
    plateau: f64,
    cruise: f64,
    acceleration: f64,
    angle: f64,
}

impl Manoeuvre {
    /// Builds the manoeuvre. Allocates; [`JointMotion::eval`] does not.
    ///
    /// # Errors
    /// [`ManoeuvreError`] naming the argument that is out of range.
    pub fn new(spec: &ManoeuvreSpec) -> Result<Self, ManoeuvreError> {
        let n = spec.start.len();
        positive("number of joints", n as f64)?;
        for &q in &spec.start {
            finite("start position", q)?;
        }
        positive("ramp time", spec.ramp)?;
        not_negative("lead time", spec.lead)?;
        not_negative("hold time", spec.hold)?;
        if let Some(h) = spec.grid {
            positive("sample time of the grid", h)?;
        }
        let up = |x: f64| spec.grid.map_or(x, |h| grid_up(x, h));
        let snap = |x: f64| spec.grid.map_or(x, |h| (x / h).round() * h);
        let lead = up(spec.lead);
        let mut pieces = vec![Vec::new(); n];
        let mut moves = Vec::with_capacity(spec.commands.len());
        let mut breaks = vec![0.0, lead];
        let mut end_of_motion = lead;
        for c in &spec.commands {
            if c.joint >= n {
                return Err(E::Joint { joint: c.joint, dof: n });
            }
            if !pieces[c.joint].is_empty() {
                return Err(E::Twice(c.joint));
            }
            let p = Profile::new(c, spec.ramp, spec.grid)?;
            let list = p.pieces(c.shape, lead, spec.start[c.joint], snap);
            let end = list[list.len() - 1].t;
            breaks.extend(list.iter().map(|x| x.t));
            end_of_motion = end_of_motion.max(end);
            moves.push(Move {
                joint: c.joint,
                angle: p.angle,
                velocity: p.acceleration.abs() * (p.ramp + p.plateau),
                acceleration: p.acceleration.abs(),
                jerk: p.acceleration.abs() / p.ramp,
                start: lead,
                end,
            });
            pieces[c.joint] = list;
        }
        let duration = snap(end_of_motion + up(spec.hold));
        breaks.push(duration);
        breaks.sort_by(f64::total_cmp);
        breaks.dedup_by(|a, b| (*a - *b).abs() <= 1e-12 * (1.0 + b.abs()));
        Ok(Self { start: spec.start.clone(), pieces, moves, breaks, duration })
    }
    /// What each commanded joint does, in the order of the commands.
    pub fn moves(&self) -> &[Move] {
        &self.moves
    }
    /// The window in which all joints hold after moving: start and end (s).
    pub fn ringing(&self) -> (f64, f64) {
        (self.moves.iter().map(|m| m.end).fold(0.0, f64::max), self.duration)
    }
    /// Lowest and highest position that a joint takes.
    ///
    /// # Panics
    /// If the joint does not exist.
    pub fn excursion(&self, joint: usize) -> (f64, f64) {
        let a = self.start[joint];
        // Each move is monotonic: its ends are its extremes.
        let b = a + self.moves.iter().find(|m| m.joint == joint).map_or(0.0, |m| m.angle);
        (a.min(b), a.max(b))
    }
}

impl JointMotion for Manoeuvre {
    fn dof(&self) -> usize {
        self.start.len()
    }
    fn duration(&self) -> f64 {
        self.duration
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        for (i, list) in self.pieces.iter().enumerate() {
            let k = list.partition_point(|p| p.t <= t);
            if k == 0 {
                (q[i], qd[i], qdd[i]) = (self.start[i], 0.0, 0.0);
            } else {
                let p = list[k - 1];
                let s = t - p.t;
                q[i] = p.q + s * (p.v + s * (0.5 * p.a + s * p.j / 6.0));
                qd[i] = p.v + s * (p.a + s * 0.5 * p.j);
                qdd[i] = p.a + s * p.j;
            }
        }
    }
    /// Times at which the jerk of some joint jumps, with 0 and the duration.
    fn breaks(&self) -> Vec<f64> {
        self.breaks.clone()
    }
}

impl Profile {
    fn new(c: &JointCommand, ramp: f64, grid: Option<f64>) -> Result<Self, ManoeuvreError> {
        let (vmax, amax) = (c.velocity, c.acceleration);
        positive("velocity of a command", vmax)?;
        positive("acceleration of a command", amax)?;
        let up = |x: f64| grid.map_or(x, |h| grid_up(x, h));
        let down = |x: f64| grid.map_or(x, |h| (x / h + 1e-9).floor() * h);
        let r = up(ramp);
        let full = (vmax / amax - r).max(0.0); // plateau that reaches full speed
        let p = match c.extent {
            Extent::Angle(angle) => {
                finite("angle of a command", angle)?;
                let d = angle.abs();
                positive("size of the angle of a command", d)?;
                let (plateau, cruise) = if d >= vmax * (2.0 * r + full) {
                    (up(full), up((d / vmax - 2.0 * r - up(full)).max(0.0)))
                } else {
                    // Full speed is not reached: D = a (Ta - r) Ta with a = amax, or a shorter pulse.
                    (up((0.5 * (r + (r * r + 4.0 * d / amax).sqrt()) - 2.0 * r).max(0.0)), 0.0)
                };
                let v = angle / (2.0 * r + plateau + cruise);
                Self { ramp: r, plateau, cruise, acceleration: v / (r + plateau), angle }
            }
            Extent::HalfPeriod { frequency, negative } => {
                positive("frequency of a command", frequency)?;
                let exact = 0.5 / frequency;
                let half = grid.map_or(exact, |h| (exact / h).round() * h);
                // Time left for the plateau when the cruise vanishes.
                let (room, needed) = match c.shape {
                    Shape::Single => (half - 2.0 * r, 2.0 * r),
                    Shape::Doublet => (down(0.5 * half) - 2.0 * r, 4.0 * r),
                };
                if room < -1e-12 {
                    return Err(E::RampTooLong { half_period: half, needed });
                }
                let plateau = up(full).min(room.max(0.0));
                let a = (amax).min(vmax / (r + plateau)) * if negative { -1.0 } else { 1.0 };
                let pulse = 2.0 * r + plateau;
                let cruise = match c.shape {
                    Shape::Single => half - pulse,
                    Shape::Doublet => half - 2.0 * pulse,
                };
                let cruise = cruise.max(0.0);
                Self { ramp: r, plateau, cruise, acceleration: a, angle: a * (r + plateau) * (pulse + cruise) }
            }
        };
        Ok(p)
    }
    /// Constant-jerk pieces from `t0` at rest in `q0`; the last one rests for ever.
    fn pieces(&self, shape: Shape, t0: f64, q0: f64, snap: impl Fn(f64) -> f64) -> Vec<Piece> {
        let j = self.acceleration / self.ramp;
        let (r, k) = (self.ramp, self.plateau);
        let v = self.acceleration * (r + k);
        let ta = 2.0 * r + k;
        let mut out = Vec::with_capacity(17);
        let mut t = t0;
        let lobes: &[f64] = if shape == Shape::Single { &[1.0] } else { &[1.0, -1.0] };
        let mut from = q0;
        for &s in lobes {
            // Closed forms at each corner rather than a running sum: no rounding drift.
            let a = self.acceleration;
            let q1 = j * r * r * r / 6.0;
            let v1 = 0.5 * a * r;
            let q2 = q1 + v1 * k + 0.5 * a * k * k;
            let v2 = v1 + a * k;
            let q3 = 0.5 * v * ta;
            let q4 = q3 + v * self.cruise;
            let corners = [
                (r, 0.0, 0.0, 0.0, j),
                (k, q1, v1, a, 0.0),
                (r, q2, v2, a, -j),
                (self.cruise, q3, v, 0.0, 0.0),
                (r, q4, v, 0.0, -j),
                (k, self.angle - q2, v2, -a, 0.0),
                (r, self.angle - q1, v1, -a, j),
            ];
            for (length, q, v, a, j) in corners {
                if length > 0.0 {
                    out.push(Piece { t, q: from + s * q, v: s * v, a: s * a, j: s * j });
                }
                t = snap(t + length);
            }
            from += s * self.angle;
        }
        let end = if shape == Shape::Doublet { q0 } else { q0 + self.angle };
        out.push(Piece { t, q: end, v: 0.0, a: 0.0, j: 0.0 });
        out
    }
}

/// The next multiple of `h`; what is one but for rounding stays.
fn grid_up(x: f64, h: f64) -> f64 {
    (x / h * (1.0 - 1e-13)).ceil().max(0.0) * h
}

fn finite(what: &'static str, value: f64) -> Result<(), ManoeuvreError> {
    if value.is_finite() { Ok(()) } else { Err(E::Value { what, value, need: "not NaN" }) }
}

fn positive(what: &'static str, value: f64) -> Result<(), ManoeuvreError> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(E::Value { what, value, need: "positive" }) }
}

fn not_negative(what: &'static str, value: f64) -> Result<(), ManoeuvreError> {
    if value.is_finite() && value >= 0.0 { Ok(()) } else { Err(E::Value { what, value, need: "not negative" }) }
}
