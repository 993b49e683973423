//! `morphcog team`: robots of several runs, each for two groups, classify images together.

use crate::analysis::votes::{Ballot, CLIP};
use crate::base::Grid;
use crate::base::error::Error;
use crate::base::observer::Work;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::text::{counted, duration};
use crate::baseline::linear::{LabelledPixels, Linear, PixelMoments};
use crate::baseline::nearest::nearest;
use crate::commands::eval::images::chosen_by;
use crate::config::Config;
use crate::data::dataset::{Dataset, Split};
use crate::images::held_out::{images_besides, test_images, usual};
use crate::images::whereabouts::{
    Whereabouts, load_dataset_of, part_of_others, stimuli_of, stimulus_of,
};
use crate::robots;
use crate::robots::selection::{BEST, Chosen, Selection, VALIDATED};
use crate::search::held_out_run::Trial;
use crate::search::held_out_run::{CYCLES, HeldOutRun, control_steps, task_of};
use crate::store::folder::check_out;
use crate::store::images::{HeldOut, HowMany, ImageRef};
use crate::store::names::{TEAM_JSON, TEAM_VALIDATION_JSON};
use crate::store::results::{self, replaced};
use crate::store::run::different;
use crate::store::stored_run::StoredRun;
use crate::store::team::{Accuracy, Walk};
use crate::store::team::{FORMAT, FORMAT_VERSION, Member, TeamBaselines, TeamFile};
use crate::store::unwritten::Unwritten;
use crate::store::validation::most_images as shown_for_validation;
use crate::task::answer::Readout;
use crate::task::answer::THRESHOLD;
use crate::task::class_names::ClassNames;
use crate::task::fitness::Group;
use crate::task::grouping::{self};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Fewest images of a block: each robot walks under all of a block before the next begins.
const BLOCK: usize = 20;

/// Fewest images of a block for each thread: two packs of rollouts that are simulated together.
const PER_THREAD: usize = 16;

/// Time between two writes of an unfinished test.
const WRITE_EVERY: Duration = Duration::from_secs(10);

/// Seconds from which a test is said to be long.
const LONG: f64 = 20.0;

/// The runs of a team, and its test.
#[derive(Clone, Debug)]
pub struct TeamOptions {
    /// The run.json files.
    pub archives: Vec<PathBuf>,
    /// Their robots. Ids are looked up in all runs together; other selections apply to each run.
    pub robots: Selection,
    /// Classes to tell apart, by name or number; `None`: all of the dataset.
    pub classes: Option<Vec<String>>,
    /// Number of images; `None`: [`usual`].
    pub images: Option<HowMany>,
    /// The images: test, or validation.
    pub split: HeldOut,
    /// Seed for drawing images, and robots with `random:N`.
    pub seed: u64,
    /// Path of the results (team.json; team.csv goes beside it).
    pub out: PathBuf,
}

/// The result of a test.
#[derive(Clone, Debug)]
pub struct TeamOutcome {
    /// The results, as written to `team.json`.
    pub file: TeamFile,
    /// Error that kept the results from being written.
    pub unwritten: Option<Error>,
}

