//! Teaching a gait: from its response to a design that tells images apart.
//!
//! The response says which design should be best. What it says of a whole design is off, mostly by a constant: many voxels
//! change at once. So the design is shown training images, its displacements correct the model, and the model proposes a
//! design near by (a trust region: Conn, Gould & Toint 2000), which is shown the same images and taken if it does better.
//! Images that the model finds hard are added on the way.

use super::response::{Design, Evidence, Example, Gait, Lesson, Moments, Response, worth};
use crate::base::random::{Purpose, stream};
use crate::body::Material;
use std::collections::BTreeSet;

/// What rollouts under random images count beside those under real ones.
const RANDOM_WEIGHT: f64 = 0.5;

/// What rollouts of a design count for each design after it: older ones lie farther from the present one.
const FADE: f64 = 0.95;

/// Images that a proposal is shown between two looks at whether it falls behind.
const AT_ONCE: usize = 32;

/// Proposals in a row that are rejected before the search ends: there is little left to win.
const PATIENCE: usize = 12;

/// Hard images that are added at a time.
const ADDED: usize = 12;

/// Least number of places that a proposal may change. Smaller ones gain less than a rollout's noise.
const LEAST_RADIUS: usize = 3;

/// How a gait is taught.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Seed of all chance.
    pub seed: u64,
    /// Images that the first design is shown.
    pub images: usize,
    /// Most images that designs are shown.
    pub most_images: usize,
    /// Rollouts under real images in all.
    pub rollouts: usize,
    /// The margin at which an answer is as good as can be \[voxel lengths\].
    pub enough: f64,
}

/// A training image as a gait sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Its widths, its right side and its weight.
    pub example: Example,
    /// The condition under which it is shown: a number from 0.
    pub condition: usize,
}

/// What became of a proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Round {
    /// Its number, from 0.
    pub round: usize,
    /// Rollouts so far.
    pub rollouts: usize,
    /// Most places that might change.
    pub radius: usize,
    /// Places that changed.
    pub changed: usize,
    /// Images shown.
    pub images: usize,
    /// Mean worth of the design's answers to them.
    pub objective: f64,
    /// Share of them with a margin above 3 voxel lengths.
    pub accuracy: f64,
    /// Mean worth of the proposal's, if it was shown them all.
    pub proposed: Option<f64>,
    /// What the model said of it, on all training images.
    pub predicted: f64,
}

/// A design that was taught.
#[derive(Clone, Debug, PartialEq)]
pub struct Taught {
    /// The design.
    pub design: Design,
    /// Training images it was shown, by their numbers.
    pub shown: Vec<usize>,
    /// Its displacement under each of them \[voxel lengths\].
    pub displacements: Vec<f64>,
    /// Mean worth of its answers.
    pub objective: f64,
    /// Which way the first group walks: 1 right, −1 left.
    pub side: f64,
    /// Rollouts under real images.
    pub rollouts: usize,
}

/// A design under way: what it was shown so far.
struct Trial {
    design: Design,
    /// By place in the list of shown images.
    displacements: Vec<f64>,
    /// By condition.
    moments: Vec<Moments>,
}

impl Trial {
    fn new(design: Design, conditions: usize) -> Self {
        let moments = vec![Moments::new(design.len()); conditions];
        Trial { design, displacements: Vec::new(), moments }
    }
}

/// What simulates designs.
pub trait Rollouts {
    /// Why there are none: stopped, or a file that cannot be written.
    type Error;
    /// The displacements of a design under training images, by their numbers \[voxel lengths\]; `None` if it is unstable
    /// under one of them.
    ///
    /// # Errors
    /// If it was stopped.
    fn roll(&mut self, design: &[Material], images: &[usize]) -> Result<Option<Vec<f64>>, Self::Error>;
}

