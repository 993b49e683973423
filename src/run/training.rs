//! [`Training`]: the images a run evolves on, as its robots see them.

use super::config::BodyConfig;
use super::curriculum::Period;
use super::hardest::hardest;
use super::whereabouts::Whereabouts;
use super::{Config, Error, response};
use crate::base::Grid;
use crate::base::random::{Purpose, Stream, stream};
use crate::base::stop::NEVER;
use crate::task::condition::Condition;
use crate::task::dataset::{Dataset, DatasetError, Split};
use crate::task::score::Answer;
use crate::task::stimulus::{StimulusParams, stimulus};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// An image by its place in a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageRef {
    /// Index in its split.
    pub index: usize,
    /// Its class.
    pub label: u8,
}

/// Which data a run was made with, wherever they lay: the same data have the same fingerprint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DatasetRef {
    /// Name of the dataset.
    pub name: String,
    /// SHA-256 of the training split's content.
    pub train_sha256: String,
}

/// The images a run evolves on, and how they are shown.
#[derive(Clone, Debug)]
pub struct Training {
    /// Where they come from.
    pub dataset: DatasetRef,
    /// The images, in the order in which a sequential life sees them.
    pub images: Vec<ImageRef>,
    /// What the sensors see of each: H × W in [0, 1]. Where a response is measured, as many images of their pixels.
    pub stimuli: Vec<Grid<f64>>,
    /// Under what each is shown, in a fresh life.
    pub conditions: Vec<Condition>,
}

/// Loads the dataset of a config; `data` is the folder given on the command line.
///
/// # Errors
/// What is missing or broken, where it was looked for and what to do.
pub fn load_dataset(config: &Config, data: Option<&Path>, wanted: &[Split]) -> Result<Dataset, Error> {
    Whereabouts::given(data).load(&config.data, wanted)
}

/// Loads the dataset that a run was made with; any, if none is said. Where only other splits are wanted, it is known by its training
/// images if these are there.
///
/// # Errors
/// As [`load_dataset`]; or that it is another one: images of the same index would be others.
pub fn load_dataset_of(
    run: Option<&DatasetRef>,
    config: &Config,
    data: &Whereabouts,
    wanted: &[Split],
) -> Result<Dataset, Error> {
    let Some(run) = run else { return data.load(&config.data, wanted) };
    let loaded = data.load(&config.data, wanted).map_err(|error| data.asked_by(error))?;
    let train = match loaded.fingerprint(Split::Train) {
        None => data.load(&config.data, &[Split::Train]).ok().and_then(|set| set.fingerprint(Split::Train)),
        known => known,
    };
    match train.is_none_or(|train| train == run.train_sha256) {
        true => Ok(loaded),
        false => {
            let text = format!(
                "{}: the training images here are not those the run was made with (another SHA-256)",
                loaded.place()
            );
            Err(data.asked_by(Error::input(text)).hint("name their folder with --data".to_string()))
        }
    }
}

/// What a robot of a config sees of an image.
///
/// # Errors
/// If the image does not go with the body's size.
pub fn see(config: &Config, dataset: &Dataset, split: Split, index: usize) -> Result<Grid<f64>, Error> {
    seen(&config.body, &config.stimulus, dataset, split, index)
}

/// What a robot of this size sees of an image.
///
/// # Errors
/// If the image does not go with the body's size.
pub fn seen(
    &BodyConfig { height, width, .. }: &BodyConfig,
    params: &StimulusParams,
    dataset: &Dataset,
    split: Split,
    index: usize,
) -> Result<Grid<f64>, Error> {
    let image = dataset.image(split, index).map_err(|error| Error::input(error.to_string()))?;
    stimulus(&image, height, width, params)
        .map_err(|error| Error::input(format!("stimulus.reduction: {error}")))
}

impl Training {
    /// The training images of a config, in its first period if there are several.
    ///
    /// # Errors
    /// If the data are missing or broken, or an image is of a class that is not in the task, or a class has no image.
    pub fn load(config: &Config, data: Option<&Path>) -> Result<Self, Error> {
        Training::of(config, &load_dataset(config, data, &[Split::Train])?, config.period(0))
    }

