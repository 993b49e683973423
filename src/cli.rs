//! The command line: one short function per command.

mod args;
mod audit;
mod capacity;
mod choice;
mod compare;
mod demo;
pub mod explain;
mod import;
pub mod output;
mod plot;
mod process;
mod report;
mod reproduce;
mod response;
mod serve;
mod site;
mod sweep;
mod tasks;
mod team;
mod train;
mod values;
mod verify;

use crate::base::error::{Error, ErrorKind};
use crate::base::ranks::Ranks;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::stop::NEVER;
use crate::base::text::counted;
use crate::base::{signals, threads};
use crate::cli::output::console::Console;
use crate::cli::output::pictures::Format;
use crate::cli::output::reporters::Reporter;
use crate::cli::output::{pictures, summary};
use crate::commands::evolve;
use crate::commands::plan::{PAPER_TOML, PaperPlan};
use crate::commands::schema::{self, Schema};
use crate::commands::{bench, data, eval, replay, simulate};
use crate::config;
use crate::config::Config;
use crate::data::catalogue::Catalogue;
use crate::data::dataset::{BUILTIN, Dataset, DatasetError, Split};
use crate::data::fetch::{FetchError, FetchOptions, Program, fetch};
use crate::data::files::{FilesError, places};
use crate::draw::sheet;
use crate::draw::sheet::SheetError;
use crate::robots;
use crate::robots::published;
use crate::robots::selection::{BEST, Selection};
use crate::search::one_by_one;
use crate::search::one_by_one::Named;
use crate::shipped::gallery;
use crate::sim::{FloatEnvironment, InstructionSet};
use crate::store::capacity::CapacityFile;
use crate::store::eval::EvalFile;
use crate::store::folder;
use crate::store::folder::IfExists;
use crate::store::names::RUN_JSON;
pub use args::Cli;
use args::{Command, DataCommand, DatasetArgs, EvalArgs, EvolveArgs, ReplayArgs, SimulateArgs};
use choice::{Runs, selected};
use clap::CommandFactory;
pub use process::{called, main};
use std::path::{Path, PathBuf};

/// Runs a command; the kind of an error sets the exit code.
pub(crate) fn run(cli: Cli, console: &Console, ranks: Ranks) -> Result<(), Error> {
    let _environment = FloatEnvironment::standard();
    InstructionSet::asked().map_err(|text| Error::usage(text).advice("or leave it unset"))?;
    threads::check_environment()?;
    if cli.quiet && cli.json {
        // clap finds the conflict only if both are on the same side of the command's name.
        return Err(Error::usage("--quiet: expected without --json".to_string()));
    }
    let is_shared = matches!(
        cli.command,
        Command::Evolve(_) | Command::Eval(_) | Command::Audit(_)
    );
    if ranks.size() > 1 && !is_shared {
        let text = "MPI: expected evolve, eval or audit: several processes can share only these";
        return Err(Error::usage(text.to_string()).advice("start it without mpirun"));
    }
    match cli.command {
        Command::Demo(args) => demo::run(args, console),
        Command::Evolve(args) => run_evolve(args, console, ranks),
        Command::Eval(args) => run_eval(args, console, ranks),
        Command::Response(args) => response::run(args, console),
        Command::Train(args) => train::run(args, console),
        Command::Team(args) => team::run(args, console),
        Command::Audit(args) => audit::run(args, console, ranks),
        Command::Capacity(args) => capacity::run(args, console),
        Command::Compare(args) => compare::run(args, console),
        Command::Report(args) => report::run(args, console),
        Command::Sweep(args) => sweep::run(args, console),
        Command::Reproduce(args) => reproduce::run(args, console),
        Command::Verify(args) => verify::run(args, console),
        Command::Replay(args) => run_replay(args, console),
        Command::Plot(args) => plot::run(args, console),
        Command::Simulate(args) => run_simulate(&args, console),
        Command::Serve(args) => serve::run(args, console),
        Command::Site(args) => site::run(&args, console),
        Command::Data { command } => run_data(command, console),
        Command::Gallery => published::gallery().map(|robots| summary::gallery(console, &robots)),
        Command::Config { name: None, .. } => {
            summary::configs(console, &[&config::BUILT_IN[..], &[PAPER_TOML]].concat());
            Ok(())
        }
        Command::Config {
            name: Some(name),
            set,
        } => {
            console.text(&printed_config(&name, &set)?);
            Ok(())
        }
        Command::Schema { name: None } => {
            summary::schemas(console, &schema::ALL.map(|schema| (schema.name, schema.of)));
            Ok(())
        }
        Command::Schema { name: Some(name) } => {
            console.text(&format!("{:#}\n", Schema::named(&name)?.json()));
            Ok(())
        }
        Command::Completions { shell } => {
            let mut text = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "morphcog", &mut text);
            console.text(&String::from_utf8_lossy(&text));
            Ok(())
        }
        Command::Bench { all } => {
            let sets: Vec<InstructionSet> = match all {
                true => InstructionSet::ALL
                    .into_iter()
                    .filter(|set| set.is_available())
                    .collect(),
                false => vec![InstructionSet::in_use()],
            };
            summary::speeds(console, &bench::table(&sets));
            Ok(())
        }
        Command::Man { out: Some(out) } => {
            let written = std::fs::create_dir_all(&out)
                .and_then(|()| clap_mangen::generate_to(Cli::command(), &out));
            written.map_err(|error| Error::writing(&out, &error))
        }
        Command::Man { out: None } => {
            let mut text = Vec::new();
            let page = clap_mangen::Man::new(Cli::command()).render(&mut text);
            page.map_err(|error| Error::other(error.to_string()))?;
            console.text(&String::from_utf8_lossy(&text));
            Ok(())
        }
    }
}

