//! [`ImageSets`]: the test images that the page offers: always the built-in digits, and datasets of
//! the archives if available.

use crate::base::Grid;
use crate::base::error::Error;
use crate::data::dataset::{BUILTIN, Dataset, Split};
use crate::data::gates::Gates;
use crate::images::whereabouts::{Whereabouts, load_dataset_of};
use crate::serve::catalogue::RobotCatalogue;
use crate::serve::refusal::HttpRefusal;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Maximum number of images in one response.
pub(crate) const MAX_PAGE: usize = 60;

#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ImageName {
    pub(crate) set: String,
    /// The index among the test images.
    pub(crate) index: usize,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct TestImage {
    pub(crate) index: usize,
    pub(crate) label: u8,
    /// The pixels, 0 paper … 255 ink, rows from the top.
    pub(crate) pixels: Grid<u8>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct SetSummary {
    pub(crate) name: String,
    /// The number of test images by class.
    pub(crate) classes: Vec<(u8, usize)>,
    /// The names of the classes, from class 0.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) class_names: Vec<String>,
    /// The number of cues, each bright or dark; the class and index of an image is the number that
    /// they make.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) cues: Option<usize>,
}

/// The test images that the page offers.
pub(crate) struct ImageSets {
    sets: Vec<Dataset>,
}

impl ImageSets {
    /// Loads the available datasets; a missing one becomes a note.
    pub(crate) fn open(
        catalogue: &RobotCatalogue,
        data: Option<&Path>,
    ) -> Result<(Self, Vec<String>), Error> {
        let refuse = |error: crate::data::dataset::DatasetError| Error::input(error.to_string());
        let mut sets = Vec::new();
        // Each with the name of its set.
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
                    // Robots of another archive may know where it is.
                    notes.retain(|(of, _)| *of != name);
                    sets.push(set);
                }
                Err(error) => {
                    // If several runs lack the same folder, only the first reports it.
                    let run = collection
                        .path
                        .as_ref()
                        .map(|path| format!("{}: ", path.display()));
                    let of_run = run.and_then(|run| error.message.strip_prefix(&run));
                    let what = of_run.unwrap_or(&error.message);
                    if notes.iter().all(|(_, told)| !told.ends_with(what)) {
                        notes.push((name, error.message));
                    }
                }
            }
        }
        sets.push(Dataset::load(BUILTIN, &[], &[Split::Test]).map_err(refuse)?);
        // The page begins with the first set: digits, if cues are not all that there is.
        sets.sort_by_key(|set| Gates::named(set.name()).is_some());
        Ok((
            ImageSets { sets },
            notes.into_iter().map(|(_, note)| note).collect(),
        ))
    }

    pub(crate) fn list(&self) -> Vec<SetSummary> {
        let classes = |set: &Dataset| {
            let classes = set.classes(Split::Test).into_iter();
            classes
                .map(|class| (class, set.indices_of(Split::Test, class).len()))
                .collect()
        };
        self.sets
            .iter()
            .map(|set| SetSummary {
                name: set.name().to_string(),
                classes: classes(set),
                class_names: set.class_names().all().to_vec(),
                cues: Gates::named(set.name()).map(|gates| gates.cues),
            })
            .collect()
    }

    fn set(&self, name: &str) -> Result<&Dataset, HttpRefusal> {
        let found = self.sets.iter().find(|set| set.name() == name);
        found.ok_or_else(|| HttpRefusal::Unknown(format!("there is no set of images {name:?}")))
    }

    /// Returns `count` images of a class, starting at number `from`.
    pub(crate) fn page(
        &self,
        set: &str,
        class: u8,
        from: usize,
        count: usize,
    ) -> Result<Vec<TestImage>, HttpRefusal> {
        let dataset = self.set(set)?;
        let indices = dataset
            .indices_of(Split::Test, class)
            .iter()
            .skip(from)
            .take(count.min(MAX_PAGE));
        indices
            .map(|&index| {
                let pixels = dataset.image(Split::Test, index);
                let pixels = pixels.map_err(|error| HttpRefusal::Unknown(error.to_string()))?;
                Ok(TestImage {
                    index,
                    label: class,
                    pixels,
                })
            })
            .collect()
    }

    pub(crate) fn image(&self, name: &ImageName) -> Result<TestImage, HttpRefusal> {
        let unknown =
            |error: crate::data::dataset::DatasetError| HttpRefusal::Unknown(error.to_string());
        let (set, index) = (self.set(&name.set)?, name.index);
        let label = set.label(Split::Test, index).map_err(unknown)?;
        Ok(TestImage {
            index,
            label,
            pixels: set.image(Split::Test, index).map_err(unknown)?,
        })
    }
}