/// Tests a team on images, block by block. Writes the file every few seconds and when stopped; the
/// same command goes on from there.
///
/// # Errors
/// Returns an error if an option, a run or the data are unsuitable.
pub fn team(options: &TeamOptions, session: &Session) -> Result<TeamOutcome, Error> {
    let archives = options.archives.iter();
    let sources = archives
        .map(|path| robots::open(path))
        .collect::<Result<Vec<StoredRun>, Error>>()?;
    let Some(first) = sources.first() else {
        let text = "expected the runs whose robots are the team";
        return Err(Error::input(text.to_string()).about("archive"));
    };
    for source in &sources {
        source.has_task()?;
        check_out(&options.out, &source.path, own_name(options.split))?;
        same_data(first, source)?;
    }
    different(
        sources
            .iter()
            .map(|source| (source.path.as_path(), &source.run)),
    )?;
    let robots = chosen(options, &sources)?;
    let mut whereabouts = Whereabouts::given(session.data_folder());
    for archive in &options.archives {
        whereabouts = whereabouts.and_of(archive);
    }
    let config = &first.run.config;
    let dataset = load_dataset_of(Some(&first.run.dataset), config, &whereabouts, &Split::ALL)?;
    let (size, split) = (dataset.size(Split::Train), options.split.split());
    let said = sources
        .iter()
        .find_map(|other| part_of_others(&other.run.config, size, &dataset, split));
    said.iter().for_each(|text| session.observer.warning(text));
    let classes = classes(options, &dataset)?;
    let splits = robots
        .iter()
        .map(|chosen| split_of(&sources[chosen.source], chosen));
    let splits = splits.collect::<Result<Vec<grouping::ClassSplit>, Error>>()?;
    let (robots, splits) = within(&classes, robots, splits, session);
    covered(&splits, &classes, dataset.class_names())?;
    let how_many = options
        .images
        .unwrap_or_else(|| usual(options.split, &classes, &dataset));
    let images = match options.split {
        HeldOut::Test => test_images(&classes, &dataset, how_many, options.seed)?,
        HeldOut::Validation => validation_images(how_many, &sources, &classes, &dataset)?,
    };
    let mut file = TeamFile {
        format: FORMAT.to_string(),
        format_version: FORMAT_VERSION,
        program_version: env!("CARGO_PKG_VERSION").to_string(),
        classes,
        class_names: dataset.class_names().all().to_vec(),
        dataset: dataset.name().to_string(),
        test_sha256: dataset
            .fingerprint(Split::Test)
            .expect("both splits are loaded"),
        split: options.split,
        seed: options.seed,
        threshold: THRESHOLD,
        clip: CLIP,
        cycles: CYCLES,
        images,
        members: Vec::new(),
        size: robots.len(),
        answers: None,
        baselines: None,
    };
    let images = file.images.clone();
    let hashes: Vec<String> = sources
        .iter()
        .map(|source| source.run.fingerprint())
        .collect();
    // Known members stay in the file from the beginning, in the team's order.
    let known = known(options, &file)?;
    let walks = robots.iter().map(|chosen| {
        let is_it = |member: &&Member| {
            (&member.id, &member.run_sha256) == (&chosen.robot.id, &hashes[chosen.source])
        };
        known
            .iter()
            .find(is_it)
            .map_or_else(|| vec![None; images.len()], Member::walks)
    });
    let mut walks: Vec<Vec<Walk>> = walks.collect();
    let is_ours = |member: &Member| {
        robots.iter().any(|chosen| {
            (&member.id, &member.run_sha256) == (&chosen.robot.id, &hashes[chosen.source])
        })
    };
    let mut done = walks.iter().flatten().flatten().count() as u64;
    let total = (robots.len() * images.len()) as u64;
    let kept = match done {
        0 => String::new(),
        done => format!(" ({done} of {total} walks known from before)"),
    };
    let label = format!(
        "showing {} to {}{kept}:",
        counted(images.len(), "image", "images"),
        counted(robots.len(), "robot", "robots")
    );
    let work = Work::new(label, total, "rollouts");
    session.observer.begins(&Work {
        known: done,
        ..work
    });
    let (pool, mut unwritten) = (session.pool()?, Unwritten::default());
    let members = |walks: &[Vec<Walk>]| -> Vec<Member> {
        let of = robots.iter().zip(&splits).zip(walks);
        of.filter_map(|((chosen, split), walks)| {
            let trial = Trial {
                run: &sources[chosen.source].run,
                robot: chosen.robot,
                split,
                images: &images,
                threshold: THRESHOLD,
            };
            Member::of(&trial, &hashes[chosen.source], walks)
        })
        .collect()
    };
    let block = BLOCK.max(PER_THREAD * pool.current_num_threads());
    let mut written = Instant::now();
    let mut cost = Some((Instant::now(), done));
    let mut stopped = false;
    'test: for block in in_turn(&images, &file.classes).chunks(block) {
        for (chosen, walks) in robots.iter().zip(&mut walks) {
            let missing: Vec<usize> = block
                .iter()
                .copied()
                .filter(|place| walks[*place].is_none())
                .collect();
            if missing.is_empty() {
                continue;
            }
            let shown: Vec<ImageRef> = missing.iter().map(|place| images[*place]).collect();
            let config = &sources[chosen.source].run.config;
            let stimuli = stimuli_of(config, &dataset, split, &shown)?;
            let walker = HeldOutRun::new(config, control_steps(config, CYCLES), done, session)?;
            let (displacements, ended) = walker.rollouts_so_far(chosen.robot, &stimuli);
            done += displacements.len() as u64;
            for (place, walk) in missing.iter().zip(displacements) {
                walks[*place] = Some(walk);
            }
            if ended.is_err() {
                stopped = true;
                break 'test;
            }
            if let Some((began, before)) = cost.take() {
                say_cost(began.elapsed(), done - before, total - done, session);
            }
        }
        if written.elapsed() >= WRITE_EVERY {
            file.members = members(&walks);
            unwritten.tried(write(options, &file, is_ours, session), session)?;
            written = Instant::now();
        }
    }
    file.members = members(&walks);
    if stopped {
        if !file.members.is_empty() {
            unwritten.tried(write(options, &file, is_ours, session), session)?;
        }
        return Ok(TeamOutcome {
            file,
            unwritten: unwritten.error(),
        });
    }
    file.baselines =
        pool.install(|| baselines(&file, (&sources, &robots, &splits), &dataset, split))?;
    file.answers = Some(file.decided());
    unwritten.tried(write(options, &file, is_ours, session), session)?;
    Ok(TeamOutcome {
        file,
        unwritten: unwritten.error(),
    })
}