/// Threads, images and processes that the command line gives to a session.
#[derive(Clone)]
struct Resources {
    threads: Option<u16>,
    data: Option<PathBuf>,
    ranks: Ranks,
}

impl Resources {
    /// Returns the resources of one process.
    fn of(threads: Option<u16>, data: Option<PathBuf>) -> Self {
        Resources {
            threads,
            data,
            ranks: Ranks::ALONE,
        }
    }
}

/// Runs a command in a session that signals can stop and that reports to the terminal.
fn in_session<T>(
    console: &Console,
    with: Resources,
    work: impl FnOnce(&Session) -> Result<T, Error>,
) -> Result<T, Error> {
    reported(Reporter::new(console), with, work)
}

/// Runs a command in a session that signals can stop and that reports in this way.
fn reported<T>(
    reporter: Reporter,
    Resources {
        threads,
        data,
        ranks,
    }: Resources,
    work: impl FnOnce(&Session) -> Result<T, Error>,
) -> Result<T, Error> {
    let stop = signals::stop_flag()?;
    let session = Session::new(&stop, &reporter)
        .threads(threads.map(usize::from))
        .ranks(ranks)
        .data(data);
    work(&session)
}

/// Returns a config or plan as TOML. An empty file does not count: the shell has made it for
/// `morphcog config NAME > NAME`.
fn printed_config(name: &str, set: &[String]) -> Result<String, Error> {
    let is_empty = std::fs::metadata(name).is_ok_and(|file| file.is_file() && file.len() == 0);
    let built_in = config::BUILT_IN.iter().find(|(own, _)| *own == name);
    match built_in.filter(|_| is_empty) {
        Some((_, text)) => Ok(Config::parse(text, name, set)?.to_toml()),
        None if is_empty && name == PAPER_TOML.0 => {
            Ok(PaperPlan::parse(PAPER_TOML.1, name, set)?.to_toml())
        }
        None if PaperPlan::is_built_in(name) => Ok(PaperPlan::load(name, set)?.to_toml()),
        None => Ok(Config::load(name, set)?.to_toml()),
    }
}

