//! `cargo xtask test`: the tests of the workspace, doc tests included.

use crate::failure::Failure;
use crate::{environment, process, workspace};
use std::path::Path;
use std::process::Command;

/// Runs the tests and passes on the exit code of the runner.
///
/// `--full` adds the tests that are ignored because they take long (`.ci/full slow`). `--no-nextest` uses `cargo test` even where
/// cargo-nextest is installed; all other arguments are passed on to the runner, such as the name of a test. cargo-nextest leaves doc tests out, so they run on their own before it, and its summary closes the output. Both
/// run even if the first fails. Examples are not compiled: clippy has read them, and `.ci/full examples` runs them.
///
/// # Errors
/// The failure of the runner, or of the doc tests when the rest passes.
pub fn run(args: &[String]) -> Result<(), Failure> {
    let root = workspace::root()?;
    let given = |flag: &str| args.iter().any(|a| a == flag);
    let rest: Vec<String> =
        args.iter().filter(|a| !["--no-nextest", "--full"].contains(&a.as_str())).cloned().collect();
    let nextest = !given("--no-nextest") && process::has_cargo_subcommand("nextest");
    let runner = arguments(nextest, given("--full"), &rest);
    if !nextest && !rest.is_empty() {
        return cargo(&root, &runner);
    }
    let docs = if rest.is_empty() {
        // Doc tests alone would wait for the last library with one core, while test programs could be compiled on the others.
        cargo(&root, &["test", "--workspace", "--tests", "--no-run"])?;
        cargo(&root, &["test", "--workspace", "--doc", "--no-fail-fast"])
    } else {
        Ok(()) // a filter of nextest means nothing to rustdoc
    };
    cargo(&root, &runner)?;
    if docs.is_err() {
        eprintln!("doc tests failed (the other tests passed)");
    }
    docs
}

/// Runs Cargo with the environment of all tests, after printing the command.
fn cargo<S: AsRef<str>>(root: &Path, args: &[S]) -> Result<(), Failure> {
    let args: Vec<&str> = args.iter().map(AsRef::as_ref).collect();
    let command = format!("cargo {}", args.join(" "));
    eprintln!("+ {command}");
    let mut prepared = Command::new(process::cargo());
    environment::set(prepared.args(&args).current_dir(root));
    process::pass(&mut prepared, command)
}

/// What cargo is told. Without nextest, arguments of one's own may name doc tests, which `--tests` would leave out.
fn arguments(nextest: bool, full: bool, rest: &[String]) -> Vec<String> {
    let runner: &[&str] = if nextest { &["nextest", "run"] } else { &["test"] };
    let targets: &[&str] = if nextest || rest.is_empty() { &["--tests"] } else { &[] };
    let ignored: &[&str] = if nextest && full { &["--run-ignored", "all"] } else { &[] };
    let base = [runner, &["--workspace"], targets, &["--no-fail-fast"], ignored].concat();
    let mut all: Vec<String> = base.into_iter().map(str::to_owned).chain(rest.iter().cloned()).collect();
    if full && !nextest {
        // What follows `--` is for the test programs.
        if !rest.iter().any(|a| a == "--") {
            all.push("--".into());
        }
        all.push("--include-ignored".into());
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_adds_the_ignored_tests_in_the_words_of_either_runner() {
        let say = |nextest, full, rest: &[&str]| {
            arguments(nextest, full, &rest.iter().map(|&a| a.to_owned()).collect::<Vec<_>>()).join(" ")
        };
        assert_eq!(say(true, false, &[]), "nextest run --workspace --tests --no-fail-fast");
        assert_eq!(say(true, true, &["r03"]), "nextest run --workspace --tests --no-fail-fast --run-ignored all r03");
        assert_eq!(say(false, false, &[]), "test --workspace --tests --no-fail-fast");
        assert_eq!(say(false, true, &[]), "test --workspace --tests --no-fail-fast -- --include-ignored");
        assert_eq!(
            say(false, true, &["r03", "--", "--nocapture"]),
            "test --workspace --no-fail-fast r03 -- --nocapture --include-ignored"
        );
    }
}
