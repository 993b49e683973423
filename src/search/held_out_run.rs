//! Robots are shown held-out images, as in the paper's test: each in a fresh rollout.

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
    pool: &'a rayon::ThreadPool,
    pub session: &'a Session<'a>,
    /// Showings so far.
    done: AtomicU64,
}

impl<'a> HeldOutRun<'a> {
    /// Of robots of a config, each image for so many control steps; `done` rollouts were counted
    /// before.
    pub fn new(
        config: &'a Config,
        control_steps: u32,
        done: u64,
        session: &'a Session<'a>,
    ) -> Result<Self, Error> {
        let pool = session.pool()?;
        Ok(HeldOutRun { config, control_steps, pool, session, done: AtomicU64::new(done) })
    }

    /// A validation begins: number of robots, of images for the best of them, and of simulations in
    /// all.
    pub fn validating(&self, robots: usize, images: usize, showings: u64) {
        let label = format!(
            "validating {} on up to {}:",
            counted(robots, "robot", "robots"),
            counted(images, "image", "images")
        );
        self.session.observer.begins(&Work::new(label, showings, "rollouts"));
    }

    /// The displacement under each image (`None`: unstable), and the number of rollouts it took:
    /// images that show the sensors the same pixels share a rollout. `None` if stopped before the
    /// end.
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
