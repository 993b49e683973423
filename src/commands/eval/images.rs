//! Images of `eval`, and the baselines on them that need no body.

use crate::analysis::baselines::{LabelledImage, best_pixel, larger_group, nearest_training_image};
use crate::base::Grid;
use crate::base::error::Error;
use crate::config::Config;
use crate::data::dataset::{Dataset, Split};
use crate::images::held_out;
use crate::images::held_out::{images_besides, usual};
use crate::images::training::TrainingImages;
use crate::images::whereabouts::{stimuli_of, stimulus_of};
use crate::store::eval::Baselines;
use crate::store::images::{HeldOut, HowMany, ImageRef};
use crate::store::run::RunFile;
use crate::store::stored_run::StoredRun;
use crate::store::validation::most_images as shown_for_validation;
use crate::task::grouping;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// Training images per class on which the single-pixel baseline is chosen.
const PIXEL_IMAGES_PER_CLASS: usize = 500;

#[derive(Clone, Copy)]
pub(crate) struct Draw {
    /// `None`: [`usual`].
    pub(crate) images: Option<HowMany>,
    pub(crate) split: HeldOut,
    pub(crate) seed: u64,
    /// Number of validation images by which robots are chosen at the same time, if they are.
    pub(crate) choosing: Option<usize>,
}

/// Test or validation images, as robots see them.
pub(crate) struct HeldOutImages<'a> {
    config: &'a Config,
    dataset: &'a Dataset,
    draw: Draw,
    pub(crate) images: Vec<ImageRef>,
    /// Each image as all robots see it together.
    stimuli: Vec<Grid<f64>>,
}

impl<'a> HeldOutImages<'a> {
    /// Draws images, evenly divided between the classes; the first classes get the remainder. The
    /// robots of the runs see images together under `config`.
    pub(crate) fn draw(
        config: &'a Config,
        sources: &[StoredRun],
        dataset: &'a Dataset,
        draw: Draw,
    ) -> Result<Self, Error> {
        let classes = config.classes();
        let asked = draw
            .images
            .unwrap_or_else(|| usual(draw.split, &classes, dataset));
        let least = classes.len();
        if !asked.has_each(least) {
            let text = format!("expected {least} or more, one of each class");
            return Err(Error::argument("images", asked, text));
        }
        let images = match draw.split {
            HeldOut::Test => held_out::test_images(&classes, dataset, asked, draw.seed)?,
            HeldOut::Validation => {
                let runs: Vec<_> = sources.iter().map(|source| &source.run).collect();
                // Images that choose robots now, or did before, as `validation.json` says.
                let count = |source: &StoredRun| match draw.choosing {
                    Some(images) => Ok(Some(images)),
                    None => shown_for_validation(source),
                };
                let besides = chosen_by(sources, dataset, count)?;
                images_besides(&besides, &runs, &classes, dataset, Some("images"), asked)?
            }
        };
        let split = draw.split.split();
        let stimuli = stimuli_of(config, dataset, split, &images)?;
        // Every rank refuses images that a run's robots cannot see, before the first rollout.
        if let Some(first) = images.first() {
            for source in sources {
                stimulus_of(&source.run.config, dataset, split, first.index)?;
            }
        }
        Ok(HeldOutImages {
            config,
            dataset,
            draw,
            images,
            stimuli,
        })
    }

