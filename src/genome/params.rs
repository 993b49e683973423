//! [`MutationParams`]: sizes and shares of mutations.

use crate::body::Material;
use serde::{Deserialize, Deserializer, Serialize};

/// Sizes of mutations: section `[genome]` of a config (paper, section "Genome").
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MutationParams {
    /// Standard deviation of what is added to a weight that changes. Default 0.5.
    #[serde(deserialize_with = "size")]
    pub weight_sigma: f64,
    /// A changed weight is clipped to [−limit, limit]. Default 1.
    #[serde(deserialize_with = "size")]
    pub weight_limit: f64,
    /// Size of the weight of an added edge; its sign is random. Default 0.1.
    #[serde(deserialize_with = "size")]
    pub new_edge_weight: f64,
    /// Share of offspring of which one voxel is mutated instead of the network ([`Edits`](super::Edits)). Default 0, as in
    /// the paper; then left out of files.
    #[serde(deserialize_with = "share", skip_serializing_if = "is_zero")]
    pub voxel_mutations: f64,
    /// Most voxel mutations that are drawn for one offspring; how many is drawn, too, from one up to this. It gets the one that
    /// promises most. Default 1; then left out of files.
    #[serde(deserialize_with = "candidates", skip_serializing_if = "is_one")]
    pub voxel_candidates: u16,
    /// Most voxels of an offspring that change: one, two, four and so on, doubled up to this, of as many offspring each; with
    /// several candidates, as long as each promises more than the one before. Default 1; then left out of files.
    #[serde(deserialize_with = "candidates", skip_serializing_if = "is_one")]
    pub voxel_changes: u16,
    /// Most relatives, of other bodies with the same gait, whose lives tell what the candidates promise besides the parent's own.
    /// Default 0; then left out of files.
    #[serde(deserialize_with = "relatives", skip_serializing_if = "is_none")]
    pub voxel_relatives: u16,
    /// Which voxels may change. Default all; then left out of files.
    #[serde(skip_serializing_if = "VoxelScope::is_all")]
    pub voxel_scope: VoxelScope,
}

/// Which voxels mutations of single voxels may change, and into what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum VoxelScope {
    /// Any into any other.
    #[default]
    All,
    /// Soft voxels and sensors into one another: what walks stays as it is, and what changes is how it goes with the pixels. A
    /// body that has none of them has its network mutated.
    Sensors,
}

impl VoxelScope {
    fn is_all(&self) -> bool {
        *self == VoxelScope::All
    }

    /// Whether voxels of a material may change, and others become of it.
    pub(super) fn contains(self, material: Material) -> bool {
        self == VoxelScope::All || material.is_sensor() || material == Material::Soft
    }
}

impl Default for MutationParams {
    fn default() -> Self {
        MutationParams {
            weight_sigma: 0.5,
            weight_limit: 1.0,
            new_edge_weight: 0.1,
            voxel_mutations: 0.0,
            voxel_candidates: 1,
            voxel_changes: 1,
            voxel_relatives: 0,
            voxel_scope: VoxelScope::All,
        }
    }
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn is_none(value: &u16) -> bool {
    *value == 0
}

fn is_one(value: &u16) -> bool {
    *value == 1
}

/// Most candidates that make sense: on 14 × 14 voxels, there are 1176 mutations of one.
pub const MAX_CANDIDATES: u16 = 1000;

/// Most relatives: fitting a model to the lives of more takes longer than a life.
pub const MAX_RELATIVES: u16 = 100;

fn candidates<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u16, D::Error> {
    number(deserializer, 1, MAX_CANDIDATES)
}

fn relatives<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u16, D::Error> {
    number(deserializer, 0, MAX_RELATIVES)
}

fn number<'de, D: Deserializer<'de>>(deserializer: D, least: u16, most: u16) -> Result<u16, D::Error> {
    let value = u16::deserialize(deserializer)?;
    if (least..=most).contains(&value) {
        return Ok(value);
    }
    let text = format!("{value} is out of range; expected a number from {least} to {most}");
    Err(serde::de::Error::custom(text))
}

/// A number from 0 to 1.
fn share<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let value = f64::deserialize(deserializer)?;
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    Err(serde::de::Error::custom(format!("{value} is out of range; expected a number from 0 to 1")))
}

fn size<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let value = f64::deserialize(deserializer)?;
    if value > 0.0 && value <= 1000.0 {
        return Ok(value);
    }
    Err(serde::de::Error::custom(format!("{value} is out of range; expected a number above 0, at most 1000")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_have_the_papers_defaults_and_refuse_nonsense() {
        let read = |text: &str| serde_json::from_str::<MutationParams>(text).map_err(|e| e.to_string());
        assert_eq!(read("{}").unwrap(), MutationParams::default());
        assert_eq!(read(r#"{"weight_sigma": 0.2}"#).unwrap().weight_sigma, 0.2);
        assert!(read(r#"{"weight_sigma": -1}"#).unwrap_err().contains("-1 is out of range"));
        assert!(read(r#"{"voxel_mutations": 1.01}"#).unwrap_err().contains("1.01 is out of range"));
        assert!(
            read(r#"{"voxel_candidates": 0}"#)
                .unwrap_err()
                .contains("0 is out of range; expected a number from 1 to 1000")
        );
        assert!(read(r#"{"voxel_changes": 1001}"#).unwrap_err().contains("1001 is out of range"));
        assert!(read(r#"{"voxel_relatives": 101}"#).unwrap_err().contains("expected a number from 0 to 100"));
        assert_eq!(read(r#"{"voxel_scope": "sensors"}"#).unwrap().voxel_scope, VoxelScope::Sensors);
        assert!(read(r#"{"voxel_scope": "some"}"#).unwrap_err().contains("`all` or `sensors`"));
        assert!(!serde_json::to_string(&MutationParams::default()).unwrap().contains("voxel"));
        assert!(read(r#"{"weight_sgma": 1}"#).unwrap_err().contains("weight_sgma"));
    }
}
