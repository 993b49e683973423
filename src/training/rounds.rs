//! Training a gait: from its response to a design that tells images apart.
//!
//! The response gives the best design under the linear model. If many places change at once, the
//! body deviates from the model, so the response is measured again around the design, under
//! training images. In half of these rollouts some places change at random, an intervention as in
//! the first response. Then the design problem is solved again. After a few rounds the last design
//! is [refined](super::race); the designs before it are its first challengers.

use crate::base::Grid;
use crate::base::random::{Purpose, Stream, stream};
use crate::body::{Body, Material};
use crate::response::design_problem::DesignProblem;
use crate::response::gait::{Design, Gait, SENSORS};
use crate::response::regression::{Evidence, Moments, Response, dot};
use crate::sim::Physics;
use crate::task::fitness::clipped_margin;
use crate::training::race::{Challenge, Refinement, WeightedImage};
use crate::training::rollouts::{Image, Rollouts};
use std::collections::BTreeSet;

/// Weight of random rollouts: farther from the design, but more, and each tells more of the slopes.
const RANDOM_WEIGHT: f64 = 0.3;

/// Factor on the weight of a round's rollouts in every later round. With less, slopes are noisy;
/// with more, they describe abandoned designs.
const FADE: f64 = 0.7;

/// Probability that a place is drawn anew in a rollout around a design. Larger values leave the
/// design's neighbourhood; smaller ones carry less information about the slopes.
const CHANGED: f64 = 0.15;

/// Most designs of earlier rounds that challenge the last one when refining begins.
const FINALISTS: usize = 4;