    /// Returns the images as robots of a run see them, in order.
    pub(crate) fn seen_by(&self, config: &Config) -> Result<Cow<'_, [Grid<f64>]>, Error> {
        match config.stimulus == self.config.stimulus {
            true => Ok(Cow::Borrowed(&self.stimuli)),
            false => stimuli_of(config, self.dataset, self.draw.split.split(), &self.images)
                .map(Cow::Owned),
        }
    }

    /// Returns the baselines of these tasks, by the names that the runs give them.
    pub(crate) fn baselines<'t>(
        &self,
        sources: &[StoredRun],
        tasks: impl Iterator<Item = (&'t str, &'t grouping::ClassSplit)>,
    ) -> Result<BTreeMap<String, Baselines>, Error> {
        let seen = |images: &[ImageRef]| -> Result<Vec<(Grid<f64>, u8)>, Error> {
            let stimulus = |index| stimulus_of(self.config, self.dataset, Split::Train, index);
            images
                .iter()
                .map(|image| Ok((stimulus(image.index)?, image.label)))
                .collect()
        };
        let choice = seen(&self.pixel_images()?)?;
        // In another dataset, the indices of training images mean other images.
        let is_own = self.dataset.name() == self.config.data.dataset;
        let of_runs = sources.iter().map(|source| {
            let path = source.path.display().to_string();
            let own = images_trained_on(&source.run, self.dataset).and_then(|images| seen(&images));
            let own = own.map_err(|error| error.in_place("training_images").in_place(&path))?;
            Ok((source.run.config.grouping()?, own))
        });
        let of_runs = is_own
            .then(|| of_runs.collect::<Result<Vec<_>, Error>>())
            .transpose()?;
        let shown = self.stimuli.iter().zip(&self.images);
        let shown: Vec<LabelledImage> = shown
            .map(|(stimulus, image)| LabelledImage {
                stimulus,
                class: image.label,
            })
            .collect();
        let mut all = BTreeMap::new();
        for (name, task) in tasks {
            if all.contains_key(name) {
                continue;
            }
            let rule = best_pixel(task, &labelled(&choice));
            let nearest_of_all = of_runs.as_ref().map(|all| {
                // The mean over the runs that have the task.
                let having = all
                    .iter()
                    .filter(|(grouping, _)| grouping.tasks().contains(task));
                let nearest =
                    having.map(|(_, own)| nearest_training_image(task, &labelled(own), &shown));
                let nearest: Vec<f64> = nearest.collect();
                nearest.iter().sum::<f64>() / nearest.len() as f64
            });
            let baselines = Baselines {
                larger_group: larger_group(task, &shown),
                best_single_pixel: rule.map_or(0.0, |rule| rule.accuracy(task, &shown)),
                pixel: rule.map_or([0, 0], |rule| [rule.row, rule.column]),
                nearest_training_image: nearest_of_all,
            };
            all.insert(name.to_string(), baselines);
        }
        Ok(all)
    }

    /// Draws training images to choose a single pixel by, without the evaluated ones.
    fn pixel_images(&self) -> Result<Vec<ImageRef>, Error> {
        let shown: BTreeSet<usize> = match self.draw.split {
            HeldOut::Test => BTreeSet::new(),
            HeldOut::Validation => self.images.iter().map(|image| image.index).collect(),
        };
        let mut choice = Vec::new();
        for label in self.config.classes() {
            let count = self
                .dataset
                .indices_of(Split::Train, label)
                .len()
                .min(PIXEL_IMAGES_PER_CLASS);
            let drawn = self
                .dataset
                .draw(Split::Train, &[label], count, self.draw.seed);
            let drawn = drawn.map_err(|error| Error::input(error.to_string()))?;
            let others = drawn.into_iter().filter(|index| !shown.contains(index));
            choice.extend(others.map(|index| ImageRef { index, label }));
        }
        Ok(choice)
    }
}

/// Returns all images a run's robots were trained on; the file of a training has only the last.
fn images_trained_on(run: &RunFile, dataset: &Dataset) -> Result<Vec<ImageRef>, Error> {
    match run.origin {
        Some(_) => TrainingImages::images(&run.config, dataset),
        None => Ok(run.training_images.clone()),
    }
}

fn labelled(list: &[(Grid<f64>, u8)]) -> Vec<LabelledImage<'_>> {
    list.iter()
        .map(|(stimulus, class)| LabelledImage {
            stimulus,
            class: *class,
        })
        .collect()
}

/// Returns the validation images that choose the robots of each run, `count` per run.
pub(crate) fn chosen_by(
    sources: &[StoredRun],
    dataset: &Dataset,
    count: impl Fn(&StoredRun) -> Result<Option<usize>, Error>,
) -> Result<BTreeSet<usize>, Error> {
    let mut all = BTreeSet::new();
    for source in sources {
        if let Some(count) = count(source)? {
            let of_run = held_out::images(&[&source.run], dataset, Some("validation"), count)?;
            all.extend(of_run.into_iter().map(|image| image.index));
        }
    }
    Ok(all)
}
