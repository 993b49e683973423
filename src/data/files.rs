//! Where the files of a dataset are looked for, and their loading.

use crate::base::hash::hex;
use crate::data::idx;
use crate::data::idx::{IdxError, IdxImages};
use crate::data::info::FileInfo;
use crate::data::info::Split;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Datasets that `morphcog data fetch` can download.
pub const FETCHABLE: [&str; 2] = ["mnist", "fashion-mnist"];

/// A folder in which someone says the data are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Who says so, as the user knows it: "--data", "MORPHCOG_DATA", `[data] dir`.
    pub origin: String,
    /// The folder. If it has a subfolder with the dataset's name, that is used, so one folder can hold several datasets.
    pub path: PathBuf,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} ({})", self.path.display(), self.origin)
    }
}

/// The places that were given, in order of precedence: the option `--data`, the environment variable `MORPHCOG_DATA`
/// (its value, empty counts as not set), and the config's `[data] dir`.
///
/// The first one is used and has to work: silently reading other data than the user named would be worse than an error.
pub fn places(option: Option<&Path>, environment: Option<OsString>, config: Option<&Path>) -> Vec<Place> {
    let environment = environment.filter(|value| !value.is_empty()).map(PathBuf::from);
    [
        ("--data", option.map(Path::to_path_buf)),
        ("MORPHCOG_DATA", environment),
        ("[data] dir", config.map(Path::to_path_buf)),
    ]
    .into_iter()
    .filter_map(|(origin, path)| Some(Place { origin: origin.to_string(), path: path? }))
    .collect()
}

/// Where a dataset is looked for if no place is given, and where it is downloaded to: `data/<name>`.
pub fn default_folder(name: &str) -> PathBuf {
    Path::new("data").join(name)
}

/// Why a dataset's files cannot be used. Every message says which file, where, what was expected and what to do.
#[derive(Debug, thiserror::Error)]
pub enum FilesError {
    /// A name that cannot be a folder's name.
    #[error(
        "\"{0}\" cannot be the name of a dataset: expected letters, digits, '-', '_' and '.'; \
         name the folder of your files with --data"
    )]
    Name(String),
    /// The folder cannot be listed.
    #[error("{dataset}: the folder {place} cannot be read: {source}; {advice}")]
    Folder {
        /// Name of the dataset.
        dataset: String,
        /// Where it was looked for.
        place: Box<Place>,
        /// What the system says.
        source: io::Error,
        /// What to do.
        advice: String,
    },
    /// A file is not there.
    #[error(
        "{dataset}: the {split} {content} are missing: expected {expected} (or with .gz, or a name ending so) \
         in {place}; {advice}"
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
        /// Where it was looked for.
        place: Box<Place>,
        /// What to do.
        advice: String,
    },
    /// Several files could be meant.
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
        /// Where it was looked for.
        place: Box<Place>,
        /// The files in question.
        found: Vec<String>,
    },
    /// A file is there but not what it should be.
    #[error("{source}; {advice}")]
    Broken {
        /// What is wrong with which file.
        source: IdxError,
        /// What to do.
        advice: String,
    },
    /// Images and labels do not belong together.
    #[error(
        "{}: holds {labels} labels, expected {images}, one for each image in {}; {advice}",
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
        /// What to do.
        advice: String,
    },
}

/// The images of one split as they were stored, and where they came from.
#[derive(Clone, Debug)]
pub(crate) struct StoredSplit {
    pub images: IdxImages,
    pub files: Vec<FileInfo>,
    pub fingerprint: String,
}

/// Whether a dataset can have a name: that of a folder.
///
/// # Errors
/// [`FilesError::Name`] if not.
pub fn check_name(name: &str) -> Result<(), FilesError> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    match name.is_empty() || name.starts_with('.') || !name.chars().all(allowed) {
        true => Err(FilesError::Name(name.to_string())),
        false => Ok(()),
    }
}

/// The place that is used: the first given one, or else the default; its path is the folder with the files.
pub(crate) fn choose(name: &str, given: &[Place]) -> Result<Place, FilesError> {
    check_name(name)?;
    Ok(match given.first() {
        Some(place) => {
            let own = place.path.join(name);
            let path = if own.is_dir() { own } else { place.path.clone() };
            Place { origin: place.origin.clone(), path }
        }
        None => Place { origin: "default".to_string(), path: default_folder(name) },
    })
}

