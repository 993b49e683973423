//! `morphcog eval`: tests robots on held-out images (paper, "Generalization test").

pub(crate) mod images;

use crate::base::error::Error;
use crate::base::observer::Work;
use crate::base::ranges::MOST;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::statistics::{bootstrap, standard_deviation};
use crate::base::text::counted;
use crate::commands::eval::images::{Draw, HeldOutImages};
use crate::config::validation::LEAST;
use crate::config::{Config, TaskConfig};
use crate::data::dataset::{Dataset, Split};
use crate::images::whereabouts::{
    Whereabouts, load_dataset_of, part_of_others, say_transposed, size_of,
};
use crate::robots;
use crate::robots::selection::{Chosen, Selection};
use crate::search::held_out_run::Trial;
use crate::search::held_out_run::{HeldOutRun, control_steps, task_of};
use crate::search::validation;
use crate::store::audit::{AuditFile, RobotAudit};
use crate::store::eval::{EvalFile, Mean, RobotReport};
use crate::store::folder::check_out;
use crate::store::images::{HeldOut, HowMany};
use crate::store::names::{EVAL_JSON, EVAL_VALIDATION_JSON};
use crate::store::results::{self, replaced, write_with_table};
use crate::store::run::{Robot, different};
use crate::store::stored_run::StoredRun;
use crate::store::unwritten::Unwritten;
use crate::store::validation::Validated;
use crate::task::grouping::Grouping;
use crate::task::protocol::MAX_STEPS;
use crate::task::stimulus::StimulusParams;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Options of an evaluation.
#[derive(Clone, Debug)]
pub struct EvalOptions {
    /// The run.json files, which may differ in seeds and windows only; none: the published robots.
    pub archives: Vec<PathBuf>,
    /// The robots to evaluate.
    pub robots: Selection,
    /// Number of images; `None`: 1000, or all test images if there are fewer.
    pub images: Option<HowMany>,
    /// Split of the images.
    pub split: HeldOut,
    /// Number of validation images to choose robots by; `None`: as the config says.
    pub validation: Option<usize>,
    /// Seed for drawing images, and robots with `random:N`.
    pub seed: u64,
    /// Displacements up to this count as wrong \[voxel lengths\].
    pub threshold: f64,
    /// Actuation cycles per image.
    pub cycles: u32,
    /// Another dataset than the runs' to take test images from.
    pub dataset: Option<String>,
    /// Path of the results (eval.json; eval.csv goes beside it).
    pub out: PathBuf,
}

impl EvalOptions {
    fn draw(&self, config: &Config) -> Draw {
        let images = self.validation.unwrap_or(config.validation.images);
        let choosing = self.robots.validated().map(|_| images);
        Draw {
            images: self.images,
            split: self.split,
            seed: self.seed,
            choosing,
        }
    }
}

/// Result of an evaluation.
#[derive(Clone, Debug)]
pub struct EvalOutcome {
    pub(crate) file: EvalFile,
    /// The error if the results could not be written, or only in part.
    pub unwritten: Option<Error>,
}

/// Evaluates robots and writes the results after each one, so that stopping keeps them. Results of
/// another test in the file stay, under another name.
///
/// # Errors
/// Returns an error if the archive, data or selection is wrong.
pub fn eval(options: &EvalOptions, session: &Session) -> Result<EvalOutcome, Error> {
    let opened = Opened::new(writable_sources(options)?, options, session)?;
    let Opened {
        sources,
        config,
        grouping,
        dataset,
        steps,
        ..
    } = &opened;
    opened.say_images(options, session);
    let robots = skilled(options.robots.of(sources, options.seed)?, grouping, session)?;
    let shown = HeldOutImages::draw(config, sources, dataset, options.draw(config))?;
    let mut report = opened.report(options, &shown);
    let tasks = robots
        .iter()
        .filter_map(|Chosen { robot, .. }| Some((robot.task.as_str(), task_of(grouping, robot)?)));
    report.baselines = shown.baselines(sources, tasks)?;
    let walker = || HeldOutRun::new(config, *steps, 0, session);
    let Some((robots, scores)) = opened.chosen(options, robots, session)? else {
        report.stopped = true;
        return Ok(EvalOutcome {
            file: report,
            unwritten: None,
        });
    };
    let (count, images) = (robots.len(), shown.images.len());
    let label = format!(
        "evaluating {} on {}:",
        counted(count, "robot", "robots"),
        counted(images, "image", "images")
    );
    let own_share = count.div_ceil(session.ranks.size());
    session
        .observer
        .begins(&Work::new(label, (own_share * images) as u64, "rollouts"));
    let testing = Testing {
        session,
        options,
        sources,
        grouping,
        shown: &shown,
    };
    let unwritten = testing.test(&robots, scores, &walker()?, &mut report)?;
    Ok(EvalOutcome {
        file: report,
        unwritten: unwritten.error(),
    })
}

