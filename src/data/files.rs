//! Finding and loading the files of a dataset.

use crate::base::files::home_expanded;
use crate::base::hash::{hex, sha256_hex};
use crate::base::remedy::{Invocation, Remedy};
use crate::data::builtin::{BUILTIN, BuiltinDigits};
use crate::data::catalogue::FETCHABLE;
use crate::data::gates::Gates;
use crate::data::idx;
use crate::data::idx::{IdxError, IdxImages};
use crate::data::info::{FileInfo, Split};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Returns the height and width of the images of a dataset that the program knows by its name.
pub(crate) fn known_size(name: &str) -> Option<[usize; 2]> {
    let side = match Gates::named(name) {
        Some(_) => Gates::SIDE,
        None if name == BUILTIN || FETCHABLE.contains(&name) => BuiltinDigits::SIDE,
        None => return None,
    };
    Some([side; 2])
}

/// A folder that should hold the data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DatasetPlace {
    /// Origin of the folder in the user's terms: "as given", "MORPHCOG_DATA", `[data] dir`.
    pub(crate) origin: String,
    /// The folder, or its subfolder of the dataset's name: one may hold several datasets.
    pub(crate) path: PathBuf,
}

impl fmt::Display for DatasetPlace {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} ({})", self.path.display(), self.origin)
    }
}

/// Returns the given places, in order of precedence: the option `--data`, the environment variable
/// `MORPHCOG_DATA` (its value; empty counts as not set), and the config's `[data] dir`.
///
/// Only the first one is used, and must work: silently reading other data than the user named would
/// be worse than an error.
pub fn places(
    option: Option<&Path>,
    environment: Option<OsString>,
    config: Option<&Path>,
) -> Vec<DatasetPlace> {
    let environment = environment
        .filter(|value| !value.is_empty())
        .map(PathBuf::from);
    [
        ("as given", option.map(Path::to_path_buf)),
        ("MORPHCOG_DATA", environment),
        ("[data] dir", config.map(Path::to_path_buf)),
    ]
    .into_iter()
    .filter_map(|(origin, path)| {
        Some(DatasetPlace {
            origin: origin.to_string(),
            path: home_expanded(&path?),
        })
    })
    .collect()
}

/// Returns the folder of a dataset if no place is given, and of downloads: `data/<name>`.
pub(crate) fn default_folder(name: &str) -> PathBuf {
    Path::new("data").join(name)
}

/// The reason why a dataset's files cannot be used: file, place and expectation; see [`remedies`].
///
/// [`remedies`]: FilesError::remedies
#[derive(Debug, thiserror::Error)]
pub enum FilesError {
    /// The name cannot be a folder's name.
    #[error("\"{0}\" cannot be the name of a dataset: expected letters, digits, '-', '_' and '.'")]
    Name(String),
    /// The folder cannot be listed.
    #[error("{dataset}: the folder {place} cannot be read: {source}")]
    Folder {
        /// Name of the dataset.
        dataset: String,
        /// The folder.
        place: Box<DatasetPlace>,
        /// The system's error.
        source: io::Error,
        /// The user's alternatives.
        remedies: Vec<Remedy>,
    },
    /// A file is missing.
    #[error(
        "{dataset}: the {split} {content} are missing: expected {expected} (or with .gz, or a name ending so) \
         in {place}"
    )]
    Missing {
        /// Name of the dataset.
        dataset: String,
        /// The split.
        split: Split,
        /// "images" or "labels".
        content: &'static str,
        /// The file's standard name.
        expected: String,
        /// The folder.
        place: Box<DatasetPlace>,
        /// The user's alternatives.
        remedies: Vec<Remedy>,
    },
    /// Several files match.
    #[error(
        "{dataset}: several files in {place} could be the {split} {content}: {}; keep one, or one dataset per folder",
        found.join(", ")
    )]
    Ambiguous {
        /// Name of the dataset.
        dataset: String,
        /// The split.
        split: Split,
        /// "images" or "labels".
        content: &'static str,
        /// The folder.
        place: Box<DatasetPlace>,
        /// The files that match.
        found: Vec<String>,
    },
    /// A file is broken or of the wrong kind.
    #[error("{source}")]
    Broken {
        /// The error, which names the file.
        source: IdxError,
        /// The user's alternatives.
        remedies: Vec<Remedy>,
    },
    /// Numbers of images and labels differ.
    #[error(
        "{}: holds {labels} labels, expected {images}, one for each image in {}",
        label_file.display(), image_file.display()
    )]
    Count {
        /// The label file.
        label_file: PathBuf,
        /// Number of labels in it.
        labels: usize,
        /// The image file.
        image_file: PathBuf,
        /// Number of images in it.
        images: usize,
        /// The user's alternatives.
        remedies: Vec<Remedy>,
    },
}

