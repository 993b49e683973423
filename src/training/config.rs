//! The config of a training: that of its gaits, with another task and as many images as possible.

use crate::base::error::Error;
use crate::base::session::Session;
use crate::config::evaluation::EvaluationConfig;
use crate::config::task::TaskConfig;
use crate::config::validation::{LEAST, ValidationConfig};
use crate::config::{BodyConfig, Config, DataConfig, reading};
use crate::data::dataset::{Dataset, Split};
use crate::images::held_out;
use crate::images::training::{TrainingImages, scarcest};
use crate::images::whereabouts::{Whereabouts, part_of_others, size_of};
use crate::store::images::DatasetRef;
use crate::task::class_names::ClassNames;
use crate::task::fitness::Fitness;
use crate::task::grouping::Groups;
use crate::task::margins::Margins;
use crate::task::protocol::{Protocol, RolloutMode};
use crate::task::stimulus::StimulusParams;

const LEAST_PER_CLASS: usize = 2;

/// Builds the config of a training: that of the gaits' run with another task, perhaps another seed,
/// and the keys in `set`, which must not set what a training fixes.
pub(crate) fn config_of(
    of_walkers: &Config,
    groups: &[Vec<u8>; 2],
    seed: Option<u64>,
    set: &[String],
) -> Result<Config, Error> {
    let evaluation = EvaluationConfig {
        fitness: Fitness::MeanClipped,
    };
    let base = Config {
        seed: seed.unwrap_or(of_walkers.seed),
        generations: 1,
        task: TaskConfig {
            groups: Some(groups.clone()),
            ..TaskConfig::default()
        },
        data: DataConfig {
            train_images: None,
            ..of_walkers.data.clone()
        },
        protocol: Protocol {
            rollout: RolloutMode::Fresh,
            ..of_walkers.protocol.clone()
        },
        evaluation,
        validation: ValidationConfig {
            best: 1,
            ..of_walkers.validation
        },
        ..of_walkers.clone()
    };
    let asked = base.clone();
    let check = |config: &Config| {
        check_fixed_keys(config, &asked)
            .and_then(|()| config.validate())
            .and_then(|()| check_final_images(config, groups))
    };
    let config = reading::changed(base, set, check, |error| error)?;
    let config = Config {
        data: own_data(of_walkers, config.data.clone()),
        ..config
    };
    let BodyConfig { height, width, .. } = of_walkers.body;
    if (config.body.height, config.body.width) != (height, width) {
        let found = format!("{} × {} voxels", config.body.height, config.body.width);
        return Err(Error::value(
            "body",
            found,
            &format!("{height} × {width}, as the gaits have"),
        ));
    }
    if config.task != asked.task {
        return Err(Error::at_key(
            "task",
            "expected the groups that are trained to be said once, not as a key, too",
        ));
    }
    if config.seed != asked.seed {
        return Err(Error::value(
            "seed",
            config.seed,
            &format!("{}, as said elsewhere", asked.seed),
        ));
    }
    Ok(config)
}

/// Reads the groups of a training, by the names of its dataset's classes or by their numbers.
///
/// # Errors
/// Returns an error about the groups, or about a wrong key in `set`.
pub(crate) fn groups_of(
    text: &str,
    of_walkers: &Config,
    set: &[String],
    whereabouts: &Whereabouts,
) -> Result<Groups, Error> {
    class_names(of_walkers, set, whereabouts)?
        .read(text)
        .map_err(Error::usage)
}

/// Returns the names of the classes of the dataset that a config has once `set` has changed it.
pub(crate) fn class_names(
    config: &Config,
    set: &[String],
    whereabouts: &Whereabouts,
) -> Result<ClassNames, Error> {
    whereabouts.class_names(&changed(config, set)?.data)
}

/// Changes a config of gaits by the keys in `set`, without a task to train.
pub(crate) fn changed(config: &Config, set: &[String]) -> Result<Config, Error> {
    let changed = reading::changed(config.clone(), set, |_| Ok(()), |error| error)?;
    Ok(Config {
        data: own_data(config, changed.data.clone()),
        ..changed
    })
}

/// Returns settings without the names of another dataset's classes.
fn own_data(of_walkers: &Config, data: DataConfig) -> DataConfig {
    let there = &of_walkers.data;
    match data.dataset != there.dataset && data.class_names == there.class_names {
        true => DataConfig {
            class_names: Vec::new(),
            ..data
        },
        false => data,
    }
}

/// Checks that designs are compared on an image of every class; groups alternate, the first begins.
fn check_final_images(config: &Config, [a, b]: &[Vec<u8>; 2]) -> Result<(), Error> {
    let (found, least) = (
        config.train.final_images,
        (2 * a.len()).saturating_sub(1).max(2 * b.len()),
    );
    match found < least {
        true => {
            let expected = format!("{least} or more, for an image of every class");
            Err(Error::value("train.final_images", found, &expected))
        }
        false => Ok(()),
    }
}

