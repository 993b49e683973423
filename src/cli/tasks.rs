//! Options that `sweep` and `reproduce` share: to run one task or all, list them or show progress.

use crate::base::error::Error;
use crate::base::shell::{in_shell, quoted};
use crate::cli::output::console::Console;
use crate::cli::output::sweeps;
use crate::cli::values::{MOST, threads, whole};
use crate::cli::{Resources, in_session};
use crate::cli::{choice, process};
use crate::commands::tasks;
use crate::commands::tasks::{Run, Task, TaskFolders};
use crate::shipped::atlas;
use clap::Args;
use std::path::{Path, PathBuf};

/// Variables in which engines number the tasks of their processes, the innermost engine first.
const NUMBERS: [&str; 3] = ["HQ_TASK_ID", "SLURM_ARRAY_TASK_ID", "PBS_ARRAY_INDEX"];

/// Most tasks of an array job, unless a cluster says otherwise (Slurm's `MaxArraySize`, 1001).
const MOST_OF_AN_ARRAY: usize = 1000;

/// Seconds that a task must have run to be queued again at its time limit; with less, it would
/// spend all its time on starting.
const LEAST_SECONDS: u32 = 10;

/// A request other than to run all tasks here.
#[derive(Debug, Args)]
#[group(multiple = false)]
pub(super) struct TaskRequest {
    /// Do one task, or go on with it: its number from 1 (default: that of HQ_TASK_ID,
    /// SLURM_ARRAY_TASK_ID or PBS_ARRAY_INDEX).
    #[arg(long, value_name = "N", num_args = 0..=1, value_parser = whole::<usize>(0..=MOST))]
    pub(super) task: Option<Option<usize>>,
    /// Print one command per task, for GNU parallel, HyperQueue or xargs.
    #[arg(long)]
    pub(super) list: bool,
    /// Print a job script for Slurm's sbatch.
    #[arg(long)]
    pub(super) slurm: bool,
    /// Show the progress of every task.
    #[arg(long)]
    pub(super) status: bool,
}

/// Resources of the tasks.
#[derive(Debug, Args)]
pub(super) struct TaskResources {
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    pub(super) data: Option<PathBuf>,
    /// Tasks at once (default: one per thread).
    #[arg(long, value_parser = threads())]
    pub(super) jobs: Option<u16>,
    /// Threads of all tasks together (default: one per core; in --list and --slurm one per task).
    #[arg(long, value_parser = threads())]
    pub(super) threads: Option<u16>,
}

impl TaskResources {
    pub(super) fn with(&self) -> Resources {
        Resources::of(self.threads, self.data.clone())
    }
}

/// A command that runs tasks, to print for other machines.
pub(super) struct Command<'a> {
    /// Its words after the program's name, up to the options that all such commands share.
    pub(super) words: Vec<String>,
    /// Name of the plan.
    pub(super) name: &'a str,
    pub(super) tasks: &'a [Task],
    pub(super) place: &'a TaskFolders,
    pub(super) with: &'a TaskResources,
    /// The option that numbers a task.
    pub(super) number: &'static str,
}

