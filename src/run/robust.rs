//! Robust evolution (`robust = true` in `[evaluation]` or a stage): a robot is as fit as in the worst of its lives, the unchanged one and a
//! few that no honest walker should notice.
//!
//! The task it performs is that of the unchanged life. Its fitness is then never above the unchanged life's, so that
//! whoever cannot win by that need not live the others, and savings stay lossless.

use super::Config;
use super::training::Training;
use crate::base::stop::Stopped;
use crate::body::Body;
use crate::task::evaluation::{Evaluation, Job, MayWin, Outcome, Savings, evaluate};
use crate::task::fitness::{ENOUGH, Fitness};
use crate::task::grouping::Grouping;
use crate::task::perturbation::{Perturbation, Setting};
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;

/// How robots are evaluated: section `[evaluation]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EvaluationConfig {
    /// Fitness is that of the worst of a few perturbed lives, the unchanged one included. Default false.
    pub robust: bool,
    /// How answers to several images are judged together. Default the smallest margin, the paper's.
    #[serde(skip_serializing_if = "is_min")]
    pub fitness: Fitness,
    /// Where fitness is a mean, the margin at which an answer is as good as can be \[voxel lengths\]. Default 10; then left out of
    /// files.
    #[serde(skip_serializing_if = "is_ten")]
    pub enough: u16,
}

fn is_min(fitness: &Fitness) -> bool {
    *fitness == Fitness::Min
}

fn is_ten(enough: &u16) -> bool {
    *enough == ENOUGH
}

impl Default for EvaluationConfig {
    fn default() -> Self {
        EvaluationConfig { robust: false, fitness: Fitness::default(), enough: ENOUGH }
    }
}

impl EvaluationConfig {
    /// Whether all is as by default; it is then left out of files.
    pub fn is_default(&self) -> bool {
        *self == EvaluationConfig::default()
    }
}

/// A robot's evaluation, and what bounds its fitness besides.
pub(super) struct Scored {
    /// Of the unchanged life; unstable if one of the others is. Showings are counted of all.
    pub evaluation: Evaluation,
    /// Least fitness, on its task, in the perturbed lives; infinite if there are none.
    pub at_most: f64,
}

impl From<Evaluation> for Scored {
    /// Without perturbed lives.
    fn from(evaluation: Evaluation) -> Self {
        Scored { evaluation, at_most: f64::INFINITY }
    }
}

/// Lets the robots that may still win live their perturbed lives. Results in the jobs' order.
///
/// # Errors
/// [`Stopped`] if `stop` was set meanwhile.
pub(super) fn with_perturbed_lives(
    config: &Config,
    training: &Training,
    grouping: &Grouping,
    jobs: &[Job],
    evaluations: Vec<Evaluation>,
    savings: Savings,
    stop: &AtomicBool,
) -> Result<Vec<Scored>, Stopped> {
    let mut scored: Vec<Scored> = evaluations.into_iter().map(Scored::from).collect();
    for perturbation in Perturbation::of_evolution() {
        let open: Vec<(usize, usize)> = (0..jobs.len())
            .filter_map(|index| {
                may_win(savings, grouping, training, &jobs[index], &scored[index]).map(|t| (index, t))
            })
            .collect();
        let Some(&(first, _)) = open.first() else { break };
        // What evolution changes is of the world or the start: the same for every body.
        let Setting { physics, protocol, stimuli, .. } =
            perturbation.apply(&setting(config, training, jobs[first].body));
        let lives: Vec<Job> =
            open.iter().map(|&(index, _)| all_of(jobs[index].body, training, grouping)).collect();
        let savings = Savings { early_stop: false, ..savings };
        let conditions = &training.conditions;
        let lived = evaluate(&lives, &stimuli, conditions, &physics, &protocol, savings, stop)?;
        for (&(index, task), life) in open.iter().zip(lived) {
            let robot = &mut scored[index];
            robot.evaluation.simulated += life.simulated;
            robot.evaluation.shared += life.shared;
            match life.outcome {
                Outcome::Walked(displacements) => {
                    let answers = training.answers(displacements.into_iter().map(Some));
                    robot.at_most = robot.at_most.min(grouping.fitness_on(&grouping.tasks()[task], &answers));
                }
                unstable => robot.evaluation.outcome = unstable,
            }
        }
    }
    Ok(scored)
}

/// The task of a robot that walked and is not beaten yet.
fn may_win(
    savings: Savings,
    grouping: &Grouping,
    training: &Training,
    job: &Job,
    scored: &Scored,
) -> Option<usize> {
    let Outcome::Walked(displacements) = &scored.evaluation.outcome else { return None };
    let known: Vec<Option<f64>> = displacements.iter().copied().map(Some).collect();
    let wins = !savings.early_stop || (job.may_win)(&known);
    wins.then(|| grouping.score(&training.answers(known)).task)
}

fn all_of<'a>(body: &'a Body, training: &'a Training, grouping: &'a Grouping) -> Job<'a> {
    Job {
        body,
        order: Vec::new(),
        may_win: Box::new(|_| true),
        settled: settled(training, grouping),
        given_up: None,
    }
}

/// Whether displacements under the training images settle a fitness; `None` where only all of them do.
pub(super) fn settled<'a>(training: &'a Training, grouping: &'a Grouping) -> Option<Box<MayWin<'a>>> {
    let is_settled =
        move |known: &[Option<f64>]| grouping.is_settled(&training.answers(known.iter().copied()));
    grouping.criterion().last_wrong().map(|_| Box::new(is_settled) as Box<MayWin>)
}

fn setting(config: &Config, training: &Training, body: &Body) -> Setting {
    let (physics, protocol) = (config.physics.clone(), training.protocol.clone());
    Setting { body: body.clone(), physics, protocol, stimuli: training.stimuli.clone() }
}
