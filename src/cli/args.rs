//! Arguments of the command line: clap's types, help and examples.

use crate::cli::audit::AuditArgs;
use crate::cli::capacity::CapacityArgs;
use crate::cli::choice::{Archives, ROBOTS, Runs, run_jsons};
use crate::cli::compare::CompareArgs;
use crate::cli::demo::DemoArgs;
use crate::cli::import::ImportArgs;
use crate::cli::output::console::Mode;
use crate::cli::output::pictures::Format;
use crate::cli::plot::PlotArgs;
use crate::cli::report::ReportArgs;
use crate::cli::reproduce::ReproduceArgs;
use crate::cli::response::ResponseArgs;
use crate::cli::serve::ServeArgs;
use crate::cli::site::SiteArgs;
use crate::cli::sweep::SweepArgs;
use crate::cli::team::TeamArgs;
use crate::cli::train::TrainArgs;
use crate::cli::values::{MOST, decimal, held_out, offering, seed, threads, whole};
use crate::cli::verify::VerifyArgs;
use crate::cli::{
    audit, capacity, compare, demo, plot, report, reproduce, response, serve, site, sweep, team,
    train, verify,
};
use crate::commands::plan::PAPER_TOML;
use crate::commands::replay::ShownImage;
use crate::commands::schema;
use crate::config;
use crate::data::catalogue::FETCHABLE;
use crate::data::dataset::BUILTIN;
use crate::data::gates::NAMES;
use crate::draw::scene::Look;
use crate::robots::selection::Selection;
use crate::search::held_out_run;
use crate::store::images::{HeldOut, HowMany};
use crate::task::answer;
use clap::builder::{StringValueParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Evolve soft robots whose bodies alone recognise images.
///
/// Evolution combines voxels that oscillate, voxels that swell or shrink with one pixel, and
/// passive voxels, so that the robot walks one way when it sees a zero and the other way when it
/// sees a one: no neurons, no controller.
#[derive(Debug, Parser)]
#[command(name = "morphcog", version, after_help = EXAMPLES, max_term_width = 80)]
pub struct Cli {
    #[command(subcommand)]
    pub(super) command: Command,
    /// Results, warnings and errors only.
    #[arg(short, long, global = true, conflicts_with = "json")]
    pub(super) quiet: bool,
    /// One JSON object per line on stdout, for programs.
    #[arg(long, global = true)]
    pub(super) json: bool,
}

/// Help for commands that show one robot; that for several is in `choice`.
const ROBOT: &str = "Which robot: best (first on validation images if the run ranked robots by them, else \
the fittest), an id or the beginning of one; top:1, random:1 or best-validation:1 (of each task) if that is one \
robot; without --archive also the name of a published robot";

/// Help for `--set`.
pub(super) const SET: &str = "Change a key, such as map_elites.parents=10 or task.groups.2=[1,2] (items are counted \
from 1); without a value, such as data.train_images=, it is reset to its default; may be given several times";

const EXAMPLES: &str = "\
Examples:
  # a first look, no download
  morphcog demo
  # draw a digit, and watch a body read it
  morphcog serve
  # small robots from nothing
  morphcog evolve --config quickstart.toml
  # watch the fittest robot of the newest run
  morphcog replay --robot best
  # the paper's experiments
  morphcog data fetch mnist
  morphcog evolve --config zero_one.toml
  morphcog eval --archive runs/zero_one-seed1 \\
    --robots top:10

Exit codes:
  0    done
  1    failed for another reason, such as a full disk
  2    wrong command line
  3    file missing or wrong, or a value out of range
  4    rollout unstable (simulate)
  5    folder of a run, dataset or site, or port taken
  75   stopped by a signal, saved, can be resumed
  130  ended at once by Ctrl-C: the second, or the first with nothing to save";

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// A first look: train a body, and test it.
    #[command(after_help = demo::EXAMPLES)]
    Demo(DemoArgs),
    /// Evolve bodies with MAP-Elites.
    #[command(after_help = "\
Examples:
  morphcog evolve --config quickstart.toml
  morphcog evolve --config zero_one.toml --seed 2 \\
    --generations 1000
  # goes on with that run
  morphcog evolve --config zero_one.toml --seed 2 \\
    --generations 30000 --resume
  morphcog evolve --config zero_one.toml \\
    --set map_elites.parents=40 --out runs/forty

Ctrl-C (or SIGTERM, SIGUSR1, SIGHUP) drops the generation under way, saves and exits with 75; a \
second Ctrl-C ends at once.")]
    Evolve(EvolveArgs),
    /// Measure how far each soft voxel and sensor moves a robot, and what training could reach.
    #[command(after_help = response::EXAMPLES)]
    Response(ResponseArgs),
    /// Train the gaits of an archive to tell two groups of images apart.
    #[command(after_help = train::EXAMPLES)]
    Train(TrainArgs),
    /// Test robots on held-out images.
    #[command(after_help = "\
Examples:
  morphcog eval --archive runs/zero_one-seed1 --images 1000
  morphcog eval --archive runs/zero_one-seed1 \\
    --robots top:10
  morphcog eval --archive runs/zero_one-seed1 \\
    --robots 3fa,b02 -o two.json
  # the paper's test
  morphcog eval --archive runs/zero_one-seed* \\
    --robots random:10 --physical-only
  # the robots published with the paper
  morphcog eval --robots gallery")]
    Eval(EvalArgs),
    /// Let robots of several runs classify images together.
    #[command(after_help = team::EXAMPLES)]
    Team(TeamArgs),
    /// Check whether robots walk or exploit the simulator.
    #[command(after_help = audit::EXAMPLES)]
    Audit(AuditArgs),
    /// Find the smallest networks that are as accurate as the robots.
    #[command(after_help = capacity::EXAMPLES)]
    Capacity(CapacityArgs),
    /// Compare runs: settings, accuracies, archives, bodies.
    #[command(after_help = compare::EXAMPLES)]
    Compare(CompareArgs),
    /// Make a page about runs: archive, robots to watch, tests, methods.
    #[command(after_help = report::EXAMPLES)]
    Report(ReportArgs),
    /// Run many seeds, tasks and settings, here or on a cluster.
    #[command(after_help = sweep::EXAMPLES)]
    Sweep(SweepArgs),
    /// Run the whole paper, at a chosen scale.
    #[command(after_help = reproduce::EXAMPLES)]
    Reproduce(ReproduceArgs),
    /// Run the commands behind the project's claims again, and compare.
    #[command(
        after_help = verify::EXAMPLES,
        override_usage = "morphcog verify [OPTIONS] <CLAIM>...\n       morphcog verify [OPTIONS] --quick | --all | --list"
    )]
    Verify(VerifyArgs),
    /// Watch a robot: a GIF, a page for the browser, or a film.
    #[command(after_help = "\
