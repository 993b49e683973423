//! Runs with `fitness = "response"`: what their images are, what a gait is worth, and which configs there can be.

use crate::base::Grid;
use crate::base::random::{Purpose, stream};
use crate::config::evaluation::LEAST_IMAGES;
use crate::sim::Physics;
use crate::task::condition::Condition;
use crate::task::fitness::response_so_far;
use crate::task::response::random_image;

/// Which random images evolution shows: others than a training's, which are 0.
const OF_EVOLUTION: u64 = 1 << 32;

/// Share of what is to be beaten that a body must show after the first pairs to be shown the others. With more, chance decides;
/// with less, hopeless ones cost as much as good ones.
const WORTH_GOING_ON: f64 = 0.5;

/// As many images as there are training images, an even number, in pairs: one whose pixels are bright, dark or at rest at random, each
/// independently of all others, and its opposite. Pixels that are the same in all training images stay so: what never changes
/// says nothing.
pub(crate) fn opposites(stimuli: &[Grid<f64>], physics: &Physics, seed: u64) -> Vec<Grid<f64>> {
    let Some(first) = stimuli.first() else { return Vec::new() };
    let changes = Grid::from_fn(first.height(), first.width(), |row, column| {
        stimuli.iter().any(|other| other[(row, column)] != first[(row, column)])
    });
    let pair = |number: u64| {
        let mut random = stream(seed, Purpose::RandomImages, OF_EVOLUTION, number);
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
pub(crate) fn conditions(images: usize) -> Vec<Condition> {
    Condition::OF_RESPONSE.into_iter().flat_map(|condition| [condition; 2]).cycle().take(images).collect()
}

/// Whether a body that is to beat a response is so far from it after the first half of its pairs, two of each condition at least,
/// that the rest is not worth simulating.
pub(crate) fn is_left_behind(known: &[Option<f64>], to_beat: f64) -> bool {
    // Two images a pair; as many pairs of each condition as of the other.
    let first = (known.len() / 8 * 4).max(LEAST_IMAGES).min(known.len());
    known[..first].iter().all(Option::is_some)
        && to_beat > 0.0
        && response_so_far(known[..first].iter().copied())
            .is_some_and(|response| response < WORTH_GOING_ON * to_beat)
}

#[cfg(test)]
#[path = "response_tests.rs"]
mod tests;
