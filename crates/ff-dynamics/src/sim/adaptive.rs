//! Steps that adapt to the motion, with the error they make and dense output at the samples.
//!
//! Dormand and Prince's pair of orders 5 and 4 (J. R. Dormand, P. J. Prince, *A family of embedded Runge-Kutta
//! formulae*, J. Comput. Appl. Math. 6, 1980) on the configuration manifold: within a step the attitude is
//! `att_0 exp(u)` with `u' = dexp^-1_u(w)`, as in [`crate::sim::integrate`], but with `dexp^-1` in full, since the truncated one
//! has the order of RK4. Samples are read off the continuous extension of order 4, step control is proportional-integral
//! (Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*, II.4 to II.6; Hairer, Wanner, *II*, IV.2).
//!
//! A method of order five needs five derivatives: steps end at the breaks of a prescribed motion
//! ([`crate::motion::joint::JointMotion::breaks`]), at its end, and at the breaks of the inputs, and start afresh behind them.

use crate::sim::inputs::{ExternalInput, breaks_of};
use crate::sim::integrate::QUADRATURES;
use crate::sim::plant::Plant;
use crate::sim::simulate::{Drive, SimError, check_drive, check_state};
use crate::sim::trace::Trace;
use crate::state::State;
use ff_model::spatial::so3::{Quat, exp_so3, quat_mul, quat_normalize, quat_to_rot};
use ff_model::{Model, Params};
use nalgebra::Vector3;

/// Sampling and accuracy of an adaptive simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveOptions {
    /// Length of the simulation (s).
    pub duration_s: f64,
    /// Time between samples (s); steps do not have to meet them.
    pub sample_s: f64,
    /// Error allowed per step in every component of the state and of the quadratures, relative to it.
    pub relative: f64,
    /// The same, absolute, in the SI unit of the component: what a component near zero is allowed.
    pub absolute: f64,
    /// Longest step (s). Short enough not to step over a short event in a torque law, which names no breaks; infinite if
    /// there is none.
    pub max_step_s: f64,
}

impl AdaptiveOptions {
    fn check(&self) -> Result<(), SimError> {
        let finite = [
            ("duration", self.duration_s),
            ("sample time", self.sample_s),
            ("relative tolerance", self.relative),
            ("absolute tolerance", self.absolute),
        ];
        if let Some((what, value)) = finite.into_iter().find(|(_, x)| !(*x > 0.0 && x.is_finite())) {
            return Err(SimError::Options { what, value, extra: "" });
        }
        if self.max_step_s.is_nan() || self.max_step_s <= 0.0 {
            return Err(SimError::Options { what: "longest step", value: self.max_step_s, extra: "" });
        }
        Ok(())
    }
}

/// What the step control did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Steps taken.
    pub steps: usize,
    /// Steps tried and given up.
    pub rejected: usize,
    /// Starts afresh behind a break.
    pub restarts: usize,
    /// Evaluations of the dynamics, those of the samples included.
    pub evaluations: usize,
    /// Shortest step (s).
    pub shortest_s: f64,
    /// Longest step (s).
    pub longest_s: f64,
    /// Estimated errors of all steps added up without signs, for the component of
    /// `[position, attitude, joints, passive, velocity]` where the sum is largest, in its SI unit. A bound of the error at
    /// the end where the motion does not amplify errors, and a generous one: the estimate is that of the method of order
    /// four, the result that of order five.
    pub error: f64,
}

/// Nodes, stages and error weights of the pair.
const C: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
const A: [[f64; 6]; 7] = [
    [0.0; 6],
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
const E: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339_200.0, 22.0 / 525.0, -1.0 / 40.0];
/// Weights of the last term of the continuous extension.
const D: [f64; 7] = [
    -12_715_105_075.0 / 11_282_082_432.0,
    0.0,
    87_487_479_700.0 / 32_700_410_799.0,
    -10_690_763_975.0 / 1_880_347_072.0,
    701_980_252_875.0 / 199_316_789_632.0,
    -1_453_857_185.0 / 822_651_844.0,
    69_997_945.0 / 29_380_423.0,
];
/// Exponents of the controller, its safety, and the most a step may shrink or grow.
const ALPHA: f64 = 0.2 - 0.75 * BETA;
const BETA: f64 = 0.04;
const SAFETY: f64 = 0.9;
const SHRINK: f64 = 0.2;
const GROW: f64 = 10.0;
/// A step below this fraction of the duration means that the equations cannot be followed.
const SMALLEST: f64 = 1e-12;

