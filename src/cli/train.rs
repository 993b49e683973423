//! `morphcog train`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::shell::{in_shell, quoted};
use crate::cli::choice;
use crate::cli::choice::{Archives, ROBOTS, selected};
use crate::cli::output::console::Console;
use crate::cli::output::{summary, verdicts};
use crate::cli::tasks::{
    Command, TaskRequest, TaskResources, handle_request, refused, warn_of_gaits,
};
use crate::cli::values::{MOST, seed, threads, whole};
use crate::cli::{Resources, in_session};
use crate::commands::audit;
use crate::commands::evolve;
use crate::commands::pairs;
use crate::commands::pairs::{Gaits, PairsOptions};
use crate::commands::tasks;
use crate::commands::tasks::{Run, TaskFolders};
use crate::commands::train;
use crate::commands::train::{TrainOptions, TrainOutcome};
use crate::config::audit::Criteria;
use crate::images::whereabouts::Whereabouts;
use crate::robots::selection::Selection;
use crate::shipped::gallery;
use crate::store::folder;
use crate::store::folder::IfExists;
use crate::store::names::{AUDIT_JSON, RUN_JSON};
use crate::task::grouping::Groups;
use crate::training;
use clap::Args;
use std::path::{Path, PathBuf};

pub(super) const EXAMPLES: &str = "\
Examples:
  morphcog evolve --config gaits.toml
  morphcog train --archive runs/gaits-seed1 --task \"4|9\"
  morphcog train --task \"0|123\" --robots top:10 \\
    --set train.rounds=10
  # look for the part of the images that helps most
  morphcog train --task \"4|9\" --set train.windows=2000 \\
    --set stimulus.reduction=area
  # a body for each pair of classes; they answer as a team
  morphcog train --pairs --dataset shapes
  morphcog train --pairs --classes 0,1,2,3 --status
  morphcog train --pairs --list | parallel
then
  morphcog eval --archive runs/gaits-seed1-4v9 --robots best
  morphcog team --archive runs/shapes-team

The response of each gait is measured with random images. The most promising gait is trained \
on many training images, and the body is refined: challengers that answer better replace \
it. The robot is validated on images that it was not trained on, and audited. Ctrl-C stops it; \
--resume goes on, also after its end with more challengers (--set train.challengers=240).

