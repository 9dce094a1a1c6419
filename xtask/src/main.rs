//! The `xtask` command line; see [`xtask`] for what it does.

use std::process::ExitCode;

fn main() -> ExitCode {
    xtask::cli::main()
}
