//! [`Race`]: offspring that fall behind their parent are not shown the rest of the images (racing; Maron & Moore 1994).
//!
//! Where fitness is a mean over hundreds of images, its upper bound says little before most of them are shown. How an offspring
//! does beside its parent on the same images says much after a few dozen, but not for sure: this is no lossless saving.

use super::direction::{Assignment, Direction};
use super::fitness::Criterion;
use super::grouping::{Group, Grouping};
use super::score::{Answer, of_split, weighed};

/// Fewest images of a task that tell.
const FEWEST: usize = 16;

/// By how many standard errors of what is to come an offspring may be better than it was so far.
const ERRORS: f64 = 2.0;

/// What few images may hide of the spread, in worth of an answer: an offspring that did on all of them as its parent may yet differ.
const DOUBT: f64 = 0.05;

/// A parent to be raced against.
pub struct Race {
    criterion: Criterion,
    /// In which order the images are to be shown: those first whose answers could be better than the parent's.
    order: Vec<usize>,
    /// Of every task both assignments of sides to groups.
    lanes: Vec<Lane>,
}

/// A task with one of its assignments.
struct Lane {
    task: usize,
    /// The parent's fitness.
    fitness: f64,
    /// What counts, in the order of showing.
    images: Vec<Image>,
}

struct Image {
    number: usize,
    /// 1 if the robot is to walk right, −1 if left.
    right: f64,
    weight: f64,
    /// What the parent's answer is worth.
    worth: f64,
}

impl Image {
    /// Whether an answer can be worth more than the parent's.
    fn is_open(&self) -> bool {
        self.worth < 1.0
    }

    /// The most that can be gained on it.
    fn most(&self) -> f64 {
        self.weight * (1.0 - self.worth)
    }
}

/// What an offspring gained so far on images of a kind, and what there is to come of them.
#[derive(Default)]
struct Gains {
    shown: usize,
    sum: f64,
    squares: f64,
    to_come: f64,
    /// The most that can be gained on what is to come.
    most: f64,
}

impl Gains {
    fn add(&mut self, gain: f64, most: f64) {
        self.sum += gain;
        self.squares += gain * gain;
        self.shown += 1;
        self.to_come -= 1.0;
        self.most -= most;
    }

    /// On all of them, if it goes on as it began or somewhat better, but not better than can be.
    fn in_the_end(&self) -> f64 {
        if self.shown < FEWEST {
            return self.sum + self.most;
        }
        let shown = self.shown as f64;
        let mean = self.sum / shown;
        let variance = self.squares / shown - mean * mean + DOUBT * DOUBT;
        // Of those shown nothing is left to chance.
        let error = (variance / shown * (shown + self.to_come) / self.to_come.max(1.0)).sqrt();
        self.sum + (self.to_come * (mean + ERRORS * error)).min(self.most)
    }
}

impl Race {
    /// Against a parent with these answers; who has none is told by its own answers alone beside one who always stands still, since
    /// that is worth 0. `None` if its fitness is not a [mean](Criterion::is_mean), or not all of them are
    /// known.
    pub fn against(grouping: &Grouping, parent: &[Answer]) -> Option<Self> {
        let criterion = grouping.criterion();
        if !criterion.is_mean() || parent.iter().any(|answer| answer.displacement.is_none()) {
            return None;
        }
        let lanes = (0..).zip(grouping.tasks()).flat_map(|(task, split)| {
            let weighed = weighed(split, parent);
            let (right, left) = criterion.of_assignments(of_split(split, parent));
            [(Direction::Right, right), (Direction::Left, left)].map(|(a, reached)| {
                let image = |&(number, group, weight): &(usize, Group, f64)| {
                    let right = Assignment { a }.margin(group, 1.0);
                    let worth = criterion.worth(right * parent[number].displacement?);
                    Some(Image { number, right, weight, worth })
                };
                Lane { task, fitness: reached, images: weighed.iter().filter_map(image).collect() }
            })
        });
        let mut lanes: Vec<Lane> = lanes.collect();
        let own = lanes.iter().reduce(|best, lane| if lane.fitness > best.fitness { lane } else { best })?;
        let mut is_open = vec![false; parent.len()];
        own.images.iter().for_each(|image| is_open[image.number] = image.is_open());
        let mut order: Vec<usize> = (0..parent.len()).collect();
        // Stable: the classes keep taking turns.
        order.sort_by_key(|&number| !is_open[number]);
        lanes.iter_mut().for_each(|lane| lane.images.sort_by_key(|image| !is_open[image.number]));
        Some(Race { criterion, order, lanes })
    }

