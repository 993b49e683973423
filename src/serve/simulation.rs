//! Runs one simulation at the requested pace and reports every moment.

use crate::serve::request::{MAX_STEPS, Pace, RolloutPlan, SeenPixels};
use crate::serve::simulations::{Control, Slot};
use crate::sim::{StepError, System};
use crate::task::answer::{Reading, Readout, answer};
use crate::task::recording::{Frame, VoxelCorners};
use crate::task::rollout::Rollout;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Control steps per second of a robot's own time.
pub(crate) const STEPS_PER_SECOND: f64 = 50.0;
/// The number of moments in a message when the simulation runs as fast as possible.
const BATCH: u32 = 20;
/// Time between messages in real time.
const TICK: Duration = Duration::from_millis(40);
/// Batches that take longer are sent in parts.
const MOST_AT_ONCE: Duration = Duration::from_millis(100);
/// Interval at which a paused simulation sends a sign of life, to notice a closed page.
pub(super) const HEARTBEAT: Duration = Duration::from_millis(400);
/// Maximum delay, in seconds, that a slow simulation tries to make up for.
const MOST_BEHIND: f64 = 0.5;

pub(crate) enum Event<'a> {
    /// The simulation begins, at rest.
    Begin {
        id: u64,
        plan: &'a RolloutPlan,
        voxels: Vec<VoxelCorners>,
        frame: Frame,
    },
    Seen {
        step: u32,
        /// The last control step with this image.
        until: u32,
        seen: &'a SeenPixels,
    },
    Moments {
        /// The control steps at the last of the moments.
        step: u32,
        /// The moments, one per control step.
        frames: &'a [Frame],
        answer: Reading,
    },
    Still,
    End {
        step: u32,
        answer: Reading,
        /// The reason if it ended early.
        unstable: Option<String>,
    },
}

/// The listener has gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Gone;

/// A simulation that the page watches, control step by control step.
pub(crate) struct Walk {
    rollout: Rollout,
    judge: Option<Readout>,
    /// Number of control steps per image.
    shown_for: u32,
    /// The control steps done.
    pub(crate) step: u32,
    /// The last control step with the present image.
    pub(crate) until: u32,
}

/// Moments that a walk has gone through, and its end if it has ended.
pub(crate) struct Moments {
    pub(crate) frames: Vec<Frame>,
    /// The answer at the last of the moments.
    pub(crate) answer: Reading,
    pub(crate) end: Option<End>,
}

/// The reason for the end of a walk.
pub(crate) enum End {
    /// The image was shown to the last control step, or the walk was stopped.
    Over,
    Unstable(String),
}

impl Walk {
    /// Begins a walk, at rest.
    pub(crate) fn new(plan: &RolloutPlan) -> Self {
        let who = &plan.who;
        let system = Arc::new(System::new(&who.body, who.physics.clone()));
        let mut rollout = Rollout::new(&system, &who.protocol);
        rollout.look_at(&plan.seen.stimulus);
        Walk {
            rollout,
            judge: who.judge.clone(),
            shown_for: who.protocol.control_steps,
            step: 0,
            until: who.protocol.control_steps,
        }
    }

    /// Returns the event of a walk that has just begun.
    pub(crate) fn begins<'a>(&self, id: u64, plan: &'a RolloutPlan) -> Event<'a> {
        Event::Begin {
            id,
            plan,
            voxels: self.rollout.voxels(),
            frame: self.rollout.frame(),
        }
    }

    /// Shows another image from now on.
    pub(crate) fn look_at<'a>(&mut self, seen: &'a SeenPixels) -> Event<'a> {
        self.rollout.look_at(&seen.stimulus);
        self.until = (self.step + self.shown_for).min(MAX_STEPS);
        Event::Seen {
            step: self.step,
            until: self.until,
            seen,
        }
    }

    pub(crate) fn answer(&self) -> Reading {
        answer(self.judge.as_ref(), self.rollout.moved())
    }

    /// Simulates up to `due` control steps, fewer if `enough` says so after one of them. A walk ends
    /// in the middle of a control step if `stop` is set.
    pub(crate) fn advance(
        &mut self,
        due: u32,
        stop: &AtomicBool,
        mut enough: impl FnMut() -> bool,
    ) -> Moments {
        let (mut frames, mut end) = (Vec::new(), None);
        let mut moved = self.rollout.moved();
        for _ in 0..due.min(self.until - self.step) {
            match self.rollout.step_unless(stop) {
                Ok(()) => {}
                Err(StepError::Stopped(_)) => {
                    end = Some(End::Over);
                    break;
                }
                Err(StepError::Unstable(unstable)) => {
                    end = Some(End::Unstable(unstable.to_string()));
                    break;
                }
            }
            moved = self.rollout.moved();
            self.step += 1;
            frames.push(self.rollout.frame());
            if enough() {
                break;
            }
        }
        if end.is_none() && self.step >= self.until {
            end = Some(End::Over);
        }
        Moments {
            frames,
            answer: answer(self.judge.as_ref(), moved),
            end,
        }
    }
}

impl Moments {
    /// Passes on what has happened up to a control step; returns true if the walk has ended.
    pub(crate) fn report<E>(
        &self,
        step: u32,
        mut tell: impl FnMut(Event) -> Result<(), E>,
    ) -> Result<bool, E> {
        if !self.frames.is_empty() {
            tell(Event::Moments {
                step,
                frames: &self.frames,
                answer: self.answer.clone(),
            })?;
        }
        let unstable = match &self.end {
            None => return Ok(false),
            Some(End::Over) => None,
            Some(End::Unstable(reason)) => Some(reason.clone()),
        };
        tell(Event::End {
            step,
            answer: self.answer.clone(),
            unstable,
        })?;
        Ok(true)
    }
}

