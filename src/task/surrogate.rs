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

/// Distances over which a robot's influences may be alike \[voxels\]: the one is taken that foretells best.
const REACHES: [f64; 2] = [1.5, 3.0];

/// What influences may be charged for, in images that are missed by as much: the one is taken that foretells best.
const CHARGES: [f64; 4] = [1.0, 8.0, 64.0, 512.0];

/// Every so manieth image is foretold from the others. (Classes often take turns, and are two or four: no fold is to be of one.)
const FOLDS: usize = 5;

/// A linear model of a robot's displacements.
#[derive(Clone, Debug)]
pub struct Surrogate<'a> {
    body: &'a Body,
    stimuli: &'a [Grid<f64>],
    /// By how much a pixel of 1 moves the robot to the right, by place, where there is a sensor that expands; minus that, one that
    /// shrinks.
    influence: Grid<f64>,
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
    /// A model of a robot that answered some of the images, in their order, on a task. `None` if it has not answered any.
    pub fn of(
        body: &'a Body,
        stimuli: &'a [Grid<f64>],
        answers: &[Answer],
        split: &Split,
        fitness: Fitness,
    ) -> Option<Self> {
        let voxels = body.voxels();
        let sensors: Vec<((usize, usize), f64)> =
            voxels.iter().map(|(place, m)| (place, sense(*m))).filter(|(_, sense)| *sense != 0.0).collect();
        let seen = |stimulus: &Grid<f64>| -> Vec<f64> {
            sensors.iter().map(|&(place, sense)| sense * pixel(stimulus, place)).collect()
        };
        let shown: Vec<(Vec<f64>, f64)> = (stimuli.iter().zip(answers))
            .filter_map(|(stimulus, answer)| Some((seen(stimulus), answer.displacement?)))
            .collect();
        let Linear { reach, weights, mean, means } = Linear::of(&shown, &sensors)?;
        let influence = Grid::from_fn(voxels.height(), voxels.width(), |row, column| {
            let of = |(&(place, _), weight): (&((usize, usize), f64), &f64)| {
                weight * alike((row, column), place, reach)
            };
            sensors.iter().zip(weights.iter()).map(of).sum()
        });
        let of_sensors: Vec<f64> = sensors.iter().map(|(place, _)| influence[*place]).collect();

        let a_right = Assignment::from_training(split, fitness, answers);
        let groups = || answers.iter().map(|answer| split.group(answer.class));
        let count = |group| groups().filter(|g| *g == Some(group)).count().max(1) as f64;
        let weights = [1.0 / count(Group::A), 1.0 / count(Group::B)];
        let images = (stimuli.iter().zip(answers).zip(groups()).enumerate())
            .filter_map(|(number, ((stimulus, answer), group))| {
                let group = group?;
                let terms = |((x, m), w): ((f64, &f64), &f64)| (x - m) * w;
                let model =
                    || mean + seen(stimulus).into_iter().zip(&means).zip(&of_sensors).map(terms).sum::<f64>();
                let displacement = answer.displacement.unwrap_or_else(model);
                Some((
                    number,
                    a_right.margin(group, 1.0),
                    displacement,
                    weights[usize::from(group == Group::B)],
                ))
            })
            .collect();
        Some(Surrogate { body, stimuli, influence, images })
    }

    /// How well a body would do that differs in a few voxels, if nothing else changed but what its sensors see: the mean of its
    /// answers' worth, both groups weighing the same. An answer whose margin is u times 3 voxel lengths beyond what counts as right
    /// is worth u/(1 + |u|): those that are nearly right, or nearly wrong, matter most, and none ceases to.
    pub fn worth(&self, child: &Body) -> f64 {
        let changes: Vec<((usize, usize), f64)> = (child.voxels().iter())
            .filter_map(|(place, &material)| {
                let change = (sense(material) - sense(self.body.voxels()[place])) * self.influence[place];
                (change != 0.0).then_some((place, change))
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

/// Displacements as a mean and, for each sensor, a part in proportion to what it sees beyond its own mean.
struct Linear {
    reach: f64,
    /// Of the sensors' likeness to a place, what makes its influence.
    weights: DMatrix<f64>,
    mean: f64,
    means: Vec<f64>,
}

impl Linear {
    /// The influences that are most likely, given what a robot saw and did, if those of near places are alike (regression with a
    /// Gaussian process; Rasmussen & Williams 2006, chapter 2): how near, and how large they may be, is found out by foretelling
    /// some images from the others.
    fn of(shown: &[(Vec<f64>, f64)], sensors: &[((usize, usize), f64)]) -> Option<Self> {
        let count = sensors.len();
        let (mean, means) = means(shown, count)?;
        if count == 0 {
            return Some(Linear { reach: REACHES[0], weights: DMatrix::zeros(0, 1), mean, means });
        }
        let centred: Vec<(DVector<f64>, f64)> = (shown.iter())
            .map(|(seen, d)| (DVector::from_fn(count, |i, _| seen[i] - means[i]), d - mean))
            .collect();
        let folds: Vec<Moments> =
            (0..FOLDS).map(|fold| Moments::of(centred.iter().skip(fold).step_by(FOLDS), count)).collect();
        let all = folds.iter().fold(Moments::of([].iter(), count), |sum, fold| sum.plus(fold, 1.0));
        let mut best = (f64::INFINITY, REACHES[0], CHARGES[0]);
        for reach in REACHES {
            let likeness = likeness(sensors, reach);
            let mut errors = CHARGES.map(|charge| (0.0, reach, charge));
            for (number, fold) in folds.iter().enumerate() {
                let others = all.plus(fold, -1.0);
                let system = product(&others.matrix, &likeness);
                for (error, _, charge) in &mut errors {
                    let weights = charged(&system, *charge, &others.vector)?;
                    let influence = product(&likeness, &weights);
                    let missed = |(seen, d): &(DVector<f64>, f64)| d - seen.dot(&influence.column(0));
                    let squared = |image| missed(image) * missed(image);
                    *error += centred.iter().skip(number).step_by(FOLDS).map(squared).sum::<f64>();
                }
            }
            best = errors.into_iter().fold(best, |best, next| if next.0 < best.0 { next } else { best });
        }
        let (_, reach, charge) = best;
        let weights = charged(&product(&all.matrix, &likeness(sensors, reach)), charge, &all.vector)?;
        Some(Linear { reach, weights, mean, means })
    }
}

/// The mean displacement, and that of what each sensor saw; `None` of no images.
fn means(shown: &[(Vec<f64>, f64)], count: usize) -> Option<(f64, Vec<f64>)> {
    let (mut sum, mut sums) = (0.0, vec![0.0; count]);
    for (seen, displacement) in shown {
        sum += displacement;
        sums.iter_mut().zip(seen).for_each(|(sum, x)| *sum += x);
    }
    let number = shown.len() as f64;
    (number > 0.0).then(|| (sum / number, sums.into_iter().map(|sum| sum / number).collect()))
}

/// Sums over images, of products of what sensors saw with each other, and with the displacement.
#[derive(Clone)]
struct Moments {
    matrix: DMatrix<f64>,
    /// One column.
    vector: DMatrix<f64>,
}

impl Moments {
    fn of<'b>(images: impl Iterator<Item = &'b (DVector<f64>, f64)>, count: usize) -> Self {
        let (mut matrix, mut vector) = (DMatrix::zeros(count, count), DMatrix::zeros(count, 1));
        for (seen, displacement) in images {
            vector.column_mut(0).axpy(*displacement, seen, 1.0);
            for (mut column, x) in matrix.column_iter_mut().zip(seen.iter()) {
                column.axpy(*x, seen, 1.0);
            }
        }
        Moments { matrix, vector }
    }

    fn plus(&self, other: &Moments, factor: f64) -> Self {
        Moments {
            matrix: &self.matrix + &other.matrix * factor,
            vector: &self.vector + &other.vector * factor,
        }
    }
}

/// The u for which influences K u, with K the likeness, make the sum of squared errors and the charge for u' K u smallest: of
/// (M K + charge) u = vector, with M K the system.
fn charged(system: &DMatrix<f64>, charge: f64, vector: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut matrix = system.clone();
    (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += charge);
    matrix.lu().solve(vector)
}

/// A product of matrices in one order of sums on every machine, which nalgebra's own is not.
fn product(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let mut result = DMatrix::zeros(left.nrows(), right.ncols());
    for (mut column, factors) in result.column_iter_mut().zip(right.column_iter()) {
        for (of_left, x) in left.column_iter().zip(factors.iter()) {
            column.axpy(*x, &of_left, 1.0);
        }
    }
    result
}

fn likeness(sensors: &[((usize, usize), f64)], reach: f64) -> DMatrix<f64> {
    DMatrix::from_fn(sensors.len(), sensors.len(), |i, j| alike(sensors[i].0, sensors[j].0, reach))
}

/// How much alike the influences of two places are taken to be: 1 of the same, half that at the reach.
fn alike((row, column): (usize, usize), (r, c): (usize, usize), reach: f64) -> f64 {
    let squared = (row.abs_diff(r) * row.abs_diff(r) + column.abs_diff(c) * column.abs_diff(c)) as f64;
    1.0 / (1.0 + squared / (reach * reach))
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
        // Of sensors that expand: the first one shrinks.
        let influence = |place| model.influence[place];
        assert!((influence((0, 0)) + 12.0).abs() < 0.4 && (influence((2, 4)) + 6.0).abs() < 0.4);
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
        let influence = |place| model.influence[place];
        assert!((-12.0..-0.5).contains(&influence((0, 1))) && influence((0, 1)) < influence((1, 1)));
        assert!((-12.0..-0.5).contains(&influence((2, 3))));
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
        assert!(model.worth(&blind).is_finite() && model.influence.cells().iter().all(|i| *i == 0.0));
        assert_eq!(model.worth(&blind), model.worth(&"363/222".parse().unwrap()));
        assert!(surrogate(&body(), &stimuli, 0).is_none() && surrogate(&blind, &[], 0).is_none());
    }
}
