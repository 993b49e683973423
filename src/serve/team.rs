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
    members.sort_by(|a, b| a.task.cmp(&b.task));
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
        /// Each robot's voxels and initial pose.
        stands: Vec<(Vec<VoxelCorners>, Frame)>,
    },
    Moment {
        step: u32,
        /// Each robot's pose; `None` for one that has become unstable.
        frames: Vec<Option<Frame>>,
        tally: Tally,
    },
    Still,
    End {
        step: u32,
        tally: Tally,
    },
}

struct Walker<'a> {
    rollout: Rollout<'a>,
    is_unstable: bool,
}

/// Runs a team's walk, its robots in parallel in a pool, and passes its events to `tell`.
pub(crate) fn live(
    slot: &Slot,
    plan: &TeamPlan,
    pool: &rayon::ThreadPool,
    mut tell: impl FnMut(TeamEvent) -> Result<(), Gone>,
) -> Result<(), Gone> {
    let systems: Vec<Arc<System>> = plan
        .members
        .iter()
        .map(|(_, who, _)| Arc::new(System::new(&who.body, who.physics.clone())))
        .collect();
    let mut walkers: Vec<Walker> = Vec::new();
    for ((_, who, seen), system) in plan.members.iter().zip(&systems) {
        let mut rollout = Rollout::new(system, &who.protocol);
        rollout.look_at(&seen.stimulus);
        walkers.push(Walker {
            rollout,
            is_unstable: false,
        });
    }
    let judges: Vec<&Readout> = plan
        .members
        .iter()
        .map(|(name, _, _)| &name.judge)
        .collect();
    let classes = classes(judges.iter().copied());
    let stands = walkers
        .iter()
        .map(|walker| (walker.rollout.voxels(), walker.rollout.frame()))
        .collect();
    tell(TeamEvent::Begin {
        id: slot.id,
        plan,
        classes: &classes,
        stands,
    })?;
    let mut clock = Clock::new(plan.pace);
    let mut step = 0;
    loop {
        let news = slot.control.news();
        clock.set(news.pace, news.paused);
        if news.end || step >= plan.control_steps {
            return tell(TeamEvent::End {
                step,
                tally: tally(&walkers, &judges, &classes),
            });
        }
        let Some(due) = clock.due(step) else {
            tell(TeamEvent::Still)?;
            slot.control.wait(HEARTBEAT);
            continue;
        };
        let due = due.min(plan.control_steps - step);
        if due > 0 {
            let over = &slot.control.over;
            let walks = |walker: &mut Walker| {
                for _ in 0..due {
                    if let Err(StepError::Unstable(_)) = walker.rollout.step_unless(over) {
                        walker.is_unstable = true;
                    }
                    if walker.is_unstable || slot.control.is_over() {
                        return;
                    }
                }
            };
            pool.install(|| {
                walkers
                    .par_iter_mut()
                    .filter(|walker| !walker.is_unstable)
                    .for_each(walks);
            });
            if slot.control.is_over() {
                continue;
            }
            step += due;
            let frame = |walker: &Walker| (!walker.is_unstable).then(|| walker.rollout.frame());
            let frames = walkers.iter().map(frame).collect();
            tell(TeamEvent::Moment {
                step,
                frames,
                tally: tally(&walkers, &judges, &classes),
            })?;
        }
        clock.sleep(&slot.control);
    }
}

fn tally(walkers: &[Walker], judges: &[&Readout], classes: &[u8]) -> Tally {
    let moved = walkers
        .iter()
        .map(|walker| (!walker.is_unstable).then(|| walker.rollout.moved()))
        .collect();
    Tally::of(classes, judges, moved, (THRESHOLD, CLIP))
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
