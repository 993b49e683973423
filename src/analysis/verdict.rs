//! [`Verdict`]: the conclusion of an audit from perturbed rollouts, according to its [`Criteria`].

use crate::base::number;
use crate::config::audit::Criteria;
use crate::store::audit::{PerturbedRollout, Verdict};
use crate::task::answer::Answer;
use crate::task::answer::{Assignment, Direction};
use crate::task::fitness::Fitness;
use crate::task::fitness::Group;
use crate::task::grouping::ClassSplit;
use crate::task::perturbation::PerturbationKind;

/// Balanced accuracy of a robot that always walks the same way.
const CHANCE: f64 = 0.5;

/// A robot's correct directions, and its answers in its own simulator.
pub(crate) struct Behaviour<'a> {
    criteria: &'a Criteria,
    /// Displacements in the unperturbed rollout.
    plain: Vec<f64>,
    /// True for images whose class is to walk right; `None` if it is in no group.
    rightward: Vec<Option<bool>>,
    /// Images answered correctly.
    answered: Vec<usize>,
    /// Reason why it is no walker; `None` if it is one.
    flaw: Option<String>,
}

impl<'a> Behaviour<'a> {
    /// Evaluates a robot's unperturbed displacements on its task, under images of these classes.
    pub(crate) fn new(
        criteria: &'a Criteria,
        (split, fitness): (&ClassSplit, Fitness),
        classes: &[u8],
        plain: Vec<f64>,
    ) -> Self {
        let answer = |(&class, &d): (&u8, &f64)| Answer {
            class,
            displacement: Some(d),
        };
        let answers: Vec<_> = classes.iter().zip(&plain).map(answer).collect();
        let assignment = Assignment::from_training(split, fitness, &answers);
        let right = |group| assignment.expected(group) == Direction::Right;
        let rightward: Vec<Option<bool>> = classes
            .iter()
            .map(|&class| split.group(class).map(right))
            .collect();
        let asked: Vec<usize> = (0..plain.len())
            .filter(|&image| rightward[image].is_some())
            .collect();
        let is_right =
            |&image: &usize| towards(rightward[image], plain[image]) > criteria.threshold;
        let answered: Vec<usize> = asked.iter().copied().filter(is_right).collect();
        // Wrong answers do not matter to a walker: tests measure its accuracy.
        let walks = |&&image: &&usize| Direction::of(plain[image], criteria.threshold).is_some();
        let walked = asked.iter().filter(walks).count();
        let groups = [Group::A, Group::B]
            .into_iter()
            .filter(|&group| !split.classes(group).is_empty());
        let shares: Vec<(Group, f64)> = groups
            .map(|group| {
                let count = |of: &[usize]| {
                    of.iter()
                        .filter(|&&i| split.group(classes[i]) == Some(group))
                        .count()
                };
                (group, count(&answered) as f64 / count(&asked).max(1) as f64)
            })
            .collect();
        let balanced =
            shares.iter().map(|(_, share)| share).sum::<f64>() / shares.len().max(1) as f64;
        let flaw = if let Some((group, _)) = shares.iter().find(|(_, share)| *share == 0.0) {
            let (threshold, classes) = (criteria.threshold, split.listed(*group));
            Some(format!(
                "never walks more than {threshold} voxel lengths the correct way for {classes}"
            ))
        } else if (walked as f64) < criteria.least_answered * asked.len() as f64 {
            Some(format!(
                "answers {walked} of {} training images",
                asked.len()
            ))
        } else if balanced <= CHANCE {
            Some(format!(
                "answers {} % of its training images correctly, balanced",
                number::fixed(100.0 * balanced, 0)
            ))
        } else {
            None
        };
        Behaviour {
            criteria,
            plain,
            rightward,
            answered,
            flaw,
        }
    }

    pub(crate) fn is_walker(&self) -> bool {
        self.flaw.is_none()
    }

    pub(crate) fn compare(
        &self,
        name: String,
        kind: PerturbationKind,
        displacements: Option<Vec<f64>>,
    ) -> PerturbedRollout {
        let along = |of: &[f64], image: usize| towards(self.rightward[image], of[image]);
        let (mut kept, mut distance) = (0.0, 0.0);
        if let Some(changed) = &displacements {
            let right = self
                .answered
                .iter()
                .filter(|&&i| along(changed, i) > self.criteria.least_walk);
            kept = right.count() as f64 / self.answered.len().max(1) as f64;
            let sum = |of: &[f64]| self.answered.iter().map(|&i| along(of, i)).sum::<f64>();
            let whole = sum(&self.plain);
            distance = if whole > 0.0 {
                sum(changed) / whole
            } else {
                0.0
            };
        }
        let persists = kept >= self.criteria.least_kept && distance >= self.criteria.least_distance;
        PerturbedRollout {
            name,
            kind,
            displacements,
            kept,
            distance,
            persists,
        }
    }

