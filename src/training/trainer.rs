//! The course of a training: every gait is trained for one round; the best continues.

use crate::base::error::Error;
use crate::base::number;
use crate::base::observer::Work;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::text::counted;
use crate::config::Config;
use crate::data::dataset::{Dataset, Split};
use crate::images::training::TrainingImages;
use crate::images::whereabouts::stimulus_of;
use crate::response::design_problem::Example;
use crate::response::gait::Gait;
use crate::response::probing::{Probing, response};
use crate::response::regression::Response;
use crate::store::images::ImageRef;
use crate::store::training::Batch;
use crate::task::grouping::balanced;
use crate::task::perturbation::Condition;
use crate::training::gaits::Candidate;
use crate::training::log::{Kept, Log, stopped};
use crate::training::race::Challenge;
use crate::training::rollouts::Image;
use crate::training::rounds::{First, GaitTrainer, Round, TrainedDesign, TrainingPlan};
use crate::training::window::{Found, Windows};
use std::sync::Arc;
use std::sync::atomic::Ordering;

pub(crate) struct Trainer<'a> {
    pub(crate) config: &'a Config,
    pub(crate) dataset: &'a Dataset,
    pub(crate) training: &'a TrainingImages,
    pub(crate) probing: Probing,
    /// Displacements of each gait with random images that were known beforehand.
    pub(crate) measured: Vec<Batch>,
}

impl Trainer<'_> {
    /// Measures a gait's response; `None` if most of its rollouts are unstable.
    fn response(
        &self,
        gait: &Gait,
        measured: &[Option<f64>],
        log: &mut Log,
    ) -> Result<Option<Response>, Error> {
        let Trainer {
            config, probing, ..
        } = self;
        let count = config.train.random_images;
        let shown = probing.shown(
            gait,
            &config.physics,
            0..count,
            |probe, stimuli, conditions| {
                log.rollouts(probe, (stimuli, conditions), measured, config)
            },
        )?;
        Ok(response(&shown, count))
    }

    /// Returns the config with the window that has the best prediction for a gait.
    fn with_window(
        &self,
        walker: &Candidate,
        response: &Response,
        log: &Log,
        session: &Session,
    ) -> Result<Config, Error> {
        let Trainer {
            config, training, ..
        } = self;
        let (count, robot) = (config.train.windows_tried(), &walker.robot.id);
        let mut with = (*config).clone();
        with.train.windows = 0;
        if count == 0 {
            return Ok(with);
        }
        session.observer.begins(&Work::new(
            format!("{robot}: windows:"),
            count as u64,
            "windows",
        ));
        let windows = Windows::of(config, self.dataset, &training.images, self.groups())?;
        let told = |tried: usize| session.observer.progress(tried as u64);
        let found = windows
            .best(&walker.gait, response, log.session, &told)
            .map_err(|_| stopped())?;
        report_window(session, robot, &found, count);
        with.stimulus.margin = found.margins;
        Ok(with)
    }

    fn groups(&self) -> &[Vec<u8>; 2] {
        self.config
            .task
            .groups
            .as_ref()
            .expect("a training has two groups")
    }

    /// Returns the training images as a gait sees them; both groups weigh the same.
    fn images(&self, gait: &Gait, config: &Config) -> Result<Vec<Image>, Error> {
        let Trainer {
            training, probing, ..
        } = self;
        let all = probing.conditions();
        let [first, _] = self.groups();
        let ways = balanced(training.images.iter().map(|image| image.label), first);
        let image =
            |((image, condition), (right, weight)): ((&ImageRef, &Condition), (f64, f64))| {
                let stimulus = stimulus_of(config, self.dataset, Split::Train, image.index)?;
                let condition = all
                    .iter()
                    .position(|other| other == condition)
                    .expect("it is one of all");
                let example = Example {
                    right,
                    weight,
                    ..Example::new(gait, &stimulus, &config.physics)
                };
                Ok(Image {
                    stimulus,
                    class: image.label,
                    example,
                    condition,
                })
            };
        training
            .images
            .iter()
            .zip(&training.conditions)
            .zip(ways)
            .map(image)
            .collect()
    }

    fn plan(&self) -> TrainingPlan {
        let train = &self.config.train;
        TrainingPlan {
            seed: self.config.seed,
            rounds: train.rounds,
            images: train.images,
            final_images: train.final_images,
            challengers: train.challengers,
            min_muscles: self.config.body.min_muscles,
        }
    }

    /// Trains all gaits for one round, then continues with the one that has the best prediction.
    pub(crate) fn train<'w>(
        &self,
        walkers: &'w [Candidate<'w>],
        log: &mut Log,
        session: &Session,
    ) -> Result<(&'w Candidate<'w>, Config, TrainedDesign), Error> {
        let plan = self.plan();
        let Trainer {
            config, probing, ..
        } = self;
        let mut best: Option<(&Candidate, Config, GaitTrainer)> = None;
        for (walker, measured) in walkers.iter().zip(&self.measured) {
            let (gait, robot) = (&walker.gait, &walker.robot.id);
            log.begins(
                format!("{robot}: response:"),
                self.config.train.random_images,
            );
            let Some(response) = self.response(gait, measured, log)? else {
                continue;
            };
            report_response(session, &walker.robot.id, gait, &response);
            let seeing = self.with_window(walker, &response, log, session)?;
            let images = self.images(gait, &seeing)?;
            let mut trainer = GaitTrainer::new(gait, &response, images, plan, &config.physics);
            let conditions = probing.conditions();
            log.begins_round(robot, 1, &plan);
            let mut rollouts = Kept {
                config,
                conditions,
                log,
            };
            match trainer.first(&mut rollouts)? {
                First::Round(round) => report_round(session, robot, &round, &plan),
                First::Own(fitness) => report_own(session, robot, fitness),
            }
            if best
                .as_ref()
                .is_none_or(|(_, _, best)| trainer.predicted() > best.predicted())
            {
                best = Some((walker, seeing, trainer));
            }
            if plan.rounds == 0 {
                // Predictions of designs that nothing has changed rank no robots.
                break;
            }
        }
        let Some((walker, seeing, mut trainer)) = best else {
            let text =
                "none of the chosen robots is stable with random images: there is nothing to train";
            return Err(Error::input(text.to_string()).remedy(Remedy::ChooseRobots(None)));
        };
        let mut rollouts = Kept {
            config,
            conditions: probing.conditions(),
            log,
        };
        for number in 2..=plan.rounds {
            rollouts.log.begins_round(&walker.robot.id, number, &plan);
            let round = trainer.round(&mut rollouts)?;
            report_round(session, &walker.robot.id, &round, &plan);
        }
        let challengers = trainer.challengers();
        rollouts.log.begins_challenges(challengers);
        let has_simulated = Arc::clone(&rollouts.log.has_simulated);
        has_simulated.store(false, Ordering::Relaxed);
        let told = |challenge: &Challenge| {
            // A challenge recorded by an earlier session took no time.
            if !has_simulated.swap(false, Ordering::Relaxed) {
                session.observer.skips(1);
            }
            report_challenge(session, challenge, challengers);
        };
        Ok((walker, seeing, trainer.finish(&mut rollouts, told)?))
    }
}

