//! Refining a taught robot: a hill climb over whole bodies on real rollouts.
//!
//! What a model says ends where a body is not linear. So at the end of a training the best design
//! is *champion*: it is shown a few hundred training images, after some challengers others, so that
//! none wins by chance on these. Challengers differ from it in some sensors, chosen by the slopes
//! and by how the champion really answered, or in a few voxels of any material. A challenger is
//! shown the same images, and dropped as soon as it falls behind (racing; Maron & Moore 1994). One
//! that is better by more than chance becomes champion. Every challenger with the champion's gait
//! tells more of the slopes.

use crate::base::Grid;
use crate::base::random::{Purpose, Stream, stream};
use crate::body::{Body, Material};
use crate::genome::other_voxel;
use crate::response::gait::{CHOICES, Design, Gait};
use crate::response::lesson::{Example, Lesson};
use crate::response::regression::{Evidence, Moments};
use crate::sim::{Physics, width};
use crate::task::fitness::clipped_margin;
use crate::training::rounds::{Image, Rollouts};

/// Images of the first look at a challenger; each next look takes twice as many. With fewer, good
/// ones are dropped by chance; with more, bad ones cost more.
const FIRST_LOOK: usize = 24;

/// By how many standard errors what is to come may be better than what was seen. Larger values drop
/// later: with 2, three in four challengers of a hard task (3|012) are shown all 400 images.
const ERRORS_OF_HOPE: f64 = 1.0;

/// By how many of its standard errors a challenger must be better. Every change of a body throws its
/// answers near the boundary anew, so many that are worse look better on a few hundred images. With
/// 0, they won by chance.
const ERRORS_TO_WIN: f64 = 1.0;

/// What few images may hide of the spread of gains. Without it, a challenger whose first answers
/// are all the champion's is taken for its twin.
const DOUBT: f64 = 0.05;

/// Share of challengers that differ in voxels of any material; the others differ in sensors.
const OTHER_GAITS: f64 = 0.4;

/// Most places of a challenger that change when sensors do: 1, 2, 4, 8 or 16.
const MOST_SENSORS: u32 = 4;

/// Most voxels of a challenger that change when the gait does.
const MOST_VOXELS: usize = 3;

/// What older evidence of the slopes counts when a champion is beaten.
const FADE: f64 = 0.9;

/// Draws until a changed body is valid.
const DRAWS: usize = 1000;

/// A training image of a refinement.
#[derive(Clone, Debug)]
pub struct WeightedImage {
    /// What the voxels see.
    pub stimulus: Grid<f64>,
    /// The number of its condition.
    pub condition: usize,
    /// 1 if the robot is to walk right, −1 if left.
    pub right: f64,
    /// What it weighs.
    pub weight: f64,
}

impl WeightedImage {
    /// Images of a training, for a robot whose first group walks to this side: 1 right, −1 left.
    /// Both groups weigh the same, however many images of each there are.
    pub fn all(images: &[&Image], side: f64) -> Vec<Self> {
        let of =
            |right: f64| images.iter().filter(|image| image.example.right == right).count().max(1) as f64;
        let shown = |image: &&Image| WeightedImage {
            stimulus: image.stimulus.clone(),
            condition: image.condition,
            right: side * image.example.right,
            weight: 0.5 / of(image.example.right),
        };
        images.iter().map(shown).collect()
    }
}

/// How a challenger did.
#[derive(Clone, Debug, PartialEq)]
pub struct Challenge {
    /// Its number, from 1.
    pub number: usize,
    /// Whether its gait is another one.
    pub other_gait: bool,
    /// Images it was shown.
    pub shown: usize,
    /// The champion's fitness after it.
    pub fitness: f64,
    /// Whether it is the champion now.
    pub won: bool,
}

/// A champion and what is known of it.
pub struct Refinement<'a> {
    images: Vec<WeightedImage>,
    physics: &'a Physics,
    min_muscles: usize,
    seed: u64,
    body: Body,
    displacements: Vec<f64>,
    /// What is known of the slopes of all cells of the grid, row-major; of a cell that is no place
    /// nothing is.
    evidence: Evidence,
    ridge: f64,
    challenges: usize,
    rollouts: usize,
}