Examples:
  morphcog replay --robot best
  morphcog replay --robot 3fa \\
    --archive runs/zero_one-seed1 --images train:1,test:17
  # a robot published with the paper (see morphcog gallery)
  morphcog replay --robot XFJPI
  # in the terminal: space pauses, . steps, q quits
  morphcog replay --robot best --format terminal
  # the best on validation images
  morphcog replay --robot best-validation:1
  morphcog replay --robot best -o walk.gif
  # a film for a talk, by ffmpeg
  morphcog replay --robot best -o walk.mp4
  # its frames, and the command that makes a film of them
  morphcog replay --robot best -o frames/")]
    Replay(ReplayArgs),
    /// Make a figure: SVG, PNG and PDF for papers and pages.
    #[command(after_help = plot::EXAMPLES)]
    Plot(PlotArgs),
    /// Simulate any body with any stimuli or targets, on any terrain.
    #[command(after_help = "\
Examples:
  morphcog simulate scenario.json --out traj.csv
  morphcog simulate scenario.json --out walk.gif
  jq '.control_steps = 50' scenario.json |
    morphcog simulate - --points > points.csv

scenario.json:
  {\"body\": [[3, 3, 6], [4, 0, 5]],
   \"stimulus\": [[0, 0.5, 1], [0, 0, 1]],
   \"control_steps\": 500, \"start_row\": 2,
   \"start_column\": 493, \"reset_between\": false}

body: rows from the top; 0 empty, 1 rigid, 2 soft, 3 and 4 muscle (in phase, antiphase), 5 and 6 \
sensor (shrinks, expands), 7 and 8 actuator (horizontal, vertical). stimulus: one pixel per voxel, 0 to 1; or \
\"stimuli\": [...] with \"switch_every\": 500; and targets of actuators, in voxel lengths:
  \"targets\": {\"mean\": 1.1, \"amplitude\": 0.5,
    \"period\": 25, \"phases\": [0, 1.7, 3.4, 5.1]}
or a list for each control step. Fixed cells (5) instead of the flat ground:
  \"terrain\": [{\"column\": 0, \"row\": 0,
    \"grid\": [\"0000000055\", \"5555555555\"]}]

Output: step,com_x,com_y in voxel lengths, x from the body's left edge at the start, y from the ground (on \
terrain from column 0 and row 0); with --points also x_0,y_0,… and pixel_0_0,…, target_0_0,…. \
Exit code 4 if the rollout becomes unstable.")]
    Simulate(SimulateArgs),
    /// Draw a digit and watch robots walk, in the browser.
    #[command(after_help = serve::EXAMPLES)]
    Serve(ServeArgs),
    /// Write the page as static files: anybody can open them, without the program.
    #[command(after_help = site::EXAMPLES)]
    Site(SiteArgs),
    /// Find, download and look at images.
    #[command(after_help = "\
Examples:
  morphcog data fetch mnist
  morphcog data info mnist
  morphcog data sheet builtin -o sheet.png")]
    Data {
        #[command(subcommand)]
        command: DataCommand,
    },
    /// List the robots published with the paper.
    #[command(after_help = "Examples:\n  morphcog gallery\n  morphcog replay --robot XFJPI")]
    Gallery,
    /// List the built-in configs, or print one to start your own from.
    #[command(
        after_help = "Examples:\n  morphcog config\n  morphcog config zero_one.toml > mine.toml"
    )]
    Config {
        /// Name of a built-in config, or a file: printed with its defaults.
        #[arg(value_parser = config_or_file(), hide_possible_values = true)]
        name: Option<String>,
        #[arg(long, value_name = "KEY=VALUE", requires = "name", help = SET)]
        set: Vec<String>,
    },
    /// List the JSON Schemas of configs and results, for editors and validators, or print one.
    #[command(
        after_help = "Examples:\n  morphcog schema\n  morphcog schema config > morphcog-config.schema.json"
    )]
    Schema {
        /// Name of a schema, as morphcog schema lists them.
        #[arg(value_parser = offering(schema::ALL.map(|schema| schema.name), StringValueParser::new()))]
        name: Option<String>,
    },
    /// Print completions for a shell.
    #[command(
        after_help = "Example:\n  morphcog completions bash \\\n    > ~/.local/share/bash-completion/completions/morphcog"
    )]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Write the man pages.
    #[command(after_help = "\