/// Challengers on the same images. With more, some win by chance; fewer cost more evaluations.
const CHALLENGERS_OF_A_SET: usize = 30;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrainingPlan {
    pub(crate) seed: u64,
    /// Rounds that measure the response around a design; 0: the robot keeps its own design.
    pub(crate) rounds: usize,
    /// Training images of a round.
    pub(crate) images: usize,
    /// Training images on which the last designs are compared.
    pub(crate) final_images: usize,
    /// Bodies that challenge the best of those.
    pub(crate) challengers: usize,
    /// Least number of muscles in such a body.
    pub(crate) min_muscles: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Round {
    pub(crate) round: usize,
    /// Predicted mean clipped margin of the design's answers to all training images.
    pub(crate) predicted: f64,
    /// Mean clipped margin of its answers to the images of the round.
    pub(crate) measured: f64,
    /// Mean of displacement minus prediction \[voxel lengths\], positive to the right.
    pub(crate) off: f64,
    /// Number of places that change in the next design.
    pub(crate) changed: usize,
    /// Rollouts so far, without the first response.
    pub(crate) rollouts: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum First {
    Round(Round),
    /// Mean clipped margin of the robot's own design, where there are no rounds.
    Own(f64),
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TrainedDesign {
    pub(crate) body: Body,
    /// Numbers of the training images on which it was evaluated at the end.
    pub(crate) shown: Vec<usize>,
    /// Its displacement under each of them \[voxel lengths\].
    pub(crate) displacements: Vec<f64>,
    /// Mean clipped margin of its answers.
    pub(crate) objective: f64,
    /// Direction in which the first group walks: 1 right, −1 left.
    pub(crate) side: f64,
    /// Rollouts, without the first response.
    pub(crate) rollouts: usize,
}

/// Trains a gait with a known response to tell images apart.
pub(crate) struct GaitTrainer<'a> {
    gait: &'a Gait,
    physics: &'a Physics,
    images: Vec<Image>,
    plan: TrainingPlan,
    ridge: f64,
    conditions: usize,
    /// Evidence of the slopes from all rollouts so far.
    evidence: Evidence,
    slopes: Vec<f64>,
    /// By condition \[voxel lengths\].
    intercepts: Vec<f64>,
    /// The latest design; `earlier` has those before it.
    design: Design,
    earlier: Vec<Design>,
    /// Prediction for the latest design.
    predicted: f64,
    side: f64,
    rounds: usize,
    rollouts: usize,
}

impl<'a> GaitTrainer<'a> {
    /// Solves the design problem for the first design, by the response alone.
    ///
    /// # Panics
    /// Panics if there are no images.
    pub(crate) fn new(
        gait: &'a Gait,
        response: &Response,
        images: Vec<Image>,
        plan: TrainingPlan,
        physics: &'a Physics,
    ) -> Self {
        let conditions = 1 + images
            .iter()
            .map(|image| image.condition)
            .max()
            .expect("there are images");
        let mut evidence = response.evidence.clone();
        evidence.fade(RANDOM_WEIGHT);
        let mut trainer = GaitTrainer {
            gait,
            physics,
            images,
            plan,
            ridge: response.ridge,
            conditions,
            evidence,
            slopes: response.slopes.clone(),
            intercepts: vec![response.intercept; conditions],
            design: vec![Material::SensorExpand; gait.places().len()],
            earlier: Vec::new(),
            predicted: f64::NEG_INFINITY,
            side: 1.0,
            rounds: 0,
            rollouts: 0,
        };
        let any = trainer.design.clone();
        for (draw, side) in [(0, 1.0), (1, -1.0)] {
            let mut random = trainer.random(Use::First, draw);
            let (predicted, design) =
                trainer.solved(&any, side, |problem| problem.solve_from_many(&mut random));
            if predicted > trainer.predicted {
                (trainer.predicted, trainer.design, trainer.side) = (predicted, design, side);
            }
        }
        trainer
    }

    /// Returns the predicted mean clipped margin of the latest design over all training images.
    pub(crate) fn predicted(&self) -> f64 {
        self.predicted
    }

    /// Begins: with the first round, or, without rounds, with the robot's own design.
    pub(crate) fn first<R: Rollouts>(&mut self, rollouts: &mut R) -> Result<First, R::Error> {
        match self.plan.rounds {
            0 => self.own(rollouts).map(First::Own),
            _ => self.round(rollouts).map(First::Round),
        }
    }

    /// Measures the response around the design, and solves the design problem again.
    pub(crate) fn round<R: Rollouts>(&mut self, rollouts: &mut R) -> Result<Round, R::Error> {
        self.rounds += 1;
        let mut random = self.random(Use::Round, self.rounds as u64);
        let (measured, off) = self.measured(&mut random, rollouts)?;
        let before = self.design.clone();
        let (predicted, design) =
            self.solved(&before, self.side, |problem| problem.solve(&mut random));
        let round = Round {
            round: self.rounds,
            predicted: self.predicted,
            measured,
            off,
            changed: design.iter().zip(&before).filter(|(a, b)| a != b).count(),
            rollouts: self.rollouts,
        };
        self.earlier.push(before);
        (self.predicted, self.design) = (predicted, design);
        Ok(round)
    }

    /// Takes the robot's own design and its better side for a solution, and measures the response
    /// around it. Returns its mean clipped margin.
    fn own<R: Rollouts>(&mut self, rollouts: &mut R) -> Result<f64, R::Error> {
        self.design = self.gait.design();
        let (measured, _) = self.measured(&mut self.random(Use::Round, 0), rollouts)?;
        if measured < 0.0 {
            self.side = -self.side;
        }
        Ok(measured.abs())
    }

    /// Measures the response around the design; returns its mean clipped margin and its mean `off`.
    fn measured<R: Rollouts>(
        &mut self,
        random: &mut Stream,
        rollouts: &mut R,
    ) -> Result<(f64, f64), R::Error> {
        let numbers = self.drawn(self.plan.images, random);
        let draw = |(turn, number): (usize, &usize)| {
            let material = |material: &Material| {
                // Half use the design itself, in both groups. Soft stays soft: all are of one body.
                if turn / 2 % 2 == 1 && *material != Material::Soft && random.unit() < CHANGED {
                    SENSORS[random.below(SENSORS.len())]
                } else {
                    *material
                }
            };
            (*number, self.design.iter().map(material).collect())
        };
        let asked: Vec<(usize, Design)> = numbers.iter().enumerate().map(draw).collect();
        let as_probe = |(number, design): &(usize, Design)| {
            self.gait.as_probe(design, &self.images[*number].stimulus)
        };
        let stimuli: Vec<Grid<f64>> = asked.iter().map(as_probe).collect();
        let body = self.gait.probe_of(&self.design);
        let found = rollouts.roll(&body, &stimuli, &self.conditions_of(&numbers))?;
        self.rollouts += asked.len();

        let mut sets = vec![Moments::new(self.design.len()); self.conditions];
        let (mut off, mut stable) = (0.0, 0.0);
        for ((number, design), displacement) in asked.iter().zip(&found) {
            let Image {
                example, condition, ..
            } = &self.images[*number];
            let widths = example.widths(design);
            let Some(displacement) = displacement else {
                continue;
            };
            off += displacement - self.intercepts[*condition] - dot(&self.slopes, &widths);
            stable += 1.0;
            sets[*condition].add(&widths, *displacement);
        }
        self.evidence.fade(FADE);
        sets.iter().for_each(|set| self.evidence.add(set, 1.0));
        self.slopes = self.evidence.slopes(self.ridge).0;
        let known: Vec<Option<f64>> = sets.iter().map(|set| set.intercept(&self.slopes)).collect();
        if known.iter().any(Option::is_some) {
            let of_known: Vec<f64> = known.iter().copied().flatten().collect();
            let mean = of_known.iter().sum::<f64>() / of_known.len() as f64;
            self.intercepts = known
                .into_iter()
                .map(|intercept| intercept.unwrap_or(mean))
                .collect();
        }
        let of_itself = asked
            .iter()
            .zip(&found)
            .filter(|((_, design), _)| *design == self.design);
        let measured =
            self.mean_score(of_itself.map(|((number, _), found)| (*number, nowhere(*found))));
        Ok((measured, if stable > 0.0 { off / stable } else { 0.0 }))
    }

    /// Compares the last designs on the same training images, and refines the best by challengers.
    /// `told` is called after each challenge.
    pub(crate) fn finish<R: Rollouts>(
        self,
        rollouts: &mut R,
        mut told: impl FnMut(&Challenge),
    ) -> Result<TrainedDesign, R::Error> {
        let finalists = self.finalists();
        let body = self.gait.built(&self.design);
        let cell = |(row, column): &(usize, usize)| row * body.width() + column;
        let cells: Vec<usize> = self.gait.places().iter().map(cell).collect();
        let evidence = self.evidence.among(&cells, body.height() * body.width());
        let TrainingPlan {
            seed,
            challengers,
            min_muscles,
            ..
        } = self.plan;
        let (mut numbers, images) = self.compared_on(0);
        let mut refinement = Refinement::new(
            body,
            images,
            (evidence, self.ridge),
            (self.physics, min_muscles, seed),
            rollouts,
        )?;
        for design in finalists {
            told(&refinement.challenge(self.gait.built(&design), rollouts)?);
        }
        for challenger in 0..challengers {
            if challenger > 0 && challenger % CHALLENGERS_OF_A_SET == 0 {
                let (others, images) = self.compared_on(challenger);
                numbers = others;
                refinement.show(images, rollouts)?;
            }
            let challenger = refinement.challenger();
            told(&refinement.challenge(challenger, rollouts)?);
        }
        Ok(TrainedDesign {
            body: refinement.body().clone(),
            shown: numbers,
            displacements: refinement.displacements().to_vec(),
            objective: refinement.fitness(),
            side: self.side,
            rollouts: self.rollouts + refinement.rollouts(),
        })
    }

    /// Returns the number of challengers: the designs before the last one, and those of the plan.
    pub(crate) fn challengers(&self) -> usize {
        self.finalists().len() + self.plan.challengers
    }

    /// Returns the earlier designs that challenge first, the latest of them first.
    fn finalists(&self) -> Vec<Design> {
        let mut finalists: Vec<Design> = Vec::new();
        for design in self.earlier.iter().rev() {
            if finalists.len() < FINALISTS && *design != self.design && !finalists.contains(design)
            {
                finalists.push(design.clone());
            }
        }
        finalists
    }

    /// Draws training images for comparing bodies; returns their numbers and the images. Both
    /// groups have as many if possible, and every class has at least one if there is room.
    fn compared_on(&self, draw: usize) -> (Vec<usize>, Vec<WeightedImage>) {
        let mut random = self.random(Use::Finish, draw as u64);
        let numbers = self.drawn(self.plan.final_images, &mut random);
        let numbers = self.with_every_class(numbers, &mut random);
        let images: Vec<&Image> = numbers.iter().map(|number| &self.images[*number]).collect();
        let images = WeightedImage::all(&images, self.side);
        (numbers, images)
    }

    fn random(&self, what: Use, number: u64) -> Stream {
        stream(self.plan.seed, Purpose::Training, what as u64, number)
    }

    /// Draws `count` different training images, or all; groups alternate while both have images.
    fn drawn(&self, count: usize, random: &mut Stream) -> Vec<usize> {
        let of = |right: f64| -> Vec<usize> {
            (0..self.images.len())
                .filter(|number| self.images[*number].example.right == right)
                .collect()
        };
        let mut groups = [1.0, -1.0].map(|right| {
            let all = of(right);
            random
                .sample(all.len(), all.len())
                .into_iter()
                .map(move |number| all[number])
        });
        let mut drawn = Vec::new();
        let mut turn = 0;
        while drawn.len() < count.min(self.images.len()) {
            drawn.extend(groups[turn % 2].next());
            turn += 1;
        }
        drawn
    }

    /// Adds missing classes: each replaces its group's last image whose class has another.
    fn with_every_class(&self, mut numbers: Vec<usize>, random: &mut Stream) -> Vec<usize> {
        let classes: BTreeSet<u8> = self.images.iter().map(|image| image.class).collect();
        for class in classes {
            let count = |class: u8| {
                numbers
                    .iter()
                    .filter(|n| self.images[**n].class == class)
                    .count()
            };
            if count(class) > 0 {
                continue;
            }
            let all: Vec<usize> = (0..self.images.len())
                .filter(|number| self.images[*number].class == class)
                .collect();
            let right = self.images[all[0]].example.right;
            let has_another = |number: &usize| {
                let image = &self.images[*number];
                image.example.right == right && count(image.class) > 1
            };
            if let Some(place) = numbers.iter().rposition(has_another) {
                numbers[place] = all[random.below(all.len())];
            }
        }
        numbers
    }

    fn conditions_of(&self, numbers: &[usize]) -> Vec<usize> {
        numbers
            .iter()
            .map(|number| self.images[*number].condition)
            .collect()
    }

    /// Returns the mean clipped margin of displacements, given by the numbers of their training
    /// images. Both groups weigh the same, however many images each has.
    fn mean_score(&self, answers: impl Iterator<Item = (usize, f64)>) -> f64 {
        let (mut scores, mut counts) = ([0.0; 2], [0.0; 2]);
        for (number, displacement) in answers {
            let right = self.images[number].example.right;
            let group = usize::from(right < 0.0);
            scores[group] += clipped_margin(self.side * right * displacement);
            counts[group] += 1.0;
        }
        let means = scores
            .iter()
            .zip(&counts)
            .filter(|(_, count)| **count > 0.0);
        let means: Vec<f64> = means.map(|(sum, count)| sum / count).collect();
        means.iter().sum::<f64>() / means.len().max(1) as f64
    }

    /// Solves on from a design; returns the predicted objective and the solution.
    fn solved(
        &self,
        from: &[Material],
        side: f64,
        solve: impl FnOnce(&mut DesignProblem),
    ) -> (f64, Design) {
        let examples = self
            .images
            .iter()
            .map(|image| (&image.example, self.intercepts[image.condition]));
        let mut problem = DesignProblem::predicted(examples, &self.slopes, from, side);
        solve(&mut problem);
        (problem.objective(), problem.design())
    }
}

#[derive(Clone, Copy)]
enum Use {
    First = 1,
    Round = 2,
    Finish = 3,
}

/// An unstable design counts as one that does not move.
fn nowhere(displacement: Option<f64>) -> f64 {
    displacement.unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;
    use crate::response::design_problem::Example;
    use crate::response::gait::{CHOICES, random_image};
    use crate::response::regression::RandomRollout;
    use std::convert::Infallible;

    /// A body that walks by its widths with diminishing effect, on which slopes depend a little.
    struct Planted {
        gait: Gait,
        physics: Physics,
        slopes: Vec<f64>,
        asked: Vec<(Design, usize)>,
        unstable: bool,
    }

    impl Planted {
        fn new(places: usize) -> Self {
            let body: Body = "6".repeat(places).parse().unwrap();
            let mut random = stream(7, Purpose::RandomImages, 0, 0);
            let slopes: Vec<f64> = (0..places).map(|_| 4.0 * random.normal()).collect();
            Planted {
                gait: Gait::of(&body).unwrap(),
                physics: Physics::default(),
                slopes,
                asked: Vec::new(),
                unstable: false,
            }
        }

        fn walks(&self, widths: &[f64], condition: usize) -> f64 {
            let moved =
                |(width, slope): (&f64, &f64)| slope * (width - 1.1) + 0.5 * (width - 1.1).powi(2);
            let moved: f64 = widths.iter().zip(&self.slopes).map(moved).sum();
            30.0 * ((moved + [3.0, -2.0][condition]) / 30.0).tanh()
        }

        fn images(&self, count: usize) -> Vec<Image> {
            let mut random = stream(7, Purpose::RandomImages, 1, 0);
            let mut image = |number: usize| {
                let right = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
                // Every pixel carries a little information about the class.
                let bright = |c: usize| {
                    0.5 + if c.is_multiple_of(2) {
                        0.15 * right
                    } else {
                        -0.15 * right
                    }
                };
                let stimulus = Grid::from_fn(1, self.slopes.len(), |_, column| {
                    f64::from(u8::from(random.unit() < bright(column)))
                });
                let example = Example {
                    right,
                    ..Example::new(&self.gait, &stimulus, &self.physics)
                };
                // The second group has many classes; the last of them is rare.
                let class = if right > 0.0 {
                    0
                } else {
                    1 + (number / 2 % 49 / 8) as u8
                };
                Image {
                    stimulus,
                    class,
                    example,
                    condition: number / 2 % 2,
                }
            };
            (0..count).map(&mut image).collect()
        }

        fn response(&self, rollouts: usize) -> Response {
            let mut random = stream(7, Purpose::RandomImages, 0, 1);
            let probe = vec![Material::SensorExpand; self.slopes.len()];
            let mut shown = |number: usize| {
                let image = random_image(1, self.slopes.len(), &self.physics, &mut random);
                let widths = self.gait.widths(&probe, &image, &self.physics);
                RandomRollout {
                    displacement: self.walks(&widths, number % 2),
                    widths,
                    condition: number % 2,
                }
            };
            Response::of(&(0..rollouts).map(&mut shown).collect::<Vec<_>>()).unwrap()
        }

        /// Trains; returns the design, the rounds, and the first and last design's accuracies.
        fn taught(
            &mut self,
            images: usize,
            response: usize,
        ) -> (TrainedDesign, Vec<Round>, [f64; 2]) {
            let (gait, physics) = (self.gait.clone(), self.physics.clone());
            let images = self.images(images);
            let mut trainer = GaitTrainer::new(
                &gait,
                &self.response(response),
                images.clone(),
                PLAN,
                &physics,
            );
            let first = (trainer.design.clone(), trainer.side);
            let mut rounds = Vec::new();
            for _ in 0..PLAN.rounds {
                let Ok(round) = trainer.round(self);
                rounds.push(round);
            }
            let Ok(taught) = trainer.finish(self, |_| ());
            let mut share = |(body, side): (Body, f64)| {
                let stimuli: Vec<_> = images.iter().map(|image| image.stimulus.clone()).collect();
                let conditions: Vec<_> = images.iter().map(|image| image.condition).collect();
                let Ok(walked) = self.roll(&body, &stimuli, &conditions);
                self.asked.pop();
                let is_right = |(image, walked): &(&Image, Option<f64>)| {
                    walked.is_some_and(|walked| walked * image.example.right * side > 3.0)
                };
                images.iter().zip(walked).filter(is_right).count() as f64 / images.len() as f64
            };
            let shares = [
                share((gait.built(&first.0), first.1)),
                share((taught.body.clone(), taught.side)),
            ];
            (taught, rounds, shares)
        }
    }

    impl Rollouts for Planted {
        type Error = Infallible;
        fn roll(
            &mut self,
            body: &Body,
            stimuli: &[Grid<f64>],
            conditions: &[usize],
        ) -> Result<Vec<Option<f64>>, Infallible> {
            // Other materials do not contribute.
            let design: Design = body.voxels().cells().to_vec();
            self.asked.push((design.clone(), stimuli.len()));
            let walk = |(stimulus, condition): (&Grid<f64>, &usize)| {
                let wide = |(column, material): (usize, &Material)| match CHOICES.contains(material)
                {
                    true => crate::sim::width(*material, stimulus[(0, column)], &self.physics),
                    false => 1.1,
                };
                let widths: Vec<f64> = design.iter().enumerate().map(wide).collect();
                (!self.unstable).then(|| self.walks(&widths, *condition))
            };
            Ok(stimuli.iter().zip(conditions).map(walk).collect())
        }
    }

    const PLAN: TrainingPlan = TrainingPlan {
        seed: 3,
        rounds: 4,
        images: 60,
        final_images: 100,
        challengers: 12,
        min_muscles: 0,
    };

    #[test]
    fn a_gait_is_taught_more_than_a_response_of_few_rollouts_says() {
        let mut planted = Planted::new(40);
        let (taught, rounds, [before, after]) = planted.taught(600, 24);
        assert!(after > 0.73 && after > before + 0.02, "{before} {after}");
        assert_eq!(rounds.len(), PLAN.rounds);
        let shown = (FINALISTS + PLAN.challengers) * PLAN.final_images;
        assert!(taught.rollouts <= PLAN.rounds * PLAN.images + shown);
        assert_eq!(
            taught.rollouts,
            planted
                .asked
                .iter()
                .map(|(_, images)| images)
                .sum::<usize>()
        );
        assert!(rounds.last().unwrap().off.abs() < 2.0, "{rounds:?}");
        // The reported displacements are those measured, under images of both groups.
        let images = planted.images(600);
        assert_eq!((taught.shown.len(), taught.displacements.len()), (100, 100));
        let right = taught
            .shown
            .iter()
            .filter(|number| images[**number].example.right == 1.0)
            .count();
        assert_eq!(right, 50);
        let stimuli: Vec<_> = taught
            .shown
            .iter()
            .map(|number| images[*number].stimulus.clone())
            .collect();
        let conditions: Vec<_> = taught
            .shown
            .iter()
            .map(|number| images[*number].condition)
            .collect();
        let Ok(walked) = planted.roll(&taught.body, &stimuli, &conditions);
        assert_eq!(
            walked.into_iter().flatten().collect::<Vec<_>>(),
            taught.displacements
        );
    }

    #[test]
    fn what_the_model_says_of_a_gait_with_many_rollouts_is_what_is_measured() {
        let (_, rounds, _) = Planted::new(40).taught(600, 400);
        let mean = |of: fn(&Round) -> f64| rounds.iter().map(of).sum::<f64>() / rounds.len() as f64;
        let (predicted, measured) = (mean(|round| round.predicted), mean(|round| round.measured));
        assert!(
            (predicted - measured).abs() < 0.15,
            "{predicted} {measured}"
        );
    }

    #[test]
    fn designs_are_compared_on_an_image_of_every_class_if_there_is_room() {
        let planted = Planted::new(4);
        let (gait, response, images) = (
            planted.gait.clone(),
            planted.response(40),
            planted.images(600),
        );
        let classes = |final_images: usize, draw: usize| -> BTreeSet<u8> {
            let plan = TrainingPlan {
                final_images,
                ..PLAN
            };
            let trainer =
                GaitTrainer::new(&gait, &response, images.clone(), plan, &planted.physics);
            let (numbers, _) = trainer.compared_on(draw);
            assert_eq!(
                numbers.iter().collect::<BTreeSet<_>>().len(),
                final_images,
                "each once"
            );
            let first = numbers
                .iter()
                .filter(|number| images[**number].class == 0)
                .count();
            assert_eq!(first, final_images.div_ceil(2));
            numbers.iter().map(|number| images[*number].class).collect()
        };
        for draw in 0..20 {
            assert_eq!(
                classes(14, draw).len(),
                8,
                "seven classes of one group in seven images"
            );
            assert_eq!(classes(40, draw).len(), 8);
        }
        assert_eq!(classes(2, 0).len(), 2);
    }

    #[test]
    fn the_same_seed_teaches_the_same() {
        let (mut a, mut b) = (Planted::new(20), Planted::new(20));
        assert_eq!(a.taught(200, 80), b.taught(200, 80));
        assert_eq!(a.asked, b.asked);
    }

    #[test]
    fn a_gait_that_is_never_stable_ends_with_its_first_design_and_gets_nowhere() {
        let mut planted = Planted {
            unstable: true,
            ..Planted::new(10)
        };
        let (taught, rounds, _) = planted.taught(100, 40);
        assert!(taught.displacements.iter().all(|d| *d == 0.0) && taught.objective == 0.0);
        assert!(
            rounds
                .iter()
                .all(|round| round.measured == 0.0 && round.off == 0.0)
        );
    }
}
