//! [`Body`]: a grid of voxels, each of a [`Material`].

use crate::grid::{Grid, GridError};
use std::fmt;
use std::str::FromStr;

/// The material of a voxel; files hold its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "u8", into = "u8"))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema), schemars(extend("maximum" = 8)))]
#[repr(u8)]
pub enum Material {
    /// No voxel.
    Empty = 0,
    /// Passive and stiff.
    Rigid = 1,
    /// Passive and soft.
    Soft = 2,
    /// Oscillates in width with phase 0.
    MuscleInPhase = 3,
    /// Oscillates in width with phase π.
    MuscleAntiphase = 4,
    /// Sensor that gets narrower with its pixel's intensity.
    SensorShrink = 5,
    /// Sensor that gets wider with its pixel's intensity.
    SensorExpand = 6,
    /// Actuator of EvoGym's robots: takes the width that it is given at every control step.
    ActuatorHorizontal = 7,
    /// Actuator of EvoGym's robots: takes the height that it is given at every control step.
    ActuatorVertical = 8,
}

impl Material {
    /// The materials that evolve, in the order of their numbers: all but actuators.
    pub const ALL: [Material; 7] = [
        Material::Empty,
        Material::Rigid,
        Material::Soft,
        Material::MuscleInPhase,
        Material::MuscleAntiphase,
        Material::SensorShrink,
        Material::SensorExpand,
    ];

    /// The materials that are given their size at every control step
    /// ([`World::set_targets`](crate::World::set_targets)).
    pub const ACTUATORS: [Material; 2] = [Material::ActuatorHorizontal, Material::ActuatorVertical];

    /// Returns its number, 0…8.
    pub fn code(self) -> u8 {
        self as u8
    }

    /// Returns the material with a number, `None` above 8.
    pub fn from_code(code: u8) -> Option<Self> {
        let mut all = Material::ALL.into_iter().chain(Material::ACTUATORS);
        all.nth(usize::from(code))
    }

    /// Returns true if there is no voxel.
    pub fn is_empty(self) -> bool {
        self == Material::Empty
    }

    /// Returns true if it oscillates.
    pub fn is_muscle(self) -> bool {
        matches!(self, Material::MuscleInPhase | Material::MuscleAntiphase)
    }

    /// Returns true if it follows a pixel.
    pub fn is_sensor(self) -> bool {
        matches!(self, Material::SensorShrink | Material::SensorExpand)
    }

    /// Returns true if it is given its size at every control step.
    pub fn is_actuator(self) -> bool {
        Material::ACTUATORS.contains(&self)
    }

    /// Returns true if its width or height is actuated: muscles, sensors and actuators.
    pub fn is_active(self) -> bool {
        self.is_muscle() || self.is_sensor() || self.is_actuator()
    }

    /// Returns its name in pictures and tables.
    pub fn name(self) -> &'static str {
        match self {
            Material::Empty => "empty",
            Material::Rigid => "rigid",
            Material::Soft => "soft",
            Material::MuscleInPhase => "muscle, in phase",
            Material::MuscleAntiphase => "muscle, antiphase",
            Material::SensorShrink => "sensor, shrinks",
            Material::SensorExpand => "sensor, expands",
            Material::ActuatorHorizontal => "actuator, horizontal",
            Material::ActuatorVertical => "actuator, vertical",
        }
    }
}

/// A number that belongs to no material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0} is not a material; expected 0…8 (0 empty, 1 rigid, 2 soft, 3 and 4 muscle, 5 and 6 sensor, 7 and 8 actuator)"
)]
pub struct UnknownMaterial(pub u8);

impl TryFrom<u8> for Material {
    type Error = UnknownMaterial;
    fn try_from(code: u8) -> Result<Self, UnknownMaterial> {
        Material::from_code(code).ok_or(UnknownMaterial(code))
    }
}

impl From<Material> for u8 {
    fn from(material: Material) -> u8 {
        material.code()
    }
}

/// Largest height and width of a body in voxels.
pub const MAX_SIDE: usize = 64;