impl<'a> Refinement<'a> {
    /// Shows a body all images: the first champion. `evidence` is of all cells of its grid,
    /// row-major.
    ///
    /// # Errors
    /// What the rollouts say.
    pub fn new<R: Rollouts>(
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

    /// The champion.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Shows the champion other images: what challengers are compared on from now on.
    ///
    /// # Errors
    /// What the rollouts say.
    pub fn show<R: Rollouts>(
        &mut self,
        images: Vec<WeightedImage>,
        rollouts: &mut R,
    ) -> Result<(), R::Error> {
        self.displacements = shown(&self.body, &images, rollouts)?;
        self.rollouts += images.len();
        self.images = images;
        Ok(())
    }

    /// How far it walks under each image \[voxel lengths\].
    pub fn displacements(&self) -> &[f64] {
        &self.displacements
    }

    /// Rollouts so far.
    pub fn rollouts(&self) -> usize {
        self.rollouts
    }

    /// The champion's fitness: the weighted mean clipped margin of its answers.
    pub fn fitness(&self) -> f64 {
        let all: f64 = self.images.iter().map(|image| image.weight).sum();
        let scores = self.images.iter().zip(&self.displacements).map(|(image, d)| self.score(image, *d));
        scores.sum::<f64>() / all
    }

    fn score(&self, image: &WeightedImage, displacement: f64) -> f64 {
        image.weight * clipped_margin(image.right * displacement)
    }

    /// Lets a body challenge the champion.
    ///
    /// # Errors
    /// What the rollouts say.
    pub fn challenge<R: Rollouts>(
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
        // As in an archive, what is unstable has no fitness.
        let (mut look, mut shown, mut is_stable) = (FIRST_LOOK, 0, true);
        while found.len() < order.len() && !self.is_behind(&order, &found) {
            let next = &order[found.len()..order.len().min(found.len() + look)];
            let stimuli: Vec<Grid<f64>> =
                next.iter().map(|number| self.images[*number].stimulus.clone()).collect();
            let conditions: Vec<usize> = next.iter().map(|number| self.images[*number].condition).collect();
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
        let gains = || order.iter().zip(&found).map(|(number, d)| self.gain(*number, *d));
        let (gain, squares) = gains().fold((0.0, 0.0), |(sum, squares), g| (sum + g, squares + g * g));
        let error = (squares - gain * gain / order.len() as f64).max(0.0).sqrt();
        let won = is_stable && found.len() == order.len() && gain > ERRORS_TO_WIN * error;
        if won {
            for (number, displacement) in order.iter().zip(&found) {
                self.displacements[*number] = *displacement;
            }
            self.body = challenger;
            self.evidence.fade(FADE);
        }
        Ok(Challenge { number: self.challenges, other_gait, shown, fitness: self.fitness(), won })
    }

    /// A body to challenge the champion with.
    pub fn challenger(&self) -> Body {
        let mut random = self.random(Use::Challenger);
        if random.unit() < OTHER_GAITS {
            return self.other_gait(&mut random);
        }
        match Gait::of(&self.body) {
            Some(gait) => self.other_sensors(&gait, &mut random),
            None => self.other_gait(&mut random),
        }
    }

    /// The champion with some sensors chosen by the slopes, among a random half of its places.
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
        let mut lesson = Lesson::new(&examples, &slopes, &design);
        let places: Vec<usize> = (0..design.len()).filter(|_| random.unit() < 0.5).collect();
        lesson.best_changes(&places, 1 << random.below(MOST_SENSORS as usize + 1));
        let solved = lesson.design();
        if solved != design {
            return gait.built(&solved);
        }
        // The model knows nothing better: one place at random.
        let mut other: Design = design;
        let place = random.below(other.len());
        let others: Vec<Material> =
            CHOICES.into_iter().filter(|material| *material != other[place]).collect();
        other[place] = others[random.below(others.len())];
        gait.built(&other)
    }

    /// The champion with one to three voxels of other materials.
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
        stream(self.seed, Purpose::Training, what as u64, self.challenges as u64)
    }

    /// All images: those first on which the champion can be beaten, each kind at random.
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

    /// Whether a challenger that goes on as it began, or somewhat better, will not beat the
    /// champion.
    fn is_behind(&self, order: &[usize], found: &[f64]) -> bool {
        let mean_weight =
            self.images.iter().map(|image| image.weight).sum::<f64>() / self.images.len() as f64;
        let mut bound = 0.0;
        for open in [true, false] {
            let of_kind = || order.iter().enumerate().filter(|(_, number)| self.is_open(**number) == open);
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
                        most += (image.weight - self.score(image, self.displacements[*number])) / mean_weight;
                        left += 1.0;
                    }
                }
            }
            bound += sum;
            if seen < FIRST_LOOK as f64 / 2.0 {
                // Nothing can be gained where all is as good as can be.
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

    /// What a challenger with the champion's gait tells of the slopes: on each image by how much it
    /// is wider, and by how much farther it walks. A soft voxel counts as one rest width, which it
    /// is only nearly: what is learnt here proposes challengers, and decides nothing.
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
                let of = |material: &Material| width(*material, stimulus.or_default(place), self.physics);
                of(after) - of(before)
            };
            let widths: Vec<f64> = pairs().map(wider).collect();
            set.add(&widths, displacement - self.displacements[*number]);
        }
        self.evidence.add(&set, 1.0);
    }
}

/// How far a body walks under images \[voxel lengths\]; nowhere where it is unstable.
fn shown<R: Rollouts>(body: &Body, images: &[WeightedImage], rollouts: &mut R) -> Result<Vec<f64>, R::Error> {
    let stimuli: Vec<Grid<f64>> = images.iter().map(|image| image.stimulus.clone()).collect();
    let conditions: Vec<usize> = images.iter().map(|image| image.condition).collect();
    let found = rollouts.roll(body, &stimuli, &conditions)?;
    Ok(found.into_iter().map(|displacement| displacement.unwrap_or(0.0)).collect())
}

