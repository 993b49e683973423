//! `morphcog report`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::session::Session;
use crate::base::stop::NEVER;
use crate::cli::choice;
use crate::cli::choice::{Archives, Runs, run_jsons};
use crate::cli::explain::spell;
use crate::cli::output::console::Console;
use crate::cli::output::reporters::Reporter;
use crate::cli::values::{MOST, whole};
use crate::commands::report;
use crate::commands::report::ReportOptions;
use crate::store::folder;
use clap::Args;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Examples:
  morphcog report --archive runs/zero_one-seed1
  morphcog report --archive runs/zero_one-seed* \\
    -o seeds.html
  morphcog report --archive runs/zero_one-seed1 \\
    --rollouts 20 --open

What lies beside a run.json is part of its report: metrics.csv, eval.json, audit.json, \
capacity.json. With several runs, their common results are looked for in the folder above them.";

#[derive(Debug, Args)]
pub(super) struct ReportArgs {
    #[command(flatten)]
    archives: Archives,
    /// Archives without the option's name, as in earlier command lines.
    #[arg(value_parser = run_jsons(), hide = true)]
    runs: Vec<Runs>,
    /// Robots that can be watched, the fittest of each run; with more, each has fewer frames (the
    /// page stays below 20 MB).
    #[arg(long, value_name = "ROBOTS", default_value_t = 100, value_parser = whole::<usize>(0..=MOST))]
    rollouts: usize,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// The page (default: report.html beside run.json, or above several).
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Open the page.
    #[arg(long)]
    open: bool,
}

pub(super) fn run(args: ReportArgs, console: &Console) -> Result<(), Error> {
    let mut archives = args.archives.paths();
    archives.extend(args.runs.into_iter().flat_map(|Runs(paths)| paths));
    if archives.is_empty() {
        archives.push(folder::newest_run()?);
    }
    match args.rollouts {
        0 => choice::say_unfinished(&archives, console),
        _ => choice::say_simulated(&archives, console),
    }
    let out = args
        .out
        .unwrap_or_else(|| folder::beside_all(&archives, "report.html"));
    let options = ReportOptions {
        archives,
        rollouts: args.rollouts,
        out,
        spell: &spell,
    };
    let reporter = Reporter::new(console);
    report::report(&options, &Session::new(&NEVER, &reporter).data(args.data))?;
    drop(reporter);
    match args.open {
        true => super::show(&options.out),
        false => Ok(()),
    }
}