    /// Indices of the images among which those of a period are chosen; without a choice, of its training images.
    ///
    /// # Errors
    /// If a class has not as many images as are to be drawn.
    pub fn drawn(config: &Config, dataset: &Dataset, period: Period) -> Result<Vec<usize>, Error> {
        let period = config.drawn_in(period);
        let key = |key: &str| format!("stage {}: {key}", period.stage + 1);
        let (key, per_class, number) = match (config.drawn_per_class(period), config.pool(period)) {
            (Some(_), Some(pool)) => (key("pool"), pool, period.number()),
            (Some(per_class), None) => (key("images_per_class"), per_class, period.number()),
            (None, _) => match &config.data.train_images {
                Some(indices) => return Ok(indices.clone()),
                None => ("data.images_per_class".to_string(), config.data.images_per_class, 0),
            },
        };
        dataset
            .draw(Split::Train, &config.classes(), per_class, config.seed, number)
            .map_err(|error| Error::input(format!("{key}: {error}")))
    }

    /// Indices of the training images of a period.
    ///
    /// # Errors
    /// As [`Training::drawn`].
    pub fn indices(config: &Config, dataset: &Dataset, period: Period) -> Result<Vec<usize>, Error> {
        Training::indices_unless(config, dataset, period, &NEVER)
    }

    fn indices_unless(
        config: &Config,
        dataset: &Dataset,
        period: Period,
        stop: &AtomicBool,
    ) -> Result<Vec<usize>, Error> {
        let mut drawn = Training::drawn(config, dataset, period)?;
        let drawn_in = config.drawn_in(period);
        let per_class = config.drawn_per_class(drawn_in);
        if let (Some(per_class), Some(_)) = (per_class, config.pool(drawn_in)) {
            let label = |&index: &usize| dataset.label(Split::Train, index);
            let labels = drawn.iter().map(label).collect::<Result<Vec<u8>, DatasetError>>();
            let labels =
                labels.map_err(|error| Error::input(format!("stage {}: pool: {error}", period.stage + 1)))?;
            let stimulus = |&index: &usize| see(config, dataset, Split::Train, index);
            let stimuli = drawn.iter().map(stimulus).collect::<Result<Vec<_>, Error>>()?;
            drawn = hardest(&labels, &stimuli, per_class, stop)?
                .into_iter()
                .map(|number| drawn[number])
                .collect();
        }
        if per_class.is_none() && config.data.train_images.is_some() {
            return Ok(drawn);
        }
        // Where the first images decide whether others are shown, they are not to be of one class.
        let takes_turns = config.race(period);
        let per_class = drawn.len() / config.classes().len().max(1);
        Ok(if takes_turns { by_turns(drawn, per_class) } else { drawn })
    }

    /// The training images of a period.
    ///
    /// # Errors
    /// As [`Training::load`].
    pub fn of(config: &Config, dataset: &Dataset, period: Period) -> Result<Self, Error> {
        Training::unless(config, dataset, period, &NEVER)
    }