/// Returns the results in the file if they are of this very test: same program version, runs,
/// robots, images, conditions and threshold. Fails as [`eval`] does.
pub(crate) fn known(options: &EvalOptions, session: &Session) -> Result<Option<EvalFile>, Error> {
    let Ok(known) = EvalFile::read(&options.out) else {
        return Ok(None);
    };
    let opened = Opened::new(writable_sources(options)?, options, session)?;
    let shown = HeldOutImages::draw(
        &opened.config,
        &opened.sources,
        &opened.dataset,
        options.draw(&opened.config),
    )?;
    let is_it = !known.stopped
        && known.head() == opened.report(options, &shown).head()
        && is_of_robots(&known, &opened.sources, options)?;
    Ok(is_it.then_some(known))
}

/// Evaluates robots without writing anything, and without baselines and means. Results of the same
/// images in the file are taken from there. Fails as [`eval`] does.
pub(crate) fn measure(options: &EvalOptions, session: &Session) -> Result<EvalFile, Error> {
    let opened = Opened::new(sources(options)?, options, session)?;
    let Opened {
        sources,
        config,
        grouping,
        dataset,
        steps,
        ..
    } = &opened;
    opened.say_images(options, session);
    let robots = skilled(options.robots.of(sources, options.seed)?, grouping, session)?;
    let shown = HeldOutImages::draw(config, sources, dataset, options.draw(config))?;
    let mut report = opened.report(options, &shown);
    report.stopped = true;
    let Some((robots, scores)) = opened.chosen(options, robots, session)? else {
        return Ok(report);
    };
    let is_same = |known: &EvalFile| {
        let selected = report.selected.clone();
        let (known, now) = (known.head(), report.head());
        EvalFile { selected, ..known } == now
    };
    let known = EvalFile::read(&options.out).ok().filter(is_same);
    let known = known.map_or(Vec::new(), |known| known.robots);
    let known = |run: usize, robot: &Robot| {
        let is_it = |known: &&RobotReport| {
            (known.run, &known.id, &known.task) == (run, &robot.id, &robot.task)
        };
        known.iter().find(is_it)
    };
    let open = robots
        .iter()
        .filter(|chosen| known(chosen.source, chosen.robot).is_none());
    let (open, images) = (open.count(), shown.images.len());
    if open > 0 {
        let run = &sources[0].run;
        let robots = counted(open, "robot", "robots");
        let (called, seed) = (run.called(), run.config.seed);
        let label = format!("evaluating {robots} of {called}, seed {seed}:");
        let work = Work::new(label, (open * images) as u64, "rollouts");
        session.observer.begins(&work);
    }
    let walker = HeldOutRun::new(config, *steps, 0, session)?;
    let mut scores = scores.into_iter();
    for Chosen { source, robot } in robots {
        let validation = scores.next();
        let tested = match known(source, robot) {
            Some(known) => known.clone(),
            None => {
                let run = &sources[source].run;
                let stimuli = shown.seen_by(&run.config)?;
                let Some((displacements, simulated)) = walker.rollouts(robot, &stimuli) else {
                    return Ok(report);
                };
                let trial = Trial {
                    run,
                    robot,
                    split: task_of(grouping, robot)
                        .expect("robots without a task are left out before"),
                    images: &shown.images,
                    threshold: options.threshold,
                };
                RobotReport::new(&trial, displacements, simulated)
            }
        };
        report.robots.push(RobotReport {
            run: source,
            validation,
            ..tested
        });
    }
    report.stopped = false;
    Ok(report)
}

