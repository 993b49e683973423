//! `morphcog compare`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::cli::choice::{Runs, run_jsons, selected};
use crate::cli::output::comparisons;
use crate::cli::output::console::Console;
use crate::cli::values::{seed, threads};
use crate::cli::{Resources, choice, in_session};
use crate::commands::compare;
use crate::commands::compare::CompareOptions;
use crate::robots::selection::Selection;
use crate::store::images::HowMany;
use clap::Args;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Examples:
  morphcog compare runs/zero_one-seed1 runs/zero_one-seed2
  # seeds of one setting, and of another
  morphcog compare runs/small-seed* runs/large-seed* \\
    -o sizes.csv
  # runs that ship, on all test images
  morphcog compare gallery:zero_one --images all

The robots of the other runs are compared with those of the first, image by image; McNemar's exact \
test says whether a difference is significant. Runs that differ in nothing but the seed are \
repetitions: they have a mean and a spread. No other runs are taken together. Results in an \
eval.json beside a run.json are reused if they are of the same images.";

#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// Two or more runs: each a run.json, or its folder, or runs of the gallery or atlas
    /// (gallery:zero_one, atlas:zero_one).
    #[arg(value_name = "ARCHIVE", value_parser = run_jsons(), required = true)]
    archives: Vec<Runs>,
    /// Which robot of each run, one of each task: best, top:1, random:1, best-validation:1, or ids
    /// or beginnings of ids, separated by commas (default: of each task the first on validation
    /// images if the run ranked robots by them, else the fittest).
    #[arg(short, long, visible_aliases = ["robot", "select"])]
    robots: Vec<Selection>,
    /// Only robots that morphcog audit found physical.
    #[arg(long)]
    physical_only: bool,
    /// Number of test images in all, equally many per class; or "all": every image of the classes
    /// (default: 1000, or all test images if there are fewer).
    #[arg(short = 'n', long)]
    images: Option<HowMany>,
    /// A dataset other than the runs', such as builtin, whose test images are used: robots of
    /// different datasets see the same images then.
    #[arg(long, value_name = "NAME")]
    dataset: Option<String>,
    /// Random seed for drawing images, and robots with random:1.
    #[arg(long, default_value_t = 1, value_parser = seed())]
    seed: u64,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// The table (.csv); the figure goes beside it as SVG, PNG and PDF (default: compare.csv above the
    /// runs).
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Threads (default: one per core).
    #[arg(long, value_parser = threads())]
    threads: Option<u16>,
}

pub(super) fn run(args: CompareArgs, console: &Console) -> Result<(), Error> {
    let archives = args.archives.into_iter();
    let archives: Vec<PathBuf> = archives.flat_map(|Runs(paths)| paths).collect();
    let robots = selected(args.robots)?;
    choice::say_simulated(&archives, console);
    let options = CompareOptions {
        archives,
        robots,
        physical_only: args.physical_only,
        images: args.images,
        dataset: args.dataset,
        seed: args.seed,
        out: args.out,
    };
    let with = Resources::of(args.threads, args.data);
    let outcome = in_session(console, with, |session| compare::compare(&options, session))?;
    comparisons::comparison(console, &outcome);
    Ok(())
}
