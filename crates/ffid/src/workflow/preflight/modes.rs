//! Who sees which mode.
//!
//! At every sample the passive motion is split into the modes of the start pose, `eta - rest = sum_k psi_k x_k`, by
//! their orthogonality: `x_k = psi_k^T H_p* (eta - rest) / (psi_k^T H_p* psi_k)`. With the mass matrix at the sample's
//! joint positions, mode `k` then adds to the sensors
//!
//! ```text
//! base       a_k = -H_b^-1 H_bp psi_k          (per unit of modal acceleration)
//! torques    (H_bm^T a_k + H_mp psi_k) x_k..   (N m)
//! gyro       [a_k]_ang x_k.                    (rad/s)
//! ```
//!
//! The shapes are kept while the arm moves; what they do to base and joints follows the arm.
//!
//! Whether a sensor could see the mode at all is another question than whether this trajectory shows it: ringing freely at
//! the start pose with amplitude `X`, a mode of `w` rad/s reads at most `|load| w^2 X` and `|rate| w X`, which gives the
//! amplitude that stands out of the noise.

use super::error::PreflightError;
use super::question::Question;
use ff_dynamics::analysis::ModesError;
use ff_dynamics::tree::MassBlocks;
use ff_dynamics::{Mode, SimError, State, Trace, Work, hybrid_dynamics, mass_matrix};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Signal-to-noise ratio over the whole record above which a mode counts as seen: its amplitude is then known to a tenth.
pub const SENSED: f64 = 10.0;
/// Most samples looked at.
const MOST: usize = 10_000;

/// How a kind of sensor sees a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Seen {
    /// Stands out of the noise: its peak exceeds one standard deviation of a sample.
    Plainly,
    /// Buried in the noise of a sample, but the whole record shows it ([`SENSED`]).
    Buried,
    /// Not even the whole record shows it.
    Not,
}

/// What a kind of sensor reads of a mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reading {
    /// Largest contribution to any channel, in the unit of the sensor.
    pub peak: f64,
    /// The same over the noise of one sample.
    pub peak_over_noise: f64,
    /// Amplitude of free ringing at the start pose that would reach the noise of one sample (unit of the mode's largest
    /// coordinate); absent when the sensor reads nothing of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ringing_at_noise: Option<f64>,
    /// Signal-to-noise ratio over all samples and channels, `sqrt(sum (contribution / sigma)^2)`.
    pub record_snr: f64,
    /// The verdict.
    pub seen: Seen,
}

/// One mode and who sees it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModeVisibility {
    /// Undamped natural frequency (Hz).
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Shape over the passive coordinates, largest 1.
    pub passive: Vec<f64>,
    /// Largest amplitude `|x|` along the trajectory (unit of the largest coordinate).
    pub peak_amplitude: f64,
    /// The joint torque sensors (N m).
    pub torque: Reading,
    /// The gyro (rad/s).
    pub gyro: Reading,
}

/// Sums over samples.
#[derive(Clone, Copy, Default)]
struct Sum {
    peak: f64,
    square: f64,
}

impl Sum {
    fn add(&mut self, x: f64) {
        self.peak = self.peak.max(x.abs());
        self.square += x * x;
    }
    /// `gain`: reading per unit of ringing amplitude.
    fn read(self, sigma: f64, every: usize, gain: f64) -> Reading {
        let (peak_over_noise, record_snr) = (self.peak / sigma, (self.square * every as f64).sqrt() / sigma);
        let seen = match () {
            () if record_snr < SENSED => Seen::Not,
            () if peak_over_noise < 1.0 => Seen::Buried,
            () => Seen::Plainly,
        };
        let at_noise = sigma / gain;
        let ringing_at_noise = at_noise.is_finite().then_some(at_noise);
        Reading { peak: self.peak, peak_over_noise, ringing_at_noise, record_snr, seen }
    }
}

