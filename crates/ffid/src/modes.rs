//! Natural modes as plain data, with a word on what each does: for `ffid check` and `ffid modes`.

use crate::open::MAX_DENSE;
use ff_dynamics::analysis::ModesError;
use ff_dynamics::{Boundary, Mode, State, Work, mass_matrix, modes};
use ff_model::{Inertia, Model, Motion, Params};
use nalgebra::DMatrix;
use serde::Serialize;
use std::fmt;

/// A passive coordinate is named in the text when it moves at least this share of the largest one.
const NAMED: f64 = 0.3;
/// The base is called still when it has less than this share of the kinetic energy of the passive coordinates.
const STILL: f64 = 1e-4;

/// The modes of a model at one pose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModeTable {
    /// `base held`, `joints held` or `joints free`.
    pub boundary: &'static str,
    /// Joint positions (rad or m).
    pub joints: Vec<f64>,
    /// Names of the passive coordinates, in the order of [`ModeRow::passive`].
    pub coordinates: Vec<String>,
    /// Modes by ascending frequency.
    pub modes: Vec<ModeRow>,
}

/// One mode of a [`ModeTable`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModeRow {
    /// Undamped natural frequency (Hz).
    pub frequency_hz: f64,
    /// Damping ratio; 1 or more means overdamped.
    pub damping_ratio: f64,
    /// Frequency of the free oscillation (Hz).
    pub damped_hz: f64,
    /// What the base does: `rotates`, `translates` (its rotation carries less kinetic energy, so that a gyro
    /// sees little of the mode), `still`, or `held`.
    pub base: &'static str,
    /// Shape over the passive coordinates, largest 1.
    pub passive: Vec<f64>,
    /// Motion of the base frame with that shape, linear first (m or rad).
    pub base_motion: [f64; 6],
}

/// Modes with the joints held, appendages at `rest`, for what steps and marks are taken from: none for a model without passive
/// coordinates, and none when it is too large ([`MAX_DENSE`]) or they cannot be computed. Allocates.
pub fn held(model: &Model, params: &Params<f64>, q: &[f64], rest: &[f64]) -> Vec<Mode> {
    if model.np() == 0 || model.nv() > MAX_DENSE {
        return Vec::new();
    }
    modes(model, params, q, rest, Boundary::JointsHeld).unwrap_or_default()
}

impl ModeTable {
    /// Modes at joint positions `q`, parameters nominal, appendages at rest. Allocates.
    ///
    /// # Errors
    /// [`ModesError`].
    ///
    /// # Panics
    /// If `q` has the wrong length.
    pub fn new(model: &Model, q: &[f64], boundary: Boundary) -> Result<Self, ModesError> {
        let params = Params::nominal(model);
        let eta = model.rest_position(&params);
        let found = modes(model, &params, q, &eta, boundary)?;
        let mut state = State::<f64>::zero(model);
        state.q.copy_from_slice(q);
        state.eta.copy_from_slice(&eta);
        let mut h = DMatrix::zeros(model.nv(), model.nv());
        mass_matrix(model, &params, &state, &mut Work::new(model), &mut h);
        let row = |m: Mode| ModeRow {
            base: if model.nb() == 0 || boundary == Boundary::BaseHeld { "held" } else { base_word(&h, &m) },
            frequency_hz: m.frequency_hz,
            damping_ratio: m.damping_ratio,
            damped_hz: m.damped_hz,
            base_motion: m.base.into(),
            passive: m.passive,
        };
        Ok(Self {
            boundary: match boundary {
                Boundary::BaseHeld => "base held",
                Boundary::JointsHeld => "joints held",
                Boundary::JointsFree => "joints free",
            },
            joints: q.to_vec(),
            coordinates: model.passive_coords().into_iter().map(|(name, _)| name).collect(),
            modes: found.into_iter().map(row).collect(),
        })
    }
}

/// Compares the kinetic energies of the base's share: with the whole system rigid, translation of its centre of
/// mass and rotation about it do not mix, whatever the base frame.
fn base_word(h: &DMatrix<f64>, mode: &Mode) -> &'static str {
    let whole = Inertia::from_elements(|i, j| h[(i, j)]);
    let base = Motion::from_slice(mode.base.as_slice());
    let at_com = base.lin + base.ang.cross(&whole.com().unwrap_or_default());
    let translation = 0.5 * whole.mass * at_com.norm_squared();
    let rotation = 0.5 * base.ang.dot(&(whole.about_com() * base.ang));
    let first = h.nrows() - mode.passive.len();
    let n = mode.passive.len();
    let own = nalgebra::DVector::from_column_slice(&mode.passive);
    let passive = 0.5 * (h.view((first, first), (n, n)) * &own).dot(&own);
    if translation.max(rotation) < STILL * passive {
        "still"
    } else if rotation > translation {
        "rotates"
    } else {
        "translates"
    }
}

impl fmt::Display for ModeTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let joints: Vec<String> = self.joints.iter().map(|q| format!("{q:.4}")).collect();
        writeln!(f, "modes ({}), {}, joints at [{}]", self.modes.len(), self.boundary, joints.join(", "))?;
        for m in &self.modes {
            write!(f, "  {:>9.4} Hz  damping {:>6.2} %  base {:10}", m.frequency_hz, 100.0 * m.damping_ratio, m.base)?;
            for (name, x) in self.coordinates.iter().zip(&m.passive).filter(|(_, x)| x.abs() >= NAMED) {
                write!(f, "  {x:+.2} {name}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}