/// What random numbers are drawn for.
#[derive(Clone, Copy)]
enum Use {
    Challenger = 4,
    Order = 5,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// Bodies of one row that walk by the widths of their soft voxels and sensors; the first of
    /// them is worth most.
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

    /// Images whose bright pixels are those of even columns, mostly, if right is right; else those
    /// of odd ones.
    fn images(count: usize) -> Vec<WeightedImage> {
        let mut random = stream(1, Purpose::RandomImages, 0, 0);
        let image = |number: usize| {
            let right = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
            let stimulus = Grid::from_fn(1, PLACES, |_, column| {
                let likely = if column.is_multiple_of(2) == (right > 0.0) { 0.75 } else { 0.25 };
                f64::from(u8::from(random.unit() < likely))
            });
            WeightedImage { stimulus, condition: 0, right, weight: 1.0 }
        };
        (0..count).map(image).collect()
    }

    fn planted() -> Planted {
        Planted { physics: Physics::default(), simulated: 0 }
    }

    /// A champion of soft voxels after a number of challengers of its own, with the fitness after
    /// each.
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
        // What it says of the champion is what it does.
        let stimuli: Vec<Grid<f64>> = refinement.images.iter().map(|image| image.stimulus.clone()).collect();
        let Ok(walked) = rollouts.roll(refinement.body(), &stimuli, &[]);
        assert_eq!(walked.into_iter().flatten().collect::<Vec<_>>(), refinement.displacements());
        (refinement.body().clone(), course, refinement.rollouts())
    }

    #[test]
    fn a_champion_is_never_beaten_by_a_worse_body_and_learns_what_its_images_ask_for() {
        let (body, course, rollouts) = refined(60);
        assert!(course.windows(2).all(|two| two[1] >= two[0]), "{course:?}");
        assert!(course[0].abs() < 1e-9 && course[60] > 0.45, "{course:?}");
        // Most challengers are dropped before they have seen all images.
        assert!(rollouts < 200 * 61 * 2 / 3, "{rollouts}");
        // The place that moves it most is an expanding sensor, since its pixel is bright where
        // right is right.
        assert_eq!(body.voxels()[(0, 0)], Material::SensorExpand);
        assert_eq!(refined(60), (body, course, rollouts), "the same seed refines the same");
    }

    #[test]
    fn both_groups_weigh_the_same_however_many_images_they_have() {
        let gait = Gait::of(&"66".parse().unwrap()).unwrap();
        let image = |right: f64| {
            let stimulus = Grid::from_fn(1, 2, |_, _| 1.0);
            let example =
                Example { right, weight: 0.25, ..Example::new(&gait, &stimulus, &Physics::default()) };
            Image { stimulus, class: 0, example, condition: 0 }
        };
        let images = [image(1.0), image(-1.0), image(-1.0), image(-1.0)];
        let shown = WeightedImage::all(&images.iter().collect::<Vec<_>>(), -1.0);
        let weight = |right: f64| -> f64 {
            shown.iter().filter(|shown| shown.right == right).map(|shown| shown.weight).sum()
        };
        assert!((weight(-1.0) - 0.5).abs() < 1e-12 && (weight(1.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn what_is_hopeless_is_dropped_at_the_first_look_and_what_is_better_is_shown_everything() {
        let (mut rollouts, physics) = (planted(), Physics::default());
        let evidence = (Evidence::new(PLACES), 1.0);
        let good: Body = "656565656565".parse().unwrap();
        let bad: Body = "565656565656".parse().unwrap();
        let Ok(mut refinement) =
            Refinement::new(good.clone(), images(200), evidence.clone(), (&physics, 0, 5), &mut rollouts);
        let Ok(challenge) = refinement.challenge(bad.clone(), &mut rollouts);
        assert_eq!((challenge.won, challenge.shown, challenge.other_gait), (false, FIRST_LOOK, false));
        let Ok(mut refinement) = Refinement::new(bad, images(200), evidence, (&physics, 0, 5), &mut rollouts);
        let Ok(challenge) = refinement.challenge(good.clone(), &mut rollouts);
        assert_eq!((challenge.won, challenge.shown), (true, 200));
        assert_eq!(*refinement.body(), good);
        // A body with a muscle is another gait.
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
        let (good, bad): (Body, Body) = ("656565656565".parse().unwrap(), "565656565656".parse().unwrap());
        let evidence = (Evidence::new(PLACES), 1.0);
        let Ok(mut refinement) =
            Refinement::new(bad.clone(), images(200), evidence, (&physics, 0, 5), &mut rollouts);
        let Ok(challenge) = refinement.challenge(good, &mut Shaky(rollouts));
        assert_eq!((challenge.won, challenge.shown), (false, FIRST_LOOK));
        assert_eq!(*refinement.body(), bad);
    }
}