impl FilesError {
    pub(crate) fn remedies(&self) -> &[Remedy] {
        match self {
            FilesError::Name(_) => &[Remedy::NameData],
            FilesError::Folder { remedies, .. }
            | FilesError::Missing { remedies, .. }
            | FilesError::Broken { remedies, .. }
            | FilesError::Count { remedies, .. } => remedies,
            FilesError::Ambiguous { .. } => &[],
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct StoredSplit {
    pub(crate) images: IdxImages,
    /// True if their rows and columns are exchanged in the files.
    pub(crate) transposed: bool,
    pub(crate) files: Vec<FileInfo>,
    pub(crate) fingerprint: String,
}

pub(crate) fn check_name(name: &str) -> Result<(), FilesError> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    match name.is_empty() || name.starts_with('.') || !name.chars().all(allowed) {
        true => Err(FilesError::Name(name.to_string())),
        false => Ok(()),
    }
}

/// Chooses the first given place, or else the default; its path is the folder with the files.
pub(crate) fn choose(name: &str, given: &[DatasetPlace]) -> Result<DatasetPlace, FilesError> {
    check_name(name)?;
    Ok(match given.first() {
        Some(place) => {
            let own = place.path.join(name);
            let path = if own.is_dir() {
                own
            } else {
                place.path.clone()
            };
            DatasetPlace {
                origin: place.origin.clone(),
                path,
            }
        }
        None => DatasetPlace {
            origin: "default".to_string(),
            path: default_folder(name),
        },
    })
}

/// Loads one split; `transpose`: are rows and columns exchanged? By default, if EMNIST's.
pub(crate) fn load(
    name: &str,
    place: &DatasetPlace,
    split: Split,
    transpose: Option<bool>,
) -> Result<(Vec<u8>, StoredSplit), FilesError> {
    let broken = |source: IdxError| FilesError::Broken {
        remedies: remedies(name, place, !source.is_io()),
        source,
    };
    let (image_file, beginning) = find(name, place, split, "images", None)?;
    // Another set in the same folder might have as many labels.
    let (label_file, _) = find(name, place, split, "labels", Some(&beginning))?;
    let mut images = idx::read_images(&image_file).map_err(broken)?;
    let transposed = transpose.unwrap_or_else(|| is_emnist(name, place, &image_file));
    if transposed {
        images.content = images.content.transposed();
    }
    let labels = idx::read_labels(&label_file).map_err(broken)?;
    let (expected, found) = (images.content.count, labels.content.len());
    if expected != found {
        let remedies = remedies(name, place, true);
        return Err(FilesError::Count {
            label_file,
            labels: found,
            image_file,
            images: expected,
            remedies,
        });
    }
    let mut hash = Sha256::new();
    let sizes = [
        images.content.count,
        images.content.height,
        images.content.width,
    ]
    .map(|n| n as u32);
    hash.update(idx::header(&sizes));
    hash.update(&images.content.pixels);
    hash.update(idx::header(&sizes[..1]));
    hash.update(&labels.content);
    let fingerprint = hex(&hash.finalize());
    let describe = |path: &Path, bytes, sha256: &str| FileInfo {
        name: path
            .file_name()
            .expect("it was read as a file")
            .to_string_lossy()
            .into_owned(),
        bytes,
        sha256: sha256.to_string(),
    };
    let files = vec![
        describe(&image_file, images.bytes, &images.sha256),
        describe(&label_file, labels.bytes, &labels.sha256),
    ];
    Ok((
        labels.content,
        StoredSplit {
            images: images.content,
            transposed,
            files,
            fingerprint,
        },
    ))
}

/// True if the names of dataset, file or folder are EMNIST's, whose rows and columns are exchanged.
fn is_emnist(dataset: &str, place: &DatasetPlace, image_file: &Path) -> bool {
    let folder = place
        .path
        .canonicalize()
        .unwrap_or_else(|_| place.path.clone());
    let folder = folder.file_name().filter(|_| !FETCHABLE.contains(&dataset));
    let names = [Some(dataset.as_ref()), image_file.file_name(), folder];
    let mut names = names.into_iter().flatten();
    names.any(|name| names_emnist(&name.to_string_lossy()))
}

/// True if EMNIST is a word of a name.
pub(crate) fn names_emnist(name: &str) -> bool {
    name.split(|c: char| !c.is_ascii_alphanumeric())
        .any(|word| word.eq_ignore_ascii_case("emnist"))
}

/// Returns the standard names (without .gz) of a split's images or labels, the most common first.
fn standard_names(split: Split, content: &str) -> Vec<String> {
    let stems: &[&str] = match split {
        Split::Train => &["train"],
        Split::Test => &["t10k", "test"],
    };
    let kind = if content == "images" { "idx3" } else { "idx1" };
    let spelled =
        |stem: &&str| ["-", "."].map(|mark| format!("{stem}-{content}{mark}{kind}-ubyte"));
    stems.iter().flat_map(spelled).collect()
}

/// Finds the file of a split's images or labels: one with a standard name, or else the only one
/// whose name ends in one (`emnist-digits-train-…`), in any case. Several, such as a gzipped copy,
/// must have the same content. Returns path and beginning of the name; `beginning` requires one.
fn find(
    name: &str,
    place: &DatasetPlace,
    split: Split,
    content: &'static str,
    beginning: Option<&str>,
) -> Result<(PathBuf, String), FilesError> {
    let (dataset, searched) = (name.to_string(), Box::new(place.clone()));
    let present = match file_names(&place.path) {
        Ok(present) => present,
        Err(source) => {
            let remedies = remedies(name, place, false);
            return Err(FilesError::Folder {
                dataset,
                place: searched,
                source,
                remedies,
            });
        }
    };
    let standard = standard_names(split, content);
    // Standard names go before all others, in their own order; gzipped files first.
    let mut found: Vec<(usize, String, &String)> = Vec::new();
    for file in present.iter().rev() {
        let base = bare(file);
        let is_meant = beginning.is_none_or(|beginning| begins(&base, content) == beginning);
        if is_meant && standard.iter().any(|name| base.ends_with(name.as_str())) {
            let place = standard
                .iter()
                .position(|name| base == *name)
                .unwrap_or(standard.len());
            found.push((place, base, file));
        }
    }
    found.sort_by_key(|(place, ..)| *place);
    let is_standard = found
        .first()
        .is_some_and(|(place, ..)| *place < standard.len());
    found.retain(|(place, ..)| *place < standard.len() || !is_standard);
    let Some((_, base, file)) = found.first() else {
        let usual = &standard[0];
        let expected = match beginning {
            Some(beginning) => usual.replacen(begins(usual, content), beginning, 1),
            None => usual.clone(),
        };
        let remedies = remedies(name, place, false);
        return Err(FilesError::Missing {
            dataset,
            split,
            content,
            expected,
            place: searched,
            remedies,
        });
    };
    let is_one = is_standard || found.iter().all(|(_, other, _)| other == base);
    let files: Vec<&String> = found.iter().map(|(.., file)| *file).collect();
    if !is_one || !hold_the_same(name, place, &files)? {
        let found = files.into_iter().rev().cloned().collect();
        return Err(FilesError::Ambiguous {
            dataset,
            split,
            content,
            place: searched,
            found,
        });
    }
    Ok((place.path.join(file), begins(base, content).to_string()))
}

/// Returns a file's name for comparisons: in lower case, without the ending of gzipped files.
fn bare(file: &str) -> String {
    let name = file.to_ascii_lowercase();
    name.strip_suffix(".gz").unwrap_or(&name).to_string()
}

/// Returns true if files have the same content after unpacking.
fn hold_the_same(name: &str, place: &DatasetPlace, files: &[&String]) -> Result<bool, FilesError> {
    if files.len() < 2 {
        return Ok(true);
    }
    let mut sums = BTreeSet::new();
    for file in files {
        let unpacked = idx::unpacked(&place.path.join(file));
        let broken = |source| FilesError::Broken {
            remedies: remedies(name, place, true),
            source,
        };
        sums.insert(sha256_hex(&unpacked.map_err(broken)?));
    }
    Ok(sums.len() == 1)
}

/// Returns the beginning of a file's name, before the kind of its content.
fn begins<'a>(base: &'a str, content: &str) -> &'a str {
    &base[..base.rfind(content).unwrap_or(base.len())]
}

