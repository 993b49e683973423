//! Evaluation of many robots at once, in parallel over robots and images, with lossless savings.

use crate::base::Grid;
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::body::Body;
use crate::sim::{Physics, StepError, System, Unstable, Worlds};
use crate::task::perturbation::{Condition, Perturbation, PerturbationKind, PerturbedSetting};
use crate::task::protocol::{Protocol, RolloutMode};
use crate::task::rollout::{Rollout, fresh_rollout, fresh_rollouts_of, same_to_sensors, walk};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Savings that change no archive; keys of a config's section `[savings]`. All are on by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Savings {
    /// Simulates no body twice on the same images. Default true.
    ///
    /// It would be exactly as fit, and only strictly fitter robots enter the archive.
    pub known_bodies: bool,
    /// Stops simulating offspring that can no longer beat an elite. Default true.
    pub early_stop: bool,
    /// Simulates images once that show a body's sensors the same pixels. Default true.
    pub shared_rollouts: bool,
}

impl Default for Savings {
    fn default() -> Self {
        Savings {
            known_bodies: true,
            early_stop: true,
            shared_rollouts: true,
        }
    }
}

/// The way in which an evaluation ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// The displacement under every image, in the images' order, voxel lengths.
    Walked(Vec<f64>),
    /// A rollout became unstable: no fitness.
    Unstable(Unstable),
    /// Stopped because it could no longer enter the archive, or was [given up](Job::given_up).
    /// Holds the displacement under every image, as far as known.
    Stopped(Vec<Option<f64>>),
}

impl Outcome {}

/// An outcome and the simulation it took. A *showing* is one image for one robot: a fresh rollout,
/// or one phase of a sequential one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// The outcome.
    pub outcome: Outcome,
    /// Showings simulated.
    pub simulated: u64,
    /// Showings covered by another image's rollout.
    pub shared: u64,
    /// Showings not needed after an early stop (or after an instability).
    pub stopped: u64,
}

/// A predicate of a robot's displacements so far.
pub(crate) type MayWin<'a> = dyn Fn(&[Option<f64>]) -> bool + Sync + Send + 'a;

/// A body to be evaluated.
pub struct Job<'a> {
    /// The body.
    pub body: &'a Body,
    /// Preferred order of the images in fresh rollouts: first those under which it is likely to
    /// drop out. Images that are missing here come last, in their order.
    pub order: Vec<usize>,
    /// Returns true if it may still enter the archive, given some of its displacements; called with
    /// early stopping only.
    pub may_win: Box<MayWin<'a>>,
    /// Stops the evaluation early if it returns true. It gets only the known prefix in a fixed
    /// order, so the result does not depend on scheduling.
    pub given_up: Option<Box<MayWin<'a>>>,
}

/// Evaluates jobs, each on all images. Results are in the jobs' order and the same on any number of
/// threads. Fresh rollouts use the images' `conditions`, or the default one where they are missing;
/// sequential rollouts ignore them.
///
/// All rollouts of all jobs are one list of work: first every robot's first image, then every
/// second one, and so on, large bodies first so that no core waits long at the end. A rollout whose
/// robot has already dropped out is skipped. One that had begun before is not counted.
///
/// # Errors
/// Returns [`Stopped`] if `stop` was set before all was known.
pub fn evaluate(
    jobs: &[Job],
    images: &[Grid<f64>],
    conditions: &[Condition],
    physics: &Physics,
    protocol: &Protocol,
    savings: Savings,
    session: &Session,
) -> Result<Vec<Evaluation>, Stopped> {
    let setup = &Setup::new(images, conditions, (physics, protocol), session);
    let candidate = |job| {
        session
            .check()
            .map(|()| Candidate::new(job, setup, savings))
    };
    let candidates: Vec<Candidate> = jobs.iter().map(candidate).collect::<Result<_, Stopped>>()?;
    let mut work: Vec<(usize, &Candidate)> = candidates
        .iter()
        .flat_map(|candidate| (0..candidate.rollouts()).map(move |place| (place, candidate)))
        .collect();
    // A stable sort: equally large bodies keep the jobs' order.
    work.sort_by_key(|(place, candidate)| (*place, Reverse(candidate.systems[0].point_count())));
    let next = AtomicUsize::new(0);
    let worker = |_| {
        while let Some((place, candidate)) = work.get(next.fetch_add(1, Ordering::Relaxed)) {
            candidate.simulate(*place)?;
        }
        Ok(())
    };
    let workers = (0..rayon::current_num_threads().min(work.len()))
        .into_par_iter()
        .with_max_len(1);
    workers.map(worker).collect::<Result<Vec<()>, Stopped>>()?;
    Ok(candidates.iter().map(Candidate::evaluation).collect())
}

