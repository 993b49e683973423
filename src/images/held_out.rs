//! Images that robots are not trained on: test images and validation images. A run's seed draws the
//! latter from the training split, without those it trains on or chooses its training images from.

use crate::base::error::{Error, ErrorKind};
use crate::base::random::{Purpose, stream};
use crate::base::text::counted;
use crate::config::Config;
use crate::config::validation::{IMAGES_KEY, LEAST, ValidationConfig};
use crate::data::dataset::{Dataset, Split};
use crate::images::training::TrainingImages;
use crate::store::images::{HeldOut, HowMany, ImageRef};
use crate::store::run::RunFile;
use crate::store::training::Origin;
use crate::task::class_names::ClassNames;
use std::collections::BTreeSet;

/// Returns the indices of all images that a run, and its gaits before, were trained on.
pub(crate) fn trained_on(run: &RunFile, dataset: &Dataset) -> Result<BTreeSet<usize>, Error> {
    let mut seen: BTreeSet<usize> = run
        .origin
        .iter()
        .flat_map(|origin: &Origin| &origin.trained_on)
        .copied()
        .collect();
    seen.extend(run.training_images.iter().map(|image| image.index));
    seen.extend(TrainingImages::indices(&run.config, dataset)?);
    Ok(seen)
}

/// Returns the images of each class that are not in `seen`.
fn unused_by_class(
    classes: &[u8],
    seen: &BTreeSet<usize>,
    dataset: &Dataset,
) -> Vec<Vec<ImageRef>> {
    let of_class = |&label: &u8| {
        let all = dataset.indices_of(Split::Train, label).iter();
        let free = all.filter(|&index| !seen.contains(index));
        free.map(|&index| ImageRef { index, label }).collect()
    };
    classes.iter().map(of_class).collect()
}

/// Returns the largest number of images available, evenly divided between the classes.
fn most(left: &[Vec<ImageRef>]) -> usize {
    left.iter().map(Vec::len).min().unwrap_or(0) * left.len()
}

/// Returns the number of images to take of each class, at least one; errors name `argument`.
fn per_class(
    classes: &[u8],
    left: &[Vec<ImageRef>],
    names: &ClassNames,
    argument: Option<&'static str>,
    how_many: HowMany,
) -> Result<usize, Error> {
    let per_class = match how_many {
        HowMany::All => 1,
        HowMany::Evenly(count) => count.div_ceil(left.len().max(1)),
    };
    match classes.iter().zip(left).min_by_key(|(_, left)| left.len()) {
        Some((label, scarcest)) if scarcest.len() < per_class => {
            let text = format!(
                "expected {} of class {} that the run is not trained on, found {}",
                counted(per_class, "image", "images"),
                names.name(*label),
                scarcest.len()
            );
            let error = match argument {
                Some(name) => Error {
                    kind: ErrorKind::Input,
                    ..Error::argument(name, how_many, text)
                },
                None => {
                    Error::input(format!("{IMAGES_KEY} = {how_many}: {text}")).with_key(IMAGES_KEY)
                }
            };
            Err(error)
        }
        _ => Ok(per_class),
    }
}

/// Checks that enough images remain to validate a run's robots at its end, besides `before`, which
/// its gaits were trained on; `key` is the config key that sets its own number.
pub(crate) fn check(
    config: &Config,
    before: &[usize],
    key: &str,
    dataset: &Dataset,
) -> Result<(), Error> {
    let ValidationConfig { images, best } = config.validation;
    if best == 0 {
        return Ok(());
    }
    let mut seen: BTreeSet<usize> = TrainingImages::indices(config, dataset)?
        .into_iter()
        .collect();
    seen.extend(before);
    let classes = config.classes();
    let left = unused_by_class(&classes, &seen, dataset);
    let names = dataset.class_names();
    per_class(&classes, &left, names, None, HowMany::Evenly(images))
        .map(|_| ())
        .map_err(|error| {
            let most = most(&left);
            let fewer = if most >= LEAST {
                format!("ask for at most {most}, ")
            } else {
                String::new()
            };
            error.advice(format!(
                "{fewer}train on fewer ({key}), or choose none (validation.best = 0)"
            ))
        })
}

