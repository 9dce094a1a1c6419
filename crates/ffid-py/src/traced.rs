//! Simulations as arrays.

use crate::arrays::array2;
use ffid::dynamics::{Readings, SensorSuite, Trace, measure};
use ffid::model::{BaseKind, Model};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// What sensors with a seed read of a simulation, or the exact values, as arrays by name.
pub(crate) fn traced<'py>(
    py: Python<'py>,
    model: &Model,
    trace: &Trace,
    rate_hz: f64,
    noise: Option<(&SensorSuite, u64)>,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    // As in the files of `ffid simulate`, so that both give the same records.
    let t: Vec<f64> = (0..trace.len()).map(|i| i as f64 / rate_hz).collect();
    all.set_item("t", PyArray1::from_vec(py, t))?;
    let floats = model.base_kind() == BaseKind::Floating;
    match noise {
        Some((sensors, seed)) => {
            let Readings { q, tau, gyro, .. } = measure(trace, sensors, seed);
            all.set_item("q", array2(py, &q)?)?;
            all.set_item("tau", array2(py, &tau)?)?;
            if floats {
                all.set_item("gyro", array2(py, &gyro)?)?;
            }
        }
        None => {
            for (name, m) in [("q", &trace.q), ("qd", &trace.qd), ("qdd", &trace.qdd), ("tau", &trace.tau)] {
                all.set_item(name, array2(py, m)?)?;
            }
            if floats {
                all.set_item("gyro", array2(py, &trace.gyro())?)?;
                all.set_item("att", array2(py, &trace.att)?)?;
                all.set_item("pos", array2(py, &trace.pos)?)?;
            }
            all.set_item("eta", array2(py, &trace.eta)?)?;
        }
    }
    Ok(all)
}