fn run_evolve(args: EvolveArgs, console: &Console, ranks: Ranks) -> Result<(), Error> {
    let mut set = args.set;
    set.extend(args.seed.map(|seed| format!("seed={seed}")));
    set.extend(
        args.generations
            .map(|generations| format!("generations={generations}")),
    );
    let config = Config::load(&args.config, &set)?;
    let name = folder::name_of(&args.config);
    let out = args
        .out
        .unwrap_or_else(|| Path::new(folder::RUNS).join(format!("{name}-seed{}", config.seed)));
    let if_exists = match (args.resume, args.force) {
        (true, _) => IfExists::Resume,
        (_, true) => IfExists::Overwrite,
        _ => IfExists::Refuse,
    };
    let with = || Resources {
        ranks,
        ..Resources::of(args.threads, args.data.clone())
    };
    let options = evolve::EvolveOptions {
        config,
        name,
        out: out.clone(),
        if_exists,
    };
    let training = match args.train {
        true => Some(in_session(console, with(), |session| {
            train::after_evolution(&options, session)
        })?),
        false => None,
    };
    let finished = in_session(console, with(), |session| evolve::evolve(&options, session))?;
    summary::evolution(console, &finished, &out, training.is_some());
    if !finished.validated.is_empty() {
        summary::validation(console, &finished.validated);
    }
    if let Some(error) = finished.unwritten {
        return Err(error);
    }
    if finished.stopped {
        let done = finished.run.generations;
        let text = match done < finished.run.config.generations {
            true => format!("stopped after generation {done}; the run is saved"),
            false => "stopped while validating; the run is saved".to_string(),
        };
        return Err(Error::stopped(text).remedy(Remedy::RepeatResuming));
    }
    if finished.run.elites.is_empty() {
        return Ok(());
    }
    if let Some(training) = &training {
        train::trained(training, with(), console)?;
    }
    let out = training.map_or(out, |training| training.out);
    if args.replay && ranks.leads() {
        let shown = replay::ReplayOptions {
            data: args.data,
            ..replay::ReplayOptions::default()
        };
        replay_best(&out, shown, console, false)?;
    }
    Ok(())
}

/// Replays the best robot of a run into its folder, and returns the files. A brief replay says
/// nothing of them.
fn replay_best(
    folder: &Path,
    shown: replay::ReplayOptions,
    console: &Console,
    brief: bool,
) -> Result<Vec<PathBuf>, Error> {
    let (robot, archive) = (BEST.to_string(), Some(folder.join(RUN_JSON)));
    let options = replay::ReplayOptions {
        robot,
        archive,
        ..shown
    };
    let replay = replay::replay(&options, &NEVER)?;
    let formats = [Format::Gif, Format::Html];
    let wanted = pictures::PicturesWanted::beside(folder, &replay.name, &formats)?;
    match brief {
        true => pictures::write(console, &replay, &wanted, &NEVER),
        false => pictures::make(console, &replay, &wanted, &NEVER),
    }
}

fn run_eval(args: EvalArgs, console: &Console, ranks: Ranks) -> Result<(), Error> {
    let chosen = selected(args.robots)?.unwrap_or(Selection::All);
    let (archives, robots) = robots::archives(args.archives.paths(), chosen)?;
    choice::say_simulated(&archives, console);
    let beside = || folder::beside_all(&archives, eval::own_name(args.split));
    let out = args.out.unwrap_or_else(beside);
    let options = eval::EvalOptions {
        robots: robots.physical(args.physical_only),
        images: args.images,
        split: args.split,
        validation: args.validation.map(|images| images as usize),
        seed: args.seed,
        threshold: args.threshold,
        cycles: args.cycles,
        dataset: args.dataset,
        out,
        archives,
    };
    test(
        &options,
        Resources {
            ranks,
            ..Resources::of(args.threads, args.data)
        },
        console,
        false,
    )
    .map(drop)
}

/// Tests robots and returns the report. A brief test writes nothing to the terminal but its progress.
fn test(
    options: &eval::EvalOptions,
    with: Resources,
    console: &Console,
    brief: bool,
) -> Result<EvalFile, Error> {
    let reporter = Reporter::new(console).brief(brief);
    let eval::EvalOutcome {
        file: report,
        unwritten,
    } = reported(reporter, with, |session| eval::eval(options, session))?;
    if !brief {
        let capacity = CapacityFile::of(&report, &options.out);
        let written = unwritten.is_none().then_some(options.out.as_path());
        summary::evaluation(console, &report, capacity.as_ref(), written);
    }
    if let Some(error) = unwritten {
        return Err(error);
    }
    if report.stopped {
        let text = match report.robots.len() {
            0 => "stopped before the first robot; nothing is written".to_string(),
            robots => {
                format!(
                    "stopped after {}",
                    counted(robots, "robot; it is saved", "robots; those are saved")
                )
            }
        };
        return Err(Error::stopped(text));
    }
    Ok(report)
}