/// Returns the names of all entries of a folder that are not folders. Includes broken links, since
/// reading them reports the problem. Leaves out hidden files, such as those that macOS adds.
fn file_names(folder: &Path) -> io::Result<BTreeSet<String>> {
    let mut names = BTreeSet::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if !entry.path().is_dir() {
            names.extend(
                entry
                    .file_name()
                    .into_string()
                    .ok()
                    .filter(|name| !name.starts_with('.')),
            );
        }
    }
    Ok(names)
}

fn remedies(name: &str, place: &DatasetPlace, replace: bool) -> Vec<Remedy> {
    if !FETCHABLE.contains(&name) {
        let put = Remedy::advice("put its IDX files there");
        return vec![put, Remedy::NameData, Remedy::UseBuiltin];
    }
    let fetch = Invocation::new("data fetch").value(name);
    let fetch = match place.path == default_folder(name) {
        true => fetch,
        false => fetch.option("to", place.path.as_path()),
    };
    vec![Remedy::Run(fetch.switch("force", replace), "downloads it")]
}

#[cfg(test)]
mod tests {
    //! Contract of the search for a dataset's files.

    use super::*;
    use crate::base::error::Error;
    use crate::data::dataset::{Dataset, DatasetError};
    use std::fs;

    /// Writes images and labels under the given names; pixels of image i are i, its label 10 − i.
    fn write(folder: &Path, images: &str, labels: &str, count: u8) {
        let pixels: Vec<u8> = (0..count).flat_map(|i| [i; 6]).collect();
        let values: Vec<u8> = (0..count).map(|i| 10 - i).collect();
        let count = u32::from(count);
        fs::write(
            folder.join(images),
            [idx::header(&[count, 2, 3]), pixels].concat(),
        )
        .unwrap();
        fs::write(
            folder.join(labels),
            [idx::header(&[count]), values].concat(),
        )
        .unwrap();
    }

