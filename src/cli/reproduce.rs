//! `morphcog reproduce`: its words, and what it calls.

use crate::base::error::Error;
use crate::base::signals;
use crate::commands::plan::{PAPER_TOML, Plan};
use crate::commands::reproduce;
use crate::commands::reproduce::Options;
use crate::view::console::Console;
use crate::view::networks;
use crate::view::reporters::Reporter;
use clap::Args;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Examples:
  morphcog reproduce paper.toml --scale 0.01      the same steps with a hundredth of the generations
  morphcog reproduce paper.toml                   all of it
  morphcog reproduce mine.toml --set seeds=[1,2] --out mine

Evolves every experiment from every seed, audits robots until enough are found physical, tests them on held-out images, finds
the networks they are worth, and prints the paper's table. Ctrl-C stops it anywhere; the same command goes on.";

#[derive(Debug, Args)]
pub(super) struct ReproduceArgs {
    /// What belongs to it (TOML or JSON), or paper.toml, which is built in.
    #[arg(default_value = PAPER_TOML.0)]
    plan: String,
    /// More than 0, up to 1: generations are multiplied by it, test images and trainings by its
    /// square root.
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// Change a key, as in seeds=[1,2] or experiment.1.config=mine.toml (experiments are counted
    /// from 1); without a value, it has its default again; may be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder for everything.
    #[arg(short, long, value_name = "DIR", default_value = "reproduction")]
    out: PathBuf,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Threads (default: one per core).
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

pub(super) fn run(args: ReproduceArgs, console: &Console) -> Result<(), Error> {
    let options = Options {
        plan: Plan::load(&args.plan, &args.set)?,
        scale: args.scale,
        out: args.out,
        data: args.data,
        threads: args.threads.map(usize::from),
    };
    let stop = signals::stop_flag()?;
    let finished = reproduce::reproduce(&options, &stop, &Reporter::new(console))?;
    if finished.stopped {
        let text = "stopped; what is done so far is kept".to_string();
        return Err(Error::stopped(text).hint("the same command goes on".to_string()));
    }
    networks::table(console, &finished);
    if let Some(error) = finished.unwritten {
        return Err(error);
    }
    for (path, file) in &finished.capacities {
        let made = networks::figure(file, path)?;
        console.line(&format!("wrote {}", made[1].display()));
    }
    Ok(())
}
