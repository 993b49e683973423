//! `morphcog plot`: its words, and what it calls.

use super::run_json;
use crate::run::Error;
use crate::run::replay::{Options, Shown};
use crate::view::console::Console;
use crate::view::figures::{self, Kind, Wanted};
use crate::view::plot::Background;
use clap::Args;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Kinds:
  body         a robot's voxels by material
  spacetime    its position over time, seen from above
  snapshots    poses of its life laid over each other
  sensitivity  by how much each pixel changes its walk
  archive      fitness over muscle, sensor and total voxels
  progress     QD score, coverage and best fitness; several --archive (seeds) make a band
  accuracy     what morphcog eval found (eval.json beside run.json)
  capacity     what morphcog capacity found (capacity.json beside run.json)

Examples:
  morphcog plot archive --archive runs/zero_one-seed1/run.json
  morphcog plot body --robot best --robot 3fa -a runs/zero_one-seed1/run.json
  morphcog plot snapshots --robot YJTLA -o yjtla.svg         a robot published with the paper
  morphcog plot spacetime --images train:1,test:17 -o walk.png --dpi 600
  morphcog plot progress -a runs/zero_one-seed1/run.json -a runs/zero_one-seed2/run.json
  morphcog plot progress --stage 7 -a runs/zero_one_curriculum-seed1";

#[derive(Debug, Args)]
pub(super) struct PlotArgs {
    /// What to show: body, spacetime, snapshots, sensitivity, archive, progress, accuracy or capacity.
    kind: Kind,
    /// A run.json, or its folder (default: the newest under runs/); for accuracy and capacity also an eval.json or
    /// capacity.json; may be given several times.
    #[arg(short, long, value_name = "FILE", value_parser = run_json())]
    archive: Vec<PathBuf>,
    /// Id (or the beginning of one), "best" (first on validation images if the run ranked robots by them, else the fittest), or the
    /// name of a published robot; may be given several times.
    #[arg(short, long, value_delimiter = ',')]
    robot: Vec<String>,
    /// Only robots that morphcog audit found physical: "best" is the best of them.
    #[arg(long)]
    physical_only: bool,
    /// Images by index, as train:1,test:17 (default: the training images).
    #[arg(short, long, value_delimiter = ',')]
    images: Vec<Shown>,
    /// Another dataset than the run's, as builtin.
    #[arg(long)]
    dataset: Option<String>,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Of progress: the stage of a curriculum to show alone, from 1; evaluations count from where it began.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    stage: Option<u16>,
    /// Control steps between the poses of snapshots (default: as suits the walk).
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    every: Option<u32>,
    /// File; its ending (.svg, .png) says the format (default: both, plot-<kind>[-<robot>] beside run.json).
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Pixels of PNG per inch.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u32).range(36..=2400))]
    dpi: u32,
    /// No white behind the figure.
    #[arg(long)]
    transparent: bool,
}

pub(super) fn run(args: PlotArgs, console: &Console) -> Result<(), Error> {
    let PlotArgs { physical_only, images, data, dataset, .. } = args;
    let wanted = Wanted {
        kind: args.kind,
        archives: args.archive,
        robots: args.robot,
        options: Options { physical_only, images, data, dataset, ..Options::default() },
        stage: args.stage.map(usize::from),
        every: args.every.map_or(0, |steps| steps as usize),
        out: args.out,
        dpi: args.dpi,
        background: if args.transparent { Background::Transparent } else { Background::Paper },
    };
    figures::make(console, &wanted).map(|_| ())
}