impl Command<'_> {
    /// Returns the whole command without its number of threads, independent of the present folder
    /// and of variables.
    fn line(&self) -> Result<String, Error> {
        let absolute =
            |path: &Path| std::path::absolute(path).map_err(|error| Error::reading(path, &error));
        let own = || std::env::current_exe().map_err(|error| Error::other(error.to_string()));
        let mut words = vec![match process::program() {
            Some(words) => words.to_string(),
            None => in_shell(&own()?),
        }];
        words.extend(self.words.iter().cloned());
        words.extend(["--out".to_string(), in_shell(&absolute(&self.place.out)?)]);
        let environment = std::env::var_os("MORPHCOG_DATA")
            .filter(|value| !value.is_empty())
            .map(PathBuf::from);
        if let Some(data) = self
            .with
            .data
            .clone()
            .or(environment)
            .or_else(|| self.data_here())
        {
            words.extend(["--data".to_string(), in_shell(&absolute(&data)?)]);
        }
        if let Some(atlas) = self.tasks.iter().find_map(Task::atlas) {
            words.splice(
                0..0,
                [
                    "env".to_string(),
                    format!("{}={}", atlas::VARIABLE, in_shell(&absolute(&atlas)?)),
                ],
            );
        }
        Ok(words.join(" "))
    }

    /// Returns the default folder of the tasks' images, relative to the present one, if all share
    /// it.
    fn data_here(&self) -> Option<PathBuf> {
        let mut all = self.tasks.iter().map(Task::data_here);
        let first = all.next()?;
        all.all(|other| other == first).then_some(first)?
    }

    fn list(&self, count: usize, console: &Console) -> Result<(), Error> {
        let (line, threads) = (self.line()?, self.with.threads.unwrap_or(1));
        (1..=count).for_each(|number| {
            console.command(&format!(
                "{line} --threads {threads} {} {number}",
                self.number
            ))
        });
        Ok(())
    }

    /// Prints a job script for sbatch.
    fn slurm(&self, count: usize, console: &Console) -> Result<(), Error> {
        let out = &self.place.out;
        std::fs::create_dir_all(out).map_err(|error| Error::writing(out, &error))?;
        let out = std::path::absolute(out).map_err(|error| Error::reading(out, &error))?;
        let (name, line, threads) = (self.name, self.line()?, self.with.threads.unwrap_or(1));
        let (name, log) = (quoted(name), out.join("slurm-%A-%a.log"));
        // Slurm reads these lines itself, without a shell's escapes.
        if [name.as_str(), &in_shell(&log)]
            .iter()
            .any(|word| word.starts_with('$'))
        {
            let text = format!(
                "--slurm: {}: expected names of plan and folder that are text",
                log.display()
            );
            return Err(Error::usage(text).advice("rename them, or use --list"));
        }
        let first = count.min(MOST_OF_AN_ARRAY);
        if count > first {
            let submit = |before: usize| {
                let last = (count - before).min(first);
                format!("sbatch --array=1-{last} --export=ALL,TASKS_BEFORE={before} job.sh")
            };
            let others: Vec<String> = (first..count).step_by(first).map(submit).collect();
            console.warning(&format!(
                "{count} tasks are more than Slurm's arrays have by default (up to {first}, MaxArraySize - 1): the \
                 script is for the first {first}. For those after them, submit it again: {}",
                others.join("; ")
            ));
        }
        console.text(&format!(
            r#"#!/bin/bash
#SBATCH --job-name={name}
#SBATCH --array=1-{first}
#SBATCH --cpus-per-task={threads}
#SBATCH --signal=B:USR1@120
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output={log}

# Two minutes before the time limit Slurm sends SIGUSR1. The task saves itself and ends with 75, and is queued again; so is a
# task that the signal meets while it starts: it ends with 138. One that had less than {LEAST_SECONDS} seconds is not: it would
# never end.
task= again=no had=
trap 'again=yes had=${{had:-$SECONDS}}; [ -z "$task" ] || kill -USR1 "$task"' USR1
trap '[ -z "$task" ] || kill -TERM "$task"' TERM
number=$((${{TASKS_BEFORE:-0}} + SLURM_ARRAY_TASK_ID))
{line} --threads "${{SLURM_CPUS_PER_TASK:-1}}" {option} "$number" &
task=$!
if [ "$again" = yes ]; then kill -USR1 "$task"; fi
while true; do
  wait "$task"
  code=$?
  kill -0 "$task" 2>/dev/null || break
done
if [ "$again" = yes ] && {{ [ "$code" -eq 75 ] || [ "$code" -eq 138 ]; }}; then
  if [ "$had" -lt {LEAST_SECONDS} ]; then
    echo "error: task $number had $had s: it is saved, and not queued again; give it more than three minutes (sbatch --time=04:00:00)" >&2
  else
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}" ||
      echo "error: task $number is saved, but scontrol could not queue it again; submit the script again: it goes on" >&2
  fi
fi
exit "$code"
"#,
            log = in_shell(&log),
            option = self.number,
        ));
        Ok(())
    }
}

/// Reports every error but the last, which is left to `main`.
pub(super) fn refused(mut errors: Vec<Error>, console: &Console) -> Error {
    let last = errors
        .pop()
        .expect("something is refused, and it is said what");
    errors.iter().for_each(|error| console.failed(error));
    last
}

/// Warns of gaits that another version of the program made.
pub(super) fn warn_of_gaits(tasks: &[Task], console: &Console) {
    // All tasks train the gaits of one archive.
    match tasks.first().map(|task| &task.run) {
        Some(Run::Train(training)) => choice::warn_of_versions([&training.archive], console),
        Some(Run::Pair(pair)) => choice::warn_of_versions(&pair.gaits.archives, console),
        _ => {}
    }
}

/// Handles a request other than to run all tasks; returns false if there is none.
pub(super) fn handle_request(
    what: &TaskRequest,
    tasks: &[Task],
    command: &Command,
    console: &Console,
) -> Result<bool, Error> {
    let place = command.place;
    if let Some(number) = what.task {
        let number = number.map_or_else(|| from_engine(command.number), Ok)?;
        let Some(task) = number.checked_sub(1).and_then(|index| tasks.get(index)) else {
            let text = format!(
                "{} {number}: expected a number from 1 to {}",
                command.number,
                tasks.len()
            );
            return Err(Error::usage(text));
        };
        tasks::check_folders(std::slice::from_ref(task), place)
            .map_err(|errors| refused(errors, console))?;
        tasks::check_data(
            std::iter::once((number, task)),
            place,
            command.with.data.as_deref(),
        )?;
        warn_of_gaits(std::slice::from_ref(task), console);
        in_session(console, command.with.with(), |session| {
            tasks::run(task, place, session)
        })?;
        console.line(&format!("task {number} ({}): done", task.name));
    } else if what.list {
        command.list(tasks.len(), console)?;
    } else if what.slurm {
        command.slurm(tasks.len(), console)?;
    } else if what.status {
        tasks::check_folders(tasks, place).map_err(|errors| refused(errors, console))?;
        sweeps::status(console, &tasks::status(tasks, place)?);
    } else {
        return Ok(false);
    }
    Ok(true)
}

/// Returns the number that an engine gave to this process.
fn from_engine(option: &str) -> Result<usize, Error> {
    let given = NUMBERS
        .iter()
        .find_map(|name| Some((name, std::env::var(name).ok()?)));
    let Some((name, value)) = given else {
        let text = format!(
            "{option}: expected a number, or one of {} to be set",
            NUMBERS.join(", ")
        );
        return Err(Error::usage(text));
    };
    value
        .trim()
        .parse()
        .map_err(|_| Error::usage(format!("{name}={value}: expected the number of a task")))
}
