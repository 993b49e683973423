//! Simple classifiers without a body, to compare a robot's accuracy with.

use crate::base::Grid;
use crate::baseline::nearest::nearest;
use crate::task::fitness::Group;
use crate::task::grouping::ClassSplit;

/// An image as the sensors see it, with its class.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LabelledImage<'a> {
    /// H × W in [0, 1].
    pub(crate) stimulus: &'a Grid<f64>,
    pub(crate) class: u8,
}

/// A classifier by one pixel: above its threshold one group, else the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PixelRule {
    pub(crate) row: usize,
    pub(crate) column: usize,
    /// The threshold, in [0, 1].
    pub(crate) level: f64,
    pub(crate) above: Group,
}

/// Returns the accuracy of always answering with the larger group.
pub(crate) fn larger_group(split: &ClassSplit, images: &[LabelledImage]) -> f64 {
    let a = images
        .iter()
        .filter(|image| split.group(image.class) == Some(Group::A))
        .count();
    a.max(images.len() - a) as f64 / images.len().max(1) as f64
}

/// Returns the pixel and threshold that best separate the groups; the first in reading order wins.
pub(crate) fn best_pixel(split: &ClassSplit, images: &[LabelledImage]) -> Option<PixelRule> {
    let first = images.first()?.stimulus;
    let total_a = images
        .iter()
        .filter(|image| split.group(image.class) == Some(Group::A))
        .count();
    let mut best: Option<(usize, PixelRule)> = None;
    for row in 0..first.height() {
        for column in 0..first.width() {
            let value = |image: &LabelledImage| image.stimulus.or_default((row, column));
            let mut sorted: Vec<(f64, bool)> = images
                .iter()
                .map(|i| (value(i), split.group(i.class) == Some(Group::A)))
                .collect();
            sorted.sort_by(|x, y| x.0.total_cmp(&y.0));
            // With the threshold after i images, A may be the answer below it, or B.
            let mut a_below = 0;
            for (i, (level, is_a)) in sorted.iter().enumerate() {
                a_below += usize::from(*is_a);
                if sorted.get(i + 1).is_some_and(|next| next.0 == *level) {
                    continue;
                }
                let b_below = i + 1 - a_below;
                let right_if_a_below = a_below + (images.len() - total_a - b_below);
                for (right, above) in [
                    (right_if_a_below, Group::B),
                    (images.len() - right_if_a_below, Group::A),
                ] {
                    if best.as_ref().is_none_or(|(most, _)| right > *most) {
                        best = Some((
                            right,
                            PixelRule {
                                row,
                                column,
                                level: *level,
                                above,
                            },
                        ));
                    }
                }
            }
        }
    }
    best.map(|(_, rule)| rule)
}

impl PixelRule {
    /// Returns the fraction of images it answers correctly.
    pub(crate) fn accuracy(&self, split: &ClassSplit, images: &[LabelledImage]) -> f64 {
        let answer = |image: &LabelledImage| {
            let value = image.stimulus.or_default((self.row, self.column));
            if (value > self.level) == (self.above == Group::A) {
                Group::A
            } else {
                Group::B
            }
        };
        share(images, |image| {
            split.group(image.class) == Some(answer(image))
        })
    }
}

/// Returns the accuracy of answering with the group of the [`nearest`] training image.
pub(crate) fn nearest_training_image(
    split: &ClassSplit,
    training: &[LabelledImage],
    images: &[LabelledImage],
) -> f64 {
    let known = || {
        training
            .iter()
            .filter_map(|other| Some((other.stimulus, split.group(other.class)?)))
    };
    share(images, |image| {
        let answer = nearest(known(), image.stimulus);
        answer.is_some() && answer == split.group(image.class)
    })
}

fn share(images: &[LabelledImage], is_right: impl Fn(&LabelledImage) -> bool) -> f64 {
    images.iter().filter(|image| is_right(image)).count() as f64 / images.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::grouping::Grouping;

    fn grid(cells: [f64; 4]) -> Grid<f64> {
        Grid::from_fn(2, 2, |r, c| cells[2 * r + c])
    }

    #[test]
    fn the_best_pixel_is_found_with_its_threshold_and_sense() {
        let grouping = Grouping::two_groups(&[0], &[1, 2]).unwrap();
        let split = &grouping.tasks()[0];
        let zeros = [grid([0.1, 0.9, 0.0, 0.3]), grid([0.8, 0.7, 0.0, 0.4])];
        let others = [grid([0.1, 0.2, 0.0, 0.3]), grid([0.9, 0.4, 0.0, 0.9])];
        let of =
            |list: &'static [u8], grids: &'static [Grid<f64>]| -> Vec<LabelledImage<'static>> {
                list.iter()
                    .zip(grids)
                    .map(|(&class, stimulus)| LabelledImage { stimulus, class })
                    .collect()
            };
        let zeros: &'static _ = Box::leak(Box::new(zeros));
        let others: &'static _ = Box::leak(Box::new(others));
        let images = [of(&[0, 0], zeros), of(&[1, 2], others)].concat();
        let rule = best_pixel(split, &images).unwrap();
        assert_eq!(
            rule,
            PixelRule {
                row: 0,
                column: 1,
                level: 0.4,
                above: Group::A
            }
        );
        assert_eq!(rule.accuracy(split, &images), 1.0);
        assert_eq!(rule.accuracy(split, &images[2..]), 1.0);
        assert_eq!(larger_group(split, &images[1..]), 2.0 / 3.0);
        assert_eq!(nearest_training_image(split, &images[..3], &images), 0.75);
        // The same image, labelled once as a zero and twice as others.
        let same = |class: u8| LabelledImage { class, ..images[0] };
        let known = [same(0), same(1), same(2)];
        assert_eq!(nearest_training_image(split, &known, &[same(1)]), 1.0);
        assert_eq!(nearest_training_image(split, &known[..2], &[same(0)]), 1.0);
        assert_eq!(nearest_training_image(split, &[], &[same(0)]), 0.0);
        assert_eq!(best_pixel(split, &[]), None);
    }
}
