//! Datasets and stimuli.

use crate::config::ConfigData;
use crate::errors::{entered, raised, refused, room};
use crate::watch::{Listener, heard, watched};
use morphcog::base::Grid;
use morphcog::base::error::Error;
use morphcog::commands::data::{self, ImportOptions, ImportSource};
use morphcog::config;
use morphcog::data::dataset::{Dataset, DatasetError, Split};
use morphcog::data::files::places;
use morphcog::data::import::arrays::{Array, LabelledArrays, Values};
use morphcog::data::import::{ClassLabel, Fit, InMemory};
use morphcog::task::stimulus::stimulus;
use numpy::{
    PyArray1, PyArray3, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// Images and labels.
type Labelled<'py> = (Bound<'py, PyArray3<u8>>, Bound<'py, PyArray1<u8>>);

/// Numbers or texts of any shape.
#[derive(FromPyObject)]
pub(crate) enum Given<'py> {
    Bools(PyReadonlyArrayDyn<'py, bool>),
    Bytes(PyReadonlyArrayDyn<'py, u8>),
    Whole(PyReadonlyArrayDyn<'py, i64>),
    Real(PyReadonlyArrayDyn<'py, f64>),
    Texts(Vec<String>),
}

impl Given<'_> {
    fn array(&self, name: &str) -> Array {
        let (shape, values) = match self {
            Given::Bools(array) => {
                let values = array
                    .as_array()
                    .iter()
                    .map(|value| u8::from(*value))
                    .collect();
                (array.shape().to_vec(), Values::Bools(values))
            }
            Given::Bytes(array) => {
                let values = array.as_array().iter().copied().collect();
                (array.shape().to_vec(), Values::Bytes(values))
            }
            Given::Whole(array) => {
                let values = array.as_array().iter().copied().collect();
                (array.shape().to_vec(), Values::Whole(values))
            }
            Given::Real(array) => {
                let values = array.as_array().iter().copied().collect();
                (array.shape().to_vec(), Values::Real(values))
            }
            Given::Texts(texts) => (vec![texts.len()], Values::Texts(texts.clone())),
        };
        Array {
            name: name.to_string(),
            shape,
            values,
        }
    }

    /// Returns each value as a class; fractions are none.
    fn classes(&self) -> PyResult<Vec<ClassLabel>> {
        let array = self.array("labels");
        let whole = |value: &f64| match value.fract() == 0.0 {
            true => Ok(ClassLabel::Number(*value as i64)),
            false => Err(refused(format!(
                "labels: expected whole numbers or texts, found {value}"
            ))),
        };
        let byte = |value: &u8| ClassLabel::Number((*value).into());
        match &array.values {
            Values::Bools(all) | Values::Bytes(all) => Ok(all.iter().map(byte).collect()),
            Values::Whole(all) => Ok(all.iter().copied().map(ClassLabel::Number).collect()),
            Values::Real(all) => all.iter().map(whole).collect(),
            Values::Texts(all) => Ok(all.iter().cloned().map(ClassLabel::Name).collect()),
        }
    }
}

/// Images of a dataset to be, and their labels.
#[derive(FromPyObject)]
pub(crate) enum GivenImages<'py> {
    Array(Given<'py>),
    /// Grey pictures of any size.
    Pictures(Vec<PyReadonlyArray2<'py, u8>>),
}

/// Images with labels of one split; the first is for training if there is a second.
type GivenSplit<'py> = (GivenImages<'py>, Given<'py>);

fn import_source(paths: Vec<PathBuf>, splits: &[GivenSplit]) -> PyResult<ImportSource> {
    let mut arrays = Vec::new();
    let mut pictures = Vec::new();
    for ((images, labels), (split, prefix)) in splits
        .iter()
        .zip([(Split::Train, ""), (Split::Test, "test_")])
    {
        let split = (splits.len() > 1).then_some(split);
        match images {
            GivenImages::Array(images) => arrays.push(LabelledArrays {
                images: images.array(&format!("{prefix}pixels")),
                labels: labels.array(&format!("{prefix}labels")),
                split,
            }),
            GivenImages::Pictures(images) => {
                let classes = labels.classes()?;
                if classes.len() != images.len() {
                    return Err(refused(format!(
                        "{prefix}labels: has {} labels, expected {}, one for each picture",
                        classes.len(),
                        images.len()
                    )));
                }
                pictures.extend(images.iter().zip(classes).map(|(image, class)| {
                    let view = image.as_array();
                    let (height, width) = view.dim();
                    let pixels = Grid::from_fn(height, width, |row, column| view[(row, column)]);
                    InMemory {
                        pixels,
                        class,
                        split,
                    }
                }));
            }
        }
    }
    match (arrays.is_empty(), pictures.is_empty()) {
        (true, true) => Ok(ImportSource::Paths(paths)),
        (false, true) => Ok(ImportSource::Arrays(arrays)),
        (true, false) => Ok(ImportSource::Pictures(pictures)),
        (false, false) => Err(refused(
            "test_pixels: expected an array or a list of pictures, as pixels",
        )),
    }
}

/// Makes a dataset, and returns what was made as JSON; see `morphcog.import_dataset`.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn import_dataset(
    py: Python,
    paths: Vec<PathBuf>,
    splits: Vec<GivenSplit>,
    name: String,
    to: Option<PathBuf>,
    test: f64,
    seed: u64,
    size: usize,
    fit: &str,
    choices: [Option<bool>; 2],
    force: bool,
    listener: &Bound<PyAny>,
) -> PyResult<(PathBuf, String)> {
    let _environment = entered()?;
    let source = import_source(paths, &splits)?;
    let fit = match fit {
        "auto" => Fit::Auto,
        "whole" => Fit::Whole,
        "content" => Fit::Content,
        "keep" => Fit::Keep,
        other => {
            return Err(refused(format!(
                "fit={other:?}: expected \"auto\", \"whole\", \"content\" or \"keep\""
            )));
        }
    };
    let [invert, transpose] = choices;
    let options = ImportOptions {
        name,
        to,
        test,
        seed,
        size,
        fit,
        invert,
        transpose,
        force,
    };
    let listener = Listener {
        function: listener,
        waits: false,
    };
    let made = heard(py, &listener, (None, None), |session| {
        data::import(source, &options, session)
    })?;
    let json = serde_json::to_string(&made).expect("names and numbers are JSON");
    Ok((made.folder, json))
}

/// Returns images as sensors see them; see `morphcog.stimuli`.
#[pyfunction]
pub(crate) fn stimuli<'py>(
    py: Python<'py>,
    images: PyReadonlyArray3<u8>,
    config: &ConfigData,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let _environment = entered()?;
    let config::BodyConfig { height, width, .. } = config.inner.body;
    let view = images.as_array();
    let (count, tall, wide) = view.dim();
    let seen = |number: usize| {
        let image = view.index_axis(numpy::ndarray::Axis(0), number);
        let image = Grid::from_fn(tall, wide, |row, column| image[(row, column)]);
        stimulus(&image, height, width, &config.inner.stimulus)
            .map_err(|error| refused(format!("{}: {error}", error.key())))
    };
    let all = watched(py, |stop| -> PyResult<Vec<f64>> {
        // Images that cannot be seen must be refused before memory is taken for all.
        if count > 0 {
            seen(0)?;
        }
        let mut all = room(count.checked_mul(height * width), "the stimuli")?;
        for number in (0..count).take_while(|_| !stop.load(Ordering::Relaxed)) {
            all.extend_from_slice(seen(number)?.cells());
        }
        Ok(all)
    })??;
    let array = numpy::ndarray::Array3::from_shape_vec((count, height, width), all)
        .expect("as many as said");
    Ok(PyArray3::from_owned_array(py, array))
}

/// Returns images and labels of a dataset; see `morphcog.images`.
#[pyfunction]
pub(crate) fn images<'py>(
    py: Python<'py>,
    dataset: &str,
    split: &str,
    data: Option<PathBuf>,
) -> PyResult<Labelled<'py>> {
    let _environment = entered()?;
    let split = match split {
        "train" => Split::Train,
        "test" => Split::Test,
        other => {
            return Err(refused(format!(
                "split={other:?}: expected \"train\" or \"test\""
            )));
        }
    };
    let places = places(data.as_deref(), std::env::var_os("MORPHCOG_DATA"), None);
    let failed = |error: DatasetError| raised(&Error::from(error));
    let (pixels, labels, [height, width]) = watched(py, |stop| -> PyResult<_> {
        let loaded = Dataset::load(dataset, &places, &[split]).map_err(failed)?;
        let count = loaded.len(split);
        let (mut pixels, mut labels, mut size) =
            (Vec::new(), room(Some(count), "the labels")?, [0, 0]);
        for index in (0..count).take_while(|_| !stop.load(Ordering::Relaxed)) {
            let image = loaded.image(split, index).map_err(failed)?;
            if index == 0 {
                size = [image.height(), image.width()];
                pixels = room(image.area().checked_mul(count), "the images")?;
            }
            pixels.extend_from_slice(image.cells());
            labels.push(loaded.label(split, index).map_err(failed)?);
        }
        Ok((pixels, labels, size))
    })??;
    let pixels = numpy::ndarray::Array3::from_shape_vec((labels.len(), height, width), pixels);
    Ok((
        PyArray3::from_owned_array(py, pixels.expect("images of one size")),
        PyArray1::from_vec(py, labels),
    ))
}