pub(super) fn visibility(
    q: &Question<'_>,
    modes: &[Mode],
    t: &Trace,
    rest: &[f64],
) -> Result<Vec<ModeVisibility>, PreflightError> {
    let (model, params) = (q.model, q.params);
    let m = model.np();
    if m == 0 {
        return Ok(Vec::new());
    }
    let (nb, nj, nv) = (model.nb(), model.nj(), model.nv());
    let mut work = Work::new(model);
    let mut h = DMatrix::zeros(nv, nv);
    let (mut a, mut tau) = (vec![0.0; nv], vec![0.0; nj]);
    let mut blocks = |state: &State<f64>, work: &mut Work<f64>| {
        mass_matrix(model, params, state, work, &mut h);
        MassBlocks::new(&h, nb, nj)
    };
    let solve = |b: &MassBlocks| -> Result<DMatrix<f64>, PreflightError> {
        let chol = b.h_b.clone().cholesky().ok_or(ModesError::Singular)?;
        Ok(-chol.solve(&b.h_bp))
    };
    // Rows that pick a mode out of the passive coordinates: psi^T H_p* / (psi^T H_p* psi) at the start.
    let mut state = t.state(model, 0);
    state.eta.copy_from_slice(rest);
    let b = blocks(&state, &mut work);
    let base = solve(&b)?;
    let inertia = &b.h_p + b.h_bp.tr_mul(&base);
    let load = b.h_bm.tr_mul(&base) + &b.h_mp;
    let shapes: Vec<DVector<f64>> = modes.iter().map(|m| DVector::from_column_slice(&m.passive)).collect();
    let pick: Vec<DVector<f64>> = shapes.iter().map(|s| (&inertia * s) / s.dot(&(&inertia * s))).collect();
    let gains: Vec<(f64, f64)> = modes
        .iter()
        .zip(&shapes)
        .map(|(m, s)| {
            let w = std::f64::consts::TAU * m.frequency_hz;
            (w * w * (&load * s).amax(), w * (&base * s).rows(3, 3).amax())
        })
        .collect();
    let every = t.len().div_ceil(MOST);
    let mut sums = vec![(0.0f64, Sum::default(), Sum::default()); modes.len()];
    for i in (0..t.len()).step_by(every) {
        let mut state = t.state(model, i);
        let qdd: Vec<f64> = t.qdd.row(i).iter().copied().collect();
        let singular = |source| SimError::Singular { t: i as f64 * t.dt, source };
        hybrid_dynamics(model, params, &state, &qdd, &mut work, &mut a, &mut tau).map_err(singular)?;
        let acc = DVector::from_column_slice(&a[nb + nj..]);
        let rate = DVector::from_column_slice(state.nu());
        let off = DVector::from_fn(m, |k, _| state.eta[k] - rest[k]);
        state.eta.copy_from_slice(rest);
        let b = blocks(&state, &mut work);
        let base = solve(&b)?;
        let load = b.h_bm.tr_mul(&base) + &b.h_mp;
        for ((shape, pick), (amplitude, torque, gyro)) in shapes.iter().zip(&pick).zip(&mut sums) {
            *amplitude = amplitude.max(pick.dot(&off).abs());
            let (x2, x1) = (pick.dot(&acc), pick.dot(&rate));
            (&load * shape).iter().for_each(|l| torque.add(l * x2));
            (&base * shape).iter().skip(3).for_each(|w| gyro.add(w * x1));
        }
    }
    let mut out = Vec::with_capacity(modes.len());
    for (mode, ((amplitude, torque, gyro), gain)) in modes.iter().zip(sums.into_iter().zip(&gains)) {
        out.push(ModeVisibility {
            frequency_hz: mode.frequency_hz,
            damping_ratio: mode.damping_ratio,
            passive: mode.passive.clone(),
            peak_amplitude: amplitude,
            torque: torque.read(q.sensing.torque_nm, every, gain.0),
            gyro: gyro.read(q.sensing.gyro_rad_per_s, every, gain.1),
        });
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::open::{Opened, open};
    use crate::workflow::preflight::Sensing;
    use ff_dynamics::motion::Hold;
    use ff_dynamics::{Boundary, Drive, SimOptions, modes as modes_of, simulate};
    use ff_mission::mission::Limits;
    use ff_model::Params;

    /// Every mode of the paper's panels rung alone at the hold pose: all that the sensors then read is that mode, so the
    /// verdict's contributions must be the readings of the simulation.
    #[test]
    fn what_is_said_of_a_mode_is_what_the_sensors_read_when_it_rings_alone() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/flex.toml");
        let opened: Opened = open(file.as_ref(), Default::default()).unwrap();
        let (model, params) = (&opened.model, Params::nominal(&opened.model));
        let (pose, rest) = (opened.pose(), opened.model.rest_position(&params));
        let modes = modes_of(model, &params, &pose, &rest, Boundary::JointsHeld).unwrap();
        let motion = Hold::new(pose.clone(), 12.0).unwrap();
        let sensing = Sensing { torque_nm: 0.1, gyro_rad_per_s: 1.5e-4, rate_hz: 100.0 };
        let limits = Limits::default();
        let selected = [0];
        let q = Question {
            model,
            params: &params,
            selected: &selected,
            motion: &motion,
            sensing,
            weak: 0.1,
            proven: None,
            limits: &limits,
            constraints: &[],
            end_effector: None,
            uncertain: None,
            small: None,
        };
        for (k, mode) in modes.iter().enumerate() {
            let amplitude = 2e-3;
            let mut start = State::zero(model);
            start.q.copy_from_slice(&pose);
            start.eta = rest.iter().zip(&mode.passive).map(|(r, p)| r + amplitude * p).collect();
            let o = SimOptions { duration_s: 12.0, step_s: 1e-3, sample_s: 0.01 };
            let t = simulate(model, &params, &start, &Drive::Prescribed(&motion), &o).unwrap();
            let seen = &visibility(&q, &modes, &t, &rest).unwrap()[k];
            let (tau, gyro) = (t.tau.amax(), t.gyro().amax());
            eprintln!(
                "{:.4} Hz: torque {:.3e} of {tau:.3e}, gyro {:.3e} of {gyro:.3e}",
                mode.frequency_hz, seen.torque.peak, seen.gyro.peak
            );
            assert!((seen.torque.peak / tau - 1.0).abs() < 0.02, "{seen:?}, simulated {tau}");
            // The gyro of the symmetric mode is second order small: what little there is may come from elsewhere.
            assert!((seen.gyro.peak - gyro).abs() < 0.02 * gyro + 2e-8, "{seen:?}, simulated {gyro}");
            assert!((seen.peak_amplitude / amplitude - 1.0).abs() < 1e-3);
            let snr = (t.tau.iter().map(|x| x * x).sum::<f64>()).sqrt() / 0.1;
            assert!((seen.torque.record_snr / snr - 1.0).abs() < 0.02);
            // The amplitude that equals the noise: damping takes a little of it within the first period.
            let expected = amplitude * 0.1 / tau;
            assert!((seen.torque.ringing_at_noise.unwrap() / expected - 1.0).abs() < 0.03, "{seen:?}");
        }
    }

    #[test]
    fn the_three_words_follow_peak_and_record() {
        let word = |peak: f64, square: f64| Sum { peak, square }.read(0.5, 4, 2.0).seen;
        // Signal over noise of the record: sqrt(4 square) / 0.5.
        assert_eq!([word(0.4, 6.3), word(0.4, 6.2), word(0.6, 6.3)], [Seen::Buried, Seen::Not, Seen::Plainly]);
        assert_eq!(Sum::default().read(0.5, 1, 0.0).ringing_at_noise, None);
    }
}
