//! A team: robots of several tasks walk under one image at once, while their votes are counted.

use crate::analysis::votes::{CLIP, Tally};
use crate::serve::catalogue::{Collection, RobotCatalogue, Who};
use crate::serve::images::ImageSets;
use crate::serve::refusal::HttpRefusal;
use crate::serve::request::{ImageChoice, MAX_STEPS, Pace, SeenPixels};
use crate::serve::simulation::{Clock, Gone, HEARTBEAT};
use crate::serve::simulations::Slot;
use crate::sim::{StepError, System};
use crate::task::answer::Readout;
use crate::task::answer::THRESHOLD;
use crate::task::class_names::ClassNames;
use crate::task::recording::{Frame, VoxelCorners};
use crate::task::rollout::Rollout;
use crate::task::stimulus::StimulusParams;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const LEAST: usize = 2;

/// The identity of a robot in the team.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Name {
    /// The number of its collection.
    pub(crate) archive: usize,
    pub(crate) robot: String,
    /// The task, such as "4|9".
    pub(crate) task: String,
    pub(crate) judge: Readout,
}

/// Returns the team: for every task, the fittest robot of the first archive that has one. All share
/// the dataset with the most tasks. If there are fewer than two, returns the shipped team.
pub(crate) fn members(collections: &[Arc<Collection>]) -> Vec<Name> {
    type Numbered<'a> = Vec<(usize, &'a Arc<Collection>)>;
    let (built_in, archives): (Numbered, Numbered) = collections
        .iter()
        .enumerate()
        .partition(|(_, from)| from.path.is_none());
    let own = largest(archives);
    match own.len() < LEAST {
        true => largest(
            built_in
                .into_iter()
                .max_by_key(|(_, from)| from.tasks.len()),
        ),
        false => own,
    }
}

/// Returns the largest team among collections, each with its number.
fn largest<'a>(collections: impl IntoIterator<Item = (usize, &'a Arc<Collection>)>) -> Vec<Name> {
    let data = |from: &Collection| {
        (
            from.config.data.dataset.clone(),
            from.config.data.builtin.clone(),
        )
    };
    let mut teams: Vec<(_, Vec<Name>)> = Vec::new();
    for (archive, from) in collections {
        let of = data(from);
        let place = teams
            .iter()
            .position(|(other, _)| *other == of)
            .unwrap_or_else(|| {
                teams.push((of, Vec::new()));
                teams.len() - 1
            });
        let members = &mut teams[place].1;
        for robot in &from.robots {
            let Some(judge) = &robot.judge else { continue };
            if members.iter().all(|member| member.task != robot.task) {
                let (id, task) = (robot.id.clone(), robot.task.clone());
                members.push(Name {
                    archive,
                    robot: id,
                    task,
                    judge: judge.clone(),
                });
            }
        }
    }
    let mut members = teams
        .into_iter()
        .map(|(_, members)| members)
        .max_by_key(Vec::len)
        .unwrap_or_default();
    // Pairs of the first classes come first: 0|1, then 0|2 and 1|2, then 0|3 ...
    members.sort_by_key(|member| {
        let last = classes([&member.judge]).pop();
        (last, member.task.clone())
    });
    members
}

/// Returns the classes that a team tells apart, in order.
pub(crate) fn classes<'a>(judges: impl IntoIterator<Item = &'a Readout>) -> Vec<u8> {
    let all: BTreeSet<u8> = judges
        .into_iter()
        .flat_map(|judge| judge.left.iter().chain(&judge.right))
        .copied()
        .collect();
    all.into_iter().collect()
}

