//! [`Surrogate`]: a linear model of how a robot answers, to tell promising changes of single voxels from others before any of
//! them has lived (pre-selection by a surrogate, as surveyed by Jin 2011).
//!
//! Bodies that recognise images turn out to be nearly linear: of the variance of displacements over hundreds of images, a model
//! with one number per sensor explains 85 to 93 % (robots of `zero_one_curriculum.toml`, on images it was not fitted to).

use super::direction::Assignment;
use super::fitness::{Fitness, WRONG};
use super::grouping::{Group, Split};
use super::score::Answer;
use crate::base::Grid;
use crate::body::{Body, Material};
use nalgebra::{DMatrix, DVector};

/// What an influence is charged for: as much as so many images whose displacement the model misses by that influence.
const RIDGE: f64 = 1.0;

/// Distance at which a sensor says a quarter as much about a place as one that is there \[voxels\].
const REACH: f64 = 1.0;

/// Weight, in sensors at the place, of what is believed of a place without knowing of any sensor: that it has no influence.
const DOUBT: f64 = 0.5;

/// A linear model of a robot's displacements.
#[derive(Clone, Debug)]
pub struct Surrogate<'a> {
    body: &'a Body,
    stimuli: &'a [Grid<f64>],
    /// By how much a pixel of 1 moves the robot to the right, by place: through the sensor that is there.
    influence: Grid<f64>,
    /// The same for a sensor that expands where there is none, after its neighbours.
    expected: Grid<f64>,
    /// For each image that counts: its number, 1 if the robot is to walk right and −1 if left, its displacement (as it was, or else as
    /// the model has it), and what it weighs.
    images: Vec<(usize, f64, f64, f64)>,
}

/// Which way a voxel's width goes with its pixel.
fn sense(material: Material) -> f64 {
    match material {
        Material::SensorExpand => 1.0,
        Material::SensorShrink => -1.0,
        _ => 0.0,
    }
}

