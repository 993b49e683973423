//! `morphcog sweep`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::shell::{in_shell, quoted};
use crate::base::text::counted;
use crate::cli::in_session;
use crate::cli::output::console::Console;
use crate::cli::output::sweeps;
use crate::cli::tasks::{
    Command, TaskRequest, TaskResources, handle_request, refused, warn_of_gaits,
};
use crate::commands::sweep::SweepPlan;
use crate::commands::tasks::TaskFolders;
use crate::commands::{collect, tasks};
use crate::store::folder;
use clap::Args;
use std::path::{Path, PathBuf};

pub(super) const EXAMPLES: &str = "\
plan.toml:
  # or, to train: archive = \"runs/gaits-seed1\"
  config = \"zero_one.toml\"
  seeds = [1, 2, 3]
  set = [\"generations=1000\"]
  [vary]
  map_elites.parents = [10, 20, 40]
  # after each run
  [audit]
  [eval]
  robots = \"random:10\"
  physical_only = true

Examples:
  # all tasks here, one per core
  morphcog sweep plan.toml
  morphcog sweep plan.toml --status
  # one CSV, and figures
  morphcog sweep plan.toml --collect
  # elsewhere: GNU parallel, Slurm, HyperQueue
  morphcog sweep plan.toml --list | parallel
  morphcog sweep plan.toml --slurm | sbatch
  hq submit --array 1-9 -- morphcog sweep $PWD/plan.toml \\
    --out $PWD/runs/plan --threads 1 --task

Every combination of seeds, groups or pairs (of classes) and varied keys is a task with a run folder \
of its own. Ctrl-C stops anywhere; the same command goes on, here or elsewhere. Exit code 0: all \
tasks are done; 1: some failed; 75: stopped.";

#[derive(Debug, Args)]
pub(super) struct SweepArgs {
    /// Plan file (TOML or JSON; morphcog schema sweep has its keys).
    plan: PathBuf,
    #[arg(
        long,
        value_name = "KEY=VALUE",
        help = "Change a key of the plan, such as seeds=[1,2]; without a value, it is reset to its \
                default; may be given several times"
    )]
    set: Vec<String>,
    /// Folder for all run folders (default: runs/<plan>).
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    what: TaskRequest,
    /// Collect the results of all tasks: sweep.csv, and figures.
    #[arg(long, conflicts_with_all = ["task", "list", "slurm", "status"])]
    collect: bool,
    #[command(flatten)]
    place: TaskResources,
}

pub(super) fn run(args: SweepArgs, console: &Console) -> Result<(), Error> {
    let plan = SweepPlan::load(&args.plan, &args.set)?;
    let tasks = plan
        .tasks(&args.plan, args.place.data.as_deref())
        .map_err(|errors| refused(errors, console))?;
    let name = args.plan.file_stem().map_or("sweep".to_string(), |stem| {
        stem.to_string_lossy().into_owned()
    });
    let out = args
        .out
        .unwrap_or_else(|| Path::new(folder::RUNS).join(&name));
    let place = TaskFolders { out: out.clone() };
    let absolute =
        std::path::absolute(&args.plan).map_err(|error| Error::reading(&args.plan, &error))?;
    let mut words = vec!["sweep".to_string(), in_shell(&absolute)];
    words.extend(
        args.set
            .iter()
            .flat_map(|set| ["--set".to_string(), quoted(set)]),
    );
    if handle_request(
        &args.what,
        &tasks,
        &Command {
            words,
            name: &name,
            tasks: &tasks,
            place: &place,
            with: &args.place,
            number: "--task",
        },
        console,
    )? {
        return Ok(());
    }
    tasks::check_folders(&tasks, &place).map_err(|errors| refused(errors, console))?;
    if args.collect {
        let status = tasks::status(&tasks, &place)?;
        let warn = |text: &str| console.warning(text);
        let collected = collect::collect(&tasks, &status, &place, &warn)?;
        return sweeps::collected(console, &name, &collected, &status, &out);
    }
    warn_of_gaits(&tasks, console);
    let jobs = args.place.jobs.map(usize::from);
    let summary = in_session(console, args.place.with(), |session| {
        tasks::run_all(&tasks, &place, jobs, session)
    })?;
    summary.check(tasks.len())?;
    console.line(&format!(
        "{} done, in {}",
        counted(tasks.len(), "task is", "tasks are"),
        out.display()
    ));
    console.suggest(
        "next:",
        &format!("morphcog sweep {} --collect", in_shell(&args.plan)),
    );
    Ok(())
}