pub(crate) fn settings(file: &EvalFile) -> [(&'static str, String); 8] {
    [
        ("robots", file.selected.clone()),
        ("dataset", file.dataset.clone()),
        ("split", file.split.to_string()),
        ("images", file.images.len().to_string()),
        ("seed", file.seed.to_string()),
        ("threshold", file.threshold.to_string()),
        ("control_steps", file.control_steps.to_string()),
        ("stopped", file.stopped.to_string()),
    ]
}

/// Returns the keys in which an evaluation differs from the options, with its value and theirs, as
/// far as known without images. `cycle_steps` are the control steps per actuation cycle.
pub(crate) fn differing(
    known: &EvalFile,
    options: &EvalOptions,
    cycle_steps: u32,
) -> Vec<(&'static str, String, String)> {
    let images = match options.images {
        Some(HowMany::Evenly(count)) => count,
        Some(HowMany::All) | None => known.images.len(),
    };
    let own = known
        .trained_on
        .as_ref()
        .map_or(&known.dataset, |own| &own.name);
    let asked = [
        options.robots.describe(),
        options.dataset.as_ref().unwrap_or(own).clone(),
        options.split.to_string(),
        images.to_string(),
        options.seed.to_string(),
        options.threshold.to_string(),
        options.cycles.saturating_mul(cycle_steps).to_string(),
        false.to_string(),
    ];
    let both = settings(known).into_iter().zip(asked);
    both.filter(|((_, there), asked)| there != asked)
        .map(|((key, there), asked)| (key, there, asked))
        .collect()
}

/// Returns true if its runs would yield the robots of an evaluation again, with the present
/// verdicts. Fails if robots cannot be chosen.
pub(crate) fn is_of_robots(
    known: &EvalFile,
    sources: &[StoredRun],
    options: &EvalOptions,
) -> Result<bool, Error> {
    let of_run = |run: usize| known.robots.iter().filter(move |robot| robot.run == run);
    if options.robots.validated().is_some() {
        // Validation images would choose the same robots again, if these are still physical.
        let wanted = |config: &Config| options.validation.unwrap_or(config.validation.images);
        for (number, source) in sources.iter().enumerate() {
            let images = wanted(&source.run.config);
            if of_run(number)
                .any(|robot| robot.validation.as_ref().is_none_or(|v| v.images != images))
            {
                return Ok(false);
            }
            if !matches!(options.robots, Selection::Physical(_)) {
                continue;
            }
            let audit = AuditFile::if_any(&source.run, &source.path)?;
            let is_physical = |robot: &RobotReport| {
                audit
                    .as_ref()
                    .and_then(|audit| audit.robot(&robot.id))
                    .is_some_and(RobotAudit::is_physical)
            };
            if !of_run(number).all(is_physical) {
                return Ok(false);
            }
        }
        return Ok(true);
    }
    let (_, grouping) = common_setting(sources)?;
    let chosen = options.robots.of(sources, options.seed)?;
    let chosen = chosen
        .iter()
        .filter(|chosen| task_of(&grouping, chosen.robot).is_some());
    let chosen = chosen.map(|chosen| (chosen.source, &chosen.robot.id));
    Ok(chosen.eq(known.robots.iter().map(|robot| (robot.run, &robot.id))))
}

/// Returns the config under which robots of several runs see images together, and all their tasks.
fn common_setting(sources: &[StoredRun]) -> Result<(Config, Grouping), Error> {
    // Trainings may have found different windows; the baselines use what all see together.
    let configs = || sources.iter().map(|source| &source.run.config);
    let config = Config::together(configs()).expect("there is a run");
    let task = TaskConfig::together(configs().map(|config| &config.task));
    let config = Config {
        task: task.expect("the tasks of all runs were compared"),
        ..config
    };
    let grouping = config.grouping()?;
    Ok((config, grouping))
}

/// Robots, and their results on validation images if these chose them.
type WithScores<'a> = (Vec<Chosen<'a>>, Vec<Validated>);

/// A test without its robots and images.
struct Opened<'o> {
    sources: Vec<StoredRun>,
    /// The config under which all robots see images together.
    config: Config,
    grouping: Grouping,
    wanted: Option<validation::Wanted>,
    whereabouts: Whereabouts,
    /// Another dataset than the runs', if requested.
    other: Option<&'o str>,
    /// That dataset, or the runs' own.
    dataset: Dataset,
    /// Control steps per image.
    steps: u32,
}

