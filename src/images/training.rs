//! [`TrainingImages`]: the training images of a run, as its robots see them.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::config::Config;
use crate::data::dataset::{Dataset, DatasetError, Split};
use crate::images::whereabouts::{load_dataset, stimulus_of};
use crate::store::images::{DatasetRef, ImageRef, answers};
use crate::task::answer::Answer;
use crate::task::class_names::ClassNames;
use crate::task::perturbation::Condition;
use std::path::Path;

/// The training images of a run and their stimuli.
#[derive(Clone, Debug)]
pub struct TrainingImages {
    pub(crate) dataset: DatasetRef,
    /// Images, in the order of a sequential rollout.
    pub(crate) images: Vec<ImageRef>,
    /// Stimuli, H × W in [0, 1]: the images as the sensors see them or, where a response is
    /// measured, as many made from their pixels.
    pub stimuli: Vec<Grid<f64>>,
    /// Names of the classes.
    pub(crate) names: ClassNames,
    /// Condition of each stimulus in a fresh rollout; the default where one is missing.
    pub conditions: Vec<Condition>,
}

/// Says which classes the training images have.
fn has(dataset: &Dataset) -> String {
    let there = dataset.class_names().list(&dataset.classes(Split::Train));
    format!("{} has the classes [{there}]", dataset.name())
}

/// Returns the number of training images of the scarcest class; an error if below `least`.
pub(crate) fn scarcest(dataset: &Dataset, classes: &[u8], least: usize) -> Result<usize, Error> {
    let counts = classes
        .iter()
        .map(|class| (dataset.indices_of(Split::Train, *class).len(), *class));
    match counts.min() {
        Some((count, class)) if count < least => {
            let class = dataset.class_names().name(class);
            let text =
                format!("class {class}: expected {least} training images or more, found {count}");
            Err(Error::input(text).about("task").advice(has(dataset)))
        }
        scarcest => Ok(scarcest.map_or(0, |(count, _)| count)),
    }
}

impl TrainingImages {
    /// Loads the training images of a config.
    ///
    /// # Errors
    /// Returns an error if the data are missing or broken, if an image is of a class outside the
    /// task, or if a class has no image.
    pub fn load(config: &Config, data: Option<&Path>) -> Result<Self, Error> {
        TrainingImages::of(config, &load_dataset(config, data, &[Split::Train])?)
    }

    /// Returns the indices of the training images of a config.
    ///
    /// # Errors
    /// Returns an error if a class has too few images to draw from.
    pub fn indices(config: &Config, dataset: &Dataset) -> Result<Vec<usize>, Error> {
        match &config.data.train_images {
            Some(indices) => Ok(indices.clone()),
            None => dataset
                .draw(
                    Split::Train,
                    &config.classes(),
                    config.data.images_per_class,
                    config.seed,
                )
                .map_err(|error| {
                    Error::input(format!("data.images_per_class: {error}")).advice(has(dataset))
                }),
        }
    }

    /// Returns the training images of a config, at least one of each class of its task.
    pub(crate) fn images(config: &Config, dataset: &Dataset) -> Result<Vec<ImageRef>, Error> {
        let refuse = |error: DatasetError| Error::input(format!("data.train_images: {error}"));
        let (classes, names) = (config.classes(), dataset.class_names());
        let mut images = Vec::new();
        for index in TrainingImages::indices(config, dataset)? {
            let label = dataset.label(Split::Train, index).map_err(refuse)?;
            if !classes.contains(&label) {
                let what = names
                    .given(label)
                    .map_or(format!("a {label}"), str::to_string);
                let expected = names.list(&classes);
                let text = format!(
                    "data.train_images: image {index} shows {what}, expected one of [{expected}]"
                );
                return Err(Error::input(text).remedy(Remedy::DrawTrainingImages));
            }
            images.push(ImageRef { index, label });
        }
        match classes
            .iter()
            .find(|&&class| images.iter().all(|image| image.label != class))
        {
            Some(class) => {
                let text = format!(
                    "data.train_images: expected an image of class {}, found none",
                    names.name(*class)
                );
                Err(Error::input(text).remedy(Remedy::DrawTrainingImages))
            }
            None => Ok(images),
        }
    }

    /// Takes the training images of a config from a loaded dataset.
    ///
    /// # Errors
    /// As [`TrainingImages::load`].
    pub fn of(config: &Config, dataset: &Dataset) -> Result<Self, Error> {
        let images = TrainingImages::images(config, dataset)?;
        let seen = |image: &ImageRef| stimulus_of(config, dataset, Split::Train, image.index);
        let stimuli: Vec<Grid<f64>> = images.iter().map(seen).collect::<Result<_, _>>()?;
        let train_sha256 = dataset
            .fingerprint(Split::Train)
            .expect("its images were read just now");
        let names = dataset.class_names().clone();
        let dataset = DatasetRef {
            name: dataset.name().to_string(),
            train_sha256,
        };
        let (stimuli, conditions) =
            config
                .objective()
                .prepare(stimuli, &config.physics, config.seed);
        Ok(TrainingImages {
            dataset,
            images,
            stimuli,
            names,
            conditions,
        })
    }