/// Integrates `start`, under external inputs or none, with steps that keep the estimated error per step within the
/// tolerance.
///
/// Samples are those of [`crate::sim::simulate::simulate_with`] but for the error of either; with [`Drive::Prescribed`] the joint part of
/// `start` is overwritten by the motion. Allocates the trace and buffers once.
///
/// # Errors
/// [`SimError`]; the trace up to there is dropped.
pub fn simulate_adaptive(
    model: &Model,
    params: &Params<f64>,
    start: &State<f64>,
    drive: &Drive<'_>,
    inputs: &[&dyn ExternalInput],
    options: &AdaptiveOptions,
) -> Result<(Trace, StepReport), SimError> {
    options.check()?;
    check_drive(model, drive, inputs)?;
    let samples = (options.duration_s / options.sample_s + 1e-9).floor() as usize + 1;
    let end = (samples - 1) as f64 * options.sample_s;
    let shortest = SMALLEST * options.duration_s;
    let mut borders = match drive {
        Drive::Prescribed(m) => [m.breaks(), vec![m.duration()]].concat(),
        Drive::Torque(_) => Vec::new(),
    };
    borders = breaks_of(inputs, &borders, 0.0, end, 1e3 * shortest);
    borders.push(end);
    let coords = model.passive_coords();
    let mut trace = Trace::new(model, samples, options.sample_s, start);
    let mut flow = Flow::new(model, Plant::new(model, params, drive, inputs), start);
    let mut report = StepReport { shortest_s: f64::INFINITY, evaluations: 3, ..StepReport::default() };
    let mut errors = vec![0.0; flow.y.len() - QUADRATURES];
    flow.plant.enter_step(0.0, borders[0]);
    flow.begin(0.0)?;
    flow.sample(0.0, 0.0, 0, &mut trace)?;
    if samples == 1 {
        report.shortest_s = 0.0;
        trace.last = flow.state;
        return Ok((trace, report));
    }
    let mut control = Control { h: flow.first_step(options, borders[0])?, before: 1e-4, most: GROW };
    let (mut t, mut next) = (0.0, 1);
    for (i, &border) in borders.iter().enumerate() {
        if i > 0 {
            // What jumps at the border is seen from behind it.
            flow.plant.enter_step(t, border);
            flow.begin(t)?;
            (control.before, control.most) = (1e-4, GROW);
            report.restarts += 1;
            report.evaluations += 1;
        }
        while t < border {
            if control.h.is_nan() || control.h < shortest {
                return Err(SimError::StepUnderflow { t, step: control.h });
            }
            let mut h = control.h.min(options.max_step_s);
            // No sliver is left before the border, and no last step that is much shorter than its neighbour.
            let left = border - t;
            if left <= 1.01 * h {
                h = left;
            } else if left < 2.0 * h {
                h = 0.5 * left;
            }
            let to = if h == left { border } else { t + h };
            flow.plant.enter_step(t, border);
            report.evaluations += 6;
            let error = match flow.attempt(t, h, options) {
                Ok(error) => error,
                // A stage far off the solution may have no inertia left; a shorter step stays near it.
                Err(e @ SimError::Singular { .. }) if h * SHRINK < shortest => return Err(e),
                Err(_) => f64::NAN,
            };
            if error.is_nan() || error > 1.0 {
                control.reject(h, error);
                report.rejected += 1;
                continue;
            }
            check_state(&flow.state, &coords, to, h)?;
            errors.iter_mut().zip(&flow.local).for_each(|(sum, e)| *sum += e.abs());
            report.steps += 1;
            (report.shortest_s, report.longest_s) = (report.shortest_s.min(h), report.longest_s.max(h));
            // A sample at a border belongs to what begins there, as in a simulation with fixed steps.
            let last = i + 1 == borders.len();
            while next < samples && next as f64 * options.sample_s <= to + if last { shortest } else { 0.0 } {
                let ts = next as f64 * options.sample_s;
                let behind = if ts < border - shortest || last { border } else { borders[i + 1] };
                flow.plant.enter_step(ts.min(behind), behind);
                flow.sample(ts, ((ts - t) / h).min(1.0), next, &mut trace)?;
                check_state(&flow.state, &coords, ts, h)?;
                report.evaluations += 1;
                next += 1;
            }
            t = to;
            flow.advance();
            control.accept(h, error);
        }
    }
    report.error = errors.iter().fold(0.0, |m, e| m.max(*e));
    trace.last = flow.state;
    Ok((trace, report))
}