    pub(crate) fn judge(&self, rollouts: &[PerturbedRollout]) -> (Verdict, String) {
        if let Some(flaw) = &self.flaw {
            return (Verdict::NotAWalker, flaw.clone());
        }
        let failed = |kind: &&PerturbationKind| {
            rollouts
                .iter()
                .any(|rollout| rollout.kind == **kind && !rollout.persists)
        };
        let failed: Vec<PerturbationKind> = PerturbationKind::ALL
            .iter()
            .filter(failed)
            .copied()
            .collect();
        let world = || {
            rollouts
                .iter()
                .filter(|rollout| rollout.kind.is_of_the_world())
        };
        let robust = world().filter(|rollout| rollout.persists).count() as f64;
        let is_robust = robust >= self.criteria.least_robust * world().count() as f64;
        let names = |of_the_world: bool| {
            let names = failed
                .iter()
                .filter(|kind| kind.is_of_the_world() == of_the_world);
            names
                .map(|kind| kind.name().to_string())
                .collect::<Vec<_>>()
        };
        let (artefacts, mut broken) = (names(false), names(true));
        if artefacts.is_empty() && broken.is_empty() {
            return (
                Verdict::Physical,
                format!("persists in all {} changed rollouts", rollouts.len()),
            );
        }
        if is_robust && !artefacts.is_empty() {
            return (Verdict::Exploits, artefacts.join(", "));
        }
        broken.extend(artefacts);
        (Verdict::Fragile, broken.join(", "))
    }

    /// Returns the root mean square difference of displacements between perturbed and unperturbed
    /// rollouts \[voxel lengths\]; unstable rollouts are left out.
    pub(crate) fn spread(&self, rollouts: &[PerturbedRollout]) -> f64 {
        let stable = rollouts
            .iter()
            .filter_map(|rollout| rollout.displacements.as_ref());
        let squares: Vec<f64> = stable
            .flat_map(|d| d.iter().zip(&self.plain).map(|(a, b)| (a - b) * (a - b)))
            .collect();
        // The sum of no terms is −0; adding 0.0 makes it 0.
        ((squares.iter().sum::<f64>() + 0.0) / squares.len().max(1) as f64).sqrt()
    }
}