    /// Describes the images to the user, one by one if they are few.
    pub(crate) fn listed(&self) -> String {
        const FEW: usize = 8;
        if self.images.len() > FEW {
            let mut classes: Vec<u8> = self.images.iter().map(|image| image.label).collect();
            classes.sort_unstable();
            classes.dedup();
            return format!("{} images of {} classes", self.images.len(), classes.len());
        }
        let image = |image: &ImageRef| image.called(Split::Train, &self.names);
        self.images.iter().map(image).collect::<Vec<_>>().join(", ")
    }

    /// Returns the answers to the images, given displacements in their order; the rest are pending.
    pub fn answers(&self, displacements: impl IntoIterator<Item = Option<f64>>) -> Vec<Answer> {
        answers(&self.images, displacements)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::response::objective::GaitResponse;
    use crate::sim::Physics;
    use crate::task::objective::Objective;
    use crate::task::perturbation::of_response;

    /// Two classes of built-in digits, six images of each.
    const CONFIG: &str =
        "[task]\ngroups = [[0], [1]]\n[data]\ndataset = \"builtin\"\nimages_per_class = 6\n";

    fn config(more: &str, set: &[&str]) -> Result<Config, Error> {
        let set: Vec<String> = set.iter().map(ToString::to_string).collect();
        Config::parse(&format!("{CONFIG}{more}"), "a.toml", &set)
    }

    const RESPONSE: &str = "[evaluation]\nfitness = \"response\"\n";

    #[test]
    fn images_are_pairs_of_opposites_where_training_images_differ_and_the_same_for_the_same_seed() {
        let images = |more: &str, seed: &str| {
            TrainingImages::load(&config(more, &[&format!("seed={seed}")]).unwrap(), None).unwrap()
        };
        let (plain, random) = (images("", "1"), images(RESPONSE, "1"));
        assert_eq!(random.images, plain.images);
        assert_eq!(random.stimuli.len(), 12);
        let (mut seen, mut changing) = ([0, 0, 0], 0);
        for (place, first) in plain.stimuli[0].iter() {
            let changes = plain.stimuli.iter().any(|other| other[place] != *first);
            changing += usize::from(changes);
            for pair in random.stimuli.chunks(2) {
                let (a, b) = (pair[0][place], pair[1][place]);
                match changes {
                    true if a == b => seen[2] += 1,
                    true => {
                        assert_eq!((a.max(b), a.min(b)), (1.0, 0.0), "{place:?}");
                        seen[usize::from(a == 1.0)] += 1;
                    }
                    false => assert_eq!((a, b), (*first, *first), "{place:?}"),
                }
            }
        }
        let all = 6.0 * changing as f64;
        for (seen, expected) in seen.into_iter().zip([0.4, 0.4, 0.2]) {
            assert!(
                (f64::from(seen) / all - expected).abs() < 0.1,
                "{seen} of {all}: expected {expected}"
            );
        }
        assert!(changing > 20);
        let opposites = |seed| {
            GaitResponse
                .prepare(plain.stimuli.clone(), &Physics::default(), seed)
                .0
        };
        assert_eq!(opposites(1), random.stimuli);
        assert_ne!(opposites(2), random.stimuli);
    }

    #[test]
    fn every_second_pair_is_shown_from_a_raised_start_without_length_limits() {
        let [ground, raised] = of_response();
        let training = TrainingImages::load(&config(RESPONSE, &[]).unwrap(), None).unwrap();
        assert_eq!(
            training.conditions[..6],
            [&ground, &ground, &raised, &raised, &ground, &ground].map(Clone::clone)
        );
        assert_eq!(training.conditions.len(), 12);
        let plain = TrainingImages::load(&config("", &[]).unwrap(), None).unwrap();
        assert!(plain.conditions.is_empty());
    }

    #[test]
    fn what_does_not_go_with_a_response_is_refused_with_its_key() {
        assert!(config(RESPONSE, &[]).is_ok());
        assert!(config(RESPONSE, &["data.images_per_class=4"]).is_ok());
        assert!(
            config(
                RESPONSE,
                &["genome.voxel_mutations=0.5", "genome.voxel_changes=4"]
            )
            .is_ok()
        );
        let refused = [
            (
                "data.images_per_class=3",
                "data.images_per_class = 3",
                "8 or more",
            ),
            (
                "data.train_images=[0, 1, 2, 3, 4, 5, 6, 7, 8]",
                "data.train_images = 9 images",
                "an even number",
            ),
            (
                "protocol.rollout=\"sequential\"",
                "protocol.rollout = \"sequential\"",
                "\"fresh\"",
            ),
        ];
        for (set, found, expected) in refused {
            let message = config(RESPONSE, &[set]).unwrap_err().message;
            assert!(
                message.contains(found) && message.contains(expected),
                "{set}: {message}"
            );
            assert!(
                message.contains("evaluation.fitness = \"response\""),
                "{set}: {message}"
            );
            assert!(
                config("", &[set]).is_ok(),
                "{set}: it is no error by itself"
            );
        }
        let splits = CONFIG.replace("groups = [[0], [1]]", "splits = [0, 1, 2]");
        let message = Config::parse(&format!("{splits}{RESPONSE}"), "a.toml", &[])
            .unwrap_err()
            .message;
        assert!(
            message.contains("a.toml:2: task.splits = 3 tasks: "),
            "{message}"
        );
        assert!(message.contains("one task, as groups"), "{message}");
    }
}
