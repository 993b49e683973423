//! Refining a trained robot: a hill climb over whole bodies on real rollouts.
//!
//! A linear model fails where a body is not linear. So the best design ends a training as
//! *champion*. It is evaluated on a few hundred training images, which change after some
//! challengers so that none wins by chance on them. Challengers differ in some sensors, chosen by
//! the slopes and by the champion's measured answers, or in a few voxels of any material. Each is
//! evaluated on the same images and dropped as soon as it falls behind (racing; Maron & Moore
//! 1994). It becomes champion if it is better by more than chance. Challengers with the champion's
//! gait improve the slopes.

use crate::base::Grid;
use crate::base::random::{Purpose, Stream, stream};
use crate::body::{Body, Material};
use crate::genome::other_voxel;
use crate::response::design_problem::{DesignProblem, Example};
use crate::response::gait::{CHOICES, Design, Gait};
use crate::response::regression::{Evidence, Moments};
use crate::sim::{Physics, width};
use crate::task::fitness::clipped_margin;
use crate::training::rollouts::{Image, Rollouts};

/// Images in the first look, then twice as many. Fewer drop good challengers; more cost time.
const FIRST_LOOK: usize = 24;

/// Standard errors by which the mean gain to come may exceed that so far. Larger values drop
/// challengers later: with 2, three in four of a hard task (3|012) need all 400 images.
const ERRORS_OF_HOPE: f64 = 1.0;

/// Standard errors by which a challenger must be better. Any change reshuffles answers near the
/// boundary: with 0, worse bodies won by chance.
const ERRORS_TO_WIN: f64 = 1.0;

/// Added to the spread of gains: who first answers like the champion is not taken for its twin.
const DOUBT: f64 = 0.05;

/// Fraction of challengers that differ in voxels of any material; the others differ in sensors.
const OTHER_GAITS: f64 = 0.4;

/// Binary logarithm of the most sensors that change: 1, 2, 4, 8 or 16.
const MOST_SENSORS_LOG2: u32 = 4;

/// Most voxels that change in a challenger with another gait.
const MOST_VOXELS: usize = 3;

/// Factor on the older evidence of the slopes when the champion is beaten.
const FADE: f64 = 0.9;

/// Most draws of a changed body before the champion is copied for lack of a valid one.
const DRAWS: usize = 1000;

/// A training image of a refinement.
#[derive(Clone, Debug)]
pub(crate) struct WeightedImage {
    pub(crate) stimulus: Grid<f64>,
    pub(crate) condition: usize,
    pub(crate) right: f64,
    pub(crate) weight: f64,
}

