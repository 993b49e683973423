//! The morphcog command.

use clap::Parser;
use morphcog::cli::{self, Cli};
use morphcog::view::console::Console;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::parse();
    let console = Console::new(cli.mode());
    match cli::run(cli, &console) {
        Ok(()) if console.has_lost_results() => ExitCode::FAILURE,
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console.error(&error, error.hint.as_deref());
            ExitCode::from(error.kind.exit_code())
        }
    }
}