/// Returns the names of a team's classes: its members share a dataset.
pub(crate) fn class_names(members: &[Name], collections: &[Arc<Collection>]) -> ClassNames {
    members.first().map_or_else(ClassNames::default, |first| {
        collections[first.archive].config.class_names()
    })
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TeamRequest {
    #[serde(default)]
    shown: ImageChoice,
    /// The number of control steps; the default is the first robot's protocol.
    control_steps: Option<u32>,
    /// The speed as a multiple of real time; 0: as fast as possible. Default 1.
    speed: Option<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct TeamPlan {
    /// The robots with their stimuli; at least two.
    pub(crate) members: Vec<(Name, Who, SeenPixels)>,
    /// The common stimulus that covers all windows.
    pub(crate) together: SeenPixels,
    pub(crate) control_steps: u32,
    pub(crate) pace: Pace,
}

impl TeamRequest {
    pub(crate) fn plan(
        self,
        catalogue: &RobotCatalogue,
        images: &ImageSets,
    ) -> Result<TeamPlan, HttpRefusal> {
        let collections = catalogue.collections();
        let names = members(&collections);
        let mut members = Vec::new();
        for name in names {
            let who = collections[name.archive].who(&name.robot)?;
            let seen = self.shown.clone().seen(&who, images)?;
            members.push((name, who, seen));
        }
        let (_, first, _) = members.first().expect("a team ships with the program");
        let stimuli = members.iter().map(|(_, who, _)| who.encoding);
        let encoding = StimulusParams::together(stimuli).expect("the first member's is among them");
        let together = self.shown.seen(
            &Who {
                encoding,
                ..first.clone()
            },
            images,
        )?;
        let control_steps = self
            .control_steps
            .unwrap_or(first.protocol.control_steps.min(MAX_STEPS));
        if !(1..=MAX_STEPS).contains(&control_steps) {
            return Err(HttpRefusal::Wrong(format!(
                "control_steps: {control_steps}: expected 1 to {MAX_STEPS}"
            )));
        }
        Ok(TeamPlan {
            members,
            together,
            control_steps,
            pace: Pace::of(self.speed.unwrap_or(1.0))?,
        })
    }
}

pub(crate) enum TeamEvent<'a> {
    /// The walk begins, at rest.
    Begin {
        id: u64,
        plan: &'a TeamPlan,
        classes: &'a [u8],
        /// Each robot's voxels and initial pose; `None` for one that walks elsewhere.
        stands: Vec<Option<(Vec<VoxelCorners>, Frame)>>,
    },
    Moment {
        step: u32,
        /// Each robot's pose; `None` for one that has become unstable, or walks elsewhere.
        frames: Vec<Option<Frame>>,
        tally: Tally,
    },
    Still,
    End {
        step: u32,
        tally: Tally,
    },
}

/// A team whose robots walk side by side, control step by control step.
pub(crate) struct TeamWalk {
    /// The robots by their numbers; `None` for one that walks elsewhere.
    walkers: Vec<Option<Walker>>,
    judges: Vec<Readout>,
    classes: Vec<u8>,
    /// The control steps done.
    pub(crate) step: u32,
    until: u32,
}

/// A robot of a team.
pub(crate) struct Walker {
    rollout: Rollout,
    is_unstable: bool,
}

impl Walker {
    /// Simulates control steps, unless `stop` is set or the robot becomes unstable.
    fn walk(&mut self, due: u32, stop: &AtomicBool) {
        for _ in 0..due {
            match self.rollout.step_unless(stop) {
                Ok(()) => {}
                Err(StepError::Unstable(_)) => {
                    self.is_unstable = true;
                    return;
                }
                Err(StepError::Stopped(_)) => return,
            }
        }
    }
}

impl TeamWalk {
    /// Begins the walk of the robots whose numbers `walks_here` accepts, at rest.
    pub(crate) fn new(plan: &TeamPlan, walks_here: impl Fn(usize) -> bool) -> Self {
        let walker = |(number, (_, who, seen)): (usize, &(Name, Who, SeenPixels))| {
            walks_here(number).then(|| {
                let system = Arc::new(System::new(&who.body, who.physics.clone()));
                let mut rollout = Rollout::new(&system, &who.protocol);
                rollout.look_at(&seen.stimulus);
                Walker {
                    rollout,
                    is_unstable: false,
                }
            })
        };
        let judges: Vec<Readout> = plan
            .members
            .iter()
            .map(|(name, _, _)| name.judge.clone())
            .collect();
        TeamWalk {
            walkers: plan.members.iter().enumerate().map(walker).collect(),
            classes: classes(&judges),
            judges,
            step: 0,
            until: plan.control_steps,
        }
    }

    /// Returns the event of a walk that has just begun.
    pub(crate) fn begins<'a>(&'a self, id: u64, plan: &'a TeamPlan) -> TeamEvent<'a> {
        let stand = |walker: &Option<Walker>| {
            let rollout = &walker.as_ref()?.rollout;
            Some((rollout.voxels(), rollout.frame()))
        };
        TeamEvent::Begin {
            id,
            plan,
            classes: &self.classes,
            stands: self.walkers.iter().map(stand).collect(),
        }
    }

    /// Simulates up to `due` control steps. `each` applies a function to all robots, perhaps in
    /// parallel.
    pub(crate) fn advance(
        &mut self,
        due: u32,
        stop: &AtomicBool,
        each: impl FnOnce(&mut [Option<Walker>], &(dyn Fn(&mut Option<Walker>) + Sync)),
    ) {
        let due = due.min(self.until - self.step);
        each(&mut self.walkers, &|walker| match walker {
            Some(walker) if !walker.is_unstable => walker.walk(due, stop),
            _ => {}
        });
        self.step += due;
    }

    pub(crate) fn is_over(&self) -> bool {
        self.step >= self.until
    }

    /// Returns the event of the present moment.
    pub(crate) fn moment(&self) -> TeamEvent<'static> {
        let frame = |walker: &Option<Walker>| walker.as_ref()?.place(Rollout::frame);
        TeamEvent::Moment {
            step: self.step,
            frames: self.walkers.iter().map(frame).collect(),
            tally: self.tally(),
        }
    }

    /// Returns the event of the end.
    pub(crate) fn ends(&self) -> TeamEvent<'static> {
        TeamEvent::End {
            step: self.step,
            tally: self.tally(),
        }
    }

    fn tally(&self) -> Tally {
        let moved = |walker: &Option<Walker>| walker.as_ref()?.place(Rollout::moved);
        self.tally_of(self.walkers.iter().map(moved).collect())
    }

    /// Counts the votes if the robots have moved so far \[voxel lengths\]; `None` is unstable.
    pub(crate) fn tally_of(&self, moved: Vec<Option<f64>>) -> Tally {
        let judges: Vec<&Readout> = self.judges.iter().collect();
        Tally::of(&self.classes, &judges, moved, (THRESHOLD, CLIP))
    }
}