    /// The same, unless `stop` is set meanwhile: to find the hardest of a large pool takes long.
    ///
    /// # Errors
    /// Of kind [`ErrorKind::Stopped`](super::ErrorKind::Stopped) then, or as [`Training::load`].
    pub fn unless(
        config: &Config,
        dataset: &Dataset,
        period: Period,
        stop: &AtomicBool,
    ) -> Result<Self, Error> {
        let refuse = |error: DatasetError| Error::input(format!("data.train_images: {error}"));
        let classes = config.classes();
        let indices = Training::indices_unless(config, dataset, period, stop)?;
        let mut images = Vec::new();
        let mut stimuli = Vec::new();
        for index in indices {
            let label = dataset.label(Split::Train, index).map_err(refuse)?;
            if !classes.contains(&label) {
                let text =
                    format!("data.train_images: image {index} shows a {label}, expected one of {classes:?}");
                return Err(Error::input(text).hint("see [task] for the classes".to_string()));
            }
            let mut stimulus = see(config, dataset, Split::Train, index)?;
            // Others in every image and every period.
            let mut random =
                stream(config.seed, Purpose::InvertedPixels, period.number(), images.len() as u64);
            invert(&mut stimulus, config.inverted_pixels(period), &mut random);
            stimuli.push(stimulus);
            images.push(ImageRef { index, label });
        }
        if let Some(class) = classes.iter().find(|&&class| images.iter().all(|image| image.label != class)) {
            return Err(Error::input(format!(
                "data.train_images: expected an image of class {class}, found none"
            )));
        }
        let train_sha256 = dataset.fingerprint(Split::Train).expect("its images were read just now");
        let dataset = DatasetRef { name: dataset.name().to_string(), train_sha256 };
        let classes = images.iter().map(|image| image.label);
        let conditions = if config.measures_response(period) {
            stimuli = response::opposites(&stimuli, &config.physics, config.seed, period);
            response::conditions(images.len())
        } else {
            Condition::by_turns(classes, config.raised_starts(period), config.without_limits(period))
        };
        Ok(Training { dataset, images, stimuli, conditions })
    }

    /// The answers that displacements under the images are, in their order; those that are missing are still to come.
    pub fn answers(&self, displacements: impl IntoIterator<Item = Option<f64>>) -> Vec<Answer> {
        answers(&self.images, displacements)
    }
}

/// The answers that displacements under images are, in their order; those that are missing are still to come.
pub(super) fn answers(
    images: &[ImageRef],
    displacements: impl IntoIterator<Item = Option<f64>>,
) -> Vec<Answer> {
    let all = displacements.into_iter().chain(std::iter::repeat(None));
    images.iter().zip(all).map(|(image, displacement)| Answer { class: image.label, displacement }).collect()
}

/// Inverts so many pixels of what sensors see.
fn invert(stimulus: &mut Grid<f64>, count: usize, random: &mut Stream) {
    let (height, width) = (stimulus.height(), stimulus.width());
    for place in random.sample(height * width, count) {
        let pixel = &mut stimulus[(place / width, place % width)];
        *pixel = 1.0 - *pixel;
    }
}

