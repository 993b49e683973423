//! The morphcog command.

use clap::Parser;
use morphcog::cli::{self, Cli};
use morphcog::run::ErrorKind;
use morphcog::view::console::{Console, Mode};
use std::io;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(help) => return say(&help),
    };
    let console = Console::new(cli.mode());
    match cli::run(cli, &console) {
        Ok(()) if console.has_lost_results() => ExitCode::FAILURE,
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // To stop is what the user asked for, and no error.
            if error.kind == ErrorKind::Stopped {
                let next = error.hint.as_ref().map_or(String::new(), |hint| format!("; {hint}"));
                console.info(&format!("{}{next}", error.message));
            } else {
                console.error(&error, error.hint.as_deref());
            }
            ExitCode::from(error.kind.exit_code())
        }
    }
}

/// Help, the version, or what is wrong with the command line.
fn say(help: &clap::Error) -> ExitCode {
    match help.print() {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Console::new(Mode::Human).error(&error, None);
            ExitCode::FAILURE
        }
        _ => ExitCode::from(u8::try_from(help.exit_code()).unwrap_or(2)),
    }
}
