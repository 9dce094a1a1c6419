//! Ctrl-C (SIGINT, and SIGTERM): the first one ends a computation in good order, the second one at once.

use ff_model::{Area, Problem, Problems};
use ffid::exit::Exit;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that the first Ctrl-C sets, when the command runs in its own process (once per process). A caller of the library
/// keeps its own handling of signals: then nothing sets the flag.
pub(crate) fn flag(own_process: bool) -> Result<Arc<AtomicBool>, (Exit, Problems)> {
    let stop = Arc::new(AtomicBool::new(false));
    if !own_process {
        return Ok(stop);
    }
    let flag = stop.clone();
    let handler = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::SeqCst) {
            // The second one is meant. A partial folder stays; nobody mistakes it for a result.
            std::process::exit(i32::from(Exit::Interrupted.code()));
        }
        // Whoever has closed it sees the command end all the same.
        let _ = writeln!(std::io::stderr(), "interrupted: ending; interrupt once more to end at once");
    });
    handler.map_err(|e| {
        let p = Problem::error(Area::Io, "Io::Signal", format!("Ctrl-C cannot be caught: {e}"));
        (Exit::Io, Problems(vec![p.hint("run the command again")]))
    })?;
    Ok(stop)
}