Examples:
  morphcog man > morphcog.1 && man ./morphcog.1
  morphcog man --out ~/.local/share/man/man1")]
    Man {
        /// Folder for the pages of all commands (default: the page of morphcog itself, to standard
        /// output).
        #[arg(short, long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Measure how fast this machine simulates.
    ///
    /// It takes the processor time of one thread, which other work on the machine hardly affects.
    /// Where the system does not report that (Windows), it takes wall-clock time, and says so.
    #[command(after_help = "Examples:\n  morphcog bench\n  morphcog bench --all")]
    Bench {
        /// Every instruction set of this machine, not only the one in use.
        #[arg(long)]
        all: bool,
    },
}

impl Command {
    /// Returns true for commands so long that several processes may be meant to share them.
    pub(super) fn is_long(&self) -> bool {
        matches!(
            self,
            Command::Demo(_)
                | Command::Evolve(_)
                | Command::Response(_)
                | Command::Train(_)
                | Command::Eval(_)
                | Command::Team(_)
                | Command::Audit(_)
                | Command::Capacity(_)
                | Command::Compare(_)
                | Command::Report(_)
                | Command::Sweep(_)
                | Command::Reproduce(_)
        )
    }
}

#[derive(Debug, Args)]
pub(super) struct EvolveArgs {
    /// Config file (TOML or JSON), or the name of a built-in one (see morphcog config).
    #[arg(short, long, value_name = "FILE")]
    pub(super) config: String,
    #[arg(long, value_name = "KEY=VALUE", help = SET)]
    pub(super) set: Vec<String>,
    /// Random seed.
    #[arg(long, value_parser = seed())]
    pub(super) seed: Option<u64>,
    /// Number of generations.
    #[arg(short, long, value_parser = whole::<u64>(1..=config::MAX_NUMBER))]
    pub(super) generations: Option<u64>,
    /// Threads (default: one per core); the result does not depend on it.
    #[arg(long, value_parser = threads())]
    pub(super) threads: Option<u16>,
    /// Run folder (default: runs/<config>-seed<seed>).
    #[arg(short, long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    pub(super) data: Option<PathBuf>,
    /// Go on with the run in the folder; start it if there is none.
    #[arg(long, conflicts_with = "force")]
    pub(super) resume: bool,
    /// Replace the run in the folder.
    #[arg(long)]
    pub(super) force: bool,
    /// Then train the fittest gaits to tell the config's two groups apart, as morphcog train does.
    #[arg(long)]
    pub(super) train: bool,
    /// At the end, replay the best robot into its run folder.
    #[arg(long)]
    pub(super) replay: bool,
}

