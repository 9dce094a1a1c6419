//! What one part of a record hands to the next.

use crate::linalg::rows::BLOCK;
use crate::reduced::sensitivity::partials::state_columns;
use crate::reduced::sensitivity::wanted::Wanted;
use crate::sim::attitude::AttitudeTrack;
use ff_model::Model;

/// What is handed from one part of a record to the next: state, its derivatives, and the attitude where it is wanted.
#[derive(Clone, Debug)]
pub struct Carried {
    pub(crate) z: Vec<f64>,
    /// By block of columns, as `propagate.rs` keeps them.
    pub(crate) dz: Vec<f64>,
    pub(crate) track: Option<AttitudeTrack>,
    pub(crate) dtheta: Vec<f64>,
}

impl Carried {
    /// At the first sample of a record, with the state `z0 = [V 6 | eta m | nu m]`. Allocates.
    ///
    /// # Panics
    /// If `z0` has the wrong length or an initial state does not exist.
    pub fn start(model: &Model, z0: &[f64], wanted: &Wanted) -> Self {
        let nz = 6 + 2 * model.np();
        assert_eq!(z0.len(), nz, "initial state");
        assert!(wanted.initial.iter().all(|&i| i < nz), "index of an initial state");
        let dz = initial_columns(model, wanted);
        let width = wanted.len().next_multiple_of(BLOCK);
        let dtheta = vec![0.0; if wanted.attitude { 3 * width } else { 0 }];
        Self { z: z0.to_vec(), dz, track: wanted.attitude.then(AttitudeTrack::default), dtheta }
    }
}

/// Columns `dz` at the beginning of a record, by block: one for each wanted initial state.
fn initial_columns(model: &Model, wanted: &Wanted) -> Vec<f64> {
    let (m, nz) = (model.np(), state_columns(model));
    let mut dz = vec![0.0; nz * wanted.len().next_multiple_of(BLOCK)];
    for (c, &i) in wanted.initial.iter().enumerate() {
        // The state of the record is `[v | w | eta | nu]`.
        let (row, c) = (if i < 3 { 3 + 2 * m + i } else { i - 3 }, wanted.forced() + c);
        if row < nz {
            dz[(c / BLOCK * nz + row) * BLOCK + c % BLOCK] = 1.0;
        }
    }
    dz
}
