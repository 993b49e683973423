//! `morphcog replay`: records a robot's rollout for pictures.

use crate::base::error::Error;
use crate::base::remedy::{Invocation, Remedy};
use crate::base::stop::Stopped;
use crate::body::Body;
use crate::config::{Config, DataConfig};
use crate::data::dataset::Split;
use crate::images::training::TrainingImages;
use crate::images::whereabouts::{Whereabouts, labelled, load_dataset_of};
use crate::robots;
use crate::robots::published;
use crate::robots::selection::Selection;
use crate::store::images::{DatasetRef, ImageRef};
use crate::task::answer::Readout;
use crate::task::class_names::ClassNames;
use crate::task::protocol::RolloutMode;
use crate::task::recording::{LabelledStimulus, Recording};
use crate::task::rollout::{check_length, record_unless};
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::atomic::AtomicBool;

/// Most images in one recording, since pictures hold every frame.
pub(crate) const MAX_IMAGES: usize = 20;

/// An image by split and index: `train:3`, `test:17`; without a word, a training image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShownImage {
    pub(crate) split: Split,
    pub(crate) index: usize,
}

impl FromStr for ShownImage {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let (split, digits) = match text.split_once(':') {
            Some(("test", digits)) => (Split::Test, digits),
            Some(("train", digits)) => (Split::Train, digits),
            None => (Split::Train, text),
            Some((other, _)) => {
                return Err(format!("{other}: expected train or test before the colon"));
            }
        };
        let index = digits
            .trim()
            .parse()
            .map_err(|_| format!("{text}: expected an index, as 3 or test:17"))?;
        Ok(ShownImage { split, index })
    }
}

/// Options of a recording.
#[derive(Clone, Debug, Default)]
pub struct ReplayOptions {
    /// The robot: an id or its beginning, "best", or a name in the gallery.
    pub robot: String,
    /// True if only robots count that an audit found physical.
    pub physical_only: bool,
    /// The run.json; `None`: the newest under `runs/`.
    pub archive: Option<PathBuf>,
    /// The images; none: the training images.
    pub images: Vec<ShownImage>,
    /// Folder of the data, if the command line names one.
    pub data: Option<PathBuf>,
    /// Another dataset than the run's.
    pub dataset: Option<String>,
}

/// A robot's rollout, and its description.
#[derive(Clone, Debug)]
pub struct Replay {
    /// The rollout.
    pub recording: Recording,
    /// Description on a page: words and values.
    pub about: Vec<(String, String)>,
    /// Name of the recording in file names.
    pub name: String,
}

/// A robot and its images, before the simulation.
#[derive(Clone, Debug)]
pub(crate) struct ReplaySubject {
    pub(crate) found: FoundRobot,
    /// Images as it sees them.
    pub(crate) images: Vec<LabelledStimulus>,
    /// Names of the images' classes.
    pub(crate) names: ClassNames,
}

/// Records a robot's rollout under the protocol of its config, unless `stop` is set in the meantime.
///
/// # Errors
/// Returns an error if the robot, archive, images or data are wrong, or if `stop` was set.
pub fn replay(options: &ReplayOptions, stop: &AtomicBool) -> Result<Replay, Error> {
    Ok(replay_subject(subject(options)?, stop)?)
}

/// Acts as [`replay`] for a robot and images that were found.
pub(crate) fn replay_subject(subject: ReplaySubject, stop: &AtomicBool) -> Result<Replay, Stopped> {
    let recording = record_subject(&subject, stop)?;
    let FoundRobot {
        name,
        config,
        mut about,
        ..
    } = subject.found;
    let fresh = config.protocol.rollout == RolloutMode::Fresh;
    about.push((
        "Images".to_string(),
        format!(
            "{}, {:?} encoding",
            config.data.dataset, config.stimulus.encoding
        )
        .to_lowercase(),
    ));
    let rollout = if fresh {
        "a fresh rollout for every image"
    } else {
        "one continuous rollout"
    };
    about.push((
        "Protocol".to_string(),
        format!(
            "{rollout}, {} control steps each",
            config.protocol.control_steps
        ),
    ));
    Ok(Replay {
        recording,
        about,
        name,
    })
}

pub(crate) fn record_subject(
    subject: &ReplaySubject,
    stop: &AtomicBool,
) -> Result<Recording, Stopped> {
    let ReplaySubject {
        found:
            FoundRobot {
                name,
                body,
                config,
                judge,
                ..
            },
        images,
        names,
    } = subject;
    let fresh = config.protocol.rollout == RolloutMode::Fresh;
    let setting = (&config.physics, &config.protocol);
    let recording = record_unless(name, body, setting, fresh, images, stop)?;
    Ok(Recording {
        judge: judge.clone(),
        names: names.clone(),
        ..recording
    })
}

