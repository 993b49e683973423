//! [`Training`]: the training images of a run, as its robots see them.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::config::Config;
use crate::data::dataset::{Dataset, DatasetError, Split};
use crate::images::whereabouts::{load_dataset, see};
use crate::store::images::{DatasetRef, ImageRef, answers};
use crate::task::perturbation::Condition;
use crate::task::score::Answer;
use std::path::Path;

/// The training images of a run and their stimuli.
#[derive(Clone, Debug)]
pub struct Training {
    /// Dataset of the images.
    pub dataset: DatasetRef,
    /// Images, in the order of a sequential rollout.
    pub images: Vec<ImageRef>,
    /// Stimuli, H × W in [0, 1]: the images as the sensors see them or, where a response is
    /// measured, as many made from their pixels.
    pub stimuli: Vec<Grid<f64>>,
    /// Condition of each stimulus in a fresh rollout; the default where one is missing.
    pub conditions: Vec<Condition>,
}

/// Returns the number of training images of the class that has fewest.
///
/// # Errors
/// If it is less than `least`, the error names the class and all classes of the dataset.
pub(crate) fn scarcest(dataset: &Dataset, classes: &[u8], least: usize) -> Result<usize, Error> {
    let counts = classes.iter().map(|class| (dataset.indices_of(Split::Train, *class).len(), *class));
    match counts.min() {
        Some((count, class)) if count < least => {
            let text = format!("class {class}: expected {least} training images or more, found {count}");
            let there = dataset.classes(Split::Train);
            Err(Error::input(text)
                .about("task")
                .advice(format!("{} has the classes {there:?}", dataset.name())))
        }
        scarcest => Ok(scarcest.map_or(0, |(count, _)| count)),
    }
}

impl Training {
    /// Loads the training images of a config.
    ///
    /// # Errors
    /// Returns an error if the data are missing or broken, if an image is of a class outside the
    /// task, or if a class has no image.
    pub fn load(config: &Config, data: Option<&Path>) -> Result<Self, Error> {
        Training::of(config, &load_dataset(config, data, &[Split::Train])?)
    }

    /// Returns the indices of the training images of a config.
    ///
    /// # Errors
    /// Returns an error if a class has too few images to draw from.
    pub fn indices(config: &Config, dataset: &Dataset) -> Result<Vec<usize>, Error> {
        match &config.data.train_images {
            Some(indices) => Ok(indices.clone()),
            None => dataset
                .draw(Split::Train, &config.classes(), config.data.images_per_class, config.seed)
                .map_err(|error| {
                    let there = dataset.classes(Split::Train);
                    Error::input(format!("data.images_per_class: {error}"))
                        .advice(format!("{} has the classes {there:?}", dataset.name()))
                }),
        }
    }

    /// Returns the training images of a config, at least one of each class of its task.
    ///
    /// # Errors
    /// As [`Training::load`].
    pub(crate) fn images(config: &Config, dataset: &Dataset) -> Result<Vec<ImageRef>, Error> {
        let refuse = |error: DatasetError| Error::input(format!("data.train_images: {error}"));
        let classes = config.classes();
        let mut images = Vec::new();
        for index in Training::indices(config, dataset)? {
            let label = dataset.label(Split::Train, index).map_err(refuse)?;
            if !classes.contains(&label) {
                let text =
                    format!("data.train_images: image {index} shows a {label}, expected one of {classes:?}");
                return Err(Error::input(text).remedy(Remedy::DrawTrainingImages));
            }
            images.push(ImageRef { index, label });
        }
        match classes.iter().find(|&&class| images.iter().all(|image| image.label != class)) {
            Some(class) => {
                let text = format!("data.train_images: expected an image of class {class}, found none");
                Err(Error::input(text).remedy(Remedy::DrawTrainingImages))
            }
            None => Ok(images),
        }
    }

    /// Takes the training images of a config from a loaded dataset.
    ///
    /// # Errors
    /// As [`Training::load`].
    pub fn of(config: &Config, dataset: &Dataset) -> Result<Self, Error> {
        let images = Training::images(config, dataset)?;
        let seen = |image: &ImageRef| see(config, dataset, Split::Train, image.index);
        let stimuli: Vec<Grid<f64>> = images.iter().map(seen).collect::<Result<_, _>>()?;
        let train_sha256 = dataset.fingerprint(Split::Train).expect("its images were read just now");
        let dataset = DatasetRef { name: dataset.name().to_string(), train_sha256 };
        let (stimuli, conditions) = config.objective().prepare(stimuli, &config.physics, config.seed);
        Ok(Training { dataset, images, stimuli, conditions })
    }

    /// Describes the images to the user, one by one if they are few.
    pub fn listed(&self) -> String {
        const FEW: usize = 8;
        if self.images.len() > FEW {
            let mut classes: Vec<u8> = self.images.iter().map(|image| image.label).collect();
            classes.sort_unstable();
            classes.dedup();
            return format!("{} images of {} classes", self.images.len(), classes.len());
        }
        let image = |image: &ImageRef| format!("{} (train {})", image.label, image.index);
        self.images.iter().map(image).collect::<Vec<_>>().join(", ")
    }

    /// Returns the answers to the images, given displacements in their order; the rest are pending.
    pub fn answers(&self, displacements: impl IntoIterator<Item = Option<f64>>) -> Vec<Answer> {
        answers(&self.images, displacements)
    }
}
