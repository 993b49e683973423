//! The images that `eval` shows, and what takes no body on them.

use crate::analysis::baselines::{Labelled, best_pixel, larger_group, nearest_training_image};
use crate::base::Grid;
use crate::base::error::Error;
use crate::commands::eval::Options;
use crate::config::Config;
use crate::data::dataset::{Dataset, Split};
use crate::images::held_out;
use crate::images::held_out::images_besides;
use crate::images::training::Training;
use crate::images::whereabouts::{see, see_all};
use crate::store::eval::Baselines;
use crate::store::images::{HeldOut, ImageRef};
use crate::store::run::RunFile;
use crate::store::run::StoredRun;
use crate::store::validation::shown as shown_for_validation;
use crate::task::grouping;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// Training images per class on which the single-pixel baseline is chosen.
const PIXEL_IMAGES_PER_CLASS: usize = 500;

/// Test or validation images, and how robots see them.
pub(crate) struct HeldOutImages<'a> {
    config: &'a Config,
    dataset: &'a Dataset,
    options: &'a Options,
    /// The images.
    pub images: Vec<ImageRef>,
    /// Of each, as all robots see it together.
    stimuli: Vec<Grid<f64>>,
}

impl<'a> HeldOutImages<'a> {
    /// As many as asked for, evenly divided between the classes; the first classes get what is left
    /// over. `config`: of the runs, with what their robots see together.
    ///
    /// # Errors
    /// If there are not enough images, or not one of each class is asked for.
    pub fn draw(
        config: &'a Config,
        sources: &[StoredRun],
        dataset: &'a Dataset,
        options: &'a Options,
    ) -> Result<Self, Error> {
        let (asked, least) = (options.images, config.classes().len());
        if !asked.has_each(least) {
            let text = format!("expected {least} or more, one of each class");
            return Err(Error::argument("images", asked, text));
        }
        let classes = config.classes();
        let images = match options.split {
            HeldOut::Test => held_out::test_images(&classes, dataset, asked, options.seed)?,
            HeldOut::Validation => {
                let runs: Vec<_> = sources.iter().map(|source| &source.run).collect();
                // Now, or before: those of `validation.json`.
                let count = |source: &StoredRun| match options.robots.validated() {
                    Some(_) => Ok(Some(options.validation.unwrap_or(config.validation.images))),
                    None => shown_for_validation(source),
                };
                let besides = chosen_by(sources, dataset, count)?;
                images_besides(&besides, &runs, &classes, dataset, Some("images"), asked)?
            }
        };
        let split = options.split.split();
        let stimuli = see_all(config, dataset, split, &images)?;
        // What a run's robots cannot see is found before any is shown one, by every rank.
        if let Some(first) = images.first() {
            for source in sources {
                see(&source.run.config, dataset, split, first.index)?;
            }
        }
        Ok(HeldOutImages { config, dataset, options, images, stimuli })
    }

    /// As robots of a run see them, in the order of the images.
    ///
    /// # Errors
    /// If an image cannot be drawn or seen.
    pub fn seen_by(&self, config: &Config) -> Result<Cow<'_, [Grid<f64>]>, Error> {
        match config.stimulus == self.config.stimulus {
            true => Ok(Cow::Borrowed(&self.stimuli)),
            false => see_all(config, self.dataset, self.options.split.split(), &self.images).map(Cow::Owned),
        }
    }

    /// The baselines of each of these tasks, by the names that their robots' runs have for them.
    ///
    /// # Errors
    /// If an image cannot be drawn or seen.
    pub fn baselines<'t>(
        &self,
        sources: &[StoredRun],
        tasks: impl Iterator<Item = (&'t str, &'t grouping::Split)>,
    ) -> Result<BTreeMap<String, Baselines>, Error> {
        let seen = |images: &[ImageRef]| -> Result<Vec<(Grid<f64>, u8)>, Error> {
            let stimulus = |index| see(self.config, self.dataset, Split::Train, index);
            images.iter().map(|image| Ok((stimulus(image.index)?, image.label))).collect()
        };
        let choice = seen(&self.pixel_images()?)?;
        // In another dataset, a run's training images are other ones.
        let is_own = self.dataset.name() == self.config.data.dataset;
        let of_runs = sources.iter().map(|source| {
            let path = source.path.display().to_string();
            let own = taught_with(&source.run, self.dataset).and_then(|images| seen(&images));
            let own = own.map_err(|error| error.in_place("training_images").in_place(&path))?;
            Ok((source.run.config.grouping()?, own))
        });
        let of_runs = is_own.then(|| of_runs.collect::<Result<Vec<_>, Error>>()).transpose()?;
        let shown = self.stimuli.iter().zip(&self.images);
        let shown: Vec<Labelled> =
            shown.map(|(stimulus, image)| Labelled { stimulus, class: image.label }).collect();
        let mut all = BTreeMap::new();
        for (name, task) in tasks {
            if all.contains_key(name) {
                continue;
            }
            let rule = best_pixel(task, &labelled(&choice));
            let nearest_of_all = of_runs.as_ref().map(|all| {
                // Of the runs that have the task.
                let having = all.iter().filter(|(grouping, _)| grouping.tasks().contains(task));
                let nearest = having.map(|(_, own)| nearest_training_image(task, &labelled(own), &shown));
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

    /// Training images to choose a single pixel by; none of those shown.
    fn pixel_images(&self) -> Result<Vec<ImageRef>, Error> {
        let shown: BTreeSet<usize> = match self.options.split {
            HeldOut::Test => BTreeSet::new(),
            HeldOut::Validation => self.images.iter().map(|image| image.index).collect(),
        };
        let mut choice = Vec::new();
        for label in self.config.classes() {
            let count = self.dataset.indices_of(Split::Train, label).len().min(PIXEL_IMAGES_PER_CLASS);
            let drawn = self.dataset.draw(Split::Train, &[label], count, self.options.seed);
            let drawn = drawn.map_err(|error| Error::input(error.to_string()))?;
            let others = drawn.into_iter().filter(|index| !shown.contains(index));
            choice.extend(others.map(|index| ImageRef { index, label }));
        }
        Ok(choice)
    }
}

/// The images that a run's robots were trained on: of a training, all that it learnt from, and not
/// only the last, which stand in its file.
fn taught_with(run: &RunFile, dataset: &Dataset) -> Result<Vec<ImageRef>, Error> {
    match run.origin {
        Some(_) => Training::images(&run.config, dataset),
        None => Ok(run.training_images.clone()),
    }
}

fn labelled(list: &[(Grid<f64>, u8)]) -> Vec<Labelled<'_>> {
    list.iter().map(|(stimulus, class)| Labelled { stimulus, class: *class }).collect()
}

/// Validation images that robots of each run are chosen by, as many of them as `count` says of each.
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
