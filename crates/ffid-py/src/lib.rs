//! The module `ffid._ffid`: numbers and texts in and out of the library. Classes, docstrings and defaults that users see are Python, in
//! `python/ffid`.
// `deny`, not `forbid`: the code that pyo3's macros write allows itself to be unsafe (docs/decisions/0020-python.md).
#![deny(unsafe_code)]

mod arrays;
mod batch;
mod errors;
mod identify;
mod kinds;
mod mission;
mod motion;
mod record;
mod traced;
mod watch;

use pyo3::prelude::*;

/// The compiled part of the package ffid.
#[pymodule]
mod _ffid {
    use super::*;

    #[pymodule_export]
    use crate::identify::{Identification, doctor, identify, load_result, read_table, validate};
    #[pymodule_export]
    use crate::kinds::appendage_kinds;
    #[pymodule_export]
    use crate::mission::{Mission, command, main, options_table};
    #[pymodule_export]
    use crate::motion::{Motion, plan_excitation};
    #[pymodule_export]
    use crate::record::Record;

    #[pymodule_init]
    fn init(m: &Bound<'_, PyModule>) -> PyResult<()> {
        ffid::add_kinds(crate::kinds::register);
        m.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
