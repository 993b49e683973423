//! [`ImageSets`]: test images to show: the built-in digits always, datasets of the archives where
//! they are found.

use crate::base::Grid;
use crate::base::error::Error;
use crate::data::dataset::{BUILTIN, Dataset, Split};
use crate::images::whereabouts::{Whereabouts, load_dataset_of};
use crate::serve::catalogue::Catalogue;
use crate::serve::refusal::Refusal;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Most images in one answer.
pub const MAX_PAGE: usize = 60;

/// An image by its place.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ImageName {
    /// Name of its set.
    pub set: String,
    /// Its index among the test images.
    pub index: usize,
}

/// A test image.
#[derive(Clone, Debug, Serialize)]
pub struct TestImage {
    /// Its index among the test images.
    pub index: usize,
    /// Its class.
    pub label: u8,
    /// Its pixels, 0 paper … 255 ink, rows from the top.
    pub pixels: Grid<u8>,
}

/// What a set has.
#[derive(Clone, Debug, Serialize)]
pub struct SetSummary {
    /// Its name.
    pub name: String,
    /// Number of test images by class.
    pub classes: Vec<(u8, usize)>,
}

/// The test images that can be shown.
pub struct ImageSets {
    sets: Vec<Dataset>,
}

impl ImageSets {
    /// Loads what is there; a dataset that is not is told in a note.
    ///
    /// # Errors
    /// If the built-in digits cannot be made (which does not happen).
    pub fn open(catalogue: &Catalogue, data: Option<&Path>) -> Result<(Self, Vec<String>), Error> {
        let refuse = |error: crate::data::dataset::DatasetError| Error::input(error.to_string());
        let mut sets = Vec::new();
        // With the name of the set that each is about.
        let mut notes: Vec<(&String, String)> = Vec::new();
        let collections = catalogue.collections();
        for collection in &collections {
            let name = &collection.config.data.dataset;
            if name == BUILTIN || sets.iter().any(|set: &Dataset| set.name() == name) {
                continue;
            }
            let whereabouts = Whereabouts::given(data);
            let whereabouts = match &collection.path {
                Some(path) => whereabouts.and_of(path),
                None => whereabouts,
            };
            let (own, config) = (collection.dataset.as_ref(), &collection.config);
            match load_dataset_of(own, config, &whereabouts, &[Split::Test]) {
                Ok(set) => {
                    // Robots of another archive may know better where it is.
                    notes.retain(|(of, _)| *of != name);
                    sets.push(set);
                }
                Err(error) => {
                    // Of several runs that lack the same folder the first says so.
                    let run = collection.path.as_ref().map(|path| format!("{}: ", path.display()));
                    let of_run = run.and_then(|run| error.message.strip_prefix(&run));
                    let what = of_run.unwrap_or(&error.message);
                    if notes.iter().all(|(_, told)| !told.ends_with(what)) {
                        notes.push((name, error.message));
                    }
                }
            }
        }
        sets.push(Dataset::load(BUILTIN, &[], &[Split::Test]).map_err(refuse)?);
        Ok((ImageSets { sets }, notes.into_iter().map(|(_, note)| note).collect()))
    }

    /// What there is.
    pub fn list(&self) -> Vec<SetSummary> {
        let classes = |set: &Dataset| {
            let classes = set.classes(Split::Test).into_iter();
            classes.map(|class| (class, set.indices_of(Split::Test, class).len())).collect()
        };
        self.sets
            .iter()
            .map(|set| SetSummary { name: set.name().to_string(), classes: classes(set) })
            .collect()
    }

    fn set(&self, name: &str) -> Result<&Dataset, Refusal> {
        let found = self.sets.iter().find(|set| set.name() == name);
        found.ok_or_else(|| Refusal::Unknown(format!("there is no set of images {name:?}")))
    }

    /// `count` images of a class, starting at number `from`.
    ///
    /// # Errors
    /// If there is no such set.
    pub fn page(&self, set: &str, class: u8, from: usize, count: usize) -> Result<Vec<TestImage>, Refusal> {
        let dataset = self.set(set)?;
        let indices = dataset.indices_of(Split::Test, class).iter().skip(from).take(count.min(MAX_PAGE));
        indices
            .map(|&index| {
                let pixels = dataset.image(Split::Test, index);
                let pixels = pixels.map_err(|error| Refusal::Unknown(error.to_string()))?;
                Ok(TestImage { index, label: class, pixels })
            })
            .collect()
    }

    /// An image.
    ///
    /// # Errors
    /// If there is none of that name.
    pub fn image(&self, name: &ImageName) -> Result<TestImage, Refusal> {
        let unknown = |error: crate::data::dataset::DatasetError| Refusal::Unknown(error.to_string());
        let (set, index) = (self.set(&name.set)?, name.index);
        let label = set.label(Split::Test, index).map_err(unknown)?;
        Ok(TestImage { index, label, pixels: set.image(Split::Test, index).map_err(unknown)? })
    }
}