/// Returns the places of images so that classes take turns: a part of the test is a test, too.
fn in_turn(images: &[ImageRef], classes: &[u8]) -> Vec<usize> {
    let mut seen = vec![0_usize; classes.len()];
    let mut places: Vec<(usize, usize, usize)> = Vec::new();
    for (place, image) in images.iter().enumerate() {
        let class = classes
            .iter()
            .position(|class| *class == image.label)
            .expect("the images are drawn from these classes");
        places.push((seen[class], class, place));
        seen[class] += 1;
    }
    places.sort_unstable();
    places.into_iter().map(|(.., place)| place).collect()
}

/// Says how long the test will take, judged by its first walks, if that is longer than a moment.
fn say_cost(took: Duration, walks: u64, left: u64, session: &Session) {
    let seconds = took.as_secs_f64() * left as f64 / walks.max(1) as f64;
    if seconds >= LONG {
        session.observer.note(&format!(
            "{left} walks are left, which will take about {}",
            duration(seconds)
        ));
    }
}

fn same_data(first: &StoredRun, other: &StoredRun) -> Result<(), Error> {
    let (a, b) = (&first.run, &other.run);
    if a.dataset == b.dataset && a.config.data.builtin == b.config.data.builtin {
        return Ok(());
    }
    let (path, first) = (other.path.display(), first.path.display());
    let text = format!(
        "{path}: expected robots of the same data ({}) as in {first}",
        a.dataset.name
    );
    Err(Error::input(text).advice(format!("these are of {}: leave them out", b.dataset.name)))
}

/// Returns the robots of the team: ids from all runs together, other selections from each run.
fn chosen<'a>(options: &TeamOptions, sources: &'a [StoredRun]) -> Result<Vec<Chosen<'a>>, Error> {
    if options.robots.validated().is_some() {
        let text = "expected another selection: a team does not choose by images";
        return Err(Error::argument("robots", VALIDATED, text)
            .advice("best is the first on validation images of a run that ranked its robots"));
    }
    if matches!(&options.robots, Selection::Ids(ids) if !ids.iter().any(|id| id == BEST)) {
        return options.robots.of(sources, options.seed);
    }
    let mut all = Vec::new();
    for (number, source) in sources.iter().enumerate() {
        let of_one = options
            .robots
            .of(std::slice::from_ref(source), options.seed);
        let of_one = of_one.map_err(|error| error.in_place(&source.path.display().to_string()))?;
        all.extend(of_one.into_iter().map(|chosen| Chosen {
            source: number,
            ..chosen
        }));
    }
    Ok(all)
}

fn classes(options: &TeamOptions, dataset: &Dataset) -> Result<Vec<u8>, Error> {
    let classes = dataset.chosen(options.classes.as_deref())?;
    if let Some(asked) = options
        .images
        .filter(|asked| !asked.has_each(classes.len()))
    {
        let least = classes.len();
        return Err(Error::argument(
            "images",
            asked,
            format!("expected {least} or more, one of each class"),
        ));
    }
    Ok(classes)
}

/// Returns the default file name of results on these images.
pub fn own_name(split: HeldOut) -> &'static str {
    match split {
        HeldOut::Test => TEAM_JSON,
        HeldOut::Validation => TEAM_VALIDATION_JSON,
    }
}