/// Simulates a fresh rollout of a body under each image and its condition (the default where one is
/// missing). Images that give its sensors the same pixels under the same condition share a rollout.
///
/// Returns the displacements in voxel lengths, in the images' order, and the number of rollouts
/// simulated. `progress` is called after each with the number of images it covers.
///
/// # Errors
/// Returns [`Stopped`] if `stop` was set in the meantime; single rollouts return [`Unstable`].
pub fn fresh_rollouts(
    body: &Body,
    images: &[Grid<f64>],
    conditions: &[Condition],
    setting: (&Physics, &Protocol),
    progress: &(dyn Fn(u64) + Sync),
    session: &Session,
) -> Result<(Vec<Result<f64, Unstable>>, usize), Stopped> {
    let (found, simulated, ended) =
        fresh_rollouts_so_far(body, images, conditions, setting, progress, session);
    ended.map(|()| (found, simulated))
}

/// Acts as [`fresh_rollouts`], but keeps what was completed before `stop` was set. Returns the
/// displacements of the first images, the number simulated, and an error if it was stopped. The
/// other images, simulated later, complete them with the same bits.
pub(crate) fn fresh_rollouts_so_far(
    body: &Body,
    images: &[Grid<f64>],
    conditions: &[Condition],
    setting: (&Physics, &Protocol),
    progress: &(dyn Fn(u64) + Sync),
    session: &Session,
) -> (Vec<Result<f64, Unstable>>, usize, Result<(), Stopped>) {
    let setup = Setup::new(images, conditions, setting, session);
    let systems = setup.systems(body);
    let same_as = setup.same_as(body);
    let mut shared = BTreeMap::<usize, u64>::new();
    same_as
        .iter()
        .for_each(|&first| *shared.entry(first).or_default() += 1);
    let mut parts = setup.parts(&systems, shared.keys().copied());
    // In the images' order, so that the first ones are complete after a stop.
    parts.sort_by_key(|(_, images)| images.first().copied());
    let next = AtomicUsize::new(0);
    let worker = |_| {
        let mut own = Vec::new();
        while let Some((number, images)) = parts.get(next.fetch_add(1, Ordering::Relaxed)) {
            let Ok(rolled) = setup.side_by_side(body, &systems[*number], images) else {
                break;
            };
            images.iter().for_each(|image| progress(shared[image]));
            own.extend(images.iter().copied().zip(rolled));
        }
        own
    };
    let workers = (0..rayon::current_num_threads().min(parts.len()))
        .into_par_iter()
        .with_max_len(1);
    let rolled: Vec<Vec<(usize, Result<f64, Unstable>)>> = workers.map(worker).collect();
    let rolled: BTreeMap<usize, Result<f64, Unstable>> = rolled.into_iter().flatten().collect();
    let found: Vec<_> = same_as
        .iter()
        .map_while(|first| rolled.get(first).copied())
        .collect();
    let ended = if found.len() == images.len() {
        Ok(())
    } else {
        Err(Stopped)
    };
    (found, rolled.len(), ended)
}

/// Returns the displacements in a setting, or `None` if a rollout is unstable.
pub(crate) fn displacements_in(
    setting: &PerturbedSetting,
    session: &Session,
) -> Result<Option<Vec<f64>>, Stopped> {
    let PerturbedSetting {
        body,
        physics,
        protocol,
        stimuli,
    } = setting;
    if protocol.rollout == RolloutMode::Fresh {
        let (found, _) = fresh_rollouts(body, stimuli, &[], (physics, protocol), &|_| (), session)?;
        return Ok(found.into_iter().map(Result::ok).collect());
    }
    let system = Arc::new(System::new(body, physics.clone()));
    let walked = StepError::outcome(walk(&system, protocol, stimuli, false, session.stop))?;
    Ok(walked.ok().map(|(displacements, _)| displacements))
}

/// A finished rollout: of one image if fresh; of all up to the robot's drop-out if sequential.
struct Shown {
    /// Displacement under each image, voxel lengths; none where it became unstable.
    displacements: Vec<Option<f64>>,
    unstable: Option<Unstable>,
}

impl Shown {
    fn add(&mut self, shown: Result<f64, Unstable>) {
        self.displacements.push(shown.ok());
        self.unstable = shown.err();
    }
}

/// The known results of a robot's rollouts.
#[derive(Default)]
struct Progress {
    /// Rollouts that have ended but are not counted yet, in the order of counting.
    ended: Vec<Option<Shown>>,
    counted: usize,
    /// Displacements of the counted rollouts, in the order of showing.
    displacements: Vec<Option<f64>>,
    /// Instability of the first counted rollout that became unstable.
    unstable: Option<Unstable>,
    /// End of the evaluation, as soon as it is known.
    verdict: Option<Evaluation>,
}

fn walked(known: Vec<Option<f64>>) -> Outcome {
    let displacement =
        |known: Option<f64>| known.expect("no rollout was left out, and none was unstable");
    Outcome::Walked(known.into_iter().map(displacement).collect())
}

struct Setup<'a> {
    images: &'a [Grid<f64>],
    /// Every condition once, the default first.
    conditions: Vec<Condition>,
    /// Number of each image's condition.
    condition_of: Vec<usize>,
    physics: &'a Physics,
    /// Protocol of each condition.
    protocols: Vec<Protocol>,
    session: &'a Session<'a>,
}