/// A robot's body: H × W voxels, row 0 on top. Empty rows and columns count: pixel (row, column) of
/// a stimulus drives voxel (row, column). In files: rows of numbers 0…8 (see [`Material`]).
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(try_from = "Grid<Material>", into = "Grid<Material>")
)]
#[cfg_attr(
    feature = "schemars",
    derive(schemars::JsonSchema),
    schemars(with = "Vec<Vec<Material>>")
)]
pub struct Body(Grid<Material>);

/// Numbers of voxels of a body, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
pub struct VoxelCounts {
    /// Muscle voxels, both phases.
    pub muscle: usize,
    /// Sensor voxels, both kinds.
    pub sensor: usize,
    /// Voxels that are not empty.
    pub total: usize,
}

/// The reason why voxels do not form a body.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BodyError {
    /// The rows do not form a grid.
    #[error("a body is a list of rows of equal length: {0}")]
    Shape(#[from] GridError),
    /// The body is larger than [`MAX_SIDE`] on a side.
    #[error("the body is {height} × {width} voxels, at most {MAX_SIDE} × {MAX_SIDE} are possible")]
    TooLarge {
        /// Rows found.
        height: usize,
        /// Columns found.
        width: usize,
    },
    /// A character of the text form is not a digit 0…8.
    #[error(
        "row {row}, column {column}: '{found}' is not a voxel; expected a digit 0…8 (or '.' for empty)"
    )]
    Voxel {
        /// Row from the top, from 0.
        row: usize,
        /// Column from the left, from 0.
        column: usize,
        /// The character found there.
        found: char,
    },
}

impl Body {
    /// Makes a body from its voxels.
    ///
    /// # Errors
    /// Returns [`BodyError::TooLarge`] above [`MAX_SIDE`] rows or columns.
    pub fn new(voxels: Grid<Material>) -> Result<Self, BodyError> {
        let (height, width) = (voxels.height(), voxels.width());
        if height > MAX_SIDE || width > MAX_SIDE {
            return Err(BodyError::TooLarge { height, width });
        }
        Ok(Body(voxels))
    }

    /// Returns the voxels, row 0 on top.
    pub fn voxels(&self) -> &Grid<Material> {
        &self.0
    }

    /// Returns the number of rows, empty ones included.
    pub fn height(&self) -> usize {
        self.0.height()
    }

    /// Returns the number of columns, empty ones included.
    pub fn width(&self) -> usize {
        self.0.width()
    }

    /// Returns the material at (row, column); outside the grid all is empty.
    pub fn at(&self, row: isize, column: isize) -> Material {
        self.0.get(row, column).copied().unwrap_or(Material::Empty)
    }

    /// Counts muscle, sensor and non-empty voxels.
    pub fn counts(&self) -> VoxelCounts {
        let count = |kind: fn(&Material) -> bool| self.0.cells().iter().filter(|m| kind(m)).count();
        VoxelCounts {
            muscle: count(|m| m.is_muscle()),
            sensor: count(|m| m.is_sensor()),
            total: count(|m| !m.is_empty()),
        }
    }

    /// Returns true if there is a voxel and all voxels are connected through their sides.
    pub fn is_connected(&self) -> bool {
        let Some((start, _)) = self.0.iter().find(|(_, m)| !m.is_empty()) else {
            return false;
        };
        let mut reached = Grid::filled(self.height(), self.width(), false);
        let mut open = vec![start];
        reached[start] = true;
        let mut count = 0;
        while let Some((r, c)) = open.pop() {
            count += 1;
            for (dr, dc) in [(0, 1), (1, 0), (0, -1), (-1, 0)] {
                let (row, column) = (r as isize + dr, c as isize + dc);
                if !self.at(row, column).is_empty() {
                    let next = (row as usize, column as usize);
                    if !std::mem::replace(&mut reached[next], true) {
                        open.push(next);
                    }
                }
            }
        }
        count == self.counts().total
    }

    /// Returns true if the body is connected and has at least `min_muscles` muscle voxels.
    pub fn is_valid(&self, min_muscles: usize) -> bool {
        self.counts().muscle >= min_muscles && self.is_connected()
    }