/// Proportional-integral step control (Hairer, Wanner II, IV.2).
struct Control {
    /// Length of the next step (s).
    h: f64,
    /// Error of the step before, in units of the tolerance.
    before: f64,
    /// How much the next step may grow: not at all right after a rejection.
    most: f64,
}

impl Control {
    fn accept(&mut self, h: f64, error: f64) {
        let factor = SAFETY * error.max(1e-10).powf(-ALPHA) * self.before.powf(BETA);
        let next = h * factor.clamp(SHRINK, self.most);
        // A step that a border has cut short says nothing against the length planned.
        self.h = if h < self.h && self.most > 1.0 { next.max(self.h) } else { next };
        (self.before, self.most) = (error.max(1e-4), GROW);
    }
    fn reject(&mut self, h: f64, error: f64) {
        let factor = if error.is_finite() { SAFETY * error.powf(-0.2) } else { SHRINK };
        self.h = h * factor.clamp(SHRINK, 1.0);
        self.most = 1.0;
    }
}

/// The motion within a step, in the coordinates of its start: `y = [pos 3 | u 3 | q | eta | v | quadratures]`.
struct Flow<'a> {
    plant: Plant<'a>,
    /// Attitude at the start of the step.
    att: Quat<f64>,
    /// Start and end of the step.
    y: Vec<f64>,
    y1: Vec<f64>,
    k: [Vec<f64>; 7],
    /// The last term of the continuous extension.
    dense: Vec<f64>,
    /// Estimated error per component.
    local: Vec<f64>,
    scratch: Vec<f64>,
    state: State<f64>,
    a: Vec<f64>,
    /// Step of the last attempt (s).
    h: f64,
}

