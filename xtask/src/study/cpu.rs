//! Time that a thread has computed: what a fit takes of one core, whatever else the machine does.

use std::time::Instant;

/// Runs from [`CpuTime::begin`] on, for the thread that began it.
pub(super) struct CpuTime {
    wall: Instant,
    computed: Option<f64>,
}

impl CpuTime {
    /// Begins now.
    pub(super) fn begin() -> Self {
        Self { wall: Instant::now(), computed: computed() }
    }
    /// Seconds that this thread has computed since; seconds of the clock where the system does not say (other systems than Linux).
    pub(super) fn seconds(&self) -> f64 {
        match (self.computed, computed()) {
            (Some(before), Some(now)) => now - before,
            _ => self.wall.elapsed().as_secs_f64(),
        }
    }
}

/// Seconds that the scheduler has given to this thread.
fn computed() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(1e-9 * nanoseconds)
}
