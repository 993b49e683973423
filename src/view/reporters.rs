//! What the console shows while a command runs: the observers of `run`.

use super::console::{Bar, Console, Counter, Progress};
use crate::base::number;
use crate::run::curriculum::Period;
use crate::run::data::catalogue::RemoteFile;
use crate::run::data::fetch::{Attempt, FetchObserver};
use crate::run::folder::RunFolder;
use crate::run::start::StartRef;
use crate::run::training::{ImageRef, Training};
use crate::run::{audit, capacity, eval, evolve, reproduce, train};
use crate::task::response::{Gait, Response};
use crate::task::teach::{Plan, Round};
use std::sync::{OnceLock, RwLock};

/// Shows an evolution.
pub struct Evolution<'c> {
    console: &'c Console,
    bar: Option<Bar<'c>>,
}

impl<'c> Evolution<'c> {
    /// Shows it on a console.
    pub fn new(console: &'c Console) -> Self {
        Evolution { console, bar: None }
    }
}

fn shown(progress: &evolve::Progress) -> Progress {
    Progress {
        done: progress.done,
        total: progress.generations,
        best: progress.stats.obj_max,
        coverage: progress.stats.coverage,
        evaluations: progress.totals.evaluations,
    }
}

/// Training images for people: one by one if they are few.
fn listed(training: &Training) -> String {
    const FEW: usize = 8;
    if training.images.len() > FEW {
        let mut classes: Vec<u8> = training.images.iter().map(|image| image.label).collect();
        classes.sort_unstable();
        classes.dedup();
        return format!("{} images of {} classes", training.images.len(), classes.len());
    }
    let image = |image: &ImageRef| format!("{} (train {})", image.label, image.index);
    training.images.iter().map(image).collect::<Vec<_>>().join(", ")
}

impl evolve::Observer for Evolution<'_> {
    fn started(&mut self, folder: &RunFolder, training: &Training, progress: &evolve::Progress) {
        let verb = if progress.done > 0 { "going on with" } else { "evolving in" };
        let (folder, dataset) = (folder.path().display(), &training.dataset.name);
        self.console.info(&format!("{verb} {folder}; images from {dataset}: {}", listed(training)));
        let bar = self.console.progress(progress.generations);
        bar.update(&shown(progress));
        self.bar = Some(bar);
    }

    fn starting_from(&mut self, origin: &StartRef, robots: usize) {
        let StartRef { name, generations, .. } = origin;
        self.console.info(&format!("starting from {robots} elites of {name}, {generations} generations old"));
    }

    fn period(&mut self, period: Period, training: &Training, progress: &evolve::Progress) {
        let Progress { done, best, .. } = shown(progress);
        let best = best.map_or("no elite".to_string(), |best| format!("best {}", number::fixed(best, 2)));
        let number = period.stage + 1;
        let text =
            format!("stage {number} from generation {done} on: {}; elites anew: {best}", listed(training));
        self.console.info(&text);
    }

    fn generation(&mut self, progress: &evolve::Progress) {
        if let Some(bar) = &self.bar {
            bar.update(&shown(progress));
        }
    }

    fn validation(&mut self) -> Box<dyn eval::Observer + '_> {
        // Its bar ends first: there is one line on the screen.
        self.bar = None;
        Box::new(Evaluation::new(self.console))
    }

    fn warning(&mut self, text: &str) {
        self.console.warning(text);
    }
}

/// Shows a training.
pub struct Teaching<'c> {
    console: &'c Console,
}

impl<'c> Teaching<'c> {
    /// Shows it on a console.
    pub fn new(console: &'c Console) -> Self {
        Teaching { console }
    }
}

impl train::Observer for Teaching<'_> {
    fn started(&mut self, folder: &RunFolder, gaits: usize, images: usize) {
        let folder = folder.path().display();
        self.console.info(&format!("training in {folder}: {gaits} gaits, {images} training images"));
    }

    fn response(&mut self, robot: &str, gait: &Gait, response: &Response) {
        let (places, share) = (gait.places().len(), number::fixed(100.0 * response.r_squared, 0));
        let noise = number::fixed(response.noise, 1);
        let text = format!(
            "{robot}: {places} soft voxels and sensors explain {share} % of its response; the rest is {noise} voxel lengths"
        );
        self.console.info(&text);
    }

    fn round(&mut self, robot: &str, round: &Round, plan: &Plan) {
        let of = plan.rounds;
        let Round { round, predicted, measured, off, changed, rollouts } = round;
        let [p, m] = [predicted, measured].map(|fitness| number::fixed(*fitness, 2));
        self.console.info(&format!("{robot}: round {round} of {of}: fitness {m}, predicted {p}"));
        self.console.event("round", &serde_json::json!({
            "robot": robot, "round": round, "rollouts": rollouts, "predicted": predicted, "measured": measured, "off": off,
            "changed": changed,
        }));
    }

    fn validation(&mut self) -> Box<dyn eval::Observer + '_> {
        Box::new(Evaluation::new(self.console))
    }
}

