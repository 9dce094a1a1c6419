//! Ctrl-C: the first one ends a computation in good order, the second one at once.

use ff_model::{Area, Problem, Problems};
use ffid::exit::Exit;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that the first Ctrl-C sets. Asked for once per run of the program.
pub(crate) fn flag() -> Result<Arc<AtomicBool>, (Exit, Problems)> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    let handler = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::SeqCst) {
            // The second one is meant. A partial folder stays; nobody mistakes it for a result.
            std::process::exit(i32::from(Exit::Interrupted.code()));
        }
    });
    handler.map_err(|e| {
        let p = Problem::error(Area::Io, "Io::Signal", format!("Ctrl-C cannot be caught: {e}"));
        (Exit::Io, Problems(vec![p.hint("run the command again")]))
    })?;
    Ok(stop)
}
