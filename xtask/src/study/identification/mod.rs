//! Studies of what is identified: `recovery`, `coverage`, `combined`.

mod case;
pub mod combined;
pub mod coverage;
pub mod recovery;

use super::{Op, Study};
use ffid::ident::lm::Settings;

/// When a fit of these studies stops.
fn settings() -> Settings {
    Settings { max_iterations: 100, decrement_tolerance: 1e-10, cost_floor: 1e-13, ..Settings::default() }
}

/// A limit that holds for the whole study only.
fn judged(study: &mut Study, quick: bool, name: String, unit: &'static str, value: f64, (op, limit): (Op, f64)) {
    if quick {
        study.figure(name, unit, value);
    } else {
        study.limited(name, unit, value, op, limit);
    }
}
