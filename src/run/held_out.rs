//! Images that robots are not trained on: those of the test split, and validation images. The latter are those of the training
//! split that a run neither is trained on nor chooses its training images among, drawn by its seed.

use super::archive::RunFile;
use super::start::StartRef;
use super::training::{ImageRef, Training};
use super::validation::ValidationConfig;
use super::{Config, Error};
use crate::base::random::{Purpose, stream};
use crate::task::dataset::{Dataset, Split};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fmt;
use std::str::FromStr;

/// Which images that robots are not trained on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HeldOut {
    /// Those of the test split, which nothing should be chosen by.
    #[default]
    Test,
    /// Validation images.
    Validation,
}

impl HeldOut {
    /// Whether a file needs not say it.
    pub(super) fn is_default(&self) -> bool {
        *self == HeldOut::default()
    }
}

impl fmt::Display for HeldOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            HeldOut::Test => "test",
            HeldOut::Validation => "validation",
        })
    }
}

impl FromStr for HeldOut {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let found = [HeldOut::Test, HeldOut::Validation].into_iter().find(|split| split.to_string() == text);
        found.ok_or_else(|| "expected test or validation".to_string())
    }
}

/// Indices of all images that a run was trained on so far, in any of its periods, and before where it started from. With those
/// that hardest ones were chosen among: what is left of these is easier than images are.
pub(super) fn trained_on(run: &RunFile, dataset: &Dataset) -> Result<BTreeSet<usize>, Error> {
    let mut seen = before(run.start.as_ref());
    seen.extend(run.training_images.iter().map(|image| image.index));
    for period in run.config.periods(run.generations) {
        seen.extend(Training::drawn(&run.config, dataset, period)?);
    }
    Ok(seen)
}

/// What robots were trained on where a run started from.
fn before(start: Option<&StartRef>) -> BTreeSet<usize> {
    start.iter().flat_map(|start| &start.trained_on).copied().collect()
}

/// Of each class the images that are not among those seen.
fn left(config: &Config, seen: &BTreeSet<usize>, dataset: &Dataset) -> Vec<Vec<ImageRef>> {
    let of_class = |&label: &u8| {
        let all = dataset.indices_of(Split::Train, label).iter();
        let free = all.filter(|&index| !seen.contains(index));
        free.map(|&index| ImageRef { index, label }).collect()
    };
    config.classes().iter().map(of_class).collect()
}

/// How many are to be taken of each class, for `count` in all; `asked` says where that many were asked for, `or` what else to do.
///
/// # Errors
/// If a class has not as many.
fn per_class(
    config: &Config,
    left: &[Vec<ImageRef>],
    asked: &str,
    count: usize,
    or: &str,
) -> Result<usize, Error> {
    let per_class = count.div_ceil(left.len().max(1));
    match config.classes().iter().zip(left).min_by_key(|(_, left)| left.len()) {
        Some((label, scarcest)) if scarcest.len() < per_class => {
            let text = format!(
                "{asked} {count}: expected {per_class} images of class {label} that the run is not trained on and does not \
                choose from (pool), found {}",
                scarcest.len()
            );
            let most = scarcest.len() * left.len();
            Err(Error::input(text).hint(format!("ask for at most {most}{or}")))
        }
        _ => Ok(per_class),
    }
}

/// Whether a run that is to choose robots when it ends will have images for that: to be known before it begins.
///
/// # Errors
/// If of a class there are not enough.
pub(super) fn check(config: &Config, start: Option<&StartRef>, dataset: &Dataset) -> Result<(), Error> {
    let ValidationConfig { images, best } = config.validation;
    if best == 0 {
        return Ok(());
    }
    let or = ", train on fewer (images_per_class, pool, redraw), or choose none (validation.best = 0)";
    let mut seen = before(start);
    // One after the other: who draws without end runs out of images soon.
    for period in config.periods(config.generations) {
        seen.extend(Training::drawn(config, dataset, period)?);
        per_class(config, &left(config, &seen, dataset), "validation.images =", images, or)?;
    }
    Ok(())
}

/// `count` validation images of some runs of one experiment together, evenly divided between the classes, which take turns: so
/// are the first of them. Of the same runs, in whichever order, they are always the same, and fewer of them the first of more. `asked` says
/// where so many were asked for.
///
/// # Errors
/// If there are not enough images.
pub fn images(
    runs: &[&RunFile],
    dataset: &Dataset,
    asked: &str,
    count: usize,
) -> Result<Vec<ImageRef>, Error> {
    images_besides(&BTreeSet::new(), runs, dataset, asked, count)
}

/// The same, none of these among them.
///
/// # Errors
/// As of [`images`].
pub(super) fn images_besides(
    besides: &BTreeSet<usize>,
    runs: &[&RunFile],
    dataset: &Dataset,
    asked: &str,
    count: usize,
) -> Result<Vec<ImageRef>, Error> {
    let first = runs.iter().map(|run| &run.config).min_by_key(|config| config.seed);
    let Some(config) = first else { return Ok(Vec::new()) };
    let mut seen = besides.clone();
    for run in runs {
        seen.extend(trained_on(run, dataset)?);
    }
    let left = left(config, &seen, dataset);
    let per_class = per_class(config, &left, asked, count, "")?;
    let draw = |(&label, free): (&u8, Vec<ImageRef>)| -> Vec<ImageRef> {
        let mut random = stream(config.seed, Purpose::Validation, 0, u64::from(label));
        random.sample(free.len(), per_class).into_iter().map(|i| free[i]).collect()
    };
    let drawn: Vec<Vec<ImageRef>> = config.classes().iter().zip(left).map(draw).collect();
    let turns =
        (0..per_class).flat_map(|turn| drawn.iter().filter_map(move |class| class.get(turn).copied()));
    Ok(turns.take(count).collect())
}