impl<'a> Flow<'a> {
    fn new(model: &Model, plant: Plant<'a>, start: &State<f64>) -> Self {
        let n = 6 + model.nj() + model.np() + model.nv() + QUADRATURES;
        let z = vec![0.0; n];
        let mut y = z.clone();
        y[..3].copy_from_slice(start.pos.as_slice());
        let rest = start.q.iter().chain(&start.eta).chain(&start.v);
        y[6..].iter_mut().zip(rest).for_each(|(y, &x)| *y = x);
        Self {
            plant,
            att: start.att,
            y,
            y1: z.clone(),
            k: std::array::from_fn(|_| z.clone()),
            dense: z.clone(),
            local: z.clone(),
            scratch: z,
            state: start.clone(),
            a: vec![0.0; model.nv()],
            h: 0.0,
        }
    }
    /// The state that `y` means.
    fn load(&mut self, y: &[f64]) {
        let s = &mut self.state;
        s.pos.copy_from_slice(&y[..3]);
        let u = Vector3::new(y[3], y[4], y[5]);
        s.att = quat_normalize(&quat_mul(&self.att, &exp_so3(&u)));
        let rest = s.q.iter_mut().chain(&mut s.eta).chain(&mut s.v);
        rest.zip(&y[6..]).for_each(|(x, &y)| *x = y);
    }
    /// `k[i] = f(t, y)`.
    fn rate(&mut self, t: f64, y: &[f64], i: usize) -> Result<(), SimError> {
        self.load(y);
        let mut quad = [0.0; QUADRATURES];
        let seen = self.plant.inside(t);
        self.plant.accelerate(t, seen, &mut self.state, &mut self.a, &mut quad)?;
        let (s, k) = (&self.state, &mut self.k[i]);
        let twist = s.base_twist();
        k[..3].copy_from_slice((quat_to_rot(&s.att) * twist.lin).as_slice());
        let u = Vector3::new(y[3], y[4], y[5]);
        k[3..6].copy_from_slice(dexp_inv(&u, &twist.ang).as_slice());
        let rest = s.qd().iter().chain(s.nu()).chain(&self.a).chain(&quad);
        k[6..].iter_mut().zip(rest).for_each(|(k, &x)| *k = x);
        Ok(())
    }
    /// First stage of a step that has none before.
    fn begin(&mut self, t: f64) -> Result<(), SimError> {
        let y = std::mem::take(&mut self.y);
        let done = self.rate(t, &y, 0);
        self.y1.copy_from_slice(&y);
        self.y = y;
        done
    }
    /// A first step from the sizes of `y`, `y'` and `y''` (Hairer, Norsett, Wanner I, II.4).
    fn first_step(&mut self, o: &AdaptiveOptions, border: f64) -> Result<f64, SimError> {
        let (d0, d1) = (self.norm(&self.y, o), self.norm(&self.k[0], o));
        let h0 = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 } else { 0.01 * d0 / d1 };
        let h0 = h0.min(border).min(o.max_step_s);
        let y: Vec<f64> = self.y.iter().zip(&self.k[0]).map(|(y, k)| y + h0 * k).collect();
        self.rate(h0, &y, 1)?;
        let second: Vec<f64> = self.k[1].iter().zip(&self.k[0]).map(|(b, a)| (b - a) / h0).collect();
        let d = d1.max(self.norm(&second, o));
        let h1 = if d <= 1e-15 { (1e-3 * h0).max(1e-6) } else { (0.01 / d).powf(0.2) };
        Ok((100.0 * h0).min(h1))
    }
    /// Largest component in units of the tolerance; NaN if there is one.
    fn norm(&self, x: &[f64], o: &AdaptiveOptions) -> f64 {
        let larger = |m: f64, x: f64| if x > m || x.is_nan() { x } else { m };
        x.iter().enumerate().map(|(i, x)| x.abs() / self.tolerance(i, o)).fold(0.0, larger)
    }
    /// Error allowed in component `i`. The rotation vector starts every step at zero; its size is one radian.
    fn tolerance(&self, i: usize, o: &AdaptiveOptions) -> f64 {
        let size = if (3..6).contains(&i) { 1.0 } else { self.y[i].abs().max(self.y1[i].abs()) };
        o.absolute + o.relative * size
    }
    /// One step of length `h` from `y` into `y1`; the estimated error in units of the tolerance.
    fn attempt(&mut self, t: f64, h: f64, o: &AdaptiveOptions) -> Result<f64, SimError> {
        self.h = h;
        let mut y = std::mem::take(&mut self.scratch);
        let mut outcome = Ok(());
        for i in 1..7 {
            for (c, y) in y.iter_mut().enumerate() {
                let sum: f64 = A[i][..i].iter().zip(&self.k).map(|(a, k)| a * k[c]).sum();
                *y = self.y[c] + h * sum;
            }
            outcome = self.rate(t + C[i] * h, &y, i);
            if outcome.is_err() {
                break;
            }
        }
        // The last stage is the end of the step.
        self.y1.copy_from_slice(&y);
        self.scratch = y;
        outcome?;
        for c in 0..self.local.len() {
            let sum = |w: &[f64; 7]| h * w.iter().zip(&self.k).map(|(w, k)| w * k[c]).sum::<f64>();
            (self.local[c], self.dense[c]) = (sum(&E), sum(&D));
        }
        Ok(self.norm(&self.local, o))
    }
    /// Writes sample `i` at time `t`, the fraction `theta` of the last step.
    fn sample(&mut self, t: f64, theta: f64, i: usize, trace: &mut Trace) -> Result<(), SimError> {
        let mut y = std::mem::take(&mut self.scratch);
        let rest = 1.0 - theta;
        for (c, y) in y.iter_mut().enumerate() {
            *y = self.y[c];
            if theta > 0.0 {
                let dy = self.y1[c] - self.y[c];
                let b = self.h * self.k[0][c] - dy;
                let d = dy - self.h * self.k[6][c] - b;
                *y += theta * (dy + rest * (b + theta * (d + rest * self.dense[c])));
            }
        }
        self.load(&y);
        let mut quad = [0.0; QUADRATURES];
        quad.copy_from_slice(&y[y.len() - QUADRATURES..]);
        self.scratch = y;
        let mut rate = [0.0; QUADRATURES];
        self.plant.accelerate(t, t, &mut self.state, &mut self.a, &mut rate)?;
        trace.put(i, &self.state, &self.a, &self.plant.tau, &quad);
        Ok(())
    }
    /// Goes to the end of the last attempt: new coordinates for the attitude, the last stage becomes the first.
    fn advance(&mut self) {
        let u = Vector3::new(self.y1[3], self.y1[4], self.y1[5]);
        self.att = quat_normalize(&quat_mul(&self.att, &exp_so3(&u)));
        self.y.copy_from_slice(&self.y1);
        self.y[3..6].fill(0.0);
        self.k.swap(0, 6);
        // At u = 0 the rate of u is the angular velocity; the other rates do not depend on the coordinates.
        let first = 6 + self.state.q.len() + self.state.eta.len();
        let floating = self.state.v.len() > self.state.q.len() + self.state.eta.len();
        for i in 0..3 {
            self.k[0][3 + i] = if floating { self.y[first + 3 + i] } else { 0.0 };
        }
    }
}

