//! Runs with `fitness = "response"`: what their images are, and which configs there can be.

use super::curriculum::Period;
use super::{Config, Error};
use crate::base::Grid;
use crate::base::random::{Purpose, stream};
use crate::task::fitness::Fitness;
use crate::task::protocol::Life;

/// Fewest images that a response is measured under: two in each condition, to differ.
const LEAST_IMAGES: usize = 4;

/// As many images as these, made of their pixels: each pixel's values are given to the images in an order of its own, so that
/// a pixel is as often bright as it was, and says nothing of the others.
pub(super) fn shuffled(stimuli: &[Grid<f64>], seed: u64, period: Period) -> Vec<Grid<f64>> {
    let mut shuffled = stimuli.to_vec();
    let places: Vec<(usize, usize)> =
        stimuli.first().into_iter().flat_map(Grid::iter).map(|(place, _)| place).collect();
    for (number, place) in (0..).zip(places) {
        let mut random = stream(seed, Purpose::RandomImages, period.number(), number);
        let order = random.sample(stimuli.len(), stimuli.len());
        for (image, other) in shuffled.iter_mut().zip(order) {
            image[place] = stimuli[other][place];
        }
    }
    shuffled
}

impl Config {
    /// Whether fitness is a response in a period: of the bodies' probes, under shuffled images.
    pub fn measures_response(&self, period: Period) -> bool {
        self.criterion_in(period).fitness == Fitness::Response
    }

    /// Checks what goes with `fitness = "response"`, if it is asked for.
    pub(super) fn validate_response(&self) -> Result<(), Error> {
        if let Some(number) = self.stage.iter().position(|stage| stage.fitness == Some(Fitness::Response)) {
            let text =
                "fitness = \"response\": expected another, or this in [evaluation] of a run without stages";
            return Err(Error::input(format!("stage {}: {text}", number + 1)));
        }
        if self.evaluation.fitness != Fitness::Response {
            return Ok(());
        }
        let (tasks, classes) = (self.grouping()?.tasks().len(), self.classes().len());
        let per_class = self.data.images_per_class;
        let (images_key, found, images) = match &self.data.train_images {
            Some(named) => ("data.train_images", format!("{} images", named.len()), named.len()),
            None => ("data.images_per_class", per_class.to_string(), per_class.saturating_mul(classes)),
        };
        let enough = format!("{LEAST_IMAGES} training images or more in all");
        let checks = [
            (
                tasks > 1,
                "task.splits",
                format!("{tasks} tasks"),
                "one task, as groups = [[0], [1]]: a response belongs to no task",
            ),
            (!self.stage.is_empty(), "stage", format!("{} stages", self.stage.len()), "none"),
            (
                self.protocol.life == Life::Sequential,
                "protocol.life",
                "\"sequential\"".to_string(),
                "\"fresh\"",
            ),
            (
                self.genome.voxel_candidates > 1,
                "genome.voxel_candidates",
                self.genome.voxel_candidates.to_string(),
                "1: what candidates promise is told by a task",
            ),
            (
                self.genome.voxel_relatives > 0,
                "genome.voxel_relatives",
                self.genome.voxel_relatives.to_string(),
                "0: what relatives teach is told by a task",
            ),
            (images < LEAST_IMAGES, images_key, found, enough.as_str()),
        ];
        match checks.into_iter().find(|(is_wrong, ..)| *is_wrong) {
            Some((_, key, found, expected)) => Err(Error::input(format!(
                "{key} = {found}: with evaluation.fitness = \"response\" expected {expected}"
            ))),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
#[path = "response_tests.rs"]
mod tests;
