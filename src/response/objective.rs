//! [`GaitResponse`]: the objective of runs with `fitness = "response"`.

use crate::base::Grid;
use crate::base::random::{Purpose, stream};
use crate::body::Body;
use crate::response::gait::random_image;
use crate::sim::Physics;
use crate::task::answer::Answer;
use crate::task::evaluation::MayWin;
use crate::task::fitness::LEAST_IMAGES;
use crate::task::fitness::response_so_far;
use crate::task::grouping::Grouping;
use crate::task::objective::Objective;
use crate::task::perturbation::{Condition, of_response};
use std::borrow::Cow;

/// Index of evolution's random images, unlike that of a training's, which is 0.
const OF_EVOLUTION: u64 = 1 << 32;

/// Fraction of the response to beat that a body must reach after the first pairs. With more, chance
/// decides; with less, hopeless bodies cost as much as good ones.
const WORTH_GOING_ON: f64 = 0.5;

/// Returns as many images as there are training images, in pairs: one with pixels bright, dark or
/// at rest at random, and its opposite. Pixels that never differ in training keep their values.
fn opposites(stimuli: &[Grid<f64>], physics: &Physics, seed: u64) -> Vec<Grid<f64>> {
    let Some(first) = stimuli.first() else {
        return Vec::new();
    };
    let changes = Grid::from_fn(first.height(), first.width(), |row, column| {
        stimuli
            .iter()
            .any(|other| other[(row, column)] != first[(row, column)])
    });
    let pair = |number: u64| {
        let mut random = stream(seed, Purpose::RandomImages, OF_EVOLUTION, number);
        let drawn = random_image(first.height(), first.width(), physics, &mut random);
        [false, true].map(|is_opposite| {
            Grid::from_fn(first.height(), first.width(), |row, column| {
                let pixel = drawn[(row, column)];
                match changes[(row, column)] {
                    false => first[(row, column)],
                    // A pixel at rest is so in both.
                    true if is_opposite && (pixel == 0.0 || pixel == 1.0) => 1.0 - pixel,
                    true => pixel,
                }
            })
        })
    };
    (0..stimuli.len() as u64 / 2).flat_map(pair).collect()
}

/// Returns the condition of each image; both images of a pair have the same.
fn conditions(images: usize) -> Vec<Condition> {
    of_response()
        .into_iter()
        .flat_map(|condition| [condition.clone(), condition])
        .cycle()
        .take(images)
        .collect()
}

/// True if, after half of its pairs (at least two a condition), a body is hopelessly behind.
fn is_left_behind(known: &[Option<f64>], to_beat: f64) -> bool {
    // Two images a pair; equally many pairs of each condition.
    let first = (known.len() / 8 * 4).max(LEAST_IMAGES).min(known.len());
    known[..first].iter().all(Option::is_some)
        && to_beat > 0.0
        && response_so_far(known[..first].iter().copied())
            .is_some_and(|response| response < WORTH_GOING_ON * to_beat)
}

/// The response of a gait: the probe of a body, all of whose soft voxels and sensors see a pixel,
/// walks under random images.
pub(crate) struct GaitResponse;

impl Objective for GaitResponse {
    fn prepare(
        &self,
        stimuli: Vec<Grid<f64>>,
        physics: &Physics,
        seed: u64,
    ) -> (Vec<Grid<f64>>, Vec<Condition>) {
        (
            opposites(&stimuli, physics, seed),
            conditions(stimuli.len()),
        )
    }

    fn simulated<'b>(&self, body: &'b Body) -> Cow<'b, Body> {
        Cow::Owned(body.probe())
    }

    /// A gait whose response is known would fill the archive with its sensors.
    fn may_repeat(&self) -> bool {
        false
    }

    /// √(number of soft voxels and sensors), up to two thirds of the grid: together they can move a
    /// gait by at most this factor (Cauchy's inequality), if all respond alike. Limited because
    /// something has to walk.
    fn factor(&self, body: &Body) -> f64 {
        let most = body.height() * body.width() * 2 / 3;
        (body.probe().counts().sensor.clamp(1, most.max(1)) as f64).sqrt()
    }

    /// The first pairs decide whether the others are worth it.
    fn order(&self, _: &Grouping, _: Option<&[Answer]>) -> Vec<usize> {
        Vec::new()
    }

    fn given_up(&self, to_beat: &[Option<f64>]) -> Option<Box<MayWin<'static>>> {
        let least = to_beat
            .iter()
            .flatten()
            .fold(f64::INFINITY, |least, next| least.min(*next));
        Some(Box::new(move |known| {
            least.is_finite() && is_left_behind(known, least)
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_is_left_behind_by_the_first_half_of_its_pairs_alone() {
        let known = |d: &[f64]| -> Vec<Option<f64>> {
            d.iter()
                .map(|d| Some(*d))
                .chain(std::iter::repeat(None))
                .take(16)
                .collect()
        };
        let pairs = [3.0, -3.0, 2.0, -2.0, -1.0, 1.0, -2.0, 2.0];
        let response = 4.5_f64.sqrt();
        assert!(is_left_behind(&known(&pairs), 2.01 * response));
        assert!(
            !is_left_behind(&known(&pairs), 1.99 * response)
                && !is_left_behind(&known(&pairs), -9.0)
        );
        assert!(!is_left_behind(&known(&pairs[..7]), 1e9));
        let more: Vec<f64> = pairs.into_iter().chain([900.0, -900.0, 0.0, 0.0]).collect();
        assert!(is_left_behind(&known(&more), 2.01 * response));
    }
}
