//! The rollouts of a training, kept in `training.json`, so that a resumed training can reuse them.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::files::write_atomically;
use crate::base::observer::Work;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::body::Body;
use crate::config::Config;
use crate::store::results;
use crate::store::training::{Batch, File};
use crate::task::evaluation::fresh_rollouts_so_far;
use crate::task::perturbation::Condition;
use crate::training::rollouts::Rollouts;
use crate::training::rounds::TrainingPlan;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Interval at which rollouts are saved. A power cut loses at most this much work.
const SAVE_EVERY: Duration = Duration::from_secs(5);

/// Rollouts per thread between two looks at the time to save. With fewer, threads wait more often.
const PART: usize = 128;

/// The rollouts simulated in this session and in earlier ones.
pub(crate) struct Log<'a> {
    path: PathBuf,
    key: String,
    batches: Vec<Batch>,
    /// Batches requested so far; `simulated` counts their rollouts.
    asked: usize,
    pub(crate) simulated: usize,
    /// Number of rollouts in the file, and the time it was written.
    saved: (usize, Instant),
    /// Rollouts completed in the current work; `None` if its progress has another unit.
    done: Option<AtomicU64>,
    pub(crate) has_simulated: Arc<AtomicBool>,
    pub(crate) session: &'a Session<'a>,
}

impl<'a> Log<'a> {
    pub(crate) fn open(
        path: PathBuf,
        key: String,
        session: &'a Session<'a>,
    ) -> Result<Self, Error> {
        let mut batches = Vec::new();
        if path.exists() {
            let name = path.display().to_string();
            let file: File =
                results::read(&path, None).map_err(|error| error.remedy(Remedy::Replace))?;
            if file.key != key {
                let text = format!(
                    "{name}: expected the training that began here: other robots, images or settings"
                );
                let error = Error::usage(text).advice("go on with those");
                return Err(error.remedy(Remedy::ChooseOut).remedy(Remedy::Replace));
            }
            if file.checksum.is_none() {
                session.observer.warning(&format!(
                    "{name}: it has no checksum, so damage to it would go unnoticed"
                ));
            }
            batches = file.rollouts;
        }
        let saved = (count(&batches), Instant::now());
        let has_simulated = Arc::default();
        Ok(Log {
            path,
            key,
            batches,
            asked: 0,
            simulated: 0,
            saved,
            done: None,
            has_simulated,
            session,
        })
    }

    /// Starts work whose progress is counted in rollouts.
    pub(crate) fn begins(&mut self, label: String, rollouts: usize) {
        self.session
            .observer
            .begins(&Work::new(label, rollouts as u64, "rollouts"));
        self.done = Some(AtomicU64::new(0));
    }

    /// Starts a round or, if the plan has none, the evaluation of the robot as it is.
    pub(crate) fn begins_round(&mut self, robot: &str, number: usize, plan: &TrainingPlan) {
        match plan.rounds {
            0 => self.begins(format!("{robot}: as it is:"), plan.images),
            rounds => self.begins(format!("{robot}: round {number} of {rounds}:"), plan.images),
        }
    }

    /// Starts work whose progress is counted in challengers.
    pub(crate) fn begins_challenges(&mut self, challengers: usize) {
        self.session.observer.begins(&Work::new(
            "refining:".to_string(),
            challengers as u64,
            "challengers",
        ));
        self.done = None;
    }

    /// Reports `count` rollouts as done; only `simulated` of them took time.
    fn rolled(&self, count: u64, simulated: u64) {
        if simulated > 0 {
            self.has_simulated.store(true, Ordering::Relaxed);
        }
        if let Some(done) = &self.done {
            self.session.observer.skips(count - simulated);
            self.session
                .observer
                .progress(done.fetch_add(count, Ordering::Relaxed) + count);
        }
    }

    /// Returns the rollouts of a body under stimuli and conditions; the first are `known`.
    pub(crate) fn rollouts(
        &mut self,
        body: &Body,
        (stimuli, conditions): (&[Grid<f64>], &[Condition]),
        known: &[Option<f64>],
        config: &Config,
    ) -> Result<Batch, Error> {
        let number = self.asked;
        self.asked += 1;
        self.simulated += stimuli.len();
        let begun = match self.batches.get(number) {
            Some(batch) if batch.len() == stimuli.len() => {
                self.rolled(batch.len() as u64, 0);
                return Ok(batch.clone());
            }
            // The last session stopped during this batch.
            Some(batch) if batch.len() < stimuli.len() && number + 1 == self.batches.len() => {
                self.batches.pop()
            }
            Some(batch) => {
                let (path, wanted, found) = (self.path.display(), stimuli.len(), batch.len());
                let text = format!("{path}: rollouts {number}: expected {wanted}, found {found}");
                return Err(Error::input(text).remedy(Remedy::Replace));
            }
            None => None,
        };
        let setting = (&config.physics, &config.protocol);
        self.batches
            .push(begun.unwrap_or_else(|| known[..known.len().min(stimuli.len())].to_vec()));
        self.rolled(self.batches[number].len() as u64, 0);
        // Simulating part by part lets a stopped training resume after the last part.
        let part = PART * rayon::current_num_threads();
        while self.batches[number].len() < stimuli.len() {
            let begin = self.batches[number].len();
            let end = stimuli.len().min(begin + part);
            let (stimuli, conditions) = (&stimuli[begin..end], &conditions[begin..end]);
            let told = |count| self.rolled(count, 1);
            let (found, _, ended) =
                fresh_rollouts_so_far(body, stimuli, conditions, setting, &told, self.session);
            self.batches[number].extend(found.into_iter().map(Result::ok));
            ended.map_err(|_| stopped())?;
            if self.saved.1.elapsed() >= SAVE_EVERY {
                self.save()?;
            }
        }
        Ok(self.batches[number].clone())
    }

    pub(crate) fn save(&mut self) -> Result<(), Error> {
        let rollouts = count(&self.batches);
        if self.saved.0 == rollouts && self.path.exists() {
            return Ok(());
        }
        let file = File::new(self.key.clone(), self.batches.clone());
        let text =
            serde_json::to_string(&file).expect("numbers are finite and keys are text") + "\n";
        write_atomically(&self.path, text.as_bytes())
            .map_err(|error| Error::writing(&self.path, &error))?;
        self.saved = (rollouts, Instant::now());
        Ok(())
    }
}

fn count(batches: &[Batch]) -> usize {
    batches.iter().map(Vec::len).sum()
}

pub(crate) fn stopped() -> Error {
    Error::stopped("stopped; what was simulated is saved".to_string())
        .remedy(Remedy::RepeatResuming)
}

/// Rollouts that are recorded in the log.
pub(crate) struct Kept<'a, 'b> {
    pub(crate) config: &'a Config,
    pub(crate) conditions: &'a [Condition],
    pub(crate) log: &'a mut Log<'b>,
}

impl Rollouts for Kept<'_, '_> {
    type Error = Error;

    fn roll(
        &mut self,
        body: &Body,
        stimuli: &[Grid<f64>],
        conditions: &[usize],
    ) -> Result<Batch, Error> {
        let conditions: Vec<Condition> = conditions
            .iter()
            .map(|number| self.conditions[*number].clone())
            .collect();
        self.log
            .rollouts(body, (stimuli, &conditions), &[], self.config)
    }
}
