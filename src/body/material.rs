//! [`Material`]: what a voxel is made of.

use serde::{Deserialize, Serialize};

/// What a voxel is made of; the numbers are those of the paper and of all files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
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
}

impl Material {
    /// All materials, in the order of their numbers.
    pub const ALL: [Material; 7] = [
        Material::Empty,
        Material::Rigid,
        Material::Soft,
        Material::MuscleInPhase,
        Material::MuscleAntiphase,
        Material::SensorShrink,
        Material::SensorExpand,
    ];

    /// Its number, 0…6.
    pub fn code(self) -> u8 {
        self as u8
    }

    /// The material with a number, `None` above 6.
    pub fn from_code(code: u8) -> Option<Self> {
        Material::ALL.get(usize::from(code)).copied()
    }

    /// Whether there is no voxel.
    pub fn is_empty(self) -> bool {
        self == Material::Empty
    }

    /// Whether it oscillates ("active voxels" in the paper's descriptor).
    pub fn is_muscle(self) -> bool {
        matches!(self, Material::MuscleInPhase | Material::MuscleAntiphase)
    }

    /// Whether it follows a pixel.
    pub fn is_sensor(self) -> bool {
        matches!(self, Material::SensorShrink | Material::SensorExpand)
    }

    /// Whether its width is actuated: muscles and sensors.
    pub fn is_active(self) -> bool {
        self.is_muscle() || self.is_sensor()
    }

    /// Its name in pictures and tables.
    pub fn name(self) -> &'static str {
        match self {
            Material::Empty => "empty",
            Material::Rigid => "rigid",
            Material::Soft => "soft",
            Material::MuscleInPhase => "muscle, in phase",
            Material::MuscleAntiphase => "muscle, antiphase",
            Material::SensorShrink => "sensor, shrinks",
            Material::SensorExpand => "sensor, expands",
        }
    }
}

/// A number that is not a material's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} is not a material; expected 0…6 (0 empty, 1 rigid, 2 soft, 3 and 4 muscle, 5 and 6 sensor)")]
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
