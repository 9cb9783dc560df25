//! `khz`: the command line of Kilohertz. One file for each subcommand in `cli/`.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
