//! [`Training`]: the images a run evolves on, as its robots see them.

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

/// The images a run evolves on, and how they are shown.
#[derive(Clone, Debug)]
pub struct Training {
    /// Where they come from.
    pub dataset: DatasetRef,
    /// The images, in the order in which a sequential rollout sees them.
    pub images: Vec<ImageRef>,
    /// What the sensors see of each: H × W in [0, 1]. Where a response is measured, as many images
    /// of their pixels.
    pub stimuli: Vec<Grid<f64>>,
    /// Under what each is shown, in a fresh rollout; the default where one is missing.
    pub conditions: Vec<Condition>,
}

/// The number of training images of the scarcest of some classes, of a task that was asked for by
/// its name.
///
/// # Errors
/// If it is less than `least`; which class, and which there are.
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
    /// The training images of a config.
    ///
    /// # Errors
    /// If the data are missing or broken, or an image is of a class that is not in the task, or a
    /// class has no image.
    pub fn load(config: &Config, data: Option<&Path>) -> Result<Self, Error> {
        Training::of(config, &load_dataset(config, data, &[Split::Train])?)
    }

    /// Indices of the training images of a config.
    ///
    /// # Errors
    /// If a class has not as many images as are to be drawn.
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

    /// The training images of a config, one or more of each class of its task.
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

    /// The training images of a config, of a dataset that is loaded.
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

    /// The images for people: one by one if they are few.
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

    /// The answers that displacements under the images are, in their order; those that are missing
    /// are still to come.
    pub fn answers(&self, displacements: impl IntoIterator<Item = Option<f64>>) -> Vec<Answer> {
        answers(&self.images, displacements)
    }
}