fn split_of(source: &StoredRun, chosen: &Chosen) -> Result<grouping::ClassSplit, Error> {
    let grouping = source.run.config.grouping()?;
    let text = || {
        format!(
            "{}: robot {} walks the same way for every class",
            source.path.display(),
            chosen.robot.id
        )
    };
    let of_robot = task_of(&grouping, chosen.robot).cloned();
    of_robot.ok_or_else(|| Error::input(text()).remedy(Remedy::ChooseRobots(None)))
}

/// Leaves out robots that know a class outside of the team's: their votes would be for none of it.
fn within<'a>(
    classes: &[u8],
    robots: Vec<Chosen<'a>>,
    splits: Vec<grouping::ClassSplit>,
    session: &Session,
) -> (Vec<Chosen<'a>>, Vec<grouping::ClassSplit>) {
    let is_within = |split: &grouping::ClassSplit| {
        let all = [Group::A, Group::B].into_iter();
        all.flat_map(|group| split.classes(group))
            .all(|class| classes.contains(class))
    };
    let all = robots.len();
    let both = robots.into_iter().zip(splits);
    let (robots, splits): (Vec<Chosen>, Vec<_>) =
        both.filter(|(_, split)| is_within(split)).unzip();
    if robots.len() < all {
        let left_out = all - robots.len();
        session.observer.note(&format!(
            "left out: {} other classes",
            counted(left_out, "robot that knows", "robots that know")
        ));
    }
    (robots, splits)
}

/// Checks that every class has a robot.
fn covered(
    splits: &[grouping::ClassSplit],
    classes: &[u8],
    names: &ClassNames,
) -> Result<(), Error> {
    let is_unknown = |class: &&u8| splits.iter().all(|split| split.group(**class).is_none());
    let missing: Vec<&u8> = classes.iter().filter(is_unknown).collect();
    match missing.is_empty() {
        true => Ok(()),
        false => {
            let missing = names.list(missing);
            let text = format!("no robot of the team knows class {missing}");
            Err(Error::input(text)
                .remedy(Remedy::AddRuns)
                .remedy(Remedy::NameClasses))
        }
    }
}

/// Draws images of the training split that no run was trained on and no robot was chosen by.
fn validation_images(
    how_many: HowMany,
    sources: &[StoredRun],
    classes: &[u8],
    dataset: &Dataset,
) -> Result<Vec<ImageRef>, Error> {
    let besides = chosen_by(sources, dataset, shown_for_validation)?;
    let runs: Vec<_> = sources.iter().map(|source| &source.run).collect();
    images_besides(&besides, &runs, classes, dataset, Some("images"), how_many)
}

/// Returns true if two tests use the same images in the same way, so that members carry over.
fn is_same(a: &TeamFile, b: &TeamFile) -> bool {
    let about = |file: &TeamFile| {
        let TeamFile {
            program_version,
            test_sha256,
            images,
            cycles,
            split,
            ..
        } = file;
        (
            program_version.clone(),
            test_sha256.clone(),
            images.clone(),
            *cycles,
            *split,
        )
    };
    about(a) == about(b)
}

/// Returns the members of an earlier test on the same images, stopped or with fewer robots. Fails
/// if its file cannot be read.
fn known(options: &TeamOptions, now: &TeamFile) -> Result<Vec<Member>, Error> {
    let earlier = replaced::<TeamFile>(&options.out)?.filter(|file| is_same(file, now));
    Ok(earlier.map_or(Vec::new(), |file| file.members))
}

/// Writes the results so far; sets those of another test in the file aside, and those of a team with
/// a member that this one lacks.
fn write(
    options: &TeamOptions,
    file: &TeamFile,
    is_ours: impl Fn(&Member) -> bool,
    session: &Session,
) -> Result<(), Error> {
    let is_same = || {
        TeamFile::read(&options.out)
            .is_ok_and(|known| is_same(&known, file) && known.members.iter().all(is_ours))
    };
    results::make_room(&options.out, is_same, session)?;
    file.write(&options.out)
}

