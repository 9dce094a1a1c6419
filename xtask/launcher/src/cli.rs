//! The command line. Commands of this program are read here; those of package `xtask` are handed on as they are.

use crate::failure::Failure;
use crate::tasks::{self, TASKS};
use crate::{api, ci, fixtures, python, suite};

/// Commands of this program, with what they do.
const OWN: [(&str, &str); 5] = [
    ("test", "Run the tests, doc tests included; --full also the slow ones [--no-nextest] [ARGUMENTS OF THE RUNNER]"),
    ("ci", "Run .ci/run: format, clippy, documentation, tests, quick reproduction; with --full also .ci/full"),
    ("fixtures", "Write fixtures/SHA256SUMS, or verify it with --check"),
    (
        "python",
        "Build the wheel and run its tests, types and notebooks, or its measurements: test | bench [--json F] | wheel",
    ),
    ("api", "Write the public names of every crate to docs/api, or compare with --check"),
];

/// Runs the command line `args` (without the name of the program).
///
/// # Errors
/// [`Failure::Usage`] for what is not understood, else those of the command.
pub fn run(args: &[String]) -> Result<(), Failure> {
    let Some((command, rest)) = args.split_first() else {
        return Err(Failure::Usage("which task?".into()));
    };
    match command.as_str() {
        "-h" | "--help" | "help" => {
            print!("{}", help());
            Ok(())
        }
        // A runner has arguments of its own, among them --help.
        "test" if rest != ["--help"] => suite::run(rest),
        "test" | "ci" | "fixtures" | "api" if rest.iter().any(|a| a == "--help" || a == "-h") => {
            print!("{}", help());
            Ok(())
        }
        // pytest has arguments of its own.
        "python" => python::run(rest),
        "ci" => ci::run(flag(command, rest, "--full")?),
        "fixtures" => fixtures::run(flag(command, rest, "--check")?),
        "api" => api::run(flag(command, rest, "--check")?),
        name if TASKS.iter().any(|t| t.0 == name) => tasks::run(args),
        name => Err(Failure::Usage(format!("unknown task '{name}'"))),
    }
}

/// Whether the one flag of a command is given.
fn flag(command: &str, rest: &[String], flag: &str) -> Result<bool, Failure> {
    match rest {
        [] => Ok(false),
        [one] if one == flag => Ok(true),
        _ => Err(Failure::Usage(format!("'{command}' takes {flag} or nothing, not '{}'", rest.join(" ")))),
    }
}

fn help() -> String {
    let lines =
        |all: &[(&str, &str)]| all.iter().map(|(name, what)| format!("  {name:12} {what}\n")).collect::<String>();
    format!(
        "Project tasks: cargo xtask <COMMAND>\n\n{}\nCompiled from the whole project first (minutes the first time); options with --help:\n{}\n\
         Exit codes: 0 done, 2 wrong command line, 15 outside a tolerance, 20 reading or writing failed;\n\
         `cargo xtask reproduce --help` has the table. `test` and `ci` pass on the code of the program that failed.\n",
        lines(&OWN),
        lines(&TASKS)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usage(args: &[&str]) -> String {
        let args: Vec<String> = args.iter().map(|&a| a.to_owned()).collect();
        match run(&args) {
            Err(Failure::Usage(text)) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn nonsense_is_usage_before_anything_is_compiled() {
        assert!(usage(&["frobnicate"]).contains("frobnicate"));
        assert!(usage(&["fixtures", "--chekc"]).contains("--chekc"));
        assert!(usage(&["ci", "--full", "--full"]).contains("ci"));
        assert!(usage(&[]).contains("which"));
    }

    #[test]
    fn help_names_every_command() {
        let text = help();
        for (name, _) in OWN.iter().chain(&TASKS) {
            assert!(text.contains(&format!("\n  {name} ")), "{name}: {text}");
        }
    }
}
