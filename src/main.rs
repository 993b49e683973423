//! The morphcog command.

#![forbid(unsafe_code)]
#![deny(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)]

use clap::Parser;
use morphcog::base::error::{Error, ErrorKind};
use morphcog::base::ranks::Ranks;
use morphcog::base::text::is_unseen;
use morphcog::cli::{self, Cli};
use morphcog::view::console::{Console, Mode};
use std::io;
use std::process::ExitCode;
use std::time::Duration;

/// How long the leading rank has to say what is wrong before another one that failed does.
const LEAD_SPEAKS: Duration = Duration::from_secs(2);

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(help) => return say(&help),
    };
    let joined = Ranks::join();
    let (ranks, _guard) = match joined {
        Ok(joined) => joined,
        Err(error) => {
            Console::new(cli.mode()).error(&error, error.hint.as_deref());
            return ExitCode::from(error.kind.exit_code());
        }
    };
    let console = match ranks.leads() {
        true => Console::new(cli.mode()),
        false => Console::with_writers(Mode::Quiet, Box::new(io::sink()), Box::new(io::sink())),
    };
    match cli::run(cli, &console, ranks) {
        Ok(()) if console.has_lost_results() => ExitCode::FAILURE,
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // To stop is what the user asked for, and no error.
            if error.kind == ErrorKind::Stopped {
                let next = error.hint.as_ref().map_or(String::new(), |hint| format!("; {hint}"));
                console.info(&format!("{}{next}", error.message));
            } else {
                console.error(&error, error.hint.as_deref());
                if ranks.size() > 1 {
                    failed_among(ranks, &error);
                }
            }
            ExitCode::from(error.kind.exit_code())
        }
    }
}

/// Ends all ranks when one has failed. What all of them find wrong, the leading one says.
fn failed_among(ranks: Ranks, error: &Error) -> ! {
    if !ranks.leads() {
        std::thread::sleep(LEAD_SPEAKS);
        Console::new(Mode::Human).error(&error.clone().within(&format!("rank {}", ranks.rank())), None);
    }
    ranks.abort(error.kind.exit_code())
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