/// Images of one class after the other, as drawn, so that the classes take turns.
fn by_turns(drawn: Vec<usize>, per_class: usize) -> Vec<usize> {
    (0..per_class).flat_map(|turn| drawn.iter().skip(turn).step_by(per_class).copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Labels of the training images of a config with this section `[data]` and this stage, and those images in ascending order.
    fn drawn(data: &str, stage: &str) -> (Vec<u8>, Vec<usize>) {
        let text = format!(
            "[task]\ngroups = [[3], [0, 1]]\n[data]\ndataset = \"builtin\"\n{data}\n[[stage]]\n{stage}"
        );
        let config = Config::parse(&text, "a.toml", &[]).unwrap();
        let training = Training::load(&config, None).unwrap();
        let mut indices: Vec<usize> = training.images.iter().map(|image| image.index).collect();
        indices.sort_unstable();
        (training.images.iter().map(|image| image.label).collect(), indices)
    }

    #[test]
    fn classes_take_turns_where_the_first_images_decide_whether_others_are_shown() {
        let (two, pool) = ("images_per_class = 2", "images_per_class = 2\npool = 5");
        for (data, images) in [("", two), ("", pool), (two, "")] {
            let plain = drawn(data, &format!("{images}\nfitness = \"mean_hinge\""));
            assert_eq!(plain.0, [3, 3, 0, 0, 1, 1]);
            let by_turns = drawn(data, &format!("{images}\nfitness = \"mean_hinge\"\nrace = true"));
            // The same images.
            assert_eq!(by_turns, (vec![3, 0, 1, 3, 0, 1], plain.1), "{data} {images}");
        }
        // Images that are named come as they are named.
        let named = drawn("train_images = [3, 0, 10, 1]", "fitness = \"mean_hinge\"\nrace = true");
        assert_eq!(named.0, [3, 0, 0, 1]);
    }

    #[test]
    fn images_are_shown_under_the_conditions_of_their_stage() {
        let conditions = |stage: &str| {
            let text = format!(
                "[task]\ngroups = [[3], [0]]\n[data]\ndataset = \"builtin\"\n[[stage]]\n{stage}\nimages_per_class = 4"
            );
            Training::load(&Config::parse(&text, "a.toml", &[]).unwrap(), None).unwrap().conditions
        };
        assert_eq!(conditions(""), [Condition::default(); 8]);
        let every = [(0, false), (1, false), (0, true), (1, true)];
        let every = every.map(|(raised, without_limits)| Condition { raised, without_limits });
        // Images of one class after the other.
        assert_eq!(conditions("raised_starts = 1\nwithout_limits = true"), [every, every].concat());
    }

    #[test]
    fn a_stage_may_show_the_images_of_a_stage_before() {
        let images = |generation: u64, [second, third]: [&str; 2]| -> Vec<usize> {
            let stages = "[[stage]]\ngenerations = 5\nimages_per_class = 3\npool = 9\nredraw = 2";
            let text = format!(
                "[task]\ngroups = [[3], [0]]\n[data]\ndataset = \"builtin\"\n{stages}\n[[stage]]\ngenerations = 1\n{second}\n[[stage]]\n{third}"
            );
            let config = Config::parse(&text, "a.toml", &[]).unwrap();
            let dataset = load_dataset(&config, None, &[Split::Train]).unwrap();
            Training::indices(&config, &dataset, config.period(generation)).unwrap()
        };
        let [others, first, second] = ["images_per_class = 3\npool = 9", "images_of = 1", "images_of = 2"];
        // Those of its last draw.
        assert_ne!(images(3, [first, first]), images(4, [first, first]));
        assert_eq!(images(5, [first, others]), images(4, [first, others]));
        assert_ne!(images(5, [others, others]), images(4, [others, others]));
        // Of the stage before the last, or by way of the last.
        assert_eq!(images(6, [others, first]), images(4, [others, first]));
        assert_eq!(images(6, [first, second]), images(4, [first, second]));
        assert_eq!(images(6, [others, second]), images(5, [others, second]));
    }

    #[test]
    fn so_many_pixels_of_each_image_are_inverted_others_in_each_and_in_each_draw() {
        let seen = |inverted: &str, draw: u64| {
            let stage = format!("[[stage]]\nimages_per_class = 4\nredraw = 1\n{inverted}");
            let text = format!("[task]\ngroups = [[3], [0]]\n[data]\ndataset = \"builtin\"\n{stage}");
            let config = Config::parse(&text, "a.toml", &[]).unwrap();
            let dataset = load_dataset(&config, None, &[Split::Train]).unwrap();
            let training = Training::of(&config, &dataset, Period { stage: 0, draw }).unwrap();
            (training.images, training.stimuli)
        };
        let changed = |draw: u64| -> Vec<Vec<(usize, usize)>> {
            let (plain, noisy) = (seen("", draw), seen("inverted_pixels = 3", draw));
            assert_eq!(plain.0, noisy.0, "the same images");
            let pairs = plain.1.iter().zip(&noisy.1);
            let places = pairs.map(|(plain, noisy)| {
                let changed = plain.iter().filter(|(place, pixel)| noisy[*place] != **pixel);
                changed
                    .map(|(place, pixel)| {
                        assert_eq!(noisy[place], 1.0 - pixel);
                        place
                    })
                    .collect()
            });
            places.collect()
        };
        let (first, second) = (changed(0), changed(1));
        assert!(first.len() == 8 && first.iter().chain(&second).all(|places| places.len() == 3), "{first:?}");
        assert!(first.windows(2).any(|two| two[0] != two[1]) && first != second);
        assert_eq!(first, changed(0));
        assert_eq!(seen("", 0), seen("inverted_pixels = 0", 0));
    }
}