--pairs trains each pair of classes with the gait whose response predicts the highest accuracy, and, \
if the result is not physical, with the next best gait, too. The same command goes on after Ctrl-C, here or \
elsewhere. Exit code 0: all pairs are done; 1: some failed; 75: stopped. The settings are those of the \
team that ships; --set changes them:
  stimulus.reduction=area stimulus.encoding=threshold
  stimulus.level=0.25 stimulus.margin=5 (0 for images of
  another size than the gaits')
  train.windows=2000 train.random_images=600 train.rounds=4
  train.images=120 train.final_images=400
  train.challengers=8 validation.images=400";

/// Help for `--archive`, whose default depends on `--pairs`.
const ARCHIVE: &str = "The run.json of the gaits, or its folder (default: the newest under runs/; with --pairs \
gallery:gaits); of several, the gait with the highest predicted accuracy is trained";

#[derive(Debug, Args)]
#[command(mut_arg("archive", |archive| archive.help(ARCHIVE)))]
pub(super) struct TrainArgs {
    #[command(flatten)]
    archives: Archives,
    /// Two groups of classes, such as 4|9, 0|123 or cat|dog. Commas separate names, and numbers if
    /// one is above 9: cat,wolf|dog, 10,11|3, or "1|26," for 1 against 26.
    #[arg(short, long, value_name = "A|B", required_unless_present = "pairs")]
    task: Option<String>,
    /// Train a robot for each pair of classes.
    #[arg(long, conflicts_with_all = ["task", "resume", "force"])]
    pairs: bool,
    /// Classes of the pairs, by name or number, such as 0,1,2 (default: all of the dataset).
    #[arg(long, value_delimiter = ',', requires = "pairs")]
    classes: Vec<String>,
    #[arg(short, long, visible_aliases = ["robot", "select"], help = format!("{ROBOTS} [default: top:4; with --pairs or several archives top:5 of each]"))]
    robots: Vec<Selection>,
    /// Random seed (default: that of the archive's run).
    #[arg(long, value_parser = seed())]
    seed: Option<u64>,
    /// Change a key, such as train.rounds=10 or data.dataset=fashion-mnist; may be given several
    /// times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The dataset (default: that of the gaits).
    #[arg(long, value_name = "NAME")]
    dataset: Option<String>,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Run folder (default: the archive's folder and the task, such as runs/gaits-seed1-4v9; with
    /// --pairs, of all pairs: runs/<dataset>-team).
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on with the training in the folder; start it if there is none.
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Replace the run in the folder.
    #[arg(long)]
    force: bool,
    /// Threads (default: one per core); the result does not depend on it.
    #[arg(long, value_parser = threads())]
    threads: Option<u16>,
    #[command(flatten)]
    what: PairRequest,
}

/// A request about pairs other than to train all of them here.
#[derive(Debug, Args)]
struct PairRequest {
    /// Train one pair, or go on with it: its number from 1 (default: that of HQ_TASK_ID,
    /// SLURM_ARRAY_TASK_ID or PBS_ARRAY_INDEX).
    #[arg(long, value_name = "N", num_args = 0..=1, value_parser = whole::<usize>(0..=MOST), requires = "pairs", conflicts_with_all = ["list", "slurm", "status"])]
    pair: Option<Option<usize>>,
    /// Print one command per pair, for GNU parallel, HyperQueue or xargs.
    #[arg(long, requires = "pairs", conflicts_with_all = ["slurm", "status"])]
    list: bool,
    /// Print a job script for Slurm's sbatch.
    #[arg(long, requires = "pairs", conflicts_with = "status")]
    slurm: bool,
    /// Show the progress of every pair.
    #[arg(long, requires = "pairs")]
    status: bool,
    /// Pairs at once (default: one per thread).
    #[arg(long, value_parser = threads(), requires = "pairs")]
    jobs: Option<u16>,
}

pub(super) fn run(args: TrainArgs, console: &Console) -> Result<(), Error> {
    if args.pairs {
        return pairs(args, console);
    }
    // clap does not require what --task excludes.
    let of_pairs = [
        ("classes", !args.classes.is_empty()),
        ("pair", args.what.pair.is_some()),
        ("list", args.what.list),
        ("slurm", args.what.slurm),
        ("status", args.what.status),
        ("jobs", args.what.jobs.is_some()),
    ];
    if let Some((name, _)) = of_pairs.into_iter().find(|(_, is_given)| *is_given) {
        return Err(Error::usage("expected with --pairs only".to_string()).about(name));
    }
    let mut archives = args.archives.paths();
    if archives.is_empty() {
        archives.push(folder::newest_run()?);
    }
    let robots = selected(args.robots)?;
    let dataset = args
        .dataset
        .iter()
        .map(|name| format!("data.dataset={name}"));
    let set: Vec<String> = dataset.chain(args.set).collect();
    let task = args.task.as_deref();
    let task = task.expect("clap requires it without pairs");
    let groups = train::groups(&archives[0], task, &set, args.data.as_deref())?;
    let with = Resources::of(args.threads, args.data);
    let (archive, robots) = match archives.as_slice() {
        [archive] => (
            archive.clone(),
            robots.unwrap_or(Selection::Top(train::GAITS_OF_ONE)),
        ),
        _ => {
            let gaits = Gaits {
                archives,
                robots: robots.unwrap_or(Selection::Top(train::GAITS_OF_EACH)),
                groups: groups.clone(),
                seed: args.seed,
                set: set.clone(),
            };
            in_session(console, with.clone(), |session| {
                pairs::best_gait(&gaits, session)
            })?
        }
    };
    let name = train::name(&archive, &groups, args.seed);
    let out = args
        .out
        .unwrap_or_else(|| train::default_out(&archive, &name));
    let if_exists = match (args.resume, args.force) {
        (true, _) => IfExists::Resume,
        (_, true) => IfExists::Overwrite,
        _ => IfExists::Refuse,
    };
    let options = TrainOptions {
        archive,
        robots,
        groups,
        seed: args.seed,
        set,
        name,
        out,
        if_exists,
    };
    trained(&options, with, console)
}

/// Trains the pairs of a team, or handles a request about them.
fn pairs(args: TrainArgs, console: &Console) -> Result<(), Error> {
    let mut archives = args.archives.paths();
    if archives.is_empty() {
        archives = folder::run_json(PathBuf::from(gallery::GAITS)).map_err(Error::other)?;
    }
    let options = PairsOptions {
        archives,
        robots: selected(args.robots)?.unwrap_or(Selection::Top(train::GAITS_OF_EACH)),
        dataset: args.dataset.clone(),
        classes: (!args.classes.is_empty()).then_some(args.classes.clone()),
        seed: args.seed,
        set: args.set.clone(),
    };
    let name = format!("{}-team", options.dataset_name()?);
    let out = args
        .out
        .unwrap_or_else(|| Path::new(folder::RUNS).join(&name));
    let tasks = options.tasks(args.data.as_deref())?;
    let place = TaskFolders { out: out.clone() };
    let PairRequest {
        pair,
        list,
        slurm,
        status,
        jobs,
    } = args.what;
    let with = TaskResources {
        data: args.data,
        jobs,
        threads: args.threads,
    };
    let what = TaskRequest {
        task: pair,
        list,
        slurm,
        status,
    };
    let command = Command {
        words: words(&options, &args.classes)?,
        name: &name,
        tasks: &tasks,
        place: &place,
        with: &with,
        number: "--pair",
    };
    if let Some(Run::Pair(pair)) = tasks.first().map(|task| &task.run)
        && (list || slurm)
    {
        warn_of_unmeasured(&pair.gaits, console)?;
    }
    if handle_request(&what, &tasks, &command, console)? {
        return Ok(());
    }
    tasks::check_folders(&tasks, &place).map_err(|errors| refused(errors, console))?;
    warn_of_gaits(&tasks, console);
    in_session(console, with.with(), |session| {
        pairs::train_all(&tasks, &place, jobs.map(usize::from), session)
    })?;
    summary::pairs(console, &tasks, &place)?;
    console.suggest(
        "next:",
        &format!("morphcog team --archive {}", in_shell(&out)),
    );
    Ok(())
}

/// Warns of gaits that every process would measure for itself.
fn warn_of_unmeasured(gaits: &Gaits, console: &Console) -> Result<(), Error> {
    for unmeasured in pairs::unmeasured(gaits, &Session::default())? {
        let archive = match folder::full_name(&unmeasured.archive) {
            Some(name) => quoted(&name),
            None => in_shell(&unmeasured.archive),
        };
        console.warning(&format!(
            "gaits not measured yet: {}; before the pairs start, run: morphcog response \
             --archive {archive} --robots {} --images {} --error 0",
            unmeasured.robots.len(),
            quoted(unmeasured.robots.join(",")),
            unmeasured.rollouts
        ));
    }
    Ok(())
}

/// Returns the words of the command that trains the same pairs anywhere.
fn words(options: &PairsOptions, classes: &[String]) -> Result<Vec<String>, Error> {
    let mut words = vec!["train".to_string(), "--pairs".to_string()];
    for archive in &options.archives {
        let named = match folder::full_name(archive) {
            Some(name) => quoted(&name),
            None => {
                let absolute = std::path::absolute(archive);
                in_shell(&absolute.map_err(|error| Error::reading(archive, &error))?)
            }
        };
        words.extend(["--archive".to_string(), named]);
    }
    words.extend(["--robots".to_string(), quoted(options.robots.to_string())]);
    let dataset = options.dataset.iter();
    words.extend(dataset.flat_map(|name| ["--dataset".to_string(), quoted(name)]));
    if !classes.is_empty() {
        words.extend(["--classes".to_string(), quoted(classes.join(","))]);
    }
    let seed = options.seed.iter();
    words.extend(seed.flat_map(|seed| ["--seed".to_string(), seed.to_string()]));
    let set = options.set.iter();
    words.extend(set.flat_map(|set| ["--set".to_string(), quoted(set)]));
    Ok(words)
}

/// Returns the training that `evolve --train` does after the gaits have evolved. It fails if the
/// config does not have two groups that can be trained, several processes would share the training,
/// or its folder holds a run.
pub(super) fn after_evolution(
    evolution: &evolve::EvolveOptions,
    session: &Session,
) -> Result<TrainOptions, Error> {
    let evolve::EvolveOptions {
        config,
        out,
        if_exists,
        ..
    } = evolution;
    if session.ranks.size() > 1 {
        let text = "--train: expected one process: several cannot share a training".to_string();
        return Err(Error::usage(text).advice("evolve first, then morphcog train without mpirun"));
    }
    let Some(groups) = &config.task.groups else {
        let text = "--train: expected a config with task.groups, two groups of classes".to_string();
        return Err(Error::usage(text).advice("evolve first, then morphcog train --task"));
    };
    let archive = out.join(RUN_JSON);
    let whereabouts =
        Whereabouts::given(session.data_folder()).and_of_resumed(*if_exists, &archive);
    let names = whereabouts.class_names(&config.data)?;
    let groups = &Groups::from(groups.clone()).named(&names);
    let name = train::name(&archive, groups, None);
    let of_training = out.with_file_name(&name);
    // Obstacles must be reported before the gaits evolve for an hour.
    training::check(config, groups.classes(), &whereabouts)?;
    if *if_exists == IfExists::Refuse {
        folder::vacant(&of_training)?;
    }
    Ok(TrainOptions {
        out: of_training,
        archive,
        robots: Selection::Top(train::GAITS_OF_ONE),
        groups: groups.clone(),
        seed: None,
        set: Vec::new(),
        name,
        if_exists: *if_exists,
    })
}

/// Trains, validates and audits, and reports the results.
pub(super) fn trained(
    options: &TrainOptions,
    with: Resources,
    console: &Console,
) -> Result<(), Error> {
    choice::say_simulated([&options.archive], console);
    let finished = in_session(console, with.clone(), |session| {
        train::train(options, session)
    })?;
    let TrainOutcome { validated, .. } = &finished;
    summary::training(console, &finished, &options.out);
    let Some(validated) = validated else {
        let text = "stopped while validating; the run is saved".to_string();
        return Err(Error::stopped(text).remedy(Remedy::RepeatResuming));
    };
    if !validated.is_empty() {
        summary::validation(console, validated);
    }
    let archive = options.out.join(RUN_JSON);
    let options = audit::AuditOptions {
        robots: Selection::All,
        seed: 1,
        criteria: Criteria::load(None, &[])?,
        fresh: false,
        out: archive.with_file_name(AUDIT_JSON),
        archive: archive.clone(),
    };
    let audited = in_session(console, with, |session| audit::audit(&options, session))?;
    verdicts::audit(console, &audited, &options.out);
    if let Some(error) = audited.unwritten {
        return Err(error);
    }
    if audited.stopped {
        return Err(
            Error::stopped("stopped while auditing; the run is saved".to_string())
                .remedy(Remedy::RepeatResuming),
        );
    }
    console.suggest(
        "next:",
        &format!("morphcog eval --archive {}", in_shell(&archive)),
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_lists_the_settings_of_pairs() {
        for setting in pairs::SETTINGS {
            assert!(EXAMPLES.contains(setting), "{setting}");
        }
    }
}