fn report_response(session: &Session, robot: &str, gait: &Gait, response: &Response) {
    let places = counted(
        gait.places().len(),
        "soft voxel or sensor",
        "soft voxels and sensors",
    );
    let share = number::explained(response.r_squared);
    let noise = number::fixed(response.noise, 1);
    session.observer.note(&format!(
        "{robot}: {share} % of its response is explained by {places}; the rest is {noise} voxel lengths"
    ));
}

fn report_window(session: &Session, robot: &str, found: &Found, tried: usize) {
    let Found {
        margins,
        predicted,
        predicted_before,
    } = found;
    let [after, before] = [predicted, predicted_before].map(|fitness| number::fixed(*fitness, 2));
    session.observer.note(&format!(
        "{robot}: of {tried} windows, stimulus.margin = {margins} is predicted to be best: \
         fitness {after}, before {before}"
    ));
    session.observer.finding(
        "window",
        &serde_json::json!({
            "robot": robot, "windows": tried, "margin": margins, "predicted": predicted,
            "predicted_before": predicted_before,
        }),
    );
}

fn report_own(session: &Session, robot: &str, fitness: f64) {
    session.observer.note(&format!(
        "{robot}: fitness {} as it is",
        number::fixed(fitness, 2)
    ));
    session.observer.finding(
        "own",
        &serde_json::json!({ "robot": robot, "fitness": fitness }),
    );
}

fn report_round(session: &Session, robot: &str, round: &Round, plan: &TrainingPlan) {
    let Round {
        round,
        predicted,
        measured,
        off,
        changed,
        rollouts,
    } = round;
    let [p, m] = [predicted, measured].map(|fitness| number::fixed(*fitness, 2));
    session.observer.note(&format!(
        "{robot}: round {round} of {}: fitness {m}, predicted {p}",
        plan.rounds
    ));
    session.observer.finding(
        "round",
        &serde_json::json!({
            "robot": robot, "round": round, "rollouts": rollouts, "predicted": predicted, "measured": measured,
            "off": off,
            "changed": changed,
        }),
    );
}

fn report_challenge(session: &Session, challenge: &Challenge, challengers: usize) {
    let Challenge {
        number,
        other_gait,
        shown,
        fitness,
        won,
    } = challenge;
    let what = if *other_gait {
        "another gait"
    } else {
        "other sensors"
    };
    if *won {
        let fitness = number::fixed(*fitness, 3);
        session.observer.note(&format!(
            "challenger {number} of {challengers}: {what}: fitness {fitness}"
        ));
    }
    session.observer.progress(*number as u64);
    session.observer.finding(
        "challenge",
        &serde_json::json!({
            "challenger": number, "other_gait": other_gait, "images": shown, "fitness": fitness, "won": won,
        }),
    );
}