#[derive(Debug, Args)]
pub(super) struct EvalArgs {
    #[command(flatten)]
    pub(super) archives: Archives,
    /// Number of images in all, equally many per class; or "all": every image of the classes
    /// (default: 1000, or all test images if there are fewer).
    #[arg(short = 'n', long)]
    pub(super) images: Option<HowMany>,
    /// Which images: test, or validation (of the training split, neither trained on nor chosen
    /// from), to compare robots while the test images stay unused.
    #[arg(long, default_value_t = HeldOut::Test, value_name = "SPLIT", value_parser = held_out())]
    pub(super) split: HeldOut,
    #[arg(short, long, visible_aliases = ["robot", "select"], default_value = "top:10", help = ROBOTS)]
    pub(super) robots: Vec<Selection>,
    /// Number of validation images for best-validation (default: that of the config, or 400).
    #[arg(long, value_name = "IMAGES", value_parser = whole::<u32>(1..=1_000_000))]
    pub(super) validation: Option<u32>,
    /// Only robots that morphcog audit found physical.
    #[arg(long)]
    pub(super) physical_only: bool,
    /// Random seed for drawing images, and robots with random:N.
    #[arg(long, default_value_t = 1, value_parser = seed())]
    pub(super) seed: u64,
    /// A dataset other than the run's, such as builtin, whose test images are used.
    #[arg(long, value_name = "NAME")]
    pub(super) dataset: Option<String>,
    /// Displacements up to this many voxel lengths are wrong.
    #[arg(long, default_value_t = answer::THRESHOLD, value_parser = decimal())]
    pub(super) threshold: f64,
    /// Actuation cycles per image.
    #[arg(long, default_value_t = held_out_run::CYCLES, value_parser = whole::<u32>(1..=10_000))]
    pub(super) cycles: u32,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    pub(super) data: Option<PathBuf>,
    /// Result file; a CSV goes beside it (default: eval.json, or eval-validation.json, beside
    /// run.json, or above several).
    #[arg(short, long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    /// Threads (default: one per core).
    #[arg(long, value_parser = threads())]
    pub(super) threads: Option<u16>,
}