impl<'o> Opened<'o> {
    fn new(
        sources: Vec<StoredRun>,
        options: &'o EvalOptions,
        session: &Session,
    ) -> Result<Self, Error> {
        let threshold = options.threshold;
        if !(0.0..=MOST).contains(&threshold) {
            return Err(Error::argument(
                "threshold",
                threshold,
                "expected 0 or more voxel lengths",
            ));
        }
        let (config, grouping) = common_setting(&sources)?;
        let wanted = wanted(options, &config)?;
        let other = options
            .dataset
            .as_deref()
            .filter(|name| *name != config.data.dataset);
        if other.is_some() && options.split == HeldOut::Validation {
            let text =
                "expected with test images only: validation images are of the runs' own data";
            return Err(Error::usage(text.to_string()).about("dataset"));
        }
        let mut whereabouts = Whereabouts::given(session.data_folder());
        for archive in &options.archives {
            whereabouts = whereabouts.and_of(archive);
        }
        let own = |splits: &[Split]| own(&sources[0], &config, &whereabouts, splits);
        let dataset = match other {
            None if options.split == HeldOut::Validation => own(&[Split::Train])?,
            None => own(&Split::ALL)?,
            Some(name) => whereabouts.load(&config.data.of(name), &Split::ALL)?,
        };
        let steps = checked_steps(&config, options.cycles)?;
        Ok(Opened {
            sources,
            config,
            grouping,
            wanted,
            whereabouts,
            other,
            dataset,
            steps,
        })
    }

    fn own(&self, splits: &[Split]) -> Result<Dataset, Error> {
        own(&self.sources[0], &self.config, &self.whereabouts, splits)
    }

    /// Reports what is special about the images: transposed, or of another size than the runs'.
    fn say_images(&self, options: &EvalOptions, session: &Session) {
        let Opened {
            sources,
            config,
            dataset,
            ..
        } = self;
        if let Some(name) = self.other {
            say_transposed(dataset, &config.data.of(name), session);
        }
        let size = size_of(&sources[0].run.dataset, &config.data.dataset, dataset);
        let part = |source: &StoredRun| {
            part_of_others(&source.run.config, size, dataset, options.split.split())
        };
        if let Some(text) = sources.iter().find_map(part) {
            session.observer.warning(&text);
        }
    }

    /// Returns the robots to test: these, or the best of them on validation images with their
    /// results. `None` if stopped.
    fn chosen<'a>(
        &'a self,
        options: &EvalOptions,
        robots: Vec<Chosen<'a>>,
        session: &'a Session,
    ) -> Result<Option<WithScores<'a>>, Error> {
        let Opened {
            sources,
            config,
            grouping,
            dataset,
            ..
        } = self;
        let Some(wanted) = &self.wanted else {
            return Ok(Some((robots, Vec::new())));
        };
        // Indices identify validation images, and only in the run's own data.
        let others = self.other.map(|_| self.own(&[Split::Train])).transpose()?;
        let of_runs = others.as_ref().unwrap_or(dataset);
        let walker = || HeldOutRun::new(config, self.steps, 0, session);
        let selection = &options.robots;
        let best = validation::best_of_runs(
            sources, &robots, selection, of_runs, grouping, wanted, &walker,
        )?;
        let all_know = session.ranks.all(best.is_some());
        Ok(best
            .filter(|_| all_know)
            .map(|best| best.into_iter().unzip()))
    }

    /// Returns the report as it is before the first robot.
    fn report(&self, options: &EvalOptions, shown: &HeldOutImages) -> EvalFile {
        let Opened {
            sources,
            config,
            other,
            dataset,
            steps,
            ..
        } = self;
        let asked = (
            options.robots.describe(),
            options.split,
            options.seed,
            options.threshold,
        );
        let test_sha256 = dataset.fingerprint(Split::Test);
        let mut report =
            EvalFile::new((sources, config), asked, *steps, &shown.images, test_sha256);
        if let Some(name) = other {
            report.transfer(name, dataset);
        }
        report
    }
}

/// Loads the data that the runs of a test share.
fn own(
    run: &StoredRun,
    config: &Config,
    whereabouts: &Whereabouts,
    splits: &[Split],
) -> Result<Dataset, Error> {
    load_dataset_of(Some(&run.run.dataset), config, whereabouts, splits).map_err(|error| {
        let named = if error.remedies.is_empty() {
            error.remedy(Remedy::NameData)
        } else {
            error
        };
        named.remedy(Remedy::ShowOtherDataset)
    })
}

/// The parts of a test that all robots share.
struct Testing<'a> {
    session: &'a Session<'a>,
    options: &'a EvalOptions,
    sources: &'a [StoredRun],
    grouping: &'a Grouping,
    shown: &'a HeldOutImages<'a>,
}

