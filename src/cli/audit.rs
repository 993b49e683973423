//! `morphcog audit`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::ranks::Ranks;
use crate::base::remedy::Remedy;
use crate::base::text::counted;
use crate::cli::choice;
use crate::cli::choice::{Archives, ROBOTS, selected};
use crate::cli::output::console::Console;
use crate::cli::output::verdicts;
use crate::cli::values::{seed, threads};
use crate::cli::{Resources, in_session};
use crate::commands::audit;
use crate::commands::audit::{AuditOptions, AuditOutcome};
use crate::config::audit::Criteria;
use crate::robots;
use crate::robots::selection::Selection;
use crate::search::validation;
use crate::store::folder;
use crate::store::names::AUDIT_JSON;
use crate::store::run::different;
use crate::store::stored_run::StoredRun;
use clap::Args;
use std::path::{Path, PathBuf};

pub(super) const EXAMPLES: &str = "\
Examples:
  morphcog audit --archive runs/zero_one-seed1
  morphcog audit --archive runs/zero_one-seed1 \\
    --robots top:10
  morphcog audit --archive runs/zero_one-seed1 \\
    --robots best-validation:3
  morphcog audit --archive runs/zero_one-seed*
  # the robots published with the paper
  morphcog audit --robots gallery
  morphcog audit --set perturbations.time_step=[2,4,8] \\
    --set threshold=2
then
  morphcog eval --archive runs/zero_one-seed1 \\
    --robots random:10 --physical-only";

#[derive(Debug, Args)]
pub(super) struct AuditArgs {
    #[command(flatten)]
    archives: Archives,
    #[arg(short, long, visible_aliases = ["robot", "select"], default_value = "all", help = ROBOTS)]
    robots: Vec<Selection>,
    /// Random seed for random:N.
    #[arg(long, default_value_t = 1, value_parser = seed())]
    seed: u64,
    /// Criteria: a TOML file (or JSON); missing keys have their defaults.
    #[arg(long, value_name = "FILE")]
    criteria: Option<PathBuf>,
    #[arg(
        long,
        value_name = "KEY=VALUE",
        help = "Change a criterion, such as threshold=2 or perturbations.time_step=[2,4]; without \
                a value, it is reset to its default; may be given several times"
    )]
    set: Vec<String>,
    /// Repeat audits of robots that have verdicts.
    #[arg(long)]
    fresh: bool,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Result file; a CSV goes beside it (default: audit.json beside run.json, where
    /// --physical-only looks).
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Threads (default: one per core).
    #[arg(long, value_parser = threads())]
    threads: Option<u16>,
}

pub(super) fn run(args: AuditArgs, console: &Console, ranks: Ranks) -> Result<(), Error> {
    let criteria = Criteria::load(args.criteria.as_deref(), &args.set)?;
    let chosen = selected(args.robots.clone())?.unwrap_or(Selection::All);
    let (archives, chosen) = robots::archives(args.archives.paths(), chosen)?;
    choice::say_simulated(&archives, console);
    // The robots are chosen from all runs before the first rollout.
    let runs: Vec<StoredRun> = archives
        .iter()
        .map(|path| robots::open(path))
        .collect::<Result<_, _>>()?;
    different(
        runs.iter()
            .map(|source| (source.path.as_path(), &source.run)),
    )?;
    let asked = chosen.of_each(&runs, args.seed)?;
    if archives.len() > 1 && args.out.is_some() {
        let text = "--out: expected with one --archive only; of several, each gets an audit.json beside it";
        return Err(Error::usage(text.to_string()));
    }
    for (archive, robots) in archives.into_iter().zip(asked) {
        let Some(robots) = robots else { continue };
        let beside = folder::beside(&archive, AUDIT_JSON);
        let robots = match robots.validated() {
            Some(best) => validated(&args, (&archive, best), ranks, console)?,
            None => robots,
        };
        let options = AuditOptions {
            archive,
            robots,
            seed: args.seed,
            criteria: criteria.clone(),
            fresh: args.fresh,
            out: args.out.clone().unwrap_or(beside),
        };
        let with = Resources {
            ranks,
            ..Resources::of(args.threads, args.data.clone())
        };
        let finished = in_session(console, with, |session| audit::audit(&options, session))?;
        say_known(&finished, &options.out, console);
        verdicts::audit(console, &finished, &options.out);
        if let Some(error) = finished.unwritten {
            return Err(error);
        }
        if finished.stopped {
            let text = match finished.file.robots.len() {
                0 => "stopped before the first robot was audited; nothing is written".to_string(),
                audited => {
                    format!(
                        "stopped; {} audited and saved",
                        counted(audited, "robot is", "robots are")
                    )
                }
            };
            return Err(Error::stopped(text).remedy(Remedy::Repeat));
        }
    }
    Ok(())
}

fn say_known(finished: &AuditOutcome, out: &Path, console: &Console) {
    let AuditOutcome { known, shipped, .. } = finished;
    if *known == 0 {
        return;
    }
    let robots = counted(*known, "robot was", "robots were");
    let place = match shipped {
        Some(path) => format!("{}, which ships with the run", path.display()),
        None => out.display().to_string(),
    };
    console.info(&format!(
        "{robots} audited before ({place}); --fresh audits again"
    ));
}

/// Returns the best robots on validation images, from earlier results or from a search now.
fn validated(
    args: &AuditArgs,
    (archive, best): (&Path, usize),
    ranks: Ranks,
    console: &Console,
) -> Result<Selection, Error> {
    let options = validation::ValidationOptions {
        archive: archive.to_path_buf(),
        best: Some(best),
    };
    let with = Resources {
        ranks,
        ..Resources::of(args.threads, args.data.clone())
    };
    let found = in_session(console, with, |session| {
        validation::validate(&options, session)
    })?;
    let all_know = ranks.all(found.is_some());
    let Some(found) = found.filter(|_| all_know) else {
        let text = "stopped before the robots were chosen; nothing is audited";
        return Err(Error::stopped(text.to_string()).remedy(Remedy::Repeat));
    };
    Ok(Selection::Ids(
        found.into_iter().map(|robot| robot.id).collect(),
    ))
}
