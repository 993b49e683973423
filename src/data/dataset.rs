//! Labelled images in two splits: MNIST, look-alikes of it, and the built-in digits.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::random::{Purpose, stream};
pub use crate::data::builtin::BUILTIN;
use crate::data::builtin::{BuiltinDigits, BuiltinError};
use crate::data::catalogue::{FETCHABLE, known_as};
use crate::data::class_names::ClassNames;
use crate::data::description::Description;
use crate::data::files;
use crate::data::files::{DatasetPlace, FilesError, StoredSplit};
use crate::data::gates::Gates;
pub use crate::data::info::Split;
use crate::data::info::{DatasetInfo, SplitInfo};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The reason why a dataset cannot be loaded, or lacks what was requested.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The files are missing or wrong.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// Such built-in digits do not exist.
    #[error(transparent)]
    Builtin(#[from] BuiltinError),
    /// The folder's description is wrong.
    #[error("{}", .0.message)]
    Description(Error),
    /// A published dataset is in the place of another one.
    #[error("{place}: these {split} images are those of {found}, not of {dataset}")]
    Other {
        /// Name of the dataset.
        dataset: String,
        /// The name that it is published under.
        found: &'static str,
        /// Its place.
        place: String,
        /// The split.
        split: Split,
    },
    /// The split was not requested when the dataset was loaded.
    #[error("{dataset}: the {split} images were not loaded")]
    NotLoaded {
        /// Name of the dataset.
        dataset: String,
        /// The split.
        split: Split,
    },
    /// An index is beyond the end of a split.
    #[error("{dataset}: there is no {split} image {index}: there are {len}, counted from 0")]
    Index {
        /// Name of the dataset.
        dataset: String,
        /// The split.
        split: Split,
        /// The index requested.
        index: usize,
        /// Number of images in the split.
        len: usize,
    },
    /// There are fewer images of a class than requested.
    #[error(
        "{dataset}: {wanted} {split} images of class {class} were asked for, there are {found}"
    )]
    TooFew {
        /// Name of the dataset.
        dataset: String,
        /// The split.
        split: Split,
        /// The name of the class, or its number.
        class: String,
        /// Number requested.
        wanted: usize,
        /// Number of images of the class.
        found: usize,
    },
}

impl From<DatasetError> for Error {
    fn from(error: DatasetError) -> Self {
        let remedies = match &error {
            DatasetError::Files(files) => files.remedies().to_vec(),
            _ => Vec::new(),
        };
        Error {
            remedies,
            ..Error::input(error.to_string())
        }
    }
}

/// Labelled images, with one or both splits loaded.
#[derive(Clone, Debug)]
pub struct Dataset {
    name: String,
    /// The folder with its files; none for the built-in digits.
    folder: Option<PathBuf>,
    origin: String,
    class_names: ClassNames,
    splits: BTreeMap<Split, Loaded>,
}

#[derive(Clone, Debug)]
struct Loaded {
    labels: Vec<u8>,
    by_class: BTreeMap<u8, Vec<usize>>,
    images: Images,
}

#[derive(Clone, Debug)]
enum Images {
    Stored(StoredSplit),
    Drawn(BuiltinDigits),
    Gates(Gates),
}

/// Where images come from that have no files.
const DRAWN: &str = "drawn by the program";

/// Returns true if the program draws the images of a dataset of this name itself.
pub(crate) fn is_drawn(name: &str) -> bool {
    name == BUILTIN || Gates::named(name).is_some()
}

impl Dataset {
    /// Loads the wanted splits of a dataset: "builtin" (the default [`BuiltinDigits`]), "mnist",
    /// "fashion-mnist", or any other name for the user's own IDX files. The files must be in the
    /// first of the `given` places (see [`files::places`]) or, without any, in `data/<name>`. Files
    /// of splits that are not wanted may be missing.
    ///
    /// # Errors
    /// Returns [`DatasetError::Files`]: the file, its place, what was expected and what to do.
    pub fn load(
        name: &str,
        given: &[DatasetPlace],
        wanted: &[Split],
    ) -> Result<Self, DatasetError> {
        Dataset::oriented(name, given, wanted, None)
    }