fn run_replay(args: ReplayArgs, console: &Console) -> Result<(), Error> {
    let ReplayArgs {
        physical_only,
        images,
        dataset,
        data,
        format,
        out,
        open,
        ..
    } = args;
    let (width, fps, look) = (args.width, args.fps, args.look);
    let every = args.every.map(usize::from);
    // Wrong file names and formats must be reported before the simulation starts.
    let named = out
        .as_deref()
        .map(|path| pictures::PicturesWanted::named(path, &format))
        .transpose()?;
    if args.side_by_side {
        let formats = named.as_ref().map(|named| named.formats());
        pictures::check_side_by_side(formats.as_deref().unwrap_or(&format))?;
    }
    // Without a run, it shows the best body that ships with the program.
    let is_bare = args.archive.is_none() && args.robot == Selection::Ids(vec![BEST.to_string()]);
    let is_first_look = is_bare && folder::newest_run().is_err();
    let archives = match is_first_look {
        true => vec![folder::first_run(PathBuf::from(gallery::ZERO_ONE)).map_err(Error::other)?],
        false => args.archive.map_or(Vec::new(), |Runs(paths)| paths),
    };
    let search = one_by_one::RobotChoice {
        robots: args.robot,
        archives,
        physical_only,
        seed: args.seed,
    };
    let Named { archive, robot } = the_one(&search, data.clone(), console)?;
    let folder = pictures::folder(&archive);
    let options = replay::ReplayOptions {
        robot,
        physical_only,
        archive: Some(archive),
        images,
        data,
        dataset,
    };
    if is_first_look {
        console.info(&format!(
            "no run under runs/: the best body of {}",
            gallery::ZERO_ONE
        ));
    }
    let is_any = options.dataset.is_none() && options.data.is_none() && options.images.is_empty();
    let stop = signals::stop_flag()?;
    let subject = match replay::subject(&options) {
        Err(error) if is_first_look && is_any && error.kind == ErrorKind::Input => {
            console.info(&format!(
                "{}; it sees the program's own digits instead",
                error.message
            ));
            replay::subject(&replay::ReplayOptions {
                dataset: Some(BUILTIN.to_string()),
                ..options
            })
        }
        subject => subject,
    }?;
    let wanted = match named {
        Some(named) => named,
        None => pictures::PicturesWanted::beside(&folder, &subject.found.name, &format)?,
    };
    let replay = replay::replay_subject(subject, &stop)?;
    let made = pictures::make(
        console,
        &replay,
        &pictures::PicturesWanted {
            width,
            every,
            fps,
            look,
            side_by_side: args.side_by_side,
            ..wanted
        },
        &stop,
    )?;
    match made.last().filter(|_| open) {
        Some(path) => show(path),
        None => Ok(()),
    }
}

fn show(path: &Path) -> Result<(), Error> {
    // The reason would name programs that the user never chose.
    open::that(path).map_err(|_| {
        let text = format!("{}: no program could be started to show it", path.display());
        Error::other(text).advice("the file is written: open it yourself")
    })
}

fn the_one(
    search: &one_by_one::RobotChoice,
    data: Option<PathBuf>,
    console: &Console,
) -> Result<Named, Error> {
    // If it is certain that there are several, no search is needed.
    let many = |these: String, first: &str| {
        let text = format!("--robot: expected one robot to watch, these are {these}");
        let error = Error::usage(text).advice(format!("name one, as in --robot {first}"));
        Err(error.advice("show several with morphcog plot or report"))
    };
    if let Some(count) = search.robots.validated().filter(|&count| count > 1) {
        return many(format!("up to {count} of each task"), "best-validation:1");
    }
    let found = choice::one_by_one(search, data, console)?;
    match found.as_slice() {
        [one] => Ok(one.clone()),
        several => {
            let names: Vec<&str> = several
                .iter()
                .take(5)
                .map(|named| named.robot.as_str())
                .collect();
            let more = if several.len() > names.len() {
                ", …"
            } else {
                ""
            };
            let these = format!("{} ({}{more})", several.len(), names.join(", "));
            many(these, names.first().copied().unwrap_or("best"))
        }
    }
}

