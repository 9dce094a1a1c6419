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

use super::{PreflightError, Question};
use crate::dynamics::modes::ModesError;
use crate::dynamics::{MassBlocks, Mode, SimError, State, Trace, Work, hybrid_dynamics, mass_matrix};
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
    fn read(self, sigma: f64, every: usize) -> Reading {
        let (peak_over_noise, record_snr) = (self.peak / sigma, (self.square * every as f64).sqrt() / sigma);
        let seen = match () {
            () if record_snr < SENSED => Seen::Not,
            () if peak_over_noise < 1.0 => Seen::Buried,
            () => Seen::Plainly,
        };
        Reading { peak: self.peak, peak_over_noise, record_snr, seen }
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
    let inertia = &b.h_p + b.h_bp.tr_mul(&solve(&b)?);
    let shapes: Vec<DVector<f64>> = modes.iter().map(|m| DVector::from_column_slice(&m.passive)).collect();
    let pick: Vec<DVector<f64>> = shapes.iter().map(|s| (&inertia * s) / s.dot(&(&inertia * s))).collect();
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
    let one = |(mode, (amplitude, torque, gyro)): (&Mode, (f64, Sum, Sum))| ModeVisibility {
        frequency_hz: mode.frequency_hz,
        damping_ratio: mode.damping_ratio,
        passive: mode.passive.clone(),
        peak_amplitude: amplitude,
        torque: torque.read(q.sensing.torque_nm, every),
        gyro: gyro.read(q.sensing.gyro_rad_per_s, every),
    };
    Ok(modes.iter().zip(sums).map(one).collect())
}
