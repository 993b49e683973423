//! Robots are shown held-out images, as in the paper's test: each in a fresh rollout.

use crate::base::Grid;
use crate::base::observer::{Observer, Work};
use crate::base::text::counted;
use crate::config::Config;
use crate::store::run::Robot;
use crate::task::evaluation::fresh_rollouts;
use crate::task::grouping::{self, Grouping};
use crate::task::protocol::{Protocol, RolloutMode};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Actuation cycles per image in the paper's test.
pub const CYCLES: u32 = 10;

/// Control steps of this number of actuation cycles.
pub(crate) fn control_steps(config: &Config, cycles: u32) -> u32 {
    cycles.saturating_mul(config.physics.cycle_steps)
}

/// The recognition task a robot performs; none if it always walks the same way.
pub(crate) fn task_of<'a>(grouping: &'a Grouping, robot: &Robot) -> Option<&'a grouping::Split> {
    grouping.tasks().iter().find(|split| split.is_called(&robot.task) && !split.is_same_way())
}

/// Shows images to robots.
pub(crate) struct HeldOutRun<'a> {
    pub config: &'a Config,
    /// Of one showing.
    pub control_steps: u32,
    pub pool: &'a rayon::ThreadPool,
    pub stop: &'a AtomicBool,
    pub observer: &'a dyn Observer,
    /// Showings so far.
    pub done: AtomicU64,
}

impl HeldOutRun<'_> {
    /// A validation begins: number of robots, of images for the best of them, and of simulations in
    /// all.
    pub fn validating(&self, robots: usize, images: usize, showings: u64) {
        let label = format!(
            "validating {} on up to {}:",
            counted(robots, "robot", "robots"),
            counted(images, "image", "images")
        );
        self.observer.begins(&Work::new(label, showings, "rollouts"));
    }

    /// The displacement under each image (`None`: unstable), and the number of rollouts it took:
    /// images that show the sensors the same pixels share a rollout. `None` if stopped before the
    /// end.
    pub fn rollouts(&self, robot: &Robot, stimuli: &[Grid<f64>]) -> Option<(Vec<Option<f64>>, usize)> {
        let HeldOutRun { config, stop, observer, done, .. } = self;
        let protocol = Protocol {
            rollout: RolloutMode::Fresh,
            control_steps: self.control_steps,
            ..config.protocol.clone()
        };
        let told = |count: u64| {
            // One rollout stands for all of them.
            observer.skips(count - 1);
            observer.progress(done.fetch_add(count, Ordering::Relaxed) + count);
        };
        let found = self
            .pool
            .install(|| fresh_rollouts(&robot.body, stimuli, &[], (&config.physics, &protocol), &told, stop));
        let (displacements, simulated) = found.ok()?;
        Some((displacements.into_iter().map(Result::ok).collect(), simulated))
    }
}
