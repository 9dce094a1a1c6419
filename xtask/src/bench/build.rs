//! Building `ff-bench`, and states for it when the peers' are not at hand.

use super::run;
use crate::process;
use ffid::exit::Failure;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// For which processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// The default of the compiler: any x86-64. The headline.
    Portable,
    /// `-C target-cpu=native`.
    Native,
}

impl Target {
    /// Name in tables and JSON.
    pub fn text(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Native => "native",
        }
    }
}

/// Builds `ff-bench` in the release profile and returns its path.
///
/// # Errors
/// [`Failure::Child`] with the code of cargo, [`Failure::Io`].
pub fn ff_bench(root: &Path, target: Target) -> Result<PathBuf, Failure> {
    let mut args = vec!["build", "--release", "--package", "ff-bench", "--message-format=json-render-diagnostics"];
    let mut command = Command::new(process::cargo());
    if target == Target::Native {
        // A folder of its own: flags are part of the fingerprint of every dependency.
        args.extend(["--target-dir", "target/native"]);
        command.env("RUSTFLAGS", "-C target-cpu=native");
        eprintln!("+ RUSTFLAGS=\"-C target-cpu=native\" cargo {}", args.join(" "));
    } else {
        command.env_remove("RUSTFLAGS");
        eprintln!("+ cargo {}", args.join(" "));
    }
    // Flags of the surroundings would make another program than the one that is named.
    command.env_remove("CARGO_ENCODED_RUSTFLAGS").env_remove("CARGO_BUILD_RUSTFLAGS");
    let out = command
        .args(&args)
        .current_dir(root)
        .stderr(Stdio::inherit())
        .output()
        .map_err(|e| Failure::io("start", Path::new("cargo"), e))?;
    if !out.status.success() {
        let command = format!("cargo {}", args.join(" "));
        return Err(Failure::Child { command, status: out.status.to_string(), code: out.status.code() });
    }
    executable(&String::from_utf8_lossy(&out.stdout)).ok_or_else(|| {
        Failure::Numerical("cargo built ff-bench but named no executable; look at the messages above".into())
    })
}

/// Path of the `ff-bench` executable in cargo's messages.
fn executable(messages: &str) -> Option<PathBuf> {
    messages
        .lines()
        .filter_map(|l| serde_json::from_str::<Value>(l).ok())
        .filter(|m| m["target"]["name"] == "ff-bench")
        .find_map(|m| m["executable"].as_str().map(PathBuf::from))
}

/// The folder of states from `ff-bench states`, made anew: they come from a fixed seed and take no time.
///
/// # Errors
/// As [`run::lines`].
pub fn own_states(root: &Path, ff_bench: &Path) -> Result<PathBuf, Failure> {
    let dir = root.join("target").join("bench").join("states");
    run::lines(root, ff_bench, &["states".into(), dir.display().to_string()], &run::Pin::none())?;
    Ok(dir)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_executable_is_found_among_cargos_messages() {
        let text = concat!(
            "{\"reason\":\"compiler-artifact\",\"target\":{\"name\":\"ff_model\"},\"executable\":null}\n",
            "not JSON\n",
            "{\"reason\":\"compiler-artifact\",\"target\":{\"name\":\"ff-bench\"},\"executable\":\"/t/ff-bench\"}\n",
            "{\"reason\":\"build-finished\",\"success\":true}\n"
        );
        assert_eq!(executable(text), Some(PathBuf::from("/t/ff-bench")));
        assert_eq!(executable("{\"reason\":\"build-finished\"}"), None);
    }
}
