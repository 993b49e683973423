//! `morphcog team`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::number::percent;
use crate::base::remedy::Remedy;
use crate::base::text::counted;
use crate::cli::choice;
use crate::cli::choice::{Archives, selected};
use crate::cli::output::console::Console;
use crate::cli::output::teams;
use crate::cli::values::{held_out, seed, threads};
use crate::cli::{Resources, in_session};
use crate::commands::team;
use crate::commands::team::TeamOptions;
use crate::robots::selection::{BEST, Selection};
use crate::shipped::gallery;
use crate::store::folder;
use crate::store::images::{HeldOut, HowMany};
use clap::Args;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Examples:
  # the team that ships with the program
  morphcog team --images 100
  # a robot of each run
  morphcog team --archive runs/pairs/*/
  morphcog team --archive runs/0v1 runs/0v2 runs/1v2 \\
    --classes 0,1,2
  morphcog team --archive runs/pairs/*/ \\
    --split validation --images 400

A robot votes for the classes of the side it walks to, if it walks farther than 3 voxel lengths; \
most votes win; in a tie, the class with the largest sum of walks. A second answer is that sum of \
walks alone. No weight of the votes is trained. team.json keeps every walk: the same command goes on \
after Ctrl-C, and with more runs.";

/// Help for `--archive`, whose default differs from that of other commands, the newest run.
const ARCHIVE: &str = "A run.json, or its folder, or runs of the gallery; several may follow, and the option may be \
repeated (default: gallery:team, a robot for each pair of digits)";

#[derive(Debug, Args)]
#[command(mut_arg("archive", |archive| archive.help(ARCHIVE)))]
pub(super) struct TeamArgs {
    #[command(flatten)]
    archives: Archives,
    /// Which robots: all, top:N or random:N (of each archive and task), best (of each archive, the
    /// first on validation images if the run ranked robots by them, else the fittest), or ids or
    /// their beginnings, separated by commas (of all archives) [default: best].
    #[arg(short, long, visible_aliases = ["robot", "select"])]
    robots: Vec<Selection>,
    /// Classes to tell apart, by name or number, such as 0,1,2 (default: all of the dataset). Robots
    /// that know others are left out.
    #[arg(long, value_delimiter = ',')]
    classes: Vec<String>,
    /// Number of images in all, equally many per class; or "all": every image of the classes
    /// (default: 1000, or all if there are fewer).
    #[arg(short = 'n', long)]
    images: Option<HowMany>,
    /// Which images: test, or validation (of the training split, neither trained on nor chosen
    /// from).
    #[arg(long, default_value_t = HeldOut::Test, value_name = "SPLIT", value_parser = held_out())]
    split: HeldOut,
    /// Random seed for drawing images, and robots with random:N.
    #[arg(long, default_value_t = 1, value_parser = seed())]
    seed: u64,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Result file; a CSV and the pictures go beside it (default: team.json in the folder above all
    /// runs).
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Threads (default: one per core); the result does not depend on it.
    #[arg(long, value_parser = threads())]
    threads: Option<u16>,
}

pub(super) fn run(args: TeamArgs, console: &Console) -> Result<(), Error> {
    let mut archives = args.archives.paths();
    if archives.is_empty() {
        archives = folder::run_json(PathBuf::from(gallery::TEAM)).map_err(Error::other)?;
        console.line(&format!(
            "no --archive: the {} robots of {}",
            archives.len(),
            gallery::TEAM
        ));
    }
    choice::say_simulated(&archives, console);
    let options = TeamOptions {
        robots: selected(args.robots)?.unwrap_or(Selection::Ids(vec![BEST.to_string()])),
        classes: (!args.classes.is_empty()).then_some(args.classes),
        images: args.images,
        split: args.split,
        seed: args.seed,
        out: args
            .out
            .unwrap_or_else(|| folder::beside_all(&archives, team::own_name(args.split))),
        archives,
    };
    let with = Resources::of(args.threads, args.data);
    let team::TeamOutcome { file, unwritten } =
        in_session(console, with, |session| team::team(&options, session))?;
    teams::team(
        console,
        &file,
        unwritten.is_none().then_some(options.out.as_path()),
    )?;
    if let Some(error) = unwritten {
        return Err(error);
    }
    if file.answers.is_none() {
        let text = match file.so_far() {
            Some(part) => format!(
                "stopped after {} of {}, of which {} % are read; what is done is saved",
                part.images.len(),
                counted(file.images.len(), "image", "images"),
                percent(part.decided().votes.accuracy.accuracy)
            ),
            None => {
                "stopped before all robots had seen an image; what is done is saved".to_string()
            }
        };
        return Err(Error::stopped(text).remedy(Remedy::Repeat));
    }
    Ok(())
}
