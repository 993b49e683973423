//! `morphcog response`: measures how far each soft voxel and sensor moves a robot, and estimates
//! the accuracy that training could reach.

use crate::base::error::{Error, ErrorKind};
use crate::base::files::alone_beside;
use crate::base::observer::Work;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::text::counted;
use crate::body::Body;
use crate::config::train::MOST_RANDOM_IMAGES;
use crate::config::{Config, DataConfig, MAX_NUMBER};
use crate::data::dataset::{Dataset, Split};
#[cfg(feature = "figures")]
use crate::draw::plot::{self, Style};
use crate::images::whereabouts::{Whereabouts, load_dataset_of, say_transposed};
use crate::response::gait::Gait;
use crate::response::probing;
use crate::response::probing::Probing;
use crate::response::regression::RandomRollout;
use crate::robots;
#[cfg(feature = "figures")]
use crate::robots::published;
use crate::robots::selection::Selection;
use crate::store::folder::{check_out, writable};
use crate::store::images::DatasetRef;
use crate::store::names::{FigureFormat, RESPONSE_JSON};
use crate::store::response::{
    EndedBy, FORMAT, FORMAT_VERSION, ResponseFile, ResponseSetting, RobotResponse, Unfinished,
    pictures,
};
use crate::store::results::replaced;
use crate::store::unwritten::Unwritten;
use crate::task::evaluation::fresh_rollouts_so_far;
use crate::task::perturbation::Condition;
use crate::task::protocol::{Protocol, RolloutMode};
use crate::training;
use crate::training::prediction::Predictor;
#[cfg(feature = "figures")]
use std::path::Path;
use std::path::PathBuf;

/// Rollouts between two checks of the slopes' error, and fewest of a robot: ten under each of six
/// conditions. Larger batches overshoot; smaller ones leave cores idle at their ends.
pub(crate) const BATCH: usize = 60;

/// The robots to measure, and the end of a measurement.
#[derive(Clone, Debug)]
pub struct ResponseOptions {
    /// The run.json.
    pub archive: PathBuf,
    /// The robots, by ids, their beginnings or "best".
    pub robots: Vec<String>,
    /// True if only robots count that an audit found physical.
    pub physical_only: bool,
    /// Two groups of classes, to estimate the accuracy that training could reach.
    pub task: Option<String>,
    /// Config keys that a training would change, as `stimulus.margin=5`; only with a task.
    pub set: Vec<String>,
    /// Most rollouts per robot.
    pub images: usize,
    /// Relative error of the slopes at which a measurement ends.
    pub error: f64,
    /// Seed of the random images; `None`: the run's, as in `train`.
    pub seed: Option<u64>,
    /// Path of the results (response.json; CSV and pictures go beside it).
    pub out: PathBuf,
}

/// The result of a measurement.
#[derive(Clone, Debug)]
pub struct ResponseOutcome {
    /// The results, as written to `response.json`.
    pub file: ResponseFile,
    /// The name of the run for people.
    pub(crate) called: String,
    /// Pictures of its robots, still to be drawn.
    pub(crate) pictures: Vec<[PathBuf; 3]>,
    /// True if it was stopped.
    pub stopped: bool,
    /// Error that kept the results from being written.
    pub unwritten: Option<Error>,
}

struct Subject {
    id: String,
    gait: Gait,
}

/// Robots, and the run they come from.
struct Provenance {
    config: Config,
    run: String,
    /// The name for people.
    called: String,
    sha256: String,
    dataset: DatasetRef,
    robots: Vec<(String, Body)>,
}

#[cfg(feature = "figures")]
impl ResponseOutcome {
    /// Draws the picture of each robot in all formats, and calls `drawn` with each file.
    ///
    /// # Errors
    /// Returns an error if a picture cannot be drawn or written.
    pub fn draw(&self, mut drawn: impl FnMut(&Path)) -> Result<(), Error> {
        for (robot, paths) in self.file.robots.iter().zip(&self.pictures) {
            let from = published::provenance(&self.called, self.file.run_seed);
            let of = format!("robot {}, {from}", robot.id);
            let task = self.file.setting.task.as_deref();
            plot::response(robot, task, &of, &Style::default()).write(paths)?;
            paths.iter().for_each(|path| drawn(path));
        }
        Ok(())
    }
}

