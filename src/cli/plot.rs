//! `morphcog plot`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::session::Session;
use crate::base::stop::NEVER;
use crate::cli::choice;
use crate::cli::choice::{Archives, ROBOTS, selected};
use crate::cli::output::console::Console;
use crate::cli::output::reporters::Reporter;
use crate::cli::output::{summary, sweeps};
use crate::cli::values::{MOST, offering, seed, whole};
use crate::commands::plot;
use crate::commands::plot::{FigureKind, PlotOptions};
use crate::commands::replay::{ReplayOptions, ShownImage};
use crate::draw::plot::{Background, MILLIMETRES, Style};
use crate::robots::selection::{BEST, Selection};
use crate::search::one_by_one;
use crate::search::one_by_one::Named;
use clap::Args;
use std::ops::RangeInclusive;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Kinds:
  body       a robot's voxels by material
  spacetime  its position over time, seen from above
  snapshots  poses of its rollout laid over each other
  archive    fitness over muscle, sensor and total voxels
  progress   QD score, coverage and best fitness; several
             archives (seeds) make a band
  accuracy   what morphcog eval found
  capacity   what morphcog capacity found
  gates      each logic gate of a run on the dataset gates: its
             body, and its walks at every brightness of both cues

With several robots or archives, every kind but progress makes one figure for each. accuracy and \
capacity read eval.json and capacity.json beside run.json, or the file that --archive names.

Examples:
  morphcog plot archive --archive runs/zero_one-seed1
  morphcog plot body --robot best --robot 3fa \\
    --archive runs/zero_one-seed1
  # a robot published with the paper
  morphcog plot snapshots --robot YJTLA -o yjtla.svg
  morphcog plot spacetime --images train:1,test:17 \\
    -o walk.png --dpi 600
  morphcog plot body --robot top:3
  morphcog plot progress --archive runs/zero_one-seed*
  # for a paper set in Latin Modern
  morphcog plot accuracy -o accuracy.pdf --no-title \\
    --width 85 --font lmroman10-regular.otf";

#[derive(Debug, Args)]
pub(super) struct PlotArgs {
    /// Kind of figure.
    #[arg(value_parser = offering(FigureKind::ALL.map(|(_, name)| name), str::parse::<FigureKind>))]
    kind: FigureKind,
    #[command(flatten)]
    archives: Archives,
    #[arg(short, long, visible_aliases = ["robots", "select"], help = format!("{ROBOTS} [default: best]"))]
    robot: Vec<Selection>,
    /// Random seed for random:N.
    #[arg(long, default_value_t = 1, value_parser = seed())]
    seed: u64,
    /// Only robots that morphcog audit found physical: "best" is the best of them.
    #[arg(long)]
    physical_only: bool,
    /// Images by index, such as train:1,test:17 (default: the training images).
    #[arg(short, long, value_delimiter = ',')]
    images: Vec<ShownImage>,
    /// A dataset other than the run's, such as builtin.
    #[arg(long)]
    dataset: Option<String>,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Control steps between the poses of snapshots (default: fits the walk).
    #[arg(long, value_parser = whole::<u32>(1..=MOST))]
    every: Option<u32>,
    /// File; its ending (.svg, .png, .pdf) sets the format (default: all three,
    /// plot-<kind>[-<robot>] beside run.json).
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// PNG resolution in pixels per inch (default: 300, or less for a side over 16000 pixels).
    #[arg(long, value_parser = whole::<u32>(36..=2400))]
    dpi: Option<u32>,
    /// Transparent background.
    #[arg(long)]
    transparent: bool,
    /// Leave out the title, for a figure with a caption.
    #[arg(long)]
    no_title: bool,
    /// Width in millimetres; letters keep their size (default: 85 or 178, a journal's column or
    /// page).
    #[arg(long, value_name = "MM", value_parser = whole::<u32>(width()))]
    width: Option<u32>,
    /// Font of the letters (.ttf, .otf); a second --font is for bold ones.
    #[arg(long, value_name = "FILE")]
    font: Vec<PathBuf>,
}

fn width() -> RangeInclusive<u64> {
    u64::from(*MILLIMETRES.start())..=u64::from(*MILLIMETRES.end())
}

pub(super) fn run(args: PlotArgs, console: &Console) -> Result<(), Error> {
    let PlotArgs {
        kind,
        physical_only,
        images,
        data,
        dataset,
        ..
    } = args;
    let archives = args.archives.paths();
    // What is wrong with the file is to be known before robots are searched for.
    plot::formats(args.out.as_deref())?;
    let style = Style::default().millimetres(args.width);
    let style = match args.no_title {
        true => style.without_title(),
        false => style,
    };
    let style = style.in_font(&args.font)?;
    let robots: Vec<Named> = match selected(args.robot)? {
        Some(_) if !kind.is_of_robot() => return Err(plot::no_robot(kind)),
        None if !kind.is_of_robot() => {
            choice::say_unfinished(&archives, console);
            Vec::new()
        }
        robots => {
            let robots = robots.unwrap_or(Selection::Ids(vec![BEST.to_string()]));
            let archives = archives.clone();
            let search = one_by_one::RobotChoice {
                robots,
                archives,
                physical_only,
                seed: args.seed,
            };
            choice::one_by_one(&search, data.clone(), console)?
        }
    };
    let wanted = PlotOptions {
        kind,
        archives,
        robots,
        options: ReplayOptions {
            physical_only,
            images,
            data,
            dataset,
            ..ReplayOptions::default()
        },
        every: args.every.map_or(0, |steps| steps as usize),
        out: args.out,
        dpi: args.dpi,
        background: if args.transparent {
            Background::Transparent
        } else {
            Background::Paper
        },
        style,
    };
    let made = plot::plot(&wanted, &Session::new(&NEVER, &Reporter::new(console)))?;
    sweeps::differences(console, &made.progress);
    summary::gate_walks(console, &made.gates);
    Ok(())
}
