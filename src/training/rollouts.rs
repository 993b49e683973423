//! [`Rollouts`]: the simulations of a training, under its images.

use crate::base::Grid;
use crate::body::Body;
use crate::response::design_problem::Example;

/// A training image as a gait sees it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Image {
    pub(crate) stimulus: Grid<f64>,
    pub(crate) class: u8,
    /// Its widths, its correct side and its weight.
    pub(crate) example: Example,
    /// Number of its condition, from 0.
    pub(crate) condition: usize,
}

/// Simulates designs; tests plant a body whose response they know.
pub(crate) trait Rollouts {
    type Error;
    /// Returns a body's displacements under stimuli and conditions \[voxel lengths\]; `None`:
    /// unstable.
    fn roll(
        &mut self,
        body: &Body,
        stimuli: &[Grid<f64>],
        conditions: &[usize],
    ) -> Result<Vec<Option<f64>>, Self::Error>;
}