    /// Acts as [`Dataset::load`]; `transpose` says whether rows and columns of the images in the
    /// files are exchanged. By default those of EMNIST are, which is recognised by its names.
    pub(crate) fn oriented(
        name: &str,
        given: &[DatasetPlace],
        wanted: &[Split],
        transpose: Option<bool>,
    ) -> Result<Self, DatasetError> {
        if name == BUILTIN {
            return Dataset::builtin(BuiltinDigits::default(), wanted);
        }
        if let Some(gates) = Gates::named(name) {
            return Ok(Dataset::gates(gates, wanted));
        }
        let place = files::choose(name, given)?;
        let described = Description::read(&place.path).map_err(DatasetError::Description)?;
        let transpose = transpose.or(described.as_ref().and_then(|said| said.transpose));
        let class_names = described.map_or_else(ClassNames::default, |said| said.names());
        let mut splits = BTreeMap::new();
        for &split in wanted {
            let (labels, stored) = files::load(name, &place, split, transpose)?;
            // Otherwise results would name the wrong dataset.
            if FETCHABLE.contains(&name)
                && let Some(found) =
                    known_as(&stored.fingerprint, &stored.files).filter(|found| *found != name)
            {
                let (dataset, place) = (name.to_string(), place.path.display().to_string());
                return Err(DatasetError::Other {
                    dataset,
                    found,
                    place,
                    split,
                });
            }
            splits.insert(split, Loaded::new(labels, Images::Stored(stored)));
        }
        Ok(Dataset {
            name: name.to_string(),
            folder: Some(place.path),
            origin: place.origin,
            class_names,
            splits,
        })
    }

    /// Makes built-in digits with the given parameters. Images are drawn on request.
    ///
    /// # Errors
    /// Returns [`DatasetError::Builtin`] if [`BuiltinDigits::validate`] fails.
    pub(crate) fn builtin(digits: BuiltinDigits, wanted: &[Split]) -> Result<Self, DatasetError> {
        digits.validate()?;
        let loaded = |&split: &Split| {
            let labels = (0..).map_while(|i| digits.label(split, i)).collect();
            (split, Loaded::new(labels, Images::Drawn(digits.clone())))
        };
        let splits = wanted.iter().map(loaded).collect();
        Ok(Dataset {
            name: BUILTIN.to_string(),
            folder: None,
            origin: DRAWN.to_string(),
            class_names: ClassNames::default(),
            splits,
        })
    }

