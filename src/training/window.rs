//! [`Windows`]: the part of the images that a gait is trained to look at.
//!
//! Some places of a gait move it far, others do not; some pixels distinguish two groups of images,
//! others do not. A window of the images, stretched over the body, brings them together. The
//! response alone predicts the result under a window, so many windows can be tried.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::random::{Purpose, Stream, stream};
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::body::Material;
use crate::config::Config;
use crate::data::dataset::{Dataset, Split};
use crate::response::design_problem::{DesignProblem, Example};
use crate::response::gait::Gait;
use crate::response::regression::Response;
use crate::store::images::ImageRef;
use crate::task::grouping::balanced;
use crate::task::margins::Margins;
use crate::task::stimulus::{StimulusParams, stimulus};
use rayon::prelude::*;

/// Windows evaluated in parallel. With more, the best is known less well; with fewer, cores idle.
const BATCH: usize = 20;

/// Most images by which windows are compared. More cost time and hardly change the best window.
const IMAGES: usize = 1000;

/// Image side by a window's least side. With more, small windows show all voxels almost the same.
const LEAST_SHARE: usize = 4;

/// Most pixels by which an edge moves when the best window is improved.
const NEAR: usize = 2;

/// Windows of the training images of a task.
pub(crate) struct Windows<'a> {
    /// Correct side, weight, and pixels.
    images: Vec<(f64, f64, Grid<u8>)>,
    config: &'a Config,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    /// Margins outside the window.
    pub(crate) margins: Margins,
    /// Predicted mean clipped margin of the answers under it.
    pub(crate) predicted: f64,
    /// Predicted mean clipped margin under the window of the config.
    pub(crate) predicted_before: f64,
}

impl<'a> Windows<'a> {
    /// Takes at most 1000 of these training images, which are in the order of their classes.
    pub(crate) fn of(
        config: &'a Config,
        dataset: &Dataset,
        images: &[ImageRef],
        [first, _]: &[Vec<u8>; 2],
    ) -> Result<Self, Error> {
        let some = || images.iter().step_by(images.len().div_ceil(IMAGES).max(1));
        let image = |(image, (right, weight)): (&ImageRef, (f64, f64))| {
            let pixels = dataset.image(Split::Train, image.index);
            let pixels = pixels.map_err(|error| Error::input(error.to_string()))?;
            Ok((right, weight, pixels))
        };
        let images = some()
            .zip(balanced(some().map(|image| image.label), first))
            .map(image);
        Ok(Windows {
            images: images.collect::<Result<_, Error>>()?,
            config,
        })
    }

    /// Returns the window with the best prediction among the config's own, windows anywhere, and
    /// near the best, `train.windows` in all. `told` is called with the number tried so far.
    pub(crate) fn best(
        &self,
        gait: &Gait,
        response: &Response,
        session: &Session,
        told: &dyn Fn(usize),
    ) -> Result<Found, Stopped> {
        let (margins, count) = (self.config.stimulus.margin, self.config.train.windows);
        let predicted = self.predicted(gait, response, margins);
        let mut best = Found {
            margins,
            predicted,
            predicted_before: predicted,
        };
        let mut tried = 1;
        while tried < count {
            session.check()?;
            let draw = |number: usize| {
                let mut random = stream(self.config.seed, Purpose::Windows, 0, number as u64);
                match tried < count / 2 {
                    true => self.anywhere(&mut random),
                    false => self.near(best.margins, &mut random),
                }
            };
            let drawn: Vec<Margins> = (tried..count.min(tried + BATCH)).map(draw).collect();
            let found: Vec<f64> = drawn
                .par_iter()
                .map(|margins| self.predicted(gait, response, *margins))
                .collect();
            for (margins, predicted) in drawn.into_iter().zip(found) {
                if predicted > best.predicted {
                    best = Found {
                        margins,
                        predicted,
                        ..best
                    };
                }
                tried += 1;
            }
            told(tried);
        }
        Ok(best)
    }

    /// Returns the predicted mean clipped margin under a window.
    fn predicted(&self, gait: &Gait, response: &Response, margin: Margins) -> f64 {
        let seen_as = StimulusParams {
            margin,
            ..self.config.stimulus
        };
        let (height, width) = (self.config.body.height, self.config.body.width);
        let example = |(right, weight, image): &(f64, f64, Grid<u8>)| {
            let seen = stimulus(image, height, width, &seen_as)
                .expect("a window leaves pixels, and areas fit any body");
            Example {
                right: *right,
                weight: *weight,
                ..Example::new(gait, &seen, &self.config.physics)
            }
        };
        let examples: Vec<Example> = self.images.iter().map(example).collect();
        let any = vec![Material::SensorExpand; gait.places().len()];
        let solved = |(draw, side)| {
            let examples = examples.iter().map(|example| (example, response.intercept));
            let mut problem = DesignProblem::predicted(examples, &response.slopes, &any, side);
            problem.solve(&mut stream(self.config.seed, Purpose::Windows, 1, draw));
            problem.objective()
        };
        [(0, 1.0), (1, -1.0)]
            .into_iter()
            .map(solved)
            .fold(f64::NEG_INFINITY, f64::max)
    }

    fn sides(&self) -> [usize; 2] {
        let (_, _, first) = self.images.first().expect("a task has training images");
        [first.height(), first.width()]
    }

    /// Draws a window of any size, anywhere.
    fn anywhere(&self, random: &mut Stream) -> Margins {
        let [rows, columns] = self.sides().map(|side| {
            let shown = least(side) + random.below(side - least(side) + 1);
            let before = random.below(side - shown + 1);
            (before, side - shown - before)
        });
        Margins {
            top: rows.0,
            bottom: rows.1,
            left: columns.0,
            right: columns.1,
        }
    }

