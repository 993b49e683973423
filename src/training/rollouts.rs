//! [`Rollouts`]: the simulations of a training, under its images.

use crate::base::Grid;
use crate::body::Body;
use crate::response::lesson::Example;

/// A training image as a gait sees it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Image {
    /// Pixels at the voxels.
    pub(crate) stimulus: Grid<f64>,
    /// Its class.
    pub(crate) class: u8,
    /// Its widths, its correct side and its weight.
    pub(crate) example: Example,
    /// Number of its condition, from 0.
    pub(crate) condition: usize,
}

/// A simulator of designs.
pub(crate) trait Rollouts {
    /// Error of a simulation: it was stopped, or a file could not be written.
    type Error;
    /// Returns the displacements of a body under stimuli and conditions \[voxel lengths\]; `None`
    /// where it is unstable.
    ///
    /// # Errors
    /// Returns an error if it was stopped, or if a file cannot be written.
    fn roll(
        &mut self,
        body: &Body,
        stimuli: &[Grid<f64>],
        conditions: &[usize],
    ) -> Result<Vec<Option<f64>>, Self::Error>;
}
