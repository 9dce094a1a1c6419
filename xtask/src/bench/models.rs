//! Models that every program of the benchmark knows.

/// The models of the peers.
pub const MODELS: [&str; 3] = ["rigid", "flex", "slosh"];