/// The labels and images of one split.
pub(crate) fn load(name: &str, place: &Place, split: Split) -> Result<(Vec<u8>, StoredSplit), FilesError> {
    let broken =
        |source: IdxError| FilesError::Broken { advice: advice(name, place, !source.is_io()), source };
    let image_file = find(name, place, split, "images")?;
    let label_file = find(name, place, split, "labels")?;
    let images = idx::read_images(&image_file).map_err(broken)?;
    let labels = idx::read_labels(&label_file).map_err(broken)?;
    let (expected, found) = (images.content.count, labels.content.len());
    if expected != found {
        let advice = advice(name, place, true);
        return Err(FilesError::Count { label_file, labels: found, image_file, images: expected, advice });
    }
    let mut hash = Sha256::new();
    let sizes = [images.content.count, images.content.height, images.content.width].map(|n| n as u32);
    hash.update(idx::header(&sizes));
    hash.update(&images.content.pixels);
    hash.update(idx::header(&sizes[..1]));
    hash.update(&labels.content);
    let fingerprint = hex(&hash.finalize());
    let describe = |path: &Path, bytes, sha256: &str| FileInfo {
        name: path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
        bytes,
        sha256: sha256.to_string(),
    };
    let files = vec![
        describe(&image_file, images.bytes, &images.sha256),
        describe(&label_file, labels.bytes, &labels.sha256),
    ];
    Ok((labels.content, StoredSplit { images: images.content, files, fingerprint }))
}

/// The standard names (without .gz) of a split's images or labels, the most usual first.
fn standard_names(split: Split, content: &str) -> Vec<String> {
    let stems: &[&str] = match split {
        Split::Train => &["train"],
        Split::Test => &["t10k", "test"],
    };
    let kind = if content == "images" { "idx3" } else { "idx1" };
    let spelled = |stem: &&str| ["-", "."].map(|mark| format!("{stem}-{content}{mark}{kind}-ubyte"));
    stems.iter().flat_map(spelled).collect()
}

/// The file of a split's images or labels: one of a standard name, or else the only one whose name ends in one
/// (EMNIST's `emnist-digits-train-images-idx3-ubyte.gz`). The gzipped one of two that differ in .gz only.
fn find(name: &str, place: &Place, split: Split, content: &'static str) -> Result<PathBuf, FilesError> {
    let (dataset, searched) = (name.to_string(), Box::new(place.clone()));
    let present = match file_names(&place.path) {
        Ok(present) => present,
        Err(source) => {
            let advice = advice(name, place, false);
            return Err(FilesError::Folder { dataset, place: searched, source, advice });
        }
    };
    let bare = |file: &str| file.strip_suffix(".gz").unwrap_or(file).to_string();
    let bases: BTreeSet<String> = present.iter().map(|file| bare(file)).collect();
    let standard = standard_names(split, content);
    let ends_so = |base: &&String| standard.iter().any(|name| base.ends_with(name.as_str()));
    let found: Vec<String> = match standard.iter().find(|name| bases.contains(*name)) {
        Some(exact) => vec![exact.clone()],
        None => bases.iter().filter(ends_so).cloned().collect(),
    };
    match found.as_slice() {
        [] => {
            let (expected, advice) = (standard[0].clone(), advice(name, place, false));
            Err(FilesError::Missing { dataset, split, content, expected, place: searched, advice })
        }
        [base] => {
            let zipped = format!("{base}.gz");
            Ok(place.path.join(if present.contains(&zipped) { &zipped } else { base }))
        }
        _ => Err(FilesError::Ambiguous { dataset, split, content, place: searched, found }),
    }
}

fn file_names(folder: &Path) -> io::Result<BTreeSet<String>> {
    let mut names = BTreeSet::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.path().is_file() {
            names.extend(entry.file_name().into_string());
        }
    }
    Ok(names)
}

/// What to do about files that are missing or (`replace`) wrong.
fn advice(name: &str, place: &Place, replace: bool) -> String {
    if !FETCHABLE.contains(&name) {
        return "put its IDX files there or name their folder with --data; dataset \"builtin\" needs no files".to_string();
    }
    let to = match place.path == default_folder(name) {
        true => String::new(),
        false => format!(" --to {}", place.path.display()),
    };
    let force = if replace { " --force" } else { "" };
    format!("`morphcog data fetch {name}{to}{force}` downloads it")
}

#[cfg(test)]
#[path = "files_tests.rs"]
mod tests;