    /// Draws a window near another.
    fn near(&self, margins: Margins, random: &mut Stream) -> Margins {
        let [height, width] = self.sides();
        let mut moved = |side: usize, before: usize, after: usize| {
            let [a, b] = [before, after]
                .map(|edge| (edge + random.below(2 * NEAR + 1)).saturating_sub(NEAR));
            if a + b + least(side) <= side {
                (a, b)
            } else {
                (before, after)
            }
        };
        let (top, bottom) = moved(height, margins.top, margins.bottom);
        let (left, right) = moved(width, margins.left, margins.right);
        Margins {
            top,
            right,
            bottom,
            left,
        }
    }
}

/// Returns the least side of a window of images with this side.
fn least(side: usize) -> usize {
    side.div_ceil(LEAST_SHARE)
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::response::regression::RandomRollout;
    use crate::task::stimulus::Reduction;

    /// A body of 4 × 4 voxels that only its lower right quarter moves, and images of 12 × 12 pixels
    /// whose classes differ only in the upper left quarter.
    struct Planted {
        config: Config,
        gait: Gait,
        response: Response,
    }

    impl Planted {
        fn new(windows: usize) -> Self {
            let gait = Gait::of(&"6666/6666/6666/6666".parse().unwrap()).unwrap();
            let mut random = stream(3, Purpose::RandomImages, 0, 0);
            let shown = |number: usize| {
                let widths: Vec<f64> = (0..16)
                    .map(|_| if random.unit() < 0.5 { 0.6 } else { 1.6 })
                    .collect();
                let moved = |place: &usize| place / 4 >= 2 && place % 4 >= 2;
                let displacement = (0..16)
                    .filter(moved)
                    .map(|place| 6.0 * (widths[place] - 1.1))
                    .sum();
                RandomRollout {
                    widths,
                    displacement,
                    condition: number % 2,
                }
            };
            let rollouts: Vec<RandomRollout> = (0..200).map(shown).collect();
            let mut config = Config::load("quickstart.toml", &[]).unwrap();
            (config.body.height, config.body.width) = (4, 4);
            (config.stimulus.reduction, config.train.windows) = (Reduction::Area, windows);
            Planted {
                config,
                gait,
                response: Response::of(&rollouts).unwrap(),
            }
        }

        fn windows(&self) -> Windows<'_> {
            let mut random = stream(4, Purpose::RandomImages, 0, 0);
            let mut image = |number: usize| {
                let right = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
                let image = Grid::from_fn(12, 12, |r, c| match r < 6 && c < 6 {
                    true => {
                        if right > 0.0 {
                            200
                        } else {
                            20
                        }
                    }
                    false => random.below(256) as u8,
                });
                (right, 0.01, image)
            };
            Windows {
                images: (0..100).map(&mut image).collect(),
                config: &self.config,
            }
        }

        fn best(&self) -> Found {
            self.windows()
                .best(&self.gait, &self.response, &Session::default(), &|_| ())
                .unwrap()
        }
    }

    #[test]
    fn what_tells_classes_apart_is_brought_to_where_the_body_is_moved() {
        let found = Planted::new(300).best();
        // The window ends within the quarter, below and on the right.
        let Margins {
            top,
            right,
            bottom,
            left,
        } = found.margins;
        assert!(bottom >= 5 && right >= 5, "{found:?}");
        assert!(top < 6 && left < 6, "{found:?}");
        assert!(found.predicted > found.predicted_before + 0.3, "{found:?}");
    }

    #[test]
    fn one_window_is_that_of_the_config_and_more_are_never_worse() {
        let mut planted = Planted::new(1);
        planted.config.stimulus.margin = Margins {
            top: 1,
            right: 2,
            bottom: 3,
            left: 4,
        };
        let found = planted.best();
        assert_eq!(
            (found.margins, found.predicted),
            (planted.config.stimulus.margin, found.predicted_before)
        );
        let mut told = Vec::new();
        for windows in [2, 21, 90] {
            planted.config.train.windows = windows;
            let counted = std::sync::Mutex::new(0);
            let tell = |tried: usize| *counted.lock().unwrap() = tried;
            let found = planted
                .windows()
                .best(&planted.gait, &planted.response, &Session::default(), &tell)
                .unwrap();
            assert!(
                found.predicted >= found.predicted_before,
                "{windows}: {found:?}"
            );
            told.push(*counted.lock().unwrap());
        }
        assert_eq!(told, [2, 21, 90]);
    }

    #[test]
    fn windows_lie_in_the_image_and_are_not_too_small() {
        let planted = Planted::new(1);
        let windows = planted.windows();
        let mut random = stream(5, Purpose::Windows, 0, 0);
        let mut last = Margins::default();
        let mut edges = [false; 4];
        for _ in 0..2000 {
            for margins in [
                windows.anywhere(&mut random),
                windows.near(last, &mut random),
            ] {
                let Margins {
                    top,
                    right,
                    bottom,
                    left,
                } = margins;
                assert!(
                    top + bottom <= 12 - 3 && left + right <= 12 - 3,
                    "{margins:?}"
                );
                last = margins;
            }
            let Margins {
                top,
                right,
                bottom,
                left,
            } = last;
            edges = [
                edges[0] || top == 0,
                edges[1] || right == 0,
                edges[2] || bottom == 9,
                edges[3] || left == 9,
            ];
        }
        assert_eq!(edges, [true; 4]);
    }
}