impl WeightedImage {
    /// Prepares images; the first group walks to `side`: 1 right, −1 left. Both weigh the same.
    pub(crate) fn all(images: &[&Image], side: f64) -> Vec<Self> {
        let of = |right: f64| {
            images
                .iter()
                .filter(|image| image.example.right == right)
                .count()
                .max(1) as f64
        };
        let shown = |image: &&Image| WeightedImage {
            stimulus: image.stimulus.clone(),
            condition: image.condition,
            right: side * image.example.right,
            weight: 0.5 / of(image.example.right),
        };
        images.iter().map(shown).collect()
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Challenge {
    pub(crate) number: usize,
    /// True if the challenger has another gait than the champion.
    pub(crate) other_gait: bool,
    /// Number of images the challenger was evaluated on.
    pub(crate) shown: usize,
    pub(crate) fitness: f64,
    pub(crate) won: bool,
}

/// A champion, and the evidence from which challengers are proposed.
pub(crate) struct Refinement<'a> {
    images: Vec<WeightedImage>,
    physics: &'a Physics,
    min_muscles: usize,
    seed: u64,
    body: Body,
    displacements: Vec<f64>,
    /// Evidence of the slopes of all cells, row-major; none for cells that are no places.
    evidence: Evidence,
    ridge: f64,
    challenges: usize,
    rollouts: usize,
}

impl<'a> Refinement<'a> {
    /// Evaluates the first champion on all images. `evidence` covers all cells of its grid,
    /// row-major.
    pub(crate) fn new<R: Rollouts>(
        body: Body,
        images: Vec<WeightedImage>,
        (evidence, ridge): (Evidence, f64),
        (physics, min_muscles, seed): (&'a Physics, usize, u64),
        rollouts: &mut R,
    ) -> Result<Self, R::Error> {
        let displacements = shown(&body, &images, rollouts)?;
        let rollouts = images.len();
        Ok(Refinement {
            images,
            physics,
            min_muscles,
            seed,
            body,
            displacements,
            evidence,
            ridge,
            challenges: 0,
            rollouts,
        })
    }

    pub(crate) fn body(&self) -> &Body {
        &self.body
    }

    /// Evaluates the champion on other images, on which challengers are compared from now on.
    pub(crate) fn show<R: Rollouts>(
        &mut self,
        images: Vec<WeightedImage>,
        rollouts: &mut R,
    ) -> Result<(), R::Error> {
        self.displacements = shown(&self.body, &images, rollouts)?;
        self.rollouts += images.len();
        self.images = images;
        Ok(())
    }

    /// Returns the champion's displacement under each image \[voxel lengths\].
    pub(crate) fn displacements(&self) -> &[f64] {
        &self.displacements
    }

    pub(crate) fn rollouts(&self) -> usize {
        self.rollouts
    }

    /// Returns the champion's fitness: the weighted mean clipped margin of its answers.
    pub(crate) fn fitness(&self) -> f64 {
        let all: f64 = self.images.iter().map(|image| image.weight).sum();
        let scores = self
            .images
            .iter()
            .zip(&self.displacements)
            .map(|(image, d)| self.score(image, *d));
        scores.sum::<f64>() / all
    }

    fn score(&self, image: &WeightedImage, displacement: f64) -> f64 {
        image.weight * clipped_margin(image.right * displacement)
    }

    /// Compares a challenger with the champion, which it replaces if it wins.
    pub(crate) fn challenge<R: Rollouts>(
        &mut self,
        challenger: Body,
        rollouts: &mut R,
    ) -> Result<Challenge, R::Error> {
        self.challenges += 1;
        let probe = |body: &Body| Gait::of(body).map(|gait| gait.probe());
        let other_gait = probe(&challenger) != probe(&self.body);
        let mut random = self.random(Use::Order);
        let order = self.order(&mut random);
        let mut found: Vec<f64> = Vec::new();
        // As in an archive, an unstable body has no fitness.
        let (mut look, mut shown, mut is_stable) = (FIRST_LOOK, 0, true);
        while found.len() < order.len() && !self.is_behind(&order, &found) {
            let next = &order[found.len()..order.len().min(found.len() + look)];
            let stimuli: Vec<Grid<f64>> = next
                .iter()
                .map(|number| self.images[*number].stimulus.clone())
                .collect();
            let conditions: Vec<usize> = next
                .iter()
                .map(|number| self.images[*number].condition)
                .collect();
            let rolled = rollouts.roll(&challenger, &stimuli, &conditions)?;
            shown += rolled.len();
            let Some(walked) = rolled.into_iter().collect::<Option<Vec<f64>>>() else {
                is_stable = false;
                break;
            };
            found.extend(walked);
            look *= 2;
        }
        self.rollouts += shown;
        if !other_gait {
            self.learn(&challenger, &order, &found);
        }
        let gains = || {
            order
                .iter()
                .zip(&found)
                .map(|(number, d)| self.gain(*number, *d))
        };
        let (gain, squares) =
            gains().fold((0.0, 0.0), |(sum, squares), g| (sum + g, squares + g * g));
        let error = (squares - gain * gain / order.len() as f64).max(0.0).sqrt();
        let won = is_stable && found.len() == order.len() && gain > ERRORS_TO_WIN * error;
        if won {
            for (number, displacement) in order.iter().zip(&found) {
                self.displacements[*number] = *displacement;
            }
            self.body = challenger;
            self.evidence.fade(FADE);
        }
        Ok(Challenge {
            number: self.challenges,
            other_gait,
            shown,
            fitness: self.fitness(),
            won,
        })
    }

    pub(crate) fn challenger(&self) -> Body {
        let mut random = self.random(Use::Challenger);
        if random.unit() < OTHER_GAITS {
            return self.other_gait(&mut random);
        }
        match Gait::of(&self.body) {
            Some(gait) => self.other_sensors(&gait, &mut random),
            None => self.other_gait(&mut random),
        }
    }

    /// Proposes sensors chosen by the slopes, at a random half of the champion's places.
    fn other_sensors(&self, gait: &Gait, random: &mut Stream) -> Body {
        let slopes = self.evidence.slopes_alone(self.ridge);
        let of_place = |place: &(usize, usize)| slopes[place.0 * self.body.width() + place.1];
        let slopes: Vec<f64> = gait.places().iter().map(of_place).collect();
        let examples: Vec<Example> = (self.images.iter().zip(&self.displacements))
            .map(|(image, displacement)| Example {
                displacement: *displacement,
                right: image.right,
                weight: image.weight,
                ..Example::new(gait, &image.stimulus, self.physics)
            })
            .collect();
        let examples: Vec<&Example> = examples.iter().collect();
        let design = gait.design();
        let mut problem = DesignProblem::new(&examples, &slopes, &design);
        let places: Vec<usize> = (0..design.len()).filter(|_| random.unit() < 0.5).collect();
        problem.best_changes(&places, 1 << random.below(MOST_SENSORS_LOG2 as usize + 1));
        let solved = problem.design();
        if solved != design {
            return gait.built(&solved);
        }
        // The model finds no better design: change one place at random.
        let mut other: Design = design;
        let place = random.below(other.len());
        let others: Vec<Material> = CHOICES
            .into_iter()
            .filter(|material| *material != other[place])
            .collect();
        other[place] = others[random.below(others.len())];
        gait.built(&other)
    }

    /// Proposes the champion with one to three voxels of other materials.
    fn other_gait(&self, random: &mut Stream) -> Body {
        for _ in 0..DRAWS {
            let mut voxels = self.body.voxels().clone();
            for _ in 0..=random.below(MOST_VOXELS) {
                let (place, material) = other_voxel(&voxels, random);
                voxels[place] = material;
            }
            match Body::new(voxels) {
                Ok(body) if body != self.body && body.is_valid(self.min_muscles) => return body,
                _ => {}
            }
        }
        self.body.clone()
    }

    fn random(&self, what: Use) -> Stream {
        stream(
            self.seed,
            Purpose::Training,
            what as u64,
            self.challenges as u64,
        )
    }

    /// Orders the images at random, those first on which the champion can be beaten.
    fn order(&self, random: &mut Stream) -> Vec<usize> {
        let count = self.images.len();
        let mut order = random.sample(count, count);
        order.sort_by_key(|number| !self.is_open(*number));
        order
    }

    fn is_open(&self, number: usize) -> bool {
        let image = &self.images[number];
        clipped_margin(image.right * self.displacements[number]) < 1.0
    }

    fn gain(&self, number: usize, displacement: f64) -> f64 {
        let image = &self.images[number];
        self.score(image, displacement) - self.score(image, self.displacements[number])
    }

    /// Returns true if a challenger will not win, even if it does somewhat better than so far.
    fn is_behind(&self, order: &[usize], found: &[f64]) -> bool {
        let mean_weight =
            self.images.iter().map(|image| image.weight).sum::<f64>() / self.images.len() as f64;
        let mut bound = 0.0;
        for open in [true, false] {
            let of_kind = || {
                order
                    .iter()
                    .enumerate()
                    .filter(|(_, number)| self.is_open(**number) == open)
            };
            let (mut seen, mut sum, mut squares, mut most, mut left) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (turn, number) in of_kind() {
                match found.get(turn) {
                    Some(displacement) => {
                        let gain = self.gain(*number, *displacement) / mean_weight;
                        seen += 1.0;
                        sum += gain;
                        squares += gain * gain;
                    }
                    None => {
                        let image = &self.images[*number];
                        most += (image.weight - self.score(image, self.displacements[*number]))
                            / mean_weight;
                        left += 1.0;
                    }
                }
            }
            bound += sum;
            if seen < FIRST_LOOK as f64 / 2.0 {
                // This bounds the gain by 0 where the champion's answers are perfect.
                bound += most;
            } else if left > 0.0 {
                let mean = sum / seen;
                let variance = (squares / seen - mean * mean).max(0.0) + DOUBT * DOUBT;
                let error = (variance / seen * (seen + left) / left).sqrt();
                bound += (left * (mean + ERRORS_OF_HOPE * error)).min(most);
            }
        }
        bound <= 0.0
    }

    /// Adds the evidence of a challenger with the champion's gait: the differences of width and
    /// displacement on each image. A soft voxel counts as one rest width, which is only nearly
    /// true. The evidence only proposes challengers; it decides nothing.
    fn learn(&mut self, challenger: &Body, order: &[usize], found: &[f64]) {
        let cells = self.body.height() * self.body.width();
        let mut set = Moments::new(cells);
        let pairs = || self.body.voxels().iter().zip(challenger.voxels().cells());
        for (number, displacement) in order.iter().zip(found) {
            let stimulus = &self.images[*number].stimulus;
            let wider = |((place, before), after): (((usize, usize), &Material), &Material)| {
                if before == after {
                    return 0.0;
                }
                let of = |material: &Material| {
                    width(*material, stimulus.or_default(place), self.physics)
                };
                of(after) - of(before)
            };
            let widths: Vec<f64> = pairs().map(wider).collect();
            set.add(&widths, displacement - self.displacements[*number]);
        }
        self.evidence.add(&set, 1.0);
    }
}

/// Returns the displacements of a body \[voxel lengths\]; 0 where it is unstable.
fn shown<R: Rollouts>(
    body: &Body,
    images: &[WeightedImage],
    rollouts: &mut R,
) -> Result<Vec<f64>, R::Error> {
    let stimuli: Vec<Grid<f64>> = images.iter().map(|image| image.stimulus.clone()).collect();
    let conditions: Vec<usize> = images.iter().map(|image| image.condition).collect();
    let found = rollouts.roll(body, &stimuli, &conditions)?;
    Ok(found
        .into_iter()
        .map(|displacement| displacement.unwrap_or(0.0))
        .collect())
}

#[derive(Clone, Copy)]
enum Use {
    Challenger = 4,
    Order = 5,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// Bodies of one row that walk by their places' widths; the first has the largest slope.
    struct Planted {
        physics: Physics,
        simulated: usize,
    }