/// Checks that no key overrides a setting that every training fixes.
fn check_fixed_keys(config: &Config, asked: &Config) -> Result<(), Error> {
    let fixed = [
        (
            "generations",
            config.generations != asked.generations,
            "has rounds and challengers",
        ),
        (
            "data.images_per_class",
            config.data.images_per_class != asked.data.images_per_class,
            "has train.images_per_class",
        ),
        (
            "evaluation",
            config.evaluation != asked.evaluation,
            "has a fitness of its own",
        ),
        (
            "protocol.rollout",
            config.protocol.rollout != asked.protocol.rollout,
            "has fresh rollouts",
        ),
    ];
    match fixed.into_iter().find(|(_, is_set, _)| *is_set) {
        Some((key, _, has)) => Err(Error::at_key(
            key,
            format!("expected without: a training {has}"),
        )),
        None => Ok(()),
    }
}

/// Drops the margin inherited from `of_gaits`, trained on `their_data`, if the new images have
/// another size, unless `set` asks for it.
pub(crate) fn with_fitting_margin(
    config: Config,
    their_data: &DatasetRef,
    of_gaits: &Config,
    dataset: &Dataset,
    set: &[String],
    session: &Session,
) -> Config {
    let is_asked = set
        .iter()
        .any(|assignment| reading::sets(assignment, "stimulus.margin"));
    let size = size_of(their_data, &of_gaits.data.dataset, dataset);
    let (said, shown) = (
        part_of_others(&config, size, dataset, Split::Train),
        dataset.size(Split::Train),
    );
    match (said, size, shown) {
        (None, ..) => config,
        (Some(_), Some([height, width]), Some(shown)) if !is_asked => {
            let margin = config.stimulus.margin;
            let config = Config {
                stimulus: StimulusParams {
                    margin: Margins::default(),
                    ..config.stimulus
                },
                ..config
            };
            session.observer.warning(&format!(
                "stimulus.margin = {margin} is for the gaits' images of {height} × {width} pixels: \
                 of these, robots see {}",
                config.stimulus.part(shown)
            ));
            config
        }
        (Some(said), ..) => {
            session.observer.warning(&said);
            config
        }
    }
}

/// Sets the number of training images to as many as validation leaves; validation uses fewer if
/// they are few. `before` holds the images the gaits were trained on.
pub(crate) fn with_images(
    config: Config,
    before: &[usize],
    dataset: &Dataset,
    session: &Session,
) -> Result<Config, Error> {
    let classes = config.classes();
    let fewest = scarcest(dataset, &classes, LEAST_PER_CLASS)?;
    let ValidationConfig { images, best } = config.validation;
    let mut per_class = config.train.images_per_class.min((fewest * 3 / 4).max(1));
    let mut validation = config.validation;
    let wanted = images.div_ceil(classes.len());
    if best > 0 && fewest - per_class < wanted {
        per_class = per_class.min((fewest * 2 / 3).max(1));
        let there = (fewest - per_class).min(wanted) * classes.len();
        // A number of validation images that the user chose is kept or refused, never reduced.
        let is_asked = images != ValidationConfig::default().images;
        if !is_asked && (LEAST..images).contains(&there) {
            session.observer.warning(&format!(
                "validating on {there} images in place of {images}: there are no more"
            ));
            validation.images = there;
        }
    }
    let data = DataConfig {
        images_per_class: per_class,
        ..config.data.clone()
    };
    let config = Config {
        data,
        validation,
        ..config
    };
    config.validate()?;
    held_out::check(&config, before, "train.images_per_class", dataset)?;
    Ok(config)
}

/// Checks that two groups are unambiguous given a dataset's classes; the error says what to write.
pub(crate) fn check_groups(groups: &Groups, dataset: &Dataset) -> Result<(), Error> {
    let there = dataset.classes(Split::Train);
    groups
        .check_among(&there)
        .map_err(|error| Error::usage(error.to_string()))
}

/// Checks before a run evolves that its gaits can later be trained on these groups.
pub(crate) fn check(
    evolved: &Config,
    groups: &[Vec<u8>; 2],
    whereabouts: &Whereabouts,
) -> Result<(), Error> {
    let config = config_of(evolved, groups, None, &[])?;
    let dataset = whereabouts.load(&config.data, &[Split::Train])?;
    with_images(
        config,
        &TrainingImages::indices(evolved, &dataset)?,
        &dataset,
        &Session::default(),
    )
    .map(|_| ())
}
