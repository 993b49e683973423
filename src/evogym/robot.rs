//! EvoGym's bodies.

use crate::base::Grid;
use crate::base::error::Error;
use crate::body::{Body, Material};

/// EvoGym's materials: the number of each is its place.
const MATERIALS: [Material; 5] = [
    Material::Empty,
    Material::Rigid,
    Material::Soft,
    Material::ActuatorHorizontal,
    Material::ActuatorVertical,
];

/// Makes a robot of EvoGym's numbers: 0 empty, 1 rigid, 2 soft, 3 horizontal and 4 vertical
/// actuator; row 0 on top.
///
/// # Errors
/// Returns an error if there is another number, no actuator, or more than one piece.
pub fn body(voxels: &Grid<u8>) -> Result<Body, Error> {
    let refused = |text: String| Error::usage(format!("body: {text}"));
    if let Some(code) = voxels.cells().iter().find(|code| **code > 4) {
        return Err(refused(format!(
            "expected EvoGym's voxels 0 to 4 (empty, rigid, soft, horizontal and vertical actuator), found {code}"
        )));
    }
    let material = |row, column| MATERIALS[usize::from(voxels[(row, column)])];
    let body = Body::new(Grid::from_fn(voxels.height(), voxels.width(), material));
    let body = body.map_err(|error| refused(error.to_string()))?;
    if actuators(&body).next().is_none() {
        let text = "expected at least one actuator (3 or 4), which a robot of EvoGym must have";
        return Err(refused(text.to_string()));
    }
    match body.is_connected() {
        true => Ok(body),
        false => Err(refused(
            "expected voxels that all hang together through their sides".to_string(),
        )),
    }
}

/// Returns the places of a body's actuators as indices of its flattened grid, in the order of
/// actions.
pub fn actuators(body: &Body) -> impl Iterator<Item = usize> + '_ {
    let cells = body.voxels().cells().iter().enumerate();
    cells
        .filter(|(_, material)| material.is_actuator())
        .map(|(place, _)| place)
}
