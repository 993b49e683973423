//! Validation images: those of the training split that a run neither is trained on nor chooses its training images among, drawn
//! by its seed.

use super::archive::RunFile;
use super::start::StartRef;
use super::training::{ImageRef, Training};
use super::validation::ValidationConfig;
use super::{Config, Error};
use crate::base::random::{Purpose, stream};
use crate::task::dataset::{Dataset, Split};
use std::collections::BTreeSet;

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

/// `count` validation images, evenly divided between the classes, which take turns: so are the first of them.
///
/// # Errors
/// If there are not enough images.
pub fn images(run: &RunFile, dataset: &Dataset, count: usize) -> Result<Vec<ImageRef>, Error> {
    let left = left(&run.config, &trained_on(run, dataset)?, dataset);
    let per_class = per_class(&run.config, &left, "--validation", count, "")?;
    let drawn: Vec<Vec<ImageRef>> = run
        .config
        .classes()
        .iter()
        .zip(left)
        .map(|(&label, free)| {
            let mut random = stream(run.config.seed, Purpose::Validation, 0, u64::from(label));
            random.sample(free.len(), per_class).into_iter().map(|i| free[i]).collect()
        })
        .collect();
    let turns =
        (0..per_class).flat_map(|turn| drawn.iter().filter_map(move |class| class.get(turn).copied()));
    Ok(turns.take(count).collect())
}