pub(crate) fn subject(options: &ReplayOptions) -> Result<ReplaySubject, Error> {
    let mut found = find(options)?;
    let config = &mut found.config;
    if let Some(dataset) = &options.dataset {
        config.data = config.data.of(dataset);
    }
    let whereabouts = Whereabouts::given(options.data.as_deref()).and_of(&found.archive);
    // Any body can look at the digits that the program draws.
    let offer = |error: Error| match options.dataset {
        None => error.remedy(Remedy::UseBuiltin),
        Some(_) => error,
    };
    let (asks, mut shown) = (!options.images.is_empty(), options.images.clone());
    if shown.is_empty() {
        let own = if options.dataset.is_none() {
            found.training.as_slice()
        } else {
            &[]
        };
        let all = match own {
            [] => {
                let train = whereabouts
                    .load(&config.data, &[Split::Train])
                    .map_err(offer)?;
                // Draws no more than are recorded: another dataset may have fewer.
                let is_shown = |per_class: &usize| per_class * config.classes().len() <= MAX_IMAGES;
                let images_per_class = Some(config.data.images_per_class)
                    .filter(is_shown)
                    .unwrap_or(1);
                let data = DataConfig {
                    images_per_class,
                    ..config.data.clone()
                };
                TrainingImages::of(
                    &Config {
                        data,
                        ..config.clone()
                    },
                    &train,
                )?
                .images
            }
            own => own.to_vec(),
        };
        let training = |image: &ImageRef| ShownImage {
            split: Split::Train,
            index: image.index,
        };
        shown = some(&all).iter().map(training).collect();
    }
    if shown.len() > MAX_IMAGES {
        let text = format!(
            "{} images, expected at most {MAX_IMAGES} in one recording",
            shown.len()
        );
        return Err(Error::usage(text).about("images"));
    }
    let wanted: Vec<Split> = Split::ALL
        .into_iter()
        .filter(|split| shown.iter().any(|image| image.split == *split))
        .collect();
    let own = found
        .dataset
        .as_ref()
        .filter(|own| own.name == config.data.dataset);
    let dataset = load_dataset_of(own, config, &whereabouts, &wanted).map_err(offer)?;
    let mut images = Vec::new();
    for ShownImage { split, index } in shown {
        let label =
            dataset
                .label(split, index)
                .map_err(|error| match (&options.archive, asks) {
                    (_, true) => Error::usage(error.to_string()).about("images"),
                    (Some(path), _) => {
                        Error::input(format!("{}: training_images: {error}", path.display()))
                    }
                    (None, _) => Error::input(format!("training_images: {error}")),
                })?;
        images.push(labelled(
            config,
            &dataset,
            split,
            ImageRef { index, label },
        )?);
    }
    config.data.dataset = dataset.name().to_string();
    let body = [config.body.height, config.body.width];
    check_length(body, &config.protocol, images.len())?;
    Ok(ReplaySubject {
        found,
        images,
        names: dataset.class_names().clone(),
    })
}

/// Training images to show: all, or the first of each class if they are too many.
fn some(images: &[ImageRef]) -> Vec<ImageRef> {
    let mut some = images.to_vec();
    if some.len() > MAX_IMAGES {
        let mut seen = std::collections::BTreeSet::new();
        some.retain(|image| seen.insert(image.label));
    }
    some
}

/// A robot, and the settings of its simulation.
#[derive(Clone, Debug)]
pub struct FoundRobot {
    /// Its id.
    pub name: String,
    pub(crate) body: Body,
    pub(crate) config: Config,
    /// Its training images, as far as known.
    pub(crate) training: Vec<ImageRef>,
    pub(crate) dataset: Option<DatasetRef>,
    /// Description on a page: words and values.
    pub(crate) about: Vec<(String, String)>,
    judge: Option<Readout>,
    /// The run.json it comes from.
    pub(crate) archive: PathBuf,
}

impl FoundRobot {
    /// Returns the title of its picture, one line: robot, run and seed.
    pub(crate) fn title(&self) -> String {
        let word = |key: &str| {
            self.about
                .iter()
                .find(|(word, _)| word == key)
                .map_or("", |(_, value)| value)
        };
        format!("robot {}, {}", word("Robot"), word("From"))
    }
}

/// Finds a robot in an archive or the gallery.
///
/// # Errors
/// Returns an error if the robot or archive is wrong.
pub fn find(options: &ReplayOptions) -> Result<FoundRobot, Error> {
    let ids = Selection::Ids(vec![options.robot.clone()]);
    let (archives, _) = robots::archives(options.archive.iter().cloned().collect(), ids)?;
    let [archive] = archives
        .try_into()
        .expect("one is named, or else there is one");
    let source = robots::open(&archive)?;
    let robots = Selection::Ids(vec![options.robot.clone()]).physical(options.physical_only);
    let robots = robots.of(std::slice::from_ref(&source), 0);
    let robots = robots.map_err(|error| {
        let error = error.in_place(&archive.display().to_string());
        if options.archive.is_some() || options.physical_only {
            return error;
        }
        // Without an archive, the name may mean a published robot.
        error.remedy(Remedy::Run(
            Invocation::new("gallery"),
            "lists the published robots",
        ))
    })?;
    let (robot, run) = (robots[0].robot, &source.run);
    let about = vec![
        ("Robot".to_string(), robot.id.clone()),
        (
            "From".to_string(),
            published::provenance(run.called(), run.config.seed),
        ),
        ("Task".to_string(), robot.task.clone()),
        ("Fitness".to_string(), run.in_units(robot.objective)),
        (
            "Born".to_string(),
            format!("generation {}", robot.generation),
        ),
    ];
    let (name, body) = (robot.id.clone(), robot.body.clone());
    Ok(FoundRobot {
        name,
        body,
        training: run.training_images.clone(),
        dataset: Some(run.dataset.clone()),
        about,
        judge: run.judge(robot),
        archive,
        config: run.config.clone(),
    })
}