impl<'a> Surrogate<'a> {
    /// A model of a robot that answered some of the images, in their order, on a task: least squares over what it was shown,
    /// with small influences preferred. `None` if it has not answered any.
    pub fn of(
        body: &'a Body,
        stimuli: &'a [Grid<f64>],
        answers: &[Answer],
        split: &Split,
        fitness: Fitness,
    ) -> Option<Self> {
        let voxels = body.voxels();
        let sensors: Vec<(usize, usize)> =
            voxels.iter().filter(|(_, m)| m.is_sensor()).map(|(place, _)| place).collect();
        let seen = |stimulus: &Grid<f64>| -> Vec<f64> {
            sensors.iter().map(|&place| pixel(stimulus, place)).chain([1.0]).collect()
        };
        let unknowns = sensors.len() + 1;
        let (mut matrix, mut vector) = (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
        let mut is_shown = false;
        for (stimulus, answer) in stimuli.iter().zip(answers) {
            let Some(displacement) = answer.displacement else { continue };
            is_shown = true;
            let seen = seen(stimulus);
            for (i, x) in seen.iter().enumerate().filter(|(_, x)| **x != 0.0) {
                vector[i] += x * displacement;
                seen[..=i].iter().enumerate().for_each(|(j, y)| matrix[(i, j)] += x * y);
            }
        }
        (0..sensors.len()).for_each(|i| matrix[(i, i)] += RIDGE);
        // Only the lower triangle is looked at.
        let solution = matrix.cholesky().filter(|_| is_shown)?.solve(&vector);
        let mut influence = Grid::filled(voxels.height(), voxels.width(), 0.0);
        sensors.iter().zip(solution.iter()).for_each(|(&place, &value)| influence[place] = value);

        let a_right = Assignment::from_training(split, fitness, answers);
        let groups = || answers.iter().map(|answer| split.group(answer.class));
        let count = |group| groups().filter(|g| *g == Some(group)).count().max(1) as f64;
        let weights = [1.0 / count(Group::A), 1.0 / count(Group::B)];
        let images = (stimuli.iter().zip(answers).zip(groups()).enumerate())
            .filter_map(|(number, ((stimulus, answer), group))| {
                let group = group?;
                let model = || seen(stimulus).iter().zip(solution.iter()).map(|(x, w)| x * w).sum();
                let displacement = answer.displacement.unwrap_or_else(model);
                Some((
                    number,
                    a_right.margin(group, 1.0),
                    displacement,
                    weights[usize::from(group == Group::B)],
                ))
            })
            .collect();
        let expected = Grid::from_fn(voxels.height(), voxels.width(), |row, column| {
            let (mut sum, mut weight) = (0.0, DOUBT);
            for &(r, c) in &sensors {
                let distance =
                    ((row.abs_diff(r).pow(2) + column.abs_diff(c).pow(2)) as f64) / (REACH * REACH);
                let nearness = 1.0 / ((1.0 + distance) * (1.0 + distance));
                sum += nearness * sense(voxels[(r, c)]) * influence[(r, c)];
                weight += nearness;
            }
            sum / weight
        });
        Some(Surrogate { body, stimuli, influence, expected, images })
    }

    /// How well a body would do that differs in a few voxels, if nothing else changed but what its sensors see: the mean of its
    /// answers' worth, both groups weighing the same. An answer whose margin is u times 3 voxel lengths beyond what counts as right
    /// is worth u/(1 + |u|): those that are nearly right, or nearly wrong, matter most, and none ceases to.
    pub fn worth(&self, child: &Body) -> f64 {
        let changes: Vec<((usize, usize), f64)> = (child.voxels().iter())
            .filter_map(|(place, &material)| {
                let before = sense(self.body.voxels()[place]);
                let change = sense(material) - before;
                let each = if before == 0.0 { self.expected[place] } else { self.influence[place] * before };
                (change != 0.0).then_some((place, change * each))
            })
            .collect();
        let worth = |&(number, right, displacement, weight): &(usize, f64, f64, f64)| {
            let stimulus = &self.stimuli[number];
            let change: f64 = changes.iter().map(|&(place, each)| each * pixel(stimulus, place)).sum();
            let excess = right * (displacement + change) - WRONG;
            weight * excess / (excess.abs() + WRONG)
        };
        self.images.iter().map(worth).sum::<f64>() / 2.0
    }
}

fn pixel(stimulus: &Grid<f64>, (row, column): (usize, usize)) -> f64 {
    stimulus.get(row as isize, column as isize).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};
    use crate::task::grouping::Grouping;

    /// A sensor of each kind, apart from each other, and a muscle.
    fn body() -> Body {
        "50003/00000/20006".parse().unwrap()
    }

    /// Images of two classes by turns; the first sensor's pixel is on for class 0 only, the last one's at random.
    fn stimuli(count: usize) -> Vec<Grid<f64>> {
        let mut random = stream(1, Purpose::Images, 0, 0);
        let mut image = |number: usize| {
            Grid::from_fn(3, 5, |row, column| match (row, column) {
                (0, 0) => f64::from(u8::from(number.is_multiple_of(2))),
                _ => f64::from(u8::from(random.unit() < 0.5)),
            })
        };
        (0..count).map(&mut image).collect()
    }

    /// A robot that is as linear as can be: −6 + 12 · pixel of the first sensor − 6 · that of the last.
    fn answers(stimuli: &[Grid<f64>], known: usize) -> Vec<Answer> {
        let walk = |stimulus: &Grid<f64>| -6.0 + 12.0 * stimulus[(0, 0)] - 6.0 * stimulus[(2, 4)];
        let answer = |(number, stimulus)| Answer {
            class: (number % 2) as u8,
            displacement: (number < known).then(|| walk(stimulus)),
        };
        stimuli.iter().enumerate().map(answer).collect()
    }

    fn split() -> Split {
        Grouping::two_groups(&[0], &[1]).unwrap().tasks()[0].clone()
    }

    fn surrogate<'a>(body: &'a Body, stimuli: &'a [Grid<f64>], known: usize) -> Option<Surrogate<'a>> {
        Surrogate::of(body, stimuli, &answers(stimuli, known), &split(), Fitness::RightThenMin)
    }