    /// Replaces every soft voxel and every sensor by an expanding sensor, so that a simulation
    /// shows the effect of each of those places when its voxel grows.
    pub fn probe(&self) -> Self {
        let is_place = |material: Material| material == Material::Soft || material.is_sensor();
        Body(self.0.map(|&material| {
            if is_place(material) {
                Material::SensorExpand
            } else {
                material
            }
        }))
    }

    /// Returns the body mirrored left to right.
    pub fn mirrored(&self) -> Self {
        Body(self.0.mirrored())
    }
}

impl TryFrom<Grid<Material>> for Body {
    type Error = BodyError;
    fn try_from(voxels: Grid<Material>) -> Result<Self, BodyError> {
        Body::new(voxels)
    }
}

impl From<Body> for Grid<Material> {
    fn from(body: Body) -> Self {
        body.0
    }
}

/// Writes the text form: one line of digits 0…8 per row.
impl fmt::Display for Body {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, row) in self.0.rows().enumerate() {
            if i > 0 {
                f.write_str("\n")?;
            }
            row.iter().try_for_each(|m| write!(f, "{}", m.code()))?;
        }
        Ok(())
    }
}

/// Reads the text form; lines may be separated by newlines or `/`, and `.` means empty.
impl FromStr for Body {
    type Err = BodyError;
    fn from_str(text: &str) -> Result<Self, BodyError> {
        let mut rows = Vec::new();
        for (row, line) in text.trim().split(['\n', '/']).enumerate() {
            let cells = line.trim().chars().enumerate().map(|(column, found)| {
                let digit = if found == '.' {
                    Some(0)
                } else {
                    found.to_digit(10)
                };
                digit
                    .and_then(|d| Material::from_code(d as u8))
                    .ok_or(BodyError::Voxel { row, column, found })
            });
            rows.push(cells.collect::<Result<Vec<_>, _>>()?);
        }
        Body::new(Grid::from_rows(rows)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(text: &str) -> Body {
        text.parse().unwrap()
    }

    #[test]
    fn text_form_goes_there_and_back() {
        let b = body("0123\n4560");
        assert_eq!(b.to_string(), "0123\n4560");
        assert_eq!(body(".123/456."), b);
    }

    #[cfg(feature = "serde")]
    #[test]
    fn json_is_a_list_of_rows_of_numbers() {
        let b = body("0123\n4560");
        assert_eq!(serde_json::to_string(&b).unwrap(), "[[0,1,2,3],[4,5,6,0]]");
        assert_eq!(
            serde_json::from_str::<Body>("[[0,1,2,3],[4,5,6,0]]").unwrap(),
            b
        );
        let error = serde_json::from_str::<Body>("[[0,9]]")
            .unwrap_err()
            .to_string();
        assert!(error.contains('9') && error.contains("0…8"), "{error}");
    }

    #[test]
    fn what_is_not_a_body_is_refused_with_its_place() {
        let error = "012\n098".parse::<Body>().unwrap_err();
        assert_eq!(
            error,
            BodyError::Voxel {
                row: 1,
                column: 1,
                found: '9'
            }
        );
        assert!(matches!("01\n0".parse::<Body>(), Err(BodyError::Shape(_))));
        let row = "2".repeat(65);
        assert!(matches!(
            row.parse::<Body>(),
            Err(BodyError::TooLarge {
                height: 1,
                width: 65
            })
        ));
    }

    #[test]
    fn connected_means_through_sides() {
        assert!(body("11\n01").is_connected());
        assert!(!body("10\n01").is_connected());
        assert!(!body("00\n00").is_connected());
        assert!(body("111\n101\n111").is_connected());
    }

    #[test]
    fn valid_bodies_have_enough_muscles() {
        assert!(body("343").is_valid(3));
        assert!(!body("341").is_valid(3));
        assert!(!body("33.4").is_valid(3));
    }

    #[test]
    fn voxels_are_counted_by_kind() {
        let b = body("0123456");
        assert_eq!(
            b.counts(),
            VoxelCounts {
                muscle: 2,
                sensor: 2,
                total: 6
            }
        );
    }
}
