//! Evaluation of robots on held-out images, each in a fresh rollout, as in the paper's test.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::observer::Work;
use crate::base::session::Session;
use crate::base::statistics::wilson;
use crate::base::stop::Stopped;
use crate::base::text::counted;
use crate::config::Config;
use crate::store::eval::RobotReport;
use crate::store::images::ImageRef;
use crate::store::run::{Robot, RunFile};
use crate::task::answer::{Assignment, is_correct};
use crate::task::evaluation::fresh_rollouts_so_far;
use crate::task::fitness::Group;
use crate::task::grouping::ClassSplit;
use crate::task::grouping::{self, Grouping};
use crate::task::protocol::{Protocol, RolloutMode};
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};

/// Actuation cycles per image in the paper's test.
pub const CYCLES: u32 = 10;

pub(crate) fn control_steps(config: &Config, cycles: u32) -> u32 {
    cycles.saturating_mul(config.physics.cycle_steps)
}

/// Returns the recognition task that a robot performs; `None` if it always walks the same way.
pub(crate) fn task_of<'a>(
    grouping: &'a Grouping,
    robot: &Robot,
) -> Option<&'a grouping::ClassSplit> {
    grouping
        .tasks()
        .iter()
        .find(|split| split.is_called(&robot.task) && !split.is_same_way())
}

pub(crate) struct HeldOutRun<'a> {
    pub(crate) config: &'a Config,
    pub(crate) control_steps: u32,
    pool: &'a rayon::ThreadPool,
    pub(crate) session: &'a Session<'a>,
    done: AtomicU64,
}

impl<'a> HeldOutRun<'a> {
    /// Evaluates robots of a config for this many control steps per image, after `done` rollouts.
    pub(crate) fn new(
        config: &'a Config,
        control_steps: u32,
        done: u64,
        session: &'a Session<'a>,
    ) -> Result<Self, Error> {
        let pool = session.pool()?;
        Ok(HeldOutRun {
            config,
            control_steps,
            pool,
            session,
            done: AtomicU64::new(done),
        })
    }

    /// Announces a validation. `images` counts those of the best robots, `showings` all rollouts.
    pub(crate) fn validating(&self, robots: usize, images: usize, showings: u64) {
        let label = format!(
            "validating {} on up to {}:",
            counted(robots, "robot", "robots"),
            counted(images, "image", "images")
        );
        self.session
            .observer
            .begins(&Work::new(label, showings, "rollouts"));
    }

    /// Returns each displacement (`None`: unstable) and the number of rollouts; `None` if stopped.
    /// Images with the same pixels at the sensors share a rollout.
    pub(crate) fn rollouts(
        &self,
        robot: &Robot,
        stimuli: &[Grid<f64>],
    ) -> Option<(Vec<Option<f64>>, usize)> {
        let (displacements, simulated, ended) = self.simulated(robot, stimuli);
        ended.ok().map(|()| (displacements, simulated))
    }

    /// Acts as [`rollouts`](HeldOutRun::rollouts), but keeps the displacements under the first
    /// images if it is stopped.
    pub(crate) fn rollouts_so_far(
        &self,
        robot: &Robot,
        stimuli: &[Grid<f64>],
    ) -> (Vec<Option<f64>>, Result<(), Stopped>) {
        let (displacements, _, ended) = self.simulated(robot, stimuli);
        (displacements, ended)
    }

    fn simulated(
        &self,
        robot: &Robot,
        stimuli: &[Grid<f64>],
    ) -> (Vec<Option<f64>>, usize, Result<(), Stopped>) {
        let HeldOutRun {
            config,
            session,
            done,
            ..
        } = self;
        let protocol = Protocol {
            rollout: RolloutMode::Fresh,
            control_steps: self.control_steps,
            ..config.protocol.clone()
        };
        let told = |count: u64| {
            // One rollout stands for all of them.
            session.observer.skips(count - 1);
            session
                .observer
                .progress(done.fetch_add(count, Ordering::Relaxed) + count);
        };
        let (found, simulated, ended) = self.pool.install(|| {
            fresh_rollouts_so_far(
                &robot.body,
                stimuli,
                &[],
                (&config.physics, &protocol),
                &told,
                session,
            )
        });
        let displacements = found.into_iter().map(Result::ok).collect();
        (displacements, simulated, ended)
    }
}

pub(crate) struct Trial<'a> {
    pub(crate) run: &'a RunFile,
    pub(crate) robot: &'a Robot,
    pub(crate) split: &'a ClassSplit,
    pub(crate) images: &'a [ImageRef],
    pub(crate) threshold: f64,
}

impl RobotReport {
    pub(crate) fn new(trial: &Trial, displacements: Vec<Option<f64>>, simulated: usize) -> Self {
        let Trial {
            run,
            robot,
            split,
            images,
            threshold,
        } = *trial;
        let assignment = Assignment::from_training(split, run.fitness(), &run.answers(robot));
        let is_right = |(image, walk): (&ImageRef, &Option<f64>)| {
            is_correct(split, assignment, image.label, *walk, threshold).unwrap_or(false)
        };
        let verdicts: Vec<(u8, bool)> = images
            .iter()
            .zip(&displacements)
            .map(|pair| (pair.0.label, is_right(pair)))
            .collect();
        let share = |of: &dyn Fn(u8) -> bool| {
            let chosen = verdicts.iter().filter(|(class, _)| of(*class));
            let (right, all) = chosen.fold((0usize, 0usize), |(r, n), (_, right)| {
                (r + usize::from(*right), n + 1)
            });
            (right as f64 / all.max(1) as f64, right)
        };
        let (accuracy, right) = share(&|_| true);
        let group = |g: Group| share(&|class| split.group(class) == Some(g)).0;
        let classes: BTreeSet<u8> = images.iter().map(|image| image.label).collect();
        let moved: Vec<f64> = displacements.iter().flatten().map(|d| d.abs()).collect();
        let count = images.len().max(1) as f64;
        RobotReport {
            id: robot.id.clone(),
            run: 0,
            task: robot.task.clone(),
            objective: robot.objective,
            first_group_walks: assignment.expected(Group::A).name().to_string(),
            right,
            images: images.len(),
            accuracy,
            interval: wilson(right, images.len()),
            balanced_accuracy: (group(Group::A) + group(Group::B)) / 2.0,
            per_class: classes
                .into_iter()
                .map(|class| (class, share(&|c| c == class).0))
                .collect(),
            mean_distance: moved.iter().sum::<f64>() / moved.len().max(1) as f64,
            not_moved: moved.iter().filter(|&&d| d <= threshold).count() as f64 / count,
            unstable: displacements.len() - moved.len(),
            simulated,
            validation: None,
            displacements,
        }
    }
}
