//! Evaluation of robots on held-out images, each in a fresh rollout, as in the paper's test.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::observer::Work;
use crate::base::session::Session;
use crate::base::text::counted;
use crate::config::Config;
use crate::store::run::Robot;
use crate::task::evaluation::fresh_rollouts;
use crate::task::grouping::{self, Grouping};
use crate::task::protocol::{Protocol, RolloutMode};
use std::sync::atomic::{AtomicU64, Ordering};

/// Actuation cycles per image in the paper's test.
pub const CYCLES: u32 = 10;

/// Converts actuation cycles to control steps.
pub(crate) fn control_steps(config: &Config, cycles: u32) -> u32 {
    cycles.saturating_mul(config.physics.cycle_steps)
}

/// Returns the recognition task that a robot performs; `None` if it always walks the same way.
pub(crate) fn task_of<'a>(grouping: &'a Grouping, robot: &Robot) -> Option<&'a grouping::Split> {
    grouping.tasks().iter().find(|split| split.is_called(&robot.task) && !split.is_same_way())
}

pub(crate) struct HeldOutRun<'a> {
    pub config: &'a Config,
    /// Control steps per image.
    pub control_steps: u32,
    pool: &'a rayon::ThreadPool,
    pub session: &'a Session<'a>,
    /// Rollouts so far.
    done: AtomicU64,
}

impl<'a> HeldOutRun<'a> {
    /// Evaluates robots of a config for this many control steps per image, after `done` rollouts.
    pub fn new(
        config: &'a Config,
        control_steps: u32,
        done: u64,
        session: &'a Session<'a>,
    ) -> Result<Self, Error> {
        let pool = session.pool()?;
        Ok(HeldOutRun { config, control_steps, pool, session, done: AtomicU64::new(done) })
    }

    /// Announces a validation. `images` counts those of the best robots, `showings` all rollouts.
    pub fn validating(&self, robots: usize, images: usize, showings: u64) {
        let label = format!(
            "validating {} on up to {}:",
            counted(robots, "robot", "robots"),
            counted(images, "image", "images")
        );
        self.session.observer.begins(&Work::new(label, showings, "rollouts"));
    }

    /// Returns the displacement under each image (`None`: unstable) and the number of rollouts.
    /// Images with the same pixels at the sensors share a rollout. Returns `None` if it was
    /// stopped.
    pub fn rollouts(&self, robot: &Robot, stimuli: &[Grid<f64>]) -> Option<(Vec<Option<f64>>, usize)> {
        let HeldOutRun { config, session, done, .. } = self;
        let protocol = Protocol {
            rollout: RolloutMode::Fresh,
            control_steps: self.control_steps,
            ..config.protocol.clone()
        };
        let told = |count: u64| {
            // One rollout stands for all of them.
            session.observer.skips(count - 1);
            session.observer.progress(done.fetch_add(count, Ordering::Relaxed) + count);
        };
        let found = self.pool.install(|| {
            fresh_rollouts(&robot.body, stimuli, &[], (&config.physics, &protocol), &told, session)
        });
        let (displacements, simulated) = found.ok()?;
        Some((displacements.into_iter().map(Result::ok).collect(), simulated))
    }
}
