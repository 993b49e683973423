//! Images to train and test networks on: those of the robots, as the robots see them.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::hash::sha256_hex;
use crate::base::random::{Purpose, stream};
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::baseline::{NetworkKind, Samples, Trained, train};
use crate::config::capacity::CapacityConfig;
use crate::data::dataset::{Dataset, Split};
use crate::images::whereabouts::{Whereabouts, stimulus_for};
use crate::store::eval::EvalFile;
use crate::store::images::ImageRef;
use crate::store::names::RUN_JSON;
use crate::store::setting::{RunRef, RunSetting};
use crate::task::fitness::Group;
use crate::task::grouping;
use std::path::{Path, PathBuf};

/// The images that networks train on, wait on and are tested on, with their classes.
pub(crate) struct Images {
    training: Vec<Vec<Seen>>,
    waiting: Vec<Seen>,
    test: Vec<Seen>,
    /// Hash of all images as they are seen.
    pub(crate) key: String,
}

/// An image as the robots see it.
pub(crate) struct Seen {
    stimulus: Grid<f64>,
    class: u8,
}

impl Images {
    pub(crate) fn of(
        report: &EvalFile,
        setting: &RunSetting,
        (eval, config): (&Path, &CapacityConfig),
        session: &Session,
    ) -> Result<Images, Error> {
        let dataset = whereabouts(eval, session).load_of(
            &setting.train_sha256,
            &setting.data,
            &Split::ALL,
        )?;
        if report.test_sha256 != dataset.fingerprint(Split::Test) {
            let text = format!(
                "{}: the images here are not those of {} (another SHA-256)",
                dataset.place(),
                eval.display()
            );
            return Err(Error::input(text).remedy(Remedy::NameData));
        }
        let see = |split: Split, images: &[ImageRef]| -> Result<Vec<Seen>, Error> {
            let one = |image: &ImageRef| {
                let stimulus = stimulus_for(
                    &setting.body,
                    &setting.stimulus,
                    &dataset,
                    split,
                    image.index,
                )?;
                Ok(Seen {
                    stimulus,
                    class: image.label,
                })
            };
            images.iter().map(one).collect()
        };
        let waited = if config.clean {
            waiting(&dataset, setting, &report.runs, config)?
        } else {
            Vec::new()
        };
        let training: Result<Vec<_>, Error> = report
            .runs
            .iter()
            .map(|run| see(Split::Train, &run.training_images))
            .collect();
        let (training, test_images) = (training?, see(Split::Test, &report.images)?);
        let waiting = see(Split::Train, &waited)?;
        // Pixels, not indices, since training depends on the pixels.
        let all = training
            .iter()
            .flatten()
            .chain(&test_images)
            .chain(&waiting);
        let pixels: Vec<(u8, &[f64])> = all
            .map(|seen| (seen.class, seen.stimulus.cells()))
            .collect();
        let counts: Vec<usize> = training.iter().map(Vec::len).collect();
        let (size, waited) = ((setting.body.height, setting.body.width), waiting.len());
        let key = sha256_hex(format!("{size:?} {counts:?} {pixels:?} {waited}").as_bytes());
        Ok(Images {
            training,
            waiting,
            test: test_images,
            key,
        })
    }
}

/// Collects the whereabouts of the images from runs beside the evaluation or in folders there.
fn whereabouts(eval: &Path, session: &Session) -> Whereabouts {
    let folder = eval
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let entries = std::fs::read_dir(folder.unwrap_or(Path::new(".")))
        .into_iter()
        .flatten()
        .flatten();
    let mut runs: Vec<PathBuf> = entries.map(|entry| entry.path().join(RUN_JSON)).collect();
    runs.sort();
    let here = Whereabouts::given(session.data_folder()).and_of(eval);
    runs.iter()
        .fold(here, |whereabouts, run| whereabouts.and_of(run))
}

/// Draws images of the training split that no run was trained on last.
fn waiting(
    dataset: &Dataset,
    setting: &RunSetting,
    runs: &[RunRef],
    config: &CapacityConfig,
) -> Result<Vec<ImageRef>, Error> {
    let classes = setting.task.classes();
    let per_class = config.waiting_images.div_ceil(classes.len().max(1));
    let trained = |index: &usize| {
        runs.iter()
            .any(|run| run.training_images.iter().any(|i| i.index == *index))
    };
    let mut all = Vec::new();
    for &label in &classes {
        let free: Vec<usize> = dataset
            .indices_of(Split::Train, label)
            .iter()
            .copied()
            .filter(|index| !trained(index))
            .collect();
        if free.len() < per_class {
            let found = free.len();
            let class = dataset.class_names().name(label);
            let text = format!(
                "capacity: waiting_images: expected {per_class} of class {class}, found {found}"
            );
            let advice = match found * classes.len() {
                0 => "clean = false needs none".to_string(),
                most => format!("ask for at most {most}"),
            };
            return Err(Error::input(text).advice(advice));
        }
        let rng = &mut stream(config.seed, Purpose::Waiting, 0, u64::from(label));
        all.extend(
            rng.sample(free.len(), per_class)
                .into_iter()
                .map(|i| ImageRef {
                    index: free[i],
                    label,
                }),
        );
    }
    Ok(all)
}

/// The images of a task, with their groups, as networks of a kind see them.
pub(crate) struct Task {
    kind: NetworkKind,
    training: Vec<Samples>,
    waiting: Option<Samples>,
    test: Samples,
}

impl Task {
    pub(crate) fn new(
        split: &grouping::ClassSplit,
        kind: NetworkKind,
        config: &CapacityConfig,
        images: &Images,
    ) -> Result<Self, Error> {
        let samples = |of: &[Seen]| {
            let grouped = of
                .iter()
                .filter_map(|seen| Some((&seen.stimulus, split.group(seen.class)?)));
            let grouped: Vec<(&Grid<f64>, usize)> = grouped
                .map(|(stimulus, group)| (stimulus, usize::from(group == Group::B)))
                .collect();
            Samples::new(&grouped, kind, config.of(kind))
                .map_err(|error| Error::input(format!("capacity: {error}")))
        };
        let training: Result<Vec<Samples>, Error> =
            images.training.iter().map(|run| samples(run)).collect();
        let waiting = (!images.waiting.is_empty())
            .then(|| samples(&images.waiting))
            .transpose()?;
        Ok(Task {
            kind,
            training: training?,
            waiting,
            test: samples(&images.test)?,
        })
    }

    /// Trains the network of this number; the runs take turns in lending their images.
    pub(crate) fn train(
        &self,
        size: usize,
        config: &CapacityConfig,
        number: usize,
        session: &Session,
    ) -> Result<Trained, Error> {
        let kind = self.kind;
        let training = &self.training[number % self.training.len()];
        let waiting = self.waiting.as_ref().unwrap_or(&self.test);
        let rng = &mut stream(
            config.seed,
            Purpose::Networks,
            ((kind as u64) << 32) + size as u64,
            number as u64,
        );
        Ok(train(
            size,
            config.of(kind),
            training,
            waiting,
            &self.test,
            rng,
            session,
        )?)
    }
}
