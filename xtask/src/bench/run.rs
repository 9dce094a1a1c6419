//! Running a benchmark program on one core and reading its JSON lines.

use ffid::exit::Failure;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The core that programs are pinned to, where that can be done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pin {
    core: Option<usize>,
}

impl Pin {
    /// Pins to `core` if `taskset` exists and the core does; else nothing is pinned.
    pub fn to(core: usize) -> Self {
        let works = Command::new("taskset")
            .args(["-c", &core.to_string(), "true"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|s| s.success());
        Self { core: works.then_some(core) }
    }
    /// Pins nothing.
    pub fn none() -> Self {
        Self { core: None }
    }
    /// How the programs ran, in words.
    pub fn text(&self) -> String {
        self.core.map_or("not pinned (taskset is missing or knows no such core)".into(), |c| format!("core {c}"))
    }
    /// A command for `program`, pinned.
    fn command(&self, program: &Path) -> Command {
        match self.core {
            Some(core) => {
                let mut c = Command::new("taskset");
                c.args(["-c", &core.to_string()]).arg(program);
                c
            }
            None => Command::new(program),
        }
    }
}

/// Runs a program in `dir` and returns the JSON objects it printed, one per line; other lines are skipped.
///
/// What it says on standard error is shown when it fails.
///
/// # Errors
/// [`Failure::Io`] if it cannot be started, [`Failure::Child`] if it fails.
pub fn lines(dir: &Path, program: &Path, args: &[String], pin: &Pin) -> Result<Vec<Value>, Failure> {
    let out = pin
        .command(program)
        .args(args)
        .current_dir(dir)
        // One thread: the peers' linear algebra would start more.
        .env("OMP_NUM_THREADS", "1")
        .env("OPENBLAS_NUM_THREADS", "1")
        .output()
        .map_err(|e| Failure::io("start", &PathBuf::from(program), e))?;
    if !out.status.success() {
        eprint!("{}", String::from_utf8_lossy(&out.stderr));
        let command = format!("{} {}", program.display(), args.join(" "));
        return Err(Failure::Child { command, status: out.status.to_string(), code: out.status.code() });
    }
    Ok(objects(&String::from_utf8_lossy(&out.stdout)))
}

fn objects(text: &str) -> Vec<Value> {
    text.lines().filter_map(|l| serde_json::from_str::<Value>(l).ok()).filter(Value::is_object).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_objects_are_read() {
        let all = objects("warming up\n{\"fn\":\"rnea\",\"median_ns\":838.1}\n12.5\n");
        assert_eq!(all.len(), 1);
        assert_eq!(all[0]["median_ns"].as_f64(), Some(838.1));
    }

    #[test]
    fn a_failing_program_is_an_error_with_its_code() {
        let e = lines(Path::new("."), Path::new("sh"), &["-c".into(), "exit 7".into()], &Pin::none()).unwrap_err();
        assert!(matches!(e, Failure::Child { code: Some(7), .. }), "{e}");
        let e = lines(Path::new("."), Path::new("/no/such program"), &[], &Pin::none()).unwrap_err();
        assert!(matches!(e, Failure::Io { .. }), "{e}");
    }
}
