//! [`Whereabouts`]: the folders of images. A run remembers its own in a file beside `run.json`.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::files::{home_expanded, write_atomically};
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::config::{BodyConfig, Config, DataConfig, reading};
use crate::data::dataset::{BUILTIN, Dataset, DatasetError, Split, is_drawn};
use crate::data::description::Description;
use crate::data::files;
use crate::data::files::{DatasetPlace, default_folder, places};
use crate::data::gates::Gates;
use crate::shipped::read_text;
use crate::store::folder::{IfExists, RunFolder};
use crate::store::images::{DatasetRef, ImageRef};
use crate::store::names::DATA_FOLDER;
use crate::task::class_names::ClassNames;
use crate::task::recording::{FramedImage, LabelledStimulus};
use crate::task::stimulus::{StimulusParams, stimulus};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

const FORMAT: (&str, u32) = ("morphcog-data-folder", 1);

#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DataFolder {
    format: String,
    format_version: u32,
    dataset: String,
    /// Folder with its files; users may write one relative to the run's folder.
    folder: PathBuf,
}

/// The folders in which images are looked for, in this order: that of the command line,
/// `MORPHCOG_DATA`, the one that a run remembers (if it still exists), the config's `[data] dir`,
/// and `data/<name>`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Whereabouts {
    data: Option<PathBuf>,
    /// Files that may name the folder of a run's images.
    remembered: Vec<PathBuf>,
    /// The first run.json given, for messages.
    run_json: Option<PathBuf>,
}

impl Whereabouts {
    /// Starts without a run; `data` is the folder from the command line.
    pub fn given(data: Option<&Path>) -> Self {
        Whereabouts {
            data: data.map(Path::to_path_buf),
            remembered: Vec::new(),
            run_json: None,
        }
    }

    /// Adds the folder that a run remembers, by its run.json or another file beside it.
    #[must_use]
    pub(crate) fn and_of(mut self, run_json: &Path) -> Self {
        self.remembered.push(run_json.with_file_name(DATA_FOLDER));
        self.run_json.get_or_insert_with(|| run_json.to_path_buf());
        self
    }

    /// Adds the folder of a run that is resumed; a run that is replaced does not count.
    #[must_use]
    pub(crate) fn and_of_resumed(self, if_exists: IfExists, run_json: &Path) -> Self {
        if if_exists == IfExists::Resume {
            self.and_of(run_json)
        } else {
            self
        }
    }

    /// Adds the run.json that needs the images to an error.
    pub(crate) fn asked_by(&self, error: Error) -> Error {
        match &self.run_json {
            Some(path) => error.in_place(&path.display().to_string()),
            None => error,
        }
    }

    /// Returns the names of a dataset's classes, those of the config first; no image is read.
    pub(crate) fn class_names(&self, config: &DataConfig) -> Result<ClassNames, Error> {
        if !config.class_names.is_empty() || config.dataset == BUILTIN {
            return Ok(ClassNames::of(&config.class_names));
        }
        if let Some(gates) = Gates::named(&config.dataset) {
            return Ok(ClassNames::of(&gates.class_names()));
        }
        let (given, _) = self.places(config)?;
        let place = files::choose(&config.dataset, &given).map_err(DatasetError::from)?;
        let described = Description::read(&place.path)?;
        Ok(described.map_or_else(ClassNames::default, |said| said.names()))
    }

    /// Returns the folders to look in, and the one that a run remembers if it is gone.
    fn places(
        &self,
        config: &DataConfig,
    ) -> Result<(Vec<DatasetPlace>, Option<DatasetPlace>), Error> {
        let mut given = places(
            self.data.as_deref(),
            std::env::var_os("MORPHCOG_DATA"),
            None,
        );
        let (there, gone) = match given.is_empty() {
            true => self.remembered(&config.dataset)?,
            false => (None, None),
        };
        given.extend(there);
        given.extend(places(None, None, config.dir.as_deref()));
        Ok((given, gone))
    }

