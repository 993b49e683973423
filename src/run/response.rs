//! Runs with `fitness = "response"`: what their images are, what a gait is worth, and which configs there can be.

use super::curriculum::Period;
use super::{Config, Error};
use crate::base::Grid;
use crate::base::random::{Purpose, stream};
use crate::body::{Body, key};
use crate::sim::Physics;
use crate::task::condition::Condition;
use crate::task::fitness::{Fitness, response_so_far};
use crate::task::protocol::Life;
use crate::task::response::random_image;

/// Fewest images that a response is measured under: two pairs in each condition, to differ.
const LEAST_IMAGES: usize = 8;

/// Share of what is to be beaten that a body must show after the first pairs to be shown the others. With more, chance decides;
/// with less, hopeless ones cost as much as good ones.
const WORTH_GOING_ON: f64 = 0.5;

/// As many images as there are training images, an even number, in pairs: one whose pixels are bright, dark or at rest at random, each
/// independently of all others, and its opposite. Pixels that are the same in all training images stay so: what never changes
/// says nothing.
pub(super) fn opposites(
    stimuli: &[Grid<f64>],
    physics: &Physics,
    seed: u64,
    period: Period,
) -> Vec<Grid<f64>> {
    let Some(first) = stimuli.first() else { return Vec::new() };
    let changes = Grid::from_fn(first.height(), first.width(), |row, column| {
        stimuli.iter().any(|other| other[(row, column)] != first[(row, column)])
    });
    let pair = |number: u64| {
        let mut random = stream(seed, Purpose::RandomImages, period.number(), number);
        let drawn = random_image(first.height(), first.width(), physics, &mut random);
        [false, true].map(|is_opposite| {
            Grid::from_fn(first.height(), first.width(), |row, column| {
                let pixel = drawn[(row, column)];
                match changes[(row, column)] {
                    false => first[(row, column)],
                    // What is at rest is so in both.
                    true if is_opposite && (pixel == 0.0 || pixel == 1.0) => 1.0 - pixel,
                    true => pixel,
                }
            })
        })
    };
    (0..stimuli.len() as u64 / 2).flat_map(pair).collect()
}

/// Under what each of so many images is shown: both of a pair under the same.
pub(super) fn conditions(images: usize) -> Vec<Condition> {
    Condition::OF_RESPONSE.into_iter().flat_map(|condition| [condition; 2]).cycle().take(images).collect()
}

/// Whether a body that is to beat a response is so far from it after the first half of its pairs, two of each condition at least,
/// that the rest is not worth simulating.
pub(super) fn is_left_behind(known: &[Option<f64>], to_beat: f64) -> bool {
    // Two images a pair; as many pairs of each condition as of the other.
    let first = (known.len() / 8 * 4).max(LEAST_IMAGES).min(known.len());
    known[..first].iter().all(Option::is_some)
        && to_beat > 0.0
        && response_so_far(known[..first].iter().copied())
            .is_some_and(|response| response < WORTH_GOING_ON * to_beat)
}

impl Config {
    /// Whether fitness is a response in a period: of the bodies' probes, under shuffled images.
    pub fn measures_response(&self, period: Period) -> bool {
        self.criterion_in(period).fitness == Fitness::Response
    }

    /// What stands for a body among those that were evaluated in a period: itself, or what a response is measured with, so that a
    /// gait is evaluated once, whatever its sensors are.
    pub(super) fn known_key(&self, body: &Body, period: Period) -> [u8; 16] {
        match self.measures_response(period) {
            true => key(&body.probe()),
            false => key(body),
        }
    }

    /// By what the fitness of a body is multiplied in a period: 1, or, if it is a response, the square root of the number of its
    /// soft voxels and sensors, up to a third of its grid. Of two gaits that respond as strongly, the one with more places can
    /// be taught more: together they can move it by at most so much (Cauchy's inequality), and by that only if all respond
    /// alike. More than a third leave too little that walks.
    pub(super) fn worth_of_places(&self, body: &Body, period: Period) -> f64 {
        match self.measures_response(period) {
            true => {
                let most = body.height() * body.width() / 3;
                (body.probe().counts().sensor.clamp(1, most.max(1)) as f64).sqrt()
            }
            false => 1.0,
        }
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
        let enough = format!("an even number of training images in all, {LEAST_IMAGES} or more");
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
            (images < LEAST_IMAGES || images % 2 == 1, images_key, found, enough.as_str()),
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
