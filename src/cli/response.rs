//! `morphcog response`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::text::counted;
use crate::cli::choice;
use crate::cli::choice::{ROBOTS, run_json, selected};
use crate::cli::output::console::Console;
use crate::cli::output::responses;
use crate::cli::values::{MOST, decimal, seed, threads, whole};
use crate::cli::{Resources, in_session};
use crate::commands::response;
use crate::commands::response::ResponseOptions;
use crate::robots;
use crate::robots::selection::{BEST, Selection};
use crate::search::one_by_one;
use crate::search::one_by_one::Named;
use crate::store::folder;
use crate::store::names::RESPONSE_JSON;
use clap::Args;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Examples:
  morphcog response --archive runs/gaits
  # what they could be taught
  morphcog response --archive runs/gaits --robots top:4 \\
    --task \"4|9\"
  # a published robot
  morphcog response --robots YJTLA
  # a sharper map
  morphcog response --archive runs/gaits --error 0.1 \\
    --images 3000
then
  morphcog train --archive runs/gaits --task \"4|9\"

All soft voxels and sensors of a robot are made wide, narrow or left at rest by random images, each \
independently of the others: by how much does each move the body? A measurement ends when the slopes \
are known well enough (--error), or after --images rollouts. Images of a dataset are only needed \
with --task. Earlier measurements in response.json are reused for any task, by this command and by \
`train`: if many trainings begin with the same gaits, measure these first. Ctrl-C stops it.";

#[derive(Debug, Args)]
pub(super) struct ResponseArgs {
    /// The run.json, or its folder (default: the newest under runs/).
    #[arg(short, long, value_name = "FILE", value_parser = run_json())]
    archive: Option<PathBuf>,
    #[arg(short, long, visible_aliases = ["robot", "select"], help = format!("{ROBOTS} [default: best]"))]
    robots: Vec<Selection>,
    /// Only robots that morphcog audit found physical: "best" is the best of them.
    #[arg(long)]
    physical_only: bool,
    /// Two groups of classes, such as 4|9, 0|123 or 10,11|3 (as in train), to estimate the accuracy
    /// that training could reach.
    #[arg(short, long, value_name = "A|B")]
    task: Option<String>,
    /// Change a key of the config for a training of the task, such as stimulus.margin=5 or
    /// train.windows=2000; may be given several times.
    #[arg(long, value_name = "KEY=VALUE", requires = "task")]
    set: Vec<String>,
    /// Most rollouts per robot, each with a random image (60 or more); earlier ones are all reused.
    #[arg(short = 'n', long, default_value_t = 1000, value_parser = whole::<usize>(0..=MOST))]
    images: usize,
    /// Relative error of the slopes at which a robot's measurement ends; 0: only after --images
    /// rollouts.
    #[arg(long, default_value_t = 0.2, value_parser = decimal())]
    error: f64,
    /// Random seed for the images (default: that of the run, as train has it), and for random:N
    /// (default: 1).
    #[arg(long, value_parser = seed())]
    seed: Option<u64>,
    /// Folder with the images of the task.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Result file; a CSV and the picture (of several robots: one each) go beside it (default:
    /// response.json beside run.json).
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Threads (default: one per core); the result does not depend on it.
    #[arg(long, value_parser = threads())]
    threads: Option<u16>,
}

pub(super) fn run(args: ResponseArgs, console: &Console) -> Result<(), Error> {
    let robots = selected(args.robots)?.unwrap_or(Selection::Ids(vec![BEST.to_string()]));
    let (archives, robots) = robots::archives(args.archive.into_iter().collect(), robots)?;
    let [archive] = archives
        .try_into()
        .expect("one is named, or else there is one");
    let search = one_by_one::RobotChoice {
        robots,
        archives: vec![archive.clone()],
        physical_only: args.physical_only,
        seed: args.seed.unwrap_or(1),
    };
    let robots = choice::one_by_one(&search, args.data.clone(), console)?;
    let out = args
        .out
        .unwrap_or_else(|| folder::beside(&archive, RESPONSE_JSON));
    let options = ResponseOptions {
        robots: robots
            .into_iter()
            .map(|Named { robot, .. }| robot)
            .collect(),
        physical_only: args.physical_only,
        task: args.task,
        set: args.set,
        images: args.images,
        error: args.error,
        seed: args.seed,
        out,
        archive,
    };
    let with = Resources::of(args.threads, args.data);
    let finished = in_session(console, with, |session| {
        response::measure(&options, session)
    })?;
    responses::response(console, &finished, &options.out);
    if let Some(error) = finished.unwritten {
        return Err(error);
    }
    finished.draw(|path| console.line_about(path, &format!("wrote {}", path.display())))?;
    if finished.stopped {
        let text = match finished.file.robots.len() {
            0 if finished.file.unfinished.is_empty() => {
                "stopped before anything was measured; nothing is written".to_string()
            }
            0 => "stopped within the first robot; what was measured is saved".to_string(),
            robots => {
                format!(
                    "stopped after {}",
                    counted(robots, "robot; it is saved", "robots; those are saved")
                )
            }
        };
        return Err(Error::stopped(text));
    }
    Ok(())
}