/// Teaches a gait, whose response is known, to tell images apart; `told` is told of every proposal.
///
/// # Errors
/// What the rollouts say.
pub fn teach<R: Rollouts>(
    gait: &Gait,
    response: &Response,
    images: &[Image],
    plan: &Plan,
    rollouts: &mut R,
    mut told: impl FnMut(&Round),
) -> Result<Taught, R::Error> {
    let mut teacher = Teacher::new(gait, response, images, plan);
    let (first, side) = teacher.first_design();
    teacher.side = side;
    let mut best = teacher.trial(first);
    teacher.show(&mut best, rollouts)?;
    let places = gait.places().len();
    let (mut radius, mut rejected, mut number) = (places, 0, 0);
    let mut known = BTreeSet::from([best.design.clone()]);
    while teacher.rollouts < plan.rollouts {
        let (design, predicted, changed) = teacher.proposal(&best, radius, rejected);
        let is_new = known.insert(design.clone());
        let mut trial = teacher.trial(design);
        let (objective, accuracy) = teacher.objective(&best);
        let is_whole = is_new && teacher.race(&mut trial, &best, rollouts)?;
        let proposed = is_whole.then(|| teacher.objective(&trial).0);
        told(&Round {
            round: number,
            rollouts: teacher.rollouts,
            radius,
            changed,
            images: teacher.shown.len(),
            objective,
            accuracy,
            proposed,
            predicted,
        });
        number += 1;
        if proposed.is_some_and(|proposed| proposed > objective) {
            teacher.close(std::mem::replace(&mut best, trial));
            (radius, rejected) = ((2 * changed.max(2)).min(places), 0);
        } else {
            teacher.close(trial);
            let tried = if changed > 0 { changed.min(radius) } else { radius };
            (radius, rejected) = ((tried / 2).max(LEAST_RADIUS), rejected + 1);
        }
        if rejected >= PATIENCE {
            break;
        }
        if rejected.is_multiple_of(3) {
            teacher.add_hard(&best);
        }
        teacher.show(&mut best, rollouts)?;
    }
    let (objective, _) = teacher.objective(&best);
    Ok(Taught {
        design: best.design,
        shown: teacher.shown,
        displacements: best.displacements,
        objective,
        side: teacher.side,
        rollouts: teacher.rollouts,
    })
}

struct Teacher<'a> {
    response: &'a Response,
    images: &'a [Image],
    plan: &'a Plan,
    conditions: usize,
    places: usize,
    /// What designs before the present one told.
    before: Evidence,
    /// Numbers of the images that designs are shown.
    shown: Vec<usize>,
    /// Which way the first group walks: 1 right, −1 left.
    side: f64,
    rollouts: usize,
    draws: u64,
}

impl<'a> Teacher<'a> {
    fn new(gait: &'a Gait, response: &'a Response, images: &'a [Image], plan: &'a Plan) -> Self {
        let places = gait.places().len();
        let conditions = 1 + images.iter().map(|image| image.condition).max().unwrap_or(0);
        let mut random = stream(plan.seed, Purpose::Training, 0, 0);
        let shown = random.sample(images.len(), plan.images.min(images.len()));
        let before = Evidence::new(places);
        Teacher {
            response,
            images,
            plan,
            conditions,
            places,
            before,
            shown,
            side: 1.0,
            rollouts: 0,
            draws: 0,
        }
    }

    fn trial(&self, design: Design) -> Trial {
        Trial::new(design, self.conditions)
    }

    /// The best design by the response alone, and which way it has the first group walk: 1 right, −1 left.
    fn first_design(&mut self) -> (Design, f64) {
        let soft = vec![Material::Soft; self.places];
        let displaced = |image: &Image| {
            let widths = image.example.widths(&soft);
            let moved: f64 = widths.iter().zip(&self.response.slopes).map(|(w, slope)| w * slope).sum();
            Example { displacement: self.response.intercept + moved, ..image.example.clone() }
        };
        let examples: Vec<Example> = self.images.iter().map(displaced).collect();
        let solved = |side: f64, draw: u64| {
            let turned: Vec<Example> =
                examples.iter().map(|e| Example { right: e.right * side, ..e.clone() }).collect();
            let turned: Vec<&Example> = turned.iter().collect();
            let mut lesson = Lesson::new(&turned, &self.response.slopes, &soft, self.plan.enough);
            lesson.solve_from_many(&mut stream(self.plan.seed, Purpose::Training, 1, draw));
            (lesson.objective(), lesson.design())
        };
        let (right, left) = (solved(1.0, 0), solved(-1.0, 1));
        if right.0 >= left.0 { (right.1, 1.0) } else { (left.1, -1.0) }
    }

    /// Shows a design the images that it has not been shown yet. Where it is unstable it gets nowhere.
    fn show<R: Rollouts>(&mut self, trial: &mut Trial, rollouts: &mut R) -> Result<(), R::Error> {
        let new = self.shown[trial.displacements.len()..].to_vec();
        let found = self.roll(trial, &new, rollouts)?;
        trial.displacements.extend(found.unwrap_or_else(|| vec![0.0; new.len()]));
        Ok(())
    }