    impl Rollouts for Planted {
        type Error = Infallible;
        fn roll(
            &mut self,
            body: &Body,
            stimuli: &[Grid<f64>],
            _: &[usize],
        ) -> Result<Vec<Option<f64>>, Infallible> {
            self.simulated += stimuli.len();
            let walks = |stimulus: &Grid<f64>| {
                let moved = body.voxels().iter().map(|((row, column), material)| {
                    let slope = 12.0 / (column + 1) as f64;
                    let is_place = CHOICES.contains(material);
                    let wide = width(*material, stimulus[(row, column)], &self.physics) - 1.0;
                    if is_place { slope * wide } else { 0.0 }
                });
                Some(moved.sum())
            };
            Ok(stimuli.iter().map(walks).collect())
        }
    }

    const PLACES: usize = 12;

    /// Makes images whose bright pixels are mostly in even columns if right is correct, else in odd
    /// ones.
    fn images(count: usize) -> Vec<WeightedImage> {
        let mut random = stream(1, Purpose::RandomImages, 0, 0);
        let image = |number: usize| {
            let right = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
            let stimulus = Grid::from_fn(1, PLACES, |_, column| {
                let likely = if column.is_multiple_of(2) == (right > 0.0) {
                    0.75
                } else {
                    0.25
                };
                f64::from(u8::from(random.unit() < likely))
            });
            WeightedImage {
                stimulus,
                condition: 0,
                right,
                weight: 1.0,
            }
        };
        (0..count).map(image).collect()
    }

