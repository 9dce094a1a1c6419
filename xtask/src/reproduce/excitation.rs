//! The trajectories in numbers.

use super::experiment::Experiment;
use ff_dynamics::motion::JointMotion;
use ff_spectral::{Psd, Welch};

/// Sampling (s).
const STEP_S: f64 = 0.02;
/// Length with zeros behind, in lengths of the motion.
const PADDED: usize = 8;

/// A trajectory in numbers.
pub(super) struct Line {
    pub(super) name: &'static str,
    pub(super) seconds: f64,
    /// Largest joint rate (rad/s) and acceleration (rad/s^2).
    pub(super) rate: f64,
    pub(super) acceleration: f64,
    /// Square root of the density of all joint accelerations at the natural frequencies, mean over these (rad/s^2/sqrt(Hz)).
    pub(super) modes: f64,
}

/// Every trajectory of a case.
pub(super) fn lines(x: &Experiment) -> Vec<Line> {
    x.motions()
        .into_iter()
        .enumerate()
        .map(|(k, (name, m))| line(x, name, m, if k == 0 { x.ring_from } else { m.duration() }))
        .collect()
}

fn line(x: &Experiment, name: &'static str, motion: &dyn JointMotion, seconds: f64) -> Line {
    let n = motion.dof();
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let (mut rate, mut acceleration) = (0.0_f64, 0.0_f64);
    let samples = (seconds / STEP_S).round() as usize + 1;
    let mut all = vec![Vec::with_capacity(samples); n];
    for i in 0..samples {
        motion.eval(i as f64 * STEP_S, &mut q, &mut qd, &mut qdd);
        rate = qd.iter().fold(rate, |m, v| m.max(v.abs()));
        acceleration = qdd.iter().fold(acceleration, |m, a| m.max(a.abs()));
        all.iter_mut().zip(&qdd).for_each(|(s, a)| s.push(*a));
    }
    let densities: Vec<Psd> = Welch::new(samples, 1.0 / STEP_S)
        .map(|w| w.padded(PADDED))
        .map(|mut w| all.iter().filter_map(|s| w.run(s).ok()).collect())
        .unwrap_or_default();
    let at = |hz: f64| -> f64 {
        densities
            .iter()
            .filter_map(|p| {
                let near =
                    p.frequency.iter().enumerate().min_by(|a, b| (a.1 - hz).abs().total_cmp(&(b.1 - hz).abs()))?.0;
                Some(p.density[near])
            })
            .sum()
    };
    let mean = x.modes.iter().map(|m| at(m.frequency_hz)).sum::<f64>() / x.modes.len().max(1) as f64;
    Line { name, seconds, rate, acceleration, modes: mean.sqrt() }
}