#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    #[arg(short, long, visible_aliases = ["robots", "select"], default_value = "best", help = ROBOT)]
    pub(super) robot: Selection,
    /// Random seed for random:1.
    #[arg(long, default_value_t = 1, value_parser = seed())]
    pub(super) seed: u64,
    /// Only robots that morphcog audit found physical: "best" is the best of them.
    #[arg(long)]
    pub(super) physical_only: bool,
    /// The run.json, or its folder, or runs of the gallery (default: the newest under runs/).
    #[arg(short, long, value_name = "FILE", value_parser = run_jsons())]
    pub(super) archive: Option<Runs>,
    /// Images by index, such as train:1,test:17 (default: the training images).
    #[arg(short, long, value_delimiter = ',')]
    pub(super) images: Vec<ShownImage>,
    /// A dataset other than the run's, such as builtin.
    #[arg(long)]
    pub(super) dataset: Option<String>,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    pub(super) data: Option<PathBuf>,
    /// Formats to make, separated by commas (default: gif,html).
    #[arg(short, long, value_delimiter = ',', value_parser = offering(Format::ALL.map(|(_, name)| name), str::parse::<Format>))]
    pub(super) format: Vec<Format>,
    /// File; its ending (.gif, .html, .png, .mp4, .webm) sets the format; a folder, such as frames/,
    /// takes a film's frames (default: replay-<robot> beside run.json).
    #[arg(short, long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    /// Show all images at once, instead of one after another (the page has a button).
    #[arg(long)]
    pub(super) side_by_side: bool,
    /// Width of pictures in pixels; with --side-by-side, of each walk (default: 480, films 1280).
    #[arg(long, value_parser = whole::<u32>(0..=MOST))]
    pub(super) width: Option<u32>,
    /// Control steps per frame: more is faster and a smaller file (default: 1, or 2 of a GIF without
    /// --fps).
    #[arg(long, value_parser = whole::<u16>(1..=500))]
    pub(super) every: Option<u16>,
    /// Frames per second; 50 control steps are a second of the robot's own time (default: 50, or 25
    /// of a GIF without --every).
    #[arg(long, value_parser = whole::<u32>(1..=50))]
    pub(super) fps: Option<u32>,
    /// Style of pictures: plain, or as in the paper's videos.
    #[arg(long, default_value_t = Look::Plain, value_parser = offering(["plain", "paper"], str::parse::<Look>))]
    pub(super) look: Look,
    /// Open the result.
    #[arg(long)]
    pub(super) open: bool,
}

#[derive(Debug, Args)]
pub(super) struct SimulateArgs {
    /// The scenario (JSON); - reads it from standard input.
    pub(super) scenario: PathBuf,
    /// CSV file (default: standard output), or, by its ending, a picture or film (.gif, .html, .png,
    /// .mp4, .webm; a folder, such as frames/, takes a film's frames).
    #[arg(short, long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    /// Write every point, pixel and target as well.
    #[arg(long)]
    pub(super) points: bool,
    /// Width of pictures in pixels (default: 480, films 1280).
    #[arg(long, value_parser = whole::<u32>(0..=MOST))]
    pub(super) width: Option<u32>,
}

#[derive(Debug, Subcommand)]
pub(super) enum DataCommand {
    /// Download a dataset and check it.
    #[command(
        after_help = "Examples:\n  morphcog data fetch\n  morphcog data fetch fashion-mnist --to ~/data/fashion"
    )]
    Fetch {
        /// Name of the dataset to download.
        #[arg(default_value = "mnist", value_parser = offering(FETCHABLE, StringValueParser::new()))]
        dataset: String,
        /// Folder (default: data/<dataset>).
        #[arg(long, value_name = "DIR")]
        to: Option<PathBuf>,
        /// Address of a folder with the files, instead of the well-known mirrors.
        #[arg(long, value_name = "URL")]
        mirror: Option<String>,
        /// Replace existing files that differ.
        #[arg(long)]
        force: bool,
    },
    /// Make a dataset of pictures, arrays or tables of your own.
    ///
    /// Images become grey, bright on a dark ground, and of one size. Training and test images are the
    /// source's own or drawn by the seed. The command says what it did to them.
    #[command(after_help = "\