    /// Displacements under some images; `None` if the design is unstable under one.
    fn roll<R: Rollouts>(
        &mut self,
        trial: &mut Trial,
        images: &[usize],
        rollouts: &mut R,
    ) -> Result<Option<Vec<f64>>, R::Error> {
        let found = rollouts.roll(&trial.design, images)?;
        self.rollouts += images.len();
        for (image, displacement) in images.iter().zip(found.iter().flatten()) {
            let Image { example, condition } = &self.images[*image];
            trial.moments[*condition].add(&example.widths(&trial.design), *displacement);
        }
        Ok(found)
    }

    fn worth(&self, place: usize, displacement: f64) -> (f64, f64) {
        let example = &self.images[self.shown[place]].example;
        (worth(self.side * example.right * displacement, self.plan.enough), example.weight)
    }

    /// The weighted mean worth of a design's answers, and the share that are right.
    fn objective(&self, trial: &Trial) -> (f64, f64) {
        let (mut sum, mut right, mut total) = (0.0, 0.0, 0.0);
        for (place, displacement) in trial.displacements.iter().enumerate() {
            let (worth, weight) = self.worth(place, *displacement);
            sum += weight * worth;
            right += if worth * self.plan.enough > 3.0 { weight } else { 0.0 };
            total += weight;
        }
        (sum / total, right / total)
    }

    /// Shows a design the images that a rival was shown, those first that the rival answered worst; whether it was shown
    /// all: not if it is unstable, or cannot do better any more.
    fn race<R: Rollouts>(
        &mut self,
        trial: &mut Trial,
        rival: &Trial,
        rollouts: &mut R,
    ) -> Result<bool, R::Error> {
        let worths: Vec<(f64, f64)> =
            rival.displacements.iter().enumerate().map(|(place, d)| self.worth(place, *d)).collect();
        let mut order: Vec<usize> = (0..worths.len()).collect();
        order.sort_by(|a, b| worths[*a].0.total_cmp(&worths[*b].0));
        // By how much it would be ahead if it answered the rest as well as can be.
        let mut ahead: f64 = worths.iter().map(|(worth, weight)| weight * (1.0 - worth)).sum();
        let mut displacements = vec![0.0; worths.len()];
        for places in order.chunks(AT_ONCE) {
            let images: Vec<usize> = places.iter().map(|place| self.shown[*place]).collect();
            let Some(found) = self.roll(trial, &images, rollouts)? else { return Ok(false) };
            for (place, displacement) in places.iter().zip(found) {
                displacements[*place] = displacement;
                let (worth, weight) = self.worth(*place, displacement);
                ahead -= weight * (1.0 - worth);
            }
            if ahead <= 0.0 {
                return Ok(false);
            }
        }
        trial.displacements = displacements;
        Ok(true)
    }

    fn close(&mut self, trial: Trial) {
        self.before.fade(FADE);
        trial.moments.iter().for_each(|set| self.before.add(set, 1.0));
    }

    /// Slopes near a design, and by what they may be off.
    fn slopes(&self, trial: &Trial) -> (Vec<f64>, Vec<f64>) {
        let mut evidence = self.response.evidence.clone();
        evidence.fade(RANDOM_WEIGHT);
        evidence.join(&self.before);
        trial.moments.iter().for_each(|set| evidence.add(set, 1.0));
        evidence.slopes(self.response.ridge)
    }

    /// All training images with the displacements of a design: measured where it was shown them, else by the model.
    fn examples(&self, trial: &Trial, slopes: &[f64]) -> Vec<Example> {
        let mean = {
            let all: Vec<f64> = trial.moments.iter().filter_map(|set| set.intercept(slopes)).collect();
            all.iter().sum::<f64>() / all.len().max(1) as f64
        };
        let intercepts: Vec<f64> =
            trial.moments.iter().map(|set| set.intercept(slopes).unwrap_or(mean)).collect();
        let modelled = |image: &Image| {
            let widths = image.example.widths(&trial.design);
            let moved: f64 = widths.iter().zip(slopes).map(|(width, slope)| width * slope).sum();
            let example = image.example.clone();
            let displacement = intercepts[image.condition] + moved;
            Example { displacement, right: self.side * example.right, ..example }
        };
        let mut examples: Vec<Example> = self.images.iter().map(modelled).collect();
        // What was measured counts as much as all that was not.
        let (mut of_shown, mut of_others) = (0.0, 0.0);
        let mut is_shown = vec![false; examples.len()];
        self.shown.iter().for_each(|image| is_shown[*image] = true);
        for (example, is_shown) in examples.iter().zip(&is_shown) {
            *(if *is_shown { &mut of_shown } else { &mut of_others }) += example.weight;
        }
        for (image, displacement) in self.shown.iter().zip(&trial.displacements) {
            examples[*image].displacement = *displacement;
            if of_others > 0.0 {
                examples[*image].weight *= (of_others / of_shown).max(1.0);
            }
        }
        examples
    }

