//! Long computations: on a thread of their own, without the interpreter's lock, while this thread reports progress and hears Ctrl-C.

use crate::errors::{guarded, panicked};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{Builder, scope};
use std::time::Duration;

/// How often signals are looked at.
const PERIOD: Duration = Duration::from_millis(50);
/// Stack of the computation (bytes): that of a main thread.
const STACK: usize = 8 << 20;

/// What a computation reports: stage, count, value.
pub(crate) type Report = (&'static str, usize, f64);

/// Runs `work` on another thread. `progress` is called with every report; an exception in it, or a signal, sets the flag that `work` ends
/// by, and is returned beside what `work` then has.
pub(crate) fn watched<R: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&AtomicBool, Sender<Report>) -> R + Send,
) -> PyResult<(R, Option<PyErr>)> {
    let stop = AtomicBool::new(false);
    py.detach(|| {
        scope(|s| {
            let (tell, told) = channel();
            let stop = &stop;
            let started = Builder::new().stack_size(STACK).spawn_scoped(s, move || guarded(|| work(stop, tell)));
            let thread = started.map_err(PyErr::from)?;
            let mut broken: Option<PyErr> = None;
            loop {
                let heard = told.recv_timeout(PERIOD);
                if broken.is_none() {
                    broken = Python::attach(|py| match (&heard, &progress) {
                        (Ok(report), Some(f)) => f.call1(py, *report).err().or_else(|| py.check_signals().err()),
                        _ => py.check_signals().err(),
                    });
                    if broken.is_some() {
                        stop.store(true, Ordering::SeqCst);
                    }
                }
                if heard == Err(RecvTimeoutError::Disconnected) {
                    break;
                }
            }
            let done = thread.join().map_err(|why| panicked(&*why))?;
            Ok((done?, broken))
        })
    })
}
