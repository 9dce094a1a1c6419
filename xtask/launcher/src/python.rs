//! `cargo xtask python`: the wheel of the package `ffid`, its tests and its measurements, in a virtual environment of their own.

use crate::failure::Failure;
use crate::{process, tasks, workspace};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// What builds wheels: the version that `pyproject.toml` asks for.
const MATURIN: &str = "maturin>=1.16,<2";

/// What is printed before minutes go into a wheel that nobody has asked for.
const HELP: &str = "\
The Python package, in a virtual environment under target/python

Usage: cargo xtask python <test|bench|wheel|docs> [ARGUMENTS]

  test    Build and install the wheel; type checker, stubs, pytest with the notebooks. What follows is passed on to pytest
  bench   The same over Pinocchio's bindings and over Rust; --json FILE
  wheel   Build and install the wheel
  docs    Write docs/python-reference.md from the sources
";

/// Builds the wheel, installs it with its test dependencies from PyPI, and runs what `args` say:
///
/// * `test`: pytest (which runs the notebooks of `docs/notebooks`), the type checker in strict mode, stubs against the module; what follows
///   is passed on to pytest;
/// * `bench`: the measurements, beside Pinocchio and beside the same in Rust; what follows is passed on, such as `--json FILE`;
/// * `wheel`: nothing more;
/// * `docs`: no wheel; writes `docs/python-reference.md` from the sources of the package.
///
/// # Errors
/// [`Failure::Usage`], or that of the first program that fails.
pub fn run(args: &[String]) -> Result<(), Failure> {
    if args.iter().any(|a| a == "--help" || a == "-h") {
        print!("{HELP}");
        return Ok(());
    }
    let tasks = ["test", "bench", "wheel", "docs"];
    let Some((task, rest)) = args.split_first().filter(|(t, _)| tasks.contains(&t.as_str())) else {
        return Err(Failure::Usage("'python' takes test, bench, wheel or docs".into()));
    };
    let root = workspace::root()?;
    let crate_folder = root.join("crates").join("ffid-py");
    if task == "docs" {
        return process::run(&crate_folder, &system(), &[OsStr::new("docs/reference.py")]);
    }
    let python = install(&root, &crate_folder)?;
    let run = |words: &[&str], rest: &[String]| {
        let all: Vec<String> = words.iter().map(|&w| w.to_owned()).chain(rest.iter().cloned()).collect();
        process::run(&crate_folder, &python, &all)
    };
    match task.as_str() {
        "test" => {
            run(&["-m", "mypy", "--strict"], &[])?;
            run(&["-m", "mypy.stubtest", "ffid._ffid", "--ignore-disjoint-bases"], &[])?;
            run(&["-m", "pytest", "-q"], rest)
        }
        "bench" => {
            let rust = rust_side(&root, &crate_folder)?;
            run(&["bench/dynamics.py", "--rust", &rust.to_string_lossy()], &from_here(rest)?)
        }
        _ => Ok(()),
    }
}

/// Paths after `--json` as seen from the folder in which the command was given.
fn from_here(args: &[String]) -> Result<Vec<String>, Failure> {
    let here = std::env::current_dir().map_err(|e| Failure::io("find", Path::new("."), e))?;
    let mut path = false;
    let absolute = |a: &String| {
        let is_path = std::mem::replace(&mut path, a == "--json");
        if is_path { here.join(a).to_string_lossy().into_owned() } else { a.clone() }
    };
    Ok(args.iter().map(absolute).collect())
}

/// The program that does in Rust what is measured from Python, with the libraries that the wheel was built of.
fn rust_side(root: &Path, crate_folder: &Path) -> Result<PathBuf, Failure> {
    let build = tasks::target(root).join("python").join("build");
    let words = ["build", "--release", "--locked", "--package", "ffid-py-bench", "--target-dir"].map(OsStr::new);
    process::run(crate_folder, &process::cargo(), &[&words[..], &[build.as_os_str()]].concat())?;
    Ok(build.join("release").join(format!("ffid-py-bench{}", std::env::consts::EXE_SUFFIX)))
}

/// The interpreter of the system.
fn system() -> OsString {
    std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into())
}

/// The interpreter of a virtual environment under the target folder in which the wheel of this source is installed.
fn install(root: &Path, crate_folder: &Path) -> Result<OsString, Failure> {
    let folder = tasks::target(root).join("python");
    let (venv, wheels) = (folder.join("venv"), folder.join("wheels"));
    let python = interpreter(&venv);
    if !python.is_file() {
        process::run(root, &system(), &[OsStr::new("-m"), OsStr::new("venv"), venv.as_os_str()])?;
    }
    let python = python.into_os_string();
    let pip = |args: &[&OsStr]| {
        let quiet = ["-m", "pip", "--disable-pip-version-check", "install", "--quiet"].map(OsStr::new);
        process::run(root, &python, &[&quiet[..], args].concat())
    };
    pip(&[OsStr::new(MATURIN)])?;
    // The wheel of an older source would be found beside it.
    if wheels.exists() {
        std::fs::remove_dir_all(&wheels).map_err(|e| Failure::io("remove", &wheels, e))?;
    }
    let build = folder.join("build");
    let words = ["-m", "maturin", "build", "--release", "--locked", "--out"].map(OsStr::new);
    let target = [OsStr::new("--target-dir"), build.as_os_str()];
    process::run(crate_folder, &python, &[&words[..], &[wheels.as_os_str()], &target[..]].concat())?;
    let wheel = std::fs::read_dir(&wheels).map_err(|e| Failure::io("read", &wheels, e))?.flatten().next();
    let wheel = wheel.ok_or_else(|| Failure::Differs(format!("{}: no wheel was built", wheels.display())))?.path();
    pip(&[OsStr::new("--force-reinstall"), OsStr::new("--no-deps"), wheel.as_os_str()])?;
    let with_tests = format!("{}[test]", wheel.display());
    pip(&[OsStr::new(&with_tests)])?;
    Ok(python)
}

fn interpreter(venv: &Path) -> PathBuf {
    if cfg!(windows) { venv.join("Scripts").join("python.exe") } else { venv.join("bin").join("python") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonsense_is_usage_before_anything_is_built() {
        for args in [vec![], vec!["tests".to_owned()]] {
            assert!(matches!(run(&args), Err(Failure::Usage(_))), "{args:?}");
        }
    }

    #[test]
    fn files_are_those_of_the_folder_in_which_the_command_is_given() {
        let words = ["--rounds", "3", "--json", "b.json"].map(str::to_owned);
        let here = std::env::current_dir().unwrap().join("b.json");
        assert_eq!(from_here(&words).unwrap(), ["--rounds", "3", "--json", &here.to_string_lossy()]);
    }
}