fn run_simulate(args: &SimulateArgs, console: &Console) -> Result<(), Error> {
    let out = args.out.as_deref();
    let pictures = out.map(pictures::PicturesWanted::by_ending).transpose()?;
    if let Some(wanted) = pictures.flatten() {
        if args.points {
            let text = "expected only with a table, such as --out points.csv".to_string();
            return Err(Error::usage(text).about("points"));
        }
        let stop = signals::stop_flag()?;
        let scenario = simulate::Scenario::read(&args.scenario)?;
        let name = match args.scenario.file_stem() {
            Some(name) if args.scenario != Path::new("-") => name.to_string_lossy().into_owned(),
            _ => "scenario".to_string(),
        };
        let (replay, outcome) = simulate::record(&scenario, &name, &stop)?;
        let width = args.width;
        let made = pictures::write(
            console,
            &replay,
            &pictures::PicturesWanted { width, ..wanted },
            &stop,
        )?;
        made.iter()
            .for_each(|path| console.line_about(path, &format!("wrote {}", path.display())));
        return outcome;
    }
    if args.width.is_some() {
        let text = "expected only with a picture or film, such as --out walk.gif".to_string();
        return Err(Error::usage(text).about("width"));
    }
    match &args.out {
        Some(path) => simulate::to_file(
            &args.scenario,
            args.points,
            path,
            &Session::new(&*signals::stop_flag()?, &()),
        ),
        None => {
            let scenario = simulate::Scenario::read(&args.scenario)?;
            let written = |row: String| {
                console.text(&row);
                // Nobody reads the rest.
                if console.is_closed() {
                    Err(Error::other("the standard output is closed".to_string()))
                } else {
                    Ok(())
                }
            };
            // The console knows why it was closed, as does `main` if results were lost.
            simulate::simulate(&scenario, args.points, written).or_else(|error| {
                if console.is_closed() {
                    Ok(())
                } else {
                    Err(error)
                }
            })
        }
    }
}

fn run_data(command: DataCommand, console: &Console) -> Result<(), Error> {
    let given = |data: Option<&Path>| places(data, std::env::var_os("MORPHCOG_DATA"), None);
    match command {
        DataCommand::Import(args) => import::run(args, console)?,
        DataCommand::Fetch {
            dataset,
            to,
            mirror,
            force,
        } => {
            let catalogue =
                Catalogue::named(&dataset).map_err(|error| Error::usage(error.to_string()))?;
            let options = FetchOptions { to, mirror, force };
            let stop = signals::stop_flag()?;
            let fetched = fetch(
                &catalogue,
                &options,
                &Program::ALL,
                &Session::new(&stop, &Reporter::new(console)),
            );
            if matches!(fetched, Err(FetchError::Stopped(_))) {
                // Whole files stay, and there is nothing else to save.
                stop.end_process();
            }
            summary::fetched(console, &fetched?);
        }
        DataCommand::Info(DatasetArgs {
            dataset,
            data,
            transpose,
        }) => {
            let found = data::info(&dataset, &given(data.as_deref()), transpose);
            let mut found = found?;
            // A missing split is reported; an unusable one is an error.
            let is_there = |(_, problem): &(Split, DatasetError)| {
                !matches!(
                    problem,
                    DatasetError::Files(FilesError::Missing {
                        content: "images",
                        ..
                    })
                )
            };
            let broken = found
                .problems
                .iter()
                .position(is_there)
                .map(|place| found.problems.remove(place));
            summary::dataset(console, &found);
            if let Some((split, problem)) = broken {
                return Err(Error::input(format!("{split}: {problem}")));
            }
        }
        DataCommand::Sheet {
            dataset:
                DatasetArgs {
                    dataset,
                    data,
                    transpose,
                },
            samples,
            test,
            out,
        } => {
            if !out
                .extension()
                .is_some_and(|ending| ending.eq_ignore_ascii_case("png"))
            {
                let text = format!(
                    "--out {}: expected a file name that ends in .png",
                    out.display()
                );
                return Err(Error::usage(text));
            }
            let split = if test { Split::Test } else { Split::Train };
            let dataset = Dataset::oriented(&dataset, &given(data.as_deref()), &[split], transpose);
            let dataset = dataset?;
            if dataset.is_transposed() && transpose.is_none() {
                console.info(
                    "these files are EMNIST's, mirrored and turned: the images are transposed",
                );
            }
            let made = sheet::contact_sheet(&dataset, split, samples)
                .and_then(|sheet| sheet::write_png(&out, &sheet));
            made.map_err(|error| match error {
                SheetError::Size { .. } => Error::usage(format!("--samples: {error}")),
                SheetError::Write { file, source } => Error::writing(&file, &source),
                error => Error::other(error.to_string()),
            })?;
            console.line_about(&out, &format!("wrote {}", out.display()));
        }
    }
    Ok(())
}