    fn planted() -> Planted {
        Planted {
            physics: Physics::default(),
            simulated: 0,
        }
    }

    /// Refines soft voxels; returns champion, fitness after each challenge, number of rollouts.
    fn refined(challengers: usize) -> (Body, Vec<f64>, usize) {
        let (mut rollouts, physics) = (planted(), Physics::default());
        let evidence = (Evidence::new(PLACES), 1.0);
        let body: Body = "2".repeat(PLACES).parse().unwrap();
        let Ok(mut refinement) =
            Refinement::new(body, images(200), evidence, (&physics, 0, 5), &mut rollouts);
        let mut course = vec![refinement.fitness()];
        for _ in 0..challengers {
            let challenger = refinement.challenger();
            assert_ne!(challenger, *refinement.body());
            let Ok(challenge) = refinement.challenge(challenger, &mut rollouts);
            assert_eq!(challenge.fitness, refinement.fitness());
            course.push(challenge.fitness);
        }
        assert_eq!(rollouts.simulated, refinement.rollouts());
        // The reported displacements are the champion's own.
        let stimuli: Vec<Grid<f64>> = refinement
            .images
            .iter()
            .map(|image| image.stimulus.clone())
            .collect();
        let Ok(walked) = rollouts.roll(refinement.body(), &stimuli, &[]);
        assert_eq!(
            walked.into_iter().flatten().collect::<Vec<_>>(),
            refinement.displacements()
        );
        (refinement.body().clone(), course, refinement.rollouts())
    }

