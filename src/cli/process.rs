//! Runs the command line as a process: arguments in, exit code out.

use crate::base::error::{Error, ErrorKind};
use crate::base::ranks::Ranks;
use crate::base::signals;
use crate::base::text::is_unseen;
use crate::cli::explain::{Explained, explain};
use crate::cli::output::console::{Console, Mode};
use crate::cli::values::with_negative_numbers;
use crate::cli::{Cli, run};
use clap::{CommandFactory, FromArgMatches};
use std::ffi::OsString;
use std::io;
use std::sync::OnceLock;
use std::time::Duration;

/// Words that call this process in a shell, if not its own file.
static PROGRAM: OnceLock<String> = OnceLock::new();

/// Sets the words that call this process in a shell, if not its own file. Commands printed for
/// other processes begin with them. Only the first call counts.
pub fn called(words: String) {
    PROGRAM.get_or_init(|| words);
}

pub(super) fn program() -> Option<&'static str> {
    PROGRAM.get().map(String::as_str)
}

/// Time for the leading rank to report an error, before another rank that failed does.
const LEAD_SPEAKS: Duration = Duration::from_secs(2);

/// Runs the command line with these arguments, the program's name first, and returns the exit code.
/// By then, everything is printed.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    signals::heed_file_limit();
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let matches = with_negative_numbers(Cli::command()).try_get_matches_from(&arguments);
    let cli = match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(help) => return say(&help, &arguments),
    };
    // A program that MPI started may call commands that have nothing to do with it.
    let joined = match cli.command.is_long() {
        true => Ranks::join().map(|(ranks, guard)| (ranks, Some(guard))),
        false => Ok((Ranks::ALONE, None)),
    };
    let (ranks, _guard) = match joined {
        Ok(joined) => joined,
        Err(error) => {
            Console::new(cli.mode()).failed(&error);
            return error.kind.exit_code();
        }
    };
    let console = match ranks.leads() {
        true => Console::new(cli.mode()),
        false => Console::with_writers(Mode::Quiet, Box::new(io::sink()), Box::new(io::sink())),
    };
    match run(cli, &console, ranks) {
        Ok(()) => u8::from(console.has_lost_results()),
        Err(error) => {
            // The user requested the stop, so it is no error.
            if error.kind == ErrorKind::Stopped {
                let Explained { message, hint } = explain(&error);
                console.info(&hint.map_or(message.clone(), |hint| format!("{message}; {hint}")));
            } else {
                console.failed(&error);
                if ranks.size() > 1 {
                    failed_among(ranks, &error);
                }
            }
            error.kind.exit_code()
        }
    }
}

/// Ends all ranks when one has failed. The leading one reports the errors that all of them find.
fn failed_among(ranks: Ranks, error: &Error) -> ! {
    if !ranks.leads() {
        std::thread::sleep(LEAD_SPEAKS);
        let error = error.clone().in_place(&format!("rank {}", ranks.rank()));
        Console::new(Mode::Human).failed(&Error {
            remedies: Vec::new(),
            ..error
        });
    }
    ranks.abort(error.kind.exit_code())
}

/// Returns an error of the command line in one line, with clap's tips as advice.
fn as_error(help: &clap::Error) -> Error {
    if help.kind() == clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return Error::usage("expected a command or an argument".to_string());
    }
    let text = help.to_string();
    let one_line = |lines: &str| lines.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut parts = text
        .trim_start_matches("error: ")
        .split("\n\n")
        .map(one_line);
    let error = Error::usage(parts.next().expect("a split text has a first part"));
    let tips: Vec<String> = parts
        .filter_map(|part| Some(part.strip_prefix("tip: ")?.to_string()))
        .collect();
    match tips.is_empty() {
        true => error,
        false => error.advice(tips.join("; ")),
    }
}

/// Prints help, the version, or an error of the command line, and returns the exit code.
fn say(help: &clap::Error, arguments: &[OsString]) -> u8 {
    let code = u8::try_from(help.exit_code()).unwrap_or(2);
    // File names that a shell inserted may have hidden characters.
    let hides_any = arguments
        .iter()
        .any(|argument| argument.to_string_lossy().contains(is_unseen));
    if help.use_stderr() && arguments.iter().any(|argument| argument == "--json") {
        Console::new(Mode::Json).failed(&as_error(help));
        return code;
    }
    if help.use_stderr() && hides_any {
        let text = help.to_string();
        Console::new(Mode::Human).error(
            &io::Error::other(text.trim_start_matches("error: ").trim()),
            None,
        );
        return code;
    }
    if help.use_stderr() {
        let text = help.render();
        Console::new(Mode::Human).usage(&text.to_string(), &text.ansi().to_string());
        return code;
    }
    match help.print() {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Console::new(Mode::Human).error(&error, None);
            1
        }
        _ => code,
    }
}
