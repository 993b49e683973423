//! The gaits that a training tries, and the rollouts known beforehand.

use crate::base::error::Error;
use crate::base::hash::sha256_hex;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::config::Config;
use crate::config::train::TrainConfig;
use crate::data::dataset::{Dataset, Split};
use crate::images::held_out;
use crate::images::training::TrainingImages;
use crate::response::gait::Gait;
use crate::response::probing::Probing;
use crate::robots::selection::Selection;
use crate::store::folder;
use crate::store::names::RESPONSE_JSON;
use crate::store::response::ResponseFile;
use crate::store::run::{Robot, RunFile};
use crate::store::stored_run::StoredRun;
use crate::store::training::{Batch, Drawn, Elsewhere, Origin};
use crate::task::protocol::{Protocol, RolloutMode};
use std::collections::BTreeSet;

pub(crate) struct Candidate<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) gait: Gait,
}

/// Returns the origin of the gaits, with the images they were trained on; those cannot validate.
pub(crate) fn origin(
    source: &StoredRun,
    config: &Config,
    dataset: &Dataset,
) -> Result<Origin, Error> {
    let run = &source.run;
    let sha256 = dataset
        .fingerprint(Split::Train)
        .expect("a training loads its training images");
    let all = run
        .origin
        .as_ref()
        .map_or(Vec::new(), |origin| origin.elsewhere.clone());
    let (here, mut elsewhere): (Vec<_>, Vec<_>) = all
        .into_iter()
        .partition(|other| other.train_sha256 == sha256);
    let mut trained_on = BTreeSet::new();
    match sha256 == run.dataset.train_sha256 {
        true => trained_on = held_out::trained_on(run, dataset)?,
        // A later training may use that data again.
        false => elsewhere.push(Elsewhere::of(run)),
    }
    for earlier in here {
        trained_on.extend(earlier.indices);
        if let Some(Drawn {
            classes,
            images_per_class,
            seed,
        }) = earlier.drawn
        {
            let drawn = dataset.draw(Split::Train, &classes, images_per_class, seed);
            trained_on.extend(drawn.map_err(|error| Error::input(error.to_string()))?);
        }
    }
    Ok(Origin {
        name: run.name.clone(),
        generations: run.generations,
        sha256: run.fingerprint(),
        trained_on: trained_on.into_iter().collect(),
        elsewhere,
        windows: config.train.windows_tried(),
    })
}

pub(crate) fn candidates<'a>(
    source: &'a StoredRun,
    robots: &Selection,
    train: &TrainConfig,
    seed: u64,
) -> Result<Vec<Candidate<'a>>, Error> {
    let mut walkers: Vec<Candidate> = Vec::new();
    let mut chosen = robots.of(std::slice::from_ref(source), seed)?;
    if train.rounds == 0 {
        // One robot is refined as it is: the fittest, or the first of equals.
        chosen.sort_by(|a, b| b.robot.objective.total_cmp(&a.robot.objective));
    }
    for chosen in chosen {
        let Some(gait) = Gait::of(&chosen.robot.body) else {
            continue;
        };
        if walkers
            .iter()
            .all(|other| other.gait.probe() != gait.probe())
        {
            walkers.push(Candidate {
                robot: chosen.robot,
                gait,
            });
        }
    }
    if walkers.is_empty() {
        let text = format!(
            "{}: none of the chosen robots has a soft voxel or a sensor: there is nothing to train",
            source.path.display()
        );
        return Err(Error::input(text).remedy(Remedy::ChooseRobots(None)));
    }
    Ok(walkers)
}

/// Returns each gait's rollouts by `morphcog response`; empty unless valid for this training.
pub(crate) fn measured(
    source: &StoredRun,
    config: &Config,
    probing: &Probing,
    walkers: &[Candidate],
    session: &Session,
) -> Vec<Batch> {
    let nothing = || vec![Vec::new(); walkers.len()];
    // If the response of a named run was measured, it is in the current folder.
    let made = folder::beside(&source.path, RESPONSE_JSON);
    let path = if made.exists() {
        made
    } else {
        source.path.with_file_name(RESPONSE_JSON)
    };
    let of_run = &source.run.config;
    // Responses are measured in fresh rollouts.
    let protocol = Protocol {
        rollout: RolloutMode::Fresh,
        ..of_run.protocol.clone()
    };
    if (&config.physics, &config.protocol) != (&of_run.physics, &protocol) {
        return nothing();
    }
    let Some(file) = ResponseFile::found(&path, session) else {
        return nothing();
    };
    let (run, seed, conditions) = (source.run.fingerprint(), of_run.seed, probing.conditions());
    walkers
        .iter()
        .map(|walker| file.known(&run, seed, conditions, &walker.gait).0.to_vec())
        .collect()
}

/// Hashes all that rollouts depend on, but not the challengers: more of them only add rollouts.
pub(crate) fn key(
    config: &Config,
    seed_of_gaits: u64,
    walkers: &[Candidate],
    training: &TrainingImages,
) -> String {
    let bodies: Vec<String> = walkers
        .iter()
        .map(|walker| walker.robot.body.to_string())
        .collect();
    let images: Vec<usize> = training.images.iter().map(|image| image.index).collect();
    let train = TrainConfig {
        challengers: 0,
        ..config.train
    };
    let essence = Config {
        train,
        ..config.essence()
    }
    .to_toml();
    let text = format!(
        "{} {essence} {seed_of_gaits} {bodies:?} {} {images:?}",
        env!("CARGO_PKG_VERSION"),
        training.dataset.train_sha256
    );
    sha256_hex(text.as_bytes())
}

impl Elsewhere {
    fn of(run: &RunFile) -> Self {
        let config = &run.config;
        let before = run
            .origin
            .iter()
            .flat_map(|origin| origin.trained_on.iter().copied());
        let drawn = || Drawn {
            classes: config.classes(),
            images_per_class: config.data.images_per_class,
            seed: config.seed,
        };
        Elsewhere {
            train_sha256: run.dataset.train_sha256.clone(),
            indices: run
                .training_images
                .iter()
                .map(|image| image.index)
                .chain(before)
                .collect(),
            drawn: config.data.train_images.is_none().then(drawn),
        }
    }
}