    fn given(folder: &Path) -> Vec<DatasetPlace> {
        places(Some(folder), None, None)
    }

    fn failure(name: &str, folder: &Path, split: Split) -> String {
        Dataset::load(name, &given(folder), &[split])
            .unwrap_err()
            .to_string()
    }

    fn remedies_of(name: &str, folder: &Path, split: Split) -> Vec<Remedy> {
        Error::from(Dataset::load(name, &given(folder), &[split]).unwrap_err()).remedies
    }

    /// Returns the command that downloads a dataset into a folder.
    fn fetching(name: &str, folder: &Path) -> Invocation {
        Invocation::new("data fetch")
            .value(name)
            .option("to", folder)
    }

    #[test]
    fn standard_names_in_every_spelling_are_found() {
        for (images, labels, split) in [
            (
                "train-images-idx3-ubyte",
                "train-labels-idx1-ubyte",
                Split::Train,
            ),
            (
                "train-images.idx3-ubyte",
                "train-labels.idx1-ubyte.gz",
                Split::Train,
            ),
            (
                "t10k-images-idx3-ubyte.gz",
                "t10k-labels.idx1-ubyte",
                Split::Test,
            ),
            (
                "emnist-digits-test-images-idx3-ubyte.gz",
                "emnist-digits-test-labels-idx1-ubyte.gz",
                Split::Test,
            ),
        ] {
            let folder = tempfile::tempdir().unwrap();
            write(folder.path(), images, labels, 3);
            let data = Dataset::load("own", &given(folder.path()), &[split]).unwrap();
            assert_eq!(
                (data.len(split), data.label(split, 2).unwrap()),
                (3, 8),
                "{images}"
            );
            let [height, width] = if images.starts_with("emnist") {
                [3, 2]
            } else {
                [2, 3]
            };
            assert_eq!(
                data.image(split, 2).unwrap(),
                crate::base::Grid::filled(height, width, 2)
            );
            assert_eq!(data.indices_of(split, 9), [1]);
            assert_eq!(data.info().splits[&split].files[0].name, images);
        }
    }

