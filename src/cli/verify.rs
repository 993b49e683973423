//! `morphcog verify`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::base::text::counted;
use crate::cli::output::claims;
use crate::cli::output::console::Console;
use crate::cli::values::threads;
use crate::cli::{Resources, in_session, process};
use crate::commands::verify;
use crate::commands::verify::{Agreement, Choice, VerifyOptions};
use clap::Args;
use std::path::PathBuf;
use std::process::Command;

pub(super) const EXAMPLES: &str = "\
Examples:
  # all claims, with their commands and costs
  morphcog verify --list
  # what takes some minutes and no download
  morphcog verify --quick
  # one claim
  morphcog verify zero-or-one --data data/mnist

Every command runs in a folder of its own below --out. A value is reproduced if it is the same to the \
last bit, or within tolerance if it differs by no more than the claim allows. Exit code 1 if any is \
not. Ctrl-C stops it; the same command goes on, and does not measure again what is measured.";

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    #[command(flatten)]
    what: Request,
    /// Measure claims again that have a result in the folder.
    #[arg(long)]
    fresh: bool,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Folder for the results.
    #[arg(short, long, value_name = "DIR", default_value = "verify")]
    out: PathBuf,
    /// Threads (default: one per core).
    #[arg(long, value_parser = threads())]
    threads: Option<u16>,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Request {
    /// Names of claims.
    #[arg(value_name = "CLAIM")]
    names: Vec<String>,
    /// Those that need no data, and some minutes.
    #[arg(long)]
    quick: bool,
    /// All; it begins with what they cost together.
    #[arg(long)]
    all: bool,
    /// List the claims, their commands and their costs; run nothing.
    #[arg(long)]
    list: bool,
}

pub(super) fn run(args: VerifyArgs, console: &Console) -> Result<(), Error> {
    let Request {
        names, quick, all, ..
    } = args.what;
    if args.what.list {
        claims::list(console, &verify::claims()?);
        return Ok(());
    }
    let choice = match (quick, all) {
        (true, _) => Choice::Quick,
        (_, true) => Choice::All,
        _ => Choice::Named(names),
    };
    let options = VerifyOptions {
        claims: verify::chosen(&choice)?,
        out: args.out,
        fresh: args.fresh,
        program: Box::new(program),
    };
    claims::costs(console, &options);
    let with = Resources::of(args.threads, args.data);
    let outcome = in_session(console, with, |session| verify::verify(&options, session))?;
    claims::verified(console, &outcome.verified);
    if outcome.stopped {
        let text = format!(
            "stopped after {}",
            counted(outcome.verified.len(), "claim", "claims")
        );
        return Err(Error::stopped(text).remedy(Remedy::Repeat));
    }
    let missed = outcome.verified.iter();
    let missed = missed.filter(|verified| verified.agreement() == Agreement::NotReproduced);
    let missed: Vec<&str> = missed
        .map(|verified| verified.claim.name.as_str())
        .collect();
    match missed.as_slice() {
        [] => Ok(()),
        missed => {
            let text = format!("not reproduced: {}", missed.join(", "));
            let advice = format!("what they wrote is below {}", options.out.display());
            Err(Error::other(text).advice(&advice))
        }
    }
}

/// Returns a command that calls this program for its events.
fn program() -> Result<Command, Error> {
    let mut command = match process::program() {
        // Words for a shell.
        Some(words) => {
            let mut shell = Command::new("sh");
            shell.args(["-c", &format!("exec {words} \"$@\""), "morphcog"]);
            shell
        }
        None => {
            let own = std::env::current_exe();
            Command::new(own.map_err(|error| Error::other(error.to_string()))?)
        }
    };
    command.arg("--json");
    Ok(command)
}