impl Walker {
    /// Returns what a stable rollout says of its place.
    fn place<T>(&self, of: impl FnOnce(&Rollout) -> T) -> Option<T> {
        (!self.is_unstable).then(|| of(&self.rollout))
    }
}

/// Runs a team's walk, its robots in parallel in a pool, and passes its events to `tell`.
pub(crate) fn live(
    slot: &Slot,
    plan: &TeamPlan,
    pool: &rayon::ThreadPool,
    mut tell: impl FnMut(TeamEvent) -> Result<(), Gone>,
) -> Result<(), Gone> {
    let mut walk = TeamWalk::new(plan, |_| true);
    tell(walk.begins(slot.id, plan))?;
    let mut clock = Clock::new(plan.pace);
    loop {
        let news = slot.control.news();
        clock.set(news.pace, news.paused);
        if news.end || walk.is_over() {
            return tell(walk.ends());
        }
        let Some(due) = clock.due(walk.step) else {
            tell(TeamEvent::Still)?;
            slot.control.wait(HEARTBEAT);
            continue;
        };
        if due > 0 {
            walk.advance(due, &slot.control.over, |walkers, walk| {
                pool.install(|| walkers.par_iter_mut().for_each(walk));
            });
            if slot.control.is_over() {
                continue;
            }
            tell(walk.moment())?;
        }
        clock.sleep(&slot.control);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::votes::Ballot;
    use crate::base::Grid;
    use crate::base::threads::pool;
    use crate::serve::simulations::Simulations;
    use crate::sim::Physics;
    use crate::task::protocol::Protocol;
    use crate::task::rollout::fresh_rollout;
    use std::sync::atomic::AtomicBool;

    fn plan() -> TeamPlan {
        let judge = |a, b| Readout {
            left: vec![a],
            right: vec![b],
        };
        let member = |body: &str, judge: Readout| {
            let who = Who {
                body: body.parse().unwrap(),
                physics: Physics::default(),
                protocol: Protocol {
                    control_steps: 120,
                    ..Protocol::default()
                },
                encoding: StimulusParams::default(),
                judge: Some(judge.clone()),
                names: ClassNames::default(),
            };
            let seen = SeenPixels {
                stimulus: Grid::filled(who.body.height(), who.body.width(), 1.0),
                label: Some(1),
                image: None,
            };
            (
                Name {
                    archive: 0,
                    robot: body.to_string(),
                    task: String::new(),
                    judge,
                },
                who,
                seen,
            )
        };
        let members = vec![
            member("3434/4345/6363", judge(0, 1)),
            member("334/463/343", judge(1, 2)),
        ];
        let together = members[0].2.clone();
        TeamPlan {
            members,
            together,
            control_steps: 120,
            pace: Pace::Free,
        }
    }

    #[test]
    fn the_walks_of_a_team_are_those_of_its_robots_by_themselves_and_are_counted_as_team_counts() {
        let plan = plan();
        let simulations = Simulations::default();
        let slot = simulations.begin(plan.members[0].1.clone()).unwrap();
        let (mut moments, mut end) = (0, None);
        live(&slot, &plan, &pool(None).unwrap(), |event| {
            match event {
                TeamEvent::Begin {
                    classes, stands, ..
                } => {
                    assert_eq!((classes, stands.len()), (&[0, 1, 2][..], 2))
                }
                TeamEvent::Moment { frames, .. } => {
                    moments += usize::from(frames.iter().all(Option::is_some))
                }
                TeamEvent::Still => {}
                TeamEvent::End { step, tally } => end = Some((step, tally)),
            }
            Ok(())
        })
        .unwrap();
        let (step, tally) = end.unwrap();
        assert!((step, moments > 3) == (120, true));
        let alone = |(_, who, seen): &(Name, Who, SeenPixels)| {
            let system = Arc::new(System::new(&who.body, who.physics.clone()));
            fresh_rollout(
                &system,
                &who.protocol,
                &seen.stimulus,
                &AtomicBool::new(false),
            )
            .ok()
        };
        let walks: Vec<Option<f64>> = plan.members.iter().map(alone).collect();
        assert_eq!(tally.moved, walks);
        let judges = plan.members.iter().map(|(name, _, _)| &name.judge);
        assert_eq!(
            tally.ballot,
            Ballot::count(&[0, 1, 2], judges.zip(walks), THRESHOLD, CLIP)
        );
    }

    #[test]
    fn a_team_that_is_to_end_ends_in_the_middle_of_a_control_step() {
        let mut plan = plan();
        for (_, who, _) in &mut plan.members {
            who.physics.substeps = u32::MAX;
        }
        let simulations = Simulations::default();
        let slot = simulations.begin(plan.members[0].1.clone()).unwrap();
        let begin = std::time::Instant::now();
        std::thread::scope(|threads| {
            threads.spawn(|| {
                std::thread::sleep(std::time::Duration::from_millis(50));
                simulations.close();
            });
            live(&slot, &plan, &pool(None).unwrap(), |_| Ok(())).unwrap();
        });
        assert!(begin.elapsed().as_secs() < 5, "{:?}", begin.elapsed());
    }
}