    #[test]
    fn only_the_wanted_split_needs_its_files() {
        let folder = tempfile::tempdir().unwrap();
        write(
            folder.path(),
            "train-images-idx3-ubyte",
            "train-labels-idx1-ubyte",
            3,
        );
        assert!(Dataset::load("mnist", &given(folder.path()), &[Split::Train]).is_ok());
        let message = failure("mnist", folder.path(), Split::Test);
        let remedies = remedies_of("mnist", folder.path(), Split::Test);
        assert_eq!(
            remedies,
            [Remedy::Run(
                fetching("mnist", folder.path()),
                "downloads it"
            )]
        );
        for part in ["test images", "t10k-images-idx3-ubyte", "as given"] {
            assert!(message.contains(part), "{part}: {message}");
        }
        assert!(
            message.contains(folder.path().to_str().unwrap()),
            "{message}"
        );
    }

    #[test]
    fn the_first_given_place_is_used_and_has_to_work() {
        let (good, empty) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        write(
            good.path(),
            "train-images-idx3-ubyte",
            "train-labels-idx1-ubyte",
            3,
        );
        let both = places(
            Some(empty.path()),
            Some(good.path().into()),
            Some(good.path()),
        );
        let origins: Vec<&str> = both.iter().map(|p| p.origin.as_str()).collect();
        assert_eq!(origins, ["as given", "MORPHCOG_DATA", "[data] dir"]);
        assert!(Dataset::load("mnist", &both, &[Split::Train]).is_err());
        assert!(Dataset::load("mnist", &both[1..], &[Split::Train]).is_ok());
        assert!(places(None, Some(OsString::new()), None).is_empty());
        assert_eq!(choose("mnist", &[]).unwrap().path, Path::new("data/mnist"));
    }

    #[test]
    fn a_subfolder_with_the_datasets_name_comes_first() {
        let folder = tempfile::tempdir().unwrap();
        write(
            folder.path(),
            "train-images-idx3-ubyte",
            "train-labels-idx1-ubyte",
            3,
        );
        fs::create_dir(folder.path().join("own")).unwrap();
        write(
            &folder.path().join("own"),
            "train-images-idx3-ubyte",
            "train-labels-idx1-ubyte",
            5,
        );
        let load = |name| {
            Dataset::load(name, &given(folder.path()), &[Split::Train])
                .unwrap()
                .len(Split::Train)
        };
        assert_eq!((load("own"), load("mnist")), (5, 3));
    }