impl<'a> Setup<'a> {
    fn new(
        images: &'a [Grid<f64>],
        conditions: &[Condition],
        (physics, protocol): (&'a Physics, &Protocol),
        session: &'a Session<'a>,
    ) -> Self {
        let mut once = vec![Condition::new()];
        let mut number = |condition: &Condition| {
            once.iter()
                .position(|other| other == condition)
                .unwrap_or_else(|| {
                    once.push(condition.clone());
                    once.len() - 1
                })
        };
        let condition_of = (0..images.len())
            .map(|image| conditions.get(image).map_or(0, &mut number))
            .collect();
        let under = |condition: &Condition| {
            condition
                .iter()
                .fold(protocol.clone(), |protocol, perturbation| {
                    perturbation.protocol(&protocol)
                })
        };
        let protocols = once.iter().map(under).collect();
        Setup {
            images,
            conditions: once,
            condition_of,
            physics,
            protocols,
            session,
        }
    }

    fn protocol(&self) -> &Protocol {
        &self.protocols[0]
    }

    /// Returns a body under the physics of each condition.
    fn systems(&self, body: &Body) -> Vec<Arc<System>> {
        let mut once: Vec<(Body, Physics, Arc<System>)> = Vec::new();
        let system = |condition: &Condition| {
            let body = condition
                .iter()
                .fold(body.clone(), |body, perturbation| perturbation.body(&body));
            let physics = self.physics.clone();
            let physics = condition.iter().fold(physics, |physics, perturbation| {
                perturbation.physics(&physics)
            });
            if let Some((_, _, system)) = once
                .iter()
                .find(|other| other.0 == body && other.1 == physics)
            {
                return Arc::clone(system);
            }
            let system = Arc::new(System::new(&body, physics.clone()));
            once.push((body, physics, Arc::clone(&system)));
            system
        };
        self.conditions.iter().map(system).collect()
    }

    /// Returns for each image the first with the same condition and the same pixels under sensors.
    fn same_as(&self, body: &Body) -> Vec<usize> {
        let mut first = HashMap::new();
        let same = same_to_sensors(body, &self.images.iter().collect::<Vec<_>>());
        let of = |(image, same): (usize, usize)| {
            let condition = self.condition_of[image];
            // The inverted pixel differs from image to image.
            let is_drawn = self.conditions[condition]
                .iter()
                .any(|change| change.kind() == PerturbationKind::Pixel);
            *first
                .entry((same, condition, is_drawn.then_some(image)))
                .or_insert(image)
        };
        same.into_iter().enumerate().map(of).collect()
    }

    /// Simulates a fresh rollout under an image and its condition.
    fn fresh_rollout(
        &self,
        body: &Body,
        systems: &[Arc<System>],
        image: usize,
    ) -> Result<Result<f64, Unstable>, Stopped> {
        let number = self.condition_of[image];
        let stimulus = self.stimulus(body, image);
        let rollout = fresh_rollout(
            &systems[number],
            &self.protocols[number],
            &stimulus,
            self.session.stop,
        );
        Ok(self.in_unperturbed_frame(StepError::outcome(rollout)?, number))
    }

    /// Simulates at most [`Worlds::MOST`] images of one condition, with unchanged bits.
    fn side_by_side(
        &self,
        body: &Body,
        system: &Arc<System>,
        images: &[usize],
    ) -> Result<Vec<Result<f64, Unstable>>, Stopped> {
        let number = images.first().map_or(0, |image| self.condition_of[*image]);
        let stimuli: Vec<Grid<f64>> = images
            .iter()
            .map(|image| self.stimulus(body, *image))
            .collect();
        let found =
            fresh_rollouts_of(system, &self.protocols[number], &stimuli, self.session.stop)?;
        Ok(found
            .into_iter()
            .map(|displacement| self.in_unperturbed_frame(displacement, number))
            .collect())
    }

    /// Divides images into parts to simulate side by side, each with the number of its condition.
    /// Parts are as large as possible for bodies that gain by it, but no fewer than threads.
    fn parts(
        &self,
        systems: &[Arc<System>],
        images: impl Iterator<Item = usize>,
    ) -> Vec<(usize, Vec<usize>)> {
        let mut by_condition = BTreeMap::<usize, Vec<usize>>::new();
        images.for_each(|image| {
            by_condition
                .entry(self.condition_of[image])
                .or_default()
                .push(image)
        });
        let split = |(number, images): (usize, Vec<usize>)| {
            let share = images.len().div_ceil(rayon::current_num_threads());
            let most = if Worlds::gain(&systems[number]) {
                share.clamp(1, Worlds::MOST)
            } else {
                1
            };
            images
                .chunks(most)
                .map(|part| (number, part.to_vec()))
                .collect::<Vec<_>>()
        };
        by_condition.into_iter().flat_map(split).collect()
    }

    /// Returns the stimulus of an image under its condition.
    fn stimulus(&self, body: &Body, image: usize) -> Grid<f64> {
        let condition = &self.conditions[self.condition_of[image]];
        let see = |stimulus: Grid<f64>, change: &Perturbation| {
            change.stimulus(body, &stimulus, image as u64)
        };
        condition.iter().fold(self.images[image].clone(), see)
    }

    /// Mirrors a mirrored walk back; an instability that a condition excuses is standing still.
    fn in_unperturbed_frame(
        &self,
        displacement: Result<f64, Unstable>,
        condition: usize,
    ) -> Result<f64, Unstable> {
        let condition = &self.conditions[condition];
        let undo = |d: f64, change: &Perturbation| change.undo(vec![d])[0];
        let displacement = displacement.map(|d| condition.iter().fold(d, undo));
        // Any material has a limit of length, so a body that needs one is not refused for that.
        let is_excused = condition.iter().any(|change| !change.counts_if_unstable());
        if is_excused {
            displacement.or(Ok(0.0))
        } else {
            displacement
        }
    }
}

/// A job in progress.
struct Candidate<'a> {
    job: &'a Job<'a>,
    setup: &'a Setup<'a>,
    early_stop: bool,
    systems: Vec<Arc<System>>,
    /// Images to simulate, in order.
    order: Vec<usize>,
    /// Index of each image in that order, or of the image whose rollout it shares.
    places: Vec<usize>,
    rollouts: Mutex<Progress>,
    /// True if the end of the evaluation is known.
    is_over: AtomicBool,
}