impl Testing<'_> {
    /// Tests robots, one per process at a time, and writes the report after each round. `scores`
    /// are theirs on validation images, if these chose them. Returns the outcome of writing.
    fn test(
        &self,
        robots: &[Chosen],
        scores: Vec<Validated>,
        walker: &HeldOutRun,
        report: &mut EvalFile,
    ) -> Result<Unwritten, Error> {
        let Testing {
            session,
            options,
            sources,
            grouping,
            shown,
        } = self;
        let (ranks, threshold) = (session.ranks, &options.threshold);
        let mut scores = scores.into_iter();
        let mut left = robots.len();
        report.stopped = left > 0;
        let mut unwritten = Unwritten::default();
        for robots in robots.chunks(ranks.size()) {
            let own = match robots.get(ranks.rank()) {
                None => None,
                Some(Chosen { source, robot }) => {
                    let stimuli = shown.seen_by(&sources[*source].run.config)?;
                    walker.rollouts(robot, &stimuli)
                }
            };
            let before = report.robots.len();
            let mut is_stopped = false;
            for (Chosen { source, robot }, walked) in robots.iter().zip(ranks.share(own)) {
                let Some((displacements, simulated)) = walked else {
                    is_stopped = true;
                    break;
                };
                let split =
                    task_of(grouping, robot).expect("robots without a task are left out before");
                left -= 1;
                report.stopped = left > 0;
                let run = &sources[*source].run;
                let trial = Trial {
                    run,
                    robot,
                    split,
                    images: &shown.images,
                    threshold: *threshold,
                };
                let (validation, of_trial) = (
                    scores.next(),
                    RobotReport::new(&trial, displacements, simulated),
                );
                report.robots.push(RobotReport {
                    run: *source,
                    validation,
                    ..of_trial
                });
                report.means = means(&report.robots);
            }
            if ranks.leads() && report.robots.len() > before {
                let written =
                    make_room(options, report, session).and_then(|()| write(options, report));
                unwritten.tried(written, session)?;
            }
            if is_stopped {
                break;
            }
        }
        Ok(unwritten)
    }
}

/// Reads the runs; checks that they can be tested together and the results written.
fn writable_sources(options: &EvalOptions) -> Result<Vec<StoredRun>, Error> {
    let sources = sources(options)?;
    for source in &sources {
        check_out(&options.out, &source.path, own_name(options.split))?;
    }
    replaced::<EvalFile>(&options.out)?;
    Ok(sources)
}

/// Reads the runs; checks that they can be tested together.
fn sources(options: &EvalOptions) -> Result<Vec<StoredRun>, Error> {
    let sources: Vec<StoredRun> = options
        .archives
        .iter()
        .map(|path| robots::open(path))
        .collect::<Result<_, _>>()?;
    for source in &sources {
        source.has_task()?;
        same_setting(&sources[0], source)?;
    }
    different(
        sources
            .iter()
            .map(|source| (source.path.as_path(), &source.run)),
    )?;
    Ok(sources)
}

/// Returns how to choose robots by validation images, if requested; the same threshold applies.
fn wanted(options: &EvalOptions, config: &Config) -> Result<Option<validation::Wanted>, Error> {
    let Some(count) = options.robots.validated() else {
        return match options.validation {
            None => Ok(None),
            Some(_) => {
                let text = "expected with robots best-validation:N: only those are so chosen";
                Err(Error::usage(text.to_string()).about("validation"))
            }
        };
    };
    let images = options.validation.unwrap_or(config.validation.images);
    if images < LEAST {
        return Err(Error::argument(
            "validation",
            images,
            format!("expected {LEAST} or more images"),
        ));
    }
    let argument = options.validation.map(|_| "validation");
    Ok(Some(validation::Wanted {
        count,
        images,
        argument,
        threshold: options.threshold,
    }))
}

/// Returns the robots that have a task, and warns about the others.
fn skilled<'a>(
    robots: Vec<Chosen<'a>>,
    grouping: &Grouping,
    session: &Session,
) -> Result<Vec<Chosen<'a>>, Error> {
    let (robots, unskilled): (Vec<Chosen>, Vec<Chosen>) = robots
        .into_iter()
        .partition(|chosen| task_of(grouping, chosen.robot).is_some());
    if robots.is_empty() {
        let text =
            "there is no robot to evaluate: those selected walk the same way for every class";
        return Err(Error::input(text.to_string()));
    }
    if let Some(chosen) = unskilled.first() {
        let count = counted(unskilled.len(), "robot that walks", "robots that walk");
        let id = &chosen.robot.id;
        session.observer.warning(&format!(
            "left out: {count} the same way for every class ({id} …)"
        ));
    }
    Ok(robots)
}