    #[test]
    fn a_champion_is_never_beaten_by_a_worse_body_and_learns_what_its_images_ask_for() {
        let (body, course, rollouts) = refined(60);
        assert!(course.windows(2).all(|two| two[1] >= two[0]), "{course:?}");
        assert!(course[0].abs() < 1e-9 && course[60] > 0.45, "{course:?}");
        // Most challengers are dropped before they are evaluated on all images.
        assert!(rollouts < 200 * 61 * 2 / 3, "{rollouts}");
        // The place with the largest slope expands: its pixel is bright where right is correct.
        assert_eq!(body.voxels()[(0, 0)], Material::SensorExpand);
        assert_eq!(
            refined(60),
            (body, course, rollouts),
            "the same seed refines the same"
        );
    }

    #[test]
    fn both_groups_weigh_the_same_however_many_images_they_have() {
        let gait = Gait::of(&"66".parse().unwrap()).unwrap();
        let image = |right: f64| {
            let stimulus = Grid::from_fn(1, 2, |_, _| 1.0);
            let example = Example {
                right,
                weight: 0.25,
                ..Example::new(&gait, &stimulus, &Physics::default())
            };
            Image {
                stimulus,
                class: 0,
                example,
                condition: 0,
            }
        };
        let images = [image(1.0), image(-1.0), image(-1.0), image(-1.0)];
        let shown = WeightedImage::all(&images.iter().collect::<Vec<_>>(), -1.0);
        let weight = |right: f64| -> f64 {
            shown
                .iter()
                .filter(|shown| shown.right == right)
                .map(|shown| shown.weight)
                .sum()
        };
        assert!((weight(-1.0) - 0.5).abs() < 1e-12 && (weight(1.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn what_is_hopeless_is_dropped_at_the_first_look_and_what_is_better_is_shown_everything() {
        let (mut rollouts, physics) = (planted(), Physics::default());
        let evidence = (Evidence::new(PLACES), 1.0);
        let good: Body = "656565656565".parse().unwrap();
        let bad: Body = "565656565656".parse().unwrap();
        let Ok(mut refinement) = Refinement::new(
            good.clone(),
            images(200),
            evidence.clone(),
            (&physics, 0, 5),
            &mut rollouts,
        );
        let Ok(challenge) = refinement.challenge(bad.clone(), &mut rollouts);
        assert_eq!(
            (challenge.won, challenge.shown, challenge.other_gait),
            (false, FIRST_LOOK, false)
        );
        let Ok(mut refinement) =
            Refinement::new(bad, images(200), evidence, (&physics, 0, 5), &mut rollouts);
        let Ok(challenge) = refinement.challenge(good.clone(), &mut rollouts);
        assert_eq!((challenge.won, challenge.shown), (true, 200));
        assert_eq!(*refinement.body(), good);
        // A body with a muscle has another gait.
        let Ok(challenge) = refinement.challenge("656565656563".parse().unwrap(), &mut rollouts);
        assert!(challenge.other_gait);
    }

    #[test]
    fn a_challenger_that_is_unstable_under_an_image_loses_however_it_answers_the_others() {
        /// Unstable under the last image of each look.
        struct Shaky(Planted);
        impl Rollouts for Shaky {
            type Error = Infallible;
            fn roll(
                &mut self,
                body: &Body,
                stimuli: &[Grid<f64>],
                conditions: &[usize],
            ) -> Result<Vec<Option<f64>>, Infallible> {
                let Ok(mut walked) = self.0.roll(body, stimuli, conditions);
                *walked.last_mut().unwrap() = None;
                Ok(walked)
            }
        }
        let (mut rollouts, physics) = (planted(), Physics::default());
        let (good, bad): (Body, Body) = (
            "656565656565".parse().unwrap(),
            "565656565656".parse().unwrap(),
        );
        let evidence = (Evidence::new(PLACES), 1.0);
        let Ok(mut refinement) = Refinement::new(
            bad.clone(),
            images(200),
            evidence,
            (&physics, 0, 5),
            &mut rollouts,
        );
        let Ok(challenge) = refinement.challenge(good, &mut Shaky(rollouts));
        assert_eq!((challenge.won, challenge.shown), (false, FIRST_LOOK));
        assert_eq!(*refinement.body(), bad);
    }
}
