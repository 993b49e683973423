//! `morphcog train`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::shell::in_shell;
use crate::cli::choice;
use crate::cli::choice::{ROBOTS, run_json, selected};
use crate::cli::output::console::Console;
use crate::cli::output::{summary, verdicts};
use crate::cli::values::{seed, threads};
use crate::cli::{Resources, in_session};
use crate::commands::audit;
use crate::commands::evolve;
use crate::commands::train;
use crate::commands::train::{TrainOptions, TrainOutcome};
use crate::config::audit::Criteria;
use crate::images::whereabouts::Whereabouts;
use crate::robots::selection::Selection;
use crate::shipped;
use crate::store::folder;
use crate::store::folder::IfExists;
use crate::store::names::{AUDIT_JSON, RUN_JSON};
use crate::task::grouping::{Groups, groups_text};
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
then
  morphcog eval --archive runs/gaits-seed1-4v9 --robots best

The response of each gait is measured with random images. The most promising gait is trained \
on many training images, and the body is refined: challengers that answer better replace \
it. The robot is validated on images that it was not trained on, and audited. Ctrl-C stops it; \
--resume goes on, also after its end with more challengers (--set train.challengers=240).";

#[derive(Debug, Args)]
pub(super) struct TrainArgs {
    /// The run.json of the gaits, or its folder (default: the newest under runs/).
    #[arg(short, long, value_name = "FILE", value_parser = run_json())]
    archive: Option<PathBuf>,
    /// Two groups of classes, such as 4|9 or 0|123. Commas separate classes if one is above 9:
    /// 10,11|3, or "1|26," for 1 against 26.
    #[arg(short, long, value_name = "A|B")]
    task: Groups,
    #[arg(short, long, visible_aliases = ["robot", "select"], default_value = "top:4", help = ROBOTS)]
    robots: Vec<Selection>,
    /// Random seed (default: that of the archive's run).
    #[arg(long, value_parser = seed())]
    seed: Option<u64>,
    /// Change a key, such as train.rounds=10 or data.dataset=fashion-mnist; may be given several
    /// times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Run folder (default: the archive's folder and the task, such as runs/gaits-seed1-4v9).
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
}

pub(super) fn run(args: TrainArgs, console: &Console) -> Result<(), Error> {
    let archive = args.archive.map_or_else(folder::newest_run, Ok)?;
    let robots = selected(args.robots)?.unwrap_or(Selection::Top(GAITS));
    let name = name(&archive, args.task.classes(), args.seed);
    let beside = match shipped::is_named(&archive) {
        true => Some(Path::new(folder::RUNS)),
        false => archive.parent().and_then(|folder| folder.parent()),
    };
    let out = args
        .out
        .or(beside.map(|folder| folder.join(&name)))
        .unwrap_or_else(|| PathBuf::from(&name));
    let if_exists = match (args.resume, args.force) {
        (true, _) => IfExists::Resume,
        (_, true) => IfExists::Overwrite,
        _ => IfExists::Refuse,
    };
    let options = TrainOptions {
        archive,
        robots,
        groups: args.task,
        seed: args.seed,
        set: args.set,
        name,
        out,
        if_exists,
    };
    trained(&options, Resources::of(args.threads, args.data), console)
}

/// Default number of gaits to try.
const GAITS: usize = 4;

/// Returns the name of a training: the archive's folder and the task.
fn name(archive: &Path, [a, b]: &[Vec<u8>; 2], seed: Option<u64>) -> String {
    let folder = archive
        .parent()
        .and_then(Path::file_name)
        .map(|name| name.to_string_lossy());
    let of = match shipped::name(archive) {
        Some((of, "")) => of,
        Some((_, name)) => name,
        None => folder.as_deref().unwrap_or("run"),
    };
    let seed = seed.map_or(String::new(), |seed| format!("-seed{seed}"));
    format!("{of}-{}{seed}", groups_text([a, b], "v"))
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
    let name = name(&archive, groups, None);
    let of_training = out.with_file_name(&name);
    // Obstacles must be reported before the gaits evolve for an hour.
    let whereabouts =
        Whereabouts::given(session.data_folder()).and_of_resumed(*if_exists, &archive);
    training::check(config, groups, &whereabouts)?;
    if *if_exists == IfExists::Refuse {
        folder::vacant(&of_training)?;
    }
    Ok(TrainOptions {
        out: of_training,
        archive,
        robots: Selection::Top(GAITS),
        groups: groups.clone().into(),
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