    #[test]
    fn broken_files_are_named_with_the_command_that_helps() {
        let folder = tempfile::tempdir().unwrap();
        write(
            folder.path(),
            "train-images-idx3-ubyte",
            "train-labels-idx1-ubyte",
            3,
        );
        let labels = folder.path().join("train-labels-idx1-ubyte");
        fs::write(&labels, [idx::header(&[2]), vec![1, 2]].concat()).unwrap();
        let message = failure("mnist", folder.path(), Split::Train);
        assert!(message.contains("holds 2 labels, expected 3"), "{message}");
        fs::write(&labels, [idx::header(&[3]), vec![1, 2]].concat()).unwrap();
        let message = failure("mnist", folder.path(), Split::Train);
        assert!(message.contains("too short"), "{message}");
        let again = fetching("mnist", folder.path()).switch("force", true);
        let remedies = remedies_of("mnist", folder.path(), Split::Train);
        assert_eq!(remedies, [Remedy::Run(again, "downloads it")]);
        let message = failure("my-letters", folder.path(), Split::Train);
        assert!(message.contains("too short"), "{message}");
        assert!(remedies_of("my-letters", folder.path(), Split::Train).contains(&Remedy::NameData));
    }

    #[test]
    fn what_could_be_several_datasets_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        for set in ["digits", "letters"] {
            let name = |content| format!("emnist-{set}-train-{content}-ubyte.gz");
            write(folder.path(), &name("images-idx3"), &name("labels-idx1"), 3);
        }
        let message = failure("emnist", folder.path(), Split::Train);
        assert!(
            message.contains("emnist-digits-train") && message.contains("emnist-letters-train"),
            "{message}"
        );
    }

    #[test]
    fn two_files_of_a_standard_name_are_one_only_if_they_hold_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let [plain, zipped] = ["", ".gz"].map(|end| format!("train-images-idx3-ubyte{end}"));
        write(folder.path(), &plain, "train-labels-idx1-ubyte", 3);
        let bytes = fs::read(folder.path().join(&plain)).unwrap();
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut packed, &bytes).unwrap();
        fs::write(folder.path().join(&zipped), packed.finish().unwrap()).unwrap();
        let data = Dataset::load("own", &given(folder.path()), &[Split::Train]).unwrap();
        assert_eq!(data.info().splits[&Split::Train].files[0].name, zipped);
        for other in [zipped.as_str(), "train-images.idx3-ubyte"] {
            write(folder.path(), other, "train-labels-idx1-ubyte", 3);
            let mut bytes = bytes.clone();
            *bytes.last_mut().unwrap() = 99;
            fs::write(folder.path().join(other), bytes).unwrap();
            let message = failure("own", folder.path(), Split::Train);
            assert!(
                message.contains(&plain) && message.contains(other),
                "{message}"
            );
            fs::remove_file(folder.path().join(other)).unwrap();
        }
        // A truncated copy is no copy.
        fs::write(folder.path().join(&zipped), [0x1f, 0x8b]).unwrap();
        let message = failure("own", folder.path(), Split::Train);
        assert!(
            message.contains("cannot be unpacked") && message.contains(&zipped),
            "{message}"
        );
    }

    #[test]
    fn names_in_capitals_are_those_in_small_letters() {
        let folder = tempfile::tempdir().unwrap();
        write(
            folder.path(),
            "TRAIN-IMAGES.IDX3-UBYTE",
            "Train-Labels-idx1-ubyte.GZ",
            3,
        );
        let data = Dataset::load("own", &given(folder.path()), &[Split::Train]).unwrap();
        assert_eq!(
            data.info().splits[&Split::Train].files[1].name,
            "Train-Labels-idx1-ubyte.GZ"
        );
    }

    #[test]
    #[cfg(unix)]
    fn a_link_that_leads_nowhere_is_broken_and_not_missing() {
        let folder = tempfile::tempdir().unwrap();
        write(
            folder.path(),
            "train-images-idx3-ubyte",
            "train-labels-idx1-ubyte",
            3,
        );
        let images = folder.path().join("train-images-idx3-ubyte");
        fs::rename(&images, folder.path().join("elsewhere")).unwrap();
        std::os::unix::fs::symlink("elsewhere", &images).unwrap();
        assert!(Dataset::load("own", &given(folder.path()), &[Split::Train]).is_ok());
        fs::remove_file(folder.path().join("elsewhere")).unwrap();
        let message = failure("own", folder.path(), Split::Train);
        let expected = format!("{}: cannot be read", images.display());
        assert!(
            message.starts_with(&expected) && message.contains("link to elsewhere"),
            "{message}"
        );
    }

    /// Writes a single image of two rows of three pixels, 0 to 5, and returns it as loaded.
    fn seen(dataset: &str, folder: &Path, prefix: &str, transpose: Option<bool>) -> Vec<Vec<u8>> {
        let name = |content| folder.join(format!("{prefix}train-{content}-ubyte"));
        let pixels = [idx::header(&[1, 2, 3]), (0..6).collect()].concat();
        fs::create_dir_all(folder).unwrap();
        fs::write(name("images-idx3"), pixels).unwrap();
        fs::write(name("labels-idx1"), [idx::header(&[1]), vec![7]].concat()).unwrap();
        let data = Dataset::oriented(dataset, &given(folder), &[Split::Train], transpose).unwrap();
        let image = data.image(Split::Train, 0).unwrap();
        (0..image.height())
            .map(|r| (0..image.width()).map(|c| image[(r, c)]).collect())
            .collect()
    }

    #[test]
    fn emnist_is_transposed_by_its_names_and_other_images_where_that_is_asked_for() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        let (stored, turned) = (
            vec![vec![0, 1, 2], vec![3, 4, 5]],
            vec![vec![0, 3], vec![1, 4], vec![2, 5]],
        );
        assert_eq!(seen("own", &at("a"), "emnist-letters-", None), turned);
        assert_eq!(seen("emnist-digits", &at("b"), "", None), turned);
        assert_eq!(seen("own", &at("EMNIST"), "", None), turned);
        assert_eq!(seen("own", &at("c"), "", None), stored);
        assert_eq!(seen("mnist", &at("EMNIST"), "", None), stored);
        // A similar name, whose images are upright.
        assert_eq!(seen("femnist", &at("d"), "femnist-", None), stored);
        assert_eq!(seen("own", &at("e"), "", Some(true)), turned);
        assert_eq!(
            seen("own", &at("f"), "emnist-letters-", Some(false)),
            stored
        );
    }

    #[test]
    fn a_transposed_dataset_has_the_fingerprint_of_the_images_as_they_are_seen() {
        let folder = tempfile::tempdir().unwrap();
        seen("own", folder.path(), "", None);
        let load = |transpose| {
            let data = Dataset::oriented("own", &given(folder.path()), &[Split::Train], transpose)
                .unwrap();
            data.info().splits[&Split::Train].clone()
        };
        let (stored, turned) = (load(None), load(Some(true)));
        assert_ne!(stored.fingerprint, turned.fingerprint);
        assert_eq!(
            (turned.height, turned.width, turned.files),
            (3, 2, stored.files)
        );
        assert!(turned.transposed && !stored.transposed);
    }

    #[test]
    fn names_that_are_paths_and_missing_folders_are_errors() {
        for name in ["../mnist", "", "a/b", ".hidden"] {
            let error = Dataset::load(name, &[], &[Split::Train]).unwrap_err();
            assert!(
                matches!(error, DatasetError::Files(FilesError::Name(_))),
                "{error}"
            );
        }
        let message = failure("fashion-mnist", Path::new("no/such/folder"), Split::Train);
        assert!(message.contains("no/such/folder"), "{message}");
        let missing = Path::new("no/such/folder");
        let remedies = remedies_of("fashion-mnist", missing, Split::Train);
        assert_eq!(
            remedies,
            [Remedy::Run(
                fetching("fashion-mnist", missing),
                "downloads it"
            )]
        );
    }

    #[test]
    fn the_fingerprint_is_that_of_the_unpacked_files_in_a_row() {
        let folder = tempfile::tempdir().unwrap();
        write(
            folder.path(),
            "train-images-idx3-ubyte",
            "train-labels-idx1-ubyte",
            3,
        );
        let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
        let both = [
            read("train-images-idx3-ubyte"),
            read("train-labels-idx1-ubyte"),
        ]
        .concat();
        let data = Dataset::load("own", &given(folder.path()), &[Split::Train]).unwrap();
        assert_eq!(
            data.fingerprint(Split::Train).unwrap(),
            crate::base::hash::sha256_hex(&both)
        );
    }
}