Examples:
  morphcog data import photos/ --name shapes
  morphcog data import mnist.npz --name mine
  morphcog data import train.csv test.csv --name letters")]
    Import(ImportArgs),
    /// Show which files of a dataset are found, and where.
    #[command(
        after_help = "Examples:\n  morphcog data info\n  morphcog data info emnist-digits --data ~/data/emnist"
    )]
    Info(DatasetArgs),
    /// Make a contact sheet: images side by side.
    #[command(after_help = "Example:\n  morphcog data sheet builtin -o sheet.png")]
    Sheet {
        #[command(flatten)]
        dataset: DatasetArgs,
        /// Images per class.
        #[arg(short, long, default_value_t = 16, value_parser = whole::<usize>(0..=MOST))]
        samples: usize,
        /// The test images instead of the training images.
        #[arg(long)]
        test: bool,
        /// PNG file.
        #[arg(short, long, value_name = "FILE", default_value = "sheet.png")]
        out: PathBuf,
    },
}

#[derive(Debug, Args)]
pub(super) struct DatasetArgs {
    /// builtin, gates, mnist, fashion-mnist, or a name of your own.
    #[arg(default_value = BUILTIN, value_parser = dataset(), hide_possible_values = true)]
    pub(super) dataset: String,
    /// Folder with the files.
    #[arg(long, value_name = "DIR")]
    pub(super) data: Option<PathBuf>,
    /// Swap rows and columns of the images, as data.transpose: true or false (default: EMNIST's).
    #[arg(long, value_name = "BOOL")]
    pub(super) transpose: Option<bool>,
}

fn config_or_file() -> impl TypedValueParser<Value = String> {
    let names = config::BUILT_IN.map(|(name, _)| name);
    offering(
        names.into_iter().chain([PAPER_TOML.0]),
        StringValueParser::new(),
    )
}

/// Parses the name of a dataset, which may be the user's own.
fn dataset() -> impl TypedValueParser<Value = String> {
    offering(
        [BUILTIN].into_iter().chain(NAMES).chain(FETCHABLE),
        StringValueParser::new(),
    )
}

impl Cli {
    pub(crate) fn mode(&self) -> Mode {
        match (self.quiet, self.json) {
            (true, _) => Mode::Quiet,
            (_, true) => Mode::Json,
            _ => Mode::Human,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::values::with_negative_numbers;
    use clap::{Command, CommandFactory};

    /// Returns the commands in the examples of a help text, as a shell reads them.
    fn examples(help: &str) -> Vec<Vec<String>> {
        let help = help.replace(" \\\n", " ").replace(" |\n", " | ");
        let lines = help
            .lines()
            .filter(|line| line.starts_with("  ") && !line.trim_start().starts_with('#'));
        let begin = |line: &str| {
            line.find("morphcog ")
                .map(|place| line[place..].to_string())
        };
        let ends = [" | ", " > ", " && "];
        let command = |line: String| {
            let end = ends
                .iter()
                .filter_map(|end| line.find(end))
                .min()
                .unwrap_or(line.len());
            line[..end]
                .replace('"', "")
                .split_whitespace()
                .map(str::to_string)
                .collect()
        };
        lines.filter_map(begin).map(command).collect()
    }

    fn check(command: &mut Command, columns: usize, count: &mut usize) {
        let mut narrow = command.clone().term_width(columns);
        let help = narrow.render_help().to_string();
        let (_, footer) = help.rsplit_once("Example").unwrap();
        let whole = command.get_after_help().unwrap().to_string();
        assert_eq!(
            examples(footer),
            examples(whole.rsplit_once("Example").unwrap().1)
        );
        for words in examples(footer) {
            let read = with_negative_numbers(Cli::command()).try_get_matches_from(&words);
            assert!(
                read.is_ok(),
                "{columns} columns: {words:?}: {}",
                read.unwrap_err()
            );
            *count += 1;
        }
        for sub in command
            .get_subcommands_mut()
            .filter(|sub| sub.get_name() != "help")
        {
            check(sub, columns, count);
        }
    }

    #[test]
    fn every_example_of_every_help_is_a_command() {
        for columns in [60, 80] {
            let (mut command, mut count) = (Cli::command(), 0);
            command.build();
            check(&mut command, columns, &mut count);
            assert!(count > 80, "{count}");
        }
    }
}