impl<'a> Candidate<'a> {
    fn new(job: &'a Job<'a>, setup: &'a Setup<'a>, savings: Savings) -> Self {
        let images = setup.images;
        let all: Vec<usize> = (0..images.len()).collect();
        let is_fresh = setup.protocol().rollout == RolloutMode::Fresh;
        let same_as = match is_fresh && savings.shared_rollouts {
            true => setup.same_as(job.body),
            false => all.clone(),
        };
        let wished: &[usize] = if is_fresh { &job.order } else { &[] };
        let (mut order, mut places) = (Vec::new(), vec![None; images.len()]);
        for image in wished
            .iter()
            .chain(&all)
            .filter_map(|&image| same_as.get(image).copied())
        {
            if places[image].is_none() {
                places[image] = Some(order.len());
                order.push(image);
            }
        }
        let places = same_as
            .iter()
            .map(|&image| {
                places[image].expect("every image is in the order, or the one it is the same as")
            })
            .collect();
        let rollouts = if is_fresh { order.len() } else { 1 };
        Candidate {
            job,
            setup,
            early_stop: savings.early_stop,
            systems: setup.systems(job.body),
            order,
            places,
            rollouts: Mutex::new(Progress {
                ended: (0..rollouts).map(|_| None).collect(),
                ..Progress::default()
            }),
            is_over: AtomicBool::new(false),
        }
    }

    fn rollouts(&self) -> usize {
        self.locked().ended.len()
    }