/// Draws `count` validation images for runs of one experiment. They are evenly divided between the
/// classes, which alternate. The order of the runs does not matter, and fewer images are always the
/// first of more. `argument` is the argument that set `count`; `None` if the config did.
///
/// # Errors
/// Returns an error if there are not enough images.
pub fn images(
    runs: &[&RunFile],
    dataset: &Dataset,
    argument: Option<&'static str>,
    count: usize,
) -> Result<Vec<ImageRef>, Error> {
    let classes = runs.first().map_or(Vec::new(), |run| run.config.classes());
    images_besides(
        &BTreeSet::new(),
        runs,
        &classes,
        dataset,
        argument,
        HowMany::Evenly(count),
    )
}

/// Draws validation images of these classes without those in `besides`; see [`images`].
pub(crate) fn images_besides(
    besides: &BTreeSet<usize>,
    runs: &[&RunFile],
    classes: &[u8],
    dataset: &Dataset,
    argument: Option<&'static str>,
    how_many: HowMany,
) -> Result<Vec<ImageRef>, Error> {
    let first = runs
        .iter()
        .map(|run| &run.config)
        .min_by_key(|config| config.seed);
    let Some(config) = first else {
        return Ok(Vec::new());
    };
    let mut seen = besides.clone();
    for run in runs {
        seen.extend(trained_on(run, dataset)?);
    }
    let left = unused_by_class(classes, &seen, dataset);
    let names = dataset.class_names();
    let per_class =
        per_class(classes, &left, names, argument, how_many).map_err(|error| {
            match most(&left) {
                0 => error.advice("every image of that class was trained on; show test images"),
                most => error.advice(format!("ask for at most {most}")),
            }
        })?;
    let HowMany::Evenly(count) = how_many else {
        return Ok(left.concat());
    };
    let draw = |(&label, free): (&u8, Vec<ImageRef>)| -> Vec<ImageRef> {
        let mut random = stream(config.seed, Purpose::Validation, 0, u64::from(label));
        random
            .sample(free.len(), per_class)
            .into_iter()
            .map(|i| free[i])
            .collect()
    };
    let drawn: Vec<Vec<ImageRef>> = classes.iter().zip(left).map(draw).collect();
    let turns = (0..per_class).flat_map(|turn| {
        drawn
            .iter()
            .filter_map(move |class| class.get(turn).copied())
    });
    Ok(turns.take(count).collect())
}

/// Number of images of a test if nobody says another.
const USUAL: usize = 1000;

/// Returns the default number of images: 1000, or all test images if there are fewer.
pub(crate) fn usual(split: HeldOut, classes: &[u8], dataset: &Dataset) -> HowMany {
    if split == HeldOut::Validation {
        return HowMany::Evenly(USUAL);
    }
    let of_class = |class: &u8| dataset.indices_of(Split::Test, *class).len();
    let fewest = classes.iter().map(of_class).min().unwrap_or(0);
    match fewest >= USUAL.div_ceil(classes.len().max(1)) {
        true => HowMany::Evenly(USUAL),
        false => HowMany::All,
    }
}

/// Returns test images by class: all, or an even share drawn of each; first classes get the rest.
pub(crate) fn test_images(
    classes: &[u8],
    dataset: &Dataset,
    how_many: HowMany,
    seed: u64,
) -> Result<Vec<ImageRef>, Error> {
    let count_of = |class: &&u8| dataset.indices_of(Split::Test, **class).len();
    if let Some(label) = classes.iter().find(|class| count_of(class) == 0) {
        let names = dataset.class_names();
        let text = format!(
            "{}: there is no test image of class {}",
            dataset.name(),
            names.name(*label)
        );
        let there = names.list(&dataset.classes(Split::Test));
        return Err(Error::input(text).advice(format!("there are of the classes [{there}]")));
    }
    let HowMany::Evenly(count) = how_many else {
        let of_class = |&label: &u8| {
            dataset
                .indices_of(Split::Test, label)
                .iter()
                .map(move |&index| ImageRef { index, label })
        };
        return Ok(classes.iter().flat_map(of_class).collect());
    };
    let mut images = Vec::new();
    for (place, &label) in classes.iter().enumerate() {
        let share = count / classes.len() + usize::from(place < count % classes.len());
        let drawn = dataset.draw(Split::Test, &[label], share, seed);
        let drawn = drawn.map_err(|error| {
            let most = classes
                .iter()
                .map(|class| count_of(&class))
                .min()
                .unwrap_or(0);
            let advice = format!("ask for at most {} images", most * classes.len());
            Error::input(error.to_string()).advice(advice)
        })?;
        images.extend(drawn.into_iter().map(|index| ImageRef { index, label }));
    }
    Ok(images)
}
