//! `morphcog capacity`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::cli::output::console::Console;
use crate::cli::output::networks;
use crate::cli::values::threads;
use crate::cli::{Resources, in_session};
use crate::commands::capacity;
use crate::commands::capacity::CapacityOptions;
use crate::config::capacity::CapacityConfig;
use crate::store::capacity::CapacityFile;
use crate::store::folder;
use crate::store::names::EVAL_JSON;
use clap::Args;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Examples:
  morphcog eval --archive runs/zero_one-seed* \\
    --robots random:10 --physical-only -o runs/eval.json
  # networks of sizes 1 to 45, 50 trainings each
  morphcog capacity --eval runs/eval.json
  # early stopping waits on other images than the test's
  morphcog capacity --eval runs/eval.json --clean
  morphcog capacity --eval runs/eval.json \\
    --set trainings=10 --set step=4 \\
    --set mlp.learning_rate=0.003";

#[derive(Debug, Args)]
pub(super) struct CapacityArgs {
    /// Result file of morphcog eval (default: eval.json beside the newest run under runs/).
    #[arg(short, long, value_name = "FILE")]
    eval: Option<PathBuf>,
    /// Early stopping uses images of the training split; in the paper it uses the test images.
    #[arg(long)]
    clean: bool,
    /// Only robots that morphcog audit found physical (audit.json is looked for beside the
    /// evaluation and one folder below).
    #[arg(long)]
    physical_only: bool,
    /// Settings: a TOML file (or JSON); missing keys have their defaults.
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Change a setting, such as trainings=10 or mlp.epochs=20; without a value, it is reset to its
    /// default; may be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Result file; a CSV and the figure go beside it (default: capacity.json beside eval.json,
    /// my-capacity.json beside my-eval.json).
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Threads (default: one per core).
    #[arg(long, value_parser = threads())]
    threads: Option<u16>,
}

pub(super) fn run(args: CapacityArgs, console: &Console) -> Result<(), Error> {
    let newest = || folder::newest_run().map(|run| run.with_file_name(EVAL_JSON));
    let eval = args.eval.map_or_else(newest, Ok)?;
    let mut set = args.set;
    set.extend(args.clean.then(|| "clean=true".to_string()));
    let options = CapacityOptions {
        config: CapacityConfig::load(args.config.as_deref(), &set)?,
        physical_only: args.physical_only,
        out: args.out.unwrap_or_else(|| CapacityFile::beside(&eval)),
        eval,
    };
    let with = Resources::of(args.threads, args.data);
    let finished = in_session(console, with, |session| {
        capacity::capacity(&options, session)
    })?;
    let capacity::CapacityOutcome { file, unwritten } = finished;
    networks::capacity(
        console,
        &file,
        unwritten.is_none().then_some(options.out.as_path()),
    );
    if let Some(error) = unwritten {
        return Err(error);
    }
    if !file.tasks.is_empty() {
        for path in &networks::figure(&file, &options.out)? {
            console.line_about(path, &format!("wrote {}", path.display()));
        }
    }
    if file.stopped {
        let text = "stopped; the trainings done so far are kept".to_string();
        return Err(Error::stopped(text).remedy(Remedy::Repeat));
    }
    Ok(())
}