/// Runs a simulation at its pace and passes its events to `tell`; returns [`Gone`] as soon as that
/// does.
pub(crate) fn live(
    slot: &Slot,
    plan: &RolloutPlan,
    mut tell: impl FnMut(Event) -> Result<(), Gone>,
) -> Result<(), Gone> {
    let mut walk = Walk::new(plan);
    tell(walk.begins(slot.id, plan))?;
    let mut clock = Clock::new(plan.pace);
    loop {
        let news = slot.control.news();
        if let Some(seen) = &news.seen {
            tell(walk.look_at(seen))?;
        }
        clock.set(news.pace, news.paused);
        if news.end {
            return tell(Event::End {
                step: walk.step,
                answer: walk.answer(),
                unstable: None,
            });
        }
        let Some(due) = clock.due(walk.step) else {
            tell(Event::Still)?;
            slot.control.wait(HEARTBEAT);
            continue;
        };
        // Large bodies are reported in parts, to stay live.
        let begin = Instant::now();
        let moments = walk.advance(due, &slot.control.over, || begin.elapsed() > MOST_AT_ONCE);
        if moments.report(walk.step, &mut tell)? {
            return Ok(());
        }
        clock.sleep(&slot.control);
    }
}

/// Decides when control steps are due.
pub(super) struct Clock {
    pace: Pace,
    paused: bool,
    /// The time at which `first` control steps had been simulated; `None` before the first call.
    begin: Option<(Instant, u32)>,
}

impl Clock {
    pub(super) fn new(pace: Pace) -> Self {
        Clock {
            pace,
            paused: false,
            begin: None,
        }
    }

    pub(super) fn set(&mut self, pace: Option<Pace>, paused: Option<bool>) {
        if pace.is_some() || paused.is_some() {
            self.pace = pace.unwrap_or(self.pace);
            self.paused = paused.unwrap_or(self.paused);
            self.begin = None;
        }
    }

    /// Returns the number of control steps that are due, or `None` if paused.
    pub(super) fn due(&mut self, step: u32) -> Option<u32> {
        let Pace::Times(times) = self.pace else {
            return (!self.paused).then_some(BATCH);
        };
        if self.paused {
            return None;
        }
        let rate = times * STEPS_PER_SECOND;
        let now = Instant::now();
        let (begin, first) = *self.begin.get_or_insert((now, step));
        let target = f64::from(first) + (now - begin).as_secs_f64() * rate;
        let due = target - f64::from(step);
        if due > rate * MOST_BEHIND {
            self.begin = None;
        }
        Some(due.clamp(0.0, f64::from(BATCH).max(rate / 10.0)) as u32)
    }

    pub(super) fn sleep(&self, control: &Control) {
        if self.pace != Pace::Free {
            control.wait(TICK);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Grid;
    use crate::serve::catalogue::Who;
    use crate::serve::simulations::Simulations;
    use crate::sim::Physics;
    use crate::task::class_names::ClassNames;
    use crate::task::protocol::Protocol;
    use crate::task::stimulus::StimulusParams;

    #[test]
    fn a_simulation_ends_in_the_middle_of_a_control_step_when_it_is_to_end() {
        let who = Who {
            body: "3434/4343".parse().unwrap(),
            // A control step takes a quarter of an hour.
            physics: Physics {
                substeps: u32::MAX,
                ..Physics::default()
            },
            protocol: Protocol::default(),
            encoding: StimulusParams::default(),
            judge: None,
            names: ClassNames::default(),
        };
        let seen = SeenPixels {
            stimulus: Grid::filled(2, 4, 0.0),
            label: None,
            image: None,
        };
        let plan = RolloutPlan {
            who: who.clone(),
            seen,
            pace: Pace::Free,
        };
        let simulations = Simulations::default();
        let slot = simulations.begin(who).unwrap();
        let begin = Instant::now();
        let mut ends = 0;
        std::thread::scope(|threads| {
            threads.spawn(|| {
                std::thread::sleep(Duration::from_millis(50));
                simulations.close();
            });
            live(&slot, &plan, |event| {
                ends += u32::from(matches!(event, Event::End { step: 0, .. }));
                Ok(())
            })
            .unwrap();
        });
        assert_eq!(ends, 1);
        assert!(begin.elapsed().as_secs() < 5, "{:?}", begin.elapsed());
    }

    #[test]
    fn a_clock_keeps_its_pace_and_forgives_what_cannot_be_made_up_for() {
        let mut free = Clock::new(Pace::Free);
        assert_eq!(free.due(7), Some(BATCH));
        free.set(None, Some(true));
        assert_eq!(free.due(7), None);

        let mut clock = Clock::new(Pace::Times(2.0));
        assert_eq!(clock.due(0), Some(0));
        let ago = |ms| Instant::now().checked_sub(Duration::from_millis(ms));
        clock.begin = ago(100).map(|begin| (begin, 0));
        assert!((10..=12).contains(&clock.due(0).unwrap()));
        assert!((5..=8).contains(&clock.due(5).unwrap()) && clock.begin.is_some());
        clock.begin = ago(60_000).map(|begin| (begin, 0));
        assert_eq!((clock.due(5), clock.begin), (Some(BATCH), None));
        clock.set(Some(Pace::Times(1.0)), None);
        assert_eq!(clock.due(25), Some(0));
    }
}
