//! The command line: parses its words, calls one subcommand, turns what came of it into an exit status.

mod args;
mod bench;
mod build;
mod check;
mod diff;
mod disasm;
mod explain;
mod fmt;
mod inputs;
mod output;
mod page;
mod report;
mod run;
mod sarif;
mod session;
mod stopwatch;
mod test;
mod trace;
mod verify;

use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command};
use output::Failure;

/// What a process says to its caller; scripts rely on these.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// Done.
    Done = 0,
    /// The input was refused.
    Refused = 1,
    /// Wrong usage.
    Usage = 2,
    /// A trap ended the run.
    Trap = 3,
    /// The host refused something that was asked for.
    Host = 4,
    /// Engines or traces differ.
    Differ = 5,
}

/// What a subcommand ends in.
pub type Outcome = Result<Status, Failure>;

/// Runs the command line.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // `--help` and `--version` are errors to clap too, with exit status 0.
            let status = if error.use_stderr() { Status::Usage } else { Status::Done };
            // Nothing can be done about a closed terminal.
            let _ = error.print();
            return ExitCode::from(status as u8);
        }
    };
    let (format, outcome) = match &cli.command {
        Command::Check(args) => (args.format.failures(), check::run(args)),
        Command::Explain(args) => (args.common.format, explain::run(args)),
        Command::Build(args) => (args.common.format, build::run(args)),
        Command::Verify(args) => (args.common.format, verify::run(args)),
        Command::Disasm(args) => (args.common.format, disasm::run(args)),
        Command::Run(args) => (args.common.format, run::run(args)),
        Command::Bench(args) => (args.common.format, bench::run(args)),
        Command::Test(args) => (args.format.failures(), test::run(args)),
        Command::Diff(args) => (args.common.format, diff::run(args)),
        Command::Fmt(args) => (args.common.format, fmt::run(args)),
    };
    let status = outcome.unwrap_or_else(|failure| failure.report(format));
    ExitCode::from(status as u8)
}
