//! The options of the commands as a table, and as the parser of the command line reads them.

use super::Refused;
use crate::{Cli, Command};
use clap::{CommandFactory, Parser};
use ff_model::{Area, Problem, Problems};
use ffid::exit::Exit;
use serde::Serialize;

/// One option of a command.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct CommandOption {
    /// The command, such as `identify`.
    pub command: String,
    /// The option without its dashes, such as `held-out`.
    pub option: String,
    /// Whether it takes a value.
    pub takes_value: bool,
    /// Values to choose from; empty where any will do.
    pub choices: Vec<String>,
    /// What it does.
    pub help: String,
}

/// Every option of every command, help and version excepted. Allocates.
pub fn options() -> Vec<CommandOption> {
    let mut all = Vec::new();
    for command in Cli::command().get_subcommands() {
        for arg in command.get_arguments() {
            let Some(option) = arg.get_long().filter(|&o| o != "help" && o != "version") else { continue };
            all.push(CommandOption {
                command: command.get_name().to_owned(),
                option: option.to_owned(),
                takes_value: arg.get_action().takes_values(),
                choices: arg.get_possible_values().iter().map(|v| v.get_name().to_owned()).collect(),
                help: arg.get_help().map(ToString::to_string).unwrap_or_default(),
            });
        }
    }
    all
}

/// A command with its options, as the command line has them.
pub(super) fn parse(command: &str, words: &[String]) -> Result<Command, Refused> {
    let all = ["ffid", command].into_iter().map(str::to_owned).chain(words.iter().cloned());
    Cli::try_parse_from(all).map(|c| c.command).map_err(|e| {
        let text = e.render().to_string();
        let what = text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
        let p = Problem::error(Area::Config, "Config::Option", what).on(command);
        Refused { exit: Exit::Usage, problems: Problems(vec![p.hint(format!("see `ffid {command} --help`"))]) }
    })
}

/// What cannot happen: the parser returned another command than it was given.
pub(super) fn another(command: &str) -> Refused {
    let p = Problem::error(Area::Config, "Internal::Command", format!("'{command}' was read as another command"));
    Refused { exit: Exit::Usage, problems: Problems(vec![p.hint("please report this")]) }
}