    /// Makes the images of gates; those of both splits are the same.
    pub(crate) fn gates(gates: Gates, wanted: &[Split]) -> Self {
        let loaded = |&split: &Split| {
            let labels = (0..=u8::MAX).take(gates.len()).collect();
            (split, Loaded::new(labels, Images::Gates(gates)))
        };
        Dataset {
            name: gates.name().to_string(),
            folder: None,
            origin: DRAWN.to_string(),
            class_names: ClassNames::of(&gates.class_names()),
            splits: wanted.iter().map(loaded).collect(),
        }
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Returns the folder it was read from; none for the built-in digits.
    pub(crate) fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    pub(crate) fn class_names(&self) -> &ClassNames {
        &self.class_names
    }

    /// Calls its classes as a config does, if that names any.
    #[must_use]
    pub(crate) fn called(self, names: &[String]) -> Self {
        match names.is_empty() {
            true => self,
            false => Dataset {
                class_names: ClassNames::of(names),
                ..self
            },
        }
    }

    /// Returns name, folder and the origin of that folder, for messages.
    pub(crate) fn place(&self) -> String {
        match &self.folder {
            Some(folder) => format!("{} in {} ({})", self.name, folder.display(), self.origin),
            None => self.name.clone(),
        }
    }

    /// Returns height and width of the images of a split; `None` if it was not loaded.
    pub(crate) fn size(&self, split: Split) -> Option<[usize; 2]> {
        self.splits.get(&split).map(|loaded| match &loaded.images {
            Images::Stored(stored) => [stored.images.height, stored.images.width],
            Images::Drawn(_) => [BuiltinDigits::SIDE; 2],
            Images::Gates(_) => [Gates::SIDE; 2],
        })
    }

    /// Returns true if rows and columns of the images in its files are exchanged.
    pub(crate) fn is_transposed(&self) -> bool {
        let is_turned =
            |loaded: &Loaded| matches!(&loaded.images, Images::Stored(stored) if stored.transposed);
        self.splits.values().any(is_turned)
    }

    /// Returns the number of images in a split; 0 if it was not loaded.
    pub fn len(&self, split: Split) -> usize {
        self.splits
            .get(&split)
            .map_or(0, |loaded| loaded.labels.len())
    }

    /// Returns the image at an index of a split: 0 background … 255 ink, row 0 on top.
    ///
    /// # Errors
    /// Returns [`DatasetError::NotLoaded`] or [`DatasetError::Index`].
    pub fn image(&self, split: Split, index: usize) -> Result<Grid<u8>, DatasetError> {
        let image = match &self.loaded(split)?.images {
            Images::Stored(stored) => stored.images.image(index),
            Images::Drawn(digits) => digits.image(split, index),
            Images::Gates(gates) => gates.image(index),
        };
        image.ok_or_else(|| self.no_such(split, index))
    }

    /// Returns the class of the image at an index of a split.
    ///
    /// # Errors
    /// Returns [`DatasetError::NotLoaded`] or [`DatasetError::Index`].
    pub fn label(&self, split: Split, index: usize) -> Result<u8, DatasetError> {
        let label = self.loaded(split)?.labels.get(index).copied();
        label.ok_or_else(|| self.no_such(split, index))
    }

    /// Returns the indices of all images of a class in a split, ascending; none if not loaded.
    pub fn indices_of(&self, split: Split, class: u8) -> &[usize] {
        self.splits
            .get(&split)
            .and_then(|loaded| loaded.by_class.get(&class))
            .map_or(&[], Vec::as_slice)
    }

    /// Returns the classes that occur in a split, ascending; none if it was not loaded.
    pub(crate) fn classes(&self, split: Split) -> Vec<u8> {
        self.splits
            .get(&split)
            .map_or_else(Vec::new, |loaded| loaded.by_class.keys().copied().collect())
    }

    /// Returns the training classes that a user names, or all of them, ascending.
    ///
    /// # Errors
    /// Returns an error about `classes` if one is not there, or if there are fewer than two.
    pub(crate) fn chosen(&self, texts: Option<&[String]>) -> Result<Vec<u8>, Error> {
        let (all, names) = (self.classes(Split::Train), &self.class_names);
        let mut classes = match texts {
            None => all.clone(),
            Some(texts) => {
                let read = texts.iter().map(|text| names.class(text));
                let read = read.collect::<Result<Vec<u8>, String>>();
                read.map_err(|text| Error::usage(text).about("classes"))?
            }
        };
        classes.sort_unstable();
        classes.dedup();
        if let Some(class) = classes.iter().find(|class| !all.contains(class)) {
            let text = format!(
                "{} has no class {}: expected some of {}",
                self.name,
                names.name(*class),
                names.list(&all)
            );
            return Err(Error::usage(text).about("classes"));
        }
        match classes.len() < 2 {
            true => Err(Error::usage("expected two or more".to_string()).about("classes")),
            false => Ok(classes),
        }
    }

    /// Returns a split's SHA-256 (see [`SplitInfo::fingerprint`]); `None` if it was not loaded.
    pub(crate) fn fingerprint(&self, split: Split) -> Option<String> {
        self.splits.get(&split).map(|loaded| match &loaded.images {
            Images::Stored(stored) => stored.fingerprint.clone(),
            Images::Drawn(digits) => digits.fingerprint(split),
            Images::Gates(gates) => gates.fingerprint(),
        })
    }

    pub(crate) fn info(&self) -> DatasetInfo {
        let describe = |(&split, loaded): (&Split, &Loaded)| {
            let [height, width] = self.size(split).expect("the split is loaded");
            let (transposed, files) = match &loaded.images {
                Images::Stored(stored) => (stored.transposed, stored.files.clone()),
                Images::Drawn(_) | Images::Gates(_) => (false, Vec::new()),
            };
            let fingerprint = self.fingerprint(split).expect("the split is loaded");
            let per_class = loaded
                .by_class
                .iter()
                .map(|(&class, indices)| (class, indices.len()))
                .collect();
            let images = loaded.labels.len();
            (
                split,
                SplitInfo {
                    images,
                    height,
                    width,
                    fingerprint,
                    transposed,
                    per_class,
                    files,
                },
            )
        };
        let splits = self.splits.iter().map(describe).collect();
        let source = self
            .folder
            .as_ref()
            .map_or(self.name.clone(), |folder| folder.display().to_string());
        let (name, origin) = (self.name.clone(), self.origin.clone());
        DatasetInfo {
            name,
            source,
            origin,
            class_names: self.class_names.all().to_vec(),
            splits,
        }
    }

    /// Draws `per_class` different images of each class by seed and returns their indices: those of
    /// `classes[0]`, those of `classes[1]`, … Other classes do not affect the draw of one.
    pub(crate) fn draw(
        &self,
        split: Split,
        classes: &[u8],
        per_class: usize,
        seed: u64,
    ) -> Result<Vec<usize>, DatasetError> {
        self.loaded(split)?;
        let mut drawn = Vec::new();
        for &class in classes {
            let all = self.indices_of(split, class);
            if all.len() < per_class {
                let (dataset, found) = (self.name.clone(), all.len());
                let class = self.class_names.name(class);
                return Err(DatasetError::TooFew {
                    dataset,
                    split,
                    class,
                    wanted: per_class,
                    found,
                });
            }
            let child = 256 * split.code() + u64::from(class);
            let picked = stream(seed, Purpose::Images, 0, child).sample(all.len(), per_class);
            drawn.extend(picked.into_iter().map(|i| all[i]));
        }
        Ok(drawn)
    }

    fn loaded(&self, split: Split) -> Result<&Loaded, DatasetError> {
        self.splits
            .get(&split)
            .ok_or_else(|| DatasetError::NotLoaded {
                dataset: self.name.clone(),
                split,
            })
    }

    fn no_such(&self, split: Split, index: usize) -> DatasetError {
        DatasetError::Index {
            dataset: self.name.clone(),
            split,
            index,
            len: self.len(split),
        }
    }
}

impl Loaded {
    fn new(labels: Vec<u8>, images: Images) -> Self {
        let mut by_class = BTreeMap::<u8, Vec<usize>>::new();
        for (index, &label) in labels.iter().enumerate() {
            by_class.entry(label).or_default().push(index);
        }
        Loaded {
            labels,
            by_class,
            images,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digits() -> Dataset {
        Dataset::load(BUILTIN, &[], &Split::ALL).unwrap()
    }

    #[test]
    fn draws_are_even_distinct_and_fixed_by_seed() {
        let data = digits();
        let drawn = data.draw(Split::Test, &[4, 9], 100, 5).unwrap();
        let labels: Vec<u8> = drawn
            .iter()
            .map(|&i| data.label(Split::Test, i).unwrap())
            .collect();
        assert!(labels[..100].iter().all(|&l| l == 4) && labels[100..].iter().all(|&l| l == 9));
        let mut distinct = drawn.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), 200);
        assert_eq!(drawn, data.draw(Split::Test, &[4, 9], 100, 5).unwrap());
        assert_eq!(drawn[..100], data.draw(Split::Test, &[4], 100, 5).unwrap());
        assert_ne!(drawn, data.draw(Split::Test, &[4, 9], 100, 6).unwrap());
        let error = data.draw(Split::Test, &[4], 501, 5).unwrap_err();
        let expected = "builtin: 501 test images of class 4 were asked for, there are 500";
        assert_eq!(error.to_string(), expected);
        let mut names = vec![String::new(); 4];
        names.push("four".to_string());
        let error = data.called(&names).draw(Split::Test, &[4], 501, 5);
        assert!(error.unwrap_err().to_string().contains("class four"));
    }

    #[test]
    fn indices_and_splits_that_are_not_there_are_errors() {
        let data = Dataset::load(BUILTIN, &[], &[Split::Train]).unwrap();
        let error = data.image(Split::Train, 10_000).unwrap_err().to_string();
        assert_eq!(
            error,
            "builtin: there is no train image 10000: there are 10000, counted from 0"
        );
        assert!(matches!(
            data.label(Split::Test, 0),
            Err(DatasetError::NotLoaded { .. })
        ));
        assert!(matches!(
            data.draw(Split::Test, &[1], 1, 1),
            Err(DatasetError::NotLoaded { .. })
        ));
        assert_eq!(
            (data.len(Split::Test), data.fingerprint(Split::Test)),
            (0, None)
        );
    }

    #[test]
    fn info_of_builtin_digits_goes_through_json() {
        let info = digits().info();
        assert_eq!(info.splits[&Split::Train].per_class[&3], 1000);
        let text = serde_json::to_string(&info).unwrap();
        assert_eq!(serde_json::from_str::<DatasetInfo>(&text).unwrap(), info);
    }
}