    /// Loads the dataset of a section `[data]`; its classes have the config's names, or else the
    /// dataset's own.
    ///
    /// # Errors
    /// The error says what is missing or broken, where it was looked for, and what to do.
    pub fn load(&self, config: &DataConfig, wanted: &[Split]) -> Result<Dataset, Error> {
        if let Some(gates) = Gates::named(&config.dataset) {
            let images = Dataset::gates(gates, wanted);
            return Ok(images.called(&config.class_names));
        }
        if config.dataset == BUILTIN {
            let digits = Dataset::builtin(config.builtin.clone(), wanted)?;
            return Ok(digits.called(&config.class_names));
        }
        let (given, gone) = self.places(config)?;
        let loaded = Dataset::oriented(&config.dataset, &given, wanted, config.transpose);
        let loaded = loaded.map_err(|error| match gone {
            Some(gone) => Error::from(error)
                .advice(format!(
                    "the images of this run were in {gone}, which is not there any more"
                ))
                .remedy(Remedy::NameData),
            None => Error::from(error),
        })?;
        Ok(loaded.called(&config.class_names))
    }

    /// Loads the dataset whose training images have this SHA-256, since indices mean other images
    /// elsewhere. If only other splits are wanted, it is checked if its training images exist.
    pub(crate) fn load_of(
        &self,
        train_sha256: &str,
        config: &DataConfig,
        wanted: &[Split],
    ) -> Result<Dataset, Error> {
        let load = |config: &DataConfig| -> Result<(Dataset, bool), Error> {
            let loaded = self.load(config, wanted)?;
            let of_training = match loaded.fingerprint(Split::Train) {
                None => self
                    .load(config, &[Split::Train])
                    .ok()
                    .and_then(|set| set.fingerprint(Split::Train)),
                known => known,
            };
            let is_it = of_training.is_none_or(|found| found == train_sha256);
            Ok((loaded, is_it))
        };
        let (loaded, is_it) = load(config).map_err(|error| self.asked_by(error))?;
        if is_it {
            return Ok(loaded);
        }
        // File names may imply another orientation than when the run was made: the hash decides.
        if config.transpose.is_none() && loaded.folder().is_some() {
            let other = DataConfig {
                transpose: Some(!loaded.is_transposed()),
                ..config.clone()
            };
            if let Ok((loaded, true)) = load(&other) {
                return Ok(loaded);
            }
        }
        let text = format!(
            "{}: the training images here are not those the run was made with (another SHA-256)",
            loaded.place()
        );
        Err(self.asked_by(Error::input(text)).remedy(Remedy::NameData))
    }

    /// Returns the folder of the config, or else `data/<name>`, if images are looked for there.
    pub(crate) fn by_default(&self, config: &DataConfig) -> Option<PathBuf> {
        let is_known = self.data.is_some() || self.remembered(&config.dataset).ok()?.0.is_some();
        if is_drawn(&config.dataset) || is_known {
            return None;
        }
        let folder = config
            .dir
            .as_deref()
            .map_or_else(|| default_folder(&config.dataset), home_expanded);
        folder.is_dir().then_some(folder)
    }

    /// Returns a dataset's first remembered folder that still exists, and the first that does not.
    fn remembered(
        &self,
        dataset: &str,
    ) -> Result<(Option<DatasetPlace>, Option<DatasetPlace>), Error> {
        let mut gone = None;
        for path in self.remembered.iter().filter(|path| path.exists()) {
            let text = read_text(path).map_err(|error| Error::reading(path, &error))?;
            let name = path.display().to_string();
            let found: DataFolder = reading::read_versioned(&text, &name, FORMAT.0, FORMAT.1)
                .map_err(|error| error.advice("delete it").remedy(Remedy::NameData))?;
            if found.dataset != dataset {
                continue;
            }
            let folder = path
                .parent()
                .unwrap_or(Path::new(""))
                .join(home_expanded(&found.folder));
            let place = DatasetPlace {
                origin: name,
                path: folder,
            };
            match place.path.is_dir() {
                true => return Ok((Some(place), None)),
                false => _ = gone.get_or_insert(place),
            }
        }
        Ok((None, gone))
    }
}

/// Records the folder of a run's images, unless the program draws them.
pub(crate) fn remember(folder: &RunFolder, dataset: &Dataset) -> Result<(), Error> {
    let path = folder.path().join(DATA_FOLDER);
    let failed = |error: &std::io::Error| Error::writing(&path, error);
    let Some(source) = dataset.folder() else {
        return Ok(());
    };
    let absolute = std::path::absolute(source).map_err(|error| failed(&error))?;
    // JSON cannot hold a path that is not Unicode: the user names it with --data again.
    if absolute.to_str().is_none() {
        return Ok(());
    }
    let file = DataFolder {
        format: FORMAT.0.to_string(),
        format_version: FORMAT.1,
        dataset: dataset.name().to_string(),
        folder: absolute,
    };
    let text = serde_json::to_string(&file).expect("texts and a number are JSON") + "\n";
    write_atomically(&path, text.as_bytes()).map_err(|error| failed(&error))
}