    /// A design near by that the model finds better, what it says of it, and at how many places it differs.
    fn proposal(&mut self, trial: &Trial, radius: usize, rejected: usize) -> (Design, f64, usize) {
        let (mut slopes, errors) = self.slopes(trial);
        self.draws += 1;
        let mut random = stream(self.plan.seed, Purpose::Training, 2, self.draws);
        if rejected > 0 {
            // Other slopes that are as likely: else the model would propose the same again.
            let noise = self.response.noise * rejected as f64;
            slopes
                .iter_mut()
                .zip(&errors)
                .for_each(|(slope, error)| *slope += noise * error * random.normal());
        }
        let examples = self.examples(trial, &slopes);
        let examples: Vec<&Example> = examples.iter().collect();
        let mut lesson = Lesson::new(&examples, &slopes, &trial.design, self.plan.enough);
        if radius >= self.places {
            lesson.solve(&mut random);
        } else {
            lesson.solve_near(radius);
        }
        let design = lesson.design();
        let changed = design.iter().zip(&trial.design).filter(|(a, b)| a != b).count();
        (design, lesson.objective(), changed)
    }

    /// Adds those images that the model finds nearest to where the answer changes: designs differ most in these. (The
    /// hardest of all are hopeless, and no design would be told from another by them.)
    fn add_hard(&mut self, trial: &Trial) {
        let room = self.plan.most_images.min(self.images.len()).saturating_sub(self.shown.len());
        if room == 0 {
            return;
        }
        let (slopes, _) = self.slopes(trial);
        let examples = self.examples(trial, &slopes);
        let mut is_shown = vec![false; examples.len()];
        self.shown.iter().for_each(|image| is_shown[*image] = true);
        let mut others: Vec<(usize, f64)> = (examples.iter().enumerate())
            .filter(|(image, _)| !is_shown[*image])
            .map(|(image, example)| (image, example.displacement.abs()))
            .collect();
        others.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        self.shown.extend(others.into_iter().take(room.min(ADDED)).map(|(image, _)| image));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Grid;
    use crate::body::Body;
    use crate::sim::Physics;
    use crate::task::response::Shown;
    use std::convert::Infallible;

    /// A linear body, but for a constant that depends on the design, and is not seen in its response.
    struct Planted {
        gait: Gait,
        slopes: Vec<f64>,
        images: Vec<Image>,
        asked: Vec<(Design, Vec<usize>)>,
        unstable: bool,
    }

    impl Planted {
        fn new(places: usize, images: usize) -> Self {
            let body: Body = "6".repeat(places).parse().unwrap();
            let gait = Gait::of(&body).unwrap();
            let mut random = stream(7, Purpose::RandomImages, 0, 0);
            let slopes: Vec<f64> = (0..places).map(|_| 4.0 * random.normal()).collect();
            let image = |number: usize, random: &mut crate::base::random::Stream| {
                let right = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
                // Every pixel says a little of the class.
                let bright =
                    |column: usize| 0.5 + if column.is_multiple_of(2) { 0.15 * right } else { -0.15 * right };
                let stimulus =
                    Grid::from_fn(1, places, |_, c| f64::from(u8::from(random.unit() < bright(c))));
                let example = Example { right, ..Example::new(&gait, &stimulus, &Physics::default()) };
                Image { example, condition: number / 2 % 2 }
            };
            let images = (0..images).map(|number| image(number, &mut random)).collect();
            Planted { gait, slopes, images, asked: Vec::new(), unstable: false }
        }

        fn walks(&self, design: &[Material], widths: &[f64], condition: usize) -> f64 {
            // It stands still when its sensors are half open: no choice of sensors could make up for more.
            let moved: f64 =
                widths.iter().zip(&self.slopes).map(|(width, slope)| (width - 1.1) * slope).sum();
            // What the probe, which has none of them, does not tell.
            let shrinking = design.iter().filter(|material| **material == Material::SensorShrink).count();
            moved + [3.0, -2.0][condition] - 0.8 * shrinking as f64
        }

        fn response(&self) -> Response {
            let mut random = stream(7, Purpose::RandomImages, 0, 1);
            let shown = |number: usize| {
                let widths: Vec<f64> =
                    self.slopes.iter().map(|_| if random.unit() < 0.5 { 1.6 } else { 0.6 }).collect();
                let probe = vec![Material::SensorExpand; widths.len()];
                let displacement = self.walks(&probe, &widths, number % 2);
                Shown { widths, displacement, condition: number % 2 }
            };
            Response::of(&(0..200).map(shown).collect::<Vec<_>>()).unwrap()
        }

        fn taught(&mut self, plan: &Plan) -> (Taught, Vec<Round>) {
            let (gait, images, response) = (self.gait.clone(), self.images.clone(), self.response());
            let mut rounds = Vec::new();
            let Ok(taught) = teach(&gait, &response, &images, plan, self, |round| rounds.push(round.clone()));
            (taught, rounds)
        }
    }

    impl Rollouts for Planted {
        type Error = Infallible;
        fn roll(&mut self, design: &[Material], images: &[usize]) -> Result<Option<Vec<f64>>, Infallible> {
            self.asked.push((design.to_vec(), images.to_vec()));
            let walk = |image: &usize| {
                let Image { example, condition } = &self.images[*image];
                self.walks(design, &example.widths(design), *condition)
            };
            Ok((!self.unstable).then(|| images.iter().map(walk).collect()))
        }
    }

    const PLAN: Plan = Plan { seed: 3, images: 40, most_images: 80, rollouts: 1500, enough: 10.0 };

    fn accuracy(planted: &Planted, taught: &Taught) -> f64 {
        let is_right = |image: &&Image| {
            let walks = planted.walks(&taught.design, &image.example.widths(&taught.design), image.condition);
            walks * image.example.right * taught.side > 3.0
        };
        planted.images.iter().filter(is_right).count() as f64 / planted.images.len() as f64
    }

    #[test]
    fn a_gait_is_taught_what_its_slopes_allow_although_the_response_is_off_by_a_constant() {
        let mut planted = Planted::new(40, 600);
        let (taught, rounds) = planted.taught(&PLAN);
        let first = Taught { design: planted.asked[0].0.clone(), ..taught.clone() };
        let (before, after) = (accuracy(&planted, &first), accuracy(&planted, &taught));
        assert!(after > 0.73 && after > before + 0.03, "{before} {after}");
        assert!(taught.rollouts <= PLAN.rollouts + PLAN.most_images && !rounds.is_empty());
        let shown: BTreeSet<usize> = taught.shown.iter().copied().collect();
        assert!(shown.len() == taught.shown.len() && shown.len() <= PLAN.most_images);
        // What it says of the design is what was measured.
        for (image, displacement) in taught.shown.iter().zip(&taught.displacements) {
            let Image { example, condition } = &planted.images[*image];
            assert_eq!(
                *displacement,
                planted.walks(&taught.design, &example.widths(&taught.design), *condition)
            );
        }
    }

    #[test]
    fn the_same_seed_teaches_the_same_and_no_design_is_shown_an_image_twice() {
        let (mut a, mut b) = (Planted::new(20, 200), Planted::new(20, 200));
        assert_eq!(a.taught(&PLAN), b.taught(&PLAN));
        assert_eq!(a.asked, b.asked);
        let mut seen = BTreeSet::new();
        for (design, images) in &a.asked {
            assert!(images.iter().all(|image| seen.insert((design.clone(), *image))));
        }
    }

    #[test]
    fn a_gait_that_is_never_stable_ends_with_its_first_design() {
        let mut planted = Planted { unstable: true, ..Planted::new(10, 100) };
        let (taught, rounds) = planted.taught(&PLAN);
        assert_eq!(taught.design, planted.asked[0].0);
        assert!(
            taught.displacements.iter().all(|d| *d == 0.0) && rounds.iter().all(|r| r.proposed.is_none())
        );
    }
}
