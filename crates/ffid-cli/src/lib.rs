//! The command `ffid`, callable as a library: [`run`] takes arguments and streams, and returns the exit code.

mod commands;
mod flags;
mod interrupt;
mod output;
mod replay;
mod result_folder;
mod results;
pub mod session;

use clap::{CommandFactory, Parser, Subcommand};
use ffid::exit::Exit;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

/// In-orbit identification of free-floating robots.
#[derive(Parser)]
#[command(name = "ffid", version, about, after_help = ffid::exit::help())]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

// One is made for a run.
#[allow(clippy::large_enum_variant)]
#[derive(Subcommand)]
pub(crate) enum Command {
    /// Write a first mission file for a URDF: base, arm and panels guessed, the rest commented out with its unit.
    #[command(after_help = commands::init::EXAMPLES)]
    Init(commands::init::Args),
    /// Check a mission file and the robot it names, or a URDF alone; print the model and every problem.
    Check(output::Input),
    /// Judge a record before anything is fitted: units, axes, signs, rest, excitation, noise, gaps, clocks, modes.
    #[command(after_help = commands::doctor::EXAMPLES)]
    Doctor(commands::doctor::Args),
    /// Convert a record between CSV and Parquet, or from a bag of ROS 1 or ROS 2.
    #[command(after_help = commands::convert::EXAMPLES)]
    Convert(commands::convert::Args),
    /// Print the JSON schema of a file, for editors that complete and check what is written.
    #[command(after_help = commands::schema::EXAMPLES)]
    Schema(commands::schema::Args),
    /// Plan the manoeuvre of [excite]: the most information, the largest response of the modes, or the paper's; write the
    /// trajectory and a verdict on what it will tell.
    #[command(after_help = commands::excite::EXAMPLES)]
    Excite(commands::excite::Args),
    /// Judge a trajectory, planned or given: standard deviations it will leave, modes the sensors see, limits, excursions.
    #[command(after_help = commands::plan::EXAMPLES)]
    Plan(commands::plan::Args),
    /// Estimate the parameters of [estimate] from a record; write the identified robot, a report and the residuals.
    #[command(after_help = commands::identify::EXAMPLES)]
    Identify(commands::identify::Args),
    /// Judge an identified model by a record it has not seen.
    #[command(after_help = commands::validate::EXAMPLES)]
    Validate(commands::validate::Args),
    /// Predict what an identified robot does on a trajectory.
    #[command(after_help = commands::predict::EXAMPLES)]
    Predict(commands::predict::Args),
    /// Simulate a trajectory and write the record that the mission's sensors would read.
    #[command(after_help = commands::simulate::EXAMPLES)]
    Simulate(commands::simulate::Args),
    /// Draw the robot in 3-D, with its modes and, if there is one, a motion: one page that needs no network.
    #[command(after_help = commands::show::EXAMPLES)]
    Show(commands::show::Args),
    /// Hold the simulation of this robot to the laws of mechanics: momentum, energy, dissipation, order of the integrator.
    Selfcheck(commands::selfcheck::Args),
    /// Print completions for a shell, to be put where it looks for them.
    Completions {
        /// bash, elvish, fish, powershell or zsh.
        shell: clap_complete::Shell,
    },
    /// Print natural frequencies, damping ratios and shapes of the passive coordinates, at the mission's hold pose.
    Modes(commands::modes::Args),
}

impl Command {
    /// Lets commands that take long draw progress on the standard error of the process and catch its Ctrl-C.
    fn in_own_process(&mut self) {
        let output = match self {
            Self::Excite(args) => &mut args.output,
            Self::Plan(args) => &mut args.output,
            Self::Identify(args) => &mut args.output,
            Self::Validate(args) => &mut args.output,
            _ => return,
        };
        output.own_process = true;
    }
}

/// Runs the command line of this process. Wrong usage ends the process with exit code 2 and help with 0, as the table of
/// exit codes wants.
pub fn main() -> ExitCode {
    main_from(std::env::args_os()).into()
}

/// [`main`] with other arguments than those of the process, the first of which is the name of the program: for a process that an
/// interpreter started.
pub fn main_from<I, A>(args: I) -> Exit
where
    I: IntoIterator<Item = A>,
    A: Into<std::ffi::OsString> + Clone,
{
    let mut cli = Cli::parse_from(args);
    cli.command.in_own_process();
    // The standard error is not locked: a progress bar writes to it from a thread of its own.
    execute(cli, &mut std::io::stdout().lock(), &mut std::io::stderr())
}

/// Runs the command `ffid` with `args`, the first of which is the name of the program, and returns its exit code. Output goes to
/// `out`, problems to `err`. Wrong usage is written to `err` (help to `out`) and does not end the process. Nothing is
/// written to the streams of the process, no progress is shown, and the handling of its signals stays as it is.
///
/// ```
/// let mut out = Vec::new();
/// let exit = ffid_cli::run(["ffid", "--version"], &mut out, &mut Vec::new());
/// assert_eq!((exit, out.starts_with(b"ffid ")), (ffid::exit::Exit::Done, true));
/// ```
pub fn run<I, A>(args: I, out: &mut dyn Write, err: &mut dyn Write) -> Exit
where
    I: IntoIterator<Item = A>,
    A: Into<std::ffi::OsString> + Clone,
{
    match Cli::try_parse_from(args) {
        Ok(cli) => execute(cli, out, err),
        Err(e) => {
            // A closed stream leaves the exit code alone to say it.
            let (_, exit) = if e.use_stderr() {
                (write!(err, "{}", e.render()), Exit::Usage)
            } else {
                (write!(out, "{}", e.render()), Exit::Done)
            };
            exit
        }
    }
}

fn execute(cli: Cli, mut out: &mut dyn Write, mut err: &mut dyn Write) -> Exit {
    let result = match cli.command {
        Command::Init(args) => commands::init::run(&args, &mut out, &mut err),
        Command::Check(input) => commands::check::run(&input, &mut out, &mut err),
        Command::Doctor(args) => commands::doctor::run(&args, &mut out, &mut err),
        Command::Convert(args) => commands::convert::run(&args, &mut out, &mut err),
        Command::Schema(args) => commands::schema::run(&args, &mut out),
        Command::Excite(args) => commands::excite::run(&args, &mut out, &mut err),
        Command::Plan(args) => commands::plan::run(&args, &mut out, &mut err),
        Command::Identify(args) => commands::identify::run(&args, &mut out, &mut err),
        Command::Validate(args) => commands::validate::run(&args, &mut out, &mut err),
        Command::Predict(args) => commands::predict::run(&args, &mut out, &mut err),
        Command::Simulate(args) => commands::simulate::run(&args, &mut out, &mut err),
        Command::Show(args) => commands::show::run(&args, &mut out, &mut err),
        Command::Selfcheck(args) => commands::selfcheck::run(&args, &mut out, &mut err),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "ffid", &mut script);
            let done = Exit::Done;
            out.write_all(&script).map(|()| done).map_err(|e| (done, e))
        }
        Command::Modes(args) => commands::modes::run(&args, &mut out, &mut err),
    };
    match result {
        Ok(exit) => exit,
        // Nobody reads any more (`ffid check ... | head`): not an error of ours, and no code can tell.
        Err((exit, e)) if e.kind() == ErrorKind::BrokenPipe => exit,
        Err((_, e)) => {
            // The standard error may be closed as well; then the code alone has to say it.
            let _ =
                std::io::Write::write_fmt(&mut err, format_args!("error[Io::Write] output: {e}; free some space\n"));
            Exit::Io
        }
    }
}

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
