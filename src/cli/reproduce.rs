//! `morphcog reproduce`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::base::shell::quoted;
use crate::cli::in_session;
use crate::cli::output::console::Console;
use crate::cli::output::networks;
use crate::cli::tasks::{Command, TaskRequest, TaskResources, handle_request};
use crate::cli::values::decimal;
use crate::commands::plan::{PAPER_TOML, PaperPlan};
use crate::commands::reproduce;
use crate::commands::reproduce::ReproduceOptions;
use crate::commands::tasks::TaskFolders;
use clap::Args;
use std::path::{Path, PathBuf};

pub(super) const EXAMPLES: &str = "\
Examples:
  # the same steps with a hundredth of the generations
  morphcog reproduce paper.toml --scale 0.01
  # all of it
  morphcog reproduce paper.toml
  morphcog reproduce mine.toml --set seeds=[1,2] --out mine

Evolves every experiment from every seed, audits robots until enough are found physical, tests them \
on held-out images, finds the networks that are as accurate, and prints the paper's table. Ctrl-C \
stops it anywhere; the same command goes on.";

#[derive(Debug, Args)]
pub(super) struct ReproduceArgs {
    /// Plan file (TOML or JSON), or paper.toml, which is built in.
    #[arg(default_value = PAPER_TOML.0)]
    plan: String,
    /// More than 0, up to 1: multiplies generations; its square root multiplies test images (not
    /// below 100) and trainings (not below 5).
    #[arg(long, default_value_t = 1.0, value_parser = decimal())]
    scale: f64,
    #[arg(
        long,
        value_name = "KEY=VALUE",
        help = "Change a key, such as seeds=[1,2] or experiment.1.config=mine.toml (experiments \
                are counted from 1); without a value, it is reset to its default; may be given \
                several times"
    )]
    set: Vec<String>,
    /// Folder for all results.
    #[arg(short, long, value_name = "DIR", default_value = "reproduction")]
    out: PathBuf,
    #[command(flatten)]
    what: TaskRequest,
    #[command(flatten)]
    place: TaskResources,
}

pub(super) fn run(args: ReproduceArgs, console: &Console) -> Result<(), Error> {
    let plan = PaperPlan::load(&args.plan, &args.set)?;
    let tasks = reproduce::tasks(&plan, args.scale)?;
    let place = TaskFolders {
        out: args.out.clone(),
    };
    let name = if PaperPlan::is_built_in(&args.plan) {
        args.plan.clone()
    } else {
        absolute(&args.plan)?
    };
    let mut words = ["reproduce", &name, "--scale", &args.scale.to_string()]
        .map(quoted)
        .to_vec();
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
            name: "reproduce",
            tasks: &tasks,
            place: &place,
            with: &args.place,
            number: "--task",
        },
        console,
    )? {
        if args.what.list || args.what.slurm {
            console
                .info("when all tasks are done, the same command without --list or --slurm makes the table");
        }
        return Ok(());
    }
    let jobs = args.place.jobs.map(usize::from);
    let options = ReproduceOptions {
        plan,
        scale: args.scale,
        place,
        jobs,
    };
    let finished = in_session(console, args.place.with(), |session| {
        reproduce::reproduce(&options, session)
    })?;
    finished.runs.check(tasks.len())?;
    if finished.stopped {
        let text = "stopped; what is done so far is kept".to_string();
        return Err(Error::stopped(text).remedy(Remedy::Repeat));
    }
    networks::table(console, &finished);
    if let Some(error) = finished.unwritten {
        return Err(error);
    }
    for (path, file) in &finished.capacities {
        let made = networks::figure(file, path)?;
        console.line_about(&made[1], &format!("wrote {}", made[1].display()));
    }
    Ok(())
}

fn absolute(path: &str) -> Result<String, Error> {
    let path = Path::new(path);
    let absolute = std::path::absolute(path).map_err(|error| Error::reading(path, &error))?;
    Ok(absolute.to_string_lossy().into_owned())
}