/// Averages robots by task.
fn means(robots: &[RobotReport]) -> BTreeMap<String, Mean> {
    let mut by_task = BTreeMap::<&str, Vec<&RobotReport>>::new();
    robots
        .iter()
        .for_each(|robot| by_task.entry(&robot.task).or_default().push(robot));
    let mean = |robots: &[&RobotReport], of: fn(&RobotReport) -> f64| {
        robots.iter().map(|robot| of(robot)).sum::<f64>() / robots.len() as f64
    };
    let means = by_task.into_iter().map(|(task, robots)| {
        let (accuracy, balanced_accuracy) = (
            mean(&robots, |r| r.accuracy),
            mean(&robots, |r| r.balanced_accuracy),
        );
        let accuracies: Vec<f64> = robots.iter().map(|robot| robot.accuracy).collect();
        let mut by_run = BTreeMap::<usize, Vec<f64>>::new();
        robots
            .iter()
            .for_each(|robot| by_run.entry(robot.run).or_default().push(robot.accuracy));
        let by_run: Vec<Vec<f64>> = by_run.into_values().collect();
        let (standard_deviation, interval) = (standard_deviation(&accuracies), bootstrap(&by_run));
        let robots = robots.len();
        (
            task.to_string(),
            Mean {
                robots,
                accuracy,
                balanced_accuracy,
                standard_deviation,
                interval,
            },
        )
    });
    means.collect()
}

/// Returns the default file name of the results beside a run.json.
pub fn own_name(split: HeldOut) -> &'static str {
    match split {
        HeldOut::Test => EVAL_JSON,
        HeldOut::Validation => EVAL_VALIDATION_JSON,
    }
}

/// Checks that robots of two runs can be tested together, on the same images in the same world.
/// Their windows and their groups of the classes may differ.
fn same_setting(first: &StoredRun, other: &StoredRun) -> Result<(), Error> {
    let (a, b) = (&first.run.config, &other.run.config);
    let of_data = |config: &Config| (config.data.dataset.clone(), config.data.builtin.clone());
    let differing = [
        ("task", TaskConfig::together([&a.task, &b.task]).is_none()),
        ("body", a.body != b.body),
        (
            "stimulus",
            StimulusParams {
                margin: b.stimulus.margin,
                ..a.stimulus
            } != b.stimulus,
        ),
        ("protocol", a.protocol != b.protocol),
        ("physics", a.physics != b.physics),
        (
            "data",
            of_data(a) != of_data(b) || first.run.dataset != other.run.dataset,
        ),
    ];
    match differing.into_iter().find(|(_, differs)| *differs) {
        None => Ok(()),
        Some((section, _)) => {
            let (other, first) = (other.path.display(), first.path.display());
            let but = if section == "stimulus" {
                ", but for margin,"
            } else {
                ""
            };
            let text =
                format!("{other}: expected the same [{section}]{but} in its config as {first}");
            Err(Error::input(text).advice("evaluate runs of different experiments one by one"))
        }
    }
}

/// Sets results of another test aside, if the file has any.
fn make_room(options: &EvalOptions, report: &EvalFile, session: &Session) -> Result<(), Error> {
    let validated = |file: &EvalFile| file.robots.first()?.validation.as_ref().map(|of| of.images);
    let is_same =
        |known: EvalFile| known.head() == report.head() && validated(&known) == validated(report);
    results::make_room(
        &options.out,
        || EvalFile::read(&options.out).is_ok_and(is_same),
        session,
    )
}

fn write(options: &EvalOptions, report: &EvalFile) -> Result<(), Error> {
    write_with_table(&options.out, &report.to_json(), &report.to_csv(), [])
}

/// Returns the control steps of so many cycles, or an error if they exceed [`MAX_STEPS`].
fn checked_steps(config: &Config, cycles: u32) -> Result<u32, Error> {
    let steps = control_steps(config, cycles);
    match steps <= MAX_STEPS {
        true => Ok(steps),
        false => {
            let most = MAX_STEPS / config.physics.cycle_steps;
            Err(Error::argument(
                "cycles",
                cycles,
                format!("expected at most {most}, {MAX_STEPS} control steps"),
            ))
        }
    }
}