/// Measures the responses of robots and writes the results after each one, so that stopping keeps
/// them. Leaves out robots that cannot be measured, with a warning, if others can.
///
/// # Errors
/// Returns an error if an option, the run or the data are unsuitable, or no robot can be measured.
pub fn measure(options: &ResponseOptions, session: &Session) -> Result<ResponseOutcome, Error> {
    let (found, none) = measure_any(options, session)?;
    match none {
        Some(error) => Err(error),
        None => Ok(found),
    }
}

/// Acts as [`measure`], but also returns the error if no robot can be measured.
pub(crate) fn measure_any(
    options: &ResponseOptions,
    session: &Session,
) -> Result<(ResponseOutcome, Option<Error>), Error> {
    check_numbers(options)?;
    let provenance = provenance(options)?;
    let config = &provenance.config;
    let mut subjects: Vec<Subject> = Vec::new();
    let mut refused: Vec<Error> = Vec::new();
    for (id, body) in &provenance.robots {
        match Gait::of(body) {
            Some(gait) => subjects.push(Subject {
                id: id.clone(),
                gait,
            }),
            None => refused.push(Error::input(format!(
                "robot {id}: it has neither soft voxels nor sensors, so no image can move it"
            ))),
        }
    }
    check_names(options, &subjects)?;
    let seed = options.seed.unwrap_or(config.seed);
    let task = task(options, &provenance, seed, session)?;
    let probing = Probing::new(&conditions(config, options.images), seed);
    let pool = session.pool()?;
    let run_seed = config.seed;
    let mut file = ResponseFile {
        format: FORMAT.to_string(),
        format_version: FORMAT_VERSION,
        program_version: env!("CARGO_PKG_VERSION").to_string(),
        run: provenance.run.clone(),
        run_seed,
        run_sha256: provenance.sha256.clone(),
        setting: setting(options, seed, config, &probing, task.as_ref())?,
        unfinished: Vec::new(),
        robots: Vec::new(),
    };
    let earlier = earlier(options, session)?;
    if let Some((path, before)) = earlier.iter().find(|(path, _)| *path == options.out)
        && before.run_sha256 == provenance.sha256
        && before.setting.seed != seed
    {
        let count = counted(
            before.robots.len(),
            "robot of this run is",
            "robots of this run are",
        );
        let text = format!(
            "{}: {count} measured with the random images of seed {}",
            path.display(),
            before.setting.seed
        );
        let error = Error::input(text).remedy(Remedy::ChooseOut);
        return Err(error.remedy(Remedy::MeasureWithSeed(before.setting.seed)));
    }
    let measuring = Measuring {
        options,
        config,
        probing,
        task,
        earlier,
        run_sha256: &provenance.sha256,
        seed,
        session,
    };
    let asked: Vec<&str> = subjects.iter().map(|subject| subject.id.as_str()).collect();
    let drawn = pictures(&options.out, &asked);
    if !subjects.is_empty() {
        let known: usize = subjects
            .iter()
            .map(|subject| measuring.known(&subject.gait).0.len())
            .sum();
        let kept = if known > 0 {
            format!(" ({known} rollouts known from before)")
        } else {
            String::new()
        };
        let label = format!(
            "measuring {}{kept}:",
            counted(subjects.len(), "robot", "robots")
        );
        session.observer.begins(&Work::new(
            label,
            (subjects.len() * options.images) as u64,
            "rollouts",
        ));
    }
    let mut unwritten = Unwritten::default();
    let mut stopped = false;
    for (number, subject) in subjects.iter().enumerate() {
        let mut displacements = Vec::new();
        let found = pool.install(|| {
            measuring.robot(subject, &mut displacements, &mut |rollouts, skipped| {
                session.observer.skips(skipped as u64);
                session
                    .observer
                    .progress((number * options.images + rollouts) as u64);
            })
        });
        match found {
            Ok(Some(found)) => file.robots.push(found),
            Ok(None) => refused.push(Error::input(format!(
                "robot {}: most of its rollouts with random images are unstable, so its response cannot be measured",
                subject.id
            ))),
            Err(error) if error.kind == ErrorKind::Stopped => {
                stopped = true;
                if !displacements.is_empty() {
                    let (id, body) = (subject.id.clone(), subject.gait.built(&subject.gait.design()));
                    file.unfinished.push(Unfinished { id, body, displacements });
                }
            }
            Err(error) => return Err(error),
        }
        if !file.robots.is_empty() || !file.unfinished.is_empty() {
            let is_new = |id: &str| file.robots.iter().any(|robot| robot.id == id);
            let outdated = asked.iter().zip(&drawn).filter(|(id, _)| is_new(id));
            let outdated: Vec<[PathBuf; 3]> = outdated.map(|(_, files)| files.clone()).collect();
            let written = alone_beside(&options.out, || {
                // Another process may have measured robots of this run meanwhile.
                let before = replaced::<ResponseFile>(&options.out)?;
                let whole = before.map_or_else(|| file.clone(), |b| file.with_others_of(&b));
                whole.write(&options.out, &outdated)
            });
            unwritten.tried(written, session)?;
        }
        if stopped {
            break;
        }
    }
    let none = (file.robots.is_empty() && !stopped).then(|| match refused.as_slice() {
        [one] => one.clone().remedy(Remedy::ChooseRobots(None)),
        several => {
            let text = format!(
                "none of the {} chosen robots can be measured: {}",
                several.len(),
                several[0]
            );
            Error::input(text).remedy(Remedy::ChooseRobots(None))
        }
    });
    if none.is_none() {
        let left_out = |error: &Error| session.observer.warning(&format!("{error}; left out"));
        refused.iter().for_each(left_out);
    }
    // Named by all that were asked for, so that a stop leaves no other names.
    let is_measured = |id: &str| file.robots.iter().any(|robot| robot.id == id);
    let pictures = asked
        .iter()
        .zip(drawn)
        .filter(|(id, _)| is_measured(id))
        .map(|(_, files)| files)
        .collect();
    let found = ResponseOutcome {
        called: provenance.called,
        pictures,
        file,
        stopped,
        unwritten: unwritten.error(),
    };
    Ok((found, none))
}

