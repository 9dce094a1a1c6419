//! The `ffid` command.

mod check;
mod convert_command;
mod excite_command;
mod fit_flags;
mod identify_command;
mod init_command;
mod interrupt;
mod modes_command;
mod output;
mod plan_command;
mod predict_command;
mod records;
mod result_folder;
mod results;
mod schema_command;
mod selfcheck_command;
mod simulate_command;
mod validate_command;

use clap::{CommandFactory, Parser, Subcommand};
use std::io::ErrorKind;
use std::process::ExitCode;

/// In-orbit identification of free-floating robots.
#[derive(Parser)]
#[command(version, about, after_help = crate::exit::help())]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write a first mission file for a URDF: base, arm and panels guessed, the rest commented out with its unit.
    #[command(after_help = init_command::EXAMPLES)]
    Init(init_command::Args),
    /// Check a mission file and the robot it names, or a URDF alone; print the model and every problem.
    Check(output::Input),
    /// Convert a record between CSV and Parquet, or from a ROS 2 bag (MCAP).
    #[command(after_help = convert_command::EXAMPLES)]
    Convert(convert_command::Args),
    /// Print the JSON schema of a file, for editors that complete and check what is written.
    #[command(after_help = schema_command::EXAMPLES)]
    Schema(schema_command::Args),
    /// Plan the manoeuvre of [excite]: the most information, the largest response of the modes, or the paper's; write the
    /// trajectory and a verdict on what it will tell.
    #[command(after_help = excite_command::EXAMPLES)]
    Excite(excite_command::Args),
    /// Judge a trajectory, planned or given: standard deviations it will leave, modes the sensors see, limits, excursions.
    #[command(after_help = plan_command::EXAMPLES)]
    Plan(plan_command::Args),
    /// Estimate the parameters of [estimate] from a record; write the identified robot, a report and the residuals.
    #[command(after_help = identify_command::EXAMPLES)]
    Identify(identify_command::Args),
    /// Judge an identified model by a record it has not seen.
    #[command(after_help = validate_command::EXAMPLES)]
    Validate(validate_command::Args),
    /// Predict what an identified robot does on a trajectory.
    #[command(after_help = predict_command::EXAMPLES)]
    Predict(predict_command::Args),
    /// Simulate a trajectory and write the record that the mission's sensors would read.
    #[command(after_help = simulate_command::EXAMPLES)]
    Simulate(simulate_command::Args),
    /// Hold the simulation of this robot to the laws of mechanics: momentum, energy, dissipation, order of the integrator.
    Selfcheck(selfcheck_command::Args),
    /// Print completions for a shell, to be put where it looks for them.
    Completions {
        /// bash, elvish, fish, powershell or zsh.
        shell: clap_complete::Shell,
    },
    /// Print natural frequencies, damping ratios and shapes of the passive coordinates, at the mission's hold pose.
    Modes(modes_command::Args),
}

fn main() -> ExitCode {
    // clap ends wrong usage with 2 and help with 0, as the table wants.
    let cli = Cli::parse();
    // The standard error is not locked: a progress bar writes to it from a thread of its own.
    let (mut out, mut err) = (std::io::stdout().lock(), std::io::stderr());
    let result = match cli.command {
        Command::Init(args) => init_command::run(&args, &mut out, &mut err),
        Command::Check(input) => check::run(&input, &mut out, &mut err),
        Command::Convert(args) => convert_command::run(&args, &mut out, &mut err),
        Command::Schema(args) => schema_command::run(&args, &mut out),
        Command::Excite(args) => excite_command::run(&args, &mut out, &mut err),
        Command::Plan(args) => plan_command::run(&args, &mut out, &mut err),
        Command::Identify(args) => identify_command::run(&args, &mut out, &mut err),
        Command::Validate(args) => validate_command::run(&args, &mut out, &mut err),
        Command::Predict(args) => predict_command::run(&args, &mut out, &mut err),
        Command::Simulate(args) => simulate_command::run(&args, &mut out, &mut err),
        Command::Selfcheck(args) => selfcheck_command::run(&args, &mut out, &mut err),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "ffid", &mut script);
            let done = crate::exit::Exit::Done;
            std::io::Write::write_all(&mut out, &script).map(|()| done).map_err(|e| (done, e))
        }
        Command::Modes(args) => modes_command::run(&args, &mut out, &mut err),
    };
    match result {
        Ok(exit) => exit.into(),
        // Nobody reads any more (`ffid check ... | head`): not an error of ours, and no code can tell.
        Err((exit, e)) if e.kind() == ErrorKind::BrokenPipe => exit.into(),
        Err((_, e)) => {
            // The standard error may be closed as well; then the code alone has to say it.
            let _ =
                std::io::Write::write_fmt(&mut err, format_args!("error[Io::Write] output: {e}; free some space\n"));
            crate::exit::Exit::Io.into()
        }
    }
}
