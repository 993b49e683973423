//! `morphcog demo`: parses its arguments and runs it.

use crate::base::error::{Error, ErrorKind};
use crate::base::remedy::Remedy;
use crate::cli::output::console::{Console, Mode};
use crate::cli::output::reporters::Reporter;
use crate::cli::output::summary;
use crate::cli::values::{seed, threads};
use crate::cli::{Resources, replay_best, reported, test};
use crate::commands::replay::ShownImage;
use crate::commands::train;
use crate::commands::{eval, replay};
use crate::data::builtin::BuiltinDigits;
use crate::data::dataset::{Dataset, Split};
use crate::robots::selection::{BEST, Selection};
use crate::search::held_out_run::CYCLES;
use crate::shipped::gallery;
use crate::store::folder;
use crate::store::folder::IfExists;
use crate::store::images::{HeldOut, HowMany};
use crate::store::names::{EVAL_JSON, RUN_JSON};
use crate::task::answer::THRESHOLD;
use clap::Args;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Examples:
  morphcog demo
then
  # draw digits yourself
  morphcog serve
  # evolve small robots from nothing
  morphcog evolve --config quickstart.toml

196 CPU seconds on Zen 3, no download: a gait that ships with the program is trained to tell zeros from ones, on \
digits that the program draws itself. Then the robot is shown 200 digits that it has never seen. \
Ctrl-C stops it; the same command goes on.";

/// Settings of a short training: 196 CPU seconds on Zen 3.
const LITTLE: [&str; 11] = [
    "data.dataset=builtin",
    "stimulus.encoding=threshold",
    "stimulus.level=0.25",
    "train.windows=500",
    "train.rounds=3",
    "train.images=80",
    "train.final_images=100",
    "train.challengers=4",
    "train.images_per_class=500",
    "train.random_images=600",
    // The test measures the result, so no images are needed for validation.
    "validation.best=0",
];

const TEST_IMAGES: usize = 200;

#[derive(Debug, Args)]
pub(super) struct DemoArgs {
    /// Random seed.
    #[arg(long, default_value_t = 1, value_parser = seed())]
    seed: u64,
    /// Run folder.
    #[arg(short, long, value_name = "DIR", default_value = "runs/demo")]
    out: PathBuf,
    /// Start again, replacing the run in the folder.
    #[arg(long)]
    force: bool,
    /// Threads (default: one per core); the result does not depend on it.
    #[arg(long, value_parser = threads())]
    threads: Option<u16>,
    /// Print every step of the training, and the tables of the test.
    #[arg(short, long)]
    verbose: bool,
}

pub(super) fn run(args: DemoArgs, console: &Console) -> Result<(), Error> {
    let options = train::TrainOptions {
        archive: folder::first_run(PathBuf::from(gallery::GAITS)).map_err(Error::other)?,
        robots: Selection::Ids(vec![BEST.to_string()]),
        groups: [vec![0], vec![1]].into(),
        seed: Some(args.seed),
        set: LITTLE.map(str::to_string).to_vec(),
        name: "demo".to_string(),
        out: args.out.clone(),
        if_exists: if args.force {
            IfExists::Overwrite
        } else {
            IfExists::Resume
        },
    };
    let with = Resources::of(args.threads, None);
    let brief = !args.verbose && console.mode() != Mode::Json;
    if brief {
        console
            .info("training a body to tell zeros from ones, then testing it: some three minutes");
    }
    let reporter = Reporter::new(console).brief(brief);
    let finished = reported(reporter, with.clone(), |session| {
        train::train(&options, session)
    })
    .map_err(|error| match error.kind {
        // It resumes by itself.
        ErrorKind::Stopped => Error {
            remedies: vec![Remedy::Repeat],
            ..error
        },
        _ => error,
    })?;
    if !brief {
        summary::training(console, &finished, &options.out);
    }
    let archive = options.out.join(RUN_JSON);
    let tested = eval::EvalOptions {
        out: archive.with_file_name(EVAL_JSON),
        archives: vec![archive],
        robots: options.robots,
        images: Some(HowMany::Evenly(TEST_IMAGES)),
        split: HeldOut::Test,
        validation: None,
        seed: args.seed,
        threshold: THRESHOLD,
        cycles: CYCLES,
        dataset: None,
    };
    let report = test(&tested, with, console, brief)?;
    let shown = replay::ReplayOptions {
        images: new_digits()?,
        ..replay::ReplayOptions::default()
    };
    let pictures = replay_best(&options.out, shown, console, brief)?;
    if brief {
        let robot = report.robots.first().expect("one robot was tested");
        summary::demo(console, robot, &options.out, &pictures);
    }
    Ok(())
}

/// Returns a zero and a one of the test digits.
fn new_digits() -> Result<Vec<ShownImage>, Error> {
    let digits = Dataset::builtin(BuiltinDigits::default(), &[Split::Test]);
    let digits = digits.map_err(|error| Error::other(error.to_string()))?;
    let first = |class: u8| digits.indices_of(Split::Test, class).first().copied();
    Ok([0, 1]
        .into_iter()
        .filter_map(first)
        .map(|index| ShownImage {
            split: Split::Test,
            index,
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::response::gait::Gait;
    use crate::response::probing::Probing;
    use crate::store::names::RESPONSE_JSON;
    use crate::store::response::ResponseFile;
    use crate::store::stored_run::StoredRun;
    use crate::training;

    #[test]
    fn the_response_that_ships_with_the_gaits_is_what_the_training_begins_with() {
        let archive = folder::first_run(PathBuf::from(gallery::GAITS)).unwrap();
        let StoredRun { run, .. } = StoredRun::read(&archive).unwrap();
        let set = LITTLE.map(str::to_string);
        let config = training::config_of(&run.config, &[vec![0], vec![1]], Some(1), &set).unwrap();
        assert_eq!(
            (config.data.dataset.as_str(), config.train.random_images),
            ("builtin", 600)
        );
        // After a change of version, `morphcog response` makes it anew.
        let file = ResponseFile::read(&archive.with_file_name(RESPONSE_JSON)).unwrap();
        let conditions: Vec<_> = config.train.perturbations.conditions().collect();
        let probing = Probing::new(&conditions, run.config.seed);
        let gait = Gait::of(&run.best().unwrap().body).unwrap();
        assert_eq!(
            file.known(
                &run.fingerprint(),
                run.config.seed,
                probing.conditions(),
                &gait
            )
            .0
            .len(),
            600
        );
    }

    #[test]
    fn a_zero_and_a_one_of_the_test_are_shown_at_the_end() {
        let shown = new_digits().unwrap();
        assert!(shown.len() == 2 && shown.iter().all(|shown| shown.split == Split::Test));
    }
}