fn check_numbers(options: &ResponseOptions) -> Result<(), Error> {
    let ResponseOptions {
        images,
        error,
        seed,
        ..
    } = options;
    if !(BATCH..=MOST_RANDOM_IMAGES).contains(images) {
        let text = format!("expected {BATCH} to {MOST_RANDOM_IMAGES} random images");
        return Err(Error::argument("images", images, text).advice("with fewer, no slope is known"));
    }
    if !(0.0..1.0).contains(error) {
        return Err(Error::argument(
            "error",
            error,
            "expected 0 or more, and below 1",
        ));
    }
    if let Some(seed) = seed.filter(|seed| *seed > MAX_NUMBER) {
        return Err(Error::argument(
            "seed",
            seed,
            format!("expected at most {MAX_NUMBER}"),
        ));
    }
    Ok(())
}

/// Checks that results and pictures can be written, and overwrite nothing of a run.
fn check_names(options: &ResponseOptions, subjects: &[Subject]) -> Result<(), Error> {
    let out = &options.out;
    check_out(out, &options.archive, RESPONSE_JSON)?;
    if FigureFormat::beside(out).contains(out) {
        let text = "expected another ending: the picture beside the results has that name";
        return Err(Error::argument("out", out.display(), text));
    }
    let ids: Vec<&str> = subjects.iter().map(|subject| subject.id.as_str()).collect();
    pictures(out, &ids)
        .iter()
        .flatten()
        .try_for_each(|picture| writable(picture))
}

