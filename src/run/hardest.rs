//! Which of many images are hard to tell from another class: what a stage's `pool` chooses by.
//!
//! Bodies that know 99 % of all images are right on a few dozen random ones, which then no longer tell the good from the
//! better. Most of what they get wrong lies where the classes meet (docs/experiments.md).

use crate::base::Grid;
use crate::base::stop::{Stopped, check};
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// Of the same class so many of the nearest images say how far away its own kind is: one alone may be a double.
const OWN: usize = 5;

/// Images between two looks at whether to stop.
const AT_ONCE: usize = 32;

/// Of the images of each class the `per_class` hardest, in their order: those that lie farthest from the nearest of their
/// own class in proportion to the nearest image of another one, in what sensors see (squared distance; one more in both,
/// as distances may be 0). `stimuli` go with `labels`.
///
/// # Errors
/// [`Stopped`] if `stop` was set meanwhile.
pub(super) fn hardest(
    labels: &[u8],
    stimuli: &[Grid<f64>],
    per_class: usize,
    stop: &AtomicBool,
) -> Result<Vec<usize>, Stopped> {
    let hardness = |number: usize| {
        // What is quick is done all the same: a run that is stopped as it begins has its folder.
        if number % AT_ONCE == AT_ONCE - 1 {
            check(stop)?;
        }
        let (mut own, mut other) = (Vec::new(), f64::INFINITY);
        for (i, (label, stimulus)) in labels.iter().zip(stimuli).enumerate() {
            if i != number {
                let distance = distance(stimulus, &stimuli[number]);
                if *label == labels[number] {
                    own.push(distance);
                } else {
                    other = distance.min(other);
                }
            }
        }
        own.sort_by(f64::total_cmp);
        own.truncate(OWN);
        let own = own.iter().sum::<f64>() / own.len().max(1) as f64;
        Ok(((1.0 + own) / (1.0 + other), number))
    };
    let ranked: Result<Vec<(f64, usize)>, Stopped> =
        (0..labels.len()).into_par_iter().map(hardness).collect();
    let mut ranked = ranked?;
    // Stable: of equally hard images the first drawn.
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut taken = [0; 256];
    let mut chosen: Vec<usize> = Vec::new();
    for (_, number) in ranked {
        let taken = &mut taken[usize::from(labels[number])];
        if *taken < per_class {
            *taken += 1;
            chosen.push(number);
        }
    }
    chosen.sort_unstable();
    Ok(chosen)
}

fn distance(a: &Grid<f64>, b: &Grid<f64>) -> f64 {
    a.cells().iter().zip(b.cells()).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::stop::NEVER;

    fn hardest(labels: &[u8], stimuli: &[Grid<f64>], per_class: usize) -> Vec<usize> {
        super::hardest(labels, stimuli, per_class, &NEVER).unwrap()
    }

    /// Images of one row of pixels, by class.
    fn pool(images: &[(u8, &str)]) -> (Vec<u8>, Vec<Grid<f64>>) {
        let stimulus = |row: &str| row.bytes().map(|b| f64::from(b - b'0') / 9.0).collect::<Vec<_>>();
        let stimuli = images.iter().map(|(_, row)| Grid::from_rows(vec![stimulus(row)]).unwrap()).collect();
        (images.iter().map(|(label, _)| *label).collect(), stimuli)
    }

    #[test]
    fn images_between_the_classes_are_the_hardest() {
        let (labels, stimuli) = pool(&[
            (0, "990000"),
            (0, "990900"),
            (0, "900099"),
            (1, "000099"),
            (1, "000999"),
            (1, "990099"),
            (0, "990000"),
        ]);
        // 2 and 5 are a pixel away from each other; the others have their own kind nearer.
        assert_eq!(hardest(&labels, &stimuli, 1), [2, 5]);
        assert_eq!(hardest(&labels, &stimuli, 2).len(), 4);
        // As many as there are, in their order.
        assert_eq!(hardest(&labels, &stimuli, 9), [0, 1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn doubles_and_lone_images_are_ranked_all_the_same() {
        let (labels, stimuli) = pool(&[(0, "90"), (1, "90"), (0, "90")]);
        assert_eq!(hardest(&labels, &stimuli, 1), [0, 1]);
        let (labels, stimuli) = pool(&[(0, "90"), (0, "99")]);
        assert_eq!(hardest(&labels, &stimuli, 1), [0]);
        assert!(hardest(&[], &[], 3).is_empty());
    }
}