/// `dexp^-1_u(w) = w + u x w / 2 + c u x (u x w)`, `c = (1 - x cot x) / |u|^2`, `x = |u| / 2`, for body rates `w`.
///
/// The coefficient by its series where the closed form would cancel.
fn dexp_inv(u: &Vector3<f64>, w: &Vector3<f64>) -> Vector3<f64> {
    let s = u.norm_squared();
    let c = if s < 0.1 {
        1.0 / 12.0 + s * (1.0 / 720.0 + s * (1.0 / 30_240.0 + s * (1.0 / 1_209_600.0 + s / 47_900_160.0)))
    } else {
        let x = 0.5 * s.sqrt();
        (1.0 - x / x.tan()) / s
    };
    let uw = u.cross(w);
    w + uw * 0.5 + u.cross(&uw) * c
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of a consistent method, quadrature to degree 4, and weights of differences that sum to zero.
    #[test]
    fn the_coefficients_are_those_of_a_method_of_order_five() {
        for i in 0..7 {
            assert!((A[i].iter().sum::<f64>() - C[i]).abs() < 1e-14, "row {i}");
        }
        assert!(E.iter().sum::<f64>().abs() < 1e-15 && D.iter().sum::<f64>().abs() < 1e-13);
        for p in 1..5 {
            let b: f64 = (0..6).map(|j| A[6][j] * C[j].powi(p)).sum();
            assert!((b - 1.0 / (f64::from(p) + 1.0)).abs() < 1e-14, "quadrature of degree {p}");
        }
    }

    /// On both sides of the switch, against what it is for: the rate of `u` for which `exp(u)` turns with `w`.
    #[test]
    fn the_inverse_of_dexp_is_the_rate_of_the_rotation_vector() {
        let w = Vector3::new(-0.7, 0.9, 0.25);
        for size in [1e-3, 0.31, 0.32, 1.9] {
            let u = Vector3::new(0.48, -0.6, 0.64) * size;
            let at = |h: f64| ff_model::spatial::so3::log_so3(&quat_mul(&exp_so3(&u), &exp_so3(&(w * h))));
            let h = 1e-3;
            // Central differences of order four.
            let want = ((at(h) - at(-h)) * 8.0 - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
            assert!((dexp_inv(&u, &w) - want).norm() < 1e-11, "{size}");
        }
        let side = |s: f64| dexp_inv(&(Vector3::new(0.48, -0.6, 0.64) * (0.1f64.sqrt() * s)), &w);
        assert!((side(1.0 - 1e-12) - side(1.0 + 1e-12)).norm() < 1e-12);
    }
}
