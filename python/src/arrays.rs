//! Bodies and stimuli as arrays.

use crate::errors::{refused, room};
use morphcog::base::Grid;
use morphcog::body::{Body, Material};
use numpy::{PyArray2, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// Makes a body from an array of materials; errors begin with `what`.
pub(crate) fn body(voxels: &PyReadonlyArray2<u8>, what: &str) -> PyResult<Body> {
    let view = voxels.as_array();
    let (height, width) = view.dim();
    let mut cells = Vec::with_capacity(height * width);
    for &code in view {
        cells.push(Material::try_from(code).map_err(|error| refused(format!("{what}: {error}")))?);
    }
    let grid = Grid::from_fn(height, width, |row, column| cells[row * width + column]);
    let body = Body::new(grid).map_err(|error| refused(format!("{what}: {error}")))?;
    match body.is_connected() {
        true => Ok(body),
        false => Err(refused(format!(
            "{what}: expected at least one voxel, and voxels that all hang together through their sides"
        ))),
    }
}

pub(crate) fn array<'py>(py: Python<'py>, body: &Body) -> Bound<'py, PyArray2<u8>> {
    let (height, width) = (body.height(), body.width());
    let codes: Vec<u8> = body
        .voxels()
        .cells()
        .iter()
        .map(|material| material.code())
        .collect();
    PyArray2::from_owned_array(
        py,
        numpy::ndarray::Array2::from_shape_vec((height, width), codes).expect("as many"),
    )
}

/// Makes a stimulus from an array in [0, 1] of a body's size.
pub(crate) fn seen(pixels: numpy::ndarray::ArrayView2<f64>, body: &Body) -> PyResult<Grid<f64>> {
    let (height, width) = pixels.dim();
    if (height, width) != (body.height(), body.width()) {
        return Err(refused(format!(
            "stimulus: expected {} × {} pixels, as the body has places, found {height} × {width}",
            body.height(),
            body.width()
        )));
    }
    if let Some(pixel) = pixels.iter().find(|pixel| !(0.0..=1.0).contains(*pixel)) {
        return Err(refused(format!(
            "stimulus: expected pixels from 0 to 1, found {pixel}"
        )));
    }
    Ok(Grid::from_fn(height, width, |row, column| {
        pixels[(row, column)]
    }))
}

/// Makes bodies of one size and the stimuli of their size; errors name the body and the image.
pub(crate) fn bodies_and_images(
    py: Python,
    bodies: &[PyReadonlyArray2<u8>],
    stimuli: &PyReadonlyArray3<f64>,
) -> PyResult<(Vec<Body>, Vec<Grid<f64>>)> {
    let bodies = bodies
        .iter()
        .enumerate()
        .map(|(number, voxels)| body(voxels, &format!("body {number}")))
        .collect::<PyResult<Vec<Body>>>()?;
    let view = stimuli.as_array();
    let seen_by = |number: usize, place: usize| {
        let pixels = view.index_axis(numpy::ndarray::Axis(0), number);
        seen(pixels, &bodies[place])
            .map_err(|error| refused(format!("image {number}, body {place}: {}", error.value(py))))
    };
    let shown = stimuli.shape()[0];
    // All bodies must have one size, as the stimuli of the first are used for all.
    let size = |body: &Body| (body.height(), body.width());
    if let Some(place) = bodies
        .iter()
        .position(|body| size(body) != size(&bodies[0]))
        && shown > 0
    {
        seen_by(0, 0)?;
        seen_by(0, place)?;
    }
    let shown_to_any = if bodies.is_empty() { 0 } else { shown };
    if shown_to_any > 0 {
        seen_by(0, 0)?;
    }
    // Tried as a whole, since a lack of memory for single images could not be reported.
    drop(room::<(Grid<f64>, f64)>(Some(shown_to_any), "the stimuli")?);
    drop(room::<f64>(Some(stimuli.len()), "the stimuli")?);
    let images = (0..shown_to_any)
        .map(|number| seen_by(number, 0))
        .collect::<PyResult<Vec<Grid<f64>>>>()?;
    Ok((bodies, images))
}