/// Loads the dataset of a config; `data` is the folder from the command line.
///
/// # Errors
/// As [`Whereabouts::load`].
pub fn load_dataset(
    config: &Config,
    data: Option<&Path>,
    wanted: &[Split],
) -> Result<Dataset, Error> {
    Whereabouts::given(data).load(&config.data, wanted)
}

/// Loads the dataset that a run was made with, or, without a run, any. If only other splits are
/// wanted, it is checked by its training images if they exist.
pub(crate) fn load_dataset_of(
    run: Option<&DatasetRef>,
    config: &Config,
    data: &Whereabouts,
    wanted: &[Split],
) -> Result<Dataset, Error> {
    match run {
        None => data.load(&config.data, wanted),
        Some(run) => data.load_of(&run.train_sha256, &config.data, wanted),
    }
}

/// Reports that file names alone made images transposed, for users who stored them upright.
pub(crate) fn say_transposed(dataset: &Dataset, config: &DataConfig, session: &Session) {
    if config.transpose.is_none() && dataset.is_transposed() {
        session.observer.note(&format!(
            "{}: EMNIST stores its images mirrored and turned, so they are transposed; \
             data.transpose = false leaves them as they are",
            dataset.name()
        ));
    }
}

/// Returns a run's image size (height, width): the loaded dataset's, or that published as `name`.
pub(crate) fn size_of(data: &DatasetRef, name: &str, loaded: &Dataset) -> Option<[usize; 2]> {
    match loaded.fingerprint(Split::Train).as_ref() == Some(&data.train_sha256) {
        true => loaded.size(Split::Train),
        false => files::known_size(name),
    }
}

/// Warns if robots that see part of images get other sizes: margins are counted in pixels.
pub(crate) fn part_of_others(
    config: &Config,
    size: Option<[usize; 2]>,
    dataset: &Dataset,
    split: Split,
) -> Option<String> {
    let shown = dataset.size(split).filter(|shown| size != Some(*shown))?;
    if config.stimulus.margin.is_none() {
        return None;
    }
    let others = match size {
        Some([height, width]) => format!("images of {height} × {width} pixels"),
        None => "other images, perhaps of another size".to_string(),
    };
    let part = config.stimulus.part(shown);
    Some(format!(
        "the robots were made for {others}; of these they see {part}"
    ))
}

/// Returns an image as a robot of a config sees it.
///
/// # Errors
/// Returns an error if the image does not fit the body's size.
pub fn stimulus_of(
    config: &Config,
    dataset: &Dataset,
    split: Split,
    index: usize,
) -> Result<Grid<f64>, Error> {
    stimulus_for(&config.body, &config.stimulus, dataset, split, index)
}

/// Returns an image as a robot of a config sees it, for pictures.
pub(crate) fn labelled(
    config: &Config,
    dataset: &Dataset,
    split: Split,
    image: ImageRef,
) -> Result<LabelledStimulus, Error> {
    let pixels = dataset
        .image(split, image.index)
        .map_err(|error| Error::input(error.to_string()))?;
    Ok(LabelledStimulus {
        class: image.label,
        label: image.called(split, dataset.class_names()),
        stimulus: stimulus_of(config, dataset, split, image.index)?,
        image: FramedImage::of(&pixels, &config.stimulus),
    })
}

/// Returns several images as a robot of a config sees them, in their order.
pub(crate) fn stimuli_of(
    config: &Config,
    dataset: &Dataset,
    split: Split,
    images: &[ImageRef],
) -> Result<Vec<Grid<f64>>, Error> {
    images
        .iter()
        .map(|image| stimulus_of(config, dataset, split, image.index))
        .collect()
}

/// Returns an image as a robot of this size sees it.
pub(crate) fn stimulus_for(
    &BodyConfig { height, width, .. }: &BodyConfig,
    params: &StimulusParams,
    dataset: &Dataset,
    split: Split,
    index: usize,
) -> Result<Grid<f64>, Error> {
    let image = dataset
        .image(split, index)
        .map_err(|error| Error::input(error.to_string()))?;
    stimulus(&image, height, width, params)
        .map_err(|error| Error::input(format!("{}: {error}", error.key())))
}