/// Returns the requested robots, each once, and their run.
fn provenance(options: &ResponseOptions) -> Result<Provenance, Error> {
    let path = &options.archive;
    let source = robots::open(path)?;
    let chosen = Selection::Ids(options.robots.clone()).physical(options.physical_only);
    let seed = options.seed.unwrap_or(source.run.config.seed);
    let chosen = chosen.of(std::slice::from_ref(&source), seed)?;
    let robots = chosen
        .iter()
        .map(|chosen| (chosen.robot.id.clone(), chosen.robot.body.clone()))
        .collect();
    let sha256 = source.run.fingerprint();
    let run = &source.run;
    Ok(Provenance {
        config: run.config.clone(),
        run: run.name.clone(),
        called: run.called().to_string(),
        sha256,
        dataset: run.dataset.clone(),
        robots,
    })
}

/// Returns the conditions of `train`, at most one per rollout.
fn conditions(config: &Config, rollouts: usize) -> Vec<Condition> {
    config
        .train
        .perturbations
        .conditions()
        .take(rollouts)
        .collect()
}

fn task(
    options: &ResponseOptions,
    provenance: &Provenance,
    seed: u64,
    session: &Session,
) -> Result<Option<Predictor>, Error> {
    let Some(text) = &options.task else {
        return Ok(None);
    };
    let whereabouts = Whereabouts::given(session.data_folder()).and_of(&options.archive);
    let groups = training::groups_of(text, &provenance.config, &options.set, &whereabouts)
        .map_err(|error| error.about("task"))?;
    let config = training::config_of(
        &provenance.config,
        groups.classes(),
        Some(seed),
        &options.set,
    )?;
    same_walks(&provenance.config, &config)?;
    let data = |config: &Config| {
        let DataConfig {
            dataset,
            dir,
            transpose,
            builtin,
            ..
        } = &config.data;
        (dataset.clone(), dir.clone(), *transpose, builtin.clone())
    };
    let of_run = Some(&provenance.dataset).filter(|_| data(&config) == data(&provenance.config));
    let dataset = load_dataset_of(of_run, &config, &whereabouts, &[Split::Train])?;
    training::check_groups(&groups, &dataset)?;
    say_transposed(&dataset, &config.data, session);
    let config = training::with_fitting_margin(
        config,
        &provenance.dataset,
        &provenance.config,
        &dataset,
        &options.set,
        session,
    );
    Predictor::new(config, dataset, &groups, seed).map(Some)
}

/// Checks that a training would simulate as the run did: the measurement holds for no other.
pub(crate) fn same_walks(of_run: &Config, training: &Config) -> Result<(), Error> {
    let steps = |config: &Config| Protocol {
        rollout: RolloutMode::Fresh,
        ..config.protocol.clone()
    };
    let differing = [
        ("physics", of_run.physics != training.physics),
        ("protocol", steps(of_run) != steps(training)),
        (
            "train.perturbations",
            of_run.train.perturbations != training.train.perturbations,
        ),
    ];
    match differing.into_iter().find(|(_, differs)| *differs) {
        None => Ok(()),
        Some((section, _)) => {
            let text = "expected keys that say what robots see";
            Err(Error::argument("set", section, text)
                .advice("rollouts are those of the run: no other can be measured here"))
        }
    }
}

fn reference(dataset: &Dataset) -> DatasetRef {
    let train_sha256 = dataset
        .fingerprint(Split::Train)
        .expect("its images were read just now");
    DatasetRef {
        name: dataset.name().to_string(),
        train_sha256,
    }
}

fn setting(
    options: &ResponseOptions,
    seed: u64,
    config: &Config,
    probing: &Probing,
    task: Option<&Predictor>,
) -> Result<ResponseSetting, Error> {
    Ok(ResponseSetting {
        seed,
        images: options.images,
        error: options.error,
        dataset: task.map(|task| reference(&task.dataset)),
        conditions: probing.conditions().to_vec(),
        control_steps: config.protocol.control_steps,
        task: task.map(|task| task.groups.to_string()),
        stimulus: task.map(|task| task.config.stimulus),
        windows: task.map_or(0, |task| task.config.train.windows),
    })
}

