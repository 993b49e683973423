//! The morphcog command.

#![forbid(unsafe_code)]
#![deny(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)]

use clap::Parser;
use morphcog::base::error::ErrorKind;
use morphcog::base::text::is_unseen;
use morphcog::cli::{self, Cli};
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
    let code = ExitCode::from(u8::try_from(help.exit_code()).unwrap_or(2));
    // As names of files that a shell put into the command line.
    let hides_any = std::env::args_os().any(|argument| argument.to_string_lossy().contains(is_unseen));
    if help.use_stderr() && hides_any {
        let text = help.to_string();
        Console::new(Mode::Human).error(&io::Error::other(text.trim_start_matches("error: ").trim()), None);
        return code;
    }
    match help.print() {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Console::new(Mode::Human).error(&error, None);
            ExitCode::FAILURE
        }
        _ => code,
    }
}
