//! `morphcog evolve`: MAP-Elites over bodies. Resumable, with the same bits however it is run.

use crate::base::error::{Error, ErrorKind};
use crate::base::remedy::{Invocation, Remedy};
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::config::Config;
use crate::data::dataset::Split;
use crate::images::held_out;
use crate::images::training::TrainingImages;
use crate::images::whereabouts;
use crate::images::whereabouts::Whereabouts;
use crate::search::evolve::{Files, Mutations, Run};
use crate::search::{resume, validation};
use crate::store::folder::{IfExists, RunFolder};
use crate::store::metrics::{Metrics, Totals};
use crate::store::names::{METRICS, RUN_JSON, TRAINING_JSON};
use crate::store::run::RunFile;
use crate::store::validation::Validated;
use std::path::PathBuf;

/// The config of a run, and its output folder.
#[derive(Clone, Debug)]
pub struct EvolveOptions {
    /// Everything that the result depends on.
    pub config: Config,
    /// Name of the run.
    pub name: String,
    /// Its folder.
    pub out: PathBuf,
    /// Action if the folder already has a run.
    pub if_exists: IfExists,
}

/// The result of a session.
#[derive(Clone, Debug)]
pub struct EvolveOutcome {
    /// The run as written to `run.json`.
    pub run: RunFile,
    pub(crate) totals: Totals,
    /// Height and width of the training images.
    pub(crate) size: [usize; 2],
    /// Best robots of each task on validation images, best first; empty if the config wants none,
    /// or if it was stopped.
    pub validated: Vec<Validated>,
    /// True if a signal stopped the run before its last generation, or before the choice of robots.
    pub stopped: bool,
    /// Error that kept the last state from being fully written; the run resumes from its last
    /// checkpoint.
    pub unwritten: Option<Error>,
}

impl EvolveOutcome {
    /// Returns the id of the best robot on validation images or, without validation, the fittest.
    pub fn best(&self) -> Option<&str> {
        let better = |a: &Validated, b: &Validated| a.balanced_accuracy > b.balanced_accuracy;
        let first = self
            .validated
            .iter()
            .reduce(|best, other| if better(other, best) { other } else { best });
        first
            .map(|robot| robot.id.as_str())
            .or(self.run.best().map(|robot| robot.id.as_str()))
    }
}

/// Runs a config or resumes a run, then chooses robots on validation images if configured. If
/// `stop` is set, it drops the current generation and saves the state before it.
///
/// # Errors
/// Returns an error if config, data or folder is unsuitable. No existing results are lost, except
/// those that it is to replace ([`IfExists::Overwrite`]).
pub fn evolve(options: &EvolveOptions, session: &Session) -> Result<EvolveOutcome, Error> {
    let resumes = options.if_exists == IfExists::Resume;
    // Check everything that can be known before anything is written.
    if resumes && options.out.join(TRAINING_JSON).exists() {
        let text = format!(
            "{}: the run in this folder is a training",
            options.out.display()
        );
        return Err(Error::occupied(text).remedy(Remedy::Run(
            Invocation::new("train").switch("resume", true),
            "goes on with it",
        )));
    }
    let whereabouts = Whereabouts::given(session.data_folder())
        .and_of_resumed(options.if_exists, &options.out.join(RUN_JSON));
    let dataset = whereabouts.load(&options.config.data, &[Split::Train])?;
    whereabouts::say_transposed(&dataset, &options.config.data, session);
    let config = &options.config.clone().with_names_of(&dataset);
    let size = dataset
        .size(Split::Train)
        .expect("its training images were loaded just now");
    let training = TrainingImages::of(config, &dataset)?;
    held_out::check(config, &[], "data.images_per_class", &dataset)?;
    let mutations = Mutations::new(config, config.seed, session);
    let first = mutations.random(0, 0);
    // Only the leading rank has a folder.
    let ranks = session.ranks;
    let open = || RunFolder::open(&options.out, options.if_exists, session);
    let opened = first.and_then(|_| ranks.leads().then(open).transpose());
    // Every rank must vote, or the others block.
    let is_stopped = matches!(&opened, Err(error) if error.kind == ErrorKind::Stopped);
    if !ranks.all(!is_stopped) {
        return Err(Stopped.into());
    }
    let folder = opened?;
    let saved = match &folder {
        Some(folder) if resumes => resume::saved(folder, config, &training, |text| {
            session.observer.warning(&text)
        })?,
        _ => None,
    };
    let saved = ranks.broadcast(saved);
    if let Some(folder) = &folder {
        folder.write_config(config)?;
        whereabouts::remember(folder, &dataset)?;
    }
    let pool = session.pool()?;
    let mut run = Run::new((config, &options.name), session, training, saved)?;
    let mut files = match folder {
        Some(folder) => Some(Files {
            metrics: metrics(&folder, run.generation, session)?,
            folder,
        }),
        None => None,
    };
    session.observer.note(&run.beginning(&options.out));
    pool.install(|| run.evolve(&mutations, &mut files, session))
        .map_err(goes_on)?;
    let (file, totals) = (run.file(), run.totals());
    let is_whole = run.generation >= config.generations;
    let Some(mut files) = files else {
        return Ok(EvolveOutcome {
            run: file,
            totals,
            size,
            validated: Vec::new(),
            stopped: !is_whole,
            unwritten: None,
        });
    };
    let unwritten = files.save(&run).err().map(goes_on);
    // If the run was not written, robots would be chosen from an older run.json.
    let chooses =
        is_whole && unwritten.is_none() && config.validation.best > 0 && !file.elites.is_empty();
    let validated = match chooses {
        true => {
            let archive = files.folder.path().join(RUN_JSON);
            validation::at_end(&archive, &dataset, session)?
        }
        false => Some(Vec::new()),
    };
    let stopped = !is_whole || validated.is_none();
    let validated = validated.unwrap_or_default();
    Ok(EvolveOutcome {
        run: file,
        totals,
        size,
        validated,
        stopped,
        unwritten,
    })
}

fn metrics(folder: &RunFolder, generation: u64, session: &Session) -> Result<Metrics, Error> {
    let metrics = Metrics::open(folder.path(), generation)?;
    if metrics.missing > 0 {
        let (path, missing) = (
            folder.path().join(METRICS).display().to_string(),
            metrics.missing,
        );
        session.observer.warning(&format!(
            "{path}: {missing} of {generation} generations are missing in it"
        ));
    }
    Ok(metrics)
}

/// Adds the advice to resume to an error of a full disk.
fn goes_on(error: Error) -> Error {
    match error.kind == ErrorKind::Other && !error.remedies.is_empty() {
        true => error.remedy(Remedy::RepeatResuming),
        false => error,
    }
}