/// The parts of a measurement that all robots share.
struct Measuring<'a> {
    options: &'a ResponseOptions,
    config: &'a Config,
    probing: Probing,
    task: Option<Predictor>,
    earlier: Vec<(PathBuf, ResponseFile)>,
    run_sha256: &'a str,
    seed: u64,
    session: &'a Session<'a>,
}

/// Returns earlier results to reuse, from the results' file and from beside the run. Fails if the
/// results' file cannot be read.
fn earlier(
    options: &ResponseOptions,
    session: &Session,
) -> Result<Vec<(PathBuf, ResponseFile)>, Error> {
    let out = replaced(&options.out)?.map(|file| (options.out.clone(), file));
    let beside =
        Some(options.archive.with_file_name(RESPONSE_JSON)).filter(|beside| *beside != options.out);
    let beside =
        beside.and_then(|path| ResponseFile::found(&path, session).map(|file| (path, file)));
    Ok(beside.into_iter().chain(out).collect())
}

impl Measuring<'_> {
    /// Returns the known displacements of a gait under the first random images, and how many of
    /// them belong to a finished measurement.
    fn known(&self, gait: &Gait) -> (&[Option<f64>], usize) {
        let conditions = self.probing.conditions();
        let of_files = self
            .earlier
            .iter()
            .map(|(_, file)| file.known(self.run_sha256, self.seed, conditions, gait));
        // All begin with the same images.
        of_files.fold((&[], 0), |(known, ended), (other, other_ended)| {
            (
                if other.len() > known.len() {
                    other
                } else {
                    known
                },
                ended.max(other_ended),
            )
        })
    }

    /// Measures a robot's response; returns `None` if most of its rollouts are unstable.
    /// `displacements` gets those under the random images so far, even if stopped. `progress` gets
    /// the number of rollouts done, and how many since the last call were not simulated.
    fn robot(
        &self,
        Subject { id, gait }: &Subject,
        displacements: &mut Vec<Option<f64>>,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<Option<RobotResponse>, Error> {
        let Measuring {
            options,
            config,
            probing,
            session,
            ..
        } = self;
        let (known, ended) = self.known(gait);
        let mut shown: Vec<RandomRollout> = Vec::new();
        // The rollouts of a finished measurement cost nothing: they are taken whole, and first. A
        // stopped one is repeated batch by batch, as if it had never been stopped.
        let most = options.images.max(ended);
        let mut rollouts = 0;
        loop {
            let numbers = rollouts..most.min(ended.max(rollouts + BATCH));
            rollouts = numbers.end;
            let known = &known[numbers.start.min(known.len())..numbers.end.min(known.len())];
            shown.extend(probing.shown(
                gait,
                &config.physics,
                numbers,
                |probe, stimuli, conditions| {
                    let before = displacements.len();
                    displacements.extend(known);
                    let (rolled, _, ended) = fresh_rollouts_so_far(
                        probe,
                        &stimuli[known.len()..],
                        &conditions[known.len()..],
                        (&config.physics, &config.protocol),
                        &|_| (),
                        session,
                    );
                    displacements.extend(rolled.into_iter().map(Result::ok));
                    ended?;
                    Ok::<_, Error>(displacements[before..].to_vec())
                },
            )?);
            progress(
                rollouts.min(options.images),
                known.len().min(options.images),
            );
            session.check()?;
            let Some(response) = probing::response(&shown, rollouts) else {
                return Ok(None);
            };
            let ended_by = if response.relative_error() <= options.error {
                EndedBy::Error
            } else if rollouts == most {
                EndedBy::Images
            } else {
                continue;
            };
            progress(
                options.images,
                options.images - rollouts.min(options.images),
            );
            let taught = self
                .task
                .as_ref()
                .map(|task| task.taught(gait, &response, &shown, session))
                .transpose()?;
            let taught = taught.flatten();
            let displacements = std::mem::take(displacements);
            return Ok(Some(RobotResponse::new(
                id,
                gait,
                &response,
                displacements,
                ended_by,
                taught,
            )));
        }
    }
}