    #[test]
    fn influences_of_a_linear_robot_are_found_and_what_it_was_not_shown_is_foretold() {
        let (body, stimuli) = (body(), stimuli(400));
        let model = surrogate(&body, &stimuli, 200).unwrap();
        let influence = |place| model.influence[place];
        assert!((influence((0, 0)) - 12.0).abs() < 0.4 && (influence((2, 4)) + 6.0).abs() < 0.4, "{model:?}");
        assert_eq!(influence((2, 0)), 0.0);
        let truth = answers(&stimuli, 400);
        assert_eq!(model.images.len(), 400);
        for &(number, right, displacement, weight) in &model.images {
            let walked = truth[number].displacement.unwrap();
            // What was shown is kept as it was.
            assert!((displacement - walked).abs() < if number < 200 { 1e-12 } else { 0.5 });
            assert_eq!((right, weight), (if number % 2 == 0 { 1.0 } else { -1.0 }, 1.0 / 200.0));
        }
    }

    #[test]
    fn changes_that_help_promise_more_than_the_robot_and_those_that_harm_less() {
        let (body, stimuli) = (body(), stimuli(200));
        let model = surrogate(&body, &stimuli, 200).unwrap();
        let worth = |text: &str| model.worth(&text.parse::<Body>().unwrap());
        let now = worth("50003/00000/20006");
        // The last sensor only disturbs: where its pixel is on, the robot stands still for a 0.
        assert!(worth("50003/00000/20000") > now);
        // The first one is all that tells the classes apart; the other way round it tells them apart wrongly.
        let (without, turned) = (worth("00003/00000/20006"), worth("60003/00000/20006"));
        assert!(now > without && without > turned, "{now} {without} {turned}");
        // What no sensor sees changes nothing.
        assert_eq!([worth("50004/00000/10006"), worth("50003/01110/20006")], [now, now]);
    }

    #[test]
    fn a_new_sensor_is_believed_to_work_as_its_neighbours_do() {
        let (body, stimuli) = (body(), stimuli(200));
        let model = surrogate(&body, &stimuli, 200).unwrap();
        // The first one shrinks and leads to the right: those beside it that shrink are to do so, too, but less.
        let expected = |place| model.expected[place];
        assert!(expected((0, 1)) < -0.5 && expected((0, 1)) > -12.0 && expected((0, 1)) < expected((1, 1)));
        assert!(expected((2, 3)) < -0.5 && expected((2, 3)) > -6.0);
        // A pixel that is on for 0 and 1 alike tells nothing: both ways it does harm to one of them.
        let beside =
            |sensor: &str| model.worth(&format!("5{sensor}003/00000/20006").parse::<Body>().unwrap());
        let change = |sensor: &str| beside(sensor) - beside("0");
        assert!(change("5") != 0.0 && change("6") != 0.0);
    }

    #[test]
    fn groups_weigh_the_same_and_other_classes_do_not_count() {
        let (body, stimuli) = (body(), stimuli(90));
        let split = Grouping::two_groups(&[0], &[1, 2]).unwrap().tasks()[0].clone();
        let answers: Vec<Answer> = (0..90)
            .map(|i| Answer {
                class: (i % 6).min(3) as u8,
                displacement: Some(if i % 6 == 0 { -1e9 } else { 1e9 }),
            })
            .collect();
        let model = Surrogate::of(&body, &stimuli, &answers, &split, Fitness::Min).unwrap();
        assert_eq!(model.images.len(), 45);
        // Everything right, by far; of three classes with as many images each.
        assert!((model.worth(&body) - 1.0).abs() < 1e-6);
        let sum = |way: f64| model.images.iter().filter(|i| i.1 == way).map(|i| i.3).sum::<f64>();
        assert!((sum(1.0) - 1.0).abs() < 1e-12 && (sum(-1.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn robots_that_see_nothing_or_were_shown_nothing_are_no_trouble() {
        let stimuli = stimuli(20);
        let blind: Body = "333/222".parse().unwrap();
        let model = surrogate(&blind, &stimuli, 20).unwrap();
        assert!(model.worth(&blind).is_finite() && model.expected.cells().iter().all(|e| *e == 0.0));
        assert_eq!(model.worth(&blind), model.worth(&"363/222".parse().unwrap()));
        assert!(surrogate(&body(), &stimuli, 0).is_none() && surrogate(&blind, &[], 0).is_none());
    }
}
