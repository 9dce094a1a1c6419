//! The command `ffid`.

fn main() -> std::process::ExitCode {
    ffid_cli::main()
}