/// Computes baselines without bodies on the same images, as all robots see them together; for a
/// pair of classes that a robot tells apart, as that robot sees them.
fn baselines(
    file: &TeamFile,
    (sources, robots, splits): (&[StoredRun], &[Chosen], &[grouping::ClassSplit]),
    dataset: &Dataset,
    split: Split,
) -> Result<Option<TeamBaselines>, Error> {
    let Some((place, best_body)) = file.best_body() else {
        return Ok(None);
    };
    let configs = robots
        .iter()
        .map(|chosen| &sources[chosen.source].run.config);
    let common = Config::together(configs).expect("every class of a team has a robot");
    let classes = &file.classes;
    let shown: BTreeSet<usize> = match split {
        Split::Test => BTreeSet::new(),
        Split::Train => file.images.iter().map(|image| image.index).collect(),
    };
    let training_of = |config: &Config, classes: &[u8]| {
        let indices = |class: u8| {
            dataset
                .indices_of(Split::Train, class)
                .iter()
                .map(move |index| (*index, class))
        };
        let besides = classes
            .iter()
            .flat_map(|class| indices(*class))
            .filter(|(index, _)| !shown.contains(index));
        let seen = |(index, class)| Ok((stimulus_of(config, dataset, Split::Train, index)?, class));
        besides
            .map(seen)
            .collect::<Result<Vec<(Grid<f64>, u8)>, Error>>()
    };
    let training = training_of(&common, classes)?;
    let known = labelled(&training);
    let stimuli = stimuli_of(&common, dataset, split, &file.images)?;
    let labels = || file.images.iter().map(|image| image.label);
    let moments = PixelMoments::new(&known);
    let against_rest = |class: &u8| {
        let rest: Vec<u8> = classes
            .iter()
            .copied()
            .filter(|other| other != class)
            .collect();
        moments.apart(&[*class], &rest)
    };
    let against_rest: Vec<Linear> = classes.iter().map(against_rest).collect();
    let largest = |stimulus: &Grid<f64>| {
        let values: Vec<f64> = against_rest
            .iter()
            .map(|linear| linear.value(stimulus))
            .collect();
        // Ties go to the first.
        let best = (1..values.len()).fold(0, |best, next| {
            if values[next] > values[best] {
                next
            } else {
                best
            }
        });
        classes[best]
    };
    let pair = |a: u8, b: u8| {
        // A positive value is a walk to the right.
        let judge = Readout {
            left: vec![b],
            right: vec![a],
        };
        let is_pair = |split: &grouping::ClassSplit| {
            let mut told = [Group::A, Group::B].map(|group| split.classes(group).to_vec());
            told.sort();
            told == [vec![a], vec![b]]
        };
        let robot = splits.iter().position(is_pair);
        let config = robot.map_or(&common, |robot| &sources[robots[robot].source].run.config);
        let seeing = |config: &Config| (config.stimulus, config.body.height, config.body.width);
        if seeing(config) == seeing(&common) {
            let linear = moments.apart(&[a], &[b]);
            return Ok((
                judge,
                stimuli
                    .iter()
                    .map(|stimulus| linear.value(stimulus))
                    .collect(),
            ));
        }
        let training = training_of(config, &[a, b])?;
        let linear = PixelMoments::new(&labelled(&training)).apart(&[a], &[b]);
        let value =
            |image: &ImageRef| Ok(linear.value(&stimulus_of(config, dataset, split, image.index)?));
        Ok((
            judge,
            file.images
                .iter()
                .map(value)
                .collect::<Result<_, Error>>()?,
        ))
    };
    let pairs = classes
        .iter()
        .enumerate()
        .flat_map(|(number, a)| classes[number + 1..].iter().map(|b| (*a, *b)));
    // The values of each pair's function, image by image.
    let pairs: Vec<(Readout, Vec<f64>)> = pairs
        .map(|(a, b)| pair(a, b))
        .collect::<Result<_, Error>>()?;
    let voted = |image: usize| {
        let walks = pairs
            .iter()
            .map(|(judge, values)| (judge, Some(values[image])));
        classes[Ballot::count(classes, walks, 0.0, 1.0).by_votes().0]
    };
    let nearest: Vec<Option<u8>> = stimuli
        .par_iter()
        .map(|stimulus| nearest(known.iter().copied(), stimulus))
        .collect();
    Ok(Some(TeamBaselines {
        training_images: known.len(),
        linear_one_against_rest: Accuracy::of(stimuli.iter().map(largest).zip(labels())),
        linear_pairs: Accuracy::of((0..stimuli.len()).map(voted).zip(labels())),
        nearest_neighbour: Accuracy::of(nearest.into_iter().zip(labels().map(Some))),
        best_body,
        best_body_id: file.members[place].id.clone(),
    }))
}

fn labelled(training: &[(Grid<f64>, u8)]) -> Vec<LabelledPixels<'_>> {
    training
        .iter()
        .map(|(stimulus, class)| (stimulus, *class))
        .collect()
}