    fn locked(&self) -> MutexGuard<'_, Progress> {
        // A panic leaves only whole entries behind.
        self.rollouts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Simulates one rollout, unless the robot has dropped out.
    fn simulate(&self, place: usize) -> Result<(), Stopped> {
        if self.is_over.load(Ordering::Relaxed) {
            return Ok(());
        }
        let mut shown = Shown {
            displacements: Vec::new(),
            unstable: None,
        };
        match self.setup.protocol().rollout {
            RolloutMode::Fresh => {
                shown.add(self.setup.fresh_rollout(
                    self.job.body,
                    &self.systems,
                    self.order[place],
                )?);
            }
            RolloutMode::Sequential => {
                let mut rollout = Rollout::new(&self.systems[0], self.setup.protocol());
                for image in self.setup.images {
                    shown.add(StepError::outcome(
                        rollout.show_unless(image, self.setup.session.stop),
                    )?);
                    if shown.unstable.is_some() || self.outcome(&shown.displacements).is_some() {
                        break;
                    }
                }
            }
        }
        let mut rollouts = self.locked();
        rollouts.ended[place] = Some(shown);
        self.count(&mut rollouts);
        if rollouts.verdict.is_some() {
            self.is_over.store(true, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Returns the outcome, whatever answers that are still missing may be; `None` if they matter.
    fn outcome(&self, displacements: &[Option<f64>]) -> Option<Outcome> {
        let Job {
            may_win, given_up, ..
        } = self.job;
        let known = self.known(displacements);
        let is_lost =
            || self.early_stop && displacements.len() < self.order.len() && !may_win(&known);
        let is_given_up = given_up.as_ref().is_some_and(|given_up| given_up(&known));
        (is_given_up || is_lost()).then_some(Outcome::Stopped(known))
    }

    /// Returns the displacement under each image, as far as the first showings tell.
    fn known(&self, displacements: &[Option<f64>]) -> Vec<Option<f64>> {
        self.places
            .iter()
            .map(|place| *displacements.get(*place)?)
            .collect()
    }

    /// Counts known rollouts in their order, each once, whichever ended first.
    fn count(&self, rollouts: &mut Progress) {
        let is_over = |rollouts: &Progress| {
            self.early_stop && rollouts.unstable.is_some()
                || rollouts.counted == rollouts.ended.len()
        };
        if rollouts.verdict.is_some() {
            return;
        }
        while !is_over(rollouts) {
            let Some(rollout) = rollouts.ended[rollouts.counted].take() else {
                return;
            };
            rollouts.counted += 1;
            for displacement in rollout.displacements {
                rollouts.displacements.push(displacement);
                let shown = &rollouts.displacements;
                if let Some(outcome) = displacement.and_then(|_| self.outcome(shown)) {
                    rollouts.verdict = Some(self.ended(outcome, shown.len()));
                    return;
                }
            }
            rollouts.unstable = rollouts.unstable.or(rollout.unstable);
        }
        let shown = &rollouts.displacements;
        let outcome = rollouts
            .unstable
            .map_or_else(|| walked(self.known(shown)), Outcome::Unstable);
        rollouts.verdict = Some(self.ended(outcome, shown.len()));
    }

    fn ended(&self, outcome: Outcome, simulated: usize) -> Evaluation {
        let stopped = self
            .places
            .iter()
            .filter(|place| **place >= simulated)
            .count() as u64;
        let (all, simulated) = (self.setup.images.len() as u64, simulated as u64);
        Evaluation {
            outcome,
            simulated,
            shared: all - simulated - stopped,
            stopped,
        }
    }

    fn evaluation(&self) -> Evaluation {
        // All rollouts that the verdict needs are done; without images there are none.
        let mut rollouts = self.locked();
        self.count(&mut rollouts);
        rollouts
            .verdict
            .take()
            .unwrap_or_else(|| self.ended(Outcome::Walked(Vec::new()), 0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::stop::NEVER;
    use crate::body::Material;
    use crate::sim::UnstableReason;
    use crate::task::perturbation::{PerturbedSetting, Sizes, condition};
    use std::collections::BTreeSet;

    /// Its sensors expand at both ends: under a bright image it exceeds `blow_up_extent`.
    fn body() -> Body {
        let row = [
            Material::SensorExpand,
            Material::Soft,
            Material::SensorExpand,
        ];
        Body::new(Grid::from_fn(1, 3, |_, column| row[column])).unwrap()
    }

    fn physics() -> Physics {
        Physics {
            blow_up_extent: 0.115,
            ..Physics::default()
        }
    }

    /// Images by their three pixels.
    fn images(rows: &[[f64; 3]]) -> Vec<Grid<f64>> {
        rows.iter()
            .map(|row| Grid::from_fn(1, 3, |_, column| row[column]))
            .collect()
    }

    /// The second and the fourth are the same to the sensors, and so are the first and the last.
    const CALM: [[f64; 3]; 5] = [
        [0.4, 0.0, 0.3],
        [0.2, 0.5, 0.4],
        [0.1, 0.0, 0.4],
        [0.2, 0.9, 0.4],
        [0.4, 1.0, 0.3],
    ];
    /// The third is too bright, and so is the last.
    const WILD: [[f64; 3]; 5] = [
        [0.4, 0.0, 0.3],
        [0.2, 0.5, 0.4],
        [1.0, 0.0, 1.0],
        [0.2, 0.9, 0.4],
        [1.0, 0.7, 1.0],
    ];

    fn run(
        rows: &[[f64; 3]],
        rollout: RolloutMode,
        savings: Savings,
        order: &[usize],
        may_win: Box<MayWin>,
    ) -> Evaluation {
        let protocol = Protocol {
            rollout,
            control_steps: 8,
            ..Protocol::default()
        };
        let body = body();
        let job = Job {
            body: &body,
            order: order.to_vec(),
            may_win,
            given_up: None,
        };
        let mut evaluations = evaluate(
            &[job],
            &images(rows),
            &[],
            &physics(),
            &protocol,
            savings,
            &Session::default(),
        )
        .unwrap();
        assert_eq!(evaluations.len(), 1);
        let evaluation = evaluations.remove(0);
        let Evaluation {
            simulated,
            shared,
            stopped,
            ..
        } = evaluation;
        assert_eq!(
            simulated + shared + stopped,
            rows.len() as u64,
            "{evaluation:?}"
        );
        assert!(savings.shared_rollouts || shared == 0, "{evaluation:?}");
        evaluation
    }

    fn rayon(threads: usize) -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
    }

    /// Orders of the images: none, a first one, all, and some with repeated and missing images.
    const ORDERS: [&[usize]; 4] = [&[], &[3], &[4, 2, 0, 1, 3], &[7, 2, 2, 4]];

    fn all_savings() -> impl Iterator<Item = Savings> {
        (0..4).map(|mask| Savings {
            known_bodies: true,
            early_stop: mask & 1 > 0,
            shared_rollouts: mask & 2 > 0,
        })
    }

    #[test]
    fn rollouts_side_by_side_have_the_bits_of_each_by_itself() {
        let body: Body = "1111111/1311141/1161511/3111114/1111111".parse().unwrap();
        let images: Vec<Grid<f64>> = (0..11)
            .map(|k| {
                Grid::from_fn(5, 7, |row, column| {
                    f64::from((row * 5 + column * 3 + k) as u32 % 4) / 3.0
                })
            })
            .collect();
        let raised = condition(1, false);
        let conditions: Vec<Condition> = (0..11)
            .map(|k| {
                if k % 3 == 0 {
                    raised.clone()
                } else {
                    Condition::new()
                }
            })
            .collect();
        let protocol = Protocol {
            control_steps: 40,
            ..Protocol::default()
        };
        let physics = Physics::default();
        let session = Session::default();
        let setup = Setup::new(&images, &conditions, (&physics, &protocol), &session);
        let systems = setup.systems(&body);
        assert!(Worlds::gain(&systems[0]));
        let one_by_one: Vec<_> = (0..11)
            .map(|image| setup.fresh_rollout(&body, &systems, image).unwrap())
            .collect();
        for threads in [1, 3] {
            let together = || {
                fresh_rollouts(
                    &body,
                    &images,
                    &conditions,
                    (&physics, &protocol),
                    &|_| (),
                    &Session::default(),
                )
            };
            let (found, _) = rayon(threads).install(together).unwrap();
            assert_eq!(found, one_by_one, "{threads} threads");
        }
    }

    #[test]
    fn every_image_is_simulated_shared_or_stopped_in_every_outcome() {
        for (rollout, savings) in [RolloutMode::Fresh, RolloutMode::Sequential]
            .into_iter()
            .flat_map(|l| all_savings().map(move |s| (l, s)))
        {
            for (rows, order) in [&CALM, &WILD]
                .into_iter()
                .flat_map(|r| ORDERS.map(|order| (r, order)))
            {
                // After none, after some, never.
                for patience in [0, 1, 2, 5] {
                    let may_win =
                        move |known: &[Option<f64>]| known.iter().flatten().count() <= patience;
                    let evaluation = run(rows, rollout, savings, order, Box::new(may_win));
                    let is_stopped = matches!(evaluation.outcome, Outcome::Stopped(_));
                    assert!(
                        !is_stopped || savings.early_stop && patience < 5,
                        "{evaluation:?}"
                    );
                    assert_eq!(
                        matches!(evaluation.outcome, Outcome::Walked(_)),
                        rows == &CALM && !is_stopped
                    );
                }
            }
        }
    }

    #[test]
    fn the_outcome_is_the_same_with_each_saving_and_in_any_order() {
        for rollout in [RolloutMode::Fresh, RolloutMode::Sequential] {
            let none = Savings {
                known_bodies: false,
                early_stop: false,
                shared_rollouts: false,
            };
            let walked = run(&CALM, rollout, none, &[], Box::new(|_| true));
            let Outcome::Walked(displacements) = &walked.outcome else {
                panic!("{walked:?}")
            };
            assert!(displacements.len() == 5 && displacements.iter().any(|d| *d != 0.0));
            assert_eq!(walked.simulated, 5);
            for (savings, order) in
                all_savings().flat_map(|savings| ORDERS.map(|order| (savings, order)))
            {
                let other = run(&CALM, rollout, savings, order, Box::new(|_| true));
                assert_eq!(other.outcome, walked.outcome);
                let rollouts = if savings.shared_rollouts && rollout == RolloutMode::Fresh {
                    3
                } else {
                    5
                };
                assert_eq!((other.simulated, other.stopped), (rollouts, 0));
                let wild = run(&WILD, rollout, savings, order, Box::new(|_| true));
                let Outcome::Unstable(end) = wild.outcome else {
                    panic!("{wild:?}")
                };
                assert_eq!(end.reason, UnstableReason::BlownUp);
            }
        }
    }

    #[test]
    fn fresh_rollouts_follow_the_order_and_stop_when_nothing_can_be_won() {
        // Image 3 shares image 1's rollout, image 4 image 0's: with both known, it cannot win.
        let may_win = |known: &[Option<f64>]| {
            assert!(
                known[3].is_some() && known[1] == known[3],
                "image 3 comes first: {known:?}"
            );
            known[0].is_none()
        };
        let evaluation = run(
            &CALM,
            RolloutMode::Fresh,
            Savings::default(),
            &[3, 4],
            Box::new(may_win),
        );
        let all = run(
            &CALM,
            RolloutMode::Fresh,
            Savings::default(),
            &[],
            Box::new(|_| true),
        )
        .outcome;
        let Outcome::Walked(all) = all else {
            panic!("all images are shown")
        };
        let mut known: Vec<Option<f64>> = all.into_iter().map(Some).collect();
        known[2] = None;
        let outcome = Outcome::Stopped(known);
        assert_eq!(
            evaluation,
            Evaluation {
                outcome,
                simulated: 2,
                shared: 2,
                stopped: 1
            }
        );
    }

    #[test]
    fn every_rollout_is_looked_at_once() {
        let rows: Vec<[f64; 3]> = (0..60)
            .map(|i| [0.4 / 60.0 * f64::from(i), 0.0, 0.3])
            .collect();
        let looks = Arc::new(AtomicUsize::new(0));
        let look = Arc::clone(&looks);
        let may_win: Box<MayWin> = Box::new(move |_| {
            look.fetch_add(1, Ordering::Relaxed);
            true
        });
        let evaluation =
            rayon(2).install(|| run(&rows, RolloutMode::Fresh, Savings::default(), &[], may_win));
        assert_eq!(evaluation.simulated, 60);
        // After the last one there is nothing left to drop.
        assert_eq!(looks.load(Ordering::Relaxed), 59);
    }

    #[test]
    fn a_raised_start_is_another_rollout_even_under_the_same_image() {
        let protocol = Protocol {
            rollout: RolloutMode::Fresh,
            control_steps: 30,
            ..Protocol::default()
        };
        let (body, physics, images) = (body(), physics(), images(&CALM));
        let system = Arc::new(System::new(&body, physics.clone()));
        let live = |image: usize, rows: u32| {
            let raised = Protocol {
                start_row: protocol.start_row + rows,
                ..protocol.clone()
            };
            fresh_rollout(&system, &raised, &images[image], &NEVER).unwrap()
        };
        // To the sensors images 1 and 3, and 0 and 4, are the same; 1 and 3 also start the same.
        let raised = [1, 0, 1, 2];
        let expected = [live(0, 1), live(1, 0), live(2, 1), live(3, 2), live(4, 0)];
        assert!(
            expected[1] != expected[3] && expected[0] != expected[4],
            "{expected:?}"
        );
        for savings in all_savings() {
            let evaluated = |raised: &[u32]| {
                let conditions: Vec<Condition> =
                    raised.iter().map(|rows| condition(*rows, false)).collect();
                let job = Job {
                    body: &body,
                    order: Vec::new(),
                    may_win: Box::new(|_| true),
                    given_up: None,
                };
                evaluate(
                    &[job],
                    &images,
                    &conditions,
                    &physics,
                    &protocol,
                    savings,
                    &Session::default(),
                )
                .unwrap()
                .remove(0)
            };
            let evaluation = evaluated(&raised);
            assert_eq!(
                (evaluation.outcome, evaluation.simulated),
                (Outcome::Walked(expected.to_vec()), 5)
            );
            let rollouts = if savings.shared_rollouts { 4 } else { 5 };
            assert_eq!(evaluated(&[1, 0, 1, 2, 1]).simulated, rollouts);
        }
    }

    #[test]
    fn a_rollout_without_limits_is_another_rollout_and_leads_nowhere_where_it_becomes_unstable() {
        let protocol = Protocol {
            rollout: RolloutMode::Fresh,
            control_steps: 30,
            ..Protocol::default()
        };
        let images = images(&WILD);
        let evaluated = |physics: &Physics, without_limits: &[bool]| {
            let conditions: Vec<Condition> = without_limits
                .iter()
                .map(|off| condition(0, *off))
                .collect();
            let body = body();
            let may_win = Box::new(|_: &[Option<f64>]| true);
            let job = Job {
                body: &body,
                order: Vec::new(),
                may_win,
                given_up: None,
            };
            evaluate(
                &[job],
                &images,
                &conditions,
                physics,
                &protocol,
                Savings::default(),
                &Session::default(),
            )
            .unwrap()
            .remove(0)
        };
        // Tight limits keep a sensor at rest as far below its goal as they allow.
        let tight = Physics {
            limit_high: 1.02,
            limit_low: 0.98,
            ..physics()
        };
        let expected = |physics: &Physics, image: usize| {
            let system = Arc::new(System::new(&body(), physics.clone()));
            StepError::outcome(fresh_rollout(&system, &protocol, &images[image], &NEVER)).unwrap()
        };
        let calm = Physics {
            blow_up_extent: 1.0,
            ..tight.clone()
        };
        let mixed = [true, false, false, true, true];
        let evaluation = evaluated(&calm, &mixed);
        let free = calm.without_limits();
        let alone: Vec<f64> = mixed
            .iter()
            .enumerate()
            .map(|(image, &off)| expected(if off { &free } else { &calm }, image).unwrap())
            .collect();
        // Images 1 and 3, and 2 and 4, are the same to the sensors, but under different conditions.
        assert!(alone[1] != alone[3] && alone[2] != alone[4], "{alone:?}");
        assert_eq!(
            (evaluation.outcome, evaluation.simulated),
            (Outcome::Walked(alone), 5)
        );

        // Without them it grows wider than allowed: no reason to refuse it, but no walk either.
        assert!(expected(&tight, 2).is_ok() && expected(&tight.without_limits(), 2).is_err());
        let evaluation = evaluated(&tight, &[false, false, true, false, false]);
        let Outcome::Walked(walked) = evaluation.outcome else {
            panic!("{:?}", evaluation.outcome)
        };
        assert_eq!(walked[2], 0.0);
        assert_eq!(walked[1], expected(&tight, 1).unwrap());
    }

    #[test]
    fn every_perturbation_of_an_audit_is_shown_as_a_condition_of_its_own() {
        let (body, physics, images) = (body(), Physics::default(), images(&CALM));
        let protocol = Protocol {
            rollout: RolloutMode::Fresh,
            control_steps: 30,
            ..Protocol::default()
        };
        let sizes = Sizes {
            least_sensors: 1,
            ..Sizes::default()
        };
        for perturbation in Perturbation::all(&sizes, &body, RolloutMode::Fresh) {
            let setting = PerturbedSetting {
                body: body.clone(),
                physics: physics.clone(),
                protocol: protocol.clone(),
                stimuli: images.clone(),
            };
            let changed = perturbation.apply(&setting);
            let system = Arc::new(System::new(&changed.body, changed.physics));
            let live =
                |stimulus| fresh_rollout(&system, &changed.protocol, stimulus, &NEVER).unwrap();
            let expected = perturbation.undo(changed.stimuli.iter().map(live).collect());
            let conditions = vec![vec![perturbation]; images.len()];
            let setting = (&physics, &protocol);
            let (walked, _) = fresh_rollouts(
                &body,
                &images,
                &conditions,
                setting,
                &|_| (),
                &Session::default(),
            )
            .unwrap();
            let walked: Vec<f64> = walked.into_iter().map(Result::unwrap).collect();
            assert_eq!(walked, expected, "{}", perturbation.name());
        }
    }

    #[test]
    fn a_sequential_rollout_keeps_the_order_of_the_images() {
        let asked = Mutex::new(BTreeSet::new());
        let may_win = |known: &[Option<f64>]| {
            let first = known.iter().map_while(|displacement| *displacement).count();
            assert_eq!(known.iter().flatten().count(), first, "{known:?}");
            asked.lock().unwrap().insert(first);
            true
        };
        run(
            &CALM,
            RolloutMode::Sequential,
            Savings::default(),
            &[3, 4],
            Box::new(may_win),
        );
        assert_eq!(*asked.lock().unwrap(), BTreeSet::from([1, 2, 3, 4]));
    }

    #[test]
    fn rollouts_that_were_stopped_are_the_first_ones_and_the_others_complete_them() {
        let (physics, protocol) = (
            Physics::default(),
            Protocol {
                control_steps: 20,
                ..Protocol::default()
            },
        );
        let body: Body = "336/446/333".parse().unwrap();
        let images: Vec<Grid<f64>> = (0..60)
            .map(|number| {
                Grid::from_fn(3, 3, |row, column| {
                    f64::from((number * (row + 2) * (column + 1)) as u32 % 61) / 61.0
                })
            })
            .collect();
        let conditions = crate::task::perturbation::of_response();
        let conditions: Vec<Condition> = conditions.into_iter().cycle().take(60).collect();
        let setting = (&physics, &protocol);
        let (whole, _) = fresh_rollouts(
            &body,
            &images,
            &conditions,
            setting,
            &|_| (),
            &Session::default(),
        )
        .unwrap();
        for most in [1, 20, 59] {
            let (stop, done) = (AtomicBool::new(false), AtomicUsize::new(0));
            let told = |count: u64| {
                let done = done.fetch_add(count as usize, Ordering::Relaxed) + count as usize;
                stop.fetch_or(done >= most, Ordering::Relaxed);
            };
            let (found, _, ended) = fresh_rollouts_so_far(
                &body,
                &images,
                &conditions,
                setting,
                &told,
                &Session::new(&stop, &()),
            );
            let known = found.len();
            assert_eq!(ended.is_ok(), known == 60, "{known} of {most}");
            let (images, conditions) = (&images[known..], &conditions[known..]);
            let (rest, _) = fresh_rollouts(
                &body,
                images,
                conditions,
                setting,
                &|_| (),
                &Session::default(),
            )
            .unwrap();
            assert_eq!([found, rest].concat(), whole, "{known}");
        }
    }

    #[test]
    fn what_is_stopped_is_no_evaluation_and_ends_in_the_middle_of_a_rollout() {
        let (body, images) = (body(), images(&CALM));
        // A rollout that lasts for minutes.
        for rollout in [RolloutMode::Fresh, RolloutMode::Sequential] {
            let protocol = Protocol {
                rollout,
                control_steps: 10_000_000,
                ..Protocol::default()
            };
            let may_win = Box::new(|_: &[Option<f64>]| true);
            let job = Job {
                body: &body,
                order: Vec::new(),
                may_win,
                given_up: None,
            };
            let stop = AtomicBool::new(false);
            let begin = std::time::Instant::now();
            let ended = std::thread::scope(|threads| {
                threads.spawn(|| {
                    std::thread::sleep(std::time::Duration::from_millis(50));
                    stop.store(true, Ordering::Relaxed);
                });
                evaluate(
                    &[job],
                    &images,
                    &[],
                    &Physics::default(),
                    &protocol,
                    Savings::default(),
                    &Session::new(&stop, &()),
                )
            });
            assert_eq!(ended, Err(Stopped));
            assert!(begin.elapsed().as_secs() < 5, "{:?}", begin.elapsed());
        }
    }
}
