//! [`Edits`]: single voxels in which a body differs from its network's description.

use crate::base::Grid;
use crate::body::{Body, MAX_SIDE, Material};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Voxels that differ from the description of a genome's network: a direct encoding on top of the
/// indirect one, for final touches that no change of a network makes alone (HybrID of Clune,
/// Beckmann, Pennock & Ofria, ECAL 2009). In files a list of `[row, column, material]`. Edits
/// outside a body's grid have no effect.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(
    try_from = "Vec<(usize, usize, Material)>",
    into = "Vec<(usize, usize, Material)>"
)]
pub(crate) struct Edits(pub(super) BTreeMap<(usize, usize), Material>);

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum EditError {
    #[error("edits: row {0}, column {1}: bodies have at most {MAX_SIDE} rows and columns")]
    Place(usize, usize),
    #[error("edits: row {0}, column {1} is there twice")]
    Twice(usize, usize),
    #[error("edits: row {0}, column {1}: {2} is no material that evolves; expected 0…6")]
    Material(usize, usize, u8),
}

impl Edits {
    /// Returns true if the body is exactly the network's.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Makes the voxel at (row, column) of `material`, where the network has `described`.
    pub(super) fn set(&mut self, place: (usize, usize), material: Material, described: Material) {
        if material == described {
            self.0.remove(&place);
        } else {
            self.0.insert(place, material);
        }
    }

    pub(super) fn apply(&self, described: &Body) -> Grid<Material> {
        let voxels = described.voxels();
        Grid::from_fn(voxels.height(), voxels.width(), |row, column| {
            self.0
                .get(&(row, column))
                .copied()
                .unwrap_or(voxels[(row, column)])
        })
    }

    /// Returns bytes that are the same for equal edits, and only for those.
    pub(super) fn canonical_bytes(&self) -> Vec<u8> {
        // Rows and columns are below MAX_SIDE.
        self.0
            .iter()
            .flat_map(|((row, column), material)| [*row as u8, *column as u8, material.code()])
            .collect()
    }
}

impl TryFrom<Vec<(usize, usize, Material)>> for Edits {
    type Error = EditError;
    fn try_from(list: Vec<(usize, usize, Material)>) -> Result<Self, EditError> {
        let mut edits = BTreeMap::new();
        for (row, column, material) in list {
            if row >= MAX_SIDE || column >= MAX_SIDE {
                return Err(EditError::Place(row, column));
            }
            if material.is_actuator() {
                return Err(EditError::Material(row, column, material.code()));
            }
            if edits.insert((row, column), material).is_some() {
                return Err(EditError::Twice(row, column));
            }
        }
        Ok(Edits(edits))
    }
}

impl From<Edits> for Vec<(usize, usize, Material)> {
    fn from(edits: Edits) -> Self {
        edits
            .0
            .into_iter()
            .map(|((row, column), material)| (row, column, material))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Edits, String> {
        serde_json::from_str(text).map_err(|error| error.to_string())
    }

    #[test]
    fn edits_replace_what_the_network_describes() {
        let described: Body = "012/345".parse().unwrap();
        let edits = read("[[1,2,6],[0,0,3],[40,0,1]]").unwrap();
        assert_eq!(
            Body::new(edits.apply(&described)).unwrap().to_string(),
            "312\n346"
        );
        assert_eq!(
            Body::new(Edits::default().apply(&described)).unwrap(),
            described
        );
    }

    #[test]
    fn what_is_as_described_is_no_edit() {
        let mut edits = Edits::default();
        edits.set((1, 2), Material::Rigid, Material::Soft);
        assert_eq!(edits.0.len(), 1);
        edits.set((1, 2), Material::Soft, Material::Soft);
        assert!(edits.is_empty());
    }

    #[test]
    fn files_hold_them_in_one_order_and_nonsense_is_refused_with_its_place() {
        let edits = read("[[1,2,6],[0,0,3]]").unwrap();
        assert_eq!(serde_json::to_string(&edits).unwrap(), "[[0,0,3],[1,2,6]]");
        assert_eq!(edits.canonical_bytes(), [0, 0, 3, 1, 2, 6]);
        assert!(
            read("[[1,2,6],[1,2,3]]")
                .unwrap_err()
                .contains("row 1, column 2 is there twice")
        );
        assert!(read("[[64,2,6]]").unwrap_err().contains("row 64, column 2"));
        assert!(read("[[1,2,9]]").unwrap_err().contains('9'));
        let actuator = read("[[1,2,7]]").unwrap_err();
        assert!(actuator.contains("row 1, column 2: 7 is no material that evolves"));
    }
}