/// Shows an evaluation.
pub struct Evaluation<'c> {
    console: &'c Console,
    counter: RwLock<Option<Counter<'c>>>,
}

impl<'c> Evaluation<'c> {
    /// Shows it on a console.
    pub fn new(console: &'c Console) -> Self {
        Evaluation { console, counter: RwLock::new(None) }
    }

    fn begin(&self, label: &str, showings: u64) {
        // A panic elsewhere is no reason to stop counting.
        let mut counter = self.counter.write().unwrap_or_else(std::sync::PoisonError::into_inner);
        // The one before ends first: there is one line on the screen.
        *counter = None;
        *counter = Some(self.console.counter(label, showings, "lives"));
    }
}

impl eval::Observer for Evaluation<'_> {
    fn validating(&self, robots: usize, images: usize, showings: u64) {
        let label = format!("validating {robots} robots on up to {images} images:");
        self.begin(&label, showings);
    }

    fn started(&self, robots: usize, images: usize) {
        self.begin(&format!("evaluating {robots} robots on {images} images:"), (robots * images) as u64);
    }

    fn progress(&self, done: u64) {
        let counter = self.counter.read().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(counter) = counter.as_ref() {
            counter.update(done);
        }
    }

    fn warning(&self, text: &str) {
        self.console.warning(text);
    }
}

/// Shows an audit.
pub struct Audit<'c> {
    console: &'c Console,
    counter: OnceLock<Counter<'c>>,
}

impl<'c> Audit<'c> {
    /// Shows it on a console.
    pub fn new(console: &'c Console) -> Self {
        Audit { console, counter: OnceLock::new() }
    }
}

impl audit::Observer for Audit<'_> {
    fn started(&self, robots: usize, lives: usize) {
        let label = format!("auditing {robots} robots:");
        self.counter.get_or_init(|| self.console.counter(&label, lives as u64, "lives"));
    }

    fn progress(&self, done: u64) {
        if let Some(counter) = self.counter.get() {
            counter.update(done);
        }
    }

    fn warning(&self, text: &str) {
        self.console.warning(text);
    }
}

/// Shows the training of networks.
pub struct Capacity<'c> {
    console: &'c Console,
    counter: OnceLock<Counter<'c>>,
}

impl<'c> Capacity<'c> {
    /// Shows it on a console.
    pub fn new(console: &'c Console) -> Self {
        Capacity { console, counter: OnceLock::new() }
    }
}

impl capacity::Observer for Capacity<'_> {
    fn started(&self, trainings: u64, known: u64) {
        let kept = if known > 0 { format!(" ({known} known from before)") } else { String::new() };
        let label = format!("training {trainings} networks{kept}:");
        let counter = self.counter.get_or_init(|| self.console.counter(&label, trainings, "trainings"));
        counter.go_on_from(known);
    }

    fn progress(&self, done: u64) {
        if let Some(counter) = self.counter.get() {
            counter.update(done);
        }
    }

    fn warning(&self, text: &str) {
        self.console.warning(text);
    }
}

/// Shows a reproduction.
pub struct Reproduction<'c> {
    console: &'c Console,
}

impl<'c> Reproduction<'c> {
    /// Shows it on a console.
    pub fn new(console: &'c Console) -> Self {
        Reproduction { console }
    }
}

impl reproduce::Observer for Reproduction<'_> {
    fn step(&self, text: &str) {
        self.console.info(text);
    }

    fn evolution(&self) -> Box<dyn evolve::Observer + Send + '_> {
        Box::new(Evolution::new(self.console))
    }

    fn audit(&self) -> Box<dyn audit::Observer + '_> {
        Box::new(Audit::new(self.console))
    }

    fn evaluation(&self) -> Box<dyn eval::Observer + '_> {
        Box::new(Evaluation::new(self.console))
    }

    fn capacity(&self) -> Box<dyn capacity::Observer + '_> {
        Box::new(Capacity::new(self.console))
    }
}

/// Shows a download.
pub struct Download<'c> {
    console: &'c Console,
    counter: Option<Counter<'c>>,
}

impl<'c> Download<'c> {
    /// Shows it on a console.
    pub fn new(console: &'c Console) -> Self {
        Download { console, counter: None }
    }
}

impl FetchObserver for Download<'_> {
    fn begins(&mut self, file: &RemoteFile, _url: &str) {
        self.counter = None;
        self.counter = Some(self.console.counter(&file.name, file.bytes, "bytes"));
    }

    fn received(&mut self, _file: &RemoteFile, bytes: u64) {
        if let Some(counter) = &self.counter {
            counter.update(bytes);
        }
    }

    fn failed(&mut self, file: &RemoteFile, attempt: &Attempt) {
        self.counter = None;
        self.console.warning(&format!("{}: {}: {}", file.name, attempt.url, attempt.error));
    }
}
