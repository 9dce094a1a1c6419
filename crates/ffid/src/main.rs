//! The `ffid` command.
fn main() {}