    /// In which order the images are to be shown: those first on which the parent can be beaten, each kind in their order.
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// Whether an offspring with these displacements so far, an image each, fell behind on the first that are [shown](Self::order),
    /// or on more but not all: whether, if it goes on beside its parent as it began, it will not exceed what is `to_beat` of any
    /// task. On images where nobody can beat the parent it is believed to do as well until it was shown some.
    pub fn is_left_behind(&self, known: &[Option<f64>], to_beat: impl Fn(usize) -> Option<f64>) -> bool {
        self.lanes
            .iter()
            .all(|lane| to_beat(lane.task).is_some_and(|to_beat| self.is_behind(lane, known, to_beat)))
    }

    fn is_behind(&self, lane: &Lane, known: &[Option<f64>], to_beat: f64) -> bool {
        let all = lane.images.len() as f64;
        let (mut open, mut full) = (Gains::default(), Gains::default());
        for image in &lane.images {
            let gains = if image.is_open() { &mut open } else { &mut full };
            gains.to_come += 1.0;
            gains.most += image.most();
        }
        for image in lane.images.iter().take(lane.images.len().saturating_sub(1)) {
            let Some(displacement) = known.get(image.number).copied().flatten() else { return false };
            let gain = image.weight * (self.criterion.worth(image.right * displacement) - image.worth);
            let gains = if image.is_open() { &mut open } else { &mut full };
            gains.add(gain, image.most());
            let is_told = open.shown + full.shown >= FEWEST;
            if is_told && lane.fitness + (open.in_the_end() + full.in_the_end()) / all <= to_beat {
                return true;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};
    use crate::task::fitness::Fitness;

    const IMAGES: usize = 200;

    /// Answers to classes by turns, one group each, of a robot whose margins are about `margin`.
    fn answers(seed: u64, margin: f64) -> Vec<Answer> {
        let mut random = stream(seed, Purpose::Images, 0, 0);
        let mut answer = |class: u8| {
            let margin = margin + 4.0 * random.unit() - 2.0;
            Answer { class, displacement: Some(if class == 0 { margin } else { -margin }) }
        };
        (0..IMAGES).map(|number| answer((number % 2) as u8)).collect()
    }

    fn known(answers: &[Answer]) -> Vec<Option<f64>> {
        answers.iter().map(|answer| answer.displacement).collect()
    }

    fn grouping(fitness: Fitness) -> Grouping {
        Grouping::two_groups(&[0], &[1]).unwrap().with_fitness(fitness)
    }

    /// After how many images a robot with these margins is left behind by its parent, whose margins are about 4.
    fn left_behind_after(seed: u64, margin: f64) -> Option<usize> {
        let grouping = grouping(Fitness::MeanHinge);
        let parent = answers(seed + 1000, 4.0);
        let race = Race::against(&grouping, &parent).unwrap();
        let (child, to_beat) = (known(&answers(seed, margin)), grouping.score(&parent).fitness);
        let after = |shown: usize| race.is_left_behind(&child[..shown], |_| Some(to_beat));
        let first = (0..=IMAGES).find(|&shown| after(shown));
        // Once left behind, always left behind.
        assert!(first.is_none_or(|first| (first..=IMAGES).all(after)));
        first
    }

    #[test]
    fn who_is_much_worse_is_told_after_a_few_images_and_who_is_better_seldom() {
        for seed in 0..20 {
            assert_eq!(left_behind_after(seed, 0.0), Some(FEWEST), "{seed}");
            assert!(left_behind_after(seed, 2.5).is_some_and(|shown| shown <= 40), "{seed}");
            assert_eq!(left_behind_after(seed, 4.8), None, "{seed}");
        }
        let of_slightly_better = (0..100).filter(|&seed| left_behind_after(seed, 4.2).is_some()).count();
        assert!(of_slightly_better <= 20, "{of_slightly_better}");
    }

    #[test]
    fn nobody_is_left_behind_where_a_cell_is_free_or_the_parent_is_far_ahead_of_it() {
        let grouping = grouping(Fitness::MeanClipped);
        let parent = answers(1, 4.0);
        let race = Race::against(&grouping, &parent).unwrap();
        let (worse, to_beat) = (known(&answers(2, 2.0)), grouping.score(&parent).fitness);
        assert!(race.is_left_behind(&worse, |_| Some(to_beat)));
        assert!(!race.is_left_behind(&worse, |_| Some(to_beat - 0.3)));
        assert!(!race.is_left_behind(&worse, |_| None));
        // Better the other way round is better.
        let mirrored: Vec<_> = known(&answers(3, 6.0)).into_iter().map(|d| d.map(|d| -d)).collect();
        assert!(!race.is_left_behind(&mirrored, |_| Some(to_beat)));
    }

    #[test]
    fn beside_one_who_stands_still_it_is_told_by_what_it_did_whether_it_is_good_enough() {
        let stood = |answer: &Answer| Answer { displacement: Some(0.0), ..*answer };
        let still: Vec<Answer> = answers(1, 0.0).iter().map(stood).collect();
        for fitness in [Fitness::MeanHinge, Fitness::MeanClipped] {
            let race = Race::against(&grouping(fitness), &still).unwrap();
            let known = known(&answers(2, 4.0));
            // Worth 0.4 on average.
            assert!(
                race.is_left_behind(&known, |_| Some(0.6)) && !race.is_left_behind(&known, |_| Some(0.35))
            );
            assert!(race.is_left_behind(&known[..FEWEST], |_| Some(0.9)));
            assert!(!race.is_left_behind(&known[..FEWEST - 1], |_| Some(0.9)));
        }
    }

    #[test]
    fn what_can_be_won_is_shown_first_and_who_does_not_win_there_is_told_by_it() {
        let grouping = grouping(Fitness::MeanClipped);
        // Far enough on all but thirty images, on which it is half as good as can be.
        let parent: Vec<Answer> = (answers(1, 15.0).into_iter().enumerate())
            .map(|(number, answer)| match number % 20 {
                3 | 8 | 14 => {
                    Answer { displacement: answer.displacement.map(|d| d.signum() * 5.0), ..answer }
                }
                _ => answer,
            })
            .collect();
        let race = Race::against(&grouping, &parent).unwrap();
        assert!(race.order()[..30].iter().all(|number| matches!(number % 20, 3 | 8 | 14)));
        assert!(race.order()[..30].is_sorted() && race.order()[30..].is_sorted());
        let to_beat = grouping.score(&parent).fitness;
        // After how many images in that order it is left behind who answers as its parent, but for so much on those thirty, and on
        // the others.
        let told_after = |open: f64, full: f64| {
            let mut known = vec![None; IMAGES];
            let after = |&shown: &usize| {
                let number = race.order()[shown];
                let change = if shown < 30 { open } else { full };
                let displacement = parent[number].displacement.unwrap();
                known[number] = Some(displacement + change * displacement.signum());
                race.is_left_behind(&known, |_| Some(to_beat))
            };
            (0..IMAGES).find(after).map(|last| last + 1)
        };
        assert_eq!(told_after(-2.0, 0.0), Some(16));
        assert!(told_after(0.0, 0.0).is_some_and(|shown| shown <= 30));
        assert_eq!(told_after(1.0, 0.0), None);
        // What it wins there it loses elsewhere.
        assert!(told_after(1.0, -8.0).is_some_and(|shown| (38..46).contains(&shown)));
    }

    #[test]
    fn gaps_and_other_fitness_and_few_images_are_no_race() {
        let parent = answers(1, 4.0);
        let race = Race::against(&grouping(Fitness::MeanHinge), &parent).unwrap();
        let mut worse = known(&answers(2, 0.0));
        assert!(race.is_left_behind(&worse, |_| Some(0.4)));
        worse[FEWEST - 1] = None;
        assert!(!race.is_left_behind(&worse, |_| Some(0.4)));
        let few = Race::against(&grouping(Fitness::MeanHinge), &parent[..FEWEST]).unwrap();
        assert!(!few.is_left_behind(&known(&answers(2, 0.0)), |_| Some(0.4)));
        assert!(Race::against(&grouping(Fitness::Min), &parent).is_none());
        let unknown = Answer { class: 1, displacement: None };
        assert!(Race::against(&grouping(Fitness::MeanHinge), &[&parent[..], &[unknown]].concat()).is_none());
    }
}
