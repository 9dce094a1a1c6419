//! `ffid schema`: JSON schemas for editors and programs.

use clap::ValueEnum;
use ffid::exit::Exit;
use std::io;
use std::io::Write;

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid schema mission > mission.schema.json
  ffid schema result > result.schema.json       of the result.json of an identification

An editor that knows TOML schemas (Even Better TOML, taplo) completes and checks a mission file that begins with
  #:schema ./mission.schema.json";

/// Files that have a schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Of {
    /// The mission file.
    Mission,
    /// The `result.json` of an identification.
    Result,
}

/// Arguments of `ffid schema`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The file that is described.
    #[arg(value_enum)]
    of: Of,
}

/// Prints the schema.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> Result<Exit, (Exit, io::Error)> {
    let schema = match args.of {
        Of::Mission => ffid::schema::mission(&ffid::default_registry()),
        Of::Result => ffid::schema::result(),
    };
    let print = |out: &mut dyn Write| -> io::Result<()> {
        serde_json::to_writer_pretty(&mut *out, &schema)?;
        writeln!(out)
    };
    print(out).map(|()| Exit::Done).map_err(|e| (Exit::Done, e))
}
