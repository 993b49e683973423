//! [`MutationParams`]: sizes and frequencies of mutations.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// Sizes of mutations: section `[genome]` of a config (paper, section "Genome").
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MutationParams {
    /// Standard deviation of a weight's mutation. Default 0.5, the paper's.
    ///
    /// Sizes are above 0, and at most 1000.
    #[serde(deserialize_with = "size")]
    pub(crate) weight_sigma: f64,
    /// Limit to which a changed weight is clipped. Default 1, the paper's.
    #[serde(deserialize_with = "size")]
    pub(crate) weight_limit: f64,
    /// Absolute weight of an added edge; its sign is random. Default 0.1, the paper's.
    #[serde(deserialize_with = "size")]
    pub(crate) new_edge_weight: f64,
    /// Share of offspring in which voxels mutate instead of the network. Default 0, the paper's.
    ///
    /// A mutated network seldom changes one voxel alone.
    /// The genome keeps them as [`Edits`](crate::genome::Edits) (after HybrID, Clune et al. 2009).
    /// Files omit the default.
    #[schemars(range(min = 0, max = 1))]
    #[serde(deserialize_with = "share", skip_serializing_if = "is_zero")]
    pub(crate) voxel_mutations: f64,
    /// Most voxels of an offspring that mutate: 1, 2, 4 … with equal probability. Default 1.
    ///
    /// Files omit the default.
    #[schemars(range(min = 1, max = MAX_CHANGES))]
    #[serde(deserialize_with = "changes", skip_serializing_if = "is_one")]
    pub(crate) voxel_changes: u16,
}

impl Default for MutationParams {
    fn default() -> Self {
        MutationParams {
            weight_sigma: 0.5,
            weight_limit: 1.0,
            new_edge_weight: 0.1,
            voxel_mutations: 0.0,
            voxel_changes: 1,
        }
    }
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn is_one(value: &u16) -> bool {
    *value == 1
}

/// Most voxels that change at once: more than the paper's bodies have.
const MAX_CHANGES: u16 = 1000;

fn changes<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u16, D::Error> {
    let value = u16::deserialize(deserializer)?;
    if (1..=MAX_CHANGES).contains(&value) {
        return Ok(value);
    }
    let text = format!("{value} is out of range; expected a number from 1 to {MAX_CHANGES}");
    Err(serde::de::Error::custom(text))
}

/// Reads a number from 0 to 1.
fn share<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let value = f64::deserialize(deserializer)?;
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    Err(serde::de::Error::custom(format!(
        "{value} is out of range; expected a number from 0 to 1"
    )))
}

fn size<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let value = f64::deserialize(deserializer)?;
    if value > 0.0 && value <= 1000.0 {
        return Ok(value);
    }
    Err(serde::de::Error::custom(format!(
        "{value} is out of range; expected a number above 0, at most 1000"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_have_the_papers_defaults_and_refuse_nonsense() {
        let read =
            |text: &str| serde_json::from_str::<MutationParams>(text).map_err(|e| e.to_string());
        assert_eq!(read("{}").unwrap(), MutationParams::default());
        assert_eq!(read(r#"{"weight_sigma": 0.2}"#).unwrap().weight_sigma, 0.2);
        assert!(
            read(r#"{"weight_sigma": -1}"#)
                .unwrap_err()
                .contains("-1 is out of range")
        );
        assert!(
            read(r#"{"voxel_mutations": 1.01}"#)
                .unwrap_err()
                .contains("1.01 is out of range")
        );
        assert!(
            read(r#"{"voxel_changes": 1001}"#)
                .unwrap_err()
                .contains("1001 is out of range")
        );
        assert!(
            !serde_json::to_string(&MutationParams::default())
                .unwrap()
                .contains("voxel")
        );
        assert!(
            read(r#"{"weight_sgma": 1}"#)
                .unwrap_err()
                .contains("weight_sgma")
        );
    }
}
