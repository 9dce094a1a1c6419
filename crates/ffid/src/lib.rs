//! In-orbit identification of free-floating robots: the facade over all crates, and the ffid command
