//! Figures, and recordings of rollouts.

use crate::arrays::{body, seen};
use crate::config::{ConfigData, setting};
use crate::errors::{entered, raised, refused};
use crate::watch::watched;
use morphcog::base::error::Error;
use morphcog::draw::film::FilmOptions;
use morphcog::draw::gif;
use morphcog::draw::plot::Figure;
use morphcog::draw::walk::Walk;
use morphcog::draw::{html, raster};
use morphcog::task::protocol::Protocol;
use morphcog::task::recording::{LabelledStimulus, Recording};
use morphcog::task::rollout::{check_length, record_unless};
use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::sync::atomic::AtomicBool;

/// Width of pictures in a notebook \[pixels\].
const WIDTH: u32 = 480;

/// A figure; see `morphcog.Figure`.
#[pyclass(frozen, module = "morphcog._morphcog")]
pub(crate) struct FigureData {
    pub(crate) figure: Figure,
}

#[pymethods]
impl FigureData {
    #[getter]
    fn title(&self) -> &str {
        self.figure.title()
    }

    fn svg(&self) -> String {
        self.figure.svg()
    }

    /// Returns the text of an SVG file, whose words look the same everywhere.
    fn svg_file(&self) -> String {
        self.figure.outlined_svg()
    }

    fn pdf<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = self.figure.pdf().map_err(|error| raised(&error.into()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Returns the bytes of a PNG with so many pixels per inch, or as for print.
    #[pyo3(signature = (dpi))]
    fn png<'py>(&self, py: Python<'py>, dpi: Option<u32>) -> PyResult<Bound<'py, PyBytes>> {
        let drawn = py.detach(|| match dpi {
            Some(dpi) => self.figure.png(dpi),
            None => self.figure.print(),
        });
        let bytes = drawn.map_err(|error| raised(&error.into()))?;
        Ok(PyBytes::new(py, &bytes))
    }
}

/// A rollout for pictures; see `morphcog.Shown`.
#[pyclass(frozen, module = "morphcog._morphcog")]
pub(crate) struct RecordingData {
    recording: Recording,
    title: String,
    /// Description on a page: words and values.
    about: Vec<(String, String)>,
}

#[pymethods]
impl RecordingData {
    /// Records a body under each stimulus, in a fresh simulation each.
    #[new]
    #[pyo3(signature = (voxels, stimuli, control_steps, config))]
    fn recorded(
        py: Python,
        voxels: PyReadonlyArray2<u8>,
        stimuli: PyReadonlyArray3<f64>,
        control_steps: Option<u32>,
        config: Option<&ConfigData>,
    ) -> PyResult<Self> {
        let _environment = entered()?;
        let body = body(&voxels, "body")?;
        let (physics, protocol) = setting(config);
        let protocol = Protocol {
            control_steps: control_steps.unwrap_or(protocol.control_steps),
            ..protocol
        };
        let view = stimuli.as_array();
        let image = |number: usize| -> PyResult<LabelledStimulus> {
            let pixels = view.index_axis(numpy::ndarray::Axis(0), number);
            Ok(LabelledStimulus {
                class: 0,
                label: format!("image {number}"),
                image: None,
                stimulus: seen(pixels, &body)
                    .map_err(|error| refused(format!("image {number}: {}", error.value(py))))?,
            })
        };
        let images = (0..stimuli.shape()[0])
            .map(image)
            .collect::<PyResult<Vec<_>>>()?;
        check_length([body.height(), body.width()], &protocol, images.len())
            .map_err(|error| raised(&error))?;
        let recorded = watched(py, |stop| {
            record_unless("", &body, (&physics, &protocol), true, &images, stop)
        })?;
        let recording = recorded.map_err(|stopped| raised(&stopped.into()))?;
        Ok(RecordingData::new(recording))
    }

    /// Returns the displacement under each image; those after an unstable one are missing.
    #[getter]
    fn displacements(&self) -> Vec<f64> {
        let phases = self.recording.phases.iter();
        phases.map(|phase| phase.displacement).collect()
    }

    #[getter]
    fn unstable(&self) -> bool {
        self.recording.unstable
    }

    /// Returns a page for a browser.
    fn page(&self, py: Python) -> PyResult<String> {
        self.drawn(py, |_| {
            Ok(html::page(&self.recording, &self.title, &self.about)?)
        })
    }

    /// Returns a small page for a notebook.
    fn small_page(&self, py: Python) -> PyResult<String> {
        self.drawn(py, |_| {
            Ok(html::small_page(&self.recording, &self.title, &self.about)?)
        })
    }

    /// Returns the last moment as a GIF, which is smaller, or as a PNG.
    fn still<'py>(&self, py: Python<'py>, png: bool) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = self.drawn(py, |_| {
            let walk = Walk::new(&self.recording)?;
            let last = walk.frames() - 1;
            Ok(match png {
                true => raster::png(&walk, last, WIDTH)?,
                false => gif::still(&walk, last, WIDTH)?,
            })
        })?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Returns the animation as a GIF.
    fn gif<'py>(
        &self,
        py: Python<'py>,
        width: u32,
        every: usize,
        side_by_side: bool,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let mut options = FilmOptions::default();
        (options.width, options.every, options.side_by_side) = (width, every, side_by_side);
        let bytes = self.drawn(py, |stop| Ok(gif::encode(&self.recording, &options, stop)?))?;
        Ok(PyBytes::new(py, &bytes))
    }
}

impl RecordingData {
    pub(crate) fn new(recording: Recording) -> Self {
        RecordingData {
            recording,
            title: "morphcog".to_string(),
            about: Vec::new(),
        }
    }

    pub(crate) fn entitled(self, title: String, about: Vec<(String, String)>) -> Self {
        RecordingData {
            title,
            about,
            ..self
        }
    }

    fn drawn<T: Send>(
        &self,
        py: Python,
        draw: impl FnOnce(&AtomicBool) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        let _environment = entered()?;
        watched(py, draw)?.map_err(|error| raised(&error))
    }
}