fn towards(rightward: Option<bool>, displacement: f64) -> f64 {
    match rightward {
        Some(true) => displacement,
        Some(false) => -displacement,
        None => f64::NEG_INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::fitness::Fitness;
    use crate::task::grouping::Grouping;

    fn judged(rollouts: &[(PerturbationKind, [f64; 2])]) -> (Verdict, String) {
        let criteria = Criteria::default();
        let split = Grouping::two_groups(&[0], &[1]).unwrap().tasks()[0].clone();
        let behaviour = Behaviour::new(
            &criteria,
            (&split, Fitness::Min),
            &[0, 1],
            vec![-10.0, 12.0],
        );
        let rollout = |(kind, d): &(PerturbationKind, [f64; 2])| {
            behaviour.compare(String::new(), *kind, Some(d.to_vec()))
        };
        behaviour.judge(&rollouts.iter().map(rollout).collect::<Vec<_>>())
    }

    const SAME: [f64; 2] = [-9.0, 13.0];
    const LOST: [f64; 2] = [-9.0, 1.0];

    #[test]
    fn who_keeps_its_directions_in_all_rollouts_is_physical() {
        let rollouts = PerturbationKind::ALL.map(|kind| (kind, SAME));
        assert_eq!(judged(&rollouts).0, Verdict::Physical);
    }

    #[test]
    fn who_is_broken_by_the_simulator_alone_exploits_it_and_by_the_world_is_fragile() {
        let but = |lost: &[PerturbationKind]| {
            judged(&PerturbationKind::ALL.map(|k| (k, if lost.contains(&k) { LOST } else { SAME })))
        };
        assert_eq!(
            but(&[PerturbationKind::TimeStep]),
            (Verdict::Exploits, "time step".to_string())
        );
        assert_eq!(
            but(&[PerturbationKind::Start, PerturbationKind::LengthLimits]).1,
            "start, length limits"
        );
        assert_eq!(
            but(&[PerturbationKind::Gravity]),
            (Verdict::Fragile, "gravity".to_string())
        );
        let all = but(&[
            PerturbationKind::Gravity,
            PerturbationKind::Pixel,
            PerturbationKind::Friction,
            PerturbationKind::TimeStep,
        ]);
        assert_eq!(
            all,
            (
                Verdict::Fragile,
                "friction, gravity, pixel noise, time step".to_string()
            )
        );
    }

    #[test]
    fn a_walk_persists_by_direction_threshold_and_distance() {
        let criteria = Criteria::default();
        let split = Grouping::two_groups(&[0], &[1]).unwrap().tasks()[0].clone();
        let behaviour = Behaviour::new(
            &criteria,
            (&split, Fitness::Min),
            &[0, 1],
            vec![-10.0, 12.0],
        );
        let compare = |d: Option<[f64; 2]>| {
            behaviour.compare("x".into(), PerturbationKind::Start, d.map(Vec::from))
        };
        assert!(compare(Some([-9.0, 30.0])).persists);
        // Below the threshold for an answer.
        assert!(compare(Some([-9.0, 2.9])).persists && !compare(Some([-9.0, 1.5])).persists);
        let turned = compare(Some([9.0, 30.0]));
        assert_eq!((turned.kept, turned.persists), (0.5, false));
        let short = compare(Some([-4.0, 4.0]));
        assert_eq!(
            (short.kept, short.distance, short.persists),
            (1.0, 8.0 / 22.0, false)
        );
        assert!(!compare(None).persists);
        let rollouts = [
            compare(Some([-13.0, 12.0])),
            compare(None),
            compare(Some([-10.0, 15.0])),
        ];
        assert_eq!(behaviour.spread(&rollouts), (18.0f64 / 4.0).sqrt());
    }

    #[test]
    fn who_does_not_answer_its_images_is_not_a_walker() {
        let criteria = Criteria::default();
        let splits = Grouping::all_splits(&[0, 1, 2, 3], false).unwrap();
        let split = &splits.tasks()[0];
        let flaw = |d: [f64; 4]| {
            Behaviour::new(&criteria, (split, Fitness::Min), &[0, 1, 2, 3], d.to_vec()).flaw
        };
        assert_eq!(split.name(), "0|123");
        assert_eq!(flaw([5.0, -4.0, -9.0, -2.0]), None);
        assert_eq!(
            flaw([5.0, -4.0, -1.0, -2.0]).unwrap(),
            "answers 2 of 4 training images"
        );
        assert!(
            flaw([2.0, -4.0, -9.0, -8.0])
                .is_some_and(|flaw| flaw.ends_with("the correct way for 0"))
        );
        // A low accuracy is no flaw of a walker, but accuracy at chance is.
        assert_eq!(flaw([9.0, -8.0, 4.0, 4.0]), None);
        let flaw = |d: &[f64], classes: &[u8]| {
            Behaviour::new(
                &criteria,
                (split, Fitness::MeanClipped),
                classes,
                d.to_vec(),
            )
            .flaw
        };
        assert_eq!(flaw(&[5.0, -4.0, -9.0, -8.0, -8.0], &[0, 0, 1, 2, 3]), None);
        let halves = [5.0, -5.0, -4.0, 4.0];
        assert_eq!(
            flaw(&halves, &[0, 0, 1, 2]).unwrap(),
            "answers 50 % of its training images correctly, balanced"
        );
        let still = Behaviour::new(
            &criteria,
            (split, Fitness::Min),
            &[0, 1, 2, 3],
            vec![0.0; 4],
        );
        assert_eq!(still.judge(&[]).0, Verdict::NotAWalker);
    }

    #[test]
    fn criteria_are_read_checked_and_named() {
        let set = |text: &str| Criteria::load(None, &[text.to_string()]);
        assert_eq!(
            set("perturbations.time_step=[8]")
                .unwrap()
                .perturbations
                .time_step,
            [8]
        );
        assert_eq!(set("threshold=2").unwrap().threshold, 2.0);
        let wrong = [
            "threshold=-1",
            "least_kept=2",
            "perturbations.time_step=[1]",
            "treshold=1",
            "perturbations.share=0",
        ];
        for wrong in wrong {
            assert!(set(wrong).is_err(), "{wrong}");
        }
    }
}
